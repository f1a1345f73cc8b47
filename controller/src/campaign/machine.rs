//! Random machines, as data: what a shrinking case leaves out, and what becomes a machine file.

use super::dice::{Dice, rounded};
use crate::budget::MachineBudget;
use crate::machine::Machine;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;
use syncline_drives::model::{Address, Assumed, MODELS, Model, Setpoints};

/// Letters of axes, in the order in which a small machine has them.
const LETTERS: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// Cycles that are drawn, µs.
const CYCLES: [u32; 8] = [1000, 2000, 2000, 3000, 4000, 5000, 10_000, 20_000];

/// Bit rates that are drawn, bit/s: slower buses hold no cycle of two drives.
const BIT_RATES: [u32; 3] = [1_000_000, 500_000, 250_000];

/// CiA 402's quick stop ramp, increments/s². As a drive leaves the factory it may be steeper than many a motor
/// can follow, so who sets up a machine writes what the axis takes, where the controller does not.
const QUICK_STOP_RAMP: Address = Address::new(0x6085, 0);

/// Draws of a machine until one fits its buses; then the simplest one is taken.
const DRAWS: usize = 40;

/// A machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MachineSpec {
    /// Base cycle, µs.
    pub cycle_us: u32,
    /// T_PDOs missing in a row that are a fault.
    pub t_pdo_misses: u32,
    /// How far a path may leave what is programmed under G61, and under G64, mm.
    pub tolerances: [f64; 2],
    /// Bit rate of each bus, bit/s.
    pub buses: Vec<u32>,
    /// The axes.
    pub axes: Vec<AxisSpec>,
    /// I/O nodes.
    #[serde(default)]
    pub io_nodes: Vec<IoSpec>,
}

/// An I/O node by CiA 401.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IoSpec {
    /// Its place among the buses.
    pub bus: usize,
    /// Its node id.
    pub node: u8,
    /// It tells its inputs when they change, not at every SYNC.
    pub by_event: bool,
    /// It has its digital signals by words, not by bytes: all nodes of a machine alike.
    pub words: bool,
    /// What is wired to its inputs and outputs.
    pub wires: Vec<Wire>,
}

/// An axis of one drive, or a gantry of two.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisSpec {
    /// Its letter.
    pub letter: char,
    /// Travel for one revolution of the motor, mm or degrees.
    pub travel: f64,
    /// mm/s.
    pub velocity: f64,
    /// mm/s².
    pub acceleration: f64,
    /// mm/s³.
    pub jerk: f64,
    /// Least and greatest position, mm.
    pub soft_limits: [f64; 2],
    /// Whether the drives supervise following error and soft limits too.
    pub supervised: bool,
    /// One, or two.
    pub drives: Vec<DeviceSpec>,
    /// What the file says of what its drives move: the inside of `simulation`.
    pub simulation: Option<String>,
    /// How it is homed: the inside of `homing`. Its encoders are absolute if there is none.
    #[serde(default)]
    pub homing: Option<String>,
}

/// A drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceSpec {
    /// Its place among the buses.
    pub bus: usize,
    /// Its node id.
    pub node: u8,
    /// The name of its model.
    pub model: String,
    /// Its encoder counts the other way.
    pub negative: bool,
    /// What its encoder counts at machine position 0.
    pub zero: i32,
    /// What is wired to its inputs and outputs.
    #[serde(default)]
    pub wires: Vec<Wire>,
}

/// An input or an output of a drive that means something to the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wire {
    /// The table of the machine file that has it: `input` or `output`.
    pub table: String,
    /// Its number among the drive's inputs, or outputs.
    pub place: u8,
    /// The drive's name of it.
    pub signal: String,
    /// What it means: the rest of that table.
    pub meaning: String,
}

/// What at most one input of a machine means, each. An enable is on while nothing is connected, as a closed
/// contact is.
const INPUTS: [&str; 4] = [
    "function = \"door\"\ndebounce_ms = 20",
    "function = \"feed_hold\"",
    "function = \"cycle_start\"",
    ENABLE,
];
const ENABLE: &str = "function = \"enable\"\nactive_low = true";

