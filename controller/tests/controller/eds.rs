//! `syncline eds`: writes a node's data sheet, and finds where another one departs from it.

use std::process::Command;
use syncline_canopen::eds::{Eds, Value};
use syncline_controller::machine::Machine;

const MACHINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/portal/machine.toml"
);

fn eds(args: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_syncline"));
    let output = command.arg("eds").arg(MACHINE).args(args).output();
    let output = output.expect("runs");
    (
        output.status.code().expect("exits"),
        String::from_utf8(output.stdout).expect("UTF-8"),
        String::from_utf8(output.stderr).expect("UTF-8"),
    )
}

#[test]
fn data_sheet_of_a_node() {
    let (code, text, _) = eds(&["3"]);
    assert_eq!(code, 0);
    let sheet = Eds::parse(&text).expect("an EDS");
    assert_eq!(sheet.device_info("VendorNumber"), Some("0x0800005A"));
    assert_eq!(sheet.device_info("NrOfTXPDO"), Some("4"));
    assert!(text.contains("[60C1sub1]\r\nParameterName=IPp_target\r\n"));
    assert!(text.contains("DefaultValue=$NODEID+0x40000180\r\n"));
}

#[test]
fn comparison() {
    let (_, ours, _) = eds(&["1"]);
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("theirs.eds");
    let compare = |text: &str| {
        std::fs::write(&file, text).expect("written");
        eds(&["1", "--compare", file.to_str().expect("UTF-8")])
    };
    assert_eq!(compare(&ours), (0, String::new(), String::new()));
    let changed = ours.replace("HighLimit=35", "HighLimit=37");
    let (code, text, _) = compare(&changed);
    assert_eq!(
        (code, text.as_str()),
        (1, "6098h:0 HighLimit: 37, built in 35\n")
    );
    let (code, _, error) = compare("[1000]\nobject\n");
    assert_eq!(code, 2);
    assert!(
        error.ends_with("theirs.eds: line 2: neither [section] nor key=value\n"),
        "{error}"
    );
}

#[test]
fn unknown_node() {
    let (code, _, error) = eds(&["9"]);
    assert_eq!(code, 2);
    assert!(
        error.ends_with("no drive with node id 9, only 1 (X1), 2 (X2), 3 (Y), 4 (Z)\n"),
        "{error}"
    );
}

/// Without a machine file, and with all that CiA 306 wants of a file.
#[test]
fn data_sheet_of_a_model() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_syncline"));
    let output = command.args(["eds", "--node", "1:lxm32m"]).output();
    let text = String::from_utf8(output.expect("runs").stdout).expect("UTF-8");
    let sheet = Eds::parse(&text).expect("an EDS");
    assert_eq!(sheet.device_info("VendorName"), Some("Schneider Electric"));
    assert_eq!(sheet.device_info("ProductName"), Some("LXM32M"));
    let file = |key: &str| {
        let mut pairs = sheet.file.iter();
        pairs
            .find(|(name, _)| name == key)
            .map(|(_, value)| &**value)
    };
    for side in ["Creation", "Modification"] {
        let date = file(&format!("{side}Date")).expect("a date");
        let time = file(&format!("{side}Time")).expect("a time");
        assert!(
            date.len() == 10 && &date[2..3] == "-" && &date[5..6] == "-",
            "{date}"
        );
        assert!(time.len() == 7 && time.ends_with('M'), "{time}");
    }
    assert!(file("CreatedBy").is_some() && file("ModifiedBy").is_some());
    // Statusword, 16 bits.
    assert!(text.contains("DefaultValue=0x60410010\r\n"), "{text}");
    let (_, of_machine, _) = eds(&["1"]);
    let objects = |text: &str| text[text.find("[DeviceInfo]").expect("a section")..].to_owned();
    assert_eq!(objects(&of_machine), objects(&text));
}

/// The data sheet of a device without a machine file, named as `NODE:MODEL`.
fn sheet_of(device: &str) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_syncline"));
    let output = command.args(["eds", "--node", device]).output();
    String::from_utf8(output.expect("runs").stdout).expect("UTF-8")
}

/// Whoever makes a device is named, also where it has no vendor number; of a profile nobody does.
#[test]
fn data_sheets_name_the_maker() {
    for (model, maker) in [
        ("tlc5xx", Some("SIG Positec / Berger Lahr")),
        ("tsp10", Some("AHS Antriebstechnik GmbH")),
        ("twk_crn", Some("TWK Elektronik")),
        ("cia401", None),
        ("cia402_csp", None),
        ("cia402_csv", None),
        ("cia402_vl", None),
        ("cia406", None),
    ] {
        let text = sheet_of(&format!("1:{model}"));
        let sheet = Eds::parse(&text).expect("an EDS");
        assert_eq!(sheet.device_info("VendorName"), maker, "{model}");
    }
}

/// The data sheet of each drive of the profile tells its own mode, so that a description can begin with it.
#[test]
fn a_description_can_begin_with_the_data_sheet_of_its_model() {
    let machine = include_str!("../../../examples/described/machine.toml");
    let asked = "drive_following_error = true\ndrive_soft_limits = true\n";
    for (model, mode) in [
        ("cia402_csp", 8),
        ("cia402_csv", 9),
        ("cia402_pv", 3),
        ("cia402_vl", 2),
    ] {
        let text = sheet_of(&format!("5:{model}"));
        let sheet = Eds::parse(&text).expect("an EDS");
        let modes = &sheet.objects[&0x6502].subs[&0].default;
        assert_eq!(*modes, Some(Value::Number(1 << (mode - 1))), "{model}");
        let folder = tempfile::tempdir().expect("a directory");
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("written")
        };
        write("servo.eds", &text);
        write(
            "servo.toml",
            &format!("name = \"own\"\neds = \"servo.eds\"\ngeneric = \"{model}\"\n"),
        );
        write("machine.toml", &machine.replace(asked, ""));
        let told = Machine::load(&folder.path().join("machine.toml"));
        let told = told.map_or_else(|error| error.to_string(), |_| String::new());
        // One that only turns spindles moves no axis; nothing is wrong with its data sheet.
        assert!(!told.contains("`eds`"), "{model}: {told}");
        assert_eq!(told.is_empty(), model != "cia402_vl", "{model}: {told}");
    }
}

/// What cannot be written is told.
#[test]
fn a_full_disk_is_an_error() {
    for arguments in [&["eds", "--node", "1:lxm32m"][..], &["budget", MACHINE]] {
        let full = std::fs::File::options().write(true).open("/dev/full");
        let mut command = Command::new(env!("CARGO_BIN_EXE_syncline"));
        let command = command.args(arguments).stdout(full.expect("a device"));
        let output = command.output().expect("runs");
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {told}");
        assert!(
            told.contains("cannot write standard output: No space"),
            "{told}"
        );
    }
}
