//! Axes that are homed against a hard stop at limited torque: from anywhere, and everything that ends it on its way.

use super::homing::{ALL, Y, errors, failure, go, home, is_referenced, settle, state, truth};
use proptest::prelude::*;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CobId, Instant};
use syncline_controller::control::fault::{AxisCause, DeviceCause};
use syncline_controller::control::{Event, Fault, HomingFailure, State};
use syncline_controller::session::Command;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// The homing of the router's Y in its machine file.
const BY_SWITCH: &str = "kind = \"switch\"\norder = 2\nswitches = [\"home Y\"]\ndirection = \"negative\"\nspeed = 80.0\nslow_speed = 2.0\nback_off = 5.0\nposition = -4.0\nfinal_position = 0.0";
const HOME_Y: &str = "[[input]]\nname = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]\n";
/// Travel of Y in a radian of its motor, m.
const RADIAN: f64 = 0.02 / core::f64::consts::TAU;
/// Continuous stall torque of the motor of Y, N·m.
const STALL: f64 = 1.4;

/// A homing of Y against a hard stop.
#[derive(Clone, Debug)]
struct Case {
    positive: bool,
    /// The drive counts the other way than the axis.
    mirrored: bool,
    /// Where the axis stands, and how far its stop is ahead, mm.
    start: f64,
    ahead: f64,
    torque: f64,
    speed: f64,
    contact: u32,
    back_off: f64,
    min_distance: f64,
    max_distance: f64,
    /// More keys of the homing and of the simulated axis.
    homing: String,
    simulation: String,
    seed: u64,
}

impl Default for Case {
    fn default() -> Self {
        Self {
            positive: false,
            mirrored: false,
            start: 95.0,
            ahead: 101.0,
            torque: 30.0,
            speed: 15.0,
            contact: 50,
            back_off: 5.0,
            min_distance: 0.0,
            max_distance: 300.0,
            homing: String::new(),
            simulation: String::new(),
            seed: 0,
        }
    }
}

impl Case {
    fn direction(&self) -> f64 {
        if self.positive { 1.0 } else { -1.0 }
    }

    /// True position of the stop, mm.
    fn stop(&self) -> f64 {
        self.start + self.direction() * self.ahead
    }

    /// Goes that far off its stop in the end.
    fn away(self, far: f64) -> Self {
        let there = self.stop() - self.direction() * far;
        Self {
            homing: format!("final_position = {there:?}"),
            ..self
        }
    }

    /// What the router's file has instead.
    fn replacements(&self) -> Vec<(String, String)> {
        let (direction, stop) = match self.positive {
            true => ("positive", self.stop()),
            false => ("negative", self.stop()),
        };
        let stops = [stop, stop - self.direction() * 5000.0];
        let [least, most] = [stops[0].min(stops[1]), stops[0].max(stops[1])];
        let homing = format!(
            "kind = \"hard_stop\"\norder = 2\ndirection = \"{direction}\"\nweight = \"none\"\ntorque = {:?}\nspeed = {:?}\n\
             contact_ms = {}\nback_off = {:?}\nmin_distance = {:?}\nmax_distance = {:?}\nposition = {stop:?}\n{}",
            self.torque,
            self.speed,
            self.contact,
            self.back_off,
            self.min_distance,
            self.max_distance,
            self.homing
        );
        let simulation = format!(
            "start = {:?}\nend_stops = [{least:?}, {most:?}]\n{}",
            self.start, self.simulation
        );
        let mut replacements = vec![
            (HOME_Y.to_owned(), String::new()),
            (BY_SWITCH.to_owned(), homing),
            ("start = 95.0".to_owned(), simulation),
        ];
        if self.mirrored {
            let drive = "name = \"Y\"\nbus = \"main\"\nnode = 3\n";
            let mirrored = format!("{drive}direction = \"negative\"\n");
            replacements.push((drive.to_owned(), mirrored));
        }
        replacements
    }

    fn rig(&self) -> Rig {
        let replacements = self.replacements();
        let replacements: Vec<_> = (replacements.iter())
            .map(|(old, new)| (old.as_str(), new.as_str()))
            .collect();
        let seed = self.seed;
        let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
            config.seed = seed + drive as u64;
        });
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        rig
    }
}

