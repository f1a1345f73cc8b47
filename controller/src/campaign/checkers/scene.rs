//! What all checkers know of a case so far.

use super::super::case::Case;
use super::super::interference::{Interference, ToBus, ToDrive};
use super::super::machine::Wire;
use super::super::stage::Woken;
use super::carriage::{Corrected, wound};
use crate::control::fault::DeviceCause;
use crate::control::{self, Fault, Phase, State};
use crate::machine::{HomingMethod, Machine, Motion};
use crate::observe::mapping::{Heard, PdoMappings};
use crate::observe::sent::PositionObjects;
use crate::session::Event;
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_drives::bus::Transmission;
use syncline_drives::model::{self, Device, DriveStatus, Increments, PowerState, unwrapped};
use syncline_drives::twin::Observation;

/// Controlword and statusword, as a mapping names them.
const CONTROLWORD: u32 = 0x6040_0010;
const STATUSWORD: u32 = 0x6041_0010;
/// Increments by which two readings of an encoder that stands may differ: each is off by 7 at the most, 3.5 deviations of the
/// noisiest twin's 2 increments, and rounded.
pub(super) const NOISE: f64 = 20.0;
/// Increments by which a shaft at rest may stand beside where its drive says it is: its loops answer that noise.
pub(super) const SWAYS: f64 = 10.0 * NOISE;
/// A shaft slower than that is at rest, rev/s: its loops answer the encoder's noise.
pub(super) const AT_REST: f64 = 0.2;
/// How long an axis may take to settle once what it is sent rests, s.
pub(super) const SETTLES: f64 = 1.0;
/// After something happened from outside an axis may move, and stand, as it was made to, for so long, s.
pub(super) const DISTURBED: f64 = 4.0;
/// Low bits of a controlword with which a drive follows what it is sent (CiA 402).
pub(super) const FOLLOWS: u16 = 0x0F;
/// By so much of the way a lead error changes at the most, as docs/machine-file.md has it.
pub(super) const STEEPEST: f64 = 0.1;
/// The target velocity, and the position that a drive tells.
const VELOCITY: u32 = 0x60FF_0020;
const POSITION: u32 = 0x6064_0020;
/// What an LXM32M's EMCY ends with that stands on its limit switch: A302h.
const LIMIT_SWITCH: [u8; 2] = [0x02, 0xA3];
/// What a drive told is from so long before what comes of it, cycles.
const TOLD_BEFORE: f64 = 4.0;
/// A shaft that is slower may be compared with what its drive told a little before, rev/s.
const STANDS: f64 = 0.01;

