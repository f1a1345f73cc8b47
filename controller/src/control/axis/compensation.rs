//! What an axis' setpoints are corrected by in the cycle, so that its carriage is where they were planned.
//!
//! The lead error is a function of the position alone, which counts while the plan's positions are machine positions. The
//! backlash has a state: on which flank the carriage is pushed. It changes as the axis turns round, and the drive is sent on by
//! the backlash along a profile of bounded jerk, made in the cycle in which the axis turns; one that turns round again meanwhile
//! gets another from there. `machine/compensation.rs` says why what is sent keeps the limits.
//!
//! *Which way it goes* its plan tells: it goes on, and has turned round once it is back by more than an increment of its
//! drive. So neither a standstill nor a plan's rounding is a reversal.
//!
//! *Where nobody knows the flank*, as the drives are enabled, which something may have moved since, or have gone by themselves, the carriage is
//! taken to be in the middle: no axis jumps then, nothing is off by more than half of the backlash, and the first
//! motion takes up that half. Where the middle is outside the soft limits, the carriage is taken to be as near to it as is inside: it came to
//! its limit on the flank that pushed it there. If something has pushed it over since, it is off by up to the whole backlash until its
//! first motion, and an axis that stands outside by less than that is not told from one that does not.
//!
//! *Steps and not time* count, as for the plan. What no SYNC latches is no step of an axis that waits, so a stop, a
//! fault or lost cycles leave the correction where it is.

use super::AxisControl;
use super::cross_coupling::Coupling;
use super::history::Planned;
use crate::machine;
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{self, Problem};

/// Steps in which a position is found that is corrected to another one; each leaves a tenth of the difference at the most.
const STEPS: usize = 16;

/// What is added to a setpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Correction {
    /// mm
    pub(super) position: f64,
    /// mm/s
    pub(super) velocity: f64,
    /// What of that takes up backlash, mm/s.
    pub(super) take_up: f64,
}

/// Corrects the setpoints of an axis.
#[derive(Clone, Debug)]
pub(super) struct Compensation {
    of: machine::Compensation,
    /// Back by so much it has turned round, mm.
    turned: f64,
    /// Its positions are machine positions, which have a lead error.
    placed: bool,
    /// As its last setpoint was handed over …
    flank: Flank,
    /// … and as the next one is prepared.
    next: Flank,
}

/// On which flank the carriage is pushed.
#[derive(Clone, Copy, Debug)]
struct Flank {
    /// Which way it went last: 1 or −1; 0 if that is not known.
    direction: f64,
    /// How far it came that way, mm.
    reached: f64,
    /// How its backlash is taken up, mm …
    take_up: Profile,
    /// … for so long now, s.
    since: f64,
}

impl Flank {
    /// In the middle, of an axis that rests there.
    fn unknown(position: f64) -> Self {
        Self::beside(position, 0.0)
    }

    /// Between the flanks, of an axis that rests there and whose drive is so far beyond the middle, mm.
    fn beside(position: f64, beyond: f64) -> Self {
        Self {
            direction: 0.0,
            reached: position,
            take_up: Profile::new(State::at_rest(beyond)),
            since: 0.0,
        }
    }

    /// As the axis goes on to a position.
    fn step(mut self, position: f64, of: &Compensation, period: f64) -> Self {
        let went = position - self.reached;
        if went * self.direction > 0.0 {
            self.reached = position;
        } else if went.abs() > of.turned {
            let direction = 1_f64.copysign(went);
            let to = State::at_rest(direction * 0.5 * of.of.backlash);
            let (from, later) = self.take_up.sample(self.since);
            let problem = Problem::new(from, to, of.of.take_up);
            // Without a plan it is tried again with the next setpoint.
            if let Ok(take_up) = state_to_state::plan(&problem, 0.0) {
                self = Self {
                    direction,
                    reached: position,
                    take_up,
                    since: -later,
                };
            }
        }
        self.since += period;
        self
    }

    /// How far the drive is sent beyond the middle.
    fn state(&self) -> State {
        self.take_up.at(self.since)
    }
}

impl Compensation {
    /// Of an axis whose drives tell so much apart, mm.
    pub(super) fn new(of: &machine::Compensation, resolution: f64) -> Self {
        let flank = Flank::unknown(0.0);
        Self {
            of: of.clone(),
            turned: resolution,
            placed: false,
            flank,
            next: flank,
        }
    }

    /// Where the carriage is between the flanks is not known any more.
    pub(super) fn forget_flank(&mut self) {
        self.flank = Flank::unknown(self.flank.reached);
    }

    /// Of an axis whose flank is not known: its drives are found there, mm, and its carriage is between the flanks
    /// where that is inside these limits.
    fn find_inside(&mut self, told: f64, (least, most): (f64, f64)) {
        if self.flank.direction != 0.0 {
            return;
        }
        self.forget_flank();
        let middle = self.uncorrected(told);
        let inside = middle.clamp(least, most);
        if inside != middle {
            let half = 0.5 * self.of.backlash;
            let beyond = told - (inside - self.error(inside).0);
            self.flank = Flank::beside(self.flank.reached, beyond.clamp(-half, half));
        }
    }

