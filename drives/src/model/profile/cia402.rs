//! A master's side of CiA 402: how a drive is surveyed, switched on and off, what its statusword
//! says, and the two PDOs of a mode that takes a position each cycle. The words and states
//! themselves are [`syncline_canopen::cia402`]'s.

use crate::model::{
    Address, Assumption, Capture, CaptureInput, Data, DriveStatus, Increments, ModeDisplay,
    PowerCommand, PowerState, Sample, Settings, StatusWord, Survey, Write,
};
use syncline_canopen::cia402::{Controlword, State, Statusword};

const CONTROLWORD: Address = Address::new(0x6040, 0);
const STATUSWORD: Address = Address::new(0x6041, 0);
const MODE_DISPLAY: Address = Address::new(0x6061, 0);

/// The interpolation data record's first entry, and the target position.
pub(in crate::model) static POSITIONS: [Address; 2] =
    [Address::new(0x60C1, 1), Address::new(0x607A, 0)];

/// What a drive's loops add to their torque, in thousandths of the motor's rated one.
pub(in crate::model) const TORQUE_OFFSET: Address = Address::new(0x60B2, 0);

/// How late a drive's position reference follows what it was sent.
pub(in crate::model) const INTERPOLATION_DELAY: Assumption = Assumption {
    name: "interpolation_delay",
    default: 1,
    allowed: 0..=10,
    meaning: "cycles from the SYNC that latches a setpoint until the position reference reaches it",
};

/// Resets a fault by bit 7's rising edge (T15), whatever the controlword was before.
pub(in crate::model) const FAULT_RESET: [Write; 2] = [
    Write::new(0x6040, 0, Data::u16(0)),
    Write::new(0x6040, 0, Data::u16(0x80)),
];

/// A drive's state by 6041h; 6040h = 0000h switches it off, 000Bh brings it to rest.
pub(in crate::model) const SURVEY: Survey = Survey {
    address: STATUSWORD,
    status: |value| said(Statusword(value as u16)),
    disable: Write {
        address: CONTROLWORD,
        data: Data::u16(Controlword::DISABLE_VOLTAGE.0),
    },
    quick_stop: Write {
        address: CONTROLWORD,
        data: Data::u16(Controlword::QUICK_STOP.0),
    },
};

/// What stopped a drive last: error code, error register, newest entry of the error list.
pub(in crate::model) const HISTORY: [Address; 3] = [
    Address::new(0x603F, 0),
    Address::new(0x1001, 0),
    Address::new(0x1003, 1),
];

/// 6061h must show this mode.
pub(in crate::model) const fn shows(mode: i8) -> ModeDisplay {
    ModeDisplay {
        address: MODE_DISPLAY,
        mode,
    }
}

/// A touch probe, the first or the second, that sees an input: 60B8h arms it, 60B9h tells of edges, and 60BAh to 60BDh
/// hold where they were.
pub(in crate::model) const fn touch_probe(input: usize, probe: u16) -> CaptureInput {
    CaptureInput {
        input,
        rising: touch_probe_edge(probe, 0),
        falling: touch_probe_edge(probe, 1),
    }
}

/// The same of its rising edges, 0, or its falling ones, 1. It is told anew once it has been off.
const fn touch_probe_edge(probe: u16, edge: u16) -> Capture {
    const ENABLE: u16 = 1 << 0;
    const SAMPLE_RISING: u16 = 1 << 4;
    const STORED_RISING: u32 = 1 << 1;
    let shift = 8 * probe;
    let function = (ENABLE | SAMPLE_RISING << edge) << shift;
    Capture {
        arm: [
            Write::new(0x60B8, 0, Data::u16(0)),
            Write::new(0x60B8, 0, Data::u16(function)),
        ],
        status: Address::new(0x60B9, 0),
        stored: (STORED_RISING << edge) << shift,
        position: Address::new(0x60BA + 2 * probe + edge, 0),
    }
}

/// A controlword is a command, not a setting.
pub(in crate::model) fn is_command(write: &Write) -> bool {
    write.address == CONTROLWORD
}

/// The limits that the drive supervises itself: of the following error (6065h), and of the position
/// (607Dh). A limit beyond what an object holds is no limit, which the object's end says just as well.
pub(in crate::model) fn limits(settings: &Settings) -> Vec<Write> {
    let mut limits = Vec::new();
    if let Some(limit) = settings.following_error_limit {
        let limit = limit.saturating_i32() as u32;
        limits.push(Write::new(0x6065, 0, Data::u32(limit)));
    }
    if let Some((least, most)) = settings.soft_limits {
        limits.push(Write::new(0x607D, 1, Data::i32(least.saturating_i32())));
        limits.push(Write::new(0x607D, 2, Data::i32(most.saturating_i32())));
    }
    limits
}

