//! The flight recorder: what is left in files after a fault.

use crate::day::{go, mdi, ready_with, settle, state};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;
use syncline_canopen::Frame;
use syncline_controller::bus_log::candump::Line;
use syncline_controller::control::State;
use syncline_controller::observe::flight_recorder::{FlightRecorder, KEPT_FAULTS};
use syncline_controller::observe::frames::VIRTUAL_ORIGIN;
use syncline_controller::session::Command;
use syncline_drives::bus::Transmission;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// A portal with a flight recorder of so many seconds.
fn recorded(seconds: u32) -> (Rig, PathBuf) {
    recorded_with(seconds, &[])
}

fn recorded_with(seconds: u32, more: &[(&str, &str)]) -> (Rig, PathBuf) {
    let key = format!("[controller]\nflight_recorder_s = {seconds}\n");
    let mut rig = ready_with(&[&[("[controller]\n", &*key)], more].concat());
    let folder = FlightRecorder::folder(&rig.folder.path("machine.toml"));
    let recorder = FlightRecorder::new(&rig.machine, &rig.layout, folder.clone(), VIRTUAL_ORIGIN);
    if let Some(recorder) = recorder {
        rig.session.record_faults(recorder);
    }
    (rig, folder)
}

/// Has a drive fail in the midst of a motion, and waits until what was before is written.
fn fail(rig: &mut Rig, drive: usize) {
    rig.command(Command::Mdi("G1 X60 Y40 F6000\nX0 Y0".to_owned()));
    rig.run_until(|rig| state(rig) == State::Mdi && rig.session.status().setpoint[0] > 20.0);
    let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
    rig.twin(drive).disturb(fault);
    settle(rig);
    assert_eq!(state(rig), State::Faulted);
    await_files(rig, 2000);
}

