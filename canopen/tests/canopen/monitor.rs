//! What a monitor tells of a conversation between a master and a node.

use proptest::prelude::*;
use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table};
use syncline_canopen::monitor::Monitor;
use syncline_canopen::node::{LocalNode, Options};
use syncline_canopen::sdo::Client;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, Frame, Instant, NodeId};

#[rustfmt::skip]
static TABLE: [Entry; 18] = table([
    ro(0x1000, 0, "Device type", U32).default(0x0042_0192),
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x80),
    ro(0x1008, 0, "Device name", Text(8)).default_text("LXM32M"),
    rw(0x1017, 0, "Producer heartbeat time", U16),
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x200),
    rw(0x1400, 2, "Transmission type R_PDO1", U8).default(255),
    rw(0x1600, 0, "R_PDO1 mapping: number", U8).default(1),
    rw(0x1600, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(1),
    rw(0x1A00, 0, "T_PDO1 mapping: number", U8).default(1),
    rw(0x1A00, 1, "1st mapped object", U32).default(0x6041_0010),
    rw(0x1A00, 2, "2nd mapped object", U32),
    rw(0x2000, 0, "Program", Domain(100)),
    rw(0x6040, 0, "DCOMcontrol", U16).r_pdo(),
    ro(0x6041, 0, "_DCOMstatus", U16).t_pdo().default(0x4237),
    rw(0x6060, 0, "DCOMopmode", I8).range(-6, 10).r_pdo(),
    ro(0x6064, 0, "_p_act", I32).t_pdo().default(-2),
]);

/// A bus with a node that the monitor knows.
struct Bus {
    monitor: Monitor,
    node: LocalNode,
    objects: Dictionary,
    client: Client,
}

impl Bus {
    fn new() -> Self {
        let id = NodeId::new(3).expect("1…127");
        let mut monitor = Monitor::new();
        monitor.add(id, &TABLE);
        let objects = Dictionary::new(&TABLE, id);
        let mut node = LocalNode::new(id, &objects, Options::default());
        node.power_on(Instant::ZERO);
        Self {
            monitor,
            node,
            objects,
            client: Client::new(id, Duration::from_millis(100), 100),
        }
    }

    /// Sends frames, carries on what follows, and returns what the monitor tells of it all.
    fn carry(&mut self, frames: Vec<Frame>) -> Vec<String> {
        let mut told = Vec::new();
        let mut frames = frames;
        let now = Instant::ZERO;
        while !frames.is_empty() {
            let mut next = Vec::new();
            for frame in frames {
                told.push(self.monitor.decode(&frame));
                let _ = self.client.on_frame(now, &frame, &mut next);
                self.node
                    .on_frame(now, &frame, &mut self.objects, &mut next);
            }
            frames = next;
        }
        told
    }

    fn read(&mut self, index: u16) -> Vec<String> {
        let mut frames = Vec::new();
        let address = Address::new(index, 0);
        let started = self.client.upload(Instant::ZERO, address, &mut frames);
        started.expect("idle");
        self.carry(frames)
    }

    fn write(&mut self, index: u16, sub: u8, data: &[u8]) -> Vec<String> {
        let mut frames = Vec::new();
        let address = Address::new(index, sub);
        let now = Instant::ZERO;
        let started = self.client.download(now, address, data, &mut frames);
        started.expect("idle");
        self.carry(frames)
    }

    fn send(&mut self, id: u16, data: &[u8]) -> Vec<String> {
        self.carry(vec![Frame::new(CanId::Standard(id), data)])
    }
}

