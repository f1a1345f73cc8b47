//! Every axis against its limits: what was planned, what was sent, and what the drives made of it.
//!
//! A verdict that believed the plan would trust whom it judges. So it has three grounds, of which none
//! can be right by mistake alone:
//!
//! - *the plan's own derivatives* at every SYNC, as exact as numbers are,
//! - *differences of the positions*: of those planned, and of those that the drives were sent, which were
//!   decoded from the frames that their buses carried ([`sent`](super::sent)). They are bounds that hold
//!   between the SYNCs too (`differences`): a move that is over within a cycle has
//!   no derivative at a SYNC, but its differences show what it did,
//! - *what was sent against the plan*: the nearest increment. A drive keeps a whole number of increments
//!   between its own count and the plan's, captured when its setpoint was frozen where it stood; that is
//!   read off the first row, held against the standstill window (and the skew of a gantry), and must stay
//!   what it was. From there a setpoint that is more than half an increment off is wrong: by another
//!   rounding, a cycle, a scale, a sign, an axis or a side.
//!
//! A setpoint that holds the low bits of a position alone ([`Drive::setpoint_range`]) goes on from the one
//! before, as the drive takes it; the first one is the nearest to the plan, as nothing else tells.
//!
//! Where the controller compensates backlash and lead error, what was sent is held against the corrected setpoint, and the
//! correction against the machine file's lead error: it is off that by half of the backlash at the most.
//!
//! With the third ground, what the first says of the plan holds for what was sent, to half an increment; and
//! the second holds without it.
//!
//! [`Drive::setpoint_range`]: syncline_drives::model::Drive::setpoint_range

use super::differences::{Differences, Uncertainty};
use super::kept::Kept;
use super::positioning::Positioning;
use super::record::{Place, Violation};
use super::sent::SentSetpoints;
use crate::control::{AxisSample, Row};
use crate::machine::{Axis, AxisLimits, COORDINATES, Compensation, CrossCoupling, Machine, Motion};
use syncline_drives::model::{self, Increments, Setpoints, unwrapped};

/// A plan may exceed a limit by this part of it: rounding.
const ROUNDING: f64 = 1e-9;

/// A setpoint so far beyond a soft limit, mm, is still on it.
const BEYOND: f64 = 1e-6;

/// The plan of a row is at the most so many cycles ahead of what its drives have latched.
const LATCHED: f64 = 4.0;

/// How far a setpoint that was sent may be from the one that was planned, increments: rounding to the
/// nearest one.
const NEAREST: f64 = 0.5 + 1e-6;

/// What is watched for each axis, and which of its units that has: of position, velocity, acceleration or
/// jerk, or increments.
const WATCHED: [(&str, usize); 12] = [
    ("velocity", 1),
    ("acceleration", 2),
    ("jerk", 3),
    ("following_error", 0),
    ("beyond soft_limits", 0),
    ("off the compensated position", 0),
    ("sent velocity", 1),
    ("sent acceleration", 2),
    ("sent jerk", 3),
    ("sent beyond soft_limits", 0),
    ("sent off the plan", 4),
    ("sent off the frozen setpoint", 0),
];

/// Which of them is the following error.
const FOLLOWING: usize = 3;

/// Which of them are held against limits of the axis' setpoints.
const BY_LIMITS: [usize; 8] = [0, 1, 2, 4, 6, 7, 8, 9];

/// How many of them are of what was sent: the last ones.
const SENT: usize = 6;

/// A value that has a limit. A stretch above the limit is one violation, told at its worst.
#[derive(Debug, Default)]
pub(super) struct Watch {
    /// Where the stretch that goes on began, and its worst.
    stretch: Option<(Place, Violation)>,
}

/// Whether it is no more than the limit, but for the rounding of both.
fn is_within(value: f64, limit: f64) -> bool {
    value <= limit * (1.0 + ROUNDING)
}

impl Watch {
    /// Looks at a value. Its violation is made of where the stretch began.
    pub(super) fn look(
        &mut self,
        violations: &mut Kept<Violation>,
        at: Place,
        value: f64,
        limit: f64,
        violation: impl FnOnce(Place) -> Violation,
    ) {
        if is_within(value, limit) {
            return self.close(violations);
        }
        let began = self.stretch.as_ref().map_or(at, |(began, _)| *began);
        let worst = self.stretch.as_ref().map(|(_, worst)| worst.value);
        if worst.is_none_or(|worst| value > worst) {
            self.stretch = Some((began, violation(began)));
        }
    }

