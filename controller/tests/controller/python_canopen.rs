//! python-canopen, a real third-party master, against the simulated drives.

use crate::outside::{Drives, LOCAL, Namespace, SYNCLINE, TWO_TOLERANT, available, root, runs};
use std::path::PathBuf;
use std::process::Command;

/// The interpreter that `tests/python/prepare` sets up, or else the host's.
pub(crate) fn python() -> PathBuf {
    let prepared = root().join("target/python/bin/python");
    if prepared.exists() {
        prepared
    } else {
        "python3".into()
    }
}

pub(crate) fn has_python_canopen() -> Result<(), String> {
    runs(python(), &["-c", "import can, canopen, msgpack"])
        .map_err(|why| format!("{why}; run tests/python/prepare"))
}

/// Runs a client of `tests/python` with the data sheet that `eds` asks for, this `subject` and a bus
/// that python-can opens with these arguments; returns what it says.
pub(crate) fn run(
    mut python: Command,
    client: &str,
    eds: &[&str],
    subject: &str,
    bus: &[&str],
) -> String {
    let directory = tempfile::tempdir().unwrap();
    let data_sheet = directory.path().join("device.eds");
    let mut command = Command::new(SYNCLINE);
    command.arg("eds").args(eds).current_dir(root());
    std::fs::write(&data_sheet, command.output().unwrap().stdout).unwrap();
    let client = python
        .arg(format!("tests/python/{client}"))
        .arg(&data_sheet)
        .arg(subject)
        .args(bus)
        .current_dir(root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&client.stdout);
    let complained = String::from_utf8_lossy(&client.stderr);
    assert!(client.status.success(), "{said}{complained}");
    said.into_owned()
}

/// Runs a client as [`run`] does, on the bus of drives that are hosted over socketcand.
pub(crate) fn run_local(drives: &Drives, client: &str, eds: &[&str], subject: &str) -> String {
    let port = format!("port={}", drives.port());
    let bus = ["socketcand", "host=127.0.0.1", &port, "channel=can0"];
    run(Command::new(python()), client, eds, subject, &bus)
}

/// Does these steps with two LXM32Ms.
fn client(python: Command, steps: &str, bus: &[&str]) -> String {
    let eds = ["examples/portal/machine.toml", "1"];
    run(python, "client.py", &eds, steps, bus)
}

fn drive(python: Command, bus: &[&str]) {
    let said = client(python, "all", bus);
    assert!(said.contains("interpolated position on 2 drives"), "{said}");
}

#[test]
fn over_socketcand() {
    if !available(has_python_canopen()) {
        return;
    }
    let drives = Drives::local(&TWO_TOLERANT);
    let port = format!("port={}", drives.port());
    let bus = ["socketcand", "host=127.0.0.1", &port, "channel=can0"];
    drive(Command::new(python()), &bus);
    drives.stop();
}

/// A namespace in which python-canopen can be run, or nothing if the test is to be skipped.
fn namespace(made: Result<Namespace, String>) -> Option<Namespace> {
    let made = made.and_then(|namespace| has_python_canopen().map(|()| namespace));
    match made {
        Ok(namespace) => Some(namespace),
        Err(why) => {
            available(Err(why));
            None
        }
    }
}

#[test]
fn over_udp_multicast() {
    let Some(namespace) = namespace(Namespace::new()) else {
        return;
    };
    let drives = Drives::start(
        namespace.command(SYNCLINE),
        &TWO_TOLERANT,
        "udp://239.74.163.2:43113",
    );
    assert!(drives.announced.contains("on interface lo only"));
    let bus = ["udp_multicast", "channel=239.74.163.2", "port=43113"];
    drive(namespace.command(python()), &bus);
}

/// python-can's own IPv6 group.
#[test]
fn over_ipv6_multicast() {
    const GROUP: &str = "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173";
    let Some(namespace) = namespace(Namespace::new()) else {
        return;
    };
    let url = format!("udp://[{GROUP}]:43113");
    // Before there is a way to the group on loopback, the command says what to type.
    let command = |arguments: &[&str]| {
        let mut command = namespace.command(SYNCLINE);
        command.args(arguments).output().unwrap()
    };
    let scan = ["scan", "--bus", &url];
    let complained = String::from_utf8(command(&scan).stderr).unwrap();
    let (_, wanted) = complained.split_once("sudo ip ").expect(&complained);
    let words: Vec<&str> = wanted.trim().trim_matches('`').split(' ').collect();
    namespace.ip(&words).unwrap();

    let drives = Drives::start(namespace.command(SYNCLINE), &TWO_TOLERANT, &url);
    let bus = ["udp_multicast", &format!("channel={GROUP}"), "port=43113"];
    let said = client(namespace.command(python()), "resting", &bus);
    assert!(said.contains("expedited and segmented upload"), "{said}");
    let scanned = String::from_utf8(command(&scan).stdout).unwrap();
    assert_eq!(scanned.matches(": LXM32M").count(), 2, "{scanned}");
    drives.stop();
}

/// With `--beacon`, and only then, python-can finds the bus by itself.
#[test]
fn the_beacon_is_seen() {
    let Some(namespace) = namespace(Namespace::new()) else {
        return;
    };
    let output =
        |mut command: Command| String::from_utf8(command.output().unwrap().stdout).unwrap();
    let sockets = || {
        let mut command = namespace.command("cat");
        command.arg("/proc/net/udp");
        output(command).lines().count() - 1
    };
    let quiet = Drives::start(namespace.command(SYNCLINE), &TWO_TOLERANT, LOCAL);
    assert_eq!(sockets(), 0);
    quiet.stop();
    let drives = [&TWO_TOLERANT[..], &["--beacon"]].concat();
    let drives = Drives::start(namespace.command(SYNCLINE), &drives, LOCAL);
    let detect = "from can.interfaces.socketcand.socketcand import detect_beacon
print(*(f'{key}={value}' for key, value in detect_beacon(20_000)[0].items()))";
    let mut python = namespace.command(python());
    python.args(["-c", detect]);
    let bus = output(python);
    let port = format!("port={}", drives.port());
    let bus: Vec<&str> = bus.split_whitespace().collect();
    assert_eq!(
        bus,
        [
            "interface=socketcand",
            "host=127.0.0.1",
            &port,
            "channel=can0"
        ]
    );
    assert_eq!(sockets(), 1);
    drives.stop();
}
