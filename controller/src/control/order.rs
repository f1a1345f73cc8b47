//! What the session, or the program's feeder, orders.

use super::state::{NotNow, Request};
use super::{
    Controller, Event, Goal, Hold, HomingFailure, Job, JobKind, State, StopPoint, ZeroOverrides,
};
use crate::machine::COORDINATES;
use std::mem::take;
use strum::VariantNames;
use syncline_gcode::AxisLetter;
use syncline_trajectory::path::{Jog, JogError, Overrides};

/// An order to the controller; it is obeyed in the next cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order<const N: usize = COORDINATES> {
    /// Begins a job where the machine rests. Its plan is asked for then.
    /// Lines that are typed in set aside a program that is held.
    Begin(Job),
    /// Begins the rest of the program that was set aside, likewise.
    TakeUp(Job),
    /// Ends a pause: program stop, tool change.
    CycleStart,
    /// Rests on the path.
    FeedHold,
    /// Ends a feed hold, also one that a single block came to.
    Resume,
    /// [`Order::Resume`] while held, otherwise, also at rest for want of speed, [`Order::FeedHold`].
    ToggleFeedHold,
    /// Whether the path rests at the end of every block.
    SingleBlock(bool),
    /// Whether the program waits for an operator at M1.
    OptionalStop(bool),
    /// Goes back to the beginning of the block and rests there.
    Retrace,
    /// Moves axes while the path rests: held, at a pause, or without a job.
    Jog(Jog<N>),
    /// Renews the continuous jog of the axis with this coordinate; of one that rests or moves otherwise
    /// changes nothing.
    RenewJog(usize),
    /// Ends the continuous jog of the axis with this coordinate, as [`Order::RenewJog`] renews it.
    EndJog(usize),
    /// Part of the programmed feeds, 0…2.
    FeedOverride(f64),
    /// Part of the rapids' speed, 0…1.
    RapidOverride(f64),
    /// Stops on the path; the job is over. A machine that was switched on for one job goes off.
    Interrupt,
    /// The job with this number cannot go on.
    Abandon(u64),
    /// The command of an M-code of the user's has ended.
    UserCodeEnded {
        /// As in [`Event::UserCode`].
        number: u32,
        /// Whether it has ended well.
        ok: bool,
    },
    /// Enables the drives.
    Enable,
    /// Disables the drives, once what moves has come to rest.
    Disable,
    /// Homes the axes with these coordinates; without any, all but those that an operator homes by hand.
    Home([bool; N]),
    /// Brings the drives back after a fault: found, set up and enabled anew, without a motion.
    Reset,
    /// Switches an output of the machine by hand.
    Switch {
        /// Its place in the machine file.
        output: usize,
        /// Whether it is on then.
        on: bool,
    },
    /// Switches the machine off, once what moves has come to rest.
    SwitchOff,
    /// Nothing of the cycle's: what the session does by itself has its cycle and its turn among the orders.
    Nothing,
}

