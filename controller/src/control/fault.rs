//! Why the machine stopped: whom it concerns, and the cause. Plain numbers and indices, because a
//! fault is raised inside the cycle; the text is made outside of it by [`Fault::describe`]. A
//! cause's text stands at the cause, and says what came, what was expected and what to do next.

use super::NO_PLAN;
use super::homing::HomingFailure;
use super::inputs::InputIndex;
use super::layout::AxisSpec;
use super::probing::ProbeFailure;
use super::setpoint_guard::Quantity;
use super::threading::ThreadFailure;
use std::fmt;
use strum::VariantNames;
use syncline_canopen::NodeId;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::nmt;
use syncline_canopen::sdo::AbortCode;
use syncline_drives::model::{Address, NotFollowing, StatusWord};
use thiserror::Error;

/// A device by its place in the machine file: the drives, behind them the encoders, behind those the I/O nodes.
pub type DeviceIndex = usize;
/// An axis by its place in the machine file.
pub type AxisIndex = usize;
/// A bus by its place in the machine file.
pub type BusIndex = usize;

/// What stopped the machine: a subject and what it did. Subjects that can do but one thing have no causes of their own. The
/// machine stays stopped until a person starts it again.
#[derive(Clone, Copy, Debug, PartialEq, VariantNames)]
pub enum Fault {
    /// A device, or what has its node id.
    Device(DeviceIndex, DeviceCause),
    /// An axis.
    Axis(AxisIndex, AxisCause),
    /// A bus.
    Bus(BusIndex, BusCause),
    /// The spindle.
    Spindle(SpindleCause),
    /// A block of the program, by its line.
    Block(u32, BlockCause),
    /// The cycle woke up too late, and the run is strict about it.
    LateWakeUp {
        /// How late, ns.
        late_ns: u64,
    },
    /// The program could not go on; its message is in the event log.
    Program,
    /// An external enable is off.
    NotEnabled {
        /// Which input.
        input: InputIndex,
    },
    /// The probe touched something, or a tool the tool setter, while the axes moved for something else.
    Touched,
    /// The probe, or the tool setter, was moved on beyond `overtravel` in contact.
    Pressed,
    /// The path rested in mid-program, nobody held it, and nothing more of its plan came.
    NoPlan,
}

