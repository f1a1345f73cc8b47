//! What is sent behind each SYNC: the setpoints for the next one, and as many requests by SDO as there is room for.

use super::fault::{AxisCause, Fault};
use super::reaction::Cause;
use super::{BusIndex, Controller, DeviceNode, Event, Phase, event_sink, layout};
use crate::bus::Outbox;
use std::mem::take;
use std::sync::Arc;
use syncline_canopen::{Instant, Transmit};

impl<const N: usize> Controller<N> {
    /// The burst of setpoints for the next SYNC: of every drive, or of none. What is wrong with them has its reaction in the
    /// same burst.
    pub(super) fn command(&mut self, now: Instant, out: &mut [Outbox]) {
        self.setpoints_change = false;
        if !self.streams() {
            return;
        }
        if !self.frozen {
            self.nodes.iter_mut().for_each(DeviceNode::hold);
            for axis in &self.axes {
                axis.hold_up(&mut self.nodes);
            }
        } else if let Err(fault) = self.plan_axes() {
            self.fail(fault);
        }
        if self.phase == Phase::Start && !self.nodes.iter().all(DeviceNode::is_sampled) {
            return;
        }
        if now > self.sync_at + self.layout.latest_burst {
            (0..out.len()).for_each(|bus| self.miss(bus, self.cycle));
            return;
        }
        self.set_outputs();
        self.nodes.iter_mut().for_each(DeviceNode::encode);
        for ((burst, outbox), misses) in self.bursts.iter().zip(out).zip(&mut self.misses) {
            for &(drive, r_pdo) in burst {
                outbox.burst.transmit(self.nodes[drive].r_pdos()[r_pdo]);
            }
            misses.keep(outbox.burst.as_slice(), self.setpoints_change);
        }
    }

    /// Whether setpoints go out every cycle.
    pub(super) fn streams(&self) -> bool {
        (Phase::Start..=Phase::Disable).contains(&self.phase) && self.sync_on
    }

    /// Goes on with the plan, and hands the drives their setpoints: all but those of an axis that cannot
    /// be sent there; of none where one would be beyond its axis' limits.
    fn plan_axes(&mut self) -> Result<(), Fault> {
        if take(&mut self.left_out) {
            self.plan(0.0);
            let plan = (&self.planned.position[..], &self.planned.velocity[..]);
            for axis in &mut self.axes {
                axis.leave_out(self.cycle, plan);
            }
        }
        self.plan(1.0);
        let mut outcome = self.lost_step().map_or(Ok(()), Err);
        let mut move_on = true;
        let couples = !self.is_faulty();
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let plan = (&self.planned.position[..], &self.planned.velocity[..]);
            let in_homing = self.homing.homes(index);
            let how = (in_homing, couples);
            let mut prepared = axis.prepare(self.cycle + 1, plan, how, &self.nodes);
            if let Err(Fault::Axis(_, AxisCause::SetpointGuard { sampled, .. })) = &mut prepared {
                *sampled = self.along_samples.leads();
            }
            if prepared.is_err_and(|fault| fault.cause() == Cause::SetpointGuard) {
                move_on = false;
                outcome = prepared;
            }
            outcome = outcome.and(prepared);
        }
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            self.setpoints_change |= axis.hand_over(self.cycle + 1, move_on, &mut self.nodes);
            if let Some(what) = axis.tells_sides() {
                self.tell(Event::SidesApart { axis: index, what });
            }
        }
        outcome
    }

    /// Goes on with the plan by one cycle, to the setpoint of the SYNC that is so many cycles ahead.
    fn plan(&mut self, ahead: f64) {
        if (Phase::Program..=Phase::Stop).contains(&self.phase) {
            let beside_plan = self.follow_spindle(ahead);
            let beside_plan = beside_plan.or_else(|| self.follow_samples(ahead));
            self.planned = beside_plan.unwrap_or_else(|| {
                let planned = self.executor.advance();
                let planned = self.along_samples.behind(planned);
                self.shaping.shape(planned, &self.executor)
            });
            self.place_beside();
            self.switch();
        }
    }

    /// As many SDO requests as fit beside the cyclic frames.
    pub(super) fn send_acyclic(&mut self, now: Instant, out: &mut [Outbox]) {
        for (bus, outbox) in out.iter_mut().enumerate() {
            if let Err(fault) = self.ask_nodes(now, bus, &mut outbox.acyclic) {
                self.fail(fault);
            }
        }
    }

    /// Lets the nodes of a bus ask, as many as there is room for, in turn. Beside setpoints that change only those are
    /// asked that are asked all the time, for which each cycle has room, and those that are told by SDO what R_PDOs may not
    /// tell them.
    fn ask_nodes(
        &mut self,
        now: Instant,
        bus: BusIndex,
        tx: &mut impl Transmit,
    ) -> Result<(), Fault> {
        let layout = Arc::clone(&self.layout);
        let layout::BusSpec {
            devices,
            sdo_per_cycle,
            ..
        } = &layout.buses[bus];
        let mut left = if self.sync_on {
            *sdo_per_cycle
        } else {
            devices.len()
        };
        let first = self.turn[bus];
        let mut events = event_sink(&mut self.events);
        for place in (0..devices.len()).map(|turn| (first + turn) % devices.len()) {
            let node = &mut self.nodes[devices[place]];
            let may_ask = !self.setpoints_change || node.is_polled() || node.is_told_by_sdo();
            let may_send = left > 0 && may_ask;
            if node.ask(now, may_send, tx, &mut events)? {
                left -= 1;
                self.turn[bus] = place + 1;
            }
        }
        Ok(())
    }
}
