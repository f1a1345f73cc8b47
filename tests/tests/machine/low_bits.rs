//! A drive whose setpoint holds the low bits of a position, and no more: the judge counts on.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{Address, Frame};
use syncline_controller::machine::Machine;
use syncline_controller::observe::summary::Summary;
use syncline_controller::program::Programs;
use syncline_controller::validate::Inputs;
use syncline_drives::model::{
    Device, Drive, DriveStatus, Feedback, Increments, IoSettings, MODELS, Make, ModeDisplay, Model,
    NodeSpec, PowerCommand, RemoteNode, Sample, Setpoint, Setpoints, Settings, Survey,
};
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::PORTAL_PROGRAM;

/// An object of 16 bits that has no meaning to an LXM32M whose outputs are not used: here it is its setpoint.
static SETPOINT: [Address; 1] = [Address::new(0x3008, 0x11)];
/// Where it is in the R_PDO, behind controlword and the setpoint that the twin follows.
const PLACE: usize = 6;

/// In this setpoint since it runs, all axes being on their way, it is sent to somewhere else.
const FORGED: u32 = 100;

/// An LXM32M that is sent its position once more, modulo `RANGE`: to the judge that is its setpoint. One of
/// them is `OFF` increments off.
#[derive(Clone, Debug)]
struct LowBits<const RANGE: i64, const OFF: i64> {
    drive: Box<dyn Drive>,
    /// Setpoints since it runs.
    sent: u32,
}

impl<const RANGE: i64, const OFF: i64> RemoteNode for LowBits<RANGE, OFF> {
    fn spec(&self) -> &NodeSpec {
        self.drive.spec()
    }
}

impl<const RANGE: i64, const OFF: i64> Feedback for LowBits<RANGE, OFF> {
    fn sample(&self, t_pdo: usize, data: &[u8]) -> Option<Sample> {
        self.drive.sample(t_pdo, data)
    }

    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        self.drive.in_motion(position)
    }
}

impl<const RANGE: i64, const OFF: i64> Drive for LowBits<RANGE, OFF> {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        self.drive.survey()
    }

    fn mode(&self) -> Option<ModeDisplay> {
        self.drive.mode()
    }

    fn ends_mode(&self) -> bool {
        self.drive.ends_mode()
    }

    fn latency(&self) -> f64 {
        self.drive.latency()
    }

    fn status(&mut self, t_pdo: usize, data: &[u8]) -> Option<DriveStatus> {
        self.drive.status(t_pdo, data)
    }

    fn position_objects(&self) -> &'static [Address] {
        &SETPOINT
    }

    fn setpoint_range(&self) -> Option<Increments> {
        Some(Increments::new(RANGE))
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        self.drive.encode(command, setpoint, frames);
        self.sent += u32::from(command == PowerCommand::Run);
        let off = if self.sent == FORGED { OFF } else { 0 };
        let low = (setpoint.position.get() + off).rem_euclid(RANGE) as u16;
        let mut data = [0; 8];
        data[..PLACE].copy_from_slice(&frames[0].data()[..PLACE]);
        data[PLACE..].copy_from_slice(&low.to_le_bytes());
        frames[0] = Frame::new(self.drive.spec().r_pdos[0].cob_id, &data);
    }
}

fn lxm32m() -> &'static Model {
    let mut models = MODELS.iter();
    models.find(|it| it.name == "lxm32m").expect("it is there")
}

fn make<const RANGE: i64, const OFF: i64>(
    _: &'static Model,
    settings: &Settings,
) -> Box<dyn Drive> {
    let io = IoSettings {
        outputs: 1,
        ..settings.io.clone()
    };
    let settings = Settings {
        io,
        ..settings.clone()
    };
    match lxm32m().device(&settings) {
        Device::Drive(drive) => Box::new(LowBits::<RANGE, OFF> { drive, sent: 0 }),
        _ => unreachable!("it moves an axis"),
    }
}

type MakeDrive = fn(&'static Model, &Settings) -> Box<dyn Drive>;

/// The verdict on the portal whose drives are made so. Z, which counts most for its speed, moves by no more than a
/// machine file may ask for with setpoints of `range` values; Y and Z count from `zeros`.
fn judged(make: MakeDrive, range: i64, zeros: [i32; 2]) -> Summary {
    let folder = Folder::new();
    let most = (range / 2 - 2) as f64 / 3.0 / 131_072.0 * 10.0 / 0.002;
    let text = machine_with(
        "portal",
        &[
            ("max_velocity = 500.0", &format!("max_velocity = {most:.3}")),
            ("zero = 402_131", &format!("zero = {}", zeros[0])),
            ("zero = 5_000_000", &format!("zero = {}", zeros[1])),
        ],
    );
    let file = folder.file("machine.toml", &text);
    let mut machine = Machine::load(&file).expect("a good machine");
    let model: &'static Model = Box::leak(Box::new(Model {
        make: Make::Drive(Setpoints::Positions, make),
        ..lxm32m().clone()
    }));
    for drive in &mut machine.drives {
        drive.model = model;
    }
    let programs = Programs::new(&machine, &file).expect("no tables");
    let program = programs.file(&folder.file("program.ngc", PORTAL_PROGRAM));
    let inputs = Inputs { machine, programs };
    let validated = inputs.validate(program, 0, false, |_| true);
    validated.expect("a result").0
}

#[test]
fn a_setpoint_that_is_off_is_found_behind_its_low_bits() {
    for make in [
        make::<65_536, 2>,
        make::<65_536, -20>,
        make::<65_536, 30_000>,
    ] {
        let summary = judged(make, 65_536, [402_131, 5_000_000]);
        let off = |axis: &str| {
            let mut violations = summary.violations.iter();
            violations.any(|it| it.axis.as_deref() == Some(axis) && it.what == "sent off the plan")
        };
        assert!(
            off("X") && off("Y") && off("Z"),
            "{:#?}",
            summary.violations
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Whatever its range is, and wherever the drives count from.
    #[test]
    fn what_is_sent_as_planned_passes(
        (make, range) in select(&[
            (make::<65_536, 0> as MakeDrive, 65_536),
            (make::<50_000, 0> as MakeDrive, 50_000),
            (make::<40_000, 0> as MakeDrive, 40_000),
            (make::<39_501, 0> as MakeDrive, 39_501),
        ][..]),
        zeros: [i16; 2],
    ) {
        let summary = judged(make, range, zeros.map(|it| i32::from(it) * 1000));
        prop_assert_eq!(summary.verdict, "pass", "{:#?}", summary.violations);
    }
}
