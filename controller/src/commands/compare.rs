//! `syncline compare`: two motions side by side.

use super::Exit;
use super::output::{Claims, Target};
use crate::compare::{Comparison, Motion};
use crate::validate::Inputs;
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Compare two motions, aligned by their path: time and contour by line, how the axes follow, worst places.
///
/// Each is a trace of `run` or `validate` (.csv), a machine file (.toml, with --program), or a program (with
/// --machine), of which the last two are validated first. A recorded run beside its program shows where the
/// simulated machine is wrong, and by how much.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Trace, machine file or program.
    first: PathBuf,
    /// What it is compared with: the same or something else of these.
    second: PathBuf,
    /// Machine file (TOML) on which programs are validated.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Part program (RS-274/NGC) with which machine files are validated.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Another value of a key of the first's machine file, as `validate --set` takes it. May be given again.
    #[arg(long = "set-first", value_name = "KEY=VALUE")]
    of_first: Vec<String>,
    /// The same of the second's: `shaper.kind="zvd"`, `path.mode="G64"`.
    #[arg(long = "set-second", value_name = "KEY=VALUE")]
    of_second: Vec<String>,
    /// Varies what is validated, as `validate --seed` does.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write the comparison as JSON (`-`: to standard output).
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What is compared.
enum Compared<'a> {
    /// A trace, in the file itself.
    Trace,
    /// A run: of which machine file, what was read of it, and of which program.
    Run(&'a Path, Box<Inputs>, &'a Path),
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        match self.compare() {
            Ok(()) => Exit::Finished,
            Err(error) => super::bad_input(&*error),
        }
    }

    fn compare(&self) -> Result<(), Box<dyn Error>> {
        let mut claims = Claims::default()
            .reads("the first", &self.first)
            .reads("the second", &self.second);
        for (what, file) in [("--machine", &self.machine), ("--program", &self.program)] {
            if let Some(file) = file {
                claims = claims.reads(what, file);
            }
        }
        let first = self.compared(&self.first, &self.of_first)?;
        let second = self.compared(&self.second, &self.of_second)?;
        for compared in [&first, &second] {
            if let Compared::Run(machine, inputs, program) = compared {
                claims = claims
                    .reads_machine(machine, &inputs.machine)
                    .reads_program(program);
            }
        }
        let json: Option<Target> = claims.open("--json", &self.json)?;
        let first = self.motion(&self.first, &self.of_first, first)?;
        let second = self.motion(&self.second, &self.of_second, second)?;
        let comparison = Comparison::of(&first, &second)?;
        if let Some(json) = json {
            let mut json = json.begin()?;
            json.write_all((serde_json::to_string_pretty(&comparison)? + "\n").as_bytes())?;
            json.flush()?;
        }
        claims.tell(&comparison.to_string());
        Ok(())
    }

    /// What a file stands for.
    fn compared<'a>(
        &'a self,
        file: &'a Path,
        settings: &[String],
    ) -> Result<Compared<'a>, Box<dyn Error>> {
        let is = |kind: &str| file.extension().is_some_and(|name| name == kind);
        if is("csv") {
            if let [setting, ..] = settings {
                let file = file.display();
                return Err(
                    format!("`{setting}`: {file} is a trace, of which nothing can be set").into(),
                );
            }
            return Ok(Compared::Trace);
        }
        let (machine, program) = if is("toml") {
            let program = self.program.as_deref();
            let missing = || format!("{}: --program names what is run on it", file.display());
            (file, program.ok_or_else(missing)?)
        } else {
            let machine = self.machine.as_deref();
            let missing = || format!("{}: --machine names what it is run on", file.display());
            (machine.ok_or_else(missing)?, file)
        };
        let inputs = Inputs::read(machine, settings, None)?;
        Ok(Compared::Run(machine, Box::new(inputs), program))
    }

    /// What moves in a file, or in the run that it stands for.
    fn motion(
        &self,
        file: &Path,
        settings: &[String],
        compared: Compared<'_>,
    ) -> Result<Motion, Box<dyn Error>> {
        let Compared::Run(_, inputs, program) = compared else {
            return Ok(Motion::read(file)?);
        };
        let program = inputs.programs.file(program);
        let (summary, report) = inputs.validate(program, self.seed, true, |_| true)?;
        let name = [&[file.display().to_string()], settings].concat().join(" ");
        if summary.verdict != "pass" {
            eprintln!(
                "{name} does not pass, and is compared as far as it came: syncline validate says why"
            );
        }
        Ok(Motion::of(name, &report.unwrap_or_default())?)
    }
}
