//! Encoders that a file describes: what an axis is watched by, or where its position loop has its position from.

use proptest::prelude::*;
use syncline_canopen::eds::Value::Number;
use syncline_canopen::eds::{Access, Eds};
use syncline_canopen::{CanId, CobId, NodeId};
use syncline_controller::control::fault::{AxisCause, DeviceCause};
use syncline_controller::control::{End, Fault};
use syncline_drives::bus::Sender;
use syncline_drives::dictionary::CIA406;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_tests::command::{Folder, root};
use syncline_tests::rig::Rig;

/// The encoder's place among the devices.
const SCREW: usize = 2;

#[derive(Clone, Debug)]
struct Description {
    steps_per_turn: u32,
    turns: u32,
    t_pdo: u8,
    pdos: u8,
    has_resolution: bool,
    has_scaling: bool,
    has_heartbeat: bool,
    fixed_mapping: bool,
    /// What is mapped stands in the data sheet.
    tells_mapping: bool,
    vendor_id: u32,
}

impl Description {
    /// Increments are well below the standstill window, 0.05 mm, and 10 mm for each of its turns are more than the axis has.
    fn any() -> impl Strategy<Value = Self> {
        (
            (1024..=1u32 << 20, 32..=0xFFFFu32, 1..=4u8, 1..=4u8),
            (any::<[bool; 5]>(), any::<u32>()),
        )
            .prop_map(
                |((steps_per_turn, turns, t_pdo, pdos), (has, vendor_id))| Self {
                    steps_per_turn,
                    // All of it in 32 bits.
                    turns: turns.min(u32::MAX / steps_per_turn),
                    t_pdo,
                    pdos,
                    has_resolution: has[0],
                    has_scaling: has[1],
                    has_heartbeat: has[2],
                    fixed_mapping: has[3],
                    tells_mapping: has[4],
                    vendor_id,
                },
            )
    }

    /// Its files; the one that a machine file names.
    fn write(&self, folder: &Folder) -> String {
        let mut eds = Eds::of(CIA406);
        let absent = [
            (self.has_resolution, &[0x6501, 0x6502][..]),
            (self.has_scaling, &[0x6000, 0x6001, 0x6002]),
            (self.has_heartbeat, &[0x1017]),
        ];
        for (_, objects) in absent.iter().filter(|(has, _)| !has) {
            eds.objects.retain(|index, _| !objects.contains(index));
        }
        // It has no other PDOs than are said.
        let most = u16::from(self.pdos.max(self.t_pdo));
        eds.objects.retain(|&index, _| {
            let of = matches!(index & !0x3, 0x1800 | 0x1A00);
            !of || index % 4 < most
        });
        if self.fixed_mapping {
            let mapping = eds.objects.get_mut(&(0x19FF + u16::from(self.t_pdo)));
            let subs = &mut mapping.unwrap().subs;
            for (sub, value) in [(0, 1), (1, 0x6004_0020)] {
                let parameter = subs.get_mut(&sub).unwrap();
                parameter.default = self.tells_mapping.then_some(Number(value));
                parameter.access = Access::Ro;
            }
        }
        let identity = eds.objects.get_mut(&0x1018).unwrap();
        identity.subs.get_mut(&1).unwrap().default = None;
        for (index, value) in [(0x6501, self.steps_per_turn), (0x6502, self.turns)] {
            if let Some(object) = eds.objects.get_mut(&index) {
                object.subs.get_mut(&0).unwrap().default = Some(Number(value.into()));
            }
        }
        let _sheet = folder.file("drawn.eds", &eds.to_string());
        let flag = u8::from;
        let text = format!(
            "name = \"drawn\"\ngeneric = \"cia406\"\neds = \"drawn.eds\"\nsteps_per_turn = {}\nturns = {}\npdos = {}\n\
             t_pdo = {}\nhas_resolution = {}\nhas_scaling = {}\nhas_heartbeat = {}\nfixed_mapping = {}\nvendor_id = {}\n",
            self.steps_per_turn,
            self.turns,
            self.pdos,
            self.t_pdo,
            flag(self.has_resolution),
            flag(self.has_scaling),
            flag(self.has_heartbeat),
            flag(self.fixed_mapping),
            self.vendor_id,
        );
        folder.file("drawn.toml", &text).display().to_string()
    }
}

const PROGRAM: &str = "G21 G90\nG0 X30 Y10\nG1 F9000 X40\nG3 X50 Y20 J10\nG0 X0 Y0\nM2\n";

/// The example with this encoder, whose position closes the loop about X or is a second opinion.
pub(super) fn rig(encoder: &str, more: &[(&str, &str)], program: &str) -> Rig {
    let folder = root().join("examples/velocity");
    let file = |name: &str| format!("model = {:?}", folder.join(name).display().to_string());
    let (wheel, inverter) = (file("wheel.toml"), file("inverter.toml"));
    let encoder = format!("model = {encoder:?}");
    let mut replacements = vec![
        ("model = \"wheel.toml\"", &*wheel),
        ("model = \"inverter.toml\"", &*inverter),
        ("model = \"scale.toml\"", &*encoder),
    ];
    replacements.extend(more);
    Rig::new("velocity", &replacements, program, |_, _| ())
}

