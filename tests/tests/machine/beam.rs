//! The portal's gantry with both sides on one rigid beam: what one side does, the other feels.

use crate::validate::digest;
use syncline_controller::control::{End, Fault};
use syncline_drives::twin::{Disturbance, Observation};
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

const X1: usize = 0;
const X2: usize = 1;

/// In the program's arc, with both sides under way.
const ON_THE_ARC: usize = 700;

const BEAM: (&str, &str) = (
    "skew_limit = 0.5",
    "skew_limit = 0.5\n\
     simulation = { mechanics = \"rigid_beam\", mass = 80.0, inertia = 15.0, span = 1500.0 }",
);

/// The portal with a shaft for each side, or with a beam between them.
fn portal(beam: bool) -> Rig {
    let replacements: &[_] = if beam { &[BEAM] } else { &[] };
    Rig::new("portal", replacements, PORTAL_PROGRAM, |_, _| ())
}

/// Both sides after so many wake-ups from the arc on.
fn sides(rig: &mut Rig, wake_ups: usize) -> [Observation; 2] {
    for _ in 0..wake_ups {
        rig.step();
    }
    [X1, X2].map(|drive| rig.twin(drive).observe())
}

#[test]
fn a_gantry_on_a_beam_runs_its_program_within_its_limits() {
    let mut rig = portal(true);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

#[test]
fn a_side_that_loses_its_torque_is_felt_by_the_other() {
    let felt = |beam: bool| {
        let [whole, broken] = [false, true].map(|lost| {
            let mut rig = portal(beam);
            rig.run_to_row(ON_THE_ARC);
            if lost {
                rig.twin(X1).disturb(Disturbance::LoseTorque(true));
            }
            sides(&mut rig, 6)
        });
        assert!(whole[0].torque.abs() > 0.01 && broken[0].velocity != whole[0].velocity);
        (broken[1].torque - whole[1].torque).abs()
    };
    // Without a beam the other drive cannot know in so few cycles.
    assert_eq!(felt(false), 0.0);
    let felt = felt(true);
    assert!(felt > 0.01, "{felt} N·m");
}

#[test]
fn a_gantry_that_loses_a_side_stops_on_the_path() {
    let mut rig = portal(true);
    rig.run_to_row(ON_THE_ARC);
    rig.twin(X1).disturb(Disturbance::LoseTorque(true));
    let fault = rig.finish_with_fault();
    assert!(matches!(fault, Fault::Axis(0, _)), "{fault:?}");
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    for drive in 0..rig.machine.drives.len() {
        assert!(!rig.twin(drive).observe().is_powered, "drive {drive}");
    }
}

/// The same frames on every machine: these digests are kept.
#[test]
fn the_beams_frames_are_those_of_its_seed() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("portal", &[BEAM]));
    let program = folder.file("program.ngc", PORTAL_PROGRAM);
    let kept = [
        (
            "0",
            "7a8c2c636b15130aadb9b12aad389eab6da555839dbe05921214f2147caa6688",
        ),
        (
            "7",
            "a459adbb10a54a7d257a5668e2b0c4c24353bea20b6043fa0b0ec0e1b5fa37df",
        ),
    ];
    for (seed, kept) in kept {
        let now = digest(&machine, &program, &["--seed", seed]);
        assert_eq!(now, kept, "seed {seed}");
    }
}
