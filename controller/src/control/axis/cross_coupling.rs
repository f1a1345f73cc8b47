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
//! catch up, and then until its sides are together, or come no nearer to each other: by the mean of the difference, as that of a SYNC
//! has the encoders' noise. Until then it counts as moving, and after that it is held until the plan moves again. Sides that went
//! together are not waited for.
//!
//! *Where the axis is homed anew* what its sides are sent apart is split: as much as holds them, against friction, where they are
//! stays, and the rest is how far apart they are.

use super::super::node::DeviceNode;
use super::AxisControl;
use crate::machine::CrossCoupling;

/// So many times as long as one of the two lags takes, of which there are as much in the loop about them, the drives catch up at rest.
const CATCHES_UP: f64 = 4.0;
/// Then they have to come nearer to each other, to this part of how far they were apart, in so many times 1 / gain, in which a difference
/// comes to 0.14 by itself, and where friction lets go of a side late to a half, …
const NEARER: (f64, f64) = (0.8, 2.0);
/// … and are waited for so many times 1 / gain at the most.
const PATIENCE: f64 = 8.0;
/// The mean of the difference forgets what was this part of 1 / gain before.
const FORGETS: f64 = 0.25;
/// It is told that this part of its limit is used up: it comes to all of it slowly.
const ENDS: f64 = 0.95;
/// What is no more than this part of what its greatest jerk does in a cycle is there.
const THERE: f64 = 0.1;

/// What there is to tell of the sides of an axis that are coupled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SidesApart {
    /// They are sent as far apart as they may be, mm.
    AtLimit(f64),
    /// The axis has come to rest, and they come no nearer to each other than that, mm.
    GivenUp(f64),
}

impl SidesApart {
    /// What it is and what to do, in words.
    pub(in crate::control) fn describe(self, unit: &str) -> String {
        match self {
            Self::AtLimit(limit) => format!(
                "{limit} {unit}, the `limit` of its `cross_coupling`, do not keep its sides together: look what holds one back"
            ),
            Self::GivenUp(apart) => format!(
                "at rest its sides come no nearer to each other than {apart:.4} {unit}: look what holds one back; where it is \
                 their encoders' noise, state more as `dead_zone` of its `cross_coupling`"
            ),
        }
    }
}

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
    rest: Rest,
    /// Nothing changes before the plan moves.
    held: bool,
}

/// How it goes while the plan rests.
#[derive(Clone, Copy, Debug, Default)]
struct Rest {
    /// For so long it has, s.
    time: f64,
    /// The difference in the mean, mm.
    mean: Option<f64>,
    /// What that was, and when, as it was looked last whether the sides come nearer.
    looked: Option<(f64, f64)>,
    /// Nothing more is done about a difference.
    is_over: bool,
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
    /// What is to be told, and whether it was: that it came to its limit, and that sides were given up.
    told: [Option<(SidesApart, bool)>; 2],
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
            told: [None; 2],
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
        (self.state, self.next, self.told) = (held, held, [None; 2]);
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
            (state.rest, state.held) = (Rest::default(), false);
        } else if !state.rest.is_over {
            state.rest.time += self.period;
            state.rest.is_over = !may || self.is_over(&mut state, difference);
        }
        if !state.held {
            let known = difference.filter(|_| may && !state.rest.is_over);
            let beyond = known.map(|it| beyond(it, self.of.dead_zone));
            let before = std::mem::replace(&mut state.beyond, beyond);
            let changes = beyond.zip(before).map_or(0.0, |(now, before)| now - before);
            let led = beyond.unwrap_or_default() + self.of.lead * changes / self.period;
            self.step(&mut state, -self.of.gain * led);
            state.held = state.rest.is_over && self.is_there(&state);
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
            self.told[0].get_or_insert((SidesApart::AtLimit(limit), false));
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

    /// Whether what is under way has run out.
    fn is_there(&self, state: &State) -> bool {
        let cycle = self.of.jerk() * self.period * self.period * self.period;
        state.aims == 0.0 && (state.aim - state.position).abs() <= THERE * cycle
    }

    /// Whether nothing more is to be done about the sides of an axis whose plan rests: they are together, or come no nearer.
    fn is_over(&mut self, state: &mut State, difference: Option<f64>) -> bool {
        let CrossCoupling {
            gain,
            smoothing,
            dead_zone,
            ..
        } = self.of;
        let (position, rest) = (state.position, &mut state.rest);
        if let Some(difference) = difference {
            let before = rest.mean.unwrap_or(difference);
            let share = (gain * self.period / FORGETS).min(1.0);
            rest.mean = Some(before + share * (difference - before));
        }
        let caught_up = rest.time >= CATCHES_UP / smoothing;
        let together = [difference, rest.mean].map(|it| it.is_some_and(|it| it.abs() <= dead_zone));
        if together.contains(&true) && (caught_up || position.abs() <= dead_zone) {
            return true;
        }
        let nearer = match (rest.looked, rest.mean) {
            (Some((then, _)), Some(now)) => now.abs() <= NEARER.0 * then.abs(),
            // Before they have caught up they may still come apart; while nothing is known nothing is said.
            _ => true,
        };
        let since = rest
            .looked
            .map_or(f64::INFINITY, |(_, when)| rest.time - when);
        let looks = since >= NEARER.1 / gain;
        if caught_up && looks {
            rest.looked = rest.mean.map(|now| (now, rest.time)).filter(|_| nearer);
        }
        let given_up = !nearer && looks || rest.time >= PATIENCE / gain;
        if given_up {
            let apart = rest.mean.unwrap_or_default().abs();
            self.told[1].get_or_insert((SidesApart::GivenUp(apart), false));
        }
        given_up
    }

    /// What was not told before.
    fn tells(&mut self) -> Option<SidesApart> {
        let mut told = self.told.iter_mut().flatten();
        let (what, is_told) = told.find(|(_, is_told)| !is_told)?;
        *is_told = true;
        Some(*what)
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

    /// How much of what its sides are sent apart holds them at rest where they are, mm.
    pub(super) fn holds_apart(&self, nodes: &[DeviceNode]) -> f64 {
        let (Some(coupling), &[one, other]) = (&self.coupling, &self.spec.drives[..]) else {
            return 0.0;
        };
        let ahead = |drive: usize| nodes[drive].setpoint_mm() - nodes[drive].actual_mm();
        let (held, coupled) = (ahead(other) - ahead(one), coupling.last());
        match held.abs() <= coupling.of.dead_zone {
            true => 0.0,
            false => held.clamp(coupled.min(0.0), coupled.max(0.0)),
        }
    }

    /// What there is to tell of its sides, which was not told before.
    pub(in crate::control) fn tells_sides(&mut self) -> Option<SidesApart> {
        self.coupling.as_mut()?.tells()
    }
}

#[cfg(test)]
mod tests;
