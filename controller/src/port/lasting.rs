//! A connection that outlasts its server: once that is gone a thread connects anew, once a second at most, so
//! that a reset behind the fault finds the bus as soon as there is a server again. The cycle waits for none of it.

use super::PortError;
use super::url::{BusUrl, End};
use super::wire::Wire;
use crossbeam::channel::{self, Receiver, Sender};
use std::io;
use std::thread;
use std::time::Duration;
use syncline_canopen::{Frame, Instant};

/// From one attempt to the next.
const PAUSE: Duration = Duration::from_secs(1);

type Opened = Result<Box<dyn Wire + Send>, PortError>;

/// See the module.
pub(super) struct Lasting {
    name: String,
    /// The connection, or why there is none.
    wire: Opened,
    /// Has the thread connect anew.
    lost: Sender<()>,
    /// What came of its attempts.
    opened: Receiver<Opened>,
}

impl Lasting {
    /// Connects there.
    ///
    /// # Errors
    /// It cannot be connected to, or no thread begun.
    pub(super) fn open(url: BusUrl, bit_rate: u32) -> Result<Self, PortError> {
        let wire = url.open(bit_rate, End::Client)?;
        let name = wire.name().to_owned();
        let (lost, is_lost) = channel::bounded::<()>(1);
        let (give, opened) = channel::bounded(1);
        let connect = move || {
            let mut last: Option<std::time::Instant> = None;
            while is_lost.recv().is_ok() {
                loop {
                    // A server that greets and hangs up is not asked without end.
                    let early = last.and_then(|last| PAUSE.checked_sub(last.elapsed()));
                    thread::sleep(early.unwrap_or_default());
                    last = Some(std::time::Instant::now());
                    let attempt = url.open(bit_rate, End::Client);
                    let is_open = attempt.is_ok();
                    if give.send(attempt).is_err() {
                        return;
                    }
                    if is_open {
                        break;
                    }
                }
            }
        };
        let thread = thread::Builder::new().name("connection".into());
        let failed = |error: io::Error| PortError {
            bus: name.clone(),
            what: format!("cannot watch the connection: {error}"),
        };
        thread.spawn(connect).map_err(failed)?;
        Ok(Self {
            name,
            wire: Ok(wire),
            lost,
            opened,
        })
    }

    /// Does something with the connection, if there is one.
    fn with<T>(
        &mut self,
        what: impl FnOnce(&mut (dyn Wire + Send)) -> Result<T, PortError>,
    ) -> Result<T, PortError> {
        if self.wire.is_err()
            && let Ok(opened) = self.opened.try_recv()
        {
            self.wire = opened;
        }
        let done = match &mut self.wire {
            Ok(wire) => what(&mut **wire),
            Err(why) => return Err(why.clone()),
        };
        if let Err(why) = &done {
            self.wire = Err(why.clone());
            let _ = self.lost.try_send(());
        }
        done
    }
}

impl Wire for Lasting {
    fn name(&self) -> &str {
        &self.name
    }

    fn wait(&mut self, most: Duration) -> Result<(), PortError> {
        self.with(|wire| wire.wait(most))
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
        self.with(|wire| wire.receive(sink))
    }

    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
        self.with(|wire| wire.send(frames))
    }
}
