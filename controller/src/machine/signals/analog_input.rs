//! `[[input]]` with `full_scale`: an analog input of an I/O node.

use super::{Kind, Wire, Wiring};
use std::ops::Range;
use syncline_drives::twin::Course;
use syncline_gcode::ANALOG_INPUTS;
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// An analog input of an I/O node, which programs read.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalogInput {
    /// As the machine file names it.
    pub name: String,
    /// Index of its device in [`Machine::nodes`](crate::machine::Machine::nodes).
    pub node: usize,
    /// Which of the device's analog inputs.
    pub place: usize,
    /// What it is at the greatest value that it can take in; above zero.
    pub full_scale: f64,
    /// E of M66, below [`ANALOG_INPUTS`]; no two have the same.
    pub number: u8,
    /// What it is over time where its node is simulated: seconds since that was switched on, and its value then.
    pub simulated: Vec<(f64, f64)>,
}

impl AnalogInput {
    /// What a value of the device is: the whole range of 16 bits is from the negative full scale to the positive one.
    #[must_use]
    pub fn scaled(&self, value: i16) -> f64 {
        f64::from(value) / f64::from(i16::MAX) * self.full_scale
    }

    /// What a simulated node tells over time; `None` where that is not stated.
    #[must_use]
    pub fn course(&self) -> Option<Course> {
        let told = |&(at, value): &(f64, f64)| (at, value / self.full_scale * f64::from(i16::MAX));
        let points: Vec<_> = self.simulated.iter().map(told).collect();
        (!points.is_empty()).then_some(Course(points))
    }
}

/// An analog input as the file has it.
pub(super) struct AnalogInputTable {
    pub(super) wire: Wire,
    full_scale: f64,
    number: Spanned<i64>,
    simulated: Vec<(f64, f64)>,
}

/// The latest time at which a simulated value changes, s.
const LATEST: f64 = 1e6;

impl AnalogInputTable {
    pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let wire = Wire::read(log, &mut table, "an analog input of the device: \"AI0\"");
        let unit = "(the value at the greatest that it can take in)";
        let full_scale = table.positive(log, "full_scale", unit);
        let most = ANALOG_INPUTS as i64 - 1;
        let number = table.integer_if(log, "number", 0..=most, ", E of M66");
        if number.is_none() && table.span_of("number").is_none() {
            log.report(
                table.span_of("name").unwrap_or_default(),
                format!("{}: nothing says what it is for", table.title),
                format!("allowed: `number`, E of M66, a whole number from 0 to {most}"),
            );
        }
        let most = full_scale.as_ref().map_or(0.0, |it| *it.get_ref());
        let allowed = format!(
            "[[seconds, value], …], seconds ascending from 0 to {LATEST}, values from {} to {most}",
            -most
        );
        let accept = |[at, value]: [f64; 2]| (0.0..=LATEST).contains(&at) && value.abs() <= most;
        let simulated = table.points_if(log, "simulated", &allowed, accept);
        let simulated = simulated.map_or_else(Vec::new, Spanned::into_inner);
        table.finish(log);
        Some(Self {
            wire: wire?,
            full_scale: full_scale?.into_inner(),
            number: number?,
            simulated: simulated.into_iter().map(<(f64, f64)>::from).collect(),
        })
    }
}

/// All of them, each of a signal and a number of its own.
pub(super) fn join(
    log: &mut Log<'_>,
    tables: Vec<AnalogInputTable>,
    wiring: Wiring<'_>,
) -> Vec<AnalogInput> {
    let mut inputs: Vec<AnalogInput> = Vec::new();
    for AnalogInputTable {
        wire,
        full_scale,
        number,
        simulated,
    } in tables
    {
        let place = wire.resolve(
            log,
            wiring,
            |model| model.analog_inputs,
            (|model| model.inputs, Kind::Digital),
        );
        let Some((node, place)) = place else {
            continue;
        };
        let mut twice = |span: Range<usize>, what: &str, other: &str, each: &str| {
            let problem = format!("{}: its {what} is that of input \"{other}\"", wire.title);
            log.report(span, problem, format!("allowed: each {each} once"));
        };
        let mut others = inputs.iter();
        if let Some(other) = others.find(|it| (it.node, it.place) == (node, place)) {
            twice(
                wire.signal.span(),
                "signal",
                &other.name,
                "input of a device",
            );
        }
        let own = *number.get_ref() as u8;
        if let Some(other) = inputs.iter().find(|it| it.number == own) {
            twice(
                number.span(),
                "`number`",
                &other.name,
                "number of an analog input",
            );
        }
        inputs.push(AnalogInput {
            name: wire.name.into_inner(),
            node,
            place,
            full_scale,
            number: own,
            simulated,
        });
    }
    inputs
}
