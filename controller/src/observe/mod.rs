//! What only watches: a run is the same with it and without it.
//!
//! - [`Observers`]: all that is kept about a run, row by row
//! - [`limits`]: every axis against its limits, as planned and as sent
//! - [`sent`]: what the drives were sent, from the frames on the buses
//! - `mapping`: which bytes of their PDOs are what
//! - `differences`: what positions at the SYNCs say of the motion between them
//! - [`axis_log`]: setpoint, position and torque of one axis, for who identifies it
//! - [`circles`]: the circular test on full circles
//! - [`cutting`]: with which force tools cut in a simulation
//! - [`deviation`]: setpoint and tool against the programmed geometry
//! - `trail`: the path of the setpoints, which the drives are to follow
//! - [`loops`]: how far the loops of simulated drives are from swinging
//! - `drives`: torque and speed of simulated drives
//! - [`gantry`]: skew, racking and torque fight of the sides of gantries
//! - `structure`: how the simulated machine sways between tool and workpiece
//! - `transmission`: how far what simulated drives move is from where they say
//! - [`travel`]: how far the tool has come along the program, and for how long it moved
//! - [`places`]: where a run was worst
//! - `positioning`: what axes did that go point to point
//! - [`provenance`]: where a result is from
//! - [`operations`]: what the time of motion went into, by tool and by operation
//! - `fourier`: spectra of stretches of rows; `kept`: the first of what there may be any number of
//! - [`trace`]: every row as CSV
//! - [`sampled`]: motion that is known by samples alone, against limits
//! - [`record`]: every row for a report, and what must not be
//! - [`switched`]: what M-codes switched, and when
//! - [`supply`]: I²t, DC bus and braking resistor of simulated drives
//! - [`summary`]: the result
//! - [`frames`]: what the simulated buses carried: hash, utilisation
//! - [`flight_recorder`]: the last seconds before a fault
//! - [`timing`]: how punctual a cycle was

pub mod axis_log;
pub mod circles;
pub mod cutting;
pub mod deviation;
mod differences;
mod drives;
pub mod flight_recorder;
pub(crate) mod fourier;
pub mod frames;
pub mod gantry;
mod kept;
pub mod limits;
pub mod loops;
pub(crate) mod mapping;
pub mod operations;
pub mod places;
mod positioning;
pub mod provenance;
pub mod record;
pub mod sampled;
pub mod sent;
mod structure;
pub mod summary;
pub mod supply;
pub mod switched;
pub mod timing;
pub mod trace;
mod trail;
mod transmission;
pub mod travel;

use crate::control::fault::{AxisCause, Fault};
use crate::control::layout::Layout;
use crate::control::{Cause, Controller, End, Event, LostReference, Phase, Row};
use crate::machine::{Axis, COORDINATES, Machine, Position, Validation};
use crate::program::bounds::TimeBounds;
use crate::program::{Extent, Moves, counted_speed};
use axis_log::AxisLog;
use circles::Circles;
use deviation::Deviation;
use drives::Drives;
use kept::Kept;
use limits::AxisWatches;
use loops::LoopSummary;
use operations::Operations;
use places::{Places, Seen};
use record::{Place, Report, Violation};
use sent::SentSetpoints;
use std::fmt;
use std::io;
use std::time::Duration;
use summary::{AxisSummary, BusSummary, Stopped, Summary, Times};
use switched::Switched;
use syncline_drives::twin::Observation;
use syncline_drives::twin::servo::cascade::Gains;
use syncline_trajectory::sampled::Sampled;
use trace::{Sink, Trace};
use travel::Travel;

/// By this part of a step less an instant is at the next sample.
const WHOLE: f64 = 1e-6;

/// What is there to be seen at one SYNC of the program.
#[derive(Clone, Copy)]
pub struct Observed<'a> {
    /// Plan and axes.
    pub row: &'a Row<COORDINATES>,
    /// Where the axes are, mm and degrees; coordinates without an axis as planned.
    pub actual: Position,
    /// The program's line.
    pub line: u32,
    /// At rest until an operator goes on.
    pub waits: bool,
    /// No job is at work, and nothing is asked for.
    pub idle: bool,
    /// The job at work: each counts its path from 0.
    pub job: u64,
    /// The program's moves about here.
    pub moves: &'a Moves,
    /// The tag of the move that the path has come to; `None` while the axes are off the path.
    pub tag: Option<u32>,
}

