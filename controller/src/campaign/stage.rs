//! Where a case is played: the controller of `validate`, a session with its operators, simulated drives,
//! and everything that can be seen of them handed on in its order.

use super::case::Case;
use super::interference::{Interference, Trouble, TroubledPort};
use super::operator::{Attendant, Deed, OPERATORS};
use crate::bus_log::BusLog;
use crate::control::{Layout, Phase, State};
use crate::machine::Machine;
use crate::observe::Observers;
use crate::observe::frames::{SharedFrames, VIRTUAL_ORIGIN};
use crate::observe::record::Report;
use crate::observe::summary::Summary;
use crate::observe::trace::Sink;
use crate::port::sim::{SimPort, Simulated};
use crate::program::Programs;
use crate::run::Progress;
use crate::run::virtual_time::VirtualMachine;
use crate::session::{self, Command, Operator, Session, Subscription};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::{env, fs, io, process};
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;
use syncline_drives::bus::Transmission;
use syncline_drives::model::Increments;
use syncline_drives::twin::Observation;
use syncline_drives::world::{DeviceId, Observer, World};
use syncline_gcode::AxisLetter;

/// A machine that is not ready after so long is switched off, and so is one that comes up and down.
const NOT_READY: Duration = Duration::from_secs(20);

/// Who brings an axis in place by hand leaves it so much of its travel inside of its soft limits, and bothers with a gantry whose
/// sides are off their middle by so much of what they may be apart.
const INSIDE: f64 = 0.01;
const ALIGNED: f64 = 0.25;

/// How long a machine may take to go off, with drives that answer nothing.
const GOES_OFF: Duration = Duration::from_secs(60);

/// What can be seen of a case as it is played.
#[derive(Clone, Debug)]
pub enum Seen {
    /// A bus has carried a frame.
    Frame {
        /// Which bus.
        bus: usize,
        /// When, whose and what.
        sent: Transmission,
    },
    /// Something happens from outside, before the next wake-up.
    Interfered(Interference),
    /// An operator commands something, before the next wake-up.
    Commanded(Command),
    /// The session tells something.
    Told(session::Event),
    /// A wake-up is over.
    Woken(Woken),
}

/// How things are after a wake-up.
#[derive(Clone, Debug)]
pub struct Woken {
    /// Virtual time.
    pub now: Instant,
    /// The controller's cycle.
    pub cycle: u64,
    /// As operators have it.
    pub state: State,
    /// Where the controller is.
    pub phase: Phase,
    /// By drive: what is true of it.
    pub plants: Vec<Observation>,
    /// By device: the levels of its digital outputs, one bit each.
    pub outputs: Vec<u16>,
    /// By axis: where operators are shown that it is, mm.
    pub shown: Vec<f64>,
    /// By axis: where operators are shown that it is sent, mm.
    pub commanded: Vec<f64>,
    /// Operators are shown that the axes are off the path.
    pub off_path: bool,
}

/// What is left of a case that was played to its end.
#[derive(Debug)]
pub struct Played {
    /// Digest of all frames.
    pub frames: String,
    /// The observers' own verdict.
    pub summary: Summary,
    /// Every row, if it was asked for.
    pub report: Option<Report>,
    /// From switching on to off, s.
    pub seconds: f64,
    /// It went off by itself.
    pub ended: bool,
}

/// What a case is to leave besides.
#[derive(Default)]
pub struct Wanted {
    /// Every row as CSV.
    pub trace: Option<Sink>,
    /// Every row for a report.
    pub report: bool,
    /// Every frame.
    pub log: Option<BusLog>,
}

/// A folder for the programs of a case, gone with it.
struct Folder(PathBuf);

impl Folder {
    fn new() -> io::Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("syncline-campaign-{}-{number}", process::id());
        let path = env::temp_dir().join(name);
        fs::create_dir_all(&path)?;
        Ok(Self(path))
    }

    fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed stays for the system to remove.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Takes what is due out of what is to come. What waits for an instant since switching on holds up nothing
