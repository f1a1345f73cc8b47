//! Brings a simulated LXM32M to Operation Enabled over SDO, as any CANopen master can.
//! `cargo run -p syncline-drives --example bring_up_a_twin`

use std::error::Error;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::sdo::Client;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, Frame, NodeId};
use syncline_drives::bus::{Band, BitRate, SimBus};
use syncline_drives::twin::lxm32m::{Twin, TwinConfig};

const CONTROLWORD: Address = Address::new(0x6040, 0);
const STATUSWORD: Address = Address::new(0x6041, 0);
const STEP: Duration = Duration::from_micros(100);

/// A bus with one drive on it, and the master's side of its SDO channel.
struct Bench {
    bus: SimBus<Twin>,
    client: Client,
}

impl Bench {
    /// Runs the bus until the transfer that was begun ends; its data.
    fn finish(&mut self) -> Result<Vec<u8>, Box<dyn Error>> {
        loop {
            let mut requests = Vec::new();
            self.bus.advance_to(self.bus.now() + STEP, &mut |_| {});
            while let Some(received) = self.bus.receive() {
                let outcome = self
                    .client
                    .on_frame(received.at, &received.frame, &mut requests);
                if let Some(result) = outcome {
                    return Ok(result?.to_vec());
                }
            }
            if let Some(failure) = self.client.poll(self.bus.now(), &mut requests) {
                return Err(failure.into());
            }
            self.send(requests);
        }
    }

    fn send(&mut self, frames: Vec<Frame>) {
        for frame in frames {
            self.bus.send(Band::Acyclic, frame);
        }
    }

    fn read_u16(&mut self, object: Address) -> Result<u16, Box<dyn Error>> {
        let mut requests = Vec::new();
        self.client.upload(self.bus.now(), object, &mut requests)?;
        self.send(requests);
        Ok(u16::from_le_bytes(self.finish()?.as_slice().try_into()?))
    }

    fn write_u16(&mut self, object: Address, value: u16) -> Result<(), Box<dyn Error>> {
        let mut requests = Vec::new();
        let data = value.to_le_bytes();
        self.client
            .download(self.bus.now(), object, &data, &mut requests)?;
        self.send(requests);
        self.finish().map(drop)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let node = NodeId::new(1).ok_or("a node id is 1…127")?;
    let mut bus = SimBus::new(BitRate::from_kbit(1000).ok_or("a bit rate of CANopen")?);
    bus.attach(Twin::new(TwinConfig::new(node)));
    let client = Client::new(node, Duration::from_millis(100), 8);
    let mut bench = Bench { bus, client };

    // Shutdown, switch on, enable operation (CiA 402); each takes effect after a while.
    for controlword in [0x0006, 0x0007, 0x000F] {
        bench.write_u16(CONTROLWORD, controlword)?;
        bench
            .bus
            .advance_to(bench.bus.now() + Duration::from_millis(500), &mut |_| {});
        let statusword = Statusword(bench.read_u16(STATUSWORD)?);
        println!("controlword {controlword:04X}h: statusword {statusword}");
    }
    let statusword = Statusword(bench.read_u16(STATUSWORD)?);
    assert_eq!(statusword.state(), Some(State::OperationEnabled));
    Ok(())
}
