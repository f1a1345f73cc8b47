//! A machine whose setpoints are shaped against its vibrations.

use super::day::{go, settle};
use proptest::prelude::*;
use proptest::sample::select;
use std::path::Path;
use syncline_controller::control::{End, Event, Hold, Order, Phase, Refusal, Switch};
use syncline_controller::machine::Machine;
use syncline_controller::session::{Command, Direction, Jog, Override};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// The portal with a shaper of some 125 ms.
const SHAPED: (&str, &str) = (
    "[[bus]]\nname = \"portal\"",
    "[shaper]\nkind = \"zvd\"\nmodes = [[8.0, 0.02]]\n\n[[bus]]\nname = \"portal\"",
);

/// How long that is, rows.
const LENGTH: usize = 63;

pub(crate) fn portal(shaped: bool, program: &str) -> Rig {
    let replaced: &[(&str, &str)] = if shaped { &[SHAPED] } else { &[] };
    Rig::new("portal", replaced, program, |_, _| ())
}

/// Lines with corners, and a line into an arc without one, far slower than what the shaper leaves of an arc.
const CORNERS: &str = "G17 G21 G90 G94 G61 F6000\nG1 X100 Y40\nX160\nG4 P0.05\nY120 Z-10\nG1 X120 Y120\n\
                       G0 X0 Y0 Z0\nM2\n";

/// Under G61 and G61.1 the path is exact although it is shaped, and no setpoint leaves its limits.
#[test]
fn an_exact_path_stays_exact_and_inside_its_limits() {
    for program in [CORNERS.to_owned(), CORNERS.replace("G61 ", "G61.1 ")] {
        let plain = portal(false, &program).judge();
        let shaped = portal(true, &program).judge();
        assert_eq!(shaped.verdict, "pass", "{:?}", shaped.violations);
        let [plain_off, off] = [&plain, &shaped].map(|it| it.path.max_deviation_mm);
        assert!(off <= plain_off + 1e-9, "{off} {plain_off}");
        assert!(
            shaped.duration_s > plain.duration_s + 0.125,
            "{}",
            shaped.duration_s
        );
    }
}

/// Two arcs between lines that touch them, and a corner; then the same again under G64.
const ARCS: &str = "G17 G21 G90 G94 G61 F6000\nG0 X100 Y100\nG1 X160\nG3 X160 Y120 J10\nG1 X120\nG2 X100 Y140 J20\nG1 Y180\nX140\n\
                    G0 X100 Y100\nG64 P0.05\nG1 X160\nG3 X160 Y120 J10\nG1 X120\nG2 X100 Y140 J20\nG1 Y180\nX140\nM2\n";

