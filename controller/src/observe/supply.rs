//! What the power stage of a simulated drive was loaded with: I²t, DC bus and braking resistor.

use super::record::{Greatest, Place};
use serde::Serialize;
use std::fmt;
use syncline_drives::twin::Observation;

/// What the power stage of a drive was loaded with.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SupplySummary {
    /// Greatest I²t of the motor, cold as it was switched on; at 1 its torque is limited.
    pub max_motor_i2t: f64,
    /// Where that was.
    pub max_motor_i2t_at: Place,
    /// Greatest I²t of the drive.
    pub max_drive_i2t: f64,
    /// Where that was.
    pub max_drive_i2t_at: Place,
    /// Greatest voltage of the DC bus, V.
    pub max_bus_voltage: f64,
    /// Where that was.
    pub max_bus_voltage_at: Place,
    /// Most energy that braking had stored in the DC bus, J.
    pub max_bus_energy_j: f64,
    /// Energy that the braking resistor took, J.
    pub braked_j: f64,
    /// Mean power of the braking resistor over the run, W.
    pub braking_power_w: f64,
}

/// As a person reads it.
impl fmt::Display for SupplySummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "I²t max {:.3} of the motor, {:.3} of the drive; DC bus max {:.0} V, {:.1} J stored by braking",
            self.max_motor_i2t, self.max_drive_i2t, self.max_bus_voltage, self.max_bus_energy_j
        )?;
        match self.braked_j {
            0.0 => Ok(()),
            braked => write!(
                f,
                ", {braked:.1} J in the braking resistor, {:.1} W on average",
                self.braking_power_w
            ),
        }
    }
}

/// What is watched of one.
#[derive(Clone, Debug, Default)]
pub(super) struct SupplyWatch {
    /// I²t of motor and drive.
    overloads: [Greatest; 2],
    voltage: Greatest,
    stored: Greatest,
    /// Energy that the braking resistor had taken at first and at last, J.
    braked: Option<(f64, f64)>,
}

impl SupplyWatch {
    /// Takes how its drive is at one SYNC.
    pub(super) fn observe(&mut self, at: Place, seen: &Observation) {
        let Some(supply) = seen.supply else {
            return;
        };
        for (watch, overload) in self.overloads.iter_mut().zip(supply.overloads) {
            watch.look(overload, at);
        }
        self.voltage.look(supply.voltage, at);
        self.stored.look(supply.stored, at);
        let (first, _) = self.braked.unwrap_or((supply.braked, 0.0));
        self.braked = Some((first, supply.braked));
    }

    /// What was seen in so many seconds; `None` where no power stage is simulated.
    pub(super) fn summary(&self, seconds: f64) -> Option<SupplySummary> {
        let (first, last) = self.braked?;
        let [motor, drive] = self.overloads;
        Some(SupplySummary {
            max_motor_i2t: motor.value,
            max_motor_i2t_at: motor.at,
            max_drive_i2t: drive.value,
            max_drive_i2t_at: drive.at,
            max_bus_voltage: self.voltage.value,
            max_bus_voltage_at: self.voltage.at,
            max_bus_energy_j: self.stored.value,
            braked_j: last - first,
            braking_power_w: (last - first) / seconds,
        })
    }
}
