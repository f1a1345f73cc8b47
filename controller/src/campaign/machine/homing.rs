//! How gantries of a random machine are taken square, and homed, and how drives home by themselves.

use super::super::dice::{Dice, rounded};
use super::axis::{AxisSpec, digits};
use super::wires::{HOME, Wire};

/// Revolutions beyond the soft limits from which on a drive's limit switches are on, at the least and at the most: a drive counts from a
/// reference point that may be a turn and a half beside where the file has it.
const BEYOND: (f64, f64) = (3.0, 4.0);

/// Methods that search a limit switch.
const BY_LIMIT: [u8; 4] = [1, 2, 17, 18];

/// How wide a reference switch is, revolutions: either of its edges is near to where the file has it.
const WIDTH: f64 = 0.3;

/// Parts of a turn from the index that an edge may be at, so that no other index is taken for it.
const OFF_INDEX: (f64, f64) = (0.15, 0.55);

/// Rounding to whole turns a minute is all that an LXM32M takes of a speed; the slowest over an edge, 1/min.
const SLOWEST: f64 = 60.0;
/// From there an LXM32M halts in a second, by its ramp as delivered (6084h), 1/min.
const HALTS: f64 = 600.0;

impl AxisSpec {
    /// How far the sides of a gantry may be apart, mm.
    pub(super) fn skew_limit(&self) -> f64 {
        digits(0.1 * self.travel)
    }

    /// Has its sides be coupled: by loops that are stated to be so fast, 1/s, by a part of what they may be apart, and by a gain.
    pub(super) fn couple(&mut self, loops: f64, part: f64, gain: Option<f64>) {
        let limit = part * self.skew_limit();
        let gain = gain.map_or_else(String::new, |gain| format!(", gain = {}", rounded(gain, 3)));
        self.cross_coupling = Some(format!(
            "position_gain = {}, limit = {}{gain}",
            rounded(loops, 1),
            rounded(limit, 6)
        ));
    }

    /// A place inside the soft limits of a gantry where neither side is beyond them, as far as they are apart, mm.
    fn inside(&self, dice: &mut Dice, apart: f64) -> f64 {
        let [least, most] = self.soft_limits;
        let room = apart.abs().min(0.5 * (most - least));
        digits(dice.between(least + room, most - room)).clamp(least, most)
    }

    /// Has it stand there as it is switched on, the second side of a gantry so much further.
    fn stand(&mut self, start: f64, apart: f64) {
        let before = self.simulation.take().map_or(String::new(), |it| it + ", ");
        let skew = match apart {
            0.0 => String::new(),
            apart => format!(", start_skew = {apart:?}"),
        };
        self.simulation = Some(format!("{before}start = {start:?}{skew}"));
    }

    /// Has a gantry's sides stand apart as it is switched on; and of some have it be taken square by a homing: of absolute
    /// encoders, by a switch at each side, or where it is set.
    pub(super) fn home_gantry(&mut self, dice: &mut Dice) {
        let (skew, part) = (self.skew_limit(), dice.between(-0.9, 0.9));
        let most = digits(skew.max(self.travel * dice.between(0.1, 0.6)));
        let speed = digits(self.velocity * dice.between(0.02, 0.3));
        let order = dice.whole(1..=2);
        let square = format!("max_skew = {most}\nsquare_speed = {speed}");
        let jogs = format!(
            "order = {order}\njog_distance = {}",
            digits(2.0 * self.travel)
        );
        match dice.weighted(&[3, 2, 4, 1]) {
            0 => {
                let apart = digits(part * skew);
                let start = self.inside(dice, apart);
                self.stand(start, apart);
            }
            1 => {
                let apart = digits(part * most);
                let start = self.inside(dice, apart);
                self.stand(start, apart);
                self.homing = Some(format!("kind = \"encoder\"\n{square}"));
            }
            2 => self.search_switches(dice, most, part * most, &format!("{jogs}\n{square}")),
            _ => {
                let position = self.inside(dice, 0.0);
                self.homing = Some(format!(
                    "kind = \"set_here\"\nposition = {position}\n{jogs}\n{square}"
                ));
            }
        }
    }

