//! Limit switches that are wired to inputs of the machine: `negative_limit` and `positive_limit` of an axis.

use super::{Axis, HomingMethod, Input, InputMeaning, Machine, Motion};
use std::ops::Range;
use syncline_strict_toml::{Log, Table, nearest, one_of};
use toml::Spanned;

/// The keys, by the end of the travel that each is about.
const KEYS: [&str; 2] = ["negative_limit", "positive_limit"];

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
    let mut taken = vec![false; inputs.len()];
    for (axis, LimitTable(ends)) in axes.iter_mut().zip(tables) {
        for (end, names) in ends.iter().enumerate() {
            for name in names.iter().flat_map(|names| names.get_ref()) {
                let Some(input) = limit_input(log, axis.name(), name, inputs) else {
                    continue;
                };
                if std::mem::replace(&mut taken[input], true) {
                    log.report(
                        name.span(),
                        format!(
                            "axis \"{}\": limit switch \"{}\" a second time",
                            axis.name(),
                            name.get_ref()
                        ),
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

/// The input of that name, if it is a limit switch.
fn limit_input(
    log: &mut Log<'_>,
    axis: &str,
    name: &Spanned<String>,
    inputs: &[Input],
) -> Option<usize> {
    let limit = |input: &&Input| input.meaning == InputMeaning::Limit;
    let found = inputs.iter().position(|it| it.name == *name.get_ref());
    let found = found.filter(|&index| limit(&&inputs[index]));
    if found.is_none() {
        let names = inputs.iter().filter(limit).map(|input| input.name.as_str());
        let help = match nearest(name.get_ref(), names.clone()) {
            Some(near) => format!("allowed: {}; nearest: \"{near}\"", one_of(names)),
            None => "add an [[input]] with `function = \"limit\"`".to_owned(),
        };
        log.report(
            name.span(),
            format!(
                "axis \"{axis}\": there is no limit switch \"{}\"",
                name.get_ref()
            ),
            help,
        );
    }
    found
}
