//! What a node is asked by SDO, step after step: survey, identity, set-up, release.

use super::event::Event;
use super::fault::{DeviceCause, DeviceIndex, Fault};
use super::layout::Layout;
use std::collections::VecDeque;
use std::sync::Arc;
use syncline_canopen::sdo::{self, AbortCode, Failure, Reason};
use syncline_canopen::time::Duration;
use syncline_canopen::{Frame, Instant, Transmit};
use syncline_drives::model::{
    Address, Capture, ClockLock, Identity, Increments, Marks, ModeDisplay, Survey, Write,
};

/// What an upload brought.
struct Reading {
    bytes: [u8; LONGEST],
    len: usize,
}

impl Reading {
    fn of(outcome: Result<&[u8], Failure>) -> Result<Self, Failure> {
        outcome.map(|data| {
            let len = data.len().min(LONGEST);
            let mut bytes = [0; LONGEST];
            bytes[..len].copy_from_slice(&data[..len]);
            Self { bytes, len }
        })
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }

    /// The first four bytes, little-endian.
    fn number(&self) -> u32 {
        let [a, b, c, d, ..] = self.bytes;
        u32::from_le_bytes([a, b, c, d])
    }
}

/// One step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// Reads the status of a drive in an unknown state, and notes whether its power stage is on.
    Survey(Survey),
    /// Reads the status until the power stage is off.
    AwaitDisabled(Survey),
    /// Reads an object for the log.
    History(Address),
    /// Reads an object until there is an answer, whatever it is.
    AwaitAnswer(Address),
    /// Reads an object that must be the model's.
    Identity(Identity),
    /// Reads one of the [`Marks`], at this place; a refusal says that there is none.
    Mark(usize, Address),
    /// Writes, where the object reads otherwise.
    Ensure(Write),
    /// Writes; a refusal is a fault.
    Write(Write),
    /// Reads what was written; a refusal to be read is an event, another value a fault.
    ReadBack(Write),
    /// Reads a status until the drive's clock follows SYNC.
    AwaitLock(ClockLock),
    /// Reads which operating mode runs.
    Mode(ModeDisplay),
    /// Writes on the way out; a refusal is an event.
    Release(Write),
    /// Writes once, whatever the answer is.
    Command(Write),
    /// Reads whether an edge was captured, and goes on with where, or with another one that may have been.
    Captured(&'static Capture, Option<&'static Capture>),
    /// Reads where an edge was captured.
    CapturedAt(&'static Capture),
    /// Reads an object, and notes at this place what it says.
    Note(usize, Address),
    /// Reads an object of a device that is asked all the time; whoever waits for an answer knows how long.
    Poll(Address),
}

impl Step {
    fn address(&self) -> Address {
        match self {
            Self::Survey(survey) | Self::AwaitDisabled(survey) => survey.address,
            Self::History(address)
            | Self::AwaitAnswer(address)
            | Self::Mark(_, address)
            | Self::Note(_, address)
            | Self::Poll(address) => *address,
            Self::Identity(identity) => identity.address,
            Self::Write(write)
            | Self::Ensure(write)
            | Self::ReadBack(write)
            | Self::Release(write)
            | Self::Command(write) => write.address,
            Self::AwaitLock(lock) => lock.address,
            Self::Mode(display) => display.address,
            Self::Captured(capture, _) => capture.status,
            Self::CapturedAt(capture) => capture.position,
        }
    }

    fn write(&self) -> Option<&Write> {
        match self {
            Self::Write(write) | Self::Release(write) | Self::Command(write) => Some(write),
            _ => None,
        }
    }

    /// What to do where it cannot be read.
    fn remedy(&self, code: AbortCode) -> &'static str {
        let other = "check that the device is the model of the machine file";
        match (self, code) {
            (Self::Identity(it), AbortCode::UnknownObject) => it.if_absent.unwrap_or(other),
            _ => other,
        }
    }

    /// Whether a drive that says nothing may be passed over.
    fn may_fail(&self) -> bool {
        matches!(self, Self::Survey(_) | Self::History(_) | Self::Release(_))
    }
}

