//! What the simulated drives of a run were asked for: torque, speed, how far what they move is from where they
//! say, and how it sways the structure.
//!
//! Each is looked at once a cycle, shortly behind its SYNC, as it truly is: without the encoder's noise and
//! without the drive's own idea of it. What is over between two cycles is not seen. Speed is held against that
//! at which the motor's voltage is used up without load, where the drive's power stage is simulated.

use super::cutting::{CuttingSummary, CuttingWatch};
use super::gantry::{GantrySummary, GantryWatch};
use super::kept::Kept;
use super::limits::Watch;
use super::record::{Greatest, Place, Violation};
use super::structure::StructureWatch;
use super::summary::{DriveSummary, StructureSummary, TransmissionSummary};
use super::supply::SupplyWatch;
use super::transmission::TransmissionWatch;
use crate::control::AxisSample;
use crate::machine::{COORDINATES, Drive, FeedAxis, Machine, Position, Simulation, Validation};
use syncline_drives::twin::Observation;
use syncline_drives::twin::servo::motor::Motor;
use syncline_drives::twin::servo::power_stage::{DcBus, lasts};
use syncline_gcode::AxisLetter;

/// What is watched of all drives, gantries and the structure.
#[derive(Debug)]
pub(super) struct Drives {
    drives: Vec<DriveWatch>,
    gantries: Vec<GantryWatch>,
    structures: Vec<StructureWatch>,
    transmissions: Vec<TransmissionWatch>,
    cutting: Option<CuttingWatch>,
    /// The drives at the last SYNC.
    seen: Vec<Observation>,
    /// Cycles in which they were seen.
    rows: u64,
}

/// One drive.
#[derive(Debug)]
struct DriveWatch {
    name: String,
    /// N·m.
    peak: f64,
    continuous: f64,
    /// What its root mean square may be, N·m.
    rms_limit: f64,
    /// Where the file says what is turned.
    motor: Option<Motor>,
    /// rev/s.
    most_speed: Option<f64>,
    tolerance: Validation,
    torque: Greatest,
    speed: Greatest,
    /// Sum of the squares of its torque.
    squares: f64,
    supply: SupplyWatch,
    /// s.
    cycle: f64,
    watches: [Watch; 2],
    /// Of an axis with a weight.
    hanging: Option<Hanging>,
}

/// An axis that falls where nothing holds it.
#[derive(Debug)]
struct Hanging {
    /// Of a revolution, mm or degrees.
    travel: f64,
    /// `mm` or `°`.
    unit: &'static str,
    /// Where its motor was when its power stage was seen on last, revolutions from its encoder's zero.
    held: Option<f64>,
    /// How far it has moved from there until it hung, mm or degrees.
    drop: Option<f64>,
}

impl Drives {
    /// Nothing yet.
    pub(super) fn new(machine: &Machine) -> Self {
        let drives = machine.drives.iter();
        let gantries = machine.axes.iter().filter(|axis| axis.drives.len() == 2);
        Self {
            drives: drives.map(|it| DriveWatch::new(machine, it)).collect(),
            gantries: gantries.map(|it| GantryWatch::new(machine, it)).collect(),
            structures: (machine.axes.iter())
                .filter_map(|axis| StructureWatch::new(machine, axis))
                .collect(),
            transmissions: (machine.axes.iter())
                .filter_map(|axis| TransmissionWatch::new(machine, axis))
                .collect(),
            cutting: CuttingWatch::new(machine),
            seen: Vec::with_capacity(machine.drives.len()),
            rows: 0,
        }
    }

