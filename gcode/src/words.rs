//! The words of a block by letter and modal group, and who uses them.

use super::arc::Plane;
use super::axes::AxisLetter;
use super::error::{Fault, Refusal};
use super::lexer::Columns;
use super::modal::{Code, Group, Standing};

/// How far from a whole number a value may be that has to be one (RS-274/NGC: 0.0001).
const WHOLE: f64 = 1e-4;

/// How many letters there are with those around them that are none.
const LETTERS: usize = slot(b'^') + 1;

/// The place of a letter, `@` or `^`.
const fn slot(letter: u8) -> usize {
    (letter - b'@') as usize
}

/// A set of letters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Letters(u32);

impl Letters {
    pub(crate) fn insert(&mut self, letter: u8) {
        self.0 |= 1 << slot(letter);
    }

    pub(crate) fn has(self, letter: u8) -> bool {
        self.0 & 1 << slot(letter) != 0
    }

    pub(crate) fn has_any_of(self, letters: &[u8]) -> bool {
        letters.iter().any(|letter| self.has(*letter))
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = u8> {
        (b'@'..=b'^').filter(move |letter| self.has(*letter))
    }
}

/// A word's value and who used it.
#[derive(Clone, Copy, Debug)]
struct Letter {
    value: f64,
    columns: Columns,
    user: Option<Code>,
}

/// A block's evaluated words.
#[derive(Debug, Default)]
pub(crate) struct Words {
    /// From `@` over `A` … `Z` to `^`.
    letters: [Option<Letter>; LETTERS],
    codes: [Option<(Code, Columns)>; Group::COUNT],
}

impl Words {
    /// Adds an evaluated word.
    pub(crate) fn add(&mut self, letter: u8, value: f64, columns: Columns) -> Result<(), Refusal> {
        let refuse = |fault| Err(Refusal::new(columns, fault));
        let code = match letter {
            b'G' => match whole(value * 10.0, WHOLE * 10.0) {
                Some(tenths @ 0..=999) => Code::G(tenths as u16),
                _ => return refuse(out_of_range('G', value, "G0 to G99.9, one decimal at most")),
            },
            b'M' => match whole(value, WHOLE) {
                Some(number @ 0..=199) => Code::M(number as u16),
                _ => return refuse(out_of_range('M', value, "M0 to M199, a whole number")),
            },
            _ => {
                let slot = &mut self.letters[slot(letter)];
                if slot.is_some() {
                    return refuse(Fault::DuplicateWord {
                        letter: char::from(letter),
                    });
                }
                *slot = Some(Letter {
                    value,
                    columns,
                    user: None,
                });
                return Ok(());
            }
        };
        match code.standing() {
            Standing::Supported(group) => {
                let slot = &mut self.codes[group as usize];
                if let Some((first, _)) = *slot {
                    // Post-processors write `G0 … G80` in one block: the cycle ends, G0 is on.
                    let plain = |code| matches!(code, Code::G(0 | 10 | 20 | 30));
                    match (first, code) {
                        (Code::G(800), second) if plain(second) => {
                            *slot = Some((code, columns));
                            return Ok(());
                        }
                        (first, Code::G(800)) if plain(first) => return Ok(()),
                        _ => {}
                    }
                    return refuse(Fault::Conflict {
                        first,
                        second: code,
                        group: group.name(),
                    });
                }
                *slot = Some((code, columns));
                Ok(())
            }
            Standing::Refused(reason) => refuse(Fault::Unsupported { code, reason }),
            Standing::Unknown => refuse(Fault::UnknownCode(code)),
        }
    }

    /// The block's code of a group.
    pub(crate) fn code(&self, group: Group) -> Option<Code> {
        self.codes[group as usize].map(|(code, _)| code)
    }

    /// The columns of a group's code, if the block has one.
    pub(crate) fn code_columns(&self, group: Group) -> Option<Columns> {
        self.codes[group as usize].map(|(_, columns)| columns)
    }

    /// The first code of another group than this.
    pub(crate) fn first_code_but(&self, group: Group) -> Option<(Code, Columns)> {
        let others = self.codes.iter().enumerate();
        let others = others.filter(|(index, _)| *index != group as usize);
        let others = others.filter_map(|(_, code)| *code);
        others.min_by_key(|(_, columns)| columns.start)
    }

