//! A person at a terminal of their own: a shell command, the keys and what stands there.

use crate::screen::Screen;
use std::fs::File;
use std::io::{Read, Write};
use std::mem::take;
use std::os::fd::AsFd;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

/// How long a person waits for something to come to stand on the screen: also of a host that is busy.
const PATIENCE: Duration = Duration::from_secs(300);

/// A shell command that runs on a terminal.
pub struct Terminal {
    child: Child,
    /// `None` once nobody types any more.
    keys: Option<ChildStdin>,
    /// What comes to stand there, read at once: a terminal whose other end is full takes no keys.
    told: Receiver<Vec<u8>>,
    /// What was told and not waited for.
    unread: Vec<u8>,
    /// What all of it has made of a terminal of 80 columns and 24 rows.
    screen: Screen,
}

impl Terminal {
    /// Runs `line` in the shell.
    ///
    /// # Panics
    /// If util-linux' `script` cannot be run.
    #[must_use]
    pub fn run(line: &str) -> Self {
        let mut child = Command::new("script")
            .args(["-qec", line, "/dev/null"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("script runs");
        let keys = child.stdin.take();
        let mut output = child.stdout.take().expect("piped");
        let (tell, told) = mpsc::channel();
        thread::spawn(move || {
            let mut more = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut more) {
                // Nobody looking is fine.
                let _ = tell.send(more[..count].to_vec());
            }
        });
        let unread = Vec::new();
        Self {
            child,
            keys,
            told,
            unread,
            screen: Screen::new(80, 24),
        }
    }

    /// Types something.
    ///
    /// # Panics
    /// If nobody reads it any more.
    pub fn press(&mut self, keys: &[u8]) {
        let to = self.keys.as_mut().expect("piped");
        to.write_all(keys).expect("somebody listens");
    }

    /// The keyboard, for another thread that types.
    ///
    /// # Panics
    /// If there are too many open files.
    #[must_use]
    pub fn keyboard(&self) -> File {
        let keys = self.keys.as_ref().expect("piped");
        let keys = keys.as_fd().try_clone_to_owned();
        keys.expect("a file more").into()
    }

    /// The next line that comes to stand there.
    ///
    /// # Panics
    /// If the command ends without it.
    pub fn line(&mut self) -> String {
        self.up_to("\n").trim_end().to_owned()
    }

    /// Waits until something is told.
    ///
    /// # Panics
    /// If the command ends without it.
    pub fn wait_for(&mut self, part: &str) {
        self.up_to(part);
    }

    /// Takes what is told up to `part`, that included.
    fn up_to(&mut self, part: &str) -> String {
        loop {
            let places = self.unread.windows(part.len()).enumerate();
            let mut places = places.filter(|(_, at)| *at == part.as_bytes());
            if let Some((place, _)) = places.next() {
                let told = self.unread.drain(..place + part.len());
                return String::from_utf8_lossy(&told.collect::<Vec<_>>()).into_owned();
            }
            let more = self.told.recv().expect(part);
            self.take(&more);
        }
    }

    /// Waits until the screen is so; what stands there then, row by row.
    ///
    /// # Panics
    /// If it does not become so.
    pub fn wait_until(&mut self, is_so: impl Fn(&str) -> bool) -> String {
        let end = Instant::now() + PATIENCE;
        loop {
            let text = self.screen.text();
            if is_so(&text) {
                return text;
            }
            let left = end.saturating_duration_since(Instant::now());
            match self.told.recv_timeout(left) {
                Ok(more) => self.take(&more),
                Err(_) => panic!("in vain:\n{text}"),
            }
        }
    }

    fn take(&mut self, more: &[u8]) {
        self.screen.take(more);
        self.unread.extend(more);
    }

    /// Waits for the command's end, without a word; what it still told.
    ///
    /// # Panics
    /// If it does not end with 0.
    #[must_use]
    pub fn end(mut self) -> Vec<String> {
        self.keys = None;
        let mut rest = take(&mut self.unread);
        rest.extend(self.told.iter().flatten());
        let status = self.child.wait().expect("it was started");
        assert!(status.success(), "{status}");
        let rest = String::from_utf8_lossy(&rest);
        rest.lines().map(str::to_owned).collect()
    }
}

impl Drop for Terminal {
    /// What runs there ends with its terminal, also where a test fails.
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
