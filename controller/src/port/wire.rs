//! A bus whose frames are read and written as they come: what tools, and hosts of simulated
//! drives, use.

use super::{Port, PortError};
use crate::bus::{Burst, Received};
use crossbeam::channel::Receiver;
use std::time::Duration;
use syncline_canopen::{Frame, Instant};
use syncline_drives::world::BusId;

/// A bus to read from and write to, one frame at a time.
pub trait Wire {
    /// Its URL, with the port number that the host gave if any was asked for.
    fn name(&self) -> &str;

    /// What a person should know although the bus works on, a line each, as it happens. To be
    /// taken once.
    fn notices(&mut self) -> Option<Receiver<String>> {
        None
    }

    /// Sleeps until something may have arrived, for `most` at most.
    ///
    /// # Errors
    /// The bus is gone.
    fn wait(&mut self, most: Duration) -> Result<(), PortError>;

    /// Hands over some of what has arrived, with its instant of arrival on CLOCK_MONOTONIC; false
    /// if nothing had. Own frames are not among it.
    ///
    /// # Errors
    /// The bus is gone.
    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError>;

    /// Sends frames in order; what the bus does not take now stays in `frames`.
    ///
    /// # Errors
    /// The bus is gone.
    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError>;
}

impl<W: Wire + ?Sized> Wire for Box<W> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn notices(&mut self) -> Option<Receiver<String>> {
        (**self).notices()
    }

    fn wait(&mut self, most: Duration) -> Result<(), PortError> {
        (**self).wait(most)
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
        (**self).receive(sink)
    }

    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
        (**self).send(frames)
    }
}

/// Frames that a wake-up takes at least before the rest is left to the next one, so that a bus that babbles cannot hold the
/// cycle: more than a bus carries in any cycle.
const MOST_FRAMES: usize = 1024;

/// A [`Wire`] under a controller's cycle. It has no priority bands and no echo: good for trying
/// things out, not for holding a cycle.
pub struct WirePort<W> {
    wire: W,
    queue: Vec<Frame>,
}

impl<W: Wire> WirePort<W> {
    /// Over this wire.
    pub fn new(wire: W) -> Self {
        Self {
            wire,
            queue: Vec::with_capacity(256),
        }
    }

    /// Sends what the wire takes now and forgets the rest; returns how many it took.
    fn send(&mut self, frames: &[Frame]) -> Result<usize, PortError> {
        self.queue.clear();
        self.queue.extend_from_slice(frames);
        self.wire.send(&mut self.queue)?;
        Ok(frames.len() - self.queue.len())
    }
}

impl<W: Wire> Port for WirePort<W> {
    fn simulated(&self) -> Option<BusId> {
        None
    }

    fn echoes(&self) -> bool {
        false
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        let mut count = 0;
        while count < MOST_FRAMES
            && self.wire.receive(&mut |at, frame| {
                count += 1;
                sink(Received {
                    at,
                    frame: *frame,
                    echo: false,
                });
            })?
        {}
        Ok(())
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        match self.send(std::slice::from_ref(frame))? {
            0 => Err(PortError {
                bus: self.wire.name().to_owned(),
                what: "it takes no frames any more: is its other end alive?".to_owned(),
            }),
            _ => Ok(()),
        }
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        Ok(match self.send(frames)? {
            queued if queued == frames.len() => Burst::Queued,
            0 => Burst::Dropped,
            queued => Burst::Torn { queued },
        })
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        self.send(frames).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_canopen::CobId;

    /// A wire on which something has always arrived, so many frames at a time, and how many it has handed over.
    struct Babbling {
        at_once: usize,
        count: usize,
    }

    impl Wire for Babbling {
        fn name(&self) -> &str {
            "babbling"
        }

        fn wait(&mut self, _: Duration) -> Result<(), PortError> {
            Ok(())
        }

        fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
            assert!(self.count < 1_000_000, "it takes them without end");
            for _ in 0..self.at_once {
                self.count += 1;
                sink(Instant::ZERO, &Frame::new(CobId::SYNC, &[]));
            }
            Ok(true)
        }

        fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
            frames.clear();
            Ok(())
        }
    }

    #[test]
    fn a_bus_that_babbles_does_not_hold_a_wake_up() {
        for at_once in [1, 7, 64] {
            let mut port = WirePort::new(Babbling { at_once, count: 0 });
            for wake_up in 1..=3 {
                let mut taken = 0;
                port.receive(&mut |_| taken += 1).unwrap();
                let most = MOST_FRAMES + at_once;
                assert!((1..most).contains(&taken), "{taken} at once {at_once}");
                assert!(port.wire.count < wake_up * most);
            }
        }
    }
}
