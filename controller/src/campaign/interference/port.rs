//! The port through which buses are interfered with.

use super::{Change, Tampering, ToBus, Traffic};
use crate::bus::{Burst, BusFault, Received, Severity};
use crate::port::sim::SimPort;
use crate::port::{Port, PortError};
use std::mem::take;
use syncline_canopen::{CanId, CobId, Frame};
use syncline_drives::world::{BusId, World};

/// The controller's port to a simulated bus that is interfered with.
pub(in crate::campaign) struct TroubledPort {
    port: SimPort,
    drop_bursts: u32,
    delay_bursts: u32,
    tear_bursts: u32,
    lose_syncs: u32,
    unplugged: u32,
    condition: Option<BusFault>,
    tampering: Vec<Tampering>,
    intruder: Option<(Frame, u32)>,
    /// What another master puts on the bus.
    nmt: Option<Frame>,
    /// A second node has this id, for so many frames more.
    second: Option<(u8, u32)>,
    /// Bursts that wait for the next SYNC to leave.
    late: Vec<Frame>,
    /// Frames that come a cycle later.
    delayed: Vec<Received>,
}

impl TroubledPort {
    /// Around a port that nothing happens to.
    pub(in crate::campaign) fn new(port: SimPort) -> Self {
        Self {
            port,
            drop_bursts: 0,
            delay_bursts: 0,
            tear_bursts: 0,
            lose_syncs: 0,
            unplugged: 0,
            condition: None,
            tampering: Vec::new(),
            intruder: None,
            nmt: None,
            second: None,
            late: Vec::new(),
            delayed: Vec::new(),
        }
    }

    /// Lets something happen.
    pub(in crate::campaign) fn trouble(&mut self, what: ToBus) {
        match what {
            ToBus::DropBursts(count) => self.drop_bursts = count,
            ToBus::DelayBursts(count) => self.delay_bursts = count,
            ToBus::TearBurst => self.tear_bursts = 1,
            ToBus::LoseSyncs(count) => self.lose_syncs = count,
            ToBus::Unplug(cycles) => self.unplugged = cycles,
            ToBus::Condition(place) => match BusFault::ALL.get(place) {
                // A port tells by an error that its bus carries nothing any more.
                Some(fault) if fault.severity() == Severity::Lose => self.unplugged = 1,
                fault => self.condition = fault.copied(),
            },
            ToBus::Incoming(tampering) => self.tampering.push(tampering),
            ToBus::Intruder(id, data, count) => {
                let frame = Frame::new(CanId::Standard(id & 0x7FF), &data);
                self.intruder = Some((frame, count));
            }
            ToBus::Nmt(command, node) => self.nmt = Some(Frame::new(CobId::NMT, &[command, node])),
            ToBus::SecondNode(node, count) => self.second = Some((node, count)),
        }
    }

    /// Nothing happens to it any more. What waits to be sent or handed on is so with the next.
    pub(in crate::campaign) fn mend(&mut self) {
        (self.drop_bursts, self.delay_bursts, self.tear_bursts) = (0, 0, 0);
        (self.lose_syncs, self.unplugged) = (0, 0);
        self.condition = None;
        self.tampering.clear();
        (self.intruder, self.nmt, self.second) = (None, None, None);
    }

    fn check(&self) -> Result<(), PortError> {
        if self.unplugged == 0 {
            return Ok(());
        }
        Err(PortError {
            bus: "campaign".into(),
            what: "unplugged".into(),
        })
    }

