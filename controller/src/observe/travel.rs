//! How far the tool has come along the program as F counts it, and what the time went into.

use super::Observed;
use crate::control::Waiting;
use crate::machine::Position;
use crate::program::moved;

/// What no step back along the path is that leaves the axes where they are, mm or degrees.
const LEAST: f64 = 1e-6;

/// Path and time of a run so far.
#[derive(Debug, Default)]
pub(super) struct Travel {
    /// Length, mm.
    pub(super) length_mm: f64,
    /// Angle where A, B and C turned alone, degrees.
    pub(super) turned_deg: f64,
    /// The first and the last cycle of motion.
    pub(super) motion: Option<(u64, u64)>,
    pub(super) cycles: Cycles,
    /// What of the last row's distance was no length of the tool's path.
    besides: f64,
    last: Last,
}

/// How many cycles went into what.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cycles {
    /// The path moved, or a thread was cut.
    pub(super) motion: u64,
    /// A dwell of the program.
    pub(super) dwells: u64,
    /// An operator was waited for.
    pub(super) waits: u64,
    /// A block waited for the machine: its spindle, an input, a command.
    pub(super) awaits: u64,
    /// Axes were off the path.
    pub(super) jogs: u64,
    /// The path rested between two of the others, or before the first: until there was a plan.
    pub(super) planning: u64,
    /// It has rested since the last of the others: until the axes were in position.
    pub(super) settling: u64,
    /// The same of jobs that are over.
    pub(super) settled: u64,
    /// The path rested in between until what axes are sent beside the plan did.
    pub(super) corrections: u64,
    /// No job was at work.
    pub(super) idle: u64,
}

impl Cycles {
    /// Takes the cycle before a row; whether the path moved at the one before, too.
    fn observe(&mut self, observed: &Observed, moved: bool) {
        let (plan, threads) = (&observed.row.plan, observed.row.threads);
        let by_itself = observed.row.axes.iter().any(|axis| axis.by_itself);
        let count = if plan.off_path && !by_itself && !threads {
            &mut self.jogs
        } else if plan.speed > 0.0 || moved || (by_itself && !plan.off_path) {
            &mut self.motion
        } else if observed.idle {
            self.settled += std::mem::take(&mut self.settling);
            &mut self.idle
        } else if observed.waits {
            &mut self.waits
        } else if observed.row.waiting == Some(Waiting::Corrections) {
            &mut self.corrections
        } else if plan.busy && !threads {
            &mut self.dwells
        } else if observed.row.rests_for.is_some() {
            &mut self.awaits
        } else {
            self.settling += 1;
            return;
        };
        *count += 1;
        self.planning += std::mem::take(&mut self.settling);
    }
}

/// Where the last row was.
#[derive(Debug, Default)]
struct Last {
    distance: f64,
    speed: f64,
    position: Position,
    threads: bool,
    /// What of the distance was length then, and what angle.
    shares: [f64; 2],
}

impl Travel {
    /// Takes what happened at one SYNC; the second is the speed as F counts it, and whether that
    /// is of a turn.
    pub(super) fn observe(&mut self, observed: &Observed, counted: (f64, bool)) {
        let row = observed.row;
        let before = self.cycles.motion;
        // The move's last step ends at rest.
        self.cycles.observe(observed, self.last.speed > 0.0);
        if self.cycles.motion > before {
            let (first, _) = self.motion.unwrap_or((row.cycle.saturating_sub(1), 0));
            self.motion = Some((first, row.cycle));
        }
        self.measure(observed, counted);
    }

    /// Adds up the path. The plan's own distance also counts what other axes move.
    fn measure(&mut self, observed: &Observed, (speed, turns): (f64, bool)) {
        let row = observed.row;
        let (at, from) = (row.plan.position, self.last.position);
        let step = || moved(&std::array::from_fn(|i| at[i] - from[i]));
        if row.threads || self.last.threads {
            // Of a thread, its last step included, the plan counts nothing.
            let [tool, ..] = step();
            self.besides -= tool;
        }
        let Last {
            mut distance,
            position,
            shares: before,
            ..
        } = self.last;
        let gone = row.plan.distance - distance;
        let moved_by: f64 = (row.plan.position.iter().zip(position))
            .map(|(now, before)| (now - before).abs())
            .sum();
        if gone < -(2.0 * moved_by + LEAST) {
            // Not back along the path: another job counts from 0.
            self.besides -= distance;
            distance = 0.0;
        }
        let distance = row.plan.distance - distance;
        let mut shares = before;
        if row.plan.speed > 0.0 {
            let share = speed / row.plan.speed;
            let all = (share - 1.0).abs() < 1e-9;
            shares = match (turns, all) {
                (true, _) => [0.0, share],
                (false, true) => [1.0, 0.0],
                (false, false) => [share, 0.0],
            };
        }
        // The way to where a program is begun is none of its path.
        let motion = observed.tag.and_then(|tag| observed.moves.motion(tag));
        let programmed = motion.is_none_or(|motion| motion.is_programmed);
        let counts = if programmed { distance } else { 0.0 };
        let [mut length, mut angle] = shares.map(|share| share * counts);
        if (shares[1] > 0.0) != (before[1] > 0.0) && counts != 0.0 {
            // The end of one and the beginning of the other, with a rest between.
            let [tool, other, turn] = step();
            length = if tool > 0.0 { tool } else { other };
            angle = turn;
        }
        self.besides += distance - length;
        self.length_mm = row.plan.distance - self.besides;
        self.turned_deg += angle;
        self.last = Last {
            distance: row.plan.distance,
            speed: row.plan.speed,
            position: at,
            threads: row.threads,
            shares,
        };
    }
}
