//! What the bus sees from power-up to the program, and from the program to the end.

use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant, NodeId, nmt};
use syncline_controller::control::fault::{BusCause, DeviceCause};
use syncline_controller::control::{self, End, Event, Fault, Phase};
use syncline_controller::machine::Machine;
use syncline_controller::port::{Port, sim};
use syncline_controller::session::Command;
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// The set-up of Interpolated Position, index:sub, length and value, in its order
/// (lxm32m 1604-1636). `ID` and `MS` stand for node id and cycle.
const SET_UP: &str = "
1400:1 4 80000200+ID   1800:1 4 80000180+ID   1401:1 4 00000300+ID   1801:1 4 00000280+ID
1402:1 4 80000400+ID   1802:1 4 80000380+ID   1403:1 4 80000500+ID   1803:1 4 80000480+ID
1401:2 1 1             1801:2 1 1             6040:0 2 0             6040:0 2 80
1601:0 1 0             1601:1 4 60400010      1601:2 4 60C10120      1601:0 1 2
1A01:0 1 0             1A01:1 4 60410010      1A01:2 4 60640020      1A01:0 1 2
3006:7 4 20000         3006:8 4 1             6060:0 1 7             3006:3D 2 1
60C2:1 1 MS            3012:6 2 3E8           3013:6 2 3E8           3006:6 2 1
3022:4 2 1             3022:5 2 2";

/// The set-up's requests to a node as they have to stand on the bus (CiA 301, expedited).
fn set_up_requests(node: NodeId, cycle_ms: u8) -> Vec<[u8; 8]> {
    let mut words = SET_UP.split_whitespace();
    let mut requests = Vec::new();
    while let (Some(object), Some(bytes), Some(value)) = (words.next(), words.next(), words.next())
    {
        let hex = |text: &str| u32::from_str_radix(text, 16).unwrap();
        let (index, sub) = object.split_once(':').unwrap();
        let bytes: u8 = bytes.parse().unwrap();
        let value = match value.split_once('+') {
            Some((base, _)) => hex(base) + u32::from(node.get()),
            None if value == "MS" => u32::from(cycle_ms),
            None => hex(value),
        };
        let mut request = [0; 8];
        request[0] = 0x23 | (4 - bytes) << 2;
        request[1..3].copy_from_slice(&(hex(index) as u16).to_le_bytes());
        request[3] = hex(sub) as u8;
        request[4..].copy_from_slice(&value.to_le_bytes());
        requests.push(request);
    }
    assert_eq!(requests.len(), 30);
    requests
}

/// Both machines' runs to their end, undisturbed.
fn runs() -> Vec<Rig> {
    let portal = Rig::portal(PORTAL_PROGRAM);
    let program = "G4 P0.1\nG0 X20 Y-20 Z-5\nG3 X30 Y-10 J10 F6000\nM30\n";
    let xyz = Rig::new("xyz", &[], program, |_, _| ());
    let mut runs = vec![portal, xyz];
    for rig in &mut runs {
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    }
    runs
}

fn nodes(rig: &Rig) -> impl Iterator<Item = (usize, NodeId)> {
    rig.machine
        .drives
        .iter()
        .map(|drive| drive.node)
        .enumerate()
}

/// Requests to a node's SDO server.
fn requests(rig: &Rig, node: NodeId) -> Vec<Transmission> {
    rig.sent(CobId::r_sdo(node))
}

/// When the first of these frames that begins so was sent.
fn first(frames: &[Transmission], begin: &[u8]) -> Instant {
    let found = frames.iter().find(|it| it.frame.data().starts_with(begin));
    let found = found.unwrap_or_else(|| panic!("no {begin:02X?}"));
    found.start
}

fn nmt_frames(rig: &Rig) -> Vec<(Instant, u8, u8)> {
    let frames = rig.sent(CanId::Standard(0));
    let fields = |it: &Transmission| match *it.frame.data() {
        [command, node] => (it.start, command, node),
        ref data => panic!("an NMT command of {} bytes", data.len()),
    };
    frames.iter().map(fields).collect()
}

