//! A whole machine in virtual time, to interfere with: the controller of `syncline validate` on
//! simulated drives, with everything that the bus carries, the controller tells and the trace
//! holds in view.

use crate::command::{Folder, machine_file, machine_with};
use crate::trace::{self, Trace};
use std::any::Any;
use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_controller::bus::{Burst, BusFault, Received};
use syncline_controller::control::{
    Controller, End, Event, Fault, Layout, Phase, Row, State, Switch,
};
use syncline_controller::machine::{COORDINATES, Machine, MachineState};
use syncline_controller::observe::Observers;
use syncline_controller::observe::flight_recorder::FaultFiles;
use syncline_controller::observe::frames::SharedFrames;
use syncline_controller::observe::summary::Summary;
use syncline_controller::port::sim::{SimPort, Simulated};
use syncline_controller::port::{Port, PortError};
use syncline_controller::program::Programs;
use syncline_controller::run::Progress;
use syncline_controller::run::virtual_time::VirtualMachine;
use syncline_controller::session::{
    self, Command, Operator, PassesStops, Refused, Session, Subscription,
};
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::twin::{Config, SimulatedDevice};
use syncline_drives::world::{BusId, DeviceId, Observer, World};
use syncline_gcode::Tables;

/// Steps after which a run is taken for endless: 2 minutes of the portal's time.
const MOST_STEPS: usize = 120_000;

/// A few seconds of lines and arcs on the portal, in all its axes; ends where it begins.
pub const PORTAL_PROGRAM: &str = "\
G17 G21 G90 G94 G61
G0 X300 Y150 Z-20
G1 X350 Y200 F18000
G2 X450 Y300 I100
G3 X400 Y250 I-50 Z-40
G1 X200 Y300 Z-10
G0 X0 Y0 Z0
M2
";

/// Changes what arrives from the bus; what it is false for is lost.
pub type Doctor = Box<dyn FnMut(&mut Received) -> bool + Send>;

/// Changes the burst of setpoints on its way to the bus.
pub type Forger = Box<dyn FnMut(&mut Vec<Frame>) + Send>;

/// A simulated bus whose port can be interfered with.
pub struct TappedPort {
    port: SimPort,
    /// Bursts that find a full transmit queue from now on.
    pub drop_bursts: u32,
    /// Bursts that leave behind the SYNC they are meant for, from now on.
    pub delay_bursts: u32,
    /// Bursts of which only the first frame finds room, from now on.
    pub tear_bursts: u32,
    /// The interface is gone.
    pub unplugged: bool,
    /// What it reports of its bus next.
    pub condition: Option<BusFault>,
    /// What happens to received frames.
    pub doctor: Option<Doctor>,
    /// What happens to bursts that are sent.
    pub forger: Option<Forger>,
    late: Vec<Frame>,
}

impl TappedPort {
    fn check(&self) -> Result<(), PortError> {
        match self.unplugged {
            true => Err(PortError {
                bus: "tapped".into(),
                what: "unplugged".into(),
            }),
            false => Ok(()),
        }
    }
}

/// An error with its causes.
fn told(error: &dyn Error) -> String {
    let mut told = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        told += &format!(": {error}");
        cause = error.source();
    }
    told
}

/// One less, if there is one.
fn take_one(count: &mut u32) -> bool {
    let some = *count > 0;
    *count = count.saturating_sub(1);
    some
}

impl Port for TappedPort {
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
        self.check()?;
        let doctor = &mut self.doctor;
        self.port.receive(&mut |mut received| {
            if doctor.as_mut().is_none_or(|doctor| doctor(&mut received)) {
                sink(received);
            }
        })
    }

    fn condition(&mut self) -> Option<BusFault> {
        self.condition.take()
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.check()?;
        self.port.send_sync(frame)?;
        self.port.send_burst(&std::mem::take(&mut self.late))?;
        Ok(())
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        self.check()?;
        if take_one(&mut self.drop_bursts) {
            Ok(Burst::Dropped)
        } else if take_one(&mut self.tear_bursts) {
            self.port.send_burst(&frames[..1])?;
            Ok(Burst::Torn { queued: 1 })
        } else if take_one(&mut self.delay_bursts) {
            self.late.extend(frames);
            Ok(Burst::Queued)
        } else if let Some(forger) = &mut self.forger {
            let mut frames = frames.to_vec();
            forger(&mut frames);
            self.port.send_burst(&frames)
        } else {
            self.port.send_burst(frames)
        }
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        self.check()?;
        self.port.send_acyclic(frames)
    }
}