/// How things are.
#[derive(Debug)]
pub struct Scene<'a> {
    /// The case.
    pub case: &'a Case,
    /// Its machine.
    pub machine: &'a Machine,
    /// Virtual time of the last frame or wake-up.
    pub now: Instant,
    /// The controller's cycle.
    pub cycle: u64,
    /// The machine's state, as last told.
    pub state: State,
    /// When it was told.
    pub state_since: Instant,
    /// Where the controller is.
    pub phase: Phase,
    /// By drive: what its bus shows.
    pub drives: Vec<DriveScene>,
    /// By drive: what is true of it.
    pub plants: Vec<Observation>,
    /// By device: the levels of its digital outputs, one bit each.
    pub outputs: Vec<u16>,
    /// By bus: the cycle of the last SYNC, counted from the first one by their times; `None` for one that was
    /// too far off to belong to any.
    pub syncs: Vec<Option<u64>>,
    /// By axis: its positions are machine positions, as was told.
    pub referenced: Vec<bool>,
    /// By axis: what machine positions are more than what the machine file makes of counts, mm. Only an operator who sets
    /// an axis where it stands makes that different from 0: all else finds what is true of the simulated machine.
    pub set_off: Vec<f64>,
    /// By drive that homes by itself: what it counts more than its encoder, since it found a reference point.
    shifted: Vec<Increments>,
    /// By axis: its drive may be on its way home by itself.
    pub homes_by_itself: Vec<bool>,
    /// By axis: a homing by its drive was cut off.
    cut_off: Vec<bool>,
    /// By axis: by how much those may be off, as was told, mm.
    pub uncertainty: Vec<f64>,
    /// By axis: what its drives are sent beyond it.
    pub corrected: Vec<Corrected>,
    /// By axis: by how much what drives count may be off what they are sent beyond it, as it was homed: who looks for a switch, or says
    /// where it stands, does not know the flank, mm.
    pub homed_off: Vec<f64>,
    /// By axis: how far apart its sides stood as somebody set it where it stood, which is square from there on, mm.
    pub set_apart: Vec<f64>,
    /// By axis: where operators are shown that it is, mm.
    pub shown: Vec<f64>,
    /// By axis: where operators are shown that it is sent, mm.
    pub commanded: Vec<f64>,
    /// Operators are shown that the axes are off the path.
    pub off_path: bool,
    /// What happened from outside, and when, that something may still come of.
    pub interferences: Vec<(Instant, Interference)>,
    /// So many of these are mended, and whether the machine was started since.
    mended: Option<(usize, bool)>,
    /// Whether nothing goes wrong in the case, as [`Case::is_untroubled`] has it.
    pub is_untroubled: bool,
    /// Somebody has switched an input by which an axis is homed: where that is may be anywhere from then on.
    pub is_misled: bool,
    /// A fault was told, and no reset since.
    pub faulted: bool,
    /// Which drive told its status by the last frame.
    pub told_status: Option<usize>,
    /// Which drive was sent a controlword by it.
    pub told_controlword: Option<(usize, u16)>,
    /// Which drive answered a request by SDO with it.
    pub answered: Option<usize>,
    polled: Vec<usize>,
    buses: Vec<BusScene>,
}

/// A drive as its bus shows it.
#[derive(Debug, Default)]
pub struct DriveScene {
    /// The last that it was sent.
    pub controlword: Option<u16>,
    /// The last that it sent.
    pub statusword: Option<u16>,
    /// What it said of itself by its last T_PDO that says so, as its model reads it.
    pub status: Option<DriveStatus>,
    /// The last position along the path that it was sent, as the frame had it.
    pub setpoint: Option<Increments>,
    /// R_PDOs with a position, a target or a velocity since the last SYNC.
    pub came: u32,
    /// When the last of these came.
    pub came_at: Instant,
    /// What it latched at the last SYNC, all of the position.
    pub latched: Option<Increments>,
    /// When that came.
    pub latched_came: Instant,
    /// As many as came between the last two SYNCs.
    pub latched_of: u32,
    /// It was enabled and in its mode, as it said, when it latched.
    pub in_effect: bool,
    /// It was so at the SYNC before, too, and latched another setpoint then.
    pub moves: bool,
    /// The last velocity that it was sent, in its own units.
    pub velocity: Option<i32>,
    /// The last position that it told.
    told: Option<Increments>,
}

#[derive(Debug)]
struct BusScene {
    mappings: PdoMappings,
    drives: Vec<usize>,
    /// By place in `drives`: how its PDOs are read.
    readers: Vec<Reader>,
    first_sync: Option<Instant>,
}

/// What a drive's model says of its PDOs.
#[derive(Debug)]
struct Reader {
    device: Device,
    positions: PositionObjects,
    /// It is sent targets, to which it goes by a profile of its own.
    goes: bool,
}

impl Reader {
    fn new(machine: &Machine, drive: usize) -> Self {
        Self {
            device: machine.device(drive),
            positions: PositionObjects::of(machine, drive),
            goes: machine.axes[machine.drives[drive].axis].motion == Motion::PointToPoint,
        }
    }

    /// After how many increments its setpoint begins anew, if it does.
    fn range(&self) -> Option<Increments> {
        self.device.drive().and_then(model::Drive::setpoint_range)
    }

