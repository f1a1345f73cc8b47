//! The `syncline` command as a user runs it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::TempDir;

/// The repository.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// The command, built in the profile of the test, to be run in the repository.
#[must_use]
pub fn syncline() -> Command {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    let release = !cfg!(debug_assertions);
    let mut command = Command::new(BINARY.get_or_init(|| build(release)));
    command.current_dir(root());
    command
}

/// Builds the command and says where it is: with the very features of `cargo test --workspace` or
/// of `cargo run --release`, so that after those there is nothing left to do.
///
/// # Panics
/// If it does not build.
#[must_use]
pub fn build(release: bool) -> PathBuf {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(root());
    cargo.args([
        "build",
        "--quiet",
        "--message-format=json",
        "--bin=syncline",
    ]);
    if release {
        cargo.arg("--release");
    } else {
        cargo.args(["--workspace", "--test=machine"]);
    }
    let output = cargo.output().expect("cargo runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let executable = |line: &str| {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        let is_command = message.pointer("/target/name")? == "syncline";
        let executable = message.get("executable")?.as_str()?;
        is_command.then(|| PathBuf::from(executable))
    };
    let mut executables = text(&output.stdout).lines().filter_map(executable);
    executables.next().expect("cargo names the executable")
}

/// What a command printed.
///
/// # Panics
/// If it is no text.
#[must_use]
pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

/// The exit code and both outputs of a command that ended by itself.
///
/// # Panics
/// If a signal ended it.
#[must_use]
pub fn ended(output: &Output) -> (i32, &str, &str) {
    let code = output.status.code().expect("no signal");
    (code, text(&output.stdout), text(&output.stderr))
}

/// A machine of the examples.
#[must_use]
pub fn machine_file(name: &str) -> PathBuf {
    root().join("examples").join(name).join("machine.toml")
}

/// All example programs with their machine files.
#[must_use]
pub fn examples() -> Vec<(PathBuf, PathBuf)> {
    let mut examples = Vec::new();
    for machine in fs::read_dir(root().join("examples")).expect("examples") {
        let file = machine.expect("entry").path().join("machine.toml");
        let folder = fs::read_dir(file.with_file_name("")).expect("examples");
        for entry in folder {
            let program = entry.expect("entry").path();
            if program.extension().is_some_and(|it| it == "ngc") {
                examples.push((file.clone(), program));
            }
        }
    }
    assert!(examples.len() >= 5, "programs for each machine");
    examples.sort();
    examples
}

/// A folder of its own for one test's files.
pub struct Folder(TempDir);

impl Folder {
    /// A new one.
    #[must_use]
    #[allow(clippy::new_without_default)] // it does something
    pub fn new() -> Self {
        Self(TempDir::new().expect("a temporary folder"))
    }

    /// A path in it.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file in it.
    #[must_use]
    pub fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, text).expect("written");
        path
    }

    /// Copies an example's machine file into it, without the tables beside it: no work offsets.
    #[must_use]
    pub fn machine(&self, name: &str) -> PathBuf {
        self.file(&format!("{name}.toml"), &machine_with(name, &[]))
    }

    /// Reads a file in it.
    #[must_use]
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect("written by the command")
    }
}

/// An example's machine file with parts of it replaced.
///
/// # Panics
/// If a part is not there.
#[must_use]
pub fn machine_with(name: &str, replacements: &[(&str, &str)]) -> String {
    let text = fs::read_to_string(machine_file(name)).expect("example");
    replacements.iter().fold(text, |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    })
}
