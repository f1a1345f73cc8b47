//! Devices that tell a position.

use super::{Increments, RemoteNode};
use syncline_canopen::Frame;

/// A device with a position, which it samples at SYNC and sends in one of its T_PDOs.
pub trait Feedback: RemoteNode {
    /// What the data of a T_PDO, all its mapped bytes, say of the position; `None` if that PDO
    /// carries none.
    fn sample(&self, t_pdo: usize, data: &[u8]) -> Option<Sample>;

    /// After so many increments the position begins anew at 0, as an encoder's does that tells only
    /// so many turns apart; above zero. `None`: it counts on. See [`unwrapped`].
    fn range(&self) -> Option<Increments> {
        None
    }

    /// Whether it counts on from where it stood without supply. Otherwise its position says nothing of the
    /// machine's until something tells where it stands.
    fn counts_without_power(&self) -> bool {
        true
    }

    /// Its T_PDOs in motion, at `position`: what the bus typically carries.
    fn in_motion(&self, position: Increments) -> Vec<Frame>;
}

/// Where a device was at a SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// As the device counts.
    pub position: Increments,
}

/// The position behind a `reading` that begins anew after each `range`: of all that read so, the one
/// nearest to `known`, where the device was shortly before. It is the right one as long as the device
/// has moved by less than half its range since. Without a range it is the reading.
#[must_use]
pub fn unwrapped(reading: Increments, range: Option<Increments>, known: Increments) -> Increments {
    let Some(range) = range.map(Increments::get) else {
        return reading;
    };
    let ahead = (reading - known).get().rem_euclid(range);
    let back = ahead - range;
    known + Increments::new(if ahead <= -back { ahead } else { back })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_turn_over_goes_on_in_both_directions() {
        let at = |reading, known| {
            let [reading, range, known] = [reading, 8192, known].map(Increments::new);
            unwrapped(reading, Some(range), known).get()
        };
        assert_eq!(at(5, 8190), 8197);
        assert_eq!(at(8190, 5), -2);
        assert_eq!(at(8190, 8192 * 7 + 5), 8192 * 7 - 2);
        assert_eq!(at(100, 100), 100);
    }

    proptest! {
        /// Wherever a device goes in steps of less than half its range, and whatever its range is.
        #[test]
        fn every_way_is_followed(
            range in 3i64..1 << 32,
            start in -(1i64 << 40)..1 << 40,
            steps in prop::collection::vec(-1.0..1.0f64, 1..50),
        ) {
            let (mut there, mut known) = (start, start);
            for step in steps {
                // Less than half, either way.
                there += (step * ((range - 1) / 2) as f64) as i64;
                let reading = Increments::new(there.rem_euclid(range));
                known = unwrapped(reading, Some(Increments::new(range)), Increments::new(known)).get();
                prop_assert_eq!(known, there);
            }
        }
    }
}