/// Under G61 arcs are as exact as without a shaper, and take a fraction of the time that they take by coordinates; what is in the
/// same program under G64 is cut by no more than its tolerance, whichever the method.
#[test]
fn arcs_under_g61_are_exact_by_the_clock() {
    let exact = ARCS
        .split_once("G64")
        .map(|(exact, _)| format!("{exact}M2\n"));
    let run = |method: &str, program: &str| {
        let with = format!("{method}\n\n{}", SHAPED.0);
        let with = SHAPED.1.replace(SHAPED.0, "") + &with;
        let mut rig = Rig::new("portal", &[(SHAPED.0, &with)], program, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        rig.trace().assert_within_limits();
        let with = [(SHAPED.0, &*with)];
        Rig::new("portal", &with, program, |_, _| ()).judge()
    };
    let exact = exact.unwrap();
    let plain = portal(false, &exact).judge();
    let [clock, chosen, coordinates] =
        ["", "method = \"clock\"", "method = \"coordinates\""].map(|method| run(method, &exact));
    for (name, it) in [("clock", &clock), ("coordinates", &coordinates)] {
        println!(
            "| {name} | {:.2} s | {:.6} mm |",
            it.duration_s, it.path.max_deviation_mm
        );
        assert_eq!(it.verdict, "pass", "{:?}", it.violations);
    }
    let off = clock.path.max_deviation_mm;
    assert!(off <= plain.path.max_deviation_mm + 1e-9, "{off}");
    assert_eq!(clock.duration_s, chosen.duration_s);
    let [longer, longest] = [&clock, &coordinates].map(|it| it.duration_s - plain.duration_s);
    assert!(
        0.125 < longer && longer < 0.3 * longest,
        "{longer} {longest}"
    );
    for method in ["", "method = \"clock\"", "method = \"coordinates\""] {
        let both = run(method, ARCS);
        assert_eq!(both.verdict, "pass", "{method}: {:?}", both.violations);
        let off = both.path.max_deviation_mm;
        assert!(off <= 0.05 + 1e-9, "{method}: {off}");
    }
}

/// What shaping takes off a curve is told, and no more than is allowed: then the curve is slower.
#[test]
fn a_curve_is_cut_by_no_more_than_it_may_be() {
    let feed = 3000.0 / 60.0;
    let circle = |tolerance: &str| {
        let program = format!(
            "G21 G90 G64 P{tolerance} F3000\nG0 X100 Y100\nG4 P0.1\nG2 X100 Y100 I50\nM2\n"
        );
        portal(true, &program).judge()
    };
    // κ v² σ² / 2, σ² = T² / 8.
    let predicted = feed * feed / 50.0 * (0.125 * 0.125 / 8.0) / 2.0;
    let fits = circle("0.2");
    assert_eq!(fits.verdict, "pass", "{:?}", fits.violations);
    let off = fits.path.max_deviation_mm;
    assert!((off / predicted - 1.0).abs() < 0.05, "{off} {predicted}");
    // Half of the tolerance is the shaper's.
    let tight = circle("0.01");
    assert_eq!(tight.verdict, "pass", "{:?}", tight.violations);
    let off = tight.path.max_deviation_mm;
    assert!((off / 0.005 - 1.0).abs() < 0.05, "{off}");
    let slower = (predicted / 0.005_f64).sqrt();
    let longer = tight.duration_s - fits.duration_s;
    let expected = std::f64::consts::TAU * 50.0 / feed * (slower - 1.0);
    assert!(
        (longer / expected - 1.0).abs() < 0.05,
        "{longer} {expected}"
    );
}

/// `check` tells it beforehand.
#[test]
fn check_tells_of_arcs_that_are_slowed_down() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("portal", &[SHAPED]));
    let plain = folder.machine("portal");
    let program = "G21 G90 G64 P0.01 F3000\nG0 X100 Y100\nG2 X100 Y100 I50\nG64 P0.2\nG3 X100 Y100 I50\nG64 P0.001\nG2 X100 Y100 J9\nM2\n";
    let program = folder.file("part.ngc", program);
    for (machine, told) in [
        (
            &machine,
            Some(
                "shaper: 2 arcs are slowed down, so that they are left by no more than their mode allows; line 7 to 4 %",
            ),
        ),
        (&plain, None),
    ] {
        let output = syncline()
            .arg("check")
            .args([machine, &program])
            .output()
            .unwrap();
        let (code, out, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        match told {
            Some(told) => assert!(out.contains(told), "{out}"),
            None => assert!(!out.contains("shaper"), "{out}"),
        }
    }
}

