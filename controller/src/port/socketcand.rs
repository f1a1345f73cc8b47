//! The socketcand protocol in raw mode, as socketcand and python-can speak it: CAN over TCP.
//!
//! ```text
//! server  < hi >
//! client  < open can0 >      server  < ok >
//! client  < rawmode >        server  < ok >
//! client  < send 601 8 40 0 10 0 0 0 0 0 >
//! server  < frame 581 23.424242 4300100092014200 >
//! ```
//!
//! Identifiers are hexadecimal, 3 digits for 11 bits and 8 for 29. A frame without data has two
//! spaces before `>`. There are no remote frames. Clients expect the greeting and the answers each
//! in a segment of its own.

mod server;

pub(crate) use server::Beacon;
pub(super) use server::serve;

use super::PortError;
use super::network::{NetworkBus, Outlet};
use crate::realtime;
use socket2::SockRef;
use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::thread;
use std::time::Duration;
use syncline_canopen::{CanId, Frame};

/// For a connection, and for each step of the greeting.
const TIMEOUT: Duration = Duration::from_secs(10);
/// The longest message of raw mode is far shorter.
const LONGEST: usize = 200;

/// A message of the protocol, without `<` and `>`.
fn send_message(frame: &Frame) -> String {
    let mut text = format!("< send {} {:X} ", identifier(frame.id()), frame.dlc());
    for byte in frame.data() {
        let _ = write!(text, "{byte:x} ");
    }
    if frame.data().is_empty() {
        text.push(' ');
    }
    text.push('>');
    text
}

fn frame_message(frame: &Frame, time: Duration) -> String {
    let mut text = format!(
        "< frame {} {}.{:06} ",
        identifier(frame.id()),
        time.as_secs(),
        time.subsec_micros()
    );
    for byte in frame.data() {
        let _ = write!(text, "{byte:02X}");
    }
    text.push_str(" >");
    text
}

fn identifier(id: CanId) -> String {
    match id {
        CanId::Standard(id) => format!("{id:03X}"),
        CanId::Extended(id) => format!("{id:08X}"),
    }
}

fn parse_identifier(text: &str) -> Option<CanId> {
    let id = u32::from_str_radix(text, 16).ok()?;
    match text.len() {
        8 => CanId::extended(id),
        1..=3 => CanId::standard(id as u16),
        _ => None,
    }
}

/// The frame of a `send` message: words behind the first.
fn parse_send<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Frame> {
    let id = parse_identifier(words.next()?)?;
    let length = usize::from_str_radix(words.next()?, 16).ok()?;
    let data = words
        .map(|word| u8::from_str_radix(word, 16).ok())
        .collect::<Option<Vec<u8>>>()?;
    (data.len() == length).then(|| Frame::try_new(id, &data))?
}

/// The frame of a `frame` message: words behind the first.
fn parse_frame<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Frame> {
    let id = parse_identifier(words.next()?)?;
    let _time: f64 = words.next()?.parse().ok()?;
    let text = words.next().unwrap_or_default();
    if !text.len().is_multiple_of(2) || !text.is_ascii() {
        return None;
    }
    let bytes = (0..text.len()).step_by(2);
    let data = bytes
        .map(|at| u8::from_str_radix(&text[at..at + 2], 16).ok())
        .collect::<Option<Vec<u8>>>()?;
    Frame::try_new(id, &data)
}

/// Cuts a byte stream into messages.
#[derive(Default)]
struct Messages {
    text: String,
}

impl Messages {
    /// Takes bytes; hands over the inside of every complete message, trimmed.
    fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(&str)) {
        self.text.push_str(&String::from_utf8_lossy(bytes));
        while let Some(end) = self.text.find('>') {
            let message: String = self.text.drain(..=end).collect();
            if let Some(start) = message.rfind('<') {
                sink(message[start + 1..message.len() - 1].trim());
            }
        }
        if self.text.len() > LONGEST {
            self.text.clear();
        }
    }
}

/// Any stream, in pieces of any length: little of it is kept, and what is a frame is the same frame when it
/// is sent on.
#[cfg(fuzzing)]
pub fn fuzz<'a>(pieces: impl Iterator<Item = &'a [u8]>) {
    fn inside(message: &str) -> impl Iterator<Item = &str> {
        let words = message.trim_matches(['<', '>']).split_ascii_whitespace();
        words.skip(1)
    }
    let mut messages = Messages::default();
    for piece in pieces {
        messages.push(piece, |message| {
            let time = Duration::from_secs(1);
            if let Some(frame) = parse_frame(inside(message)) {
                let again = frame_message(&frame, time);
                assert_eq!(parse_frame(inside(&again)), Some(frame), "{again}");
            }
            if let Some(frame) = parse_send(inside(message)) {
                let again = send_message(&frame);
                assert_eq!(parse_send(inside(&again)), Some(frame), "{again}");
            }
        });
        assert!(
            messages.text.len() <= LONGEST,
            "{} bytes",
            messages.text.len()
        );
    }
}

