//! Wake-ups so late that whole cycles are lost.

use std::mem::take;
use std::sync::Arc;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId, nmt};
use syncline_controller::bench::rig::{Shape, Shuttle, ready_machine};
use syncline_controller::bus::{Burst, Received};
use syncline_controller::control::fault::{BusCause, DeviceCause};
use syncline_controller::control::{End, Event, Fault, Layout, Phase, Wake};
use syncline_controller::machine::Machine as MachineFile;
use syncline_controller::port::sim::{self, SimPort, Simulated};
use syncline_controller::port::{Port, PortError};
use syncline_controller::realtime;
use syncline_controller::run::driver::Driver;
use syncline_controller::run::real_time::{Cycle, Pace, Timing};
use syncline_drives::twin::Config;
use syncline_drives::world::{BusId, Observer, World};

const CYCLE: Duration = Duration::from_millis(2);

type Machine = Driver<9, Box<dyn Port + Send>>;

/// A machine of one axis in mid-motion, its next wake-up being SYNC.
fn in_motion() -> (Machine, Shuttle<9>) {
    let shape = Shape::on_fewest_buses(1, CYCLE).unwrap();
    let mut machine = ready_machine::<9>(&shape);
    let mut plan = Shuttle::new(1);
    for _ in 0..1001 {
        step(&mut machine, &mut plan, Duration::ZERO);
    }
    if machine.setpoints_are_next() {
        step(&mut machine, &mut plan, Duration::ZERO);
    }
    (machine, plan)
}

/// One wake-up, `late` after it was due.
fn step(machine: &mut Machine, plan: &mut Shuttle<9>, late: Duration) -> Instant {
    while machine.controller.room() > 0 {
        machine.controller.accept(plan.instruction());
    }
    let now = machine
        .controller
        .next_wake()
        .map_or(Instant::ZERO, Wake::at)
        + late;
    machine.step(now).unwrap();
    now
}

fn set(machine: &Machine) -> f64 {
    machine
        .controller
        .row()
        .map_or(f64::NAN, |row| row.plan.position[0])
}

#[test]
fn one_lost_cycle_is_counted_and_the_next_setpoint_is_that_of_its_own_instant() {
    let (mut machine, mut plan) = in_motion();
    let mut before = [0.0; 2];
    for place in &mut before {
        step(&mut machine, &mut plan, Duration::ZERO);
        step(&mut machine, &mut plan, Duration::ZERO);
        *place = set(&machine);
    }
    let advance = before[1] - before[0];
    assert!(advance > 0.05, "in motion: {advance} mm a cycle");

    let grid = machine.controller.next_wake().unwrap().at();
    step(&mut machine, &mut plan, CYCLE + CYCLE / 10);
    step(&mut machine, &mut plan, Duration::ZERO);
    assert_eq!(machine.controller.late_setpoints(), 1);
    assert_eq!(machine.controller.end(), None);
    let next = machine.controller.next_wake().unwrap().at();
    assert_eq!(next, grid + 2 * CYCLE, "SYNC keeps its grid");
    step(&mut machine, &mut plan, Duration::ZERO);
    step(&mut machine, &mut plan, Duration::ZERO);
    // The setpoint that SYNC latched one cycle late is the one that it is compared with.
    let sample = machine.controller.row().unwrap().axes[0];
    let behind = sample.following_error.abs();
    assert!(behind < 3.0 * advance, "{behind} mm, {advance} mm a cycle");
    // One setpoint left out: from the last row to this one are three cycles of motion.
    let passed = set(&machine) - before[1];
    assert!(
        (passed - 3.0 * advance).abs() < 0.02,
        "{passed} mm, {advance} mm a cycle"
    );
    for _ in 0..200 {
        step(&mut machine, &mut plan, Duration::ZERO);
    }
    assert_eq!(machine.controller.end(), None);
}

