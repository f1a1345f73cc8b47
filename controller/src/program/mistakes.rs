//! What is wrong with a program, all of it, and each mistake once.

use std::fmt;
use std::path::{Path, PathBuf};
use syncline_gcode as gcode;

/// How many mistakes of a program are told, and of how many lines of the same one.
const MOST_MISTAKES: usize = 50;
const MOST_LINES: usize = 12;
/// How many characters of a block are told with its line.
const LONGEST_BLOCK: usize = 60;

/// A mistake of a program, and where it is made again.
#[derive(Debug)]
pub struct Mistake {
    first: gcode::Error,
    lines: Vec<Again>,
    more: u64,
}

/// A line in which a mistake is made again.
#[derive(Debug)]
struct Again {
    line: u32,
    /// The block, if it is the same mistake with other numbers.
    otherwise: Option<String>,
}

/// All mistakes of a program, in the order in which they are met.
#[derive(Debug, Default)]
pub struct Mistakes {
    list: Vec<Mistake>,
    /// The tables file that is missing, if a mistake asks for what would be in it.
    no_tables: Option<PathBuf>,
}

impl Mistakes {
    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// There is no such tables file: told where a tool is missing.
    pub(super) fn without_tables(&mut self, file: Option<&Path>) {
        let tool = |it: &Mistake| matches!(it.first.fault, gcode::Fault::NoSuchTool { .. });
        self.no_tables = (file.map(Path::to_owned)).filter(|_| self.list.iter().any(tool));
    }

    /// Adds a mistake; `false` if no more can be told.
    pub(super) fn add(&mut self, error: gcode::Error) -> bool {
        // Numbers aside, the same message is the same mistake.
        let kind = |error: &gcode::Error| {
            let text = error.fault.to_string();
            // Of what is no code here the number is what is wrong.
            if let gcode::Fault::UnknownCode(_) | gcode::Fault::Unsupported { .. } = error.fault {
                return text;
            }
            text.replace(|c: char| c.is_ascii_digit() || "-.".contains(c), "")
        };
        let known = kind(&error);
        let same = |mistake: &&mut Mistake| {
            mistake.first.file == error.file && kind(&mistake.first) == known
        };
        match self.list.iter_mut().find(same) {
            // A loop or a subroutine makes it again and again.
            Some(mistake) if mistake.is_in(error.line) => {}
            Some(mistake) if mistake.lines.len() < MOST_LINES => mistake.is_again_in(&error),
            Some(mistake) => mistake.more += 1,
            None => self.list.push(Mistake {
                first: error,
                lines: Vec::new(),
                more: 0,
            }),
        }
        self.list.len() < MOST_MISTAKES
    }
}

impl Mistake {
    /// Whether the line is told.
    fn is_in(&self, line: u32) -> bool {
        self.first.line == line || self.lines.iter().any(|it| it.line == line)
    }

    fn is_again_in(&mut self, error: &gcode::Error) {
        let is_told = error.fault.to_string() == self.first.fault.to_string();
        let block = || {
            let block = error.shown_block();
            let block = block.trim();
            match block.char_indices().nth(LONGEST_BLOCK) {
                Some((end, _)) => format!("{} …", &block[..end]),
                None => block.to_owned(),
            }
        };
        self.lines.push(Again {
            line: error.line,
            otherwise: (!is_told).then(block),
        });
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for mistake in &self.list {
            write!(f, "{separator}{}", mistake.first)?;
            separator = "\n";
            for again in &mistake.lines {
                if let Some(block) = &again.otherwise {
                    write!(f, "\n  the same in line {}: {block}", again.line)?;
                }
            }
            let alike = mistake.lines.iter().filter(|it| it.otherwise.is_none());
            let alike: Vec<String> = alike.map(|it| it.line.to_string()).collect();
            match (&alike[..], mistake.more) {
                ([], 0) => {}
                ([], more) => write!(f, "\n  the same in {more} more lines")?,
                (alike, more) => {
                    write!(f, "\n  the same in line {}", alike.join(", "))?;
                    if more > 0 {
                        write!(f, " and {more} more")?;
                    }
                }
            }
        }
        if self.list.len() == MOST_MISTAKES {
            f.write_str("\nfurther mistakes are not told: correct these first")?;
        }
        if let Some(file) = &self.no_tables {
            let file = file.display();
            write!(
                f,
                "\nthere is no {file}, which tells the tools and work offsets of this machine"
            )?;
        }
        Ok(())
    }
}
