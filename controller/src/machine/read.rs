//! From a machine file's text to a [`Machine`], in two stages, each of which reports all it finds: what is no TOML, each
//! table on its own, names, and how cycle, controller, buses and devices that are good fit together; then how all tables do. The
//! second starts only on what is clean, and of a table of
//! which a line is no TOML the rest is judged as if the line had a wrong value, so that one mistake does not cause
//! complaints about another thing. So a person hears of all mistakes in two rounds at most.

use super::axis::AxisTable;
use super::cross_coupling;
use super::dc_bus::{self, DcBusTable};
use super::described;
use super::encoder::{self, EncoderTable};
use super::files::Files;
use super::fits::{self, Pairing};
use super::homing::{self, HomingTable};
use super::io_node::IoTable;
use super::limit_inputs;
use super::names;
use super::node::{self, NodeTable, node_id};
use super::path_forces;
use super::probing;
use super::retraction::RetractionTable;
use super::shaper::ShaperTable;
use super::signals::{SignalTables, Signals, Wiring};
use super::simulation;
use super::spindle::SpindleTable;
use super::user_code::UserCodeTable;
use super::{
    Bus, Controller, Cut, Drive, HomingPolicy, LONGEST_CYCLE, Machine, Motion, PathForces,
    PathTolerances, Probing, Validation, assumed, spindle, validation,
};
use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
    path::Path,
    time::Duration,
};
use syncline_canopen::BIT_RATES;
use syncline_drives::model::{Assumed, Direction, Increments, MODELS, Model, Scaling};
use syncline_gcode as gcode;
use syncline_strict_toml::{Diagnostic, Log, Rest, Table, nearest, one_of};
use syncline_trajectory::shaper::Shaper;
use toml::{Spanned, de::DeTable};

/// Degrees for one turn of a rotary axis.
pub(crate) const TURN: f64 = 360.0;

pub(super) fn machine(folder: &Path, source: &str) -> Result<Machine, Vec<Diagnostic>> {
    let mut log = Log::new(source);
    let mut files = Files::of(folder);
    let document = syncline_strict_toml::parse(&mut log, source);
    if !log.is_empty() {
        if let Some(rest) = Rest::of(source) {
            let mut of_rest = Log::of_rest(source, &rest);
            let document = syncline_strict_toml::parse(&mut of_rest, rest.text());
            Tables::read(&mut of_rest, &mut files, document.get_ref());
            log.append(of_rest);
        }
        return Err(log.into_diagnostics());
    }
    let machine = Tables::read(&mut log, &mut files, document.get_ref())
        .filter(|_| log.is_empty())
        .and_then(|tables| tables.join(&mut log));
    match machine {
        Some(machine) if log.is_empty() => Ok(Machine {
            values: syncline_strict_toml::values(document.get_ref()),
            files: files.into_all(),
            ..machine
        }),
        _ => Err(log.into_diagnostics()),
    }
}

