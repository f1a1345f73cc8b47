//! Work that several processes share.

use std::str::FromStr;

/// A share of what is numbered: every [`parts`](Self::parts)-th, beginning with [`part`](Self::part).
#[derive(Clone, Copy, Debug)]
pub(super) struct Shard {
    /// From 0.
    pub(super) part: u64,
    /// How many shares there are.
    pub(super) parts: u64,
}

/// All of it.
impl Default for Shard {
    fn default() -> Self {
        Self { part: 0, parts: 1 }
    }
}

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (part, parts) = text.split_once('/').ok_or("write I/N")?;
        let number = |text: &str| text.parse().map_err(|_| "write whole numbers");
        let shard = Self {
            part: number(part)?,
            parts: number(parts)?,
        };
        if shard.part >= shard.parts {
            return Err("I is from 0 to N - 1");
        }
        Ok(shard)
    }
}
