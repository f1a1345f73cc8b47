//! Recorded runs fed back through the controller.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use syncline_controller::bus_log::candump::Line;
use tempfile::TempDir;

const SYNCLINE: &str = env!("CARGO_BIN_EXE_syncline");
const MACHINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/portal/machine.toml"
);
/// Rests before, between and behind motions, of which no frame tells how long they last.
const PROGRAM: &str = "\
G21 G61 G4 P0.1
G1 F12000 X60 Y30
M0
G4 P0.1
G1 X20 Y10 Z-10
M0
M0
G0 X0 Y0 Z0
M2
";

struct Recorded {
    folder: TempDir,
    machine: PathBuf,
    program: PathBuf,
    log: PathBuf,
}

impl Recorded {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let machine = file("machine.toml", &fs::read_to_string(MACHINE).unwrap());
        let program = file("program.ngc", PROGRAM);
        let log = folder.path().join("log");
        Self {
            folder,
            machine,
            program,
            log,
        }
    }

    fn command(&self, name: &str) -> Command {
        let mut command = Command::new(SYNCLINE);
        command.arg(name);
        if name == "replay" {
            command.arg(&self.log);
        }
        command.args([&self.machine, &self.program]);
        if name != "replay" {
            command.arg("--candump").arg(&self.log);
        }
        if name == "run" {
            command.arg("--wait-for-plan");
        }
        command
    }

    fn validated() -> Self {
        let recorded = Self::new();
        let (code, text) = ended(&recorded.command("validate").output().unwrap());
        assert_eq!(code, 0, "{text}");
        recorded
    }

    fn replay(&self) -> (i32, String) {
        ended(&self.command("replay").output().unwrap())
    }

    /// Replays the log as `change` leaves its lines.
    fn replay_with(&self, change: impl FnOnce(&mut Vec<String>)) -> (i32, String) {
        let text = fs::read_to_string(&self.log).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        change(&mut lines);
        let changed = self.folder.path().join("changed");
        fs::write(&changed, lines.join("\n") + "\n").unwrap();
        replay(&changed, &self.machine, &self.program)
    }

    /// Frames that only the controller sends.
    fn own(&self) -> usize {
        let text = fs::read_to_string(&self.log).unwrap();
        let ids = text
            .lines()
            .map(|line| Line::parse(line).unwrap().frame.id());
        ids.filter(|id| {
            let id = id.raw();
            matches!(id, 0x000 | 0x080 | 0x77F | 0x301..=0x304 | 0x601..=0x604)
        })
        .count()
    }
}

fn replay(log: &Path, machine: &Path, program: &Path) -> (i32, String) {
    let mut command = Command::new(SYNCLINE);
    ended(
        &command
            .arg("replay")
            .args([log, machine, program])
            .output()
            .unwrap(),
    )
}

fn ended(output: &Output) -> (i32, String) {
    let text = [&output.stdout[..], &output.stderr].concat();
    (
        output.status.code().unwrap(),
        String::from_utf8(text).unwrap(),
    )
}

fn assert_same(recorded: &Recorded, end: &str) {
    let (code, text) = recorded.replay();
    assert_eq!(code, 0, "{text}");
    let same = format!(
        "the same           {} frames of the controller\n",
        recorded.own()
    );
    assert!(text.contains(&same), "{same}{text}");
    assert!(
        text.contains(&format!("the run's end      {end}\n")),
        "{text}"
    );
}

#[test]
fn a_validated_run_is_sent_again_bit_for_bit() {
    let recorded = Recorded::validated();
    assert_same(&recorded, "program finished");

    // Cut off, it is the same as far as it goes.
    let (code, text) = recorded.replay_with(|lines| lines.truncate(lines.len() / 2));
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("the log ends before the run does"), "{text}");

    // In the middle of a frame, too.
    let text = fs::read_to_string(&recorded.log).unwrap();
    let cut = text.len() / 2 + text[text.len() / 2..].find('#').unwrap() + 4;
    fs::write(&recorded.log, &text[..cut]).unwrap();
    let (code, text) = recorded.replay();
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("the last line is cut off"), "{text}");
}

