//! Programs that read inputs and outputs of the machine by name: each where the path has come to the block that reads
//! it, whatever is read ahead, and whatever an operator does meanwhile.

use proptest::prelude::*;
use std::fmt::Write as _;
use syncline_controller::control::{End, Event};
use syncline_controller::program::Programs;
use syncline_controller::session::{Command, SwitchChange};
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// A switch that is on about the middle of Y, and an output of its drive.
const WIRED: &str = r#"
[[input]]
name = "Middle of Y"
drive = "Y"
signal = "DI0"
number = 3
simulated = [44.0, 66.0]

[[output]]
name = "clamp"
drive = "Y"
signal = "DQ0"
number = 1

[machine]
"#;

/// What a program does between two readings.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Moves Y to so many tenths of a metre.
    Move(u8),
    /// Switches the clamp: whether it is on, and whether only with the next motion.
    Clamp(bool, bool),
    Dwell,
    /// Moves X by what it reads; under which path mode.
    Read(u8),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        3 => (0u8..11).prop_map(Step::Move),
        2 => any::<(bool, bool)>().prop_map(|(on, with_motion)| Step::Clamp(on, with_motion)),
        1 => Just(Step::Dwell),
        4 => (0u8..3).prop_map(Step::Read),
    ];
    prop::collection::vec(step, 1..14)
}

/// The program, and where X rests behind each reading.
fn program(steps: &[Step]) -> (String, Vec<f64>) {
    let mut text = "G21 G90 G94 F9000\n#1 = 0\n".to_owned();
    let (mut y, mut clamp, mut with_motion) = (0, false, None);
    let (mut x, mut places) = (0.0, Vec::new());
    for step in steps {
        match *step {
            Step::Move(to) => {
                text += &format!("G1 Y{}\n", 10 * u32::from(to));
                if to != y {
                    clamp = with_motion.take().unwrap_or(clamp);
                }
                y = to;
            }
            Step::Clamp(on, later) => {
                let code = 62 + 2 * u8::from(!later) + u8::from(!on);
                text += &format!("M{code} P1\n");
                match later {
                    true => with_motion = Some(on),
                    false => clamp = on,
                }
            }
            Step::Dwell => text += "G4 P0.02\n",
            Step::Read(mode) => {
                let mode = ["G61", "G61.1", "G64 P0.1"][usize::from(mode)];
                let by = "1 + 2 * #<_hal[middle of y]> + 4 * #<_hal[clamp]>";
                writeln!(text, "{mode} G1 X[#1 + {by}]\n#1 = #5420").expect("a text grows");
                let middle = u8::from((5..=6).contains(&y));
                x += f64::from(1 + 2 * middle + 4 * u8::from(clamp));
                clamp = with_motion.take().unwrap_or(clamp);
                places.push(x);
            }
        }
    }
    (text + "M2\n", places)
}

fn rig(program: &str) -> Rig {
    Rig::new("portal", &[("[machine]\n", WIRED)], program, |_, _| ())
}

/// Where X is where it has come to rest.
fn rests(rig: &Rig) -> Vec<f64> {
    let mut rests = vec![0.0];
    let mut x = rig.rows.iter().map(|row| row.plan.position[0]);
    let mut before = x.next().unwrap_or_default();
    for x in x {
        if x == before && x != rests[rests.len() - 1] {
            rests.push(x);
        }
        before = x;
    }
    rests
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Wherever the program reads, it reads what is there then: the switch where Y stands, the output as it was
    /// switched before; feed holds and single blocks on the way change nothing.
    #[test]
    fn what_is_read_is_what_is_there(
        steps in steps(),
        held in prop::collection::vec((1usize..400, any::<bool>()), 0..3),
    ) {
        let (text, places) = program(&steps);
        let mut rig = rig(&text);
        for &(after, block) in &held {
            let row = rig.rows.len() + after;
            while rig.rows.len() < row && rig.step() {}
            rig.command(match block {
                true => Command::SingleBlock(SwitchChange::To(true)),
                false => Command::FeedHold,
            });
            let row = rig.rows.len() + 60;
            while rig.rows.len() < row && rig.step() {}
            rig.command(Command::SingleBlock(SwitchChange::To(false)));
            rig.command(Command::Resume);
        }
        prop_assert_eq!(rig.finish(), End::Finished, "{}{:?}", text, rig.events);
        let rests = rests(&rig);
        let mut rests = rests.iter();
        for place in &places {
            let met = rests.any(|x| (x - place).abs() < 1e-6);
            prop_assert!(met, "{}{}: X never rested there", text, place);
        }
        if let (Some(row), Some(place)) = (rig.rows.last(), places.last()) {
            prop_assert!((row.plan.position[0] - place).abs() < 1e-6, "{}{:?}", text, row.plan);
        }
    }
}

