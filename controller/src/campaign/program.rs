//! Random programs from a grammar of RS-274/NGC, a list of lines each.
//!
//! A program knows where the machine will be, so that it stays within the soft limits: what is to be
//! found lies behind programs that run. One in twenty has a block that is wrong, and must be refused
//! before anything moves.

use super::dice::{Dice, rounded};
use super::machine::{AxisSpec, MachineSpec, SpindleSpec};

/// What a program begins with. A tool length stays from the job before.
const BEGINS: &str = "G17 G21 G49 G90 G94";

/// Decimals of a position in a program.
const DECIMALS: usize = 4;

/// The least travel with which there are moves between the soft limits that rounding leaves inside, mm.
const LEAST_SPAN: f64 = 0.01;

/// Travels of a plane's axes may differ by this factor where there is cutter compensation: beyond, arcs are so
/// small where they are that rounding leads over an axis' jerk (`docs/reliability.md`).
const MOST_APART: f64 = 100.0;

/// Writes a part of a program.
type Part = fn(&mut Writer);

/// What a program is made of, and how often each comes.
const PARTS: [(u32, Part); 16] = [
    (8, Writer::rapid),
    (12, Writer::line),
    (8, Writer::arc),
    (4, Writer::contour),
    (3, Writer::zigzag),
    (2, Writer::incremental),
    (2, Writer::inverse_time),
    (2, Writer::repeat),
    (1, Writer::parameters),
    (2, Writer::drill),
    (3, Writer::dwell),
    (4, Writer::mode),
    (3, Writer::stop),
    (5, Writer::switch),
    (3, Writer::feed),
    (1, Writer::nothing),
];

/// Random programs for a machine.
pub(super) fn draw(dice: &mut Dice, machine: &MachineSpec) -> Vec<String> {
    let mut writer = Writer::new(Dice::new(dice.seed(), 0), machine);
    let mut weights = PARTS.map(|(weight, _)| weight);
    // Each program is rich in some things and has none of others.
    for weight in &mut weights {
        *weight *= [0, 1, 1, 4][writer.dice.below(4)];
    }
    writer.feed();
    for _ in 0..writer.dice.whole(1..=40) {
        let part = writer.dice.weighted(&weights);
        PARTS[part].1(&mut writer);
    }
    if writer.dice.chance(0.05) {
        writer.mistake();
    }
    let end = *writer.dice.pick(&["M2", "M30", "M2", ""]);
    writer.lines.push(end.to_owned());
    writer.lines
}

/// A program of what few machines can do: cutter compensation, and signals where some are wired.
pub(super) fn special(dice: &mut Dice, machine: &MachineSpec) -> Option<Vec<String>> {
    let [inputs, outputs] = ["input", "output"].map(|table| machine.numbers(table));
    let is_wired = !inputs.is_empty() || !outputs.is_empty();
    if !dice.chance(if is_wired { 0.7 } else { 0.15 }) {
        return None;
    }
    let mut writer = Writer::new(dice.clone(), machine);
    for _ in 0..writer.dice.whole(1..=6) {
        writer.feed();
        match writer.dice.below(3) {
            0 => writer.compensated(),
            1 => writer.line(),
            _ => writer.zigzag(),
        }
        writer.signal(&inputs, &outputs);
    }
    writer.push("M2");
    Some(writer.lines)
}

/// A program whose coordinates are shifted, and shifted back: by work offsets, G92, G52 and tool lengths.
pub(super) fn shifted(dice: &mut Dice, machine: &MachineSpec) -> Option<Vec<String>> {
    let outputs = machine.numbers("output");
    let has_room = |axis: &AxisSpec| axis.soft_limits[1] - axis.soft_limits[0] > LEAST_SPAN;
    if !dice.chance(0.3) || !on_path(machine).all(has_room) {
        return None;
    }
    let mut writer = Writer::new(dice.clone(), machine);
    writer.feed();
    let none = vec![0.0; writer.axes.len()];
    writer.go_shifted(&none, true);
    for _ in 0..writer.dice.whole(1..=5) {
        writer.shift(&outputs);
    }
    writer.push("M2");
    Some(writer.lines)
}

