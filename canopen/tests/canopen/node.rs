//! A generic node, seen from the bus: what each communication object makes it do.

use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, Row, ro, rw, table};
use syncline_canopen::emcy::Emergency;
use syncline_canopen::node::{Application, LocalNode, Options, Origin, ParameterRules};
use syncline_canopen::sync::Sync;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId, nmt};

const NODE: u8 = 1;

#[rustfmt::skip]
static TABLE: [Entry; 61] = table([
    ro(0x1000, 0, "Device type", U32).default(0x0042_0192),
    ro(0x1001, 0, "Error register", U8),
    rw(0x1003, 0, "Number of errors", U8),
    ro(0x1003, 1, "Newest error", U32),
    ro(0x1003, 2, "Second error", U32),
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x80),
    rw(0x1006, 0, "Communication cycle period", U32).unit("us"),
    rw(0x100C, 0, "Guard time", U16).unit("ms"),
    rw(0x100D, 0, "Life time factor", U8),
    rw(0x1010, 1, "Store all parameters", U32).default(1),
    rw(0x1011, 1, "Restore all parameters", U32).default(1),
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80),
    rw(0x1015, 0, "Inhibit time EMCY", U16).unit("100 us"),
    ro(0x1016, 0, "Consumer heartbeat: number", U8).default(2),
    rw(0x1016, 1, "Consumer heartbeat time 1", U32),
    rw(0x1016, 2, "Consumer heartbeat time 2", U32),
    rw(0x1017, 0, "Producer heartbeat time", U16).unit("ms"),
    rw(0x1019, 0, "SYNC counter overflow", U8).range(0, 240),
    ro(0x1029, 0, "Error behaviour: number", U8).default(1),
    rw(0x1029, 1, "Communication error", U8).range(0, 2),
    ro(0x1201, 0, "2nd server SDO: number", U8).default(3),
    rw(0x1201, 1, "COB-ID client to server", U32).default(0x8000_0000),
    rw(0x1201, 2, "COB-ID server to client", U32).default(0x8000_0000),
    ro(0x1400, 0, "R_PDO1 parameter: number", U8).default(2),
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x200),
    rw(0x1400, 2, "Transmission type R_PDO1", U8).default(255),
    ro(0x1401, 0, "R_PDO2 parameter: number", U8).default(2),
    rw(0x1401, 1, "COB-ID R_PDO2", U32).default_plus_node(0x8000_0300),
    rw(0x1401, 2, "Transmission type R_PDO2", U8).default(1),
    rw(0x1600, 0, "R_PDO1 mapping: number", U8).range(0, 4).default(1),
    rw(0x1600, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1600, 2, "2nd mapped object", U32),
    rw(0x1600, 3, "3rd mapped object", U32),
    rw(0x1600, 4, "4th mapped object", U32),
    rw(0x1601, 0, "R_PDO2 mapping: number", U8).range(0, 4).default(2),
    rw(0x1601, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1601, 2, "2nd mapped object", U32).default(0x60C1_0120),
    ro(0x1800, 0, "T_PDO1 parameter: number", U8).default(6),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(255),
    rw(0x1800, 3, "Inhibit time T_PDO1", U16).unit("100 us"),
    rw(0x1800, 5, "Event timer T_PDO1", U16).unit("ms"),
    rw(0x1800, 6, "SYNC start value T_PDO1", U8),
    ro(0x1801, 0, "T_PDO2 parameter: number", U8).default(5),
    rw(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0x8000_0280),
    rw(0x1801, 2, "Transmission type T_PDO2", U8).default(1),
    rw(0x1A00, 0, "T_PDO1 mapping: number", U8).range(0, 4).default(1),
    rw(0x1A00, 1, "1st mapped object", U32).default(0x6041_0010),
    rw(0x1A00, 2, "2nd mapped object", U32),
    rw(0x1A00, 3, "3rd mapped object", U32),
    rw(0x1A01, 0, "T_PDO2 mapping: number", U8).range(0, 4).default(2),
    rw(0x1A01, 1, "1st mapped object", U32).default(0x6041_0010),
    rw(0x1A01, 2, "2nd mapped object", U32).default(0x6064_0020),
    rw(0x2000, 0, "Program", Domain(1000)),
    rw(0x2001, 0, "Gain", U16).default(7).persistent(),
    rw(0x6040, 0, "Controlword", U16).r_pdo(),
    ro(0x6041, 0, "Statusword", U16).t_pdo().default(0x6231),
    rw(0x6060, 0, "Mode", I8).range(-6, 10).r_pdo(),
    ro(0x6064, 0, "Actual position", I32).t_pdo(),
    rw(0x60C1, 1, "Setpoint", I32).r_pdo(),
    rw(0x6203, 0, "Flag", Bool).r_pdo().t_pdo(),
]);