/// What a device did, or did not do.
#[derive(Clone, Copy, Debug, PartialEq, Error, VariantNames)]
pub enum DeviceCause {
    /// It did not send its boot-up message after the reset.
    #[error("no boot-up message after the reset: check power, cabling, node id and bit rate")]
    NoBootUp,
    /// It did not answer an SDO request after the reset, by which it would show that it has booted.
    #[error("no answer after the reset: check power, cabling, node id and bit rate")]
    NoAnswer,
    /// An object that identifies the device has another value than the configured model.
    #[error(
        "object {object} ({name}) reads {found:08X}h, expected {expected:08X}h: another device has \
         this node id, or it is not what the machine file says"
    )]
    WrongIdentity {
        /// The object.
        object: Address,
        /// Its name.
        name: &'static str,
        /// What the model has there.
        expected: u32,
        /// What the device answered.
        found: u32,
    },
    /// It refused to have an object written.
    #[error(
        "SDO write {object} = {value} aborted {code}: check the value, and `sdo` in the machine file"
    )]
    WriteAborted {
        /// The object.
        object: Address,
        /// The value.
        value: u32,
        /// Its reason.
        code: AbortCode,
    },
    /// It refused to have an object read.
    #[error("SDO read {object} aborted {code}: {remedy}")]
    ReadAborted {
        /// The object.
        object: Address,
        /// Its reason.
        code: AbortCode,
        /// What to do.
        remedy: &'static str,
    },
    /// It answered an SDO request with what is no answer to it.
    #[error(
        "SDO {object} answered wrongly, {code}: check for another master or tool that talks to it, and \
         the device's firmware"
    )]
    WrongAnswer {
        /// The object.
        object: Address,
        /// What was wrong with it, which the device was told.
        code: AbortCode,
    },
    /// It did not answer an SDO request, retries included.
    #[error("no answer to SDO {object}: check that the device is on the bus")]
    SdoTimeout {
        /// The object.
        object: Address,
    },
    /// A set-up value reads back as something else.
    #[error(
        "object {object} reads back {found} ({found:X}h), expected {expected} ({expected:X}h): check \
         for another master or tool, and the device's firmware"
    )]
    ReadBack {
        /// The object.
        object: Address,
        /// What was written.
        expected: u32,
        /// What came back.
        found: u32,
    },
    /// Found enabled at the start, it would not let itself be disabled.
    #[error("found enabled and does not switch off, {word}: switch it off by hand")]
    StaysEnabled {
        /// What it said last.
        word: StatusWord,
    },
    /// It did not synchronise its interpolation clock to SYNC in time.
    #[error(
        "not synchronised to SYNC, status {status}: check the cycle time and the model's \
         `{assumption}`"
    )]
    NoSyncLock {
        /// The last status it reported.
        status: u32,
        /// The model's assumption that says which status it should be.
        assumption: &'static str,
    },
    /// It did not reach the state that it was commanded to.
    #[error(
        "expected {awaited}, stays at {word}: check supply, enable inputs and the drive's error \
         memory"
    )]
    StateTimeout {
        /// What it should have reached.
        awaited: AwaitedState,
        /// What it said last.
        word: StatusWord,
    },
    /// It did not come to rest, so that its setpoint could not be frozen.
    #[error(
        "does not come to rest once enabled: check its loop and what moves its axis, or \
         `standstill_window`"
    )]
    NotAtRest,
    /// It runs another operating mode than the one selected.
    #[error(
        "operating mode {object} reads {found}, expected {expected}: check for another master or tool \
         that selects one"
    )]
    WrongMode {
        /// The object that says which mode runs.
        object: Address,
        /// The mode that was selected.
        expected: i8,
        /// The object's value.
        found: i8,
    },
    /// Its position is not within the range of the axis's conversion.
    #[error("setpoint outside the drive's position range: check `zero` and the travel")]
    PositionRange,
    /// It sent an EMCY message.
    #[error("EMCY {:04X}h, error register {:02X}h", .emergency.code, .emergency.register)]
    Emergency {
        /// What it says.
        emergency: Emergency,
    },
    /// It says that it has a fault.
    #[error("drive fault, {word}: read its error memory, and clear its cause")]
    Reported {
        /// What it says of itself.
        word: StatusWord,
    },
    /// It does not follow its setpoints any longer without having been told so.
    #[error("{why}, {word}: check the drive's inputs and its error memory")]
    NotFollowing {
        /// What it says of itself.
        word: StatusWord,
        /// What it says.
        why: NotFollowing,
    },
    /// A second T_PDO came to one SYNC, with other data than the first: which of them is true nobody knows, and the
    /// second one was not taken. One that answered behind the next SYNC for longer than two of them, and catches up, looks
    /// the same: in between each SYNC had its answer.
    #[error(
        "a second T_PDO to one SYNC, with other data than the first: another device has this node id, give it one of \
         its own; or something else on the bus has changed when it sends: let only one controller set it up; or it was \
         late by a whole cycle for longer: check the load of the bus"
    )]
    SecondTPdo,
    /// Two devices share its node id: the same T_PDO came twice to one SYNC, in two cycles in a row.
    #[error("two T_PDOs to one SYNC: another device has this node id, give it one of its own")]
    TwoNodes,
    /// Its heartbeat stayed away.
    #[error("heartbeat lost: check cabling and supply")]
    HeartbeatLost,
    /// It did not answer guarding.
    #[error(
        "no answer to guarding: check cabling and supply, and that the bus carries remote frames, which a socketcand does not"
    )]
    GuardingUnanswered,
    /// It has no heartbeat, and did not answer the requests that are sent instead.
    #[error("no answer to the polls of {object} any more: check cabling and supply")]
    PollUnanswered {
        /// The object that is read.
        object: Address,
    },
    /// No heartbeat has carried an NMT state since it was to start.
    #[error(
        "no heartbeat that tells its NMT state, expected Operational: check cabling and bus load"
    )]
    NoNmtState,
    /// Its heartbeat carries a number that is no NMT state.
    #[error(
        "heartbeat says {byte:02X}h, which is no NMT state, expected 05h, Operational: check for a master \
         that guards it, which sets the highest bit, and the device's firmware"
    )]
    UnknownNmtState {
        /// The number.
        byte: u8,
    },
    /// Its heartbeat carries another NMT state than Operational.
    #[error(
        "NMT state is {state:?}, expected Operational: check for another NMT master and for \
         communication errors"
    )]
    NmtState {
        /// The state.
        state: nmt::State,
    },
    /// It booted in the middle of the run.
    #[error("booted in the middle of the run: check its supply and for another NMT master")]
    Rebooted,
    /// Its T_PDO stayed away.
    #[error("no T_PDO in {misses} cycles in a row: check the bus load and the device")]
    MissingTPdo {
        /// Cycles in a row.
        misses: u32,
    },
}

