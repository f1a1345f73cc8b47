//! python-canopen brings up the drive by the profile alone, beside an LXM32M on the same bus.

use crate::outside::{Drives, SYNCLINE, available, root};
use crate::python_canopen::{has_python_canopen, python};
use std::process::Command;

#[test]
fn it_is_brought_up_and_follows() {
    if !available(has_python_canopen()) {
        return;
    }
    let hosted = ["--node", "2:lxm32m", "--node", "3:cia402_csp"];
    let drives = Drives::local(&[&["--tolerant"], &hosted[..]].concat());
    assert!(drives.announced.contains("node 3 (CiA 402 CSP)"));
    let directory = tempfile::tempdir().unwrap();
    let data_sheet = directory.path().join("cia402_csp.eds");
    let eds = Command::new(SYNCLINE)
        .args(["eds", "examples/csp/machine.toml", "3"])
        .current_dir(root())
        .output()
        .unwrap();
    std::fs::write(&data_sheet, eds.stdout).unwrap();
    let client = Command::new(python())
        .arg("tests/python/csp_client.py")
        .arg(&data_sheet)
        .args(["3", "socketcand", "host=127.0.0.1"])
        .arg(format!("port={}", drives.port()))
        .arg("channel=can0")
        .current_dir(root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&client.stdout);
    let complained = String::from_utf8_lossy(&client.stderr);
    assert!(client.status.success(), "{said}{complained}");
    assert!(said.contains("cyclic synchronous position"), "{said}");
    drives.stop();
}