    /// Takes how the drives are at one SYNC, by their index; nothing where one is not simulated.
    pub(super) fn observe(
        &mut self,
        at: Place,
        drive: impl Fn(usize) -> Option<Observation>,
        violations: &mut Kept<Violation>,
    ) {
        self.seen.clear();
        self.seen.extend((0..self.drives.len()).map_while(drive));
        if self.seen.len() < self.drives.len() {
            return;
        }
        self.rows += 1;
        // Before what is seen now has it go on to the next SYNC.
        let deflection = self.cutting.as_ref().map(|_| self.deflection());
        for (watch, seen) in self.drives.iter_mut().zip(&self.seen) {
            watch.observe(at, seen, violations);
        }
        for gantry in &mut self.gantries {
            gantry.observe(at, &self.seen, violations);
        }
        for structure in &mut self.structures {
            structure.observe(at, &self.seen);
        }
        for transmission in &mut self.transmissions {
            transmission.observe(at, &self.seen);
        }
        if let Some((cutting, deflection)) = self.cutting.as_mut().zip(deflection) {
            cutting.observe(at, &self.seen, deflection);
        }
    }

    /// Takes what the axes say at one SYNC, before it is seen how the drives are.
    pub(super) fn correct(&mut self, at: Place, axes: &[AxisSample; COORDINATES]) {
        for gantry in &mut self.gantries {
            gantry.correct(at, axes);
        }
        for transmission in &mut self.transmissions {
            transmission.correct(axes);
        }
    }

    /// An axis stands where it is known to be.
    pub(super) fn count_anew(&mut self, coordinate: usize) {
        for transmission in &mut self.transmissions {
            transmission.count_anew(coordinate);
        }
    }

    /// Where the tool is at the next SYNC, by where the axes are.
    pub(super) fn tool(&self, actual: &Position) -> Position {
        let mut tool = *actual;
        for structure in &self.structures {
            structure.sway(&mut tool);
        }
        for transmission in &self.transmissions {
            transmission.give(&mut tool);
        }
        tool
    }

    /// Whether the tool may be elsewhere than the axes say.
    pub(super) fn give_way(&self) -> bool {
        !self.structures.is_empty() || !self.transmissions.is_empty()
    }

    /// How far the tool is from where X, Y and Z are at the next SYNC, mm.
    fn deflection(&self) -> f64 {
        let off = self.tool(&Position::default());
        let linear = [AxisLetter::X, AxisLetter::Y, AxisLetter::Z];
        let squares = linear.map(|letter| off[letter.index()].powi(2));
        squares.iter().sum::<f64>().sqrt()
    }

    /// Whether some axis falls where nothing holds it.
    pub(super) fn hang(&self) -> bool {
        self.drives.iter().any(|drive| drive.hanging.is_some())
    }

    /// Takes how the drives are, by their index, once the machine is off and nothing moves.
    pub(super) fn rest(&mut self, drive: impl Fn(usize) -> Option<Observation>) {
        for (index, watch) in self.drives.iter_mut().enumerate() {
            if let Some(hanging) = &mut watch.hanging
                && let Some(seen) = drive(index).filter(|it| !it.is_powered)
            {
                let fallen = hanging.held.map(|held| (seen.position - held).abs());
                hanging.drop = fallen.map(|turns| turns * hanging.travel.abs());
            }
        }
    }

    /// Ends the stretches that go on, and says what is wrong of the whole run.
    pub(super) fn close(&mut self, end: Place, violations: &mut Kept<Violation>) {
        for gantry in &mut self.gantries {
            gantry.close(violations);
        }
        for drive in &mut self.drives {
            drive.close(self.rows, end, violations);
        }
    }

    /// What was seen; nothing where nothing could be.
    pub(super) fn summaries(
        &self,
    ) -> (Vec<DriveSummary>, Vec<GantrySummary>, Vec<StructureSummary>) {
        if self.rows == 0 {
            return Default::default();
        }
        let structures = self.structures.iter().map(StructureWatch::summary);
        let drives = self.drives.iter().map(|it| it.summary(self.rows));
        let gantries = self.gantries.iter().map(|it| it.summary(self.rows));
        (drives.collect(), gantries.collect(), structures.collect())
    }

    /// With which force tools cut, where something cuts.
    pub(super) fn cutting(&self) -> Option<CuttingSummary> {
        let seen = self.cutting.as_ref().filter(|_| self.rows > 0);
        seen.map(CuttingWatch::summary)
    }

    /// By how much loads were not where their motors say, by axis.
    pub(super) fn transmissions(&self) -> Vec<TransmissionSummary> {
        let seen = self.transmissions.iter();
        seen.filter_map(TransmissionWatch::summary).collect()
    }
}