/// Circles right beside where the machine stands, in one path mode: a machine with a shaper follows them from the first second on.
pub(super) fn circles(dice: &mut Dice, machine: &MachineSpec) -> Option<Vec<String>> {
    let axis = |letter: char| on_path(machine).find(|axis| axis.letter == letter);
    let (x, y) = (axis('X')?, axis('Y')?);
    let asked = dice.chance(0.7);
    let spans = [x, y].map(|axis| axis.soft_limits[1] - axis.soft_limits[0]);
    let radius = rounded(spans[0].min(spans[1]) * dice.between(0.002, 0.1), DECIMALS);
    if machine.shaper.is_none() || !asked || radius < 0.001 {
        return None;
    }
    // Towards the middle of each, so that the circles are inside.
    let inwards = |axis: &AxisSpec| {
        let [least, most] = axis.soft_limits;
        radius.copysign(least + most - 2.0 * rest(axis))
    };
    let (to_x, to_y) = (rest(x), rounded(rest(y) + inwards(y), DECIMALS));
    let feed = 60.0 * x.velocity.min(y.velocity) * dice.between(0.1, 1.0);
    let mode = *dice.pick(&["G61", "G61.1", "G64"]);
    let mut lines = vec![
        BEGINS.to_owned(),
        format!("{mode} F{}", rounded(feed, DECIMALS).max(0.001)),
        format!("G1 X{to_x} Y{to_y}"),
    ];
    for _ in 0..dice.whole(2..=5) {
        let way = dice.whole(2..=3);
        lines.push(format!("G{way} X{to_x} Y{to_y} I{} J0", inwards(x)));
    }
    lines.push("M2".to_owned());
    Some(lines)
}

/// The axes that follow a path.
fn on_path(machine: &MachineSpec) -> impl Iterator<Item = &AxisSpec> {
    machine.axes.iter().filter(|axis| !axis.goes)
}

/// Has programs move axes that go point to point, in between.
pub(super) fn go(dice: &mut Dice, machine: &MachineSpec, programs: &mut [Vec<String>]) {
    for axis in machine.axes.iter().filter(|axis| axis.goes) {
        let [least, most] = axis.soft_limits;
        for program in &mut *programs {
            for _ in 0..dice.whole(0..=3) {
                let to = rounded(dice.between(least, most), DECIMALS).clamp(least, most);
                let place = dice.whole(1..=program.len() as u32) as usize;
                // Neither behind its end nor between words that hold for what stands there alone.
                let before = &program[place - 1];
                let alone = ["G91", "G93", "G41", "G42", "M2", "M30"];
                if !alone.iter().any(|word| before.contains(word)) {
                    program.insert(place, format!("G0 {}{to}", axis.letter));
                }
            }
        }
    }
}

/// Has programs ask what inputs are (M66 L0), in between, and read what they are told (#5399).
pub(super) fn read_inputs(dice: &mut Dice, machine: &MachineSpec, programs: &mut [Vec<String>]) {
    let digital = machine.numbers("input").into_iter().map(|it| ('P', it));
    let analog = machine.analog_inputs().into_iter().map(|it| ('E', it));
    let inputs: Vec<(char, u8)> = digital.chain(analog).collect();
    if inputs.is_empty() {
        return;
    }
    for program in &mut *programs {
        for _ in 0..dice.whole(0..=4) {
            let (letter, number) = *dice.pick(&inputs);
            let Some(place) = resting_place(dice, program) else {
                continue;
            };
            let asks = format!("M66 {letter}{number} L0");
            let reads = ["#<found> = #5399", "G4 P[0.01 * #5399 * #5399]"];
            program.insert(place, (*dice.pick(&reads)).to_owned());
            if dice.chance(0.8) {
                program.insert(place, asks);
            }
        }
    }
}

/// Has programs orient a spindle whose angle is measured (M19), in between.
pub(super) fn orient(dice: &mut Dice, machine: &MachineSpec, programs: &mut [Vec<String>]) {
    if !machine
        .spindle
        .as_ref()
        .is_some_and(SpindleSpec::is_measured)
    {
        return;
    }
    for program in &mut *programs {
        for _ in 0..dice.whole(0..=2) {
            let angle = dice.whole(0..=3600);
            let word = *dice.pick(&["", " P0", " P1", " P2"]);
            if let Some(place) = resting_place(dice, program) {
                program.insert(place, format!("M19 R{}{word}", f64::from(angle) / 10.0));
            }
        }
    }
}

