//! Profiles of constant-jerk segments: a start state and a fixed-size array of `{duration, jerk}`.
//!
//! Units are the caller's: a length (mm, deg) and seconds. Nothing here allocates.

use crate::double::Double;

/// Position, velocity and acceleration at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Position (length).
    pub p: f64,
    /// Velocity (length/s).
    pub v: f64,
    /// Acceleration (length/s²).
    pub a: f64,
}

impl State {
    /// A state at rest.
    pub const fn at_rest(p: f64) -> Self {
        State { p, v: 0.0, a: 0.0 }
    }

    /// The state `t` seconds later under the constant jerk `j`; `t` may be negative.
    #[inline]
    pub fn after(self, t: f64, j: f64) -> State {
        let jt = j * t;
        State {
            p: self.p + self.displacement(t, j),
            v: self.v + t * (self.a + 0.5 * jt),
            a: self.a + jt,
        }
    }

    /// Distance gained in `t` seconds under the constant jerk `j`. More exact than a difference of
    /// positions where the position is large.
    #[inline]
    pub fn displacement(self, t: f64, j: f64) -> f64 {
        t * (self.v + t * (0.5 * self.a + (1.0 / 6.0) * (j * t)))
    }

    /// Whether all three numbers are finite.
    pub fn is_finite(self) -> bool {
        self.p.is_finite() && self.v.is_finite() && self.a.is_finite()
    }
}

/// A stretch of constant jerk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Segment {
    /// Duration, ≥ 0 (s).
    pub duration: f64,
    /// Jerk (length/s³).
    pub jerk: f64,
}

/// The lowest and the highest value that a quantity takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lowest value.
    pub min: f64,
    /// Highest value.
    pub max: f64,
}

impl Range {
    const EMPTY: Range = Range {
        min: f64::INFINITY,
        max: f64::NEG_INFINITY,
    };

    fn take(&mut self, x: f64) {
        self.min = self.min.min(x);
        self.max = self.max.max(x);
    }
}

/// The ranges of position, velocity, acceleration and jerk over a whole profile, between its
/// segment ends too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extrema {
    /// Position (length).
    pub position: Range,
    /// Velocity (length/s).
    pub velocity: Range,
    /// Acceleration (length/s²).
    pub acceleration: Range,
    /// Jerk (length/s³); `{0, 0}` where the profile has no segment.
    pub jerk: Range,
}

/// A motion of one axis: a start state followed by at most [`Profile::CAPACITY`] segments of
/// constant jerk. `Copy`, without heap.
#[derive(Clone, Copy)]
pub struct Profile {
    start: State,
    /// Where it is known to end, which the segments say only to rounding.
    target: Option<State>,
    segments: [Segment; Profile::CAPACITY],
    len: usize,
}

impl Profile {
    /// More than the most segments that any planner here makes: six that bring a start outside the limits back into
    /// them, two extremal plans of seven about a hold, and the two parts in which that settles.
    pub const CAPACITY: usize = 24;

    /// A profile that stays at `start` and takes no time.
    #[inline]
    pub const fn new(start: State) -> Self {
        Profile {
            start,
            target: None,
            segments: [Segment {
                duration: 0.0,
                jerk: 0.0,
            }; Self::CAPACITY],
            len: 0,
        }
    }

    /// A profile without segments as yet that will lead to `target`.
    #[inline]
    pub(crate) const fn towards(start: State, target: Option<State>) -> Self {
        let mut profile = Profile::new(start);
        profile.target = target;
        profile
    }

    /// Appends a segment; one without duration adds nothing. `false` where the array is full.
    #[inline]
    #[must_use]
    pub fn push(&mut self, segment: Segment) -> bool {
        debug_assert!(segment.duration >= 0.0, "{segment:?}");
        if segment.duration > 0.0 {
            if self.len == Self::CAPACITY {
                return false;
            }
            self.segments[self.len] = segment;
            self.len += 1;
        }
        true
    }

