//! What commands write: each file is opened before a command does anything else, and emptied only
//! when it is written.

use super::origin::Origin;
use super::writers::Writers;
use crate::machine::{Machine, MachineState};
use crate::observe::record::Report;
use crate::observe::summary::Summary;
use crate::observe::trace::Sink;
use std::error::Error;
use std::fs::{self, File, Metadata};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};
use syncline_gcode::Tables;

/// The option for JSON.
const JSON: &str = "--json";

/// For so long a pipe may have no reader before a command begins, and between two looks whether it has one.
const READER: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_millis(20);

/// Why a command does not begin.
#[derive(Debug, thiserror::Error)]
pub(super) enum NoOutput {
    #[error("cannot write {}", file.display())]
    CannotWrite { file: PathBuf, source: io::Error },
    #[error("{0} and {1} both go to standard output: give one of them a file")]
    Stdout(&'static str, &'static str),
    #[error("{first} and {second} are both {}: give each a file of its own", file.display())]
    Same {
        first: &'static str,
        second: &'static str,
        file: PathBuf,
    },
}

/// The files beside a program that it can call.
pub(super) fn callable(program: &Path) -> Vec<PathBuf> {
    let folder = program.parent().filter(|it| !it.as_os_str().is_empty());
    // A folder that cannot be read holds nothing that can be called.
    let beside = fs::read_dir(folder.unwrap_or(Path::new("."))).into_iter();
    let beside = beside.flatten().flatten().map(|entry| entry.path());
    beside
        .filter(|it| it.extension().is_some_and(|it| it == "ngc"))
        .collect()
}

/// What the files of a command are for: none may be written over by another.
#[derive(Default)]
pub(super) struct Claims {
    taken: Vec<(&'static str, Place)>,
}

/// A standard stream.
#[derive(Clone, Copy)]
pub(super) enum Stream {
    /// Standard output.
    Output,
    /// Standard error.
    Error,
}

impl Stream {
    /// Prints to it.
    pub(super) fn print(self, text: &str) {
        match self {
            Self::Output => print!("{text}"),
            Self::Error => eprint!("{text}"),
        }
    }
}

#[derive(PartialEq, Eq)]
enum Place {
    Stdout,
    /// Device and number on it.
    File(u64, u64),
    /// Nothing is there yet.
    Free(PathBuf),
}

impl Place {
    /// `None` for devices, which many may write to.
    fn of(file: &Metadata) -> Option<Self> {
        let kind = file.file_type();
        (kind.is_file() || kind.is_fifo()).then(|| Self::File(file.dev(), file.ino()))
    }

    /// Of a file that may yet come to be.
    fn free(file: &Path) -> Option<Self> {
        let folder = file.parent().filter(|it| !it.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(Self::Free(folder.join(file.file_name()?)))
    }
}

impl Claims {
    /// What goes to standard output whatever the options say.
    pub(super) fn stdout(what: &'static str) -> Self {
        Self {
            taken: vec![(what, Place::Stdout)],
        }
    }

    /// For a machine in a file.
    pub(super) fn of_machine(file: &Path, machine: &Machine) -> Self {
        Self::default().reads_machine(file, machine)
    }

    /// For a program on a machine: nor are the program and the files beside it that it can call.
    pub(super) fn of_run(file: &Path, machine: &Machine, program: &Path) -> Self {
        Self::of_machine(file, machine).reads_program(program)
    }

    /// A machine: its file is not to be written over, nor is what it names, nor are the tables and its state, be they
    /// there or to be made.
    pub(super) fn reads_machine(self, file: &Path, machine: &Machine) -> Self {
        self.reads("the machine file", file)
            .reads("the tables", &Tables::beside(file))
            .reads("the machine's state", &MachineState::beside(file))
            .reads_named(machine.named_files())
    }

    /// What a machine file names.
    pub(super) fn reads_named(self, files: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        files.into_iter().fold(self, |claims, file| {
            claims.reads("a file that the machine file names", file.as_ref())
        })
    }

    /// A program, and the files beside it that it can call.
    pub(super) fn reads_program(self, program: &Path) -> Self {
        let claims = self.reads("the program", program);
        callable(program).iter().fold(claims, |claims, file| {
            claims.reads("a program that can be called", file)
        })
    }

    /// For a sweep: its own files are not to be written over.
    pub(super) fn keeps_sweep(self, files: impl Iterator<Item = PathBuf>) -> Self {
        files.fold(self, |claims, file| {
            claims.reads("a file of the sweep", &file)
        })
    }

