//! The node of one device, a drive, an encoder or an I/O node, as the controller sees it over its bus: what it last told
//! and what it is told. An encoder is told nothing, an I/O node has no place.
//!
//! What travels is the model's affair ([`Device`]); here is what holds for every device: that all
//! its T_PDOs answer every SYNC, or every so many, that it is alive, in Operational, and where it was told to be.

use super::event::Event;
use super::fault::{AwaitedState, DeviceCause, DeviceIndex, Fault};
use super::layout::{self, Layout};
use super::polls::Polls;
use super::sdo_sequence::{SdoSequence, Step};
use crate::bus::FrameBuf;
use std::sync::Arc;
use syncline_canopen::emcy::{self, Emergency};
use syncline_canopen::{CanId, CobId, Frame, Instant, Transmit, guarding, heartbeat, nmt};
use syncline_drives::model::{
    ANALOG_INPUTS, Device, DriveStatus, Dynamics, Increments, Monitoring, OutOfRange, PowerCommand,
    PowerState, Scaling, Setpoint, Survey, unwrapped,
};

/// A device in the cycle: what it last told, and what it is told next.
#[derive(Clone, Debug)]
pub(super) struct DeviceNode {
    layout: Arc<Layout>,
    index: DeviceIndex,
    /// Its own, with what changes from frame to frame.
    device: Device,
    sequence: SdoSequence,
    /// What an SDO transfer of several messages goes on with, until the next wake-up.
    replies: FrameBuf,

    /// Its signs of life, also those that it is asked for.
    heartbeat: heartbeat::Consumer,
    /// Asks for them, if it has to be asked.
    guarding: Option<guarding::Master>,
    /// Where that is how it shows that it is there, and when it last answered.
    polls: Polls,
    polled: Option<Instant>,
    /// A boot-up message has come since it was last waited for.
    booted: bool,

    /// Identifier and length of each of its T_PDOs.
    t_pdos: Vec<(CanId, usize)>,
    /// Those that have come at all, one bit each.
    come: u32,
    answers: Answers,
    status: DriveStatus,
    place: Place,
    /// The torque that its last T_PDOs told, if they tell one, as its positions grow.
    told_torque: Option<i16>,
    /// How fast it turns as it told last, increments/s, if it tells no position.
    told_speed: Option<f64>,
    /// It has begun anew without having been told to, or was out of reach: it may count otherwise.
    lost_count: bool,
    /// The boot-up message that is to come was asked for.
    resetting: bool,
    /// Its digital inputs and outputs, off before they are first told.
    signals: u32,
    /// What its analog inputs are.
    analog_inputs: [i16; ANALOG_INPUTS],
    /// Its digital outputs as they are to be, where its R_PDOs carry them.
    outputs: u32,
    /// SYNCs since the one that its last T_PDOs answered; 0 if that was the last, or if they answer none.
    age: u32,
    misses: u32,
    still: Standstill,
    steady: Standstill,

    /// The state of its power stage, as told.
    told_power: Option<PowerState>,
    /// What is wanted of its power stage; [`Self::power_command`] is what it is told.
    pub(super) power: PowerCommand,
    /// For so many cycles it has been told to come to rest by itself: until it is brought up anew it follows no setpoints, and
    /// is only switched off.
    quick_stopped: Option<u64>,
    /// It homes by itself, or has not come back from there to the mode in which it follows setpoints.
    homes: bool,
    /// Cycles in a row that it was told to halt on its way home, and moved.
    unhalted: u64,
    torque: Torque,
    pub(super) setpoint: Setpoint,
    /// Its R_PDOs, as last encoded.
    r_pdos: Vec<Frame>,
    by_sdo: BySdo,
}

