//! Files that are read: one that does not end, or a line in it, is refused before it fills the memory.
//!
//! Whatever comes from outside is read here. What is small is read as a whole: of a regular file its size says at once
//! whether it is too large, of anything else what comes. What may be long is read by lines, none of which is longer than
//! [`LINE`]; who keeps what they say bounds how much that is.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Bytes of a file that is read as a whole, where its reader knows of no lesser bound.
pub const WHOLE: u64 = 16 << 20;
/// Bytes of a line.
pub const LINE: usize = 1 << 16;

/// A file as a whole.
///
/// # Errors
/// It cannot be read, or is longer than [`WHOLE`].
pub fn read(file: &Path) -> io::Result<Vec<u8>> {
    read_to(file, WHOLE)
}

/// A file as a whole that has so many bytes at most.
///
/// # Errors
/// It cannot be read, or is longer.
pub fn read_to(file: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(file)?;
    let found = file.metadata()?;
    if found.is_file() && found.len() > most {
        let size = found.len();
        return Err(too_large(format!(
            "it has {size} bytes, more than {most}: is it the right file?"
        )));
    }
    whole(file, most)
}

/// A text of lines as a whole.
///
/// # Errors
/// It cannot be read, is no UTF-8, or it is longer than [`WHOLE`] or a line of it than [`LINE`].
pub fn read_lines(file: &Path) -> io::Result<String> {
    text(whole(ShortLines::new(File::open(file)?), WHOLE)?)
}

/// The beginning of a file: so many bytes, or all there are.
///
/// # Errors
/// It cannot be read.
pub fn beginning(file: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(file)?.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Hands on a file of any length, part by part.
///
/// # Errors
/// It cannot be read.
pub fn parts(file: &Path, mut take: impl FnMut(&[u8])) -> io::Result<()> {
    let mut file = BufReader::new(File::open(file)?);
    loop {
        let bytes = file.fill_buf()?;
        if bytes.is_empty() {
            return Ok(());
        }
        take(bytes);
        let count = bytes.len();
        file.consume(count);
    }
}

/// A file of any length, to be read line by line.
///
/// # Errors
/// It cannot be opened; reading fails where a line is longer than [`LINE`].
pub fn lines(file: &Path) -> io::Result<BufReader<ShortLines<File>>> {
    Ok(BufReader::new(ShortLines::new(File::open(file)?)))
}

/// All that comes from a source, so many bytes at most.
///
/// # Errors
/// It cannot be read, or more comes.
pub fn whole(source: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_large(format!(
            "more than {most} bytes: is it the right file?"
        )));
    }
    Ok(bytes)
}

/// The text that bytes are.
pub(crate) fn text(bytes: Vec<u8>) -> io::Result<String> {
    let wrong = |_| {
        io::Error::new(
            io::ErrorKind::InvalidData,
            "stream did not contain valid UTF-8",
        )
    };
    String::from_utf8(bytes).map_err(wrong)
}

pub(crate) fn too_large(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, what)
}

/// Hands on what it reads for as long as no line in it is too long.
#[derive(Debug)]
pub struct ShortLines<R> {
    source: R,
    /// Bytes since the last end of a line.
    length: usize,
}

impl<R: Read> ShortLines<R> {
    /// Of a source at the beginning of a line.
    pub fn new(source: R) -> Self {
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
        assert_eq!(
            error.to_string(),
            "more than 16777216 bytes: is it the right file?"
        );
        let error = read_lines(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "a line of more than 65536 bytes");
    }
}