/// A device that writes down what happens to it.
struct Device {
    objects: Dictionary,
    told: Vec<String>,
    emergencies: Vec<Emergency>,
    event_mask: u64,
    event: Option<Row>,
}

impl Application for Device {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn written(&mut self, _: Instant, row: Row, origin: Origin) {
        let address = self.objects.entry(row).address;
        if address.index >= 0x2000 {
            let value = self.objects.get(row);
            self.told
                .push(format!("{address} := {value:X}h {origin:?}"));
        }
    }

    fn on_reset(&mut self, _: Instant, reset: nmt::Event) {
        self.told.push(format!("after {reset:?}"));
    }

    fn on_sync(&mut self, _: Instant, sync: Sync) {
        self.told.push(format!("SYNC {:?}", sync.counter));
    }

    fn on_nmt(&mut self, _: Instant, event: nmt::Event) {
        self.told.push(format!("{event:?}"));
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.emergencies.pop()
    }

    fn next_event(&mut self) -> Option<Row> {
        self.event.take()
    }

    fn event_mask(&self, _: u16) -> u64 {
        self.event_mask
    }
}

/// A bus with the node and a master on it.
struct Bench {
    node: LocalNode,
    device: Device,
    now: Instant,
}

impl Bench {
    fn new() -> Self {
        Self::with(Options::default())
    }

    fn with(options: Options) -> Self {
        let id = NodeId::new(NODE).expect("1…127");
        let objects = Dictionary::new(&TABLE, id);
        let mut bench = Self {
            node: LocalNode::new(id, &objects, options),
            device: Device {
                objects,
                told: Vec::new(),
                emergencies: Vec::new(),
                event_mask: u64::MAX,
                event: None,
            },
            now: Instant::ZERO,
        };
        assert_eq!(bench.send("601#4000100000000000"), "", "not before boot-up");
        let mut sent = Vec::new();
        bench.node.power_on(bench.now);
        bench.node.poll(bench.now, &mut bench.device, &mut sent);
        assert_eq!(printed(&sent), "701#00");
        bench.told();
        bench
    }

    fn operational() -> Self {
        let mut bench = Self::new();
        bench.send("000#0101");
        bench
    }

    /// Sends one frame and returns what the node sends at once.
    fn send(&mut self, frame: &str) -> String {
        let mut sent = Vec::new();
        self.node
            .on_frame(self.now, &parse(frame), &mut self.device, &mut sent);
        printed(&sent)
    }

    /// Writes an object by SDO; the abort code or 0.
    fn write(&mut self, index: u16, sub: u8, value: i64) -> u32 {
        let row = self.device.objects.row(index, sub).expect("in the table");
        let size = self.device.objects.entry(row).data_type.size();
        let [low, high] = index.to_le_bytes();
        let mut request = [0x23 | (4 - size as u8) << 2, low, high, sub, 0, 0, 0, 0];
        request[4..].copy_from_slice(&(value as u32).to_le_bytes());
        let mut sent = Vec::new();
        let frame = Frame::new(CobId::new(0x601).expect("id"), &request);
        self.node
            .on_frame(self.now, &frame, &mut self.device, &mut sent);
        let answer = sent
            .iter()
            .find(|frame| frame.id().raw() == 0x581)
            .expect("an answer");
        match answer.data()[0] {
            0x60 => 0,
            0x80 => u32::from_le_bytes(answer.data()[4..].try_into().expect("4 bytes")),
            other => panic!("{other:02X}h"),
        }
    }

    #[track_caller]
    fn set(&mut self, index: u16, sub: u8, value: i64) {
        assert_eq!(self.write(index, sub, value), 0, "{index:04X}:{sub:X}");
    }

    /// Lets time pass and returns what the node sends, each with the ms since the start.
    fn pass(&mut self, ms: u64) -> Vec<String> {
        let end = self.now + Duration::from_millis(ms);
        let mut all = Vec::new();
        while let Some(next) = self.node.deadline().filter(|&next| next <= end) {
            assert!(next >= self.now, "a deadline in the past");
            self.now = next;
            let mut sent = Vec::new();
            self.node.poll(next, &mut self.device, &mut sent);
            let ms = next.as_nanos() as f64 * 1e-6;
            all.extend(sent.iter().map(|frame| format!("{ms} {frame:?}")));
        }
        self.now = end;
        all
    }

