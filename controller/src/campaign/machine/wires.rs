//! What is wired to the inputs and outputs of a random machine, and its I/O nodes.

use super::super::dice::Dice;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

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
pub(super) const INPUTS: [&str; 4] = [DOOR, FEED_HOLD, "function = \"cycle_start\"", ENABLE];
const DOOR: &str = "function = \"door\"\ndebounce_ms = 20";
const FEED_HOLD: &str = "function = \"feed_hold\"";
const ENABLE: &str = "function = \"enable\"\nactive_low = true";

/// What the names of analog inputs begin with.
const ANALOG_INPUT: &str = "AI";

/// What an input means by which an axis is homed.
pub(super) const HOME: &str = "function = \"home\"";

/// The same of outputs.
pub(super) const OUTPUTS: [&str; 4] = [
    "function = \"spindle\"",
    "function = \"mist\"",
    "function = \"flood\"\nactive_low = true",
    "function = \"spindle_reverse\"\nactive_low = true",
];

impl Wire {
    /// Whether it is the switch by which an axis is homed.
    pub(in super::super) fn is_home(&self) -> bool {
        self.meaning.starts_with(HOME)
    }

    /// Whether it is an input that is on or off.
    pub(in super::super) fn is_digital_input(&self) -> bool {
        self.table == "input" && !self.signal.starts_with(ANALOG_INPUT)
    }

    /// Whether the path is held while it is on: a door, or an operator's input.
    pub(in super::super) fn holds(&self) -> bool {
        [DOOR, FEED_HOLD].contains(&&self.meaning[..])
    }

    /// Whether the drives may be enabled while it is on alone.
    pub(in super::super) fn is_enable(&self) -> bool {
        self.meaning == ENABLE
    }

    /// Whether a machine is not what it is taken for where somebody else switches it: its drives may not be enabled without it, or an axis
    /// is homed by it.
    pub(in super::super) fn misleads(&self) -> bool {
        self.is_enable() || self.is_home()
    }

    /// Of a device that the key names.
    pub(super) fn write(&self, key: &str, device: &str, text: &mut String) {
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
    pub(super) fn draw(dice: &mut Dice, bus: usize, words: bool, place: u8) -> Self {
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

    /// A digital output to which nothing is wired.
    pub(super) fn spare_output(&self) -> Option<u8> {
        let is_used = |place: u8| {
            let signal = format!("DO{place}");
            self.wires.iter().any(|wire| wire.signal == signal)
        };
        (0..16).find(|place| !is_used(*place))
    }

    /// Wires the enable chain to an output to spare.
    pub(super) fn chain(&mut self) {
        if let Some(place) = self.spare_output() {
            self.wires.push(Wire {
                table: "output".to_owned(),
                place,
                signal: format!("DO{place}"),
                meaning: "function = \"enable_chain\"".to_owned(),
            });
        }
    }

    /// Gives it analog inputs that change over time, with numbers of their own.
    pub(super) fn measure(&mut self, dice: &mut Dice, place: u8) {
        for signal in 0..2 {
            if dice.chance(0.5) {
                let number = 2 * place + signal;
                let course: Vec<_> = (0..dice.whole(1..=4))
                    .map(|at| format!("[{}, {:.2}]", 3 * at, dice.between(-10.0, 10.0)))
                    .collect();
                self.wires.push(Wire {
                    table: "input".to_owned(),
                    place: signal,
                    signal: format!("{ANALOG_INPUT}{signal}"),
                    meaning: format!(
                        "{NUMBER}{number}\nfull_scale = 10.0\nsimulated = [{}]",
                        course.join(", ")
                    ),
                });
            }
        }
    }

    /// What the machine file calls it.
    pub(super) fn name(place: usize) -> String {
        format!("io{place}")
    }

    pub(super) fn write(&self, place: usize, text: &mut String) {
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

/// What a number means of which programs know.
pub(super) const NUMBER: &str = "number = ";

/// What inputs, or outputs, may mean: each function once, and numbers without end.
pub(super) struct Meanings {
    functions: Vec<&'static str>,
    next: u8,
}

impl Meanings {
    pub(super) fn of(functions: [&'static str; 4]) -> Self {
        Self {
            functions: functions.to_vec(),
            next: 0,
        }
    }

    pub(super) fn draw(&mut self, dice: &mut Dice) -> String {
        if !self.functions.is_empty() && dice.chance(0.5) {
            let place = dice.below(self.functions.len());
            return self.functions.swap_remove(place).to_owned();
        }
        self.next += 1;
        format!("{NUMBER}{}", self.next - 1)
    }
}
