//! One drive as the controller sees it over its bus: what it last told and what it is told.

use super::event::Event;
use super::fault::{DriveIndex, Fault, Wanted};
use super::layout::{Drive, Layout};
use super::script::{Script, Step, is_powered};
use crate::port::FrameBuf;
use std::sync::Arc;
use syncline_canopen::cia402::{Controlword, State, Statusword};
use syncline_canopen::emcy::{self, Emergency};
use syncline_canopen::{CanId, CobId, Frame, Instant, Transmit, heartbeat, nmt};
use syncline_drives::model::{Actuator, Increments, Scaling};

/// One drive.
#[derive(Clone, Debug)]
pub(super) struct Node {
    layout: Arc<Layout>,
    index: DriveIndex,
    script: Script,
    /// What an SDO transfer of several messages goes on with, until the next wake-up.
    replies: FrameBuf,

    heartbeat: heartbeat::Consumer,
    /// A boot-up message has come since it was last waited for.
    booted: bool,

    statusword: Statusword,
    actual: Increments,
    /// A T_PDO has come at all.
    sampled: bool,
    /// SYNCs since the one that its last T_PDO answered; 0 if that was the last.
    age: u32,
    misses: u32,
    /// Two T_PDOs came to this SYNC, and to the one before.
    twice: bool,
    was_twice: bool,
    /// Cycles in a row within the standstill window around `still_at`.
    still: u32,
    still_at: Increments,

    pub(super) controlword: Controlword,
    pub(super) setpoint: Increments,
}

impl Node {
    pub(super) fn new(index: DriveIndex, layout: &Arc<Layout>) -> Self {
        let drive = &layout.drives[index];
        Self {
            script: Script::new(index, layout),
            layout: Arc::clone(layout),
            index,
            replies: FrameBuf::default(),
            heartbeat: heartbeat::Consumer::new(drive.device.node(), drive.heartbeat_timeout),
            booted: false,
            statusword: Statusword(0),
            actual: Increments::ZERO,
            sampled: false,
            age: 1,
            misses: 0,
            twice: false,
            was_twice: false,
            still: 0,
            still_at: Increments::ZERO,
            controlword: Controlword::DISABLE_VOLTAGE,
            setpoint: Increments::ZERO,
        }
    }

    fn spec(&self) -> &Drive {
        &self.layout.drives[self.index]
    }

    pub(super) fn device(&self) -> &dyn Actuator {
        &*self.spec().device
    }

    pub(super) fn scaling(&self) -> &Scaling {
        &self.spec().scaling
    }

    pub(super) fn is_script_done(&self) -> bool {
        self.script.is_done()
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
        self.script.poll(now, tx, events)?;
        let sends = may_send && self.script.wants_to_send();
        if sends {
            self.script.advance(now, tx);
        }
        Ok(sends)
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
        let drive = self.index;
        let node = self.device().node();
        let is = |cob_id: CobId| frame.id() == CanId::from(cob_id);
        if is(self.device().t_pdo().cob_id) {
            if let Some(sample) = self.device().sample(frame.data()) {
                if sample.statusword.has(Statusword::WARNING)
                    && !self.statusword.has(Statusword::WARNING)
                {
                    events(Event::Warning { drive });
                }
                self.statusword = sample.statusword;
                self.actual = sample.position;
                self.sampled = true;
                if since.is_some_and(|sync| at >= sync) {
                    if std::mem::replace(&mut self.age, 0) == 0 {
                        self.twice = true;
                    }
                    // Once may be a frame that was received twice.
                    if self.twice && self.was_twice {
                        return Err(Fault::TwoNodes { drive });
                    }
                }
            }
        } else if is(CobId::t_sdo(node)) {
            // A server that goes on before it has its reply is none to listen to.
            if !self.replies.as_slice().is_empty() {
                return Ok(());
            }
            self.script.receive(at, frame, &mut self.replies, events)?;
        } else if is(CobId::emcy(node)) {
            let Some(emergency) = Emergency::decode(frame.data()) else {
                return Ok(());
            };
            let Emergency {
                code,
                register,
                vendor: [.., v0, v1],
            } = emergency;
            if code != emcy::code::NO_ERROR {
                return Err(Fault::Emergency {
                    drive,
                    code,
                    register,
                    vendor: u16::from_le_bytes([v0, v1]),
                });
            }
            events(Event::ErrorReset { drive });
        } else {
            let told = self.heartbeat.on_frame(at, frame);
            self.booted |= told == Some(heartbeat::Event::BootUp);
        }
        Ok(())
    }

    /// The machine position that the drive reports, mm.
    pub(super) fn actual_mm(&self) -> f64 {
        self.scaling().to_mm(self.actual)
    }

    pub(super) fn actual(&self) -> Increments {
        self.actual
    }

    /// SYNCs since the one that its last T_PDO answered.
    pub(super) fn age(&self) -> u32 {
        self.age
    }

    /// Whether a T_PDO has come at all.
    pub(super) fn is_sampled(&self) -> bool {
        self.sampled
    }

    pub(super) fn statusword(&self) -> Statusword {
        self.statusword
    }

