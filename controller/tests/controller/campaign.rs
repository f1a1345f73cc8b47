//! The campaign's checkers are silent where nothing is wrong, and each is told what is planted.

use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::Duration;
use syncline_canopen::cia402::{self, Statusword};
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_controller::campaign::stage::{self, Played, Woken};
use syncline_controller::campaign::{
    self, AxisSpec, Case, Checkers, Interference, Seen, ToBus, ToDrive, Trouble, Wanted, When, Wire,
};
use syncline_controller::control::fault::{AxisCause, BusCause, DeviceCause, Fault};
use syncline_controller::control::{self, State};
use syncline_controller::machine::Machine;
use syncline_controller::session::{Accepted, Command, Direction, Event, Jog};
use syncline_drives::bus::{Sender, Transmission};

use super::outside::root;

/// A case without troubles, as it was seen.
struct Recorded {
    case: Case,
    machine: Machine,
    seen: Vec<Seen>,
    played: Played,
}

/// Quiet cases in which a program runs, among them one with a gantry; none that homes first, for which there is less time.
static RECORDED: LazyLock<Vec<Recorded>> = LazyLock::new(|| {
    let quiet = (0..)
        .map(Case::of)
        .filter(|case| case.is_untroubled() && case.patience.is_some() && case.cycles < 1200)
        .filter(|case| case.machine.axes.iter().all(|axis| axis.homing.is_none()));
    let mut recorded: Vec<Recorded> = Vec::new();
    for case in quiet {
        let has_gantry = |case: &Case| case.machine.drives() > case.machine.axes.len();
        let missing = !recorded.iter().any(|it| has_gantry(&it.case));
        if recorded.len() >= 5 && !(missing && has_gantry(&case)) {
            if missing {
                continue;
            }
            break;
        }
        let quiet = record(case);
        if quiet.played.summary.times.motion_s > 1.5 {
            recorded.push(quiet);
        }
    }
    recorded.push(switching());
    recorded.push(untroubled(|case, _| {
        let mut axes = case.machine.axes.iter();
        axes.any(|axis| axis.encoder.is_some())
    }));
    recorded.push(untroubled(|_, machine| streamed(machine).is_some()));
    recorded.push(untroubled(|case, _| wired(case, ENABLE).is_some()));
    recorded.push(untroubled(|case, _| !case.machine.io_nodes.is_empty()));
    recorded.push(untroubled(|_, machine| {
        let watched = machine.encoders.first().map(|encoder| encoder.axis);
        stepper(machine).is_some_and(|drive| watched == Some(Some(machine.drives[drive].axis)))
    }));
    recorded
});

/// Ways to and fro at the end of a program.
const WAYS: usize = 6;

/// A program that switches an output of a drive, on and off, at once and with motions, and leaves it on; its machine has a door.
fn switching() -> Recorded {
    let number = |case: &Case| {
        let drives = case.machine.axes.iter().flat_map(|axis| &axis.drives);
        let mut wires = drives.flat_map(|drive| &drive.wires);
        let number = |meaning: &str| meaning.strip_prefix("number = ")?.parse::<u8>().ok();
        wires.find_map(|wire| number(&wire.meaning).filter(|_| wire.table == "output"))
    };
    let mut cases = (0..).map(Case::of);
    let small = cases.find(|case| case.machine.axes.len() < 3 && number(case).is_some());
    let mut case = small.unwrap();
    let number = number(&case).unwrap();
    let drives = case
        .machine
        .axes
        .iter_mut()
        .flat_map(|axis| &mut axis.drives);
    let is_output = |wire: &Wire| wire.table == "output";
    let mut wired = drives.filter(|drive| drive.wires.iter().any(is_output));
    let drive = wired.next().unwrap();
    drive.wires.retain(is_output);
    drive.wires.push(Wire {
        table: "input".to_owned(),
        place: 4,
        signal: "DI4".to_owned(),
        meaning: format!("{DOOR}\ndebounce_ms = 20"),
    });
    let axis = &case.machine.axes[0];
    let [least, most] = axis.soft_limits;
    let rest = 0.0_f64.clamp(least, most);
    let way = if rest + 3.0 * axis.travel > most {
        -axis.travel
    } else {
        axis.travel
    };
    let line = |turns: f64| format!("G1 {}{}", axis.letter, rest + turns * way);
    let switch = |code: u8| format!("M{code} P{number}");
    let mut program = vec![
        format!("F{}", 30.0 * axis.velocity),
        line(1.0),
        switch(64),
        "G4 P0.1".to_owned(),
        switch(65),
        line(2.0),
        switch(62),
        line(3.0),
        switch(63),
        line(1.0),
        switch(64),
    ];
    // Longer than any stop takes.
    program.extend((0..WAYS).flat_map(|_| [line(3.0), line(1.0)]));
    program.push("M2".to_owned());
    case.programs = vec![program];
    case.deeds.clear();
    case.troubles.clear();
    case.patience = Some(10);
    case.cycles = 12_000_000 / case.machine.cycle_us;
    record(case)
}

/// A quiet case of a kind, in which a program runs.
fn untroubled(is_kind: fn(&Case, &Machine) -> bool) -> Recorded {
    let quiet = (0..).map(Case::of).filter(|case| {
        case.is_untroubled()
            && case.patience.is_some()
            && is_kind(case, &case.machine.machine().unwrap())
    });
    let mut recorded = quiet.map(record);
    let moves = recorded.find(|it| it.played.summary.times.motion_s > 1.5);
    moves.unwrap()
}

/// What machine files say of inputs.
const DOOR: &str = "function = \"door\"";
const ENABLE: &str = "function = \"enable\"";

/// An input that means this, by its device and its number there.
fn wired(case: &Case, meaning: &str) -> Option<(usize, u8)> {
    let machine = &case.machine;
    let drives = machine.axes.iter().flat_map(|axis| &axis.drives);
    let encoders = machine.axes.iter().filter(|axis| axis.encoder.is_some());
    let wires = drives.map(|drive| &drive.wires[..]);
    let wires = wires.chain(encoders.map(|_| &[][..]));
    let mut wires = wires.chain(machine.io_nodes.iter().map(|io| &io.wires[..]));
    let place = |wires: &[Wire]| {
        let mut wires = wires.iter();
        Some(wires.find(|it| it.meaning.starts_with(meaning))?.place)
    };
    let mut device = 0;
    wires.find_map(|wires| {
        device += 1;
        Some((device - 1, place(wires)?))
    })
}

