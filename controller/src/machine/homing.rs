//! `[homing]` and `[axis.homing]`: how an axis comes to know where it is.
//!
//! An absolute encoder knows it from the beginning. Any other axis counts from where it was switched on
//! until it is homed: then it is *referenced*, and its positions are machine positions.

mod hard_stop;
pub(super) mod test_move;

pub use hard_stop::HardStopSearch;
pub use test_move::TestMove;

use super::names;
use super::signals::{Input, InputMeaning};

use super::simulation::{number, number_or};
use super::{Axis, AxisLimits, Drive, Machine, Motion, signals};
use hard_stop::HardStopTable;
use std::ops::Range;
use std::time::Duration;
use syncline_drives::model::{Ability, Capture};
use syncline_strict_toml::{Log, Table, one_of};
use toml::Spanned;

/// `[homing]`: what holds for all axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HomingPolicy {
    /// A machine that is switched on for one program homes what is not referenced before it.
    pub at_start: bool,
    /// Programs and typed lines may move axes that are not referenced.
    pub unreferenced_jobs: bool,
}

/// `[axis.homing]`: how an axis is homed.
#[derive(Clone, Debug, PartialEq)]
pub struct Homing {
    /// How it finds its place.
    pub method: HomingMethod,
    /// Axes with a lower number home first, those with the same number at once.
    pub order: u32,
    /// The highest speed of a jog while the axis is not referenced, mm/s.
    pub jog_speed: f64,
    /// How far one jog goes at most while the axis is not referenced, mm.
    pub jog_distance: f64,
    /// How a gantry is taken square; `None` of an axis with one drive.
    pub square: Option<Square>,
    /// The encoders of an axis that is homed keep counting without power: its reference holds when it is switched on
    /// again and has moved by no more than this since, mm.
    pub moved_limit: Option<f64>,
    /// Where it is homed again, its reference may be so far from where it believed that to be, mm; more is a fault: lost steps, or a
    /// coupling that has slipped. `None`: that is told alone.
    pub reference_limit: Option<f64>,
    /// The slow move with which each homing begins of an axis whose drive is sent velocities, if it is to.
    pub test_move: Option<TestMove>,
}

/// How the two sides of a gantry are brought to where they belong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// How far they may be apart for a homing to take that out, mm; what is more is a fault.
    pub most: f64,
    /// How fast one moves against the other, mm/s.
    pub speed: f64,
    /// By how much the switch of the second side comes on further than that of the first where the
    /// gantry is square, mm.
    pub squareness: f64,
}

impl Square {
    /// `square_speed` where it is not said, of the greatest velocity.
    const USUAL_SPEED: f64 = 0.01;

    /// Of a gantry without `[axis.homing]`, whose sides may be so far apart.
    pub(super) fn usual(limits: &AxisLimits, skew: f64) -> Self {
        Self {
            most: skew,
            speed: Self::USUAL_SPEED * limits.velocity,
            squareness: 0.0,
        }
    }
}

/// How an axis finds its place.
#[derive(Clone, Debug, PartialEq)]
pub enum HomingMethod {
    /// Its encoder is absolute, with the drives' `zero`: it always knows where it is.
    Encoder,
    /// Where it stands when it is homed is this machine position, mm.
    SetHere {
        /// mm.
        position: f64,
    },
    /// The controller searches a switch.
    Switch(SwitchSearch),
    /// The controller searches a hard stop.
    HardStop(HardStopSearch),
    /// Its drive homes by itself.
    Drive(DriveHoming),
}

/// A homing that a drive makes by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveHoming {
    /// Which one, of its model's [`homing_methods`](syncline_drives::model::Model::homing_methods).
    pub method: u8,
    /// Of the search, mm/s.
    pub speed: f64,
    /// Over the edge that counts, mm/s.
    pub slow_speed: f64,
    /// How far from where it begins the axis goes at most, mm.
    pub max_distance: f64,
    /// How long it takes at most.
    pub max_time: Duration,
    /// Machine position of the drive's reference point, mm.
    pub position: f64,
    /// Where the axis goes once it is referenced, mm.
    pub final_position: f64,
}

