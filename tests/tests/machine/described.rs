//! Drives that a file describes, in a machine that runs a program.

use proptest::prelude::*;
use serde_json::Value;
use syncline_canopen::eds::Value::Number;
use syncline_canopen::eds::{Access, Eds};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, NodeId};
use syncline_controller::control::fault::{AxisCause, DeviceCause};
use syncline_controller::control::{End, Fault};
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::dictionary::CIA402_CSP;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_tests::command::{Folder, ended, root, syncline};
use syncline_tests::rig::Rig;

const MODEL: &str = "model = \"servo.toml\"";

/// The generic drive's data sheet with one mode, no other PDOs than are said, and no vendor ID. In those two the maker has mapped the
/// controlword and the statusword, and `fixed` behind them, if that is said.
pub(super) fn sheet(mode: u8, pdos: u8, [r_pdo, t_pdo]: [u8; 2], fixed: Option<[u32; 2]>) -> Eds {
    let mut eds = Eds::of(CIA402_CSP);
    for (first, most) in [(0x1400, pdos.max(r_pdo)), (0x1800, pdos.max(t_pdo))] {
        eds.objects.retain(|&index, _| {
            let of = matches!(index & !0x3, it if it == first || it == first + 0x200);
            !of || index % 4 < u16::from(most)
        });
    }
    let modes = eds.objects.get_mut(&0x6502).unwrap();
    modes.subs.get_mut(&0).unwrap().default = Some(Number(1 << (mode - 1)));
    if let Some([setpoint, actual]) = fixed {
        for (index, first, second) in [
            (0x15FF + u16::from(r_pdo), 0x6040_0010, setpoint),
            (0x19FF + u16::from(t_pdo), 0x6041_0010, actual),
        ] {
            let mapping = eds.objects.get_mut(&index).unwrap();
            for (sub, value) in [(0, 2), (1, first), (2, second)] {
                let parameter = mapping.subs.get_mut(&sub).unwrap();
                parameter.default = Some(Number(value.into()));
                parameter.access = Access::Ro;
            }
        }
    }
    let identity = eds.objects.get_mut(&0x1018).unwrap();
    identity.subs.get_mut(&1).unwrap().default = None;
    eds
}

/// The mapping of these PDOs is read-only, and the data sheet does not say what it is.
pub(super) fn leave_mapping_out(eds: &mut Eds, [r_pdo, t_pdo]: [u8; 2]) {
    for index in [0x15FF + u16::from(r_pdo), 0x19FF + u16::from(t_pdo)] {
        if let Some(mapping) = eds.objects.get_mut(&index) {
            for parameter in mapping.subs.values_mut() {
                parameter.default = None;
                parameter.access = Access::Ro;
            }
        }
    }
}

/// A description of X; Y stays the example's.
#[derive(Clone, Debug)]
struct Description {
    mode: u8,
    r_pdo: u8,
    t_pdo: u8,
    pdos: u8,
    encoder_increments: u32,
    has_resolution: bool,
    has_period: bool,
    tells_following: bool,
    interpolates: bool,
    fixed_mapping: bool,
    /// What is mapped stands in the data sheet.
    tells_mapping: bool,
    vendor_id: u32,
    /// Units of velocity at so many revolutions a minute; increments/s.
    velocity_unit: Option<[u32; 2]>,
}

const PROFILE_VELOCITY: u8 = 3;
const VELOCITY: u8 = 9;

impl Description {
    /// Increments are well below the standstill window, 0.05 mm; a unit of velocity is 1 r/min at most.
    fn any() -> impl Strategy<Value = Self> {
        let unit =
            prop::option::of((1..=20u32, 1..=1000u32).prop_map(|(rpm, finer)| [rpm * finer, rpm]));
        (
            (1..=4u8, 1..=4u8, 1..=4u8),
            (8192..=1u32 << 24, any::<[bool; 6]>(), any::<u32>()),
            (
                prop::sample::select(vec![PROFILE_VELOCITY, 7, 8, VELOCITY]),
                unit,
            ),
        )
            .prop_map(
                |((r_pdo, t_pdo, pdos), (encoder_increments, has, vendor_id), (mode, unit))| Self {
                    mode,
                    r_pdo,
                    t_pdo,
                    pdos,
                    // Its ramp has 32 bits.
                    encoder_increments: match (mode, unit) {
                        (PROFILE_VELOCITY, None) => encoder_increments.min(1 << 20),
                        _ => encoder_increments,
                    },
                    has_resolution: has[0],
                    has_period: has[1],
                    tells_following: has[2],
                    interpolates: has[3],
                    fixed_mapping: has[4],
                    tells_mapping: has[5],
                    vendor_id,
                    velocity_unit: unit,
                },
            )
    }

