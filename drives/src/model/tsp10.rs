//! The stepper controller TSP10-CBE. Numbers in parentheses in comments are lines of the fieldbus
//! appendix's text.
//!
//! It has no cyclic mode and no part in SYNC. Its axis goes point to point: it is sent targets (R_PDO1), to which
//! it goes by its own profile. Or it is sent velocities, which take effect as they arrive
//! (R_PDO2), and the controller closes the position loop. Its PDOs cannot be changed, and what sends a
//! T_PDO stands nowhere: so it is taken to tell its state when that changes, and its position when it is
//! asked. That is too seldom for a loop: an encoder on the axis closes it.
//!
//! It has neither heartbeat nor guarding. That it is there shows in its answers; that the controller is
//! not, nothing shows it, and it goes on with its last velocity.

use super::profile::cia402::{self, Targets};
use super::profile::communication;
use super::{
    Ability, Address, Assumption, Data, Drive, DriveStatus, Dynamics, Feedback, Identity,
    Increments, Make, ModeDisplay, Model, Monitoring, NODES, NodeSpec, PowerCommand, PowerState,
    RemoteNode, Sample, Setpoint, Setpoints, Settings, Survey, Write,
};
use crate::dictionary;
use core::time::Duration;
use syncline_canopen::Frame;
use syncline_canopen::budget::Events;
use syncline_canopen::cia402::{Controlword, State, Statusword};

/// The controller.
pub(super) static TSP10: Model = Model {
    name: "tsp10",
    title: "TSP10-CBE",
    maker: Some("AHS Antriebstechnik GmbH"),
    bitrates: &[
        50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
    ], // (116-127)
    nodes: NODES,
    cycle_step: Duration::from_micros(1),
    cycles: Duration::from_millis(1)..=Duration::from_millis(20),
    increments_per_revolution: |assumed| assumed.value(&STEPS),
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[Ability::PointToPoint],
    generic: None,
    r_pdo_values: &[],
    assumptions: &[
        &[STEPS, VELOCITY_UNITS, VELOCITY_RPM, VELOCITY_DELAY],
        &communication::responses(400, 2000),
    ],
    choices: &[],
    dictionary: dictionary::TSP10,
    reserved,
    inputs: &[],
    outputs: &[],
    analog_inputs: &[],
    analog_outputs: &[],
    captures: &[],
    homing_methods: &[],
    torque_limit: None,
    make: Make::Drive(Setpoints::Velocities, |_, settings| {
        Box::new(Tsp10::new(settings))
    }),
};

const STEPS: Assumption = Assumption {
    name: "steps_per_revolution",
    default: 10_000,
    allowed: 200..=1_000_000,
    meaning: "6092h:1, steps for each motor revolution, which it is set to",
};

// The table of objects has no unit for 60FFh (791).
const VELOCITY_UNITS: Assumption = Assumption {
    name: "velocity_units",
    default: 0,
    allowed: 0..=1_000_000,
    meaning: "what 60FFh counts at velocity_rpm revolutions a minute; 0: 60FFh counts steps/s",
};

const VELOCITY_RPM: Assumption = Assumption {
    name: "velocity_rpm",
    default: 1,
    allowed: 1..=1_000_000,
    meaning: "revolutions a minute at which 60FFh counts velocity_units",
};

// No number is printed. Its times count milliseconds (550-566): assumed is a task of 1 ms that looks at what has come, half of
// which a frame waits on average.
const VELOCITY_DELAY: Assumption = Assumption {
    name: "velocity_delay_us",
    default: 500,
    allowed: 0..=20_000,
    meaning: "time in µs from the arrival of a velocity until the motor turns with it, ramps aside",
};

const PROFILE_POSITION: i8 = 1;
const PROFILE_VELOCITY: i8 = 3;

/// How much steeper than the plan its ramps are: what it is sent has taken a quarter of a cycle at the most
/// until it turns so fast.
const STEEPER: f64 = 4.0;

/// The least that its ramps take, steps/s² (731).
const LEAST_RAMP: f64 = 23.0;

/// One controller.
#[derive(Clone, Debug)]
struct Tsp10 {
    spec: NodeSpec,
    /// Units of 60FFh for a step/s.
    units: f64,
    latency: f64,
    dynamics: Dynamics,
    /// What its statusword last told.
    state: Option<State>,
    /// Where it is sent, if its axis goes point to point.
    targets: Option<Targets>,
}

