//! Checks a program's plan against the limits between the samples too, from the jerk segments of constant
//! jerk that the controller is fed with.

use std::collections::VecDeque;
use std::path::Path;
use syncline_controller::control::Instruction;
use syncline_controller::machine::{COORDINATES, Machine, Position};
use syncline_controller::program::{Moves, Program};
use syncline_trajectory::path::{Command, JerkSegment, Limits, PathSegment};

/// Samples of a jerk segment on a curve.
const SAMPLES: usize = 16;

/// A part of the plan that is executed, in order.
#[derive(Clone, Debug)]
pub enum Step {
    /// A section begins: distances count from 0 again.
    Section(Vec<PathSegment<COORDINATES>>),
    /// Constant jerk along the section.
    JerkSegment(JerkSegment),
    /// Rest.
    Dwell(f64),
}

/// Everything that a program makes the machine do.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What is executed.
    pub steps: Vec<Step>,
    /// What every coordinate is allowed.
    pub limits: Limits<COORDINATES>,
    /// Where the machine stands before it.
    pub start: Position,
    /// It goes to the program's end; otherwise to what has to be done before more can be planned: a thread, a probing, a homing.
    pub is_whole: bool,
}

impl Plan {
    /// The plan of a program, as a machine that stands where simulated ones stand follows it.
    ///
    /// # Panics
    /// If the program cannot be planned, or the plan is no plan.
    #[must_use]
    pub fn of(machine: &Machine, machine_file: &Path, program: &Path) -> Self {
        let program = Program::new(program, machine, machine_file).expect("tables");
        let start = machine.rest();
        let mut feeder = program.feeder(start, Moves::new().0).expect("a program");
        let mut plan = Self {
            steps: Vec::new(),
            limits: Limits {
                velocity: [f64::INFINITY; COORDINATES],
                acceleration: [f64::INFINITY; COORDINATES],
                jerk: [f64::INFINITY; COORDINATES],
            },
            start,
            is_whole: true,
        };
        for axis in &machine.axes {
            let coordinate = axis.letter.index();
            plan.limits.velocity[coordinate] = axis.limits.velocity;
            plan.limits.acceleration[coordinate] = axis.limits.acceleration;
            plan.limits.jerk[coordinate] = axis.limits.jerk;
        }
        let (mut committed, mut replaces_from) = (0, None);
        // Where in the steps the section under way is.
        let mut section = 0;
        while let Some(instruction) = feeder.next_instruction().expect("a good program") {
            let command = match instruction {
                Instruction::Plan(command) => command,
                Instruction::Mark { item, mark, .. } => Command::Mark { item, mark },
                Instruction::Probe(_) | Instruction::Thread(_) | Instruction::Home { .. } => {
                    plan.is_whole = false;
                    continue;
                }
                Instruction::Switch { .. } | Instruction::Found(_) => continue,
            };
            match command {
                Command::Section { .. } => {
                    section = plan.steps.len();
                    plan.steps.push(Step::Section(Vec::new()));
                }
                Command::ReplaceTail(step) => replaces_from = Some(step as usize),
                Command::PathSegment(path_segment) => match &mut plan.steps[section] {
                    Step::Section(path_segments) => path_segments.push(path_segment),
                    step => panic!("a path segment goes on with {step:?}"),
                },
                Command::JerkSegment(segment) => plan.steps.push(Step::JerkSegment(segment)),
                Command::Dwell { duration, .. } => plan.steps.push(Step::Dwell(duration)),
                Command::Mark { .. } | Command::Waypoint { .. } => {
                    plan.steps.push(Step::Dwell(0.0));
                }
                Command::ReplacePlan { .. } | Command::Hold => {
                    panic!("nobody asked for {command:?}")
                }
                Command::Commit => {
                    if let Some(step) = replaces_from.take() {
                        assert!(section < step, "a section's jerk segments go on in it");
                        plan.steps.drain(step..committed);
                    }
                    committed = plan.steps.len();
                }
            }
        }
        assert_eq!(plan.steps.len(), committed, "the plan ends committed");
        plan
    }

