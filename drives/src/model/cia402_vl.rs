//! A drive as the profile has it that turns a spindle in its velocity mode, as frequency inverters have it: CiA 402 (IEC
//! 61800-7-201), mode 2, "vl". Drives that a file describes are instances of it.
//!
//! R_PDO and T_PDO bring controlword and 6042h, statusword and 6044h, both at every SYNC. 6042h is a speed of 16 bits,
//! to which the drive goes by its own ramps, 6048h and 6049h: a difference of speeds in so many seconds. 6046h is the greatest
//! amount of it. Controlword bits 4 and 5 let the ramp run, and bit 6 gives it 6042h to go to; without bit 6 it goes
//! to zero. No bit of the statusword is the mode's own.
//!
//! It need not have an encoder, and tells no position: 6044h is how fast the spindle turns, as the drive knows it. So
//! it moves no axis, and no thread follows it.
//!
//! A drive that has lost its master would go on. What it does then (6007h) is therefore set: it is a fault.

use super::profile::cia402;
use super::profile::generic::{self, Kind, Pdos};
use super::{
    Address, Assumed, Assumption, Data, Drive, DriveStatus, Feedback, Increments, Make, Mapping,
    ModeDisplay, Model, NodeSpec, OutOfRange, PowerCommand, RemoteNode, Sample, Setpoint,
    Setpoints, Settings, Survey, Write,
};
use crate::dictionary;
use syncline_canopen::Frame;
use syncline_canopen::cia402::Controlword;

/// The drive in velocity mode.
pub(super) static CIA402_VL: Model = Model {
    // Increments/s are revolutions a minute.
    increments_per_revolution: |_| 60,
    assumptions: &[
        &[VELOCITY_UNITS, VELOCITY_RPM, HAS_DIMENSION_FACTOR],
        generic::DRIVE,
    ],
    dictionary: dictionary::CIA402_VL,
    reserved,
    ..generic::drive(
        "cia402_vl",
        "CiA 402 VL",
        Make::Drive(Setpoints::Speeds, |model, settings| {
            Box::new(Cia402Vl::new(model, settings))
        }),
    )
};

const VELOCITY_UNITS: Assumption = Assumption {
    name: "velocity_units",
    default: 1,
    allowed: 1..=1_000_000,
    meaning: "what 6042h counts at velocity_rpm revolutions a minute",
};

const VELOCITY_RPM: Assumption = Assumption {
    name: "velocity_rpm",
    default: 1,
    allowed: 1..=1_000_000,
    meaning: "revolutions a minute at which 6042h counts velocity_units",
};

const HAS_DIMENSION_FACTOR: Assumption = Assumption {
    name: "has_dimension_factor",
    default: 1,
    allowed: 0..=1,
    meaning: "1: 604Ch is set to what 6042h counts; 0: it has no such object, and counts as velocity_units says",
};

const KIND: Kind = Kind {
    mode: 2,
    setpoint: 0x6042_0010,
    actual: 0x6044_0010,
};

/// The ramp runs.
const RAMP_RUNS: u16 = Controlword::MODE_4 | Controlword::MODE_5;
/// It goes to 6042h.
const RAMP_IS_LED: u16 = Controlword::MODE_6;

/// 6007h, what a lost connection does: it is a fault.
const CONNECTION_LOST_IS_FAULT: u16 = 1;

/// One drive.
#[derive(Clone, Debug)]
struct Cia402Vl {
    spec: NodeSpec,
    pdos: Pdos,
    /// Units of 6042h for 1/min.
    units: f64,
}

impl Cia402Vl {
    fn new(model: &'static Model, settings: &Settings) -> Self {
        let units = units(&settings.assumed);
        let own = own(settings, units);
        let (spec, pdos) = generic::spec(model, settings, KIND, own);
        Self { spec, pdos, units }
    }
}

fn units(assumed: &Assumed) -> f64 {
    f64::from(assumed.value(&VELOCITY_UNITS)) / f64::from(assumed.value(&VELOCITY_RPM))
}

/// The part of the set-up that is the mode's, of a drive with so many `units` for 1/min.
fn own(settings: &Settings, units: f64) -> Vec<Write> {
    let assumed = &settings.assumed;
    let abort_connection = Data::u16(CONNECTION_LOST_IS_FAULT);
    let mut own = vec![Write::new(0x6007, 0, abort_connection)];
    if assumed.value(&HAS_DIMENSION_FACTOR) != 0 {
        // So many 1/min are so many units.
        let [rpm, units] = [&VELOCITY_RPM, &VELOCITY_UNITS].map(|it| assumed.value(it) as i32);
        own.push(Write::new(0x604C, 1, Data::i32(rpm)));
        own.push(Write::new(0x604C, 2, Data::i32(units)));
    }
    let most = (settings.velocity * units).ceil();
    own.push(Write::new(0x6046, 1, Data::u32(0)));
    own.push(Write::new(0x6046, 2, Data::u32(most as u32)));
    let (difference, seconds) = ramp(settings, units);
    for index in [0x6048, 0x6049] {
        own.push(Write::new(index, 1, Data::u32(difference)));
        own.push(Write::new(index, 2, Data::u16(seconds)));
    }
    own
}

