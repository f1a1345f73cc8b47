//! Threads: a line, a lead and a speed of the spindle to what the cycle has to know, if the axes can.

use crate::control::ThreadMove;
use crate::machine::COORDINATES;
use syncline_gcode::{Spindle, Turning};
use syncline_trajectory::path::{Curve, Limits};
use syncline_trajectory::synchronous::Thread;

/// How far the tool may be from where the spindle wants it, mm: beyond, a thread is none.
const TOLERANCE: f64 = 0.1;

/// Why the axes cannot cut a thread.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoThread {
    /// The spindle is too fast for them.
    #[error(
        "S{speed} is too fast for the axes, which go {allowed:.2} mm/s along it at most: at a lead of {lead} mm S \
         is {most:.0} at most"
    )]
    TooFast {
        /// 1/min
        speed: f64,
        /// mm
        lead: f64,
        /// mm/s
        allowed: f64,
        /// 1/min
        most: f64,
    },
    /// It is over before they are in step.
    #[error(
        "it is {length:.3} mm long, and at S{speed} the axes need {needed:.3} mm to come in step and to rest: begin \
         and end it beside the work, or lower S"
    )]
    TooShort {
        /// mm
        length: f64,
        /// 1/min
        speed: f64,
        /// mm
        needed: f64,
    },
}

/// The thread with that number along a line.
///
/// # Errors
/// The axes cannot, at that speed of the spindle.
pub(super) fn thread(
    number: u32,
    line: &Curve<COORDINATES>,
    lead: f64,
    spindle: Spindle,
    limits: &Limits<COORDINATES>,
) -> Result<ThreadMove<COORDINATES>, NoThread> {
    let (length, speed) = (line.length(), spindle.speed);
    let direction = line.at(0.0).d1;
    let limits = limits.along(&direction);
    let thread = Thread {
        length,
        lead,
        reverse: spindle.turning == Turning::Counterclockwise,
        tolerance: TOLERANCE,
    };
    match thread.least_length(&limits, speed / 60.0) {
        None => Err(NoThread::TooFast {
            speed,
            lead,
            allowed: limits.v_max,
            most: (60.0 * limits.v_max / lead).floor(),
        }),
        Some(needed) if needed > length => Err(NoThread::TooShort {
            length,
            speed,
            needed,
        }),
        Some(_) => Ok(ThreadMove {
            number,
            to: line.end(),
            direction,
            thread,
            limits,
        }),
    }
}