/// What an input means by which an axis is homed.
const HOME: &str = "function = \"home\"";

/// The same of outputs.
const OUTPUTS: [&str; 4] = [
    "function = \"spindle\"",
    "function = \"mist\"",
    "function = \"flood\"\nsafe = \"on\"",
    "function = \"spindle_reverse\"\nactive_low = true",
];

impl Wire {
    /// Whether it is the switch by which an axis is homed.
    pub(super) fn is_home(&self) -> bool {
        self.meaning.starts_with(HOME)
    }

    /// Whether the drives may be enabled while it is on alone.
    pub(super) fn is_enable(&self) -> bool {
        self.meaning == ENABLE
    }

    /// Of a device that the key names.
    fn write(&self, key: &str, device: &str, text: &mut String) {
        let Self {
            table,
            signal,
            meaning,
            ..
        } = self;
        let _ = write!(
            text,
            "\n[[{table}]]\nname = \"{device} {signal}\"\n{key} = \"{device}\"\n\
             signal = \"{signal}\"\n{meaning}\n"
        );
    }
}

impl IoSpec {
    /// A node whose signals have numbers of their own: those of drives are lower.
    fn draw(dice: &mut Dice, bus: usize, words: bool, place: u8) -> Self {
        let first = 32 + 16 * place;
        let mut wires = Vec::new();
        for (table, name, chance) in [("input", "DI", 0.2), ("output", "DO", 0.3)] {
            for signal in 0..16 {
                if dice.chance(chance) {
                    let active_low = ["", "\nactive_low = true"][usize::from(dice.chance(0.3))];
                    wires.push(Wire {
                        table: table.to_owned(),
                        place: signal,
                        signal: format!("{name}{signal}"),
                        meaning: match (table, dice.chance(0.2)) {
                            ("output", true) => {
                                format!("{NUMBER}{}{active_low}\nsafe = \"on\"", first + signal)
                            }
                            _ => format!("{NUMBER}{}{active_low}", first + signal),
                        },
                    });
                }
            }
        }
        for signal in 0..2 {
            if dice.chance(0.4) {
                let scale = *dice.pick(&[1.0, 5.0, 10.0]);
                let safe = *dice.pick(&[0.0, 0.0, -0.5, 1.0]);
                wires.push(Wire {
                    table: "output".to_owned(),
                    place: signal,
                    signal: format!("AO{signal}"),
                    meaning: format!(
                        "{NUMBER}{}\nfull_scale = {scale:?}\nsafe = {safe:?}",
                        2 * place + signal
                    ),
                });
            }
        }
        if wires.is_empty() {
            wires.push(Wire {
                table: "output".to_owned(),
                place: 0,
                signal: "DO0".to_owned(),
                meaning: format!("{NUMBER}{first}"),
            });
        }
        Self {
            bus,
            node: dice.whole(1..=126) as u8,
            by_event: dice.chance(0.3),
            words,
            wires,
        }
    }

    /// What the machine file calls it.
    fn name(place: usize) -> String {
        format!("io{place}")
    }

    fn write(&self, place: usize, text: &mut String) {
        let name = Self::name(place);
        let inputs = if self.by_event { "event" } else { "sync" };
        let _ = write!(
            text,
            "\n[[io]]\nname = \"{name}\"\nbus = \"bus{}\"\nnode = {}\nmodel = \"cia401\"\n\
             inputs = \"{inputs}\"\n",
            self.bus, self.node
        );
        for wire in &self.wires {
            wire.write("io", &name, text);
        }
    }
}

impl MachineSpec {
    /// What its outputs are called.
    pub(super) fn outputs(&self) -> Vec<String> {
        let drives = self.axes.iter().flat_map(|axis| {
            let drives = axis.drives.iter().enumerate();
            drives.map(|(side, drive)| (axis.drive_name(side), drive))
        });
        let drives = drives.map(|(name, drive)| (name, &drive.wires));
        let io_nodes = self.io_nodes.iter().enumerate();
        let io_nodes = io_nodes.map(|(place, io)| (IoSpec::name(place), &io.wires));
        let outputs = drives.chain(io_nodes).flat_map(|(name, wires)| {
            let outputs = wires.iter().filter(|wire| wire.table == "output");
            outputs.map(move |wire| format!("{name} {}", wire.signal))
        });
        outputs.collect()
    }