/// All tables, each good on its own.
struct Tables {
    name: String,
    cycle: Spanned<i64>,
    controller: ControllerTable,
    path: PathTolerances,
    path_mode: gcode::PathMode,
    buses: Vec<BusTable>,
    drives: Vec<DriveTable>,
    encoders: Vec<EncoderTable>,
    io_nodes: Vec<IoTable>,
    axes: Vec<AxisTable>,
    spindle: Option<SpindleTable>,
    homing: Spanned<HomingPolicy>,
    probing: Probing,
    touched: probing::Touched,
    cuts: Vec<Cut>,
    path_forces: Option<PathForces>,
    dc_buses: Vec<DcBusTable>,
    shaper: Option<ShaperTable>,
    retraction: Option<RetractionTable>,
    validation: Validation,
    signals: SignalTables,
    user_codes: Vec<UserCodeTable>,
    assumptions: Vec<(&'static Model, Assumed)>,
}

impl Tables {
    fn read(log: &mut Log<'_>, files: &mut Files, document: &DeTable<'_>) -> Option<Self> {
        if !log.lacks(names::KEYS) {
            names::check(log, document);
        }
        let mut file = Table::new("machine file", 0..0, document);
        let machine = file.table(log, "machine", true);
        let controller = file.table(log, "controller", false);
        let path = file.table(log, "path", false);
        let buses = file.tables(log, "bus");
        let drives = file.tables(log, "drive");
        let encoders = file.tables_if(log, "encoder", "name");
        let io_nodes = file.tables_if(log, "io", "name");
        let axes = file.tables(log, "axis");
        let spindle = file.table(log, "spindle", false);
        let homing = file.table(log, "homing", false);
        let probing = file.table(log, "probing", false);
        let simulation = file.table(log, "simulation", false);
        let shaper = file.table(log, "shaper", false);
        let retraction = file.table(log, "retraction", false);
        let validation = file.table(log, "validation", false);
        let signals = SignalTables::read(log, &mut file);
        let user_codes = file.tables_if(log, "user_code", "code");
        let model = file.table(log, "model", false);
        file.finish(log);

        let machine = machine.and_then(|mut table| {
            let name = name(log, &mut table);
            let cycle = table.integer(
                log,
                "cycle_us",
                1..=LONGEST_CYCLE.as_micros() as i64,
                " (µs)",
            );
            table.finish(log);
            Some((name?.into_inner(), cycle?))
        });
        let empty = DeTable::new();
        let controller = controller.unwrap_or_else(|| Table::new("controller", 0..0, &empty));
        let controller = ControllerTable::read(log, controller);
        let path = path.unwrap_or_else(|| Table::new("path", 0..0, &empty));
        let (path, path_mode) = followed_path(log, path);
        let buses: Vec<_> = buses.into_iter().map(|t| BusTable::read(log, t)).collect();
        let drives: Vec<_> = drives
            .into_iter()
            .map(|t| DriveTable::read(log, files, t))
            .collect();
        let encoders: Vec<_> = encoders
            .into_iter()
            .map(|t| EncoderTable::read(log, files, t))
            .collect();
        let io_nodes: Vec<_> =
            (io_nodes.into_iter().map(|t| IoTable::read(log, files, t))).collect();
        let axes: Vec<_> = axes.into_iter().map(|t| AxisTable::read(log, t)).collect();
        let spindle = spindle.and_then(|table| spindle::read(log, table));
        let homing = homing.unwrap_or_else(|| Table::new("homing", 0..0, &empty));
        let homing = homing::policy(log, homing);
        let probing = probing.map(|table| probing::read(log, table));
        let mut cuts = Vec::new();
        let mut path_forces = None;
        let mut dc_buses = Vec::new();
        let touched = simulation.and_then(|mut table| {
            path_forces = path_forces::read(log, files, &mut table);
            dc_buses = dc_bus::read(log, &mut table);
            probing::simulated(log, table, &mut cuts)
        });
        let shaper = shaper.and_then(|table| ShaperTable::read(log, table));
        let retraction = retraction.and_then(|table| RetractionTable::read(log, table));
        let validation = validation.map(|table| validation::read(log, table));
        let user_codes = user_codes.into_iter();
        let user_codes: Vec<_> = user_codes.map(|t| UserCodeTable::read(log, t)).collect();
        let assumptions = model.map_or(Vec::new(), |table| assumptions(log, table));
        let has_all_buses = buses.iter().all(Option::is_some);
        let buses: Vec<BusTable> = buses.into_iter().flatten().collect();
        if (log.is_of_rest() || !log.is_empty())
            && let (Some((_, cycle)), Some(controller)) = (&machine, &controller)
        {
            let drives = drives.iter().flatten().map(|it| &it.node);
            let encoders = encoders.iter().flatten().map(|it| &it.node);
            let io_nodes = io_nodes.iter().flatten().map(|it| &it.node);
            let devices: Vec<_> = drives.chain(encoders).chain(io_nodes).collect();
            check_sound(log, cycle, controller, &devices, &buses);
        }
        let (name, cycle) = machine?;
        Some(Self {
            name,
            cycle,
            controller: controller?,
            path,
            path_mode,
            buses: has_all_buses.then_some(buses)?,
            drives: drives.into_iter().collect::<Option<_>>()?,
            encoders: encoders.into_iter().collect::<Option<_>>()?,
            io_nodes: io_nodes.into_iter().collect::<Option<_>>()?,
            axes: axes.into_iter().collect::<Option<_>>()?,
            spindle,
            homing,
            probing: probing.unwrap_or_default(),
            touched: touched.unwrap_or_default(),
            cuts,
            path_forces,
            dc_buses,
            shaper,
            retraction,
            validation: validation.unwrap_or_default(),
            signals: signals?,
            user_codes: user_codes.into_iter().collect::<Option<_>>()?,
            assumptions,
        })
    }

