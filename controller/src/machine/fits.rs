//! Whether a drive can do what its axis, the cycle and its bus ask of it: what the model says of
//! itself, held against the machine file.

use super::compensation::CompensationTable;
use super::encoder::OFTEN_ENOUGH;
use super::{Axis, AxisLimits, Drive, HomingMethod, Machine, Motion, POLL};
use std::f64::consts::TAU;
use std::ops::Range;
use std::time::Duration;
use syncline_drives::model::{self, Ability, Increments, Model, Monitoring, Scaling, Setpoints};
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// A key of an axis that asks its drives for an ability.
pub(super) struct Asked {
    key: &'static str,
    pub(super) ability: Ability,
    span: Range<usize>,
}

impl Asked {
    pub(super) fn new(key: &'static str, ability: Ability, span: Range<usize>) -> Self {
        Self { key, ability, span }
    }
}

/// What an axis asks its drives to do besides following.
pub(super) fn asked(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Vec<Asked> {
    let keys = [
        ("drive_following_error", Ability::FollowingErrorLimit),
        ("drive_soft_limits", Ability::SoftLimits),
    ];
    let mut asked = Vec::new();
    for (key, ability) in keys {
        if table.flag_or(log, key, false) {
            let span = table.span_of(key).unwrap_or_default();
            asked.push(Asked::new(key, ability, span));
        }
    }
    asked
}

/// A drive that an axis names, and that axis.
pub(super) struct Pairing<'p> {
    /// The drive as messages call it.
    pub(super) drive: String,
    pub(super) model: &'static Model,
    pub(super) scaling: &'p Scaling,
    /// What the drive reports at machine position 0.
    pub(super) zero: Increments,
    /// Increments of a motor revolution, and how far it moves the axis.
    pub(super) increments: u32,
    pub(super) travel: f64,
    /// The axis as messages call it, and where its name stands.
    pub(super) axis: String,
    pub(super) name: Range<usize>,
    pub(super) unit: &'static str,
    pub(super) limits: &'p AxisLimits,
    /// Where the soft limits stand.
    pub(super) soft_limits: Range<usize>,
    pub(super) asked: &'p [Asked],
}

impl Pairing<'_> {
    /// Reports what does not fit.
    pub(super) fn check(&self, log: &mut Log<'_>) {
        self.check_abilities(log);
        self.check_range(log);
        self.check_resolution(log);
    }

    fn check_abilities(&self, log: &mut Log<'_>) {
        let Self { drive, model, .. } = self;
        for Asked { key, ability, span } in self.asked {
            if !model.abilities.contains(ability) {
                log.report(
                    span.clone(),
                    format!(
                        "{}: `{key}`, which {drive} ({}) cannot",
                        self.axis, model.title
                    ),
                    match ability {
                        Ability::TorqueOffset => {
                            "leave the key out: its loops alone make the torque, as its own gains say"
                        }
                        _ => "leave the key out: the controller supervises it in any case",
                    },
                );
            }
        }
    }

    /// Whether the drive can be sent wherever the axis may go.
    fn check_range(&self, log: &mut Log<'_>) {
        let Self { scaling, unit, .. } = self;
        let positions = &self.model.positions;
        let (least, most) = self.limits.position;
        let is_reached = |mm| {
            let position = scaling.to_increments(mm);
            position.is_ok_and(|position| positions.contains(&position))
        };
        if is_reached(least) && is_reached(most) {
            return;
        }
        let mut ends = [*positions.start(), *positions.end()].map(|end| scaling.to_mm(end));
        ends.sort_by(f64::total_cmp);
        log.report(
            self.soft_limits.clone(),
            format!(
                "{}: `soft_limits` [{least}, {most}] are beyond what {} can count",
                self.axis, self.drive,
            ),
            format!(
                "allowed: {:.3}…{:.3} {unit} ({}…{} increments, {} for each revolution of {} \
                 {unit}, `zero` at {})",
                ends[0],
                ends[1],
                positions.start(),
                positions.end(),
                self.increments,
                self.travel,
                self.zero
            ),
        );
    }

    /// Whether the drive tells positions finely enough for what they are held against.
    fn check_resolution(&self, log: &mut Log<'_>) {
        let AxisLimits {
            following_error,
            skew,
            standstill,
            ..
        } = *self.limits;
        let counts = f64::from(self.increments);
        for (key, limit) in [
            ("following_error_limit", Some(following_error)),
            ("skew_limit", skew),
            ("standstill_window", Some(standstill)),
        ] {
            let Some(limit) = limit.filter(|limit| self.travel > limit * counts) else {
                continue;
            };
            log.report(
                self.name.clone(),
                format!(
                    "{}: an increment of {} is more than `{key}`",
                    self.axis, self.drive
                ),
                format!(
                    "allowed: `pitch` / `gear` up to {} {}, {counts} increments",
                    limit * counts,
                    self.unit
                ),
            );
        }
    }
}