    /// A random machine that fits its buses.
    pub(super) fn draw(dice: &mut Dice) -> Self {
        for _ in 0..DRAWS {
            let spec = Self::any(dice);
            if spec.fits() {
                return spec;
            }
        }
        Self {
            cycle_us: 4000,
            t_pdo_misses: 2,
            tolerances: [0.001, 0.01],
            buses: vec![1_000_000],
            axes: vec![AxisSpec::draw(
                dice,
                'X',
                4000,
                &mut vec![(0, MODELS[0].name)],
            )],
            io_nodes: Vec::new(),
        }
    }

    /// A random one, whether it fits or not.
    fn any(dice: &mut Dice) -> Self {
        let cycle_us = *dice.pick(&CYCLES);
        // Small machines are most: they are quick, and most of what goes wrong needs no more.
        let count = match dice.weighted(&[4, 4, 2]) {
            0 => dice.whole(1..=3),
            1 => dice.whole(3..=5),
            _ => dice.whole(6..=9),
        };
        let buses = 1 + dice.weighted(&[6, 3, 1]).min(count as usize - 1);
        let buses: Vec<u32> = (0..buses)
            .map(|_| BIT_RATES[dice.weighted(&[6, 2, 1])])
            .collect();
        let mut letters = LETTERS.to_vec();
        if dice.chance(0.3) {
            for place in (1..letters.len()).rev() {
                letters.swap(place, dice.below(place + 1));
            }
        }
        // Most machines have one maker's drives, and those of all are sent positions.
        let period = Duration::from_micros(cycle_us.into());
        let models: Vec<&str> = MODELS
            .iter()
            .filter(|model| model.is_sent(Setpoints::Positions) && model.takes_cycle(period))
            .map(|model| model.name)
            .collect();
        let mixed = dice.chance(0.4);
        let main = MODELS[0].name;
        let axes = letters[..count as usize].iter().map(|&letter| {
            let gantry = dice.chance(0.15);
            let model = if mixed { *dice.pick(&models) } else { main };
            let drives = if gantry { 2 } else { 1 };
            let mut places: Vec<_> = (0..drives)
                .map(|_| (dice.below(buses.len()), model))
                .collect();
            AxisSpec::draw(dice, letter, cycle_us, &mut places)
        });
        let axes = axes.collect();
        let mut spec = Self {
            cycle_us,
            t_pdo_misses: *dice.pick(&[2, 2, 2, 1, 3]),
            tolerances: [dice.decades(-4, -1), dice.decades(-3, 0)],
            buses,
            axes,
            io_nodes: Vec::new(),
        };
        spec.number(dice);
        spec
    }

    /// Gives the drives node ids of their own, and leaves out buses without any.
    fn number(&mut self, dice: &mut Dice) {
        let mut used = Vec::new();
        for drive in self.axes.iter_mut().flat_map(|axis| &mut axis.drives) {
            while used.contains(&(drive.bus, drive.node)) {
                drive.node = dice.whole(1..=126) as u8;
            }
            used.push((drive.bus, drive.node));
        }
        self.leave_out_unused_buses();
    }

    /// Leaves out buses without drives.
    pub(super) fn leave_out_unused_buses(&mut self) {
        for bus in (0..self.buses.len()).rev() {
            let drives = || self.axes.iter().flat_map(|axis| &axis.drives);
            if self.buses.len() > 1 && !drives().any(|drive| drive.bus == bus) {
                self.buses.remove(bus);
                for io in self.io_nodes.iter_mut().filter(|io| io.bus >= bus) {
                    io.bus = io.bus.saturating_sub(1);
                }
                let drives = self.axes.iter_mut().flat_map(|axis| &mut axis.drives);
                for drive in drives.filter(|drive| drive.bus > bus) {
                    drive.bus -= 1;
                }
            }
        }
    }

