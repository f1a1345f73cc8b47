//! Jogs: what a person does with single axes while the path rests, and the way back to it.
//!
//! Away from the path every axis has a plan of its own, from state to state, that ends at rest inside
//! its travel. An order changes where an axis is to come to rest; the plan to there begins in the
//! state that the axis has in that cycle, whatever it is. Orders only note what is wanted, so that a
//! cycle plans every axis once at most.
//!
//! None of these plans can leave the travel: of all the ways on from a state the fastest stop reaches
//! least far, the fastest way to a rest further on reaches that rest and no further, and the fastest
//! way to a rest before it turns around earlier than the stop. Only a speed that is lowered in motion
//! costs more way than the stop does. Such a plan is looked at as a whole, and where it leaves the
//! travel the axis stops first.

use super::Setpoint;
use crate::limits::{Limits, PositionLimits};
use crate::profile::{Profile, State};
use crate::state_to_state::{self, Axis, Target};
use crate::synchronise::{self, Synchronisation};

/// Where an axis may be, and how it may move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Of velocity (mm/s), acceleration (mm/s²) and jerk (mm/s³).
    pub limits: Limits,
    /// The soft limits, mm, finite.
    pub bounds: PositionLimits,
}

/// An order to single axes, in machine coordinates. As fast as the axes' limits and the rapid
/// override allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Jog<const N: usize> {
    /// On and on, to the soft limit if no other order comes.
    Continuous {
        /// Which one.
        axis: usize,
        /// mm/s; its sign is the direction.
        velocity: f64,
    },
    /// By a distance: from the position that the last order leads the axis to, so that steps add up,
    /// or from where it can come to rest soonest. A soft limit ends it.
    Step {
        /// Which one.
        axis: usize,
        /// mm
        distance: f64,
        /// The highest, mm/s; may be infinite.
        speed: f64,
    },
    /// To these positions, mm, each axis as fast as it can.
    To([Option<f64>; N]),
    /// To these positions, mm, on a straight line. Axes that move otherwise come to rest first.
    Line([Option<f64>; N]),
}

/// Why an order is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JogError {
    /// The path has to rest.
    #[error("the path is not at rest")]
    Moving,
    /// There is no such axis.
    #[error("there is no axis {0}")]
    NoAxis(usize),
    /// A position is outside of the axis' soft limits.
    #[error("the position is outside of the soft limits of axis {0}")]
    OutsideTravel(usize),
    /// A position, a distance or a speed is not a number.
    #[error("a position, distance or speed is not a number")]
    NotANumber,
    /// The speed, or the rapid override, is 0.
    #[error("the speed or the rapid override is 0")]
    NoSpeed,
}

/// Where an axis is to come to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    /// Wherever it can soonest.
    Anywhere,
    /// At a position.
    At(f64),
    /// At the soft limit, where no order stops it before.
    Limit(f64),
}

/// When a plan is to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Due {
    No,
    Now,
    /// There was none that keeps the travel.
    AtRest,
}

#[derive(Clone, Copy, Debug)]
struct Motion {
    plan: Profile,
    /// The cycle at whose start the plan began.
    began: u64,
    aim: Aim,
    /// The highest towards the aim, mm/s.
    speed: f64,
    due: Due,
}

impl Motion {
    /// Where it comes to rest.
    fn end(&self) -> f64 {
        self.plan.at(f64::INFINITY).p
    }
}

/// What all axes do together.
#[derive(Clone, Copy, Debug)]
enum Straight<const N: usize> {
    To([Option<f64>; N]),
    Stop,
}

/// What follows once the axes are back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Then {
    Resume,
    StepBack,
}

/// The axes away from the path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excursion<const N: usize> {
    period: f64,
    cycle: u64,
    travel: [Option<Travel>; N],
    motions: [Motion; N],
    /// A straight line to there that is to be planned, or a stop on the one that the axes are on, and when.
    line: Option<(Straight<N>, Due)>,
    /// Where the path was left.
    home: [f64; N],
    /// They are on their way back.
    then: Option<Then>,
}

/// A plan whose rounding leaves the travel by less does not leave it, mm.
const ROUNDING: f64 = 1e-9;