impl DeviceNode {
    pub(super) fn new(index: DeviceIndex, layout: &Arc<Layout>) -> Self {
        let drive = &layout.devices[index];
        let spec = drive.device.spec();
        Self {
            sequence: SdoSequence::new(index, layout),
            layout: Arc::clone(layout),
            index,
            device: drive.device.clone(),
            replies: FrameBuf::default(),
            heartbeat: heartbeat::Consumer::new(spec.node, drive.heartbeat_timeout),
            guarding: None,
            polls: Polls::NONE,
            polled: None,
            booted: false,
            t_pdos: (spec.t_pdos.iter())
                .map(|pdo| (pdo.cob_id.into(), pdo.bytes.into()))
                .collect(),
            come: 0,
            answers: Answers::new(
                (spec.t_pdos.iter())
                    .map(|pdo| Frame::new(pdo.cob_id, &[]))
                    .collect(),
            ),
            status: DriveStatus::default(),
            place: Place::new(drive.scaling, drive.middle),
            told_torque: None,
            told_speed: None,
            lost_count: false,
            resetting: false,
            signals: 0,
            analog_inputs: [0; ANALOG_INPUTS],
            outputs: 0,
            age: spec.answers_sync.into(),
            misses: 0,
            still: Standstill::NONE,
            steady: Standstill::NONE,
            told_power: None,
            power: PowerCommand::Disable,
            quick_stopped: None,
            homes: false,
            unhalted: 0,
            torque: Torque::Own,
            setpoint: Setpoint::default(),
            r_pdos: (spec.r_pdos.iter())
                .map(|pdo| Frame::new(pdo.cob_id, &[]))
                .collect(),
            by_sdo: BySdo::new(&drive.device),
        }
    }

    fn spec(&self) -> &layout::DeviceSpec {
        &self.layout.devices[self.index]
    }

    pub(super) fn scaling(&self) -> &Scaling {
        &self.spec().scaling
    }

    /// Whether it is known to be the device that is expected.
    pub(super) fn is_known(&self) -> bool {
        self.sequence.has_identified()
    }

    pub(super) fn is_sequence_done(&self) -> bool {
        self.sequence.is_done()
    }

    /// Looks for an SDO time-out and, if it `may_send`, sends the next request; whether it did.
    pub(super) fn ask(
        &mut self,
        now: Instant,
        may_send: bool,
        tx: &mut impl Transmit,
        events: &mut impl FnMut(Event),
    ) -> Result<bool, Fault> {
        for reply in self.replies.as_slice() {
            tx.transmit(*reply);
        }
        self.replies.clear();
        self.sequence.poll(now, tx, events)?;
        if may_send && self.call_back(tx) {
            return Ok(true);
        }
        if let Monitoring::Poll(position) = self.monitoring() {
            let state = self.survey().map(|survey| survey.address);
            self.polls.ask(now, (position, state), &mut self.sequence);
        }
        let sends = may_send && self.sequence.wants_to_send();
        if sends {
            self.sequence.advance(now, tx);
        }
        Ok(sends)
    }

    /// Whether a frame of its own answers a request by SDO.
    pub(super) fn is_answer(&self, frame: &Frame) -> bool {
        frame.id() == CanId::from(CobId::t_sdo(self.device.spec().node))
    }

    // --- what it tells ---

    /// Takes a frame of this node's bus; `since` is when the running cycle's SYNC left.
    pub(super) fn receive(
        &mut self,
        at: Instant,
        frame: &Frame,
        since: Option<Instant>,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        let node = self.device.spec().node;
        let is = |cob_id: CobId| frame.id() == CanId::from(cob_id);
        let t_pdo =
            |(id, length): &(CanId, usize)| *id == frame.id() && frame.data().len() >= *length;
        if let Some(t_pdo) = self.t_pdos.iter().position(t_pdo) {
            let answers = since.is_some_and(|sync| at >= sync);
            if !answers || self.count(t_pdo, frame)? {
                self.take(t_pdo, frame.data(), events);
            }
        } else if self.is_answer(frame) {
            // A server that goes on before it has its reply is none to listen to.
            if !self.replies.as_slice().is_empty() {
                return Ok(());
            }
            self.sequence
                .receive(at, frame, &mut self.replies, events)?;
            if let Some((object, value)) = self.sequence.take_polled() {
                self.polled = Some(at);
                match self.survey() {
                    Some(survey) if survey.address == object => {
                        self.take_state((survey.status)(value));
                    }
                    _ => {
                        self.place.move_to(Increments::from(value as i32));
                        self.polls.locate();
                    }
                }
            }
        } else if is(CobId::emcy(node)) {
            if frame.data().is_empty() {
                // The boot-up message of older devices.
                self.boots();
                return Ok(());
            }
            let Some(emergency) = Emergency::decode(frame.data()) else {
                return Ok(());
            };
            if emergency.code != emcy::code::NO_ERROR {
                return Err(self.fault(DeviceCause::Emergency { emergency }));
            }
            events(Event::ErrorReset { device: self.index });
        } else {
            let told = self.take_sign_of_life(at, frame);
            if told == Some(heartbeat::Event::BootUp) {
                self.boots();
            }
        }
        Ok(())
    }

