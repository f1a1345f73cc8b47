//! `syncline sdo`: reads and writes a node's objects.

use super::scan::recognise;
use super::tool::{BusChoice, CAPACITY, Known, Session, milliseconds, node_id};
use super::{Exit, bad_input, report};
use clap::Subcommand;
use std::error::Error;
use std::time::Duration;
use syncline_canopen::dictionary::{DataType, Entry};
use syncline_canopen::sdo::Client;
use syncline_canopen::{Address, NodeId, monitor};

/// Read or write an object of a node.
///
/// An object is INDEX or INDEX:SUB in hexadecimal (`6041`, `60C1:1`, `3006:3D`), or its name
/// (`_DCOMstatus`). Name and type come from the node's dictionary: of the model that --node or
/// --machine says, or that the node's device type and vendor tell. Exit code 1 if the node
/// refuses or does not answer.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    bus: BusChoice,
    #[command(flatten)]
    known: Known,
    /// Milliseconds to wait for an answer.
    #[arg(long, value_name = "MS", default_value_t = 500, value_parser = milliseconds())]
    timeout: u64,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print an object's value.
    Read(Target),
    /// Set an object's value.
    Write {
        #[command(flatten)]
        target: Target,
        /// A number (decimal, 0x… or …h), or the text of a string.
        #[arg(allow_hyphen_values = true)]
        value: String,
    },
}

#[derive(Debug, clap::Args)]
struct Target {
    /// Node id.
    #[arg(value_parser = node_id)]
    node: NodeId,
    /// INDEX[:SUB] in hexadecimal, or a name.
    object: String,
    /// Its type, where the node's dictionary is not known: `i8` to `u64`, `text`.
    #[arg(long = "type", value_parser = data_type)]
    data_type: Option<DataType>,
}

impl Args {
    /// Reads or writes.
    pub(super) fn execute(&self) -> Exit {
        let models = match self.known.models() {
            Ok(models) => models,
            Err(error) => return bad_input(&*error),
        };
        let mut session = match self.bus.open() {
            Ok(session) => session,
            Err(error) => return bad_input(&error),
        };
        let (Command::Read(target) | Command::Write { target, .. }) = &self.command;
        let timeout = Duration::from_millis(self.timeout);
        let mut client = Client::new(target.node, timeout, CAPACITY);
        let model = models.get(&target.node.get()).copied();
        let table = match model {
            Some(model) => model.dictionary,
            None => ask_who(&mut session, &mut client),
        };
        let (address, entry) = match target.find(table) {
            Ok(found) => found,
            Err(error) => return bad_input(&*error),
        };
        let known = target.data_type.or(entry.map(|entry| entry.data_type));
        let result = match &self.command {
            Command::Read(_) => session.read(&mut client, address).map(|data| {
                let name = entry.map_or(String::new(), |entry| format!(" {}", entry.name));
                let unit = entry.map_or("", |entry| entry.unit);
                let line = format!("{address}{name} = {} {unit}", shown(address, known, &data));
                println!("{}", line.trim_end());
            }),
            Command::Write { value, .. } => match encoded(value, known) {
                Ok(data) => session.write(&mut client, address, &data),
                Err(error) => return bad_input(&*error),
            },
        };
        match result {
            Ok(()) => Exit::Finished,
            Err(error) => {
                let node = target.node;
                report(&Failed { node, error });
                Exit::Stopped
            }
        }
    }
}

/// A transfer that failed, and with whom.
#[derive(Debug, thiserror::Error)]
#[error("node {node}: {error}")]
struct Failed {
    node: NodeId,
    error: Box<dyn Error>,
}

/// The dictionary of the model that the node says it is; empty if it is none that is known.
fn ask_who(session: &mut Session, client: &mut Client) -> &'static [Entry] {
    let mut number = |index, sub| {
        let data = session.read(client, Address::new(index, sub)).ok()?;
        Some(u32::from_le_bytes(data.try_into().ok()?))
    };
    let model = number(0x1000, 0).and_then(|device| recognise(device, number(0x1018, 1)));
    model.map_or(&[], |model| model.dictionary)
}

