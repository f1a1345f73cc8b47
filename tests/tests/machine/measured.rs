//! Encoders on shafts of their own, which are no axis' feedback: a belt beside the portal, by a TWK CRN and by CiA 406.

use super::velocity::LOSSES_OF_ENCODERS;
use proptest::prelude::*;
use std::fs;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, NodeId};
use syncline_controller::control::fault::DeviceCause;
use syncline_controller::control::{End, Fault, MeasuredSample};
use syncline_controller::observe::flight_recorder::FlightRecorder;
use syncline_controller::observe::frames::VIRTUAL_ORIGIN;
use syncline_drives::twin::{Config, Disturbance};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// Its place behind the drives of the machine file.
const BELT: usize = 4;

/// Of the belt for one turn, mm.
const PITCH: f64 = 200.0;

/// Turns after which both begin anew.
const TURNS: f64 = 4096.0;

const PROGRAM: &str = "G21 G90 G94 G61\nG1 X60 Y40 F6000\nG4 P0.3\nX0 Y0\nM2\n";

fn belt(model: &str, speed: f64) -> String {
    format!(
        "[[encoder]]\nname = \"belt\"\nbus = \"portal\"\nnode = 5\nmodel = \"{model}\"\n\
         measured = true\npitch = {PITCH}\nsimulated_speed = {speed:?}\n\n[[axis]]\nname = \"X\""
    )
}

/// The portal beside a belt that goes so fast, mm/s.
fn portal(model: &str, speed: f64, program: &str, configure: impl Fn(usize, &mut Config)) -> Rig {
    let changes = [("[[axis]]\nname = \"X\"", &*belt(model, speed))];
    Rig::new("portal", &changes, program, configure)
}

/// Where the belt was at each SYNC, mm.
fn positions(rig: &Rig) -> Vec<f64> {
    let samples = rig
        .rows
        .iter()
        .map(|row| row.measured[0].expect("it is sampled"));
    samples
        .map(|MeasuredSample { position, .. }| position)
        .collect()
}

/// That it went at that speed all the time, to so many increments of the encoder.
fn goes_at(rig: &Rig, speed: f64) {
    let positions = positions(rig);
    let period = rig.machine.cycle.as_secs_f64();
    let resolution = rig.machine.encoders[0].scaling.resolution();
    for (cycle, position) in positions.iter().enumerate() {
        let there = positions[0] + speed * period * cycle as f64;
        // Its clock is not the controller's, and its sample a few µs behind SYNC.
        let off = 3.0 * resolution + 1e-3 * speed.abs();
        assert!(
            (position - there).abs() <= off,
            "{cycle}: {position}, {there}"
        );
    }
}

#[test]
fn a_belt_is_where_it_is_at_each_sync() {
    for model in ["twk_crn", "cia406"] {
        for speed in [0.0, 350.0, -350.0] {
            let mut rig = portal(model, speed, PROGRAM, |_, _| ());
            assert_eq!(rig.finish(), End::Finished, "{model}: {:?}", rig.events);
            goes_at(&rig, speed);
            let shown = rig.session.status().measured[0].expect("it is shown");
            assert!((shown.position - positions(&rig).last().unwrap()).abs() < 1.0);
            assert_eq!(rig.rows[0].measured[1..], [None; 3]);
        }
    }
}

/// Behind the last increment of its range it counts on, and backwards below its first one.
#[test]
fn a_belt_counts_on_behind_its_range() {
    // Behind the way that it goes until the program begins.
    for (turns, speed) in [(TURNS - 3.5, 400.0), (3.5, -400.0)] {
        let mut rig = portal("twk_crn", speed, PROGRAM, |device, config| {
            if device == BELT {
                config.position = turns;
            }
        });
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        goes_at(&rig, speed);
        let end = positions(&rig).last().copied().unwrap();
        let range = 0.0..TURNS * PITCH;
        assert!(!range.contains(&end), "{end}");
    }
}

/// Nothing follows it: what the drives are sent is the same, whatever it does.
#[test]
fn nothing_moves_by_it() {
    let frames = |speed: f64, by: f64| {
        let mut rig = portal("twk_crn", speed, PROGRAM, |_, _| ());
        rig.run_to_row(300);
        rig.slip(0, by);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let set = rig.rows.iter().map(|row| row.plan.position);
        set.collect::<Vec<_>>()
    };
    assert_eq!(frames(0.0, 0.0), frames(500.0, 3.25));
}

/// Turned by hand it is where it was turned to, at the next SYNC.
#[test]
fn a_shaft_that_is_turned_by_hand() {
    let mut rig = portal("twk_crn", 0.0, PROGRAM, |_, _| ());
    rig.run_to_row(300);
    rig.slip(0, -0.25);
    rig.run_to_row(303);
    let positions = positions(&rig);
    let turned = positions[302] - positions[299];
    assert!((turned + 0.25 * PITCH).abs() < 0.1, "{turned}");
}

