//! Torques that drives are sent with their setpoints, held against those setpoints as somebody on the bus would reckon them: whatever
//! the axes take, and whatever stops them.

use super::day::{at, go, mdi, settle, state};
use super::feed_forward::{COUNTS, CYCLE, PLANT, RATED, TRAVEL, WINDOWS};
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::fmt;
use syncline_canopen::cia402::Controlword;
use syncline_canopen::{CobId, NodeId};
use syncline_controller::control::{AxisSample, End, State};
use syncline_controller::session::Command;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

const CSP: &str = "model = \"cia402_csp\"";

/// The places of the gantry's first side, of Y and of Z in the machine file.
const X: usize = 0;
const Y: usize = 2;
const Z: usize = 3;

/// Of the default motor, N·m.
const OF_DEFAULT: f64 = 1.4;

/// A row of [`PORTAL_PROGRAM`] in the midst of its first arc.
const ON_THE_ARC: usize = 900;

/// What a motor takes, N·m, kg·m² and N·m·s/rad.
#[derive(Clone, Copy, Debug)]
struct Figures {
    rated: f64,
    inertia: f64,
    coulomb: f64,
    viscous: f64,
    gravity: f64,
}

/// Of [`PLANT`], some per cent off.
const OF_PLANT: Figures = Figures {
    rated: RATED,
    inertia: 8.8e-4,
    coulomb: 0.22,
    viscous: 0.0,
    gravity: 0.38,
};

impl fmt::Display for Figures {
    /// As the key has it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            rated,
            inertia,
            coulomb,
            viscous,
            gravity,
        } = self;
        write!(
            f,
            "feed_forward = {{ rated_torque = {rated:?}, inertia = {inertia:e}, coulomb_friction = {coulomb}, \
             viscous_friction = {viscous}, gravity = {gravity} }}"
        )
    }
}

impl Figures {
    /// Thousandths of the rated torque.
    fn permille(&self, torque: f64) -> f64 {
        torque / self.rated * 1000.0
    }
}

/// Controlword, target position and torque offset of each R_PDO.
pub(super) fn sent(rig: &Rig, node: NodeId) -> Vec<(u16, i32, i16)> {
    let frames = rig.sent(CobId::r_pdo(2, node)).into_iter();
    let sent = frames.map(|it| match *it.frame.data() {
        [c0, c1, p0, p1, p2, p3, t0, t1] => (
            u16::from_le_bytes([c0, c1]),
            i32::from_le_bytes([p0, p1, p2, p3]),
            i16::from_le_bytes([t0, t1]),
        ),
        ref data => panic!("an R_PDO of {} bytes", data.len()),
    });
    sent.collect()
}

/// What one drive was sent, in its axis's direction.
struct Held {
    /// How far its torque went from gravity, thousandths.
    greatest: f64,
    /// Controlwords, one after the other.
    words: Vec<u16>,
}

