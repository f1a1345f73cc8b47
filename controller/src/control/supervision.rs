//! What is looked at in every cycle, and what is done about what is found, by the table of
//! [`reaction`](super::reaction).
//!
//! Supervision goes on while the machine comes to rest after a fault: what follows is told and kept behind the first
//! cause, and may make the stop a harder one. A drive that was quick-stopped is out of it: nothing more is expected
//! of it than to come to rest.

use super::axis::AxisSample;
use super::fault::AxisCause;
use super::{Controller, Event, Fault, Goal, Phase, Reaction, Row, StopPoint, event_sink};
use syncline_canopen::Instant;
use syncline_drives::model::PowerState;

/// What drives are given time for, in cycles.
struct Times {
    /// To come to a state that they were told.
    patience: u64,
    /// To be seen standing still.
    still: u32,
    /// To reach the velocity of a test move.
    settling: u64,
}

impl<const N: usize> Controller<N> {
    /// Looks at drives and axes.
    pub(super) fn supervise(&mut self, now: Instant) {
        let runs = self.sync_on && (Phase::Lock..=Phase::Disable).contains(&self.phase);
        for node in &mut self.nodes {
            node.watch_standstill();
            node.watch_count(now, runs);
        }
        self.watch_spindle();
        let phase = self.phase;
        if (Phase::Square..=Phase::QuickStop).contains(&phase) {
            self.sample_axes();
        }
        if self.sync_on && self.is_faulty() && (Phase::Program..=Phase::Disable).contains(&phase) {
            for node in &mut self.nodes {
                node.watch_outputs();
            }
        }
        if self.sync_on && (Phase::QuickStop..=Phase::Disable).contains(&phase) {
            self.check_io_nodes(now);
        }
        if !self.sync_on || !(Phase::Lock..=Phase::Stop).contains(&phase) {
            return;
        }
        for drive in 0..self.nodes.len() {
            if let Err(fault) = self.check_drive(drive, phase, now) {
                self.fail(fault);
            }
        }
        let times = Times {
            patience: self.cycles(self.layout.state_timeout),
            still: self.still_cycles(),
            settling: self.test_settling(),
        };
        for axis in 0..self.axes.len() {
            if let Err(fault) = self.check_axis(axis, phase, &times) {
                self.fail(fault);
            }
        }
        let spindle = self.watch_cutting_speed();
        if let Err(fault) = spindle.and_then(|()| self.watch_orientation()) {
            self.fail(fault);
        }
    }

    /// While drives are switched off I/O nodes are still to be heard: their outputs are to become safe.
    fn check_io_nodes(&mut self, now: Instant) {
        for node in 0..self.nodes.len() {
            if !self.nodes[node].is_io_node() {
                continue;
            }
            let mut events = event_sink(&mut self.events);
            if let Err(fault) = self.nodes[node].check_alive(now, &mut events) {
                drop(events);
                self.fail(fault);
            }
        }
    }

    fn check_drive(&mut self, drive: usize, phase: Phase, now: Instant) -> Result<(), Fault> {
        let node = &mut self.nodes[drive];
        if node.is_quick_stopped() {
            return Ok(());
        }
        node.check_alive(now, &mut event_sink(&mut self.events))?;
        match phase {
            Phase::ModeStart => node.check_follows(false),
            Phase::Square | Phase::Program | Phase::Stop => node.check_follows(true),
            _ => node.check_no_fault(),
        }
    }

    fn check_axis(&mut self, axis: usize, phase: Phase, times: &Times) -> Result<(), Fault> {
        let Times {
            patience,
            still,
            settling,
        } = *times;
        let Self { nodes, .. } = self;
        let index = axis;
        let axis = &mut self.axes[index];
        if axis.is_quick_stopped(nodes) {
            return Ok(());
        }
        if phase == Phase::OperationEnabled {
            return axis.check_enabled(nodes);
        }
        if phase == Phase::ModeStart {
            axis.check_standstill(&axis.sample(self.cycle, nodes))?;
            return axis.check_feedback(nodes);
        }
        let Some(row) = &self.row else {
            return Ok(());
        };
        axis.watch_goer(patience, still, nodes)?;
        let unhalted = nodes[axis.drive()].watch_halt(still);
        if unhalted > patience {
            let time = self.layout.cycle.as_secs_f64() * unhalted as f64;
            return Err(Fault::Axis(index, AxisCause::NotHalted { time }));
        }
        axis.watch_test(self.cycle, settling, nodes)?;
        axis.check_jumps(nodes)?;
        axis.check_motion(self.cycle, &row.axes[axis.coordinate()], nodes)?;
        axis.check_feedback(nodes)
    }

    /// Compares what the axes did at this SYNC with the plan, and keeps it as the trace's row.
    fn sample_axes(&mut self) {
        if self.phase == Phase::QuickStop {
            self.follow_axes();
        }
        for axis in &mut self.axes {
            axis.follow(self.cycle, &self.nodes);
        }
        self.place_beside();
        let squares = self.axes.iter().any(|axis| axis.squares(self.cycle));
        if squares || self.planned.velocity.iter().any(|by| *by != 0.0) {
            self.moved = self.cycle;
        }
        let mut samples = [AxisSample::default(); N];
        let mut in_position = self.path_rests();
        for (index, axis) in self.axes.iter().enumerate() {
            let sample = &mut samples[axis.coordinate()];
            *sample = axis.sample(self.cycle, &self.nodes);
            sample.in_homing = self.homing.homes(index);
            in_position &= axis.is_in_position(sample);
        }
        self.in_position = if in_position { self.in_position + 1 } else { 0 };
        // A homing leads to where the switches are, and rests there between two legs.
        let mut plan = self.planned;
        plan.off_path |= self.beside_path.line().is_some();
        self.row = Some(Row {
            cycle: self
                .cycle
                .saturating_sub(self.mode_cycle.unwrap_or_default()),
            sync: self.syncs,
            at: self.sync_at,
            plan,
            axes: samples,
            functions: self.switches.functions,
            put_out: self.put_out(),
            spindle: self.sample_spindle(),
            analog_inputs: self.analog_inputs(),
            measured: self.sample_measured(),
            rests_for: match self
                .probing
                .line()
                .or(self.beside_path.line())
                .or(self.threading.line())
            {
                None => self.reached().and_then(|stop| match stop {
                    StopPoint::Pause { line, .. } => self.pause_told.then_some(line),
                    stop => stop.works_on(),
                }),
                line => line,
            },
            dwells_for: self.executor.dwell().and_then(|dwell| dwell.block),
            threads: self.threading.is_active(),
            waiting: None,
            along: self.along_samples.since(self.cycle),
        });
    }