/// All that is kept about a run.
pub struct Observers {
    cycle: Duration,
    cycles: u64,
    /// The cycle of the next row, if none is left out.
    next: u64,
    /// Seconds from sample to sample, where what runs is known by samples alone.
    samples: Option<f64>,
    /// The last row's.
    line: u32,
    position: Position,
    /// What the program amounts to, if it was read before.
    extent: Option<Extent>,
    time_bounds: Option<TimeBounds>,
    /// What began the last stop, and where.
    fault: Option<(Fault, Place)>,
    /// What began those before it, behind each of which the machine was reset.
    faults: Kept<(Fault, Place)>,
    /// Why the program could not go on, in a line.
    problem: Option<String>,
    late_setpoint: Option<Place>,
    travel: Travel,
    deviation: Deviation,
    axes: Vec<AxisWatches>,
    drives: Drives,
    loops: Vec<LoopSummary>,
    tolerance: Validation,
    /// What the buses carried, where all of them can be heard.
    sent: Option<SentSetpoints>,
    operations: Operations,
    places: Places,
    circles: Circles,
    switched: Switched,
    violations: Kept<Violation>,
    trace: Option<Trace>,
    axis_log: Option<AxisLog>,
    report: Option<Report>,
}

impl Observers {
    /// For a machine; `sent` is what its buses carry ([`SharedFrames::listen`]), `None` where they cannot
    /// be heard; `trace` takes the CSV rows, `report` says whether a report will be wanted.
    ///
    /// [`SharedFrames::listen`]: frames::SharedFrames::listen
    #[must_use]
    pub fn new(
        machine: &Machine,
        sent: Option<SentSetpoints>,
        trace: Option<Sink>,
        report: bool,
    ) -> Self {
        Self {
            cycle: machine.cycle,
            cycles: 0,
            next: 0,
            samples: None,
            line: 0,
            position: Position::default(),
            extent: None,
            time_bounds: None,
            fault: None,
            faults: Kept::default(),
            problem: None,
            late_setpoint: None,
            travel: Travel::default(),
            deviation: Deviation::new(machine),
            drives: Drives::new(machine),
            loops: Vec::new(),
            tolerance: machine.validation,
            axes: (machine.axes.iter())
                .map(|axis| AxisWatches::new(machine, axis))
                .collect(),
            sent,
            operations: Operations::default(),
            places: Places::default(),
            circles: Circles::new(machine),
            switched: Switched::default(),
            violations: Kept::default(),
            trace: trace.map(|file| Trace::begin(file, machine)),
            axis_log: None,
            report: report.then(|| Report::of(machine)),
        }
    }

    /// What the program amounts to, where it was read before: for what is left of one that does not come to
    /// its end.
    #[must_use]
    pub fn of_program(mut self, extent: Option<Extent>) -> Self {
        self.extent = extent;
        self
    }

    /// The simulated drives are seen in every cycle ([`observe_drives`](Self::observe_drives)): the trace has where the tool is, too, where
    /// that is not where the axes say.
    #[must_use]
    pub fn seeing_drives(mut self, machine: &Machine) -> Self {
        if let Some(trace) = self.trace.as_mut().filter(|_| self.drives.give_way()) {
            trace.tell_tool(machine);
        }
        self
    }

    /// What runs is known by samples alone, behind a program that leads to the first one: only they count, with times from
    /// the first one on. The lines of places are their numbers, from 1. Their limits are judged apart, with what samples
    /// are uncertain by ([`sampled`]).
    #[must_use]
    pub fn along(mut self, samples: &Sampled<COORDINATES>) -> Self {
        self.samples = Some(samples.step());
        self.deviation.has_no_moves();
        self.axes.iter_mut().for_each(AxisWatches::judge_following);
        self
    }

    /// Hands on what one axis did in every cycle.
    #[must_use]
    pub fn logging(mut self, axis_log: AxisLog) -> Self {
        self.axis_log = Some(axis_log);
        self
    }

    /// What bounds the program's time, where that was asked for.
    #[must_use]
    pub fn bounded_by(mut self, bounds: Option<TimeBounds>) -> Self {
        self.time_bounds = bounds;
        self
    }

    /// Takes what the controller tells, before the row of the same cycle.
    pub fn tell(&mut self, event: &Event) {
        let time = self.seconds(self.next);
        // Of a sample that was never at an axis there is no row.
        let line = self.sample_at(time).unwrap_or(self.line);
        let now = Place { time, line };
        match event {
            Event::Fault(fault) => {
                self.fault.get_or_insert((*fault, now));
            }
            Event::Phase(Phase::Survey) => self.faults.extend(self.fault.take()),
            Event::LateSetpoint { .. } => {
                self.late_setpoint.get_or_insert(now);
            }
            Event::Referenced { axis, .. } | Event::Recalled { axis, .. } => {
                self.axes[*axis].count_anew(true);
                self.drives.count_anew(self.axes[*axis].coordinate);
            }
            Event::Unreferenced {
                axis,
                why: LostReference::CutOff,
            } => self.axes[*axis].forget_reference(),
            Event::Unreferenced { axis, .. } => self.axes[*axis].count_anew(false),
            Event::OutOfSquare {
                axis, stays: true, ..
            } => self.axes[*axis].stand_apart(),
            _ => {}
        }
    }

