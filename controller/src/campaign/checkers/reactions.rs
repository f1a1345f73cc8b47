//! What is done about each fault is what `docs/supervision.md` states, commanded in time, and each is told once, the
//! one that showed first first: from controlwords, statuswords and what the session told.
//!
//! The table is this checker's own copy of the page. A reaction is looked for in the controlwords: a quick stop is
//! 000Bh, and a drive that comes to rest on the path is told to follow until its setpoints rest. That a machine may not be
//! enabled, and that a device is silent whatever else happens, or was taken out of Operational, is known from what happened.

use super::super::interference::{Interference, ToBus, ToDrive};
use super::super::machine::Wire;
use super::scene::FOLLOWS;
use super::{Checker, Found, Scene};
use crate::control::fault::{AxisCause, BlockCause, BusCause, DeviceCause, SpindleCause};
use crate::control::{self, Fault, State};
use crate::machine::Machine;
use crate::session::{Command, Event};
use syncline_canopen::{CanId, Instant, nmt};
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::model::PowerState;

const NAME: &str = "reactions";

/// Low bits of a controlword with which a drive makes a quick stop (CiA 402).
const QUICK_STOP: u16 = 0x0B;

/// R_PDOs from where a cause shows, or is told, until its reaction is commanded.
const IN_TIME: u32 = 2;
/// The same where bursts were lost or late.
const IN_TIME_LATE: u32 = 5;
/// SYNCs without an answer, to them or to what is asked, beyond those that are allowed until something is done.
pub(super) const SILENT: u32 = 3;

/// Cycles in which an enable that went off stops the machine: an I/O node tells its inputs once in a cycle.
const DISABLES: f64 = 6.0;
/// How much later than its heartbeat is missing a silent device is noticed at the most, s.
const NOTICED: f64 = 0.1;

/// A column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Reaction {
    Disable,
    OnPath,
    QuickStopAxis,
    QuickStopAll,
}

/// A row of the table: what it is called here, and what is done.
type Row = (&'static str, Reaction);

/// Whom a fault concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Subject {
    Device(usize),
    Axis(usize),
    Bus(usize),
    Machine,
}

/// The table.
fn row(fault: &Fault) -> (Subject, Row) {
    use Reaction::{Disable, OnPath, QuickStopAll, QuickStopAxis};
    match fault {
        Fault::Device(device, cause) => {
            let row = match cause {
                DeviceCause::Emergency { .. } | DeviceCause::Reported { .. } => {
                    ("an error of a drive", QuickStopAxis)
                }
                DeviceCause::NotFollowing { .. } => ("a drive no longer enabled", QuickStopAxis),
                DeviceCause::PositionRange => ("beyond what a drive can count", QuickStopAxis),
                DeviceCause::SdoTimeout { .. }
                | DeviceCause::SecondTPdo
                | DeviceCause::TwoNodes
                | DeviceCause::HeartbeatLost
                | DeviceCause::GuardingUnanswered
                | DeviceCause::PollUnanswered { .. }
                | DeviceCause::NoNmtState
                | DeviceCause::UnknownNmtState { .. }
                | DeviceCause::NmtState { .. }
                | DeviceCause::Rebooted
                | DeviceCause::MissingTPdo { .. } => ("a device that is silent", QuickStopAxis),
                _ => ("a drive that does not come up or go off", Disable),
            };
            (Subject::Device(*device), row)
        }
        Fault::Axis(_, AxisCause::Unreferenced | AxisCause::Homing(_)) => {
            (Subject::Machine, ("unreferenced", OnPath))
        }
        Fault::Axis(axis, cause) => {
            let row = match cause {
                AxisCause::Skew { .. } => ("skew", QuickStopAll),
                AxisCause::SetpointGuard { .. } => ("a setpoint beyond limits", QuickStopAll),
                AxisCause::FeedbackDifference { .. } | AxisCause::ReferenceMoved { .. } => {
                    ("an encoder that disagrees", OnPath)
                }
                AxisCause::Jump { .. } => ("a jump", QuickStopAxis),
                AxisCause::LimitSwitch { .. } => ("a limit switch", QuickStopAxis),
                AxisCause::OutsideSoftLimits { .. } | AxisCause::Standstill { .. } => {
                    ("an axis not where it should be", Disable)
                }
                _ => ("following error", QuickStopAxis),
            };
            (Subject::Axis(*axis), row)
        }
        Fault::Bus(bus, cause) => {
            let row = match cause {
                BusCause::Failed => ("a bus that is lost", QuickStopAxis),
                BusCause::ErrorPassive => ("error passive", OnPath),
                BusCause::LateSetpoints { .. } | BusCause::TornBurst => ("late setpoints", OnPath),
                _ => ("a second controller", OnPath),
            };
            (Subject::Bus(*bus), row)
        }
        Fault::NotEnabled { .. } => (Subject::Machine, ("external enable off", QuickStopAll)),
        Fault::LateWakeUp { .. } => (Subject::Machine, ("late wake-up", OnPath)),
        Fault::NoPlan => (Subject::Machine, ("no plan", OnPath)),
        Fault::Program => (Subject::Machine, ("program", OnPath)),
        Fault::Block(_, BlockCause::Thread(_)) => (Subject::Machine, ("thread", OnPath)),
        Fault::Spindle(SpindleCause::Speed { .. }) => {
            (Subject::Machine, ("a spindle off its speed", OnPath))
        }
        Fault::Spindle(SpindleCause::Angle { .. }) => {
            (Subject::Machine, ("a spindle off its angle", OnPath))
        }
        Fault::Block(_, BlockCause::Probing(_)) | Fault::Touched | Fault::Pressed => {
            (Subject::Machine, ("probing", OnPath))
        }
    }
}

