//! A person at a terminal of their own: a shell command, the keys and what stands there.

use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A shell command that runs on a terminal.
pub struct Terminal {
    child: Child,
    keys: ChildStdin,
    told: Lines<BufReader<ChildStdout>>,
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
        let told = BufReader::new(child.stdout.take().expect("piped")).lines();
        Self { child, keys, told }
    }

    /// Types something.
    ///
    /// # Panics
    /// If nobody reads it any more.
    pub fn press(&mut self, keys: &[u8]) {
        self.keys.write_all(keys).expect("somebody listens");
    }

    /// The next line that comes to stand there.
    pub fn line(&mut self) -> Option<String> {
        self.told.next().map(|line| line.expect("text"))
    }

    /// Waits until something is told.
    ///
    /// # Panics
    /// If the command ends without it.
    pub fn wait_for(&mut self, part: &str) {
        while !self.line().expect(part).contains(part) {}
    }

    /// Waits for the command's end, without a word; what it still told.
    ///
    /// # Panics
    /// If it does not end with 0.
    #[must_use]
    pub fn end(mut self) -> Vec<String> {
        drop(self.keys);
        let rest = self.told.map(|line| line.expect("text")).collect();
        let status = self.child.wait().expect("it was started");
        assert!(status.success(), "{status}");
        rest
    }
}
