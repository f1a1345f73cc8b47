//! A small master for tests: SDO and NMT over a simulated bus, one virtual instant after another.

pub(crate) mod dictionary;
pub(crate) mod lxm32m;
pub(crate) mod tlc5xx;

use proptest::prelude::*;
use syncline_canopen::cia402::Statusword;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant, NodeId, nmt};
use syncline_drives::bus::{Band, BitRate, BusNode, Received, SimBus};
use syncline_drives::twin::SimulatedDevice;

pub(crate) struct Bench<T> {
    pub(crate) bus: SimBus<T>,
    /// Everything that came from the nodes, oldest first.
    pub(crate) log: Vec<Received>,
}

pub(crate) fn id(node: u8) -> NodeId {
    NodeId::new(node).unwrap()
}

pub(crate) fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

impl<T: BusNode> Bench<T> {
    /// Devices at 1 Mbit/s, 5 ms after they were switched on.
    pub(crate) fn of(devices: impl IntoIterator<Item = T>) -> Self {
        let mut bus = SimBus::new(BitRate::from_kbit(1000).unwrap());
        for device in devices {
            bus.attach(device);
        }
        let mut bench = Self { bus, log: vec![] };
        bench.wait(ms(5));
        bench
    }

    pub(crate) fn twin(&mut self) -> &mut T {
        self.bus.node_mut(0)
    }

    pub(crate) fn now(&self) -> Instant {
        self.bus.now()
    }

    pub(crate) fn wait(&mut self, time: Duration) {
        self.run_to(self.bus.now() + time);
    }

    pub(crate) fn run_to(&mut self, until: Instant) {
        self.bus.advance_to(until, &mut |_| {});
        while let Some(received) = self.bus.receive() {
            if !received.own {
                self.log.push(received);
            }
        }
    }

    pub(crate) fn send(&mut self, id: u16, data: &[u8]) {
        self.bus
            .send(Band::Acyclic, Frame::new(CanId::Standard(id), data));
    }

    pub(crate) fn sync(&mut self) {
        self.bus.send(Band::Sync, Frame::new(CobId::SYNC, &[]));
    }

    /// The first frame with this identifier that came since `from` of the log, waiting for it.
    pub(crate) fn expect(&mut self, from: usize, id: u16, within: Duration) -> Option<Frame> {
        let end = self.now() + within;
        loop {
            let found = self.log[from..]
                .iter()
                .find(|received| received.frame.id() == CanId::Standard(id));
            if let Some(found) = found {
                return Some(found.frame);
            }
            if self.now() >= end {
                return None;
            }
            self.wait(Duration::from_micros(100));
        }
    }

    pub(crate) fn request(&mut self, node: u8, request: [u8; 8]) -> [u8; 8] {
        let from = self.log.len();
        self.send(0x600 + u16::from(node), &request);
        let answer = self
            .expect(from, 0x580 + u16::from(node), ms(50))
            .expect("an SDO answer");
        answer.data().try_into().expect("8 bytes")
    }

    /// Sends a remote request for one byte and returns the data of the answer, if there is one.
    pub(crate) fn remote(&mut self, id: u16) -> Option<Vec<u8>> {
        let from = self.log.len();
        let request = Frame::remote(CanId::Standard(id), 1).unwrap();
        self.bus.send(Band::Acyclic, request);
        let answer = self.expect(from, id, ms(5))?;
        Some(answer.data().to_vec())
    }

    /// The data of what came with this identifier since `from` of the log.
    pub(crate) fn received(&self, from: usize, id: u16) -> Vec<Vec<u8>> {
        let frames = self.log[from..].iter().map(|received| received.frame);
        let frames = frames.filter(|frame| frame.id() == CanId::Standard(id));
        frames.map(|frame| frame.data().to_vec()).collect()
    }

