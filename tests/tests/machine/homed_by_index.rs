//! An axis whose switch tells the turn, and the index of its motor's encoder behind that the place.

use super::homing::{Y, failure, go, home, is_referenced, settle, state, truth};
use proptest::prelude::*;
use std::path::Path;
use syncline_controller::control::{Event, HomingFailure, State};
use syncline_controller::machine::Machine;
use syncline_gcode::AxisLetter;
use syncline_tests::command::machine_with;
use syncline_tests::rig::Rig;

/// Travel of the router's Y in a revolution of its motor, from one index to the next, mm.
const TURN: f64 = 20.0;
/// The same where the machine file has it.
const SWITCH: &str = "simulated = [-60.0, -4.0]\n\n# It opens";
const SEARCH: &str = "switches = [\"home Y\"]\ndirection = \"negative\"\nspeed = 80.0\nslow_speed = 2.0\nback_off = 5.0\nposition = -4.0\n";
const START: &str = "start = 95.0";
const DRIVE: &str = "name = \"Y\"\nbus = \"main\"\nnode = 3\n";

#[derive(Clone, Debug)]
struct Case {
    /// To the side where positions grow.
    positive: bool,
    /// The drive counts the other way than the axis.
    mirrored: bool,
    latch: bool,
    slow_speed: f64,
    /// Where the switch comes on, mm.
    edge: f64,
    start: f64,
    seed: u64,
}

impl Case {
    fn any() -> impl Strategy<Value = Self> {
        let edge = (-40.0..-1.0_f64, 801.0..840.0_f64);
        let slow = prop::sample::select(vec![0.5, 2.0, 20.0]);
        (any::<[bool; 3]>(), edge, 20.0..200.0_f64, slow, 0..1000u64).prop_map(
            |([positive, mirrored, latch], (low, high), start, slow_speed, seed)| Self {
                positive,
                mirrored,
                latch,
                slow_speed,
                edge: if positive { high } else { low },
                // From there, away from the edge.
                start: if positive { 780.0 - start } else { start },
                seed,
            },
        )
    }

    /// The index that counts, mm.
    fn index(&self) -> f64 {
        match self.positive {
            true => (self.edge / TURN).ceil() * TURN,
            false => (self.edge / TURN).floor() * TURN,
        }
    }

    fn homed(&self) -> Rig {
        let (from, to) = match self.positive {
            true => (self.edge, 900.0),
            false => (-100.0, self.edge),
        };
        let switch = format!("simulated = [{from:?}, {to:?}]\n\n# It opens");
        let search = format!(
            "switches = [\"home Y\"]\ndirection = \"{}\"\nspeed = 80.0\nslow_speed = {:?}\nback_off = 1.0\nposition = {:?}\n\
             latch = {}\nindex = true\n",
            if self.positive {
                "positive"
            } else {
                "negative"
            },
            self.slow_speed,
            self.index(),
            self.latch,
        );
        let start = format!("start = {:?}", self.start);
        let direction = if self.mirrored {
            "negative"
        } else {
            "positive"
        };
        let drive = format!("{DRIVE}direction = \"{direction}\"\n");
        let changes = [
            (SWITCH, &*switch),
            (SEARCH, &*search),
            (START, &*start),
            (DRIVE, &*drive),
        ];
        let mut rig = Rig::staying_on("router", &changes, |drive, config| {
            config.seed = self.seed + drive as u64;
        });
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        go(&mut rig, home(AxisLetter::Y));
        rig
    }

    /// How near to the edge an index is, mm.
    fn near(&self) -> f64 {
        let behind = (self.index() - self.edge).abs();
        behind.min(TURN - behind)
    }
}

