//! Nothing moves that is not enabled and commanded, and what moves keeps together: from the plants, which
//! no drive can misreport.

use super::scene::{AT_REST, DISTURBED, SETTLES, SWAYS, extent};
use super::{Checker, Found, Scene};
use crate::control::{Phase, State};
use crate::machine::{AxisLimits, Machine};
use std::collections::VecDeque;
use syncline_canopen::Instant;
use syncline_drives::model::Increments;

const NAME: &str = "motion";

/// How long a shaft may coast once its power stage is off, s: brakes and friction hold by then.
const COASTS: f64 = 3.0;
/// Cycles, beyond those for which a T_PDO may be missing, until a following error is no longer followed.
const IN_TIME: u32 = 4;
/// Cycles from where a gantry is seen to be askew until its drives brake.
const SEEN: f64 = 4.0;
/// What operators are shown was true within so many wake-ups.
const SHOWN_AFTER: usize = 8;

/// See the module.
pub(super) struct Motion {
    /// By drive: since when its power stage is off.
    off: Vec<Option<Instant>>,
    /// By drive: since when its setpoint is the same, or it follows none.
    rests: Vec<(Option<Increments>, Instant)>,
    /// By drive: since when it is far from its setpoint and goes on.
    far: Vec<Option<Instant>>,
    /// By axis: where it was at the last wake-ups, and how far its sides were apart, the newest first, mm.
    is: Vec<VecDeque<(f64, f64)>>,
    /// By axis: its sides have been together since it is where its plan has it.
    is_square: Vec<bool>,
}

