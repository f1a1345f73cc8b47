//! By what the controller notices that a device is gone, and in what time; and what that device does when the controller
//! is. Nothing here is looked at in the cycle: it is told at start-up, and tests hold the machine against it.

use super::STILL;
use super::fault::{AxisIndex, DeviceIndex, Names};
use super::layout::{AxisSpec, DeviceSpec, Layout};
use super::polls::CONTRADICTIONS;
use crate::machine::{OutputSwitch, POLL, STATE_POLL};
use std::fmt;
use syncline_canopen::time::Duration;
use syncline_drives::model::{Address, Device, Monitoring, Setpoints};

/// What stays away when a device is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Its T_PDOs.
    TPdos,
    /// Its heartbeat.
    Heartbeat,
    /// Its answers to guarding.
    Guarding,
    /// Its answers to the requests for this object.
    Answers(Address),
    /// Its state, which it is asked for there: it has begun anew, and told nobody.
    State(Address),
}

/// How it shows that a device is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Notice {
    /// By what.
    pub sign: Sign,
    /// The longest time from the loss until it is a fault. Setpoints that react to it leave in the same cycle.
    pub within: Duration,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.sign {
            Sign::TPdos => write!(f, "missing T_PDOs")?,
            Sign::Heartbeat => write!(f, "a missing heartbeat")?,
            Sign::Guarding => write!(f, "guarding without an answer")?,
            Sign::Answers(object) => write!(f, "requests for {object} without an answer")?,
            Sign::State(object) => write!(f, "another state in {object}, where it begins anew,")?,
        }
        write!(f, " within {}", Millis(self.within))
    }
}

/// When an axis's encoder is held against its drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// At every SYNC.
    AtSync,
    /// Where the encoder has stood since the drive was asked, or the drive rests and has no target: it has no position of a SYNC.
    AtRest,
}

/// What becomes of an axis whose position is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extrapolation {
    /// The axis.
    pub axis: AxisIndex,
    /// For so long the axis is taken to go on as it is sent; what is missing then is a fault.
    pub lasts: Duration,
    /// By how much that may be wrong meanwhile, as velocities are sent in whole units of the drive, mm.
    pub off: f64,
    /// How far it goes meanwhile at its greatest velocity, mm.
    pub unseen: f64,
}

/// A time as people read it.
struct Millis(Duration);

impl fmt::Display for Millis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ms", self.0.as_secs_f64() * 1e3)
    }
}

impl Layout {
    /// The longest time from a fault that a device has and tells, by its state or an EMCY, until the controller sees it:
    /// what happens behind the sample of one SYNC is told at the next one that it answers and looked at in that cycle. The
    /// time that the device itself takes to find its fault comes on top.
    #[must_use]
    pub fn tells_within(&self, device: DeviceIndex) -> Duration {
        self.cycle * (self.devices[device].device.spec().sync_divider + 1)
    }

    /// By what it shows that a device is gone, the quickest first.
    pub fn notices(&self, device: DeviceIndex) -> impl Iterator<Item = Notice> {
        let device = &self.devices[device];
        let spec = device.device.spec();
        // What was lost just behind its answer to a SYNC is missed from the next one on, each time within the cycle.
        let t_pdos = Notice {
            sign: Sign::TPdos,
            within: self.cycle * (device.t_pdo_misses * spec.sync_divider + 1),
        };
        let after = |sign| Notice {
            sign,
            within: device.heartbeat_timeout + self.cycle,
        };
        let other = match spec.monitoring {
            Monitoring::TPdos => None,
            Monitoring::Heartbeat => Some(after(Sign::Heartbeat)),
            Monitoring::Guarding { .. } => Some(after(Sign::Guarding)),
            Monitoring::Poll(object) => Some(after(Sign::Answers(object))),
        };
        let survey = device.device.drive().and_then(|drive| drive.survey());
        let state = survey.filter(|_| matches!(spec.monitoring, Monitoring::Poll(_)));
        // The request under way when it went is given up first; each other one may wait for one of its position.
        let state = state.map(|survey| Notice {
            sign: Sign::State(survey.address),
            within: self.sdo_timeout + (STATE_POLL + POLL) * CONTRADICTIONS + self.cycle,
        });
        let t_pdos = spec.answers_sync.then_some(t_pdos);
        t_pdos.into_iter().chain(other).chain(state)
    }