/// Counts passes in X until Y has come to the switch.
const SEARCH: &str = "\
G21 G90 F6000
#1 = 0
o1 while [[#<_hal[middle of y]> EQ 0] AND [#1 LT 9]]
  #1 = [#1 + 1]
  G1 Y[#1 * #<_ini[axis.Y]pitch> / 16]
  (debug, pass #1: #<_hal[middle of y]>)
o1 endwhile
M64 P1
o2 if [#<_hal[clamp]> NE 1]
  G1 X50
o2 elseif [#<_hal[middle of y]>]
  G1 X#1
o2 endif
M2
";

#[test]
fn a_loop_ends_where_an_input_comes() {
    let mut rig = rig(SEARCH);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let last = rig.rows.last().expect("it moved").plan.position;
    assert_eq!((last[0], last[1]), (5.0, 50.0));
    let told: Vec<&str> = rig.messages.iter().map(|(_, text)| &text[..]).collect();
    assert_eq!(
        told,
        [
            "pass 1: 0",
            "pass 2: 0",
            "pass 3: 0",
            "pass 4: 0",
            "pass 5: 1"
        ]
    );
}

#[test]
fn typed_lines_read_too() {
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], |_, _| ());
    super::day::settle(&mut rig);
    rig.command(Command::Mdi(
        "G1 F6000 Y50\nG1 X[3 + #<_hal[middle of y]>]".into(),
    ));
    rig.run_until(|rig| {
        rig.events
            .iter()
            .any(|it| matches!(it, Event::JobOver { .. }))
    });
    let last = rig.rows.last().expect("it moved").plan.position;
    assert_eq!((last[0], last[1]), (4.0, 50.0));
}

/// `run` reads what `validate` read, and a replay does; `check` tells from where on nothing is known, a line behind that
/// is no place to begin at, and nobody says how long the program takes.
#[test]
fn every_command_knows_it() {
    let folder = Folder::new();
    let machine = folder.file(
        "machine.toml",
        &machine_with("portal", &[("[machine]\n", WIRED)]),
    );
    let part = folder.file("part.ngc", SEARCH);
    let path = |name: &str| folder.path(name).display().to_string();
    let (log, commands) = (path("run.log"), path("run.commands"));
    let output = |arguments: &[&str]| {
        let mut command = syncline();
        command.args(arguments).args([&machine, &part]);
        let output = command.output().expect("it can be run");
        let (code, printed, told) = ended(&output);
        (code, printed.to_owned(), told.to_owned())
    };
    let (code, printed, told) = output(&["check"]);
    assert_eq!(code, 0, "{told}");
    assert!(
        printed.contains("from line 3 on checked as it runs"),
        "{printed}"
    );

    let frames = |printed: &str| {
        let json: serde_json::Value = serde_json::from_str(printed).expect("JSON");
        assert_eq!(json["verdict"], "pass", "{json}");
        json["frames_sha256"].to_string()
    };
    let (code, validated, told) = output(&["validate", "--json", "-"]);
    assert_eq!(code, 0, "{told}");
    let log_to = ["--candump", &log, "--commands", &commands];
    let (code, ran, told) =
        output(&[&["run", "--wait-for-plan", "--json", "-"], &log_to[..]].concat());
    assert_eq!(code, 0, "{told}");
    assert_eq!(frames(&validated), frames(&ran));
    let (code, _, told) = output(&["replay", &log, "--commands", &commands]);
    assert_eq!(code, 0, "{told}");

    let (code, _, told) = output(&["validate", "--from-line", "8"]);
    assert_eq!(code, 2, "{told}");
    assert!(
        told.contains("line 8 is behind a block with #<_hal"),
        "{told}"
    );
    let programs = Programs::new(
        &syncline_controller::machine::Machine::load(&machine).unwrap(),
        &machine,
    );
    let table = programs.unwrap().file(&part).timetable([0.0; 9]).unwrap();
    assert!(!table.is_whole());
}