fn nmt_sent(rig: &Rig, command: nmt::Command, node: NodeId) -> Instant {
    let frames = nmt_frames(rig);
    let is = |it: &&(Instant, u8, u8)| (it.1, it.2) == (command as u8, node.get());
    let found: Vec<_> = frames.iter().filter(is).collect();
    assert_eq!(found.len(), 1, "{command:?} to {node} in {frames:?}");
    found[0].0
}

#[test]
fn the_set_up_is_the_manuals_byte_for_byte() {
    for rig in runs() {
        let cycle_ms = rig.machine.cycle.as_millis() as u8;
        for (_, node) in nodes(&rig) {
            let booted = nmt_sent(&rig, nmt::Command::ResetCommunication, node);
            let is_write =
                |it: &&Transmission| it.start > booted && it.frame.data()[0] & 0xE0 == 0x20;
            let sent = requests(&rig, node);
            let writes: Vec<&[u8]> = sent
                .iter()
                .filter(is_write)
                .map(|it| it.frame.data())
                .collect();
            let expected = set_up_requests(node, cycle_ms);
            for (row, (write, expected)) in writes.iter().zip(&expected).enumerate() {
                assert_eq!(write, expected, "I-{:02} of node {node}", row + 1);
            }
            // Then what the machine file asks for, and the heartbeats both ways.
            let rest: Vec<[u8; 4]> = writes[30..]
                .iter()
                .map(|it| it[..4].try_into().unwrap())
                .collect();
            for object in [[0x2B, 0x17, 0x10, 0], [0x23, 0x16, 0x10, 1]] {
                assert!(rest.contains(&object), "{rest:02X?}");
            }
        }
    }
}

#[test]
fn limits_and_own_objects_follow_the_set_up() {
    let runs = runs();
    let [portal, xyz] = &runs[..] else {
        panic!("two machines");
    };
    let writes = |rig: &Rig, drive: usize, begin: [u8; 4]| {
        let mut sent = requests(rig, rig.machine.drives[drive].node);
        sent.retain(|it| it.frame.data().starts_with(&begin));
        let value =
            |it: &Transmission| i32::from_le_bytes(it.frame.data()[4..].try_into().unwrap());
        sent.iter().map(value).collect::<Vec<_>>()
    };
    // 2 mm at 20 mm a revolution, rounded up.
    assert_eq!(writes(portal, 0, [0x23, 0x65, 0x60, 0]), [13_108]);
    // Soft limits 0…1500 mm, further out by the following error; X2 is mirrored.
    let zero = [1_250_000, -843_776];
    let around = |zero: i32, mm: f64| zero + (mm / 20.0 * 131_072.0).round() as i32;
    let near = |found: &[i32], expected: i32| {
        assert!(
            found.len() == 1 && found[0].abs_diff(expected) <= 1,
            "{found:?}, {expected}"
        );
    };
    near(
        &writes(portal, 0, [0x23, 0x7D, 0x60, 1]),
        around(zero[0], -2.0),
    );
    near(
        &writes(portal, 0, [0x23, 0x7D, 0x60, 2]),
        around(zero[0], 1502.0),
    );
    near(
        &writes(portal, 1, [0x23, 0x7D, 0x60, 1]),
        around(zero[1], -1502.0),
    );
    near(
        &writes(portal, 1, [0x23, 0x7D, 0x60, 2]),
        around(zero[1], 2.0),
    );
    // Not enabled on the other machine; its third drive has objects of its own.
    assert_eq!(writes(xyz, 0, [0x23, 0x65, 0x60, 0]), [0; 0]);
    assert_eq!(writes(xyz, 0, [0x2B, 0x12, 0x30, 6]), [1000]);
    assert_eq!(writes(xyz, 2, [0x2B, 0x12, 0x30, 6]), [1000, 1000]);
}

