//! The positioning controller Twin Line TLC53x (DSP-402 V1.0). Numbers in parentheses in comments are
//! lines of the fieldbus manual's text, D-02 and the like the doubts listed in `docs/tlc5xx.md`.
//!
//! It takes no interpolated positions. It is sent velocities, which its profile generator integrates to
//! the position that it controls, and the controller closes a loop about the position that it tells:
//! R_PDO3 brings controlword and velocity (60FFh), T_PDO2 statusword and position (6064h), both at every
//! SYNC.
//!
//! Or its axis goes point to point: R_PDO2 brings controlword and target (607Ah) at every SYNC, and the drive
//! goes there in profile position by its own profile (6081h, 6083h, 6084h). Targets are relative to the one
//! before, as absolute ones need a reference point in the drive (3151-3155).
//!
//! A velocity is in user units, which are made as fine as the greatest velocity (607Fh, 12 000 units at
//! most, 15575) leaves room for. That a unit is 1 r/min while the factor 6094h is 1 stands nowhere
//! (D-53): it is inferred from an example, and so an [`Assumption`] with a name.

use super::profile::cia402::{self, IN_EACH_CYCLE, Targets};
use super::profile::communication;
use super::{
    Ability, Address, Assumption, Data, Drive, DriveStatus, Dynamics, Feedback, Identity,
    Increments, Make, ModeDisplay, Model, NODES, NodeSpec, PowerCommand, PowerState, RemoteNode,
    Sample, Setpoint, Setpoints, Settings, Survey, Write,
};
use crate::dictionary;
use core::time::Duration;
use syncline_canopen::cia402::{Controlword, Statusword};
use syncline_canopen::{CobId, Frame, pdo::CobIdWord};

/// The controller.
pub(super) static TLC5XX: Model = Model {
    name: "tlc5xx",
    title: "Twin Line TLC53x",
    maker: Some("SIG Positec / Berger Lahr"),
    bitrates: &[100_000, 125_000, 250_000, 500_000, 1_000_000],
    nodes: NODES,
    cycle_step: Duration::from_millis(1),
    cycles: Duration::from_millis(1)..=Duration::from_millis(20),
    // Of a motor with a Sincoder (4982).
    increments_per_revolution: |_| INCREMENTS,
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[Ability::PointToPoint, Ability::SyncDivider],
    generic: None,
    r_pdo_values: &[],
    assumptions: &[
        &[
            UNITS_PER_RPM,
            VELOCITY_DELAY,
            POSITION_LAG,
            REMOTE,
            ABSOLUTE,
        ],
        &communication::responses(600, 4000),
    ],
    choices: &[],
    dictionary: dictionary::TLC5XX,
    reserved,
    inputs: &[],
    outputs: &[],
    analog_inputs: &[],
    analog_outputs: &[],
    captures: &[],
    homing_methods: &[],
    torque_limit: None,
    make: Make::Drive(Setpoints::Velocities, |_, settings| {
        Box::new(Tlc5xx::new(settings))
    }),
};

/// Of a motor with a Sincoder, increments for a revolution (4982).
const INCREMENTS: u32 = 16_384;

/// 1000h (6793).
const DEVICE_TYPE: u32 = 0x0002_0192;

/// 1018h:1 (7481).
const VENDOR: u32 = 0x0100_002E;

/// 6041h and 6064h as T_PDO2 brings them as delivered, too (8936, 8948).
const STATUS_AND_POSITION: [u32; 2] = [0x6041_0010, 0x6064_0020];

/// 6040h, the first object of each R_PDO (8181, 8263).
const COMMAND: u32 = 0x6040_0010;

/// 607Ah, of R_PDO2 (15474), and 60FFh, of R_PDO3 (8275).
const TARGET_POSITION: u32 = 0x607A_0020;
const TARGET_VELOCITY: u32 = 0x60FF_0020;

/// Transmission type of an R_PDO that takes effect at the next SYNC: one cycle of it (7729).
const AT_SYNC: u8 = 1;

const UNITS_PER_RPM: Assumption = Assumption {
    name: "units_per_rpm",
    default: 1,
    allowed: 1..=1000,
    meaning: "what 60FFh counts for 1 r/min while the factor 6094h is 1 (D-53)",
};

const VELOCITY_DELAY: Assumption = Assumption {
    name: "velocity_delay_us",
    default: 0,
    allowed: 0..=20_000,
    meaning: "time in µs from the SYNC that latches a velocity until the profile generator has it",
};