/// `motion` of an axis, and where the file says it.
pub(super) fn motion(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
) -> Option<(Motion, Range<usize>)> {
    let motions = ["path", "point_to_point"].into_iter();
    let motion = table.choice_if(log, "motion", motions)?;
    let goes = match motion.get_ref().as_str() {
        "path" => Motion::Path,
        _ => Motion::PointToPoint,
    };
    Some((goes, motion.span()))
}

/// Whether the drives of axes that go point to point can, and nothing is asked of these axes that needs a path;
/// `motions` is what the file says of each axis, `places` where it names the drives. Where it says nothing, a drive that
/// would go on without the controller is sent velocities only if something stops it, and a loop is closed about it.
pub(super) fn settle_motions(
    log: &mut Log<'_>,
    machine: &mut Machine,
    motions: &[Option<(Motion, Range<usize>)>],
    places: &[Range<usize>],
) {
    for (index, stated) in motions.iter().enumerate() {
        let axis = &machine.axes[index];
        let drive = axis.drives[0];
        let goes_on = !machine.device(drive).spec().monitoring.is_mutual();
        let closes_loop = axis.feedback.is_some_and(|it| it.closes_loop);
        let can = |drive: usize| {
            let abilities = machine.drives[drive].model.abilities;
            abilities.contains(&Ability::PointToPoint)
        };
        let by_default = can(drive) && goes_on && !axis.hardware_stops && !closes_loop;
        let point_to_point = match stated {
            Some((motion, _)) => *motion == Motion::PointToPoint,
            None => by_default,
        };
        if !point_to_point {
            continue;
        }
        if unpaired(machine, axis).is_some() {
            continue;
        }
        let cannot = axis.drives.iter().find(|&&drive| !can(drive));
        let problem = if let Some(&drive) = cannot {
            let drive = &machine.drives[drive];
            format!(
                "which drive \"{}\" ({}) cannot",
                drive.name, drive.model.title
            )
        } else if axis.drives.len() > 1 {
            "which would rack a gantry pair".to_owned()
        } else if closes_loop {
            "and its drive closes the position loop itself then, not `position_loop`".to_owned()
        } else if matches!(axis.homing.method, HomingMethod::Switch(_)) {
            "and no path leads it to a switch".to_owned()
        } else {
            machine.axes[index].motion = Motion::PointToPoint;
            continue;
        };
        let span = stated
            .as_ref()
            .map_or_else(|| places[drive].clone(), |(_, span)| span.clone());
        log.report(
            span,
            format!(
                "axis \"{}\": `motion = \"point_to_point\"`, {problem}",
                axis.name()
            ),
            "leave the key out where the drive follows a path; otherwise see docs/machine-file.md",
        );
    }
}

