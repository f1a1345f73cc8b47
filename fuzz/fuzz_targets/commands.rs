//! Commands to a session, as JSON and in any order, with time between them: each is answered, time goes on,
//! and the machine goes off in the end.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use std::sync::{Arc, LazyLock};
use syncline_canopen::time::Duration;
use syncline_controller::control::Layout;
use syncline_controller::machine::Machine;
use syncline_controller::observe::Observers;
use syncline_controller::observe::frames::SharedFrames;
use syncline_controller::port::sim::{SimPort, Simulated};
use syncline_controller::program::Programs;
use syncline_controller::run::Progress;
use syncline_controller::run::virtual_time::VirtualMachine;
use syncline_controller::session::{Command, Event, Session};
use syncline_drives::world::Observer;
use syncline_gcode::Tables;

/// Lines of an input at most.
const LINES: usize = 40;
/// Wake-ups in all before the machine is switched off.
const WAKE_UPS: u32 = 3000;
/// Wake-ups of one pause at most.
const PAUSE: u32 = 1000;
/// Wake-ups within which a machine that is switched off is off.
const GOES_OFF: u32 = 10_000;

static MACHINE: LazyLock<Machine> = LazyLock::new(|| {
    let text = include_str!("../../examples/xyz/machine.toml");
    Machine::parse(Path::new("machine.toml"), text).expect("an example")
});

fn session() -> Session<VirtualMachine<SimPort>> {
    let machine = &*MACHINE;
    let layout = Arc::new(Layout::new(machine).expect("an example"));
    let frames = SharedFrames::new(machine);
    let sent = frames.listen(machine);
    let observers = (0..machine.buses.len()).map(|bus| Some(Box::new(frames.observer(bus)) as Observer));
    let simulated = Simulated::new(machine, 0, observers, |_, _| ()).expect("all simulated");
    let ports = simulated.buses.iter().flatten();
    let ports = ports.map(|bus| SimPort::new(*bus)).collect();
    let timeline = VirtualMachine::staying_on(simulated.world, ports, Arc::clone(&layout), frames);
    let programs = Programs::with_tables(machine, Tables::default());
    let observers = Observers::new(machine, Some(sent), None, false);
    Session::staying_on(&layout, timeline, programs, observers)
}

fuzz_target!(|text: &str| {
    let mut session = session();
    let operator = session.operator("fuzz");
    let told = session.subscribe();
    let mut answered = 0;
    let mut left = WAKE_UPS;
    let mut taken = 0;
    let advance = |session: &mut Session<_>, answered: &mut u32| {
        let goes_on = session.advance() != Progress::Ended;
        for event in told.events() {
            *answered += u32::from(matches!(event, Event::Accepted(_) | Event::Refused(_)));
        }
        goes_on
    };
    for line in text.lines().take(LINES) {
        // A line is a number of wake-ups to wait for, or a command.
        if let Ok(pause) = line.parse::<u32>() {
            for _ in 0..pause.min(PAUSE).min(left) {
                left -= 1;
                if !advance(&mut session, &mut answered) {
                    return;
                }
            }
        } else if let Ok(command) = serde_json::from_str::<Command>(line) {
            // What is on this host is no business of a random input.
            let opens = matches!(command, Command::Load(_));
            taken += u32::from(!opens && operator.command(command).is_ok());
        }
    }
    let before = session.timeline().now();
    taken += u32::from(operator.command(Command::SwitchOff).is_ok());
    for _ in 0..GOES_OFF {
        if !advance(&mut session, &mut answered) {
            assert!(answered <= taken, "{answered} answers to {taken} commands");
            return;
        }
    }
    let now = session.timeline().now();
    assert!(now > before + Duration::from_millis(1), "virtual time stands still");
    panic!("it does not go off");
});
