//! The node's side of a transfer: it answers what it is asked, and keeps the state of one transfer.

use super::{
    AbortCode, crc,
    wire::{self, Message},
};
use crate::dictionary::Address;
use crate::{CanId, CobId, Frame, Instant, Transmit, time::Duration};

/// What a [`Server`] gives access to: a node's objects.
pub trait Objects {
    /// Reads an object into `buffer` and returns its length.
    ///
    /// # Errors
    /// Why the upload is refused.
    fn upload(&mut self, address: Address, buffer: &mut [u8]) -> Result<usize, AbortCode>;

    /// Asked before the data of a download come, with their length where the client states it.
    /// Returns how many bytes the object takes at most.
    ///
    /// # Errors
    /// Why the download is refused.
    fn begin_download(&mut self, address: Address, size: Option<usize>)
    -> Result<usize, AbortCode>;

    /// Writes an object.
    ///
    /// # Errors
    /// Why the download is refused.
    fn download(&mut self, address: Address, data: &[u8]) -> Result<(), AbortCode>;
}

/// One SDO server of a node: one transfer at a time between one client and the node's objects.
#[derive(Debug)]
pub struct Server {
    channel: Option<(CobId, CobId)>,
    timeout: Option<Duration>,
    block_size: Option<u8>,
    echo: bool,
    state: State,
    deadline: Option<Instant>,
    /// The object in transfer, with room for a last block segment's unused bytes.
    buffer: Box<[u8]>,
    /// The segment that ended the last block, which may come twice.
    block_end: Message,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    /// Segments to be requested by the client.
    Upload {
        address: Address,
        size: usize,
        sent: usize,
        toggle: bool,
    },
    /// Segments to come from the client, `limit` bytes at most.
    Download {
        address: Address,
        size: Option<usize>,
        limit: usize,
        got: usize,
        toggle: bool,
    },
    /// Blocks to be sent; `confirmed` segments have arrived, `sent` more are on the way; of the last
    /// `futile` blocks nothing arrived.
    BlockUpload {
        address: Address,
        size: usize,
        confirmed: usize,
        sent: usize,
        futile: u8,
        block_size: u8,
        crc: bool,
        step: BlockUploadStep,
    },
    /// Blocks to come; `got` bytes have come in order, `number` segments of them in this block.
    BlockDownload {
        address: Address,
        size: Option<usize>,
        limit: usize,
        got: usize,
        number: u8,
        crc: bool,
        complete: bool,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BlockUploadStep {
    Start,
    Acknowledge,
    End,
}

impl Server {
    /// A server that takes requests on `request` and answers on `response`, for objects of at
    /// most `capacity` bytes, 8 at least, with block transfer.
    #[must_use]
    pub fn new(request: CobId, response: CobId, capacity: usize) -> Self {
        Self {
            channel: Some((request, response)),
            timeout: None,
            block_size: Some(127),
            echo: false,
            state: State::Idle,
            deadline: None,
            buffer: vec![0; capacity.max(8) + 7].into_boxed_slice(),
            block_end: Message::default(),
        }
    }

    /// Refuses block transfer with 0504 0001h.
    #[must_use]
    pub const fn without_block_transfer(mut self) -> Self {
        self.block_size = None;
        self
    }

    /// Asks clients for blocks of `segments` (1…127) instead of 127.
    #[must_use]
    pub fn with_block_size(mut self, segments: u8) -> Self {
        self.block_size = Some(segments.clamp(1, 127));
        self
    }

    /// Repeats the data of an expedited download in its confirmation, where CiA 301 has zeros.
    #[must_use]
    pub const fn with_echo(mut self) -> Self {
        self.echo = true;
        self
    }

    /// Gives up a transfer with 0504 0000h when the client is silent for this long.
    #[must_use]
    pub const fn with_timeout(mut self, timeout: Duration) -> Self {
        self.timeout = Some(timeout);
        self
    }

    /// Moves the server to other identifiers or, with `None`, takes it off the bus (1201h). A transfer
    /// goes on only where the server stays.
    pub fn set_channel(&mut self, channel: Option<(CobId, CobId)>) {
        if self.channel != channel {
            self.channel = channel;
            self.reset();
        }
    }

    /// Whether the server answers on this identifier.
    #[must_use]
    pub fn answers_on(&self, id: CanId) -> bool {
        self.channel
            .is_some_and(|(_, response)| id == response.into())
    }

    /// Forgets a transfer under way without a word.
    pub fn reset(&mut self) {
        self.state = State::Idle;
        self.deadline = None;
    }

    /// Whether a transfer is under way.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.state != State::Idle
    }

    /// Whether frames with that identifier are requests to it.
    pub(crate) fn is_request(&self, id: CanId) -> bool {
        let channel = self.channel;
        channel.is_some_and(|(request, _)| id == CanId::from(request))
    }

    /// When [`Self::poll`] wants to be called.
    #[must_use]
    pub const fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// Gives up a transfer whose client has been silent for too long.
    pub fn poll(&mut self, now: Instant, tx: &mut (impl Transmit + ?Sized)) {
        if self.deadline.is_some_and(|deadline| now >= deadline) {
            let address = self.address();
            self.reset();
            self.send(tx, wire::abort(address, AbortCode::TimedOut));
        }
    }

    /// Serves a frame if it is a request to this server; whether it was.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> bool {
        if !self.is_request(frame.id()) {
            return false;
        }
        // An SDO has 8 bytes; anything else is not one and gets no answer.
        if let Ok(message) = Message::try_from(frame.data()) {
            if let Err((address, code)) = self.serve(&message, objects, tx) {
                self.state = State::Idle;
                self.send(tx, wire::abort(address, code));
            }
            self.deadline = match self.state {
                State::Idle => None,
                _ => self.timeout.map(|timeout| now + timeout),
            };
        }
        true
    }

