//! Outputs are switched in the program's order and at their place, and have their safe values after every stop and
//! where nothing is at work: from what R_PDOs carry and what the program says.
//!
//! Which states of a program the outputs may be in is kept as a set, as several may look alike. From one of them it
//! goes on to a later one that looks as the outputs do, over such alone as are too short to be seen.

use super::super::interference::Interference;
use super::super::machine::FASTEST;
use super::scene::NOISE;
use super::script::{Reading, Script, Switched};
use super::{Checker, Found, Scene};
use crate::control::{self, Outcome, State};
use crate::machine::{AnalogSource, Machine, OutputSwitch, SpindleDrive};
use crate::observe::mapping::{Heard, PdoMappings};
use crate::session::{Accepted, Command, Event};
use std::collections::VecDeque;
use std::mem::take;
use syncline_canopen::{Address, Instant};
use syncline_drives::bus::Transmission;
use syncline_drives::model::Device;

const NAME: &str = "outputs";

/// A state that lasts for less may not be seen, cycles.
const SHORT: f64 = 3.0;
/// How much earlier than by the program's dwells and distances a state may end, cycles.
const EARLY: f64 = 2.0;
/// How many cycles' distances the setpoints may be off the place of a code.
const OFF: f64 = 2.0;
/// Variances of a shaper's delays, parts of the squared period of a mode: those without damping, which makes them smaller.
const VARIANCES: [(&str, f64); 4] = [
    ("zv", 1.0 / 16.0),
    ("zvd", 1.0 / 8.0),
    ("ei", 0.132),
    ("two_hump_ei", 0.223),
];
/// R_PDOs until outputs are safe: that of the cycle that finds the cause, and the next one.
const UNTIL_SAFE: u32 = 1;
/// The same where bursts were lost or late.
const UNTIL_SAFE_LATE: u32 = 4;
/// What is switched by hand shows, and no longer does, within so many cycles.
const BY_HAND: f64 = 4.0;

/// See the module.
pub(super) struct Outputs {
    outputs: Vec<Output>,
    ears: Vec<Ears>,
    /// Outputs that are judged together.
    groups: Vec<Vec<usize>>,
    /// The program that is loaded.
    loaded: Option<usize>,
    /// What is left switched where no job is; `None`: not known.
    left: Option<Switched>,
    /// Work offsets were set, or tool lengths.
    shifted: bool,
    job: Option<Job>,
    /// A program is left for typed lines where it was held.
    aside: bool,
    /// Outputs are to be safe.
    to_be_safe: bool,
    /// By axis: where its setpoints were at the last SYNCs, mm.
    setpoints: Vec<VecDeque<f64>>,
    /// By axis: how far a shaper has its setpoints off where they were the mean of its delay ago, mm.
    shaped: Vec<f64>,
}

/// An output of the machine.
struct Output {
    name: String,
    what: What,
    safe: i32,
    /// As the last R_PDO had it, and as it was at the last SYNC.
    came: Option<i32>,
    latched: Option<i32>,
    /// R_PDOs since it is to be safe.
    unsafe_for: u32,
    /// It was switched by hand.
    by_hand: Option<bool>,
    /// When.
    by_hand_since: Instant,
    /// What it is by hand may show until then.
    is_by_hand: Option<Instant>,
}

/// What an output puts out.
enum What {
    Digital {
        active_low: bool,
        switch: OutputSwitch,
        /// Of a drive: the object that it has its outputs in, a bit each.
        object: Option<Address>,
    },
    Analog {
        full_scale: f64,
        source: AnalogSource,
    },
    /// The speed that a spindle's drive is sent, with so many units for 1/min.
    Speed { units: f64 },
}

/// The nodes of a bus that have outputs.
struct Ears {
    mappings: PdoMappings,
    /// By place there: which outputs, each with the number that its device has for it.
    outputs: Vec<Vec<(usize, usize)>>,
}

/// A job at work.
struct Job {
    is_program: bool,
    script: Script,
    /// By group: the states that it may be in, each with when it came there.
    at: Vec<Vec<(usize, Instant)>>,
    /// By group: the outputs have shown what the job makes of them. What they showed before may still show for a while.
    begun: Vec<bool>,
    /// By output: what it showed as the job began.
    before: Vec<Option<i32>>,
}

