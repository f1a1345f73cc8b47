//! Random operators: what is commanded when, and who goes on where the machine rests.

use super::When;
use super::coverage;
use super::dice::{Dice, rounded};
use super::machine::MachineSpec;
use crate::control::State;
use crate::machine::COORDINATES;
use crate::session::{Command, Direction, Jog, Override, StepChange, SwitchChange};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use syncline_gcode::AxisLetter;

/// Operators of a session that command at random.
pub(super) const OPERATORS: usize = 3;

/// Something that an operator commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deed {
    /// When.
    pub at: When,
    /// Which of the operators.
    pub operator: usize,
    /// What. A program to load is `NUMBER.ngc`.
    pub command: Command,
}

/// Random commands for a machine in a case of so many cycles with so many programs.
pub(super) fn draw(
    dice: &mut Dice,
    machine: &MachineSpec,
    programs: usize,
    cycles: u32,
) -> Vec<Deed> {
    let letters = letters(machine);
    let count = dice.weighted(&[2, 3, 3, 1]);
    let count = [
        0,
        dice.whole(1..=3),
        dice.whole(3..=15),
        dice.whole(15..=60),
    ][count];
    // Each case has operators who are fond of some commands and know nothing of others.
    let weights: Vec<u32> = KINDS
        .iter()
        .map(|(weight, _)| weight * [0, 1, 1, 5][dice.below(4)])
        .collect();
    let mut deeds: Vec<Deed> = (0..count)
        .map(|_| {
            let mut drawing = Drawing {
                dice,
                machine,
                letters: &letters,
                programs,
            };
            let command = KINDS[drawing.dice.weighted(&weights)].1(&mut drawing);
            Deed {
                at: When::draw(dice, cycles),
                operator: dice.below(OPERATORS),
                command,
            }
        })
        .collect();
    // Some come in the same cycle, or in the next one.
    for place in 1..deeds.len() {
        if dice.chance(0.15) {
            deeds[place].at = deeds[place - 1].at.later(dice.whole(0..=3));
        }
    }
    deeds.sort_by_key(|deed| deed.at);
    deeds
}

/// A random command of this kind, as the tables name it, for a machine with so many programs.
pub(super) fn of_kind(
    dice: &mut Dice,
    machine: &MachineSpec,
    programs: usize,
    kind: &str,
) -> Option<Command> {
    let letters = letters(machine);
    let mut drawing = Drawing {
        dice,
        machine,
        letters: &letters,
        programs,
    };
    let mut commands = KINDS.iter().map(|(_, draw)| draw(&mut drawing));
    commands.find(|command| coverage::name(command) == kind)
}

/// The letters of a machine's axes.
fn letters(machine: &MachineSpec) -> Vec<AxisLetter> {
    let axes = machine.axes.iter();
    axes.filter_map(|axis| AxisLetter::from_letter(axis.letter))
        .collect()
}

/// What a command is drawn from.
struct Drawing<'a> {
    dice: &'a mut Dice,
    machine: &'a MachineSpec,
    letters: &'a [AxisLetter],
    programs: usize,
}

