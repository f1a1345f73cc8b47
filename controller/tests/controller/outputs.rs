//! What commands write: tried before anything else happens, never two things into one file, and
//! nothing lost where a command then refuses to begin. Exit codes mean the same in all commands.

use crate::outside::{SYNCLINE, root};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use syncline_controller::bus_log::candump::Line;
use syncline_controller::campaign::Case;
use tempfile::TempDir;

/// A folder with a short program, which every command here runs in.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(TempDir::new().unwrap());
        let machine = root().join("examples/portal/machine.toml");
        fs::copy(machine, place.path().join("portal.toml")).unwrap();
        fs::write(place.path().join("short.ngc"), "G0 X1\nM2\n").unwrap();
        place
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// Exit code, standard output, standard error.
    fn run(&self, arguments: &str) -> (i32, String, String) {
        self.play(Command::new(SYNCLINE), arguments)
    }

    /// The same with 256 MiB of memory at most.
    fn run_in_little(&self, arguments: &str) -> (i32, String, String) {
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -d 262144; exec \"$0\" \"$@\"", SYNCLINE]);
        self.play(command, arguments)
    }

    fn play(&self, mut command: Command, arguments: &str) -> (i32, String, String) {
        command.current_dir(self.path());
        let output = (command.args(arguments.split_whitespace()).output()).unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let code = output.status.code().unwrap();
        (code, text(output.stdout), text(output.stderr))
    }

    /// Refused as bad input, in these words, with nothing printed.
    fn refused(&self, arguments: &str, told: &str) {
        let expected = (2, String::new(), format!("error: {told}\n"));
        assert_eq!(self.run(arguments), expected, "{arguments}");
    }

    /// What is in it, besides machine and program.
    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.path()).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names
            .filter(|name| !["portal.toml", "short.ngc"].contains(&&**name))
            .collect();
        names.sort();
        names
    }
}

const RUN: &str = "run portal.toml short.ngc";
const VALIDATE: &str = "validate portal.toml short.ngc";

#[test]
fn standard_output_takes_one_file() {
    let place = Place::new();
    let both = |a: &str, b: &str| {
        format!("{a} and {b} both go to standard output: give one of them a file")
    };
    for command in [RUN, VALIDATE] {
        for (a, b) in [
            ("--json", "--candump"),
            ("--trace", "--report"),
            ("--candump", "--pcapng"),
        ] {
            place.refused(&format!("{command} {a} - {b} -"), &both(a, b));
        }
    }
    let record = "record --bus nocan17 --candump - --pcapng -";
    place.refused(record, &both("--candump", "--pcapng"));
    let report = "bench plan --steps 20 --report -";
    place.refused(report, &both("what is printed", "--report"));
    assert_eq!(place.files(), [""; 0]);
}

/// Whatever has standard output has it for itself.
#[test]
fn what_is_on_standard_output_is_nothing_else() {
    let place = Place::new();
    let (code, log, told) = place.run(&format!("{VALIDATE} --candump -"));
    assert_eq!(code, 0, "{told}");
    assert!(told.contains("pass"), "{told}");
    assert!(log.lines().count() > 100);
    for line in log.lines() {
        assert!(Line::parse(line).is_ok(), "{line}");
    }
    let (_, trace, told) = place.run(&format!("{VALIDATE} --trace -"));
    assert!(told.contains("pass"), "{told}");
    let columns = |line: &str| line.split(',').count();
    assert!(trace.lines().all(|line| columns(line) == 16), "{trace}");
    let (_, page, _) = place.run(&format!("{VALIDATE} --report -"));
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    let (_, json, told) = place.run(&format!("{VALIDATE} --json -"));
    assert_eq!(told, "", "the JSON says it");
    assert!(json.starts_with("{\n") && json.ends_with("}\n"), "{json}");
    assert_eq!(place.files(), [""; 0]);
}