impl DeviceCause {
    /// Whether the device is not heard any more: what it said before need not be true of it.
    pub(super) fn is_silence(&self) -> bool {
        matches!(
            self,
            Self::NoBootUp
                | Self::NoAnswer
                | Self::HeartbeatLost
                | Self::GuardingUnanswered
                | Self::PollUnanswered { .. }
                | Self::NoNmtState
                | Self::MissingTPdo { .. }
        )
    }

    /// Whether the device may hear no R_PDOs any more: it is silent, or not in Operational, as behind its boot-up, or does not do
    /// what it is told by R_PDO.
    #[must_use]
    pub(super) fn may_not_hear(&self) -> bool {
        let is_elsewhere = matches!(
            self,
            Self::NmtState { .. } | Self::UnknownNmtState { .. } | Self::Rebooted
        );
        is_elsewhere || matches!(self, Self::StateTimeout { .. }) || self.is_silence()
    }
}

/// What an axis did.
#[derive(Clone, Copy, Debug, PartialEq, VariantNames)]
pub enum AxisCause {
    /// It is not referenced, which the program needs.
    Unreferenced,
    /// It could not be homed before the program.
    Homing(HomingFailure),
    /// It stands outside its soft limits at the start.
    OutsideSoftLimits {
        /// Where it stands, mm.
        position: f64,
    },
    /// The two sides of a gantry are further apart than allowed.
    Skew {
        /// The difference, mm.
        difference: f64,
    },
    /// It left its frozen position before the program.
    Standstill {
        /// Distance from the frozen position, mm.
        distance: f64,
    },
    /// It lags its setpoint by more than allowed.
    FollowingError {
        /// Setpoint minus actual position, mm.
        error: f64,
        /// What was allowed at its speed, mm.
        allowed: f64,
    },
    /// In its test move it went another way than its drive was sent.
    TestMove {
        /// So many times as far; below 0 to the other side.
        factor: f64,
    },
    /// An actual position changed by more than an axis can move meanwhile.
    Jump {
        /// By how much, mm.
        distance: f64,
        /// What was possible, mm.
        possible: f64,
    },
    /// A setpoint of a drive was beyond a limit of its axis, and was not sent.
    SetpointGuard {
        /// The drive.
        drive: DeviceIndex,
        /// What of it.
        quantity: Quantity,
        /// How much: by mm and s; of a position, how far beyond its range.
        value: f64,
        /// It is one of a trajectory that others have planned.
        sampled: bool,
    },
    /// Its drive was sent to a target and did not get there in time.
    NotThere {
        /// How far it is from there, mm.
        distance: f64,
        /// Its drive has told that it is there.
        told: bool,
    },
    /// Its drive was sent to a target and did not acknowledge it.
    NotAcknowledged {
        /// For how long, s.
        time: f64,
    },
    /// Its drive was told to halt on its way to a target and did not come to rest.
    NotHalted {
        /// For how long, s.
        time: f64,
    },
    /// A limit switch of its own is on that forbids its motion.
    LimitSwitch {
        /// The switch.
        input: InputIndex,
        /// It is the one at the positive end.
        positive: bool,
        /// It came on while the axis moved away from it.
        moving_away: bool,
    },
    /// Its encoder and its drives disagree about where it is.
    FeedbackDifference {
        /// The encoder's position minus the drives', mm.
        difference: f64,
    },
    /// Homed again, it was not where it believed to be: it has lost steps, or its coupling has slipped.
    ReferenceMoved {
        /// Where it believed to be minus where it was, mm.
        difference: f64,
    },
}