    /// Wires some of its drives' inputs and outputs, where the buses have room for what they carry then.
    pub(super) fn wire(&mut self, dice: &mut Dice) {
        if !dice.chance(0.35) {
            return;
        }
        let mut wired = self.clone();
        let (mut inputs, mut outputs) = (Meanings::of(INPUTS), Meanings::of(OUTPUTS));
        for drive in wired.axes.iter_mut().flat_map(|axis| &mut axis.drives) {
            let Some(model) = drive.model() else { continue };
            for (table, signals, meanings) in [
                ("input", model.inputs, &mut inputs),
                ("output", model.outputs, &mut outputs),
            ] {
                for (place, signal) in signals.iter().enumerate() {
                    if dice.chance(0.25) {
                        drive.wires.push(Wire {
                            table: table.to_owned(),
                            place: place as u8,
                            signal: (*signal).to_owned(),
                            meaning: meanings.draw(dice),
                        });
                    }
                }
            }
        }
        if wired.fits() {
            *self = wired;
        }
    }

    /// Gives some machines an I/O node or two, where the buses have room for what they carry then.
    pub(super) fn equip(&mut self, dice: &mut Dice) {
        if !dice.chance(0.3) {
            return;
        }
        let mut equipped = self.clone();
        let words = dice.chance(0.3);
        for place in 0..dice.whole(1..=2) {
            let bus = dice.below(self.buses.len());
            let io = IoSpec::draw(dice, bus, words, place as u8);
            equipped.io_nodes.push(io);
        }
        let mut used: Vec<_> = self.nodes().collect();
        for io in &mut equipped.io_nodes {
            while used.contains(&(io.bus, io.node)) {
                io.node = dice.whole(1..=126) as u8;
            }
            used.push((io.bus, io.node));
        }
        if equipped.fits() {
            *self = equipped;
        }
    }

    /// Has some machines home axes of one drive: where they are set, or by a switch that is searched.
    pub(super) fn home(&mut self, dice: &mut Dice) {
        if !dice.chance(0.25) {
            return;
        }
        let mut homed = self.clone();
        for axis in homed.axes.iter_mut().filter(|axis| axis.drives.len() == 1) {
            if dice.chance(0.6) {
                axis.home(dice);
            }
        }
        if homed.fits() {
            *self = homed;
        }
    }

    /// The bus and the node id of every device, in the order of the machine.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (usize, u8)> {
        let drives = self.axes.iter().flat_map(|axis| &axis.drives);
        let drives = drives.map(|drive| (drive.bus, drive.node));
        drives.chain(self.io_nodes.iter().map(|io| (io.bus, io.node)))
    }

    /// What is wired, and to which device.
    pub(super) fn wires(&self) -> impl Iterator<Item = (usize, &Wire)> {
        let drives = self.axes.iter().flat_map(|axis| &axis.drives);
        let wires = drives.map(|drive| &drive.wires);
        let wires = wires.chain(self.io_nodes.iter().map(|io| &io.wires));
        (wires.enumerate()).flat_map(|(place, wires)| wires.iter().map(move |wire| (place, wire)))
    }

    /// The numbers by which programs know what is wired in a table.
    pub(super) fn numbers(&self, table: &str) -> Vec<u8> {
        let wires = self.wires().filter(|(_, wire)| wire.table == table);
        let wires = wires.filter(|(_, wire)| !wire.signal.starts_with("AO"));
        let number = |(_, wire): (usize, &Wire)| {
            let number = wire.meaning.strip_prefix(NUMBER)?;
            number.lines().next()?.parse().ok()
        };
        wires.filter_map(number).collect()
    }

    /// How many drives it has.
    #[must_use]
    pub fn drives(&self) -> usize {
        self.axes.iter().map(|axis| axis.drives.len()).sum()
    }

    /// What the machine file says of it.
    ///
    /// # Errors
    /// What is wrong in it, in words.
    pub fn machine(&self) -> Result<Machine, String> {
        Machine::parse(Path::new("machine.toml"), &self.toml()).map_err(|wrong| wrong.to_string())
    }

    /// Whether it is good, and its frames fit its cycle.
    fn fits(&self) -> bool {
        let machine = self.machine();
        machine.is_ok_and(|machine| MachineBudget::of(&machine).check().is_ok())
    }

    /// The machine file.
    #[must_use]
    pub fn toml(&self) -> String {
        let [exact, blend] = self.tolerances;
        let mut text = format!(
            "[machine]\nname = \"campaign\"\ncycle_us = {}\n\n[controller]\nt_pdo_misses = {}\n\n\
             [path]\nexact_tolerance = {exact}\nblend_tolerance = {blend}\n",
            self.cycle_us, self.t_pdo_misses,
        );
        for (bus, bitrate) in self.buses.iter().enumerate() {
            let _ = write!(
                text,
                "\n[[bus]]\nname = \"bus{bus}\"\nbitrate = {bitrate}\nport = \"sim\"\n"
            );
        }
        for axis in &self.axes {
            axis.write(&mut text);
        }
        for (place, io) in self.io_nodes.iter().enumerate() {
            io.write(place, &mut text);
        }
        if self.io_nodes.iter().any(|io| io.words) {
            text.push_str("\n[model.cia401]\ndigital_words = 1\n");
        }
        text
    }
}

