//! What the machine does about whatever goes wrong, whenever, as the bus shows it: the reaction of the table,
//! commanded within two cycles of the cycle that showed the cause, and nothing enabled again.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{CanId, CobId, Instant, NodeId};
use syncline_controller::control::{Event, Phase, Reaction, State};
use syncline_controller::session::{Command, Direction, Jog};
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// The gantry's sides, Y and Z; Z has the inputs.
const DRIVES: usize = 4;
const Z: usize = 3;

const WIRED: &str = r#"
[[output]]
name = "valve"
drive = "Y"
signal = "DQ0"
number = 1

[[input]]
name = "enable"
drive = "Z"
signal = "DI0"
function = "enable"

[machine]
"#;

const PROGRAM: &str = "M64 P1\nG1 X300 Y200 F9000\nG2 X400 Y300 I100 J0\nM0\nG4 P1\nG1 X0 Y0\nM2\n";

/// What the machine does when it happens.
#[derive(Clone, Copy, Debug)]
enum When {
    Rests,
    Jogs,
    Runs(usize),
    Held,
    Stops(usize),
}

fn when() -> impl Strategy<Value = When> {
    prop_oneof![
        1 => Just(When::Rests),
        1 => Just(When::Jogs),
        4 => (0..900_usize).prop_map(When::Runs),
        1 => Just(When::Held),
        2 => (0..40_usize).prop_map(When::Stops),
    ]
}

/// What happens.
#[derive(Clone, Copy, Debug)]
enum What {
    Disturb(Disturbance),
    EnableLost,
    BurstsDropped,
    BusTorn,
    Unplugged,
}

fn what() -> impl Strategy<Value = What> {
    let disturb = select(vec![
        Disturbance::Fault(ErrorClass::QuickStop),
        Disturbance::Fault(ErrorClass::StopAndSwitchOff),
        Disturbance::Fault(ErrorClass::SwitchOff),
        Disturbance::LoseTPdos(20),
        Disturbance::Mute(true),
        Disturbance::Mains(false),
        Disturbance::Block(true),
    ]);
    prop_oneof![
        5 => disturb.prop_map(What::Disturb),
        2 => Just(What::EnableLost),
        1 => Just(What::BurstsDropped),
        1 => Just(What::BusTorn),
        1 => Just(What::Unplugged),
    ]
}

fn state(rig: &Rig) -> State {
    rig.session.status().state
}

/// A portal that does something.
fn at_work(when: When) -> Rig {
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], |_, _| ());
    rig.goes_on = false;
    rig.twin(Z).disturb(Disturbance::Input(0, true));
    rig.run_until(|rig| state(rig) == State::Ready);
    let steps = |rig: &mut Rig, cycles: usize| {
        for _ in 0..2 * cycles {
            rig.step();
        }
    };
    if matches!(when, When::Jogs) {
        rig.command(Command::Jog(Jog::Continuous {
            axis: AxisLetter::X,
            direction: Direction::Positive,
            speed: Some(100.0),
        }));
        steps(&mut rig, 50);
    }
    if let When::Runs(_) | When::Held | When::Stops(_) = when {
        let file = rig.folder.file("part.ngc", PROGRAM);
        rig.command(Command::Load(file));
        rig.command(Command::Run { from_line: None });
        rig.run_until(|rig| state(rig) == State::Running);
    }
    match when {
        When::Runs(cycles) => steps(&mut rig, cycles),
        When::Held => {
            steps(&mut rig, 300);
            rig.command(Command::FeedHold);
            rig.run_until(|rig| state(rig) == State::Held);
        }
        When::Stops(cycles) => {
            steps(&mut rig, 400);
            rig.command(Command::Stop);
            steps(&mut rig, cycles);
        }
        When::Rests | When::Jogs => {}
    }
    rig
}