impl What {
    /// What it puts out where so much is switched; `None`: whatever holds a spindle at an angle.
    fn value(&self, switched: &Switched) -> Option<i32> {
        let value = match self {
            Self::Speed { .. } if switched.is_oriented => return None,
            Self::Digital {
                active_low, switch, ..
            } => {
                let on = match *switch {
                    OutputSwitch::Program(number) => switched.digital >> number & 1 != 0,
                    OutputSwitch::Spindle => switched.turns.is_some(),
                    OutputSwitch::SpindleReverse => switched.turns == Some(true),
                    OutputSwitch::Mist => switched.coolant[0],
                    OutputSwitch::Flood => switched.coolant[1],
                    OutputSwitch::EnableChain => false,
                };
                (on != *active_low).into()
            }
            Self::Analog { full_scale, source } => {
                let value = match *source {
                    AnalogSource::Program(number) => switched.analog[usize::from(number)],
                    AnalogSource::SpindleSpeed if switched.turns.is_none() => 0.0,
                    AnalogSource::SpindleSpeed => switched.speed,
                };
                scaled(value, *full_scale)
            }
            Self::Speed { units } => {
                let speed = switched.speed * units;
                match switched.turns {
                    None => 0,
                    Some(false) => speed.round() as i32,
                    Some(true) => (-speed).round() as i32,
                }
            }
        };
        Some(value)
    }

    /// Whether it may put that out where so much is switched.
    fn allows(&self, switched: &Switched, value: i32) -> bool {
        match (self, self.value(switched)) {
            (_, Some(right)) => value == right,
            (Self::Speed { units }, None) => {
                f64::from(value).abs() <= f64::from(FASTEST) * units.abs()
            }
            (Self::Digital { .. } | Self::Analog { .. }, None) => false,
        }
    }

    /// What an object of an R_PDO says of the output with this number, if it has it.
    fn read(&self, object: u32, value: u32, number: usize) -> Option<i32> {
        let [bits, sub, low, high] = object.to_le_bytes();
        match (u16::from_le_bytes([low, high]), self) {
            // CiA 401, by bytes and by words.
            (0x6200 | 0x6300, Self::Digital { .. }) => {
                let first = usize::from(bits) * usize::from(sub.checked_sub(1)?);
                let place = number.checked_sub(first)?;
                (place < bits.into()).then_some((value >> place & 1) as i32)
            }
            (0x6411, Self::Analog { .. }) if usize::from(sub) == number + 1 => {
                Some((value as i16).into())
            }
            (index, Self::Digital { object, .. }) if *object == Some(Address::new(index, sub)) => {
                Some((value >> number & 1) as i32)
            }
            // CiA 402's target velocity, and that of its velocity mode.
            (0x60FF, Self::Speed { .. }) => Some(value as i32),
            (0x6042, Self::Speed { .. }) => Some((value as i16).into()),
            _ => None,
        }
    }
}

/// 16 bits of an analog output.
fn scaled(value: f64, full_scale: f64) -> i32 {
    i32::from((value / full_scale * f64::from(i16::MAX)).round() as i16)
}

impl Outputs {
    pub(super) fn new(scene: &Scene<'_>) -> Self {
        let machine = scene.machine;
        let (outputs, wired) = wired(machine);
        let ears = (0..machine.buses.len()).map(|bus| {
            let nodes = machine.nodes().enumerate();
            let own = |device: &usize| wired.iter().any(|(of, _)| of == device);
            let nodes = nodes.filter(|(device, node)| node.bus == bus && own(device));
            let nodes: Vec<_> = nodes.collect();
            let outputs_of = |device: usize| {
                let wired = wired.iter().enumerate();
                let wired = wired.filter(move |(_, (of, _))| *of == device);
                wired
                    .map(|(output, (_, number))| (output, *number))
                    .collect()
            };
            let ids = nodes
                .iter()
                .map(|(_, node)| (node.id.get().into(), node.model.dictionary));
            Ears {
                mappings: PdoMappings::new(ids),
                outputs: (nodes.iter().map(|(device, _)| outputs_of(*device))).collect(),
            }
        });
        // Where something goes wrong with buses, devices may have another cycle's outputs than others.
        let mut devices: Vec<usize> = wired.iter().map(|(device, _)| *device).collect();
        devices.dedup();
        let groups = match scene.is_untroubled && !outputs.is_empty() {
            true => vec![(0..outputs.len()).collect()],
            false => {
                let group = |device: usize| {
                    let own = wired.iter().enumerate();
                    let own = own.filter(move |(_, (of, _))| *of == device);
                    own.map(|(output, _)| output).collect()
                };
                devices.iter().map(|device| group(*device)).collect()
            }
        };
        Self {
            ears: ears.collect(),
            outputs,
            groups,
            loaded: None,
            left: Some(Switched::default()),
            shifted: false,
            job: None,
            aside: false,
            to_be_safe: true,
            setpoints: vec![VecDeque::new(); machine.axes.len()],
            shaped: shaped(scene),
        }
    }