impl Tsp10 {
    fn new(settings: &Settings) -> Self {
        let assumed = &settings.assumed;
        let cycle = settings.cycle.as_secs_f64();
        // The half of what its ramp takes.
        let delay = assumed.time(&VELOCITY_DELAY).as_secs_f64() + cycle / STEEPER / 2.0;
        let units = cia402::velocity_units(
            assumed.value(&VELOCITY_UNITS),
            assumed.value(&VELOCITY_RPM),
            assumed.value(&STEPS),
        );
        let r_pdo = match settings.point_to_point {
            true => 1,
            false => 2,
        };
        let spec = NodeSpec::new(&TSP10, settings, setup(settings), cia402::is_command);
        Self {
            spec: NodeSpec {
                identity: identity(),
                history: vec![Address::new(0x1001, 0), Address::new(0x1002, 0)],
                tells_boot_up: false,
                monitoring: Monitoring::Poll(Address::new(0x6064, 0)),
                t_pdos: [1, 2]
                    .map(|number| communication::t_pdo(number, settings.node, 6))
                    .to_vec(),
                answers_sync: false,
                events: events(settings.cycle, spec.t_pdo_response, spec.sdo_response),
                r_pdos: vec![communication::r_pdo(r_pdo, settings.node, 6)],
                latches_at_sync: false,
                ..spec
            },
            units,
            latency: 1.0 + delay / cycle,
            dynamics: Dynamics {
                lag: 0.0,
                // From a sample to the middle of the cycle in which it takes effect.
                gain: Dynamics::gain(delay + 1.5 * cycle),
                quantum: units.recip(),
                told_delay: &VELOCITY_DELAY,
                told_lag: None,
            },
            state: None,
            targets: settings.point_to_point.then(|| Targets::told(1)),
        }
    }
}

/// Changes of the statusword that an R_PDO may cause: bit 10 falls with a new velocity or target and rises where it is reached
/// (770).
const CHANGES: u32 = 2;

/// How many times each T_PDO may come in a cycle at most: at each change that an R_PDO of the cycle causes, behind it, and at
/// those of as many cycles before as they may be late. They wait for an answer by SDO that is on its way, and for one another.
fn events(cycle: Duration, t_pdo_response: Duration, sdo_response: Duration) -> Events {
    let late = sdo_response + t_pdo_response * 2 * CHANGES;
    let cycles = late.as_nanos().div_ceil(cycle.as_nanos());
    Events {
        any_time: CHANGES * cycles.max(1) as u32,
        behind_r_pdo: CHANGES,
    }
}

/// What tells that it is this controller.
fn identity() -> Vec<Identity> {
    let reads = Identity::new;
    vec![
        reads(0x1000, 0, "device type", 0x0004_0192), // (207)
        reads(0x1018, 1, "vendor", 0x0041_4853),      // (285)
        reads(0x1018, 2, "product code", 21),         // (291)
    ]
}

/// Nothing is stored in it (463): units first, which make every position invalid (518), then ramps and mode.
fn setup(settings: &Settings) -> Vec<Write> {
    let w = Write::new;
    let steps = settings.assumed.value(&STEPS);
    let ramp = |of: f64| (of * settings.acceleration).max(LEAST_RAMP) as u32;
    let [idle, reset] = cia402::FAULT_RESET;
    let mut setup = vec![
        idle,
        reset,
        w(0x6092, 1, Data::u32(steps)),
        w(0x6092, 2, Data::u32(1)),
        w(0x2002, 0, Data::u16(0)),
        w(0x6083, 0, Data::u32(ramp(STEEPER))),
        w(0x6084, 0, Data::u32(ramp(STEEPER))),
        w(0x6085, 0, Data::u32(ramp(1.0))),
        w(0x6060, 0, Data::u8(mode(settings.point_to_point) as u8)),
    ];
    setup.extend(&settings.objects);
    setup
}

/// The operating mode for an axis that goes point to point or not.
const fn mode(point_to_point: bool) -> i8 {
    match point_to_point {
        true => PROFILE_POSITION,
        false => PROFILE_VELOCITY,
    }
}

/// Words of the state machine, mode, units and ramps are the controller's.
fn reserved(Address { index, .. }: Address) -> bool {
    matches!(
        index,
        0x1000..=0x1FFF | 0x2002 | 0x6040 | 0x6060 | 0x607A | 0x6081..=0x6085 | 0x6092 | 0x60FF
    )
}

/// No EMCY is described.
impl RemoteNode for Tsp10 {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }
}

/// T_PDO1 brings the position.
impl Feedback for Tsp10 {
    fn sample(&self, t_pdo: usize, data: &[u8]) -> Option<Sample> {
        (t_pdo == 0).then(|| cia402::sample(data)).flatten()
    }

    /// A stepper's count begins at 0.
    fn counts_without_power(&self) -> bool {
        false
    }

    /// While it moves as it is told its statusword does not change.
    fn in_motion(&self, _: Increments) -> Vec<Frame> {
        Vec::new()
    }
}

impl Drive for Tsp10 {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(cia402::SURVEY)
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