/// Why an order is refused, and what to do.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error, VariantNames)]
pub enum Refusal {
    /// The state of the machine forbids it.
    #[error(transparent)]
    NotNow(#[from] NotNow),
    /// It would set something in motion while a door is open.
    #[error("a door is open: close it, then go on")]
    DoorOpen,
    /// It would set something in motion while the input for feed hold is on.
    #[error("the input for feed hold is on: switch it off, then go on")]
    FeedHoldOn,
    /// A jog cannot be.
    #[error("not moved: {}", why_no_jog(*.0))]
    Jog(JogError),
    /// The axis with this coordinate is not referenced.
    #[error("axis {} is not referenced: home it first", letter(*.0))]
    Unreferenced(usize),
    /// The sides of the axis with this coordinate are too far apart.
    #[error("the sides of axis {} are too far apart: home it to take it square", letter(*.0))]
    Askew(usize),
    /// The axis with this coordinate has not made its test move.
    #[error("axis {} has not made its test move: home it first", letter(*.0))]
    Untested(usize),
    /// The axis with this coordinate knows where it is.
    #[error("axis {} has an absolute encoder: there is nothing to home", letter(*.0))]
    Absolute(usize),
    /// The axis with this coordinate is on a limit switch, beyond which the order leads, or may lead.
    #[error("axis {} is on its {} limit switch: jog it off first", letter(*.axis), if *.positive { "positive" } else { "negative" })]
    OnLimit {
        /// Its coordinate.
        axis: usize,
        /// The switch is that of the positive end.
        positive: bool,
    },
    /// The axis with this coordinate follows no path.
    #[error("axis {} goes point to point and cannot be jogged: type a line that moves it", letter(*.0))]
    PointToPoint(usize),
    /// No axis has this coordinate.
    #[error("the machine has no axis {}", letter(*.0))]
    NoSuchAxis(usize),
    /// It would lead away from a probing.
    #[error("not while the program probes: resume, or stop")]
    Probing,
    /// It would take the axes out of step with the spindle.
    #[error("not while a thread is cut, which ends by itself: wait for that, or stop")]
    Threading,
    /// Axes move beside the path, or are about to, and it waits for them.
    #[error("axes move beside the path, which nothing takes back: feed hold and resume, or stop")]
    NoWayBack,
    /// Nothing is left of the programmed speed, so that nothing would move.
    #[error("{0}")]
    NoSpeed(ZeroOverrides),
    /// It needs the axes at rest.
    #[error("axes move: feed hold, wait until they rest, then command it again")]
    Moving,
    /// What is held are typed lines themselves.
    #[error("typed lines are held already: resume or stop them first")]
    LinesHeld,
    /// The program that was held is not the cycle's any more.
    #[error(
        "the program was left for typed lines, and nothing leads back from here: resume reads it anew, stop gives it up"
    )]
    SetAside,
    /// A program that is held has not come to its first block.
    #[error(
        "the program is still to begin, with the outputs as they were: stop it, switch, and begin it again"
    )]
    NotBegun,
    /// Nothing of a program was gone along that is still to begin.
    #[error(
        "the program is still to begin, and nothing leads back: wait until it moves, or stop it"
    )]
    NothingBehind,
    /// Cycle start ends a pause, and nothing else that holds the path.
    #[error("the path is held: resume goes on")]
    FeedHeld,
    /// No axis is homed unless it is named.
    #[error("nothing is to be homed but what an operator homes by hand: name the axes")]
    NothingToHome,
    /// No axis is homed at all.
    #[error("all axes have absolute encoders: there is nothing to home")]
    AllAbsolute,
}

impl<const N: usize> Order<N> {
    /// What it asks of the machine's state; `None` for what no operator orders.
    #[must_use]
    pub fn request(&self) -> Option<Request> {
        Some(match self {
            Self::Begin(job) => match job.kind {
                JobKind::Program => Request::Begin,
                JobKind::Mdi => Request::TypedLines,
            },
            Self::TakeUp(_) | Self::CycleStart | Self::Resume | Self::Retrace => Request::GoOn,
            Self::FeedHold | Self::ToggleFeedHold => Request::FeedHold,
            Self::Jog(_) => Request::Jog,
            Self::Home(_) => Request::Home,
            Self::FeedOverride(_)
            | Self::RapidOverride(_)
            | Self::SingleBlock(_)
            | Self::OptionalStop(_)
            | Self::RenewJog(_) => Request::Set,
            Self::Interrupt | Self::EndJog(_) => Request::Stop,
            Self::Enable => Request::Enable,
            Self::Disable => Request::Disable,
            Self::Reset => Request::Reset,
            Self::SwitchOff => Request::SwitchOff,
            Self::Switch { .. } => Request::Switch,
            Self::Abandon(_) | Self::UserCodeEnded { .. } | Self::Nothing => return None,
        })
    }
}