    /// [`Profile::push`] for a planner that knows how many segments it makes.
    #[inline]
    pub(crate) fn append(&mut self, duration: f64, jerk: f64) {
        let room = self.push(Segment { duration, jerk });
        debug_assert!(room, "more segments than any plan has");
    }

    /// Adds to the jerk of a segment.
    pub(crate) fn bend(&mut self, segment: usize, jerk: f64) {
        self.segments[segment].jerk += jerk;
    }

    /// The state at time 0.
    #[inline]
    pub const fn start(&self) -> State {
        self.start
    }

    /// The segments in order.
    #[inline]
    pub fn segments(&self) -> &[Segment] {
        &self.segments[..self.len]
    }

    /// Sum of the segments' durations (s).
    pub fn duration(&self) -> f64 {
        self.segments().iter().map(|s| s.duration).sum()
    }

    /// The state at the end, by integration from the start.
    pub fn end(&self) -> State {
        let state = self
            .segments()
            .iter()
            .fold(Exact::leaving(self.start), |state, s| {
                state.after(s.duration, s.jerk)
            });
        state.rounded(self.start.p, 0.0, 0.0).0
    }

    /// The state at time `t` (s). Before the start it is the start state, after the end the end
    /// state: nothing is extrapolated.
    ///
    /// A position has to be rounded, and a state whose position is off its velocity and acceleration
    /// by a rounding is not one from which the rest of this motion is the fastest way on: by the cube
    /// root of that rounding. So the position is rounded the way the axis moves, and velocity and
    /// acceleration are those of the instant, less than one unit in the last place of the position
    /// later, at which the motion is exactly there.
    pub fn at(&self, t: f64) -> State {
        self.sample(t).0
    }

    /// The state of [`Profile::at`], and how much later than `t` the motion is in it (s). That is next to
    /// nothing but where the axis all but rests: there it is the cube root of the position's rounding, about
    /// a microsecond. A plan from that state begins then, or the motion would jump ahead in time.
    pub fn sample(&self, t: f64) -> (State, f64) {
        if t <= 0.0 {
            return (self.start, 0.0);
        }
        let duration = self.duration();
        // From the nearer end, so that what is left of a plan keeps its digits.
        match self.target {
            Some(target) if t >= duration => (target, 0.0),
            Some(target) if t > 0.5 * duration => {
                let mut rest = duration - t;
                let mut state = Exact::leaving(target);
                let speed = |s: &Segment| (s.jerk * s.duration * s.duration).abs();
                let fastest = self.segments().iter().map(speed).fold(0.0, f64::max);
                let ramp = |s: &Segment| (s.jerk * s.duration).abs();
                let hardest = self.segments().iter().map(ramp).fold(0.0, f64::max);
                for s in self.segments().iter().rev() {
                    // In a cruise the acceleration is zero but for rounding, which is not to add up. In
                    // the hold of a ramp it is not, however short that is.
                    let a = state.a.value().abs();
                    let is_rounding = a <= 1e-6 * hardest
                        && a * s.duration <= 1e-6 * fastest.max(state.v.value().abs());
                    if s.jerk == 0.0 && is_rounding {
                        state.a = Double::ZERO;
                    }
                    let part = s.duration.min(rest);
                    let earlier = state.after(-part, s.jerk);
                    if part < s.duration {
                        let (state, later) = earlier.rounded(target.p, s.jerk, part);
                        let arrived = state.p == target.p
                            && (state.v * part).abs() <= 4.0 * f64::EPSILON * target.p.abs();
                        return if arrived {
                            (target, part)
                        } else {
                            (state, later)
                        };
                    }
                    rest -= part;
                    state = earlier;
                }
                state.rounded(target.p, 0.0, 0.0)
            }
            _ => {
                let mut rest = t;
                let mut state = Exact::leaving(self.start);
                for s in self.segments() {
                    let part = s.duration.min(rest);
                    state = state.after(part, s.jerk);
                    if part < s.duration {
                        return state.rounded(self.start.p, s.jerk, s.duration - part);
                    }
                    rest -= part;
                }
                state.rounded(self.start.p, 0.0, 0.0)
            }
        }
    }

