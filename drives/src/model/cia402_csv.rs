//! A servo drive as the profile has it that is sent velocities: CiA 402 (IEC 61800-7-201) in Cyclic Synchronous
//! Velocity, or in Profile Velocity, by the profile's own objects. Drives that a file describes are instances of these two.
//!
//! R_PDO and T_PDO bring controlword and velocity (60FFh), statusword and position (6064h), both at every SYNC, and the
//! controller closes the position loop about the drive. In Cyclic Synchronous Velocity the drive goes from one velocity
//! to the next within the cycle, or at once, and statusword bit 12 says that it follows. In Profile Velocity its own ramps
//! (6083h, 6084h) are in between, which have to be so steep that they add nothing; bit 12 says that it stands.
//!
//! Positions are encoder increments at the motor's shaft, as in Cyclic Synchronous Position. What velocities count the
//! profile leaves to the maker: it is an [`Assumption`], by default increments/s.
//!
//! In Profile Velocity it turns a spindle, too: then its ramps are the spindle's, and nobody controls its position, which
//! begins anew at the end of 6064h.
//!
//! A drive that is sent velocities and has lost its master would go on with the last one. What it does then (6007h)
//! is therefore set: it is a fault.

use super::profile::cia402;
use super::profile::generic::{
    self, COUNTING, ENCODER_INCREMENTS, Kind, Pdos, SYNCHRONOUS, TELLS_FOLLOWING,
};
use super::{
    Ability, Address, Assumption, Data, Drive, DriveStatus, Dynamics, Feedback, Increments, Make,
    Mapping, ModeDisplay, Model, NodeSpec, OutOfRange, PowerCommand, RemoteNode, Sample, Setpoint,
    Setpoints, Settings, Survey, Write,
};
use crate::dictionary;
use syncline_canopen::Frame;

/// The drive in Cyclic Synchronous Velocity.
pub(super) static CIA402_CSV: Model = Model {
    abilities: &[Ability::SyncDivider, Ability::CountsWithinTurn],
    assumptions: &[
        &[
            VELOCITY_UNITS,
            VELOCITY_RPM,
            INTERPOLATES,
            VELOCITY_DELAY,
            VELOCITY_LAG,
        ],
        COUNTING,
        SYNCHRONOUS,
        generic::DRIVE,
    ],
    dictionary: dictionary::CIA402_CSV,
    reserved,
    ..generic::drive(
        "cia402_csv",
        "CiA 402 CSV",
        Make::Drive(Setpoints::Velocities, |model, settings| {
            Box::new(Cia402Velocity::new(model, settings, Mode::Synchronous))
        }),
    )
};

/// The drive in Profile Velocity.
pub(super) static CIA402_PV: Model = Model {
    abilities: &[
        Ability::ProfileVelocity,
        Ability::SyncDivider,
        Ability::CountsWithinTurn,
    ],
    assumptions: &[
        &[
            VELOCITY_UNITS,
            VELOCITY_RPM,
            RAMP,
            VELOCITY_DELAY,
            VELOCITY_LAG,
        ],
        COUNTING,
        generic::DRIVE,
    ],
    dictionary: dictionary::CIA402_PV,
    reserved,
    ..generic::drive(
        "cia402_pv",
        "CiA 402 PV",
        Make::Drive(Setpoints::Velocities, |model, settings| {
            Box::new(Cia402Velocity::new(model, settings, Mode::Profile))
        }),
    )
};

const VELOCITY_UNITS: Assumption = Assumption {
    name: "velocity_units",
    default: 0,
    allowed: 0..=u32::MAX,
    meaning: "what 60FFh counts at velocity_rpm revolutions a minute; 0: 60FFh counts increments/s",
};

const VELOCITY_RPM: Assumption = Assumption {
    name: "velocity_rpm",
    default: 1,
    allowed: 1..=1_000_000,
    meaning: "revolutions a minute at which 60FFh counts velocity_units",
};

const INTERPOLATES: Assumption = Assumption {
    name: "interpolates",
    default: 1,
    allowed: 0..=1,
    meaning: "1: it goes from one velocity to the next in a straight line within the cycle; 0: at once",
};

const RAMP: Assumption = Assumption {
    name: "ramp",
    default: 0,
    allowed: 0..=u32::MAX,
    meaning: "6083h and 6084h, as the drive counts them: so steep that they add nothing; 0: left as they are",
};

const VELOCITY_DELAY: Assumption = Assumption {
    name: "velocity_delay_us",
    default: 0,
    allowed: 0..=20_000,
    meaning: "time in µs from the SYNC that latches a velocity until the drive begins to go there",
};

