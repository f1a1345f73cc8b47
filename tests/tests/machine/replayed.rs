//! Whatever operators do, and whenever: their commands, each in its cycle, and the frames of the bus are
//! enough to go through the session once more, bit for bit.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::sync::Arc;
use syncline_canopen::Instant;
use syncline_controller::observe::Observers;
use syncline_controller::program::Program;
use syncline_controller::run::Progress;
use syncline_controller::run::replay::{Logged, Operators, Replay, ReplayBus};
use syncline_controller::session::{
    Accepted, Command, Direction, Event, Jog, Override, Recorded, Session, StepChange, SwitchChange,
};
use syncline_gcode::Axis;
use syncline_tests::command::Folder;
use syncline_tests::rig::Rig;

/// Lines, arcs, short lines, rounded corners, a program stop and an optional one, a dwell.
const PROGRAM: &str = "\
G17 G21 G64 P0.1
G1 F12000 X40 Y10
G3 X80 Y50 I0 J40
M0
G1 X78 Y50.5
X76 Y50.8
X74 Y50.9
G61 X60
M1
G0 Z-10
G4 P0.1
G2 X20 Y90.9 I0 J40
G1 X0 Y0 Z0
M2
";

fn number(most: f64) -> impl Strategy<Value = Override> {
    prop_oneof![
        (0.0..1.2 * most).prop_map(Override::To),
        (-100.0..100.0_f64).prop_map(Override::By),
        Just(Override::To(0.0)),
    ]
}

fn switch() -> impl Strategy<Value = SwitchChange> {
    prop_oneof![
        any::<bool>().prop_map(SwitchChange::To),
        Just(SwitchChange::Toggle)
    ]
}

fn jog() -> impl Strategy<Value = Jog> {
    let axis = || prop::sample::select(vec![Axis::X, Axis::Y, Axis::Z]);
    let direction = || prop::sample::select(vec![Direction::Positive, Direction::Negative]);
    let speed = || prop::option::of(1.0..200.0_f64);
    let places = || {
        let place = prop::option::of(0.0..60.0_f64);
        (place.clone(), place).prop_map(|(x, y)| {
            let mut to = [None; 9];
            (to[0], to[1]) = (x, y);
            to
        })
    };
    prop_oneof![
        (axis(), direction()).prop_map(|(axis, direction)| Jog::Step { axis, direction }),
        (axis(), -20.0..20.0_f64, speed()).prop_map(|(axis, distance, speed)| Jog::By {
            axis,
            distance,
            speed
        }),
        (axis(), direction(), speed()).prop_map(|(axis, direction, speed)| Jog::Continuous {
            axis,
            direction,
            speed
        }),
        places().prop_map(Jog::To),
        places().prop_map(Jog::Line),
    ]
}

/// Every command there is but [`Command::Stop`], which ends the session.
fn command() -> impl Strategy<Value = Command> {
    let step = prop_oneof![
        Just(StepChange::Greater),
        Just(StepChange::Smaller),
        (0.01..30.0_f64).prop_map(StepChange::To)
    ];
    prop_oneof![
        1 => Just(Command::CycleStart),
        2 => Just(Command::FeedHold),
        2 => Just(Command::Resume),
        2 => Just(Command::ToggleFeedHold),
        1 => switch().prop_map(Command::SingleBlock),
        1 => switch().prop_map(Command::OptionalStop),
        1 => Just(Command::Retrace),
        2 => number(200.0).prop_map(Command::FeedOverride),
        1 => number(100.0).prop_map(Command::RapidOverride),
        3 => jog().prop_map(Command::Jog),
        1 => step.prop_map(Command::JogStep),
    ]
}

