//! python-canopen brings up devices that no machine file names, each with its own data sheet.

use crate::outside::{Drives, SYNCLINE, available};
use crate::python_canopen::{has_python_canopen, run_local};
use std::process::Command;

/// Hosts the device at node 5 and runs its client; returns what that says.
fn client(device: &str, title: &str, client: &str) -> Option<String> {
    if !available(has_python_canopen()) {
        return None;
    }
    let node = format!("5:{device}");
    let drives = Drives::local(&["--node", &node]);
    assert!(drives.announced.contains(&format!("node 5 ({title})")));
    let said = run_local(&drives, client, &["--node", &node], "5");
    drives.stop();
    Some(said)
}

#[test]
fn the_encoder_is_brought_up_and_read() {
    if let Some(said) = client("twk_crn", "TWK CRN", "twk_client.py") {
        assert!(said.contains("stored values outlive a reset"), "{said}");
    }
}

#[test]
fn the_positioning_controller_is_brought_up_and_moved() {
    if let Some(said) = client("tlc5xx", "Twin Line TLC53x", "tlc_client.py") {
        assert!(said.contains("velocities by PDO at SYNC"), "{said}");
    }
}

#[test]
fn the_stepper_controller_is_brought_up_and_moved() {
    if let Some(said) = client("tsp10", "TSP10-CBE", "tsp_client.py") {
        assert!(said.contains("profile velocity and halt"), "{said}");
    }
}

#[test]
fn the_io_node_is_brought_up_and_falls_back() {
    if let Some(said) = client("cia401", "CiA 401", "io_client.py") {
        assert!(said.contains("a missing heartbeat is found"), "{said}");
    }
}

/// At a rate that the encoder does not have nobody hears it.
#[test]
fn a_bus_of_another_rate_is_silent() {
    let drives = Drives::local(&["--node", "5:twk_crn", "--bitrate", "250000"]);
    let read = Command::new(SYNCLINE)
        .args(["sdo", "--bitrate", "250000", "--bus"])
        .arg(format!("socketcand://127.0.0.1:{}/can0", drives.port()))
        .args(["read", "5", "1000"])
        .output()
        .unwrap();
    assert!(!read.status.success());
    drives.stop();
}
