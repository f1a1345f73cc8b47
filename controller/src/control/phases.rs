//! From power-up to a machine that is ready and from there to power-down, one phase after the other.

use super::InputWait;
use super::axis::AxisControl;
use super::beside_path::BesidePath;
use super::fault::{AwaitedState, DeviceCause, DeviceIndex, Fault};
use super::job::Aside;
use super::{
    COMMAND_CYCLES, Controller, DeviceNode, End, Event, Goal, Hold, NO_PLAN, Outcome, Pause, Phase,
    STILL, STILL_CYCLES, StopPoint, whole_nanos,
};
use crate::bus::Outbox;
use crate::machine::InputMeaning;
use std::mem::take;
use syncline_canopen::time::Duration;
use syncline_canopen::{Transmit, nmt};
use syncline_drives::model::PowerCommand;
use syncline_trajectory::path::Leg;

/// `#5399` behind an M66 whose input did not come (RS-274/NGC in LinuxCNC).
const NOT_IN_TIME: f64 = -1.0;

impl<const N: usize> Controller<N> {
    /// Does what the phase has to do in this cycle, and goes on to the next one when it is
    /// through.
    pub(super) fn step(&mut self, out: &mut [Outbox]) -> Result<(), Fault> {
        match self.phase {
            phase if phase < Phase::Program => self.step_up(out),
            Phase::Program => {
                let late = self.executor.late_plans();
                if std::mem::replace(&mut self.late_plans, late) < late {
                    self.tell(Event::LatePlan);
                }
                self.step_program();
                self.tell_waiting();
                self.watch_plan()
            }
            _ => {
                self.step_down(out);
                Ok(())
            }
        }
    }

    /// On the way from power-up to *ready*; it is left by the first fault.
    fn step_up(&mut self, out: &mut [Outbox]) -> Result<(), Fault> {
        match self.phase {
            Phase::Survey => self.step_survey(out),
            Phase::Boot => {
                if self.timed_out(self.layout.boot_timeout) {
                    let missing = self.nodes.iter().position(|node| !node.has_booted());
                    missing.map_or(Ok(()), |drive| Err(self.nodes[drive].did_not_boot()))?;
                }
                let booted = self.nodes.iter().all(DeviceNode::has_booted);
                self.go_on_if(booted, Phase::SetUp, out);
            }
            Phase::SetUp => self.go_on_if(self.sequences_done(), Phase::Start, out),
            Phase::Start => {
                if self.cycle > self.phase_cycle && !self.acted {
                    self.acted = true;
                    self.send_nmt(nmt::Command::Start, out);
                }
                let started = |node: &DeviceNode| node.is_sampled() && node.is_operational();
                if self.timed_out(self.layout.boot_timeout)
                    && let Some(drive) = self.nodes.iter().position(|node| !started(node))
                {
                    return Err(self.nodes[drive].did_not_start());
                }
                let started = self.nodes.iter().all(started);
                self.go_on_if(started, Phase::Lock, out);
            }
            Phase::Lock => {
                let locked = self.sequences_done();
                if locked {
                    self.recall_references();
                    for axis in &mut self.axes {
                        axis.begin_compensating();
                        axis.count_from_here(&mut self.nodes)?;
                        axis.locate(&self.nodes)?;
                    }
                }
                self.go_on_if(locked, Phase::Disabled, out);
            }
            Phase::Disabled if self.goal == Goal::Ready => {
                for axis in &mut self.axes {
                    axis.begin_compensating();
                    axis.learn_place(&mut self.nodes)?;
                }
                self.await_all(AwaitedState::Disabled, Phase::ReadyToSwitchOn, out)?;
            }
            Phase::Disabled => {}
            Phase::ReadyToSwitchOn if self.sequences_done() => {
                let has_torque = self.torque_returns();
                if has_torque {
                    self.await_all(AwaitedState::Ready, Phase::OperationEnabled, out)?;
                }
            }
            Phase::OperationEnabled => {
                self.watch_sides()?;
                let cycles = self.still_cycles();
                let moving = self.nodes.iter().position(|node| node.still() < cycles);
                match moving {
                    Some(drive) if self.timed_out(self.layout.state_timeout) => {
                        return Err(Fault::Device(drive, DeviceCause::NotAtRest));
                    }
                    Some(_) => {}
                    None => self.await_all(AwaitedState::Enabled, Phase::ModeStart, out)?,
                }
            }
            Phase::ModeStart if self.sequences_done() => {
                let mut axes = self.axes.iter();
                let out_of_square =
                    axes.any(|it| it.out_of_square(self.cycle, &self.nodes).is_some());
                let next = match out_of_square {
                    true => Phase::Square,
                    false => Phase::Program,
                };
                self.await_all(AwaitedState::ModeStarted, next, out)?;
            }
            Phase::Square => self.await_squares(out)?,
            _ => {}
        }
        Ok(())
    }

