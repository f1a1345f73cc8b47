//! Parameters that a program sets and reads: `#1`, `#<name>`, `#<_global>`.

use std::collections::BTreeMap;

use super::error::Fault;
use super::words::whole;

/// The greatest parameter number.
const LAST: usize = 5602;

/// The number of a parameter.
pub(crate) fn index(value: f64) -> Result<usize, Fault> {
    match whole(value, 1e-4) {
        Some(number) if (1..=LAST).contains(&(number as usize)) => Ok(number as usize),
        _ => Err(Fault::ParameterIndex(value)),
    }
}

/// The parameters' values.
#[derive(Debug)]
pub(crate) struct Parameters {
    numbered: Vec<f64>,
    globals: BTreeMap<String, f64>,
    locals: BTreeMap<String, f64>,
}

impl Default for Parameters {
    fn default() -> Self {
        Parameters {
            numbered: vec![0.0; LAST + 1],
            globals: BTreeMap::new(),
            locals: BTreeMap::new(),
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

    /// A named parameter: global if its name begins with `_`.
    pub(crate) fn named(&self, name: &str) -> Option<f64> {
        let names = if name.starts_with('_') {
            &self.globals
        } else {
            &self.locals
        };
        names.get(name).copied()
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
}