#[test]
fn a_conversation() {
    let mut bus = Bus::new();
    let mut boot_up = Vec::new();
    bus.node.poll(Instant::ZERO, &mut bus.objects, &mut boot_up);
    assert_eq!(bus.carry(boot_up), ["node 3 boot-up"]);
    assert_eq!(
        bus.read(0x1000),
        [
            "node 3 SDO request: read 1000h:0 Device type",
            "node 3 SDO answer: 1000h:0 Device type = 4325778 (00420192h)"
        ]
    );
    assert_eq!(
        bus.read(0x1008),
        [
            "node 3 SDO request: read 1008h:0 Device name",
            "node 3 SDO answer: 1008h:0 Device name, 6 bytes",
            "node 3 SDO request: next segment",
            "node 3 SDO answer: last segment, 1008h:0 Device name = \"LXM32M\""
        ]
    );
    assert_eq!(
        bus.write(0x6060, 0, &[0xFF]),
        [
            "node 3 SDO request: write 6060h:0 DCOMopmode = -1",
            "node 3 SDO answer: written 6060h:0 DCOMopmode"
        ]
    );
    assert_eq!(
        bus.write(0x6060, 0, &[11]),
        [
            "node 3 SDO request: write 6060h:0 DCOMopmode = 11",
            "node 3 SDO answer: abort 6060h:0 DCOMopmode: \
             0609 0030h \"invalid value for parameter\""
        ]
    );
    assert_eq!(bus.send(0x000, &[1, 0]), ["NMT start all nodes"]);
    assert_eq!(
        bus.send(0x203, &[0x0F, 0]),
        ["node 3 R_PDO1: DCOMcontrol 15 (000Fh)"]
    );
    assert_eq!(
        bus.send(0x080, &[]),
        [
            "SYNC",
            "node 3 T_PDO1: _DCOMstatus 4237h (Operation Enabled)"
        ]
    );
    assert_eq!(
        bus.send(0x583, &[0; 4]),
        ["node 3 SDO of 4 bytes"],
        "malformed"
    );
}

#[test]
fn moved_and_remapped_pdos_are_followed() {
    let mut bus = Bus::new();
    bus.node
        .poll(Instant::ZERO, &mut bus.objects, &mut Vec::new());
    bus.write(0x1800, 1, &0x8000_0183u32.to_le_bytes());
    bus.write(0x1A00, 0, &[0]);
    bus.write(0x1A00, 2, &0x6064_0020u32.to_le_bytes());
    bus.write(0x1A00, 0, &[2]);
    bus.write(0x1800, 1, &0x285u32.to_le_bytes());
    // Refused, so nothing changes: the PDO is in use.
    bus.write(0x1800, 1, &0x183u32.to_le_bytes());
    bus.send(0x000, &[1, 3]);
    assert_eq!(
        bus.send(0x080, &[7]),
        [
            "SYNC 7",
            "node 3 T_PDO1: _DCOMstatus 4237h (Operation Enabled), _p_act -2"
        ]
    );
    assert_eq!(
        bus.send(0x000, &[0x82, 3]),
        ["NMT reset communication node 3", "node 3 boot-up"]
    );
    assert_eq!(
        bus.send(0x183, &[0x31, 0x62]),
        ["node 3 T_PDO1: _DCOMstatus 6231h (Ready To Switch On)"]
    );
}

#[test]
fn block_transfers() {
    let mut bus = Bus::new();
    bus.node
        .poll(Instant::ZERO, &mut bus.objects, &mut Vec::new());
    let mut frames = Vec::new();
    let program = Address::new(0x2000, 0);
    let now = Instant::ZERO;
    let started = bus
        .client
        .download_block(now, program, b"0123456789", &mut frames);
    started.expect("idle");
    assert_eq!(
        bus.carry(frames),
        [
            "node 3 SDO request: write 2000h:0 Program, 10 bytes in blocks",
            "node 3 SDO answer: written 2000h:0 Program in blocks of 127",
            "node 3 SDO request: block segment 1",
            "node 3 SDO request: block segment 2, the last",
            "node 3 SDO answer: 2 segments taken",
            "node 3 SDO request: end of blocks",
            "node 3 SDO answer: blocks taken"
        ]
    );
    let mut frames = Vec::new();
    let started = bus.client.upload_block(now, program, 1, &mut frames);
    started.expect("idle");
    assert_eq!(
        bus.carry(frames),
        [
            "node 3 SDO request: read 2000h:0 Program in blocks of 1",
            "node 3 SDO answer: 2000h:0 Program, 10 bytes in blocks",
            "node 3 SDO request: start",
            "node 3 SDO answer: block segment 1",
            "node 3 SDO request: 1 segments taken",
            "node 3 SDO answer: block segment 1, the last",
            "node 3 SDO request: 1 segments taken",
            "node 3 SDO answer: end of blocks",
            "node 3 SDO request: blocks taken"
        ]
    );
}

