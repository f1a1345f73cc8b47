//! One axis in the cycle: planned position to increments, actual position back, following error.

mod compensation;
mod cross_coupling;
mod feed_forward;
mod feedback;
mod history;
mod position_loop;
mod sag;
mod sample;
mod skew;
mod squaring;
mod test_move;

pub use cross_coupling::SidesApart;
pub use feed_forward::AxisTorque;
pub(super) use feedback::STEADY;
pub use sample::{AxisSample, ToldTorque};
pub(super) use test_move::Test;

use super::SIDES_ENABLE;
use super::fault::{AwaitedState, AxisCause, AxisIndex, DeviceIndex, Fault};
use super::homing::{Edge, NotRecalled};
use super::layout::{self, Layout};
use super::node::DeviceNode;
use super::setpoint_guard::SetpointGuard;
use crate::machine::{AxisLimits, HomingMethod, Kept, NotKept};
use compensation::Compensation;
use cross_coupling::Coupling;
use history::{History, Planned};
use squaring::Squaring;
use syncline_drives::model::{Increments, PowerCommand, Setpoint};

/// Those whose speed counts for what a following error may be.
const RECENT: u64 = 16;
/// So many times its greatest velocity no axis moves, also not while it catches up.
const JUMP: f64 = 1.5;

/// Which way a side goes as the sides come apart.
const OUTWARDS: [f64; 2] = [-0.5, 0.5];

/// What one side of an axis keeps.
#[derive(Clone, Debug)]
struct Side {
    /// What its drive is sent to next, before it is known that all others' can be too.
    next: Setpoint,
    guard: SetpointGuard,
    /// Its last actual position, and how many cycles ago that was.
    seen: Option<(Increments, u32)>,
    /// Where it was as its drive told that it is enabled, until its setpoint is frozen, mm.
    enabled: Option<f64>,
}

/// An axis in the cycle.
#[derive(Clone, Debug)]
pub(super) struct AxisControl {
    index: AxisIndex,
    spec: layout::AxisSpec,
    sides: Vec<Side>,
    /// Its positions are machine positions.
    referenced: bool,
    /// Its drives go as fast as they are sent, as far as is to be looked for: until then no loop of the controller's is
    /// closed about it.
    tested: bool,
    /// Where its test move is.
    test: Test,
    /// It was looked whether a reference from before holds.
    recalled: bool,
    /// Its drives can be sent on with the plan; otherwise it stays.
    moves_on: bool,
    /// What it was planned to do lately.
    history: History,
    /// What its setpoints are corrected by, if anything.
    compensation: Option<Compensation>,
    /// What moves its sides against each other, if anything.
    coupling: Option<Coupling>,
    /// See [`Layout::lag`].
    lag: f64,
    /// If it goes point to point.
    point_to_point: Option<Place>,
    /// How what the sides are apart goes to zero.
    squaring: Option<Squaring>,
    /// For so many cycles one of its sides has been enabled, and the other has not.
    half_enabled: u32,
    /// For so many cycles its sides have not been seen at one SYNC.
    apart_seen: u32,
    /// Of a cycle, s.
    period: f64,
}

/// Where an axis is that goes point to point.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    /// Where it rests, or where its drive says that it is, mm.
    at: f64,
    /// Where its drive goes.
    target: Option<Increments>,
    /// Cycles in which it comes to rest from there, with its ramp, at the most.
    halts_in: u64,
    /// Cycles in a row in which the drive has not acknowledged what it was sent.
    unacknowledged: u64,
    /// Cycles in a row in which it has gone on although it was told to halt.
    unhalted: u64,
}

impl AxisControl {
    pub(super) fn new(index: AxisIndex, layout: &Layout) -> Self {
        let spec = layout.axes[index].clone();
        let scaling = |drive: usize| &layout.devices[drive].scaling;
        let side = |&drive: &usize| Side {
            next: Setpoint::default(),
            guard: SetpointGuard::new(&spec.sent_limits, scaling(drive), layout.cycle),
            seen: None,
            enabled: None,
        };
        Self {
            index,
            sides: spec.drives.iter().map(side).collect(),
            referenced: spec.homing.is_absolute(),
            tested: spec.homing.test_move.is_none(),
            test: Test::Idle,
            point_to_point: spec.point_to_point.then(Place::default),
            compensation: (spec.compensation.as_ref())
                .map(|of| Compensation::new(of, scaling(spec.drives[0]).resolution())),
            coupling: (spec.cross_coupling).map(|of| Coupling::new(of, layout.cycle.as_secs_f64())),
            recalled: false,
            spec,
            moves_on: false,
            history: History::at_rest(Planned::default()),
            lag: layout.lag,
            squaring: None,
            half_enabled: 0,
            apart_seen: 0,
            period: layout.cycle.as_secs_f64(),
        }
    }