#[test]
fn the_bring_up_goes_in_its_order() {
    for rig in runs() {
        let frames = rig.frames();
        let first_sync = rig.syncs()[0];
        for (drive, node) in nodes(&rig) {
            let asked = requests(&rig, node);
            // What it is, read before anything is told to it, and what it remembers.
            assert_eq!(asked[0].frame.data()[..4], [0x40, 0x41, 0x60, 0]);
            let survey = asked[0].start;
            let history = [
                [0x40, 0x3F, 0x60, 0],
                [0x40, 1, 0x10, 0],
                [0x40, 3, 0x10, 1],
            ];
            let remembered = history
                .map(|object| first(&asked, &object))
                .into_iter()
                .max();
            let reset = nmt_sent(&rig, nmt::Command::ResetCommunication, node);
            let from_node = |id: CobId, data: u8| {
                let is =
                    |it: &&Transmission| it.start > reset && it.frame == Frame::new(id, &[data]);
                frames.iter().find(is).unwrap().start
            };
            let boot_up = from_node(CobId::error_control(node), 0);
            let identity = [[0x40, 0, 0x10, 0], [0x40, 0x18, 0x10, 1]];
            let identity = identity.map(|object| first(&asked, &object));
            let set_up = first(&asked, &[0x23, 0, 0x14, 1]);
            let last_write = first(&asked, &[0x2B, 0x22, 0x30, 5, 2]);
            let start = nmt_sent(&rig, nmt::Command::Start, node);
            let lock = first(&asked, &[0x40, 0x22, 0x30, 6]);
            let commands = rig.commands(drive);
            let when = |word: u16| commands.iter().find(|it| it.1 == word).unwrap().0;
            let mode = first(&asked, &[0x40, 0x61, 0x60, 0]);
            let order = [
                survey,
                remembered.unwrap(),
                reset,
                boot_up,
                identity[0],
                identity[1],
                set_up,
                last_write,
                first_sync,
                start,
                lock,
                when(0x06),
                when(0x0F),
                when(0x1F),
                mode,
            ];
            assert!(order.is_sorted(), "node {node}: {order:?}");
            assert!(commands[0].1 == 0 && commands[0].0 > start, "0000h first");
        }
        // All drives are set up when SYNC starts, and none is told what is meant for all.
        assert!(nmt_frames(&rig).iter().all(|it| it.2 != 0));
        let phases: Vec<Phase> = rig.phases.iter().map(|it| it.0).collect();
        assert!(phases.is_sorted(), "{phases:?}");
    }
}

/// Nobody moves before the program, nor is anybody told to.
#[test]
fn before_the_program_every_drive_stays_where_it_is() {
    for rig in runs() {
        let frames = rig.frames();
        let phase = |wanted| rig.phases.iter().find(|it| it.0 == wanted).unwrap().1;
        let moves = rig
            .rows
            .iter()
            .position(|row| row.plan.speed > 0.0)
            .unwrap();
        let program = phase(Phase::Program) + rig.machine.cycle * moves as u32;
        let frozen = phase(Phase::ModeStart);
        for (drive, node) in nodes(&rig) {
            let axis = &rig.machine.axes[rig.machine.drives[drive].axis];
            let window = rig.machine.drives[drive]
                .scaling
                .magnitude(axis.limits.standstill)
                .get();
            let commands = rig.commands(drive);
            let mut still: Vec<i32> = Vec::new();
            for &(at, _, setpoint) in commands.iter().take_while(|it| it.0 < program) {
                let is_sample = |it: &&Transmission| {
                    it.frame.id() == CanId::from(CobId::t_pdo(2, node)) && it.end <= at
                };
                let sample = frames.iter().rev().find(is_sample).unwrap().frame;
                let actual = i32::from_le_bytes(sample.data()[2..6].try_into().unwrap());
                if at < frozen {
                    assert_eq!(setpoint, actual, "node {node} at {at:?}");
                } else {
                    still.push(setpoint);
                    assert!(i64::from(actual).abs_diff(i64::from(still[0])) <= window as u64);
                }
            }
            assert!(still.len() >= 3, "frozen for some cycles: {still:?}");
            assert!(
                still.iter().all(|it| *it == still[0]),
                "node {node}: {still:?}"
            );
        }
    }
}

