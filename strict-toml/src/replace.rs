//! Files that are replaced as a whole: after a power cut there is the old one or the new one.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where the file is written that is to replace `file`.
#[must_use]
pub fn beside(file: &Path) -> PathBuf {
    let mut name = OsString::from(file);
    name.push(".new");
    name.into()
}

/// The folder that a file is in.
#[must_use]
pub fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes a new file in place of one that a power cut has left, or of a link to anywhere.
///
/// # Errors
/// It cannot be made.
pub fn create(new: &Path) -> io::Result<File> {
    match fs::remove_file(new) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    File::create_new(new)
}

/// Puts `text` in place of what is in a file, or makes the file.
///
/// # Errors
/// It cannot be written; then the file is as it was.
pub fn replace(file: &Path, text: &str) -> io::Result<()> {
    let new = beside(file);
    let writer = create(&new)?;
    if let Ok(old) = fs::metadata(file) {
        writer.set_permissions(old.permissions())?;
    }
    put_in_place(file, &new, writer, text.as_bytes())
}

/// Writes what is to stand in a file into a `new` one beside it, and puts that in its place.
///
/// # Errors
/// It cannot be written; then the file is as it was.
pub fn put_in_place(file: &Path, new: &Path, mut writer: File, text: &[u8]) -> io::Result<()> {
    writer.write_all(text)?;
    writer.sync_all()?;
    fs::rename(new, file)?;
    // The rename itself is on disk only when the folder is.
    File::open(folder(file))?.sync_all()
}