fn scale(program: &str) -> Rig {
    let scale = root().join("examples/velocity/scale.toml");
    rig(&scale.display().to_string(), &[], program)
}

const WATCHES: (&str, &str) = ("position_loop = \"encoder\"\n", "");

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Whatever a valid description says, the axis is where it was sent, by the one T_PDO that it names, and nothing is
    /// written that moves the encoder's zero.
    #[test]
    fn an_axis_is_where_a_described_encoder_says(
        description in Description::any(),
        closes_loop: bool,
        negative: bool,
        zero in 0..1u32 << 30,
    ) {
        let folder = Folder::new();
        let file = description.write(&folder);
        let steps = f64::from(description.steps_per_turn);
        let range = u64::from(description.steps_per_turn) * u64::from(description.turns);
        let zero = format!("zero = {}", u64::from(zero) % range);
        let direction = format!("{zero}\ndirection = {:?}", if negative { "negative" } else { "positive" });
        let more = [("zero = 100_000", &*direction), if closes_loop { (WATCHES.0, WATCHES.0) } else { WATCHES }];
        let mut rig = rig(&file, &more, PROGRAM);
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let step = 10.0 / steps;
        let greatest = rig.rows.iter().map(|row| row.axes[0].act).fold(0.0, f64::max);
        prop_assert!((greatest - 50.0).abs() < 0.05 + 2.0 * step, "{greatest}");
        let errors = rig.rows.iter().map(|row| row.axes[0].following_error.abs());
        let most = errors.fold(0.0, f64::max);
        prop_assert!(most < 0.1 + 5.0 * step, "{most}");
        let node = NodeId::new(3).unwrap();
        let frames = rig.frames();
        for number in 1..=4 {
            let id = CanId::from(CobId::t_pdo(number, node));
            let used = frames.iter().any(|it| it.sender != Sender::Port && it.frame.id() == id);
            prop_assert_eq!(used, number == description.t_pdo);
        }
        let requests = rig.sent(CobId::r_sdo(node));
        let preset = |data: &[u8]| data[0] >> 5 == 1 && data[1..3] == [0x03, 0x60];
        prop_assert!(!requests.iter().any(|it| preset(it.frame.data())));
    }
}

const AROUND: &str =
    "G21 G90 G94 G61\nG0 X60 Y60\nG1 X80 F6000\nG3 X80 Y60 I-20\nG3 X80 Y60 I-20\nM2\n";

#[test]
fn each_loss_of_a_described_encoder_has_its_own_message() {
    for (disturbance, text) in [
        (Disturbance::Mute(true), "no T_PDO in 2 cycles in a row"),
        (Disturbance::Reset, "no T_PDO in 2 cycles in a row"),
        (
            Disturbance::Fault(ErrorClass::StopAndSwitchOff),
            "EMCY 5000h",
        ),
    ] {
        let mut rig = scale(AROUND);
        rig.run_to_row(400);
        rig.twin(SCREW).disturb(disturbance);
        let fault = rig.finish_with_fault().describe(&*rig.layout);
        let who = "node 3 (screw, Scale 13): ";
        assert!(fault.starts_with(who) && fault.contains(text), "{fault}");
        assert!(rig.ends_at_rest(), "{fault}");
    }
}

#[test]
fn a_heartbeat_that_is_lost_alone_stops_as_well() {
    let mut rig = scale(AROUND);
    rig.run_to_row(200);
    let heartbeat = CanId::from(CobId::error_control(NodeId::new(3).unwrap()));
    rig.bus().doctor = Some(Box::new(move |received| received.frame.id() != heartbeat));
    let fault = rig.finish_with_fault();
    assert_eq!(fault, Fault::Device(SCREW, DeviceCause::HeartbeatLost));
}

#[test]
fn a_coupling_that_slips_is_found() {
    let mut rig = scale(AROUND);
    rig.run_to_row(400);
    rig.slip(0, 0.05);
    let fault = rig.finish_with_fault();
    assert!(
        matches!(fault, Fault::Axis(0, AxisCause::FeedbackDifference { .. })),
        "{fault:?}"
    );
}

/// Another encoder than the one described is refused before anything moves.
#[test]
fn another_encoder_is_refused() {
    let folder = Folder::new();
    let description = Description {
        steps_per_turn: 8192,
        turns: 4096,
        t_pdo: 1,
        pdos: 4,
        has_resolution: true,
        has_scaling: true,
        has_heartbeat: true,
        fixed_mapping: false,
        tells_mapping: true,
        vendor_id: 0x1234,
    };
    let file = description.write(&folder);
    let mut rig = self::rig(&file, &[], AROUND);
    rig.twin(SCREW).disturb(Disturbance::Vendor(0x4321));
    let Fault::Device(SCREW, cause @ DeviceCause::WrongIdentity { .. }) = rig.finish_with_fault()
    else {
        panic!("{:?}", rig.events);
    };
    let told = cause.to_string();
    let expected = "1018h:1 (vendor ID) reads 00004321h, expected 00001234h";
    assert!(told.contains(expected), "{told}");
}
