//! Splines: G5, G5.1, and the non-uniform B-splines of G5.2 to G5.3.
//!
//! Each becomes polynomials of the fifth degree by their control points (Bernstein's form), which is exact: a polynomial of
//! a lower degree is one of the fifth by elevating its degree, and a B-spline is a polynomial between two of its knots.
//! Its control points there are values of its blossom, the one symmetric function of as many parameters as the degree that is
//! affine in each and is the polynomial where all are equal: with the left knot a times and the right one b times
//! it gives the control points (de Boor's algorithm with another parameter on each level). Where its points have
//! different weights it is rational, and becomes polynomials in `rational`.

use super::arc::Plane;
use super::axes::{AxisLetter, Point};
use super::command::{Action, Feed};
use super::error::{Fault, Refusal};
use super::execute::{Compensated, State};
use super::lexer::Columns;
use super::modal::{Code, FeedMode, Group, Motion};
use super::motion::{RADIUS_LIMIT, in_range};
use super::rational::{Weighted, approximate};
use super::words::{Words, out_of_range};
use std::collections::VecDeque;

/// Degree of what comes of every spline.
pub(crate) const DEGREE: usize = 5;
/// Control points of one G5.2, at most.
const MOST_POINTS: usize = 1000;
/// What weights may be.
const WEIGHTS: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// How far apart weights may be that are equal, as a part.
const EQUAL: f64 = 1e-9;
/// Halvings after which an extreme is known to rounding.
const HALVINGS: u32 = 60;

/// A vector in X and Y, mm.
pub(crate) type Vector = [f64; 2];

/// A stretch of a spline in X and Y, machine coordinates: a polynomial of degree five by its control points. Other axes rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spline {
    /// Where it starts, machine coordinates.
    pub from: Point,
    /// Where it ends, machine coordinates.
    pub to: Point,
    /// X and Y of the control points between, mm.
    pub inner: [Vector; DEGREE - 1],
}

impl Spline {
    /// X and Y of all control points, mm.
    pub fn controls(&self) -> [Vector; DEGREE + 1] {
        let [from, to] =
            [self.from, self.to].map(|point| [point[AxisLetter::X], point[AxisLetter::Y]]);
        let [a, b, c, d] = self.inner;
        [from, a, b, c, d, to]
    }

    /// The spline with these control points in X and Y, from a point.
    fn new(from: Point, controls: &[Vector]) -> Spline {
        let [_, a, b, c, d, [x, y]] = elevated(controls);
        let mut to = from;
        (to[AxisLetter::X], to[AxisLetter::Y]) = (x, y);
        Spline {
            from,
            to,
            inner: [a, b, c, d],
        }
    }

    /// The point at a parameter from 0 to 1. Exact at both ends.
    pub fn at(&self, parameter: f64) -> Point {
        let mut points = self.controls();
        for level in 1..points.len() {
            for k in 0..points.len() - level {
                points[k] = between(points[k], points[k + 1], parameter);
            }
        }
        let mut point = self.from;
        [point[AxisLetter::X], point[AxisLetter::Y]] = points[0];
        point
    }

    /// Least and greatest value that an axis takes on the whole spline.
    pub fn extent(&self, axis: AxisLetter) -> (f64, f64) {
        let (from, to) = (self.from[axis], self.to[axis]);
        let (mut least, mut greatest) = (from.min(to), from.max(to));
        if let AxisLetter::X | AxisLetter::Y = axis {
            let index = usize::from(axis == AxisLetter::Y);
            let values = self.controls().map(|point| point[index]);
            extremes(values, HALVINGS, &mut |value| {
                least = least.min(value);
                greatest = greatest.max(value);
            });
        }
        (least, greatest)
    }
}

/// Tells values of a polynomial, its extremes among them: a stretch whose control points only rise or fall has them at its
/// ends, others are halved.
fn extremes(values: [f64; DEGREE + 1], halvings: u32, tell: &mut impl FnMut(f64)) {
    let (first, last) = (values[0], values[DEGREE]);
    tell(first);
    tell(last);
    let rises = values.windows(2).all(|pair| pair[0] <= pair[1]);
    let falls = values.windows(2).all(|pair| pair[0] >= pair[1]);
    let most = values.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
    let least = values.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    let rounding = 1e-12 * (1.0 + most.abs().max(least.abs()));
    let within = most - first.max(last) <= rounding && first.min(last) - least <= rounding;
    if rises || falls || within || halvings == 0 {
        return;
    }
    let (mut start, mut end) = (values, values);
    for level in 1..=DEGREE {
        for k in (level..=DEGREE).rev() {
            start[k] = (start[k - 1] + start[k]) / 2.0;
        }
        end[DEGREE - level] = start[DEGREE];
    }
    extremes(start, halvings - 1, tell);
    extremes(end, halvings - 1, tell);
}

