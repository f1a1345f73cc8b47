//! `cross_coupling` of a gantry: what the measured difference of its sides makes of their setpoints, so that they go together.
//!
//! # What is solved
//!
//! The sides of a gantry are sent one planned position, and each drive closes a position loop of its own. So a side that is pulled at, by
//! a carriage near to it or by friction, or whose loop is set lower, is behind the other one, and racks the beam. Koren's cross-coupled
//! controller (1980) takes the difference of two axes for an error of its own, and adds a share of it to both commands
//! with opposite signs. His commands are velocities. Drives that are sent positions get the integral of that: with the
//! difference e, second side less first one, less what is planned of it, their setpoints are moved against each other by c, half each,
//!
//! ```text
//! ż = −gain · (e + lead · ė),   |z| ≤ limit, |ż| ≤ rate, |z̈| ≤ slew          c = z behind two lags of 1/ω
//! ```
//!
//! (`control/axis/cross_coupling.rs`). Their sum, the planned position, stays. A share of e that is not integrated would leave a constant
//! difference where it is but for a part. `lead` makes up for half of the lag of the drives' loops: for all of it the loop would be worse about drives
//! that are faster than stated, or have velocity feed-forward and so no such lag.
//!
//! # Why it is stable
//!
//! What is seen at a SYNC changes a setpoint that the next one latches, and the drives are there a latency later: (1 + latency) cycles.
//! Their loops follow with 1 / `position_gain` behind that, of which `lead` takes half away. Call what is left T₀, and let ω be 2 / T₀. The loop's lag
//! is 2 T₀ then, and with gain · 2 T₀ ≤ 1/2 it has a gain margin of 3.7 at the least, about any share of delay and of lag; with half of that, the
//! default, 7.5, and it makes nothing worse than by 1.23 at any frequency. About sides without any lag, and with a third of it, the margins
//! are no less; about sides with three and with ten times of it, as where a stiff beam has them answer more slowly than their loops, it has a margin of 2.8
//! at the least. (Found for delays of a tenth to twice 1 / `position_gain`, from the open loop over frequency.)
//!
//! Where `slew` bounds z, ż is late besides. `rate` is no more than slew / gain: so a difference that decays as the loop has it never asks for more than
//! `slew`, and no swing of ż is bounded by it that is slower than the loop's own. What is faster the loop takes part in the less the faster it is.
//!
//! # Why the limits hold
//!
//! Two equal lags have an impulse response h(t) = ω² t e^(−ωt), which is nowhere negative and whose integral is 1. So |c| ≤ limit, |ċ| ≤ rate,
//! |c̈| ≤ slew, and, by the total variation of h, |c⃛| ≤ slew · 2 ω / e, at every instant, whatever the difference does. `rate` and
//! `slew` are what keeps half of each, that of a side, within its [`SHARES`] of the axis's limits, and the plan has the rest. A
//! stop that begins at any instant takes ż to zero, and c runs out, within the same shares.

use super::{AxisLimits, Machine, Motion};
use std::f64::consts::E;
use std::ops::Range;
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// The parts of an axis's velocity, acceleration and jerk that its sides have to move against each other.
const SHARES: [f64; 3] = [0.02, 0.05, 0.25];

/// The part of the lag of the drives' loops that is made up for.
const LED: f64 = 0.5;

/// The greatest gain times T₀, and the one of a file that states none.
const GAINS: [f64; 2] = [0.25, 0.125];

/// So many increments the sides may differ, and nothing is done: half of it is rounding, and friction holds each beside its setpoint.
const INCREMENTS: f64 = 4.0;
/// And no less than this part of a revolution, of encoders that tell more apart than that.
const REVOLUTION: f64 = 1.0 / 32_768.0;

/// The key.
const KEY: &str = "cross_coupling";

/// How the sides of a gantry are coupled. Of A, B and C every mm is a degree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrossCoupling {
    /// As fast their setpoints are moved against each other for a difference, 1/s.
    pub gain: f64,
    /// And the greatest that is allowed with these drives, 1/s.
    pub greatest_gain: f64,
    /// For how long the difference is taken to go on as it changes, s.
    pub lead: f64,
    /// As far they are, mm.
    pub limit: f64,
    /// A difference that is left alone, mm.
    pub dead_zone: f64,
    /// The velocity of the setpoints against each other that nothing makes greater, mm/s.
    pub rate: f64,
    /// And their acceleration, mm/s².
    pub slew: f64,
    /// Of each of the two lags behind that, 1/s.
    pub smoothing: f64,
}