/// The method of CiA 402 that takes the place where the drive stands.
const SET_HERE: u8 = 35;

/// A search for a switch.
#[derive(Clone, Debug, PartialEq)]
pub struct SwitchSearch {
    /// For each drive of the axis, the switch at its side: index in
    /// [`Machine::inputs`](super::Machine::inputs).
    pub inputs: Vec<usize>,
    /// For each drive of the axis, how it captures the edge of its switch; empty where edges are taken from samples.
    pub captures: Vec<&'static Capture>,
    /// Another axis has the same switch.
    pub is_shared: bool,
    /// Its place is that of the first index of the motor's encoder behind the edge, where the drive counts whole turns.
    pub by_index: bool,
    /// 1 or −1: to which side the switch is searched.
    pub direction: f64,
    /// Of the search, mm/s.
    pub speed: f64,
    /// Of the approach by which the edge is measured, mm/s.
    pub slow_speed: f64,
    /// From how far in front of the edge it is approached, mm.
    pub back_off: f64,
    /// How far from where it begins the axis goes at most to either side, mm.
    pub max_distance: f64,
    /// How long the axis takes at most.
    pub max_time: Duration,
    /// Machine position of the edge at which the switch comes on in that direction, or of the index behind it, mm.
    pub position: f64,
    /// Where the axis goes once it is referenced, mm.
    pub final_position: f64,
}

impl Default for Homing {
    /// An absolute encoder.
    fn default() -> Self {
        Self {
            method: HomingMethod::Encoder,
            order: 0,
            jog_speed: f64::INFINITY,
            jog_distance: f64::INFINITY,
            square: None,
            moved_limit: None,
            reference_limit: None,
            test_move: None,
        }
    }
}

impl Homing {
    /// Whether the axis is referenced from the beginning.
    #[must_use]
    pub fn is_absolute(&self) -> bool {
        self.tells_place() && self.test_move.is_none()
    }

    /// Whether its encoder tells from the beginning where the axis is.
    #[must_use]
    pub fn tells_place(&self) -> bool {
        self.method == HomingMethod::Encoder
    }

    /// Whether an operator has to say where the axis stands.
    #[must_use]
    pub fn is_by_hand(&self) -> bool {
        match &self.method {
            HomingMethod::SetHere { .. } => true,
            HomingMethod::Drive(own) => own.method == SET_HERE,
            HomingMethod::Encoder | HomingMethod::Switch(_) | HomingMethod::HardStop(_) => false,
        }
    }

    /// The switches by which it is homed, by their places in [`Machine::inputs`](super::Machine::inputs).
    #[must_use]
    pub fn switches(&self) -> &[usize] {
        match &self.method {
            HomingMethod::Switch(search) => &search.inputs,
            _ => &[],
        }
    }

    /// Where the axis goes once its place is found, and how fast; mm and mm/s.
    #[must_use]
    pub fn final_move(&self) -> Option<(f64, f64)> {
        match &self.method {
            HomingMethod::Encoder | HomingMethod::SetHere { .. } => None,
            HomingMethod::Switch(search) => Some((search.final_position, search.speed)),
            HomingMethod::HardStop(search) => Some((search.final_position, search.speed)),
            HomingMethod::Drive(own) => Some((own.final_position, own.speed)),
        }
    }

    /// The highest speed of the axis' jogs, mm/s.
    #[must_use]
    pub fn fastest_jog(&self, limits: &AxisLimits, referenced: bool) -> f64 {
        match referenced {
            true => limits.velocity,
            false => limits.velocity.min(self.jog_speed),
        }
    }

    /// Where the axis stands once it is homed, if that is stated.
    #[must_use]
    pub fn final_position(&self) -> Option<f64> {
        match &self.method {
            HomingMethod::SetHere { position } => Some(*position),
            _ => self.final_move().map(|(there, _)| there),
        }
    }
}

