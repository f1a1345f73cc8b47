//! Drives that a file describes, in a machine that runs a program.

use proptest::prelude::*;
use serde_json::Value;
use syncline_canopen::eds::Eds;
use syncline_canopen::eds::Value::Number;
use syncline_canopen::{CanId, CobId, NodeId};
use syncline_controller::control::fault::DeviceCause;
use syncline_controller::control::{End, Fault};
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::dictionary::CIA402_CSP;
use syncline_drives::twin::Disturbance;
use syncline_tests::command::{Folder, ended, root, syncline};
use syncline_tests::rig::Rig;

const MODEL: &str = "model = \"servo.toml\"";

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
    vendor_id: u32,
}

impl Description {
    /// Increments are well below the standstill window, 0.05 mm.
    fn any() -> impl Strategy<Value = Self> {
        (
            (1..=4u8, 1..=4u8, 1..=4u8),
            (8192..=1u32 << 24, any::<[bool; 4]>(), any::<u32>()),
        )
            .prop_map(
                |((r_pdo, t_pdo, pdos), (encoder_increments, has, vendor_id))| Self {
                    r_pdo,
                    t_pdo,
                    pdos,
                    encoder_increments,
                    mode: if has[3] { 8 } else { 7 },
                    has_resolution: has[0],
                    has_period: has[1],
                    tells_following: has[2],
                    vendor_id,
                },
            )
    }

    /// Its files; the name of the one that a machine file names.
    fn write(&self, folder: &Folder) -> String {
        let mut eds = Eds::of(CIA402_CSP);
        if !self.has_resolution {
            eds.objects
                .retain(|index, _| ![0x608F, 0x6091].contains(index));
        }
        if !self.has_period {
            eds.objects.remove(&0x60C2);
        }
        // It has no other PDOs than are said.
        for (first, most) in [
            (0x1400, self.pdos.max(self.r_pdo)),
            (0x1800, self.pdos.max(self.t_pdo)),
        ] {
            eds.objects.retain(|&index, _| {
                let of = matches!(index & !0x3, it if it == first || it == first + 0x200);
                !of || index % 4 < u16::from(most)
            });
        }
        // It tells the modes that it has.
        let modes = eds.objects.get_mut(&0x6502).unwrap();
        modes.subs.get_mut(&0).unwrap().default = Some(Number(1 << (self.mode - 1)));
        eds.objects
            .remove(if self.mode == 7 { &0x607A } else { &0x60C1 });
        let identity = eds.objects.get_mut(&0x1018).unwrap();
        identity.subs.get_mut(&1).unwrap().default = None;
        let _sheet = folder.file("drive.eds", &eds.to_string());
        let flag = u8::from;
        let text = format!(
            "name = \"drawn\"\ngeneric = \"cia402_csp\"\neds = \"drive.eds\"\nmode = {}\nr_pdo = {}\nt_pdo = {}\npdos = {}\n\
             encoder_increments = {}\nhas_resolution = {}\nhas_period = {}\ntells_following = {}\nvendor_id = {}\n",
            self.mode,
            self.r_pdo,
            self.t_pdo,
            self.pdos,
            self.encoder_increments,
            flag(self.has_resolution),
            flag(self.has_period),
            flag(self.tells_following),
            self.vendor_id,
        );
        folder.file("drive.toml", &text).display().to_string()
    }
}

fn rig(x: &str, cycle_us: u32, program: &str) -> Rig {
    let servo = root().join("examples/described/servo.toml");
    let [x, y] = [x, &servo.display().to_string()].map(|file| format!("model = {file:?}"));
    let cycle = format!("cycle_us = {cycle_us}");
    // The first one is X's, behind its replacement comes Y's.
    let replacements = [("cycle_us = 2000", &*cycle), (MODEL, &*x), (MODEL, &*y)];
    Rig::new("described", &replacements, program, |_, _| ())
}

/// Following error that the loops have in [`PROGRAM`], mm.
const BOUND: f64 = 0.1;

const PROGRAM: &str = "G21 G90\nG0 X30 Y10\nG1 F9000 X40\nG3 X50 Y20 J10\nG0 X0 Y0\nM2\n";

#[test]
fn the_example_passes_and_is_the_same_each_time() {
    let folder = root().join("examples/described");
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
        let mut rig = rig(&file, half_milliseconds * 500, PROGRAM);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let errors = rig.rows.iter().map(|row| row.axes[0].following_error.abs());
        let most = errors.fold(0.0, f64::max);
        // The loops' own at 3 m/s², and a few increments: a cycle too late would be 0.4 mm and more at 400 mm/s.
        let increment = 10.0 / f64::from(description.encoder_increments);
        prop_assert!(most < BOUND + 5.0 * increment, "{most} mm, increment {increment} mm");
        let greatest = rig.rows.iter().map(|row| row.axes[0].act).fold(0.0, f64::max);
        prop_assert!((greatest - 50.0).abs() < BOUND + 5.0 * increment, "{greatest} mm");
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
        vendor_id: 0x1234,
    };
    let file = description.write(&folder);
    let mut rig = rig(&file, 2000, PROGRAM);
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
