//! The flight recorder: the last seconds of a machine, in memory, and in files after a fault.
//!
//! Who asks why a machine stopped needs what was before: where the axes should have been and were, what was
//! switched, what the buses carried. A log of the whole day is too long to be kept, so the memory for the last
//! seconds is made at start-up and written over again and again. From the first fault on only half of it is: so what
//! led to the fault stays, and how the machine came to rest is there too. Once it rests, a thread of its own
//! writes three files, and the recorder begins anew.
//!
//! ```text
//!  cycle ──frames──► queue ────► session ──► FlightRecorder ──Recording──► thread ──► fault-1.csv
//!        ──rows────► reports ──┘                                                     fault-1.candump, .pcapng
//! ```
//!
//! The cycle only pushes copies of its frames into a bounded queue. Neither it nor the session waits for a disk.

use super::trace;
use crate::bus_log::{BusLog, LogFile};
use crate::control::{Event, Layout, MachineFunctions, MeasuredSample, Row, SpindleSample, State};
use crate::machine::{COORDINATES, MEASURED, Machine, Position};
use std::collections::VecDeque;
use std::fmt::{self, Write as _};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};
use syncline_canopen::{Frame, Instant};
use syncline_gcode::ANALOG_INPUTS;

/// Bits of the shortest frame with the pause behind it: a bus carries no more frames than that allows.
const SHORTEST_FRAME: f64 = 47.0;
/// So many faults are kept in files; then the oldest one's are written over.
pub const KEPT_FAULTS: u32 = 20;

/// A frame as the controller had it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carried {
    /// The bus, by its place in the machine file.
    pub bus: usize,
    /// When it was received, or handed to the bus.
    pub at: Instant,
    /// The frame.
    pub frame: Frame,
}

/// What was at one SYNC of the program.
#[derive(Clone, Copy, Debug)]
struct Moment {
    state: State,
    line: u32,
    setpoint: Position,
    actual: Position,
    functions: MachineFunctions,
    spindle: Option<SpindleSample>,
    measured: [Option<MeasuredSample>; MEASURED],
    /// Bit by bit, by the place in the machine file.
    inputs: u64,
    analog_inputs: [f64; ANALOG_INPUTS],
}

/// The last items, in memory that is made once.
#[derive(Clone, Debug)]
struct LastSeconds<T> {
    items: VecDeque<(Instant, T)>,
    room: usize,
    kept: Duration,
    /// What is later is not kept any more.
    until: Option<Instant>,
}

impl<T> LastSeconds<T> {
    fn new(kept: Duration, room: usize) -> Self {
        Self {
            items: VecDeque::with_capacity(room),
            room,
            kept,
            until: None,
        }
    }

    /// Takes what was at an instant, and forgets what is longer ago than what is kept.
    fn push(&mut self, at: Instant, item: T) {
        if self.until.is_some_and(|until| at > until) {
            return;
        }
        while let Some((first, _)) = self.items.front()
            && (self.items.len() == self.room || *first + self.kept < at)
        {
            self.items.pop_front();
        }
        if self.items.len() < self.room {
            self.items.push_back((at, item));
        }
    }

    /// From now on it takes only so much that half of what was before stays.
    fn spare_half(&mut self) {
        if let Some((last, _)) = self.items.back() {
            self.until.get_or_insert(*last + self.kept / 2);
        }
    }
}

impl<T: Clone> LastSeconds<T> {
    /// A copy of what is kept; from now on it is written over again.
    fn copy(&mut self) -> Vec<(Instant, T)> {
        self.until = None;
        self.items.iter().cloned().collect()
    }
}