/// Behind what is seen this is, too, once, in the midst of a program.
fn also(planting: &mut Planting, seen: &Seen, more: Option<Seen>) -> Vec<Seen> {
    let more = more.filter(|_| planting.once());
    [seen.clone()].into_iter().chain(more).collect()
}

/// In the midst of a program an input comes on that means this.
fn comes_on(recorded: &Recorded, planting: &mut Planting, seen: &Seen, meaning: &str) -> Vec<Seen> {
    let on = wired(&recorded.case, meaning).map(|(device, place)| {
        let what = ToDrive::Input(place, true);
        Seen::Interfered(Interference::Drive(device, what))
    });
    also(planting, seen, on)
}

/// The first drive that is sent velocities.
fn streamed(machine: &Machine) -> Option<usize> {
    (0..machine.drives.len()).find(|&drive| machine.closes_loop(machine.drives[drive].axis))
}

/// The first drive that is sent targets, and is asked for its position.
fn stepper(machine: &Machine) -> Option<usize> {
    let mut drives = machine.drives.iter();
    drives.position(|drive| drive.model.name == "tsp10")
}

/// The first byte of the controlword in an R_PDO to a drive.
fn told(recorded: &Recorded, drive: Option<usize>, seen: &Seen) -> Option<u8> {
    let (drive, Seen::Frame { bus, sent }) = (drive?, seen) else {
        return None;
    };
    let device = recorded.machine.device(drive);
    let id = CanId::from(device.spec().r_pdos[0].cob_id);
    let own = sent.frame.id() == id && *bus == recorded.machine.drives[drive].bus;
    sent.frame.data().first().filter(|_| own).copied()
}

fn record(case: Case) -> Recorded {
    let machine = case.machine.machine().unwrap();
    let mut seen = Vec::new();
    let mut record = |it| seen.push(it);
    let played = stage::play(&case, &machine, Wanted::default(), &mut record).unwrap();
    Recorded {
        case,
        machine,
        seen,
        played,
    }
}

/// What becomes of something that was seen.
type Change = fn(&Recorded, &mut Planting, &Seen) -> Vec<Seen>;

/// What the checkers say of a recording that was changed: their names.
fn judge(recorded: &Recorded, change: Change) -> Vec<&'static str> {
    let mut checkers = Checkers::new(&recorded.case, &recorded.machine);
    let mut planting = Planting::default();
    for seen in &recorded.seen {
        planting.see(recorded, seen);
        for seen in change(recorded, &mut planting, seen) {
            checkers.see(&seen);
        }
    }
    checkers.end(&recorded.played);
    checkers.found.0.iter().map(|it| it.checker).collect()
}

/// What a defect knows of the recording so far.
#[derive(Default)]
struct Planting {
    now: Instant,
    state: Option<State>,
    /// Wake-ups while a program runs.
    running: u32,
    /// Wake-ups in which the machine is ready.
    ready: u32,
    done: u32,
    setpoint: Option<i32>,
    /// In all of the recording.
    outputs: Vec<u8>,
}

impl Planting {
    fn see(&mut self, _: &Recorded, seen: &Seen) {
        match seen {
            Seen::Woken(woken) => {
                self.now = woken.now;
                self.running += u32::from(woken.state == State::Running);
                self.ready += u32::from(woken.state == State::Ready);
            }
            Seen::Told(Event::State(state)) => self.state = Some(*state),
            _ => {}
        }
    }

    /// Once, in the midst of a program.
    fn once(&mut self) -> bool {
        let now = self.running > 100 && self.state == Some(State::Running);
        let first = now && self.done == 0;
        self.done += u32::from(first);
        first
    }
}

/// The setpoint of an LXM32M's frame to a node, and the frame with another one.
fn setpoint(recorded: &Recorded, seen: &Seen) -> Option<i32> {
    let Seen::Frame { sent, .. } = seen else {
        return None;
    };
    let drives = recorded.machine.drives.iter();
    let mut drives = drives.filter(|drive| drive.model.name == "lxm32m");
    let first = drives.next()?;
    let Seen::Frame { bus, .. } = seen else {
        return None;
    };
    let own = sent.frame.id() == CanId::from(CobId::r_pdo(2, first.node)) && *bus == first.bus;
    let bytes = sent.frame.data().get(2..6).filter(|_| own)?;
    Some(i32::from_le_bytes(bytes.try_into().ok()?))
}

fn with_setpoint(seen: &Seen, setpoint: i32) -> Seen {
    let Seen::Frame { bus, sent } = seen else {
        return seen.clone();
    };
    let mut data = sent.frame.data().to_vec();
    data[2..6].copy_from_slice(&setpoint.to_le_bytes());
    framed(*bus, sent, Frame::new(sent.frame.id(), &data))
}

/// The same frame with another control- or statusword.
fn with_word(seen: &Seen, word: u8) -> Seen {
    let Seen::Frame { bus, sent } = seen else {
        return seen.clone();
    };
    let mut data = sent.frame.data().to_vec();
    data[0] = word;
    framed(*bus, sent, Frame::new(sent.frame.id(), &data))
}

/// Whether it is the T_PDO of the drive whose setpoints [`setpoint`] tells.
fn is_statusword(recorded: &Recorded, seen: &Seen) -> bool {
    let mut drives = recorded.machine.drives.iter();
    let first = drives.find(|drive| drive.model.name == "lxm32m");
    matches!((seen, first), (Seen::Frame { bus, sent }, Some(first))
        if sent.frame.id() == CanId::from(CobId::t_pdo(2, first.node)) && *bus == first.bus)
}

/// A fault in mid-motion, and from then on another controlword.
fn told_while_it_moves(
    recorded: &Recorded,
    planting: &mut Planting,
    seen: &Seen,
    fault: Fault,
    word: u8,
) -> Vec<Seen> {
    let Some(at) = setpoint(recorded, seen) else {
        return vec![seen.clone()];
    };
    let before = planting.setpoint.replace(at);
    if planting.done > 0 {
        return vec![with_word(seen, word)];
    }
    let moves = before.is_some_and(|before| before.abs_diff(at) > 100);
    if moves && planting.once() {
        return vec![seen.clone(), event(control::Event::Fault(fault))];
    }
    vec![seen.clone()]
}

/// Of the drive whose setpoints [`setpoint`] tells, or of another axis's.
fn fault_of(recorded: &Recorded, own: bool, cause: DeviceCause) -> Option<Fault> {
    let drives = &recorded.machine.drives;
    let first = drives.iter().position(|it| it.model.name == "lxm32m")?;
    let other = drives.iter().position(|it| it.axis != drives[first].axis);
    Some(Fault::Device(if own { first } else { other? }, cause))
}

