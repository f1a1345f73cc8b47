//! Axes of a random machine, with their drives and encoders.

use super::super::dice::{Dice, rounded};
use super::mechanics::{ErrorSpec, TransmissionSpec, WarmthSpec};
use super::wires::{HOME, Wire};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::ops::RangeInclusive;
use syncline_drives::model::{Ability, Address, Assumed, MODELS, Model};

/// Quick stop ramps: CiA 402's, increments/s², and an LXM32M's, r/(min·s). As a drive leaves the factory it may be steeper than many a
/// motor can follow, or not as steep as the plan of its axis, which stands beyond its soft limit then. So who sets up a machine writes what the
/// axis takes, where the controller does not.
const CIA402_RAMP: Address = Address::new(0x6085, 0);
const LXM32M_RAMP: Address = Address::new(0x3006, 0x12);

/// A stepper controller, and what is written to it: its motor's current, mA, which is 400 mA after each power-on.
pub(super) const STEPPER: &str = "tsp10";
const STEPPER_SDO: &str = "[\"6075:0\", 5000]";

/// What has an LXM32M be enabled that stands on its limit switch, as one that was stopped on its way home may.
const ON_LIMIT_SWITCH: &str = "[\"3006:6\", 1]";

/// An axis of one drive, or a gantry of two.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisSpec {
    /// Its letter.
    pub letter: char,
    /// Travel for one revolution of the motor, mm or degrees.
    pub travel: f64,
    /// mm/s.
    pub velocity: f64,
    /// mm/s².
    pub acceleration: f64,
    /// mm/s³.
    pub jerk: f64,
    /// Least and greatest position, mm.
    pub soft_limits: [f64; 2],
    /// Whether the drives supervise following error and soft limits too.
    pub supervised: bool,
    /// One, or two.
    pub drives: Vec<DeviceSpec>,
    /// What the file says of what its drives move: the inside of `simulation`.
    pub simulation: Option<String>,
    /// What its drives are sent of the torque that the plan takes: the inside of `feed_forward`.
    #[serde(default)]
    pub feed_forward: Option<String>,
    /// How it is homed: the inside of `homing`. Its encoders are absolute if there is none.
    #[serde(default)]
    pub homing: Option<String>,
    /// What says where it is, beside its drives.
    #[serde(default)]
    pub encoder: Option<EncoderSpec>,
    /// It goes point to point.
    #[serde(default)]
    pub goes: bool,
    /// For how long its position may be missing, where the controller closes a loop about it, ms.
    #[serde(default)]
    pub position_loss: Option<u32>,
    /// What its setpoints are corrected by.
    #[serde(default)]
    pub corrected: Option<ErrorSpec>,
    /// How its sides are coupled: the inside of `cross_coupling`.
    #[serde(default)]
    pub cross_coupling: Option<String>,
    /// What is between its motors and its carriage.
    #[serde(default)]
    pub transmission: Option<TransmissionSpec>,
    /// How warm that is.
    #[serde(default)]
    pub warmth: Option<WarmthSpec>,
    /// Hardware stops it where the controller is gone.
    #[serde(default)]
    pub stopped_by_hardware: bool,
}

/// An encoder of an axis, by CiA 406.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EncoderSpec {
    /// Its place among the buses.
    pub bus: usize,
    /// Its node id.
    pub node: u8,
    /// How far the axis moves for a revolution of its shaft, mm or degrees.
    pub pitch: f64,
    /// It counts the other way.
    pub negative: bool,
    /// What it counts at machine position 0.
    pub zero: u32,
    /// How far it and the drives may be apart, mm or degrees.
    pub difference: f64,
    /// It is what the controller closes the position loop by.
    #[serde(default)]
    pub closes_loop: bool,
}

/// A drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceSpec {
    /// Its place among the buses.
    pub bus: usize,
    /// Its node id.
    pub node: u8,
    /// The name of its model.
    pub model: String,
    /// Its encoder counts the other way.
    pub negative: bool,
    /// What its encoder counts at machine position 0.
    pub zero: i32,
    /// What is wired to its inputs and outputs.
    #[serde(default)]
    pub wires: Vec<Wire>,
}

/// What a machine file says of the resolution of generic drives.
const RESOLUTION: &str = "encoder_increments";

