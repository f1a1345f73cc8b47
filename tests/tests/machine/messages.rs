//! What programs tell their operator: in their order, at its place on the path.

use syncline_controller::control::{End, State};
use syncline_controller::session::Command;
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::rig::Rig;

const PROGRAM: &str = "(a comment for readers)\n\
    (MSG, begins)\n\
    #1=4 G1 X30 F6000 (debug, to #<far> by #1)\n\
    (PRINT, X is #5420) M0 (turn it over)\n\
    G1 X60\n\
    M1 ; look\n\
    M2\n";

#[test]
fn messages_come_in_their_order_at_their_place() {
    let mut rig = Rig::portal(PROGRAM);
    let mut places = Vec::new();
    while rig.step() {
        if rig.messages.len() > places.len() {
            places.resize(rig.messages.len(), rig.session.status().setpoint[0]);
        }
    }
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    let told: Vec<(u32, &str)> = (rig.messages.iter())
        .map(|(line, text)| (*line, text.as_str()))
        .collect();
    let expected = [
        (2, "begins"),
        (3, "to #<far> by 4"),
        (4, "X is 30"),
        (4, "turn it over"),
        (6, "look"),
    ];
    assert_eq!(told, expected);
    for (place, expected) in places.iter().zip([0.0, 0.0, 30.0, 30.0, 60.0]) {
        assert!((place - expected).abs() < 0.5, "{places:?}");
    }
}

/// Held, jogged and retraced in between, each is told once.
#[test]
fn a_message_is_told_once() {
    let text = "G1 X20 F6000\n(MSG, one)\nX40\n(MSG, two)\nX60\n(MSG, three)\nX80\nM2\n";
    let mut rig = Rig::portal(text);
    for far in [30.0, 50.0, 70.0] {
        rig.run_until(|rig| rig.session.status().setpoint[0] > far);
        for command in [Command::FeedHold, Command::Retrace, Command::Resume] {
            rig.command(command);
            for _ in 0..600 {
                rig.step();
            }
        }
    }
    assert_eq!(rig.finish(), End::Finished);
    let told: Vec<&str> = rig.messages.iter().map(|(_, text)| text.as_str()).collect();
    assert_eq!(told, ["one", "two", "three"]);
}

/// A program that was stopped leaves no message to the next one.
#[test]
fn messages_of_a_job_that_is_stopped_are_gone() {
    let mut rig = crate::day::ready_with(&[]);
    let lines = "G1 X20 F6000\n(MSG, never)\nX40";
    rig.command(Command::Mdi(lines.to_owned()));
    rig.run_until(|rig| rig.session.status().setpoint[0] > 5.0);
    crate::day::go(&mut rig, Command::Stop);
    assert_eq!(crate::day::state(&rig), State::Ready);
    crate::day::mdi(&mut rig, "(MSG, now)");
    let told: Vec<&str> = rig.messages.iter().map(|(_, text)| text.as_str()).collect();
    assert_eq!(told, ["now"]);
}

#[test]
fn a_validation_shows_them_and_the_name_of_the_tool() {
    let folder = Folder::new();
    let machine = folder.machine("xyz");
    let _ = folder.file(
        "xyz.tables.toml",
        "[[tool]]\nnumber = 3\nname = \"drill 5 mm\"\n",
    );
    let part = folder.file("part.ngc", "T3 M6 (the short one)\nG1 X5 F600\nM2\n");
    let run = syncline()
        .arg("validate")
        .args([&machine, &part])
        .output()
        .unwrap();
    let (code, told, errors) = ended(&run);
    assert_eq!(code, 0, "{told}{errors}");
    for text in ["line 1: the short one", "line 1: tool 3: drill 5 mm"] {
        assert!(errors.contains(text), "{text}: {errors}");
    }
}
