//! `syncline eds`: a node's electronic data sheet.

use super::calendar::Utc;
use super::tool::NodeOfTwin;
use super::{Exit, bad_input};
use crate::machine::{Machine, Node};
use std::error::Error;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use syncline_canopen::dictionary::Entry;
use syncline_canopen::eds::{Difference, Eds};
use syncline_drives::model::Model;
use syncline_drives::twin::Kind;
use syncline_strict_toml::input;

/// Write a node's electronic data sheet (EDS), or compare one with what is built in.
///
/// Prints the data sheet of the drive with that node id, or of a --node, to standard output, for
/// other CANopen tools. With --compare the file's objects, types, access, PDO mappability, limits
/// and defaults are held against the built-in table instead; what one side leaves open is no
/// difference. Exit code 0: written, or no difference; 1: differences, one a line; 2: bad input.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file
    #[arg(required_unless_present = "of", requires = "node")]
    machine: Option<PathBuf>,
    /// Node id of the drive
    #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// A device without a machine file, such as 1:lxm32m or 5:twk_crn
    #[arg(
        long = "node",
        id = "of",
        value_name = "ID:DEVICE",
        conflicts_with = "machine"
    )]
    of: Option<NodeOfTwin>,
    /// The drive's bus, if several buses have a drive with that node id
    #[arg(long, requires = "machine")]
    bus: Option<String>,
    /// An EDS file to compare instead
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,
}

impl Args {
    /// Prints the data sheet or the differences.
    pub(super) fn execute(&self) -> Exit {
        let device = match self.device() {
            Ok(device) => device,
            Err(error) => return bad_input(&*error),
        };
        let Some(file) = &self.compare else {
            return write(&data_sheet(&device));
        };
        match differences(&device, file) {
            Ok(differences) if differences.is_empty() => Exit::Finished,
            Ok(differences) => {
                for difference in &differences {
                    println!("{difference}");
                }
                Exit::Stopped
            }
            Err(error) => bad_input(&*error),
        }
    }

    /// What the node is.
    fn device(&self) -> Result<Device, Box<dyn Error>> {
        let (Some(file), Some(node)) = (&self.machine, self.node) else {
            let of = self
                .of
                .ok_or("give a machine file and a node id, or --node")?;
            return Ok(of.twin.into());
        };
        let machine = Machine::load(file)?;
        let node = self.node_of(&machine, node);
        let node = node.map_err(|message| format!("{}: {message}", file.display()))?;
        Ok(node.model.into())
    }

    fn node_of<'a>(&self, machine: &'a Machine, id: u8) -> Result<Node<'a>, String> {
        if let Some(wanted) = &self.bus
            && machine.buses.iter().all(|bus| bus.name != *wanted)
        {
            let known: Vec<&str> = machine.buses.iter().map(|bus| &*bus.name).collect();
            return Err(format!("no bus `{wanted}`, only {}", known.join(", ")));
        }
        let on_bus = |node: &Node<'_>| {
            let bus = &machine.buses[node.bus].name;
            self.bus.as_ref().is_none_or(|wanted| wanted == bus)
        };
        let of_id = |node: &Node<'_>| node.id.get() == id;
        let mut nodes = machine.nodes().filter(on_bus).filter(of_id);
        match (nodes.next(), nodes.next()) {
            (Some(node), None) => Ok(node),
            (Some(_), Some(_)) => Err(format!(
                "several buses have a node {id}: say which by --bus"
            )),
            (None, _) => {
                let known = machine.nodes().filter(on_bus);
                let known: Vec<String> = known
                    .map(|node| format!("{} ({})", node.id, node.name))
                    .collect();
                Err(format!(
                    "no drive with node id {id}, only {}",
                    known.join(", ")
                ))
            }
        }
    }
}

/// What a data sheet says of a device.
struct Device {
    name: &'static str,
    title: &'static str,
    maker: Option<&'static str>,
    bitrates: &'static [u32],
    dictionary: &'static [Entry],
}

impl From<&'static Model> for Device {
    fn from(model: &'static Model) -> Self {
        Self {
            name: model.name,
            title: model.title,
            maker: model.maker,
            bitrates: model.bitrates,
            dictionary: model.dictionary,
        }
    }
}

impl From<&'static Kind> for Device {
    fn from(twin: &'static Kind) -> Self {
        Self {
            name: twin.name,
            title: twin.title,
            maker: Model::by_name(twin.name).and_then(|model| model.maker),
            bitrates: twin.bitrates,
            dictionary: twin.dictionary,
        }
    }
}

fn data_sheet(device: &Device) -> Eds {
    let mut eds = Eds::of(device.dictionary);
    let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    let (date, time) = Utc::of(SystemTime::now()).cia_306();
    let author = concat!("syncline ", env!("CARGO_PKG_VERSION"));
    eds.file = vec![
        pair("FileName", &format!("{}.eds", device.name)),
        pair("FileVersion", "1"),
        pair("FileRevision", "0"),
        pair("EDSVersion", "4.0"),
        pair(
            "Description",
            &format!("{} as Syncline knows it", device.title),
        ),
        pair("CreationTime", &time),
        pair("CreationDate", &date),
        pair("CreatedBy", author),
        pair("ModificationTime", &time),
        pair("ModificationDate", &date),
        pair("ModifiedBy", author),
    ];
    let vendor = device.maker.map(|maker| pair("VendorName", maker));
    eds.device.splice(0..0, vendor);
    let place = eds
        .device
        .iter()
        .position(|(key, _)| key == "ProductNumber");
    let place = place.unwrap_or(eds.device.len());
    eds.device.insert(place, pair("ProductName", device.title));
    for rate in [10, 20, 50, 125, 250, 500, 800, 1000] {
        let takes = device.bitrates.contains(&(rate * 1000));
        let key = format!("BaudRate_{rate}");
        eds.device.push(pair(&key, if takes { "1" } else { "0" }));
    }
    eds
}

/// Prints the file as it is, with the ends of lines that CiA 306 wants.
fn write(eds: &Eds) -> Exit {
    let mut stdout = io::stdout();
    let written = stdout.write_all(eds.to_string().as_bytes());
    match written.and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            eprintln!("error: cannot write standard output: {error}");
            Exit::Stopped
        }
        _ => Exit::Finished,
    }
}

fn differences(device: &Device, file: &Path) -> Result<Vec<Difference>, Box<dyn Error>> {
    let bytes = input::read(file);
    let bytes = bytes.map_err(|error| format!("cannot read {}: {error}", file.display()))?;
    // Data sheets of older tools are in some 8-bit code; names do not matter here.
    let theirs = Eds::parse(&String::from_utf8_lossy(&bytes));
    let theirs = theirs.map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(data_sheet(device).compare(&theirs))
}
