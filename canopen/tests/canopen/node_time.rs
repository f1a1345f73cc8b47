//! A node as time passes, whatever a master writes and whenever it writes it.

use proptest::prelude::*;
use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table};
use syncline_canopen::emcy::Emergency;
use syncline_canopen::nmt::State;
use syncline_canopen::node::{
    Application, CommunicationError, LifeGuarding, LocalNode, Options, ParameterRules,
};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame, Instant, NodeId};

const MS: Duration = Duration::from_millis(1);

#[rustfmt::skip]
static TABLE: [Entry; 32] = table([
    ro(0x1001, 0, "Error register", U8),
    rw(0x1005, 0, "COB-ID SYNC", U32).default(0x80),
    rw(0x1006, 0, "Communication cycle period", U32).unit("us"),
    rw(0x100C, 0, "Guard time", U16).unit("ms"),
    rw(0x100D, 0, "Life time factor", U8),
    rw(0x100E, 0, "COB-ID guarding", U32).default_plus_node(0x700),
    rw(0x1014, 0, "COB-ID EMCY", U32).default_plus_node(0x80),
    rw(0x1015, 0, "Inhibit time EMCY", U16).unit("100 us"),
    ro(0x1016, 0, "Consumer heartbeat: number", U8).default(2),
    rw(0x1016, 1, "Consumer heartbeat time 1", U32),
    rw(0x1016, 2, "Consumer heartbeat time 2", U32),
    rw(0x1017, 0, "Producer heartbeat time", U16).unit("ms"),
    rw(0x1029, 1, "Communication error", U8).range(0, 2),
    rw(0x1201, 1, "COB-ID client to server", U32).default(0x6A1),
    rw(0x1201, 2, "COB-ID server to client", U32).default(0x6A2),
    rw(0x1202, 1, "COB-ID client to server", U32).default(0x6A3),
    rw(0x1202, 2, "COB-ID server to client", U32).default(0x6A4),
    rw(0x1400, 1, "COB-ID R_PDO1", U32).default_plus_node(0x200),
    rw(0x1400, 2, "Transmission type R_PDO1", U8).default(255),
    rw(0x1800, 1, "COB-ID T_PDO1", U32).default_plus_node(0x180),
    rw(0x1800, 2, "Transmission type T_PDO1", U8).default(255),
    rw(0x1800, 3, "Inhibit time T_PDO1", U16).unit("100 us"),
    rw(0x1800, 5, "Event timer T_PDO1", U16).unit("ms"),
    rw(0x1801, 1, "COB-ID T_PDO2", U32).default_plus_node(0x280),
    rw(0x1801, 2, "Transmission type T_PDO2", U8).default(254),
    rw(0x1801, 3, "Inhibit time T_PDO2", U16).unit("100 us"),
    ro(0x1A00, 0, "T_PDO1 mapping: number", U8).default(1),
    ro(0x1A00, 1, "1st mapped object", U32).default(0x6064_0020),
    ro(0x1A01, 0, "T_PDO2 mapping: number", U8).default(1),
    ro(0x1A01, 1, "1st mapped object", U32).default(0x6064_0020),
    rw(0x2000, 0, "Program", Domain(100)),
    rw(0x6064, 0, "Position", I32).t_pdo(),
]);

/// A device that remembers which losses of communication it was told.
struct Device {
    objects: Dictionary,
    emergencies: Vec<Emergency>,
    lost: Vec<CommunicationError>,
}

impl Application for Device {
    fn objects(&self) -> &Dictionary {
        &self.objects
    }

    fn objects_mut(&mut self) -> &mut Dictionary {
        &mut self.objects
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.emergencies.pop()
    }

    fn on_communication_error(
        &mut self,
        _: Instant,
        error: CommunicationError,
    ) -> Option<Emergency> {
        self.lost.push(error);
        Some(Emergency::default())
    }
}

/// The node, its device and the present instant.
struct Bench {
    node: LocalNode,
    device: Device,
    now: Instant,
}

impl Bench {
    fn new(options: Options) -> Self {
        let id = NodeId::new(1).expect("1…127");
        let objects = Dictionary::new(&TABLE, id);
        let mut bench = Self {
            node: LocalNode::new(id, &objects, options),
            device: Device {
                objects,
                emergencies: Vec::new(),
                lost: Vec::new(),
            },
            now: Instant::ZERO,
        };
        bench.node.power_on(bench.now);
        bench.pass(Duration::ZERO);
        bench
    }