    /// How long it takes, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        let time = |step: &Step| match step {
            Step::Section(_) => 0.0,
            Step::JerkSegment(segment) => segment.duration,
            Step::Dwell(duration) => *duration,
        };
        self.steps.iter().map(time).sum()
    }

    /// What it moves along, in order.
    #[must_use]
    pub fn path_segments(&self) -> Spans<'_> {
        fn of(step: &Step) -> &[PathSegment<COORDINATES>] {
            match step {
                Step::Section(path_segments) => path_segments,
                _ => &[],
            }
        }
        Spans(self.steps.iter().flat_map(of).collect())
    }

    /// What is wrong with it, in words.
    #[must_use]
    pub fn faults(&self) -> Vec<String> {
        self.examine().0
    }

    /// What is wrong with it, in words, and the greatest velocity, acceleration and jerk of any
    /// coordinate as parts of their limits.
    #[must_use]
    pub fn examine(&self) -> (Vec<String>, [f64; 3]) {
        let mut faults = Vec::new();
        let mut loads = [0.0; 3];
        let mut at_rest_in = self.start;
        let mut path_segments: &[PathSegment<COORDINATES>] = &[];
        // Path distance, speed and acceleration with which the last jerk segment ended.
        let mut last: (f64, f64, f64) = (0.0, 0.0, 0.0);
        for (index, step) in self.steps.iter().enumerate() {
            let mut complain = |what: String| faults.push(format!("step {index}: {what}"));
            if !matches!(step, Step::JerkSegment(_)) && (last.1.abs() > 1e-6 || last.2.abs() > 1e-3)
            {
                complain(format!("begins in motion: {last:?}"));
            }
            match step {
                Step::Dwell(_) => {}
                Step::Section(of) => {
                    let Some(first) = of.first() else {
                        complain("a section without a curve".into());
                        continue;
                    };
                    let jump = distance(&at_rest_in, &first.curve.start());
                    if jump > 1e-6 {
                        complain(format!("jumps by {jump} mm"));
                    }
                    for pair in of.windows(2) {
                        let gap = distance(&pair[0].curve.end(), &pair[1].curve.start());
                        let behind = pair[0].start + pair[0].curve.length() - pair[1].start;
                        if gap > 1e-6 || behind.abs() > 1e-9 * pair[1].start {
                            complain(format!("a gap of {gap} mm, {behind} mm along the path"));
                        }
                    }
                    path_segments = of;
                    last = (0.0, 0.0, 0.0);
                    at_rest_in = of[of.len() - 1].curve.end();
                }
                Step::JerkSegment(segment) => {
                    let JerkSegment {
                        distance,
                        speed,
                        acceleration,
                        ..
                    } = *segment;
                    let steps = [distance - last.0, speed - last.1, acceleration - last.2];
                    for (step, allowed) in steps.into_iter().zip([1e-9, 1e-6, 1e-3]) {
                        if step.abs() > allowed * (1.0 + distance.abs()) {
                            complain(format!("does not go on from the last: {steps:?}"));
                        }
                    }
                    let (way, speed, acceleration) = segment.at(segment.duration);
                    last = (distance + way, speed, acceleration);
                    self.check(segment, path_segments, &mut loads, &mut complain);
                }
            }
        }
        if last.1.abs() > 1e-6 || last.2.abs() > 1e-3 {
            faults.push(format!("ends in motion: {last:?}"));
        }
        (faults, loads)
    }

    /// Checks one jerk segment: path speed against the feed, every axis against its limits.
    fn check(
        &self,
        segment: &JerkSegment,
        path_segments: &[PathSegment<COORDINATES>],
        loads: &mut [f64; 3],
        complain: &mut impl FnMut(String),
    ) {
        let over = |value: f64, limit: f64| value.is_nan() || value.abs() > limit * (1.0 + 1e-6);
        // Too short to tell on which side of a joint it is.
        if segment.at(segment.duration).0 < 1e-8 {
            return;
        }
        for t in instants(segment) {
            let (way, v, a) = segment.at(t);
            let at = segment.distance + way;
            if v < -1e-6 {
                complain(format!("goes back with {v} mm/s at {at} mm"));
            }
            // Where two curves meet both have to be followed; a jerk segment that begins or ends there
            // follows one of them, for the jerk may change in a joint.
            let reach = |ends: bool| if ends { -1e-9 } else { 1e-9 };
            let (begins, ends) = (reach(t == segment.duration), reach(t == 0.0));
            let next =
                path_segments.partition_point(|path_segment| path_segment.start - begins <= at);
            let here = &path_segments[next.saturating_sub(2)..next];
            let goes_on = |path_segment: &&PathSegment<COORDINATES>| {
                at <= path_segment.start + path_segment.curve.length() + ends
            };
            let mut on_a_curve = false;
            for path_segment in here.iter().filter(goes_on) {
                on_a_curve = true;
                if over(v, path_segment.feed) {
                    complain(format!("speed {v} of {} at {at} mm", path_segment.feed));
                }
                let along = (at - path_segment.start).clamp(0.0, path_segment.curve.length());
                let d = path_segment.curve.at(along);
                for axis in 0..COORDINATES {
                    let velocity = d.d1[axis] * v;
                    let acceleration = d.d2[axis] * v * v + d.d1[axis] * a;
                    let jerk = d.d3[axis] * v * v * v
                        + 3.0 * d.d2[axis] * v * a
                        + d.d1[axis] * segment.jerk;
                    for (load, (what, value, limit)) in loads.iter_mut().zip([
                        ("velocity", velocity, self.limits.velocity[axis]),
                        ("acceleration", acceleration, self.limits.acceleration[axis]),
                        ("jerk", jerk, self.limits.jerk[axis]),
                    ]) {
                        *load = load.max(value.abs() / limit);
                        if over(value, limit) {
                            complain(format!("{what} {value} of {limit} at {at} mm, axis {axis}"));
                        }
                    }
                }
            }
            if !on_a_curve {
                complain(format!("leaves the path at {at} mm"));
            }
        }
    }

    /// Panics if anything is wrong with it.
    ///
    /// # Panics
    /// Or if there is no motion to check.
    pub fn assert_good(&self) {
        let moves = |step: &Step| matches!(step, Step::JerkSegment(_));
        assert!(self.steps.iter().any(moves), "an empty plan proves nothing");
        let faults = self.faults();
        let first = &faults[..faults.len().min(5)];
        assert!(faults.is_empty(), "{} faults: {first:#?}", faults.len());
    }
}