    /// As 60FFh has 32 bits (791).
    fn most_velocity(&self) -> f64 {
        f64::from(i32::MAX) / self.units
    }

    fn dynamics(&self) -> Option<Dynamics> {
        self.targets.is_none().then_some(self.dynamics)
    }

    fn profile(&self, velocity: f64, acceleration: f64) -> Option<[Write; 3]> {
        self.targets.as_ref()?;
        let ramp = Data::u32(acceleration.max(LEAST_RAMP) as u32);
        Some([
            Write::new(0x6081, 0, Data::u32(velocity.max(1.0) as u32)),
            Write::new(0x6083, 0, ramp),
            Write::new(0x6084, 0, ramp),
        ])
    }

    fn least_ramp(&self) -> f64 {
        LEAST_RAMP
    }

    fn owes_acknowledgement(&self) -> bool {
        self.targets.as_ref().is_some_and(Targets::waits)
    }

    fn answers(&mut self, said: &DriveStatus) {
        if let Some(targets) = &mut self.targets {
            targets.answer(Statusword(said.word.value.bits() as u16));
        }
    }

    fn is_under_way(&self) -> bool {
        self.targets.as_ref().is_some_and(Targets::is_under_way)
    }

    /// Bits 9 and 12 are named and not explained (645-657): the first says nothing, the second is the handshake's
    /// of CiA 402.
    fn status(&mut self, _: usize, data: &[u8]) -> Option<DriveStatus> {
        let status = cia402::status(data, None)?;
        let statusword = Statusword(status.word.value.bits() as u16);
        self.state = statusword.state();
        if let Some(targets) = &mut self.targets {
            targets.status(statusword);
        }
        Some(DriveStatus {
            mode_runs: status.power == PowerState::Enabled,
            remote: true,
            ..status
        })
    }

    /// From Ready To Switch On there is no way to Operation Enabled in one (141-167).
    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let controlword = match (command, self.state) {
            (PowerCommand::Enable | PowerCommand::Run, Some(State::ReadyToSwitchOn)) => {
                Controlword::SWITCH_ON
            }
            _ => cia402::controlword(command, 0),
        };
        let data = if let Some(targets) = &mut self.targets {
            // Whether it goes on after a halt stands nowhere: it is sent there again.
            let (start, [to, _]) = targets.send(command, setpoint.position, true);
            cia402::to_position(controlword.with(start), to)
        } else {
            cia402::at_velocity(controlword, command, setpoint.velocity * self.units)
        };
        frames[0] = Frame::new(self.spec.r_pdos[0].cob_id, &data);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Assumed;
    use super::*;
    use proptest::prelude::*;
    use syncline_canopen::NodeId;