/// A place in a program where the path may come to rest: not where the cutter is compensated, and not behind the end.
fn resting_place(dice: &mut Dice, program: &[String]) -> Option<usize> {
    let place = dice.whole(1..=program.len() as u32) as usize;
    let before = program[..place].iter().rev();
    let words = ["G40", "G41", "G42", "M2", "M30"];
    let mut last = before.filter_map(|line| words.iter().find(|word| line.contains(**word)));
    matches!(last.next(), None | Some(&"G40")).then_some(place)
}

/// Where a simulated axis stands when it is switched on.
fn rest(axis: &AxisSpec) -> f64 {
    let [least, most] = axis.soft_limits;
    0.0_f64.clamp(least, most)
}

/// A program that is being written.
struct Writer {
    dice: Dice,
    axes: Vec<AxisSpec>,
    /// Where each axis is, machine coordinates.
    at: Vec<f64>,
    lines: Vec<String>,
    /// Labels of flow that were given.
    labels: u32,
}

impl Writer {
    /// At the beginning of a program.
    fn new(dice: Dice, machine: &MachineSpec) -> Self {
        Self {
            dice,
            axes: on_path(machine).cloned().collect(),
            at: on_path(machine).map(rest).collect(),
            lines: vec![BEGINS.to_owned()],
            labels: 0,
        }
    }

    fn push(&mut self, line: impl Into<String>) {
        self.lines.push(line.into());
    }

    /// A position of an axis a random way from where it is: over all decades, within its limits.
    fn target(&mut self, axis: usize) -> f64 {
        let AxisSpec {
            soft_limits: [least, most],
            travel,
            ..
        } = self.axes[axis];
        let to = match self.dice.weighted(&[3, 5, 1]) {
            0 => self.dice.between(least, most),
            1 => {
                let distance = travel * self.dice.decades(-3, 2);
                self.at[axis]
                    + if self.dice.chance(0.5) {
                        distance
                    } else {
                        -distance
                    }
            }
            _ => *self.dice.pick(&[least, most]),
        };
        rounded(to.clamp(least, most), DECIMALS).clamp(least, most)
    }

    /// Some axes' words for a move, and where it leads; absolute.
    fn words(&mut self) -> String {
        let mut words = String::new();
        let all = self.dice.chance(0.3);
        let first = self.dice.below(self.axes.len());
        for axis in 0..self.axes.len() {
            if all || axis == first || self.dice.chance(0.2) {
                self.at[axis] = self.target(axis);
                words += &format!(" {}{}", self.axes[axis].letter, self.at[axis]);
            }
        }
        words
    }

    fn rapid(&mut self) {
        let words = self.words();
        self.push(format!("G0{words}"));
    }

    fn line(&mut self) {
        let words = self.words();
        self.push(format!("G1{words}"));
    }

    fn feed(&mut self) {
        let axis = &self.axes[self.dice.below(self.axes.len())];
        let most = axis.velocity * 60.0;
        let feed = most * *self.dice.pick(&[0.02, 0.1, 0.3, 0.7, 1.0, 3.0]);
        self.push(format!("F{}", rounded(feed, DECIMALS).max(0.001)));
    }

    /// The places of two linear axes, by the plane that they span, if the machine has them.
    fn plane(&mut self) -> Option<(&'static str, [usize; 2], [char; 2])> {
        let planes = [
            ("G17", ['X', 'Y'], ['I', 'J']),
            ("G18", ['Z', 'X'], ['K', 'I']),
            ("G19", ['Y', 'Z'], ['J', 'K']),
        ];
        let (code, letters, centre) = *self.dice.pick(&planes);
        let place = |letter| self.axes.iter().position(|axis| axis.letter == letter);
        Some((code, [place(letters[0])?, place(letters[1])?], centre))
    }

    /// Room of an axis to both sides.
    fn room(&self, axis: usize) -> f64 {
        let [least, most] = self.axes[axis].soft_limits;
        (self.at[axis] - least).min(most - self.at[axis])
    }

