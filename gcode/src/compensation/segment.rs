//! Lines and circular arcs in a plane: offsets, crossings, distances.

use std::f64::consts::{PI, TAU};

/// A point or a vector in the plane, mm.
pub(crate) type Vector = [f64; 2];

/// What arithmetic on coordinates may round, mm.
pub(crate) const ROUNDING: f64 = 1e-9;

pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

/// `from` moved by `length` along `direction`.
pub(crate) fn along(from: Vector, direction: Vector, length: f64) -> Vector {
    [
        from[0] + direction[0] * length,
        from[1] + direction[1] * length,
    ]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(crate) fn cross(a: Vector, b: Vector) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The vector turned a quarter to the left.
pub(crate) fn left_of(vector: Vector) -> Vector {
    [-vector[1], vector[0]]
}

pub(crate) fn distance(a: Vector, b: Vector) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

fn angle(vector: Vector) -> f64 {
    libm::atan2(vector[1], vector[0])
}

/// An angle brought into 0 … 2π, where what lies just below 2π by rounding counts as just below 0.
fn once_round(angle: f64, rounding: f64) -> f64 {
    let angle = angle.rem_euclid(TAU);
    if angle > TAU - rounding {
        angle - TAU
    } else {
        angle
    }
}

/// A line or an arc with a sense.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Segment {
    Line { from: Vector, to: Vector },
    Arc(CircularArc),
}

/// An arc with a sense.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CircularArc {
    pub(crate) center: Vector,
    pub(crate) radius: f64,
    /// Angle of the start about the centre, rad.
    pub(crate) start: f64,
    /// Angle swept, rad, positive to the left.
    pub(crate) sweep: f64,
}

impl CircularArc {
    fn length(&self) -> f64 {
        self.radius * self.sweep.abs()
    }

    /// The point at an angle.
    fn at(&self, angle: f64) -> Vector {
        along(
            self.center,
            [libm::cos(angle), libm::sin(angle)],
            self.radius,
        )
    }

    fn end(&self) -> f64 {
        self.start + self.sweep
    }
}

impl Segment {
    pub(crate) fn length(&self) -> f64 {
        match *self {
            Segment::Line { from, to } => distance(from, to),
            Segment::Arc(arc) => arc.length(),
        }
    }

    pub(crate) fn from(&self) -> Vector {
        match *self {
            Segment::Line { from, .. } => from,
            Segment::Arc(arc) => arc.at(arc.start),
        }
    }

    pub(crate) fn to(&self) -> Vector {
        match *self {
            Segment::Line { to, .. } => to,
            Segment::Arc(arc) => arc.at(arc.end()),
        }
    }

    /// Unit vectors along the segment at its start and at its end.
    pub(crate) fn directions(&self) -> [Vector; 2] {
        match *self {
            Segment::Line { from, to } => {
                let length = distance(from, to);
                [[(to[0] - from[0]) / length, (to[1] - from[1]) / length]; 2]
            }
            Segment::Arc(arc) => {
                let left = arc.sweep.signum();
                [arc.start, arc.end()]
                    .map(|angle| left_of([left * libm::cos(angle), left * libm::sin(angle)]))
            }
        }
    }

    /// Curvature, 1/mm, positive to the left.
    pub(crate) fn curvature(&self) -> f64 {
        match *self {
            Segment::Line { .. } => 0.0,
            Segment::Arc(arc) => arc.sweep.signum() / arc.radius,
        }
    }

    /// How far the direction turns from start to end, rad, positive to the left.
    pub(crate) fn turning(&self) -> f64 {
        match *self {
            Segment::Line { .. } => 0.0,
            Segment::Arc(arc) => arc.sweep,
        }
    }

    /// The parallel at a distance to the left; `None` where an arc has no such parallel.
    pub(crate) fn parallel(&self, left: f64) -> Option<Segment> {
        match *self {
            Segment::Line { from, to } => {
                let aside = left_of(self.directions()[0]);
                Some(Segment::Line {
                    from: along(from, aside, left),
                    to: along(to, aside, left),
                })
            }
            Segment::Arc(arc) => {
                let radius = arc.radius - left * arc.sweep.signum();
                (radius > ROUNDING).then_some(Segment::Arc(CircularArc { radius, ..arc }))
            }
        }
    }

    /// How far a point of the segment is ahead of its start, mm: negative by rounding at most.
    pub(crate) fn ahead(&self, point: Vector) -> f64 {
        match *self {
            Segment::Line { from, .. } => dot(minus(point, from), self.directions()[0]),
            Segment::Arc(arc) => {
                let towards = angle(minus(point, arc.center));
                let passed = (towards - arc.start) * arc.sweep.signum();
                arc.radius * once_round(passed, (ROUNDING / arc.radius).max(1e-12))
            }
        }
    }