    /// Its place in the plan's coordinates.
    pub(super) fn coordinate(&self) -> usize {
        self.spec.coordinate
    }

    // --- its reference ---

    /// Whether its positions are machine positions.
    pub(super) fn is_referenced(&self) -> bool {
        self.referenced
    }

    /// Whether it is known where the axis is, also of one that is not to be moved before its test move.
    fn is_placed(&self) -> bool {
        self.referenced || self.spec.homing.tells_place()
    }

    /// Its positions mean nothing any more.
    pub(super) fn forget_reference(&mut self) {
        self.referenced = false;
        self.tested = self.spec.homing.test_move.is_none();
    }

    /// Whether one of its drives may not count any more as it did when it was referenced.
    pub(super) fn has_lost_count(&self, nodes: &[DeviceNode]) -> bool {
        let mut drives = self.spec.drives.iter();
        let counts_on = self.spec.homing.tells_place() || self.keeps_reference();
        let by_drive = matches!(self.spec.homing.method, HomingMethod::Drive(_));
        let is_lost = |node: &DeviceNode| node.has_lost_count() || by_drive && node.is_not_home();
        !counts_on && drives.any(|&drive| is_lost(&nodes[drive]))
    }

    /// Whether its reference holds when it is switched on again.
    pub(super) fn keeps_reference(&self) -> bool {
        self.spec.homing.moved_limit.is_some()
    }

    /// Takes up the reference that it had when the machine was on last; how far it has moved since, mm. `None`
    /// where there is nothing to take up.
    ///
    /// # Errors
    /// It does not hold any more.
    pub(super) fn recall(&mut self, nodes: &mut [DeviceNode]) -> Option<Result<f64, NotRecalled>> {
        let limit = self.spec.homing.moved_limit?;
        if std::mem::replace(&mut self.recalled, true) || self.referenced {
            return None;
        }
        let kept = match &self.spec.kept {
            Ok(kept) => kept,
            Err(why) => return Some(Err(NotRecalled::NotKept(*why))),
        };
        let mut drives = self.spec.drives.iter().zip(kept);
        if let Some(other) = drives.find_map(|(&drive, kept)| nodes[drive].other_mark(kept)) {
            return Some(Err(NotRecalled::NotKept(NotKept::OtherDevice(other))));
        }
        let mut moved = 0.0_f64;
        for (&drive, kept) in self.spec.drives.iter().zip(kept) {
            let node = &mut nodes[drive];
            let by = node.recall(kept).get().abs() as f64 * node.scaling().resolution();
            moved = moved.max(by);
        }
        self.referenced = moved <= limit;
        Some(match self.referenced {
            true => Ok(moved),
            false => Err(NotRecalled::Moved(moved)),
        })
    }

    /// What is to be kept of its drives, once it was looked what was kept before.
    pub(super) fn kept(
        &self,
        nodes: &[DeviceNode],
    ) -> impl Iterator<Item = (DeviceIndex, Option<Kept>)> {
        let kept = |&drive: &DeviceIndex| (drive, self.referenced.then(|| nodes[drive].kept()));
        let keeps = self.keeps_reference() && self.recalled;
        self.spec.drives.iter().filter(move |_| keeps).map(kept)
    }

    /// The encoder that its position loop is closed by, where it is not the drives.
    fn loop_encoder(&self) -> Option<DeviceIndex> {
        let feedback = self.spec.feedback.filter(|it| it.closes_loop);
        feedback.map(|it| it.encoder)
    }

    /// What tells where a side is.
    pub(super) fn telling(&self, side: usize) -> DeviceIndex {
        self.loop_encoder().unwrap_or(self.spec.drives[side])
    }

