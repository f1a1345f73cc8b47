//! The machine as the controller needs it, made once from the machine file.

use super::axis::{AxisTorque, STEADY};
use super::fault::{AxisIndex, BusCause, BusIndex, DeviceIndex, Names};
use super::inputs::InputIndex;
use crate::budget::{BusBudget, DoesNotFit, MachineBudget};
use crate::machine::{
    self, AnalogSource, AxisLimits, Homing, HomingPolicy, Kept, Machine, MachineState, Motion,
    NotKept, OutputSwitch, ProbeCaptures, Probing, Seat, Spindle, SpindleDrive, TURN,
};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, NodeId, nmt};
use syncline_drives::model::{Device, Direction, Feedback, Increments, Scaling};
use syncline_gcode::Output;
use syncline_trajectory::limits::Limits;
use syncline_trajectory::path::Retraction;
use syncline_trajectory::shaper::{Method, Shaper};

/// No speed of a spindle is held more closely than to this part of the greatest.
const LEAST_WINDOW: f64 = 0.001;
/// Increments by which an encoder that stands may tell another position.
const NOISE: f64 = 2.0;
/// A spindle stands that turns by less, degrees.
const SPINDLE_STANDS: f64 = 0.5;

/// Buses, devices, axes and times.
#[derive(Debug)]
pub struct Layout {
    /// Base cycle: from SYNC to SYNC; above zero.
    pub cycle: Duration,
    /// From SYNC to receiving, supervising and sending the setpoints of the next SYNC.
    pub setpoint_offset: Duration,
    /// From SYNC to the last instant at which a burst still reaches the drives before the next one.
    pub latest_burst: Duration,
    /// The controller's own node id.
    pub node: NodeId,
    /// Between two of the controller's own heartbeats.
    pub heartbeat: Duration,
    /// For the answer to one SDO request.
    pub sdo_timeout: Duration,
    /// Further requests after one that was not answered.
    pub sdo_retries: u32,
    /// For the boot-up message after a reset.
    pub boot_timeout: Duration,
    /// For a drive's clock to follow SYNC.
    pub lock_timeout: Duration,
    /// For a drive to reach the state that it was commanded to.
    pub state_timeout: Duration,
    /// Where one axis is quick-stopped, all are.
    pub stop_together: bool,
    /// Cycles from the SYNC that latches a setpoint of the slowest drive until it is where it was sent to.
    /// All axes are where the plan was so long ago: setpoints of the others are those of later
    /// ([`DeviceSpec::delay`]).
    pub lag: f64,
    /// Buses, in the order of the machine file.
    pub buses: Vec<BusSpec>,
    /// Drives of axes, in the order of the machine file, behind them encoders in theirs, and I/O nodes in theirs, and
    /// the drive of the spindle.
    pub devices: Vec<DeviceSpec>,
    /// Axes, in the order of the machine file.
    pub axes: Vec<AxisSpec>,
    /// The encoders on shafts of their own, in the order of the machine file.
    pub measured: Vec<DeviceIndex>,
    /// The spindle, where a drive turns it.
    pub spindle: Option<SpindleSpec>,
    /// A cut may go on for so long after the spindle has lost its speed.
    pub speed_loss: Duration,
    /// What setpoints go through on their way from the path to the drives.
    pub shaper: Shaper,
    /// What of a motion it shapes; `None`: what the mode of each move says.
    pub shaper_method: Option<Method>,
    /// How the axes go back to a path that they were jogged off; `None`: on a straight line.
    pub retraction: Option<Retraction>,
    /// What holds for the homing of all axes.
    pub homing: HomingPolicy,
    /// What holds for probing.
    pub probing: Probing,
    /// By device, how it captures where the probe touches, if it does.
    pub probe_captures: Vec<Option<ProbeCaptures>>,
    /// Inputs, in the order of the machine file.
    pub inputs: Vec<machine::Input>,
    /// The machine's analog inputs.
    pub analog_inputs: Vec<machine::AnalogInput>,
    /// Outputs, in the order of the machine file.
    pub outputs: Vec<machine::Output>,
    /// Analog outputs, likewise.
    pub analog_outputs: Vec<machine::AnalogOutput>,
}

