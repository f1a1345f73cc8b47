//! Gains that suit an axis as it was found, and the shaper for what they leave swinging.
//!
//! The loops are those of the simulated drives ([`stability`](syncline_drives::twin::servo::stability)): a real drive of
//! the same structure is near them, as far as its filters are. The axis is the one that was found. What the log does not show is
//! taken to be at its worst: a load of which no swing was seen swings anywhere above the highest frequency that was, hardly
//! damped. Which frequency is worst depends on load and gains: a heavy load that swings a little above the loops' bandwidth can be
//! worse than one in it. So gains keep their distance at each of some frequencies, and the least of the margins is told. A stiff axis
//! could have loops that are several times as fast, and no log tells it from one that swings further up: gains for one that swings nowhere
//! are told besides, for a person to try.

use super::estimate::{Estimate, Swing};
use serde::Serialize;
use std::f64::consts::TAU;
use syncline_drives::mechanics::drive_train::{DriveTrain, Elasticity};
use syncline_drives::mechanics::friction::Friction;
use syncline_drives::model::{Drive, LoopGains};
use syncline_drives::twin::servo::cascade::Gains;
use syncline_drives::twin::servo::motor::Motor;
use syncline_drives::twin::servo::power_stage::CURRENT_BANDWIDTH;
use syncline_drives::twin::servo::stability::{Distance, Mode, Stability, Tuning};

/// More than what is promised, 45° and 8 dB, by as much as an axis may be off what was found of it.
const DISTANCE: Distance = Distance {
    phase: 50.0,
    gain: 9.5,
    peak: 1.1,
};

/// Damping ratio of a swing of which none is known.
const LEAST_DAMPING: f64 = 0.01;

/// Where a swing may be that was not seen, by the highest frequency at which one would have been. Further up even a heavy load
/// takes hardly any phase from loops that are slow enough for these.
const UNSEEN: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0];

/// Gains for an axis, and what they come to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuned {
    /// Speed loop, N·m·s/rad.
    pub speed_gain: f64,
    /// Its integral time, s.
    pub integral_time_s: f64,
    /// Position loop, 1/s.
    pub position_gain: f64,
    /// How far the loops are from swinging at least, wherever a swing may be that was not seen.
    pub stability: Stability,
    /// What is left swinging: of the position loop, with less than 0.3 of damping; what takes longest to die out.
    pub swing: Option<Mode>,
    /// What sets them in the drive, as `sdo` of the machine file has it; empty where its objects are not known.
    pub sdo: Vec<(String, u32)>,
}

impl Tuned {
    /// For an axis that was found; `None` where no gains keep it from swinging.
    #[must_use]
    pub fn of(estimate: &Estimate, motor: &Motor, rotor: f64, drive: &dyn Drive) -> Option<Self> {
        let trains = trains(estimate, rotor)?;
        Self::for_all(trains, estimate, motor, rotor, drive)
    }

    /// For one of which no swing was seen, if it has none; `None` where one was.
    #[must_use]
    pub fn if_stiff(
        estimate: &Estimate,
        motor: &Motor,
        rotor: f64,
        drive: &dyn Drive,
    ) -> Option<Self> {
        let stiff = train(estimate, [rotor, estimate.inertia.value - rotor], None);
        let is_told = estimate.swing.is_none() && stiff.load_inertia > 0.0;
        is_told.then(|| Self::for_all(vec![stiff], estimate, motor, rotor, drive))?
    }

    /// For each of these axes, any of which it may be.
    fn for_all(
        trains: Vec<DriveTrain>,
        estimate: &Estimate,
        motor: &Motor,
        rotor: f64,
        drive: &dyn Drive,
    ) -> Option<Self> {
        let (gains, tunings) = proposed(trains, estimate, motor, rotor)?;
        let stability = tunings.iter().map(|it| it.stability(&gains));
        let stability = stability.reduce(|one, other| Some(one?.least(&other?)))??;
        let swings = tunings.iter().filter_map(|it| it.slowest_swing(&gains));
        let writes = drive.tuning(&LoopGains {
            speed: gains.speed / motor.torque_constant,
            integral_time: gains.speed_integral_time,
            position: gains.position,
        });
        let sdo = writes.iter().map(|write| {
            let at = write.address;
            (format!("{:04X}:{}", at.index, at.sub), write.data.bits())
        });
        Some(Self {
            speed_gain: gains.speed / TAU,
            integral_time_s: gains.speed_integral_time,
            position_gain: gains.position,
            stability,
            swing: swings.min_by(|one, other| one.rate().total_cmp(&other.rate())),
            sdo: sdo.collect(),
        })
    }
}

/// Gains for an axis that was found, and all that it may be.
fn proposed(
    trains: Vec<DriveTrain>,
    estimate: &Estimate,
    motor: &Motor,
    rotor: f64,
) -> Option<(Gains, Vec<Tuning>)> {
    let stiff = DriveTrain {
        rotor_inertia: rotor,
        load_inertia: (estimate.inertia.value - rotor).max(0.0),
        elasticity: None,
        ..DriveTrain::default()
    };
    let like = Gains::commissioned(motor, &stiff);
    let tunings: Vec<_> = (trains.into_iter())
        .map(|train| Tuning::new(train, CURRENT_BANDWIDTH))
        .collect();
    Some((tuned(&tunings, &like)?, tunings))
}

