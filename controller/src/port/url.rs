//! What stands behind a bus, as a person names it.

use super::PortError;
use super::network::NetworkBus;
use super::socketcan::DriveSocket;
use super::wire::Wire;
use super::{socketcand, udp};
use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

/// The name of a simulated bus.
pub const SIM: &str = "sim";
/// The interface of a multicast bus unless another one is named.
const LOOPBACK: &str = "lo";
/// The port of socketcand unless another one is named.
const SOCKETCAND_PORT: u16 = 29_536;

/// A bus by its URL: `sim`, `can0`, `socketcand://127.0.0.1:29536/can0`,
/// `udp://239.74.163.2:43113?interface=lo`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusUrl {
    /// Simulated in this process.
    Sim,
    /// A SocketCAN interface.
    SocketCan(String),
    /// A bus of a socketcand server, or to be served.
    Socketcand {
        /// Host and port.
        address: String,
        /// The bus' name at the server.
        bus: String,
    },
    /// A multicast group.
    Udp {
        /// The group.
        group: IpAddr,
        /// UDP port.
        port: u16,
        /// The network interface of this host.
        interface: String,
    },
}

/// Not a bus.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no bus: write sim, a CAN interface such as can0, socketcand://HOST:PORT/BUS or \
     udp://GROUP:PORT?interface=NAME"
)]
pub struct NoBus(String);

/// Whether the kernel takes this for the name of an interface: shorter than IFNAMSIZ.
fn is_interface(name: &str) -> bool {
    let is_name = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    (1..16).contains(&name.len()) && name.chars().all(is_name)
}

impl FromStr for BusUrl {
    type Err = NoBus;

    fn from_str(text: &str) -> Result<Self, NoBus> {
        let no_bus = || NoBus(text.to_owned());
        let Some((scheme, rest)) = text.split_once("://") else {
            return match text {
                SIM => Ok(Self::Sim),
                _ if is_interface(text) => Ok(Self::SocketCan(text.to_owned())),
                _ => Err(no_bus()),
            };
        };
        match scheme {
            "socketcand" => {
                let (address, bus) = rest.split_once('/').ok_or_else(no_bus)?;
                if address.is_empty() || bus.is_empty() || bus.contains(['/', ' ', '<', '>']) {
                    return Err(no_bus());
                }
                // The colons of an IPv6 address stand in brackets.
                let (host, port) = match address.rsplit_once(':') {
                    Some((host, port)) if !port.ends_with(']') => {
                        (host, port.parse::<u16>().map_err(|_| no_bus())?)
                    }
                    _ => (address, SOCKETCAND_PORT),
                };
                if host.is_empty() || (host.contains(':') && !host.starts_with('[')) {
                    return Err(no_bus());
                }
                Ok(Self::Socketcand {
                    address: format!("{host}:{port}"),
                    bus: bus.to_owned(),
                })
            }
            "udp" => {
                let (address, query) = rest.split_once('?').unwrap_or((rest, ""));
                let (group, port) = address.rsplit_once(':').ok_or_else(no_bus)?;
                let group: IpAddr = group
                    .trim_matches(['[', ']'])
                    .parse()
                    .map_err(|_| no_bus())?;
                let interface = match query.split_once('=') {
                    Some(("interface", name)) if is_interface(name) => name,
                    None if query.is_empty() => LOOPBACK,
                    _ => return Err(no_bus()),
                };
                if !group.is_multicast() {
                    return Err(no_bus());
                }
                Ok(Self::Udp {
                    group,
                    port: port.parse().map_err(|_| no_bus())?,
                    interface: interface.to_owned(),
                })
            }
            _ => Err(no_bus()),
        }
    }
}

impl fmt::Display for BusUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim => f.write_str(SIM),
            Self::SocketCan(interface) => f.write_str(interface),
            Self::Socketcand { address, bus } => write!(f, "socketcand://{address}/{bus}"),
            Self::Udp {
                group: IpAddr::V6(group),
                port,
                interface,
            } => write!(f, "udp://[{group}]:{port}?interface={interface}"),
            Self::Udp {
                group,
                port,
                interface,
            } => write!(f, "udp://{group}:{port}?interface={interface}"),
        }
    }
}

/// Which end of a connection is meant where it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Uses a bus that is there.
    Client,
    /// Is the bus: serves it to others.
    Host,
}

impl BusUrl {
    /// Opens the bus to read and write frame by frame. The bit rate is for interfaces that can
    /// tell theirs.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn open(&self, bit_rate: u32, end: End) -> Result<Box<dyn Wire + Send>, PortError> {
        let name = self.to_string();
        let network = |bus: NetworkBus| Box::new(bus) as Box<dyn Wire + Send>;
        match (self, end) {
            (Self::Sim, _) => Err(PortError {
                bus: name,
                what: "a simulated bus lives inside the command that runs the machine: give other commands drives by `syncline drives --bus …`".to_owned(),
            }),
            (Self::SocketCan(interface), _) => {
                Ok(Box::new(DriveSocket::open(interface, bit_rate)?))
            }
            (Self::Socketcand { address, bus }, End::Client) => {
                socketcand::connect(&name, address, bus).map(network)
            }
            (Self::Socketcand { address, bus }, End::Host) => {
                socketcand::serve(&name, address, bus).map(network)
            }
            (
                Self::Udp {
                    group,
                    port,
                    interface,
                },
                _,
            ) => Ok(Box::new(udp::Group::join(name, *group, *port, interface)?)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls() {
        for (text, shown) in [
            ("sim", "sim"),
            ("can0", "can0"),
            (
                "socketcand://127.0.0.1:29536/can0",
                "socketcand://127.0.0.1:29536/can0",
            ),
            (
                "socketcand://localhost/can1",
                "socketcand://localhost:29536/can1",
            ),
            ("socketcand://[::1]/can0", "socketcand://[::1]:29536/can0"),
            ("socketcand://[::1]:1/can0", "socketcand://[::1]:1/can0"),
            (
                "udp://239.74.163.2:43113",
                "udp://239.74.163.2:43113?interface=lo",
            ),
            (
                "udp://[ff15:7079:7468:6f6e:6465:6d6f:6d63:6173]:43113?interface=eth0",
                "udp://[ff15:7079:7468:6f6e:6465:6d6f:6d63:6173]:43113?interface=eth0",
            ),
        ] {
            assert_eq!(text.parse::<BusUrl>().unwrap().to_string(), shown);
        }
        for text in [
            "",
            "can 0",
            "a-name-that-is-too-long-for-an-interface",
            "socketcand://127.0.0.1:29536",
            "socketcand:///can0",
            "socketcand://:29536/can0",
            "socketcand://127.0.0.1:99999/can0",
            "socketcand://localhost:/can0",
            "socketcand://::1/can0",
            "udp://127.0.0.1:43113",
            "udp://239.74.163.2",
            "udp://239.74.163.2:43113?x=y",
            "tcp://127.0.0.1/can0",
        ] {
            assert!(text.parse::<BusUrl>().is_err(), "{text}");
        }
    }
}
