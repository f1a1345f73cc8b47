//! What `syncline identify` finds of gantries: two sides of one beam, with and without a carriage that stands anywhere along
//! it, and two sides with loads of their own.

use super::{Dice, Plant, WITHIN, number, told};
use serde_json::Value;
use std::fmt::Write as _;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// What ties both sides together.
#[derive(Clone, Debug)]
struct Beam {
    /// kg, without the carriage.
    mass: f64,
    /// mm.
    span: f64,
    /// N·m/rad.
    racking_stiffness: f64,
    /// kg, and how far from the middle it stands, mm.
    carriage: Option<(f64, f64)>,
}

/// A gantry each of whose motors moves what the plant's moves.
#[derive(Clone, Debug)]
struct Gantry {
    plant: Plant,
    /// Of the second side: motors are mounted alike, or as mirror images.
    direction: &'static str,
    beam: Option<Beam>,
}

impl Gantry {
    fn drawn(dice: &mut Dice) -> Self {
        let has_beam = dice.below(3) > 0;
        // A beam is moved by stiff sides.
        let fits = |plant: &Plant| plant.swing.is_none() || !has_beam;
        let mut plants = std::iter::repeat_with(|| Plant::drawn(dice));
        let mut plant = plants.find(fits).expect("every second one");
        // Three drives at 1 Mbit/s.
        plant.cycle_us = 2000;
        let moved = 2.0 * number(&plant.simulation, "load");
        let beam = has_beam.then(|| {
            let span = dice.between([400.0, 3000.0]);
            let carried = moved * dice.between([0.1, 0.6]);
            let place = span * dice.between([-0.4, 0.4]);
            let carriage = (dice.below(2) == 0).then_some((carried, place));
            Beam {
                mass: moved - carriage.map_or(0.0, |(mass, _)| mass),
                span,
                racking_stiffness: 10_f64.powf(dice.between([4.0, 7.0])),
                carriage,
            }
        });
        Self {
            plant,
            direction: ["positive", "negative"][dice.below(2)],
            beam,
        }
    }

    /// Keys of `[axis.simulation]` but the motor.
    fn simulation(&self) -> String {
        let Some(beam) = &self.beam else {
            return self.plant.simulation.clone();
        };
        let of_side = |key: &str| number(&self.plant.simulation, key);
        let Beam { mass, span, .. } = *beam;
        let mut keys = format!(
            "mechanics = \"rigid_beam\"\nmass = {mass:e}\ninertia = {:e}\nspan = {span:e}\nracking_stiffness = {:e}\n\
             racking_damping = 300.0\nfriction = {:e}\nviscous_friction = {:e}\ngravity = {:e}\n",
            mass * (span * 1e-3).powi(2) / 12.0,
            beam.racking_stiffness,
            of_side("friction"),
            of_side("viscous_friction"),
            2.0 * of_side("gravity"),
        );
        if let Some((mass, place)) = beam.carriage {
            // The carriage stands at 0.
            let middle = -place;
            let _ = write!(
                keys,
                "carriage = \"X\"\ncarriage_mass = {mass:e}\ncarriage_middle = {middle:e}\n"
            );
        }
        keys
    }

    fn machine(&self) -> String {
        let side = |name: &str, node: u8, direction: &str| {
            format!(
                "[[drive]]\nname = \"{name}\"\nbus = \"main\"\nnode = {node}\nmodel = \"{}\"\ndirection = \"{direction}\"\nzero = 0\n\n",
                self.plant.model
            )
        };
        let carriage = "[[axis]]\nname = \"X\"\ndrives = [\"X\"]\npitch = 20.0\ngear = 1.0\nmax_velocity = 200.0\n\
                        max_acceleration = 1000.0\nmax_jerk = 10_000.0\nsoft_limits = [-200.0, 200.0]\n\
                        following_error_limit = 1000.0\nstandstill_window = 5.0\n\n";
        let text = self.plant.machine(true);
        let (head, axis) = text.split_once("[[axis]]\n").expect("an axis");
        let (bus, _) = head.split_once("[[drive]]").expect("a drive");
        let axis = axis.replace("[\"Y1\"]", "[\"Y1\", \"Y2\"]");
        let axis = axis.replace(
            "drive_following_error",
            "skew_limit = 5.0\ndrive_following_error",
        );
        format!(
            "{bus}{}{}{}{carriage}[[axis]]\n{axis}{}",
            side("Y1", 1, self.plant.direction),
            side("Y2", 2, self.direction),
            side("X", 3, "positive"),
            self.simulation()
        )
    }
}

/// What is found of a gantry, and its machine file behind `--update`.
fn identified(gantry: &Gantry, folder: &Folder) -> (Value, String) {
    let machine = folder.file("gantry.toml", &gantry.machine());
    let mut command = syncline();
    command.args(["identify", "--axis", "Y", "--update", "--json", "-"]);
    let output = command.arg(&machine).output().expect("it was built");
    let (code, json, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}\n{gantry:?}\n{}", gantry.machine());
    let found = serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"));
    (found, folder.read("gantry.toml"))
}

/// Holds what was found of so many drawn gantries against what is true of them.
fn hold_against_truth(count: usize, dice: &mut Dice) {
    let folder = Folder::new();
    let mut told_surely = 0;
    for _ in 0..count {
        let gantry = Gantry::drawn(dice);
        let (found, written) = identified(&gantry, &folder);
        let errors = gantry.plant.errors(&found);
        let off = errors
            .iter()
            .find(|[error, said]| *error > WITHIN && *said <= WITHIN);
        assert!(off.is_none(), "{off:?}: {gantry:?}");
        if errors.iter().any(|[_, said]| *said > WITHIN) {
            continue;
        }
        told_surely += 1;
        let load = match gantry.beam {
            Some(_) => "mass",
            None => "load",
        };
        let [.., held] = gantry.plant.truth;
        let is_heavy = held.abs() > 0.02 * gantry.plant.rated_torque;
        let weight = is_heavy.then_some("gravity");
        for key in [load, "friction", "viscous_friction"]
            .into_iter()
            .chain(weight)
        {
            let is = number(&gantry.machine(), key);
            let told = number(&written, key);
            // Of a carriage the mass is known, and the beam's is what is left.
            assert!(
                (told - is).abs() <= 0.1 * is.abs(),
                "{key}: {told}, not {is}: {gantry:?}"
            );
        }
    }
    assert!(told_surely * 10 >= count * 7, "{told_surely} of {count}");
}

#[test]
fn drawn_gantries_are_found_and_written() {
    hold_against_truth(4, &mut Dice(8));
}

#[test]
#[ignore = "long: 60 gantries"]
fn sixty_drawn_gantries_are_found_and_written() {
    hold_against_truth(60, &mut Dice(2027));
}

/// A carriage far aside racks a beam beyond `skew_limit`; the stop takes more torque than was allowed.
#[test]
fn what_is_told_is_the_fault_and_not_the_torque_of_its_stop() {
    let folder = Folder::new();
    let far = "skew_limit = 0.02\nsimulation = { motor = \"generic-6\", mechanics = \"rigid_beam\", mass = 30.0, inertia = 15.0, \
               span = 1500.0, carriage = \"Y\", carriage_mass = 150.0, carriage_middle = 1500.0 }";
    let text = machine_with("portal", &[("skew_limit = 0.5", far)]);
    let machine = folder.file("far.toml", &text);
    let (code, errors) = told(&machine, &["--axis", "X", "--torque", "48"]);
    assert_eq!(code, 1, "{errors}");
    assert!(errors.contains("its two sides are"), "{errors}");
    assert!(!errors.contains("beyond --torque"), "{errors}");
}