/// The machine and all that is known about its run so far.
pub struct Rig {
    /// The machine's file.
    pub machine: Machine,
    /// What the controller knows of it.
    pub layout: Arc<Layout>,
    /// What the controller told.
    pub events: Vec<Event>,
    /// What it recorded at every SYNC of the program.
    pub rows: Vec<Row<COORDINATES>>,
    /// What the program switched.
    pub switches: Vec<Switch>,
    /// When each phase was entered.
    pub phases: Vec<(Phase, Instant)>,
    /// The states that the session was in, one after the other.
    pub states: Vec<State>,
    /// Commands that were refused.
    pub refused: Vec<Refused>,
    /// What could not go on, with its causes.
    pub problems: Vec<String>,
    /// What programs told their operator: the line, and what.
    pub messages: Vec<(u32, String)>,
    /// What led to faults and was written.
    pub recorded: Vec<FaultFiles>,
    /// At a pause the operator goes on at once.
    pub goes_on: bool,
    /// The machine as operators have it.
    pub session: Session<VirtualMachine<TappedPort>>,
    operator: Operator,
    passes_stops: PassesStops,
    told: Subscription,
    /// In the order of the machine file.
    twins: Vec<DeviceId>,
    frames: Arc<Mutex<Vec<Transmission>>>,
    steps: usize,
    /// Holds the programs, which are read while they run.
    pub folder: Folder,
}

impl Rig {
    /// The example portal with a program.
    #[must_use]
    pub fn portal(program: &str) -> Self {
        Self::new("portal", &[], program, |_, _| ())
    }

    /// An example machine with parts of its file replaced, a program, and changes to the twins, which are given by their place in the file.
    ///
    /// # Panics
    /// If the machine is not good.
    #[must_use]
    pub fn new(
        machine: &str,
        replacements: &[(&str, &str)],
        program: &str,
        configure: impl Fn(usize, &mut Config),
    ) -> Self {
        let state = MachineState::default();
        Self::switched_on(machine, replacements, Some(program), &state, configure)
    }

    /// The same without a program: a machine that stays on.
    #[must_use]
    pub fn staying_on(
        machine: &str,
        replacements: &[(&str, &str)],
        configure: impl Fn(usize, &mut Config),
    ) -> Self {
        Self::recalling(machine, replacements, &MachineState::default(), configure)
    }

    /// The same, of which that is known from when it was on last.
    #[must_use]
    pub fn recalling(
        machine: &str,
        replacements: &[(&str, &str)],
        state: &MachineState,
        configure: impl Fn(usize, &mut Config),
    ) -> Self {
        Self::switched_on(machine, replacements, None, state, configure)
    }

    fn switched_on(
        machine: &str,
        replacements: &[(&str, &str)],
        program: Option<&str>,
        state: &MachineState,
        configure: impl Fn(usize, &mut Config),
    ) -> Self {
        let folder = Folder::new();
        let file = folder.file("machine.toml", &machine_with(machine, replacements));
        let machine = Machine::load(&file).expect("a good machine");
        let layout = Layout::new(&machine).expect("it fits its cycle");
        let layout = Arc::new(layout.recalling(&machine, state));
        let programs = Programs::new(&machine, &file).expect("good tables");
        let shared = SharedFrames::new(&machine);
        let sent = shared.listen(&machine);
        let frames = Arc::new(Mutex::new(Vec::new()));
        let observers = (0..machine.buses.len()).map(|bus| {
            let mut digest = shared.observer(bus);
            let seen = Arc::clone(&frames);
            let observer: Observer = Box::new(move |frame| {
                digest(frame);
                seen.lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .push(*frame);
            });
            Some(observer)
        });
        let simulated = Simulated::new(&machine, 0, observers, |drive, config| {
            config.seed = drive as u64 + 1;
            configure(drive, config);
        });
        let Simulated {
            world,
            buses,
            devices,
        } = simulated.expect("a bit rate that can be simulated");
        let port = |bus: Option<BusId>| TappedPort {
            port: SimPort::new(bus.expect("it is simulated")),
            drop_bursts: 0,
            delay_bursts: 0,
            tear_bursts: 0,
            unplugged: false,
            condition: None,
            doctor: None,
            forger: None,
            late: Vec::new(),
        };
        let ports: Vec<TappedPort> = buses.into_iter().map(port).collect();
        let observers = Observers::new(&machine, Some(sent), None, false);
        let layouts = Arc::clone(&layout);
        let mut session = match program {
            Some(text) => {
                let program = programs.file(&folder.file("program.ngc", text));
                let (timeline, moves) = VirtualMachine::on(world, ports, layouts, program, shared);
                Session::new(&layout, timeline, moves, observers)
            }
            None => {
                let timeline = VirtualMachine::staying_on(world, ports, layouts, shared);
                let programs = programs.keep_tables(Tables::beside(&file));
                Session::staying_on(&layout, timeline, programs, observers)
            }
        };
        Self {
            operator: session.operator("rig"),
            passes_stops: PassesStops::new(session.operator("rig")),
            told: session.subscribe(),
            session,
            twins: devices.into_iter().flatten().collect(),
            machine,
            layout,
            events: Vec::new(),
            states: Vec::new(),
            refused: Vec::new(),
            problems: Vec::new(),
            recorded: Vec::new(),
            messages: Vec::new(),
            rows: Vec::new(),
            switches: Vec::new(),
            phases: Vec::new(),
            frames,
            goes_on: true,
            steps: 0,
            folder,
        }
    }

