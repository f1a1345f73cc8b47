//! What happens to a machine, at random: each kind by itself, in bursts and together.

use super::{Change, Interference, Tampering, ToBus, ToDrive, Traffic, Trouble};
use crate::bus::BusFault;
use crate::campaign::When;
use crate::campaign::dice::{Dice, rounded};
use crate::campaign::machine::{EncoderSpec, MachineSpec};
use syncline_canopen::nmt;

/// Random interference with a machine in a case of so many cycles. Three cases in ten have none.
pub(in crate::campaign) fn draw(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
) -> Vec<Trouble> {
    let count = match dice.weighted(&[3, 4, 2, 1]) {
        0 => 0,
        1 => 1,
        2 => dice.whole(2..=4),
        _ => dice.whole(5..=15),
    };
    let mut troubles = Vec::new();
    for _ in 0..count {
        let at = When::draw(dice, cycles);
        let what = any(dice, machine);
        troubles.push(Trouble {
            at,
            what: what.clone(),
        });
        if let Some(end) = what.end()
            && dice.chance(0.85)
        {
            troubles.push(Trouble {
                at: at.later(dice.whole(1..=cycles / 2)),
                what: end,
            });
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
    troubles
}

/// Draws for one of a kind: the rarest comes every few hundred.
const DRAWS: usize = 2000;

/// Random interference of this kind, as [`Interference::kind`] names it, if it is one that may come at any
/// time.
pub(in crate::campaign) fn of_kind(
    dice: &mut Dice,
    machine: &MachineSpec,
    kind: &str,
) -> Option<Interference> {
    let inputs = machine.wires().filter(|(_, wire)| wire.is_digital_input());
    let switched = inputs.flat_map(|(drive, wire)| {
        [true, false].map(|on| Interference::Drive(drive, ToDrive::Input(wire.place, on)))
    });
    let mut switched: Vec<_> = switched.filter(|what| what.kind() == kind).collect();
    if !switched.is_empty() {
        return Some(switched.swap_remove(dice.below(switched.len())));
    }
    let drawn = (0..DRAWS).flat_map(|_| {
        let what = one(dice, machine);
        let end = what.end();
        [Some(what), end].into_iter().flatten()
    });
    let mut drawn = drawn.filter(|what| what.kind() == kind);
    drawn.next()
}

/// Any one, of those that come at any time and of those that few machines have.
pub(in crate::campaign) fn one(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    match dice.below(16) {
        0 => nmt(dice, machine),
        1 => strange(dice, machine).1,
        2 => wrong_answers(dice, machine),
        3 => of_a_coupling(dice, machine).unwrap_or_else(|| any(dice, machine)),
        _ => any(dice, machine),
    }
}

fn any(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    match dice.weighted(&[6, 6, 2, 1]) {
        0 => Interference::Drive(dice.below(machine.nodes().count()), to_drive(dice)),
        1 => Interference::Bus(dice.below(machine.buses.len()), to_bus(dice, machine)),
        2 => {
            // A tenth of a cycle to fifty of them.
            let cycles = *dice.pick(&[0.1, 0.3, 0.6, 0.9, 1.0, 1.3, 2.0, 3.7, 10.0, 50.0]);
            Interference::Late((f64::from(machine.cycle_us) * cycles) as u32)
        }
        _ => Interference::StarvePlanner(dice.whole(1..=400)),
    }
}

fn to_drive(dice: &mut Dice) -> ToDrive {
    match dice.below(12) {
        0 => ToDrive::Mains(false),
        1 => ToDrive::Block(true),
        2 => ToDrive::LoseTorque(true),
        3 => ToDrive::Mute(true),
        4 | 5 => ToDrive::LoseTPdos(*dice.pick(&[1, 1, 2, 3, 20])),
        6 => ToDrive::Reset,
        7 | 8 => ToDrive::Error(dice.whole(0..=4) as u8),
        9 => ToDrive::ErrorPersists(true),
        10 => ToDrive::Remote(false),
        _ => ToDrive::EnableTime(*dice.pick(&[1, 20, 300])),
    }
}

fn to_bus(dice: &mut Dice, machine: &MachineSpec) -> ToBus {
    let count = *dice.pick(&[1, 1, 2, 3, 10]);
    match dice.below(12) {
        0 | 1 => ToBus::DropBursts(count),
        2 => ToBus::DelayBursts(count),
        3 => ToBus::TearBurst,
        4 => ToBus::LoseSyncs(count),
        5 => ToBus::Unplug(*dice.pick(&[1, 5, 100, 1000])),
        6 => ToBus::Condition(dice.below(BusFault::ALL.len())),
        7 => {
            let mut data = [0; 8];
            data.fill_with(|| dice.whole(0..=255) as u8);
            // Sometimes it looks like a drive's.
            let node = nodes(machine)[dice.below(machine.nodes().count())];
            let function = *dice.pick(&[0x080, 0x180, 0x280, 0x580, 0x700, 0x000, 0x480]);
            ToBus::Intruder(function + u16::from(node), data, count)
        }
        _ => {
            let traffic = [
                Traffic::TPdo,
                Traffic::TPdo,
                Traffic::Heartbeat,
                Traffic::Emergency,
                Traffic::Sdo,
            ];
            let change = [
                Change::Lose,
                Change::Delay,
                Change::Duplicate,
                Change::Corrupt(dice.whole(0..=63) as u8),
            ];
            let node = nodes(machine)[dice.below(machine.nodes().count())];
            ToBus::Incoming(Tampering {
                traffic: *dice.pick(&traffic),
                node: if dice.chance(0.8) { node } else { 0 },
                change: *dice.pick(&change),
                count,
            })
        }
    }
}

/// Commands of an SDO server that are no answer to what a drive is asked: an abort, the beginning and the
/// middle of a segmented transfer, a block transfer, the answer to a write, and none that there is.
const WRONG: [u8; 6] = [0x80, 0x41, 0x00, 0xC6, 0x60, 0xE7];

/// Where there is trouble anyway: drives that give wrong SDO answers while the machine comes up.
pub(in crate::campaign) fn answer_wrongly(
    dice: &mut Dice,
    machine: &MachineSpec,
    troubles: &mut Vec<Trouble>,
) {
    if troubles.is_empty() || !dice.chance(0.12) {
        return;
    }
    let what = wrong_answers(dice, machine);
    troubles.push(Trouble {
        at: When::On(dice.whole(0..=300)),
        what,
    });
    troubles.sort_by_key(|trouble| trouble.at);
}

fn wrong_answers(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    let tampering = Tampering {
        traffic: Traffic::Sdo,
        node: 0,
        change: Change::Begin(*dice.pick(&WRONG)),
        count: *dice.pick(&[1, 1, 2, 10]),
    };
    let bus = dice.below(machine.buses.len());
    Interference::Bus(bus, ToBus::Incoming(tampering))
}

/// What is wired to inputs is switched on and off.
pub(in crate::campaign) fn switch_inputs(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    for (drive, wire) in machine.wires().filter(|(_, wire)| wire.is_digital_input()) {
        let seldom = wire.misleads();
        if !dice.chance(if seldom { 0.2 } else { 0.7 }) {
            continue;
        }
        for _ in 0..dice.whole(1..=3) {
            let at = When::draw(dice, cycles);
            let later = at.later(dice.whole(1..=400));
            for (at, on) in [(at, true), (later, false)] {
                let what = Interference::Drive(drive, ToDrive::Input(wire.place, on));
                troubles.push(Trouble { at, what });
            }
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// Couplings of encoders slip: by less than what the machine takes, and by more.
pub(in crate::campaign) fn slip(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    for (place, encoder) in machine.encoders().enumerate() {
        if dice.chance(0.3) {
            let by = slips(dice, encoder);
            troubles.push(Trouble {
                at: When::draw(dice, cycles),
                what: Interference::Slip(machine.drives() + place, by),
            });
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// By how many revolutions a coupling slips.
fn slips(dice: &mut Dice, encoder: &EncoderSpec) -> f64 {
    let allowed = encoder.difference / encoder.pitch;
    rounded(allowed * dice.between(-3.0, 3.0), 4)
}

/// Something that happens to the coupling of an encoder, if the machine has one.
fn of_a_coupling(dice: &mut Dice, machine: &MachineSpec) -> Option<Interference> {
    let encoders: Vec<_> = machine.encoders().collect();
    if encoders.is_empty() {
        return None;
    }
    let place = dice.below(encoders.len());
    let device = machine.drives() + place;
    Some(match dice.chance(0.5) {
        true => Interference::Part(device),
        false => Interference::Slip(device, slips(dice, encoders[place])),
    })
}

/// Couplings of encoders break; of some nobody makes them whole.
pub(in crate::campaign) fn part(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    for place in 0..machine.encoders().count() {
        if !dice.chance(0.2) {
            continue;
        }
        let (at, encoder) = (When::draw(dice, cycles), machine.drives() + place);
        let what = Interference::Part(encoder);
        troubles.push(Trouble { at, what });
        if dice.chance(0.5) {
            let at = at.later(dice.whole(1..=cycles / 2));
            let what = Interference::Join(encoder);
            troubles.push(Trouble { at, what });
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// Where there is trouble anyway: another master commands devices, one of them or all.
pub(in crate::campaign) fn command_besides(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    if troubles.is_empty() || !dice.chance(0.2) {
        return;
    }
    for _ in 0..dice.whole(1..=2) {
        troubles.push(Trouble {
            at: When::draw(dice, cycles),
            what: nmt(dice, machine),
        });
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

fn nmt(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    use nmt::Command::{EnterPreOperational, ResetCommunication, ResetNode, Start, Stop};
    let command = [
        EnterPreOperational,
        Stop,
        Start,
        ResetNode,
        ResetCommunication,
    ];
    let command = command[dice.weighted(&[4, 4, 1, 1, 1])];
    let nodes: Vec<_> = machine.nodes().collect();
    let (bus, node) = *dice.pick(&nodes);
    let all = dice.chance(0.2);
    Interference::Bus(bus, ToBus::Nmt(command as u8, if all { 0 } else { node }))
}

/// Where there is trouble anyway: what few machines have, devices that are not what they should be, and frames that are not whole.
pub(in crate::campaign) fn be_strange(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    if troubles.is_empty() || !dice.chance(0.25) {
        return;
    }
    let at = When::draw(dice, cycles);
    let (device, what) = strange(dice, machine);
    let is_cut = matches!(
        what,
        Interference::Bus(
            _,
            ToBus::Incoming(Tampering {
                change: Change::Cut(_),
                ..
            })
        )
    );
    let end = what.end();
    troubles.push(Trouble { at, what });
    if let Some(end) = end {
        let at = at.later(dice.whole(1..=cycles / 2));
        troubles.push(Trouble { at, what: end });
    }
    if is_cut {
        let error = ToDrive::Error(dice.whole(0..=3) as u8);
        troubles.push(Trouble {
            at: at.later(dice.whole(1..=20)),
            what: Interference::Drive(device, error),
        });
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// Objects that a set-up writes: the interpolation period, the mode, the SYNC behind which nothing is wrong, a mapping, a heartbeat.
const WRITTEN: [(u16, u8); 6] = [
    (0x60C2, 1),
    (0x6060, 0),
    (0x1006, 0),
    (0x1600, 0),
    (0x1017, 0),
    (0x1400, 1),
];

/// A device, and what is strange about it.
fn strange(dice: &mut Dice, machine: &MachineSpec) -> (usize, Interference) {
    let nodes: Vec<_> = machine.nodes().collect();
    let device = dice.below(nodes.len());
    let (bus, node) = nodes[device];
    let what = match dice.weighted(&[4, 4, 1, 2, 2, 1]) {
        0 => {
            let count = *dice.pick(&[1, 2, 20, 1000]);
            Interference::Bus(bus, ToBus::SecondNode(node, count))
        }
        1 => {
            let tampering = Tampering {
                traffic: Traffic::Emergency,
                node,
                change: Change::Cut(dice.whole(0..=7) as u8),
                count: dice.whole(1..=3),
            };
            Interference::Bus(bus, ToBus::Incoming(tampering))
        }
        2 => Interference::Drive(device, ToDrive::Vendor(dice.whole(1..=999))),
        3 => {
            let (index, sub) = *dice.pick(&WRITTEN);
            Interference::Drive(device, ToDrive::Refuse(index, sub))
        }
        4 => Interference::Drive(device, ToDrive::Deaf(true)),
        _ => Interference::Drive(device, ToDrive::FoundEnabled),
    };
    (device, what)
}

/// The node ids of the devices.
fn nodes(machine: &MachineSpec) -> Vec<u8> {
    machine.nodes().map(|(_, node)| node).collect()
}
