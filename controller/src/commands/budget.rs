//! `syncline budget`: does this machine's traffic fit its cycle?

use super::{Exit, report};
use crate::budget::{BusBudget, MachineBudget};
use crate::machine::Machine;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Duration;
use syncline_canopen::budget::{Direction, Verdict};

/// Tell whether a machine's frames fit its cycle, with the arithmetic.
///
/// For each bus: SYNC, all PDOs and one blocking frame at their worst-case lengths against the
/// cycle, when each T_PDO has come and each R_PDO begins at the latest against its deadline, when in
/// the cycle the setpoints leave, what is left for SDO, and how full a cycle can get. Fits: exit code 0, with a warning above 80 % of the
/// cycle. Does not fit: exit code 1, with the least cycle that does and what two buses would give.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file
    machine: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Prints the budget.
    pub(super) fn execute(&self) -> Exit {
        let machine = match Machine::load(&self.machine) {
            Ok(machine) => machine,
            Err(error) => {
                report(&error);
                return Exit::BadInput;
            }
        };
        let budget = MachineBudget::of(&machine);
        let check = budget.check();
        if self.json {
            println!(
                "{:#}",
                json!({
                    "fits": check.is_ok(),
                    "setpoint_offset_us": micros(budget.setpoint_offset),
                    "latest_burst_us": micros(budget.latest_burst),
                    "buses": budget.buses.iter().map(bus_json).collect::<Vec<_>>(),
                })
            );
        } else {
            for bus in &budget.buses {
                println!("{bus}");
            }
        }
        match check {
            Ok(()) => Exit::Finished,
            Err(refused) => {
                report(&refused);
                Exit::Stopped
            }
        }
    }
}

fn micros(time: Duration) -> f64 {
    time.as_nanos() as f64 / 1e3
}

fn bus_json(bus: &BusBudget) -> Value {
    let budget = &bus.budget;
    json!({
        "name": bus.bus,
        "verdict": match bus.verdict {
            Verdict::Fits => "fits",
            Verdict::FitsTightly => "fits-tightly",
            Verdict::DoesNotFit => "does-not-fit",
        },
        "bit_rate": budget.bit_rate,
        "cycle_us": micros(budget.cycle),
        "demand_us": micros(budget.demand),
        "sync_bits": budget.sync_bits,
        "t_pdo_bits": budget.t_pdo_bits,
        "r_pdo_bits": budget.r_pdo_bits,
        "sync_jitter_us": micros(budget.sync_jitter),
        "t_pdos_in_us": micros(budget.t_pdos_in),
        "setpoint_offset_us": micros(budget.setpoint_offset),
        "latest_offset_us": micros(budget.latest_offset),
        "offsets_us": bus.offsets().map(micros),
        "burst_out_us": micros(budget.burst_out),
        "outlasts_emcy": budget.outlasts_emcy,
        "quiet_window_us": micros(budget.quiet_window),
        "sdo_room_us": micros(budget.sdo_room),
        "sdo_transfers_per_cycle": bus.sdo_per_cycle,
        "load_in_motion": bus.load_in_motion.as_secs_f64() / budget.cycle.as_secs_f64(),
        "load": bus.load.as_secs_f64() / budget.cycle.as_secs_f64(),
        "typical_load": bus.typical_load(),
        "smallest_cycle_us": bus.smallest_cycle().map(micros),
        "on_two_buses_us": bus.traffic.on_two_buses().map(|half| micros(half.budget().demand)),
        "pdos": budget.pdos.iter().map(|pdo| json!({
            "node": pdo.node.get(),
            "direction": match pdo.pdo.direction {
                Direction::Transmit => "t_pdo",
                Direction::Receive => "r_pdo",
            },
            "cob_id": pdo.pdo.cob_id.get(),
            "bits": pdo.bits,
            "times": pdo.times,
            "latest_us": pdo.latest.map(micros),
            "deadline_us": micros(pdo.deadline),
        })).collect::<Vec<_>>(),
    })
}