/// A bus as the controller has to use it.
#[derive(Debug)]
pub struct BusSpec {
    /// As the machine file names it.
    pub name: String,
    /// Bits per second.
    pub bit_rate: u32,
    /// SDO requests, with their answers, that fit beside one cycle's SYNC and PDOs; at least one,
    /// as none is sent while axes move.
    pub sdo_per_cycle: usize,
    /// The devices on it.
    pub devices: Vec<DeviceIndex>,
    /// By node id: the device.
    pub by_node: [Option<DeviceIndex>; 128],
}

impl BusSpec {
    /// The device whose node id is in the frame's identifier.
    pub(super) fn node_of(&self, frame: &Frame) -> Option<DeviceIndex> {
        match frame.id() {
            CanId::Standard(id) => self.by_node[usize::from(id & 0x7F)],
            CanId::Extended(_) => None,
        }
    }
}

/// A drive, an encoder or an I/O node, as it is switched on.
#[derive(Debug)]
pub struct DeviceSpec {
    /// As the machine file names it.
    pub name: String,
    /// The bus it is on.
    pub bus: BusIndex,
    /// What the controller knows of it, as it is switched on.
    pub device: Device,
    /// Machine millimetres to increments, of what has a place on an axis.
    pub scaling: Scaling,
    /// Cycles in a row without its T_PDO that are a fault.
    pub t_pdo_misses: u32,
    /// Without a heartbeat for so long it is lost.
    pub heartbeat_timeout: Duration,
    /// Standing still is moving less than this.
    pub standstill_window: Increments,
    /// What it may move and still be compared with a device that is asked for its position.
    pub steady_window: Increments,
    /// Cycles by which it is sent the plan later than the slowest drive, as it is faster by so much.
    pub delay: f64,
    /// Its axis keeps its reference from one day to the next, as this very device and its motor count.
    pub keeps_reference: bool,
    /// In the middle of its axis's travel: where a position that begins anew is first looked for.
    pub middle: Increments,
}

/// An axis and its limits: a drive, or the two sides of a gantry.
#[derive(Clone, Debug)]
pub struct AxisSpec {
    /// As the machine file names it.
    pub name: String,
    /// Its place in the plan's coordinates.
    pub coordinate: usize,
    /// Of its positions: `mm`, or `°`, as which every mm below counts then.
    pub unit: &'static str,
    /// Its drives.
    pub drives: Vec<DeviceIndex>,
    /// What says where it is, beside them.
    pub feedback: Option<AxisFeedback>,
    /// It goes point to point, by profiles of its drive's own.
    pub point_to_point: bool,
    /// What its drives are sent of the torque that they take, if they are.
    pub feed_forward: Option<AxisTorque>,
    /// What it may be planned to do, and what is a fault.
    pub limits: AxisLimits,
    /// What its drives may be sent.
    pub sent_limits: AxisLimits,
    /// What its setpoints are corrected by.
    pub compensation: Option<machine::Compensation>,
    /// How the sides of a gantry are coupled.
    pub cross_coupling: Option<machine::CrossCoupling>,
    /// How it comes to know where it is.
    pub homing: Homing,
    /// The limit switches at its negative and at its positive end.
    pub limit_inputs: [Vec<InputIndex>; 2],
    /// The references of its drives from when the machine was on last.
    pub kept: Result<Vec<Kept>, NotKept>,
}

/// A spindle that a drive turns.
#[derive(Clone, Copy, Debug)]
pub struct SpindleSpec {
    /// Its drive, whose scaling is in degrees.
    pub drive: DeviceIndex,
    /// The greatest S, 1/min.
    pub fastest: f64,
    /// It has its speed within this part of it.
    pub tolerance: f64,
    /// As fast as its drive's ramp changes its speed, 1/min in a second.
    pub ramp: f64,
    /// Within this time it turns as it was told last.
    pub reversal: Duration,
    /// The smallest difference of speeds that its drive tells, 1/min; 0 where it tells a position.
    pub speed_step: f64,
    /// How it is oriented; `None` where its drive tells no position.
    pub orientation: Option<OrientationSpec>,
}

