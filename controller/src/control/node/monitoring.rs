//! By what a device shows that it is there and Operational: its heartbeat, what it answers to guarding or polls, its T_PDOs.

use super::{DeviceNode, Event};
use crate::control::fault::{DeviceCause, Fault};
use syncline_canopen::{CobId, Frame, Instant, Transmit, guarding, heartbeat, nmt};
use syncline_drives::model::Monitoring;

impl DeviceNode {
    /// From now on it is guarded or polled, if it shows by that that it is there.
    pub(in crate::control) fn begin_polls(&mut self) {
        self.polls.begin();
        if let Monitoring::Guarding { every } = self.monitoring() {
            let node = self.device.spec().node;
            // How long it may be silent is the heartbeat's affair.
            self.guarding = Some(guarding::Master::new(node, every, 0, Instant::ZERO));
        }
    }

    /// Asks it for a sign of life if that is due; whether it is.
    pub(in crate::control) fn guard(&mut self, now: Instant, tx: &mut impl Transmit) -> bool {
        let due = self.guarding.as_mut().filter(|it| now >= it.deadline());
        due.map(|it| it.poll(now, tx)).is_some()
    }

    /// Takes its heartbeat, or what it answers to guarding: that is one with a toggle bit, and says nothing where the bit is that of
    /// the answer before.
    pub(super) fn take_sign_of_life(
        &mut self,
        at: Instant,
        frame: &Frame,
    ) -> Option<heartbeat::Event> {
        let Some(guarding) = &mut self.guarding else {
            return self.heartbeat.on_frame(at, frame);
        };
        let error_control = CobId::error_control(self.device.spec().node);
        let &[byte] = frame.data() else {
            return None;
        };
        if frame.id() != error_control.into()
            || guarding.on_frame(frame) == Some(guarding::Event::Toggle)
        {
            return None;
        }
        self.heartbeat.on_byte(at, byte & 0x7F)
    }

    pub(in crate::control) fn is_operational(&self) -> bool {
        match self.monitoring() {
            Monitoring::Heartbeat | Monitoring::Guarding { .. } => {
                self.heartbeat.state() == Some(nmt::State::Operational)
            }
            Monitoring::TPdos | Monitoring::Poll(_) => self.is_sampled(),
        }
    }

    /// Whether the device answers as many SYNCs as it has to and shows signs of life in Operational.
    pub(in crate::control) fn check_alive(
        &mut self,
        now: Instant,
        events: &mut impl FnMut(Event),
    ) -> Result<(), Fault> {
        if self.booted {
            return Err(self.fault(DeviceCause::Rebooted));
        }
        if self.age == 0 {
            self.misses = 0;
        } else if self.is_due() {
            self.misses += 1;
            events(Event::MissedTPdo { device: self.index });
        }
        if self.misses >= self.spec().t_pdo_misses {
            let misses = self.misses * self.divider();
            return Err(self.fault(DeviceCause::MissingTPdo { misses }));
        }
        match self.monitoring() {
            Monitoring::TPdos => Ok(()),
            Monitoring::Poll(object) => {
                let timeout = self.spec().heartbeat_timeout;
                if self.polled.is_none_or(|last| now > last + timeout) {
                    self.lost_count = true;
                    return Err(self.fault(DeviceCause::PollUnanswered { object }));
                }
                Ok(())
            }
            Monitoring::Heartbeat if !self.heartbeat.is_alive(now) => {
                Err(self.fault(DeviceCause::HeartbeatLost))
            }
            Monitoring::Guarding { .. } if !self.heartbeat.is_alive(now) => {
                Err(self.fault(DeviceCause::GuardingUnanswered))
            }
            _ if !self.is_operational() => Err(self.did_not_start()),
            Monitoring::Heartbeat | Monitoring::Guarding { .. } => Ok(()),
        }
    }

    /// Why a drive that should run in Operational does not.
    pub(in crate::control) fn did_not_start(&self) -> Fault {
        let missing = DeviceCause::MissingTPdo {
            misses: self.misses,
        };
        match self.monitoring() {
            Monitoring::Heartbeat | Monitoring::Guarding { .. } => {}
            Monitoring::TPdos => return self.fault(missing),
            Monitoring::Poll(object) => return self.fault(DeviceCause::PollUnanswered { object }),
        }
        self.fault(match (self.heartbeat.state(), self.heartbeat.byte()) {
            (Some(nmt::State::Operational), _) => missing,
            (Some(state), _) => DeviceCause::NmtState { state },
            (None, Some(byte)) => DeviceCause::UnknownNmtState { byte },
            (None, None) if self.guarding.is_some() => DeviceCause::GuardingUnanswered,
            (None, None) => DeviceCause::NoNmtState,
        })
    }
}