/// What the spindle did, which its drive turns.
#[derive(Clone, Copy, Debug, PartialEq, Error, VariantNames)]
pub enum SpindleCause {
    /// It fell away from its speed while the path cut.
    #[error(
        "the spindle turned with {speed:.0} 1/min in a cut, told were {told:.0} ± {allowed:.0} 1/min: look for what \
         holds it back, tool, feed and depth of the cut, and at its drive"
    )]
    Speed {
        /// How fast it turned, 1/min, negative counterclockwise.
        speed: f64,
        /// What it was told.
        told: f64,
        /// By how much it might differ, 1/min.
        allowed: f64,
    },
    /// It was turned away from the angle that it was oriented to, while the path moved.
    #[error(
        "the oriented spindle was {off:.2}° away from its angle, allowed is {allowed}°, while axes moved: look for \
         what turns it, and at its drive"
    )]
    Angle {
        /// By how much, degrees, negative counterclockwise.
        off: f64,
        /// By how much it might, degrees.
        allowed: f64,
    },
}

/// Why a block of the program could not be executed.
#[derive(Clone, Copy, Debug, PartialEq, VariantNames)]
pub enum BlockCause {
    /// It could not probe.
    Probing(ProbeFailure),
    /// It could not cut a thread.
    Thread(ThreadFailure),
}

/// What went wrong with a bus.
#[derive(Clone, Copy, Debug, PartialEq, Error, VariantNames)]
pub enum BusCause {
    /// Too many bursts were dropped or late.
    #[error(
        "setpoints missed their SYNC {count} times: this host or bus does not hold the cycle; look at `syncline doctor` \
         and `syncline bench cycle`, or take a longer `cycle_us`"
    )]
    LateSetpoints {
        /// Bursts that missed their SYNC so far.
        count: u64,
    },
    /// A burst left in part: the axes of one cycle no longer act together.
    #[error(
        "only a part of one cycle's setpoints could be queued: see `syncline doctor` for the \
         transmit queue"
    )]
    TornBurst,
    /// The adapter counted so many errors that it may soon leave the bus.
    #[error("error passive, more than 127 errors: check cable, termination and bit rate")]
    ErrorPassive,
    /// SYNC came that this controller did not send.
    #[error(
        "SYNC comes from another node, too: drives take their setpoints at its instants; stop that node from \
         producing SYNC (bit 30 of its 1005h), or the other master"
    )]
    SecondSync,
    /// NMT commands came that this controller did not send.
    #[error(
        "another master commands devices, too ({request}): only one may start and stop them; end the other tool or master, \
         then reset"
    )]
    SecondNmtMaster {
        /// What it commanded.
        request: nmt::Request,
    },
    /// A node sends under the node id that is the controller's.
    #[error(
        "another node sends with the controller's node id {node}, and drives take its life for the controller's: \
         give it another one, or the controller by `node` in the machine file"
    )]
    SecondController {
        /// Which id that is.
        node: NodeId,
    },
    /// The interface failed; its message is in the event log.
    #[error(
        "the interface failed, drives out of reach stop by lost heartbeat: mend what its message \
         says"
    )]
    Failed,
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
            Self::Ready => "ready to be enabled",
            Self::Enabled => "power stage on",
            Self::ModeStarted => "operating mode started",
            Self::ModeEnded => "operating mode ended",
        })
    }
}