    /// Axes that come to rest by themselves have no plan: it is where they are.
    fn follow_axes(&mut self) {
        for axis in &self.axes {
            let at = axis.coordinate();
            self.planned.position[at] = axis.sample(self.cycle, &self.nodes).act;
        }
        let zero = [0.0; N];
        (self.planned.velocity, self.planned.acceleration) = (zero, zero);
        self.planned.jerk = zero;
        (self.planned.speed, self.planned.feed) = (0.0, 0.0);
        (self.planned.busy, self.planned.off_path) = (false, true);
    }

    /// Records a fault and does what the table says: the first one has the machine go down, those that
    /// follow may still make a quick stop of it.
    pub(super) fn fail(&mut self, fault: Fault) {
        // Also one that says less than another one before has.
        if let Fault::Device(device, cause) = fault
            && cause.may_not_hear()
        {
            self.nodes[device].tell_by_sdo();
        }
        if self.faults.iter().any(|known| fault.repeats(known)) {
            return;
        }
        let is_first = !self.is_faulty();
        self.faults.push(fault);
        self.tell(Event::Fault(fault));
        if let Fault::Device(device, cause) = fault
            && cause.is_silence()
        {
            let mut events = event_sink(&mut self.events);
            self.nodes[device].see_power(PowerState::Unknown, &mut events);
        }
        if is_first {
            self.explain_search(&fault);
            let goes_off = !self.stays_on || self.end().is_some();
            self.goal = match goes_off {
                true => Goal::Off(super::End::Fault(fault)),
                false => Goal::Disabled,
            };
        }
        let powered = (Phase::OperationEnabled..=Phase::Stop).contains(&self.phase);
        if powered && self.stops_all(&fault) {
            self.enter(Phase::QuickStop, &mut []);
        } else if is_first {
            self.go_to(self.goal);
        }
        if self.phase == Phase::Stop && fault.cause().rule().reaction == Reaction::QuickStopAxis {
            self.quick_stop(|layout, drive| fault.concerns(layout, drive));
        }
    }

    /// Whether every drive is quick-stopped for a fault: by the table, because the machine file has all axes stop
    /// together, or because it concerns one side of a gantry.
    fn stops_all(&self, fault: &Fault) -> bool {
        match fault.cause().rule().reaction {
            Reaction::QuickStopAll => true,
            Reaction::QuickStopAxis if self.follows_plan() => {
                let layout = &self.layout;
                let of_a_pair = |axis: &super::layout::AxisSpec| {
                    let mut drives = axis.drives.iter();
                    axis.drives.len() > 1 && drives.any(|&drive| fault.concerns(layout, drive))
                };
                layout.stop_together || layout.axes.iter().any(of_a_pair)
            }
            _ => false,
        }
    }

    /// Whether axes may move, so that it matters how they come to rest.
    fn follows_plan(&self) -> bool {
        (Phase::Square..=Phase::Stop).contains(&self.phase)
    }

    /// Has drives come to rest by themselves.
    pub(super) fn quick_stop(&mut self, of: impl Fn(&super::Layout, usize) -> bool) {
        for drive in 0..self.nodes.len() {
            if of(&self.layout, drive) {
                self.nodes[drive].quick_stop();
            }
        }
    }

    /// Whether the drives that come to rest by themselves have, or have had the time for it.
    pub(super) fn quick_stops_rest(&self) -> bool {
        let cycles = self.still_cycles();
        self.nodes.iter().enumerate().all(|(drive, node)| {
            let rests = !node.status().power.may_be_on() || node.still() >= cycles;
            let waited = node.has_braked_for(self.braking_cycles(drive));
            !node.is_quick_stopped() || rests || waited || !self.is_in_reach(drive)
        })
    }

    /// So many cycles a drive is given to come to rest by itself: that of the spindle those of its ramp.
    fn braking_cycles(&self, drive: usize) -> u64 {
        let spindle = self.layout.spindle.as_ref();
        let spindle = spindle.filter(|it| it.drive == drive && self.nodes[drive].is_fresh());
        let least = self.layout.state_timeout;
        self.cycles(spindle.map_or(least, |it| it.reversal.max(least)))
    }

    /// Takes the power from drives that have not come to rest by themselves in time, whatever else is waited for: a spindle is
    /// given the time of its ramp.
    pub(super) fn disable_what_goes_on(&mut self) {
        let cycles = self.still_cycles();
        let most = self.cycles(self.layout.state_timeout);
        let spindle = self.layout.spindle.as_ref().map(|it| it.drive);
        for (drive, node) in self.nodes.iter_mut().enumerate() {
            let goes_on = node.has_braked_for(most) && node.still() < cycles;
            if goes_on && spindle != Some(drive) {
                node.switch_off();
            }
        }
    }
}
