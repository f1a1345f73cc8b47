//! Every row as CSV: time, line, setpoint and actual position of every axis, what is switched.

use super::Observed;
use super::switched::running;
use crate::control::spindle::turning;
use crate::control::{MachineFunctions, MeasuredSample, SpindleSample};
use crate::machine::{Machine, Position};
use std::fmt::Write as _;
use std::io::{self, Write};
use syncline_gcode::{ANALOG_OUTPUTS, Outputs};

/// What takes a trace, each row in one call.
pub type Sink = Box<dyn Write + Send>;

/// A trace that is being written.
pub(super) struct Trace {
    file: Sink,
    /// Of the axes, in the machine's order.
    coordinates: Vec<usize>,
    /// A drive turns the spindle.
    has_spindle: bool,
    /// So many analog inputs.
    analog_inputs: usize,
    /// How many encoders are on shafts of their own.
    measured: usize,
    /// The axes whose sides are coupled.
    coupled: Vec<usize>,
    /// Each row has where the tool is, too.
    tells_tool: bool,
    row: String,
    /// What stands above the rows, until it is written.
    header: Option<String>,
    /// Nothing is written behind the first failure.
    written: io::Result<()>,
}

impl Trace {
    /// A trace with its header.
    pub(super) fn begin(file: Sink, machine: &Machine) -> Self {
        let mut header = "t_s,line".to_owned();
        for axis in &machine.axes {
            // Writing to a string does not fail.
            let _ = write!(header, ",{0}_set,{0}_act", axis.name());
        }
        header += &switched_columns();
        let has_spindle = machine.spindle_drive().is_some();
        if has_spindle {
            header += SPINDLE_COLUMNS;
        }
        for input in &machine.analog_inputs {
            let _ = write!(header, ",analog_input_{}", input.number);
        }
        header += &measured_columns(machine);
        let coupled = machine.axes.iter();
        let coupled: Vec<_> = coupled.filter(|it| it.cross_coupling.is_some()).collect();
        for axis in &coupled {
            let _ = write!(header, ",{}_coupling", axis.name());
        }
        Self {
            written: Ok(()),
            file,
            coordinates: (machine.axes.iter())
                .map(|axis| axis.letter.index())
                .collect(),
            has_spindle,
            analog_inputs: machine.analog_inputs.len(),
            measured: machine.measured().count(),
            coupled: coupled.iter().map(|it| it.letter.index()).collect(),
            tells_tool: false,
            row: String::new(),
            header: Some(header),
        }
    }

    /// Each row has where the tool is along each axis, too.
    pub(super) fn tell_tool(&mut self, machine: &Machine) {
        self.tells_tool = true;
        if let Some(header) = &mut self.header {
            for axis in &machine.axes {
                let _ = write!(header, ",{}_tool", axis.name());
            }
        }
    }

    /// Appends a row.
    pub(super) fn push(&mut self, time: f64, observed: &Observed, tool: &Position) {
        self.write_header();
        let text = &mut self.row;
        text.clear();
        let _ = write!(text, "{time},{}", observed.line);
        for &coordinate in &self.coordinates {
            let sample = &observed.row.axes[coordinate];
            let _ = write!(text, ",{},{}", sample.set, sample.act);
        }
        write_switched(text, &observed.row.put_out);
        if self.has_spindle {
            write_spindle(text, observed.row.spindle);
        }
        for value in &observed.row.analog_inputs[..self.analog_inputs] {
            let _ = write!(text, ",{value}");
        }
        write_measured(text, &observed.row.measured[..self.measured]);
        for &coordinate in &self.coupled {
            let _ = write!(text, ",{}", observed.row.axes[coordinate].coupled);
        }
        if self.tells_tool {
            for &coordinate in &self.coordinates {
                let _ = write!(text, ",{}", tool[coordinate]);
            }
        }
        text.push('\n');
        if self.written.is_ok() {
            self.written = self.file.write_all(text.as_bytes());
        }
    }

    /// Writes what stands above the first row, once.
    fn write_header(&mut self) {
        if let Some(header) = self.header.take() {
            self.written = writeln!(self.file, "{header}");
        }
    }

    /// Writes what is still to be written.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.write_header();
        self.written?;
        self.file.flush()
    }
}

/// The names of the columns of [`write_switched`], each behind a comma.
pub(super) fn switched_columns() -> String {
    let mut columns = ",spindle,coolant,tool,digital_outputs".to_owned();
    for number in 0..ANALOG_OUTPUTS {
        let _ = write!(columns, ",analog_output_{number}");
    }
    columns
}

/// The names of the columns of [`write_spindle`], each behind a comma.
pub(super) const SPINDLE_COLUMNS: &str = ",spindle_act,spindle_turns";

/// Appends what the drive of a spindle measured, each value behind a comma.
pub(super) fn write_spindle(text: &mut String, sample: Option<SpindleSample>) {
    let SpindleSample { speed, turns, .. } = sample.unwrap_or_default();
    let _ = write!(text, ",{speed},{turns}");
}

/// The names of the columns of [`write_measured`], each behind a comma.
pub(super) fn measured_columns(machine: &Machine) -> String {
    let names = machine
        .measured()
        .map(|(_, encoder)| format!(",{}_act", encoder.name));
    names.collect()
}

/// Appends where encoders on shafts of their own are, each value behind a comma; none before it is known.
pub(super) fn write_measured(text: &mut String, samples: &[Option<MeasuredSample>]) {
    for sample in samples {
        text.push(',');
        if let Some(MeasuredSample { position, .. }) = sample {
            let _ = write!(text, "{position}");
        }
    }
}

/// Appends what programs have switched, each value behind a comma.
pub(super) fn write_switched(text: &mut String, functions: &MachineFunctions) {
    let MachineFunctions {
        spindle,
        coolant,
        tool,
        outputs: Outputs { digital, analog },
        ..
    } = functions;
    let (spindle, coolant) = (turning(*spindle), running(*coolant));
    let _ = write!(text, ",{spindle},{coolant},{tool},{digital}");
    for value in analog {
        let _ = write!(text, ",{value}");
    }
}
