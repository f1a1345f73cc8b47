//! The force of the tool that cuts, upon what simulated drives move.
//!
//! It is that of the plan at the last SYNC and lasts until the next one: against the feed, and across it. There is none in
//! rapids, off the path, at rest, and while the spindle does not turn. What a file has of the force along the path comes on top of
//! that, wherever the path moves.

use crate::control::spindle::turning;
use crate::control::{Controller, Job, JobKind, Row};
use crate::machine::{COORDINATES, Cut, Machine, PathForces};
use std::f64::consts::TAU;
use syncline_drives::world::{DeviceId, World};
use syncline_gcode::AxisLetter;

/// Where a tool is moved.
const MOVED: [AxisLetter; 3] = [AxisLetter::X, AxisLetter::Y, AxisLetter::Z];
/// A spindle that is slower than this part of what it is told cuts as one that keeps it: chips would become as thick as one likes.
const SLOWEST: f64 = 0.5;

/// What pushes at the drives of a machine.
pub(super) struct Cutting {
    cuts: Vec<Cut>,
    along: Option<PathForces>,
    drives: Vec<Pushed>,
    travel: PathTravel,
}

/// A drive of an axis that moves the tool.
struct Pushed {
    device: DeviceId,
    /// Among those that [move the tool](MOVED).
    place: usize,
    /// Torque at its shaft of a N along the axis, N·m; of a gantry's side half of it.
    lever: f64,
}

/// How far the path of a program has come, mm: plans behind a probing, a homing or a thread begin at 0 again.
#[derive(Default)]
struct PathTravel {
    job: Option<u64>,
    /// The last search behind which a plan began …
    search: Option<u32>,
    /// … and how far all of them had come before.
    before: f64,
    /// By the plan.
    planned: f64,
}

impl PathTravel {
    /// Goes on to a SYNC, at which the path of this job has come so far by its plan.
    fn go_on(&mut self, job: u64, search: Option<u32>, planned: f64) -> f64 {
        if self.job != Some(job) {
            *self = Self {
                job: Some(job),
                search,
                ..Self::default()
            };
        }
        if search.is_some() && search != self.search {
            self.search = search;
            self.before += self.planned;
        }
        self.planned = planned;
        self.before + planned
    }
}

impl Cutting {
    /// Of a machine with these twins; `None`: nothing cuts, or nothing is there that feels it.
    pub(super) fn new(machine: &Machine, twins: &[Option<DeviceId>]) -> Option<Self> {
        let drives = machine.axes.iter().flat_map(|axis| {
            let place = MOVED.iter().position(|letter| *letter == axis.letter);
            let sides = axis.drives.len() as f64;
            axis.drives.iter().filter_map(move |&drive| {
                let travel = machine.drives[drive].scaling.travel_per_revolution();
                Some(Pushed {
                    device: twins[drive]?,
                    place: place?,
                    lever: travel / 1e3 / TAU / sides,
                })
            })
        });
        let drives: Vec<Pushed> = drives.collect();
        let cuts = machine.is_cutting() && !drives.is_empty();
        cuts.then(|| Self {
            cuts: machine.cuts.clone(),
            along: machine.path_forces.clone(),
            drives,
            travel: PathTravel::default(),
        })
    }

    /// Pushes as the tool cuts now.
    pub(super) fn push(&mut self, controller: &Controller<COORDINATES>, world: &mut World) {
        let Some(row) = controller.row() else {
            return self.leave(world);
        };
        let search = controller.found().map(|it| it.number);
        let [cut, along] = [self.force(row), self.along(row, controller.job(), search)];
        for drive in &self.drives {
            let force = cut[drive.place] + along[drive.place];
            world.push(drive.device, force * drive.lever);
        }
    }

    /// Pushes no more.
    pub(super) fn leave(&self, world: &mut World) {
        for drive in &self.drives {
            world.push(drive.device, 0.0);
        }
    }

    /// What the file has, N along each axis that moves the tool; typed lines are no part of its program.
    fn along(&mut self, row: &Row<COORDINATES>, job: Option<Job>, search: Option<u32>) -> [f64; 3] {
        let plan = &row.plan;
        let job = job.filter(|it| it.kind == JobKind::Program && !plan.off_path);
        let (Some(job), Some(along)) = (job, &self.along) else {
            return [0.0; 3];
        };
        let travel = self.travel.go_on(job.number, search, plan.distance);
        match plan.speed > 0.0 {
            true => along.at(travel),
            false => [0.0; 3],
        }
    }

    /// Of the tool that cuts, N along each axis that moves it.
    fn force(&self, row: &Row<COORDINATES>) -> [f64; 3] {
        let (plan, functions) = (&row.plan, &row.functions);
        let told = turning(functions.spindle);
        let turns = cutting_speed(told, row.spindle.map(|it| it.speed));
        let feeds = plan.feed > 0.0 && plan.feed.is_finite() && !plan.off_path;
        let [x, y, z] = MOVED.map(|letter| plan.velocity[letter.index()]);
        let level = f64::hypot(x, y);
        let speed = f64::hypot(level, z);
        let cut = Cut::of(&self.cuts, functions.tool);
        let Some(cut) = cut.filter(|_| feeds && turns > 0.0 && speed > 0.0) else {
            return [0.0; 3];
        };
        let force = cut.force(60.0 * speed / turns);
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

/// How fast a tool cuts by the speed that its spindle is told and the one that is measured, 1/min; 0: it does not turn.
fn cutting_speed(told: f64, measured: Option<f64>) -> f64 {
    let told = told.abs();
    match told > 0.0 {
        true => measured.map_or(told, |it| it.abs().max(SLOWEST * told)),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever noise a spindle at rest is measured with, a tool that is told to stand cuts nothing, and no chip is thicker than
        /// twice what it is told.
        #[test]
        fn a_spindle_that_hardly_turns_makes_no_endless_chip(told in -3e4..3e4_f64, measured in -3e4..3e4_f64) {
            prop_assert_eq!(cutting_speed(0.0, Some(measured)), 0.0);
            let speed = cutting_speed(told, Some(measured));
            prop_assert!(speed >= 0.5 * told.abs() && speed >= measured.abs(), "{}", speed);
            prop_assert_eq!(cutting_speed(told, None), told.abs());
        }

        /// Plans that begin at 0 behind searches go on where the ones before came to, also where a SYNC tells both; another job begins
        /// anew, and one that goes back on its path goes back.
        #[test]
        fn a_program_goes_on_behind_its_searches(
            jobs in prop::collection::vec(prop::collection::vec((0.0..500.0_f64, 0.0..1.0_f64, any::<bool>()), 1..5), 1..4),
        ) {
            let mut travel = PathTravel::default();
            for (job, plans) in jobs.iter().enumerate() {
                let mut before = 0.0;
                let mut search = None;
                for (number, (length, back, told_late)) in plans.iter().enumerate() {
                    for planned in [0.0, *length, back * length, *length] {
                        prop_assert_eq!(travel.go_on(job as u64, search, planned), before + planned);
                    }
                    search = Some(number as u32 + 1);
                    before += length;
                    if *told_late {
                        let _ = travel.go_on(job as u64, search, *length);
                    }
                }
            }
        }
    }
}
