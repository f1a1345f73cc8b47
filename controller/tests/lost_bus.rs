//! A machine on two buses, one of which is lost.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant, NodeId};
use syncline_controller::bench::rig::{Shape, Shuttle, ready_machine};
use syncline_controller::control::{End, Fault};
use syncline_controller::port::{Burst, Port, PortError, Received};

const CYCLE: Duration = Duration::from_millis(2);

/// A bus that can be unplugged, and what went over it.
struct Plug {
    port: Box<dyn Port + Send>,
    unplugged: Arc<AtomicBool>,
    seen: Arc<Mutex<Vec<Frame>>>,
}

impl Plug {
    fn check(&self, frames: &[Frame]) -> Result<(), PortError> {
        if self.unplugged.load(Relaxed) {
            return Err(PortError {
                bus: "plug".into(),
                what: "unplugged".into(),
            });
        }
        self.seen.lock().unwrap().extend(frames);
        Ok(())
    }
}

impl Port for Plug {
    fn advance_to(&mut self, now: Instant) {
        self.port.advance_to(now);
    }
    fn echoes(&self) -> bool {
        self.port.echoes()
    }
    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        self.check(&[])?;
        let mut seen = self.seen.lock().unwrap();
        self.port.receive(&mut |received| {
            if !received.echo {
                seen.push(received.frame);
            }
            sink(received);
        })
    }
    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.check(&[*frame])?;
        self.port.send_sync(frame)
    }
    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        self.check(frames)?;
        self.port.send_burst(frames)
    }
    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        self.check(frames)?;
        self.port.send_acyclic(frames)
    }
}

/// The first words of all frames with that identifier.
fn words(frames: &[Frame], id: CobId) -> Vec<u16> {
    let frames = frames.iter().filter(|frame| frame.id() == CanId::from(id));
    let word = |frame: &Frame| u16::from_le_bytes([frame.data()[0], frame.data()[1]]);
    frames.map(word).collect()
}

#[test]
fn whichever_bus_is_lost_the_other_is_stopped_and_disabled_in_order() {
    for lost in [0, 1] {
        let shape = Shape {
            axes: 2,
            buses: 2,
            period: CYCLE,
        };
        let mut machine = ready_machine::<9>(&shape);
        let mut plan = Shuttle::new(2);
        let mut plugs = Vec::new();
        machine.ports = std::mem::take(&mut machine.ports)
            .into_iter()
            .map(|port| -> Box<dyn Port + Send> {
                let plug = Plug {
                    port,
                    unplugged: Arc::default(),
                    seen: Arc::default(),
                };
                plugs.push((Arc::clone(&plug.unplugged), Arc::clone(&plug.seen)));
                Box::new(plug)
            })
            .collect();
        let mut last = [0.0; 2];
        let mut steps = 0;
        while let Some(wake) = machine.controller.next_wake() {
            steps += 1;
            assert!(steps < 60_000, "no end: {:?}", machine.controller.end());
            while machine.controller.room() > 0 {
                machine.controller.accept(plan.instruction());
            }
            let _ = machine.step(wake.at());
            if let Some(row) = machine.controller.row() {
                last = [row.plan.velocity[0], row.plan.velocity[1]];
            }
            if steps == 1001 {
                assert!(last[1].abs() > 1.0, "in motion: {last:?}");
                plugs
                    .iter()
                    .for_each(|(_, seen)| seen.lock().unwrap().clear());
                plugs[lost].0.store(true, Relaxed);
            }
        }
        let end = machine.controller.end();
        assert!(
            matches!(end, Some(End::Fault(Fault::BusFailed { bus })) if bus == lost),
            "{end:?}"
        );
        assert_eq!(last, [0.0; 2], "at rest");

        let node = NodeId::new(1).unwrap();
        let seen = plugs[1 - lost].1.lock().unwrap();
        let syncs = (seen.iter()).filter(|frame| frame.id() == CanId::from(CobId::SYNC));
        let mut commands = words(&seen, CobId::r_pdo(2, node));
        let syncs = syncs.count();
        let cycles = (steps - 1001) / 2;
        assert!(
            syncs.abs_diff(cycles) < 10,
            "{syncs} SYNCs in {cycles} cycles"
        );
        let heartbeat = CobId::error_control(NodeId::new(127).unwrap());
        assert!(
            seen.iter()
                .any(|frame| frame.id() == CanId::from(heartbeat))
        );
        commands.dedup();
        assert!(commands.ends_with(&[0x0006, 0x0000]), "{commands:04X?}");
        let status = words(&seen, CobId::t_pdo(2, node)).pop().unwrap();
        // Neither switched on nor operation enabled: the power stage is off.
        assert_eq!(status & 0x0006, 0, "{status:04X}");
    }
}