    /// Whether positions are machine positions from now on, of an axis that rests.
    pub(super) fn place(&mut self, placed: bool) {
        self.placed = placed;
    }

    /// It rests at a position, mm, and goes on from there.
    pub(super) fn rest(&mut self, position: f64) {
        self.flank.reached = position;
    }

    /// Looks where the next setpoint is planned, mm and mm/s: what is to be added to it.
    pub(super) fn prepare(&mut self, position: f64, velocity: f64, period: f64) -> Correction {
        self.next = match self.of.backlash > 0.0 {
            true => self.flank.step(position, self, period),
            false => self.flank,
        };
        let State { p, v, .. } = self.next.state();
        let (error, slope) = self.error(position);
        Correction {
            position: p - error,
            velocity: v - slope * velocity,
            take_up: v,
        }
    }

    /// What was prepared was handed over, or is left out.
    pub(super) fn go_on(&mut self) {
        self.flank = self.next;
    }

    /// Whether its backlash is taken up.
    pub(super) fn rests(&self) -> bool {
        self.flank.since >= self.flank.take_up.duration()
    }

    /// What is added to a setpoint at a position while the axis rests, mm.
    pub(super) fn at(&self, position: f64) -> f64 {
        self.flank.state().p - self.error(position).0
    }

    /// The position that is corrected to this one, mm.
    pub(super) fn uncorrected(&self, corrected: f64) -> f64 {
        let step = |position, _| corrected - self.at(position);
        (0..STEPS).fold(corrected, step)
    }

    /// Lead error and its slope.
    fn error(&self, position: f64) -> (f64, f64) {
        match self.placed {
            true => self.of.lead_error.at(position),
            false => (0.0, 0.0),
        }
    }
}

impl AxisControl {
    /// Its drives are off: from where it is found, in the middle between the flanks, it goes on.
    pub(in crate::control) fn begin_compensating(&mut self) {
        self.forget_corrections();
        self.place_compensation(self.is_placed());
    }

    /// Its drives are off, or have gone by themselves: where its carriage is between the flanks is not known, and its sides are not sent
    /// apart any more.
    pub(super) fn forget_corrections(&mut self) {
        if let Some(compensation) = &mut self.compensation {
            compensation.forget_flank();
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.begin(0.0);
        }
    }

    /// Its drives are found there, mm: its carriage is between the flanks where that is inside its soft limits.
    pub(super) fn find_inside(&mut self, told: f64) {
        let limits = self.spec.limits.position;
        if self.is_placed()
            && let Some(compensation) = &mut self.compensation
        {
            compensation.find_inside(told, limits);
        }
    }

    /// Whether its positions are machine positions from now on, while it rests.
    pub(super) fn place_compensation(&mut self, placed: bool) {
        if let Some(compensation) = &mut self.compensation {
            compensation.place(placed);
        }
    }

    /// Its share of the plan, positions and velocities, for SYNC `cycle`.
    pub(super) fn planned_at(
        &mut self,
        cycle: u64,
        (positions, velocities): (&[f64], &[f64]),
    ) -> Planned {
        let at = self.spec.coordinate;
        let (position, velocity) = (positions[at], velocities[at]);
        let prepare = |it: &mut Compensation| it.prepare(position, velocity, self.period);
        let correction = self
            .compensation
            .as_mut()
            .map_or(Correction::default(), prepare);
        Planned {
            position,
            correction: correction.position,
            velocity: velocity + correction.velocity,
            take_up: correction.take_up,
            apart: match &self.squaring {
                Some(squaring) => squaring.apart(cycle, self.period),
                None => self.apart(cycle - 1),
            },
            coupled: self.coupling.as_ref().map_or(0.0, Coupling::next),
        }
    }

    /// What was prepared was handed over, or is left out.
    pub(super) fn go_on_compensating(&mut self) {
        if let Some(compensation) = &mut self.compensation {
            compensation.go_on();
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.go_on();
        }
    }

    /// Whether no correction is under way while the plan rests.
    pub(in crate::control) fn is_compensated(&self) -> bool {
        (self.compensation.as_ref()).is_none_or(Compensation::rests)
            && (self.coupling.as_ref()).is_none_or(Coupling::rests)
    }

    /// What is added to a setpoint at a position while it rests, mm.
    pub(super) fn correction_at(&self, position: f64) -> f64 {
        (self.compensation.as_ref()).map_or(0.0, |it| it.at(position))
    }

    /// What its drive is beyond a place that was found as the axis came there in a direction; `None` where it rests now.
    pub(super) fn correction_of_found(&self, position: f64, towards: Option<f64>) -> f64 {
        let of = |it: &Compensation| match towards {
            Some(towards) => 0.5 * towards * it.of.backlash - it.error(position).0,
            None => it.at(position),
        };
        self.compensation.as_ref().map_or(0.0, of)
    }

    /// Where it is by what its drives count as a position, mm.
    pub(in crate::control) fn uncorrected(&self, told: f64) -> f64 {
        (self.compensation.as_ref()).map_or(told, |it| it.uncorrected(told))
    }
}

#[cfg(test)]
mod tests;