/// Whether a plan keeps the bounds at every instant.
fn stays(plan: &Profile, bounds: &PositionLimits) -> bool {
    let range = plan.extrema().position;
    range.min >= bounds.min - ROUNDING && range.max <= bounds.max + ROUNDING
}

/// The fastest stop.
fn stop(start: State, limits: Limits) -> Option<Profile> {
    state_to_state::plan(&Axis::to_velocity(start, 0.0, limits), 0.0).ok()
}

impl Travel {
    /// The plan to the aim, and whether it leads there; otherwise the fastest stop.
    fn plan(&self, start: State, aim: Aim, speed: f64) -> Option<(Profile, bool)> {
        let stop = stop(start, self.limits)?;
        let (Aim::At(position) | Aim::Limit(position)) = aim else {
            return Some((stop, true));
        };
        // Against the direction of the aim there is but what is braked.
        let mut limits = self.limits;
        if position >= stop.end().p {
            limits.v_max = limits.v_max.min(speed);
        } else {
            limits.v_min = limits.v_min.max(-speed);
        }
        let axis = Axis::new(start, State::at_rest(position), limits);
        let direct = state_to_state::plan(&axis, 0.0).ok();
        let direct = direct.filter(|plan| stays(plan, &self.bounds));
        Some(direct.map_or((stop, false), |plan| (plan, true)))
    }

    fn holds(&self, position: f64) -> bool {
        (self.bounds.min..=self.bounds.max).contains(&position)
    }
}

impl<const N: usize> Excursion<N> {
    /// At rest in `home`. An axis that is outside of its travel may be there and come back.
    pub(super) fn new(home: [f64; N], period: f64, travel: &[Option<Travel>; N]) -> Self {
        let hull = |i: usize| {
            travel[i].map(|Travel { limits, bounds }| Travel {
                limits,
                bounds: PositionLimits {
                    min: bounds.min.min(home[i]),
                    max: bounds.max.max(home[i]),
                },
            })
        };
        Excursion {
            period,
            cycle: 0,
            travel: std::array::from_fn(hull),
            motions: home.map(|position| Motion {
                plan: Profile::new(State::at_rest(position)),
                began: 0,
                aim: Aim::Anywhere,
                speed: f64::INFINITY,
                due: Due::No,
            }),
            line: None,
            home,
            then: None,
        }
    }

    /// Takes an order, or refuses it and changes nothing; it is followed from the next cycle on.
    pub(super) fn order(&mut self, jog: Jog<N>, rapid: f64) -> Result<(), JogError> {
        let travel = |axis: usize| {
            let travel = self.travel.get(axis).copied().flatten();
            travel.ok_or(JogError::NoAxis(axis))
        };
        let check = |number: f64, speed: f64| {
            if !number.is_finite() || speed.is_nan() {
                Err(JogError::NotANumber)
            } else if speed.min(rapid) > 0.0 {
                Ok(())
            } else {
                Err(JogError::NoSpeed)
            }
        };
        match jog {
            Jog::Continuous { axis, velocity } => {
                let Travel { bounds, .. } = travel(axis)?;
                let limit = if velocity > 0.0 {
                    bounds.max
                } else {
                    bounds.min
                };
                check(limit, velocity.abs())?;
                self.aim(axis, Aim::Limit(limit), velocity.abs());
            }
            Jog::Step {
                axis,
                distance,
                speed,
            } => {
                let Travel { bounds, limits } = travel(axis)?;
                check(distance, speed)?;
                let from = match self.motions[axis].aim {
                    Aim::At(position) => position,
                    _ => {
                        let now = self.state(axis).0;
                        stop(now, limits).map_or(now.p, |stop| stop.end().p)
                    }
                };
                let to = (from + distance).clamp(bounds.min, bounds.max);
                self.aim(axis, Aim::At(to), speed);
            }
            Jog::To(positions) | Jog::Line(positions) => {
                for (axis, position) in positions.iter().enumerate() {
                    let Some(position) = *position else { continue };
                    let travel = travel(axis)?;
                    check(position, f64::INFINITY)?;
                    if !travel.holds(position) {
                        return Err(JogError::OutsideTravel(axis));
                    }
                }
                if matches!(jog, Jog::Line(_)) {
                    self.forget_orders();
                    self.line = Some((Straight::To(positions), Due::Now));
                } else {
                    for (axis, position) in positions.iter().enumerate() {
                        if let Some(position) = *position {
                            self.aim(axis, Aim::At(position), f64::INFINITY);
                        }
                    }
                }
            }
        }
        self.then = None;
        Ok(())
    }

