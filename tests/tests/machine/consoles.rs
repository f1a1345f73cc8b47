//! Several consoles on one session: whoever commands, all see the same; and what was commanded, with
//! its cycles, makes the same run again.

use proptest::prelude::*;
use syncline_controller::control::{self, End, State};
use syncline_controller::session::{
    Accepted, Command, Direction, Event, Jog, Operator, Override, Refusal, StepChange,
    Subscription, SwitchChange,
};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// A line and an arc at 100 mm/s, with a program stop and M-codes.
const PROGRAM: &str = "\
G17 G21 G90 G94 G61 F6000
M3 S1000
G1 X300 Y100
M0
M8 G3 X300 Y300 J100
M2
";

/// A screen with keys.
struct Console {
    keys: Operator,
    screen: Subscription,
    shown: Vec<String>,
    accepted: Vec<Accepted>,
}

impl Console {
    fn new(rig: &mut Rig, name: &str) -> Self {
        Self {
            keys: rig.session.operator(name),
            screen: rig.session.subscribe(),
            shown: Vec::new(),
            accepted: Vec::new(),
        }
    }

    fn press(&self, command: Command) {
        self.keys.command(command).unwrap();
    }

    fn look(&mut self) {
        for event in self.screen.events() {
            self.shown.push(format!("{event:?}"));
            if let Event::Accepted(accepted) = event {
                self.accepted.push(accepted);
            }
        }
    }

    /// The program's stop has been told that often.
    fn stops(&self) -> usize {
        let stops = self.shown.iter().filter(|it| it.contains("Paused"));
        stops.count()
    }
}

/// What sets something going.
fn goings() -> impl Strategy<Value = Command> {
    let jog = Command::Jog(Jog::By {
        axis: AxisLetter::X,
        distance: 5.0,
        speed: None,
    });
    let mut there = [None; 9];
    there[0] = Some(20.0);
    prop::sample::select(vec![
        Command::Run { from_line: None },
        Command::CycleStart,
        Command::Resume,
        Command::Mdi("G0 X50".to_owned()),
        Command::GoTo(there),
        jog,
    ])
}

/// What does not.
fn settings() -> impl Strategy<Value = Command> {
    prop::sample::select(vec![
        Command::FeedOverride(Override::By(10.0)),
        Command::SingleBlock(SwitchChange::To(false)),
        Command::FeedHold,
    ])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Whoever gave what before a stop, nothing of it begins behind it; what sets nothing going is done, and so is what
    /// comes behind the stop.
    #[test]
    fn nothing_that_was_given_before_a_stop_begins_behind_it(
        before in prop::collection::vec((any::<bool>(), prop_oneof![goings(), settings()]), 1..6),
        stops in prop::collection::vec(any::<bool>(), 1..3), again: bool,
    ) {
        let mut rig = Rig::staying_on("portal", &[], |_, _| ());
        rig.run_until(|rig| rig.session.status().state == State::Ready);
        let file = rig.folder.file("part.ngc", PROGRAM);
        rig.command(Command::Load(file));
        (0..6).for_each(|_| assert!(rig.step()));
        let keys = ["keys", "panel"].map(|name| rig.session.operator(name));
        let mut given = 0;
        for (place, of) in stops.iter().enumerate() {
            for (of, command) in &before[..before.len() / (place + 1)] {
                keys[usize::from(*of)].command(command.clone()).unwrap();
                given += usize::from(goes(command));
            }
            keys[usize::from(*of)].command(Command::Stop).unwrap();
        }
        if again {
            keys[0].command(Command::Mdi("G0 X50".to_owned())).unwrap();
        }
        let from = rig.rows.len();
        (0..60).for_each(|_| assert!(rig.step()));
        let stopped = rig.refused.iter().filter(|it| it.reason == Refusal::Stopped).count();
        prop_assert_eq!(stopped, given);
        let moved = rig.rows[from..].iter().any(|row| row.plan.speed > 0.0);
        prop_assert_eq!(moved, again);
    }
}

fn goes(command: &Command) -> bool {
    !matches!(
        command,
        Command::FeedOverride(_) | Command::SingleBlock(_) | Command::FeedHold
    )
}

fn go_on(rig: &mut Rig, consoles: &mut [Console; 2], rows: usize) {
    let until = rig.rows.len() + rows;
    while rig.rows.len() < until && rig.step() {
        consoles.iter_mut().for_each(Console::look);
    }
}

/// Where the program is held and nobody plans, it is at rest.
fn rests(rig: &Rig) -> bool {
    rig.session.status().waits
}

