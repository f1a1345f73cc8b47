//! The force of the tool that cuts, upon what simulated drives move.
//!
//! It is that of the plan at the last SYNC and lasts until the next one: against the feed, and across it. There is none in
//! rapids, off the path, at rest, and while the spindle does not turn. What a file has of the force along the path comes on top of
//! that, wherever the path moves.

use crate::control::spindle::turning;
use crate::control::{Layout, Row};
use crate::machine::{COORDINATES, Cut, Machine, PathForces};
use std::f64::consts::TAU;
use syncline_drives::world::{DeviceId, World};
use syncline_gcode::AxisLetter;

/// Where a tool is moved.
const MOVED: [AxisLetter; 3] = [AxisLetter::X, AxisLetter::Y, AxisLetter::Z];

/// What pushes at the drives of a machine.
pub(super) struct Cutting {
    cuts: Vec<Cut>,
    along: Option<PathForces>,
    drives: Vec<Pushed>,
}

/// A drive of an axis that moves the tool.
struct Pushed {
    device: DeviceId,
    /// Among those that [move the tool](MOVED).
    place: usize,
    /// Torque at its shaft of a N along the axis, N·m; of a gantry's side half of it.
    lever: f64,
}

impl Cutting {
    /// Of a machine whose drives are there in a world; `None`: nothing cuts.
    pub(super) fn new(machine: &Machine, layout: &Layout, world: &World) -> Option<Self> {
        let drives = machine.axes.iter().flat_map(|axis| {
            let place = MOVED.iter().position(|letter| *letter == axis.letter);
            let sides = axis.drives.len() as f64;
            axis.drives.iter().filter_map(move |&drive| {
                let travel = machine.drives[drive].scaling.travel_per_revolution();
                let device = &layout.devices[drive];
                Some(Pushed {
                    device: world.find(device.bus, device.device.spec().node)?,
                    place: place?,
                    lever: travel / 1e3 / TAU / sides,
                })
            })
        });
        machine.is_cutting().then(|| Self {
            cuts: machine.cuts.clone(),
            along: machine.path_forces.clone(),
            drives: drives.collect(),
        })
    }

    /// Pushes as the tool cuts now.
    pub(super) fn push(&self, row: Option<&Row<COORDINATES>>, world: &mut World) {
        let force = row.map_or([0.0; 3], |row| {
            let [cut, along] = [self.force(row), self.along(row)];
            [0, 1, 2].map(|at| cut[at] + along[at])
        });
        for drive in &self.drives {
            world.push(drive.device, force[drive.place] * drive.lever);
        }
    }

    /// What the file has, N along each axis that moves the tool.
    fn along(&self, row: &Row<COORDINATES>) -> [f64; 3] {
        let plan = &row.plan;
        let moves = plan.speed > 0.0 && !plan.off_path;
        let along = self.along.as_ref().filter(|_| moves);
        along.map_or([0.0; 3], |it| it.at(plan.distance))
    }

    /// Of the tool that cuts, N along each axis that moves it.
    fn force(&self, row: &Row<COORDINATES>) -> [f64; 3] {
        let (plan, functions) = (&row.plan, &row.functions);
        let turns = row
            .spindle
            .map_or(turning(functions.spindle), |it| it.speed);
        let feeds = plan.feed > 0.0 && plan.feed.is_finite() && !plan.off_path;
        let [x, y, z] = MOVED.map(|letter| plan.velocity[letter.index()]);
        let level = f64::hypot(x, y);
        let speed = f64::hypot(level, z);
        let cut = Cut::of(&self.cuts, functions.tool);
        let Some(cut) = cut.filter(|_| feeds && turns != 0.0 && speed > 0.0) else {
            return [0.0; 3];
        };
        let force = cut.force(60.0 * speed / turns.abs());
        let against = -force / speed;
        // To the left of the feed, as seen from above.
        let across = match level > 0.0 {
            true => cut.across * force / level,
            false => 0.0,
        };
        [
            against * x - across * y,
            against * y + across * x,
            against * z,
        ]
    }
}