    fn is_sent_velocities(&self) -> bool {
        matches!(self.mode, PROFILE_VELOCITY | VELOCITY)
    }

    /// The object that its R_PDO brings, as it is mapped.
    fn setpoint(&self) -> u32 {
        match self.mode {
            7 => 0x60C1_0120,
            8 => 0x607A_0020,
            _ => 0x60FF_0020,
        }
    }

    /// Keys that not every generic drive has.
    fn own_keys(&self) -> String {
        let flag = u8::from;
        let [units, rpm] = self.velocity_unit.unwrap_or([0, 1]);
        let (period, following) = (flag(self.has_period), flag(self.tells_following));
        let cyclic = format!("has_period = {period}\ntells_following = {following}\n");
        let unit = format!("velocity_units = {units}\nvelocity_rpm = {rpm}\n");
        match self.mode {
            PROFILE_VELOCITY => {
                let of_revolution = match self.velocity_unit {
                    Some([units, rpm]) => f64::from(units) / f64::from(rpm) * 60.0,
                    None => self.encoder_increments.into(),
                };
                // 1500 rev/s², five times what the axis takes.
                let ramp = (1500.0 * of_revolution) as u32;
                format!("generic = \"cia402_pv\"\n{unit}ramp = {ramp}\n")
            }
            VELOCITY => {
                let interpolates = flag(self.interpolates);
                format!("generic = \"cia402_csv\"\n{cyclic}{unit}interpolates = {interpolates}\n")
            }
            mode => format!("generic = \"cia402_csp\"\n{cyclic}mode = {mode}\n"),
        }
    }

    /// Its files; the name of the one that a machine file names.
    fn write(&self, folder: &Folder) -> String {
        let mapped = [self.setpoint(), 0x6064_0020];
        let mut eds = sheet(
            self.mode,
            self.pdos,
            [self.r_pdo, self.t_pdo],
            self.fixed_mapping.then_some(mapped),
        );
        if self.fixed_mapping && !self.tells_mapping {
            leave_mapping_out(&mut eds, [self.r_pdo, self.t_pdo]);
        }
        if !self.has_resolution {
            eds.objects
                .retain(|index, _| ![0x608F, 0x6091].contains(index));
        }
        if !self.has_period {
            eds.objects.remove(&0x60C2);
        }
        let setpoint = (self.setpoint() >> 16) as u16;
        eds.objects
            .retain(|index, _| ![0x607A, 0x60C1, 0x60FF].contains(index) || *index == setpoint);
        let _sheet = folder.file("drive.eds", &eds.to_string());
        let flag = u8::from;
        let text = format!(
            "name = \"drawn\"\neds = \"drive.eds\"\n{}r_pdo = {}\nt_pdo = {}\npdos = {}\n\
             encoder_increments = {}\nhas_resolution = {}\nfixed_mapping = {}\nvendor_id = {}\n",
            self.own_keys(),
            self.r_pdo,
            self.t_pdo,
            self.pdos,
            self.encoder_increments,
            flag(self.has_resolution),
            flag(self.fixed_mapping),
            self.vendor_id,
        );
        folder.file("drive.toml", &text).display().to_string()
    }
}

/// What X of the example asks of its drive, which one that is sent velocities does not have.
const ASKED: (&str, &str) = (
    "drive_following_error = true\ndrive_soft_limits = true\n\n[[axis]]\nname = \"Y\"",
    "\n[[axis]]\nname = \"Y\"",
);

/// What makes a machine with X's drive by that file of the example. Positions: X asks its drive to watch itself.
pub(super) fn replacements(x: &str, cycle_us: u32, positions: bool) -> Vec<(String, String)> {
    let servo = root().join("examples/described/servo.toml");
    let [x, y] = [x, &servo.display().to_string()].map(|file| format!("model = {file:?}"));
    let cycle = format!("cycle_us = {cycle_us}");
    let own = |(from, to): (&str, &str)| (from.to_owned(), to.to_owned());
    // The first one is X's, behind its replacement comes Y's.
    let models = [("cycle_us = 2000", &*cycle), (MODEL, &*x), (MODEL, &*y)];
    let asked = (!positions).then_some(ASKED);
    models.into_iter().chain(asked).map(own).collect()
}

fn rig(x: &str, cycle_us: u32, positions: bool, program: &str) -> Rig {
    let replacements = replacements(x, cycle_us, positions);
    let replacements: Vec<_> = (replacements.iter())
        .map(|(from, to)| (&**from, &**to))
        .collect();
    Rig::new("described", &replacements, program, |_, _| ())
}

