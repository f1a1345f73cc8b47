//! Random machines, as data: what a shrinking case leaves out, and what becomes a machine file.
//!
//! - `draw`: at random
//! - `axis`, `mechanics`, `homing`: an axis with its drives and encoders, what it moves, and how it is homed
//! - `wires`: what is wired to inputs and outputs

mod axis;
mod draw;
mod homing;
mod mechanics;
mod wires;

pub use axis::{AxisSpec, DeviceSpec, EncoderSpec};
pub use mechanics::{ErrorSpec, TransmissionSpec, WarmthSpec};
pub use wires::{IoSpec, Wire};

use crate::budget::MachineBudget;
use crate::machine::Machine;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::Path;
use syncline_drives::model::{Address, MODELS};
use wires::NUMBER;

/// The object that says who made a device.
const VENDOR: Address = Address::new(0x1018, 1);

/// A machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MachineSpec {
    /// Base cycle, µs.
    pub cycle_us: u32,
    /// T_PDOs missing in a row that are a fault.
    pub t_pdo_misses: u32,
    /// How far a path may leave what is programmed under G61, and under G64, mm.
    pub tolerances: [f64; 2],
    /// Bit rate of each bus, bit/s.
    pub buses: Vec<u32>,
    /// The axes.
    pub axes: Vec<AxisSpec>,
    /// I/O nodes.
    #[serde(default)]
    pub io_nodes: Vec<IoSpec>,
    /// What its setpoints are not to excite.
    #[serde(default)]
    pub shaper: Option<ShaperSpec>,
    /// What it says of models: whole tables.
    #[serde(default)]
    pub models: Vec<String>,
    /// What turns its spindle.
    #[serde(default)]
    pub spindle: Option<SpindleSpec>,
    /// All of its axes are quick-stopped where one is.
    #[serde(default)]
    pub stop_together: bool,
}

/// A drive that turns the spindle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpindleSpec {
    /// Its place among the buses.
    pub bus: usize,
    /// Its node id.
    pub node: u8,
    /// What it is.
    pub model: String,
    /// From rest to the greatest speed, ms.
    pub ramp_ms: u32,
}

/// No program asks for more, 1/min.
pub(super) const FASTEST: u32 = 10_000;

impl SpindleSpec {
    /// Whether its drive tells the spindle's angle.
    pub(super) fn is_measured(&self) -> bool {
        let mut models = MODELS.iter();
        models.any(|model| model.name == self.model && model.moves_axes())
    }

    fn write(&self, text: &mut String) {
        let Self {
            bus,
            node,
            model,
            ramp_ms,
        } = self;
        let _ = write!(
            text,
            "\n[[drive]]\nname = \"spindle\"\nbus = \"bus{bus}\"\nnode = {node}\nmodel = \"{model}\"\n\n\
             [spindle]\ndrive = \"spindle\"\nmax_speed = {FASTEST}\nramp_ms = {ramp_ms}\n"
        );
    }
}

/// A shaper of a machine's setpoints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShaperSpec {
    /// What the machine file calls it.
    pub kind: String,
    /// Natural frequencies, Hz, and damping ratios.
    pub modes: Vec<(f64, f64)>,
    /// What it shapes, if the machine file says so.
    #[serde(default)]
    pub method: Option<String>,
}

impl MachineSpec {
    /// What its outputs are called.
    pub(super) fn outputs(&self) -> Vec<String> {
        let drives = self.axes.iter().flat_map(|axis| {
            let drives = axis.drives.iter().enumerate();
            drives.map(|(side, drive)| (axis.drive_name(side), drive))
        });
        let drives = drives.map(|(name, drive)| (name, &drive.wires));
        let io_nodes = self.io_nodes.iter().enumerate();
        let io_nodes = io_nodes.map(|(place, io)| (IoSpec::name(place), &io.wires));
        let outputs = drives.chain(io_nodes).flat_map(|(name, wires)| {
            let outputs = wires.iter().filter(|wire| wire.table == "output");
            outputs.map(move |wire| format!("{name} {}", wire.signal))
        });
        outputs.collect()
    }

    /// Cycles in so many seconds.
    pub(super) fn cycles(&self, seconds: f64) -> u32 {
        (seconds * 1e6 / f64::from(self.cycle_us)) as u32
    }