/// A second run in the log is compared with nothing: that is no success.
#[test]
fn what_is_not_compared_is_told() {
    let recorded = Recorded::validated();
    let (code, text) = recorded.replay_with(|lines| {
        let again = lines.clone();
        lines.extend(again.iter().map(|line| line.replacen("(00", "(01", 1)));
    });
    assert_eq!(code, 2, "{text}");
    assert!(text.contains("program finished"), "{text}");
    assert!(
        text.contains("behind the run's end is not compared"),
        "{text}"
    );
}

/// A log that was cut off behind its first frame says nothing of a run, and is no run that is the same.
#[test]
fn a_log_of_which_nothing_is_compared_is_refused() {
    let recorded = Recorded::validated();
    for frames in [1, 5] {
        let (code, text) = recorded.replay_with(|lines| lines.truncate(frames));
        assert_eq!(code, 2, "{text}");
        assert!(text.contains("nothing is compared"), "{text}");
    }
    let (code, text) = recorded.replay_with(|lines| lines.truncate(30));
    assert_eq!(code, 0, "{text}");
}

#[test]
fn what_differs_is_told_with_its_place() {
    let recorded = Recorded::validated();
    let nth = |lines: &[String], id: &str, number: usize| {
        let mut places = (0..lines.len()).filter(|&place| lines[place].contains(id));
        places.nth(number).unwrap()
    };

    // One bit of a setpoint.
    let mut stamp = String::new();
    let (code, text) = recorded.replay_with(|lines| {
        let place = nth(lines, " 303#", 400);
        let last = lines[place].pop().unwrap();
        lines[place].push(if last == '0' { '1' } else { '0' });
        stamp = lines[place][1..18].trim_start_matches('0').to_owned();
    });
    assert_eq!(code, 1, "{text}");
    assert!(
        text.contains(&format!("at {stamp}, bus portal, cycle ")),
        "{stamp}: {text}"
    );
    for told in [
        "the log has      303#",
        "syncline sends   303#",
        "node 3 R_PDO2: DCOMcontrol 31 (001Fh), IPp_target",
        "a plan that came late",
    ] {
        assert!(text.contains(told), "{told}: {text}");
    }

    // A frame that is gone, one that nobody sends.
    let (code, text) = recorded.replay_with(|lines| {
        let place = nth(lines, " 602#", 20);
        lines.remove(place);
    });
    assert_eq!(code, 1, "{text}");
    let (code, text) = recorded.replay_with(|lines| {
        let place = nth(lines, " 304#", 300);
        let stranger = lines[place].replace(" 304#", " 000#");
        lines.insert(
            place + 1,
            stranger[..stranger.find('#').unwrap()].to_owned() + "#8002",
        );
    });
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("the log has      000#8002"), "{text}");
    assert!(text.contains("syncline sends   nothing"), "{text}");

    // Another actual position while setpoints follow it, another machine, another program.
    let (code, text) = recorded.replay_with(|lines| {
        let place = nth(lines, " 282#", 4);
        let last = lines[place].pop().unwrap();
        lines[place].push(if last == '0' { '1' } else { '0' });
    });
    assert_eq!(code, 1, "{text}");
    for (file, from, to) in [
        ("machine.toml", "max_jerk = 60_000.0", "max_jerk = 60_001.0"),
        ("program.ngc", "X60", "X60.001"),
    ] {
        let changed = Recorded::new();
        fs::copy(&recorded.log, &changed.log).unwrap();
        let file = changed.folder.path().join(file);
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&file, text.replace(from, to)).unwrap();
        let (code, text) = changed.replay();
        assert_eq!(code, 1, "{text}");
    }

    // What cannot be replayed at all.
    for (lines, why) in [
        (vec!["(1.0) portal 281#00"], "no SYNC"),
        (vec!["(1.0) other 080#"], "--bus BUS=INTERFACE"),
        (
            vec!["(1.0) portal 080#", "(1.1) portal 77F#05"],
            "begins in the middle of a run",
        ),
        (vec!["(1.0) portal 80#"], "changed:1: the identifier"),
    ] {
        let (code, text) = recorded.replay_with(|log| {
            *log = lines.into_iter().map(str::to_owned).collect();
        });
        assert_eq!(code, 2, "{text}");
        assert!(text.contains(why), "{why}: {text}");
    }
}

