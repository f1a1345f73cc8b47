//! How fast a campaign goes: cases of machines of four axes at 2 ms, from drawing to the end, bring-up included, before all checkers;
//! the axes rigid, or elastic with friction, play and a power stage. What is measured is the thread's processor time:
//! `cargo bench -p syncline-benches --bench campaign`, with how many cases, and from which seed on, if not 50 and 0:
//! `-- 50 0`.

use std::time::Duration;
use syncline_controller::campaign::{self, AxisSpec, Case, ErrorSpec, TransmissionSpec, Wanted};
use syncline_controller::machine::Machine;
use syncline_controller::realtime::thread_time;

/// A case is measured so many times; the least of them is what others on the host disturbed least.
const TIMES: usize = 3;

/// What an axis is given that has no motor, and no screw: its antiresonance, Hz, the load's inertia by that of the rotor, and the
/// play, by the travel of a revolution.
const MOTOR: &str = "motor = \"generic-1.4\"";
const SCREW: (f64, f64) = (200.0, 1.0);
const BACKLASH: f64 = 1e-4;

/// What the axes of a case are made of.
#[derive(Clone, Copy, Debug)]
enum Plants {
    AsDrawn,
    Rigid,
    Full,
}

impl Plants {
    fn give(self, case: &mut Case) {
        let machine = &mut case.machine;
        let file = machine.machine().expect("what is drawn is good");
        for place in 0..machine.axes.len() {
            let drawn = machine.axes[place].transmission.clone();
            match self {
                Self::Rigid => rigid(&mut machine.axes[place]),
                Self::Full if !is_stepper(&file, place) => full(&mut machine.axes[place]),
                Self::AsDrawn | Self::Full => {}
            }
            // Some are too heavy for a screw.
            if machine.machine().is_err() {
                machine.axes[place].transmission = drawn;
            }
        }
    }
}

/// What an axis is said to be simulated with that its homing needs: where it stands first, and where switches are.
fn homed(axis: &AxisSpec) -> Option<String> {
    let mut keys: Vec<String> = Vec::new();
    for part in axis.simulation.as_deref()?.split(", ") {
        match keys.last_mut() {
            // The second value of the key before.
            Some(key) if !part.contains(" = ") => *key = format!("{key}, {part}"),
            _ => keys.push(part.to_owned()),
        }
    }
    let needed = ["start", "reference_switch", "limit_switches"];
    keys.retain(|key| needed.iter().any(|needed| key.starts_with(needed)));
    (!keys.is_empty()).then(|| keys.join(", "))
}

/// An inertia with friction, and a torque that follows at once.
fn rigid(axis: &mut AxisSpec) {
    let homed = homed(axis);
    if axis.simulation != homed {
        // What it was told of the torque that the axis takes is of another one.
        axis.feed_forward = None;
    }
    axis.simulation = homed;
    if axis.transmission.take().is_some() {
        axis.corrected = None;
    }
}

/// Whether an axis's drive counts from where it is switched on, as that of a stepping motor does, which has no power stage.
fn is_stepper(machine: &Machine, axis: usize) -> bool {
    let mut drives = machine.axes[axis].drives.iter();
    drives.any(|drive| {
        let device = machine.device(*drive);
        (device.feedback()).is_some_and(|feedback| !feedback.counts_without_power())
    })
}

/// Behind a motor with its power stage, and a screw that gives way, with play and a guide that rubs, as far as it is not drawn so. Who
/// goes to a target or closes a loop about the load bears no play.
fn full(axis: &mut AxisSpec) {
    let simulation = axis.simulation.take().unwrap_or_default();
    axis.simulation = Some(match simulation.contains("motor = ") {
        true => simulation,
        false if simulation.is_empty() => MOTOR.to_owned(),
        false => format!("{MOTOR}, {simulation}"),
    });
    let sees_load = axis.encoder.as_ref().is_some_and(|it| it.closes_loop);
    if axis.goes || sees_load {
        return;
    }
    let transmission = axis.transmission.get_or_insert(TransmissionSpec {
        errors: ErrorSpec::default(),
        soft: None,
    });
    if transmission.soft.is_none() {
        transmission.soft = Some(SCREW);
        transmission.errors.backlash = BACKLASH * axis.travel;
    }
}

/// Virtual seconds of a case and the processor time that it takes, drawing included; how much of it is wrong.
fn measure(seed: u64, plants: Plants) -> (f64, Duration, usize) {
    let mut least = Duration::MAX;
    let (mut seconds, mut violations) = (0.0, Vec::new());
    for _ in 0..TIMES {
        let began = thread_time();
        let mut case = Case::of(seed);
        let drawn = thread_time() - began;
        plants.give(&mut case);
        let began = thread_time();
        let outcome = campaign::run(&case, Wanted::default(), &mut |_| ());
        least = least.min(drawn + (thread_time() - began));
        seconds = outcome.seconds[0];
        violations = outcome.violations;
    }
    for violation in &violations {
        eprintln!("seed {seed}, {plants:?}: {violation}");
    }
    (seconds, least, violations.len())
}

fn main() {
    let numbers = std::env::args().skip(1).filter_map(|it| it.parse().ok());
    let numbers: Vec<u64> = numbers.collect();
    let count = numbers.first().copied().unwrap_or(50) as usize;
    let first = numbers.get(1).copied().unwrap_or(0);
    let is_asked = |seed: &u64| {
        let machine = Case::of(*seed).machine;
        machine.axes.len() == 4 && machine.cycle_us == 2000
    };
    let seeds: Vec<u64> = (first..).filter(is_asked).take(count).collect();
    println!("virtual seconds a second of processor time, {count} cases of four axes at 2 ms");
    println!(
        "{:10} {:>7} {:>7} {:>7} {:>9} {:>12} {:>10}",
        "axes", "tenth", "median", "ninth", "all", "virtual, s", "violations"
    );
    for plants in [Plants::Rigid, Plants::Full, Plants::AsDrawn] {
        let (mut all, mut took, mut violations) = (0.0, Duration::ZERO, 0);
        let mut paces = Vec::new();
        for &seed in &seeds {
            let (seconds, time, found) = measure(seed, plants);
            all += seconds;
            took += time;
            violations += found;
            paces.push(seconds / time.as_secs_f64());
        }
        paces.sort_by(f64::total_cmp);
        let at = |part: usize| paces[(paces.len() - 1) * part / 10];
        println!(
            "{:10} {:>7.0} {:>7.0} {:>7.0} {:>9.0} {:>12.0} {:>10}",
            format!("{plants:?}"),
            at(1),
            at(5),
            at(9),
            all / took.as_secs_f64(),
            all,
            violations
        );
    }
}
