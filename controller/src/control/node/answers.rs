//! Which of a device's T_PDOs answer which SYNC.

use crate::control::fault::DeviceCause;
use syncline_canopen::Frame;

/// Before the first SYNC no T_PDO is late.
const NOTHING_OWED: u32 = u32::MAX;

/// A device's T_PDOs of the running cycle and of those before, one bit each.
#[derive(Clone, Debug)]
pub(super) struct Answers {
    /// Those that came since SYNC, and as what.
    arrived: u32,
    frames: Vec<Frame>,
    /// Those that did not come to the SYNC before, and to the one before that: they may come late.
    owed: [u32; 2],
    /// A T_PDO came a second time to this SYNC, the same bit by bit, and one to the SYNC before.
    twice: bool,
    was_twice: bool,
}

impl Answers {
    /// Of a device with as many T_PDOs as there are `frames`.
    pub(super) fn new(frames: Vec<Frame>) -> Self {
        Self {
            arrived: NOTHING_OWED,
            frames,
            owed: [0; 2],
            twice: false,
            was_twice: false,
        }
    }

    /// Knows of no SYNC any more.
    pub(super) fn forget(&mut self) {
        (self.arrived, self.owed) = (NOTHING_OWED, [0; 2]);
        (self.twice, self.was_twice) = (false, false);
    }

    /// SYNC leaves: what came before it no longer counts. `was_due`: to the SYNC before there was an answer to come.
    pub(super) fn on_sync(&mut self, was_due: bool) {
        let missing = !std::mem::take(&mut self.arrived);
        self.owed = [if was_due { missing } else { 0 }, self.owed[0]];
        self.was_twice = std::mem::take(&mut self.twice);
    }

    /// Counts a T_PDO as an answer to the running cycle's SYNC; whether it is to be taken.
    ///
    /// # Errors
    /// Two devices answer.
    pub(super) fn count(&mut self, t_pdo: usize, frame: &Frame) -> Result<bool, DeviceCause> {
        let bit = 1 << t_pdo;
        let second = self.arrived & bit != 0;
        let owed = self.owed.iter_mut().rev().find(|owed| **owed & bit != 0);
        if second && owed.is_none() {
            if self.frames[t_pdo] != *frame {
                return Err(DeviceCause::SecondTPdo);
            }
            // CAN itself may hand over a frame twice, where its sender saw an error in the last bit. Once.
            self.twice = true;
            return match self.was_twice {
                true => Err(DeviceCause::TwoNodes),
                false => Ok(false),
            };
        }
        // The one before was late, which its SYNC was told of.
        if let Some(owed) = owed.filter(|_| second) {
            *owed &= !bit;
        }
        self.arrived |= bit;
        self.frames[t_pdo] = *frame;
        Ok(true)
    }

    /// Whether every T_PDO has come to this SYNC.
    pub(super) fn are_complete(&self) -> bool {
        self.arrived.count_ones() as usize == self.frames.len()
    }
}
