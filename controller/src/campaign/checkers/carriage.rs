//! A drive is sent beyond its axis by what the machine file says of the axis's transmission, and no further; and where that is right, the
//! carriage is where the axis is.
//!
//! An axis is at q, as operators are shown, where its drives are at q − e(q) + β: e is its lead error and β half of its backlash to
//! the side to which it went last ([compensation.md](../../../../docs/compensation.md)). [`Corrected`] makes that of the case's own numbers, with a
//! spline of its own. While an axis moves β is somewhere between both flanks; at rest it is that of the flank, once the axis went further than
//! its drive tells apart.

use super::super::case::Case;
use super::super::machine::ErrorSpec;
use super::scene::{DISTURBED, NOISE, STEEPEST, SWAYS, extent};
use super::{Checker, Found, Scene};
use crate::control::{Phase, State};
use crate::machine::{Machine, Simulation};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use syncline_canopen::Instant;

const NAME: &str = "carriage";

/// Positions that are shown are of the SYNC before, or of one a little earlier: what drives latched at so many wake-ups.
const WINDOW: usize = 8;
/// What a drive latched is known as long as its last SYNC is no older, cycles.
const LATELY: f64 = 1.5;
/// What rests for so long has taken up its backlash, s: beside what that takes.
const SETTLES: f64 = 0.3;
/// Increments of the drive by which a carriage may stand beside the place of its axis: as much as the shaft sways is left of the
/// following error once the loop has settled.
const STANDS: f64 = 2.0 * SWAYS;

/// Sweeps in which slopes are found, to the last digits.
const SWEEPS: usize = 80;

/// Increments that rounding has two sides differ, now and at first.
const TOGETHER: f64 = 2.1;
/// Steps in which a position is found of which the correction is known: each leaves a tenth at the most.
const STEPS: usize = 12;

/// What the drives of an axis are sent beyond it.
#[derive(Debug, Default)]
pub struct Corrected {
    curve: Curve,
    /// Half of the backlash, mm.
    pub half: f64,
    /// What lies between motors and carriage of the simulated axis, if it is there: half of its play, and its lead error.
    carriage: Option<(f64, Vec<(f64, f64)>)>,
    /// The furthest that warmth puts its carriage off, mm.
    grows: f64,
}

/// A lead error: the natural cubic spline through its points, by the slopes there, and to either side of these a way out to where it is constant.
#[derive(Debug, Default)]
struct Curve {
    /// Position, error and slope, mm.
    points: Vec<[f64; 3]>,
}

impl Curve {
    fn new(errors: &ErrorSpec) -> Self {
        let points = errors.lead_error.iter();
        let mut points: Vec<[f64; 3]> =
            points.map(|(at, error)| [*at, 1e-3 * error, 0.0]).collect();
        // Each slope by those beside it, over and over: twice as much of its own is in its equation as of theirs, at the least.
        for _ in 0..SWEEPS {
            for place in 0..points.len() {
                let (mut right, mut own) = (0.0, 0.0);
                let [at, error, _] = points[place];
                let beside = [place.checked_sub(1), Some(place + 1)]
                    .into_iter()
                    .flatten();
                for [there, other, slope] in beside.filter_map(|it| points.get(it).copied()) {
                    let length = (there - at).abs();
                    let rise = (other - error) / (there - at);
                    right += (3.0 * rise - slope) / length;
                    own += 2.0 / length;
                }
                points[place][2] = if own > 0.0 { right / own } else { 0.0 };
            }
        }
        Self { points }
    }

