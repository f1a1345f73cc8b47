//! M-codes of the user's that run a command: the path rests until it has ended, whatever becomes of it.

use proptest::prelude::*;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};
use syncline_controller::control::{End, Event, Pause, Switch};
use syncline_controller::session::Command;
use syncline_gcode::Output;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// A table for M101, which may take 0.2 s, and one for M102.
const CODES: &str = r#"
[[user_code]]
code = 101
command = ["/bin/true"]
timeout_ms = 200

[[user_code]]
code = 102
command = ["/bin/true"]

[machine]
"#;

fn rig(program: &str) -> Rig {
    let mut rig = Rig::new("portal", &[("[machine]\n", CODES)], program, |_, _| ());
    rig.goes_on = false;
    rig
}

/// The number of the last call.
fn called(rig: &Rig) -> Option<u32> {
    rig.events.iter().rev().find_map(|event| match event {
        Event::UserCode { number, .. } => Some(*number),
        _ => None,
    })
}

fn pauses(rig: &Rig) -> Vec<Pause> {
    let pause = |event: &Event| match event {
        Event::Paused { reason, .. } => Some(*reason),
        _ => None,
    };
    rig.events.iter().filter_map(pause).collect()
}

fn ended_well(number: u32) -> Command {
    Command::UserCodeEnded {
        number,
        failure: None,
    }
}

fn x(rig: &Rig) -> f64 {
    rig.rows.last().map_or(0.0, |row| row.plan.position[0])
}

const PROGRAM: &str = "G21 G90 F6000\nG1 X10\nM101 P3\nG1 X20\nM2\n";

#[test]
fn the_path_rests_until_it_is_said_how_the_command_ended() {
    let mut rig = rig(PROGRAM);
    rig.session.await_user_codes();
    rig.run_until(|rig| called(rig).is_some());
    assert_eq!(x(&rig), 10.0);
    for _ in 0..100 {
        rig.step();
    }
    assert_eq!((x(&rig), pauses(&rig).len()), (10.0, 0));
    // Of another call it says nothing.
    rig.command(ended_well(7));
    for _ in 0..20 {
        rig.step();
    }
    assert_eq!(x(&rig), 10.0);
    rig.command(ended_well(1));
    assert_eq!(rig.finish(), End::Finished);
    assert_eq!(pauses(&rig), []);
}

#[test]
fn a_command_that_fails_or_takes_too_long_is_the_operators() {
    for failure in [Some("M101: it has no pallet".to_owned()), None] {
        let mut rig = rig(PROGRAM);
        rig.session.await_user_codes();
        let told = rig.session.subscribe();
        rig.run_until(|rig| called(rig).is_some());
        let since = rig.rows.len();
        if failure.is_some() {
            rig.command(Command::UserCodeEnded {
                number: 1,
                failure: failure.clone(),
            });
        }
        rig.run_until(|rig| !pauses(rig).is_empty());
        assert_eq!(pauses(&rig), [Pause::UserCode(101)]);
        let waited = rig.rows.len() - since;
        let text = told.events().find_map(|event| match event {
            syncline_controller::session::Event::Message { text, .. } => Some(text),
            _ => None,
        });
        assert_eq!(text, failure);
        match failure {
            // 0.2 s, and 0.5 s for who is to say why, of cycles of 2 ms.
            None => assert!((348..=354).contains(&waited), "{waited}"),
            Some(_) => assert!(waited < 10, "{waited}"),
        }
        // Too late it does not go on by itself.
        rig.command(ended_well(1));
        for _ in 0..50 {
            rig.step();
        }
        assert_eq!(x(&rig), 10.0);
        rig.command(Command::CycleStart);
        assert_eq!(rig.finish(), End::Finished);
    }
}