/// What a plan moves along.
pub struct Spans<'a>(VecDeque<&'a PathSegment<COORDINATES>>);

impl Spans<'_> {
    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Where they end.
    #[must_use]
    pub fn end(&self) -> Option<Position> {
        self.0.back().map(|path_segment| path_segment.curve.end())
    }

    /// Goes on to the next place that is no further than `enough` from a point, and says how far;
    /// if there is none, stays and says how near it gets.
    pub fn pass_by(&mut self, point: &[f64; 3], enough: f64) -> f64 {
        let mut to = [0.0; COORDINATES];
        to[..3].copy_from_slice(point);
        let mut nearest = f64::INFINITY;
        for index in 0..self.0.len() {
            let curve = &self.0[index].curve;
            let apart = |s: f64| distance(&curve.at(s).q, &to);
            let length = curve.length();
            // No way of that length leads there.
            let start = curve.start();
            let away = (0..3).map(|i| (to[i] - start[i]).powi(2)).sum::<f64>();
            if away.sqrt() - length > enough.max(nearest) {
                continue;
            }
            let place = |k: usize| length * k as f64 / SAMPLES as f64;
            let places: [f64; SAMPLES + 1] = std::array::from_fn(|k| apart(place(k)));
            let first = (0..=SAMPLES).min_by(|a, b| places[*a].total_cmp(&places[*b]));
            let first = first.unwrap_or(0);
            let mut ends = (
                place(first.saturating_sub(1)),
                place((first + 1).min(SAMPLES)),
            );
            for _ in 0..60 {
                if apart(0.5 * (ends.0 + ends.1)) <= enough {
                    break;
                }
                let third = (ends.1 - ends.0) / 3.0;
                if apart(ends.0 + third) < apart(ends.1 - third) {
                    ends.1 -= third;
                } else {
                    ends.0 += third;
                }
            }
            nearest = nearest.min(apart(0.5 * (ends.0 + ends.1)));
            if nearest <= enough {
                self.0.drain(..index);
                break;
            }
        }
        nearest
    }
}