    fn at(&self, position: f64) -> f64 {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else {
            return 0.0;
        };
        let behind = self.points.partition_point(|[at, ..]| *at <= position);
        match (behind, self.points.get(behind)) {
            (0, _) => {
                let length = self.points.get(1).map_or(1.0, |it| it[0] - first[0]);
                first[1] - way_out(first[0] - position, first[2], length)
            }
            (_, None) => {
                let before = self.points.len().saturating_sub(2);
                way_out(
                    position - last[0],
                    last[2],
                    last[0] - self.points[before][0],
                ) + last[1]
            }
            (_, Some(&[to, there, end])) => {
                let [from, here, begin] = self.points[behind - 1];
                let length = to - from;
                let t = (position - from) / length;
                let (one, other) = (t * t * (3.0 - 2.0 * t), t * (1.0 - t));
                here + one * (there - here) + length * other * ((1.0 - t) * begin - t * end)
            }
        }
    }
}

/// What it changes by, so far beyond a point with a slope, along two pieces of a length of which each is a cubic: the slope is there at first,
/// and without curvature, and behind the second one nothing is.
fn way_out(beyond: f64, slope: f64, length: f64) -> f64 {
    let cubic = |t: f64| slope * t * t * t / (6.0 * length * length);
    match beyond / length {
        ..1.0 => slope * beyond - cubic(beyond),
        1.0..2.0 => slope * length - cubic(2.0 * length - beyond),
        _ => slope * length,
    }
}

/// Straight lines between the points, and constant beyond them, mm.
fn on_straight_lines(points: &[(f64, f64)], position: f64) -> f64 {
    let behind = points.partition_point(|(at, _)| *at <= position);
    let error = match (
        behind.checked_sub(1).map(|it| points[it]),
        points.get(behind),
    ) {
        (Some((from, here)), Some((to, there))) => {
            here + (there - here) * (position - from) / (to - from)
        }
        (Some((_, here)), None) => here,
        (None, Some((_, there))) => *there,
        (None, None) => 0.0,
    };
    1e-3 * error
}

impl Corrected {
    /// Of every axis of a case.
    pub(super) fn all(case: &Case) -> Vec<Self> {
        let axes = case.machine.axes.iter();
        let all = axes.map(|axis| {
            let corrected = axis.corrected.clone().unwrap_or_default();
            let carriage = axis.transmission.as_ref().map(|it| {
                let errors = &it.errors;
                let play = it.soft.map_or(0.0, |_| errors.backlash);
                (0.5 * play, errors.lead_error.clone())
            });
            Self {
                grows: (axis.warmth.as_ref()).map_or(0.0, |it| it.greatest(axis.soft_limits)),
                curve: Curve::new(&corrected),
                half: 0.5 * corrected.backlash,
                carriage,
            }
        });
        all.collect()
    }

    /// Where its drives are to be between the flanks of an axis at a position, mm.
    pub(super) fn drives(&self, position: f64) -> f64 {
        position - self.curve.at(position)
    }

    /// Where an axis is whose drives are there, mm: by half of its backlash more or less.
    pub(super) fn axis(&self, drives: f64) -> f64 {
        let step = |position, _| drives + self.curve.at(position);
        (0..STEPS).fold(drives, step)
    }

    /// The greatest that the carriage or the drives are off a position, mm.
    pub(super) fn greatest(&self) -> f64 {
        let errors = self.curve.points.iter();
        let steepest = |it: &[f64; 3]| it[2].abs();
        // Between two points it is not beyond both by more than the slopes have it.
        let apart = self.curve.points.windows(2);
        let bulge = apart.map(|it| (it[1][0] - it[0][0]) * steepest(&it[0]).max(steepest(&it[1])));
        let own = errors.map(|it| it[1].abs()).fold(0.0, f64::max) + bulge.fold(0.0, f64::max);
        let carriage = self.carriage.as_ref().map_or(0.0, |(half, points)| {
            let errors = points.iter().map(|(_, error)| 1e-3 * error.abs());
            half + errors.fold(0.0, f64::max)
        });
        self.half + own + carriage + 2.0 * self.grows
    }
}

/// See the module.
pub(super) struct Carriage {
    axes: Vec<Watched>,
    /// By bus: when its last SYNC came.
    syncs: Vec<Instant>,
}