    /// Something that is read, and so is not to be written over.
    pub(super) fn reads(mut self, what: &'static str, file: &Path) -> Self {
        let place = match file.metadata() {
            Ok(found) => Place::of(&found),
            Err(_) => Place::free(file),
        };
        self.taken.extend(place.map(|place| (what, place)));
        self
    }

    /// Where a result for people is printed: to standard error where standard output is a file's.
    /// Nowhere where JSON is there, which says it all.
    pub(super) fn stream(&self) -> Option<Stream> {
        let mut taken = self.taken.iter();
        match taken.find(|(_, place)| *place == Place::Stdout) {
            None => Some(Stream::Output),
            Some((JSON, _)) => None,
            Some(_) => Some(Stream::Error),
        }
    }

    /// Prints a result for people.
    pub(super) fn tell(&self, text: &str) {
        if let Some(stream) = self.stream() {
            stream.print(text);
        }
    }

    /// Opens an option's file, if there is one.
    pub(super) fn open(
        &mut self,
        option: &'static str,
        file: &Option<PathBuf>,
    ) -> Result<Option<Target>, NoOutput> {
        let file = file.as_deref();
        file.map(|file| self.target(option, file)).transpose()
    }

    /// Opens an option's file.
    pub(super) fn target(&mut self, option: &'static str, file: &Path) -> Result<Target, NoOutput> {
        let cannot = |source| NoOutput::CannotWrite {
            file: file.to_owned(),
            source,
        };
        let stdout = file == Path::new("-");
        let (target, places) = if stdout {
            (Target::stdout(option), [Some(Place::Stdout), None])
        } else {
            let target = Target::open(option, file).map_err(cannot)?;
            let place = Place::of(&target.metadata().map_err(cannot)?);
            // The file behind a link, which is there now.
            let real = place.as_ref().and_then(|_| file.canonicalize().ok());
            (target, [place, real.as_deref().and_then(Place::free)])
        };
        for place in places.into_iter().flatten() {
            let before = self.taken.iter().find(|(_, taken)| *taken == place);
            if let Some((before, _)) = before {
                return Err(if stdout {
                    NoOutput::Stdout(before, option)
                } else {
                    NoOutput::Same {
                        first: before,
                        second: option,
                        file: file.to_owned(),
                    }
                });
            }
            self.taken.push((option, place));
        }
        Ok(target)
    }
}

/// A file that can be written, or standard output. Its errors name it. What is in the file stays
/// until its writing begins; one that was not there, and that nothing is written to, goes again.
pub(super) struct Target {
    option: &'static str,
    path: PathBuf,
    file: Option<File>,
    /// What was made for this, while nothing is in it: of a link to nowhere what it leads to.
    made: Option<PathBuf>,
}

impl Target {
    fn stdout(option: &'static str) -> Self {
        Self {
            option,
            path: "standard output".into(),
            file: None,
            made: None,
        }
    }

    fn open(option: &'static str, path: &Path) -> io::Result<Self> {
        let new = File::options().write(true).create_new(true).open(path);
        let (file, made) = match new {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                if path.metadata().is_ok_and(|it| it.file_type().is_fifo()) {
                    let file = open_pipe(path)?;
                    return Ok(Self {
                        option,
                        path: path.to_owned(),
                        file: Some(file),
                        made: None,
                    });
                }
                let leads_nowhere = !path.exists();
                let mut there = File::options();
                there.write(true).create(true).truncate(false);
                let file = there.open(path)?;
                let made = leads_nowhere.then(|| path.canonicalize()).transpose()?;
                (file, made)
            }
            new => (new?, Some(path.to_owned())),
        };
        Ok(Self {
            option,
            path: path.to_owned(),
            file: Some(file),
            made,
        })
    }

    fn metadata(&self) -> io::Result<Metadata> {
        self.file.as_ref().map_or_else(
            || Err(io::ErrorKind::Unsupported.into()),
            |file| file.metadata(),
        )
    }

    /// The option that named it.
    pub(super) fn option(&self) -> &'static str {
        self.option
    }

    /// As it was named.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The file, to be written from now on.
    pub(super) fn begin(self) -> io::Result<BufWriter<Self>> {
        Ok(BufWriter::new(self.emptied()?))
    }

    /// The file with nothing in it, and no buffer before it.
    pub(super) fn emptied(mut self) -> io::Result<Self> {
        self.made = None;
        let emptied = match &self.file {
            Some(file) if file.metadata().is_ok_and(|it| it.is_file()) => file.set_len(0),
            _ => Ok(()),
        };
        self.name(emptied)?;
        Ok(self)
    }