/// The controlword of a command. `start` are the bits that start the mode on top of Enable
/// Operation; none for a mode that runs as soon as the drive is enabled.
pub(in crate::model) const fn controlword(command: PowerCommand, start: u16) -> Controlword {
    match command {
        PowerCommand::Disable => Controlword::DISABLE_VOLTAGE,
        PowerCommand::Prepare => Controlword::SHUTDOWN,
        PowerCommand::Enable => Controlword::ENABLE_OPERATION,
        PowerCommand::Run => Controlword::ENABLE_OPERATION.with(start),
        PowerCommand::Home => Controlword::ENABLE_OPERATION.with(Controlword::MODE_4),
        PowerCommand::Halt => Controlword::ENABLE_OPERATION.with(Controlword::HALT),
        PowerCommand::QuickStop => Controlword::QUICK_STOP,
    }
}

/// An R_PDO of controlword and position.
pub(in crate::model) fn to_position(controlword: Controlword, position: Increments) -> [u8; 6] {
    image(controlword.0, position)
}

/// An R_PDO of controlword and velocity, in units of the drive: the nearest that there is, and none
/// unless it is told to run.
pub(in crate::model) fn at_velocity(
    controlword: Controlword,
    command: PowerCommand,
    velocity: f64,
) -> [u8; 6] {
    let velocity = match command {
        PowerCommand::Run => velocity.round() as i32,
        _ => 0,
    };
    image(controlword.0, velocity.into())
}

/// What 60FFh counts for an increment/s where it counts `units` at `rpm` revolutions a minute of so many increments each; with 0
/// units it counts increments/s.
pub(in crate::model) fn velocity_units(units: u32, rpm: u32, increments: u32) -> f64 {
    match units {
        0 => 1.0,
        units => f64::from(units) / (f64::from(rpm) / 60.0 * f64::from(increments)),
    }
}

/// The T_PDO of statusword and position of a drive that follows its setpoints, at `position`.
pub(in crate::model) fn in_motion(position: Increments) -> [u8; 6] {
    let operation_enabled = 0x0037;
    let following = Statusword::REMOTE | Statusword::MODE_12;
    image(operation_enabled | following, position)
}

/// Where a drive in Profile Position is sent, and the handshake by which it is: bit 4 rises with a new target,
/// and falls when bit 12 of the statusword has said that the drive took it; the next one waits until bit 12
/// has fallen too.
///
/// Halt (bit 8) waits until a target that is on its way was taken: by what comes later nobody could tell whether
/// the drive saw bit 4 rise before it halted.
///
/// Bit 10 tells that it has come to its target, or that it rests as it was to halt; it falls as a target is taken, and as the drive
/// goes on after a halt. One that tells its state in each cycle may still tell the old one then, so that it has to tell it several
/// times in a row.
#[derive(Clone, Debug)]
pub(in crate::model) struct Targets {
    /// Where it was sent last, and from where, since it was enabled.
    last: Option<[Increments; 2]>,
    /// Bit 4 is set.
    asks: bool,
    /// Bit 12, as the drive last said.
    taken: bool,
    /// It has rested on its way since the last target.
    halted: bool,
    /// Bit 12 has to fall before the next target can be sent.
    blocked: bool,
    /// It has not told yet that it has come to the last target.
    goes: bool,
    /// How often in a row it has told so since it took that, and was not to halt; and how often it has to.
    reached: u32,
    often: u32,
    /// Bit 8 is set.
    halts: bool,
}

/// So often in a row a drive tells that it has come to its target that tells its state in each cycle.
pub(in crate::model) const IN_EACH_CYCLE: u32 = 4;

impl Targets {
    /// Of a drive that tells so often in a row that it has come to its target.
    pub(in crate::model) fn told(often: u32) -> Self {
        Self {
            last: None,
            asks: false,
            taken: false,
            halted: false,
            blocked: false,
            goes: false,
            reached: 0,
            often,
            halts: false,
        }
    }

