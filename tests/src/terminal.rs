//! A person at a terminal of their own: a shell command, the keys and what stands there.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;

/// A shell command that runs on a terminal.
pub struct Terminal {
    child: Child,
    keys: ChildStdin,
    /// What comes to stand there, read at once: a terminal whose other end is full takes no keys.
    told: Receiver<Vec<u8>>,
    /// What was told and not waited for.
    unread: Vec<u8>,
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
        let keys = child.stdin.take().expect("piped");
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
        }
    }

    /// Types something.
    ///
    /// # Panics
    /// If nobody reads it any more.
    pub fn press(&mut self, keys: &[u8]) {
        self.keys.write_all(keys).expect("somebody listens");
    }

    /// The keyboard, for another thread that types.
    ///
    /// # Panics
    /// If there are too many open files.
    #[must_use]
    pub fn keyboard(&self) -> File {
        let keys = self.keys.as_fd().try_clone_to_owned();
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
            self.unread.extend(self.told.recv().expect(part));
        }
    }

    /// Waits for the command's end, without a word; what it still told.
    ///
    /// # Panics
    /// If it does not end with 0.
    #[must_use]
    pub fn end(mut self) -> Vec<String> {
        drop(self.keys);
        let mut rest = self.unread;
        rest.extend(self.told.iter().flatten());
        let status = self.child.wait().expect("it was started");
        assert!(status.success(), "{status}");
        let rest = String::from_utf8_lossy(&rest);
        rest.lines().map(str::to_owned).collect()
    }
}
