//! What a node's table does not say: older boot-up, guarding, SYNC and identifiers (DS 301 V3),
//! and a node id that changes.

use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, Row, ro, rw, table};
use syncline_canopen::nmt::State;
use syncline_canopen::node::{
    Application, BootUp, LifeGuarding, LocalNode, Options, ParameterRules,
};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame, Instant, NodeId};

const MS: Duration = Duration::from_millis(1);

#[rustfmt::skip]
static TABLE: [Entry; 29] = table([
    ro(0x1000, 0, "Device type", U32).default(0x0002_0196),
    ro(0x1001, 0, "Error register", U8),
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x8000_0080).persistent(),
    rw(0x1006, 0, "Communication cycle period", U32).unit("ms"),
    rw(0x100C, 0, "Guard time", U16).unit("ms"),
    rw(0x100D, 0, "Life time factor", U8),
    rw(0x100E, 0, "COB-ID guarding", U32).default_plus_node(0x700).persistent(),
    rw(0x1010, 1, "Store", U32),
    rw(0x1011, 1, "Restore", U32),
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80).persistent(),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180).persistent(),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(254),
    rw(0x1800, 3, "Inhibit time T_PDO1", U16),
    rw(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0x8000_0280),
    rw(0x1801, 2, "Transmission type T_PDO2", U8).default(254),
    rw(0x1801, 5, "Event timer T_PDO2", U16).default(40),
    rw(0x1802, 1, "COB-ID T_PDO3", U32).default_plus_node(0x8000_0380),
    rw(0x1802, 2, "Transmission type T_PDO3", U8).default(2),
    ro(0x1A00, 0, "T_PDO1 mapping: number", U8).default(1),
    ro(0x1A00, 1, "1st mapped object", U32).default(0x6004_0020),
    ro(0x1A01, 0, "T_PDO2 mapping: number", U8).default(1),
    ro(0x1A01, 1, "1st mapped object", U32).default(0x6004_0020),
    ro(0x1A02, 0, "T_PDO3 mapping: number", U8).default(1),
    ro(0x1A02, 1, "1st mapped object", U32).default(0x6004_0020),
    rw(0x2000, 0, "Node id", U8).default(1).persistent(),
    ro(0x6004, 0, "Position", U32).t_pdo(),
    rw(0x6200, 0, "Cyclic timer", U16).unit("ms").persistent(),
    rw(0x6300, 0, "Secret", U8),
    rw(0x6400, 0, "Plain", U8),
]);

struct Device {
    objects: Dictionary,
    /// Power has been on, so that 2000h counts.
    has_run: bool,
}

impl Application for Device {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn node_id(&self) -> Option<NodeId> {
        let id = self.objects.value(0x2000, 0).filter(|_| self.has_run)?;
        NodeId::new(id as u8)
    }

    fn check_read(&self, row: Row) -> Result<(), AbortCode> {
        match self.objects.entry(row).address.index {
            0x6300 => Err(AbortCode::DeviceState),
            _ => Ok(()),
        }
    }

    fn state_after_loss(&self, _: State) -> State {
        State::PreOperational
    }
}

struct Bench {
    node: LocalNode,
    device: Device,
    now: Instant,
}

/// As candump prints it; `R` is a remote request.
fn parse(text: &str) -> Frame {
    let (id, data) = text.split_once('#').expect("#");
    let id = CanId::Standard(u16::from_str_radix(id, 16).expect("an identifier"));
    if data == "R" {
        return Frame::remote(id, 1).expect("a remote request");
    }
    let bytes = (0..data.len()).step_by(2);
    let bytes: Vec<u8> = bytes
        .map(|place| u8::from_str_radix(&data[place..place + 2], 16).expect("hexadecimal"))
        .collect();
    Frame::new(id, &bytes)
}

fn printed(frames: &[Frame]) -> String {
    let frames: Vec<String> = frames.iter().map(|frame| format!("{frame:?}")).collect();
    frames.join(" ")
}

