//! What the cycle asks of its drives, by drives that count.

use super::*;
use crate::bench::rig::{Shape, Shuttle};
use crate::run::driver::Driver;
use proptest::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use syncline_canopen::NodeId;
use syncline_canopen::budget::{Direction, Pdo};
use syncline_drives::model::{
    Device, Drive, DriveStatus, Feedback, Increments, Io, ModeDisplay, NodeSpec, OutOfRange,
    PowerCommand, RemoteNode, Sample, Setpoint, Survey,
};

/// How often all drives were asked, by what.
#[derive(Debug, Default)]
struct Asked {
    checks: AtomicU64,
    encodings: AtomicU64,
}

/// A drive that counts, and leaves the rest to another one.
#[derive(Clone, Debug)]
struct Probe {
    drive: Box<dyn Drive>,
    asked: Arc<Asked>,
    spec: NodeSpec,
    ends_mode: bool,
}

impl Probe {
    fn new(drive: Box<dyn Drive>, asked: &Arc<Asked>) -> Self {
        Self {
            asked: Arc::clone(asked),
            spec: drive.spec().clone(),
            ends_mode: drive.ends_mode(),
            drive,
        }
    }

    /// As a drive with a PDO each for words and positions, whose mode has no end.
    fn in_two_pdos(drive: Box<dyn Drive>) -> Self {
        let node = drive.spec().node;
        let pdo = |direction, cob_id, bytes| Pdo {
            direction,
            cob_id,
            bytes,
        };
        let mut probe = Self::new(drive, &Arc::default());
        probe.spec.t_pdos = vec![
            pdo(Direction::Transmit, CobId::t_pdo(1, node), 2),
            pdo(Direction::Transmit, CobId::t_pdo(3, node), 4),
        ];
        probe.spec.r_pdos = vec![
            pdo(Direction::Receive, CobId::r_pdo(1, node), 2),
            pdo(Direction::Receive, CobId::r_pdo(3, node), 4),
        ];
        probe.ends_mode = false;
        probe
    }
}

fn as_drive(device: &Device) -> Box<dyn Drive> {
    device.drive().expect("a drive").clone_box()
}

impl RemoteNode for Probe {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }
    fn vendor_error(&self, bytes: [u8; 5]) -> Option<String> {
        self.drive.vendor_error(bytes)
    }
}

impl Feedback for Probe {
    fn sample(&self, t_pdo: usize, data: &[u8]) -> Option<Sample> {
        match self.spec.t_pdos.len() {
            1 => self.drive.sample(t_pdo, data),
            _ if t_pdo == 1 => self.drive.sample(0, &[&[0, 0], data].concat()),
            _ => None,
        }
    }
    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        self.drive.in_motion(position)
    }
}

impl Drive for Probe {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }
    fn survey(&self) -> Option<Survey> {
        self.drive.survey()
    }
    fn mode(&self) -> Option<ModeDisplay> {
        self.drive.mode()
    }
    fn ends_mode(&self) -> bool {
        self.ends_mode
    }
    fn latency(&self) -> f64 {
        self.drive.latency()
    }
    fn io(&self) -> Option<&dyn Io> {
        self.drive.io()
    }
    fn status(&mut self, t_pdo: usize, data: &[u8]) -> Option<DriveStatus> {
        match t_pdo {
            0 => self.drive.status(0, data),
            _ => None,
        }
    }
    fn check(&self, setpoint: Setpoint) -> Result<(), OutOfRange> {
        self.asked.checks.fetch_add(1, Ordering::Relaxed);
        self.drive.check(setpoint)
    }
    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        self.asked.encodings.fetch_add(1, Ordering::Relaxed);
        if let [words, positions] = frames {
            let mut whole = [*words];
            self.drive.encode(command, setpoint, &mut whole);
            let (word, position) = whole[0].data().split_at(2);
            *words = Frame::new(self.spec.r_pdos[0].cob_id, word);
            *positions = Frame::new(self.spec.r_pdos[1].cob_id, position);
        } else {
            self.drive.encode(command, setpoint, frames);
        }
    }
}

const DRIVES: usize = 3;

/// A machine whose drives count, ready for its program.
fn counting_machine() -> (Driver<9, Box<dyn crate::port::Port + Send>>, Arc<Asked>) {
    let shape = Shape::on_fewest_buses(DRIVES, Duration::from_millis(2)).unwrap();
    let asked = Arc::new(Asked::default());
    let mut layout = shape.layout();
    for drive in &mut layout.devices {
        drive.device = Device::Drive(Box::new(Probe::new(as_drive(&drive.device), &asked)));
    }
    let (world, ports) = shape.simulated();
    let mut machine = Driver::new(Arc::new(layout), world, ports, Instant::ZERO);
    while machine.controller.ready().is_none() {
        let wake = machine.controller.next_wake().unwrap();
        machine.step(wake.at()).unwrap();
    }
    (machine, asked)
}

