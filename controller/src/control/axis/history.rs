//! What an axis was planned to do lately: step by step of its plan, and which step each SYNC latched.
//!
//! The two go together but for cycles that were lost. Behind a single one the plan goes on by two steps, of which the
//! first is latched by no SYNC; behind several of them it goes on by one, from where it was left. A drive that answers
//! sooner than others follows the plan some steps later ([`Layout::lag`](super::Layout::lag)). Those are steps and not
//! cycles: so it leaves out what the others leave out, at the same SYNC, and nothing afterwards. What a SYNC is held
//! against is looked for by cycles: it is what the drives were at.

use super::OUTWARDS;

/// Steps and cycles that are kept, to look back by the drives' latency and for as long as a position may be missing; a
/// power of two, of which the processor takes the remainder with one instruction.
const KEPT: usize = 128;
/// Of those as many can be looked back: with the next cycle, the next step, and the steps that no SYNC latched, of
/// which there are two at the most before a fault.
const FARTHEST: f64 = (KEPT - 6) as f64;

/// The plan of an axis at one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Planned {
    /// mm
    pub(super) position: f64,
    /// What its drives are sent beyond that, so that it is there, mm.
    pub(super) correction: f64,
    /// Of what they are sent, mm/s.
    pub(super) velocity: f64,
    /// What of that takes up backlash, mm/s.
    pub(super) take_up: f64,
    /// How far the second side is planned beyond the first, mm.
    pub(super) apart: f64,
    /// How much further it is sent than that, so that it is there, mm.
    pub(super) coupled: f64,
}

impl Planned {
    /// Between this one and the `next`, at a part of the way from 0 to 1. As a mean of both it keeps every
    /// limit that the plan keeps, up to the jerk; it is beside the plan by at most an eighth of the
    /// acceleration times the square of the cycle.
    fn towards(self, next: Self, part: f64) -> Self {
        Self {
            position: self.position + part * (next.position - self.position),
            correction: self.correction + part * (next.correction - self.correction),
            velocity: self.velocity + part * (next.velocity - self.velocity),
            take_up: self.take_up + part * (next.take_up - self.take_up),
            apart: self.apart + part * (next.apart - self.apart),
            coupled: self.coupled + part * (next.coupled - self.coupled),
        }
    }

    /// What its drives are sent, in the mean of its sides, mm.
    pub(super) fn sent(self) -> f64 {
        self.position + self.correction
    }

    /// What the drive of a side is sent, mm.
    pub(super) fn of_side(self, side: usize) -> f64 {
        self.sent() + OUTWARDS[side] * (self.apart + self.coupled)
    }
}

/// The newest steps of an axis' plan.
#[derive(Clone, Debug)]
pub(super) struct History {
    /// By step, at `step % KEPT`.
    steps: [Planned; KEPT],
    /// The step that is handed to the drives next.
    next: u64,
    /// The step that a SYNC latched, at `cycle % KEPT`.
    latched: [u64; KEPT],
}

impl History {
    /// Of an axis that has always rested there.
    pub(super) fn at_rest(there: Planned) -> Self {
        Self {
            steps: [there; KEPT],
            next: KEPT as u64,
            latched: [KEPT as u64 - 1; KEPT],
        }
    }

    /// What the drives are to be handed next, unless it is proposed again.
    pub(super) fn propose(&mut self, planned: Planned) {
        self.steps[self.next as usize % KEPT] = planned;
    }

    /// The drives are to be handed once more what they were handed last.
    pub(super) fn propose_rest(&mut self) {
        self.propose(self.step(self.next - 1, 0));
    }

    /// What is proposed was handed to the drives: SYNC `cycle` latches it.
    pub(super) fn hand_over(&mut self, cycle: u64) {
        self.latched[cycle as usize % KEPT] = self.next;
        self.next += 1;
    }

    /// A step that no SYNC latches.
    pub(super) fn leave_out(&mut self, planned: Planned) {
        self.propose(planned);
        self.next += 1;
    }

    /// What SYNC `cycle` would have latched is latched `lost` cycles later, and by none in between.
    pub(super) fn lose_cycles(&mut self, cycle: u64, lost: u64) {
        let step = self.latched[cycle as usize % KEPT];
        for lost in (cycle + 1..=cycle + lost).rev().take(KEPT) {
            self.latched[lost as usize % KEPT] = step;
        }
    }

    /// So many steps before the one that is proposed, a part of a step included.
    pub(super) fn proposed(&self, behind: f64) -> Planned {
        self.before(self.next, behind)
    }

    /// So many steps before the one that SYNC `cycle` latched, a part of a step included.
    pub(super) fn latched(&self, cycle: u64, behind: f64) -> Planned {
        self.before(self.latched[cycle as usize % KEPT], behind)
    }

    /// What was latched so many cycles before SYNC `cycle`, a part of a cycle included.
    pub(super) fn planned(&self, cycle: u64, behind: f64) -> Planned {
        between(behind, |whole| {
            let step = self.latched[cycle.wrapping_sub(whole) as usize % KEPT];
            self.step(step, 0)
        })
    }

    fn before(&self, step: u64, behind: f64) -> Planned {
        between(behind, |whole| self.step(step, whole))
    }

    fn step(&self, step: u64, behind: u64) -> Planned {
        self.steps[step.wrapping_sub(behind) as usize % KEPT]
    }
}

/// So many places `behind`, between two of them where that is no whole number.
fn between(behind: f64, at: impl Fn(u64) -> Planned) -> Planned {
    let behind = behind.min(FARTHEST);
    let whole = behind as u64;
    match behind - whole as f64 {
        0.0 => at(whole),
        part => at(whole + 1).towards(at(whole), 1.0 - part),
    }
}
