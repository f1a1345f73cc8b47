//! `[[axis]]`: its limits, its drives, and what else the file says of it.

use super::compensation::CompensationTable;
use super::cross_coupling::{CouplingTable, CrossCoupling};
use super::encoder::FeedbackTable;
use super::feed_forward::{self, FeedForward};
use super::fits::{self, Asked};
use super::homing::{self, HomingTable};
use super::limit_inputs::LimitTable;
use super::read::TURN;
use super::simulation::{self, Simulation};
use super::{Axis, AxisLimits, Compensation, Feedback, Homing, Motion, Square};
use std::{ops::Range, time::Duration};
use syncline_drives::model::Ability;
use syncline_gcode as gcode;
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// A limit of the plan: wide enough for every machine, and its powers are numbers.
fn limit(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    key: &'static str,
    most: f64,
    unit: &str,
) -> Option<Spanned<f64>> {
    let allowed = format!("a number from 0.001 to {most} {unit}");
    table.number(log, key, &allowed, |number| {
        (0.001..=most).contains(&number)
    })
}

/// The limits of the following error at the greatest velocity and at rest.
fn following_error_limits(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    unit: &str,
) -> Option<(f64, f64)> {
    let limit = table.positive(log, "following_error_limit", unit);
    let limit = limit.map(Spanned::into_inner);
    let allowed = format!("a number above 0, at most `following_error_limit` {unit}");
    let most = limit.unwrap_or(f64::INFINITY);
    let is_less = |number| number > 0.0 && number <= most;
    let at_rest = table.number_if(log, "following_error_limit_at_rest", &allowed, is_less);
    Some((limit?, at_rest.map_or(most, Spanned::into_inner)))
}

/// `[[axis]]`.
pub(super) struct AxisTable {
    pub(super) name: Spanned<String>,
    pub(super) letter: gcode::AxisLetter,
    pub(super) drives: Spanned<Vec<Spanned<String>>>,
    pitch: f64,
    gear: f64,
    pub(super) limits: AxisLimits,
    sent_limits: AxisLimits,
    compensation: Option<Compensation>,
    /// Where the file says so.
    pub(super) compensated: Option<CompensationTable>,
    pub(super) coupled: Option<CouplingTable>,
    /// Where the soft limits stand.
    pub(super) soft_limits: Range<usize>,
    /// What its drives are to do besides.
    pub(super) asked: Vec<Asked>,
    pub(super) homing: Option<HomingTable>,
    limit_switches: LimitTable,
    pub(super) feedback: Option<FeedbackTable>,
    hardware_stops: bool,
    pub(super) position_loss: Option<Spanned<i64>>,
    /// And where the file says so.
    pub(super) motion: Option<(Motion, Range<usize>)>,
    feed_forward: Option<FeedForward>,
    simulation: Option<Simulation>,
}

