//! A touch probe and the work pieces that it touches.
//!
//! The tip of the probe is a ball about the machine position of X, Y and Z. It touches where the ball does, so that a
//! face is touched by the ball's radius in front of it.

/// So often the way between two places is halved in the search for the one where the tip touches: to 10⁻¹² of it.
const HALVINGS: u32 = 40;

/// A place in the machine, mm.
pub type Place = [f64; 3];

/// A work piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// All that is behind a plane.
    Plane {
        /// A point of it.
        at: Place,
        /// Which way is out of it, of length 1.
        normal: Place,
    },
    /// A box along the axes.
    Box {
        /// Its corner with the least coordinates.
        from: Place,
        /// Its corner with the greatest ones.
        to: Place,
    },
    /// A cylinder upright on X and Y.
    Cylinder {
        /// The middle of its foot.
        foot: Place,
        /// mm.
        radius: f64,
        /// mm.
        height: f64,
    },
}

/// A probe and what it may touch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TouchProbe {
    /// Radius of the ball at its tip, mm.
    pub radius: f64,
    /// The work pieces.
    pub solids: Vec<Solid>,
}

fn dot(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: Place) -> f64 {
    dot(a, a).sqrt()
}

/// From how far an outside is away across each of several directions, how far away it is; negative inside.
fn outside(across: Place) -> f64 {
    let greatest = across.into_iter().fold(f64::NEG_INFINITY, f64::max);
    length(across.map(|by| by.max(0.0))) + greatest.min(0.0)
}

impl Solid {
    /// How far a place is from its surface, mm; negative inside.
    #[must_use]
    pub fn distance(&self, place: Place) -> f64 {
        let from = |other: Place| [0, 1, 2].map(|axis: usize| place[axis] - other[axis]);
        match *self {
            Self::Plane { at, normal } => dot(from(at), normal),
            Self::Box { from: least, to } => outside(
                [0, 1, 2]
                    .map(|axis: usize| (least[axis] - place[axis]).max(place[axis] - to[axis])),
            ),
            Self::Cylinder {
                foot,
                radius,
                height,
            } => {
                let [x, y, z] = from(foot);
                let across = length([x, y, 0.0]) - radius;
                outside([across, (-z).max(z - height), f64::NEG_INFINITY])
            }
        }
    }
}

impl TouchProbe {
    /// How far the tip is from the nearest work piece, mm; negative where it touches.
    #[must_use]
    pub fn clearance(&self, place: Place) -> f64 {
        let distances = self.solids.iter().map(|solid| solid.distance(place));
        distances.fold(f64::INFINITY, f64::min) - self.radius
    }

    /// Whether the tip touches something there.
    #[must_use]
    pub fn touches(&self, place: Place) -> bool {
        self.clearance(place) <= 0.0
    }

    /// Between two places of which it touches something in one: the part of the way to where that changes.
    #[must_use]
    pub fn crossing(&self, from: Place, to: Place) -> f64 {
        let touches = self.touches(to);
        let (mut before, mut behind) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let part = 0.5 * (before + behind);
            let place = [0, 1, 2].map(|axis: usize| from[axis] + part * (to[axis] - from[axis]));
            if self.touches(place) == touches {
                behind = part;
            } else {
                before = part;
            }
        }
        behind
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_nearest_point() {
        let solid = Solid::Box {
            from: [0.0, 0.0, -10.0],
            to: [40.0, 30.0, 0.0],
        };
        assert_eq!(solid.distance([-5.0, 10.0, -5.0]), 5.0);
        assert_eq!(solid.distance([20.0, 15.0, 2.0]), 2.0);
        assert_eq!(solid.distance([43.0, 34.0, -5.0]), 5.0);
        assert_eq!(solid.distance([1.0, 15.0, -5.0]), -1.0);
        let solid = Solid::Cylinder {
            foot: [10.0, 20.0, -30.0],
            radius: 25.0,
            height: 30.0,
        };
        assert_eq!(solid.distance([40.0, 60.0, -10.0]), 25.0);
        assert_eq!(solid.distance([10.0, 20.0, 3.0]), 3.0);
        assert_eq!(solid.distance([34.0, 20.0, -10.0]), -1.0);
        let solid = Solid::Plane {
            at: [0.0, 0.0, -5.0],
            normal: [0.0, 0.0, 1.0],
        };
        assert_eq!(solid.distance([7.0, 8.0, -3.0]), 2.0);
    }

    #[test]
    fn the_tip_touches_a_face_by_its_radius() {
        let probe = TouchProbe {
            radius: 2.0,
            solids: vec![Solid::Box {
                from: [0.0; 3],
                to: [40.0, 30.0, 10.0],
            }],
        };
        let part = probe.crossing([-12.0, 15.0, 5.0], [8.0, 15.0, 5.0]);
        assert!((part - 0.5).abs() < 1e-11, "{part}");
        let back = probe.crossing([8.0, 15.0, 5.0], [-12.0, 15.0, 5.0]);
        assert!((back - 0.5).abs() < 1e-11, "{back}");
    }
}
