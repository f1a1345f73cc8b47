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

struct Reader<'a> {
    reading: &'a Reading<'a>,
    script: Script,
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
                170..=190 | 210 | 490 | 540 | 800 | 930 | 940 | 980 | 990 => {}
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
        let there = self.at.iter().zip(to).map(|(at, to)| match to {
            None => *at,
            Some(_) if is_cycle || self.compensated => None,
            Some(to) if self.absolute => *to,
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