/// What 3011h:C of the drive of Y was written so far, and when.
fn limits(rig: &Rig) -> Vec<(Instant, u16)> {
    let sent = rig.sent(CobId::r_sdo(rig.machine.drives[Y].node));
    let limits = sent.iter().filter_map(|it| match *it.frame.data() {
        [0x2B, 0x11, 0x30, 0x0C, low, high, ..] => {
            Some((it.start, u16::from_le_bytes([low, high])))
        }
        _ => None,
    });
    limits.collect()
}

/// The drive is limited as it was before, to which 0 sets it back.
fn is_as_before(rig: &Rig) -> bool {
    limits(rig).last().is_none_or(|(_, limit)| *limit == 0)
}

/// Homes Y, and holds its torque against the limit for as long as that is in effect.
fn homed(rig: &mut Rig, case: &Case) {
    rig.command(home(AxisLetter::Y));
    let mut samples = Vec::new();
    let mut since = 0;
    while since < 6 && rig.step() {
        let homes = state(rig) == State::Homing;
        since = if homes { 0 } else { since + 1 };
        let now = rig.session.timeline().now();
        samples.push((now, rig.twin(Y).observe().torque.abs()));
    }
    settle(rig);
    let [(lowered, _), (back, 0)] = limits(rig)[..] else {
        panic!("{:?}", limits(rig));
    };
    // As long as the answer to a request takes.
    let begin = lowered + Duration::from_millis(4);
    let weak = samples.iter().filter(|(at, _)| (begin..back).contains(at));
    let torque = weak.map(|(_, torque)| *torque).fold(0.0, f64::max);
    // A hundredth of an ampere, and what ripples.
    let most = STALL * case.torque / 100.0 * 1.02 + 0.01;
    assert!(torque <= most, "{torque} > {most}");
}

fn day() -> String {
    let case = Case::default();
    let mut rig = case.rig();
    go(&mut rig, ALL);
    assert_eq!(failure(&rig), None);
    for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
        assert!(is_referenced(&rig, axis), "{:?}", rig.events);
    }
    let shown = rig.session.status().setpoint[AxisLetter::Y.index()];
    assert_eq!(shown, 0.0);
    assert!(errors(&mut rig, AxisLetter::Y)[0].abs() < 0.005);
    assert_eq!(limits(&rig).len(), 2);
    go(&mut rig, Command::Mdi("G0 X20 Y30 Z-5".to_owned()));
    go(&mut rig, home(AxisLetter::Y));
    go(&mut rig, Command::Mdi("G0 X0 Y0 Z0".to_owned()));
    assert_eq!(rig.refused, []);
    assert!(is_as_before(&rig));
    go(&mut rig, Command::SwitchOff);
    assert_eq!(rig.problems, [""; 0]);
    rig.session.timeline().frames().result().0
}

#[test]
fn an_axis_is_homed_against_its_stop_among_others_and_the_same_twice() {
    assert_eq!(day(), day());
}

#[test]
fn a_run_that_homes_so_passes() {
    let replacements = Case::default().replacements();
    let replacements: Vec<_> = (replacements.iter())
        .map(|(old, new)| (&**old, &**new))
        .collect();
    let program = "G0 X20 Y30 Z-5\nG1 X40 Y60 F3000\nM2\n";
    let rig = Rig::new("router", &replacements, program, |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}

/// Homes Y; why that failed, in which state the machine is then, and how far the axis is from where it began, mm.
fn failed(case: &Case) -> (Rig, HomingFailure, State, f64) {
    let mut rig = case.rig();
    let from = truth(&mut rig, Y);
    go(&mut rig, home(AxisLetter::Y));
    assert!(!is_referenced(&rig, AxisLetter::Y));
    let moved = truth(&mut rig, Y) - from;
    let why = failure(&rig).unwrap_or_else(|| panic!("{:?}", rig.events));
    let state = state(&rig);
    (rig, why, state, moved)
}

#[test]
fn a_stop_that_is_absent_or_too_near_is_told() {
    let absent = Case {
        ahead: 400.0,
        max_distance: 80.0,
        ..Case::default()
    };
    let (rig, why, state, moved) = failed(&absent);
    assert_eq!((why, state), (HomingFailure::NoStop, State::Ready));
    assert!((moved + 80.0).abs() < 0.05, "{moved}");
    assert!(is_as_before(&rig));
    let near = Case {
        ahead: 20.0,
        min_distance: 50.0,
        ..Case::default()
    };
    let (rig, why, state, moved) = failed(&near);
    assert_eq!((why, state), (HomingFailure::TooEarly, State::Ready));
    assert!(moved.abs() < 0.05, "{moved}");
    assert!(is_as_before(&rig));
    // A torque that does not move it looks the same.
    let weak = Case {
        min_distance: 1.0,
        torque: 4.0,
        ..Case::default()
    };
    let (_, why, state, moved) = failed(&weak);
    assert_eq!((why, state), (HomingFailure::TooEarly, State::Ready));
    assert!(moved.abs() < 0.05, "{moved}");
}

#[test]
fn what_is_limited_as_much_already_is_told() {
    let mut case = Case::default();
    let mut replacements = case.replacements();
    let drive = "name = \"Y\"\nbus = \"main\"\nnode = 3\n";
    let limited = format!("{drive}sdo = [[\"3011:C\", 20]]\n");
    replacements.push((drive.to_owned(), limited));
    case.torque = 30.0;
    let replacements: Vec<_> = (replacements.iter())
        .map(|(old, new)| (&**old, &**new))
        .collect();
    let mut rig = Rig::staying_on("router", &replacements, |_, _| ());
    settle(&mut rig);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), Some(HomingFailure::WeakAlready));
    assert_eq!(state(&rig), State::Ready);
}