/// What a machine is called in its recordings.
#[derive(Clone, Debug)]
struct Legend {
    buses: Vec<String>,
    inputs: Vec<String>,
    analog_inputs: Vec<String>,
    axes: Vec<(&'static str, usize)>,
    /// A drive turns the spindle.
    has_spindle: bool,
    /// How many encoders are on shafts of their own, and the names of their columns.
    measured: (usize, String),
}

/// See the module.
pub struct FlightRecorder {
    layout: Arc<Layout>,
    legend: Arc<Legend>,
    /// Where the files go.
    folder: PathBuf,
    /// Instant zero, since 1970.
    origin: Duration,
    moments: LastSeconds<Moment>,
    frames: LastSeconds<(usize, Frame)>,
    inputs: u64,
    /// Axes were followed since the last recording.
    followed: bool,
    /// How the last recording began: its first fault.
    recorded: Option<String>,
    /// What stopped the machine and is not written yet, the first cause first.
    faults: Vec<String>,
    writing: Option<JoinHandle<io::Result<PathBuf>>>,
}

/// What is to be written.
struct Recording {
    legend: Arc<Legend>,
    origin: Duration,
    faults: Vec<String>,
    moments: Vec<(Instant, Moment)>,
    frames: Vec<(Instant, (usize, Frame))>,
}

/// The files of a fault, that are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultFiles(PathBuf);

impl FaultFiles {
    /// The table; the bus logs are beside it, with the same name.
    #[must_use]
    pub fn csv(&self) -> &Path {
        &self.0
    }
}

impl fmt::Display for FaultFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.0.display();
        write!(
            f,
            "what was before the fault is in {file}, with the frames beside it"
        )
    }
}

/// The files of a fault cannot be written.
#[derive(Debug, thiserror::Error)]
#[error(
    "the flight recorder cannot write into {}; make room there, or switch it off by `flight_recorder_s = 0`",
    folder.display()
)]
pub struct NotRecorded {
    folder: PathBuf,
    source: io::Error,
}

impl FlightRecorder {
    /// For a machine whose instant zero is `origin` past 1970; its files go into `folder`. `None` if the
    /// machine file wants none.
    #[must_use]
    pub fn new(
        machine: &Machine,
        layout: &Arc<Layout>,
        folder: PathBuf,
        origin: Duration,
    ) -> Option<Self> {
        let kept = machine.controller.flight_recorder;
        if kept.is_zero() {
            return None;
        }
        let moments = kept.as_nanos().div_ceil(machine.cycle.as_nanos()) as usize;
        let bits: f64 = machine.buses.iter().map(|bus| f64::from(bus.bitrate)).sum();
        let frames = (kept.as_secs_f64() * bits / SHORTEST_FRAME) as usize;
        let names = |names: &mut dyn Iterator<Item = &String>| names.cloned().collect();
        Some(Self {
            layout: Arc::clone(layout),
            legend: Arc::new(Legend {
                buses: names(&mut machine.buses.iter().map(|bus| &bus.name)),
                inputs: names(&mut machine.inputs.iter().map(|input| &input.name)),
                analog_inputs: names(&mut machine.analog_inputs.iter().map(|input| &input.name)),
                axes: (machine.axes.iter())
                    .map(|axis| (axis.name(), axis.letter.index()))
                    .collect(),
                has_spindle: machine.spindle_drive().is_some(),
                measured: (machine.measured().count(), trace::measured_columns(machine)),
            }),
            folder,
            origin,
            moments: LastSeconds::new(kept, moments + 1),
            frames: LastSeconds::new(kept, frames),
            inputs: 0,
            followed: false,
            recorded: None,
            faults: Vec::new(),
            writing: None,
        })
    }

    /// The folder for the files of a machine's faults: beside its file, with the same name.
    #[must_use]
    pub fn folder(machine: &Path) -> PathBuf {
        machine.with_extension("faults")
    }

    /// Takes a frame.
    pub fn carry(&mut self, Carried { bus, at, frame }: Carried) {
        self.frames.push(at, (bus, frame));
    }

    /// Takes what the controller tells.
    pub fn tell(&mut self, event: &Event) {
        match event {
            Event::Fault(fault) => {
                self.faults.push(fault.describe(&*self.layout));
                self.moments.spare_half();
                self.frames.spare_half();
            }
            Event::Input { input, on } if *input < u64::BITS as usize => {
                let bit = 1 << input;
                self.inputs = self.inputs & !bit | if *on { bit } else { 0 };
            }
            _ => {}
        }
    }

