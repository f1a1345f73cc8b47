//! Moves of axes that go point to point: their drives take no setpoints along a path, but a target, to which they go
//! by profiles of their own while the path rests.
//!
//! *Straight.* Several axes in one move share a trapezoidal profile, s from 0 to 1: axis i is at
//! p + d s, where d is how far it goes. Its drive is told the velocity V d and the ramps A d, with V the least of
//! v/d over the axes and A the least of a/d, so that no axis exceeds its limits, and all get there at once.
//! The profiles are told by SDO while the axes rest; the targets then go out in one burst, so that what latches at
//! SYNC sets off at one SYNC, and what does not sets off as its frame arrives. What is left is what the drives'
//! units round (`Drive::profile`), the time between these starts, and each drive's own lag: see
//! `docs/point-to-point.md`.
//!
//! *On its own.* While a drive goes, its axis is where it says, and has no setpoint to be held against; what tells
//! that something is wrong is that it is not there, at rest, within `standstill_window` and by what its drive tells, in twice the
//! time that it needs and `state_timeout_ms`; that it does not acknowledge its target within `state_timeout_ms`;
//! that it does not rest in twice the time of its ramp and `state_timeout_ms` where it is to halt.
//!
//! *Held and stopped.* A feed hold halts the drives (`PowerCommand::Enable`), which go on with their target
//! afterwards. What stops a job halts them too, and then switches them off: a target lives in the drive, and
//! a drive that is merely told to run again would go there. Overrides count as a move begins; at 0 it waits.

use super::axis::AxisControl;
use super::{Controller, Fault};
use crate::machine::COORDINATES;
use syncline_canopen::time::Duration;
use syncline_drives::model::PowerCommand;

/// Where axes go point to point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointToPoint {
    /// By coordinate, mm; none for an axis that stays.
    pub targets: [Option<f64>; COORDINATES],
    /// How fast they go along the line there, mm/s; none: as fast as they can.
    pub speed: Option<f64>,
}

/// How far the move is that the path waits for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Progress {
    /// The drives are told their profiles, with which they take so many cycles at the most, and halt on their way in so many.
    Telling { most: u64, halts_in: u64 },
    /// They go, and have so many cycles left.
    Going { left: u64 },
}

/// How all axes of a move get from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CommonProfile {
    /// 1/s
    velocity: f64,
    /// 1/s²
    acceleration: f64,
}

impl CommonProfile {
    /// From the greatest velocity to rest, s.
    fn braking(self) -> f64 {
        (self.velocity / self.acceleration).min(1.0 / self.acceleration.sqrt())
    }

    /// From rest to rest, s.
    fn duration(self) -> f64 {
        match self.velocity * self.velocity < self.acceleration {
            true => 1.0 / self.velocity + self.velocity / self.acceleration,
            false => 2.0 / self.acceleration.sqrt(),
        }
    }
}

/// How far an axis has to go, mm.
fn distance(axis: &AxisControl, target: f64) -> f64 {
    axis.beside().map_or(0.0, |at| (target - at).abs())
}

impl<const N: usize> Controller<N> {
    /// Goes on with the move that the path waits for, and passes on once the axes are there. While the path is held it
    /// is not called.
    ///
    /// # Errors
    /// A target is beyond what its drive counts; an axis is not there in time.
    pub(super) fn step_point_to_point(&mut self, motion: &PointToPoint) -> Result<(), Fault> {
        match self.positioning {
            None => match self.common_profile(motion) {
                Some(profile) if profile.velocity > 0.0 => self.tell_profiles(motion, profile),
                Some(_) => {}
                None => self.pass_block(),
            },
            Some(Progress::Telling { .. }) if !self.sequences_done() => {}
            Some(Progress::Telling { most, halts_in }) => {
                for axis in &mut self.axes {
                    if let Some(target) = motion.targets[axis.coordinate()] {
                        axis.go_to(target, halts_in, &self.nodes)?;
                        // How long it has stood says nothing of where it goes now.
                        self.nodes[axis.drive()].leave_standstill();
                    }
                }
                self.positioning = Some(Progress::Going { left: most });
            }
            Some(Progress::Going { left }) => {
                let cycles = self.still_cycles();
                let mut goers = self.axes.iter();
                let late = goers.find_map(|axis| axis.is_away(cycles, left > 0, &self.nodes));
                self.positioning = Some(Progress::Going {
                    left: left.saturating_sub(1),
                });
                match late {
                    None => self.arrive(motion),
                    Some(fault) if left == 0 => return Err(fault),
                    Some(_) => {}
                }
            }
        }
        Ok(())
    }

