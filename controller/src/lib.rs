//! The machine: configuration, bring-up, SYNC cycle, supervision, programs, recording, reports.
