//! Why a job rests: whatever it rests for, the status gives the one reason, and it is true.

use super::day::{go, settle};
use proptest::prelude::*;
use proptest::sample::select;
use syncline_controller::control::{
    Event, Hold, Refusal as OrderRefusal, State, Waiting, ZeroOverrides,
};
use syncline_controller::session::{Command, Override, Refusal};
use syncline_drives::twin::Disturbance;
use syncline_tests::rig::Rig;

/// A spindle that an input of the drive Z, the fourth, tells to have its speed, an input that a program waits for, and one
/// for cycle start.
const WIRED: &str = r#"
[spindle]
max_speed = 3000
ramp_ms = 1000

[[input]]
name = "part"
drive = "Z"
signal = "DI0"
number = 5

[[input]]
name = "at speed"
drive = "Z"
signal = "DI1"
function = "at_speed"

[[input]]
name = "start"
drive = "Z"
signal = "DI3"
function = "cycle_start"

[machine]
"#;
const INPUTS: usize = 3;
const START: u8 = 3;

const NO_FEED: ZeroOverrides = ZeroOverrides {
    feed: true,
    rapid: false,
};

/// The portal with these signals, which stays on, at work on a program.
fn at_work(program: &str) -> Rig {
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], |_, _| ());
    settle(&mut rig);
    rig.goes_on = false;
    let file = rig.folder.file("part.ngc", program);
    go(&mut rig, Command::Load(file));
    rig.command(Command::Run { from_line: None });
    rig.run_until(|rig| state(rig) == State::Running);
    rig
}

fn state(rig: &Rig) -> State {
    rig.session.status().state
}

fn waiting(rig: &Rig) -> Option<Waiting> {
    rig.session.status().waiting
}

fn moves(rig: &Rig) -> bool {
    let velocity = rig.session.status().velocity;
    velocity.iter().any(|by| *by != 0.0)
}

fn feed(to: f64) -> Command {
    Command::FeedOverride(Override::To(to))
}

fn set(rig: &mut Rig, input: u8, on: bool) {
    rig.twin(INPUTS).disturb(Disturbance::Input(input, on));
}

/// It is told as what it is, and not as a feed hold; resume and cycle start say what to do, and raising it is all it takes.
#[test]
fn a_feed_override_of_0_is_told_and_so_is_what_to_do() {
    let mut rig = at_work("G21 G90 G1 X200 F6000\nM2\n");
    rig.run_until(|rig| moves(rig));
    rig.command(feed(0.0));
    rig.run_until(|rig| state(rig) == State::Held);
    let told = Event::Held(Hold::NoSpeed(NO_FEED));
    assert_eq!(rig.events.last(), Some(&told));
    assert!(!rig.events.contains(&Event::Held(Hold::Operator)));
    let text = told.describe(&*rig.layout.clone()).unwrap();
    assert_eq!(
        text,
        "held on the path: the feed override is 0: raise it to go on"
    );
    for command in [Command::Resume, Command::CycleStart] {
        rig.refused.clear();
        go(&mut rig, command);
        assert_eq!(waiting(&rig), Some(Waiting::Override(NO_FEED)));
        let reason = &rig.refused[0].reason;
        let expected = Refusal::Machine(OrderRefusal::NoSpeed(NO_FEED));
        assert_eq!(reason, &expected);
        assert!(
            reason.to_string().contains("the feed override is 0"),
            "{reason}"
        );
    }
    // The button has nobody to refuse it to.
    let told = rig.events.len();
    set(&mut rig, START, true);
    for _ in 0..20 {
        rig.step();
    }
    let why = Event::Waits(Waiting::Override(NO_FEED));
    assert!(rig.events[told..].contains(&why), "{:?}", rig.events);
    rig.command(feed(100.0));
    rig.run_until(|rig| moves(rig));
    assert_eq!((state(&rig), waiting(&rig)), (State::Running, None));
    // Who presses the key for feed hold holds it, and is told so.
    rig.command(feed(0.0));
    rig.run_until(|rig| state(rig) == State::Held);
    go(&mut rig, Command::ToggleFeedHold);
    assert_eq!(rig.events.last(), Some(&Event::Held(Hold::Operator)));
    assert_eq!(waiting(&rig), None);
    // Resumed, it rests for the override again.
    go(&mut rig, Command::Resume);
    assert_eq!(
        rig.events.last(),
        Some(&Event::Held(Hold::NoSpeed(NO_FEED)))
    );
    go(&mut rig, feed(100.0));
    assert_eq!(state(&rig), State::Ready);
}

/// What lasts is told once, by name and with the time that is left, and what is routine is not.
#[test]
fn a_rest_that_lasts_is_told_with_its_reason() {
    let mut rig = at_work("G21 G90 G1 X10 F6000\nG4 P3\nM66 P5 L3 Q5\nX20\nM2\n");
    settle(&mut rig);
    let layout = rig.layout.clone();
    let told: Vec<_> = (rig.events.iter())
        .filter(|event| matches!(event, Event::Waits(_)))
        .map(|event| (event.is_routine(), event.describe(&*layout).unwrap()))
        .collect();
    let dwells = (true, "dwells, 1.0 s left".to_owned());
    let input = (false, "waits for input \"part\" on, 3.0 s left".to_owned());
    assert_eq!(told, [dwells, input]);
}