#[test]
fn a_run_on_two_buses_is_sent_again() {
    let recorded = Recorded::new();
    let mut text = fs::read_to_string(&recorded.machine).unwrap();
    // Another bit rate: the ends of frames do not fall together.
    let second = "[[bus]]\nname = \"second\"\nbitrate = 500_000\nport = \"sim\"\n\n[[drive]]";
    text = text.replacen("[[drive]]", second, 1);
    let named = "name = \"Z\"\nbus = ";
    assert!(text.contains(named));
    text = text.replace(&format!("{named}\"portal\""), &format!("{named}\"second\""));
    fs::write(&recorded.machine, text).unwrap();
    let (code, text) = ended(&recorded.command("validate").output().unwrap());
    assert_eq!(code, 0, "{text}");
    assert_same(&recorded, "program finished");

    let (code, text) = recorded.replay_with(|lines| {
        let mut setpoints = lines
            .iter_mut()
            .filter(|line| line.contains(" second 304#"));
        let line = setpoints.nth(400).unwrap();
        let last = line.pop().unwrap();
        line.push(if last == '0' { '1' } else { '0' });
    });
    assert_eq!(code, 1, "{text}");
    assert!(text.contains(", bus second, cycle "), "{text}");
    assert!(text.contains("the log has      304#"), "{text}");
}

/// Persons go on when they like, and break off in mid-motion.
#[test]
fn a_run_with_pauses_and_an_interruption_is_sent_again() {
    let recorded = Recorded::new();
    let start = || {
        let mut run = recorded.command("run");
        run.stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        run.spawn().unwrap()
    };
    let mut child = start();
    let mut person = child.stdin.take().unwrap();
    let wait = || std::thread::sleep(Duration::from_millis(37));
    while child.try_wait().unwrap().is_none() {
        wait();
        // It may have ended just now.
        let _ = person.write_all(b"\n");
    }
    assert_same(&recorded, "program finished");

    fs::write(&recorded.program, "G21 G1 F6000 X1000 Y500\nM2\n").unwrap();
    fs::remove_file(&recorded.log).unwrap();
    let mut child = start();
    let moving = |text: String| text.matches(" 301#1F00").count() > 400;
    while !moving(fs::read_to_string(&recorded.log).unwrap_or_default()) {
        wait();
    }
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_same(&recorded, "interrupted by a stop");
    assert!(recorded.replay().1.contains("interrupted        in cycle "));
}

/// Lines, arcs and rounded corners, a program stop and one that is optional.
const ACTED: &str = "\
G17 G21 G64 P0.1
G1 F9000 X60 Y30
G3 X100 Y70 I0 J40
G1 Y90 Z-10
M0
G61 X60
M1
G2 X20 Y50 I0 J-40
G1 X0 Y0 Z0
M2
";

/// Whatever operators can do; the program is held at the jogs.
const EVENTS: &str = "\
t_s,event,value
0.02,optional_stop,on
0.1,feed_override,50
0.3,feed_override,130
0.4,rapid_override,40
0.5,feed_hold,
0.9,jog,X+1.5
1.0,jog,Z-
1.1,feed_hold,
1.3,jog_to,X70 Y31
1.6,move_to,X69 Y32 Z0
2.0,resume,
2.3,feed_hold,
2.301,resume,
2.5,retrace,
3.6,resume,
4.0,single_block,on
5.5,resume,
7.0,single_block,off
7.0,resume,
7.1,feed_override,0
7.4,feed_override,100
";

impl Recorded {
    /// A validated run in which operators act, with the log of what they commanded.
    fn acted() -> Self {
        let recorded = Self::new();
        fs::write(&recorded.program, ACTED).unwrap();
        let events = recorded.folder.path().join("events.csv");
        fs::write(&events, EVENTS).unwrap();
        let mut validate = recorded.command("validate");
        validate.arg("--events").arg(&events);
        validate.arg("--commands").arg(recorded.commands());
        let (code, text) = ended(&validate.output().unwrap());
        assert_eq!(code, 0, "{text}");
        recorded
    }

