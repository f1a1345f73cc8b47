//! CAN over UDP multicast, as python-can's `udp_multicast` has it: a datagram is one frame, a
//! MessagePack map of eleven keys.
//!
//! A group is joined on one interface, but the kernel by itself hands a socket whatever any program
//! of the host has joined, on any interface. Here it is told not to, and each datagram is held
//! against the interface that it came by: nobody beyond it moves a drive.

use super::PortError;
use super::arrival::Arrivals;
use super::wire::Wire;
use crate::realtime;
use nix::cmsg_space;
use nix::errno::Errno;
use nix::libc::{in_pktinfo, in6_pktinfo};
use nix::net::if_::if_nametoindex;
use nix::sys::socket::{
    ControlMessageOwned, MsgFlags, SockaddrStorage, recvmsg, setsockopt, sockopt,
};
use nix::sys::time::TimeSpec;
use serde::{Deserialize, Serialize};
use socket2::{Domain, InterfaceIndexOrAddress, Protocol, Socket, Type};
use std::io::{self, IoSliceMut};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::os::fd::AsRawFd as _;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use syncline_canopen::{CanId, Frame, Instant};

/// More than any frame's datagram.
const LONGEST: usize = 4096;
/// Bytes that wait to be read; the kernel grants less if it is told to.
const RECEIVE_BUFFER: usize = 1 << 22;

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

/// Any datagram: what is a frame is the same frame when it is sent on.
#[cfg(fuzzing)]
pub fn fuzz(datagram: &[u8]) {
    if let Some(frame) = decode(datagram) {
        let again = encode(&frame).ok().as_deref().and_then(decode);
        assert_eq!(again, Some(frame));
    }
}

/// A multicast group on one network interface of this host.
pub(super) struct Group {
    name: String,
    receiving: UdpSocket,
    arrivals: Arrivals,
    /// Room for what the kernel says of a datagram.
    control: Vec<u8>,
    /// The only one that counts.
    interface: u32,
    sending: UdpSocket,
    /// Of the sending socket: datagrams come back to their sender.
    own_port: u16,
    to: SocketAddr,
}

impl Group {
    /// Joins it.
    ///
    /// # Errors
    /// The group cannot be joined.
    pub(super) fn join(
        name: String,
        group: IpAddr,
        port: u16,
        interface: &str,
    ) -> Result<Self, PortError> {
        let sockets = || -> io::Result<_> {
            let index = interface_index(interface)?;
            let receiving = receiving_socket(group, port, index)?;
            let sending = sending_socket(group, interface)?;
            let own_port = sending.local_addr()?.port();
            Ok((index, receiving, sending, own_port))
        };
        match sockets() {
            Ok((interface, receiving, sending, own_port)) => Ok(Self {
                name,
                receiving,
                arrivals: Arrivals::new(),
                control: cmsg_space!(TimeSpec, in_pktinfo, in6_pktinfo),
                interface,
                sending,
                own_port,
                to: SocketAddr::new(group, port),
            }),
            Err(error) => Err(PortError {
                bus: name,
                what: format!("cannot join the multicast group on interface {interface}: {error}"),
            }),
        }
    }

    fn fail(&self, doing: &str, error: &io::Error) -> PortError {
        // Linux gives loopback no way to IPv6 groups by itself.
        let hint = match self.to.ip() {
            IpAddr::V6(group) if error.kind() == io::ErrorKind::NetworkUnreachable => format!(
                ": on loopback, sudo ip -6 route add local {:x}::/16 dev lo table local",
                group.segments()[0]
            ),
            _ => String::new(),
        };
        PortError {
            bus: self.name.clone(),
            what: format!("{doing}: {error}{hint}"),
        }
    }
}

impl Wire for Group {
    fn name(&self) -> &str {
        &self.name
    }

    fn wait(&mut self, most: Duration) -> Result<(), PortError> {
        realtime::wait_readable(&self.receiving, most).map_err(|error| self.fail("waiting", &error))
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
        let asked = realtime::now();
        let mut bytes = [0; LONGEST];
        match self.read(&mut bytes) {
            Ok(received) => {
                if received.from != self.own_port
                    && received.interface == self.interface
                    && let Some(frame) = decode(&bytes[..received.length])
                {
                    sink(self.arrivals.read().at(received.stamp), &frame);
                }
                Ok(true)
            }
            Err(Errno::EAGAIN) => {
                self.arrivals.found_empty(asked);
                Ok(false)
            }
            Err(error) => Err(self.fail("receiving", &error.into())),
        }
    }

    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
        let mut sent = 0;
        let outcome: io::Result<()> = frames.iter().try_for_each(|frame| {
            let bytes = encode(frame).map_err(io::Error::other)?;
            self.sending.send_to(&bytes, self.to)?;
            sent += 1;
            Ok(())
        });
        frames.drain(..sent);
        match outcome {
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => {
                Err(self.fail("sending", &error))
            }
            _ => Ok(()),
        }
    }
}