impl<const N: usize> Controller<N> {
    /// Goes back along the path, to the beginning of the block that it is on.
    fn retrace(&mut self) -> Result<(), Refusal> {
        if self.probing.is_active() {
            return Err(Refusal::Probing);
        }
        if self.awaits_instructions() {
            return Err(Refusal::NothingBehind);
        }
        if self.reached().is_some_and(StopPoint::leaves_path) {
            return Err(Refusal::NoWayBack);
        }
        // From the beginning of a block on into the one before, only once the axes have come there: what is shaped
        // would cut the corner.
        if self.executor.retraces() && self.executor.is_held() && !self.axes_rest() {
            return Err(Refusal::Moving);
        }
        self.retraced_from = (self.planned.speed == 0.0).then_some(self.planned.distance);
        // A pause that is told comes again when the path has come back to it.
        if take(&mut self.pause_told) {
            self.tell(Event::Retracing);
        }
        self.executor.retrace();
        Ok(())
    }

    /// Does what is ordered.
    ///
    /// # Errors
    /// Why it is refused; nothing changes then.
    pub fn obey(&mut self, order: Order<N>) -> Result<(), Refusal> {
        let state = self.state();
        if let Some(request) = order.request()
            && !state.allows(request)
        {
            return Err(NotNow { request, state }.into());
        }
        if let Some(input) = self.holding_input().filter(|_| self.moves(order)) {
            return Err(match self.is_door(input) {
                true => Refusal::DoorOpen,
                false => Refusal::FeedHoldOn,
            });
        }
        self.check_references(&order)?;
        self.check_limit_switches(&order)?;
        let leads_on = matches!(order, Order::CycleStart | Order::Resume | Order::Retrace);
        if self.rests_aside() && leads_on {
            return Err(Refusal::SetAside);
        }
        if let Some(overrides) = self.lacks_speed(&order) {
            return Err(Refusal::NoSpeed(overrides));
        }
        if order == Order::CycleStart && state == State::Held && !self.awaits_cycle_start() {
            return Err(Refusal::FeedHeld);
        }
        // What it begins with was told as it was begun.
        if matches!(order, Order::Switch { .. }) && self.awaits_instructions() {
            return Err(Refusal::NotBegun);
        }
        match order {
            Order::FeedHold | Order::ToggleFeedHold if state == State::Homing => {
                self.interrupt_homing(HomingFailure::Held);
            }
            Order::Begin(lines) if state == State::Held => self.begin_beside(lines)?,
            Order::Begin(job) => self.begin(job),
            Order::TakeUp(job) => self.take_up(job)?,
            Order::CycleStart => self.go_on(),
            Order::FeedHold => self.hold_path(Hold::Operator),
            Order::Resume => self.resume_path(),
            Order::ToggleFeedHold => {
                // Without a job there is no path to go back to: what is jogged stops.
                let held = self.job.is_some() && self.is_path_held();
                if held && !self.executor.wants_speed() {
                    self.resume_path();
                } else {
                    self.hold_path(Hold::Operator);
                }
            }
            Order::SingleBlock(on) => self.executor.set_single_block(on),
            Order::OptionalStop(on) => self.optional_stop = on,
            Order::Retrace | Order::Jog(_) if self.threading.is_active() => {
                return Err(Refusal::Threading);
            }
            Order::Retrace => self.retrace()?,
            Order::Jog(_) if self.probing.is_active() => return Err(Refusal::Probing),
            Order::Jog(jog) => self.jog(jog).map_err(Refusal::Jog)?,
            Order::RenewJog(axis) => self.renew_jog(axis),
            Order::EndJog(axis) => self.executor.end_jog(axis),
            Order::FeedOverride(feed) => {
                let overrides = self.executor.overrides();
                (self.executor).set_overrides(Overrides { feed, ..overrides });
                self.change_probing_speed();
            }
            Order::RapidOverride(rapid) => {
                let overrides = self.executor.overrides();
                (self.executor).set_overrides(Overrides { rapid, ..overrides });
                self.change_probing_speed();
            }
            Order::Interrupt => self.interrupt(),
            Order::Abandon(number) => {
                if self.job().is_some_and(|job| job.number == number) {
                    self.abandon();
                }
            }
            Order::UserCodeEnded { number, ok } => self.calls.end(number, ok),
            Order::Enable => self.enable(),
            Order::Disable => self.go_to(Goal::Disabled),
            Order::Home(coordinates) => self.home(coordinates)?,
            Order::Reset => self.reset(),
            Order::SwitchOff => self.switch_off(),
            Order::Switch { output, on } => self.switches.by_hand(output, on),
            Order::Nothing => {}
        }
        Ok(())
    }