    /// What a frame says of the drive, if it is one of its T_PDOs that say something.
    fn status(&mut self, frame: &Frame) -> Option<DriveStatus> {
        let mut t_pdos = self.device.spec().t_pdos.iter();
        let t_pdo = t_pdos.position(|it| CanId::from(it.cob_id) == frame.id())?;
        self.device.drive_mut()?.status(t_pdo, frame.data())
    }
}

impl DriveScene {
    /// Something to go to came.
    fn came(&mut self, now: Instant) {
        self.came += 1;
        self.came_at = now;
    }

    /// It is told to follow, and says that its power stage is on and its mode at work. What a drive that fell
    /// silent said last is no more than that.
    #[must_use]
    pub fn follows(&self) -> bool {
        let told = self.controlword.is_none_or(|word| word & 0x0F == 0x0F);
        let says = |status: DriveStatus| status.power == PowerState::Enabled && status.mode_runs;
        told && self.status.is_some_and(says)
    }
}

/// The least and the greatest of them.
pub(super) fn extent(all: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let least = all.clone().fold(f64::INFINITY, f64::min);
    [least, all.fold(f64::NEG_INFINITY, f64::max)]
}

/// What a drive would count, so many revolutions from its encoder's zero.
fn count(machine: &Machine, drive: usize, revolutions: f64) -> Increments {
    let spec = &machine.drives[drive];
    let revolution = machine.axes[spec.axis].mm_per_revolution;
    // The range of increments is wide enough: positions come from a simulation.
    let increments = revolutions * revolution / spec.scaling.resolution();
    Increments::new(increments.round() as i64)
}

impl<'a> Scene<'a> {
    pub(super) fn new(case: &'a Case, machine: &'a Machine) -> Self {
        let bus = |bus: usize| {
            let drives = machine.drives.iter().enumerate();
            let drives: Vec<usize> = drives
                .filter(|(_, drive)| drive.bus == bus)
                .map(|(index, _)| index)
                .collect();
            let ids = drives
                .iter()
                .map(|it| &machine.drives[*it])
                .map(|drive| (drive.node.get().into(), drive.model.dictionary));
            BusScene {
                mappings: PdoMappings::new(ids),
                readers: (drives.iter())
                    .map(|drive| Reader::new(machine, *drive))
                    .collect(),
                drives,
                first_sync: None,
            }
        };
        Self {
            case,
            machine,
            now: Instant::ZERO,
            cycle: 0,
            state: State::Starting,
            state_since: Instant::ZERO,
            phase: Phase::Survey,
            drives: (machine.drives.iter())
                .map(|_| DriveScene::default())
                .collect(),
            plants: Vec::new(),
            outputs: Vec::new(),
            syncs: vec![None; machine.buses.len()],
            referenced: machine
                .axes
                .iter()
                .map(|axis| axis.homing.is_absolute())
                .collect(),
            set_off: vec![0.0; machine.axes.len()],
            shifted: vec![Increments::default(); machine.drives.len()],
            homes_by_itself: vec![false; machine.axes.len()],
            cut_off: vec![false; machine.axes.len()],
            uncertainty: vec![0.0; machine.axes.len()],
            corrected: Corrected::all(case),
            homed_off: vec![0.0; machine.axes.len()],
            set_apart: vec![0.0; machine.axes.len()],
            shown: Vec::new(),
            commanded: Vec::new(),
            off_path: false,
            interferences: Vec::new(),
            mended: None,
            is_untroubled: case.is_untroubled(),
            is_misled: false,
            faulted: false,
            told_status: None,
            told_controlword: None,
            answered: None,
            polled: (0..machine.drives.len())
                .filter(|drive| !machine.device(*drive).spec().answers_sync)
                .collect(),
            buses: (0..machine.buses.len()).map(bus).collect(),
        }
    }

