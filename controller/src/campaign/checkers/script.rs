//! What a drawn program makes of outputs: in which order, where, and how long one state lasts at least.
//!
//! A reader of its own, so that a program that the controller misreads is found. It knows no more of RS-274 than
//! the campaign's programs have; where it does not know what comes, the rest of the program is left open.

use super::super::machine::AxisSpec;
use std::mem::take;

/// Positions that differ by less are the same, mm.
const SAME: f64 = 1e-6;

/// What has been switched.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Switched {
    /// The spindle turns: the other way (M4), or not.
    pub(super) turns: Option<bool>,
    /// It is held at an angle instead (M19).
    pub(super) is_oriented: bool,
    /// S, 1/min.
    pub(super) speed: f64,
    /// M7 and M8.
    pub(super) coolant: [bool; 2],
    /// M62 to M65: bit 0 is P0.
    pub(super) digital: u64,
    /// M67 and M68, from E0 on.
    pub(super) analog: [f64; 4],
    /// Outputs of the program, by bits, that are what is safe, as nobody has switched them.
    kept: [u64; 2],
}

impl Switched {
    /// Turns the spindle, or not; then it may be oriented.
    fn turn(&mut self, turns: Option<bool>, is_oriented: bool) {
        self.turns = turns;
        self.is_oriented = is_oriented;
    }

    /// Switches the output with this P.
    pub(super) fn put(&mut self, number: u8, on: bool) {
        let bit = bit(number);
        self.digital = self.digital & !bit | if on { bit } else { 0 };
        self.kept[0] &= !bit;
    }

    /// Puts this out at the analog output with this E.
    fn put_analog(&mut self, number: u8, value: f64) {
        self.analog[usize::from(number) % 4] = value;
        self.kept[1] &= !bit(number % 4);
    }

    /// The output with this P has what is safe until it is switched.
    pub(super) fn keep(&mut self, number: u8, safe: bool) {
        self.put(number, safe);
        self.kept[0] |= bit(number);
    }

    /// The same of the analog output with this E.
    pub(super) fn keep_analog(&mut self, number: u8, safe: f64) {
        self.put_analog(number, safe);
        self.kept[1] |= bit(number % 4);
    }

    /// What nobody has switched is off.
    pub(super) fn let_go(&mut self) {
        let [digital, analog] = take(&mut self.kept);
        self.digital &= !digital;
        for (number, value) in (0..).zip(&mut self.analog) {
            if analog & bit(number) != 0 {
                *value = 0.0;
            }
        }
    }
}

/// The bit of an output; none for one that no machine has.
fn bit(number: u8) -> u64 {
    1_u64.checked_shl(number.into()).unwrap_or(0)
}

/// One state of a program's outputs.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub(super) state: Switched,
    /// Where the path is when it comes, by axis, mm, as far as that is known.
    pub(super) place: Vec<Option<f64>>,
    /// How far the path may be from there, mm.
    pub(super) tolerance: f64,
    /// How long it lasts at least, s.
    pub(super) lasts: f64,
}

/// The states of a program in their order.
#[derive(Clone, Debug)]
pub(super) struct Script {
    /// The first one is that which it begins with.
    pub(super) steps: Vec<Step>,
    /// What follows the last one is not known.
    pub(super) is_open: bool,
}

/// The machine, as a program's reader needs it.
pub(super) struct Reading<'a> {
    pub(super) axes: &'a [AxisSpec],
    /// How far a path may be from what is programmed, mm: exact, and blended.
    pub(super) tolerances: [f64; 2],
    /// It is a program and no typed lines: what it leaves on is switched off.
    pub(super) is_program: bool,
    /// Positions of the program are positions of the machine.
    pub(super) is_placed: bool,
}

/// A change of a state.
type Change = Box<dyn Fn(&mut Switched)>;

/// What the positions of a program are shifted by, by axis, mm; `None`: nobody knows.
struct Shifts {
    /// Of G54 to G59.3.
    offsets: Vec<Vec<Option<f64>>>,
    active: usize,
    /// Of G92 and G52, and whether it is on.
    common: Vec<Option<f64>>,
    is_on: bool,
    /// Of tools.
    lengths: Vec<(u32, Vec<Option<f64>>)>,
    loaded: u32,
    /// Of the tool that is compensated.
    length: Vec<Option<f64>>,
}

impl Shifts {
    fn new(axes: usize) -> Self {
        let none = vec![Some(0.0); axes];
        Self {
            offsets: vec![none.clone(); 9],
            active: 0,
            common: none.clone(),
            is_on: false,
            lengths: Vec::new(),
            loaded: 0,
            length: none,
        }
    }

    /// Without what G92 and G52 add.
    fn beneath(&self, axis: usize) -> Option<f64> {
        Some(self.offsets[self.active][axis]? + self.length[axis]?)
    }