/// From the first to the last one there is a setpoint for every SYNC, and it comes before it.
#[test]
fn every_sync_finds_a_new_setpoint_in_every_drive() {
    for rig in runs() {
        let syncs = rig.syncs();
        let gaps = syncs
            .windows(2)
            .map(|pair| pair[1].saturating_since(pair[0]));
        // A frame that a drive has begun to send delays SYNC by its length at most.
        let blocking = Duration::from_secs(135) / rig.machine.buses[0].bitrate;
        let uneven = gaps.map(|gap| gap.abs_diff(rig.machine.cycle)).max();
        assert!(uneven.unwrap() <= blocking, "SYNC is even: {uneven:?}");
        for (drive, node) in nodes(&rig) {
            let commands = rig.commands(drive);
            let (begin, end) = (commands[0].0, commands[commands.len() - 1].0);
            let mut sent = commands.iter().map(|it| it.0).peekable();
            for pair in syncs
                .windows(2)
                .filter(|pair| pair[1] > begin && pair[0] < end)
            {
                let here = sent.next_if(|at| pair[0] < *at && *at < pair[1]);
                assert!(here.is_some(), "node {node} before {:?}", pair[1]);
            }
            assert_eq!(sent.next(), None);
        }
    }
}

#[test]
fn the_controllers_heartbeat_is_there_as_long_as_drives_watch_it() {
    for rig in runs() {
        let controller = rig.machine.controller.node;
        let beats = rig.sent(CobId::error_control(controller));
        let allowed = rig.machine.controller.heartbeat + rig.machine.cycle;
        let gaps = beats
            .windows(2)
            .map(|pair| pair[1].start.saturating_since(pair[0].start));
        assert!(gaps.max().unwrap() <= allowed);
        let last = beats.last().unwrap().start;
        assert!(rig.syncs().last().unwrap().saturating_since(last) <= allowed);
    }
}

#[test]
fn the_end_goes_in_its_order() {
    for mut rig in runs() {
        let syncs = rig.syncs();
        for (drive, node) in nodes(&rig).collect::<Vec<_>>() {
            let commands = rig.commands(drive);
            let mut words: Vec<u16> = commands.iter().map(|it| it.1).collect();
            words.dedup();
            assert_eq!(
                words,
                [0x00, 0x06, 0x0F, 0x1F, 0x0F, 0x06, 0x00],
                "node {node}"
            );
            let last_command = commands.last().unwrap().0;
            let released = first(&requests(&rig, node), &[0x2B, 0x22, 0x30, 5, 0, 0]);
            let pre_operational = nmt_sent(&rig, nmt::Command::EnterPreOperational, node);
            let order = [
                last_command,
                released,
                pre_operational,
                *syncs.last().unwrap(),
            ];
            assert!(order.is_sorted(), "node {node}: {order:?}");
            assert!(!rig.twin(drive).observe().is_powered);
            assert_eq!(
                rig.twin(drive).observe().nmt_state,
                nmt::State::PreOperational
            );
        }
    }
}

#[test]
fn a_drive_found_enabled_is_switched_off_before_anything_else() {
    let mut rig = Rig::portal("G0 X10\nM2\n");
    rig.step();
    rig.twin(2).disturb(Disturbance::FoundEnabled);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let found = |it: &&Event| matches!(it, Event::FoundEnabled { .. });
    let found: Vec<_> = rig.events.iter().filter(found).collect();
    assert!(
        matches!(found[..], [Event::FoundEnabled { device: 2, .. }]),
        "{found:?}"
    );
    let node = rig.machine.drives[2].node;
    let asked = requests(&rig, node);
    let is_write = |it: &&Transmission| it.frame.data()[0] & 0xE0 == 0x20;
    let disabled = asked.iter().find(is_write).unwrap();
    assert_eq!(disabled.frame.data(), [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0]);
    // Another controller would have sent a SYNC by then.
    assert!(disabled.start.saturating_since(asked[0].end) > Duration::from_millis(1050));
    let resets =
        nodes(&rig).map(|(_, node)| nmt_sent(&rig, nmt::Command::ResetCommunication, node));
    assert!(resets.min().unwrap() > disabled.end);
    // It said so itself before its reset.
    let answers = rig.frames();
    let statusword = |it: &Transmission| {
        it.sender != Sender::Port
            && it.frame.id() == CanId::from(CobId::t_sdo(node))
            && it.frame.data()[1..4] == [0x41, 0x60, 0]
            && it.start > disabled.end
    };
    let answer = answers.iter().find(|it| statusword(it)).unwrap();
    let statusword = u16::from_le_bytes([answer.frame.data()[4], answer.frame.data()[5]]);
    assert_eq!(
        Statusword(statusword).state().map(State::is_powered),
        Some(false)
    );
}

