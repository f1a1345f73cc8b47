//! Limit switches that are wired to inputs of the machine: `negative_limit` and `positive_limit` of an axis.

use super::{Axis, HomingMethod, Input, InputMeaning, Machine, Motion, signals};
use std::ops::Range;
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// The keys, by the end of the travel that each is about.
const KEYS: [&str; 2] = ["negative_limit", "positive_limit"];

/// What they are, and the `function` of their inputs.
const KIND: (&str, &str) = ("limit switch", "limit");

/// The limit switches of an axis as the file names them, by end.
pub(super) struct LimitTable([Option<Spanned<Vec<Spanned<String>>>>; 2]);

impl LimitTable {
    pub(super) fn read(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Self {
        let allowed = "the name of one [[input]] with `function = \"limit\"`, or of two";
        Self(KEYS.map(|key| table.texts_if(log, key, allowed, 1..=2)))
    }
}

/// Gives each axis the limit switches of its table: inputs of the machine, each of one axis and one end.
pub(super) fn join(
    log: &mut Log<'_>,
    axes: &mut [Axis],
    tables: &[LimitTable],
    (inputs, places): (&[Input], &[Range<usize>]),
) {
    let is_limit = |place: usize| inputs[place].meaning == InputMeaning::Limit;
    let mut taken = vec![false; inputs.len()];
    for (axis, LimitTable(ends)) in axes.iter_mut().zip(tables) {
        let title = format!("axis \"{}\"", axis.name());
        for (end, names) in ends.iter().enumerate() {
            for name in names.iter().flat_map(|names| names.get_ref()) {
                let Some(input) = signals::named(log, &title, KIND, name, inputs, is_limit) else {
                    continue;
                };
                if std::mem::replace(&mut taken[input], true) {
                    log.report(
                        name.span(),
                        format!("{title}: limit switch \"{}\" a second time", name.get_ref()),
                        "allowed: each limit switch for one end of one axis",
                    );
                }
                axis.limit_inputs[end].push(input);
            }
        }
    }
    for ((input, place), taken) in inputs.iter().zip(places).zip(&taken) {
        if input.meaning == InputMeaning::Limit && !taken {
            log.report(
                place.clone(),
                format!("input \"{}\": no axis ends at it", input.name),
                "name it in the `negative_limit` or `positive_limit` of an [[axis]], or remove it",
            );
        }
    }
}

/// Refuses limit switches of axes that do not follow the controller's setpoints all the time.
pub(super) fn check(log: &mut Log<'_>, machine: &Machine, tables: &[LimitTable]) {
    for (axis, LimitTable(ends)) in machine.axes.iter().zip(tables) {
        if let HomingMethod::HardStop(search) = &axis.homing.method
            && let Some(names) = &ends[usize::from(search.direction > 0.0)]
        {
            log.report(
                names.span(),
                format!(
                    "axis \"{}\": a limit switch in front of the hard stop by which it is homed",
                    axis.name()
                ),
                "leave it out, or home the axis by it: `kind = \"switch\"`",
            );
        }
        let by_itself = match (axis.motion, &axis.homing.method) {
            (Motion::PointToPoint, _) => "goes point to point",
            (_, HomingMethod::Drive(_)) => "is homed by its drive",
            _ => continue,
        };
        for (key, names) in KEYS.iter().zip(ends) {
            if let Some(names) = names {
                log.report(
                    names.span(),
                    format!("axis \"{}\": `{key}` of an axis that {by_itself}", axis.name()),
                    "leave it out, and wire the switch to the drive, which then supervises it by itself",
                );
            }
        }
    }
}