/// that waits for one since the machine was ready.
fn due<T: Copy>(to_come: &mut Vec<T>, is_due: impl Fn(&T) -> bool) -> Vec<T> {
    to_come.extract_if(.., |it| is_due(it)).collect()
}

type Frames = Arc<Mutex<Vec<(usize, Transmission)>>>;

/// A case that is being played.
struct Stage<'a> {
    case: &'a Case,
    machine: &'a Machine,
    folder: Folder,
    session: Session<VirtualMachine<TroubledPort>>,
    operators: Vec<Operator>,
    attendant: Option<(Attendant, Operator)>,
    told: Subscription,
    frames: Frames,
    /// By device of the machine, the drives first.
    twins: Vec<DeviceId>,
    /// What came last, so that buffers are used again.
    carried: Vec<(usize, Transmission)>,
    /// The cycle in which the machine was ready first.
    ready: Option<u64>,
    /// What is to come, in its order.
    deeds: Vec<&'a Deed>,
    troubles: Vec<&'a Trouble>,
    switched_off: bool,
}

/// Plays a case to its end and shows what is to be seen of it.
///
/// # Errors
/// The machine of the case is none, or files cannot be written.
pub fn play(
    case: &Case,
    machine: &Machine,
    wanted: Wanted,
    see: &mut dyn FnMut(Seen),
) -> Result<Played, Box<dyn Error>> {
    let layout = Arc::new(Layout::new(machine)?);
    let report = wanted.report;
    let mut stage = Stage::new(case, machine, &layout, wanted)?;
    let mut ended = false;
    while !ended && stage.session.timeline().now() < stage.latest() {
        ended = !stage.step(see);
    }
    let seconds = stage.session.timeline().now().as_nanos() as f64 * 1e-9;
    let (mut timeline, observers) = stage.session.end();
    timeline.frames().finish_log()?;
    let carried = Some(timeline.frames().result());
    let frames = carried.as_ref().map_or_else(String::new, |it| it.0.clone());
    let (summary, rows) = observers.finish(machine, &layout, timeline.controller(), carried)?;
    Ok(Played {
        frames,
        summary,
        report: rows.filter(|_| report),
        seconds,
        ended,
    })
}

impl<'a> Stage<'a> {
    fn new(
        case: &'a Case,
        machine: &'a Machine,
        layout: &Arc<Layout>,
        wanted: Wanted,
    ) -> Result<Self, Box<dyn Error>> {
        let folder = Folder::new()?;
        for (number, lines) in case.programs.iter().enumerate() {
            fs::write(
                folder.path(format!("{number}.ngc")),
                lines.join("\n") + "\n",
            )?;
        }
        let shared = SharedFrames::new(machine);
        let sent = shared.listen(machine);
        if let Some(log) = wanted.log {
            shared.write_to(log, VIRTUAL_ORIGIN);
        }
        let frames = Frames::default();
        let observers = (0..machine.buses.len()).map(|bus| {
            let (mut digest, frames) = (shared.observer(bus), Arc::clone(&frames));
            Some(Box::new(move |sent: &Transmission| {
                digest(sent);
                let mut frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
                frames.push((bus, *sent));
            }) as Observer)
        });
        let simulated = Simulated::new(machine, case.seed, observers, |_, _| ())?;
        let ports = simulated.buses.iter().flatten();
        let ports = ports.map(|bus| TroubledPort::new(SimPort::new(*bus)));
        let world = simulated.world;
        let timeline =
            VirtualMachine::staying_on(world, ports.collect(), Arc::clone(layout), shared);
        // Nothing is written to the tables: a case begins with what it is alone.
        let programs = Programs::new(machine, &folder.path("machine.toml"))?;
        let observers =
            Observers::new(machine, Some(sent), wanted.trace, wanted.report).seeing_drives(machine);
        let mut session = Session::staying_on(layout, timeline, programs, observers);
        let told = session.subscribe();
        let attendant = case.patience.map(|patience| {
            let attendant =
                Attendant::new(patience, case.leave, &case.machine, case.programs.len());
            (attendant, session.operator("attendant"))
        });
        Ok(Self {
            operators: (1..=OPERATORS)
                .map(|number| session.operator(&format!("operator {number}")))
                .collect(),
            attendant,
            told,
            session,
            case,
            machine,
            folder,
            frames,
            twins: simulated.devices.into_iter().flatten().collect(),
            carried: Vec::new(),
            ready: None,
            deeds: case.deeds.iter().collect(),
            troubles: case.troubles.iter().collect(),
            switched_off: false,
        })
    }