/// The ramp as a difference of speeds, at least 1, in whole seconds: as many as it takes to the greatest speed, so that units tell
/// it as finely as they tell that.
fn ramp(settings: &Settings, units: f64) -> (u32, u16) {
    let takes = match settings.acceleration > 0.0 {
        true => settings.velocity / settings.acceleration,
        false => 0.0,
    };
    let seconds = (takes.ceil() as u16).max(1);
    let difference = settings.acceleration * units * f64::from(seconds);
    ((difference.round() as u32).max(1), seconds)
}

/// Setpoints, ramps, limits and what a lost connection does are the controller's, too; tuning is the user's.
fn reserved(address: Address) -> bool {
    generic::reserved(address)
        || matches!(
            address.index,
            0x6007 | 0x6042 | 0x6046 | 0x6048 | 0x6049 | 0x604C
        )
}

/// What the bytes of its EMCY mean is the maker's affair, and nobody knows who that is.
impl RemoteNode for Cia402Vl {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }

    fn mapped(&self) -> Vec<&Mapping> {
        self.pdos.all()
    }
}

impl Feedback for Cia402Vl {
    /// It tells none.
    fn sample(&self, _: usize, _: &[u8]) -> Option<Sample> {
        None
    }

    fn in_motion(&self, _: Increments) -> Vec<Frame> {
        let operation_enabled = 0x0237u16.to_le_bytes();
        let [s0, s1] = operation_enabled;
        let arranged = [s0, s1, 0, 0];
        vec![
            self.pdos
                .transmit
                .frame(self.spec.t_pdos[0].cob_id, &arranged),
        ]
    }
}

