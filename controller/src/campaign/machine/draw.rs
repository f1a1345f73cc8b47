//! A machine at random: drawn until it fits its buses, and given what some machines have, as far as it still fits.

use super::axis::{ENCODER_NODES, STEPPER};
use super::wires::{INPUTS, Meanings, OUTPUTS};
use super::{AxisSpec, EncoderSpec, IoSpec, MachineSpec, ShaperSpec, SpindleSpec, Wire};
use crate::campaign::dice::{Dice, rounded};
use std::fmt::Write as _;
use std::time::Duration;
use syncline_drives::model::{MODELS, Setpoints};

/// Letters of axes, in the order in which a small machine has them.
const LETTERS: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// Cycles that are drawn, µs.
const CYCLES: [u32; 8] = [1000, 2000, 2000, 3000, 4000, 5000, 10_000, 20_000];

/// Bit rates that are drawn, bit/s: slower buses hold no cycle of two drives.
const BIT_RATES: [u32; 3] = [1_000_000, 500_000, 250_000];

/// The model, beside the stepper, whose axes go point to point, and the shortest cycle that both take, µs.
const GOER: &str = "tlc5xx";
const LEAST_CYCLE: u32 = 2000;

/// Axes that programs move along arcs and into holes.
const PATH: [char; 3] = ['X', 'Y', 'Z'];

/// A key of a model's table, and values of it.
type Key = (&'static str, &'static [u32]);

/// What makers of generic drives do in their own way, by the model's own keys and by those of all.
const GENERIC: [(&str, &[Key]); 3] = [
    (
        "cia402_csp",
        &[("mode", &[7, 8]), ("tells_following", &[0, 1])],
    ),
    (
        "cia402_csv",
        &[
            ("interpolates", &[0, 1]),
            ("tells_following", &[0, 1]),
            ("velocity_units", &[0, 1, 10, 1000]),
        ],
    ),
    ("cia402_pv", &[("velocity_units", &[0, 1, 10, 1000])]),
];
const COMMON: [Key; 4] = [
    ("encoder_increments", &[16_384, 65_536, 1_048_576]),
    ("r_pdo", &[1, 2, 3, 4]),
    ("t_pdo", &[1, 2, 3, 4]),
    ("pdos", &[2, 4]),
];

/// Draws of a machine until one fits its buses; then the simplest one is taken.
const DRAWS: usize = 40;

/// The greatest travel of a carriage that runs along a beam, mm.
const WIDEST: f64 = 5000.0;

/// Errors of a transmission are halved as often, until they leave the plan enough.
const HALVINGS: u32 = 8;

impl MachineSpec {
    /// The machine of a seed, with all that it has.
    pub(in crate::campaign) fn of(seed: u64) -> Self {
        let mut machine = Self::draw(&mut Dice::new(seed, 0));
        machine.wire(&mut Dice::new(seed, 5));
        machine.equip(&mut Dice::new(seed, 9));
        machine.home(&mut Dice::new(seed, 10));
        machine.square(&mut Dice::new(seed, 34));
        machine.home_by_drives(&mut Dice::new(seed, 35));
        machine.watch(&mut Dice::new(seed, 11));
        machine.shape(&mut Dice::new(seed, 13));
        machine.stream(&mut Dice::new(seed, 14));
        machine.step(&mut Dice::new(seed, 40));
        machine.describe(&mut Dice::new(seed, 15));
        machine.measure(&mut Dice::new(seed, 17));
        machine.turn(&mut Dice::new(seed, 19));
        machine.take_indices(&mut Dice::new(seed, 23));
        machine.send_torques(&mut Dice::new(seed, 29));
        machine.weigh(&mut Dice::new(seed, 30));
        machine.err(&mut Dice::new(seed, 31));
        machine.choose_method(&mut Dice::new(seed, 32));
        machine.warm(&mut Dice::new(seed, 38));
        machine.tie(&mut Dice::new(seed, 39));
        machine.couple(&mut Dice::new(seed, 42));
        machine.stop_together = Dice::new(seed, 33).chance(0.2);
        machine
    }

