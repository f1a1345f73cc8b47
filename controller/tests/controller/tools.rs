//! The tools for a bus at work, on simulated drives behind socketcand on loopback.

use crate::outside::{Drives, Namespace, SYNCLINE, TWO_TOLERANT, available, runs};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use syncline_canopen::{CanId, Frame};
use syncline_controller::bus_log::candump::Line;
use syncline_controller::port::url::{BusUrl, End};
use syncline_controller::realtime;
use syncline_drives::model::MODELS;

const MACHINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../examples/portal/machine.toml"
);

/// A portal's drives on a bus.
struct Portal {
    _host: Drives,
    bus: String,
}

impl Portal {
    fn new() -> Self {
        let host = Drives::local(&[MACHINE]);
        let bus = host.url().to_owned();
        Self { _host: host, bus }
    }

    fn run(&self, args: &[&str]) -> (i32, String, String) {
        let Output {
            status,
            stdout,
            stderr,
        } = syncline().args(args).output().expect("runs");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (status.code().unwrap_or(-1), text(stdout), text(stderr))
    }

    fn tool(&self, name: &str, args: &[&str]) -> (i32, String, String) {
        self.run(&[&[name, "--bus", &self.bus], args].concat())
    }
}

fn syncline() -> Command {
    Command::new(SYNCLINE)
}

#[test]
fn tools_on_a_bus() {
    let drives = Portal::new();

    let (code, text, _) = drives.tool("scan", &["--timeout", "2000"]);
    assert_eq!(code, 0);
    for node in 1..=4 {
        let found = format!("node {node}: LXM32M\n  device type 00420192h, vendor 0800005Ah");
        assert!(text.contains(&found), "{text}");
    }

    let sdo = |args: &[&str]| drives.tool("sdo", &[&["--timeout", "2000"], args].concat());
    for object in ["1008", "0x1008:0", "1008h", "Manufacturer device name"] {
        let read = sdo(&["read", "3", object]);
        let told = "1008h:0 Manufacturer device name = \"LXM32M  \"\n";
        assert_eq!(read, (0, told.into(), String::new()));
    }
    assert_eq!(
        sdo(&["write", "3", "DCOMopmode", "-1"]),
        (0, String::new(), String::new())
    );
    assert_eq!(sdo(&["read", "3", "6060"]).1, "6060h:0 DCOMopmode = -1\n");
    assert_eq!(sdo(&["write", "3", "1017", "0x32"]).0, 0);
    assert_eq!(
        sdo(&["write", "3", "6060", "11"]),
        (
            1,
            String::new(),
            "error: node 3: SDO write 6060h:0 aborted 0609 0030h \"invalid value for parameter\"\n"
                .into()
        )
    );
    for (args, told) in [
        (
            ["write", "3", "6060", "300"],
            "error: 300 is outside -128 to 127\n",
        ),
        (["write", "3", "6060", "x"], "error: `x` is no number\n"),
        (
            ["write", "3", "2000:1", "1"],
            "error: the object's type is not known: say it by --type\n",
        ),
        (
            ["write", "3", "DCOMopmod", "1"],
            "error: `DCOMopmod` is no object: did you mean `DCOMopmode`?\n",
        ),
    ] {
        assert_eq!(sdo(&args), (2, String::new(), told.into()));
    }

    assert_eq!(drives.tool("nmt", &["start", "3"]).0, 0);
    // With the next tool's answer the command is on the bus, and what it caused.
    assert_eq!(sdo(&["read", "3", "1017"]).0, 0);
    let (code, text, _) = drives.tool("monitor", &["--node", "3:lxm32m", "--count", "2"]);
    assert_eq!(code, 0);
    assert_eq!(
        text.matches("703#05                 node 3 heartbeat: Operational\n")
            .count(),
        2
    );

    let directory = tempfile::tempdir().expect("a directory");
    let log = directory.path().join("can.log");
    let packets = directory.path().join("can.pcapng");
    let (log, packets) = (
        log.to_str().expect("UTF-8"),
        packets.to_str().expect("UTF-8"),
    );
    let record = ["--candump", log, "--pcapng", packets, "--count", "5"];
    assert_eq!(
        drives.tool("record", &record),
        (0, String::new(), "5 frames\n".into())
    );
    let size = std::fs::metadata(packets).expect("written").len();
    assert_eq!(
        size,
        28 + 40 + 5 * 44,
        "head, interface, 5 packets of one byte"
    );
    let (code, text, _) = drives.run(&["monitor", "--log", log, "--machine", MACHINE]);
    assert_eq!(code, 0);
    assert_eq!(text.lines().count(), 5);
    assert!(text.starts_with("    0.000000  703#05"), "{text}");
}