    /// The same where a value comes and goes: what is above the limit again in the same line is of the same stretch.
    pub(super) fn look_by_line(
        &mut self,
        violations: &mut Kept<Violation>,
        at: Place,
        value: f64,
        limit: f64,
        violation: impl FnOnce(Place) -> Violation,
    ) {
        let goes_on = (self.stretch.as_ref()).is_some_and(|(began, _)| began.line == at.line);
        if !(is_within(value, limit) && goes_on) {
            self.look(violations, at, value, limit, violation);
        }
    }

    /// Ends a stretch that goes on.
    pub(super) fn close(&mut self, violations: &mut Kept<Violation>) {
        violations.extend(self.stretch.take().map(|(_, worst)| worst));
    }
}

/// What is seen of one axis; arrays in the order of [`WATCHED`].
#[derive(Debug)]
pub(super) struct AxisWatches {
    pub(super) name: &'static str,
    pub(super) coordinate: usize,
    units: [&'static str; 5],
    /// The machine file's; its positions widened by where the axis stood at first.
    pub(super) limits: AxisLimits,
    /// What of velocity, acceleration and jerk the plan has: what compensation leaves it.
    planned_limits: [f64; 3],
    compensation: Option<Compensation>,
    /// The greatest curvature of its lead error, 1/mm.
    curvature: f64,
    coupling: Option<CrossCoupling>,
    max: [f64; WATCHED.len()],
    watches: [Watch; WATCHED.len()],
    /// The cycle of the next row, if none is left out.
    next: u64,
    /// Its positions are machine positions, and it stands where the machine file says.
    referenced: bool,
    /// It is homed: its drives do not count as the machine file says.
    homed: bool,
    /// Setpoints are held against limits.
    judges_setpoints: bool,
    period: f64,
    planned: Differences,
    sides: Vec<Side>,
    /// It was told that its sides stay apart.
    stands_apart: bool,
    /// Sum of the squares of the following error, and of how many rows.
    squares: f64,
    rows: u64,
    /// Where the greatest following error was, and what of it `[validation]` allows.
    following_at: Place,
    following_tolerance: f64,
    /// SYNCs at which a drive had been sent no setpoint.
    pub(super) unsent: u64,
    /// Of an axis that goes point to point.
    pub(super) positioning: Option<Positioning>,
}

/// A drive of an axis by what it is sent; its increments as the machine file has them.
#[derive(Debug)]
struct Side {
    drive: usize,
    /// Which side of its axis it is.
    place: usize,
    /// One increment, with the sign of the direction, mm.
    increment: f64,
    /// What the drive counts at machine position 0.
    zero: f64,
    /// After how many increments its setpoint begins anew, if it does.
    range: Option<Increments>,
    /// What it latched last, all of it.
    count: Increments,
    /// Its count less the plan's, increments, once it is known.
    offset: Option<f64>,
    /// The cycle of the last row; where cycles were left out, the setpoint may have been frozen anew.
    cycle: u64,
    differences: Differences,
}

impl Side {
    fn new(machine: &Machine, drive: usize, place: usize) -> Self {
        let scaling = &machine.drives[drive].scaling;
        let increment = scaling.direction().sign() * scaling.resolution();
        let device = machine.device(drive);
        Self {
            drive,
            place,
            increment,
            zero: (-scaling.to_mm(Increments::ZERO) / increment).round(),
            range: device.drive().and_then(model::Drive::setpoint_range),
            count: Increments::ZERO,
            offset: None,
            cycle: 0,
            differences: Differences::new(machine.cycle.as_secs_f64(), Uncertainty::Increments),
        }
    }

