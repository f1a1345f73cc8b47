//! The path of the setpoints, as far back as a tool that follows may be.
//!
//! How far the tool is off that path is the drives' part of its contour error; lagging behind along
//! the path is no part of it. Between two SYNCs the path is the parabola through both setpoints whose
//! second derivative is the mean of theirs, so that an arc is no polygon.
//!
//! Only the stretch behind the setpoint counts on which the tool can be: twice as long as the setpoint has
//! lately been ahead of it, by which corners are shorter than their legs. So a branch that crosses is never taken
//! for the one that the tool is on.
//!
//! The nearest place is found from the setpoint back. A place that is `s` further back along the path than one
//! whose distance is `d` is no nearer than `d − s`, so what cannot be nearer than the best so far is
//! skipped: of hundreds of chords a handful is looked at.

use crate::machine::Position;
use std::array;
use std::collections::VecDeque;

/// How long a tool may take to follow, s.
const LONGEST: f64 = 0.5;

/// Twice the way that a setpoint is ahead.
const CORNERS: f64 = 2.0;

/// Time in which the memory of how far it was ahead fades, s: longer than a vibration's period.
const FADES: f64 = 0.25;

/// Setpoints so near to each other, mm, are one.
const RESTS: f64 = 1e-9;

/// The setpoints of the last cycles.
#[derive(Debug)]
pub(super) struct Trail {
    /// Between two setpoints, s.
    period: f64,
    /// The newest last.
    points: VecDeque<Point>,
    /// The cycle of the newest.
    cycle: u64,
    /// How far the setpoint has lately been ahead of the tool, mm.
    ahead: f64,
}

#[derive(Clone, Copy, Debug)]
struct Point {
    position: Position,
    velocity: Position,
    /// Length of the chords up to here, mm.
    along: f64,
}

impl Trail {
    /// Nothing yet, of setpoints with so many seconds from cycle to cycle.
    pub(super) fn new(period: f64) -> Self {
        Self {
            period,
            points: VecDeque::with_capacity((LONGEST / period) as usize + 2),
            cycle: 0,
            ahead: 0.0,
        }
    }

    /// The path goes on elsewhere.
    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.ahead = 0.0;
    }

    /// Takes the setpoint of a cycle, and where the tool is.
    pub(super) fn push(
        &mut self,
        cycle: u64,
        position: Position,
        velocity: Position,
        tool: &Position,
    ) {
        if cycle != self.cycle + 1 {
            self.clear();
        }
        self.cycle = cycle;
        let ahead = norm(&position, tool);
        self.ahead = ahead.max(self.ahead * (1.0 - self.period / FADES));
        let mut along = 0.0;
        if let Some(last) = self.points.back() {
            let step = norm(&position, &last.position);
            along = last.along + step;
            if step <= RESTS {
                along = last.along;
                self.points.pop_back();
            }
        }
        if self.points.len() as f64 * self.period > LONGEST {
            self.points.pop_front();
        }
        self.points.push_back(Point {
            position,
            velocity,
            along,
        });
    }

    /// The length of path on either side of the setpoint on which the tool can be, mm.
    pub(super) fn reach(&self) -> f64 {
        CORNERS * self.ahead
    }

    /// How far a point is off the path, mm.
    pub(super) fn distance(&self, point: &Position) -> f64 {
        let Some(newest) = self.points.back() else {
            return 0.0;
        };
        let oldest = newest.along - self.reach();
        let mut nearest = norm(&newest.position, point);
        let mut place = None;
        let mut index = self.points.len() - 1;
        while index > 0 && self.points[index].along >= oldest {
            let (away, share) = self.chord(index, point);
            if away < nearest {
                nearest = away;
                place = Some((index, share));
            }
            index -= 1;
            let no_nearer = self.points[index].along - (away - nearest);
            while index > 0 && self.points[index - 1].along > no_nearer {
                index -= 1;
            }
        }
        place.map_or(nearest, |(index, share)| {
            self.off_the_parabola(index, share, point)
        })
    }

    /// How far a point is from the chord that ends in a setpoint, and at which part of it that is nearest.
    fn chord(&self, index: usize, point: &Position) -> (f64, f64) {
        let (from, to) = (&self.points[index - 1], &self.points[index]);
        let step = between(&from.position, &to.position);
        let share = dot(&between(&from.position, point), &step) / dot(&step, &step);
        let share = share.clamp(0.0, 1.0);
        let place = array::from_fn(|i| from.position[i] + share * step[i]);
        (norm(&place, point), share)
    }

    /// How far a point is from the path beside a place of the chord that ends in a setpoint, across the chord
    /// unless the chord ends there.
    fn off_the_parabola(&self, index: usize, share: f64, point: &Position) -> f64 {
        let (from, to) = (&self.points[index - 1], &self.points[index]);
        let step = between(&from.position, &to.position);
        let turn = between(&from.velocity, &to.velocity);
        let bulge = 0.5 * share * (1.0 - share) * self.period;
        let place = array::from_fn(|i| from.position[i] + share * step[i] - bulge * turn[i]);
        let off = between(&place, point);
        let along = dot(&off, &step);
        let along = if bulge > 0.0 {
            along * along / dot(&step, &step)
        } else {
            0.0
        };
        (dot(&off, &off) - along).max(0.0).sqrt()
    }
}

