//! The machine file as people write it, well and badly.

use proptest::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;
use syncline_controller::budget::{DoesNotFit, MachineBudget};
use syncline_controller::machine::{
    AnalogSource, AxisLimits, HomingMethod, InputMeaning, Machine, Motion, OutputSwitch, TestMove,
};
use syncline_drives::model::{Increments, MODELS};
use syncline_strict_toml::{Diagnostic, Invalid};

const PORTAL: &str = include_str!("../../../examples/portal/machine.toml");
const CSP: &str = include_str!("../../../examples/csp/machine.toml");
const XYZ: &str = include_str!("../../../examples/xyz/machine.toml");

fn parse(text: &str) -> Result<Machine, Invalid> {
    Machine::parse(Path::new("machine.toml"), text)
}

/// The portal's file with its first `from` replaced.
fn portal_with(from: &str, to: &str) -> String {
    assert!(PORTAL.contains(from), "{from}");
    PORTAL.replacen(from, to, 1)
}

#[test]
fn the_portal() {
    let machine = parse(PORTAL).unwrap();
    assert_eq!(machine.cycle, Duration::from_millis(2));
    assert_eq!(machine.controller.node.get(), 127);
    assert_eq!(machine.buses[0].bitrate, 1_000_000);
    let names: Vec<_> = machine.axes.iter().map(|axis| axis.name()).collect();
    assert_eq!(names, ["X", "Y", "Z"]);
    assert_eq!(machine.axes[0].drives, [0, 1]);
    assert_eq!(machine.axes[0].limits.skew, Some(0.5));
    assert_eq!(machine.axes[1].limits.skew, None);
    assert_eq!(machine.axes[0].mm_per_revolution, 20.0);

    // One turn of the motor is 20 mm; the second side is mirrored.
    let position = |drive: usize, mm| machine.drives[drive].scaling.to_increments(mm).unwrap();
    assert_eq!(position(0, 20.0), Increments::new(1_250_000 + 131_072));
    assert_eq!(position(1, 20.0), Increments::new(-843_776 - 131_072));

    // 6065h and 607Dh as each side counts: 2 mm further out than the soft limits.
    let setup = |drive: usize| machine.device(drive).spec().setup[30..33].to_vec();
    let shown: Vec<_> = setup(1)
        .iter()
        .map(|write| (write.address.to_string(), write.data.bits() as i32))
        .collect();
    let increments = |mm: f64| (mm / 20.0 * 131_072.0).round() as i32;
    assert_eq!(
        shown,
        [
            ("6065h:0".into(), increments(2.0) + 1), // 13107.2, up
            ("607Dh:1".into(), -843_776 - increments(1502.0)),
            ("607Dh:2".into(), -843_776 + increments(2.0)),
        ]
    );
}

/// The figures of the load as the motor feels them: 5 mm a revolution, and a drive that counts the
/// other way.
#[test]
fn a_simulated_axis_is_seen_at_its_shaft() {
    let text = XYZ.replacen(
        "max_velocity = 200.0",
        "max_velocity = 200.0\nsimulation = { motor = \"generic-3\", load = 50, transmission = \"screw\", \
         stiffness = 80, damping = 0.05, play = 0.01, friction = 30, breakaway_friction = 45, \
         stribeck_velocity = 3, viscous_friction = 200, gravity = -490.0, brake_torque = 7, \
         brake_opening_ms = 40, end_stops = [-160, 30], lead_error = [[-150, 0], [0, 20]], \
         temperature_rise = 20, fixed_at = -150, warming_time = 600, \
         transmission_inertia = 1e-4, encoder_noise = 0.3, encoder_steps = 65536 }",
        1,
    );
    let machine = parse(&text).unwrap();
    let axis = &machine.axes[0];
    let simulation = axis.simulation.as_ref().unwrap();
    let scaling = &machine.drives[axis.drives[0]].scaling;
    let at_shaft = simulation
        .axis
        .at_shaft(scaling, axis.mm_per_revolution, false);
    let (motor, train) = (at_shaft.motor, at_shaft.train);
    let travel = 5e-3 / TAU;
    let elasticity = train.elasticity.unwrap();
    let reduced = 3.8e-4 * 50.0 * travel * travel / (3.8e-4 + 50.0 * travel * travel);
    let decay = 0.5 * elasticity.damping / reduced;
    let (lower, upper) = train.stops.unwrap();
    for (what, found, expected) in [
        ("torque", motor.continuous_torque, 3.0),
        ("rotor", train.rotor_inertia, 3.8e-4),
        ("load", train.load_inertia, 50.0 * travel * travel),
        ("stiffness", elasticity.stiffness, 8e7 * travel * travel),
        (
            "damping",
            decay / (elasticity.stiffness / reduced).sqrt(),
            0.05,
        ),
        ("play", elasticity.play, 1e-5 / travel),
        ("friction", train.guide.coulomb, 30.0 * travel),
        ("breakaway", train.guide.breakaway, 45.0 * travel),
        ("its speed", train.guide.stribeck_speed, 3e-3 / travel),
        ("viscous", train.guide.viscous, 200.0 * travel * travel),
        // Z's drive turns the other way: up is negative.
        ("gravity", train.load_torque, 490.0 * travel),
        ("brake", train.brake.torque, 7.0),
        ("opening", train.brake.opening, 0.04),
        ("lower stop", lower, -0.03 / travel),
        ("upper stop", upper, 0.16 / travel),
        ("lead error", train.lead_error.at(15.0), -0.01 / 5.0),
        // 2.3 parts in 10000 of steel; Z's shaft turns backwards by 30 revolutions to -150 mm.
        ("expansion", train.expansion.at(0.0, 1e6), 2.3e-4 * -30.0),
        ("warming", train.expansion.time, 600.0),
    ] {
        assert!(
            (found / expected - 1.0).abs() < 1e-12,
            "{what}: {found}, expected {expected}"
        );
    }
    let encoder = simulation.encoder.unwrap();
    assert_eq!((encoder.noise, encoder.steps), (0.3, 65536));
    assert_eq!(machine.axes[1].simulation, None);
}

#[test]
fn nothing_is_wired_to_the_portal() {
    let machine = parse(XYZ).unwrap();
    assert_eq!(machine.cycle, Duration::from_millis(4));
    assert_eq!(machine.controller.node.get(), 64);
    let moves: Vec<_> = machine
        .axes
        .iter()
        .map(|axis| (axis.name(), machine.drives[axis.drives[0]].node.get()))
        .collect();
    assert_eq!(moves, [("Z", 33), ("X", 17), ("Y", 9)]);
    // What the file leaves out.
    assert_eq!(machine.buses[0].port, "sim");
    assert_eq!(machine.controller.t_pdo_misses, 2);
    assert_eq!((machine.path.exact, machine.path.blend), (0.001, 0.01));
    assert_eq!(machine.axes[0].limits.standstill, 0.1);
    let drive = machine.device(2);
    assert_eq!(drive.spec().setup[30].address.to_string(), "3012h:6");
    assert_eq!(drive.drive().unwrap().latency(), 1.0);
}

#[test]
fn a_rotary_axis_is_measured_in_degrees() {
    let text = include_str!("../../../examples/rotary/machine.toml");
    let axes = parse(text).unwrap().axes;
    assert_eq!((axes[3].name(), axes[3].units()[0]), ("A", "°"));
    assert_eq!(axes[3].mm_per_revolution, 6.0);
    // What the gear turns is not the axis itself, but a wheel that a belt leads to it.
    let belt = text.replace("gear = 60.0", "pitch = 90.0\ngear = 60.0");
    assert_eq!(parse(&belt).unwrap().axes[3].mm_per_revolution, 1.5);
    // Of one mistake, one complaint.
    let misnamed = text.replace("name = \"A\"\ndrives", "name = \"a\"\ndrives");
    let found = parse(&misnamed).unwrap_err();
    assert_eq!(found.diagnostics.len(), 1, "{found}");
    for (good, bad, allowed) in [
        ("= 180.0", "= 0", "a number from 0.001 to 1000000 (°/s)"),
        (
            "[-3600.0, 3600.0]",
            "[3600.0, -3600.0]",
            "machine position in degrees",
        ),
        (
            "[-3600.0, 3600.0]",
            "[-3600.0, 98700.0]",
            "revolution of 6 °",
        ),
    ] {
        let error = parse(&text.replace(good, bad)).unwrap_err().to_string();
        assert!(error.contains(allowed), "{bad}: {error}");
    }
}

