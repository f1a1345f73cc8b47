//! The SocketCAN port on a kernel that has it. Run by `tests/vm/suite`; by hand as root with
//! `cargo test -p syncline-controller --test socketcan -- --ignored --test-threads 1`.

use socketcan::{CanSocket, EmbeddedFrame, Frame as _, Socket, StandardId};
use std::process::Command;
use std::time::Duration;
use syncline_canopen::{CobId, Frame, NodeId};
use syncline_controller::bus::BusFault;
use syncline_controller::bus::{Burst, Received};
use syncline_controller::port::Port;
use syncline_controller::port::socketcan::{Options, SocketCan, StampSource};
use syncline_controller::realtime;

fn ip(arguments: &str) {
    run("ip", arguments);
}

fn run(program: &str, arguments: &str) {
    let status = Command::new(program)
        .args(arguments.split_whitespace())
        .status()
        .unwrap();
    assert!(status.success(), "{program} {arguments}");
}

fn node(id: u8) -> NodeId {
    NodeId::new(id).unwrap()
}

fn options(axes: u8) -> Options {
    Options {
        bit_rate: 1_000_000,
        receive: (1..=axes).map(|id| CobId::t_pdo(2, node(id))).collect(),
        heartbeat: CobId::error_control(node(127)),
        burst: (1..=axes).map(|id| CobId::r_pdo(2, node(id))).collect(),
    }
}

fn burst(axes: u8) -> Vec<Frame> {
    (1..=axes)
        .map(|id| Frame::new(CobId::r_pdo(2, node(id)), &[0x1F, 0, id, 0, 0, 0]))
        .collect()
}