const POSITION_LAG: Assumption = Assumption {
    name: "position_lag_us",
    default: 12_500,
    allowed: 0..=100_000,
    meaning: "time constant in µs of the position loop in the drive, which lags by as much at a \
              constant velocity",
};

const REMOTE: Assumption = Assumption {
    name: "remote_bit",
    default: 0,
    allowed: 0..=2,
    meaning: "level of statusword bit 9 while the fieldbus has control (D-04); 2: it says nothing",
};

const ABSOLUTE: Assumption = Assumption {
    name: "absolute_bit",
    default: 1,
    allowed: 0..=1,
    meaning: "level of controlword bit 6 at which a target is absolute (D-02)",
};

/// 6060h (15225-15228).
const PROFILE_POSITION: i8 = 1;
const PROFILE_VELOCITY: i8 = 3;

/// Most units of 607Fh (15575).
const MOST_UNITS: f64 = 12_000.0;

/// How much faster than its axis the loop may have it for a while.
const RESERVE: f64 = 1.2;

/// The greatest velocity of an axis whose drive has that unit, increments/s: with what the loop adds 607Fh holds it.
fn most_velocity(per_rpm: u32) -> f64 {
    MOST_UNITS / RESERVE / f64::from(per_rpm) / 60.0 * f64::from(INCREMENTS)
}

/// The steepest ramp, r/(min·s) (15651, 15680): the drive follows the plan, it makes none.
const RAMP: u32 = 2_000_000;

/// The flattest ramp, r/(min·s) (15651, 15680).
const LEAST_RAMP: u32 = 60;

/// The greatest speed of the profile generator, r/min (10734).
const MOST_SPEED: f64 = 12_000.0;

/// A ramp for that acceleration, increments/s², r/(min·s).
fn ramp(acceleration: f64) -> u32 {
    ((acceleration * 60.0 / f64::from(INCREMENTS)) as u32).clamp(LEAST_RAMP, RAMP)
}

/// A speed, increments/s, in r/min.
fn rpm(velocity: f64) -> f64 {
    velocity / f64::from(INCREMENTS) * 60.0
}

/// One drive.
#[derive(Clone, Debug)]
struct Tlc5xx {
    spec: NodeSpec,
    /// Units of 60FFh for an increment/s.
    units: f64,
    latency: f64,
    most_velocity: f64,
    dynamics: Dynamics,
    remote: u32,
    /// Where it is sent, if its axis goes point to point.
    targets: Option<Targets>,
    /// Bit 6 of the controlword for a target relative to the one before.
    relative: u16,
}

impl Tlc5xx {
    fn new(settings: &Settings) -> Self {
        let assumed = &settings.assumed;
        let rpm = rpm(settings.velocity);
        let per_rpm = assumed.value(&UNITS_PER_RPM);
        // Finer than by a thousand nothing is gained.
        let finer = (MOST_UNITS / (rpm * RESERVE * f64::from(per_rpm))).clamp(1.0, 1000.0) as u32;
        let units = f64::from(finer * per_rpm) * 60.0 / f64::from(INCREMENTS);
        let spec = NodeSpec::new(&TLC5XX, settings, setup(settings, finer), is_command);
        let cycle = settings.cycle.as_secs_f64();
        let delay = assumed.time(&VELOCITY_DELAY).as_secs_f64();
        let lag = assumed.time(&POSITION_LAG).as_secs_f64();
        let (r_pdo, _) = setpoints(settings);
        let release = (!settings.point_to_point).then(|| only_by_fieldbus(false));
        Self {
            spec: NodeSpec {
                identity: identity(),
                // The device's serial number (9150) and the motor's type (16673).
                marks: [(0x2007, 0), (0x6410, 1)]
                    .map(|(index, sub)| Some(Address::new(index, sub))),
                history: cia402::HISTORY.to_vec(),
                tells_boot_up: false,
                t_pdos: vec![communication::t_pdo(2, settings.node, 6)],
                sync_divider: settings.sync_divider.into(),
                r_pdos: vec![communication::r_pdo(r_pdo, settings.node, 6)],
                release: release.into_iter().collect(),
                ..spec
            },
            units,
            latency: 1.0 + delay / cycle,
            most_velocity: most_velocity(per_rpm),
            dynamics: Dynamics {
                lag,
                // From a sample to the middle of the cycle in which it takes effect are one and a half, and it may be older.
                gain: Dynamics::gain(lag + delay + 1.5 * cycle + Dynamics::oldest(settings)),
                quantum: units.recip(),
                told_delay: &VELOCITY_DELAY,
                told_lag: Some(&POSITION_LAG),
            },
            remote: assumed.value(&REMOTE),
            targets: (settings.point_to_point).then(|| Targets::told(IN_EACH_CYCLE)),
            relative: match assumed.value(&ABSOLUTE) {
                0 => Controlword::MODE_6,
                _ => 0,
            },
        }
    }
}

