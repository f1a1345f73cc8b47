//! The master's side of a transfer: expedited, segmented or by blocks, one at a time for each node.

use super::{
    AbortCode, crc,
    wire::{self, Message},
};
use crate::dictionary::Address;
use crate::{CanId, CobId, Frame, Instant, NodeId, Transmit, time::Duration};
use core::fmt;
use thiserror::Error;

/// Which way an object travels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// From the node: read.
    Upload,
    /// To the node: written.
    Download,
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Upload => "read",
            Self::Download => "write",
        })
    }
}

/// A transfer that failed, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("SDO {direction} {address} {reason}")]
pub struct Failure {
    /// Which way the object travelled.
    pub direction: Direction,
    /// The object.
    pub address: Address,
    /// What happened.
    pub reason: Reason,
}

/// Why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Reason {
    /// The node aborted the transfer.
    #[error("aborted {0}")]
    Refused(AbortCode),
    /// The client aborted the transfer because the node's answer was wrong.
    #[error("given up after a wrong answer: {0}")]
    GivenUp(AbortCode),
    /// The node did not answer in time.
    #[error("not answered in time")]
    TimedOut,
}

/// A transfer that could not start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotStarted {
    /// Another transfer is under way.
    #[error("another SDO transfer with this node is under way")]
    Busy,
    /// The object is longer than the client can hold.
    #[error("{size} bytes exceed the client's {capacity}")]
    TooLong {
        /// The object's bytes.
        size: usize,
        /// The client's room.
        capacity: usize,
    },
}

