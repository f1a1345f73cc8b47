//! `[[input]]` and `[[output]]`: the machine's inputs and outputs by name, each a digital signal of a
//! drive or of an I/O node, or an analog one of an I/O node.

mod analog_input;

pub use analog_input::AnalogInput;

use analog_input::AnalogInputTable;

use super::read::{name, unknown};
use super::{Drive, IoNode, Node, Spindle};
use std::ops::Range;
use std::time::Duration;
use syncline_drives::model::Model;
use syncline_gcode::{ANALOG_OUTPUTS, DIGITAL_INPUTS, DIGITAL_OUTPUTS};
use syncline_strict_toml::{Log, Table, nearest, one_of};
use toml::Spanned;

/// A digital input of a drive or of an I/O node, and what it means to the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// As the machine file names it.
    pub name: String,
    /// Index of its device in [`Machine::nodes`](super::Machine::nodes).
    pub node: usize,
    /// Which of the device's signals.
    pub signal: usize,
    /// It is on where the device's input is off.
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
    /// It is on while the probe touches something.
    Probe,
    /// It is on while a tool touches the tool setter.
    ToolSetter,
    /// It is on beyond an end of the travel of an axis, which goes no further there.
    Limit,
}

impl InputMeaning {
    /// Whether it is what G38.2 to G38.5 look for, and what nothing else may touch.
    #[must_use]
    pub fn is_probed(self) -> bool {
        matches!(self, Self::Probe | Self::ToolSetter)
    }

    /// Whether it holds the path, and nothing begins to move while it is on: a door that is open, or a feed hold.
    #[must_use]
    pub fn holds(self) -> bool {
        matches!(self, Self::Door | Self::FeedHold)
    }
}

/// A digital output of a drive or of an I/O node, and what the machine uses it for.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// As the machine file names it.
    pub name: String,
    /// Index of its device in [`Machine::nodes`](super::Machine::nodes).
    pub node: usize,
    /// Which of the device's outputs.
    pub signal: usize,
    /// It is on where the device's output is off.
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
    /// No program: it is on while drives are enabled or on their way there, and closes the chain that lets them have power.
    EnableChain,
}

/// An analog output of an I/O node, and what the machine uses it for.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalogOutput {
    /// As the machine file names it.
    pub name: String,
    /// Index of its device in [`Machine::nodes`](super::Machine::nodes).
    pub node: usize,
    /// Which of the device's analog outputs.
    pub place: usize,
    /// The value at which it puts out all it can; above zero.
    pub full_scale: f64,
    /// Its value while no program runs, and from a stop on.
    pub safe: f64,
    /// What it puts out while a program runs.
    pub source: AnalogSource,
}

impl AnalogOutput {
    /// A value as the device takes it: the whole range of 16 bits is from the negative full scale to the positive
    /// one, and what is beyond is at its end.
    #[must_use]
    pub fn scaled(&self, value: f64) -> i16 {
        (value / self.full_scale * f64::from(i16::MAX)).round() as i16
    }
}

/// What an analog output puts out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalogSource {
    /// Q of M67 and M68 with this E.
    Program(u8),
    /// S while the spindle turns, 1/min; 0 while it does not.
    SpindleSpeed,
}

/// What inputs mean besides their numbers, by their names in the file.
const MEANINGS: [(&str, InputMeaning); 9] = [
    ("enable", InputMeaning::Enable),
    ("feed_hold", InputMeaning::FeedHold),
    ("cycle_start", InputMeaning::CycleStart),
    ("door", InputMeaning::Door),
    ("at_speed", InputMeaning::AtSpeed),
    ("home", InputMeaning::Home),
    ("probe", InputMeaning::Probe),
    ("tool_setter", InputMeaning::ToolSetter),
    ("limit", InputMeaning::Limit),
];

/// What switches outputs besides their numbers.
const SWITCHES: [(&str, OutputSwitch); 5] = [
    ("spindle", OutputSwitch::Spindle),
    ("spindle_reverse", OutputSwitch::SpindleReverse),
    ("mist", OutputSwitch::Mist),
    ("flood", OutputSwitch::Flood),
    ("enable_chain", OutputSwitch::EnableChain),
];