    /// Whether a program is held, or was left where it was held: what lines begin with there is not known.
    fn is_held(&self) -> bool {
        self.aside || self.job.is_some()
    }

    /// A job begins.
    fn begin(&mut self, scene: &Scene<'_>, lines: Option<&[String]>, is_program: bool) {
        self.aside = self.is_held() && !is_program;
        let was_safe = take(&mut self.to_be_safe);
        if let Some(left) = &mut self.left {
            match is_program {
                true => left.let_go(),
                false if was_safe => keep_safe(scene.machine, left),
                false => {}
            }
            for output in &mut self.outputs {
                let Some(on) = output.by_hand.take() else {
                    continue;
                };
                match output.what {
                    What::Digital { switch, .. } => match switch {
                        OutputSwitch::Program(number) => left.put(number, on),
                        OutputSwitch::Mist => left.coolant[0] = on,
                        OutputSwitch::Flood => left.coolant[1] = on,
                        OutputSwitch::Spindle
                        | OutputSwitch::SpindleReverse
                        | OutputSwitch::EnableChain => {}
                    },
                    What::Analog { .. } | What::Speed { .. } => {}
                }
            }
        }
        let script = lines.zip(self.left).map(|(lines, left)| {
            let reading = Reading {
                axes: &scene.case.machine.axes,
                tolerances: scene.case.machine.tolerances,
                is_program,
                is_placed: is_program && !self.shifted && !scene.is_misled,
            };
            Script::read(lines, &reading, left)
        });
        self.job = Some(Job {
            is_program,
            script: script.unwrap_or_else(Script::unknown),
            at: vec![vec![(0, scene.now)]; self.groups.len()],
            begun: vec![false; self.groups.len()],
            before: self.outputs.iter().map(|it| it.latched).collect(),
        });
    }

    fn accepted(&mut self, scene: &Scene<'_>, it: &Accepted) {
        let program = |loaded: Option<usize>| {
            let programs = &scene.case.programs;
            loaded
                .and_then(|number| programs.get(number))
                .map(Vec::as_slice)
        };
        match &it.command {
            Command::Load(file) => {
                let stem = file.file_stem().and_then(|stem| stem.to_str());
                self.loaded = stem.and_then(|stem| stem.parse().ok());
            }
            Command::Run { from_line: None } => self.begin(scene, program(self.loaded), true),
            Command::Run { .. } => self.begin(scene, None, true),
            // What was interrupted goes on from anywhere.
            Command::Resume if self.job.is_none() => self.begin(scene, None, true),
            Command::CycleStart | Command::ToggleFeedHold if self.job.is_none() && self.aside => {
                self.begin(scene, None, true);
            }
            Command::CycleStart if self.job.is_none() => {
                self.begin(scene, program(self.loaded), true);
            }
            Command::Mdi(_) if self.is_held() => self.begin(scene, None, false),
            Command::Mdi(text) => {
                let lines: Vec<String> = text.lines().map(str::to_owned).collect();
                self.begin(scene, Some(&lines), false);
            }
            Command::SetWorkOffset(_) | Command::SetToolLength(_) => {
                self.shifted = true;
                let lines: Option<&[String]> = (!self.is_held()).then_some(&[]);
                self.begin(scene, lines, false);
            }
            // Nothing is at work: what typed lines have left on goes off.
            Command::Stop if scene.state == State::Ready => self.stop(),
            Command::Output { name, on } => {
                let mut outputs = self.outputs.iter_mut();
                if let Some(output) = outputs.find(|output| output.name == *name) {
                    output.by_hand = Some(*on);
                    output.by_hand_since = scene.now;
                    output.is_by_hand = Some(scene.now);
                }
            }
            _ => {}
        }
    }