/// One mistake each: what is replaced by what, with § before the place that must be named, how the
/// complaint begins and what it advises.
#[test]
fn every_mistake_is_found_named_and_placed() {
    let cases = [
        // Keys.
        (
            "max_velocity = 700.0",
            "§max_velocty = 700.0",
            "axis \"X\": unknown key `max_velocty`",
            "nearest valid key: `max_velocity`; allowed: name, drives, pitch",
        ),
        (
            "[machine]\nname = \"portal\"\ncycle_us = 2000\n",
            "§[machine]\nname = \"portal\"\n",
            "machine: missing key `cycle_us`",
            "add `cycle_us`: a whole number",
        ),
        (
            "[controller]",
            "[§controler]",
            "machine file: unknown key `controler`",
            "nearest valid key: `controller`; allowed: machine, controller, path, bus",
        ),
        (
            "[controller]",
            "[path]\n§exact_tolerence = 0.001\n[controller]",
            "path: unknown key `exact_tolerence`",
            "nearest valid key: `exact_tolerance`; allowed: exact_tolerance, blend_tolerance, mode",
        ),
        (
            "[controller]",
            "[path]\nmode = §\"G62\"\n[controller]",
            "path: `mode` is \"G62\"",
            "allowed: \"G61\", \"G61.1\" or \"G64\"; nearest: \"G61\"",
        ),
        (
            "[controller]",
            "[path]\nblend_tolerance = §0.0\n[controller]",
            "path: `blend_tolerance` is 0.0",
            "allowed: a number above 0 (mm)",
        ),
        (
            "node = 127",
            "node = 127\n§node = 5",
            "not TOML: duplicate key",
            "toml.io",
        ),
        (
            "[machine]",
            "[machine§",
            "not TOML: unclosed table",
            "toml.io",
        ),
        // Names.
        (
            "model = \"lxm32m\"",
            "model = §\"lxm23m\"",
            "drive \"X1\": `model` is \"lxm23m\"",
            "; nearest: \"lxm32m\"",
        ),
        (
            "bus = \"portal\"\nnode = 3",
            "bus = §\"potral\"\nnode = 3",
            "drive \"Y\": there is no bus \"potral\"",
            "nearest: \"portal\"",
        ),
        (
            "drives = [\"Y\"]",
            "drives = [§\"YY\"]",
            "axis \"Y\": there is no drive \"YY\"",
            "allowed: \"X1\", \"X2\", \"Y\" or \"Z\"; nearest: \"Y\"",
        ),
        (
            "drives = [\"Y\"]",
            "drives = [§\"X1\"]",
            "axis \"Y\": drive \"X1\" already moves axis \"X\"",
            "each drive once",
        ),
        (
            "name = \"X2\"",
            "name = §\"X1\"",
            "drive \"X1\": `name` is taken",
            "a name that no other [[drive]] has",
        ),
        (
            "name = \"Y\"\ndrives",
            "name = §\"X\"\ndrives",
            "axis \"X\": `name` is taken",
            "",
        ),
        (
            "name = \"Z\"\ndrives",
            "name = §\"Q\"\ndrives",
            "axis \"Q\": `name` is \"Q\"",
            "\"X\", \"Y\", \"Z\", \"A\", \"B\", \"C\", \"U\", \"V\" or \"W\"",
        ),
        (
            "drives = [\"X1\", \"X2\"]",
            "drives = §[]",
            "axis \"X\": `drives` is []",
            "one [[drive]], or of two",
        ),
        (
            "[[axis]]\nname = \"X\"",
            "[[drive]]\nname = §\"A\"\nbus = \"portal\"\nnode = 9\nmodel = \"lxm32m\"\n\n\
             [[axis]]\nname = \"X\"",
            "drive \"A\": no axis names it",
            "or remove it",
        ),
        // Nodes.
        (
            "node = 2",
            "node = §1",
            "drive \"X2\": node 1 is already X1 on bus \"portal\"",
            "each once on a bus",
        ),
        (
            "node = 2",
            "node = §127",
            "drive \"X2\": node 127 is already the controller on bus \"portal\"",
            "each once on a bus",
        ),
        (
            "node = 2",
            "node = §128",
            "drive \"X2\": `node` is 128",
            "a whole number 1…127",
        ),
        (
            "node = 2",
            "node = §\"2\"",
            "drive \"X2\": `node` is \"2\"",
            "a whole number 1…127",
        ),
        // Limits.
        (
            "max_velocity = 700.0",
            "max_velocity = §0",
            "axis \"X\": `max_velocity` is 0",
            "a number from 0.001 to 1000000 (mm/s)",
        ),
        (
            "max_acceleration = 3000.0",
            "max_acceleration = §-3000.0",
            "axis \"X\": `max_acceleration` is -3000.0",
            "a number from 0.001 to 1000000000 (mm/s²)",
        ),
        (
            "max_jerk = 60_000.0",
            "max_jerk = §inf",
            "axis \"X\": `max_jerk` is inf",
            "from 0.001 to 1000000000000 (mm/s³)",
        ),
        (
            "max_velocity = 700.0",
            "max_velocity = §1e160",
            "axis \"X\": `max_velocity` is 1e160",
            "from 0.001 to 1000000 (mm/s)",
        ),
        (
            "max_acceleration = 3000.0",
            "max_acceleration = §1e-300",
            "axis \"X\": `max_acceleration` is 1e-300",
            "from 0.001 to 1000000000 (mm/s²)",
        ),
        (
            "max_jerk = 60_000.0",
            "max_jerk = §nan",
            "axis \"X\": `max_jerk` is nan",
            "from 0.001 to 1000000000000 (mm/s³)",
        ),
        (
            "max_jerk = 60_000.0",
            "max_jerk = §1e999",
            "axis \"X\": `max_jerk`",
            "from 0.001 to 1000000000000 (mm/s³)",
        ),
        (
            "following_error_limit = 2.0",
            "following_error_limit = §0.0",
            "axis \"X\": `following_error_limit` is 0.0",
            "above 0 (mm)",
        ),
        (
            "soft_limits = [0.0, 1500.0]",
            "soft_limits = §[1500.0, 0.0]",
            "axis \"X\": `soft_limits` is [1500.0, 0.0]",
            "the first below the second",
        ),
        (
            "[[axis]]\nname = \"Y\"\ndrives = [\"Y\"]",
            "§[[axis]]\nname = \"Y\"\ndrives = [\"Y\", \"X2\"]",
            "axis \"Y\": missing key `skew_limit`",
            "add `skew_limit`: a number above 0 (mm)",
        ),
        (
            "soft_limits = [0.0, 1000.0]",
            "soft_limits = [0.0, 1000.0]\nskew_limit = §1",
            "axis \"Y\": `skew_limit` for one drive",
            "a gantry pair",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = §{ mechanics = \"rigid_beam\", mass = 80, inertia = 15 }",
            "axis \"X\": simulation: missing key `span`",
            "add `span`: a number from 1 to 1000000 (mm from side to side)",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = §\"rigid_bean\", mass = 80, inertia = 15, \
             span = 1500 }",
            "axis \"X\": simulation: `mechanics` is \"rigid_bean\"",
            "nearest: \"rigid_beam\"",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = §0, inertia = 15, \
             span = 1500 }",
            "axis \"X\": simulation: `mass` is 0",
            "allowed: a number from 0.001 to 1000000 (kg)",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1500, carriage = §\"X\", carriage_mass = 30 }",
            "axis \"X\": simulation: axis \"X\" cannot run along its beam",
            "another linear axis of this machine with one drive: \"Y\" or \"Z\"",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1500, carriage = §\"Q\", carriage_mass = 30 }",
            "axis \"X\": simulation: axis \"Q\" cannot run along its beam",
            "another linear axis of this machine with one drive: \"Y\" or \"Z\"",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1.5, carriage = §\"Y\", carriage_mass = 30 }",
            "axis \"X\": simulation: axis \"Y\" goes 500 mm from the middle of a beam of 1.5 mm",
            "`span`, which is in mm",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1500, carriage = §\"Y\", carriage_mass = 30, carriage_middle = 10000 }",
            "axis \"X\": simulation: axis \"Y\" goes 10000 mm from the middle",
            "`carriage_middle`",
        ),
        (
            "soft_limits = [0.0, 1000.0]",
            "soft_limits = [0.0, 1000.0]\nsimulation = §{ mechanics = \"rigid_beam\" }",
            "axis \"Y\": `simulation` where nothing is tied together",
            "a gantry pair",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = §{ mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1500, carriage = \"Y\" }",
            "axis \"X\": simulation: missing key `carriage_mass`",
            "a number from 0.001 to 1000000 (kg)",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1500, §carriage_mass = 30 }",
            "axis \"X\": simulation: unknown key `carriage_mass`",
            "",
        ),
        (
            "soft_limits = [0.0, 1000.0]",
            "soft_limits = [0.0, 1000.0]\nsimulation = §{ mechanics = \"rigid_beam\", mass = 80, \
             inertia = 15, span = 1500 }",
            "axis \"Y\": `simulation` where nothing is tied together",
            "a gantry pair",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nsimulation = { motor = §\"generic-2\" }",
            "axis \"Z\": simulation: `motor` is \"generic-2\"",
            "nearest: \"generic-3\"",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nsimulation = { transmission = §\"srew\" }",
            "axis \"Z\": simulation: `transmission` is \"srew\"",
            "nearest: \"screw\"",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nsimulation = { §stiffness = 30 }",
            "axis \"Z\": simulation: unknown key `stiffness`",
            "",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nsimulation = { friction = 20, breakaway_friction = §15 }",
            "axis \"Z\": simulation: `breakaway_friction` is 15",
            "allowed: a number from 20 to 1000000 (N)",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nsimulation = { lead_error = §[[10, 1], [0, 2]] }",
            "axis \"Z\": simulation: `lead_error` is [[10, 1], [0, 2]]",
            "in ascending order of position",
        ),
        (
            "skew_limit = 0.5",
            "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80, inertia = 15, \
             span = 1500, §load = 3 }",
            "axis \"X\": simulation: unknown key `load`",
            "",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = §[-300.0, 163_500]",
            "axis \"Z\": `soft_limits` [-300, 163500] are beyond what drive \"Z\" can count",
            "allowed: -164221.470…163458.530 mm (-2147483648…2147483647 increments, 131072 for each",
        ),
        (
            "name = \"Y\"\ndrives = [\"Y\"]\npitch = 160.0\ngear = 8.0",
            "name = §\"Y\"\ndrives = [\"Y\"]\npitch = 160.0\ngear = 1e-300",
            "axis \"Y\": an increment of drive \"Y\" is more than `following_error_limit`",
            "allowed: `pitch` / `gear` up to",
        ),
        // What only some drives are sent.
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nfeed_forward = §{ rated_torque = 1.4, inertia = 5e-4 }",
            "axis \"Z\": `feed_forward`, which drive \"Z\" (LXM32M) cannot",
            "leave the key out: its loops alone make the torque, as its own gains say",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nfeed_forward = { rated_torque = 1.4, inertia = §-1 }",
            "axis \"Z\": feed_forward: `inertia` is -1",
            "allowed: a number from 0 to 10000 (kg·m², at the motor's shaft)",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nfeed_forward = §{ inertia = 5e-4 }",
            "axis \"Z\": feed_forward: missing key `rated_torque`",
            "add `rated_torque`: a number from 0.01 to 4000000 (N·m)",
        ),
        (
            "soft_limits = [-300.0, 0.0]",
            "soft_limits = [-300.0, 0.0]\nfeed_forward = { rated_torque = 1.4, inertia = 5e-4, motor_inertia = §6e-4 }",
            "axis \"Z\": feed_forward: `motor_inertia` is 6e-4",
            "allowed: a number from 0 to 0.0005 (kg·m², no more than `inertia`)",
        ),
        // Cycle and bit rate.
        (
            "cycle_us = 2000",
            "cycle_us = §2500",
            "machine: `cycle_us` is 2500, which drive \"X1\" (LXM32M) does not take",
            "allowed: 1000…20000 µs in steps of 1000 µs",
        ),
        (
            "cycle_us = 2000",
            "cycle_us = §21000",
            "machine: `cycle_us` is 21000",
            "1000…20000",
        ),
        (
            "cycle_us = 2000",
            "cycle_us = §0",
            "machine: `cycle_us` is 0",
            "1…1000000 (µs)",
        ),
        (
            "cycle_us = 2000",
            "cycle_us = §2.0",
            "machine: `cycle_us` is 2.0",
            "whole number",
        ),
        (
            "bitrate = 1_000_000",
            "bitrate = §800_000",
            "bus \"portal\": `bitrate` is 800000, which drive \"X1\" (LXM32M) does not take",
            "allowed: 50000, 125000, 250000, 500000, 1000000 (bit/s)",
        ),
        (
            "bitrate = 1_000_000",
            "bitrate = §1",
            "bus \"portal\": `bitrate` is 1",
            "500000",
        ),
        // Supervision.
        (
            "heartbeat_timeout_ms = 300",
            "heartbeat_timeout_ms = §100",
            "controller: `heartbeat_timeout_ms` is 100 with `heartbeat_ms` at 100",
            "clearly longer",
        ),
        (
            "sdo_retries = 2",
            "setpoint_offset_us = §2000",
            "controller: `setpoint_offset_us` is 2000",
            "less than the cycle of 2000 µs",
        ),
        // Objects.
        (
            "zero = 402_131",
            "sdo = [§[\"3012:3\"]]",
            "drive \"Y\": `sdo`: this entry is not an object with a value",
            "[\"3012:3\", 5]",
        ),
        (
            "zero = 402_131",
            "sdo = [[§\"3012.3\", 5]]",
            "drive \"Y\": `sdo`: this is no object",
            "\"index:sub\" in hexadecimal",
        ),
        (
            "zero = 402_131",
            "sdo = [[\"3012:3\", §65536]]",
            "drive \"Y\": `sdo`: this is no value for 3012h:3 (CTRL1_KPp)",
            "a whole number 0…65535",
        ),
        (
            "zero = 402_131",
            "sdo = [[\"3012:3\", §5.5]]",
            "drive \"Y\": `sdo`: this is no value for 3012h:3 (CTRL1_KPp)",
            "a whole number 0…65535",
        ),
        (
            "zero = 402_131",
            "sdo = [[\"3012:3\", 5], [§\"3012:FF\", 5]]",
            "drive \"Y\": `sdo`: the LXM32M has no object 3012h:FF",
            "lists as writable",
        ),
        (
            "zero = 402_131",
            "sdo = [[§\"6064\", 5]]",
            "drive \"Y\": `sdo`: 6064h:0 (_p_act) is read-only",
            "lists as writable",
        ),
        (
            "zero = 402_131",
            "sdo = [[§\"60C2:1\", 4]]",
            "drive \"Y\": `sdo`: 60C2h:1 is the controller's own",
            "objects outside communication",
        ),
        (
            "zero = 402_131",
            "zero = §3_000_000_000",
            "drive \"Y\": `zero` is 3000000000",
            "",
        ),
        (
            "direction = \"negative\"",
            "direction = §\"neg\"",
            "drive \"X2\": `direction` is \"neg\"",
            "\"positive\" or \"negative\"; nearest: \"negative\"",
        ),
        (
            "drive_soft_limits = true",
            "drive_soft_limits = §1",
            "axis \"X\": `drive_soft_limits` is 1",
            "true or false",
        ),
        (
            "[machine]",
            "[model.lxm32m]\n§sync_loked = 1\n[machine]",
            "lxm32m: unknown key `sync_loked`",
            "nearest valid key: `sync_locked`; allowed: interpolation_delay, sync_locked",
        ),
    ];
    for (from, to, problem, help) in cases {
        let marked = portal_with(from, to);
        let place = marked.find('§').expect(to);
        let line = marked[..place].matches('\n').count() + 1;
        let column = marked[..place]
            .chars()
            .rev()
            .take_while(|c| *c != '\n')
            .count()
            + 1;
        let error = parse(&marked.replace('§', "")).expect_err(to).to_string();
        assert!(
            error.starts_with(&format!("machine.toml:{line}:{column}: {problem}"))
                && error.contains(help),
            "`{to}` gave\n{error}"
        );
    }
    let error = parse("").unwrap_err().to_string();
    assert!(error.starts_with("machine.toml:1:1: machine file: missing key `machine`"));
}

/// What is right beside a mistake is not told to be another one.
#[test]
fn a_mistake_of_a_beam_is_told_alone() {
    for (from, beam) in [
        (
            "skew_limit = 0.5",
            "mass = 80, inertia = 15, span = 1500, carriage = \"Q\", carriage_mass = 30",
        ),
        (
            "skew_limit = 0.5",
            "mass = 80, inertia = 15, span = 1500, carriage = 5, carriage_middle = 0, carriage_mass = 30",
        ),
        ("soft_limits = [0.0, 1000.0]", "carriage = \"X\""),
    ] {
        let beam = format!("{from}\nsimulation = {{ mechanics = \"rigid_beam\", {beam} }}");
        let told = parse(&portal_with(from, &beam)).unwrap_err();
        assert_eq!(told.diagnostics.len(), 1, "{told}");
    }
}

#[test]
fn a_model_is_one_of_the_list() {
    let text = portal_with("model = \"lxm32m\"", "model = \"lxm23m\"");
    let told = parse(&text).unwrap_err().diagnostics;
    for model in MODELS.iter().filter(|model| model.is_drive()) {
        let name = format!("\"{}\"", model.name);
        assert!(told[0].help.contains(&name), "{}", told[0].help);
    }
}

#[test]
fn what_several_drives_of_a_model_do_not_take_is_told_once() {
    for (key, text) in [
        (
            "cycle_us",
            portal_with("cycle_us = 2000", "cycle_us = 2500"),
        ),
        (
            "bitrate",
            portal_with("bitrate = 1_000_000", "bitrate = 800_000"),
        ),
    ] {
        let told = parse(&text).unwrap_err().diagnostics;
        let about = |it: &&Diagnostic| it.problem.contains(key);
        assert_eq!(told.iter().filter(about).count(), 1, "{told:?}");
    }
}

#[test]
fn several_mistakes_are_told_at_once_in_the_order_of_the_file() {
    let text = portal_with("node = 127", "node = 0")
        .replace("cycle_us = 2000", "cycle_us = \"fast\"")
        .replace("max_jerk = 80_000.0", "max_jerk = 0\ncolour = \"red\"");
    let error = parse(&text).unwrap_err();
    let lines: Vec<_> = error.diagnostics.iter().map(|found| found.line).collect();
    assert_eq!(lines, [6, 9, 85, 86]);
    let expected = "machine.toml:6:12: machine: `cycle_us` is \"fast\"\n  \
                      6 | cycle_us = \"fast\"\n    \
                        |            ^^^^^^\n    \
                        = allowed: a whole number 1…1000000 (µs)\n\
                    machine.toml:9:8: ";
    assert!(error.to_string().starts_with(expected), "{error}");
}

#[test]
fn text_that_is_no_machine_never_panics() {
    for text in [
        "",
        "\u{feff}",
        "x",
        "[",
        "[[axis]]",
        "machine = 3",
        "bus = []",
        "drive = [1]",
        "é = 'ü'\n[é",
    ] {
        let error = parse(text).expect_err(text);
        assert!(!error.diagnostics.is_empty() && !error.to_string().is_empty());
    }
    // Every prefix of a good file, and every line left out.
    for end in 0..PORTAL.len() {
        if let Some(text) = PORTAL.get(..end) {
            drop(parse(text));
        }
    }
    let lines: Vec<_> = PORTAL.lines().collect();
    for left_out in 0..lines.len() {
        let mut lines = lines.clone();
        lines.remove(left_out);
        drop(parse(&lines.join("\n")));
    }
}

/// `docs/machine-file.md` has a row for each key that the reader knows, and no other.
#[test]
fn the_reference_is_complete() {
    let reference = include_str!("../../../docs/machine-file.md");
    let chapters: Vec<&str> = reference.split("\n## ").skip(1).collect();
    let documented = |table: &str| -> Vec<String> {
        let chapter = chapters
            .iter()
            .find(|chapter| {
                chapter.starts_with(&format!("`[{table}"))
                    || chapter.starts_with(&format!("`[[{table}"))
            })
            .expect(table);
        let rows = chapter.lines().filter_map(|line| line.strip_prefix("| `"));
        rows.map(|row| row.split('`').next().unwrap().to_owned())
            .collect()
    };
    let models: Vec<_> = (MODELS.iter())
        .map(|model| format!("model.{}", model.name))
        .collect();
    let mut text = PORTAL.to_owned()
        + "\n[axis.simulation]\ntransmission = \"belt\"\ntemperature_rise = 1\n[path]\n[validation]\n";
    text += "[probing]\n[simulation]\n[simulation.tool_setter]\nx = 0\ny = 0\nz = 0\n[[simulation.cutting]]\nspecific_force = 2000\nwidth = 1\n";
    text += "[[simulation.dc_bus]]\ndrives = [\"Y\", \"Z\"]\n";
    text += "[[encoder]]\nname = \"screw\"\nbus = \"portal\"\nnode = 5\nmodel = \"twk_crn\"\npitch = 10.0\n";
    text += "[[io]]\nname = \"cabinet\"\nbus = \"portal\"\nnode = 6\nmodel = \"cia401\"\n";
    text += "[[user_code]]\ncode = 100\ncommand = [\"/bin/true\"]\n";
    for model in &models {
        text += &format!("[{model}]\n");
    }
    let sent_torques =
        CSP.replace("\"lxm32m\"", "\"cia402_csp\"") + "\n[axis.feed_forward]\nrated_torque = 1.4\n";
    let mut tables: Vec<_> = [
        ("machine", "[machine]"),
        ("controller", "[controller]"),
        ("path", "[path]"),
        ("validation", "[validation]"),
        ("probing", "[probing]"),
        ("simulation", "[simulation]"),
        ("simulation.tool_setter", "[simulation.tool_setter]"),
        ("simulation.cutting", "[[simulation.cutting]]"),
        ("simulation.dc_bus", "[[simulation.dc_bus]]"),
        ("bus", "[[bus]]"),
        ("drive", "[[drive]]"),
        ("encoder", "[[encoder]]"),
        ("io", "[[io]]"),
        ("user_code", "[[user_code]]"),
        ("axis", "[[axis]]"),
        ("axis.feed_forward", "[axis.feed_forward]"),
        ("axis.simulation", "[axis.simulation]"),
    ]
    .map(|(table, header)| (table, header.to_owned()))
    .into();
    tables.extend((models.iter()).map(|model| (&model[..], format!("[{model}]"))));
    for table in ["homing", "axis.homing", "spindle"] {
        tables.push((table, format!("[{table}]")));
    }
    for (table, header) in tables {
        let text = match table {
            "homing" | "axis.homing" => ROUTER,
            "spindle" => DRILL,
            "axis.feed_forward" => &sent_torques,
            _ => &text,
        };
        let text = text.replacen(&header, &format!("{header}\nno_such_key = 1"), 1);
        let error = parse(&text).unwrap_err();
        let (_, allowed) = error.diagnostics[0].help.split_once("allowed: ").unwrap();
        let mut allowed: Vec<_> = allowed.split(", ").map(str::to_owned).collect();
        if table == "axis.homing" {
            // Of other kinds than the router's.
            allowed.insert(1, "method".to_owned());
            let back_off = allowed.iter().position(|key| key == "back_off").unwrap();
            let of_stop = ["weight", "torque", "contact_ms", "min_distance"];
            allowed.splice(back_off..back_off, of_stop.map(str::to_owned));
        }
        assert_eq!(documented(table), allowed, "[{table}]");
    }
}

#[test]
fn user_codes_are_each_one_command_by_its_path() {
    let with = |tables: &str| parse(&format!("{PORTAL}\n{tables}"));
    let one = "[[user_code]]\ncode = 101\ncommand = [\"/bin/a\", \"b\"]\ntimeout_ms = 50\n";
    let machine = with(one).unwrap();
    let code = &machine.user_codes[0];
    assert_eq!((code.code, code.within.as_millis()), (101, 50));
    assert_eq!(code.command, ["/bin/a", "b"]);
    for (tables, told) in [
        (
            format!("{one}{one}"),
            "there is another one with `code = 101`",
        ),
        (one.replace("101", "99"), "a whole number 100…199"),
        (one.replace("/bin/a", "a"), "`command` begins with \"a\""),
        (
            one.replace("[\"/bin/a\", \"b\"]", "[]"),
            "the path absolute",
        ),
        (
            one.replace("timeout_ms = 50", "timeout_ms = 0"),
            "`timeout_ms`",
        ),
    ] {
        let error = with(&tables).unwrap_err().to_string();
        assert!(error.contains(told), "{told}: {error}");
    }
}

/// An encoder on the screw of the portal's Z.
const ENCODER: &str = r#"
[[encoder]]
name = "screw"
bus = "portal"
node = 5
model = "twk_crn"
pitch = 10.0
direction = "negative"
zero = 1000

[[axis]]
name = "Z"
feedback = "screw"
difference_limit = 0.2
"#;

/// The portal with that encoder, its text changed.
fn with_encoder(from: &str, to: &str) -> Result<Machine, Invalid> {
    let text = portal_with("[[axis]]\nname = \"Z\"\n", ENCODER);
    assert!(text.contains(from), "{from}");
    parse(&text.replacen(from, to, 1))
}

#[test]
fn an_encoder_sees_an_axis() {
    let machine = with_encoder("", "").unwrap();
    let (encoder, axis) = (&machine.encoders[0], &machine.axes[2]);
    assert_eq!(
        (encoder.bus, encoder.node.get(), encoder.axis),
        (0, 5, Some(2))
    );
    let feedback = axis.feedback.unwrap();
    assert_eq!((feedback.encoder, feedback.difference), (0, 0.2));
    assert!(machine.axes[0].feedback.is_none());
    // One turn is 10 mm, downwards.
    let position = encoder.scaling.to_increments(-10.0).unwrap();
    assert_eq!(position, Increments::new(1000 + 8192));
    // Behind the drives.
    let names: Vec<_> = machine.nodes().map(|node| node.name.to_owned()).collect();
    assert_eq!(names, ["X1", "X2", "Y", "Z", "screw"]);
    let device = machine.device(4);
    assert!(device.drive().is_none() && device.spec().r_pdos.is_empty());
    assert_eq!(
        device.feedback().and_then(|it| it.range()),
        Some(Increments::new(8192 * 4096))
    );
    let scaled = with_encoder(
        "[[encoder]]",
        "[model.twk_crn]\nunits_per_turn = 1000\nturns_exponent = 6\n[[encoder]]",
    );
    let device = scaled.unwrap().device(4);
    let range = device.feedback().and_then(|it| it.range());
    assert_eq!(range, Some(Increments::new(64_000)));
}

#[test]
fn encoders_that_see_nothing_or_not_enough_are_told() {
    let told = |from: &str, to: &str| {
        let told = with_encoder(from, to).unwrap_err().diagnostics.into_iter();
        let told: Vec<_> = told
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        told.join("\n")
    };
    let scaling = |exponent: u32| {
        format!("[model.twk_crn]\nunits_per_turn = 1000\nturns_exponent = {exponent}\n[[encoder]]")
    };
    let twice = "[[axis]]\nname = \"Y\"\nfeedback = \"screw\"\ndifference_limit = 1.0\n";
    insta::assert_snapshot!(
        [
            told("feedback = \"screw\"", "feedback = \"scrow\""),
            told("feedback = \"screw\"\ndifference_limit = 0.2\n", ""),
            told("feedback = \"screw\"\n", ""),
            told("difference_limit = 0.2\n", ""),
            told("difference_limit = 0.2\n", "difference_limit = 0.001\n"),
            told("model = \"twk_crn\"", "model = \"lxm32m\""),
            told("model = \"lxm32m\"", "model = \"twk_crn\""),
            told("node = 5", "node = 4"),
            told("zero = 1000", "zero = -1"),
            told("zero = 1000", "sdo = [[\"6003:0\", 5]]"),
            // Of 300 mm it tells 40 apart.
            told("[[encoder]]", &scaling(2)),
            told("[[axis]]\nname = \"Y\"\n", twice),
        ]
        .join("\n\n")
    );
    assert!(with_encoder("[[encoder]]", &scaling(5)).is_ok());
}

/// By an encoder the controller can close a loop that is its own, about an axis that has no other reference.
#[test]
fn an_encoder_closes_no_loop_that_a_drive_closes() {
    let told = |changes: &[(&str, &str)]| {
        let mut text = portal_with("[[axis]]\nname = \"Z\"\n", ENCODER);
        let last = "difference_limit = 0.2\n";
        text = text.replacen(last, &format!("{last}position_loop = \"encoder\"\n"), 1);
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        parse(&text)
    };
    let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
    let velocities = (drive, "node = 4\nmodel = \"tlc5xx\"\nzero = 600_000");
    let own = (
        "drive_following_error = true\ndrive_soft_limits = true\n",
        "",
    );
    let machine = told(&[velocities, own]);
    let refused = |changes: &[(&str, &str)]| {
        let told = told(changes).unwrap_err().diagnostics.into_iter();
        let told: Vec<_> = told
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        told.join("\n")
    };
    insta::assert_snapshot!(
        [
            refused(&[]),
            refused(&[("feedback = \"screw\"\ndifference_limit = 0.2\n", "")]),
            refused(&[("position_loop = \"encoder\"", "position_loop = \"both\"")]),
        ]
        .join("\n\n")
    );
    assert!(machine.is_ok_and(|it| it.axes[2].feedback.is_some_and(|it| it.closes_loop)));
}

/// What an axis is compensated for has to be something, and leave its plan room; what sees the load has nothing to compensate.
#[test]
fn what_cannot_be_compensated_is_refused() {
    let z = "soft_limits = [-300.0, 0.0]\n";
    let refused = |keys: &str, changes: &[(&str, &str)]| {
        let mut text = portal_with(z, &format!("{z}{keys}\n"));
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        let told = parse(&text).unwrap_err().diagnostics.into_iter();
        let told: Vec<_> = told
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        format!("{keys}\n  {}", told.join("\n  "))
    };
    let scale = (
        "[[axis]]\nname = \"Z\"\n",
        "[[axis]]\nname = \"Z\"\nsimulation = { scale_step = 1.0 }\n",
    );
    let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
    let unsupervised = (
        "following_error_limit = 1.0\nstandstill_window = 0.05\ndrive_following_error = true\ndrive_soft_limits = true\n",
        "following_error_limit = 1.0\nstandstill_window = 0.05\n",
    );
    let velocities = (drive, "node = 4\nmodel = \"tlc5xx\"\nzero = 600_000");
    let encoder = (
        "[[axis]]\nname = \"Z\"\n",
        &*ENCODER.replace(
            "difference_limit = 0.2\n",
            "difference_limit = 0.2\nposition_loop = \"encoder\"\n",
        ),
    );
    let targets = (
        "[[axis]]\nname = \"Z\"\n",
        "[[axis]]\nname = \"Z\"\nmotion = \"point_to_point\"\n",
    );
    insta::assert_snapshot!(
        [
            refused("backlash = 0.0", &[]),
            refused("backlash = 20", &[]),
            refused("lead_error = 12", &[]),
            refused("lead_error = [[0, 12]]", &[]),
            refused("lead_error = [[0, 0], [-100, 5]]", &[]),
            refused("lead_error = [[-100, 0], [0, 1500]]", &[]),
            refused("lead_error = [[-2, 0], [0, 300]]", &[]),
            // Noise of 8 µm every 2 mm.
            refused("lead_error = [[-104, 4], [-102, -4], [-100, 4]]", &[]),
            refused("backlash = 0.02", &[scale]),
            refused(
                "lead_error = [[-100, 0], [0, 12]]",
                &[unsupervised, velocities, encoder]
            ),
            refused("backlash = 0.02", &[unsupervised, velocities, targets]),
        ]
        .join("\n\n")
    );
    // What is left for the plan is what (128 b / J)^(1/3) takes no part of; the drives, and what they are held against, have it all.
    let machine = parse(&portal_with(z, &format!("{z}backlash = 0.02\n"))).unwrap();
    let axis = &machine.axes[2];
    let of = |it: &AxisLimits| [it.velocity, it.acceleration, it.jerk];
    let quarter = 0.25 * f64::cbrt(128.0 * 0.02 / 80_000.0);
    let (v, a) = (20_000.0 * quarter * quarter, 20_000.0 * quarter);
    for (left, expected) in of(&axis.limits)
        .into_iter()
        .zip([500.0 - v, 4000.0 - a, 60_000.0])
    {
        assert!(
            (left / expected - 1.0).abs() < 1e-9,
            "{left}, expected {expected}"
        );
    }
    assert_eq!(of(&axis.stated_limits()), [500.0, 4000.0, 80_000.0]);
    assert_eq!(axis.limits.position, (-300.0, 0.0));
    assert_eq!(axis.sent_limits.position, (-300.01, 0.01));
}

/// Which axes may go point to point, and which do where the file does not say.
#[test]
fn axes_go_point_to_point_where_their_drives_can() {
    let z = |model: &str, more: &str| {
        let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
        let text = portal_with(drive, &format!("node = 4\nmodel = \"{model}\""));
        let own = "drive_following_error = true\ndrive_soft_limits = true\n";
        let (before, after) = text.rsplit_once(own).unwrap();
        parse(&format!("{before}{more}\n{after}"))
    };
    let motion = |model, more| z(model, more).unwrap().axes[2].motion;
    let stated = "motion = \"point_to_point\"";
    let by_hand = "[axis.homing]\nkind = \"set_here\"";
    assert_eq!(motion("tsp10", by_hand), Motion::PointToPoint);
    assert_eq!(motion("tlc5xx", ""), Motion::Path);
    assert_eq!(motion("tlc5xx", stated), Motion::PointToPoint);
    assert_eq!(motion("lxm32m", ""), Motion::Path);
    let refused = |told: Result<Machine, Invalid>| {
        let told = told.unwrap_err().diagnostics.into_iter();
        let told: Vec<_> = told
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        told.join("\n")
    };
    let homing = "[axis.homing]\nkind = \"switch\"\nswitches = [\"home Z\"]\ndirection = \"positive\"\n\
        speed = 30.0\nslow_speed = 1.0\nback_off = 3.0\nposition = 3.0\n[[input]]\nname = \"home Z\"\n\
        drive = \"X1\"\nsignal = \"DI0\"\nfunction = \"home\"";
    let told = [
        refused(z("lxm32m", stated)),
        refused(z("tsp10", "motion = \"path\"")),
        refused(z("tlc5xx", &format!("{stated}\n{homing}"))),
        refused(parse(&portal_with(
            "skew_limit = 0.5\n",
            &format!("skew_limit = 0.5\n{stated}\n"),
        ))),
        refused(z("tlc5xx", "motion = \"fast\"")),
    ];
    insta::assert_snapshot!(told.join("\n\n"));
}

/// A stepper counts from where it is switched on: nothing would tell where its axis is.
#[test]
fn a_stepper_that_goes_point_to_point_is_homed_after_each_power_on_or_has_an_encoder() {
    let z = |encoder: bool, homing: &str| {
        let own = "drive_following_error = true\ndrive_soft_limits = true\n";
        let axis = "[[axis]]\nname = \"Z\"\n";
        let text = portal_with(axis, if encoder { ENCODER } else { axis });
        let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
        let text = text.replace(drive, "node = 4\nmodel = \"tsp10\"");
        let (before, after) = text.rsplit_once(own).unwrap();
        parse(&format!("{before}{homing}{after}"))
    };
    let by_hand = "[axis.homing]\nkind = \"set_here\"\n";
    let motion = z(false, by_hand).unwrap().axes[2].motion;
    assert_eq!(motion, Motion::PointToPoint);
    assert!(z(true, "").is_ok());
    let kept = format!("{by_hand}absolute = true\n");
    for homing in ["", "[axis.homing]\nkind = \"encoder\"\n", &kept] {
        let told = z(false, homing).unwrap_err().diagnostics;
        let told: Vec<_> = told
            .iter()
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        assert_eq!(
            told,
            [
                "axis \"Z\": drive \"Z\" (TSP10-CBE) counts from where it is switched on, and nothing tells where that \
                 is: home it after each power-on: [axis.homing] with `kind = \"set_here\"` and without `absolute`; or name \
                 an [[encoder]] as the axis's `feedback`"
            ]
        );
    }
}

/// Each refusal of a stepper names what is taken instead.
#[test]
fn what_a_refused_stepper_is_told_to_do_is_taken() {
    let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
    let own = "drive_following_error = true\ndrive_soft_limits = true\n";
    let axis = "[[axis]]\nname = \"Z\"\n";
    let z = |encoder: bool, homing: &str| {
        let text = portal_with(axis, if encoder { ENCODER } else { axis });
        let text = text.replace(drive, "node = 4\nmodel = \"tsp10\"");
        let (before, after) = text.rsplit_once(own).unwrap();
        parse(&format!("{before}{homing}{after}"))
    };
    let helps = |told: Result<Machine, Invalid>| {
        let told = told.unwrap_err().diagnostics.into_iter();
        told.map(|it| it.help).collect::<Vec<_>>()
    };
    let by_hand = "[axis.homing]\nkind = \"set_here\"\n";
    // An encoder, and an [axis.homing] that keeps what the stepper forgets.
    let kept = helps(z(true, &format!("{by_hand}absolute = true\n")));
    assert_eq!(
        kept,
        [
            "leave [axis.homing] out: the encoder that is its `feedback` tells where it is; or leave `absolute` out, and home \
             it after each power-on"
        ]
    );
    assert!(z(true, "").is_ok() && z(true, by_hand).is_ok());
    // A homing that a stepper is not made for.
    let speeds = "position = 3.0\nspeed = 30.0\n";
    let by_itself =
        format!("[axis.homing]\nkind = \"drive\"\nmethod = 17\nslow_speed = 1.0\n{speeds}");
    let by_stop = format!(
        "[axis.homing]\nkind = \"hard_stop\"\nweight = \"none\"\ndirection = \"negative\"\ntorque = 30\nback_off = 2.0\n{speeds}"
    );
    for homing in [by_itself, by_stop] {
        assert_eq!(
            helps(z(false, &homing)),
            ["home it with `kind = \"set_here\"`"]
        );
        let told = helps(z(true, &homing));
        let told: Vec<_> = told.iter().filter(|it| it.contains("set_here")).collect();
        assert_eq!(
            told,
            [
                "leave [axis.homing] out: its encoder tells where it is; or home it with `kind = \"set_here\"`"
            ]
        );
    }
    assert!(z(false, by_hand).is_ok());
}

/// A stepper as a side of a gantry pair is refused once, and nothing is asked of it that would be refused next.
#[test]
fn a_stepper_is_no_side_of_a_gantry_pair() {
    let pair = "node = 2\nmodel = \"lxm32m\"\ndirection = \"negative\"";
    for more in [
        "",
        "motion = \"path\"\n",
        "unsupervised_stop = \"hardware\"\n",
    ] {
        let text = portal_with("skew_limit = 0.5\n", &format!("skew_limit = 0.5\n{more}"));
        assert!(text.contains(pair), "{text}");
        let text = text.replacen(pair, "node = 2\nmodel = \"tsp10\"", 1);
        let told = parse(&text).unwrap_err().diagnostics;
        let about: Vec<_> = told
            .iter()
            .filter(|it| it.problem.contains("(TSP10-CBE)"))
            .collect();
        let about: Vec<_> = about
            .iter()
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        assert!(
            about
                .iter()
                .any(|it| it.contains("cannot be a side of a gantry pair")),
            "{about:?}"
        );
        assert!(
            about
                .iter()
                .all(|it| !it.contains("[[encoder]]") && !it.contains("enable chain")),
            "{about:?}"
        );
    }
}

/// 100 kbit/s, which CiA 301 does not recommend, is a bit rate of those who take it.
#[test]
fn a_bit_rate_that_a_drive_takes_is_one() {
    let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
    for model in MODELS {
        for rate in model.bitrates {
            let rate = rate.to_string();
            let text = portal_with("bitrate = 1_000_000", &format!("bitrate = {rate}"));
            let text = text.replace(drive, &format!("node = 4\nmodel = \"{}\"", model.name));
            let told = parse(&text).map(|_| ()).map_err(|it| it.diagnostics);
            let told = told.err().unwrap_or_default();
            let is_none = |it: &Diagnostic| it.problem.ends_with(&format!("`bitrate` is {rate}"));
            assert!(!told.iter().any(is_none), "{} {rate}", model.name);
        }
    }
}

/// An I/O node that opens the enable chain.
const CHAIN: &str = r#"[[io]]
name = "cabinet"
bus = "portal"
node = 9
model = "cia401"

[[output]]
name = "drives on"
io = "cabinet"
signal = "DO3"
function = "enable_chain"
"#;

const CHAIN_AGAIN: &str = r#"[[output]]
name = "contactor"
io = "cabinet"
signal = "DO4"
function = "enable_chain"
"#;

/// The portal with Y on a drive that is sent velocities, and more about the axis.
fn streamed(model: &str, stated: &str) -> Result<Machine, String> {
    let text = portal_with(
        "node = 3\nmodel = \"lxm32m\"",
        &format!("node = 3\nmodel = \"{model}\""),
    );
    let text = text
        .replace("drive_following_error = true\n", "")
        .replace("drive_soft_limits = true\n", "");
    let axis = "[[axis]]\nname = \"Y\"\n";
    assert!(text.contains(axis));
    parse(&text.replacen(axis, &format!("{axis}{stated}\n"), 1)).map_err(|wrong| wrong.to_string())
}

/// A drive that takes no part in SYNC and does not notice a controller that dies has to have both made up for.
#[test]
fn a_position_may_be_missing_where_the_controller_closes_a_loop_by_it() {
    let of = |model: &str, ms: u32| streamed(model, &format!("position_loss_ms = {ms}"));
    for model in ["tlc5xx", "cia402_csv", "cia402_pv"] {
        let machine = of(model, 80).unwrap();
        assert_eq!(machine.position_loss(2), Some(Duration::from_millis(80)));
        assert_eq!(
            [0, 1, 3].map(|drive| machine.position_loss(drive)),
            [None; 3]
        );
        let wrong = of(model, 81).unwrap_err();
        let told = "axis \"Y\": `position_loss_ms` is 81, more than 40 cycles of 2000 µs";
        assert!(wrong.contains(told), "{wrong}");
    }
    let wrong = of("lxm32m", 20).unwrap_err();
    let told = "axis \"Y\": `position_loss_ms` is 20, and no loop of the controller has it";
    assert!(wrong.contains(told), "{wrong}");
}

/// Cycles are 2 ms, and Z goes 500 mm/s at most on its 300 mm.
#[test]
fn an_encoder_may_answer_every_nth_sync() {
    let of = |divider: i32, from: &str, to: &str| {
        let encoder = ENCODER.replace("zero = 1000", &format!("sync_divider = {divider}"));
        let text = portal_with("[[axis]]\nname = \"Z\"\n", &encoder);
        assert!(text.contains(from), "{from}");
        parse(&text.replace(from, to)).map_err(|wrong| wrong.to_string())
    };
    for divider in [1, 2, 10] {
        let machine = of(divider, "", "").unwrap();
        let spec = machine.device(4).spec().clone();
        assert_eq!(spec.sync_divider, divider as u32);
        assert_eq!(spec.traffic().divider, divider as u32);
        // Drives answer each of them.
        assert_eq!(machine.device(2).spec().sync_divider, 1);
    }
    // 32 turns of 10 mm, and a position every 20 ms.
    let scaled = "[model.twk_crn]\nunits_per_turn = 4096\nturns_exponent = 5\n[[encoder]]";
    assert!(of(10, "[[encoder]]", scaled).is_ok());
    let fast = of(10, "max_velocity = 500.0", "max_velocity = 8_000.0");
    let too_fast = fast.err().unwrap_or_default();
    assert!(!too_fast.contains("sync_divider"), "{too_fast}");
    let faster = "max_velocity = 8_000.0";
    let text = portal_with(
        "[[axis]]\nname = \"Z\"\n",
        &ENCODER.replace("zero = 1000", "sync_divider = 10"),
    );
    let text = text
        .replace("[[encoder]]", scaled)
        .replace("max_velocity = 500.0", faster);
    let wrong = parse(&text).unwrap_err().to_string();
    let told = "its axis may go 160.000 from one position to the next, which is not less than half of 320.000";
    assert!(wrong.contains(told), "{wrong}");
    for (divider, told) in [
        (0, "`sync_divider`"),
        (241, "`sync_divider`"),
        (
            11,
            "`sync_divider` is 11: its positions would be 22 ms apart, more than 20 ms",
        ),
    ] {
        let wrong = of(divider, "", "").unwrap_err();
        assert!(wrong.contains(told), "{wrong}");
    }
}

/// A loop wants a position at every SYNC.
#[test]
fn an_encoder_that_closes_a_loop_answers_each_sync() {
    let axis = "[[axis]]\nname = \"Y\"\n";
    let encoder = ENCODER.replace("[[axis]]\nname = \"Z\"\n", axis);
    let of = |divider: u32| {
        let table = encoder.replace("zero = 1000", &format!("sync_divider = {divider}"));
        let loops = table.replace("feedback =", "position_loop = \"encoder\"\nfeedback =");
        let text = portal_with(
            "node = 3\nmodel = \"lxm32m\"",
            "node = 3\nmodel = \"tlc5xx\"",
        );
        let text = text
            .replace("drive_following_error = true\n", "")
            .replace("drive_soft_limits = true\n", "");
        parse(&text.replacen(axis, &loops, 1)).map_err(|wrong| wrong.to_string())
    };
    assert!(of(1).is_ok(), "{:?}", of(1).err());
    let wrong = of(2).unwrap_err();
    assert!(
        wrong.contains("`sync_divider` is 2: it closes a position loop"),
        "{wrong}"
    );
}

/// 60 r/(min·s) of a TLC53x are 20 mm/s² of Y, and a stepper's 23 steps/s² of 10 000 a revolution 0.046 mm/s².
#[test]
fn an_axis_that_goes_to_targets_needs_ramps_that_its_drive_has() {
    let of = |model: &str, acceleration: f64, motion: &str| {
        let homed = "[axis.homing]\nkind = \"set_here\"\n\n[[axis]]\nname = \"Z\"\n";
        let text = portal_with(
            "node = 3\nmodel = \"lxm32m\"",
            &format!("node = 3\nmodel = \"{model}\""),
        );
        let text = text
            .replace("drive_following_error = true\n", "")
            .replace("drive_soft_limits = true\n", "")
            .replacen("[[axis]]\nname = \"Z\"\n", homed, 1);
        let y = "drives = [\"Y\"]\n";
        let (before, after) = text.split_once(y).unwrap();
        let stated = format!("max_acceleration = {acceleration}");
        let after = after.replacen("max_acceleration = 5000.0", &stated, 1);
        parse(&format!("{before}{y}motion = \"{motion}\"\n{after}"))
            .map_or_else(|wrong| wrong.to_string(), |_| String::new())
    };
    for (model, least) in [("tlc5xx", 20.0), ("tsp10", 0.046)] {
        let told = format!("has no ramp below {least:.4} mm/s²");
        let wrong = of(model, least * 0.99, "point_to_point");
        assert!(wrong.contains(&told), "{wrong}");
        assert_eq!(of(model, least * 1.01, "point_to_point"), "");
    }
    // Along the path the drive follows the plan, whatever its ramps are.
    assert_eq!(of("tlc5xx", 19.0, "path"), "");
}

/// One that is sent velocities; every other one is refused with the reason.
#[test]
fn a_drive_may_answer_every_nth_sync() {
    let of = |model: &str, divider: u32, changes: &[(&str, &str)]| {
        let mut text = portal_with(
            "node = 3\nmodel = \"lxm32m\"",
            &format!("node = 3\nmodel = \"{model}\"\nsync_divider = {divider}"),
        );
        if model != "lxm32m" {
            text = text
                .replace("drive_following_error = true\n", "")
                .replace("drive_soft_limits = true\n", "");
        }
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        parse(&text).map_err(|wrong| wrong.to_string())
    };
    for model in ["tlc5xx", "cia402_csv", "cia402_pv"] {
        for divider in [1, 2, 10] {
            let machine = of(model, divider, &[]).unwrap();
            let device = machine.device(2);
            let spec = device.spec();
            assert_eq!(spec.sync_divider, divider);
            assert_eq!(spec.traffic().divider, divider);
            let gain = device.drive().unwrap().dynamics().unwrap().gain;
            let each = of(model, 1, &[]).unwrap().device(2);
            let each = each.drive().unwrap().dynamics().unwrap().gain;
            // A quarter of the inverse of all that delays, each SYNC without an answer too.
            let later = 0.002 * f64::from(divider - 1);
            assert!(
                (0.25 / gain - 0.25 / each - later).abs() < 1e-9,
                "{model} {divider}"
            );
        }
    }
    let y = "[[axis]]\nname = \"Y\"\n";
    let probe = "[[input]]\nname = \"probe\"\ndrive = \"Z\"\nsignal = \"DI0\"\nfunction = \"probe\"\n\n[[axis]]\nname = \"X\"\n";
    for (model, divider, changes, told) in [
        (
            "lxm32m",
            2,
            &[][..],
            "the LXM32M is sent positions, and has to be seen to go to each of them",
        ),
        ("cia402_csp", 2, &[], "the CiA 402 CSP is sent positions"),
        ("tsp10", 2, &[], "the TSP10-CBE answers no SYNC"),
        (
            "tlc5xx",
            11,
            &[],
            "its positions would be 22 ms apart, more than 20 ms",
        ),
        ("tlc5xx", 0, &[], "`sync_divider` is 0"),
        (
            "tlc5xx",
            2,
            &[("[[axis]]\nname = \"X\"\n", probe)],
            "a probe asks for the position of every axis at a SYNC",
        ),
        (
            "tlc5xx",
            10,
            &[("[controller]\n", "[controller]\nt_pdo_misses = 5\n")],
            "it might be unseen for 50 cycles, more than 40",
        ),
        (
            "tlc5xx",
            10,
            &[(y, "[[axis]]\nname = \"Y\"\nposition_loss_ms = 80\n")],
            "it might be unseen for 50 cycles, more than 40",
        ),
    ] {
        let wrong = of(model, divider, changes).unwrap_err();
        assert!(wrong.contains(told), "{told}\n{wrong}");
    }
}

#[test]
fn an_encoder_is_on_a_shaft_of_its_own_where_it_is_measured() {
    let of = |encoders: &str| {
        let axis = "[[axis]]\nname = \"X\"\n";
        let text = portal_with(axis, &format!("{encoders}{axis}"));
        parse(&text).map_err(|wrong| wrong.to_string())
    };
    let encoder = |name: &str, node: u32, more: &str| {
        format!(
            "[[encoder]]\nname = \"{name}\"\nbus = \"portal\"\nnode = {node}\nmodel = \"cia406\"\n\
             pitch = 200.0\n{more}\n"
        )
    };
    let measured = |name: &str, node| encoder(name, node, "measured = true");
    let machine = of(&measured("belt-1_a", 20)).unwrap();
    assert_eq!(machine.measured().count(), 1);
    assert_eq!(machine.encoders[0].axis, None);
    let five: String = (0..5)
        .map(|at| measured(&format!("belt{at}"), 20 + at))
        .collect();
    let named = measured("belt", 20) + &encoder("other", 21, "");
    for (encoders, told) in [
        (
            measured("the belt", 20),
            "the trace has a column of that name",
        ),
        (measured("a,b", 20), "the trace has a column of that name"),
        (
            five,
            "encoder \"belt4\": more than 4 encoders are `measured`",
        ),
        (named, "encoder \"other\": no axis names it"),
        (
            encoder("belt", 20, "simulated_speed = 1.0"),
            "`simulated_speed`",
        ),
    ] {
        let wrong = of(&encoders).unwrap_err();
        assert!(wrong.contains(told), "{wrong}");
    }
    // And no axis' feedback at once.
    let text = portal_with(
        "max_jerk = 80_000.0\n",
        "max_jerk = 80_000.0\nfeedback = \"belt\"\ndifference_limit = 1.0\n",
    );
    let axis = "[[axis]]\nname = \"X\"\n";
    let text = text.replacen(axis, &(measured("belt", 20) + axis), 1);
    let wrong = parse(&text).unwrap_err().to_string();
    assert!(
        wrong.contains("is `measured`, and no axis' feedback"),
        "{wrong}"
    );
}

#[test]
fn a_test_move_is_made_where_it_can_be_measured() {
    let of = |model: &str, homing: &str| streamed(model, &format!("homing = {{ {homing} }}"));
    for test in [4.0, -0.7, 8.0] {
        let homing = format!("kind = \"encoder\", test_move = {test:?}");
        let machine = of("tlc5xx", &homing).unwrap();
        let axis = machine.axes.iter().find(|axis| axis.name() == "Y").unwrap();
        assert_eq!(axis.homing.test_move, Some(TestMove { distance: test }));
        assert!(!axis.homing.is_absolute());
    }
    for (model, homing, told) in [
        (
            "lxm32m",
            "kind = \"encoder\", test_move = 4.0",
            "the controller closes no loop about the axis",
        ),
        (
            "tlc5xx",
            "kind = \"encoder\", test_move = 0.6",
            "0.6 mm are too little to measure by",
        ),
        (
            "tlc5xx",
            "kind = \"encoder\", test_move = -8.1",
            "a quarter of 8.1 mm is more than `following_error_limit_at_rest`",
        ),
        (
            "tlc5xx",
            "kind = \"set_here\", absolute = true, test_move = 4.0",
            "with `absolute`, an axis that is referenced without being homed",
        ),
        (
            "tlc5xx",
            "kind = \"encoder\", test_move = 0.0",
            "`test_move`",
        ),
    ] {
        let wrong = of(model, homing).unwrap_err();
        assert!(wrong.contains(told), "{homing}: {wrong}");
    }
}

#[test]
fn a_stepper_is_sent_velocities_only_where_something_stops_it() {
    let parsed = |changes: &[(&str, &str)]| {
        let mut text = portal_with("[[axis]]\nname = \"Z\"\n", ENCODER);
        let last = "difference_limit = 0.2\n";
        let more = "position_loop = \"encoder\"\nunsupervised_stop = \"hardware\"\n";
        text = text.replacen(last, &format!("{last}{more}"), 1);
        let drive = "node = 4\nmodel = \"lxm32m\"\nzero = 5_000_000";
        let stepper = format!("node = 4\nmodel = \"tsp10\"\n\n{CHAIN}");
        let own = "drive_following_error = true\ndrive_soft_limits = true\n";
        for (from, to) in [(drive, &*stepper), (own, "")].iter().chain(changes) {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        parse(&text)
    };
    let refused = |changes: &[(&str, &str)]| {
        let told = parsed(changes).unwrap_err().diagnostics.into_iter();
        let told: Vec<_> = told
            .map(|it| format!("{}: {}", it.problem, it.help))
            .collect();
        told.join("\n")
    };
    insta::assert_snapshot!(
        [
            refused(&[("unsupervised_stop = \"hardware\"\n", "")]),
            refused(&[("position_loop = \"encoder\"\n", "")]),
            refused(&[("\"hardware\"", "\"software\"")]),
            refused(&[(CHAIN, "")]),
            refused(&[("function = \"enable_chain\"", "function = \"flood\"")]),
            refused(&[(
                "io = \"cabinet\"\nsignal = \"DO3\"",
                "drive = \"Y\"\nsignal = \"DQ0\""
            )]),
            refused(&[("signal = \"DO3\"", "signal = \"DO3\"\nsafe = \"on\"")]),
            refused(&[(
                "[[axis]]\nname = \"X\"",
                &format!("{CHAIN_AGAIN}\n[[axis]]\nname = \"X\"")
            )]),
        ]
        .join("\n\n")
    );
    // Beside four drives at 1 Mbit/s its T_PDOs need a longer cycle, and beside slow ones so do the answers to its polls.
    let fits = |machine: Result<Machine, Invalid>| MachineBudget::of(&machine.unwrap()).check();
    let cycle = ("cycle_us = 2000", "cycle_us = 4000");
    assert_eq!(fits(parsed(&[cycle])), Ok(()));
    assert!(matches!(fits(parsed(&[])), Err(DoesNotFit::Bus { .. })));
    let slow = "[model.lxm32m]\nt_pdo_response_us = 2000\n\n[[bus]]";
    let Err(DoesNotFit::Polls { bus, devices, .. }) = fits(parsed(&[cycle, ("[[bus]]", slow)]))
    else {
        panic!("there is room for polls");
    };
    assert_eq!([&*bus, &*devices], ["portal", "Z (TSP10-CBE)"]);
}

/// What is told of the portal with this table, each with its line's text.
fn told_of(table: &str) -> Vec<String> {
    let text = portal_with("[[drive]]\n", &format!("{table}\n[[drive]]\n"));
    let told = parse(&text).unwrap_err().diagnostics.into_iter();
    told.map(|it| format!("{}: {}", it.problem, it.help))
        .collect()
}

#[test]
fn inputs_and_outputs_are_wired_to_signals() {
    let wires = r#"
[[input]]
name = "door"
drive = "Z"
signal = "DI5"
function = "door"
active_low = true
debounce_ms = 15

[[output]]
name = "valve"
drive = "Y"
signal = "DQ2"
number = 63
safe = "on"

[[drive]]
"#;
    let machine = parse(&portal_with("[[drive]]\n", wires)).unwrap();
    let (input, output) = (&machine.inputs[0], &machine.outputs[0]);
    assert_eq!((input.node, input.signal, input.active_low), (3, 5, true));
    assert_eq!(input.debounce, Duration::from_millis(15));
    assert_eq!(input.meaning, InputMeaning::Door);
    assert_eq!((output.node, output.signal, output.safe), (2, 2, true));
    assert_eq!(output.switch, OutputSwitch::Program(63));
    // The frames grow where something is wired.
    let bytes = |drive: usize| {
        let device = machine.device(drive);
        (device.spec().t_pdos[0].bytes, device.spec().r_pdos[0].bytes)
    };
    assert_eq!([bytes(1), bytes(2), bytes(3)], [(6, 6), (6, 8), (8, 6)]);
}

#[test]
fn wires_that_lead_nowhere_are_told() {
    let output = |rest: &str| {
        told_of(&format!("[[output]]\nname = \"a\"\ndrive = \"Y\"\n{rest}")).join("\n")
    };
    insta::assert_snapshot!([
        output("signal = \"DQ0\""),
        output("signal = \"DQ0\"\nnumber = 64"),
        output("signal = \"DQ0\"\nnumber = 1\nfunction = \"mist\""),
        output("signal = \"DQ0\"\nfunction = \"most\""),
        output("signal = \"DQ7\"\nnumber = 1"),
        output("signal = \"DI0\"\nnumber = 1"),
        output("signal = \"DQ0\"\nnumber = 1\nsafe = \"maybe\""),
        output("signal = \"DQ0\"\nnumber = 1\n[[output]]\nname = \"b\"\ndrive = \"Y\"\nsignal = \"DQ0\"\nnumber = 2"),
        output("signal = \"DQ0\"\nnumber = 1\n[[output]]\nname = \"a\"\ndrive = \"Q\"\nsignal = \"DQ0\"\nnumber = 2"),
        told_of("[[input]]\nname = \"a\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"dor\"\ndebounce_ms = 2000").join("\n"),
    ].join("\n\n"));
}

const ROUTER: &str = include_str!("../../../examples/router/machine.toml");

/// What is wrong with the router's file with `from` replaced.
fn router_with(from: &str, to: &str) -> String {
    assert!(ROUTER.contains(from), "{from}");
    errors(&ROUTER.replacen(from, to, 1))
}

/// What is wrong with a file.
fn errors(text: &str) -> String {
    let read = parse(text);
    read.err()
        .map_or_else(String::new, |error| error.to_string())
}

#[test]
fn homing_is_read() {
    let machine = parse(ROUTER).unwrap();
    assert!(machine.homing.at_start && !machine.homing.unreferenced_jobs);
    let [x, _, z] = &machine.axes[..] else {
        panic!("three axes")
    };
    let HomingMethod::Switch(search) = &x.homing.method else {
        panic!("a switch")
    };
    assert_eq!((&search.inputs[..], search.direction), (&[0, 1][..], -1.0));
    assert_eq!(search.max_distance, 1800.0);
    // What the drives can capture they do.
    assert_eq!(search.captures.len(), 2);
    let HomingMethod::Switch(search) = &z.homing.method else {
        panic!("a switch")
    };
    assert!(search.captures.is_empty());
    assert_eq!([x.homing.order, z.homing.order], [2, 1]);
    assert_eq!(x.homing.jog_speed, 80.0);
    assert_eq!(
        [x.rest(), x.stands(0, 0), z.stands(0, 0)],
        [0.0, 180.0, -40.0]
    );
    // Without the table an axis has an absolute encoder.
    assert!(parse(PORTAL).unwrap().axes[0].homing.is_absolute());
}

/// What the router's Z says of its switch.
const BY_SWITCH: &str = "kind = \"switch\"\norder = 1\nswitches = [\"home Z\"]\ndirection = \"positive\"\nspeed = 30.0\nslow_speed = 1.0\nback_off = 3.0";

/// What it says with a hard stop instead, against which it is searched upwards.
const ON_STOP: &str = "kind = \"hard_stop\"\ndirection = \"positive\"\nweight = \"negative\"\ntorque = 40.0\nspeed = 8.0\nback_off = 3.0";

#[test]
fn a_search_for_a_hard_stop_is_read_and_its_mistakes_are_told() {
    let switch = "# It opens at the top, as a broken wire does.\n[[input]]\nname = \"home Z\"\ndrive = \"Z\"\nsignal = \"DI4\"\nfunction = \"home\"\nactive_low = true\nsimulated = [3.0, 40.0]\n";
    let without = ROUTER.replacen(switch, "", 1);
    let with = |keys: &str| without.replacen(BY_SWITCH, keys, 1);
    let machine = parse(&with(ON_STOP)).unwrap();
    let HomingMethod::HardStop(search) = &machine.axes[2].homing.method else {
        panic!("{:?}", machine.axes[2].homing);
    };
    assert_eq!((search.direction, search.torque), (1.0, 0.4));
    assert_eq!(search.contact, Duration::from_millis(50));
    assert_eq!(search.ramps, [300.0, 6000.0]);
    for (from, to, told) in [
        (
            "weight = \"negative\"",
            "weight = \"positive\"",
            "axis \"Z\": homing: a hard stop in positive direction, to which its weight pulls it",
        ),
        ("weight = \"negative\"\n", "", "`weight`"),
        ("torque = 40.0", "torque = 101.0", "a number from 1 to 100"),
        (
            "back_off = 3.0",
            "back_off = 3.0\nslow_speed = 1.0",
            "`slow_speed`",
        ),
        (
            "speed = 8.0",
            "speed = 20.0",
            "axis \"Z\": homing: its setpoints would go 1.925 mm beyond the stop, more than the 1 mm of its following error",
        ),
        (
            "back_off = 3.0",
            "back_off = 3.0\nmax_distance = 30.0\nmin_distance = 40.0",
            "a number from 0 to 30",
        ),
    ] {
        assert!(ON_STOP.contains(from), "{from}");
        let errors = errors(&with(&ON_STOP.replacen(from, to, 1)));
        assert!(errors.contains(told), "{told}: {errors}");
    }
    // Of a drive without such an object, and of a gantry.
    let drive = "name = \"Z\"\nbus = \"main\"\nnode = 4\nmodel = \"lxm32m\"";
    let other = with(ON_STOP).replacen(drive, &drive.replace("lxm32m", "cia402_csp"), 1);
    let told = "axis \"Z\": homing: drive \"Z\" (CiA 402 CSP) has no object that limits its torque";
    assert!(errors(&other).contains(told), "{}", errors(&other));
    let x = "kind = \"switch\"\norder = 2                   # once Z is up\nswitches = [\"home X1\", \"home X2\"]\ndirection = \"negative\"\nspeed = 80.0                # mm/s, of the search\nslow_speed = 2.0            # mm/s, of the approach by which the edge is measured\nback_off = 5.0              # mm";
    let gantry = ROUTER.replacen(x, &ON_STOP.replace("\"negative\"", "\"none\""), 1);
    let told = "axis \"X\": homing: the sides of a gantry are not homed against hard stops";
    assert!(errors(&gantry).contains(told), "{}", errors(&gantry));
}

/// The router with limit switches of Y.
fn with_limits(axis: &str, homing: Option<&str>) -> String {
    let input = |name: &str, signal: &str| {
        format!(
            "[[input]]\nname = \"{name}\"\ndrive = \"Y\"\nsignal = \"{signal}\"\nfunction = \"limit\"\n\n"
        )
    };
    let inputs = input("Y-", "DI2") + &input("Y+", "DI3") + "[machine]\n";
    let y = "name = \"Y\"\ndrives = [\"Y\"]\n";
    let text = ROUTER.replacen("[machine]\n", &inputs, 1);
    let text = text.replacen(y, &format!("{y}{axis}"), 1);
    match homing {
        None => text,
        Some(homing) => {
            let begin = text.find("kind = \"switch\"\norder = 2\nswitches").unwrap();
            let end = begin + text[begin..].find("\n\n").unwrap();
            let spare = "signal = \"DI0\"\nnumber = 5";
            let home = "name = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"";
            let named = format!("name = \"home Y\"\ndrive = \"Y\"\n{spare}");
            format!("{}{homing}{}", &text[..begin], &text[end..]).replacen(home, &named, 1)
        }
    }
}

const BOTH_LIMITS: &str = "negative_limit = [\"Y-\"]\npositive_limit = [\"Y+\"]\n";

#[test]
fn limit_switches_are_read() {
    let machine = parse(&with_limits(BOTH_LIMITS, None)).unwrap();
    assert_eq!(machine.axes[1].limit_inputs, [vec![0], vec![1]]);
    assert!(machine.axes[0].limit_inputs.iter().all(Vec::is_empty));
    let by_limit = "kind = \"switch\"\nswitches = [\"Y-\"]\ndirection = \"negative\"\nspeed = 80.0\nslow_speed = 2.0\n\
                    back_off = 5.0\nposition = -4.0";
    let machine = parse(&with_limits(BOTH_LIMITS, Some(by_limit))).unwrap();
    assert_eq!(machine.axes[1].homing.switches(), [0]);

    let by_drive = "kind = \"drive\"\nspeed = 60.0\nslow_speed = 2.0\nmethod = 17\nposition = -4.0";
    let by_stop = format!("{ON_STOP}\nposition = 810.0");
    let swapped = by_limit.replace("\"negative\"", "\"positive\"");
    let on_travel = by_limit.replace("-4.0", "0.0");
    for (axis, homing, told) in [
        ("", None, "input \"Y-\": no axis ends at it"),
        (
            "negative_limit = [\"Y-\"]\npositive_limit = [\"Y*\"]\n",
            None,
            "axis \"Y\": there is no limit switch \"Y*\"",
        ),
        (
            "negative_limit = [\"home Y\"]\n",
            None,
            "axis \"Y\": there is no limit switch \"home Y\"",
        ),
        (
            "negative_limit = [\"Y-\"]\npositive_limit = [\"Y-\", \"Y+\"]\n",
            None,
            "axis \"Y\": limit switch \"Y-\" a second time",
        ),
        (
            BOTH_LIMITS,
            Some(by_drive),
            "axis \"Y\": `negative_limit` of an axis that is homed by its drive",
        ),
        (
            BOTH_LIMITS,
            Some(&by_stop),
            "axis \"Y\": a limit switch in front of the hard stop by which it is homed",
        ),
        (
            BOTH_LIMITS,
            Some(&swapped),
            "axis \"Y\": homing: there is no home switch \"Y-\"",
        ),
        (
            BOTH_LIMITS,
            Some(&on_travel),
            "axis \"Y\": homing: its soft limits go up to 0, and its limit switch \"Y-\" is on from 0 on",
        ),
    ] {
        let errors = errors(&with_limits(axis, homing));
        assert!(errors.contains(told), "{told}: {errors}");
    }
}

#[test]
fn mistakes_of_homing_are_told() {
    for (from, to, told) in [
        (
            "switches = [\"home Y\"]",
            "switches = [\"home W\"]",
            "axis \"Y\": homing: there is no home switch \"home W\"",
        ),
        (
            "switches = [\"home X1\", \"home X2\"]",
            "switches = [\"home X1\"]",
            "a switch for each of its 2 drives",
        ),
        (
            "switches = [\"home Y\"]",
            "switches = [\"home X1\"]",
            "switch \"home X1\" is that of axis \"X\" at the same time",
        ),
        (
            "switches = [\"home Y\"]",
            "switches = [\"home X1\"]",
            "input \"home Y\": no axis is homed by it",
        ),
        ("slow_speed = 1.0", "slow_speed = 31.0", "`slow_speed`"),
        (
            BY_SWITCH,
            "kind = \"drive\"\nspeed = 30.0\nslow_speed = 1.0\nmethod = 5",
            "drive \"Z\" (LXM32M) does not home by method 5",
        ),
        (
            BY_SWITCH,
            "kind = \"drive\"\nspeed = 30.0\nslow_speed = 1.0\nmethod = 36",
            "a whole number 1…35",
        ),
        (
            BY_SWITCH,
            "kind = \"drive\"\nspeed = 30.0\nslow_speed = 1.0\nmethod = 17\nabsolute = true",
            "`absolute`",
        ),
        (
            BY_SWITCH,
            "kind = \"drive\"\nspeed = 30.0\nslow_speed = 1.0\nmethod = 35",
            "`at_start` with axis \"Z\"",
        ),
        (
            "kind = \"switch\"\norder = 2                   # once Z is up\nswitches = [\"home X1\", \"home X2\"]\ndirection = \"negative\"\nspeed = 80.0                # mm/s, of the search\nslow_speed = 2.0            # mm/s, of the approach by which the edge is measured\nback_off = 5.0              # mm",
            "kind = \"drive\"\nspeed = 80.0\nslow_speed = 2.0\nmethod = 17",
            "axis \"X\": homing: the sides of a gantry do not home by themselves",
        ),
        ("speed = 30.0", "speed = 251.0", "`speed`"),
        (
            "position = 3.0\nfinal_position = 0.0",
            "position = 3.0\nfinal_position = 3.0",
            "inside the soft limits",
        ),
        (
            "following_error_limit = 1.0",
            "following_error_limit = 1.0\ndrive_soft_limits = true",
            "`drive_soft_limits` of an axis that is homed",
        ),
        (
            "active_low = true",
            "active_low = true\ndebounce_ms = 5",
            "`debounce_ms` of a home switch",
        ),
        (
            "kind = \"switch\"\norder = 1",
            "kind = \"encoder\"\norder = 1",
            "`order`",
        ),
        ("start = -40.0", "start_skew = 1.0", "`start_skew`"),
        (
            "start = -40.0",
            "start_skew_within = [0, 1]",
            "`start_skew_within`",
        ),
        ("start = -40.0", "start_within = [5, 5]", "`start_within`"),
        (
            "start = -40.0",
            "start = -40.0\nstart_within = [0, 5]",
            "`start` and `start_within`",
        ),
        (
            "switches = [\"home Z\"]",
            "switches = [\"home Z\"]\nlatch = true",
            "axis \"Z\": homing: no capture of drive \"Z\" sees switch \"home Z\"",
        ),
        (
            "switches = [\"home Z\"]",
            "switches = [\"home Z\"]\nlatch = true",
            "wire the switch to \"DI0\" or \"DI1\" of drive \"Z\", or leave it out",
        ),
    ] {
        let errors = router_with(from, to);
        assert!(errors.contains(told), "{told}: {errors}");
    }
    // A capture of the other side's drive is none of this side.
    let crossed = ROUTER.replacen(
        "drive = \"X2\"\nsignal = \"DI0\"",
        "drive = \"X1\"\nsignal = \"DI1\"",
        1,
    );
    let HomingMethod::Switch(search) = &parse(&crossed).unwrap().axes[0].homing.method else {
        panic!("a switch")
    };
    assert!(search.captures.is_empty());
    let by_hand = ROUTER.replacen(
        "kind = \"switch\"\norder = 1\nswitches = [\"home Z\"]\ndirection = \"positive\"\nspeed = \
         30.0\nslow_speed = 1.0\nback_off = 3.0\nposition = 3.0\nfinal_position = 0.0",
        "kind = \"set_here\"",
        1,
    );
    let errors = parse(&by_hand).unwrap_err().to_string();
    assert!(errors.contains("`at_start` with axis \"Z\""), "{errors}");
}

const MILL: &str = include_str!("../../../examples/mill/machine.toml");

#[test]
fn io_nodes_stand_behind_the_others_and_have_what_is_wired_to_them() {
    let machine = parse(MILL).unwrap();
    let names: Vec<_> = machine.nodes().map(|node| node.name.to_owned()).collect();
    assert_eq!(names[3], "cabinet");
    assert!(
        machine
            .nodes()
            .all(|node| node.seat.is_some() == (node.name != "cabinet"))
    );
    assert_eq!(
        machine
            .inputs
            .iter()
            .map(|input| input.node)
            .collect::<Vec<_>>(),
        [3; 3]
    );
    let speed = &machine.analog_outputs[0];
    assert_eq!(
        (speed.node, speed.place, speed.source),
        (3, 0, AnalogSource::SpindleSpeed)
    );
    let scaled =
        [0.0, 12_000.0, 24_000.0, 1e9, -24_000.0, f64::NAN].map(|value| speed.scaled(value));
    assert_eq!(scaled, [0, 16384, 32767, 32767, -32767, 0]);
    let device = machine.device(3);
    let bytes: Vec<_> = (device.spec().t_pdos.iter().chain(&device.spec().r_pdos))
        .map(|pdo| pdo.bytes)
        .collect();
    assert_eq!(bytes, [2, 1, 2]);
}

#[test]
fn analog_inputs_are_read_and_their_mistakes_told() {
    let input = |name: &str, signal: &str, rest: &str| {
        format!("[[input]]\nname = \"{name}\"\nio = \"cabinet\"\nsignal = \"{signal}\"\n{rest}\n\n")
    };
    let with =
        |inputs: &[String]| parse(&MILL.replacen("[[input]]", &(inputs.concat() + "[[input]]"), 1));
    let force = input("force", "AI1", "full_scale = 500\nnumber = 3");
    let machine = with(std::slice::from_ref(&force)).unwrap();
    let read = &machine.analog_inputs[0];
    assert_eq!((read.node, read.place, read.number), (3, 1, 3));
    let scaled = [0, i16::MAX, -i16::MAX].map(|value| read.scaled(value));
    assert_eq!(scaled, [0.0, 500.0, -500.0]);
    // T_PDO2 has both inputs up to the one in use.
    let device = machine.device(3);
    let bytes: Vec<_> = device.spec().t_pdos.iter().map(|pdo| pdo.bytes).collect();
    assert_eq!(bytes, [2, 4]);
    for (inputs, told) in [
        (
            vec![input("force", "AI1", "full_scale = 0\nnumber = 3")],
            "`full_scale`",
        ),
        (
            vec![input("force", "AI1", "full_scale = 5\nnumber = 8")],
            "0…7, E of M66",
        ),
        (
            vec![input("force", "AI1", "full_scale = 5")],
            "nothing says what it is for",
        ),
        (
            vec![input("force", "AI1", "full_scale = 5\nfunction = \"door\"")],
            "function",
        ),
        (
            vec![input("force", "DI1", "full_scale = 5\nnumber = 1")],
            "signal \"DI1\" of io \"cabinet\" (CiA 401) is digital, and has no `full_scale`",
        ),
        (
            vec![input("force", "AI1", "number = 1")],
            "signal \"AI1\" of io \"cabinet\" (CiA 401) is analog, and `full_scale` is missing",
        ),
        (
            vec![
                input("force", "DI1", "number = 7"),
                input("other", "DI2", "number = 7"),
            ],
            "input \"other\": its `number`, 7, is that of input \"force\"",
        ),
        (
            vec![
                force.clone(),
                input("other", "AI1", "full_scale = 5\nnumber = 1"),
            ],
            "its signal is that of input \"force\"",
        ),
        (
            vec![
                force.clone(),
                input("other", "AI2", "full_scale = 5\nnumber = 3"),
            ],
            "its `number` is that of input \"force\"",
        ),
        (
            vec![
                force.clone(),
                input("force", "AI2", "full_scale = 5\nnumber = 1"),
            ],
            "force",
        ),
    ] {
        let errors = with(&inputs).unwrap_err().to_string();
        assert!(errors.contains(told), "{told}: {errors}");
    }
}

proptest! {
    /// A course over time: what the input can take in, at times that ascend; nothing else.
    #[test]
    fn what_a_simulated_analog_input_tells_is_within_its_range(
        full_scale in 1e-3..1e6f64,
        // Shares of the latest time, and of the full scale; some are beyond.
        mut points in prop::collection::vec((-0.1..1.1f64, -1.2..1.2f64), 1..5),
        in_order in prop::bool::weighted(0.8),
        edge in prop::sample::select(vec![None, Some((0.0, 1.0)), Some((1.0, -1.0))]),
    ) {
        if in_order {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        if let Some(edge) = edge {
            // Both ends count.
            points = vec![edge];
        }
        let points: Vec<_> = points.iter().map(|&(at, value)| (1e6 * at, full_scale * value)).collect();
        let shown: Vec<_> = points.iter().map(|(at, value)| format!("[{at}, {value}]")).collect();
        let input = format!(
            "[[input]]\nname = \"force\"\nio = \"cabinet\"\nsignal = \"AI1\"\nfull_scale = {full_scale}\nnumber = 3\n\
             simulated = [{}]\n\n",
            shown.join(", ")
        );
        let read = parse(&MILL.replacen("[[input]]", &(input + "[[input]]"), 1));
        let ascends = points.windows(2).all(|pair| pair[0].0 < pair[1].0);
        let allowed = |&(at, value): &(f64, f64)| (0.0..=1e6).contains(&at) && value.abs() <= full_scale;
        if ascends && points.iter().all(allowed) {
            prop_assert_eq!(&read.unwrap().analog_inputs[0].simulated, &points);
        } else {
            let told = read.unwrap_err().to_string();
            prop_assert!(told.contains("input \"force\": `simulated`"), "{}", told);
            prop_assert!(told.contains("seconds ascending from 0 to 1000000"), "{}", told);
        }
    }
}

#[test]
fn mistakes_of_io_nodes_are_told() {
    for (from, to, told) in [
        (
            "model = \"cia401\"",
            "model = \"lxm32m\"",
            "io \"cabinet\": `model`",
        ),
        (
            "model = \"cia401\"",
            "model = \"cia401\"\ninputs = \"poll\"",
            "io \"cabinet\": `inputs`",
        ),
        ("node = 40", "node = 33", "node 33 is already up-down"),
        (
            "io = \"cabinet\"\nsignal = \"DO0\"",
            "io = \"box\"\nsignal = \"DO0\"",
            "there is no io \"box\"",
        ),
        (
            "io = \"cabinet\"\nsignal = \"DO0\"",
            "signal = \"DO0\"",
            "nothing says where it is",
        ),
        (
            "io = \"cabinet\"\nsignal = \"DO0\"",
            "io = \"cabinet\"\ndrive = \"up-down\"\nsignal = \"DO0\"",
            "both `drive` and `io` say where it is",
        ),
        (
            "signal = \"DO2\"",
            "signal = \"DO0\"",
            "its signal is output \"spindle on\"",
        ),
        (
            "signal = \"DO2\"",
            "signal = \"DO16\"",
            "io \"cabinet\" (CiA 401) has no such signal \"DO16\"",
        ),
        (
            "signal = \"AO0\"",
            "signal = \"DO7\"",
            "signal \"DO7\" of io \"cabinet\" (CiA 401) is digital",
        ),
        (
            "signal = \"DO2\"",
            "signal = \"AO1\"",
            "signal \"AO1\" of io \"cabinet\" (CiA 401) is analog, and `full_scale` is missing",
        ),
        (
            "full_scale = 24_000 ",
            "full_scale = 20_000 ",
            "`full_scale` is 20000, and S goes up to 24000",
        ),
        (
            "full_scale = 24_000 ",
            "safe = 24_001\nfull_scale = 24_000 ",
            "`safe` is 24001",
        ),
        (
            "max_speed = 24_000\nmin_speed = 3_000\nramp_ms = 3_000",
            "min_speed = 3_000",
            "`max_speed`",
        ),
        (
            "function = \"cycle_start\"",
            "function = \"home\"",
            "`debounce_ms` of a home switch",
        ),
        (
            "model = \"cia401\"",
            "model = \"cia401\"\nsdo = [[\"6206:1\", 0]]",
            "6206h:1 is the controller's own",
        ),
        (
            "signal = \"DI8\"",
            "signal = \"DI8\"\nsimulated = [0, 1]",
            "`simulated` of an I/O node",
        ),
    ] {
        assert!(MILL.contains(from), "{from}");
        let read = parse(&MILL.replacen(from, to, 1));
        let errors = read
            .err()
            .map_or_else(String::new, |error| error.to_string());
        assert!(errors.contains(told), "{told}: {errors}");
    }
    let home = MILL
        .replace(
            "model = \"cia401\"",
            "model = \"cia401\"\ninputs = \"event\"",
        )
        .replace(
            "signal = \"DI8\"\nnumber = 1",
            "signal = \"DI8\"\nfunction = \"home\"",
        );
    let errors = parse(&home).unwrap_err().to_string();
    assert!(
        errors.contains("a home switch of an I/O node whose inputs come by event"),
        "{errors}"
    );
    let no_spindle = MILL.replace(
        "[spindle]\nmax_speed = 24_000\nmin_speed = 3_000\nramp_ms = 3_000\n",
        "",
    );
    let errors = parse(&no_spindle).unwrap_err().to_string();
    assert!(
        errors.contains("speed of a spindle that is not there"),
        "{errors}"
    );
}

const DRILL: &str = include_str!("../../../examples/drill/machine.toml");

#[test]
fn a_drive_turns_the_spindle_or_moves_an_axis() {
    let machine = parse(DRILL).unwrap();
    let (place, drive) = machine.spindle_drive().unwrap();
    assert_eq!((place, machine.drives.len()), (3, 3));
    assert_eq!((&*drive.name, drive.tolerance), ("spindle", 0.03));
    let spindle = machine.node(place);
    assert!(spindle.seat.is_none() && spindle.id.get() == 4);
    // 3000 1/min in 0.3 s, in tenths of 1/min.
    let device = machine.device(place);
    let ramps = device.spec().setup.iter();
    let ramps = ramps.filter(|write| matches!(write.address.index, 0x6083 | 0x6084));
    assert!(ramps.map(|write| write.data.bits()).eq([100_000; 2]));

    let input = "[[input]]\nname = \"at speed\"\ndrive = \"Z\"\nsignal = \"DI1\"\nfunction = \"at_speed\"\n\n";
    let axes = "[[axis]]\nname = \"X\"";
    for (from, to, told) in [
        (
            "drive = \"spindle\"",
            "drive = \"spindel\"",
            "spindle: there is no drive \"spindel\"",
        ),
        (
            "drive = \"spindle\"",
            "drive = \"Z\"",
            "drive \"Z\" already moves axis \"Z\"",
        ),
        (
            "drives = [\"X\"]",
            "drives = [\"spindle\"]",
            "already moves axis \"X\"",
        ),
        (
            "model = \"cia402_pv\"",
            "model = \"lxm32m\"",
            "`model` \"cia402_pv\" or \"cia402_vl\"",
        ),
        ("ramp_ms = 300 ", "ramp_ms = 0 ", "`ramp_ms` is 0"),
        ("ramp_ms = 300 ", "# ", "`ramp_ms` is 0"),
        ("tolerance = 0.03", "tolerance = 0.6", "`tolerance`"),
        ("tolerance = 0.03", "gear = 0", "`gear`"),
        (
            "max_speed = 3000",
            "max_speed = 300_000_000",
            "beyond what drive \"spindle\" can be sent",
        ),
        (
            "velocity_units = 10",
            "velocity_units = 2_000_000_000",
            "beyond what drive \"spindle\" can be sent",
        ),
        ("node = 4", "node = 3", "node 3 is already Z"),
        ("name = \"spindle\"", "name = \"Z\"", "`name` is taken"),
        (
            axes,
            &format!("{input}{axes}"),
            "whose drive tells its speed",
        ),
        ("motor = \"generic-6\"", "motor = \"large\"", "`motor`"),
    ] {
        assert!(DRILL.contains(from), "{from}");
        let errors = parse(&DRILL.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(errors.contains(told), "{told}: {errors}");
    }
}

/// One bus with these drives, an axis for each.
fn one_bus(bitrate: u32, cycle_us: u64, models: &[&str]) -> String {
    let mut text = format!(
        "[machine]\nname = \"drawn\"\ncycle_us = {cycle_us}\n[[bus]]\nname = \"b\"\nbitrate = {bitrate}\n"
    );
    for (place, model) in models.iter().enumerate() {
        let _ = write!(
            text,
            "[[drive]]\nname = \"d{place}\"\nbus = \"b\"\nnode = {}\nmodel = \"{model}\"\n\
             [[axis]]\nname = \"{}\"\ndrives = [\"d{place}\"]\npitch = 10.0\nmax_velocity = 20.0\nmax_acceleration = 200.0\n\
             max_jerk = 4000.0\nsoft_limits = [-100.0, 100.0]\nfollowing_error_limit = 1.0\nstandstill_window = 0.1\n",
            place + 1,
            ["X", "Y", "Z", "U", "V", "W"][place],
        );
    }
    text
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

    /// A machine that is refused is taken in the least cycle that fits, and in no lesser one; and it is refused with
    /// setpoints at any other offset, too.
    #[test]
    fn a_machine_is_refused_where_nothing_helps_and_taken_as_is_advised(
        bitrate in prop::sample::select(&[125_000, 250_000, 500_000, 1_000_000][..]),
        half_ms in 1..24_u64,
        models in prop::collection::vec(
            prop::sample::select(&["lxm32m", "tlc5xx", "tsp10", "tsp10", "cia402_csp"][..]), 1..=6)
            .prop_union(prop::collection::vec(prop::sample::select(&["cia402_csp", "cia402_csv"][..]), 1..=6)),
    ) {
        /// No drive takes another cycle than in steps of it, µs.
        const STEP: u64 = 500;
        let machine = |cycle_us| parse(&one_bus(bitrate, cycle_us, &models)).ok();
        let check = |machine: &Machine| MachineBudget::of(machine).check();
        let refused = machine(STEP * half_ms).filter(|it| check(it).is_err());
        prop_assume!(refused.is_some());
        let mut refused = refused.unwrap();
        if let Some(least) = MachineBudget::of(&refused).buses[0].smallest_cycle() {
            let least = least.as_micros() as u64;
            let taken = machine(least).expect("its drives take that cycle");
            prop_assert_eq!(check(&taken), Ok(()), "in {} µs", least);
            for lesser in (STEP..least).step_by(STEP as usize) {
                if let Some(lesser_machine) = machine(lesser) {
                    prop_assert!(check(&lesser_machine).is_err(), "in {} µs", lesser);
                }
            }
        }
        for offset in (0..STEP * half_ms).step_by(50) {
            refused.controller.setpoint_offset = Some(Duration::from_micros(offset));
            prop_assert!(check(&refused).is_err(), "with setpoints at {} µs", offset);
        }
    }
}

/// What two buses would give is told of those whose drives could be apart, and offsets that hold where there are some.
#[test]
fn a_budget_tells_of_what_there_is() {
    let mut without = 0;
    for drives in 1..=6 {
        let machine = parse(&one_bus(1_000_000, 1000, &["lxm32m"; 6][..drives])).unwrap();
        let bus = &MachineBudget::of(&machine).buses[0];
        let told = bus.to_string();
        assert_eq!(told.contains("on two buses"), drives > 1, "{told}");
        let [earliest, latest] = bus.offsets();
        assert_eq!(told.contains("none holds"), earliest > latest, "{told}");
        without += usize::from(earliest > latest);
    }
    assert!(without > 0);
}
