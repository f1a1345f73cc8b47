//! A recorded minute of the portal, as tshark and can-utils read it.

use crate::outside::{SYNCLINE, available, root, runs};
use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, Frame};
use syncline_controller::bus_log::{candump::Line, pcapng};
use tempfile::TempDir;

/// A little more than a minute.
const PROGRAM: &str = "G21 G90 G94 F6000
G53 G1 X1000
G53 G1 Y800
G53 G1 X50
G53 G1 Y50
G53 G1 X1400
G53 G1 Y700
G53 G1 X400
M2
";

/// The portal's minute: `minute.log` and `minute.pcapng`.
fn recorded() -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    fs::write(at("minute.ngc"), PROGRAM).unwrap();
    let validated = Command::new(SYNCLINE)
        .args(["validate", "examples/portal/machine.toml"])
        .arg(at("minute.ngc"))
        .arg("--candump")
        .arg(at("minute.log"))
        .arg("--pcapng")
        .arg(at("minute.pcapng"))
        .current_dir(root())
        .output()
        .unwrap();
    let complained = String::from_utf8_lossy(&validated.stderr);
    assert!(validated.status.success(), "{complained}");
    directory
}

/// What a program prints.
fn output(program: &str, arguments: &[&str], directory: &Path) -> String {
    let mut command = Command::new(program);
    let output = (command.args(arguments).current_dir(directory))
        .output()
        .unwrap();
    let complained = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program}: {complained}");
    String::from_utf8(output.stdout).unwrap()
}

fn tshark(file: &str, arguments: &[&str], directory: &Path) -> String {
    let canopen = ["-r", file, "-d", "can.subdissector,canopen"];
    output("tshark", &[&canopen, arguments].concat(), directory)
}

const MALFORMED: [&str; 2] = ["-Y", "_ws.malformed"];

/// One recording for all readers.
#[test]
fn others_read_what_was_recorded() {
    let tshark = available(runs("tshark", &["--version"]));
    let can_utils = available(runs("which", &["log2asc", "asc2log"]));
    if !tshark && !can_utils {
        return;
    }
    let directory = recorded();
    if can_utils {
        can_utils_read_the_log(directory.path());
    }
    if tshark {
        tshark_decodes_the_packets(directory.path());
    }
}

fn tshark_decodes_the_packets(directory: &Path) {
    assert_eq!(tshark("minute.pcapng", &MALFORMED, directory), "");

    // The same frames by service: as logged, and as tshark has them.
    let log = fs::read_to_string(directory.join("minute.log")).unwrap();
    let lines: Vec<Line> = log.lines().map(|line| Line::parse(line).unwrap()).collect();
    let length = lines[lines.len() - 1].at - lines[0].at;
    assert!(length > Duration::from_secs(60), "{length:?}");
    let mut logged = BTreeMap::new();
    for line in &lines {
        *logged.entry(service(&line.frame)).or_insert(0) += 1;
    }
    let mut decoded = BTreeMap::new();
    let columns = ["-T", "fields", "-e", "_ws.col.Info"];
    for info in tshark("minute.pcapng", &columns, directory).lines() {
        *decoded.entry(named(info)).or_insert(0) += 1;
    }
    assert_eq!(decoded, logged);
    for service in ["NMT", "SYNC", "SDO", "PDO", "NMT error control"] {
        assert!(logged[service] > 3, "{logged:?}");
    }

    // A short SDO is found.
    let path = directory.join("minute.pcapng");
    let mut file = OpenOptions::new().append(true).open(path).unwrap();
    let short = Frame::new(CanId::Standard(0x601), &[0x40, 0x00, 0x10]);
    pcapng::append(&mut file, 0, Duration::from_secs(100), &short).unwrap();
    let found = tshark("minute.pcapng", &MALFORMED, directory);
    assert_eq!(found.lines().count(), 1, "{found}");
}

/// A frame's service by the predefined connection set.
fn service(frame: &Frame) -> &'static str {
    let id = frame.id().raw();
    match id {
        _ if frame.id() == CanId::from(CobId::NMT) => "NMT",
        _ if frame.id() == CanId::from(CobId::SYNC) => "SYNC",
        0x081..=0x0FF => "EMCY",
        0x180..=0x57F => "PDO",
        0x580..=0x67F => "SDO",
        0x700..=0x77F => "NMT error control",
        _ => "other",
    }
}

/// The service in tshark's words.
fn named(info: &str) -> &'static str {
    match info {
        "SYNC" => "SYNC",
        _ if info.starts_with("NMT Error Control") => "NMT error control",
        _ if info.starts_with("NMT") => "NMT",
        _ if info.starts_with("Default-SDO") => "SDO",
        _ if info.starts_with("PDO") => "PDO",
        _ if info.starts_with("EMCY") => "EMCY",
        _ => "other",
    }
}

fn can_utils_read_the_log(directory: &Path) {
    let log = ["-I", "minute.log", "-O", "minute.asc", "portal"];
    output("log2asc", &log, directory);
    let back = output("asc2log", &["-I", "minute.asc"], directory);
    let frame = |line: &str| Line::parse(line).unwrap().frame;
    let back: Vec<Frame> = back.lines().map(frame).collect();
    let log = fs::read_to_string(directory.join("minute.log")).unwrap();
    let logged: Vec<Frame> = log.lines().map(frame).collect();
    assert_eq!(back.len(), logged.len());
    assert!(back == logged);
}
