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
    /// Actual position in the plan's frame, mm; of a gantry the mean of its sides.
    pub middle: f64,
    /// What the drives told of their torque at this SYNC; `None` where the T_PDOs of one carry none or did not come.
    pub torque: Option<ToldTorque>,
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
    /// Of a gantry the mean of its sides.
    pub mean: f64,
    /// The greatest amount that a drive told.
    pub greatest: f64,
}

impl ToldTorque {
    /// Of an axis whose sides, if it has any, told the same.
    #[must_use]
    pub fn alike(torque: f64) -> Self {
        Self {
            mean: torque,
            greatest: torque.abs(),
        }
    }

    /// What these drives told, if each of them told it.
    pub(super) fn of(told: impl ExactSizeIterator<Item = Option<i16>>) -> Option<Self> {
        let drives = told.len() as f64;
        let mut all = Self::default();
        for torque in told {
            let torque = f64::from(torque?);
            all.mean += torque / drives;
            all.greatest = all.greatest.max(torque.abs());
        }
        Some(all)
    }
}