fn told(rig: &Rig) -> Option<f64> {
    rig.events.iter().find_map(|event| match event {
        Event::IndexNear { distance, .. } => Some(*distance),
        _ => None,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10, ..ProptestConfig::default() })]

    /// Wherever the axis begins, to either side, latched or by samples, at any speed: its place is that of the encoder, to the
    /// increments by which a drive at rest varies, and no index near to the edge is taken without a word.
    #[test]
    fn the_place_is_that_of_the_index(case in Case::any()) {
        let mut rig = case.homed();
        // By samples the edge is off by half a cycle's way, and the input's filter besides.
        let off = case.slow_speed * 2e-3 + 0.01;
        let near = case.near();
        if let Some(HomingFailure::IndexTooNear { thousandths }) = failure(&rig) {
            prop_assert!((f64::from(thousandths) / 1000.0 * TURN - near).abs() < 0.001 * TURN + off);
            prop_assert!(near < 0.02 * TURN + off, "{near} mm");
            prop_assert!(!is_referenced(&rig, AxisLetter::Y));
            return Ok(());
        }
        prop_assert_eq!(failure(&rig), None);
        prop_assert!(near > 0.02 * TURN - off, "{near} mm");
        match told(&rig) {
            Some(distance) => prop_assert!((distance - near).abs() < off && near < 0.1 * TURN + off),
            None => prop_assert!(near > 0.1 * TURN - off, "{near} mm"),
        }
        for _ in 0..200 {
            rig.step();
        }
        let shown = rig.session.status().setpoint[AxisLetter::Y.index()];
        let error = truth(&mut rig, Y) - shown;
        prop_assert!(error.abs() < 0.0015, "{error} mm");
        let uncertainty = rig.events.iter().find_map(|event| match event {
            Event::Referenced { uncertainty, .. } => *uncertainty,
            _ => None,
        });
        prop_assert!(uncertainty.is_some_and(|it| it < 3.0 * TURN / 131_072.0), "{uncertainty:?}");
    }
}

/// Where it would tell nothing it is refused by its name.
#[test]
fn an_index_that_tells_nothing_is_refused() {
    let refused = |changes: &[(&str, &str)]| {
        let text = machine_with("router", changes);
        let refused = Machine::parse(Path::new("case.toml"), &text);
        refused.unwrap_err().to_string()
    };
    let keyed = |switches: &str| format!("{switches}\nindex = true");
    let of_gantry = "switches = [\"home X1\", \"home X2\"]";
    let problem = refused(&[(of_gantry, &keyed(of_gantry))]);
    assert!(
        problem.contains("axis \"X\": homing: `index` of a gantry"),
        "{problem}"
    );

    let of_y = "switches = [\"home Y\"]";
    let model = format!("{DRIVE}model = \"lxm32m\"");
    for other in ["tlc5xx", "tsp10"] {
        let other = model.replace("lxm32m", other);
        let problem = refused(&[(of_y, &keyed(of_y)), (&model, &other)]);
        assert!(
            problem.contains("`index` of a drive that counts from where it was switched on"),
            "{problem}"
        );
    }

    // On a limit switch the edge is up to a turn in front of the index.
    let input =
        "[[input]]\nname = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\n";
    let limit = input.replace("function = \"home\"", "function = \"limit\"");
    let axis = "name = \"Y\"\ndrives = [\"Y\"]\n";
    let by_limit = format!("{axis}negative_limit = [\"home Y\"]\n");
    let position =
        |index: f64| format!("position = {index:?}\nfinal_position = 0.0\nindex = true\n");
    let judged = |index: f64| {
        let changes = [
            (input, &*limit),
            (axis, &*by_limit),
            ("position = -4.0\nfinal_position = 0.0\n", &*position(index)),
        ];
        Machine::parse(Path::new("case.toml"), &machine_with("router", &changes))
    };
    assert!(judged(-20.5).is_ok(), "{:?}", judged(-20.5).map(|_| ()));
    let problem = judged(-19.5).map(|_| ()).unwrap_err().to_string();
    assert!(problem.contains("is on from 0.5 on"), "{problem}");
}
