//! What the controller has to tell, as plain numbers; the text is made outside of the cycle.

use super::axis::SidesApart;
use super::fault::{AxisIndex, BlockCause, BusIndex, DeviceIndex, Fault, Names};
use super::functions::Switch;
use super::homing::{HomingFailure, LostReference, NotRecalled};
use super::inputs::InputIndex;
use super::job::Outcome;
use super::jogs::HOLD_TO_RUN;
use super::layout::AxisSpec;
use super::probing::{KnownBy, ProbeFailure};
use super::rest::{Hold, Pause, Waiting};
use super::state::State;
use super::user_codes::UserCall;
use crate::bus::BusFault;
use crate::machine::{COORDINATES, Kept};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::time::Duration;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::sdo::AbortCode;
use syncline_drives::model::{Address, PowerState, StatusWord};
use syncline_gcode::AxisLetter;
use syncline_trajectory::path::Leg;

/// Why a path slows down that nobody told to.
const LATE_PLAN: &str =
    "the plan came late, so the path slows down: this host is slow for the program";

/// Why a path is not retraced any further.
const NO_WAY_BACK: &str = "no way back from here: the program begins here, or goes on behind a probing or a move point to point";

/// Why a cut is held, and what to do.
const SPEED_LOST: &str = "the spindle lost its speed in the cut, its input says: look for what holds it back, then go on; it is \
                          watched again once the input is on";

/// What a held program that was left for typed lines waits for.
const SET_ASIDE: &str = "the program waits: `resume` reads it anew from the block at work, with the offsets and tools as they \
                         are then; `stop` gives it up";