#[test]
fn where_nobody_runs_commands_they_all_end_well() {
    let frames = |program: &str| {
        let mut rig = rig(program);
        assert_eq!(rig.finish(), End::Finished);
        assert_eq!((called(&rig), pauses(&rig)), (Some(1), vec![]));
        rig.session.timeline().frames().result().0
    };
    assert_eq!(frames(PROGRAM), frames(PROGRAM));
    // One that no table names is told, and nothing else.
    let mut rig = rig(&PROGRAM.replace("M101", "M150"));
    assert_eq!(rig.finish(), End::Finished);
    assert_eq!(called(&rig), None);
}

/// A block of a program.
#[derive(Clone, Copy, Debug)]
enum Block {
    Move(f64),
    Dwell(f64),
    Switch(u8, bool),
    /// M-code of the user's, and after so many wake-ups its command ends, or fails.
    User(u16, usize, bool),
}

fn block() -> impl Strategy<Value = Block> {
    prop_oneof![
        (1.0..60.0).prop_map(Block::Move),
        (0.0..0.1).prop_map(Block::Dwell),
        (0..8u8, any::<bool>()).prop_map(|(number, on)| Block::Switch(number, on)),
        (100..104u16, 0..400usize, any::<bool>())
            .prop_map(|(code, after, ok)| Block::User(code, after, ok)),
    ]
}

fn judge(blocks: &[Block], events: &[(usize, bool)]) -> Result<(), TestCaseError> {
    let mut program = "G21 G90 G64 P0.1 F6000\n".to_owned();
    for block in blocks {
        program += &match *block {
            Block::Move(x) => format!("G1 X{x:.3}\n"),
            Block::Dwell(seconds) => format!("G4 P{seconds:.3}\n"),
            Block::Switch(number, on) => format!("M{} P{number}\n", if on { 64 } else { 65 }),
            Block::User(code, after, _) => format!("M{code} P{after}\n"),
        };
    }
    program += "M2\n";
    let mut rig = rig(&program);
    rig.session.await_user_codes();
    let mut calls = blocks.iter().filter_map(|block| match *block {
        Block::User(code @ (101 | 102), after, ok) => Some((code, after, ok)),
        _ => None,
    });
    let (mut seen, mut due) = (0, None);
    let mut wake_up = 0;
    loop {
        wake_up += 1;
        prop_assert!(wake_up < 400_000, "it does not end");
        for &(at, holds) in events {
            if wake_up == at {
                rig.command(if holds {
                    Command::FeedHold
                } else {
                    Command::Retrace
                });
            }
            if wake_up == at + 60 {
                rig.command(Command::Resume);
            }
        }
        if let Some(number) = called(&rig)
            && number > seen
        {
            seen = number;
            let (_, after, ok) = calls.next().unwrap();
            due = Some((wake_up + after, number, ok));
        }
        if let Some((at, number, ok)) = due
            && wake_up >= at
        {
            due = None;
            let failure = (!ok).then(|| "no".to_owned());
            rig.command(Command::UserCodeEnded { number, failure });
        }
        // An operator goes on where it failed, and where it takes too long.
        let open = rig.events.iter().rev().find_map(|event| match event {
            Event::Paused { .. } | Event::StillPaused { .. } => Some(true),
            Event::Resumed | Event::Held(_) | Event::Retracing => Some(false),
            _ => None,
        });
        if open == Some(true) && wake_up % 50 == 0 {
            rig.command(Command::CycleStart);
        }
        if !rig.step() {
            break;
        }
    }
    prop_assert_eq!(rig.end(), Some(End::Finished));
    // Whatever came of them: each once, in the program's order.
    let done: Vec<String> = rig
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Switched {
                switch: Switch::Output(output @ (Output::Digital { .. } | Output::User { .. })),
                ..
            } => Some(output.to_string()),
            _ => None,
        })
        .collect();
    let programmed: Vec<String> = program
        .lines()
        .filter(|line| line.starts_with('M') && *line != "M2")
        .map(str::to_owned)
        .collect();
    prop_assert_eq!(done, programmed);
    prop_assert!(calls.next().is_none());
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Whatever commands do, and an operator meanwhile: each code comes once, in the program's order, and the run ends.
    #[test]
    fn each_code_comes_once_and_the_run_ends(
        blocks in prop::collection::vec(block(), 1..14),
        events in prop::collection::vec((1..6000usize, any::<bool>()), 0..4),
    ) {
        judge(&blocks, &events)?;
    }
}