    fn send(&self, tx: &mut (impl Transmit + ?Sized), message: Message) {
        if let Some((_, response)) = self.channel {
            tx.transmit(Frame::new(response, &message));
        }
    }

    /// The object in transfer.
    fn address(&self) -> Address {
        match self.state {
            State::Idle => Address::default(),
            State::Upload { address, .. }
            | State::Download { address, .. }
            | State::BlockUpload { address, .. }
            | State::BlockDownload { address, .. } => address,
        }
    }

    fn serve(
        &mut self,
        message: &Message,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), (Address, AbortCode)> {
        if message[0] == wire::ABORT {
            self.state = State::Idle;
            return Ok(());
        }
        if let State::BlockDownload {
            address,
            complete: false,
            ..
        } = self.state
        {
            return self
                .block_download_segment(message, tx)
                .map_err(|code| (address, code));
        }
        if let State::BlockDownload { .. } = self.state
            && message == &self.block_end
        {
            // The very last segment, twice.
            return Ok(());
        }
        let addressed = wire::address(message);
        let current = self.address();
        match message[0] >> 5 {
            0 => self
                .download_segment(message, objects, tx)
                .map_err(|code| (current, code)),
            1 => self
                .initiate_download(addressed, message, objects, tx)
                .map_err(|code| (addressed, code)),
            2 => self
                .initiate_upload(addressed, objects, tx)
                .map_err(|code| (addressed, code)),
            3 => self
                .upload_segment(message, tx)
                .map_err(|code| (current, code)),
            5 if message[0] & 0x03 == 0 => self
                .initiate_block_upload(addressed, message, objects, tx)
                .map_err(|code| (addressed, code)),
            5 => self
                .block_upload(message, tx)
                .map_err(|code| (current, code)),
            6 if message[0] & 0x01 == 0 => self
                .initiate_block_download(addressed, message, objects, tx)
                .map_err(|code| (addressed, code)),
            6 => self
                .end_block_download(message, objects, tx)
                .map_err(|code| (current, code)),
            _ => Err((addressed, AbortCode::CommandSpecifier)),
        }
    }

    fn initiate_upload(
        &mut self,
        address: Address,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let capacity = self.buffer.len() - 7;
        let size = objects.upload(address, &mut self.buffer[..capacity])?;
        self.answer_upload(address, size, tx);
        Ok(())
    }

    fn answer_upload(&mut self, address: Address, size: usize, tx: &mut (impl Transmit + ?Sized)) {
        if (1..=4).contains(&size) {
            self.state = State::Idle;
            self.send(tx, wire::expedited(0x40, address, &self.buffer[..size]));
        } else {
            self.state = State::Upload {
                address,
                size,
                sent: 0,
                toggle: false,
            };
            self.send(
                tx,
                wire::message(0x41, address, &(size as u32).to_le_bytes()),
            );
        }
    }

