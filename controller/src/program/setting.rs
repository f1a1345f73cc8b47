//! What is set where the machine stands.

use crate::machine::COORDINATES;
use syncline_gcode as gcode;

/// What an operator sets where the machine stands, as the lines that do so.
#[derive(Clone, Copy, Debug)]
pub enum Setting {
    /// The work offset in effect, so that the position has these work coordinates, mm and degrees.
    WorkOffset([Option<f64>; COORDINATES]),
    /// The length of this tool, which is compensated from then on, for the same.
    ToolLength(u32, [Option<f64>; COORDINATES]),
}

impl Setting {
    /// The lines, in the units that are in effect.
    pub(super) fn lines(&self, memory: &gcode::Memory) -> String {
        match self {
            Self::WorkOffset(positions) => format!("G10 L20 P0{}", memory.words(positions)),
            Self::ToolLength(tool, positions) => {
                let words = memory.words(positions);
                format!("G10 L10 P{tool}{words}\nG43 H{tool}")
            }
        }
    }
}
