//! Homings of axes that have something in common: one switch for two of them, one beam with its carriage at one end.

use super::homing::{
    ALL, INCREMENT, Y, errors, failure, home, is_referenced, settle, squared, state, truth,
};
use proptest::prelude::*;
use syncline_controller::control::{HomingFailure, State};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// The drive of Z of the router.
const Z: usize = 3;

/// The router, whose Y and Z press the same switch, at the drive of Y.
fn one_switch(y: f64, z: f64, seed: u64) -> Rig {
    let z_switch = "# It opens at the top, as a broken wire does.\n[[input]]\nname = \"home Z\"\ndrive = \"Z\"\nsignal = \"DI4\"\nfunction = \"home\"\nactive_low = true\nsimulated = [3.0, 40.0]\n";
    let [y, z] = [y, z].map(|start| format!("start = {start:?}"));
    let replacements = [
        (
            "signal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]\n\n# It opens",
            "signal = \"DI0\"\nfunction = \"home\"\n\n# It opens",
        ),
        (z_switch, ""),
        (
            "switches = [\"home Y\"]",
            "switches = [\"home Y\"]\nlatch = false",
        ),
        ("switches = [\"home Z\"]", "switches = [\"home Y\"]"),
        ("start = 95.0", &y),
        ("start = -40.0", &z),
    ];
    let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
        config.seed = seed + drive as u64;
    });
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// Y in front of -4 mm, or Z behind 3 mm, presses it.
fn is_pressed(rig: &mut Rig) -> bool {
    truth(rig, Y) <= -4.0 || truth(rig, Z) >= 3.0
}

/// Goes on until the machine is ready, with the switch as the axes press it.
fn press(rig: &mut Rig) {
    let mut since = 0;
    while since < 6 && rig.step() {
        let on = is_pressed(rig);
        rig.twin(Y).disturb(Disturbance::Input(0, on));
        since = if state(rig) == State::Ready {
            since + 1
        } else {
            0
        };
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// One after the other by their `order`; where it is on already, it says nothing.
    #[test]
    fn one_switch_homes_two_axes_in_turn(
        y in -30.0..150.0_f64, z in -80.0..20.0_f64, seed in 0..1000u64,
    ) {
        prop_assume!((y + 4.0).abs() > 0.5 && (z - 3.0).abs() > 0.5);
        let mut rig = one_switch(y, z, seed);
        let on = is_pressed(&mut rig);
        rig.twin(Y).disturb(Disturbance::Input(0, on));
        for _ in 0..6 {
            rig.step();
        }
        rig.command(ALL);
        rig.step();
        press(&mut rig);
        if on {
            prop_assert_eq!(failure(&rig), Some(HomingFailure::Shared));
            prop_assert!(!is_referenced(&rig, AxisLetter::Y) && !is_referenced(&rig, AxisLetter::Z));
        } else {
            prop_assert_eq!(failure(&rig), None);
            for axis in [AxisLetter::Y, AxisLetter::Z] {
                prop_assert!(is_referenced(&rig, axis), "{:?}", rig.events);
                prop_assert!(errors(&mut rig, axis)[0].abs() < 0.02);
            }
        }
    }
}

/// What moves along the beam makes one side heavier than the other: stiffness and friction are not shared evenly.
#[test]
fn a_beam_with_its_carriage_at_one_end_is_taken_square() {
    for (seed, y) in [(0, 5.0), (1, 795.0), (2, 5.0), (3, 795.0)] {
        let skew = 3.0 - 1.5 * seed as f64;
        let beam = format!(
            "start = 180.0\nstart_skew = {skew:?}\nmechanics = \"rigid_beam\"\nmass = 60.0\ninertia = 12.0\n\
             span = 1500.0\nracking_stiffness = 2e5\nracking_damping = 300.0\nfriction = 20.0\ncarriage = \"Y\"\n\
             carriage_mass = 40.0"
        );
        let y = format!("start = {y:?}");
        let replacements = [("start = 180.0", &beam[..]), ("start = 95.0", &y)];
        let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
            config.seed = seed * 8 + drive as u64;
        });
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let left = squared(&mut rig, 0.5);
        assert!(left.abs() < 2.5 * INCREMENT, "{seed}: {left}");
        rig.command(home(AxisLetter::Y));
        settle(&mut rig);
        assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
    }
}