    /// Nothing is at work any longer.
    fn stop(&mut self) {
        if !self.to_be_safe {
            self.to_be_safe = true;
            self.outputs.iter_mut().for_each(|it| it.unsafe_for = 0);
        }
        for output in &mut self.outputs {
            output.by_hand = None;
        }
        self.left = Some(Switched::default());
        self.job = None;
        self.aside = false;
    }

    /// A job is over.
    fn over(&mut self, scene: &Scene<'_>, outcome: Outcome, found: &mut Found) {
        let Some(job) = self.job.take() else {
            return;
        };
        let cycle = scene.period();
        let last = job.script.steps.len().saturating_sub(1);
        let is_through = |&(at, _): &(usize, Instant)| {
            let behind = &job.script.steps[at..];
            at == last || behind[1..].iter().all(|step| step.lasts < SHORT * cycle)
        };
        let is_judged =
            outcome == Outcome::Finished && scene.bursts_are_on_time() && !job.script.is_open;
        for (group, at) in job.at.iter().enumerate() {
            let looks = |from: usize| {
                let behind = &job.script.steps[from..];
                let first = &job.script.steps[from].state;
                behind.iter().all(|step| {
                    let same = |output: &usize| {
                        let what = &self.outputs[*output].what;
                        what.value(&step.state) == what.value(first)
                    };
                    self.groups[group].iter().all(same)
                })
            };
            if is_judged && !at.iter().any(|it| is_through(it) || looks(it.0)) {
                found.violate(NAME, scene, "an output that was never switched", || {
                    format!("the program ended; its outputs came to state {at:?} of {last}")
                });
            }
        }
        let is_known = outcome == Outcome::Finished && !job.script.is_open;
        let last = job.script.steps.last().filter(|_| is_known);
        self.left = last.map(|step| step.state);
    }

    /// Where setpoints are at the last SYNC, and how far they went at most in a cycle lately, by axis: of a gantry in the middle of its sides, which
    /// may be sent askew as they were found.
    fn setpoints(&mut self, scene: &Scene<'_>) {
        for (index, setpoints) in self.setpoints.iter_mut().enumerate() {
            let latched = |drive: usize| Some(scene.mm(drive, scene.drives[drive].latched?));
            if let Some(middle) = scene.middle(index, latched) {
                setpoints.push_back(scene.axis(index, middle));
            }
            if setpoints.len() > 4 {
                setpoints.pop_front();
            }
        }
    }

    /// Whether setpoints are where a step begins, as far as the places of the axes are known.
    fn is_at(&self, scene: &Scene<'_>, place: &[Option<f64>], tolerance: f64) -> bool {
        let axes = scene.machine.axes.iter().zip(place).zip(&self.setpoints);
        let axes = axes.enumerate();
        let mut axes = axes.filter_map(|(index, ((axis, place), setpoints))| {
            Some((index, axis, (*place)?, setpoints))
        });
        axes.all(|(index, axis, place, setpoints)| {
            let steps = setpoints.iter().zip(setpoints.iter().skip(1));
            let most = steps
                .map(|(from, to)| (to - from).abs())
                .fold(0.0, f64::max);
            let resolution = scene.machine.drives[axis.drives[0]].scaling.resolution();
            let off = scene.uncertainty[index] + scene.unknown(index) + self.shaped[index];
            let allowed = tolerance + off + OFF * most + NOISE * resolution;
            setpoints
                .back()
                .is_none_or(|at| (at - place).abs() <= allowed)
        })
    }