    fn upload_segment(
        &mut self,
        message: &Message,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let State::Upload {
            size, sent, toggle, ..
        } = &mut self.state
        else {
            return Err(AbortCode::CommandSpecifier);
        };
        if wire::toggle(message) != *toggle {
            return Err(AbortCode::ToggleBit);
        }
        let end = (*sent + 7).min(*size);
        let last = end == *size;
        let answer = wire::segment(*toggle, &self.buffer[*sent..end], last);
        *sent = end;
        *toggle = !*toggle;
        if last {
            self.state = State::Idle;
        }
        self.send(tx, answer);
        Ok(())
    }

    fn initiate_download(
        &mut self,
        address: Address,
        message: &Message,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        self.state = State::Idle;
        let sized = message[0] & 0x01 != 0;
        let mut confirmed: &[u8] = &[];
        if message[0] & 0x02 != 0 {
            let size = if sized {
                4 - usize::from(message[0] >> 2 & 3)
            } else {
                objects.begin_download(address, None)?.min(4)
            };
            objects.download(address, &message[4..4 + size])?;
            if self.echo {
                confirmed = &message[4..4 + size];
            }
        } else {
            let size = sized.then_some(wire::word(message) as usize);
            let limit = self.limit(objects.begin_download(address, size)?, size)?;
            self.state = State::Download {
                address,
                size,
                limit,
                got: 0,
                toggle: false,
            };
        }
        self.send(tx, wire::message(0x60, address, confirmed));
        Ok(())
    }

    /// The most bytes to take of a download.
    fn limit(&self, object: usize, size: Option<usize>) -> Result<usize, AbortCode> {
        let capacity = self.buffer.len() - 7;
        match size {
            Some(size) if size > capacity => Err(AbortCode::OutOfMemory),
            Some(size) if size > object => Err(AbortCode::TooLong),
            _ => Ok(object.min(capacity)),
        }
    }

    fn download_segment(
        &mut self,
        message: &Message,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let State::Download {
            address,
            size,
            limit,
            got,
            toggle,
        } = &mut self.state
        else {
            return Err(AbortCode::CommandSpecifier);
        };
        if wire::toggle(message) != *toggle {
            return Err(AbortCode::ToggleBit);
        }
        let data = wire::segment_data(message);
        if *got + data.len() > *limit {
            return Err(AbortCode::TooLong);
        }
        self.buffer[*got..*got + data.len()].copy_from_slice(data);
        *got += data.len();
        let answer = [0x20 | u8::from(*toggle) << 4, 0, 0, 0, 0, 0, 0, 0];
        *toggle = !*toggle;
        if message[0] & 0x01 != 0 {
            if size.is_some_and(|size| size != *got) {
                return Err(AbortCode::LengthMismatch);
            }
            objects.download(*address, &self.buffer[..*got])?;
            self.state = State::Idle;
        }
        self.send(tx, answer);
        Ok(())
    }

    fn initiate_block_upload(
        &mut self,
        address: Address,
        message: &Message,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        if self.block_size.is_none() {
            return Err(AbortCode::CommandSpecifier);
        }
        let (block_size, switch_below) = (message[4], message[5]);
        if !wire::is_block_size(block_size) {
            return Err(AbortCode::BlockSize);
        }
        let capacity = self.buffer.len() - 7;
        let size = objects.upload(address, &mut self.buffer[..capacity])?;
        if switch_below > 0 && size <= usize::from(switch_below) {
            self.answer_upload(address, size, tx);
        } else {
            self.state = State::BlockUpload {
                address,
                size,
                confirmed: 0,
                sent: 0,
                futile: 0,
                block_size,
                crc: message[0] & 0x04 != 0,
                step: BlockUploadStep::Start,
            };
            self.send(
                tx,
                wire::message(0xC6, address, &(size as u32).to_le_bytes()),
            );
        }
        Ok(())
    }