/// How a spindle is brought to an angle (M19).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationSpec {
    /// It is there within so much, degrees.
    pub tolerance: f64,
    /// What it keeps on the way, in turns.
    pub limits: Limits,
    /// So much later than its drive is sent a velocity it has it, s.
    pub delay: f64,
    /// It is there within this time, from whatever speed.
    pub within: Duration,
}

impl AxisSpec {
    fn of(machine: &Machine, axis: &machine::Axis) -> Self {
        Self {
            name: axis.name().to_owned(),
            coordinate: axis.letter.index(),
            unit: axis.units()[0],
            drives: axis.drives.clone(),
            point_to_point: axis.motion == Motion::PointToPoint,
            feedback: axis.feedback.map(|it| AxisFeedback::of(machine, axis, it)),
            feed_forward: (axis.feed_forward.as_ref())
                .map(|it| AxisTorque::new(it, axis.mm_per_revolution)),
            limits: axis.limits,
            sent_limits: axis.sent_limits,
            compensation: axis.compensation.clone(),
            cross_coupling: axis.cross_coupling,
            homing: axis.homing.clone(),
            limit_inputs: axis.limit_inputs.clone(),
            kept: Err(NotKept::Unknown),
        }
    }
}

impl SpindleSpec {
    /// By how much it may differ from a speed that it has, 1/min.
    pub(super) fn window(&self, speed: f64) -> f64 {
        let window = (self.tolerance * speed.abs()).max(LEAST_WINDOW * self.fastest);
        // It was sent the nearest that there is, and tells the nearest.
        window.max(self.speed_step)
    }
}

/// By device, how it captures what a probing looks for, if it is to.
fn probe_captures(machine: &Machine) -> Vec<Option<ProbeCaptures>> {
    let devices = 0..machine.nodes().count();
    let captures = devices.map(|device| {
        let captures = ProbeCaptures::new(device, &machine.drives, &machine.inputs);
        captures.filter(|_| machine.probing.latch)
    });
    captures.collect()
}

/// What a device counts by, and by how much it may move where it stands: at its axis, or turning the spindle.
fn scale(machine: &Machine, index: usize, seat: Option<Seat<'_>>) -> Option<(Scaling, f64)> {
    let seat = seat.map(|it| (*it.scaling, machine.axes[it.axis].limits.standstill));
    let spindle = (machine.spindle_drive()).filter(|(place, _)| *place == index);
    seat.or(spindle.map(|(_, drive)| (drive.scaling, SPINDLE_STANDS)))
}

impl SpindleSpec {
    fn of(machine: &Machine) -> Option<Self> {
        let (place, drive) = machine.spindle_drive()?;
        let spindle = machine.spindle.as_ref()?;
        let device = machine.device(place);
        let step = device.drive().and_then(|it| it.speed_step());
        Some(Self {
            drive: place,
            fastest: spindle.speeds.1,
            tolerance: drive.tolerance,
            ramp: spindle.acceleration(),
            reversal: spindle.reversal(),
            speed_step: step.map_or(0.0, |step| step / drive.increments_per_second(1.0).abs()),
            orientation: OrientationSpec::of(machine, spindle, drive),
        })
    }
}

impl OrientationSpec {
    fn of(machine: &Machine, spindle: &Spindle, drive: &SpindleDrive) -> Option<Self> {
        let delay = spindle.delay(machine);
        let delay = delay.filter(|_| drive.model.moves_axes())?;
        Some(Self {
            tolerance: drive.orientation_tolerance,
            limits: spindle.smooth_limits(),
            delay,
            within: spindle.orienting(),
        })
    }
}

/// What says where an axis is, beside its drives.
#[derive(Clone, Copy, Debug)]
pub struct AxisFeedback {
    /// Which encoder.
    pub encoder: DeviceIndex,
    /// Between its position and that of the drives; more is a fault. mm.
    pub difference: f64,
    /// It is what the axis's position loop is closed by, and where the axis is.
    pub closes_loop: bool,
    /// When the drives learn their place from it.
    pub teaches: Teaches,
}