    /// On the way down, which goes on whatever fails.
    fn step_down(&mut self, out: &mut [Outbox]) {
        match self.phase {
            Phase::Stop => {
                let settled = self.in_position >= self.still_cycles();
                let waited = self.timed_out(self.layout.state_timeout);
                self.disable_what_goes_on();
                let adjusts =
                    |axis: &AxisControl| axis.squares(self.cycle) || !axis.is_compensated();
                let adjusts = self.axes.iter().any(adjusts);
                let stopped = self.quick_stops_rest();
                // One that never rests is a fault in time, and quick-stopped by that.
                let rests = self.path_rests() && !adjusts && stopped && self.goers_rest();
                let over = rests && (settled || waited || self.is_faulty());
                if !over || self.goal == Goal::Ready && !self.let_go_of_stops(settled) {
                    return;
                }
                // What is left of a target goes with the power.
                if self.goal == Goal::Ready && !self.has_goers() {
                    self.rest_after(Outcome::Stopped);
                    self.enter(Phase::Program, out);
                } else if self.spindle_rests() {
                    self.end_job(match self.end() {
                        Some(End::Finished) => Outcome::Finished,
                        _ => Outcome::Stopped,
                    });
                    self.enter(Phase::ModeEnd, out);
                }
            }
            Phase::QuickStop => {
                let seen = self.cycle >= self.phase_cycle + COMMAND_CYCLES;
                self.disable_what_goes_on();
                if seen && self.quick_stops_rest() {
                    self.end_job(Outcome::Stopped);
                    self.enter(Phase::Disable, out);
                }
            }
            Phase::ModeEnd => self.await_some(AwaitedState::ModeEnded, Phase::ShutDown, out),
            // Where a drive has a brake, it holds before 0000h takes what is left of the torque.
            Phase::ShutDown => self.await_some(AwaitedState::Disabled, Phase::Disable, out),
            Phase::Disable => {
                let goes_off = self.end().is_some();
                let next = if goes_off {
                    Phase::Release
                } else {
                    Phase::Disabled
                };
                self.await_some(AwaitedState::Disabled, next, out);
            }
            Phase::Release => self.go_on_if(self.sequences_done(), Phase::PreOperational, out),
            Phase::PreOperational => {
                let sent = self.cycle >= self.phase_cycle + COMMAND_CYCLES;
                let goes_off = self.end().is_some();
                let next = if goes_off {
                    Phase::Done
                } else {
                    Phase::Disabled
                };
                self.sync_on &= !sent;
                self.go_on_if(sent, next, out);
            }
            _ => {}
        }
    }