    /// It says that it begins: once where it was reset, otherwise by itself.
    fn boots(&mut self) {
        self.lost_count |= self.booted || !self.resetting;
        self.booted = true;
    }

    /// Takes what a drive says of its state when it is asked.
    fn take_state(&mut self, said: DriveStatus) {
        if let Some(drive) = self.device.drive_mut() {
            drive.answers(&said);
        }
        if self.polls.believes(said.power != self.status.power) {
            self.status = DriveStatus {
                power: said.power,
                word: said.word,
                ..self.status
            };
        }
    }

    fn survey(&self) -> Option<Survey> {
        self.device.drive().and_then(|drive| drive.survey())
    }

    /// Takes what a T_PDO says.
    fn take(&mut self, t_pdo: usize, data: &[u8], events: &mut impl FnMut(Event)) {
        self.come |= 1 << t_pdo;
        self.polls.told();
        let drive = self.device.drive_mut();
        if let Some(status) = drive.and_then(|drive| drive.status(t_pdo, data)) {
            if status.warning && !self.status.warning {
                events(Event::Warning { device: self.index });
            }
            self.see_power(status.power, events);
            self.status = status;
        }
        let drive = self.device.drive();
        if let Some(torque) = drive.and_then(|drive| drive.torque(t_pdo, data)) {
            self.told_torque = Some(torque);
        }
        if let Some(speed) = drive.and_then(|drive| drive.speed(t_pdo, data)) {
            self.told_speed = Some(speed);
        }
        if let Some(feedback) = self.device.feedback()
            && let Some(sample) = feedback.sample(t_pdo, data)
        {
            let before = self.place.counts();
            (self.place).move_to(unwrapped(sample.position, feedback.range(), before));
            self.polls.locate();
        }
        if let Some(io) = self.device.io()
            && let Some(signals) = io.signals(t_pdo, data)
        {
            let mut changed = signals ^ std::mem::replace(&mut self.signals, signals);
            while changed != 0 {
                let signal = changed.trailing_zeros() as usize;
                let on = signals >> signal & 1 != 0;
                events(Event::Signal {
                    device: self.index,
                    signal,
                    on,
                });
                changed &= changed - 1;
            }
        }
        if let Some(io) = self.device.io()
            && let Some(inputs) = io.analog_inputs(t_pdo, data)
        {
            self.analog_inputs = inputs;
        }
    }

    /// Tells the state of its power stage if that is another one.
    pub(super) fn see_power(&mut self, power: PowerState, events: &mut impl FnMut(Event)) {
        let is_new = self.told_power.replace(power) != Some(power);
        if is_new && self.device.drive().is_some() {
            let device = self.index;
            events(Event::Power { device, power });
        }
    }

    /// Counts a T_PDO as the answer to the running cycle's SYNC; whether it is to be taken.
    ///
    /// # Errors
    /// It is a second answer.
    fn count(&mut self, t_pdo: usize, frame: &Frame) -> Result<bool, Fault> {
        if !self.device.spec().answers_sync {
            return Ok(true);
        }
        let taken = (self.answers.count(t_pdo, frame)).map_err(|cause| self.fault(cause))?;
        if self.answers.are_complete() {
            self.age = 0;
        }
        Ok(taken)
    }