    /// The first bus, to interfere with it.
    pub fn bus(&mut self) -> &mut TappedPort {
        self.bus_at(0)
    }

    /// A bus by its place in the machine file.
    pub fn bus_at(&mut self, bus: usize) -> &mut TappedPort {
        self.session.timeline().bus(bus)
    }

    /// Somebody else puts a frame on a bus, by its place in the machine file.
    pub fn intrude(&mut self, bus: usize, frame: Frame) {
        let wire = self
            .bus_at(bus)
            .simulated()
            .expect("its buses are simulated");
        self.session.timeline().world().intrude(wire, frame);
    }

    /// The drive at that place in the machine file, behind all drives the encoder, to interfere with it.
    pub fn twin(&mut self, drive: usize) -> &mut dyn SimulatedDevice {
        let twin = self.twins[drive];
        self.session.timeline().world().device_mut(twin)
    }

    /// The coupling of an encoder, by its place among them, slips by so many revolutions of it.
    pub fn slip(&mut self, encoder: usize, by: f64) {
        let twin = self.twins[self.machine.drives.len() + encoder];
        self.session.timeline().world().slip(twin, by);
    }

    /// The coupling of an encoder, by its place among them, breaks.
    pub fn part(&mut self, encoder: usize) {
        let twin = self.twins[self.machine.drives.len() + encoder];
        self.session.timeline().world().part(twin);
    }

    /// The same as what it is, for what only its model has.
    ///
    /// # Panics
    /// If it is another model's twin.
    pub fn twin_as<T: SimulatedDevice>(&mut self, drive: usize) -> &mut T {
        let twin: &mut dyn Any = self.twin(drive);
        twin.downcast_mut().expect("a twin of that type")
    }

    /// The controller.
    pub fn controller(&mut self) -> &mut Controller<COORDINATES> {
        self.session.timeline().controller()
    }

    /// One wake-up; false at the end. Program stops go on at once.
    ///
    /// # Panics
    /// If the run does not come to an end.
    pub fn step(&mut self) -> bool {
        self.steps += 1;
        assert!(self.steps < MOST_STEPS, "no end: {:?}", self.phases.last());
        let goes_on = self.session.advance() != Progress::Ended;
        let now = self.session.timeline().now();
        for event in self.told.events() {
            if self.goes_on {
                self.passes_stops.hear(&event).expect("there is room");
            }
            let event = match event {
                session::Event::Machine(event) => event,
                session::Event::Refused(refused) => {
                    self.refused.push(refused);
                    continue;
                }
                session::Event::State(state) => {
                    self.states.push(state);
                    continue;
                }
                session::Event::Problem(problem) => {
                    self.problems.push(told(&*problem));
                    continue;
                }
                session::Event::Message { line, text } => {
                    self.messages.push((line, text));
                    continue;
                }
                session::Event::Recorded(files) => {
                    self.recorded.push(files);
                    continue;
                }
                session::Event::Accepted(_) => continue,
            };
            match event {
                Event::Switched { switch, .. } if switch != Switch::Message => {
                    self.switches.push(switch);
                }
                Event::Phase(phase) => self.phases.push((phase, now)),
                _ => {}
            }
            self.events.push(event);
        }
        self.rows.extend(self.session.timeline().row().copied());
        goes_on
    }

    /// Commands something.
    ///
    /// # Panics
    /// If too much was commanded since the last wake-up.
    pub fn command(&mut self, command: Command) {
        self.operator.command(command).expect("there is room");
    }

    /// Goes on until something is so.
    ///
    /// # Panics
    /// If the run ends before.
    pub fn run_until(&mut self, mut is_so: impl FnMut(&mut Self) -> bool) {
        while !is_so(self) {
            assert!(self.step(), "ended before: {:?}", self.end());
        }
    }

    /// Goes on until a phase is entered.
    pub fn run_to(&mut self, phase: Phase) {
        self.run_until(|rig| rig.controller().phase() == phase);
    }

