//! Which port each bus of a machine is reached through.

use crate::machine::Machine;
use crate::port::url::BusUrl;
use std::error::Error;

/// The machine file's ports, unless the command line says otherwise.
#[derive(Debug, clap::Args)]
pub(super) struct PortChoice {
    /// Use this port instead of the machine file's, for all buses or for the one named: `sim`, a
    /// SocketCAN interface such as `can0`, `socketcand://HOST:PORT/BUS` or
    /// `udp://GROUP:PORT?interface=NAME`. Can be repeated.
    #[arg(long, value_name = "[BUS=]PORT")]
    bus: Vec<String>,
}

impl PortChoice {
    /// Puts the chosen ports into the machine.
    pub(super) fn apply(&self, machine: &mut Machine) -> Result<(), UnknownBus> {
        for choice in &self.bus {
            match choice.split_once('=') {
                // The `=` of a URL's query is not ours.
                Some((name, port)) if !name.contains("://") => {
                    let buses = machine.buses.iter_mut();
                    let bus = buses.into_iter().find(|bus| bus.name == name);
                    bus.ok_or_else(|| UnknownBus(name.to_owned()))?.port = port.to_owned();
                }
                _ => machine
                    .buses
                    .iter_mut()
                    .for_each(|bus| bus.port.clone_from(choice)),
            }
        }
        Ok(())
    }

    /// The one bus, where there is no machine file.
    pub(super) fn only(&self) -> Result<BusUrl, Box<dyn Error>> {
        match &self.bus[..] {
            [url] => Ok(url.parse::<BusUrl>()?),
            _ => Err("--bus: one bus for all nodes without a machine file".into()),
        }
    }
}

#[derive(Debug, thiserror::Error)]
#[error("--bus: the machine file has no bus `{0}`")]
pub(super) struct UnknownBus(String);
