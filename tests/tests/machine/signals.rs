//! Digital inputs and outputs of the drives, as the controller tells them.

use syncline_canopen::{CanId, CobId, Frame, NodeId};
use syncline_controller::bus::Received;
use syncline_controller::control::{End, Event};
use syncline_controller::machine::Machine;
use syncline_tests::rig::Rig;

const Y: usize = 2;

/// DQ0 of a simulated drive is on without an error, DQ1 while its power stage is on.
const ASKED_FOR: (&str, &str) = ("zero = 402_131", "zero = 402_131\nsignals = true");

/// A switch on DI0 of Y, one revolution long, one from where Y stands.
fn switch(received: &mut Received) -> bool {
    let id = CobId::t_pdo(2, NodeId::new(3).unwrap());
    if received.frame.id() == CanId::from(id)
        && let &[s0, s1, p0, p1, p2, p3, inputs, outputs] = received.frame.data()
    {
        let revolution = (i32::from_le_bytes([p0, p1, p2, p3]) - 402_131) / 131_072;
        let inputs = inputs & !1 | u8::from(revolution == 1);
        received.frame = Frame::new(id, &[s0, s1, p0, p1, p2, p3, inputs, outputs]);
    }
    true
}

#[test]
fn changes_of_inputs_and_outputs_are_told_by_name() {
    let program = "G0 Y150\nG0 Y0\nM2\n";
    let mut rig = Rig::new("portal", &[ASKED_FOR], program, |_, _| ());
    rig.bus().doctor = Some(Box::new(switch));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let told = rig.events.iter().filter_map(|event| match event {
        Event::Signal { .. } => event.describe(&*rig.layout),
        _ => None,
    });
    let expected = [
        "DQ0 on", "DQ1 on", "DI0 on", "DI0 off", "DI0 on", "DI0 off", "DQ1 off",
    ];
    let expected = expected.map(|change| format!("node 3 (Y, LXM32M): {change}"));
    assert_eq!(told.collect::<Vec<_>>(), expected);
}

#[test]
fn they_cost_nothing_where_nobody_asks() {
    let mut rig = Rig::portal("G0 Y150\nM2\n");
    assert_eq!(rig.finish(), End::Finished);
    let told = |event: &Event| matches!(event, Event::Signal { .. });
    assert!(!rig.events.iter().any(told));
    let lengths = |text: &str| -> Vec<u8> {
        let file = std::path::Path::new("m.toml");
        let machine = Machine::parse(file, text).unwrap_or_else(|error| panic!("{error}"));
        let device = machine.device(Y);
        device.spec().t_pdos.iter().map(|pdo| pdo.bytes).collect()
    };
    let text = include_str!("../../../examples/portal/machine.toml");
    assert_eq!(lengths(text), [6]);
    assert_eq!(lengths(&text.replace(ASKED_FOR.0, ASKED_FOR.1)), [8]);
}