/// When drives learn their place from the encoder of their axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Teaches {
    /// Never: they know it by themselves.
    Never,
    /// As they come up: it closes the loop. What slips later is a fault, also while they are without power, as they count on.
    AtBringUp,
    /// As they come up and whenever they are enabled: without power they do not see how they are moved.
    AtEnabling,
}

impl AxisFeedback {
    fn of(machine: &Machine, axis: &machine::Axis, feedback: machine::Feedback) -> Self {
        let counts_anew = |&drive: &usize| {
            let device = machine.device(drive);
            device
                .feedback()
                .is_some_and(|it| !it.counts_without_power())
        };
        let counts_anew = axis.drives.iter().any(counts_anew);
        Self {
            encoder: machine.drives.len() + feedback.encoder,
            difference: feedback.difference,
            closes_loop: feedback.closes_loop,
            teaches: match feedback.closes_loop || axis.homing.tells_place() {
                true if counts_anew => Teaches::AtEnabling,
                true if feedback.closes_loop => Teaches::AtBringUp,
                _ => Teaches::Never,
            },
        }
    }
}

/// By how much an encoder that is held against drives which are asked for their positions may move and still stands, mm; `None`:
/// this device is none.
fn steady(machine: &Machine, device: usize) -> Option<f64> {
    let encoder = device.checked_sub(machine.drives.len())?;
    let of = |it: &&machine::Axis| it.feedback.is_some_and(|it| it.encoder == encoder);
    let axis = machine.axes.iter().find(of)?;
    let asked = |&drive: &usize| !machine.device(drive).spec().answers_sync;
    let asks = axis.drives.iter().any(asked);
    axis.feedback
        .filter(|_| asks)
        .map(|it| STEADY * it.difference)
}

impl Layout {
    /// What the position of the spindle's drive tells at least, turns; 1 without one.
    pub(super) fn spindle_resolution(&self) -> f64 {
        let scaling = self
            .spindle
            .map(|spindle| &self.devices[spindle.drive].scaling);
        scaling.map_or(1.0, |scaling| scaling.resolution().abs() / TURN)
    }

    /// What a frame that another node sent does that only the controller may.
    pub(super) fn second_master(&self, frame: &Frame) -> Option<BusCause> {
        let node = self.node;
        let is = |cob_id: CobId| frame.id() == CanId::from(cob_id);
        if is(CobId::SYNC) {
            Some(BusCause::SecondSync)
        } else if let Some(request) = nmt::Request::decode(frame) {
            Some(BusCause::SecondNmtMaster { request })
        } else if is(CobId::error_control(node)) {
            Some(BusCause::SecondController { node })
        } else {
            None
        }
    }