/// The master's side of one SDO channel to one node: one transfer at a time.
///
/// Start a transfer with [`upload`](Self::upload) or [`download`](Self::download), hand in every
/// received frame and call [`poll`](Self::poll) at the [`deadline`](Self::deadline); either may
/// end the transfer.
#[derive(Clone, Debug)]
pub struct Client {
    request: CobId,
    response: CobId,
    timeout: Duration,
    state: State,
    deadline: Option<Instant>,
    /// The object in transfer, with room for a last block segment's unused bytes.
    buffer: Box<[u8]>,
    /// Bytes of it that count.
    size: usize,
    /// The segment that ended the last block, which may come twice.
    block_end: Message,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    Upload {
        address: Address,
        step: UploadStep,
    },
    Download {
        address: Address,
        step: DownloadStep,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum UploadStep {
    Initiate,
    Segments {
        stated: Option<usize>,
        toggle: bool,
    },
    InitiateBlock {
        block_size: u8,
    },
    Block {
        stated: Option<usize>,
        crc: bool,
        block_size: u8,
        number: u8,
        /// Blocks in a row of which nothing came.
        futile: u8,
    },
    EndBlock {
        stated: Option<usize>,
        crc: bool,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DownloadStep {
    Initiate,
    Segments {
        sent: usize,
        toggle: bool,
    },
    InitiateBlock,
    Block {
        crc: bool,
        confirmed: usize,
        sent: usize,
        /// Blocks in a row of which nothing arrived.
        futile: u8,
    },
    EndBlock,
}

/// What an answer makes of a transfer.
enum Progress {
    /// It goes on.
    Continues(UploadOrDownload),
    /// The answer belongs to no step of this transfer, such as one that came too late.
    Ignored,
    /// All data have come or gone.
    Complete,
}

enum UploadOrDownload {
    Upload(UploadStep),
    Download(DownloadStep),
}

use UploadOrDownload as To;

impl Client {
    /// A client of a node's default SDO server (600h/580h + id) for objects of at most
    /// `capacity` bytes, 8 at least, that waits `timeout` for every answer.
    #[must_use]
    pub fn new(node: NodeId, timeout: Duration, capacity: usize) -> Self {
        Self::on_channel(CobId::r_sdo(node), CobId::t_sdo(node), timeout, capacity)
    }

    /// A client of any SDO server: requests on `request`, answers on `response`.
    #[must_use]
    pub fn on_channel(request: CobId, response: CobId, timeout: Duration, capacity: usize) -> Self {
        Self {
            request,
            response,
            timeout,
            state: State::Idle,
            deadline: None,
            buffer: vec![0; capacity.max(8) + 7].into_boxed_slice(),
            size: 0,
            block_end: Message::default(),
        }
    }

    /// Whether a transfer is under way.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.state != State::Idle
    }

    /// When [`Self::poll`] wants to be called.
    #[must_use]
    pub const fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// Starts to read an object.
    ///
    /// # Errors
    /// [`NotStarted::Busy`].
    pub fn upload(
        &mut self,
        now: Instant,
        address: Address,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), NotStarted> {
        self.start(
            now,
            0,
            State::Upload {
                address,
                step: UploadStep::Initiate,
            },
        )?;
        self.send(tx, wire::message(0x40, address, &[]));
        Ok(())
    }

    /// Starts to write an object: expedited up to 4 bytes, segmented above.
    ///
    /// # Errors
    /// [`NotStarted`].
    pub fn download(
        &mut self,
        now: Instant,
        address: Address,
        data: &[u8],
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), NotStarted> {
        self.start(
            now,
            data.len(),
            State::Download {
                address,
                step: DownloadStep::Initiate,
            },
        )?;
        self.buffer[..data.len()].copy_from_slice(data);
        let message = if (1..=4).contains(&data.len()) {
            wire::expedited(0x20, address, data)
        } else {
            wire::message(0x21, address, &(data.len() as u32).to_le_bytes())
        };
        self.send(tx, message);
        Ok(())
    }

    /// Starts to read an object by block transfer in blocks of `block_size` (1…127) segments.
    ///
    /// # Errors
    /// [`NotStarted::Busy`].
    pub fn upload_block(
        &mut self,
        now: Instant,
        address: Address,
        block_size: u8,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), NotStarted> {
        let block_size = block_size.clamp(1, 127);
        let step = UploadStep::InitiateBlock { block_size };
        self.start(now, 0, State::Upload { address, step })?;
        self.send(tx, wire::message(0xA4, address, &[block_size, 0]));
        Ok(())
    }

    /// Starts to write an object by block transfer.
    ///
    /// # Errors
    /// [`NotStarted`].
    pub fn download_block(
        &mut self,
        now: Instant,
        address: Address,
        data: &[u8],
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), NotStarted> {
        let step = DownloadStep::InitiateBlock;
        self.start(now, data.len(), State::Download { address, step })?;
        self.buffer[..data.len()].copy_from_slice(data);
        self.send(
            tx,
            wire::message(0xC6, address, &(data.len() as u32).to_le_bytes()),
        );
        Ok(())
    }

    /// Aborts a transfer under way.
    pub fn abort(&mut self, code: AbortCode, tx: &mut (impl Transmit + ?Sized)) {
        if let State::Upload { address, .. } | State::Download { address, .. } = self.state {
            self.end();
            self.send(tx, wire::abort(address, code));
        }
    }

    /// Takes a frame if it is an answer to this client. Once the transfer has ended: the bytes
    /// read (none after a write), or why it failed.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Option<Result<&[u8], Failure>> {
        if frame.id() != CanId::from(self.response) {
            return None;
        }
        let message = Message::try_from(frame.data()).ok()?;
        let (direction, address) = self.transfer()?;
        let fail = |reason| Failure {
            direction,
            address,
            reason,
        };
        if message[0] == wire::ABORT {
            if ![address, Address::default()].contains(&wire::address(&message)) {
                return None;
            }
            self.end();
            let code = AbortCode::from(wire::word(&message));
            return Some(Err(fail(Reason::Refused(code))));
        }
        let progress = match self.state {
            State::Idle => return None,
            State::Upload { step, .. } => self.on_upload(step, address, &message, tx),
            State::Download { step, .. } => self.on_download(step, address, &message, tx),
        };
        match progress {
            Ok(Progress::Ignored) => None,
            Ok(Progress::Continues(next)) => {
                self.state = match next {
                    To::Upload(step) => State::Upload { address, step },
                    To::Download(step) => State::Download { address, step },
                };
                self.deadline = Some(now + self.timeout);
                None
            }
            Ok(Progress::Complete) => {
                self.end();
                Some(Ok(match direction {
                    Direction::Upload => &self.buffer[..self.size],
                    Direction::Download => &[],
                }))
            }
            Err(code) => {
                self.abort(code, tx);
                Some(Err(fail(Reason::GivenUp(code))))
            }
        }
    }

    /// Gives up a transfer whose answer is overdue.
    pub fn poll(&mut self, now: Instant, tx: &mut (impl Transmit + ?Sized)) -> Option<Failure> {
        if self.deadline.is_none_or(|deadline| now < deadline) {
            return None;
        }
        let (direction, address) = self.transfer()?;
        self.abort(AbortCode::TimedOut, tx);
        Some(Failure {
            direction,
            address,
            reason: Reason::TimedOut,
        })
    }

    fn start(&mut self, now: Instant, size: usize, state: State) -> Result<(), NotStarted> {
        if self.is_busy() {
            return Err(NotStarted::Busy);
        }
        let capacity = self.buffer.len() - 7;
        if size > capacity {
            return Err(NotStarted::TooLong { size, capacity });
        }
        self.size = size;
        self.block_end = Message::default();
        self.state = state;
        self.deadline = Some(now + self.timeout);
        Ok(())
    }

    fn end(&mut self) {
        self.state = State::Idle;
        self.deadline = None;
    }

    fn transfer(&self) -> Option<(Direction, Address)> {
        match self.state {
            State::Idle => None,
            State::Upload { address, .. } => Some((Direction::Upload, address)),
            State::Download { address, .. } => Some((Direction::Download, address)),
        }
    }

    fn send(&self, tx: &mut (impl Transmit + ?Sized), message: Message) {
        tx.transmit(Frame::new(self.request, &message));
    }

    fn on_upload(
        &mut self,
        step: UploadStep,
        address: Address,
        message: &Message,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<Progress, AbortCode> {
        match step {
            UploadStep::Initiate => self.on_upload_initiated(address, message, tx),
            UploadStep::Segments { stated, toggle } => {
                if message[0] >> 5 != 0 {
                    return wrong(address, message);
                }
                if wire::toggle(message) != toggle {
                    return Err(AbortCode::ToggleBit);
                }
                let data = wire::segment_data(message);
                self.append(data)?;
                if message[0] & 0x01 != 0 {
                    return self.complete(stated);
                }
                if data.is_empty() {
                    // Any number of those would bring the transfer no further.
                    return Err(AbortCode::General);
                }
                self.request_segment(stated, !toggle, tx)
            }
            UploadStep::InitiateBlock { block_size } => {
                // A server may answer a short object as an ordinary upload.
                if message[0] >> 5 == 2 {
                    return self.on_upload_initiated(address, message, tx);
                }
                if message[0] & 0xF9 != 0xC0 || wire::address(message) != address {
                    return not_initiated(address, message);
                }
                let stated = (message[0] & 0x02 != 0).then_some(wire::word(message) as usize);
                self.check_room(stated)?;
                self.send(tx, [0xA3, 0, 0, 0, 0, 0, 0, 0]);
                Ok(Progress::Continues(To::Upload(UploadStep::Block {
                    stated,
                    crc: message[0] & 0x04 != 0,
                    block_size,
                    number: 0,
                    futile: 0,
                })))
            }
            UploadStep::Block {
                stated,
                crc,
                block_size,
                mut number,
                mut futile,
            } => {
                let (last, this) = (message[0] & 0x80 != 0, message[0] & 0x7F);
                if this == 0 || this > block_size {
                    return Err(AbortCode::SequenceNumber);
                }
                let (in_order, ends) = (this == number + 1, last || this == block_size);
                if in_order {
                    if self.size + 7 > self.buffer.len() {
                        return Err(AbortCode::OutOfMemory);
                    }
                    self.buffer[self.size..self.size + 7].copy_from_slice(&message[1..]);
                    self.size += 7;
                    number = this;
                } else if !ends || message == &self.block_end {
                    // It is dropped: the acknowledgement will tell where to go on, or has told it.
                    return Ok(Progress::Ignored);
                }
                if ends {
                    futile = wire::futile(futile, number.into())?;
                    self.block_end = wire::end_of_block(message, number);
                    self.send(tx, [0xA2, number, block_size, 0, 0, 0, 0, 0]);
                    number = 0;
                }
                Ok(Progress::Continues(To::Upload(if last && in_order {
                    UploadStep::EndBlock { stated, crc }
                } else {
                    UploadStep::Block {
                        stated,
                        crc,
                        block_size,
                        number,
                        futile,
                    }
                })))
            }
            UploadStep::EndBlock { stated, crc } => {
                if message == &self.block_end {
                    // The very last one, twice.
                    return Ok(Progress::Ignored);
                }
                if message[0] & 0xE3 != 0xC1 {
                    return wrong(address, message);
                }
                self.size -= usize::from(message[0] >> 2 & 7);
                let sent = u16::from_le_bytes([message[1], message[2]]);
                if crc && crc::crc(&self.buffer[..self.size]) != sent {
                    return Err(AbortCode::Crc);
                }
                let progress = self.complete(stated)?;
                self.send(tx, [0xA1, 0, 0, 0, 0, 0, 0, 0]);
                Ok(progress)
            }
        }
    }

    fn on_upload_initiated(
        &mut self,
        address: Address,
        message: &Message,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<Progress, AbortCode> {
        if message[0] >> 5 != 2 || wire::address(message) != address {
            return not_initiated(address, message);
        }
        let sized = message[0] & 0x01 != 0;
        if message[0] & 0x02 != 0 {
            let unused = if sized { message[0] >> 2 & 3 } else { 0 };
            self.append(&message[4..8 - usize::from(unused)])?;
            return Ok(Progress::Complete);
        }
        let stated = sized.then_some(wire::word(message) as usize);
        self.check_room(stated)?;
        self.request_segment(stated, false, tx)
    }

    fn request_segment(
        &self,
        stated: Option<usize>,
        toggle: bool,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<Progress, AbortCode> {
        self.send(tx, [0x60 | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0]);
        Ok(Progress::Continues(To::Upload(UploadStep::Segments {
            stated,
            toggle,
        })))
    }

    fn append(&mut self, data: &[u8]) -> Result<(), AbortCode> {
        self.buffer
            .get_mut(self.size..self.size + data.len())
            .ok_or(AbortCode::OutOfMemory)?
            .copy_from_slice(data);
        self.size += data.len();
        Ok(())
    }

    fn check_room(&self, stated: Option<usize>) -> Result<(), AbortCode> {
        match stated {
            Some(size) if size > self.buffer.len() - 7 => Err(AbortCode::OutOfMemory),
            _ => Ok(()),
        }
    }

    /// Whether as much has come as the server had stated.
    fn complete(&self, stated: Option<usize>) -> Result<Progress, AbortCode> {
        match stated {
            Some(size) if size != self.size => Err(AbortCode::LengthMismatch),
            _ => Ok(Progress::Complete),
        }
    }

    fn on_download(
        &mut self,
        step: DownloadStep,
        address: Address,
        message: &Message,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<Progress, AbortCode> {
        match step {
            DownloadStep::Initiate => {
                if message[0] >> 5 != 3 || wire::address(message) != address {
                    return not_initiated(address, message);
                }
                if (1..=4).contains(&self.size) {
                    return Ok(Progress::Complete);
                }
                Ok(self.send_segment(0, false, tx))
            }
            DownloadStep::Segments { sent, toggle } => {
                if message[0] >> 5 != 1 {
                    return wrong(address, message);
                }
                if wire::toggle(message) != toggle {
                    return Err(AbortCode::ToggleBit);
                }
                if sent == self.size {
                    return Ok(Progress::Complete);
                }
                Ok(self.send_segment(sent, !toggle, tx))
            }
            DownloadStep::InitiateBlock => {
                if message[0] & 0xFB != 0xA0 || wire::address(message) != address {
                    return not_initiated(address, message);
                }
                self.send_block(message[0] & 0x04 != 0, 0, 0, message[4], tx)
            }
            DownloadStep::Block {
                crc,
                confirmed,
                sent,
                futile,
            } => {
                let (acknowledged, block_size) = (usize::from(message[1]), message[2]);
                if message[0] != 0xA2 {
                    return wrong(address, message);
                }
                if acknowledged > sent {
                    return Err(AbortCode::SequenceNumber);
                }
                let futile = wire::futile(futile, acknowledged)?;
                let confirmed = confirmed + acknowledged;
                if confirmed < wire::segments(self.size) {
                    return self.send_block(crc, confirmed, futile, block_size, tx);
                }
                self.send(tx, wire::end_of_blocks(&self.buffer[..self.size], crc));
                Ok(Progress::Continues(To::Download(DownloadStep::EndBlock)))
            }
            DownloadStep::EndBlock => match message[0] {
                0xA1 => Ok(Progress::Complete),
                // The last acknowledgement, twice.
                0xA2 => Ok(Progress::Ignored),
                _ => wrong(address, message),
            },
        }
    }

    fn send_segment(
        &self,
        from: usize,
        toggle: bool,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Progress {
        let sent = (from + 7).min(self.size);
        let last = sent == self.size;
        self.send(tx, wire::segment(toggle, &self.buffer[from..sent], last));
        Progress::Continues(To::Download(DownloadStep::Segments { sent, toggle }))
    }

    fn send_block(
        &self,
        crc: bool,
        confirmed: usize,
        futile: u8,
        block_size: u8,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<Progress, AbortCode> {
        if !wire::is_block_size(block_size) {
            return Err(AbortCode::BlockSize);
        }
        let block = wire::block(&self.buffer[..self.size], confirmed, block_size);
        let sent = block.len();
        for message in block {
            self.send(tx, message);
        }
        Ok(Progress::Continues(To::Download(DownloadStep::Block {
            crc,
            confirmed,
            sent,
            futile,
        })))
    }
}

/// An answer that names another object comes late and is ignored; any other is an error.
fn wrong(address: Address, message: &Message) -> Result<Progress, AbortCode> {
    if matches!(message[0] >> 5, 2 | 3) && wire::address(message) != address {
        Ok(Progress::Ignored)
    } else {
        Err(AbortCode::CommandSpecifier)
    }
}

/// Before a transfer's first answer those come late, too, that name no object: they are of an earlier one.
fn not_initiated(address: Address, message: &Message) -> Result<Progress, AbortCode> {
    let names_none = match message[0] >> 5 {
        0 | 1 => true,
        5 => message[0] & 0x03 != 0,
        6 => message[0] & 0x01 != 0,
        _ => false,
    };
    if names_none {
        Ok(Progress::Ignored)
    } else {
        wrong(address, message)
    }
}
