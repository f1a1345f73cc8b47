//! `[[encoder]]`: devices that tell where an axis is and do not move it, and `feedback`, by which an
//! axis names one. One that is `measured` is on a shaft of its own.

use super::files::Files;
use super::names;
use super::node::NodeTable;
use super::read::unknown;
use super::{Axis, Machine, Motion};
use std::{ops::Range, time::Duration};
use syncline_canopen::NodeId;
use syncline_drives::model::{Assumed, Direction, Increments, Model, Scaling, Setpoints, Write};
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// An encoder on a bus.
#[derive(Clone, Debug)]
pub struct Encoder {
    /// As axes and messages name it.
    pub name: String,
    /// Index of its bus in [`Machine::buses`].
    pub bus: usize,
    /// Its node id, unique on the bus.
    pub node: NodeId,
    /// What it is.
    pub model: &'static Model,
    /// Index of the axis that it sees in [`Machine::axes`]; `None` of one that is measured, on a shaft of its own.
    pub axis: Option<usize>,
    /// The axis's, or its own shaft's, millimetres and its own increments.
    pub scaling: Scaling,
    /// How fast its own shaft turns where it is simulated, mm/s.
    pub simulated_speed: f64,
    /// It tells its position at every so many SYNCs.
    pub sync_divider: u8,
    /// Written after the standard set-up, in this order.
    pub objects: Vec<Write>,
}

/// An encoder that says where an axis is, beside its drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Its index in [`Machine::encoders`].
    pub encoder: usize,
    /// `difference_limit`: between its position and that of the drives; more is a fault. mm.
    pub difference: f64,
    /// `position_loop = "encoder"`: by its position the controller closes the loop about an axis whose
    /// drive is sent velocities.
    pub closes_loop: bool,
}

/// Encoders on shafts of their own, at most.
pub const MEASURED: usize = 4;

/// A table good on its own.
pub(super) struct EncoderTable {
    pub(super) node: NodeTable,
    /// Where the file says that it is on a shaft of its own, if it does.
    measured: Option<Range<usize>>,
    simulated_speed: f64,
    sync_divider: u8,
    pitch: f64,
    direction: Direction,
    zero: Increments,
}

impl EncoderTable {
    pub(super) fn read(
        log: &mut Log<'_>,
        files: &mut Files,
        mut table: Table<'_, '_>,
    ) -> Option<Self> {
        let node = NodeTable::read(log, files, &mut table, "encoder", Model::is_encoder);
        let unit = "(mm or degrees that the axis moves for one turn of the encoder's shaft)";
        let pitch = table.positive(log, "pitch", unit);
        let direction = super::read::direction(log, &mut table);
        let zero = table.integer_or(log, "zero", 0, 0..=u32::MAX.into(), " (increments)");
        let divider = table.integer_or(log, "sync_divider", 1, 1..=240, " (SYNCs)");
        let span = table.span_of("measured").unwrap_or_default();
        let measured = table.flag_or(log, "measured", false).then_some(span);
        let allowed =
            "a number from -1000000 to 1000000 (mm/s or °/s), of an encoder that is `measured`";
        let is_speed = |speed: f64| measured.is_some() && speed.abs() <= 1e6;
        let speed = table.number_if(log, "simulated_speed", allowed, is_speed);
        table.finish(log);
        Some(Self {
            node: node?,
            measured,
            sync_divider: divider as u8,
            simulated_speed: speed.map_or(0.0, Spanned::into_inner),
            pitch: pitch?.into_inner(),
            direction,
            zero: Increments::new(zero),
        })
    }

    pub(super) fn join(self, bus: usize, axis: Option<usize>, assumed: &Assumed) -> Encoder {
        let model = self.node.model;
        Encoder {
            name: self.node.name.into_inner(),
            bus,
            node: self.node.node.into_inner(),
            model,
            axis,
            scaling: Scaling::new(
                (model.increments_per_revolution)(assumed),
                self.pitch,
                self.direction,
                self.zero,
            ),
            simulated_speed: self.simulated_speed,
            sync_divider: self.sync_divider,
            objects: self.node.objects,
        }
    }
}

/// What an axis says of its encoder, good on its own.
pub(super) struct FeedbackTable {
    pub(super) name: Spanned<String>,
    pub(super) difference: f64,
    /// Where the file says that it closes the position loop, if it does.
    pub(super) closes_loop: Option<Range<usize>>,
}