/// Whether each axis that is compensated follows the path, where it is seen which way it goes.
pub(super) fn check_compensation(
    log: &mut Log<'_>,
    machine: &Machine,
    compensated: &[Option<CompensationTable>],
) {
    for (axis, table) in machine.axes.iter().zip(compensated) {
        if let Some(table) = table
            && axis.motion == Motion::PointToPoint
        {
            let title = format!("axis \"{}\"", axis.name());
            let help = "leave it out, or let the axis follow the path: `motion = \"path\"`";
            table.refuse(log, &title, "that goes point to point", help);
        }
    }
}

/// The drive of a gantry pair that cannot be a side of one, if there is one: neither does it tell its place at every SYNC, nor
/// can one encoder tell that of either side.
fn unpaired<'m>(machine: &'m Machine, axis: &Axis) -> Option<&'m Drive> {
    let mut sides = axis.drives.iter().filter(|_| axis.drives.len() > 1);
    let tells = |drive: usize| machine.device(drive).spec().answers_sync;
    let side = sides.find(|&&drive| !tells(drive));
    side.map(|&drive| &machine.drives[drive])
}

/// Whether each drive of a gantry pair can be a side of one. `places` are where the file names the drives.
pub(super) fn check_pairs(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for axis in &machine.axes {
        let Some(drive) = unpaired(machine, axis) else {
            continue;
        };
        log.report(
            places[axis.drives[0]].clone(),
            format!(
                "axis \"{}\": drive \"{}\" ({}) cannot be a side of a gantry pair: it does not tell its position at every SYNC, \
                 at which the two sides are compared",
                axis.name(),
                drive.name,
                drive.model.title
            ),
            "give each side a drive that does, or each drive an axis of its own",
        );
    }
}

/// Whether each drive that is to be sent torques has room for them in its R_PDO, which its maker may have mapped without. `places`
/// are where the file names the drives.
pub(super) fn check_feed_forward(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for ((index, drive), place) in machine.drives.iter().enumerate().zip(places) {
        let axis = &machine.axes[drive.axis];
        let can = drive.model.abilities.contains(&Ability::TorqueOffset);
        let Some(feed_forward) = axis.feed_forward.filter(|_| can) else {
            continue;
        };
        if feed_forward.motor_inertia > 0.0 && !axis.has_backlash() {
            log.report(
                place.clone(),
                format!(
                    "axis \"{}\": `motor_inertia` of its `feed_forward` without `backlash`, which the motor would cross alone",
                    axis.name(),
                ),
                "leave it out, or state the `backlash`",
            );
        }
        let radians = TAU / axis.mm_per_revolution;
        let limits = axis.stated_limits();
        let excess = feed_forward.excess(limits.velocity * radians, limits.acceleration * radians);
        if let Some((when, torque, allowed)) = excess {
            log.report(
                place.clone(),
                format!(
                    "axis \"{}\": by its `feed_forward` drive \"{}\" takes {torque:.3} N·m {when}",
                    axis.name(),
                    drive.name,
                ),
                format!("allowed: up to {allowed:.3} N·m, by the `rated_torque` of its motor"),
            );
        }
        if machine.device(index).takes_torque() {
            continue;
        }
        log.report(
            place.clone(),
            format!(
                "axis \"{}\": `feed_forward`, which drive \"{}\" ({}) is not sent: its maker has mapped its R_PDO without \
                 60B2h",
                axis.name(),
                drive.name,
                drive.model.title
            ),
            "leave the key out, or name an R_PDO by `r_pdo` that has 60B2h",
        );
    }
}

/// Whether each drive that goes to targets has a ramp as flat as its axis needs. `places` are where the file names the drives.
pub(super) fn check_ramps(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for ((index, drive), place) in machine.drives.iter().enumerate().zip(places) {
        let axis = &machine.axes[drive.axis];
        let device = machine.device(index);
        let least =
            device.drive().map_or(0.0, model::Drive::least_ramp) * drive.scaling.resolution();
        let most = axis.sent_limits.acceleration;
        if axis.motion != Motion::PointToPoint || most >= least {
            continue;
        }
        let [.., unit, _] = axis.units();
        log.report(
            place.clone(),
            format!(
                "axis \"{}\": `max_acceleration` is {most}, and drive \"{}\" ({}) has no ramp below {least:.4} {unit}",
                axis.name(),
                drive.name,
                drive.model.title
            ),
            format!("allowed: from {least:.4} {unit}"),
        );
    }
}