/// What a master writes is kept however it is transferred, once the node has confirmed it.
#[test]
fn pdos_are_followed_in_each_kind_of_transfer() {
    let word = 0x185u32.to_le_bytes();
    let [a, b, c, d] = word;
    let begin = |command, size| [command, 0x00, 0x18, 1, size, 0, 0, 0];
    let confirmed = [0x60, 0x00, 0x18, 1, 0, 0, 0, 0];
    let mut without_size = begin(0x22, 0);
    without_size[4..].copy_from_slice(&word);
    let expedited = vec![(0x603, without_size), (0x583, confirmed)];
    let segmented = |begin| {
        vec![
            (0x603, begin),
            (0x583, confirmed),
            (0x603, [0x07, a, b, c, d, 0, 0, 0]),
            (0x583, [0x20, 0, 0, 0, 0, 0, 0, 0]),
        ]
    };
    let refused = vec![
        (0x603, begin(0x21, 4)),
        (0x583, confirmed),
        (0x603, [0x07, a, b, c, d, 0, 0, 0]),
        (0x583, [0x80, 0x00, 0x18, 1, 0x30, 0, 0x09, 0x06]),
    ];
    let read = vec![
        (0x603, begin(0x40, 0)),
        (0x583, begin(0x41, 4)),
        (0x603, [0x60, 0, 0, 0, 0, 0, 0, 0]),
        (0x583, [0x07, a, b, c, d, 0, 0, 0]),
    ];
    for (place, (messages, kept)) in [
        (expedited, true),
        (segmented(begin(0x21, 4)), true),
        (segmented(begin(0x20, 0)), true),
        (refused, false),
        (read, true),
    ]
    .into_iter()
    .enumerate()
    {
        let mut monitor = Monitor::new();
        monitor.add(NodeId::new(3).expect("1…127"), &TABLE);
        let mut told =
            |id: u16, data: &[u8]| monitor.decode(&Frame::new(CanId::Standard(id), data));
        for (id, message) in messages {
            told(id, &message);
        }
        let pdo = told(0x185, &[0x37, 0x42]);
        let known = pdo == "node 3 T_PDO1: _DCOMstatus 4237h (Operation Enabled)";
        assert_eq!(known, kept, "{place}: {pdo}");
    }
}

/// Expedited without a size the object's own counts, and segmented none is told.
#[test]
fn transfers_without_a_size() {
    let mut bus = Bus::new();
    assert_eq!(
        bus.send(0x603, &[0x22, 0x17, 0x10, 0, 0x32, 0, 0xAA, 0xAA]),
        ["node 3 SDO request: write 1017h:0 Producer heartbeat time = 50 (0032h)"]
    );
    assert_eq!(
        bus.send(0x583, &[0x42, 0x60, 0x60, 0, 0xFF, 0, 0, 0]),
        ["node 3 SDO answer: 6060h:0 DCOMopmode = -1"]
    );
    assert_eq!(
        bus.send(0x585, &[0x42, 0x60, 0x60, 0, 0xFF, 0, 0, 0]),
        ["node 5 SDO answer: 6060h:0 = FF 00 00 00"]
    );
    let answers = [
        [0x40, 0x08, 0x10, 0, 0, 0, 0, 0],
        [0x0B, b'a', b'b', 0, 0, 0, 0, 0],
    ];
    let told = answers.map(|message| bus.send(0x583, &message).concat());
    assert_eq!(
        told,
        [
            "node 3 SDO answer: 1008h:0 Device name, some bytes",
            "node 3 SDO answer: last segment, 1008h:0 Device name = 61 62"
        ]
    );
}

/// An EMCY without data is how DS 301 V3 boots; the node knows nothing more of what it was told.
#[test]
fn an_older_boot_up() {
    let mut bus = Bus::new();
    bus.send(0x603, &[0x23, 0x00, 0x18, 1, 0x85, 1, 0, 0]);
    bus.send(0x583, &[0x60, 0x00, 0x18, 1, 0, 0, 0, 0]);
    let pdo = "node 3 T_PDO1: _DCOMstatus 4237h (Operation Enabled)";
    assert_eq!(bus.send(0x185, &[0x37, 0x42]), [pdo]);
    assert_eq!(bus.send(0x083, &[]), ["node 3 boot-up"]);
    assert_eq!(bus.send(0x183, &[0x37, 0x42]), [pdo]);
    assert_eq!(bus.send(0x083, &[1, 2]), ["unknown"]);
}

