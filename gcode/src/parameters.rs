//! Parameters that a program sets and reads: `#1`, `#<name>`, `#<_global>`.

use std::collections::BTreeMap;

use super::error::Fault;
use super::words::whole;

/// The greatest parameter number.
const LAST: usize = 5602;
/// `#1` to `#30` are a subroutine's own.
const ARGUMENTS: usize = 30;

/// What the last M66 found.
pub(crate) const INPUT_RESULT: usize = 5399;

/// Whether `#5399` is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum InputResult {
    #[default]
    Known,
    /// The machine knows it, once it has come to the block that asks.
    Asked,
    /// Its M66 was passed, as the program was begun behind it.
    Passed,
}

/// The number of a parameter.
pub(crate) fn index(value: f64) -> Result<usize, Fault> {
    match whole(value, 1e-4) {
        Some(number) if (1..=LAST).contains(&(number as usize)) => Ok(number as usize),
        _ => Err(Fault::ParameterIndex(value)),
    }
}

/// The parameters' values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parameters {
    numbered: Vec<f64>,
    globals: BTreeMap<String, f64>,
    locals: BTreeMap<String, f64>,
    /// What the last ENDSUB or RETURN handed back.
    result: Option<f64>,
}

/// A caller's own parameters while its subroutine has the floor.
#[derive(Debug)]
pub(crate) struct Caller {
    arguments: [f64; ARGUMENTS],
    locals: BTreeMap<String, f64>,
}

impl Default for Parameters {
    fn default() -> Self {
        Parameters {
            numbered: vec![0.0; LAST + 1],
            globals: BTreeMap::new(),
            locals: BTreeMap::new(),
            result: None,
        }
    }
}

impl Parameters {
    pub(crate) fn numbered(&self, index: usize) -> f64 {
        self.numbered.get(index).copied().unwrap_or_default()
    }

    pub(crate) fn set_numbered(&mut self, index: usize, value: f64) -> Result<(), Fault> {
        match self.numbered.get_mut(index) {
            Some(parameter) if index <= 5000 => {
                *parameter = value;
                Ok(())
            }
            _ => Err(Fault::ParameterReadOnly(format!("#{index}"))),
        }
    }

    /// Sets a parameter that programs only read.
    pub(crate) fn show(&mut self, index: usize, value: f64) {
        if let Some(parameter) = self.numbered.get_mut(index) {
            *parameter = value;
        }
    }

    /// A named parameter: global if its name begins with `_`.
    pub(crate) fn named(&self, name: &str) -> Option<f64> {
        match name {
            "_value" => Some(self.result.unwrap_or_default()),
            "_value_returned" => Some(f64::from(u8::from(self.result.is_some()))),
            _ if name.starts_with('_') => self.globals.get(name).copied(),
            _ => self.locals.get(name).copied(),
        }
    }

    pub(crate) fn set_named(&mut self, name: &str, value: f64) {
        let names = if name.starts_with('_') {
            &mut self.globals
        } else {
            &mut self.locals
        };
        match names.get_mut(name) {
            Some(parameter) => *parameter = value,
            None => {
                names.insert(name.to_owned(), value);
            }
        }
    }

    /// Gives a subroutine its arguments as `#1` … and no named parameters of its own; what it does
    /// not get keeps the caller's value.
    pub(crate) fn call(&mut self, arguments: &[f64]) -> Caller {
        let own = &mut self.numbered[1..=ARGUMENTS];
        let mut caller = Caller {
            arguments: [0.0; ARGUMENTS],
            locals: std::mem::take(&mut self.locals),
        };
        caller.arguments.copy_from_slice(own);
        for (parameter, argument) in own.iter_mut().zip(arguments) {
            *parameter = *argument;
        }
        caller
    }

    /// Gives the caller its own back, with the subroutine's result.
    pub(crate) fn return_to(&mut self, caller: Caller, result: Option<f64>) {
        self.numbered[1..=ARGUMENTS].copy_from_slice(&caller.arguments);
        self.locals = caller.locals;
        self.result = result;
    }
}