    /// Takes what the drive says.
    pub(in crate::model) fn status(&mut self, statusword: Statusword) {
        self.taken = statusword.has(Statusword::MODE_12);
        self.asks &= !self.taken;
        self.reached = match self.is_there(statusword) {
            true => self.reached.saturating_add(1),
            false => 0,
        };
        self.goes &= self.reached < self.often;
    }

    /// Takes what the drive says of its target when it is asked for its statusword: its T_PDO may be lost. The handshake goes by that
    /// alone, as an answer may be older.
    pub(in crate::model) fn answer(&mut self, statusword: Statusword) {
        self.goes &= !self.is_there(statusword);
    }

    /// Whether a statusword says of the last target that the drive has come there.
    fn is_there(&self, statusword: Statusword) -> bool {
        !self.asks && !self.halts && statusword.has(Statusword::TARGET_REACHED)
    }

    /// Whether it has not told yet that it has come to the last target.
    pub(in crate::model) fn is_under_way(&self) -> bool {
        self.goes
    }

    /// Whether the handshake waits for the drive: for bit 12 to rise with the last target, or to fall before the next.
    pub(in crate::model) fn waits(&self) -> bool {
        self.asks || self.blocked
    }

    /// The controlword's bits on top of `command`, and where the drive was sent last and from where. With
    /// `anew` a target is sent once more after a halt, to a drive that may forget it then.
    pub(in crate::model) fn send(
        &mut self,
        command: PowerCommand,
        target: Increments,
        anew: bool,
    ) -> (u16, [Increments; 2]) {
        let runs = command == PowerCommand::Run;
        if !runs && command != PowerCommand::Enable {
            *self = Self {
                taken: self.taken,
                ..Self::told(self.often)
            };
            return (0, [target; 2]);
        }
        // Where it stands when it is enabled it was sent already.
        let [last, from] = *self.last.get_or_insert([target; 2]);
        let new = target != last || anew && self.halted;
        self.blocked = runs && new && self.taken;
        if runs && new && !self.asks && !self.taken {
            (self.asks, self.halted, self.halts) = (true, false, false);
            (self.goes, self.reached) = (true, 0);
            // Sent once more, it is on the way from where it set off.
            let from = if target == last { from } else { last };
            self.last = Some([target, from]);
            return (Controlword::MODE_4, [target, from]);
        }
        let bits = match (self.asks, runs) {
            (true, _) => Controlword::MODE_4,
            (false, true) => 0,
            (false, false) => Controlword::HALT,
        };
        self.halts = bits == Controlword::HALT;
        self.halted |= self.halts && last != from;
        (bits, [last, from])
    }
}

fn image(word: u16, value: Increments) -> [u8; 6] {
    let [w0, w1] = word.to_le_bytes();
    let [v0, v1, v2, v3] = value.saturating_i32().to_le_bytes();
    [w0, w1, v0, v1, v2, v3]
}

/// The position that a T_PDO brings behind the statusword.
pub(in crate::model) fn sample(data: &[u8]) -> Option<Sample> {
    let &[_, _, p0, p1, p2, p3, ..] = data else {
        return None;
    };
    Some(Sample {
        position: i32::from_le_bytes([p0, p1, p2, p3]).into(),
    })
}

/// What a T_PDO says that begins with the statusword. In Operation Enabled `error` is the bit of an
/// error that has to be dealt with, if there is one; in other states it may be set without meaning any.
pub(in crate::model) fn status(data: &[u8], error: Option<u16>) -> Option<DriveStatus> {
    let &[s0, s1, ..] = data else {
        return None;
    };
    let statusword = Statusword(u16::from_le_bytes([s0, s1]));
    let status = said(statusword);
    Some(DriveStatus {
        error: status.power == PowerState::Enabled && error.is_some_and(|bit| statusword.has(bit)),
        ..status
    })
}

/// The same in a mode that has no bit of its own: it runs as long as the drive is enabled.
pub(in crate::model) fn status_of_bare_mode(data: &[u8]) -> Option<DriveStatus> {
    let status = status(data, None)?;
    Some(DriveStatus {
        mode_runs: status.power == PowerState::Enabled,
        ..status
    })
}

/// What a statusword says by the bits that mean the same in every mode that takes a setpoint a
/// cycle: bit 12 is set while the drive follows them. Bits that a maker or a mode gives another
/// meaning are left out.
fn said(statusword: Statusword) -> DriveStatus {
    DriveStatus {
        mode_runs: statusword.has(Statusword::MODE_12),
        remote: statusword.has(Statusword::REMOTE),
        warning: statusword.has(Statusword::WARNING),
        ..DriveStatus::of(power_state(statusword), statusword.into())
    }
}