    fn commands(&self) -> PathBuf {
        self.folder.path().join("commands")
    }

    fn replay_acted(&self) -> (i32, String) {
        let mut replay = self.command("replay");
        replay.arg("--commands").arg(self.commands());
        ended(&replay.output().unwrap())
    }

    /// Replays the run with the commands as `change` leaves their lines.
    fn replay_commanded(&self, change: impl FnOnce(&mut Vec<String>)) -> (i32, String) {
        let was = fs::read_to_string(self.commands()).unwrap();
        let mut lines: Vec<String> = was.lines().map(str::to_owned).collect();
        change(&mut lines);
        fs::write(self.commands(), lines.join("\n") + "\n").unwrap();
        let replayed = self.replay_acted();
        fs::write(self.commands(), was).unwrap();
        replayed
    }
}

#[test]
fn a_session_in_which_operators_acted_is_sent_again_bit_for_bit() {
    let recorded = Recorded::acted();
    let log = fs::read_to_string(recorded.commands()).unwrap();
    let count = |what: &str| log.lines().filter(|line| line.contains(what)).count();
    assert_eq!(
        count(r#""source":"events""#),
        EVENTS.lines().count() - 1,
        "{log}"
    );
    assert_eq!(
        count(r#""source":"validate","command":"cycle_start""#),
        2,
        "{log}"
    );
    let (code, text) = recorded.replay_acted();
    assert_eq!(code, 0, "{text}");
    let same = format!("the same           {} frames", recorded.own());
    assert!(text.contains(&same), "{same}{text}");
    assert!(
        text.contains("the run's end      program finished"),
        "{text}"
    );

    // From the frames alone it cannot be told.
    let (code, text) = recorded.replay();
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("which --commands has"), "{text}");
}

#[test]
fn a_log_of_commands_that_was_tampered_with_is_found() {
    let recorded = Recorded::acted();
    let place = |lines: &[String], what: &str| {
        let found = lines.iter().position(|line| line.contains(what));
        found.unwrap_or_else(|| panic!("{what}: {lines:?}"))
    };
    type Change = fn(&mut Vec<String>, usize);
    let changes: [(&str, Change); 6] = [
        (r#"{"feed_override":{"to":50.0}}"#, |lines, at| {
            lines.remove(at);
        }),
        (r#"{"feed_override":{"to":130.0}}"#, |lines, at| {
            lines[at] = lines[at].replace("130.0", "130.1");
        }),
        (r#""feed_hold""#, |lines, at| {
            let later = lines[at].find(",").unwrap();
            let cycle: u64 = lines[at][9..later].parse().unwrap();
            lines[at] = format!("{{\"cycle\":{}{}", cycle + 1, &lines[at][later..]);
        }),
        (r#""distance":1.5"#, |lines, at| {
            lines[at] = lines[at].replace("1.5", "1.4");
        }),
        (r#""retrace""#, |lines, at| {
            lines[at] = lines[at].replace("retrace", "feed_hold");
        }),
        (r#""cycle_start""#, |lines, at| {
            lines.remove(at);
        }),
    ];
    for (what, change) in changes {
        let (code, text) = recorded.replay_commanded(|lines| change(lines, place(lines, what)));
        assert_eq!(code, 1, "{what}: {text}");
        assert!(text.contains("FIRST DIFFERENCE"), "{what}: {text}");
    }
    let (code, text) = recorded.replay_commanded(|lines| {
        lines.push(r#"{"cycle":1000000,"source":"keys","command":"feed_hold"}"#.to_owned());
    });
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("1 commands from cycle 1000000 on"), "{text}");

    for (line, told) in [
        ("{\"cycle\":1", "commands:1: no command"),
        (
            r#"{"cycle":1,"source":"keys","command":"hop"}"#,
            "unknown variant `hop`",
        ),
        (
            "{\"cycle\":9,\"source\":\"a\",\"command\":\"retrace\"}\n\
             {\"cycle\":8,\"source\":\"a\",\"command\":\"retrace\"}",
            "commands:2: cycle 8 comes behind cycle 9",
        ),
    ] {
        let (code, text) = recorded.replay_commanded(|lines| lines.insert(0, line.to_owned()));
        assert_eq!(code, 2, "{text}");
        assert!(text.contains(told), "{told}: {text}");
    }
}