    /// The machine position that the drive reports, mm.
    pub(super) fn actual_mm(&self) -> f64 {
        self.place.machine_mm()
    }

    /// Where the plan has its axis as the drive reports it, of a gantry without what the sides are planned to be apart, mm.
    pub(super) fn plan_mm(&self) -> f64 {
        self.place.plan_mm()
    }

    /// Its count at machine position 0, beyond the `zero` of the machine file.
    pub(super) fn origin(&self) -> Increments {
        self.place.origin()
    }

    /// How often its position was converted.
    #[cfg(test)]
    pub(super) fn conversions(&self) -> u64 {
        self.place.conversions()
    }

    /// It has that count at machine position 0.
    pub(super) fn set_origin(&mut self, origin: Increments) {
        self.place.set_origin(origin);
    }

    /// It has that count, beyond the `zero` of the machine file, where the plan has its axis at 0: captured when the
    /// setpoint was frozen, so that the drive stays where it is, whatever the other side of a gantry does.
    pub(super) fn set_offset(&mut self, offset: Increments) {
        self.place.set_offset(offset);
    }

    /// The machine position of its setpoint, mm.
    pub(super) fn setpoint_mm(&self) -> f64 {
        self.scaling()
            .to_mm(self.setpoint.position - self.place.origin())
    }

    pub(super) fn actual(&self) -> Increments {
        self.place.counts()
    }

    /// The level of one of its signals, once its T_PDOs have come.
    pub(super) fn signal(&self, signal: usize) -> Option<bool> {
        self.is_sampled().then(|| self.signals >> signal & 1 != 0)
    }

    /// What one of its analog inputs is, as it tells it; 0 before its T_PDOs have come.
    pub(super) fn analog_input(&self, place: usize) -> i16 {
        self.analog_inputs[place]
    }

    /// SYNCs since the one that its last T_PDO answered.
    pub(super) fn age(&self) -> u32 {
        self.age
    }

    /// How fast it turns, in units of its scaling in a second, as a drive tells that tells no position.
    pub(super) fn told_speed(&self) -> Option<f64> {
        let scaling = self.scaling();
        (self.told_speed).map(|speed| speed / scaling.to_increments_per_second(1.0))
    }

    /// Whether every T_PDO has come at all.
    pub(super) fn is_sampled(&self) -> bool {
        match self.monitoring() {
            Monitoring::Poll(_) => self.polled.is_some(),
            Monitoring::Heartbeat | Monitoring::Guarding { .. } | Monitoring::TPdos => {
                self.come.count_ones() as usize == self.t_pdos.len()
            }
        }
    }

    pub(super) fn status(&self) -> &DriveStatus {
        &self.status
    }

    /// Knows nothing of the drive any more, as after power-up; its device's own state stays.
    pub(super) fn forget(&mut self) {
        self.sequence.clear();
        self.torque.forget_steps();
        self.replies.clear();
        self.expect_boot();
        self.answers.forget();
        self.status = DriveStatus::default();
        self.age = self.device.spec().answers_sync.into();
        self.misses = 0;
        self.forget_standstill();
        (self.quick_stopped, self.homes) = (None, false);
        self.told_power = None;
        self.power = PowerCommand::Disable;
    }

    /// Forgets the boot-up messages so far.
    pub(super) fn expect_boot(&mut self) {
        self.booted = false;
        self.resetting = true;
        self.heartbeat.forget();
        self.guarding = None;
        self.polls = Polls::NONE;
        self.polled = None;
        self.by_sdo.forget();
        self.come = 0;
    }

    pub(super) fn has_booted(&self) -> bool {
        if self.device.spec().tells_boot_up {
            self.booted
        } else {
            self.sequence.is_done()
        }
    }

    /// Why a device that was reset does not count as booted.
    pub(super) fn did_not_boot(&self) -> Fault {
        self.fault(if self.device.spec().tells_boot_up {
            DeviceCause::NoBootUp
        } else {
            DeviceCause::NoAnswer
        })
    }