    /// Takes what went wrong beside the machine: the first is what ends a program that cannot go on.
    pub fn problem(&mut self, error: &dyn fmt::Display) {
        let told = error.to_string();
        let first = told.lines().next().unwrap_or_default();
        self.problem.get_or_insert_with(|| first.to_owned());
    }

    /// Takes what is seen at one SYNC; returns its time, s.
    pub fn observe(&mut self, observed: &Observed) -> f64 {
        let Observed { row, .. } = *observed;
        let (cycle, line) = match (self.samples, row.along) {
            (None, _) => (row.cycle, observed.line),
            (Some(_), Some(cycle)) => {
                let sample = self.sample_at(self.seconds(cycle));
                (cycle, sample.unwrap_or_default())
            }
            (Some(_), None) => return 0.0,
        };
        let observed = &Observed { line, ..*observed };
        let time = self.seconds(cycle);
        self.cycles += 1;
        self.next = cycle + 1;
        self.line = line;
        self.position = observed.actual;
        let counted = counted_speed(&row.plan.velocity);
        let moved = self.travel.cycles.motion;
        self.travel.observe(observed, counted);
        let moved = self.travel.cycles.motion - moved;
        self.operations.observe(row, time, line, moved);
        self.switched.observe(row, time);
        self.drives.correct(Place { time, line }, &row.axes);
        let tool = self.drives.tool(&observed.actual);
        let off_path = (self.deviation).observe(observed, &tool, time, &mut self.violations);
        if self.samples.is_none() {
            (self.circles).observe(observed, &tool, time, &mut self.violations);
        }
        self.places.observe(&Seen {
            at: self.last(),
            off_path: off_path.map(|it| [it.setpoint, it.tool]),
            feed: counted.0,
            reached: row.plan.speed / row.plan.feed,
            lasts: self.seconds(1),
        });
        if let Some(sent) = &mut self.sent {
            sent.go_on_to(row.sync);
        }
        for axis in &mut self.axes {
            let sent = self.sent.as_ref();
            axis.observe(row, sent, time, line, &mut self.violations);
        }
        if let Some(report) = &mut self.report {
            let coordinates = self.axes.iter().map(|axis| axis.coordinate);
            let at = Place { time, line };
            report.push(at, row, counted, off_path, &tool, coordinates);
        }
        if let Some(trace) = &mut self.trace {
            trace.push(time, observed, &tool);
        }
        if let Some(axis_log) = &self.axis_log {
            axis_log.push(time, row);
        }
        time
    }

    /// Takes how the simulated drives are at the SYNC of the last row, by their index; nothing where one
    /// is not simulated.
    pub fn observe_drives(&mut self, drive: impl Fn(usize) -> Option<Observation>) {
        if self.samples.is_some() && self.cycles == 0 {
            return;
        }
        let at = self.last();
        self.drives.observe(at, drive, &mut self.violations);
    }

    /// Takes how the simulated drives are, by their index, once the machine is off and has come to rest: where an axis with a
    /// weight hangs then. `come_to_rest` lets the time pass, and is called where there is such an axis.
    pub fn observe_rest(&mut self, mut come_to_rest: impl FnMut() -> Vec<Option<Observation>>) {
        if self.drives.hang() {
            let drives = come_to_rest();
            self.drives.rest(|drive| *drives.get(drive)?);
        }
    }

    /// The last row.
    fn last(&self) -> Place {
        Place {
            time: self.seconds(self.next.saturating_sub(1)),
            line: self.line,
        }
    }

