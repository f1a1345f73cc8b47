//! A machine of any number of axes to measure with: each a drive of its own, all of one model, moving to
//! and fro.

use crate::budget::DoesNotFit;
use crate::control::{Instruction, Layout, layout};
use crate::machine::{AxisLimits, Homing, HomingPolicy, NotKept, Probing};
use crate::port::sim::{self, SimPort};
use crate::port::{Port, Ports};
use crate::run::driver::Driver;
use std::sync::Arc;
use std::time::Duration;
use syncline_canopen::budget::{NodeTraffic, Traffic, Verdict};
use syncline_canopen::{CobId, Instant, NodeId};
use syncline_drives::bus::BitRate;
use syncline_drives::model::{
    Assumed, Device, Direction, Increments, Model, REFERENCE, Scaling, Settings,
};
use syncline_drives::twin::{Config, SimulatedDevice};
use syncline_drives::world::World;
use syncline_trajectory::path::{Curve, Feed, Limits, Move, PathControlMode, PathItem, Planner};
use syncline_trajectory::shaper::Shaper;

/// Of every bus.
const BIT_RATE: u32 = 1_000_000;

/// Each axis goes this far, mm …
const STROKE: f64 = 100.0;

/// … at this many mm/s.
const SPEED: f64 = 50.0;

/// … mm/s² …
const ACCELERATION: f64 = 500.0;

/// … and mm/s³.
const JERK: f64 = 10_000.0;

/// Bring-up takes a few hundred cycles; this many mean that it hangs.
const BRING_UP_CYCLES: u32 = 100_000;

/// A machine of `axes` axes spread over `buses` buses.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Of its drives.
    pub model: &'static Model,
    /// 1…`N`.
    pub axes: usize,
    /// At least one.
    pub buses: usize,
    /// SYNC to SYNC.
    pub period: Duration,
}

impl Shape {
    /// The axes on as few buses as take them, with drives of the reference model.
    ///
    /// # Errors
    /// If one axis alone does not fit the period.
    pub fn on_fewest_buses(axes: usize, period: Duration) -> Result<Self, DoesNotFit> {
        Self::of_model(REFERENCE, axes, period)
    }

    /// The same with drives of another model.
    ///
    /// # Errors
    /// If one axis alone does not fit the period.
    pub fn of_model(
        model: &'static Model,
        axes: usize,
        period: Duration,
    ) -> Result<Self, DoesNotFit> {
        let shape = |buses| Self {
            model,
            axes,
            buses,
            period,
        };
        (1..axes)
            .map(shape)
            .find(|shape| shape.check().is_ok())
            .map_or_else(|| shape(axes).check().map(|()| shape(axes)), Ok)
    }

    /// # Errors
    /// If a bus does not fit the period, or the drives do not take it.
    pub fn check(&self) -> Result<(), DoesNotFit> {
        if !self.model.takes_cycle(self.period) {
            return Err(DoesNotFit::Cycle {
                cycle: self.period,
                allowed: self.model.cycles.clone(),
                step: self.model.cycle_step,
            });
        }
        // The first bus has the most axes.
        let traffic = self.traffic(0);
        let budget = traffic.budget();
        if budget.verdict != Verdict::DoesNotFit {
            return Ok(());
        }
        Err(DoesNotFit::Bus {
            bus: bus_name(0),
            arithmetic: budget.to_string(),
            advice: "take a longer period or more buses".into(),
        })
    }

    fn axes_of(&self, bus: usize) -> impl Iterator<Item = usize> + use<> {
        (bus..self.axes).step_by(self.buses)
    }

    fn node(&self, axis: usize) -> NodeId {
        NodeId::new((axis / self.buses + 1) as u8).expect("at most 64 axes on a bus")
    }

    /// The drive of an axis as the controller sees it.
    #[must_use]
    pub fn device(&self, axis: usize) -> Device {
        self.model.device(&Settings {
            // Increments a second from mm a second.
            velocity: self.scaling().magnitude(SPEED).get() as f64,
            ..Settings::new(self.node(axis), self.period)
        })
    }

    fn scaling(&self) -> Scaling {
        let increments = (self.model.increments_per_revolution)(&Assumed::default());
        Scaling::new(increments, 10.0, Direction::Positive, Increments::ZERO)
    }

