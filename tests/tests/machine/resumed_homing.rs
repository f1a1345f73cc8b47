//! Programs that home axes, interrupted wherever it may be, by holds, stops and faults, and resumed each time: what they
//! home, switch and cut is what they say, in their order, and nothing is left uncut.

use super::homing::{Y, settle, state, switched_on};
use proptest::prelude::*;
use proptest::sample::select;
use syncline_controller::control::{Event, Row, State};
use syncline_controller::machine::COORDINATES;
use syncline_controller::session::Command;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_tests::rig::Rig;

/// So far a cut may begin behind what is cut already: what the axes go in two cycles, mm.
const GAP: f64 = 1.5;
/// So near to the end of a cut it may be the one or the next, mm.
const JOINT: f64 = 0.05;
/// Slower, the axes rest, mm/s.
const REST: f64 = 1.0;

/// A block of a program.
#[derive(Clone, Copy, Debug)]
enum Block {
    Home([bool; 3]),
    Cut([f64; 3]),
    Output,
    Dwell,
}

fn block() -> impl Strategy<Value = Block> {
    let places = (1.0..250.0, 1.0..250.0, -60.0..-1.0_f64);
    prop_oneof![
        1 => any::<[bool; 3]>().prop_map(Block::Home),
        4 => places.prop_map(|(x, y, z)| Block::Cut([x, y, z])),
        2 => Just(Block::Output),
        1 => Just(Block::Dwell),
    ]
}

/// What interrupts it.
#[derive(Clone, Copy, Debug)]
enum Interruption {
    Hold,
    Stop,
    Fault,
}

/// When it is interrupted, in wake-ups.
#[derive(Clone, Copy, Debug)]
enum When {
    /// Behind the last interruption.
    Later(usize),
    /// Behind the next homing, of which the program has hardly gone on.
    Homed(usize),
}

fn interruption() -> impl Strategy<Value = (When, Interruption)> {
    let kinds = [Interruption::Hold, Interruption::Stop, Interruption::Fault];
    let when = prop_oneof![
        2 => (20..5000usize).prop_map(When::Later),
        1 => (0..60usize).prop_map(When::Homed),
    ];
    (when, select(kinds.to_vec()))
}

/// A line from one place to another, and what is done before it.
#[derive(Debug)]
struct Cut {
    from: [f64; 3],
    to: [f64; 3],
    homings: usize,
    outputs: u32,
}

impl Cut {
    fn length(&self) -> f64 {
        let squares = self
            .from
            .iter()
            .zip(self.to)
            .map(|(from, to)| (to - from).powi(2));
        squares.sum::<f64>().sqrt()
    }

    /// How far along it a place is, if it is on it and is left that way: two cuts with a sharp angle between them lie
    /// together near it.
    fn along(&self, at: [f64; 3], velocity: [f64; 3]) -> Option<f64> {
        let length = self.length();
        let way = [0, 1, 2].map(|axis: usize| (self.to[axis] - self.from[axis]) / length);
        let goes: f64 = way.iter().zip(velocity).map(|(way, goes)| way * goes).sum();
        let rel = [0, 1, 2].map(|axis: usize| at[axis] - self.from[axis]);
        let along: f64 = way.iter().zip(rel).map(|(way, rel)| way * rel).sum();
        let beside: f64 = (way.iter().zip(rel))
            .map(|(way, rel)| (rel - way * along).powi(2))
            .sum();
        let is_on = beside.sqrt() < 0.01 && (-0.01..=length + 0.01).contains(&along);
        (is_on && goes > 0.0).then_some(along)
    }

    /// Whether the tool goes down there to where it begins, at its feed, as what is below may not have been cut.
    fn is_gone_down_to(&self, at: [f64; 3], velocity: [f64; 3]) -> bool {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| at[axis] - self.from[axis]);
        x.hypot(y) < 0.01 && z > -0.01 && velocity[0].hypot(velocity[1]) == 0.0 && velocity[2] < 0.0
    }
}

/// A program, what it cuts, how many homings and outputs it has, and where it ends.
#[derive(Debug)]
struct Part {
    text: String,
    cuts: Vec<Cut>,
    homings: Vec<u32>,
    outputs: u32,
    ends: [f64; 3],
}

fn part(blocks: &[Block]) -> Part {
    let mut text = "G28.2\nG90 G61.1 F12000\n".to_owned();
    let (mut at, mut cuts, mut homings, mut outputs) = ([0.0; 3], Vec::new(), vec![1], 0);
    for block in blocks {
        let line = text.lines().count() as u32 + 1;
        match *block {
            Block::Home(axes) => {
                text += "G28.2";
                for (axis, name) in axes.iter().zip([" X0", " Y0", " Z0"]) {
                    text += if *axis { name } else { "" };
                }
                let all = axes == [false; 3];
                for (at, axis) in at.iter_mut().zip(axes) {
                    *at = if axis || all { 0.0 } else { *at };
                }
                homings.push(line);
            }
            Block::Cut(to) => {
                let to = to.map(|it| (it * 1e3).round() / 1e3);
                text += &format!("G1 X{:.3} Y{:.3} Z{:.3}", to[0], to[1], to[2]);
                cuts.push(Cut {
                    from: at,
                    to,
                    homings: homings.len(),
                    outputs,
                });
                at = to;
            }
            Block::Output => {
                text += &format!("M64 P{outputs}");
                outputs += 1;
            }
            Block::Dwell => text += "G4 P0.05",
        }
        text += "\n";
    }
    Part {
        text: text + "M2\n",
        cuts,
        homings,
        outputs,
        ends: at,
    }
}

