//! What is encoded is decoded, and what decodes is what was encoded.

use proptest::prelude::*;
use syncline_canopen::dictionary::DataType;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::nmt::{Command, Request, State};
use syncline_canopen::pdo::{CobIdWord, Mapped, Packer, TransmissionType, Unpacker};
use syncline_canopen::{CobId, Frame, NodeId, heartbeat};

fn node() -> impl Strategy<Value = NodeId> {
    (1u8..=127).prop_filter_map("1…127", NodeId::new)
}

fn command() -> impl Strategy<Value = Command> {
    prop::sample::select(vec![
        Command::Start,
        Command::Stop,
        Command::EnterPreOperational,
        Command::ResetNode,
        Command::ResetCommunication,
    ])
}

fn state() -> impl Strategy<Value = State> {
    prop::sample::select(vec![
        State::Initialising,
        State::Stopped,
        State::Operational,
        State::PreOperational,
    ])
}

proptest! {
    #[test]
    fn nmt_requests(command in command(), node in proptest::option::of(node())) {
        let request = Request { command, node };
        prop_assert_eq!(Request::decode(&request.encode()), Some(request));
    }

    #[test]
    fn nmt_frames(data in proptest::collection::vec(any::<u8>(), 0..=8)) {
        let frame = Frame::new(CobId::NMT, &data);
        if let Some(request) = Request::decode(&frame) {
            prop_assert_eq!(request.encode(), frame);
        }
    }

    #[test]
    fn heartbeats(node in node(), state in state()) {
        prop_assert_eq!(heartbeat::decode(&heartbeat::encode(node, state)), Some((node, state)));
    }

    #[test]
    fn emergencies(node in node(), code: u16, register: u8, vendor: [u8; 5]) {
        let emergency = Emergency { code, register, vendor };
        let frame = emergency.encode(CobId::emcy(node));
        prop_assert_eq!(Emergency::from_frame(&frame), Some((node, emergency)));
    }

    #[test]
    fn transmission_types(number: u8) {
        prop_assert_eq!(u8::from(TransmissionType::from(number)), number);
    }

    #[test]
    fn mapping_entries(entry: u32) {
        prop_assert_eq!(u32::from(Mapped::from(entry)), entry);
    }

    #[test]
    fn cob_id_words(id in 0u16..=0x7FF) {
        let cob_id = CobId::new(id).expect("11 bits");
        prop_assert_eq!(CobIdWord::valid(cob_id).cob_id(), Some(cob_id));
        prop_assert!(CobIdWord::valid(cob_id).is_valid());
        prop_assert!(!CobIdWord::invalid(cob_id).is_valid());
    }

    #[test]
    fn payloads(fields in proptest::collection::vec((any::<i64>(), 1u8..=64), 1..12)) {
        let mut packer = Packer::new();
        let mut room = 64;
        let mut packed = Vec::new();
        for (value, bits) in fields {
            if bits <= room {
                packer.push(value, bits);
                packed.push((value, bits));
                room -= bits;
            }
        }
        let bytes = packer.bytes();
        let mut payload = Unpacker::new(&bytes[..packer.len()]);
        for (value, bits) in packed {
            let unused = 64 - u32::from(bits);
            let raw = payload.unsigned(bits);
            prop_assert_eq!(raw, Some((value as u64) << unused >> unused));
            let signed = raw.map(|raw| DataType::I64.extend(raw, bits.into()));
            prop_assert_eq!(signed, Some(value << unused >> unused));
        }
    }
}

/// (lxm32m 484, 918, 1019-1023, 1620-1625).
#[test]
fn printed_values() {
    let node = |id| NodeId::new(id).expect("1…127");
    assert_eq!(CobId::t_pdo(1, node(5)).get(), 0x185);
    assert_eq!(u32::from(Mapped::new(0x60C1, 1, 32)), 0x60C1_0120);
    assert_eq!(u32::from(Mapped::new(0x6041, 0, 16)), 0x6041_0010);
    let boot_up = heartbeat::encode(node(1), State::Initialising);
    assert_eq!(format!("{boot_up:?}"), "701#00");
    let start = Request {
        command: Command::Start,
        node: None,
    };
    assert_eq!(format!("{:?}", start.encode()), "000#0100");
    let mut setpoint = Packer::new();
    setpoint.push(0x001F, 16);
    setpoint.push(-2, 32);
    assert_eq!(
        setpoint.bytes()[..setpoint.len()],
        [0x1F, 0, 0xFE, 0xFF, 0xFF, 0xFF]
    );
}

/// What an error code is about, as CiA 301 and CiA 402 have it; a maker's own is nobody else's to explain.
#[test]
fn an_emergency_tells_what_its_code_is_about() {
    let meaning = |code| {
        Emergency {
            code,
            ..Emergency::default()
        }
        .meaning()
    };
    for (code, told) in [
        (0x2310, "current"),
        (0x3130, "mains voltage"),
        (0x3210, "voltage"),
        (0x4310, "temperature"),
        (0x7305, "sensor"),
        (0x8130, "life guarding or heartbeat"),
        (0x8120, "communication"),
        (0x8611, "following error, by the drive's own limit"),
    ] {
        assert_eq!(meaning(code), Some(told), "{code:04X}h");
    }
    for code in [0x0000, 0x1000, 0xFF01, 0xF001] {
        assert_eq!(meaning(code), None, "{code:04X}h");
    }
}