    /// When an axis's encoder is held against its drives, and the longest time from where both are further apart than is
    /// allowed, and rest if they have to, until that is a fault: lost steps, a coupling that slips or is broken.
    #[must_use]
    pub fn comparison(&self, axis: AxisIndex) -> Option<(Compared, Duration)> {
        let axis = &self.axes[axis];
        let drives = axis
            .drives
            .iter()
            .map(|&drive| self.devices[drive].device.spec());
        // What one of them tells is as old as the SYNC that it answered last; the others answer each.
        let encoder = self.devices[axis.feedback?.encoder].device.spec();
        let dividers = drives.clone().chain([encoder]).map(|it| it.sync_divider);
        let older = self.cycle * (dividers.max().unwrap_or(1) - 1);
        let polled = drives.filter(|spec| !spec.answers_sync);
        let response = polled.map(|spec| spec.sdo_response).max();
        Some(
            response.map_or((Compared::AtSync, self.cycle * 2 + older), |response| {
                // The last position from before the rest is replaced by one that waited for an answer and has its own;
                // both requests wait for their turn in a cycle. What is left of the way then may take it out of the
                // standstill window around that one, once, so that its time of standing still begins anew. Where the rest
                // begins between two SYNCs it is seen a cycle later.
                let heard = POLL + (response + self.cycle) * 2;
                let stands = STILL.max(response) + self.cycle + older;
                (Compared::AtRest, heard + stands * 2 + self.cycle)
            }),
        )
    }

    /// By when an encoder finds that the drives of its axis are elsewhere.
    fn compares(&self, encoder: DeviceIndex) -> Option<String> {
        let watched = |axis: &AxisIndex| {
            (self.axes[*axis].feedback).is_some_and(|feedback| feedback.encoder == encoder)
        };
        let index = (0..self.axes.len()).find(watched)?;
        let axis = &self.axes[index];
        let (compared, within) = self.comparison(index)?;
        let at_rest = match compared {
            Compared::AtSync => "",
            Compared::AtRest => ", once both rest,",
        };
        Some(format!(
            "; a difference to the drives of axis {} above {} {} counts{at_rest} within {}",
            axis.name,
            axis.feedback?.difference,
            axis.unit,
            Millis(within)
        ))
    }

    /// How a device is supervised and what it does without the controller, as it is told at start-up.
    #[must_use]
    pub fn supervision(&self, device: DeviceIndex) -> String {
        let notices: Vec<String> = self.notices(device).map(|it| it.to_string()).collect();
        format!(
            "{}: {}what it tells counts within {}; its loss shows by {}; {}{}{}{}{}",
            self.who(device),
            match self.devices[device].device.spec().sync_divider {
                1 => String::new(),
                divider => format!("it tells its position every {divider} SYNCs; "),
            },
            Millis(self.tells_within(device)),
            notices.join(" or "),
            self.left_alone(device),
            self.deaf(device).unwrap_or_default(),
            self.compares(device).unwrap_or_default(),
            self.extrapolates(device).unwrap_or_default(),
            self.couples(device).unwrap_or_default(),
        )
    }

    /// How the second side of a gantry is coupled to the first one.
    fn couples(&self, device: DeviceIndex) -> Option<String> {
        let axis = self.axis_of(device)?;
        let it = axis
            .cross_coupling
            .filter(|_| axis.drives.last() == Some(&device))?;
        Some(format!(
            "; the sides of axis {} are coupled across, with a gain of {:.2} 1/s, up to {} allowed, and are sent apart by {} {} at the most",
            axis.name,
            it.gain,
            it.told_greatest(),
            it.limit,
            axis.unit
        ))
    }

    /// How a drive shows that it hears no R_PDOs any more, because something has taken it out of NMT Operational, where nothing
    /// tells its NMT state.
    fn deaf(&self, device: DeviceIndex) -> Option<String> {
        let spec = self.devices[device].device.spec();
        let is_told = !matches!(spec.monitoring, Monitoring::Poll(_)) || spec.answers_sync;
        let axis = self.axis_of(device).filter(|_| !is_told)?;
        let AxisSpec { name, unit, .. } = axis;
        Some(if axis.point_to_point {
            format!(
                "; out of NMT Operational it answers as before, and shows it by its next target, which it does not \
                 acknowledge within {}",
                Millis(self.state_timeout)
            )
        } else {
            let least = axis.limits.following_error_at_rest;
            let most = axis.limits.following_error;
            format!(
                "; out of NMT Operational it answers as before and goes on with its last velocity, and shows it once axis \
                 {name} is to have another one, by a following error of {least} to {most} {unit}"
            )
        })
    }

