//! Descriptions of devices, good and with one thing wrong.

use proptest::prelude::*;
use std::fs;
use syncline_canopen::Address;
use syncline_canopen::eds::{Access, Eds, Value};
use syncline_controller::machine::{Machine, MachineError};
use syncline_drives::dictionary::{CIA402_CSP, CIA406};
use tempfile::TempDir;

const MACHINE: &str = include_str!("../../../examples/described/machine.toml");
const SERVO: &str = include_str!("../../../examples/described/servo.toml");
const SHEET: &str = include_str!("../../../examples/described/servo.eds");

/// The example with this description and this data sheet.
fn load(servo: &str, sheet: &str) -> Result<Machine, MachineError> {
    load_as(MACHINE, servo, sheet)
}

fn load_as(machine: &str, servo: &str, sheet: &str) -> Result<Machine, MachineError> {
    let folder = TempDir::new().unwrap();
    let write = |name, text| fs::write(folder.path().join(name), text).unwrap();
    write("machine.toml", machine);
    write("servo.toml", servo);
    write("servo.eds", sheet);
    Machine::load(&folder.path().join("machine.toml"))
}

fn refused(servo: &str, sheet: &str) -> String {
    load(servo, sheet).unwrap_err().to_string()
}

/// The example's description with a part replaced.
fn servo(from: &str, to: &str) -> String {
    assert!(SERVO.contains(from), "{from}");
    SERVO.replacen(from, to, 1)
}

#[test]
fn a_model_is_what_its_files_say() {
    let machine = load(SERVO, SHEET).unwrap();
    let [x, y] = [0, 1].map(|drive| machine.drives[drive].model);
    assert!(std::ptr::eq(x, y));
    assert_eq!((x.title, x.maker), ("Servo 20", None));
    assert_eq!(x.bitrates, [125_000, 250_000, 500_000, 1_000_000]);
    assert_eq!(machine.drives[0].scaling.to_revolutions(65_536.into()), 1.0);
    // Read again it is the same one, not another.
    let again = load(SERVO, SHEET).unwrap();
    assert!(std::ptr::eq(x, again.drives[0].model));
}

#[test]
fn what_only_its_own_data_sheet_has_can_be_written() {
    let gain = "\n[2001]\nParameterName=Position gain\nObjectType=7\nDataType=6\nAccessType=rw\nLowLimit=1\nHighLimit=99\n";
    let folder = TempDir::new().unwrap();
    let parse = |sheet: &str, sdo: &str| {
        fs::write(folder.path().join("servo.toml"), SERVO).unwrap();
        fs::write(folder.path().join("servo.eds"), sheet).unwrap();
        let text = MACHINE.replacen("node = 1\n", &format!("node = 1\nsdo = [{sdo}]\n"), 1);
        let file = folder.path().join("machine.toml");
        Machine::parse(&file, &text).map_err(|wrong| wrong.to_string())
    };
    let sheet = SHEET.to_owned() + gain;
    let machine = parse(&sheet, "[\"2001:0\", 12]").unwrap();
    assert_eq!(machine.drives[0].objects[0].data.bits(), 12);
    for (sheet, sdo, told) in [
        (
            &*sheet,
            "[\"2001:0\", 100]",
            "no value for 2001h:0 (Position gain)",
        ),
        (
            SHEET,
            "[\"2001:0\", 12]",
            "the Servo 20 has no object 2001h:0",
        ),
        (SHEET, "[\"607A:0\", 12]", "607Ah:0 is the controller's own"),
    ] {
        let wrong = parse(sheet, sdo).unwrap_err();
        assert!(wrong.contains(told), "{wrong}");
    }
}