/// What is looked for in the controlwords of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaited {
    /// It follows until its setpoints rest.
    RestsFirst,
    /// It no longer follows.
    Leaves,
    /// It makes a quick stop before anything else.
    QuickStop,
}

/// See the module.
pub(super) struct Reactions {
    drives: Vec<Watched>,
    /// Faults since the machine was reset.
    told: Vec<(Subject, Row)>,
    /// The machine's state at the last wake-up.
    state: State,
    /// Inputs by which the machine may not be enabled, device and place, and since when.
    forbids: Vec<((usize, u8), Instant)>,
    /// Devices of which nothing reaches the bus, whatever they are told, and since when.
    mute: Vec<(usize, Instant)>,
    /// Devices that were taken out of Operational, and since when.
    away: Vec<(usize, Instant)>,
    /// By how much wake-ups were late, s.
    late: f64,
    /// A stranger's frames may have been taken for a device's.
    is_feigned: bool,
}

/// A drive.
#[derive(Clone, Debug, Default)]
struct Watched {
    awaited: Option<(Awaited, &'static str)>,
    /// R_PDOs since.
    frames: u32,
    /// It said that it follows, when it was heard last.
    followed: bool,
    /// Since when something shows, and how many R_PDOs it was sent since while nothing was done.
    shows: Option<(Instant, u32)>,
    /// SYNCs without a T_PDO.
    silent: u32,
    /// It was taken off the path while it moved, for a fault: right if another one is told in the same wake-up.
    left: Option<&'static str>,
}

/// Axes may move, and every drive follows its setpoints.
pub(super) fn is_up(state: State) -> bool {
    use State::{Held, Homing, Jogging, Mdi, Ready, Running};
    matches!(state, Ready | Homing | Jogging | Mdi | Running | Held)
}

/// Whether an NMT command takes a device out of Operational for good.
fn takes_down(command: u8) -> bool {
    let stops = [nmt::Command::Stop, nmt::Command::EnterPreOperational];
    stops.map(|it| it as u8).contains(&command)
}

impl Reactions {
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            drives: vec![Watched::default(); machine.drives.len()],
            told: Vec::new(),
            state: State::Starting,
            forbids: Vec::new(),
            mute: Vec::new(),
            away: Vec::new(),
            late: 0.0,
            is_feigned: false,
        }
    }

    /// What shows in no drive, and nothing is done about while axes may move.
    fn overlooked(&self, scene: &Scene<'_>, found: &mut Found) {
        if !is_up(scene.state) || scene.faulted {
            return;
        }
        let up = scene.since(scene.state_since);
        let lasts = |since: Instant| scene.since(since).min(up);
        let forbids = |(_, since): &&((usize, u8), Instant)| {
            lasts(*since) > DISABLES * scene.period() && scene.bursts_are_on_time()
        };
        if let Some(((device, place), since)) = self.forbids.iter().find(forbids) {
            let what = "nothing is done about an enable that is off";
            found.violate(NAME, scene, what, || {
                let since = scene.since(*since);
                format!("input {place} of device {device}, {since} s after it went off")
            });
        }
        let heartbeat = scene.machine.controller.heartbeat_timeout.as_secs_f64();
        let late = heartbeat + NOTICED + f64::from(SILENT) * scene.period() + self.late;
        let silent = |(_, since): &&(usize, Instant)| lasts(*since) > late && !self.is_feigned;
        let mut all = self.mute.iter().chain(&self.away);
        if let Some((device, since)) = all.find(silent) {
            let what = "nothing is done about a silent device";
            found.violate(NAME, scene, what, || {
                format!("device {device}, silent for {} s", scene.since(*since))
            });
        }
    }

    /// The controller starts or resets a device: it begins anew, if it can be heard.
    fn begins_anew(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission) {
        let &[command, node] = sent.frame.data() else {
            return;
        };
        let is_nmt = sent.frame.id() == CanId::Standard(0) && sent.sender == Sender::Port;
        if is_nmt && !takes_down(command) {
            let mut nodes = scene.case.machine.nodes();
            let device = nodes.position(|it| it == (bus, node));
            self.away.retain(|(it, _)| Some(*it) != device);
        }
    }

    /// Something happens to the devices of a bus.
    fn bus(&mut self, scene: &Scene<'_>, bus: usize, what: ToBus) {
        match what {
            ToBus::Nmt(command, to) => {
                for (device, (of, node)) in scene.case.machine.nodes().enumerate() {
                    if of == bus && (to == 0 || to == node) && !scene.is_polled(device) {
                        self.away.retain(|(it, _)| *it != device);
                        self.away
                            .extend(takes_down(command).then_some((device, scene.now)));
                    }
                }
            }
            ToBus::Intruder(..) | ToBus::SecondNode(..) => self.is_feigned = true,
            _ => {}
        }
    }

    fn fault(&mut self, scene: &Scene<'_>, fault: &Fault, found: &mut Found) {
        let (subject, row) = row(fault);
        if self.told.contains(&(subject, row)) {
            found.violate(NAME, scene, "a fault is told again", || {
                format!("{fault:?}, after {:?}", self.told)
            });
        }
        let is_first = self.told.is_empty();
        self.told.push((subject, row));
        if is_first {
            self.is_first(scene, fault, subject, found);
        }
        let machine = scene.machine;
        let concerns = |drive: usize| match subject {
            Subject::Device(device) => device == drive,
            Subject::Axis(axis) => machine.drives[drive].axis == axis,
            Subject::Bus(bus) => machine.drives[drive].bus == bus,
            Subject::Machine => false,
        };
        let (name, reaction) = row;
        let paired = |drive: usize| machine.axes[machine.drives[drive].axis].drives.len() > 1;
        let all = match reaction {
            Reaction::QuickStopAll => true,
            Reaction::QuickStopAxis => {
                let mut drives = 0..self.drives.len();
                machine.controller.stop_together || drives.any(|it| concerns(it) && paired(it))
            }
            Reaction::OnPath | Reaction::Disable => false,
        };
        for (drive, watched) in self.drives.iter_mut().enumerate() {
            let quick = all || reaction == Reaction::QuickStopAxis && concerns(drive);
            if quick {
                watched.left = None;
                (watched.awaited).take_if(|(awaited, _)| *awaited == Awaited::RestsFirst);
            }
            if !is_up(self.state) {
                continue;
            }
            let told = scene.drives[drive].controlword;
            let awaited = match (quick, told.map(|word| word & FOLLOWS)) {
                (_, Some(word)) if word != FOLLOWS => continue,
                (true, _) if scene.drives[drive].follows() => Awaited::QuickStop,
                (true, _) => Awaited::Leaves,
                (false, _) if reaction == Reaction::Disable => continue,
                (false, _) => Awaited::RestsFirst,
            };
            let known = watched
                .awaited
                .is_some_and(|(known, _)| known != Awaited::RestsFirst);
            if !known {
                watched.awaited = Some((awaited, name));
                watched.frames = 0;
            }
        }
    }

    /// What showed first is told first.
    fn is_first(&self, scene: &Scene<'_>, fault: &Fault, subject: Subject, found: &mut Found) {
        let since = |drive: usize| self.drives[drive].shows.map(|(since, _)| since);
        let drives = 0..self.drives.len();
        let first = drives
            .filter_map(|drive| Some((since(drive)?, drive)))
            .min();
        let told = match subject {
            Subject::Device(device) if device < self.drives.len() => Some(device),
            Subject::Axis(axis) => scene.machine.axes[axis].drives.first().copied(),
            _ => None,
        };
        let (Some((first, drive)), Some(told), true) = (first, told, scene.buses_are_sound())
        else {
            return;
        };
        let same = scene.machine.drives[drive].axis == scene.machine.drives[told].axis;
        let later = since(told).is_none_or(|since| {
            let apart = since.saturating_since(first).as_nanos();
            apart > scene.machine.cycle.as_nanos()
        });
        if !same && later {
            found.violate(NAME, scene, "another fault is told first", || {
                let name = &scene.machine.drives[drive].name;
                format!(
                    "{fault:?}; drive {name} showed something {} s before",
                    scene.since(first)
                )
            });
        }
    }

    /// A controlword came.
    fn commanded(&mut self, scene: &Scene<'_>, drive: usize, word: u16, found: &mut Found) {
        let watched = &mut self.drives[drive];
        let in_time = match scene.buses_are_sound() {
            true => IN_TIME,
            false => IN_TIME_LATE,
        };
        let name = &scene.machine.drives[drive].name;
        let follows = word & FOLLOWS == FOLLOWS;
        if let Some((since, frames)) = &mut watched.shows {
            *frames += 1;
            let (since, frames) = (*since, *frames);
            if !follows || !is_up(self.state) {
                watched.shows = None;
            } else if frames >= in_time && scene.is_told_all() {
                watched.shows = None;
                found.violate(
                    NAME,
                    scene,
                    "nothing is done in time about what shows",
                    || format!("drive {name}, {} s after it showed", scene.since(since)),
                );
            }
        }
        let Some((awaited, fault)) = watched.awaited else {
            return;
        };
        watched.frames += 1;
        let frames = watched.frames;
        let wrong = match awaited {
            Awaited::RestsFirst if !follows && scene.drives[drive].moves => {
                watched.left = Some(fault);
                None
            }
            // What came before may have been lost.
            Awaited::QuickStop
                if !follows && word & FOLLOWS != QUICK_STOP && scene.buses_are_sound() =>
            {
                Some("another reaction than the quick stop")
            }
            Awaited::Leaves | Awaited::QuickStop if follows && frames >= in_time => {
                Some("a reaction that is not commanded in time")
            }
            _ => None,
        };
        if !follows || wrong.is_some() {
            watched.awaited = None;
        }
        if let Some(what) = wrong.filter(|_| scene.is_told_all()) {
            found.violate(NAME, scene, what, || {
                format!("drive {name} is told {word:04X}h, {frames} R_PDOs after: {fault}")
            });
        }
    }

    /// A T_PDO came with what a drive says of itself.
    fn heard(&mut self, scene: &Scene<'_>, drive: usize) {
        let watched = &mut self.drives[drive];
        watched.silent = 0;
        let says = scene.drives[drive]
            .status
            .is_some_and(|status| status.power == PowerState::Enabled && status.mode_runs);
        let told = scene.drives[drive].controlword;
        let is_to = told.is_some_and(|word| word & FOLLOWS == FOLLOWS);
        // One that homes by itself is in another mode meanwhile.
        let homes = scene.homes_by_itself[scene.machine.drives[drive].axis];
        if watched.followed && !says && is_to && is_up(self.state) && !homes {
            watched.shows.get_or_insert((scene.now, 0));
        }
        watched.followed = says;
    }
}