impl Bench {
    /// A node that has just booted, and what it said.
    fn booted(options: Options) -> (Self, String) {
        let id = NodeId::new(1).expect("1…127");
        let objects = Dictionary::new(&TABLE, id);
        let options = Options {
            parameters: ParameterRules::Lenient {
                pdo: 0x8000_07FF,
                sync_and_emcy: 0xC000_07FF,
            },
            ..options
        };
        let mut bench = Self {
            node: LocalNode::new(id, &objects, options),
            device: Device {
                objects,
                has_run: false,
            },
            now: Instant::ZERO,
        };
        bench.node.power_on(bench.now);
        let said = bench.pass(Duration::ZERO);
        bench.device.has_run = true;
        (bench, said)
    }

    fn with(options: Options) -> Self {
        Self::booted(options).0
    }

    fn send(&mut self, frame: &str) -> String {
        let mut sent = Vec::new();
        let frame = parse(frame);
        self.node
            .on_frame(self.now, &frame, &mut self.device, &mut sent);
        printed(&sent)
    }

    fn pass(&mut self, time: Duration) -> String {
        let end = self.now + time;
        let mut sent = Vec::new();
        while let Some(due) = self.node.deadline().filter(|due| *due <= end) {
            self.now = self.now.max(due);
            self.node.poll(self.now, &mut self.device, &mut sent);
        }
        self.now = end;
        printed(&sent)
    }

    /// The position changes, and the node has a look.
    fn turn(&mut self, position: i64) -> String {
        self.device.objects.put(0x6004, 0, position);
        let mut sent = Vec::new();
        self.node.poll(self.now, &mut self.device, &mut sent);
        printed(&sent)
    }
}

#[test]
fn three_ways_to_say_that_a_node_has_booted() {
    for (boot_up, said) in [
        (BootUp::Message, "701#00"),
        (BootUp::EmptyEmergency, "081#"),
        (BootUp::Silent, ""),
    ] {
        let options = Options {
            boot_up,
            ..Options::default()
        };
        let (bench, heard) = Bench::booted(options);
        assert_eq!(heard, said);
        assert_eq!(bench.node.state(), State::PreOperational);
    }
}

#[test]
fn a_late_guarding_request_is_found_when_the_time_is_over_or_when_it_comes() {
    for (life_guarding, missed) in [
        (LifeGuarding::AtExpiry, State::PreOperational),
        (LifeGuarding::AtLateRequest, State::Operational),
    ] {
        let mut bench = Bench::with(Options {
            life_guarding,
            ..Options::default()
        });
        bench.send("601#2B0C100064000000");
        bench.send("601#2F0D100002000000");
        bench.send("000#0101");
        assert_eq!(bench.send("701#R"), "701#05");
        bench.pass(199 * MS);
        assert_eq!(bench.send("701#R"), "701#85", "in time");
        bench.pass(300 * MS);
        assert_eq!(bench.node.state(), missed, "{life_guarding:?}");
        let answer = bench.send("701#R");
        assert!(answer.ends_with("701#7F"), "{answer}");
    }
}

#[test]
fn a_loss_of_communication_may_lead_elsewhere() {
    let mut bench = Bench::with(Options::default());
    bench.send("601#2B0C100064000000");
    bench.send("601#2F0D100001000000");
    bench.send("701#R");
    bench.send("000#0201");
    assert_eq!(bench.node.state(), State::Stopped);
    bench.pass(100 * MS);
    assert_eq!(bench.node.state(), State::PreOperational);
}

#[test]
fn the_guarding_identifier_can_be_another() {
    let mut bench = Bench::with(Options::default());
    bench.send("601#230E100045070000");
    assert_eq!(bench.send("701#R"), "");
    assert_eq!(bench.send("745#R"), "745#7F");
}

#[test]
fn identifiers_may_wait_for_store_and_reset() {
    let mut bench = Bench::with(Options {
        identifiers_at_reset: true,
        ..Options::default()
    });
    bench.send("601#230E100045070000");
    bench.send("601#2314100085000000");
    bench.send("601#2305100081000080");
    bench.send("601#2F00180201000000");
    let in_effect = |bench: &mut Bench| {
        bench.send("000#0101");
        bench.turn(7);
        [bench.send("080#"), bench.send("081#")].map(|said| !said.is_empty())
    };
    assert_eq!(bench.send("745#R"), "");
    // Through Stopped as well, where SYNC starts anew.
    bench.send("000#0201");
    assert_eq!(in_effect(&mut bench), [true, false]);
    assert_eq!(bench.send("701#R"), "701#05");
    bench.send("601#2310100173617665");
    assert_eq!(bench.send("701#R"), "701#85");
    bench.send("000#8101");
    assert_eq!(bench.send("701#R"), "");
    assert_eq!(bench.send("745#R"), "745#7F");
    bench.send("601#2F00180201000000");
    assert_eq!(in_effect(&mut bench), [false, true]);
}