/// A setpoint is converted where it is checked, an actual position where it is told.
#[test]
fn positions_are_converted_once_and_a_drive_encoded_once_a_cycle() {
    let (mut machine, asked) = counting_machine();
    let mut plan = Shuttle::<9>::new(DRIVES);
    for cycle in 0..200 {
        while machine.controller.room() > 0 {
            machine.controller.accept(plan.instruction());
        }
        let actual = |machine: &Driver<9, Box<dyn crate::port::Port + Send>>| -> u64 {
            let nodes = machine.controller.nodes.iter();
            nodes.map(DeviceNode::conversions).sum()
        };
        let converted = actual(&machine);
        let before = [&asked.checks, &asked.encodings].map(|count| count.load(Ordering::Relaxed));
        for _ in 0..2 {
            let wake = machine.controller.next_wake().unwrap();
            machine.step(wake.at()).unwrap();
        }
        let after = [&asked.checks, &asked.encodings].map(|count| count.load(Ordering::Relaxed));
        let once = DRIVES as u64;
        assert_eq!(
            [
                after[0] - before[0],
                after[1] - before[1],
                actual(&machine) - converted
            ],
            [once; 3],
            "cycle {cycle}"
        );
    }
    assert_eq!(machine.controller.end(), None);
}

/// What changes from frame to frame must not change by a rehearsal, or by a cycle whose frames do
/// not leave.
#[test]
fn nothing_is_encoded_that_is_not_sent() {
    let (mut machine, asked) = counting_machine();
    let encodings = || asked.encodings.load(Ordering::Relaxed);
    let sync = machine.controller.next_wake().unwrap();
    machine.step(sync.at()).unwrap();
    let setpoint = machine.controller.next_wake().unwrap();
    let before = encodings();
    machine.controller.rehearse();
    assert_eq!(encodings(), before, "rehearsed");
    // Too late for the burst to leave before the next SYNC.
    machine.step(sync.at() + Duration::from_millis(2)).unwrap();
    assert!(setpoint.at() < sync.at() + Duration::from_millis(2));
    assert_eq!(encodings(), before, "late");
    assert_eq!(machine.controller.late_setpoints(), 1);
}

/// The layout of a machine whose drives have two PDOs each way.
fn two_pdos_each() -> Arc<Layout> {
    let shape = Shape::on_fewest_buses(2, Duration::from_millis(2)).unwrap();
    let mut layout = shape.layout();
    for drive in &mut layout.devices {
        drive.device = Device::Drive(Box::new(Probe::in_two_pdos(as_drive(&drive.device))));
    }
    Arc::new(layout)
}

#[test]
fn a_drive_has_answered_when_all_its_t_pdos_have() {
    let layout = two_pdos_each();
    let mut node = DeviceNode::new(0, &layout);
    let id = layout.devices[0].device.spec().node;
    let (word, position) = (CobId::t_pdo(1, id), CobId::t_pdo(3, id));
    let sync = Instant::ZERO;
    let take = |node: &mut DeviceNode, id, data: &[u8]| {
        node.receive(sync, &Frame::new(id, data), Some(sync), &mut |_| ())
    };
    node.on_sync();
    assert_eq!(take(&mut node, word, &[0x37, 0x02]), Ok(()));
    assert_eq!((node.is_sampled(), node.age()), (false, 2));
    assert_eq!(take(&mut node, position, &[7, 0, 0]), Ok(()), "cut short");
    assert_eq!((node.is_sampled(), node.age()), (false, 2));
    assert_eq!(take(&mut node, position, &[7, 0, 0, 0]), Ok(()));
    assert_eq!((node.is_sampled(), node.age()), (true, 0));
    assert_eq!(node.actual(), Increments::new(7));
    assert!(node.has_reached(fault::AwaitedState::Enabled));
    // One of two is a missing answer.
    node.on_sync();
    assert_eq!(take(&mut node, position, &[8, 0, 0, 0]), Ok(()));
    assert_eq!((node.actual(), node.age()), (Increments::new(8), 1));
    // That may come late, behind the next SYNC. One of them twice to a SYNC, and again to the next: another device has
    // its node id.
    node.on_sync();
    for _ in 0..2 {
        assert_eq!(take(&mut node, word, &[0x37, 0x02]), Ok(()));
    }
    let twice = |node: &mut DeviceNode| {
        node.on_sync();
        [(); 2].map(|()| {
            node.receive(
                sync,
                &Frame::new(word, &[0x37, 0x02]),
                Some(sync),
                &mut |_| (),
            )
        })
    };
    assert_eq!(twice(&mut node), [Ok(()), Ok(())]);
    assert_eq!(
        twice(&mut node)[1],
        Err(Fault::Device(0, fault::DeviceCause::TwoNodes))
    );
}