    fn aim(&mut self, axis: usize, aim: Aim, speed: f64) {
        self.line = None;
        let motion = &mut self.motions[axis];
        motion.aim = aim;
        motion.speed = speed;
        motion.due = Due::Now;
    }

    /// What is planned goes on; what is not does not come any more.
    fn forget_orders(&mut self) {
        self.line = None;
        for motion in &mut self.motions {
            motion.due = Due::No;
        }
    }

    /// Comes to rest as fast as the axes can: on their line, or each on its own.
    pub(super) fn hold(&mut self) {
        self.then = None;
        self.stop_each();
        self.line = Some((Straight::Stop, Due::Now));
    }

    fn stop_each(&mut self) {
        for axis in 0..N {
            self.aim(axis, Aim::Anywhere, f64::INFINITY);
        }
    }

    /// Back to where the path was left, on a straight line.
    pub(super) fn go_home(&mut self, then: Then) {
        if self.then.replace(then).is_none() {
            self.forget_orders();
            self.line = Some((Straight::To(self.home.map(Some)), Due::Now));
        }
    }

    /// The axes are on their way back.
    pub(super) fn returns(&self) -> bool {
        self.then.is_some()
    }

    /// What follows, once the axes are back.
    pub(super) fn arrived(&self) -> Option<Then> {
        let home = |(motion, home): (&Motion, &f64)| motion.end() == *home;
        let back = self.rests() && self.motions.iter().zip(&self.home).all(home);
        self.then.filter(|_| back)
    }

    /// No axis moves, and none is going to.
    pub(super) fn rests(&self) -> bool {
        let due = self.line.is_some() || self.motions.iter().any(|motion| motion.due != Due::No);
        !due && (0..N).all(|axis| self.is_at_rest(axis))
    }

    /// Seconds into the plan.
    fn since(&self, motion: &Motion) -> f64 {
        (self.cycle - motion.began) as f64 * self.period
    }

    fn is_at_rest(&self, axis: usize) -> bool {
        let motion = &self.motions[axis];
        self.since(motion) >= motion.plan.duration()
    }

    /// State and jerk.
    fn state(&self, axis: usize) -> (State, f64) {
        let motion = &self.motions[axis];
        let t = self.since(motion);
        if t >= motion.plan.duration() {
            // Exactly, which a stop wherever it may be is only to rounding.
            (State::at_rest(motion.end()), 0.0)
        } else {
            (motion.plan.at(t), motion.plan.jerk_at(t))
        }
    }

    /// Goes on by one cycle, with this part of the axes' velocities.
    pub(super) fn advance(&mut self, rapid: f64) {
        if let Some((line, due)) = self.line {
            let at_rest = (0..N).all(|axis| self.is_at_rest(axis));
            if (due == Due::Now || at_rest) && self.plan_line(&line, rapid) {
                self.line = None;
            } else if due == Due::Now {
                self.stop_each();
                self.line = Some((line, Due::AtRest));
            }
        }
        for axis in 0..N {
            self.plan_axis(axis, rapid);
        }
        self.cycle += 1;
    }

    fn plan_axis(&mut self, axis: usize, rapid: f64) {
        let Motion {
            aim, speed, due, ..
        } = self.motions[axis];
        if due == Due::No || due == Due::AtRest && !self.is_at_rest(axis) {
            return;
        }
        let start = self.state(axis).0;
        let plan = self.travel[axis].and_then(|travel| {
            let Limits { v_max, v_min, .. } = travel.limits;
            travel.plan(start, aim, speed.min(rapid * v_max.max(-v_min)))
        });
        let motion = &mut self.motions[axis];
        motion.due = Due::No;
        if let Some((plan, leads_there)) = plan {
            motion.plan = plan;
            motion.began = self.cycle;
            if !leads_there {
                motion.due = Due::AtRest;
            }
        }
    }

