//! What the drives do and which inputs and outputs are on, in words, for a person at the machine.

use crate::machine::Machine;
use crate::session::{Squareness, Status};
use syncline_drives::model::PowerState;
use syncline_gcode::AxisLetter;

/// What the row of the drives is called.
pub(super) const DRIVES: &str = "drives";

/// States of power stages, those first that somebody has to look after.
const BY_URGENCY: [PowerState; 7] = [
    PowerState::Fault,
    PowerState::FaultReaction,
    PowerState::Unknown,
    PowerState::QuickStop,
    PowerState::Off,
    PowerState::Ready,
    PowerState::Enabled,
];

/// The names of drives, inputs and outputs, in the order of the machine file.
#[derive(Default)]
pub(super) struct Signals {
    pub(super) drives: Vec<String>,
    pub(super) inputs: Vec<String>,
    pub(super) analog_inputs: Vec<String>,
    pub(super) outputs: Vec<String>,
    pub(super) analog_outputs: Vec<String>,
    /// Encoders on shafts of their own.
    pub(super) measured: Vec<String>,
    /// The gantries that homing takes square: letter and unit.
    pub(super) gantries: Vec<(AxisLetter, &'static str)>,
}

impl Signals {
    pub(super) fn of(machine: &Machine) -> Self {
        let analog_inputs = &machine.analog_inputs;
        let analog_outputs = &machine.analog_outputs;
        Self {
            drives: (machine.nodes())
                .filter(|node| node.model.is_drive())
                .map(|node| node.name.to_owned())
                .collect(),
            inputs: machine.inputs.iter().map(|it| it.name.clone()).collect(),
            analog_inputs: analog_inputs.iter().map(|it| it.name.clone()).collect(),
            outputs: machine.outputs.iter().map(|it| it.name.clone()).collect(),
            analog_outputs: analog_outputs.iter().map(|it| it.name.clone()).collect(),
            measured: machine.measured().map(|(_, it)| it.name.clone()).collect(),
            gantries: (machine.axes.iter())
                .filter(|axis| axis.homing.square.is_some())
                .map(|axis| (axis.letter, axis.units()[0]))
                .collect(),
        }
    }

    /// The drives' states, how square gantries are, where encoders on shafts of their own are, the inputs that are on, and the outputs that are on or put out
    /// something: a name and what is to be told, for what the machine has.
    pub(super) fn rows(&self, status: &Status) -> Vec<(&'static str, String)> {
        let mut rows = vec![(DRIVES, self.drives_in_words(&status.drives))];
        let square = self.squareness_in_words(status);
        if !square.is_empty() {
            rows.push(("square", square));
        }
        if !self.measured.is_empty() {
            let measured = self.measured.iter().zip(status.measured.iter().flatten());
            let measured = measured.map(|(name, it)| format!("{name} {:.3}", it.position));
            rows.push(("encoders", measured.collect::<Vec<_>>().join(", ")));
        }
        if !self.inputs.is_empty() || !self.analog_inputs.is_empty() {
            let analog = self.analog_inputs.iter().zip(&status.analog_inputs);
            let analog = analog.map(|(name, value)| format!("{name} {value:.2}"));
            let inputs = on(&self.inputs, &status.inputs).chain(analog);
            rows.push(("inputs", listed(inputs.collect())));
        }
        if !self.outputs.is_empty() || !self.analog_outputs.is_empty() {
            let analog = self.analog_outputs.iter().zip(&status.analog_outputs);
            let analog = analog.filter(|(_, value)| **value != 0.0);
            let analog = analog.map(|(name, value)| format!("{name} {value}"));
            let outputs = on(&self.outputs, &status.outputs).chain(analog);
            rows.push(("outputs", listed(outputs.collect())));
        }
        rows
    }

    /// What the homing of each gantry has found, and what is square by the machine file: `X was 1.9876 mm out, stored
    /// 0.8000 mm`.
    fn squareness_in_words(&self, status: &Status) -> String {
        let gantries = self.gantries.iter().filter_map(|&(axis, unit)| {
            let Squareness { stored, measured } = status.squareness[axis.index()]?;
            let found = match measured {
                Some(apart) => format!("was {apart:.4} {unit} out"),
                None => "not measured".to_owned(),
            };
            Some(format!("{axis} {found}, stored {stored:.4} {unit}"))
        });
        gantries.collect::<Vec<_>>().join("; ")
    }

    /// Which drives are in which state, the most urgent first: `Y fault, X1 X2 enabled`.
    fn drives_in_words(&self, states: &[PowerState]) -> String {
        let groups = BY_URGENCY.iter().filter_map(|power| {
            let drives = self.drives.iter().zip(states);
            let names = drives.filter_map(|(name, state)| (state == power).then_some(&**name));
            let names: Vec<_> = names.collect();
            match names.len() {
                0 => None,
                count if count == self.drives.len() && count > 1 => Some(format!("all {power}")),
                _ => Some(format!("{} {power}", names.join(" "))),
            }
        });
        groups.collect::<Vec<_>>().join(", ")
    }
}

/// The names of those that are on.
fn on(names: &[String], levels: &[bool]) -> impl Iterator<Item = String> {
    let names = names.iter().zip(levels);
    names.filter(|(_, on)| **on).map(|(name, _)| name.clone())
}

fn listed(names: Vec<String>) -> String {
    match names.is_empty() {
        true => "none on".to_owned(),
        false => names.join(", "),
    }
}