    fn receive(&mut self, frame: &Frame) -> Vec<Frame> {
        let mut sent = Vec::new();
        self.node
            .on_frame(self.now, frame, &mut self.device, &mut sent);
        sent
    }

    fn send(&mut self, id: u16, data: &[u8]) -> Vec<Frame> {
        self.receive(&Frame::new(CanId::Standard(id), data))
    }

    /// Asks as a guarding master does.
    fn guard(&mut self) {
        let request = Frame::remote(CanId::Standard(0x701), 1).expect("a remote request");
        self.receive(&request);
    }

    /// Writes an object by the server that listens on `to`; the abort code, or 0.
    fn write_by(&mut self, to: u16, index: u16, sub: u8, value: u32) -> u32 {
        let row = self.device.objects.row(index, sub).expect("in the table");
        let size = self.device.objects.entry(row).data_type.size() as u8;
        let [low, high] = index.to_le_bytes();
        let mut request = [0x23 | (4 - size) << 2, low, high, sub, 0, 0, 0, 0];
        request[4..].copy_from_slice(&value.to_le_bytes());
        let sent = self.send(to, &request);
        match sent.first().map(Frame::data) {
            Some(&[0x80, _, _, _, ref code @ ..]) => {
                u32::from_le_bytes(code.try_into().expect("8 bytes"))
            }
            _ => 0,
        }
    }

    fn write(&mut self, index: u16, sub: u8, value: u32) -> u32 {
        self.write_by(0x601, index, sub, value)
    }

    /// Lets time pass as a bus does: whoever has been polled must want to be called later.
    #[track_caller]
    fn pass(&mut self, time: Duration) -> Vec<Frame> {
        let end = self.now + time;
        let mut sent = Vec::new();
        while let Some(due) = self.node.deadline().filter(|&due| due <= end) {
            self.now = self.now.max(due);
            self.node.poll(self.now, &mut self.device, &mut sent);
            let next = self.node.deadline();
            assert!(next.is_none_or(|next| next > self.now), "{next:?} is over");
        }
        self.now = end;
        sent
    }
}

fn printed(frames: &[Frame]) -> String {
    let frames: Vec<String> = frames.iter().map(|frame| format!("{frame:?}")).collect();
    frames.join(" ")
}

/// What happens to a node.
#[derive(Clone, Debug)]
enum Step {
    Write(u16, u8, u32),
    Frame(u16, Vec<u8>),
    Guard,
    Emergency,
    Turn,
    Pass(u64),
}

fn step() -> impl Strategy<Value = Step> {
    use prop::sample::select;
    let write = |index, sub, values: &'static [u32]| {
        select(values).prop_map(move |value| Step::Write(index, sub, value))
    };
    let supervision = prop_oneof![
        write(0x1014, 0, &[0x81, 0x8000_0081]),
        write(0x1015, 0, &[0, 1, 30, 200]),
        write(0x1016, 1, &[0, 0x02_0005, 0x02_0014, 0x03_0005]),
        write(0x1016, 2, &[0, 0x02_0005, 0x03_0005, 0x04_0001]),
        write(0x1017, 0, &[0, 1, 7, 20]),
        write(0x100C, 0, &[0, 1, 5]),
        write(0x100D, 0, &[0, 1, 3]),
        write(0x1029, 1, &[0, 1, 2]),
    ];
    let others = prop_oneof![
        write(0x1005, 0, &[0x80, 0x4000_0080, 0x8000_0080]),
        write(0x1006, 0, &[0, 1000, 5000]),
        write(0x1201, 1, &[0x6A1, 0x8000_06A1]),
        write(0x1800, 1, &[0x181, 0x8000_0181]),
        write(0x1800, 2, &[0, 1, 252, 253, 254, 255]),
        write(0x1800, 3, &[0, 20, 100]),
        write(0x1800, 5, &[0, 1, 6]),
        write(0x6064, 0, &[1, 2, 3]),
    ];
    let frame = prop_oneof![
        select(&[1u8, 2, 0x80][..]).prop_map(|command| Step::Frame(0, vec![command, 1])),
        (2u16..5).prop_map(|node| Step::Frame(0x700 + node, vec![5])),
        // A segmented download that nobody ends, by either server.
        select(&[0x601u16, 0x6A1][..])
            .prop_map(|id| Step::Frame(id, vec![0x21, 0, 0x20, 0, 20, 0, 0, 0])),
        Just(Step::Frame(0x80, vec![])),
    ];
    prop_oneof![
        4 => supervision,
        2 => others,
        3 => frame,
        1 => Just(Step::Guard),
        2 => Just(Step::Emergency),
        1 => Just(Step::Turn),
        4 => (0u64..30).prop_map(Step::Pass),
    ]
}

