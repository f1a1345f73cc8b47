//! Whatever goes wrong, and whenever: the right reason, rest on the path inside the limits, every
//! drive switched off in its order, and nothing enabled again.

use std::sync::LazyLock;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, CobId, Frame, NodeId, nmt};
use syncline_controller::bus::Received;
use syncline_controller::control::fault::{AwaitedState, AxisCause, BusCause, DeviceCause};
use syncline_controller::control::{End, Event, Fault, Phase, State};
use syncline_controller::session::Command;
use syncline_drives::model::NotFollowing;
use syncline_drives::twin::lxm32m::{DriveError, Twin};
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// A row of [`PORTAL_PROGRAM`] in the midst of its first arc.
const ON_THE_ARC: usize = 900;

/// The drives: the gantry's sides, Y and Z.
const X1: usize = 0;
const X2: usize = 1;
const Y: usize = 2;
const Z: usize = 3;

/// The setpoints of the undisturbed run.
static NOMINAL: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    positions(&rig)
});

fn positions(rig: &Rig) -> Vec<[f64; 3]> {
    let xyz = |set: &[f64; 9]| [set[0], set[1], set[2]];
    rig.rows.iter().map(|row| xyz(&row.plan.position)).collect()
}

/// A portal in the midst of its program.
fn moving() -> Rig {
    moving_with(&[], |_, _| ())
}

fn moving_with(replacements: &[(&str, &str)], configure: impl Fn(usize, &mut Config)) -> Rig {
    let mut rig = Rig::new("portal", replacements, PORTAL_PROGRAM, configure);
    rig.run_to_row(ON_THE_ARC);
    assert!(rig.rows[ON_THE_ARC].plan.speed > 100.0, "in motion");
    rig
}

fn node(drive: usize) -> NodeId {
    NodeId::new(drive as u8 + 1).unwrap()
}

/// Whether a frame has this identifier and begins so.
fn is(received: &Received, id: CobId, begin: &[u8]) -> bool {
    received.frame.id() == CanId::from(id)
        && !received.echo
        && received.frame.data().starts_with(begin)
}

/// Puts other data into a frame.
fn doctored(received: &mut Received, change: impl FnOnce(&mut Vec<u8>)) -> bool {
    let mut data = received.frame.data().to_vec();
    change(&mut data);
    received.frame = Frame::new(received.frame.id(), &data);
    true
}

/// Distance of a point from the undisturbed run's setpoints, joined by straight lines.
fn off_the_path(point: &[f64; 3]) -> f64 {
    let to = |from: &[f64; 3], to: &[f64; 3]| [0, 1, 2].map(|i| to[i] - from[i]);
    let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let from = |pair: &[[f64; 3]]| {
        let (along, way) = (to(&pair[0], &pair[1]), to(&pair[0], point));
        let part = (dot(&along, &way) / dot(&along, &along).max(1e-12)).clamp(0.0, 1.0);
        let aside = [0, 1, 2].map(|i| way[i] - part * along[i]);
        dot(&aside, &aside).sqrt()
    };
    NOMINAL.windows(2).map(from).fold(f64::INFINITY, f64::min)
}

/// The drives that are quick-stopped for a fault: those of its axis, and all where that is the gantry.
fn quick_stopped(fault: &Fault) -> &'static [usize] {
    match fault {
        Fault::Device(0 | X2, _) | Fault::Axis(0, _) => &[0, X2, Y, Z],
        Fault::Device(Y, _) | Fault::Axis(1, _) => &[Y],
        Fault::Device(..) | Fault::Axis(..) => &[Z],
        _ => &[],
    }
}

/// The controlwords of a whole run, one after the other: with an ordinary end, and with a quick stop.
const ORDERLY: [u16; 7] = [0x00, 0x06, 0x0F, 0x1F, 0x0F, 0x06, 0x00];
const QUICK_STOP: [u16; 6] = [0x00, 0x06, 0x0F, 0x1F, 0x0B, 0x00];

/// What holds after every end of a machine that moved. Of axes that are quick-stopped it is the plan that stays on
/// the path.
fn assert_stopped_on_the_path(rig: &mut Rig, quick_stopped: &[usize]) {
    let trace = rig.trace();
    trace.assert_within_limits();
    assert!(rig.ends_at_rest());
    let from = ON_THE_ARC.saturating_sub(10).min(rig.rows.len());
    let planned = trace.axes[0].set.len();
    let positions = positions(rig);
    for (row, point) in positions[..planned].iter().enumerate().skip(from) {
        // A setpoint a cycle: chords of the arcs, at most 0.6 mm long.
        let off = off_the_path(point);
        assert!(off < 2e-3, "row {row} is {off} mm off the path: {point:?}");
    }
    assert_switched_off_by(rig, |drive| match quick_stopped.contains(&drive) {
        true => &QUICK_STOP,
        false => &ORDERLY,
    });
}

