//! `syncline check`: is the input good?

use super::switches::Switches;
use super::{Exit, report};
use crate::budget::MachineBudget;
use crate::control::Layout;
use crate::counted::counted;
use crate::machine::Machine;
use crate::program::{CappedFeeds, Extent, Programs};
use std::error::Error;
use std::path::{Path, PathBuf};
use syncline_gcode::Tables;

/// Check a machine file, and a program for it, and move nothing.
///
/// The machine file: every key, the drives and axes it ties together, and whether its frames fit
/// its cycle. The work offsets and tools that stand beside it (portal.toml: portal.tables.toml):
/// every key. The program: every block, as the machine would execute it from its zero with those,
/// every motion inside the soft limits.
///
/// Good input: exit code 0. Bad input: every mistake of the machine file, else of the tables, else
/// of the program, with file:line:column, what is allowed and what to do; exit code 2.
///
/// Example: syncline check examples/portal/machine.toml examples/portal/bracket.ngc
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file
    machine: PathBuf,
    /// G-code program; `-` is standard input
    program: Option<PathBuf>,
    #[command(flatten)]
    switches: Switches,
}

impl Args {
    /// Prints what the input amounts to, or what is wrong with it.
    pub(super) fn execute(&self) -> Exit {
        match self.check() {
            Ok(()) => Exit::Finished,
            Err(error) => {
                report(&*error);
                Exit::BadInput
            }
        }
    }

    fn check(&self) -> Result<(), Box<dyn Error>> {
        let machine = Machine::load(&self.machine)?;
        let layout = Layout::new(&machine)?;
        Tables::load(&Tables::beside(&self.machine))?;
        describe(&machine, &layout);
        if let Some(program) = &self.program {
            let Some(extent) = self.check_program(&machine, program)? else {
                println!(
                    "program {}: not read: with `--stream` each block is checked as it runs; without it `check` reads the whole program",
                    program.display()
                );
                return Ok(());
            };
            let turned = match extent.turned {
                0.0 => String::new(),
                degrees => format!(", {degrees:.1} ° of turns"),
            };
            println!(
                "program {}: {}, {:.1} mm of path{turned}",
                program.display(),
                counted(extent.blocks, "block", "blocks"),
                extent.length
            );
            if let Some(line) = extent.known_to {
                println!(
                    "from line {line} on checked as it runs: what the program does next hangs on what the machine \
                     finds there"
                );
            }
            let CappedFeeds { moves, line, part } = extent.capped;
            if moves > 0 {
                let moves = counted(
                    moves,
                    "move asks for more than the axes can, and is as fast",
                    "moves ask for more than the axes can, and are as fast",
                );
                println!(
                    "feed: {moves} as these can; line {line} has {:.0} % of its feed",
                    part * 100.0
                );
            }
            let CappedFeeds { moves, line, part } = extent.slowed;
            if moves > 0 {
                let arcs = counted(
                    moves,
                    "arc is slowed down, so that it is left by no more than its mode allows",
                    "arcs are slowed down, so that they are left by no more than their mode allows",
                );
                let percent = part * 100.0;
                // What moves at all is not slowed down to nothing.
                let digits = (0..6).find(|it| percent * 10_f64.powi(*it) >= 1.0);
                let digits = digits.unwrap_or(6) as usize;
                println!(
                    "shaper: {arcs}; line {line} to {percent:.digits$} %: by the square root of its tolerance, which is that \
                     of G64 P, or `exact_tolerance`"
                );
            }
            let (deviation, line) = extent.arc_deviation;
            if deviation > 0.0 {
                println!(
                    "arcs: changed by up to {deviation:.4} mm (line {line}), so that their ends are exact"
                );
            }
        }
        Ok(())
    }

    /// What the program amounts to; nothing of one that is read as it runs.
    fn check_program(
        &self,
        machine: &Machine,
        file: &Path,
    ) -> Result<Option<Extent>, Box<dyn Error>> {
        let programs = Programs::new(machine, &self.machine)?;
        let program = self.switches.program(&programs, file)?;
        let extent = program.check(machine.rest())?;
        if let Some(beginning) = program.beginning(machine.rest())? {
            println!("line {}: {beginning}", beginning.line());
        }
        Ok((!program.streams()).then_some(extent))
    }
}

fn describe(machine: &Machine, layout: &Layout) {
    let axes: Vec<String> = machine
        .axes
        .iter()
        .map(|axis| {
            let drives = axis.drives.iter().map(|drive| &machine.drives[*drive]);
            let drives: Vec<String> = drives
                .map(|drive| format!("{} at node {}", drive.name, drive.node))
                .collect();
            format!("{} ({})", axis.name(), drives.join(" + "))
        })
        .collect();
    println!("machine {}: {}", machine.name, axes.join(", "));
    for bus in &MachineBudget::of(machine).buses {
        let cycle = bus.budget.cycle;
        let [demand, load] = [bus.budget.demand, bus.load_in_motion]
            .map(|taken| 100.0 * taken.as_secs_f64() / cycle.as_secs_f64());
        println!(
            "bus {}: {} kbit/s, cycle {} µs, of which SYNC, PDOs and one other frame take {demand:.0} % in the worst case, all \
             that can come in motion {load:.0} %",
            bus.bus,
            bus.budget.bit_rate / 1000,
            cycle.as_micros(),
        );
    }
    for device in 0..layout.devices.len() {
        println!("{}", layout.supervision(device));
    }
}