/// Whether each drive can be as fast as its axis may be. `places` are where the file names the drives.
pub(super) fn check_velocities(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for ((index, drive), place) in machine.drives.iter().enumerate().zip(places) {
        let axis = &machine.axes[drive.axis];
        let device = machine.device(index);
        let most = device
            .drive()
            .map_or(f64::INFINITY, model::Drive::most_velocity)
            * drive.scaling.resolution();
        let velocity = axis.sent_limits.velocity;
        if velocity <= most {
            continue;
        }
        let [_, unit, ..] = axis.units();
        log.report(
            place.clone(),
            format!(
                "axis \"{}\": `max_velocity` is {velocity}, and drive \"{}\" ({}) takes no more than {most:.3} {unit} in its unit of velocity",
                axis.name(),
                drive.name,
                drive.model.title
            ),
            format!("allowed: up to {most:.3} {unit}, or a coarser unit, if the drive has one"),
        );
    }
}

/// Whether each drive that is sent velocities has what its axis's loop needs: a position at every SYNC, and
/// something that stops it where the controller dies. `places` are where the file names the drives.
pub(super) fn check_loops(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for ((index, drive), place) in machine.drives.iter().enumerate().zip(places) {
        let axis = &machine.axes[drive.axis];
        let device = machine.device(index);
        let (spec, who) = (device.spec(), &drive.name);
        let (name, title) = (axis.name(), drive.model.title);
        let is_sent = drive.model.is_sent(Setpoints::Velocities);
        if !is_sent || axis.motion == Motion::PointToPoint || unpaired(machine, axis).is_some() {
            continue;
        }
        if !spec.answers_sync && !axis.feedback.is_some_and(|it| it.closes_loop) {
            // As old as the answer to the last request but one, which is heard in the cycle after it.
            let old = POLL + spec.sdo_response + machine.cycle;
            let travel = axis.limits.velocity * old.as_secs_f64();
            log.report(
                place.clone(),
                format!(
                    "axis \"{name}\": drive \"{who}\" ({title}) is sent velocities, and does not tell its \
                     position at every SYNC; asked by SDO every {} ms it would be up to {:.1} ms old, in \
                     which the axis goes {travel:.2} mm",
                    POLL.as_millis(),
                    old.as_secs_f64() * 1e3
                ),
                "name an [[encoder]] as the axis's `feedback`, with `position_loop = \"encoder\"`",
            );
        }
        if spec.monitoring.is_mutual() {
            continue;
        }
        let unstopped = format!(
            "axis \"{name}\": drive \"{who}\" ({title}) is sent velocities, and goes on with the last one \
             where the controller dies"
        );
        if !axis.hardware_stops {
            let help =
                "have the enable chain stop it, and say so: `unsupervised_stop = \"hardware\"`";
            log.report(place.clone(), unstopped, help);
        } else if machine.enable_chain().is_none() {
            let problem = format!("{unstopped}, and no output opens the enable chain");
            let help = "add an [[output]] of an [[io]] with `function = \"enable_chain\"`, and let its contactor \
                        cut the drive's power";
            log.report(place.clone(), problem, help);
        }
    }
}

