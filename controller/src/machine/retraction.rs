//! `[retraction]`: how the axes go back to a path that they were jogged off.

use super::Axis;
use syncline_strict_toml::{Log, Table};
use syncline_trajectory::path::Retraction;
use toml::Spanned;

/// What a file says of it.
pub(super) struct RetractionTable {
    axis: Spanned<String>,
    clearance: Spanned<f64>,
    approach: Spanned<f64>,
}

impl RetractionTable {
    pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let axis = table.text(log, "axis", "the name of an axis", |_| true);
        let clearance = table.number(log, "clearance", "a number (mm)", |_| true);
        let approach = table.positive(log, "approach_speed", "(mm/s)");
        table.finish(log);
        Some(Self {
            axis: axis?,
            clearance: clearance?,
            approach: approach?,
        })
    }

    /// The retraction of a machine with these axes.
    pub(super) fn join(&self, log: &mut Log<'_>, axes: &[Axis]) -> Option<Retraction> {
        let lifts = |axis: &&Axis| axis.letter.is_linear();
        let named = |axis: &&Axis| axis.name() == self.axis.get_ref();
        let Some(axis) = axes.iter().filter(lifts).find(named) else {
            let names = axes.iter().filter(lifts).map(|axis| axis.name().to_owned());
            log.report(
                self.axis.span(),
                format!("retraction: `axis` is \"{}\"", self.axis.get_ref()),
                format!(
                    "allowed: the name of a linear axis: {}",
                    names.collect::<Vec<_>>().join(", ")
                ),
            );
            return None;
        };
        let (least, most) = axis.limits.position;
        let (clearance, approach) = (*self.clearance.get_ref(), *self.approach.get_ref());
        if !(least..=most).contains(&clearance) {
            log.report(
                self.clearance.span(),
                format!("retraction: `clearance` is {clearance}"),
                format!(
                    "allowed: within the soft limits of {}, {least}…{most} mm",
                    axis.name()
                ),
            );
        }
        if approach > axis.limits.velocity {
            log.report(
                self.approach.span(),
                format!("retraction: `approach_speed` is {approach}"),
                format!(
                    "allowed: up to `max_velocity` of {}, {} mm/s",
                    axis.name(),
                    axis.limits.velocity
                ),
            );
        }
        Some(Retraction {
            axis: axis.letter.index(),
            clearance,
            approach,
        })
    }
}
