//! `simulation` of an axis: what its simulated drives move, if that is not a load for each alone.

use std::ops::RangeInclusive;
use syncline_drives::mechanics::rigid_beam::Beam;
use syncline_strict_toml::{Log, Table};

/// What ties the drives of an axis together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mechanics {
    /// A rigid beam between the two sides of a gantry.
    RigidBeam(Beam),
}

impl Mechanics {
    /// As the machine file names it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::RigidBeam(_) => RIGID_BEAM,
        }
    }
}

const RIGID_BEAM: &str = "rigid_beam";

/// What a `simulation` looks like.
const ALLOWED: &str = "{ mechanics = \"rigid_beam\", mass = …, inertia = …, span = … }";

/// The key of an axis that is linear and has two drives if `gantry`.
pub(super) fn mechanics(
    log: &mut Log<'_>,
    axis: &mut Table<'_, '_>,
    gantry: bool,
) -> Option<Mechanics> {
    let mut table = axis.table_if(log, "simulation", ALLOWED)?;
    table.title = format!("{}: simulation", axis.title);
    if !gantry {
        let span = axis.span_of("simulation").unwrap_or_default();
        log.report(
            span,
            format!(
                "{}: `simulation` where nothing is tied together",
                axis.title
            ),
            "allowed: only of a linear axis whose `drives` name two, a gantry pair",
        );
    }
    let kind = table.choice(log, "mechanics", [RIGID_BEAM].into_iter());
    let mut number = |key, range: RangeInclusive<f64>, unit: &str| {
        let (least, most) = (range.start(), range.end());
        let allowed = format!("a number from {least} to {most} {unit}");
        let found = table.number(log, key, &allowed, |number| range.contains(&number));
        found.map(|number| *number.get_ref())
    };
    let mass = number("mass", 0.001..=1e6, "(kg)");
    let inertia = number(
        "inertia",
        1e-6..=1e9,
        "(kg·m², about the middle of the beam)",
    );
    let span = number("span", 1.0..=1e6, "(mm from side to side)");
    table.finish(log);
    kind?;
    Some(Mechanics::RigidBeam(Beam {
        mass: mass?,
        inertia: inertia?,
        span: span? / 1000.0,
    }))
}