/// The point between two others that divides their distance by a part.
pub(crate) fn between<const N: usize>(a: [f64; N], b: [f64; N], part: f64) -> [f64; N] {
    std::array::from_fn(|k| a[k] * (1.0 - part) + b[k] * part)
}

/// Control points of the same polynomial as one of the fifth degree.
fn elevated(controls: &[Vector]) -> [Vector; DEGREE + 1] {
    let mut points = [[0.0; 2]; DEGREE + 1];
    let mut count = controls.len().min(points.len());
    points[..count].copy_from_slice(&controls[..count]);
    while count <= DEGREE {
        points[count] = points[count - 1];
        for k in (1..count).rev() {
            points[k] = between(points[k], points[k - 1], k as f64 / count as f64);
        }
        count += 1;
    }
    points
}

/// The B-spline that G5.2 has begun.
#[derive(Clone, Debug)]
pub(crate) struct Nurbs {
    order: usize,
    /// Of the control points; machine coordinates, mm.
    points: Vec<Vector>,
    /// Of each of them.
    weights: Vec<f64>,
    feed: Feed,
}

impl Nurbs {
    /// Knots at whole numbers, as often at both ends as the order says: it begins in the first point and ends in the
    /// last.
    fn knot(&self, index: usize) -> f64 {
        let spans = self.points.len() - self.order + 1;
        (index + 1).saturating_sub(self.order).min(spans) as f64
    }

    /// The blossom between two knots, the left of which is `knot(span)`.
    fn blossom(&self, span: usize, parameters: &[f64]) -> Weighted {
        let degree = self.order - 1;
        let mut points = [[0.0; 3]; DEGREE + 1];
        for (k, point) in points[..=degree].iter_mut().enumerate() {
            let index = span - degree + k;
            let ([x, y], weight) = (self.points[index], self.weights[index]);
            *point = [x * weight, y * weight, weight];
        }
        for (level, parameter) in parameters.iter().enumerate() {
            for k in (level + 1..=degree).rev() {
                let from = self.knot(span - degree + k);
                let to = self.knot(span + k - level);
                points[k] = between(points[k - 1], points[k], (parameter - from) / (to - from));
            }
        }
        points[degree]
    }

    /// The control points of polynomials that go along it; `None` if its weights are beyond that.
    fn polynomials(mut self) -> Option<Vec<Vec<Vector>>> {
        // Only the ratios of weights count.
        let first = self.weights[0];
        let differs = |weight: &f64| (weight - first).abs() > EQUAL * first;
        if !self.weights.iter().any(differs) {
            self.weights.fill(1.0);
            let in_plane =
                |controls: Vec<Weighted>| controls.iter().map(|[x, y, _]| [*x, *y]).collect();
            return Some(self.stretches().map(in_plane).collect());
        }
        let mut polynomials = Vec::new();
        for stretch in self.stretches() {
            if !approximate(&stretch, &mut |quintic| polynomials.push(quintic.to_vec())) {
                return None;
            }
        }
        // To the last bit, which dividing by the weight is not.
        let end = polynomials
            .last_mut()
            .and_then(|controls| controls.last_mut());
        if let (Some(end), Some(point)) = (end, self.points.last()) {
            *end = *point;
        }
        Some(polynomials)
    }

    /// The control points of each of its stretches between two knots.
    fn stretches(&self) -> impl Iterator<Item = Vec<Weighted>> + '_ {
        let degree = self.order - 1;
        (degree..self.points.len()).map(move |span| {
            let (left, right) = (self.knot(span), self.knot(span + 1));
            let points = (0..=degree).map(|k| {
                let mut parameters = [left; DEGREE];
                parameters[..k].fill(right);
                self.blossom(span, &parameters[..degree])
            });
            points.collect()
        })
    }
}