    /// Goes on in the program as the outputs of a group do.
    fn go_on(&self, scene: &Scene<'_>, job: &Job, group: usize) -> Option<Vec<(usize, Instant)>> {
        let looks = |state: &Switched| {
            self.groups[group].iter().all(|output| {
                let output = &self.outputs[*output];
                let is_right = |it| output.what.allows(state, it);
                output.is_by_hand.is_some() || output.latched.is_none_or(is_right)
            })
        };
        let (cycle, calm) = (scene.period(), scene.bursts_are_on_time());
        let steps = &job.script.steps;
        let mut reached: Vec<(usize, Instant)> = Vec::new();
        for &(from, since) in &job.at[group] {
            let stays = looks(&steps[from].state);
            let over = scene.since(since) + EARLY * cycle >= steps[from].lasts;
            for (to, step) in steps.iter().enumerate().skip(from) {
                let passes = steps[from + 1..].iter().take(to.saturating_sub(from + 1));
                let mut passes = passes.map(|step| step.lasts < SHORT * cycle);
                if calm && to > from && !(over && passes.all(|short| short)) {
                    break;
                }
                let shows = to > from && !stays;
                let at = !(calm && shows) || self.is_at(scene, &step.place, step.tolerance);
                if looks(&step.state) && at {
                    // On one of the paths there it has been for the longest.
                    let since = if to == from { since } else { scene.now };
                    match reached.iter_mut().find(|(it, _)| *it == to) {
                        Some((_, known)) => *known = since.min(*known),
                        None => reached.push((to, since)),
                    }
                }
            }
        }
        (!reached.is_empty()).then_some(reached)
    }

    /// Whether a group may have come behind the last state that is known.
    fn may_be_behind(&self, scene: &Scene<'_>, job: &Job, group: usize) -> bool {
        let (cycle, calm) = (scene.period(), scene.bursts_are_on_time());
        let steps = &job.script.steps;
        let mut at = job.at[group].iter();
        job.script.is_open
            && at.any(|&(from, since)| {
                let Some([step, behind @ ..]) = steps.get(from..) else {
                    return true;
                };
                let over = scene.since(since) + EARLY * cycle >= step.lasts;
                !calm || over && behind.iter().all(|step| step.lasts < SHORT * cycle)
            })
    }

    /// Outputs of a job at work.
    fn at_work(&mut self, scene: &Scene<'_>, found: &mut Found) {
        let Some(mut job) = self.job.take() else {
            return;
        };
        let last = job.script.steps.len().checked_sub(1);
        for group in 0..self.groups.len() {
            let through = last.is_none_or(|last| job.at[group].iter().any(|(at, _)| *at == last));
            if job.script.is_open && through {
                continue;
            }
            // Outputs are a job's with its first instruction, which a planner that is starved does not give.
            let soon = scene.since(job.at[group][0].1) < SHORT * scene.period();
            let is_before = !job.begun[group] && (soon || is_starved(scene));
            let same = |output: &usize| self.outputs[*output].latched == job.before[*output];
            // It may look like a state that the program comes to later.
            if is_before && self.groups[group].iter().all(same) {
                continue;
            }
            match self.go_on(scene, &job, group) {
                Some(reached) => {
                    job.begun[group] = true;
                    job.at[group] = reached;
                }
                None if is_before => {}
                None if self.may_be_behind(scene, &job, group) => {
                    job.at[group] = vec![(job.script.steps.len() - 1, scene.now)];
                }
                None => {
                    let what = "an output out of the program's order, place or time";
                    found.violate(NAME, scene, what, || self.describe(&job, group));
                    job.script = Script::unknown();
                    // No group has a place in it any more.
                    break;
                }
            }
        }
        self.job = Some(job);
    }

    fn describe(&self, job: &Job, group: usize) -> String {
        let own = self.groups[group].iter().map(|it| &self.outputs[*it]);
        let own: Vec<_> = own.map(|it| (&it.name, it.latched)).collect();
        let at = &job.at[group];
        let steps = at.first().map(|(first, _)| {
            let steps = &job.script.steps[*first..];
            &steps[..steps.len().min(3)]
        });
        let setpoints: Vec<_> = self.setpoints.iter().map(VecDeque::back).collect();
        format!("{own:?}; setpoints {setpoints:?}; states {at:?} from {steps:?}")
    }