    /// Checks what concerns several tables, and resolves names.
    fn join(mut self, log: &mut Log<'_>) -> Option<Machine> {
        let cycle = Duration::from_micros(*self.cycle.get_ref() as u64);
        let controller = self.controller.join(log, cycle);

        let shaper = self.shaper.as_ref().map(|table| table.join(log, cycle));

        let turning = self.take_spindle_drive(log);
        let drives = self.drives.iter().map(|drive| &drive.node);
        let encoders = self.encoders.iter().map(|encoder| &encoder.node);
        let io_nodes = self.io_nodes.iter().map(|io| &io.node);
        let devices = drives.chain(encoders).chain(io_nodes);
        let devices: Vec<_> = devices.chain(turning.iter().map(|it| &it.node)).collect();
        let described = described::models(log, &devices);
        let bus_of = node::places(log, &devices, &self.buses, &self.cycle, controller.node);

        self.assumptions.extend(described);
        let axis_of = self.assign(log);
        let feedbacks = self.axes.iter();
        let feedbacks = feedbacks.map(|axis| (axis.title(), axis.feedback.as_ref()));
        let seen = encoder::assign(log, &self.encoders, feedbacks);
        let bus_of: Option<Vec<usize>> = bus_of.into_iter().collect();
        let axis_of: Option<Vec<usize>> = axis_of.into_iter().collect();
        let mut bus_of = bus_of?;
        let turning = turning.and_then(|drive| Some((drive, bus_of.pop()?)));
        let io_buses = bus_of.split_off(bus_of.len() - self.io_nodes.len());
        let encoder_buses = bus_of.split_off(self.drives.len());
        let places = bus_of.into_iter().zip(axis_of?);
        let named: Vec<_> = (self.drives.iter().map(|it| it.node.name.span())).collect();
        let dividers: Vec<_> = (self.drives.iter().map(|it| it.sync_divider.clone())).collect();
        let drives: Vec<_> = self
            .drives
            .into_iter()
            .zip(places)
            .map(|(drive, (bus, axis))| {
                let assumed = assumed(&self.assumptions, drive.node.model);
                drive.join(log, bus, axis, &self.axes[axis], &assumed)
            })
            .collect();
        let stated: Vec<_> = self.encoders.iter().map(|it| it.node.name.span()).collect();
        let encoders = self
            .encoders
            .into_iter()
            .zip(encoder_buses.into_iter().zip(seen));
        let encoders: Vec<_> = encoders
            .map(|(encoder, (bus, axis))| {
                let assumed = assumed(&self.assumptions, encoder.node.model);
                encoder.join(bus, axis, &assumed)
            })
            .collect();
        let io_nodes = self.io_nodes.into_iter().zip(io_buses);
        let io_nodes: Vec<_> = io_nodes.map(|(io, bus)| io.join(bus)).collect();
        let motions: Vec<_> = self.axes.iter().map(|axis| axis.motion.clone()).collect();
        let coupled: Vec<_> = self.axes.iter().map(|it| it.coupled.clone()).collect();
        let compensated: Vec<_> = (self.axes.iter())
            .map(|it| it.compensated.clone())
            .collect();
        let losses: Vec<_> = (self.axes.iter().map(|it| it.position_loss.clone())).collect();
        let (mut axes, rest): (Vec<_>, Vec<_>) = self
            .axes
            .into_iter()
            .map(|axis| {
                let index = |name: &Spanned<String>| {
                    drives
                        .iter()
                        .position(|drive| drive.name == *name.get_ref())
                };
                let own = axis.drives.get_ref().iter().filter_map(index);
                let own: Vec<usize> = own.collect();
                let encoder = axis.feedback.as_ref().and_then(|it| it.find(&encoders));
                if let Some(feedback) = &axis.feedback {
                    let models = own.iter().map(|&drive| drives[drive].model);
                    let homes = axis.homing.as_ref().is_some_and(HomingTable::searches);
                    feedback.check_loop(log, &axis.title(), models, homes);
                }
                axis.join(own, encoder)
            })
            .unzip();
        let shaped_by = shaper.as_ref().map_or(0.0, Shaper::mean);
        for (axis, motion) in axes.iter_mut().zip(&motions) {
            let by_itself = matches!(motion, Some((Motion::PointToPoint, _)));
            axis.shaped_by = if by_itself { 0.0 } else { shaped_by };
        }
        for axis in &axes {
            simulation::check(log, axis, &axes);
        }
        let dc_buses = dc_bus::join(log, &self.dc_buses, &drives, &axes);
        let retraction = self.retraction.as_ref();
        let retraction = retraction.and_then(|table| table.join(log, &axes));
        let places = self.signals.inputs();
        let wiring = Wiring {
            drives: &drives,
            encoders: encoders.len(),
            io_nodes: &io_nodes,
        };
        let turned = turning.as_ref().map(|(table, _)| table.node.name.span());
        let spindle = (self.spindle)
            .map(|table| table.join(log, turning, |model| assumed(&self.assumptions, model)));
        let signals = self.signals.join(log, wiring, spindle.as_ref());
        let Signals {
            inputs,
            analog_inputs,
            outputs,
            analog_outputs,
        } = signals;
        let wired = (&inputs[..], &places[..]);
        let (homings, limit_switches): (Vec<_>, Vec<_>) = rest.into_iter().unzip();
        let mut homings: Vec<Option<HomingTable>> = homings;
        let searches = homings.iter_mut().map(|it| it.as_mut()?.take_search());
        let searches: Vec<_> = searches.collect();
        let test_moves: Vec<_> = (homings.iter())
            .map(|table| table.as_ref().and_then(HomingTable::test_move))
            .collect();
        limit_inputs::join(log, &mut axes, &limit_switches, wired);
        let joined = (&mut axes[..], &drives[..]);
        homing::join(log, joined, homings, wired, &self.homing);
        let mut machine = Machine {
            name: self.name,
            cycle,
            controller,
            path: self.path,
            path_mode: self.path_mode,
            buses: self.buses.into_iter().map(BusTable::join).collect(),
            drives,
            encoders,
            io_nodes,
            axes,
            spindle,
            homing: self.homing.into_inner(),
            probing: self.probing,
            touched: self.touched,
            cuts: self.cuts,
            path_forces: self.path_forces,
            dc_buses,
            shaper: shaper.unwrap_or_else(Shaper::none),
            shaper_method: self.shaper.and_then(|table| table.method),
            retraction,
            validation: self.validation,
            inputs,
            analog_inputs,
            outputs,
            analog_outputs,
            user_codes: UserCodeTable::join(log, self.user_codes),
            values: Vec::new(),
            files: Vec::new(),
            assumptions: self.assumptions,
        };
        fits::settle_motions(log, &mut machine, &motions, &named);
        fits::check_compensation(log, &machine, &compensated);
        cross_coupling::settle(log, &mut machine, &coupled);
        homing::check(log, &machine, searches);
        fits::check_pairs(log, &machine, &named);
        limit_inputs::check(log, &machine, &limit_switches);
        encoder::check(log, &machine, &stated);
        fits::check_ramps(log, &machine, &named);
        fits::check_velocities(log, &machine, &named);
        fits::check_feed_forward(log, &machine, &named);
        fits::check_loops(log, &machine, &named);
        fits::check_spindle(log, &machine, turned);
        fits::check_guarding(log, &machine, &named);
        homing::test_move::check(log, &machine, &test_moves);
        fits::check_losses(log, &machine, &losses);
        fits::check_counts(log, &machine, &named);
        fits::check_setpoints(log, &machine, &named);
        fits::check_dividers(log, &machine, &dividers);
        Some(machine)
    }

