//! Several consoles on one session: whoever commands, all see the same; and what was commanded, with
//! its cycles, makes the same run again.

use syncline_controller::control::{self, End};
use syncline_controller::session::{
    Accepted, Command, Direction, Event, Jog, Operator, Override, StepChange, Subscription,
    SwitchChange,
};
use syncline_gcode::Axis;
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
        axis: Axis::Z,
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