/// What a number means of which programs know.
const NUMBER: &str = "number = ";

/// What inputs, or outputs, may mean: each function once, and numbers without end.
struct Meanings {
    functions: Vec<&'static str>,
    next: u8,
}

impl Meanings {
    fn of(functions: [&'static str; 4]) -> Self {
        Self {
            functions: functions.to_vec(),
            next: 0,
        }
    }

    fn draw(&mut self, dice: &mut Dice) -> String {
        if !self.functions.is_empty() && dice.chance(0.5) {
            let place = dice.below(self.functions.len());
            return self.functions.swap_remove(place).to_owned();
        }
        self.next += 1;
        format!("{NUMBER}{}", self.next - 1)
    }
}

impl DeviceSpec {
    fn model(&self) -> Option<&'static Model> {
        MODELS
            .iter()
            .find(|model| model.name == self.model)
            .copied()
    }

    /// What it counts in a revolution, if it has a quick stop ramp for a user to set.
    fn ramped(&self) -> Option<f64> {
        let model = self.model()?;
        let mut entries = model.dictionary.iter();
        let has_ramp = entries.any(|entry| entry.address == QUICK_STOP_RAMP);
        let is_users = has_ramp && !(model.reserved)(QUICK_STOP_RAMP);
        is_users.then(|| (model.increments_per_revolution)(&Assumed::default()).into())
    }
}

impl AxisSpec {
    /// An axis whose drives have these buses and models.
    ///
    /// Limits are drawn at the motor, where a drive can follow them, and carried over to the axis by
    /// a travel per revolution between micrometres and metres, so that axes of one machine differ by
    /// decades.
    fn draw(dice: &mut Dice, letter: char, cycle_us: u32, places: &mut Vec<(usize, &str)>) -> Self {
        let period = f64::from(cycle_us) * 1e-6;
        let travel = if dice.chance(0.6) {
            f64::from(dice.whole(1..=40))
        } else {
            dice.decades(-2, 3)
        };
        // Between two setpoints a drive interpolates: what changes much within a cycle it cannot follow.
        let velocity = dice.between(3.0, 45.0);
        let acceleration = dice.between(10.0, 400.0).min(0.6 / period);
        let jerk = acceleration * dice.between(2.0, 40.0).min(0.2 / period);
        let span = dice.between(5.0, 200.0);
        let least = match dice.weighted(&[3, 3, 1]) {
            0 => 0.0,
            1 => -span * dice.between(0.0, 1.0),
            _ => dice.between(-500.0, 500.0),
        };
        let drives = places.drain(..).enumerate().map(|(side, (bus, model))| {
            let revolutions = dice.between(-600.0, 600.0);
            DeviceSpec {
                bus,
                node: dice.whole(1..=126) as u8,
                model: model.to_owned(),
                negative: side == 1 || dice.chance(0.3),
                zero: (revolutions * 131_072.0) as i32,
                wires: Vec::new(),
            }
        });
        Self {
            letter,
            travel,
            velocity: digits(velocity * travel),
            acceleration: digits(acceleration * travel),
            jerk: digits(jerk * travel),
            drives: drives.collect(),
            soft_limits: [digits(least * travel), digits((least + span) * travel)],
            supervised: dice.chance(0.5),
            simulation: dice.chance(0.15).then(|| Self::simulation(dice)),
            homing: None,
        }
    }

