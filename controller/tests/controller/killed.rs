//! Processes that end or stall at any instant: the controller's, and that of the drives. In real time, over
//! socketcand on loopback, with drives that care about the controller's heartbeat but not about when SYNC comes.

use crate::outside::{Drives, LOCAL, SYNCLINE, runs};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use syncline_drives::twin::random::Random;
use syncline_gcode::Tables;
use tempfile::TempDir;

/// Two axes at a cycle that any host can hold.
const MACHINE: &str = r#"
[machine]
name = "killed"
cycle_us = 20000
[controller]
heartbeat_ms = 50
heartbeat_timeout_ms = 250
# Hosts that do other work as well are late at times.
setpoint_offset_us = 15000
t_pdo_misses = 5
[[bus]]
name = "main"
bitrate = 1_000_000
[[drive]]
name = "x"
bus = "main"
node = 1
model = "lxm32m"
[[drive]]
name = "y"
bus = "main"
node = 2
model = "lxm32m"
[[axis]]
name = "X"
drives = ["x"]
pitch = 10.0
max_velocity = 100.0
max_acceleration = 1000.0
max_jerk = 20_000.0
soft_limits = [-100.0, 100.0]
following_error_limit = 5.0
[[axis]]
name = "Y"
drives = ["y"]
pitch = 10.0
max_velocity = 100.0
max_acceleration = 1000.0
max_jerk = 20_000.0
soft_limits = [-100.0, 100.0]
following_error_limit = 5.0
[model.lxm32m]
interpolation_delay = 1
"#;

/// To and fro, and at its end an offset that is kept in the tables.
const PROGRAM: &str = "G64 F6000\nO1 REPEAT [#<_times>]\nG1 X30 Y20\nG1 X-30 Y-10\nO1 ENDREPEAT\n\
                       G10 L2 P1 X12.5\nM2\n";

const TABLES: &str =
    "# Kept by hand.\n[work_offsets.G54]\nX = 1.0\n\n[[tool]]\nnumber = 1\ndiameter = 8.0\n";

/// How long after the controller's last heartbeat its drives stand, with what this host is late by.
const STANDS: Duration = Duration::from_millis(1500);

/// What an LXM32M stops with that no longer hears the controller.
const CONNECTION_LOST: i64 = 0xB408;

/// A machine of two hosted drives and a controller that runs a program on them.
struct Killed {
    folder: TempDir,
    drives: Drives,
    controller: Child,
    log: BufReader<ChildStderr>,
    seen: String,
}

