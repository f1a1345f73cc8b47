//! Threads: a line, a lead and a speed of the spindle to what the cycle has to know, if the axes can.

use crate::control::ThreadMove;
use crate::machine::{COORDINATES, Machine, Position};
use syncline_gcode::{AxisLetter, Spindle, Turning};
use syncline_trajectory::path::{Curve, Limits};
use syncline_trajectory::synchronous::{BEYOND, Tapping, Thread};

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
    /// It ends too near to the end of an axis's travel.
    #[error(
        "the axes may go {beyond:.3} mm further than its end, a quarter of the lead, which is outside of the soft \
         limits of {axis}: end it so much before them"
    )]
    NoRoom {
        /// Whose soft limits.
        axis: AxisLetter,
        /// mm
        beyond: f64,
    },
}

/// What is known of the machine that cuts threads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threads {
    limits: Limits<COORDINATES>,
    /// Where the axes may be, mm.
    travel: [Option<(f64, f64)>; COORDINATES],
    /// What the spindle's speed may differ by, a part of it.
    tolerance: f64,
    /// As fast as its drive's ramp changes its speed, turns/s².
    ramp: f64,
    /// So much later than its drive is sent a speed it has it, s.
    delay: f64,
}

impl Threads {
    pub(super) fn of(machine: &Machine, limits: Limits<COORDINATES>) -> Self {
        let mut travel = [None; COORDINATES];
        for axis in &machine.axes {
            travel[axis.letter.index()] = Some(axis.limits.position);
        }
        let spindle = machine.spindle.as_ref();
        let drive = machine.spindle_drive();
        Self {
            limits,
            travel,
            tolerance: drive.map_or(0.0, |(_, it)| it.tolerance),
            ramp: spindle.map_or(0.0, |it| it.acceleration() / 60.0),
            delay: spindle.and_then(|it| it.delay(machine)).unwrap_or_default(),
        }
    }

    /// The thread with that number along a line, or the tap.
    ///
    /// # Errors
    /// The axes cannot, at that speed of the spindle.
    pub(super) fn thread(
        &self,
        number: u32,
        line: &Curve<COORDINATES>,
        lead: f64,
        taps: bool,
        spindle: Spindle,
    ) -> Result<ThreadMove<COORDINATES>, NoThread> {
        let (length, speed) = (line.length(), spindle.speed);
        let direction = line.at(0.0).d1;
        let limits = self.limits.along(&direction);
        let tapping = Tapping {
            speed: speed / 60.0,
            ramp: self.ramp,
            delay: self.delay,
        };
        let thread = Thread {
            length,
            lead,
            reverse: spindle.turning == Turning::Counterclockwise,
            tolerance: TOLERANCE,
            tapping: taps.then_some(tapping),
        };
        if taps {
            self.check_beyond(&line.end(), &direction, BEYOND * lead)?;
        }
        let needed = thread.least_length(&limits, speed / 60.0);
        // As fast as it may be where it is taken to have its speed.
        let fastest = thread.least_length(&limits, (1.0 + self.tolerance) * speed / 60.0);
        match fastest.or(needed).filter(|_| needed.is_some()) {
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

    /// Whether the axes may be by so much further than a tap's end, mm.
    fn check_beyond(
        &self,
        end: &Position,
        direction: &Position,
        beyond: f64,
    ) -> Result<(), NoThread> {
        for axis in AxisLetter::ALL {
            let at = axis.index();
            let deepest = end[at] + beyond * direction[at];
            let Some((least, most)) = self.travel[at].filter(|_| direction[at] != 0.0) else {
                continue;
            };
            if deepest < least || deepest > most {
                return Err(NoThread::NoRoom { axis, beyond });
            }
        }
        Ok(())
    }
}