/// A node that is Stopped, one of which only heartbeats are heard, in a state that CiA 301 does not
/// know, and one that refuses to tell its device type.
#[test]
fn scan_finds_who_does_not_answer() {
    let drives = Drives::local(&TWO_TOLERANT);
    let tool = |args: &[&str]| {
        let mut command = syncline();
        let command = command
            .args([args[0], "--bus", drives.url()])
            .args(&args[1..]);
        String::from_utf8(command.output().expect("runs").stdout).expect("UTF-8")
    };
    tool(&["sdo", "--timeout", "5000", "write", "1", "1017", "50"]);
    tool(&["nmt", "stop", "1"]);
    let url: BusUrl = drives.url().parse().expect("a bus");
    let mut wire = url.open(1_000_000, End::Client).expect("opens");
    let stop = AtomicBool::new(false);
    let found = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                let mut frames = vec![Frame::new(CanId::Standard(0x705), &[0x03])];
                wire.wait(Duration::from_millis(20)).expect("open");
                let mut answer = |_, frame: &Frame| {
                    if frame.id() == CanId::Standard(0x606) {
                        let [_, low, high, sub, ..] = *frame.data() else {
                            return;
                        };
                        // 0602 0000h: object does not exist.
                        let abort = [0x80, low, high, sub, 0, 0, 0x02, 0x06];
                        frames.push(Frame::new(CanId::Standard(0x586), &abort));
                    }
                };
                while wire.receive(&mut answer).expect("open") {}
                wire.send(&mut frames).expect("open");
            }
        });
        let found = tool(&["scan", "--timeout", "1000"]);
        stop.store(true, Ordering::Relaxed);
        found
    });
    for told in [
        "node 1: unknown\n  does not answer, is only heard\n  NMT Stopped\n",
        "node 2: LXM32M\n",
        "node 5: unknown\n  does not answer, is only heard\n  \
         NMT state 03h, which CiA 301 does not know\n",
        "node 6: unknown\n  device type aborted 0602 0000h \
         \"object does not exist in the object dictionary\", vendor -, product -, revision -\n",
    ] {
        assert!(found.contains(told), "{found}");
    }
}

/// What `run` records of a bus that is not its own: its own frames and the drives'.
#[test]
fn a_run_records_its_bus() {
    let drives = Portal::new();
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (program, log) = (at("short.ngc"), at("run.log"));
    std::fs::write(&program, "G0 X10\nM2\n").expect("written");
    let run = ["run", MACHINE, &program, "--candump", &log];
    let (code, _, complained) = drives.run(&[&run[..], &["--bus", &drives.bus]].concat());
    // A busy host may make it late, and that a fault.
    assert!(matches!(code, 0 | 1), "{complained}");
    let log = std::fs::read_to_string(log).expect("written");
    let count = |frame: &str| log.matches(frame).count();
    // Of NMT, node 4: reset communication, start, boot-up and, last of all, Pre-Operational.
    assert!(count(" 000#8204") == 1 && count(" 704#00") == 1, "{log}");
    assert!(count(" 000#0104") <= 1 && count(" 000#8004") >= 1, "{log}");
    let (requests, answers) = (count(" 604#"), count(" 584#"));
    assert!(requests > 50 && requests.abs_diff(answers) < 3, "{log}");
    let seconds = |line: &str| Line::parse(line).expect("a line").at.as_secs();
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    let now = since_1970.expect("after 1970").as_secs();
    assert!(log.lines().all(|line| now - seconds(line) < 600));
}

