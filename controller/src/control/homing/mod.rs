//! Homing: axes come to know where they are.
//!
//! An axis that is not *referenced* counts from where it was switched on. Its machine positions are known
//! once the machine position of one of the drive's counts is: its *origin*, the drive's count at machine
//! position 0, beyond the `zero` of the machine file. A homing finds it, while setpoints go out as
//! always; when it is found the plan's positions change, and the setpoints in increments do not.
//!
//! Axes are homed in groups, one after the other by their `order`: all axes of a group search
//! at once, are referenced in one cycle, at rest, and go to their final positions. What moves them are the
//! executor's jogs, so that a homing has the limits of the axes, the supervision of every cycle and, inside the
//! distance that the machine file allows, a stop from wherever it is.
//!
//! Behind the edge of a switch the index of the motor's encoder may count: the next place where the drive, which knows its
//! place within a turn from power-on, counts a whole number of turns. It is always the same one, however well the edge is
//! known, unless the edge lies beside an index.
//!
//! The sides of a gantry are planned as far apart as they stand then. The difference is taken out by a
//! jerk-limited motion of both about the middle, while the axis itself rests, and skew is what is left
//! beside that plan. A gantry with absolute encoders, too, is taken square by a homing, without a search.
//!
//! A failure is told with its cause, the axes come to rest, and what was not homed yet stays
//! unreferenced.

mod by_drive;
mod failure;
mod hard_stop;
mod switch;
mod test_move;

pub use failure::{HomingFailure, LostReference, NotRecalled};
pub(super) use switch::Edge;

use super::axis::Test;
use super::fault::{AxisCause, AxisIndex, DeviceCause, Fault};
use super::{Controller, Event, Hold, Phase, Refusal, event_sink};
use crate::machine::HomingMethod;
use by_drive::ByDrive;
use hard_stop::HardStop;
use std::mem::replace;
use std::sync::Arc;
use switch::{Motion, Progress, Search, Seen};
use syncline_canopen::emcy::code;
use syncline_drives::model::Direction;
use syncline_gcode::AxisLetter;
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::path::{Jog, Travel};

/// A set of axes: bit n is the axis with that index.
type AxisSet = u32;

/// So near to where it is to come to rest, mm, an axis is there.
const REACHED: f64 = 1e-6;

/// A side of a gantry that lags so many times as far as the other one is jammed.
const JAMMED: f64 = 2.0;

/// By less than this part of a turn beside the edge of its switch an index pulse is refused: the next homing may take the
/// one before it or behind it.
const INDEX_LEAST: f64 = 0.02;
/// By less than this part it is told.
const INDEX_SAFE: f64 = 0.1;

/// Whether an index pulse is so near to the edge of its switch, by parts of a turn, that it is told.
///
/// # Errors
/// It is too near to count.
fn is_near(part: f64) -> Result<bool, HomingFailure> {
    match part < INDEX_LEAST {
        true => Err(too_near(part)),
        false => Ok(part < INDEX_SAFE),
    }
}

fn too_near(part: f64) -> HomingFailure {
    HomingFailure::IndexTooNear {
        thousandths: (1000.0 * part) as u16,
    }
}

/// Where a homing is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// None is under way.
    #[default]
    Idle,
    /// The next group begins.
    Next,
    /// Its axes search.
    Searching,
    /// They are referenced at the beginning of the next cycle.
    Found,
    /// The sides of gantries go where they belong.
    Squaring,
    /// They go to their final positions; whether that is ordered.
    Leaving(bool),
}

/// A homing of axes.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    stage: Stage,
    /// Axes that are still to come.
    left: AxisSet,
    /// Axes at work.
    group: AxisSet,
    /// When those began.
    began: u64,
    /// By axis.
    searches: Vec<Search>,
    /// By axis, where its drive does that by itself.
    by_drive: Vec<ByDrive>,
    /// By axis, where it searches a hard stop.
    hard_stops: Vec<HardStop>,
    /// Axes of the group that have been found.
    found: AxisSet,
}

impl Homing {
    /// Of a machine with so many drives to each axis.
    pub(super) fn new(sides: impl Iterator<Item = usize>) -> Self {
        let searches: Vec<_> = sides.map(Search::new).collect();
        Self {
            stage: Stage::Idle,
            left: 0,
            group: 0,
            began: 0,
            by_drive: vec![ByDrive::default(); searches.len()],
            hard_stops: vec![HardStop::default(); searches.len()],
            searches,
            found: 0,
        }
    }

