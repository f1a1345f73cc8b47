//! Where a device is: as it counts, and in mm. It is converted when it changes, once for all who ask in a cycle.

use syncline_drives::model::{Increments, Scaling};

/// The last position that a device told, and what that means.
#[derive(Clone, Debug)]
pub(super) struct Place {
    scaling: Scaling,
    counts: Increments,
    origin: Increments,
    offset: Increments,
    machine_mm: f64,
    plan_mm: f64,
    /// How often it was converted.
    #[cfg(test)]
    conversions: u64,
}

impl Place {
    pub(super) fn new(scaling: Scaling, counts: Increments) -> Self {
        let mut place = Self {
            scaling,
            counts,
            origin: Increments::ZERO,
            offset: Increments::ZERO,
            machine_mm: 0.0,
            plan_mm: 0.0,
            #[cfg(test)]
            conversions: 0,
        };
        place.convert();
        place
    }

    fn convert(&mut self) {
        #[cfg(test)]
        {
            self.conversions += 1;
        }
        self.machine_mm = self.scaling.to_mm(self.counts - self.origin);
        self.plan_mm = match self.offset == self.origin {
            true => self.machine_mm,
            false => self.scaling.to_mm(self.counts - self.offset),
        };
    }

    /// It is where it counts so many.
    pub(super) fn move_to(&mut self, counts: Increments) {
        self.counts = counts;
        self.convert();
    }

    /// It counts so many at machine position 0, beyond the `zero` of the machine file.
    pub(super) fn set_origin(&mut self, origin: Increments) {
        self.origin = origin;
        self.convert();
    }

    /// It counts so many where the plan has its axis at 0, beyond the `zero` of the machine file.
    pub(super) fn set_offset(&mut self, offset: Increments) {
        self.offset = offset;
        self.convert();
    }

    pub(super) fn counts(&self) -> Increments {
        self.counts
    }

    pub(super) fn origin(&self) -> Increments {
        self.origin
    }

    pub(super) fn offset(&self) -> Increments {
        self.offset
    }

    #[cfg(test)]
    pub(super) fn conversions(&self) -> u64 {
        self.conversions
    }

    /// Its machine position, mm.
    pub(super) fn machine_mm(&self) -> f64 {
        self.machine_mm
    }

    /// Its position in the plan, mm.
    pub(super) fn plan_mm(&self) -> f64 {
        self.plan_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use syncline_drives::model::Direction;

    proptest! {
        /// Whatever changes last, and in whichever order: both positions are those of the count.
        #[test]
        fn positions_are_those_of_the_count(
            zero in -1_000_000_i64..1_000_000,
            changes in prop::collection::vec((0_u8..3, -1_000_000_000_i64..1_000_000_000), 0..20),
        ) {
            let scaling = Scaling::new(131_072, 5.0, Direction::Negative, Increments::new(zero));
            let mut place = Place::new(scaling, Increments::ZERO);
            let mut told = [Increments::ZERO; 3];
            for (what, value) in changes {
                let value = Increments::new(value);
                told[usize::from(what)] = value;
                match what {
                    0 => place.move_to(value),
                    1 => place.set_origin(value),
                    _ => place.set_offset(value),
                }
                let [counts, origin, offset] = told;
                prop_assert_eq!(place.machine_mm(), scaling.to_mm(counts - origin));
                prop_assert_eq!(place.plan_mm(), scaling.to_mm(counts - offset));
            }
        }
    }
}
