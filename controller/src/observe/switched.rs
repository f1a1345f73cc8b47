//! What the program's M-codes switched, and when.

use super::kept::Kept;
use crate::control::spindle::turning;
use crate::control::{MachineFunctions, Row};
use crate::machine::COORDINATES;
use serde::Serialize;
use syncline_gcode::{ANALOG_OUTPUTS, Coolant, DIGITAL_OUTPUTS};

/// The state from an instant on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SwitchedState {
    /// Of the first SYNC with it, s.
    #[serde(rename = "time_s")]
    pub time: f64,
    /// The line of the last M-code.
    pub line: u32,
    /// 1/min, negative for M4.
    pub spindle: f64,
    /// Where it is held instead (M19), degrees.
    #[serde(rename = "orientation_deg", skip_serializing_if = "Option::is_none")]
    pub orientation: Option<f64>,
    /// 1 mist, 2 flood, 3 both.
    pub coolant: u8,
    /// The tool in the spindle.
    pub tool: u32,
    /// The digital outputs that are on.
    pub digital_outputs: Vec<usize>,
    /// The analog outputs, from E0 on.
    pub analog_outputs: [f64; ANALOG_OUTPUTS],
}

/// The changes so far.
#[derive(Debug, Default)]
pub(super) struct Switched {
    last: MachineFunctions,
    states: Kept<SwitchedState>,
}

impl Switched {
    /// The changes that are kept, and how many are not.
    pub(super) fn end(self) -> (Vec<SwitchedState>, u64) {
        self.states.end()
    }

    /// Takes what happened at one SYNC.
    pub(super) fn observe(&mut self, row: &Row<COORDINATES>, time: f64) {
        let functions = row.put_out;
        let programmed = MachineFunctions {
            spindle: functions.spindle.as_programmed(),
            ..functions
        };
        if programmed == self.last {
            return;
        }
        self.last = programmed;
        self.states.push(SwitchedState {
            time,
            line: functions.line,
            spindle: turning(functions.spindle),
            orientation: functions.spindle.orientation.map(|it| it.angle),
            coolant: running(functions.coolant),
            tool: functions.tool,
            digital_outputs: (0..DIGITAL_OUTPUTS)
                .filter(|number| functions.outputs.digital >> number & 1 == 1)
                .collect(),
            analog_outputs: functions.outputs.analog,
        });
    }
}

/// Which coolant runs: 1 mist, 2 flood, 3 both.
pub(crate) fn running(coolant: Coolant) -> u8 {
    u8::from(coolant.mist) + 2 * u8::from(coolant.flood)
}

/// What that is called.
pub(crate) fn coolant_name(running: u8) -> &'static str {
    ["off", "mist", "flood", "mist, flood"][usize::from(running & 3)]
}
