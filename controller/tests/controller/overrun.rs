//! Wake-ups on the host's clock that come late: what made them so is told.

use std::mem::take;
use syncline_canopen::Frame;
use syncline_canopen::time::Duration;
use syncline_controller::bus::{Burst, Received};
use syncline_controller::control::Layout;
use syncline_controller::machine::Machine as MachineFile;
use syncline_controller::port::{Port, PortError};
use syncline_controller::realtime;
use syncline_controller::run::real_time::{Cycle, Pace, Timing};
use syncline_drives::world::{BusId, World};

const CYCLE: Duration = Duration::from_millis(2);

/// A bus that the next acyclic frames take long to be handed to.
struct Slow {
    port: Box<dyn Port + Send>,
    delay: Duration,
}

impl Port for Slow {
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
        self.port.receive(sink)
    }
    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.port.send_sync(frame)
    }
    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        self.port.send_burst(frames)
    }
    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        std::thread::sleep(take(&mut self.delay));
        self.port.send_acyclic(frames)
    }
}

#[test]
fn the_stage_that_made_a_wake_up_late_is_told() {
    let file = std::path::Path::new("../examples/portal/machine.toml");
    let machine = MachineFile::load(file).unwrap();
    let layout = std::sync::Arc::new(Layout::new(&machine).unwrap());
    let (world, mut ports) =
        syncline_controller::port::open(&machine, 0, vec![Box::new(|_| ())]).unwrap();
    let slow = Slow {
        port: ports.remove(0),
        delay: 20 * CYCLE,
    };
    let timing = Timing {
        settings: realtime::Settings {
            priority: 1,
            core: None,
        },
        spin: Duration::ZERO,
        pace: Pace::Lockstep,
        strict: false,
    };
    let (cycle, link, instructions) = Cycle::new(&layout, world, vec![Box::new(slow)], timing);
    // Nobody is there: it begins its way down at once.
    drop((link, instructions));
    let (_, measured) = cycle.run(|_| ());
    let [_, receive, compute, send] = measured.late_by;
    assert!(send >= 1, "{:?}", measured.late_by);
    assert_eq!([receive, compute], [0, 0]);
    assert_eq!(measured.late_by.iter().sum::<u64>(), measured.late);
    assert!(measured.worst.to_string().ends_with("us: send"));
    assert!(measured.worst.send >= 20 * CYCLE);
}
