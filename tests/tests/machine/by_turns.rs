//! A gantry whose sides are heard by turns: each tells its position often enough, and never both at one SYNC.

use super::day::{go, settle, state};
use proptest::prelude::*;
use syncline_canopen::{CobId, Frame};
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{End, Fault, State};
use syncline_controller::session::Command;
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// Of every two T_PDOs of a side one is lost, of the other side the other one; and what the second side tells goes on by so
/// many increments in each, up to so many, as if it did.
fn hear_by_turns(rig: &mut Rig, step: i32, most: i32) {
    let sides = [0, 1].map(|side| CobId::t_pdo(2, rig.machine.drives[side].node));
    let (mut heard, mut off) = ([0_u32, 1], 0);
    rig.bus().doctor = Some(Box::new(move |received| {
        let frame = &received.frame;
        let Some(side) = sides.iter().position(|id| frame.id() == (*id).into()) else {
            return true;
        };
        heard[side] += 1;
        if side == 1
            && let [s0, s1, p0, p1, p2, p3] = *frame.data()
        {
            off = (off + step).clamp(-most, most);
            let position = i32::from_le_bytes([p0, p1, p2, p3]) + off;
            let [p0, p1, p2, p3] = position.to_le_bytes();
            received.frame = Frame::new(sides[1], &[s0, s1, p0, p1, p2, p3]);
        }
        heard[side] % 2 == 0
    }));
}

#[test]
fn a_gantry_that_is_heard_by_turns_goes_on() {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.run_to_row(10);
    hear_by_turns(&mut rig, 0, 0);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// At rest and in motion: sides that go apart are stopped, though no SYNC is answered by both.
    #[test]
    fn sides_that_go_apart_are_stopped_though_they_are_heard_by_turns(
        moves: bool, cycles in 0..400_usize, step in prop_oneof![20..200_i32, -200..-20_i32],
    ) {
        let mut rig = Rig::staying_on("portal", &[], |_, _| ());
        settle(&mut rig);
        if moves {
            rig.command(Command::Mdi("G1 X900 F18000".to_owned()));
        }
        for _ in 0..2 * cycles {
            rig.step();
        }
        let resolution = rig.machine.drives[1].scaling.resolution();
        let skew = rig.machine.axes[0].limits.skew.unwrap();
        // Nearer together than a following error of one of them.
        hear_by_turns(&mut rig, step, (1.3 * skew / resolution) as i32);
        for _ in 0..2000 {
            rig.step();
        }
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Faulted);
        let fault = rig.session.faults()[0];
        prop_assert!(matches!(fault, Fault::Axis(0, AxisCause::Skew { .. })), "{:?}", fault);
        rig.bus().doctor = None;
        go(&mut rig, Command::SwitchOff);
    }
}