impl CrossCoupling {
    /// What it leaves the plan of these limits.
    #[must_use]
    pub fn leaves(limits: &AxisLimits) -> AxisLimits {
        let [velocity, acceleration, jerk] = SHARES.map(|share| 1.0 - share);
        AxisLimits {
            velocity: velocity * limits.velocity,
            acceleration: acceleration * limits.acceleration,
            jerk: jerk * limits.jerk,
            ..*limits
        }
    }

    /// The greatest gain as it is told, 1/s: what is told to be allowed is.
    #[must_use]
    pub fn told_greatest(&self) -> String {
        told(self.greatest_gain)
    }

    /// The greatest jerk of the setpoints against each other, mm/s³.
    #[must_use]
    pub fn jerk(&self) -> f64 {
        self.slew * 2.0 * self.smoothing / E
    }

    /// The sides take `time` to follow what they are sent, s.
    fn settle(&mut self, time: f64, limits: &AxisLimits) {
        let [velocity, acceleration, jerk] = SHARES;
        self.smoothing = 2.0 / time;
        let slew = acceleration * limits.acceleration;
        // Each side has half of it.
        self.slew = 2.0 * slew.min(jerk * limits.jerk * E / (2.0 * self.smoothing));
        self.rate = (2.0 * velocity * limits.velocity).min(self.slew / self.gain);
    }
}

/// The greatest of a gain with two decimals, rounded down.
fn told(greatest: f64) -> String {
    format!("{:.2}", (greatest * 100.0).floor() / 100.0)
}

/// What an `[[axis]]` says of it.
#[derive(Clone)]
pub(super) struct CouplingTable {
    span: Range<usize>,
    gain: Option<Spanned<f64>>,
    limit: f64,
    position_gain: f64,
    dead_zone: Option<f64>,
    /// The greatest of it.
    most_left_alone: f64,
}

impl CouplingTable {
    /// Reads it, of an axis whose sides may be so far apart, if it has two, and which is in position so near to its setpoint.
    pub(super) fn read(
        log: &mut Log<'_>,
        axis: &mut Table<'_, '_>,
        (skew_limit, standstill): (Option<f64>, f64),
        unit: &str,
    ) -> Option<Self> {
        let allowed = "a table: { position_gain = 60.0, limit = 0.1 }";
        let mut table = axis.table_if(log, KEY, allowed)?;
        let span = axis.span_of(KEY)?;
        table.title = format!("{}: {KEY}", axis.title);
        let most = skew_limit.map_or(f64::INFINITY, |skew| 0.5 * skew);
        let half = match skew_limit {
            Some(_) => format!("a number above 0, at most {most} {unit}, half of `skew_limit`"),
            None => format!("a number above 0 {unit}"),
        };
        let limit = table.number(log, "limit", &half, |it| it > 0.0 && it <= most);
        let allowed =
            "a number from 1 to 1000 (1/s): of the slower one of both drives' position loops";
        let is_gain = |it: f64| (1.0..=1000.0).contains(&it);
        let position_gain = table.number(log, "position_gain", allowed, is_gain);
        let gain = table.number_if(log, "gain", "a number from 0.01 to 1000 (1/s)", |it| {
            (0.01..=1000.0).contains(&it)
        });
        let limited = limit.as_ref().map_or(most, |it| *it.get_ref());
        // Sides that are left alone are in position.
        let most = limited.min(standstill);
        let whose = match limited <= standstill {
            true => "its `limit`",
            false => "the axis's `standstill_window`",
        };
        let allowed = format!("a number from 0 to {most} {unit}, {whose}");
        let dead_zone =
            table.number_if(log, "dead_zone", &allowed, |it| (0.0..=most).contains(&it));
        table.finish(log);
        Some(Self {
            span,
            gain,
            limit: limit?.into_inner(),
            position_gain: position_gain?.into_inner(),
            dead_zone: dead_zone.map(Spanned::into_inner),
            most_left_alone: most,
        })
    }