/// Whether each drive that does not answer every SYNC can do that, and nothing that looks at it needs more. `dividers` are
/// what the file says of each, and where.
pub(super) fn check_dividers(
    log: &mut Log<'_>,
    machine: &Machine,
    dividers: &[(u8, Range<usize>)],
) {
    let drives = machine.drives.iter().enumerate();
    for ((index, drive), (divider, place)) in drives.zip(dividers) {
        let problem = (*divider > 1).then(|| undivided(machine, index, drive));
        let Some(problem) = problem.flatten() else {
            continue;
        };
        log.report(
            place.clone(),
            format!(
                "drive \"{}\": `sync_divider` is {divider}: {problem}",
                drive.name
            ),
            "allowed: a smaller one; 1 has it answer every SYNC",
        );
    }
}

/// Why a drive has to answer more SYNCs than it does, if it has to.
fn undivided(machine: &Machine, index: usize, drive: &Drive) -> Option<String> {
    let (axis, title) = (&machine.axes[drive.axis], drive.model.title);
    let apart = machine.cycle * drive.sync_divider.into();
    let loss = machine.position_loss(index);
    let misses = loss.map(|loss| loss.as_nanos() / apart.as_nanos() + 1);
    let misses = misses.unwrap_or(machine.controller.t_pdo_misses.into());
    let unseen = misses * u128::from(drive.sync_divider);
    let probes = machine.inputs.iter().any(|it| it.meaning.is_probed());
    if !drive.model.abilities.contains(&Ability::SyncDivider) {
        return Some(match drive.model.is_sent(Setpoints::Positions) {
            true => {
                format!("the {title} is sent positions, and has to be seen to go to each of them")
            }
            false => format!("the {title} answers no SYNC"),
        });
    }
    let problem = if axis.drives.len() > 1 {
        "the two sides of a gantry pair are compared at every SYNC".to_owned()
    } else if matches!(
        axis.homing.method,
        HomingMethod::Switch(_) | HomingMethod::HardStop(_) | HomingMethod::Drive(_)
    ) {
        format!(
            "axis \"{}\" is homed by where its drive is at a SYNC",
            axis.name()
        )
    } else if probes {
        "a probe asks for the position of every axis at a SYNC".to_owned()
    } else if axis
        .feedback
        .is_some_and(|it| machine.encoders[it.encoder].sync_divider > 1)
    {
        "its encoder does not answer every SYNC either, and they would never be compared".to_owned()
    } else if apart > OFTEN_ENOUGH {
        format!(
            "its positions would be {} ms apart, more than {} ms",
            apart.as_secs_f64() * 1e3,
            OFTEN_ENOUGH.as_secs_f64() * 1e3
        )
    } else if unseen > MOST_LOST {
        format!("it might be unseen for {unseen} cycles, more than {MOST_LOST}")
    } else {
        return None;
    };
    Some(problem)
}

/// Whether the drive of the spindle, which `place` names, notices that the controller is gone.
pub(super) fn check_spindle(log: &mut Log<'_>, machine: &Machine, place: Option<Range<usize>>) {
    let (Some((index, drive)), Some(place)) = (machine.spindle_drive(), place) else {
        return;
    };
    if machine.device(index).spec().monitoring.is_mutual() {
        return;
    }
    log.report(
        place,
        format!(
            "spindle: drive \"{}\" ({}) does not notice that the controller is gone, and would turn on",
            drive.name, drive.model.title
        ),
        "allowed: one with a heartbeat, or with guarding, `has_guarding = 1`",
    );
}

