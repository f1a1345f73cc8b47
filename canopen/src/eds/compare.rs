//! Where two data sheets differ, told object by object.

use super::{Access, Eds, Parameter, Value};
use crate::dictionary::Address;
use core::fmt;

/// One point in which a user's EDS departs from a built-in one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The object.
    pub address: Address,
    /// In what respect.
    pub aspect: Aspect,
}

/// A respect in which two data sheets differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// The user's EDS lacks the object with this name.
    Missing(String),
    /// Only the user's EDS has the object, under this name.
    Unknown(String),
    /// Both have the object but say different things under this key.
    Key {
        /// The key in the EDS.
        key: &'static str,
        /// What the user's EDS says.
        theirs: String,
        /// What is built in.
        ours: String,
    },
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ", self.address)?;
        match &self.aspect {
            Aspect::Missing(name) => write!(f, "{name}: built in, not in the EDS"),
            Aspect::Unknown(name) => write!(f, "{name}: in the EDS, not built in"),
            Aspect::Key { key, theirs, ours } => write!(f, "{key}: {theirs}, built in {ours}"),
        }
    }
}

impl Eds {
    /// Where a user's EDS departs from this one: objects, types, access, mappability, and what both
    /// state of its direction, of limits and defaults. Names are free, and so is all that is of no object.
    #[must_use]
    pub fn compare(&self, theirs: &Self) -> Vec<Difference> {
        let mut differences = Vec::new();
        for (address, ours) in self.parameters() {
            match theirs.parameter(address) {
                Some(theirs) => {
                    let aspects = ours.compare(theirs).into_iter().flatten();
                    differences.extend(aspects.map(|aspect| Difference { address, aspect }));
                }
                None => differences.push(Difference {
                    address,
                    aspect: Aspect::Missing(ours.name.clone()),
                }),
            }
        }
        let extra = theirs.parameters();
        let extra = extra.filter(|&(address, _)| self.parameter(address).is_none());
        differences.extend(extra.map(|(address, parameter)| Difference {
            address,
            aspect: Aspect::Unknown(parameter.name.clone()),
        }));
        differences.sort_by_key(|difference| difference.address);
        differences
    }

    fn parameter(&self, address: Address) -> Option<&Parameter> {
        self.objects.get(&address.index)?.subs.get(&address.sub)
    }
}

impl Parameter {
    fn compare(&self, theirs: &Self) -> [Option<Aspect>; 6] {
        let key = |key, ours: &dyn fmt::Display, theirs: &dyn fmt::Display| {
            Some(Aspect::Key {
                key,
                theirs: theirs.to_string(),
                ours: ours.to_string(),
            })
        };
        let stated = |name, ours: &Option<Value>, theirs: &Option<Value>| match (ours, theirs) {
            (Some(ours), Some(theirs)) if ours != theirs => key(name, ours, theirs),
            _ => None,
        };
        let mut aspects = [const { None }; 6];
        if self.data_type != theirs.data_type {
            let code = |data_type: u16| format!("{data_type:04X}h");
            aspects[0] = key("DataType", &code(self.data_type), &code(theirs.data_type));
        }
        let opposite = matches!(
            (self.access, theirs.access),
            (Access::Rwr, Access::Rww) | (Access::Rww, Access::Rwr)
        );
        if self.access.by_sdo() != theirs.access.by_sdo() || opposite {
            aspects[1] = key("AccessType", &self.access, &theirs.access);
        }
        if self.pdo_mapping != theirs.pdo_mapping {
            let flag = |mapped: bool| u8::from(mapped);
            aspects[2] = key(
                "PDOMapping",
                &flag(self.pdo_mapping),
                &flag(theirs.pdo_mapping),
            );
        }
        aspects[3] = stated("LowLimit", &self.low, &theirs.low);
        aspects[4] = stated("HighLimit", &self.high, &theirs.high);
        aspects[5] = stated("DefaultValue", &self.default, &theirs.default);
        aspects
    }
}