    /// Forgets the boot-up messages so far.
    pub(super) fn expect_boot(&mut self) {
        self.booted = false;
        self.heartbeat.forget();
        self.sampled = false;
    }

    pub(super) fn has_booted(&self) -> bool {
        self.booted
    }

    pub(super) fn is_operational(&self) -> bool {
        self.heartbeat.state() == Some(nmt::State::Operational)
    }

    /// Whether the state that `wanted` names is reported.
    pub(super) fn has_reached(&self, wanted: Wanted) -> bool {
        let statusword = self.statusword;
        match wanted {
            Wanted::Disabled => !is_powered(statusword),
            Wanted::ReadyToSwitchOn => statusword.state() == Some(State::ReadyToSwitchOn),
            Wanted::OperationEnabled => statusword.state() == Some(State::OperationEnabled),
            Wanted::ModeStarted => self.device().mode_started(self.statusword),
            Wanted::ModeEnded => !self.device().mode_started(self.statusword),
        }
    }

    /// Cycles in a row that the drive has stood still.
    pub(super) fn still(&self) -> u32 {
        self.still
    }

    // --- supervision ---

    /// SYNC leaves: what came before it no longer counts.
    pub(super) fn on_sync(&mut self) {
        self.age = self.age.saturating_add(1);
        self.was_twice = std::mem::take(&mut self.twice);
    }

    /// Whether the drive answers every SYNC and shows signs of life in Operational.
    pub(super) fn check_alive(
        &mut self,
        now: Instant,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        let drive = self.index;
        if self.booted {
            return Err(Fault::Rebooted { drive });
        }
        if self.age == 0 {
            self.misses = 0;
        } else {
            self.misses += 1;
            events(Event::MissedTPdo { drive });
        }
        if self.misses >= self.layout.t_pdo_misses {
            let misses = self.misses;
            return Err(Fault::MissingTPdo { drive, misses });
        }
        if !self.heartbeat.is_alive(now) {
            Err(Fault::HeartbeatLost { drive })
        } else if !self.is_operational() {
            Err(self.did_not_start())
        } else {
            Ok(())
        }
    }

    /// Why a drive that should run in Operational does not.
    pub(super) fn did_not_start(&self) -> Fault {
        let drive = self.index;
        match self.heartbeat.state() {
            Some(nmt::State::Operational) => Fault::MissingTPdo {
                drive,
                misses: self.misses,
            },
            state => Fault::NmtState { drive, state },
        }
    }

    /// Whether a drive that is not enabled yet reports no fault.
    pub(super) fn check_no_fault(&self) -> Result<(), Fault> {
        let statusword = self.statusword;
        let state = statusword.state();
        if matches!(state, Some(State::Fault | State::FaultReactionActive)) {
            let drive = self.index;
            return Err(Fault::DriveFault { drive, statusword });
        }
        Ok(())
    }

    /// Whether an enabled drive, in its mode if `started`, still does as it is told.
    pub(super) fn check_follows(&self, started: bool) -> Result<(), Fault> {
        self.check_no_fault()?;
        self.device()
            .follows(self.statusword, started)
            .map_err(|why| Fault::NotFollowing {
                drive: self.index,
                statusword: self.statusword,
                why,
            })
    }

    /// Counts the cycles in which the drive has stood within `window` increments.
    pub(super) fn watch_standstill(&mut self, window: Increments) {
        if (self.actual - self.still_at).get().abs() <= window.get() {
            self.still = self.still.saturating_add(1);
        } else {
            self.still_at = self.actual;
            self.still = 0;
        }
    }

    /// Counts anew.
    pub(super) fn forget_standstill(&mut self) {
        self.still = 0;
    }

    // --- what it is told ---

    /// The R_PDO for the next SYNC.
    pub(super) fn command(&self) -> Result<Frame, Fault> {
        self.device()
            .command(self.controlword, self.setpoint)
            .map_err(|_| Fault::PositionRange { drive: self.index })
    }

    /// Whether the drive can be sent to `setpoint`.
    pub(super) fn can_take(&self, setpoint: Increments) -> bool {
        self.device().command(self.controlword, setpoint).is_ok()
    }

    pub(super) fn nmt(&self, command: nmt::Command) -> Frame {
        nmt::Request {
            command,
            node: Some(self.device().node()),
        }
        .encode()
    }

    /// The steps from a drive in an unknown state to one that may be reset.
    pub(super) fn ask_survey(&mut self) {
        let history = self.layout.drives[self.index].device.history();
        self.script.extend([Step::Survey]);
        self.script
            .extend(history.iter().copied().map(Step::History));
    }

    /// The steps from the boot-up message to a drive that is set up.
    pub(super) fn ask_set_up(&mut self) {
        self.booted = false;
        let device = &self.layout.drives[self.index].device;
        let identity = device.identity().iter().copied().map(Step::Identity);
        let writes = device.setup().iter().copied().map(Step::Write);
        let read_back = device.read_back().iter().copied().map(Step::ReadBack);
        self.script.extend(identity.chain(writes).chain(read_back));
    }

