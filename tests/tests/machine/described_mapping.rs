//! Drives and encoders that a file describes and whose PDOs their makers have mapped: in any order, and with objects that nobody
//! here goes by.

use super::{described, described_encoder};
use proptest::prelude::*;
use syncline_canopen::eds::Value::Number;
use syncline_canopen::eds::{Access, Eds};
use syncline_canopen::{CobId, NodeId};
use syncline_controller::control::fault::DeviceCause;
use syncline_controller::control::{End, Fault};
use syncline_controller::machine::Machine;
use syncline_drives::dictionary::{CIA402_CSP, CIA406};
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::Rig;

/// Sent positions in two modes, and velocities in two: the description, the mode, and what the R_PDO brings.
const DRIVES: [(&str, u8, u32); 4] = [
    ("generic = \"cia402_csp\"\nmode = 7\n", 7, 0x60C1_0120),
    ("generic = \"cia402_csp\"\n", 8, 0x607A_0020),
    ("generic = \"cia402_csv\"\n", 9, 0x60FF_0020),
    // 1500 rev/s², five times what the axis takes.
    (
        "generic = \"cia402_pv\"\nramp = 1_572_864_000\n",
        3,
        0x60FF_0020,
    ),
];

/// The maker's own, of 1 to 32 bits, with the value that is stated for each; and their data types.
const OWN: [(u32, i64, u16); 5] = [
    (0x2001_0008, 0x5A, 5),
    (0x2002_0010, 0x8001, 6),
    (0x2003_0020, 0xDEAD_BEEF, 7),
    (0x2004_0010, -2, 3),
    (0x2005_0001, 1, 1),
];

/// The ramp of the last of [`DRIVES`], which its maker may have in the R_PDO: the controller sends it there as it sets it up.
const RAMP: (u32, i64) = (0x6083_0020, 1_572_864_000);

/// What else an R_PDO may have: the mode, and gaps of two lengths.
const MODE: u32 = 0x6060_0008;
const GAPS: [u32; 2] = [0x0005_0008, 0x0006_0010];

/// What else a T_PDO may have: a mode, the torque, an error; and of the maker's own a REAL32 and an UNSIGNED24.
const TOLD: [u32; 6] = [
    0x6061_0008,
    0x6077_0010,
    0x603F_0010,
    0x1001_0008,
    0x2006_0020,
    0x2007_0018,
];
const OWN_TOLD: [(u32, u16); 2] = [(0x2006_0020, 8), (0x2007_0018, 0x16)];

/// Some of these, and those that are needed, in any order.
fn mapped(needed: Vec<u32>, others: Vec<u32>) -> impl Strategy<Value = Vec<u32>> {
    let most = others.len().min(4);
    let some = prop::sample::subsequence(others, 0..=most);
    some.prop_flat_map(move |others| Just([needed.clone(), others].concat()).prop_shuffle())
}

/// A drive of [`DRIVES`], and the mappings of its R_PDO and its T_PDO.
fn drive() -> impl Strategy<Value = (usize, [Vec<u32>; 2])> {
    (0..DRIVES.len()).prop_flat_map(|drive| {
        let own = OWN.map(|(object, ..)| object);
        let ramp = if drive == 3 { &[RAMP.0][..] } else { &[] };
        let received = [&own[..], &[MODE], ramp, &GAPS].concat();
        let transmitted = [&own[..], &TOLD].concat();
        let received = mapped(vec![0x6040_0010, DRIVES[drive].2], received);
        let transmitted = mapped(vec![0x6041_0010, 0x6064_0020], transmitted);
        (Just(drive), [received.boxed(), transmitted.boxed()])
    })
}