    /// What becomes of a frame that comes in: handed on as often as it says.
    fn tamper(&mut self, received: &mut Received) -> usize {
        let frame = received.frame;
        let ours = |it: &&mut Tampering| it.count > 0 && it.traffic.matches(it.node, &frame);
        let Some(tampering) = self
            .tampering
            .iter_mut()
            .find(ours)
            .filter(|_| !received.echo)
        else {
            return 1;
        };
        tampering.count -= 1;
        match tampering.change {
            Change::Lose => 0,
            Change::Delay => {
                self.delayed.push(*received);
                0
            }
            Change::Duplicate => 2,
            Change::Corrupt(_) | Change::Begin(_) | Change::Cut(_) => {
                let mut data = frame.data().to_vec();
                match tampering.change {
                    Change::Corrupt(bit) if data.len() > usize::from(bit / 8) => {
                        data[usize::from(bit / 8)] ^= 1 << (bit % 8);
                    }
                    Change::Begin(byte) if !data.is_empty() => data[0] = byte,
                    Change::Cut(length) => data.truncate(length.into()),
                    _ => {}
                }
                received.frame = Frame::new(frame.id(), &data);
                1
            }
        }
    }
}

/// What a node sends that has not been set up, with the identifier of that frame.
fn of_another(frame: &Frame) -> Frame {
    let CanId::Standard(id) = frame.id() else {
        return *frame;
    };
    let mut data = vec![0; frame.data().len()];
    let begins: &[u8] = match id >> 7 {
        // Switch On Disabled, Pre-Operational, and a general abort.
        0x3 => &[0x50, 0x02],
        0xE => &[0x7F],
        0xB => &[0x80, 0, 0, 0, 0, 0, 0, 0x08],
        _ => &[],
    };
    for (byte, begin) in data.iter_mut().zip(begins) {
        *byte = *begin;
    }
    Frame::new(frame.id(), &data)
}

/// One less, if there is one.
fn take_one(count: &mut u32) -> bool {
    let some = *count > 0;
    *count = count.saturating_sub(1);
    some
}

impl Port for TroubledPort {
    fn simulated(&self) -> Option<BusId> {
        self.port.simulated()
    }

    fn exchange(&mut self, world: &mut World) {
        if let (Some(frame), Some(bus)) = (self.nmt.take(), self.simulated()) {
            world.intrude(bus, frame);
        }
        self.port.exchange(world);
    }

    fn echoes(&self) -> bool {
        self.port.echoes()
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        let gone = self.check();
        take_one(&mut self.unplugged);
        let mut came = take(&mut self.delayed);
        self.port.receive(&mut |received| came.push(received))?;
        gone?;
        if let Some((frame, count)) = &mut self.intruder
            && take_one(count)
            && let Some(last) = came.last()
        {
            came.push(Received {
                at: last.at,
                frame: *frame,
                echo: false,
            });
        }
        for mut received in came {
            let (frame, came_in) = (received.frame, !received.echo);
            for _ in 0..self.tamper(&mut received) {
                sink(received);
            }
            let kinds = [
                Traffic::TPdo,
                Traffic::Heartbeat,
                Traffic::Emergency,
                Traffic::Sdo,
            ];
            if let Some((node, count)) = &mut self.second
                && came_in
                && kinds.iter().any(|kind| kind.matches(*node, &frame))
                && take_one(count)
            {
                sink(Received {
                    frame: of_another(&frame),
                    ..received
                });
            }
        }
        Ok(())
    }

    fn condition(&mut self) -> Option<BusFault> {
        self.condition.take()
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.check()?;
        if !take_one(&mut self.lose_syncs) {
            self.port.send_sync(frame)?;
        }
        self.port.send_burst(&take(&mut self.late))?;
        Ok(())
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        self.check()?;
        if take_one(&mut self.drop_bursts) {
            Ok(Burst::Dropped)
        } else if take_one(&mut self.tear_bursts) && frames.len() > 1 {
            self.port.send_burst(&frames[..1])?;
            Ok(Burst::Torn { queued: 1 })
        } else if take_one(&mut self.delay_bursts) {
            self.late.extend(frames);
            Ok(Burst::Queued)
        } else {
            self.port.send_burst(frames)
        }
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        self.check()?;
        self.port.send_acyclic(frames)
    }
}