    /// The device changes a value by itself.
    fn change(&mut self, index: u16, value: i64) -> String {
        assert!(self.device.objects.put(index, 0, value));
        let mut sent = Vec::new();
        self.node.poll(self.now, &mut self.device, &mut sent);
        printed(&sent)
    }

    fn told(&mut self) -> Vec<String> {
        std::mem::take(&mut self.device.told)
    }
}

fn printed(frames: &[Frame]) -> String {
    let frames: Vec<String> = frames.iter().map(|frame| format!("{frame:?}")).collect();
    frames.join(" ")
}

/// A frame as candump prints it.
fn parse(text: &str) -> Frame {
    let (id, data) = text.split_once('#').expect("id#data");
    let id = CobId::new(u16::from_str_radix(id, 16).expect("hex")).expect("11 bits");
    if let Some(dlc) = data.strip_prefix('R') {
        return Frame::remote(id, dlc.parse().expect("dlc")).expect("dlc");
    }
    let bytes: Vec<u8> = (0..data.len() / 2)
        .map(|i| u8::from_str_radix(&data[2 * i..2 * i + 2], 16).expect("hex"))
        .collect();
    Frame::new(id, &bytes)
}

const INVALID: u32 = 0x0609_0030;
const UNSUPPORTED: u32 = 0x0601_0000;
const NOT_MAPPABLE: u32 = 0x0604_0041;
const PDO_LENGTH: u32 = 0x0604_0042;

#[test]
fn nmt_commands() {
    let mut bench = Bench::new();
    assert_eq!(bench.node.state(), nmt::State::PreOperational);
    assert_eq!(bench.send("000#0102"), "", "another node's command");
    assert_eq!(bench.send("000#0101"), "181#3162", "(lxm32m 1755)");
    assert_eq!(bench.send("000#0101"), "", "nothing new");
    assert_eq!(bench.send("000#0200"), "");
    assert_eq!(bench.send("601#4000100000000000"), "", "Stopped");
    assert_eq!(bench.send("000#8001"), "");
    assert_eq!(
        bench.send("601#4000100000000000"),
        "581#4300100092014200",
        "(lxm32m X-02)"
    );
    bench.set(0x1017, 0, 50);
    bench.set(0x2001, 0, 8);
    assert_eq!(bench.send("000#8201"), "701#00");
    assert_eq!(bench.device.objects.value(0x1017, 0), Some(0));
    assert_eq!(bench.device.objects.value(0x2001, 0), Some(8));
    assert_eq!(bench.send("000#8100"), "701#00");
    assert_eq!(bench.device.objects.value(0x2001, 0), Some(7));
    assert_eq!(
        bench.told(),
        [
            "Entered(Operational)",
            "Entered(Stopped)",
            "Entered(PreOperational)",
            "2001h:0 := 8h Sdo",
            "ResetCommunication",
            "after ResetCommunication",
            "ResetNode",
            "after ResetNode"
        ]
    );
}

#[test]
fn boot_time() {
    let mut bench = Bench::with(Options {
        boot_time: Duration::from_millis(20),
        ..Options::default()
    });
    bench.send("000#8201");
    assert_eq!(bench.told(), ["ResetCommunication"]);
    assert_eq!(bench.send("000#0101"), "", "a resetting node obeys nothing");
    assert_eq!(bench.pass(30), ["20 701#00"]);
    assert_eq!(bench.told(), ["after ResetCommunication"]);
}

#[test]
fn values_are_stored_and_restored() {
    let mut bench = Bench::new();
    bench.set(0x2001, 0, 8);
    assert_eq!(bench.write(0x1010, 1, 1), 0x0800_0020, "not \"save\"");
    bench.set(0x1010, 1, 0x6576_6173);
    bench.set(0x2001, 0, 9);
    bench.send("000#8101");
    assert_eq!(bench.device.objects.value(0x2001, 0), Some(8));
    bench.set(0x1011, 1, 0x6461_6F6C);
    assert_eq!(bench.device.objects.value(0x2001, 0), Some(8));
    bench.send("000#8101");
    assert_eq!(bench.device.objects.value(0x2001, 0), Some(7));
}