impl Motion {
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            off: vec![Some(Instant::ZERO); machine.drives.len()],
            rests: vec![(None, Instant::ZERO); machine.drives.len()],
            far: vec![None; machine.drives.len()],
            is: vec![VecDeque::new(); machine.axes.len()],
            is_square: vec![false; machine.axes.len()],
        }
    }

    fn without_power(&mut self, scene: &Scene<'_>, drive: usize, found: &mut Found) {
        let plant = &scene.plants[drive];
        let off = &mut self.off[drive];
        if plant.is_powered {
            *off = None;
            return;
        }
        let since = *off.get_or_insert(scene.now);
        let tied = scene.machine.axes[scene.machine.drives[drive].axis]
            .drives
            .len()
            > 1;
        if !tied && scene.since(since) > COASTS && plant.velocity.abs() > AT_REST {
            found.violate(NAME, scene, "moves without power", || {
                let name = &scene.machine.drives[drive].name;
                let (speed, since) = (plant.velocity, scene.since(since));
                format!("drive {name}: {speed} rev/s, off for {since} s")
            });
        }
    }

    fn at_rest(&mut self, scene: &Scene<'_>, drive: usize, found: &mut Found) {
        let (latched, since) = &mut self.rests[drive];
        let now = scene.drives[drive]
            .latched
            .filter(|_| scene.drives[drive].in_effect);
        if *latched != now {
            (*latched, *since) = (now, scene.now);
        }
        let plant = &scene.plants[drive];
        let rests = latched.is_some() && scene.since(*since) > SETTLES;
        // Each side of a beam answers the other one's noise, too.
        let axis = &scene.machine.axes[scene.machine.drives[drive].axis];
        let is_tied = (axis.simulation.as_ref()).is_some_and(|it| it.gantry.is_some());
        let at_rest = if is_tied { 2.0 * AT_REST } else { AT_REST };
        if rests && !scene.is_disturbed(DISTURBED) && plant.velocity.abs() > at_rest {
            found.violate(NAME, scene, "moves although its setpoint rests", || {
                let name = &scene.machine.drives[drive].name;
                format!("drive {name}: {} rev/s", plant.velocity)
            });
        }
    }

    /// The setpoint of a machine that waits does not change.
    fn uncommanded(&self, scene: &Scene<'_>, drive: usize, found: &mut Found) {
        let waits = matches!(scene.state, State::Ready | State::Faulted | State::Disabled);
        let told = scene.since(scene.state_since) / scene.period();
        let (latched, since) = &self.rests[drive];
        let changed = scene.since(*since) / scene.period();
        // What the state before sent is latched meanwhile, at the next SYNC, however late that comes.
        let came = scene.since(scene.drives[drive].latched_came) / scene.period();
        if waits && latched.is_some() && changed < 0.5 && told > 4.0 && came < told {
            found.violate(
                NAME,
                scene,
                "a setpoint changes while nothing is commanded",
                || {
                    let name = &scene.machine.drives[drive].name;
                    format!("drive {name}, machine {}", scene.state)
                },
            );
        }
    }

    fn follows(&mut self, scene: &Scene<'_>, drive: usize, found: &mut Found) {
        let it = &scene.drives[drive];
        let (Some(latched), Some(actual)) = (it.latched, scene.actual(drive)) else {
            self.far[drive] = None;
            return;
        };
        let axis = &scene.machine.axes[scene.machine.drives[drive].axis];
        // A setpoint is where the drive is to be a cycle or some later.
        let under_way = 4.0 * scene.period() * axis.sent_limits.velocity;
        let allowed = axis.limits.following_error + under_way;
        let off = (scene.mm(drive, latched) - actual).abs();
        let is_far = it.in_effect && off > allowed && !scene.faulted;
        let since = match is_far {
            true => *self.far[drive].get_or_insert(scene.now),
            false => {
                self.far[drive] = None;
                return;
            }
        };
        let in_time = f64::from(scene.misses(drive) + IN_TIME) * scene.period();
        if scene.since(since) > in_time && scene.buses_are_sound() {
            found.violate(
                NAME,
                scene,
                "nothing is done about a following error",
                || {
                    let name = &scene.machine.drives[drive].name;
                    format!("drive {name}: {off} mm, allowed {allowed}")
                },
            );
        }
        if !scene.is_disturbed(DISTURBED) {
            found.violate(NAME, scene, "far from its setpoint", || {
                let name = &scene.machine.drives[drive].name;
                format!("drive {name}: {off} mm, allowed {allowed}")
            });
        }
    }

    /// Where nothing is wrong operators are shown where an axis is, or was a little while ago.
    fn shown(&mut self, scene: &Scene<'_>, found: &mut Found) {
        let follows = follows_plan(scene);
        for (index, axis) in scene.machine.axes.iter().enumerate() {
            // Who is asked for a position says it some time later.
            if scene.is_polled(axis.drives[0]) {
                continue;
            }
            let sides: Option<Vec<f64>> = axis.drives.iter().map(|it| scene.actual(*it)).collect();
            let is = &mut self.is[index];
            let Some(sides) = sides.filter(|_| scene.is_placed(index) && follows) else {
                is.clear();
                continue;
            };
            is.truncate(SHOWN_AFTER - 1);
            let middle = sides.iter().sum::<f64>() / sides.len() as f64;
            is.push_front((scene.axis(index, middle), sides[sides.len() - 1] - sides[0]));
            if is.len() < SHOWN_AFTER || !scene.is_untroubled {
                continue;
            }
            let resolution = scene.machine.drives[axis.drives[0]].scaling.resolution();
            let [least, most] = extent(is.iter().map(|it| it.0));
            // Where sides move against each other it is shown by the one that is further behind.
            let apart = extent(is.iter().map(|it| it.1));
            if apart[1] - apart[0] > SWAYS * resolution {
                continue;
            }
            // Between wake-ups it may have been further.
            let steps = is.iter().zip(is.iter().skip(1));
            let between = steps
                .map(|(one, other)| (one.0 - other.0).abs())
                .fold(0.0, f64::max);
            let encoder = axis.feedback.filter(|it| it.closes_loop);
            let by_encoder = encoder.map_or(0.0, |it| {
                2.0 * scene.machine.encoders[it.encoder].scaling.resolution()
            });
            // Sides that are coupled across are sent apart, and it is shown by one of them.
            let coupled =
                (axis.cross_coupling).map_or(0.0, |_| 0.5 * apart[0].abs().max(apart[1].abs()));
            let off = scene.uncertainty[index] + scene.unknown(index) + coupled;
            let allowed = off + SWAYS * resolution + between + by_encoder;
            let shown = scene.shown[index];
            if shown < least - allowed || shown > most + allowed {
                found.violate(NAME, scene, "a position that is shown is another", || {
                    let name = axis.name();
                    format!("axis {name}: {shown} mm is shown, {least} to {most} is true, allowed {allowed} off")
                });
            }
        }
    }

    fn together(&mut self, scene: &Scene<'_>, found: &mut Found) {
        for (index, axis) in scene.machine.axes.iter().enumerate() {
            // One that is to be taken square by a homing may stand further apart until that has come to its end.
            if !scene.is_placed(index) || !follows_plan(scene) {
                self.is_square[index] = false;
                continue;
            }
            let ([one, other], Some(limit)) = (&axis.drives[..], axis.limits.skew) else {
                continue;
            };
            let both = [one, other].map(|drive| scene.drives[*drive].in_effect);
            let is_disturbed = scene.is_disturbed(DISTURBED);
            let (Some(a), Some(b)) = (scene.actual(*one), scene.actual(*other)) else {
                continue;
            };
            let skew = (a - b).abs();
            self.is_square[index] |= skew <= limit;
            let is_askew = self.is_square[index] && skew > limit;
            // What holds one side back, or lets go of it, is seen, and both brake: the free one as far off its setpoint as is no fault.
            let AxisLimits {
                velocity,
                acceleration,
                ..
            } = axis.sent_limits;
            let way = velocity * (SEEN * scene.period() + 0.5 * velocity / acceleration);
            let braked = way + axis.limits.following_error;
            if is_disturbed
                && self.is_square[index]
                && scene.buses_are_sound()
                && skew > limit + braked
            {
                let what = "a gantry is askew by more than it takes to brake";
                found.violate(NAME, scene, what, || {
                    let name = axis.name();
                    format!("axis {name}: {skew} mm, allowed {}", limit + braked)
                });
            }
            if both == [true; 2] && is_askew && !is_disturbed {
                found.violate(NAME, scene, "a gantry is askew", || {
                    format!("axis {}: {skew} mm, allowed {limit}", axis.name())
                });
            }
        }
    }
}

/// Whether axes are where their plan has them.
fn follows_plan(scene: &Scene<'_>) -> bool {
    matches!(scene.phase, Phase::Program | Phase::Stop)
}

impl Checker for Motion {
    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        for drive in 0..scene.plants.len() {
            self.without_power(scene, drive, found);
            self.at_rest(scene, drive, found);
            self.uncommanded(scene, drive, found);
            self.follows(scene, drive, found);
        }
        self.together(scene, found);
        self.shown(scene, found);
    }
}