#[test]
fn a_search_that_takes_too_long_ends() {
    let case = Case {
        homing: "max_time_ms = 500".to_owned(),
        ..Case::default()
    };
    let (rig, why, state, _) = failed(&case);
    assert_eq!((why, state), (HomingFailure::TooLong, State::Ready));
    assert!(is_as_before(&rig));
}

/// A drive that does not take a limit is not moved with its full torque.
#[test]
fn a_drive_that_does_not_take_the_limit_is_a_fault() {
    let mut rig = Case::default().rig();
    let limit = Address::new(0x3011, 0x0C);
    let refused = Disturbance::RefuseWrite(limit, AbortCode::InvalidValue);
    rig.twin(Y).disturb(refused);
    let from = truth(&mut rig, Y);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(state(&rig), State::Faulted);
    let fault = rig.session.faults()[0];
    assert!(
        matches!(fault, Fault::Device(Y, DeviceCause::WriteAborted { object, .. }) if object == limit),
        "{fault:?}"
    );
    assert!((truth(&mut rig, Y) - from).abs() < 0.01);
}

/// Homes Y until it stands against something, in which its plan comes to rest; the events so far.
fn to_contact(rig: &mut Rig) {
    let y = AxisLetter::Y.index();
    rig.command(home(AxisLetter::Y));
    let velocity = |rig: &mut Rig| {
        let row = rig.session.timeline().row();
        row.map_or(f64::NAN, |row| row.plan.velocity[y])
    };
    rig.run_until(|rig| velocity(rig).abs() > 1.0);
    rig.run_until(|rig| velocity(rig) == 0.0);
}

#[test]
fn what_gives_way_is_no_stop() {
    let mut rig = Case::default().rig();
    rig.command(home(AxisLetter::Y));
    let from = truth(&mut rig, Y);
    rig.run_until(|rig| (truth(rig, Y) - from).abs() > 20.0);
    rig.twin(Y).disturb(Disturbance::Block(true));
    rig.run_until(|rig| {
        let row = rig.session.timeline().row();
        row.is_some_and(|row| row.plan.velocity[AxisLetter::Y.index()] == 0.0)
    });
    rig.twin(Y).disturb(Disturbance::Block(false));
    settle(&mut rig);
    assert_eq!(failure(&rig), Some(HomingFailure::GaveWay));
    assert_eq!(state(&rig), State::Ready);
    assert!(is_as_before(&rig));
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
}

#[test]
fn what_holds_the_axis_is_told() {
    let mut rig = Case::default().rig();
    rig.command(home(AxisLetter::Y));
    let from = truth(&mut rig, Y);
    rig.run_until(|rig| (truth(rig, Y) - from).abs() > 20.0);
    rig.twin(Y).disturb(Disturbance::Block(true));
    settle(&mut rig);
    assert_eq!(failure(&rig), Some(HomingFailure::Holds));
    assert_eq!(state(&rig), State::Faulted);
    let fault = rig.session.faults()[0];
    assert!(
        matches!(fault, Fault::Axis(1, AxisCause::FollowingError { .. })),
        "{fault:?}"
    );
    rig.twin(Y).disturb(Disturbance::Block(false));
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready);
    assert!(is_as_before(&rig));
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
}

