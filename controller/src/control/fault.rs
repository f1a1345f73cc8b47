//! Why the machine stopped. Plain numbers and indices: a fault is raised inside the cycle, the
//! text is made outside of it by [`Fault::describe`].

use super::NO_PLAN;
use std::fmt;
use syncline_canopen::NodeId;
use syncline_canopen::cia402::Statusword;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::nmt;
use syncline_canopen::sdo::AbortCode;
use syncline_drives::model::{Address, NotFollowing};

/// A drive by its place in the machine file.
pub type DriveIndex = usize;
/// An axis by its place in the machine file.
pub type AxisIndex = usize;
/// A bus by its place in the machine file.
pub type BusIndex = usize;

/// What stopped the machine. It stays stopped until a person starts it again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// A drive did not send its boot-up message after the reset.
    NoBootUp {
        /// Which drive.
        drive: DriveIndex,
    },
    /// An object that identifies the device has another value than the configured model.
    WrongIdentity {
        /// Which drive.
        drive: DriveIndex,
        /// The object.
        object: Address,
        /// Its name.
        name: &'static str,
        /// What the model has there.
        expected: u32,
        /// What the device answered.
        found: u32,
    },
    /// A drive refused an SDO transfer.
    SdoAborted {
        /// Which drive.
        drive: DriveIndex,
        /// The object.
        object: Address,
        /// The value written; none for a read.
        value: Option<u32>,
        /// The drive's reason.
        code: AbortCode,
    },
    /// A drive did not answer an SDO request, retries included.
    SdoTimeout {
        /// Which drive.
        drive: DriveIndex,
        /// The object.
        object: Address,
    },
    /// A set-up value reads back as something else.
    ReadBack {
        /// Which drive.
        drive: DriveIndex,
        /// The object.
        object: Address,
        /// What was written.
        expected: u32,
        /// What came back.
        found: u32,
    },
    /// A drive found enabled at the start would not let itself be disabled.
    StaysEnabled {
        /// Which drive.
        drive: DriveIndex,
        /// Its last statusword.
        statusword: Statusword,
    },
    /// A drive did not synchronise its interpolation clock to SYNC in time.
    NoSyncLock {
        /// Which drive.
        drive: DriveIndex,
        /// The last status it reported.
        status: u32,
        /// The model's assumption that says which status it should be.
        assumption: &'static str,
    },
    /// A drive did not reach the state that its controlword asks for.
    StateTimeout {
        /// Which drive.
        drive: DriveIndex,
        /// What it should have reached.
        awaited: AwaitedState,
        /// Its last statusword.
        statusword: Statusword,
    },
    /// A drive did not come to rest, so that its setpoint could not be frozen.
    NotAtRest {
        /// Which drive.
        drive: DriveIndex,
    },
    /// A drive runs another operating mode than the one selected.
    WrongMode {
        /// Which drive.
        drive: DriveIndex,
        /// The object that says which mode runs.
        object: Address,
        /// Its value.
        found: i8,
    },
    /// An axis stands outside its soft limits at the start.
    OutsideSoftLimits {
        /// Which axis.
        axis: AxisIndex,
        /// Where it stands, mm.
        position: f64,
    },
    /// A drive's position is not within the range of the axis' conversion.
    PositionRange {
        /// Which drive.
        drive: DriveIndex,
    },
    /// The two sides of a gantry axis are further apart than allowed.
    Skew {
        /// Which axis.
        axis: AxisIndex,
        /// The difference, mm.
        difference: f64,
    },
    /// An axis left its frozen position before the program.
    Standstill {
        /// Which axis.
        axis: AxisIndex,
        /// Distance from the frozen position, mm.
        distance: f64,
    },
    /// An axis lags its setpoint by more than allowed.
    FollowingError {
        /// Which axis.
        axis: AxisIndex,
        /// Setpoint minus actual position, mm.
        error: f64,
    },
    /// A drive sent an EMCY message.
    Emergency {
        /// Which drive.
        drive: DriveIndex,
        /// What it says.
        emergency: Emergency,
    },
    /// A statusword shows a fault.
    DriveFault {
        /// Which drive.
        drive: DriveIndex,
        /// The statusword.
        statusword: Statusword,
    },
    /// A drive does not follow its setpoints any longer without having been told so.
    NotFollowing {
        /// Which drive.
        drive: DriveIndex,
        /// The statusword.
        statusword: Statusword,
        /// What it says.
        why: NotFollowing,
    },
    /// Two devices share a drive's node id: two T_PDOs came to one SYNC, in two cycles in a row.
    TwoNodes {
        /// Which drive.
        drive: DriveIndex,
    },
    /// A drive's heartbeat stayed away.
    HeartbeatLost {
        /// Which drive.
        drive: DriveIndex,
    },
    /// A drive reports another NMT state than Operational.
    NmtState {
        /// Which drive.
        drive: DriveIndex,
        /// The state that its heartbeat carried, if any came.
        state: Option<nmt::State>,
    },
    /// A drive booted in the middle of the run.
    Rebooted {
        /// Which drive.
        drive: DriveIndex,
    },
    /// A drive's T_PDO stayed away.
    MissingTPdo {
        /// Which drive.
        drive: DriveIndex,
        /// Cycles in a row.
        misses: u32,
    },
    /// Too many bursts were dropped or late.
    LateSetpoints {
        /// Which bus.
        bus: BusIndex,
        /// Bursts that missed their SYNC so far.
        count: u64,
    },
    /// A burst left in part: the axes of one cycle no longer act together.
    TornBurst {
        /// Which bus.
        bus: BusIndex,
    },
    /// The adapter of a bus counted so many errors that it may soon leave the bus.
    BusErrorPassive {
        /// Which bus.
        bus: BusIndex,
    },
    /// The interface of a bus failed; its message is in the event log.
    BusFailed {
        /// Which bus.
        bus: BusIndex,
    },
    /// The cycle woke up too late, and the run is strict about it.
    LateWakeUp {
        /// How late, ns.
        late_ns: u64,
    },
    /// The program could not go on; its message is in the event log.
    Program,
    /// The path rested in mid-program, nobody held it, and nothing more of its plan came.
    NoPlan,
}