/// Takes the steps of one node over its SDO client, one request outstanding.
#[derive(Clone, Debug)]
pub(super) struct SdoSequence {
    layout: Arc<Layout>,
    device: DeviceIndex,
    client: sdo::Client,
    steps: VecDeque<Step>,
    /// Requests sent for the first step without an answer.
    tries: u32,
    /// When the polling of the first step gives up.
    give_up: Option<Instant>,
    /// The device has shown to be the configured model.
    identified: bool,
    /// The answer under way is to a step that was cleared.
    stale: bool,
    /// Where the edge was that was asked for last, if one was captured.
    captured: Option<Increments>,
    /// What the last [`Step::Mark`]s read, by their places.
    marks: Marks<u32>,
    /// What the last [`Step::Note`]s read, by their places.
    noted: [u32; NOTES],
    /// What the last [`Step::Poll`] read, and where.
    polled: Option<(Address, u32)>,
    /// A command got no answer.
    unanswered: bool,
    /// The drive was found with power, and is not told yet to switch it off.
    found_on: bool,
}

/// Places for what is noted.
const NOTES: usize = 2;

/// The longest object that a sequence reads, in bytes.
const LONGEST: usize = 8;

impl SdoSequence {
    pub(super) fn new(device: DeviceIndex, layout: &Arc<Layout>) -> Self {
        let node = layout.devices[device].device.spec().node;
        Self {
            layout: Arc::clone(layout),
            device,
            client: sdo::Client::new(node, layout.sdo_timeout, LONGEST),
            steps: VecDeque::with_capacity(128),
            tries: 0,
            give_up: None,
            identified: false,
            stale: false,
            captured: None,
            marks: [None; 2],
            noted: [0; NOTES],
            polled: None,
            unanswered: false,
            found_on: false,
        }
    }

    /// Whether the drive was found with power.
    pub(super) fn is_found_on(&self) -> bool {
        self.found_on
    }

    /// The same, and that it is told to switch it off now.
    pub(super) fn take_found_on(&mut self) -> bool {
        std::mem::take(&mut self.found_on)
    }

    /// Asks for the edge that was captured, or else for the `other` one.
    pub(super) fn ask_captured(
        &mut self,
        capture: Option<&'static Capture>,
        other: Option<&'static Capture>,
    ) {
        let ask = capture.map(|capture| Step::Captured(capture, other));
        self.extend(ask);
    }

    /// Where the edge was that was asked for last, if one was captured.
    pub(super) fn captured(&self) -> Option<Increments> {
        self.captured
    }

    /// What tells the device from another of its model, as it was read last.
    pub(super) fn marks(&self) -> Marks<u32> {
        self.marks
    }

    /// What was noted last, by its places.
    pub(super) fn noted(&self) -> [u32; NOTES] {
        self.noted
    }

    /// Whether the device has shown to be the configured model.
    pub(super) fn has_identified(&self) -> bool {
        self.identified
    }

    /// Adds steps behind those that are left.
    pub(super) fn extend(&mut self, steps: impl IntoIterator<Item = Step>) {
        self.steps.extend(steps);
    }

    /// Writes before all steps that are left, whatever the device answers, and in place of what the same object was to be written
    /// with before.
    pub(super) fn command(&mut self, write: Write) {
        let asked = self.forget(write);
        self.steps.insert(asked, Step::Command(write));
    }

    /// The same, behind what else is commanded.
    pub(super) fn command_behind(&mut self, write: Write) {
        let asked = self.forget(write);
        let behind = self.steps.iter().skip(asked);
        let others = behind.take_while(|step| matches!(step, Step::Command(_)));
        let place = asked + others.count();
        self.steps.insert(place, Step::Command(write));
    }

    /// Forgets what an object was to be written with that has not been asked for; the first place behind what has.
    fn forget(&mut self, write: Write) -> usize {
        let is_asked = self.client.is_busy() && !self.stale;
        let asked = usize::from(is_asked).min(self.steps.len());
        let same = |step: &Step| matches!(step, Step::Command(it) if it.address == write.address);
        while let Some(place) = self.steps.iter().skip(asked).position(same) {
            self.steps.remove(asked + place);
        }
        asked
    }

    /// Whether a command got no answer since the last call.
    pub(super) fn take_unanswered(&mut self) -> bool {
        std::mem::take(&mut self.unanswered)
    }

    /// Adds the step that looks whether the device has power.
    pub(super) fn survey(&mut self, survey: Survey) {
        self.found_on = false;
        self.steps.push_back(Step::Survey(survey));
    }

    /// Forgets the steps that are left; an answer under way is awaited and dropped.
    pub(super) fn clear(&mut self) {
        self.steps.clear();
        self.tries = 0;
        self.give_up = None;
        self.unanswered = false;
        self.stale = self.client.is_busy();
    }

