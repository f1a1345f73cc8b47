//! A course as a profile, every digit of it: where a cruise follows ramps, their rounding is set right.

use super::steps::Steps;
use super::{Course, Route};
use crate::double::Double;
use crate::extremal::Phases;
use crate::profile::{Exact, Profile, State};

/// Rounding of an acceleration that ramps lead to, relative.
const RATE_ROUNDING: f64 = 4.0 * f64::EPSILON;
/// A drift during a cruise that shows, relative: a tenth of what plans are certified to.
const SHOWS: f64 = 1e-13;
/// An error of a velocity that is too much, relative: what plans are certified to.
const TOO_MUCH: f64 = 1e-12;

impl Route {
    pub(crate) fn profile(&self, course: &Course) -> Profile {
        self.profile_along(course, self.start, self.distance(), 1.0, self.target)
    }

    /// The profile of an axis that moves `factor` times as far as this one does, from a start of
    /// its own over a `distance` of its own.
    pub(crate) fn profile_along(
        &self,
        course: &Course,
        start: State,
        distance: f64,
        factor: f64,
        target: Option<State>,
    ) -> Profile {
        let mut profile = Profile::towards(start, target);
        if self.entry.duration > 0.0 {
            for segment in self.entry.segments {
                profile.append(segment.duration, factor * segment.jerk);
            }
        }
        if let Course::Extremal(phases) = course
            && !self.is_long(phases)
        {
            for (duration, jerk) in phases.t.into_iter().zip(phases.jerks(&self.limits)) {
                profile.append(duration, factor * jerk);
            }
            return profile;
        }
        let steps = match course {
            Course::Extremal(phases) => Steps::extremal(phases, &self.limits),
            Course::Cruise(into, cruise, out) => Steps::cruise(into, *cruise, out),
            Course::Via {
                first,
                hold,
                second,
            } => Steps::via(first, *hold, second, &self.limits),
            Course::Between { up, down, mix } => Steps::between(up, down, *mix, &self.limits),
        };
        let slow = !matches!(course, Course::Extremal(_));
        let settles = !slow || self.drifts(&steps);
        // Ramps from far outside the limits are rounded more coarsely than a slow cruise after them is.
        let meets = (slow || self.entry.duration > 0.0) && self.target.is_some();
        let mut share = if meets { SETTLE_AND_MEET } else { SETTLE };
        let fastest = [
            self.limits.v_max,
            self.limits.v_min,
            self.start.v,
            self.conditions.vf,
        ]
        .into_iter()
        .fold(0.0_f64, |most, v| most.max((factor * v).abs()));
        let [one, other] = [self.limits.j_min, self.limits.j_max].map(|jerk| factor * jerk);
        let keeps = |jerk: f64| jerk >= one.min(other) && jerk <= one.max(other);
        loop {
            let mut whole = profile;
            let bent = follow(
                &mut whole,
                &steps,
                factor,
                settles.then_some(share),
                |reached, cruise| {
                    let miss = (Double::from(distance) - reached).value();
                    let cruised = fastest * cruise;
                    // A short cruise would pay with its velocity for a distance that is missed by less.
                    let costs = miss.abs() > TOO_MUCH * cruised && distance.abs() > cruised;
                    (meets && !costs).then_some(miss)
                },
            );
            // As short as the jerk allows.
            if share >= LONGEST || bent.into_iter().all(keeps) {
                return whole;
            }
            share = (LONGER * share).min(LONGEST);
        }
    }

    /// Whether an extremal plan cruises so long that the rounding of the ramps before it shows.
    pub(super) fn is_long(&self, phases: &Phases) -> bool {
        let speed = if phases.mirrored {
            -self.limits.v_min
        } else {
            self.limits.v_max
        };
        2.0 * RATE_ROUNDING * self.limits.a_max * phases.t[3] > SHOWS * speed
    }

    /// Whether the rounding of the rates before a cruise shows in the position after it.
    pub(super) fn drifts(&self, steps: &Steps) -> bool {
        let mut state = State {
            p: 0.0,
            v: self.conditions.v0,
            a: self.conditions.a0,
        };
        let mut length = self.entry.displacement.abs();
        let mut cruise = 0.0_f64;
        for step in steps.iter() {
            if step.cruise {
                cruise = step.duration;
                state.a = 0.0;
            }
            let next = state.after(step.duration, step.jerk);
            length += (next.p - state.p).abs();
            state = next;
        }
        let speed = self.start.v.abs().max(self.conditions.vf.abs());
        let drift = cruise * (0.5 * cruise * self.limits.a_max + speed);
        RATE_ROUNDING * drift > SHOWS * length
    }
}

/// The part of a cruise in which its acceleration is brought to zero: short, so that the velocity
/// stays; longer where the velocity too is to be adjusted.
const SETTLE: f64 = 1.0 / (1_u32 << 30) as f64;

const SETTLE_AND_MEET: f64 = 1.0 / (1_u32 << 20) as f64;

/// Where the jerk does not suffice for so short a part it is so many times as long, and at most that part of the cruise.
const LONGER: f64 = 4.0;
const LONGEST: f64 = 0.25;

/// Appends the steps, `factor` times as high. With a `share`, a cruise begins with two parts of that share in which its
/// acceleration is brought to zero and, where `missing` tells what is left of the distance after such a displacement, for a cruise of such a duration, its
/// velocity to what meets the distance. The jerks of both parts.
fn follow(
    profile: &mut Profile,
    steps: &Steps,
    factor: f64,
    share: Option<f64>,
    missing: impl FnOnce(Double, f64) -> Option<f64>,
) -> [f64; 2] {
    let mut settled = None;
    for step in steps.iter() {
        let mut duration = step.duration;
        if let Some(share) = share.filter(|_| step.cruise) {
            let part = duration * share;
            settle(profile, part);
            duration -= 2.0 * part;
            settled = Some((profile.segments().len() - 2, part, duration));
        }
        profile.append(duration, factor * step.jerk);
    }
    let Some((first, part, cruise)) = settled else {
        return [0.0; 2];
    };
    // A cruise slower than the rates around it multiplies their rounding: set its velocity by
    // what it leaves of the distance.
    if let Some(miss) = missing(displacement(profile), cruise + part) {
        let jerk = miss / ((cruise + part) * part * part);
        profile.bend(first, jerk);
        profile.bend(first + 1, -jerk);
    }
    [first, first + 1].map(|part| profile.segments()[part].jerk)
}

/// What the ramps leave of the acceleration by rounding, a long cruise would integrate to a wrong
/// velocity. Brings it to zero in two first small parts of the cruise.
pub(super) fn settle(profile: &mut Profile, part: f64) {
    let mut left = Double::from(profile.start().a);
    for s in profile.segments() {
        left = left + Double::product(s.jerk, s.duration);
    }
    // From a to zero with no change of velocity.
    let jerk = -0.5 * left.value() / part;
    profile.append(part, 3.0 * jerk);
    profile.append(part, -jerk);
}

pub(super) fn displacement(profile: &Profile) -> Double {
    let start = Exact::leaving(profile.start());
    profile
        .segments()
        .iter()
        .fold(start, |state, s| state.after(s.duration, s.jerk))
        .p
}
