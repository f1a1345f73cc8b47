//! A simulated Lexium 32M with its CANopen module.
//!
//! ```
//! use syncline_canopen::NodeId;
//! use syncline_drives::bus::{BitRate, SimBus};
//! use syncline_drives::twin::lxm32m::{Twin, TwinConfig};
//!
//! let mut bus = SimBus::new(BitRate::from_kbit(1000).ok_or("bit rate")?);
//! let x = bus.attach(Twin::new(TwinConfig {
//!     initial_position: 131_072 * 10,
//!     seed: 7,
//!     ..TwinConfig::new(NodeId::new(1).ok_or("node id")?)
//! }));
//! // … bring it up over the bus, then ask what a master cannot know:
//! assert_eq!(bus.node(x).position(), 10.0);
//! # Ok::<(), &str>(())
//! ```
//!
//! What the manual tells is modelled as it tells it; line numbers in comments (`lxm32m 1634`) are
//! those of the manual's text. What it leaves open is an option in [`Policies`] or
//! [`TwinConfig`], with a default that is an assumption.
//!
//! The node is Pre-Operational from the origin of time and sends its boot-up then. Time passes
//! inside it whenever it is called; its state is polled every millisecond.
//!
//! In Interpolated Position a setpoint that is put into effect at SYNC *k* is reached at
//! SYNC *k* + 1 by linear interpolation at the position loop's rate: the interpolation delay is
//! one cycle ([`INTERPOLATION_DELAY`]), an assumption.
//!
//! Tests interfere with it through [`Twin::raise`], [`Twin::mute`], [`Twin::drop_t_pdos`],
//! [`Twin::block_axis`], [`Twin::start_enabled`], [`Twin::refuse_write`], [`Twin::reboot`] and
//! [`TwinConfig::identity`].

mod drive;
mod fault;
mod modes;
mod monitoring;
mod motion;
mod outbox;
mod pdo;
mod policy;
mod rows;
mod state;
mod switches;
mod synchronisation;
mod units;

pub use fault::{DriveError, ErrorClass};
pub use policy::{Policies, SetpointGap};
pub use switches::Switches;
pub use synchronisation::SyncStatus;

use super::clock::Clock;
use super::control::{Cascade, Gains};
use super::plant::{INCREMENTS_PER_REVOLUTION, Mechanics, Plant};
use super::random::Random;
use crate::bus::Node;
use crate::dictionary::LXM32M;
use core::ops::Range;
use drive::{Channel, Drive};
use monitoring::Monitoring;
use outbox::Outbox;
use pdo::Pdos;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::{Dictionary, Entry, Row};
use syncline_canopen::pdo::CobIdWord;
use syncline_canopen::sdo::{AbortCode, Objects, Server};
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CobId, Frame, Instant, NodeId, Transmit, nmt};

/// SYNC cycles from putting a setpoint into effect to reaching it (assumption).
pub const INTERPOLATION_DELAY: f64 = 1.0;

/// How often the drive looks after its state without being addressed.
const TASK: Duration = Duration::from_millis(1);

/// What a twin is made of.
#[derive(Clone, Debug)]
pub struct TwinConfig {
    /// Node id.
    pub node: NodeId,
    /// Seed of encoder noise, delays and oscillator.
    pub seed: u64,
    /// Where the absolute multi-turn encoder stands, increments (131072 a revolution).
    pub initial_position: i64,
    /// The axis behind the motor.
    pub mechanics: Mechanics,
    /// Gains of the control loops.
    pub gains: Gains,
    /// The switches along it.
    pub switches: Switches,
    /// What the manual leaves open.
    pub policies: Policies,
    /// Who the drive says it is.
    pub identity: Identity,
    /// Time from SYNC or event until a T_PDO, heartbeat or EMCY is handed to the CAN controller.
    pub t_pdo_delay: Range<Duration>,
    /// Time from a request to its SDO answer.
    pub sdo_delay: Range<Duration>,
    /// Greatest error of the oscillator, parts per million; the seed picks one within.
    pub oscillator_ppm: f64,
    /// Time from a reset to the boot-up message.
    pub boot_time: Duration,
}