impl DriveWatch {
    fn new(machine: &Machine, drive: &Drive) -> Self {
        let simulation = machine.axes[drive.axis].simulation.as_ref();
        let own = simulation.and_then(Simulation::driven);
        let hanging = own.as_ref().is_some_and(FeedAxis::has_weight);
        let own = own.as_ref().map(FeedAxis::motor);
        let motor = own.unwrap_or_default();
        let tolerance = machine.validation;
        Self {
            name: drive.name.clone(),
            peak: motor.peak_torque,
            continuous: motor.continuous_torque,
            rms_limit: tolerance.rms_torque * motor.continuous_torque,
            motor: own,
            most_speed: own.map(|it| it.no_load_speed(DcBus::default().nominal)),
            tolerance,
            torque: Greatest::default(),
            speed: Greatest::default(),
            squares: 0.0,
            supply: SupplyWatch::default(),
            cycle: machine.cycle.as_secs_f64(),
            watches: Default::default(),
            hanging: hanging.then(|| Hanging {
                travel: drive.scaling.travel_per_revolution(),
                unit: machine.axes[drive.axis].units()[0],
                held: None,
                drop: None,
            }),
        }
    }

    fn observe(&mut self, at: Place, seen: &Observation, violations: &mut Kept<Violation>) {
        let (torque, speed) = (seen.torque.abs(), seen.velocity.abs());
        self.torque.look(torque, at);
        self.speed.look(speed, at);
        self.squares += torque * torque;
        self.supply.observe(at, seen);
        if let Some(hanging) = self.hanging.as_mut().filter(|_| seen.is_powered) {
            hanging.held = Some(seen.position);
        }
        let most_speed = self.most_speed.unwrap_or(f64::INFINITY);
        let looks = [
            ("torque", torque, self.tolerance.torque * self.peak, "N·m"),
            (
                "speed",
                60.0 * speed,
                60.0 * self.tolerance.speed * most_speed,
                "1/min",
            ),
        ];
        for (watch, (what, value, limit, unit)) in self.watches.iter_mut().zip(looks) {
            // A cause is told before what it leads to: where it began.
            watch.look_by_line(violations, at, value, limit, |began| Violation {
                what: format!("{what} of drive {}", self.name),
                axis: None,
                time: began.time,
                line: began.line,
                value,
                limit,
                unit,
            });
        }
    }

    fn close(&mut self, rows: u64, end: Place, violations: &mut Kept<Violation>) {
        for watch in &mut self.watches {
            watch.close(violations);
        }
        let limit = self.rms_limit;
        let value = root_mean(self.squares, rows);
        if value > limit {
            violations.push(Violation {
                what: format!("rms_torque of drive {}", self.name),
                axis: None,
                time: end.time,
                line: end.line,
                value,
                limit,
                unit: "N·m",
            });
        }
    }

    fn summary(&self, rows: u64) -> DriveSummary {
        DriveSummary {
            name: self.name.clone(),
            max_torque: self.torque.value,
            max_torque_at: self.torque.at,
            peak_torque: self.peak,
            // Ripple and cogging come on top of what the current makes.
            torque_reserve: (1.0 - self.torque.value / self.peak).max(0.0),
            rms_torque: root_mean(self.squares, rows),
            continuous_torque: self.continuous,
            limited_after_s: self
                .motor
                .and_then(|it| lasts(&it, root_mean(self.squares, rows))),
            supply: self.supply.summary(rows as f64 * self.cycle),
            max_speed_rpm: 60.0 * self.speed.value,
            speed_reserve: self.most_speed.map(|most| 1.0 - self.speed.value / most),
            drop: self.hanging.as_ref().and_then(|it| it.drop),
            drop_unit: self.hanging.as_ref().map(|it| it.unit),
        }
    }
}

/// Root mean square of what was summed up over so many rows.
pub(super) fn root_mean(squares: f64, rows: u64) -> f64 {
    (squares / rows.max(1) as f64).sqrt()
}
