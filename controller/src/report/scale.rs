//! From values to places on the page, and numbers as people read them.

/// A linear scale: values of `domain` to pixels of `range`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) domain: (f64, f64),
    pub(super) range: (f64, f64),
}

impl Scale {
    /// An empty or single-valued domain is widened, so that every scale has an extent.
    pub(super) fn new(domain: (f64, f64), range: (f64, f64)) -> Self {
        let (least, most) = if domain.0.is_finite() && domain.1.is_finite() {
            domain
        } else {
            (0.0, 1.0)
        };
        let pad = if most - least > f64::EPSILON * least.abs().max(most.abs()) {
            0.0
        } else {
            (least.abs() * 0.05).max(0.5)
        };
        Self {
            domain: (least - pad, most + pad),
            range,
        }
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        let share = (value - self.domain.0) / (self.domain.1 - self.domain.0);
        self.range.0 + share * (self.range.1 - self.range.0)
    }

    /// Pixels of 0, and of 1 more.
    pub(super) fn linear(&self) -> (f64, f64) {
        let origin = self.at(0.0);
        (origin, self.at(1.0) - origin)
    }

    /// Round values inside the domain with their labels, `count` of them or a few more or less.
    pub(super) fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        let (least, most) = self.domain;
        let rough = (most - least) / count.max(1) as f64;
        let decade = 10f64.powf(rough.log10().floor());
        let step = [10.0, 5.0, 2.0]
            .map(|nice| nice * decade)
            .into_iter()
            .find(|step| *step <= rough * 1.25)
            .unwrap_or(decade);
        let first = (least / step - 1e-9).ceil() as i64;
        let last = (most / step + 1e-9).floor() as i64;
        let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        (first..=last)
            .map(|n| n as f64 * step)
            .map(|value| (value, grouped(&format!("{value:.decimals$}"))))
            .collect()
    }
}

/// The least and the greatest finite value, if there is one.
pub(super) fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .into_iter()
        .filter(|value| value.is_finite())
        .fold(None, |extent, value| match extent {
            None => Some((value, value)),
            Some((least, most)) => Some((value.min(least), value.max(most))),
        })
}

/// A number with four significant digits, thousands apart.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let magnitude = value.abs();
    let text = if magnitude == 0.0 {
        "0".into()
    } else if !(1e-5..1e7).contains(&magnitude) {
        return format!("{value:.2e}");
    } else {
        let whole_digits = magnitude.log10().floor() as i32 + 1;
        let decimals = (4 - whole_digits).clamp(0, 9) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    };
    grouped(&text)
}

/// A count, thousands apart.
pub(super) fn count(value: u64) -> String {
    grouped(&value.to_string())
}

fn grouped(text: &str) -> String {
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let (sign, digits) = match whole.strip_prefix('-') {
        Some(digits) => ("\u{2212}", digits),
        None => ("", whole),
    };
    let mut out = String::from(sign);
    for (n, digit) in digits.chars().enumerate() {
        if n > 0 && digits.len() > 4 && (digits.len() - n) % 3 == 0 {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out + rest
}

/// Down to 1, 2 or 5 times a power of ten; at least 1.
pub(super) fn round_down(value: f64) -> f64 {
    let decade = 10f64.powf(value.max(1.0).log10().floor());
    let steps = [5.0, 2.0, 1.0].into_iter();
    steps
        .map(|it| it * decade)
        .find(|it| *it <= value)
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let ticks = |least, most, count| {
            let ticks = Scale::new((least, most), (0.0, 1.0)).ticks(count);
            ticks.into_iter().map(|tick| tick.0).collect::<Vec<_>>()
        };
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(-0.3, 0.31, 3), [-0.2, 0.0, 0.2]);
        assert_eq!(ticks(1.0, 1.0, 2), [0.5, 1.0, 1.5]);
        assert!(ticks(f64::NAN, f64::INFINITY, 3).len() > 1);
        let labels = Scale::new((1999.6, 2001.0), (0.0, 1.0)).ticks(3);
        assert_eq!(
            labels.iter().map(|t| &*t.1).collect::<Vec<_>>(),
            ["2000.0", "2000.5", "2001.0"]
        );
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (700.0, "700"),
            (1234.56, "1235"),
            (60_000.0, "60\u{202f}000"),
            (-0.012_346, "\u{2212}0.01235"),
            (2.5, "2.5"),
            (1e-9, "1.00e-9"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(count(30_000), "30\u{202f}000");
    }
}