    /// A machine's layout.
    ///
    /// # Errors
    /// If the frames of a bus do not fit the cycle.
    pub fn new(machine: &Machine) -> Result<Self, DoesNotFit> {
        let budget = MachineBudget::of(machine);
        budget.check()?;
        let devices: Vec<Device> = (0..machine.nodes().count())
            .map(|index| machine.device(index))
            .collect();
        let latencies: Vec<Option<f64>> = (machine.nodes().zip(&devices))
            .map(|(node, device)| {
                let early = budget.early(node.bus, machine.cycle);
                // Who goes by a profile of its own keeps nobody waiting.
                let follows = |seat: Seat<'_>| machine.axes[seat.axis].motion == Motion::Path;
                device
                    .drive()
                    .filter(|_| node.seat.is_some_and(follows))
                    .map(|drive| match drive.spec().latches_at_sync {
                        true => drive.latency(),
                        false => drive.latency() - early,
                    })
            })
            .collect();
        let keeps_reference = |seat: Seat<'_>| machine.axes[seat.axis].homing.moved_limit.is_some();
        let lag = latencies.iter().flatten().copied().fold(0.0, f64::max);
        let nowhere = Scaling::new(1, 1.0, Direction::Positive, Increments::ZERO);
        let devices: Vec<DeviceSpec> = (machine.nodes().zip(devices).zip(latencies))
            .enumerate()
            .map(|(index, ((node, device), latency))| {
                let loss = machine.position_loss(index);
                let apart = machine.cycle * device.spec().sync_divider;
                let lost = loss.map(|loss| (loss.as_nanos() / apart.as_nanos()) as u32 + 1);
                let scale = scale(machine, index, node.seat);
                let mut scaling = scale.map_or(nowhere, |(scaling, _)| scaling);
                let mut standstill = scale.map(|(scaling, window)| scaling.magnitude(window));
                let steady = steady(machine, index).map(|steady| {
                    let noise = NOISE * scaling.resolution();
                    scaling.magnitude(steady.max(noise))
                });
                let middle = node.seat.map(|seat| machine.axes[seat.axis].middle());
                let mut middle = middle.and_then(|mm| scaling.to_increments(mm).ok());
                if let Some((_, encoder)) = machine.measured().find(|(at, _)| *at == index) {
                    // It turns as it likes, and counts from what it reads first.
                    let range = device.feedback().and_then(Feedback::range);
                    scaling = encoder.scaling;
                    standstill = Some(Increments::MAX);
                    middle = range.map(|range| Increments::new(range.get() / 2));
                }
                DeviceSpec {
                    name: node.name.to_owned(),
                    bus: node.bus,
                    delay: latency.map_or(0.0, |latency| lag - latency),
                    device,
                    scaling,
                    t_pdo_misses: lost.unwrap_or(machine.controller.t_pdo_misses),
                    heartbeat_timeout: machine.controller.heartbeat_timeout,
                    standstill_window: standstill.unwrap_or_default(),
                    steady_window: steady.or(standstill).unwrap_or_default(),
                    keeps_reference: node.seat.is_some_and(keeps_reference),
                    // The soft limits are within what it can count.
                    middle: middle.unwrap_or_default(),
                }
            })
            .collect();
        let buses = (budget.buses.iter().enumerate())
            .map(|(index, bus)| BusSpec::new(index, bus, &devices))
            .collect();
        let controller = &machine.controller;
        Ok(Self {
            cycle: machine.cycle,
            setpoint_offset: budget.setpoint_offset,
            latest_burst: budget.latest_burst,
            node: controller.node,
            heartbeat: controller.heartbeat,
            sdo_timeout: controller.sdo_timeout,
            sdo_retries: controller.sdo_retries,
            boot_timeout: controller.boot_timeout,
            lock_timeout: controller.sync_lock_timeout,
            state_timeout: controller.state_timeout,
            stop_together: controller.stop_together,
            lag,
            axes: (machine.axes.iter())
                .map(|axis| AxisSpec::of(machine, axis))
                .collect(),
            buses,
            devices,
            measured: machine.measured().map(|(device, _)| device).collect(),
            spindle: SpindleSpec::of(machine),
            speed_loss: (machine.spindle.as_ref()).map_or(Duration::ZERO, |it| it.loss),
            shaper: machine.shaper.clone(),
            shaper_method: machine.shaper_method,
            retraction: machine.retraction,
            homing: machine.homing,
            probing: machine.probing,
            probe_captures: probe_captures(machine),
            inputs: machine.inputs.clone(),
            analog_inputs: machine.analog_inputs.clone(),
            outputs: machine.outputs.clone(),
            analog_outputs: machine.analog_outputs.clone(),
        })
    }
}

impl Layout {
    /// Takes up what is known of the machine from when it was on last.
    #[must_use]
    pub fn recalling(mut self, machine: &Machine, state: &MachineState) -> Self {
        for (spec, axis) in self.axes.iter_mut().zip(&machine.axes) {
            spec.kept = state.of_axis(machine, axis);
        }
        self
    }

    /// The drives among the devices: those of axes, and that of the spindle.
    pub fn drives(&self) -> impl Iterator<Item = DeviceIndex> {
        let devices = self.devices.iter().enumerate();
        let drives = devices.filter(|(_, device)| device.device.drive().is_some());
        drives.map(|(index, _)| index)
    }

