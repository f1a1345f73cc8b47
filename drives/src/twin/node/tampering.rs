//! Objects that do not behave as the table says, because a test wants them so.

use syncline_canopen::Address;
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::node::Origin;
use syncline_canopen::sdo::AbortCode;

/// What has been changed about a device's objects.
#[derive(Clone, Debug, Default)]
pub struct Tampering {
    refusals: Vec<(Address, AbortCode)>,
    presets: Vec<(Address, i64)>,
}

impl Tampering {
    /// Refuses SDO writes to an object from now on.
    pub fn refuse(&mut self, address: Address, code: AbortCode) {
        self.refusals.push((address, code));
    }

    /// Lets all SDO writes through again.
    pub fn accept(&mut self) {
        self.refusals.clear();
    }

    /// Whether a write is let through.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn check_write(&self, address: Address, origin: Origin) -> Result<(), AbortCode> {
        let mut refusals = self.refusals.iter();
        let refused = refusals.find(|(refused, _)| *refused == address);
        match refused {
            Some((_, code)) if origin == Origin::Sdo => Err(*code),
            _ => Ok(()),
        }
    }

    /// Gives an object another value than the table's, now and whenever [`Self::show`] is called.
    pub fn preset(&mut self, objects: &mut Dictionary, address: Address, value: i64) {
        self.presets.push((address, value));
        self.show(objects);
    }

    /// The device says from now on that this maker made it.
    pub fn preset_vendor(&mut self, objects: &mut Dictionary, id: u32) {
        self.preset(objects, Address::new(0x1018, 1), id.into());
    }

    /// Brings the changed values back, after a reset has shown the table's.
    pub fn show(&self, objects: &mut Dictionary) {
        for &(Address { index, sub }, value) in &self.presets {
            objects.put(index, sub, value);
        }
    }
}
