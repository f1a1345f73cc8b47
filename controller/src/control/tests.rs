//! What the cycle asks of its drives, by drives that count.

use super::*;
use crate::bench::rig::{Shape, Shuttle};
use crate::run::driver::Driver;
use std::sync::atomic::{AtomicU64, Ordering};
use syncline_canopen::budget::Pdo;
use syncline_drives::model::{
    Address, ClockLock, Drive, DriveStatus, Feedback, Identity, Increments, Io, ModeDisplay, Model,
    OutOfRange, PowerCommand, RemoteNode, Sample, Setpoint, Survey, Write,
};

/// How often all drives were asked, by what.
#[derive(Debug, Default)]
struct Asked {
    checks: AtomicU64,
    encodings: AtomicU64,
}

/// A drive that counts, and leaves the rest to another one.
#[derive(Clone, Debug)]
struct Counting {
    drive: Box<dyn Drive>,
    asked: Arc<Asked>,
}

impl RemoteNode for Counting {
    fn model(&self) -> &'static Model {
        self.drive.model()
    }
    fn node(&self) -> syncline_canopen::NodeId {
        self.drive.node()
    }
    fn identity(&self) -> &[Identity] {
        self.drive.identity()
    }
    fn history(&self) -> &[Address] {
        self.drive.history()
    }
    fn setup(&self) -> &[Write] {
        self.drive.setup()
    }
    fn read_back(&self) -> &[Write] {
        self.drive.read_back()
    }
    fn agrees(&self, written: &Write, read: &[u8]) -> bool {
        self.drive.agrees(written, read)
    }
    fn clock_lock(&self) -> Option<ClockLock> {
        self.drive.clock_lock()
    }
    fn release(&self) -> &[Write] {
        self.drive.release()
    }
    fn t_pdos(&self) -> &[Pdo] {
        self.drive.t_pdos()
    }
    fn r_pdos(&self) -> &[Pdo] {
        self.drive.r_pdos()
    }
    fn t_pdo_response(&self) -> Duration {
        self.drive.t_pdo_response()
    }
    fn sdo_response(&self) -> Duration {
        self.drive.sdo_response()
    }
    fn io(&self) -> Option<&dyn Io> {
        self.drive.io()
    }
    fn vendor_error(&self, bytes: [u8; 5]) -> Option<String> {
        self.drive.vendor_error(bytes)
    }
}

impl Feedback for Counting {
    fn sample(&self, t_pdo: usize, data: &[u8]) -> Option<Sample> {
        self.drive.sample(t_pdo, data)
    }
}

impl Drive for Counting {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }
    fn survey(&self) -> Survey {
        self.drive.survey()
    }
    fn mode(&self) -> ModeDisplay {
        self.drive.mode()
    }
    fn ends_mode(&self) -> bool {
        self.drive.ends_mode()
    }
    fn latency(&self) -> u32 {
        self.drive.latency()
    }
    fn status(&mut self, t_pdo: usize, data: &[u8]) -> Option<DriveStatus> {
        self.drive.status(t_pdo, data)
    }
    fn check(&self, setpoint: Setpoint) -> Result<(), OutOfRange> {
        self.asked.checks.fetch_add(1, Ordering::Relaxed);
        self.drive.check(setpoint)
    }
    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        self.asked.encodings.fetch_add(1, Ordering::Relaxed);
        self.drive.encode(command, setpoint, frames);
    }
    fn in_motion(&self, position: Increments) -> Result<Vec<Frame>, OutOfRange> {
        self.drive.in_motion(position)
    }
}

const DRIVES: usize = 3;

/// A machine whose drives count, ready for its program.
fn counting_machine() -> (Driver<9, Box<dyn crate::port::Port + Send>>, Arc<Asked>) {
    let shape = Shape::on_fewest_buses(DRIVES, Duration::from_millis(2)).unwrap();
    let asked = Arc::new(Asked::default());
    let mut layout = shape.layout();
    for drive in &mut layout.drives {
        drive.device = Box::new(Counting {
            drive: drive.device.clone(),
            asked: Arc::clone(&asked),
        });
    }
    let (world, ports) = shape.simulated();
    let mut machine = Driver::new(Arc::new(layout), world, ports, Instant::ZERO);
    while machine.controller.ready().is_none() {
        let wake = machine.controller.next_wake().unwrap();
        machine.step(wake.at()).unwrap();
    }
    (machine, asked)
}

/// A setpoint is converted where it is checked.
#[test]
fn a_setpoint_is_converted_once_and_a_drive_encoded_once_a_cycle() {
    let (mut machine, asked) = counting_machine();
    let mut plan = Shuttle::<9>::new(DRIVES);
    for cycle in 0..200 {
        while machine.controller.room() > 0 {
            machine.controller.accept(plan.instruction());
        }
        let before = [&asked.checks, &asked.encodings].map(|count| count.load(Ordering::Relaxed));
        for _ in 0..2 {
            let wake = machine.controller.next_wake().unwrap();
            machine.step(wake.at()).unwrap();
        }
        let after = [&asked.checks, &asked.encodings].map(|count| count.load(Ordering::Relaxed));
        let once = DRIVES as u64;
        assert_eq!(
            [after[0] - before[0], after[1] - before[1]],
            [once, once],
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