/// What holds after every end: the drives were given just these controlwords, one after the other,
/// then released, Pre-Operational, and SYNC went last.
fn assert_switched_off(rig: &mut Rig, controlwords: &[u16]) {
    assert_switched_off_by(rig, |_| controlwords);
}

fn assert_switched_off_by<'a>(rig: &mut Rig, controlwords: impl Fn(usize) -> &'a [u16]) {
    let last_sync = rig.syncs().last().copied();
    let nmt_frames = rig.sent(CanId::Standard(0));
    assert!(
        nmt_frames.iter().all(|it| it.frame.data()[1] != 0),
        "never to all nodes"
    );
    for drive in 0..rig.machine.drives.len() {
        assert!(!rig.twin(drive).observe().is_powered, "drive {drive}");
        let commands = rig.commands(drive);
        let mut words: Vec<u16> = commands.iter().map(|it| it.1).collect();
        words.dedup();
        assert_eq!(words, controlwords(drive), "drive {drive}");
        let requests = rig.sent(CobId::r_sdo(node(drive)));
        let release = [0x2B, 0x22, 0x30, 5, 0, 0];
        let released = requests
            .iter()
            .find(|it| it.frame.data().starts_with(&release));
        let leave = [nmt::Command::EnterPreOperational as u8, node(drive).get()];
        // One that is not heard is called back before, too.
        let left = nmt_frames
            .iter()
            .rfind(|it| it.frame.data() == leave)
            .unwrap()
            .start;
        let mut order: Vec<_> = commands.last().map(|it| it.0).into_iter().collect();
        order.extend(released.map(|it| it.start));
        order.push(left);
        order.extend(last_sync);
        assert!(order.is_sorted(), "drive {drive}: {order:?}");
        assert!(released.is_some() || commands.is_empty(), "drive {drive}");
    }
}

/// A fault while the machine moves, by what is done to it.
fn fault_in_motion(interfere: impl FnOnce(&mut Rig)) -> Fault {
    let mut rig = moving();
    interfere(&mut rig);
    let fault = rig.finish_with_fault();
    assert_stopped_on_the_path(&mut rig, quick_stopped(&fault));
    fault
}

/// A fault before the machine moves: the drives are never enabled.
fn fault_in_bring_up(
    configure: impl Fn(usize, &mut Config),
    interfere: impl FnOnce(&mut Rig),
) -> Fault {
    let mut rig = Rig::new("portal", &[], PORTAL_PROGRAM, configure);
    interfere(&mut rig);
    let fault = rig.finish_with_fault();
    assert_eq!(rig.rows.len(), 0, "nothing moved");
    let commanded = rig.commands(0).last().is_some();
    assert_switched_off(&mut rig, if commanded { &[0x00] } else { &[] });
    fault
}

// --- what drives tell ---

#[test]
fn an_emcy_message() {
    let error = DriveError {
        class: ErrorClass::QuickStop,
        number: 0xA305,
        emcy_code: 0x3130,
        register: 4,
    };
    let fault = fault_in_motion(|rig| rig.twin_as::<Twin>(Y).raise(error));
    let emergency = Emergency {
        code: 0x3130,
        register: 5,
        vendor: [0, 0, 0, 0x05, 0xA3],
    };
    let expected = Fault::Device(Y, DeviceCause::Emergency { emergency });
    assert_eq!(fault, expected);
}

#[test]
fn a_fault_in_the_statusword_alone() {
    let fault = fault_in_motion(|rig| {
        let no_emcy = |it: &mut Received| !is(it, CobId::emcy(node(Z)), &[]);
        rig.bus().doctor = Some(Box::new(no_emcy));
        rig.twin(Z)
            .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    });
    assert!(
        matches!(fault, Fault::Device(Z, DeviceCause::Reported { .. })),
        "{fault:?}"
    );
}

/// The phases in which drives are waited for on the way down, and how long each took.
fn way_down(rig: &Rig) -> Vec<(Phase, Duration)> {
    let waits = [Phase::ModeEnd, Phase::ShutDown, Phase::Disable];
    let pairs = rig.phases.windows(2);
    let times = pairs.map(|pair| (pair[0].0, pair[1].1 - pair[0].1));
    times.filter(|(phase, _)| waits.contains(phase)).collect()
}

