//! A node with every service, for the fuzz targets to torment.

use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table, wo};
use syncline_canopen::node::{LocalNode, Options, ParameterRules};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame, Instant, NodeId};

#[rustfmt::skip]
static ROWS: [Entry; 55] = table([
    ro(0x1000, 0, "Device type", U32),
    ro(0x1001, 0, "Error register", U8),
    rw(0x1003, 0, "Number of errors", U8),
    ro(0x1003, 1, "Newest error", U32),
    ro(0x1003, 2, "Second error", U32),
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x80),
    rw(0x1006, 0, "Communication cycle period", U32),
    ro(0x1008, 0, "Device name", Text(16)).default_text("a node"),
    rw(0x100C, 0, "Guard time", U16),
    rw(0x100D, 0, "Life time factor", U8),
    rw(0x1010, 1, "Store all parameters", U32).default(1),
    rw(0x1011, 1, "Restore all parameters", U32).default(1),
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80),
    rw(0x1015, 0, "Inhibit time EMCY", U16),
    rw(0x1016, 1, "Consumer heartbeat time 1", U32),
    rw(0x1016, 2, "Consumer heartbeat time 2", U32),
    rw(0x1017, 0, "Producer heartbeat time", U16),
    rw(0x1019, 0, "SYNC counter overflow", U8),
    rw(0x1029, 1, "Communication error", U8).range(0, 2),
    rw(0x1201, 1, "COB-ID client to server", U32).default(0x8000_0000),
    rw(0x1201, 2, "COB-ID server to client", U32).default(0x8000_0000),
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x200),
    rw(0x1400, 2, "Transmission type R_PDO1", U8).default(255),
    rw(0x1401, 1, "COB-ID R_PDO2", U32).default_plus_node(0x300),
    rw(0x1401, 2, "Transmission type R_PDO2", U8).default(1),
    rw(0x1600, 0, "R_PDO1 mapping: number", U8).default(1),
    rw(0x1600, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1600, 2, "2nd mapped object", U32),
    rw(0x1600, 3, "3rd mapped object", U32),
    rw(0x1601, 0, "R_PDO2 mapping: number", U8).default(2),
    rw(0x1601, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1601, 2, "2nd mapped object", U32).default(0x6200_0008),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(255),
    rw(0x1800, 3, "Inhibit time T_PDO1", U16),
    rw(0x1800, 5, "Event timer T_PDO1", U16),
    rw(0x1800, 6, "SYNC start value T_PDO1", U8),
    rw(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0x280),
    rw(0x1801, 2, "Transmission type T_PDO2", U8).default(1),
    rw(0x1A00, 0, "T_PDO1 mapping: number", U8).default(1),
    rw(0x1A00, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1A00, 2, "2nd mapped object", U32),
    rw(0x1A00, 3, "3rd mapped object", U32),
    rw(0x1A01, 0, "T_PDO2 mapping: number", U8).default(2),
    rw(0x1A01, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1A01, 2, "2nd mapped object", U32).default(0x6201_0040),
    rw(0x2000, 0, "Program", Domain(300)),
    wo(0x2001, 0, "Command", U8),
    rw(0x2002, 0, "Gain", U16).persistent(),
    rw(0x2003, 0, "Note", Text(20)).persistent(),
    rw(0x6040, 0, "Word", U16).r_pdo().t_pdo(),
    rw(0x6200, 0, "Small", I8).range(-6, 10).r_pdo(),
    rw(0x6201, 0, "Large", I64).r_pdo().t_pdo(),
    rw(0x6202, 0, "Largest", U64).r_pdo().t_pdo(),
    rw(0x6203, 0, "Flag", Bool).r_pdo().t_pdo(),
]);

/// What the victim's dictionary holds.
pub static TABLE: &[Entry] = &ROWS;

/// A node with the id 1 that has booted, and its values.
pub struct Victim {
    /// The node.
    pub node: LocalNode,
    /// Its values.
    pub objects: Dictionary,
    /// The present.
    pub now: Instant,
    /// What the node has sent since it was last emptied.
    pub sent: Vec<Frame>,
}

impl Victim {
    /// The node, with strict parameters or with lenient ones.
    pub fn new(lenient: bool) -> Self {
        let id = NodeId::new(1).expect("1…127");
        let mut objects = Dictionary::new(TABLE, id);
        let parameters = if lenient {
            ParameterRules::Lenient {
                pdo: 0x8000_07FF,
                sync_and_emcy: 0x0780,
            }
        } else {
            ParameterRules::Standard
        };
        let options = Options {
            parameters,
            ..Options::default()
        };
        let mut node = LocalNode::new(id, &objects, options);
        let mut sent = Vec::new();
        node.power_on(Instant::ZERO);
        node.poll(Instant::ZERO, &mut objects, &mut sent);
        Self {
            node,
            objects,
            now: Instant::ZERO,
            sent,
        }
    }

    /// A frame from the bus.
    pub fn receive(&mut self, frame: &Frame) {
        let Self {
            node,
            objects,
            now,
            sent,
        } = self;
        node.on_frame(*now, frame, objects, sent);
        self.check();
    }

    /// Lets time pass; polls at most so many deadlines on the way.
    pub fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        for _ in 0..50 {
            let Some(due) = self.node.deadline().filter(|&due| due <= end) else {
                break;
            };
            self.now = self.now.max(due);
            let Self {
                node,
                objects,
                now,
                sent,
            } = self;
            node.poll(*now, objects, sent);
            let next = node.deadline();
            assert!(
                next.is_none_or(|next| next > *now),
                "a deadline that stays due"
            );
            self.check();
        }
        self.now = end;
        let Self {
            node,
            objects,
            now,
            sent,
        } = self;
        node.poll(*now, objects, sent);
        self.check();
    }

    /// What holds at all times.
    fn check(&mut self) {
        // Lenient rules let a PDO be sent with the identifier of the SDO server, too.
        let mut pdos = (0x1800..=0x1801u16).filter_map(|row| self.objects.value(row, 1));
        let shared = pdos.any(|word| word & 0x7FF == 0x581);
        for frame in self.sent.drain(..) {
            if frame.id() == CanId::Standard(0x581) && !shared {
                assert_eq!(frame.dlc(), 8, "an SDO has 8 bytes");
            }
        }
        for row in 0x1600..=0x1601u16 {
            let count = self.objects.value(row, 0).unwrap_or(0);
            let bits = |sub| self.objects.value(row, sub).unwrap_or(0) & 0xFF;
            let total: i64 = (1..=count as u8).map(bits).sum();
            assert!(total <= 64, "a PDO has 64 bits at most");
        }
    }
}