/// An axis that its weight pulls down with more than the torque that is left of its motor.
#[test]
fn an_axis_that_falls_is_a_fault() {
    let case = Case {
        positive: true,
        ahead: 30.0,
        torque: 20.0,
        simulation: "gravity = -200.0".to_owned(),
        ..Case::default()
    };
    let (mut rig, why, state, _) = failed(&case);
    assert_eq!((why, state), (HomingFailure::Weak, State::Faulted));
    assert!(matches!(rig.session.faults()[0], Fault::Axis(1, _)));
    go(&mut rig, Command::Reset);
    assert!(is_as_before(&rig));
}

/// Stopped while it presses, its drive goes off before its torque comes back.
#[test]
fn an_axis_that_presses_is_off_before_its_torque_is_back() {
    let mut rig = Case::default().rig();
    to_contact(&mut rig);
    rig.command(Command::Stop);
    let mut torque = 0.0_f64;
    rig.run_until(|rig| {
        torque = torque.max(rig.twin(Y).observe().torque.abs());
        state(rig) == State::Disabled
    });
    assert!(torque < STALL * 0.3 * 1.02 + 0.01, "{torque}");
    settle(&mut rig);
    assert!(rig.events.contains(&Event::Presses { axis: 1 }));
    assert_eq!(rig.session.faults(), []);
    assert!(is_as_before(&rig));
    go(&mut rig, Command::Enable);
    assert_eq!(state(&rig), State::Ready);
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
}

fn case() -> impl Strategy<Value = Case> {
    let transmission = prop::sample::select(vec!["stiff", "screw", "rack", "belt"]);
    let places = (60.0..700.0, 1.0..60.0, 1.0..12.0_f64);
    let bounds = (prop_oneof![Just(0.0), 0.0..40.0_f64], 10.0..90.0_f64);
    let motion = (15.0..60.0, 4.0..14.0, 30..60u32, 0.0..40.0_f64);
    let what = (any::<[bool; 2]>(), transmission, 0..1000u64);
    (what, places, bounds, motion).prop_map(
        |(
            ([positive, mirrored], transmission, seed),
            (start, ahead, back_off),
            (min_distance, max_distance),
            (torque, speed, contact, friction),
        )| {
            Case {
                positive,
                mirrored,
                start,
                ahead,
                torque,
                speed,
                contact,
                back_off,
                min_distance: f64::min(min_distance, max_distance),
                max_distance,
                simulation: format!("transmission = \"{transmission}\"\nfriction = {friction:?}"),
                seed,
                homing: String::new(),
            }
            .away(20.0)
        },
    )
}

impl Case {
    /// What has to come of it, where that is sure.
    fn expected(&self) -> Option<Result<(), HomingFailure>> {
        // The plan goes on behind the stop.
        let reaches = self.ahead + 3.0 < self.max_distance;
        if self.ahead > self.max_distance + 0.5 {
            Some(Err(HomingFailure::NoStop))
        } else if reaches && self.ahead < self.min_distance - 0.5 {
            Some(Err(HomingFailure::TooEarly))
        } else if reaches && self.ahead > self.min_distance + 0.5 {
            Some(Ok(()))
        } else {
            None
        }
    }

    /// How far its plan goes on beyond the stop at most, as `check` holds its machine file to it, mm.
    fn lags(&self, rig: &Rig) -> f64 {
        let limits = &rig.machine.axes[1].limits;
        let seen = self.speed * f64::from(self.contact) * 1e-3;
        let stands = seen.max(4.0 * limits.standstill);
        let reaction = 4.0 * rig.machine.cycle.as_secs_f64() + 0.02;
        stands + self.speed * reaction + limits.stopping_distance(self.speed) + 0.02
    }

    /// By how much transmission and guide let the motor go on at the stop, mm.
    fn yields(&self) -> f64 {
        let of = |name: &str| self.simulation.contains(name);
        let (stiffness, play) = match () {
            () if of("screw") => (100.0, 0.0),
            () if of("rack") => (30.0, 0.02),
            () if of("belt") => (2.0, 0.0),
            () => (f64::INFINITY, 0.0),
        };
        let force = STALL * self.torque / 100.0 / RADIAN;
        force / stiffness * 1e-3 + play
    }
}