    /// Takes what was at a SYNC of the program.
    pub fn observe(&mut self, row: &Row<COORDINATES>, state: State, line: u32) {
        let moment = Moment {
            state,
            line,
            setpoint: row.axes.map(|axis| axis.set),
            actual: row.axes.map(|axis| axis.act),
            functions: row.put_out,
            spindle: row.spindle,
            measured: row.measured,
            inputs: self.inputs,
            analog_inputs: row.analog_inputs,
        };
        self.followed = true;
        self.moments.push(row.at, moment);
    }

    /// The machine rests: has what led to its fault written, if there was one. Where that begins as the last recording did and no axis was
    /// followed since, as behind a reset in vain, nothing is written: older recordings, which say more, would go for it.
    pub fn write(&mut self) -> Option<Result<FaultFiles, NotRecorded>> {
        if self.faults.is_empty() || self.writing.is_some() {
            return None;
        }
        let first = self.faults.first().cloned();
        if !take(&mut self.followed) && self.recorded == first {
            self.faults.clear();
            self.moments.until = None;
            self.frames.until = None;
            return None;
        }
        self.recorded = first;
        let recording = Recording {
            legend: Arc::clone(&self.legend),
            origin: self.origin,
            faults: take(&mut self.faults),
            moments: self.moments.copy(),
            frames: self.frames.copy(),
        };
        let folder = self.folder.clone();
        let thread = thread::Builder::new().name("flight recorder".into());
        match thread.spawn(move || recording.write(&folder)) {
            Ok(writing) => {
                self.writing = Some(writing);
                None
            }
            Err(source) => Some(Err(self.not_recorded(source))),
        }
    }

    /// What came of the files, once it is known; at the `end` it is waited for.
    pub fn written(&mut self, end: bool) -> Option<Result<FaultFiles, NotRecorded>> {
        let is_over = |writing: &mut JoinHandle<_>| end || writing.is_finished();
        let writing = self.writing.take_if(is_over)?;
        let written = writing.join().unwrap_or_else(|_| {
            Err(io::Error::other(
                "it panicked: this is a defect of syncline",
            ))
        });
        Some(
            written
                .map(FaultFiles)
                .map_err(|source| self.not_recorded(source)),
        )
    }

    fn not_recorded(&self, source: io::Error) -> NotRecorded {
        let folder = self.folder.clone();
        NotRecorded { folder, source }
    }
}

impl Recording {
    /// Writes all files; the table first, which has the cause. Its path.
    fn write(mut self, folder: &Path) -> io::Result<PathBuf> {
        fs::create_dir_all(folder)?;
        let file = next_file(folder)?;
        let mut table = BufWriter::new(File::create(&file)?);
        self.write_table(&mut table)?;
        table.flush()?;
        let begin = |extension: &str| -> io::Result<LogFile> {
            let file = File::create(file.with_extension(extension))?;
            Ok(Box::new(BufWriter::new(file)))
        };
        let buses = self.legend.buses.clone();
        let mut log = BusLog::begin(buses, Some(begin("candump")?), Some(begin("pcapng")?))?;
        // What is received is stamped before what was sent meanwhile.
        self.frames.sort_by_key(|(at, _)| *at);
        for (at, (bus, frame)) in &self.frames {
            log.keep(*bus, self.since_1970(*at), frame)?;
        }
        log.finish()?;
        Ok(file)
    }

    fn since_1970(&self, at: Instant) -> Duration {
        self.origin + Duration::from_nanos(at.as_nanos())
    }

