//! A servo drive as the profile has it: CiA 402 (IEC 61800-7-201) in Cyclic Synchronous Position, or in Interpolated
//! Position, by the profile's own objects. Drives that a file describes are instances of it.
//!
//! Cyclic Synchronous Position has no start: an enabled drive runs to 607Ah within the cycle after each SYNC, and
//! statusword bit 12 says so. Interpolated Position runs to 60C1h:1, from controlword bit 4 on. Nothing that a maker adds is used, no clock that follows SYNC
//! either; what the profile leaves to the maker is an [`Assumption`].
//!
//! Positions are encoder increments at the motor's shaft. What a revolution counts (608Fh) and that
//! the drive reckons with no gear of its own (6091h) is read before anything is written: the travel
//! per motor revolution stands in the machine file. What a drive does not have of this, or does in another way, is an
//! assumption as well.

use super::profile::cia402::{self, INTERPOLATION_DELAY};
use super::profile::generic::{self, COUNTING, Kind, Pdos, SYNCHRONOUS, TELLS_FOLLOWING};
use super::{
    Ability, Address, Assumption, Drive, DriveStatus, Feedback, Increments, Make, Mapping,
    ModeDisplay, Model, NodeSpec, PowerCommand, PowerState, RemoteNode, Sample, Setpoint,
    Setpoints, Settings, Survey,
};
use syncline_canopen::Frame;
use syncline_canopen::cia402::{Controlword, Statusword};

/// The drive.
pub(super) static CIA402_CSP: Model = Model {
    abilities: &[
        Ability::CountsWithinTurn,
        Ability::FollowingErrorLimit,
        Ability::SoftLimits,
        Ability::Torque,
        Ability::TorqueOffset,
    ],
    assumptions: &[
        &[MODE, INTERPOLATION_DELAY],
        COUNTING,
        SYNCHRONOUS,
        generic::DRIVE,
    ],
    reserved,
    ..generic::drive(
        "cia402_csp",
        "CiA 402 CSP",
        Make::Drive(Setpoints::Positions, |model, settings| {
            Box::new(Cia402Csp::new(model, settings))
        }),
    )
};

const MODE: Assumption = Assumption {
    name: "mode",
    default: CYCLIC_SYNCHRONOUS_POSITION,
    allowed: INTERPOLATED_POSITION..=CYCLIC_SYNCHRONOUS_POSITION,
    meaning: "6060h, the operating mode: 8, Cyclic Synchronous Position, or 7, Interpolated Position",
};

const INTERPOLATED_POSITION: u32 = 7;
const CYCLIC_SYNCHRONOUS_POSITION: u32 = 8;

/// Statusword bit 13 in Cyclic Synchronous Position: the following error is beyond 6065h.
const FOLLOWING_ERROR: u16 = Statusword::BIT_13;

/// One drive.
#[derive(Clone, Debug)]
struct Cia402Csp {
    spec: NodeSpec,
    pdos: Pdos,
    interpolation_delay: u32,
    is_interpolated: bool,
    tells_following: bool,
}

impl Cia402Csp {
    fn new(model: &'static Model, settings: &Settings) -> Self {
        let assumed = &settings.assumed;
        let mode = assumed.value(&MODE);
        let kind = Kind {
            mode: mode as u8,
            setpoint: match mode {
                INTERPOLATED_POSITION => 0x60C1_0120,
                _ => 0x607A_0020,
            },
            actual: generic::POSITION,
        };
        let own = [generic::period(settings), cia402::limits(settings)].concat();
        let (spec, pdos) = generic::spec(model, settings, kind, own);
        Self {
            spec,
            pdos,
            interpolation_delay: assumed.value(&INTERPOLATION_DELAY),
            is_interpolated: mode == INTERPOLATED_POSITION,
            tells_following: assumed.value(&TELLS_FOLLOWING) != 0,
        }
    }
}

/// Setpoints and limits are the controller's, too; tuning is the user's.
fn reserved(address: Address) -> bool {
    generic::reserved(address) || matches!(address.index, 0x6065 | 0x607A | 0x607D | 0x60C1)
}

/// What the bytes of its EMCY mean is the maker's affair, and nobody knows who that is.
impl RemoteNode for Cia402Csp {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }

    fn mapped(&self) -> Vec<&Mapping> {
        self.pdos.all()
    }
}

impl Feedback for Cia402Csp {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        let arranged = self.pdos.transmit.arranged(data);
        cia402::sample(arranged.data())
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

impl Drive for Cia402Csp {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(cia402::SURVEY)
    }

