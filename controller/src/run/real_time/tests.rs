//! The cycle's orders and reports, and a machine whose planner does not answer.

use super::*;
use crate::control::{Event, Job, JobKind, MachineFunctions, Row, State};
use crate::port;
use crate::program::Programs;
use std::path::Path;
use syncline_drives::world::Observer;
use syncline_trajectory::path::Executor;

pub(super) const TIMING: Timing = Timing {
    settings: realtime::Settings {
        priority: 1,
        core: None,
    },
    spin: Duration::ZERO,
    pace: Pace::LockstepWithPlanner,
    strict: false,
};

/// A simulated portal.
fn portal() -> (Machine, Arc<Layout>, World, Ports) {
    let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
    let machine = Machine::load(&portal).unwrap();
    let layout = Arc::new(Layout::new(&machine).unwrap());
    let unseen = machine
        .buses
        .iter()
        .map(|_| Box::new(|_: &_| ()) as Observer);
    let (world, ports) = port::open(&machine, 0, unseen.collect()).unwrap();
    (machine, layout, world, ports)
}

/// Drives that are enabled stand under setpoints, a SYNC each cycle, while the planner has said nothing at all. Where time is to stand still
/// for the planner, it does so only for as long as the cycle has patience.
#[test]
fn a_simulated_machine_goes_on_without_an_answer_of_its_planner() {
    assert!(!goes_on_without_a_plan(TIMING), "it waits");
    let timing = Timing {
        pace: Pace::Lockstep,
        ..TIMING
    };
    assert!(goes_on_without_a_plan(timing), "it does not wait");
}

/// Waits until a machine goes on although its planner says nothing: whether it did without losing patience.
fn goes_on_without_a_plan(timing: Timing) -> bool {
    let (_, layout, world, ports) = portal();
    let (cycle, mut handle, mut queues) = Cycle::new(&layout, world, ports, timing);
    let cycle = thread::spawn(move || cycle.run(|_| ()));
    while queues.requests.pop().is_err() {
        while handle.report().is_some() {}
        thread::sleep(NAP);
    }
    // The program is to begin, and nothing comes of it.
    let asked = realtime::now();
    let mut cycles = 0;
    while cycles < 100 {
        match handle.report() {
            Some(CycleReport::Row(_)) => cycles += 1,
            Some(_) => {}
            None => thread::sleep(NAP),
        }
        let waited = realtime::now().saturating_since(asked);
        assert!(waited < 3 * PLAN_PATIENCE, "{cycles} cycles");
    }
    let waited = realtime::now().saturating_since(asked);
    drop((handle, queues));
    cycle.join().unwrap();
    waited < PLAN_PATIENCE
}

#[test]
fn no_order_gets_lost_while_the_cycle_stands() {
    let (orders, mut taken) = RingBuffer::new(ORDERS);
    let (_, reports) = RingBuffer::new(1);
    let (_, carried) = RingBuffer::new(1);
    let mut handle = CycleHandle {
        orders,
        waiting: VecDeque::new(),
        reports,
        carried,
    };
    let many = 2 * ORDERS as u64;
    for number in 0..many {
        handle.order(number, Order::Retrace);
    }
    handle.order(many, Order::Interrupt);
    let mut last = None;
    for _ in 0..=many {
        last = taken.pop().ok();
        assert!(handle.report().is_none());
    }
    assert_eq!(last, Some((many, Order::Interrupt)));
}

/// Of each order it is told what became of it, whatever became of the next one; and a wake-up takes no more of them than
/// there is room for, however many come.
#[test]
fn each_order_is_told_of() {
    let (_, layout, world, ports) = portal();
    let (mut cycle, mut handle, _queues) = Cycle::new(&layout, world, ports, TIMING);
    (handle.orders, cycle.orders) = RingBuffer::new(2 * ORDERS);
    let refused = 1;
    for number in 0..2 * ORDERS as u64 {
        // Nothing is held yet.
        let order = match number == refused {
            true => Order::Retrace,
            false => Order::Nothing,
        };
        handle.order(number, order);
    }
    cycle.obey();
    let told = std::iter::from_fn(|| handle.report()).map(|report| match report {
        CycleReport::Obeyed { number, .. } => (number, true),
        CycleReport::Refused { number, .. } => (number, false),
        other => panic!("{other:?}"),
    });
    let told: Vec<_> = told.collect();
    let each = (0..ORDERS as u64).map(|number| (number, number != refused));
    assert_eq!(told, each.collect::<Vec<_>>());
}