/// Names and limits that a fault's text needs.
pub trait Names {
    /// A device's node id, name and model.
    fn device(&self, device: DeviceIndex) -> (NodeId, &str, &str);
    /// An axis.
    fn axis(&self, axis: AxisIndex) -> &AxisSpec;
    /// A bus' name.
    fn bus(&self, bus: BusIndex) -> &str;
    /// The name of one of a device's digital inputs or outputs.
    fn signal(&self, device: DeviceIndex, signal: usize) -> &str;

    /// The name of an input of the machine.
    fn input(&self, input: InputIndex) -> &str;
    /// The name of an output of the machine.
    fn output(&self, output: usize) -> &str;
    /// The name of an analog output of the machine.
    fn analog_output(&self, output: usize) -> &str;
    /// What the bytes that its maker adds to a device's EMCY say, if anything.
    fn vendor_error(&self, device: DeviceIndex, bytes: [u8; 5]) -> Option<String>;

    /// Whether it is the drive of the spindle.
    fn turns_spindle(&self, device: DeviceIndex) -> bool;

    /// A device as messages call it: `node 3 (Y, LXM32M)`.
    fn who(&self, device: DeviceIndex) -> String {
        let (node, name, model) = self.device(device);
        format!("node {node} ({name}, {model})")
    }

    /// The same, and what it does besides moving an axis: `the spindle's drive, node 20 (spindle, …)`.
    fn subject(&self, device: DeviceIndex) -> String {
        let who = self.who(device);
        match self.turns_spindle(device) {
            true => format!("the spindle's drive, {who}"),
            false => who,
        }
    }

    /// `, vendor error B404h: its meaning`, or nothing.
    fn vendor_part(&self, device: DeviceIndex, emergency: &Emergency) -> String {
        let error = self.vendor_error(device, emergency.vendor);
        error.map_or_else(String::new, |error| format!(", {error}"))
    }
}

impl Fault {
    /// Of a fault that is a value beyond a limit: both, and their unit.
    #[must_use]
    pub fn excess(&self, names: &impl Names) -> Option<(f64, f64, &'static str)> {
        let (axis, cause) = match *self {
            Self::Axis(axis, cause) => (axis, cause),
            Self::Spindle(SpindleCause::Speed {
                speed,
                told,
                allowed,
            }) => return Some(((speed - told).abs(), allowed, "1/min")),
            Self::Spindle(SpindleCause::Angle { off, allowed }) => {
                return Some((off.abs(), allowed, "°"));
            }
            _ => return None,
        };
        let AxisSpec { limits, unit, .. } = names.axis(axis);
        let (value, limit) = match cause {
            AxisCause::FollowingError { error, allowed } => (error.abs(), allowed),
            AxisCause::Jump { distance, possible } => (distance, possible),
            AxisCause::SetpointGuard {
                quantity, value, ..
            } => return Some((value, quantity.limit(limits), quantity.unit(unit))),
            AxisCause::Skew { difference } => (difference, limits.skew?),
            AxisCause::Standstill { distance } | AxisCause::NotThere { distance, .. } => {
                (distance, limits.standstill)
            }
            AxisCause::NotAcknowledged { .. }
            | AxisCause::NotHalted { .. }
            | AxisCause::LimitSwitch { .. }
            | AxisCause::TestMove { .. }
            | AxisCause::Unreferenced
            | AxisCause::Homing(_) => return None,
            AxisCause::FeedbackDifference { difference } => {
                (difference.abs(), names.axis(axis).feedback?.difference)
            }
            AxisCause::ReferenceMoved { difference } => {
                (difference.abs(), names.axis(axis).homing.reference_limit?)
            }
            AxisCause::OutsideSoftLimits { position } => {
                let (min, max) = limits.position;
                (position, if position < min { min } else { max })
            }
        };
        Some((value, limit, unit))
    }