/// The R_PDO that brings its setpoints, and the object that they are.
fn setpoints(settings: &Settings) -> (u8, u32) {
    match settings.point_to_point {
        true => (2, TARGET_POSITION),
        false => (3, TARGET_VELOCITY),
    }
}

/// The operating mode for an axis that goes point to point or not.
const fn mode(point_to_point: bool) -> i8 {
    match point_to_point {
        true => PROFILE_POSITION,
        false => PROFILE_VELOCITY,
    }
}

/// What tells that it is this controller, and that a unit of its positions is an increment as it counts
/// without inversion. All of it is stored in the drive, so that it has to be so before.
fn identity() -> Vec<Identity> {
    let reads = Identity::new;
    vec![
        reads(0x1000, 0, "device type", DEVICE_TYPE),
        reads(0x1018, 1, "vendor", VENDOR),
        reads(0x6093, 1, "position factor, numerator", 1), // 15787
        reads(0x6093, 2, "position factor, denominator", INCREMENTS), // 15799
        reads(0x2045, 0, "inversion of rotation", 0),      // 10226
    ]
}

/// 2060h: whether the fieldbus alone controls it, or a panel, TL CT and the signal interface as well (10944-10948).
fn only_by_fieldbus(only: bool) -> Write {
    Write::new(0x2060, 0, Data::u16(only.into()))
}

/// Every PDO off; mode, unit, ramps; the two that are used, and heartbeats, which exclude guarding.
fn setup(settings: &Settings, finer: u32) -> Vec<Write> {
    let w = Write::new;
    let node = settings.node;
    let mut setup = Vec::new();
    for n in 1..=4 {
        let receive = CobIdWord::valid(CobId::r_pdo(n, node)).0 | CobIdWord::INVALID;
        let transmit = CobIdWord::valid(CobId::t_pdo(n, node)).0 | CobIdWord::INVALID;
        setup.push(w(0x13FF + u16::from(n), 1, Data::u32(receive)));
        setup.push(w(0x17FF + u16::from(n), 1, Data::u32(transmit)));
    }
    setup.extend(cia402::FAULT_RESET); // 2728
    setup.push(w(0x6060, 0, Data::u8(mode(settings.point_to_point) as u8)));
    if !settings.point_to_point {
        // Who takes it over in motion would have it go on with its last velocity: it carries out no R_PDO then (2813-2815).
        setup.push(only_by_fieldbus(true));
    }
    setup.push(w(0x6094, 1, Data::i32(1))); // 15829
    setup.push(w(0x6094, 2, Data::i32(finer as i32))); // 15845
    setup.push(w(0x607F, 0, Data::u32(MOST_UNITS as u32)));
    // As delivered it is 3000 r/min, at which motions end without a word.
    let speed = (rpm(settings.velocity) * RESERVE).clamp(1.0, MOST_SPEED);
    setup.push(w(0x205A, 0, Data::i32(libm::ceil(speed) as i32)));
    setup.push(w(0x6083, 0, Data::u32(RAMP)));
    setup.push(w(0x6084, 0, Data::u32(RAMP)));
    // As delivered a quick stop takes seconds (15725).
    setup.push(w(0x6085, 0, Data::u32(ramp(settings.acceleration))));
    setup.extend(&settings.objects);
    let (r_pdo, setpoint) = setpoints(settings);
    let parameters = 0x13FF + u16::from(r_pdo);
    for (index, mapped) in [
        (0x200 + parameters, [COMMAND, setpoint]),
        (0x1A01, STATUS_AND_POSITION),
    ] {
        setup.push(w(index, 0, Data::u8(0)));
        setup.push(w(index, 1, Data::u32(mapped[0])));
        setup.push(w(index, 2, Data::u32(mapped[1])));
        setup.push(w(index, 0, Data::u8(2)));
    }
    setup.push(w(parameters, 2, Data::u8(AT_SYNC)));
    setup.push(w(0x1801, 2, Data::u8(settings.sync_divider)));
    let receive = CobIdWord::valid(CobId::r_pdo(r_pdo, node)).0;
    let transmit = CobIdWord::valid(CobId::t_pdo(2, node)).0;
    setup.push(w(parameters, 1, Data::u32(receive)));
    setup.push(w(0x1801, 1, Data::u32(transmit)));
    // Guarding and heartbeat exclude each other (2237-2245).
    setup.push(w(0x100C, 0, Data::u16(0)));
    setup.extend(communication::heartbeats(&settings.heartbeat));
    setup
}

