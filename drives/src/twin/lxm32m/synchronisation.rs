//! The mechanism of 3022h: watches SYNC and locks the drive's clock to it.

use super::policy::Policies;
use crate::twin::servo::clock::Clock;
use syncline_canopen::Instant;

/// 3022h:6 `SyncMechStatus`. The coding is an assumption (recollection of the drive's own manual).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncStatus {
    /// Off, 3022h:5 is not 2.
    Inactive = 1,
    /// On, the clock is not locked.
    Synchronising = 32,
    /// On, the clock is locked.
    Synchronised = 64,
}

/// The value of 3022h:5 that activates the mechanism over CANopen (lxm32m 1636).
pub(super) const START: i64 = 2;

/// What a SYNC, or its absence, means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Nothing to complain of.
    Fine,
    /// More were missing or out of tolerance in a row than the policy lets pass.
    Lost,
}

/// Watches SYNC against the drive's clock, each cycle's from half a cycle before its boundary
/// to half a cycle after it.
#[derive(Clone, Debug)]
pub(super) struct Synchronisation {
    status: SyncStatus,
    period_ns: u64,
    tolerance_ns: u64,
    /// The clock runs in SYNC cycles: a first SYNC has come.
    paced: bool,
    seen: bool,
    good: u32,
    bad: u32,
}

impl Synchronisation {
    pub(super) fn new() -> Self {
        Self {
            status: SyncStatus::Inactive,
            period_ns: 0,
            tolerance_ns: 0,
            paced: false,
            seen: false,
            good: 0,
            bad: 0,
        }
    }

    pub(super) fn status(&self) -> SyncStatus {
        self.status
    }

    /// Whether the clock runs in SYNC cycles.
    pub(super) fn is_paced(&self) -> bool {
        self.paced
    }

    /// Activates the mechanism for SYNCs that come every `period_ns`, give or take the tolerance.
    pub(super) fn start(&mut self, period_ns: u64, tolerance_ns: u64) {
        *self = Self {
            status: SyncStatus::Synchronising,
            period_ns,
            tolerance_ns,
            ..Self::new()
        };
    }

    /// Switches the mechanism off; the clock runs free.
    pub(super) fn stop(&mut self, clock: &mut Clock, now: Instant) {
        if self.paced {
            clock.unlock(now);
        }
        *self = Self::new();
    }

    /// A SYNC.
    pub(super) fn on_sync(
        &mut self,
        clock: &mut Clock,
        now: Instant,
        policies: &Policies,
    ) -> Verdict {
        if self.status == SyncStatus::Inactive {
            return Verdict::Fine;
        }
        if !self.paced {
            clock.lock(now, self.period_ns);
            self.paced = true;
            self.seen = true;
            return Verdict::Fine;
        }
        let error = clock.phase_error(now);
        let repeated = core::mem::replace(&mut self.seen, true);
        if error.unsigned_abs() <= self.tolerance_ns && !repeated {
            clock.correct(error);
            self.bad = 0;
            self.good = self.good.saturating_add(1);
            if self.good >= policies.lock_cycles {
                self.status = SyncStatus::Synchronised;
            }
            return Verdict::Fine;
        }
        self.miss(policies)
    }

    /// The middle of a cycle: its SYNC must have come by now.
    pub(super) fn on_mid_cycle(&mut self, policies: &Policies) -> Verdict {
        if !self.paced || core::mem::replace(&mut self.seen, false) {
            return Verdict::Fine;
        }
        self.miss(policies)
    }

    fn miss(&mut self, policies: &Policies) -> Verdict {
        self.good = 0;
        self.bad = self.bad.saturating_add(1);
        if self.bad <= policies.missing_syncs.unwrap_or(2) {
            return Verdict::Fine;
        }
        // The next SYNC starts a new attempt to lock.
        self.status = SyncStatus::Synchronising;
        self.paced = false;
        self.bad = 0;
        match policies.missing_syncs {
            Some(_) => Verdict::Lost,
            None => Verdict::Fine,
        }
    }
}
