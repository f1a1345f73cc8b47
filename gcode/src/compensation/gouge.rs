//! What the tool cuts beyond the contour.
//!
//! The tool is a disc that is swept along its way. A **wall** is what is left of the contour behind
//! it: wherever the disc reaches more than [`ALLOWED`] across a wall, from its side or from behind,
//! whichever of the two comes first and however far apart they are, the part is spoilt. So each part
//! of the way is measured against all walls, and each wall against all of the way, by the exact
//! distance of lines and arcs. Ways on and off are ways like any other.
//!
//! **What is a wall.** At first sight all of the contour. That refuses what everybody writes: the arc
//! onto a pocket's wall lies in the pocket, and is cut when the tool comes round. It is not the
//! contour's affair, and what tells so is that the contour **closes**: it touches or crosses what
//! came before, having turned by more than half a turn since.
//!
//! ```text
//!             ╭────────────╮            lead-in, then the loop: it closes at P
//!             │     ╭      │            (an overlap and the lead-out follow);
//!             │    ╱       │            a loop whose ends cross closes where they do
//!             ╰───P────────╯
//! ```
//!
//! - A contour that does not close is a wall from end to end. But it has its ends where there is
//!   nothing: within a radius of them, the ways on and off may cut it.
//! - Where one closes, the loop is a wall. What leads onto it and off it is none: up to [`LEAD`]
//!   blocks before it, and as many behind the last loop. Blocks that change their height, as those of
//!   a helix, are not counted. Between two loops, of a pocket and its island, it is the same. The
//!   tool on these may not cut into loops all the same.
//! - What goes along a loop again, an overlap or a further pass, is the same wall.
//! - A contour that crosses itself elsewhere cuts into itself, and is refused.
//! - Walls are what they are at their height. A pass at another depth neither closes nor cuts what
//!   is above or below. Helices and ramps are taken in parts, each with the heights that it has. Ways
//!   on and off that change their height come from where there is nothing, and are not judged.
//!
//! Whether a block leads onto a loop is known when it closes. Until then what cuts the first blocks
//! is a suspicion, which the loop refutes or confirms, and the end of the contour confirms. Everything
//! else is refused at once: what the way of a block cuts before that way is handed out; a wall that
//! was cut before when it is read.
//!
//! Tried: to look only for walls that face each other, by how far the contour has turned. It missed
//! all that is cut from behind, and refused the arc onto a slot's wall when the tool cut it from the
//! other wall. To tell by the side on which the tool is of a wall: coming round to a lead-in, it is on both.

use std::f64::consts::PI;

use super::super::error::{Fault, Origin, Refusal};
use super::nearby::{Bounded, Bounds, Nearby};
use super::segment::{Segment, Vector};

/// How far the tool may cut beyond the contour, where programs round their digits, mm.
const ALLOWED: f64 = 0.002;
/// Nearer than this a contour touches itself, mm: less than what may be cut.
const TOUCHES: f64 = 0.0015;
/// What is shorter is nothing, mm.
const SHORT: f64 = 1e-6;
/// How many level blocks may lead onto a loop and off it.
const LEAD: usize = 32;
/// What closes has turned by this much at least, rad. Both sides of a sheet of no thickness are half a
/// turn apart.
const CLOSES: f64 = PI + 0.05;
/// Arcs are taken in parts that turn by this much, rad: their boxes are small.
const PART: f64 = PI / 8.0;
/// Lines that change their height are taken in so many parts.
const RAMP: u32 = 16;
/// How many suspicions there may be.
const MAX_SUSPECTS: usize = 10_000;

/// A part of the contour.
#[derive(Clone, Copy, Debug)]
struct Wall {
    segment: Segment,
    /// How far the contour has turned at its start, rad.
    turned: f64,
    height: [f64; 2],
    /// How much of the contour is before it, mm.
    before: f64,
    line: u32,
    is: Role,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    Wall,
    /// It may yet turn out to lead onto a loop, or off one.
    MayLead,
    /// It leads onto a loop or off one.
    Leads,
}