    /// An R_PDO came with an output that is to be safe.
    fn is_safe(&mut self, scene: &Scene<'_>, output: usize, found: &mut Found) {
        let late = !scene.bursts_are_on_time();
        let it = &mut self.outputs[output];
        if !self.to_be_safe || it.is_by_hand.is_some() {
            return;
        }
        it.unsafe_for += 1;
        let until = if late { UNTIL_SAFE_LATE } else { UNTIL_SAFE };
        if it.unsafe_for > until && it.came != Some(it.safe) {
            found.violate(NAME, scene, "an output that is not safe", || {
                let (name, came, since) = (&it.name, it.came, it.unsafe_for);
                let state = scene.state;
                format!(
                    "{name}: {came:?}, {since} R_PDOs after what makes it safe, machine {state}"
                )
            });
        }
    }

    /// What an operator has switched is so, until something else switches it.
    fn by_hand(&self, scene: &Scene<'_>, found: &mut Found) {
        for output in &self.outputs {
            let (Some(on), What::Digital { active_low, .. }) = (output.by_hand, &output.what)
            else {
                continue;
            };
            let shows = scene.since(output.by_hand_since) > BY_HAND * scene.period();
            let right = i32::from(on != *active_low);
            let other = output.latched.filter(|it| *it != right);
            if let Some(other) = other.filter(|_| shows && scene.bursts_are_on_time()) {
                let what = "an output is not as it was switched by hand";
                found.violate(NAME, scene, what, || {
                    let (name, state) = (&output.name, scene.state);
                    format!("{name}: {other} where it was switched {on}, machine {state}")
                });
            }
        }
    }

    /// Whether outputs may be switched by hand in this state.
    fn state(&mut self, scene: &Scene<'_>, state: State) {
        match state {
            State::Stopping | State::Faulted | State::Disabled | State::Starting | State::Off => {
                self.stop();
            }
            _ => {}
        }
        // A job takes over what was switched by hand before it, also where axes are homed between.
        let begins = self.job.is_none() && matches!(state, State::Running | State::Mdi);
        let stays = matches!(
            state,
            State::Ready | State::Jogging | State::Held | State::Homing
        );
        if !begins && !stays {
            for output in &mut self.outputs {
                output.by_hand = None;
            }
        }
        for output in &mut self.outputs {
            if output.by_hand.is_some() {
                output.is_by_hand = Some(scene.now);
            }
        }
    }
}

/// Whether no instructions may come, or none have come until shortly before.
fn is_starved(scene: &Scene<'_>) -> bool {
    scene.interferences.iter().any(|(at, what)| match what {
        Interference::StarvePlanner(wake_ups) => {
            scene.since(*at) < (f64::from(*wake_ups) + SHORT) * scene.period()
        }
        _ => false,
    })
}

/// Typed lines leave outputs as they are safe until they switch them.
fn keep_safe(machine: &Machine, left: &mut Switched) {
    for output in &machine.outputs {
        if let OutputSwitch::Program(number) = output.switch {
            left.keep(number, output.safe);
        }
    }
    for output in &machine.analog_outputs {
        if let AnalogSource::Program(number) = output.source {
            left.keep_analog(number, output.safe);
        }
    }
}

/// The object that a drive has its digital outputs in, by its model.
fn object_of(device: &Device) -> Option<Address> {
    let mut object = None;
    device.drive()?.io()?.write(&mut |write| {
        object.get_or_insert(write.address);
    });
    object
}

/// Outputs of a machine, and of which device with which number there each is.
fn wired(machine: &Machine) -> (Vec<Output>, Vec<(usize, usize)>) {
    let output = |name: &str, what, safe| Output {
        name: name.to_owned(),
        what,
        safe,
        came: None,
        latched: None,
        unsafe_for: 0,
        by_hand: None,
        by_hand_since: Instant::ZERO,
        is_by_hand: None,
    };
    // No program switches an enable chain.
    let digital = machine.outputs.iter();
    let digital = digital.filter(|it| it.switch != OutputSwitch::EnableChain);
    let digital = digital.map(|it| {
        let what = What::Digital {
            active_low: it.active_low,
            switch: it.switch,
            object: object_of(&machine.device(it.node)),
        };
        let safe = it.safe != it.active_low;
        (output(&it.name, what, safe.into()), (it.node, it.signal))
    });
    let analog = machine.analog_outputs.iter().map(|it| {
        let what = What::Analog {
            full_scale: it.full_scale,
            source: it.source,
        };
        let safe = scaled(it.safe, it.full_scale);
        (output(&it.name, what, safe), (it.node, it.place))
    });
    let speed = machine.spindle_drive().map(|(node, drive)| {
        let units = units_of(machine, drive);
        (output("speed", What::Speed { units }, 0), (node, 0))
    });
    let mut all: Vec<_> = digital.chain(analog).chain(speed).collect();
    all.sort_by_key(|(_, wired)| *wired);
    all.into_iter().unzip()
}

