//! Lead error of a screw, rack or scale: what the load's position is off by over the travel.

/// A table over the travel, linear between its points and constant beyond its ends. The encoder on
/// the motor knows nothing of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeadError {
    /// Position and error, both in revolutions of the shaft, in ascending order of position.
    points: Vec<(f64, f64)>,
}

impl LeadError {
    /// The table of these points, position and error in revolutions, in any order.
    #[must_use]
    pub fn new(mut points: Vec<(f64, f64)>) -> Self {
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        Self { points }
    }

    /// The error at a position, both in revolutions.
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        let above = self.points.partition_point(|point| point.0 <= position);
        match (
            above.checked_sub(1).map(|it| self.points[it]),
            self.points.get(above),
        ) {
            (None, None) => 0.0,
            (Some((_, error)), None) | (None, Some(&(_, error))) => error,
            (Some((from, least)), Some(&(to, most))) => {
                least + (most - least) * (position - from) / (to - from)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_its_points_and_constant_beyond_them() {
        let table = LeadError::new(vec![(2.0, 0.5), (0.0, 0.1), (4.0, 0.5)]);
        for (position, error) in [(-9.0, 0.1), (0.0, 0.1), (1.0, 0.3), (3.0, 0.5), (9.0, 0.5)] {
            assert!((table.at(position) - error).abs() < 1e-12, "at {position}");
        }
        assert_eq!(LeadError::default().at(1.0), 0.0);
    }
}