// --- in real time ---

/// A script that does this.
fn script(folder: &Folder, text: &str) -> PathBuf {
    let path = folder.file("code.sh", &format!("#!/bin/sh\n{text}\n"));
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// Runs a program with M101 as that script, which may take so long, ms.
fn run(folder: &Folder, text: &str, timeout: u32, program: &str) -> (i32, String) {
    let code = script(folder, text);
    let table = format!(
        "[[user_code]]\ncode = 101\ncommand = [{:?}, \"first\"]\ntimeout_ms = {timeout}\n\n[machine]\n",
        code.display().to_string()
    );
    let machine = folder.file(
        "machine.toml",
        &machine_with("portal", &[("[machine]\n", &table)]),
    );
    let program = folder.file("program.ngc", program);
    let output = syncline()
        .arg("run")
        .args([&machine, &program])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let (exit, _, log) = ended(&output);
    (exit, log.to_owned())
}

#[test]
fn a_command_is_run_with_its_words_at_its_place() {
    let folder = Folder::new();
    let out = folder.path("out").display().to_string();
    let (exit, log) = run(
        &folder,
        &format!("echo \"$1|$2|$3\" >> {out}"),
        5000,
        "G21 G90 F6000\nG1 X5\nM101 P2.5\nG1 X10\nM101 P1 Q-3\nM101\nM2\n",
    );
    assert_eq!(exit, 0, "{log}");
    assert_eq!(folder.read("out"), "first|2.5|\nfirst|1|-3\nfirst||\n");
}

/// Whether a process runs: killed, it may not have been waited for yet by whoever inherited it.
fn runs(process: &str) -> bool {
    let stat = fs::read_to_string(Path::new("/proc").join(process).join("stat"));
    stat.is_ok_and(|stat| !stat.contains(") Z "))
}

#[test]
fn what_one_that_ends_well_has_started_goes_on() {
    let folder = Folder::new();
    let ran = folder.path("ran").display().to_string();
    let text = format!("sleep 30 & echo $! > {ran}");
    let (exit, log) = run(&folder, &text, 5000, "G21 G90 F6000\nM101\nG1 X5\nM2\n");
    assert_eq!(exit, 0, "{log}");
    let ran = folder.read("ran");
    let goes_on = runs(ran.trim());
    let killed = Process::new("kill").arg(ran.trim()).status().unwrap();
    assert!(goes_on && killed.success());
}

#[test]
fn one_that_fails_or_does_not_end_stops_the_program_with_its_reason() {
    for (text, told) in [
        ("exit 3", "has ended with exit status: 3"),
        // Behind it another one waits, too.
        (
            "sleep 60 & echo $$ $! > ran; sleep 60",
            "took longer than 0.3 s",
        ),
    ] {
        let folder = Folder::new();
        let ran = folder.path("ran");
        let text = text.replace("ran", &ran.display().to_string());
        // Nobody goes on: standard input is closed.
        let program = "G21 G90 F6000\nG1 X5\nM101\nG1 X10\nM2\n";
        let (exit, log) = run(&folder, &text, 300, program);
        assert_ne!(exit, 0, "{log}");
        assert!(log.contains(told), "{log}");
        assert!(
            log.contains("line 3: the command of M101 failed or took too long"),
            "{log}"
        );
        // Nothing of it is left.
        let ran = fs::read_to_string(&ran).unwrap_or_default();
        for process in ran.split_whitespace() {
            assert!(!runs(process), "{process}");
        }
        assert_eq!(ran.is_empty(), told.starts_with("has ended"));
    }
}