#[test]
fn every_file_is_for_one_thing() {
    let place = Place::new();
    let program = fs::read(place.path().join("short.ngc")).unwrap();
    for command in [RUN, VALIDATE] {
        place.refused(
            &format!("{command} --json out --candump ./out"),
            "--json and --candump are both ./out: give each a file of its own",
        );
        place.refused(
            &format!("{command} --trace short.ngc"),
            "the program and --trace are both short.ngc: give each a file of its own",
        );
        place.refused(
            &format!("{command} --report portal.toml"),
            "the machine file and --report are both portal.toml: give each a file of its own",
        );
    }
    fs::write(place.path().join("cases.csv"), "id,sync\n").unwrap();
    let (code, _, _) = place.run("plan cases.csv --out cases.csv");
    let cases = fs::read_to_string(place.path().join("cases.csv")).unwrap();
    assert_eq!((code, &*cases), (2, "id,sync\n"));
    let (code, _, told) = place.run(&format!("{VALIDATE} --json /dev/null --trace /dev/null"));
    assert_eq!(code, 0, "{told}");
    assert_eq!(fs::read(place.path().join("short.ngc")).unwrap(), program);
    assert_eq!(place.files(), ["cases.csv"]);
}

/// A file that cannot be written is told before anything is done, and nothing is left of the others.
#[test]
fn files_are_tried_first() {
    let place = Place::new();
    let wrong = "nowhere/file";
    let told = "cannot write nowhere/file: No such file or directory (os error 2)";
    let options = ["--json", "--trace", "--report", "--candump", "--pcapng"];
    for wrong_one in options {
        let files = options.map(|option| {
            let file = if option == wrong_one { wrong } else { option };
            format!("{option} ./{file}")
        });
        let told = "cannot write ./nowhere/file: No such file or directory (os error 2)";
        for command in [RUN, VALIDATE] {
            place.refused(&format!("{command} {}", files.join(" ")), told);
        }
    }
    for option in ["--candump", "--pcapng"] {
        place.refused(&format!("record --bus nocan17 {option} {wrong}"), told);
    }
    for what in ["cycle --duration 2s", "bus", "plant", "plan"] {
        place.refused(&format!("bench {what} --report {wrong}"), told);
        let (code, printed, complaint) = place.run(&format!("bench {what} --hgrm {wrong}"));
        assert_eq!((code, &*printed), (2, ""), "{what}: {complaint}");
        assert!(complaint.starts_with("error: cannot write nowhere/file-"));
    }
    // One of several tables is a folder.
    fs::create_dir(place.path().join("t-send.hgrm")).unwrap();
    let (code, printed, complaint) = place.run("bench cycle --duration 2s --hgrm t");
    assert_eq!((code, &*printed), (2, ""), "{complaint}");
    assert!(complaint.starts_with("error: cannot write t-send.hgrm: "));
    assert_eq!(place.files(), ["t-send.hgrm"]);
}

/// A command that does not begin leaves files as they were.
#[test]
fn a_refusal_costs_no_file() {
    let place = Place::new();
    let there = ["a", "b", "c"];
    for name in there {
        fs::write(place.path().join(name), "worth keeping").unwrap();
    }
    for refused in [
        &format!("{RUN} --bus nocan17 --json a --trace b --candump c --report d --pcapng e"),
        "record --bus nocan17 --candump a --pcapng e",
        "bench cycle --bus nocan17 --report a --hgrm t",
    ] {
        let (code, printed, told) = place.run(refused);
        assert_eq!((code, &*printed), (2, ""), "{refused}: {told}");
        assert!(told.contains("nocan17"), "{refused}: {told}");
        assert_eq!(place.files(), there, "{refused}");
        for name in there {
            let text = fs::read_to_string(place.path().join(name)).unwrap();
            assert_eq!(text, "worth keeping", "{refused}: {name}");
        }
    }
}