    /// Whether the axes that an order moves by machine positions have such positions.
    fn check_references(&self, order: &Order<N>) -> Result<(), Refusal> {
        // What is taken up first leads back to where it was held, whichever axes that takes.
        let excused = |at: usize| match order {
            Order::Begin(job) => {
                job.homes_first.contains_index(at) || job.leaves.contains_index(at)
            }
            Order::TakeUp(job) => job.homes_first.contains_index(at),
            _ => false,
        };
        let needs = |at: usize| match order {
            Order::Begin(_) | Order::TakeUp(_) => {
                !self.layout.homing.unreferenced_jobs && !excused(at)
            }
            Order::Jog(Jog::To(to) | Jog::Line { to, .. }) => to[at].is_some(),
            _ => false,
        };
        let moves = |at: usize| match order {
            Order::Begin(_) | Order::TakeUp(_) => !excused(at),
            Order::Jog(Jog::Continuous { axis, .. } | Jog::Step { axis, .. }) => *axis == at,
            _ => needs(at),
        };
        let jogs = |at: usize| matches!(order, Order::Jog(_)) && moves(at);
        let mut beside = self.axes.iter().filter(|axis| axis.beside().is_some());
        if let Some(axis) = beside.find(|axis| jogs(axis.coordinate())) {
            return Err(Refusal::PointToPoint(axis.coordinate()));
        }
        let mut askew = self.axes.iter();
        let askew = askew.find(|it| it.askew(self.cycle).is_some() && moves(it.coordinate()));
        if let Some(axis) = askew {
            return Err(Refusal::Askew(axis.coordinate()));
        }
        let mut untested = self.axes.iter().filter(|axis| !axis.is_tested());
        if let Some(axis) = untested.find(|axis| moves(axis.coordinate())) {
            return Err(Refusal::Untested(axis.coordinate()));
        }
        let missing = self.axes.iter().filter(|axis| !axis.is_referenced());
        let mut missing = missing.map(|axis| axis.coordinate());
        match missing.find(|&at| needs(at)) {
            Some(at) => Err(Refusal::Unreferenced(at)),
            None => Ok(()),
        }
    }

    /// The overrides that leave nothing of the speed for what is ordered.
    fn lacks_speed(&self, order: &Order<N>) -> Option<ZeroOverrides> {
        match order {
            Order::CycleStart | Order::Resume => self.rests_for_speed(),
            Order::Retrace => {
                let zero = ZeroOverrides {
                    rapid: false,
                    ..self.zero_overrides()
                };
                zero.feed.then_some(zero)
            }
            _ => None,
        }
    }

    /// Whether an order sets something in motion that rests.
    fn moves(&self, order: Order<N>) -> bool {
        match order {
            Order::Begin(job) => !job.is_still,
            Order::TakeUp(_)
            | Order::CycleStart
            | Order::Resume
            | Order::Retrace
            | Order::Home(_)
            | Order::Jog(_) => true,
            Order::ToggleFeedHold => self.is_path_held(),
            _ => false,
        }
    }
}

/// The letter of a coordinate.
fn letter(coordinate: usize) -> char {
    AxisLetter::ALL
        .get(coordinate)
        .map_or('?', |axis| axis.letter())
}

/// Why a jog is refused, and what to do.
fn why_no_jog(error: JogError) -> String {
    match error {
        JogError::Moving => "the machine moves: feed hold first".to_owned(),
        JogError::NoAxis(axis) => format!("the machine has no axis {}", letter(axis)),
        JogError::OutsideTravel { axis, to, min, max } => format!(
            "{} would go to {to:.4}, and may go from {min:.4} to {max:.4} (machine coordinates)",
            letter(axis)
        ),
        JogError::NotANumber => "there is a number that is none".to_owned(),
        JogError::NoSpeed => "the speed or the rapid override is 0: raise it".to_owned(),
    }
}
