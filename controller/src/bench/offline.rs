//! How fast the parts of a simulation are: bus, drive, planner.

use super::rig::{Shape, Shuttle};
use crate::observe::timing::Distribution;
use crate::realtime;
use std::hint::black_box;
use std::time::Duration;
use syncline_canopen::NodeId;
use syncline_canopen::{CobId, Frame, Instant};
use syncline_drives::bus::{Band, BitRate, BusNode, SimBus, Transmission};

/// A part of a simulation.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// What it is.
    pub name: &'static str,
    /// Measures it at a machine of this shape, in so many steps.
    pub measure: fn(&Shape, u64) -> Throughput,
}

/// The simulated bus.
pub const BUS: Part = Part {
    name: "simulated bus",
    measure: bus,
};

/// The simulated drives.
pub const PLANT: Part = Part {
    name: "simulated drives",
    measure: plant,
};

/// The path planner.
pub const PLAN: Part = Part {
    name: "planner",
    measure: plan,
};

/// How long one simulated second, or a thousand of something, took.
#[derive(Debug)]
pub struct Throughput {
    /// Times of the single steps.
    pub distribution: Distribution,
    /// When measuring began.
    pub start: Instant,
    /// Steps measured.
    pub steps: u64,
    /// Processor time of all steps.
    pub total: Duration,
    /// What one step is.
    pub step: &'static str,
    /// Simulated time a step stands for; `None` where time is not simulated.
    pub simulated: Option<Duration>,
    /// Things done, by name: frames, moves.
    pub done: Vec<(&'static str, u64)>,
}

impl Throughput {
    fn measure(
        name: &'static str,
        step: &'static str,
        simulated: Option<Duration>,
        steps: u64,
        mut run: impl FnMut(u64),
    ) -> Self {
        // The first steps find cold caches and pages that were never touched.
        (0..steps / 10 + 1).for_each(&mut run);
        let mut distribution = Distribution::new(name);
        let start = realtime::now();
        let clock = realtime::thread_time();
        for number in 0..steps {
            let began = realtime::now();
            run(steps / 10 + 1 + number);
            let ended = realtime::now();
            distribution.record(ended.saturating_since(began), ended);
        }
        Self {
            distribution,
            start,
            steps,
            total: realtime::thread_time().saturating_sub(clock),
            step,
            simulated,
            done: Vec::new(),
        }
    }

    /// One line on the speed: steps a second, and how many times faster than real.
    #[must_use]
    pub fn speed(&self) -> String {
        let seconds = self.total.as_secs_f64().max(1e-9);
        let mut line = format!("{:.0} {} a second", self.steps as f64 / seconds, self.step);
        for (name, count) in &self.done {
            line += &format!(", {:.0} {name} a second", *count as f64 / seconds);
        }
        if let Some(simulated) = self.simulated {
            let times = simulated.as_secs_f64() * self.steps as f64 / seconds;
            line += &format!(", {times:.0} times real time");
        }
        line
    }
}

/// The simulated bus alone, its nodes without drives: a cycle's SYNC, T_PDOs and R_PDOs a step.
///
fn bus(shape: &Shape, steps: u64) -> Throughput {
    /// Sends its T_PDO 50 µs after SYNC.
    struct Replier {
        frame: Frame,
        due: Option<Instant>,
    }
    impl BusNode for Replier {
        fn on_frame(
            &mut self,
            now: Instant,
            frame: &Frame,
            _: &mut dyn syncline_canopen::Transmit,
        ) {
            if frame.id() == CobId::SYNC.into() {
                self.due = Some(now + Duration::from_micros(50));
            }
        }
        fn poll(&mut self, _: Instant, tx: &mut dyn syncline_canopen::Transmit) {
            self.due = None;
            tx.transmit(self.frame);
        }
        fn deadline(&self) -> Option<Instant> {
            self.due
        }
    }
    let mut sim = SimBus::new(BitRate::from_kbit(1000).expect("1 Mbit/s"));
    let nodes: Vec<NodeId> = (1..=shape.axes.min(64) as u8)
        .filter_map(NodeId::new)
        .collect();
    for &node in &nodes {
        sim.attach(Replier {
            frame: Frame::new(CobId::t_pdo(2, node), &[0x37, 0x12, 1, 2, 3, 4]),
            due: None,
        });
    }
    let burst: Vec<Frame> = nodes
        .iter()
        .map(|&node| Frame::new(CobId::r_pdo(2, node), &[0x1F, 0, 1, 2, 3, 4]))
        .collect();
    let mut frames = 0_u64;
    let mut throughput =
        Throughput::measure(BUS.name, "cycles", Some(shape.period), steps, |number| {
            let mut count = |_: &Transmission| frames += 1;
            sim.send(Band::Sync, Frame::new(CobId::SYNC, &[]));
            for frame in &burst {
                sim.send(Band::Pdo, *frame);
            }
            let end = Instant::ZERO + shape.period * (number as u32 + 1);
            sim.advance_to(end, &mut count);
            while let Some(received) = sim.receive() {
                black_box(received);
            }
        });
    throughput.done.push(("frames", frames * 10 / 11));
    throughput
}

/// Simulated drives, each a twin that stands powered and supervised: a cycle of all a step.
fn plant(shape: &Shape, steps: u64) -> Throughput {
    let shape = Shape { buses: 1, ..*shape };
    let mut twins: Vec<_> = shape.twins(0).collect();
    let mut answers: Vec<Frame> = Vec::with_capacity(64);
    let mut throughput =
        Throughput::measure(PLANT.name, "cycles", Some(shape.period), steps, |number| {
            let end = Instant::ZERO + shape.period * (number as u32 + 1);
            for twin in &mut twins {
                while let Some(due) = twin.deadline().filter(|due| *due <= end) {
                    twin.poll(due, &mut answers);
                }
            }
            answers.clear();
        });
    throughput
        .done
        .push(("drive cycles", steps * shape.axes as u64));
    throughput
}

/// The path planner: a straight move of all axes a step.
fn plan(shape: &Shape, steps: u64) -> Throughput {
    fn of<const N: usize>(shape: &Shape, steps: u64) -> Throughput {
        let mut shuttle = Shuttle::<N>::new(shape.axes);
        Throughput::measure(PLAN.name, "moves", None, steps, |_| shuttle.one_move())
    }
    match shape.axes {
        ..=9 => of::<9>(shape, steps),
        10..=16 => of::<16>(shape, steps),
        _ => of::<64>(shape, steps),
    }
}