/// Blocks that move, and blocks that have the path rest: what for, and for how long, s. The at-speed input stays off.
const BLOCKS: [(&str, Option<(&str, f64)>); 6] = [
    ("G1 X10", None),
    ("G1 X30 Y5", None),
    ("G0 X0", None),
    ("G4 P0.3", Some(("dwell", 0.3))),
    ("M66 P5 L3 Q0.25", Some(("input", 0.25))),
    ("M66 P5 L1 Q0.4", Some(("input", 0.4))),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whenever a program is at work and nothing moves, there is a reason, of the block at work, and the time that is left
    /// is the truth to a few cycles; where something moves there is none.
    #[test]
    fn a_job_that_rests_says_for_what(
        blocks in prop::collection::vec(select(&BLOCKS[..]), 1..8),
        spindle: bool,
        zero_at in prop::option::of(100..900usize),
    ) {
        let mut text = "G21 G90 F3000\n".to_owned();
        // Its first cut waits for its speed, 2 s and then for an operator.
        text += if spindle { "M3 S500\nG1 X5\n" } else { "\n\n" };
        for (block, _) in &blocks {
            text += block;
            text += "\n";
        }
        let mut rig = at_work(&(text + "M2\n"));
        let period = rig.machine.cycle.as_secs_f64();
        let (mut rested, mut unexplained) = (0, 0);
        let (mut begun, mut reasons) = (None::<(Waiting, usize)>, 0);
        for step in 0.. {
            if state(&rig) == State::Ready {
                break;
            }
            if Some(step) == zero_at {
                rig.command(feed(0.0));
            }
            rig.step();
            let at_rest = !moves(&rig);
            rested = if at_rest { rested + 1 } else { 0 };
            let (state, now) = (state(&rig), waiting(&rig));
            if !at_rest {
                prop_assert_eq!(now, None);
            }
            if state == State::Held {
                // The spindle does not come to its speed, or nothing is left of it.
                match now {
                    Some(Waiting::Override(zero)) => {
                        prop_assert_eq!(zero, NO_FEED);
                        rig.command(feed(100.0));
                    }
                    now => {
                        prop_assert_eq!(now, None);
                        rig.command(Command::CycleStart);
                    }
                }
            }
            // A wake-up comes twice a cycle, and what is switched or passed may take a few.
            let explains = !at_rest || now.is_some() || state != State::Running;
            unexplained = if explains { 0 } else { unexplained + 1 };
            prop_assert!(
                unexplained < 12 || rig.controller().job().is_none(),
                "at rest in line {} without a reason",
                rig.session.status().line
            );
            let same = |before: &(Waiting, usize)| {
                now.is_some_and(|now| std::mem::discriminant(&now) == std::mem::discriminant(&before.0))
            };
            begun = begun.filter(same).or(now.map(|now| (now, rig.rows.len())));
            let line = rig.session.status().line as usize;
            let block = line.checked_sub(4).and_then(|at| blocks.get(at));
            let expected = block.and_then(|(_, rests)| *rests);
            let of_time = match now {
                Some(Waiting::Dwell { left }) => Some(("dwell", left)),
                Some(Waiting::Input { left, input, on }) => {
                    prop_assert_eq!((rig.machine.inputs[input].name.as_str(), on), ("part", true));
                    Some(("input", left))
                }
                Some(Waiting::SpindleSpeed { left }) => {
                    prop_assert!(spindle && line <= 3, "{}", line);
                    Some(("spindle", left))
                }
                Some(Waiting::Plan | Waiting::Override(_)) | None => None,
                other => panic!("{other:?}"),
            };
            if let Some((what, left)) = of_time {
                reasons += 1;
                // A dwell has no move, and so no line, of its own.
                if let (Some((expected, within)), true) = (expected, rested > 12 && what == "input") {
                    prop_assert_eq!(what, expected);
                    prop_assert!(left <= within + 1e-9 && left >= 0.0, "{} of {}", left, within);
                }
                let (before, since) = begun.expect("it has begun");
                let passed = (rig.rows.len() - since) as f64 * period;
                let first = match before {
                    Waiting::Dwell { left } | Waiting::Input { left, .. } | Waiting::SpindleSpeed { left } => left,
                    _ => left,
                };
                prop_assert!(left + passed >= first - 3.0 * period, "{} of {}, {} s later", left, first, passed);
            }
        }
        let rests = blocks.iter().any(|(_, rests)| rests.is_some());
        prop_assert!(reasons > 0 || !rests && !spindle);
        prop_assert_eq!(waiting(&rig), None);
    }
}