    /// Takes it that the edges of its switches, one a side, are at the machine position that the machine
    /// file says; without switches, that the axis stands there. Returns by how much that may be off, and, of one that was
    /// referenced before, how far it believed to be from there, mm.
    pub(super) fn reference(
        &mut self,
        edges: [Option<Edge>; 2],
        nodes: &mut [DeviceNode],
    ) -> Result<(f64, Option<f64>), Fault> {
        let position = match &self.spec.homing.method {
            HomingMethod::Encoder => 0.0,
            HomingMethod::SetHere { position } => *position,
            HomingMethod::Switch(search) => search.position,
            HomingMethod::HardStop(search) => search.position,
            HomingMethod::Drive(homing) => homing.position,
        };
        let (mut uncertainty, mut moved) = (0.0_f64, None::<f64>);
        let squareness = self.spec.homing.square.map_or(0.0, |it| it.squareness);
        let towards = match &self.spec.homing.method {
            HomingMethod::Switch(search) => Some(search.direction),
            HomingMethod::HardStop(search) => Some(search.direction),
            HomingMethod::Encoder | HomingMethod::SetHere { .. } | HomingMethod::Drive(_) => None,
        };
        self.place_compensation(true);
        let position = position + self.correction_of_found(position, towards);
        let places = [position, position + squareness];
        let held = self.holds_apart(nodes);
        let sides = OUTWARDS.into_iter().zip(&self.spec.drives);
        for ((edge, place), (outwards, &drive)) in edges.into_iter().zip(places).zip(sides) {
            let node = &mut nodes[drive];
            let (at, off) = match edge {
                Some(edge) => (edge.at, edge.uncertainty.get()),
                None => {
                    let beside = node.increments(outwards * held)? - node.increments(0.0)?;
                    (node.setpoint.position - beside, 1)
                }
            };
            uncertainty = uncertainty.max(off as f64 * node.scaling().resolution());
            let origin = at - node.increments(place)?;
            let believed = node.scaling().to_mm(at - node.origin()) - place;
            node.set_origin(origin);
            node.keep_count();
            if self.referenced && moved.is_none_or(|moved| believed.abs() > moved.abs()) {
                moved = Some(believed);
            }
        }
        self.referenced = true;
        Ok((uncertainty, moved))
    }

    /// Goes on at rest from where its setpoints are, which do not change; its position there, mm. Of a
    /// gantry that is the middle of its sides, which are planned as far apart as they are.
    pub(super) fn reseat(&mut self, nodes: &mut [DeviceNode]) -> f64 {
        for &drive in &self.spec.drives {
            let node = &mut nodes[drive];
            node.set_offset(node.origin());
        }
        let at = |side: usize| nodes[self.spec.drives[side]].setpoint_mm();
        let coupled = self.holds_apart(nodes);
        let (sent, apart) = match self.sides.len() {
            2 => (f64::midpoint(at(0), at(1)), at(1) - at(0) - coupled),
            _ => (at(0), 0.0),
        };
        self.place_compensation(self.is_placed());
        let position = self.uncorrected(sent);
        self.rest(position, [apart, coupled]);
        position
    }

    // --- its setpoints ---

    /// Takes the setpoints of its sides to be at that position.
    fn seat(&mut self, position: f64, nodes: &mut [DeviceNode]) -> Result<(), Fault> {
        let sent = position + self.correction_at(position);
        for &drive in &self.spec.drives {
            let node = &mut nodes[drive];
            node.set_offset(node.setpoint.position - node.increments(sent)?);
        }
        self.rest(position, [0.0; 2]);
        Ok(())
    }

    /// Is planned to rest there, with its sides apart and sent further apart so far, mm, and goes nowhere.
    pub(super) fn rest(&mut self, position: f64, [apart, coupled]: [f64; 2]) {
        self.history = History::at_rest(Planned {
            position,
            correction: self.correction_at(position),
            apart,
            coupled,
            ..Planned::default()
        });
        if let Some(compensation) = &mut self.compensation {
            compensation.rest(position);
        }
        self.squaring = None;
        if let Some(coupling) = &mut self.coupling {
            coupling.begin(coupled);
        }
        if let Some(place) = &mut self.point_to_point {
            *place = Place {
                at: position,
                ..Place::default()
            };
        }
    }

    // --- point to point ---

    /// Its drive, the first one of two.
    pub(super) fn drive(&self) -> DeviceIndex {
        self.spec.drives[0]
    }

    pub(super) fn limits(&self) -> &AxisLimits {
        &self.spec.limits
    }