    /// What happened, to whom, and what to do next, in words.
    #[must_use]
    pub fn describe(&self, names: &impl Names) -> String {
        match *self {
            Self::Device(device, cause @ DeviceCause::Emergency { emergency }) => {
                let meaning = emergency.meaning().map(|it| format!(", {it}"));
                format!(
                    "{}: {cause}{}{}: clear its cause",
                    names.subject(device),
                    meaning.unwrap_or_default(),
                    names.vendor_part(device, &emergency)
                )
            }
            Self::Device(device, cause) => format!("{}: {cause}", names.subject(device)),
            Self::Axis(axis, cause @ AxisCause::SetpointGuard { drive, .. }) => {
                format!("{}, {}", names.who(drive), cause.describe(names.axis(axis)))
            }
            Self::Axis(axis, cause @ AxisCause::LimitSwitch { input, .. }) => {
                format!(
                    "input \"{}\", {}",
                    names.input(input),
                    cause.describe(names.axis(axis))
                )
            }
            Self::Axis(axis, cause) => cause.describe(names.axis(axis)),
            Self::Bus(bus, cause) => format!("bus {}: {cause}", names.bus(bus)),
            Self::Spindle(cause) => cause.to_string(),
            Self::Block(line, cause) => format!("line {line}: {}", cause.describe(names)),
            Self::LateWakeUp { late_ns } => format!(
                "the cycle woke up {:.3} ms late, and --strict allows none: look at `syncline doctor`",
                late_ns as f64 * 1e-6
            ),
            Self::Program => {
                "the program could not go on: see its message, and mend it".to_owned()
            }
            Self::NotEnabled { input } => format!(
                "the enabling input \"{}\" is off: switch it on",
                names.input(input)
            ),
            Self::Touched => {
                "the probe touched something, or a tool the tool setter, while nobody probed: move away, and look \
                              at probe, program and work"
                    .to_owned()
            }
            Self::Pressed => {
                "the probe, or the tool setter, is in contact and was moved on by more than `overtravel` from where that \
                 began: move back the way it came, and look at probe, program and work"
                    .to_owned()
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

/// Of an axis that was homed again, so far from where it believed to be.
fn reference_moved(difference: f64, axis: &AxisSpec) -> String {
    let AxisSpec { name, unit, .. } = axis;
    format!(
        "axis {name}: homed again, it was {difference:.4} {unit} beside where it believed to be, allowed {} {unit}: look for lost \
         steps and for a coupling or belt that has slipped, check what was made since, and home it again",
        axis.homing.reference_limit.unwrap_or(0.0)
    )
}

/// Of an axis whose drive was sent to a target that is so far away, and has `told` that it is there or not.
fn not_there(distance: f64, told: bool, axis: &AxisSpec) -> String {
    let AxisSpec { name, unit, .. } = axis;
    let allowed = axis.limits.standstill;
    match told {
        true => format!(
            "axis {name}: its drive did not get to where it was sent and is {distance:.4} {unit} away, allowed \
             {allowed} {unit}: look for what blocks it, and check the drive's units and its current"
        ),
        false => format!(
            "axis {name}: its drive has not told that it has got to where it was sent, and is {distance:.4} {unit} away: \
             look for what blocks it, and check the position window of the drive and that its T_PDOs come"
        ),
    }
}

impl AxisCause {
    fn describe(self, axis: &AxisSpec) -> String {
        let AxisSpec {
            name, unit, limits, ..
        } = axis;
        match self {
            Self::Unreferenced => format!(
                "axis {name} is not referenced: let it be homed by `at_start` in [homing], or home it in \
                 `syncline console`"
            ),
            Self::Homing(failure) => failure.describe(axis),
            Self::OutsideSoftLimits { position } => {
                let (least, most) = limits.position;
                format!(
                    "axis {name} stands at {position:.3} {unit}, outside its soft limits \
                     {least}…{most} {unit}: move it inside, or check the drive's `zero`"
                )
            }
            Self::Skew { difference } => format!(
                "axis {name}: its two sides are {difference:.3} {unit} apart, allowed {} {unit}: \
                 align the gantry, or check the drives' `zero`",
                limits.skew.unwrap_or_default()
            ),
            Self::Standstill { distance } => format!(
                "axis {name} left its frozen position by {distance:.4} {unit}, allowed {} {unit}: \
                 check its brake, its loop and `standstill_window`",
                limits.standstill
            ),
            Self::NotThere { distance, told } => not_there(distance, told, axis),
            Self::NotAcknowledged { time } => format!(
                "axis {name}: its drive has not acknowledged where it was sent for {time:.2} s: check its \
                 operating mode, and that its R_PDOs reach it"
            ),
            Self::NotHalted { time } => format!(
                "axis {name}: its drive was told to halt and has not come to rest for {time:.2} s: check its ramps, \
                 and that its R_PDOs reach it"
            ),
            Self::LimitSwitch {
                positive,
                moving_away,
                ..
            } => {
                let [end, other] = match positive {
                    true => ["positive", "negative"],
                    false => ["negative", "positive"],
                };
                match moving_away {
                    false => format!(
                        "axis {name} is on its {end} limit switch: reset, then jog it off in {other} direction"
                    ),
                    true => format!(
                        "axis {name} moved in {other} direction as its {end} limit switch came on: check whether \
                         its two limit switches are wired the wrong way round, then reset"
                    ),
                }
            }
            Self::FeedbackDifference { difference } => format!(
                "axis {name}: its encoder is {difference:.4} {unit} from where its drive says that it \
                 is, allowed {} {unit}: look for a coupling or belt that slips or is broken and for \
                 lost steps, then check the `zero` of both",
                axis.feedback.map_or(0.0, |feedback| feedback.difference)
            ),
            Self::ReferenceMoved { difference } => reference_moved(difference, axis),
            Self::FollowingError { error, allowed } => format!(
                "axis {name}: following error {error:.4} {unit}, allowed {allowed} {unit}: look for a \
                 blocked axis, a weak loop or too high limits"
            ),
            Self::TestMove { factor } => format!(
                "axis {name}: in its test move it went {factor:.3} times as far as its drive was sent: check the unit of its \
                 velocity in [model.…] or in its description, its increments a turn, `pitch`, `gear` and `direction`"
            ),
            Self::Jump { distance, possible } => format!(
                "axis {name}: an actual position jumped by {distance:.4} {unit}, {possible:.4} {unit} \
                 were possible: check the encoder and its coupling, then the position of the axis"
            ),
            Self::SetpointGuard {
                quantity,
                value,
                sampled,
                ..
            } => format!(
                "axis {name}: a setpoint whose {quantity} is {value:.4} {unit}, allowed {limit} \
                 {unit}, was not sent: {}",
                match sampled {
                    true => "the trajectory asks for more than the axis may do",
                    false =>
                        "this is a defect of syncline, please report it with the machine, the program \
                         and what was done",
                },
                unit = quantity.unit(unit),
                limit = quantity.limit(limits),
            ),
        }
    }
}

impl BlockCause {
    fn describe(self, names: &impl Names) -> String {
        match self {
            Self::Probing(failure) => failure.describe(|axis| names.axis(axis).name.clone()),
            Self::Thread(failure) => failure.describe(),
        }
    }
}
