//! Devices of several kinds that are lost while the machine does something else than run a program, and come back: each is told as it
//! is in a program, all drives stand, and the machine is brought back by a reset.

use super::day::{go, settle, state};
use super::homing::home;
use super::losses::{self, By, LOSSES, Loss, stated};
use super::velocity;
use proptest::prelude::*;
use syncline_controller::control::{Event, State};
use syncline_controller::session::{Command, Direction, Jog};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// What the machine does when it happens.
#[derive(Clone, Copy, Debug, PartialEq)]
enum When {
    Ready,
    Jogs,
    Held,
    Disabled,
    /// Y makes its test move.
    Homes,
}

const ALWAYS: [When; 5] = [
    When::Ready,
    When::Jogs,
    When::Held,
    When::Disabled,
    When::Homes,
];

fn steps(rig: &mut Rig, wake_ups: usize) {
    for _ in 0..wake_ups {
        rig.step();
    }
}

fn at_work(when: When) -> Rig {
    let tested = velocity::UNSUPERVISED.replace(
        "\n\n[[axis]]",
        "\nhoming = { kind = \"encoder\", test_move = 4.0 }\n\n[[axis]]",
    );
    let more = [(velocity::UNSUPERVISED, &*tested)];
    let mut rig = losses::staying_on(if when == When::Homes { &more } else { &[] });
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    match when {
        When::Ready => {}
        When::Jogs => {
            rig.command(Command::Jog(Jog::Continuous {
                axis: AxisLetter::Y,
                direction: Direction::Positive,
                speed: Some(50.0),
            }));
            steps(&mut rig, 40);
            assert_eq!(state(&rig), State::Jogging);
        }
        When::Held => {
            let file = rig.folder.file("part.ngc", losses::PROGRAM);
            go(&mut rig, Command::Load(file));
            rig.command(Command::Run { from_line: None });
            rig.run_until(|rig| state(rig) == State::Running);
            steps(&mut rig, 200);
            go(&mut rig, Command::FeedHold);
            assert_eq!(state(&rig), State::Held);
        }
        When::Disabled => {
            go(&mut rig, Command::Disable);
            assert_eq!(state(&rig), State::Disabled);
        }
        When::Homes => {
            rig.command(home(AxisLetter::Y));
            steps(&mut rig, 400);
            assert_eq!(state(&rig), State::Homing);
        }
    }
    rig
}

/// The device is as it was.
fn returns(rig: &mut Rig, device: usize, loss: Loss) {
    rig.bus().doctor = None;
    let disturbance = match loss {
        Loss::Power => Disturbance::Mains(true),
        Loss::Bus => Disturbance::Mute(false),
        Loss::LocalControl => Disturbance::Remote(true),
        Loss::Control | Loss::Heartbeat | Loss::Error => return,
    };
    rig.twin(device).disturb(disturbance);
}

/// Without power on its stage a drive has none to lose, and who has control of it does not matter.
fn matters(when: When, loss: Loss) -> bool {
    when != When::Disabled || !matches!(loss, Loss::Power | Loss::LocalControl)
}

fn check(when: When, wake_ups: usize, (device, loss, by, text): (usize, Loss, By, &str)) {
    let mut rig = at_work(when);
    steps(&mut rig, wake_ups);
    let (told, before) = (rig.events.len(), rig.session.timeline().now());
    losses::happen(&mut rig, device, loss);
    let fault = |rig: &Rig| {
        let mut events = rig.events[told..].iter();
        events.find_map(|event| match event {
            Event::Fault(fault) => Some(fault.describe(&*rig.layout)),
            _ => None,
        })
    };
    let within = stated(&rig, device, by);
    while fault(&rig).is_none() && rig.session.timeline().now() < before + 2 * within {
        rig.step();
    }
    let after = rig.session.timeline().now().saturating_since(before);
    let case = format!(
        "{when:?}, device {device} {loss:?}: {:?}, {after:?}",
        fault(&rig)
    );
    println!("{case}");
    if matters(when, loss) {
        // A stepper without current does not stay where its encoder tells that it should.
        let fault = fault(&rig).unwrap_or_default();
        let moved = (device, loss) == (losses::Z, Loss::Control) && fault.starts_with("axis Z: ");
        assert!(moved || fault.contains(text), "{case}");
        assert!(after <= within, "{case} of {within:?}");
        settle(&mut rig);
        assert_eq!(state(&rig), State::Faulted, "{case}");
    } else {
        settle(&mut rig);
    }
    // What another channel controls is that one's to stop.
    let obeys = |drive: &usize| (*drive, loss) != (device, Loss::LocalControl);
    for drive in (0..rig.machine.drives.len()).filter(obeys) {
        let seen = rig.twin(drive).observe();
        assert!(seen.velocity.abs() < 0.02, "{case}: {drive} {seen:?}");
    }
    returns(&mut rig, device, loss);
    go(&mut rig, Command::Reset);
    if state(&rig) == State::Disabled {
        go(&mut rig, Command::Enable);
    }
    assert_eq!(
        state(&rig),
        State::Ready,
        "{case}: {:?}",
        rig.session.faults()
    );
}

#[test]
fn each_loss_is_told_whatever_the_machine_does_and_a_reset_brings_it_back() {
    for case in LOSSES {
        check(When::Ready, 0, case);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn each_loss_is_told_at_any_time(
        when in prop::sample::select(ALWAYS.to_vec()), case in 0..LOSSES.len(), wake_ups in 0..200usize,
    ) {
        let wake_ups = if when == When::Jogs { wake_ups % 20 } else { wake_ups };
        check(when, wake_ups, LOSSES[case]);
    }
}
