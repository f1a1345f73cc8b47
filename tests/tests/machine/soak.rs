//! Machines that stay on for long: what a day takes is no more than what an hour takes. A session with random
//! programs, operators and troubles in virtual time, and a program that goes on and on in real time; beside them the
//! checkers of the campaign, the counters, and the process's memory.

use serde_json::Value;
use std::fs;
use std::process::{Child, Stdio};
use std::thread;
use std::time::Duration;
use syncline_tests::command::{Folder, syncline};

/// Memory may vary by so many bytes in seconds, for what an allocator keeps and for code that was not used before.
const SECONDS_VARY: u64 = 2 << 20;
/// In minutes also for what windows of the planner take, which other programs make larger or smaller by some megabytes. 120,000
/// cycles of the second half that each left something behind would take as much with 70 bytes each.
const MINUTES_VARY: u64 = 8 << 20;
/// In hours also for what is kept of a day, the last 16,384 path segments, which can be retraced, of 2.5 kB each, and the first
/// 10,000 violations, operations and changes of outputs.
const HOURS_VARY: u64 = 48 << 20;

/// What of a process is in memory, bytes; none once it has ended.
fn resident(process: &Child) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes * 1024)
}

/// Lets a process come to its end and returns what it took of memory, in its first and its second half at most.
fn memory(process: &mut Child, every: Duration) -> [u64; 2] {
    let mut taken = Vec::new();
    while process.try_wait().expect("it was started").is_none() {
        taken.extend(resident(process));
        thread::sleep(every);
    }
    assert!(taken.len() >= 20, "{} samples", taken.len());
    // At its very end it writes what it found.
    taken.truncate(taken.len() - 2);
    let (first, second) = taken.split_at(taken.len() / 2);
    [first, second].map(|half| half.iter().copied().max().unwrap_or_default())
}

/// Whether no more was taken in the second half.
fn holds(what: &str, seconds: u32, [first, second]: [u64; 2]) {
    println!("{what}: at most {first} bytes in the first half, {second} in the second");
    let varies = match seconds {
        ..60 => SECONDS_VARY,
        60..1000 => MINUTES_VARY,
        _ => HOURS_VARY,
    };
    assert!(second <= first + varies, "{what}: {first}, then {second}");
}

/// A session that lasts so many seconds of virtual time, of the case with this seed.
fn session_that_lasts(seed: u64, seconds: u32) {
    let mut command = syncline();
    command.args(["campaign", "--jobs", "1", "--seeds"]);
    command.args([
        &format!("{seed}..{}", seed + 1),
        "--lasting",
        &seconds.to_string(),
    ]);
    let mut process = command
        .stdout(Stdio::piped())
        .spawn()
        .expect("it was built");
    let memory = memory(
        &mut process,
        Duration::from_millis(u64::from(seconds / 20).min(5_000)),
    );
    let ended = process.wait_with_output().expect("it was started");
    let told = String::from_utf8_lossy(&ended.stdout);
    print!("{told}");
    assert!(ended.status.success(), "{told}");
    holds(&format!("seed {seed}, {seconds} s"), seconds, memory);
}

/// A program that runs for so many seconds in real time: a round on the portal, again and again.
fn run_that_lasts(seconds: u32) {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    // A round takes 2.4 s.
    let program = format!(
        "G21 G90 G64 P0.05 F30000\no1 repeat [{}]\nG1 X400 Y0 Z-20\nG3 X400 Y300 J150\nG0 X0 Z0\nG1 Y0\nG4 P0.1\n\
         o1 endrepeat\nM2\n",
        seconds * 10 / 24,
    );
    let (program, json) = (folder.file("round.ngc", &program), folder.path("run.json"));
    let mut command = syncline();
    command
        .arg("run")
        .args([&machine, &program])
        .arg("--json")
        .arg(&json);
    command.stdout(Stdio::null()).stdin(Stdio::null());
    let mut process = command.spawn().expect("it was built");
    let memory = memory(
        &mut process,
        Duration::from_millis(u64::from(seconds * 8).min(5_000)),
    );
    assert!(process.wait().expect("it was started").success());

    let run: Value = serde_json::from_str(&folder.read("run.json")).expect("JSON");
    let number = |value: &Value| value.as_f64().expect("a number");
    let times = run["times"].as_object().expect("times").values();
    let (told, took) = (
        times.map(number).sum::<f64>(),
        number(&run["cycles"]) * 0.002,
    );
    assert!((told - took).abs() < 1e-6, "{told} s of {took} s");
    assert!(took > 0.8 * f64::from(seconds), "{took} s");
    assert_eq!(run["verdict"], "pass");
    holds(&format!("run for {took} s"), seconds, memory);
}

#[test]
fn a_session_takes_no_more_memory_the_longer_it_lasts() {
    session_that_lasts(3, 240);
}

#[test]
fn a_run_takes_no_more_memory_the_longer_it_lasts() {
    run_that_lasts(12);
}

/// Some minutes for each.
#[test]
#[ignore = "long"]
fn eight_hours_of_sessions() {
    for seed in [0, 3, 5, 7] {
        session_that_lasts(seed, 2 * 3600);
    }
}

#[test]
#[ignore = "half an hour"]
fn half_an_hour_of_a_run() {
    run_that_lasts(1800);
}