    fn monitoring(&self) -> Monitoring {
        self.device.spec().monitoring
    }

    /// Whether it is asked all the time for what others tell by themselves.
    pub(super) fn is_polled(&self) -> bool {
        matches!(self.monitoring(), Monitoring::Poll(_))
    }

    /// Whether the drive reports what is `awaited`.
    pub(super) fn has_reached(&self, awaited: AwaitedState) -> bool {
        let Some(drive) = self.device.drive() else {
            return true;
        };
        let DriveStatus {
            power, mode_runs, ..
        } = self.status;
        match awaited {
            AwaitedState::Disabled => !power.may_be_on(),
            AwaitedState::Ready => power == PowerState::Ready,
            AwaitedState::Enabled => power == PowerState::Enabled,
            AwaitedState::ModeStarted => mode_runs,
            AwaitedState::ModeEnded => self.homes || !mode_runs || !drive.ends_mode(),
        }
    }

    // --- supervision ---

    /// What this drive did.
    fn fault(&self, cause: DeviceCause) -> Fault {
        Fault::Device(self.index, cause)
    }

    /// SYNC leaves: what came before it no longer counts.
    pub(super) fn on_sync(&mut self) {
        self.answers.on_sync(self.is_due());
        if self.device.spec().answers_sync {
            self.age = self.age.saturating_add(1);
        }
    }

    /// Which SYNCs it answers.
    fn divider(&self) -> u32 {
        self.device.spec().sync_divider
    }

    /// Whether the last SYNC was one that it answers, as it has answered so far.
    fn is_due(&self) -> bool {
        self.age.is_multiple_of(self.divider())
    }

    /// Whether it has answered each SYNC that it answers.
    pub(super) fn has_answered(&self) -> bool {
        self.age < self.divider()
    }

    /// For so many SYNCs in a row it may answer none.
    fn patience(&self) -> u32 {
        self.spec().t_pdo_misses * self.divider()
    }

    /// The fault of a drive that has answered no SYNC for as many cycles as are tolerated: what it said
    /// before is no longer true of it.
    pub(super) fn check_answers(&self) -> Result<(), Fault> {
        if self.age < self.patience() {
            return Ok(());
        }
        let misses = self.age;
        Err(self.fault(DeviceCause::MissingTPdo { misses }))
    }

    /// Whether a drive that is not enabled yet reports no fault.
    pub(super) fn check_no_fault(&self) -> Result<(), Fault> {
        if self.status.power.is_fault() {
            let word = self.status.word;
            return Err(self.fault(DeviceCause::Reported { word }));
        }
        Ok(())
    }

    /// Whether an enabled drive, in its mode if `in_mode`, still does as it is told.
    pub(super) fn check_follows(&self, in_mode: bool) -> Result<(), Fault> {
        self.check_no_fault()?;
        if self.device.drive().is_none() {
            return Ok(());
        }
        let word = self.status.word;
        self.status
            .follows(in_mode && !self.homes)
            .map_err(|why| self.fault(DeviceCause::NotFollowing { word, why }))
    }

    // --- what it is told ---

    /// What its power stage is told now. Out of a quick stop, its own or a commanded one, there is
    /// one way down.
    fn power_command(&self) -> PowerCommand {
        let quick_stops = self.status.power == PowerState::QuickStop;
        match self.power {
            PowerCommand::Prepare if self.is_quick_stopped() || quick_stops => {
                PowerCommand::Disable
            }
            PowerCommand::Disable | PowerCommand::Prepare => self.power,
            _ if self.is_quick_stopped() => PowerCommand::QuickStop,
            power => power,
        }
    }

    /// Whether it was told to come to rest by itself, and follows no setpoints.
    pub(super) fn is_quick_stopped(&self) -> bool {
        self.quick_stopped.is_some()
    }

    /// Whether it was told so for as many cycles.
    pub(super) fn has_braked_for(&self, cycles: u64) -> bool {
        self.quick_stopped.is_some_and(|since| since >= cycles)
    }