    /// Cycles for which a device that answers SYNC may fall silent, or one that is asked by SDO, before that is a fault.
    #[must_use]
    pub fn misses(&self, device: usize) -> u32 {
        let stated = match self.is_polled(device) {
            true => Some(self.machine.controller.heartbeat_timeout),
            false => self.machine.position_loss(device),
        };
        let cycle = self.machine.cycle.as_nanos();
        stated.map_or(self.case.machine.t_pdo_misses, |it| {
            (it.as_nanos() / cycle) as u32 + 1
        })
    }

    /// Whether a device is asked by SDO over and over, also while axes move, for what others tell by themselves.
    #[must_use]
    pub fn is_polled(&self, device: usize) -> bool {
        self.polled.contains(&device)
    }

    /// Virtual time, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.now.as_nanos() as f64 * 1e-9
    }

    /// Seconds since an instant.
    #[must_use]
    pub fn since(&self, instant: Instant) -> f64 {
        self.now.saturating_since(instant).as_nanos() as f64 * 1e-9
    }

    /// A cycle, s.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.machine.cycle.as_secs_f64()
    }

    /// The drives of a bus.
    #[must_use]
    pub fn drives_of(&self, bus: usize) -> &[usize] {
        &self.buses[bus].drives
    }

    /// Which drive of a bus has this node id.
    #[must_use]
    pub fn drive_with(&self, bus: usize, node: u8) -> Option<usize> {
        let drives = self.buses[bus].drives.iter().copied();
        let mut drives = drives.filter(|it| self.machine.drives[*it].node.get() == node);
        drives.next()
    }

    /// Where a drive would be that counts so many increments, mm.
    #[must_use]
    pub fn mm(&self, drive: usize, increments: Increments) -> f64 {
        self.encoder_mm(drive, increments - self.shifted[drive])
    }

    /// Where a drive would be whose encoder is there, mm.
    fn encoder_mm(&self, drive: usize, increments: Increments) -> f64 {
        let spec = &self.machine.drives[drive];
        spec.scaling.to_mm(increments) + self.set_off[spec.axis]
    }

    /// Whether an axis is homed by its drive.
    #[must_use]
    pub fn is_homed_by_drive(&self, axis: usize) -> bool {
        matches!(
            self.machine.axes[axis].homing.method,
            HomingMethod::Drive(_)
        )
    }

    /// Whether an axis goes by machine positions, and nobody has switched an input by which it is homed.
    #[must_use]
    pub fn is_placed(&self, axis: usize) -> bool {
        self.referenced[axis] && self.state != State::Homing && !self.is_misled
    }

    /// Where a drive's shaft is, mm.
    #[must_use]
    pub fn actual(&self, drive: usize) -> Option<f64> {
        let count = count(self.machine, drive, self.plants.get(drive)?.position);
        Some(self.encoder_mm(drive, count))
    }

    /// Where the middle of an axis's sides is, mm, of what is known of each of its drives.
    #[must_use]
    pub fn middle(&self, axis: usize, of: impl Fn(usize) -> Option<f64>) -> Option<f64> {
        let drives = &self.machine.axes[axis].drives;
        let sides: Option<Vec<f64>> = drives.iter().map(|drive| of(*drive)).collect();
        Some(sides?.iter().sum::<f64>() / drives.len() as f64)
    }

    /// Where what a drive moves is, mm.
    #[must_use]
    pub fn carriage(&self, drive: usize) -> Option<f64> {
        let load = self.plants.get(drive)?.load_position;
        Some(self.encoder_mm(drive, count(self.machine, drive, load)))
    }

    /// Where an axis is whose drives are there, mm: by [`Self::unknown`] more or less.
    #[must_use]
    pub fn axis(&self, axis: usize, drives: f64) -> f64 {
        match self.is_placed(axis) {
            true => self.corrected[axis].axis(drives),
            false => drives,
        }
    }

    /// How far an axis may be beside that, mm: where a flank is not known, with what the lead error changes by on the way there.
    #[must_use]
    pub fn unknown(&self, axis: usize) -> f64 {
        (self.corrected[axis].half + self.homed_off[axis]) / (1.0 - STEEPEST)
    }

    /// Whether anything happened from outside in the last `seconds`, or lasts.
    #[must_use]
    pub fn is_disturbed(&self, seconds: f64) -> bool {
        let lasts = |what: &Interference| match what {
            Interference::Drive(_, what) => {
                !matches!(what, ToDrive::LoseTPdos(_) | ToDrive::Input(..))
            }
            Interference::Bus(_, what) => matches!(what, ToBus::Incoming(_) | ToBus::Unplug(_)),
            Interference::Part(_) => true,
            Interference::Slip(..)
            | Interference::Join(_)
            | Interference::Align(_)
            | Interference::Mended
            | Interference::Late(_)
            | Interference::StarvePlanner(_) => false,
        };
        let mut all = self.interferences.iter();
        all.any(|(at, what)| lasts(what) || self.since(*at) < seconds)
    }

    /// Takes a frame; whether it was a SYNC.
    pub(super) fn frame(&mut self, bus: usize, sent: &Transmission) -> bool {
        self.now = self.now.max(sent.end);
        let BusScene {
            mappings,
            drives,
            readers,
            first_sync,
        } = &mut self.buses[bus];
        let is_sync = sent.frame.id() == CanId::from(CobId::SYNC);
        if is_sync {
            let first = *first_sync.get_or_insert(sent.start);
            let cycle = self.machine.cycle.as_nanos() as u64;
            let passed = sent.start.saturating_since(first).as_nanos() as u64;
            let number = (passed + cycle / 2) / cycle;
            // A frame may be in its way, and have been in that of the first one.
            let blocked = 2 * 135_000_000_000 / u64::from(self.machine.buses[bus].bitrate);
            let on_time = passed.abs_diff(number * cycle) <= cycle / 20 + blocked;
            self.syncs[bus] = on_time.then_some(number);
            for (&index, reader) in drives.iter().zip(&*readers) {
                let drive = &mut self.drives[index];
                let by_itself = self.homes_by_itself[self.machine.drives[index].axis];
                let follows = drive.follows() && !by_itself;
                let followed = std::mem::replace(&mut drive.in_effect, follows);
                let before = drive.latched;
                let plant = self.plants.get(index);
                let count = |it: &Observation| count(self.machine, index, it.position);
                let known = before.or_else(|| plant.map(count));
                let known = known.unwrap_or_default();
                drive.latched = (drive.setpoint).map(|it| unwrapped(it, reader.range(), known));
                drive.latched_came = drive.came_at;
                drive.moves = followed && drive.in_effect && drive.latched != before;
                drive.latched_of = std::mem::take(&mut drive.came);
            }
        }
        let scenes = &mut self.drives;
        (self.told_status, self.told_controlword) = (None, None);
        self.answered = (drives.iter().copied()).find(|drive| {
            let node = self.machine.drives[*drive].node;
            sent.frame.id() == CanId::from(CobId::t_sdo(node))
        });
        for (&drive, reader) in drives.iter().zip(&mut *readers) {
            if let Some(status) = reader.status(&sent.frame) {
                scenes[drive].status = Some(status);
                self.told_status = Some(drive);
            }
        }
        let controlword = &mut self.told_controlword;
        mappings.hear(&sent.frame, &mut |node, heard| {
            let drive = &mut scenes[drives[node]];
            match heard {
                Heard::Reset => *drive = DriveScene::default(),
                Heard::Object { object, value } => match object {
                    CONTROLWORD => {
                        drive.controlword = Some(value as u16);
                        *controlword = Some((drives[node], value as u16));
                    }
                    STATUSWORD => drive.statusword = Some(value as u16),
                    POSITION => drive.told = Some((value as i32).into()),
                    VELOCITY => {
                        drive.velocity = Some(value as i32);
                        drive.came(sent.end);
                    }
                    _ => {
                        let reader = &readers[node];
                        if let Some(setpoint) = reader.positions.read(object, value) {
                            drive.setpoint = Some(setpoint).filter(|_| !reader.goes);
                            drive.came(sent.end);
                        }
                    }
                },
            }
        });
        is_sync
    }

    /// Nothing has happened to buses or to the host.
    pub(super) fn buses_are_sound(&self) -> bool {
        self.interferences.iter().all(|(_, what)| {
            matches!(
                what,
                Interference::Drive(..)
                    | Interference::Slip(..)
                    | Interference::Part(_)
                    | Interference::Join(_)
                    | Interference::Align(_)
                    | Interference::Mended
                    | Interference::StarvePlanner(_)
            )
        })
    }

    /// Nothing has happened to what comes in from buses: bursts may have been lost or late, and so may SYNCs and wake-ups.
    pub(super) fn is_told_all(&self) -> bool {
        self.interferences.iter().all(|(_, what)| match what {
            Interference::Bus(_, what) => matches!(
                what,
                ToBus::DropBursts(_)
                    | ToBus::DelayBursts(_)
                    | ToBus::TearBurst
                    | ToBus::LoseSyncs(_)
            ),
            _ => true,
        })
    }

    /// Nothing has happened that changes when bursts leave.
    pub(super) fn bursts_are_on_time(&self) -> bool {
        self.interferences.iter().all(|(_, what)| {
            matches!(
                what,
                Interference::StarvePlanner(_)
                    | Interference::Mended
                    | Interference::Drive(_, ToDrive::Input(..))
            )
        })
    }

    pub(super) fn interfered(&mut self, what: &Interference) {
        if let Interference::Drive(drive, ToDrive::Input(place, _)) = *what {
            self.is_misled |= (self.case.machine).has_wire(drive, place, Wire::is_home);
        }
        if *what == Interference::Mended {
            self.mended = Some((self.interferences.len(), false));
        }
        self.interferences.push((self.now, what.clone()));
    }

    /// Forgets what was mended once the machine was started and is ready since.
    fn forget(&mut self, state: State) {
        match (&mut self.mended, state) {
            (Some((_, is_started)), State::Starting) => *is_started = true,
            (Some((count, true)), State::Ready) => {
                self.interferences.drain(..*count);
                self.mended = None;
            }
            _ => {}
        }
    }

    pub(super) fn told(&mut self, event: &Event) {
        match event {
            Event::State(state) => {
                self.forget(*state);
                self.state = *state;
                self.state_since = self.now;
                for axis in 0..self.machine.axes.len() {
                    let begins = *state == State::Homing && self.is_homed_by_drive(axis);
                    let goes_on = *state == State::Stopping && self.homes_by_itself[axis];
                    self.homes_by_itself[axis] = begins || goes_on;
                    self.cut_off[axis] |= goes_on;
                }
            }
            Event::Machine(control::Event::Referenced {
                axis, uncertainty, ..
            }) => {
                self.referenced[*axis] = true;
                (self.homes_by_itself[*axis], self.cut_off[*axis]) = (false, false);
                let spec = &self.machine.axes[*axis];
                let resolution = self.machine.drives[spec.drives[0]].scaling.resolution();
                let learned = match spec.homing.method {
                    HomingMethod::Drive(_) => 2.0 * SWAYS * resolution,
                    _ => 0.0,
                };
                self.uncertainty[*axis] = uncertainty.unwrap_or(learned);
                let corrected = &self.corrected[*axis];
                if let HomingMethod::SetHere { position } = spec.homing.method
                    && let Some(actual) = self.middle(*axis, |drive| self.actual(drive))
                {
                    // One that sags as it is enabled has gone on since its drives told where it was.
                    let fastest = spec.drives.iter().map(|it| self.plants[*it].velocity.abs());
                    let speed = fastest.fold(0.0, f64::max) * spec.mm_per_revolution;
                    let went = TOLD_BEFORE * self.period() * speed;
                    // A weight, or grease, holds it beside its setpoint for a while.
                    let held = spec.drives.iter().filter_map(|it| {
                        let sent = self.mm(*it, self.drives[*it].latched?);
                        Some((sent - self.actual(*it)?).abs())
                    });
                    let held = held.fold(0.0, f64::max);
                    let [least, most] =
                        extent(spec.drives.iter().filter_map(|it| self.actual(*it)));
                    self.set_apart[*axis] = most - least;
                    self.set_off[*axis] += corrected.drives(position) - actual;
                    self.homed_off[*axis] = corrected.half + SWAYS * resolution + went + held;
                } else {
                    // A switch is tripped by what its drive moves.
                    let wound = match &spec.homing.method {
                        HomingMethod::Switch(search) => {
                            let drives = spec.drives.iter();
                            let wound = drives.map(|it| wound(self, *it, search.slow_speed));
                            wound.fold(0.0, f64::max)
                        }
                        _ => 0.0,
                    };
                    self.homed_off[*axis] = corrected.greatest() + wound;
                }
            }
            Event::Machine(
                control::Event::Unreferenced { axis, .. } | control::Event::Askew { axis, .. },
            ) => {
                self.referenced[*axis] = false;
                self.cut_off[*axis] |= self.homes_by_itself[*axis];
            }
            Event::Machine(control::Event::HomingFailed { axis, .. }) => {
                self.cut_off[*axis] |= self.homes_by_itself[*axis];
            }
            Event::Machine(control::Event::Fault(fault)) => {
                self.faulted = true;
                self.stopped_on_its_switch(fault);
            }
            Event::Accepted(it) if it.command == crate::session::Command::Reset => {
                self.faulted = false;
            }
            _ => {}
        }
    }

    /// A drive whose homing was cut off beyond its limit switch says so, as it does of an error that somebody gave it; and one comes there
    /// whose axis was set elsewhere than it stands.
    fn stopped_on_its_switch(&mut self, fault: &Fault) {
        if let Fault::Device(drive, DeviceCause::Emergency { emergency }) = fault
            && let Some(spec) = self.machine.drives.get(*drive)
            && (self.cut_off[spec.axis] || self.is_set_elsewhere(spec.axis))
            && emergency.vendor[3..] == LIMIT_SWITCH
        {
            let error = Interference::Drive(*drive, ToDrive::Error(1));
            self.interferences.push((self.now, error));
            self.is_untroubled = false;
        }
    }

    /// Whether somebody has set an axis where it stood, and that was not there.
    fn is_set_elsewhere(&self, axis: usize) -> bool {
        let drive = self.machine.axes[axis].drives[0];
        self.set_off[axis].abs() > SWAYS * self.machine.drives[drive].scaling.resolution()
    }

    pub(super) fn woken(&mut self, woken: &Woken) {
        self.now = self.now.max(woken.now);
        self.cycle = woken.cycle;
        self.phase = woken.phase;
        self.plants.clone_from(&woken.plants);
        self.outputs.clone_from(&woken.outputs);
        self.shown.clone_from(&woken.shown);
        self.commanded.clone_from(&woken.commanded);
        self.off_path = woken.off_path;
        for axis in 0..self.machine.axes.len() {
            if self.is_homed_by_drive(axis) {
                self.learn(axis);
            }
        }
    }

    /// Learns, while it stands, what a drive counts that homes by itself, and until the homing is over what machine positions are
    /// there: where exactly its reference point is, only the drive knows.
    fn learn(&mut self, axis: usize) {
        let drive = self.machine.axes[axis].drives[0];
        let plant = &self.plants[drive];
        if plant.velocity.abs() > STANDS {
            return;
        }
        let counted = count(self.machine, drive, plant.position);
        let follows = self.drives[drive].follows() && !self.homes_by_itself[axis];
        if let (Some(told), false) = (self.drives[drive].told, follows) {
            self.shifted[drive] = told - counted;
        }
        if self.state == State::Homing && self.referenced[axis] {
            let drives = self.corrected[axis].drives(self.shown[axis]);
            self.set_off[axis] += drives - self.encoder_mm(drive, counted);
        }
    }
}