#[test]
fn what_is_wrong_in_a_description_is_told_with_its_place() {
    for (text, told) in [
        (
            servo("name = \"Servo 20\"", "name = \"lxm32m\""),
            "servo.toml:5:8: description: `name` is \"lxm32m\"",
        ),
        (
            servo("name = \"Servo 20\"", "name = \"TWK crn\""),
            "servo.toml:5:8: description: `name` is \"TWK crn\"",
        ),
        (
            servo("name = \"Servo 20\"\n", ""),
            "servo.toml:1:1: description: missing key `name`",
        ),
        (
            servo("\"cia402_csp\"", "\"lxm32m\""),
            "servo.toml:6:11: description: `generic` is \"lxm32m\"",
        ),
        (
            servo("eds = \"servo.eds\"\n", ""),
            "description: missing key `eds`",
        ),
        (
            servo("\"servo.eds\"", "\"other.eds\""),
            "servo.toml:7:7: description: `eds`: cannot read ",
        ),
        (
            servo("r_pdo = 2", "r_pdo = 5"),
            "servo.toml:12:9: description: `r_pdo` is 5",
        ),
        (
            servo("r_pdo = 2", "rpdo = 2"),
            "servo.toml:12:1: description: unknown key `rpdo`",
        ),
        (
            servo("has_period = 0", "has_period = 2"),
            "description: `has_period` is 2",
        ),
        (
            servo("has_period = 0", "has_period = "),
            "servo.toml:15:14: not TOML",
        ),
        // What the data sheet does not have.
        (
            servo("has_period = 0\n", ""),
            "`eds`: 60C2h:1 (Interpolation time period value) is not there",
        ),
        (
            servo("has_resolution = 0\n", ""),
            "`eds`: 6091h:2 (Driving shaft revolutions) is not there",
        ),
        (
            servo("r_pdo = 2", "r_pdo = 3"),
            "`eds`: 1402h:1 (COB-ID R_PDO3) is not there",
        ),
        (
            servo("pdos = 2", "pdos = 4"),
            "`eds`: 1803h:1 (COB-ID T_PDO4) is not there",
        ),
        (
            servo("pdos = 2", "mode = 7"),
            "`eds`: 60C1h:1 (Interpolation data record 1) is not there",
        ),
        (
            servo("0x14", "0x15"),
            "`eds`: 1018h:2 (Product code) is 14h, not 15h",
        ),
    ] {
        let wrong = refused(&text, SHEET);
        assert!(wrong.contains(told), "{told}\n{wrong}");
        assert!(
            wrong.contains("machine.toml:16:9: drive \"X\": `model`: "),
            "{wrong}"
        );
    }
    let wrong = refused(SERVO, &SHEET.replacen("[1000]", "[1000", 1));
    assert!(
        wrong.contains("servo.eds") && wrong.contains("neither [section] nor key=value"),
        "{wrong}"
    );
}

/// What is wrong in a data sheet names the key that does without, if there is one.
#[test]
fn what_a_data_sheet_lacks_names_the_key_that_does_without() {
    for (description, sheet, mend) in [
        (
            servo("has_period = 0\n", ""),
            SHEET,
            "with `has_period = 0` it does not",
        ),
        (
            servo("has_resolution = 0\n", ""),
            SHEET,
            "with `has_resolution = 0` it does not",
        ),
        (
            servo("r_pdo = 2", "r_pdo = 3"),
            SHEET,
            "with `r_pdo = 1` it does not",
        ),
        (
            servo("\"cia402_csp\"", "\"cia402_csv\""),
            SHEET,
            "it tells the mode of `generic = \"cia402_csp\"`",
        ),
        (
            SERVO.to_owned(),
            &*SHEET
                .replace("[6041]", "[2041]")
                .replace("=0x6041\n", "=0x2041\n"),
            "no key of a description changes that",
        ),
    ] {
        let wrong = refused(&description, sheet);
        assert!(
            wrong.contains(&format!(" goes by this object; {mend}\n")),
            "{mend}\n{wrong}"
        );
    }
}

#[test]
fn a_name_is_one_descriptions_and_a_file_is_of_the_tables_kind() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("servo.toml", SERVO);
    write("servo.eds", SHEET);
    write("other.toml", &servo("65_536", "4096"));
    let parse = |text: &str| {
        let wrong = Machine::parse(&folder.path().join("machine.toml"), text).unwrap_err();
        wrong.to_string()
    };
    let second = "node = 2\nmodel = \"servo.toml\"";
    let two = MACHINE.replacen(second, "node = 2\nmodel = \"other.toml\"", 1);
    let wrong = parse(&two);
    let told = "drive \"Y\": `model`: another file describes another \"Servo 20\"";
    assert!(wrong.contains(told), "{wrong}");
    let encoder = "[[encoder]]\nname = \"scale\"\nbus = \"table\"\nnode = 9\nmodel = \"servo.toml\"\npitch = 1.0\n";
    let wrong = parse(&(MACHINE.to_owned() + encoder));
    assert!(wrong.contains("servo.toml describes a drive"), "{wrong}");
    let missing = MACHINE.replace("servo.toml", "none.toml");
    let wrong = parse(&missing);
    assert!(wrong.contains("none.toml"), "{wrong}");
}

