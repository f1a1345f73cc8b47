//! The traffic of buses in files that other tools read.
//!
//! - [`candump`]: text, a line a frame, as can-utils' `candump -L` writes it
//! - [`pcapng`]: packets, as tshark and Wireshark read them
//! - [`BusLog`]: either or both of them

pub mod candump;
pub mod pcapng;

use std::fmt;
use std::io::{self, Write};
use std::time::Duration;
use syncline_canopen::Frame;

/// A file being written.
pub type LogFile = Box<dyn Write + Send>;

/// Frames of some buses on their way into files.
#[derive(Default)]
pub struct BusLog {
    buses: Vec<String>,
    candump: Option<LogFile>,
    packets: Option<LogFile>,
    frames: u64,
}

impl BusLog {
    /// A log of the buses with these names, into a candump log and a pcapng file.
    ///
    /// # Errors
    /// The head of the pcapng file cannot be written.
    pub fn begin(
        buses: Vec<String>,
        candump: Option<LogFile>,
        mut packets: Option<LogFile>,
    ) -> io::Result<Self> {
        if let Some(file) = &mut packets {
            pcapng::begin(file, &buses)?;
        }
        Ok(Self {
            buses,
            candump,
            packets,
            frames: 0,
        })
    }

    /// Takes a frame of the bus with index `bus`; `at` counts from 1970. Each file has it in one
    /// call, so that one which ends ends behind a frame.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn keep(&mut self, bus: usize, at: Duration, frame: &Frame) -> io::Result<()> {
        if let Some(file) = &mut self.candump {
            let (frame, bus) = (*frame, &*self.buses[bus]);
            let line = format!("{}\n", candump::Line { at, bus, frame });
            file.write_all(line.as_bytes())?;
        }
        if let Some(file) = &mut self.packets {
            pcapng::append(file, bus, at, frame)?;
        }
        self.frames += 1;
        Ok(())
    }

    /// Frames taken.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Writes what is still buffered.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finish(&mut self) -> io::Result<()> {
        let files = [&mut self.candump, &mut self.packets];
        files.into_iter().flatten().try_for_each(Write::flush)
    }
}

impl fmt::Debug for BusLog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BusLog")
            .field("buses", &self.buses)
            .field("frames", &self.frames)
            .finish_non_exhaustive()
    }
}