    /// Takes the setpoint that it latched, where one was planned, mm, between two limits: what is
    /// watched of what was sent.
    fn latch(
        &mut self,
        cycle: u64,
        count: Increments,
        planned: f64,
        (min, max): (f64, f64),
    ) -> [f64; SENT] {
        let Self {
            increment, zero, ..
        } = *self;
        let planned = planned / increment;
        if cycle != self.cycle + 1 {
            self.offset = None;
            self.count = Increments::new((zero + planned.round()) as i64);
        }
        self.count = unwrapped(count, self.range, self.count);
        let count = self.count.get() as f64;
        self.cycle = cycle;
        let offset = *(self.offset).get_or_insert(count - zero - planned.round());
        let [velocity, acceleration, jerk] =
            (self.differences.push(cycle, count)).map(|it| it * increment.abs());
        let sent = count - zero - offset;
        // What was rounded to the increment may lie this side of the limit.
        let beyond = (min - sent * increment).max(sent * increment - max);
        let beyond = beyond - NEAREST * increment.abs();
        [
            velocity,
            acceleration,
            jerk,
            beyond.max(0.0),
            (sent - planned).abs(),
            (offset * increment).abs(),
        ]
    }
}

impl AxisWatches {
    /// Nothing yet of an axis of the machine.
    pub(super) fn new(machine: &Machine, axis: &Axis) -> Self {
        let cycle = machine.cycle.as_secs_f64();
        let [position, velocity, acceleration, jerk] = axis.units();
        Self {
            name: axis.name(),
            coordinate: axis.letter.index(),
            units: [position, velocity, acceleration, jerk, "increments"],
            limits: axis.stated_limits(),
            planned_limits: [
                axis.limits.velocity,
                axis.limits.acceleration,
                axis.limits.jerk,
            ],
            compensation: axis.compensation.clone(),
            curvature: (axis.compensation.as_ref()).map_or(0.0, |it| it.lead_error.greatest()[2]),
            coupling: axis.cross_coupling,
            max: [0.0; WATCHED.len()],
            watches: Default::default(),
            // No row has that number: the first one begins.
            next: u64::MAX,
            referenced: axis.homing.is_absolute(),
            homed: !axis.homing.is_absolute(),
            judges_setpoints: true,
            period: cycle,
            planned: Differences::new(cycle, Uncertainty::Numbers),
            // What is sent velocities is judged by where it is.
            sides: (axis.drives.iter().enumerate())
                .filter(|&(_, &drive)| machine.drives[drive].model.is_sent(Setpoints::Positions))
                .map(|(place, &drive)| Side::new(machine, drive, place))
                .collect(),
            stands_apart: false,
            squares: 0.0,
            rows: 0,
            following_at: Place::default(),
            following_tolerance: machine.validation.following_error,
            unsent: 0,
            positioning: (axis.motion == Motion::PointToPoint).then(Positioning::default),
        }
    }

    /// From the next row on its positions count from elsewhere, and are machine positions or not; what
    /// the drives are sent does not change with that.
    pub(super) fn count_anew(&mut self, referenced: bool) {
        self.referenced = referenced;
        self.next = u64::MAX;
        self.planned = Differences::new(self.period, Uncertainty::Numbers);
        self.count_sides_anew();
    }

    fn count_sides_anew(&mut self) {
        for side in &mut self.sides {
            side.offset = None;
        }
    }

    /// Behind the next row, which is of the cycle before that was so, its sides count from where they rest apart, and are planned there.
    pub(super) fn stand_apart(&mut self) {
        self.stands_apart = true;
    }

    /// From the next row on its positions are no machine positions. They count on, and it may be in motion.
    pub(super) fn forget_reference(&mut self) {
        self.referenced = false;
    }

    /// Whether it is known where it is.
    pub(super) fn is_referenced(&self) -> bool {
        self.referenced
    }

    /// Of its limits only that of its following error is judged, and whether it is sent what is planned.
    pub(super) fn judge_following(&mut self) {
        self.judges_setpoints = false;
    }

    /// Of its positions.
    pub(super) fn unit(&self) -> &'static str {
        self.units[0]
    }

    /// Greatest velocity, acceleration and jerk: at the SYNCs, and what differences between them prove.
    pub(super) fn max(&self) -> [f64; 3] {
        let (plan, sent) = self.max.split_at(WATCHED.len() - SENT);
        [0, 1, 2].map(|order| plan[order].max(sent[order]))
    }

    /// Greatest following error, and the root of its mean square.
    pub(super) fn following(&self) -> [f64; 2] {
        let mean = self.squares / self.rows.max(1) as f64;
        [self.max[FOLLOWING], mean.sqrt()]
    }

    /// Where the greatest following error was.
    pub(super) fn following_at(&self) -> Place {
        self.following_at
    }

