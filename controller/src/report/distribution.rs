//! How often a time was how long.

use super::{
    html::escape,
    scale::{Scale, count, number},
};
use crate::observe::timing::{self, Distribution};
use std::{fmt::Write, time::Duration};

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 210.0;
const LEFT: f64 = 76.0;
const BARS: usize = 64;

/// A card with bars, both axes logarithmic but for narrow distributions, and percentiles.
pub(super) fn card(distribution: &Distribution) -> String {
    let name = distribution.name();
    let mut html = format!("<figure><figcaption>{}</figcaption>", escape(name));
    let Some((least, greatest)) = distribution.extent() else {
        return html + "<p class=quiet>No values.</p></figure>";
    };
    let micros = |time: Duration| time.as_nanos() as f64 * 1e-3;
    let (least, most) = (micros(least), micros(greatest));
    let logarithmic = most > 8.0 * least.max(1e-3);
    let place = |value: f64| {
        if logarithmic {
            value.max(0.1).log10()
        } else {
            value
        }
    };
    let x = Scale::new((place(least), place(most)), (LEFT, WIDTH - 12.0));

    let mut bars = [0u64; BARS];
    for (time, count) in distribution.counts() {
        let value = place(micros(time).clamp(least, most));
        let share = (value - x.domain.0) / (x.domain.1 - x.domain.0);
        bars[((share * BARS as f64) as usize).min(BARS - 1)] += count;
    }
    let tallest = bars.iter().copied().max().unwrap_or(1).max(1);
    let floor = HEIGHT - 30.0;
    let y = Scale::new((-0.3, (tallest as f64).log10().max(0.7)), (floor, 12.0));
    _ = write!(
        html,
        "<svg class=view viewBox='0 0 {WIDTH} {HEIGHT}' role=img aria-label='{}'>",
        escape(name)
    );
    for decade in 0..=(tallest as f64).log10() as u32 {
        let at = y.at(f64::from(decade));
        _ = write!(
            html,
            "<path class=grid d='M{LEFT} {at:.1}H{:.1}'/>\
             <text class=tick x={:.1} y={:.1} text-anchor=end>{}</text>",
            WIDTH - 12.0,
            LEFT - 6.0,
            at + 3.5,
            count(10u64.pow(decade))
        );
    }
    let cell = (x.range.1 - x.range.0) / BARS as f64;
    for (n, bar) in bars.iter().enumerate().filter(|(_, bar)| **bar > 0) {
        let top = y.at((*bar as f64).log10());
        _ = write!(
            html,
            "<rect class=bar x={:.1} y={top:.1} width={:.1} height={:.1}><title>{}</title></rect>",
            x.range.0 + n as f64 * cell,
            cell - 1.0,
            floor - top,
            count(*bar)
        );
    }
    let ticks: Vec<(f64, String)> = if logarithmic {
        let decades = x.domain.0.floor() as i32..=x.domain.1.ceil() as i32;
        decades
            .flat_map(|decade| [1.0, 2.0, 5.0].map(|n| n * 10f64.powi(decade)))
            .map(|tick| (tick.log10(), number(tick)))
            .filter(|(at, _)| (x.domain.0..=x.domain.1).contains(at))
            .collect()
    } else {
        x.ticks(6)
    };
    let every = ticks.len().div_ceil(9).max(1);
    for (tick, label) in ticks.into_iter().step_by(every) {
        _ = write!(
            html,
            "<text class=tick x={:.1} y={:.1} text-anchor=middle>{label}</text>",
            x.at(tick),
            floor + 16.0,
        );
    }
    _ = write!(
        html,
        "<text class=tick x={:.1} y={:.1} text-anchor=end>µs</text></svg><p class=quiet>{} values",
        WIDTH - 12.0,
        HEIGHT - 1.0,
        count(distribution.count())
    );
    for (percent, time) in distribution.percentiles() {
        _ = write!(html, " · p{percent} {} µs", timing::micros(time));
    }
    _ = write!(html, " · max {} µs</p></figure>", timing::micros(greatest));
    html
}
