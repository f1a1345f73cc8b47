//! What stands on a terminal: as much of one as full-screen programs that draw what has changed need.

/// The cells of a terminal, and its cursor.
pub struct Screen {
    rows: Vec<Vec<char>>,
    row: usize,
    column: usize,
    /// The beginning of a character, or of a sequence behind an escape.
    unfinished: Vec<u8>,
}

impl Screen {
    /// An empty one.
    #[must_use]
    pub fn new(columns: usize, rows: usize) -> Self {
        Self {
            rows: vec![vec![' '; columns]; rows],
            row: 0,
            column: 0,
            unfinished: Vec::new(),
        }
    }

    /// What stands there, row by row.
    #[must_use]
    pub fn text(&self) -> String {
        let rows = self.rows.iter().map(|row| String::from_iter(row) + "\n");
        rows.collect()
    }

    /// Takes what a program writes.
    pub fn take(&mut self, written: &[u8]) {
        for &byte in written {
            self.unfinished.push(byte);
            match self.unfinished[..] {
                [0x1B] | [0x1B, b'['] => {}
                [0x1B, b'[', ref parameters @ .., last] if last >= b'@' => {
                    let parameters = String::from_utf8_lossy(parameters).into_owned();
                    self.obey(&parameters, last);
                    self.unfinished.clear();
                }
                [0x1B, b'[', ..] => {}
                // Sequences of two bytes, which move nothing.
                [0x1B, _] => self.unfinished.clear(),
                _ => {
                    let bytes = &self.unfinished;
                    let whole = bytes.len() == 4;
                    let character = std::str::from_utf8(bytes).map(|text| text.chars().next());
                    if let Ok(Some(character)) = character {
                        self.write(character);
                    }
                    if character.is_ok() || whole {
                        self.unfinished.clear();
                    }
                }
            }
        }
    }

    fn write(&mut self, character: char) {
        match character {
            '\r' => self.column = 0,
            '\n' => self.row += 1,
            _ if character.is_control() => {}
            _ => {
                let cell = self.rows.get_mut(self.row);
                if let Some(cell) = cell.and_then(|row| row.get_mut(self.column)) {
                    *cell = character;
                }
                self.column += 1;
            }
        }
    }

    /// Obeys a control sequence: the cursor's place, and clearing; colours are none of a text.
    fn obey(&mut self, parameters: &str, last: u8) {
        match last {
            b'H' => {
                let mut places = parameters
                    .split(';')
                    .map(|place| place.parse().unwrap_or(1));
                let mut next = || places.next().unwrap_or(1_usize).saturating_sub(1);
                (self.row, self.column) = (next(), next());
            }
            // The other screen of a terminal is empty when it comes up.
            b'h' if parameters != "?1049" => {}
            b'J' | b'h' => self.rows.iter_mut().for_each(|row| row.fill(' ')),
            _ => {}
        }
    }
}