/// `[homing]` of a machine file.
pub(super) fn policy(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Spanned<HomingPolicy> {
    let span = table.span_of("at_start").unwrap_or_default();
    let policy = HomingPolicy {
        at_start: table.flag_or(log, "at_start", false),
        unreferenced_jobs: table.flag_or(log, "unreferenced_jobs", false),
    };
    table.finish(log);
    Spanned::new(span, policy)
}

/// `[axis.homing]` as the file has it.
pub(super) struct HomingTable {
    homing: Homing,
    /// The names of its switches.
    switches: Option<Spanned<Vec<Spanned<String>>>>,
    /// Whether the drives are to capture the switches' edges, if the file says so.
    latch: Option<Spanned<bool>>,
    /// Where it says whether the index behind the edge counts.
    index: Option<Range<usize>>,
    /// What asks for more of its drive than that it follows.
    search: Option<OwnSearch>,
    /// Where it has it make a test move.
    test: Option<Range<usize>>,
}

/// A homing that its drive has to be made for.
pub(super) enum OwnSearch {
    /// By a method of its own, which the file says here.
    Method(Range<usize>),
    /// Against a hard stop.
    HardStop(HardStopTable),
}

impl HomingTable {
    /// What [`check`] looks at once it is known how the axis moves.
    pub(super) fn take_search(&mut self) -> Option<OwnSearch> {
        self.search.take()
    }

    /// Where the file has the axis make a test move.
    pub(super) fn test_move(&self) -> Option<Range<usize>> {
        self.test.clone()
    }

    /// Whether the axis has to find its place.
    pub(super) fn searches(&self) -> bool {
        !self.homing.tells_place()
    }
}

/// What a `homing` looks like.
const ALLOWED: &str = "a table [axis.homing]; see docs/homing.md";
const KINDS: [&str; 5] = ["encoder", "set_here", "switch", "hard_stop", "drive"];
/// Of a jog without a reference, mm or degrees.
const JOG_DISTANCE: f64 = 10.0;
/// How far an axis may move without power, mm or degrees.
const MOVED: f64 = 1.0;

/// The key of an axis with those limits, of a gantry where those have a skew.
pub(super) fn read(
    log: &mut Log<'_>,
    axis: &mut Table<'_, '_>,
    limits: &AxisLimits,
    rotary: bool,
) -> Option<HomingTable> {
    let mut table = axis.table_if(log, "homing", ALLOWED)?;
    table.title = format!("{}: homing", axis.title);
    let kind = table.choice(log, "kind", KINDS.into_iter());
    let [position, speed] = if rotary {
        ["(°)", "(°/s)"]
    } else {
        ["(mm)", "(mm/s)"]
    };
    let mut switches = None;
    let mut latch = None;
    let mut index = None;
    let mut own = None;
    let mut stop = None;
    let mut jog_speed = limits.velocity / 10.0;
    let method = match kind.as_ref().map(|kind| kind.get_ref().as_str()) {
        Some("set_here") => Some(HomingMethod::SetHere {
            position: place(log, &mut table, "position", 0.0, limits, position),
        }),
        Some("switch") => {
            let allowed = "the name of an [[input]] for each of the axis' drives";
            switches = table.texts(log, "switches", allowed, 1..=2);
            let said = table.flag_or(log, "latch", true);
            let span = table.span_of("latch");
            latch = span.map(|span| Spanned::new(span, said));
            index = table.span_of("index");
            let search = search(log, &mut table, limits, [position, speed]);
            jog_speed = search.as_ref().map_or(jog_speed, |search| search.speed);
            search.map(HomingMethod::Switch)
        }
        Some("hard_stop") => {
            let place = kind.as_ref().map(Spanned::span).unwrap_or_default();
            stop = hard_stop::read(log, &mut table, (limits, place), [position, speed]);
            let search = stop.as_ref().map(|stop| stop.search.clone());
            jog_speed = search.as_ref().map_or(jog_speed, |search| search.speed);
            search.map(HomingMethod::HardStop)
        }
        Some("drive") => {
            own = table.span_of("method");
            let homing = drive_homing(log, &mut table, limits, [position, speed]);
            jog_speed = homing.as_ref().map_or(jog_speed, |homing| homing.speed);
            homing.map(HomingMethod::Drive)
        }
        _ => Some(HomingMethod::Encoder),
    };
    let mut homing = Homing::default();
    if kind.is_some_and(|kind| kind.get_ref() != KINDS[0]) {
        homing.order = table.integer_or(log, "order", 1, 1..=100, "") as u32;
        let most = limits.velocity;
        homing.jog_speed = number_or(log, &mut table, "jog_speed", jog_speed, 0.001..=most, speed);
        homing.jog_distance = number_or(
            log,
            &mut table,
            "jog_distance",
            JOG_DISTANCE,
            0.001..=1e6,
            position,
        );
        // The zero that a drive has found by itself is its own affair, also whether it keeps it.
        let absolute = own.is_none() && table.flag_or(log, "absolute", false);
        let given = table.span_of("moved_limit");
        let moved = number_or(log, &mut table, "moved_limit", MOVED, 0.0..=1e6, position);
        homing.moved_limit = absolute.then_some(moved);
        if let (Some(span), false) = (given, absolute) {
            log.report(
                span,
                format!("{}: `moved_limit` where no reference is kept", table.title),
                "allowed: with `absolute = true`, for encoders that count without power",
            );
        }
        // One that homes by itself has forgotten where it was.
        if own.is_none() {
            let limit = table.positive_if(log, "reference_limit", position);
            homing.reference_limit = limit.map(Spanned::into_inner);
        }
        refuse_drive_limits(log, axis);
    }
    if let Some(skew) = limits.skew {
        homing.square = Some(square(log, &mut table, limits, skew, method.as_ref()));
    }
    let test = test_move::read(log, &mut table, position);
    homing.test_move = test.as_ref().map(|(test, _)| *test);
    table.finish(log);
    Some(HomingTable {
        homing: Homing {
            method: method?,
            ..homing
        },
        switches,
        latch,
        index,
        search: (own.map(OwnSearch::Method)).or(stop.map(OwnSearch::HardStop)),
        test: test.map(|(_, place)| place),
    })
}

/// The keys of a gantry.
fn square(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    limits: &AxisLimits,
    skew: f64,
    method: Option<&HomingMethod>,
) -> Square {
    let usual = match method {
        Some(HomingMethod::Switch(search)) => search.back_off.max(skew),
        _ => skew,
    };
    let place = table.span_of("max_skew");
    let most = number_or(log, table, "max_skew", usual, skew..=1e3, "(mm)");
    if let Some(HomingMethod::Switch(search)) = method
        && let Some(place) = place
        && most > search.back_off
    {
        log.report(
            place,
            format!(
                "{}: `max_skew` is {most} mm, but the second side's switch is looked for over `back_off`, {} mm",
                table.title, search.back_off
            ),
            "allowed: up to `back_off`, or a greater `back_off`",
        );
    }
    let fastest = limits.velocity;
    let speed = number_or(
        log,
        table,
        "square_speed",
        Square::USUAL_SPEED * fastest,
        0.001..=fastest,
        "(mm/s)",
    );
    let squareness = match method {
        Some(HomingMethod::Switch(_)) => {
            number_or(log, table, "squareness", 0.0, -most..=most, "(mm)")
        }
        _ => 0.0,
    };
    Square {
        most,
        speed,
        squareness,
    }
}

/// A drive that supervises positions does so by its own count, which tells no machine position before
/// the axis is homed.
fn refuse_drive_limits(log: &mut Log<'_>, axis: &mut Table<'_, '_>) {
    if let Some(span) = axis.span_of("drive_soft_limits") {
        log.report(
            span,
            format!(
                "{}: `drive_soft_limits` of an axis that is homed",
                axis.title
            ),
            "allowed: only with an absolute encoder, `kind = \"encoder\"`",
        );
    }
}

/// To which side an axis searches.
fn direction(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<Spanned<String>> {
    table.choice(log, "direction", ["positive", "negative"].into_iter())
}

/// That side as a number.
fn sign(direction: &str) -> f64 {
    if direction == "negative" { -1.0 } else { 1.0 }
}

/// The keys of a search for a switch.
fn search(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    limits: &AxisLimits,
    [position, speed]: [&str; 2],
) -> Option<SwitchSearch> {
    let direction = direction(log, table);
    let back_off = number(log, table, "back_off", 0.001..=1e6, position);
    let by_index = table.flag_or(log, "index", false);
    let bounds = bounds(log, table, limits, ([position, speed], true));
    let Bounds {
        speed,
        slow_speed,
        max_distance,
        max_time,
        position,
        final_position,
    } = bounds?;
    Some(SwitchSearch {
        inputs: Vec::new(),
        captures: Vec::new(),
        is_shared: false,
        by_index,
        direction: sign(direction?.get_ref()),
        speed,
        slow_speed,
        back_off: back_off?,
        max_distance,
        max_time,
        position,
        final_position,
    })
}

/// The keys of a homing that a drive makes by itself.
fn drive_homing(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    limits: &AxisLimits,
    units: [&str; 2],
) -> Option<DriveHoming> {
    let method = table.integer(log, "method", 1..=SET_HERE.into(), "");
    let Bounds {
        speed,
        slow_speed,
        max_distance,
        max_time,
        position,
        final_position,
    } = bounds(log, table, limits, (units, true))?;
    Some(DriveHoming {
        method: *method?.get_ref() as u8,
        speed,
        slow_speed,
        max_distance,
        max_time,
        position,
        final_position,
    })
}

/// What every search has.
struct Bounds {
    speed: f64,
    slow_speed: f64,
    max_distance: f64,
    max_time: Duration,
    position: f64,
    final_position: f64,
}

/// The keys that bound a search, which may have a slow approach.
fn bounds(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    limits: &AxisLimits,
    ([position, speed], approaches): ([&str; 2], bool),
) -> Option<Bounds> {
    let (least, most) = limits.position;
    let fast = 0.001..=limits.velocity;
    let search_speed = number(log, table, "speed", fast, speed);
    let slow = 0.001..=search_speed.unwrap_or(limits.velocity);
    let slow_speed = match approaches {
        true => number(log, table, "slow_speed", slow, speed),
        false => search_speed,
    };
    let travel = most - least;
    let max_distance = number_or(
        log,
        table,
        "max_distance",
        1.5 * travel,
        0.001..=1e7,
        position,
    );
    let max_time = table.millis_or(log, "max_time_ms", 120_000, 3_600_000);
    let found = number(log, table, "position", -1e7..=1e7, position);
    let final_position = place(
        log,
        table,
        "final_position",
        found.unwrap_or_default().clamp(least, most),
        limits,
        position,
    );
    Some(Bounds {
        speed: search_speed?,
        slow_speed: slow_speed?,
        max_distance,
        max_time,
        position: found?,
        final_position,
    })
}

/// A place inside the soft limits.
fn place(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    key: &'static str,
    default: f64,
    limits: &AxisLimits,
    unit: &str,
) -> f64 {
    let (least, most) = limits.position;
    let unit = format!("{unit}, inside the soft limits");
    number_or(log, table, key, default, least..=most, &unit)
}

/// Gives each axis of these drives the homing of its table: the names of its switches are inputs of the machine.
pub(super) fn join(
    log: &mut Log<'_>,
    (axes, drives): (&mut [Axis], &[Drive]),
    tables: Vec<Option<HomingTable>>,
    (inputs, places): (&[Input], &[Range<usize>]),
    policy: &Spanned<HomingPolicy>,
) {
    // By input: the last axis that has it, and in which order.
    let mut users: Vec<Option<(usize, u32)>> = vec![None; inputs.len()];
    let mut wrong = Vec::new();
    for (axis, table) in tables.into_iter().enumerate() {
        let Some(HomingTable {
            mut homing,
            switches,
            latch,
            index,
            ..
        }) = table
        else {
            continue;
        };
        let name = axes[axis].name();
        if let (HomingMethod::Switch(search), Some(switches)) = (&mut homing.method, switches) {
            let sides = axes[axis].drives.len();
            if let Some(index) = index.filter(|_| search.by_index) {
                check_index(log, &axes[axis], drives, index);
            }
            if switches.get_ref().len() != sides {
                log.report(
                    switches.span(),
                    format!("axis \"{name}\": homing: a switch for each of its {sides} drives"),
                    "allowed: as many names as `drives` has, in the same order",
                );
            }
            for switch in switches.get_ref() {
                let Some(input) = home_input(log, &axes[axis], switch, (inputs, search)) else {
                    wrong.push(switch.get_ref().clone());
                    continue;
                };
                search.inputs.push(input);
                if let Some((other, order)) = users[input].replace((axis, homing.order)) {
                    search.is_shared = true;
                    share(log, switch, axes, [other, axis], [order, homing.order]);
                }
            }
            if latch.as_ref().is_none_or(|latch| *latch.get_ref()) {
                let sides = search.inputs.iter().map(|&input| &inputs[input]);
                let captures = sides.zip(&axes[axis].drives).map(|(switch, &drive)| {
                    let captured = capture(switch, drive, drives);
                    if let (None, Some(latch)) = (captured, &latch) {
                        refuse_latch(log, name, latch.span(), switch, &drives[drive]);
                    }
                    captured
                });
                // Of all sides or of none.
                let captures: Vec<_> = captures.collect();
                search.captures = captures
                    .into_iter()
                    .collect::<Option<_>>()
                    .unwrap_or_default();
            }
        }
        axes[axis].homing = homing;
    }
    let unused = inputs.iter().zip(&users);
    let unused = unused.filter(|(it, user)| it.meaning == InputMeaning::Home && user.is_none());
    let unused = names::not_meant(unused.map(|(it, _)| it.name.as_str()).collect(), wrong);
    for (input, place) in inputs.iter().zip(places) {
        if unused.contains(&input.name.as_str()) {
            log.report(
                place.clone(),
                format!("input \"{}\": no axis is homed by it", input.name),
                "name it in the `switches` of an [axis.homing], or remove it",
            );
        }
    }
    let by_hand = |axis: &&Axis| axis.homing.is_by_hand() && axis.homing.moved_limit.is_none();
    if policy.get_ref().at_start
        && let Some(axis) = axes.iter().find(by_hand)
    {
        log.report(
            policy.span(),
            format!(
                "homing: `at_start` with axis \"{}\", which an operator homes by hand",
                axis.name()
            ),
            "leave `at_start` out, or give the axis another `kind`",
        );
    }
}

/// Whether the drives of each axis are made for its homing.
pub(super) fn check(log: &mut Log<'_>, machine: &Machine, searches: Vec<Option<OwnSearch>>) {
    let drives = &machine.drives;
    for (axis, search) in machine.axes.iter().zip(searches) {
        match (search, &axis.homing.method) {
            (Some(OwnSearch::HardStop(stop)), _) => stop.check(log, axis, drives, machine.cycle),
            (Some(OwnSearch::Method(own)), HomingMethod::Drive(homing)) => {
                check_method(log, axis, drives, homing.method, own);
            }
            _ => {}
        }
    }
}

/// How an axis can be homed whose drive is not made for the homing that the file asks for.
fn otherwise(axis: &Axis) -> &'static str {
    match (axis.motion, axis.feedback) {
        (Motion::Path, Some(feedback)) if feedback.closes_loop => {
            "leave [axis.homing] out: its encoder tells where it is"
        }
        (Motion::Path, _) => "home it with `kind = \"switch\"` or `kind = \"set_here\"`",
        // No path leads it to a switch.
        (Motion::PointToPoint, None) => "home it with `kind = \"set_here\"`",
        (Motion::PointToPoint, Some(_)) => {
            "leave [axis.homing] out: its encoder tells where it is; or home it with `kind = \"set_here\"`"
        }
    }
}

/// Whether the one drive of an axis homes by itself by that method.
fn check_method(log: &mut Log<'_>, axis: &Axis, drives: &[Drive], method: u8, place: Range<usize>) {
    let name = axis.name();
    let [drive] = axis.drives[..] else {
        let help = "home a gantry with `kind = \"switch\"`, which takes it square, too";
        let problem =
            format!("axis \"{name}\": homing: the sides of a gantry do not home by themselves");
        return log.report(place, problem, help);
    };
    let Drive {
        name: who, model, ..
    } = &drives[drive];
    let methods = model.homing_methods;
    if !methods.contains(&method) {
        let help = match methods {
            [] => otherwise(axis).to_owned(),
            _ => format!("allowed: one of {methods:?}"),
        };
        let problem = format!(
            "axis \"{name}\": homing: drive \"{who}\" ({}) does not home by method {method}",
            model.title
        );
        log.report(place, problem, help);
    }
}

/// The input of that name, if it is a home switch, or the axis' own limit switch on the side of the search.
fn home_input(
    log: &mut Log<'_>,
    axis: &Axis,
    switch: &Spanned<String>,
    (inputs, search): (&[Input], &SwitchSearch),
) -> Option<usize> {
    let (name, limits) = (axis.name(), axis.limits.position);
    let (end, travel) = match search.direction > 0.0 {
        true => (&axis.limit_inputs[1], limits.1),
        false => (&axis.limit_inputs[0], limits.0),
    };
    let title = format!("axis \"{name}\": homing");
    let allowed =
        |place: usize| inputs[place].meaning == InputMeaning::Home || end.contains(&place);
    let found = signals::named(
        log,
        &title,
        ("home switch", "home"),
        switch,
        inputs,
        allowed,
    );
    // The edge is less than a turn in front of the index.
    let turn = match search.by_index {
        true => axis.mm_per_revolution,
        false => 0.0,
    };
    if found.is_some_and(|place| end.contains(&place))
        && (search.position - travel) * search.direction <= turn
    {
        log.report(
            switch.span(),
            format!(
                "{title}: its soft limits go up to {travel}, and its limit switch \"{}\" is on from {} on",
                switch.get_ref(),
                search.position - search.direction * turn
            ),
            "let `soft_limits` end in front of the switch: of its `position`, with `index` a turn of the motor less",
        );
    }
    found
}

/// How a drive captures where a switch comes on, if it sees that switch.
fn capture(switch: &Input, drive: usize, drives: &[Drive]) -> Option<&'static Capture> {
    let model = drives[drive].model;
    let own = switch.node == drive;
    own.then(|| model.capture(switch.signal, !switch.active_low))
        .flatten()
}