    fn traffic(&self, bus: usize) -> Traffic {
        let nodes: Vec<NodeTraffic> = self
            .axes_of(bus)
            .map(|axis| self.device(axis).spec().traffic())
            .collect();
        Traffic {
            bit_rate: BIT_RATE,
            cycle: self.period,
            nodes,
        }
    }

    /// Identifiers that the controller receives and sends on a bus.
    #[must_use]
    pub fn identifiers(&self, bus: usize) -> (Vec<CobId>, Vec<CobId>) {
        let devices: Vec<_> = self.axes_of(bus).map(|axis| self.device(axis)).collect();
        let receive = devices.iter().flat_map(|device| {
            let node = device.spec().node;
            let t_pdos = device.spec().t_pdos.iter().map(|pdo| pdo.cob_id);
            t_pdos.chain([
                CobId::emcy(node),
                CobId::t_sdo(node),
                CobId::error_control(node),
            ])
        });
        let burst = devices.iter().flat_map(|device| &device.spec().r_pdos);
        (receive.collect(), burst.map(|pdo| pdo.cob_id).collect())
    }

    /// Identifier of the controller's heartbeat.
    #[must_use]
    pub fn heartbeat(&self) -> CobId {
        CobId::error_control(self.layout().node)
    }

    /// The twins of a bus.
    pub fn twins(&self, bus: usize) -> impl Iterator<Item = Box<dyn SimulatedDevice>> + use<> {
        let shape = *self;
        self.axes_of(bus).map(move |axis| {
            let config = Config {
                seed: axis as u64,
                ..Config::new(shape.node(axis))
            };
            sim::twin(shape.model, &config)
        })
    }

    /// Its buses, simulated, and the ports to them.
    ///
    /// # Panics
    /// Never: the bit rate can be simulated.
    #[must_use]
    pub fn simulated(&self) -> (World, Ports) {
        let bit_rate = BitRate::from_kbit(BIT_RATE / 1000).expect("1 Mbit/s");
        let mut world = World::new();
        let mut port = |number| -> Box<dyn Port + Send> {
            let bus = world.add_bus(bit_rate, |_| ());
            for twin in self.twins(number) {
                world.attach(bus, twin);
            }
            Box::new(SimPort::new(bus))
        };
        let ports = (0..self.buses).map(&mut port).collect();
        (world, ports)
    }