/// Whether guarded devices are asked often enough. One request leaves in a cycle, and none in those in which the controller's own
/// heartbeat does. Each device has its turn within a third of the time between two requests, so that three of them, one of which may
/// get lost, end in time.
/// `places` are where the file names the drives; of a bus the first one tells.
pub(super) fn check_guarding(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    let guarded = machine.nodes().enumerate().filter_map(|(index, node)| {
        match machine.device(index).spec().monitoring {
            Monitoring::Guarding { every } => Some((index, node, every)),
            _ => None,
        }
    });
    let guarded: Vec<_> = guarded.collect();
    let (heartbeat, cycle) = (machine.controller.heartbeat, machine.cycle);
    // Between two heartbeats of the controller's.
    let free = (heartbeat.as_nanos().div_ceil(cycle.as_nanos()) as u32).saturating_sub(1);
    for bus in 0..machine.buses.len() {
        let mut on_bus = guarded.iter().filter(|(_, node, _)| node.bus == bus);
        let requests = on_bus.clone().count() as u32;
        let Some((index, node, every)) = on_bus.next() else {
            continue;
        };
        if free == 0 {
            log.report(
                places.get(*index).cloned().unwrap_or_default(),
                format!(
                    "drive \"{}\" ({}): it is guarded, and each cycle has the controller's heartbeat in place of a request",
                    node.name, node.model.title
                ),
                format!(
                    "allowed: `heartbeat_ms` of more than a cycle: from {}",
                    cycle.as_millis() + 1
                ),
            );
            continue;
        }
        let turn = cycle * (requests + requests.div_ceil(free));
        if turn * 3 <= *every {
            continue;
        }
        log.report(
            places.get(*index).cloned().unwrap_or_default(),
            format!(
                "drive \"{}\" ({}): it is guarded every {} ms, a quarter of `heartbeat_timeout_ms`, and its turn may \
                 come {:.1} ms late",
                node.name,
                node.model.title,
                every.as_millis(),
                turn.as_secs_f64() * 1e3
            ),
            format!(
                "allowed: `heartbeat_timeout_ms` from {}, a longer `heartbeat_ms`, or a shorter `cycle_us`",
                (turn * 3).as_nanos().div_ceil(1_000_000) * 4
            ),
        );
    }
}

/// Cycles for which a position may be missing: the plan is kept for longer than that and the drives' latency.
const MOST_LOST: u128 = 40;

/// Whether each axis whose position may be missing has a loop of the controller's about it, and a plan to go on by. `stated`
/// is what the file says, for each axis.
pub(super) fn check_losses(log: &mut Log<'_>, machine: &Machine, stated: &[Option<Spanned<i64>>]) {
    for (index, (axis, stated)) in machine.axes.iter().zip(stated).enumerate() {
        let Some(stated) = stated else { continue };
        let (name, ms) = (axis.name(), stated.get_ref());
        let most = machine.cycle.as_nanos() * MOST_LOST / 1_000_000;
        let (problem, help) = if !machine.closes_loop(index) {
            let help =
                "leave the key out: it is for an axis of the path whose drive is sent velocities";
            (
                "and no loop of the controller has it".to_owned(),
                help.to_owned(),
            )
        } else if *ms as u128 > most {
            let problem = format!(
                "more than {MOST_LOST} cycles of {} µs",
                machine.cycle.as_micros()
            );
            (problem, format!("allowed: 1…{most}"))
        } else {
            continue;
        };
        let problem = format!("axis \"{name}\": `position_loss_ms` is {ms}, {problem}");
        log.report(stated.span(), problem, help);
    }
}

/// Whether each axis whose drive begins to count as it is switched on learns where it is from something else: of one that
/// follows a path the encoder of its loop tells it.
pub(super) fn check_counts(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for ((index, drive), place) in machine.drives.iter().enumerate().zip(places) {
        let axis = &machine.axes[drive.axis];
        let device = machine.device(index);
        let feedback = device.feedback();
        let counts_on = feedback.is_none_or(model::Feedback::counts_without_power);
        let is_told = match axis.homing.method {
            HomingMethod::Encoder => axis.feedback.is_some(),
            HomingMethod::SetHere { .. }
            | HomingMethod::Switch(_)
            | HomingMethod::HardStop(_)
            | HomingMethod::Drive(_) => axis.homing.moved_limit.is_none(),
        };
        if counts_on || is_told || axis.motion == Motion::Path {
            continue;
        }
        log.report(
            place.clone(),
            format!(
                "axis \"{}\": drive \"{}\" ({}) counts from where it is switched on, and nothing tells where that is",
                axis.name(),
                drive.name,
                drive.model.title
            ),
            match axis.feedback {
                None => {
                    "home it after each power-on: [axis.homing] with `kind = \"set_here\"` and without `absolute`; or name an \
                     [[encoder]] as the axis's `feedback`"
                }
                Some(_) => {
                    "leave [axis.homing] out: the encoder that is its `feedback` tells where it is; or leave `absolute` out, \
                     and home it after each power-on"
                }
            },
        );
    }
}

