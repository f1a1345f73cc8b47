//! A simulated machine whose planner is slow: each of its answers may come late.
//!
//! Between cycle and planner stands a relay, which holds back requests and instructions. Held against the same program with a
//! planner that is waited for, SYNC leaves in every cycle, everything is switched once and in order, and the motion ends in the
//! same place; it only takes longer.

use super::tests::TIMING;
use super::*;
use crate::control::{End, MachineFunctions, Row, State, Waiting};
use crate::program::Programs;
use proptest::collection::vec;
use proptest::prelude::*;
use std::fmt::Debug;
use std::path::Path;

/// Everything that is switched, waited for and found: the probe touches the table 40 mm below X100 Y100.
const PROGRAM: &str = "\
G21 G90 G94 G64 P0.05
M3 S8000
G0 X60 Y60 Z-10
M62 P0
G1 X100 F12000
Y100
M63 P0
X90 Y90
X100 Y100
G4 P0.1
M7
G38.2 Z-60 F900
G0 Z[#5063 + 5]
#1 = #5063
G2 X60 Y60 R80 F9000
M9
G1 X20 Z[#1 + 20]
M5
M2
";

/// The axes' limits of acceleration, mm/s², by coordinate X, Y and Z.
const ACCELERATIONS: [f64; 3] = [3000.0, 5000.0, 4000.0];

/// What a run showed.
#[derive(Debug, Default)]
struct Seen {
    /// Each state of what the program switches, once it differs from the one before.
    functions: Vec<MachineFunctions>,
    /// How many cycles each dwell took.
    dwells: Vec<usize>,
    /// In how many cycles the path rested for want of a plan.
    waited: usize,
    probed: Vec<bool>,
    end: [f64; COORDINATES],
}

impl Seen {
    /// Adds a row behind the one before it, with which it agrees.
    fn add(&mut self, row: &Row<COORDINATES>, before: Option<&Row<COORDINATES>>, period: Duration) {
        if self.functions.last() != Some(&row.functions) {
            self.functions.push(row.functions);
        }
        self.waited += usize::from(row.waiting == Some(Waiting::Plan));
        self.end = row.plan.position;
        let dwelt = before.is_some_and(|before| before.dwells_for.is_some());
        match self.dwells.last_mut() {
            Some(cycles) if dwelt && row.dwells_for.is_some() => *cycles += 1,
            _ if row.dwells_for.is_some() => self.dwells.push(1),
            _ => {}
        }
        let Some(before) = before else { return };
        assert_eq!(row.sync, before.sync + 1, "a SYNC is missing");
        assert_eq!(row.at, before.at + period, "SYNC leaves its grid");
        for (axis, most) in ACCELERATIONS.into_iter().enumerate() {
            let by = row.plan.velocity[axis] - before.plan.velocity[axis];
            let most = most * period.as_secs_f64();
            assert!(by.abs() <= most * 1.000_001, "{by} in sync {}", row.sync);
        }
    }
}

/// The portal with a probe and a table that it touches.
fn machine() -> Machine {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
    let text = include_str!("../../../../examples/portal/machine.toml");
    let probe = "
[[input]]
name = \"probe\"
drive = \"Z\"
signal = \"DI0\"
function = \"probe\"

[simulation]
ball = 4.0

[[simulation.workpiece]]
name = \"table\"
shape = \"box\"
x = [0.0, 200.0]
y = [0.0, 200.0]
z = [-100.0, -50.0]
";
    Machine::parse(&file, &format!("{text}{probe}")).unwrap()
}

/// Stands between a cycle and its planner; hands on what the planner's ends of the queues are. Of all that passes either way the next delay
/// tells how long it is held back, and the last one is followed by the first.
fn relay(cycle: PlanQueues, delays: &[Duration]) -> PlanQueues {
    let (ask, requests) = RingBuffer::new(REQUESTS);
    let (give, instructions) = RingBuffer::new(INSTRUCTIONS);
    hold_back(cycle.requests, ask, delays);
    hold_back(instructions, cycle.instructions, delays);
    PlanQueues {
        requests,
        instructions: give,
    }
}

/// One way of it, until nobody gives or nobody takes any more.
fn hold_back<T: Send + Debug + 'static>(
    mut from: Consumer<T>,
    mut to: Producer<T>,
    delays: &[Duration],
) {
    let delays: Vec<Duration> = delays.into();
    let mut delays = delays.into_iter().cycle();
    thread::spawn(move || {
        while !(to.is_abandoned() || from.is_abandoned() && from.is_empty()) {
            match (!to.is_full()).then(|| from.pop().ok()).flatten() {
                Some(it) => {
                    thread::sleep(delays.next().unwrap_or_default());
                    to.push(it).unwrap();
                }
                None => thread::sleep(NAP),
            }
        }
    });
}

/// Runs the program, held by an operator and resumed in the cycle with that number.
fn run(pace: Pace, delays: &[Duration], held: u64) -> Seen {
    let machine = machine();
    let layout = Arc::new(Layout::new(&machine).unwrap());
    let unseen = Box::new(|_: &_| ());
    let (world, ports) = crate::port::open(&machine, 0, vec![unseen]).unwrap();
    let timing = Timing { pace, ..TIMING };
    let without_tables = tempfile::tempdir().unwrap();
    let programs = Programs::new(&machine, &without_tables.path().join("machine.toml")).unwrap();
    let program = programs.text("slow", PROGRAM.as_bytes());
    let (mut cycle, handle, queues) = Cycle::new(&layout, world, ports, timing);
    cycle.driver.cut(&machine, &layout);
    cycle.driver.controller.works_on(program.only_job());
    let (upcoming, _moves) = Moves::new();
    let mut running = RealTime::of(handle, relay(queues, delays)).unwrap();
    running.prepare(Work {
        number: 0,
        program,
        upcoming,
    });
    running.begin(cycle, |_| ()).unwrap();
    let mut seen = Seen::default();
    let mut before: Option<Row<COORDINATES>> = None;
    let mut orders = vec![(1, Order::FeedHold)];
    let (mut finished, mut was_held) = (false, false);
    loop {
        let mut is_held = false;
        let progress = running.advance(&mut |report| match report {
            CycleReport::Row(row) => {
                seen.add(&row, before.as_ref(), layout.cycle);
                before = Some(row);
            }
            CycleReport::Event(Event::State(State::Held)) => is_held = true,
            CycleReport::Event(Event::Probed { found, .. }) => seen.probed.push(found.is_some()),
            CycleReport::Event(Event::JobOver { outcome, .. }) => {
                finished = outcome == Outcome::Finished;
            }
            CycleReport::BusFailed(error) => panic!("{error}"),
            _ => {}
        });
        if before.is_some_and(|row| row.cycle >= held)
            && let Some((number, order)) = orders.pop()
        {
            running.order(number, order);
        }
        was_held |= is_held;
        if is_held {
            running.order(2, Order::Resume);
        }
        match progress.unwrap() {
            Progress::More => {}
            Progress::Idle => thread::sleep(NAP),
            Progress::Ended => break,
        }
    }
    let ended = running.end().unwrap();
    let end = ended.controller.end();
    assert_eq!(
        end,
        Some(End::Finished),
        "{pace:?}, held in cycle {held}: {seen:?}"
    );
    assert!(finished && was_held && ended.measured.lost == 0);
    seen
}

fn delays() -> impl Strategy<Value = Vec<Duration>> {
    let delay = prop_oneof![
        40 => Just(0_u64),
        1 => 1_u64..10,
        1 => 10_u64..80,
    ];
    // The first one passes as the program begins, where the path rests for it.
    vec(delay.prop_map(Duration::from_millis), 50..100).prop_map(|mut delays| {
        delays[0] = Duration::from_millis(60);
        delays
    })
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 2, failure_persistence: None, ..ProptestConfig::with_cases(2) })]

    #[test]
    fn a_slow_planner_makes_motion_take_longer_and_nothing_else(delays in delays(), held in 50_u64..1500) {
        let waited_for = run(Pace::LockstepWithPlanner, &[Duration::ZERO], held);
        let slow = run(Pace::Lockstep, &delays, held);
        prop_assert_eq!(&slow.functions, &waited_for.functions);
        prop_assert_eq!(&slow.dwells, &waited_for.dwells);
        prop_assert_eq!(&slow.probed, &waited_for.probed);
        prop_assert!(slow.waited > waited_for.waited, "{} and {}", slow.waited, waited_for.waited);
        for (slow, waited_for) in slow.end.iter().zip(waited_for.end) {
            prop_assert!((slow - waited_for).abs() < 0.005, "{} and {}", slow, waited_for);
        }
    }
}
