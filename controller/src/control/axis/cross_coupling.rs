//! The sides of a gantry, coupled across: what they are measured to be apart, beside what is planned of it, moves their setpoints
//! against each other, so that they go together. `machine/cross_coupling.rs` has the law, and says why it is stable and keeps
//! the limits.
//!
//! *It takes nothing for a difference that is planned*: sides that stand apart without a reference, that are taken square, or that are
//! sent apart by this. Positions count that came with one SYNC: while one is missing nothing is known, and what the sides are sent
//! apart is held.
//!
//! *While a fault stops the machine, a homing moves it, or its sides are taken square* it is held, too: what is under way then
//! runs out within its share of the limits, so that every stop that the plan has stays one.
//!
//! *At rest* nothing may move that nobody commanded. So an axis that has come to rest goes on for as long as its drives take to
//! catch up, and then until its sides are together, for a bounded time, and counts as moving until then. After that it is held until
//! the plan moves again. Sides that went together are not waited for.

use super::super::node::DeviceNode;
use super::AxisControl;
use crate::machine::CrossCoupling;

/// So many times as long as one of the two lags takes, of which there are as much in the loop about them, the drives catch up at rest.
const CATCHES_UP: f64 = 4.0;
/// And so many times 1 / gain sides are waited for that do not come together, …
const PATIENCE: f64 = 8.0;
/// … but for no longer than this, s.
const LONGEST: f64 = 1.0;
/// It is told that this part of its limit is used up: it comes to all of it slowly.
const ENDS: f64 = 0.95;
/// What is no more than this part of its limit is there.
const THERE: f64 = 1e-6;

/// How far the second side is sent beyond the first, and what becomes of it.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    /// What it runs behind, mm, …
    aim: f64,
    /// … and how fast that goes, mm/s.
    aims: f64,
    /// mm
    position: f64,
    /// mm/s
    velocity: f64,
    /// mm/s²
    acceleration: f64,
    /// What of the difference was not left alone, if it was known, mm.
    beyond: Option<f64>,
    /// For so long the plan has rested, s.
    rested: f64,
    /// Nothing changes before the plan moves.
    held: bool,
}

/// Moves the sides of an axis against each other.
#[derive(Clone, Debug)]
pub(super) struct Coupling {
    of: CrossCoupling,
    period: f64,
    /// e^(−ω T)
    decay: f64,
    /// As the last setpoint was handed over …
    state: State,
    /// … and as the next one is prepared.
    next: State,
    /// It came to its limit, which is told once.
    ended: Option<bool>,
}

impl Coupling {
    /// In a cycle of so many seconds.
    pub(super) fn new(of: CrossCoupling, period: f64) -> Self {
        let mut it = Self {
            of,
            period,
            decay: libm::exp(-of.smoothing * period),
            state: State::default(),
            next: State::default(),
            ended: None,
        };
        it.begin(0.0);
        it
    }

    /// Its sides rest, and are sent so far apart beside what is planned, mm.
    pub(super) fn begin(&mut self, apart: f64) {
        let held = State {
            aim: apart,
            position: apart,
            held: true,
            ..State::default()
        };
        (self.state, self.next, self.ended) = (held, held, None);
    }

    /// How far the second side is sent beyond the first with the next setpoint, mm.
    pub(super) fn next(&self) -> f64 {
        self.next.position
    }

    /// And with the last one, mm.
    pub(super) fn last(&self) -> f64 {
        self.state.position
    }

    /// What was prepared was handed over, or is left out.
    pub(super) fn go_on(&mut self) {
        self.state = self.next;
    }

    /// Whether nothing changes before the plan moves.
    pub(super) fn rests(&self) -> bool {
        self.state.held
    }

    /// Looks what comes next: the second side is that far beyond where it is planned beside the first, mm, if that is known;
    /// something `may` be done about it; the plan `moves`.
    fn prepare(&mut self, difference: Option<f64>, may: bool, moves: bool) {
        let mut state = self.state;
        if moves {
            (state.rested, state.held) = (0.0, false);
        } else {
            state.rested += self.period;
        }
        if !state.held {
            let may = may && state.rested < (PATIENCE / self.of.gain).min(LONGEST);
            let known = difference.filter(|_| may);
            let beyond = known.map(|it| beyond(it, self.of.dead_zone));
            let before = std::mem::replace(&mut state.beyond, beyond);
            let changes = beyond.zip(before).map_or(0.0, |(now, before)| now - before);
            let led = beyond.unwrap_or_default() + self.of.lead * changes / self.period;
            self.step(&mut state, -self.of.gain * led);
            state.held = !moves && self.is_done(&state, difference, may);
            if state.held {
                state.position = state.aim;
                (state.velocity, state.acceleration) = (0.0, 0.0);
            }
        }
        self.next = state;
    }