#[test]
fn event_driven_t_pdo() {
    let mut bench = Bench::operational();
    assert_eq!(bench.change(0x6041, 0x4237), "181#3742");
    assert_eq!(bench.change(0x6041, 0x4237), "", "no change");
    bench.device.event = bench.device.objects.row(0x6041, 0);
    assert_eq!(
        bench.change(0x6041, 0x4237),
        "181#3742",
        "an event all the same"
    );
    bench.send("000#8001");
    bench.set(0x1800, 1, 0x8000_0181);
    bench.set(0x1800, 3, 50); // inhibited for 5 ms
    bench.set(0x1800, 5, 20); // at least every 20 ms
    bench.set(0x1800, 1, 0x181);
    assert_eq!(bench.send("000#0101"), "181#3742");
    assert_eq!(bench.change(0x6041, 1), "");
    assert_eq!(bench.change(0x6041, 2), "");
    assert_eq!(bench.pass(50), ["5 181#0200", "25 181#0200", "45 181#0200"]);
    bench.send("000#0201");
    assert!(bench.pass(100).is_empty());
}

#[test]
fn event_mask_picks_the_objects_that_count() {
    let mut bench = Bench::new();
    bench.set(0x1801, 2, 254);
    bench.set(0x1801, 1, 0x281);
    bench.device.event_mask = 0b10;
    bench.send("000#0101");
    assert_eq!(bench.change(0x6041, 1), "");
    assert_eq!(bench.change(0x6064, -1), "281#0100FFFFFFFF");
}

#[test]
fn synchronous_t_pdos() {
    for (kind, expected) in [
        (1, ["281", "281", "281", "281"]),
        (2, ["", "281", "", "281"]),
        (0, ["281", "", "281", ""]),
        (252, ["", "", "", ""]),
        (254, ["", "", "", ""]),
    ] {
        let mut bench = Bench::new();
        bench.set(0x1801, 2, kind);
        bench.set(0x1801, 1, 0x281);
        assert_eq!(bench.send("080#"), "", "not before Operational");
        bench.send("000#0101");
        let mut sent = Vec::new();
        for sync in 0..4 {
            if sync == 2 {
                bench.device.objects.put(0x6064, 0, 1000);
            }
            let frames = bench.send("080#");
            sent.push(frames.split('#').next().expect("id").to_owned());
        }
        if kind == 254 {
            assert_eq!(sent, ["", "", "281", ""], "at the change, not at SYNC");
        } else {
            assert_eq!(sent, expected, "type {kind}");
        }
    }
}

#[test]
fn sync_counter_starts_a_t_pdo() {
    let mut bench = Bench::new();
    bench.set(0x1800, 1, 0x8000_0181);
    bench.set(0x1800, 2, 2);
    bench.set(0x1800, 6, 3);
    bench.set(0x1800, 1, 0x181);
    bench.send("000#0101");
    let sent: Vec<String> = (1..=6)
        .map(|n| bench.send(&format!("080#{n:02X}")))
        .collect();
    assert_eq!(sent, ["", "", "", "181#3162", "", "181#3162"]);
}

#[test]
fn remote_requests() {
    let mut bench = Bench::new();
    for (kind, after) in [(252, "281#010064000000"), (253, "281#0200C8000000")] {
        bench.send("000#8001");
        bench.set(0x1801, 1, 0x8000_0281);
        bench.set(0x1801, 2, kind);
        bench.set(0x1801, 1, 0x281);
        bench.send("000#0101");
        for (value, then) in [(1, "080#"), (2, "281#R6")] {
            bench.device.objects.put(0x6041, 0, value);
            bench.device.objects.put(0x6064, 0, value * 100);
            let sent = bench.send(then);
            if then.ends_with("R6") {
                assert_eq!(sent.split(' ').next(), Some(after), "type {kind}");
            }
        }
    }
    bench.set(0x1801, 1, 0x8000_0281);
    bench.set(0x1801, 1, 0x4000_0281);
    assert_eq!(bench.send("281#R6"), "", "bit 30 forbids it");
}

