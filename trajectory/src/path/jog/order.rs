//! What is ordered of axes off the path, and why it is refused.

/// An order to single axes, in machine coordinates. As fast as the axes' limits and the rapid
/// override allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Jog<const N: usize> {
    /// On and on, to the soft limit if no other order comes.
    Continuous {
        /// Which one.
        axis: usize,
        /// mm/s; its sign is the direction.
        velocity: f64,
    },
    /// By a distance: from the position that the last order leads the axis to, so that steps add up,
    /// or from where it can come to rest soonest. A soft limit ends it.
    Step {
        /// Which one.
        axis: usize,
        /// mm
        distance: f64,
        /// The highest, mm/s; may be infinite.
        speed: f64,
    },
    /// To these positions, mm, each axis as fast as it can.
    To([Option<f64>; N]),
    /// To these positions, mm, on a straight line. Axes that move otherwise come to rest first.
    Line {
        /// Where to.
        to: [Option<f64>; N],
        /// The highest along the line, mm/s; may be infinite.
        speed: f64,
    },
}

/// Why an order is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum JogError {
    /// The path has to rest.
    #[error("the path is not at rest")]
    Moving,
    /// There is no such axis.
    #[error("there is no axis {0}")]
    NoAxis(usize),
    /// A position is outside of the axis' soft limits.
    #[error("axis {axis} would go to {to}, and may go from {min} to {max}")]
    OutsideTravel {
        /// The axis.
        axis: usize,
        /// Where it would go, mm.
        to: f64,
        /// The least position that it may go to, mm: of its soft limits, or where it is beyond them.
        min: f64,
        /// The greatest, mm.
        max: f64,
    },
    /// A position, a distance or a speed is not a number.
    #[error("a position, distance or speed is not a number")]
    NotANumber,
    /// The speed, or the rapid override, is 0.
    #[error("the speed or the rapid override is 0")]
    NoSpeed,
}
