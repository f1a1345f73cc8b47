//! Lines of a program's bytes, with the places to come back to that loops and subroutines need.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

/// The longest line that a program may have, in bytes.
pub const MAX_LINE: usize = 4096;

/// The most bytes of one line that are passed over: what has no line ends is no program.
const MAX_PASSED: usize = 1 << 20;

/// What a program is read from. Loops and subroutines go back in it, so it must be able to seek.
pub trait Input: Read + Seek + Send {}

impl<T: Read + Seek + Send> Input for T {}

/// The start of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Bytes in front of it.
    pub(crate) offset: u64,
    /// Number of the line that starts here, from 1.
    pub(crate) line: u32,
}

impl Place {
    pub(crate) const START: Place = Place { offset: 0, line: 1 };
}

/// What reading a line gave.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Read1 {
    /// A line, without its end.
    Line,
    /// A line longer than [`MAX_LINE`]: only its beginning was kept, and the next one comes next.
    TooLong,
    /// There is no further line.
    End,
}

/// Reads lines ended by LF, CR LF or CR, at most [`MAX_LINE`] bytes each, whatever the bytes are.
pub(crate) struct Lines {
    input: BufReader<Box<dyn Input>>,
    next: Place,
}

impl Lines {
    pub(crate) fn new(input: Box<dyn Input>) -> Lines {
        Lines {
            input: BufReader::with_capacity(1 << 16, input),
            next: Place::START,
        }
    }

    /// Where the next line starts.
    pub(crate) fn place(&self) -> Place {
        self.next
    }

    /// Goes to the start of a line.
    pub(crate) fn go_to(&mut self, place: Place) -> io::Result<()> {
        // A loop's start is mostly still in the buffer, which a relative seek keeps.
        match i64::try_from(i128::from(place.offset) - i128::from(self.next.offset)) {
            Ok(distance) => self.input.seek_relative(distance)?,
            Err(_) => {
                self.input.seek(SeekFrom::Start(place.offset))?;
            }
        }
        self.next = place;
        Ok(())
    }

    /// Replaces `line` with the next line's bytes, without the line end.
    pub(crate) fn read(&mut self, line: &mut Vec<u8>) -> io::Result<Read1> {
        line.clear();
        let mut length = 0;
        loop {
            let bytes = match self.input.fill_buf() {
                Ok(bytes) => bytes,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            if bytes.is_empty() {
                if length == 0 {
                    return Ok(Read1::End);
                }
                break;
            }
            let end = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let part = &bytes[..end.unwrap_or(bytes.len())];
            let kept = part.len().min(MAX_LINE - line.len());
            line.extend_from_slice(&part[..kept]);
            let terminator = end.map(|end| bytes[end]);
            let read = part.len();
            length += read;
            if length > MAX_PASSED {
                let text = format!("a line of more than {MAX_PASSED} bytes: is it the right file?");
                return Err(io::Error::new(io::ErrorKind::InvalidData, text));
            }
            match terminator {
                Some(terminator) => {
                    self.consume(read + 1);
                    if terminator == b'\r' && self.input.fill_buf()?.first() == Some(&b'\n') {
                        self.consume(1);
                    }
                    break;
                }
                None => self.consume(read),
            }
        }
        self.next.line = self.next.line.saturating_add(1);
        Ok(if length > MAX_LINE {
            Read1::TooLong
        } else {
            Read1::Line
        })
    }

    fn consume(&mut self, bytes: usize) {
        self.input.consume(bytes);
        self.next.offset += bytes as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn lines(bytes: &'static [u8]) -> Lines {
        Lines::new(Box::new(Cursor::new(bytes)))
    }

    #[test]
    fn every_line_end_counts_once() {
        let mut lines = lines(b"a\nb\r\n\rc");
        let mut line = Vec::new();
        for expected in [&b"a"[..], b"b", b"", b"c"] {
            assert_eq!(lines.read(&mut line).unwrap(), Read1::Line);
            assert_eq!(line, expected);
        }
        assert_eq!(lines.read(&mut line).unwrap(), Read1::End);
        assert_eq!(lines.place().line, 5);
    }

    #[test]
    fn a_place_leads_back() {
        let mut lines = lines(b"a\nbb\nccc\n");
        let mut line = Vec::new();
        lines.read(&mut line).unwrap();
        let place = lines.place();
        lines.read(&mut line).unwrap();
        lines.read(&mut line).unwrap();
        lines.go_to(place).unwrap();
        lines.read(&mut line).unwrap();
        assert_eq!(line, b"bb");
        assert_eq!(lines.place().line, 3);
    }

    #[test]
    fn a_line_without_end_is_cut() {
        let mut bytes = vec![b'x'; MAX_LINE];
        bytes.extend(b"\r\n");
        bytes.extend(vec![b'y'; 20 * MAX_LINE]);
        bytes.extend(b"\nz");
        let mut lines = Lines::new(Box::new(Cursor::new(bytes)));
        let mut line = Vec::new();
        for (read, expected) in [
            (Read1::Line, vec![b'x'; MAX_LINE]),
            (Read1::TooLong, vec![b'y'; MAX_LINE]),
            (Read1::Line, vec![b'z']),
        ] {
            assert_eq!(lines.read(&mut line).unwrap(), read);
            assert_eq!(line, expected);
        }
        assert_eq!(lines.place().line, 4);
    }

    #[test]
    fn what_has_no_line_ends_is_no_program() {
        let mut lines = Lines::new(Box::new(Cursor::new(vec![0; 2 * MAX_PASSED])));
        let error = lines.read(&mut Vec::new()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }
}