impl TwinConfig {
    /// The drive with all defaults; delays, oscillator and boot time are assumptions.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            seed: 0,
            initial_position: 0,
            mechanics: Mechanics::default(),
            gains: Gains::default(),
            switches: Switches::default(),
            policies: Policies::default(),
            identity: Identity::default(),
            t_pdo_delay: Duration::from_micros(30)..Duration::from_micros(90),
            sdo_delay: Duration::from_micros(200)..Duration::from_micros(900),
            oscillator_ppm: 50.0,
            boot_time: Duration::from_millis(20),
        }
    }
}

/// 1000h, Objects 1000h, 1008h…100Ah and 1018h. Product code, revision and texts are not in the
/// manual at hand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// 1000h (lxm32m 2965).
    pub device_type: u32,
    /// 1018h:1 (lxm32m 3353).
    pub vendor_id: u32,
    /// 1018h:2.
    pub product_code: u32,
    /// 1018h:3.
    pub revision: u32,
    /// 1008h; padded with spaces to 8 bytes like the next two.
    pub name: String,
    /// 1009h.
    pub hardware: String,
    /// 100Ah.
    pub software: String,
}

impl Default for Identity {
    fn default() -> Self {
        Self {
            device_type: 0x0042_0192,
            vendor_id: 0x0800_005A,
            product_code: 0,
            revision: 0,
            name: "LXM32M".into(),
            hardware: String::new(),
            software: "V01.00".into(),
        }
    }
}

/// A Lexium 32M on a bus; see the [module](self).
pub struct Twin {
    config: TwinConfig,
    nmt: nmt::Slave,
    boot_at: Option<(Instant, nmt::Event)>,
    drive: Drive,
    pdos: Pdos,
    monitoring: Monitoring,
    servers: [Server; 2],
    outbox: Outbox,
    next_task: Instant,
    emcy_blocked_until: Instant,
    reboot: bool,
    dropped_t_pdos: u32,
    refusals: Vec<(Address, AbortCode)>,
}

impl Twin {
    /// A drive that has just been powered on, at the origin of time.
    #[must_use]
    pub fn new(config: TwinConfig) -> Self {
        let stream =
            |purpose: u64| Random::new(config.seed, u64::from(config.node.get()) << 8 | purpose);
        let mut objects = Dictionary::new(&LXM32M, config.node);
        stamp(&mut objects, &config.identity);
        let ppm = stream(0).between(-config.oscillator_ppm, config.oscillator_ppm);
        let revolutions = config.initial_position as f64 / INCREMENTS_PER_REVOLUTION;
        let drive = Drive::new(
            objects,
            config.policies.clone(),
            config.switches.clone(),
            Clock::new(Instant::ZERO, ppm),
            Plant::new(config.mechanics.clone(), revolutions, stream(1)),
            Cascade::new(config.gains.clone(), config.initial_position),
        );
        let node = config.node;
        Self {
            nmt: nmt::Slave::new(node),
            boot_at: Some((Instant::ZERO, nmt::Event::ResetNode)),
            pdos: Pdos::new(&drive.objects),
            monitoring: Monitoring::new(node, &drive.objects, Instant::ZERO),
            servers: [
                Server::new(CobId::r_sdo(node), CobId::t_sdo(node), 16).without_block_transfer(),
                {
                    let mut second = Server::new(CobId::r_sdo(node), CobId::t_sdo(node), 16)
                        .without_block_transfer();
                    second.set_channel(None);
                    second
                },
            ],
            outbox: Outbox::new(stream(2)),
            drive,
            next_task: Instant::ZERO,
            emcy_blocked_until: Instant::ZERO,
            reboot: false,
            dropped_t_pdos: 0,
            refusals: Vec::new(),
            config,
        }
    }

    // ---- what a master cannot know ----

    /// True position of the shaft, revolutions from the encoder's zero.
    #[must_use]
    pub fn position(&self) -> f64 {
        self.drive.plant().position()
    }

