//! The rows of a run, packed for the script of its page.
//!
//! Every column is a sequence of whole numbers of a step; what is written is the difference from the value before, with its sign in the
//! lowest bit, seven bits a byte, and all of it is compressed. Motion is smooth, so that most values take a byte, and
//! compression halves that.
//!
//! A run of many hours has more rows than a page can hold or a screen can show. Then a stretch of rows becomes two: of every column its
//! least and its greatest value, in the order in which they came, so that no peak is lost.

use super::Report;
use crate::text::shown;
use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value, json};
use std::io::{self, Write};

/// Values that a page holds at most, over all columns.
const MOST: usize = 2_400_000;
/// Steps into which values are divided that have no unit of their own.
const STEPS: f64 = 30_000.0;
/// Steps of positions, mm, and of times, s.
const POSITION: f64 = 1e-4;
const TIME: f64 = 1e-6;

/// Columns with their names, and the text of the program, as they are written.
#[derive(Default)]
struct Packed {
    columns: Vec<Value>,
    bytes: Vec<u8>,
}

impl Packed {
    /// Of numbers that are whole multiples of a step, after rounding.
    fn push(&mut self, name: &str, step: f64, values: impl Iterator<Item = f64>) {
        let (mut before, mut count) = (0_i64, 0_usize);
        for value in values {
            count += 1;
            if !value.is_finite() {
                self.number(0);
                continue;
            }
            let whole = (value / step).round() as i64;
            let by = whole - before;
            before = whole;
            // The sign in the lowest bit; 0 is kept for what is no number.
            self.number(((by << 1) ^ (by >> 63)) as u64 + 1);
        }
        self.columns
            .push(json!({ "name": name, "step": step, "count": count }));
    }

    fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }
}

/// Which rows are shown: all of them, or of each stretch its beginning and its middle.
struct Rows {
    count: usize,
    /// Rows to a stretch; 1 where all are shown.
    stretch: usize,
}

impl Rows {
    fn new(count: usize, columns: usize) -> Self {
        let most = (MOST / columns.max(1)).max(2);
        let stretch = if count <= most {
            1
        } else {
            (2 * count).div_ceil(most)
        };
        Self { count, stretch }
    }

    /// The rows that stand for all.
    fn standing(&self) -> impl Iterator<Item = usize> {
        let (count, stretch) = (self.count, self.stretch);
        (0..count).step_by(stretch).flat_map(move |first| {
            let middle = first + stretch / 2;
            [
                Some(first),
                (stretch > 1 && middle < count).then_some(middle),
            ]
            .into_iter()
            .flatten()
        })
    }

    /// Those of the rows that stand for all.
    fn values<'a>(&'a self, values: &'a [f64]) -> impl Iterator<Item = f64> + use<'a> {
        self.standing().map(|n| at(values, n))
    }

    /// Values with no peak lost. A row without a value has none here either.
    fn peaks(&self, values: &[f64]) -> Vec<f64> {
        let mut kept = Vec::new();
        for first in (0..self.count).step_by(self.stretch) {
            let stretch = first..(first + self.stretch).min(self.count);
            let (length, one) = (stretch.len(), |n: usize| at(values, n));
            let finite = || stretch.clone().filter(|&n| one(n).is_finite());
            let by_value = |a: &usize, b: &usize| one(*a).total_cmp(&one(*b));
            let least = finite().min_by(by_value).unwrap_or(first);
            let most = finite().max_by(by_value).unwrap_or(first);
            kept.push(one(least.min(most)));
            // A stretch with a middle has two values; the last one may have none.
            if self.stretch > 1 && self.stretch / 2 < length {
                kept.push(one(least.max(most)));
            }
        }
        kept
    }
}

/// The value of a row; no number where there is none.
fn at(values: &[f64], row: usize) -> f64 {
    values.get(row).copied().unwrap_or(f64::NAN)
}

