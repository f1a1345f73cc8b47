//! A tool setter: tools measured by programs, and contact that nobody meant.

use proptest::prelude::*;
use syncline_controller::control::fault::BlockCause;
use syncline_controller::control::{End, Event, Fault, KnownBy};
use syncline_controller::machine::Machine;
use syncline_controller::program::Programs;
use syncline_controller::session::{Command, Jog};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::Rig;

use super::day::{go, mdi, settle};

/// The setter at an input that Z captures, or at one that it does not; Z-70 is where the spindle's nose would meet it.
fn wired(signal: &str, length: f64) -> String {
    format!(
        "[[input]]\nname = \"setter\"\ndrive = \"up-down\"\nsignal = \"{signal}\"\nfunction = \"tool_setter\"\n\
         [simulation.tool_setter]\nx = 80\ny = -40\nz = -70\ntool_length = {length}\n\n[model.lxm32m]"
    )
}

fn rig(signal: &str, length: f64, program: &str) -> Rig {
    let wired = wired(signal, length);
    Rig::new("xyz", &[("[model.lxm32m]", &wired)], program, |_, _| ())
}

/// As `docs/probing.md` has it.
const MEASURE: &str = "\
O<tool_length> sub
  G59.3 G49 G90 G94 G21
  G53 G0 Z0                        (clear of everything)
  G0 X0 Y0
  G38.2 Z1 F300                    (coarse, down to 1 mm above the bare nose)
  #1 = #5063
  G0 Z[#1 + 2]
  G38.2 Z1 F30
  G10 L1 P#5400 Z#5063             (its length, in the tool table)
  G53 G0 Z0
  G54 G43
O<tool_length> endsub
";

/// Measures tool 7, shows what the table says, and brings its tip down on what G54 has at Z-60.
fn program() -> String {
    format!(
        "{MEASURE}G10 L2 P9 X80 Y-40 Z-70\nM61 Q7\nO<tool_length> call\n(debug, #5403)\n\
         G10 L2 P1 X0 Y0 Z-60\nG0 Z0\nM2\n"
    )
}

/// What it told the length to be, and where Z came to rest in the end.
fn measured(mut rig: Rig) -> (f64, f64) {
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    let told = rig.messages.last().expect("the length is told").1.parse();
    (
        told.expect("a number"),
        rig.rows.last().unwrap().plan.position[2],
    )
}

#[test]
fn the_page_has_the_program_that_is_tested() {
    let page = include_str!("../../../docs/probing.md");
    assert!(page.contains(MEASURE));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Each length is found, as well as its contact is known, and the tip is where the program has it: by a contact that closes
    /// and by one that opens.
    #[test]
    fn a_program_measures_a_tool(length in 5.0..60.0f64, is_captured: bool, opens: bool) {
        let signal = if is_captured { "DI0" } else { "DI3" };
        let mut wired = wired(signal, length);
        if opens {
            wired = wired.replacen("function", "active_low = true\nfunction", 1);
        }
        let rig = Rig::new("xyz", &[("[model.lxm32m]", &wired)], &program(), |_, _| ());
        let (found, z) = measured(rig);
        // 2 increments; or half of what Z goes at 0.5 mm/s in a cycle.
        let off = if is_captured { 0.0005 } else { 0.002 };
        prop_assert!((found - length).abs() <= off, "{} for {}", found, length);
        prop_assert!((z - (found - 60.0)).abs() < 1e-5, "{} with {}", z, found);
    }
}

/// Z captures a probe beside it: each is as exact as it is alone, contacts that come and those that are lost.
#[test]
fn a_probe_at_the_same_drive_is_captured_as_well() {
    let beside = |program: &str| {
        let probe = "[[input]]\nname = \"probe\"\ndrive = \"up-down\"\nsignal = \"DI1\"\nfunction = \"probe\"\n\
                     [[simulation.workpiece]]\nname = \"table\"\nshape = \"box\"\nx = [-10, 10]\ny = [-10, 10]\nz = [-90, -61.2345]\n";
        let wired = format!("{probe}{}", wired("DI0", 33.3));
        Rig::new("xyz", &[("[model.lxm32m]", &wired)], program, |_, _| ())
    };
    // Fast, so that samples would not do.
    let moves = "G21 G90\nG0 X0 Y0\nG38.2 Z-80 F600\n(debug, #5063)\nG38.4 Z-50 F600\n(debug, #5063)\nG0 Z0\n\
                 G0 X80 Y-40\nG38.2 Z-80 F600\n(debug, #5063)\nG38.4 Z-20 F600\n(debug, #5063)\nG0 Z0\n\
                 G0 X0 Y0\nG38.2 Z-80 F600\n(debug, #5063)\nM2\n";
    let mut rig = beside(moves);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let known = rig.events.iter().filter_map(|event| match event {
        Event::Probed { found, .. } => found.map(|(_, by)| by),
        _ => None,
    });
    assert_eq!(known.collect::<Vec<_>>(), [KnownBy::Captured; 5]);
    let places = [-61.2345, -61.2345, -36.7, -36.7, -61.2345];
    let found = rig
        .messages
        .iter()
        .map(|told| told.1.parse::<f64>().unwrap());
    let found: Vec<f64> = found.collect();
    assert_eq!(found.len(), places.len(), "{found:?}");
    for (z, place) in found.iter().zip(places) {
        assert!((z - place).abs() < 0.0005, "{z} for {place}");
    }
}

/// A tool that comes down on it in G0 or G1, or in a jog, stops.
#[test]
fn contact_while_nobody_probes_stops() {
    for code in ["G0", "G1 F1200"] {
        let mut rig = rig(
            "DI0",
            50.0,
            &format!("G21 G90\nG0 X80 Y-40\n{code} Z-60\nM2\n"),
        );
        let fault = rig.finish_with_fault();
        assert_eq!(fault, Fault::Touched, "{code}");
        assert!(fault.describe(&*rig.layout).contains("tool setter"));
        assert!(rig.ends_at_rest());
    }
    let wired = wired("DI0", 50.0);
    let mut rig = Rig::staying_on("xyz", &[("[model.lxm32m]", &wired)], |_, _| ());
    settle(&mut rig);
    mdi(&mut rig, "G0 X80 Y-40");
    mdi(&mut rig, "G0 Z-15");
    go(
        &mut rig,
        Command::Jog(Jog::By {
            axis: AxisLetter::Z,
            distance: -50.0,
            speed: Some(20.0),
        }),
    );
    assert!(rig.events.contains(&Event::Touched), "{:?}", rig.events);
    let z = rig.session.status().actual[2];
    assert!((-22.0..-20.0).contains(&z), "{z}");
}

/// Beside it nothing is touched: the probing fails, as without contact.
#[test]
fn a_probing_beside_it_fails() {
    let mut rig = rig("DI0", 50.0, "G21 G90\nG0 X88 Y-40\nG38.2 Z-50 F300\nM2\n");
    let fault = rig.finish_with_fault();
    assert!(
        matches!(fault, Fault::Block(_, BlockCause::Probing(_))),
        "{fault:?}"
    );
}

/// G38.2 of a machine that has neither is refused when the program is checked; the setter alone will do.
#[test]
fn a_machine_with_a_setter_can_probe() {
    let folder = Folder::new();
    let check = |replacements: &[(&str, &str)]| {
        let file = folder.file("machine.toml", &machine_with("xyz", replacements));
        let machine = Machine::load(&file).unwrap();
        let programs = Programs::new(&machine, &file).unwrap();
        let program = programs.text("part.ngc", b"G21 G90\nG38.2 Z-10 F100\nM2\n".as_slice());
        let checked = program.check(machine.rest()).map(|_| ());
        checked.map_err(|error| error.to_string())
    };
    let refused = check(&[]).unwrap_err();
    assert!(refused.contains("tool_setter"), "{refused}");
    let wired = wired("DI0", 10.0);
    check(&[("[model.lxm32m]", &wired)]).unwrap();
}
