//! Machine files: a mistake is told, and a machine that is accepted can be laid out and simulated.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use syncline_controller::budget::MachineBudget;
use syncline_controller::control::Layout;
use syncline_controller::machine::Machine;
use syncline_controller::port::sim::Simulated;

fuzz_target!(|text: &str| {
    match Machine::parse(Path::new("machine.toml"), text) {
        Err(mistakes) => assert!(mistakes.to_string().contains("machine.toml:")),
        Ok(machine) => {
            let _ = MachineBudget::of(&machine).check();
            let _ = Layout::new(&machine);
            let _ = Simulated::new(&machine, 0, machine.buses.iter().map(|_| None), |_, _| ());
            assert!(machine.rest().iter().all(|it| it.is_finite()));
        }
    }
});