    /// A feed axis that a motor is at ease with.
    fn simulation(dice: &mut Dice) -> String {
        let motor = dice.pick(&["generic-3", "generic-6", "generic-12"]);
        format!("motor = \"{motor}\"")
    }

    /// Has it be homed: where it is set, or, if its drive has an input to spare, by a switch.
    fn home(&mut self, dice: &mut Dice) {
        let [least, most] = self.soft_limits;
        let inside = digits(dice.between(least, most)).clamp(least, most);
        // Two revolutions: ten millimetres are a thousand of some motors.
        let order = dice.whole(1..=2);
        let jogs = format!(
            "order = {order}\njog_distance = {}",
            digits(2.0 * self.travel)
        );
        let name = self.drive_name(0);
        let drive = &mut self.drives[0];
        let inputs = drive.model().map_or(&[][..], |model| model.inputs);
        let used = |place: usize| {
            let mut inputs = drive.wires.iter().filter(|wire| wire.table == "input");
            inputs.any(|wire| usize::from(wire.place) == place)
        };
        let spare: Vec<usize> = (0..inputs.len()).filter(|place| !used(*place)).collect();
        if spare.is_empty() || dice.chance(0.3) {
            self.homing = Some(format!("kind = \"set_here\"\nposition = {inside}\n{jogs}"));
            return;
        }
        let place = *dice.pick(&spare);
        let (direction, end, away) = match dice.chance(0.5) {
            true => ("positive", most, -1.0),
            false => ("negative", least, 1.0),
        };
        let edge = digits(end - away * self.travel * dice.between(-0.5, 2.0));
        let start = digits(edge + away * self.travel * dice.between(-1.0, 8.0));
        let active_low = ["", "\nactive_low = true"][usize::from(dice.chance(0.3))];
        // On to the end of the travel.
        let beyond = digits(edge - away * 1000.0 * self.travel);
        let [from, to] = [edge.min(beyond), edge.max(beyond)];
        drive.wires.push(Wire {
            table: "input".to_owned(),
            place: place as u8,
            signal: inputs[place].to_owned(),
            meaning: format!("{HOME}{active_low}\nsimulated = [{from}, {to}]"),
        });
        let speed = digits(self.velocity * dice.between(0.1, 0.9));
        let slow_speed = digits(speed * dice.between(0.02, 0.3));
        let latch = ["", "\nlatch = false"][usize::from(dice.chance(0.3))];
        self.homing = Some(format!(
            "kind = \"switch\"\nswitches = [\"{name} {}\"]\ndirection = \"{direction}\"\n\
             speed = {speed}\nslow_speed = {slow_speed}\nback_off = {}\nposition = {edge}\n\
             final_position = {inside}\n{jogs}{latch}",
            inputs[place],
            digits(self.travel * dice.between(0.05, 1.0)),
        ));
        let before = self.simulation.take().map_or(String::new(), |it| it + ", ");
        self.simulation = Some(format!("{before}start = {start}"));
    }

    /// Following error that is a fault, mm.
    #[must_use]
    pub fn following_error(&self) -> f64 {
        digits(0.25 * self.travel)
    }

    /// What the machine file calls one of its drives.
    fn drive_name(&self, side: usize) -> String {
        format!("{}{}", self.letter, side + 1)
    }