    /// Has a switch at each side tell where a gantry is, if each of its drives has an input to spare: sides that are so far apart
    /// are looked for over that back-off.
    fn search_switches(&mut self, dice: &mut Dice, back_off: f64, apart: f64, keys: &str) {
        let (direction, end, away) = match dice.chance(0.5) {
            true => ("positive", self.soft_limits[1], -1.0),
            false => ("negative", self.soft_limits[0], 1.0),
        };
        let edge = digits(end - away * self.travel * dice.between(-0.5, 2.0));
        let start = digits(edge + away * self.travel * dice.between(-1.0, 8.0));
        let squareness = match dice.chance(0.5) {
            true => digits(back_off * dice.between(-0.5, 0.5)),
            false => 0.0,
        };
        let active_low = ["", "\nactive_low = true"][usize::from(dice.chance(0.3))];
        let latch = ["", "\nlatch = false"][usize::from(dice.chance(0.3))];
        let speed = digits(self.velocity * dice.between(0.1, 0.9));
        let slow_speed = digits(speed * dice.between(0.02, 0.3));
        let inside = self.inside(dice, back_off);
        let mut switches = Vec::new();
        let mut wires = Vec::new();
        for (side, drive) in self.drives.iter().enumerate() {
            let inputs = drive.model().map_or(&[][..], |model| model.inputs);
            let mut spare = drive.spare_inputs();
            if spare.is_empty() {
                return;
            }
            let place = spare.swap_remove(dice.below(spare.len()));
            let edge = edge + if side == 1 { squareness } else { 0.0 };
            // On to the end of the travel.
            let beyond = digits(edge - away * 1000.0 * self.travel);
            let [from, to] = [edge.min(beyond), edge.max(beyond)];
            switches.push(format!("\"{} {}\"", self.drive_name(side), inputs[place]));
            wires.push(Wire {
                table: "input".to_owned(),
                place: place as u8,
                signal: inputs[place].to_owned(),
                meaning: format!("{HOME}{active_low}\nsimulated = [{from}, {to}]"),
            });
        }
        for (drive, wire) in self.drives.iter_mut().zip(wires) {
            drive.wires.push(wire);
        }
        self.homing = Some(format!(
            "kind = \"switch\"\nswitches = [{}]\ndirection = \"{direction}\"\nspeed = {speed}\nslow_speed = {slow_speed}\n\
             back_off = {back_off}\nposition = {edge}\nfinal_position = {inside}\nsquareness = {squareness}\n{keys}{latch}",
            switches.join(", "),
        ));
        self.stand(start, digits(apart));
    }

    /// Has its drive home by itself, if it has methods for that: by a limit switch, a reference switch or an index pulse, or where it
    /// stands.
    pub(super) fn home_by_drive(&mut self, dice: &mut Dice) {
        let methods = self.drives[0]
            .model()
            .map_or(&[][..], |it| it.homing_methods);
        if methods.is_empty() {
            return;
        }
        // One that is cut off on the limit switch that it searches is stopped by an error of its own.
        let methods = methods.iter().filter(|it| !BY_LIMIT.contains(*it));
        let methods: Vec<u8> = methods.copied().collect();
        let method = *dice.pick(&methods);
        let [least, most] = self.soft_limits;
        let beyond = |dice: &mut Dice| self.travel * dice.between(BEYOND.0, BEYOND.1);
        let [lower, upper] = [least - beyond(dice), most + beyond(dice)];
        let limits = [self.off_index(dice, lower), self.off_index(dice, upper)];
        let switch = dice.between(least, most);
        let switch = self.off_index(dice, switch);
        let to = switch + WIDTH * self.travel;
        // It sets off towards its switch, in its own direction: a limit switch is where it turns if it misses that.
        let upwards = matches!(method, 7..=10 | 23..=26) != self.drives[0].negative;
        let away = if upwards { -1.0 } else { 1.0 };
        let start = match method {
            33.. => switch,
            _ => switch + away * self.travel * dice.between(-0.2, 2.5),
        };
        let fastest = 60.0 * self.velocity / self.travel;
        let speed = (fastest * dice.between(0.1, 0.6)).floor();
        let speed = speed.clamp(SLOWEST, HALTS);
        let slow_speed = (speed * dice.between(0.1, 0.3)).floor().max(SLOWEST);
        let [speed, slow_speed] = [speed, slow_speed].map(|it| it * self.travel / 60.0);
        let (order, jogs) = (dice.whole(1..=2), digits(2.0 * self.travel));
        let inside = digits(dice.between(least, most)).clamp(least, most);
        self.homing = Some(format!(
            "kind = \"drive\"\nmethod = {method}\nspeed = {speed:?}\nslow_speed = {slow_speed:?}\nposition = {switch:?}\n\
             final_position = {inside}\nmax_distance = {:?}\norder = {order}\njog_distance = {jogs}",
            2.0 * (upper - lower),
        ));
        self.stand(start.clamp(limits[0], limits[1]), 0.0);
        let keys = format!(
            "reference_switch = [{switch:?}, {to:?}], limit_switches = [{:?}, {:?}]",
            limits[0], limits[1]
        );
        self.move_too(&keys);
    }

    /// A place near that one, mm, which is not near to an index of its drive's encoder.
    fn off_index(&self, dice: &mut Dice, place: f64) -> f64 {
        let drive = &self.drives[0];
        let sign = if drive.negative { -1.0 } else { 1.0 };
        let zero = drive
            .indexed()
            .map_or(0.0, |turn| f64::from(drive.zero) / turn);
        let turns = (zero + sign * place / self.travel).floor();
        sign * (turns + dice.between(OFF_INDEX.0, OFF_INDEX.1) - zero) * self.travel
    }
}