impl FeedbackTable {
    /// Reads `feedback` and `difference_limit` of an axis, which come together, and `position_loop`.
    pub(super) fn read(log: &mut Log<'_>, table: &mut Table<'_, '_>, unit: &str) -> Option<Self> {
        let allowed = "the `name` of an [[encoder]]";
        let name = table.text_if(log, "feedback", allowed, |_| true);
        let sources = ["drive", "encoder"].into_iter();
        let source = table.choice_or(log, "position_loop", "drive", sources);
        let closes_loop = (source == "encoder").then(|| table.span_of("position_loop"));
        let closes_loop = closes_loop.map(Option::unwrap_or_default);
        let Some(name) = name else {
            if let Some(span) = closes_loop {
                log.report(
                    span,
                    format!("{}: `position_loop` without `feedback`", table.title),
                    "allowed: \"encoder\" only where `feedback` names an [[encoder]]",
                );
            }
            if let Some(difference) = table.positive_if(log, "difference_limit", unit) {
                log.report(
                    difference.span(),
                    format!("{}: `difference_limit` without `feedback`", table.title),
                    "allowed: only where `feedback` names an [[encoder]]",
                );
            }
            return None;
        };
        let unit = format!("{unit}, between its encoder and its drives");
        let difference = table.positive(log, "difference_limit", &unit)?;
        Some(Self {
            name,
            difference: difference.into_inner(),
            closes_loop,
        })
    }

    /// Whether the controller has a loop about the axis that the encoder could close.
    pub(super) fn check_loop(
        &self,
        log: &mut Log<'_>,
        title: &str,
        drives: impl ExactSizeIterator<Item = &'static Model>,
        homes: bool,
    ) {
        let Some(span) = &self.closes_loop else {
            return;
        };
        let several = drives.len() > 1;
        let positions = drives
            .into_iter()
            .find(|it| it.is_sent(Setpoints::Positions));
        let (problem, help) = if let Some(model) = positions {
            let problem = format!("its {} closes the position loop itself", model.title);
            (
                problem,
                "leave the key out: the encoder is a second opinion then",
            )
        } else if several {
            let problem = "one encoder says nothing about each side of a gantry pair".to_owned();
            (problem, "leave the key out, or give the axis one drive")
        } else if homes {
            let problem = "the encoder is absolute, and the axis has an [axis.homing]".to_owned();
            (
                problem,
                "leave one of them out: `zero` of the encoder says where the axis is",
            )
        } else {
            return;
        };
        let problem = format!("{title}: `position_loop`: {problem}");
        log.report(span.clone(), problem, help);
    }

    /// Its encoder's place among them.
    pub(super) fn find(&self, encoders: &[Encoder]) -> Option<usize> {
        let mut names = encoders.iter().map(|encoder| &encoder.name);
        names.position(|name| name == self.name.get_ref())
    }
}

/// The axis that each encoder sees: exactly one, or none of one that is measured.
pub(super) fn assign<'t>(
    log: &mut Log<'_>,
    encoders: &[EncoderTable],
    axes: impl Iterator<Item = (String, Option<&'t FeedbackTable>)>,
) -> Vec<Option<usize>> {
    let mut axis_of: Vec<Option<usize>> = vec![None; encoders.len()];
    let mut wrong = Vec::new();
    for (index, (title, feedback)) in axes.enumerate() {
        let Some(FeedbackTable { name, .. }) = feedback else {
            continue;
        };
        let names = (encoders.iter()).map(|encoder| encoder.node.name.get_ref().as_str());
        match names.clone().position(|other| other == name.get_ref()) {
            None if encoders.is_empty() => log.report(
                name.span(),
                format!("{title}: there is no encoder \"{}\"", name.get_ref()),
                "add it as an [[encoder]]",
            ),
            None => unknown(log, &title, "encoder", name, names),
            Some(encoder) if encoders[encoder].measured.is_some() => log.report(
                name.span(),
                format!(
                    "{title}: encoder \"{}\" is `measured`, and no axis' feedback",
                    name.get_ref()
                ),
                "leave one of them out",
            ),
            Some(encoder) if axis_of[encoder].is_some() => log.report(
                name.span(),
                format!(
                    "{title}: encoder \"{}\" already sees another axis",
                    name.get_ref()
                ),
                "allowed: each encoder once",
            ),
            Some(encoder) => {
                axis_of[encoder] = Some(index);
                continue;
            }
        }
        wrong.push(name.get_ref().as_str());
    }
    let unused = encoders
        .iter()
        .zip(&axis_of)
        .filter(|(encoder, axis)| axis.is_none() && encoder.measured.is_none());
    let unused = unused.map(|(encoder, _)| encoder.node.name.get_ref().as_str());
    let unused = names::not_meant(unused.collect(), wrong);
    for encoder in encoders {
        if unused.contains(&encoder.node.name.get_ref().as_str()) {
            log.report(
                encoder.node.name.span(),
                format!("{}: no axis names it", encoder.node.title()),
                "name it as the `feedback` of an [[axis]], say that it is `measured`, or remove it",
            );
        }
    }
    check_measured(log, encoders);
    axis_of
}

/// Whether the encoders that are measured have names that a table can have columns for, and are few enough.
fn check_measured(log: &mut Log<'_>, encoders: &[EncoderTable]) {
    let measured = encoders
        .iter()
        .filter_map(|it| Some((it, it.measured.as_ref()?)));
    for (place, (encoder, span)) in measured.enumerate() {
        let is_plain = |it: char| it.is_ascii_alphanumeric() || it == '_' || it == '-';
        let title = encoder.node.title();
        if !encoder.node.name.get_ref().chars().all(is_plain) {
            log.report(
                encoder.node.name.span(),
                format!("{title}: the trace has a column of that name"),
                "allowed: letters and digits, - and _",
            );
        }
        if place == MEASURED {
            let problem = format!("{title}: more than {MEASURED} encoders are `measured`");
            log.report(span.clone(), problem, "leave one of them out");
        }
    }
}