#[test]
fn two_consoles_agree_about_everything() {
    let mut rig = Rig::portal(PROGRAM);
    rig.goes_on = false;
    let mut consoles = ["panel", "keys"].map(|name| Console::new(&mut rig, name));
    go_on(&mut rig, &mut consoles, 300);
    let [panel, keys] = &consoles;
    panel.press(Command::FeedOverride(Override::To(80.0)));
    keys.press(Command::FeedOverride(Override::By(-10.0)));
    panel.press(Command::RapidOverride(Override::By(-50.0)));
    keys.press(Command::JogStep(StepChange::Greater));
    go_on(&mut rig, &mut consoles, 1);
    let settings = rig.session.status().settings;
    assert_eq!(
        [
            settings.feed_override,
            settings.rapid_override,
            settings.jog_step
        ],
        [70.0, 50.0, 10.0]
    );
    assert_eq!(rig.session.view().get(), *rig.session.status());
    let text = serde_json::to_string(rig.session.status()).unwrap();
    let read: syncline_controller::session::Status = serde_json::from_str(&text).unwrap();
    assert_eq!(read, *rig.session.status());

    consoles[0].press(Command::ToggleFeedHold);
    go_on(&mut rig, &mut consoles, 400);
    assert!(rests(&rig));
    consoles[1].press(Command::Jog(Jog::Step {
        axis: AxisLetter::Z,
        direction: Direction::Negative,
    }));
    go_on(&mut rig, &mut consoles, 400);
    assert!(rig.session.status().off_path);
    let z = rig.session.status().setpoint[2];
    assert!((z + 10.0).abs() < 1e-3, "by the step that was set: {z}");
    consoles[1].press(Command::ToggleFeedHold);
    while consoles[0].stops() == 0 {
        go_on(&mut rig, &mut consoles, 1);
    }
    consoles[0].press(Command::CycleStart);
    while rig.step() {
        consoles.iter_mut().for_each(Console::look);
    }
    consoles.iter_mut().for_each(Console::look);
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);

    let [panel, keys] = &consoles;
    assert_eq!(panel.shown, keys.shown);
    assert_eq!(panel.accepted, keys.accepted);
    assert_eq!([panel.screen.missed(), keys.screen.missed()], [0, 0]);
    let sources = panel.accepted.iter().map(|it| it.source.as_str());
    assert!(
        sources.eq([
            "panel", "keys", "panel", "keys", "panel", "keys", "keys", "panel"
        ]),
        "{:?}",
        panel.accepted
    );
    assert!(panel.accepted.is_sorted_by_key(|it| it.cycle));
    let switched = panel.shown.iter().filter(|it| it.contains("Switched"));
    // What it switches on its end switches off.
    assert_eq!(switched.count(), 4, "{:?}", panel.shown);

    // Once more, from the log alone.
    let log: Vec<String> = (panel.accepted.iter())
        .map(|accepted| serde_json::to_string(accepted).unwrap())
        .collect();
    let mut again = Rig::portal(PROGRAM);
    again.goes_on = false;
    let mut left = log.iter().map(|line| serde_json::from_str(line).unwrap());
    let mut next: Option<Accepted> = left.next();
    loop {
        while let Some(accepted) = &next
            && accepted.cycle <= again.controller().cycle()
        {
            again.command(accepted.command.clone());
            next = left.next();
        }
        if !again.step() {
            break;
        }
    }
    assert_eq!(next, None);
    assert_eq!(again.frames(), rig.frames());
}

/// M1 is a stop if the optional stop is on when the path comes there, whoever switched it.
#[test]
fn a_switch_of_one_console_is_the_others_too() {
    let mut rig = Rig::portal("G61 G1 X100 F6000\nM1\nX200\nM1\nX300\nM1\nX400\nM2\n");
    rig.goes_on = false;
    let mut consoles = ["panel", "keys"].map(|name| Console::new(&mut rig, name));
    let mut press = |rig: &mut Rig, console: usize, command| {
        consoles[console].press(command);
        go_on(rig, &mut consoles, 1);
        rig.session.view().get().settings
    };
    let beyond = |rig: &mut Rig, x: f64| {
        rig.run_until(|rig| rig.session.status().setpoint[0] > x);
    };
    beyond(&mut rig, 150.0);
    let toggled = Command::OptionalStop(SwitchChange::Toggle);
    assert!(press(&mut rig, 0, toggled.clone()).optional_stop);
    rig.run_until(|rig| matches!(rig.events.last(), Some(control::Event::Paused { .. })));
    assert_eq!(rig.session.status().setpoint[0], 200.0);
    // It waits for cycle start, not for the switch.
    assert!(!press(&mut rig, 1, toggled).optional_stop);
    go_on(&mut rig, &mut consoles, 100);
    assert_eq!(rig.session.status().setpoint[0], 200.0);
    consoles[1].press(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(rig.session.status().setpoint[0], 400.0);
    let stops = (rig.events.iter()).filter(|it| matches!(it, control::Event::Paused { .. }));
    assert_eq!(stops.count(), 1, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

/// Who does not listen misses something and is told how much; nobody waits for them.
#[test]
fn a_console_that_does_not_listen_is_in_nobodys_way() {
    let mut rig = Rig::portal("G0 X1\nM2\n");
    let deaf = rig.session.subscribe();
    let operator = rig.session.operator("panel");
    rig.run_until(|rig| !rig.rows.is_empty());
    for _ in 0..50 {
        for _ in 0..100 {
            operator
                .command(Command::JogStep(StepChange::To(0.5)))
                .unwrap();
        }
        rig.step();
    }
    assert_eq!(rig.finish(), End::Finished);
    let heard = deaf.events().count() as u64;
    let all = 50 * 100 + (rig.events.len() + rig.states.len()) as u64;
    assert_eq!(heard + deaf.missed(), all);
    assert!(deaf.missed() > 0);
    let first = control::Event::Phase(control::Phase::Survey);
    assert_eq!(rig.events.first(), Some(&first));
}
