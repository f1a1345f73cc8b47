//! A machine on the host's clock: the cycle in a thread of its own, everything else outside.
//!
//! ```text
//!  instructions, orders ──► cycle thread ──► news: events, rows, progress
//! ```
//!
//! One bounded queue of orders goes in, one of news comes out; the plan has a queue of its own, from
//! a thread of its own ([`planning`](super::planning)). Nothing else is shared.

use super::driver::Driver;
use crate::control::{Controller, Event, Instruction, Layout, Order, Phase, Row};
use crate::machine::{COORDINATES, Position};
use crate::port::{Port, PortError, Ports};
use crate::realtime::{self, Granted};
use crate::timing::{Distribution, Stage, Stages};
use rtrb::{Consumer, Producer, PushError, RingBuffer};
use std::collections::VecDeque;
use std::mem::replace;
use std::sync::Arc;
use std::time::Duration;
use syncline_canopen::Instant;
use syncline_drives::world::World;
use syncline_trajectory::path::ReplanRequest;

/// Instructions on their way into the cycle.
const INSTRUCTIONS: usize = 1024;
/// Most of them that one wake-up takes on the host's clock: far more than a cycle uses up.
const TAKEN_AT_ONCE: usize = 128;
/// Orders on their way into the cycle.
const ORDERS: usize = 64;
/// News on their way out of the cycle.
const NEWS: usize = 16_384;
/// How long the cycle of a simulated machine waits for its plan at a time.
const NAP: Duration = Duration::from_micros(200);
/// How long a simulated machine waits for its way to rest, in all.
const PATIENCE: Duration = Duration::from_millis(200);

/// What the cycle tells.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // a ring's slots are all of one size
pub enum News {
    /// Something worth a line in the log.
    Event(Event),
    /// The machine is ready; the plan has to start here.
    Ready(Position),
    /// What happened at one SYNC.
    Row(Row<COORDINATES>),
    /// The path has to be planned anew from there.
    ReplanRequest(ReplanRequest),
    /// A bus' interface failed.
    BusFailed(PortError),
}

/// How the cycle treats time.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// What the thread asks of the kernel.
    pub settings: realtime::Settings,
    /// Time before each wake-up that is spent spinning.
    pub spin: Duration,
    /// Every bus is simulated: its time goes with the cycle, and a late wake-up delays both.
    pub lockstep: bool,
    /// A late wake-up is a fault.
    pub strict: bool,
}

/// What the cycle measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// From the instant asked for to waking up.
    pub wake_up: Distribution,
    /// |From SYNC to SYNC − cycle|.
    pub sync_jitter: Distribution,
    /// From waking up for the setpoints until they are sent.
    pub compute: Distribution,
    /// Wake-ups later than [`late_after`].
    pub late: u64,
    /// The same by what made them late, in the order of [`Stage::ALL`]: the kernel, or the longest
    /// stage of the wake-up before, which was not over in time.
    pub late_by: [u64; 4],
    /// The wake-up that was over latest.
    pub worst: Stages,
    /// News that nobody fetched in time.
    pub lost: u64,
    /// When the cycle began.
    pub start: Instant,
}

impl Measured {
    /// All distributions.
    #[must_use]
    pub fn distributions(&self) -> [Distribution; 3] {
        [&self.wake_up, &self.sync_jitter, &self.compute].map(Distribution::clone)
    }
}

/// A wake-up later than this counts as late: a quarter of the cycle.
#[must_use]
pub fn late_after(cycle: Duration) -> Duration {
    cycle / 4
}

/// The outer ends of a person's queues.
pub struct Link {
    orders: Producer<Order>,
    /// Orders that found no room yet.
    waiting: VecDeque<Order>,
    news: Consumer<News>,
}

impl Link {
    /// Orders something. None gets lost: what finds no room goes with the next order or
    /// [`Link::news`].
    pub fn order(&mut self, order: Order) {
        self.waiting.push_back(order);
        self.hand_over();
    }