/// Waits for so many cycles at most until the files of a fault are written, in the host's time.
fn await_files(rig: &mut Rig, cycles: usize) {
    let told = |rig: &Rig| rig.recorded.len() + rig.problems.len();
    let before = told(rig);
    for _ in 0..cycles {
        rig.step();
        if told(rig) > before {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The frames of a log by identifier, and when its first and its last one were.
fn frames_of(log: &Path) -> (BTreeMap<u32, Vec<Frame>>, Duration, Duration) {
    let text = fs::read_to_string(log).unwrap();
    let mut frames = BTreeMap::<u32, Vec<Frame>>::new();
    let mut times = Vec::new();
    for line in text.lines() {
        let line = Line::parse(line).unwrap();
        frames
            .entry(line.frame.id().raw())
            .or_default()
            .push(line.frame);
        times.push(line.at);
    }
    assert!(times.is_sorted());
    (frames, times[0], times[times.len() - 1])
}

/// Analog inputs are in it as programs and the trace have them.
#[test]
fn analog_inputs_are_among_what_was_before() {
    let wired = "[[io]]\nname = \"cabinet\"\nbus = \"portal\"\nnode = 9\nmodel = \"cia401\"\n\
                 [[input]]\nname = \"pressure\"\nio = \"cabinet\"\nsignal = \"AI1\"\nfull_scale = 10\nnumber = 3\n\
                 simulated = [[0, 2], [20, 6]]\n\n[machine]\n";
    let (mut rig, _) = recorded_with(1, &[("[machine]\n", wired)]);
    fail(&mut rig, 2);
    let [files] = &rig.recorded[..] else {
        panic!("{:?} {:?}", rig.recorded, rig.problems);
    };
    let table = fs::read_to_string(files.csv()).unwrap();
    let mut lines = table.lines().skip_while(|line| line.starts_with('#'));
    let column = lines
        .next()
        .unwrap()
        .split(',')
        .position(|it| it == "input_pressure");
    let cell = |line: &str| {
        line.split(',')
            .nth(column.unwrap())
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    let told: Vec<f64> = lines.map(cell).collect();
    assert!(told.is_sorted() && told.len() > 100, "{}", told.len());
    // It rises by 0.2 a second.
    let rise = told[told.len() - 1] - told[0];
    let lasted = (told.len() - 1) as f64 * rig.machine.cycle.as_secs_f64();
    assert!((rise - 0.2 * lasted).abs() < 0.002, "{rise} in {lasted} s");
    assert_eq!(
        told[told.len() - 1],
        rig.rows.last().unwrap().analog_inputs[0]
    );
}

#[test]
fn a_fault_leaves_what_was_before() {
    let (mut rig, folder) = recorded(1);
    let bus = rig.frames().len();
    // Longer than is kept.
    mdi(&mut rig, "G4 P1.5");
    fail(&mut rig, 2);
    let [files] = &rig.recorded[..] else {
        panic!("{:?} {:?}", rig.recorded, rig.problems);
    };
    assert_eq!(files.csv(), folder.join("fault-1.csv"));
    let table = fs::read_to_string(files.csv()).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[0].starts_with("# cause: node 3 (Y, LXM32M): EMCY"),
        "{}",
        lines[0]
    );
    let head = lines
        .iter()
        .position(|line| line.starts_with("t_s,state,line,X_set,X_act,"));
    let rows = &lines[head.unwrap() + 1..];
    let cells = |row: &str| row.split(',').map(str::to_owned).collect::<Vec<_>>();
    let times: Vec<f64> = rows
        .iter()
        .map(|row| cells(row)[0].parse().unwrap())
        .collect();
    assert!(times.is_sorted() && times[times.len() - 1] - times[0] <= 1.0 + 1e-9);
    assert!(rows.iter().any(|row| cells(row)[1] == "MDI"), "{table}");
    assert!(
        rows.iter().any(|row| cells(row)[1] == "stopping"),
        "{table}"
    );
    // Setpoints and actual positions are those of the run.
    let set = |row: &str| cells(row)[3].parse::<f64>().unwrap();
    let last = rig.rows.last().unwrap().axes[0];
    assert_eq!(set(rows[rows.len() - 1]), last.set);

    // Of each identifier, the frames are those that the bus carried, one after the other.
    let (found, first, last) = frames_of(&files.csv().with_extension("candump"));
    assert!(last - first <= Duration::from_secs(1), "{first:?} {last:?}");
    assert!(
        last - first > Duration::from_millis(900),
        "{first:?} {last:?}"
    );
    assert!(found.contains_key(&0x083) && found.contains_key(&0x080));
    let carried = &rig.frames()[bus..];
    let kept = |it: &&Transmission| {
        let end = VIRTUAL_ORIGIN + Duration::from_nanos(it.end.as_nanos());
        first < end && end < last
    };
    let ids = carried.iter().filter(kept).map(|it| it.frame.id().raw());
    assert!(ids.collect::<BTreeSet<_>>().iter().eq(found.keys()));
    for (id, frames) in found {
        let on_bus: Vec<Frame> = (carried.iter().map(|it| it.frame))
            .filter(|frame| frame.id().raw() == id)
            .collect();
        let is_part = on_bus.windows(frames.len()).any(|part| part == frames);
        assert!(is_part, "{id:03X}: {} frames", frames.len());
    }
    let packets = fs::read(files.csv().with_extension("pcapng")).unwrap();
    assert_eq!(packets[..4], [0x0A, 0x0D, 0x0D, 0x0A]);

    // The next fault has files of its own, and is not mixed up with the first one.
    go(&mut rig, Command::Reset);
    fail(&mut rig, 3);
    assert_eq!(rig.recorded.len(), 2, "{:?}", rig.problems);
    let second = fs::read_to_string(folder.join("fault-2.csv")).unwrap();
    assert!(
        second.starts_with("# cause: node 4 (Z, LXM32M)"),
        "{second}"
    );
    assert_eq!(second.matches("# cause").count(), 1);
}

/// A machine that does not come up again leaves one recording of that, however often it is reset, and one of the next cause.
#[test]
fn resets_in_vain_leave_one_recording() {
    let (mut rig, folder) = recorded(1);
    fail(&mut rig, 2);
    let mut reset = |drive: usize, resets: usize, recordings: usize| {
        rig.twin(drive).disturb(Disturbance::Mute(true));
        for _ in 0..resets {
            rig.command(Command::Reset);
            rig.run_until(|rig| state(rig) == State::Starting);
            rig.run_until(|rig| state(rig) == State::Faulted);
            await_files(&mut rig, 100);
        }
        rig.twin(drive).disturb(Disturbance::Mute(false));
        assert_eq!(rig.recorded.len(), recordings, "{:?}", rig.problems);
    };
    reset(1, 3, 2);
    reset(3, 2, 3);
    let causes = [1, 2, 3].map(|number| {
        let table = fs::read_to_string(folder.join(format!("fault-{number}.csv"))).unwrap();
        table.lines().next().unwrap_or_default().to_owned()
    });
    let nodes = ["node 3", "node 2", "node 4"];
    let of = causes.iter().zip(nodes);
    assert!(
        of.clone().all(|(cause, node)| cause.contains(node)),
        "{causes:?}"
    );
}

/// What the bus carries in a run that fails and goes on.
fn carried(seconds: u32, prepare: impl Fn(&Path)) -> (Rig, String) {
    let (mut rig, folder) = recorded(seconds);
    prepare(&folder);
    // What is written comes in the host's time: the machine's goes on by the same wake-ups.
    rig.command(Command::Mdi("G1 X60 Y40 F6000\nX0 Y0".to_owned()));
    rig.run_until(|rig| state(rig) == State::Mdi && rig.session.status().setpoint[0] > 20.0);
    let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
    rig.twin(2).disturb(fault);
    settle(&mut rig);
    go(&mut rig, Command::Reset);
    mdi(&mut rig, "G0 X5");
    go(&mut rig, Command::SwitchOff);
    let frames = rig.session.timeline().frames().result().0;
    (rig, frames)
}

#[test]
fn a_full_disk_is_told_and_changes_nothing() {
    let full = |folder: &Path| {
        fs::create_dir_all(folder).unwrap();
        for number in 1..=KEPT_FAULTS {
            symlink("/dev/full", folder.join(format!("fault-{number}.csv"))).unwrap();
        }
    };
    let (with, frames) = carried(10, |_| ());
    assert_eq!((with.recorded.len(), with.problems.len()), (1, 0));
    let (none, same) = carried(0, |_| ());
    assert_eq!((none.recorded.len(), none.problems.len()), (0, 0));
    assert_eq!(frames, same);
    let (full, same) = carried(10, full);
    assert_eq!(full.recorded.len(), 0);
    let [problem] = &full.problems[..] else {
        panic!("{:?}", full.problems);
    };
    assert!(
        problem.contains("the flight recorder cannot write into"),
        "{problem}"
    );
    assert!(problem.contains("No space left on device"), "{problem}");
    assert_eq!(frames, same);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Wherever a drive fails, and however little is kept, the cause and the fault's frame are there.
    #[test]
    fn the_fault_is_always_in_what_is_kept(
        seconds in 1u32..4,
        drive in 2usize..4,
        dwell in 0.0..3.0,
    ) {
        let (mut rig, folder) = recorded(seconds);
        mdi(&mut rig, &format!("G4 P{dwell:.3}"));
        fail(&mut rig, drive);
        prop_assert_eq!(rig.recorded.len(), 1, "{:?}", rig.problems);
        let node = u32::from(rig.machine.drives[drive].node.get());
        let (frames, first, last) = frames_of(&folder.join("fault-1.candump"));
        prop_assert!(last - first <= Duration::from_secs(seconds.into()));
        prop_assert!(frames.contains_key(&(0x080 + node)));
    }
}

/// In real time, by the command: the files are named, and our own reader takes the log.
#[test]
fn a_run_that_fails_names_the_files() {
    let folder = Folder::new();
    let limit = (
        "following_error_limit = 1.0",
        "following_error_limit = 0.005",
    );
    let machine = folder.file("tight.toml", &machine_with("xyz", &[limit; 3]));
    let part = folder.file("part.ngc", "G1 X30 F12000\nM2\n");
    let run = syncline()
        .arg("run")
        .args([&machine, &part])
        .output()
        .unwrap();
    let (code, told, errors) = ended(&run);
    assert_eq!(code, 1, "{told}{errors}");
    let table = folder.path("tight.faults/fault-1.csv");
    let named = format!("what was before the fault is in {}", table.display());
    assert!(errors.contains(&named), "{errors}");
    assert!(
        fs::read_to_string(&table)
            .unwrap()
            .starts_with("# cause: axis X"),
        "{errors}"
    );
    let log = table.with_extension("candump");
    let mut monitor = syncline();
    let monitor = monitor.arg("monitor").arg("--machine").arg(&machine);
    let decoded = monitor.arg("--log").arg(&log).output().unwrap();
    let (code, text, errors) = ended(&decoded);
    assert_eq!(code, 0, "{errors}");
    assert!(text.contains("SYNC"), "{text}");
}