    /// Enters a phase: what it sends or asks once.
    pub(super) fn enter(&mut self, phase: Phase, out: &mut [Outbox]) {
        self.phase = phase;
        self.aside = Aside::None;
        self.phase_cycle = self.cycle;
        self.acted = false;
        self.tell(Event::Phase(phase));
        self.ask(DeviceNode::end_reset);
        match phase {
            Phase::Survey => self.ask(DeviceNode::ask_survey),
            Phase::Boot => {
                self.ask(DeviceNode::ask_boot);
                self.commands_nodes = true;
                self.send_nmt(nmt::Command::ResetCommunication, out);
            }
            Phase::SetUp => self.ask(DeviceNode::ask_set_up),
            Phase::Start => {
                self.sync_on = true;
                self.ask(DeviceNode::begin_polls);
            }
            Phase::Lock => self.ask(DeviceNode::ask_lock),
            Phase::Disabled => {
                self.frozen = false;
                self.set_power(PowerCommand::Disable);
                if !self.left_to_another {
                    self.ask(DeviceNode::release_torque);
                }
                self.keep_references();
            }
            Phase::Disable => {
                self.set_power(PowerCommand::Disable);
                self.ask(DeviceNode::switch_off_by_sdo);
            }
            Phase::ReadyToSwitchOn | Phase::ShutDown => {
                self.set_power(PowerCommand::Prepare);
                if phase == Phase::ReadyToSwitchOn {
                    self.return_from_homing();
                }
            }
            Phase::OperationEnabled => {
                self.ask(DeviceNode::forget_standstill);
                self.axes.iter_mut().for_each(AxisControl::forget_motion);
                self.set_power(PowerCommand::Enable);
            }
            Phase::ModeEnd => self.ask(DeviceNode::end_mode),
            Phase::ModeStart => {
                if let Err(fault) = self.freeze() {
                    return self.fail(fault);
                }
                self.set_power(PowerCommand::Run);
                self.ask(DeviceNode::ask_mode);
            }
            Phase::Square => {
                self.mode_cycle.get_or_insert(self.cycle + 1);
                if let Err(fault) = self.take_square() {
                    self.fail(fault);
                }
            }
            Phase::Program => {
                self.mode_cycle.get_or_insert(self.cycle + 1);
                if !self.stays_on
                    && let Err(fault) = self.home_at_start()
                {
                    return self.fail(fault);
                }
                if let Some(input) = self.holding_input().filter(|_| self.job.is_some()) {
                    self.hold_path(Hold::Input(input));
                }
            }
            Phase::Stop => {
                self.abort_homing();
                self.probing.abort();
                self.beside_path = BesidePath::new();
                if self.threading.is_active() {
                    self.leave_thread();
                }
                self.threading.abort();
                self.leave_samples();
                self.stop_squaring();
                self.stop_path();
                self.positioning = None;
                self.let_go(false);
            }
            Phase::QuickStop => {
                self.cut_homing_off();
                self.probing.abort();
                self.beside_path = BesidePath::new();
                self.tell_tap_left();
                self.threading.abort();
                self.along_samples.abort();
                self.frozen = false;
                self.quick_stop(|_, _| true);
            }
            Phase::Release => {
                self.keep_references();
                self.ask_release();
            }
            Phase::PreOperational => self.leave_nodes(out),
            Phase::Done => self.sync_on = false,
        }
    }

    /// Goes there from wherever the machine is; the way down ends at what is wanted then.
    pub(super) fn go_to(&mut self, goal: Goal) {
        self.goal = goal;
        let next = match self.phase {
            Phase::Survey => self.leave_survey(),
            Phase::Boot | Phase::SetUp | Phase::Start | Phase::Lock => Phase::Release,
            Phase::Disabled if !self.sync_on => match goal {
                Goal::Off(_) if self.left_to_another => Phase::PreOperational,
                Goal::Off(_) => Phase::Release,
                Goal::Ready | Goal::Disabled => return,
            },
            Phase::Disabled | Phase::ReadyToSwitchOn | Phase::OperationEnabled => Phase::ShutDown,
            Phase::ModeStart => Phase::ModeEnd,
            Phase::Square | Phase::Program => Phase::Stop,
            Phase::Stop
            | Phase::QuickStop
            | Phase::ModeEnd
            | Phase::ShutDown
            | Phase::Disable
            | Phase::Release
            | Phase::PreOperational
            | Phase::Done => return,
        };
        // Nothing on these phases' entry is sent at once.
        self.enter(next, &mut []);
    }

