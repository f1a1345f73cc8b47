//! Values over time: strips of equal width under each other, with one time axis. The page's script draws them, from the
//! columns that [`data`](super::data) packs; here stands what they are.

use super::html::quoted;
use crate::text::shown;
use serde::Serialize;

/// One line of a strip.
#[derive(Serialize)]
pub(super) struct Line {
    /// CSS class: its colour.
    pub(super) class: &'static str,
    /// Its name, where a strip has several.
    pub(super) name: &'static str,
    /// The column of its values.
    pub(super) column: String,
    /// Held from one value to the next instead of joined by a slope.
    pub(super) stepped: bool,
}

impl Line {
    /// One that another is drawn over.
    pub(super) fn below(name: &'static str, column: &str) -> Self {
        Self {
            class: "act",
            name,
            column: column.to_owned(),
            stepped: false,
        }
    }
}

/// One quantity over time.
#[derive(Serialize)]
pub(super) struct Strip {
    pub(super) title: &'static str,
    pub(super) unit: &'static str,
    /// What stands at its right end: greatest value, limit.
    pub(super) note: String,
    pub(super) lines: Vec<Line>,
    /// Values not to be exceeded. Drawn where the data come near them.
    pub(super) limits: Vec<f64>,
}

impl Strip {
    /// With one line and no limits.
    pub(super) fn new(title: &'static str, unit: &'static str, note: String, column: &str) -> Self {
        Self {
            title,
            unit,
            note,
            lines: vec![Line {
                class: "set",
                name: "",
                column: column.to_owned(),
                stepped: false,
            }],
            limits: Vec::new(),
        }
    }

    /// Held from one value to the next.
    pub(super) fn stepped(mut self) -> Self {
        self.lines.iter_mut().for_each(|it| it.stepped = true);
        self
    }

    /// With values not to be exceeded.
    pub(super) fn within(mut self, limits: &[f64]) -> Self {
        self.limits = limits.to_vec();
        self
    }

    /// With another line below its own, which gets a name then.
    pub(super) fn over(mut self, own: &'static str, below: Line) -> Self {
        self.lines[0].name = own;
        self.lines.insert(0, below);
        self
    }
}

/// A moment worth a mark on every strip.
#[derive(Serialize)]
pub(super) struct Mark {
    pub(super) time: f64,
    pub(super) text: String,
}

#[derive(Serialize)]
struct Spec<'a> {
    label: &'a str,
    strips: &'a [Strip],
    marks: &'a [Mark],
}

/// The place of some strips on the page.
pub(super) fn strips(label: &str, strips: &[Strip], marks: &[Mark]) -> String {
    let marks = marks.iter().map(|mark| Mark {
        time: mark.time,
        text: shown(&mark.text).into_owned(),
    });
    let spec = Spec {
        label: &shown(label),
        strips,
        marks: &marks.collect::<Vec<_>>(),
    };
    // Of texts and finite numbers.
    let spec = serde_json::to_string(&spec).unwrap_or_default();
    format!("<div class=strips data-spec='{}'></div>", quoted(&spec))
}