    /// Plans all axes on a straight line from where they are, if there is one.
    fn plan_line(&mut self, line: &Straight<N>, rapid: f64) -> bool {
        let mut plans = [Profile::new(State::default()); N];
        let axes: [Axis; N] = std::array::from_fn(|i| {
            let start = self.state(i).0;
            let mut limits = self.travel[i].map_or(Limits::symmetric(1.0, 1.0, 1.0), |t| t.limits);
            let Straight::To(to) = line else {
                return Axis::to_velocity(start, 0.0, limits);
            };
            limits.v_max *= rapid;
            limits.v_min *= rapid;
            Axis::new(start, State::at_rest(to[i].unwrap_or(start.p)), limits)
        });
        let planned = synchronise::plan(&axes, Synchronisation::Line, 0.0, &mut plans).is_ok();
        let within = |(plan, travel): (&Profile, &Option<Travel>)| {
            travel.is_none_or(|travel| stays(plan, &travel.bounds))
        };
        if !planned || !plans.iter().zip(&self.travel).all(within) {
            return false;
        }
        for ((motion, plan), axis) in self.motions.iter_mut().zip(plans).zip(axes) {
            motion.plan = plan;
            motion.began = self.cycle;
            motion.due = Due::No;
            motion.aim = match axis.target {
                Target::State(target) => Aim::At(target.p),
                Target::Velocity { .. } => Aim::Anywhere,
            };
        }
        true
    }

