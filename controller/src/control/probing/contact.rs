//! Where a contact was: by what the drives captured, and by the samples about it.

use super::{ProbeFailure, ProbeMove, REACHED};
use crate::control::Controller;
use crate::control::node::DeviceNode;
use std::fmt;

/// Samples that are kept: an input's filter may delay the level by less.
const KEPT: usize = 16;

/// By what the place of a contact is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownBy {
    /// Every axis that moved has it from its drives.
    Captured,
    /// Some have; the others follow from the instant that this gives.
    Inferred,
    /// The samples before and behind it.
    Sampled,
}

impl fmt::Display for KnownBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Captured => "by what the drives captured",
            Self::Inferred => "by what some drives captured",
            Self::Sampled => "by samples",
        })
    }
}

/// A contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact<const N: usize> {
    /// Where it was, mm.
    pub(super) at: [f64; N],
    /// By how much that may be off, mm: the greatest of all axes.
    pub(super) uncertainty: f64,
    pub(super) by: KnownBy,
}

/// Where the axes were at the last SYNCs, up to the contact.
#[derive(Clone, Debug)]
pub(super) struct Samples<const N: usize> {
    /// Actual positions, mm, the newest last.
    positions: [[f64; N]; KEPT],
    count: usize,
}

impl<const N: usize> Samples<N> {
    pub(super) fn none() -> Self {
        Self {
            positions: [[0.0; N]; KEPT],
            count: 0,
        }
    }

    fn keep(&mut self, position: [f64; N]) {
        self.positions.rotate_left(1);
        self.positions[KEPT - 1] = position;
        self.count = (self.count + 1).min(KEPT);
    }

    fn kept(&self) -> &[[f64; N]] {
        &self.positions[KEPT - self.count..]
    }

    /// The pairs of samples in a row of an axis, the newest first.
    fn intervals(&self, at: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let pairs = self.kept().windows(2).rev();
        pairs.map(move |pair| (pair[0][at], pair[1][at]))
    }

    /// In which part of which interval a captured position lies; `None` of an axis that rests, or moves so slowly that
    /// its samples do not tell.
    fn moment(&self, at: usize, captured: Place, resolution: f64) -> Option<Moment> {
        let off = captured.uncertainty + resolution;
        let mut intervals = self.intervals(at).enumerate();
        intervals.find_map(|(back, (before, now))| {
            let step = now - before;
            let part = (captured.position - before) / step;
            let uncertainty = off / step.abs();
            let inside = (-uncertainty..=1.0 + uncertainty).contains(&part);
            (inside && step.abs() > 4.0 * off).then_some(Moment {
                back,
                part,
                uncertainty,
            })
        })
    }

    /// Whether a captured position may be one of where an axis was, which stands still while it moves less than
    /// `standstill`.
    fn are_near(&self, at: usize, captured: Place, standstill: f64) -> bool {
        let places = self.kept().iter().map(|position| position[at]);
        let (least, most) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
            (least.min(at), most.max(at))
        });
        let window = standstill + captured.uncertainty;
        (least - window..=most + window).contains(&captured.position)
    }

    /// Where an axis was at a moment.
    fn inferred(&self, at: usize, moment: Moment, resolution: f64) -> Place {
        let mut intervals = self.intervals(at).skip(moment.back);
        let Some((before, now)) = intervals.next() else {
            return self.between(at, resolution);
        };
        let step = now - before;
        // The middle of a parabola is off its chord by an eighth of the change of its steps.
        let earlier = intervals
            .next()
            .map_or(0.0, |(first, second)| second - first);
        let bend = 0.125 * (step - earlier).abs();
        Place {
            position: before + moment.part * step,
            uncertainty: step.abs() * moment.uncertainty + bend + 2.0 * resolution,
        }
    }

    /// Where an axis was between the last two samples.
    fn between(&self, at: usize, resolution: f64) -> Place {
        let here = self.positions[KEPT - 1][at];
        let (before, now) = self.intervals(at).next().unwrap_or((here, here));
        Place {
            position: f64::midpoint(before, now),
            uncertainty: 0.5 * (now - before).abs() + resolution,
        }
    }
}