    /// What the drive has to be sent to for its axis to be at `mm` of the plan.
    pub(super) fn setpoint_at(&self, mm: f64) -> Result<Setpoint, Fault> {
        let setpoint = Setpoint::at(self.increments(mm)? + self.place.offset());
        let checked = self.check(setpoint);
        checked.map_err(|OutOfRange| self.fault(DeviceCause::PositionRange))?;
        Ok(setpoint)
    }

    /// A machine position as the device counts, from its `zero` in the machine file.
    pub(super) fn increments(&self, mm: f64) -> Result<Increments, Fault> {
        let there = self.scaling().to_increments(mm);
        there.map_err(|OutOfRange| self.fault(DeviceCause::PositionRange))
    }

    /// Whether the drive can be sent there.
    pub(super) fn check(&self, setpoint: Setpoint) -> Result<(), OutOfRange> {
        let drive = self.device.drive();
        drive.map_or(Ok(()), |drive| drive.check(setpoint))
    }

    /// How it moves, if it is sent velocities.
    pub(super) fn dynamics(&self) -> Option<Dynamics> {
        self.device.drive().and_then(|drive| drive.dynamics())
    }

    /// By how many cycles its setpoints lag behind the plan, see [`Layout::lag`].
    pub(super) fn delay(&self) -> f64 {
        self.spec().delay
    }

    /// Whether its position is young enough to be controlled by.
    pub(super) fn is_fresh(&self) -> bool {
        self.age < self.patience()
    }

    /// Holds the drive where it is. One that follows its setpoints as soon as it is enabled is held
    /// where it was before: if its setpoint went along with its noise, nothing would hold it.
    pub(super) fn hold(&mut self) {
        let ends_mode = self.device.drive().is_none_or(|drive| drive.ends_mode());
        if self.power != PowerCommand::Enable || ends_mode {
            self.setpoint = Setpoint::at(self.place.counts());
        }
    }

    /// Sets a digital output with the next R_PDOs.
    pub(super) fn set_output(&mut self, output: usize, level: bool) {
        let bit = 1 << output;
        self.outputs = self.outputs & !bit | if level { bit } else { 0 };
    }

    /// Sets an analog output with the next R_PDOs.
    pub(super) fn set_analog_output(&mut self, output: usize, value: i16) {
        if let Some(io) = self.device.io_mut() {
            io.set_analog_output(output, value);
        }
    }

    /// Encodes its R_PDOs for the next SYNC: once for a cycle in which they are sent.
    pub(super) fn encode(&mut self) {
        let power = self.power_command();
        self.take_outputs();
        self.by_sdo.is_sent = true;
        match &mut self.device {
            Device::Drive(drive) => drive.encode(power, self.setpoint, &mut self.r_pdos),
            Device::Encoder(_) => {}
            Device::Io(io) => io.encode(&mut self.r_pdos),
        }
        self.tell_outputs();
    }

    /// Hands the device what its digital outputs are to be.
    fn take_outputs(&mut self) {
        if let Some(io) = self.device.io_mut() {
            io.set_outputs(self.outputs);
        }
    }

    /// Its R_PDOs as last encoded.
    pub(super) fn r_pdos(&self) -> &[Frame] {
        &self.r_pdos
    }

    pub(super) fn nmt(&self, command: nmt::Command) -> Frame {
        nmt::Request {
            command,
            node: Some(self.device.spec().node),
        }
        .encode()
    }

    /// The step until a device that was reset has booted, where no boot-up message will tell; forgets
    /// those so far.
    pub(super) fn ask_boot(&mut self) {
        self.expect_boot();
        if !self.device.spec().tells_boot_up {
            let first = self.device.spec().identity.first();
            let answer = first.map(|identity| Step::AwaitAnswer(identity.address));
            self.sequence.extend(answer);
        }
    }

    /// The steps from a drive in an unknown state to one that may be reset.
    pub(super) fn ask_survey(&mut self) {
        if let Some(survey) = self.survey() {
            self.sequence.survey(survey);
        }
        let history = self.device.spec().history.iter().copied();
        self.sequence.extend(history.map(Step::History));
    }