    /// The axes that follow a path: all but those that go point to point.
    pub(super) fn path_axes(&self) -> impl Iterator<Item = &AxisSpec> {
        self.axes.iter().filter(|axis| !axis.point_to_point)
    }

    /// The R_PDOs of a bus by their identifiers, each as device and place among its R_PDOs: the
    /// order in which a burst leaves.
    pub(super) fn burst(&self, bus: &BusSpec) -> Vec<(DeviceIndex, usize)> {
        let mut burst = Vec::new();
        for &device in &bus.devices {
            let r_pdos = self.devices[device].device.spec().r_pdos.iter().enumerate();
            burst.extend(r_pdos.map(|(place, r_pdo)| (r_pdo.cob_id.get(), (device, place))));
        }
        burst.sort_unstable();
        burst.into_iter().map(|(_, r_pdo)| r_pdo).collect()
    }
}

impl BusSpec {
    fn new(index: BusIndex, bus: &BusBudget, devices: &[DeviceSpec]) -> Self {
        let own: Vec<DeviceIndex> = (0..devices.len())
            .filter(|&device| devices[device].bus == index)
            .collect();
        let mut by_node = [None; 128];
        for &device in &own {
            by_node[usize::from(devices[device].device.spec().node.get())] = Some(device);
        }
        Self {
            name: bus.bus.clone(),
            bit_rate: bus.budget.bit_rate,
            sdo_per_cycle: bus.sdo_per_cycle,
            devices: own,
            by_node,
        }
    }
}

impl Layout {
    /// Whether a signal of a device is an input that the machine file names.
    pub(crate) fn is_input(&self, device: DeviceIndex, signal: usize) -> bool {
        let mut inputs = self.inputs.iter();
        inputs.any(|input| (input.node, input.signal) == (device, signal))
    }

    /// Whether a signal of a device is an output that the machine file names.
    pub(crate) fn is_output(&self, device: DeviceIndex, signal: usize) -> bool {
        // A device's signals are its inputs and behind them its outputs.
        let inputs = self.devices[device].device.spec().model.inputs.len();
        let mut outputs = self.outputs.iter();
        outputs.any(|output| (output.node, inputs + output.signal) == (device, signal))
    }

    /// Whether what a program switches is an output that the machine file names.
    pub(crate) fn has_output(&self, output: Output) -> bool {
        match output {
            Output::Digital { number, .. } => {
                (self.outputs.iter()).any(|output| output.switch == OutputSwitch::Program(number))
            }
            Output::Analog { number, .. } => (self.analog_outputs.iter())
                .any(|output| output.source == AnalogSource::Program(number)),
            Output::User { .. } => false,
        }
    }
}

impl Names for Layout {
    fn device(&self, device: DeviceIndex) -> (NodeId, &str, &str) {
        let device = &self.devices[device];
        let spec = device.device.spec();
        (spec.node, &device.name, spec.model.title)
    }

    fn axis(&self, axis: AxisIndex) -> &AxisSpec {
        &self.axes[axis]
    }

    fn turns_spindle(&self, device: DeviceIndex) -> bool {
        self.spindle.is_some_and(|spindle| spindle.drive == device)
    }

    fn bus(&self, bus: BusIndex) -> &str {
        &self.buses[bus].name
    }

    fn signal(&self, device: DeviceIndex, signal: usize) -> &str {
        let model = self.devices[device].device.spec().model;
        model.signal(signal).unwrap_or_default()
    }

    fn input(&self, input: InputIndex) -> &str {
        &self.inputs[input].name
    }

    fn output(&self, output: usize) -> &str {
        &self.outputs[output].name
    }

    fn analog_output(&self, output: usize) -> &str {
        &self.analog_outputs[output].name
    }

    fn vendor_error(&self, device: DeviceIndex, bytes: [u8; 5]) -> Option<String> {
        self.devices[device].device.vendor_error(bytes)
    }
}