    /// A random machine that fits its buses.
    pub(in crate::campaign) fn draw(dice: &mut Dice) -> Self {
        for _ in 0..DRAWS {
            let spec = Self::any(dice);
            if spec.fits() {
                return spec;
            }
        }
        Self {
            cycle_us: 4000,
            t_pdo_misses: 2,
            tolerances: [0.001, 0.01],
            buses: vec![1_000_000],
            axes: vec![AxisSpec::draw(
                dice,
                'X',
                4000,
                &mut vec![(0, MODELS[0].name)],
            )],
            io_nodes: Vec::new(),
            shaper: None,
            models: Vec::new(),
            spindle: None,
            stop_together: false,
        }
    }

    /// A random one, whether it fits or not.
    fn any(dice: &mut Dice) -> Self {
        let cycle_us = *dice.pick(&CYCLES);
        // Small machines are most: they are quick, and most of what goes wrong needs no more.
        let count = match dice.weighted(&[4, 4, 2]) {
            0 => dice.whole(1..=3),
            1 => dice.whole(3..=5),
            _ => dice.whole(6..=9),
        };
        let buses = 1 + dice.weighted(&[6, 3, 1]).min(count as usize - 1);
        let buses: Vec<u32> = (0..buses)
            .map(|_| BIT_RATES[dice.weighted(&[6, 2, 1])])
            .collect();
        let mut letters = LETTERS.to_vec();
        if dice.chance(0.3) {
            for place in (1..letters.len()).rev() {
                letters.swap(place, dice.below(place + 1));
            }
        }
        // Most machines have one maker's drives, and those of all are sent positions.
        let period = Duration::from_micros(cycle_us.into());
        let models: Vec<&str> = MODELS
            .iter()
            .filter(|model| model.is_sent(Setpoints::Positions) && model.takes_cycle(period))
            .map(|model| model.name)
            .collect();
        let mixed = dice.chance(0.4);
        let main = MODELS[0].name;
        let axes = letters[..count as usize].iter().map(|&letter| {
            let gantry = dice.chance(0.15);
            let model = if mixed { *dice.pick(&models) } else { main };
            let drives = if gantry { 2 } else { 1 };
            let mut places: Vec<_> = (0..drives)
                .map(|_| (dice.below(buses.len()), model))
                .collect();
            AxisSpec::draw(dice, letter, cycle_us, &mut places)
        });
        let axes = axes.collect();
        let mut spec = Self {
            cycle_us,
            t_pdo_misses: *dice.pick(&[2, 2, 2, 1, 3]),
            tolerances: [dice.decades(-4, -1), dice.decades(-3, 0)],
            buses,
            axes,
            io_nodes: Vec::new(),
            shaper: None,
            models: Vec::new(),
            spindle: None,
            stop_together: false,
        };
        spec.number(dice);
        spec
    }

    /// Gives the drives node ids of their own, and leaves out buses without any.
    fn number(&mut self, dice: &mut Dice) {
        let mut used = Vec::new();
        for drive in self.axes.iter_mut().flat_map(|axis| &mut axis.drives) {
            while used.contains(&(drive.bus, drive.node)) {
                drive.node = dice.whole(1..=126) as u8;
            }
            used.push((drive.bus, drive.node));
        }
        self.leave_out_unused_buses();
    }

    /// Leaves out buses without drives.
    pub(in crate::campaign) fn leave_out_unused_buses(&mut self) {
        for bus in (0..self.buses.len()).rev() {
            let drives = || self.axes.iter().flat_map(|axis| &axis.drives);
            if self.buses.len() > 1 && !drives().any(|drive| drive.bus == bus) {
                self.buses.remove(bus);
                for io in self.io_nodes.iter_mut().filter(|io| io.bus >= bus) {
                    io.bus = io.bus.saturating_sub(1);
                }
                if let Some(spindle) = self.spindle.as_mut().filter(|it| it.bus >= bus) {
                    spindle.bus = spindle.bus.saturating_sub(1);
                }
                let encoders = self.axes.iter_mut().filter_map(|it| it.encoder.as_mut());
                for encoder in encoders.filter(|encoder| encoder.bus >= bus) {
                    encoder.bus = encoder.bus.saturating_sub(1);
                }
                let drives = self.axes.iter_mut().flat_map(|axis| &mut axis.drives);
                for drive in drives.filter(|drive| drive.bus > bus) {
                    drive.bus -= 1;
                }
            }
        }
    }