    /// The bus and the node id of every device, in the order of the machine.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (usize, u8)> {
        let drives = self.axes.iter().flat_map(|axis| &axis.drives);
        let drives = drives.map(|drive| (drive.bus, drive.node));
        let encoders = self.encoders().map(|encoder| (encoder.bus, encoder.node));
        drives
            .chain(encoders)
            .chain(self.io_nodes.iter().map(|io| (io.bus, io.node)))
    }

    /// The vendor id that a device has to have; 0 where any may.
    pub(super) fn vendor(&self, device: usize) -> u32 {
        let Ok(machine) = self.machine() else {
            return 0;
        };
        let device = machine.device(device);
        let mut identity = device.spec().identity.iter();
        let vendor = identity.find(|it| it.address == VENDOR);
        vendor.map_or(0, |it| it.value)
    }

    /// What watches axes, in the order of the machine.
    pub(super) fn encoders(&self) -> impl Iterator<Item = &EncoderSpec> {
        self.axes.iter().filter_map(|axis| axis.encoder.as_ref())
    }

    /// What is wired, and to which device.
    pub(super) fn wires(&self) -> impl Iterator<Item = (usize, &Wire)> {
        let drives = self.axes.iter().flat_map(|axis| &axis.drives);
        let wires = drives.map(|drive| &drive.wires[..]);
        let wires = wires.chain(self.encoders().map(|_| &[][..]));
        let wires = wires.chain(self.io_nodes.iter().map(|io| &io.wires[..]));
        (wires.enumerate()).flat_map(|(place, wires)| wires.iter().map(move |wire| (place, wire)))
    }

    /// Whether something of that kind is wired to this place of a device.
    pub(super) fn has_wire(&self, device: usize, place: u8, is: impl Fn(&Wire) -> bool) -> bool {
        let mut wires = self.wires();
        wires.any(|(of, wire)| (of, wire.place) == (device, place) && is(wire))
    }

    /// The numbers by which programs know what is wired in a table.
    pub(super) fn numbers(&self, table: &str) -> Vec<u8> {
        let is_digital = |wire: &Wire| match table {
            "input" => wire.is_digital_input(),
            _ => wire.table == table && !wire.signal.starts_with("AO"),
        };
        self.numbers_of(is_digital)
    }

    /// Those of its analog inputs.
    pub(super) fn analog_inputs(&self) -> Vec<u8> {
        self.numbers_of(|wire| wire.table == "input" && !wire.is_digital_input())
    }

    fn numbers_of(&self, is_meant: impl Fn(&Wire) -> bool) -> Vec<u8> {
        let wires = self.wires().filter(|(_, wire)| is_meant(wire));
        let number = |(_, wire): (usize, &Wire)| {
            let number = wire.meaning.strip_prefix(NUMBER)?;
            number.lines().next()?.parse().ok()
        };
        wires.filter_map(number).collect()
    }

    /// How many drives it has.
    #[must_use]
    pub fn drives(&self) -> usize {
        self.axes.iter().map(|axis| axis.drives.len()).sum()
    }

    /// What the machine file says of it.
    ///
    /// # Errors
    /// What is wrong in it, in words.
    pub fn machine(&self) -> Result<Machine, String> {
        Machine::parse(Path::new("machine.toml"), &self.toml()).map_err(|wrong| wrong.to_string())
    }

    /// Whether it is good, and its frames fit its cycle.
    fn fits(&self) -> bool {
        let machine = self.machine();
        machine.is_ok_and(|machine| MachineBudget::of(&machine).check().is_ok())
    }

    /// Becomes another one that is good. Whether that is so is looked into only where anything is different.
    fn take_if_it_fits(&mut self, other: Self) {
        if other != *self && other.fits() {
            *self = other;
        }
    }

    /// The machine file.
    #[must_use]
    pub fn toml(&self) -> String {
        let [exact, blend] = self.tolerances;
        let mut text = format!(
            "[machine]\nname = \"campaign\"\ncycle_us = {}\n\n[controller]\nt_pdo_misses = {}\n\
             stop_together = {}\n\n[path]\nexact_tolerance = {exact}\nblend_tolerance = {blend}\n",
            self.cycle_us, self.t_pdo_misses, self.stop_together,
        );
        for (bus, bitrate) in self.buses.iter().enumerate() {
            let _ = write!(
                text,
                "\n[[bus]]\nname = \"bus{bus}\"\nbitrate = {bitrate}\nport = \"sim\"\n"
            );
        }
        for axis in &self.axes {
            axis.write(&self.models, &mut text);
        }
        for (place, io) in self.io_nodes.iter().enumerate() {
            io.write(place, &mut text);
        }
        if let Some(spindle) = &self.spindle {
            spindle.write(&mut text);
        }
        if let Some(ShaperSpec {
            kind,
            modes,
            method,
        }) = &self.shaper
        {
            let modes = modes
                .iter()
                .map(|(at, damping)| format!("[{at:?}, {damping:?}]"));
            let modes: Vec<_> = modes.collect();
            let modes = modes.join(", ");
            let _ = write!(text, "\n[shaper]\nkind = \"{kind}\"\nmodes = [{modes}]\n");
            if let Some(method) = method {
                let _ = writeln!(text, "method = \"{method}\"");
            }
        }
        for table in &self.models {
            text.push('\n');
            text.push_str(table);
        }
        if self.io_nodes.iter().any(|io| io.words) {
            text.push_str("\n[model.cia401]\ndigital_words = 1\n");
        }
        text
    }
}