/// Who steps back again and again cuts no corner: from one block into the one before it leads only once the axes rest.
#[test]
fn a_second_step_back_waits_until_the_axes_have_come_to_the_corner() {
    let program = "G21 G90 G61.1 F6000\nG0 X100 Y100\nG1 X160\nY160\nM2\n";
    let mut rig = portal(true, program);
    let at = |rig: &Rig| {
        rig.rows.last().map_or([0.0; 2], |row| {
            let [x, y, ..] = row.plan.position;
            [x, y]
        })
    };
    rig.run_until(|rig| at(rig)[1] > 130.0);
    let (mut refused, first) = (0, rig.rows.len());
    while at(&rig)[0] > 130.0 {
        let rows = rig.rows.len();
        rig.run_until(|rig| rig.rows.len() > rows);
        match rig.controller().obey(Order::Retrace) {
            Ok(()) => {}
            Err(Refusal::Moving) => refused += 1,
            Err(other) => panic!("{other}"),
        }
        assert!(rows < first + 5_000, "it never goes back");
    }
    assert!((1..=LENGTH).contains(&refused), "{refused}");
    for row in &rig.rows[first..] {
        let [x, y, ..] = row.plan.position;
        let off = (x - 160.0).abs().min((y - 100.0).abs());
        assert!(off < 1e-6, "{off} mm beside the path at {x} {y}");
    }
}

/// Rows from an order on until the axes' setpoints rest.
fn rows_to_rest(rig: &mut Rig, from: usize) -> usize {
    rig.run_until(|rig| {
        let rows = rig.rows.len();
        let positions = rig.rows[rows.saturating_sub(2 * LENGTH)..].iter();
        let mut positions = positions.map(|row| row.plan.position);
        let first = positions.next();
        rows > from + 2 * LENGTH && positions.all(|it| Some(it) == first)
    });
    rig.rows.len() - 2 * LENGTH - from
}

/// A feed hold ends later by the shaper's length, and is told once the axes rest; what was held goes on to its end.
#[test]
fn a_hold_ends_later_by_the_shapers_length() {
    let held = |shaped: bool| {
        let mut rig = portal(shaped, "G21 G90 G61\nG1 X400 F12000\nM2\n");
        rig.run_to_row(500);
        rig.command(Command::FeedHold);
        let rows = rows_to_rest(&mut rig, 500);
        rig.run_until(|rig| rig.events.contains(&Event::Held(Hold::Operator)));
        rig.command(Command::Resume);
        assert_eq!(rig.finish(), End::Finished);
        rig.trace().assert_within_limits();
        rows
    };
    let (plain, shaped) = (held(false), held(true));
    assert!(shaped.abs_diff(plain + LENGTH) <= 2, "{shaped} {plain}");
}

/// A stop for a fault goes past the shaper: it takes no longer than one without a shaper.
#[test]
fn a_stop_for_a_fault_goes_past_the_shaper() {
    let stopped = |shaped: bool| {
        let mut rig = portal(shaped, "G21 G90 G61\nG1 X400 Y200 F12000\nM2\n");
        rig.run_to_row(500);
        rig.bus().tear_bursts = 1;
        rig.run_to(Phase::Stop);
        let from = rig.rows.len();
        let rows = rig.rows.len();
        while rig.controller().phase() == Phase::Stop && rig.step() {}
        let moving = rig.rows[rows..]
            .iter()
            .filter(|row| row.plan.speed > 0.0)
            .count();
        rig.finish_with_fault();
        rig.trace().assert_within_limits();
        assert!(rig.ends_at_rest());
        assert!(from >= 500);
        moving
    };
    let (plain, shaped) = (stopped(false), stopped(true));
    assert!(shaped <= plain + 5, "{shaped} {plain}");
}

/// M-codes come where they stand on the shaped path.
#[test]
fn what_is_switched_is_switched_at_its_place() {
    let program = "G21 G90 G64 P0.01 F6000\nG1 X60\nM8\nG1 X120\nM9\nX180\nM2\n";
    let exact = program.replace("G64 P0.01", "G61");
    for (shaped, program) in [(false, program), (true, program), (true, &*exact)] {
        let mut rig = portal(shaped, program);
        let mut places = Vec::new();
        let mut told = 0;
        while rig.step() {
            let switched = rig.events.iter().filter(|event| {
                matches!(
                    event,
                    Event::Switched {
                        switch: Switch::Coolant(_),
                        ..
                    }
                )
            });
            let count = switched.count();
            if count > told {
                told = count;
                places.push(rig.rows.last().map_or(0.0, |row| row.plan.position[0]));
            }
        }
        assert_eq!(places.len(), 2, "{places:?}");
        for (place, wanted) in places.iter().zip([60.0, 120.0]) {
            // 100 mm/s; a cycle or two of the log.
            assert!((place - wanted).abs() < 0.7, "{shaped}: {places:?}");
        }
    }
}

