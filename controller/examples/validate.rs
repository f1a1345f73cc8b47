//! Validates a program on a machine: the real controller on simulated drives, in virtual time.
//! `cargo run -p syncline-controller --example validate`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use syncline_controller::control::Layout;
use syncline_controller::machine::Machine;
use syncline_controller::observe::Observers;
use syncline_controller::program::Program;
use syncline_controller::run::Progress;
use syncline_controller::run::virtual_time::VirtualMachine;
use syncline_controller::session::Session;

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
    while session.advance() != Progress::Ended {}
    let (mut timeline, observers) = session.end();
    let frames = Some(timeline.frames().result());
    let (summary, _) = observers.finish(&machine, &layout, timeline.controller(), frames)?;

    print!("{summary}");
    assert_eq!(summary.verdict, "pass");
    Ok(())
}