    /// Writes all there is to write.
    pub(super) fn put(self, text: &str) -> io::Result<()> {
        let mut file = self.begin()?;
        file.write_all(text.as_bytes())?;
        file.flush()
    }

    fn name<T>(&self, written: io::Result<T>) -> io::Result<T> {
        written.map_err(|source| {
            let text = format!("cannot write {}: {source}", self.path.display());
            io::Error::new(source.kind(), text)
        })
    }
}

/// Opens a named pipe once somebody reads it, which the kernel would wait for without an end.
fn open_pipe(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    options.write(true).custom_flags(libc::O_NONBLOCK);
    let began = Instant::now();
    let mut is_told = false;
    loop {
        let opened = options.open(path);
        let nobody_reads = |error: &io::Error| error.raw_os_error() == Some(libc::ENXIO);
        match opened {
            Ok(file) => {
                // From here on a slow reader is waited for.
                rustix::io::ioctl_fionbio(&file, false)?;
                return Ok(file);
            }
            Err(error) if !nobody_reads(&error) => return Err(error),
            Err(_) if began.elapsed() > READER => {
                let what = format!(
                    "it is a pipe that nobody reads, for {} s: start its reader first",
                    READER.as_secs()
                );
                return Err(io::Error::new(io::ErrorKind::NotConnected, what));
            }
            Err(_) => {}
        }
        if !is_told {
            eprintln!("waits for a reader of {}", path.display());
            is_told = true;
        }
        thread::sleep(LOOK);
    }
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.file {
            Some(file) => file.write(bytes),
            None => io::stdout().write(bytes),
        };
        self.name(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = match &mut self.file {
            Some(file) => file.flush(),
            None => io::stdout().flush(),
        };
        self.name(flushed)
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        if let Some(made) = &self.made {
            // It is empty: no loss if it stays.
            let _ = std::fs::remove_file(made);
        }
    }
}

/// Where the results of `run` and `validate` go.
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

/// The files of an [`Output`].
pub(super) struct Results {
    json: Option<Target>,
    trace: Option<Target>,
    report: Option<Target>,
    origin: Option<Origin>,
}

impl Output {
    /// Where the result goes as JSON.
    pub(super) fn json(&self) -> &Option<PathBuf> {
        &self.json
    }

    /// Where the run is from that begins now, if what tells it is wanted.
    pub(super) fn origin(&self, file: &Path, machine: &Machine, program: &Path) -> Option<Origin> {
        let with_source = self.report.is_some();
        let told = with_source || self.json.is_some();
        told.then(|| Origin::now(file, machine, program, with_source))
    }

    /// Opens the files, of a run from there.
    pub(super) fn open(
        &self,
        claims: &mut Claims,
        origin: Option<Origin>,
    ) -> Result<Results, NoOutput> {
        Ok(Results {
            json: claims.open(JSON, &self.json)?,
            trace: claims.open("--trace", &self.trace)?,
            report: claims.open("--report", &self.report)?,
            origin,
        })
    }
}

impl Results {
    pub(super) fn wants_report(&self) -> bool {
        self.report.is_some()
    }

    /// The trace, to be written at once.
    pub(super) fn trace(&mut self) -> io::Result<Option<Sink>> {
        let trace = self.trace.take().map(Target::begin).transpose()?;
        Ok(trace.map(|trace| Box::new(trace) as Sink))
    }

    /// The trace, to be written beside the motion.
    pub(super) fn trace_by(&mut self, writers: &mut Writers) -> io::Result<Option<Sink>> {
        let trace = self.trace.take().map(|file| writers.begin(file));
        Ok(trace.transpose()?.map(|trace| Box::new(trace) as Sink))
    }

    /// Writes JSON and report, with where they are from; `begin` begins a file.
    pub(super) fn write<W: Write>(
        self,
        summary: &mut Summary,
        report: Option<Report>,
        program: &Path,
        mode: String,
        mut begin: impl FnMut(Target) -> io::Result<W>,
    ) -> Result<(), Box<dyn Error>> {
        let mut put = |target: Target, text: String| {
            let mut file = begin(target)?;
            file.write_all(text.as_bytes())?;
            file.flush()
        };
        let (provenance, source) = self.origin.map(|it| (it.provenance, it.source)).unzip();
        summary.provenance = provenance;
        if let Some(json) = self.json {
            put(json, serde_json::to_string_pretty(summary)? + "\n")?;
        }
        if let (Some(file), Some(mut report)) = (self.report, report) {
            report.program = program.display().to_string();
            report.mode = mode;
            report.source = source.unwrap_or_default();
            put(file, report.to_html(Some(summary)))?;
        }
        Ok(())
    }
}