/// What comes to a SYNC of a drive whose T_PDO counts up.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    InTime,
    /// Behind the next SYNC.
    Late,
    Lost,
    /// As CAN itself may hand it over.
    Twice,
}

fn answers() -> impl Strategy<Value = Vec<Answer>> {
    use Answer::{InTime, Late, Lost, Twice};
    let answer = prop_oneof![
        4 => Just(InTime),
        2 => Just(Late),
        1 => Just(Lost),
        1 => Just(Twice),
    ];
    prop::collection::vec(answer, 1..40).prop_map(|mut answers| {
        for at in 1..answers.len() {
            let before = &answers[at.saturating_sub(2)..at];
            let again = match answers[at] {
                Late => before == [Late; 2],
                Twice => before.ends_with(&[Twice]),
                InTime | Lost => false,
            };
            if again {
                answers[at] = InTime;
            }
        }
        answers
    })
}

/// Takes the T_PDO that tells this position as an answer to the last SYNC.
fn take(node: &mut DeviceNode, position: i32) -> Result<(), Fault> {
    // The first drive of a layout of two PDOs each.
    let id = NodeId::new(1).unwrap();
    let frame = Frame::new(CobId::t_pdo(3, id), &position.to_le_bytes());
    node.receive(Instant::ZERO, &frame, Some(Instant::ZERO), &mut |_| ())
}

proptest! {
    /// Losses, late answers and a frame that came twice are no second device; one that answers besides is, at once, and
    /// what it says is not taken.
    #[test]
    fn a_second_answer_is_a_fault_and_not_taken(answers in answers(), more in 0..3_usize) {
        let layout = two_pdos_each();
        let mut node = DeviceNode::new(0, &layout);
        let mut late = None;
        for (position, &answer) in (1..).zip(&answers) {
            node.on_sync();
            let times = match answer {
                Answer::InTime => 1,
                Answer::Twice => 2,
                Answer::Late | Answer::Lost => 0,
            };
            let came = late.take().into_iter().chain(std::iter::repeat_n(position, times));
            for position in came {
                prop_assert_eq!(take(&mut node, position), Ok(()));
                prop_assert_eq!(node.actual(), Increments::new(position.into()));
            }
            late = (answer == Answer::Late).then_some(position);
        }
        // Nothing is late any more.
        for position in 1000..1003 + more as i32 {
            node.on_sync();
            prop_assert_eq!(late.take().map_or(Ok(()), |late| take(&mut node, late)), Ok(()));
            prop_assert_eq!(take(&mut node, position), Ok(()));
        }
        let second = take(&mut node, -1000);
        prop_assert_eq!(second, Err(Fault::Device(0, fault::DeviceCause::SecondTPdo)));
        prop_assert_eq!(node.actual(), Increments::new(1002 + more as i64));
    }
}

proptest! {
    /// However many T_PDOs come to each SYNC, one that is taken answers a SYNC that nothing else has answered: what came late
    /// is owed no more.
    #[test]
    fn no_more_is_taken_than_was_asked_for(counts in prop::collection::vec(0..5_usize, 1..30)) {
        let layout = two_pdos_each();
        let mut node = DeviceNode::new(0, &layout);
        let mut positions = 1..;
        let mut taken = 0;
        'run: for (syncs, count) in (1..).zip(counts) {
            node.on_sync();
            for position in positions.by_ref().take(count) {
                if take(&mut node, position).is_err() {
                    break 'run;
                }
                taken += u32::from(node.actual() == Increments::new(position.into()));
            }
            prop_assert!(taken <= syncs, "{taken} to {syncs} SYNCs");
        }
    }
}

/// One that answers behind the next SYNC more than twice and then catches up cannot be told from two devices: what it was
/// taken for in between is not known, so the machine stops.
#[test]
fn a_drive_that_catches_up_after_three_late_answers_is_stopped() {
    for late in 1..=4 {
        let layout = two_pdos_each();
        let mut node = DeviceNode::new(0, &layout);
        node.on_sync();
        assert_eq!(take(&mut node, 0), Ok(()));
        // To one SYNC nothing comes, and to each of the others the answer to the one before.
        node.on_sync();
        for position in 1..=late {
            node.on_sync();
            assert_eq!(take(&mut node, position), Ok(()));
        }
        let second = fault::DeviceCause::SecondTPdo;
        let expected = if late < 3 {
            Ok(())
        } else {
            Err(Fault::Device(0, second))
        };
        assert_eq!(take(&mut node, late + 1), expected, "{late}");
    }
}