/// Requests to two drives at once, each answered as soon as its processor has time: with
/// `--prompt` always in the order of the requests.
#[test]
fn prompt_drives_answer_in_order() {
    let in_order = |options: &[&str]| {
        let drives = Drives::local(&[&TWO_TOLERANT[..], options].concat());
        let url: BusUrl = drives.url().parse().expect("a bus");
        let mut wire = url.open(1_000_000, End::Client).expect("opens");
        let request = |node: u16| {
            let read = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
            Frame::new(CanId::Standard(0x600 + node), &read)
        };
        (0..40).all(|_| {
            wire.send(&mut vec![request(1), request(2)]).expect("sent");
            let mut answers = Vec::new();
            while answers.len() < 2 {
                wire.wait(Duration::from_secs(10)).expect("open");
                let mut keep = |_, frame: &Frame| {
                    if frame.id().raw() & 0x780 == 0x580 {
                        answers.push(frame.id().raw());
                    }
                };
                assert!(wire.receive(&mut keep).expect("open"), "no answer");
            }
            answers == [0x581, 0x582]
        })
    };
    assert!(in_order(&["--prompt"]));
    assert!(!in_order(&[]));
}

/// The server byte by byte, as python-can and socketcand's own clients meet it.
#[test]
fn socketcand_to_the_letter() {
    let drives = Drives::local(&TWO_TOLERANT);
    let mut stream =
        TcpStream::connect(("127.0.0.1", drives.port().parse().expect("a port"))).expect("listens");
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .expect("set");
    // One segment at a time.
    let mut answer = |request: &str| {
        stream.write_all(request.as_bytes()).expect("written");
        let mut bytes = [0; 256];
        let length = stream.read(&mut bytes).expect("an answer");
        String::from_utf8(bytes[..length].to_vec()).expect("UTF-8")
    };
    assert_eq!(answer(""), "< hi >");
    assert_eq!(answer("< open can7 >"), "< error could not open bus >");
    assert_eq!(answer("< open can0 >"), "< ok >");
    assert_eq!(answer("< rawmode >"), "< ok >");
    // Hexadecimal without leading zeros, in two segments; 8 digits are an extended identifier,
    // which is nobody's.
    assert_eq!(answer("< echo >"), "< echo >");
    assert_eq!(answer("< send 601 9 0 >"), "< error invalid frame >");
    assert_eq!(answer("< send 601 2 0 >"), "< error invalid frame >");
    let sent = "< send 00000601 8 40 0 10 0 0 0 0 0 >< send 80 0  >";
    assert_eq!(
        answer(&format!("{sent}< nonsense >")),
        "< error unknown command >"
    );
    let upload = answer("< send 601 8 40 0 10 0 0 0 0 0 >");
    let (head, data) = upload.rsplit_once(" 4300100092014200 >").expect(&upload);
    let time = head.strip_prefix("< frame 581 ").expect(&upload);
    assert!(data.is_empty() && time.split_once('.').is_some_and(|(_, us)| us.len() == 6));
    drives.stop();
}