/// The whole program of the examples, with what it leaves of its curves.
#[test]
fn a_shaped_program_keeps_the_limits_of_every_axis() {
    let mut rig = portal(true, PORTAL_PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

#[test]
fn what_a_shaper_cannot_be_is_refused_by_name() {
    for (keys, told) in [
        ("kind = \"zvdd\"\nmodes = [[8.0, 0.02]]", "nearest: \"zvd\""),
        (
            "kind = \"zv\"\nmodes = [[8.0, 0.02]]\nmethod = \"path\"",
            "\"clock\" or \"coordinates\"",
        ),
        ("kind = \"zv\"", "modes"),
        ("kind = \"zv\"\nmodes = []", "0 `modes`"),
        ("kind = \"zv\"\nmodes = [[9, 0.1], [8, 0.1]]", "ascending"),
        (
            "kind = \"zv\"\nmodes = [[8, 1.0]]",
            "damping ratios from 0 to 0.3",
        ),
        (
            "kind = \"zv\"\nmodes = [[80, 0.0]]",
            "up to a tenth of the frequency of SYNC, 50 Hz",
        ),
    ] {
        let with = format!("[shaper]\n{keys}\n\n{}", SHAPED.0);
        let file = machine_with("portal", &[(SHAPED.0, &with)]);
        let refused = Machine::parse(Path::new("portal.toml"), &file)
            .unwrap_err()
            .to_string();
        assert!(refused.contains(told), "{keys}: {refused}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 20, ..ProptestConfig::with_cases(6) })]

    /// What is told of how far a jog goes on counts what the shaper has still to bring.
    #[test]
    fn a_jog_goes_on_as_far_as_is_told(
        kind in select(vec![None, Some("zv"), Some("zvd"), Some("ei"), Some("two_hump_ei")]),
        frequency in 3.0..20.0f64, speed in 10.0..700.0f64,
    ) {
        let shaper = kind.map(|kind| {
            let shaper = format!("[shaper]\nkind = \"{kind}\"\nmodes = [[{frequency:.3}, 0.02]]\n\n");
            ("[[bus]]\nname = \"portal\"", shaper + "[[bus]]\nname = \"portal\"")
        });
        let changes: Vec<_> = shaper.iter().map(|(from, to)| (*from, &**to)).collect();
        let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
        settle(&mut rig);
        go(&mut rig, Command::RapidOverride(Override::To(100.0)));
        let axis = AxisLetter::X;
        let jog = Jog::Continuous { axis, direction: Direction::Positive, speed: Some(speed) };
        rig.command(Command::Jog(jog));
        let velocity = |rig: &Rig| rig.rows.last().map_or(0.0, |row| row.plan.velocity[0]);
        let mut steady = 0;
        while steady < 20 {
            steady = if velocity(&rig) > speed - 1e-6 { steady + 1 } else { 0 };
            prop_assert!(rig.step());
            rig.command(Command::RenewJog(axis));
        }
        let position = |rig: &Rig| rig.rows.last().map_or(0.0, |row| row.plan.position[0]);
        let from = position(&rig);
        go(&mut rig, Command::EndJog(axis));
        let gone = position(&rig) - from;
        let told = rig.machine.axes[0].stopping_distance(speed);
        // The command takes a few cycles of 2 ms until it is obeyed.
        let reaction = 5.0 * 2e-3 * speed;
        prop_assert!(gone >= told - 1e-6 && gone <= told + reaction, "{gone} mm of {told}");
    }
}
