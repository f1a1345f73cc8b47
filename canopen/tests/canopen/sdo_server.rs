//! An SDO server, seen from the bus: messages byte by byte as CiA 301 and the LXM32M's manual
//! have them.

use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, constant, ro, rw, table, wo};
use syncline_canopen::sdo::Server;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId};

static TABLE: [Entry; 8] = table([
    constant(0x1000, 0, "Device type", U32).default(0x0042_0192),
    ro(0x1008, 0, "Device name", Text(8)).default_text("LXM32M  "),
    rw(0x2000, 1, "Long text", Text(64)),
    wo(0x2001, 0, "Command", U8),
    rw(0x6040, 0, "Controlword", U16).r_pdo(),
    ro(0x6041, 0, "Statusword", U16).t_pdo(),
    rw(0x6060, 0, "Mode", I8).range(-6, 10).r_pdo(),
    rw(0x60C1, 1, "Setpoint", I32).r_pdo(),
]);

struct Bench {
    server: Server,
    objects: Dictionary,
}

impl Bench {
    fn new() -> Self {
        let node = NodeId::new(1).expect("node");
        Self {
            server: Server::new(CobId::r_sdo(node), CobId::t_sdo(node), 64),
            objects: Dictionary::new(&TABLE, node),
        }
    }

    /// Sends one request and returns the answers as candump prints them.
    fn ask(&mut self, request: &str) -> Vec<String> {
        let mut answers = Vec::new();
        let taken = self.server.on_frame(
            Instant::ZERO,
            &frame(0x601, request),
            &mut self.objects,
            &mut answers,
        );
        assert!(taken);
        answers.iter().map(|frame| format!("{frame:?}")).collect()
    }

    #[track_caller]
    fn expect(&mut self, request: &str, answer: &str) {
        assert_eq!(self.ask(request), [format!("581#{answer}")], "{request}");
    }
}

fn frame(id: u16, hex: &str) -> Frame {
    let bytes: Vec<u8> = (0..hex.len() / 2)
        .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).expect("hex"))
        .collect();
    Frame::new(CobId::new(id).expect("11 bits"), &bytes)
}

#[test]
fn expedited_transfers() {
    let mut bench = Bench::new();
    // (lxm32m X-02), (lxm32m 1617), (lxm32m 1629)
    bench.expect("4000100000000000", "4300100092014200");
    bench.expect("2B4060000F000000", "6040600000000000");
    bench.expect("4040600000000000", "4B4060000F000000");
    bench.expect("2F606000FA000000", "6060600000000000");
    bench.expect("4060600000000000", "4F606000FA000000");
    assert_eq!(bench.objects.value(0x6060, 0), Some(-6));
    // Expedited without a stated size (22h) takes the object's own.
    bench.expect("22606000FE000000", "6060600000000000");
    assert_eq!(bench.objects.value(0x6060, 0), Some(-2));
}

#[test]
fn segmented_transfers() {
    let mut bench = Bench::new();
    bench.expect("4008100000000000", "4108100008000000");
    bench.expect("6000000000000000", "004C584D33324D20");
    bench.expect("7000000000000000", "1D20000000000000");
    bench.expect("210020010A000000", "6000200100000000");
    bench.expect("0030313233343536", "2000000000000000");
    bench.expect("1937383900000000", "3000000000000000");
    bench.expect("4000200100000000", "410020010A000000");
    bench.expect("6000000000000000", "0030313233343536");
    bench.expect("7000000000000000", "1937383900000000");
}

#[test]
fn refusals() {
    let mut bench = Bench::new();
    for (request, answer) in [
        ("4006100000000000", "8006100000000206"), // unknown object (lxm32m X-04)
        ("4040600500000000", "8040600511000906"), // unknown subindex (lxm32m X-06)
        ("40C1600000000000", "80C1600011000906"), // unknown subindex below the first
        ("2B41600000000000", "8041600002000106"), // read only (lxm32m X-05)
        ("4001200000000000", "8001200001000106"), // write only
        ("2F6060000B000000", "8060600030000906"), // out of range (lxm32m X-07)
        ("2B60600007000000", "8060600012000706"), // too long (lxm32m X-08)
        ("2F40600007000000", "8040600013000706"), // too short
        ("2100200141000000", "8000200112000706"), // longer than the object
        ("E000200100000000", "8000200101000405"), // unknown command
        ("6000000000000000", "8000000001000405"), // segment without a transfer
        ("A300000000000000", "8000000001000405"), // block without a transfer
    ] {
        bench.expect(request, answer);
    }
    bench.expect("4008100000000000", "4108100008000000");
    bench.expect("7000000000000000", "8008100000000305"); // toggle not alternated
    assert!(!bench.server.is_busy());
}