/// A part of the tool's way.
#[derive(Clone, Copy, Debug)]
struct ToolPath {
    segment: Segment,
    height: [f64; 2],
    line: u32,
    /// Whether it leads onto the contour.
    on: bool,
}

/// What is cut, if it is a wall.
#[derive(Debug)]
struct Suspect {
    tool_path: ToolPath,
    wall: usize,
    /// The block that was read last of the two.
    origin: Origin,
    refused: Fault,
}

/// Where the contour touches what came before.
#[derive(Clone, Copy, Debug)]
struct Contact {
    wall: usize,
    /// How far that is along the wall, and along what touches it, mm.
    along: [f64; 2],
}

/// Finds what the tool cuts beyond one contour.
#[derive(Debug)]
pub(crate) struct GougeCheck {
    radius: f64,
    walls: Nearby<Wall>,
    tool_paths: Nearby<ToolPath>,
    /// All of them since the contour began or closed last.
    suspects: Vec<Suspect>,
    /// The first wall since then, and how many level blocks.
    since: usize,
    blocks: usize,
    /// Whether the contour has closed.
    closed: bool,
    /// Whether the contour has its end where there is nothing: it ends without leading off a loop.
    ends_open: bool,
    length: f64,
}

impl GougeCheck {
    pub(crate) fn new(radius: f64) -> GougeCheck {
        GougeCheck {
            radius,
            walls: Nearby::new(),
            tool_paths: Nearby::new(),
            suspects: Vec::new(),
            since: 0,
            blocks: 0,
            closed: false,
            ends_open: false,
            length: 0.0,
        }
    }

    /// Takes a block of the contour, which has turned by so much at its start and goes from a height to another.
    pub(crate) fn contour(
        &mut self,
        contour: Segment,
        turned: f64,
        heights: [f64; 2],
        origin: &Origin,
    ) -> Result<(), Refusal> {
        self.blocks += usize::from(is_level(heights));
        let mut turned = turned;
        for (segment, height) in parts(contour, heights) {
            let is = if self.blocks > LEAD {
                Role::Wall
            } else {
                Role::MayLead
            };
            let wall = Wall {
                segment,
                turned,
                height,
                before: self.length,
                line: origin.span.line,
                is,
            };
            turned += segment.turning();
            self.length += segment.length();
            let Some(contact) = self.contact(&wall) else {
                self.wall(wall, origin)?;
                continue;
            };
            let length = segment.length();
            let [_, ahead] = contact.along;
            if ahead > SHORT {
                let mut loop_end = wall;
                loop_end.without_end(length - ahead);
                self.wall(loop_end, origin)?;
            }
            self.close(contact)?;
            if length - ahead > SHORT {
                let mut tail = wall;
                tail.without_start(ahead);
                tail.is = Role::MayLead;
                self.wall(tail, origin)?;
            }
        }
        Ok(())
    }

    /// Takes what the tool goes along.
    pub(crate) fn tool_path(
        &mut self,
        tool_path: Segment,
        heights: [f64; 2],
        on: bool,
        origin: &Origin,
    ) -> Result<(), Refusal> {
        if on && !is_level(heights) {
            return Ok(());
        }
        for (segment, height) in parts(tool_path, heights) {
            let line = origin.span.line;
            let tool_path = ToolPath {
                segment,
                height,
                line,
                on,
            };
            for number in self.walls.near(&tool_path.bounds(), self.reach()) {
                if let Some(wall) = self.walls.get(number).copied()
                    && let Some(depth) = self.depth(&tool_path, &wall)
                {
                    let fault = Fault::CutterCuts {
                        line: wall.line,
                        depth,
                        radius: self.radius,
                    };
                    self.suspect(tool_path, (number, &wall), fault, origin)?;
                }
            }
            self.tool_paths.push(tool_path);
        }
        Ok(())
    }