    /// Takes what happened at one SYNC, and what the drives latched there if that is known.
    pub(super) fn observe(
        &mut self,
        row: &Row<COORDINATES>,
        sent: Option<&SentSetpoints>,
        time: f64,
        line: u32,
        violations: &mut Kept<Violation>,
    ) {
        let at = self.coordinate;
        if let Some(positioning) = &mut self.positioning {
            positioning.observe(&row.axes[at], row.cycle, Place { time, line });
        }
        if row.axes[at].by_itself {
            // It follows nothing that could be held against a limit.
            return;
        }
        let position = row.plan.position[at];
        // The sides of a gantry are that far from its middle, by which it is planned.
        let half = 0.5 * row.axes[at].apart.abs();
        let (mut min, mut max) = self.limits.position;
        if !self.referenced || row.axes[at].in_homing {
            (min, max) = (f64::NEG_INFINITY, f64::INFINITY);
        } else if row.cycle != self.next {
            // The encoder's noise of a machine that is frozen at a limit is no violation.
            (min, max) = (min.min(position - half), max.max(position + half));
            self.limits.position = (min, max);
        }
        self.next = row.cycle + 1;
        let following = row.axes[at].following_error;
        if following.abs() > self.max[FOLLOWING] {
            self.following_at = Place { time, line };
        }
        self.squares += following * following;
        self.rows += 1;
        let [velocity, acceleration, jerk] = self.planned.push(row.cycle, position);
        let speed = row.plan.velocity[at].abs().max(velocity);
        let planned = [
            speed,
            row.plan.acceleration[at].abs().max(acceleration),
            row.plan.jerk[at].abs().max(jerk),
            following.abs(),
            (min - position).max(position - max).max(0.0),
            self.off_compensated(&row.axes[at]),
        ];
        let beyond = half + (self.compensation.as_ref()).map_or(0.0, Compensation::greatest);
        let beyond = beyond + 0.5 * self.coupling.map_or(0.0, |it| it.limit);
        let of_sent = (min - beyond, max + beyond);
        let sent = sent.map_or([0.0; SENT], |sent| self.latch(row, sent, of_sent));
        if std::mem::take(&mut self.stands_apart) {
            self.count_sides_anew();
        }
        let AxisLimits {
            velocity,
            acceleration,
            jerk,
            following_error,
            skew,
            standstill,
            ..
        } = self.limits;
        let window = match self.homed {
            true => f64::INFINITY,
            false => standstill + skew.unwrap_or(0.0),
        };
        let following = following_error.min(self.following_tolerance);
        let [v, a, j] = self.planned_limits;
        let corrected = self.may_be_off(speed);
        let planned = (planned.into_iter()).zip([v, a, j, following, BEYOND, corrected]);
        let sent = sent
            .into_iter()
            .zip([velocity, acceleration, jerk, BEYOND, NEAREST, window]);
        for (place, (value, limit)) in planned.chain(sent).enumerate() {
            let (what, unit) = WATCHED[place];
            self.max[place] = self.max[place].max(value);
            if !self.judges_setpoints && BY_LIMITS.contains(&place) {
                continue;
            }
            let at = Place { time, line };
            self.watches[place].look(violations, at, value, limit, |_| Violation {
                what: what.to_owned(),
                axis: Some(self.name.to_owned()),
                time,
                line,
                value,
                limit,
                unit: self.units[unit],
            });
        }
    }

    /// How far a drive is sent beside where the lead error says that the axis has to be sent, mm: that is half of its backlash
    /// at the most.
    fn off_compensated(&self, sample: &AxisSample) -> f64 {
        match (&self.compensation, &self.sides[..]) {
            (Some(compensation), [side]) if self.referenced => {
                let (error, _) = compensation.lead_error.at(sample.set);
                (sample.of_side[side.place] - (sample.set - error)).abs()
            }
            _ => 0.0,
        }
    }

    /// How far that may be, mm, of an axis of this speed, mm/s: half of the backlash; and as a drive that is sent the mean of two
    /// setpoints is sent the mean of their corrections, what a curve that is bent so much is away from a chord of that length.
    fn may_be_off(&self, speed: f64) -> f64 {
        let flank = 0.5 * (self.compensation.as_ref()).map_or(0.0, |it| it.backlash);
        let before = LATCHED * self.limits.acceleration * self.period;
        let step = (speed + before) * self.period;
        flank + self.curvature * step * step / 8.0 + BEYOND
    }

    /// What is watched of what its drives latched at the row's SYNC: of its sides the greatest.
    fn latch(
        &mut self,
        row: &Row<COORDINATES>,
        sent: &SentSetpoints,
        limits: (f64, f64),
    ) -> [f64; SENT] {
        let sample = &row.axes[self.coordinate];
        let mut greatest = [0.0_f64; SENT];
        for side in &mut self.sides {
            let planned = sample.of_side[side.place];
            let Some(count) = sent.latched(side.drive, row.sync) else {
                self.unsent += 1;
                continue;
            };
            let of = side.latch(row.cycle, count, planned, limits);
            for (greatest, of) in greatest.iter_mut().zip(of) {
                *greatest = greatest.max(of);
            }
        }
        greatest
    }

    /// Ends the stretches that go on.
    pub(super) fn close(&mut self, violations: &mut Kept<Violation>) {
        for watch in &mut self.watches {
            watch.close(violations);
        }
    }
}
