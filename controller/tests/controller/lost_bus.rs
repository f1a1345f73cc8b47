//! A machine on two buses, one of which is lost, or says that it may be soon.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, NodeId};
use syncline_controller::bench::rig::{Shape, Shuttle, ready_machine};
use syncline_controller::bus::BusFault;
use syncline_controller::bus::{Burst, Received};
use syncline_controller::control::fault::BusCause;
use syncline_controller::control::{End, Event, Fault};
use syncline_controller::port::{Port, PortError};
use syncline_controller::run::driver::Driver;
use syncline_drives::model::REFERENCE;
use syncline_drives::world::{BusId, World};

const CYCLE: Duration = Duration::from_millis(2);

/// A bus that can be unplugged, and what went over it.
struct Plug {
    port: Box<dyn Port + Send>,
    test: Arc<Test>,
}

/// The test's end of it.
#[derive(Default)]
struct Test {
    unplugged: AtomicBool,
    reports: Mutex<Option<BusFault>>,
    seen: Mutex<Vec<Frame>>,
}

impl Plug {
    fn check(&self, frames: &[Frame]) -> Result<(), PortError> {
        if self.test.unplugged.load(Relaxed) {
            return Err(PortError {
                bus: "plug".into(),
                what: "unplugged".into(),
            });
        }
        self.test.seen.lock().unwrap().extend(frames);
        Ok(())
    }
}

impl Port for Plug {
    fn simulated(&self) -> Option<BusId> {
        self.port.simulated()
    }
    fn exchange(&mut self, world: &mut World) {
        self.port.exchange(world);
    }
    fn echoes(&self) -> bool {
        self.port.echoes()
    }
    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        self.check(&[])?;
        let mut seen = self.test.seen.lock().unwrap();
        self.port.receive(&mut |received| {
            if !received.echo {
                seen.push(received.frame);
            }
            sink(received);
        })
    }
    fn condition(&mut self) -> Option<BusFault> {
        self.test.reports.lock().unwrap().take()
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

/// One axis on each of two buses, and all that happens to it.
struct Machine {
    driver: Driver<9, Box<dyn Port + Send>>,
    plan: Shuttle<9>,
    buses: Vec<Arc<Test>>,
    /// Wake-ups.
    steps: usize,
    velocity: [f64; 2],
    warnings: Vec<(usize, BusFault)>,
}

impl Machine {
    /// In mid-motion.
    fn moving() -> Self {
        let shape = Shape {
            model: REFERENCE,
            axes: 2,
            buses: 2,
            period: CYCLE,
        };
        let mut driver = ready_machine::<9>(&shape);
        let buses: Vec<Arc<Test>> = (0..2).map(|_| Arc::default()).collect();
        let ports = std::mem::take(&mut driver.ports).into_iter().zip(&buses);
        driver.ports = ports
            .map(|(port, test)| -> Box<dyn Port + Send> {
                let test = Arc::clone(test);
                Box::new(Plug { port, test })
            })
            .collect();
        let mut machine = Self {
            driver,
            plan: Shuttle::new(2),
            buses,
            steps: 0,
            velocity: [0.0; 2],
            warnings: Vec::new(),
        };
        machine.run(1001);
        assert!(machine.velocity[1].abs() > 1.0, "{:?}", machine.velocity);
        for bus in &machine.buses {
            bus.seen.lock().unwrap().clear();
        }
        machine.steps = 0;
        machine
    }

    /// Runs it for so many wake-ups, or to its end.
    fn run(&mut self, most: usize) {
        for _ in 0..most {
            let Some(wake) = self.driver.controller.next_wake() else {
                return;
            };
            while self.driver.controller.room() > 0 {
                self.driver.controller.accept(self.plan.instruction());
            }
            let _ = self.driver.step(wake.at());
            self.steps += 1;
            let controller = &mut self.driver.controller;
            if let Some(row) = controller.row() {
                self.velocity = [row.plan.velocity[0], row.plan.velocity[1]];
            }
            while let Some(event) = controller.event() {
                if let Event::BusWarning { bus, fault } = event {
                    self.warnings.push((bus, fault));
                }
            }
        }
    }

    /// Runs it to its end, which comes soon.
    fn finish(&mut self) -> Option<End> {
        self.run(2_000);
        let controller = &self.driver.controller;
        assert_eq!(controller.next_wake(), None, "{:?}", controller.phase());
        assert_eq!(self.velocity, [0.0; 2], "at rest");
        controller.end()
    }

    /// The drive of a bus was disabled in order, and had SYNC and heartbeats all the way.
    fn assert_disabled_in_order(&self, bus: usize) {
        let node = NodeId::new(1).unwrap();
        let seen = self.buses[bus].seen.lock().unwrap();
        let syncs = (seen.iter()).filter(|frame| frame.id() == CanId::from(CobId::SYNC));
        let (syncs, cycles) = (syncs.count(), self.steps / 2);
        assert!(
            syncs.abs_diff(cycles) < 10,
            "{syncs} SYNCs in {cycles} cycles"
        );
        let heartbeat = CobId::error_control(NodeId::new(127).unwrap());
        assert!(
            seen.iter()
                .any(|frame| frame.id() == CanId::from(heartbeat))
        );
        let mut commands = words(&seen, CobId::r_pdo(2, node));
        commands.dedup();
        assert!(commands.ends_with(&[0x0006, 0x0000]), "{commands:04X?}");
        let status = words(&seen, CobId::t_pdo(2, node)).pop().unwrap();
        // Neither switched on nor operation enabled: the power stage is off.
        assert_eq!(status & 0x0006, 0, "{status:04X}");
    }
}

/// The drive out of reach is not waited for.
#[test]
fn whichever_bus_is_lost_the_other_is_stopped_and_disabled_in_order() {
    for lost in [0, 1] {
        let mut machine = Machine::moving();
        machine.buses[lost].unplugged.store(true, Relaxed);
        let end = machine.finish();
        assert_eq!(end, Some(End::Fault(Fault::Bus(lost, BusCause::Failed))));
        machine.assert_disabled_in_order(1 - lost);
    }
}

#[test]
fn an_error_warning_is_told_and_error_passive_stops_in_order() {
    let mut machine = Machine::moving();
    *machine.buses[1].reports.lock().unwrap() = Some(BusFault::ErrorWarning);
    machine.run(100);
    assert_eq!(machine.warnings, [(1, BusFault::ErrorWarning)]);
    assert_eq!(machine.driver.controller.end(), None);
    *machine.buses[1].reports.lock().unwrap() = Some(BusFault::ErrorPassive);
    let end = machine.finish();
    assert_eq!(end, Some(End::Fault(Fault::Bus(1, BusCause::ErrorPassive))));
    machine.assert_disabled_in_order(0);
    machine.assert_disabled_in_order(1);
}