/// From one point to another.
fn between(from: &Position, to: &Position) -> Position {
    array::from_fn(|i| to[i] - from[i])
}

fn dot(a: &Position, b: &Position) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Distance of two points, mm.
pub(super) fn norm(a: &Position, b: &Position) -> f64 {
    let apart = between(a, b);
    dot(&apart, &apart).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIOD: f64 = 0.002;

    fn at(x: f64, y: f64) -> Position {
        let mut position = Position::default();
        (position[0], position[1]) = (x, y);
        position
    }

    /// Follows setpoints with a tool that is so many of them behind and `off` beside the path; how far
    /// it is found to be off, at most and at least, once it moves.
    fn follow(path: &[(Position, Position)], behind: usize, off: f64) -> (f64, f64) {
        let mut trail = Trail::new(PERIOD);
        let (mut most, mut least) = (0.0_f64, f64::INFINITY);
        for (cycle, (position, velocity)) in path.iter().enumerate() {
            let (place, direction) = path[cycle.saturating_sub(behind)];
            let speed = norm(&direction, &Position::default());
            let mut tool = place;
            if speed > 0.0 {
                tool[0] -= off * direction[1] / speed;
                tool[1] += off * direction[0] / speed;
            }
            trail.push(cycle as u64 + 1, *position, *velocity, &tool);
            if cycle > 2 * behind + 10 {
                let found = trail.distance(&tool);
                (most, least) = (most.max(found), least.min(found));
            }
        }
        (most, least)
    }

    proptest! {
        /// On a circle a lag counts nothing, and what is beside the path counts as it is.
        #[test]
        fn what_is_beside_a_circle_is_found_and_a_lag_is_not(
            radius in 2.0..200.0_f64,
            speed in 1.0..300.0_f64,
            behind in 0_usize..20,
            off in -0.5..0.5_f64,
        ) {
            let path: Vec<_> = (0..600).map(|cycle| {
                let angle = f64::from(cycle) * PERIOD * speed / radius;
                let (sin, cos) = angle.sin_cos();
                (at(radius * cos, radius * sin), at(-speed * sin, speed * cos))
            }).collect();
            prop_assume!(speed * PERIOD < 0.1 * radius);
            let (most, least) = follow(&path, behind, off);
            // Of the fourth order in the angle of a cycle.
            let angle = speed * PERIOD / radius;
            let exact = 1e-9 + radius * angle.powi(4) + off.abs() * angle * angle;
            prop_assert!(most <= off.abs() + exact && least >= off.abs() - exact, "{least} {most}");
        }

        /// Any chord may be the nearest one: what is skipped never is.
        #[test]
        fn what_is_skipped_is_no_nearer(
            steps in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64), 3..60),
            tool in (-3.0..3.0_f64, -3.0..3.0_f64),
        ) {
            let mut trail = Trail::new(PERIOD);
            let (mut x, mut y) = (0.0, 0.0);
            let tool = at(tool.0, tool.1);
            for (cycle, step) in steps.iter().enumerate() {
                (x, y) = (x + step.0, y + step.1);
                // All velocities are equal: the parabolas are chords.
                trail.push(cycle as u64 + 1, at(x, y), Position::default(), &tool);
            }
            let newest = trail.points.back().unwrap();
            let all = (1..trail.points.len())
                .filter(|&index| trail.points[index].along >= newest.along - trail.reach())
                .map(|index| trail.chord(index, &tool).0)
                .fold(norm(&newest.position, &tool), f64::min);
            prop_assert!((trail.distance(&tool) - all).abs() < 1e-9);
        }
    }

    /// A figure of eight: the branch that crosses is passed over, however near it is.
    #[test]
    fn a_branch_that_crosses_is_not_the_path() {
        let mut trail = Trail::new(PERIOD);
        let mut worst = 0.0_f64;
        for cycle in 0..3000 {
            let t = f64::from(cycle) * PERIOD;
            let (position, velocity) = (
                at(40.0 * t.sin(), 20.0 * (2.0 * t).sin()),
                at(40.0 * t.cos(), 40.0 * (2.0 * t).cos()),
            );
            // Where it crosses itself the tool is 0.3 mm beside its branch, and on the other.
            let speed = norm(&velocity, &Position::default());
            let tool = at(
                position[0] - 0.3 * velocity[1] / speed,
                position[1] + 0.3 * velocity[0] / speed,
            );
            trail.push(cycle as u64 + 1, position, velocity, &tool);
            if cycle > 0 {
                worst = worst.max((trail.distance(&tool) - 0.3).abs());
            }
        }
        assert!(worst < 1e-3, "{worst}");
    }
}