/// Draws a command of a kind.
type Draw = fn(&mut Drawing<'_>) -> Command;

/// Every kind of command, and how often it comes.
const KINDS: [(u32, Draw); 26] = [
    (4, |_| Command::CycleStart),
    (4, |_| Command::FeedHold),
    (4, |_| Command::Resume),
    (3, |_| Command::ToggleFeedHold),
    (2, |it| Command::SingleBlock(it.switch())),
    (1, |it| Command::OptionalStop(it.switch())),
    (3, |_| Command::Retrace),
    (4, |it| Command::FeedOverride(it.change(220.0))),
    (3, |it| Command::RapidOverride(it.change(110.0))),
    (8, |it| Command::Jog(it.jog())),
    (4, |it| Command::RenewJog(it.axis().1)),
    (1, |it| Command::EndJog(it.axis().1)),
    (1, |it| Command::JogStep(it.step())),
    (2, |it| Command::GoTo(it.positions())),
    (2, |it| Command::Load(it.program())),
    (4, |it| Command::Run {
        from_line: it.line(),
    }),
    (4, |it| Command::Mdi(it.mdi())),
    (1, |it| Command::SetWorkOffset(it.positions())),
    (1, |it| Command::SetToolLength(it.positions())),
    (3, |_| Command::Stop),
    (1, |it| {
        Command::Home(it.positions().map(|axis| axis.is_some()))
    }),
    (2, |_| Command::Enable),
    (2, |_| Command::Disable),
    (2, |_| Command::Reset),
    (2, |it| it.output()),
    (1, |_| Command::SwitchOff),
];

impl Drawing<'_> {
    fn switch(&mut self) -> SwitchChange {
        match self.dice.below(3) {
            0 => SwitchChange::To(true),
            1 => SwitchChange::To(false),
            _ => SwitchChange::Toggle,
        }
    }

    /// An output of the machine; now and then one that it does not have.
    fn output(&mut self) -> Command {
        let names = self.machine.outputs();
        let name = match names.is_empty() || self.dice.chance(0.05) {
            true => "none".to_owned(),
            false => self.dice.pick(&names).clone(),
        };
        let on = self.dice.chance(0.5);
        Command::Output { name, on }
    }

    fn change(&mut self, most: f64) -> Override {
        match self.dice.below(4) {
            0 => Override::To(0.0),
            1 => Override::To(100.0),
            2 => Override::To(rounded(self.dice.between(0.0, most), 1)),
            _ => Override::By(rounded(self.dice.between(-120.0, 120.0), 1)),
        }
    }

    fn step(&mut self) -> StepChange {
        match self.dice.below(3) {
            0 => StepChange::Greater,
            1 => StepChange::Smaller,
            _ => StepChange::To(self.dice.decades(-4, 2)),
        }
    }

    /// An axis of the machine; now and then one that it does not have.
    fn axis(&mut self) -> (usize, AxisLetter) {
        let place = self.dice.below(self.letters.len());
        let letter = match self.dice.chance(0.05) {
            true => *self.dice.pick(&AxisLetter::ALL),
            false => self.letters[place],
        };
        (place, letter)
    }

    fn direction(&mut self) -> Direction {
        *self.dice.pick(&[Direction::Positive, Direction::Negative])
    }

    fn speed(&mut self, axis: usize) -> Option<f64> {
        let most = self.machine.axes[axis].velocity;
        let part = *self.dice.pick(&[0.0, 0.01, 0.1, 0.5, 1.0, 10.0]);
        self.dice.chance(0.6).then_some(most * part)
    }

    /// Positions of some axes, most of them within the limits.
    fn positions(&mut self) -> [Option<f64>; COORDINATES] {
        let mut positions = [None; COORDINATES];
        for (axis, letter) in self.machine.axes.iter().zip(self.letters) {
            if self.dice.chance(0.5) {
                let [least, most] = axis.soft_limits;
                let beyond = if self.dice.chance(0.1) {
                    axis.travel
                } else {
                    0.0
                };
                let to = self.dice.between(least - beyond, most + beyond);
                positions[letter.index()] = Some(rounded(to, 4));
            }
        }
        positions
    }

    fn jog(&mut self) -> Jog {
        let (place, axis) = self.axis();
        let direction = self.direction();
        let speed = self.speed(place);
        let travel = self.machine.axes[place].travel;
        match self.dice.below(5) {
            0 => Jog::Step { axis, direction },
            1 => {
                let distance = travel * self.dice.decades(-3, 2);
                let distance = direction.of(distance);
                Jog::By {
                    axis,
                    distance,
                    speed,
                }
            }
            2 => Jog::Continuous {
                axis,
                direction,
                speed,
            },
            3 => Jog::To(self.positions()),
            _ => Jog::Line(self.positions()),
        }
    }

    /// A program's name; now and then of one that is not there.
    fn program(&mut self) -> PathBuf {
        let missing = usize::from(self.dice.chance(0.1));
        let place = self.dice.below(self.programs + missing);
        format!("{place}.ngc").into()
    }

    fn line(&mut self) -> Option<u32> {
        (self.dice.chance(0.2)).then(|| self.dice.whole(1..=40))
    }

    fn mdi(&mut self) -> String {
        let place = self.dice.below(self.letters.len());
        let axis = &self.machine.axes[place];
        let [least, most] = axis.soft_limits;
        let to = rounded(self.dice.between(least, most), 4).clamp(least, most);
        let feed = rounded(axis.velocity * 60.0 * self.dice.between(0.05, 2.0), 3).max(0.001);
        let letter = axis.letter;
        match self.dice.below(9) {
            0 | 1 => format!("G0 {letter}{to}"),
            2 | 3 => format!("G1 {letter}{to} F{feed}"),
            4 => format!("G1 {letter}{to} F{feed}\nG4 P0.05\nM0\nG0 {letter}{least}"),
            5 => "M3 S100".to_owned(),
            6 => (*self
                .dice
                .pick(&["M0", "G91", "G90", "T3 M6", "M64 P1", "G4 P0.2", "M2"]))
            .to_owned(),
            7 => format!("G1 {letter}"),
            _ => format!("G1 {letter}{} F{feed}", most + axis.travel),
        }
    }
}

/// Somebody who goes on where the machine rests, so that there is motion to interfere with: a case is
/// not to stand still from its first stop on.
#[derive(Debug)]
pub(super) struct Attendant {
    patience: u32,
    /// Waits longer where a fault has stopped the machine, or it was disabled.
    leave: u32,
    programs: usize,
    /// Which axes are homed.
    homed: [bool; COORDINATES],
    /// Wake-ups in the present state.
    since: u32,
    state: State,
    /// How often it went on.
    count: usize,
}

impl Attendant {
    /// Who waits for so many wake-ups, and for so many more where the machine is stopped by a fault, or disabled.
    pub(super) fn new(patience: u32, leave: u32, machine: &MachineSpec, programs: usize) -> Self {
        let mut homed = [false; COORDINATES];
        for (axis, letter) in machine.axes.iter().zip(letters(machine)) {
            homed[letter.index()] = axis.homing.is_some();
        }
        Self {
            patience,
            leave,
            programs,
            homed,
            since: 0,
            state: State::Off,
            count: 0,
        }
    }

    /// What there is to do in the state of a wake-up.
    pub(super) fn attend(
        &mut self,
        state: State,
        referenced: &[bool; COORDINATES],
    ) -> Vec<Command> {
        self.since = if state == self.state {
            self.since + 1
        } else {
            0
        };
        self.state = state;
        let leave = match state {
            State::Faulted | State::Disabled => self.leave,
            _ => 0,
        };
        if self.since < self.patience + leave {
            return Vec::new();
        }
        self.since = 0;
        self.count += 1;
        match state {
            State::Ready if referenced.contains(&false) => vec![
                Command::RapidOverride(Override::To(100.0)),
                Command::Home(self.homed),
            ],
            State::Ready => {
                let program = format!("{}.ngc", self.count % self.programs.max(1));
                vec![
                    Command::Load(program.into()),
                    Command::FeedOverride(Override::To(100.0)),
                    Command::RapidOverride(Override::To(100.0)),
                    Command::Run { from_line: None },
                ]
            }
            State::Held => vec![Command::Resume, Command::CycleStart],
            State::Faulted => vec![Command::Reset],
            State::Disabled => vec![Command::Enable],
            _ => Vec::new(),
        }
    }
}