    /// An arc, a full circle or a helix, where there is room for one.
    fn arc(&mut self) {
        let Some((code, [a, b], [i, j])) = self.plane() else {
            return self.line();
        };
        // The whole circle is within the limits.
        let room = self.room(a).min(self.room(b)) / 2.0;
        let radius = rounded(room * self.dice.between(0.01, 0.99), 3);
        if radius < 0.05 {
            return self.line();
        }
        let [x, y] = self.dice.direction();
        let centre = [rounded(radius * x, DECIMALS), rounded(radius * y, DECIMALS)];
        let sense = *self.dice.pick(&["G2", "G3"]);
        let letters = [a, b].map(|axis| self.axes[axis].letter);
        let mut words = format!("{i}{} {j}{}", centre[0], centre[1]);
        if self.dice.chance(0.7) {
            let [u, v] = self.dice.direction();
            let real = (centre[0] * centre[0] + centre[1] * centre[1]).sqrt();
            let end = [
                rounded(self.at[a] + centre[0] + real * u, DECIMALS),
                rounded(self.at[b] + centre[1] + real * v, DECIMALS),
            ];
            words = format!("{}{} {}{} {words}", letters[0], end[0], letters[1], end[1]);
            (self.at[a], self.at[b]) = (end[0], end[1]);
        }
        self.push(format!("{code} {sense} {words}"));
    }

    /// Short segments, as CAM writes a curve.
    fn contour(&mut self) {
        let Some((_, [a, b], _)) = self.plane() else {
            return self.zigzag();
        };
        let letters = [a, b].map(|axis| self.axes[axis].letter);
        let travel = self.axes[a].travel.min(self.axes[b].travel);
        let step = travel * self.dice.decades(-2, 0);
        let [mut x, mut y] = self.dice.direction();
        let bend = self.dice.between(0.0, 0.3);
        for _ in 0..self.dice.whole(5..=60) {
            let t = self.dice.between(-bend, bend);
            let (cos, sin) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
            (x, y) = (x * cos - y * sin, x * sin + y * cos);
            let to = [self.at[a] + step * x, self.at[b] + step * y].map(|it| rounded(it, DECIMALS));
            let inside = |axis: usize, to: f64| {
                let [least, most] = self.axes[axis].soft_limits;
                (least..=most).contains(&to)
            };
            if !inside(a, to[0]) || !inside(b, to[1]) {
                (x, y) = (-x, -y);
                continue;
            }
            (self.at[a], self.at[b]) = (to[0], to[1]);
            self.push(format!(
                "G1 {}{} {}{}",
                letters[0], to[0], letters[1], to[1]
            ));
        }
    }

    /// To and fro over the same stretch: reversals, moves of no length.
    fn zigzag(&mut self) {
        let axis = self.dice.below(self.axes.len());
        let letter = self.axes[axis].letter;
        let ends = [self.at[axis], self.target(axis)];
        for turn in 0..self.dice.whole(1..=6) as usize {
            self.at[axis] = ends[(turn + 1) % 2];
            let code = *self.dice.pick(&["G1", "G0", "G1"]);
            self.push(format!("{code} {letter}{}", self.at[axis]));
        }
    }

    fn incremental(&mut self) {
        let axis = self.dice.below(self.axes.len());
        let to = self.target(axis);
        let distance = rounded(to - self.at[axis], DECIMALS);
        self.push(format!("G91 G1 {}{distance}", self.axes[axis].letter));
        self.at[axis] += distance;
        self.push("G90");
    }

    fn inverse_time(&mut self) {
        let words = self.words();
        let feed = rounded(60.0 / self.dice.between(0.05, 2.0), 3);
        self.push(format!("G93 G1{words} F{feed}"));
        self.push("G94");
        self.feed();
    }

    /// A loop that goes somewhere and back.
    fn repeat(&mut self) {
        self.labels += 1;
        let label = self.labels;
        let times = self.dice.whole(0..=4);
        let axis = self.dice.below(self.axes.len());
        let letter = self.axes[axis].letter;
        let (from, to) = (self.at[axis], self.target(axis));
        self.push(format!("O{label} REPEAT [{times}]"));
        self.push(format!("G1 {letter}{to}"));
        self.push(format!("G0 {letter}{from}"));
        self.push(format!("O{label} ENDREPEAT"));
    }

    /// Positions by parameters and expressions.
    fn parameters(&mut self) {
        let axis = self.dice.below(self.axes.len());
        let to = self.target(axis);
        let half = rounded(to / 2.0, DECIMALS);
        self.push(format!("#101 = {half}"));
        self.push(format!("#<rest> = [{to} - #101]"));
        self.push(format!("G1 {}[#101 + #<rest>]", self.axes[axis].letter));
        self.at[axis] = to;
    }