#[test]
fn r_pdos() {
    let mut bench = Bench::operational();
    bench.told();
    bench.send("201#0F00");
    assert_eq!(bench.told(), ["6040h:0 := Fh Pdo(1)"]);
    bench.send("201#0600AA");
    assert_eq!(bench.told(), ["6040h:0 := 6h Pdo(1)"], "longer is taken");
    assert_eq!(bench.send("301#1F0001000000"), "", "switched off");
    assert!(bench.told().is_empty());
    bench.set(0x1401, 1, 0x301);
    bench.send("301#1F00FEFFFFFF");
    assert!(bench.told().is_empty(), "waits for SYNC");
    bench.send("080#");
    assert_eq!(
        bench.told(),
        [
            "6040h:0 := 1Fh Pdo(2)",
            "60C1h:1 := FFFFFFFFFFFFFFFEh Pdo(2)",
            "SYNC None"
        ]
    );
    bench.send("080#");
    assert_eq!(bench.told(), ["SYNC None"], "once");
    assert_eq!(
        bench.send("201#0F"),
        "081#1082110000010000",
        "too short: EMCY 8210h"
    );
    assert!(bench.told().is_empty());
}

#[test]
fn r_pdo_with_a_gap_and_a_value_out_of_range() {
    let mut bench = Bench::new();
    bench.set(0x1400, 1, 0x8000_0201);
    bench.set(0x1600, 0, 0);
    bench.set(0x1600, 1, 0x0005_0008);
    bench.set(0x1600, 2, 0x6060_0008);
    bench.set(0x1600, 3, 0x6040_0010);
    bench.set(0x1600, 0, 3);
    bench.set(0x1400, 1, 0x201);
    bench.send("000#0101");
    bench.told();
    bench.send("201#FFFA0F00");
    bench.send("201#FF0B0600");
    assert_eq!(
        bench.told(),
        [
            "6060h:0 := FFFFFFFFFFFFFFFAh Pdo(1)",
            "6040h:0 := Fh Pdo(1)",
            "6040h:0 := 6h Pdo(1)"
        ]
    );
}

#[test]
fn mapping_checks() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x1600, 0, 0), UNSUPPORTED, "while switched on");
    bench.set(0x1400, 1, 0x8000_0201);
    assert_eq!(
        bench.write(0x1600, 1, 0x6060_0008),
        UNSUPPORTED,
        "count not 0"
    );
    bench.set(0x1600, 0, 0);
    for (entry, code) in [
        (0x6041_0010, NOT_MAPPABLE), // wrong direction (lxm32m X-09)
        (0x1017_0010, NOT_MAPPABLE), // no PDO object
        (0x6040_0020, NOT_MAPPABLE), // wrong length
        (0x7000_0010, 0x0602_0000),  // no such object
        (0x6040_0110, 0x0609_0011),  // no such subindex
        (0x0005_0010, NOT_MAPPABLE), // dummy of a wrong length
    ] {
        assert_eq!(bench.write(0x1600, 1, entry), code, "{entry:08X}h");
    }
    for sub in 1..=3 {
        bench.set(0x1600, sub, 0x60C1_0120);
    }
    assert_eq!(bench.write(0x1600, 0, 3), PDO_LENGTH, "12 bytes");
    assert_eq!(bench.write(0x1600, 0, 5), PDO_LENGTH, "more than entries");
    bench.set(0x1600, 0, 2);
    assert_eq!(bench.write(0x1A00, 1, 0x6040_0010), UNSUPPORTED);
    bench.set(0x1800, 1, 0x8000_0181);
    bench.set(0x1A00, 0, 0);
    assert_eq!(bench.write(0x1A00, 1, 0x6040_0010), NOT_MAPPABLE);
    assert_eq!(
        bench.write(0x1A00, 1, 0x0005_0008),
        0x0602_0000,
        "no gaps in T_PDOs"
    );
}

#[test]
fn single_bits_can_be_mapped() {
    let mut bench = Bench::new();
    bench.set(0x1400, 1, 0x8000_0201);
    bench.set(0x1600, 0, 0);
    bench.set(0x1600, 1, 0x60C1_0120);
    bench.set(0x1600, 2, 0x60C1_0120);
    bench.set(0x1600, 3, 0x6203_0001);
    assert_eq!(bench.write(0x1600, 0, 3), PDO_LENGTH, "65 bits");
    bench.set(0x1600, 1, 0x6060_0008);
    bench.set(0x1600, 2, 0x6203_0001);
    bench.set(0x1600, 0, 2);
    bench.set(0x1400, 1, 0x201);
    bench.send("000#0101");
    bench.told();
    bench.send("201#0603");
    assert_eq!(
        bench.told(),
        ["6060h:0 := 6h Pdo(1)", "6203h:0 := 1h Pdo(1)"]
    );
    assert_eq!(
        bench.send("201#06"),
        "081#1082110000010000",
        "9 bits are 2 bytes"
    );
}