    /// Wires some of its drives' inputs and outputs, where the buses have room for what they carry then.
    pub(in crate::campaign) fn wire(&mut self, dice: &mut Dice) {
        if !dice.chance(0.35) {
            return;
        }
        let mut wired = self.clone();
        let (mut inputs, mut outputs) = (Meanings::of(INPUTS), Meanings::of(OUTPUTS));
        for drive in wired.axes.iter_mut().flat_map(|axis| &mut axis.drives) {
            let Some(model) = drive.model() else { continue };
            for (table, signals, meanings) in [
                ("input", model.inputs, &mut inputs),
                ("output", model.outputs, &mut outputs),
            ] {
                for (place, signal) in signals.iter().enumerate() {
                    if dice.chance(0.25) {
                        drive.wires.push(Wire {
                            table: table.to_owned(),
                            place: place as u8,
                            signal: (*signal).to_owned(),
                            meaning: meanings.draw(dice),
                        });
                    }
                }
            }
        }
        self.take_if_it_fits(wired);
    }

    /// Gives some machines an I/O node or two, where the buses have room for what they carry then.
    fn equip(&mut self, dice: &mut Dice) {
        if !dice.chance(0.3) {
            return;
        }
        let mut equipped = self.clone();
        let words = dice.chance(0.3);
        for place in 0..dice.whole(1..=2) {
            let bus = dice.below(self.buses.len());
            let io = IoSpec::draw(dice, bus, words, place as u8);
            equipped.io_nodes.push(io);
        }
        let mut used: Vec<_> = self.nodes().collect();
        for io in &mut equipped.io_nodes {
            while used.contains(&(io.bus, io.node)) {
                io.node = dice.whole(1..=126) as u8;
            }
            used.push((io.bus, io.node));
        }
        self.take_if_it_fits(equipped);
    }

    /// Wires analog inputs to some I/O nodes, where the buses have room for what they tell.
    fn measure(&mut self, dice: &mut Dice) {
        let mut measuring = self.clone();
        for (place, io) in measuring.io_nodes.iter_mut().enumerate() {
            io.measure(dice, place as u8);
        }
        self.take_if_it_fits(measuring);
    }

    /// Has a drive turn the spindle of some machines, where the buses have room for it.
    fn turn(&mut self, dice: &mut Dice) {
        if !dice.chance(0.25) {
            return;
        }
        let period = Duration::from_micros(self.cycle_us.into());
        let models = MODELS.iter();
        let models = models.filter(|it| it.turns_spindles() && it.takes_cycle(period));
        let models: Vec<&str> = models.map(|model| model.name).collect();
        if models.is_empty() {
            return;
        }
        let mut spindle = SpindleSpec {
            bus: dice.below(self.buses.len()),
            node: dice.whole(1..=126) as u8,
            model: (*dice.pick(&models)).to_owned(),
            ramp_ms: *dice.pick(&[100, 300, 1500]),
        };
        while self.nodes().any(|used| used == (spindle.bus, spindle.node)) {
            spindle.node = dice.whole(1..=126) as u8;
        }
        let turned = Self {
            spindle: Some(spindle),
            ..self.clone()
        };
        self.take_if_it_fits(turned);
    }

    /// Has some machines home axes of one drive: where they are set, or by a switch that is searched.
    fn home(&mut self, dice: &mut Dice) {
        if !dice.chance(0.25) {
            return;
        }
        let mut homed = self.clone();
        for axis in homed.axes.iter_mut().filter(|axis| axis.drives.len() == 1) {
            if dice.chance(0.6) {
                axis.home(dice);
            }
        }
        self.take_if_it_fits(homed);
    }

    /// Changes one axis after the other, each where the machine is still good with it.
    fn change_each(&mut self, mut change: impl FnMut(&mut AxisSpec)) {
        for place in 0..self.axes.len() {
            let mut with = self.clone();
            change(&mut with.axes[place]);
            if with.axes[place] != self.axes[place] {
                self.take_if_it_fits(with);
            }
        }
    }

    /// Has sides of gantries stand apart, and some be taken square by a homing.
    fn square(&mut self, dice: &mut Dice) {
        self.change_each(|axis| {
            if dice.chance(0.7) && axis.drives.len() == 2 {
                axis.home_gantry(dice);
            }
        });
    }