    fn of(&self, axis: usize) -> Option<f64> {
        let common = if self.is_on { self.common[axis]? } else { 0.0 };
        Some(self.beneath(axis)? + common)
    }
}

struct Reader<'a> {
    reading: &'a Reading<'a>,
    script: Script,
    shifts: Shifts,
    /// Where it is, machine positions.
    at: Vec<Option<f64>>,
    /// M62, M63 and M67, which wait for a motion.
    waiting: Vec<Change>,
    /// Steps whose place the next motion begins at.
    since_motion: usize,
    /// How far the path may be from where motions end, mm.
    tolerance: f64,
    is_exact: bool,
    absolute: bool,
    compensated: bool,
    motion: Option<u32>,
    ended: bool,
}

impl Script {
    /// Of a job that begins with what is switched already; `lines` are its text.
    pub(super) fn read(lines: &[String], reading: &Reading<'_>, begins: Switched) -> Self {
        let mut reader = Reader {
            at: vec![None; reading.axes.len()],
            shifts: Shifts::new(reading.axes.len()),
            script: Self {
                steps: Vec::new(),
                is_open: false,
            },
            waiting: Vec::new(),
            since_motion: 0,
            tolerance: reading.tolerances[0],
            is_exact: true,
            absolute: true,
            compensated: false,
            motion: None,
            ended: false,
            reading,
        };
        reader.step(begins);
        let text: Option<Vec<&str>> = unrolled(lines);
        reader.script.is_open |= text.is_none();
        for line in text.unwrap_or_default() {
            if !reader.ended && !reader.script.is_open && reader.line(line).is_none() {
                reader.script.is_open = true;
            }
        }
        if reader.ended || reading.is_program && !reader.script.is_open {
            reader.switch(|it| {
                it.turn(None, false);
                it.coolant = [false; 2];
            });
        }
        reader.script
    }

    /// Of one of which nothing is known.
    pub(super) fn unknown() -> Self {
        Self {
            steps: Vec::new(),
            is_open: true,
        }
    }
}

/// The lines with loops written out; `None` where they do not close.
fn unrolled(lines: &[String]) -> Option<Vec<&str>> {
    let mut all = Vec::new();
    let mut lines = lines.iter().map(String::as_str);
    while let Some(line) = lines.next() {
        let Some((label, times)) = line.split_once(" REPEAT ") else {
            all.push(line);
            continue;
        };
        let times: usize = times.trim_matches(['[', ']']).parse().ok()?;
        let end = format!("{label} ENDREPEAT");
        let mut body = Vec::new();
        loop {
            match lines.next()? {
                line if line == end => break,
                line => body.push(line),
            }
        }
        all.extend(body.repeat(times));
    }
    Some(all)
}

/// A line's words, each with its number if that is written out; `None` for what is no block of words.
fn words(line: &str) -> Option<Vec<(char, Option<f64>)>> {
    let line = line.split(';').next()?;
    let mut text = String::new();
    let mut depth = 0;
    for letter in line.chars().filter(|it| !it.is_whitespace()) {
        match letter {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ if depth == 0 => text.push(letter),
            _ => {}
        }
    }
    let mut words = Vec::new();
    let mut rest = text.as_str();
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_alphabetic() {
            return None;
        }
        rest = &rest[1..];
        let end = if rest.starts_with('[') {
            rest.find(']')? + 1
        } else {
            let ends = |it: char| !(it.is_ascii_digit() || "+-.".contains(it));
            rest.find(ends).unwrap_or(rest.len())
        };
        words.push((letter.to_ascii_uppercase(), rest[..end].parse().ok()));
        rest = &rest[end..];
    }
    Some(words)
}