/// The outputs in an LXM32M's frame, of the first drive that has some.
fn outputs(recorded: &Recorded, seen: &Seen) -> Option<u8> {
    let Seen::Frame { bus, sent } = seen else {
        return None;
    };
    let drive = recorded
        .machine
        .drives
        .get(recorded.machine.outputs.first()?.node)?;
    let own = sent.frame.id() == CanId::from(CobId::r_pdo(2, drive.node)) && *bus == drive.bus;
    sent.frame.data().get(6).filter(|_| own).copied()
}

fn with_outputs(seen: &Seen, outputs: u8) -> Seen {
    let Seen::Frame { bus, sent } = seen else {
        return seen.clone();
    };
    let mut data = sent.frame.data().to_vec();
    data[6] = outputs;
    framed(*bus, sent, Frame::new(sent.frame.id(), &data))
}

/// In the midst of a program the machine is said to be disabled, and nothing else of its state; from then on wake-ups are
/// changed.
fn disabled(planting: &mut Planting, seen: &Seen, change: impl Fn(&mut Woken)) -> Vec<Seen> {
    match seen {
        Seen::Told(Event::State(_)) if planting.done > 0 => Vec::new(),
        Seen::Woken(woken) if planting.done > 0 => {
            let mut woken = woken.clone();
            change(&mut woken);
            vec![Seen::Woken(woken)]
        }
        Seen::Woken(_) if planting.once() => {
            vec![seen.clone(), Seen::Told(Event::State(State::Disabled))]
        }
        _ => vec![seen.clone()],
    }
}

/// The outputs as they are so many frames later, or before.
fn shifted(recorded: &Recorded, planting: &mut Planting, seen: &Seen, frames: isize) -> Vec<Seen> {
    if planting.outputs.is_empty() {
        let all = recorded.seen.iter();
        planting.outputs = all.filter_map(|seen| outputs(recorded, seen)).collect();
    }
    if outputs(recorded, seen).is_none() {
        return vec![seen.clone()];
    }
    let place = planting.done as isize + frames;
    planting.done += 1;
    let last = planting.outputs.len() as isize - 1;
    let shifted = planting.outputs[place.clamp(0, last) as usize];
    vec![with_outputs(seen, shifted)]
}

fn framed(bus: usize, sent: &Transmission, frame: Frame) -> Seen {
    Seen::Frame {
        bus,
        sent: Transmission { frame, ..*sent },
    }
}

fn event(event: control::Event) -> Seen {
    Seen::Told(Event::Machine(event))
}

/// Told to be accepted, whoever commanded it.
fn accepted(command: Command) -> Seen {
    Seen::Told(Event::Accepted(Accepted {
        cycle: 0,
        source: "planted".into(),
        command,
    }))
}

/// The coupling of the first encoder slips, by so much of what it and the drives may differ.
fn slip(recorded: &Recorded, part: f64) -> Seen {
    let mut encoders = recorded.case.machine.axes.iter();
    let encoder = encoders.find_map(|axis| axis.encoder.as_ref()).unwrap();
    let turns = part * encoder.difference / encoder.pitch;
    let device = recorded.machine.drives.len();
    Seen::Interfered(Interference::Slip(device, turns))
}

fn is_sync(seen: &Seen) -> bool {
    matches!(seen, Seen::Frame { sent, .. } if sent.frame.id() == CanId::from(CobId::SYNC))
}

/// The last drive never says that it is ready to be switched on.
fn not_ready(it: &Recorded, seen: &Seen) -> Vec<Seen> {
    let Seen::Frame { bus, sent } = seen else {
        return vec![seen.clone()];
    };
    let last = it.machine.drives.last().unwrap();
    let own = sent.frame.id() == CanId::from(CobId::t_pdo(2, last.node)) && *bus == last.bus;
    let data = sent.frame.data();
    if !own || data.len() < 2 {
        return vec![seen.clone()];
    }
    let word = Statusword(u16::from_le_bytes([data[0], data[1]]));
    if word.state() != Some(cia402::State::ReadyToSwitchOn) {
        return vec![seen.clone()];
    }
    let mut data = data.to_vec();
    data[0] = 0x50;
    vec![framed(*bus, sent, Frame::new(sent.frame.id(), &data))]
}

/// An NMT command in front of a SYNC.
fn commanded(seen: &Seen, data: [u8; 2]) -> Vec<Seen> {
    let Seen::Frame { bus, sent } = seen else {
        return vec![seen.clone()];
    };
    vec![
        framed(*bus, sent, Frame::new(CanId::Standard(0), &data)),
        seen.clone(),
    ]
}

/// From the midst of a program on a shaft is elsewhere.
fn elsewhere(planting: &Planting, seen: &Seen, drive: usize, turns: f64) -> Seen {
    match seen {
        Seen::Woken(woken) if planting.done > 0 => {
            let mut woken = woken.clone();
            woken.plants[drive].position += turns;
            Seen::Woken(woken)
        }
        _ => seen.clone(),
    }
}