/// Looks at all that the machine does.
struct Watch<'p> {
    part: &'p Part,
    rows: usize,
    events: usize,
    homed: Vec<u32>,
    /// Which cut is at work, and how far it is cut.
    cut: usize,
    far: f64,
}

impl Watch<'_> {
    fn look(&mut self, rig: &Rig) {
        for event in &rig.events[self.events..] {
            if let Event::ProgramHomed { line } = event {
                self.homed.push(*line);
            }
        }
        self.events = rig.events.len();
        for row in &rig.rows[self.rows..] {
            let feeds = row.plan.feed.is_finite() && row.plan.feed > 0.0;
            if feeds && row.plan.speed > REST && !row.plan.off_path {
                self.cuts(row, state(rig) == State::Stopping);
            }
        }
        self.rows = rig.rows.len();
    }

    /// The tool cuts there, or comes to rest where it is stopped, with its outputs off.
    fn cuts(&mut self, row: &Row<COORDINATES>, is_stopping: bool) {
        let [at, velocity] = [row.plan.position, row.plan.velocity].map(|it| [it[0], it[1], it[2]]);
        let Part { cuts, text, .. } = self.part;
        let whole = self.far > cuts[self.cut].length() - GAP;
        let here = cuts[self.cut].along(at, velocity);
        // Two cuts may begin at the same place and lie together there.
        let is_over = whole && here.is_none_or(|along| along < self.far - GAP);
        let next = cuts.get(self.cut + 1).filter(|_| is_over);
        let next = next.and_then(|next| Some((self.cut + 1, next.along(at, velocity)?)));
        let found = next.or(here.map(|along| (self.cut, along)));
        // A cut that ends where it is resumed begins anew, and no other.
        let again = || {
            (self.cut.saturating_sub(1)..self.cut)
                .rev()
                .find_map(|cut| Some((cut, cuts[cut].along(at, velocity)?)))
        };
        let mut begun = cuts.iter().take(self.cut + 2);
        let Some((cut, along)) = found.or_else(again) else {
            if begun.any(|cut| cut.is_gone_down_to(at, velocity)) {
                return;
            }
            panic!(
                "{at:?} is no part of what is to be cut now, {}: {text}",
                self.cut
            );
        };
        if cut > self.cut {
            (self.cut, self.far) = (cut, 0.0);
        }
        if cut == self.cut {
            assert!(
                along < self.far + GAP,
                "{} to {along} of cut {cut} is left out: {text}",
                self.far
            );
            self.far = self.far.max(along);
        }
        let length = cuts[cut].length();
        if !is_stopping && (JOINT..length - JOINT).contains(&along) {
            let outputs = (1u64 << cuts[cut].outputs) - 1;
            assert_eq!(
                row.functions.outputs.digital, outputs,
                "outputs in cut {cut}: {text}"
            );
            assert_eq!(
                self.homed.len(),
                cuts[cut].homings,
                "homed before cut {cut}: {text}"
            );
        }
    }

    /// Goes on by so many wake-ups, or until the machine rests.
    fn go_on(&mut self, rig: &mut Rig, most: usize) {
        let mut since = 0;
        for _ in 0..most {
            rig.step();
            self.look(rig);
            let rests = matches!(state(rig), State::Ready | State::Held | State::Faulted);
            since = if rests { since + 1 } else { 0 };
            if since > 6 {
                return;
            }
        }
    }

    /// Goes on until then, or until the machine rests.
    fn wait(&mut self, rig: &mut Rig, when: When) {
        match when {
            When::Later(most) => self.go_on(rig, most),
            When::Homed(most) => {
                let homed = self.homed.len();
                let works = |rig: &Rig| matches!(state(rig), State::Homing | State::Running);
                while works(rig) && self.homed.len() == homed {
                    self.go_on(rig, 1);
                }
                self.go_on(rig, most);
            }
        }
    }

    fn command(&mut self, rig: &mut Rig, command: Command) {
        rig.command(command);
        self.go_on(rig, 8);
    }

    /// Interrupts what goes on, and brings the machine to where it can be resumed.
    fn interrupt(&mut self, rig: &mut Rig, by: Interruption) {
        match by {
            Interruption::Hold => self.command(rig, Command::FeedHold),
            Interruption::Stop => self.command(rig, Command::Stop),
            Interruption::Fault => {
                let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
                rig.twin(Y).disturb(fault);
            }
        }
        // A homing waits for nobody's feed hold.
        let waits = !matches!(by, Interruption::Hold) || state(rig) != State::Homing;
        self.go_on(rig, if waits { usize::MAX } else { 1 });
        if state(rig) == State::Faulted {
            self.command(rig, Command::Reset);
            self.go_on(rig, usize::MAX);
        }
    }

    /// Resumes what was interrupted or held; whether there was anything.
    fn resume(&mut self, rig: &mut Rig) -> bool {
        match state(rig) {
            State::Ready if rig.session.status().interrupted.is_none() => return false,
            State::Ready | State::Held => self.command(rig, Command::Resume),
            _ => return true,
        }
        true
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5, max_shrink_iters: 30, ..ProptestConfig::default() })]

    /// Whenever it is interrupted, and by what: each homing once and in its order, each cut from its beginning to its end
    /// with what is switched before it, nothing else, and an end.
    #[test]
    fn what_is_interrupted_and_resumed_is_the_program(
        blocks in prop::collection::vec(block(), 1..7),
        interruptions in prop::collection::vec(interruption(), 1..5),
    ) {
        let part = part(&blocks);
        let mut rig = switched_on(&[]);
        rig.goes_on = false;
        let mut watch = Watch { part: &part, rows: rig.rows.len(), events: rig.events.len(), homed: Vec::new(), cut: 0, far: 0.0 };
        let file = rig.folder.file("part.ngc", &part.text);
        rig.command(Command::Load(file));
        settle(&mut rig);
        watch.command(&mut rig, Command::Run { from_line: None });
        for (when, by) in interruptions {
            watch.wait(&mut rig, when);
            while state(&rig) == State::Held {
                watch.command(&mut rig, Command::CycleStart);
            }
            if state(&rig) == State::Ready && rig.session.status().interrupted.is_none() {
                break;
            }
            watch.interrupt(&mut rig, by);
            watch.resume(&mut rig);
        }
        let mut patience = 60;
        loop {
            watch.go_on(&mut rig, usize::MAX);
            let rests = state(&rig);
            prop_assert!(patience > 0, "{:?}: {:?}", rests, part);
            patience -= 1;
            match rests {
                State::Held => watch.command(&mut rig, Command::CycleStart),
                _ if !watch.resume(&mut rig) => break,
                _ => {}
            }
        }
        prop_assert_eq!(rig.problems.len(), 0, "{:?}", rig.problems);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        prop_assert_eq!(&watch.homed, &part.homings, "{}", part.text);
        if let Some(last) = part.cuts.last() {
            prop_assert_eq!(watch.cut + 1, part.cuts.len(), "{}", part.text);
            prop_assert!(watch.far > last.length() - GAP, "{} of {}: {}", watch.far, last.length(), part.text);
        }
        let [x, y, z, ..] = rig.session.status().setpoint;
        let off = [x, y, z].iter().zip(part.ends).map(|(is, ends)| (is - ends).abs()).fold(0.0, f64::max);
        prop_assert!(off < 1e-6, "{:?} for {:?}: {}", [x, y, z], part.ends, part.text);
        // Whatever was switched, and switched again on the way back: the outputs come in their order.
        let mut last = 0;
        for row in &rig.rows {
            let on = row.functions.outputs.digital;
            let count = on.trailing_ones();
            prop_assert_eq!(on, (1u64 << count) - 1, "out of order: {}", part.text);
            last = last.max(count);
        }
        prop_assert_eq!(last, part.outputs, "{}", part.text);
    }
}

