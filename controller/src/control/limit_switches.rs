//! Limit switches that are wired to inputs of the machine: at each end an axis goes no further than its switch.
//!
//! A switch acts on what the axis is sent. While it is on, a setpoint that moves the axis further in its direction is a
//! fault; at rest, and on the way back, it forbids nothing, so that a machine that was stopped by one is reset and jogged
//! off it. A switch that *comes* on while its axis moves away from it is a fault too: then the two of an axis are wired
//! the wrong way round, and the one in front would not stop it. Until it goes off it bars the direction in which it was
//! met, whatever it is called. One that bounces as its axis leaves it is no such one: it was on just before.
//!
//! An axis may be homed by its limit switch, onto which it then moves by right. That switch alone acts on nothing from
//! the beginning of the search until the axis rests behind it; the one at the other end goes on acting.

use super::fault::{AxisCause, AxisIndex, Fault};
use super::inputs::InputIndex;
use super::layout::AxisSpec;
use super::{Controller, Layout, Order, Phase, Refusal, whole_nanos};
use std::sync::Arc;
use std::time::Duration;
use syncline_trajectory::path::Jog;

/// A switch that was on so short a time ago bounces.
const BOUNCE: Duration = Duration::from_millis(100);

/// The direction of each end.
const ENDS: [f64; 2] = [-1.0, 1.0];

/// What the limit switches were.
#[derive(Clone, Debug)]
pub(super) struct LimitSwitches {
    /// By input: the cycle in which it was on last.
    was_on: Vec<Option<u64>>,
    /// By input: the direction in which no axis moves while it is on.
    bars: Vec<f64>,
    /// By axis: it is, or comes to rest, on the limit switch by which it is homed.
    homes: Vec<bool>,
}

impl LimitSwitches {
    pub(super) fn new(layout: &Layout) -> Self {
        let mut bars = vec![0.0; layout.inputs.len()];
        for (end, input) in layout.axes.iter().flat_map(limit_inputs) {
            bars[input] = ENDS[end];
        }
        Self {
            was_on: vec![None; layout.inputs.len()],
            bars,
            homes: vec![false; layout.axes.len()],
        }
    }
}

impl<const N: usize> Controller<N> {
    /// Compares what the axes are sent with their limit switches.
    ///
    /// # Errors
    /// A switch forbids it.
    pub(super) fn watch_limit_switches(&mut self) -> Result<(), Fault> {
        let layout = Arc::clone(&self.layout);
        let moves = (Phase::Square..=Phase::Stop).contains(&self.phase);
        let bounces = whole_nanos(BOUNCE) / whole_nanos(layout.cycle);
        let mut forbidden = Ok(());
        for (index, axis) in layout.axes.iter().enumerate() {
            let velocity = self.planned.velocity[axis.coordinate];
            let homes = self.homing.searches(index);
            self.limit_switches.homes[index] =
                homes || self.limit_switches.homes[index] && velocity != 0.0;
            for (end, input) in limit_inputs(axis) {
                if !self.inputs.is_on(input) {
                    self.limit_switches.bars[input] = ENDS[end];
                    continue;
                }
                let is_home = self.is_home(index, input);
                let before = self.limit_switches.was_on[input].replace(self.cycle);
                let is_new = before.is_none_or(|before| before + bounces < self.cycle);
                let moving_away = ENDS[end] * velocity < 0.0;
                let bars = &mut self.limit_switches.bars[input];
                if moves && is_new && moving_away && !is_home {
                    *bars = -ENDS[end];
                }
                if moves && *bars * velocity > 0.0 && !is_home && forbidden.is_ok() {
                    let cause = AxisCause::LimitSwitch {
                        input,
                        positive: end == 1,
                        moving_away,
                    };
                    forbidden = Err(Fault::Axis(index, cause));
                }
            }
        }
        forbidden
    }

    /// Whether an axis is homed by that input of its own just now.
    fn is_home(&self, axis: AxisIndex, input: InputIndex) -> bool {
        let homing = &self.layout.axes[axis].homing;
        self.limit_switches.homes[axis] && homing.switches().contains(&input)
    }

    /// Whether an order leads further onto a limit switch on which its axis stands.
    ///
    /// # Errors
    /// It does; of a job nobody knows.
    pub(super) fn check_limit_switches(&self, order: &Order<N>) -> Result<(), Refusal> {
        for axis in &self.layout.axes {
            let at = axis.coordinate;
            let by = match order {
                Order::Begin(job) | Order::TakeUp(job) if !job.homes_first.contains_index(at) => {
                    None
                }
                Order::Jog(jog) => Some(self.jogged_by(jog, at)),
                _ => continue,
            };
            for (end, input) in limit_inputs(axis) {
                let barred = by.is_none_or(|by| by * self.limit_switches.bars[input] > 0.0);
                if barred && self.inputs.is_on(input) {
                    let positive = end == 1;
                    return Err(Refusal::OnLimit { axis: at, positive });
                }
            }
        }
        Ok(())
    }

    /// To which side, and how far or fast, a jog moves the axis with that coordinate.
    fn jogged_by(&self, jog: &Jog<N>, at: usize) -> f64 {
        match jog {
            Jog::Continuous { axis, velocity } if *axis == at => *velocity,
            Jog::Step { axis, distance, .. } if *axis == at => *distance,
            Jog::To(to) | Jog::Line { to, .. } => {
                to[at].map_or(0.0, |to| to - self.planned.position[at])
            }
            Jog::Continuous { .. } | Jog::Step { .. } => 0.0,
        }
    }
}

/// The limit switches of an axis, each with its end.
fn limit_inputs(axis: &AxisSpec) -> impl Iterator<Item = (usize, InputIndex)> {
    let ends = axis.limit_inputs.iter().enumerate();
    ends.flat_map(|(end, inputs)| inputs.iter().map(move |&input| (end, input)))
}
