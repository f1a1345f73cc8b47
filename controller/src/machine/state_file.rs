//! The machine's state file, `machine.state.json` beside `machine.toml`: what holds from one day to the next because
//! encoders keep counting without power.
//!
//! Of each drive whose axis keeps its reference ([`Homing::moved_limit`](super::Homing::moved_limit)) it has the
//! origin that a homing found, where the drive stood when its axis came to rest last, and what would make
//! its counts mean something else: model, scaling and zero, and what tells the drive and its motor from others. It is the machine's own, replaced as a whole, and
//! not to be edited: whoever wants an axis homed again homes it.

use super::{Axis, Drive, Machine};
use serde::de::Error as _;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use syncline_drives::model::{Address, Increments, Marks};
use syncline_strict_toml::input;
use syncline_strict_toml::replace::replace;
use thiserror::Error;

/// What is known of a machine from when it was on last.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineState {
    /// By the names of the drives.
    drives: BTreeMap<String, DriveState>,
}

/// The file: the state, and what shows that it is as it was written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StateFile {
    /// The SHA-256 of the state as JSON on one line.
    sha256: String,
    state: MachineState,
}

impl StateFile {
    fn of(state: MachineState) -> serde_json::Result<Self> {
        let digest = Sha256::digest(serde_json::to_string(&state)?);
        let sha256 = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { sha256, state })
    }

    /// The state, if nobody has changed it since it was written.
    fn open(self) -> serde_json::Result<MachineState> {
        let written = Self::of(self.state)?;
        match written.sha256 == self.sha256 {
            true => Ok(written.state),
            false => Err(serde_json::Error::custom("its SHA-256 is another one")),
        }
    }
}

/// What is known of a drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DriveState {
    counts: Counts,
    /// See [`Kept::origin`].
    origin: i64,
    /// See [`Kept::position`].
    position: i64,
    /// See [`Kept::marks`].
    #[serde(default, skip_serializing_if = "is_unmarked")]
    marks: Marks<u32>,
}

fn is_unmarked(marks: &Marks<u32>) -> bool {
    marks.iter().all(Option::is_none)
}

/// What the counts of a drive mean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Counts {
    model: String,
    /// mm, negative where it counts down.
    travel_per_revolution: f64,
    increments_per_revolution: u32,
    zero: i64,
}

/// The reference of a drive that counts without power, as the drive counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// Its count at machine position 0, beyond the `zero` of the machine file.
    pub origin: Increments,
    /// Where it stood last.
    pub position: Increments,
    /// What told it, and the motor that counts for it, from another of its model.
    pub marks: Marks<u32>,
}

/// What shows that a device, or the motor that counts for it, is not the one of before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OtherMark {
    /// Where it stands.
    pub object: Address,
    /// What it read.
    pub before: u32,
    /// What it reads; `None`: there is no such object.
    pub now: Option<u32>,
}

/// Why an axis has no reference from before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotKept {
    /// None is known.
    Unknown,
    /// The counts of one of its drives meant something else.
    OtherCounts {
        /// Its index in [`Machine::drives`].
        drive: usize,
    },
    /// One of its drives, or the motor on it, was replaced.
    OtherDevice(OtherMark),
}

/// A state file that cannot be used.
#[derive(Debug, Error)]
pub enum StateError {
    /// It cannot be read.
    #[error("cannot read the machine's state, {}", file.display())]
    Read {
        /// Which file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is none as the controller writes it.
    #[error("{} is not the machine's state as it was written: remove it, and home the axes", file.display())]
    Broken {
        /// Which file.
        file: PathBuf,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// It cannot be written.
    #[error("cannot write the machine's state, {}: its axes have to be homed when it is switched on again", file.display())]
    Write {
        /// Which file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Counts {
    fn of(drive: &Drive) -> Self {
        let scaling = &drive.scaling;
        let travel = scaling.travel_per_revolution();
        Self {
            model: drive.model.name.to_owned(),
            travel_per_revolution: travel,
            increments_per_revolution: (travel.abs() / scaling.resolution()).round() as u32,
            zero: scaling.zero().get(),
        }
    }
}

impl MachineState {
    /// Where the state of a machine file is: `portal.toml` has `portal.state.json`.
    #[must_use]
    pub fn beside(machine: &Path) -> PathBuf {
        machine.with_extension("state.json")
    }

    /// Reads a state file; nothing is known where there is none.
    ///
    /// # Errors
    /// It cannot be read, or is none.
    pub fn load(file: &Path) -> Result<Self, StateError> {
        match input::read(file) {
            Ok(text) => {
                let state = serde_json::from_slice(&text).and_then(StateFile::open);
                state.map_err(|source| StateError::Broken {
                    file: file.to_owned(),
                    source,
                })
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Self::default()),
            Err(source) => Err(StateError::Read {
                file: file.to_owned(),
                source,
            }),
        }
    }

    /// Replaces a state file as a whole.
    ///
    /// # Errors
    /// It cannot be written; then it is as it was.
    pub fn save(&self, file: &Path) -> Result<(), StateError> {
        let text = StateFile::of(self.clone()).and_then(|it| serde_json::to_string_pretty(&it));
        let text = text.map_err(io::Error::from);
        let written = text.and_then(|text| replace(file, &(text + "\n")));
        written.map_err(|source| StateError::Write {
            file: file.to_owned(),
            source,
        })
    }

    /// Of a machine that is simulated with this seed and whose encoders have kept counting: each axis stands where it is
    /// said to.
    #[must_use]
    pub fn simulated(machine: &Machine, seed: u64) -> Self {
        let mut state = Self::default();
        for axis in machine
            .axes
            .iter()
            .filter(|axis| axis.homing.moved_limit.is_some())
        {
            for (side, &drive) in axis.drives.iter().enumerate() {
                let drive = &machine.drives[drive];
                let position = drive
                    .scaling
                    .to_increments(axis.drive_stands(side, seed))
                    .ok();
                let kept = position.map(|position| Kept {
                    origin: Increments::ZERO,
                    position,
                    marks: [None; 2],
                });
                state.keep(drive, kept);
            }
        }
        state
    }

    /// Keeps the reference of a drive, or forgets what there was.
    pub fn keep(&mut self, drive: &Drive, kept: Option<Kept>) {
        let Some(kept) = kept else {
            self.drives.remove(&drive.name);
            return;
        };
        let state = DriveState {
            counts: Counts::of(drive),
            origin: kept.origin.get(),
            position: kept.position.get(),
            marks: kept.marks,
        };
        self.drives.insert(drive.name.clone(), state);
    }

    /// The references of an axis' drives, in their order.
    ///
    /// # Errors
    /// One of them is not known, or none of these drives.
    pub fn of_axis(&self, machine: &Machine, axis: &Axis) -> Result<Vec<Kept>, NotKept> {
        let kept = |&drive: &usize| {
            let known = &machine.drives[drive];
            let state = self.drives.get(&known.name).ok_or(NotKept::Unknown)?;
            if state.counts != Counts::of(known) {
                return Err(NotKept::OtherCounts { drive });
            }
            Ok(Kept {
                origin: Increments::new(state.origin),
                position: Increments::new(state.position),
                marks: state.marks,
            })
        };
        axis.drives.iter().map(kept).collect()
    }
}
