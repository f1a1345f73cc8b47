//! An axis on a stepper that takes no part in SYNC: Z of the portal on a TSP10-CBE, sent velocities, with a
//! TWK CRN on its screw that closes the loop.

use super::day::{go, settle};
use proptest::prelude::*;
use std::f64::consts::TAU;
use syncline_canopen::budget::PdoTime;
use syncline_canopen::response_time::bit_time;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, NodeId};
use syncline_controller::budget::MachineBudget;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{End, Fault, Phase, Row, State};
use syncline_controller::machine::{COORDINATES, Machine};
use syncline_controller::session::Command;
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::twin::tsp10::Twin;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::Rig;

/// Places of the drive and of the encoder among the devices.
const DRIVE: usize = 3;
const SCREW: usize = 4;
const CABINET: usize = 5;

const Z: usize = 2;

const LXM32M: &str = "bus = \"portal\"\nnode = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
const TSP10: &str = "bus = \"portal\"\nnode = 4\nmodel = \"tsp10\"\nsdo = [[\"6075:0\", 5000]]\n\n\
    [[io]]\nname = \"cabinet\"\nbus = \"portal\"\nnode = 9\nmodel = \"cia401\"\n\n\
    [[output]]\nname = \"drives on\"\nio = \"cabinet\"\nsignal = \"DO3\"\nfunction = \"enable_chain\"";

const ENCODER: &str = "[[encoder]]\nname = \"screw\"\nbus = \"portal\"\nnode = 5\n\
    model = \"twk_crn\"\npitch = 10.0\nzero = 10_000\n\n[[axis]]\nname = \"X\"";

/// What a motor of this size can: 8 turns a second.
const FAST: &str = "max_velocity = 500.0\nmax_acceleration = 4000.0\nmax_jerk = 80_000.0";
const SLOW: &str = "max_velocity = 80.0\nmax_acceleration = 800.0\nmax_jerk = 20_000.0\n\
    feedback = \"screw\"\ndifference_limit = 0.1\nposition_loop = \"encoder\"\n\
    unsupervised_stop = \"hardware\"";

const SUPERVISED: &str = "soft_limits = [-300.0, 0.0]\nfollowing_error_limit = 1.0\n\
    standstill_window = 0.05\ndrive_following_error = true\ndrive_soft_limits = true";
const UNSUPERVISED: &str = "soft_limits = [-300.0, 0.0]\nfollowing_error_limit = 1.0\n\
    standstill_window = 0.05";

/// Z of the portal on the stepper, with the encoder, and an I/O node that opens the enable chain.
pub(super) const CHANGES: [(&str, &str); 4] = [
    (LXM32M, TSP10),
    ("[[axis]]\nname = \"X\"", ENCODER),
    (FAST, SLOW),
    (SUPERVISED, UNSUPERVISED),
];

/// A circle of 20 mm in X and Z, and lines of all three.
const PROGRAM: &str = "G21 G90 G94 G61 G18\nG1 X40 Z-40 F3000\nG2 X40 Z-40 I20\n\
    G1 X100 Y80 Z-10\nG1 Z-60 F4800\nG1 Z-5\nM2\n";

/// How far the axis may be from its plan at the most on its way to and from a velocity, mm, by what is known before it runs.
fn bound(rig: &Rig, velocity: f64) -> f64 {
    let [drive, screw] = [DRIVE, SCREW].map(|device| &rig.layout.devices[device]);
    let dynamics = drive.device.drive().unwrap().dynamics().unwrap();
    let limits = &rig.layout.axes[Z].limits;
    let acceleration = limits.acceleration.min((velocity * limits.jerk).sqrt());
    // Latency: its place in the burst is not reckoned with; half a millisecond is assumed from the arrival on, of which none may
    // be true; half of its ramp at the axis' greatest acceleration is reckoned with, at less it has less.
    let bus = &MachineBudget::of(&rig.machine).buses[0].budget;
    let burst = bit_time(bus.r_pdo_bits, bus.bit_rate).as_secs_f64();
    let ramp = rig.layout.cycle.as_secs_f64() / 4.0 / 2.0;
    let latency = burst + 0.5e-3 + ramp;
    // So much later it is where it should be, and the gain takes off what comes of that while it accelerates.
    let late = latency * velocity.min(acceleration / dynamics.gain);
    // A velocity is off by half of its quantum, which the loop holds against.
    let rounded = 0.5 * dynamics.quantum * drive.scaling.resolution() / dynamics.gain;
    // The rotor is behind its field by the angle at which it has the torque: inertia, and the friction that it has to break
    // away from. 0.6 N·m/A at 5 A, 50 pole pairs, a screw of 10 mm.
    let rigid = Rigid::default();
    let inertia = rigid.motor_inertia + rigid.load_inertia;
    let radians = TAU / 10.0;
    let friction = rigid.coulomb_friction + rigid.viscous_friction * velocity * radians;
    let torque = inertia * acceleration * radians + friction;
    let angle = (torque / (0.6 * 5.0)).asin() / 50.0;
    // The encoder tells whole increments, and the drive goes in whole steps.
    let increments = screw.scaling.resolution() + drive.scaling.resolution();
    late + rounded + angle / TAU * 10.0 + increments
}