/// Answers that are lost behind its state do not have it forgotten: it is listened, and it is switched off, before any node is reset.
#[test]
fn a_drive_found_enabled_that_answers_no_more_is_not_forgotten() {
    for heard in [false, true] {
        let mut rig = Rig::portal("G0 X10\nM2\n");
        rig.step();
        rig.twin(2).disturb(Disturbance::FoundEnabled);
        let found = |rig: &mut Rig| {
            let found = |it: &Event| matches!(it, Event::FoundEnabled { .. });
            rig.events.iter().any(found)
        };
        rig.run_until(found);
        rig.twin(2).disturb(Disturbance::Mute(true));
        // Longer than all tries take.
        let until = rig.session.timeline().now() + Duration::from_millis(700);
        rig.run_until(|rig| rig.session.timeline().now() >= until);
        rig.twin(2).disturb(Disturbance::Mute(false));
        let commands = |it: &Transmission| nmt::Request::decode(&it.frame).is_some();
        assert_eq!(rig.frames().iter().find(|it| commands(it)), None);
        if heard {
            rig.intrude(0, Frame::new(CobId::SYNC, &[]));
            let second = Fault::Bus(0, BusCause::SecondSync);
            assert_eq!(rig.finish(), End::Fault(second), "{:?}", rig.events);
            assert!(rig.twin(2).observe().is_powered);
            continue;
        }
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let asked = requests(&rig, rig.machine.drives[2].node);
        let is_write = |it: &&Transmission| it.frame.data()[0] & 0xE0 == 0x20;
        let disabled = asked.iter().find(is_write).unwrap();
        assert_eq!(disabled.frame.data(), [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0]);
        let frames = rig.frames();
        let reset = frames.iter().find(|it| commands(it)).unwrap();
        assert!(reset.start > disabled.end);
    }
}

/// Whoever has the drives enabled may be at work: its SYNC comes once in a cycle, of 1 s at most, and may be late. Then it is the drives' controller, and
/// nothing but their states has been read.
#[test]
fn a_drive_that_another_controller_runs_is_left_alone() {
    for after_ms in [3, 40, 700, 1010, 1080] {
        let mut rig = Rig::portal("G0 X10\nM2\n");
        rig.step();
        rig.twin(2).disturb(Disturbance::FoundEnabled);
        let sync = Duration::from_millis(after_ms);
        rig.run_until(|rig| rig.session.timeline().now() >= Instant::ZERO + sync);
        rig.intrude(0, Frame::new(CobId::SYNC, &[]));
        let end = rig.finish();
        let second = Fault::Bus(0, BusCause::SecondSync);
        assert_eq!(end, End::Fault(second), "{after_ms} ms: {:?}", rig.events);
        for (_, node) in nodes(&rig) {
            let asked = requests(&rig, node);
            let reads = |it: &&Transmission| it.frame.data()[0] == 0x40;
            assert_eq!(asked.iter().find(|it| !reads(it)), None, "{after_ms} ms");
        }
        let of_port = |it: &&Transmission| it.sender == Sender::Port;
        let commands = |it: &Transmission| nmt::Request::decode(&it.frame).is_some();
        let frames = rig.frames();
        assert_eq!(frames.iter().filter(of_port).find(|it| commands(it)), None);
        assert!(rig.twin(2).observe().is_powered);
    }
}

