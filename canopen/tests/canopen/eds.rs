//! Electronic data sheets: what is written is read, odd files of real vendors are understood, bad
//! ones are refused with their place, differences are found.

use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use std::collections::BTreeMap;
use syncline_canopen::Address;
use syncline_canopen::dictionary::{DataType::*, Entry, constant, ro, rw, table, wo};
use syncline_canopen::eds::{Access, Eds, Object, ObjectType, Parameter, Problem, Value};

static TABLE: [Entry; 10] = table([
    ro(0x1000, 0, "Device type", U32).default(0x0042_0192),
    ro(0x1008, 0, "Device name", Text(8)).default_text("LXM32M"),
    ro(0x1018, 0, "Identity: number", U8).default(1),
    ro(0x1018, 1, "Vendor ID", U32).default(0x0800_005A),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x4000_0180),
    rw(0x3006, 7, "ScalePOSdenom", I32),
    wo(0x3006, 8, "Trigger", U8),
    rw(0x6040, 0, "Controlword", U16).r_pdo(),
    constant(0x6041, 0, "Statusword", U16).t_pdo(),
    rw(0x6060, 0, "Mode", I8).range(-6, 10).r_pdo(),
]);

#[test]
fn table_becomes_an_eds() {
    let mut eds = Eds::of(&TABLE);
    eds.file.push(("FileName".into(), "lxm32m.eds".into()));
    eds.device.push(("VendorName".into(), "Syncline".into()));
    let text = eds.to_string();
    assert_eq!(Eds::parse(&text), Ok(eds));
    let lines = text.replace("\r\n", "\n");
    for part in [
        "[FileInfo]\nFileName=lxm32m.eds\n",
        "NrOfRXPDO=0\nNrOfTXPDO=1\nLSS_Supported=0\n",
        "[DummyUsage]\nDummy0001=0\nDummy0002=0\n",
        "[MandatoryObjects]\nSupportedObjects=2\n1=0x1000\n2=0x1018\n",
        "[ManufacturerObjects]\nSupportedObjects=1\n1=0x3006\n",
        "[1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\n\
         DefaultValue=4325778\nPDOMapping=0\n",
        "[1018]\nParameterName=Identity object\nObjectType=0x9\nSubNumber=2\n",
        "[1018sub1]\nParameterName=Vendor ID\nObjectType=0x7\nDataType=0x0007\n",
        "AccessType=rw\nDefaultValue=$NODEID+0x40000180\n",
        "[6060]\nParameterName=Mode\nObjectType=0x7\nDataType=0x0002\nAccessType=rww\n\
         LowLimit=-6\nHighLimit=10\nPDOMapping=1\n",
    ] {
        assert!(lines.contains(part), "{part}\nin\n{lines}");
    }
}

