//! Where a result is from: enough to have it again, and to know whether it is still true.

use serde::Serialize;

/// Of one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Of this software.
    pub version: &'static str,
    /// When the run began, in UTC as RFC 3339 has it.
    pub date: String,
    /// The name of the computer.
    pub host: String,
    /// What makes the run again, as a shell takes it.
    pub command: String,
    /// SHA-256 of the machine file.
    pub machine_sha256: String,
    /// What describes its devices: descriptions and their data sheets.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub descriptions: Vec<Digest>,
    /// The same of the program, where it is a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_sha256: Option<String>,
    /// The cycle, s.
    pub cycle_s: f64,
}

/// A file as it was.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Digest {
    /// As it is found from the machine file.
    pub file: String,
    /// Its SHA-256.
    pub sha256: String,
}