#[test]
fn parameter_checks() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x1800, 1, 0x185), INVALID, "moved while in use");
    bench.set(0x1800, 1, 0x8000_0185);
    assert_eq!(
        bench.write(0x1800, 1, 0x581),
        INVALID,
        "an SDO's identifier"
    );
    assert_eq!(bench.write(0x1800, 1, 0x0400_0185), INVALID, "11 bits only");
    bench.set(0x1800, 1, 0x185);
    for kind in [241, 251] {
        assert_eq!(bench.write(0x1800, 2, kind), INVALID, "type {kind}");
    }
    assert_eq!(bench.write(0x1800, 3, 1), INVALID, "inhibit time in use");
    assert_eq!(bench.send("000#0101"), "185#3162");
}

/// The order of the LXM32M's manual (lxm32m 1605-1626) and its worked COB-ID words (1784).
#[test]
fn lenient_parameters() {
    let mut bench = Bench::with(Options {
        parameters: ParameterRules::Lenient {
            pdo: 0x8000_07FF,
            sync_and_emcy: 0x0780,
        },
        ..Options::default()
    });
    for (index, sub, value) in [
        (0x1401, 1, 0x0400_0301),
        (0x1801, 1, 0x0000_0281),
        (0x1401, 2, 1),
        (0x1801, 2, 1),
        (0x1601, 0, 0),
        (0x1601, 1, 0x6040_0010),
        (0x1601, 2, 0x60C1_0120),
        (0x1601, 0, 2),
        (0x1A01, 0, 0),
        (0x1A01, 1, 0x6041_0010),
        (0x1A01, 2, 0x6064_0020),
        (0x1A01, 0, 2),
    ] {
        bench.set(index, sub, value);
    }
    assert_eq!(bench.device.objects.value(0x1401, 1), Some(0x301));
    bench.set(0x1014, 0, 0x501);
    assert_eq!(bench.device.objects.value(0x1014, 0), Some(0x501));
    assert_eq!(bench.write(0x1014, 0, 0x101), 0x0609_0030, "restricted");
    bench.set(0x1014, 0, 0x85);
    assert_eq!(bench.device.objects.value(0x1014, 0), Some(0x81));
    bench.send("000#0101");
    assert_eq!(bench.send("080#"), "281#316200000000");
}

#[test]
fn heartbeat_and_1029() {
    let mut bench = Bench::new();
    bench.set(0x1017, 0, 50);
    bench.set(0x1016, 1, 0x007F_0064);
    assert_eq!(bench.write(0x1016, 2, 0x007F_0032), 0x0604_0043, "twice");
    assert_eq!(bench.pass(100), ["0 701#7F", "50 701#7F", "100 701#7F"]);
    bench.send("000#0101");
    bench.send("77F#05");
    bench.told();
    assert_eq!(
        bench.pass(101),
        ["150 701#05", "200 701#05", "200 081#3081110000000000"]
    );
    assert_eq!(bench.told(), ["Entered(PreOperational)"]);
    assert_eq!(bench.device.objects.value(0x1001, 0), Some(0x11));
    for (behaviour, state) in [(1, nmt::State::Operational), (2, nmt::State::Stopped)] {
        bench.send("000#8001");
        bench.set(0x1029, 1, behaviour);
        bench.send("000#0101");
        bench.send("77F#05");
        bench.pass(101);
        assert_eq!(bench.node.state(), state);
    }
}

#[test]
fn guarding() {
    let mut bench = Bench::new();
    bench.set(0x100C, 0, 100);
    bench.set(0x100D, 0, 2);
    bench.send("000#0101");
    assert!(bench.pass(1000).is_empty(), "starts with the first request");
    assert_eq!(bench.send("701#R1"), "701#05");
    assert_eq!(bench.send("701#R1"), "701#85");
    assert_eq!(bench.pass(300), ["1200 081#3081110000000000"]);
    assert_eq!(bench.node.state(), nmt::State::PreOperational);
    bench.send("000#8201");
    assert_eq!(bench.send("701#R1"), "701#7F", "the toggle bit starts anew");
    bench.set(0x1017, 0, 100);
    assert_eq!(bench.send("701#R1"), "", "a heartbeat excludes guarding");
}