    /// When it has to be off.
    fn latest(&self) -> Instant {
        let cycle = Duration::from_micros(self.case.machine.cycle_us.into());
        Instant::ZERO + NOT_READY + cycle * self.case.cycles + GOES_OFF
    }

    /// One wake-up with what comes before and behind it; false at the end.
    fn step(&mut self, see: &mut dyn FnMut(Seen)) -> bool {
        self.command(see);
        self.interfere(see);
        let goes_on = self.session.advance() != Progress::Ended;
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::swap(&mut *frames, &mut self.carried);
        drop(frames);
        for (bus, sent) in self.carried.drain(..) {
            see(Seen::Frame { bus, sent });
        }
        for event in self.told.events() {
            see(Seen::Told(event));
        }
        let woken = self.look();
        if woken.state == State::Ready {
            self.ready.get_or_insert(woken.cycle);
        }
        see(Seen::Woken(woken));
        goes_on
    }

    fn look(&mut self) -> Woken {
        let status = self.session.status();
        let axes = self.case.machine.axes.iter();
        let letters = axes.filter_map(|axis| AxisLetter::from_letter(axis.letter));
        let coordinates: Vec<usize> = letters.map(AxisLetter::index).collect();
        let of = |all: &[f64]| coordinates.iter().map(|it| all[*it]).collect();
        let (state, shown, commanded) = (status.state, of(&status.actual), of(&status.setpoint));
        let off_path = status.off_path;
        let timeline = self.session.timeline();
        let now = timeline.now();
        let world = timeline.world();
        let drives = self.twins.iter().take(self.case.machine.drives());
        let plants = drives.map(|twin| world.device(*twin).observe());
        let plants = plants.collect();
        let outputs = self.twins.iter();
        let outputs = outputs.map(|twin| world.device(*twin).outputs()).collect();
        let controller = timeline.controller();
        Woken {
            now,
            cycle: controller.cycle(),
            state,
            phase: controller.phase(),
            plants,
            outputs,
            shown,
            commanded,
            off_path,
        }
    }

    /// What operators command before the next wake-up.
    fn command(&mut self, see: &mut dyn FnMut(Seen)) {
        let status = self.session.status();
        let (state, referenced) = (status.state, status.referenced);
        if self.switched_off {
            return;
        }
        let (on, since) = self.cycles();
        let over = since.is_some_and(|since| since >= self.case.cycles.into());
        let too_late = self.session.timeline().now() - Instant::ZERO > NOT_READY;
        if over || self.ready.is_none() && too_late {
            self.switched_off = true;
            self.issue(0, Command::SwitchOff, see);
            return;
        }
        for deed in due(&mut self.deeds, |deed| deed.at.has_come(on, since)) {
            self.issue(deed.operator, deed.command.clone(), see);
        }
        if let Some((attendant, _)) = &mut self.attendant {
            for command in attendant.attend(state, &referenced) {
                self.issue(usize::MAX, command, see);
            }
        }
    }

    /// Cycles since switching on, and since the machine was ready.
    fn cycles(&mut self) -> (u64, Option<u64>) {
        let cycle = self.session.timeline().controller().cycle();
        (cycle, self.ready.map(|ready| cycle - ready))
    }