/// Following error that the loops have in [`PROGRAM`], mm.
pub(super) const BOUND: f64 = 0.1;

pub(super) const PROGRAM: &str =
    "G21 G90\nG0 X30 Y10\nG1 F9000 X40\nG3 X50 Y20 J10\nG0 X0 Y0\nM2\n";

#[test]
fn the_examples_pass_and_are_the_same_each_time() {
    passes_and_is_the_same_each_time("described");
    passes_and_is_the_same_each_time("velocity");
    passes_and_is_the_same_each_time("inverter");
}

fn passes_and_is_the_same_each_time(example: &str) {
    let folder = root().join("examples").join(example);
    let validated = |seed: &str| -> Value {
        let mut command = syncline();
        command.arg("validate").arg(folder.join("machine.toml"));
        command.arg(folder.join("plate.ngc"));
        let output = command.args(["--json", "-", "--seed", seed]).output();
        let output = output.unwrap();
        let (code, json, errors) = ended(&output);
        assert_eq!(code, 0, "{json}{errors}");
        serde_json::from_str(json).unwrap()
    };
    let [once, again, other] = ["7", "7", "8"].map(validated);
    assert_eq!(once["verdict"], "pass", "{once:#}");
    assert_eq!(once["frames_sha256"], again["frames_sha256"]);
    assert_ne!(once["frames_sha256"], other["frames_sha256"]);
}

/// The built-in model and its description are one: the same frames.
#[test]
fn a_description_that_says_nothing_is_the_generic_drive() {
    let folder = Folder::new();
    let _sheet = folder.file("plain.eds", &Eds::of(CIA402_CSP).to_string());
    let plain = "name = \"plain\"\ngeneric = \"cia402_csp\"\neds = \"plain.eds\"\n";
    let file = folder.file("plain.toml", plain);
    let frames = |model: &str| {
        let model = format!("model = {model:?}");
        let mut rig = Rig::new(
            "described",
            &[(MODEL, &model), (MODEL, &model)],
            PROGRAM,
            |_, _| (),
        );
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let frames = rig.frames();
        frames
            .iter()
            .map(|it| (it.end, it.frame))
            .collect::<Vec<_>>()
    };
    assert_eq!(frames(&file.display().to_string()), frames("cia402_csp"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(ProptestConfig::default().cases.min(8)))]

    /// Whatever a valid description says, the axis follows its setpoints, by the PDOs that it names and no other.
    #[test]
    fn an_axis_follows_whatever_describes_its_drive(
        description in Description::any(),
        half_milliseconds in 2..=8u32,
    ) {
        let folder = Folder::new();
        let file = description.write(&folder);
        let positions = !description.is_sent_velocities();
        let mut rig = rig(&file, half_milliseconds * 500, positions, PROGRAM);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let errors = rig.rows.iter().map(|row| row.axes[0].following_error.abs());
        let most = errors.fold(0.0, f64::max);
        // The loops' own at 3 m/s², and a few increments: a cycle too late would be 0.4 mm and more at 400 mm/s.
        let increment = 10.0 / f64::from(description.encoder_increments);
        // And what the quantum of a velocity leaves, 1/6 mm/s, over the least gain of the loop about it.
        let bound = BOUND + 5.0 * increment + if positions { 0.0 } else { 1.0 / 6.0 / 30.0 };
        prop_assert!(most < bound, "{most} mm, increment {increment} mm");
        let greatest = rig.rows.iter().map(|row| row.axes[0].act).fold(0.0, f64::max);
        prop_assert!((greatest - 50.0).abs() < bound, "{greatest} mm");
        let node = NodeId::new(1).unwrap();
        let frames = rig.frames();
        let used = |of_port: bool, id: CobId| {
            let of = |it: &&Transmission| (it.sender == Sender::Port) == of_port && it.frame.id() == CanId::from(id);
            frames.iter().any(|it| of(&it))
        };
        for number in 1..=4 {
            prop_assert_eq!(used(true, CobId::r_pdo(number, node)), number == description.r_pdo);
            prop_assert_eq!(used(false, CobId::t_pdo(number, node)), number == description.t_pdo);
        }
    }
}