/// In real time, on an arc, where the way to rest is the planner's.
#[test]
fn a_run_that_is_interrupted_on_an_arc_is_sent_again() {
    let recorded = Recorded::new();
    fs::write(
        &recorded.program,
        "G21 G17 G0 X200 Y300\nG3 F6000 X200 Y300 I200 P3\nM2\n",
    )
    .unwrap();
    let mut run = recorded.command("run");
    run.arg("--commands").arg(recorded.commands());
    run.stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut child = run.spawn().unwrap();
    let moving = |text: String| text.matches(" 301#1F00").count() > 900;
    while !moving(fs::read_to_string(&recorded.log).unwrap_or_default()) {
        assert!(child.try_wait().unwrap().is_none(), "it ended");
        std::thread::sleep(Duration::from_millis(37));
    }
    let id = child.id().to_string();
    let killed = Command::new("kill").args(["-INT", &id]).status();
    assert!(killed.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let (code, text) = recorded.replay_acted();
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("interrupted by a stop"), "{text}");
}

impl Recorded {
    /// The session of a console that is given these lines, with the log of what took effect.
    fn attended(lines: &str) -> Self {
        let recorded = Self::new();
        let mut console = Command::new(SYNCLINE);
        console
            .args(["console", "--lines", "--wait-for-plan"])
            .arg(&recorded.machine);
        console.arg("--candump").arg(&recorded.log);
        console.arg("--commands").arg(recorded.commands());
        console
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut console = console.spawn().unwrap();
        let mut input = console.stdin.take().unwrap();
        input.write_all(lines.as_bytes()).unwrap();
        drop(input);
        let (code, text) = ended(&console.wait_with_output().unwrap());
        assert_eq!(code, 0, "{text}");
        recorded
    }

    fn replay_attended(&self) -> (i32, String) {
        let mut replay = Command::new(SYNCLINE);
        replay.arg("replay").args([&self.log, &self.machine]);
        replay.arg("--commands").arg(self.commands());
        ended(&replay.output().unwrap())
    }
}

/// Several jobs: each begins with the offsets, the tool and the modes that those before it have left, and
/// with tables that the session itself has written.
#[test]
fn a_day_at_the_console_is_sent_again_bit_for_bit() {
    let lines = "\
        mdi G0 X5\nwait\njog X+10\nset_offset X0 Y0\nmdi G91 G1 X5 F6000\nmdi X5\nmdi T1 M6\nwait\ncycle_start\n\
        set_tool_length Z3\nwait\ndisable\nwait\nenable\nwait\nload PROGRAM\nfeed_override 80\nrun\n\
        wait\ncycle_start\nwait\ncycle_start\nwait\ncycle_start\nwait\n";
    let program = Recorded::new();
    let lines = lines.replace("PROGRAM", program.program.to_str().unwrap());
    let recorded = Recorded::attended(&lines);
    let log = fs::read_to_string(recorded.commands()).unwrap();
    for taken in [
        r#"{"tables":""}"#,
        r#""command":{"mdi":"X5"}"#,
        r#"{"set_work_offset":[0.0,0.0,"#,
        r#""enable""#,
        r#"{"run":{"from_line":null}}"#,
    ] {
        assert!(log.contains(taken), "{taken}: {log}");
    }
    assert!(recorded.folder.path().join("machine.tables.toml").exists());
    let (code, text) = recorded.replay_attended();
    assert_eq!(code, 0, "{text}");
    let same = format!("the same           {} frames", recorded.own());
    assert!(text.contains(&same), "{same}{text}");
    assert!(text.contains("the run's end      switched off"), "{text}");

    // Without the tables with which it began it is another session.
    fs::write(recorded.commands(), log.replace("{\"tables\":\"\"}\n", "")).unwrap();
    let (code, text) = recorded.replay_attended();
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("FIRST DIFFERENCE"), "{text}");
}