    /// Takes the drive of the spindle out of those of axes.
    fn take_spindle_drive(&mut self, log: &mut Log<'_>) -> Option<DriveTable> {
        (self.spindle.as_ref()).and_then(|it| it.take_drive(log, &mut self.drives))
    }

    /// The axis of each drive, which names have told to be exactly one.
    fn assign(&self, log: &mut Log<'_>) -> Vec<Option<usize>> {
        let mut axis_of = vec![None; self.drives.len()];
        for (index, axis) in self.axes.iter().enumerate() {
            for name in axis.drives.get_ref() {
                let mut drives = self.drives.iter();
                let of = drives.position(|drive| drive.node.name.get_ref() == name.get_ref());
                let Some(drive) = of else {
                    continue;
                };
                let DriveTable { node, .. } = &self.drives[drive];
                if !node.model.moves_axes() {
                    log.report(
                        name.span(),
                        format!(
                            "{}: drive \"{}\" ({}) tells no position",
                            axis.title(),
                            name.get_ref(),
                            node.model.title
                        ),
                        "allowed: a drive that does; this one can turn a spindle",
                    );
                }
                axis_of[drive] = Some(index);
            }
        }
        axis_of
    }
}

/// Checks how those tables fit together that are good, where others are not: what they say of each other is true whatever is
/// mended in the others.
fn check_sound(
    log: &mut Log<'_>,
    cycle: &Spanned<i64>,
    controller: &ControllerTable,
    devices: &[&NodeTable],
    buses: &[BusTable],
) {
    let time = Duration::from_micros(*cycle.get_ref() as u64);
    let controller = controller.join(log, time);
    let mut names = BTreeSet::new();
    // Which bus is meant is not known where two have one name.
    if buses.iter().all(|bus| names.insert(bus.name.get_ref())) {
        node::places(log, devices, buses, cycle, controller.node);
    }
}

struct ControllerTable {
    controller: Controller,
    setpoint_offset: Option<Spanned<i64>>,
    heartbeat_timeout: Range<usize>,
}

impl ControllerTable {
    fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let node = table.integer_or(log, "node", 127, 1..=127, "");
        let heartbeat = table.millis_or(log, "heartbeat_ms", 100, 65_534);
        let heartbeat_timeout = table.millis_or(log, "heartbeat_timeout_ms", 300, 65_535);
        let sdo_timeout = table.millis_or(log, "sdo_timeout_ms", 200, 60_000);
        let sdo_retries = table.integer_or(log, "sdo_retries", 2, 0..=100, "");
        let boot_timeout = table.millis_or(log, "boot_timeout_ms", 5_000, 600_000);
        let sync_lock_timeout = table.millis_or(log, "sync_lock_timeout_ms", 5_000, 600_000);
        let state_timeout = table.millis_or(log, "state_timeout_ms", 2_000, 600_000);
        let t_pdo_misses = table.integer_or(log, "t_pdo_misses", 2, 1..=5, "");
        let stop_together = table.flag_or(log, "stop_together", false);
        let flight_recorder = table.integer_or(log, "flight_recorder_s", 10, 0..=60, " (s)");
        let setpoint_offset = table.integer_if(log, "setpoint_offset_us", 1..=1_000_000, " (µs)");
        let span = table
            .span_of("heartbeat_timeout_ms")
            .or(table.span_of("heartbeat_ms"));
        table.finish(log);
        Some(Self {
            controller: Controller {
                node: node_id(node)?,
                heartbeat,
                heartbeat_timeout,
                sdo_timeout,
                sdo_retries: sdo_retries as u32,
                boot_timeout,
                sync_lock_timeout,
                state_timeout,
                t_pdo_misses: t_pdo_misses as u32,
                stop_together,
                setpoint_offset: None,
                flight_recorder: Duration::from_secs(flight_recorder as u64),
            },
            setpoint_offset,
            heartbeat_timeout: span.unwrap_or(0..0),
        })
    }

