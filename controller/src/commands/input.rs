//! What commands read: a file that does not end, or a line in it, is refused before it fills the
//! memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Bytes of a file that is read as a whole.
const WHOLE: u64 = 16 << 20;
/// Bytes of a line.
const LINE: usize = 1 << 16;

/// A file as a whole.
pub(super) fn read(file: &Path) -> io::Result<Vec<u8>> {
    whole(File::open(file)?)
}

/// The lines of a file as a whole.
pub(super) fn read_lines(file: &Path) -> io::Result<String> {
    let bytes = whole(ShortLines::new(File::open(file)?))?;
    String::from_utf8(bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

fn whole(source: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(WHOLE + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > WHOLE {
        return Err(too_large(format!("more than {WHOLE} bytes")));
    }
    Ok(bytes)
}

fn too_large(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, what)
}

/// Hands on what it reads for as long as no line in it is too long.
pub(super) struct ShortLines<R> {
    source: R,
    /// Bytes since the last end of a line.
    length: usize,
}

impl<R: Read> ShortLines<R> {
    pub(super) fn new(source: R) -> Self {
        Self { source, length: 0 }
    }
}

impl<R: Read> Read for ShortLines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(buffer)?;
        for part in buffer[..count].split_inclusive(|&byte| byte == b'\n') {
            self.length += part.len();
            if self.length > LINE {
                return Err(too_large(format!("a line of more than {LINE} bytes")));
            }
            if part.ends_with(b"\n") {
                self.length = 0;
            }
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_files_are_bounded() {
        let read_all = |text: &[u8]| {
            let mut bytes = Vec::new();
            let read = ShortLines::new(text).read_to_end(&mut bytes);
            read.map(|_| bytes.len())
        };
        let full = [vec![b'x'; LINE - 1], vec![b'\n']].concat().repeat(3);
        assert_eq!(read_all(&full).unwrap(), 3 * LINE);
        let error = read_all(&[b'x'; LINE + 1]).unwrap_err();
        assert_eq!(error.to_string(), "a line of more than 65536 bytes");
        let error = read(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "more than 16777216 bytes");
        let error = read_lines(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "a line of more than 65536 bytes");
    }
}