    /// The jerk at time `t` (length/s³); at a switch that of the segment that begins, outside the
    /// profile 0.
    pub fn jerk_at(&self, t: f64) -> f64 {
        let mut rest = t;
        if rest < 0.0 {
            return 0.0;
        }
        for segment in self.segments() {
            if rest < segment.duration {
                return segment.jerk;
            }
            rest -= segment.duration;
        }
        0.0
    }

    /// The state at the beginning of each segment with that segment.
    pub fn pieces(&self) -> impl Iterator<Item = (State, Segment)> + '_ {
        let mut at = Exact::leaving(self.start);
        self.segments().iter().map(move |segment| {
            let begin = State {
                p: self.start.p + at.p.value(),
                v: at.v.value(),
                a: at.a.value(),
            };
            at = at.after(segment.duration, segment.jerk);
            (begin, *segment)
        })
    }

    /// Exact ranges of position, velocity and acceleration (to rounding): the candidates are the
    /// segment ends and, inside a segment, the zeros of the next derivative.
    pub fn extrema(&self) -> Extrema {
        let mut e = Extrema {
            position: Range::EMPTY,
            velocity: Range::EMPTY,
            acceleration: Range::EMPTY,
            jerk: Range::EMPTY,
        };
        let take = |e: &mut Extrema, s: State| {
            e.position.take(s.p);
            e.velocity.take(s.v);
            e.acceleration.take(s.a);
        };
        take(&mut e, self.start);
        for (begin, Segment { duration, jerk }) in self.pieces() {
            take(&mut e, begin.after(duration, jerk));
            e.jerk.take(jerk);
            let inside = |t: f64| t > 0.0 && t < duration;
            let a_zero = -begin.a / jerk;
            if inside(a_zero) {
                e.velocity.take(begin.after(a_zero, jerk).v);
            }
            for t in zeros(begin.v, begin.a, 0.5 * jerk) {
                if inside(t) {
                    e.position.take(begin.after(t, jerk).p);
                }
            }
        }
        if self.len == 0 {
            e.jerk = Range { min: 0.0, max: 0.0 };
        }
        e
    }

    /// The same motion in the opposite direction: every position, velocity, acceleration and jerk
    /// with its sign changed.
    pub fn mirrored(&self) -> Self {
        fn mirror(State { p, v, a }: State) -> State {
            State {
                p: -p,
                v: -v,
                a: -a,
            }
        }
        let mut mirrored = *self;
        mirrored.start = mirror(self.start);
        mirrored.target = self.target.map(mirror);
        for segment in &mut mirrored.segments[..self.len] {
            segment.jerk = -segment.jerk;
        }
        mirrored
    }

    /// The motion of an axis that goes `factor` times as far, from `origin` on, and is known to end in
    /// `target`.
    pub(crate) fn scaled(&self, origin: f64, factor: f64, target: Option<State>) -> Self {
        let mut scaled = *self;
        scaled.start = State {
            p: origin + factor * self.start.p,
            v: factor * self.start.v,
            a: factor * self.start.a,
        };
        scaled.target = target;
        for segment in &mut scaled.segments[..self.len] {
            segment.jerk *= factor;
        }
        scaled
    }
}

impl PartialEq for Profile {
    fn eq(&self, other: &Self) -> bool {
        self.start == other.start && self.segments() == other.segments()
    }
}

impl core::fmt::Debug for Profile {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Profile")
            .field("start", &self.start)
            .field("segments", &self.segments())
            .finish()
    }
}

/// A state in double-double arithmetic, its position as displacement from some origin.
#[derive(Clone, Copy)]
pub(crate) struct Exact {
    pub(crate) p: Double,
    pub(crate) v: Double,
    pub(crate) a: Double,
}