    /// Enables drives that are disabled.
    pub(super) fn enable(&mut self) {
        self.goal = Goal::Ready;
        self.resets = false;
        if self.sync_on {
            self.enter(Phase::Disabled, &mut []);
        } else {
            self.bring_up();
        }
    }

    /// Brings the drives back after a fault. Whatever became of them meanwhile, they are found, reset
    /// and set up as after power-up, which resets their errors.
    pub(super) fn reset(&mut self) {
        self.faults.clear();
        self.goal = Goal::Ready;
        self.resets = true;
        self.bring_up();
    }

    /// Switches the machine off, unless that is under way.
    pub(super) fn switch_off(&mut self) {
        if self.end().is_none() {
            let end = self
                .faults
                .first()
                .map_or(End::SwitchedOff, |first| End::Fault(*first));
            self.go_to(Goal::Off(end));
        }
    }

    /// Begins as after power-up.
    fn bring_up(&mut self) {
        self.sync_on = false;
        self.sync_sent = None;
        self.left_to_another = false;
        self.nodes.iter_mut().for_each(DeviceNode::forget);
        for bus in 0..self.misses.len() {
            self.misses[bus].forgive();
            self.lost[bus] = false;
        }
        self.enter(Phase::Survey, &mut []);
        self.acted = true;
    }

    /// Comes to rest on the path, and through the shaper; for a fault as soon as the axes can, past it.
    fn stop_path(&mut self) {
        if self.is_faulty() && !self.shaping.is_settled() {
            let travel = self.travel();
            self.executor.stop_beside(&self.planned, &travel);
            self.shaping.bypass();
        } else {
            self.executor.stop();
        }
    }

    fn step_program(&mut self) {
        if self.homing.is_active() {
            return self.step_homing();
        }
        if self.probing.is_active() {
            return self.step_probing();
        }
        if self.threading.is_active() {
            if let Err(fault) = self.step_thread() {
                self.fail(fault);
            }
            return;
        }
        if self.along_samples.is_active() {
            if self.end_samples() {
                self.end_program();
            }
            return;
        }
        if self.job.is_none() {
            let rests = self.executor.is_at_rest() && self.axes_rest();
            if self.executor.is_off_path() && rests {
                self.rest_here();
            }
            return;
        }
        self.feed_by_turns();
        // A jog of what is held already is no going on; on its way back it is held once it stands.
        let jogs = self.planned.off_path && self.held;
        let stands = match self.planned.off_path {
            true => self.planned.velocity == [0.0; N],
            false => self.planned.speed == 0.0,
        };
        let rests = self.executor.is_held() && (jogs || stands && self.axes_rest());
        let leg = self.executor.next_leg();
        if leg != self.told_leg {
            self.told_leg = leg;
            if let Some(leg) = leg {
                self.tell(Event::NextLeg(Leg {
                    to: std::array::from_fn(|axis| leg.to.get(axis).copied().flatten()),
                    speed: leg.speed,
                    last: leg.last,
                }));
            }
        }
        let came_from = self.retraced_from.take_if(|_| rests);
        if self.executor.retraces() && came_from == Some(self.planned.distance) {
            self.tell(Event::NoWayBack);
        }
        self.tell_hold(rests);
        // The path may be held, or on its way back from where it was retraced or jogged to.
        let waits_here = self.path_rests() && !self.executor.is_off_path();
        let is_theirs = matches!(self.reached(), Some(StopPoint::PointToPoint { .. }));
        self.let_go(waits_here && is_theirs && !self.executor.is_held());
        if !matches!(
            self.reached(),
            Some(StopPoint::AwaitInput { .. } | StopPoint::Orient { .. })
        ) {
            self.awaited = None;
        }
        if self.path_rests() && !self.switches.lag(self.executor.waypoints()) {
            self.serve_stop_point();
        }
    }

