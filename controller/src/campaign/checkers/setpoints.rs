//! Setpoints as drives are sent them are within the limits of velocity, acceleration and jerk, and inside
//! the soft limits, whatever happens.
//!
//! Positions at SYNCs that follow each other bound what the motion between them did: the n-th difference
//! over strides of m cycles of T is (m T)ⁿ times a mean of the n-th derivative, and off by 2ⁿ halves of an
//! increment. Where a setpoint is missing nothing is certain across the gap but a mean velocity, and the
//! differences begin anew.

use super::{Checker, Found, Scene};
use crate::machine::{AxisLimits, Machine};
use std::collections::VecDeque;
use syncline_canopen::Instant;
use syncline_drives::model::Increments;

const NAME: &str = "setpoints";

/// Cycles from one position of a difference to the next.
const STRIDES: [usize; 3] = [1, 4, 16];
/// Positions that are kept.
const KEPT: usize = 3 * STRIDES[STRIDES.len() - 1] + 1;

/// Rounding to an increment, halves of it: with what the conversion before it may add.
const ROUNDED: f64 = 0.501;
/// Numbers are rounded, too; a limit may be exceeded by this part.
const ROUNDING: f64 = 1e-6;

/// See the module.
pub(super) struct Setpoints {
    /// By drive: positions that were in effect at SYNCs in a row, mm, the newest first; the cycle of it, and when it came.
    drives: Vec<(VecDeque<f64>, u64, Instant)>,
}

impl Setpoints {
    pub(super) fn new(machine: &Machine) -> Self {
        let none = (VecDeque::with_capacity(KEPT + 1), 0, Instant::ZERO);
        Self {
            drives: vec![none; machine.drives.len()],
        }
    }

    fn latched(&mut self, scene: &Scene<'_>, drive: usize, cycle: u64, found: &mut Found) {
        let spec = &scene.machine.drives[drive];
        let axis = &scene.machine.axes[spec.axis];
        let (positions, last, came_at) = &mut self.drives[drive];
        let it = &scene.drives[drive];
        let Some(latched) = it.latched.filter(|_| it.in_effect) else {
            positions.clear();
            return;
        };
        let increment = spec.scaling.resolution();
        let limits = &axis.sent_limits;
        if scene.is_placed(spec.axis) {
            outside(scene, drive, latched, &axis.limits, increment, found);
        }
        // An axis that is set where it stands does not move by that.
        let position = spec.scaling.to_mm(latched);
        if it.latched_of != 1 {
            // Nothing new came, or more than one: what it stands for is not certain.
            positions.clear();
            return;
        }
        // Bursts leave at one instant of the cycle. One that is held up until behind its SYNC and one that is not follow each other
        // in two cycles although what came between them is lost.
        let earlier = std::mem::replace(came_at, it.came_at);
        let (cycle_time, apart) = (scene.machine.cycle, it.came_at.saturating_since(earlier));
        if apart.abs_diff(cycle_time) > cycle_time / 20 {
            positions.clear();
        }
        // Behind a SYNC that was left out drives latch what was meant for that one, and then go on with the
        // setpoints of their own instants.
        if std::mem::replace(last, cycle) + 1 != cycle {
            positions.clear();
            return;
        }
        positions.truncate(KEPT - 1);
        positions.push_front(position);
        let allowed = [
            ("velocity", limits.velocity),
            ("acceleration", limits.acceleration),
            ("jerk", limits.jerk),
        ];
        for stride in STRIDES {
            let time = stride as f64 * scene.period();
            let mut over = 1.0;
            for (order, (what, limit)) in allowed.into_iter().enumerate() {
                over *= time;
                let Some(difference) = difference(positions, stride, order + 1) else {
                    break;
                };
                let off = ROUNDED * increment * f64::from(2 << order);
                let certain = (difference.abs() - off) / over;
                if certain > limit * (1.0 + ROUNDING) {
                    found.violate(NAME, scene, what, || {
                        let name = &spec.name;
                        format!("drive {name}: {certain}, allowed {limit}, over {stride} cycles")
                    });
                }
            }
        }
    }
}

/// The difference of an order over strides of so many cycles, if there are positions enough.
fn difference(positions: &VecDeque<f64>, stride: usize, order: usize) -> Option<f64> {
    let at = |k: usize| positions.get(k * stride).copied();
    Some(match order {
        1 => at(0)? - at(1)?,
        2 => at(0)? - 2.0 * at(1)? + at(2)?,
        _ => at(0)? - 3.0 * (at(1)? - at(2)?) - at(3)?,
    })
}

/// Looks for a position outside of the soft limits. Where an axis is frozen it stands as it was found,
/// and each side of a gantry keeps its own offset, also where it was set with its sides apart; one that was homed may be beside its place
/// by what that is uncertain.
fn outside(
    scene: &Scene<'_>,
    drive: usize,
    latched: Increments,
    limits: &AxisLimits,
    increment: f64,
    found: &mut Found,
) {
    let axis = scene.machine.drives[drive].axis;
    let position = scene.axis(axis, scene.mm(drive, latched));
    let (least, most) = limits.position;
    let beyond = (least - position).max(position - most);
    let coupling = scene.machine.axes[axis].cross_coupling;
    let aside = limits.skew.unwrap_or(0.0)
        + scene.uncertainty[axis]
        + scene.unknown(axis)
        + 0.5 * scene.set_apart[axis]
        + 0.5 * coupling.map_or(0.0, |it| it.limit);
    let allowed = limits.standstill + aside + increment;
    if beyond > allowed {
        found.violate(NAME, scene, "soft limits", || {
            let name = &scene.machine.drives[drive].name;
            format!("drive {name}: {position} mm is {beyond} mm outside, allowed {allowed}")
        });
    }
}

impl Checker for Setpoints {
    fn sync(&mut self, scene: &Scene<'_>, bus: usize, found: &mut Found) {
        for &drive in scene.drives_of(bus) {
            match scene.syncs[bus] {
                Some(cycle) => self.latched(scene, drive, cycle, found),
                None => self.drives[drive].0.clear(),
            }
        }
    }
}