    /// What the sides of an axis may be sent that is itself sent so far.
    pub(super) fn widen(this: Option<&Self>, (least, most): (f64, f64)) -> (f64, f64) {
        let half = this.map_or(0.0, |it| 0.5 * it.limit);
        (least - half, most + half)
    }

    /// Reports that this axis has nothing to couple.
    pub(super) fn refuse(&self, log: &mut Log<'_>, title: &str, what: &str, help: &str) {
        let problem = format!("{title}: `{KEY}` of {what}");
        log.report(self.span.clone(), problem, help);
    }
}

/// Couples the sides of each axis that asks for it, whose drives and times are known now.
pub(super) fn settle(log: &mut Log<'_>, machine: &mut Machine, tables: &[Option<CouplingTable>]) {
    for (axis, table) in tables.iter().enumerate() {
        let Some(table) = table else { continue };
        let coupled = couple(log, machine, axis, table);
        machine.axes[axis].cross_coupling = coupled;
    }
}

/// From a setpoint that SYNC latches until the slowest drive of all that follow the path is there, cycles.
fn latency(machine: &Machine) -> f64 {
    let follow = (0..machine.drives.len())
        .filter(|&drive| machine.axes[machine.drives[drive].axis].motion == Motion::Path);
    let latencies = follow.filter_map(|drive| Some(machine.device(drive).drive()?.latency()));
    latencies.fold(0.0, f64::max)
}

fn couple(
    log: &mut Log<'_>,
    machine: &Machine,
    index: usize,
    table: &CouplingTable,
) -> Option<CrossCoupling> {
    let axis = &machine.axes[index];
    let title = format!("axis \"{}\"", axis.name());
    for &drive in &axis.drives {
        let device = machine.device(drive);
        if device.drive().is_some_and(|it| it.dynamics().is_some()) {
            let drive = &machine.drives[drive];
            let what = format!(
                "drive \"{}\" ({}), which is sent velocities: the controller closes its position loop itself",
                drive.name, drive.model.title
            );
            let help = "leave it out, or give both sides drives that are sent positions";
            table.refuse(log, &title, &what, help);
            return None;
        }
    }
    let cycles = 1.0 + latency(machine);
    let lead = LED / table.position_gain;
    let time = cycles * machine.cycle.as_secs_f64() + (1.0 / table.position_gain - lead);
    let [most, usual] = GAINS.map(|gain| gain / time);
    if let Some(gain) = table.gain.as_ref().filter(|it| *it.get_ref() > most) {
        log.report(
            gain.span(),
            format!(
                "{title}: {KEY}: `gain` of {} 1/s, beyond which its sides may swing against each other",
                gain.get_ref()
            ),
            format!(
                "allowed: up to {} 1/s, a quarter of 1 / ({cycles} cycles + 0.5 / `position_gain`); without the key it is half of that",
                told(most)
            ),
        );
        return None;
    }
    let scalings = axis
        .drives
        .iter()
        .map(|&drive| &machine.drives[drive].scaling);
    let coarse = scalings.map(|it| {
        let revolution = REVOLUTION * it.travel_per_revolution().abs();
        (INCREMENTS * it.resolution()).max(revolution)
    });
    let coarse = coarse.fold(0.0, f64::max);
    if table.limit < coarse {
        log.report(
            table.span.clone(),
            format!(
                "{title}: {KEY}: `limit` of {} is less than what these drives tell apart",
                table.limit
            ),
            format!(
                "allowed: {INCREMENTS} increments, {coarse} {}, at the least",
                axis.units()[0]
            ),
        );
        return None;
    }
    let mut coupling = CrossCoupling {
        gain: table.gain.as_ref().map_or(usual, |it| *it.get_ref()),
        greatest_gain: most,
        lead,
        limit: table.limit,
        dead_zone: (table.dead_zone).unwrap_or(coarse.min(table.most_left_alone)),
        ..CrossCoupling::default()
    };
    coupling.settle(time, &axis.sent_limits);
    Some(coupling)
}
