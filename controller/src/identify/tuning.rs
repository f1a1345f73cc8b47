//! Gains that suit an axis as it was found, and the shaper for what they leave swinging.
//!
//! The loops are those of the simulated drives ([`stability`](syncline_drives::twin::servo::stability)): a real drive of
//! the same structure is near them, as far as its filters are. The axis is the one that was found. What the log does not show is
//! taken to be at its worst: a load of which no swing was seen swings right above the highest frequency that was, hardly
//! damped.

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

/// Gains for an axis, and what they come to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuned {
    /// Speed loop, N·m·s/rad.
    pub speed_gain: f64,
    /// Its integral time, s.
    pub integral_time_s: f64,
    /// Position loop, 1/s.
    pub position_gain: f64,
    /// How far the loops are from swinging.
    pub stability: Stability,
    /// What is left swinging: of the position loop, with less than 0.3 of damping.
    pub swing: Option<Mode>,
    /// What sets them in the drive, as `sdo` of the machine file has it; empty where its objects are not known.
    pub sdo: Vec<(String, u32)>,
}

impl Tuned {
    /// For an axis that was found; `None` where no gains keep it from swinging.
    #[must_use]
    pub fn of(estimate: &Estimate, motor: &Motor, rotor: f64, drive: &dyn Drive) -> Option<Self> {
        let stiff = DriveTrain {
            rotor_inertia: rotor,
            load_inertia: (estimate.inertia.value - rotor).max(0.0),
            elasticity: None,
            ..DriveTrain::default()
        };
        let like = Gains::commissioned(motor, &stiff);
        let tuning = Tuning::new(train(estimate, rotor)?, CURRENT_BANDWIDTH);
        let gains = tuning.tuned(&like, &DISTANCE)?;
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
            stability: tuning.stability(&gains)?,
            swing: tuning.slowest_swing(&gains),
            sdo: sdo.collect(),
        })
    }
}

/// What was found as inertias and a spring; `None` if the motor alone has more inertia than that.
fn train(estimate: &Estimate, rotor: f64) -> Option<DriveTrain> {
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
    let hertz = swing.map_or(estimate.seen_to_hz, |it| it.antiresonance.value);
    let damping = swing.and_then(|it| it.damping).map(|it| it.value);
    let damping = damping.unwrap_or(LEAST_DAMPING).min(1.0);
    let stiffness = load * (TAU * hertz).powi(2);
    Some(DriveTrain {
        rotor_inertia: rotor,
        load_inertia: load,
        elasticity: Some(Elasticity::damped(stiffness, damping, [rotor, load])),
        bearing: Friction::coulomb(0.0),
        guide: Friction {
            viscous: estimate.viscous_friction.value.max(0.0),
            ..Friction::coulomb(0.0)
        },
        ..DriveTrain::default()
    })
}