    /// Goes on until that row of the program.
    pub fn run_to_row(&mut self, row: usize) {
        self.run_until(|rig| rig.rows.len() > row);
    }

    /// Goes on to the end.
    ///
    /// # Panics
    /// If it comes to none.
    pub fn finish(&mut self) -> End {
        while self.step() {}
        self.end().expect("an end")
    }

    /// Goes on to the end, which has to be a fault.
    ///
    /// # Panics
    /// If it is none.
    pub fn finish_with_fault(&mut self) -> Fault {
        match self.finish() {
            End::Fault(fault) => fault,
            end => panic!("no fault: {end:?}"),
        }
    }

    /// Goes on to the end; the verdict.
    ///
    /// # Panics
    /// If it comes to none.
    #[must_use]
    pub fn judge(mut self) -> Summary {
        self.finish();
        let (mut timeline, observers) = self.session.end();
        let frames = Some(timeline.frames().result());
        let judged = observers.finish(&self.machine, &self.layout, timeline.controller(), frames);
        judged.expect("there is no trace to write").0
    }

    /// How the run ends, once that is decided.
    pub fn end(&mut self) -> Option<End> {
        self.controller().end()
    }

    /// The trace so far. An axis that was quick-stopped follows no setpoint: its are those of the plan, which
    /// ends where all were.
    #[must_use]
    pub fn trace(&self) -> Trace {
        let mut axes = trace::axes(&self.machine);
        let specs = &self.layout.axes;
        let planned = |row: &&Row<COORDINATES>| {
            let mut axes = specs.iter().map(|axis| row.axes[axis.coordinate]);
            axes.any(|axis| !axis.by_itself)
        };
        let rows: Vec<_> = self.rows.iter().filter(planned).collect();
        for (trace, axis) in axes.iter_mut().zip(specs) {
            let at = axis.coordinate;
            let delay = self.layout.devices[axis.drives[0]].delay;
            let (whole, part) = (delay as usize, delay.fract());
            // As it would be sent it: where its drive is faster than others, later.
            let plan = |row: usize| {
                let plan = |behind| rows[row.saturating_sub(behind)].plan.position[at];
                plan(whole + 1) + (1.0 - part) * (plan(whole) - plan(whole + 1))
            };
            let set = |(place, row): (usize, &&Row<COORDINATES>)| match row.axes[at].by_itself {
                true => plan(place),
                false => row.axes[at].set,
            };
            trace.set = rows.iter().enumerate().map(set).collect();
            trace.act = rows.iter().map(|row| row.axes[at].act).collect();
        }
        Trace {
            cycle: self.machine.cycle.as_secs_f64(),
            line: vec![0; rows.len()],
            cut_off: rows.len() < self.rows.len(),
            axes,
        }
    }

    /// Whether the last setpoint of the program is at rest.
    #[must_use]
    pub fn ends_at_rest(&self) -> bool {
        let last = self.rows.last().map(|row| row.plan);
        last.is_none_or(|plan| plan.velocity == [0.0; COORDINATES])
    }

    /// All frames so far, in the order in which the buses ended them.
    #[must_use]
    pub fn frames(&self) -> Vec<Transmission> {
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        frames.clone()
    }

    /// The controller's frames so far with that identifier.
    #[must_use]
    pub fn sent(&self, id: impl Into<CanId>) -> Vec<Transmission> {
        let id = id.into();
        let mut frames = self.frames();
        frames.retain(|it| it.sender == Sender::Port && it.frame.id() == id);
        frames
    }

    /// What a drive was commanded in each R_PDO2: when, controlword, setpoint.
    #[must_use]
    pub fn commands(&self, drive: usize) -> Vec<(Instant, u16, i32)> {
        let frames = self.sent(CobId::r_pdo(2, self.machine.drives[drive].node));
        let command = |it: &Transmission| match *it.frame.data() {
            [c0, c1, p0, p1, p2, p3] => (
                it.start,
                u16::from_le_bytes([c0, c1]),
                i32::from_le_bytes([p0, p1, p2, p3]),
            ),
            ref data => panic!("an R_PDO2 of {} bytes", data.len()),
        };
        frames.iter().map(command).collect()
    }

    /// When SYNC was sent.
    #[must_use]
    pub fn syncs(&self) -> Vec<Instant> {
        let frames = self.sent(CobId::SYNC);
        frames.iter().map(|it| it.start).collect()
    }
}

/// The machine file of an example, for tests that want nothing changed.
#[must_use]
pub fn example(name: &str) -> Machine {
    Machine::load(&machine_file(name)).expect("a good example")
}