/// Holds what a drive was sent against what its motor takes by its setpoints: while it is told to follow them that; and gravity
/// alone while it goes by itself, and before.
fn held(rig: &Rig, drive: usize, of: &Figures, jerk: f64) -> Held {
    let spec = &rig.machine.drives[drive];
    let sign = spec.scaling.travel_per_revolution().signum();
    let sent = sent(rig, spec.node);
    let follows = |word: u16| word == Controlword::ENABLE_OPERATION.0;
    let is_held_up =
        |torque: i16| (sign * f64::from(torque) - of.permille(of.gravity)).abs() < 0.51;
    let begins = sent.iter().position(|&(word, ..)| follows(word));
    let begins = begins.expect("it is enabled");
    for &(word, _, torque) in &sent[begins..] {
        assert!(
            follows(word) || is_held_up(torque),
            "{torque} with {word:04X}h"
        );
    }
    let radians = TAU / TRAVEL;
    let mut greatest = 0.0_f64;
    for three in sent.windows(3) {
        if !three.iter().all(|&(word, ..)| follows(word)) {
            continue;
        }
        let torque = sign * f64::from(three[1].2);
        let mm = |at: usize| sign * f64::from(three[at].1) * TRAVEL / COUNTS;
        let [before, here, there] = [mm(0), mm(1), mm(2)];
        let velocity = (here - before) / CYCLE;
        let acceleration = (there - 2.0 * here + before) / (CYCLE * CYCLE);
        let friction = (velocity / (TRAVEL * 5.0 / 60.0)).clamp(-1.0, 1.0) * of.coulomb;
        let turning = radians * (of.inertia * acceleration + of.viscous * velocity);
        let expected = of.permille(turning + friction + of.gravity);
        // A cycle later the acceleration is another one, and increments are whole ones.
        let increment = TRAVEL / COUNTS;
        let rounding = of.inertia * (jerk * CYCLE + 4.0 * increment / (CYCLE * CYCLE))
            + of.viscous * increment / CYCLE;
        let slow = of.coulomb * increment / CYCLE / (TRAVEL * 5.0 / 60.0);
        let allowed = 0.51 + of.permille(radians * rounding + slow);
        assert!(
            (torque - expected).abs() < allowed,
            "drive {drive}: {torque} in place of {expected} ± {allowed}"
        );
        greatest = greatest.max((torque - of.permille(of.gravity)).abs());
    }
    let mut words: Vec<u16> = sent.iter().map(|it| it.0).collect();
    words.dedup();
    Held { greatest, words }
}