    /// The steps from the boot-up message to a drive that is set up.
    pub(super) fn ask_set_up(&mut self) {
        self.booted = false;
        // What it is set up with has it count from there.
        let feedback = self.device.feedback();
        self.lost_count |= feedback.is_some_and(|it| !it.counts_without_power());
        let spec = self.device.spec();
        let identity = spec.identity.iter().copied().map(Step::Identity);
        let marks = self.spec().keeps_reference.then_some(spec.marks);
        let marks = marks.into_iter().flatten().enumerate();
        let marks = marks.filter_map(|(place, mark)| Some(Step::Mark(place, mark?)));
        let ensured = spec.ensured.iter().copied().map(Step::Ensure);
        let writes = spec.setup.iter().copied().map(Step::Write);
        let read_back = spec.ensured.iter().chain(&spec.read_back);
        let read_back = read_back.copied().map(Step::ReadBack);
        self.sequence
            .extend((identity.chain(marks).chain(ensured)).chain(writes.chain(read_back)));
    }

    /// Whether its position is one of the last SYNC.
    pub(super) fn answers_sync(&self) -> bool {
        self.device.spec().answers_sync
    }

    /// The steps until the drive's clock follows SYNC; none for one without a clock that does.
    pub(super) fn ask_lock(&mut self) {
        let lock = self.device.spec().clock_lock;
        self.sequence.extend(lock.map(Step::AwaitLock));
    }

    /// The step that checks the operating mode, where the drive has more than one.
    pub(super) fn ask_mode(&mut self) {
        let mode = self.device.drive().and_then(|drive| drive.mode());
        self.sequence.extend(mode.map(Step::Mode));
    }

    /// The steps that tell the drive the profile by which it goes to its next target, mm/s and mm/s².
    pub(super) fn ask_profile(&mut self, velocity: f64, acceleration: f64) {
        let [velocity, acceleration] =
            [velocity, acceleration].map(|it| self.scaling().to_increments_per_second(it).abs());
        let drive = self.device.drive();
        let profile = drive.and_then(|drive| drive.profile(velocity, acceleration));
        self.sequence
            .extend(profile.into_iter().flatten().map(Step::Write));
    }

    /// Whether it has still to acknowledge a target.
    pub(super) fn owes_acknowledgement(&self) -> bool {
        let drive = self.device.drive();
        drive.is_some_and(|drive| drive.owes_acknowledgement())
    }

    /// Whether it has still to acknowledge a target, or to tell that it has come there.
    pub(super) fn is_under_way(&self) -> bool {
        let drive = self.device.drive();
        drive.is_some_and(|drive| drive.owes_acknowledgement() || drive.is_under_way())
    }

    /// The steps that take the set-up's cyclic part back, from a device in reach; whatever else there was to do is
    /// forgotten, as a bus may come back meanwhile.
    pub(super) fn ask_release(&mut self, in_reach: bool) {
        self.guarding = None;
        self.polls = Polls::NONE;
        self.sequence.clear();
        self.torque.forget_steps();
        self.command_off();
        if in_reach {
            // One that was never started or never sent an R_PDO, or no longer hears them; of another kind than expected it is told
            // nothing.
            let may_hear = self.is_operational() && self.by_sdo.is_sent;
            if self.is_known() && !may_hear {
                self.tell_by_sdo();
            }
            self.tell_finally();
        }
        if in_reach && self.is_known() {
            self.release_torque();
            let release = self
                .device
                .spec()
                .release
                .iter()
                .copied()
                .map(Step::Release);
            self.sequence.extend(release);
        }
    }
}

mod answers;
mod by_sdo;
mod captures;
mod count;
mod homing;
mod monitoring;
mod place;
mod standstill;
#[cfg(test)]
mod tests;
mod torque;

use answers::Answers;
use by_sdo::BySdo;
use place::Place;
use standstill::Standstill;
use torque::Torque;