impl State {
    /// G5, G5.1, G5.2 or G5.3 with the words of its block.
    pub(crate) fn spline(
        &mut self,
        motion: Motion,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = motion.code();
        let refuse = |fault| Err(Refusal::new(columns, fault));
        if self.compensated != Compensated::Off {
            return refuse(Fault::WhileCompensated { code });
        }
        if self.modes.plane != Plane::Xy {
            return refuse(Fault::SplinePlane { code });
        }
        let axes = self.setup.axes;
        if let Some(axis) = [AxisLetter::X, AxisLetter::Y]
            .into_iter()
            .find(|axis| !axes.contains(*axis))
        {
            return refuse(Fault::NoSuchAxis { axis, axes });
        }
        let other = |axis: &AxisLetter| {
            !matches!(axis, AxisLetter::X | AxisLetter::Y) && words.has(axis.letter() as u8)
        };
        if let Some(axis) = AxisLetter::ALL.into_iter().find(other) {
            return Err(words.refuse(axis.letter() as u8, Fault::SplineAxis { code, axis }));
        }
        match motion {
            Motion::Cubic => self.cubic(words, columns, commands),
            Motion::Quadratic => self.quadratic(words, columns, commands),
            _ => self.nurbs_point(words, columns),
        }
    }

    /// G5: the directions at both ends by I J from the start and P Q from the end; without I and J it goes on as the G5
    /// before it ended.
    fn cubic(
        &mut self,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = Motion::Cubic.code();
        let before = self.spline_direction.take();
        let to = self.target(words, code, false)?;
        let first = self.offset_words(words, code, [b'I', b'J'])?;
        let second = self.offset_words(words, code, [b'P', b'Q'])?;
        let missing = |words| Refusal::new(columns, Fault::MissingWord { code, words });
        let first = match first {
            [None, None] => before.ok_or_else(|| missing("I and J, as no G5 is before it"))?,
            [Some(i), Some(j)] => [i, j],
            _ => return Err(missing("both I and J")),
        };
        let [Some(p), Some(q)] = second else {
            return Err(missing("both P and Q"));
        };
        let last = [-p, -q];
        let [start, end] = [self.at, to].map(|point| [point[AxisLetter::X], point[AxisLetter::Y]]);
        let [[i, j], [p, q]] = [first, [p, q]].map(|vector| self.turned_vector(vector));
        let controls = [
            start,
            [start[0] + i, start[1] + j],
            [end[0] + p, end[1] + q],
            end,
        ];
        self.go_along(&controls, words, code, columns, commands)?;
        self.spline_direction = Some(last);
        Ok(())
    }

    /// G5.1: one control point, by I J from the start.
    fn quadratic(
        &mut self,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = Motion::Quadratic.code();
        let to = self.target(words, code, false)?;
        let offsets = self.offset_words(words, code, [b'I', b'J'])?;
        if offsets == [None; 2] {
            let words = "I and J, from the start to the control point";
            return Err(Refusal::new(columns, Fault::MissingWord { code, words }));
        }
        let [start, end] = [self.at, to].map(|point| [point[AxisLetter::X], point[AxisLetter::Y]]);
        let [i, j] = self.turned_vector(offsets.map(Option::unwrap_or_default));
        let controls = [start, [start[0] + i, start[1] + j], end];
        self.go_along(&controls, words, code, columns, commands)
    }

    /// A vector of the program in machine coordinates.
    fn turned_vector(&self, [x, y]: Vector) -> Vector {
        let turned = self.coordinates().turned(Point::xyz(x, y, 0.0));
        [turned[AxisLetter::X], turned[AxisLetter::Y]]
    }

    /// Two words that are lengths from a point, mm.
    fn offset_words(
        &self,
        words: &mut Words,
        code: Code,
        letters: [u8; 2],
    ) -> Result<[Option<f64>; 2], Refusal> {
        let mut values = [None; 2];
        for (value, letter) in values.iter_mut().zip(letters) {
            let given = words
                .take(letter, code)?
                .map(|number| number * self.modes.unit());
            if let Some(length) = given.filter(|length| length.abs() > RADIUS_LIMIT) {
                let fault = out_of_range(char::from(letter), length, "within 10 km");
                return Err(words.refuse(letter, fault));
            }
            *value = given;
        }
        Ok(values)
    }

    /// Hands out a polynomial by its control points in the plane.
    fn go_along(
        &mut self,
        controls: &[Vector],
        words: &mut Words,
        code: Code,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let spline = Spline::new(self.at, controls);
        let feed = self.feed(words, code, spline.to);
        let feed = feed.map_err(|fault| Refusal::new(columns, fault))?;
        self.go_on_spline(spline, feed, words, columns, commands)
    }