    /// What is made of a position that is missing, of a device by which the controller closes a loop.
    fn extrapolates(&self, device: DeviceIndex) -> Option<String> {
        let it = self.extrapolation(device)?;
        let AxisSpec { name, unit, .. } = &self.axes[it.axis];
        Some(format!(
            "; while its position is missing, for up to {}, axis {name} is taken to go on as it is sent, at the most \
             {:.4} {unit} off by the drive's unit of velocity, and goes up to {:.1} {unit} unseen",
            Millis(it.lasts),
            it.off,
            it.unseen,
        ))
    }

    /// For how long the position of an axis is extrapolated that a device tells and about which the controller closes a
    /// loop, and what that leaves open; `None` where it is not.
    #[must_use]
    pub fn extrapolation(&self, device: DeviceIndex) -> Option<Extrapolation> {
        let spec = &self.devices[device];
        let lasts = self.cycle * (spec.t_pdo_misses * spec.device.spec().sync_divider - 1);
        let seconds = lasts.as_secs_f64();
        let mut axes = self.axes.iter().enumerate();
        axes.find_map(|(axis, spec)| {
            let encoder = spec.feedback.filter(|it| it.closes_loop);
            let tells = |&&drive: &&DeviceIndex| encoder.map_or(drive, |it| it.encoder) == device;
            let drive = spec.drives.iter().find(tells)?;
            let drive = &self.devices[*drive];
            let dynamics = drive.device.drive()?.dynamics()?;
            let quantum = dynamics.quantum * drive.scaling.resolution();
            (!lasts.is_zero() && !spec.point_to_point).then_some(Extrapolation {
                axis,
                lasts,
                off: 0.5 * quantum * seconds,
                unseen: spec.limits.velocity * seconds,
            })
        })
    }

    /// What a device does when the controller dies.
    fn left_alone(&self, index: DeviceIndex) -> String {
        let DeviceSpec {
            device,
            heartbeat_timeout,
            ..
        } = &self.devices[index];
        let timeout = Millis(*heartbeat_timeout);
        let monitoring = device.spec().monitoring;
        let sign = match monitoring {
            Monitoring::Guarding { .. } => "guarding request",
            _ => "heartbeat",
        };
        match device {
            Device::Drive(_) if monitoring.is_mutual() => {
                format!(
                    "it stops by itself {timeout} after the last {sign} that it hears of the controller"
                )
            }
            Device::Drive(_) if self.axis_of(index).is_some_and(|it| it.point_to_point) => {
                "a dead controller it does not notice, goes on to its target and rests there".into()
            }
            Device::Drive(_) if device.spec().model.is_sent(Setpoints::Positions) => {
                "a dead controller it does not notice, and rests where it was sent last".into()
            }
            Device::Drive(_) => format!(
                "a dead controller it does not notice, and goes on with its last velocity until {}",
                self.chain_opens()
            ),
            Device::Io(_) if self.switches(index) => format!(
                "its outputs are safe {timeout} after the last heartbeat that it hears of the controller, by its own error mode"
            ),
            Device::Io(_) | Device::Encoder(_) => "it moves nothing".into(),
        }
    }

    /// How the enable chain opens when the controller dies.
    fn chain_opens(&self) -> String {
        let mut outputs = self.outputs.iter();
        let chain = outputs.find(|output| output.switch == OutputSwitch::EnableChain);
        chain.map_or("something else stops it".into(), |chain| {
            let timeout = Millis(self.devices[chain.node].heartbeat_timeout);
            let who = self.who(chain.node);
            format!(
                "the enable chain opens: by {who}, {timeout} after the last heartbeat that it hears"
            )
        })
    }

    fn axis_of(&self, drive: DeviceIndex) -> Option<&AxisSpec> {
        self.axes.iter().find(|axis| axis.drives.contains(&drive))
    }

    /// Whether the machine has an output at an I/O node.
    fn switches(&self, node: DeviceIndex) -> bool {
        let mut digital = self.outputs.iter().map(|output| output.node);
        let mut analog = self.analog_outputs.iter().map(|output| output.node);
        digital.any(|it| it == node) || analog.any(|it| it == node)
    }
}