/// A program that sets offsets is not run where they could not be saved.
#[test]
fn tables_that_cannot_be_saved() {
    let place = Place::new();
    fs::write(place.path().join("set.ngc"), "G10 L2 P2 X5\nM2\n").unwrap();
    let new = "portal.tables.toml.new";
    fs::create_dir(place.path().join(new)).unwrap();
    let told = format!("cannot write {new}: Is a directory (os error 21)");
    place.refused("run portal.toml set.ngc", &told);
    place.refused("run portal.toml set.ngc --stream", &told);
    let (code, _, told) = place.run("validate portal.toml set.ngc");
    assert_eq!(code, 0, "{told}");
    assert_eq!(place.files(), [new, "set.ngc"]);
    let tables = place.path().join("portal.tables.toml");
    fs::create_dir(tables).unwrap();
    let told = "cannot read portal.tables.toml: Is a directory (os error 21)";
    place.refused("run portal.toml short.ngc", told);
}

/// What cannot be read is bad input too, and told by its name.
#[test]
fn files_that_cannot_be_read() {
    let place = Place::new();
    fs::write(place.path().join("bytes"), b"(1.0) can0 181#37\n\xff\n").unwrap();
    let folder = "cannot read .: Is a directory (os error 21)";
    let bytes = "cannot read bytes: stream did not contain valid UTF-8";
    for (command, told) in [
        ("check .", folder),
        ("plan .", folder),
        ("monitor --log .", folder),
        ("replay . portal.toml short.ngc", folder),
        ("eds portal.toml 1 --compare .", folder),
        ("validate portal.toml short.ngc --events .", folder),
        ("check bytes", bytes),
        ("replay bytes portal.toml short.ngc --bus can0", bytes),
        (
            "eds portal.toml 1 --bus main",
            "portal.toml: no bus `main`, only portal",
        ),
    ] {
        place.refused(command, told);
    }
    let (code, _, told) = place.run("monitor --log bytes");
    assert_eq!((code, told), (2, format!("error: {bytes}\n")));
}

/// Neither a program that is called nor tables that are yet to be made are written over.
#[test]
fn inputs_are_not_written_over() {
    let place = Place::new();
    let called = "o<part> sub\nG0 X2\no<part> endsub\n";
    fs::write(place.path().join("part.ngc"), called).unwrap();
    fs::write(place.path().join("calls.ngc"), "o<part> call\nM2\n").unwrap();
    std::os::unix::fs::symlink("portal.tables.toml", place.path().join("link")).unwrap();
    for command in ["run", "validate"] {
        let command = format!("{command} portal.toml calls.ngc");
        place.refused(
            &format!("{command} --json part.ngc"),
            "a program that can be called and --json are both part.ngc: give each a file of its own",
        );
        for file in ["portal.tables.toml", "link"] {
            let told =
                format!("the tables and --json are both {file}: give each a file of its own");
            place.refused(&format!("{command} --json {file}"), &told);
            let _ = fs::remove_file(place.path().join("portal.tables.toml"));
        }
    }
    let kept = fs::read_to_string(place.path().join("part.ngc")).unwrap();
    assert_eq!(kept, called);
}

