//! python-canopen brings up the absolute encoder and reads it, with its own data sheet.

use crate::outside::{Drives, SYNCLINE, available, root};
use crate::python_canopen::{has_python_canopen, python};
use std::process::Command;

#[test]
fn it_is_brought_up_and_read() {
    if !available(has_python_canopen()) {
        return;
    }
    let drives = Drives::local(&["--node", "5:twk_crn"]);
    assert!(drives.announced.contains("node 5 (TWK CRN)"));
    let directory = tempfile::tempdir().unwrap();
    let data_sheet = directory.path().join("twk_crn.eds");
    let eds = Command::new(SYNCLINE)
        .args(["eds", "--node", "5:twk_crn"])
        .output()
        .unwrap();
    std::fs::write(&data_sheet, eds.stdout).unwrap();
    let client = Command::new(python())
        .arg("tests/python/twk_client.py")
        .arg(&data_sheet)
        .args(["5", "socketcand", "host=127.0.0.1"])
        .arg(format!("port={}", drives.port()))
        .arg("channel=can0")
        .current_dir(root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&client.stdout);
    let complained = String::from_utf8_lossy(&client.stderr);
    assert!(client.status.success(), "{said}{complained}");
    assert!(said.contains("stored values outlive a reset"), "{said}");
    drives.stop();
}

/// At a rate that the encoder does not have nobody hears it.
#[test]
fn a_bus_of_another_rate_is_silent() {
    let drives = Drives::local(&["--node", "5:twk_crn", "--bitrate", "250000"]);
    let scan = Command::new(SYNCLINE)
        .args(["sdo", "--bitrate", "250000", "--bus"])
        .arg(format!("socketcand://127.0.0.1:{}/can0", drives.port()))
        .args(["read", "5", "1000"])
        .output()
        .unwrap();
    assert!(!scan.status.success());
    drives.stop();
}
