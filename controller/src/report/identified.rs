//! What an axis was identified as: what is told of it, and how it answers torque over frequency.

use super::html::{escape, opened, section};
use super::plot::{self, Along, Curve};
use crate::identify::Identified;
use crate::identify::response::Response;

impl Identified {
    /// The file's text; `machine` is the machine's name.
    #[must_use]
    pub fn to_html(&self, machine: &str) -> String {
        page(self, machine)
    }
}

fn page(identified: &Identified, machine: &str) -> String {
    let points = |of: fn(&Response) -> f64| -> Vec<(f64, f64)> {
        let told = identified.response.iter();
        told.map(|it| (it.frequency_hz, of(it))).collect()
    };
    let plot = |what, unit, up, seen: fn(&Response) -> f64, model: fn(&Response) -> f64| {
        let (seen, model) = (points(seen), points(model));
        let curve = |class, name, points| Curve {
            class,
            name,
            points,
        };
        let both = [
            curve("set", "as estimated", &model),
            curve("act", "as seen", &seen),
        ];
        plot::curves(what, ("Hz", unit), (Along::Decades, up), &both)
    };
    let plots = [
        plot(
            "Speed of the motor over its torque",
            "rad/s per N·m",
            Along::Decades,
            |it| it.gain,
            |it| it.model_gain,
        ),
        plot(
            "Phase",
            "°",
            Along::Evenly,
            |it| it.phase_deg,
            |it| it.model_phase_deg,
        ),
    ];
    let told = escape(&identified.to_string());
    format!(
        "{}<header class=pass>\n<div><h1>{} <span>axis {}</span></h1><p class=quiet>identified from how it moves</p></div>\n\
         </header>\n{}{}</main>\n</body>\n</html>\n",
        opened(&format!("{machine} · axis {}", identified.axis)),
        escape(machine),
        escape(identified.axis),
        section(
            "How it answers",
            format!("<div class=pair>{}</div>", plots.concat())
        ),
        section(
            "What it is",
            format!("<div class=scroll><pre>{told}</pre></div>")
        ),
    )
}
