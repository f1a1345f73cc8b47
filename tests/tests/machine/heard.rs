//! An operator is heard whatever stands in the way of an output: a terminal that takes nothing, a
//! pipe that nobody reads. The machine comes to rest as soon as it would have otherwise.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::terminal::Terminal;

/// 28 s of motion.
const PROGRAM: &str = "G1 X1400 F3000\nM2\n";

/// From the key or the signal until the axis rests. The stop is commanded within 0.1 s on an idle
/// host; tests share theirs, and the trace as the test sees it lags behind.
const BOUND: Duration = Duration::from_secs(6);

/// From the key or the signal until the command ends: with what takes no output it waits for a
/// while.
const END: Duration = Duration::from_secs(15);

/// Waits until something is so.
fn wait_until(what: &str, most: Duration, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < most, "{what}: not after {most:?}");
        sleep(Duration::from_millis(10));
    }
}

/// Sends the process SIGINT.
fn interrupt(pid: &str) {
    let killed = Command::new("kill").args(["-INT", pid]).status();
    assert!(killed.unwrap().success());
}

/// Rows of a trace that is being written.
fn rows(trace: &Path) -> usize {
    let text = fs::read(trace).unwrap_or_default();
    text.iter().filter(|byte| **byte == b'\n').count()
}

/// A run on a terminal, with its trace in a file.
struct Run {
    folder: Folder,
    terminal: Terminal,
}

impl Run {
    /// `beside` is a shell command before it, which may go on beside it.
    fn start(beside: &str) -> Self {
        let folder = Folder::new();
        let machine = folder.machine("portal");
        let program = folder.file("p.ngc", PROGRAM);
        let line = format!(
            "{beside} sh -c 'echo $$ > {pid}; exec {syncline} run {machine} {program} --trace {trace}'; \
             echo $? > {exit}; kill -KILL $PPID",
            pid = folder.path("pid").display(),
            syncline = syncline().get_program().display(),
            machine = machine.display(),
            program = program.display(),
            trace = folder.path("trace.csv").display(),
            exit = folder.path("exit").display(),
        );
        let terminal = Terminal::run(&line);
        Self { folder, terminal }
    }

    /// Waits until the axis moves.
    fn moves(&self) {
        let trace = self.folder.path("trace.csv");
        wait_until("motion", Duration::from_secs(30), || rows(&trace) > 500);
    }

    /// The axis rests soon after `stop`, and the command ends as an interrupted one.
    fn assert_stops(mut self, stop: impl FnOnce(&mut Self)) {
        let trace = self.folder.path("trace.csv");
        let before = rows(&trace);
        stop(&mut self);
        let exit = self.folder.path("exit");
        wait_until("the end", END, || exit.exists());
        wait_until("the exit code", END, || self.folder.read("exit") == "130\n");
        let more = Duration::from_millis(2) * (rows(&trace) - before) as u32;
        assert!(more < BOUND, "{more:?} more of motion");
    }

    fn interrupt(&self) {
        interrupt(self.folder.read("pid").trim());
    }
}

/// Ctrl-S holds the terminal's output back, and all that follows it.
fn a_terminal_is_held(stop: impl FnOnce(&mut Run)) {
    let mut run = Run::start("");
    run.terminal.wait_for("keys: space");
    run.moves();
    run.terminal.press(b"\x13");
    sleep(Duration::from_secs(2));
    run.assert_stops(stop);
}

/// Both wait for most of their time, so they wait together.
#[test]
fn a_terminal_that_is_held() {
    thread::scope(|scope| {
        scope.spawn(|| a_terminal_is_held(|run| run.terminal.press(b"q")));
        scope.spawn(|| a_terminal_is_held(|run| run.interrupt()));
    });
}

/// The terminal is full from the beginning, and nobody reads it. Who does not read it here would not
/// hand over keys either.
#[test]
fn a_terminal_that_is_not_read() {
    let run = Run::start("yes full & sleep 1;");
    run.moves();
    run.assert_stops(|run| run.interrupt());
}

/// What goes into a pipe that nobody reads; what is missing is told in the end.
fn a_file_takes_nothing(option: &str) {
    let folder = Folder::new();
    let pipe = folder.path("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    // Open at both ends, so that nobody waits for the other.
    let open = File::options().read(true).write(true).open(&pipe);
    let mut child = syncline()
        .arg("run")
        .args([folder.machine("portal"), folder.file("p.ngc", PROGRAM)])
        .args([Path::new(option), &pipe])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_secs(8));
    let begun = Instant::now();
    interrupt(&child.id().to_string());
    while begun.elapsed() < END && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_millis(20));
    }
    let in_time = begun.elapsed() < END;
    // Nothing where it has ended.
    let _ = child.kill();
    assert!(in_time, "{option}: no end");
    let output = child.wait_with_output().unwrap();
    let (code, _, errors) = ended(&output);
    assert_eq!(code, 130, "{option}: {errors}");
    assert!(
        errors.contains(&format!("{option} is incomplete")),
        "{option}: {errors}"
    );
    drop(open);
}

/// They wait for most of their time, so they wait together.
#[test]
fn a_file_that_takes_nothing() {
    thread::scope(|scope| {
        for option in ["--trace", "--candump", "--pcapng"] {
            scope.spawn(move || a_file_takes_nothing(option));
        }
    });
}
