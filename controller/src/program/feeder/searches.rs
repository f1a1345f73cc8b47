//! Probings, homings and threads: the path comes to rest, and nothing more is known before the machine has been there.

use super::{Feeder, planner};
use crate::control::{Found, Instruction, ProbeMove, StopPoint};
use crate::machine::{COORDINATES, Position};
use crate::program::feed::programmed_speed;
use crate::program::{ProgramError, place};
use std::mem::take;
use syncline_gcode as gcode;

impl Feeder {
    /// Comes to rest, and has the cycle home axes there.
    pub(super) fn take_home(&mut self, axes: gcode::AxisSet, line: u32) {
        self.switch_with_motion();
        self.searches += 1;
        self.search = Some(Instruction::Home {
            number: self.searches,
            axes: gcode::AxisLetter::ALL.map(|axis| axes.contains(axis)),
        });
        self.stop_then(StopPoint::Home { line });
    }

    /// Comes to rest, and has the cycle probe from there.
    pub(super) fn take_probe(
        &mut self,
        to: Position,
        feed: gcode::Feed,
        probe: gcode::Probe,
        span: gcode::Span,
    ) -> Result<(), ProgramError> {
        self.switch_with_motion();
        let line_there = self.source.line(to).map_err(|source| ProgramError::Curve {
            place: place(&self.interpreter, span),
            source,
        })?;
        let speed = programmed_speed(&line_there, feed, line_there.length());
        self.searches += 1;
        self.search = Some(Instruction::Probe(ProbeMove {
            number: self.searches,
            to: line_there.end(),
            speed: self.scale.feed * speed,
            probe,
        }));
        let line = span.line;
        self.stop_then(StopPoint::Probe { line });
        Ok(())
    }

    /// Comes to rest, and has the cycle cut a thread from there, or tap one.
    pub(super) fn take_thread(
        &mut self,
        to: Position,
        lead: f64,
        taps: bool,
        span: gcode::Span,
    ) -> Result<(), ProgramError> {
        if take(&mut self.spins_up) {
            self.await_spindle(span)?;
        }
        self.switch_with_motion();
        let line = self.source.line(to).map_err(|source| ProgramError::Curve {
            place: place(&self.interpreter, span),
            source,
        })?;
        let spindle = self.interpreter.modes().spindle;
        let number = self.searches + 1;
        let next = self.threads.thread(number, &line, lead, taps, spindle);
        let next = next.map_err(|source| ProgramError::Thread {
            place: place(&self.interpreter, span),
            source,
        })?;
        self.searches = number;
        self.awaits_thread = true;
        // A tap leaves it on its way back to its direction.
        self.spins_up = taps;
        self.search = Some(Instruction::Thread(next));
        let line = span.line;
        self.stop_then(StopPoint::Thread { line });
        Ok(())
    }

    /// Whether nothing more is known before the machine has been there.
    pub(super) fn awaits_machine(&self) -> bool {
        self.awaits_thread || self.interpreter.awaits_machine()
    }

    /// Goes on behind a probing, a homing or a thread from where the machine rests, once it is known what came of it; a
    /// result that was taken, or is of another one, changes nothing.
    pub fn found(&mut self, found: &Found<COORDINATES>) {
        let searches = self.awaits_thread || self.interpreter.awaits_search();
        if !searches || found.number != self.searches {
            return;
        }
        if take(&mut self.awaits_thread) {
            self.source.go_on_from(found.at);
        } else if self.interpreter.awaits_homing() {
            self.source.homed(found.at);
            self.interpreter.homed(gcode::Point(found.at));
        } else {
            let at = gcode::Point(self.source.go_on_from(found.at));
            let contact = found.contact.map(gcode::Point);
            let probed = gcode::Probed { contact, at };
            self.answers.push(gcode::Answer::Probed(probed));
            self.interpreter.probed(probed);
        }
        self.planner = planner(self.limits, self.bounds, found.at, self.shaped());
        self.first_mark += self.marks.len() as u32;
        self.marks.clear();
        self.committed.clear();
        self.since_stop = 0;
        self.search = Some(Instruction::Found(found.number));
    }
}