    /// Where it is planned to be now, beside the path, if it goes point to point; mm.
    pub(super) fn beside(&self) -> Option<f64> {
        self.point_to_point.map(|place| place.at)
    }

    /// Whether its drive goes to a target, or rests on the way there.
    pub(super) fn goes(&self) -> bool {
        self.point_to_point
            .is_some_and(|place| place.target.is_some())
    }

    /// Sends its drive there with the next setpoints, mm; on the way it halts in so many cycles at the most.
    pub(super) fn go_to(
        &mut self,
        mm: f64,
        halts_in: u64,
        nodes: &[DeviceNode],
    ) -> Result<(), Fault> {
        let there = nodes[self.drive()].setpoint_at(mm)?;
        if let Some(place) = &mut self.point_to_point {
            place.target = Some(there.position);
            place.halts_in = halts_in;
        }
        Ok(())
    }

    /// Looks whether its drive does as it was told: that it acknowledges a target within `patience` cycles, and comes to
    /// rest, which takes `still` cycles to see, within as many behind its ramp where it is to halt.
    pub(super) fn watch_goer(
        &mut self,
        patience: u64,
        still: u32,
        nodes: &[DeviceNode],
    ) -> Result<(), Fault> {
        let node = &nodes[self.drive()];
        let Some(place) = self
            .point_to_point
            .as_mut()
            .filter(|it| it.target.is_some())
        else {
            return Ok(());
        };
        let goes_on = node.power == PowerCommand::Enable && node.still() < still;
        for (cycles, counts) in [
            (&mut place.unacknowledged, node.owes_acknowledgement()),
            (&mut place.unhalted, goes_on),
        ] {
            *cycles = if counts { *cycles + 1 } else { 0 };
        }
        let time = |cycles: u64| cycles as f64 * self.period;
        let cause = if place.unacknowledged > patience {
            AxisCause::NotAcknowledged {
                time: time(place.unacknowledged),
            }
        } else if place.unhalted > patience + place.halts_in {
            AxisCause::NotHalted {
                time: time(place.unhalted),
            }
        } else {
            return Ok(());
        };
        Err(Fault::Axis(self.index, cause))
    }

    /// Its drive goes by itself: it is where that says at SYNC `cycle`.
    pub(super) fn follow(&mut self, cycle: u64, nodes: &[DeviceNode]) {
        if self.point_to_point.is_none_or(|it| it.target.is_none()) {
            return;
        }
        let at = self.actual(cycle, 0, nodes);
        if let Some(place) = &mut self.point_to_point {
            place.at = at;
        }
    }

    /// The fault of an axis whose drive goes to a target and has not stood there for so many cycles, as it has told that it has come
    /// there; while it `may` take longer, it also waits until its encoder was held against its drive.
    pub(super) fn is_away(&self, cycles: u32, may: bool, nodes: &[DeviceNode]) -> Option<Fault> {
        let target = self.point_to_point?.target?;
        let node = &nodes[self.drive()];
        let away = target - node.actual();
        let told = !node.is_under_way();
        let there = away.get().abs() <= node.standstill_window().get()
            && node.still() >= cycles
            && told
            && !(may && self.awaits_comparison(nodes));
        let distance = away.get().abs() as f64 * node.scaling().resolution();
        let cause = AxisCause::NotThere { distance, told };
        (!there).then_some(Fault::Axis(self.index, cause))
    }

    // --- where it stands ---