    /// True velocity of the shaft, rev/s.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.drive.plant().velocity()
    }

    /// Torque of the motor, N·m.
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.drive.torque()
    }

    /// State of the drive.
    #[must_use]
    pub fn state(&self) -> State {
        self.drive.state()
    }

    /// Statusword of the drive.
    #[must_use]
    pub fn statusword(&self) -> Statusword {
        self.drive.statusword()
    }

    /// NMT state of the node.
    #[must_use]
    pub fn nmt_state(&self) -> nmt::State {
        self.nmt.state()
    }

    /// Node id.
    #[must_use]
    pub fn node(&self) -> NodeId {
        self.config.node
    }

    // ---- interference ----

    /// Raises an error, as if the drive's monitoring had found one.
    pub fn raise(&mut self, error: DriveError) {
        self.drive.raise(error);
    }

    /// While true, the cause of an error is still there: Fault Reset is in vain.
    pub fn cause_persists(&mut self, persists: bool) {
        self.drive.errors.cause_persists = persists;
    }

    /// While true, nothing that the node sends reaches the bus.
    pub fn mute(&mut self, muted: bool) {
        self.outbox.mute(muted);
    }

    /// Loses the next `count` T_PDOs.
    pub fn drop_t_pdos(&mut self, count: u32) {
        self.dropped_t_pdos = count;
    }

    /// While true, the axis is blocked mechanically.
    pub fn block_axis(&mut self, blocked: bool) {
        self.drive.plant_mut().block(blocked);
    }

    /// Operation Enabled, as a master that crashed may have left the drive.
    pub fn start_enabled(&mut self) {
        self.drive.start_enabled();
    }

    /// Refuses every SDO write to an object.
    pub fn refuse_write(&mut self, address: Address, code: AbortCode) {
        self.refusals.push((address, code));
    }

    /// Power fails and returns; the boot-up message comes after the boot time.
    pub fn reboot(&mut self) {
        self.reboot = true;
    }

    /// Pulses/s at the PTI interface, the reference of Electronic Gear.
    pub fn set_pulse_frequency(&mut self, frequency: f64) {
        self.drive.pulses.frequency = frequency;
    }

    /// Presets statusword bits 10 and 13, which the manual's examples find set without a cause.
    pub fn preset_status(&mut self, target_reached: bool, x_err: bool) {
        self.drive.target_reached = target_reached;
        self.drive.x_err = x_err;
    }

    // ---- the node ----

    fn boot(&mut self, now: Instant, reset: nmt::Event) {
        let communication = |entry: &Entry| entry.address.index < 0x2000;
        let objects = &mut self.drive.objects;
        if reset == nmt::Event::ResetNode {
            objects.restore(|_| true);
            self.drive.restart();
        } else {
            objects.restore(communication);
        }
        let objects = &mut self.drive.objects;
        stamp(objects, &self.config.identity);
        self.pdos = Pdos::new(objects);
        self.monitoring = Monitoring::new(self.config.node, objects, now);
        self.servers[0].reset();
        self.servers[1].set_channel(None);
        let mut boot_up = Single(None);
        self.nmt.boot(&mut boot_up);
        if let Some(frame) = boot_up.0 {
            self.outbox
                .send_within(now, &self.config.t_pdo_delay, frame);
        }
    }

    fn on_nmt(&mut self, now: Instant, event: nmt::Event) {
        match event {
            nmt::Event::Entered(nmt::State::Operational) => self.pdos.start(),
            nmt::Event::Entered(nmt::State::Stopped) => {
                if self.drive.is_powered() {
                    self.drive.raise(DriveError::NMT_STOP);
                }
            }
            nmt::Event::Entered(_) => {}
            nmt::Event::ResetNode | nmt::Event::ResetCommunication => {
                if self.drive.is_powered() {
                    self.drive.raise(DriveError::NMT_RESET);
                }
                self.outbox.clear();
                self.boot_at = Some((now + self.config.boot_time, event));
            }
        }
    }

    fn on_sync(&mut self, now: Instant) {
        self.drive.publish(now);
        let operational = self.nmt.state() == nmt::State::Operational;
        if operational {
            let (outbox, dropped) = (&mut self.outbox, &mut self.dropped_t_pdos);
            self.pdos.sample(&self.drive.objects, |frame| {
                if dropped.checked_sub(1).map(|left| *dropped = left).is_none() {
                    outbox.send_within(now, &self.config.t_pdo_delay, frame);
                }
            });
            self.pdos.apply(&mut self.drive);
        }
        self.drive.on_sync(now);
    }

    fn on_sdo(&mut self, now: Instant, frame: &Frame) -> bool {
        let mut answer = Single(None);
        let mut access = Access {
            now,
            drive: &mut self.drive,
            pdos: &mut self.pdos,
            monitoring: &mut self.monitoring,
            refusals: &self.refusals,
            moved_server: false,
        };
        let served = self
            .servers
            .iter_mut()
            .any(|server| server.on_frame(now, frame, &mut access, &mut answer));
        if access.moved_server {
            let word = |sub| {
                let word = self.drive.objects.value(0x1201, sub).unwrap_or(0);
                let word = CobIdWord(word as u32);
                word.cob_id().filter(|_| word.is_valid())
            };
            self.servers[1].set_channel(word(1).zip(word(2)));
        }
        if let Some(frame) = answer.0 {
            self.outbox.send_within(now, &self.config.sdo_delay, frame);
        }
        served
    }

    fn on_r_pdo(&mut self, n: usize, frame: &Frame) {
        if self.nmt.state() != nmt::State::Operational {
            return;
        }
        if self.pdos.receive(n, frame, &mut self.drive).is_err()
            && self.config.policies.emcy_on_short_pdo
        {
            self.drive.errors.tell(DriveError::SHORT_PDO, n as u8 + 1);
        }
    }

    /// Sends what has become due or true.
    fn settle(&mut self, now: Instant) {
        if self.monitoring.lost(now) {
            // 1029h:1 (lxm32m 3401-3406).
            match self.drive.objects.value(0x1029, 1) {
                Some(0) if self.nmt.state() == nmt::State::Operational => {
                    self.nmt.enter(nmt::State::PreOperational);
                }
                Some(2) => self.nmt.enter(nmt::State::Stopped),
                _ => {}
            }
            self.drive.raise(DriveError::CONNECTION_LOST);
        }
        let delay = &self.config.t_pdo_delay;
        if let Some(heartbeat) = self.monitoring.produce(now, self.nmt.state()) {
            self.outbox.send_within(now, delay, heartbeat);
        }
        if self.nmt.state().communicates() && now >= self.emcy_blocked_until {
            self.send_emcy(now);
        }
        if self.nmt.state() == nmt::State::Operational {
            self.drive.publish(now);
            let trigger = self.drive.take_status_event();
            let (outbox, dropped) = (&mut self.outbox, &mut self.dropped_t_pdos);
            self.pdos.poll(now, &self.drive.objects, trigger, |frame| {
                if dropped.checked_sub(1).map(|left| *dropped = left).is_none() {
                    outbox.send_behind(now, &self.config.t_pdo_delay, frame);
                }
            });
        }
    }

    fn send_emcy(&mut self, now: Instant) {
        let word = self.drive.objects.value(0x1014, 0).unwrap_or(0);
        let word = CobIdWord(word as u32);
        let Some(cob_id) = word.cob_id().filter(|_| word.is_valid()) else {
            return;
        };
        if let Some(payload) = self.drive.errors.next_emcy() {
            let frame = Frame::new(cob_id, &payload);
            self.outbox
                .send_within(now, &self.config.t_pdo_delay, frame);
            let inhibit = self.drive.objects.value(0x1015, 0).unwrap_or(0) as u32;
            self.emcy_blocked_until = now + Duration::from_micros(100) * inhibit;
        }
    }

    fn sync_id(&self) -> Option<CobId> {
        let word = self.drive.objects.value(0x1005, 0).unwrap_or(0);
        CobIdWord(word as u32).cob_id()
    }
}