/// Nor is anything that a machine file names, or that an option has read, however its name is spelt.
#[test]
fn nothing_that_is_read_is_written_over() {
    let place = Place::new();
    let path = |name: &str| place.path().join(name);
    let example = root().join("examples/described");
    for name in ["servo.toml", "servo.eds"] {
        fs::copy(example.join(name), path(name)).unwrap();
    }
    let script = path("script").display().to_string();
    let machine = fs::read_to_string(example.join("machine.toml")).unwrap();
    let machine = format!(
        "{machine}\n[simulation]\nforces = \"forces.csv\"\n\n[[user_code]]\ncode = 100\ncommand = [\"/bin/sh\", \"{script}\"]\n"
    );
    fs::write(path("all.toml"), machine).unwrap();
    let forces = "path_mm,x_n,y_n,z_n\n0,0,0,0\n1,0,0,0\n";
    fs::write(path("forces.csv"), forces).unwrap();
    fs::write(&script, "exit 0\n").unwrap();
    fs::write(path("moves.csv"), "t,X\n0,0\n0.002,0\n0.004,0\n").unwrap();
    fs::write(path("at.events"), "t_s,event,value\n0,feed_override,50\n").unwrap();
    let vary = "method = \"grid\"\n[[vary]]\nkey = \"axis.X.max_jerk\"\nvalues = [30_000.0]\n";
    fs::write(path("vary.toml"), vary).unwrap();
    let case = serde_json::to_string(&Case::of(1)).unwrap();
    fs::write(path("case.json"), case).unwrap();
    fs::create_dir(path("sub")).unwrap();

    let by_machine = ["servo.toml", "servo.eds", "forces.csv", "script"];
    let mut cases: Vec<(&str, &str, &str, &str)> = Vec::new();
    for file in by_machine {
        let what = "a file that the machine file names";
        for (command, option) in [
            ("validate all.toml short.ngc", "--json"),
            ("validate all.toml short.ngc", "--trace"),
            ("validate all.toml short.ngc", "--report"),
            ("validate all.toml short.ngc", "--candump"),
            ("validate all.toml short.ngc", "--pcapng"),
            ("validate all.toml short.ngc", "--commands"),
            ("validate all.toml --events at.events", "--json"),
            ("validate all.toml --trajectory moves.csv", "--json"),
            ("run all.toml short.ngc", "--json"),
            ("run all.toml short.ngc", "--commands"),
            ("console all.toml --lines", "--candump"),
            ("sweep all.toml short.ngc --vary vary.toml", "--csv"),
            ("identify all.toml --axis X --rated-torque 1", "--json"),
            ("identify all.toml --axis X --rated-torque 1", "--write-log"),
            ("compare all.toml moves.csv --program short.ngc", "--json"),
        ] {
            cases.push((command, option, what, file));
        }
    }
    cases.extend([
        ("campaign --case case.json", "--json", "--case", "case.json"),
        (
            "campaign --case case.json",
            "--candump",
            "--case",
            "case.json",
        ),
        (
            "sweep all.toml short.ngc --vary vary.toml",
            "--csv",
            "--vary",
            "vary.toml",
        ),
        (
            "identify all.toml --axis X --rated-torque 1 --log moves.csv",
            "--json",
            "--log",
            "moves.csv",
        ),
        (
            "validate all.toml --trajectory moves.csv",
            "--json",
            "--trajectory",
            "moves.csv",
        ),
        (
            "validate all.toml short.ngc --events at.events",
            "--json",
            "--events",
            "at.events",
        ),
    ]);
    for (command, option, what, file) in cases {
        let before = fs::read(path(file)).unwrap();
        for link in ["link", "hard"] {
            let _ = fs::remove_file(path(link));
        }
        std::os::unix::fs::symlink(file, path("link")).unwrap();
        fs::hard_link(path(file), path("hard")).unwrap();
        let spelt = [
            file.to_owned(),
            format!("sub/../{file}"),
            path(file).display().to_string(),
            "link".to_owned(),
            "hard".to_owned(),
        ];
        for name in spelt {
            place.refused(
                &format!("{command} {option} {name}"),
                &format!("{what} and {option} are both {name}: give each a file of its own"),
            );
            assert_eq!(fs::read(path(file)).unwrap(), before, "{command} {option}");
        }
    }
}

