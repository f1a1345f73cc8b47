//! Whatever operators do, and whenever: their commands, each in its cycle, and the frames of the bus are
//! enough to go through the session once more, bit for bit.

use super::day::{self, Deed};
use proptest::prelude::*;
use std::sync::Arc;
use syncline_canopen::Instant;
use syncline_controller::control::Phase;
use syncline_controller::observe::Observers;
use syncline_controller::program::Programs;
use syncline_controller::run::Progress;
use syncline_controller::run::replay::{Logged, Operators, Outcome, Replay, ReplayBus};
use syncline_controller::session::{
    Accepted, Command, Direction, Event, Jog, Override, Recorded, Session, StepChange,
    Subscription, SwitchChange,
};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
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

fn axis() -> impl Strategy<Value = AxisLetter> {
    prop::sample::select(vec![AxisLetter::X, AxisLetter::Y, AxisLetter::Z])
}

fn jog() -> impl Strategy<Value = Jog> {
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
        1 => axis().prop_map(Command::RenewJog),
        1 => axis().prop_map(Command::EndJog),
        1 => step.prop_map(Command::JogStep),
    ]
}

/// Wake-ups between two commands, which may come in one cycle.
fn after() -> impl Strategy<Value = usize> {
    prop_oneof![2 => 0..400_usize, 1 => 0..5_usize]
}

/// One wake-up more; false at the end. Keeps what took effect.
fn hear(rig: &mut Rig, told: &Subscription, accepted: &mut Vec<Accepted>) -> bool {
    let more = rig.step();
    accepted.extend(accepted_of(told));
    more
}

fn accepted_of(told: &Subscription) -> impl Iterator<Item = Accepted> {
    told.events().filter_map(|event| match event {
        Event::Accepted(it) => Some(it),
        _ => None,
    })
}