/// What analog outputs put out besides.
const SOURCES: [(&str, AnalogSource); 1] = [("spindle_speed", AnalogSource::SpindleSpeed)];

/// Inputs that a machine may have.
pub const MOST_INPUTS: usize = 256;

/// Greatest time that an input is debounced for, ms.
const MOST_DEBOUNCE: i64 = 1000;

/// The devices that inputs and outputs are wired to.
#[derive(Clone, Copy)]
pub(super) struct Wiring<'m> {
    pub(super) drives: &'m [Drive],
    /// How many devices stand between drives and I/O nodes.
    pub(super) encoders: usize,
    pub(super) io_nodes: &'m [IoNode],
}

/// The inputs and outputs of a machine.
pub(super) struct Signals {
    pub(super) inputs: Vec<Input>,
    pub(super) analog_inputs: Vec<AnalogInput>,
    pub(super) outputs: Vec<Output>,
    pub(super) analog_outputs: Vec<AnalogOutput>,
}

/// What a signal is.
#[derive(Clone, Copy)]
enum Kind {
    Digital,
    Analog,
}

/// A signal of a device by their names.
struct Wire {
    title: String,
    name: Spanned<String>,
    device: Spanned<String>,
    /// The device is an I/O node.
    of_io: bool,
    signal: Spanned<String>,
}

impl Wire {
    /// The keys that inputs and outputs share; `allowed` is a signal of theirs.
    fn read(log: &mut Log<'_>, table: &mut Table<'_, '_>, allowed: &str) -> Option<Self> {
        let name = name(log, table);
        let drive = table.text_if(log, "drive", "the `name` of a [[drive]]", |_| true);
        let io = table.text_if(log, "io", "the `name` of an [[io]]", |_| true);
        let signal = table.text(log, "signal", allowed, |_| true);
        let title = table.title.clone();
        let device = match (drive, io) {
            (Some(drive), None) => Some((drive, false)),
            (None, Some(io)) => Some((io, true)),
            (drive, io) => {
                if drive.is_some() == io.is_some() {
                    let (span, problem) = match io {
                        Some(io) => (io.span(), "both `drive` and `io` say where it is"),
                        None => (
                            table.span_of("name").unwrap_or_default(),
                            "nothing says where it is",
                        ),
                    };
                    let help = "allowed: `drive`, the `name` of a [[drive]], or `io`, of an [[io]]";
                    log.report(span, format!("{title}: {problem}"), help);
                }
                None
            }
        };
        let (device, of_io) = device?;
        Some(Self {
            title,
            name: name?,
            device,
            of_io,
            signal: signal?,
        })
    }

    /// Index of the device, and the place of the signal among those that its model has; `others` are those of the other kind,
    /// digital or analog.
    fn resolve(
        &self,
        log: &mut Log<'_>,
        wiring: Wiring<'_>,
        signals: fn(&Model) -> &'static [&'static str],
        others: (fn(&Model) -> &'static [&'static str], Kind),
    ) -> Option<(usize, usize)> {
        let Wiring {
            drives,
            encoders,
            io_nodes,
        } = wiring;
        let (kind, first, devices): (_, _, Vec<Node<'_>>) = match self.of_io {
            false => ("drive", 0, drives.iter().map(Node::from).collect()),
            true => {
                let first = drives.len() + encoders;
                ("io", first, io_nodes.iter().map(Node::from).collect())
            }
        };
        // Names have told that it is there.
        let mut names = devices.iter().map(|device| device.name);
        let index = names.position(|name| name == self.device.get_ref())?;
        let Node { name, model, .. } = devices[index];
        let known = signals(model).iter().copied();
        let place = known.clone().position(|name| name == self.signal.get_ref());
        let (others, of_kind) = others;
        if place.is_none() && others(model).contains(&self.signal.get_ref().as_str()) {
            let (is, help) = match of_kind {
                Kind::Analog => (
                    "analog, and `full_scale` is missing",
                    "add `full_scale`, its value at the greatest that the device takes in or puts out",
                ),
                Kind::Digital => ("digital, and has no `full_scale`", "leave `full_scale` out"),
            };
            let signal = self.signal.get_ref();
            let problem = format!(
                "{}: signal \"{signal}\" of {kind} \"{name}\" ({}) is {is}",
                self.title, model.title
            );
            log.report(self.signal.span(), problem, help);
        } else if place.is_none() {
            let nearest = nearest(self.signal.get_ref(), known.clone());
            let problem = format!(
                "{}: {kind} \"{name}\" ({}) has no such signal \"{}\"",
                self.title,
                model.title,
                self.signal.get_ref()
            );
            let help = match nearest {
                Some(nearest) => format!("allowed: {}; nearest: \"{nearest}\"", one_of(known)),
                None => format!("allowed: a {kind} that has such signals"),
            };
            log.report(self.signal.span(), problem, help);
        }
        Some((first + index, place?))
    }
}

