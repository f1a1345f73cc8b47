//! `[[user_code]]`: what an M-code from M100 to M199 runs on the controller's computer.

use std::path::Path;
use std::time::Duration;
use syncline_strict_toml::{Log, Table};
use toml::Spanned;

/// What an M-code of the user's runs. A code that no table names is told, and runs nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UserCode {
    /// 100 … 199.
    pub code: u16,
    /// A program by its absolute path, and its first arguments; the block's P and Q come behind them.
    pub command: Vec<String>,
    /// How long it may take.
    pub within: Duration,
}

/// A table as the file has it.
pub(super) struct UserCodeTable {
    code: Spanned<i64>,
    user_code: UserCode,
}

/// Arguments that a command may have.
const MOST: usize = 32;
const ALLOWED: &str =
    "[\"/path/of/a/program\", \"its first argument\", …], the path absolute, up to 32 texts";

impl UserCodeTable {
    pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let code = table.integer(log, "code", 100..=199, "");
        let command = table.texts(log, "command", ALLOWED, 1..=MOST);
        let within = table.millis_or(log, "timeout_ms", 10_000, 3_600_000);
        table.finish(log);
        let (code, command) = (code?, command?);
        let texts: Vec<_> = command
            .get_ref()
            .iter()
            .map(|it| it.get_ref().clone())
            .collect();
        if !Path::new(&texts[0]).is_absolute() || texts.iter().any(|text| text.contains('\0')) {
            // Whatever the working directory and the search path are, it is the same program.
            let problem = format!("user_code: `command` begins with \"{}\"", texts[0]);
            log.report(command.span(), problem, ALLOWED);
        }
        Some(Self {
            user_code: UserCode {
                code: *code.get_ref() as u16,
                command: texts,
                within,
            },
            code,
        })
    }

    /// Those of a machine, each code once.
    pub(super) fn join(log: &mut Log<'_>, tables: Vec<Self>) -> Vec<UserCode> {
        let mut codes: Vec<UserCode> = Vec::with_capacity(tables.len());
        for table in tables {
            let code = table.user_code.code;
            if codes.iter().any(|other| other.code == code) {
                let problem = format!("user_code: there is another one with `code = {code}`");
                log.report(table.code.span(), problem, "give each code one table");
            }
            codes.push(table.user_code);
        }
        codes
    }
}