    fn mode(&self) -> Option<ModeDisplay> {
        Some(cia402::shows(match self.is_interpolated {
            true => INTERPOLATED_POSITION as i8,
            false => CYCLIC_SYNCHRONOUS_POSITION as i8,
        }))
    }

    fn ends_mode(&self) -> bool {
        self.is_interpolated && self.tells_following
    }

    fn latency(&self) -> f64 {
        self.interpolation_delay.into()
    }

    fn status(&mut self, _: usize, data: &[u8]) -> Option<DriveStatus> {
        let error = (!self.is_interpolated).then_some(FOLLOWING_ERROR);
        let arranged = self.pdos.transmit.arranged(data);
        let status = cia402::status(arranged.data(), error)?;
        let enabled = status.power == PowerState::Enabled;
        Some(DriveStatus {
            mode_runs: status.mode_runs || enabled && !self.tells_following,
            ..status
        })
    }

    fn torque(&self, _: usize, data: &[u8]) -> Option<i16> {
        generic::torque(self.pdos.transmit.arranged(data).data())
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let start = match self.is_interpolated {
            true => Controlword::MODE_4,
            false => 0,
        };
        let word = cia402::controlword(command, start);
        let [p0, p1, p2, p3, p4, p5] = cia402::to_position(word, setpoint.position);
        let [t0, t1] = (setpoint.torque.round() as i16).to_le_bytes();
        // The torque goes where 60B2h is mapped, if it is.
        let arranged = [p0, p1, p2, p3, p4, p5, t0, t1];
        frames[0] = self
            .pdos
            .receive
            .frame(self.spec.r_pdos[0].cob_id, &arranged);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Assumed, Data, NotFollowing, OutOfRange, Write};
    use super::*;
    use core::time::Duration;
    use syncline_canopen::{CobId, NodeId};

    fn csp(settings: &Settings) -> Cia402Csp {
        Cia402Csp::new(&CIA402_CSP, settings)
    }