    /// Checks where the axis stands before it is enabled, and returns its machine position in mm.
    pub(super) fn locate(&mut self, nodes: &[DeviceNode]) -> Result<f64, Fault> {
        let axis = self.index;
        let sides = (0..self.sides.len()).map(|side| nodes[self.telling(side)].actual_mm());
        let (least, most) = sides.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), mm| {
            (least.min(mm), most.max(mm))
        });
        let difference = most - least;
        let taken_out = self.spec.homing.square.map_or(0.0, |it| it.most);
        if self.skewed(difference) && difference > taken_out {
            return Err(Fault::Axis(axis, AxisCause::Skew { difference }));
        }
        // The encoder's noise on a limit is not outside, nor a side of a gantry that is askew: its middle counts.
        let told = f64::midpoint(least, most);
        self.find_inside(told);
        let position = self.uncorrected(told);
        if !self.is_placed() {
            return Ok(position);
        }
        let window = self.spec.limits.standstill;
        let (first, last) = self.spec.limits.position;
        if !(first - window..=last + window).contains(&position) {
            return Err(Fault::Axis(axis, AxisCause::OutsideSoftLimits { position }));
        }
        self.check_feedback(nodes)?;
        Ok(position)
    }

    /// Of a gantry that is being enabled: the side that has been without torque for too long while the
    /// other one pulls.
    pub(super) fn lagging_side(&mut self, nodes: &[DeviceNode]) -> Option<DeviceIndex> {
        let is_off = |&&drive: &&DeviceIndex| !nodes[drive].has_reached(AwaitedState::Enabled);
        let off = self.spec.drives.iter().filter(is_off).count();
        let half = off > 0 && off < self.spec.drives.len();
        self.half_enabled = if half { self.half_enabled + 1 } else { 0 };
        let lags = self.half_enabled > SIDES_ENABLE;
        let mut drives = self.spec.drives.iter().filter(|_| lags);
        drives.find(is_off).copied()
    }

    /// What its drives were sent and said before is no longer held against what comes.
    pub(super) fn forget_motion(&mut self) {
        for side in &mut self.sides {
            side.guard.forget();
            (side.seen, side.enabled) = (None, None);
        }
    }

    /// Freezes the axis where its drives' setpoints are; the plan starts from the returned
    /// machine position in mm. How far the sides of a gantry are out of square is in its plan then, and not in offsets
    /// of theirs, so that it can be taken out.
    pub(super) fn freeze(&mut self, nodes: &mut [DeviceNode]) -> Result<f64, Fault> {
        let position = self.locate(nodes)?;
        self.forget_motion();
        if let [one, other] = self.spec.drives[..] {
            let apart = nodes[other].actual_mm() - nodes[one].actual_mm();
            if self.skewed(apart.abs()) || self.is_out_of_square(apart, nodes) {
                return Ok(self.reseat(nodes));
            }
        }
        let position = self.held(position, nodes);
        self.seat(position, nodes)?;
        Ok(position)
    }

    /// SYNC `cycle` and those after it, `lost` in all, were left out: the next one latches what
    /// `cycle` would have, and the drives went on meanwhile.
    pub(super) fn lose_cycles(&mut self, cycle: u64, lost: u64) {
        self.history.lose_cycles(cycle, lost);
        if let Some(squaring) = self.squaring.as_mut().filter(|_| lost > 1) {
            squaring.wait(lost);
        }
        for (_, ago) in self.sides.iter_mut().filter_map(|side| side.seen.as_mut()) {
            *ago = ago.saturating_add(u32::try_from(lost).unwrap_or(u32::MAX));
        }
    }

    /// The plan, positions and velocities, for SYNC `cycle`, which is left out: the next setpoint may be further away.
    pub(super) fn leave_out(&mut self, cycle: u64, plan: (&[f64], &[f64])) {
        self.couple(cycle, plan, true, None);
        let planned = self.planned_at(cycle, plan);
        self.history.leave_out(planned);
        self.go_on_compensating();
        self.sides.iter_mut().for_each(|side| side.guard.forget());
    }

    /// Looks whether its drives can be sent to what the plan, positions and velocities, has for SYNC `cycle`,
    /// each by its latency. What one of them cannot take is taken by none: they keep their last one.
    /// Its soft limits count once it is referenced, but not `in_homing`. Where it `couples` its sides are moved against each other.
    pub(super) fn prepare(
        &mut self,
        cycle: u64,
        plan: (&[f64], &[f64]),
        (in_homing, couples): (bool, bool),
        nodes: &[DeviceNode],
    ) -> Result<(), Fault> {
        self.moves_on = false;
        if self.is_quick_stopped(nodes) || self.homes(nodes) {
            return Ok(());
        }
        if let Some(place) = self.point_to_point {
            let setpoint = nodes[self.drive()].setpoint;
            self.sides[0].next = place.target.map_or(setpoint, Setpoint::at);
            self.history.propose(Planned {
                position: place.at,
                ..Planned::default()
            });
            self.moves_on = true;
            return Ok(());
        }
        self.couple(cycle, plan, couples && !in_homing, Some(nodes));
        let planned = self.planned_at(cycle, plan);
        self.history.propose(planned);
        for index in 0..self.sides.len() {
            let drive = self.spec.drives[index];
            let node = &nodes[drive];
            let there = self.history.proposed(node.delay()).of_side(index);
            let velocity = self.velocity(cycle, index, nodes);
            let torque = self.torque(index, nodes);
            let side = &mut self.sides[index];
            side.next = Setpoint {
                velocity,
                torque,
                ..node.setpoint_at(there)?
            };
            let origin = Some(node.origin()).filter(|_| self.referenced && !in_homing);
            let guarded = side.guard.check(side.next.position, origin);
            guarded.map_err(|(quantity, value)| {
                let cause = AxisCause::SetpointGuard {
                    drive,
                    quantity,
                    value,
                    sampled: false,
                };
                Fault::Axis(self.index, cause)
            })?;
        }
        self.moves_on = true;
        Ok(())
    }

    /// Hands the drives what SYNC `cycle` latches, if they `move_on` and it could be prepared; otherwise they
    /// keep their last position. Whether one of them is sent another position than before.
    pub(super) fn hand_over(
        &mut self,
        cycle: u64,
        move_on: bool,
        nodes: &mut [DeviceNode],
    ) -> bool {
        if !(self.moves_on && move_on) {
            self.history.propose_rest();
            let (quick_stopped, homes) = (self.is_quick_stopped(nodes), self.homes(nodes));
            for (side, &drive) in self.spec.drives.iter().enumerate() {
                if quick_stopped {
                    nodes[drive].hold();
                } else if homes {
                    nodes[drive].go_along();
                } else {
                    nodes[drive].setpoint.velocity = self.velocity(cycle, side, nodes);
                }
            }
            self.hold_up(nodes);
            self.history.hand_over(cycle);
            if quick_stopped || homes {
                self.forget_corrections();
            }
            return false;
        }
        self.history.hand_over(cycle);
        self.go_on_compensating();
        let mut changes = false;
        for (side, &drive) in self.sides.iter_mut().zip(&self.spec.drives) {
            changes |= nodes[drive].setpoint.position != side.next.position;
            nodes[drive].setpoint = side.next;
            side.guard.push(side.next.position);
        }
        changes
    }

    /// Whether its drives come to rest by themselves.
    pub(super) fn is_quick_stopped(&self, nodes: &[DeviceNode]) -> bool {
        let mut drives = self.spec.drives.iter();
        drives.any(|&drive| nodes[drive].is_quick_stopped())
    }

    /// Whether its drive homes by itself.
    pub(super) fn homes(&self, nodes: &[DeviceNode]) -> bool {
        nodes[self.drive()].homes()
    }

    /// What the axis did at SYNC `cycle`, which has just been answered by its T_PDOs. A drive whose
    /// T_PDO is missing is measured by the plan of its last one.
    pub(super) fn sample(&self, cycle: u64, nodes: &[DeviceNode]) -> AxisSample {
        let mut worst = AxisSample {
            apart: self.apart(cycle),
            torque: ToldTorque::of(
                (self.spec.drives.iter()).map(|&drive| nodes[drive].told_torque()),
            ),
            velocity: match self.spec.drives[..] {
                [drive] if nodes[self.telling(0)].age() == 0 => {
                    position_loop::sent_velocity(&nodes[drive])
                }
                _ => None,
            },
            by_itself: self.is_quick_stopped(nodes) || self.goes() || self.homes(nodes),
            ..AxisSample::default()
        };
        let sides = self.spec.drives.len();
        if worst.by_itself {
            let told_by = |side| nodes[self.telling(side)].actual_mm();
            let told = told_by(0);
            worst.act = self.uncorrected(told);
            worst.set = worst.act;
            let places = (0..sides).map(|side| self.uncorrected(told_by(side)));
            worst.middle = places.sum::<f64>() / sides as f64;
            worst.correction = told - worst.act;
            worst.of_side = [told; 2];
            return worst;
        }
        for (side, &drive) in self.spec.drives.iter().enumerate() {
            let act = self.actual(cycle, side, nodes);
            let seen = self.goes_on(cycle, side, nodes).unwrap_or(act);
            worst.middle += seen / sides as f64;
            let due = self.sent_to(cycle, side, nodes);
            let following_error = due.position - act;
            let latched = self.history.latched(cycle, nodes[drive].delay());
            worst.of_side[side] = latched.of_side(side);
            if side == 0 || following_error.abs() > worst.following_error.abs() {
                (worst.set, worst.apart) = (latched.position, latched.apart);
                worst.coupled = latched.coupled;
                worst.correction = due.correction;
                worst.act = seen;
                worst.following_error = following_error;
            }
        }
        worst
    }

    /// The greatest speed of the setpoints latched at SYNC `cycle` and lately before, mm/s: a following error
    /// decays later than the speed that it comes from.
    fn speed(&self, cycle: u64) -> f64 {
        let steps = (1..RECENT).map(|back| {
            let before = cycle.wrapping_sub(back);
            let [there, here] =
                [before.wrapping_add(1), before].map(|at| self.history.planned(at, 0.0));
            (there.sent() - here.sent()).abs()
        });
        steps.fold(0.0, f64::max) / self.period
    }

    /// Looks at the actual positions of a cycle: what changed by more than the axis can move is none of it.
    pub(super) fn check_jumps(&mut self, nodes: &[DeviceNode]) -> Result<(), Fault> {
        let mut outcome = Ok(());
        if self.homes(nodes) {
            return outcome;
        }
        let encoder = self.loop_encoder();
        let limits = &self.spec.sent_limits;
        for (side, &drive) in self.sides.iter_mut().zip(&self.spec.drives) {
            let node = &nodes[encoder.unwrap_or(drive)];
            // What is polled may have moved for longer than a cycle.
            if !node.answers_sync() {
                continue;
            }
            if node.age() > 0 {
                side.seen = side.seen.map(|(seen, ago)| (seen, ago.saturating_add(1)));
            } else if let Some((seen, ago)) = side.seen.replace((node.actual(), 1)) {
                let counts = (node.actual() - seen).get().unsigned_abs();
                let distance = counts as f64 * node.scaling().resolution();
                let possible =
                    JUMP * limits.velocity * self.period * f64::from(ago) + limits.standstill;
                if distance > possible {
                    let cause = AxisCause::Jump { distance, possible };
                    outcome = Err(Fault::Axis(self.index, cause));
                }
            }
        }
        outcome
    }

    /// Looks at its drives from when they are told to be enabled until their setpoints are frozen: one that is stays where it
    /// was then, as near as an axis has to be at rest.
    pub(super) fn check_enabled(&mut self, nodes: &[DeviceNode]) -> Result<(), Fault> {
        self.check_jumps(nodes)?;
        let allowed = self.spec.limits.following_error_at(0.0);
        for (side, &drive) in self.sides.iter_mut().zip(&self.spec.drives) {
            let node = &nodes[drive];
            if !node.has_reached(AwaitedState::Enabled) {
                side.enabled = None;
                continue;
            }
            let error = *side.enabled.get_or_insert(node.actual_mm()) - node.actual_mm();
            if error.abs() > allowed {
                let cause = AxisCause::FollowingError { error, allowed };
                return Err(Fault::Axis(self.index, cause));
            }
        }
        Ok(())
    }

    /// Whether the axis has arrived where the plan is at rest.
    pub(super) fn is_in_position(&self, sample: &AxisSample) -> bool {
        sample.following_error.abs() <= self.spec.limits.standstill && self.is_compensated()
    }

    /// Checks a sample while the setpoint is frozen.
    pub(super) fn check_standstill(&self, sample: &AxisSample) -> Result<(), Fault> {
        let distance = (sample.set - sample.act).abs();
        if distance > self.spec.limits.standstill {
            let axis = self.index;
            return Err(Fault::Axis(axis, AxisCause::Standstill { distance }));
        }
        Ok(())
    }

    /// Checks a sample while the setpoint moves.
    pub(super) fn check_motion(
        &mut self,
        cycle: u64,
        sample: &AxisSample,
        nodes: &[DeviceNode],
    ) -> Result<(), Fault> {
        let axis = self.index;
        if sample.by_itself {
            return Ok(());
        }
        let error = sample.following_error;
        // The speed is looked for only where it matters: at rest the least is allowed.
        let allowed = |speed| self.spec.limits.following_error_at(speed);
        if error.abs() > allowed(0.0) {
            let allowed = allowed(self.speed(cycle));
            if error.abs() > allowed {
                let cause = AxisCause::FollowingError { error, allowed };
                return Err(Fault::Axis(axis, cause));
            }
        }
        self.check_skew(cycle, sample.apart, nodes)
    }
}