/// Where velocity and acceleration of constant jerk on a line have their extrema, and as many
/// instants between as a curve needs.
fn instants(segment: &JerkSegment) -> impl Iterator<Item = f64> {
    let even = (0..=SAMPLES).map(|i| segment.duration * i as f64 / SAMPLES as f64);
    let turn = -segment.acceleration / segment.jerk;
    let turn = Some(turn).filter(|t| (0.0..=segment.duration).contains(t));
    even.chain(turn)
}

fn distance(a: &Position, b: &Position) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// The checker is checked: what it must see, it sees.
#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::{Folder, machine_file};

    /// A line and an arc at the machine's limits.
    fn good() -> Plan {
        let folder = Folder::new();
        let program = folder.file("p.ngc", "G61 G0 X300 Y100\nG2 X400 Y200 I100 F60000\nM2\n");
        let file = machine_file("portal");
        let machine = Machine::load(&file).expect("example");
        Plan::of(&machine, &file, &program)
    }

    fn segments(plan: &mut Plan) -> impl Iterator<Item = &mut JerkSegment> {
        plan.steps.iter_mut().filter_map(|step| match step {
            Step::JerkSegment(segment) => Some(segment),
            _ => None,
        })
    }

    fn sees(plan: &Plan, what: &str) -> bool {
        plan.faults().iter().any(|fault| fault.contains(what))
    }

    #[test]
    fn the_planners_plan_passes() {
        good().assert_good();
    }

    #[test]
    fn each_limit_is_seen_when_it_is_exceeded_by_a_thousandth() {
        type Lower = fn(&mut Limits<COORDINATES>);
        let lowered: [(&str, Lower); 3] = [
            ("velocity", |it| it.velocity[0] /= 1.001),
            ("acceleration", |it| it.acceleration[0] /= 1.001),
            ("jerk", |it| it.jerk[0] /= 1.001),
        ];
        for (what, lower) in lowered {
            let mut plan = good();
            lower(&mut plan.limits);
            assert!(sees(&plan, what), "{what}");
        }
    }

    #[test]
    fn breaks_in_the_plan_are_seen() {
        let mut plan = good();
        while !matches!(plan.steps.pop(), Some(Step::JerkSegment(_))) {}
        assert!(sees(&plan, "ends in motion"));

        let mut plan = good();
        segments(&mut plan).nth(2).expect("segments").speed += 0.1;
        assert!(sees(&plan, "does not go on"));

        let mut plan = good();
        plan.start[0] += 1e-3;
        assert!(sees(&plan, "jumps"));

        let mut plan = good();
        segments(&mut plan).last().expect("segments").duration *= 3.0;
        assert!(sees(&plan, "leaves the path"));

        let mut plan = good();
        if let Some(Step::Section(path_segments)) = plan.steps.first_mut() {
            path_segments[0].feed = 1.0;
        }
        assert!(sees(&plan, "speed"));
    }
}