    /// Whether one is under way.
    pub(super) fn is_active(&self) -> bool {
        self.stage != Stage::Idle
    }

    /// Whether an axis is on its way to where it finds its place, or rests there until it leaves.
    pub(super) fn searches(&self, axis: AxisIndex) -> bool {
        let before = [Stage::Searching, Stage::Found, Stage::Squaring];
        before.contains(&self.stage) && has(self.group, axis)
    }

    /// Whether an axis is at work in one, from its search to its final position.
    pub(super) fn homes(&self, axis: AxisIndex) -> bool {
        self.is_active() && has(self.group, axis)
    }

    /// Whether an axis of the group does not move, and waits until no other one does.
    fn is_quiet(&self, axis: AxisIndex) -> bool {
        has(self.found, axis)
            || self.searches[axis].waits()
            || self.by_drive[axis].waits()
            || self.hard_stops[axis].waits()
    }

    fn begin(&mut self, axes: AxisSet) {
        self.stage = Stage::Next;
        self.left = axes;
        self.group = 0;
    }
}

fn has(axes: AxisSet, axis: AxisIndex) -> bool {
    axes >> axis & 1 != 0
}

impl<const N: usize> Controller<N> {
    /// Whether an axis has to be homed before it moves as it likes: it is not referenced, or its sides
    /// are too far apart.
    pub(super) fn needs_homing(&self, axis: AxisIndex) -> bool {
        let axis = &self.axes[axis];
        !axis.is_referenced() || axis.askew(self.cycle).is_some()
    }

    /// Homes the axes with these coordinates; without any all that do not wait for an operator to say
    /// where they stand.
    ///
    /// # Errors
    /// There is nothing to home.
    pub(super) fn home(&mut self, coordinates: [bool; N]) -> Result<(), Refusal> {
        let all = !coordinates.contains(&true);
        let mut wanted = 0;
        for (index, axis) in self.layout.axes.iter().enumerate() {
            let named = coordinates[axis.coordinate];
            let is_gantry = axis.drives.len() == 2;
            if named && axis.homing.is_absolute() && !is_gantry {
                return Err(Refusal::Absolute(axis.coordinate));
            }
            let searches = !axis.homing.is_absolute() && !axis.homing.is_by_hand();
            if named || all && (searches || self.axes[index].askew(self.cycle).is_some()) {
                wanted |= 1 << index;
            }
        }
        let there = |at: usize| self.layout.axes.iter().any(|axis| axis.coordinate == at);
        if let Some(at) = (0..N).find(|&at| coordinates[at] && !there(at)) {
            return Err(Refusal::NoSuchAxis(at));
        }
        if wanted == 0 {
            let mut axes = self.layout.axes.iter();
            return Err(match axes.all(|axis| axis.homing.is_absolute()) {
                true => Refusal::AllAbsolute,
                false => Refusal::NothingToHome,
            });
        }
        self.homing.begin(wanted);
        Ok(())
    }

    /// Before the one job of a machine: homes what has to be, where the machine file says so.
    ///
    /// # Errors
    /// An axis is not referenced, and it does not say so.
    pub(super) fn home_at_start(&mut self) -> Result<(), Fault> {
        let policy = self.layout.homing;
        let homed = self.job.map(|job| job.homes_first).unwrap_or_default();
        let by_program = |axis: AxisIndex| {
            let at = self.layout.axes[axis].coordinate;
            AxisLetter::ALL
                .get(at)
                .is_some_and(|&it| homed.contains(it))
        };
        let missing =
            (0..self.axes.len()).filter(|&axis| self.needs_homing(axis) && !by_program(axis));
        if policy.at_start {
            let by_hand = |axis: &AxisIndex| self.layout.axes[*axis].homing.is_by_hand();
            if let Some(axis) = missing.clone().find(by_hand) {
                return Err(Fault::Axis(axis, AxisCause::Unreferenced));
            }
            // One that came on before, and is off again, holds what is to begin.
            let held = match self.held_by {
                Hold::Input(input) if self.executor.is_held() => Some(input),
                _ => None,
            };
            let forbids = self.holding_input().or(held);
            let forbids = forbids.map(|input| match self.is_door(input) {
                true => HomingFailure::DoorOpen,
                false => HomingFailure::FeedHold,
            });
            if let Some((axis, failure)) = missing.clone().next().zip(forbids) {
                self.tell(Event::HomingFailed { axis, failure });
                return Err(Fault::Axis(axis, AxisCause::Homing(failure)));
            }
            let missing = missing.fold(0, |set, axis| set | 1 << axis);
            if missing != 0 {
                self.homing.begin(missing);
            }
            return Ok(());
        }
        for axis in missing {
            if let Some(apart) = self.axes[axis].askew(self.cycle) {
                let difference = apart.abs();
                return Err(Fault::Axis(axis, AxisCause::Skew { difference }));
            }
            if !policy.unreferenced_jobs || !self.axes[axis].is_tested() {
                return Err(Fault::Axis(axis, AxisCause::Unreferenced));
            }
        }
        Ok(())
    }