/// Maps a PDO in a data sheet, read-only unless that is `said` elsewhere.
fn map(eds: &mut Eds, index: u16, objects: &[u32], said: bool) {
    let subs = &mut eds.objects.get_mut(&index).unwrap().subs;
    let values = [&[objects.len() as u32], objects].concat();
    for (sub, value) in (0..).zip(values) {
        let entry = subs[&sub.min(1)].clone();
        let parameter = subs.entry(sub).or_insert(entry);
        parameter.default = Some(Number(value.into()));
        parameter.access = if said { Access::Rw } else { Access::Ro };
    }
}

/// Adds the maker's own objects to a data sheet.
fn add_own(eds: &mut Eds) {
    let own = OWN.map(|(object, _, data_type)| (object, data_type));
    for (object, data_type) in own.into_iter().chain(OWN_TOLD) {
        let mut added = eds.objects[&0x1017].clone();
        let parameter = added.subs.get_mut(&0).unwrap();
        (parameter.data_type, parameter.pdo_mapping) = (data_type, true);
        parameter.default = Some(Number(0));
        eds.objects.insert((object >> 16) as u16, added);
    }
}

/// Files of such a drive; the one that a machine file names.
fn write(folder: &Folder, drive: usize, mappings: &[Vec<u32>; 2], said: bool) -> String {
    let (text, mode, _) = DRIVES[drive];
    let mut eds = Eds::of(CIA402_CSP);
    add_own(&mut eds);
    let modes = eds.objects.get_mut(&0x6502).unwrap();
    modes.subs.get_mut(&0).unwrap().default = Some(Number(1 << (mode - 1)));
    for (index, mapping) in [0x1601, 0x1A02].into_iter().zip(mappings) {
        map(&mut eds, index, mapping, said);
    }
    let _sheet = folder.file("drive.eds", &eds.to_string());
    let stated = OWN
        .iter()
        .filter(|(object, ..)| mappings[0].contains(object));
    let stated: Vec<_> = stated
        .map(|(object, value, _)| format!("[\"{:X}:0\", {value}]", object >> 16))
        .collect();
    let text = format!(
        "name = \"drawn\"\neds = \"drive.eds\"\n{text}r_pdo = 2\nt_pdo = 3\nfixed_mapping = {}\nr_pdo_values = [{}]\n",
        u8::from(said),
        stated.join(", ")
    );
    folder.file("drive.toml", &text).display().to_string()
}

