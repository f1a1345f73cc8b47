//! A machine's state file: what is read is written, and read again as the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use std::sync::LazyLock;
use syncline_controller::control::Layout;
use syncline_controller::machine::{Machine, MachineState};

static MACHINE: LazyLock<Machine> = LazyLock::new(|| {
    let text = include_str!("../../examples/xyz/machine.toml");
    Machine::parse(Path::new("machine.toml"), text).expect("an example")
});

fuzz_target!(|text: &[u8]| {
    if let Ok(state) = serde_json::from_slice::<MachineState>(text) {
        let layout = Layout::new(&MACHINE).expect("an example");
        let _ = layout.recalling(&MACHINE, &state);
        let written = serde_json::to_vec(&state).expect("it can be written");
        let again = serde_json::from_slice::<MachineState>(&written);
        assert_eq!(again.expect("what was written is read"), state);
    }
});