    /// Goes on by a cycle, at whose end it is to aim at that velocity, mm/s.
    fn step(&mut self, state: &mut State, velocity: f64) {
        let CrossCoupling {
            limit,
            rate,
            slew,
            smoothing,
            ..
        } = self.of;
        let period = self.period;
        let before = state.aims;
        // What it may go at so that it comes to rest within its limit, also where the last cycle takes it to zero more slowly.
        let change = slew * period;
        let stops = |room: f64| (change * change + 2.0 * slew * room.max(0.0)).sqrt() - change;
        let ahead = state.aim + 0.5 * before * period;
        let velocity = velocity
            .clamp(-rate, rate)
            .clamp(-stops(limit + ahead), stops(limit - ahead))
            .clamp(before - change, before + change);
        let slope = (velocity - before) / period;
        state.aim += 0.5 * (before + velocity) * period;
        state.aims = velocity;
        if state.aim.abs() >= ENDS * limit {
            self.ended.get_or_insert(false);
        }
        // Both lags have the same time, so they are one of second order: behind a ramp by twice that, and what is off decays with what
        // is linear in time.
        let behind = 2.0 * slope / smoothing;
        let off = state.velocity - (before - behind);
        let grows = state.acceleration - slope + smoothing * off;
        let left = (off + grows * period) * self.decay;
        state.velocity = velocity - behind + left;
        state.acceleration = slope + grows * self.decay - smoothing * left;
        state.position = state.aim
            - 2.0 * state.velocity / smoothing
            - state.acceleration / (smoothing * smoothing);
    }

    /// Whether all is done that was to be done about a plan that rests.
    fn is_done(&self, state: &State, difference: Option<f64>, may: bool) -> bool {
        let CrossCoupling {
            smoothing,
            dead_zone,
            limit,
            ..
        } = self.of;
        let is_there = state.aims == 0.0 && (state.aim - state.position).abs() <= THERE * limit;
        let together = difference.is_some_and(|it| it.abs() <= dead_zone);
        let caught_up = state.position.abs() <= dead_zone || state.rested >= CATCHES_UP / smoothing;
        is_there && (!may || together && caught_up)
    }

    /// Whether it has come to its limit, which was not told before.
    fn has_ended(&mut self) -> bool {
        self.ended
            .as_mut()
            .is_some_and(|told| !std::mem::replace(told, true))
    }
}

/// What of a difference is beyond what is left alone.
fn beyond(difference: f64, left_alone: f64) -> f64 {
    difference - difference.clamp(-left_alone, left_alone)
}

impl AxisControl {
    /// Looks what its sides are sent apart in `cycle`, while they may be moved against each other, by `nodes` that tell where they were
    /// at the SYNC before, if it was sent.
    pub(super) fn couple(
        &mut self,
        cycle: u64,
        (positions, velocities): (&[f64], &[f64]),
        may: bool,
        nodes: Option<&[DeviceNode]>,
    ) {
        if self.coupling.is_none() {
            return;
        }
        let may = may && !self.squares(cycle);
        let difference = nodes.and_then(|nodes| self.sides_off(cycle - 1, nodes));
        let at = self.spec.coordinate;
        let before = self.history.planned(cycle - 1, 0.0).position;
        let moves = velocities[at] != 0.0 || positions[at] != before;
        if let Some(coupling) = &mut self.coupling {
            coupling.prepare(difference, may, moves);
        }
    }

    /// How far its second side was beyond where it is planned beside its first one at SYNC `cycle`, mm.
    fn sides_off(&self, cycle: u64, nodes: &[DeviceNode]) -> Option<f64> {
        let &[one, other] = &self.spec.drives[..] else {
            return None;
        };
        let (one, other) = (&nodes[one], &nodes[other]);
        let is_seen = one.age() == 0 && other.age() == 0;
        is_seen.then(|| other.plan_mm() - one.plan_mm() - self.apart(cycle))
    }

    /// Whether its sides have come to be sent as far apart as they may be, which was not told before, mm.
    pub(in crate::control) fn coupling_ends(&mut self) -> Option<f64> {
        let coupling = self.coupling.as_mut()?;
        coupling.has_ended().then_some(coupling.of.limit)
    }
}

#[cfg(test)]
mod tests;
