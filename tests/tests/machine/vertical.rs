//! How far a vertical axis drops each time its power stage goes off: the portal's Z with its weight and a holding brake that
//! takes time to grip.

use proptest::prelude::*;
use proptest::sample::select;
use serde_json::Value;
use std::f64::consts::TAU;
use syncline_canopen::time::Duration;
use syncline_controller::session::Command;
use syncline_drives::model::Increments;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

use super::day::{mdi, ready_with};

/// Z among the drives.
const Z: usize = 3;
/// mm per turn of its motor.
const PITCH: f64 = 10.0;
/// How fast it goes down where it is in motion, mm/s.
const SPEED: f64 = 50.0;
/// A drive that knows of its motor's brake, and one by the profile alone.
const DRIVES: [&str; 2] = ["lxm32m", "cia402_csp"];
/// What a motor at rest may move by its loops and by the twist that its weight leaves, mm.
const AT_REST: f64 = 0.02;

/// What hangs on it.
#[derive(Clone, Copy, Debug)]
struct Hanging {
    /// kg
    load: f64,
    /// N, downwards.
    weight: f64,
    /// Until the brake grips, ms.
    closing: u32,
}

/// What docs/supervision.md tells of.
const SHOWN: Hanging = Hanging {
    load: 30.0,
    weight: 290.0,
    closing: 40,
};

impl Hanging {
    fn any() -> impl Strategy<Value = Self> {
        let weight = (10.0..50.0f64, 0.2..1.0f64);
        (weight, 0..100u32).prop_map(|((load, share), closing)| Self {
            load,
            weight: 9.8 * load * share,
            closing,
        })
    }

    /// What of the portal's file is otherwise with it behind that drive.
    fn replaced(self, drive: &str) -> [(&'static str, String); 2] {
        let Self {
            load,
            weight,
            closing,
        } = self;
        let hanging = format!(
            "max_velocity = 500.0\nsimulation = {{ transmission = \"screw\", load = {load:.1}, gravity = {:.1}, \
             friction = 10, brake_torque = 5, brake_closing_ms = {closing} }}",
            -weight
        );
        let drive = format!("node = 4\nmodel = \"{drive}\"");
        [
            ("max_velocity = 500.0", hanging),
            ("node = 4\nmodel = \"lxm32m\"", drive),
        ]
    }

    /// The portal with it behind that drive, ready and with Z in its middle.
    fn ready(self, drive: &str) -> Rig {
        let replaced = self.replaced(drive);
        let replaced = replaced.each_ref().map(|(from, to)| (*from, &**to));
        let mut rig = ready_with(&replaced);
        mdi(&mut rig, "G90 G0 Z-100");
        rig
    }

    /// How far it falls at the most, mm: freely until its brake grips, and then until 5 N·m have stopped it.
    fn falls(self, way: Way) -> f64 {
        let time = 1e-3 * (f64::from(self.closing) + 1.0);
        let free = 1e3 * self.weight / self.load;
        let begins = if way == Way::OffInMotion { SPEED } else { 0.0 };
        let speed = begins + free * time;
        let braked = 1e3 * (5.0 * TAU / (1e-3 * PITCH) - self.weight) / (2.0 * self.load);
        begins * time + 0.5 * free * time * time + 0.5 * speed * speed / braked
    }
}

/// How Z loses its torque.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Disable,
    SwitchOff,
    /// A stop in motion, and then off.
    DisableInMotion,
    /// Another drive fails: Z stops on its path, and is switched off.
    Neighbour,
    /// It fails itself, brakes by itself, and goes off.
    OwnFault,
    /// It goes off at once, in motion or at rest.
    OffInMotion,
    OffAtRest,
    /// Its supply is gone, at rest.
    Mains,
    /// Its control supply is gone, at rest.
    Reset,
}

const WAYS: [Way; 9] = [
    Way::Disable,
    Way::SwitchOff,
    Way::DisableInMotion,
    Way::Neighbour,
    Way::OwnFault,
    Way::OffInMotion,
    Way::OffAtRest,
    Way::Mains,
    Way::Reset,
];

impl Way {
    /// Whether the drive closes the brake before it takes its torque away.
    fn is_orderly(self) -> bool {
        use Way::{Disable, DisableInMotion, Neighbour, SwitchOff};
        matches!(self, Disable | SwitchOff | DisableInMotion | Neighbour)
    }

    /// As the page tells of it.
    fn told(self) -> &'static str {
        match self {
            Self::Disable => "disabled at rest",
            Self::SwitchOff => "switched off",
            Self::DisableInMotion => "disabled in motion",
            Self::Neighbour => "an error of another drive",
            Self::OwnFault => "an error by which it brakes",
            Self::OffInMotion => "at once, at 50 mm/s downwards",
            Self::OffAtRest => "at once, at rest",
            Self::Mains => "supply of its power stage",
            Self::Reset => "its control supply",
        }
    }

    fn in_motion(self) -> bool {
        use Way::{DisableInMotion, Neighbour, OffInMotion, OwnFault};
        matches!(self, DisableInMotion | Neighbour | OwnFault | OffInMotion)
    }

    fn begin(self, rig: &mut Rig) {
        let fault = |class| Disturbance::Fault(class);
        match self {
            Self::Disable | Self::DisableInMotion => rig.command(Command::Disable),
            Self::SwitchOff => rig.command(Command::SwitchOff),
            Self::Neighbour => rig.twin(0).disturb(fault(ErrorClass::StopAndSwitchOff)),
            Self::OwnFault => rig.twin(Z).disturb(fault(ErrorClass::StopAndSwitchOff)),
            Self::OffInMotion | Self::OffAtRest => {
                rig.twin(Z).disturb(fault(ErrorClass::SwitchOff));
            }
            Self::Mains => rig.twin(Z).disturb(Disturbance::Mains(false)),
            Self::Reset => rig.twin(Z).disturb(Disturbance::Reset),
        }
    }
}