/// An axis.
#[derive(Default)]
struct Watched {
    /// Where it was shown to be sent at the last wake-ups, and where its drives were, in the mean of its sides, the newest first, mm.
    seen: VecDeque<(f64, f64)>,
    /// It was sent somewhere: what is shown before is where it was found.
    is_planned: bool,
    /// Since when it is planned to be where it is, s.
    since: f64,
    /// As far as it came the way it goes, mm.
    reached: f64,
    /// Which way that is: 1 or −1; `None` if nobody knows the flank.
    direction: Option<f64>,
    /// As far as its drives came that way, mm, counted along it.
    furthest: f64,
    /// Between which places its drives were since it was planned to go anywhere, mm.
    been: Option<[f64; 2]>,
    /// How far the drive of its second side was sent beyond that of the first one as it was seen first, mm.
    apart: Option<f64>,
}

impl Watched {
    /// It is planned to be there, and its drives are; of an axis whose drives tell so much apart.
    fn go_on(&mut self, planned: f64, sent: f64, resolution: f64, now: f64) {
        let before = self.seen.front().map(|it| it.0);
        if before != Some(planned) {
            self.since = now;
        }
        self.seen.truncate(WINDOW - 1);
        self.seen.push_front((planned, sent));
        if !self.is_planned {
            self.is_planned = before.is_some_and(|it| it != planned);
            self.reached = planned;
            return;
        }
        let went = planned - self.reached;
        let direction = 1_f64.copysign(went);
        if self.direction == Some(direction) || went.abs() > 2.0 * resolution {
            if self.direction.replace(direction) != Some(direction) {
                self.furthest = f64::NEG_INFINITY;
            }
            self.reached = planned;
        } else if went.abs() > 0.5 * resolution {
            // It has turned round, or has not.
            self.direction = None;
        }
    }

    /// Its drives have come there, mm.
    fn came(&mut self, drives: f64) {
        let [least, most] = self.been.unwrap_or([drives; 2]);
        self.been = Some([least.min(drives), most.max(drives)]);
        if let Some(direction) = self.direction {
            self.furthest = self.furthest.max(direction * drives);
        }
    }

    /// How far its drives were beyond where they are sent now, the way it went, mm.
    fn overshot(&self, direction: f64) -> f64 {
        (self.furthest - direction * self.seen[0].1).max(0.0)
    }

    /// Whether its carriage was pushed, wherever in a play of so many mm it stood at first: until then it stays where that was.
    fn has_pushed(&self, play: f64) -> bool {
        self.been.is_some_and(|[least, most]| most - least >= play)
    }

    /// Where it is planned to be.
    fn planned(&self) -> f64 {
        self.seen[0].0
    }

    /// It is planned to rest for so long that it has taken up its backlash, and all that drives are sent is known.
    fn rests(&self, scene: &Scene<'_>, axis: usize) -> bool {
        let rests = scene.seconds() - self.since;
        rests > SETTLES + taken_up(scene, axis) && self.seen.iter().all(|it| *it == self.seen[0])
    }
}

impl Carriage {
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            axes: machine.axes.iter().map(|_| Watched::default()).collect(),
            syncs: vec![Instant::ZERO; machine.buses.len()],
        }
    }
}

/// How long taking up a backlash takes at the most, s: from rest to rest with a quarter of each limit.
pub(super) fn taken_up(scene: &Scene<'_>, axis: usize) -> f64 {
    let (backlash, limits) = (
        2.0 * scene.corrected[axis].half,
        &scene.machine.axes[axis].sent_limits,
    );
    let [v, a, j] = [limits.velocity, limits.acceleration, limits.jerk].map(|it| 0.25 * it);
    backlash / v + 2.0 * (backlash / a).sqrt() + (32.0 * backlash / j).cbrt()
}