    /// Takes the gains of the simulated drives, by their index, as they are in the end.
    pub fn observe_gains<'a>(
        &mut self,
        machine: &Machine,
        gains: impl Fn(usize) -> Option<&'a Gains>,
    ) {
        let drives = 0..machine.drives.len();
        let loops = drives.filter_map(|drive| Some(LoopSummary::of(machine, drive, gains(drive)?)));
        self.loops = loops.collect();
    }

    /// How far the program has come, mm and degrees.
    #[must_use]
    pub fn passed(&self) -> f64 {
        self.travel.length_mm + self.travel.turned_deg
    }

    /// The number of the sample at so many seconds, from 1, where what runs is known by samples alone.
    fn sample_at(&self, seconds: f64) -> Option<u32> {
        let step = self.samples?;
        Some(1 + (seconds / step + WHOLE) as u32)
    }

    /// The nearest number of seconds to so many cycles.
    fn seconds(&self, cycles: u64) -> f64 {
        seconds(self.cycle, cycles)
    }

    /// What the time went into.
    fn times(&self) -> Times {
        let cycles = &self.travel.cycles;
        Times {
            motion_s: self.seconds(cycles.motion),
            dwell_s: self.seconds(cycles.dwells),
            waiting_s: self.seconds(cycles.waits),
            jogging_s: self.seconds(cycles.jogs),
            awaiting_s: self.seconds(cycles.awaits),
            planning_s: self.seconds(cycles.planning),
            settling_s: self.seconds(cycles.settling + cycles.settled + cycles.corrections),
            idle_s: self.seconds(cycles.idle),
        }
    }

    /// What must not be, up to the end of a run, and how much of it is left off.
    fn close(
        &mut self,
        layout: &Layout,
        controller: &Controller<COORDINATES>,
    ) -> (Vec<Violation>, u64) {
        for axis in &mut self.axes {
            axis.close(&mut self.violations);
        }
        self.deviation.close(&mut self.violations);
        self.circles.close(&mut self.violations);
        let end = self.last();
        self.drives.close(end, &mut self.violations);
        // Whatever was before, what ended the run is told.
        let (mut violations, mut left_off) = std::mem::take(&mut self.violations).end();
        let (faults, faults_left_off) = std::mem::take(&mut self.faults).end();
        left_off += faults_left_off;
        let mut violate = |what, arisen: Option<Place>, (value, limit, unit)| {
            let Place { time, line } = arisen.unwrap_or(end);
            violations.push(Violation {
                what,
                axis: None,
                time,
                line,
                value,
                limit,
                unit,
            });
        };
        let faults = faults.into_iter().map(|(fault, at)| (fault, Some(at)));
        let last = match controller.end() {
            Some(End::Fault(fault)) => Some((fault, self.fault.map(|(_, at)| at))),
            _ => self.fault.map(|(fault, at)| (fault, Some(at))),
        };
        for (fault, at) in faults.chain(last) {
            let excess = fault.excess(layout).unwrap_or((1.0, 0.0, ""));
            let what = format!("fault: {}", fault.describe(layout));
            violate(what, at, excess);
        }
        let unsent: u64 = self.axes.iter().map(|axis| axis.unsent).sum();
        let late = controller.late_setpoints();
        for (what, count, since, unit) in [
            ("not sent", unsent, None, "setpoints"),
            ("late_setpoints", late, self.late_setpoint, "bursts"),
        ] {
            if count > 0 {
                violate(what.to_owned(), since, (count as f64, 0.0, unit));
            }
        }
        let tolerance = self.tolerance;
        let short = (self.loops.iter()).flat_map(|it| it.short_of(&tolerance));
        violations.extend(short);
        violations.sort_by(|one, other| one.time.total_cmp(&other.time));
        (violations, left_off)
    }

    /// What an outcome says of the faults before it, of which the first.
    fn after_fault(&self, layout: &Layout, end: Option<End>) -> String {
        let last = self.fault.filter(|_| !matches!(end, Some(End::Fault(_))));
        let first = self.faults.first().or(last.as_ref());
        first.map_or_else(String::new, |(fault, _)| {
            format!(", after a fault: {}", fault.describe(layout))
        })
    }

    /// Where a run that did not come to its end stopped.
    fn stopped(&self, machine: &Machine, end: Option<End>) -> Stopped {
        let blamed = match end {
            Some(End::Fault(Fault::Axis(axis, _))) => machine.axes.get(axis),
            Some(End::Fault(Fault::Device(device, _))) => {
                let drive = machine.drives.get(device);
                drive.map(|drive| &machine.axes[drive.axis])
            }
            _ => None,
        };
        let axes = (machine.axes.iter()).zip(self.axes.iter().map(AxisWatches::is_referenced));
        let known = axes.clone().filter(|(_, is_referenced)| *is_referenced);
        let position = known.map(|(axis, _)| (axis.name(), self.position[axis.letter.index()]));
        let unreferenced = axes.filter(|(_, is_referenced)| !is_referenced);
        // What a probing or an input decides is not known before.
        let whole = self.extent.filter(|extent| extent.known_to.is_none());
        let left = whole.map(|extent| {
            let length = extent.length - self.travel.length_mm;
            let turned = extent.turned - self.travel.turned_deg;
            [length, turned].map(|left| left.max(0.0))
        });
        let lags = |cause| {
            use Cause::{DriveError, FollowingError, NotFollowing, Skew};
            matches!(cause, DriveError | NotFollowing | FollowingError | Skew)
        };
        // Along samples the rows go on behind the one that was refused.
        let refused = self.fault.filter(|_| self.samples.is_some());
        let refused = refused.map(|(_, at)| at);
        Stopped {
            line: refused.map_or(self.line, |it| it.line),
            axis: blamed.map(Axis::name),
            may_lag: matches!(end, Some(End::Fault(fault)) if lags(fault.cause())),
            sample_refused: matches!(
                end,
                Some(End::Fault(Fault::Axis(
                    _,
                    AxisCause::SetpointGuard { sampled: true, .. }
                )))
            ),
            position: position.collect(),
            unreferenced: unreferenced.map(|(axis, _)| axis.name()).collect(),
            left_mm: left.map(|[length, _]| length),
            left_deg: left.map_or(0.0, |[_, turned]| turned),
        }
    }

    /// Ends the record: writes what is still to be written and sums up. `frames` are digest and
    /// peak utilisation of simulated buses.
    ///
    /// # Errors
    /// The trace could not be written.
    pub fn finish(
        mut self,
        machine: &Machine,
        layout: &Layout,
        controller: &Controller<COORDINATES>,
        frames: Option<(String, Vec<f64>)>,
    ) -> io::Result<(Summary, Option<Report>)> {
        self.trace.take().map_or(Ok(()), Trace::finish)?;
        let after_fault = self.after_fault(layout, controller.end());
        let (violations, violations_left_off) = self.close(layout, controller);
        let (digest, loads) = frames.unzip();
        let verdict = match controller.end() {
            _ if !violations.is_empty() => "fail",
            Some(End::Finished | End::SwitchedOff) => "pass",
            Some(End::Interrupted) => "interrupted",
            Some(End::Fault(_)) | None => "fail",
        };
        let finished = matches!(controller.end(), Some(End::Finished | End::SwitchedOff));
        let (drives, gantries, structures) = self.drives.summaries();
        let transmissions = self.drives.transmissions();
        let cutting = self.drives.cutting();
        let (circles, circles_left_off) = std::mem::take(&mut self.circles.told).end();
        let cycle = self.cycle;
        let seconds = |cycles| seconds(cycle, cycles);
        let (switched, switched_left_off) = std::mem::take(&mut self.switched).end();
        let (operations, operations_left_off, tools) =
            std::mem::take(&mut self.operations).times(seconds);
        let (worst_places, slowest_places) = std::mem::take(&mut self.places).result();
        let summary = Summary {
            verdict,
            outcome: match (controller.end(), self.problem.take()) {
                (Some(End::Fault(Fault::Program)), Some(problem)) => {
                    format!("stopped: the program could not go on: {problem}")
                }
                (Some(end), _) => end.describe(layout) + &after_fault,
                (None, _) => "not ended".to_owned(),
            },
            stopped: (!finished).then(|| self.stopped(machine, controller.end())),
            duration_s: (self.travel.motion)
                .map_or(0.0, |(first, last)| self.seconds(last - first)),
            times: self.times(),
            time_bounds: self.time_bounds.take(),
            cause: None,
            seed: None,
            provenance: None,
            cycles: self.cycles,
            late_setpoints: controller.late_setpoints(),
            frames_sha256: digest,
            path: self.deviation.path(&self.travel, &self.circles),
            bus: (machine.buses.iter().zip(loads.unwrap_or_default()))
                .map(|(bus, peak_utilisation)| BusSummary {
                    name: bus.name.clone(),
                    peak_utilisation,
                })
                .collect(),
            axes: self.axes.iter().map(AxisSummary::new).collect(),
            drives,
            gantries,
            structures,
            transmissions,
            circles,
            circles_left_off,
            cutting,
            loops: std::mem::take(&mut self.loops),
            operations,
            operations_left_off,
            tools,
            worst_places,
            slowest_places,
            switched,
            switched_left_off,
            violations,
            violations_left_off,
        };
        if let Some(report) = &mut self.report {
            report.conclude(&summary);
        }
        Ok((summary, self.report))
    }
}

/// The nearest number of seconds to so many cycles.
fn seconds(cycle: Duration, cycles: u64) -> f64 {
    (u128::from(cycles) * cycle.as_nanos()) as f64 / 1e9
}