/// What the controller does with the objects of a drive with all of them, PDO 1 in use: w has to write, r reads, R and T
/// are mapped; by the tables of the profile, not by the model. The drives that are meant are sent positions,
/// velocities, or those in Profile Velocity.
const USED: &[(u16, u8, &str, [bool; 3])] = &[
    (0x1000, 0, "r", ALL),
    (0x1016, 1, "rw", ALL),
    (0x1017, 0, "rw", ALL),
    (0x1400, 1, "rw", ALL),
    (0x1400, 2, "rw", ALL),
    (0x1403, 1, "rw", ALL),
    (0x1600, 0, "r", ALL),
    (0x1600, 1, "r", ALL),
    (0x1600, 2, "r", ALL),
    (0x1800, 1, "rw", ALL),
    (0x1800, 2, "rw", ALL),
    (0x1803, 1, "rw", ALL),
    (0x1A00, 0, "r", ALL),
    (0x1A00, 1, "r", ALL),
    (0x1A00, 2, "r", ALL),
    (0x6007, 0, "rw", VELOCITIES),
    (0x6040, 0, "wR", ALL),
    (0x6041, 0, "rT", ALL),
    (0x6060, 0, "rw", ALL),
    (0x6061, 0, "r", ALL),
    (0x6064, 0, "T", ALL),
    (0x6065, 0, "rw", POSITIONS),
    (0x607A, 0, "R", POSITIONS),
    (0x607D, 1, "rw", POSITIONS),
    (0x607D, 2, "rw", POSITIONS),
    (0x6083, 0, "rw", [false, false, true]),
    (0x6084, 0, "rw", [false, false, true]),
    (0x608F, 1, "r", ALL),
    (0x608F, 2, "r", ALL),
    (0x6091, 1, "r", ALL),
    (0x6091, 2, "r", ALL),
    (0x60C2, 1, "rw", CYCLIC),
    (0x60C2, 2, "rw", CYCLIC),
    (0x60FF, 0, "R", VELOCITIES),
    (0x6502, 0, "r", ALL),
];

const ALL: [bool; 3] = [true; 3];
const POSITIONS: [bool; 3] = [true, false, false];
const VELOCITIES: [bool; 3] = [false, true, true];
const CYCLIC: [bool; 3] = [true, true, false];

/// The same of an encoder with all of them.
const USED_OF_ENCODER: &[(u16, u8, &str)] = &[
    (0x1000, 0, "r"),
    (0x1017, 0, "rw"),
    (0x1800, 1, "rw"),
    (0x1800, 2, "rw"),
    (0x1803, 1, "rw"),
    (0x1A00, 0, "r"),
    (0x1A00, 1, "r"),
    (0x6000, 0, "rw"),
    (0x6004, 0, "T"),
    (0x6501, 0, "r"),
    (0x6502, 0, "r"),
];

/// The example with an encoder that watches X, described by these keys and this data sheet.
fn load_encoder(keys: &str, eds: &Eds) -> Result<Machine, String> {
    let folder = TempDir::new().unwrap();
    let write = |name, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("servo.toml", SERVO);
    write("servo.eds", SHEET);
    let text = "name = \"whole\"\ngeneric = \"cia406\"\neds = \"scale.eds\"\n";
    write("scale.toml", &format!("{text}{keys}"));
    write("scale.eds", &eds.to_string());
    let encoder = "[[encoder]]\nname = \"scale\"\nbus = \"table\"\nnode = 9\nmodel = \"scale.toml\"\npitch = 10.0\n";
    let watched = "drive_soft_limits = true\nfeedback = \"scale\"\ndifference_limit = 0.2\n";
    let machine = MACHINE.replacen("drive_soft_limits = true\n", watched, 1) + encoder;
    let loaded = Machine::parse(&folder.path().join("machine.toml"), &machine);
    loaded.map_err(|wrong| wrong.to_string())
}