fn faults_of(rig: &Rig) -> Vec<Fault> {
    let faults = rig.events.iter().filter_map(|event| match event {
        Event::Fault(fault) => Some(*fault),
        _ => None,
    });
    faults.collect()
}

#[test]
fn a_drive_in_quick_stop_active_is_switched_off_without_waiting() {
    for drive in [X2, Y, Z] {
        let mut rig = moving();
        rig.twin(drive)
            .disturb(Disturbance::Fault(ErrorClass::QuickStop));
        rig.finish_with_fault();
        for (phase, took) in way_down(&rig) {
            assert!(took < Duration::from_millis(500), "{phase:?} took {took:?}");
        }
        let waited = |fault: &Fault| {
            let Fault::Device(_, cause) = fault else {
                return false;
            };
            matches!(cause, DeviceCause::StateTimeout { .. })
        };
        assert!(!faults_of(&rig).iter().any(waited), "{:?}", faults_of(&rig));
    }
}

#[test]
fn a_drive_that_fell_silent_is_told_once_and_given_the_time_for_its_brake() {
    for drive in [X2, Y, Z] {
        let mut rig = moving();
        rig.twin(drive).disturb(Disturbance::Mute(true));
        rig.finish_with_fault();
        for (phase, took) in way_down(&rig) {
            let brakes = phase == Phase::ShutDown && took >= Duration::from_secs(2);
            let quick = took < Duration::from_millis(500);
            assert!(
                brakes || phase != Phase::ShutDown && quick,
                "{phase:?} took {took:?}"
            );
        }
        let faults = faults_of(&rig);
        let told = |fault: &&Fault| matches!(fault, Fault::Device(of, _) if *of == drive);
        assert_eq!(faults.iter().filter(told).count(), 1, "{faults:?}");
        let missing =
            |fault: &Fault| matches!(fault, Fault::Device(_, DeviceCause::MissingTPdo { .. }));
        assert!(missing(&faults[0]), "{faults:?}");
    }
}

#[test]
fn a_statusword_that_no_longer_follows() {
    for (set, cleared, why) in [
        (0x2000, 0x0000, NotFollowing::Error),
        (0x0000, 0x1000, NotFollowing::ModeEnded),
        (0x0000, 0x0004, NotFollowing::PowerStageOff),
        (0x0000, 0x0020, NotFollowing::QuickStop),
        (0x0000, 0x0200, NotFollowing::NotRemote),
    ] {
        let mut rig = moving();
        rig.bus().doctor = Some(Box::new(move |it| {
            if !is(it, CobId::t_pdo(2, node(Y)), &[]) {
                return true;
            }
            doctored(it, |data| {
                let word = u16::from_le_bytes([data[0], data[1]]);
                // Only while it is enabled and in its mode.
                if word & 0x1000 != 0 {
                    data[..2].copy_from_slice(&(word & !cleared | set).to_le_bytes());
                }
            })
        }));
        let fault = rig.finish_with_fault();
        let told = matches!(fault, Fault::Device(Y, DeviceCause::NotFollowing { why: told, .. }) if told == why);
        assert!(told, "{why:?}: {fault:?}");
        rig.trace().assert_within_limits();
    }
}

#[test]
fn an_unexpected_reboot() {
    let quick = |_: usize, config: &mut Config| config.boot_time = Some(Duration::from_millis(1));
    let mut rig = moving_with(&[], quick);
    rig.twin(Y).disturb(Disturbance::Reset);
    assert_eq!(
        rig.finish_with_fault(),
        Fault::Device(Y, DeviceCause::Rebooted)
    );
    assert_stopped_on_the_path(&mut rig, &[Y]);
}

#[test]
fn a_drive_that_left_operational() {
    let fault = fault_in_motion(|rig| {
        rig.bus().doctor = Some(Box::new(|it| {
            let heartbeat = is(it, CobId::error_control(node(X2)), &[5]);
            !heartbeat || doctored(it, |data| data[0] = 0x7F)
        }));
    });
    let state = nmt::State::PreOperational;
    assert_eq!(fault, Fault::Device(X2, DeviceCause::NmtState { state }));
}

// --- what drives do not tell ---

#[test]
fn a_lost_heartbeat() {
    let fault = fault_in_motion(|rig| {
        let silent = |it: &mut Received| !is(it, CobId::error_control(node(Y)), &[]);
        rig.bus().doctor = Some(Box::new(silent));
    });
    assert_eq!(fault, Fault::Device(Y, DeviceCause::HeartbeatLost));
}