#[test]
fn a_belt_that_is_lost_stops_the_machine_on_its_path() {
    for (disturbance, text) in LOSSES_OF_ENCODERS {
        let mut rig = portal("twk_crn", 350.0, PORTAL_PROGRAM, |_, _| ());
        rig.run_to_row(400);
        rig.twin(BELT).disturb(disturbance);
        let fault = rig.finish_with_fault();
        let told = fault.describe(&*rig.layout);
        assert!(
            told.starts_with("node 5 (belt, TWK CRN): ") && told.contains(text),
            "{told}"
        );
        // No drive was quick-stopped.
        assert!(rig.rows.iter().all(|row| !row.axes[0].by_itself));
        rig.trace().assert_within_limits();
        assert!(rig.ends_at_rest());
    }
}

/// What led to a fault has where it was.
#[test]
fn the_flight_recorder_has_a_column_of_its_name() {
    let changes = [("[[axis]]\nname = \"X\"", &*belt("cia406", 350.0))];
    let mut rig = Rig::new("portal", &changes, PROGRAM, |_, _| ());
    let folder = FlightRecorder::folder(&rig.folder.path("machine.toml"));
    let recorder = FlightRecorder::new(&rig.machine, &rig.layout, folder.clone(), VIRTUAL_ORIGIN);
    rig.session.record_faults(recorder.expect("it keeps some"));
    rig.run_to_row(300);
    rig.twin(BELT).disturb(Disturbance::Mute(true));
    let fault = rig.finish_with_fault();
    let cause = DeviceCause::MissingTPdo { misses: 2 };
    assert_eq!(fault, Fault::Device(BELT, cause));
    let file = folder.join("fault-1.csv");
    for _ in 0..2000 {
        if file.exists() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut column = None;
    let mut seen = Vec::new();
    for line in fs::read_to_string(file).unwrap().lines() {
        let fields: Vec<&str> = line.split(',').collect();
        match column {
            None => column = fields.iter().position(|it| *it == "belt_act"),
            Some(column) => seen.push(fields[column].parse::<f64>().unwrap()),
        }
    }
    assert!(seen.len() > 250, "{}", seen.len());
    let went = (seen[200] - seen[0]) / (200.0 * rig.machine.cycle.as_secs_f64());
    assert!((went - 350.0).abs() < 1.0, "{went}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Wherever it begins, however fast it goes, to either side.
    #[test]
    fn every_belt_is_counted(
        turns in 0.0..TURNS, speed in -20_000.0..20_000.0f64, twk: bool, seed: u64,
    ) {
        let model = if twk { "twk_crn" } else { "cia406" };
        let mut rig = portal(model, speed, "G21 G90\nG1 X5 F6000\nM2\n", |device, config| {
            config.seed = seed;
            if device == BELT {
                config.position = turns;
            }
        });
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        goes_at(&rig, speed);
    }

    /// A preset would take the position of that instant. None is written, nothing is stored, and T_PDO1 is off before it could
    /// flood the bus, however fast it turns as it is set up, scaled or not, at every nth SYNC, and where it begins anew.
    #[test]
    fn no_preset_is_written_on_a_turning_shaft(
        speed in prop_oneof![Just(0.0), -20_000.0..20_000.0f64],
        model in prop::sample::select(vec!["twk_crn", "cia406"]),
        units in prop::sample::select(vec![0, 1, 4000, 8192]),
        divider in 1..=10u32,
        reset in prop::option::of(1..200usize),
        seed: u64,
    ) {
        let belt = belt(model, speed).replace("measured", &format!("sync_divider = {divider}\nmeasured"));
        let table = format!("[model.twk_crn]\nunits_per_turn = {units}\n\n{belt}");
        let changes = [("[[axis]]\nname = \"X\"", &*table)];
        let mut rig = Rig::new("portal", &changes, PROGRAM, |device, config| {
            config.seed = seed;
            config.position = if device == BELT { 17.3 } else { config.position };
        });
        if let Some(row) = reset {
            rig.run_to_row(row);
            rig.twin(BELT).disturb(Disturbance::Reset);
            rig.finish_with_fault();
        } else {
            prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        }
        let node = NodeId::new(5).unwrap();
        let written: Vec<u16> = (rig.sent(CobId::r_sdo(node)).iter())
            .filter_map(|it| match *it.frame.data() {
                [0x20..=0x2F, low, high, ..] => Some(u16::from_le_bytes([low, high])),
                _ => None,
            })
            .collect();
        prop_assert!(written.contains(&0x1800) && !written.contains(&0x1010), "{written:X?}");
        prop_assert!(!written.contains(&0x6003), "{written:X?}");
        let first = CanId::from(CobId::t_pdo(1, node));
        let floods = rig.frames().iter().filter(|it| it.frame.id() == first).count();
        prop_assert!(model == "cia406" || floods == 0, "{floods}");
    }
}