/// By axis: half of its acceleration times the variance of the shaper's delays, mm. By so much at most a mean of positions
/// is off that of the mean delay, by Taylor's theorem.
fn shaped(scene: &Scene<'_>) -> Vec<f64> {
    let shaper = scene.case.machine.shaper.iter();
    let modes = shaper.flat_map(|shaper| {
        let mut kinds = VARIANCES.iter();
        let part = kinds.find(|(kind, _)| *kind == shaper.kind);
        let part = part.map_or(f64::INFINITY, |it| it.1);
        let modes = shaper.modes.iter();
        modes.map(move |(frequency, damping)| {
            part / (frequency * frequency * (1.0 - damping * damping))
        })
    });
    let variance: f64 = modes.sum();
    let axes = scene.machine.axes.iter();
    axes.map(|axis| 0.5 * axis.limits.acceleration * variance)
        .collect()
}

/// What the drive of a spindle counts at 1/min.
fn units_of(machine: &Machine, drive: &SpindleDrive) -> f64 {
    let assumed = machine.assumed(drive.model).0;
    let of = |name: &str| {
        let mut stated = assumed.iter().filter(|(known, _)| *known == name);
        let usual = drive.model.assumption(name);
        let stated = stated.next().map(|it| it.1);
        stated.or(usual.map(|it| it.default)).unwrap_or(0)
    };
    match [of("velocity_units"), of("velocity_rpm")].map(f64::from) {
        [0.0, _] => f64::from(of("encoder_increments")) / 60.0,
        [units, rpm] => units / rpm,
    }
}

impl Checker for Outputs {
    fn sync(&mut self, _: &Scene<'_>, bus: usize, _: &mut Found) {
        for &(output, _) in self.ears[bus].outputs.iter().flatten() {
            self.outputs[output].latched = self.outputs[output].came;
        }
    }

    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, found: &mut Found) {
        if self.outputs.is_empty() {
            return;
        }
        let Ears { mappings, outputs } = &mut self.ears[bus];
        let mut came = Vec::new();
        mappings.hear(&sent.frame, &mut |node, heard| match heard {
            Heard::Reset => {
                for (output, _) in &outputs[node] {
                    self.outputs[*output].came = None;
                }
            }
            Heard::Object { object, value } => {
                for (output, number) in &outputs[node] {
                    let it = &mut self.outputs[*output];
                    if let Some(value) = it.what.read(object, value, *number) {
                        it.came = Some(value);
                        came.push(*output);
                    }
                }
            }
        });
        for output in came {
            self.is_safe(scene, output, found);
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, found: &mut Found) {
        match event {
            Event::Accepted(it) => self.accepted(scene, it),
            Event::State(state) => self.state(scene, *state),
            Event::Machine(control::Event::Fault(_)) => self.stop(),
            Event::Machine(control::Event::JobOver {
                outcome: Outcome::SetAside,
                ..
            }) => {}
            Event::Machine(control::Event::JobOver { outcome, .. }) => {
                let is_program = self.job.as_ref().is_some_and(|job| job.is_program);
                self.over(scene, *outcome, found);
                if is_program || *outcome == Outcome::Stopped {
                    self.stop();
                }
                // One that is wrong in its first lines leaves all as it was; behind a motion it stops as well.
                if is_program && *outcome == Outcome::Broken {
                    (self.to_be_safe, self.left) = (false, None);
                }
            }
            _ => {}
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        if self.outputs.is_empty() {
            return;
        }
        let shows = BY_HAND * scene.period();
        for output in &mut self.outputs {
            if output.by_hand.is_some() {
                output.is_by_hand = Some(scene.now);
            }
            output.is_by_hand = output
                .is_by_hand
                .filter(|since| scene.since(*since) < shows);
        }
        self.by_hand(scene, found);
        self.setpoints(scene);
        self.at_work(scene, found);
    }
}