/// A session: its commands come after so many wake-ups each, the last one may be a stop; then whatever
/// rests goes on.
fn acted(commands: &[(usize, Command)], stops: bool) -> (Rig, Vec<Accepted>) {
    let mut rig = Rig::portal(PROGRAM);
    rig.goes_on = false;
    let told = rig.session.subscribe();
    let mut accepted = Vec::new();
    for (after, command) in commands {
        for _ in 0..*after {
            hear(&mut rig, &told, &mut accepted);
        }
        rig.command(command.clone());
    }
    if stops {
        rig.command(Command::Stop);
    }
    let mut rested = 0;
    while hear(&mut rig, &told, &mut accepted) {
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

/// A day: a machine that stays on, what was done to it, each so many wake-ups after the one before,
/// and its end.
fn day_of(deeds: &[(Deed, usize)]) -> (Rig, Vec<Accepted>) {
    let mut rig = Rig::staying_on("portal", &[], |_, _| ());
    day::lay_out_programs(&rig);
    rig.goes_on = false;
    let told = rig.session.subscribe();
    let mut accepted = Vec::new();
    for (deed, after) in deeds {
        for _ in 0..*after {
            hear(&mut rig, &told, &mut accepted);
        }
        deed.clone().done_to(&mut rig);
    }
    rig.command(Command::SwitchOff);
    while hear(&mut rig, &told, &mut accepted) {}
    (rig, accepted)
}

/// What the bus carried and the controller's place on it, as a log has them: in whole microseconds.
fn recorded(rig: &Rig) -> (Vec<Logged>, Vec<ReplayBus>) {
    let log = rig.frames().into_iter().map(|sent| Logged {
        at: Instant::from_nanos(sent.end.as_nanos().div_ceil(1000) * 1000),
        bus: 0,
        frame: sent.frame,
    });
    let bus = ReplayBus {
        bitrate: rig.machine.buses[0].bitrate,
        echoes: true,
        simulated: true,
    };
    (log.collect(), vec![bus])
}

/// Goes through a session once more, of one program or of a machine that stayed on, with the machine as it was when that
/// began; its own commands.
pub(crate) fn again(rig: &mut Rig, program: Option<&str>, accepted: &[Accepted]) -> Vec<Accepted> {
    let folder = Folder::new();
    let machine = &rig.machine;
    let programs = Programs::new(machine, &folder.path("machine.toml")).unwrap();
    let (log, buses) = recorded(rig);
    let layout = Arc::clone(&rig.layout);
    let observers = Observers::new(machine, None, None, false);
    let session = if let Some(text) = program {
        let program = programs.file(&folder.file("program.ngc", text));
        let operators = Operators::Recorded;
        let (replay, moves) = Replay::new(layout, buses, operators, program, log).unwrap();
        Session::new(&rig.layout, replay, moves, observers)
    } else {
        let replay = Replay::staying_on(layout, buses, log).unwrap();
        Session::staying_on(&rig.layout, replay, programs, observers)
    };
    let (outcome, heard) = gone_through(session, accepted);
    assert_eq!(outcome.difference, None, "{accepted:?}");
    assert!(outcome.end.is_some() && outcome.end == rig.session.timeline().controller().end());
    heard
}

/// Has the commands handed in, each in its cycle; what is found, and what takes effect.
fn gone_through(mut session: Session<Replay>, accepted: &[Accepted]) -> (Outcome, Vec<Accepted>) {
    let told = session.subscribe();
    let mut recorded = Recorded::new(accepted.iter().cloned());
    let mut heard = Vec::new();
    let mut progress = Progress::More;
    while progress != Progress::Ended {
        if let Some(cycle) = session.timeline().setpoints_of() {
            recorded.hand_in(&mut session, cycle);
        }
        progress = session.advance();
        heard.extend(accepted_of(&told));
    }
    assert_eq!(recorded.left(), None);
    (session.timeline().outcome(), heard)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn a_session_is_a_function_of_its_commands_and_frames(
        commands in prop::collection::vec((after(), command()), 0..12),
        // Also before the first SYNC.
        before in 0..700_usize,
        stops in prop::bool::weighted(0.2),
    ) {
        let first = [(before, Command::OptionalStop(SwitchChange::Toggle))];
        let commands: Vec<_> = first.into_iter().chain(commands).collect();
        let (mut rig, accepted) = acted(&commands, stops);
        prop_assert_eq!(again(&mut rig, Some(PROGRAM), &accepted), accepted);
    }

    /// Jobs one after the other, with what each leaves to the next, jogs, drives that are disabled and
    /// enabled, faults and what brings them back.
    #[test]
    fn a_day_is_a_function_of_its_commands_and_frames(
        deeds in prop::collection::vec((day::deed(), after()), 1..16),
        before in 0..1200_usize,
    ) {
        let first = [(Deed::Command(Command::Load("0.ngc".into())), before)];
        let deeds: Vec<_> = first.into_iter().chain(deeds).collect();
        let (mut rig, accepted) = day_of(&deeds);
        prop_assert_eq!(again(&mut rig, None, &accepted), accepted);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// What the session does by itself has its cycle as well: a program that is loaded once more, however long behind a stop or
    /// a fault, is begun by cycle start; one that is loaded before that is over is not.
    #[test]
    fn a_program_that_is_loaded_behind_a_stop_is_loaded_there_once_more(
        fails: bool, runs in 5..400_usize, after in after(), then in after(),
    ) {
        let mut rig = Rig::staying_on("portal", &[], |_, _| ());
        rig.goes_on = false;
        let part = rig.folder.file("part.ngc", "G21 G90 G61\nG1 X30 F1500\nM0\nG1 X0\nM2\n");
        let told = rig.session.subscribe();
        let mut accepted = Vec::new();
        day::settle(&mut rig);
        rig.command(Command::Load(part.clone()));
        rig.command(Command::Run { from_line: None });
        for _ in 0..runs {
            hear(&mut rig, &told, &mut accepted);
        }
        if fails {
            rig.twin(2).disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
            day::settle(&mut rig);
        } else {
            rig.command(Command::Stop);
        }
        for _ in 0..after {
            hear(&mut rig, &told, &mut accepted);
        }
        rig.command(Command::Load(part));
        for _ in 0..then {
            hear(&mut rig, &told, &mut accepted);
        }
        if fails {
            day::go(&mut rig, Command::Reset);
        }
        day::go(&mut rig, Command::CycleStart);
        rig.command(Command::SwitchOff);
        while hear(&mut rig, &told, &mut accepted) {}
        prop_assert_eq!(again(&mut rig, None, &accepted), accepted);
    }
}

/// The sides of a gantry that stand askew as it is enabled are taken square, to the end or until somebody stops that: by the
/// commands and the frames once more, bit for bit.
#[test]
fn a_gantry_that_is_taken_square_is_a_function_of_its_frames() {
    for (skew, stops) in [(0.3, false), (-0.4, false), (0.4, true)] {
        let mut rig = Rig::staying_on("portal", &[], |drive, config| match drive {
            // 20 mm a turn; the second one is mirrored.
            0 => config.position += 300.0 / 20.0,
            1 => config.position -= (300.0 + skew) / 20.0,
            _ => {}
        });
        let told = rig.session.subscribe();
        rig.run_to(Phase::Square);
        if stops {
            for _ in 0..16 {
                rig.step();
            }
            rig.command(Command::Disable);
        }
        day::settle(&mut rig);
        let commands = match stops {
            true => vec![Command::Enable],
            false => vec![Command::Disable, Command::Enable],
        };
        for command in commands {
            day::go(&mut rig, command);
        }
        day::mdi(&mut rig, "G0 X320 Y10");
        day::go(&mut rig, Command::SwitchOff);
        while rig.step() {}
        assert_eq!((&rig.refused[..], &rig.problems[..]), (&[][..], &[][..]));
        let squared = rig
            .phases
            .iter()
            .filter(|(phase, _)| *phase == Phase::Square);
        assert!(squared.count() > usize::from(stops), "{:?}", rig.phases);
        let accepted: Vec<_> = accepted_of(&told).collect();
        assert_eq!(told.missed(), 0);
        assert_eq!(again(&mut rig, None, &accepted), accepted);
    }
}