/// Something worth a line in the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The machine entered this phase.
    Phase(Phase),
    /// A device did not answer before its reset; it may just be starting up.
    Silent {
        /// Which device.
        device: DeviceIndex,
    },
    /// A drive was found with its power stage on and is being disabled.
    FoundEnabled {
        /// Which device.
        device: DeviceIndex,
        /// What it says of itself.
        word: StatusWord,
    },
    /// What a device remembers of its last error, read before the set-up wipes it.
    History {
        /// Which device.
        device: DeviceIndex,
        /// The object.
        object: Address,
        /// Its value.
        value: u32,
    },
    /// A device was set otherwise than it has to be, and is set anew.
    Rewritten {
        /// Which device.
        device: DeviceIndex,
        /// The object.
        object: Address,
        /// What it was.
        found: u32,
        /// What it has to be.
        value: u32,
    },
    /// A device would not have an object read or written where that is no fault.
    Refused {
        /// Which device.
        device: DeviceIndex,
        /// The object.
        object: Address,
        /// Its reason.
        code: AbortCode,
    },
    /// A device sent an EMCY message before its set-up, which resets the error.
    Emergency {
        /// Which device.
        device: DeviceIndex,
        /// What it says.
        emergency: Emergency,
    },
    /// A device's warning came, which does not stop it.
    Warning {
        /// Which device.
        device: DeviceIndex,
    },
    /// One of a device's digital inputs or outputs changed.
    Signal {
        /// Which device.
        device: DeviceIndex,
        /// Its place among the device's signals.
        signal: usize,
        /// Its new level.
        on: bool,
    },
    /// A device told that its error is gone (EMCY code 0000h).
    ErrorReset {
        /// Which device.
        device: DeviceIndex,
    },
    /// An axis stands here, its setpoint frozen.
    Frozen {
        /// Which axis.
        axis: AxisIndex,
        /// Machine position, mm.
        position: f64,
    },
    /// An axis has been homed: its positions are machine positions from now on.
    Referenced {
        /// Which axis.
        axis: AxisIndex,
        /// By how much they may be off, mm; `None` of an absolute encoder.
        uncertainty: Option<f64>,
        /// Of a gantry: how far the second side stood beyond the first, which is being taken out, mm.
        apart: f64,
        /// Of one that was homed before: where it believed to be minus where it was, mm.
        moved: Option<f64>,
    },
    /// An axis has made its test move.
    Tested {
        /// Which axis.
        axis: AxisIndex,
        /// It went so many times as far as its drive was sent.
        factor: f64,
    },
    /// The sides of a gantry are further apart than they may be, as far as a homing takes out.
    Askew {
        /// Which axis.
        axis: AxisIndex,
        /// How far the second stands beyond the first, mm.
        apart: f64,
    },
    /// The sides of a gantry that is enabled are out of square, and no further apart than they may be.
    OutOfSquare {
        /// Which axis.
        axis: AxisIndex,
        /// How far the second stands beyond the first, mm.
        apart: f64,
        /// They stay so: the machine was reset, which moves nothing, or a door or the feed hold forbids it. Otherwise it
        /// is taken out before the machine is ready.
        stays: bool,
    },
    /// The sides of an axis that are coupled do not come together.
    SidesApart {
        /// Which axis.
        axis: AxisIndex,
        /// How so.
        what: SidesApart,
    },
    /// The reference that an axis had when the machine was on last still holds.
    Recalled {
        /// Which axis.
        axis: AxisIndex,
        /// How far it has moved since, mm.
        moved: f64,
    },
    /// An axis whose reference was to be kept has none.
    NotRecalled {
        /// Which axis.
        axis: AxisIndex,
        /// Why.
        why: NotRecalled,
    },
    /// What is to be kept of a drive for when the machine is switched on again; `None`: nothing any more.
    Kept {
        /// Which drive.
        device: DeviceIndex,
        /// Its reference.
        kept: Option<Kept>,
    },
    /// The path has come to an M-code of the user's that runs a command, and rests until it is told how that ended.
    UserCode {
        /// Counts such codes, from 1.
        number: u32,
        /// The code.
        call: UserCall,
        /// Program line.
        line: u32,
    },
    /// The positions of an axis are no machine positions any more.
    Unreferenced {
        /// Which axis.
        axis: AxisIndex,
        /// Why.
        why: LostReference,
    },
    /// An axis was not homed; what moved comes to rest.
    HomingFailed {
        /// Which axis.
        axis: AxisIndex,
        /// Why.
        failure: HomingFailure,
    },
    /// The index pulse that an axis was homed by is near to the edge of its switch.
    IndexNear {
        /// Which axis.
        axis: AxisIndex,
        /// How near, mm.
        distance: f64,
    },
    /// An axis presses against what it met as it searched a hard stop: the drives go off before its torque is what it was.
    Presses {
        /// Which axis.
        axis: AxisIndex,
    },
    /// A probing has ended.
    Probed {
        /// Program line.
        line: u32,
        /// By how much the place of the contact may be off, mm, and by what it is known; `None`: there was none.
        found: Option<(f64, KnownBy)>,
    },
    /// The axes that a program was to home have been: it goes on from where they are.
    ProgramHomed {
        /// Program line.
        line: u32,
    },
    /// A thread has been cut.
    Threaded {
        /// Program line.
        line: u32,
        /// By how much the axes were out of step with the spindle at most, mm, as the drives measured both; `None` of a
        /// thread that was too short to tell.
        off: Option<f64>,
    },
    /// The machine stopped while the axes were on a tap.
    TapLeft {
        /// Program line.
        line: u32,
    },
    /// A probing failed; the job is over.
    ProbingFailed {
        /// Program line.
        line: u32,
        /// Why.
        failure: ProbeFailure,
    },
    /// The probe touched something, or a tool the tool setter, while the axes moved for something else; they come to rest.
    Touched,
    /// The probe, or the tool setter, was moved on beyond `overtravel` in contact: the axes come to rest.
    Pressed,
    /// An input told in a cut that the spindle has lost its speed: the path comes to rest and is held.
    SpeedLost,
    /// A continuous jog was not renewed in time: the axis comes to rest.
    JogNotRenewed {
        /// Which axis.
        axis: AxisIndex,
    },
    /// A jog has taken an axis to the end of its travel.
    TravelEnds {
        /// Which axis.
        axis: AxisIndex,
        /// Where that is, mm.
        end: f64,
        /// It is referenced, and there is its soft limit; otherwise it is jogged no further at a time.
        referenced: bool,
    },
    /// A device's T_PDO did not come in time.
    MissedTPdo {
        /// Which device.
        device: DeviceIndex,
    },
    /// A cycle's setpoints were dropped or left too late for their SYNC.
    LateSetpoint {
        /// Which bus.
        bus: BusIndex,
        /// The cycle.
        cycle: u64,
    },
    /// A wake-up came so late that whole cycles passed without SYNC.
    LostCycles {
        /// How many.
        lost: u64,
        /// How late it was.
        late: Duration,
    },
    /// The adapter of a bus reported something that the bus can be used on with.
    BusWarning {
        /// Which bus.
        bus: BusIndex,
        /// What.
        fault: BusFault,
    },
    /// A part of the plan came too late: the plan before is followed, to rest if need be, until
    /// there is a new one.
    LatePlan,
    /// A drive's power stage changed its state.
    Power {
        /// Which device.
        device: DeviceIndex,
        /// Its new state.
        power: PowerState,
    },
    /// An input of the machine changed, or was on when it was first seen.
    Input {
        /// Which one.
        input: InputIndex,
        /// Whether it is on now.
        on: bool,
    },
    /// An output of the machine was switched, by a program or to its safe state.
    Output {
        /// Its place in the machine file.
        output: usize,
        /// Whether it is on now.
        on: bool,
    },
    /// An analog output of the machine puts out another value.
    AnalogOutput {
        /// Its place in the machine file.
        output: usize,
        /// The value, in the unit of its full scale.
        value: f64,
    },
    /// An M-code was executed.
    Switched {
        /// Program line.
        line: u32,
        /// What it does.
        switch: Switch,
    },
    /// The program waits for an operator.
    Paused {
        /// Program line.
        line: u32,
        /// Why.
        reason: Pause,
    },
    /// The machine rests on the path until an operator goes on.
    Held(Hold),
    /// A job has rested for a while, and goes on by itself once that has come.
    Waits(Waiting),
    /// The operator went on.
    Resumed,
    /// Axes rest off the path: the next leg of the way back, which an operator has to begin.
    NextLeg(Leg<COORDINATES>),
    /// A feed hold ended at a program stop, which still waits for an operator.
    StillPaused {
        /// Program line.
        line: u32,
        /// Why.
        reason: Pause,
    },
    /// An operator has the program go back along the path.
    Retracing,
    /// The path leads no further back: it begins there, or is behind a probing or a move point to point.
    NoWayBack,
    /// A program that was held is left for lines that are typed in, and waits to be resumed.
    SetAside,
    /// A tool change was given up: the tool before counts as in the spindle.
    ToolNotChanged {
        /// The tool that was to be loaded; 0 for none.
        asked: u32,
        /// The one before; 0 for none.
        tool: u32,
    },
    /// A job is over.
    JobOver {
        /// Its number.
        job: u64,
        /// How it ended.
        outcome: Outcome,
    },
    /// The state of the machine as its operators have it.
    State(State),
    /// It was told to stop.
    Interrupted,
    /// A fault began the stop, or came on top of it.
    Fault(Fault),
}