impl Node for Twin {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        self.drive.advance(now);
        if self.nmt.state() == nmt::State::Initialising {
            return;
        }
        let communicates = self.nmt.state().communicates();
        if let Some(event) = self.nmt.on_frame(frame) {
            self.on_nmt(now, event);
        } else if communicates && self.sync_id().is_some_and(|id| frame.id() == id.into()) {
            self.on_sync(now);
        } else if let Some(n) = self.pdos.addressed(frame) {
            self.on_r_pdo(n, frame);
        } else if communicates && self.on_sdo(now, frame) {
        } else if let Some(answer) = self.monitoring.on_frame(now, frame, self.nmt.state()) {
            self.outbox
                .send_within(now, &self.config.t_pdo_delay, answer);
        } else if frame.is_remote() && self.nmt.state() == nmt::State::Operational {
            self.drive.publish(now);
            if let Some(answer) = self.pdos.requested(frame, &self.drive.objects) {
                self.outbox
                    .send_within(now, &self.config.t_pdo_delay, answer);
            }
        }
        self.settle(now);
        self.outbox.flush(now, tx);
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        self.drive.advance(now);
        if core::mem::take(&mut self.reboot) {
            self.outbox.clear();
            self.drive.power_off();
            self.nmt = nmt::Slave::new(self.config.node);
            self.boot_at = Some((now + self.config.boot_time, nmt::Event::ResetNode));
        }
        if let Some((_, reset)) = self.boot_at.take_if(|(at, _)| *at <= now) {
            self.boot(now, reset);
        }
        if self.nmt.state() != nmt::State::Initialising {
            self.settle(now);
        }
        self.outbox.flush(now, tx);
        if self.next_task <= now {
            self.next_task = now + TASK;
        }
    }

    fn deadline(&self) -> Option<Instant> {
        let communication = [
            self.monitoring.deadline(),
            self.pdos
                .deadline()
                .filter(|_| self.nmt.state() == nmt::State::Operational),
        ];
        let communication = communication
            .into_iter()
            .filter(|_| self.nmt.state() != nmt::State::Initialising)
            .flatten();
        communication
            .chain(self.outbox.deadline())
            .chain(self.boot_at.map(|(at, _)| at))
            .chain([self.next_task])
            .min()
    }
}