/// What the tables of models say of a key of one of them.
fn stated(models: &[String], model: &str, key: &str) -> Option<u32> {
    let head = format!("[model.{model}]");
    let tables = models.iter().map(|table| table.lines());
    let mut tables = tables.filter(|lines| lines.clone().next() == Some(&head));
    let mut lines = tables.next()?;
    lines.find_map(|line| {
        let (name, value) = line.split_once(" = ")?;
        value.parse().ok().filter(|_| name == key)
    })
}

/// Node ids that an encoder, a TWK CRN, can have.
pub(super) const ENCODER_NODES: RangeInclusive<u32> = 1..=64;

impl EncoderSpec {
    /// One on an axis with that travel for a revolution of its motor, on one of so many buses.
    pub(super) fn draw(dice: &mut Dice, buses: usize, travel: f64) -> Self {
        Self {
            bus: dice.below(buses),
            node: dice.whole(ENCODER_NODES) as u8,
            pitch: digits(travel * dice.between(0.3, 4.0)),
            negative: dice.chance(0.5),
            zero: dice.whole(0..=100_000),
            difference: digits(travel * dice.between(0.15, 1.0)),
            closes_loop: false,
        }
    }

    fn write(&self, name: &str, text: &mut String) {
        let Self {
            bus,
            node,
            pitch,
            zero,
            ..
        } = self;
        let direction = direction(self.negative);
        let _ = write!(
            text,
            "\n[[encoder]]\nname = \"{name}\"\nbus = \"bus{bus}\"\nnode = {node}\nmodel = \"twk_crn\"\n\
             pitch = {pitch}\ndirection = \"{direction}\"\nzero = {zero}\n"
        );
    }
}

impl DeviceSpec {
    pub(super) fn model(&self) -> Option<&'static Model> {
        MODELS
            .iter()
            .find(|model| model.name == self.model)
            .copied()
    }

    /// The numbers of inputs to which nothing is wired.
    pub(super) fn spare_inputs(&self) -> Vec<usize> {
        let inputs = self.model().map_or(&[][..], |model| model.inputs);
        let used = |place: usize| {
            let mut inputs = self.wires.iter().filter(|wire| wire.table == "input");
            inputs.any(|wire| usize::from(wire.place) == place)
        };
        (0..inputs.len()).filter(|place| !used(*place)).collect()
    }

    /// What it counts in a revolution, if that is a whole number of turns at its index, and its maker's to say and not the
    /// machine file's.
    pub(super) fn indexed(&self) -> Option<f64> {
        let model = self.model()?;
        let counts = model.maker.is_some() && model.abilities.contains(&Ability::CountsWithinTurn);
        counts.then(|| (model.increments_per_revolution)(&Assumed::default()).into())
    }

    /// Its quick stop ramp, if that is for a user to set, and how many of its units are a revolution/s²: of a machine that says this of models.
    fn ramp(&self, models: &[String]) -> Option<(Address, f64)> {
        let model = self.model()?;
        let is_users = |ramp: Address| {
            let mut entries = model.dictionary.iter();
            entries.any(|entry| entry.address == ramp) && !(model.reserved)(ramp)
        };
        let increments = || {
            let assumed = stated(models, model.name, RESOLUTION);
            let assumed = Assumed(assumed.map(|it| (RESOLUTION, it)).into_iter().collect());
            f64::from((model.increments_per_revolution)(&assumed))
        };
        match () {
            () if is_users(CIA402_RAMP) => Some((CIA402_RAMP, increments())),
            () if is_users(LXM32M_RAMP) => Some((LXM32M_RAMP, 60.0)),
            () => None,
        }
    }
}

