//! Mechanics that tie drives together need one clock for all of them.

use std::path::Path;
use syncline_canopen::Instant;
use syncline_controller::machine::Machine;
use syncline_controller::port::sim::{self, Simulated};
use syncline_controller::validate::Inputs;
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

/// Wherever a seed puts the axes and the skew of a gantry, it is in the ranges of the file, the same for the same seed, and
/// the machine homes from there.
#[test]
fn a_seed_draws_where_axes_stand() {
    let file = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/router/machine.toml"
    ));
    let text = std::fs::read_to_string(file).unwrap();
    let drawn = "start_within = [-10.0, 700.0]\nstart_skew_within = [-2.0, 2.0]";
    let text = text.replacen("start = 180.0", drawn, 1);
    let machine = Machine::parse(file, &text).unwrap();
    let x = &machine.axes[0];
    let places: Vec<[f64; 2]> = (0..64)
        .map(|seed| {
            let [first, second] = [0, 1].map(|side| x.stands(side, seed));
            assert_eq!([x.stands(0, seed), x.stands(1, seed)], [first, second]);
            for (side, place) in [first, second].into_iter().enumerate() {
                let drive = &machine.drives[x.drives[side]].scaling;
                let turns = drive.to_revolutions(drive.to_increments(place).unwrap());
                let config = sim::config(&machine, x.drives[side], seed);
                assert_eq!(config.position, turns, "seed {seed}, side {side}");
            }
            [first, second - first]
        })
        .collect();
    for (which, (least, most)) in [(-10.0, 700.0), (-2.0, 2.0)].into_iter().enumerate() {
        let mut all: Vec<f64> = places.iter().map(|it| it[which]).collect();
        all.sort_by(f64::total_cmp);
        assert!(least <= all[0] && all[63] <= most, "{all:?}");
        let reach = (all[63] - all[0]) / (most - least);
        assert!(reach > 0.8, "{all:?}");
        assert!(all.windows(2).all(|two| two[0] < two[1]), "{all:?}");
    }
    // The axes that are not drawn stand where they are said to.
    assert_eq!(machine.axes[1].stands(0, 5), machine.axes[1].stands(0, 6));
    let folder = tempfile::tempdir().unwrap();
    let (file, program) = (folder.path().join("m.toml"), folder.path().join("p.ngc"));
    std::fs::write(&file, &text).unwrap();
    std::fs::write(&program, "G0 X100 Y50\nM2\n").unwrap();
    let inputs = Inputs::read(&file, &[], None).unwrap();
    for seed in 0..3 {
        let program = inputs.programs.file(&program);
        let (summary, _) = inputs.validate(program, seed, false, |_| true).unwrap();
        assert_eq!(
            summary.verdict, "pass",
            "seed {seed}: {:?}",
            summary.violations
        );
    }
}