#[test]
fn a_burst_leaves_by_identifiers_whichever_drive_they_are_of() {
    let layout = two_pdos_each();
    let mut controller = Controller::<9>::new(Arc::clone(&layout), Instant::ZERO);
    for node in &mut controller.nodes {
        node.power = PowerCommand::Enable;
        node.encode();
    }
    let burst = controller.bursts[0].iter();
    let frames = burst.map(|&(drive, r_pdo)| controller.nodes[drive].r_pdos()[r_pdo]);
    let frames: Vec<String> = frames.map(|frame| format!("{frame:?}")).collect();
    assert_eq!(
        frames,
        ["201#0F00", "202#0F00", "401#00000000", "402#00000000"]
    );
}

#[test]
fn a_mode_without_an_end_is_not_waited_for() {
    use fault::AwaitedState::{ModeEnded, ModeStarted};
    let running = |layout: &Arc<Layout>, t_pdo: CobId, data: &[u8]| {
        let mut node = DeviceNode::new(0, layout);
        let frame = Frame::new(t_pdo, data);
        let taken = node.receive(Instant::ZERO, &frame, None, &mut |_| ());
        assert_eq!(taken, Ok(()));
        [ModeStarted, ModeEnded].map(|awaited| node.has_reached(awaited))
    };
    let layout = two_pdos_each();
    let id = layout.devices[0].device.spec().node;
    let word = [0x37, 0x12];
    assert_eq!(running(&layout, CobId::t_pdo(1, id), &word), [true, true]);
    let shape = Shape::on_fewest_buses(1, Duration::from_millis(2)).unwrap();
    let layout = Arc::new(shape.layout());
    let data = [0x37, 0x12, 0, 0, 0, 0];
    assert_eq!(running(&layout, CobId::t_pdo(2, id), &data), [true, false]);
}

/// A drive that follows its setpoints as soon as it is enabled holds its place by the last one
/// before; one whose mode is started later goes along until then.
#[test]
fn a_drive_that_follows_once_enabled_keeps_its_last_setpoint() {
    let held = |layout: &Arc<Layout>, t_pdo: CobId, data: fn(u8) -> Vec<u8>| {
        let mut node = DeviceNode::new(0, layout);
        [
            (PowerCommand::Prepare, 7),
            (PowerCommand::Enable, 8),
            (PowerCommand::Enable, 9),
            (PowerCommand::Prepare, 10),
        ]
        .map(|(power, position)| {
            node.power = power;
            let frame = Frame::new(t_pdo, &data(position));
            let taken = node.receive(Instant::ZERO, &frame, None, &mut |_| ());
            assert_eq!(taken, Ok(()));
            node.hold();
            node.setpoint.position.get()
        })
    };
    let layout = two_pdos_each();
    let position = CobId::t_pdo(3, layout.devices[0].device.spec().node);
    let at = |position| vec![position, 0, 0, 0];
    assert_eq!(held(&layout, position, at), [7, 7, 7, 10]);
    let shape = Shape::on_fewest_buses(1, Duration::from_millis(2)).unwrap();
    let layout = Arc::new(shape.layout());
    let position = CobId::t_pdo(2, layout.devices[0].device.spec().node);
    let at = |position| vec![0x37, 0x02, position, 0, 0, 0];
    assert_eq!(held(&layout, position, at), [7, 8, 9, 10]);
}

/// However many faults are known already, what the table has for another one is done.
#[test]
fn a_fault_behind_the_last_one_that_is_kept_has_its_reaction() {
    let (mut machine, _) = counting_machine();
    let controller = &mut machine.controller;
    controller.stay_on();
    for bus in 0..40 {
        controller.fail(Fault::Bus(10 + bus, BusCause::ErrorPassive));
        assert_eq!(controller.phase(), Phase::Stop);
    }
    controller.fail(Fault::NotEnabled { input: 0 });
    assert_eq!(controller.phase(), Phase::QuickStop);
}

/// What is found wrong with a setpoint shows in the burst that it was made for: drives are quick-stopped, and outputs have
/// their safe values.
#[test]
fn what_a_setpoint_shows_has_its_reaction_in_the_same_burst() {
    let (mut machine, _) = counting_machine();
    let controller = &mut machine.controller;
    let before = controller.executor.setpoint().position;
    // A defect of the planner: the plan goes on elsewhere.
    controller.executor.restart(before.map(|at| at + 50.0));
    while !machine.controller.is_faulty() {
        let wake = machine.controller.next_wake().unwrap();
        machine.step(wake.at()).unwrap();
    }
    let controller = &machine.controller;
    let [Fault::Axis(_, fault::AxisCause::SetpointGuard { .. })] = controller.faults[..] else {
        panic!("{:?}", controller.faults);
    };
    for node in &controller.nodes {
        let [r_pdo] = node.r_pdos() else {
            panic!("{:?}", node.r_pdos());
        };
        assert_eq!(r_pdo.data()[..2], [0x0B, 0x00]);
    }
}