impl AxisSpec {
    /// An axis whose drives have these buses and models.
    ///
    /// Limits are drawn at the motor, where a drive can follow them, and carried over to the axis by
    /// a travel per revolution between micrometres and metres, so that axes of one machine differ by
    /// decades.
    pub(super) fn draw(
        dice: &mut Dice,
        letter: char,
        cycle_us: u32,
        places: &mut Vec<(usize, &str)>,
    ) -> Self {
        let period = f64::from(cycle_us) * 1e-6;
        let travel = if dice.chance(0.6) {
            f64::from(dice.whole(1..=40))
        } else {
            dice.decades(-2, 3)
        };
        // Between two setpoints a drive interpolates: what changes much within a cycle it cannot follow.
        let velocity = dice.between(3.0, 45.0);
        let acceleration = dice.between(10.0, 400.0).min(0.6 / period);
        let jerk = acceleration * dice.between(2.0, 40.0).min(0.2 / period);
        let span = dice.between(5.0, 200.0);
        let least = match dice.weighted(&[3, 3, 1]) {
            0 => 0.0,
            1 => -span * dice.between(0.0, 1.0),
            _ => dice.between(-500.0, 500.0),
        };
        let drives = places.drain(..).enumerate().map(|(side, (bus, model))| {
            let revolutions = dice.between(-600.0, 600.0);
            DeviceSpec {
                bus,
                node: dice.whole(1..=126) as u8,
                model: model.to_owned(),
                negative: side == 1 || dice.chance(0.3),
                zero: (revolutions * 131_072.0) as i32,
                wires: Vec::new(),
            }
        });
        Self {
            letter,
            travel,
            velocity: digits(velocity * travel),
            acceleration: digits(acceleration * travel),
            jerk: digits(jerk * travel),
            drives: drives.collect(),
            soft_limits: [digits(least * travel), digits((least + span) * travel)],
            supervised: dice.chance(0.5),
            simulation: dice.chance(0.15).then(|| Self::simulation(dice)),
            feed_forward: None,
            homing: None,
            encoder: None,
            goes: false,
            position_loss: None,
            corrected: None,
            cross_coupling: None,
            transmission: None,
            warmth: None,
            stopped_by_hardware: false,
        }
    }

    /// Whether its one drive may be another one: nothing is wired to it, and the axis is not homed.
    pub(super) fn is_plain(&self) -> bool {
        let is_free = |drive: &DeviceSpec| drive.wires.is_empty();
        self.drives.len() == 1 && self.homing.is_none() && self.drives.iter().all(is_free)
    }

    /// Has its drive be of that model, which does not watch it.
    pub(super) fn take_drive(&mut self, model: &str) {
        self.drives[0].model = model.to_owned();
        self.supervised = false;
    }

    /// Has it be moved by a stepping motor, which counts from where it is switched on, and has to be slow.
    pub(super) fn take_stepper(&mut self) {
        self.take_drive(STEPPER);
        self.drives[0].zero = 0;
        self.simulation = None;
        self.velocity = self.velocity.min(digits(6.0 * self.travel));
        self.acceleration = self.acceleration.min(digits(40.0 * self.travel));
    }

    /// A feed axis that a motor is at ease with.
    fn simulation(dice: &mut Dice) -> String {
        let motor = dice.pick(&["generic-3", "generic-6", "generic-12"]);
        format!("motor = \"{motor}\"")
    }

    /// Has drives that can be sent torques be sent them: of an axis of which somebody knows not quite what it takes.
    pub(super) fn send_torques(&mut self, dice: &mut Dice) {
        let (asked, inertia) = (dice.chance(0.4), dice.between(1e-4, 6e-4));
        let friction = dice.between(0.0, 0.1);
        if !asked || !self.takes_torques() {
            return;
        }
        let rated = self.motor().continuous_torque;
        self.feed_forward = Some(format!(
            "rated_torque = {rated:?}, inertia = {}, coulomb_friction = {}",
            rounded(inertia, 6),
            rounded(friction, 3)
        ));
    }