    /// How far a point of the segment is behind its end, mm: negative by rounding at most.
    pub(crate) fn behind(&self, point: Vector) -> f64 {
        self.reversed().ahead(point)
    }

    fn reversed(&self) -> Segment {
        match *self {
            Segment::Line { from, to } => Segment::Line { from: to, to: from },
            Segment::Arc(arc) => Segment::Arc(CircularArc {
                start: arc.end(),
                sweep: -arc.sweep,
                ..arc
            }),
        }
    }

    /// The segment with this much taken off its start; what is less than nothing is added.
    pub(crate) fn without_start(&self, length: f64) -> Segment {
        self.without_start_along(length, self.directions()[0])
    }

    /// The segment with this much taken off its end.
    pub(crate) fn without_end(&self, length: f64) -> Segment {
        self.reversed().without_start(length).reversed()
    }

    /// The segment with this much taken off its start. Of a line nothing may be left, so that its direction is told.
    pub(crate) fn without_start_along(&self, length: f64, direction: Vector) -> Segment {
        match *self {
            Segment::Line { from, to } => Segment::Line {
                from: along(from, direction, length),
                to,
            },
            Segment::Arc(arc) => {
                let angle = length / arc.radius * arc.sweep.signum();
                Segment::Arc(CircularArc {
                    start: arc.start + angle,
                    sweep: arc.sweep - angle,
                    ..arc
                })
            }
        }
    }

    /// The same at its end.
    pub(crate) fn without_end_along(&self, length: f64, direction: Vector) -> Segment {
        let back = direction.map(|x| -x);
        self.reversed().without_start_along(length, back).reversed()
    }

    /// The segment in so many equal parts.
    pub(crate) fn parts(self, count: u32) -> impl Iterator<Item = Segment> {
        let count = f64::from(count);
        (0..count as u32).map(move |part| match self {
            Segment::Line { from, to } => {
                let at = |part: f64| [0, 1].map(|k| from[k] + (to[k] - from[k]) * part / count);
                let part = f64::from(part);
                let to = if part + 1.0 < count {
                    at(part + 1.0)
                } else {
                    to
                };
                Segment::Line { from: at(part), to }
            }
            Segment::Arc(arc) => Segment::Arc(CircularArc {
                start: arc.start + arc.sweep * f64::from(part) / count,
                sweep: arc.sweep / count,
                ..arc
            }),
        })
    }

    /// Where the lines and circles that two segments are parts of cross; for parallel lines and
    /// for circles apart there are none.
    pub(crate) fn crossings(&self, other: &Segment) -> [Option<Vector>; 2] {
        match (*self, *other) {
            (
                Segment::Line { from, .. },
                Segment::Line {
                    from: other_from, ..
                },
            ) => {
                let (direction, other) = (self.directions()[0], other.directions()[0]);
                let length = cross(minus(other_from, from), other) / cross(direction, other);
                let crossing = along(from, direction, length);
                [length.is_finite().then_some(crossing), None]
            }
            (Segment::Line { from, .. }, Segment::Arc(arc)) => {
                line_and_circle(from, self.directions()[0], &arc)
            }
            (Segment::Arc(_), Segment::Line { .. }) => other.crossings(self),
            (Segment::Arc(arc), Segment::Arc(other)) => circles(&arc, &other),
        }
    }

    /// Whether a point of the segment's line or circle lies within the segment.
    pub(crate) fn holds(&self, point: Vector) -> bool {
        let ahead = self.ahead(point);
        ahead >= -ROUNDING && ahead <= self.length() + ROUNDING
    }

    /// The least distance between two segments, mm.
    ///
    /// It is zero where they cross, and else between an end and the other segment, or where both
    /// are at right angles to the straight line between them: for circles on the line through the
    /// centres, for a line and a circle on the perpendicular through the centre.
    pub(crate) fn distance(&self, other: &Segment) -> f64 {
        let crossing = |point: &Vector| self.holds(*point) && other.holds(*point);
        if self.crossings(other).iter().flatten().any(crossing) {
            return 0.0;
        }
        let ends = |a: &Segment, b: &Segment| a.distance_to(b.from()).min(a.distance_to(b.to()));
        let mut least = ends(self, other).min(ends(other, self));
        let facing = match (self, other) {
            (Segment::Arc(arc), _) => Some((arc.center, self, other)),
            (_, Segment::Arc(arc)) => Some((arc.center, other, self)),
            _ => None,
        };
        if let Some((center, arc, across)) = facing {
            for foot in across.feet(center).into_iter().flatten() {
                if across.holds(foot) {
                    least = least.min(arc.distance_to(foot));
                }
            }
        }
        least
    }