/// All tools, and `run`, over UDP multicast in a namespace of its own.
#[test]
fn every_tool_over_udp() {
    let network = match Namespace::new() {
        Ok(network) => network,
        Err(why) => {
            available(Err(why));
            return;
        }
    };
    const BUS: &str = "udp://239.74.163.2:43113";
    let run = |args: &[&str]| {
        let output = network.command(SYNCLINE).args(args).output().expect("runs");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (
            output.status.code(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let tool = |name: &str, args: &[&str]| run(&[&[name, "--bus", BUS], args].concat());
    let _drives = Drives::start(network.command(SYNCLINE), &[MACHINE], BUS);
    let (code, found, _) = tool("scan", &["--timeout", "2000"]);
    assert_eq!(
        (code, found.matches(": LXM32M").count()),
        (Some(0), 4),
        "{found}"
    );
    // One that is Stopped and has no heartbeat answers to guarding only.
    assert_eq!(tool("nmt", &["stop", "3"]).0, Some(0));
    let (_, found, _) = tool("scan", &["--timeout", "2000"]);
    assert!(
        found.contains("node 4: LXM32M") && !found.contains("node 3"),
        "{found}"
    );
    let (_, found, _) = tool("scan", &["--timeout", "2000", "--guarding"]);
    let stopped = "node 3: unknown\n  does not answer, is only heard\n  NMT Stopped\n";
    assert!(found.contains(stopped), "{found}");
    assert_eq!(tool("sdo", &["write", "2", "1017", "20"]).0, Some(0));
    assert_eq!(tool("nmt", &["start", "2"]).0, Some(0));
    let (_, seen, _) = tool("monitor", &["--machine", MACHINE, "--count", "3"]);
    assert_eq!(
        seen.matches("node 2 heartbeat: Operational").count(),
        3,
        "{seen}"
    );
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (recorded, log, program) = (at("recorded.log"), at("run.log"), at("short.ngc"));
    let (_, _, told) = tool("record", &["--candump", &recorded, "--count", "3"]);
    assert_eq!(told, "3 frames\n");
    std::fs::write(&program, "G0 X10\nM2\n").expect("written");
    let (code, _, complained) = run(&["run", MACHINE, &program, "--bus", BUS, "--candump", &log]);
    // A busy host may make it late, and that a fault.
    assert!(matches!(code, Some(0 | 1)), "{complained}");
    let log = std::fs::read_to_string(log).expect("written");
    assert!(
        log.contains(" 000#8202") && log.contains(" 702#00"),
        "{log}"
    );
}

/// What comes from another host moves no drive that is on loopback, even if another program of this
/// host has joined the group on the interface that it comes by.
#[test]
fn multicast_stays_on_its_interface() {
    let hosts = || {
        let (here, there) = (Namespace::new()?, Namespace::new()?);
        here.join(("cable", "10.9.8.1/24"), &there, ("outside", "10.9.8.2/24"))?;
        Ok((here, there))
    };
    let (here, there) = match hosts() {
        Ok(hosts) => hosts,
        Err(why) => {
            available(Err(why));
            return;
        }
    };
    const BUS: &str = "udp://239.74.163.2:43113";
    const CABLE: &str = "udp://239.74.163.2:43113?interface=cable";
    const OUTSIDE: &str = "udp://239.74.163.2:43113?interface=outside";
    let drives = Drives::start(here.command(SYNCLINE), &TWO_TOLERANT, BUS);
    let say = |host: &Namespace, bus: &str, words: &[&str]| {
        let mut command = host.command(SYNCLINE);
        let output = command
            .arg(words[0])
            .args(["--bus", bus])
            .args(&words[1..])
            .output();
        let output = output.expect("runs");
        assert!(output.status.success(), "{words:?}: {output:?}");
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    say(
        &here,
        BUS,
        &["sdo", "--timeout", "5000", "write", "2", "1017", "20"],
    );

    // Another program joins the group on the cable, and hears what comes from there.
    let mut joined = here.command(SYNCLINE);
    let joined = joined.args(["monitor", "--bus", CABLE, "--count", "1"]);
    let mut joined = joined.stdout(Stdio::piped()).spawn().expect("runs");
    let deadline = Instant::now() + Duration::from_secs(20);
    while joined.try_wait().expect("a child").is_none() {
        assert!(Instant::now() < deadline, "nothing crosses the cable");
        say(&there, OUTSIDE, &["nmt", "start", "2"]);
        std::thread::sleep(Duration::from_millis(50));
    }
    let heard = joined.wait_with_output().expect("ended").stdout;
    let heard = String::from_utf8(heard).expect("UTF-8");
    assert!(heard.contains("000#0102"), "{heard}");

    let state = |count| say(&here, BUS, &["monitor", "--count", count]);
    let before = state("5");
    assert_eq!(before.matches("702#7F").count(), 5, "{before}");
    say(&here, BUS, &["nmt", "start", "2"]);
    let after = state("5");
    assert_eq!(after.matches("702#05").count(), 5, "{after}");
    drives.stop();
}

/// A frame that waits to be read is stamped when it came, over UDP too.
#[test]
fn frames_are_stamped_when_they_come() {
    // A thread for its namespace.
    let read = std::thread::spawn(read_late_in_a_namespace).join();
    read.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
}

fn read_late_in_a_namespace() {
    // What this thread and its children open is in there.
    let alone = nix::sched::unshare(nix::sched::CloneFlags::CLONE_NEWNET);
    let alone = alone.map_err(|error| format!("no network namespace: {error}"));
    let up = ["link", "set", "lo", "up", "multicast", "on"];
    let route = ["route", "add", "224.0.0.0/4", "dev", "lo"];
    let ready = alone.and_then(|()| runs("ip", &up));
    if !available(ready.and_then(|()| runs("ip", &route))) {
        return;
    }
    let open = || {
        let url: BusUrl = "udp://239.74.163.2:43113".parse().expect("a bus");
        url.open(1_000_000, End::Client).expect("opens")
    };
    let (mut sender, mut reader) = (open(), open());
    let frame = Frame::new(CanId::Standard(0x181), &[1, 2]);
    // When it was sent, and when it came.
    let mut late = |wait| {
        let before = realtime::now();
        sender.send(&mut vec![frame]).expect("sent");
        let after = realtime::now();
        std::thread::sleep(Duration::from_millis(wait));
        let mut came = Vec::new();
        while (reader.receive(&mut |at, frame| came.push((at, *frame)))).expect("open") {}
        let [(at, same)] = came[..] else {
            panic!("{came:?}");
        };
        assert_eq!(same, frame);
        (before, at, after)
    };
    // The readings of two clocks lie this close together.
    let close = Duration::from_micros(200);
    // The kernel begins to stamp some time after it is asked to.
    let deadline = Instant::now() + Duration::from_secs(20);
    loop {
        let (_, at, after) = late(10);
        if at <= after + close {
            break;
        }
        assert!(Instant::now() < deadline, "stamped when they are read");
    }
    for wait in [0, 5, 20, 50] {
        let (before, at, after) = late(wait);
        assert!(
            before <= at + close && at <= after + close,
            "{before:?} {at:?} {after:?}"
        );
    }
}

#[test]
fn bad_input() {
    let run = |args: &[&str]| {
        let output = syncline().args(args).output().expect("runs");
        let text = String::from_utf8(output.stderr).expect("UTF-8");
        (output.status.code(), text)
    };
    let directory = tempfile::tempdir().expect("a directory");
    let log = directory.path().join("bad.log");
    std::fs::write(&log, "(1.0) can0 181#3742\n(1.0) can0 181\n").expect("written");
    let (code, told) = run(&["monitor", "--log", log.to_str().expect("UTF-8")]);
    assert_eq!(code, Some(2));
    assert!(
        told.ends_with("bad.log:2: expected (SECONDS) INTERFACE ID#DATA\n"),
        "{told}"
    );
    let models: Vec<&str> = MODELS.iter().map(|model| model.name).collect();
    let no_model = format!("no model `y`, only {}", models.join(", "));
    for (args, told) in [
        (&["scan", "--bus", "tcp://x"][..], "`tcp://x` is no bus"),
        (
            &["scan", "--bus", "sim"],
            "a simulated bus lives inside the command that runs the machine",
        ),
        (
            &["nmt", "--bus", "can0", "start", "128"],
            "`128` is no node id: 1 to 127",
        ),
        (
            &["monitor", "--log", "x", "--node", "1:y"],
            no_model.as_str(),
        ),
        (&["monitor"], "required"),
        (&["scan", "--bus", "can0", "--timeout", "0"], "1..=600000"),
        (
            &[
                "sdo",
                "--bus",
                "can0",
                "--timeout",
                "99999999999999",
                "read",
                "1",
                "6041",
            ],
            "1..=600000",
        ),
        (
            &[
                "record",
                "--bus",
                "can0",
                "--candump",
                "/dev/null",
                "--seconds",
                "18446744073709551615",
            ],
            "0..=2678400",
        ),
        (&["bench", "cycle", "--duration", "1e18s"], "31 days"),
        (
            &["run", MACHINE, "x.ngc", "--core", "9999"],
            "this machine has cores 0 to ",
        ),
    ] {
        let (code, error) = run(args);
        assert_eq!(code, Some(2), "{args:?}");
        assert!(error.contains(told), "{error}");
    }
}

/// A server that answers is running: it has no such bus.
#[test]
fn a_bus_that_a_server_does_not_have_is_told() {
    let drives = Drives::local(&TWO_TOLERANT);
    let url = drives.url().replace("/can0", "/can7");
    let output = Command::new(SYNCLINE)
        .args(["scan", "--bus", &url])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("the server does not open it: expected `< ok >`, got `< error"),
        "{told}"
    );
    assert!(!told.contains("is a server running"), "{told}");
}
