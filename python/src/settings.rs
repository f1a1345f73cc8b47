//! `set`: other values of keys of the machine file.

use pyo3::prelude::*;
use std::collections::BTreeMap;

/// `{"axis.X.max_jerk": 40000}`.
pub(crate) type Settings = BTreeMap<String, Value>;

/// A value as TOML knows it.
#[derive(FromPyObject)]
pub(crate) enum Value {
    Bool(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    List(Vec<Value>),
}

impl From<Value> for toml::Value {
    fn from(value: Value) -> Self {
        match value {
            Value::Bool(it) => it.into(),
            Value::Integer(it) => it.into(),
            Value::Number(it) => it.into(),
            Value::Text(it) => it.into(),
            Value::List(it) => Self::Array(it.into_iter().map(Self::from).collect()),
        }
    }
}

/// Each as `--set` has it.
pub(crate) fn key_values(set: Option<Settings>) -> Vec<String> {
    let set = set.into_iter().flatten();
    set.map(|(key, value)| format!("{key}={}", toml::Value::from(value)))
        .collect()
}