/// Connects to a socketcand server and opens one of its buses in raw mode.
///
/// # Errors
/// Nobody listens there, or it has no such bus.
pub(super) fn connect(name: &str, address: &str, bus: &str) -> Result<NetworkBus, PortError> {
    let fail = |error: io::Error| PortError {
        bus: name.to_owned(),
        what: match error.kind() {
            // It answers, though not as it would where it had such a bus.
            io::ErrorKind::InvalidData => format!("the server does not open it: {error}"),
            _ => format!("cannot connect: {error}: is a server running there?"),
        },
    };
    let mut stream = greet(address, bus).map_err(fail)?;
    let outlet = stream.try_clone().map_err(fail)?;
    let (inlet, frames) = NetworkBus::inlet();
    thread::spawn(move || {
        read_messages(&mut stream, &mut Messages::default(), |message| {
            let mut words = message.split_ascii_whitespace();
            if words.next() == Some("frame")
                && let Some(frame) = parse_frame(words)
            {
                // A full channel loses the frame; a closed one ends with the connection.
                let _ = inlet.try_send((realtime::now(), frame));
            }
        });
    });
    Ok(NetworkBus::new(
        name.to_owned(),
        frames,
        Box::new(Client {
            stream: outlet,
            rest: Vec::new(),
        }),
    ))
}

fn greet(address: &str, bus: &str) -> io::Result<TcpStream> {
    let address = resolve(address)?;
    let mut stream = TcpStream::connect_timeout(&address, TIMEOUT)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(TIMEOUT))?;
    expect(&mut stream, "hi")?;
    stream.write_all(format!("< open {bus} >").as_bytes())?;
    expect(&mut stream, "ok")?;
    stream.write_all(b"< rawmode >")?;
    expect(&mut stream, "ok")?;
    stream.set_read_timeout(None)?;
    Ok(stream)
}

fn resolve(address: &str) -> io::Result<SocketAddr> {
    let mut addresses = address.to_socket_addrs()?;
    let none = || io::Error::new(io::ErrorKind::NotFound, "no such host");
    addresses.next().ok_or_else(none)
}

/// Reads one message, byte by byte: what follows belongs to the next reader.
fn expect(stream: &mut TcpStream, wanted: &str) -> io::Result<()> {
    let mut text = String::new();
    while !text.ends_with('>') && text.len() < LONGEST {
        let mut byte = [0];
        stream.read_exact(&mut byte)?;
        text.push(char::from(byte[0]));
    }
    if text == format!("< {wanted} >") {
        return Ok(());
    }
    let what = format!("expected `< {wanted} >`, got `{text}`");
    Err(io::Error::new(io::ErrorKind::InvalidData, what))
}

/// Reads until the other side closes.
fn read_messages(stream: &mut TcpStream, messages: &mut Messages, mut sink: impl FnMut(&str)) {
    let mut bytes = [0; 4096];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) => return,
            Ok(count) => messages.push(&bytes[..count], &mut sink),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

struct Client {
    stream: TcpStream,
    /// What the connection has not taken yet of the last frames, which may end inside a message.
    rest: Vec<u8>,
}

impl Client {
    /// Writes as much of the rest as the connection takes now; a server that does not read is
    /// not to stop a cycle.
    fn flush(&mut self) -> io::Result<()> {
        while !self.rest.is_empty() {
            let flags = libc::MSG_DONTWAIT | libc::MSG_NOSIGNAL;
            let sent = SockRef::from(&self.stream).send_with_flags(&self.rest, flags)?;
            self.rest.drain(..sent);
        }
        Ok(())
    }
}

impl Outlet for Client {
    fn write(&mut self, frames: &[Frame]) -> io::Result<()> {
        self.flush()?;
        for frame in frames.iter().filter(|frame| !frame.is_remote()) {
            self.rest.extend_from_slice(send_message(frame).as_bytes());
        }
        match self.flush() {
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frames() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![
            (0u16..=0x7FF).prop_map(CanId::Standard),
            (0u32..=0x1FFF_FFFF).prop_map(CanId::Extended),
        ];
        let data = proptest::collection::vec(any::<u8>(), 0..=8);
        (id, data).prop_map(|(id, data)| Frame::new(id, &data))
    }

    fn words(message: &str) -> impl Iterator<Item = &str> {
        let inside = message.trim_start_matches('<').trim_end_matches('>');
        inside.split_ascii_whitespace().skip(1)
    }

    proptest! {
        #[test]
        fn messages_carry_frames(frame in frames()) {
            prop_assert_eq!(parse_send(words(&send_message(&frame))), Some(frame));
            let message = frame_message(&frame, Duration::from_micros(23_424_242));
            prop_assert_eq!(parse_frame(words(&message)), Some(frame));
        }

        #[test]
        fn nothing_that_arrives_panics(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            Messages::default().push(&bytes, |message| {
                let mut words = message.split_ascii_whitespace();
                words.next();
                let _ = parse_send(words.clone());
                let _ = parse_frame(words);
            });
        }

        #[test]
        fn a_stream_may_be_cut_anywhere(frame in frames(), cut in 0usize..40) {
            let text = send_message(&frame).repeat(2);
            let (one, other) = text.split_at(cut.min(text.len()));
            let mut messages = Messages::default();
            let mut count = 0;
            for part in [one, other] {
                messages.push(part.as_bytes(), |_| count += 1);
            }
            prop_assert_eq!(count, 2);
        }
    }

    #[test]
    fn the_protocol_to_the_letter() {
        let request = Frame::new(CanId::Standard(0x601), &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
        assert_eq!(send_message(&request), "< send 601 8 40 0 10 0 0 0 0 0 >");
        let sync = Frame::new(CanId::Standard(0x80), &[]);
        let time = Duration::from_micros(23_424_242);
        assert_eq!(frame_message(&sync, time), "< frame 080 23.424242  >");
        assert_eq!(send_message(&sync), "< send 080 0  >");
        let extended = Frame::new(CanId::Extended(0x123), &[0xAB]);
        assert_eq!(
            frame_message(&extended, time),
            "< frame 00000123 23.424242 AB >"
        );
    }
}