/// SYNC may stand on the identifier of an EMCY; it has no data either.
#[test]
fn a_moved_sync_is_no_boot_up() {
    let mut bus = Bus::new();
    bus.send(0x603, &[0x23, 0x05, 0x10, 0, 0x81, 0, 0, 0]);
    bus.send(0x583, &[0x60, 0x05, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(bus.send(0x081, &[]), ["SYNC"]);
    assert_eq!(bus.send(0x081, &[3]), ["SYNC 3"]);
    assert_eq!(bus.send(0x082, &[]), ["node 2 boot-up"]);
}

#[test]
fn strangers() {
    let mut monitor = Monitor::new();
    let mut told = |id: u16, data: &[u8]| monitor.decode(&Frame::new(CanId::Standard(id), data));
    assert_eq!(told(0x285, &[1, 2]), "node 5 T_PDO2: 01 02");
    assert_eq!(told(0x505, &[]), "node 5 R_PDO4: ");
    assert_eq!(
        told(0x605, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]),
        "node 5 SDO request: read 6041h:0"
    );
    assert_eq!(
        told(0x585, &[0x4B, 0x41, 0x60, 0, 0x37, 0x42, 0, 0]),
        "node 5 SDO answer: 6041h:0 = 37 42"
    );
    assert_eq!(told(0x705, &[0x7F]), "node 5 heartbeat: Pre-Operational");
    assert_eq!(told(0x705, &[0x85]), "node 5 guarding: Operational");
    assert_eq!(
        told(0x085, &[0x30, 0x81, 0x11, 0, 0, 0, 8, 0xB4]),
        "node 5 EMCY 8130h, register 11h, 00 00 00 08 B4"
    );
    assert_eq!(told(0x100, &[0; 6]), "TIME");
    assert_eq!(told(0x7FF, &[]), "unknown");
    let request = Frame::remote(CanId::Standard(0x705), 1).expect("dlc");
    assert_eq!(monitor.decode(&request), "node 5 guarding request");
    let extended = Frame::new(CanId::Extended(0x1234), &[]);
    assert_eq!(monitor.decode(&extended), "unknown");
}

proptest! {
    /// Whatever is on the bus, the monitor has something to say.
    #[test]
    fn anything_is_told(
        frames in proptest::collection::vec((0u16..0x800, proptest::collection::vec(any::<u8>(), 0..=8)), 0..60),
    ) {
        let mut bus = Bus::new();
        for (id, data) in frames {
            // Mostly the node's own SDO and PDOs.
            let id = if id & 1 == 0 { id & 0x780 | 3 } else { id };
            let frame = Frame::new(CanId::Standard(id), &data);
            prop_assert!(!bus.monitor.decode(&frame).is_empty());
        }
    }
}

/// What is wrong on a bus is told by its name.
#[test]
fn mistakes_have_names() {
    let mut bus = Bus::new();
    assert_eq!(
        bus.send(0x703, &[0x03]),
        ["node 3 heartbeat: unknown NMT state 03h"]
    );
    assert_eq!(bus.send(0x000, &[7, 3]), ["unknown NMT command: 07 03"]);
    let answers = |bus: &mut Bus, messages: [[u8; 8]; 3]| {
        let told = messages.map(|message| bus.send(0x583, &message).concat());
        told.map(|line| line.replace("node 3 SDO answer: ", ""))
    };
    let begin = [0x41, 0x08, 0x10, 0, 9, 0, 0, 0];
    let first = [0x00, b'a', b'b', b'c', b'd', b'e', b'f', b'g'];
    assert_eq!(
        answers(&mut bus, [begin, first, first]),
        [
            "1008h:0 Device name, 9 bytes",
            "segment 61 62 63 64 65 66 67",
            "wrong toggle bit, segment 61 62 63 64 65 66 67"
        ]
    );
    // One byte only in the last segment, where two are left.
    let last = [0x1D, b'h', 0, 0, 0, 0, 0, 0];
    assert_eq!(
        answers(&mut bus, [begin, first, last])[2],
        "last segment, 8 bytes instead of 9, 1008h:0 Device name = \"abcdefgh\""
    );
}
