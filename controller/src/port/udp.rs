//! CAN over UDP multicast, as python-can's `udp_multicast` has it: a datagram is one frame, a
//! MessagePack map of eleven keys.

use super::PortError;
use super::network::{NetworkBus, Outlet};
use crate::realtime;
use serde::{Deserialize, Serialize};
use socket2::{Domain, InterfaceIndexOrAddress, Protocol, Socket, Type};
use std::fs;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::thread;
use std::time::{SystemTime, UNIX_EPOCH};
use syncline_canopen::{CanId, Frame};

/// More than any frame's datagram.
const LONGEST: usize = 4096;

/// A datagram.
#[derive(Debug, Deserialize, Serialize)]
struct Datagram {
    timestamp: f64,
    arbitration_id: u32,
    is_extended_id: bool,
    is_remote_frame: bool,
    is_error_frame: bool,
    channel: Option<Channel>,
    dlc: u8,
    #[serde(with = "serde_bytes")]
    data: Vec<u8>,
    is_fd: bool,
    bitrate_switch: bool,
    error_state_indicator: bool,
}

/// The name or number of a channel at its sender.
#[derive(Debug, Deserialize, Serialize)]
#[serde(untagged)]
enum Channel {
    Number(i64),
    Name(String),
}

fn encode(frame: &Frame) -> Result<Vec<u8>, rmp_serde::encode::Error> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    rmp_serde::to_vec_named(&Datagram {
        timestamp: now.unwrap_or_default().as_secs_f64(),
        arbitration_id: frame.id().raw(),
        is_extended_id: matches!(frame.id(), CanId::Extended(_)),
        is_remote_frame: frame.is_remote(),
        is_error_frame: false,
        channel: None,
        dlc: frame.dlc(),
        data: frame.data().to_vec(),
        is_fd: false,
        bitrate_switch: false,
        error_state_indicator: false,
    })
}

/// The classical frame in a datagram, if it is one.
fn decode(bytes: &[u8]) -> Option<Frame> {
    let datagram: Datagram = rmp_serde::from_slice(bytes).ok()?;
    if datagram.is_fd || datagram.is_error_frame {
        return None;
    }
    let id = if datagram.is_extended_id {
        CanId::extended(datagram.arbitration_id)
    } else {
        CanId::standard(u16::try_from(datagram.arbitration_id).ok()?)
    }?;
    if datagram.is_remote_frame {
        Frame::remote(id, datagram.dlc)
    } else {
        Frame::try_new(id, &datagram.data)
    }
}

/// Joins a multicast group on one network interface of this host.
///
/// # Errors
/// The group cannot be joined.
pub(super) fn join(
    name: &str,
    group: IpAddr,
    port: u16,
    interface: &str,
) -> Result<NetworkBus, PortError> {
    let fail = |error: io::Error| PortError {
        bus: name.to_owned(),
        what: format!("cannot join the multicast group on interface {interface}: {error}"),
    };
    let index = interface_index(interface).map_err(fail)?;
    let receiving = receiving_socket(group, port, index).map_err(fail)?;
    let sending = sending_socket(group, interface).map_err(fail)?;
    let own = sending.local_addr().map_err(fail)?.port();
    let (inlet, frames) = NetworkBus::inlet();
    thread::spawn(move || {
        let mut bytes = [0; LONGEST];
        while let Ok((length, from)) = receiving.recv_from(&mut bytes) {
            // Datagrams come back to their sender; the sending socket's port tells them.
            if from.port() != own
                && let Some(frame) = decode(&bytes[..length])
                && let Err(error) = inlet.try_send((realtime::now(), frame))
                && error.is_disconnected()
            {
                return;
            }
        }
    });
    let outlet = Group {
        socket: sending,
        to: SocketAddr::new(group, port),
    };
    Ok(NetworkBus::new(name.to_owned(), frames, Box::new(outlet)))
}

/// The number of a network interface.
fn interface_index(interface: &str) -> io::Result<u32> {
    let none = |_| io::Error::new(io::ErrorKind::NotFound, "there is no such interface");
    let text = fs::read_to_string(format!("/sys/class/net/{interface}/ifindex")).map_err(none)?;
    (text.trim().parse()).map_err(|_| io::Error::from(io::ErrorKind::InvalidData))
}

fn receiving_socket(group: IpAddr, port: u16, index: u32) -> io::Result<UdpSocket> {
    let socket = Socket::new(domain(group), Type::DGRAM, Some(Protocol::UDP))?;
    // Others on this host listen to the same group.
    socket.set_reuse_address(true)?;
    socket.set_reuse_port(true)?;
    socket.bind(&SocketAddr::new(group, port).into())?;
    match group {
        IpAddr::V4(group) => {
            socket.join_multicast_v4_n(&group, &InterfaceIndexOrAddress::Index(index))?;
        }
        IpAddr::V6(group) => socket.join_multicast_v6(&group, index)?,
    }
    Ok(socket.into())
}

fn sending_socket(group: IpAddr, interface: &str) -> io::Result<UdpSocket> {
    let socket = Socket::new(domain(group), Type::DGRAM, Some(Protocol::UDP))?;
    // IP_MULTICAST_IF names an IPv4 interface by its address, which it may not have.
    socket.bind_device(Some(interface.as_bytes()))?;
    match group {
        IpAddr::V4(_) => {
            socket.bind(&SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)).into())?;
            socket.set_multicast_ttl_v4(1)?;
        }
        IpAddr::V6(_) => {
            socket.bind(&SocketAddr::from((Ipv6Addr::UNSPECIFIED, 0)).into())?;
            socket.set_multicast_hops_v6(1)?;
        }
    }
    Ok(socket.into())
}

fn domain(group: IpAddr) -> Domain {
    match group {
        IpAddr::V4(_) => Domain::IPV4,
        IpAddr::V6(_) => Domain::IPV6,
    }
}

struct Group {
    socket: UdpSocket,
    to: SocketAddr,
}

impl Outlet for Group {
    fn write(&mut self, frame: &Frame) -> io::Result<()> {
        let bytes = encode(frame).map_err(io::Error::other)?;
        self.socket.send_to(&bytes, self.to).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn datagrams_carry_frames(
            id in 0u32..=0x1FFF_FFFF,
            data in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            for id in [CanId::Standard((id & 0x7FF) as u16), CanId::Extended(id)] {
                for frame in [Some(Frame::new(id, &data)), Frame::remote(id, data.len() as u8)] {
                    let bytes = encode(&frame.unwrap()).unwrap();
                    // A fixmap of eleven keys.
                    prop_assert_eq!(bytes[0], 0x8B);
                    prop_assert_eq!(decode(&bytes), frame);
                }
            }
        }

        #[test]
        fn nothing_that_arrives_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = decode(&bytes);
        }
    }
}
