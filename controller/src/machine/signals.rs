//! `[[input]]` and `[[output]]`: the machine's inputs and outputs by name, each a digital signal of a
//! drive.

use super::Drive;
use super::read::{name, unique, unknown};
use std::ops::Range;
use std::time::Duration;
use syncline_gcode::{DIGITAL_INPUTS, DIGITAL_OUTPUTS};
use syncline_strict_toml::{Log, Table, nearest, one_of};
use toml::Spanned;

/// A digital input of a drive, and what it means to the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// As the machine file names it.
    pub name: String,
    /// Index of its drive in [`Machine::drives`](super::Machine::drives).
    pub drive: usize,
    /// Which of the drive's signals.
    pub signal: usize,
    /// It is on where the drive's input is off.
    pub active_low: bool,
    /// For so long it has another level before that counts.
    pub debounce: Duration,
    /// What it means.
    pub meaning: InputMeaning,
    /// Where along the drive's axis it is on when the drive is simulated, mm; `None`: nowhere.
    pub simulated: Option<(f64, f64)>,
}

/// What an input means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputMeaning {
    /// M66 waits for it by this P.
    Program(u8),
    /// The drives may be enabled while it is on; without it the machine stops.
    Enable,
    /// Rests on the path when it comes on.
    FeedHold,
    /// Goes on when it comes on.
    CycleStart,
    /// A door is open while it is on: the path rests, and does not go on.
    Door,
    /// The spindle has its speed while it is on.
    AtSpeed,
    /// It is on about the place of an axis that is homed by it.
    Home,
}

/// A digital output of a drive, and what the machine uses it for.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// As the machine file names it.
    pub name: String,
    /// Index of its drive in [`Machine::drives`](super::Machine::drives).
    pub drive: usize,
    /// Which of the drive's outputs.
    pub signal: usize,
    /// It is on where the drive's output is off.
    pub active_low: bool,
    /// Whether it is on while no program runs, and from a stop on.
    pub safe: bool,
    /// What switches it while a program runs.
    pub switch: OutputSwitch,
}

/// What switches an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputSwitch {
    /// M62 to M65 with this P.
    Program(u8),
    /// M3, M4, M5: whether the spindle turns.
    Spindle,
    /// M4: whether it turns counterclockwise.
    SpindleReverse,
    /// M7
    Mist,
    /// M8
    Flood,
}

/// What inputs mean besides their numbers, by their names in the file.
const MEANINGS: [(&str, InputMeaning); 6] = [
    ("enable", InputMeaning::Enable),
    ("feed_hold", InputMeaning::FeedHold),
    ("cycle_start", InputMeaning::CycleStart),
    ("door", InputMeaning::Door),
    ("at_speed", InputMeaning::AtSpeed),
    ("home", InputMeaning::Home),
];

/// What switches outputs besides their numbers.
const SWITCHES: [(&str, OutputSwitch); 4] = [
    ("spindle", OutputSwitch::Spindle),
    ("spindle_reverse", OutputSwitch::SpindleReverse),
    ("mist", OutputSwitch::Mist),
    ("flood", OutputSwitch::Flood),
];

/// Greatest time that an input is debounced for, ms.
const MOST_DEBOUNCE: i64 = 1000;

/// A signal of a drive by its name.
struct Wire {
    title: String,
    name: Spanned<String>,
    drive: Spanned<String>,
    signal: Spanned<String>,
    active_low: bool,
}

impl Wire {
    /// The keys that inputs and outputs share; `allowed` is a signal of theirs.
    fn read(log: &mut Log<'_>, table: &mut Table<'_, '_>, allowed: &str) -> Option<Self> {
        let name = name(log, table);
        let drive = table.text(log, "drive", "the `name` of a [[drive]]", |_| true);
        let signal = table.text(log, "signal", allowed, |_| true);
        let active_low = table.flag_or(log, "active_low", false);
        Some(Self {
            title: table.title.clone(),
            name: name?,
            drive: drive?,
            signal: signal?,
            active_low,
        })
    }