/// A machine that begins late still asks its drives what they do before it resets anything.
#[test]
fn a_late_first_wake_up_leaves_nothing_out() {
    let shape = Shape::on_fewest_buses(1, CYCLE).unwrap();
    let layout = Arc::new(shape.layout());
    let (world, ports) = shape.simulated();
    let mut machine = Driver::<9, _>::new(layout, world, ports, Instant::ZERO);
    let phases: Vec<Phase> = (0..40)
        .flat_map(|wake| {
            let due = machine.controller.next_wake().unwrap().at();
            let late = if wake == 0 {
                3 * CYCLE + CYCLE / 10
            } else {
                Duration::ZERO
            };
            machine.step(due + late).unwrap();
            std::iter::from_fn(|| machine.controller.event()).collect::<Vec<_>>()
        })
        .filter_map(|event| match event {
            Event::Phase(phase) => Some(phase),
            _ => None,
        })
        .collect();
    assert_eq!(phases[..2], [Phase::Survey, Phase::Boot]);
}

#[test]
fn two_lost_cycles_are_a_fault_and_the_stop_begins_where_the_plan_was_left() {
    let (mut machine, mut plan) = in_motion();
    step(&mut machine, &mut plan, Duration::ZERO);
    step(&mut machine, &mut plan, Duration::ZERO);
    let before = set(&machine);
    step(&mut machine, &mut plan, 50 * CYCLE);
    let end = machine.controller.end();
    assert!(
        matches!(
            end,
            Some(End::Fault(Fault::Bus(
                _,
                BusCause::LateSetpoints { count: 2 }
            )))
        ),
        "{end:?}"
    );
    step(&mut machine, &mut plan, Duration::ZERO);
    let after = set(&machine);
    assert!((after - before).abs() < 0.3, "{before} mm, then {after} mm");
    // No step of the plan is left out.
    step(&mut machine, &mut plan, Duration::ZERO);
    step(&mut machine, &mut plan, Duration::ZERO);
    let [advance, next] = [after - before, set(&machine) - after];
    assert!(
        (next - advance).abs() < 0.02,
        "{advance} mm, then {next} mm"
    );
}

/// How the portal ends with one more drive on its bus, under a node id that is taken, and whether it was
/// about to switch on power.
fn end_with_a_stranger(id: impl Fn(&MachineFile) -> NodeId) -> (Option<End>, bool) {
    let file = std::path::Path::new("../examples/portal/machine.toml");
    let machine = MachineFile::load(file).unwrap();
    let layout = std::sync::Arc::new(Layout::new(&machine).unwrap());
    let observer: Observer = Box::new(|_| ());
    let simulated = Simulated::new(&machine, 0, [Some(observer)], |_, _| ()).unwrap();
    let (mut world, bus) = (simulated.world, simulated.buses[0].unwrap());
    let stranger = Config {
        seed: 7,
        ..Config::new(id(&machine))
    };
    world.attach(bus, sim::twin(machine.drives[2].model, &stranger));
    let ports = vec![SimPort::new(bus)];
    let mut machine: Driver<9, SimPort> = Driver::new(layout, world, ports, Instant::ZERO);
    let mut powers = false;
    while let Some(wake) = machine.controller.next_wake()
        && !powers
    {
        machine.step(wake.at()).unwrap();
        powers |= machine.controller.phase() == Phase::ReadyToSwitchOn;
    }
    (machine.controller.end(), powers)
}

/// A second drive has the node id of the first: told before any power stage is on.
#[test]
fn two_nodes_with_one_id_are_a_fault_before_power_is_on() {
    let (end, powers) = end_with_a_stranger(|machine| machine.drives[2].node);
    assert!(
        matches!(
            end,
            Some(End::Fault(Fault::Device(
                2,
                DeviceCause::SecondTPdo | DeviceCause::TwoNodes
            )))
        ),
        "{end:?}"
    );
    assert!(!powers);
}

/// A drive that has the controller's own: its heartbeat would have the others run on without their controller.
#[test]
fn a_node_with_the_controllers_id_is_a_fault_before_power_is_on() {
    let (end, powers) = end_with_a_stranger(|machine| machine.controller.node);
    let node = NodeId::new(127).unwrap();
    let cause = BusCause::SecondController { node };
    assert_eq!(end, Some(End::Fault(Fault::Bus(0, cause))));
    assert!(!powers);
}

