//! `[probing]`: what holds for G38.2 to G38.5, and `[simulation]`: what a simulated probe touches, and a tool.

use super::simulation::{number, number_or};
use super::{Cut, Drive, Input, InputMeaning, cutting};
use std::ops::RangeInclusive;
use syncline_drives::mechanics::touch_probe::{Solid, TouchProbe};
use syncline_drives::model::Capture;
use syncline_strict_toml::{Log, Table};

/// `[probing]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probing {
    /// How far the axes may go on behind a contact, mm.
    pub overtravel: f64,
    /// Whether drives that can are to capture where it was.
    pub latch: bool,
}

impl Default for Probing {
    fn default() -> Self {
        Self {
            overtravel: 2.0,
            latch: true,
        }
    }
}

/// How a drive captures where a probe or a tool setter touches, and where it no longer does: as many of its inputs as it
/// can at once, a probe's first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProbeCaptures {
    touches: [Option<&'static Capture>; 2],
    leaves: [Option<&'static Capture>; 2],
}

impl ProbeCaptures {
    /// Of a drive, if a capture of it sees a probe or a tool setter.
    #[must_use]
    pub fn new(drive: usize, drives: &[Drive], inputs: &[Input]) -> Option<Self> {
        let model = drives.get(drive)?.model;
        let wired = |meaning| {
            let mut wired = inputs.iter().filter(move |it| it.node == drive);
            wired.find(|it| it.meaning == meaning && model.capture(it.signal, true).is_some())
        };
        let seen = [InputMeaning::Probe, InputMeaning::ToolSetter].map(wired);
        let at = |comes: bool| {
            seen.map(|it| it.and_then(|it| model.capture(it.signal, comes != it.active_low)))
        };
        let touches = at(true);
        (touches.iter().any(Option::is_some)).then(|| Self {
            touches,
            leaves: at(false),
        })
    }

    /// Those of a contact that is lost if `away`, otherwise of one that comes.
    #[must_use]
    pub fn of(&self, away: bool) -> [Option<&'static Capture>; 2] {
        match away {
            true => self.leaves,
            false => self.touches,
        }
    }
}

/// `[probing]` of a machine file.
pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Probing {
    let Probing { overtravel, latch } = Probing::default();
    let probing = Probing {
        overtravel: number_or(
            log,
            &mut table,
            "overtravel",
            overtravel,
            0.001..=1e3,
            "(mm)",
        ),
        latch: table.flag_or(log, "latch", latch),
    };
    table.finish(log);
    probing
}

/// A place of a work piece, mm.
const PLACE: RangeInclusive<f64> = -1e7..=1e7;
/// Which way out of a plane is.
const FACINGS: [(&str, [f64; 3]); 6] = [
    ("+X", [1.0, 0.0, 0.0]),
    ("-X", [-1.0, 0.0, 0.0]),
    ("+Y", [0.0, 1.0, 0.0]),
    ("-Y", [0.0, -1.0, 0.0]),
    ("+Z", [0.0, 0.0, 1.0]),
    ("-Z", [0.0, 0.0, -1.0]),
];

/// What is touched in a simulation.
#[derive(Clone, Debug, Default)]
pub struct Touched {
    /// The work pieces, and the ball of the probe that touches them.
    pub workpieces: Option<TouchProbe>,
    /// The tool setter as the spindle's nose meets it: higher by how far the tool sticks out.
    pub tool_setter: Option<TouchProbe>,
}

impl Touched {
    /// Each, and the inputs that tell.
    pub fn all(&self) -> impl Iterator<Item = (&TouchProbe, InputMeaning)> {
        let Self {
            workpieces,
            tool_setter,
        } = self;
        let workpieces = workpieces.iter().map(|it| (it, InputMeaning::Probe));
        workpieces.chain(tool_setter.iter().map(|it| (it, InputMeaning::ToolSetter)))
    }
}

/// `[simulation]` of a machine file; `cuts` is to be how its tools cut.
pub(super) fn simulated(
    log: &mut Log<'_>,
    mut table: Table<'_, '_>,
    cuts: &mut Vec<Cut>,
) -> Option<Touched> {
    let ball = number_or(
        log,
        &mut table,
        "ball",
        0.0,
        0.0..=100.0,
        "(mm, its diameter)",
    );
    let pieces = table.tables_if(log, "workpiece", "name");
    let setter = table.table_if(log, "tool_setter", "a table [simulation.tool_setter]");
    let cutting = table.tables_if(log, "cutting", "tool");
    table.finish(log);
    *cuts = cutting::read(log, cutting);
    let solids: Vec<_> = (pieces.into_iter().map(|piece| solid(log, piece))).collect();
    let tool_setter = match setter {
        Some(setter) => Some(TouchProbe {
            radius: 0.0,
            solids: vec![tool_setter(log, setter)?],
        }),
        None => None,
    };
    Some(Touched {
        workpieces: Some(TouchProbe {
            radius: 0.5 * ball,
            solids: solids.into_iter().collect::<Option<_>>()?,
        }),
        tool_setter,
    })
}

/// `[simulation.tool_setter]`: upright, and met by the middle of a tool's tip.
fn tool_setter(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Solid> {
    let [x, y, top] = ["x", "y", "z"].map(|key| number(log, &mut table, key, PLACE, "(mm)"));
    let diameter = number_or(log, &mut table, "diameter", 10.0, 0.1..=1e3, "(mm)");
    let length = number_or(log, &mut table, "tool_length", 0.0, 0.0..=1e4, "(mm)");
    table.finish(log);
    // As far down as anything goes.
    let low = *PLACE.start();
    Some(Solid::Cylinder {
        foot: [x?, y?, low],
        radius: 0.5 * diameter,
        height: top? + length - low,
    })
}

/// A `[[simulation.workpiece]]`.
fn solid(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Solid> {
    table.text(log, "name", "a name", |name| !name.is_empty());
    let shape = table.choice(log, "shape", ["plane", "box", "cylinder"].into_iter());
    let allowed = "[least, greatest] machine position (mm), the first below the second";
    let solid = match shape.as_ref().map(|shape| shape.get_ref().as_str()) {
        Some("plane") => {
            let names = FACINGS.iter().map(|(name, _)| *name);
            let facing = table.choice(log, "facing", names);
            let at = number(log, &mut table, "at", PLACE, "(mm)");
            let named = facing.and_then(|facing| {
                let mut known = FACINGS.iter();
                known.find(|(name, _)| name == facing.get_ref())
            });
            named.zip(at).map(|((_, normal), at)| Solid::Plane {
                at: normal.map(|out| out.abs() * at),
                normal: *normal,
            })
        }
        Some("box") => {
            let sides = ["x", "y", "z"].map(|key| table.interval(log, key, allowed));
            let [x, y, z] = sides.map(|side| side.map(|side| side.into_inner()));
            x.zip(y).zip(z).map(|((x, y), z)| Solid::Box {
                from: [x.0, y.0, z.0],
                to: [x.1, y.1, z.1],
            })
        }
        Some(_) => {
            let [x, y] = ["x", "y"].map(|key| number(log, &mut table, key, PLACE, "(mm)"));
            let diameter = number(log, &mut table, "diameter", 0.001..=1e6, "(mm)");
            let z = table.interval(log, "z", allowed);
            let z = z.map(|z| z.into_inner());
            let known = x.zip(y).zip(diameter).zip(z);
            known.map(|(((x, y), diameter), (low, high))| Solid::Cylinder {
                foot: [x, y, low],
                radius: 0.5 * diameter,
                height: high - low,
            })
        }
        None => None,
    };
    table.finish(log);
    solid
}