fn power_state(statusword: Statusword) -> PowerState {
    match statusword.state() {
        Some(State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::SwitchedOn) => {
            PowerState::Off
        }
        Some(State::ReadyToSwitchOn) => PowerState::Ready,
        Some(State::OperationEnabled) => PowerState::Enabled,
        Some(State::QuickStopActive) => PowerState::QuickStop,
        Some(State::FaultReactionActive) => PowerState::FaultReaction,
        Some(State::Fault) => PowerState::Fault,
        None => PowerState::Unknown,
    }
}

impl From<Statusword> for StatusWord {
    fn from(statusword: Statusword) -> Self {
        Self {
            name: "statusword",
            value: Data::u16(statusword.0),
            meaning: statusword.state().map_or("no state", State::name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A drive that sees what is sent it as its line lets it, and says so later.
    #[derive(Default)]
    struct Drive {
        asked: bool,
        starts: Vec<i64>,
    }

    impl Drive {
        fn sees(&mut self, bits: u16, target: Increments) -> Statusword {
            let asks = bits & Controlword::MODE_4 != 0;
            if asks && !self.asked {
                assert_eq!(bits & Controlword::HALT, 0, "nothing starts while it halts");
                self.starts.push(target.get());
            }
            self.asked = asks;
            Statusword(if asks { Statusword::MODE_12 } else { 0 })
        }
    }

    proptest! {
        /// Whatever is commanded, and whichever frames either side loses, each target starts once, in order, or is
        /// overtaken by the next one; and where it stands as it is enabled it is not sent.
        #[test]
        fn each_target_starts_once(
            steps in prop::collection::vec((0..4i32, any::<bool>(), any::<bool>(), any::<bool>()), 1..80),
        ) {
            let (mut targets, mut drive) = (Targets::told(1), Drive::default());
            let mut wanted = vec![0];
            for (target, runs, sees, says) in steps {
                let target = i64::from(target);
                let command = if runs { PowerCommand::Run } else { PowerCommand::Enable };
                if *wanted.last().unwrap() != target {
                    wanted.push(target);
                }
                if wanted.len() == 2 && drive.starts.is_empty() {
                    // The first one that it is enabled with.
                    targets.send(PowerCommand::Enable, Increments::new(0), false);
                }
                let (bits, [to, _]) = targets.send(command, Increments::new(target), false);
                if sees {
                    let said = drive.sees(bits, to);
                    if says {
                        targets.status(said);
                    }
                }
            }
            let mut left = wanted.iter();
            for start in &drive.starts {
                prop_assert!(left.any(|it| it == start), "{:?} of {:?}", drive.starts, wanted);
            }
        }
    }

    #[test]
    fn a_halt_waits_for_the_handshake_and_power_off_forgets_the_target() {
        use PowerCommand::{Disable, Enable, Run};
        let mut targets = Targets::told(1);
        let send = |targets: &mut Targets, command, to| {
            let (bits, [to, from]) = targets.send(command, Increments::new(to), true);
            (bits, to.get(), from.get())
        };
        let taken = Statusword(Statusword::MODE_12);
        assert_eq!(send(&mut targets, Enable, 5), (Controlword::HALT, 5, 5));
        assert_eq!(send(&mut targets, Run, 5), (0, 5, 5));
        assert_eq!(send(&mut targets, Run, 9), (Controlword::MODE_4, 9, 5));
        assert_eq!(send(&mut targets, Enable, 9), (Controlword::MODE_4, 9, 5));
        targets.status(taken);
        assert_eq!(send(&mut targets, Enable, 9), (Controlword::HALT, 9, 5));
        // Anew, once bit 12 has fallen.
        assert_eq!(send(&mut targets, Run, 9), (0, 9, 5));
        targets.status(Statusword(0));
        assert_eq!(send(&mut targets, Run, 9), (Controlword::MODE_4, 9, 5));
        // And again after each halt.
        targets.status(taken);
        assert_eq!(send(&mut targets, Enable, 9), (Controlword::HALT, 9, 5));
        targets.status(Statusword(0));
        assert_eq!(send(&mut targets, Run, 9), (Controlword::MODE_4, 9, 5));
        assert_eq!(send(&mut targets, Disable, 9), (0, 9, 9));
        assert_eq!(send(&mut targets, Run, 2), (0, 2, 2));
    }
}