#[test]
fn a_drive_that_falls_silent() {
    let fault = fault_in_motion(|rig| rig.twin(Y).disturb(Disturbance::Mute(true)));
    assert_eq!(
        fault,
        Fault::Device(Y, DeviceCause::MissingTPdo { misses: 2 })
    );
}

#[test]
fn one_missing_t_pdo_is_counted_and_two_in_a_row_are_a_fault() {
    let mut rig = moving();
    rig.twin(Z).disturb(Disturbance::LoseTPdos(1));
    for _ in 0..50 {
        rig.step();
    }
    rig.twin(Z).disturb(Disturbance::LoseTPdos(1));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let missed = |it: &&Event| **it == Event::MissedTPdo { device: Z };
    assert_eq!(rig.events.iter().filter(missed).count(), 2);
    assert_eq!(positions(&rig), *NOMINAL);

    let fault = fault_in_motion(|rig| rig.twin(Z).disturb(Disturbance::LoseTPdos(2)));
    assert_eq!(
        fault,
        Fault::Device(Z, DeviceCause::MissingTPdo { misses: 2 })
    );
}

#[test]
fn a_second_t_pdo_to_a_sync_is_a_fault_unless_it_is_the_first_once_more() {
    let second = |rig: &mut Rig, change: u8| {
        let id = CobId::t_pdo(2, node(Y));
        let frames = rig.frames();
        let mut t_pdos = frames.iter().rev().map(|it| &it.frame);
        let last = t_pdos
            .find(|it| it.id() == CanId::from(id))
            .expect("it answers");
        let mut data = last.data().to_vec();
        data[4] ^= change;
        let received = Received {
            at: rig.session.timeline().now(),
            frame: Frame::new(id, &data),
            echo: false,
        };
        rig.controller().receive(0, &received);
    };
    let fault = fault_in_motion(|rig| second(rig, 0x40));
    assert_eq!(fault, Fault::Device(Y, DeviceCause::SecondTPdo));

    let mut rig = moving();
    second(&mut rig, 0);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(positions(&rig), *NOMINAL);
}

#[test]
fn a_t_pdo_that_is_late_or_cut_short_is_a_missing_one() {
    let fault = fault_in_motion(|rig| {
        rig.bus().doctor = Some(Box::new(|it| {
            !is(it, CobId::t_pdo(2, node(Y)), &[]) || doctored(it, |data| data.truncate(5))
        }));
    });
    assert_eq!(
        fault,
        Fault::Device(Y, DeviceCause::MissingTPdo { misses: 2 })
    );
}

// --- mechanics ---

/// The controller's own supervision, the drive's being off.
const ALONE: (&str, &str) = (
    "soft_limits = [0.0, 1000.0]\nfollowing_error_limit = 2.0\nstandstill_window = 0.05\n\
     drive_following_error = true",
    "soft_limits = [0.0, 1000.0]\nfollowing_error_limit = 2.0",
);

#[test]
fn a_blocked_axis_is_a_following_error() {
    let mut rig = moving_with(&[ALONE], |_, _| ());
    rig.twin(Y).disturb(Disturbance::Block(true));
    let fault = rig.finish_with_fault();
    let Fault::Axis(axis, AxisCause::FollowingError { error, .. }) = fault else {
        panic!("{fault:?}");
    };
    assert_eq!(rig.layout.axes[axis].name, "Y");
    assert!(error.abs() > 2.0 && error.abs() < 3.0, "{error}");
    assert_stopped_on_the_path(&mut rig, &[Y]);
}

/// Y's limit in motion would not see it for long.
#[test]
fn a_following_error_is_less_at_rest() {
    let mut rig = Rig::new(
        "portal",
        &[(
            ALONE.0,
            &format!("{}\nfollowing_error_limit_at_rest = 0.2", ALONE.1),
        )],
        "G1 Y100 F30000\nG4 P0.2\nG1 Y100.5 F60\nM2\n",
        |_, _| (),
    );
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[1] > 100.1)
    });
    assert_eq!(rig.end(), None, "fast, its error is more: {:?}", rig.events);
    rig.twin(Y).disturb(Disturbance::Block(true));
    let fault = rig.finish_with_fault();
    let Fault::Axis(1, AxisCause::FollowingError { error, allowed }) = fault else {
        panic!("{fault:?}");
    };
    assert!(
        error.abs() > 0.2 && error.abs() < 0.3 && allowed < 0.21,
        "{error}, {allowed}"
    );
}