impl Killed {
    /// A run that goes to and fro so often; with the machine's limits it takes a second each time.
    fn start(times: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| -> PathBuf {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let machine = file("machine.toml", MACHINE);
        let times = format!("[{times}]");
        let program = file("part.ngc", &PROGRAM.replace("[#<_times>]", &times));
        file("machine.tables.toml", TABLES);
        let drives = ["--tolerant", machine.to_str().unwrap()];
        let drives = Drives::start(Command::new(SYNCLINE), &drives, LOCAL);
        let mut controller = (Command::new(SYNCLINE).arg("run"))
            .args([&machine, &program])
            .args(["--bus", drives.url(), "--verbose"])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let log = BufReader::new(controller.stderr.take().unwrap());
        Self {
            folder,
            drives,
            controller,
            log,
            seen: String::new(),
        }
    }

    /// Waits until axes move; whether they do without a fault.
    fn moves(&mut self) -> bool {
        while !self.seen.contains("ready\n") {
            if self.log.read_line(&mut self.seen).unwrap() == 0 {
                return false;
            }
        }
        thread::sleep(Duration::from_millis(400));
        !self.has_fault()
    }

    fn has_fault(&self) -> bool {
        self.seen.contains("FAULT")
    }

    /// Sends the controller a signal.
    fn signal(&self, name: &str) {
        runs("kill", &[name, &self.controller.id().to_string()]).unwrap();
    }

    /// The controller's end: its exit code, unless a signal ended it.
    fn end(&mut self) -> Option<i32> {
        self.log.read_to_string(&mut self.seen).unwrap();
        self.controller.wait().unwrap().code()
    }

    /// An object of a drive.
    fn read(&self, node: u8, object: &str) -> i64 {
        let node = node.to_string();
        let Output { stdout, stderr, .. } = Command::new(SYNCLINE)
            .args(["sdo", "--bus", self.drives.url(), "--timeout", "5000"])
            .args(["read", &node, object])
            .output()
            .unwrap();
        let text = String::from_utf8(stdout).unwrap();
        // `6041h:0 _DCOMstatus = 6638h (Fault)`
        let value = text.split_once(" = ").and_then(|(_, value)| {
            let value = value.split_whitespace().next()?;
            match value.strip_suffix('h') {
                Some(digits) => i64::from_str_radix(digits, 16).ok(),
                None => value.parse().ok(),
            }
        });
        value.unwrap_or_else(|| panic!("{object}: {text}{}", String::from_utf8_lossy(&stderr)))
    }

    /// All drives are at rest without power; their error codes.
    fn rest(&self) -> Vec<i64> {
        let mut errors = Vec::new();
        for node in [1, 2] {
            let state = self.read(node, "6041");
            // Neither switched on nor operation enabled.
            assert_eq!(
                state & 0x0006,
                0,
                "node {node}: {state:04X}h\n{}",
                self.seen
            );
            // But for the noise of the encoder; at full speed it would be 1300 increments a millisecond.
            let moved = self.read(node, "6064") - self.read(node, "6064");
            assert!(moved.abs() <= 4, "node {node} moved by {moved}");
            errors.push(self.read(node, "603F"));
        }
        errors
    }

    /// The offset that the tables have, which are whole.
    fn offset(&self) -> f64 {
        let file = self.folder.path().join("machine.tables.toml");
        let tables = Tables::load(&file).unwrap();
        assert_eq!(tables.tools[&1].diameter, 8.0);
        assert!(
            fs::read_to_string(&file)
                .unwrap()
                .starts_with("# Kept by hand.\n")
        );
        tables.work_offsets[0].0[0]
    }
}

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.controller.kill();
        let _ = self.controller.wait();
    }
}

/// Kills the controller some time after it started; whether a drive had power then.
fn kill_after(time: Duration) -> bool {
    let mut machine = Killed::start(1);
    thread::sleep(time);
    machine.controller.kill().unwrap();
    let killed = machine.controller.wait().unwrap().signal() == Some(9);
    machine.end();
    thread::sleep(STANDS);
    let errors = machine.rest();
    let (ready, over) = (
        machine.seen.contains("ready"),
        machine.seen.contains("switching the power stages off"),
    );
    let had_power = killed && ready && !over && !machine.has_fault();
    if had_power {
        assert_eq!(errors, [CONNECTION_LOST; 2], "{}", machine.seen);
    }
    let offset = machine.offset();
    assert!(offset == 1.0 || over && offset == 12.5, "{offset}");
    if !killed && !machine.has_fault() {
        assert_eq!(offset, 12.5, "{}", machine.seen);
    }
    had_power
}

/// Until `test` says that the host's other work has not made the controller late before its time.
fn when_punctual(test: impl Fn() -> bool) {
    assert!((0..5).any(|_| test()), "always late");
}

/// The same with each signal, at the same time.
fn with_each(signals: &[&str], test: impl Fn(&str) -> bool + Sync) {
    thread::scope(|scope| {
        for signal in signals {
            scope.spawn(|| when_punctual(|| test(signal)));
        }
    });
}

#[test]
fn drives_stop_by_themselves_when_the_controller_is_killed() {
    when_punctual(|| {
        let mut machine = Killed::start(5);
        let moves = machine.moves();
        machine.signal("-KILL");
        machine.end();
        if !moves || machine.has_fault() {
            return false;
        }
        thread::sleep(STANDS);
        assert_eq!(machine.rest(), [CONNECTION_LOST; 2], "{}", machine.seen);
        assert_eq!(machine.offset(), 1.0);
        true
    });
}

