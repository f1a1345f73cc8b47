//! How far the sides of a gantry get apart where one of them is held fast: no further than docs/supervision.md says.

use super::homing::{settle, state, truth};
use proptest::prelude::*;
use syncline_controller::control::{Event, State};
use syncline_drives::twin::Disturbance;
use syncline_tests::rig::Rig;

/// How an LXM32M brakes in a quick stop, 3006h:12 as it is delivered, mm/s².
pub(super) fn braking(rig: &Rig) -> f64 {
    let travel = rig.machine.drives[0].scaling.travel_per_revolution();
    6000.0 / 60.0 * travel.abs()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    /// Whichever side sticks, at whatever speed and instant: beyond its limit the skew grows by four cycles of that speed and
    /// the way of a quick stop from there, and the machine stays stopped.
    #[test]
    fn skew_passes_its_limit_by_what_is_stated_at_most(
        speed in 5.0..700.0f64,
        limit in 0.05..1.9f64,
        cycles in 0..300usize,
        held in 0..2usize,
    ) {
        let skew = format!("skew_limit = {limit:?}");
        let program = format!("G21 G90\nG1 X1400 F{:.3}\nM2\n", speed * 60.0);
        let mut rig = Rig::new("portal", &[("skew_limit = 0.5", &skew)], &program, |_, _| ());
        rig.run_until(|rig| rig.session.status().velocity[0] > 0.0);
        for _ in 0..2 * cycles {
            rig.step();
        }
        prop_assume!(rig.end().is_none() && rig.session.status().velocity[0] > 0.0);
        rig.twin(held).disturb(Disturbance::Block(true));
        let (mut apart, mut fastest) = (0.0_f64, 0.0_f64);
        while rig.step() {
            apart = apart.max((truth(&mut rig, 1) - truth(&mut rig, 0)).abs());
            fastest = fastest.max(rig.session.status().velocity[0]);
        }
        let axis = &rig.machine.axes[0].limits;
        let cycle = rig.machine.cycle.as_secs_f64();
        // What is on its way to the drives as they are quick-stopped may be faster.
        fastest = (fastest + 2.0 * cycle * axis.acceleration).min(axis.velocity);
        let stated = limit + 4.0 * cycle * fastest + fastest * fastest / (2.0 * braking(&rig));
        // Its loop overshoots as it stops.
        prop_assert!(apart <= stated + 0.1, "{} of {} at {} mm/s", apart, stated, fastest);
        let fault = rig.events.iter().find(|event| matches!(event, Event::Fault(_)));
        prop_assert!(fault.is_some(), "{:?}", rig.events);
    }
}

/// Where the middle of a gantry is inside its soft limits it may be enabled, and taken square, also with a side outside.
#[test]
fn a_gantry_that_is_askew_at_the_end_of_its_travel_is_enabled() {
    for (start, skew) in [(0.2, -0.4), (1499.8, 0.4)] {
        let skewed = format!(
            "drive_soft_limits = true\nsimulation = {{ start = {start:?}, start_skew = {skew:?} }}\n"
        );
        let skewed = [("drive_soft_limits = true\n", &skewed[..])];
        let mut rig = Rig::staying_on("portal", &skewed, |_, _| ());
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let apart = truth(&mut rig, 1) - truth(&mut rig, 0);
        assert!(apart.abs() < 0.01, "{apart}");
    }
}
