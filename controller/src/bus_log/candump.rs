//! candump's log format: `(1436509052.249713) can0 281#37420000`.

use std::fmt;
use std::time::Duration;
use syncline_canopen::{CanId, Frame};

/// A frame in a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line<'a> {
    /// Since 1970, to a microsecond.
    pub at: Duration,
    /// The interface.
    pub bus: &'a str,
    /// The frame.
    pub frame: Frame,
}

/// Not a line of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotALine {
    /// It has not the parts of one.
    #[error("expected (SECONDS) INTERFACE ID#DATA")]
    Parts,
    /// The time is none.
    #[error("the time is no number of seconds")]
    Time,
    /// The identifier has not 3 or 8 hexadecimal digits, or is too great.
    #[error("the identifier has not 3 or 8 hexadecimal digits")]
    Id,
    /// The data are not 0 to 8 bytes in hexadecimal, or R for a remote request.
    #[error("the data are not 0 to 8 bytes in hexadecimal")]
    Data,
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Rounded up: a frame is not there before its stamp.
        let at = self.at + Duration::from_nanos(999);
        let (seconds, micros) = (at.as_secs(), at.subsec_micros());
        let Self { bus, frame, .. } = self;
        write!(f, "({seconds:010}.{micros:06}) {bus} {frame:?}")
    }
}

impl<'a> Line<'a> {
    /// Reads a line.
    ///
    /// # Errors
    /// It is none.
    pub fn parse(line: &'a str) -> Result<Self, NotALine> {
        let mut parts = line.split_ascii_whitespace();
        let (Some(time), Some(bus), Some(frame)) = (parts.next(), parts.next(), parts.next())
        else {
            return Err(NotALine::Parts);
        };
        let time = time
            .strip_prefix('(')
            .and_then(|time| time.strip_suffix(')'))
            .ok_or(NotALine::Parts)?;
        let (id, data) = frame.split_once('#').ok_or(NotALine::Parts)?;
        Ok(Self {
            at: seconds(time).ok_or(NotALine::Time)?,
            bus,
            frame: self::frame(identifier(id).ok_or(NotALine::Id)?, data).ok_or(NotALine::Data)?,
        })
    }
}

fn seconds(text: &str) -> Option<Duration> {
    let (seconds, fraction) = text.split_once('.')?;
    let digits = |text: &str| text.chars().all(|c| c.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) || fraction.len() > 9 {
        return None;
    }
    let nanos: u32 = format!("{fraction:0<9}").parse().ok()?;
    Some(Duration::new(seconds.parse().ok()?, nanos))
}

fn identifier(text: &str) -> Option<CanId> {
    if !text.chars().all(|c| c.is_ascii_hexdigit()) {
        return None;
    }
    let id = u32::from_str_radix(text, 16).ok()?;
    match text.len() {
        3 => CanId::standard(id as u16),
        8 => CanId::extended(id),
        _ => None,
    }
}

fn frame(id: CanId, data: &str) -> Option<Frame> {
    if let Some(dlc) = data.strip_prefix('R') {
        let dlc = if dlc.is_empty() { 0 } else { dlc.parse().ok()? };
        return Frame::remote(id, dlc);
    }
    let is_hex = data.chars().all(|c| c.is_ascii_hexdigit());
    if !data.len().is_multiple_of(2) || data.len() > 16 || !is_hex {
        return None;
    }
    let mut bytes = [0; 8];
    for (place, byte) in bytes.iter_mut().take(data.len() / 2).enumerate() {
        *byte = u8::from_str_radix(&data[2 * place..2 * place + 2], 16).ok()?;
    }
    Frame::try_new(id, &bytes[..data.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_candump() {
        for line in [
            "(1436509052.249713) vcan0 044#2A366C2BBA",
            "(0000000000.000001) can1 080#",
            "(1436509053.000000) can0 1FFFFFFF#0011223344556677",
            "(1436509053.000000) can0 701#R1",
        ] {
            assert_eq!(Line::parse(line).unwrap().to_string(), line);
        }
        let line = Line::parse("(12.5) can0 7FF#R").unwrap();
        assert_eq!(line.at, Duration::from_millis(12_500));
        assert_eq!(line.frame.dlc(), 0);
    }

    #[test]
    fn what_is_none() {
        for (line, why) in [
            ("", NotALine::Parts),
            ("1.0 can0 123#", NotALine::Parts),
            ("(1.0) can0 123", NotALine::Parts),
            ("(x.0) can0 123#", NotALine::Time),
            ("(1.0) can0 800#", NotALine::Id),
            ("(1.0) can0 12#", NotALine::Id),
            ("(1.0) can0 20000004#", NotALine::Id),
            ("(1.0) can0 123#0", NotALine::Data),
            ("(1.0) can0 123#001122334455667788", NotALine::Data),
            ("(1.0) can0 123##0", NotALine::Data),
            ("(1.0) can0 123#R9", NotALine::Data),
            ("(1.0) can0 123#+1", NotALine::Data),
        ] {
            assert_eq!(Line::parse(line), Err(why), "{line}");
        }
    }
}