impl Drive for Cia402Vl {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(cia402::SURVEY)
    }

    fn mode(&self) -> Option<ModeDisplay> {
        Some(cia402::shows(KIND.mode as i8))
    }

    /// It does as it is told as soon as it is enabled.
    fn ends_mode(&self) -> bool {
        false
    }

    fn latency(&self) -> f64 {
        1.0
    }

    /// The mode has no bit of its own.
    fn status(&mut self, _: usize, data: &[u8]) -> Option<DriveStatus> {
        cia402::status_of_bare_mode(self.pdos.transmit.arranged(data).data())
    }

    fn speed(&self, _: usize, data: &[u8]) -> Option<f64> {
        let arranged = self.pdos.transmit.arranged(data);
        let &[_, _, low, high, ..] = arranged.data() else {
            return None;
        };
        Some(f64::from(i16::from_le_bytes([low, high])) / self.units)
    }

    fn speed_step(&self) -> Option<f64> {
        Some(self.units.recip())
    }

    /// Whether 6042h can hold its speed.
    fn check(&self, setpoint: Setpoint) -> Result<(), OutOfRange> {
        let inside = (setpoint.velocity * self.units).abs() <= i16::MAX.into();
        inside.then_some(()).ok_or(OutOfRange)
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let (bits, velocity) = match command {
            PowerCommand::Run => (RAMP_RUNS | RAMP_IS_LED, setpoint.velocity),
            PowerCommand::Enable | PowerCommand::Halt => (RAMP_RUNS, 0.0),
            _ => (0, 0.0),
        };
        let [c0, c1] = cia402::controlword(command, 0).with(bits).0.to_le_bytes();
        let [v0, v1] = ((velocity * self.units).round() as i16).to_le_bytes();
        let arranged = [c0, c1, v0, v1];
        frames[0] = self
            .pdos
            .receive
            .frame(self.spec.r_pdos[0].cob_id, &arranged);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::time::Duration;
    use proptest::prelude::*;
    use syncline_canopen::{CobId, NodeId};

    /// With that greatest speed, 1/min, and the time to it, s.
    fn drive(assumed: &[(&'static str, u32)], velocity: f64, takes: f64) -> Cia402Vl {
        let (node, cycle) = (NodeId::new(4).unwrap(), Duration::from_millis(2));
        let settings = Settings {
            assumed: Assumed(assumed.to_vec()),
            profile_velocity: true,
            velocity,
            acceleration: velocity / takes,
            ..Settings::new(node, cycle)
        };
        Cia402Vl::new(&CIA402_VL, &settings)
    }

    /// From the mode to the mapping.
    fn own_writes(drive: &Cia402Vl) -> Vec<String> {
        let writes = drive.spec.setup.iter();
        let writes = writes.map(|it| format!("{} = {}", it.address, it.data));
        let own = writes.skip_while(|it| !it.starts_with("6060h"));
        own.take_while(|it| !it.starts_with("1400h")).collect()
    }

    #[test]
    fn its_limits_and_ramps_are_set_up_and_its_pdos_mapped() {
        let drive = drive(&[("velocity_units", 10)], 3000.0, 1.5);
        assert_eq!(
            own_writes(&drive),
            [
                "6060h:0 = 02h",
                "6007h:0 = 0001h",
                "604Ch:1 = 00000001h",
                "604Ch:2 = 0000000Ah",
                "6046h:1 = 00000000h",
                "6046h:2 = 00007530h",
                "6048h:1 = 00009C40h", // 40 000 tenths in 2 s
                "6048h:2 = 0002h",
                "6049h:1 = 00009C40h",
                "6049h:2 = 0002h",
                "1600h:0 = 00h",
                "1600h:1 = 60400010h",
                "1600h:2 = 60420010h",
                "1600h:0 = 02h",
                "1A00h:0 = 00h",
                "1A00h:1 = 60410010h",
                "1A00h:2 = 60440010h",
                "1A00h:0 = 02h",
            ]
        );
        assert_eq!(
            (drive.spec.r_pdos[0].bytes, drive.spec.t_pdos[0].bytes),
            (4, 4)
        );
        // Nothing is asked of a position.
        let mut identity = drive.spec.identity.iter();
        assert!(identity.all(|it| !matches!(it.address.index, 0x608F | 0x6091)));
    }

    #[test]
    fn without_604ch_it_counts_as_it_does() {
        let drive = drive(&[("has_dimension_factor", 0)], 3000.0, 0.3);
        assert!(own_writes(&drive).iter().all(|it| !it.starts_with("604C")));
    }

    #[test]
    fn nobody_else_writes_what_it_is_set_up_and_sent_by() {
        let drive = drive(&[], 3000.0, 0.3);
        let setup = drive.spec.setup.iter().map(|write| write.address);
        for address in setup.chain([Address::new(0x6042, 0)]) {
            assert!((drive.spec.model.reserved)(address), "{address}");
        }
        assert!(!(drive.spec.model.reserved)(Address::new(0x604A, 1)));
    }

    #[test]
    fn the_ramp_leads_to_zero_unless_it_runs() {
        let mut drive = drive(&[], 3000.0, 0.3);
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        let setpoint = Setpoint {
            velocity: -2000.4,
            ..Setpoint::default()
        };
        for (command, word, velocity) in [
            (PowerCommand::Disable, 0x00, 0),
            (PowerCommand::Prepare, 0x06, 0),
            (PowerCommand::Enable, 0x3F, 0),
            (PowerCommand::Run, 0x7F, -2000),
            (PowerCommand::Halt, 0x013F, 0),
            (PowerCommand::QuickStop, 0x0B, 0),
        ] {
            drive.encode(command, setpoint, &mut frames);
            let [c0, c1, v0, v1] = *frames[0].data() else {
                panic!("{:?}", frames[0])
            };
            let sent = (u16::from_le_bytes([c0, c1]), i16::from_le_bytes([v0, v1]));
            assert_eq!(sent, (word, velocity), "{command:?}");
        }
    }

    proptest! {
        /// In whatever unit: what it is sent is what it tells at that speed, 6048h leads to the greatest speed in the
        /// ramp's time, 6046h lets it through, and 6042h holds what is not refused.
        #[test]
        fn speeds_and_ramps_are_right_in_every_unit(
            units in 1u32..1000,
            rpm in 1u32..1000,
            most in 1.0..60_000.0f64,
            part in -1.0..1.0f64,
            takes in 0.001..600.0f64,
        ) {
            let mut drive = drive(&[("velocity_units", units), ("velocity_rpm", rpm)], most, takes);
            let step = f64::from(rpm) / f64::from(units);
            let number = |text: &str| {
                let writes = own_writes(&drive);
                let write = writes.iter().find(|it| it.starts_with(text)).unwrap();
                let (_, value) = write.split_once(" = ").unwrap();
                f64::from(u32::from_str_radix(value.trim_end_matches('h'), 16).unwrap())
            };
            let greatest = number("6046h:2") * step;
            prop_assert!(greatest >= most - 1e-6 && greatest <= most + step + 1e-6, "{greatest}");
            for index in ["6048h", "6049h"] {
                let slope = number(&format!("{index}:1")) * step / number(&format!("{index}:2"));
                // To half a unit, or one in a second at least.
                let wanted = most / takes;
                prop_assert!((slope - wanted).abs() <= step + 1e-9 * wanted, "{slope} of {wanted}");
            }
            let setpoint = Setpoint { velocity: part * most, ..Setpoint::default() };
            let fits = (part * most / step).abs() <= 32_767.0;
            prop_assert_eq!(drive.check(setpoint).is_ok(), fits);
            if fits {
                let mut frames = [Frame::new(CobId::SYNC, &[])];
                drive.encode(PowerCommand::Run, setpoint, &mut frames);
                let [_, _, v0, v1] = *frames[0].data() else { unreachable!() };
                let told = drive.speed(0, &[0x37, 0x02, v0, v1]).unwrap();
                prop_assert!((told - part * most).abs() <= 0.5 * step + 1e-6, "{told}");
            }
        }
    }
}