/// Gains that keep their distance on each of these axes; `None` if there are none. Sought for those alone that bound them.
fn tuned(all: &[Tuning], like: &Gains) -> Option<Gains> {
    let mut bounding: Vec<&Tuning> = all.iter().take(1).collect();
    loop {
        let gains = Tuning::tuned_for(&bounding, like, &DISTANCE)?;
        match all.iter().find(|it| !it.keeps(&gains, &DISTANCE)) {
            // What bounds them already cannot be kept.
            Some(short) if bounding.iter().any(|it| std::ptr::eq(*it, short)) => return None,
            Some(short) => bounding.push(short),
            None => return Some(gains),
        }
    }
}

/// What was found as inertias and a spring, one for each place of a swing that was not seen; `None` if the motor alone has more
/// inertia than that.
fn trains(estimate: &Estimate, rotor: f64) -> Option<Vec<DriveTrain>> {
    let inertia = estimate.inertia.value;
    let swing = estimate.swing.as_ref();
    let resonance = swing.and_then(|it| Some((it, it.resonance?.value)));
    let rotor = match resonance {
        Some((Swing { antiresonance, .. }, resonance)) => {
            inertia * (antiresonance.value / resonance).powi(2)
        }
        None => rotor,
    };
    let load = inertia - rotor;
    if load <= 0.0 {
        return None;
    }
    let places = match swing {
        Some(swing) => vec![swing.antiresonance.value],
        None => UNSEEN.map(|by| by * estimate.seen_to_hz).into(),
    };
    let damping = swing.and_then(|it| it.damping).map(|it| it.value);
    let damping = damping.unwrap_or(LEAST_DAMPING).min(1.0);
    let at = |hertz: f64| {
        let stiffness = load * (TAU * hertz).powi(2);
        let spring = Elasticity::damped(stiffness, damping, [rotor, load]);
        train(estimate, [rotor, load], Some(spring))
    };
    Some(places.into_iter().map(at).collect())
}

/// What was found as a rotor and a load, with what is between them.
fn train(estimate: &Estimate, [rotor, load]: [f64; 2], spring: Option<Elasticity>) -> DriveTrain {
    DriveTrain {
        rotor_inertia: rotor,
        load_inertia: load,
        elasticity: spring,
        bearing: Friction::coulomb(0.0),
        guide: Friction {
            viscous: estimate.viscous_friction.value.max(0.0),
            ..Friction::coulomb(0.0)
        },
        ..DriveTrain::default()
    }
}

#[cfg(test)]
mod tests {
    use super::super::estimate::Figure;
    use super::*;
    use proptest::prelude::*;
    use syncline_drives::twin::servo::motor::MOTORS;

    /// What is promised.
    const PROMISED: Distance = Distance {
        phase: 45.0,
        gain: 8.0,
        peak: f64::INFINITY,
    };

    /// An axis of which no swing was seen up to so many Hz.
    fn without_swing(inertia: f64, seen_to_hz: f64) -> Estimate {
        let figure = |value| Figure {
            value,
            uncertainty: 0.0,
        };
        Estimate {
            inertia: figure(inertia),
            friction: figure(0.0),
            viscous_friction: figure(0.0),
            holding_torque: figure(0.0),
            torque_delay_s: 0.0,
            swing: None,
            seen_to_hz,
            moving_s: 1.0,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

        /// Wherever above all that the log shows a load swings, however heavy it is: its loops keep what is promised.
        #[test]
        fn a_swing_that_was_not_seen_leaves_what_is_promised(
            motor in prop::sample::select(&MOTORS[..]),
            ratio in 0.5..6.0_f64,
            seen in 20.0..100.0_f64,
            by in prop::collection::vec((1.0..8.0_f64, 0.01..0.1_f64), 24),
        ) {
            let rotor = motor.rotor_inertia;
            let load = ratio * rotor;
            let estimate = without_swing(rotor + load, seen);
            let may_be = trains(&estimate, rotor).expect("it has a load");
            let found = proposed(may_be, &estimate, &motor, rotor);
            let (gains, _) = found.expect("slow loops hold it");
            for (by, damping) in by {
                let train = DriveTrain {
                    rotor_inertia: rotor,
                    load_inertia: load,
                    elasticity: Some(Elasticity::damped(
                        load * (TAU * by * seen).powi(2),
                        damping,
                        [rotor, load],
                    )),
                    bearing: Friction::coulomb(0.0),
                    guide: Friction::coulomb(0.0),
                    ..DriveTrain::default()
                };
                let truth = Tuning::new(train, CURRENT_BANDWIDTH).stability(&gains);
                prop_assert!(
                    truth.is_some_and(|it| it.keeps(&PROMISED)),
                    "{} {ratio} at {by} x {seen} Hz, {damping}: {truth:?}",
                    motor.name
                );
            }
        }
    }
}