    /// The setpoint of this cycle; of the path it takes where that rests.
    pub(super) fn setpoint(&self, path: Setpoint<N>) -> Setpoint<N> {
        let states: [_; N] = std::array::from_fn(|axis| self.state(axis));
        let velocity = states.map(|(state, _)| state.v);
        let norm = |part: &[f64]| part.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (tool, others) = velocity.split_at(N.min(3));
        let speed = if norm(tool) > 0.0 {
            norm(tool)
        } else {
            norm(others)
        };
        Setpoint {
            position: states.map(|(state, _)| state.p),
            velocity,
            acceleration: states.map(|(state, _)| state.a),
            jerk: states.map(|(_, jerk)| jerk),
            speed,
            feed: if speed > 0.0 { f64::INFINITY } else { 0.0 },
            busy: !self.rests(),
            away: true,
            ..path
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify;
    use proptest::prelude::*;

    const PERIOD: f64 = 0.002;
    /// The last coordinate has no axis.
    const N: usize = 4;
    const HOME: [f64; N] = [10.0, -3.0, 0.0, 1.0];

    fn travel(v: f64, a: f64, j: f64, min: f64, max: f64) -> Option<Travel> {
        let limits = Limits::symmetric(v, a, j);
        let bounds = PositionLimits { min, max };
        Some(Travel { limits, bounds })
    }

    /// The second axis begins outside of its travel.
    fn machine() -> [Option<Travel>; N] {
        [
            travel(500.0, 5_000.0, 80_000.0, -20.0, 60.0),
            travel(300.0, 2_000.0, 50_000.0, -2.5, 40.0),
            travel(100.0, 3_000.0, 40_000.0, -5.0, 0.5),
            None,
        ]
    }

    #[derive(Debug, Clone, Copy)]
    enum Act {
        Order(Jog<N>),
        Hold,
        GoHome,
        Rapid(f64),
    }

    fn act() -> impl Strategy<Value = Act> {
        let axis = || 0..3_usize;
        let speed = || prop_oneof![Just(f64::INFINITY), 1.0..600.0_f64];
        let place = |axis: usize, share: f64| {
            let bounds = machine()[axis].map(|travel| travel.bounds);
            bounds.map(|b| b.min + share * (b.max - b.min))
        };
        let places = || {
            prop::array::uniform4(prop::option::weighted(0.7, 0.0..=1.0_f64)).prop_map(
                move |shares| {
                    std::array::from_fn(|axis| shares[axis].and_then(|share| place(axis, share)))
                },
            )
        };
        let continuous = (axis(), 1.0..600.0_f64, any::<bool>());
        let order = prop_oneof![
            3 => continuous.prop_map(|(axis, speed, up)| Jog::Continuous {
                axis,
                velocity: if up { speed } else { -speed },
            }),
            3 => (axis(), -20.0..20.0_f64, speed())
                .prop_map(|(axis, distance, speed)| Jog::Step { axis, distance, speed }),
            2 => places().prop_map(Jog::To),
            2 => places().prop_map(Jog::Line),
        ];
        prop_oneof![
            8 => order.prop_map(Act::Order),
            1 => Just(Act::Hold),
            1 => Just(Act::GoHome),
            1 => (0.05..=1.0_f64).prop_map(Act::Rapid),
        ]
    }

    /// Goes on by one cycle; certifies, between the samples too, every plan that begins.
    fn advance(axes: &mut Excursion<N>, rapid: f64) -> Result<(), TestCaseError> {
        let before: [State; N] = std::array::from_fn(|axis| axes.state(axis).0);
        axes.advance(rapid);
        for axis in 0..N {
            let Motion {
                plan,
                began,
                aim,
                due,
                ..
            } = axes.motions[axis];
            let now = axes.state(axis).0;
            let Some(Travel { limits, bounds }) = axes.travel[axis] else {
                prop_assert_eq!(now, State::at_rest(HOME[axis]));
                continue;
            };
            if began + 1 == axes.cycle {
                prop_assert_eq!(plan.start(), before[axis], "nothing jumps");
                let target = match aim {
                    Aim::At(position) | Aim::Limit(position) if due == Due::No => {
                        Target::State(State::at_rest(position))
                    }
                    _ => Target::Velocity { v: 0.0, a: 0.0 },
                };
                let problem = Axis {
                    start: before[axis],
                    target,
                    limits,
                    bounds: None,
                };
                let certificate = verify::axis(&plan, &problem);
                // Relative to the way, which may be of next to no length.
                let arrives = certificate.end_error * certificate.path <= 1e-9;
                prop_assert!(
                    arrives && certificate.limit_excess <= 1e-11,
                    "{certificate:?} {problem:?} {plan:?}"
                );
                let range = plan.extrema().position;
                prop_assert!(range.min >= bounds.min - 1e-9 && range.max <= bounds.max + 1e-9);
            }
            prop_assert!(
                now.p >= bounds.min - 1e-9 && now.p <= bounds.max + 1e-9,
                "{now:?} {:?}",
                axes.motions[axis]
            );
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

        #[test]
        fn whatever_is_ordered_whenever_every_plan_rests_inside_limits_and_travel(
            acts in prop::collection::vec((0..120_u32, act()), 1..25),
        ) {
            let mut axes = Excursion::new(HOME, PERIOD, &machine());
            let mut rapid = 1.0;
            for (wait, act) in acts {
                match act {
                    Act::Order(jog) => prop_assert_eq!(axes.order(jog, rapid), Ok(())),
                    Act::Hold => axes.hold(),
                    Act::GoHome => axes.go_home(Then::Resume),
                    Act::Rapid(part) => rapid = part,
                }
                for _ in 0..wait {
                    advance(&mut axes, rapid)?;
                }
            }
            for home in [false, true] {
                if home {
                    axes.go_home(Then::Resume);
                }
                let begun = axes.cycle;
                while !axes.rests() {
                    prop_assert!(axes.cycle < begun + 200_000, "never rests");
                    advance(&mut axes, rapid)?;
                }
                for (motion, axis) in axes.motions.iter().zip(0..) {
                    if let Aim::At(position) | Aim::Limit(position) = motion.aim {
                        prop_assert_eq!(axes.state(axis).0, State::at_rest(position));
                    }
                }
            }
            prop_assert_eq!(axes.arrived(), Some(Then::Resume));
            let there: [State; N] = std::array::from_fn(|axis| axes.state(axis).0);
            prop_assert_eq!(there, HOME.map(State::at_rest));
        }
    }
}
