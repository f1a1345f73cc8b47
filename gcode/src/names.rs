//! `#<_hal[name]>` and `#<_ini[table]key>`: what programs read of the machine by its names.
//!
//! The values of the machine file are known while a program is read. What is on is not: that is known once the path
//! has come to the block that asks. So the interpreter hands out [`Action::ReadSignals`](super::Action::ReadSignals)
//! before it executes such a block, and nothing behind it until it is told
//! ([`Interpreter::signals_read`](super::Interpreter::signals_read)).

use std::collections::BTreeMap;

use syncline_strict_toml::nearest;

use super::error::Fault;

/// What programs can read by name. As in all names of a program, letters have no case and blanks mean nothing.
#[derive(Clone, Debug, Default)]
pub struct MachineNames {
    /// The place of each input and output.
    signals: BTreeMap<String, Named<usize>>,
    /// Values, by `table]key`; `None` for one that is no number.
    values: BTreeMap<String, Named<Option<f64>>>,
}

/// What a name stands for.
#[derive(Clone, Copy, Debug)]
enum Named<T> {
    One(T),
    /// Several are called so.
    Several,
}

impl<T> Named<T> {
    /// What is meant, if that is clear.
    fn one(&self) -> Option<&T> {
        match self {
            Named::One(meant) => Some(meant),
            Named::Several => None,
        }
    }
}

fn add<T>(names: &mut BTreeMap<String, Named<T>>, name: &str, meant: T) {
    names
        .entry(plain(name))
        .and_modify(|known| *known = Named::Several)
        .or_insert(Named::One(meant));
}

/// A name as programs write it.
fn plain(name: &str) -> String {
    let blank = |character: &char| !matches!(character, ' ' | '\t');
    name.chars()
        .filter(blank)
        .collect::<String>()
        .to_lowercase()
}

/// A name of a program, if it is one of these.
enum Name<'n> {
    /// An input or output.
    Signal(&'n str),
    /// A value: `table]key`.
    Value(&'n str),
}

impl<'n> Name<'n> {
    fn of(name: &'n str) -> Option<Self> {
        match name.split_once('[')? {
            ("_hal", rest) => Some(Name::Signal(rest.strip_suffix(']').unwrap_or(rest))),
            ("_ini", rest) => Some(Name::Value(rest)),
            _ => None,
        }
    }
}

/// Whether a name of a program is that of an input or output.
pub(crate) fn is_signal(name: &str) -> bool {
    matches!(Name::of(name), Some(Name::Signal(_)))
}

impl MachineNames {
    /// Inputs and outputs, in the order in which they are told later; and values, each with its table and key.
    pub fn new<'n>(
        signals: impl Iterator<Item = &'n str>,
        values: impl Iterator<Item = (String, String, Option<f64>)>,
    ) -> Self {
        let mut names = MachineNames::default();
        for (place, name) in signals.enumerate() {
            add(&mut names.signals, name, place);
        }
        for (table, key, value) in values {
            add(&mut names.values, &format!("{table}]{key}"), value);
        }
        names
    }

    /// What a name of a program stands for, with what the inputs and outputs are.
    pub(crate) fn value(&self, name: &str, signals: Option<&[f64]>) -> Option<f64> {
        match Name::of(name)? {
            Name::Signal(name) => {
                let place = *self.signals.get(name)?.one()?;
                signals?.get(place).copied()
            }
            Name::Value(name) => *self.values.get(name)?.one()?,
        }
    }

    /// Why a name of a program cannot be read.
    pub(crate) fn refusal(&self, name: &str) -> Option<Fault> {
        let written = || format!("#<{name}>");
        let (known, one) = match Name::of(name) {
            Some(Name::Signal(name)) => {
                let found = self.signals.get(name);
                (found.is_some(), found.is_some_and(|it| it.one().is_some()))
            }
            Some(Name::Value(name)) => match self.values.get(name) {
                Some(Named::One(None)) => return Some(Fault::NoNumber(written())),
                found => (found.is_some(), found.is_some_and(|it| it.one().is_some())),
            },
            None => return Some(Fault::ParameterUnset(name.to_owned())),
        };
        match (known, one) {
            (_, true) => None,
            (true, false) => Some(Fault::SeveralNamed(written())),
            (false, false) => Some(Fault::NoSuchName {
                name: written(),
                nearest: self.nearest(name),
            }),
        }
    }

    /// What a message says of the name that is most like one that nothing has.
    fn nearest(&self, name: &str) -> String {
        let found = match Name::of(name) {
            Some(Name::Signal(name)) => nearest(name, self.signals.keys().map(String::as_str))
                .map(|name| format!("#<_hal[{name}]>")),
            Some(Name::Value(name)) => nearest(name, self.values.keys().map(String::as_str))
                .map(|name| format!("#<_ini[{name}>")),
            None => None,
        };
        found.map_or_else(
            || "there is nothing of the kind".to_owned(),
            |name| format!("the nearest is {name}"),
        )
    }
}