/// What a drive was told to reach and has to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AwaitedState {
    /// Power stage off.
    Disabled,
    /// Ready to be enabled.
    Ready,
    /// Power stage on, in control.
    Enabled,
    /// Operating mode started.
    ModeStarted,
    /// Operating mode ended.
    ModeEnded,
}

impl fmt::Display for AwaitedState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Disabled => "power stage off",
            Self::Ready => "Ready To Switch On",
            Self::Enabled => "Operation Enabled",
            Self::ModeStarted => "operating mode started (bit 12 = 1)",
            Self::ModeEnded => "operating mode ended (bit 12 = 0)",
        })
    }
}

/// Names and limits that a fault's text needs.
pub trait Names {
    /// A drive's node id, name and model.
    fn drive(&self, drive: DriveIndex) -> (NodeId, &str, &str);
    /// An axis.
    fn axis(&self, axis: AxisIndex) -> &super::layout::Axis;
    /// A bus' name.
    fn bus(&self, bus: BusIndex) -> &str;
    /// The name of one of a drive's digital inputs or outputs.
    fn signal(&self, drive: DriveIndex, signal: usize) -> &str;
    /// What the bytes that its maker adds to a drive's EMCY say, if anything.
    fn vendor_error(&self, drive: DriveIndex, bytes: [u8; 5]) -> Option<String>;
}

/// `, vendor error B404h: its meaning`, or nothing.
pub(super) fn vendor_error(names: &impl Names, drive: DriveIndex, emergency: &Emergency) -> String {
    let error = names.vendor_error(drive, emergency.vendor);
    error.map_or_else(String::new, |error| format!(", {error}"))
}

