//! The cascade in the drive: position loop with velocity feed-forward, speed loop, torque limit.
//!
//! The manual at hand names these parameters (3011h…3013h) without their values; the defaults
//! here are assumptions that let the default [`Rigid`](crate::mechanics::rigid::Rigid) axis follow well.

/// Steps of the speed loop per step of the position loop.
pub const SPEED_STEPS: u32 = 4;

/// Nominal time between two steps of the position loop, nanoseconds.
pub const POSITION_STEP_NS: u64 = 250_000;

/// Nominal time between two steps of the speed loop, nanoseconds.
pub const SPEED_STEP_NS: u64 = POSITION_STEP_NS / SPEED_STEPS as u64;

/// Gains and limits of the cascade.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// Position loop, 1/s (`CTRL1_KPp`).
    pub position: f64,
    /// Share of the reference's velocity that goes straight to the speed loop (`CTRL1_KFPp`).
    pub velocity_feed_forward: f64,
    /// Speed loop, N·m per rev/s (`CTRL1_KPn`).
    pub speed: f64,
    /// Integral time of the speed loop, s (`CTRL1_TNn`).
    pub speed_integral_time: f64,
    /// Time constant of the filter on the speed reference, s (`CTRL1_TAUnref`).
    pub speed_reference_filter: f64,
    /// Time constant of the filter on the measured speed, s (`CTRL_TAUnact`).
    pub speed_filter: f64,
    /// Continuous stall torque, N·m: 100 % of 6071h and 6077h (`_M_M_0`).
    pub continuous_torque: f64,
    /// Largest torque, N·m (`CTRL_I_max`).
    pub torque_limit: f64,
    /// Largest speed reference, rev/s (`CTRL_v_max`).
    pub speed_limit: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self {
            position: 80.0,
            velocity_feed_forward: 0.0,
            speed: 1.6,
            speed_integral_time: 0.009,
            speed_reference_filter: 0.5e-3,
            speed_filter: 0.2e-3,
            continuous_torque: 1.4,
            torque_limit: 4.2,
            speed_limit: 110.0,
        }
    }
}

/// What the loops are to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// The power stage is off: no torque.
    Off,
    /// A position in increments and its velocity in increments/s.
    Position {
        /// Where, increments from the encoder's zero.
        position: f64,
        /// How fast the reference moves there.
        velocity: f64,
    },
    /// A velocity in rev/s.
    Velocity(f64),
    /// A torque in N·m.
    Torque(f64),
}

/// The state of the cascade.
#[derive(Clone, Debug)]
pub struct Cascade {
    /// Gains in force.
    pub gains: Gains,
    speed_reference: f64,
    filtered_reference: f64,
    filtered_speed: f64,
    integral: f64,
    last_encoder: i64,
    torque: f64,
}

impl Cascade {
    /// Loops at rest over an encoder that reads `encoder`.
    #[must_use]
    pub fn new(gains: Gains, encoder: i64) -> Self {
        Self {
            gains,
            speed_reference: 0.0,
            filtered_reference: 0.0,
            filtered_speed: 0.0,
            integral: 0.0,
            last_encoder: encoder,
            torque: 0.0,
        }
    }

    /// Torque that the motor delivers now, N·m.
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// Starts again from the measured speed, without stored torque: the power stage goes on.
    pub fn reset(&mut self) {
        self.speed_reference = self.filtered_speed;
        self.filtered_reference = self.filtered_speed;
        self.integral = 0.0;
        self.torque = 0.0;
    }

    /// One step of the position loop.
    pub fn position_step(&mut self, reference: Reference, encoder: i64, increments_per_rev: f64) {
        let limit = self.gains.speed_limit;
        self.speed_reference = match reference {
            Reference::Position { position, velocity } => {
                let error = (position - encoder as f64) / increments_per_rev;
                let forward = velocity / increments_per_rev * self.gains.velocity_feed_forward;
                (forward + self.gains.position * error).clamp(-limit, limit)
            }
            Reference::Velocity(velocity) => velocity.clamp(-limit, limit),
            Reference::Off | Reference::Torque(_) => 0.0,
        };
    }

    /// One step of the speed loop of nominally `h` seconds; returns the torque in N·m.
    pub fn speed_step(
        &mut self,
        reference: Reference,
        encoder: i64,
        increments_per_rev: f64,
        h: f64,
    ) -> f64 {
        let gains = &self.gains;
        let moved = (encoder - self.last_encoder) as f64;
        self.last_encoder = encoder;
        let measured = moved / (increments_per_rev * h);
        self.filtered_speed += (measured - self.filtered_speed) * (h / (gains.speed_filter + h));
        self.torque = match reference {
            Reference::Off => 0.0,
            Reference::Torque(torque) => torque.clamp(-gains.torque_limit, gains.torque_limit),
            Reference::Position { .. } | Reference::Velocity(_) => {
                let smoothing = h / (gains.speed_reference_filter + h);
                self.filtered_reference +=
                    (self.speed_reference - self.filtered_reference) * smoothing;
                let error = self.filtered_reference - self.filtered_speed;
                let integral = self.integral + gains.speed / gains.speed_integral_time * error * h;
                let wanted = gains.speed * error + integral;
                let torque = wanted.clamp(-gains.torque_limit, gains.torque_limit);
                // A saturated loop does not wind up.
                if torque == wanted {
                    self.integral = integral;
                }
                torque
            }
        };
        self.torque
    }
}