    fn settings(cycle_us: u64, assumed: &[(&'static str, u32)]) -> Settings {
        let (node, cycle) = (NodeId::new(3).unwrap(), Duration::from_micros(cycle_us));
        Settings {
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        }
    }

    /// As a table: `index:sub bytes value`, hexadecimal.
    fn writes(drive: &Cia402Csp) -> Vec<String> {
        let row = |write: &Write| {
            let Address { index, sub } = write.address;
            let (len, bits) = (write.data.bytes().len(), write.data.bits());
            format!("{index:04X}:{sub:X} {len} {bits:X}")
        };
        drive.spec().setup.iter().map(row).collect()
    }

    #[test]
    fn the_set_up_write_for_write() {
        let drive = csp(&settings(2000, &[]));
        let expected = "
            1400:1 4 80000203, 1401:1 4 80000303, 1402:1 4 80000403, 1403:1 4 80000503,
            1800:1 4 C0000183, 1801:1 4 C0000283, 1802:1 4 C0000383, 1803:1 4 C0000483,
            6040:0 2 0, 6040:0 2 80, 6060:0 1 8, 60C2:1 1 2, 60C2:2 1 FD,
            1600:0 1 0, 1600:1 4 60400010, 1600:2 4 607A0020, 1600:0 1 2,
            1A00:0 1 0, 1A00:1 4 60410010, 1A00:2 4 60640020, 1A00:0 1 2,
            1400:2 1 1, 1800:2 1 1, 1400:1 4 203, 1800:1 4 40000183,
            1017:0 2 64, 1016:1 4 7F00FA";
        let expected: Vec<&str> = expected.split(',').map(str::trim).collect();
        assert_eq!(writes(&drive), expected);
    }

    #[test]
    fn limits_and_own_objects_come_while_the_pdos_are_off() {
        let own = Write::new(0x6085, 0, Data::u32(5));
        let drive = csp(&Settings {
            following_error_limit: Some(Increments::new(26_214)),
            soft_limits: Some((Increments::new(-10), Increments::new(5_000_000_000))),
            objects: vec![own],
            ..settings(2000, &[])
        });
        assert_eq!(
            drive.spec().setup[13..17],
            [
                Write::new(0x6065, 0, Data::u32(26_214)),
                Write::new(0x607D, 1, Data::i32(-10)),
                Write::new(0x607D, 2, Data::i32(i32::MAX)),
                own,
            ]
        );
    }

    #[test]
    fn pdos_have_the_numbers_that_the_machine_file_says() {
        let drive = csp(&settings(2000, &[("r_pdo", 4), ("t_pdo", 2), ("pdos", 1)]));
        assert_eq!(drive.spec().r_pdos[0].cob_id.get(), 0x503);
        assert_eq!(drive.spec().t_pdos[0].cob_id.get(), 0x283);
        let writes = writes(&drive);
        let count = |object: &str| writes.iter().filter(|row| row.starts_with(object)).count();
        // Those below are switched off, those above the drive does not have.
        assert_eq!([count("1402:1"), count("1403:1")], [1, 2]);
        assert_eq!([count("1801:1"), count("1802:1")], [2, 0]);
        assert!(writes.contains(&"1403:1 4 503".into()));
        assert!(writes.contains(&"1603:2 4 607A0020".into()));
        assert!(writes.contains(&"1A01:2 4 60640020".into()));
        assert!(writes.contains(&"1801:1 4 40000283".into()));
    }

    #[test]
    fn cycles_are_half_milliseconds() {
        for micros in [500, 1000, 1500, 19_500, 20_000] {
            assert!(CIA402_CSP.takes_cycle(Duration::from_micros(micros)));
        }
        for micros in [250, 750, 20_500] {
            assert!(!CIA402_CSP.takes_cycle(Duration::from_micros(micros)));
        }
    }

    #[test]
    fn torque_comes_behind_the_position_where_it_is_asked_for() {
        let drive = csp(&Settings {
            torque: true,
            ..settings(2000, &[])
        });
        let writes = writes(&drive);
        let mapped: Vec<_> = writes
            .iter()
            .filter(|row| row.starts_with("1A00"))
            .collect();
        let expected = [
            "1A00:0 1 0",
            "1A00:1 4 60410010",
            "1A00:2 4 60640020",
            "1A00:3 4 60770010",
            "1A00:0 1 3",
        ];
        assert_eq!(mapped, expected);
        assert_eq!(drive.spec().t_pdos[0].bytes, 8);
        let data = [0x37, 0x12, 0, 0, 2, 0, 0x9C, 0xFF];
        assert_eq!(drive.torque(0, &data), Some(-100));
        let silent = csp(&settings(2000, &[]));
        assert_eq!(silent.torque(0, &data[..6]), None);
        // The maker's mapping has no torque.
        let fixed = csp(&Settings {
            torque: true,
            ..settings(2000, &[("fixed_mapping", 1)])
        });
        assert_eq!(fixed.spec().t_pdos[0].bytes, 6);
    }

    #[test]
    fn a_torque_goes_behind_the_position_where_that_is_asked_for() {
        let drive = |assumed| {
            csp(&Settings {
                torque_offset: Some(2_300),
                ..settings(2000, assumed)
            })
        };
        let mut asked = drive(&[]);
        let writes = writes(&asked);
        let rows = writes.iter().filter(|row| row.starts_with("1600"));
        let expected = [
            "1600:0 1 0",
            "1600:1 4 60400010",
            "1600:2 4 607A0020",
            "1600:3 4 60B20010",
            "1600:0 1 3",
        ];
        assert_eq!(rows.collect::<Vec<_>>(), expected);
        let mut identity = asked.spec().identity.iter();
        let rated = identity.find(|it| it.address == Address::new(0x6076, 0));
        assert_eq!(rated.map(|it| it.value), Some(2_300));
        let sent = |drive: &mut Cia402Csp, torque| {
            let mut frames = [Frame::new(CobId::SYNC, &[])];
            let setpoint = Setpoint {
                torque,
                ..Setpoint::at(Increments::new(2))
            };
            drive.encode(PowerCommand::Run, setpoint, &mut frames);
            frames[0].data().to_vec()
        };
        for (torque, bytes) in [
            (-100.4, [0x9C, 0xFF]),
            (0.0, [0, 0]),
            (1e9, [0xFF, 0x7F]),
            (-1e9, [0x00, 0x80]),
        ] {
            assert_eq!(
                sent(&mut asked, torque),
                [&[0x0F, 0, 2, 0, 0, 0][..], &bytes].concat()
            );
        }
        // One that is not asked is sent none, nor one whose maker has mapped none.
        let others = [csp(&settings(2000, &[])), drive(&[("fixed_mapping", 1)])];
        for mut other in others {
            assert_eq!(sent(&mut other, 50.0), [0x0F, 0, 2, 0, 0, 0]);
        }
    }

    #[test]
    fn what_a_revolution_counts_is_the_machine_files() {
        let assumed = [("encoder_increments", 10_000)];
        let drive = csp(&settings(2000, &assumed));
        let expects = |index, sub| {
            let mut identity = drive.spec().identity.iter();
            let found = identity.find(|it| it.address == Address::new(index, sub));
            found.map(|it| it.value)
        };
        assert_eq!(expects(0x608F, 1), Some(10_000));
        assert_eq!(expects(0x6091, 1), Some(1));
        let counts = CIA402_CSP.increments_per_revolution;
        assert_eq!(counts(&Assumed(assumed.to_vec())), 10_000);
        assert_eq!(counts(&Assumed::default()), 1_048_576);
    }

    #[test]
    fn what_a_drive_does_not_have_is_left_alone() {
        let drive = csp(&settings(
            2000,
            &[("has_resolution", 0), ("has_period", 0), ("vendor_id", 7)],
        ));
        let identity = drive.spec().identity.iter();
        let read: Vec<_> = identity.map(|it| it.address.to_string()).collect();
        assert_eq!(read, ["1000h:0", "1018h:1", "6502h:0"]);
        assert!(!writes(&drive).iter().any(|row| row.starts_with("60C2")));
    }

    #[test]
    fn a_drive_that_leaves_bit_12_off_follows_while_it_is_enabled() {
        let mut drive = csp(&settings(2000, &[("tells_following", 0)]));
        let mut runs = |word: u16| {
            let status = drive.status(0, &word.to_le_bytes()).unwrap();
            status.mode_runs
        };
        assert_eq!(
            [0x0237, 0x0231, 0x0218].map(&mut runs),
            [true, false, false]
        );
    }

    #[test]
    fn in_interpolated_position_it_is_started_and_ends() {
        let mut drive = csp(&settings(2000, &[("mode", 7)]));
        let writes = writes(&drive);
        for row in ["6060:0 1 7", "1600:2 4 60C10120"] {
            assert!(writes.contains(&row.into()), "{row}");
        }
        let mut modes = drive.spec().identity.iter();
        let modes = modes.find(|it| it.address.index == 0x6502).unwrap();
        assert_eq!((modes.mask, modes.value), (0x40, 0x40));
        assert_eq!(drive.mode().unwrap().mode, 7);
        assert!(drive.ends_mode());
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        for (command, expected) in [
            (PowerCommand::Enable, "203#0F00FEFFFFFF"),
            (PowerCommand::Run, "203#1F00FEFFFFFF"),
            (PowerCommand::QuickStop, "203#0B00FEFFFFFF"),
        ] {
            drive.encode(command, Setpoint::at(Increments::new(-2)), &mut frames);
            assert_eq!(format!("{:?}", frames[0]), expected);
        }
        // Bit 13 says nothing in this mode.
        let status = drive.status(0, &0x3237u16.to_le_bytes()).unwrap();
        assert!(status.mode_runs && !status.error);
    }

    #[test]
    fn process_image() {
        let mut drive = csp(&settings(2000, &[]));
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        for (command, position, expected) in [
            (PowerCommand::Disable, 0, "203#000000000000"),
            (PowerCommand::Prepare, 1, "203#060001000000"),
            (PowerCommand::Enable, -2, "203#0F00FEFFFFFF"),
            (PowerCommand::Run, -2, "203#0F00FEFFFFFF"),
            (PowerCommand::QuickStop, -2, "203#0B00FEFFFFFF"),
            (PowerCommand::Run, 1 << 31, "203#0F00FFFFFF7F"),
        ] {
            let position = Increments::new(position);
            drive.encode(command, Setpoint::at(position), &mut frames);
            assert_eq!(format!("{:?}", frames[0]), expected);
        }
        let position = |position| Setpoint::at(Increments::new(position));
        assert_eq!(drive.check(position(-2)), Ok(()));
        assert_eq!(drive.check(position(1 << 31)), Err(OutOfRange));
        let data = [0x37, 0x12, 0x00, 0x00, 0x02, 0x00];
        let sample = drive.sample(0, &data).unwrap();
        assert_eq!(sample.position, Increments::new(131_072));
        assert_eq!(drive.sample(0, &data[..5]), None);
    }

    #[test]
    fn statuswords() {
        use NotFollowing as N;
        let mut drive = csp(&settings(2000, &[]));
        for (word, in_mode, expected) in [
            (0x1237, true, Ok(())),
            (0x0237, false, Ok(())),
            (0x12B7, true, Ok(())), // a warning does not stop
            (0x0237, true, Err(N::ModeEnded)),
            (0x1037, true, Err(N::NotRemote)),
            (0x3237, true, Err(N::Error)),
            (0x0217, true, Err(N::QuickStop)),
            (0x0231, true, Err(N::PowerStageOff)),
            (0x0218, true, Err(N::Fault)),
            (0x021F, true, Err(N::Fault)),
        ] {
            let status = drive.status(0, &u16::to_le_bytes(word)).unwrap();
            assert_eq!(status.follows(in_mode), expected, "{word:04X}");
        }
        // Off, bit 13 is no following error.
        let status = drive.status(0, &0x2231u16.to_le_bytes()).unwrap();
        assert!(!status.error);
    }
}