    /// The machine as the controller needs it.
    ///
    /// # Panics
    /// If it does not fit its cycle.
    #[must_use]
    pub fn layout(&self) -> Layout {
        let budgets: Vec<_> = (0..self.buses)
            .map(|bus| self.traffic(bus).budget())
            .collect();
        let latest = |offset: fn(&syncline_canopen::budget::Budget) -> Duration| {
            budgets.iter().map(offset).max().unwrap_or_default()
        };
        let scaling = self.scaling();
        let limits = AxisLimits {
            position: (-1.0, STROKE + 1.0),
            velocity: SPEED,
            acceleration: ACCELERATION,
            jerk: JERK,
            following_error: 5.0,
            following_error_at_rest: 5.0,
            skew: None,
            standstill: 0.1,
        };
        Layout {
            cycle: self.period,
            setpoint_offset: latest(|budget| budget.setpoint_offset),
            latest_burst: budgets
                .iter()
                .map(|budget| budget.latest_burst)
                .min()
                .unwrap_or(self.period),
            node: NodeId::new(127).expect("a node id"),
            heartbeat: Duration::from_millis(100),
            sdo_timeout: Duration::from_secs(1),
            sdo_retries: 2,
            boot_timeout: Duration::from_secs(5),
            lock_timeout: Duration::from_secs(5),
            state_timeout: Duration::from_secs(5),
            stop_together: false,
            measured: Vec::new(),
            spindle: None,
            speed_loss: Duration::ZERO,
            shaper: Shaper::none(),
            shaper_method: None,
            retraction: None,
            probing: Probing::default(),
            probe_captures: vec![None; self.axes],
            lag: self.device(0).drive().map_or(0.0, |drive| drive.latency()),
            buses: budgets
                .into_iter()
                .enumerate()
                .map(|(bus, budget)| {
                    let mut by_node = [None; 128];
                    for axis in self.axes_of(bus) {
                        by_node[usize::from(self.node(axis).get())] = Some(axis);
                    }
                    layout::BusSpec {
                        name: bus_name(bus),
                        bit_rate: budget.bit_rate,
                        sdo_per_cycle: budget.sdo_transfers(self.device(0).spec().sdo_response),
                        devices: self.axes_of(bus).collect(),
                        by_node,
                    }
                })
                .collect(),
            devices: (0..self.axes)
                .map(|axis| layout::DeviceSpec {
                    t_pdo_misses: 2,
                    name: format!("drive {axis}"),
                    bus: axis % self.buses,
                    device: self.device(axis),
                    scaling,
                    heartbeat_timeout: Duration::from_millis(300),
                    standstill_window: scaling.magnitude(0.05),
                    steady_window: scaling.magnitude(0.05),
                    keeps_reference: false,
                    delay: 0.0,
                    middle: Increments::ZERO,
                })
                .collect(),
            axes: (0..self.axes)
                .map(|axis| layout::AxisSpec {
                    name: format!("axis {axis}"),
                    coordinate: axis,
                    unit: "mm",
                    drives: vec![axis],
                    point_to_point: false,
                    feed_forward: None,
                    feedback: None,
                    limits,
                    sent_limits: limits,
                    compensation: None,
                    cross_coupling: None,
                    homing: Homing::default(),
                    limit_inputs: [Vec::new(), Vec::new()],
                    kept: Err(NotKept::Unknown),
                })
                .collect(),
            homing: HomingPolicy::default(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            analog_inputs: Vec::new(),
            analog_outputs: Vec::new(),
        }
    }
}

fn bus_name(bus: usize) -> String {
    bus.to_string()
}

/// Moves all axes to and fro along one line, for ever.
pub struct Shuttle<const N: usize> {
    planner: Planner<N>,
    axes: usize,
    out: bool,
}

impl<const N: usize> Shuttle<N> {
    /// For the first `axes` of `N` coordinates, starting in zero.
    #[must_use]
    pub fn new(axes: usize) -> Self {
        let limits = Limits {
            velocity: [SPEED; N],
            acceleration: [ACCELERATION; N],
            jerk: [JERK; N],
        };
        Self {
            planner: Planner::new(limits, [0.0; N]),
            axes,
            out: false,
        }
    }

    /// The next instruction of the plan.
    pub fn instruction(&mut self) -> Instruction<N> {
        loop {
            if let Some(command) = self.planner.pop() {
                return Instruction::Plan(command);
            }
            self.push();
        }
    }

    /// Plans one move whole and forgets it.
    pub fn one_move(&mut self) {
        self.push();
        while self.planner.pop().is_some() {}
    }

    fn push(&mut self) {
        let place = |out| {
            let end = if out { STROKE } else { 0.0 };
            core::array::from_fn(|axis| if axis < self.axes { end } else { 0.0 })
        };
        let line = Curve::line(place(self.out), place(!self.out)).expect("a line");
        self.out = !self.out;
        let item = PathItem::Move(Move {
            curve: line,
            feed: Feed::Rapid,
            mode: PathControlMode::Stop,
            tag: 1,
        });
        self.planner.push(item).expect("within the limits");
    }
}

/// A simulated machine that is ready for its program, and waits for its next wake-up.
///
/// # Panics
/// If it does not get there.
#[must_use]
pub fn ready_machine<const N: usize>(shape: &Shape) -> Driver<N, Box<dyn Port + Send>> {
    let layout = Arc::new(shape.layout());
    let (world, ports) = shape.simulated();
    let mut driver = Driver::new(layout, world, ports, Instant::ZERO);
    driver.controller.touch();
    for _ in 0..2 * BRING_UP_CYCLES {
        if driver.controller.ready().is_some() {
            return driver;
        }
        let Some(wake) = driver.controller.next_wake() else {
            break;
        };
        driver
            .step(wake.at())
            .expect("a simulated bus does not fail");
    }
    panic!("no bring-up: {:?}", driver.controller.end());
}