/// Between two positions of a device, at most: as the longest cycle that there is.
pub(super) const OFTEN_ENOUGH: Duration = Duration::from_millis(20);

/// Whether an encoder that does not answer every SYNC answers often enough for what looks at it, `range` being how far
/// its axis may go until the reading repeats.
fn check_divider(
    log: &mut Log<'_>,
    machine: &Machine,
    encoder: &Encoder,
    range: Option<f64>,
    place: &Range<usize>,
) {
    let apart = machine.cycle * encoder.sync_divider.into();
    let axis = encoder.axis.map(|axis| &machine.axes[axis]);
    let closes_loop = axis
        .and_then(|axis| axis.feedback)
        .is_some_and(|it| it.closes_loop);
    let travel = axis.map_or(0.0, |axis| axis.limits.velocity * apart.as_secs_f64());
    let problem = if encoder.sync_divider == 1 {
        return;
    } else if closes_loop {
        "it closes a position loop, which asks for a position at every SYNC".to_owned()
    } else if apart > OFTEN_ENOUGH {
        format!(
            "its positions would be {} ms apart, more than {} ms",
            apart.as_secs_f64() * 1e3,
            OFTEN_ENOUGH.as_secs_f64() * 1e3
        )
    } else if let Some(range) = range.filter(|range| travel >= range / 2.0) {
        format!(
            "its axis may go {travel:.3} from one position to the next, which is not less than half of {range:.3}"
        )
    } else {
        return;
    };
    let problem = format!(
        "encoder \"{}\": `sync_divider` is {}: {problem}",
        encoder.name, encoder.sync_divider
    );
    log.report(
        place.clone(),
        problem,
        "allowed: a smaller one; 1 asks for a position at every SYNC",
    );
}

/// Whether each encoder tells every place of its axis from every other one, and finely enough. `places`
/// are where the file names them.
pub(super) fn check(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for (index, (encoder, place)) in machine.encoders.iter().zip(places).enumerate() {
        let device = machine.device(machine.drives.len() + index);
        let range = device.feedback().and_then(|it| it.range());
        let range = range.map(|range| range.get() as f64 * encoder.scaling.resolution());
        check_divider(log, machine, encoder, range, place);
        let Some(axis) = encoder.axis.map(|axis| &machine.axes[axis]) else {
            continue;
        };
        let unit = axis.units()[0];
        let (name, title) = (&encoder.name, encoder.model.title);
        let (least, most) = axis.limits.position;
        let resolution = encoder.scaling.resolution();
        if let Some(range) = range.filter(|range| most - least >= *range) {
            log.report(
                place.clone(),
                format!(
                    "encoder \"{name}\": the {title} tells {range:.3} {unit} apart, and axis {} moves \
                     {:.3} {unit}",
                    axis.name(),
                    most - least
                ),
                "allowed: a `pitch`, and `soft_limits` of the axis, that keep it within its range",
            );
        }
        if let Some(feedback) = axis.feedback.filter(|it| it.difference < resolution) {
            log.report(
                place.clone(),
                format!(
                    "encoder \"{name}\": an increment of {resolution} {unit} is more than the \
                     `difference_limit` of {} {unit}",
                    feedback.difference
                ),
                format!("allowed: a `difference_limit` of more than {resolution} {unit}"),
            );
        }
    }
}

impl Machine {
    /// The encoders on shafts of their own, each with its place among the [devices](Self::nodes).
    pub fn measured(&self) -> impl Iterator<Item = (usize, &Encoder)> {
        let encoders = self.encoders.iter().enumerate();
        let measured = encoders.filter(|(_, encoder)| encoder.axis.is_none());
        measured.map(|(place, encoder)| (self.drives.len() + place, encoder))
    }

    /// Whether the controller closes a position loop about an axis, by its index.
    #[must_use]
    pub fn closes_loop(&self, axis: usize) -> bool {
        let axis = &self.axes[axis];
        let mut drives = axis.drives.iter().map(|&drive| &self.drives[drive]);
        axis.motion == Motion::Path && drives.any(|it| it.model.is_sent(Setpoints::Velocities))
    }

    /// For how long a device's position may be missing by which the controller closes a loop, where that is stated.
    #[must_use]
    pub fn position_loss(&self, device: usize) -> Option<Duration> {
        self.axes.iter().find_map(|axis| {
            let encoder = axis.feedback.filter(|feedback| feedback.closes_loop);
            let tells = match encoder {
                Some(feedback) => device == self.drives.len() + feedback.encoder,
                None => axis.drives.contains(&device),
            };
            axis.position_loss.filter(|_| tells)
        })
    }
}

impl Axis {
    /// Where its travel has its middle, mm.
    #[must_use]
    pub fn middle(&self) -> f64 {
        let (least, most) = self.limits.position;
        least + (most - least) / 2.0
    }
}