/// Another drive than the one described is refused before it moves.
#[test]
fn another_makers_drive_is_refused() {
    let folder = Folder::new();
    let description = Description {
        mode: 8,
        r_pdo: 1,
        t_pdo: 1,
        pdos: 4,
        encoder_increments: 65_536,
        has_resolution: true,
        has_period: true,
        tells_following: true,
        interpolates: true,
        fixed_mapping: false,
        tells_mapping: true,
        vendor_id: 0x1234,
        velocity_unit: None,
    };
    let file = description.write(&folder);
    let mut rig = rig(&file, 2000, true, PROGRAM);
    rig.twin(0).disturb(Disturbance::Vendor(0x4321));
    let Fault::Device(0, cause @ DeviceCause::WrongIdentity { .. }) = rig.finish_with_fault()
    else {
        panic!("{:?}", rig.events);
    };
    let told = cause.to_string();
    assert!(
        told.contains("1018h:1 (vendor ID) reads 00004321h, expected 00001234h"),
        "{told}"
    );
    assert!(!rig.twin(0).observe().is_powered);
}

// --- they are sent velocities ---

const MODELS: [(&str, &str); 3] = [
    ("model = \"wheel.toml\"", "wheel"),
    ("model = \"inverter.toml\"", "inverter"),
    ("model = \"scale.toml\"", "scale"),
];

/// What makes files of a folder elsewhere of the models of the example whose drives are sent velocities.
pub(super) fn velocity_models() -> Vec<(&'static str, String)> {
    let folder = root().join("examples/velocity");
    let models = MODELS.iter().map(|(model, name)| {
        let file = folder.join(format!("{name}.toml")).display().to_string();
        (*model, format!("model = {file:?}"))
    });
    models.collect()
}

/// The example whose drives are sent velocities.
pub(super) fn velocity_with(program: &str, configure: impl Fn(usize, &mut Config)) -> Rig {
    let models = velocity_models();
    let replacements: Vec<_> = models.iter().map(|(from, to)| (*from, &**to)).collect();
    Rig::new("velocity", &replacements, program, configure)
}

fn velocity(program: &str) -> Rig {
    velocity_with(program, |_, _| ())
}

const AROUND: &str =
    "G21 G90 G94 G61\nG0 X60 Y60\nG1 X80 F6000\nG3 X80 Y60 I-20\nG3 X80 Y60 I-20\nM2\n";

#[test]
fn each_loss_of_a_drive_that_is_sent_velocities_has_its_own_message() {
    for (drive, who) in [
        (0, "node 1 (X, Wheel 9): "),
        (1, "node 2 (Y, Inverter 3): "),
    ] {
        for (disturbance, text) in [
            (Disturbance::Mute(true), "no T_PDO in 2 cycles in a row"),
            (Disturbance::Reset, "no T_PDO in 2 cycles in a row"),
            (Disturbance::Mains(false), "EMCY 3220h"),
            (Disturbance::Remote(false), "not under fieldbus control"),
            (Disturbance::Fault(ErrorClass::StopAndSwitchOff), "EMCY"),
        ] {
            let mut rig = velocity(AROUND);
            rig.run_to_row(400);
            rig.twin(drive).disturb(disturbance);
            let fault = rig.finish_with_fault().describe(&*rig.layout);
            assert!(fault.starts_with(who) && fault.contains(text), "{fault}");
            assert!(rig.ends_at_rest(), "{fault}");
        }
    }
}

/// Without the controller they do not go on with their last velocity, whatever their makers have them do: 6007h is
/// set.
#[test]
fn a_drive_that_is_sent_velocities_stops_where_the_controller_dies() {
    let mut rig = velocity("G21 G90\nG1 X250 Y150 F3000\nM2\n");
    rig.run_to_row(400);
    let speeds = |rig: &mut Rig| [0, 1].map(|drive| rig.twin(drive).observe().velocity.abs());
    let before = speeds(&mut rig);
    assert!(before.iter().all(|it| *it > 0.5), "{before:?}");
    let end = rig.session.timeline().now() + Duration::from_secs(1);
    rig.session.timeline().world().advance_to(end);
    let after = speeds(&mut rig);
    assert!(after.iter().all(|it| *it < 0.01), "{after:?}");
}

/// A drive that counts its velocities otherwise than is described ends in a following error.
#[test]
fn another_unit_of_the_velocity_is_found_by_the_following_error() {
    for (drive, units) in [(0, 20), (0, 600), (1, 2), (1, 60)] {
        let mut rig = velocity_with(AROUND, |device, config| {
            if device == drive {
                config.assumed.retain(|(name, _)| *name != "velocity_units");
                config.assumed.push(("velocity_units", units));
            }
        });
        let fault = rig.finish_with_fault();
        assert!(
            matches!(fault, Fault::Axis(axis, AxisCause::FollowingError { .. }) if axis == drive),
            "{fault:?}"
        );
    }
}
