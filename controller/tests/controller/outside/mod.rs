//! What tests with other people's tools share: hosted drives, a network of their own, skipping.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

pub(crate) const SYNCLINE: &str = env!("CARGO_BIN_EXE_syncline");

/// The workspace.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The source files below a folder.
pub(crate) fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|it| it == "rs") {
            found.push(path);
        }
    }
}

/// Whether the test can be run; says why not. Where every tool is required, as in CI, that is a
/// failure.
pub(crate) fn available(needed: Result<(), String>) -> bool {
    let Err(why) = needed else {
        return true;
    };
    let required = std::env::var_os("SYNCLINE_REQUIRE_TOOLS").is_some();
    assert!(!required, "required, but {why}");
    eprintln!("skipped: {why}");
    false
}

/// Whether a program starts and succeeds.
pub(crate) fn runs(program: impl AsRef<OsStr>, arguments: &[&str]) -> Result<(), String> {
    let program = program.as_ref();
    let mut command = Command::new(program);
    match command.args(arguments).output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!(
            "{} failed: {}",
            program.display(),
            String::from_utf8_lossy(&output.stderr).trim()
        )),
        Err(error) => Err(format!("{}: {error}", program.display())),
    }
}

/// A network namespace with nothing but loopback, which takes multicast; gone with this value.
pub(crate) struct Namespace(String);

impl Namespace {
    pub(crate) fn new() -> Result<Self, String> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("syncline-{}-{number}", std::process::id());
        runs("ip", &["netns", "add", &name])?;
        let namespace = Self(name);
        namespace.ip(&["link", "set", "lo", "up", "multicast", "on"])?;
        namespace.ip(&["route", "add", "224.0.0.0/4", "dev", "lo"])?;
        Ok(namespace)
    }

    /// Ties it to another by a cable, named in each as given, with an address for each end.
    pub(crate) fn join(
        &self,
        (own, own_address): (&str, &str),
        other: &Self,
        (its, its_address): (&str, &str),
    ) -> Result<(), String> {
        self.ip(&["link", "add", own, "type", "veth", "peer", "name", its])?;
        self.ip(&["link", "set", its, "netns", &other.0])?;
        for (end, cable, address) in [(self, own, own_address), (other, its, its_address)] {
            end.ip(&["address", "add", address, "dev", cable])?;
            end.ip(&["link", "set", cable, "up"])?;
        }
        Ok(())
    }

    /// Configures its network.
    pub(crate) fn ip(&self, arguments: &[&str]) -> Result<(), String> {
        runs("ip", &[&["-n", &self.0], arguments].concat())
    }

    /// A command that will run in it.
    pub(crate) fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.0]).arg(program);
        command
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        let _ = runs("ip", &["netns", "del", &self.0]);
    }
}

/// Nodes 1 and 2 for masters on ordinary computers.
pub(crate) const TWO_TOLERANT: [&str; 5] =
    ["--tolerant", "--node", "1:lxm32m", "--node", "2:lxm32m"];

/// A socketcand bus at a port of the host's choice.
pub(crate) const LOCAL: &str = "socketcand://127.0.0.1:0/can0";

/// Simulated drives on a bus, until this value goes.
pub(crate) struct Drives {
    child: Child,
    /// What is still to be read.
    _stdout: BufReader<ChildStdout>,
    /// What the command says it hosts.
    pub(crate) announced: String,
}

impl Drives {
    /// These drives, named as on the command line, on a bus. `command` is `syncline`, wherever it
    /// is to run.
    pub(crate) fn start(mut command: Command, drives: &[&str], bus: &str) -> Self {
        let mut child = (command.arg("drives").args(drives).args(["--bus", bus]))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut announced = String::new();
        stdout.read_line(&mut announced).unwrap();
        assert!(announced.contains("node "), "{announced}");
        Self {
            child,
            _stdout: stdout,
            announced,
        }
    }

    /// On this host, over socketcand at a port of the host's choice.
    pub(crate) fn local(drives: &[&str]) -> Self {
        Self::start(Command::new(SYNCLINE), drives, LOCAL)
    }

    /// The bus' URL.
    pub(crate) fn url(&self) -> &str {
        self.announced.split(' ').next().unwrap()
    }

    /// The port number in it.
    pub(crate) fn port(&self) -> &str {
        let address = self.url().rsplit_once('/').unwrap().0;
        address.rsplit_once(':').unwrap().1
    }

    /// Sends their process a signal.
    pub(crate) fn signal(&self, name: &str) {
        runs("kill", &[name, &self.child.id().to_string()]).unwrap();
    }

    /// Stops them as a service manager does; they end well.
    pub(crate) fn stop(mut self) {
        self.signal("-TERM");
        assert!(self.child.wait().unwrap().success());
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
