//! The portal's gantry with both sides on one rigid beam: what one side does, the other feels.

use crate::validate::digest;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{End, Event, Fault};
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

/// The motor that the file names turns both sides, with its torque and its gains; a weak one does not move the beam.
#[test]
fn the_sides_of_a_beam_have_the_motor_that_is_named() {
    let with = |motor: &str, mass: &str| {
        let beam = BEAM
            .1
            .replace("span =", &format!("motor = \"{motor}\", span ="))
            .replace("mass = 80.0", mass);
        let mut rig = Rig::new("portal", &[(BEAM.0, &beam)], PORTAL_PROGRAM, |_, _| ());
        let end = rig.finish();
        let summary = rig.judge();
        (
            end,
            summary.drives[X1].peak_torque,
            summary.drives[X2].max_torque,
        )
    };
    let (end, peak, torque) = with("generic-6", "mass = 80.0");
    assert_eq!((end, peak), (End::Finished, 18.0), "{torque}");
    let (end, peak, torque) = with("generic-0.4", "mass = 2000.0");
    assert!(matches!(end, End::Fault(_)), "{end:?}");
    // Ripple and cogging come on top of what the current makes.
    assert!((peak - 1.2).abs() < 1e-9, "{peak}");
    assert!(torque <= 1.05 * peak, "{torque}");
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
fn a_gantry_that_silently_loses_a_side_is_quick_stopped() {
    let mut rig = portal(true);
    rig.run_to_row(ON_THE_ARC);
    rig.twin(X1).disturb(Disturbance::LoseTorque(true));
    let is_fault = |event: &Event| matches!(event, Event::Fault(_));
    rig.run_until(|rig| rig.events.iter().any(is_fault));
    let told = rig.session.timeline().now();
    let fault = rig.finish_with_fault();
    let silently = matches!(
        fault,
        Fault::Axis(0, AxisCause::Skew { .. } | AxisCause::FollowingError { .. })
    );
    assert!(silently, "{fault:?}");
    // By the same burst, within two cycles.
    let [one, other] = [X1, X2].map(|drive| {
        let commands = rig.commands(drive);
        let quick_stop = commands.iter().find(|(_, word, _)| *word == 0x0B);
        quick_stop.expect("a quick stop").0
    });
    let cycle = rig.machine.cycle;
    assert!(other - one < cycle / 4, "{one:?} {other:?}");
    assert!(other <= told + 2 * cycle, "{other:?}, told at {told:?}");
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    for drive in 0..rig.machine.drives.len() {
        assert!(!rig.twin(drive).observe().is_powered, "drive {drive}");
    }
}

/// Y runs along the beam, which is held square.
#[test]
fn a_gantry_with_its_carriage_runs_its_program_within_its_limits() {
    let carried = (
        "skew_limit = 0.5",
        "skew_limit = 0.5\n\
         simulation = { mechanics = \"rigid_beam\", mass = 50.0, inertia = 10.0, span = 1500.0, \
         racking_stiffness = 2e6, racking_damping = 300.0, carriage = \"Y\", carriage_mass = 35.0 }",
    );
    let mut rig = Rig::new("portal", &[carried], PORTAL_PROGRAM, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

/// Near one end of the beam the carriage weighs on that side's motor.
#[test]
fn a_carriage_weighs_on_the_side_that_it_is_at() {
    let torques = [0.0, 1000.0].map(|middle| {
        let simulation = format!(
            "skew_limit = 0.5\nsimulation = {{ mechanics = \"rigid_beam\", mass = 20.0, inertia = 4.0, \
             span = 1000.0, carriage = \"Y\", carriage_mass = 60.0, carriage_middle = {middle}.0 }}"
        );
        let program = "G0 X0 Y500 Z0\nG1 X600 F40000\nM2\n";
        let mut rig = Rig::new("portal", &[("skew_limit = 0.5", &simulation)], program, |_, _| ());
        let mut most = [0.0_f64; 2];
        for _ in 0..200 {
            let sides = sides(&mut rig, 10);
            for (most, side) in most.iter_mut().zip(sides) {
                *most = most.max(side.torque.abs());
            }
        }
        most
    });
    // Its axis's positive end is at the second side.
    let [[one, two], [mirrored_one, mirrored_two]] = torques;
    assert!(two > 1.5 * one, "{one} and {two} N·m");
    assert!(
        mirrored_one > 1.5 * mirrored_two,
        "{mirrored_one} and {mirrored_two} N·m"
    );
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
            "54370a4f33a266297fe071c9c88f369b5c8f035b483a70ff7b3018baa2c0e644",
        ),
        (
            "7",
            "ded597341c9654c340935697b473376119dc4032d163894e852ae051d65d9676",
        ),
    ];
    for (seed, kept) in kept {
        let now = digest(&machine, &program, &["--seed", seed]);
        assert_eq!(now, kept, "seed {seed}");
    }
}