    /// Index of the drive, and the place of the signal among those that its model has.
    fn resolve(
        &self,
        log: &mut Log<'_>,
        drives: &[Drive],
        signals: fn(&Drive) -> &'static [&'static str],
    ) -> Option<(usize, usize)> {
        let names = drives.iter().map(|drive| drive.name.as_str());
        let Some(index) = names.clone().position(|name| name == self.drive.get_ref()) else {
            unknown(log, &self.title, "drive", &self.drive, names);
            return None;
        };
        let drive = &drives[index];
        let known = signals(drive).iter().copied();
        let place = known.clone().position(|name| name == self.signal.get_ref());
        if place.is_none() {
            let nearest = nearest(self.signal.get_ref(), known.clone());
            let problem = format!(
                "{}: drive \"{}\" ({}) has no such signal \"{}\"",
                self.title,
                drive.name,
                drive.model.title,
                self.signal.get_ref()
            );
            let help = match nearest {
                Some(nearest) => format!("allowed: {}; nearest: \"{nearest}\"", one_of(known)),
                None => "allowed: a drive that has such signals".to_owned(),
            };
            log.report(self.signal.span(), problem, help);
        }
        Some((index, place?))
    }
}

/// What a table says that a signal is for: by `number`, or as one of `meanings`.
fn purpose<T: Copy>(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    numbers: (usize, fn(u8) -> T, &str),
    meanings: &[(&'static str, T)],
) -> Option<T> {
    let (count, numbered, codes) = numbers;
    let unit = format!(", P of {codes}");
    let number = table.integer_if(log, "number", 0..=count as i64 - 1, &unit);
    let names = meanings.iter().map(|(name, _)| *name);
    let given = table.span_of("function");
    let function = table.choice_or(log, "function", "", names.clone());
    let by_function = meanings.iter().find(|(name, _)| *name == function);
    let title = table.title.clone();
    let refuse = |log: &mut Log<'_>, span: Range<usize>, problem: &str| {
        let help = format!(
            "allowed: `number`, P of {codes}, or `function`: {}",
            one_of(names)
        );
        log.report(span, format!("{title}: {problem}"), help);
        None
    };
    match (number, given) {
        (Some(number), None) => Some(numbered(*number.get_ref() as u8)),
        (None, Some(_)) => by_function.map(|(_, meaning)| *meaning),
        (Some(_), Some(span)) => {
            refuse(log, span, "both `number` and `function` say what it is for")
        }
        (None, None) if table.span_of("number").is_some() => None,
        (None, None) => {
            let span = table.span_of("name").unwrap_or_default();
            refuse(log, span, "nothing says what it is for")
        }
    }
}

/// An input as the file has it.
struct InputTable {
    wire: Wire,
    debounce: Duration,
    meaning: InputMeaning,
    simulated: Option<(f64, f64)>,
}

impl InputTable {
    fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let wire = Wire::read(log, &mut table, "an input of the drive: \"DI0\"");
        let numbers = (DIGITAL_INPUTS, InputMeaning::Program as fn(u8) -> _, "M66");
        let meaning = purpose(log, &mut table, numbers, &MEANINGS);
        let debounce = table.integer_or(log, "debounce_ms", 0, 0..=MOST_DEBOUNCE, " (ms)");
        if let (Some(InputMeaning::Home), true) = (meaning, debounce > 0) {
            log.report(
                table.span_of("debounce_ms").unwrap_or_default(),
                format!("{}: `debounce_ms` of a home switch", table.title),
                "leave it out: each cycle's level counts, so that the place of the edge is known",
            );
        }
        let allowed = "[from, to] machine position of the drive's axis, the first below the second";
        let simulated = table.interval_if(log, "simulated", allowed);
        table.finish(log);
        Some(Self {
            wire: wire?,
            debounce: Duration::from_millis(debounce as u64),
            meaning: meaning?,
            simulated: simulated.map(Spanned::into_inner),
        })
    }
}

/// An output as the file has it.
struct OutputTable {
    wire: Wire,
    safe: bool,
    switch: OutputSwitch,
}