const VELOCITY_LAG: Assumption = Assumption {
    name: "velocity_lag_us",
    default: 250,
    allowed: 0..=100_000,
    meaning: "time constant in µs with which the motor follows the drive's velocity reference",
};

/// 6007h, what a lost connection does: it is a fault.
const CONNECTION_LOST_IS_FAULT: i16 = 1;

/// The operating mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Profile = 3,
    Synchronous = 9,
}

/// One drive.
#[derive(Clone, Debug)]
struct Cia402Velocity {
    spec: NodeSpec,
    pdos: Pdos,
    mode: Mode,
    /// Units of 60FFh for an increment/s.
    units: f64,
    latency: f64,
    dynamics: Dynamics,
    tells_following: bool,
    turns_spindle: bool,
}

impl Cia402Velocity {
    fn new(model: &'static Model, settings: &Settings, mode: Mode) -> Self {
        let assumed = &settings.assumed;
        let kind = Kind {
            mode: mode as u8,
            setpoint: 0x60FF_0020,
            actual: generic::POSITION,
        };
        let units = cia402::velocity_units(
            assumed.value(&VELOCITY_UNITS),
            assumed.value(&VELOCITY_RPM),
            assumed.value(&ENCODER_INCREMENTS),
        );
        let cycle = settings.cycle.as_secs_f64();
        let delay = assumed.time(&VELOCITY_DELAY).as_secs_f64();
        let lag = assumed.time(&VELOCITY_LAG).as_secs_f64();
        // On a straight line from the velocity before it is half a cycle behind.
        let line = match mode {
            Mode::Synchronous if assumed.value(&INTERPOLATES) != 0 => 0.5,
            Mode::Synchronous | Mode::Profile => 0.0,
        };
        let own = own(settings, mode, units);
        let (spec, pdos) = generic::spec(model, settings, kind, own);
        Self {
            spec,
            pdos,
            mode,
            units,
            latency: 1.0 + line + delay / cycle,
            dynamics: Dynamics {
                lag,
                // From a sample to the middle of the cycle in which it takes effect are one and a half, and it may be older.
                gain: Dynamics::gain(
                    lag + delay + (1.5 + line) * cycle + Dynamics::oldest(settings),
                ),
                quantum: units.recip(),
                told_delay: &VELOCITY_DELAY,
                told_lag: Some(&VELOCITY_LAG),
            },
            tells_following: mode == Mode::Synchronous && assumed.value(&TELLS_FOLLOWING) != 0,
            turns_spindle: settings.profile_velocity,
        }
    }
}

/// The part of the set-up that is the mode's, of a drive with so many `units` for an increment/s.
fn own(settings: &Settings, mode: Mode, units: f64) -> Vec<Write> {
    let abort_connection = Data::u16(CONNECTION_LOST_IS_FAULT as u16);
    let mut own = vec![Write::new(0x6007, 0, abort_connection)];
    match mode {
        Mode::Synchronous => own.extend(generic::period(settings)),
        Mode::Profile => match ramp(settings, units) {
            0 => {}
            ramp => own.extend([0x6083, 0x6084].map(|it| Write::new(it, 0, Data::u32(ramp)))),
        },
    }
    own
}

/// 6083h and 6084h; 0: they are left as they are. Those of a spindle are its own.
fn ramp(settings: &Settings, units: f64) -> u32 {
    match settings.profile_velocity {
        true => ((settings.acceleration * units).round() as u32).max(1),
        false => settings.assumed.value(&RAMP),
    }
}

/// Setpoints, ramps and what a lost connection does are the controller's, too; tuning is the user's.
fn reserved(address: Address) -> bool {
    generic::reserved(address) || matches!(address.index, 0x6007 | 0x6083 | 0x6084 | 0x60FF)
}

/// What the bytes of its EMCY mean is the maker's affair, and nobody knows who that is.
impl RemoteNode for Cia402Velocity {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }

    fn mapped(&self) -> Vec<&Mapping> {
        self.pdos.all()
    }
}

impl Feedback for Cia402Velocity {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        let arranged = self.pdos.transmit.arranged(data);
        cia402::sample(arranged.data())
    }

    /// What turns on and on comes to the end of 6064h.
    fn range(&self) -> Option<Increments> {
        self.turns_spindle.then_some(Increments::new(1 << 32))
    }

    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        let arranged = cia402::in_motion(position);
        vec![
            self.pdos
                .transmit
                .frame(self.spec.t_pdos[0].cob_id, &arranged),
        ]
    }
}