impl Checker for Carriage {
    fn sync(&mut self, scene: &Scene<'_>, bus: usize, _: &mut Found) {
        self.syncs[bus] = scene.now;
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        for (index, watched) in self.axes.iter_mut().enumerate() {
            let axis = &scene.machine.axes[index];
            let sent = axis.drives.iter().map(|&index| {
                let (drive, bus) = (&scene.drives[index], scene.machine.drives[index].bus);
                let is_new = scene.since(self.syncs[bus]) < LATELY * scene.period();
                let is_certain = is_new && drive.in_effect && drive.latched_of == 1;
                let latched = drive.latched.filter(|_| is_certain);
                latched.map(|it| scene.mm(index, it))
            });
            let sent: Option<Vec<f64>> = sent.collect();
            let follows = matches!(scene.phase, Phase::Program | Phase::Stop);
            let Some(sent) = sent.filter(|_| follows && scene.is_placed(index)) else {
                *watched = Watched::default();
                continue;
            };
            sent_together(scene, index, watched, &sent, found);
            let sent = sent.iter().sum::<f64>() / sent.len() as f64;
            let resolution = scene.machine.drives[axis.drives[0]].scaling.resolution();
            watched.go_on(scene.commanded[index], sent, resolution, scene.seconds());
            if !watched.is_planned || watched.seen.len() < WINDOW {
                continue;
            }
            let actual = scene.middle(index, |drive| scene.actual(drive));
            watched.came(actual.unwrap_or(sent));
            sent_there(scene, index, watched, resolution, found);
            stands_there(scene, index, watched, resolution, found);
        }
    }
}

/// Its sides are sent as far apart as they began, but for what their coupling may add, and what a homing takes out.
fn sent_together(
    scene: &Scene<'_>,
    index: usize,
    watched: &mut Watched,
    sent: &[f64],
    found: &mut Found,
) {
    let axis = &scene.machine.axes[index];
    let &[one, other] = sent else { return };
    // A stop may be one of sides that were being taken square; of a burst that is late both sides are not sent the same instant.
    let is_certain = scene.phase == Phase::Program && !scene.is_disturbed(DISTURBED);
    if scene.state == State::Homing || !is_certain {
        watched.apart = None;
        return;
    }
    let apart = other - one - *watched.apart.get_or_insert(other - one);
    let resolution = (axis.drives.iter())
        .map(|&drive| scene.machine.drives[drive].scaling.resolution())
        .fold(0.0, f64::max);
    // Where it was seen first it was sent apart, too.
    let limit = 2.0 * axis.cross_coupling.map_or(0.0, |it| it.limit);
    let allowed = limit + TOGETHER * resolution;
    if apart.abs() > allowed {
        found.violate(NAME, scene, "sides that are sent apart", || {
            let name = axis.name();
            format!("axis {name}: {apart} mm further apart than at first, allowed {allowed}")
        });
    }
}

/// Its drives are sent as far beyond it as its transmission is off.
fn sent_there(
    scene: &Scene<'_>,
    index: usize,
    watched: &Watched,
    resolution: f64,
    found: &mut Found,
) {
    let corrected = &scene.corrected[index];
    let flank = match watched.direction.filter(|_| watched.rests(scene, index)) {
        Some(direction) => [direction * corrected.half; 2],
        None => [-corrected.half, corrected.half],
    };
    let right = watched.seen.iter().map(|it| corrected.drives(it.0));
    let [least, most] = extent(right);
    let right = [least + flank[0], most + flank[1]];
    let sent = extent(watched.seen.iter().map(|it| it.1));
    let allowed = NOISE * resolution + scene.uncertainty[index] + scene.homed_off[index];
    if right[1] < sent[0] - allowed || right[0] > sent[1] + allowed {
        found.violate(NAME, scene, "a correction that the transmission does not ask for", || {
            let (name, planned) = (scene.machine.axes[index].name(), watched.planned());
            format!("axis {name} at {planned} mm: its drives are sent to {sent:?}, right is {right:?}, allowed {allowed} off")
        });
    }
}

