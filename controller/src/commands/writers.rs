//! Files that are written while axes move: each by a thread of its own, behind a bounded queue, so
//! that nobody waits for a disk that is slow or a pipe that nobody reads.

use super::output::Target;
use crossbeam::channel::{self, Receiver, Sender, TrySendError};
use std::io::{self, Write};
use std::mem::take;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// What is handed over at a time, bytes.
const BLOCK: usize = 8192;
/// Blocks that wait at most: 16 MiB, minutes of a trace.
const BLOCKS: usize = 2048;
/// In the end, what takes nothing for so long is given up.
pub(super) const GIVE_UP: Duration = Duration::from_secs(5);

/// The files that are being written.
#[derive(Default)]
pub(super) struct Writers(Vec<Pending>);

struct Pending {
    option: &'static str,
    path: PathBuf,
    counts: Arc<Counts>,
    thread: JoinHandle<io::Result<()>>,
}

/// Bytes of a file.
#[derive(Default)]
struct Counts {
    given: AtomicU64,
    written: AtomicU64,
}

/// A file of which something is missing.
#[derive(Debug, thiserror::Error)]
pub(super) enum NotWritten {
    #[error("{option} is incomplete: {} took no more, {missing} bytes are missing", path.display())]
    Incomplete {
        option: &'static str,
        path: PathBuf,
        missing: u64,
    },
    #[error("{option} is incomplete")]
    Failed {
        option: &'static str,
        source: io::Error,
    },
}

impl Writers {
    /// Begins to write a file.
    pub(super) fn begin(&mut self, target: Target) -> io::Result<Writer> {
        let (option, path) = (target.option(), target.path().to_owned());
        let file = target.emptied()?;
        let (queue, blocks) = channel::bounded(BLOCKS);
        let counts = Arc::<Counts>::default();
        let written = Arc::clone(&counts);
        let thread = thread::Builder::new().name("writer".into());
        self.0.push(Pending {
            option,
            path,
            counts: Arc::clone(&counts),
            thread: thread.spawn(move || write(file, &blocks, &written))?,
        });
        Ok(Writer {
            queue,
            counts,
            block: Vec::new(),
            full: false,
        })
    }

    /// Waits until all is written whose [`Writer`]s are gone, as long as any of it goes on.
    pub(super) fn finish(self) -> Vec<NotWritten> {
        let written = || -> u64 {
            let counts = self.0.iter().map(|it| &it.counts.written);
            counts.map(|it| it.load(Ordering::Relaxed)).sum()
        };
        let mut last = (written(), Instant::now());
        while self.0.iter().any(|it| !it.thread.is_finished()) && last.1.elapsed() < GIVE_UP {
            thread::sleep(Duration::from_millis(5));
            if written() != last.0 {
                last = (written(), Instant::now());
            }
        }
        self.0.into_iter().filter_map(Pending::missing).collect()
    }
}

impl Pending {
    fn missing(self) -> Option<NotWritten> {
        let Self { option, path, .. } = self;
        // One that panicked has said so, and its bytes are missing.
        if self.thread.is_finished()
            && let Ok(Err(source)) = self.thread.join()
        {
            return Some(NotWritten::Failed { option, source });
        }
        let given = self.counts.given.load(Ordering::Relaxed);
        let missing = given - self.counts.written.load(Ordering::Relaxed);
        (missing > 0).then_some(NotWritten::Incomplete {
            option,
            path,
            missing,
        })
    }
}

/// Writes what comes until nothing more does.
fn write(mut file: Target, blocks: &Receiver<Vec<u8>>, counts: &Counts) -> io::Result<()> {
    for block in blocks {
        file.write_all(&block)?;
        (counts.written).fetch_add(block.len() as u64, Ordering::Relaxed);
    }
    file.flush()
}

/// Takes what is to be written, and waits for nobody. Where the queue is full the file ends, behind a
/// whole call of [`Write::write`], and what follows is left out.
pub(super) struct Writer {
    queue: Sender<Vec<u8>>,
    counts: Arc<Counts>,
    block: Vec<u8>,
    full: bool,
}

impl Writer {
    fn hand_over(&mut self) {
        let block = take(&mut self.block);
        if !self.full && !block.is_empty() {
            // Where the thread has ended it tells why.
            self.full = matches!(self.queue.try_send(block), Err(TrySendError::Full(_)));
        }
    }
}

impl Write for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (self.counts.given).fetch_add(bytes.len() as u64, Ordering::Relaxed);
        if !self.full {
            self.block.extend(bytes);
        }
        if self.block.len() >= BLOCK {
            self.hand_over();
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.hand_over();
        Ok(())
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.hand_over();
    }
}