impl Fault {
    /// What happened, to whom, and what to do next, in words.
    #[must_use]
    pub fn describe(&self, names: &impl Names) -> String {
        let who = |drive| {
            let (node, name, model) = names.drive(drive);
            format!("node {node} ({name}, {model})")
        };
        match *self {
            Self::NoBootUp { drive } => format!(
                "{}: no boot-up message after the reset: check power, cabling, node id and bit rate",
                who(drive)
            ),
            Self::WrongIdentity {
                drive,
                object,
                name,
                expected,
                found,
            } => format!(
                "{}: object {object} ({name}) reads {found:08X}h, expected {expected:08X}h: another \
                 device has this node id, or it is not what the machine file says",
                who(drive)
            ),
            Self::SdoAborted {
                drive,
                object,
                value: Some(value),
                code,
            } => format!(
                "{}: SDO write {object} = {value} aborted {code}: check the value, and `sdo` in the \
                 machine file",
                who(drive)
            ),
            Self::SdoAborted {
                drive,
                object,
                value: None,
                code,
            } => format!(
                "{}: SDO read {object} aborted {code}: check that the device is the model of the \
                 machine file",
                who(drive)
            ),
            Self::SdoTimeout { drive, object } => format!(
                "{}: no answer to SDO {object}: check that the drive is on the bus",
                who(drive)
            ),
            Self::ReadBack {
                drive,
                object,
                expected,
                found,
            } => format!(
                "{}: object {object} reads back {found} ({found:X}h), expected {expected} \
                 ({expected:X}h): check for another master or tool, and the drive's firmware",
                who(drive)
            ),
            Self::StaysEnabled { drive, statusword } => format!(
                "{}: found enabled and does not switch off, statusword {statusword}: switch it \
                 off by hand",
                who(drive)
            ),
            Self::NoSyncLock {
                drive,
                status,
                assumption,
            } => format!(
                "{}: not synchronised to SYNC, status {status}: check the cycle time and the \
                 model's `{assumption}`",
                who(drive)
            ),
            Self::StateTimeout {
                drive,
                awaited,
                statusword,
            } => format!(
                "{}: expected {awaited}, statusword stays {statusword}: check supply, enable \
                 inputs and the drive's error memory",
                who(drive)
            ),
            Self::NotAtRest { drive } => format!(
                "{}: does not come to rest once enabled: check its loop and what moves its axis, \
                 or `standstill_window`",
                who(drive)
            ),
            Self::WrongMode {
                drive,
                object,
                found,
            } => format!(
                "{}: operating mode {object} reads {found}, not the one selected: check for another \
                 master or tool that selects one",
                who(drive)
            ),
            Self::OutsideSoftLimits { axis, position } => {
                let axis = names.axis(axis);
                let (least, most) = axis.limits.position;
                format!(
                    "axis {} stands at {position:.3} {unit}, outside its soft limits {least}…{most} \
                     {unit}: move it inside, or check the drive's `zero`",
                    axis.name,
                    unit = axis.unit
                )
            }
            Self::PositionRange { drive } => format!(
                "{}: setpoint outside the drive's position range: check `zero` and the travel",
                who(drive)
            ),
            Self::Skew { axis, difference } => {
                let axis = names.axis(axis);
                format!(
                    "axis {}: its two sides are {difference:.3} {unit} apart, allowed {} {unit}: align \
                     the gantry, or check the drives' `zero`",
                    axis.name,
                    axis.limits.skew.unwrap_or(f64::INFINITY),
                    unit = axis.unit
                )
            }
            Self::Standstill { axis, distance } => {
                let axis = names.axis(axis);
                format!(
                    "axis {} left its frozen position by {distance:.4} {unit}, allowed {} {unit}: \
                     check its brake, its loop and `standstill_window`",
                    axis.name,
                    axis.limits.standstill,
                    unit = axis.unit
                )
            }
            Self::FollowingError { axis, error } => {
                let axis = names.axis(axis);
                format!(
                    "axis {}: following error {error:.4} {unit}, allowed {} {unit}: look for a \
                     blocked axis, a weak loop or too high limits",
                    axis.name,
                    axis.limits.following_error,
                    unit = axis.unit
                )
            }
            Self::Emergency { drive, emergency } => {
                format!(
                    "{}: EMCY {:04X}h, error register {:02X}h{}",
                    who(drive),
                    emergency.code,
                    emergency.register,
                    vendor_error(names, drive, &emergency)
                )
            }
            Self::DriveFault { drive, statusword } => {
                format!(
                    "{}: drive fault, statusword {statusword}: read its error memory, clear the \
                     cause, start again",
                    who(drive)
                )
            }
            Self::NotFollowing {
                drive,
                statusword,
                why,
            } => format!(
                "{}: {why}, statusword {statusword}: check the drive's inputs and its error memory",
                who(drive)
            ),
            Self::TwoNodes { drive } => format!(
                "{}: two T_PDOs to one SYNC: another device has this node id, give it one of its own",
                who(drive)
            ),
            Self::HeartbeatLost { drive } => {
                format!("{}: heartbeat lost: check cabling and supply", who(drive))
            }
            Self::NmtState {
                drive,
                state: Some(state),
            } => format!(
                "{}: NMT state is {state:?}, expected Operational: check for another NMT master and \
                 for communication errors",
                who(drive)
            ),
            Self::NmtState { drive, state: None } => {
                format!(
                    "{}: no heartbeat after NMT start: check cabling and bus load",
                    who(drive)
                )
            }
            Self::Rebooted { drive } => {
                format!(
                    "{}: booted in the middle of the run: check its supply and for another NMT \
                     master",
                    who(drive)
                )
            }
            Self::MissingTPdo { drive, misses } => format!(
                "{}: no T_PDO in {misses} cycles in a row: check the bus load and the drive",
                who(drive)
            ),
            Self::LateSetpoints { bus, count } => format!(
                "bus {}: setpoints missed their SYNC {count} times: this host or bus does not \
                 hold the cycle",
                names.bus(bus)
            ),
            Self::TornBurst { bus } => format!(
                "bus {}: only a part of one cycle's setpoints could be queued: see `syncline doctor` \
                 for the transmit queue",
                names.bus(bus)
            ),
            Self::BusErrorPassive { bus } => format!(
                "bus {}: error passive, more than 127 errors: check cable, termination and bit rate",
                names.bus(bus)
            ),
            Self::BusFailed { bus } => format!(
                "bus {}: the interface failed, drives out of reach stop by lost heartbeat: mend what \
                 its message says, start again",
                names.bus(bus)
            ),
            Self::LateWakeUp { late_ns } => format!(
                "the cycle woke up {:.3} ms late, and --strict allows none",
                late_ns as f64 * 1e-6
            ),
            Self::Program => {
                "the program could not go on: see its message, mend it, start again".to_owned()
            }
            Self::NoPlan => format!(
                "the path rests in mid-program, nobody holds it, and no plan came for {} s: this is \
                 a defect of syncline, please report it with the machine, the program and what was \
                 done",
                NO_PLAN.as_secs()
            ),
        }
    }
}