    /// Whether nothing is left to do but to poll.
    pub(super) fn is_done(&self) -> bool {
        match self.steps.front() {
            Some(step) => matches!(step, Step::Poll(_)) && self.steps.len() == 1,
            None => !self.client.is_busy(),
        }
    }

    /// Polls an object once, unless there is something else to do; whether it does.
    pub(super) fn poll_object(&mut self, address: Address) -> bool {
        let is_free = self.steps.is_empty() && !self.client.is_busy();
        if is_free {
            self.steps.push_back(Step::Poll(address));
        }
        is_free
    }

    /// What was polled since the last call.
    pub(super) fn take_polled(&mut self) -> Option<(Address, u32)> {
        self.polled.take()
    }

    /// Whether the next call of [`SdoSequence::advance`] sends a request.
    pub(super) fn wants_to_send(&self) -> bool {
        !self.steps.is_empty() && !self.client.is_busy()
    }

    /// Sends the next request if none is outstanding.
    pub(super) fn advance(&mut self, now: Instant, tx: &mut impl Transmit) {
        let Some(step) = self.steps.front() else {
            return;
        };
        let sent = match step.write() {
            Some(write) => self
                .client
                .download(now, write.address, write.data.bytes(), tx),
            None => self.client.upload(now, step.address(), tx),
        };
        self.tries += u32::from(sent.is_ok());
    }

    /// Takes an answer.
    pub(super) fn receive(
        &mut self,
        now: Instant,
        frame: &Frame,
        tx: &mut impl Transmit,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        let outcome = self.client.on_frame(now, frame, tx).map(Reading::of);
        outcome.map_or(Ok(()), |outcome| self.conclude(now, outcome, events))
    }

    /// Looks for a time-out.
    pub(super) fn poll(
        &mut self,
        now: Instant,
        tx: &mut impl Transmit,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        let outcome = self.client.poll(now, tx).map(Err);
        outcome.map_or(Ok(()), |outcome| self.conclude(now, outcome, events))
    }

    /// What an answer, or none, means for the first step.
    fn conclude(
        &mut self,
        now: Instant,
        outcome: Result<Reading, Failure>,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        if std::mem::take(&mut self.stale) {
            return Ok(());
        }
        let Some(step) = self.steps.front().copied() else {
            return Ok(());
        };
        match outcome {
            Ok(reading) => self.answered(now, step, &reading, events),
            Err(failure) => self.failed(step, failure, events),
        }
    }

    /// What it means that the first step got no answer, or a refusal.
    fn failed(
        &mut self,
        step: Step,
        failure: Failure,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        let device = self.device;
        let object = step.address();
        let fault = |cause| Fault::Device(device, cause);
        match failure.reason {
            // Whoever waits for it knows how long.
            Reason::TimedOut if matches!(step, Step::AwaitAnswer(_)) => self.tries = 0,
            Reason::TimedOut if matches!(step, Step::Poll(_)) => self.next(),
            Reason::TimedOut if matches!(step, Step::Command(_)) => {
                self.unanswered = true;
                if self.tries > self.layout.sdo_retries {
                    self.next();
                }
            }
            Reason::Refused(_) | Reason::GivenUp(_) if matches!(step, Step::AwaitAnswer(_)) => {
                self.next();
            }
            Reason::Refused(AbortCode::UnknownObject | AbortCode::UnknownSubindex)
                if matches!(step, Step::Mark(..)) =>
            {
                self.mark(step, None);
            }
            Reason::TimedOut if self.tries <= self.layout.sdo_retries => {}
            Reason::TimedOut if step.may_fail() => {
                events(Event::Silent { device });
                self.clear();
            }
            Reason::TimedOut => return Err(fault(DeviceCause::SdoTimeout { object })),
            Reason::Refused(code) | Reason::GivenUp(code) => {
                if !step.may_fail() && !matches!(step, Step::ReadBack(_) | Step::Command(_)) {
                    return Err(fault(match (failure.reason, step.write()) {
                        (Reason::GivenUp(code), _) => DeviceCause::WrongAnswer { object, code },
                        (_, Some(write)) => DeviceCause::WriteAborted {
                            object,
                            value: write.data.bits(),
                            code,
                        },
                        (_, None) => DeviceCause::ReadAborted {
                            object,
                            code,
                            remedy: step.remedy(code),
                        },
                    }));
                }
                events(Event::Refused {
                    device,
                    object,
                    code,
                });
                self.next();
            }
        }
        Ok(())
    }

