//! SDO: requests to a node's servers and answers to a client, in any order.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syncline_canopen::sdo::Client;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, Frame, Instant, NodeId};
use syncline_fuzz::Victim;

fuzz_target!(|input: (bool, Vec<(u8, [u8; 8])>)| {
    let (lenient, messages) = input;
    let mut victim = Victim::new(lenient);
    let id = NodeId::new(1).expect("1…127");
    let mut client = Client::new(id, Duration::from_millis(10), 100);
    let mut requests: Vec<Frame> = Vec::new();
    let mut now = Instant::ZERO;
    for (kind, bytes) in messages {
        let address = Address::new(u16::from_le_bytes([bytes[0], bytes[1]]), bytes[2]);
        let data = &[0x55; 120][..usize::from(bytes[3]) % 120];
        // A client that is busy or too small says so; that is all.
        let _ = match kind % 8 {
            0 => client.upload(now, address, &mut requests),
            1 => client.download(now, address, data, &mut requests),
            2 => client.upload_block(now, address, bytes[3], &mut requests),
            3 => client.download_block(now, address, data, &mut requests),
            4 => {
                let answer = Frame::new(CanId::Standard(0x581), &bytes);
                let _ = client.on_frame(now, &answer, &mut requests);
                Ok(())
            }
            5 => {
                now += Duration::from_millis(bytes[0].into());
                let _ = client.poll(now, &mut requests);
                victim.pass(Duration::from_millis(bytes[0].into()));
                Ok(())
            }
            6 => {
                // The client and the node talk to each other.
                for request in requests.drain(..) {
                    victim.receive(&request);
                }
                Ok(())
            }
            _ => {
                victim.receive(&Frame::new(CanId::Standard(0x601), &bytes));
                Ok(())
            }
        };
        requests.truncate(1000);
    }
});