impl Drive for Cia402Velocity {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(cia402::SURVEY)
    }

    fn mode(&self) -> Option<ModeDisplay> {
        Some(cia402::shows(self.mode as i8))
    }

    /// It does as it is told as soon as it is enabled.
    fn ends_mode(&self) -> bool {
        false
    }

    fn latency(&self) -> f64 {
        self.latency
    }

    /// As 60FFh has 32 bits.
    fn most_velocity(&self) -> f64 {
        f64::from(i32::MAX) / self.units
    }

    fn dynamics(&self) -> Option<Dynamics> {
        Some(self.dynamics)
    }

    /// In neither mode the profile has a bit for an error in Operation Enabled.
    fn status(&mut self, _: usize, data: &[u8]) -> Option<DriveStatus> {
        let arranged = self.pdos.transmit.arranged(data);
        match self.tells_following {
            true => cia402::status(arranged.data(), None),
            false => cia402::status_of_bare_mode(arranged.data()),
        }
    }

    /// Of a spindle whether 60FFh can hold its velocity.
    fn check(&self, setpoint: Setpoint) -> Result<(), OutOfRange> {
        let inside = match self.turns_spindle {
            true => (setpoint.velocity * self.units).abs() <= i32::MAX.into(),
            false => self.spec.model.positions.contains(&setpoint.position),
        };
        inside.then_some(()).ok_or(OutOfRange)
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let controlword = cia402::controlword(command, 0);
        let velocity = setpoint.velocity * self.units;
        let arranged = cia402::at_velocity(controlword, command, velocity);
        frames[0] = self
            .pdos
            .receive
            .frame(self.spec.r_pdos[0].cob_id, &arranged);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Assumed, NotFollowing};
    use super::*;
    use core::time::Duration;
    use proptest::prelude::*;
    use syncline_canopen::{CobId, NodeId};

    fn drive(mode: Mode, cycle_us: u64, assumed: &[(&'static str, u32)]) -> Cia402Velocity {
        let (node, cycle) = (NodeId::new(3).unwrap(), Duration::from_micros(cycle_us));
        let settings = Settings {
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        };
        let model = match mode {
            Mode::Synchronous => &CIA402_CSV,
            Mode::Profile => &CIA402_PV,
        };
        Cia402Velocity::new(model, &settings, mode)
    }

    /// From the mode to the mapping.
    fn own_writes(drive: &Cia402Velocity) -> Vec<String> {
        let writes = drive.spec.setup.iter();
        let writes = writes.map(|it| format!("{} = {}", it.address, it.data));
        let own = writes.skip_while(|it| !it.starts_with("6060h"));
        own.take_while(|it| !it.starts_with("1A00h")).collect()
    }

    #[test]
    fn each_mode_has_its_own_set_up() {
        assert_eq!(
            own_writes(&drive(Mode::Synchronous, 2000, &[])),
            [
                "6060h:0 = 09h",
                "6007h:0 = 0001h",
                "60C2h:1 = 02h",
                "60C2h:2 = FDh",
                "1600h:0 = 00h",
                "1600h:1 = 60400010h",
                "1600h:2 = 60FF0020h",
                "1600h:0 = 02h",
            ]
        );
        assert_eq!(
            own_writes(&drive(Mode::Profile, 2000, &[("ramp", 500)]))[..4],
            [
                "6060h:0 = 03h",
                "6007h:0 = 0001h",
                "6083h:0 = 000001F4h",
                "6084h:0 = 000001F4h",
            ]
        );
        assert_eq!(own_writes(&drive(Mode::Profile, 2000, &[])).len(), 6);
    }

    #[test]
    fn nobody_else_writes_what_it_is_set_up_and_sent_by() {
        for mode in [Mode::Synchronous, Mode::Profile] {
            let drive = drive(mode, 2000, &[("ramp", 500)]);
            let setup = drive.spec.setup.iter().map(|write| write.address);
            let scaling = drive.spec.identity.iter().map(|it| it.address);
            let scaling = scaling.filter(|it| [0x608F, 0x6091].contains(&it.index));
            let setpoint = Address::new(0x60FF, 0);
            for address in setup.chain(scaling).chain([setpoint]) {
                assert!((drive.spec.model.reserved)(address), "{mode:?} {address}");
            }
            assert!(!(drive.spec.model.reserved)(Address::new(0x60F6, 1)));
        }
    }

    #[test]
    fn a_spindles_ramps_are_its_own_and_it_counts_on() {
        let (node, cycle) = (NodeId::new(3).unwrap(), Duration::from_millis(2));
        let settings = |units| Settings {
            profile_velocity: true,
            // 25 rev/s².
            acceleration: 26_214_400.0,
            assumed: Assumed(vec![("velocity_units", units), ("ramp", 7)]),
            ..Settings::new(node, cycle)
        };
        for (units, ramp) in [(0, "01900000h"), (1, "000005DCh"), (10, "00003A98h")] {
            let drive = Cia402Velocity::new(&CIA402_PV, &settings(units), Mode::Profile);
            let expected = [0x6083, 0x6084].map(|it| format!("{it:X}h:0 = {ramp}"));
            assert_eq!(own_writes(&drive)[2..4], expected);
            assert_eq!(drive.range(), Some(Increments::new(1 << 32)));
        }
        let drive = Cia402Velocity::new(&CIA402_PV, &settings(1), Mode::Profile);
        let turning = |rpm: f64| Setpoint {
            velocity: rpm / 60.0 * 1_048_576.0,
            position: Increments::new(1 << 40),
            ..Setpoint::default()
        };
        assert_eq!(drive.check(turning(-2_147_483_647.0)), Ok(()));
        assert_eq!(drive.check(turning(2_147_484_000.0)), Err(OutOfRange));
    }

    #[test]
    fn bit_12_says_in_one_mode_that_it_follows_and_in_the_other_that_it_stands() {
        use NotFollowing::ModeEnded;
        for (mode, assumed, word, expected) in [
            (Mode::Synchronous, &[][..], 0x1237u16, Ok(())),
            (Mode::Synchronous, &[], 0x0237, Err(ModeEnded)),
            (Mode::Synchronous, &[("tells_following", 0)], 0x0237, Ok(())),
            (Mode::Profile, &[], 0x0237, Ok(())),
            (Mode::Profile, &[], 0x1237, Ok(())),
            // Neither is an error: reserved, and slippage.
            (Mode::Synchronous, &[], 0x3237, Ok(())),
            (Mode::Profile, &[], 0x2237, Ok(())),
        ] {
            let status = drive(mode, 2000, assumed).status(0, &word.to_le_bytes());
            assert_eq!(
                status.unwrap().follows(true),
                expected,
                "{mode:?} {word:04X}"
            );
        }
    }

    #[test]
    fn what_is_late_by_a_part_of_a_cycle_leads_the_loop_by_it() {
        let late = drive(
            Mode::Synchronous,
            2000,
            &[("velocity_delay_us", 500), ("velocity_lag_us", 1000)],
        );
        assert_eq!(late.latency(), 1.75);
        assert_eq!(late.dynamics().unwrap().lag, 1e-3);
        assert_eq!(
            drive(Mode::Synchronous, 2000, &[("interpolates", 0)]).latency(),
            1.0
        );
        assert_eq!(drive(Mode::Profile, 2000, &[]).latency(), 1.0);
    }

    proptest! {
        /// Whatever a unit is, what is sent is the velocity to half of it, and none unless the drive is to run.
        #[test]
        fn a_velocity_is_sent_in_the_drives_unit(
            units in 1..1_000_000u32,
            rpm in 1..10_000u32,
            increments in 1000..1u32 << 24,
            share in -1.0..1.0f64,
            runs: bool,
        ) {
            let most = (f64::from(i32::MAX) / f64::from(units)).min(20_000.0 / f64::from(rpm));
            let of_rpm = share * most * f64::from(rpm);
            let assumed = [("velocity_units", units), ("velocity_rpm", rpm), ("encoder_increments", increments)];
            let mut drive = drive(Mode::Synchronous, 2000, &assumed);
            let command = if runs { PowerCommand::Run } else { PowerCommand::Enable };
            let mut frames = [Frame::new(CobId::SYNC, &[])];
            let setpoint = Setpoint {
                velocity: of_rpm / 60.0 * f64::from(increments),
                ..Setpoint::default()
            };
            drive.encode(command, setpoint, &mut frames);
            let [_, _, bytes @ ..] = frames[0].data() else { unreachable!() };
            let sent = i32::from_le_bytes(bytes.try_into().unwrap());
            let expected = if runs { of_rpm * f64::from(units) / f64::from(rpm) } else { 0.0 };
            prop_assert!((f64::from(sent) - expected).abs() <= 0.5 + 1e-9 * expected.abs(), "{sent} of {expected}");
        }
    }
}
