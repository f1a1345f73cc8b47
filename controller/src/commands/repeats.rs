//! One line for many events of the same kind.
//!
//! A loose plug or a host that is too slow brings the same event in every cycle. The first is told at once;
//! those that come within a second of it are counted, and told as one line when that is over, and so on.

use crate::control::Event;
use std::time::Duration;

/// How long events of a kind are counted before they are told.
const COUNTED: Duration = Duration::from_secs(1);

/// Events that came lately.
#[derive(Default)]
pub(super) struct Repeats(Vec<Kind>);

/// Events of one kind.
struct Kind {
    last: Event,
    /// When one of them, or their number, was told.
    told: Duration,
    /// How many came since.
    more: u64,
}

impl Repeats {
    /// Whether to tell an event that came at `now`, on any clock. Otherwise it is counted.
    pub(super) fn is_news(&mut self, event: &Event, now: Duration) -> bool {
        let same = |kind: &&mut Kind| event.repeats(&kind.last);
        if let Some(kind) = self.0.iter_mut().find(same) {
            kind.last = *event;
            kind.more += 1;
            return false;
        }
        self.0.push(Kind {
            last: *event,
            told: now,
            more: 0,
        });
        true
    }

    /// What was counted and is to be told at `now`: the last event of each kind, and how many came.
    pub(super) fn due(&mut self, now: Duration) -> Vec<(Event, u64)> {
        let mut due = Vec::new();
        self.0.retain_mut(|kind| {
            let over = now.saturating_sub(kind.told) >= COUNTED;
            if over && kind.more > 0 {
                due.push((kind.last, kind.more));
                (kind.told, kind.more) = (now, 0);
                return true;
            }
            !over
        });
        due
    }
}

/// The line for events that were counted.
pub(super) fn told(text: &str, more: u64) -> String {
    match more {
        1 => format!("{text} (once more)"),
        _ => format!("{text} ({more} times more)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Hold;

    #[test]
    fn a_flood_is_told_once_and_counted() {
        let mut repeats = Repeats::default();
        let (mut told, mut counted) = (0, Vec::new());
        for cycle in 0..1000 {
            let now = Duration::from_millis(2 * cycle);
            let late = Event::LateSetpoint { bus: 0, cycle };
            told += u64::from(repeats.is_news(&late, now));
            told += u64::from(repeats.is_news(&Event::MissedTPdo { device: 1 }, now));
            counted.extend(repeats.due(now));
        }
        counted.extend(repeats.due(Duration::MAX));
        assert_eq!(told, 2);
        assert_eq!(
            told + counted.iter().map(|(_, more)| more).sum::<u64>(),
            2000
        );
        // Two kinds in two seconds.
        assert!(counted.len() <= 4, "{counted:?}");
        assert!(repeats.due(Duration::MAX).is_empty());
    }

    #[test]
    fn what_is_not_the_same_is_told() {
        let mut repeats = Repeats::default();
        let now = Duration::ZERO;
        for event in [
            Event::MissedTPdo { device: 1 },
            Event::MissedTPdo { device: 2 },
            Event::LateSetpoint { bus: 0, cycle: 5 },
            Event::LateSetpoint { bus: 1, cycle: 5 },
            Event::Held(Hold::Operator),
            Event::Resumed,
            Event::Held(Hold::Operator),
        ] {
            assert!(repeats.is_news(&event, now), "{event:?}");
        }
        assert!(repeats.due(Duration::from_secs(2)).is_empty());
        assert!(repeats.is_news(&Event::MissedTPdo { device: 1 }, Duration::from_secs(2)));
    }
}