    /// A hole, where there is an axis to drill it with.
    fn drill(&mut self) {
        let place = |letter| self.axes.iter().position(|axis| axis.letter == letter);
        let (Some(x), Some(z)) = (place('X'), place('Z')) else {
            return self.line();
        };
        let [least, most] = self.axes[z].soft_limits;
        let depth = (most - least) * self.dice.between(0.001, 0.1);
        let level = |part: f64| rounded(most - part * depth, DECIMALS);
        self.push(format!("G0 Z{}", level(0.0).min(most)));
        let cycle = *self
            .dice
            .pick(&["G81", "G82 P0.02", "G73 Q", "G83 Q", "G85", "G89 P0.01"]);
        let peck = if cycle.ends_with('Q') {
            rounded(depth / 3.0, DECIMALS).max(0.001).to_string()
        } else {
            String::new()
        };
        self.at[x] = self.target(x);
        let back = *self.dice.pick(&["G98", "G99"]);
        self.push(format!(
            "{back} {cycle}{peck} X{} Z{} R{}",
            self.at[x],
            level(0.9).max(least),
            level(0.2)
        ));
        self.push("G80");
        self.push(format!("G0 Z{}", level(0.0).min(most)));
        self.at[z] = level(0.0).min(most);
    }

    /// A square with cutter compensation, inside or outside of it.
    fn compensated(&mut self) {
        let Some((code, [a, b], _)) = self.plane() else {
            return self.line();
        };
        let spans = [a, b].map(|axis| self.axes[axis].soft_limits);
        let span = spans.map(|[least, most]| most - least);
        if span[0].max(span[1]) > MOST_APART * span[0].min(span[1]) {
            return self.line();
        }
        let side = span[0].min(span[1]) * self.dice.between(0.05, 0.3);
        let diameter = rounded(side * self.dice.between(0.02, 0.4), DECIMALS);
        if diameter < 0.01 {
            return self.line();
        }
        let letters = [a, b].map(|axis| self.axes[axis].letter);
        let from = [0, 1].map(|it| (spans[it][0] + spans[it][1] - side) / 2.0);
        let place = |[u, v]: [f64; 2]| {
            let at = [from[0] + u * side, from[1] + v * side].map(|it| rounded(it, DECIMALS));
            (
                at,
                format!("{}{} {}{}", letters[0], at[0], letters[1], at[1]),
            )
        };
        // From the tool's side onto the middle of the first line, and off it again.
        let (hand, towards) = *self.dice.pick(&[("G41.1", 0.4), ("G42.1", -0.4)]);
        let (beside, words) = place([0.5, towards]);
        self.push(format!("{code} G0 {words}"));
        self.push(format!("{hand} D{diameter}"));
        let middle = [0.5, 0.0];
        for corner in [
            middle,
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [0.0, 0.0],
            middle,
        ] {
            self.push(format!("G1 {}", place(corner).1));
        }
        self.push(format!("G40 G1 {words}"));
        (self.at[a], self.at[b]) = (beside[0], beside[1]);
    }

    /// Numbers for some of the axes, at least for one, as words and by axis.
    fn numbers(&mut self) -> (String, Vec<Option<f64>>) {
        let first = self.dice.below(self.axes.len());
        let mut numbers = Vec::with_capacity(self.axes.len());
        let mut words = String::new();
        for axis in 0..self.axes.len() {
            let mut number = None;
            if axis == first || self.dice.chance(0.4) {
                let [least, most] = self.axes[axis].soft_limits;
                let at = rounded(self.dice.between(-1.5, 1.5) * (most - least), DECIMALS);
                words += &format!(" {}{at}", self.axes[axis].letter);
                number = Some(at);
            }
            numbers.push(number);
        }
        (words, numbers)
    }