    /// Has drives of some machines home by themselves.
    fn home_by_drives(&mut self, dice: &mut Dice) {
        if !dice.chance(0.15) {
            return;
        }
        self.change_each(|axis| {
            // What searches for switches has nothing else wired to where these come in.
            let is_alone = axis.drives.len() == 1 && axis.drives[0].wires.is_empty();
            if dice.chance(0.6) && is_alone && axis.homing.is_none() {
                axis.home_by_drive(dice);
            }
        });
    }

    /// Has some of those that are homed by a switch take the index behind it.
    fn take_indices(&mut self, dice: &mut Dice) {
        for axis in &mut self.axes {
            if dice.chance(0.4) {
                axis.take_index();
            }
        }
    }

    /// Has the drives of some axes be sent the torque that the plan takes, where they can and the buses have room for it.
    fn send_torques(&mut self, dice: &mut Dice) {
        self.change_each(|axis| axis.send_torques(dice));
    }

    /// Has weights pull at some axes, and guides of some be thick with grease.
    fn weigh(&mut self, dice: &mut Dice) {
        self.change_each(|axis| axis.weigh(dice));
    }

    /// Has transmissions of some machines be off, and setpoints be corrected, by no more than leaves the plan enough of the limits.
    fn err(&mut self, dice: &mut Dice) {
        if !dice.chance(0.3) {
            return;
        }
        for place in 0..self.axes.len() {
            let mut with = self.clone();
            let asked = dice.chance(0.6);
            with.axes[place].err(dice);
            if !asked || with.axes[place] == self.axes[place] {
                continue;
            }
            for _ in 0..HALVINGS {
                if with.fits() {
                    *self = with;
                    break;
                }
                with.axes[place].halve_errors();
            }
        }
    }

    /// Has transmissions of some machines be warm.
    fn warm(&mut self, dice: &mut Dice) {
        if !dice.chance(0.2) {
            return;
        }
        self.change_each(|axis| {
            if dice.chance(0.6) {
                axis.warm(dice);
            }
        });
    }

    /// Has beams tie the sides of some gantries together.
    fn tie(&mut self, dice: &mut Dice) {
        let single = self.axes.iter().filter(|it| it.drives.len() == 1);
        let linear = single.filter(|it| !it.is_rotary() && !it.goes);
        let carriages = linear.map(|it| (it.letter, it.soft_limits[1] - it.soft_limits[0]));
        let carriages: Vec<(char, f64)> =
            carriages.filter(|(_, travel)| *travel < WIDEST).collect();
        self.change_each(|axis| {
            if dice.chance(0.5) && axis.drives.len() == 2 {
                axis.tie(dice, &carriages);
            }
        });
    }

    /// Has the sides of some gantries be coupled, however fast the drives' loops are really.
    fn couple(&mut self, dice: &mut Dice) {
        let period = f64::from(self.cycle_us) * 1e-6;
        self.change_each(|axis| {
            let asked = dice.chance(1.0 / 3.0);
            let (loops, limit) = (dice.between(10.0, 200.0), dice.between(0.05, 0.5));
            let (stated, part) = (dice.chance(0.5), dice.between(0.1, 1.0));
            if asked && axis.drives.len() == 2 {
                // No drive's latency is more than three cycles.
                let most = 0.25 / (4.0 * period + 1.0 / loops);
                let gain = stated.then_some(part * most);
                axis.couple(loops, limit, gain);
            }
        });
    }

    /// Has some shapers shape all moves by the one method or by the other.
    fn choose_method(&mut self, dice: &mut Dice) {
        let method = *dice.pick(&[None, Some("clock"), Some("coordinates")]);
        if let Some(shaper) = &mut self.shaper {
            shaper.method = method.map(str::to_owned);
        }
    }

    /// Has encoders watch some axes that are not homed, where the buses have room for what they tell.
    fn watch(&mut self, dice: &mut Dice) {
        if !dice.chance(0.2) {
            return;
        }
        let mut watched = self.clone();
        for axis in 0..self.axes.len() {
            if self.axes[axis].homing.is_none() && dice.chance(0.5) {
                watched.give_encoder(dice, axis);
            }
        }
        self.take_if_it_fits(watched);
    }

    fn give_encoder(&mut self, dice: &mut Dice, axis: usize) {
        let used: Vec<_> = self.nodes().collect();
        let mut encoder = EncoderSpec::draw(dice, self.buses.len(), self.axes[axis].travel);
        while used.contains(&(encoder.bus, encoder.node)) {
            encoder.node = dice.whole(ENCODER_NODES) as u8;
        }
        self.axes[axis].encoder = Some(encoder);
    }