impl Checker for Reactions {
    fn sync(&mut self, scene: &Scene<'_>, bus: usize, found: &mut Found) {
        for &drive in scene.drives_of(bus) {
            let allowed = scene.misses(drive) + SILENT;
            let watched = &mut self.drives[drive];
            let told = scene.drives[drive].controlword;
            let is_to = told.is_some_and(|word| word & FOLLOWS == FOLLOWS);
            watched.silent += 1;
            if !is_to || !is_up(self.state) {
                watched.silent = 0;
            } else if watched.silent > allowed && scene.buses_are_sound() {
                watched.silent = 0;
                found.violate(NAME, scene, "nothing is done about a silent drive", || {
                    scene.machine.drives[drive].name.clone()
                });
            }
        }
    }

    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, found: &mut Found) {
        self.begins_anew(scene, bus, sent);
        if let Some(drive) = scene.told_status {
            self.heard(scene, drive);
        }
        if let Some(drive) = scene.answered.filter(|drive| scene.is_polled(*drive)) {
            self.drives[drive].silent = 0;
        }
        if let Some((drive, word)) = scene.told_controlword {
            self.commanded(scene, drive, word, found);
        }
    }

    fn interfered(&mut self, scene: &Scene<'_>, what: &Interference, _: &mut Found) {
        let (device, what) = match *what {
            Interference::Drive(device, what) => (device, what),
            Interference::Bus(bus, what) => return self.bus(scene, bus, what),
            Interference::Late(micros) => {
                self.late += f64::from(micros) * 1e-6;
                return;
            }
            Interference::Slip(..)
            | Interference::Part(_)
            | Interference::Join(_)
            | Interference::Align(_)
            | Interference::Mended
            | Interference::StarvePlanner(_) => return,
        };
        let machine = &scene.case.machine;
        match what {
            ToDrive::Reset => {
                if let Some(watched) = self.drives.get_mut(device) {
                    watched.followed = false;
                }
            }
            ToDrive::Input(place, on) if machine.has_wire(device, place, Wire::is_enable) => {
                let is_known = self.forbids.iter().any(|(it, _)| *it == (device, place));
                match on {
                    true if is_known => {}
                    true => self.forbids.push(((device, place), scene.now)),
                    false => self.forbids.retain(|(it, _)| *it != (device, place)),
                }
            }
            ToDrive::Mute(true) if !scene.is_polled(device) => {
                self.mute.push((device, scene.now));
            }
            ToDrive::Mute(false) => self.mute.retain(|(it, _)| *it != device),
            _ => {}
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, found: &mut Found) {
        match event {
            Event::Machine(control::Event::Fault(fault)) => self.fault(scene, fault, found),
            Event::Accepted(it) if matches!(it.command, Command::Reset | Command::Enable) => {
                if it.command == Command::Reset {
                    self.told.clear();
                }
                self.drives.fill(Watched::default());
            }
            _ => {}
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        for (drive, watched) in self.drives.iter_mut().enumerate() {
            if let Some(fault) = watched.left.take().filter(|_| scene.buses_are_sound()) {
                let what = "a drive is taken off the path while it moves";
                let name = &scene.machine.drives[drive].name;
                found.violate(NAME, scene, what, || {
                    format!("drive {name}, after: {fault}")
                });
            }
        }
        self.overlooked(scene, found);
        self.state = scene.state;
    }
}