    /// The steps until the drive's clock follows SYNC.
    pub(super) fn ask_lock(&mut self) {
        let lock = self.device().clock_lock();
        self.script.extend(lock.map(Step::AwaitLock));
    }

    /// The step that checks the operating mode.
    pub(super) fn ask_mode(&mut self) {
        let mode = self.device().mode();
        self.script.extend([Step::Mode(mode)]);
    }

    /// The steps that take the set-up's cyclic part back.
    pub(super) fn ask_release(&mut self) {
        self.script.clear();
        if !self.script.has_identified() {
            return;
        }
        let device = &self.layout.drives[self.index].device;
        self.script
            .extend(device.release().iter().copied().map(Step::Release));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::rig::Shape;
    use syncline_canopen::time::Duration;

    /// What happens to a node, at a time in µs.
    enum Step {
        /// Data on 700h + id.
        Says(u64, &'static [u8]),
        /// [`Node::expect_boot`]
        Forget,
        /// [`Node::ask_set_up`]
        SetUp,
    }

    /// Its name, what the node did, when it is checked in µs, and what that tells.
    type Case = (&'static str, &'static [Step], u64, Result<(), Fault>);

    /// Heartbeat supervision with a limit of 300 ms. What a check tells it tells every time.
    #[test]
    fn heartbeat_supervision() {
        use Step::{Forget, Says, SetUp};
        let state = |state| Err(Fault::NmtState { drive: 0, state });
        let lost = Err(Fault::HeartbeatLost { drive: 0 });
        let rebooted = Err(Fault::Rebooted { drive: 0 });
        let initialising = state(Some(nmt::State::Initialising));
        let pre_operational = state(Some(nmt::State::PreOperational));
        let stopped = state(Some(nmt::State::Stopped));
        let cases: [Case; 20] = [
            ("never heard", &[], 0, lost),
            ("heard", &[Says(0, &[5])], 1, Ok(())),
            ("at the limit", &[Says(0, &[5])], 300_000, Ok(())),
            ("late", &[Says(0, &[5])], 300_001, lost),
            (
                "each one counts anew",
                &[Says(0, &[5]), Says(300_000, &[5])],
                600_000,
                Ok(()),
            ),
            (
                "back after having been lost",
                &[Says(0, &[5]), Says(900_000, &[5])],
                900_001,
                Ok(()),
            ),
            ("boot-up in the run", &[Says(0, &[0])], 1, rebooted),
            (
                "boot-up in the run, running since",
                &[Says(0, &[0]), Says(100_000, &[5])],
                100_001,
                rebooted,
            ),
            (
                "boot-up before the set-up",
                &[Says(0, &[0]), SetUp],
                1,
                initialising,
            ),
            (
                "boot-up is a sign of life",
                &[Says(0, &[0]), SetUp],
                300_000,
                initialising,
            ),
            (
                "boot-up is no sign of life for ever",
                &[Says(0, &[0]), SetUp],
                300_001,
                lost,
            ),
            (
                "started after the set-up",
                &[Says(0, &[0]), SetUp, Says(100_000, &[5])],
                400_000,
                Ok(()),
            ),
            ("forgotten", &[Says(0, &[5]), Forget], 1, lost),
            (
                "left Operational",
                &[Says(0, &[5]), Says(100_000, &[0x7F])],
                100_001,
                pre_operational,
            ),
            (
                "stopped, and late besides",
                &[Says(0, &[5]), Says(100_000, &[4])],
                400_001,
                lost,
            ),
            (
                "stopped",
                &[Says(0, &[5]), Says(100_000, &[4])],
                400_000,
                stopped,
            ),
            (
                "back in Operational",
                &[Says(0, &[0x7F]), Says(100_000, &[5])],
                100_001,
                Ok(()),
            ),
            (
                "a toggle bit, as in an answer to guarding: alive, its state unknown",
                &[Says(0, &[5]), Says(100_000, &[0x85])],
                400_000,
                state(None),
            ),
            (
                "a byte that is no state: alive, its state unknown",
                &[Says(0, &[5]), Says(100_000, &[0x42])],
                400_000,
                state(None),
            ),
            (
                "no heartbeat by its length",
                &[Says(0, &[5]), Says(100_000, &[]), Says(100_000, &[0x7F, 0])],
                300_001,
                lost,
            ),
        ];
        let shape = Shape::on_fewest_buses(1, Duration::from_millis(2)).unwrap();
        let layout = Arc::new(shape.layout());
        let at = |micros| Instant::ZERO + Duration::from_micros(micros);
        for (case, steps, check, expected) in cases {
            let mut node = Node::new(0, &layout);
            let id = CobId::error_control(node.device().node());
            for step in steps {
                match *step {
                    Says(micros, data) => {
                        let heard =
                            node.receive(at(micros), &Frame::new(id, data), None, &mut |_| ());
                        assert_eq!(heard, Ok(()), "{case}");
                    }
                    Forget => node.expect_boot(),
                    SetUp => node.ask_set_up(),
                }
            }
            node.age = 0;
            for _ in 0..2 {
                assert_eq!(node.check_alive(at(check), &mut |_| ()), expected, "{case}");
            }
        }
    }
}
