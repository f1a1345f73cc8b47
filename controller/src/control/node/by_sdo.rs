//! What a device is told by SDO as well, as it may hear no R_PDOs: a drive to come to rest and to lose its power, and any
//! device what its outputs are.
//!
//! One that was taken out of Operational hears no R_PDOs, and one in Stopped takes no SDO either (CiA 301). So what gets no
//! answer is told again, behind a command to enter Pre-operational, until it is answered or the device is set up anew.

use super::super::sdo_sequence::Step;
use super::DeviceNode;
use syncline_canopen::{Transmit, nmt};
use syncline_drives::model::{Device, PowerCommand, Write};

/// What a device was told so.
#[derive(Clone, Debug)]
pub(super) struct BySdo {
    /// It has outputs, and may hear no R_PDOs.
    is_deaf: bool,
    /// R_PDOs went to it since it was brought up: none do before all devices are heard.
    pub(super) is_sent: bool,
    /// What it was told of its outputs.
    outputs: Vec<Write>,
    /// What it was told of its power.
    power: Option<Write>,
}

impl BySdo {
    /// Nothing yet.
    pub(super) fn new(device: &Device) -> Self {
        // The cycle takes no memory.
        let mut count = 0;
        if let Some(io) = device.io() {
            io.write(&mut |_| count += 1);
        }
        Self {
            is_deaf: false,
            is_sent: false,
            outputs: Vec::with_capacity(count),
            power: None,
        }
    }

    /// The device begins anew.
    pub(super) fn forget(&mut self) {
        self.is_deaf = false;
        self.is_sent = false;
        self.outputs.clear();
        self.power = None;
    }
}

impl DeviceNode {
    /// Has a drive come to rest by itself: one that is sent velocities and hears no R_PDO would go on with the last.
    pub(in crate::control) fn quick_stop(&mut self) {
        let Some(drive) = self.device.drive().filter(|_| !self.is_quick_stopped()) else {
            return;
        };
        let survey = drive.survey();
        self.quick_stopped = Some(0);
        self.forget_standstill();
        self.power = PowerCommand::QuickStop;
        self.command_power(survey.map(|survey| survey.quick_stop));
    }

    /// Takes the power from a drive that does not come to rest by itself.
    pub(in crate::control) fn switch_off(&mut self) {
        if self.power != PowerCommand::Disable {
            self.power = PowerCommand::Disable;
            self.command_power(self.survey().map(|survey| survey.disable));
        }
    }

    /// Takes the power by SDO, too, from a drive that was told to come to rest by itself, or has not told that it is off.
    pub(in crate::control) fn switch_off_by_sdo(&mut self) {
        let is_off = self.is_fresh() && !self.status.power.may_be_on();
        if self.is_quick_stopped() || !is_off {
            self.command_power(self.survey().map(|survey| survey.disable));
        }
    }

    fn command_power(&mut self, write: Option<Write>) {
        if let Some(write) = write {
            self.by_sdo.power = Some(write);
            self.sequence.command(write);
        }
    }

    /// Tells from now on by SDO as well what the outputs of a drive are that is not heard, or not in Operational.
    pub(in crate::control) fn watch_outputs(&mut self) {
        let is_heard = self.is_fresh() && self.is_operational();
        if !self.is_io_node() && !is_heard {
            self.tell_by_sdo();
        }
    }

    /// Whether it is an I/O node, and no drive that has outputs.
    pub(in crate::control) fn is_io_node(&self) -> bool {
        matches!(self.device, Device::Io(_))
    }

    /// Tells from now on by SDO as well what its outputs are: they would stay as they are.
    pub(in crate::control) fn tell_by_sdo(&mut self) {
        self.by_sdo.is_deaf |= self.device.io_mut().is_some();
    }

    /// Whether there is something that it is told by SDO as well.
    pub(in crate::control) fn is_told_by_sdo(&self) -> bool {
        self.by_sdo.is_deaf || self.by_sdo.power.is_some()
    }

    /// Tells what has changed of its outputs.
    pub(super) fn tell_outputs(&mut self) {
        let Self {
            device,
            sequence,
            by_sdo,
            ..
        } = self;
        let Some(io) = device.io().filter(|_| by_sdo.is_deaf) else {
            return;
        };
        io.write(&mut |write| {
            let mut told = by_sdo.outputs.iter_mut();
            match told.find(|told| told.address == write.address) {
                Some(told) if *told == write => return,
                Some(told) => *told = write,
                None => by_sdo.outputs.push(write),
            }
            sequence.command_behind(write);
        });
    }

    /// Takes the power once more from a drive that was told so by SDO, for the last time: it is let go of.
    pub(super) fn command_off(&mut self) {
        if self.by_sdo.power.take().is_some()
            && let Some(survey) = self.survey()
        {
            self.sequence.command(survey.disable);
        }
    }

    /// Tells once more what its outputs are: it is let go of.
    pub(super) fn tell_finally(&mut self) {
        self.by_sdo.outputs.clear();
        self.take_outputs();
        self.tell_outputs();
    }

    /// Whether it was found with power, and is not told yet to switch it off.
    pub(in crate::control) fn is_found_on(&self) -> bool {
        self.sequence.is_found_on()
    }

    /// Nothing more is asked of it: it is another controller's.
    pub(in crate::control) fn leave(&mut self) {
        self.sequence.clear();
    }

    /// The steps that switch it off where it was found with power.
    pub(in crate::control) fn switch_found_off(&mut self) {
        let survey = self.survey();
        if let Some(survey) = survey.filter(|_| self.sequence.take_found_on()) {
            let steps = [Step::Write(survey.disable), Step::AwaitDisabled(survey)];
            self.sequence.extend(steps);
        }
    }

    /// Calls it back to Pre-operational, unless it shows to be in Operational, and tells again what it has not answered; whether it did.
    pub(super) fn call_back(&mut self, tx: &mut impl Transmit) -> bool {
        let unanswered = self.sequence.take_unanswered();
        if unanswered {
            self.by_sdo.outputs.clear();
            if let Some(write) = self.by_sdo.power {
                self.sequence.command(write);
            }
            // One answer may have been lost.
            let hears = self.is_fresh() && self.is_operational();
            if !hears {
                tx.transmit(self.nmt(nmt::Command::EnterPreOperational));
            }
        }
        unanswered
    }
}