    fn join(&self, log: &mut Log<'_>, cycle: Duration) -> Controller {
        let mut controller = self.controller.clone();
        // The controller's own leaves with a cycle.
        let cycles = controller.heartbeat.as_nanos().div_ceil(cycle.as_nanos()) as u32;
        if controller.heartbeat_timeout <= cycle * (cycles + 1) {
            log.report(
                self.heartbeat_timeout.clone(),
                format!(
                    "controller: `heartbeat_timeout_ms` is {} with `heartbeat_ms` at {}",
                    controller.heartbeat_timeout.as_millis(),
                    controller.heartbeat.as_millis()
                ),
                "allowed: a time-out clearly longer than the heartbeat and a cycle, two to three \
                 of it",
            );
        }
        if let Some(offset) = &self.setpoint_offset {
            let time = Duration::from_micros(*offset.get_ref() as u64);
            if time >= cycle {
                log.report(
                    offset.span(),
                    format!("controller: `setpoint_offset_us` is {}", offset.get_ref()),
                    format!("allowed: less than the cycle of {} µs", cycle.as_micros()),
                );
            }
            controller.setpoint_offset = Some(time);
        }
        controller
    }
}

/// `[path]`: how programmed paths are followed, and how closely.
fn followed_path(log: &mut Log<'_>, mut table: Table<'_, '_>) -> (PathTolerances, gcode::PathMode) {
    let exact = table.positive_or(log, "exact_tolerance", 0.001, "(mm)");
    let blend = table.positive_or(log, "blend_tolerance", 0.01, "(mm)");
    let mode = table.choice_or(log, "mode", "G61", ["G61", "G61.1", "G64"].into_iter());
    table.finish(log);
    let mode = match mode.as_str() {
        "G61.1" => gcode::PathMode::ExactStop,
        "G64" => gcode::PathMode::Blend {
            tolerance: None,
            merge: None,
        },
        _ => gcode::PathMode::ExactPath,
    };
    (PathTolerances { exact, blend }, mode)
}