const FOREIGN: &str = "\u{FEFF}; made by hand
[fileinfo]
FILENAME=foreign.eds
[DeviceInfo]
vendornumber = 0x0800005A
[DummyUsage]
Dummy0005=1
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[Comments]
Lines=1
Line1=[not a section
[1000]
ParameterName=Device type
DataType=7
AccessType=RO
DefaultValue=0x00420192
[1014]
ParameterName=COB-ID EMCY
ObjectType=7
DataType=0x7
AccessType=const
DefaultValue=0x80+$NodeID
[2000]
ParameterName=Offset
ObjectType=0x8
CompactSubObj=3
DataType=0x0003
AccessType=rww
LowLimit=0x8000
HighLimit=0x7FFF
DefaultValue=010
PDOMapping=1
[2000Name]
NrOfEntries=1
2=Second offset
[2001]
ParameterName=Program
ObjectType=2
[2002]
ParameterName=Gain
DataType=0x0008
AccessType=rw
DefaultValue=1.5
";

#[test]
fn odd_files_are_understood() {
    let eds = Eds::parse(FOREIGN).expect("an EDS");
    assert_eq!(eds.device_info("VendorNumber"), Some("0x0800005A"));
    assert_eq!(
        eds.dummies,
        [false, false, false, false, true, false, false]
    );
    let parameter = |index: u16, sub: u8| &eds.objects[&index].subs[&sub];
    assert_eq!(
        parameter(0x1000, 0).default,
        Some(Value::Number(0x0042_0192))
    );
    assert_eq!(parameter(0x1014, 0).default, Some(Value::PlusNode(0x80)));
    assert_eq!(parameter(0x2000, 0).default, Some(Value::Number(3)));
    let offset = parameter(0x2000, 1);
    assert_eq!(offset.name, "Offset1");
    assert_eq!(offset.low, Some(Value::Number(-32768)));
    assert_eq!(offset.high, Some(Value::Number(32767)));
    assert_eq!(offset.default, Some(Value::Number(8)), "010 is octal");
    assert_eq!(offset.access, Access::Rww);
    assert_eq!(parameter(0x2000, 2).name, "Second offset");
    assert_eq!(parameter(0x2001, 0).data_type, 0x0F);
    assert_eq!(
        parameter(0x2002, 0).default,
        Some(Value::Text("1.5".into()))
    );
    assert_eq!(Eds::parse(&eds.to_string()), Ok(eds));
}

#[test]
fn bad_files_are_refused_with_their_place() {
    for (from, to, expected) in [
        (
            "[1014]",
            "1014]",
            "line 19: neither [section] nor key=value",
        ),
        ("[2001]", "[1014]", "line 38: section [1014] appears twice"),
        (
            "AccessType=const",
            "AccessType=r",
            "line 23: AccessType=r: expected const, ro, wo, rw, rwr or rww",
        ),
        (
            "DataType=0x7\n",
            "",
            "line 19: section [1014] has no DataType",
        ),
        (
            "ObjectType=7",
            "ObjectType=4",
            "line 21: ObjectType=4: expected 0, 2 or 5 to 9",
        ),
        (
            "DefaultValue=010",
            "DefaultValue=ten",
            "line 33: DefaultValue=ten: expected a number",
        ),
        (
            "CompactSubObj=3",
            "CompactSubObj=300",
            "line 28: CompactSubObj=300: expected 0 to 254",
        ),
        (
            "1=0x1000",
            "1=0x1001",
            "line 10: object 1001h is listed but has no section",
        ),
        (
            "[2002]",
            "[1000sub1]",
            "line 41: [1000sub1] belongs to no object with subindices",
        ),
        ("[fileinfo]\n", "", "line 2: a key before the first section"),
    ] {
        let text = FOREIGN.replacen(from, to, 1);
        assert_ne!(text, FOREIGN, "{from}");
        let error = Eds::parse(&text).expect_err(to);
        assert_eq!(error.to_string(), expected);
    }
    assert_eq!(
        Eds::parse("[1000]").expect_err("no name").problem,
        Problem::NoKey {
            section: "1000".into(),
            key: "ParameterName"
        }
    );
}

#[test]
fn differences_are_found() {
    let ours = Eds::of(&TABLE);
    assert!(ours.compare(&ours).is_empty());
    let mut theirs = ours.clone();
    let mut change = |index: u16, sub: u8, change: fn(&mut Parameter)| {
        let object = theirs.objects.get_mut(&index).expect("object");
        change(object.subs.get_mut(&sub).expect("subindex"));
    };
    change(0x1000, 0, |p| p.default = Some(Value::Number(1)));
    change(0x1800, 1, |p| p.default = None); // says nothing: no difference
    change(0x6040, 0, |p| p.access = Access::Rw); // same for SDO: no difference
    change(0x6041, 0, |p| p.access = Access::Rww);
    change(0x6060, 0, |p| p.data_type = 3);
    change(0x6060, 0, |p| p.low = Some(Value::Number(0)));
    change(0x3006, 7, |p| p.pdo_mapping = true);
    change(0x3006, 7, |p| p.low = Some(Value::Number(0))); // the table says nothing
    let sub = theirs
        .objects
        .get_mut(&0x1018)
        .expect("object")
        .subs
        .remove(&1);
    let name = sub.expect("subindex");
    theirs
        .objects
        .get_mut(&0x3006)
        .expect("object")
        .subs
        .insert(9, name);
    let differences: Vec<String> = ours
        .compare(&theirs)
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        differences,
        [
            "1000h:0 DefaultValue: 1, built in 4325778",
            "1018h:1 Vendor ID: built in, not in the EDS",
            "3006h:7 PDOMapping: 1, built in 0",
            "3006h:9 Vendor ID: in the EDS, not built in",
            "6041h:0 AccessType: rww, built in const",
            "6060h:0 DataType: 0003h, built in 0002h",
            "6060h:0 LowLimit: 0, built in -6",
        ]
    );
}