/// Rows that nobody takes are lost, and not what the session has to know. A simulated machine waits for who takes them, and no
/// longer however much is reported; once they are taken it waits anew.
#[test]
fn rows_leave_room_for_what_the_session_has_to_know() {
    let (_, layout, world, ports) = portal();
    let (mut cycle, mut handle, _queues) = Cycle::new(&layout, world, ports, TIMING);
    let row = Row {
        cycle: 0,
        sync: 1,
        at: Instant::ZERO,
        plan: Executor::new(Default::default(), layout.cycle.as_secs_f64()).setpoint(),
        axes: Default::default(),
        functions: MachineFunctions::default(),
        put_out: MachineFunctions::default(),
        spindle: None,
        analog_inputs: Default::default(),
        measured: Default::default(),
        rests_for: None,
        dwells_for: None,
        threads: false,
        waiting: None,
        along: None,
    };
    let waits = |cycle: &mut Cycle, report: CycleReport| {
        let before = realtime::now();
        cycle.report(report);
        realtime::now().saturating_since(before) >= REPORT_PATIENCE
    };
    for count in 0..REPORTS {
        // With the events that were told before it.
        let is_first_without_room = count + count.div_ceil(1000) == REPORTS / 2;
        let waited = waits(&mut cycle, CycleReport::Row(row));
        assert_eq!(waited, is_first_without_room, "{count}");
        if count % 1000 == 0 {
            cycle.report(CycleReport::Event(Event::SetAside));
        }
    }
    let told: Vec<_> = std::iter::from_fn(|| handle.report()).collect();
    let rows = |report: &&CycleReport| matches!(report, CycleReport::Row(_));
    let events = REPORTS.div_ceil(1000);
    assert_eq!(told.len() - told.iter().filter(rows).count(), events);
    assert_eq!(cycle.measured.lost as usize, REPORTS + events - told.len());
    for _ in 0..=REPORTS / 2 {
        cycle.report(CycleReport::Row(row));
    }
    assert!(cycle.report_patience.is_zero(), "it waited again");
}

/// A job that computes without end is held, and lines that are typed in take its place: they are planned.
#[test]
fn a_job_that_computes_without_end_makes_way_for_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.ngc");
    std::fs::write(&file, "M3 S100\nM99\n").unwrap();
    let (machine, layout, world, ports) = portal();
    let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
    let programs = Programs::new(&machine, &portal).unwrap();
    let endless = Program::new(&file, &machine, &portal).unwrap().stream(true);
    let lines = programs.lines("G0 X1");
    let mut running = RealTime::stay_on(&machine, &layout, world, ports, TIMING, |_| ()).unwrap();
    let until = |running: &mut RealTime, is_it: &dyn Fn(&CycleReport) -> bool| {
        let begun = realtime::now();
        let mut came = false;
        while !came {
            let waited = realtime::now().saturating_since(begun);
            assert!(waited < 4 * PLAN_PATIENCE, "it does not come");
            let progress = running
                .advance(&mut |report| came |= is_it(&report))
                .unwrap();
            if progress == Progress::Idle {
                thread::sleep(NAP);
            }
        }
    };
    let is_state = |report: &CycleReport, is: State| matches!(report, CycleReport::Event(Event::State(it)) if *it == is);
    until(&mut running, &|report| is_state(report, State::Ready));
    for (number, kind, program) in [(1, JobKind::Program, endless), (2, JobKind::Mdi, lines)] {
        let job = Job {
            number,
            kind,
            ..Job::ONLY
        };
        running.prepare(Work {
            number,
            program,
            upcoming: Moves::new().0,
        });
        running.order(number, Order::Begin(job));
        if kind == JobKind::Program {
            until(&mut running, &|report| is_state(report, State::Running));
            running.order(0, Order::FeedHold);
            until(&mut running, &|report| is_state(report, State::Held));
        }
    }
    let finished = |report: &CycleReport| {
        let over = Event::JobOver {
            job: 2,
            outcome: Outcome::Finished,
        };
        matches!(report, CycleReport::Event(event) if *event == over)
    };
    until(&mut running, &finished);
}