impl AxisTable {
    pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let name = table.choice(
            log,
            "name",
            gcode::AxisLetter::ALL.iter().map(|axis| axis.name()),
        );
        let letter = name.as_ref().and_then(|name| {
            let named = |axis: &gcode::AxisLetter| axis.name() == name.get_ref();
            gcode::AxisLetter::ALL.into_iter().find(named)
        });
        let rotary = letter.is_some_and(|letter| !letter.is_linear());
        let [position, velocity, acceleration, jerk] = if rotary {
            ["(°)", "(°/s)", "(°/s²)", "(°/s³)"]
        } else {
            ["(mm)", "(mm/s)", "(mm/s²)", "(mm/s³)"]
        };
        let allowed = "the name of one [[drive]], or of two for a gantry pair";
        let drives = table.texts(log, "drives", allowed, 1..=2);
        let pitch = if rotary {
            let unit = "(degrees per turn of what the gear turns)";
            let span = table.span_of("pitch").unwrap_or_default();
            Some(Spanned::new(
                span,
                table.positive_or(log, "pitch", TURN, unit),
            ))
        } else {
            let unit = "(mm per turn of the screw or pinion)";
            match name {
                Some(_) => table.positive(log, "pitch", unit),
                // Who knows whether it turns.
                None => table.positive_if(log, "pitch", unit),
            }
        };
        let gear = table.positive_or(log, "gear", 1.0, "(motor turns per turn of the screw)");
        let max_velocity = limit(log, &mut table, "max_velocity", 1e6, velocity);
        let max_acceleration = limit(log, &mut table, "max_acceleration", 1e9, acceleration);
        let max_jerk = limit(log, &mut table, "max_jerk", 1e12, jerk);
        let allowed = if rotary {
            "[least, greatest] machine position in degrees, the first below the second"
        } else {
            "[least, greatest] machine position in mm, the first below the second"
        };
        let soft_limits = table.interval(log, "soft_limits", allowed);
        let following_error = following_error_limits(log, &mut table, position);
        let pair = drives
            .as_ref()
            .is_some_and(|drives| drives.get_ref().len() == 2);
        let skew_limit = if pair {
            let unit = format!("{position}, the difference of a gantry's two sides");
            table.positive(log, "skew_limit", &unit)
        } else {
            let skew_limit = table.positive_if(log, "skew_limit", position);
            if let (Some(skew_limit), true) = (&skew_limit, drives.is_some()) {
                log.report(
                    skew_limit.span(),
                    format!("{}: `skew_limit` for one drive", table.title),
                    "allowed: only where `drives` names two, a gantry pair",
                );
            }
            None
        };
        let standstill = table.positive_or(log, "standstill_window", 0.1, position);
        let mut asked = fits::asked(log, &mut table);
        let feed_forward = feed_forward::read(log, &mut table).map(|(read, span)| {
            asked.push(Asked::new(feed_forward::KEY, Ability::TorqueOffset, span));
            read
        });
        let limits = || {
            Some(AxisLimits {
                position: *soft_limits.as_ref()?.get_ref(),
                velocity: *max_velocity.as_ref()?.get_ref(),
                acceleration: *max_acceleration.as_ref()?.get_ref(),
                jerk: *max_jerk.as_ref()?.get_ref(),
                following_error: following_error?.0,
                following_error_at_rest: following_error?.1,
                skew: skew_limit.as_ref().map(|limit| *limit.get_ref()),
                standstill,
            })
        };
        let stated = limits();
        let compensated = CompensationTable::read(log, &mut table, rotary);
        let skew = skew_limit.as_ref().map(|limit| *limit.get_ref());
        let coupled = CouplingTable::read(log, &mut table, (skew, standstill), position);
        if let (Some(coupled), false, true) = (&coupled, pair, drives.is_some()) {
            let help = "allowed: only where `drives` names two, a gantry pair";
            coupled.refuse(log, &table.title, "one drive", help);
        }
        let left = stated.map(|limits| match coupled {
            Some(_) => CrossCoupling::leaves(&limits),
            None => limits,
        });
        let joined = (compensated.as_ref().zip(left)).map(|(it, limits)| {
            it.join(log, &table.title, &limits, [velocity, acceleration, jerk])
        });
        let (compensation, limits) = joined.unzip();
        let [limits, sent_limits] = limits.map_or([left; 2], |it| it.map(Some));
        let sent_limits = (sent_limits.zip(stated)).map(|(sent, stated)| AxisLimits {
            position: CouplingTable::widen(coupled.as_ref(), sent.position),
            ..stated
        });
        // What homing keeps to, where one of them is wrong: the others.
        let known = limits.unwrap_or(AxisLimits {
            position: (soft_limits.as_ref())
                .map_or((f64::NEG_INFINITY, f64::INFINITY), |it| *it.get_ref()),
            velocity: max_velocity
                .as_ref()
                .map_or(f64::INFINITY, |it| *it.get_ref()),
            ..AxisLimits::default()
        });
        let homing = homing::read(log, &mut table, &known, rotary);
        let limit_switches = LimitTable::read(log, &mut table);
        let feedback = FeedbackTable::read(log, &mut table, position);
        let stops = ["hardware"].into_iter();
        let hardware_stops = table.choice_if(log, "unsupervised_stop", stops).is_some();
        let position_loss = table.integer_if(log, "position_loss_ms", 1..=1000, " (ms)");
        let motion = fits::motion(log, &mut table);
        let simulation = simulation::read(
            log,
            &mut table,
            simulation::Simulated::Axis { rotary, pair },
        );
        if let Some(compensated) = &compensated {
            let sees_load = |it: &FeedbackTable| it.closes_loop.is_some();
            let what = if feedback.as_ref().is_some_and(sees_load) {
                Some("whose encoder closes the position loop")
            } else if simulation.as_ref().is_some_and(|it| it.scale.is_some()) {
                Some("whose drive closes its position loop by a scale")
            } else {
                None
            };
            if let Some(what) = what {
                compensated.refuse(
                    log,
                    &table.title,
                    what,
                    "leave it out: the loop sees where the carriage is",
                );
            }
        }
        if let Some(pitch) = &pitch
            && !(pitch.get_ref() / gear).is_normal()
        {
            let problem = format!("{}: `pitch` / `gear` is no usable number", table.title);
            log.report(
                pitch.span(),
                problem,
                "allowed: a travel for a motor revolution above 0",
            );
        }
        table.finish(log);
        Some(Self {
            name: name?,
            letter: letter?,
            drives: drives?,
            pitch: pitch?.into_inner(),
            gear,
            soft_limits: soft_limits.as_ref()?.span(),
            limits: limits?,
            sent_limits: sent_limits?,
            compensation,
            compensated,
            coupled,
            asked,
            homing,
            limit_switches,
            feedback,
            hardware_stops,
            position_loss,
            motion,
            feed_forward,
            simulation,
        })
    }

    pub(super) fn title(&self) -> String {
        format!("axis \"{}\"", self.name.get_ref())
    }

    pub(super) fn mm_per_revolution(&self) -> f64 {
        self.pitch / self.gear
    }

    /// The axis with those drives, how it is homed, and its limit switches.
    pub(super) fn join(
        self,
        drives: Vec<usize>,
        encoder: Option<usize>,
    ) -> (Axis, (Option<HomingTable>, LimitTable)) {
        let asks = |ability| self.asked.iter().any(|asked| asked.ability == ability);
        let axis = Axis {
            drive_following_error: asks(Ability::FollowingErrorLimit),
            drive_soft_limits: asks(Ability::SoftLimits),
            mm_per_revolution: self.mm_per_revolution(),
            letter: self.letter,
            drives,
            limits: self.limits,
            sent_limits: self.sent_limits,
            compensation: self.compensation,
            // Settled once its drives are known.
            cross_coupling: None,
            homing: Homing {
                square: (self.limits.skew).map(|skew| Square::usual(&self.limits, skew)),
                ..Homing::default()
            },
            limit_inputs: [Vec::new(), Vec::new()],
            feedback: encoder.zip(self.feedback).map(|(encoder, table)| Feedback {
                encoder,
                difference: table.difference,
                closes_loop: table.closes_loop.is_some(),
            }),
            hardware_stops: self.hardware_stops,
            position_loss: (self.position_loss)
                .map(|ms| Duration::from_millis(ms.into_inner() as u64)),
            motion: Motion::Path,
            feed_forward: self.feed_forward,
            shaped_by: 0.0,
            simulation: self.simulation,
        };
        (axis, (self.homing, self.limit_switches))
    }
}
