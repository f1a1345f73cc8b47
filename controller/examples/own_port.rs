//! A bus of one's own under the controller's cycle: what carries frames is a `Wire`, and `WirePort`
//! makes a port of it. Here frames go through a channel to a device in the same process.
//! `cargo run -p syncline-controller --example own_port`

use std::collections::VecDeque;
use std::error::Error;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId};
use syncline_controller::bus::Burst;
use syncline_controller::port::wire::{Wire, WirePort};
use syncline_controller::port::{Port, PortError};
use syncline_controller::realtime;

/// One end of a channel of frames.
struct Channel {
    to: Sender<Frame>,
    from: Receiver<Frame>,
    /// Came while somebody waited.
    arrived: VecDeque<(Instant, Frame)>,
}

impl Channel {
    fn pair() -> (Self, Self) {
        let (to_device, from_controller) = channel();
        let (to_controller, from_device) = channel();
        let end = |to, from| Self {
            to,
            from,
            arrived: VecDeque::new(),
        };
        (
            end(to_device, from_device),
            end(to_controller, from_controller),
        )
    }

    fn gone(&self) -> PortError {
        PortError {
            bus: self.name().to_owned(),
            what: "the other end is gone: start it again".to_owned(),
        }
    }
}

impl Wire for Channel {
    fn name(&self) -> &str {
        "channel"
    }

    fn wait(&mut self, most: Duration) -> Result<(), PortError> {
        match self.from.recv_timeout(most) {
            Ok(frame) => self.arrived.push_back((realtime::now(), frame)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(self.gone()),
        }
        Ok(())
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
        while let Ok(frame) = self.from.try_recv() {
            self.arrived.push_back((realtime::now(), frame));
        }
        let some = !self.arrived.is_empty();
        for (at, frame) in self.arrived.drain(..) {
            sink(at, &frame);
        }
        Ok(some)
    }

    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
        for frame in frames.drain(..) {
            self.to.send(frame).map_err(|_| self.gone())?;
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let (near, mut far) = Channel::pair();
    let mut port = WirePort::new(near);
    let node = NodeId::new(1).ok_or("a node id is 1…127")?;

    // What the cycle does: SYNC, receive, the burst of all setpoints.
    port.send_sync(&Frame::new(CobId::SYNC, &[]))?;
    let sent = port.send_burst(&[Frame::new(CobId::r_pdo(2, node), &[0x1F, 0, 0, 0, 0, 0])])?;
    assert_eq!(sent, Burst::Queued);

    // A device at the other end answers SYNC with its T_PDO.
    let mut answers = Vec::new();
    far.wait(Duration::from_secs(1))?;
    far.receive(&mut |_, frame| {
        println!("device      {frame:?}");
        if frame.id() == CobId::SYNC.into() {
            answers.push(Frame::new(CobId::t_pdo(2, node), &[0x37, 0x12, 0, 0, 0, 0]));
        }
    })?;
    far.send(&mut answers)?;

    let mut received = 0;
    port.receive(&mut |it| {
        println!("controller  {:?}", it.frame);
        received += 1;
    })?;
    assert_eq!(received, 1);
    Ok(())
}