    /// Has the drives of some axes be sent velocities, with an encoder that closes the loop or without, and some axes go
    /// point to point, where the buses have room for that.
    fn stream(&mut self, dice: &mut Dice) {
        if !dice.chance(0.35) {
            return;
        }
        let mut follow = self.axes.len();
        for axis in 0..self.axes.len() {
            if !self.axes[axis].is_plain() {
                continue;
            }
            let mut changed = self.clone();
            let others = !PATH.contains(&self.axes[axis].letter) && self.cycle_us >= LEAST_CYCLE;
            if others && follow > 1 && dice.chance(0.6) {
                changed.go(dice, axis);
            } else if dice.chance(0.6) {
                changed.close_loop(dice, axis);
            }
            if changed.fits() {
                follow -= usize::from(changed.axes[axis].goes);
                *self = changed;
            }
        }
    }

    /// Has an axis go point to point.
    fn go(&mut self, dice: &mut Dice, axis: usize) {
        let spec = &mut self.axes[axis];
        spec.goes = true;
        // What begins to count as it is switched on has to stand at 0, and learns its place from an encoder.
        let begins = spec.soft_limits[0] <= 0.0 && spec.soft_limits[1] >= 0.0;
        if !begins || dice.chance(0.2) {
            return spec.take_drive(GOER);
        }
        spec.take_stepper();
        if spec.encoder.is_none() {
            self.give_encoder(dice, axis);
        }
    }

    /// Has stepping motors be sent velocities, with an encoder that closes the loop, where an I/O node has an output to spare for the
    /// enable chain that stops them if the controller is gone.
    fn step(&mut self, dice: &mut Dice) {
        let asked = dice.chance(0.5);
        let node = self
            .io_nodes
            .iter()
            .position(|io| io.spare_output().is_some());
        let (Some(node), true) = (node, asked && self.cycle_us >= LEAST_CYCLE) else {
            return;
        };
        let mut stepped = self.clone();
        for axis in 0..self.axes.len() {
            let spec = &self.axes[axis];
            let [least, most] = spec.soft_limits;
            let may = spec.is_plain() && !spec.goes && least <= 0.0 && most >= 0.0;
            if !may || !dice.chance(0.5) {
                continue;
            }
            if spec.encoder.is_none() {
                stepped.give_encoder(dice, axis);
            }
            let spec = &mut stepped.axes[axis];
            spec.take_stepper();
            spec.stopped_by_hardware = true;
            if let Some(encoder) = &mut spec.encoder {
                encoder.closes_loop = true;
            }
        }
        stepped.io_nodes[node].chain();
        if stepped.axes != self.axes {
            self.take_if_it_fits(stepped);
        }
    }

    /// Has the drive of an axis be sent velocities, if there is one for this cycle.
    fn close_loop(&mut self, dice: &mut Dice, axis: usize) {
        let period = Duration::from_micros(self.cycle_us.into());
        let models = MODELS.iter().filter(|model| {
            let is_sent = model.is_sent(Setpoints::Velocities) && model.name != STEPPER;
            is_sent && model.takes_cycle(period)
        });
        let models: Vec<&str> = models.map(|model| model.name).collect();
        if models.is_empty() {
            return;
        }
        let model: &str = dice.pick::<&str>(&models);
        self.axes[axis].take_drive(model);
        if self.axes[axis].encoder.is_none() && dice.chance(0.5) {
            self.give_encoder(dice, axis);
        }
        let spec = &mut self.axes[axis];
        if let Some(encoder) = &mut spec.encoder {
            encoder.closes_loop = dice.chance(0.7);
        }
        let ms = dice.whole(1..=40) * self.cycle_us / 1000;
        spec.position_loss = dice.chance(0.3).then_some(ms.clamp(1, 1000));
    }

    /// Has generic devices be as some maker's are.
    fn describe(&mut self, dice: &mut Dice) {
        if !dice.chance(0.5) {
            return;
        }
        let mut described = self.clone();
        for (model, own) in GENERIC {
            let mut table = format!("[model.{model}]\n");
            for (key, values) in COMMON.iter().chain(own) {
                if dice.chance(0.5) {
                    let _ = writeln!(table, "{key} = {}", dice.pick(values));
                }
            }
            described.models.push(table);
        }
        self.take_if_it_fits(described);
    }