proptest! {
    /// A polled node's next deadline lies in the future; a Stopped node says nothing but its state;
    /// and one that sends heartbeats is not guarded.
    #[test]
    fn no_deadline_stays_due(
        steps in prop::collection::vec(step(), 1..80),
        late in any::<bool>(),
        lenient in any::<bool>(),
    ) {
        let mut bench = Bench::new(Options {
            life_guarding: if late { LifeGuarding::AtLateRequest } else { LifeGuarding::AtExpiry },
            parameters: if lenient {
                ParameterRules::Lenient { pdo: 0x8000_07FF, sync_and_emcy: 0xC000_07FF }
            } else {
                ParameterRules::Standard
            },
            sdo_timeout: Some(11 * MS),
            ..Options::default()
        });
        for step in steps {
            let stopped = bench.node.state() == State::Stopped;
            let sent = match step {
                Step::Write(index, sub, value) => {
                    bench.write(index, sub, value);
                    Vec::new()
                }
                Step::Frame(id, data) => bench.send(id, &data),
                Step::Guard => { bench.guard(); Vec::new() }
                Step::Emergency => {
                    bench.device.emergencies.push(Emergency::default());
                    Vec::new()
                }
                Step::Turn => {
                    let row = bench.device.objects.row(0x6064, 0).expect("in the table");
                    let position = bench.device.objects.get(row);
                    bench.device.objects.set(row, position + 1);
                    bench.pass(Duration::ZERO)
                }
                Step::Pass(ms) => bench.pass(ms as u32 * MS),
            };
            if stopped && bench.node.state() == State::Stopped {
                let states = sent.iter().all(|frame| frame.id() == CanId::Standard(0x701));
                prop_assert!(states, "Stopped and sent {}", printed(&sent));
            }
            let guarded = bench.device.lost.drain(..).any(|it| it == CommunicationError::LifeGuarding);
            let heartbeat = bench.device.objects.value(0x1017, 0) != Some(0);
            prop_assert!(!(guarded && heartbeat), "guarded beside its heartbeat");
        }
    }
}

/// 1014h is switched off while an emergency waits for the inhibit time.
#[test]
fn an_emergency_that_waits_goes_with_its_identifier() {
    let mut bench = Bench::new(Options::default());
    bench.write(0x1015, 0, 100);
    for _ in 0..2 {
        bench.device.emergencies.push(Emergency::default());
        bench.send(0x080, &[]);
    }
    assert_eq!(bench.write(0x1014, 0, 0x8000_0081), 0);
    assert_eq!(printed(&bench.pass(20 * MS)), "");
    assert_eq!(bench.write(0x1014, 0, 0x81), 0);
    assert_eq!(printed(&bench.pass(20 * MS)), "", "it is forgotten");
}

/// Heartbeat and guarding exclude each other (CiA 301; lxm32m 1079).
#[test]
fn a_heartbeat_ends_life_guarding() {
    for life_guarding in [LifeGuarding::AtExpiry, LifeGuarding::AtLateRequest] {
        let mut bench = Bench::new(Options {
            life_guarding,
            ..Options::default()
        });
        bench.write(0x100C, 0, 10);
        bench.write(0x100D, 0, 2);
        bench.guard();
        bench.write(0x1017, 0, 50);
        bench.pass(30 * MS);
        bench.write(0x1017, 0, 0);
        bench.guard();
        assert_eq!(bench.device.lost, [], "{life_guarding:?}");
        bench.pass(30 * MS);
        bench.guard();
        let lost = [CommunicationError::LifeGuarding];
        assert_eq!(bench.device.lost, lost, "it begins with the next request");
    }
}