/// How a machine in motion ends once a frame that is its own to send comes from elsewhere; its own echo ends nothing.
fn end_by_another_master(frame: Frame) -> Option<End> {
    let (mut machine, mut plan) = in_motion();
    let at = step(&mut machine, &mut plan, Duration::ZERO);
    let mut received = Received {
        at,
        frame,
        echo: true,
    };
    machine.controller.receive(0, &received);
    assert_eq!(machine.controller.end(), None);
    received.echo = false;
    machine.controller.receive(0, &received);
    machine.controller.end()
}

/// SYNC from elsewhere has the drives take their setpoints when it comes.
#[test]
fn sync_from_elsewhere_is_a_fault_by_its_name() {
    let end = end_by_another_master(Frame::new(CobId::SYNC, &[]));
    assert_eq!(end, Some(End::Fault(Fault::Bus(0, BusCause::SecondSync))));
}

/// Another master's NMT command is told before the device that it stops is missed; the controller's own are its own.
#[test]
fn nmt_commands_from_elsewhere_are_a_fault_by_their_name() {
    let request = nmt::Request {
        command: nmt::Command::Stop,
        node: NodeId::new(2),
    };
    let end = end_by_another_master(request.encode());
    let cause = BusCause::SecondNmtMaster { request };
    assert_eq!(end, Some(End::Fault(Fault::Bus(0, cause))));
}

/// A bus that something is wrong with.
struct Troubled {
    port: Box<dyn Port + Send>,
    /// What the next acyclic frames are delayed by.
    delay: Duration,
    /// So many bursts are dropped.
    drops: u32,
}

impl Port for Troubled {
    fn simulated(&self) -> Option<BusId> {
        self.port.simulated()
    }
    fn exchange(&mut self, world: &mut World) {
        self.port.exchange(world);
    }
    fn echoes(&self) -> bool {
        self.port.echoes()
    }
    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        self.port.receive(sink)
    }
    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.port.send_sync(frame)
    }
    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        if self.drops > 0 {
            self.drops -= 1;
            return Ok(Burst::Dropped);
        }
        self.port.send_burst(frames)
    }
    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        std::thread::sleep(take(&mut self.delay));
        self.port.send_acyclic(frames)
    }
}

#[test]
fn the_stage_that_made_a_wake_up_late_is_told() {
    let file = std::path::Path::new("../examples/portal/machine.toml");
    let machine = MachineFile::load(file).unwrap();
    let layout = std::sync::Arc::new(Layout::new(&machine).unwrap());
    let (world, mut ports) =
        syncline_controller::port::open(&machine, 0, vec![Box::new(|_| ())]).unwrap();
    let slow = Troubled {
        port: ports.remove(0),
        delay: 20 * CYCLE,
        drops: 0,
    };
    let timing = Timing {
        settings: realtime::Settings {
            priority: 1,
            core: None,
        },
        spin: Duration::ZERO,
        pace: Pace::Lockstep,
        strict: false,
    };
    let (cycle, link, instructions) = Cycle::new(&layout, world, vec![Box::new(slow)], timing);
    // Nobody is there: it begins its way down at once.
    drop((link, instructions));
    let (_, measured) = cycle.run(|_| ());
    let [_, receive, compute, send] = measured.late_by;
    assert!(send >= 1, "{:?}", measured.late_by);
    assert_eq!([receive, compute], [0, 0]);
    assert_eq!(measured.late_by.iter().sum::<u64>(), measured.late);
    assert!(measured.worst.to_string().ends_with("us: send"));
    assert!(measured.worst.send >= 20 * CYCLE);
}

#[test]
fn a_dropped_burst_is_counted_and_two_in_a_row_are_a_fault() {
    for (dropped, faulty) in [(1, false), (2, true)] {
        let (mut machine, mut plan) = in_motion();
        let port = Troubled {
            port: machine.ports.remove(0),
            delay: Duration::ZERO,
            drops: dropped,
        };
        machine.ports.push(Box::new(port));
        for _ in 0..20 {
            step(&mut machine, &mut plan, Duration::ZERO);
        }
        assert_eq!(machine.controller.late_setpoints(), u64::from(dropped));
        assert_eq!(machine.controller.end().is_some(), faulty);
    }
}