/// A datagram as the kernel hands it over.
#[derive(Default)]
struct Received {
    length: usize,
    /// The sender's port.
    from: u16,
    /// Number of the interface that it came by.
    interface: u32,
    /// When it came, in nanoseconds of CLOCK_REALTIME.
    stamp: Option<u64>,
}

impl Group {
    /// Reads a datagram, if there is one.
    fn read(&mut self, bytes: &mut [u8]) -> nix::Result<Received> {
        let mut slices = [IoSliceMut::new(bytes)];
        let message = recvmsg::<SockaddrStorage>(
            self.receiving.as_raw_fd(),
            &mut slices,
            Some(&mut self.control),
            MsgFlags::MSG_DONTWAIT,
        )?;
        let from = message.address.as_ref().and_then(|from| {
            let v4 = from.as_sockaddr_in().map(|it| it.port());
            v4.or_else(|| from.as_sockaddr_in6().map(|it| it.port()))
        });
        let mut received = Received {
            length: message.bytes,
            from: from.unwrap_or_default(),
            ..Received::default()
        };
        for told in message.cmsgs()? {
            match told {
                ControlMessageOwned::ScmTimestampns(stamp) => {
                    let [seconds, nanos] =
                        [stamp.tv_sec(), stamp.tv_nsec()].map(i64::cast_unsigned);
                    received.stamp = Some(seconds * 1_000_000_000 + nanos);
                }
                ControlMessageOwned::Ipv4PacketInfo(info) => {
                    received.interface = info.ipi_ifindex.cast_unsigned();
                }
                ControlMessageOwned::Ipv6PacketInfo(info) => {
                    received.interface = info.ipi6_ifindex;
                }
                _ => {}
            }
        }
        Ok(received)
    }
}

/// The number of a network interface.
fn interface_index(interface: &str) -> io::Result<u32> {
    let none = |_| io::Error::new(io::ErrorKind::NotFound, "there is no such interface");
    if_nametoindex(interface).map_err(none)
}

fn receiving_socket(group: IpAddr, port: u16, index: u32) -> io::Result<UdpSocket> {
    let socket = Socket::new(domain(group), Type::DGRAM, Some(Protocol::UDP))?;
    // Others on this host listen to the same group.
    socket.set_reuse_address(true)?;
    socket.set_reuse_port(true)?;
    socket.set_recv_buffer_size(RECEIVE_BUFFER)?;
    socket.set_nonblocking(true)?;
    socket.bind(&SocketAddr::new(group, port).into())?;
    setsockopt(&socket, sockopt::ReceiveTimestampns, &true)?;
    match group {
        IpAddr::V4(group) => {
            socket.set_multicast_all_v4(false)?;
            setsockopt(&socket, sockopt::Ipv4PacketInfo, &true)?;
            socket.join_multicast_v4_n(&group, &InterfaceIndexOrAddress::Index(index))?;
        }
        IpAddr::V6(group) => {
            socket.set_multicast_all_v6(false)?;
            setsockopt(&socket, sockopt::Ipv6RecvPacketInfo, &true)?;
            socket.join_multicast_v6(&group, index)?;
        }
    }
    Ok(socket.into())
}

fn sending_socket(group: IpAddr, interface: &str) -> io::Result<UdpSocket> {
    let socket = Socket::new(domain(group), Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_nonblocking(true)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs;

    /// What the kernel has no room for is no reason to stop a cycle.
    #[test]
    fn neither_socket_waits() {
        const NON_BLOCKING: u32 = 0o4000;
        let group = "239.74.163.2".parse().unwrap();
        let group = Group::join("test".into(), group, 43_113, "lo").unwrap();
        for socket in [&group.receiving, &group.sending] {
            let about = format!("/proc/self/fdinfo/{}", socket.as_raw_fd());
            let about = fs::read_to_string(about).unwrap();
            let flags = about.lines().find_map(|line| line.strip_prefix("flags:"));
            let flags = u32::from_str_radix(flags.unwrap().trim(), 8).unwrap();
            assert_ne!(flags & NON_BLOCKING, 0, "{about}");
        }
    }

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