    /// The block's codes.
    pub(crate) fn codes(&self) -> impl Iterator<Item = Code> + '_ {
        self.codes.iter().flatten().map(|(code, _)| *code)
    }

    /// Whether the letter is there, used or not.
    pub(crate) fn has(&self, letter: u8) -> bool {
        self.letters[slot(letter)].is_some()
    }

    /// Whether there is a word of an axis.
    pub(crate) fn has_axes(&self) -> bool {
        AxisLetter::ALL
            .iter()
            .any(|axis| self.has(axis.letter() as u8))
    }

    /// Whether there is a word of polar coordinates.
    pub(crate) fn has_polar(&self) -> bool {
        self.has(b'@') || self.has(b'^')
    }

    /// Whether there is a word that describes an arc.
    pub(crate) fn has_arc(&self) -> bool {
        b"IJKR".iter().any(|letter| self.has(*letter))
    }

    /// The columns of a letter's word.
    pub(crate) fn columns(&self, letter: u8) -> Option<Columns> {
        self.letters[slot(letter)].map(|word| word.columns)
    }

    /// The value of a letter for a code that uses it.
    pub(crate) fn take(&mut self, letter: u8, user: Code) -> Result<Option<f64>, Refusal> {
        let Some(word) = &mut self.letters[slot(letter)] else {
            return Ok(None);
        };
        match word.user.replace(user) {
            Some(first) if first != user => Err(Refusal::new(
                word.columns,
                Fault::SharedWord {
                    letter: char::from(letter),
                    first,
                    second: user,
                },
            )),
            _ => Ok(Some(word.value)),
        }
    }

    /// The value of a letter that has to be a whole number of a range.
    pub(crate) fn take_whole(
        &mut self,
        letter: u8,
        user: Code,
        range: std::ops::RangeInclusive<u32>,
        allowed: &'static str,
    ) -> Result<Option<u32>, Refusal> {
        let Some(value) = self.take(letter, user)? else {
            return Ok(None);
        };
        match whole(value, WHOLE) {
            Some(number) if range.contains(&number) => Ok(Some(number)),
            _ => Err(self.refuse(letter, out_of_range(char::from(letter), value, allowed))),
        }
    }

    /// Marks a letter that needs no code (F, S, T).
    pub(crate) fn take_free(&mut self, letter: u8) -> Option<f64> {
        let word = self.letters[slot(letter)].as_mut()?;
        word.user = Some(Code::G(0));
        Some(word.value)
    }

    /// A fault at a letter's word.
    pub(crate) fn refuse(&self, letter: u8, fault: Fault) -> Refusal {
        Refusal::new(self.columns(letter).unwrap_or_default(), fault)
    }

    /// Refuses a word that no code used.
    pub(crate) fn all_used(&self) -> Result<(), Refusal> {
        let unused = (b'@'..=b'^')
            .zip(&self.letters)
            .filter_map(|(letter, word)| Some((letter, word.as_ref()?)))
            .filter(|(_, word)| word.user.is_none())
            .min_by_key(|(_, word)| word.columns.start);
        match unused {
            Some((letter, word)) => Err(Refusal::new(
                word.columns,
                Fault::UnusedWord {
                    letter: char::from(letter),
                },
            )),
            None => Ok(()),
        }
    }

    /// Refuses an offset of the centre that is not in the plane.
    pub(crate) fn offsets_in_plane(&self, plane: Plane) -> Result<(), Refusal> {
        let letters = plane.offset_letters();
        for letter in *b"IJK" {
            if self.has(letter) && !letters.contains(&letter) {
                return Err(self.refuse(
                    letter,
                    Fault::ArcOffsetPlane {
                        letter: char::from(letter),
                        allowed: match plane {
                            Plane::Xy => "I and J under G17",
                            Plane::Zx => "I and K under G18",
                            Plane::Yz => "J and K under G19",
                        },
                    },
                ));
            }
        }
        Ok(())
    }
}

pub(crate) fn out_of_range(letter: char, value: f64, allowed: &'static str) -> Fault {
    Fault::Value {
        letter,
        value,
        allowed,
    }
}

/// The whole number within `tolerance` of a value.
pub(crate) fn whole(value: f64, tolerance: f64) -> Option<u32> {
    let rounded = value.round();
    let fits =
        (value - rounded).abs() <= tolerance && (0.0..=f64::from(u32::MAX)).contains(&rounded);
    fits.then_some(rounded as u32)
}