#[test]
fn an_encoder_is_what_its_files_say() {
    let eds = Eds::of(CIA406);
    let machine = load_encoder("", &eds).unwrap();
    let encoder = &machine.encoders[0];
    assert_eq!((encoder.model.title, encoder.model.maker), ("whole", None));
    assert_eq!(encoder.scaling.to_revolutions(8192.into()), 1.0);
    for (keys, told) in [
        ("vendor_id = 7\n", "1018h:1 (Vendor ID) is 0h, not 7h"),
        ("tells_following = 0\n", "unknown key `tells_following`"),
    ] {
        let wrong = load_encoder(keys, &eds).map(|_| ()).unwrap_err();
        assert!(wrong.contains(told), "{told}\n{wrong}");
    }
}

/// Objects without which a drive has one ability less, which nobody has to ask of it.
const OPTIONAL: [u16; 2] = [0x6065, 0x607D];

/// Drives with every object of the profile, one a generic model, and the mode that each has to have (6502h).
const WHOLE: [(&str, u8); 3] = [
    (
        "name = \"whole\"\neds = \"servo.eds\"\ngeneric = \"cia402_csp\"\n",
        8,
    ),
    (
        "name = \"whole\"\neds = \"servo.eds\"\ngeneric = \"cia402_csv\"\n",
        9,
    ),
    (
        "name = \"whole\"\neds = \"servo.eds\"\ngeneric = \"cia402_pv\"\nramp = 1000\n",
        3,
    ),
];

#[test]
fn a_drive_with_every_object_of_the_profile_is_taken() {
    for which in 0..WHOLE.len() {
        load_whole(which, &whole(which)).unwrap();
    }
}

/// The data sheet of a drive with everything.
fn whole(which: usize) -> Eds {
    let mut eds = Eds::of(CIA402_CSP);
    let modes = eds.objects.get_mut(&0x6502).unwrap();
    let mode = 1 << (WHOLE[which].1 - 1);
    modes.subs.get_mut(&0).unwrap().default = Some(Value::Number(mode));
    eds
}

/// The example with such drives, of which nothing is asked that those that are sent velocities do not have.
fn load_whole(which: usize, eds: &Eds) -> Result<Machine, String> {
    let machine = match which {
        0 => MACHINE.to_owned(),
        _ => MACHINE.replace(
            "drive_following_error = true\ndrive_soft_limits = true\n",
            "",
        ),
    };
    let loaded = load_as(&machine, WHOLE[which].0, &eds.to_string());
    loaded.map_err(|error| error.to_string())
}

/// Has one thing of an object of a data sheet not be as it has to for what it is used for, and says how that is told;
/// `None` where it is nothing to that use.
fn broken(
    eds: &mut Eds,
    (index, sub): (u16, u8),
    uses: &str,
    breach: u8,
    other_type: u16,
) -> Option<&'static str> {
    let object = eds.objects.get_mut(&index).unwrap();
    let parameter = object.subs.get_mut(&sub).unwrap();
    let does = |what| uses.contains(what);
    Some(match breach {
        0 => {
            object.subs.remove(&sub);
            if object.subs.is_empty() {
                eds.objects.remove(&index);
            }
            "is not there"
        }
        1 => {
            parameter.data_type = other_type;
            parameter.default = None;
            (parameter.low, parameter.high) = (None, None);
            "is of type"
        }
        2 if does('w') => {
            parameter.access = Access::Ro;
            "cannot be written"
        }
        3 if does('r') => {
            parameter.access = Access::Wo;
            "cannot be read"
        }
        4 if does('R') => {
            parameter.pdo_mapping = false;
            "cannot be mapped into an R_PDO"
        }
        4 if does('T') => {
            parameter.pdo_mapping = false;
            "cannot be mapped into a T_PDO"
        }
        _ => return None,
    })
}

/// Objects of a maker's own, of 8, 16 and 32 bits, some of which are mapped; and their data types.
const MAKERS: [(u32, u16); 3] = [(0x2001_0008, 5), (0x2002_0010, 6), (0x2003_0020, 7)];

fn makers_objects() -> impl Strategy<Value = Vec<u32>> {
    prop::sample::subsequence(MAKERS.map(|(object, _)| object).to_vec(), 0..=3)
}