/// By how much what a drive moves may be away from it against a transmission that gives way, mm: by the friction of its guide, by a weight,
/// and by grease where it goes at that speed, mm/s.
pub(super) fn wound(scene: &Scene<'_>, drive: usize, speed: f64) -> f64 {
    let axis = &scene.machine.axes[scene.machine.drives[drive].axis];
    let travel = axis.mm_per_revolution.abs() / TAU;
    let own = axis.simulation.as_ref().and_then(Simulation::driven);
    let train = own.map(|own| scene.machine.at_shaft(drive, &own).train);
    let twist = train.and_then(|train| {
        let guide = train.guide.level(0.0) + train.guide.viscous * speed / travel;
        let torque = guide + train.load_torque.abs();
        Some(torque / train.elasticity?.stiffness)
    });
    twist.map_or(0.0, |twist| twist * travel)
}

/// At rest the carriage is where the axis is, if what the machine file compensates is what it has.
fn stands_there(
    scene: &Scene<'_>,
    index: usize,
    watched: &Watched,
    resolution: f64,
    found: &mut Found,
) {
    let (corrected, axis) = (&scene.corrected[index], &scene.machine.axes[index]);
    let spec = &scene.case.machine.axes[index];
    let fits = spec.corrected.is_some()
        && spec.corrected.as_ref() == spec.transmission.as_ref().map(|it| &it.errors);
    let (&Some((half, ref points)), true) = (&corrected.carriage, fits) else {
        return;
    };
    let Some(direction) = watched.direction else {
        return;
    };
    if !watched.rests(scene, index)
        || scene.seconds() - watched.since < DISTURBED
        || scene.is_disturbed(DISTURBED)
        || spec.homing.is_some()
        || spec.warmth.is_some()
        || spec
            .simulation
            .as_ref()
            .is_some_and(|it| it.contains("gravity"))
    {
        return;
    }
    let Some(load) = scene.middle(index, |drive| scene.carriage(drive)) else {
        return;
    };
    // What is simulated has straight lines between the points: they are those of where the carriage is, which is off by that.
    let at = watched.planned();
    let lines = (on_straight_lines(points, at) - corrected.curve.at(at)).abs();
    let lines = lines / (1.0 - STEEPEST);
    let wound = axis.drives.iter().map(|drive| wound(scene, *drive, 0.0));
    let allowed = STANDS * resolution + lines + wound.fold(0.0, f64::max);
    // A drive that overshoots takes its carriage along, which stays there as the drive comes back through the play. One that
    // has just been enabled may have it anywhere there.
    let play = 2.0 * half;
    let overshot = match watched.has_pushed(play) {
        true => watched.overshot(direction).min(play),
        false => play,
    };
    let off = direction * (load - watched.planned());
    if !(-allowed..=overshot + allowed).contains(&off) {
        found.violate(NAME, scene, "a carriage beside its axis", || {
            let (name, planned) = (axis.name(), watched.planned());
            format!("axis {name} at {planned} mm: its carriage is at {load}, allowed {allowed} off, and {overshot} beyond")
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    /// Its own spline is that of the machine file, which finds it in another way.
    #[test]
    fn both_splines_are_one() {
        let mut tables = 0;
        for seed in 0..400 {
            let case = Case::of(seed);
            let machine: Machine = case.machine.machine().unwrap();
            let corrected = Corrected::all(&case);
            for (axis, own) in machine.axes.iter().zip(corrected) {
                let Some(compensation) = &axis.compensation else {
                    continue;
                };
                tables += usize::from(!own.curve.points.is_empty());
                let (least, most) = axis.limits.position;
                let greatest = compensation.lead_error.greatest()[0].max(1e-9);
                for step in -60..=160 {
                    let at = least + (most - least) * f64::from(step) / 100.0;
                    let off = own.curve.at(at) - compensation.lead_error.at(at).0;
                    assert!(off.abs() < 1e-9 * greatest, "{seed}: {off} at {at}");
                }
            }
        }
        assert!(tables > 50, "{tables}");
    }
}