pub(super) struct BusTable {
    pub(super) name: Spanned<String>,
    pub(super) bitrate: Spanned<i64>,
    port: String,
}

impl BusTable {
    fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let name = name(log, &mut table);
        let rates: Vec<String> = BIT_RATES.iter().map(u32::to_string).collect();
        let allowed = format!("{} (bit/s)", rates.join(", "));
        let bitrate = table.number(log, "bitrate", &allowed, |rate| {
            BIT_RATES.iter().any(|allowed| f64::from(*allowed) == rate)
        });
        let allowed = "\"sim\" for simulated drives, or the name of a CAN interface, \"can0\"";
        let port = table.text_or(log, "port", "sim", allowed, |text| !text.trim().is_empty());
        table.finish(log);
        let bitrate = bitrate?;
        Some(Self {
            name: name?,
            bitrate: Spanned::new(bitrate.span(), *bitrate.get_ref() as i64),
            port,
        })
    }

    fn join(self) -> Bus {
        Bus {
            name: self.name.into_inner(),
            bitrate: *self.bitrate.get_ref() as u32,
            port: self.port,
        }
    }
}

pub(super) struct DriveTable {
    pub(super) node: NodeTable,
    pub(super) direction: Direction,
    pub(super) zero: Increments,
    signals: bool,
    /// And where it stands.
    pub(super) sync_divider: (u8, Range<usize>),
}

impl DriveTable {
    fn read(log: &mut Log<'_>, files: &mut Files, mut table: Table<'_, '_>) -> Option<Self> {
        let node = NodeTable::read(log, files, &mut table, "drive", Model::is_drive);
        let direction = direction(log, &mut table);
        let (least, most) = (i64::from(i32::MIN), i64::from(i32::MAX));
        let zero = table.integer_or(log, "zero", 0, least..=most, " (increments)");
        let signals = table.flag_or(log, "signals", false);
        let divider = table.integer_or(log, "sync_divider", 1, 1..=240, " (SYNCs)");
        let divider = (
            divider as u8,
            table.span_of("sync_divider").unwrap_or_default(),
        );
        let model = node.as_ref().map(|node| node.model);
        if let Some(model) = model.filter(|model| signals && model.signal(0).is_none()) {
            log.report(
                table.span_of("signals").unwrap_or_default(),
                format!("{}: the {} tells no signals", table.title, model.title),
                "leave the key out",
            );
        }
        table.finish(log);
        Some(Self {
            node: node?,
            direction,
            zero: Increments::new(zero),
            signals,
            sync_divider: divider,
        })
    }

