//! `syncline eds`: a node's electronic data sheet.

use super::{Exit, report};
use crate::machine::{Drive, Machine};
use std::path::{Path, PathBuf};
use syncline_canopen::NodeId;
use syncline_canopen::eds::Eds;

/// Write a node's electronic data sheet (EDS), or compare one with what is built in.
///
/// Prints the data sheet of the drive with that node id to standard output, for other CANopen
/// tools. With --compare the file's objects, types, access, PDO mappability, limits and defaults
/// are held against the built-in table instead; what one side leaves open is no difference.
/// Exit code 0: written, or no difference; 1: differences, one a line; 2: bad input.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file
    machine: PathBuf,
    /// Node id of the drive
    #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
    node: u8,
    /// The drive's bus, if several buses have a drive with that node id
    #[arg(long)]
    bus: Option<String>,
    /// An EDS file to compare instead
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,
}

impl Args {
    /// Prints the data sheet or the differences.
    pub(super) fn execute(&self) -> Exit {
        let machine = match Machine::load(&self.machine) {
            Ok(machine) => machine,
            Err(error) => {
                report(&error);
                return Exit::BadInput;
            }
        };
        let drive = match self.drive(&machine) {
            Ok(drive) => drive,
            Err(message) => {
                eprintln!("error: {}: {message}", self.machine.display());
                return Exit::BadInput;
            }
        };
        match &self.compare {
            None => {
                print!("{}", data_sheet(drive));
                Exit::Finished
            }
            Some(file) => compare(drive, file),
        }
    }

    fn drive<'a>(&self, machine: &'a Machine) -> Result<&'a Drive, String> {
        if let Some(wanted) = &self.bus
            && machine.buses.iter().all(|bus| bus.name != *wanted)
        {
            let known: Vec<&str> = machine.buses.iter().map(|bus| &*bus.name).collect();
            return Err(format!("no bus `{wanted}`, only {}", known.join(", ")));
        }
        let on_bus = |drive: &&Drive| {
            let bus = &machine.buses[drive.bus].name;
            self.bus.as_ref().is_none_or(|wanted| wanted == bus)
        };
        let of_node = |drive: &&Drive| NodeId::new(self.node) == Some(drive.node);
        let mut drives = machine.drives.iter().filter(on_bus).filter(of_node);
        match (drives.next(), drives.next()) {
            (Some(drive), None) => Ok(drive),
            (Some(_), Some(_)) => Err(format!(
                "several buses have a node {}: say which by --bus",
                self.node
            )),
            (None, _) => {
                let known = machine.drives.iter().filter(on_bus);
                let known: Vec<String> = known
                    .map(|drive| format!("{} ({})", drive.node, drive.name))
                    .collect();
                Err(format!(
                    "no drive with node id {}, only {}",
                    self.node,
                    known.join(", ")
                ))
            }
        }
    }
}

fn data_sheet(drive: &Drive) -> Eds {
    let model = drive.model;
    let mut eds = Eds::of(model.dictionary);
    let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    eds.file = vec![
        pair("FileName", &format!("{}.eds", model.name)),
        pair("FileVersion", "1"),
        pair("FileRevision", "0"),
        pair("EDSVersion", "4.0"),
        pair(
            "Description",
            &format!("{} as Syncline knows it", model.title),
        ),
        pair("CreatedBy", concat!("syncline ", env!("CARGO_PKG_VERSION"))),
    ];
    eds.device.insert(0, pair("ProductName", model.title));
    for rate in [10, 20, 50, 125, 250, 500, 800, 1000] {
        let takes = model.bitrates.contains(&(rate * 1000));
        let key = format!("BaudRate_{rate}");
        eds.device.push(pair(&key, if takes { "1" } else { "0" }));
    }
    eds
}

fn compare(drive: &Drive, file: &Path) -> Exit {
    let bytes = match std::fs::read(file) {
        Ok(bytes) => bytes,
        Err(error) => {
            eprintln!("error: cannot read {}: {error}", file.display());
            return Exit::BadInput;
        }
    };
    // Data sheets of older tools are in some 8-bit code; names do not matter here.
    let theirs = match Eds::parse(&String::from_utf8_lossy(&bytes)) {
        Ok(theirs) => theirs,
        Err(error) => {
            eprintln!("error: {}: {error}", file.display());
            return Exit::BadInput;
        }
    };
    let differences = data_sheet(drive).compare(&theirs);
    for difference in &differences {
        println!("{difference}");
    }
    if differences.is_empty() {
        Exit::Finished
    } else {
        Exit::Stopped
    }
}