/// Where the machine is between power-up and the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Reads every drive's state; disables what is found enabled where no other controller is heard.
    Survey,
    /// Resets communication and waits for the boot-up messages.
    Boot,
    /// Checks identity, writes and reads back the set-up.
    SetUp,
    /// SYNC runs; waits for Operational and for every drive's first T_PDO.
    Start,
    /// Waits until every drive's clock follows SYNC.
    Lock,
    /// Power stages off.
    Disabled,
    /// Drives ready to be enabled.
    ReadyToSwitchOn,
    /// Power stages on; then the setpoint is frozen.
    OperationEnabled,
    /// Starts the operating mode on the frozen setpoint.
    ModeStart,
    /// Takes gantries square that stand a little askew.
    Square,
    /// Setpoints follow the program.
    Program,
    /// A stop on the path.
    Stop,
    /// A quick stop of all drives.
    QuickStop,
    /// Ends the operating mode.
    ModeEnd,
    /// Power stages off, brakes first.
    ShutDown,
    /// Power stages off for good.
    Disable,
    /// Stops the drives' synchronisation to SYNC.
    Release,
    /// NMT Pre-Operational; SYNC goes last.
    PreOperational,
    /// Nothing is sent any more.
    Done,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Survey => "reading the drives' states",
            Self::Boot => "resetting the drives' communication",
            Self::SetUp => "setting up the drives",
            Self::Start => "SYNC on, starting the nodes",
            Self::Lock => "waiting until the drives' clocks follow SYNC",
            Self::Disabled => "making sure that the power stages are off",
            Self::ReadyToSwitchOn => "preparing the power stages",
            Self::OperationEnabled => "power stages on",
            Self::ModeStart => "setpoints frozen, starting the operating mode",
            Self::Square => "taking gantries square",
            Self::Program => "ready",
            Self::Stop => "coming to rest",
            Self::QuickStop => "quick stop",
            Self::ModeEnd => "ending the operating mode",
            Self::ShutDown => "switching the power stages off",
            Self::Disable => "power stages off",
            Self::Release => "ending the synchronisation",
            Self::PreOperational => "NMT Pre-Operational",
            Self::Done => "SYNC off",
        })
    }
}