    fn block_upload(
        &mut self,
        message: &Message,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let State::BlockUpload {
            size,
            confirmed,
            sent,
            futile,
            block_size,
            crc,
            step,
            ..
        } = &mut self.state
        else {
            return Err(AbortCode::CommandSpecifier);
        };
        match (*step, message[0]) {
            (BlockUploadStep::Start, 0xA3) => *step = BlockUploadStep::Acknowledge,
            (BlockUploadStep::Acknowledge, 0xA2) => {
                let (acknowledged, next_block_size) = (usize::from(message[1]), message[2]);
                if acknowledged > *sent {
                    return Err(AbortCode::SequenceNumber);
                }
                if !wire::is_block_size(next_block_size) {
                    return Err(AbortCode::BlockSize);
                }
                *futile = wire::futile(*futile, acknowledged)?;
                *confirmed += acknowledged;
                *block_size = next_block_size;
                if *confirmed == wire::segments(*size) {
                    *step = BlockUploadStep::End;
                    let end = wire::end_of_blocks(&self.buffer[..*size], *crc);
                    self.send(tx, end);
                    return Ok(());
                }
            }
            // The last acknowledgement, twice.
            (BlockUploadStep::End, 0xA2) => return Ok(()),
            (BlockUploadStep::End, 0xA1) => {
                self.state = State::Idle;
                return Ok(());
            }
            _ => return Err(AbortCode::CommandSpecifier),
        }
        let (object, from, most) = (&self.buffer[..*size], *confirmed, *block_size);
        let block = wire::block(object, from, most);
        *sent = block.len();
        for message in block {
            self.send(tx, message);
        }
        Ok(())
    }

    fn initiate_block_download(
        &mut self,
        address: Address,
        message: &Message,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let Some(block_size) = self.block_size else {
            return Err(AbortCode::CommandSpecifier);
        };
        self.state = State::Idle;
        let size = (message[0] & 0x02 != 0).then_some(wire::word(message) as usize);
        let limit = self.limit(objects.begin_download(address, size)?, size)?;
        self.state = State::BlockDownload {
            address,
            size,
            limit,
            got: 0,
            number: 0,
            crc: message[0] & 0x04 != 0,
            complete: false,
        };
        self.block_end = Message::default();
        self.send(tx, wire::message(0xA4, address, &[block_size]));
        Ok(())
    }

    fn block_download_segment(
        &mut self,
        message: &Message,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let block_size = self.block_size.unwrap_or(127);
        let State::BlockDownload {
            limit,
            got,
            number,
            complete,
            ..
        } = &mut self.state
        else {
            return Err(AbortCode::CommandSpecifier);
        };
        let (last, this) = (message[0] & 0x80 != 0, message[0] & 0x7F);
        if this == 0 || this > block_size {
            return Err(AbortCode::SequenceNumber);
        }
        if this == *number + 1 {
            if *got >= (*limit).max(1) {
                return Err(AbortCode::TooLong);
            }
            self.buffer[*got..*got + 7].copy_from_slice(&message[1..]);
            *got += 7;
            *number = this;
            *complete = last;
        } else if message == &self.block_end {
            return Ok(());
        }
        // A segment out of order is dropped; the acknowledgement tells where to go on.
        if last || this == block_size {
            let acknowledged = core::mem::take(number);
            self.block_end = wire::end_of_block(message, acknowledged);
            self.send(tx, [0xA2, acknowledged, block_size, 0, 0, 0, 0, 0]);
        }
        Ok(())
    }

    fn end_block_download(
        &mut self,
        message: &Message,
        objects: &mut impl Objects,
        tx: &mut (impl Transmit + ?Sized),
    ) -> Result<(), AbortCode> {
        let State::BlockDownload {
            address,
            size,
            limit,
            got,
            crc,
            complete: true,
            ..
        } = self.state
        else {
            return Err(AbortCode::CommandSpecifier);
        };
        let length = got - usize::from(message[0] >> 2 & 7);
        let data = &self.buffer[..length];
        if crc && crc::crc(data) != u16::from_le_bytes([message[1], message[2]]) {
            return Err(AbortCode::Crc);
        }
        if size.is_some_and(|size| size != length) {
            return Err(AbortCode::LengthMismatch);
        }
        if length > limit {
            return Err(AbortCode::TooLong);
        }
        objects.download(address, data)?;
        self.state = State::Idle;
        self.send(tx, [0xA1, 0, 0, 0, 0, 0, 0, 0]);
        Ok(())
    }
}