fn add_makers_objects(eds: &mut Eds) {
    for (object, data_type) in MAKERS {
        let mut added = eds.objects[&0x1017].clone();
        let parameter = added.subs.get_mut(&0).unwrap();
        (parameter.data_type, parameter.default) = (data_type, None);
        (parameter.low, parameter.high) = (None, None);
        eds.objects.insert((object >> 16) as u16, added);
    }
}

/// Maps a PDO in a data sheet.
fn map(eds: &mut Eds, index: u16, objects: &[u32], read_only: bool) {
    let subs = &mut eds.objects.get_mut(&index).unwrap().subs;
    let values = [&[objects.len() as u32], objects].concat();
    for (sub, value) in (0..).zip(values) {
        let parameter = subs.get_mut(&sub).unwrap();
        parameter.default = Some(Value::Number(value.into()));
        if read_only {
            parameter.access = Access::Ro;
        }
    }
}

/// A drive whose R_PDO is mapped by its maker so, with these values in its description.
fn mapped_so(objects: &[u32], values: &str) -> Result<Machine, String> {
    let mut eds = whole(0);
    add_makers_objects(&mut eds);
    map(&mut eds, 0x1600, objects, true);
    let text = format!("{}r_pdo_values = [{values}]\n", WHOLE[0].0);
    load(&text, &eds.to_string()).map_err(|wrong| wrong.to_string())
}

/// Torques are sent where the data sheet has 60B2h, and the maker has mapped it or nobody has.
#[test]
fn torques_are_sent_to_a_drive_whose_r_pdo_can_have_them() {
    const NEEDED: [u32; 2] = [0x607A_0020, 0x6040_0010];
    const TORQUE: u32 = 0x60B2_0010;
    let asked = MACHINE.replacen(
        "drive_following_error = true\ndrive_soft_limits = true\n",
        "feed_forward = { rated_torque = 1.4, inertia = 5e-4 }\n",
        1,
    );
    let loaded = |machine: &str, eds: &Eds, values: &str| {
        let text = format!("{}r_pdo_values = [{values}]\n", WHOLE[0].0);
        load_as(machine, &text, &eds.to_string()).map_err(|wrong| wrong.to_string())
    };
    // The set-up maps it.
    let takes = |machine: Machine| [0, 1].map(|drive| machine.device(drive).takes_torque());
    assert_eq!(takes(loaded(&asked, &whole(0), "").unwrap()), [true, false]);
    // So has the maker; who is not asked for torques says what is sent.
    let mut mapped = whole(0);
    map(&mut mapped, 0x1600, &[TORQUE, NEEDED[0], NEEDED[1]], true);
    let stated = "[\"60B2:0\", 0]";
    assert_eq!(
        takes(loaded(&asked, &mapped, stated).unwrap()),
        [true, false]
    );
    let unstated = loaded(&asked, &mapped, "").map(|_| ()).unwrap_err();
    assert!(
        unstated
            .contains("60B2h:0 (Torque offset) is in R_PDO1, and nothing states what it is sent"),
        "{unstated}"
    );
    // The maker has not; or the drive has no such object, or none that can be mapped.
    let mut without = whole(0);
    map(&mut without, 0x1600, &NEEDED, true);
    let wrong = loaded(&asked, &without, "").map(|_| ()).unwrap_err();
    assert!(
        wrong.contains(
            "which drive \"X\" (whole) is not sent: its maker has mapped its R_PDO without 60B2h"
        ),
        "{wrong}"
    );
    let mut none = whole(0);
    none.objects.remove(&0x60B2);
    let mut unmapped = whole(0);
    let offset = unmapped.objects.get_mut(&0x60B2).unwrap();
    offset.subs.get_mut(&0).unwrap().access = Access::Rw;
    offset.subs.get_mut(&0).unwrap().pdo_mapping = false;
    for eds in [none, unmapped] {
        let wrong = loaded(&asked, &eds, "").map(|_| ()).unwrap_err();
        assert!(
            wrong.contains("`feed_forward`, which drive \"X\" (whole) cannot"),
            "{wrong}"
        );
    }
    // One that does not tell its motor's rated torque is taken at the file's word.
    let mut silent = whole(0);
    silent.objects.remove(&0x6076);
    for (eds, reads) in [(whole(0), true), (silent, false)] {
        let device = loaded(&asked, &eds, "").unwrap().device(0);
        let mut read = device.spec().identity.iter();
        assert_eq!(read.any(|it| it.address == Address::new(0x6076, 0)), reads);
    }
}

