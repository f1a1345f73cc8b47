//! python-canopen, a real third-party master, against the simulated drives.

mod outside;

use outside::{Drives, Namespace, SYNCLINE, available, root, runs};
use std::path::PathBuf;
use std::process::Command;

const CLIENT: &str = "tests/python/client.py";

/// The interpreter that `tests/python/prepare` sets up, or else the host's.
fn python() -> PathBuf {
    let prepared = root().join("target/python/bin/python");
    if prepared.exists() {
        prepared
    } else {
        "python3".into()
    }
}

fn has_python_canopen() -> Result<(), String> {
    runs(python(), &["-c", "import can, canopen, msgpack"])
        .map_err(|why| format!("{why}; run tests/python/prepare"))
}

/// Runs the client on a bus that python-can opens with these arguments.
fn drive(mut python: Command, bus: &[&str]) {
    let directory = tempfile::tempdir().unwrap();
    let data_sheet = directory.path().join("lxm32m.eds");
    let eds = Command::new(SYNCLINE)
        .args(["eds", "examples/portal/machine.toml", "1"])
        .current_dir(root())
        .output()
        .unwrap();
    std::fs::write(&data_sheet, eds.stdout).unwrap();
    let client = python
        .arg(CLIENT)
        .arg(&data_sheet)
        .args(bus)
        .current_dir(root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&client.stdout);
    let complained = String::from_utf8_lossy(&client.stderr);
    assert!(client.status.success(), "{said}{complained}");
    assert!(said.contains("interpolated position on 2 drives"), "{said}");
}

#[test]
fn over_socketcand() {
    if !available(has_python_canopen()) {
        return;
    }
    let drives = Drives::local();
    let port = format!("port={}", drives.port());
    let bus = ["socketcand", "host=127.0.0.1", &port, "channel=can0"];
    drive(Command::new(python()), &bus);
    drives.stop();
}

#[test]
fn over_udp_multicast() {
    let network = Namespace::new();
    let namespace = match (&network, has_python_canopen()) {
        (Ok(namespace), Ok(())) => namespace,
        (network, python) => {
            let network = network.as_ref().map(|_| ()).map_err(Clone::clone);
            available(network.and(python));
            return;
        }
    };
    let drives = Drives::start(namespace.command(SYNCLINE), "udp://239.74.163.2:43113");
    assert!(drives.announced.contains("on interface lo only"));
    let bus = ["udp_multicast", "channel=239.74.163.2", "port=43113"];
    drive(namespace.command(python()), &bus);
}
