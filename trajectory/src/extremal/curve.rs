//! The whole curve of plans of one direction, for durations that are stated.

use super::regions::Crossing;
use super::{
    BoundaryConditions, Curve, Held, NormalisedProblem, Phases, Plan, REGIONS, Reach, Region,
};
use crate::limits::Limits;

impl Curve {
    /// The curve of greatest displacements, or of smallest ones where `mirrored`.
    pub(crate) fn new(conditions: &BoundaryConditions, limits: &Limits, mirrored: bool) -> Self {
        let normalised = NormalisedProblem::new(conditions, limits, mirrored);
        let plan = Plan {
            t: [0.0; 7],
            a1: 0.0,
            a2: 0.0,
        };
        let region = Region {
            held: Held::Neither,
            plan,
            extent: 0.0,
            time: 0.0,
        };
        let mut curve = Curve {
            normalised,
            regions: [region; REGIONS],
            len: 0,
            after_blocked: None,
        };
        let begin = curve.normalised.begin();
        for &(held, plan, extent) in &begin.early[..begin.len] {
            curve.push(Region {
                held,
                plan,
                extent,
                time: plan.duration(),
            });
        }
        if begin.blocked {
            curve.after_blocked = Some(curve.len);
        }
        curve.cross(begin.crossing);
        curve
    }

    fn cross(&mut self, mut crossing: Crossing) {
        for _ in 0..REGIONS {
            let Some((held, extent)) = crossing.next(&self.normalised) else {
                break;
            };
            if extent > 0.0 {
                let (plan, time) = (crossing.plan, crossing.plan.duration());
                self.push(Region {
                    held,
                    plan,
                    extent,
                    time,
                });
            }
            crossing.advance(&self.normalised, held, extent);
        }
        // From here on both ends of the cruise are ramps of their own.
        let mut plan = crossing.plan;
        let whole = plan.t[2];
        plan.t[4] = (-plan.a2 * self.normalised.n).min(whole);
        plan.t[2] = whole - plan.t[4];
        let time = plan.duration();
        self.push(Region {
            held: Held::Cruise,
            plan,
            extent: f64::INFINITY,
            time,
        });
    }

    fn push(&mut self, region: Region) {
        self.regions[self.len] = region;
        self.len += 1;
    }

    fn regions(&self) -> &[Region] {
        &self.regions[..self.len]
    }

    /// The shortest plan of the curve: the fastest change of velocity and acceleration alone.
    pub(crate) fn first(&self) -> (Phases, f64) {
        let plan = &self.regions[0].plan;
        (
            self.normalised.phases(plan),
            self.normalised.signed(self.normalised.reach(plan).d),
        )
    }

    /// The first plan after the blocked interval, where there is one.
    pub(crate) fn first_after_blocked(&self) -> Option<(Phases, f64)> {
        let plan = &self.regions[self.after_blocked?].plan;
        Some((
            self.normalised.phases(plan),
            self.normalised.signed(self.normalised.reach(plan).d),
        ))
    }

    /// The first plan over `distance` that lasts longer than `time`, where the plan of that duration
    /// falls short of it; `None` where there is none before the problem.
    pub(crate) fn next_over(&self, distance: f64, time: f64) -> Option<Phases> {
        let distance = self.normalised.signed(distance);
        let mut index = self.index_at(time)?;
        let mut first = self.regions[index];
        let skip = self.normalised.parameter(&first, time - first.time);
        if skip > 0.0 {
            first.plan = self.normalised.plan(first.held, &first.plan, skip);
            first.extent -= skip;
        }
        let crossing = self.crossing();
        while index < crossing {
            let Region {
                held, plan, extent, ..
            } = &first;
            if let Some(plan) = self.normalised.rise_over(*held, plan, *extent, distance) {
                return Some(self.normalised.phases(&plan));
            }
            index += 1;
            if self.after_blocked == Some(index) {
                return None;
            }
            first = self.regions[index];
        }
        // From here on D is convex: the last region that begins below holds the only passage.
        for i in (index..self.len).rev() {
            let region = if i == index { first } else { self.regions[i] };
            let reach = self.normalised.reach(&region.plan);
            if reach.d <= distance || i == index {
                let plan = self.solve(&region, distance, reach);
                return Some(self.normalised.phases(&plan));
            }
        }
        None
    }

    fn solve(&self, region: &Region, distance: f64, at: Reach) -> Plan {
        if region.held == Held::Cruise {
            let y = ((distance - at.d) / self.normalised.v_max).max(0.0);
            return self.normalised.plan(region.held, &region.plan, y);
        }
        self.normalised
            .solve(region.held, &region.plan, region.extent, distance, at)
    }

    /// Index of the first region with `a2 ≤ 0 ≤ a1` throughout.
    fn crossing(&self) -> usize {
        if let Some(i) = self.after_blocked {
            return i;
        }
        self.regions()
            .iter()
            .position(|r| r.plan.a2 <= 0.0)
            .unwrap_or(self.len)
    }

    /// The plan of duration `time`, with its displacement; `None` where no plan lasts so long.
    pub(crate) fn at(&self, time: f64) -> Option<(Phases, f64)> {
        let index = self.index_at(time)?;
        let region = &self.regions[index];
        let y = self.normalised.parameter(region, time - region.time);
        let plan = self.normalised.plan(region.held, &region.plan, y);
        Some((
            self.normalised.phases(&plan),
            self.normalised.signed(self.normalised.reach(&plan).d),
        ))
    }

    fn index_at(&self, time: f64) -> Option<usize> {
        let time = time * (1.0 + 4.0 * f64::EPSILON);
        let index = self.regions().iter().rposition(|r| r.time <= time)?;
        let region = &self.regions[index];
        if self.after_blocked == Some(index + 1) {
            let end = self
                .normalised
                .plan(region.held, &region.plan, region.extent)
                .duration();
            if time > end {
                return None;
            }
        }
        Some(index)
    }
}
