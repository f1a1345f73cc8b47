//! The portal with axes of data sheets behind its simulated drives.

use crate::validate::digest;
use syncline_controller::control::{End, Fault};
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// Y on a rack, Z on a screw, with everything that a simulated axis can have.
const AXES: [(&str, &str); 2] = [
    (
        "max_velocity = 800.0",
        "max_velocity = 800.0\n\
         simulation = { transmission = \"rack\", load = 40, friction = 20, breakaway_friction = 28, \
         viscous_friction = 30, lead_error = [[0, 0], [500, 12], [1000, -4]] }",
    ),
    (
        "max_velocity = 500.0",
        "max_velocity = 500.0\n\
         simulation = { transmission = \"screw\", load = 25, gravity = -60, friction = 15, \
         brake_torque = 4, brake_closing_ms = 20, end_stops = [-310, 10], encoder_noise = 0.5, \
         encoder_error = 3 }",
    ),
];

#[test]
fn axes_that_give_way_run_their_program_within_their_limits() {
    let mut rig = Rig::new("portal", &AXES, PORTAL_PROGRAM, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

/// A Z that weighs what its motor cannot lift does not follow, and is stopped for it.
#[test]
fn an_axis_that_its_motor_cannot_move_is_a_fault() {
    let heavy = (
        "max_velocity = 500.0",
        "max_velocity = 500.0\nsimulation = { motor = \"generic-0.4\", load = 30, gravity = -900 }",
    );
    let mut rig = Rig::new("portal", &[heavy], PORTAL_PROGRAM, |_, _| ());
    let fault = rig.finish_with_fault();
    let (Fault::Axis(2, _) | Fault::Device(3, _)) = fault else {
        panic!("{fault:?}");
    };
}

/// The same frames on every machine: these digests are kept.
#[test]
fn the_frames_of_axes_that_give_way_are_those_of_their_seed() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("portal", &AXES));
    let program = folder.file("program.ngc", PORTAL_PROGRAM);
    let kept = [
        (
            "0",
            "232a66eb0051da6178f33c6f47a9bb86ec373aee4d4799c97d74bc6caadf29b7",
        ),
        (
            "7",
            "bd1e71d1483c14abfde68cceeba7ac49857b634f75f07fd6dc7e163a182e2f2e",
        ),
    ];
    for (seed, kept) in kept {
        let now = digest(&machine, &program, &["--seed", seed]);
        assert_eq!(now, kept, "seed {seed}");
    }
}