    /// Has some machines shape their setpoints.
    fn shape(&mut self, dice: &mut Dice) {
        if !dice.chance(0.12) {
            return;
        }
        // A tenth of SYNC's frequency is the highest that a machine file takes.
        let most = (1e5 / f64::from(self.cycle_us)).min(30.0);
        let modes = (0..dice.whole(1..=2)).map(|_| {
            let frequency = rounded(dice.between(2.0, most), 2);
            (frequency, rounded(dice.between(0.0, 0.3), 3))
        });
        let mut modes: Vec<_> = modes.collect();
        modes.sort_by(|one, other| one.0.total_cmp(&other.0));
        let kind = *dice.pick(&["zv", "zvd", "ei", "two_hump_ei"]);
        let shaper = Some(ShaperSpec {
            kind: kind.to_owned(),
            modes,
            method: None,
        });
        let shaped = Self {
            shaper,
            ..self.clone()
        };
        self.take_if_it_fits(shaped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Layout;

    #[test]
    fn every_machine_that_is_drawn_is_a_good_one() {
        let (mut gantries, mut buses, mut most) = (0, 0, 0);
        for seed in 0..300 {
            let spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            let machine = spec
                .machine()
                .unwrap_or_else(|wrong| panic!("{seed}: {wrong}"));
            Layout::new(&machine).unwrap();
            gantries += usize::from(spec.drives() > spec.axes.len());
            buses += usize::from(spec.buses.len() > 1);
            most = most.max(spec.axes.len());
        }
        assert!(
            gantries > 30 && buses > 30 && most == 9,
            "{gantries} {buses} {most}"
        );
    }

    #[test]
    fn whatever_is_wired_is_good() {
        let (mut wires, mut homed, mut switches, mut encoders, mut shapers) = (0, 0, 0, 0, 0);
        let (mut spindles, mut measured, mut indices, mut torques) = (0, 0, 0, 0);
        let (mut corrected, mut fitting, mut plays, mut weights, mut greased) = (0, 0, 0, 0, 0);
        let (mut methods, mut told, mut coupled) = (0, 0, 0);
        let (mut squared, mut by_drive, mut tied, mut warm, mut stopped) = (0, 0, 0, 0, 0);
        let (mut velocities, mut goers, mut steppers, mut loops, mut described) = (0, 0, 0, 0, 0);
        for seed in 0..300 {
            let spec = MachineSpec::of(seed);
            let streamed = spec.axes.iter().filter(|it| !it.goes);
            let streamed = streamed.filter(|it| {
                let model = it.drives[0].model();
                model.is_some_and(|model| model.is_sent(Setpoints::Velocities))
            });
            velocities += streamed.count();
            goers += spec.axes.iter().filter(|it| it.goes).count();
            let drives = spec.axes.iter().flat_map(|it| &it.drives);
            steppers += drives.filter(|it| it.model == STEPPER).count();
            loops += spec.encoders().filter(|it| it.closes_loop).count();
            described += spec.models.len();
            encoders += spec.encoders().count();
            shapers += usize::from(spec.shaper.is_some());
            spindles += usize::from(spec.spindle.is_some());
            measured += spec.analog_inputs().len();
            wires += spec.wires().count();
            homed += spec.axes.iter().filter(|it| it.homing.is_some()).count();
            switches += spec.wires().filter(|(_, wire)| wire.is_home()).count();
            let by_index = |it: &&AxisSpec| {
                let homing = it.homing.as_ref();
                homing.is_some_and(|it| it.contains("index = true"))
            };
            indices += spec.axes.iter().filter(by_index).count();
            torques += (spec.axes.iter().filter(|it| it.feed_forward.is_some())).count();
            methods += usize::from(spec.shaper.as_ref().is_some_and(|it| it.method.is_some()));
            for axis in &spec.axes {
                let homing = axis.homing.as_deref().unwrap_or_default();
                squared += usize::from(homing.contains("max_skew"));
                by_drive += usize::from(homing.contains("\"drive\""));
                tied += usize::from(
                    axis.simulation
                        .as_ref()
                        .is_some_and(|it| it.contains("beam")),
                );
                warm += usize::from(axis.warmth.is_some());
                coupled += usize::from(axis.cross_coupling.is_some());
                stopped += usize::from(axis.stopped_by_hardware);
                let carriage = axis.transmission.as_ref().map(|it| &it.errors);
                corrected += usize::from(axis.corrected.is_some());
                fitting +=
                    usize::from(axis.corrected.is_some() && axis.corrected.as_ref() == carriage);
                plays += usize::from(carriage.is_some_and(|it| it.backlash > 0.0));
                let simulation = axis.simulation.as_deref().unwrap_or_default();
                weights += usize::from(simulation.contains("gravity"));
                greased += usize::from(simulation.contains("viscous"));
                let feed_forward = axis.feed_forward.as_deref().unwrap_or_default();
                told += usize::from(feed_forward.contains("gravity"));
            }
            spec.machine()
                .unwrap_or_else(|wrong| panic!("{seed}: {wrong}"));
        }
        assert!(
            corrected > 100 && fitting > 50 && plays > 50 && weights > 100 && greased > 80,
            "{corrected} {fitting} {plays} {weights} {greased}"
        );
        assert!(
            methods > 10 && told > 10 && coupled > 20,
            "{methods} {told} {coupled}"
        );
        assert!(
            squared > 30 && by_drive > 20 && tied > 20 && warm > 30 && stopped > 3,
            "{squared} {by_drive} {tied} {warm} {stopped}"
        );
        assert!(
            wires > 300 && homed > 100 && switches > 50 && encoders > 50 && shapers > 20,
            "{wires} {homed} {switches} {encoders} {shapers}"
        );
        assert!(
            spindles > 20 && measured > 20 && indices > 10 && torques > 20,
            "{spindles} {measured} {indices} {torques}"
        );
        assert!(
            velocities > 50 && goers > 15 && steppers > 10 && loops > 20 && described > 100,
            "{velocities} {goers} {steppers} {loops} {described}"
        );
    }

    /// By the machine file's own arithmetic.
    #[test]
    fn quick_stop_ramps_are_those_of_their_axes() {
        let mut ramps = [0, 0, 0];
        for seed in 0..300 {
            let spec = MachineSpec::of(seed);
            let machine = spec.machine().expect("a machine");
            for drive in &machine.drives {
                let units = match drive.model.name {
                    "lxm32m" => 131_072.0 / 60.0,
                    "cia402_csp" | "cia402_csv" | "cia402_pv" => 1.0,
                    _ => continue,
                };
                let axis = &machine.axes[drive.axis];
                let Some(write) = drive.objects.last() else {
                    panic!("{seed}: nothing of {}", drive.name);
                };
                let bytes = write.data.bytes().try_into().expect("four bytes");
                let ramp = f64::from(u32::from_le_bytes(bytes)) * units;
                let right = axis.sent_limits.acceleration / drive.scaling.resolution();
                assert!(
                    ramp >= right * (1.0 - 1e-9) && ramp < right + units + 1.0,
                    "{seed}: {ramp}, {right}"
                );
                let stated = spec
                    .models
                    .iter()
                    .any(|it| it.contains("encoder_increments"));
                ramps[usize::from(units == 1.0) * (1 + usize::from(stated))] += 1;
            }
        }
        assert!(ramps.iter().all(|it| *it > 20), "{ramps:?}");
    }

    #[test]
    fn a_machine_without_an_axis_is_still_good() {
        for seed in 0..60 {
            let mut spec = MachineSpec::draw(&mut Dice::new(seed, 0));
            spec.wire(&mut Dice::new(seed, 5));
            spec.equip(&mut Dice::new(seed, 9));
            spec.home(&mut Dice::new(seed, 10));
            spec.watch(&mut Dice::new(seed, 11));
            spec.shape(&mut Dice::new(seed, 13));
            spec.stream(&mut Dice::new(seed, 14));
            while spec.axes.len() > 1 {
                let place = seed as usize % spec.axes.len();
                // One axis at least follows the path.
                if spec.axes.iter().filter(|it| !it.goes).count() == 1 && !spec.axes[place].goes {
                    break;
                }
                spec.axes.remove(place);
                spec.leave_out_unused_buses();
                spec.machine()
                    .unwrap_or_else(|wrong| panic!("{seed}: {wrong}"));
            }
        }
    }
}