/// Cycles from a setpoint to the next one at the most: two in a row may be missed before the machine stops.
const CYCLES_APART: f64 = 3.0;

/// Whether each drive whose setpoint begins anew behind some value can tell from it which way to go.
pub(super) fn check_setpoints(log: &mut Log<'_>, machine: &Machine, places: &[Range<usize>]) {
    for ((index, drive), place) in machine.drives.iter().enumerate().zip(places) {
        let device = machine.device(index);
        let Some(range) = device.drive().and_then(model::Drive::setpoint_range) else {
            continue;
        };
        let (axis, drive) = (&machine.axes[drive.axis], (drive, range));
        if let Some([problem, help]) = ambiguous(axis, drive, machine.cycle) {
            log.report(place.clone(), problem, help);
        }
    }
}

/// What is wrong with a drive whose setpoint has so many values, if it is: half of them have to be more than
/// what it moves from one setpoint to the next, and an increment by rounding.
fn ambiguous(
    axis: &Axis,
    (drive, range): (&Drive, Increments),
    cycle: Duration,
) -> Option<[String; 2]> {
    let time = CYCLES_APART * cycle.as_secs_f64();
    let most = (range.get() as f64 / 2.0 - 1.0) * drive.scaling.resolution() / time;
    let velocity = axis.sent_limits.velocity;
    if velocity < most {
        return None;
    }
    let (name, [_, unit, ..]) = (axis.name(), axis.units());
    Some([
        format!(
            "axis \"{name}\": with `max_velocity` {velocity} drive \"{}\" ({}), whose setpoints begin anew \
             after {range} increments, cannot tell which way it is to go where setpoints are missed",
            drive.name, drive.model.title
        ),
        format!(
            "allowed: `max_velocity` below {most:.3} {unit} (half of {range} increments in {CYCLES_APART} \
             cycles), or a shorter `cycle_us`"
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_drives::model::{Direction, MODELS};

    /// What is told of an axis with a drive of whatever model, changed by `change`.
    fn told(limits: AxisLimits, change: impl Fn(&mut Model)) -> Vec<String> {
        let told = MODELS.iter().map(|model| {
            let mut model = Model::clone(model);
            model.title = "DRIVE";
            change(&mut model);
            told_with(limits, model)
        });
        let mut told: Vec<_> = told.collect();
        told.dedup();
        assert_eq!(told.len(), 1, "{told:?}");
        told.swap_remove(0)
    }

    fn told_with(limits: AxisLimits, model: Model) -> Vec<String> {
        let source = "drive_following_error = true\ndrive_soft_limits = true\n";
        let mut log = Log::new(source);
        let document = syncline_strict_toml::parse(&mut log, source);
        let mut table = Table::new("axis \"X\"", 0..0, document.get_ref());
        let asked = asked(&mut log, &mut table);
        let pairing = Pairing {
            drive: "drive \"X1\"".into(),
            model: Box::leak(Box::new(model)),
            scaling: &Scaling::new(1000, 10.0, Direction::Positive, Increments::ZERO),
            zero: Increments::ZERO,
            increments: 1000,
            travel: 10.0,
            axis: "axis \"X\"".into(),
            name: 0..0,
            unit: "mm",
            limits: &limits,
            soft_limits: 0..0,
            asked: &asked,
        };
        pairing.check(&mut log);
        let diagnostics = log.into_diagnostics().into_iter();
        diagnostics.map(|told| told.problem).collect()
    }

    fn all(model: &mut Model) {
        model.abilities = &[Ability::FollowingErrorLimit, Ability::SoftLimits];
    }

    const LIMITS: AxisLimits = AxisLimits {
        position: (-300.0, 300.0),
        velocity: 100.0,
        acceleration: 1000.0,
        jerk: 10_000.0,
        following_error: 1.0,
        following_error_at_rest: 1.0,
        skew: Some(1.0),
        standstill: 0.1,
    };

    #[test]
    fn a_drive_is_asked_for_what_it_can_do_only() {
        let none: Vec<String> = Vec::new();
        assert_eq!(told(LIMITS, all), none);
        let cannot = |abilities| told(LIMITS, |model| model.abilities = abilities);
        let refusal = |key| format!("axis \"X\": `{key}`, which drive \"X1\" (DRIVE) cannot");
        let keys = ["drive_following_error", "drive_soft_limits"];
        assert_eq!(cannot(&[]), keys.map(refusal));
        assert_eq!(cannot(&[Ability::SoftLimits]), [refusal(keys[0])]);
        assert_eq!(cannot(&[Ability::FollowingErrorLimit]), [refusal(keys[1])]);
    }

    #[test]
    fn an_axis_stays_where_its_drive_can_be_sent() {
        let short = |model: &mut Model| {
            let [least, most] = [i16::MIN, i16::MAX].map(i32::from).map(Increments::from);
            model.positions = least..=most;
            all(model);
        };
        let up_to = |most| AxisLimits {
            position: (-327.68, most),
            ..LIMITS
        };
        assert_eq!(told(up_to(327.67), short).len(), 0);
        assert_eq!(
            told(up_to(327.68), short),
            ["axis \"X\": `soft_limits` [-327.68, 327.68] are beyond what drive \"X1\" can count"]
        );
    }

    /// Of the portal's Z, which counts 13,107.2 increments a millimetre.
    #[test]
    fn a_setpoint_tells_which_way_to_go() {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../examples/portal/machine.toml"
        );
        let machine = Machine::load(file.as_ref()).unwrap();
        let (mut axis, drive) = (machine.axes[2].clone(), &machine.drives[3]);
        let mut told = |velocity, range| {
            axis.sent_limits.velocity = velocity;
            ambiguous(&axis, (drive, Increments::new(range)), machine.cycle)
        };
        // 32,767 increments in 6 ms.
        assert_eq!(told(416.6, 65_536), None);
        assert_eq!(
            told(416.7, 65_536),
            Some([
                "axis \"Z\": with `max_velocity` 416.7 drive \"Z\" (LXM32M), whose setpoints begin anew after \
                 65536 increments, cannot tell which way it is to go where setpoints are missed"
                    .to_owned(),
                "allowed: `max_velocity` below 416.654 mm/s (half of 65536 increments in 3 cycles), or a \
                 shorter `cycle_us`"
                    .to_owned(),
            ])
        );
        assert_eq!(told(208.0, 32_768), None);
        assert!(told(209.0, 32_768).is_some());
        assert!(told(1e-6, 2).is_some());
    }

    #[test]
    fn no_limit_is_finer_than_an_increment() {
        for (key, limits) in [
            (
                "following_error_limit",
                AxisLimits {
                    following_error: 0.009,
                    ..LIMITS
                },
            ),
            (
                "skew_limit",
                AxisLimits {
                    skew: Some(0.009),
                    ..LIMITS
                },
            ),
            (
                "standstill_window",
                AxisLimits {
                    standstill: 0.009,
                    ..LIMITS
                },
            ),
        ] {
            assert_eq!(
                told(limits, all),
                [format!(
                    "axis \"X\": an increment of drive \"X1\" is more than `{key}`"
                )]
            );
        }
        let just = AxisLimits {
            following_error: 0.01,
            skew: None,
            standstill: 0.01,
            ..LIMITS
        };
        assert_eq!(told(just, all).len(), 0);
    }
}
