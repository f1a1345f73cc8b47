//! Mechanics that tie drives together need one clock for all of them.

use std::path::Path;
use syncline_canopen::Instant;
use syncline_controller::machine::Machine;
use syncline_controller::port::sim::{self, Simulated};
use syncline_drives::world::Observer;

/// The portal with its gantry's sides on a beam, each on a bus of its own.
fn gantry_on_two_buses() -> Machine {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/portal/machine.toml"
    );
    let text = std::fs::read_to_string(file).unwrap();
    let replace = |text: String, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    let text = replace(
        text,
        "[[bus]]",
        "[[bus]]\nname = \"far\"\nbitrate = 1_000_000\nport = \"can7\"\n\n[[bus]]",
    );
    let text = replace(
        text,
        "bus = \"portal\"\nnode = 2",
        "bus = \"far\"\nnode = 2",
    );
    let text = replace(
        text,
        "skew_limit = 0.5",
        "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
         span = 1500 }",
    );
    Machine::parse(Path::new("machine.toml"), &text).unwrap()
}

fn observer() -> Option<Observer> {
    Some(Box::new(|_| ()))
}

#[test]
fn a_twin_is_told_what_the_machine_file_knows_of_its_model() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/portal/machine.toml"
    );
    let model = "\n[model.lxm32m]\nsync_locked = 77\n";
    let text = std::fs::read_to_string(file).unwrap() + model;
    let machine = Machine::parse(Path::new("machine.toml"), &text).unwrap();
    let config = sim::config(&machine, 0, 0);
    assert_eq!(config.assumed("sync_locked"), Some(77));
    assert_eq!(config.assumed("no_such_thing"), None);
}

#[test]
fn a_beam_may_span_two_simulated_buses() {
    let machine = gantry_on_two_buses();
    let simulated = Simulated::new(&machine, 0, [observer(), observer()], |_, _| ()).unwrap();
    assert!(simulated.devices.iter().all(Option::is_some));
}

#[test]
fn a_beam_between_a_simulated_drive_and_another_is_refused_by_name() {
    let machine = gantry_on_two_buses();
    let refused = Simulated::new(&machine, 0, [None, observer()], |_, _| ());
    let text = refused.err().unwrap().to_string();
    for part in [
        "axis X: rigid_beam",
        "X1 on bus portal (port sim)",
        "X2 on bus far (port can7)",
        "take `simulation` out",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Neither is simulated here: others see to their mechanics.
    assert!(Simulated::new(&machine, 0, [None, None], |_, _| ()).is_ok());
    for bus in 0..2 {
        let text = sim::hosted(&machine, bus, 0, |_| ())
            .err()
            .unwrap()
            .to_string();
        assert!(text.contains("X1 on bus portal"), "{text}");
    }
}

/// What a machine file says of the weight of a gantry it says of its beam, however many motors carry it: it falls as its mass and
/// rotors say.
#[test]
fn a_beam_falls_by_its_own_weight() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/portal/machine.toml"
    );
    let text = std::fs::read_to_string(file).unwrap().replace(
        "skew_limit = 0.5",
        "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, span = 1500, gravity = 300, \
         rotor_inertia = 2e-3, motor_friction = 0, motor_viscous_friction = 0, brake_torque = 0 }",
    );
    let machine = Machine::parse(Path::new("machine.toml"), &text).unwrap();
    let Simulated {
        mut world, devices, ..
    } = Simulated::new(&machine, 0, [observer()], |_, _| ()).unwrap();
    world.advance_to(Instant::ZERO);
    world.advance_to(Instant::from_nanos(100_000_000));
    // 20 mm for a turn of the motor.
    let travel = 0.02 / core::f64::consts::TAU;
    let acceleration = 300.0 / (80.0 + 2.0 * 2e-3 / (travel * travel));
    for (side, direction) in [(0, 1.0), (1, -1.0)] {
        let seen = world.device(devices[side].unwrap()).observe();
        let time = (seen.at.unwrap() - Instant::ZERO).as_secs_f64();
        let speed = seen.velocity * direction * 0.02;
        assert!(
            (speed / (acceleration * time) - 1.0).abs() < 1e-9,
            "{speed} m/s"
        );
    }
}
