//! A homing that a drive makes by itself, in an operating mode of its own.
//!
//! The drive leaves the mode in which it follows setpoints, is told by SDO what to search for, searches, and counts
//! from what it has found: its position jumps. Then it is told to follow setpoints again, the first of which is where
//! it stands. All the while it is where it says; what is supervised is how far it goes and how long it takes.
//!
//! Requests travel while no axis of the group moves, as those of captures do. What a drive counted before is over once
//! it sets off, so that one that is stopped on its way is not referenced any more; it is brought to rest by its halt,
//! and switched off before it comes back to its mode, since what would move on lives in the drive.

use super::super::node::DeviceNode;
use super::super::{COMMAND_CYCLES, Controller, Event};
use super::{AxisIndex, Edge, HomingFailure, LostReference, is_near};
use crate::machine::{DriveHoming, HomingMethod};
use syncline_drives::model::{Increments, PowerCommand};

/// Samples beyond its distance after which a drive has gone too far: a position that jumps as the drive
/// finds its place is told once before its statusword says so.
const BEYOND: u32 = 3;

/// Where a drive that is home began to count.
pub(super) const ZERO: Edge = Edge {
    at: Increments::ZERO,
    uncertainty: Increments::ZERO,
};

/// Where a homing of that kind is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    /// Nothing has been told to the drive.
    #[default]
    Begin,
    /// Until the mode that follows setpoints has ended.
    Leaving,
    /// Until drives may be asked.
    Left,
    /// Until it is in its homing mode.
    Entering,
    /// It homes.
    Homing,
    /// It has found its place, and rests there until drives may be asked.
    Home,
    /// Until it is in the mode again that follows setpoints.
    Returning,
    /// Until that runs.
    Starting,
}

/// A homing that the drive of an axis makes by itself, under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ByDrive {
    step: Step,
    /// Cycles since the step began.
    since: u64,
    /// Cycles that it has taken so far, without those that it waited for others.
    worked: u64,
    /// Where the drive stood as it set off.
    from: Increments,
    /// Samples in a row further away from there than it may go.
    beyond: u32,
}

impl ByDrive {
    /// Whether it rests until no axis of the group moves.
    pub(super) fn waits(&self) -> bool {
        matches!(self.step, Step::Left | Step::Home)
    }

    /// Cycles that it has taken so far, without those that it waited for others.
    pub(super) fn worked(&self) -> u64 {
        self.worked
    }

    /// Whether the drive moves, or may.
    pub(super) fn moves(&self) -> bool {
        self.step == Step::Homing
    }

    fn enter(&mut self, step: Step) {
        self.step = step;
        self.since = 0;
    }

    /// What a drive shows that homes by itself; whether it is home.
    fn watch(&mut self, how: &DriveHoming, node: &DeviceNode) -> Result<bool, HomingFailure> {
        let status = node.status();
        if self.since > COMMAND_CYCLES && status.homing_over {
            let is_home = status.is_homed && status.mode_runs;
            return is_home.then_some(true).ok_or(HomingFailure::NotHome);
        }
        let moved = (node.actual() - self.from).get().unsigned_abs() as f64;
        let is_beyond = moved * node.scaling().resolution() > how.max_distance;
        self.beyond = if is_beyond { self.beyond + 1 } else { 0 };
        if self.beyond >= BEYOND {
            return Err(HomingFailure::TooFar);
        }
        Ok(false)
    }
}

impl<const N: usize> Controller<N> {
    /// Goes on with a homing that the drive of an axis makes by itself; whether it is over. `quiet` and `answered`, as
    /// in [`Seen`](super::Seen), are of all axes of the group.
    pub(super) fn home_by_drive(
        &mut self,
        index: AxisIndex,
        how: &DriveHoming,
        (quiet, answered): (bool, bool),
    ) -> Result<bool, HomingFailure> {
        let (still, at) = (self.still_cycles(), index);
        let axis = &mut self.axes[index];
        let node = &mut self.nodes[axis.drive()];
        let by_drive = &mut self.homing.by_drive[index];
        by_drive.since += 1;
        by_drive.worked += u64::from(!by_drive.waits());
        let seen = by_drive.since > COMMAND_CYCLES;
        let is_home = by_drive.moves() && by_drive.watch(how, node)?;
        match by_drive.step {
            Step::Begin => {
                node.begin_homing();
                by_drive.enter(Step::Leaving);
            }
            Step::Leaving if seen && !node.status().mode_runs => by_drive.enter(Step::Left),
            Step::Left if quiet => {
                node.ask_homing(how);
                by_drive.enter(Step::Entering);
            }
            Step::Entering if answered => {
                node.power = PowerCommand::Home;
                by_drive.from = node.actual();
                by_drive.enter(Step::Homing);
                if axis.is_referenced() {
                    axis.forget_reference();
                    let why = LostReference::Homes;
                    self.tell(Event::Unreferenced { axis: index, why });
                }
            }
            Step::Homing if is_home => {
                node.power = PowerCommand::Enable;
                by_drive.enter(Step::Home);
            }
            Step::Home if quiet && seen && node.still() >= still => {
                // The first setpoint that it is to follow again is where it stands.
                node.hold();
                node.ask_index(how);
                node.ask_mode_back(how);
                by_drive.enter(Step::Returning);
            }
            Step::Returning if answered => {
                let index = node.index_distance(how);
                node.power = PowerCommand::Run;
                by_drive.enter(Step::Starting);
                if let Some((distance, part)) = index
                    && is_near(part)?
                {
                    self.tell(Event::IndexNear { axis: at, distance });
                }
            }
            Step::Starting if seen && node.status().mode_runs => return Ok(true),
            _ => {}
        }
        Ok(false)
    }

    /// Ends a homing where it is: drives that home by themselves come to rest.
    pub(in crate::control) fn abort_homing(&mut self) {
        self.cut_homing_off();
        self.nodes.iter_mut().for_each(DeviceNode::halt_homing);
    }

    /// Brings drives that are off, and were stopped on their way home, back to the mode in which they follow setpoints.
    pub(in crate::control) fn return_from_homing(&mut self) {
        for axis in &self.layout.axes {
            if let HomingMethod::Drive(how) = &axis.homing.method {
                let node = &mut self.nodes[axis.drives[0]];
                if node.homes() {
                    node.end_homing();
                    node.ask_mode_back(how);
                }
            }
        }
    }
}
