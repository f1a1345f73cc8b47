//! NMT and everything that supervises: any frame at any time.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::monitor::Monitor;
use syncline_canopen::nmt::{Request, State};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame, NodeId, guarding, heartbeat};
use syncline_fuzz::Victim;

fuzz_target!(|input: (bool, Vec<(u16, u8, [u8; 8])>)| {
    let (lenient, frames) = input;
    let mut victim = Victim::new(lenient);
    let id = NodeId::new(1).expect("1…127");
    let mut master = guarding::Master::new(id, Duration::from_millis(20), 3, victim.now);
    let mut watcher = heartbeat::Consumer::new(id, Duration::from_millis(50));
    let mut monitor = Monitor::new();
    monitor.add(id, syncline_fuzz::TABLE);
    for (id, kind, bytes) in frames {
        let id = CanId::Standard(id & 0x7FF);
        let length = kind & 0x0F;
        let frame = match kind >> 4 {
            0..=9 => Frame::try_new(id, &bytes[..usize::from(length.min(8))]),
            10 | 11 => Frame::remote(id, length.min(8)),
            12 | 13 => Some(Frame::new(CanId::Standard(0), &bytes[..2])),
            _ => {
                victim.pass(Duration::from_millis(u64::from(bytes[0])));
                None
            }
        };
        let mut sent: Vec<Frame> = Vec::new();
        if let Some(frame) = frame {
            let _ = (Request::decode(&frame), Emergency::from_frame(&frame));
            let _ = (
                master.on_frame(&frame),
                watcher.on_frame(victim.now, &frame),
            );
            let _ = monitor.decode(&frame);
            victim.receive(&frame);
        }
        let _ = (master.poll(victim.now, &mut sent), watcher.poll(victim.now));
        assert_ne!(
            victim.node.state(),
            State::Initialising,
            "a reset ends by itself"
        );
    }
});
