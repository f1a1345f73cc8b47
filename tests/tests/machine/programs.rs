//! Programs on a machine: what the modes promise, and where a run ends that cannot go on.

use std::process::Stdio;
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::rig::example;
use syncline_tests::trace::Trace;

/// With `--stream` the block is not known to be bad until it is read, far ahead of the machine.
#[test]
fn a_bad_block_in_a_stream_stops_the_machine_where_it_stands_in_the_program() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = "G64 P0.1 F12000\nG1 X100\nY100\nX200\nX300 Y150 H2\nX0\nM2\n";
    let program = folder.file("stream.ngc", program);
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--stream", "--trace"])
        .args([&trace, &machine, &program])
        .output()
        .unwrap();
    let (code, printed, errors) = ended(&output);
    assert_eq!(code, 1, "{errors}");
    assert!(errors.contains("stream.ngc:5:11:"), "{errors}");
    assert!(
        printed.contains("VIOLATION          fault: the program"),
        "{printed}"
    );
    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    trace.assert_within_limits();
    for (axis, end) in [("X", 200.0), ("Y", 100.0), ("Z", 0.0)] {
        let last = *trace.axis(axis).set.last().unwrap();
        assert!((last - end).abs() < 1e-3, "{axis}: {last}");
    }
    // The same block in a program that is read first moves nothing.
    let output = syncline()
        .arg("validate")
        .args([&machine, &program])
        .output();
    let output = output.unwrap();
    assert_eq!(ended(&output).0, 2);
}

/// `syncline … | head` closes the pipe: no reason to panic, least of all while axes move.
#[test]
fn a_reader_that_goes_away_changes_nothing() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G0 X20\nM2\n");
    for command in ["validate", "run"] {
        let closed = || {
            let (reader, writer) = std::io::pipe().unwrap();
            drop(reader);
            Stdio::from(writer)
        };
        let mut child = syncline();
        child
            .args([command, "--verbose"])
            .args([&machine, &program]);
        child.stdin(Stdio::null()).stdout(closed()).stderr(closed());
        assert_eq!(child.status().unwrap().code(), Some(0), "{command}");
    }
}