    fn write(&self, text: &mut String) {
        let name = |side: usize| self.drive_name(side);
        for (side, drive) in self.drives.iter().enumerate() {
            let direction = if drive.negative {
                "negative"
            } else {
                "positive"
            };
            let _ = write!(
                text,
                "\n[[drive]]\nname = \"{}\"\nbus = \"bus{}\"\nnode = {}\nmodel = \"{}\"\n\
                 direction = \"{direction}\"\nzero = {}\n",
                name(side),
                drive.bus,
                drive.node,
                drive.model,
                drive.zero
            );
            if let Some(increments) = drive.ramped() {
                let ramp = self.acceleration / self.travel * increments;
                let _ = writeln!(text, "sdo = [[\"6085:0\", {}]]", ramp.ceil());
            }
            for wire in &drive.wires {
                wire.write("drive", &name(side), text);
            }
        }
        let names: Vec<String> = (0..self.drives.len())
            .map(|side| format!("\"{}\"", name(side)))
            .collect();
        let rotary = matches!(self.letter, 'A' | 'B' | 'C');
        let gear = if rotary { 360.0 / self.travel } else { 1.0 };
        let pitch = if rotary { 360.0 } else { self.travel };
        let [least, most] = self.soft_limits;
        let following_error = self.following_error();
        let _ = write!(
            text,
            "\n[[axis]]\nname = \"{}\"\ndrives = [{}]\npitch = {pitch}\ngear = {gear}\n\
             max_velocity = {}\nmax_acceleration = {}\nmax_jerk = {}\nsoft_limits = [{least}, {most}]\n\
             following_error_limit = {following_error}\nstandstill_window = {}\n\
             drive_following_error = {supervised}\n",
            self.letter,
            names.join(", "),
            self.velocity,
            self.acceleration,
            self.jerk,
            digits(0.02 * self.travel),
            supervised = self.supervised,
        );
        // The drives of an axis that is homed do not know its machine positions.
        if self.homing.is_none() {
            let _ = writeln!(text, "drive_soft_limits = {}", self.supervised);
        }
        if self.drives.len() == 2 {
            let _ = writeln!(text, "skew_limit = {}", digits(0.1 * self.travel));
        }
        if let Some(inside) = &self.simulation {
            let _ = writeln!(text, "simulation = {{ {inside} }}");
        }
        if let Some(inside) = &self.homing {
            let _ = writeln!(text, "\n[axis.homing]\n{inside}");
        }
    }
}

/// A number as people write it: to four digits or so.
fn digits(value: f64) -> f64 {
    let magnitude = value.abs();
    let decimals = [1000.0, 100.0, 10.0, 1.0, 0.1, 0.01];
    let decimals = decimals.iter().filter(|it| magnitude < **it).count();
    rounded(value, decimals)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Layout;

    #[test]
    fn every_machine_that_is_drawn_is_a_good_one() {
        let (mut gantries, mut buses, mut most) = (0, 0, 0);
        for seed in 0..300 {
            let spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            let machine = spec
                .machine()
                .unwrap_or_else(|wrong| panic!("{seed}: {wrong}"));
            Layout::new(&machine).unwrap();
            gantries += usize::from(spec.drives() > spec.axes.len());
            buses += usize::from(spec.buses.len() > 1);
            most = most.max(spec.axes.len());
        }
        assert!(
            gantries > 30 && buses > 30 && most == 9,
            "{gantries} {buses} {most}"
        );
    }

    #[test]
    fn whatever_is_wired_is_good() {
        let (mut wires, mut homed, mut switches) = (0, 0, 0);
        for seed in 0..300 {
            let mut spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            spec.wire(&mut Dice::new(seed, 5));
            spec.equip(&mut Dice::new(seed, 9));
            spec.home(&mut Dice::new(seed, 10));
            wires += spec.wires().count();
            homed += spec.axes.iter().filter(|it| it.homing.is_some()).count();
            switches += spec.wires().filter(|(_, wire)| wire.is_home()).count();
            spec.machine()
                .unwrap_or_else(|wrong| panic!("{seed}: {wrong}"));
        }
        assert!(
            wires > 300 && homed > 100 && switches > 50,
            "{wires} {homed} {switches}"
        );
    }

    #[test]
    fn a_machine_without_an_axis_is_still_good() {
        for seed in 0..60 {
            let mut spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            spec.wire(&mut Dice::new(seed, 5));
            spec.equip(&mut Dice::new(seed, 9));
            spec.home(&mut Dice::new(seed, 10));
            while spec.axes.len() > 1 {
                spec.axes.remove(seed as usize % spec.axes.len());
                spec.leave_out_unused_buses();
                spec.machine()
                    .unwrap_or_else(|wrong| panic!("{seed}: {wrong}"));
            }
        }
    }
}
