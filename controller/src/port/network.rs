//! Buses over a network, whatever their protocol: reader threads put what arrives into a channel.

use super::PortError;
use super::wire::Wire;
use crossbeam::channel::{self, Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::io;
use std::time::Duration;
use syncline_canopen::{Frame, Instant};

/// Frames that wait to be read; a reader that falls behind by more loses the newest.
const CAPACITY: usize = 65_536;

/// Writes frames to the network.
pub(super) trait Outlet: Send {
    /// Writes frames, all or none: `WouldBlock` is for none.
    fn write(&mut self, frames: &[Frame]) -> io::Result<()>;
}

/// What a reader thread puts frames into.
pub(super) type Inlet = Sender<(Instant, Frame)>;

/// A bus over a network.
pub(super) struct NetworkBus {
    name: String,
    /// The one frame that ended a wait.
    next: Option<(Instant, Frame)>,
    inlet: Receiver<(Instant, Frame)>,
    outlet: Box<dyn Outlet>,
    notices: Option<Receiver<String>>,
}

impl NetworkBus {
    pub(super) fn new(
        name: String,
        inlet: Receiver<(Instant, Frame)>,
        outlet: Box<dyn Outlet>,
    ) -> Self {
        Self {
            name,
            next: None,
            inlet,
            outlet,
            notices: None,
        }
    }

    /// With what its other side tells a person, line by line.
    pub(super) fn with_notices(self, notices: Receiver<String>) -> Self {
        Self {
            notices: Some(notices),
            ..self
        }
    }

    pub(super) fn inlet() -> (Inlet, Receiver<(Instant, Frame)>) {
        channel::bounded(CAPACITY)
    }

    fn gone(&self) -> PortError {
        PortError {
            bus: self.name.clone(),
            what: "the connection is closed".to_owned(),
        }
    }
}

impl Wire for NetworkBus {
    fn name(&self) -> &str {
        &self.name
    }

    fn notices(&mut self) -> Option<Receiver<String>> {
        self.notices.take()
    }

    fn wait(&mut self, most: Duration) -> Result<(), PortError> {
        if self.next.is_none() {
            match self.inlet.recv_timeout(most) {
                Ok(frame) => self.next = Some(frame),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(self.gone()),
            }
        }
        Ok(())
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
        let next = self.next.take().map_or_else(|| self.inlet.try_recv(), Ok);
        let (at, frame) = match next {
            Ok(frame) => frame,
            Err(TryRecvError::Empty) => return Ok(false),
            Err(TryRecvError::Disconnected) => return Err(self.gone()),
        };
        sink(at, &frame);
        Ok(true)
    }

    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
        if frames.is_empty() {
            return Ok(());
        }
        match self.outlet.write(frames) {
            Ok(()) => frames.clear(),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => {
                return Err(PortError {
                    bus: self.name.clone(),
                    what: format!("sending: {error}"),
                });
            }
        }
        Ok(())
    }
}
