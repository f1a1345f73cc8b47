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
    /// What the drive of an axis of one drive told of its torque at this SYNC, in the axis's positive direction, in
    /// thousandths of the motor's rated torque; `None` where its T_PDOs carry none or did not come.
    pub torque: Option<i16>,
    /// What the drive of an axis of one drive was sent as velocity for this SYNC, in whole units of its own, mm/s; `None` if it is
    /// sent positions, or if where the axis was at this SYNC is not known.
    pub velocity: Option<f64>,
    /// Its drives were quick-stopped and come to rest by themselves, or go to a target by themselves: they follow no
    /// setpoint; the one here is the actual position.
    pub by_itself: bool,
    /// It is being homed: its soft limits do not count, as its switch may be beyond them.
    pub in_homing: bool,
}
