//! What is seen of an axis in a cycle.

/// What an axis did at one SYNC.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisSample {
    /// The setpoint that the drives latched, of a gantry the side that is worse off, before quantisation, mm.
    pub set: f64,
    /// Where the drive of each side was sent by the setpoint that it latched itself, mm: sides that are late by different times latch different ones.
    pub of_side: [f64; 2],
    /// Actual position in the plan's frame, mm; of a gantry the side that is worse off.
    pub act: f64,
    /// What the drives were sent beyond the setpoint for backlash and lead error, and are beyond the actual position, mm.
    pub correction: f64,
    /// Setpoint minus actual position after removing the interpolation delay, mm.
    pub following_error: f64,
    /// Of a gantry: how far the second side was planned beyond the first, where that is being taken
    /// out, mm.
    pub apart: f64,
    /// How far it was sent beyond that, so that its sides go together, mm.
    pub coupled: f64,
    /// Actual position in the plan's frame, mm; of a gantry the mean of its sides.
    pub middle: f64,
    /// What the drives told of their torque at this SYNC.
    pub torque: ToldTorque,
    /// What the drive of an axis of one drive was sent as velocity for this SYNC, in whole units of its own, mm/s; `None` if it is
    /// sent positions, or if where the axis was at this SYNC is not known.
    pub velocity: Option<f64>,
    /// Its drives were quick-stopped and come to rest by themselves, or go to a target by themselves: they follow no
    /// setpoint; the one here is the actual position.
    pub by_itself: bool,
    /// It is being homed: its soft limits do not count, as its switch may be beyond them.
    pub in_homing: bool,
}

/// The torque that the drives of an axis told at one SYNC, in the axis's positive direction, in thousandths of their
/// motors' rated torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToldTorque {
    /// Of a gantry the mean of its sides; `None` where the T_PDOs of a drive carry none or did not come.
    pub mean: Option<f64>,
    /// The greatest amount that a drive told, 0 if none did.
    pub greatest: f64,
}

impl ToldTorque {
    /// Of an axis whose sides, if it has any, told the same.
    #[must_use]
    pub fn alike(torque: f64) -> Self {
        Self {
            mean: Some(torque),
            greatest: torque.abs(),
        }
    }

    /// What these drives told.
    pub(super) fn of(told: impl ExactSizeIterator<Item = Option<i16>>) -> Self {
        let drives = told.len() as f64;
        let mut all = Self::alike(0.0);
        for torque in told {
            let torque = torque.map(f64::from);
            let sum = all.mean.zip(torque);
            all.mean = sum.map(|(mean, torque)| mean + torque / drives);
            all.greatest = torque.map_or(0.0, f64::abs).max(all.greatest);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What bounds a drive's torque does not wait for the other one's.
    #[test]
    fn a_side_that_is_silent_hides_no_torque_of_the_other() {
        for (told, mean, greatest) in [
            (&[Some(-300)][..], Some(-300.0), 300.0),
            (&[None], None, 0.0),
            (&[Some(-300), Some(101)], Some(-99.5), 300.0),
            (&[Some(-300), None], None, 300.0),
            (&[None, Some(i16::MIN)], None, 32768.0),
        ] {
            let all = ToldTorque::of(told.iter().copied());
            assert_eq!(all, ToldTorque { mean, greatest }, "{told:?}");
        }
    }
}