/// By how much motor and screw differ at rest without a loss, mm.
const MARGIN: f64 = 0.02;

fn portal_with(program: &str, configure: impl Fn(usize, &mut Config)) -> Rig {
    let changes = [&[("cycle_us = 2000", "cycle_us = 4000")], &CHANGES[..]].concat();
    Rig::new("portal", &changes, program, configure)
}

fn portal(program: &str) -> Rig {
    portal_with(program, |_, _| ())
}

fn peak(rows: &[Row<COORDINATES>], axis: usize) -> f64 {
    let errors = rows.iter().map(|row| row.axes[axis].following_error.abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn it_follows_a_program_beside_drives_that_latch_at_sync() {
    let mut rig = portal(PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let [x, z] = [0, Z].map(|axis| peak(&rig.rows, axis));
    let bound = bound(&rig, 80.0);
    println!("{z} of {bound} mm");
    assert!(
        x < 0.03 && z <= bound && z >= bound / 5.0,
        "{x}, {z}, {bound}"
    );
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    assert!(rig.twin_as::<Twin>(DRIVE).lost_steps().abs() < 50.0);
}

/// It has no error at a constant velocity, but for what the quantum of that and an increment leave: what is not known of when a
/// velocity takes effect is none then.
#[test]
fn it_does_not_lag_at_a_constant_velocity() {
    let velocity = 40.0;
    let mut rig = portal("G21 G90 G94 G61\nG1 Z-200 F2400\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let [drive, screw] = [DRIVE, SCREW].map(|device| &rig.layout.devices[device]);
    let dynamics = drive.device.drive().unwrap().dynamics().unwrap();
    let quantum = dynamics.quantum * drive.scaling.resolution();
    let middle = (rig.rows.iter()).filter(|row| (-180.0..-40.0).contains(&row.axes[Z].set));
    let errors: Vec<f64> = middle.map(|row| row.axes[Z].following_error).collect();
    assert!(errors.len() > 800, "{}", errors.len());
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let most = (0.001 * velocity + quantum) / dynamics.gain + screw.scaling.resolution();
    println!("{mean} of {most} mm");
    assert!(mean.abs() <= most, "{mean} of {most} mm");
}

#[test]
fn each_loss_has_its_own_message() {
    let cases: [(usize, Disturbance, &str); 4] = [
        (
            DRIVE,
            Disturbance::Mute(true),
            "no answer to the polls of 6064h:0",
        ),
        (
            DRIVE,
            Disturbance::Fault(ErrorClass::StopAndSwitchOff),
            "drive fault, statusword",
        ),
        (DRIVE, Disturbance::Mains(false), "drive fault, statusword"),
        (
            SCREW,
            Disturbance::Mute(true),
            "no T_PDO in 2 cycles in a row",
        ),
    ];
    for (device, disturbance, text) in cases {
        let mut rig = portal(PROGRAM);
        rig.run_to_row(200);
        rig.twin(device).disturb(disturbance);
        let fault = rig.finish_with_fault().describe(&*rig.layout);
        assert!(fault.contains(text), "{disturbance:?}: {fault}");
    }
}

// --- what its bus carries ---

/// A portal with the stepper, and what its axis does.
#[derive(Clone, Debug)]
struct Shape {
    cycle_ms: u64,
    kbit: u32,
    /// It is sent targets, not velocities.
    point_to_point: bool,
    /// Where it goes in turn, mm, and how fast, mm/min.
    moves: Vec<(f64, f64)>,
    seed: u64,
}

prop_compose! {
    fn shape()(
        cycle_ms in 2..=10u64,
        kbit in prop::sample::select(vec![500u32, 800, 1000]),
        point_to_point in prop::bool::weighted(0.25),
        moves in prop::collection::vec((-40.0..0.0f64, 300.0..4800.0f64), 1..4),
        seed: u64,
    ) -> Shape {
        Shape { cycle_ms, kbit, point_to_point, moves, seed }
    }
}

impl Shape {
    fn rig(&self) -> Option<Rig> {
        let cycle = format!("cycle_us = {}000", self.cycle_ms);
        let bitrate = format!("bitrate = {}_000", self.kbit);
        let mut changes = vec![
            ("cycle_us = 2000", &cycle[..]),
            ("bitrate = 1_000_000", &bitrate),
        ];
        changes.extend(CHANGES);
        if self.point_to_point {
            changes.push((
                "position_loop = \"encoder\"\nunsupervised_stop = \"hardware\"",
                "",
            ));
        }
        let folder = Folder::new();
        let file = folder.file("machine.toml", &machine_with("portal", &changes));
        let machine = Machine::load(&file).ok()?;
        MachineBudget::of(&machine).check().ok()?;
        let line = |(to, feed): &(f64, f64)| format!("G1 Z{to:.3} F{feed:.0}\n");
        let lines: String = self.moves.iter().map(line).collect();
        let program = format!("G21 G90 G94 G61\n{lines}M2\n");
        let seed = self.seed;
        Some(Rig::new("portal", &changes, &program, |place, config| {
            config.seed = seed.wrapping_add(place as u64);
        }))
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// It tells each change of its statusword by itself, several times in a cycle where it is sent velocities, and it is
    /// polled besides.
    #[test]
    fn no_cycle_is_busier_than_the_budget_has_it(shape in shape()) {
        let rig = shape.rig();
        prop_assume!(rig.is_some());
        let mut rig = rig.unwrap();
        let budget = MachineBudget::of(&rig.machine).buses.remove(0);
        rig.run_to(Phase::Program);
        let before = rig.frames().len();
        prop_assert_eq!(rig.finish(), End::Finished);
        let told = budget.budget.pdos.iter();
        let mut counts: Vec<_> = told.map(|told| (told, 0)).collect();
        let (mut busiest, mut bits) = (0, 0);
        for sent in rig.frames().iter().skip(before) {
            if sent.frame.id() == CobId::SYNC.into() {
                busiest = busiest.max(bits);
                bits = 0;
                counts.iter_mut().for_each(|(_, count)| *count = 0);
            }
            bits += sent.bits;
            let of = |told: &&mut (&PdoTime, u32)| sent.frame.id() == told.0.pdo.cob_id.into();
            if let Some((told, count)) = counts.iter_mut().find(of) {
                *count += 1;
                prop_assert!(*count <= told.times, "{told:?} came {count} times");
            }
        }
        let busiest = bit_time(busiest, shape.kbit * 1000);
        prop_assert!(busiest <= budget.load_in_motion, "{busiest:?} of {:?}", budget.load_in_motion);
    }
}

// --- the enable chain ---

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// The controller is gone at any time: the drive goes on with the velocity that it was told last, and has its power
    /// until the I/O node misses the controller's heartbeat.
    #[test]
    fn without_the_controller_the_enable_chain_stops_it(row in 1..500usize) {
        let mut rig = portal(PROGRAM);
        rig.run_to_row(row);
        let heartbeats = rig.sent(CobId::error_control(NodeId::new(127).unwrap()));
        let heard = heartbeats.last().expect("a heartbeat").start;
        let timeout = rig.machine.controller.heartbeat_timeout;
        let ms = Duration::from_millis(1);
        let mut now = rig.session.timeline().now();
        let mut let_pass = |rig: &mut Rig, since_heard: Duration| {
            while now + ms < heard + since_heard {
                now += ms;
                rig.session.timeline().world().advance_to(now);
            }
            rig.twin(DRIVE).observe()
        };
        let before = let_pass(&mut rig, timeout - 10 * ms);
        let on = let_pass(&mut rig, timeout - ms);
        prop_assert!(before.is_powered && on.is_powered);
        // The rotor swings a little about its field.
        prop_assert!((on.velocity - before.velocity).abs() < 0.5, "{before:?}, {on:?}");
        prop_assert!(!let_pass(&mut rig, timeout + 4 * ms).is_powered);
        let rest = let_pass(&mut rig, timeout + 500 * ms);
        prop_assert!(rest.velocity.abs() < 1e-6, "{rest:?}");
    }
}

/// It is closed while drives are to have power, and open before, between and behind.
#[test]
fn the_enable_chain_is_closed_while_drives_are_enabled() {
    let changes = [&[("cycle_us = 2000", "cycle_us = 4000")], &CHANGES[..]].concat();
    let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
    let closed = |rig: &mut Rig| rig.twin(CABINET).outputs() == 0x0008;
    rig.run_to(Phase::ReadyToSwitchOn);
    assert!(!closed(&mut rig), "before its first R_PDO");
    rig.run_to(Phase::OperationEnabled);
    assert!(closed(&mut rig));
    settle(&mut rig);
    assert!(closed(&mut rig));
    let by_hand = Command::Output {
        name: "drives on".into(),
        on: false,
    };
    go(&mut rig, by_hand);
    assert!(closed(&mut rig), "nobody opens it by hand");
    for (command, state, on) in [
        (Command::Disable, State::Disabled, false),
        (Command::Enable, State::Ready, true),
        (Command::SwitchOff, State::Off, false),
    ] {
        go(&mut rig, command);
        assert_eq!(rig.session.status().state, state);
        assert_eq!(closed(&mut rig), on, "{state}");
    }
}

/// A fault opens it once the drives are at rest.
#[test]
fn a_fault_opens_the_enable_chain_once_the_drives_rest() {
    let mut rig = portal(PROGRAM);
    rig.run_to_row(200);
    rig.twin(SCREW).disturb(Disturbance::Mute(true));
    let open = |rig: &mut Rig| rig.twin(CABINET).outputs() == 0;
    rig.run_until(open);
    let speeds = [0, 1, 2].map(|drive| rig.twin(drive).observe().velocity.abs());
    assert!(speeds.iter().all(|it| *it < 0.01), "{speeds:?}");
    let fault = rig.finish_with_fault();
    assert!(matches!(fault, Fault::Device(SCREW, _)), "{fault:?}");
}

/// A screw that swings by more than leaves its encoder to be held against the drive, and by less than `standstill_window`, stands
/// all the same: the drives are enabled.
#[test]
fn a_screw_that_vibrates_is_enabled() {
    let mut rig = portal(PROGRAM);
    // 0.03 mm from one side to the other, at 10 Hz; a quarter of `difference_limit` is 0.025 mm.
    let mut swing = 0.003;
    let mut wake_ups = 0;
    rig.run_until(|rig| {
        if wake_ups % 25 == 0 {
            rig.slip(0, swing);
            swing = -swing;
        }
        wake_ups += 1;
        rig.phases.iter().any(|(phase, _)| *phase == Phase::Program) || rig.end().is_some()
    });
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

// --- it loses steps ---

/// Down, a rest, and up again.
const RESTS: &str = "G21 G90 G94 G61\nG1 Z-40 F1200\nG4 P0.3\nG1 Z-5\nG4 P0.3\nM2\n";

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// What the screw slips against the motor, either way and at any time, is as a loss of steps: the axis makes up
    /// for it in motion, and where it is more than the limit it is found at the next rest.
    #[test]
    fn lost_steps_are_made_up_for_and_found_at_the_next_rest(
        row in 5..450usize, size in 0.0..0.02f64, backward: bool,
    ) {
        let turns = if backward { -size } else { size };
        let mut rig = portal(RESTS);
        rig.run_to_row(row);
        rig.slip(0, turns);
        let end = rig.finish();
        prop_assert!(peak(&rig.rows, Z) <= 10.0 * size + bound(&rig, 20.0));
        if size * 10.0 > 0.1 + MARGIN {
            let found = matches!(end, End::Fault(Fault::Axis(Z, AxisCause::FeedbackDifference { .. })));
            prop_assert!(found, "{:?}", end);
        } else if size * 10.0 < 0.1 - MARGIN {
            prop_assert_eq!(end, End::Finished);
        }
    }

    /// There and back, at every feed, for up to twenty seconds each.
    #[test]
    fn it_stays_within_its_bound(seconds in 0.1..20.0f64, feed in 60.0..4800.0f64, share in 0.0..0.9f64) {
        let to = (seconds * feed / 60.0).clamp(5.0, 290.0);
        let program = format!(
            "G21 G90 G94 G61\nG1 Z-{to:.3} F{feed:.0}\nG1 Z-{:.3}\nM2\n",
            share * to
        );
        let mut rig = portal(&program);
        prop_assert_eq!(rig.finish(), End::Finished);
        let error = peak(&rig.rows, Z);
        let bound = bound(&rig, feed / 60.0);
        prop_assert!(error <= bound, "{} of {} mm", error, bound);
    }
}