    fn drive(assumed: &[(&'static str, u32)]) -> Tsp10 {
        let (node, cycle) = (NodeId::new(4).unwrap(), Duration::from_millis(2));
        Tsp10::new(&Settings {
            acceleration: 800_000.0,
            objects: vec![Write::new(0x6075, 0, Data::u32(3000))],
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        })
    }

    fn told(drive: &mut Tsp10, command: PowerCommand, velocity: f64) -> Vec<u8> {
        let mut frames = [Frame::new(drive.spec.r_pdos[0].cob_id, &[])];
        let setpoint = Setpoint {
            position: Increments::new(77),
            velocity,
            ..Setpoint::default()
        };
        drive.encode(command, setpoint, &mut frames);
        assert_eq!(frames[0].id(), syncline_canopen::CanId::Standard(0x304));
        frames[0].data().to_vec()
    }

    /// What it says by T_PDO1, with position 5.
    fn says(drive: &mut Tsp10, statusword: u16) -> DriveStatus {
        let [low, high] = statusword.to_le_bytes();
        drive.status(0, &[low, high, 5, 0, 0, 0]).unwrap()
    }

    #[test]
    fn units_come_before_ramps_and_the_users_objects_last() {
        let drive = drive(&[("steps_per_revolution", 2000)]);
        let shown = |write: &Write| format!("{} = {}", write.address, write.data);
        let shown: Vec<_> = drive.spec.setup.iter().map(shown).collect();
        assert_eq!(
            shown,
            [
                "6040h:0 = 0000h",
                "6040h:0 = 0080h",
                "6092h:1 = 000007D0h",
                "6092h:2 = 00000001h",
                "2002h:0 = 0000h",
                "6083h:0 = 0030D400h",
                "6084h:0 = 0030D400h",
                "6085h:0 = 000C3500h",
                "6060h:0 = 03h",
                "6075h:0 = 00000BB8h",
            ]
        );
    }

    #[test]
    fn it_is_enabled_in_two_steps() {
        let mut drive = drive(&[]);
        assert_eq!(
            told(&mut drive, PowerCommand::Prepare, 9.0),
            [6, 0, 0, 0, 0, 0]
        );
        says(&mut drive, 0x0221);
        assert_eq!(
            told(&mut drive, PowerCommand::Enable, 9.0),
            [7, 0, 0, 0, 0, 0]
        );
        assert_eq!(says(&mut drive, 0x0223).power, PowerState::Off);
        assert_eq!(
            told(&mut drive, PowerCommand::Enable, 9.0),
            [15, 0, 0, 0, 0, 0]
        );
        let status = says(&mut drive, 0x0237);
        assert_eq!(status.follows(true), Ok(()));
        assert_eq!(
            told(&mut drive, PowerCommand::Run, -1.4),
            [15, 0, 0xFF, 0xFF, 0xFF, 0xFF]
        );
        assert_eq!(told(&mut drive, PowerCommand::QuickStop, 9.0)[0], 0x0B);
        assert!(says(&mut drive, 0x0218).power.is_fault());
    }

    #[test]
    fn its_velocity_counts_as_is_assumed() {
        let units = [
            (vec![], 7000),
            (vec![("velocity_units", 1)], 42),
            (vec![("velocity_units", 10), ("velocity_rpm", 2)], 210),
            (
                vec![("velocity_units", 1), ("steps_per_revolution", 5000)],
                84,
            ),
        ];
        for (assumed, sent) in units {
            let mut drive = drive(&assumed);
            says(&mut drive, 0x0237);
            let data = told(&mut drive, PowerCommand::Run, 7000.0);
            assert_eq!(data[2..], i32::to_le_bytes(sent), "{assumed:?}");
        }
    }

    #[test]
    fn point_to_point_it_is_sent_targets_and_a_profile() {
        let velocities = drive(&[]);
        assert_eq!(velocities.profile(800.0, 9000.0), None);
        let mut drive = Tsp10::new(&Settings {
            point_to_point: true,
            ..Settings::new(NodeId::new(4).unwrap(), Duration::from_millis(2))
        });
        assert!(
            drive
                .spec
                .setup
                .contains(&Write::new(0x6060, 0, Data::u8(1)))
        );
        let profile = drive.profile(800.7, 5.0).unwrap();
        let shown = profile.map(|it| format!("{} = {}", it.address, it.data));
        assert_eq!(
            shown,
            [
                "6081h:0 = 00000320h",
                "6083h:0 = 00000017h",
                "6084h:0 = 00000017h"
            ]
        );
        says(&mut drive, 0x0237);
        let mut sent = |position| {
            let mut frames = [Frame::new(drive.spec.r_pdos[0].cob_id, &[])];
            let setpoint = Setpoint::at(Increments::new(position));
            drive.encode(PowerCommand::Run, setpoint, &mut frames);
            assert_eq!(frames[0].id(), syncline_canopen::CanId::Standard(0x204));
            frames[0].data().to_vec()
        };
        assert_eq!(sent(7), [0x0F, 0, 7, 0, 0, 0]);
        assert_eq!(sent(-2), [0x1F, 0, 0xFE, 0xFF, 0xFF, 0xFF]);
    }

    #[test]
    fn only_the_first_t_pdo_brings_a_position() {
        let drive = drive(&[]);
        let data = [0x37, 2, 5, 0, 0, 0];
        let position = |t_pdo| drive.sample(t_pdo, &data).map(|it| it.position.get());
        assert_eq!([position(0), position(1)], [Some(5), None]);
    }

    #[test]
    fn the_machine_files_own_keys_are_not_the_users() {
        for index in [0x6040, 0x6060, 0x6083, 0x6085, 0x6092, 0x60FF] {
            assert!(reserved(Address::new(index, 0)), "{index:04X}h");
        }
        for index in [0x2001, 0x2003, 0x6075] {
            assert!(!reserved(Address::new(index, 1)), "{index:04X}h");
        }
    }

    proptest! {
        /// Whatever it has said, velocities go out while it is to run and in no other case.
        #[test]
        fn a_velocity_is_sent_to_a_drive_that_runs_alone(
            velocity: f64, statuswords in prop::collection::vec(any::<u16>(), 0..4),
        ) {
            let mut drive = drive(&[]);
            for statusword in statuswords {
                says(&mut drive, statusword);
            }
            for command in [PowerCommand::Disable, PowerCommand::Prepare, PowerCommand::Enable, PowerCommand::QuickStop] {
                prop_assert_eq!(&told(&mut drive, command, velocity)[2..], &[0; 4]);
            }
            let nearest = (velocity.round() as i32).to_le_bytes();
            prop_assert_eq!(&told(&mut drive, PowerCommand::Run, velocity)[2..], &nearest);
        }
    }
}