#[test]
fn an_actual_position_that_jumps() {
    let mut rig = moving();
    // By 4 mm, more than Z can move in a cycle.
    rig.bus().doctor = Some(Box::new(|it| {
        !is(it, CobId::t_pdo(2, node(Z)), &[])
            || doctored(it, |data| {
                let mut position = [0; 4];
                position.copy_from_slice(&data[2..6]);
                let jumped = i32::from_le_bytes(position) + 131_072 * 2 / 5;
                data[2..6].copy_from_slice(&jumped.to_le_bytes());
            })
    }));
    let fault = rig.finish_with_fault();
    let Fault::Axis(2, AxisCause::Jump { distance, possible }) = fault else {
        panic!("{fault:?}");
    };
    assert!(
        (distance - 4.0).abs() < 0.2 && possible < 2.0,
        "{distance}, {possible}"
    );
    assert_stopped_on_the_path(&mut rig, &[Z]);
}

#[test]
fn axes_that_stop_together_are_all_quick_stopped() {
    let together = ("[controller]\n", "[controller]\nstop_together = true\n");
    let mut rig = moving_with(&[together], |_, _| ());
    rig.twin(Z).disturb(Disturbance::LoseTPdos(2));
    let _ = rig.finish_with_fault();
    assert_stopped_on_the_path(&mut rig, &[0, X2, Y, Z]);
}

#[test]
fn what_follows_is_told_and_makes_a_harder_stop() {
    let mut rig = moving();
    rig.twin(Z).disturb(Disturbance::LoseTPdos(20));
    rig.run_to(Phase::Stop);
    rig.twin(X2)
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    let first = rig.finish_with_fault();
    assert_eq!(
        first,
        Fault::Device(Z, DeviceCause::MissingTPdo { misses: 2 })
    );
    let faults = rig.session.faults();
    assert_eq!(faults.len(), 2, "{faults:?}");
    assert_eq!(faults[0], first);
    assert!(matches!(faults[1], Fault::Device(X2, _)), "{faults:?}");
    assert_stopped_on_the_path(&mut rig, &[0, X2, Y, Z]);
}

#[test]
fn a_blocked_side_of_the_gantry_is_a_skew() {
    let mut rig = moving();
    rig.twin(X2).disturb(Disturbance::Block(true));
    let fault = rig.finish_with_fault();
    let Fault::Axis(axis, AxisCause::Skew { difference }) = fault else {
        panic!("{fault:?}");
    };
    assert_eq!(rig.layout.axes[axis].name, "X");
    assert!(difference > 0.5 && difference < 1.5, "{difference}");
    assert_stopped_on_the_path(&mut rig, quick_stopped(&fault));
}

#[test]
fn a_drive_that_supervises_itself_switches_off() {
    let mut rig = moving();
    // Its own limit, 6065h, is the same as the controller's, but it looks more often.
    rig.twin(Y).disturb(Disturbance::Block(true));
    let fault = rig.finish_with_fault();
    let expected = matches!(
        fault,
        Fault::Device(
            Y,
            DeviceCause::Emergency {
                emergency: Emergency {
                    vendor: [_, _, _, 0x20, 0xA3],
                    ..
                },
            }
        ) | Fault::Axis(_, AxisCause::FollowingError { .. })
    );
    assert!(expected, "{fault:?}");
    assert_stopped_on_the_path(&mut rig, &[Y]);
}

// --- the controller's own lateness ---

#[test]
fn a_dropped_burst_is_counted_and_does_not_shift_the_plan() {
    for interfere in [(|rig| rig.bus().drop_bursts = 1) as fn(&mut Rig), |rig| {
        rig.bus().delay_bursts = 1
    }] {
        let mut rig = moving();
        interfere(&mut rig);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        assert_eq!(rig.controller().late_setpoints(), 1);
        assert_eq!(positions(&rig), *NOMINAL);
    }
}

/// At rest setpoints are as those before. That an answer by SDO was in their way is no miss then (the campaign's
/// `answer-beside-a-homing-at-rest`); all else is.
#[test]
fn a_burst_that_is_late_or_dropped_at_rest_is_counted() {
    for interfere in [(|rig| rig.bus().drop_bursts = 1) as fn(&mut Rig), |rig| {
        rig.bus().delay_bursts = 1
    }] {
        let mut rig = Rig::portal("G21 G90\nG4 P0.5\nM2\n");
        rig.run_to_row(100);
        interfere(&mut rig);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        assert_eq!(rig.controller().late_setpoints(), 1);
    }
}

