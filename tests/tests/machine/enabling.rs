//! Drives that are told to be enabled are watched from the cycle on in which they are: what moves then, and what jumps, is no
//! axis that stands.

use super::day::{settle, state};
use proptest::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use syncline_canopen::{CobId, Frame};
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{Fault, Phase, State};
use syncline_tests::rig::Rig;

/// Drives of the portal, two of which are the sides of X.
const DRIVES: usize = 4;

/// The bits of a statusword that tell the state of the power stage, and those of an enabled one.
const STATE: u16 = 0x6F;
const ENABLED: u16 = 0x27;

/// A portal of which one drive tells to go on by so many increments in each cycle, from so many cycles on since it told to
/// be enabled; and how far it has told to have gone.
fn portal(drive: usize, after: usize, step: i32, cycles: usize) -> (Rig, Arc<AtomicI64>) {
    let mut rig = Rig::staying_on("portal", &[], |_, _| ());
    let told = CobId::t_pdo(2, rig.machine.drives[drive].node);
    let gone = Arc::new(AtomicI64::new(0));
    let (mut since, moved) = (0_usize, Arc::clone(&gone));
    rig.bus().doctor = Some(Box::new(move |received| {
        let frame = &received.frame;
        if frame.id() == told.into()
            && let [s0, s1, p0, p1, p2, p3] = *frame.data()
        {
            let enabled = u16::from_le_bytes([s0, s1]) & STATE == ENABLED;
            since += usize::from(enabled);
            let steps = since.saturating_sub(after).min(cycles) as i32;
            moved.store(i64::from(step * steps), Ordering::Relaxed);
            let position = i32::from_le_bytes([p0, p1, p2, p3]) + step * steps;
            let [p0, p1, p2, p3] = position.to_le_bytes();
            received.frame = Frame::new(told, &[s0, s1, p0, p1, p2, p3]);
        }
        true
    }));
    (rig, gone)
}

/// The axis of a drive.
fn axis(drive: usize) -> usize {
    drive.saturating_sub(1)
}

fn resolution(rig: &Rig, drive: usize) -> f64 {
    rig.machine.drives[drive].scaling.resolution()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// A drive that runs away as it is enabled, or behind that, is switched off before it has gone further than it may at
    /// rest, and what it goes in some cycles besides.
    #[test]
    fn a_drive_that_runs_away_as_it_is_enabled_is_told_at_once(
        drive in 0..DRIVES, after in 1..60_usize, speed in prop_oneof![10.0..600.0_f64, -600.0..-10.0_f64],
    ) {
        let at_rest = Rig::staying_on("portal", &[], |_, _| ());
        let per_cycle = speed * 0.002 / resolution(&at_rest, drive);
        let (mut rig, gone) = portal(drive, after, per_cycle as i32, usize::MAX);
        rig.run_until(|rig| !rig.session.faults().is_empty());
        let fault = rig.session.faults()[0];
        prop_assert!(matches!(fault, Fault::Axis(of, _) if of == axis(drive)), "{:?}", fault);
        let gone = gone.load(Ordering::Relaxed).unsigned_abs() as f64 * resolution(&rig, drive);
        let limits = &rig.machine.axes[axis(drive)].limits;
        let most = limits.following_error_at(0.0) + 5.0 * speed.abs() * 0.002;
        prop_assert!(gone <= most, "{} of {}: {:?}", gone, most, fault);
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Faulted);
    }

    /// A position that jumps before the setpoint is frozen there is not where the machine begins.
    #[test]
    fn no_setpoint_is_frozen_where_a_position_has_jumped_to(
        drive in 0..DRIVES, after in 2..24_usize, jump in prop_oneof![4.0..50.0_f64, -50.0..-4.0_f64],
    ) {
        let at_rest = Rig::staying_on("portal", &[], |_, _| ());
        let counts = (jump / resolution(&at_rest, drive)) as i32;
        let (mut rig, _) = portal(drive, after, counts, 1);
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Faulted);
        let fault = rig.session.faults()[0];
        let told = matches!(
            fault,
            Fault::Axis(of, AxisCause::Jump { .. } | AxisCause::Standstill { .. }) if of == axis(drive)
        );
        prop_assert!(told, "{:?}", fault);
        prop_assert!(rig.phases.iter().all(|(phase, _)| *phase != Phase::Program), "{:?}", rig.phases);
    }
}