impl Reader<'_> {
    /// A state begins here.
    fn step(&mut self, state: Switched) {
        let is_placed = self.reading.is_placed && !self.compensated;
        let place = match is_placed {
            true => self.at.clone(),
            false => vec![None; self.at.len()],
        };
        self.script.steps.push(Step {
            state,
            place,
            tolerance: self.tolerance,
            lasts: 0.0,
        });
    }

    fn switch(&mut self, change: impl Fn(&mut Switched)) {
        let Some(last) = self.script.steps.last() else {
            return;
        };
        let mut state = last.state;
        change(&mut state);
        if state != last.state {
            self.step(state);
        }
    }

    /// The state lasts so much longer.
    fn last(&mut self, seconds: f64) {
        if let Some(step) = self.script.steps.last_mut() {
            step.lasts += seconds;
        }
    }

    /// Reads a line; `None` where it is not understood.
    fn line(&mut self, line: &str) -> Option<()> {
        if line.starts_with('#') {
            return Some(());
        }
        let words = words(line)?;
        let value = |letter: char| {
            let mut words = words.iter().filter(|word| word.0 == letter);
            words.next().map(|word| word.1)
        };
        let codes = |letter| words.iter().filter(move |word| word.0 == letter);
        if self.shift(&value)? {
            return Some(());
        }
        self.functions(codes('M'), &value)?;
        let mut moves = None;
        for (_, code) in codes('G') {
            match ((*code)? * 10.0).round() as u32 {
                code @ (0 | 10 | 20 | 30) => moves = Some(code),
                code @ (730 | 810 | 820 | 830 | 850 | 890) => moves = Some(code),
                40 => self.last(value('P')??),
                900 => self.absolute = true,
                910 => self.absolute = false,
                610 | 611 => (self.tolerance, self.is_exact) = (self.reading.tolerances[0], true),
                640 => {
                    let [blend, naive] = ['P', 'Q'].map(|it| value(it).flatten());
                    let blend = blend.unwrap_or(self.reading.tolerances[1]);
                    (self.tolerance, self.is_exact) = (blend + naive.unwrap_or(0.0), false);
                }
                411 | 421 => self.compensated = true,
                400 => self.compensated = false,
                490 => self.shifts.length.fill(Some(0.0)),
                code @ 540..=590 => self.shifts.active = (code as usize - 540) / 10,
                code @ 591..=593 => self.shifts.active = code as usize - 585,
                170..=190 | 210 | 800 | 930 | 940 | 980 | 990 => {}
                _ => return None,
            }
        }
        self.motion = moves.or(self.motion);
        let letters = self.reading.axes.iter().map(|axis| value(axis.letter));
        let to: Vec<Option<Option<f64>>> = letters.collect();
        if to.iter().any(Option::is_some) || matches!(moves, Some(20 | 30)) {
            self.go(&to)?;
        }
        for (_, code) in codes('M') {
            self.ended |= matches!((*code)? as u32, 2 | 30);
        }
        Some(())
    }

    /// What sets a shift; false where nothing does, which is where a line may be anything else.
    fn shift(&mut self, value: &dyn Fn(char) -> Option<Option<f64>>) -> Option<bool> {
        if let Some(tool) = value('T') {
            self.shifts.loaded = tool? as u32;
        }
        let code = (value('G').flatten().unwrap_or_default() * 10.0).round() as u32;
        let letters = self.reading.axes.iter().map(|axis| value(axis.letter));
        let words: Vec<Option<Option<f64>>> = letters.collect();
        let named = words.iter().enumerate();
        let named = named.filter_map(|(axis, word)| word.map(|word| (axis, word)));
        let shifts = &mut self.shifts;
        match code {
            100 => {
                let (what, number) = (value('L')?? as u32, value('P')?? as usize);
                match what {
                    1 => {
                        let tool = number as u32;
                        let known = shifts.lengths.iter().position(|it| it.0 == tool);
                        let mut length = match known {
                            Some(place) => shifts.lengths.swap_remove(place).1,
                            None => vec![None; words.len()],
                        };
                        for (axis, word) in named {
                            length[axis] = word;
                        }
                        shifts.lengths.push((tool, length));
                    }
                    2 | 20 => {
                        let of = number.checked_sub(1).unwrap_or(shifts.active);
                        for (axis, word) in named {
                            let at = self.at[axis];
                            let common = shifts.of(axis).zip(shifts.beneath(axis));
                            let set = common.zip(shifts.length[axis]).zip(at).zip(word);
                            shifts.offsets.get_mut(of)?[axis] = match what {
                                2 => word,
                                _ => set.map(|((((all, beneath), length), at), word)| {
                                    at - word - length - (all - beneath)
                                }),
                            };
                        }
                    }
                    _ => return None,
                }
            }
            520 => {
                for (axis, word) in named {
                    shifts.common[axis] = word;
                }
                shifts.is_on = true;
            }
            920 => {
                for (axis, word) in named {
                    let set = self.at[axis].zip(shifts.beneath(axis)).zip(word);
                    shifts.common[axis] = set.map(|((at, beneath), word)| at - beneath - word);
                }
                shifts.is_on = true;
            }
            921 => {
                shifts.common.fill(Some(0.0));
                shifts.is_on = false;
            }
            922 | 923 => shifts.is_on = code == 923,
            430 => {
                let tool = value('H').map_or(Some(shifts.loaded), |it| Some(it? as u32))?;
                let mut lengths = shifts.lengths.iter();
                shifts
                    .length
                    .clone_from(&lengths.find(|it| it.0 == tool)?.1);
            }
            431 => {
                for (axis, word) in named {
                    shifts.length[axis] = word;
                }
            }
            _ => return Some(false),
        }
        Some(true)
    }

    /// What M-codes switch.
    fn functions<'w>(
        &mut self,
        codes: impl Iterator<Item = &'w (char, Option<f64>)>,
        value: &dyn Fn(char) -> Option<Option<f64>>,
    ) -> Option<()> {
        if let Some(speed) = value('S') {
            let speed = speed?;
            self.switch(move |it| it.speed = speed);
        }
        for (_, code) in codes {
            let code = (*code)? as u32;
            match code {
                3 | 4 => self.switch(|it| it.turn(Some(code == 4), false)),
                5 | 19 => self.switch(|it| it.turn(None, code == 19)),
                7 => self.switch(|it| it.coolant[0] = true),
                8 => self.switch(|it| it.coolant[1] = true),
                9 => self.switch(|it| it.coolant = [false; 2]),
                62..=65 => {
                    let (number, on) = (value('P')?? as u8, matches!(code, 62 | 64));
                    let change = move |it: &mut Switched| it.put(number, on);
                    match code {
                        64.. => self.switch(change),
                        _ => self.waiting.push(Box::new(change)),
                    }
                }
                67 | 68 => {
                    let (number, to) = (value('E')?? as u8, value('Q')??);
                    let change = move |it: &mut Switched| it.put_analog(number, to);
                    match code {
                        68 => self.switch(change),
                        _ => self.waiting.push(Box::new(change)),
                    }
                }
                _ => {}
            }
        }
        Some(())
    }

    /// A motion; `None` where nobody knows whether it is one, and something waits for it.
    fn go(&mut self, to: &[Option<Option<f64>>]) -> Option<()> {
        let is_line = matches!(self.motion, Some(0 | 10));
        let is_cycle = !matches!(self.motion, Some(0..=30));
        let axes = self.at.iter().zip(to).enumerate();
        let there = axes.map(|(axis, (at, to))| match to {
            None => *at,
            Some(_) if is_cycle || self.compensated => None,
            Some(to) if self.absolute => to.zip(self.shifts.of(axis)).map(|(to, by)| to + by),
            Some(by) => at.zip(*by).map(|(at, by)| at + by),
        });
        let there: Vec<Option<f64>> = there.collect();
        let distances = self.at.iter().zip(&there);
        let distances = distances.map(|(from, to)| Some(((*to)? - (*from)?).abs()));
        let distances: Vec<Option<f64>> = distances.collect();
        let mut named = distances.iter().zip(to).filter(|(_, to)| to.is_some());
        let is_known = named.all(|(distance, _)| distance.is_some());
        let moves = !is_line || distances.iter().flatten().any(|distance| *distance > SAME);
        if !moves && is_known {
            self.at = there;
            return Some(());
        }
        if !moves && !self.waiting.is_empty() {
            return None;
        }
        for change in std::mem::take(&mut self.waiting) {
            self.switch(change);
        }
        let tolerance = self.tolerance;
        for step in &mut self.script.steps[self.since_motion..] {
            step.tolerance = step.tolerance.max(tolerance);
        }
        self.since_motion = self.script.steps.len();
        if is_line && self.is_exact && !self.compensated {
            let axes = self.reading.axes.iter().zip(&distances);
            let times = axes.filter_map(|(axis, distance)| {
                Some((((*distance)? - 2.0 * tolerance) / axis.velocity).max(0.0))
            });
            let time = times.fold(0.0, f64::max);
            self.last(time);
        }
        self.at = there;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::case::Case;
    use super::*;

    #[test]
    fn shifted_positions_are_those_of_the_machine() {
        let axes = Case::of(0).machine.axes;
        let letter = axes[0].letter;
        let lines = [
            "G0 X10",
            "G92 X0",
            "G1 X5",
            "M64 P0",
            "G92.1",
            "G10 L2 P2 X3",
            "G55",
            "G1 X1",
            "M65 P0",
            "G43.1 X2",
            "G0 X0",
            "M64 P0",
            "G52 X-1",
            "G0 X0",
            "M65 P0",
            "G10 L1 P3 X7",
            "G43 H3",
            "G10 L20 P0 X1",
            "G92.2",
            "G0 X0",
            "M64 P0",
            "G54",
            "G49",
            "G0 X6",
            "M65 P0",
        ];
        let lines: Vec<String> = lines
            .iter()
            .map(|line| line.replace('X', &letter.to_string()))
            .collect();
        let reading = Reading {
            axes: &axes,
            tolerances: [0.0; 2],
            is_program: true,
            is_placed: true,
        };
        let script = Script::read(&lines, &reading, Switched::default());
        assert!(!script.is_open);
        let places = script.steps.iter().skip(1).map(|step| step.place[0]);
        let places: Vec<Option<f64>> = places.collect();
        let right = [15.0, 4.0, 5.0, 4.0, 4.0, 6.0].map(Some);
        assert_eq!(places, right);
    }
}