fn stamp(objects: &mut Dictionary, identity: &Identity) {
    objects.put(0x1000, 0, identity.device_type.into());
    objects.put(0x1018, 1, identity.vendor_id.into());
    objects.put(0x1018, 2, identity.product_code.into());
    objects.put(0x1018, 3, identity.revision.into());
    let texts = [
        (0x1008, &identity.name),
        (0x1009, &identity.hardware),
        (0x100A, &identity.software),
    ];
    for (index, text) in texts {
        if let Some(row) = objects.row(index, 0) {
            objects.set_bytes(row, format!("{text:<8}").as_bytes());
        }
    }
}

/// Catches the one frame that a state machine answers with.
struct Single(Option<Frame>);

impl Transmit for Single {
    fn transmit(&mut self, frame: Frame) {
        self.0 = Some(frame);
    }
}

/// The drive's objects as its SDO servers reach them.
struct Access<'a> {
    now: Instant,
    drive: &'a mut Drive,
    pdos: &'a mut Pdos,
    monitoring: &'a mut Monitoring,
    refusals: &'a [(Address, AbortCode)],
    moved_server: bool,
}

impl Access<'_> {
    fn write(&mut self, row: Row, address: Address, data: &[u8]) -> Result<(), AbortCode> {
        let Address { index, sub } = address;
        let value = self.drive.objects.decode(row, data)?;
        self.drive.check_write(row, value)?;
        let value = match index {
            // Of SYNC's and EMCY's identifier the function code can be changed (lxm32m 3079-3085,
            // 3228-3236).
            0x1005 | 0x1014 => {
                let kept = self.drive.objects.get(row);
                kept & !0x0780 | value & 0x0780
            }
            _ => pdo::check_write(&self.drive.objects, index, sub, value)?,
        };
        self.drive.objects.set(row, value);
        self.pdos.reconfigure(&self.drive.objects, index);
        self.monitoring
            .reconfigure(&self.drive.objects, index, self.now);
        self.moved_server |= index == 0x1201;
        self.drive.written(row, Channel::Sdo);
        Ok(())
    }
}

impl Objects for Access<'_> {
    fn upload(&mut self, address: Address, buffer: &mut [u8]) -> Result<usize, AbortCode> {
        let row = self.drive.objects.find(address)?;
        self.drive.publish(self.now);
        self.drive.objects.encode(row, buffer)
    }

    fn begin_download(
        &mut self,
        address: Address,
        size: Option<usize>,
    ) -> Result<usize, AbortCode> {
        let row = self.drive.objects.find(address)?;
        self.drive.objects.check_download(row, size)
    }

    fn download(&mut self, address: Address, data: &[u8]) -> Result<(), AbortCode> {
        let refused = self
            .refusals
            .iter()
            .find(|(refused, _)| *refused == address);
        if let Some((_, code)) = refused {
            return Err(*code);
        }
        let row = self.drive.objects.find(address)?;
        self.drive.objects.check_download(row, Some(data.len()))?;
        self.write(row, address, data)
    }
}
