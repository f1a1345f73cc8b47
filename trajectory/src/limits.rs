//! The limits of one axis.

/// Velocity, acceleration and jerk limits of one axis, each direction its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Highest velocity, > 0 (length/s).
    pub v_max: f64,
    /// Lowest velocity, < 0 (length/s).
    pub v_min: f64,
    /// Highest acceleration, > 0 (length/s²).
    pub a_max: f64,
    /// Lowest acceleration, < 0 (length/s²).
    pub a_min: f64,
    /// Highest jerk, > 0 (length/s³).
    pub j_max: f64,
    /// Lowest jerk, < 0 (length/s³).
    pub j_min: f64,
}

impl Limits {
    /// The same limits in both directions.
    pub const fn symmetric(v: f64, a: f64, j: f64) -> Self {
        Limits {
            v_max: v,
            v_min: -v,
            a_max: a,
            a_min: -a,
            j_max: j,
            j_min: -j,
        }
    }

    /// The limits as seen with the axis's direction reversed.
    #[inline]
    pub const fn mirrored(&self) -> Self {
        Limits {
            v_max: -self.v_min,
            v_min: -self.v_max,
            a_max: -self.a_min,
            a_min: -self.a_max,
            j_max: -self.j_min,
            j_min: -self.j_max,
        }
    }

    /// The limits of a coordinate of which this axis is `factor` times: `factor` ≠ 0.
    pub fn projected(&self, factor: f64) -> Self {
        let l = if factor < 0.0 { self.mirrored() } else { *self };
        let f = factor.abs();
        Limits {
            v_max: l.v_max / f,
            v_min: l.v_min / f,
            a_max: l.a_max / f,
            a_min: l.a_min / f,
            j_max: l.j_max / f,
            j_min: l.j_min / f,
        }
    }

    /// The limits that keep both.
    pub fn intersection(&self, other: &Limits) -> Self {
        Limits {
            v_max: self.v_max.min(other.v_max),
            v_min: self.v_min.max(other.v_min),
            a_max: self.a_max.min(other.a_max),
            a_min: self.a_min.max(other.a_min),
            j_max: self.j_max.min(other.j_max),
            j_min: self.j_min.max(other.j_min),
        }
    }
}

/// The positions between which an axis may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionLimits {
    /// Lowest position (length).
    pub min: f64,
    /// Highest position (length).
    pub max: f64,
}