    /// Does what the program has at the mark where the path rests.
    fn serve_stop_point(&mut self) {
        match self.reached() {
            Some(StopPoint::Pause { .. }) if self.pause_told => {}
            Some(StopPoint::Pause {
                reason: Pause::OptionalStop,
                ..
            }) if !self.optional_stop => self.executor.pass(),
            Some(StopPoint::Pause { reason, line }) => {
                self.pause_told = true;
                if let Pause::ToolChange(asked) = reason {
                    self.ask_for_tool(asked);
                }
                self.tell(Event::Paused { line, reason });
            }
            None => {}
            Some(StopPoint::Rest) => self.executor.pass(),
            Some(StopPoint::AwaitInput { wait, asks, line }) if !self.pause_told => {
                self.await_input(wait, asks, line);
            }
            Some(StopPoint::TakeInput { input, .. }) => self.take_input(input),
            Some(StopPoint::UserCode { call, within, line }) if !self.pause_told => {
                self.await_user_code(call, within, line);
            }
            Some(StopPoint::Orient { line }) if !self.pause_told => self.await_orientation(line),
            Some(
                StopPoint::AwaitInput { .. }
                | StopPoint::Orient { .. }
                | StopPoint::UserCode { .. },
            ) => {}
            Some(stop) if stop.leaves_path() && self.executor.retraces() => {
                // It was to go back, and could not come to rest before; nothing leads back over the move.
                self.tell(Event::NoWayBack);
                self.executor.feed_hold();
            }
            Some(StopPoint::PointToPoint { motion, .. }) => {
                if let Err(fault) = self.step_point_to_point(&motion) {
                    self.fail(fault);
                }
            }
            Some(StopPoint::Probe { line }) => self.begin_probing(line),
            Some(StopPoint::Thread { line }) => self.begin_thread(line),
            Some(StopPoint::Home { line }) => self.begin_program_homing(line),
            Some(StopPoint::ReadSignals { number, .. }) => self.read_signals(number),
            Some(StopPoint::End) if self.begin_samples() => {}
            Some(StopPoint::End) => self.end_program(),
            Some(StopPoint::Broken) if self.stays_on => self.rest_after(Outcome::Broken),
            Some(StopPoint::Broken) => self.fail(Fault::Program),
        }
    }

    /// The program is at its end, and the axes rest.
    fn end_program(&mut self) {
        match self.stays_on {
            true => self.rest_after(Outcome::Finished),
            false => self.go_to(Goal::Off(End::Finished)),
        }
    }

    /// The axes are where the executor has them: through the shaper, and with their backlash taken up.
    pub(super) fn axes_rest(&self) -> bool {
        self.shaping.is_settled() && self.axes.iter().all(AxisControl::is_compensated)
    }

    /// The path has come to rest, and the axes are where that is.
    pub(super) fn path_rests(&self) -> bool {
        self.executor.is_idle() && self.axes_rest()
    }

    /// The job is over, and the machine stays ready.
    pub(super) fn rest_after(&mut self, outcome: Outcome) {
        self.end_job(outcome);
        self.rest_here();
    }

    /// The path goes on with the input that it rests for, or rests until an operator goes on.
    fn await_input(&mut self, wait: InputWait, asks: bool, line: u32) {
        let came = self.awaited(wait);
        if came.is_some() {
            self.awaited = None;
        }
        if let (Some(came), InputMeaning::Program(_)) = (came, wait.input) {
            self.input_result = match wait.until {
                _ if !came => NOT_IN_TIME,
                until => f64::from(u8::from(until.is_on())),
            };
        }
        match came {
            Some(true) => self.executor.pass(),
            Some(false) if asks => self.executor.pass(),
            Some(false) => {
                self.pause_told = true;
                let reason = match wait.input {
                    InputMeaning::Program(number) => Pause::NoInput(number),
                    _ => Pause::NotAtSpeed,
                };
                self.tell(Event::Paused { line, reason });
            }
            None => {}
        }
    }

    /// Where the path could go on and no plan comes for long, none ever will.
    fn watch_plan(&mut self) -> Result<(), Fault> {
        let waits = self.begun
            && self.phase == Phase::Program
            && self.takes_plan()
            && self.executor.wants_plan();
        self.unplanned = if waits { self.unplanned + 1 } else { 0 };
        if self.unplanned > self.cycles(NO_PLAN) && !self.job.is_some_and(|job| job.waits_for_input)
        {
            return Err(Fault::NoPlan);
        }
        Ok(())
    }