#[test]
fn what_else_is_in_an_r_pdo_has_a_value_that_fits_it() {
    const NEEDED: [u32; 2] = [0x607A_0020, 0x6040_0010];
    let with = |object: u32| [&NEEDED[..], &[object]].concat();
    mapped_so(&with(0x2002_0010), "[\"2002:0\", 65_535]").unwrap();
    // The mode is sent as it is set up, and a gap is left at 0.
    mapped_so(&with(0x6060_0008), "").unwrap();
    mapped_so(&with(0x0006_0010), "").unwrap();
    for (object, values, told) in [
        (
            0x2002_0010,
            "",
            "2002h:0 (Producer heartbeat time) is in R_PDO1, and nothing states what it is sent",
        ),
        (0x2002_0010, "[\"2002:0\", 65_536]", "takes no 65536"),
        (
            0x2002_0010,
            "[\"2002:0\", 1.5]",
            "this is no value for 2002h:0",
        ),
        (0x2002_0010, "[\"2002:0:0\", 1]", "this is no object"),
        (0x2002_0010, "5", "this entry is not an object with a value"),
        (
            0x2002_0010,
            "[\"2002:0\", 1], [\"2002:0\", 2]",
            "2002h:0 has a value already",
        ),
        (
            0x2002_0010,
            "[\"2002:0\", 1], [\"2001:0\", 2]",
            "2001h:0 (Producer heartbeat time) has a value in `r_pdo_values`, and is not in its R_PDO",
        ),
        (
            0x6060_0008,
            "[\"6060:0\", 8]",
            "has a value in `r_pdo_values`, and is the controller's own",
        ),
        (
            0x6040_0010,
            "[\"6040:0\", 8]",
            "has a value in `r_pdo_values`, and is the controller's own",
        ),
        (
            0x2002_0008,
            "[\"2002:0\", 1]",
            "is of type U16, and mapped with 8 bits",
        ),
        (0x2004_0008, "[\"2004:0\", 1]", "2004h:0 is not there"),
        (
            0x6064_0008,
            "[\"6064:0\", 1]",
            "is of type I32, and mapped with 8 bits",
        ),
        (0x1001_0008, "[\"1001:0\", 1]", "cannot be written"),
    ] {
        let wrong = mapped_so(&with(object), values).map(|_| ()).unwrap_err();
        assert!(wrong.contains(told), "{told}\n{wrong}");
    }
    // What it is sent all the time nobody writes.
    let folder = TempDir::new().unwrap();
    let mut eds = whole(0);
    add_makers_objects(&mut eds);
    map(&mut eds, 0x1600, &with(0x2002_0010), true);
    let text = format!("{}r_pdo_values = [[\"2002:0\", 1]]\n", WHOLE[0].0);
    fs::write(folder.path().join("servo.toml"), text).unwrap();
    fs::write(folder.path().join("servo.eds"), eds.to_string()).unwrap();
    let machine = MACHINE.replacen("node = 1\n", "node = 1\nsdo = [[\"2002:0\", 2]]\n", 1);
    let wrong = Machine::parse(&folder.path().join("machine.toml"), &machine).unwrap_err();
    let told = "`sdo`: 2002h:0 is sent by R_PDO all the time";
    assert!(wrong.to_string().contains(told), "{wrong}");
}