    /// Once it is seen where the drives stand: takes up the references that were kept when the machine was on last.
    pub(super) fn recall_references(&mut self) {
        for index in 0..self.axes.len() {
            match self.axes[index].recall(&mut self.nodes) {
                Some(Ok(moved)) => self.tell(Event::Recalled { axis: index, moved }),
                Some(Err(why)) => self.tell(Event::NotRecalled { axis: index, why }),
                None => {}
            }
        }
    }

    /// Tells what is to be kept of the drives for when the machine is switched on again.
    pub(super) fn keep_references(&mut self) {
        for axis in &self.axes {
            let mut tell = event_sink(&mut self.events);
            for (device, kept) in axis.kept(&self.nodes) {
                tell(Event::Kept { device, kept });
            }
        }
    }

    /// Forgets where an axis is whose drive may have lost its count.
    pub(super) fn watch_references(&mut self) {
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            if axis.is_referenced() && axis.has_lost_count(&self.nodes) {
                axis.forget_reference();
                let why = LostReference::DriveGone;
                self.tell(Event::Unreferenced { axis: index, why });
            }
        }
    }

    /// Goes on with a homing by a cycle.
    pub(super) fn step_homing(&mut self) {
        // What rests for that has not come to its end.
        let is_on_its_way = self.homing.is_active() && self.executor.is_jogged();
        if is_on_its_way && self.zero_overrides().rapid {
            return self.interrupt_homing(HomingFailure::NoSpeed);
        }
        let outcome = match self.homing.stage {
            Stage::Idle | Stage::Found => Ok(()),
            Stage::Next => self.begin_group(),
            Stage::Searching => self.search(),
            Stage::Squaring => {
                self.await_square();
                Ok(())
            }
            Stage::Leaving(ordered) => self.leave(ordered),
        };
        if let Err((axis, failure)) = outcome {
            self.homing_failed(axis, failure);
        }
    }

    /// Tells what an axis that does not follow while it searches may have met, also where its drive is the first to say
    /// so. The fault that this is stops it.
    pub(super) fn explain_search(&mut self, fault: &Fault) {
        match *fault {
            Fault::Axis(axis, AxisCause::FollowingError { .. } | AxisCause::Skew { .. }) => {
                self.explain_blocked(axis);
            }
            Fault::Device(drive, cause) => {
                let lags = match cause {
                    DeviceCause::Emergency { emergency } => emergency.code == code::FOLLOWING_ERROR,
                    DeviceCause::Reported { .. } | DeviceCause::NotFollowing { .. } => false,
                    _ => return,
                };
                let mut axes = self.layout.axes.iter();
                let Some(axis) = axes.position(|axis| axis.drives.contains(&drive)) else {
                    return;
                };
                match self.homing.by_drive[axis].moves() {
                    true => self.explain_homing(axis),
                    false if lags => self.explain_blocked(axis),
                    false => {}
                }
            }
            _ => {}
        }
    }

    fn explain_blocked(&mut self, axis: AxisIndex) {
        let searches = has(self.homing.group & !self.homing.found, axis);
        if self.homing.stage != Stage::Searching || !searches {
            return;
        }
        let (of, cycle, nodes) = (&self.axes[axis], self.cycle, &self.nodes);
        let lag = |side| of.following_error(cycle, side, nodes).abs();
        let jammed = match self.layout.axes[axis].drives.len() {
            2 => [[0, 1], [1, 0]]
                .into_iter()
                .find(|&[side, other]| lag(side) > JAMMED * lag(other)),
            _ => None,
        };
        let failure = match jammed {
            Some([side, _]) => Some(HomingFailure::SideJammed { side }),
            None => {
                let homing = &self.homing;
                let on_stop = homing.hard_stops[axis].blocked();
                on_stop.or(homing.searches[axis].blocked())
            }
        };
        if let Some(failure) = failure {
            self.tell(Event::HomingFailed { axis, failure });
        }
    }

    /// Tells that the drive of an axis did not get home by itself.
    fn explain_homing(&mut self, axis: AxisIndex) {
        if self.homing.stage == Stage::Searching && has(self.homing.group, axis) {
            let failure = HomingFailure::NotHome;
            self.tell(Event::HomingFailed { axis, failure });
        }
    }

    /// Ends a homing where it is. What was on its way is not referenced, nor if it had been before: its switch may be where
    /// no soft limit lets it be.
    pub(super) fn cut_homing_off(&mut self) {
        let under_way = !matches!(self.homing.stage, Stage::Idle | Stage::Next);
        self.homing.stage = Stage::Idle;
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            let method = &self.layout.axes[index].homing.method;
            let searches = !axis.is_tested()
                || matches!(
                    method,
                    HomingMethod::Switch(_) | HomingMethod::HardStop(_) | HomingMethod::Drive(_)
                );
            axis.cut_test_off();
            if under_way && searches && has(self.homing.group, index) && axis.is_referenced() {
                axis.forget_reference();
                let why = LostReference::CutOff;
                self.tell(Event::Unreferenced { axis: index, why });
            }
        }
    }

    /// A homing does not wait and go on, as a path does in a feed hold: it ends, and what moves comes to rest.
    pub(super) fn interrupt_homing(&mut self, failure: HomingFailure) {
        let Homing {
            group, found, left, ..
        } = self.homing;
        // One that searches before those that wait for it, and before those that only leave their switches.
        let ended = [group & !found, left, group]
            .into_iter()
            .find(|set| *set != 0);
        let ended = ended.unwrap_or_default();
        if let Some(axis) = (0..self.axes.len()).find(|&axis| has(ended, axis)) {
            self.homing_failed(axis, failure);
        }
    }

    /// What did not find its place stays unreferenced.
    fn homing_failed(&mut self, axis: AxisIndex, failure: HomingFailure) {
        self.cut_homing_off();
        self.tell(Event::HomingFailed { axis, failure });
        if self.stays_on {
            self.enter(Phase::Stop, &mut []);
        } else {
            self.fail(Fault::Axis(axis, AxisCause::Homing(failure)));
        }
    }

    /// The axes of the lowest order begin; without any the homing is over.
    fn begin_group(&mut self) -> Result<(), (AxisIndex, HomingFailure)> {
        let layout = Arc::clone(&self.layout);
        let left = (0..layout.axes.len()).filter(|&axis| has(self.homing.left, axis));
        let order = |axis: AxisIndex| layout.axes[axis].homing.order;
        let Some(lowest) = left.clone().map(order).min() else {
            self.homing.stage = Stage::Idle;
            self.rest_here();
            self.end_program_homing();
            return Ok(());
        };
        let group = left.filter(|&axis| order(axis) == lowest);
        let group: AxisSet = group.fold(0, |set, axis| set | 1 << axis);
        self.homing.left &= !group;
        self.homing.group = group;
        self.homing.found = 0;
        self.homing.began = self.cycle;
        self.homing.stage = Stage::Searching;
        for axis in (0..layout.axes.len()).filter(|&axis| has(group, axis)) {
            self.homing.searches[axis] = Search::new(layout.axes[axis].drives.len());
            self.homing.by_drive[axis] = ByDrive::default();
            self.axes[axis].await_test();
            self.homing.hard_stops[axis] = match layout.axes[axis].homing.method {
                HomingMethod::HardStop(_) => HardStop::new(),
                _ => HardStop::default(),
            };
            self.check_switches(axis)
                .map_err(|failure| (axis, failure))?;
        }
        self.rest_here();
        Ok(())
    }

    /// Whether an axis can be homed by its switches as they are: one that is on, and may be on for
    /// another axis' sake, says nothing.
    fn check_switches(&self, axis: AxisIndex) -> Result<(), HomingFailure> {
        let HomingMethod::Switch(search) = &self.layout.axes[axis].homing.method else {
            return Ok(());
        };
        let on = self.switch_levels(&search.inputs);
        match on {
            None => Err(HomingFailure::NoSignal),
            Some(on) if search.is_shared && on.contains(&true) => Err(HomingFailure::Shared),
            Some(_) => Ok(()),
        }
    }

    /// The levels of one or two switches; `None` while one of them has not been seen.
    fn switch_levels(&self, inputs: &[usize]) -> Option<[bool; 2]> {
        let mut on = [false; 2];
        for (on, &input) in on.iter_mut().zip(inputs) {
            let input = &self.layout.inputs[input];
            *on = self.level(input)?;
        }
        Some(on)
    }

    /// The axes of the group search, each for itself.
    fn search(&mut self) -> Result<(), (AxisIndex, HomingFailure)> {
        let layout = Arc::clone(&self.layout);
        let elapsed = self.layout.cycle * (self.cycle - self.homing.began) as u32;
        let at_work = (0..layout.axes.len()).filter(|&axis| has(self.homing.group, axis));
        let rests = |axis| self.homing.is_quiet(axis) && self.axes[axis].test() == Test::Idle;
        let quiet = at_work.clone().all(rests);
        let mut drives = at_work.flat_map(|axis| &layout.axes[axis].drives);
        let answered = drives.all(|&drive| self.nodes[drive].is_sequence_done());
        for (index, axis) in layout.axes.iter().enumerate() {
            if !has(self.homing.group & !self.homing.found, index) {
                continue;
            }
            let failed = |failure| (index, failure);
            if !self.step_test(index).map_err(failed)? {
                continue;
            }
            let how = match &axis.homing.method {
                HomingMethod::Switch(how) => how,
                HomingMethod::Drive(_) | HomingMethod::HardStop(_) => {
                    let over = self.home_apart(index, (quiet, answered));
                    if over.map_err(failed)? {
                        self.homing.found |= 1 << index;
                    }
                    continue;
                }
                HomingMethod::Encoder | HomingMethod::SetHere { .. } => {
                    self.homing.found |= 1 << index;
                    continue;
                }
            };
            let on = self.switch_levels(&how.inputs);
            let on = on.ok_or(failed(HomingFailure::NoSignal))?;
            let seen = Seen {
                quiet,
                answered,
                ..self.seen(index, on, how.slow_speed)
            };
            let searched = self.homing.searches[index].go_on(how, &seen);
            match searched.map_err(failed)? {
                Progress::Goes if elapsed > how.max_time => {
                    return Err(failed(HomingFailure::TooLong));
                }
                Progress::Goes | Progress::Waits => {}
                Progress::Arms => {
                    for (&drive, capture) in axis.drives.iter().zip(&how.captures) {
                        self.nodes[drive].arm_capture(capture);
                    }
                }
                Progress::Reads => {
                    for (&drive, capture) in axis.drives.iter().zip(&how.captures) {
                        self.nodes[drive].ask_captured(capture);
                    }
                }
                Progress::Found => {
                    if how.by_index {
                        self.take_index(index, how.direction).map_err(failed)?;
                    }
                    self.homing.found |= 1 << index;
                }
                Progress::Moves(motion) => self.move_axis(index, motion).map_err(failed)?,
            }
        }
        if self.homing.found == self.homing.group {
            self.homing.stage = Stage::Found;
        }
        Ok(())
    }

    /// The index behind the edge that an axis has found, searching in this direction, counts from now on.
    fn take_index(&mut self, index: AxisIndex, direction: f64) -> Result<(), HomingFailure> {
        let axis = &self.layout.axes[index];
        let scaling = &self.layout.devices[axis.drives[0]].scaling;
        let up = scaling.direction() == Direction::Positive;
        let towards = if up { direction } else { -direction };
        let near = self.homing.searches[index].take_index(scaling.revolution(), towards)?;
        if let Some(near) = near {
            let distance = near.get() as f64 * scaling.resolution();
            self.tell(Event::IndexNear {
                axis: index,
                distance,
            });
        }
        Ok(())
    }

    /// Goes on with a homing that has a state of its own, and whose time counts without that which it waits for others;
    /// whether it is over. `quiet` and `answered`, as in [`Seen`], are of all axes of the group.
    fn home_apart(&mut self, index: AxisIndex, group: (bool, bool)) -> Result<bool, HomingFailure> {
        let layout = Arc::clone(&self.layout);
        let (over, worked, most) = match &layout.axes[index].homing.method {
            HomingMethod::Drive(how) => {
                let over = self.home_by_drive(index, how, group)?;
                (over, self.homing.by_drive[index].worked(), how.max_time)
            }
            HomingMethod::HardStop(how) => {
                let over = self.home_on_stop(index, how, group)?;
                (over, self.homing.hard_stops[index].worked(), how.max_time)
            }
            _ => return Ok(true),
        };
        match layout.cycle * worked as u32 > most {
            true => Err(HomingFailure::TooLong),
            false => Ok(over),
        }
    }

    /// What an axis shows in this cycle that passes its edges at that speed, mm/s.
    fn seen(&self, index: AxisIndex, on: [bool; 2], speed: f64) -> Seen {
        let axis = &self.axes[index];
        let at = axis.coordinate();
        let sample = axis.sample(self.cycle, &self.nodes);
        let mut counts = [Default::default(); 2];
        let mut window = [Default::default(); 2];
        let mut captured = [None; 2];
        for (side, &drive) in self.layout.axes[index].drives.iter().enumerate() {
            let node = &self.nodes[drive];
            counts[side] = node.actual();
            window[side] = node.standstill_window();
            captured[side] = node.captured(speed);
        }
        Seen {
            position: sample.act,
            rests: self.planned.velocity[at] == 0.0
                && self.planned.acceleration[at] == 0.0
                && self.shaping.has_settled(at),
            settled: axis.is_in_position(&sample),
            on,
            counts,
            window,
            quiet: false,
            answered: false,
            captured,
        }
    }

    /// Lets an axis of the group move.
    fn move_axis(&mut self, index: AxisIndex, motion: Motion) -> Result<(), HomingFailure> {
        let axis = self.axes[index].coordinate();
        let order = match motion {
            Motion::Run(velocity) => Jog::Continuous { axis, velocity },
            Motion::Stop => Jog::Step {
                axis,
                distance: 0.0,
                speed: f64::INFINITY,
            },
            Motion::To(position, speed) => Jog::Step {
                axis,
                distance: position - self.planned.position[axis],
                speed,
            },
        };
        let travel = self.homing_travel();
        if !self.executor.is_off_path() {
            // There is no path to leave: it is held where it stands.
            self.executor.feed_hold();
        }
        let taken = self.executor.jog(order, &travel);
        taken.map_err(|_| HomingFailure::NoSpeed)
    }

    /// How far the axes of the group may go: while they search inside the distance that the machine file
    /// allows, from where the search began; then inside their soft limits.
    fn homing_travel(&self) -> [Option<Travel>; N] {
        let mut travel = [None; N];
        for (index, axis) in self.layout.axes.iter().enumerate() {
            if !has(self.homing.group, index) {
                continue;
            }
            let limits = &axis.limits;
            let [mut acceleration, mut jerk] = [limits.acceleration, limits.jerk];
            let here = self.planned.position[axis.coordinate];
            let around = |distance: f64| (here - distance, here + distance);
            let (min, max) = match &axis.homing.method {
                _ if self.axes[index].test() != Test::Idle => {
                    let test = axis.homing.test_move;
                    if let Some(test) = test {
                        [acceleration, jerk] = test.ramps(limits);
                    }
                    around(test.map_or(0.0, |test| test.distance.abs()))
                }
                HomingMethod::Switch(how) if self.homing.stage == Stage::Searching => {
                    around(how.max_distance)
                }
                HomingMethod::HardStop(how) if self.homing.stage == Stage::Searching => {
                    // As it presses, whatever another axis is ordered meanwhile, its plan is to rest at once.
                    if !self.homing.hard_stops[index].presses() {
                        [acceleration, jerk] = how.ramps;
                    }
                    around(how.max_distance)
                }
                // It moves by itself.
                HomingMethod::Drive(_) if self.homing.stage == Stage::Searching => continue,
                _ => limits.position,
            };
            travel[axis.coordinate] = Some(Travel {
                limits: Limits::symmetric(limits.velocity, acceleration, jerk),
                bounds: PositionLimits { min, max },
            });
        }
        travel
    }

    /// At the beginning of a cycle: references what has been found. The axes rest; their plan goes on in
    /// machine positions, and no setpoint changes.
    ///
    /// # Errors
    /// A position is beyond what a drive can count.
    pub(super) fn take_references(&mut self) -> Result<(), Fault> {
        if self.homing.stage != Stage::Found {
            return Ok(());
        }
        self.homing.stage = Stage::Squaring;
        let mut position = self.planned.position;
        let mut outcome = Ok(());
        for index in 0..self.axes.len() {
            if !has(self.homing.group, index) {
                continue;
            }
            let axis = &mut self.axes[index];
            let found = match &self.layout.axes[index].homing.method {
                HomingMethod::Encoder => {
                    axis.trust();
                    None
                }
                HomingMethod::Drive(_) => {
                    axis.reference([Some(by_drive::ZERO), None], &mut self.nodes)?;
                    axis.forget_motion();
                    self.nodes[axis.drive()].end_homing();
                    None
                }
                HomingMethod::HardStop(_) => {
                    let edge = self.homing.hard_stops[index].edge();
                    Some(axis.reference([edge, None], &mut self.nodes)?)
                }
                HomingMethod::SetHere { .. } | HomingMethod::Switch(_) => {
                    let edges = self.homing.searches[index].edges();
                    Some(axis.reference(edges, &mut self.nodes)?)
                }
            };
            let of = &self.layout.axes[index];
            // Of one drive whose encoder tells its place no position changes.
            if !(of.homing.tells_place() && of.drives.len() == 1) {
                position[axis.coordinate()] = axis.reseat(&mut self.nodes);
            }
            let apart = axis.square(self.cycle + 1);
            let moved = found.and_then(|(_, moved)| moved);
            if let Some(difference) = moved
                && of
                    .homing
                    .reference_limit
                    .is_some_and(|most| difference.abs() > most)
            {
                // What it believed is wrong, and so may be what it takes for its reference now.
                axis.forget_reference();
                let why = LostReference::Moved;
                self.tell(Event::Unreferenced { axis: index, why });
                let fault = Fault::Axis(index, AxisCause::ReferenceMoved { difference });
                if let Err(other) = replace(&mut outcome, Err(fault)) {
                    self.fail(other);
                }
                continue;
            }
            self.tell(Event::Referenced {
                axis: index,
                uncertainty: found.map(|(uncertainty, _)| uncertainty),
                apart,
                moved,
            });
        }
        self.planned.position = position;
        self.rest_here();
        self.keep_references();
        outcome
    }

    /// The sides of gantries go where they belong, before the axes leave.
    fn await_square(&mut self) {
        // One that something holds beside its setpoint is not waited for without end.
        let waited = self.cycle - self.moved > self.cycles(self.layout.state_timeout);
        let settled = self.axes.iter().all(|axis| {
            let sample = axis.sample(self.cycle, &self.nodes);
            let rests = !axis.squares(self.cycle) && axis.is_compensated();
            rests && (waited || axis.is_in_position(&sample))
        });
        if settled {
            self.homing.stage = Stage::Leaving(false);
        }
    }

    /// The axes of the group go to their final positions.
    fn leave(&mut self, ordered: bool) -> Result<(), (AxisIndex, HomingFailure)> {
        let layout = Arc::clone(&self.layout);
        let mut there = true;
        for (index, axis) in layout.axes.iter().enumerate() {
            if let Some((place, speed)) = axis.homing.final_move()
                && has(self.homing.group, index)
            {
                let away = self.planned.position[axis.coordinate] - place;
                there &= self.planned.velocity[axis.coordinate] == 0.0 && away.abs() < REACHED;
                there &= self.shaping.has_settled(axis.coordinate);
                if !ordered {
                    let motion = Motion::To(place, speed);
                    let moved = self.move_axis(index, motion);
                    moved.map_err(|failure| (index, failure))?;
                }
            }
        }
        self.homing.stage = match there {
            true => Stage::Next,
            false => Stage::Leaving(true),
        };
        Ok(())
    }
}