impl Event {
    /// Whether it happens in every run.
    #[must_use]
    pub fn is_routine(&self) -> bool {
        match self {
            Self::Waits(waiting) => waiting.is_routine(),
            Self::Phase(_)
            | Self::Frozen { .. }
            | Self::JobOver { .. }
            | Self::State(_)
            | Self::Power { .. }
            | Self::Output { .. }
            | Self::AnalogOutput { .. } => true,
            _ => false,
        }
    }

    /// Whether it says again what another one said, and may come in every cycle.
    #[must_use]
    pub fn repeats(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::LateSetpoint { bus: of, .. }, Self::LateSetpoint { bus, .. }) => of == bus,
            (Self::LostCycles { .. }, Self::LostCycles { .. }) => true,
            (
                Self::Signal {
                    device: of, signal, ..
                },
                Self::Signal {
                    device,
                    signal: other,
                    ..
                },
            ) => (of, signal) == (device, other),
            (
                Self::MissedTPdo { .. }
                | Self::Warning { .. }
                | Self::BusWarning { .. }
                | Self::LatePlan,
                _,
            ) => self == other,
            _ => false,
        }
    }

    /// Whether the program rests from now on until an operator goes on, if that tells.
    #[must_use]
    pub fn rests(&self) -> Option<bool> {
        match self {
            Self::Held(_) | Self::Paused { .. } | Self::StillPaused { .. } => Some(true),
            Self::Resumed | Self::Retracing | Self::JobOver { .. } => Some(false),
            _ => None,
        }
    }

    /// The log's line; `None` for what is not worth one.
    #[must_use]
    pub fn describe(&self, names: &impl Names) -> Option<String> {
        let who = |device| names.who(device);
        Some(match *self {
            Self::Phase(phase) => phase.to_string(),
            Self::Silent { device } => {
                format!("{}: no answer; it may just be starting", who(device))
            }
            Self::FoundEnabled { device, word } => format!(
                "{}: found with its power stage on, {word}: switching it off unless another controller is heard",
                who(device)
            ),
            Self::History { value: 0, .. } => return None,
            Self::History {
                device,
                object,
                value,
            } => format!("{}: before the set-up {object} was {value:X}h", who(device)),
            Self::Rewritten {
                device,
                object,
                found,
                value,
            } => format!(
                "{}: {object} was {found:X}h, is set to {value:X}h: it may count from elsewhere now, \
                 check its `zero`",
                who(device)
            ),
            Self::Refused {
                device,
                object,
                code,
            } => format!("{}: {object} refused: {code}", who(device)),
            Self::Emergency { device, emergency } => format!(
                "{}: EMCY {:04X}h before the set-up{}",
                who(device),
                emergency.code,
                names.vendor_part(device, &emergency)
            ),
            Self::Warning { device } => format!("{}: warning pending", who(device)),
            Self::ErrorReset { device } => format!("{}: error reset", who(device)),
            Self::Frozen { axis, .. }
            | Self::Referenced { axis, .. }
            | Self::Askew { axis, .. }
            | Self::OutOfSquare { axis, .. }
            | Self::SidesApart { axis, .. }
            | Self::Tested { axis, .. }
            | Self::Unreferenced { axis, .. }
            | Self::Recalled { axis, .. }
            | Self::NotRecalled { axis, .. }
            | Self::JogNotRenewed { axis }
            | Self::TravelEnds { axis, .. }
            | Self::Presses { axis }
            | Self::IndexNear { axis, .. }
            | Self::HomingFailed { axis, .. } => return self.describe_axis(names.axis(axis)),
            Self::Probed { .. }
            | Self::ProgramHomed { .. }
            | Self::Threaded { .. }
            | Self::TapLeft { .. }
            | Self::ProbingFailed { .. }
            | Self::Touched
            | Self::Pressed => return self.describe_probing(names),
            Self::MissedTPdo { device } => format!("{}: T_PDO missing in one cycle", who(device)),
            Self::LateSetpoint { .. }
            | Self::LostCycles { .. }
            | Self::BusWarning { .. }
            | Self::LatePlan => return self.describe_delay(names),
            Self::Signal { .. }
            | Self::Input { .. }
            | Self::Output { .. }
            | Self::AnalogOutput { .. } => return self.describe_signal(names),
            Self::Switched {
                line,
                switch: Switch::Output(output),
            } => format!("line {line}: {output}"),
            // The trace has it; the phases tell of power stages, and faults do.
            Self::Switched { .. } | Self::Power { .. } => return None,
            Self::Paused { line, reason } => format!("line {line}: {reason}"),
            Self::UserCode { call, line, .. } => {
                format!("line {line}: M{}: running its command", call.code)
            }
            Self::Held(_)
            | Self::Waits(_)
            | Self::SpeedLost
            | Self::NextLeg(_)
            | Self::Resumed
            | Self::StillPaused { .. }
            | Self::Retracing
            | Self::NoWayBack
            | Self::SetAside
            | Self::ToolNotChanged { .. }
            | Self::Interrupted => return self.describe_path(names),
            Self::JobOver { .. } | Self::State(_) | Self::Kept { .. } => return None,
            Self::Fault(fault) => format!("FAULT: {}", fault.describe(names)),
        })
    }

    /// What host and buses do not do in time.
    fn describe_delay(&self, names: &impl Names) -> Option<String> {
        Some(match *self {
            Self::LateSetpoint { bus, cycle } => format!(
                "bus {}: the setpoints of cycle {cycle} missed their SYNC",
                names.bus(bus)
            ),
            Self::LostCycles { lost, late } => format!(
                "woke {:.3} ms late: {lost} cycles without SYNC; `syncline doctor` and `syncline \
                 bench cycle` tell why",
                late.as_secs_f64() * 1e3
            ),
            Self::BusWarning { bus, fault } => {
                format!(
                    "bus {}: {fault}: check cable, termination and bit rate",
                    names.bus(bus)
                )
            }
            Self::LatePlan => LATE_PLAN.to_owned(),
            _ => return None,
        })
    }

    /// What the path does for an operator.
    fn describe_path(&self, names: &impl Names) -> Option<String> {
        Some(match *self {
            Self::Held(hold) => hold.describe(names),
            Self::Waits(waiting) => waiting.describe(|input| names.input(input)),
            Self::SpeedLost => SPEED_LOST.to_owned(),
            Self::NextLeg(leg) => describe_leg(&leg),
            Self::Resumed => "going on".to_owned(),
            Self::StillPaused { line, reason } => {
                format!("feed hold ended, still at rest in line {line}: {reason}")
            }
            Self::Retracing => "retracing: going back along the path".to_owned(),
            Self::NoWayBack => NO_WAY_BACK.to_owned(),
            Self::SetAside => SET_ASIDE.to_owned(),
            Self::ToolNotChanged { asked, tool } => format!(
                "the change to tool {asked} was not confirmed: tool {tool} counts as in the spindle (0: none); if another \
                 one is, say so by M61 Q"
            ),
            Self::Interrupted => "interrupted: stopping on the path".to_owned(),
            _ => return None,
        })
    }

    /// What came of a probing, of none, of a thread, or of a program's homing.
    fn describe_probing(&self, names: &impl Names) -> Option<String> {
        Some(match *self {
            Self::Probed { line, found } => match found {
                Some((off, by)) => format!("line {line}: contact, known to {off:.4} mm {by}"),
                None => format!("line {line}: no contact"),
            },
            Self::Threaded { line, off } => match off {
                Some(off) => format!(
                    "line {line}: thread cut, in step within {:.1} µm",
                    1e3 * off
                ),
                None => format!("line {line}: thread cut, too short to tell how well in step"),
            },
            Self::TapLeft { line } => format!(
                "line {line}: the machine stopped on the way of a tap, which may be in the work: turn it out by hand \
                 before anything moves"
            ),
            Self::ProgramHomed { line } => format!("line {line}: homed, going on"),
            Self::ProbingFailed { line, failure } => {
                Fault::Block(line, BlockCause::Probing(failure)).describe(names)
            }
            Self::Touched => Fault::Touched.describe(names),
            Self::Pressed => Fault::Pressed.describe(names),
            _ => return None,
        })
    }

    /// The same of what concerns an input or an output.
    fn describe_signal(&self, names: &impl Names) -> Option<String> {
        let (what, on) = match *self {
            Self::Signal { device, signal, on } => {
                let (who, signal) = (names.who(device), names.signal(device, signal));
                (format!("{who}: {signal}"), on)
            }
            Self::Input { input, on } => (format!("input \"{}\"", names.input(input)), on),
            Self::Output { output, on } => (format!("output \"{}\"", names.output(output)), on),
            Self::AnalogOutput { output, value } => {
                let name = names.analog_output(output);
                return Some(format!("output \"{name}\" at {value}"));
            }
            _ => return None,
        };
        Some(format!("{what} {}", level(on)))
    }

    /// What happened to an axis.
    fn describe_axis(&self, axis: &AxisSpec) -> Option<String> {
        let (name, unit) = (&axis.name, axis.unit);
        Some(match *self {
            Self::Frozen { position, .. } => format!("axis {name} stands at {position:.4} {unit}"),
            Self::Referenced {
                uncertainty,
                apart,
                moved,
                ..
            } => {
                let to = uncertainty.map(|off| format!(", to {off:.4} {unit}"));
                let square = (axis.drives.len() == 2)
                    .then(|| format!("; its sides were {apart:.4} {unit} out of square"));
                let moved = moved
                    .map(|by| format!("; it was {by:.4} {unit} beside where it believed to be"));
                let [to, square, moved] = [to, square, moved].map(Option::unwrap_or_default);
                format!("axis {name} is homed{to}{square}{moved}")
            }
            Self::Tested { factor, .. } => format!(
                "axis {name} has made its test move, {factor:.4} times as far as its drive was sent"
            ),
            Self::Askew { apart, .. } => format!(
                "axis {name}: its sides are {:.3} {unit} apart: home it to take it square",
                apart.abs()
            ),
            Self::OutOfSquare { apart, stays, .. } => {
                let apart = format!("axis {name}: its sides are {apart:.3} {unit} out of square");
                match stays {
                    true => format!(
                        "{apart} and stay so: disable and enable the drives, or home it, to take it square"
                    ),
                    false => format!("{apart}: they are taken square before the machine is ready"),
                }
            }
            Self::SidesApart { what, .. } => format!("axis {name}: {}", what.describe(unit)),
            Self::Unreferenced { why, .. } => {
                let why = match why {
                    LostReference::DriveGone => "as its drive was gone: home it",
                    LostReference::Homes => "while its drive homes",
                    LostReference::CutOff => "as its homing was cut off: home it",
                    LostReference::Moved => {
                        "as it was elsewhere than where it believed to be: home it"
                    }
                };
                format!("axis {name} is not referenced any more, {why}")
            }
            Self::Recalled { moved, .. } => format!(
                "axis {name} is referenced as it was before, and has moved by {moved:.4} {unit} since"
            ),
            Self::NotRecalled { why, .. } => why.describe(axis),
            Self::JogNotRenewed { .. } => format!(
                "axis {name} stops: its jog was not renewed for {} ms",
                HOLD_TO_RUN.as_millis()
            ),
            Self::TravelEnds {
                end,
                referenced: true,
                ..
            } => {
                format!("axis {name} stops at its soft limit, {end:.3} {unit}")
            }
            Self::TravelEnds { .. } => format!(
                "axis {name} stops: it is not homed, and is jogged by {:.3} {unit} at most at a time",
                axis.homing.jog_distance
            ),
            Self::HomingFailed { failure, .. } => failure.describe(axis),
            Self::IndexNear { distance, .. } => format!(
                "axis {name}: the index pulse is {distance:.3} {unit} from the edge of its switch, less than 10 % of a turn: \
                 move the switch, lest it is another one some day"
            ),
            Self::Presses { .. } => format!(
                "axis {name} presses against what it met: its drive goes off before its torque is as it was; look what it \
                 stands against, then enable"
            ),
            _ => return None,
        })
    }
}

/// Where the next leg of the way back leads, machine coordinates, and what an operator does for it.
#[must_use]
pub fn describe_leg(leg: &Leg<COORDINATES>) -> String {
    let to = (AxisLetter::ALL.iter().zip(leg.to))
        .filter_map(|(axis, to)| Some(format!("{} to {:.3}", axis.letter(), to?)));
    let to = to.collect::<Vec<_>>().join(", ");
    let speed = match leg.speed.is_finite() {
        true => format!(" at {:.0} mm/min", leg.speed * 60.0),
        false => String::new(),
    };
    let then = match leg.last {
        true => ", where the path goes on",
        false => "",
    };
    format!("way back: cycle start takes {to}{speed} in machine coordinates{then}")
}

fn level(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}