/// Goes on until it has settled; where Z was last while its power stage was on, revolutions.
fn torque_goes(rig: &mut Rig) -> f64 {
    let mut held = rig.twin(Z).observe().position;
    let mut look = |rig: &mut Rig| {
        let now = rig.twin(Z).observe();
        if now.is_powered {
            held = now.position;
        }
    };
    for _ in 0..5000 {
        if !rig.step() {
            break;
        }
        look(rig);
    }
    // A machine that is switched off takes no more steps.
    let off = rig.session.timeline().now();
    for passed in 1..5000 {
        let at = off + passed * Duration::from_micros(100);
        rig.session.timeline().world().advance_to(at);
        look(rig);
    }
    held
}

/// How far Z drops, mm.
fn drop_of(hanging: Hanging, drive: &str, way: Way) -> f64 {
    let mut rig = hanging.ready(drive);
    if way.in_motion() {
        rig.command(Command::Mdi(format!("G1 Z-200 F{}", 60.0 * SPEED)));
        rig.run_until(|rig| rig.session.status().setpoint[2] < -130.0);
    }
    way.begin(&mut rig);
    let held = torque_goes(&mut rig);
    let after = rig.twin(Z).observe();
    assert!(!after.is_powered, "{way:?}");
    assert!(after.velocity.abs() < 1e-6, "{way:?}: {}", after.velocity);
    // Downwards is negative, and so its motor turns.
    (held - after.position) * PITCH
}

#[test]
fn the_page_has_what_it_drops_each_way() {
    let page = include_str!("../../../docs/supervision.md");
    for way in WAYS {
        let [lxm32m, csp] = DRIVES.map(|drive| drop_of(SHOWN, drive, way).max(0.0));
        let row = format!("| {lxm32m:.1} mm | {csp:.1} mm |");
        let mut rows = page.lines();
        let shown = rows.any(|line| line.contains(way.told()) && line.ends_with(&row));
        assert!(shown, "{}: {row}", way.told());
    }
}

/// As it is enabled a weight pulls it away from where its drive holds it, and it comes back: it is where it says then.
#[test]
fn it_is_where_it_says_once_its_loops_have_the_torque() {
    let hanging = "max_velocity = 500.0\nsimulation = { transmission = \"screw\", load = 30, gravity = -290 }";
    let mut rig = ready_with(&[
        ("max_velocity = 500.0", hanging),
        (
            "node = 4\nmodel = \"lxm32m\"",
            "node = 4\nmodel = \"cia402_csp\"",
        ),
    ]);
    for _ in 0..200 {
        rig.step();
    }
    let scaling = rig.machine.drives[Z].scaling;
    let counts = scaling.travel_per_revolution().abs() / scaling.resolution();
    let counts = (rig.twin(Z).observe().position * counts).round();
    let is = scaling.to_mm(Increments::new(counts as i64));
    let shown = rig.session.status().setpoint[AxisLetter::Z.index()];
    println!("{is:.6} mm, and {shown:.6} mm is shown");
    // Sixteen increments are taken for noise, and its loop answers that.
    assert!((is - shown).abs() < 40.0 * scaling.resolution());
}

/// A validation tells what an axis with a weight falls as the machine is switched off in the end, and of no other axis.
#[test]
fn a_validation_tells_what_it_drops_in_the_end() {
    let folder = Folder::new();
    let part = folder.file("part.ngc", "G21 G90 G1 Z-20 F6000\nM2\n");
    for drive in DRIVES {
        let replaced = SHOWN.replaced(drive);
        let replaced = replaced.each_ref().map(|(from, to)| (*from, &**to));
        let machine = folder.file("machine.toml", &machine_with("portal", &replaced));
        let result = folder.path("result.json");
        let output = syncline()
            .args(["validate".as_ref(), "--json".as_ref(), result.as_os_str()])
            .args([&machine, &part])
            .output()
            .unwrap();
        let (code, told, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        let json = std::fs::read_to_string(&result).unwrap();
        let json: Value = serde_json::from_str(&json).unwrap();
        let drops = [0, 1, 2, Z].map(|drive| json["drives"][drive]["drop"].as_f64());
        assert_eq!(drops[..Z], [None; 3]);
        let drop = drops[Z].unwrap();
        let held = drop_of(SHOWN, drive, Way::SwitchOff);
        assert!((drop - held).abs() < AT_REST, "{drive}: {drop}, {held}");
        let line = format!("falls by {drop:.2} mm as it is switched off");
        assert!(told.contains(&line), "{line}: {told}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever hangs on it and however long its brake takes: it stays where it is wherever the drive closes the brake itself, and
    /// otherwise falls no further than freely.
    #[test]
    fn it_stays_where_it_is_switched_off_in_order(
        hanging in Hanging::any(),
        way in select(WAYS.to_vec()),
    ) {
        let dropped = drop_of(hanging, DRIVES[0], way);
        let most = match way.is_orderly() {
            true => AT_REST,
            false => hanging.falls(way) + AT_REST,
        };
        prop_assert!((-AT_REST..=most).contains(&dropped), "{} of {} mm", dropped, most);
    }
}