    /// Expedited download; the abort code if it is refused.
    pub(crate) fn write(&mut self, node: u8, index: u16, sub: u8, bytes: &[u8]) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        let mut request = [
            0x23 | (4 - bytes.len() as u8) << 2,
            low,
            high,
            sub,
            0,
            0,
            0,
            0,
        ];
        request[4..4 + bytes.len()].copy_from_slice(bytes);
        let answer = self.request(node, request);
        assert_eq!(answer[1..4], request[1..4], "multiplexer");
        match answer[0] {
            0x60 => Ok(()),
            0x80 => Err(u32::from_le_bytes(answer[4..].try_into().unwrap())),
            other => panic!("command {other:02X}"),
        }
    }

    /// Expedited upload; the abort code if it is refused.
    pub(crate) fn read(&mut self, node: u8, index: u16, sub: u8) -> Result<Vec<u8>, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.request(node, [0x40, low, high, sub, 0, 0, 0, 0]);
        assert_eq!(answer[1..4], [low, high, sub], "multiplexer");
        match answer[0] {
            0x80 => Err(u32::from_le_bytes(answer[4..].try_into().unwrap())),
            command => {
                assert_eq!(command & 0xF3, 0x43, "an expedited answer");
                Ok(answer[4..8 - usize::from(command >> 2 & 3)].to_vec())
            }
        }
    }

    /// Upload, expedited or in segments; the abort code if it is refused.
    pub(crate) fn upload(&mut self, node: u8, index: u16, sub: u8) -> Result<Vec<u8>, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.request(node, [0x40, low, high, sub, 0, 0, 0, 0]);
        let word = u32::from_le_bytes(answer[4..].try_into().unwrap());
        match answer[0] {
            0x80 => return Err(word),
            0x41 => {}
            command => return Ok(answer[4..8 - usize::from(command >> 2 & 3)].to_vec()),
        }
        let (mut bytes, mut toggle) = (vec![], 0);
        loop {
            let segment = self.request(node, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(segment[0] & 0xF0, toggle, "toggle bit");
            bytes.extend(&segment[1..8 - usize::from(segment[0] >> 1 & 7)]);
            if segment[0] & 1 == 1 {
                assert_eq!(bytes.len(), word as usize, "announced size");
                return Ok(bytes);
            }
            toggle ^= 0x10;
        }
    }

    /// A number of up to four bytes without a sign.
    pub(crate) fn number(&mut self, node: u8, index: u16, sub: u8) -> u32 {
        let mut bytes = self.read(node, index, sub).unwrap();
        bytes.resize(4, 0);
        u32::from_le_bytes(bytes.try_into().unwrap())
    }

    pub(crate) fn read_i32(&mut self, node: u8, index: u16, sub: u8) -> i32 {
        let bytes = self.read(node, index, sub).unwrap();
        i32::from_le_bytes(bytes.try_into().unwrap())
    }

    pub(crate) fn read_u16(&mut self, node: u8, index: u16, sub: u8) -> u16 {
        let bytes = self.read(node, index, sub).unwrap();
        u16::from_le_bytes(bytes.try_into().unwrap())
    }

    pub(crate) fn nmt(&mut self, command: nmt::Command, node: u8) {
        self.send(0x000, &[command as u8, node]);
        self.wait(ms(1));
    }

    pub(crate) fn controlword(&mut self, node: u8, word: u16) {
        self.write(node, 0x6040, 0, &word.to_le_bytes()).unwrap();
        self.wait(ms(10));
    }
}

// ---- operating modes ----

pub(crate) const TARGET_REACHED: u16 = Statusword::TARGET_REACHED;
pub(crate) const BIT_12: u16 = Statusword::MODE_12;
pub(crate) const X_ERR: u16 = Statusword::BIT_13;
pub(crate) const X_END: u16 = Statusword::BIT_14;
pub(crate) const REF_OK: u16 = Statusword::BIT_15;
pub(crate) const HALT: u16 = 0x0100;

/// Writes a number in the object's own size.
pub(crate) fn set<T: BusNode>(bench: &mut Bench<T>, index: u16, sub: u8, value: i32) {
    let bytes = value.to_le_bytes();
    let size = bench.read(1, index, sub).unwrap().len();
    assert_eq!(
        bench.write(1, index, sub, &bytes[..size]),
        Ok(()),
        "{index:04X}:{sub:X}"
    );
}

pub(crate) fn status<T: BusNode>(bench: &mut Bench<T>) -> u16 {
    bench.read_u16(1, 0x6041, 0)
}

/// Waits until these statusword bits are set.
pub(crate) fn wait_for<T: BusNode>(bench: &mut Bench<T>, bits: u16, seconds: u64) {
    for _ in 0..seconds * 100 {
        if status(bench) & bits == bits {
            return;
        }
        bench.wait(ms(10));
    }
    panic!("bits {bits:04X} of {:04X}", status(bench));
}

pub(crate) fn rpm<T: SimulatedDevice>(bench: &mut Bench<T>) -> f64 {
    bench.twin().observe().velocity * 60.0
}

/// Frames with these identifiers and data, one in twenty a remote request.
pub(crate) fn frames(
    ids: impl Strategy<Value = u16>,
    data: impl Strategy<Value = Vec<u8>>,
) -> impl Strategy<Value = Frame> {
    (ids, data, 0u8..20).prop_map(|(id, data, kind)| {
        let id = CanId::Standard(id);
        match kind {
            0 => Frame::remote(id, data.len() as u8).unwrap(),
            _ => Frame::new(id, &data),
        }
    })
}