/// The input of that name among those that are `allowed`, by its place; what they are, and their `function`.
pub(super) fn named(
    log: &mut Log<'_>,
    title: &str,
    (kind, function): (&str, &str),
    name: &Spanned<String>,
    inputs: &[Input],
    allowed: impl Fn(usize) -> bool,
) -> Option<usize> {
    let places = (0..inputs.len()).filter(|place| allowed(*place));
    let found = (places.clone()).find(|&place| inputs[place].name == *name.get_ref());
    let names = places.map(|place| inputs[place].name.as_str());
    match (found, names.clone().next()) {
        (Some(_), _) => {}
        (None, Some(_)) => unknown(log, title, kind, name, names),
        (None, None) => log.report(
            name.span(),
            format!("{title}: there is no {kind} \"{}\"", name.get_ref()),
            format!("add an [[input]] with `function = \"{function}\"`"),
        ),
    }
    found
}

/// What an input is called of which every cycle's level counts.
fn edge_of(meaning: Option<InputMeaning>) -> Option<&'static str> {
    match meaning? {
        InputMeaning::Home => Some("home switch"),
        InputMeaning::Probe => Some("probe"),
        InputMeaning::ToolSetter => Some("tool setter"),
        InputMeaning::Limit => Some("limit switch"),
        _ => None,
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
    active_low: bool,
    debounce: Duration,
    meaning: InputMeaning,
    simulated: Option<(f64, f64)>,
}

impl InputTable {
    fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let wire = Wire::read(log, &mut table, "an input of the device: \"DI0\"");
        let active_low = table.flag_or(log, "active_low", false);
        let numbers = (DIGITAL_INPUTS, InputMeaning::Program as fn(u8) -> _, "M66");
        let meaning = purpose(log, &mut table, numbers, &MEANINGS);
        let debounce = table.integer_or(log, "debounce_ms", 0, 0..=MOST_DEBOUNCE, " (ms)");
        let edge = edge_of(meaning).filter(|_| debounce > 0);
        if let Some(edge) = edge {
            log.report(
                table.span_of("debounce_ms").unwrap_or_default(),
                format!("{}: `debounce_ms` of a {edge}", table.title),
                "leave it out: each cycle's level counts, so that the place of the edge is known",
            );
        }
        let allowed = "[from, to] machine position of the drive's axis, the first below the second";
        let simulated = table.interval_if(log, "simulated", allowed);
        if let (Some(simulated), Some(Wire { of_io: true, .. })) = (&simulated, &wire) {
            log.report(
                simulated.span(),
                format!("{}: `simulated` of an I/O node", table.title),
                "leave it out: a switch along an axis is simulated at an input of a drive of that axis",
            );
        }
        table.finish(log);
        Some(Self {
            wire: wire?,
            active_low,
            debounce: Duration::from_millis(debounce as u64),
            meaning: meaning?,
            simulated: simulated.map(Spanned::into_inner),
        })
    }
}

