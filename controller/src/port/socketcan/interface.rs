//! The network interface: whether it is there, up and set to the bit rate, and how long its transmit queue is.

use libc::c_int;
use socketcan::nl::CanState;
use socketcan::{CanInterface, CanSocket, Socket};
use std::io;
use std::mem::zeroed;
use std::os::fd::AsRawFd;

/// What must hold before sockets are opened.
pub(super) fn check_interface(interface: &str, bit_rate: u32) -> Result<(), String> {
    let bring_up = if interface.starts_with('v') {
        format!(
            "`sudo ip link add dev {interface} type vcan; sudo ip link set {interface} up` makes a virtual one"
        )
    } else {
        "`ip -details link show type can` lists what there is; is the adapter's driver loaded?"
            .into()
    };
    if let Err(error) = CanSocket::open_iface(0)
        && matches!(
            error.raw_os_error(),
            Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT)
        )
    {
        return Err("this kernel has no SocketCAN: `sudo modprobe can-raw`".into());
    }
    let Ok(device) = CanInterface::open(interface) else {
        return Err(format!("no such interface: {bring_up}"));
    };
    let set_up = format!(
        "`sudo ip link set {interface} down; sudo ip link set {interface} up type can bitrate {bit_rate}`"
    );
    let details = device
        .details()
        .map_err(|error| format!("cannot be asked for its state: {error}"))?;
    if !details.is_up {
        return Err(match details.can.bit_timing {
            None if details.can.state.is_none() => {
                format!("is down: `sudo ip link set {interface} up`")
            }
            _ => format!("is down: {set_up}"),
        });
    }
    if let Some(timing) = details.can.bit_timing
        && timing.bitrate != bit_rate
    {
        return Err(format!(
            "runs at {} bit/s, the machine file says {bit_rate}: {set_up}",
            timing.bitrate
        ));
    }
    if matches!(
        details.can.state,
        Some(CanState::BusOff | CanState::Stopped)
    ) {
        return Err(format!(
            "is off the bus: check cable and termination, then `sudo ip link set {interface} type can restart`"
        ));
    }
    Ok(())
}

/// Sizes the interface's transmit queue to one burst: a longer one can replay old setpoints, a
/// shorter one cannot take a cycle's.
pub(super) fn fit_transmit_queue(
    interface: &str,
    socket: &CanSocket,
    burst: usize,
    notes: &mut Vec<String>,
) -> Result<(), String> {
    let grant = format!("`sudo ip link set {interface} txqueuelen {burst}`");
    let length = transmit_queue(interface, socket, None)
        .map_err(|error| format!("cannot read its transmit queue length: {error}"))?;
    if length == burst || transmit_queue(interface, socket, Some(burst)).is_ok() {
        return Ok(());
    }
    if length < burst {
        return Err(format!(
            "its transmit queue takes {length} frames, one cycle's burst is {burst}: {grant}"
        ));
    }
    notes.push(format!(
        "{interface}: transmit queue of {length} frames left as it is (not permitted to change it), one burst is {burst}: {grant}"
    ));
    Ok(())
}

/// Reads an interface's transmit queue length, or sets it.
fn transmit_queue(interface: &str, socket: &CanSocket, set: Option<usize>) -> io::Result<usize> {
    // SAFETY: ifreq is plain data for which all zeroes is valid.
    let mut request: libc::ifreq = unsafe { zeroed() };
    for (to, from) in request.ifr_name.iter_mut().zip(interface.bytes()).take(15) {
        *to = from as libc::c_char;
    }
    let call = match set {
        Some(length) => {
            request.ifr_ifru.ifru_metric = length as c_int;
            libc::SIOCSIFTXQLEN
        }
        None => libc::SIOCGIFTXQLEN,
    };
    // SAFETY: both calls read and write one ifreq, which outlives them. The queue length is the
    // same int in the union as the metric (netdevice(7): ifr_qlen).
    unsafe {
        if libc::ioctl(socket.as_raw_fd(), call as _, &raw mut request) < 0 {
            return Err(io::Error::last_os_error());
        }
        Ok(request.ifr_ifru.ifru_metric.max(0) as usize)
    }
}