    /// Causes first, then a line for each SYNC of the program.
    fn write_table(&self, file: &mut impl Write) -> io::Result<()> {
        for (fault, role) in self
            .faults
            .iter()
            .zip(["cause"].iter().chain(std::iter::repeat(&"then")))
        {
            writeln!(file, "# {role}: {fault}")?;
        }
        let Legend {
            inputs,
            analog_inputs,
            axes,
            has_spindle,
            measured: (measured, measured_columns),
            ..
        } = &*self.legend;
        let mut row = "t_s,state,line".to_owned();
        for (name, _) in axes {
            // Writing to a string does not fail.
            let _ = write!(row, ",{name}_set,{name}_act");
        }
        row += &trace::switched_columns();
        if *has_spindle {
            row += trace::SPINDLE_COLUMNS;
        }
        row += measured_columns;
        for name in inputs.iter().chain(analog_inputs) {
            let _ = write!(row, ",input_{name}");
        }
        writeln!(file, "{row}")?;
        for (at, moment) in &self.moments {
            let at = self.since_1970(*at);
            row.clear();
            let _ = write!(row, "{}.{:06},", at.as_secs(), at.subsec_micros());
            let _ = write!(row, "{},{}", moment.state, moment.line);
            for &(_, axis) in axes {
                let _ = write!(row, ",{},{}", moment.setpoint[axis], moment.actual[axis]);
            }
            trace::write_switched(&mut row, &moment.functions);
            if *has_spindle {
                trace::write_spindle(&mut row, moment.spindle);
            }
            trace::write_measured(&mut row, &moment.measured[..*measured]);
            for input in 0..inputs.len() {
                let on = moment.inputs.checked_shr(input as u32).unwrap_or_default() & 1;
                let _ = write!(row, ",{on}");
            }
            for value in &moment.analog_inputs[..analog_inputs.len()] {
                let _ = write!(row, ",{value}");
            }
            writeln!(file, "{row}")?;
        }
        Ok(())
    }
}

/// The table's file of the next fault: one that is not there yet, or the oldest one.
fn next_file(folder: &Path) -> io::Result<PathBuf> {
    let mut oldest: Option<(SystemTime, PathBuf)> = None;
    for number in 1..=KEPT_FAULTS {
        let file = folder.join(format!("fault-{number}.csv"));
        let Ok(found) = fs::symlink_metadata(&file) else {
            return Ok(file);
        };
        let written = found.modified()?;
        if oldest.as_ref().is_none_or(|(before, _)| written < *before) {
            oldest = Some((written, file));
        }
    }
    Ok(oldest.map_or_else(|| folder.join("fault-1.csv"), |(_, file)| file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever comes, there is never more than room and time allow, and the memory is the same; of what
        /// was before a fault, half stays.
        #[test]
        fn what_is_kept_is_bounded(
            kept in 1u64..1000,
            room in 1usize..50,
            steps in proptest::collection::vec((0u64..100, prop::bool::weighted(0.05)), 1..300),
        ) {
            let ms = Duration::from_millis;
            let mut last = LastSeconds::new(ms(kept), room);
            let memory = last.items.capacity();
            let (mut now, mut fault) = (Instant::ZERO, None);
            let mut all = Vec::new();
            for (step, fails) in steps {
                now += ms(step);
                last.push(now, ());
                if fault.is_none_or(|fault| now <= fault + ms(kept) / 2) {
                    all.push(now);
                }
                if fails {
                    last.spare_half();
                    fault.get_or_insert(now);
                }
                prop_assert!(last.items.len() <= room);
                prop_assert_eq!(last.items.capacity(), memory);
                let newest = all[all.len() - 1];
                let wanted = all.iter().filter(|at| **at + ms(kept) >= newest).rev().take(room);
                let found = last.items.iter().map(|(at, ())| at).rev();
                prop_assert!(found.eq(wanted));
            }
        }
    }

    #[test]
    fn the_oldest_files_are_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        for number in 1..=KEPT_FAULTS {
            let file = next_file(folder).unwrap();
            assert_eq!(file, folder.join(format!("fault-{number}.csv")));
            let written = File::create(&file).unwrap();
            let age = Duration::from_secs(if number == 7 { 3600 } else { u64::from(number) });
            written.set_modified(SystemTime::now() - age).unwrap();
        }
        assert_eq!(next_file(folder).unwrap(), folder.join("fault-7.csv"));
    }
}
