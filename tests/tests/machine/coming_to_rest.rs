//! What is waited for until power is taken off: drives that brake by themselves have the time for it from when each of them was
//! told to, and a spindle has the time to stand, whatever ends the stop.

use super::day::{settle, state};
use super::driven_spindle::turns_at;
use proptest::prelude::*;
use syncline_canopen::{CobId, Frame};
use syncline_controller::control::{Phase, State};
use syncline_controller::session::Command;
use syncline_tests::rig::Rig;

/// Y of the drill goes point to point beside the path.
const BESIDE: [(&str, &str); 3] = [
    (
        "node = 2\nmodel = \"lxm32m\"",
        "node = 2\nmodel = \"tlc5xx\"",
    ),
    (
        "drives = [\"Y\"]\n",
        "drives = [\"Y\"]\nmotion = \"point_to_point\"\n",
    ),
    ("cycle_us = 2000", "cycle_us = 4000"),
];

/// Where an axis beside the path is stopped on its way its drive goes off, and so do all; the spindle stands by then.
#[test]
fn the_spindle_stands_before_its_drive_goes_off_with_that_of_an_axis_beside_the_path() {
    let mut rig = Rig::staying_on("drill", &BESIDE, |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig.command(Command::Mdi("M3 S3000\nG4 P1\nG0 Y100".to_owned()));
    rig.run_until(|rig| rig.twin(1).observe().velocity.abs() > 1.0);
    assert!(turns_at(&mut rig) > 2900.0);
    rig.command(Command::Stop);
    rig.run_to(Phase::ModeEnd);
    let turns = turns_at(&mut rig).abs();
    assert!(turns < 10.0, "{turns} 1/min");
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
}

/// A portal whose Y takes longer to rest than a drive is given for a change of its state.
const SLOW: [(&str, &str); 2] = [
    (
        "max_acceleration = 5000.0\nmax_jerk = 100_000.0",
        "max_acceleration = 300.0\nmax_jerk = 10_000.0",
    ),
    (
        "heartbeat_ms = 100\n",
        "heartbeat_ms = 100\nstate_timeout_ms = 400\n",
    ),
];
const Y: usize = 2;
const QUICK_STOP: u16 = 0x0B;

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Whenever in a stop, long or short: a drive that is quick-stopped then is not switched off while it brakes.
    #[test]
    fn a_drive_that_is_quick_stopped_late_in_a_stop_brakes_before_it_is_off(cycles in 0..350_usize) {
        let mut rig = Rig::staying_on("portal", &SLOW, |_, _| ());
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready);
        rig.command(Command::Mdi("G1 Y900 F18000".to_owned()));
        rig.run_until(|rig| rig.session.status().velocity[1] > 299.0);
        rig.command(Command::Stop);
        rig.run_to(Phase::Stop);
        for _ in 0..2 * cycles {
            rig.step();
        }
        // What its drive tells of its position jumps.
        let told = CobId::t_pdo(2, rig.machine.drives[Y].node);
        rig.bus().doctor = Some(Box::new(move |received| {
            let frame = &received.frame;
            if frame.id() == told.into()
                && let [s0, s1, p0, p1, p2, p3] = *frame.data()
            {
                let position = i32::from_le_bytes([p0, p1, p2, p3]) + 200_000;
                let [p0, p1, p2, p3] = position.to_le_bytes();
                received.frame = Frame::new(told, &[s0, s1, p0, p1, p2, p3]);
            }
            true
        }));
        let word = |rig: &Rig| rig.commands(Y).last().map(|it| it.1);
        rig.run_until(|rig| word(rig) == Some(QUICK_STOP));
        rig.run_until(|rig| word(rig) != Some(QUICK_STOP));
        let speed = rig.twin(Y).observe().velocity.abs();
        prop_assert!(speed < 0.05, "{} revolutions a second", speed);
    }
}
