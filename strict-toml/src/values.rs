//! What a document says, as numbers.

use super::table::number;
use toml::de::{DeTable, DeValue};

/// Every value of a document with its table and its key, as [`set`](super::set) names them; of an array each item, as
/// `soft_limits[0]`. A switch is 1 or 0; what is neither number nor switch is `None`. A table of a list is named by
/// its `name`; one without has no place here.
///
/// ```
/// use syncline_strict_toml::{Log, parse, values};
///
/// let text = "[[axis]]\nname = \"X\"\nsoft_limits = [0.0, 1500.0]\nsimulation = { backlash = 0.02 }\n";
/// let document = parse(&mut Log::new(text), text);
/// let found: Vec<String> = values(document.get_ref())
///     .into_iter()
///     .map(|(table, key, value)| format!("[{table}]{key}: {value:?}"))
///     .collect();
/// assert_eq!(
///     found,
///     [
///         "[axis.X]name: None",
///         "[axis.X.simulation]backlash: Some(0.02)",
///         "[axis.X]soft_limits[0]: Some(0.0)",
///         "[axis.X]soft_limits[1]: Some(1500.0)",
///     ]
/// );
/// ```
#[must_use]
pub fn values(document: &DeTable<'_>) -> Vec<(String, String, Option<f64>)> {
    let mut found = Vec::new();
    table_values("", document, &mut found);
    found
}

fn table_values(path: &str, table: &DeTable<'_>, found: &mut Vec<(String, String, Option<f64>)>) {
    let inner = |key: &str| match path {
        "" => key.to_owned(),
        _ => format!("{path}.{key}"),
    };
    for (key, value) in table {
        let key: &str = key.get_ref();
        match value.get_ref() {
            DeValue::Table(table) => table_values(&inner(key), table, found),
            DeValue::Array(items) => {
                for (index, item) in items.iter().enumerate() {
                    match item.get_ref() {
                        DeValue::Table(table) => {
                            let name = table.get("name").and_then(|name| name.get_ref().as_str());
                            if let Some(name) = name {
                                table_values(&inner(&format!("{key}.{name}")), table, found);
                            }
                        }
                        value => found.push((path.into(), format!("{key}[{index}]"), plain(value))),
                    }
                }
            }
            value => found.push((path.into(), key.to_owned(), plain(value))),
        }
    }
}

fn plain(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Boolean(on) => Some(f64::from(u8::from(*on))),
        value => number(value),
    }
}