/// Where an axis was at the contact.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// mm
    position: f64,
    /// By how much it may be off, mm.
    uncertainty: f64,
}

/// When between two samples the contact was.
#[derive(Clone, Copy, Debug)]
struct Moment {
    /// How many intervals before the newest.
    back: usize,
    /// The part of the interval before it, and by how much that may be off.
    part: f64,
    uncertainty: f64,
}

impl<const N: usize> Controller<N> {
    /// Keeps where the axes are now.
    pub(super) fn sample_places(&mut self) {
        let mut position = self.planned.position;
        for (index, axis) in self.axes.iter().enumerate() {
            let (sides, sum) = self.telling(index).fold((0.0, 0.0), |(sides, sum), node| {
                (sides + 1.0, sum + node.actual_mm())
            });
            position[axis.coordinate()] = axis.uncorrected(sum / sides);
        }
        self.probing.samples.keep(position);
    }

    /// What tells where the sides of an axis are.
    fn telling(&self, axis: usize) -> impl Iterator<Item = &DeviceNode> {
        let sides = 0..self.layout.axes[axis].drives.len();
        sides.map(move |side| &self.nodes[self.axes[axis].telling(side)])
    }

    /// The least change of its place that an axis tells, mm.
    fn resolution(&self, axis: usize) -> f64 {
        let sides = self.telling(axis).map(|node| node.scaling().resolution());
        sides.fold(0.0, f64::max)
    }

    /// Where an axis was as all its drives captured the contact, passed at `speed`, mm/s.
    fn captured(&self, axis: usize, speed: f64) -> Option<Place> {
        let drives = &self.layout.axes[axis].drives;
        let (mut sum, mut uncertainty) = (0.0, 0.0_f64);
        for &drive in drives {
            self.layout.probe_captures[drive]?;
            let node = &self.nodes[drive];
            let edge = node.captured(speed)?;
            sum += node.scaling().to_mm(edge.at - node.origin());
            let off = edge.uncertainty.get() as f64 * node.scaling().resolution();
            uncertainty = uncertainty.max(off);
        }
        Some(Place {
            position: self.axes[axis].uncorrected(sum / drives.len() as f64),
            uncertainty,
        })
    }

    /// Where the contact of a probing was.
    ///
    /// # Errors
    /// A drive captured another edge than the one that the samples saw.
    pub(super) fn contact(&self, probing: &ProbeMove<N>) -> Result<Contact<N>, ProbeFailure> {
        let samples = &self.probing.samples;
        let mut moment: Option<Moment> = None;
        for (index, axis) in self.axes.iter().enumerate() {
            let Some(captured) = self.captured(index, probing.speed) else {
                continue;
            };
            let at = axis.coordinate();
            if !samples.are_near(at, captured, axis.limits().standstill) {
                return Err(ProbeFailure::OtherEdge { axis: index });
            }
            let known = samples.moment(at, captured, self.resolution(index));
            let better =
                |known: &Moment| moment.is_none_or(|best| known.uncertainty < best.uncertainty);
            moment = known.filter(better).or(moment);
        }
        let mut contact = Contact {
            at: self.planned.position,
            uncertainty: 0.0,
            by: KnownBy::Captured,
        };
        for (index, axis) in self.axes.iter().enumerate() {
            let at = axis.coordinate();
            let resolution = self.resolution(index);
            let leads = (probing.to[at] - self.probing.from[at]).abs() > REACHED;
            let moves = leads && axis.beside().is_none();
            let (place, by) = match (self.captured(index, probing.speed), moment) {
                (Some(captured), _) => (captured, KnownBy::Captured),
                (None, Some(moment)) => {
                    (samples.inferred(at, moment, resolution), KnownBy::Inferred)
                }
                (None, None) => (samples.between(at, resolution), KnownBy::Sampled),
            };
            contact.at[at] = place.position;
            contact.uncertainty = contact.uncertainty.max(place.uncertainty);
            if moves && by != KnownBy::Captured {
                contact.by = by;
            }
        }
        Ok(contact)
    }
}