/// A line that does not end is not read to its end, nor is a file.
#[test]
fn inputs_are_bounded() {
    let place = Place::new();
    let line = "a line of more than 65536 bytes";
    for (command, told) in [
        ("plan /dev/zero", &*format!("cannot read /dev/zero: {line}")),
        (
            "monitor --log /dev/zero",
            &format!("cannot read /dev/zero: {line}"),
        ),
        (
            "replay /dev/zero portal.toml short.ngc",
            &format!("cannot read /dev/zero: {line}"),
        ),
        (
            "eds --node 1:lxm32m --compare /dev/zero",
            "cannot read /dev/zero: more than 16777216 bytes: is it the right file?",
        ),
        (
            "validate portal.toml short.ngc --events /dev/zero",
            &format!("cannot read /dev/zero: {line}"),
        ),
        (
            "check /dev/zero",
            "cannot read /dev/zero: more than 1048576 bytes: is it the right file?",
        ),
    ] {
        place.refused(command, told);
    }
    let machine = place.path().join("portal.toml");
    let text = fs::read_to_string(&machine).unwrap();
    fs::write(&machine, format!("{text}\n# {}\n", "x".repeat(70_000))).unwrap();
    let told = format!(
        "cannot read portal.toml: line {} has more than 65536 bytes",
        text.lines().count() + 2
    );
    place.refused("check portal.toml", &told);
    fs::write(place.path().join("portal.tables.toml"), "#".repeat(70_000)).unwrap();
    fs::write(&machine, text).unwrap();
    place.refused(
        "check portal.toml",
        "cannot read portal.tables.toml: line 1 has more than 65536 bytes",
    );
}

/// Whatever a command reads may be a file that is longer than any memory: here 1 TiB of zeros, of which the disk has nothing.
#[test]
fn no_file_fills_the_memory() {
    let place = Place::new();
    let big = |name: &str| {
        let file = fs::File::create(place.path().join(name)).unwrap();
        file.set_len(1 << 40).unwrap();
    };
    let size = 1_u64 << 40;
    let whole = |file: &str, most: u64| {
        format!("cannot read {file}: it has {size} bytes, more than {most}: is it the right file?")
    };
    let by_lines = |file: &str| format!("cannot read {file}: a line of more than 65536 bytes");
    big("big");
    let (wholly, lines) = (whole("big", 16 << 20), by_lines("big"));
    let toml = whole("big", 1 << 20);
    let page = |command: &str, told: &str| {
        let (code, printed, found) = place.run_in_little(command);
        assert_eq!((code, &*printed), (2, ""), "{command}: {found}");
        assert!(found.contains(told), "{command}: {found}");
    };
    for (command, told) in [
        ("check big", &*toml),
        ("validate portal.toml short.ngc --tables big", &toml),
        ("validate portal.toml short.ngc --events big", &lines),
        ("validate portal.toml --trajectory big --step 0.001", &lines),
        ("compare a.csv b.csv", &by_lines("a.csv")),
        (
            "identify portal.toml --axis Y --rated-torque 1 --log big",
            &lines,
        ),
        ("campaign --case big", &wholly),
        ("campaign --merge big", &wholly),
        ("sweep portal.toml short.ngc --vary big", &toml),
        ("merge folder", &whole("folder/sweep.json", 16 << 20)),
        ("plan big", &lines),
        ("monitor --log big", &lines),
        ("replay big portal.toml short.ngc", &lines),
        ("eds --node 1:lxm32m --compare big", &wholly),
    ] {
        if let Some(name) = told
            .split(": ")
            .next()
            .and_then(|it| it.strip_prefix("cannot read "))
        {
            fs::create_dir_all(place.path().join("folder")).unwrap();
            big(name);
        }
        page(command, told);
    }
    let machine = fs::read_to_string(place.path().join("portal.toml")).unwrap();
    let forces = format!("{machine}\n[simulation]\nforces = \"big\"\n");
    fs::write(place.path().join("forces.toml"), forces).unwrap();
    page("check forces.toml", "big: a line of more than 65536 bytes");
    let example = root().join("examples/described");
    for name in ["machine.toml", "servo.toml"] {
        fs::copy(example.join(name), place.path().join(name)).unwrap();
    }
    big("servo.eds");
    page("check machine.toml", &whole("servo.eds", 4 << 20));
    big("servo.toml");
    page("check machine.toml", &whole("servo.toml", 1 << 20));
    big("portal.state.json");
    let state = whole("the machine's state, portal.state.json", 16 << 20);
    page("run portal.toml short.ngc", &state);
    fs::remove_file(place.path().join("portal.state.json")).unwrap();
    big("portal.tables.toml");
    page("check portal.toml", &whole("portal.tables.toml", 1 << 20));
    fs::remove_file(place.path().join("portal.tables.toml")).unwrap();
    big("short.ngc");
    let (code, _, told) = place.run_in_little("check portal.toml short.ngc");
    assert_eq!(code, 2, "{told}");
    assert!(told.contains("a line of more than 1048576 bytes"), "{told}");
}