/// All rows, the ends of all blocks, and the program, as the page's script reads them.
pub(super) fn packed(report: &Report) -> io::Result<String> {
    let mut packed = Packed::default();
    let rows = Rows::new(report.time.len(), 6 + 6 * report.axes.len());
    packed.push("time", TIME, rows.values(&report.time));
    let lines: Vec<f64> = report.line.iter().map(|line| f64::from(*line)).collect();
    packed.push("line", 1.0, rows.values(&lines));
    let peaks: [(&str, &[f64]); 5] = [
        ("feed", &report.feed),
        ("turning", &report.turning),
        ("programmed", &report.programmed),
        ("rounding", &report.deviation),
        ("contour_error", &report.contour_error),
    ];
    for (name, values) in peaks {
        packed.push(name, step(values), rows.peaks(values).into_iter());
    }
    for axis in &report.axes {
        let of = |what: &str| format!("{}.{what}", axis.name);
        for (what, values) in [("set", &axis.set), ("act", &axis.act)] {
            packed.push(&of(what), POSITION, rows.values(values));
        }
        for (what, values) in [
            ("velocity", &axis.velocity),
            ("acceleration", &axis.acceleration),
            ("jerk", &axis.jerk),
            ("following_error", &axis.following_error),
        ] {
            packed.push(&of(what), step(values), rows.peaks(values).into_iter());
        }
    }
    let blocks = blocks(report);
    let ends = || blocks.iter().map(|it| it.end);
    packed.push(
        "block.line",
        1.0,
        ends().map(|end| f64::from(report.line[end])),
    );
    packed.push("block.end", TIME, ends().map(|end| report.time[end]));
    for axis in &report.axes {
        let name = format!("block.{}", axis.name);
        packed.push(&name, POSITION, ends().map(|end| at(&axis.set, end)));
    }
    let worst: Vec<f64> = blocks.iter().map(|it| it.worst).collect();
    packed.push("block.worst", step(&worst), worst.iter().copied());

    let head = json!({ "columns": packed.columns, "bytes": packed.bytes.len() }).to_string();
    let mut zip = GzEncoder::new(Vec::new(), Compression::best());
    zip.write_all(&(head.len() as u32).to_le_bytes())?;
    zip.write_all(head.as_bytes())?;
    zip.write_all(&packed.bytes)?;
    let lines = report.source.split('\n');
    let lines: Vec<_> = lines
        .map(|line| shown(line.trim_end_matches('\r')))
        .collect();
    zip.write_all(lines.join("\n").as_bytes())?;
    Ok(BASE64_STANDARD.encode(zip.finish()?))
}

/// Rows of one line.
struct Block {
    /// The last one.
    end: usize,
    /// Greatest contour error, mm.
    worst: f64,
}

/// All blocks, in order.
fn blocks(report: &Report) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for (n, line) in report.line.iter().enumerate() {
        let error = at(&report.contour_error, n);
        let worst = if error.is_finite() { error } else { 0.0 };
        match blocks.last_mut() {
            Some(block) if report.line[block.end] == *line => {
                block.end = n;
                block.worst = block.worst.max(worst);
            }
            _ => blocks.push(Block { end: n, worst }),
        }
    }
    blocks
}

/// A step in which values are told as finely as a screen shows them.
fn step(values: &[f64]) -> f64 {
    let finite = values.iter().filter(|it| it.is_finite());
    let most = finite.fold(0.0, |most: f64, it| most.max(it.abs()));
    if most > 0.0 { most / STEPS } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What the script does to a column.
    fn unpacked(bytes: &[u8], step: f64) -> Vec<f64> {
        let (mut found, mut at, mut value) = (Vec::new(), 0, 0_i64);
        while at < bytes.len() {
            let (mut number, mut shift) = (0_u64, 0);
            loop {
                let byte = bytes[at];
                at += 1;
                number |= u64::from(byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    break;
                }
            }
            if number == 0 {
                found.push(f64::NAN);
                continue;
            }
            number -= 1;
            value += (number >> 1) as i64 ^ -((number & 1) as i64);
            found.push(value as f64 * step);
        }
        found
    }

    proptest! {
        #[test]
        fn a_column_is_what_it_was(
            values in prop::collection::vec(
                prop_oneof![9 => -1e6..1e6_f64, 1 => Just(f64::NAN)], 0..400),
        ) {
            let step = step(&values);
            let mut packed = Packed::default();
            packed.push("x", step, values.iter().copied());
            let found = unpacked(&packed.bytes, step);
            prop_assert_eq!(found.len(), values.len());
            for (one, other) in found.iter().zip(&values) {
                let off = if one.is_nan() && other.is_nan() { 0.0 } else { (one - other).abs() };
                prop_assert!(off <= 0.51 * step, "{one} {other}");
            }
        }

        #[test]
        fn no_peak_and_no_row_is_lost(
            values in prop::collection::vec(-1e3..1e3_f64, 1..900), stretch in 1_usize..40,
        ) {
            let rows = Rows { count: values.len(), stretch };
            let kept = rows.peaks(&values);
            prop_assert_eq!(kept.len(), rows.standing().count());
            let most = |all: &[f64]| all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let least = |all: &[f64]| all.iter().copied().fold(f64::INFINITY, f64::min);
            // A last stretch too short for two values keeps its first.
            let whole = values.len() - values.len() % stretch;
            let all = if whole == 0 { &values[..1] } else { &values[..whole] };
            if stretch == 1 || whole > 0 {
                prop_assert!(most(&kept) >= most(all) && least(&kept) <= least(all));
            }
        }
    }
}