    /// Has it be homed: where it is set, or, if its drive has an input to spare, by a switch.
    pub(super) fn home(&mut self, dice: &mut Dice) {
        let [least, most] = self.soft_limits;
        let inside = digits(dice.between(least, most)).clamp(least, most);
        // Two revolutions: ten millimetres are a thousand of some motors.
        let order = dice.whole(1..=2);
        let jogs = format!(
            "order = {order}\njog_distance = {}",
            digits(2.0 * self.travel)
        );
        let name = self.drive_name(0);
        let drive = &mut self.drives[0];
        let inputs = drive.model().map_or(&[][..], |model| model.inputs);
        let spare = drive.spare_inputs();
        if spare.is_empty() || dice.chance(0.3) {
            self.homing = Some(format!("kind = \"set_here\"\nposition = {inside}\n{jogs}"));
            return;
        }
        let place = *dice.pick(&spare);
        let (direction, end, away) = match dice.chance(0.5) {
            true => ("positive", most, -1.0),
            false => ("negative", least, 1.0),
        };
        let edge = digits(end - away * self.travel * dice.between(-0.5, 2.0));
        let start = digits(edge + away * self.travel * dice.between(-1.0, 8.0));
        let active_low = ["", "\nactive_low = true"][usize::from(dice.chance(0.3))];
        // On to the end of the travel.
        let beyond = digits(edge - away * 1000.0 * self.travel);
        let [from, to] = [edge.min(beyond), edge.max(beyond)];
        drive.wires.push(Wire {
            table: "input".to_owned(),
            place: place as u8,
            signal: inputs[place].to_owned(),
            meaning: format!("{HOME}{active_low}\nsimulated = [{from}, {to}]"),
        });
        let speed = digits(self.velocity * dice.between(0.1, 0.9));
        let slow_speed = digits(speed * dice.between(0.02, 0.3));
        let latch = ["", "\nlatch = false"][usize::from(dice.chance(0.3))];
        self.homing = Some(format!(
            "kind = \"switch\"\nswitches = [\"{name} {}\"]\ndirection = \"{direction}\"\n\
             speed = {speed}\nslow_speed = {slow_speed}\nback_off = {}\nposition = {edge}\n\
             final_position = {inside}\n{jogs}{latch}",
            inputs[place],
            digits(self.travel * dice.between(0.05, 1.0)),
        ));
        let before = self.simulation.take().map_or(String::new(), |it| it + ", ");
        self.simulation = Some(format!("{before}start = {start}"));
    }

    /// Has the index behind the switch that it is homed by tell its place, where neither that nor the one before it is near
    /// to the edge.
    pub(super) fn take_index(&mut self) {
        let [drive] = &self.drives[..] else {
            return;
        };
        let Some(turn) = drive.indexed() else {
            return;
        };
        let homing = self.homing.as_mut();
        let Some(homing) = homing.filter(|it| it.starts_with("kind = \"switch\"")) else {
            return;
        };
        let edge = homing
            .lines()
            .find_map(|it| it.strip_prefix("position = ")?.parse::<f64>().ok());
        let Some(edge) = edge else {
            return;
        };
        let sign = if drive.negative { -1.0 } else { 1.0 };
        let zero = f64::from(drive.zero) / turn;
        let revolutions = zero + sign * edge / self.travel;
        let grows = homing.contains("direction = \"positive\"") != drive.negative;
        let index = if grows {
            revolutions.ceil()
        } else {
            revolutions.floor()
        };
        if (0.15..0.85).contains(&(index - revolutions).abs()) {
            let place = sign * (index - zero) * self.travel;
            let [by_edge, by_index] = [
                format!("\nposition = {edge}\n"),
                format!("\nposition = {place}\nindex = true\n"),
            ];
            *homing = homing.replace(&by_edge, &by_index);
        }
    }

    /// Following error that is a fault, mm.
    #[must_use]
    pub fn following_error(&self) -> f64 {
        digits(0.25 * self.travel)
    }

    /// Whether its mm are degrees.
    pub(super) fn is_rotary(&self) -> bool {
        matches!(self.letter, 'A' | 'B' | 'C')
    }

    /// Whether its drive homes by itself.
    fn homes_by_drive(&self) -> bool {
        let homing = self.homing.as_deref().unwrap_or_default();
        homing.starts_with("kind = \"drive\"")
    }

    /// What the machine file calls one of its drives.
    pub(super) fn drive_name(&self, side: usize) -> String {
        format!("{}{}", self.letter, side + 1)
    }

    /// What it calls its encoder.
    fn encoder_name(&self) -> String {
        format!("beside {}", self.letter)
    }

    /// As the machine file has it, which says this of models.
    pub(super) fn write(&self, models: &[String], text: &mut String) {
        self.write_drives(models, text);
        if let Some(encoder) = &self.encoder {
            encoder.write(&self.encoder_name(), text);
        }
        self.write_axis(text);
    }