/// A write to 1016h begins what it changes and leaves the rest as it is.
#[test]
fn a_node_that_is_watched_already_stays_watched() {
    let mut bench = Bench::new(Options::default());
    let [second, third] = [2, 3].map(|id| NodeId::new(id).expect("1…127"));
    bench.write(0x1016, 1, 0x02_0064);
    bench.send(0x702, &[5]);
    bench.pass(50 * MS);
    assert_eq!(bench.write(0x1016, 2, 0x03_0014), 0);
    bench.send(0x703, &[5]);
    bench.pass(40 * MS);
    assert_eq!(bench.device.lost, [CommunicationError::Heartbeat(third)]);
    bench.pass(20 * MS);
    assert_eq!(
        bench.device.lost[1..],
        [CommunicationError::Heartbeat(second)]
    );
    // Another time is another watch, which begins with the next heartbeat; and so is a reset.
    bench.send(0x702, &[5]);
    bench.write(0x1016, 1, 0x02_0032);
    bench.pass(200 * MS);
    assert_eq!(bench.device.lost.len(), 2);
    bench.send(0x702, &[5]);
    bench.send(0x000, &[0x82, 1]);
    bench.write(0x1016, 1, 0x02_0032);
    bench.pass(200 * MS);
    assert_eq!(bench.device.lost.len(), 2);
}

/// 1029h leads to Stopped, as an NMT command does, in the middle of an SDO transfer.
#[test]
fn a_node_that_stops_itself_forgets_its_sdo_transfers() {
    let mut bench = Bench::new(Options {
        sdo_timeout: Some(50 * MS),
        ..Options::default()
    });
    bench.write(0x1029, 1, 2);
    bench.write(0x1016, 1, 0x02_0014);
    bench.send(0x702, &[5]);
    bench.send(0x601, &[0x21, 0, 0x20, 0, 20, 0, 0, 0]);
    bench.pass(30 * MS);
    assert_eq!(bench.node.state(), State::Stopped);
    assert_eq!(printed(&bench.pass(100 * MS)), "");
    bench.send(0x000, &[0x80, 1]);
    let segment = bench.send(0x601, &[0; 8]);
    assert_eq!(printed(&segment), "581#8000000001000405", "no transfer");
}

/// 1201h:1 is written in the middle of a transfer of the server 1202h.
#[test]
fn a_server_that_moves_leaves_the_others_alone() {
    let mut bench = Bench::new(Options::default());
    let begun = bench.send(0x6A3, &[0x21, 0, 0x20, 0, 7, 0, 0, 0]);
    assert_eq!(printed(&begun), "6A4#6000200000000000");
    bench.send(0x6A1, &[0x21, 0, 0x20, 0, 7, 0, 0, 0]);
    assert_eq!(bench.write(0x1201, 1, 0x8000_06A1), 0);
    assert_eq!(bench.write(0x1201, 1, 0x6A5), 0);
    let last = [0x01, 1, 2, 3, 4, 5, 6, 7];
    let ended = bench.send(0x6A3, &last);
    assert_eq!(printed(&ended), "6A4#2000000000000000");
    let moved = bench.send(0x6A5, &last);
    assert_eq!(printed(&moved), "6A2#8000000001000405", "it begins anew");
}

/// CiA 301 has 252 and 253 for T_PDOs only. The LXM32M takes 252 as tied to SYNC (lxm32m 3552), the
/// TLC5xx as well (7720): the lenient.
#[test]
fn types_that_wait_for_a_request_are_for_t_pdos() {
    for (parameters, refused) in [
        (ParameterRules::Standard, 0x0609_0030),
        (
            ParameterRules::Lenient {
                pdo: 0x8000_07FF,
                sync_and_emcy: 0x0780,
            },
            0,
        ),
    ] {
        let mut bench = Bench::new(Options {
            parameters,
            ..Options::default()
        });
        for kind in [252, 253] {
            assert_eq!(bench.write(0x1400, 2, kind), refused, "{kind}");
            assert_eq!(bench.write(0x1800, 2, kind), 0, "{kind}");
        }
        for kind in [0, 1, 240, 254, 255] {
            assert_eq!(bench.write(0x1400, 2, kind), 0, "{kind}");
        }
    }
}

/// CiA 301 restricts the identifiers of guarding, which are the very ones that 100Eh is for.
#[test]
fn guarding_keeps_its_own_identifiers() {
    let lenient = ParameterRules::Lenient {
        pdo: 0x8000_07FF,
        sync_and_emcy: 0x8000_07FF,
    };
    for parameters in [ParameterRules::Standard, lenient] {
        let mut bench = Bench::new(Options {
            parameters,
            ..Options::default()
        });
        assert_eq!(bench.write(0x100E, 0, 0x701), 0);
        for index in [0x1005, 0x1014] {
            assert_eq!(bench.write(index, 0, 0x701), 0x0609_0030, "{index:04X}h");
        }
    }
}