impl OutputTable {
    fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let wire = Wire::read(log, &mut table, "an output of the drive: \"DQ0\"");
        let numbers = (
            DIGITAL_OUTPUTS,
            OutputSwitch::Program as fn(u8) -> _,
            "M62 to M65",
        );
        let switch = purpose(log, &mut table, numbers, &SWITCHES);
        let safe = table.choice_or(log, "safe", "off", ["off", "on"].into_iter());
        table.finish(log);
        Some(Self {
            wire: wire?,
            safe: safe == "on",
            switch: switch?,
        })
    }
}

/// All inputs and outputs as the file has them.
pub(super) struct SignalTables {
    inputs: Vec<InputTable>,
    outputs: Vec<OutputTable>,
}

impl SignalTables {
    pub(super) fn read(log: &mut Log<'_>, file: &mut Table<'_, '_>) -> Option<Self> {
        let inputs = file.tables_if(log, "input", "name");
        let outputs = file.tables_if(log, "output", "name");
        let inputs: Vec<_> = (inputs.into_iter().map(|it| InputTable::read(log, it))).collect();
        let outputs: Vec<_> = (outputs.into_iter().map(|it| OutputTable::read(log, it))).collect();
        Some(Self {
            inputs: inputs.into_iter().collect::<Option<_>>()?,
            outputs: outputs.into_iter().collect::<Option<_>>()?,
        })
    }

    /// Where the file names each of the inputs.
    pub(super) fn inputs(&self) -> Vec<Range<usize>> {
        let names = self.inputs.iter().map(|it| it.wire.name.span());
        names.collect()
    }

    /// Those of these drives, on a machine that `has_spindle`.
    pub(super) fn join(
        self,
        log: &mut Log<'_>,
        drives: &[Drive],
        has_spindle: bool,
    ) -> (Vec<Input>, Vec<Output>) {
        let mut inputs = self.inputs.iter();
        if let Some(input) = inputs.find(|it| it.meaning == InputMeaning::AtSpeed)
            && !has_spindle
        {
            log.report(
                input.wire.name.span(),
                format!(
                    "{}: at speed of a spindle that is not there",
                    input.wire.title
                ),
                "add [spindle] with `max_speed` and `ramp_ms`, within which it comes",
            );
        }
        (
            join_inputs(log, self.inputs, drives),
            join_outputs(log, self.outputs, drives),
        )
    }
}

/// All inputs, with names of their own.
fn join_inputs(log: &mut Log<'_>, tables: Vec<InputTable>, drives: &[Drive]) -> Vec<Input> {
    unique(log, "input", tables.iter().map(|table| &table.wire.name));
    let mut inputs = Vec::new();
    for InputTable {
        wire,
        debounce,
        meaning,
        simulated,
    } in tables
    {
        if let Some((drive, signal)) = wire.resolve(log, drives, |it| it.model.inputs) {
            inputs.push(Input {
                name: wire.name.into_inner(),
                drive,
                signal,
                active_low: wire.active_low,
                debounce,
                meaning,
                simulated,
            });
        }
    }
    inputs
}

/// All outputs, with names and signals of their own.
fn join_outputs(log: &mut Log<'_>, tables: Vec<OutputTable>, drives: &[Drive]) -> Vec<Output> {
    unique(log, "output", tables.iter().map(|table| &table.wire.name));
    let mut outputs: Vec<Output> = Vec::new();
    for OutputTable { wire, safe, switch } in tables {
        let Some((drive, signal)) = wire.resolve(log, drives, |it| it.model.outputs) else {
            continue;
        };
        let same = |other: &&Output| (other.drive, other.signal) == (drive, signal);
        if let Some(other) = outputs.iter().find(same) {
            log.report(
                wire.signal.span(),
                format!("{}: its signal is output \"{}\"", wire.title, other.name),
                "allowed: each output of a drive once",
            );
        }
        outputs.push(Output {
            name: wire.name.into_inner(),
            drive,
            signal,
            active_low: wire.active_low,
            safe,
            switch,
        });
    }
    outputs
}