    fn go_on_spline(
        &mut self,
        spline: Spline,
        feed: Feed,
        words: &Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let controls = spline.controls();
        if controls.iter().all(|point| *point == controls[0]) {
            return Err(Refusal::new(columns, Fault::SplineNowhere));
        }
        self.go(Action::Spline { spline, feed }, words, columns, commands)
    }

    /// G5.2 and the lines behind it: a control point each.
    fn nurbs_point(&mut self, words: &mut Words, columns: Columns) -> Result<(), Refusal> {
        let code = Code::G(52);
        if self.modes.feed_mode == FeedMode::InverseTime {
            return Err(Refusal::new(columns, Fault::CycleInverseTime { code }));
        }
        let weight = words.take(b'P', code)?.unwrap_or(1.0);
        if !WEIGHTS.contains(&weight) {
            let fault = out_of_range('P', weight, "a weight from 0.001 to 1000");
            return Err(words.refuse(b'P', fault));
        }
        let has_point = words.has_axes() || words.has_polar();
        let order = words.take_whole(b'L', code, 3..=6, "an order from 3 to 6")?;
        let nurbs = match &mut self.nurbs {
            Some(_) if order.is_some() => {
                let fault = Fault::UnusedWord { letter: 'L' };
                return Err(words.refuse(b'L', fault));
            }
            Some(nurbs) => nurbs,
            None => {
                let from = self.at;
                let feed = self.feed(words, code, from);
                self.nurbs.insert(Nurbs {
                    order: order.unwrap_or(3) as usize,
                    weights: vec![if has_point { 1.0 } else { weight }],
                    points: vec![[from[AxisLetter::X], from[AxisLetter::Y]]],
                    feed: feed.map_err(|fault| Refusal::new(columns, fault))?,
                })
            }
        };
        if nurbs.points.len() >= MOST_POINTS {
            let allowed = MOST_POINTS;
            return Err(Refusal::new(columns, Fault::NurbsTooLong { allowed }));
        }
        if !has_point {
            return Ok(());
        }
        // A position is where the control point before it is.
        let to = self.target(words, code, false)?;
        for axis in [AxisLetter::X, AxisLetter::Y] {
            in_range(axis, to[axis]).map_err(|fault| Refusal::new(columns, fault))?;
        }
        if let Some(nurbs) = &mut self.nurbs {
            nurbs.points.push([to[AxisLetter::X], to[AxisLetter::Y]]);
            nurbs.weights.push(weight);
        }
        self.nurbs_start.get_or_insert(self.at);
        self.at = to;
        Ok(())
    }

    /// G5.3: along what G5.2 began.
    pub(crate) fn end_nurbs(
        &mut self,
        words: &Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        self.modes.motion = Motion::None;
        let Some(nurbs) = self.nurbs.take() else {
            return Err(Refusal::new(columns, Fault::NurbsNotBegun));
        };
        self.at = self.nurbs_start.take().unwrap_or(self.at);
        if nurbs.points.len() < nurbs.order {
            let (points, order) = (nurbs.points.len(), nurbs.order);
            return Err(Refusal::new(columns, Fault::NurbsTooFew { points, order }));
        }
        let feed = nurbs.feed;
        let Some(polynomials) = nurbs.polynomials() else {
            return Err(Refusal::new(columns, Fault::NurbsWeights));
        };
        for controls in polynomials {
            let spline = Spline::new(self.at, &controls);
            self.go_on_spline(spline, feed, words, columns, commands)?;
        }
        Ok(())
    }

    /// While G5.2 is open, only its points and G5.3 may come.
    pub(crate) fn only_nurbs(&self, words: &Words) -> Result<(), Refusal> {
        if self.nurbs.is_none() {
            return Ok(());
        }
        match words.first_code_but(Group::Motion) {
            Some((code, columns)) => Err(Refusal::new(columns, Fault::NurbsOpen { code })),
            None => match words.code(Group::Motion) {
                None | Some(Code::G(52 | 53)) => Ok(()),
                Some(code) => {
                    let columns = words.code_columns(Group::Motion).unwrap_or_default();
                    Err(Refusal::new(columns, Fault::NurbsOpen { code }))
                }
            },
        }
    }
}
