//! M-codes come in the program's order, each at its place on the path, with the dwells between them.

use syncline_controller::control::{End, Event, Switch};
use syncline_tests::rig::Rig;

/// When each M-code of a program was executed, s from the first row.
fn executed(program: &str) -> Vec<(f64, Switch)> {
    let mut rig = Rig::portal(program);
    let mut executed = Vec::new();
    let mut told = 0;
    while rig.step() {
        for event in &rig.events[told..] {
            if let Event::Switched { switch, .. } = event {
                let cycle = rig.machine.cycle.as_secs_f64();
                executed.push((rig.rows.len() as f64 * cycle, *switch));
            }
        }
        told = rig.events.len();
    }
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    executed
}

#[test]
fn two_m_codes_with_a_dwell_between_are_a_pulse() {
    let program = "G21 G90 G61\nG0 X10\nM64 P1\nG4 P2\nM65 P1\nG1 X20 F3000\nM2\n";
    let pulse = executed(program);
    let codes: Vec<String> = (pulse.iter())
        .map(|(_, switch)| match switch {
            Switch::Output(output) => output.to_string(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(codes, ["M64 P1", "M65 P1"]);
    let length = pulse[1].0 - pulse[0].0;
    assert!((length - 2.0).abs() <= 0.002 + 1e-9, "{length} s");
}