    /// Shifts the coordinates in one way, or in two at once, goes somewhere, and shifts them back.
    fn shift(&mut self, outputs: &[u8]) {
        let mut by = vec![0.0; self.axes.len()];
        let mut back = Vec::new();
        // What a block does not name is that of an earlier time.
        let letters = self.axes.iter().map(|axis| format!(" {}0", axis.letter));
        let zeros: String = letters.collect();
        for _ in 0..self.dice.whole(1..=2) {
            let kind = self.dice.below(6);
            if back.iter().any(|(of, _)| *of == kind / 2) {
                continue;
            }
            let (words, numbers) = self.numbers();
            let named = numbers.iter().enumerate();
            let named: Vec<_> = named
                .filter_map(|(axis, it)| Some((axis, (*it)?)))
                .collect();
            let place = self.dice.whole(2..=9);
            let system = ["G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
            let system = system[place as usize - 2];
            let tool = self.dice.whole(1..=3);
            // What the position has in the shifted coordinates is told by some, and the shift by others.
            let by_position = matches!(kind, 0 | 2);
            match kind {
                0 => self.push(format!("G92{words}")),
                1 => self.push(format!("G52{words}")),
                2 | 3 => {
                    self.push(format!("G10 L2 P{place}{zeros}"));
                    self.push(system);
                    let way = if by_position { "L20" } else { "L2" };
                    let number = [0, place][self.dice.below(2)];
                    self.push(format!("G10 {way} P{number}{words}"));
                }
                4 => {
                    self.push(format!("G10 L1 P{tool}{zeros}"));
                    self.push(format!("G10 L1 P{tool}{words}"));
                    if self.dice.chance(0.5) {
                        self.push(format!("T{tool} M6"));
                        self.push("G43");
                    } else {
                        self.push(format!("G43 H{tool}"));
                    }
                }
                _ => self.push(format!("G43.1{words}")),
            }
            for (axis, number) in named {
                by[axis] = match by_position {
                    true => self.at[axis] - number,
                    false => by[axis] + number,
                };
            }
            back.push((
                kind / 2,
                match kind {
                    0 | 1 => "G92.1",
                    2 | 3 => "G54",
                    _ => "G49",
                },
            ));
        }
        for _ in 0..self.dice.whole(1..=3) {
            self.go_shifted(&by, false);
            self.signal(&[], outputs);
        }
        for (_, code) in back {
            self.push(code);
        }
        self.go_shifted(&vec![0.0; self.axes.len()], false);
    }

    /// A move in coordinates that are shifted by so much, of all axes or of some.
    fn go_shifted(&mut self, by: &[f64], all: bool) {
        let mut words = String::new();
        let first = self.dice.below(self.axes.len());
        for (axis, by) in by.iter().enumerate() {
            if all || axis == first || self.dice.chance(0.3) {
                let [least, most] = self.axes[axis].soft_limits;
                let margin = 0.1 * LEAST_SPAN;
                let to = self.target(axis).clamp(least + margin, most - margin);
                let word = rounded(to - by, DECIMALS);
                self.at[axis] = word + by;
                words += &format!(" {}{word}", self.axes[axis].letter);
            }
        }
        let code = *self.dice.pick(&["G0", "G1"]);
        self.push(format!("{code}{words}"));
    }

    /// Switches what is wired, or waits for it.
    fn signal(&mut self, inputs: &[u8], outputs: &[u8]) {
        if !outputs.is_empty() && self.dice.chance(0.7) {
            let (code, number) = (self.dice.whole(62..=65), *self.dice.pick(outputs));
            self.push(format!("M{code} P{number}"));
        }
        if !inputs.is_empty() && self.dice.chance(0.5) {
            let (number, until) = (*self.dice.pick(inputs), self.dice.whole(1..=4));
            let seconds = *self.dice.pick(&["0.01", "0.1", "0.5"]);
            self.push(format!("M66 P{number} L{until} Q{seconds}"));
        }
    }

    fn dwell(&mut self) {
        let seconds = *self.dice.pick(&["0", "0.001", "0.02", "0.1", "0.3"]);
        self.push(format!("G4 P{seconds}"));
    }

    fn mode(&mut self) {
        let mode = match self.dice.below(5) {
            0 => "G61".to_owned(),
            1 => "G61.1".to_owned(),
            2 => "G64".to_owned(),
            3 => format!("G64 P{}", self.dice.decades(-3, 1)),
            _ => {
                let (p, q) = (self.dice.decades(-3, 0), self.dice.decades(-3, 0));
                format!("G64 P{p} Q{q}")
            }
        };
        self.push(mode);
    }

    fn stop(&mut self) {
        let stop = *self.dice.pick(&["M0", "M1", "T1 M6", "T2 M6", "M1"]);
        self.push(stop);
    }

    fn switch(&mut self) {
        let number = self.dice.whole(0..=7);
        let code = match self.dice.below(10) {
            0 => format!("M3 S{}", self.dice.whole(0..=9000)),
            1 => "M4 S500".to_owned(),
            2 => "M5".to_owned(),
            3 => (*self.dice.pick(&["M7", "M8", "M9"])).to_owned(),
            4 | 5 => format!("M{} P{number}", self.dice.whole(64..=65)),
            6 | 7 => format!("M{} P{number}", self.dice.whole(62..=63)),
            8 => format!("M{} E{} Q{number}", self.dice.whole(67..=68), number % 4),
            _ => format!("M{}", self.dice.whole(100..=120)),
        };
        self.push(code);
    }

    fn nothing(&mut self) {
        let line = *self.dice.pick(&[
            "",
            "(nothing)",
            "; nothing",
            "N7",
            "G54",
            "G49",
            "G40",
            "G80",
        ]);
        self.push(line);
    }

    /// A block that has to be refused.
    fn mistake(&mut self) {
        let axis = &self.axes[self.dice.below(self.axes.len())];
        let beyond = axis.soft_limits[1] + axis.travel.max(1.0);
        let mistakes = [
            format!("G1 {}{beyond}", axis.letter),
            "G1 Q".to_owned(),
            "G2 X1".to_owned(),
            "G33 Z1".to_owned(),
            "#1 = [1 / 0] G4 P#1".to_owned(),
            "O9 ENDREPEAT".to_owned(),
            "G0 G1 X0".to_owned(),
        ];
        let place = self.dice.below(self.lines.len());
        let mistake = self.dice.pick(&mistakes).clone();
        self.lines.insert(place, mistake);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Programs;
    use std::path::Path;

    #[test]
    fn every_special_program_is_a_good_one() {
        let (mut compensated, mut waiting) = (0, 0);
        for seed in 0..400 {
            let mut spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            spec.wire(&mut Dice::new(seed, 5));
            let machine = spec.machine().unwrap();
            let programs = Programs::new(&machine, Path::new("/nowhere/machine.toml")).unwrap();
            let Some(lines) = special(&mut Dice::new(seed, 6), &spec) else {
                continue;
            };
            let text = lines.join("\n") + "\n";
            compensated += usize::from(text.contains("G41.1") || text.contains("G42.1"));
            waiting += usize::from(text.contains("M66"));
            if let Err(wrong) = programs.lines(&text).check(machine.rest()) {
                panic!("{seed}: {wrong}\n{text}");
            }
        }
        assert!(
            compensated > 20 && waiting > 20,
            "{compensated} compensated, {waiting} waiting"
        );
    }

    #[test]
    fn every_shifted_program_is_a_good_one() {
        let mut codes = [0; 7];
        for seed in 0..300 {
            let spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            let machine = spec.machine().unwrap();
            let programs = Programs::new(&machine, Path::new("/nowhere/machine.toml")).unwrap();
            let Some(lines) = shifted(&mut Dice::new(seed, 36), &spec) else {
                continue;
            };
            let text = lines.join("\n") + "\n";
            let all = ["G92 ", "G52 ", "G10 L2 ", "G10 L20", "G43 H", "G43.1", "M6"];
            for (count, code) in codes.iter_mut().zip(all) {
                *count += usize::from(text.contains(code));
            }
            if let Err(wrong) = programs.lines(&text).check(machine.rest()) {
                panic!("{seed}: {wrong}\n{text}");
            }
        }
        assert!(codes.iter().all(|count| *count > 5), "{codes:?}");
    }

    #[test]
    fn nearly_every_program_is_a_good_one() {
        let mut bad = Vec::new();
        for seed in 0..400 {
            let mut dice = Dice::new(seed, 0);
            let spec = MachineSpec::draw(&mut dice);
            let machine = spec.machine().unwrap();
            let programs = Programs::new(&machine, Path::new("/nowhere/machine.toml")).unwrap();
            let text = draw(&mut dice, &spec).join("\n") + "\n";
            if let Err(wrong) = programs.lines(&text).check(machine.rest()) {
                bad.push(format!("{seed}: {wrong}"));
            }
        }
        assert!(
            (5..60).contains(&bad.len()),
            "{}: {}",
            bad.len(),
            bad.join("\n")
        );
    }
}