    fn join(
        self,
        log: &mut Log<'_>,
        bus: usize,
        axis: usize,
        table: &AxisTable,
        assumed: &Assumed,
    ) -> Drive {
        let increments_per_revolution = (self.node.model.increments_per_revolution)(assumed);
        let scaling = Scaling::new(
            increments_per_revolution,
            table.mm_per_revolution(),
            self.direction,
            self.zero,
        );
        let pairing = Pairing {
            drive: self.node.title(),
            model: self.node.model,
            scaling: &scaling,
            zero: self.zero,
            increments: increments_per_revolution,
            travel: table.mm_per_revolution(),
            axis: table.title(),
            name: table.name.span(),
            unit: table.letter.units()[0],
            limits: &table.limits,
            soft_limits: table.soft_limits.clone(),
            asked: &table.asked,
        };
        pairing.check(log);
        Drive {
            name: self.node.name.into_inner(),
            bus,
            node: self.node.node.into_inner(),
            model: self.node.model,
            axis,
            scaling,
            signals: self.signals,
            sync_divider: self.sync_divider.0,
            torque: false,
            objects: self.node.objects,
        }
    }
}

/// Which way an encoder counts.
pub(super) fn direction(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Direction {
    let directions = ["positive", "negative"].into_iter();
    match &*table.choice_or(log, "direction", "positive", directions) {
        "negative" => Direction::Negative,
        _ => Direction::Positive,
    }
}

/// `[model.<name>]`: what a model's manual leaves open, as this machine's drives have it.
fn assumptions(log: &mut Log<'_>, mut tables: Table<'_, '_>) -> Vec<(&'static Model, Assumed)> {
    let mut stated = Vec::new();
    for &model in MODELS {
        let Some(mut table) = tables.table(log, model.name, false) else {
            continue;
        };
        let assumed = assumed_of(log, &mut table, model);
        table.finish(log);
        stated.push((model, assumed));
    }
    tables.finish(log);
    stated
}

/// What a table says of a model's assumptions.
pub(super) fn assumed_of(log: &mut Log<'_>, table: &mut Table<'_, '_>, model: &Model) -> Assumed {
    let mut values = Vec::new();
    for assumption in model.assumptions.iter().copied().flatten() {
        let (least, most) = assumption.allowed.clone().into_inner();
        let range = i64::from(least)..=i64::from(most);
        if let Some(choices) = model.choices(assumption.name) {
            let allowed: Vec<_> = choices.iter().map(u32::to_string).collect();
            let is_one = |number: f64| choices.iter().any(|it| f64::from(*it) == number);
            let value = table.number_if(log, assumption.name, &allowed.join(", "), is_one);
            values.extend(value.map(|value| (assumption.name, *value.get_ref() as u32)));
        } else if let Some(value) = table.integer_if(log, assumption.name, range, "") {
            values.push((assumption.name, *value.get_ref() as u32));
        }
    }
    Assumed(values)
}

pub(super) fn name(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Option<Spanned<String>> {
    table.text(log, "name", "a text that is not empty", |text| {
        !text.trim().is_empty()
    })
}

/// Reports every name that an earlier table of the kind has already.
pub(super) fn unique<'t>(
    log: &mut Log<'_>,
    kind: &str,
    names: impl Iterator<Item = &'t Spanned<String>>,
) {
    let mut seen = BTreeMap::new();
    for name in names {
        if seen.insert(name.get_ref(), ()).is_some() {
            log.report(
                name.span(),
                format!("{kind} \"{}\": `name` is taken", name.get_ref()),
                format!("allowed: a name that no other [[{kind}]] has"),
            );
        }
    }
}

/// Reports a name that refers to nothing.
pub(super) fn unknown<'n>(
    log: &mut Log<'_>,
    title: &str,
    kind: &str,
    name: &Spanned<String>,
    names: impl Iterator<Item = &'n str> + Clone,
) {
    let nearest = nearest(name.get_ref(), names.clone()).unwrap_or_default();
    log.report(
        name.span(),
        format!("{title}: there is no {kind} \"{}\"", name.get_ref()),
        format!("allowed: {}; nearest: \"{nearest}\"", one_of(names)),
    );
}
