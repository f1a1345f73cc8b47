//! Simulated drives on a clock that did not begin with them.

use std::path::Path;
use std::sync::{Arc, Mutex};
use syncline_canopen::time::Duration;
use syncline_canopen::{Frame, Instant};
use syncline_controller::control::{Layout, Wake};
use syncline_controller::machine::Machine;
use syncline_controller::port::sim::{SimPort, Simulated};
use syncline_controller::run::driver::Driver;
use syncline_drives::world::Observer;

const MACHINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/portal/machine.toml"
);

/// What the portal's bus carries in its first cycles if it is switched on at `start`: when since
/// then, and what.
fn frames(start: Duration) -> Vec<(Duration, Frame)> {
    let machine = Machine::load(Path::new(MACHINE)).unwrap();
    let layout = Arc::new(Layout::new(&machine).unwrap());
    let seen = Arc::new(Mutex::new(Vec::new()));
    let observed = Arc::clone(&seen);
    let observer: Observer = Box::new(move |frame| {
        let since = (frame.start - Instant::ZERO).checked_sub(start);
        let since = since.expect("no frame before the drives are switched on");
        observed.lock().unwrap().push((since, frame.frame));
    });
    let start = Instant::ZERO + start;
    let simulated = Simulated::new(&machine, 0, [Some(observer)], |_, _| ()).unwrap();
    let ports = vec![SimPort::new(simulated.buses[0].unwrap())];
    let mut driver = Driver::<9, _>::new(layout, simulated.world, ports, start);
    for _ in 0..1000 {
        let now = driver.controller.next_wake().map(Wake::at).unwrap();
        for (_, received) in driver.collect(now).unwrap() {
            assert!((start..=now).contains(&received.at), "{received:?}");
        }
        driver.compute(now);
        driver.send().unwrap();
    }
    let seen = seen.lock().unwrap();
    seen.clone()
}

#[test]
fn a_machine_that_is_switched_on_later_sends_the_same_later() {
    let first = frames(Duration::ZERO);
    assert!(first.len() > 100, "{} frames", first.len());
    assert!(frames(Duration::from_secs(100)) == first);
}