impl Exact {
    /// The velocity and acceleration of a state, without displacement.
    pub(crate) fn leaving(state: State) -> Self {
        Exact {
            p: Double::ZERO,
            v: state.v.into(),
            a: state.a.into(),
        }
    }

    /// The state `t` seconds later under the constant jerk `j`; `t` may be negative.
    pub(crate) fn after(self, t: f64, j: f64) -> Self {
        let step = Double::product(j, t);
        let t = Double::from(t);
        Exact {
            p: self.p + t * (self.v + t * (self.a.half() + step * Double::SIXTH)),
            v: self.v + t * (self.a + step.half()),
            a: self.a + step,
        }
    }

    /// The state displaced from `origin`, or the one at most `room` seconds later under the jerk `j`
    /// whose position is the next one that an `f64` can be, with how much later that is. Where the motion
    /// turns around before that, the position is rounded.
    fn rounded(self, origin: f64, j: f64, room: f64) -> (State, f64) {
        let nearest = (Double::from(origin) + self.p).value();
        let forward = self.v.value();
        let left = |p: f64, state: &Exact| (Double::from(p) - origin.into() - state.p).value();
        let p = match left(nearest, &self) * forward {
            behind if behind >= 0.0 => nearest,
            _ if forward > 0.0 => nearest.next_up(),
            _ => nearest.next_down(),
        };
        let whole = left(p, &self);
        let (mut state, mut later) = (self, 0.0);
        // At the end of a motion to rest this is a triple zero, to which Newton's method is slow.
        for _ in 0..64 {
            let step = left(p, &state) / state.v.value();
            if step.is_nan() || step.abs() <= f64::EPSILON * later {
                break;
            }
            let next = (later + step).clamp(0.0, room);
            // Where there is no room, or no more, nothing changes any more.
            if next == later {
                break;
            }
            later = next;
            state = self.after(later, j);
        }
        let arrived = left(p, &state).abs() <= 1e-6 * whole.abs();
        let (p, state, later) = if arrived {
            (p, state, later)
        } else {
            (nearest, self, 0.0)
        };
        let (v, a) = (state.v.value(), state.a.value());
        (State { p, v, a }, later)
    }
}