    /// Ends the contour.
    pub(crate) fn finish(&mut self) -> Result<(), Refusal> {
        self.ends_open = !self.closed || self.blocks > LEAD;
        if !self.ends_open {
            self.suspects.clear();
            for (_, wall) in self.walls.from(self.since) {
                wall.is = Role::Leads;
            }
        }
        for suspect in std::mem::take(&mut self.suspects) {
            let Some(mut wall) = self.walls.get(suspect.wall).copied() else {
                return Err(suspect.origin.refuse(suspect.refused));
            };
            if suspect.tool_path.on && !self.closed {
                wall.without_start(self.radius - wall.before);
            }
            if self.depth(&suspect.tool_path, &wall).is_some() {
                return Err(suspect.origin.refuse(suspect.refused));
            }
        }
        Ok(())
    }

    /// Judges the way off the contour, behind its end.
    pub(crate) fn tool_path_off(
        &self,
        segment: Segment,
        heights: [f64; 2],
        origin: &Origin,
    ) -> Result<(), Refusal> {
        if !is_level(heights) || segment.length() < SHORT {
            return Ok(());
        }
        let tool_path = ToolPath {
            segment,
            height: heights,
            line: origin.span.line,
            on: false,
        };
        for number in self.walls.near(&tool_path.bounds(), self.reach()) {
            let Some(mut wall) = self.walls.get(number).copied() else {
                continue;
            };
            if self.ends_open {
                let behind = self.length - wall.before - wall.segment.length();
                wall.without_end(self.radius - behind);
            }
            if let Some(depth) = self.depth(&tool_path, &wall) {
                return Err(origin.refuse(Fault::CutterCuts {
                    line: wall.line,
                    depth,
                    radius: self.radius,
                }));
            }
        }
        Ok(())
    }

    fn reach(&self) -> f64 {
        self.radius - ALLOWED
    }

    /// How deep the tool cuts into a wall, where that is more than is allowed, mm.
    fn depth(&self, tool_path: &ToolPath, wall: &Wall) -> Option<f64> {
        if wall.is == Role::Leads {
            return None;
        }
        let distance = tool_path.segment.distance(&wall.segment);
        (distance < self.reach()).then_some(self.radius - distance)
    }

    /// Takes a wall and measures it against all that the tool went along.
    fn wall(&mut self, wall: Wall, origin: &Origin) -> Result<(), Refusal> {
        let number = self.walls.end();
        for tool_path in self.tool_paths.near(&wall.bounds(), self.reach()) {
            if let Some(tool_path) = self.tool_paths.get(tool_path).copied()
                && let Some(depth) = self.depth(&tool_path, &wall)
            {
                let fault = Fault::CutterHasCut {
                    line: tool_path.line,
                    depth,
                    radius: self.radius,
                };
                self.suspect(tool_path, (number, &wall), fault, origin)?;
            }
        }
        self.walls.push(wall);
        Ok(())
    }

    /// Refuses what cuts a wall, or keeps it in mind where that may be none.
    fn suspect(
        &mut self,
        tool_path: ToolPath,
        (number, wall): (usize, &Wall),
        refused: Fault,
        origin: &Origin,
    ) -> Result<(), Refusal> {
        let at_its_end = tool_path.on && !self.closed && wall.before < self.radius;
        let may_be = wall.is == Role::MayLead || at_its_end;
        if !may_be || self.suspects.len() >= MAX_SUSPECTS {
            return Err(origin.refuse(refused));
        }
        self.suspects.push(Suspect {
            tool_path,
            wall: number,
            origin: origin.clone(),
            refused,
        });
        Ok(())
    }