/// A homing that is cut off, wherever it may be, is what is resumed, and behind one that is over nothing before it is.
#[test]
fn no_block_before_a_homing_is_resumed_once_that_has_begun() {
    let text = "G28.2\nG90 G61.1 F12000\nG1 X20 Y10 Z-5\nG1 X40 Y30 Z-8\nG1 X10 Y20 Z-3\nG28.2\nG1 X30 Y5 Z-6\nM2\n";
    let homed = |rig: &Rig, times: usize| {
        let homings = rig.events.iter();
        let homings = homings.filter(|event| matches!(event, Event::ProgramHomed { .. }));
        homings.count() == times
    };
    let run = || {
        let mut rig = switched_on(&[]);
        let file = rig.folder.file("part.ngc", text);
        rig.command(Command::Load(file));
        settle(&mut rig);
        rig.command(Command::Run { from_line: None });
        rig.run_until(|rig| homed(rig, 1) && state(rig) != State::Homing);
        rig
    };
    for after in (0..).step_by(1700) {
        let mut rig = run();
        rig.run_until(|rig| state(rig) == State::Homing);
        (0..after).for_each(|_| _ = rig.step());
        if state(&rig) != State::Homing {
            break;
        }
        let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
        rig.twin(Y).disturb(fault);
        rig.run_until(|rig| state(rig) == State::Faulted);
        assert_eq!(rig.session.status().interrupted, Some(6), "{after}");
    }
    for after in [0, 1, 2, 5, 11] {
        let mut rig = run();
        rig.run_until(|rig| homed(rig, 2));
        (0..after).for_each(|_| _ = rig.step());
        rig.command(Command::Stop);
        rig.run_until(|rig| state(rig) == State::Ready);
        let interrupted = rig.session.status().interrupted;
        assert!(
            matches!(interrupted, Some(6 | 7)),
            "{after}: {interrupted:?}"
        );
    }
}