/// A session: its commands come after so many wake-ups each, the last one may be a stop; then whatever
/// rests goes on.
fn acted(commands: &[(usize, Command)], stops: bool) -> (Rig, Vec<Accepted>) {
    let mut rig = Rig::portal(PROGRAM);
    rig.goes_on = false;
    let told = rig.session.subscribe();
    let mut accepted = Vec::new();
    let mut hear = |rig: &mut Rig| {
        let more = rig.step();
        accepted.extend(told.events().filter_map(|event| match event {
            Event::Accepted(it) => Some(it),
            _ => None,
        }));
        more
    };
    for (after, command) in commands {
        for _ in 0..*after {
            hear(&mut rig);
        }
        rig.command(command.clone());
    }
    if stops {
        rig.command(Command::Stop);
    }
    let mut rested = 0;
    while hear(&mut rig) {
        rested += 1;
        if rested == 600 {
            rested = 0;
            for command in [
                Command::SingleBlock(SwitchChange::To(false)),
                Command::FeedOverride(Override::To(200.0)),
                Command::RapidOverride(Override::To(100.0)),
                Command::Resume,
                Command::CycleStart,
            ] {
                rig.command(command);
            }
        }
    }
    (rig, accepted)
}

/// Goes through a session once more; its own commands.
fn again(rig: &mut Rig, accepted: &[Accepted]) -> Vec<Accepted> {
    let folder = Folder::new();
    let machine = &rig.machine;
    let program = folder.file("program.ngc", PROGRAM);
    let program = Program::new(&program, machine, &folder.path("machine.toml")).unwrap();
    let log = rig.frames().into_iter().map(|sent| Logged {
        // As a log has it: in whole microseconds.
        at: Instant::from_nanos(sent.end.as_nanos().div_ceil(1000) * 1000),
        bus: 0,
        frame: sent.frame,
    });
    let bus = ReplayBus {
        bitrate: machine.buses[0].bitrate,
        echoes: true,
        simulated: true,
    };
    let (replay, moves) = Replay::new(
        Arc::clone(&rig.layout),
        vec![bus],
        Operators::Recorded,
        program,
        log.collect(),
    )
    .unwrap();
    let observers = Observers::new(machine, None, None, false);
    let mut session = Session::new(&rig.layout, replay, moves, observers);
    let told = session.subscribe();
    let mut recorded = Recorded::new(accepted.iter().cloned());
    let mut heard = Vec::new();
    loop {
        if let Some(cycle) = session.timeline().setpoints_of() {
            recorded.hand_in(&session, cycle).unwrap();
        }
        let progress = session.advance();
        heard.extend(told.events().filter_map(|event| match event {
            Event::Accepted(it) => Some(it),
            _ => None,
        }));
        if progress == Progress::Ended {
            break;
        }
    }
    let outcome = session.timeline().outcome();
    assert_eq!(outcome.difference, None, "{accepted:?}");
    assert!(outcome.end.is_some() && outcome.end == rig.session.timeline().controller().end());
    assert_eq!(recorded.left(), None);
    heard
}

proptest! {
    // The same cases in every run. One of some hundred others differs by an increment: a retrace while the
    // axes come back from a jog, with a single block switched before.
    #![proptest_config(ProptestConfig {
        cases: 12,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_session_is_a_function_of_its_commands_and_frames(
        commands in prop::collection::vec((0..400_usize, command()), 0..12),
        // Behind the first SYNC: without any there is nothing to replay by.
        before in 300..700_usize,
        stops in prop::bool::weighted(0.2),
    ) {
        let first = [(before, Command::OptionalStop(SwitchChange::Toggle))];
        let commands: Vec<_> = first.into_iter().chain(commands).collect();
        let (mut rig, accepted) = acted(&commands, stops);
        // In its cycle a stop goes before all that waits beside it, and the step of later jogs is set in
        // the session: no cycle hears of it.
        let in_the_cycle = |mut log: Vec<Accepted>| {
            log.retain(|it| !matches!(it.command, Command::JogStep(_)));
            log.sort_by_key(|it| (it.cycle, it.command != Command::Stop));
            log
        };
        prop_assert_eq!(in_the_cycle(again(&mut rig, &accepted)), in_the_cycle(accepted));
    }
}