/// A pipe without a reader is told of and given up; one that is read after a while is written.
#[test]
fn a_pipe_that_nobody_reads_is_no_end_of_waiting() {
    let place = Place::new();
    let made = Command::new("mkfifo")
        .arg(place.path().join("pipe"))
        .status();
    assert!(made.unwrap().success());
    let (code, printed, told) = place.run(&format!("{VALIDATE} --json pipe"));
    assert_eq!((code, &*printed), (2, ""), "{told}");
    assert!(told.starts_with("waits for a reader of pipe\n"), "{told}");
    assert!(told.contains("a pipe that nobody reads"), "{told}");

    let mut command = Command::new(SYNCLINE);
    let command = command.current_dir(place.path()).stderr(Stdio::piped());
    let trace = format!("{VALIDATE} --trace pipe");
    let mut written = command.args(trace.split_whitespace()).spawn().unwrap();
    let mut told = BufReader::new(written.stderr.take().unwrap()).lines();
    assert_eq!(told.next().unwrap().unwrap(), "waits for a reader of pipe");
    let trace = fs::read_to_string(place.path().join("pipe")).unwrap();
    assert!(written.wait().unwrap().success());
    assert!(trace.lines().count() > 50, "{trace}");
}

/// Whatever could not be printed is told, also where the answer alone would have been no.
#[test]
fn what_cannot_be_printed_is_told() {
    let place = Place::new();
    for command in ["doctor", "doctor --json", "check portal.toml"] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let mut syncline = Command::new(SYNCLINE);
        syncline.current_dir(place.path()).stdout(full);
        let output = syncline.args(command.split_whitespace()).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command}: {told}");
        assert!(
            told.contains("cannot write standard output"),
            "{command}: {told}"
        );
    }
}

/// Names do not command the terminal.
#[test]
fn control_characters_are_shown_not_obeyed() {
    let place = Place::new();
    let (code, _, told) = place.run("check \u{1b}[2J.toml");
    assert_eq!(code, 2);
    assert!(
        told.contains("\\u{1b}[2J.toml") && !told.contains('\u{1b}'),
        "{told:?}"
    );
}

/// A file that was longer before holds only what is new.
#[test]
fn files_are_replaced() {
    let place = Place::new();
    let names = ["a", "b", "c", "d", "e"];
    for name in names {
        fs::write(place.path().join(name), vec![b'#'; 9_000_000]).unwrap();
    }
    let all = "--json a --trace b --report c --candump d --pcapng e";
    let (code, printed, told) = place.run(&format!("{VALIDATE} {all}"));
    assert_eq!(code, 0, "{told}");
    assert!(printed.contains("pass"), "{printed}");
    for name in names {
        let bytes = fs::read(place.path().join(name)).unwrap();
        assert!(bytes.len() > 100 && !bytes.ends_with(b"##"), "{name}");
    }
}

/// A bus that is not there is bad input to every command.
#[test]
fn a_bus_that_is_not_there() {
    let place = Place::new();
    for command in [
        &format!("{RUN} --bus nocan17"),
        "bench cycle --bus nocan17 --duration 1s",
        "bench sync --bus nocan17 --duration 1s",
        "drives portal.toml --bus nocan17",
        "drives --node 1:lxm32m --bus nocan17",
        "scan --bus nocan17",
        "sdo --bus nocan17 read 1 6041",
        "nmt --bus nocan17 start",
        "monitor --bus nocan17",
        "record --bus nocan17 --candump a",
    ] {
        let (code, printed, told) = place.run(command);
        assert_eq!((code, &*printed), (2, ""), "{command}: {told}");
        assert!(told.contains("nocan17"), "{command}: {told}");
    }
}