#[test]
fn sync_of_a_device_that_takes_none() {
    for (sync_by_bit_31, word, heard) in [
        (false, "80000000", true),
        (true, "80000000", false),
        (true, "80000080", true),
    ] {
        let mut bench = Bench::with(Options {
            sync_by_bit_31,
            ..Options::default()
        });
        bench.send(&format!("601#23051000{word}"));
        bench.send("601#2F00180201000000");
        bench.send("000#0101");
        assert_eq!(bench.send("080#") == "181#00000000", heard, "{word}");
    }
}

#[test]
fn a_cycle_period_in_milliseconds() {
    let mut bench = Bench::with(Options {
        cycle_period_unit: MS,
        sync_by_bit_31: true,
        ..Options::default()
    });
    bench.send("601#230610000A000000");
    assert_eq!(bench.pass(20 * MS), "");
    bench.send("601#2305100080000040");
    assert_eq!(bench.pass(20 * MS), "080# 080#");
}

#[test]
fn one_event_timer_for_all_t_pdos() {
    let mut bench = Bench::with(Options {
        event_timer: Some(0x6200),
        ..Options::default()
    });
    assert_eq!(bench.send("000#0101"), "181#00000000");
    assert_eq!(bench.pass(50 * MS), "");
    assert_eq!(
        bench.send("601#2B0062000A000000"),
        "581#6000620000000000 181#00000000"
    );
    assert_eq!(bench.pass(20 * MS), "181#00000000 181#00000000");
    bench.send("601#2B00620000000000");
    assert_eq!(bench.pass(50 * MS), "");
}

/// Of a T_PDO with a timer of its own, and of one that SYNC sends, nothing begins anew.
#[test]
fn the_common_event_timer_leaves_other_t_pdos_alone() {
    let mut bench = Bench::with(Options {
        event_timer: Some(0x6200),
        ..Options::default()
    });
    bench.send("601#2301180181020000");
    bench.send("601#2302180181030000");
    bench.send("000#0101");
    assert_eq!(bench.send("080#"), "", "at every second SYNC");
    bench.pass(30 * MS);
    let written = bench.send("601#2B00620064000000");
    assert_eq!(written, "581#6000620000000000 181#00000000");
    assert_eq!(bench.send("080#"), "381#00000000");
    assert_eq!(bench.pass(10 * MS), "281#00000000", "40 ms since the first");
}

#[test]
fn a_confirmation_that_repeats_the_data() {
    let mut bench = Bench::with(Options {
        sdo_echo: true,
        ..Options::default()
    });
    assert_eq!(bench.send("601#22051000800000C0"), "581#60051000800000C0");
    assert_eq!(bench.send("601#2B00620010270000"), "581#6000620010270000");
}

#[test]
fn a_read_may_be_refused() {
    let mut bench = Bench::with(Options::default());
    assert_eq!(bench.send("601#4000630000000000"), "581#8000630022000008");
    assert_eq!(bench.send("601#4000640000000000"), "581#4F00640000000000");
}

/// COB-IDs that were stored with the old id follow; one that was moved elsewhere stays there.
#[test]
fn a_node_id_changes_at_the_next_reset_of_the_node() {
    let mut bench = Bench::with(Options::default());
    bench.send("601#2F00200005000000");
    bench.send("601#2314100090000000");
    bench.send("601#2310100173617665");
    bench.send("000#8201");
    assert_eq!(bench.node.id().get(), 1);
    assert_eq!(bench.send("000#8101"), "705#00");
    assert_eq!(bench.node.id().get(), 5);
    assert_eq!(bench.send("601#4000180100000000"), "");
    assert_eq!(bench.send("605#4000180100000000"), "585#4300180185010000");
    assert_eq!(bench.send("605#4014100000000000"), "585#4314100090000000");
    bench.send("000#0105");
    assert_eq!(bench.turn(3), "185#03000000");
    assert_eq!(bench.send("705#R"), "705#05");
}