/// When a drive, after `since`, was first sent one of these controlwords.
fn commanded(
    frames: &[Transmission],
    drive: usize,
    since: Instant,
    words: &[u8],
) -> Option<Instant> {
    let id = CanId::from(CobId::r_pdo(2, NodeId::new(drive as u8 + 1).unwrap()));
    let mut sent = frames
        .iter()
        .filter(|it| it.sender == Sender::Port && it.frame.id() == id && it.start > since);
    let found = sent.find(|it| words.contains(&it.frame.data()[0]))?;
    Some(found.start)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, ..ProptestConfig::default() })]

    #[test]
    fn whatever_goes_wrong_the_reaction_is_commanded_within_two_cycles(
        when in when(), what in what(), drive in 0..DRIVES,
    ) {
        let mut rig = at_work(when);
        match what {
            What::Disturb(disturbance) => rig.twin(drive).disturb(disturbance),
            What::EnableLost => rig.twin(Z).disturb(Disturbance::Input(0, false)),
            What::BurstsDropped => rig.bus().drop_bursts = 2,
            What::BusTorn => rig.bus().tear_bursts = 1,
            What::Unplugged => rig.bus().unplugged = true,
        }
        // Until something is wrong; a blocked axis at rest is not, and without motion no burst counts.
        let mut told = None;
        for _ in 0..3000 {
            rig.step();
            let fault = rig.events.iter().find_map(|event| match event {
                Event::Fault(fault) => Some(*fault),
                _ => None,
            });
            if fault.is_some() {
                told = fault;
                break;
            }
        }
        let Some(fault) = told else {
            prop_assert!(matches!(what, What::Disturb(Disturbance::Block(true) | Disturbance::LoseTPdos(_)) | What::BurstsDropped | What::BusTorn), "nothing found");
            return Ok(());
        };
        let phase = rig.phases.last().map(|(phase, _)| *phase);
        let (cycle, seen) = (rig.machine.cycle, rig.session.timeline().now());
        for _ in 0..12_000 {
            rig.step();
            if state(&rig) == State::Faulted {
                break;
            }
        }
        prop_assert_eq!(state(&rig), State::Faulted);
        prop_assert_eq!(rig.session.faults().first(), Some(&fault));
        let pair = matches!(rig.layout.devices.len(), DRIVES) && (0..2).any(|side| concerns(&fault, side));
        let reaction = match fault.cause().rule().reaction {
            Reaction::QuickStopAxis if pair => Reaction::QuickStopAll,
            reaction => reaction,
        };
        let frames = rig.frames();
        let soon = seen + 2 * cycle;
        let before = Instant::from_nanos(seen.as_nanos().saturating_sub(1));
        for drive in 0..DRIVES {
            let quick = match reaction {
                Reaction::QuickStopAll => true,
                Reaction::QuickStopAxis => concerns(&fault, drive),
                _ => false,
            };
            let by = commanded(&frames, drive, before, &[0x0B]);
            // Nobody is commanded over an interface that is gone.
            if matches!(what, What::Unplugged) {
                prop_assert_eq!(by, None, "drive {}", drive);
            } else if quick {
                prop_assert!(by.is_some_and(|at| at <= soon), "{:?}: drive {}, {:?} after {:?}", fault, drive, by, seen);
            } else if rig.session.faults().len() == 1 {
                prop_assert_eq!(by, None, "{:?}: drive {}", fault, drive);
            }
            // Nothing is enabled again behind a quick stop.
            if let Some(at) = by {
                prop_assert_eq!(commanded(&frames, drive, at, &[0x0F, 0x1F]), None);
            }
        }
        prop_assert!(matches!(phase, Some(Phase::Stop | Phase::QuickStop | Phase::ModeEnd | Phase::Disable)), "{:?}", phase);
        // The valve is safe: the R_PDO of Y carries it.
        let id = CanId::from(CobId::r_pdo(2, NodeId::new(3).unwrap()));
        let valve = frames.iter().filter(|it| it.sender == Sender::Port && it.frame.id() == id && it.start > soon);
        for sent in valve {
            prop_assert_eq!(sent.frame.data()[6], 0);
        }
    }
}

/// Whether a fault concerns a drive, by the portal's layout.
fn concerns(fault: &syncline_controller::control::Fault, drive: usize) -> bool {
    use syncline_controller::control::Fault;
    match *fault {
        Fault::Device(of, _) => of == drive,
        Fault::Axis(0, _) => drive < 2,
        Fault::Axis(axis, _) => axis + 1 == drive,
        Fault::Bus(..) => true,
        _ => false,
    }
}
