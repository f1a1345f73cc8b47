//! Frames as the kernel has them, and many of them in one call: `sendmmsg(2)`, `recvmmsg(2)`.

use crate::bus::BURST_CAPACITY;
use libc::{c_int, can_frame, iovec, mmsghdr, timespec};
use socketcan::CanSocket;
use std::io;
use std::mem::{size_of, zeroed};
use std::os::fd::AsRawFd;
use syncline_canopen::{CanId, Frame};

/// A frame as the kernel has it.
#[must_use]
pub fn to_raw(frame: &Frame) -> can_frame {
    // SAFETY: can_frame is plain data for which all zeroes is valid.
    let mut raw: can_frame = unsafe { zeroed() };
    raw.can_id = match frame.id() {
        CanId::Standard(id) => id.into(),
        CanId::Extended(id) => id | libc::CAN_EFF_FLAG,
    };
    if frame.is_remote() {
        raw.can_id |= libc::CAN_RTR_FLAG;
    }
    raw.can_dlc = frame.dlc();
    raw.data[..frame.data().len()].copy_from_slice(frame.data());
    raw
}

/// The frame that the kernel hands over; `None` for what it could not have sent.
#[must_use]
pub fn from_raw(raw: &can_frame) -> Option<Frame> {
    let id = if raw.can_id & libc::CAN_EFF_FLAG != 0 {
        CanId::extended(raw.can_id & libc::CAN_EFF_MASK)?
    } else {
        CanId::standard((raw.can_id & libc::CAN_SFF_MASK) as u16)?
    };
    if raw.can_id & libc::CAN_RTR_FLAG != 0 {
        return Frame::remote(id, raw.can_dlc);
    }
    Frame::try_new(id, raw.data.get(..raw.can_dlc.into())?)
}

/// Sends frames in one call and says how many were queued, at least one; an error if none was.
pub(super) fn send_all(socket: &CanSocket, frames: &[Frame]) -> io::Result<usize> {
    let count = frames.len().min(BURST_CAPACITY);
    if count == 0 {
        return Ok(0);
    }
    // SAFETY: all three are plain data for which all zeroes is valid.
    let (mut raw, mut vectors, mut headers): (
        [can_frame; BURST_CAPACITY],
        [iovec; BURST_CAPACITY],
        [mmsghdr; BURST_CAPACITY],
    ) = unsafe { zeroed() };
    for (index, frame) in frames[..count].iter().enumerate() {
        raw[index] = to_raw(frame);
        vectors[index] = iovec {
            iov_base: (&raw mut raw[index]).cast(),
            iov_len: size_of::<can_frame>(),
        };
        headers[index].msg_hdr.msg_iov = &raw mut vectors[index];
        headers[index].msg_hdr.msg_iovlen = 1;
    }
    // SAFETY: the first `count` headers point to one vector each and that to one frame, all alive
    // on this stack during the call.
    let sent = unsafe {
        libc::sendmmsg(
            socket.as_raw_fd(),
            headers.as_mut_ptr(),
            count as libc::c_uint,
            libc::MSG_DONTWAIT,
        )
    };
    usize::try_from(sent).map_err(|_| io::Error::last_os_error())
}

/// Room for the control messages of one frame: SCM_TIMESTAMPING (three timespec) and SO_RXQ_OVFL.
#[repr(C, align(8))]
#[derive(Clone, Copy)]
struct Control([u8; 88]);

/// The buffers of one receive call.
pub(super) struct Batch {
    raw: Vec<can_frame>,
    control: Vec<Control>,
    vectors: Vec<iovec>,
    headers: Vec<mmsghdr>,
}

// SAFETY: the pointers in `vectors` and `headers` are written anew before every call and point
// into this Batch's own buffers; nobody follows one that was written before a move.
unsafe impl Send for Batch {}

/// One received frame as the kernel hands it over.
pub(super) struct Message {
    pub(super) raw: can_frame,
    pub(super) flags: c_int,
    /// Nanoseconds of CLOCK_REALTIME, by the kernel.
    pub(super) software: Option<u64>,
    /// Nanoseconds of the adapter's own clock.
    pub(super) hardware: Option<u64>,
    /// Frames lost so far for want of room in the socket.
    pub(super) overruns: Option<u32>,
}

impl Batch {
    pub(super) fn new(capacity: usize) -> Self {
        // SAFETY: iovec, mmsghdr and can_frame are plain data for which all zeroes is valid.
        unsafe {
            Self {
                raw: vec![zeroed(); capacity],
                control: vec![Control([0; 88]); capacity],
                vectors: vec![zeroed(); capacity],
                headers: vec![zeroed(); capacity],
            }
        }
    }

    pub(super) fn capacity(&self) -> usize {
        self.raw.len()
    }

    /// Takes what has arrived, up to the capacity.
    pub(super) fn receive(&mut self, socket: &CanSocket) -> io::Result<usize> {
        for index in 0..self.capacity() {
            self.vectors[index] = iovec {
                iov_base: (&raw mut self.raw[index]).cast(),
                iov_len: size_of::<can_frame>(),
            };
            let header = &mut self.headers[index].msg_hdr;
            header.msg_iov = &raw mut self.vectors[index];
            header.msg_iovlen = 1;
            header.msg_control = (&raw mut self.control[index]).cast();
            header.msg_controllen = size_of::<Control>() as _;
        }
        // SAFETY: each header points to one vector, its frame and its control buffer, with their
        // true sizes, all in `self` and alive during the call.
        let count = unsafe {
            libc::recvmmsg(
                socket.as_raw_fd(),
                self.headers.as_mut_ptr(),
                self.capacity() as libc::c_uint,
                libc::MSG_DONTWAIT as _,
                std::ptr::null_mut(),
            )
        };
        usize::try_from(count).map_err(|_| io::Error::last_os_error())
    }

    /// The frame at `index` of the last call.
    pub(super) fn message(&self, index: usize) -> Message {
        let header = &self.headers[index].msg_hdr;
        let mut message = Message {
            raw: self.raw[index],
            flags: header.msg_flags,
            software: None,
            hardware: None,
            overruns: None,
        };
        // SAFETY: the kernel wrote whole control messages into the buffer and their total length
        // into the header, and the CMSG macros stay within it; the payloads are read unaligned.
        unsafe {
            let mut control = libc::CMSG_FIRSTHDR(header);
            while let Some(found) = control.as_ref() {
                let data = libc::CMSG_DATA(control);
                if found.cmsg_level == libc::SOL_SOCKET {
                    if found.cmsg_type == libc::SCM_TIMESTAMPING {
                        let [software, _, hardware] =
                            data.cast::<[timespec; 3]>().read_unaligned().map(nanos);
                        message.software = software;
                        message.hardware = hardware;
                    } else if found.cmsg_type == libc::SO_RXQ_OVFL {
                        message.overruns = Some(data.cast::<u32>().read_unaligned());
                    }
                }
                control = libc::CMSG_NXTHDR(header, control);
            }
        }
        message
    }
}

/// `None` for the zero that stands for "no stamp".
fn nanos(time: timespec) -> Option<u64> {
    let nanos = time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64;
    (nanos > 0).then_some(nanos)
}