    fn issue(&mut self, operator: usize, command: Command, see: &mut dyn FnMut(Seen)) {
        let command = match command {
            Command::Load(file) => Command::Load(self.folder.path(file)),
            other => other,
        };
        let operator = match (self.operators.get(operator), &self.attendant) {
            (Some(operator), _) | (None, Some((_, operator))) => operator,
            (None, None) => return,
        };
        // Of the stops that come at once one is as good as all of them, and no crowd of others is that large.
        if operator.command(command.clone()).is_ok() {
            see(Seen::Commanded(command));
        }
    }

    /// Brings an axis to where it may be enabled, if it is not there and its drives are off; whether that was so.
    fn align(&mut self, axis: usize) -> bool {
        let Some(spec) = self.machine.axes.get(axis) else {
            return false;
        };
        let status = self.session.status();
        let shown = status.actual[spec.letter.index()];
        let (least, most) = spec.limits.position;
        let inset = INSIDE * (most - least);
        let world = self.session.timeline().world();
        let sides = spec.drives.iter().map(|&drive| {
            let scaling = &self.machine.drives[drive].scaling;
            let travel = scaling.travel_per_revolution();
            let twin = *self.twins.get(drive)?;
            let is = world.device(twin).observe();
            let place = scaling.to_mm(Increments::ZERO) + is.position * travel;
            (!is.is_powered).then_some((twin, place, travel))
        });
        let Some(sides) = sides.collect::<Option<Vec<_>>>() else {
            return false;
        };
        let middle = sides.iter().map(|(_, place, _)| place).sum::<f64>() / sides.len() as f64;
        let inside = match shown.is_finite() && !(least..=most).contains(&shown) {
            true => shown.clamp(least + inset, most - inset) - shown,
            false => 0.0,
        };
        let mut moved = false;
        for (twin, place, travel) in sides {
            let by = inside + middle - place;
            if by.abs() > spec.limits.skew.map_or(0.0, |skew| ALIGNED * skew) {
                world.displace(twin, by / travel);
                moved = true;
            }
        }
        moved
    }

    /// Does something to a device, if the machine has so many.
    fn act_on(&mut self, device: usize, act: impl FnOnce(&mut World, DeviceId)) {
        if let Some(twin) = self.twins.get(device) {
            act(self.session.timeline().world(), *twin);
        }
    }

    /// What goes wrong before the next wake-up.
    fn interfere(&mut self, see: &mut dyn FnMut(Seen)) {
        let (on, since) = self.cycles();
        for trouble in due(&mut self.troubles, |trouble| trouble.at.has_come(on, since)) {
            match &trouble.what {
                Interference::Drive(device, what) => self.act_on(*device, |world, twin| {
                    world.device_mut(twin).disturb(what.disturbance());
                }),
                Interference::Slip(device, by) => {
                    self.act_on(*device, |world, twin| world.slip(twin, *by));
                }
                Interference::Part(device) => self.act_on(*device, World::part),
                Interference::Join(device) => self.act_on(*device, World::join),
                Interference::Align(axis) => {
                    if !self.align(*axis) {
                        continue;
                    }
                }
                Interference::Mended => {
                    for bus in 0..self.case.machine.buses.len() {
                        self.session.timeline().bus(bus).mend();
                    }
                }
                Interference::Bus(bus, what) => {
                    if *bus < self.case.machine.buses.len() {
                        self.session.timeline().bus(*bus).trouble(*what);
                    }
                }
                Interference::Late(micros) => {
                    let late = Duration::from_micros((*micros).into());
                    self.session.timeline().wake_late(late);
                }
                Interference::StarvePlanner(wake_ups) => {
                    self.session.timeline().starve_planner(*wake_ups);
                }
            }
            see(Seen::Interfered(trouble.what.clone()));
        }
    }
}