    fn write_drives(&self, models: &[String], text: &mut String) {
        let name = |side: usize| self.drive_name(side);
        for (side, drive) in self.drives.iter().enumerate() {
            let direction = direction(drive.negative);
            let _ = write!(
                text,
                "\n[[drive]]\nname = \"{}\"\nbus = \"bus{}\"\nnode = {}\nmodel = \"{}\"\n\
                 direction = \"{direction}\"\nzero = {}\n",
                name(side),
                drive.bus,
                drive.node,
                drive.model,
                drive.zero
            );
            let mut written = Vec::new();
            if self.homes_by_drive() {
                written.push(ON_LIMIT_SWITCH.to_owned());
            }
            if drive.model == STEPPER {
                written.push(STEPPER_SDO.to_owned());
            }
            if let Some((Address { index, sub }, units)) = drive.ramp(models) {
                let ramp = (self.acceleration / self.travel * units).ceil();
                written.push(format!("[\"{index:04X}:{sub:X}\", {ramp}]"));
            }
            if !written.is_empty() {
                let _ = writeln!(text, "sdo = [{}]", written.join(", "));
            }
            for wire in &drive.wires {
                wire.write("drive", &name(side), text);
            }
        }
    }

    fn write_axis(&self, text: &mut String) {
        let names: Vec<String> = (0..self.drives.len())
            .map(|side| format!("\"{}\"", self.drive_name(side)))
            .collect();
        let (pitch, gear) = match self.is_rotary() {
            true => (360.0, 360.0 / self.travel),
            false => (self.travel, 1.0),
        };
        let [least, most] = self.soft_limits;
        let following_error = self.following_error();
        let _ = write!(
            text,
            "\n[[axis]]\nname = \"{}\"\ndrives = [{}]\npitch = {pitch}\ngear = {gear}\n\
             max_velocity = {}\nmax_acceleration = {}\nmax_jerk = {}\nsoft_limits = [{least}, {most}]\n\
             following_error_limit = {following_error}\nstandstill_window = {}\n\
             drive_following_error = {supervised}\n",
            self.letter,
            names.join(", "),
            self.velocity,
            self.acceleration,
            self.jerk,
            digits(0.02 * self.travel),
            supervised = self.supervised,
        );
        if let Some(encoder) = &self.encoder {
            let _ = writeln!(
                text,
                "feedback = \"{}\"\ndifference_limit = {}",
                self.encoder_name(),
                encoder.difference
            );
            if encoder.closes_loop {
                text.push_str("position_loop = \"encoder\"\n");
            }
        }
        if self.goes {
            text.push_str("motion = \"point_to_point\"\n");
        }
        if self.stopped_by_hardware {
            text.push_str("unsupervised_stop = \"hardware\"\n");
        }
        if let Some(ms) = self.position_loss {
            let _ = writeln!(text, "position_loss_ms = {ms}");
        }
        // The drives of an axis that is homed do not know its machine positions.
        if self.homing.is_none() {
            let _ = writeln!(text, "drive_soft_limits = {}", self.supervised);
        }
        if self.drives.len() == 2 {
            let _ = writeln!(text, "skew_limit = {}", self.skew_limit());
        }
        if let Some(inside) = &self.feed_forward {
            let _ = writeln!(text, "feed_forward = {{ {inside} }}");
        }
        if let Some(errors) = &self.corrected {
            errors.write(text);
        }
        if let Some(inside) = &self.cross_coupling {
            let _ = writeln!(text, "cross_coupling = {{ {inside} }}");
        }
        let inside = [self.simulation.clone(), self.between()];
        let inside: Vec<String> = inside.into_iter().flatten().collect();
        if !inside.is_empty() {
            let _ = writeln!(text, "simulation = {{ {} }}", inside.join(", "));
        }
        if let Some(inside) = &self.homing {
            let _ = writeln!(text, "\n[axis.homing]\n{inside}");
        }
    }
}

/// Which way an encoder counts, as a machine file says it.
fn direction(negative: bool) -> &'static str {
    if negative { "negative" } else { "positive" }
}

/// A number as people write it: to four digits or so.
pub(super) fn digits(value: f64) -> f64 {
    let magnitude = value.abs();
    let decimals = [1000.0, 100.0, 10.0, 1.0, 0.1, 0.01];
    let decimals = decimals.iter().filter(|it| magnitude < **it).count();
    rounded(value, decimals)
}
