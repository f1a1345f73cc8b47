//! What had come in by each wake-up, and whether what the controller sends then is what it sent.

use super::Logged;
use super::log::{Band, Log, is_sync};
use super::state::{Mismatch, State};
use super::{Difference, PATIENCE};
use crate::bus::{Burst, Received};
use crate::control::Phase;
use crate::control::fault::BusIndex;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, Instant};

/// A frame cannot be told from its stamp to have come before or after a wake-up that it precedes
/// by less.
const UNCERTAIN: Duration = Duration::from_micros(200);

impl Log {
    pub(super) fn sync(&self, state: &mut State, due: Instant) {
        // A SYNC that came whole cycles late: the thread was not there.
        let half = self.layout.cycle.as_nanos() as u64 / 2;
        let from = self.until(Instant::from_nanos(due.as_nanos().saturating_sub(half)));
        let next = self.frames[from..].iter().find(|it| is_sync(it));
        let next = next.map_or(due, |it| self.start_of(it));
        let streams = state
            .sent
            .iter()
            .any(|bus| !bus[Band::Burst as usize].is_empty());
        let now = if streams && next >= due + self.layout.cycle {
            next
        } else {
            due
        };
        state.wake(due, now);
    }

    /// The wake-up for the setpoints; the first difference up to it, if there is one.
    pub(super) fn setpoints(&self, state: &mut State, due: Instant) -> Option<Difference> {
        let nominal = self.until(due);
        let mut cuts = self.uncertain(state, due);
        cuts.retain(|&cut| cut != nominal);
        cuts.sort_unstable_by_key(|&cut| cut.abs_diff(nominal));
        let mut differs = None;
        let mut chosen = None;
        for cut in std::iter::once(nominal).chain(cuts.iter().copied()) {
            if cuts.is_empty() {
                differs = self.take(state, cut);
                state.wake(due, due);
                break;
            }
            let mut trial = state.clone();
            let found = self.take(&mut trial, cut);
            trial.wake(due, due);
            if self.is_what_was_sent(&trial, due) {
                chosen = Some((trial, found));
                break;
            }
            chosen = chosen.or(Some((trial, found)));
        }
        if let Some((trial, found)) = chosen {
            *state = trial;
            differs = found;
        }
        state.burst.clear();
        for bus in 0..self.buses.len() {
            state.burst.extend(state.outboxes[bus].burst.as_slice());
            self.tell_burst(state, bus, due);
        }
        state.hear();
        let differs = differs.or_else(|| {
            let patience = PATIENCE * self.layout.cycle;
            state.overdue(Instant::from_nanos(
                due.as_nanos().saturating_sub(patience.as_nanos() as u64),
            ))
        });
        differs.map(|found| found.in_state(state))
    }

    /// The ends of what had come in by a wake-up, where the stamps leave that open.
    fn uncertain(&self, state: &State, due: Instant) -> Vec<usize> {
        let from = self.until(Instant::from_nanos(
            due.as_nanos().saturating_sub(UNCERTAIN.as_nanos() as u64),
        ));
        let from = from.max(state.next);
        let mut cuts = Vec::new();
        for (place, logged) in self.frames.iter().enumerate().skip(from) {
            let own = self.band(logged);
            let sends = matches!(own, Some(Band::Burst | Band::Acyclic));
            if logged.at > due && (own.is_some() || logged.at > due + self.layout.cycle) {
                break;
            }
            if !sends && self.is_decisive(state, logged) {
                cuts.extend([place, place + 1]);
            }
        }
        cuts.dedup();
        cuts
    }

    /// Whether what the controller sends at once depends on a frame.
    fn is_decisive(&self, state: &State, logged: &Logged) -> bool {
        let operational = [0x05];
        let CanId::Standard(id) = logged.frame.id() else {
            return false;
        };
        match id & 0x780 {
            0x080 => id != CobId::SYNC.get(),
            0x580 => true,
            0x700 => logged.frame.data() != operational,
            _ => self.band(logged).is_none() && state.controller.phase() < Phase::ModeStart,
        }
    }

    /// Whether the outboxes hold what the log has from one wake-up for setpoints to the next SYNC.
    fn is_what_was_sent(&self, state: &State, due: Instant) -> bool {
        let heartbeat = CanId::from(CobId::error_control(self.layout.node));
        (state.outboxes.iter().enumerate()).all(|(bus, outbox)| {
            let sent = outbox
                .burst
                .as_slice()
                .iter()
                .chain(outbox.acyclic.as_slice());
            let next = due + self.layout.cycle;
            let here = self.frames[self.until(due)..self.until(next)].iter();
            let here = here.filter(|it| it.bus == bus && it.frame.id() != heartbeat);
            let here = here.take_while(|it| !is_sync(it));
            let logged = here.filter(|it| self.band(it).is_some());
            logged.map(|it| it.frame).eq(sent.copied())
        })
    }

    /// What became of the burst of the last wake-up: it left at some time, or was dropped.
    fn tell_burst(&self, state: &mut State, bus: BusIndex, due: Instant) {
        let burst = state.outboxes[bus].burst.as_slice();
        let Some(first) = burst.first() else {
            return;
        };
        let (id, frames) = (first.id(), burst.len());
        let came = |cycles: u32| {
            let here = &self.frames[self.until(due)..self.until(due + cycles * self.layout.cycle)];
            let same = |it: &&Logged| it.bus == bus && it.frame.id() == id;
            here.iter().filter(same).count()
        };
        let log_ends = self.until(due + self.layout.cycle) == self.frames.len();
        let burst = if came(1) == 0 && came(2) < 2 && !log_ends {
            state.dropped += 1;
            state.sent[bus][Band::Burst as usize].retain(|(at, _)| *at != due);
            Burst::Dropped
        } else {
            Burst::Queued
        };
        let echoes = self.buses[bus].echoes;
        state.controller.burst_sent(bus, frames, burst, echoes);
    }

    /// Takes the log up to `cut`, bus by bus as the driver does: hands over what came in and
    /// compares what was sent.
    pub(super) fn take(&self, state: &mut State, cut: usize) -> Option<Mismatch> {
        let mut differs: Option<Mismatch> = None;
        let range = state.next..cut.max(state.next);
        for bus in 0..self.buses.len() {
            for logged in self.frames[range.clone()].iter().filter(|it| it.bus == bus) {
                let band = self.band(logged);
                if let Some(band) = band
                    && let Err(mismatch) = state.meet(logged, band)
                {
                    let earlier = differs.as_ref().is_none_or(|it| mismatch.at < it.at);
                    differs = if earlier { Some(mismatch) } else { differs };
                }
                let received = Received {
                    at: logged.at,
                    frame: logged.frame,
                    echo: band.is_some(),
                };
                state.controller.receive(bus, &received);
            }
        }
        state.next = range.end;
        differs
    }
}