    /// What an answer means for the first step.
    fn answered(
        &mut self,
        now: Instant,
        step: Step,
        reading: &Reading,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        let device = self.device;
        let object = step.address();
        let fault = |cause| Fault::Device(device, cause);
        let value = reading.number();
        match step {
            Step::Survey(survey) => {
                let status = (survey.status)(value);
                self.next();
                if status.power.may_be_on() {
                    let word = status.word;
                    events(Event::FoundEnabled { device, word });
                    self.found_on = true;
                }
            }
            Step::AwaitDisabled(survey) => {
                let status = (survey.status)(value);
                if !status.power.may_be_on() {
                    self.next();
                } else if self.out_of_patience(now, self.layout.state_timeout) {
                    let word = status.word;
                    return Err(fault(DeviceCause::StaysEnabled { word }));
                }
            }
            Step::History(object) => {
                events(Event::History {
                    device,
                    object,
                    value,
                });
                self.next();
            }
            Step::Identity(identity) if value & identity.mask != identity.value => {
                return Err(fault(DeviceCause::WrongIdentity {
                    object,
                    name: identity.name,
                    expected: identity.value,
                    found: value,
                }));
            }
            Step::Ensure(write) => self.ensure(write, reading, events),
            Step::ReadBack(write)
                if !(self.layout.devices[device].device.spec()).agrees(&write, reading.bytes()) =>
            {
                return Err(fault(DeviceCause::ReadBack {
                    object,
                    expected: write.data.bits(),
                    found: value,
                }));
            }
            Step::AwaitLock(lock) => {
                if value == lock.locked {
                    self.next();
                } else if self.out_of_patience(now, self.layout.lock_timeout) {
                    return Err(fault(DeviceCause::NoSyncLock {
                        status: value,
                        assumption: lock.assumption,
                    }));
                }
            }
            Step::Mode(display) if value as i8 != display.mode => {
                return Err(fault(DeviceCause::WrongMode {
                    object,
                    expected: display.mode,
                    found: value as i8,
                }));
            }
            Step::Captured(..) | Step::CapturedAt(_) => self.take_captured(step, value),
            Step::Identity(_) => {
                self.next();
                self.identified = !matches!(self.steps.front(), Some(Step::Identity(_)));
            }
            Step::Mark(..) => self.mark(step, Some(value)),
            Step::Note(place, _) => {
                self.noted[place] = value;
                self.next();
            }
            Step::Poll(_) => {
                self.polled = Some((object, value));
                self.next();
            }
            Step::AwaitAnswer(_)
            | Step::Write(_)
            | Step::ReadBack(_)
            | Step::Mode(_)
            | Step::Release(_)
            | Step::Command(_) => self.next(),
        }
        Ok(())
    }

    /// Takes what tells the device from another of its model.
    fn mark(&mut self, step: Step, value: Option<u32>) {
        if let Step::Mark(place, _) = step {
            self.marks[place] = value;
        }
        self.next();
    }

    /// What an answer says of an edge that a drive was to capture.
    fn take_captured(&mut self, step: Step, value: u32) {
        self.next();
        self.captured = None;
        match step {
            Step::Captured(capture, _) if value & capture.stored != 0 => {
                self.steps.push_front(Step::CapturedAt(capture));
            }
            Step::Captured(_, Some(other)) => self.steps.push_front(Step::Captured(other, None)),
            Step::CapturedAt(_) => self.captured = Some((value as i32).into()),
            _ => {}
        }
    }

    /// Writes an object next if it reads otherwise.
    fn ensure(&mut self, write: Write, reading: &Reading, events: &mut impl FnMut(Event)) {
        let spec = self.layout.devices[self.device].device.spec();
        let is_so = spec.agrees(&write, reading.bytes());
        self.next();
        if !is_so {
            events(Event::Rewritten {
                device: self.device,
                object: write.address,
                found: reading.number(),
                value: write.data.bits(),
            });
            self.steps.push_front(Step::Write(write));
        }
    }

    fn next(&mut self) {
        self.steps.pop_front();
        self.tries = 0;
        self.give_up = None;
    }

    fn out_of_patience(&mut self, now: Instant, within: Duration) -> bool {
        self.tries = 0;
        now >= *self.give_up.get_or_insert(now + within)
    }
}