/// Runs a case, and holds it against what must be.
fn judge(case: &Case) -> Result<(), TestCaseError> {
    let mut rig = case.rig();
    let y = AxisLetter::Y.index();
    let from = rig.session.status().setpoint[y];
    let began = rig.rows.len();
    homed(&mut rig, case);
    prop_assert!(is_as_before(&rig));
    prop_assert!(rig.ends_at_rest());
    let lagged = rig.rows[began..]
        .iter()
        .map(|row| row.axes[y].following_error.abs());
    let (lagged, most) = (lagged.fold(0.0, f64::max), case.lags(&rig));
    prop_assert!(lagged < most, "{} > {}", lagged, most);
    let came = match failure(&rig) {
        Some(why) => Err(why),
        None => Ok(()),
    };
    prop_assert_eq!(is_referenced(&rig, AxisLetter::Y), came.is_ok());
    if let Some(expected) = case.expected() {
        prop_assert_eq!(came, expected, "{:?}", rig.events);
    }
    if came.is_err() {
        let rows = rig.rows[began..].iter();
        let farthest = rows.map(|row| (row.plan.position[y] - from).abs());
        let farthest = farthest.fold(0.0, f64::max);
        prop_assert!(farthest < case.max_distance + 1e-6, "{}", farthest);
    }
    if came.is_ok() {
        prop_assert_eq!(state(&rig), State::Ready);
        let error = errors(&mut rig, AxisLetter::Y)[0];
        let most = case.yields() + 0.004;
        prop_assert!(error.abs() < most, "{} > {}", error, most);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Wherever the axis stands, whatever its stop, torque and transmission are like: it ends referenced there, to what
    /// its transmission yields, or at rest with the reason; and its torque is limited as before.
    #[test]
    fn every_search_ends_at_its_stop_or_with_its_reason(case in case()) {
        judge(&case)?;
    }

    /// Cut off at any instant, by an operator, a fault or a drive that begins anew: the axis comes to rest, its torque is
    /// limited as before by when it may move again, and it is homed as ever.
    #[test]
    fn a_search_that_is_cut_off_gives_the_torque_back(
        wake_ups in 0..8000usize, how in 0..4u8, ahead in 1.0..60.0_f64, positive: bool,
    ) {
        let case = Case { positive, ahead, ..Case::default() }.away(20.0);
        let mut rig = case.rig();
        rig.command(home(AxisLetter::Y));
        for _ in 0..wake_ups {
            rig.step();
        }
        prop_assume!(state(&rig) == State::Homing);
        match how {
            0 => rig.command(Command::Stop),
            1 => rig.command(Command::Disable),
            2 => rig.twin(Y).disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff)),
            _ => rig.twin(Y).disturb(Disturbance::Fault(ErrorClass::QuickStop)),
        }
        settle(&mut rig);
        for _ in 0..200 {
            rig.step();
        }
        match state(&rig) {
            State::Ready => prop_assert!(is_as_before(&rig)),
            State::Disabled => {
                prop_assert!(is_as_before(&rig));
                go(&mut rig, Command::Enable);
            }
            _ => go(&mut rig, Command::Reset),
        }
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        prop_assert!(is_as_before(&rig));
        go(&mut rig, home(AxisLetter::Y));
        prop_assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
        prop_assert!(errors(&mut rig, AxisLetter::Y)[0].abs() < 0.005);
    }
}

/// Friction holds the axis where it is with the torque that the search lets its drive have: nor does it come off by that.
#[test]
fn an_axis_that_does_not_come_off_says_so() {
    let case = Case {
        start: 60.0,
        ahead: 1.0,
        torque: 15.0,
        speed: 4.0,
        contact: 35,
        back_off: 1.0,
        max_distance: 10.0,
        homing: "final_position = 79.0".into(),
        simulation: "transmission = \"belt\"\nfriction = 39.9".into(),
        ..Case::default()
    };
    let mut rig = case.rig();
    homed(&mut rig, &case);
    assert_eq!(
        failure(&rig),
        Some(HomingFailure::Holds),
        "{:?}",
        rig.events
    );
    assert!(is_as_before(&rig));
}