    /// Where a part of the contour, which is not among the walls yet, touches what came before: where a
    /// loop closes that may, the one that begins last; else last where it touches an earlier loop.
    fn contact(&self, part: &Wall) -> Option<Contact> {
        let mut own: Option<Contact> = None;
        let mut earlier: Option<Contact> = None;
        for number in self.walls.near(&part.bounds(), TOUCHES) {
            let Some(wall) = self.walls.get(number) else {
                continue;
            };
            let may_begin_here = number < self.since || wall.is == Role::MayLead;
            if wall.is == Role::Leads || !may_begin_here {
                continue;
            }
            let Some(along) = wall.segment.touches(&part.segment, TOUCHES) else {
                continue;
            };
            let turned = part.turned_at(along[1]) - wall.turned_at(along[0]);
            if turned.abs() < CLOSES {
                continue;
            }
            let contact = Contact {
                wall: number,
                along,
            };
            if number < self.since {
                let is_later = |it: &Contact| along[1] > it.along[1];
                if earlier.as_ref().is_none_or(is_later) {
                    earlier = Some(contact);
                }
            } else {
                own = Some(contact);
            }
        }
        own.or(earlier)
    }

    /// The contour has come to touch what came before: it is known what leads there.
    fn close(&mut self, contact: Contact) -> Result<(), Refusal> {
        let own = contact.wall >= self.since;
        for (number, wall) in self.walls.from(self.since) {
            if own && number >= contact.wall {
                if number == contact.wall {
                    wall.without_start(contact.along[0]);
                }
                if wall.is == Role::MayLead {
                    wall.is = Role::Wall;
                }
            } else if wall.is == Role::MayLead {
                wall.is = Role::Leads;
            }
        }
        for suspect in std::mem::take(&mut self.suspects) {
            let wall = self.walls.get(suspect.wall);
            if wall.is_none_or(|wall| self.depth(&suspect.tool_path, wall).is_some()) {
                return Err(suspect.origin.refuse(suspect.refused));
            }
        }
        self.since = self.walls.end();
        self.blocks = 0;
        self.closed = true;
        Ok(())
    }
}

impl Wall {
    /// How far the contour has turned at a place along it, rad.
    fn turned_at(&self, ahead: f64) -> f64 {
        self.turned + ahead * self.segment.curvature()
    }

    /// Takes some off its start, if there is some to be taken: with all of it it is none.
    fn without_start(&mut self, length: f64) {
        if length > self.segment.length() - SHORT {
            self.is = Role::Leads;
        } else if length > 0.0 {
            self.turned = self.turned_at(length);
            self.before += length;
            self.segment = self.segment.without_start(length);
        }
    }

    /// Takes some off its end, if there is some to be taken: with all of it it is none.
    fn without_end(&mut self, length: f64) {
        if length > self.segment.length() - SHORT {
            self.is = Role::Leads;
        } else if length > 0.0 {
            self.segment = self.segment.without_end(length);
        }
    }
}

impl Bounded for Wall {
    fn bounds(&self) -> Bounds {
        bounds(&self.segment, self.height)
    }
}

impl Bounded for ToolPath {
    fn bounds(&self) -> Bounds {
        bounds(&self.segment, self.height)
    }
}

fn bounds(segment: &Segment, height: [f64; 2]) -> Bounds {
    let extent: [Vector; 2] = segment.extent();
    Bounds { extent, height }
}

fn is_level([from, to]: [f64; 2]) -> bool {
    (to - from).abs() < SHORT
}

/// A segment that goes from a height to another, in parts with their least and greatest heights.
fn parts(segment: Segment, [from, to]: [f64; 2]) -> impl Iterator<Item = (Segment, [f64; 2])> {
    let turns = (segment.turning().abs() / PART).ceil().max(1.0) as u32;
    let count = match segment {
        Segment::Line { .. } if !is_level([from, to]) => RAMP,
        _ => turns,
    };
    segment.parts(count).zip(0..).map(move |(part, k)| {
        let height = |k: u32| from + (to - from) * f64::from(k) / f64::from(count);
        let (low, high) = (height(k), height(k + 1));
        (part, [low.min(high), low.max(high)])
    })
}