#[test]
fn two_dropped_bursts_in_a_row_three_in_a_thousand_cycles_or_a_torn_one_are_a_fault() {
    let fault = fault_in_motion(|rig| rig.bus().drop_bursts = 2);
    assert_eq!(fault, Fault::Bus(0, BusCause::LateSetpoints { count: 2 }));

    let fault = fault_in_motion(|rig| rig.bus().delay_bursts = 2);
    assert_eq!(fault, Fault::Bus(0, BusCause::LateSetpoints { count: 2 }));

    let fault = fault_in_motion(|rig| {
        for row in [0, 100, 200] {
            rig.run_to_row(ON_THE_ARC + row);
            rig.bus().drop_bursts = 1;
        }
    });
    assert_eq!(fault, Fault::Bus(0, BusCause::LateSetpoints { count: 3 }));

    let fault = fault_in_motion(|rig| rig.bus().tear_bursts = 1);
    assert_eq!(fault, Fault::Bus(0, BusCause::TornBurst));
}

#[test]
fn a_bus_that_is_gone() {
    let mut rig = moving();
    rig.bus().unplugged = true;
    assert_eq!(rig.finish_with_fault(), Fault::Bus(0, BusCause::Failed));
    rig.trace().assert_within_limits();
    // Nobody hears the controller any more: the drives' own supervision stops them.
}

#[test]
fn an_interrupt_stops_on_the_path() {
    let mut rig = moving();
    rig.controller().interrupt();
    assert_eq!(rig.finish(), End::Interrupted);
    assert_stopped_on_the_path(&mut rig, &[]);
    assert!(rig.rows.len() < NOMINAL.len(), "before the program's end");
}

// --- bring-up ---

fn as_configured(_: usize, _: &mut Config) {}

#[test]
fn a_drive_that_is_not_there() {
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.twin(Z).disturb(Disturbance::Mute(true))
    });
    assert_eq!(fault, Fault::Device(Z, DeviceCause::NoBootUp));
}

#[test]
fn a_drive_that_stops_answering() {
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.run_to(Phase::SetUp);
        rig.twin(X2).disturb(Disturbance::Mute(true));
    });
    let object = Address::new(0x1000, 0);
    assert_eq!(fault, Fault::Device(X2, DeviceCause::SdoTimeout { object }));
}

#[test]
fn another_device_with_the_nodes_id() {
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.twin(Y).disturb(Disturbance::Vendor(0x0000_00B7));
    });
    let expected = Fault::Device(
        Y,
        DeviceCause::WrongIdentity {
            object: Address::new(0x1018, 1),
            name: "vendor id",
            expected: 0x0800_005A,
            found: 0xB7,
        },
    );
    assert_eq!(fault, expected);
}

#[test]
fn a_set_up_write_that_is_refused() {
    let object = Address::new(0x60C2, 1);
    let code = AbortCode::InvalidValue;
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.twin(Y).disturb(Disturbance::RefuseWrite(object, code))
    });
    let expected = Fault::Device(
        Y,
        DeviceCause::WriteAborted {
            object,
            value: 2,
            code,
        },
    );
    assert_eq!(fault, expected);
}

#[test]
fn an_answer_that_breaks_the_protocol() {
    // The device begins an answer in segments, and the one that comes has the wrong toggle bit, or two
    // of four bytes.
    let segments: [([u8; 8], AbortCode); 2] = [
        ([0x17, 0x5A, 0, 0, 8, 0, 0, 0], AbortCode::ToggleBit),
        ([0x0B, 0x5A, 0, 0, 0, 0, 0, 0], AbortCode::LengthMismatch),
    ];
    for (segment, code) in segments {
        let fault = fault_in_bring_up(as_configured, |rig| {
            rig.bus().doctor = Some(Box::new(move |it| {
                let answers = CobId::t_sdo(node(Y));
                if is(it, answers, &[0x43, 0x18, 0x10, 1]) {
                    doctored(it, |data| *data = [0x41, 0x18, 0x10, 1, 4, 0, 0, 0].into())
                } else {
                    !is(it, answers, &[0x80]) || doctored(it, |data| *data = segment.into())
                }
            }));
        });
        let object = Address::new(0x1018, 1);
        let expected = DeviceCause::WrongAnswer { object, code };
        assert_eq!(fault, Fault::Device(Y, expected));
    }
}