/// The real zeros of `c + b·t + a·t²`, without cancellation; NaN for one that does not exist.
pub(crate) fn zeros(c: f64, b: f64, a: f64) -> [f64; 2] {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    [q / a, c / q]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn profile(start: State, segments: &[(f64, f64)]) -> Profile {
        let mut p = Profile::new(start);
        for &(duration, jerk) in segments {
            assert!(p.push(Segment { duration, jerk }));
        }
        p
    }

    #[test]
    fn a_rest_to_rest_move_of_four_ramps_ends_at_two_j_t_cubed() {
        let p = profile(
            State::at_rest(5.0),
            &[(1.0, 3.0), (1.0, -3.0), (1.0, -3.0), (1.0, 3.0)],
        );
        assert_eq!(p.end(), State::at_rest(5.0 + 2.0 * 3.0));
        assert_eq!(p.duration(), 4.0);
        let e = p.extrema();
        assert_eq!(
            e.position,
            Range {
                min: 5.0,
                max: 11.0
            }
        );
        assert_eq!(e.velocity, Range { min: 0.0, max: 3.0 });
        assert_eq!(
            e.acceleration,
            Range {
                min: -3.0,
                max: 3.0
            }
        );
        assert_eq!(
            e.jerk,
            Range {
                min: -3.0,
                max: 3.0
            }
        );
    }

    #[test]
    fn outside_its_time_a_profile_stands_at_its_ends() {
        let p = profile(
            State {
                p: 1.0,
                v: 2.0,
                a: 0.0,
            },
            &[(0.5, 4.0)],
        );
        assert_eq!(p.at(-1.0), p.start());
        assert_eq!(p.at(9.0), p.end());
        assert_eq!(p.jerk_at(-0.1), 0.0);
        assert_eq!(p.jerk_at(0.0), 4.0);
        assert_eq!(p.jerk_at(0.5), 0.0);
    }

    #[test]
    fn a_full_array_refuses_and_a_segment_without_duration_costs_nothing() {
        let mut p = Profile::new(State::default());
        assert!(p.push(Segment {
            duration: 0.0,
            jerk: 1.0
        }));
        for _ in 0..Profile::CAPACITY {
            assert!(p.push(Segment {
                duration: 1.0,
                jerk: 0.0
            }));
        }
        assert!(!p.push(Segment {
            duration: 1.0,
            jerk: 0.0
        }));
    }

    #[test]
    fn a_hold_of_no_length_to_speak_of_is_no_cruise() {
        let phases = [
            (0.08, -50_000.0),
            (0.04, 0.0),
            (0.08, 50_000.0),
            (5e-18, 0.0),
            (0.04, -50_000.0),
        ];
        let start = State {
            p: 8.0 / 15.0,
            v: 40.0,
            a: 2000.0,
        };
        let mut p = profile(start, &phases);
        p.target = Some(State::at_rest(0.0));
        for i in 0..=240 {
            let (near, far) = (p.at(i as f64 * 1e-3), p.mirrored().at(i as f64 * 1e-3));
            assert!(
                near.a.abs() <= 2000.0 + 1e-6 && near.a == -far.a,
                "{near:?}"
            );
        }
        assert!(
            p.at(0.121).v < -39.0 && p.at(0.121).p > 0.0,
            "{:?}",
            p.at(0.121)
        );
    }

    #[test]
    fn a_sampled_position_is_exact_on_the_motion_and_rounded_ahead() {
        // v = 1, so that a rounding of the position is one of time.
        let p = profile(
            State {
                p: 1e6,
                v: 1.0,
                a: 0.5,
            },
            &[(1.0, 0.0)],
        );
        for i in 1..100 {
            let t = f64::from(i) * 0.007;
            let s = p.at(t);
            // a = 0.5 throughout: the velocity tells the instant, that the place.
            let later = (s.v - 1.0) / 0.5 - t;
            assert!((0.0..1.2e-10).contains(&later), "{later}");
            let place = (s.v - 1.0) * (s.v + 1.0);
            assert!(
                (s.p - 1e6 - place).abs() < 1e-15,
                "{i}: {}",
                s.p - 1e6 - place
            );
        }
    }

    proptest! {
        #[test]
        fn no_sample_leaves_the_extrema_and_samples_come_near_them(
            v in -5.0..5.0f64,
            a in -5.0..5.0f64,
            segments in proptest::collection::vec((0.0..2.0f64, -8.0..8.0f64), 0..8),
        ) {
            let p = profile(State { p: 0.0, v, a }, &segments);
            let e = p.extrema();
            let n = 4000;
            let mut seen = p.start().p;
            for i in 0..=n {
                let s = p.at(p.duration() * i as f64 / n as f64);
                for (x, range) in [(s.p, e.position), (s.v, e.velocity), (s.a, e.acceleration)] {
                    let slack = 1e-9 * (1.0 + x.abs());
                    prop_assert!(range.min - slack <= x && x <= range.max + slack);
                }
                seen = seen.max(s.p);
            }
            prop_assert!(e.position.max - seen <= 0.02 * (1.0 + e.position.max.abs()));
        }

        #[test]
        fn a_mirrored_profile_runs_the_mirrored_way(
            v in -5.0..5.0f64,
            t in 0.0..3.0f64,
            segments in proptest::collection::vec((0.0..2.0f64, -8.0..8.0f64), 0..8),
        ) {
            let p = profile(State { p: 1.0, v, a: 0.5 }, &segments);
            let (s, m) = (p.at(t), p.mirrored().at(t));
            prop_assert_eq!((s.p, s.v, s.a), (-m.p, -m.v, -m.a));
        }
    }
}