/// The portal's Y on its plant, sent what it takes.
fn changes(of: &Figures) -> [(&'static str, String); 2] {
    let (window, wider) = WINDOWS;
    [
        (
            "max_velocity = 800.0",
            format!("max_velocity = 800.0\nsimulation = {PLANT}\n{of}"),
        ),
        (window, wider.to_owned()),
    ]
}

fn portal(of: &Figures, drive: &str) -> Rig {
    let [axis, windows] = changes(of);
    let replacements = [(axis.0, &*axis.1), (windows.0, &*windows.1), (CSP, drive)];
    Rig::new("csp", &replacements, PORTAL_PROGRAM, |_, _| ())
}

#[test]
fn torques_are_those_that_the_setpoints_take() {
    let mut rig = portal(&OF_PLANT, CSP);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let greatest = held(&rig, Y, &OF_PLANT, 100_000.0).greatest;
    let most = OF_PLANT.permille(OF_PLANT.inertia * TAU / TRAVEL * 5000.0 + OF_PLANT.coulomb);
    assert!(
        (0.9 * most..1.05 * most).contains(&greatest),
        "{greatest} of {most}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever an axis takes, also of viscous friction, and whichever way its drive counts.
    #[test]
    fn whatever_an_axis_takes_is_sent(
        inertia in prop_oneof![1 => Just(0.0), 4 => 1e-5..1.2e-3_f64],
        coulomb in prop_oneof![1 => Just(0.0), 3 => 0.01..0.4_f64],
        viscous in prop_oneof![1 => Just(0.0), 3 => 1e-4..3e-3_f64],
        gravity in -0.6..0.6_f64,
        mirrored in any::<bool>(),
    ) {
        let of = Figures { rated: OF_DEFAULT, inertia, coulomb, viscous, gravity };
        let drive = match mirrored {
            false => CSP.to_owned(),
            true => format!("{CSP}\ndirection = \"negative\""),
        };
        let axis = format!("max_velocity = 800.0\n{of}");
        let windows = ("following_error_limit = 2.0\nstandstill_window = 0.05\ndrive_following_error = true\ndrive_soft_limits = true\n\n[[axis]]\nname = \"Z\"",
            "following_error_limit = 4.0\nstandstill_window = 1.5\n\n[[axis]]\nname = \"Z\"");
        let soft_limits = ("soft_limits = [0.0, 1000.0]", "soft_limits = [-10.0, 1000.0]");
        let replacements = [("max_velocity = 800.0", &*axis), windows, soft_limits, (CSP, &*drive)];
        let mut rig = Rig::new("csp", &replacements, PORTAL_PROGRAM, |_, _| ());
        prop_assert_eq!(rig.finish(), End::Finished);
        held(&rig, Y, &of, 100_000.0);
    }
}

/// The sides of a gantry turn in opposite directions, and are sent opposite torques.
#[test]
fn the_sides_of_a_gantry_push_the_same_way() {
    let of = Figures {
        rated: OF_DEFAULT,
        viscous: 2e-4,
        gravity: 0.1,
        ..OF_PLANT
    };
    let [one, other] = [1, 2].map(|node| {
        let lxm32m = format!("node = {node}\nmodel = \"lxm32m\"");
        (lxm32m, format!("node = {node}\n{CSP}"))
    });
    let axis = format!("max_velocity = 700.0\n{of}");
    let replacements = [
        (&*one.0, &*one.1),
        (&*other.0, &*other.1),
        ("max_velocity = 700.0", &*axis),
    ];
    let mut rig = Rig::new("csp", &replacements, PORTAL_PROGRAM, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    for side in [X, X + 1] {
        let greatest = held(&rig, side, &of, 60_000.0).greatest;
        assert!(greatest > 200.0, "{greatest}");
    }
    let [one, other] = [1, 2].map(|node| sent(&rig, NodeId::new(node).unwrap()));
    assert_eq!(one.len(), other.len());
    let opposite = one.iter().zip(&other).all(|(one, other)| one.2 == -other.2);
    assert!(opposite, "both have as much of it to move");
}

/// An axis that goes on along its path to a stop is sent what that takes, and one that brakes by its drive's own ramp what holds it, and
/// nothing of a plan.
#[test]
fn stops_have_their_torques() {
    let quick_stop = Controlword::QUICK_STOP.0;
    for (drive, disturbance, by_itself) in [
        // Of another axis, which stops all on the path.
        (Z, Disturbance::Mute(true), false),
        // Of a gantry: all drives brake by themselves.
        (X, Disturbance::Mute(true), true),
        // Its own.
        (Y, Disturbance::Fault(ErrorClass::StopAndSwitchOff), true),
        (Y, Disturbance::Mains(false), true),
    ] {
        let mut rig = portal(&OF_PLANT, CSP);
        rig.run_to_row(ON_THE_ARC);
        let before = rig.rows.len();
        rig.twin(drive).disturb(disturbance);
        rig.finish_with_fault();
        let held = held(&rig, Y, &OF_PLANT, 100_000.0);
        let case = format!("{disturbance:?} of {drive}: {:04X?}", held.words);
        assert_eq!(held.words.contains(&quick_stop), by_itself, "{case}");
        assert!(held.greatest > 100.0, "{case}");
        assert!(rig.rows.len() > before + 20, "{case}");
    }
}

/// Each time that it is enabled it is held up from the first setpoint on, however power was lost.
#[test]
fn power_that_returns_finds_it_held_up() {
    let [axis, windows] = changes(&OF_PLANT);
    let replacements = [(axis.0, &*axis.1), (windows.0, &*windows.1)];
    let mut rig = Rig::staying_on("csp", &replacements, |_, _| ());
    settle(&mut rig);
    let mut enabled = 1;
    for lost in [
        None,
        Some(Disturbance::Mains(false)),
        Some(Disturbance::Reset),
        None,
    ] {
        mdi(&mut rig, "G1 X20 Y40 F20000");
        match lost {
            None => {
                go(&mut rig, Command::Disable);
                assert_eq!(state(&rig), State::Disabled);
                go(&mut rig, Command::Enable);
            }
            Some(disturbance) => {
                rig.command(Command::Mdi("G1 X200 Y300 F20000".to_owned()));
                rig.run_until(|rig| at(rig, AxisLetter::Y) > 100.0);
                rig.twin(Y).disturb(disturbance);
                rig.run_until(|rig| state(rig) == State::Faulted);
                rig.twin(Y).disturb(Disturbance::Mains(true));
                go(&mut rig, Command::Reset);
            }
        }
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        enabled += 1;
        mdi(&mut rig, "G1 Y5 F20000");
    }
    assert_eq!(rig.refused, []);
    let held = held(&rig, Y, &OF_PLANT, 100_000.0);
    let enable = Controlword::ENABLE_OPERATION.0;
    let times = held.words.iter().filter(|&&word| word == enable).count();
    assert_eq!(times, enabled, "{:04X?}", held.words);
}

/// While backlash is taken up the carriage stays where it is: the motor is sent what its own side takes to cross the play, as far as
/// the file has that, and the whole axis what the plan takes.
#[test]
fn a_take_up_moves_the_motors_side_alone() {
    let program = "G21 G90 G94 G61\nG1 Y50 F9000\nY40\nY60 F1000\nY10\nM2\n";
    let figures = OF_PLANT.to_string();
    for motor in [0.0, 2.8e-4] {
        let stated = figures.replace(" }", &format!(", motor_inertia = {motor:e} }}"));
        let plant = PLANT.replace(" }", ", play = 0.05 }");
        let axis = format!("max_velocity = 800.0\nbacklash = 0.05\nsimulation = {plant}\n{stated}");
        let replacements = [("max_velocity = 800.0", &*axis), WINDOWS];
        let mut rig = Rig::new("csp", &replacements, program, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let torques: Vec<_> = sent(&rig, NodeId::new(3).unwrap());
        let rows: Vec<_> = rig.rows.iter().map(|row| row.axes[1]).collect();
        // Which R_PDO a row is of, its positions tell; they count from where it was frozen as it was enabled.
        let scaling = rig.machine.drives[Y].scaling;
        let is_of = |first: &usize| {
            let apart = rows.iter().zip(&torques[*first..]).map(|(row, sent)| {
                let there = scaling.to_increments(row.of_side[0]).unwrap();
                there.get() - i64::from(sent.1)
            });
            let (least, most) = apart.fold((i64::MAX, i64::MIN), |(least, most), it| {
                (least.min(it), most.max(it))
            });
            most - least <= 1
        };
        let first = (0..=torques.len() - rows.len()).find(is_of);
        let first = first.expect("rows are of what was sent");
        let (mut taken_up, mut off) = (0.0_f64, 0.0_f64);
        for (at, four) in rows.windows(4).enumerate() {
            // In the cycle from the second to the third of them.
            let acceleration = |of: fn(&AxisSample) -> f64| {
                let [a, b, c, d] = [0, 1, 2, 3].map(|at| of(&four[at]));
                (d - c - b + a) / (2.0 * CYCLE * CYCLE)
            };
            let carriage = acceleration(|it| it.set);
            let take_up = acceleration(|it| it.of_side[0]) - carriage;
            let velocity = (four[2].set - four[1].set) / CYCLE;
            let friction = (velocity / (TRAVEL * 5.0 / 60.0)).clamp(-1.0, 1.0) * OF_PLANT.coulomb;
            let turning = OF_PLANT.inertia * carriage + motor * take_up;
            let expected = OF_PLANT.permille(TAU / TRAVEL * turning + friction + OF_PLANT.gravity);
            let torque = f64::from(torques[first + at + 2].2);
            off = off.max((torque - expected).abs());
            taken_up = taken_up.max(take_up.abs());
        }
        println!("{motor:e}: taken up with {taken_up:.1} mm/s², off by up to {off:.2} thousandths");
        // The whole axis would be off by 27 thousandths.
        assert!(taken_up > 200.0, "{taken_up}");
        assert!(off < 6.0, "{off}");
    }
}