/// An output as the file has it.
struct OutputTable {
    wire: Wire,
    used_for: OutputPurpose,
}

/// What the machine uses an output for.
enum OutputPurpose {
    Digital {
        active_low: bool,
        safe: bool,
        switch: OutputSwitch,
    },
    Analog {
        full_scale: Spanned<f64>,
        safe: f64,
        source: AnalogSource,
    },
}

impl OutputTable {
    fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let is_analog = table.span_of("full_scale").is_some();
        let allowed = match is_analog {
            true => "an analog output of the device: \"AO0\"",
            false => "an output of the device: \"DQ0\"",
        };
        let wire = Wire::read(log, &mut table, allowed);
        let used_for = match is_analog {
            true => OutputPurpose::analog(log, &mut table),
            false => OutputPurpose::digital(log, &mut table),
        };
        table.finish(log);
        Some(Self {
            wire: wire?,
            used_for: used_for?,
        })
    }
}

impl OutputPurpose {
    fn digital(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<Self> {
        let active_low = table.flag_or(log, "active_low", false);
        let numbers = (
            DIGITAL_OUTPUTS,
            OutputSwitch::Program as fn(u8) -> _,
            "M62 to M65",
        );
        let switch = purpose(log, table, numbers, &SWITCHES);
        let safe = table.choice_or(log, "safe", "off", ["off", "on"].into_iter());
        let unsafe_on = match switch {
            Some(OutputSwitch::EnableChain) => Some((
                "enable chain",
                "without the controller the chain has to open",
            )),
            Some(OutputSwitch::Spindle | OutputSwitch::SpindleReverse) => {
                Some(("spindle", "behind a fault it has to rest"))
            }
            Some(OutputSwitch::Mist | OutputSwitch::Flood) => Some((
                "coolant",
                "programs take it to be off until they switch it on; one with a `number` may be safe where it is on",
            )),
            Some(OutputSwitch::Program(_)) | None => None,
        };
        if let Some((what, why)) = unsafe_on.filter(|_| safe == "on") {
            log.report(
                table.span_of("safe").unwrap_or_default(),
                format!("{}: `safe = \"on\"` of the {what}", table.title),
                format!("leave it out: {why}"),
            );
        }
        Some(Self::Digital {
            active_low,
            safe: safe == "on",
            switch: switch?,
        })
    }

    fn analog(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<Self> {
        let unit = "(the value at which it puts out all it can)";
        let full_scale = table.positive(log, "full_scale", unit);
        let numbers = (
            ANALOG_OUTPUTS,
            AnalogSource::Program as fn(u8) -> _,
            "M67 and M68, there E",
        );
        let source = purpose(log, table, numbers, &SOURCES);
        let safe = table.number_if(log, "safe", "a number within `full_scale`", f64::is_finite);
        let full_scale = full_scale?;
        let safe = safe.filter(|safe| {
            let within = safe.get_ref().abs() <= *full_scale.get_ref();
            if !within {
                log.report(
                    safe.span(),
                    format!("{}: `safe` is {}", table.title, safe.get_ref()),
                    format!(
                        "allowed: a number within `full_scale`, {}",
                        full_scale.get_ref()
                    ),
                );
            }
            within
        });
        if let Some(safe) = safe.as_ref().filter(|it| *it.get_ref() != 0.0)
            && source == Some(AnalogSource::SpindleSpeed)
        {
            log.report(
                safe.span(),
                format!("{}: `safe` of the spindle", table.title),
                "leave it out: behind a fault it has to rest",
            );
        }
        Some(Self::Analog {
            full_scale,
            safe: safe.map_or(0.0, Spanned::into_inner),
            source: source?,
        })
    }
}

/// All inputs and outputs as the file has them.
pub(super) struct SignalTables {
    inputs: Vec<InputTable>,
    analog_inputs: Vec<AnalogInputTable>,
    outputs: Vec<OutputTable>,
}

impl SignalTables {
    pub(super) fn read(log: &mut Log<'_>, file: &mut Table<'_, '_>) -> Option<Self> {
        let inputs = file.tables_if(log, "input", "name");
        let outputs = file.tables_if(log, "output", "name");
        let (analog_inputs, inputs): (Vec<_>, Vec<_>) =
            (inputs.into_iter()).partition(|it| it.span_of("full_scale").is_some());
        let inputs: Vec<_> = (inputs.into_iter().map(|it| InputTable::read(log, it))).collect();
        let analog_inputs = analog_inputs.into_iter();
        let analog_inputs: Vec<_> = analog_inputs
            .map(|it| AnalogInputTable::read(log, it))
            .collect();
        let outputs: Vec<_> = (outputs.into_iter().map(|it| OutputTable::read(log, it))).collect();
        Some(Self {
            inputs: inputs.into_iter().collect::<Option<_>>()?,
            analog_inputs: analog_inputs.into_iter().collect::<Option<_>>()?,
            outputs: outputs.into_iter().collect::<Option<_>>()?,
        })
    }

    /// Where the file names each of the digital inputs.
    pub(super) fn inputs(&self) -> Vec<Range<usize>> {
        let names = self.inputs.iter().map(|it| it.wire.name.span());
        names.collect()
    }

    /// Those of these devices, on a machine with this spindle, if it has one.
    pub(super) fn join(
        self,
        log: &mut Log<'_>,
        wiring: Wiring<'_>,
        spindle: Option<&Spindle>,
    ) -> Signals {
        let mut inputs = self.inputs.iter();
        if let Some(input) = inputs.find(|it| it.meaning == InputMeaning::AtSpeed)
            && spindle.is_none()
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
        let mut inputs = self.inputs.iter();
        if let Some(input) = inputs.find(|it| it.meaning == InputMeaning::AtSpeed)
            && spindle.is_some_and(|spindle| spindle.drive.is_some())
        {
            log.report(
                input.wire.name.span(),
                format!(
                    "{}: at speed of a spindle whose drive tells its speed",
                    input.wire.title
                ),
                "leave the input out: cuts wait for the speed that the drive measures",
            );
        }
        check_enable_chain(log, &self.outputs);
        let inputs = join_inputs(log, self.inputs, wiring);
        let mut signals = Signals {
            inputs,
            analog_inputs: analog_input::join(log, self.analog_inputs, wiring),
            outputs: Vec::new(),
            analog_outputs: Vec::new(),
        };
        for OutputTable { wire, used_for } in self.outputs {
            match used_for {
                OutputPurpose::Digital {
                    active_low,
                    safe,
                    switch,
                } => {
                    let place = wire.resolve(
                        log,
                        wiring,
                        |model| model.outputs,
                        (|model| model.analog_outputs, Kind::Analog),
                    );
                    let used = (signals.outputs.iter()).map(|it| (it.node, it.signal, &it.name));
                    if let Some((node, signal)) = once(log, &wire, place, used) {
                        signals.outputs.push(Output {
                            name: wire.name.into_inner(),
                            node,
                            signal,
                            active_low,
                            safe,
                            switch,
                        });
                    }
                }
                OutputPurpose::Analog {
                    full_scale,
                    safe,
                    source,
                } => {
                    if source == AnalogSource::SpindleSpeed {
                        check_speed(log, &wire, &full_scale, spindle);
                    }
                    let place = wire.resolve(
                        log,
                        wiring,
                        |model| model.analog_outputs,
                        (|model| model.outputs, Kind::Digital),
                    );
                    let used = signals.analog_outputs.iter();
                    let used = used.map(|it| (it.node, it.place, &it.name));
                    if let Some((node, place)) = once(log, &wire, place, used) {
                        signals.analog_outputs.push(AnalogOutput {
                            name: wire.name.into_inner(),
                            node,
                            place,
                            full_scale: full_scale.into_inner(),
                            safe,
                            source,
                        });
                    }
                }
            }
        }
        signals
    }
}

/// Whether the enable chain hangs on one output, of a device that opens it by itself where the controller dies.
fn check_enable_chain(log: &mut Log<'_>, outputs: &[OutputTable]) {
    let is_chain = |it: &&OutputTable| matches!(it.used_for, OutputPurpose::Digital { switch, .. } if switch == OutputSwitch::EnableChain);
    for (number, OutputTable { wire, .. }) in outputs.iter().filter(is_chain).enumerate() {
        if !wire.of_io {
            log.report(
                wire.device.span(),
                format!("{}: the enable chain hangs on a drive", wire.title),
                "name an I/O node, as `io`: it opens the chain by itself where the controller dies",
            );
        }
        if number > 0 {
            log.report(
                wire.name.span(),
                format!("{}: a second enable chain", wire.title),
                "let one output open all contactors",
            );
        }
    }
}

/// The place of an output, which is `used` by no other one.
fn once<'o>(
    log: &mut Log<'_>,
    wire: &Wire,
    place: Option<(usize, usize)>,
    mut used: impl Iterator<Item = (usize, usize, &'o String)>,
) -> Option<(usize, usize)> {
    let place = place?;
    if let Some((.., other)) = used.find(|(node, signal, _)| (*node, *signal) == place) {
        log.report(
            wire.signal.span(),
            format!("{}: its signal is output \"{other}\"", wire.title),
            "allowed: each output of a device once",
        );
    }
    Some(place)
}

/// Whether an output can put out every speed that a program may ask for.
fn check_speed(
    log: &mut Log<'_>,
    wire: &Wire,
    full_scale: &Spanned<f64>,
    spindle: Option<&Spindle>,
) {
    let Some(Spindle { speeds, .. }) = spindle else {
        return log.report(
            wire.name.span(),
            format!("{}: speed of a spindle that is not there", wire.title),
            "add [spindle] with `max_speed`, beyond which S is refused",
        );
    };
    if speeds.1 > *full_scale.get_ref() {
        log.report(
            full_scale.span(),
            format!(
                "{}: `full_scale` is {}, and S goes up to {}",
                wire.title,
                full_scale.get_ref(),
                speeds.1
            ),
            "allowed: from `max_speed` of [spindle] on",
        );
    }
}

/// All inputs, with names of their own.
fn join_inputs(log: &mut Log<'_>, tables: Vec<InputTable>, wiring: Wiring<'_>) -> Vec<Input> {
    if let Some(table) = tables.get(MOST_INPUTS) {
        log.report(
            table.wire.name.span(),
            format!("{}: one input too many", table.wire.title),
            format!("allowed: {MOST_INPUTS} inputs"),
        );
    }
    let mut inputs: Vec<Input> = Vec::new();
    for InputTable {
        wire,
        active_low,
        debounce,
        meaning,
        simulated,
    } in tables
    {
        // One whose signal is not there is told, and keeps its name, by which others know it.
        let place = wire.resolve(
            log,
            wiring,
            |model| model.inputs,
            (|model| model.analog_inputs, Kind::Analog),
        );
        let (node, signal) = place.unwrap_or_default();
        let mut io_nodes = wiring.io_nodes.iter();
        let by_event =
            wire.of_io && io_nodes.any(|io| io.name == *wire.device.get_ref() && io.by_event);
        if let Some(edge) = edge_of(Some(meaning)).filter(|_| by_event) {
            log.report(
                wire.device.span(),
                format!("{}: a {edge} of an I/O node whose inputs come by event", wire.title),
                "allowed: an I/O node with `inputs = \"sync\"`, so that the place of the edge is known",
            );
        }
        let mut others = inputs.iter();
        if let InputMeaning::Program(number) = meaning
            && let Some(other) = others.find(|other| other.meaning == meaning)
        {
            log.report(
                wire.name.span(),
                format!(
                    "{}: its `number`, {number}, is that of input \"{}\"",
                    wire.title, other.name
                ),
                "allowed: each number of a digital input once",
            );
        }
        inputs.push(Input {
            name: wire.name.into_inner(),
            node,
            signal,
            active_low,
            debounce,
            meaning,
            simulated,
        });
    }
    inputs
}