/// At any instant, from before the machine comes up until behind the end of its run. SYNCLINE_KILLS says how
/// often.
#[test]
#[ignore = "takes minutes; docs/reliability.md has what came of it"]
fn drives_stop_by_themselves_whenever_the_controller_is_killed() {
    let times = std::env::var("SYNCLINE_KILLS").map_or(200, |it| it.parse().unwrap());
    let mut random = Random::new(18, 0);
    let longest = {
        let begin = Instant::now();
        let mut machine = Killed::start(1);
        assert_eq!(machine.end(), Some(0), "{}", machine.seen);
        begin.elapsed()
    };
    let mut had_power = 0;
    for time in 1..=times {
        let after = longest.mul_f64(random.between(0.0, 1.05));
        had_power += usize::from(kill_after(after));
        eprintln!("{time}: after {after:?}, {had_power} with power so far");
    }
    assert!(had_power * 5 > times, "{had_power} of {times} under power");
}

/// Ctrl-C, a service manager, and a terminal that is closed.
#[test]
fn a_signal_brings_the_machine_to_rest_in_order() {
    with_each(&["-INT", "-TERM", "-HUP"], |signal| {
        let mut machine = Killed::start(5);
        let moves = machine.moves();
        machine.signal(signal);
        let code = machine.end();
        if !moves || machine.has_fault() {
            return false;
        }
        assert_eq!(code, Some(130), "{signal}: {}", machine.seen);
        for step in ["coming to rest", "switching the power stages off"] {
            assert!(machine.seen.contains(step), "{signal}: {}", machine.seen);
        }
        machine.rest();
        assert_eq!(machine.offset(), 1.0);
        true
    });
}

/// The process of the drives stalls for longer than anybody waits, or is gone.
#[test]
fn the_controller_ends_when_the_process_of_the_drives_stalls_or_is_killed() {
    with_each(&["-STOP", "-KILL"], |signal| {
        let mut machine = Killed::start(20);
        let moves = machine.moves();
        machine.drives.signal(signal);
        let code = machine.end();
        if !moves {
            return false;
        }
        assert_eq!(code, Some(1), "{signal}: {}", machine.seen);
        assert!(machine.has_fault(), "{signal}: {}", machine.seen);
        assert_eq!(machine.offset(), 1.0);
        if signal == "-STOP" {
            machine.drives.signal("-CONT");
            thread::sleep(STANDS);
            machine.rest();
        }
        true
    });
}

/// A console whose server ends and is started again: each reset in vain says why and records nothing, and once there are drives again one
/// brings the machine back.
#[test]
fn a_console_finds_a_server_that_was_started_anew() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine.toml");
    fs::write(&machine, MACHINE).unwrap();
    let hosted = ["--tolerant", machine.to_str().unwrap()];
    let drives = Drives::start(Command::new(SYNCLINE), &hosted, LOCAL);
    let url = drives.url().to_owned();
    let mut console = (Command::new(SYNCLINE).arg("console"))
        .args([machine.as_os_str(), "--bus".as_ref(), url.as_ref()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let (mut input, mut output) = (
        console.stdin.take().unwrap(),
        BufReader::new(console.stdout.take().unwrap()),
    );
    let mut seen = String::new();
    let mut wait_for = |texts: &[&str]| loop {
        let mut line = String::new();
        let told = output.read_line(&mut line).unwrap();
        seen += &line;
        assert!(told > 0, "none of {texts:?} in {seen}");
        if let Some(found) = texts.iter().position(|it| line.contains(it)) {
            return found;
        }
    };
    wait_for(&["ready: "]);
    drop(drives);
    wait_for(&["fault-1.csv"]);
    for _ in 0..3 {
        writeln!(input, "reset").unwrap();
        wait_for(&["cannot connect: "]);
        wait_for(&["stopped by a fault: "]);
    }
    let _drives = Drives::start(Command::new(SYNCLINE), &hosted, &url);
    loop {
        writeln!(input, "reset").unwrap();
        if wait_for(&["ready: ", "stopped by a fault: "]) == 0 {
            break;
        }
    }
    drop(input);
    wait_for(&["off: "]);
    console.wait().unwrap();
    let kept = fs::read_dir(machine.with_extension("faults")).unwrap();
    let mut kept: Vec<_> = kept.map(|it| it.unwrap().file_name()).collect();
    kept.retain(|name| name.to_string_lossy().ends_with(".csv"));
    assert_eq!(kept, ["fault-1.csv"]);
}