/// The mode cannot be read either (6357): 6061h tells it.
fn is_command(write: &Write) -> bool {
    cia402::is_command(write) || write.address == Address::new(0x6060, 0)
}

/// Communication, the words of the state machine, mode, unit and ramps are the controller's.
fn reserved(Address { index, .. }: Address) -> bool {
    matches!(
        index,
        0x1000
            ..=0x1FFF
                | 0x2045
                | 0x6040
                | 0x6060
                | 0x607A
                | 0x607F
                | 0x6081
                | 0x6083
                | 0x6084
                | 0x6093
                | 0x6094
                | 0x60FF
    )
}

/// What a statusword says of the power stage. Of a fault bit 3 alone is certain (D-20): the manual prints for it what the profile has
/// for a drive that still brakes (2792).
fn power(power: PowerState, statusword: Statusword) -> PowerState {
    match power {
        _ if statusword.has(1 << 3) => PowerState::Fault,
        power => power,
    }
}

/// The bytes that its maker adds to an EMCY are the device manual's, which is not at hand.
impl RemoteNode for Tlc5xx {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }
}

impl Feedback for Tlc5xx {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        cia402::sample(data)
    }

    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        let cob_id = self.spec.t_pdos[0].cob_id;
        vec![Frame::new(cob_id, &cia402::in_motion(position))]
    }
}

impl Drive for Tlc5xx {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(Survey {
            status: |value| {
                let status = (cia402::SURVEY.status)(value);
                let power = power(status.power, Statusword(value as u16));
                DriveStatus { power, ..status }
            },
            ..cia402::SURVEY
        })
    }

    fn mode(&self) -> Option<ModeDisplay> {
        Some(cia402::shows(mode(self.targets.is_some())))
    }

    /// It does as it is told as soon as it is enabled.
    fn ends_mode(&self) -> bool {
        false
    }

    fn latency(&self) -> f64 {
        self.latency
    }

    fn most_velocity(&self) -> f64 {
        self.most_velocity
    }

    fn dynamics(&self) -> Option<Dynamics> {
        self.targets.is_none().then_some(self.dynamics)
    }

    fn profile(&self, velocity: f64, acceleration: f64) -> Option<[Write; 3]> {
        self.targets.as_ref()?;
        let velocity = (velocity * self.units).clamp(1.0, MOST_UNITS) as u32;
        let ramp = Data::u32(ramp(acceleration));
        Some([
            Write::new(0x6081, 0, Data::u32(velocity)),
            Write::new(0x6083, 0, ramp),
            Write::new(0x6084, 0, ramp),
        ])
    }

    fn least_ramp(&self) -> f64 {
        f64::from(LEAST_RAMP) / 60.0 * f64::from(INCREMENTS)
    }

    fn owes_acknowledgement(&self) -> bool {
        self.targets.as_ref().is_some_and(Targets::waits)
    }

    fn is_under_way(&self) -> bool {
        self.targets.as_ref().is_some_and(Targets::is_under_way)
    }

    /// Bit 12 says in profile velocity that it stands.
    fn status(&mut self, _: usize, data: &[u8]) -> Option<DriveStatus> {
        let status = cia402::status(data, None)?;
        let statusword = Statusword(status.word.value.bits() as u16);
        if let Some(targets) = &mut self.targets {
            targets.status(statusword);
        }
        let power = power(status.power, statusword);
        let set = statusword.has(Statusword::REMOTE);
        Some(DriveStatus {
            power,
            mode_runs: power == PowerState::Enabled,
            remote: self.remote > 1 || set == (self.remote == 1),
            ..status
        })
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let data = if let Some(targets) = &mut self.targets {
            let (start, [to, from]) = targets.send(command, setpoint.position, false);
            let relative = match start {
                Controlword::MODE_4 => self.relative,
                _ => 0,
            };
            let controlword = cia402::controlword(command, 0).with(start | relative);
            cia402::to_position(controlword, to - from)
        } else {
            let controlword = cia402::controlword(command, 0);
            cia402::at_velocity(controlword, command, setpoint.velocity * self.units)
        };
        frames[0] = Frame::new(self.spec.r_pdos[0].cob_id, &data);
    }
}