    /// Freezes every drive's setpoint where it stands; the plan starts there.
    fn freeze(&mut self) -> Result<(), Fault> {
        self.ask(DeviceNode::hold);
        self.positioning = None;
        let mut position = [0.0; N];
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            let frozen = axis.freeze(&mut self.nodes)?;
            position[axis.coordinate()] = frozen;
            if let Some(apart) = axis.askew(self.cycle) {
                self.tell(Event::Askew { axis: index, apart });
            }
            self.tell(Event::Frozen {
                axis: index,
                position: frozen,
            });
        }
        self.executor.restart(position);
        self.forget_contact();
        if let Some(job) = self.job {
            // Nothing can have been switched by hand before.
            self.switches.begin(&self.layout, &job, |_| ());
        }
        self.plan_from_rest();
        self.frozen = true;
        Ok(())
    }

    /// Gantries that stand a little askew are taken square, but after a reset, which moves nothing, and while a door
    /// is open or the input for feed hold is on.
    fn take_square(&mut self) -> Result<(), Fault> {
        if self.resets || self.holding_input().is_some() {
            return self.keep_apart();
        }
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            if let Some(apart) = axis.out_of_square(self.cycle, &self.nodes) {
                axis.square(self.cycle + 1);
                self.tell(Event::OutOfSquare {
                    axis: index,
                    apart,
                    stays: false,
                });
            }
        }
        Ok(())
    }

    /// Gantries that are out of square stay so.
    fn keep_apart(&mut self) -> Result<(), Fault> {
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            if let Some(apart) = axis.out_of_square(self.cycle, &self.nodes) {
                axis.keep_apart(self.cycle, &mut self.nodes)?;
                self.tell(Event::OutOfSquare {
                    axis: index,
                    apart,
                    stays: true,
                });
            }
        }
        Ok(())
    }

    /// The sides of gantries come to rest against each other.
    pub(super) fn stop_squaring(&mut self) {
        for axis in &mut self.axes {
            axis.stop_squaring(self.cycle + 1);
        }
    }

    /// The machine is ready once the sides of its gantries rest against each other, square or where they were stopped.
    ///
    /// # Errors
    /// An axis does not come to rest where it is planned.
    fn await_squares(&mut self, out: &mut [Outbox]) -> Result<(), Fault> {
        let check =
            |axis: &AxisControl| axis.check_standstill(&axis.sample(self.cycle, &self.nodes));
        let settled = self.axes.iter().try_for_each(check);
        let rested = self.cycle - self.moved.max(self.phase_cycle);
        if settled.is_err() && rested > self.cycles(self.layout.state_timeout) {
            return settled;
        }
        // No side moves any more, also of drives that are sent their setpoints later.
        if settled.is_ok() && rested >= self.still_cycles().into() {
            self.keep_apart()?;
            self.enter(Phase::Program, out);
        }
        Ok(())
    }

    fn go_on_if(&mut self, through: bool, next: Phase, out: &mut [Outbox]) {
        if through {
            self.enter(next, out);
        }
    }

    /// Whether the two sides of each gantry are enabled about together: one that pulls alone turns the
    /// beam. They are told in one burst, and where one does not follow both are disabled.
    fn watch_sides(&mut self) -> Result<(), Fault> {
        let mut axes = self.axes.iter_mut();
        let Some(drive) = axes.find_map(|axis| axis.lagging_side(&self.nodes)) else {
            return Ok(());
        };
        let awaited = AwaitedState::Enabled;
        let word = self.nodes[drive].status().word;
        Err(Fault::Device(
            drive,
            DeviceCause::StateTimeout { awaited, word },
        ))
    }

    /// Goes on once every drive reports what is `awaited`; one that does not in time is a fault.
    fn await_all(
        &mut self,
        awaited: AwaitedState,
        next: Phase,
        out: &mut [Outbox],
    ) -> Result<(), Fault> {
        let missing = self
            .nodes
            .iter()
            .position(|node| !node.has_reached(awaited));
        self.go_on_without(missing, awaited, next, out)
    }

    /// Goes on if no drive is `missing`; if one is for too long, that is a fault.
    fn go_on_without(
        &mut self,
        missing: Option<usize>,
        awaited: AwaitedState,
        next: Phase,
        out: &mut [Outbox],
    ) -> Result<(), Fault> {
        match missing {
            None => {
                let seen = self.cycle >= self.phase_cycle + COMMAND_CYCLES;
                self.go_on_if(seen, next, out);
                Ok(())
            }
            Some(drive) if self.timed_out(self.layout.state_timeout) => {
                let word = self.nodes[drive].status().word;
                Err(Fault::Device(
                    drive,
                    DeviceCause::StateTimeout { awaited, word },
                ))
            }
            Some(_) => Ok(()),
        }
    }

    /// On the way down: as [`Self::await_all`], but goes on in any case, and waits for nobody out of
    /// reach. A drive that fell silent is given the time for its brake, and said to be silent instead of
    /// in the state that it named last.
    fn await_some(&mut self, awaited: AwaitedState, next: Phase, out: &mut [Outbox]) {
        let mut missing = None;
        for drive in 0..self.nodes.len() {
            let node = &self.nodes[drive];
            if !self.is_in_reach(drive) || node.has_reached(awaited) {
                continue;
            }
            match node.check_answers() {
                Ok(()) => missing = missing.or(Some(drive)),
                Err(silent) => {
                    let brakes = self.phase == Phase::ShutDown;
                    let waits = brakes && !self.timed_out(self.layout.state_timeout);
                    self.fail(silent);
                    if waits {
                        return;
                    }
                }
            }
        }
        if let Err(fault) = self.go_on_without(missing, awaited, next, out) {
            // Also where it is not the first one: this drive may still be enabled.
            self.fail(fault);
            self.enter(next, out);
        }
    }

    /// [`STILL`] in cycles.
    pub(super) fn still_cycles(&self) -> u32 {
        STILL_CYCLES.max(self.cycles(STILL) as u32)
    }

    /// So long in cycles, rounded up.
    pub(super) fn cycles(&self, time: Duration) -> u64 {
        whole_nanos(time).div_ceil(whole_nanos(self.layout.cycle))
    }

    pub(super) fn timed_out(&self, limit: Duration) -> bool {
        self.layout.cycle * (self.cycle - self.phase_cycle) as u32 >= limit
    }

    pub(super) fn is_faulty(&self) -> bool {
        !self.faults.is_empty()
    }

    pub(super) fn sequences_done(&self) -> bool {
        let mut devices = (0..self.nodes.len()).filter(|&device| self.is_in_reach(device));
        devices.all(|device| self.nodes[device].is_sequence_done())
    }

    /// Whether the device's bus carries frames.
    pub(super) fn is_in_reach(&self, device: DeviceIndex) -> bool {
        !self.lost[self.layout.devices[device].bus]
    }

    fn ask_release(&mut self) {
        self.set_outputs();
        for drive in 0..self.nodes.len() {
            let in_reach = self.is_in_reach(drive);
            self.nodes[drive].ask_release(in_reach);
        }
    }

    fn ask(&mut self, what: impl Fn(&mut DeviceNode)) {
        self.nodes.iter_mut().for_each(what);
    }

    fn set_power(&mut self, power: PowerCommand) {
        self.ask(|node| node.power = power);
    }

    /// Takes nodes out of Operational that were commanded: those that were only looked at may be another controller's.
    fn leave_nodes(&mut self, out: &mut [Outbox]) {
        if take(&mut self.commands_nodes) {
            self.send_nmt(nmt::Command::EnterPreOperational, out);
        }
    }

    fn send_nmt(&self, command: nmt::Command, out: &mut [Outbox]) {
        for (bus, outbox) in self.layout.buses.iter().zip(out) {
            for &device in &bus.devices {
                outbox.acyclic.transmit(self.nodes[device].nmt(command));
            }
        }
    }
}