#[test]
fn downloads_of_a_wrong_length() {
    let mut bench = Bench::new();
    // No length stated, 10 segments of 7 bytes: the 64 of the object are exceeded.
    bench.expect("2000200100000000", "6000200100000000");
    for n in 0..9 {
        let toggle = 0x10 * (n % 2);
        bench.expect(
            &format!("{toggle:02X}41414141414141"),
            &format!("{:02X}00000000000000", 0x20 | toggle),
        );
    }
    bench.expect("1041414141414141", "8000200112000706");
    // 9 bytes stated, 8 sent.
    bench.expect("2100200109000000", "6000200100000000");
    bench.expect("0041414141414141", "2000000000000000");
    bench.expect("1D41000000000000", "8000200110000706");
    // The same by block.
    bench.expect("C200200109000000", "A40020017F000000");
    assert!(bench.ask("0141414141414141").is_empty());
    bench.expect("8241000000000000", "A2027F0000000000");
    bench.expect("D900000000000000", "8000200110000706");
}

#[test]
fn block_uploads() {
    let mut bench = Bench::new();
    let text = "2100200108000000";
    bench.expect(text, "6000200100000000");
    bench.expect("0030313233343536", "2000000000000000");
    bench.expect("1D37000000000000", "3000000000000000");
    bench.expect("A400200100000000", "8000200102000405"); // blocks of 0 segments
    bench.expect("A400200180000000", "8000200102000405"); // blocks of 128 segments
    bench.expect("A400200101080000", "4100200108000000"); // up to 8 bytes as segments
    bench.expect("A400200101070000", "C600200108000000");
    bench.expect("A300000000000000", "0130313233343536");
    bench.expect("A202010000000000", "8000200103000405"); // 2 acknowledged, 1 sent
    bench.expect("A400200101070000", "C600200108000000");
    bench.expect("A300000000000000", "0130313233343536");
    bench.expect("A200010000000000", "0130313233343536"); // none has arrived: again
    bench.expect("A201010000000000", "8137000000000000");
    bench.expect("A201010000000000", "D90AC00000000000");
    assert!(bench.ask("A100000000000000").is_empty());
    assert!(!bench.server.is_busy());
}

/// A threshold of 0 permits no change of protocol (CiA 301), not even for nothing.
#[test]
fn an_empty_object_by_block() {
    let mut bench = Bench::new();
    bench.expect("A400200101000000", "C600200100000000");
    bench.expect("A300000000000000", "8100000000000000");
    bench.expect("A201010000000000", "DD00000000000000");
    assert!(bench.ask("A100000000000000").is_empty());
    bench.expect("A400200101010000", "4100200100000000");
}

#[test]
fn silent_client_is_given_up() {
    let mut bench = Bench::new();
    bench.server = bench.server.with_timeout(Duration::from_millis(500));
    bench.expect("4008100000000000", "4108100008000000");
    let deadline = bench.server.deadline().expect("a transfer is under way");
    let mut answers = Vec::new();
    bench.server.poll(Instant::from_nanos(1), &mut answers);
    assert!(answers.is_empty());
    bench.server.poll(deadline, &mut answers);
    assert_eq!(answers, [frame(0x581, "8008100000000405")]);
    assert_eq!(bench.server.deadline(), None);
}

#[test]
fn malformed_and_foreign_frames_get_no_answer() {
    let mut bench = Bench::new();
    assert!(bench.ask("40001000").is_empty());
    let mut answers = Vec::new();
    let foreign = frame(0x602, "4000100000000000");
    assert!(
        !bench
            .server
            .on_frame(Instant::ZERO, &foreign, &mut bench.objects, &mut answers)
    );
    assert!(answers.is_empty());
}