/// Defects by the checker that has to find each.
const DEFECTS: [(&str, &str, Change); 78] = [
    (
        "velocities",
        "a velocity for a drive that is only ready",
        |it, _, seen| match told(it, streamed(&it.machine), seen) {
            Some(0x06) => vec![with_setpoint(seen, 3)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "velocities",
        "a velocity far beyond what the axis may have",
        |it, planting, seen| match told(it, streamed(&it.machine), seen) {
            Some(0x0F) if planting.once() => vec![with_setpoint(seen, i32::MAX)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "velocities",
        "a shaft that turns without a velocity",
        |it, planting, seen| match (seen, streamed(&it.machine)) {
            (Seen::Woken(woken), Some(drive)) if planting.running > 100 => {
                let mut woken = woken.clone();
                woken.plants[drive].velocity = 1.0;
                vec![Seen::Woken(woken)]
            }
            (_, drive) if planting.running > 100 && told(it, drive, seen).is_some() => {
                vec![with_setpoint(seen, 0)]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "setpoints",
        "one setpoint a tenth of a revolution off",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) if planting.once() => vec![with_setpoint(seen, at + 13_000)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "setpoints",
        "twice as far",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) => {
                let first = *planting.setpoint.get_or_insert(at);
                vec![with_setpoint(seen, first + 2 * (at - first))]
            }
            None => vec![seen.clone()],
        },
    ),
    (
        "setpoints",
        "a tremble of some increments",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) => {
                planting.done += 1;
                vec![with_setpoint(
                    seen,
                    at + [0, 900][planting.done as usize % 2],
                )]
            }
            None => vec![seen.clone()],
        },
    ),
    (
        "setpoints",
        "a leap from one program to the next",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) if planting.running > 150 => vec![with_setpoint(seen, at + 131_072)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "setpoints",
        "far outside of the soft limits",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) if planting.running > 100 => vec![with_setpoint(seen, at ^ 0x2000_0000)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "setpoints",
        "a new setpoint in every second cycle alone",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) => {
                planting.done += 1;
                if planting.done % 2 == 0 {
                    planting.setpoint = Some(at);
                }
                vec![with_setpoint(seen, planting.setpoint.unwrap_or(at))]
            }
            None => vec![seen.clone()],
        },
    ),
    (
        "motion",
        "a shaft that turns without power",
        |_, _, seen| match seen {
            Seen::Woken(woken) => {
                let mut woken = woken.clone();
                for plant in woken.plants.iter_mut().filter(|plant| !plant.is_powered) {
                    plant.velocity = 1.0;
                }
                // Long enough for it to have coasted.
                woken.now =
                    Instant::ZERO + Duration::from_secs(1) + (woken.now - Instant::ZERO) * 9;
                vec![Seen::Woken(woken)]
            }
            _ => Vec::new(),
        },
    ),
    (
        "motion",
        "a loop that swings at rest",
        |_, _, seen| match seen {
            Seen::Woken(woken) if woken.state == State::Ready => {
                let mut woken = woken.clone();
                woken.now += Duration::from_secs(3);
                woken
                    .plants
                    .iter_mut()
                    .for_each(|plant| plant.velocity = 2.0);
                vec![Seen::Woken(woken)]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "motion",
        "an axis that lags",
        |_, planting, seen| match seen {
            Seen::Woken(woken) if planting.running > 50 => {
                let mut woken = woken.clone();
                woken.plants[0].position += 30.0;
                vec![Seen::Woken(woken)]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "motion",
        "a gantry whose sides part",
        |it, planting, seen| match seen {
            Seen::Woken(woken) if planting.running > 50 => {
                let mut woken = woken.clone();
                let mut axes = it.machine.axes.iter();
                if let Some(gantry) = axes.find(|axis| axis.drives.len() == 2) {
                    woken.plants[gantry.drives[1]].position += 0.2;
                }
                vec![Seen::Woken(woken)]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "motion",
        "a setpoint that creeps while the machine is ready",
        |it, planting, seen| match setpoint(it, seen) {
            Some(at) if planting.state == Some(State::Ready) => {
                planting.done += 1;
                vec![with_setpoint(seen, at + planting.done as i32)]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "motion",
        "an axis that is shown elsewhere than it is",
        |_, _, seen| match seen {
            Seen::Woken(woken) => {
                let mut woken = woken.clone();
                woken.shown.iter_mut().for_each(|shown| *shown += 1.0);
                vec![Seen::Woken(woken)]
            }
            _ => vec![seen.clone()],
        },
    ),
    ("stops", "a stop that nobody obeys", |_, planting, seen| {
        also(planting, seen, Some(accepted(Command::Stop)))
    }),
    (
        "stops",
        "a fault in spite of which it goes on",
        |_, planting, seen| {
            also(
                planting,
                seen,
                Some(event(control::Event::Fault(Fault::Program))),
            )
        },
    ),
    (
        "stops",
        "drives that are to be disabled and go on",
        |_, planting, seen| also(planting, seen, Some(accepted(Command::Disable))),
    ),
    (
        "stops",
        "a feed hold that nobody obeys",
        |_, planting, seen| also(planting, seen, Some(accepted(Command::FeedHold))),
    ),
    (
        "stops",
        "a door that is opened, and nobody minds",
        |it, planting, seen| comes_on(it, planting, seen, DOOR),
    ),
    (
        "stops",
        "a jog that nobody renews and that goes on",
        |it, planting, seen| {
            let jog = Jog::Continuous {
                axis: it.machine.axes[0].letter,
                direction: Direction::Positive,
                speed: None,
            };
            also(planting, seen, Some(accepted(Command::Jog(jog))))
        },
    ),
    (
        "transitions",
        "a program that runs before the machine is ready",
        |_, _, seen| match seen {
            Seen::Told(Event::State(State::Ready)) => {
                vec![Seen::Told(Event::State(State::Running))]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "transitions",
        "an NMT command to a node that is none of the machine's",
        |it, planting, seen| {
            let mut nodes = (1..=127).rev();
            let taken = |node: &u8| it.machine.drives.iter().any(|it| it.node.get() == *node);
            let stranger = nodes.find(|node| !taken(node));
            match stranger.filter(|_| is_sync(seen) && planting.once()) {
                Some(node) => commanded(seen, [0x01, node]),
                None => vec![seen.clone()],
            }
        },
    ),
    (
        "transitions",
        "a machine that does not say that it stops",
        |_, _, seen| match seen {
            Seen::Told(Event::State(State::Stopping)) => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "transitions",
        "held without a job",
        |_, _, seen| match seen {
            Seen::Told(Event::State(State::Ready)) => {
                vec![seen.clone(), Seen::Told(Event::State(State::Held))]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "transitions",
        "a machine whose axes follow a path begins anew as it stops",
        |it, _, seen| match seen {
            Seen::Told(Event::State(State::Stopping)) if stepper(&it.machine).is_none() => {
                vec![seen.clone(), Seen::Told(Event::State(State::Starting))]
            }
            _ => vec![seen.clone()],
        },
    ),
    ("transitions", "off and on again", |_, _, seen| match seen {
        Seen::Told(Event::State(State::Off)) => {
            vec![seen.clone(), Seen::Told(Event::State(State::Starting))]
        }
        _ => vec![seen.clone()],
    }),
    (
        "transitions",
        "a reset of all nodes",
        |_, planting, seen| {
            if is_sync(seen) && planting.once() {
                return commanded(seen, [0x82, 0]);
            }
            vec![seen.clone()]
        },
    ),
    (
        "transitions",
        "a reset of a drive that is enabled",
        |it, planting, seen| {
            let Seen::Frame { bus, .. } = seen else {
                return vec![seen.clone()];
            };
            let mut drives = it.machine.drives.iter();
            let node = drives
                .find(|drive| drive.bus == *bus)
                .map(|drive| drive.node);
            match node.filter(|_| is_sync(seen) && planting.once()) {
                Some(node) => commanded(seen, [0x82, node.get()]),
                None => vec![seen.clone()],
            }
        },
    ),
    (
        "transitions",
        "a controlword that enables at once",
        |it, _, seen| {
            let Seen::Frame { bus, sent } = seen else {
                return vec![seen.clone()];
            };
            let data = sent.frame.data();
            match setpoint(it, seen) {
                Some(_) if data[0] == 0x06 => {
                    let mut data = data.to_vec();
                    data[0] = 0;
                    vec![framed(*bus, sent, Frame::new(sent.frame.id(), &data))]
                }
                _ => vec![seen.clone()],
            }
        },
    ),
    (
        "transitions",
        "an enabled drive beside one that is not ready",
        |it, _, seen| not_ready(it, seen),
    ),
    ("alarms", "a fault out of nothing", |_, planting, seen| {
        let mut all = vec![seen.clone()];
        if planting.ready > 5 && planting.done == 0 {
            planting.done = 1;
            let cause = BusCause::LateSetpoints { count: 2 };
            all.push(event(control::Event::Fault(Fault::Bus(0, cause))));
        }
        all
    }),
    ("alarms", "the same fault twice", |_, planting, seen| {
        let mut all = vec![seen.clone()];
        if planting.once() {
            all.push(event(control::Event::Fault(Fault::NoPlan)));
            all.push(event(control::Event::Fault(Fault::NoPlan)));
        }
        all
    }),
    ("alarms", "a warning out of nothing", |_, planting, seen| {
        let mut all = vec![seen.clone()];
        if planting.once() {
            all.push(event(control::Event::MissedTPdo { device: 0 }));
        }
        all
    }),
    (
        "alarms",
        "an EMCY that nobody hears",
        |it, planting, seen| {
            let Seen::Frame { bus, sent } = seen else {
                return vec![seen.clone()];
            };
            let mut drives = it.machine.drives.iter();
            let node = drives
                .find(|drive| drive.bus == *bus)
                .map(|drive| drive.node);
            let mut all = vec![seen.clone()];
            if let Some(node) = node.filter(|_| planting.once()) {
                let frame = Frame::new(CobId::emcy(node), &[0x11, 0x86, 0x21, 0, 0, 0, 0, 0]);
                let sent = Transmission {
                    sender: Sender::Node(0),
                    ..*sent
                };
                all.push(framed(*bus, &sent, frame));
            }
            all
        },
    ),
    (
        "reactions",
        "a drive with a fault that is told to go on",
        |it, planting, seen| match fault_of(it, true, DeviceCause::HeartbeatLost) {
            Some(fault) => told_while_it_moves(it, planting, seen, fault, 0x1F),
            None => vec![seen.clone()],
        },
    ),
    (
        "reactions",
        "a drive that is switched off in motion where it is to rest on the path",
        |it, planting, seen| told_while_it_moves(it, planting, seen, Fault::NoPlan, 0x06),
    ),
    (
        "reactions",
        "a drive that is switched off where it is to make a quick stop",
        |it, planting, seen| {
            let fault = Fault::Axis(0, AxisCause::Skew { difference: 1.0 });
            told_while_it_moves(it, planting, seen, fault, 0x06)
        },
    ),
    (
        "reactions",
        "a statusword that nobody minds",
        |it, planting, seen| match is_statusword(it, seen) && planting.running > 100 {
            true => vec![with_word(seen, 0x08)],
            false => vec![seen.clone()],
        },
    ),
    (
        "reactions",
        "a drive that falls silent, and nobody minds",
        |it, planting, seen| match is_statusword(it, seen) && planting.running > 100 {
            true => Vec::new(),
            false => vec![seen.clone()],
        },
    ),
    (
        "reactions",
        "a drive that no longer answers, and nobody minds",
        |it, planting, seen| match (seen, stepper(&it.machine)) {
            (Seen::Frame { bus, sent }, Some(drive)) if planting.running > 100 => {
                let drive = &it.machine.drives[drive];
                let answer = sent.frame.id() == CanId::from(CobId::t_sdo(drive.node));
                let silent = answer && *bus == drive.bus;
                (!silent).then(|| seen.clone()).into_iter().collect()
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "reactions",
        "the same told of a drive in other words",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if planting.once() {
                for cause in [DeviceCause::HeartbeatLost, DeviceCause::NoNmtState] {
                    let fault = fault_of(it, true, cause);
                    all.extend(fault.map(|fault| event(control::Event::Fault(fault))));
                }
            }
            all
        },
    ),
    (
        "reactions",
        "a fault of another drive than the one that showed it",
        |it, planting, seen| {
            if planting.running <= 100 {
                return vec![seen.clone()];
            }
            if is_statusword(it, seen) {
                return vec![with_word(seen, 0x08)];
            }
            let mut all = vec![seen.clone()];
            let fault = fault_of(it, false, DeviceCause::HeartbeatLost);
            if let (Seen::Woken(_), Some(fault)) = (seen, fault)
                && planting.running > 101
                && planting.done == 0
            {
                planting.done = 1;
                all.insert(0, event(control::Event::Fault(fault)));
            }
            all
        },
    ),
    (
        "answers",
        "a command that is not told to be accepted",
        |_, _, seen| match seen {
            Seen::Told(Event::Accepted(it)) if it.command == Command::SwitchOff => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "answers",
        "a program that is said to be loaded never",
        |_, _, seen| match seen {
            Seen::Told(Event::Accepted(it)) if matches!(it.command, Command::Load(_)) => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "answers",
        "a program that runs and was not told to be accepted",
        |_, _, seen| match seen {
            Seen::Told(Event::Accepted(it)) if matches!(it.command, Command::Run { .. }) => {
                Vec::new()
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "answers",
        "a command that a machine accepts which is off",
        |_, _, seen| match seen {
            Seen::Told(Event::State(State::Off)) => vec![seen.clone(), accepted(Command::Enable)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "outputs",
        "an output that is switched twice",
        |it, planting, seen| match outputs(it, seen) {
            Some(now) if planting.running > 100 && planting.done < 5 => {
                planting.done += 1;
                vec![with_outputs(seen, !now)]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "outputs",
        "outputs that are switched early",
        |it, planting, seen| shifted(it, planting, seen, 8),
    ),
    (
        "outputs",
        "outputs that are switched late",
        |it, planting, seen| shifted(it, planting, seen, -8),
    ),
    (
        "outputs",
        "an output that is switched off never",
        |it, planting, seen| match outputs(it, seen) {
            Some(now) => {
                planting.done |= u32::from(now);
                vec![with_outputs(seen, planting.done as u8)]
            }
            None => vec![seen.clone()],
        },
    ),
    (
        "outputs",
        "outputs that nobody switches",
        |it, _, seen| match outputs(it, seen) {
            Some(_) => vec![with_outputs(seen, 0)],
            None => vec![seen.clone()],
        },
    ),
    (
        "outputs",
        "outputs that stay on where a fault stops the machine",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if outputs(it, seen).is_some_and(|on| on != 0) && planting.once() {
                all.push(event(control::Event::Fault(Fault::NoPlan)));
            }
            all
        },
    ),
    (
        "outputs",
        "outputs that a program leaves on",
        |it, planting, seen| match outputs(it, seen) {
            Some(_) if planting.state == Some(State::Ready) && planting.running > 0 => {
                vec![with_outputs(seen, planting.done as u8)]
            }
            Some(now) => {
                planting.done |= u32::from(now);
                vec![seen.clone()]
            }
            None => vec![seen.clone()],
        },
    ),
    (
        "faulted",
        "a drive that keeps its power where the machine is disabled",
        |_, planting, seen| disabled(planting, seen, |_| ()),
    ),
    (
        "faulted",
        "an output that stays on where the machine is disabled",
        |it, planting, seen| {
            disabled(planting, seen, |woken| {
                for plant in &mut woken.plants {
                    plant.is_powered = false;
                }
                for output in &it.machine.outputs {
                    let is_safe = output.safe != output.active_low;
                    woken.outputs[output.node] = if is_safe { 0 } else { u16::MAX };
                }
            })
        },
    ),
    (
        "bus",
        "a SYNC that is left out",
        |_, planting, seen| match seen {
            Seen::Frame { .. } if is_sync(seen) && planting.once() => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a SYNC that comes early",
        |_, planting, seen| match seen {
            Seen::Frame { bus, sent } if is_sync(seen) && planting.once() => {
                let start = Instant::from_nanos(sent.start.as_nanos() - 900_000);
                let sent = Transmission { start, ..*sent };
                vec![Seen::Frame { bus: *bus, sent }]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a SYNC that comes late",
        |_, planting, seen| match seen {
            Seen::Frame { bus, sent } if is_sync(seen) && planting.once() => {
                let mut late = *sent;
                late.start += Duration::from_micros(900);
                vec![Seen::Frame {
                    bus: *bus,
                    sent: late,
                }]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a setpoint that one drive does not get",
        |it, planting, seen| match setpoint(it, seen) {
            Some(_) if planting.once() => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a setpoint that comes twice",
        |it, planting, seen| match setpoint(it, seen) {
            Some(_) if planting.once() => vec![seen.clone(), seen.clone()],
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a velocity that does not come",
        |it, planting, seen| match told(it, streamed(&it.machine), seen) {
            Some(_) if planting.once() => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a target that comes twice",
        |it, planting, seen| match told(it, stepper(&it.machine), seen) {
            Some(_) if planting.once() => vec![seen.clone(), seen.clone()],
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a SYNC of somebody else's",
        |_, planting, seen| match seen {
            Seen::Frame { bus, sent } if is_sync(seen) && planting.once() => {
                let mut stranger = *sent;
                stranger.sender = Sender::Node(0);
                vec![Seen::Frame {
                    bus: *bus,
                    sent: stranger,
                }]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "bus",
        "a request by SDO in the midst of a move",
        |it, planting, seen| {
            let Seen::Frame { bus, sent } = seen else {
                return vec![seen.clone()];
            };
            let mut all = vec![seen.clone()];
            if is_sync(seen) && planting.running > 100 && planting.state == Some(State::Running) {
                let request = CanId::Standard(0x600 + u16::from(it.machine.drives[0].node.get()));
                all.push(framed(*bus, sent, Frame::new(request, &[0x40; 8])));
            }
            all
        },
    ),
    (
        "bus",
        "a setpoint that does not come for an answer by SDO, in the midst of a move",
        |it, planting, seen| match (setpoint(it, seen), seen) {
            (Some(_), Seen::Frame { bus, sent }) if planting.running > 100 && planting.once() => {
                let answer = CanId::Standard(0x580 + u16::from(it.machine.drives[0].node.get()));
                vec![framed(*bus, sent, Frame::new(answer, &[0x60; 8]))]
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "encoders",
        "an encoder that falls silent",
        |it, planting, seen| match (seen, it.machine.encoders.first()) {
            (Seen::Frame { bus, sent }, Some(encoder))
                if planting.running > 100
                    && *bus == encoder.bus
                    && sent.frame.id() == CanId::from(CobId::t_pdo(2, encoder.node)) =>
            {
                Vec::new()
            }
            _ => vec![seen.clone()],
        },
    ),
    (
        "encoders",
        "a coupling that slips while nobody looks",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if !it.machine.encoders.is_empty() && planting.once() {
                all.push(slip(it, 2.0));
            }
            all
        },
    ),
    (
        "encoders",
        "a coupling of a stepper that slips while nobody looks",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if stepper(&it.machine).is_some() && planting.once() {
                all.push(slip(it, 2.0));
            }
            all
        },
    ),
    (
        "encoders",
        "an encoder that is told to disagree and does not",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if let Some(encoder) = it.machine.encoders.first()
                && planting.once()
            {
                let cause = AxisCause::FeedbackDifference { difference: 1.0 };
                let fault = Fault::Axis(encoder.axis.expect("it sees one"), cause);
                all.extend([slip(it, 0.1), event(control::Event::Fault(fault))]);
            }
            all
        },
    ),
    (
        "reactions",
        "a device that another master stops, and nobody minds",
        |it, planting, seen| {
            let stop = it.machine.drives.first().map(|first| {
                let stop = ToBus::Nmt(2, first.node.get());
                Seen::Interfered(Interference::Bus(first.bus, stop))
            });
            also(planting, seen, stop)
        },
    ),
    (
        "reactions",
        "an enable that goes off, and nobody minds",
        |it, planting, seen| comes_on(it, planting, seen, ENABLE),
    ),
    (
        "reactions",
        "an I/O node that falls silent, and nobody minds",
        |it, planting, seen| {
            let first = it.machine.drives.len() + it.machine.encoders.len();
            let mute = Seen::Interfered(Interference::Drive(first, ToDrive::Mute(true)));
            let has_one = !it.case.machine.io_nodes.is_empty();
            also(planting, seen, has_one.then_some(mute))
        },
    ),
    (
        "reactions",
        "an I/O node that is reset and stays silent, and nobody minds",
        |it, planting, seen| {
            let first = it.machine.drives.len() + it.machine.encoders.len();
            let (Some(node), Seen::Frame { bus, sent }) = (it.machine.nodes().nth(first), seen)
            else {
                return vec![seen.clone()];
            };
            if *bus != node.bus || !is_sync(seen) || !planting.once() {
                return vec![seen.clone()];
            }
            let mute = Seen::Interfered(Interference::Drive(first, ToDrive::Mute(true)));
            let reset = Frame::new(CobId::NMT, &[0x82, node.id.get()]);
            vec![seen.clone(), mute, framed(*bus, sent, reset)]
        },
    ),
    (
        "outputs",
        "an output that is switched by hand and stays as it is",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if let (Some(output), Seen::Told(Event::State(State::Ready))) =
                (it.machine.outputs.first(), seen)
            {
                planting.done += 1;
                if planting.done == 1 {
                    let (name, on) = (output.name.clone(), !output.safe);
                    all.push(accepted(Command::Output { name, on }));
                }
            }
            all
        },
    ),
    (
        "ending",
        "a clock that stands still",
        |_, planting, seen| match seen {
            Seen::Woken(woken) if planting.running > 100 => {
                let mut woken = woken.clone();
                woken.now = Instant::ZERO;
                vec![Seen::Woken(woken)]
            }
            Seen::Frame { .. } if planting.running > 100 => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "ending",
        "a machine that never says that it is off",
        |_, _, seen| match seen {
            Seen::Told(Event::State(State::Off)) => Vec::new(),
            _ => vec![seen.clone()],
        },
    ),
    (
        "ending",
        "a power stage that stays on",
        |_, _, seen| match seen {
            Seen::Woken(woken) => {
                let mut woken = woken.clone();
                woken.plants[0].is_powered = true;
                vec![Seen::Woken(woken)]
            }
            _ => vec![seen.clone()],
        },
    ),
];

#[test]
fn nothing_is_found_where_nothing_is_planted() {
    for recorded in &*RECORDED {
        let found = judge(recorded, |_, _, seen| vec![seen.clone()]);
        assert_eq!(found, [""; 0], "seed {}", recorded.case.seed);
    }
}

#[test]
fn every_planted_defect_is_found_by_its_checker() {
    let mut missed = Vec::new();
    for (checker, what, change) in DEFECTS {
        let found = RECORDED
            .iter()
            .any(|it| judge(it, change).contains(&checker));
        if !found {
            missed.push(format!("{checker}: {what}"));
        }
    }
    assert!(missed.is_empty(), "not found:\n{}", missed.join("\n"));
}

/// Of what other defects make, too, what is told of each.
const TOLD: [(&str, Change); 7] = [
    (
        "an operator's stop leaves the path",
        |_, planting, seen| match seen {
            Seen::Woken(woken) if planting.done > 0 => {
                let mut woken = woken.clone();
                woken.off_path = true;
                vec![Seen::Woken(woken)]
            }
            Seen::Woken(_) if planting.once() => vec![seen.clone(), accepted(Command::Stop)],
            _ => vec![seen.clone()],
        },
    ),
    (
        "a setpoint that only a defect makes",
        |_, planting, seen| {
            let mut all = vec![seen.clone()];
            if planting.once() {
                let late = Interference::Late(1);
                let cause = AxisCause::SetpointGuard {
                    drive: 0,
                    quantity: control::Quantity::Jerk,
                    value: 1.0,
                    sampled: false,
                };
                all.push(Seen::Interfered(late));
                all.push(event(control::Event::Fault(Fault::Axis(0, cause))));
            }
            all
        },
    ),
    (
        "a fault although what happened is to be borne",
        |it, planting, seen| {
            let mut all = vec![seen.clone()];
            if it.case.machine.t_pdo_misses > 1 && planting.once() {
                let lost = Interference::Drive(0, ToDrive::LoseTPdos(1));
                let cause = DeviceCause::MissingTPdo { misses: 1 };
                all.push(Seen::Interfered(lost));
                all.push(event(control::Event::Fault(Fault::Device(0, cause))));
            }
            all
        },
    ),
    (
        "nothing is done about a following error",
        |_, planting, seen| {
            let longer = Interference::Drive(0, ToDrive::EnableTime(1));
            let mut all = vec![elsewhere(planting, seen, 0, 30.0)];
            all.extend(planting.once().then_some(Seen::Interfered(longer)));
            all
        },
    ),
    (
        "a gantry is askew by more than it takes to brake",
        |it, planting, seen| {
            let mut axes = it.machine.axes.iter();
            let Some(gantry) = axes.find(|axis| axis.drives.len() == 2) else {
                return vec![seen.clone()];
            };
            let side = gantry.drives[1];
            let block = Interference::Drive(side, ToDrive::Block(true));
            let mut all = vec![elsewhere(planting, seen, side, 30.0)];
            all.extend(planting.once().then_some(Seen::Interfered(block)));
            all
        },
    ),
    (
        "a reaction that is not commanded in time",
        |it, planting, seen| {
            let Some(fault) = fault_of(it, true, DeviceCause::HeartbeatLost) else {
                return vec![seen.clone()];
            };
            let before = planting.done;
            let mut all = told_while_it_moves(it, planting, seen, fault, 0x1F);
            if planting.done > before {
                let lost = ToBus::DropBursts(1);
                all.insert(0, Seen::Interfered(Interference::Bus(0, lost)));
            }
            all
        },
    ),
    (
        "enabled while another drive is not ready",
        |it, planting, seen| {
            let mut all = not_ready(it, seen);
            if planting.done == 0 {
                planting.done = 1;
                let longer = Interference::Drive(0, ToDrive::EnableTime(1));
                all.push(Seen::Interfered(longer));
            }
            all
        },
    ),
];

/// As far as nothing is known to be wrong, which would be told before.
#[test]
fn what_is_wrong_beside_troubles_is_told_as_that() {
    let mut missed = Vec::new();
    for (what, change) in TOLD {
        let found = RECORDED.iter().any(|it| {
            let mut case = it.case.clone();
            case.troubles.push(Trouble {
                at: When::Ready(u32::MAX),
                what: Interference::Late(1),
            });
            let mut checkers = Checkers::new(&case, &it.machine);
            let mut planting = Planting::default();
            for seen in &it.seen {
                planting.see(it, seen);
                for seen in change(it, &mut planting, seen) {
                    checkers.see(&seen);
                }
            }
            checkers.found.0.iter().any(|it| it.what == what)
        });
        if !found {
            missed.push(what);
        }
    }
    assert_eq!(missed, [""; 0], "not found");
}

/// A fault behind trouble that was mended: nobody is to blame for it any more once the machine was started since.
#[test]
fn what_was_mended_excuses_nothing() {
    let is_found = |since: &[State]| {
        let recorded = &RECORDED[0];
        let mut case = recorded.case.clone();
        case.troubles.push(Trouble {
            at: When::Ready(u32::MAX),
            what: Interference::Late(1),
        });
        let mut checkers = Checkers::new(&case, &recorded.machine);
        let bus = recorded.machine.drives[0].bus;
        let unplugged = Interference::Bus(bus, ToBus::Unplug(1));
        for what in [unplugged, Interference::Mended] {
            checkers.see(&Seen::Interfered(what));
        }
        for state in since {
            checkers.see(&Seen::Told(Event::State(*state)));
        }
        let cause = DeviceCause::MissingTPdo { misses: 1 };
        checkers.see(&event(control::Event::Fault(Fault::Device(0, cause))));
        let mut found = checkers.found.0.iter();
        found.any(|it| it.what == "a fault of somebody whom nothing happened to")
    };
    assert!(is_found(&[State::Starting, State::Ready]));
    for since in [&[][..], &[State::Starting], &[State::Ready]] {
        assert!(!is_found(since), "{since:?}");
    }
}

/// Quiet cases of corrected axes whose positions a drive is sent, as they are seen where the machine corrects by something else.
#[test]
fn what_is_corrected_by_something_else_is_found() {
    let corrected = |case: &Case| {
        let mut axes = case.machine.axes.iter();
        let is_sent = |it: &AxisSpec| it.drives[0].model == "lxm32m" && it.homing.is_none();
        axes.position(|it| {
            is_sent(it)
                && it
                    .corrected
                    .as_ref()
                    .is_some_and(|it| it.lead_error.len() > 1)
        })
    };
    let quiet = (0..).map(Case::of).filter(|case| {
        case.is_untroubled()
            && case.patience.is_some()
            && corrected(case).is_some()
            && case.cycles < 1500
    });
    let moves = |it: &Recorded| it.played.summary.times.motion_s > 0.5;
    let recorded: Vec<Recorded> = quiet.map(record).filter(moves).take(3).collect();
    let found = |part: f64| {
        let mut found = recorded.iter().filter(|it| {
            let mut case = it.case.clone();
            let axis = corrected(&case).unwrap();
            let errors = case.machine.axes[axis].corrected.as_mut().unwrap();
            errors.backlash *= part.abs();
            errors.lead_error.iter_mut().for_each(|it| it.1 *= part);
            let mut checkers = Checkers::new(&case, &it.machine);
            it.seen.iter().for_each(|seen| checkers.see(seen));
            checkers.found.0.iter().any(|it| it.checker == "carriage")
        });
        found.next().is_some()
    };
    assert!(!found(1.0), "as it is");
    for part in [2.0, 0.5, -1.0] {
        assert!(found(part), "{part} times as much");
    }
}

/// A backlash beside which it does not count how drives sway, mm.
const GREAT: f64 = 0.5;

/// An axis that is corrected by what its transmission has, and rests long where it came from either side, as it is seen where its
/// carriage stands elsewhere.
#[test]
fn a_carriage_beside_its_axis_is_found() {
    let fits = |it: &AxisSpec| {
        let simulation = it.simulation.as_deref().unwrap_or_default();
        let has = it.transmission.as_ref().filter(|it| it.soft.is_some());
        let is_known = it.drives[0].model == "lxm32m"
            && it.homing.is_none()
            && it.warmth.is_none()
            && it.drives.len() == 1;
        let errors = has.map(|it| &it.errors);
        is_known
            && !simulation.contains("gravity")
            && it.corrected.as_ref().is_some_and(|it| it.backlash > GREAT)
            && it.corrected.as_ref() == errors
    };
    let mut cases = (0..).map(Case::of);
    let small = cases.find(|case| {
        case.machine.axes.len() < 3 && case.machine.shaper.is_none() && fits(&case.machine.axes[0])
    });
    let mut case = small.unwrap();
    let axis = case.machine.axes[0].clone();
    let backlash = axis.corrected.as_ref().unwrap().backlash;
    let [least, most] = axis.soft_limits;
    let middle = 0.5 * (least + most);
    let way = 5.0 * backlash;
    assert!(backlash > 0.0 && way < most - middle, "{}", case.seed);
    let line = |at: f64| format!("G1 {}{}", axis.letter, at);
    let mut program = vec![format!("F{}", 30.0 * axis.velocity)];
    for at in [middle, middle + way, middle] {
        program.extend([line(at), "G4 P7".to_owned()]);
    }
    program.push("M2".to_owned());
    case.programs = vec![program];
    case.deeds.clear();
    case.troubles.clear();
    case.patience = Some(10);
    case.cycles = 26_000_000 / case.machine.cycle_us;
    let recorded = record(case);
    let drive = recorded.machine.axes[0].drives[0];
    let found = |backlashes: f64| {
        let mut checkers = Checkers::new(&recorded.case, &recorded.machine);
        for seen in &recorded.seen {
            let mut seen = seen.clone();
            if let Seen::Woken(woken) = &mut seen {
                woken.plants[drive].load_position += backlashes * backlash / axis.travel;
            }
            checkers.see(&seen);
        }
        let found = checkers.found.0.iter();
        found
            .filter(|it| it.what == "a carriage beside its axis")
            .count()
    };
    assert_eq!(found(0.0), 0, "as it is");
    for backlashes in [0.5, -0.5] {
        assert!(found(backlashes) > 0, "{backlashes} of its backlash away");
    }
}

#[test]
fn a_seed_is_the_same_twice() {
    for seed in [3, 4] {
        let outcome = campaign::run_twice(&Case::of(seed));
        assert!(
            outcome.violations.is_empty(),
            "{seed}: {:?}",
            outcome.violations
        );
        assert!(!outcome.frames.is_empty());
    }
}

/// Cases that failed once, as small as they became.
fn saved() -> Vec<PathBuf> {
    let folder = root().join("controller/tests/campaign");
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = files.map(|file| file.path()).collect();
    files.retain(|file| file.extension().is_some_and(|it| it == "json"));
    files.sort();
    files
}

#[test]
fn what_failed_once_does_not_fail_again() {
    let mut failing = Vec::new();
    for file in saved() {
        let case = Case::load(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let outcome = campaign::run(&case, Wanted::default(), &mut |_| ());
        for violation in outcome.violations {
            failing.push(format!("{}: {violation}", file.display()));
        }
    }
    assert!(failing.is_empty(), "{}", failing.join("\n"));
}