proptest! {
    /// A data sheet in which one object that is used is not as it has to be: refused, and the object is named.
    #[test]
    fn a_data_sheet_that_lacks_one_thing_is_refused_by_the_objects_name(
        (index, sub, uses, drives) in prop::sample::select(USED),
        which in 0..3usize,
        breach in 0..5u8,
        other_type in prop::sample::select(vec![0x01u16, 0x08, 0x10, 0x15, 0x1B]),
    ) {
        prop_assume!(drives[which]);
        let mut eds = whole(which);
        let Some(told) = broken(&mut eds, (index, sub), uses, breach, other_type) else {
            return Ok(());
        };
        let loaded = load_whole(which, &eds);
        let name = format!("{index:04X}h:{sub:X}");
        match loaded {
            // It is asked for by the axis then.
            Err(wrong) if breach == 0 && OPTIONAL.contains(&index) => {
                prop_assert!(wrong.contains("drive_"), "{wrong}");
            }
            Err(wrong) => prop_assert!(wrong.contains(&name) && wrong.contains(told), "{name} {told}\n{wrong}"),
            Ok(_) => prop_assert!(false, "{name} {told}: taken"),
        }
    }

    /// A PDO that is on after power-on is switched off, wherever it is, and one that cannot be is refused. `states` are
    /// those of PDOs 1 to 5: on, off, or not said, which is as the generic drive has it: the first two are on.
    #[test]
    fn a_pdo_that_is_on_is_switched_off(
        transmits: bool,
        pdos in 1..=4u16,
        pdo in 1..=4u16,
        states in prop::collection::vec(prop::option::of(any::<bool>()), 5),
        fixed in prop::option::of(1..=5u16),
    ) {
        let (block, key) = if transmits { (0x1800, "t_pdo") } else { (0x1400, "r_pdo") };
        let mut eds = Eds::of(CIA402_CSP);
        let fifth = eds.objects[&(block + 3)].clone();
        eds.objects.insert(block + 4, fifth);
        let reached = pdos.max(pdo);
        let (mut off, mut refused) = (Vec::new(), None);
        for (n, state) in (1..).zip(states) {
            let parameter = eds.objects.get_mut(&(block - 1 + n)).unwrap().subs.get_mut(&1).unwrap();
            // The fifth one anywhere.
            let place = if n == 5 { 0x2A0 } else { 0x180 };
            let word = |is_on| place + if is_on { 0x4000_0000 } else { 0xC000_0000 };
            parameter.default = state.map(|is_on| Value::PlusNode(word(is_on)));
            let is_on = n > reached && state.unwrap_or(n <= 2);
            off.extend(is_on.then_some((block - 1 + n, state.is_some().then_some(place as u32 + 1))));
            if fixed == Some(n) {
                parameter.access = Access::Ro;
                refused = (is_on || n <= reached).then(|| format!("{:04X}h:1", block - 1 + n));
            }
        }
        let text = format!("{}pdos = {pdos}\n{key} = {pdo}\n", WHOLE[0].0);
        let machine = match (load(&text, &eds.to_string()), refused) {
            (Ok(machine), None) => machine,
            (Err(wrong), Some(object)) => {
                let told = wrong.to_string();
                prop_assert!(told.contains(&object) && told.contains("cannot be written"), "{}", told);
                return Ok(());
            }
            (loaded, refused) => panic!("{:?}, {refused:?}", loaded.map(|_| ())),
        };
        let device = machine.device(0);
        let setup = &device.spec().setup;
        for (index, cob_id) in off {
            let mut writes = setup.iter().filter(|it| it.address == Address::new(index, 1));
            let word = writes.next().expect("it is written").data.bits();
            prop_assert!(word >> 31 == 1 && writes.next().is_none());
            prop_assert!(cob_id.is_none_or(|it| it == word & 0x7FF), "{:X}", word);
        }
    }

    /// PDOs that the maker has mapped are read, and nothing is written there, whatever order and company their objects are in; what
    /// does not carry what is needed, or what nobody says a value for, is refused by the object's name.
    #[test]
    fn a_mapping_that_is_the_makers_is_gone_by(
        which in 0..3usize,
        pdo in 1..=4u16,
        others in [makers_objects(), makers_objects()],
        order: [prop::sample::Index; 2],
        left_out in prop::option::of((0..2usize, 0..2usize)),
        unstated: bool,
        says: bool,
        read_only: bool,
    ) {
        let mut eds = whole(which);
        add_makers_objects(&mut eds);
        let setpoint = if which == 0 { 0x607A_0020 } else { 0x60FF_0020 };
        let needed = [[0x6040_0010, setpoint], [0x6041_0010, 0x6064_0020]];
        let stated = if unstated { Vec::new() } else { others[0].clone() };
        let mut wrong = Vec::new();
        for direction in 0..2 {
            let index = [0x15FF, 0x19FF][direction] + pdo;
            let mut objects = [&needed[direction][..], &others[direction]].concat();
            if let Some((_, place)) = left_out.filter(|(left, _)| *left == direction) {
                let object = objects.remove(place);
                wrong.push(format!("{:04X}h:0", object >> 16));
            }
            let count = objects.len();
            objects.rotate_left(order[direction].index(count));
            if objects.iter().map(|it| it & 0xFF).sum::<u32>() > 64 {
                wrong.push(format!("{index:04X}h:0"));
            }
            map(&mut eds, index, &objects, read_only);
        }
        wrong.extend(others[0].iter().filter(|_| unstated).map(|it| format!("{:04X}h:0", it >> 16)));
        let (text, _) = WHOLE[which];
        let fixed = if says { "fixed_mapping = 1\n" } else { "" };
        let values: Vec<_> = stated.iter().map(|it| format!("[\"{:X}:0\", 3]", it >> 16)).collect();
        let text = format!("{text}{fixed}r_pdo = {pdo}\nt_pdo = {pdo}\nr_pdo_values = [{}]\n", values.join(", "));
        let machine = MACHINE.replace("drive_following_error = true\ndrive_soft_limits = true\n", "");
        let loaded = load_as(&machine, &text, &eds.to_string()).map_err(|wrong| wrong.to_string());
        let is_mapping = |address: &Address| matches!(address.index, 0x1600..0x1800 | 0x1A00..0x1C00);
        match loaded {
            // The set-up maps it, and nothing else is in it.
            loaded if !says && !read_only => match loaded {
                Ok(machine) => {
                    prop_assert!(stated.is_empty());
                    let mapped = machine.device(0).spec().setup.iter().filter(|it| is_mapping(&it.address)).count();
                    prop_assert_eq!(mapped, 8);
                }
                Err(told) => prop_assert!(!stated.is_empty() && told.contains("is not in its R_PDO"), "{}", told),
            },
            Ok(machine) => {
                prop_assert!(wrong.is_empty(), "{wrong:?}: taken");
                let device = machine.device(0);
                prop_assert!(!device.spec().setup.iter().any(|it| is_mapping(&it.address)));
                let read = device.spec().identity.iter().filter(|it| is_mapping(&it.address)).count();
                prop_assert_eq!(read, 6 + others[0].len() + others[1].len());
            }
            Err(told) => {
                prop_assert!(!wrong.is_empty(), "{}", told);
                for name in wrong {
                    prop_assert!(told.contains(&name), "{}: {}", name, told);
                }
            }
        }
    }

    /// The same of an encoder: a data sheet in which one object that is used is not as it has to be is refused by its name.
    #[test]
    fn a_data_sheet_of_an_encoder_that_lacks_one_thing_is_refused_by_the_objects_name(
        (index, sub, uses) in prop::sample::select(USED_OF_ENCODER),
        breach in 0..5u8,
    ) {
        let mut eds = Eds::of(CIA406);
        let Some(told) = broken(&mut eds, (index, sub), uses, breach, 0x1B) else {
            return Ok(());
        };
        let wrong = load_encoder("", &eds).map(|_| ()).unwrap_err();
        let name = format!("{index:04X}h:{sub:X}");
        prop_assert!(wrong.contains("encoder \"scale\"") && wrong.contains(&name) && wrong.contains(told), "{name} {told}\n{wrong}");
    }

    /// Whatever stands in a data sheet, nothing panics.
    #[test]
    fn any_data_sheet_is_taken_or_refused(
        values in prop::collection::vec((any::<prop::sample::Index>(), any::<u16>(), any::<i64>(), 0..4u8), 0..20),
    ) {
        let mut eds = Eds::of(CIA402_CSP);
        for (which, data_type, value, kind) in values {
            let mut all: Vec<_> = eds.objects.values_mut().flat_map(|object| object.subs.values_mut()).collect();
            let parameter = &mut all[which.index(CIA402_CSP.len())];
            match kind {
                0 => parameter.data_type = data_type % 0x20,
                1 => parameter.default = Some(Value::Number(value)),
                2 => parameter.default = Some(Value::PlusNode(value)),
                _ => parameter.low = Some(Value::Number(value)),
            }
        }
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("servo.toml"), WHOLE[0].0).unwrap();
        fs::write(folder.path().join("servo.eds"), eds.to_string()).unwrap();
        if let Ok(machine) = Machine::parse(&folder.path().join("machine.toml"), MACHINE) {
            let simulated = syncline_controller::port::sim::Simulated::new(&machine, 0, [None], |_, _| ());
            prop_assert!(simulated.is_ok());
        }
    }
}
