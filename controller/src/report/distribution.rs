//! How often a time was how long.

use super::html::escape;
use super::plot::{self, Along, BARS};
use super::scale::{Scale, count};
use crate::observe::timing::{self, Distribution};
use std::{fmt::Write, time::Duration};

/// A card with bars, both axes logarithmic but for narrow distributions, and percentiles.
pub(super) fn card(distribution: &Distribution) -> String {
    let name = distribution.name();
    let mut html = format!("<figure><figcaption>{}</figcaption>", escape(name));
    let Some((least, greatest)) = distribution.extent() else {
        return html + "<p class=quiet>No values.</p></figure>";
    };
    let micros = |time: Duration| time.as_nanos() as f64 * 1e-3;
    let (least, most) = (micros(least), micros(greatest));
    let along = match most > 8.0 * least.max(1e-3) {
        true => Along::Decades,
        false => Along::Evenly,
    };
    let place = |micros: f64| match along {
        Along::Decades => along.place(micros.max(0.1)),
        Along::Evenly => micros,
    };
    let scale = Scale::new((place(least), place(most)), (0.0, BARS as f64));
    let mut bars = [0u64; BARS];
    for (time, count) in distribution.counts() {
        let at = scale.at(place(micros(time).clamp(least, most)));
        bars[(at as usize).min(BARS - 1)] += count;
    }
    html += &plot::bars(name, "µs", along, scale.domain, &bars);
    _ = write!(
        html,
        "<p class=quiet>{} values",
        count(distribution.count())
    );
    for (percent, time) in distribution.percentiles() {
        _ = write!(html, " · p{percent} {} µs", timing::micros(time));
    }
    _ = write!(html, " · max {} µs</p></figure>", timing::micros(greatest));
    html
}
