//! What `run` and `validate` leave in files.

use crate::report::Report;
use crate::run::recorder::Summary;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A result that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", file.display())]
pub(super) struct WriteError {
    file: PathBuf,
    source: io::Error,
}

/// Where results go.
#[derive(Debug, clap::Args)]
pub(super) struct Output {
    /// Write the result as JSON (`-`: to standard output).
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write setpoint and actual position of every cycle as CSV.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Write a report as one self-contained HTML file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl Output {
    pub(super) fn wants_report(&self) -> bool {
        self.report.is_some()
    }

    pub(super) fn json_to_stdout(&self) -> bool {
        self.json.as_deref() == Some(Path::new("-"))
    }

    /// Makes sure, before anything moves, that every file can be written.
    pub(super) fn probe(&self) -> Result<(), WriteError> {
        let files = [&self.json, &self.trace, &self.report];
        for file in files.into_iter().flatten() {
            if file != Path::new("-") {
                let opened = File::options().append(true).create(true).open(file);
                opened.map_err(|source| error(file, source))?;
            }
        }
        Ok(())
    }

    /// The trace's file.
    pub(super) fn trace(&self) -> Result<Option<Box<dyn Write>>, WriteError> {
        let Some(file) = &self.trace else {
            return Ok(None);
        };
        match File::create(file) {
            Ok(opened) => Ok(Some(Box::new(BufWriter::new(Named::new(file, opened))))),
            Err(source) => Err(error(file, source)),
        }
    }

    /// Writes JSON and report.
    pub(super) fn write(
        &self,
        summary: &Summary,
        report: Option<Report>,
        program: &Path,
        mode: String,
    ) -> Result<(), WriteError> {
        if let Some(file) = &self.json {
            let mut text = serde_json::to_string_pretty(summary)
                .map_err(|source| error(file, source.into()))?;
            text.push('\n');
            let written = if self.json_to_stdout() {
                io::stdout().write_all(text.as_bytes())
            } else {
                fs::write(file, text)
            };
            written.map_err(|source| error(file, source))?;
        }
        if let (Some(file), Some(mut report)) = (&self.report, report) {
            report.program = program.display().to_string();
            report.mode = mode;
            fs::write(file, report.to_html()).map_err(|source| error(file, source))?;
        }
        Ok(())
    }
}

/// A file that is named where it cannot be written on.
pub(super) struct Named {
    path: PathBuf,
    file: File,
}

impl Named {
    pub(super) fn new(path: &Path, file: File) -> Self {
        let path = path.to_owned();
        Self { path, file }
    }

    fn name<T>(&self, written: io::Result<T>) -> io::Result<T> {
        written.map_err(|source| {
            let text = format!("cannot write {}: {source}", self.path.display());
            io::Error::new(source.kind(), text)
        })
    }
}

impl Write for Named {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes);
        self.name(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.file.flush();
        self.name(flushed)
    }
}

fn error(file: &Path, source: io::Error) -> WriteError {
    WriteError {
        file: file.to_owned(),
        source,
    }
}
