//! After construction neither node nor client touches the heap, whatever the traffic.

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, rw, table};
use syncline_canopen::emcy::Emergency;
use syncline_canopen::nmt::{Command, Request, State};
use syncline_canopen::node::{Application, LocalNode, Options};
use syncline_canopen::sdo::Client;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, CobId, Frame, Instant, NodeId, Transmit};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

const PROGRAM: Address = Address::new(0x2000, 0);
const CAPACITY: usize = 1000;

#[rustfmt::skip]
static TABLE: [Entry; 21] = table([
    rw(0x1001, 0, "Error register", U8),
    rw(0x1003, 0, "Number of errors", U8),
    rw(0x1003, 1, "Newest error", U32),
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x80),
    rw(0x1010, 1, "Store all parameters", U32),
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80),
    rw(0x1016, 1, "Consumer heartbeat time", U32).default(0x007F_0064),
    rw(0x1017, 0, "Producer heartbeat time", U16).default(10),
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x200),
    rw(0x1400, 2, "Transmission type R_PDO1", U8).default(1),
    rw(0x1600, 0, "R_PDO1 mapping: number", U8).default(1),
    rw(0x1600, 1, "1st mapped object", U32).default(0x6040_0010),
    rw(0x1600, 2, "2nd mapped object", U32),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(255),
    rw(0x1800, 5, "Event timer T_PDO1", U16).default(7),
    rw(0x1A00, 0, "T_PDO1 mapping: number", U8).default(1),
    rw(0x1A00, 1, "1st mapped object", U32).default(0x6041_0010),
    rw(0x2000, 0, "Program", Domain(CAPACITY as u16)).persistent(),
    rw(0x6040, 0, "Controlword", U16).r_pdo(),
    rw(0x6041, 0, "Statusword", U16).t_pdo(),
]);

/// A device that has an emergency to tell now and then.
struct Device {
    objects: Dictionary,
    emergency: Option<Emergency>,
}

impl Application for Device {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.emergency.take()
    }
}

/// Frames on their way, of which there is room for a block and a few more.
struct Wire {
    frames: [Option<Frame>; 160],
    count: usize,
}

impl Wire {
    const fn new() -> Self {
        Self {
            frames: [None; 160],
            count: 0,
        }
    }
}

impl Transmit for Wire {
    fn transmit(&mut self, frame: Frame) {
        self.frames[self.count] = Some(frame);
        self.count += 1;
    }
}

#[test]
fn nothing_is_allocated() {
    let id = NodeId::new(1).expect("1…127");
    let mut device = Device {
        objects: Dictionary::new(&TABLE, id),
        emergency: None,
    };
    let mut node = LocalNode::new(id, &device.objects, Options::default());
    let mut client = Client::new(id, Duration::from_millis(100), CAPACITY);
    let (mut to_node, mut to_master) = (Wire::new(), Wire::new());
    let program = [0x5A; CAPACITY];
    let controlword = CanId::Standard(0x201);
    let mut bytes_read = 0;
    assert_no_alloc(|| {
        node.power_on(Instant::ZERO);
        for ms in 0..2000 {
            let now = Instant::from_nanos(ms * 1_000_000);
            node.poll(now, &mut device, &mut to_master);
            match ms % 500 {
                5 => to_node.transmit(
                    Request {
                        command: Command::Start,
                        node: None,
                    }
                    .encode(),
                ),
                10 => client
                    .download(now, PROGRAM, &program, &mut to_node)
                    .unwrap(),
                110 => client.upload(now, PROGRAM, &mut to_node).unwrap(),
                210 => client
                    .download_block(now, PROGRAM, &program, &mut to_node)
                    .unwrap(),
                220 => client
                    .upload_block(now, PROGRAM, 100, &mut to_node)
                    .unwrap(),
                230 => {
                    let store = Address::new(0x1010, 1);
                    client.download(now, store, b"save", &mut to_node).unwrap();
                }
                240 => device.emergency = Some(Emergency::default()),
                499 => to_node.transmit(
                    Request {
                        command: Command::ResetNode,
                        node: Some(id),
                    }
                    .encode(),
                ),
                _ => {}
            }
            to_node.transmit(Frame::new(controlword, &[ms as u8, 0]));
            to_node.transmit(Frame::new(CobId::SYNC, &[]));
            // To and fro until both are silent.
            for _ in 0..20 {
                let requests = core::mem::replace(&mut to_node, Wire::new());
                for frame in requests.frames.iter().flatten() {
                    node.on_frame(now, frame, &mut device, &mut to_master);
                }
                let answers = core::mem::replace(&mut to_master, Wire::new());
                for frame in answers.frames.iter().flatten() {
                    if let Some(Ok(read)) = client.on_frame(now, frame, &mut to_node) {
                        bytes_read += read.len();
                    }
                }
            }
        }
    });
    assert_eq!(node.state(), State::PreOperational);
    assert_eq!(bytes_read, 2 * 4 * CAPACITY);
    let row = device.objects.row(0x2000, 0).expect("in the table");
    assert_eq!(device.objects.bytes(row), program, "stored and restored");
}