#[test]
fn a_set_up_value_that_reads_back_as_another() {
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.bus().doctor = Some(Box::new(|it| {
            let answer = is(it, CobId::t_sdo(node(Y)), &[0x4F, 0xC2, 0x60, 1]);
            !answer || doctored(it, |data| data[4] = 4)
        }));
    });
    let expected = Fault::Device(
        Y,
        DeviceCause::ReadBack {
            object: Address::new(0x60C2, 1),
            expected: 2,
            found: 4,
        },
    );
    assert_eq!(fault, expected);
}

#[test]
fn an_object_that_refuses_to_be_read_back_is_told_and_no_fault() {
    let mut rig = Rig::portal("G0 X10\nM2\n");
    rig.bus().doctor = Some(Box::new(|it| {
        let answer = is(it, CobId::t_sdo(node(Y)), &[0x4B, 0x06, 0x30, 0x3D]);
        !answer
            || doctored(it, |data| {
                data.splice(.., [0x80, 0x06, 0x30, 0x3D, 1, 0, 1, 6])
                    .for_each(drop)
            })
    }));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let refused = Event::Refused {
        device: Y,
        object: Address::new(0x3006, 0x3D),
        code: AbortCode::WriteOnly,
    };
    assert!(rig.events.contains(&refused), "{:?}", rig.events);
}

#[test]
fn a_clock_that_does_not_follow_sync() {
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.bus().doctor = Some(Box::new(|it| {
            let answer = is(it, CobId::t_sdo(node(Z)), &[0x4B, 0x22, 0x30, 6]);
            !answer || doctored(it, |data| data[4] = 1)
        }));
    });
    assert_eq!(
        fault,
        Fault::Device(
            Z,
            DeviceCause::NoSyncLock {
                status: 1,
                assumption: "sync_locked"
            }
        )
    );
}

#[test]
fn a_drive_that_stays_enabled() {
    let fault = fault_in_bring_up(as_configured, |rig| {
        rig.bus().doctor = Some(Box::new(|it| {
            let answer = is(it, CobId::t_sdo(node(X2)), &[0x4B, 0x41, 0x60, 0]);
            !answer || doctored(it, |data| data[4] = 0x37)
        }));
    });
    assert!(
        matches!(fault, Fault::Device(X2, DeviceCause::StaysEnabled { .. })),
        "{fault:?}"
    );
}

/// A bus that fails while its drives are found, and is back before those of the other one are released: what was
/// being asked is forgotten, and nothing waits for it.
#[test]
fn a_bus_that_comes_back_while_the_other_one_is_released() {
    const SLOW: usize = 1;
    let mut rig = Rig::staying_on("mixed", &[], as_configured);
    let fails = |rig: &mut Rig| {
        rig.bus_at(SLOW).unplugged = true;
        rig.run_until(|rig| !rig.controller().faults().is_empty());
        rig.bus_at(SLOW).unplugged = false;
    };
    rig.run_until(|rig| rig.session.status().state == State::Ready);
    fails(&mut rig);
    rig.run_until(|rig| rig.session.status().state == State::Faulted);
    rig.bus_at(SLOW).doctor = Some(Box::new(|it| {
        let answer = is(it, CobId::t_sdo(node(Z)), &[0x4B, 0x41, 0x60, 0]);
        !answer || doctored(it, |data| data[4] = 0x37)
    }));
    rig.command(Command::Reset);
    rig.run_until(|rig| {
        let found = |event: &Event| matches!(event, Event::FoundEnabled { device: Z, .. });
        rig.events.iter().any(found)
    });
    fails(&mut rig);
    rig.run_until(|rig| rig.session.status().state == State::Faulted);
    let fault = Fault::Bus(SLOW, BusCause::Failed);
    assert_eq!(rig.controller().faults(), [fault]);
}

#[test]
fn a_drive_that_does_not_enable() {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    let slow = Disturbance::EnableTime(Duration::from_secs(3600));
    rig.twin(Z).disturb(slow);
    let fault = rig.finish_with_fault();
    let expected = matches!(
        fault,
        Fault::Device(
            Z,
            DeviceCause::StateTimeout {
                awaited: AwaitedState::Enabled,
                ..
            }
        )
    );
    assert!(expected, "{fault:?}");
    assert_eq!(rig.rows.len(), 0);
    assert_switched_off(&mut rig, &[0x00, 0x06, 0x0F, 0x06, 0x00]);
}