    /// How the axes of a move get there together at the overrides of now; `None` if all are there.
    fn common_profile(&self, motion: &PointToPoint) -> Option<CommonProfile> {
        let (mut profile, mut square) = (None::<CommonProfile>, 0.0);
        for axis in &self.axes {
            let Some(target) = motion.targets[axis.coordinate()] else {
                continue;
            };
            let distance = distance(axis, target);
            if distance == 0.0 {
                continue;
            }
            square += distance * distance;
            let limits = axis.limits();
            let [velocity, acceleration] =
                [limits.velocity, limits.acceleration].map(|limit| limit / distance);
            profile = Some(profile.map_or(
                CommonProfile {
                    velocity,
                    acceleration,
                },
                |profile| CommonProfile {
                    velocity: profile.velocity.min(velocity),
                    acceleration: profile.acceleration.min(acceleration),
                },
            ));
        }
        let overrides = self.executor.overrides();
        profile.map(|profile| CommonProfile {
            velocity: match motion.speed {
                Some(speed) => profile.velocity.min(overrides.feed * speed / square.sqrt()),
                None => profile.velocity * overrides.rapid,
            },
            ..profile
        })
    }

    fn tell_profiles(&mut self, motion: &PointToPoint, profile: CommonProfile) {
        for axis in &self.axes {
            if let Some(target) = motion.targets[axis.coordinate()] {
                let distance = distance(axis, target);
                let node = &mut self.nodes[axis.drive()];
                node.ask_profile(profile.velocity * distance, profile.acceleration * distance);
            }
        }
        let twice = |seconds: f64| Duration::from_secs_f64(2.0 * seconds);
        self.positioning = Some(Progress::Telling {
            most: self.cycles(twice(profile.duration()) + self.layout.state_timeout),
            halts_in: self.cycles(twice(profile.braking())),
        });
    }

    fn arrive(&mut self, motion: &PointToPoint) {
        for axis in &mut self.axes {
            if let Some(target) = motion.targets[axis.coordinate()] {
                axis.rest(target, [0.0; 2]);
            }
        }
        self.positioning = None;
        self.pass_block();
    }

    /// The path goes on behind a block that it waited for; a single block rests there.
    fn pass_block(&mut self) {
        self.executor.pass();
        if self.executor.is_single_block() {
            self.executor.feed_hold();
        }
    }

    /// The path knows nothing of axes that go point to point, or home by themselves: in the plan they are where they are.
    pub(super) fn place_beside(&mut self) {
        for axis in &self.axes {
            let place = match axis.homes(&self.nodes) {
                true => Some(self.nodes[axis.drive()].actual_mm()),
                false => axis.beside(),
            };
            if let Some(place) = place {
                self.planned.position[axis.coordinate()] = place;
            }
        }
    }

    /// Has the drives that go to targets rest on their way, or go on.
    pub(super) fn let_go(&mut self, on: bool) {
        let power = match on {
            true => PowerCommand::Run,
            false => PowerCommand::Enable,
        };
        for axis in self.axes.iter().filter(|axis| axis.goes()) {
            let node = &mut self.nodes[axis.drive()];
            if on && node.power != power {
                // How long it has stood on its way says nothing of where it is to stand.
                node.leave_standstill();
            }
            node.power = power;
        }
    }

    /// Whether a drive has a target that it has not come to, or homes by itself.
    pub(super) fn has_goers(&self) -> bool {
        let mut axes = self.axes.iter();
        axes.any(|axis| axis.goes() || axis.homes(&self.nodes))
    }

    /// Whether all that go to targets or home by themselves, and are not quick-stopped, stand still.
    pub(super) fn goers_rest(&self) -> bool {
        let cycles = self.still_cycles();
        let goes = |axis: &&AxisControl| axis.goes() || axis.homes(&self.nodes);
        let mut goers = self.axes.iter().filter(goes);
        goers.all(|axis| {
            let node = &self.nodes[axis.drive()];
            node.is_quick_stopped() || node.still() >= cycles
        })
    }
}