impl Target {
    fn find(
        &self,
        table: &'static [Entry],
    ) -> Result<(Address, Option<&'static Entry>), Box<dyn Error>> {
        let named = table.iter().find(|entry| entry.name == self.object);
        if let Some(entry) = named {
            return Ok((entry.address, Some(entry)));
        }
        let (index, sub) = self.object.split_once(':').unwrap_or((&self.object, "0"));
        let hex = |text: &str| {
            let text = text.strip_prefix("0x").unwrap_or(text);
            let text = text.strip_suffix('h').unwrap_or(text);
            u16::from_str_radix(text, 16).ok()
        };
        let address = hex(index)
            .zip(hex(sub).and_then(|sub| u8::try_from(sub).ok()))
            .map(|(index, sub)| Address::new(index, sub))
            .ok_or_else(|| self.unknown(table))?;
        let entry = table.iter().find(|entry| entry.address == address);
        Ok((address, entry))
    }

    fn unknown(&self, table: &[Entry]) -> String {
        let near = table
            .iter()
            .map(|entry| (strsim::jaro_winkler(entry.name, &self.object), entry.name))
            .filter(|(likeness, _)| *likeness > 0.8)
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let object = &self.object;
        match near {
            Some((_, name)) => format!("`{object}` is no object: did you mean `{name}`?"),
            None => format!("`{object}` is no object: write INDEX[:SUB] in hexadecimal, or a name"),
        }
    }
}

fn data_type(text: &str) -> Result<DataType, String> {
    Ok(match text {
        "bool" => DataType::Bool,
        "i8" => DataType::I8,
        "i16" => DataType::I16,
        "i32" => DataType::I32,
        "i64" => DataType::I64,
        "u8" => DataType::U8,
        "u16" => DataType::U16,
        "u32" => DataType::U32,
        "u64" => DataType::U64,
        "text" => DataType::Text(u16::MAX),
        _ => return Err("expected bool, i8, i16, i32, i64, u8, u16, u32, u64 or text".into()),
    })
}

fn shown(address: Address, known: Option<DataType>, data: &[u8]) -> String {
    match known {
        Some(DataType::Text(_)) => format!("{:?}", String::from_utf8_lossy(data)),
        Some(number) if number.is_number() && number.size() == data.len() => {
            let mut raw = [0; 8];
            raw[..data.len()].copy_from_slice(data);
            let value = number.extend(u64::from_le_bytes(raw), data.len() as u32 * 8);
            monitor::value_text(address, number, value)
        }
        known => {
            let hex: String = data.iter().map(|byte| format!("{byte:02X} ")).collect();
            match known.filter(|known| known.is_number()) {
                Some(number) => format!("{hex}({} bytes instead of {})", data.len(), number.size()),
                None => hex,
            }
        }
    }
}

fn encoded(value: &str, known: Option<DataType>) -> Result<Vec<u8>, Box<dyn Error>> {
    let data_type = known.ok_or("the object's type is not known: say it by --type")?;
    if !data_type.is_number() {
        return Ok(value.as_bytes().to_vec());
    }
    let (negative, digits) = match value.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, value),
    };
    let hex = digits
        .strip_prefix("0x")
        .or_else(|| digits.strip_suffix('h'));
    let magnitude = match hex {
        Some(hex) => i128::from_str_radix(hex, 16),
        None => digits.parse(),
    };
    let number = magnitude.map_err(|_| format!("`{value}` is no number"))?;
    let number = if negative { -number } else { number };
    let bits = data_type.size() as u32 * 8;
    let (least, greatest) = if data_type.is_signed() {
        (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1)
    } else {
        (0, (1i128 << bits) - 1)
    };
    if !(least..=greatest).contains(&number) {
        return Err(format!("{value} is outside {least} to {greatest}").into());
    }
    Ok(number.to_le_bytes()[..data_type.size()].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_another_size_is_told() {
        let show = |data: &[u8]| shown(Address::new(0x1017, 0), Some(DataType::U16), data);
        assert_eq!(show(&[0x32, 0]), "50 (0032h)");
        assert_eq!(show(&[0x32, 0, 0, 0]), "32 00 00 00 (4 bytes instead of 2)");
        assert_eq!(shown(Address::new(0x2000, 0), None, &[1, 2]), "01 02 ");
    }
}
