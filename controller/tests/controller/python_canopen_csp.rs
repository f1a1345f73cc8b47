//! python-canopen brings up the drive by the profile alone, beside an LXM32M on the same bus.

use crate::outside::{Drives, available};
use crate::python_canopen::{has_python_canopen, run_local};

#[test]
fn it_is_brought_up_and_follows() {
    if !available(has_python_canopen()) {
        return;
    }
    let hosted = ["--node", "2:lxm32m", "--node", "3:cia402_csp"];
    let drives = Drives::local(&[&["--tolerant"], &hosted[..]].concat());
    assert!(drives.announced.contains("node 3 (CiA 402 CSP)"));
    let eds = ["examples/csp/machine.toml", "3"];
    let said = run_local(&drives, "csp_client.py", &eds, "3");
    assert!(said.contains("cyclic synchronous position"), "{said}");
    drives.stop();
}