/// A side of a gantry that does not follow the other one is not waited for as long as a drive alone:
/// both are disabled again 50 cycles later.
#[test]
fn a_side_that_is_not_enabled_with_the_other() {
    for side in [X1, X2] {
        let mut rig = Rig::portal(PORTAL_PROGRAM);
        let slow = Disturbance::EnableTime(Duration::from_secs(3600));
        rig.twin(side).disturb(slow);
        let mut pulled = 0;
        while rig.step() {
            let powered = [X1, X2].map(|drive| rig.twin(drive).observe().is_powered);
            pulled += u32::from(powered[0] != powered[1]);
        }
        let Some(End::Fault(Fault::Device(drive, DeviceCause::StateTimeout { awaited, .. }))) =
            rig.end()
        else {
            panic!("{:?}", rig.end());
        };
        assert_eq!((drive, awaited), (side, AwaitedState::Enabled));
        // Two wake-ups a cycle, and some cycles until the command and its effect are there.
        assert!((100..120).contains(&pulled), "{pulled}");
    }
}

#[test]
fn another_operating_mode() {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.bus().doctor = Some(Box::new(|it| {
        let answer = is(it, CobId::t_sdo(node(Y)), &[0x4F, 0x61, 0x60, 0]);
        !answer || doctored(it, |data| data[4] = 1)
    }));
    assert_eq!(
        rig.finish_with_fault(),
        Fault::Device(
            Y,
            DeviceCause::WrongMode {
                object: Address::new(0x6061, 0),
                expected: 7,
                found: 1
            }
        )
    );
    assert_eq!(rig.rows.len(), 0);
    assert_switched_off(&mut rig, &[0x00, 0x06, 0x0F, 0x1F, 0x0F, 0x06, 0x00]);
}

#[test]
fn an_axis_that_does_not_stand_still_when_its_mode_starts() {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.run_to(Phase::ModeStart);
    // As if Y sagged by 1 mm once its setpoint was frozen.
    rig.bus().doctor = Some(Box::new(|it| {
        let sample = is(it, CobId::t_pdo(2, node(Y)), &[]);
        !sample
            || doctored(it, |data| {
                let mut position = [0; 4];
                position.copy_from_slice(&data[2..6]);
                let sagged = i32::from_le_bytes(position) + 131_072 / 20;
                data[2..6].copy_from_slice(&sagged.to_le_bytes());
            })
    }));
    let fault = rig.finish_with_fault();
    let Fault::Axis(1, AxisCause::Standstill { distance }) = fault else {
        panic!("{fault:?}");
    };
    assert!((distance - 1.0).abs() < 0.01, "{distance}");
    assert_eq!(rig.rows.len(), 0, "nothing moved");
    assert_switched_off(&mut rig, &[0x00, 0x06, 0x0F, 0x1F, 0x0F, 0x06, 0x00]);
}

/// Moves drives away from where their axis rests, in millimetres of the portal's X and Y.
fn displaced(drives: &[usize], mm: f64) -> impl Fn(usize, &mut Config) {
    move |drive, config| {
        if drives.contains(&drive) {
            // X2 is mirrored.
            let sign = if drive == X2 { -1.0 } else { 1.0 };
            config.position += sign * mm / 20.0;
        }
    }
}

#[test]
fn an_axis_outside_its_soft_limits() {
    let fault = fault_in_bring_up(displaced(&[Y], -1.0), |_| ());
    let Fault::Axis(1, AxisCause::OutsideSoftLimits { position }) = fault else {
        panic!("{fault:?}");
    };
    assert!((position + 1.0).abs() < 0.01, "{position}");
    let fault = fault_in_bring_up(displaced(&[0, X2], 1501.0), |_| ());
    assert!(
        matches!(fault, Fault::Axis(0, AxisCause::OutsideSoftLimits { .. })),
        "{fault:?}"
    );
}

#[test]
fn a_gantry_that_stands_askew() {
    let fault = fault_in_bring_up(displaced(&[0], 0.6), |_| ());
    let Fault::Axis(0, AxisCause::Skew { difference }) = fault else {
        panic!("{fault:?}");
    };
    assert!((difference - 0.6).abs() < 0.01, "{difference}");
}

#[test]
fn a_program_that_cannot_start_where_the_machine_stands() {
    // Good from where it is checked, X0; from X1400 its relative move leaves the soft limits.
    let program = "G91 G1 X200 F6000\nM2\n";
    let mut rig = Rig::new("portal", &[], program, displaced(&[0, X2], 1400.0));
    assert_eq!(rig.finish_with_fault(), Fault::Program);
    assert!(
        positions(&rig)
            .iter()
            .all(|it| (it[0] - 1400.0).abs() < 0.01),
        "nothing moved"
    );
    assert_switched_off(&mut rig, &[0x00, 0x06, 0x0F, 0x1F, 0x0F, 0x06, 0x00]);
}
