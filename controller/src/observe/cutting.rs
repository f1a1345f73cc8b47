//! The force with which tools cut in a simulation, as the drives' loads feel it, and how far the tool gives way meanwhile.
//!
//! Both are told of the whole run and of its lines: of each stretch of rows of one line in which something cuts. A line may
//! be cut any number of times; its hardest pass stands for it, and only the hardest lines are kept, so that a program of any length takes as
//! much memory.

use super::places::keep;
use super::record::{Greatest, Place};
use crate::machine::Machine;
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use syncline_drives::twin::Observation;

/// With which force tools cut.
#[derive(Clone, Debug, Serialize)]
pub struct CuttingSummary {
    /// At most, on the tool, N.
    pub max_force_n: f64,
    /// Where that was.
    pub max_force_at: Place,
    /// The lines that cut with the greatest force, hardest first: at most 100.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hardest_lines: Vec<HardestLine>,
}

/// A line of the program that cuts: its pass with the greatest force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HardestLine {
    /// Where the force was greatest.
    #[serde(flatten)]
    pub at: Place,
    /// At most, on the tool, N.
    pub max_force_n: f64,
    /// The root of the mean of its square, while there was one, N.
    pub rms_force_n: f64,
    /// How far the tool was at most from where the axes were while there was a force, mm: by what twists, has play or a lead error, or
    /// grows with warmth between motors and loads, and by the sway of the structure.
    pub max_deflection_mm: f64,
}

impl fmt::Display for CuttingSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.max_force_n {
            0.0 => write!(f, "no force"),
            force => write!(f, "force max {force:.1} N in {}", self.max_force_at),
        }
    }
}

/// What is watched of it.
#[derive(Debug)]
pub(super) struct CuttingWatch {
    /// The drives of each axis with what a N·m at their shafts is along it, N.
    axes: Vec<Vec<(usize, f64)>>,
    force: Greatest,
    /// The line at work, as far as it has cut.
    pass: Option<Pass>,
    hardest: Vec<HardestLine>,
}

/// One pass of a line.
#[derive(Clone, Copy, Debug)]
struct Pass {
    line: u32,
    force: Greatest,
    /// Sum of the squares of the force, and in how many cycles there was one.
    squares: f64,
    cycles: u64,
    deflection: f64,
}

impl Pass {
    /// Of a line that has not cut yet.
    fn of(line: u32) -> Self {
        Self {
            line,
            force: Greatest::default(),
            squares: 0.0,
            cycles: 0,
            deflection: 0.0,
        }
    }

    /// Of a pass that has cut.
    fn ended(&self) -> Option<HardestLine> {
        (self.cycles > 0).then(|| HardestLine {
            at: self.force.at,
            max_force_n: self.force.value,
            rms_force_n: (self.squares / self.cycles as f64).sqrt(),
            max_deflection_mm: self.deflection,
        })
    }
}

/// Puts a pass among the hardest lines, if it is harder than the line was before.
fn keep_line(hardest: &mut Vec<HardestLine>, pass: HardestLine) {
    match hardest.iter().position(|it| it.at.line == pass.at.line) {
        Some(same) if hardest[same].max_force_n >= pass.max_force_n => return,
        Some(same) => {
            hardest.remove(same);
        }
        None => {}
    }
    keep(hardest, pass, |it| it.max_force_n);
}

impl CuttingWatch {
    /// Of a machine; `None`: nothing cuts.
    pub(super) fn new(machine: &Machine) -> Option<Self> {
        let linear = machine.axes.iter().filter(|it| it.letter.is_linear());
        let of = |&drive: &usize| {
            let travel = machine.drives[drive].scaling.travel_per_revolution();
            (drive, TAU * 1e3 / travel)
        };
        machine.is_cutting().then(|| Self {
            axes: linear
                .map(|it| it.drives.iter().map(of).collect())
                .collect(),
            force: Greatest::default(),
            pass: None,
            hardest: Vec::new(),
        })
    }

    /// Takes how the drives are at one SYNC, by their index, and how far the tool is from where the axes are then, mm.
    pub(super) fn observe(&mut self, at: Place, seen: &[Observation], deflection: f64) {
        let along = |axis: &Vec<(usize, f64)>| -> f64 {
            axis.iter()
                .map(|(drive, part)| seen[*drive].outside * part)
                .sum()
        };
        let squares: f64 = self.axes.iter().map(|axis| along(axis).powi(2)).sum();
        self.look(at, squares.sqrt(), deflection);
    }

    /// Takes the force of one cycle, N.
    fn look(&mut self, at: Place, force: f64, deflection: f64) {
        self.force.look(force, at);
        if self.pass.is_some_and(|pass| pass.line != at.line) {
            let ended = self.pass.take().and_then(|pass| pass.ended());
            ended
                .into_iter()
                .for_each(|it| keep_line(&mut self.hardest, it));
        }
        let pass = self.pass.get_or_insert(Pass::of(at.line));
        if force > 0.0 {
            pass.force.look(force, at);
            pass.squares += force * force;
            pass.cycles += 1;
            pass.deflection = pass.deflection.max(deflection);
        }
    }

    pub(super) fn summary(&self) -> CuttingSummary {
        let mut hardest_lines = self.hardest.clone();
        let last = self.pass.and_then(|pass| pass.ended());
        last.into_iter()
            .for_each(|it| keep_line(&mut hardest_lines, it));
        CuttingSummary {
            max_force_n: self.force.value,
            max_force_at: self.force.at,
            hardest_lines,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    /// Passes of lines, which come again and are more than are kept, each with the forces and deflections of its cycles.
    fn passes() -> impl Strategy<Value = Vec<(u32, Vec<(f64, f64)>)>> {
        let force = prop_oneof![2 => 0.1..500.0_f64, 1 => Just(0.0)];
        let cycles = prop::collection::vec((force, 0.0..0.2_f64), 1..8);
        prop::collection::vec((1..250_u32, cycles), 1..500)
    }

    proptest! {
        #[test]
        fn each_line_stands_with_its_hardest_pass(mut passes in passes()) {
            passes.dedup_by_key(|pass| pass.0);
            let mut watch = CuttingWatch {
                axes: Vec::new(),
                force: Greatest::default(),
                pass: None,
                hardest: Vec::new(),
            };
            let mut by_line: BTreeMap<u32, (f64, f64, f64)> = BTreeMap::new();
            for (line, cycles) in &passes {
                let at = Place { time: 0.0, line: *line };
                cycles.iter().for_each(|(force, off)| watch.look(at, *force, *off));
                let cut: Vec<_> = cycles.iter().filter(|it| it.0 > 0.0).collect();
                let most = cut.iter().map(|it| it.0).fold(0.0, f64::max);
                let off = cut.iter().map(|it| it.1).fold(0.0, f64::max);
                let squares: f64 = cut.iter().map(|it| it.0 * it.0).sum();
                let told = by_line.entry(*line).or_default();
                if most > told.0 {
                    *told = (most, (squares / cut.len() as f64).sqrt(), off);
                }
            }
            let mut expected: Vec<_> = by_line.into_values().filter(|it| it.0 > 0.0).collect();
            expected.sort_by(|one, other| other.0.total_cmp(&one.0));
            expected.truncate(100);
            let summary = watch.summary();
            let found = summary.hardest_lines.iter();
            let found: Vec<_> = found
                .map(|it| (it.max_force_n, it.rms_force_n, it.max_deflection_mm))
                .collect();
            prop_assert_eq!(&found, &expected);
            prop_assert_eq!(summary.max_force_n, expected.first().map_or(0.0, |it| it.0));
        }
    }
}
