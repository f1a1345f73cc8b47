//! `[axis.homing]` with `kind = "hard_stop"`: where the axis stands against a stop, pressed by no more than a share of its
//! motor's torque.

use super::super::simulation::{number, number_or};
use super::super::{Axis, AxisLimits, Drive};
use super::{Bounds, bounds, direction};
use std::ops::Range;
use std::time::Duration;
use syncline_strict_toml::{Log, Table};

/// A search for a hard stop.
#[derive(Clone, Debug, PartialEq)]
pub struct HardStopSearch {
    /// 1 or −1: to which side the stop is searched.
    pub direction: f64,
    /// The most that the motor takes of its continuous stall torque, 0…1.
    pub torque: f64,
    /// mm/s.
    pub speed: f64,
    /// How far off the stop the axis goes once it has been found, mm.
    pub back_off: f64,
    /// How long the axis stands until what it met is a stop.
    pub contact: Duration,
    /// What stops it nearer to where it began is none, mm.
    pub min_distance: f64,
    /// How far from where it begins the axis goes at most to either side, mm.
    pub max_distance: f64,
    /// How long the axis takes at most.
    pub max_time: Duration,
    /// Acceleration, mm/s², and jerk, mm/s³: less than the axis may have, since its torque is.
    pub ramps: [f64; 2],
    /// Machine position of the stop, mm.
    pub position: f64,
    /// Where the axis goes once it is referenced, mm.
    pub final_position: f64,
}

/// The key as the file has it.
pub(in crate::machine) struct HardStopTable {
    pub(super) search: HardStopSearch,
    /// Where its kind stands.
    kind: Range<usize>,
}

/// What of the axis' acceleration and jerk a motor with less torque is asked for.
const GENTLE: f64 = 0.1;
/// From where an axis stands until its plan comes to rest pass so many cycles besides …
const CYCLES: f64 = 4.0;
/// … and so long for what its loops lag by.
const LOOPS: Duration = Duration::from_millis(20);

impl HardStopSearch {
    /// So many times its standstill window the plan of an axis that stands goes on until what it met is a stop.
    pub const WINDOWS: f64 = 4.0;

    /// How far the plan of an axis is beyond it at most when it has come to rest against its stop, mm.
    fn lag(&self, axis: &Axis, cycle: Duration) -> f64 {
        let seen = self.speed * self.contact.as_secs_f64();
        let stands = seen.max(Self::WINDOWS * axis.limits.standstill);
        let reaction = CYCLES * cycle.as_secs_f64() + LOOPS.as_secs_f64();
        stands + self.speed * reaction + axis.stopping_distance(self.speed)
    }
}

/// The keys of a search for a hard stop, whose `kind` stands there.
pub(super) fn read(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    (limits, kind): (&AxisLimits, Range<usize>),
    [position, speed]: [&str; 2],
) -> Option<HardStopTable> {
    let searched = direction(log, table);
    let weight = table.choice(log, "weight", ["none", "positive", "negative"].into_iter());
    let torque = number(
        log,
        table,
        "torque",
        1.0..=100.0,
        "(% of its continuous torque)",
    );
    let back_off = number(log, table, "back_off", 0.001..=1e6, position);
    let contact = table.millis_or(log, "contact_ms", 50, 1000);
    let bounds = bounds(log, table, limits, ([position, speed], false));
    let max = bounds.as_ref().map_or(1e7, |bounds| bounds.max_distance);
    let min_distance = number_or(log, table, "min_distance", 0.0, 0.0..=max, position);
    if let (Some(searched), Some(weight)) = (&searched, &weight)
        && searched.get_ref() == weight.get_ref()
    {
        let side = weight.get_ref();
        log.report(
            searched.span(),
            format!(
                "{}: a hard stop in {side} direction, to which its weight pulls it",
                table.title
            ),
            "search the stop at the other end: with its torque limited the axis would fall",
        );
    }
    let Bounds {
        speed,
        max_distance,
        max_time,
        position,
        final_position,
        ..
    } = bounds?;
    weight?;
    Some(HardStopTable {
        search: HardStopSearch {
            direction: super::sign(searched?.get_ref()),
            torque: torque? / 100.0,
            speed,
            back_off: back_off?,
            contact,
            min_distance,
            max_distance,
            max_time,
            ramps: [GENTLE * limits.acceleration, GENTLE * limits.jerk],
            position,
            final_position,
        },
        kind,
    })
}

impl HardStopTable {
    /// Whether the drives of an axis can do that, and it follows well enough for what is a following error to be none.
    pub(super) fn check(&self, log: &mut Log<'_>, axis: &Axis, drives: &[Drive], cycle: Duration) {
        let name = axis.name();
        let mut refuse = |problem: String, help: &str| {
            let problem = format!("axis \"{name}\": homing: {problem}");
            log.report(self.kind.clone(), problem, help);
        };
        let [drive] = axis.drives[..] else {
            return refuse(
                "the sides of a gantry are not homed against hard stops, of which one comes first and racks it".into(),
                "home a gantry with `kind = \"switch\"`, which takes it square, too",
            );
        };
        let Drive {
            name: who, model, ..
        } = &drives[drive];
        if model.torque_limit.is_none() {
            let problem = format!(
                "drive \"{who}\" ({}) has no object that limits its torque",
                model.title
            );
            return refuse(problem, super::otherwise(axis));
        }
        let (lag, allowed) = (
            self.search.lag(axis, cycle),
            axis.limits.following_error_at(0.0),
        );
        if lag > allowed {
            let unit = axis.letter.units()[0];
            refuse(
                format!(
                    "its setpoints would go {lag:.3} {unit} beyond the stop, more than the {allowed} {unit} of its \
                     following error at rest"
                ),
                "lower `speed` or `contact_ms`, or raise `following_error_limit`",
            );
        }
    }
}
