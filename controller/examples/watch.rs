//! An operator and an observer at one session: one commands an override, the other watches how fast
//! the tool goes. `cargo run -p syncline-controller --example watch`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use syncline_controller::control::Layout;
use syncline_controller::machine::Machine;
use syncline_controller::observe::Observers;
use syncline_controller::program::Program;
use syncline_controller::run::Progress;
use syncline_controller::run::virtual_time::VirtualMachine;
use syncline_controller::session::{Command, Event, Override, Session, Status};

/// Watches the speed of the tool; it changes nothing.
#[derive(Debug, Default)]
struct FastestPlace {
    /// mm/s
    speed: f64,
    line: u32,
}

impl FastestPlace {
    fn observe(&mut self, status: &Status) {
        let [x, y, z, ..] = status.velocity;
        let speed = (x * x + y * y + z * z).sqrt();
        if speed > self.speed {
            *self = Self {
                speed,
                line: status.line,
            };
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/xyz");
    let (file, part) = (folder.join("machine.toml"), folder.join("rosette.ngc"));
    let machine = Machine::load(&file)?;
    let layout = Arc::new(Layout::new(&machine)?);
    let program = Program::new(&part, &machine, &file)?;
    let (timeline, moves) = VirtualMachine::new(&machine, Arc::clone(&layout), program, 0)?;
    let sent = timeline.frames().listen(&machine);
    let observers = Observers::new(&machine, Some(sent), None, false);
    let mut session = Session::new(&layout, timeline, moves, observers);

    let operator = session.operator("example");
    operator.command(Command::FeedOverride(Override::To(50.0)))?;
    let told = session.subscribe();
    let mut fastest = FastestPlace::default();
    while session.advance() != Progress::Ended {
        fastest.observe(session.status());
        for event in told.events() {
            if let Event::Accepted(it) = event {
                println!("cycle {}: {}: {:?}", it.cycle, it.source, it.command);
            }
        }
    }
    println!("{:.1} mm/s in line {}", fastest.speed, fastest.line);
    assert!(fastest.speed > 0.0);
    Ok(())
}
