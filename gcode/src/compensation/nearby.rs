//! Parts of a contour in their order, found by where they are.
//!
//! A contour is a thread through space: what follows on each other lies side by side. So its order is
//! as good as any sorting by place: eight parts in a row have a box around them, eight boxes in a row
//! one around those, and so on. Adding a part widens a box of each size; looking for what is near
//! goes into those boxes alone that are. Neither sorts anything, and the oldest parts go first when
//! there are [`REMEMBERED`]: memory is bounded whatever a program does.

use std::collections::VecDeque;

use super::segment::Vector;

/// How many parts are remembered: eight to the power of how many sizes of boxes there are.
pub(crate) const REMEMBERED: usize = 1 << (BITS * SIZES);
const SIZES: usize = 6;
/// Eight parts or boxes to a box.
const BITS: usize = 3;
/// Heights that differ by less are one, mm.
const SAME_HEIGHT: f64 = 1e-6;

/// A box, mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Least and greatest coordinates in the plane.
    pub(crate) extent: [Vector; 2],
    /// The same across the plane.
    pub(crate) height: [f64; 2],
}

impl Bounds {
    fn include(&mut self, other: &Bounds) {
        for k in 0..2 {
            self.extent[0][k] = self.extent[0][k].min(other.extent[0][k]);
            self.extent[1][k] = self.extent[1][k].max(other.extent[1][k]);
        }
        self.height[0] = self.height[0].min(other.height[0]);
        self.height[1] = self.height[1].max(other.height[1]);
    }

    /// Whether the two have a height in common and are nearer to each other than `reach` in the plane.
    fn is_near(&self, other: &Bounds, reach: f64) -> bool {
        let apart = |k: usize| {
            let after = other.extent[0][k] - self.extent[1][k];
            after.max(self.extent[0][k] - other.extent[1][k]).max(0.0)
        };
        let [x, y] = [apart(0), apart(1)];
        self.height[0] <= other.height[1] + SAME_HEIGHT
            && other.height[0] <= self.height[1] + SAME_HEIGHT
            && reach > 0.0
            && x * x + y * y < reach * reach
    }
}

/// What has a place.
pub(crate) trait Bounded {
    fn bounds(&self) -> Bounds;
}

/// The parts that were remembered last, by numbers that count on.
#[derive(Debug)]
pub(crate) struct Nearby<T> {
    parts: Numbered<T>,
    /// Boxes around eight parts, around eight of those, and so on.
    boxes: [Numbered<Bounds>; SIZES],
}

/// A queue whose members keep their numbers.
#[derive(Debug)]
struct Numbered<T> {
    first: usize,
    list: VecDeque<T>,
}

impl<T> Numbered<T> {
    const fn new() -> Numbered<T> {
        Numbered {
            first: 0,
            list: VecDeque::new(),
        }
    }

    fn end(&self) -> usize {
        self.first + self.list.len()
    }

    fn get(&self, number: usize) -> Option<&T> {
        self.list.get(number.checked_sub(self.first)?)
    }

    /// Forgets what comes before a number.
    fn forget_before(&mut self, number: usize) {
        while self.first < number && self.list.pop_front().is_some() {
            self.first += 1;
        }
    }
}

impl<T: Bounded> Nearby<T> {
    pub(crate) fn new() -> Nearby<T> {
        Nearby {
            parts: Numbered::new(),
            boxes: [const { Numbered::new() }; SIZES],
        }
    }

    /// The number that the next part gets.
    pub(crate) fn end(&self) -> usize {
        self.parts.end()
    }

    pub(crate) fn get(&self, number: usize) -> Option<&T> {
        self.parts.get(number)
    }

    /// The parts from a number on that are remembered. They may become smaller.
    pub(crate) fn from(&mut self, number: usize) -> impl Iterator<Item = (usize, &mut T)> {
        let first = number.max(self.parts.first);
        let skipped = (first - self.parts.first).min(self.parts.list.len());
        (first..).zip(self.parts.list.range_mut(skipped..))
    }

    pub(crate) fn push(&mut self, part: T) {
        let number = self.end();
        let bounds = part.bounds();
        self.parts.list.push_back(part);
        self.parts
            .forget_before((number + 1).saturating_sub(REMEMBERED));
        for (size, boxes) in self.boxes.iter_mut().enumerate() {
            let bits = BITS * (size + 1);
            if number >> bits == boxes.end() {
                boxes.list.push_back(bounds);
            } else if let Some(last) = boxes.list.back_mut() {
                last.include(&bounds);
            }
            boxes.forget_before(self.parts.first >> bits);
        }
    }

    /// The numbers of the parts whose box is nearer than `reach`, in their order.
    pub(crate) fn near(&self, bounds: &Bounds, reach: f64) -> Vec<usize> {
        let mut found = Vec::new();
        let largest = &self.boxes[SIZES - 1];
        for number in largest.first..largest.end() {
            self.look_into(SIZES - 1, number, bounds, reach, &mut found);
        }
        found
    }

    fn look_into(
        &self,
        size: usize,
        number: usize,
        bounds: &Bounds,
        reach: f64,
        found: &mut Vec<usize>,
    ) {
        let is_near = |it: &Bounds| it.is_near(bounds, reach);
        if !self.boxes[size].get(number).is_some_and(is_near) {
            return;
        }
        let inside = number << BITS..(number + 1) << BITS;
        match size.checked_sub(1) {
            Some(smaller) => {
                inside.for_each(|number| self.look_into(smaller, number, bounds, reach, found));
            }
            None => found.extend(inside.filter(|number| {
                self.get(*number)
                    .is_some_and(|part| is_near(&part.bounds()))
            })),
        }
    }
}