/// Where both sides tell the direction in which an object is mapped, it is the same or a difference.
#[test]
fn an_opposite_direction_is_a_difference() {
    let ours = Eds::of(&TABLE);
    for (access, difference) in [
        (Access::Rw, None),
        (Access::Rww, None),
        (Access::Rwr, Some("6040h:0 AccessType: rwr, built in rww")),
    ] {
        let mut theirs = ours.clone();
        let object = theirs.objects.get_mut(&0x6040).expect("object");
        object.subs.get_mut(&0).expect("subindex").access = access;
        let differences = ours.compare(&theirs);
        let told = differences.first().map(ToString::to_string);
        assert_eq!(told.as_deref(), difference, "{access}");
    }
}

fn name() -> impl Strategy<Value = String> {
    "[A-Za-z_][A-Za-z0-9_ =;#:/%-]{0,30}[A-Za-z0-9]"
}

fn parameter() -> impl Strategy<Value = Parameter> {
    let integer = || {
        prop_oneof![
            (-128i64..128).prop_map(Value::Number),
            (0i64..0x7FFF_FFFF).prop_map(Value::PlusNode),
        ]
    };
    let values = |value: BoxedStrategy<Value>| {
        let value = || proptest::option::of(value.clone());
        (value(), value(), value())
    };
    let typed = prop_oneof![
        (
            prop::sample::select(vec![
                0x01u16, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x15, 0x1B
            ]),
            values(integer().boxed())
        ),
        (
            prop::sample::select(vec![0x08u16, 0x09, 0x0A, 0x11]),
            values(name().prop_map(Value::Text).boxed())
        ),
    ];
    let access = prop::sample::select(vec![
        Access::Const,
        Access::Ro,
        Access::Wo,
        Access::Rw,
        Access::Rwr,
        Access::Rww,
    ]);
    (name(), typed, access, any::<bool>()).prop_map(
        |(name, (data_type, (default, low, high)), access, pdo_mapping)| Parameter {
            name,
            data_type,
            access,
            pdo_mapping,
            default,
            low,
            high,
        },
    )
}

fn object() -> impl Strategy<Value = Object> {
    let single = parameter().prop_map(|parameter| Object {
        name: parameter.name.clone(),
        object_type: ObjectType::Var,
        subs: BTreeMap::from([(0, parameter)]),
    });
    let kinds = vec![ObjectType::Array, ObjectType::Record];
    let several = (
        name(),
        prop::sample::select(kinds),
        btree_map(any::<u8>(), parameter(), 0..6),
    )
        .prop_map(|(name, object_type, subs)| Object {
            name,
            object_type,
            subs,
        });
    prop_oneof![single, several]
}

fn eds() -> impl Strategy<Value = Eds> {
    let pairs = || vec(("[A-Za-z]{1,12}", "[A-Za-z0-9]{0,12}"), 0..5);
    (
        pairs(),
        pairs(),
        any::<[bool; 7]>(),
        btree_map(any::<u16>(), object(), 0..20),
    )
        .prop_map(|(file, device, dummies, objects)| Eds {
            file,
            device,
            dummies,
            objects,
        })
}

proptest! {
    #[test]
    fn what_is_written_is_read(eds in eds()) {
        let text = eds.to_string();
        prop_assert_eq!(Eds::parse(&text), Ok(eds), "{}", text);
    }

    /// Damaged files are read or refused, never worse.
    #[test]
    fn damage_does_no_harm(place in 0usize..700, with in "[\\[\\]=0-9a-fx$;\\n]{0,4}") {
        let mut text = FOREIGN.to_owned();
        if text.is_char_boundary(place) && text.is_char_boundary(place + 1) {
            text.replace_range(place..place + 1, &with);
        }
        if let Ok(eds) = Eds::parse(&text) {
            prop_assert_eq!(Eds::parse(&eds.to_string()), Ok(eds));
        }
    }
}

#[test]
fn addresses_are_printed_as_manuals_print_them() {
    assert_eq!(Address::new(0x3006, 0x3D).to_string(), "3006h:3D");
}