/// The bits of an object in a frame that is mapped so.
fn bits_of(data: &[u8], mapping: &[u32], object: u32) -> u64 {
    let before = mapping.iter().take_while(|it| **it != object);
    let begin: u32 = before.map(|it| it & 0xFF).sum();
    let word = data
        .iter()
        .rev()
        .fold(0, |word, byte| word << 8 | u128::from(*byte));
    (word >> begin & ((1 << (object & 0xFF)) - 1)) as u64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(ProptestConfig::default().cases.min(8)))]

    /// A mapping with more than a PDO can hold is refused; with any other one the axis follows its setpoints, and what else its R_PDO
    /// has is sent as stated.
    #[test]
    fn an_axis_follows_however_its_drive_is_mapped((drive, mappings) in drive(), said: bool) {
        let folder = Folder::new();
        let file = write(&folder, drive, &mappings, said);
        let velocities = drive >= 2;
        let replacements = described::replacements(&file, 2000, !velocities);
        let replacements: Vec<_> = replacements.iter().map(|(from, to)| (&**from, &**to)).collect();
        let bits = mappings.each_ref().map(|mapping| mapping.iter().map(|it| it & 0xFF).sum::<u32>());
        let too_long: Vec<_> = bits.into_iter().filter(|bits| *bits > 64).collect();
        if !too_long.is_empty() {
            let text = machine_with("described", &replacements);
            let machine = folder.file("machine.toml", &text);
            let refused = Machine::load(&machine).unwrap_err().to_string();
            for bits in too_long {
                prop_assert!(refused.contains(&format!("maps {bits} bits")), "{refused}");
            }
            return Ok(());
        }
        let mut rig = Rig::new("described", &replacements, described::PROGRAM, |_, _| ());
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let errors = rig.rows.iter().map(|row| row.axes[0].following_error.abs());
        let most = errors.fold(0.0, f64::max);
        // As with a mapping of the set-up.
        let bound = described::BOUND + if velocities { 1.0 / 6.0 / 30.0 } else { 0.0 };
        prop_assert!(most < bound, "{most} mm");
        let greatest = rig.rows.iter().map(|row| row.axes[0].act).fold(0.0, f64::max);
        prop_assert!((greatest - 50.0).abs() < bound, "{greatest} mm");
        let node = NodeId::new(1).unwrap();
        let sent = rig.sent(CobId::r_pdo(2, node));
        prop_assert!(!sent.is_empty());
        let stated = OWN.iter().map(|(object, value, _)| (*object, *value));
        let others = GAPS.map(|gap| (gap, 0)).into_iter().chain([(MODE, DRIVES[drive].1.into()), RAMP]);
        for (object, value) in stated.chain(others).filter(|(object, _)| mappings[0].contains(object)) {
            let value = value as u64 & ((1 << (object & 0xFF)) - 1);
            for it in &sent {
                prop_assert_eq!(bits_of(it.frame.data(), &mappings[0], object), value, "{:08X}", object);
            }
        }
        // Nothing is written where it is mapped.
        for request in rig.sent(CobId::r_sdo(node)) {
            let &[specifier, low, high, ..] = request.frame.data() else { unreachable!() };
            let index = u16::from_le_bytes([low, high]);
            prop_assert!(specifier >> 5 != 1 || ![0x1601, 0x1A02].contains(&index), "{:04X}", index);
        }
    }

    /// The same of an encoder that closes the loop about an axis.
    #[test]
    fn an_axis_is_where_an_encoder_says_however_it_is_mapped(
        mapping in mapped(vec![0x6004_0020], vec![OWN[0].0, OWN[1].0, 0x1001_0008]),
        said: bool,
    ) {
        let folder = Folder::new();
        let mut eds = Eds::of(CIA406);
        add_own(&mut eds);
        map(&mut eds, 0x1A01, &mapping, said);
        let _sheet = folder.file("drawn.eds", &eds.to_string());
        let text = format!(
            "name = \"drawn\"\ngeneric = \"cia406\"\neds = \"drawn.eds\"\nt_pdo = 2\nfixed_mapping = {}\n",
            u8::from(said)
        );
        let file = folder.file("drawn.toml", &text).display().to_string();
        let mut rig = described_encoder::rig(&file, &[], described::PROGRAM);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let greatest = rig.rows.iter().map(|row| row.axes[0].act).fold(0.0, f64::max);
        prop_assert!((greatest - 50.0).abs() < 0.05, "{greatest}");
    }
}

/// What the data sheet says is read before anything moves.
#[test]
fn a_drive_that_is_mapped_otherwise_is_refused() {
    let folder = Folder::new();
    let mappings = [
        vec![0x607A_0020, 0x6040_0010],
        vec![0x6064_0020, 0x6041_0010],
    ];
    let file = write(&folder, 1, &mappings, false);
    let replacements = described::replacements(&file, 2000, true);
    let replacements: Vec<_> = (replacements.iter())
        .map(|(from, to)| (&**from, &**to))
        .collect();
    let mut rig = Rig::new("described", &replacements, described::PROGRAM, |_, _| ());
    let twin = rig.twin_as::<syncline_drives::twin::cia402_csp::Twin>(0);
    twin.preset(syncline_canopen::Address::new(0x1A02, 1), 0x606C_0020);
    let Fault::Device(0, cause @ DeviceCause::WrongIdentity { .. }) = rig.finish_with_fault()
    else {
        panic!("{:?}", rig.events);
    };
    let told = cause.to_string();
    let expected = "1A02h:1 (mapped object) reads 606C0020h, expected 60640020h";
    assert!(told.contains(expected), "{told}");
    assert!(!rig.twin(0).observe().is_powered);
}
