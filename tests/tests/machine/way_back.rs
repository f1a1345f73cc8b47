//! The way back to a path that axes were jogged off, with `[retraction]`: up, over, down, each at an operator's
//! word.

use super::day::{go, settle};
use syncline_controller::control::Event;
use syncline_controller::session::{Command, Jog};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

const BUS: &str = "[[bus]]\nname = \"portal\"";

const RETRACTION: &str = "[retraction]\naxis = \"Z\"\nclearance = -20.0\napproach_speed = 10.0\n\n";

const PROGRAM: &str = "\
G17 G21 G90 G94 G61 F3000
G0 X100 Y100
G1 Z-50
G1 X300
M0
G1 X400
M2
";

fn setpoint(rig: &Rig) -> [f64; 3] {
    let [x, y, z, ..] = rig.session.status().setpoint;
    [x, y, z]
}

fn jog(rig: &mut Rig, axis: AxisLetter, distance: f64) {
    let speed = None;
    go(
        rig,
        Command::Jog(Jog::By {
            axis,
            distance,
            speed,
        }),
    );
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.speed == 0.0));
    settle(rig);
}

/// What was told of the way back since the last time.
fn told(rig: &mut Rig) -> Vec<String> {
    let layout = rig.layout.clone();
    let legs = rig.events.drain(..);
    let legs = legs.filter(|event| matches!(event, Event::NextLeg(_)));
    legs.filter_map(|leg| leg.describe(&*layout)).collect()
}

/// Begins a leg and waits for its end; what was told meanwhile.
fn leg(rig: &mut Rig) -> Vec<String> {
    rig.command(Command::CycleStart);
    settle(rig);
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.speed == 0.0));
    settle(rig);
    told(rig)
}

#[test]
fn up_over_and_down_from_a_hold_and_from_a_program_stop() {
    let file = format!("{RETRACTION}{BUS}");
    let mut rig = Rig::new("portal", &[(BUS, &file)], PROGRAM, |_, _| ());
    rig.goes_on = false;
    rig.run_until(|rig| {
        let [x, _, z] = setpoint(rig);
        z == -50.0 && x > 200.0
    });
    go(&mut rig, Command::FeedHold);
    let left = setpoint(&rig);
    assert!(told(&mut rig).is_empty(), "on the path");
    // Beside the path, and deeper.
    jog(&mut rig, AxisLetter::Z, -10.0);
    jog(&mut rig, AxisLetter::Y, 30.0);
    let up = "way back: cycle start takes Z to -20.000 in machine coordinates";
    assert_eq!(told(&mut rig).last().unwrap(), up);
    let over = format!(
        "way back: cycle start takes Y to {:.3} in machine coordinates",
        left[1]
    );
    assert_eq!(leg(&mut rig), [over]);
    assert_eq!(setpoint(&rig), [left[0], left[1] + 30.0, -20.0]);
    // Away once more, and higher: over to the path at that height.
    jog(&mut rig, AxisLetter::X, 5.0);
    jog(&mut rig, AxisLetter::Z, 7.0);
    told(&mut rig);
    let down = "way back: cycle start takes Z to -50.000 at 600 mm/min in machine coordinates, \
                where the path goes on";
    assert_eq!(leg(&mut rig), [down]);
    assert_eq!(setpoint(&rig), [left[0], left[1], -13.0]);
    rig.command(Command::CycleStart);
    settle(&mut rig);
    assert_eq!(setpoint(&rig), [300.0, 100.0, -50.0], "at M0");
    // The same from there; the last leg leads on through the stop.
    jog(&mut rig, AxisLetter::Y, -30.0);
    assert_eq!(told(&mut rig), [up]);
    let over = "way back: cycle start takes Y to 100.000 in machine coordinates";
    assert_eq!(leg(&mut rig), [over]);
    assert_eq!(leg(&mut rig), [down]);
    rig.command(Command::CycleStart);
    rig.run_until(|rig| setpoint(rig)[0] > 301.0);
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{summary:?}");
}

#[test]
fn mistakes_of_the_table() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "M2\n");
    for (wrong, right, message) in [
        (
            "\"Z\"",
            "\"B\"",
            "allowed: the name of a linear axis: X, Y, Z",
        ),
        ("-20.0", "0.5", "allowed: within the soft limits of Z"),
        ("10.0", "1e4", "allowed: up to `max_velocity` of Z"),
        ("10.0", "0", "allowed: a number above 0"),
        ("axis = \"Z\"\n", "", "missing key `axis`"),
    ] {
        let table = RETRACTION.replacen(wrong, right, 1);
        let text = machine_with("portal", &[(BUS, &format!("{table}{BUS}"))]);
        let machine = folder.file("machine.toml", &text);
        let output = (syncline().arg("check").args([&machine, &program]).output()).unwrap();
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 2, "{errors}");
        assert!(errors.contains(message), "{errors}");
    }
}