/// A virtual interface of its own for one test, removed at its end.
struct Vcan(&'static str);

impl Vcan {
    fn new(name: &'static str) -> Self {
        ip(&format!("link add dev {name} type vcan"));
        ip(&format!("link set {name} up"));
        Self(name)
    }
}

impl Drop for Vcan {
    fn drop(&mut self) {
        let _ = Command::new("ip").args(["link", "del", self.0]).status();
    }
}

fn receive(port: &mut SocketCan) -> Vec<Received> {
    std::thread::sleep(Duration::from_millis(20));
    let mut received = Vec::new();
    port.receive(&mut |frame| received.push(frame)).unwrap();
    received
}

fn refusal(interface: &str, options: &Options) -> String {
    match SocketCan::open(interface, options) {
        Ok(_) => panic!("{interface} was taken"),
        Err(error) => error.to_string(),
    }
}

#[test]
#[ignore = "needs SocketCAN and root: tests/vm/suite"]
fn only_what_is_used_comes_in_and_echoes_are_told_from_strangers() {
    let vcan = Vcan::new("vcan1");
    let mut port = SocketCan::open(vcan.0, &options(2)).unwrap();
    let other = CanSocket::open(vcan.0).unwrap();
    let say = |id, data: &[u8]| {
        let id = StandardId::new(id).unwrap();
        other
            .write_frame(&socketcan::CanFrame::new(id, data).unwrap())
            .unwrap();
    };
    let before = realtime::now();
    say(0x281, &[1, 2]);
    say(0x283, &[3]);
    say(0x301, &[4]);
    port.send_sync(&Frame::new(CobId::SYNC, &[])).unwrap();
    assert_eq!(port.send_burst(&burst(2)).unwrap(), Burst::Queued);
    let life = Frame::new(CobId::error_control(node(127)), &[5]);
    port.send_acyclic(&[Frame::new(CobId::NMT, &[1, 0]), life])
        .unwrap();
    say(0x080, &[]);
    say(0x77F, &[5]);
    say(0x000, &[2, 5]);
    let received = receive(&mut port);
    let after = realtime::now();

    let seen: Vec<(u32, bool)> = received
        .iter()
        .map(|it| (it.frame.id().raw(), it.echo))
        .collect();
    assert_eq!(
        seen,
        [
            (0x281, false),
            (0x301, false),
            (0x080, true),
            (0x301, true),
            (0x302, true),
            (0x000, true),
            (0x77F, true),
            (0x080, false),
            (0x77F, false),
            (0x000, false)
        ]
    );
    assert_eq!(received[0].frame.data(), [1, 2]);
    assert!(received.is_sorted_by_key(|it| it.at));
    assert!(before <= received[0].at && received[9].at <= after);
    assert_eq!(port.stamps(), StampSource::Software);

    let everything = CanSocket::open(vcan.0).unwrap();
    everything.set_nonblocking(true).unwrap();
    port.send_acyclic(&[Frame::new(CobId::NMT, &[2, 0])])
        .unwrap();
    assert_eq!(everything.read_frame().unwrap().data(), [2, 0]);
}

#[test]
#[ignore = "needs SocketCAN and root: tests/vm/suite"]
fn refusals_say_what_to_type() {
    assert!(refusal("can7", &options(1)).contains("no such interface"));
    let vcan = Vcan::new("vcan2");
    ip("link set vcan2 down");
    let text = refusal(vcan.0, &options(1));
    assert!(
        text.contains("is down: `sudo ip link set vcan2 up`"),
        "{text}"
    );
}

#[test]
#[ignore = "needs SocketCAN and root: tests/vm/suite"]
fn an_interface_that_goes_down_is_an_error_that_names_it() {
    let vcan = Vcan::new("vcan3");
    let mut port = SocketCan::open(vcan.0, &options(1)).unwrap();
    port.receive(&mut |_| ()).unwrap();
    ip("link set vcan3 down");
    let text = port.receive(&mut |_| ()).unwrap_err().to_string();
    assert_eq!(
        text,
        "bus vcan3: receiving: the interface went down, `sudo ip link set vcan3 up`"
    );
    assert!(port.send_sync(&Frame::new(CobId::SYNC, &[])).is_err());
    assert!(port.send_burst(&burst(1)).is_err());
    ip("link set vcan3 up");
    port.receive(&mut |_| ()).unwrap();
    assert_eq!(port.send_burst(&burst(1)).unwrap(), Burst::Queued);
}

/// Error frames as an adapter's driver hands them over.
#[test]
#[ignore = "needs SocketCAN and root: tests/vm/suite"]
fn error_frames_are_counted_told_or_the_end() {
    let vcan = Vcan::new("vcan6");
    let mut port = SocketCan::open(vcan.0, &options(1)).unwrap();
    let adapter = CanSocket::open(vcan.0).unwrap();
    let report = |class, data: &[u8]| {
        let error = socketcan::CanErrorFrame::new_error(class, data).unwrap();
        adapter.write_frame(&error).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    };
    // Arbitration lost in bit 7; the transmit error counter beyond 96, beyond 127.
    report(0x02, &[7]);
    assert_eq!(receive(&mut port), []);
    assert_eq!(port.condition(), None);
    report(0x04, &[0, 0x08]);
    assert_eq!(receive(&mut port), []);
    assert_eq!(port.condition(), Some(BusFault::ErrorWarning));
    assert_eq!(port.condition(), None, "told once");
    report(0x04, &[0, 0x08]);
    report(0x04, &[0, 0x20]);
    assert_eq!(receive(&mut port), []);
    assert_eq!(port.condition(), Some(BusFault::ErrorPassive));
    report(0x40, &[]);
    let text = port.receive(&mut |_| ()).unwrap_err().to_string();
    assert!(
        text.starts_with("bus vcan6: bus off, check cable")
            && text.ends_with("`sudo ip link set vcan6 type can restart`"),
        "{text}"
    );
    let seen: Vec<_> = port.faults().seen().collect();
    assert_eq!(
        seen,
        [
            (BusFault::BusOff, 1),
            (BusFault::ErrorPassive, 1),
            (BusFault::ErrorWarning, 2),
            (BusFault::ArbitrationLost, 1)
        ]
    );
}

/// While frames wait to leave, a second burst behind the first is dropped whole; once the first
/// has left there is room again.
#[test]
#[ignore = "needs SocketCAN and root: tests/vm/suite"]
fn a_full_queue_drops_the_burst_whole() {
    let vcan = Vcan::new("vcan4");
    run("tc", "qdisc add dev vcan4 root netem delay 200ms");
    let mut port = SocketCan::open(vcan.0, &options(4)).unwrap();
    assert_eq!(port.send_burst(&burst(4)).unwrap(), Burst::Queued);
    assert_eq!(port.send_burst(&burst(4)).unwrap(), Burst::Dropped);
    let mut echoed = 0;
    for _ in 0..500 {
        echoed += receive(&mut port).iter().filter(|it| it.echo).count();
        if echoed == 4 {
            break;
        }
        assert_eq!(port.send_burst(&burst(4)).unwrap(), Burst::Dropped);
    }
    assert_eq!(echoed, 4, "each frame's echo says that it left");
    assert_eq!(port.send_burst(&burst(4)).unwrap(), Burst::Queued);
}

/// Somebody else's frames fill the queue that we share: the kernel takes none or some of ours.
#[test]
#[ignore = "needs SocketCAN and root: tests/vm/suite"]
fn a_queue_filled_by_others_tears_or_drops() {
    let vcan = Vcan::new("vcan5");
    run("tc", "qdisc add dev vcan5 root netem delay 2s limit 6");
    let mut port = SocketCan::open(vcan.0, &options(4)).unwrap();
    let other = CanSocket::open(vcan.0).unwrap();
    let stranger = socketcan::CanFrame::new(StandardId::new(0x123).unwrap(), &[]).unwrap();
    for _ in 0..4 {
        other.write_frame(&stranger).unwrap();
    }
    assert_eq!(
        port.send_burst(&burst(4)).unwrap(),
        Burst::Torn { queued: 2 }
    );
    assert_eq!(port.send_burst(&burst(2)).unwrap(), Burst::Dropped);
    assert!(port.send_sync(&Frame::new(CobId::SYNC, &[])).is_err());
    port.send_acyclic(&burst(1)).unwrap();
}

/// An adapter with its driver (QEMU's Kvaser PCI, SJA1000): bit rate, queue length, echo.
#[test]
#[ignore = "needs two adapters on one bus, can0 and can1: tests/vm/suite"]
fn an_adapter_is_checked_and_used() {
    let text = refusal("can0", &options(3));
    let set_up = "`sudo ip link set can0 down; sudo ip link set can0 up type can bitrate 1000000`";
    assert!(text.ends_with(&format!("is down: {set_up}")), "{text}");
    ip("link set can0 up type can bitrate 500000");
    let text = refusal("can0", &options(3));
    assert!(
        text.contains("runs at 500000 bit/s, the machine file says 1000000"),
        "{text}"
    );
    ip("link set can0 down");
    ip("link set can0 up type can bitrate 1000000");
    ip("link set can1 up type can bitrate 1000000");

    let mut port = SocketCan::open("can0", &options(3)).unwrap();
    let queue = std::fs::read_to_string("/sys/class/net/can0/tx_queue_len").unwrap();
    assert_eq!(queue.trim(), "3", "sized to one burst");
    let peer = CanSocket::open("can1").unwrap();
    peer.set_nonblocking(true).unwrap();
    port.send_sync(&Frame::new(CobId::SYNC, &[])).unwrap();
    assert_eq!(port.send_burst(&burst(3)).unwrap(), Burst::Queued);
    let received = receive(&mut port);
    assert_eq!(received.len(), 4, "{received:?}");
    assert!(received.iter().all(|it| it.echo));
    for id in [0x080, 0x301, 0x302, 0x303] {
        let frame = peer.read_frame().unwrap();
        assert_eq!(frame.raw_id(), id);
    }
    assert_eq!(port.faults().seen().count(), 0);
}
