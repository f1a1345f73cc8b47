//! What only watches: a run is the same with it and without it.
//!
//! - [`Observers`]: all that is kept about a run, row by row
//! - [`limits`]: every axis against its limits, as planned and as sent
//! - [`sent`]: what the drives were sent, from the frames on the buses
//! - [`differences`]: what positions at the SYNCs say of the motion between them
//! - [`deviation`]: setpoint and tool against the programmed geometry
//! - [`travel`]: how far the tool has come along the program, and for how long it moved
//! - [`trace`]: every row as CSV
//! - [`record`]: every row for a report, and what must not be
//! - [`summary`]: the result
//! - [`frames`]: what the simulated buses carried: hash, utilisation
//! - [`timing`]: how punctual a cycle was

pub mod deviation;
mod differences;
pub mod frames;
pub mod limits;
pub mod record;
pub mod sent;
pub mod summary;
pub mod timing;
pub mod trace;
pub mod travel;

use crate::control::layout::Layout;
use crate::control::{Controller, End, Row};
use crate::machine::{COORDINATES, Machine, Position};
use crate::program::{Moves, counted_speed};
use deviation::Deviation;
use limits::AxisWatches;
use record::{Report, Violation};
use sent::SentSetpoints;
use std::io;
use std::ops::RangeInclusive;
use std::time::Duration;
use summary::{AxisSummary, BusSummary, Summary};
use trace::{Sink, Trace};
use travel::Travel;

/// What is there to be seen at one SYNC of the program.
#[derive(Clone, Copy)]
pub struct Observed<'a> {
    /// Plan and axes.
    pub row: &'a Row<COORDINATES>,
    /// Where the axes are, mm and degrees; coordinates without an axis as planned.
    pub actual: Position,
    /// The program's line.
    pub line: u32,
    /// The program's moves about here.
    pub moves: &'a Moves,
    /// The tags of the moves that setpoint and tool may be on; `None` while the axes are off the
    /// path.
    pub tags: Option<&'a RangeInclusive<u32>>,
}

/// All that is kept about a run.
pub struct Observers {
    cycle: Duration,
    cycles: u64,
    line: u32,
    travel: Travel,
    deviation: Deviation,
    axes: Vec<AxisWatches>,
    /// What the buses carried, where all of them can be heard.
    sent: Option<SentSetpoints>,
    violations: Vec<Violation>,
    trace: Option<Trace>,
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
            line: 0,
            travel: Travel::default(),
            deviation: Deviation::default(),
            axes: (machine.axes.iter())
                .map(|axis| AxisWatches::new(machine, axis))
                .collect(),
            sent,
            violations: Vec::new(),
            trace: trace.map(|file| Trace::begin(file, machine)),
            report: report.then(|| Report::of(machine)),
        }
    }

    /// Takes what is seen at one SYNC; returns its time, s.
    pub fn observe(&mut self, observed: &Observed) -> f64 {
        let Observed { row, line, .. } = *observed;
        let time = self.seconds(row.cycle);
        self.cycles += 1;
        self.line = line;
        let counted = counted_speed(&row.plan.velocity);
        self.travel.observe(row, counted);
        self.deviation.observe(observed, time, &mut self.violations);
        if let Some(sent) = &mut self.sent {
            sent.go_on_to(row.sync);
        }
        for axis in &mut self.axes {
            let sent = self.sent.as_ref();
            axis.observe(row, sent, time, line, &mut self.violations);
        }
        if let Some(report) = &mut self.report {
            let coordinates = self.axes.iter().map(|axis| axis.coordinate);
            report.push(time, line, row, counted, coordinates);
        }
        if let Some(trace) = &mut self.trace {
            trace.push(time, observed);
        }
        time
    }

    /// How far the program has come, mm and degrees.
    #[must_use]
    pub fn passed(&self) -> f64 {
        self.travel.length_mm + self.travel.turned_deg
    }

    /// The nearest number of seconds to so many cycles.
    fn seconds(&self, cycles: u64) -> f64 {
        (u128::from(cycles) * self.cycle.as_nanos()) as f64 / 1e9
    }

    /// What must not be at the end of a run.
    fn close(&mut self, layout: &Layout, controller: &Controller<COORDINATES>) {
        for axis in &mut self.axes {
            axis.close(&mut self.violations);
        }
        self.deviation.close(&mut self.violations);
        let time = self.seconds(self.cycles.saturating_sub(1));
        let mut violate = |what: String, value: f64, unit| {
            self.violations.push(Violation {
                what,
                axis: None,
                time,
                line: self.line,
                value,
                limit: 0.0,
                unit,
            });
        };
        if let Some(End::Fault(fault)) = controller.end() {
            violate(format!("fault: {}", fault.describe(layout)), 1.0, "");
        }
        let unsent: u64 = self.axes.iter().map(|axis| axis.unsent).sum();
        if unsent > 0 {
            violate("not sent".to_owned(), unsent as f64, "setpoints");
        }
        let late_setpoints = controller.late_setpoints();
        if late_setpoints > 0 {
            let late_setpoints = late_setpoints as f64;
            violate("late_setpoints".to_owned(), late_setpoints, "bursts");
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
        self.close(layout, controller);
        let passed = self.violations.is_empty() && controller.end() == Some(End::Finished);
        let (digest, loads) = frames.unzip();
        let summary = Summary {
            verdict: if passed { "pass" } else { "fail" },
            outcome: (controller.end())
                .map_or_else(|| "not ended".to_owned(), |end| end.describe(layout)),
            duration_s: (self.travel.motion)
                .map_or(0.0, |(first, last)| self.seconds(last - first)),
            cycles: self.cycles,
            late_setpoints: controller.late_setpoints(),
            frames_sha256: digest,
            path: self.deviation.path(&self.travel),
            bus: (machine.buses.iter().zip(loads.unwrap_or_default()))
                .map(|(bus, peak_utilisation)| BusSummary {
                    name: bus.name.clone(),
                    peak_utilisation,
                })
                .collect(),
            axes: (self.axes.iter())
                .map(|axis| {
                    let same =
                        |it: &crate::control::layout::AxisSpec| it.coordinate == axis.coordinate;
                    let place = layout.axes.iter().position(same);
                    let following = place.map(|place| controller.following(place));
                    AxisSummary::new(axis, &following.unwrap_or_default())
                })
                .collect(),
            violations: self.violations,
        };
        if let Some(report) = &mut self.report {
            report.conclude(&summary);
        }
        Ok((summary, self.report))
    }
}