/// The index of an axis tells its place where one drive moves it that counts whole turns there.
fn check_index(log: &mut Log<'_>, axis: &Axis, drives: &[Drive], place: Range<usize>) {
    let title = format!("axis \"{}\": homing", axis.name());
    if axis.drives.len() > 1 {
        log.report(
            place,
            format!("{title}: `index` of a gantry"),
            "leave it out: each side has its index elsewhere, which says nothing of how square they are; `latch` the edges",
        );
        return;
    }
    let model = drives[axis.drives[0]].model;
    if !model.abilities.contains(&Ability::CountsWithinTurn) {
        log.report(
            place,
            format!("{title}: `index` of a drive that counts from where it was switched on"),
            format!(
                "leave it out: the count of the {} is another one within a turn each time",
                model.title
            ),
        );
    }
}

/// No capture of the drive sees its switch.
fn refuse_latch(log: &mut Log<'_>, axis: &str, place: Range<usize>, switch: &Input, drive: &Drive) {
    let (name, model) = (&drive.name, drive.model);
    let seen = model
        .captures
        .iter()
        .map(|capture| model.inputs[capture.input]);
    let help = match model.captures {
        [] => format!("leave it out: the {} captures no position", model.title),
        _ => format!(
            "wire the switch to {} of drive \"{name}\", or leave it out",
            one_of(seen)
        ),
    };
    log.report(
        place,
        format!(
            "axis \"{axis}\": homing: no capture of drive \"{name}\" sees switch \"{}\"",
            switch.name
        ),
        help,
    );
}

/// Two axes have one switch: each needs its turn.
fn share(
    log: &mut Log<'_>,
    switch: &Spanned<String>,
    axes: &mut [Axis],
    [other, index]: [usize; 2],
    orders: [u32; 2],
) {
    if let HomingMethod::Switch(search) = &mut axes[other].homing.method {
        search.is_shared = true;
    }
    if other == index || orders[0] == orders[1] {
        log.report(
            switch.span(),
            format!(
                "axis \"{}\": homing: switch \"{}\" is that of axis \"{}\" at the same time",
                axes[index].name(),
                switch.get_ref(),
                axes[other].name()
            ),
            "give the two axes different values of `order`, or each side its own switch",
        );
    }
}