#[test]
fn emergencies_and_their_history() {
    let mut bench = Bench::new();
    bench.set(0x1015, 0, 100);
    for code in [0x1000, 0x2310, 0x7300] {
        bench.device.emergencies.push(Emergency {
            code,
            register: 0x21,
            vendor: [0, 0, 0, 0x04, 0xB4],
        });
        bench.change(0x6041, 0);
    }
    assert_eq!(
        bench.pass(20),
        ["10 081#10232100000004B4", "20 081#00732100000004B4"]
    );
    let values =
        |bench: &Bench| [0, 1, 2].map(|sub| bench.device.objects.value(0x1003, sub).expect("row"));
    assert_eq!(values(&bench), [2, 0x7300, 0x2310]);
    assert_eq!(bench.device.objects.value(0x1001, 0), Some(0x21));
    assert_eq!(bench.write(0x1003, 0, 1), INVALID);
    bench.set(0x1003, 0, 0);
    assert_eq!(values(&bench), [0, 0, 0]);
}

#[test]
fn sync_producer() {
    let mut bench = Bench::new();
    bench.set(0x1019, 0, 2);
    bench.set(0x1006, 0, 10_000);
    assert!(bench.pass(50).is_empty());
    bench.set(0x1005, 0, 0x4000_0080);
    assert_eq!(bench.pass(30), ["60 080#01", "70 080#02", "80 080#01"]);
    assert_eq!(
        bench.told(),
        ["SYNC Some(1)", "SYNC Some(2)", "SYNC Some(1)"]
    );
}

/// What cannot be done must not stay due: whoever drives the node would never get past it.
#[test]
fn no_deadline_stays_due() {
    let mut bench = Bench::new();
    bench.set(0x1005, 0, 0x4000_0080);
    bench.set(0x1006, 0, 10_000);
    bench.set(0x1800, 5, 20);
    bench.set(0x1800, 1, 0x8000_0181);
    bench.send("000#0101");
    assert_eq!(bench.pass(25), ["10 080#", "20 080#"]);
    bench.send("000#0201");
    assert!(bench.pass(20).is_empty());
    bench.send("000#8001");
    assert_eq!(bench.pass(15), ["55 080#"], "starts anew");
}

#[test]
fn event_timer_waits_for_the_inhibit_time() {
    let mut bench = Bench::new();
    bench.set(0x1800, 1, 0x8000_0181);
    bench.set(0x1800, 3, 300); // 30 ms
    bench.set(0x1800, 5, 20);
    bench.set(0x1800, 1, 0x181);
    bench.send("000#0101");
    assert_eq!(bench.pass(70), ["30 181#3162", "60 181#3162"]);
}

#[test]
fn second_sdo_server() {
    let mut bench = Bench::new();
    assert_eq!(bench.send("641#4000100000000000"), "");
    // 640h + id lies in the range that CiA 301 keeps for default servers.
    assert_eq!(bench.write(0x1201, 1, 0x641), INVALID);
    bench.set(0x1201, 1, 0x6E1 - 0x40);
    bench.set(0x1201, 2, 0x6E1 - 0x41);
    assert_eq!(bench.send("6A1#4000100000000000"), "6A0#4300100092014200");
    assert_eq!(bench.send("601#4000100000000000"), "581#4300100092014200");
    bench.set(0x1201, 1, 0x8000_06A1);
    assert_eq!(bench.send("6A1#4000100000000000"), "");
}

#[test]
fn segmented_and_block_download_to_a_domain() {
    let mut bench = Bench::new();
    assert_eq!(bench.send("601#210020000A000000"), "581#6000200000000000");
    assert_eq!(bench.send("601#0030313233343536"), "581#2000000000000000");
    assert_eq!(bench.send("601#1937383900000000"), "581#3000000000000000");
    let row = bench.device.objects.row(0x2000, 0).expect("row");
    assert_eq!(bench.device.objects.bytes(row), b"0123456789");
    // CRC-16 31C3h of "123456789" (CiA 301).
    assert_eq!(bench.send("601#C600200009000000"), "581#A40020007F000000");
    assert_eq!(bench.send("601#0131323334353637"), "");
    assert_eq!(bench.send("601#8238390000000000"), "581#A2027F0000000000");
    assert_eq!(bench.send("601#D5C3310000000000"), "581#A100000000000000");
    assert_eq!(bench.device.objects.bytes(row), b"123456789");
}