    /// Where the segment is first touched by another one that goes along: how far that is along this one
    /// and along the other, mm. They touch where they are no farther apart than `most`.
    pub(crate) fn touches(&self, other: &Segment, most: f64) -> Option<[f64; 2]> {
        let crossing = |point: Vector| {
            let holds = self.holds(point) && other.holds(point);
            holds.then(|| [self.ahead(point), other.ahead(point)])
        };
        let from_other = |point: Vector| {
            let (ahead, apart) = self.nearest(point);
            (apart <= most).then(|| [ahead, other.ahead(point)])
        };
        let from_this = |point: Vector| {
            let (ahead, apart) = other.nearest(point);
            (apart <= most).then(|| [self.ahead(point), ahead])
        };
        let crossings = self.crossings(other).into_iter().flatten();
        let feet = self.foot_of_center(other).into_iter().flatten();
        let feet = feet.filter(|foot| self.holds(*foot));
        (crossings.filter_map(crossing))
            .chain(
                [other.from(), other.to()]
                    .into_iter()
                    .filter_map(from_other),
            )
            .chain(
                [self.from(), self.to()]
                    .into_iter()
                    .chain(feet)
                    .filter_map(from_this),
            )
            .min_by(|a, b| a[1].total_cmp(&b[1]))
    }

    /// The points of this one's line or circle that are nearest to, and farthest from, the centre of another one.
    fn foot_of_center(&self, other: &Segment) -> [Option<Vector>; 2] {
        match other {
            Segment::Arc(arc) => self.feet(arc.center),
            Segment::Line { .. } => [None; 2],
        }
    }

    /// The distance of a point from the segment, mm.
    fn distance_to(&self, point: Vector) -> f64 {
        self.nearest(point).1
    }

    /// How far the point that is nearest to another is ahead of the segment's start, and how far the two are apart, mm.
    fn nearest(&self, point: Vector) -> (f64, f64) {
        let ends = [(0.0, self.from()), (self.length(), self.to())];
        let feet = self.feet(point).into_iter().flatten();
        let feet = feet.filter(|foot| self.holds(*foot));
        (feet.map(|foot| (self.ahead(foot), foot)).chain(ends))
            .map(|(ahead, nearest)| (ahead, distance(point, nearest)))
            .fold((0.0, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a })
    }

    /// The points of the segment's line or circle whose perpendicular goes through a point.
    fn feet(&self, point: Vector) -> [Option<Vector>; 2] {
        match *self {
            Segment::Line { from, .. } => {
                let direction = self.directions()[0];
                let length = dot(minus(point, from), direction);
                [Some(along(from, direction, length)), None]
            }
            Segment::Arc(arc) => {
                let towards = angle(minus(point, arc.center));
                [towards, towards + PI].map(|angle| Some(arc.at(angle)))
            }
        }
    }

    /// Least and greatest coordinates: a box that holds the segment, not always the smallest.
    pub(crate) fn extent(&self) -> [Vector; 2] {
        let (from, to) = (self.from(), self.to());
        let bulge = match *self {
            Segment::Line { .. } => 0.0,
            // Of an arc up to a half turn; a longer one stays within the diameter.
            Segment::Arc(arc) if arc.sweep.abs() < 3.0 => {
                arc.radius * (1.0 - libm::cos(arc.sweep / 2.0))
            }
            Segment::Arc(arc) => 2.0 * arc.radius,
        };
        [
            [from[0].min(to[0]) - bulge, from[1].min(to[1]) - bulge],
            [from[0].max(to[0]) + bulge, from[1].max(to[1]) + bulge],
        ]
    }
}

fn line_and_circle(from: Vector, direction: Vector, arc: &CircularArc) -> [Option<Vector>; 2] {
    let (to_center, radius) = (minus(arc.center, from), arc.radius);
    let (nearest, aside) = (dot(to_center, direction), cross(to_center, direction));
    let half = ((radius - aside) * (radius + aside)).sqrt();
    if half.is_nan() {
        return [None; 2];
    }
    [nearest - half, nearest + half].map(|length| Some(along(from, direction, length)))
}

fn circles(one: &CircularArc, other: &CircularArc) -> [Option<Vector>; 2] {
    let (a, radius_a, b, radius_b) = (one.center, one.radius, other.center, other.radius);
    let apart = distance(a, b);
    let direction = [(b[0] - a[0]) / apart, (b[1] - a[1]) / apart];
    let nearest = (apart + (radius_a - radius_b) * (radius_a + radius_b) / apart) / 2.0;
    let half = ((radius_a - nearest) * (radius_a + nearest)).sqrt();
    if half.is_nan() || apart < ROUNDING {
        return [None; 2];
    }
    let foot = along(a, direction, nearest);
    [half, -half].map(|half| Some(along(foot, left_of(direction), half)))
}