/// The same where this controller had commanded its nodes, until a fault: a reset beside the other one's SYNC touches none of them, and
/// so does switching off behind that.
#[test]
fn a_reset_beside_another_controller_leaves_its_nodes_alone() {
    let mut rig = crate::losses::staying_on(&[]);
    rig.run_until(|rig| rig.session.status().state == control::State::Ready);
    rig.intrude(0, Frame::new(CobId::SYNC, &[]));
    rig.run_until(|rig| rig.session.status().state == control::State::Faulted);
    for _ in 0..100 {
        rig.step();
    }
    rig.command(Command::Reset);
    rig.run_until(|rig| rig.session.status().state == control::State::Starting);
    // Without the SYNC of this controller: the other one has enabled it.
    rig.twin(2).disturb(Disturbance::FoundEnabled);
    let before = rig.frames().len();
    // Reset and set up by the other one, they hear its SYNC.
    for _ in 0..20 {
        rig.step();
    }
    rig.intrude(0, Frame::new(CobId::SYNC, &[]));
    rig.run_until(|rig| rig.session.status().state == control::State::Faulted);
    for _ in 0..100 {
        rig.step();
    }
    rig.command(Command::SwitchOff);
    while rig.step() {}
    let of_port = |it: &&Transmission| it.sender == Sender::Port;
    let frames = rig.frames();
    let sent = frames[before..].iter().filter(of_port);
    let touches = |it: &&Transmission| {
        let writes = nodes(&rig).any(|(_, node)| {
            it.frame.id() == CanId::from(CobId::r_sdo(node)) && it.frame.data()[0] != 0x40
        });
        writes
            || nmt::Request::decode(&it.frame).is_some()
            || it.frame.id() == CanId::from(CobId::SYNC)
    };
    let touched: Vec<_> = sent.filter(touches).collect();
    assert!(touched.is_empty(), "{touched:?}");
    assert!(rig.twin(2).observe().is_powered);
}

#[test]
fn what_a_drive_remembers_is_told_and_then_reset() {
    let mut rig = Rig::portal("G0 X10\nM2\n");
    rig.step();
    rig.twin(1)
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let told = |object: &str| {
        rig.events.iter().find_map(|event| match event {
            Event::History {
                device: 1,
                object: of,
                value,
            } if of.to_string() == object => Some(*value),
            _ => None,
        })
    };
    assert_eq!(told("603Fh:0"), Some(0xA320));
    assert_eq!(told("1003h:1").map(|value| value & 0xFFFF), Some(0x8611));
    assert!(told("1001h:0").is_some_and(|register| register & 1 == 1));
}

/// How the portal ends with one more drive on its bus, under a node id that is taken: before any power stage is on.
fn fault_with_a_stranger(id: impl Fn(&Machine) -> NodeId) -> Fault {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    let stranger = Config {
        seed: 7,
        ..Config::new(id(&rig.machine))
    };
    let twin = sim::twin(rig.machine.drives[2].model, &stranger);
    let wire = rig.bus().simulated().unwrap();
    rig.session.timeline().world().attach(wire, twin);
    let fault = rig.finish_with_fault();
    let powers = |it: &(Phase, Instant)| it.0 == Phase::ReadyToSwitchOn;
    assert!(!rig.phases.iter().any(powers), "{:?}", rig.phases);
    fault
}

/// A second drive has the node id of the first.
#[test]
fn two_nodes_with_one_id_are_a_fault_before_power_is_on() {
    let fault = fault_with_a_stranger(|machine| machine.drives[2].node);
    assert!(
        matches!(
            fault,
            Fault::Device(2, DeviceCause::SecondTPdo | DeviceCause::TwoNodes)
        ),
        "{fault:?}"
    );
}

/// A drive that has the controller's own: its heartbeat would have the others run on without their controller.
#[test]
fn a_node_with_the_controllers_id_is_a_fault_before_power_is_on() {
    let fault = fault_with_a_stranger(|machine| machine.controller.node);
    let node = NodeId::new(127).unwrap();
    assert_eq!(fault, Fault::Bus(0, BusCause::SecondController { node }));
}