    fn hand_over(&mut self) {
        while !self.orders.is_full()
            && let Some(order) = self.waiting.pop_front()
        {
            let given = self.orders.push(order);
            debug_assert!(given.is_ok(), "there is room");
        }
    }

    /// The next news.
    pub fn news(&mut self) -> Option<News> {
        self.hand_over();
        self.news.pop().ok()
    }
}

/// The cycle, to be run in a thread of its own.
pub struct Cycle {
    driver: Driver<COORDINATES, Box<dyn Port + Send>>,
    timing: Timing,
    period: Duration,
    instructions: Consumer<Instruction<COORDINATES>>,
    orders: Consumer<Order>,
    news: Producer<News>,
    told_ready: bool,
    told_request: Option<ReplanRequest>,
    /// How much longer a simulated machine waits for its way to rest.
    patience: Duration,
    measured: Measured,
}

impl Cycle {
    /// The cycle of a machine whose buses are open, and the outer ends of its queues.
    #[must_use]
    pub fn new(
        layout: &Arc<Layout>,
        world: World,
        ports: Ports,
        timing: Timing,
    ) -> (Self, Link, Producer<Instruction<COORDINATES>>) {
        let (give, instructions) = RingBuffer::new(INSTRUCTIONS);
        let (order, orders) = RingBuffer::new(ORDERS);
        let (tell, news) = RingBuffer::new(NEWS);
        let start = if timing.lockstep {
            Instant::ZERO
        } else {
            realtime::now() + 10 * layout.cycle
        };
        let cycle = Self {
            driver: Driver::new(Arc::clone(layout), world, ports, start),
            timing,
            period: layout.cycle,
            instructions,
            orders,
            news: tell,
            told_ready: false,
            told_request: None,
            patience: PATIENCE,
            measured: Measured {
                wake_up: Distribution::new("wake-up latency"),
                sync_jitter: Distribution::new("SYNC jitter"),
                compute: Distribution::new("setpoint wake-up"),
                late: 0,
                late_by: [0; 4],
                worst: Stages::default(),
                lost: 0,
                start: realtime::now(),
            },
        };
        let link = Link {
            orders: order,
            waiting: VecDeque::new(),
            news,
        };
        (cycle, link, give)
    }

    /// See [`Controller::wait_for_input`].
    pub fn wait_for_input(&mut self) {
        self.driver.controller.wait_for_input();
    }

    /// Runs the machine to its end; `started` is told what the kernel granted.
    pub fn run(
        mut self,
        started: impl FnOnce(Granted) -> Granted,
    ) -> (Controller<COORDINATES>, Measured) {
        let _granted = started(realtime::enter(&self.timing.settings));
        // Where the simulated machine's time stands on the host's clock.
        let mut origin = Duration::ZERO;
        if self.timing.lockstep {
            origin = Duration::from_nanos(realtime::now().as_nanos()) + self.period;
        }
        let mut bus_failed = false;
        let mut last_sync = None;
        let mut before = (Instant::ZERO, Stages::default());
        while let Some(next) = self.driver.controller.next_wake() {
            let due = next.at() + origin;
            let controller = &self.driver.controller;
            realtime::sleep_until(due, self.timing.spin, || controller.rehearse());
            let woke = realtime::now();
            let late = woke.saturating_since(due);
            self.measured.wake_up.record(late, woke);
            if late > late_after(self.period) {
                self.measured.late += 1;
                let (over, stages) = before;
                let stage = if over > due {
                    stages.longest()
                } else {
                    Stage::WakeUp
                };
                self.measured.late_by[stage as usize] += 1;
                if self.timing.lockstep {
                    origin += late;
                }
                if self.timing.strict {
                    self.driver.controller.woke_late(late);
                }
            }
            let now = if self.timing.lockstep {
                next.at()
            } else {
                woke
            };
            let setpoints = self.driver.setpoints_are_next();
            if setpoints {
                self.obey();
                if self.timing.lockstep {
                    origin += self.take_plan(usize::MAX);
                }
            }
            let begun = realtime::now();
            let collected = self.driver.collect(now).map(|_| ());
            let received = realtime::now();
            self.driver.compute(now);
            let computed = realtime::now();
            let sent = self.driver.send();
            let over = realtime::now();
            let stages = Stages {
                at: woke.saturating_since(self.measured.start),
                wake: late,
                receive: received.saturating_since(begun),
                compute: computed.saturating_since(received),
                send: over.saturating_since(computed),
            };
            before = (over, stages);
            if stages.total() > self.measured.worst.total() {
                self.measured.worst = stages;
            }
            // What fails once fails in every cycle until the end: the first time is news.
            if let Err(error) = collected.and(sent)
                && !replace(&mut bus_failed, true)
            {
                self.tell(News::BusFailed(error));
            }
            if setpoints {
                self.measured
                    .compute
                    .record(over.saturating_since(woke), woke);
                self.tell_all();
                // Behind the setpoints, which nothing is to delay.
                if !self.timing.lockstep {
                    self.take_plan(TAKEN_AT_ONCE);
                }
            } else if let Some(last) = last_sync.replace(woke) {
                let jitter = woke.saturating_since(last).abs_diff(self.period);
                self.measured.sync_jitter.record(jitter, woke);
            }
        }
        (self.driver.controller, self.measured)
    }

    fn obey(&mut self) {
        if self.orders.is_abandoned() {
            self.driver.controller.interrupt();
        }
        while let Ok(order) = self.orders.pop() {
            self.driver.controller.obey(order);
        }
    }

    /// Fills the controller's plan with `most` instructions at most. A simulated machine waits
    /// until it is full, so that its motion does not depend on the host; returns how long.
    fn take_plan(&mut self, most: usize) -> Duration {
        let mut waited = Duration::ZERO;
        let mut taken = 0;
        while taken < most && self.driver.controller.room() > 0 {
            if !self.told_ready
                && let Some(start) = self.driver.controller.ready()
            {
                self.told_ready = true;
                self.tell(News::Ready(start));
            }
            let request = self.driver.controller.replan_request();
            if request != self.told_request {
                self.told_request = request;
                if let Some(request) = request {
                    self.tell(News::ReplanRequest(request));
                }
            }
            match self.instructions.pop() {
                Ok(instruction) => {
                    self.driver.controller.accept(instruction);
                    taken += 1;
                }
                // Interrupted if the other side is gone, so that this ends.
                Err(_) if self.timing.lockstep && self.patience > Duration::ZERO => {
                    std::thread::sleep(NAP);
                    waited += NAP;
                    if self.driver.controller.phase() == Phase::Stop {
                        self.patience = self.patience.saturating_sub(NAP);
                    }
                    self.obey();
                }
                Err(_) => break,
            }
        }
        waited
    }

    fn tell_all(&mut self) {
        while let Some(event) = self.driver.controller.event() {
            self.tell(News::Event(event));
        }
        if let Some(row) = self.driver.controller.row() {
            let row = News::Row(*row);
            self.tell(row);
        }
    }

    /// Tells something; what finds no room is lost and counted, but a simulated machine waits.
    fn tell(&mut self, mut news: News) {
        while let Err(PushError::Full(back)) = self.news.push(news) {
            if !self.timing.lockstep || self.news.is_abandoned() {
                self.measured.lost += 1;
                return;
            }
            std::thread::sleep(NAP);
            news = back;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_order_gets_lost_while_the_cycle_stands() {
        let (orders, mut taken) = RingBuffer::new(ORDERS);
        let (_, news) = RingBuffer::new(1);
        let mut link = Link {
            orders,
            waiting: VecDeque::new(),
            news,
        };
        for _ in 0..2 * ORDERS {
            link.order(Order::StopAfterBlock);
        }
        link.order(Order::Interrupt);
        let mut last = None;
        for _ in 0..=2 * ORDERS {
            last = taken.pop().ok();
            assert!(link.news().is_none());
        }
        assert_eq!(last, Some(Order::Interrupt));
    }
}
