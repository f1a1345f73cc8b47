//! Reads one TOML table key by key and remembers which keys it may have.

use super::diagnostic::Log;
use std::{
    fmt::Display,
    ops::{Range, RangeInclusive},
    time::Duration,
};
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// A value that is good, with its place for what is checked later.
pub type Found<T> = Option<Spanned<T>>;

/// A table while it is read: every key is asked for once, then [`finish`](Table::finish) reports
/// the missing ones and the ones nobody asked for.
pub struct Table<'a, 'i> {
    /// How messages call it: `axis "X"`.
    pub title: String,
    /// Its header.
    pub span: Range<usize>,
    entries: &'a DeTable<'i>,
    known: Vec<&'static str>,
    /// Keys that are required and absent, each with what it allows.
    missing: Vec<(&'static str, String)>,
}

impl<'a, 'i> Table<'a, 'i> {
    /// A table to be asked for its keys: how messages call it, where its header stands, what is in it.
    pub fn new(title: &str, span: Range<usize>, entries: &'a DeTable<'i>) -> Self {
        Self {
            title: title.into(),
            span,
            entries,
            known: Vec::new(),
            missing: Vec::new(),
        }
    }

    fn get(&mut self, key: &'static str) -> Option<&'a Spanned<DeValue<'i>>> {
        self.known.push(key);
        self.entries.get(key)
    }

    fn require(
        &mut self,
        key: &'static str,
        allowed: impl Display,
    ) -> Option<&'a Spanned<DeValue<'i>>> {
        let value = self.get(key);
        if value.is_none() {
            self.missing.push((key, allowed.to_string()));
        }
        value
    }

    /// What `read` makes of a key that may be left out.
    fn optional<T>(
        &mut self,
        key: &'static str,
        read: impl FnOnce(&mut Self) -> Option<T>,
    ) -> Option<T> {
        if self.entries.contains_key(key) {
            read(self)
        } else {
            self.known.push(key);
            None
        }
    }

    fn wrong(
        &self,
        log: &mut Log<'_>,
        key: &str,
        value: &Spanned<DeValue<'_>>,
        allowed: impl Display,
    ) {
        log.report(
            value.span(),
            format!("{}: `{key}` is {}", self.title, shown(value.get_ref())),
            format!("allowed: {allowed}"),
        );
    }

    /// A required text that `accept` takes.
    pub fn text(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        accept: impl Fn(&str) -> bool,
    ) -> Found<String> {
        let value = self.require(key, allowed)?;
        match value.get_ref().as_str() {
            Some(text) if accept(text) => Some(Spanned::new(value.span(), text.into())),
            _ => {
                self.wrong(log, key, value, allowed);
                None
            }
        }
    }

    /// A text, if the key is there.
    pub fn text_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        accept: impl Fn(&str) -> bool,
    ) -> Found<String> {
        self.optional(key, |table| table.text(log, key, allowed, accept))
    }

    /// A required name: one of `names`.
    pub fn choice<'n>(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> Found<String> {
        let allowed = one_of(names.clone());
        let value = self.require(key, &allowed)?;
        let Some(text) = value.get_ref().as_str() else {
            self.wrong(log, key, value, allowed);
            return None;
        };
        if names.clone().any(|name| name == text) {
            return Some(Spanned::new(value.span(), text.into()));
        }
        let nearest = nearest(text, names)
            .map(|name| format!("; nearest: \"{name}\""))
            .unwrap_or_default();
        self.wrong(log, key, value, format!("{allowed}{nearest}"));
        None
    }

    /// One of `names`, if the key is there.
    pub fn choice_if<'n>(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> Found<String> {
        self.optional(key, |table| table.choice(log, key, names))
    }

    /// One of `names`, or `default`.
    pub fn choice_or<'n>(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        default: &str,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> String {
        self.choice_if(log, key, names)
            .map_or_else(|| default.into(), Spanned::into_inner)
    }

    /// A text, or `default`.
    pub fn text_or(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        default: &str,
        allowed: &str,
        accept: impl Fn(&str) -> bool,
    ) -> String {
        self.text_if(log, key, allowed, accept)
            .map_or_else(|| default.into(), Spanned::into_inner)
    }

    /// A required list of texts, as many as `count` says.
    pub fn texts(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        count: RangeInclusive<usize>,
    ) -> Found<Vec<Spanned<String>>> {
        let value = self.require(key, allowed)?;
        let texts = value.get_ref().as_array().and_then(|items| {
            let text = |item: &Spanned<DeValue<'_>>| {
                let text = item.get_ref().as_str()?;
                Some(Spanned::new(item.span(), text.to_owned()))
            };
            let texts: Option<Vec<_>> = items.iter().map(text).collect();
            texts.filter(|texts| count.contains(&texts.len()))
        });
        if texts.is_none() {
            self.wrong(log, key, value, allowed);
        }
        texts.map(|texts| Spanned::new(value.span(), texts))
    }

    /// A list of texts, if the key is there.
    pub fn texts_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        count: RangeInclusive<usize>,
    ) -> Found<Vec<Spanned<String>>> {
        self.optional(key, |table| table.texts(log, key, allowed, count))
    }

    /// `true` or `false`, or `default`.
    pub fn flag_or(&mut self, log: &mut Log<'_>, key: &'static str, default: bool) -> bool {
        match self.get(key) {
            None => default,
            Some(value) => value.get_ref().as_bool().unwrap_or_else(|| {
                self.wrong(log, key, value, "true or false");
                default
            }),
        }
    }

    /// A required whole number in `range`.
    pub fn integer(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        range: RangeInclusive<i64>,
        unit: &str,
    ) -> Found<i64> {
        let allowed = format!("a whole number {}…{}{unit}", range.start(), range.end());
        let value = self.require(key, &allowed)?;
        match integer(value.get_ref()) {
            Some(number) if range.contains(&number) => Some(Spanned::new(value.span(), number)),
            _ => {
                self.wrong(log, key, value, allowed);
                None
            }
        }
    }

    /// A whole number in `range`, or `default`.
    pub fn integer_or(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        default: i64,
        range: RangeInclusive<i64>,
        unit: &str,
    ) -> i64 {
        self.integer_if(log, key, range, unit)
            .map_or(default, Spanned::into_inner)
    }

    /// 1…`most` milliseconds, or `default`.
    pub fn millis_or(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        default: i64,
        most: i64,
    ) -> Duration {
        let ms = self.integer_or(log, key, default, 1..=most, " (ms)");
        Duration::from_millis(ms as u64)
    }

    /// A whole number in `range`, if the key is there.
    pub fn integer_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        range: RangeInclusive<i64>,
        unit: &str,
    ) -> Found<i64> {
        self.optional(key, |table| table.integer(log, key, range, unit))
    }

    /// A required number that `accept` takes.
    pub fn number(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        accept: impl Fn(f64) -> bool,
    ) -> Found<f64> {
        let value = self.require(key, allowed)?;
        match number(value.get_ref()) {
            Some(number) if accept(number) => Some(Spanned::new(value.span(), number)),
            _ => {
                self.wrong(log, key, value, allowed);
                None
            }
        }
    }

    /// A number that `accept` takes, if the key is there.
    pub fn number_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        accept: impl Fn(f64) -> bool,
    ) -> Found<f64> {
        self.optional(key, |table| table.number(log, key, allowed, accept))
    }

    /// A required number above zero.
    pub fn positive(&mut self, log: &mut Log<'_>, key: &'static str, unit: &str) -> Found<f64> {
        self.number(log, key, &above_zero(unit), |number| number > 0.0)
    }

    /// A number above zero, if the key is there.
    pub fn positive_if(&mut self, log: &mut Log<'_>, key: &'static str, unit: &str) -> Found<f64> {
        self.number_if(log, key, &above_zero(unit), |number| number > 0.0)
    }

    /// A number above zero, or `default`.
    pub fn positive_or(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        default: f64,
        unit: &str,
    ) -> f64 {
        self.positive_if(log, key, unit)
            .map_or(default, Spanned::into_inner)
    }

    /// Reports a key that stands for another one.
    pub fn misread(&mut self, log: &mut Log<'_>, key: &'static str, meant: &str) {
        if let Some((place, _)) = self.entries.get_key_value(key) {
            self.known.push(key);
            log.report(
                place.span(),
                format!("{}: unknown key `{key}`", self.title),
                format!("probably meant: {meant}"),
            );
        }
    }

    /// Whether the key is there and has a text that `is` it.
    pub fn has_text(&self, key: &str, is: impl Fn(&str) -> bool) -> bool {
        let value = self.entries.get(key);
        value.is_some_and(|value| value.get_ref().as_str().is_some_and(is))
    }

    /// Where the value of a key stands, if it is there.
    pub fn span_of(&self, key: &str) -> Option<Range<usize>> {
        self.entries.get(key).map(Spanned::span)
    }

    /// A required pair of numbers, the second above the first.
    pub fn interval(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
    ) -> Found<(f64, f64)> {
        let value = self.require(key, allowed)?;
        let pair = value.get_ref().as_array().and_then(|items| {
            let [least, most] = &items[..] else {
                return None;
            };
            let (least, most) = (number(least.get_ref())?, number(most.get_ref())?);
            (least < most).then_some((least, most))
        });
        if pair.is_none() {
            self.wrong(log, key, value, allowed);
        }
        pair.map(|pair| Spanned::new(value.span(), pair))
    }

    /// A pair of numbers, the second above the first, if the key is there.
    pub fn interval_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
    ) -> Found<(f64, f64)> {
        self.optional(key, |table| table.interval(log, key, allowed))
    }

    /// A list of points, each of as many numbers, that `accept` takes, if the key is there; the first number of each is
    /// above that of the point before.
    pub fn points_if<const N: usize>(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        accept: impl Fn([f64; N]) -> bool,
    ) -> Found<Vec<[f64; N]>> {
        self.optional(key, |table| table.points(log, key, allowed, accept))
    }

    /// The same, required.
    pub fn points<const N: usize>(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
        accept: impl Fn([f64; N]) -> bool,
    ) -> Found<Vec<[f64; N]>> {
        let value = self.require(key, allowed)?;
        let point = |item: &Spanned<DeValue<'_>>| {
            let numbers = item.get_ref().as_array()?.iter();
            let numbers: Option<Vec<_>> = numbers.map(|it| number(it.get_ref())).collect();
            <[f64; N]>::try_from(numbers?).ok()
        };
        let items = value.get_ref().as_array();
        let points: Option<Vec<_>> = items.and_then(|items| items.iter().map(point).collect());
        let points = points.filter(|points| {
            let ascends = points.windows(2).all(|pair| pair[0][0] < pair[1][0]);
            ascends && points.iter().all(|&it| accept(it))
        });
        if points.is_none() {
            self.wrong(log, key, value, allowed);
        }
        points.map(|points| Spanned::new(value.span(), points))
    }

    /// The items of a list, if the key is there.
    pub fn items(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
    ) -> &'a [Spanned<DeValue<'i>>] {
        let Some(value) = self.get(key) else {
            return &[];
        };
        value.get_ref().as_array().map_or_else(
            || {
                self.wrong(log, key, value, allowed);
                &[][..]
            },
            |items| &items[..],
        )
    }

    /// The one table `[key]`, required or not.
    pub fn table(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        required: bool,
    ) -> Option<Table<'a, 'i>> {
        let allowed = format!("one table [{key}]");
        if required && !self.entries.contains_key(key) {
            self.require(key, &allowed);
            return None;
        }
        self.table_if(log, key, &allowed)
    }

    /// A table, if the key is there.
    pub fn table_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        allowed: &str,
    ) -> Option<Table<'a, 'i>> {
        let value = self.get(key)?;
        let table = value.get_ref().as_table();
        if table.is_none() {
            self.wrong(log, key, value, allowed);
        }
        table.map(|table| Table::new(key, value.span(), table))
    }

    /// The tables `[[key]]`, at least one, each called by its name.
    pub fn tables(&mut self, log: &mut Log<'_>, key: &'static str) -> Vec<Table<'a, 'i>> {
        let allowed = format!("one or more tables [[{key}]]");
        let Some(value) = self.require(key, &allowed) else {
            return Vec::new();
        };
        let tables = tables(key, "name", value).filter(|tables| !tables.is_empty());
        tables.unwrap_or_else(|| {
            self.wrong(log, key, value, allowed);
            Vec::new()
        })
    }

    /// The tables `[[key]]`, if there are any, each called by what `name` says.
    pub fn tables_if(
        &mut self,
        log: &mut Log<'_>,
        key: &'static str,
        name: &str,
    ) -> Vec<Table<'a, 'i>> {
        let Some(value) = self.get(key) else {
            return Vec::new();
        };
        tables(key, name, value).unwrap_or_else(|| {
            self.wrong(log, key, value, format!("tables [[{key}]]"));
            Vec::new()
        })
    }

    /// Reports keys that do not exist here, and those that are missing unless one of the former
    /// is a misspelling of it.
    pub fn finish(self, log: &mut Log<'_>) {
        let mut misspelt = Vec::new();
        for key in self.entries.keys() {
            let name: &str = key.get_ref();
            if self.known.contains(&name) {
                continue;
            }
            let keys = self.known.iter().copied();
            let nearest = nearest(name, keys.clone());
            if let Some(nearest) = nearest
                && strsim::damerau_levenshtein(name, nearest) <= 1 + name.len() / 3
            {
                misspelt.push(nearest);
            }
            log.report(
                key.span(),
                format!("{}: unknown key `{name}`", self.title),
                format!(
                    "nearest valid key: `{}`; allowed: {}",
                    nearest.unwrap_or_default(),
                    keys.collect::<Vec<_>>().join(", ")
                ),
            );
        }
        for (key, allowed) in self.missing {
            if !misspelt.contains(&key) && !log.is_left_out(&self.span, key) {
                log.report(
                    self.span.clone(),
                    format!("{}: missing key `{key}`", self.title),
                    format!("add `{key}`: {allowed}"),
                );
            }
        }
    }
}

/// A list's tables; `None` where it is something else.
fn tables<'a, 'i>(
    key: &str,
    name: &str,
    value: &'a Spanned<DeValue<'i>>,
) -> Option<Vec<Table<'a, 'i>>> {
    let items = value.get_ref().as_array()?;
    let table = |item: &'a Spanned<DeValue<'i>>| {
        let entries = item.get_ref().as_table()?;
        let title = match entries.get(name).map(Spanned::get_ref) {
            Some(DeValue::String(name)) => format!("{key} \"{name}\""),
            Some(DeValue::Integer(number)) => format!("{key} {number}"),
            _ => key.to_owned(),
        };
        Some(Table::new(&title, item.span(), entries))
    };
    items.iter().map(table).collect()
}

fn above_zero(unit: &str) -> String {
    format!("a number above 0 {unit}")
}

/// The name most like `name`, in whatever case.
pub fn nearest<'n>(name: &str, names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let name = name.to_lowercase();
    names.min_by_key(|candidate| strsim::damerau_levenshtein(&name, &candidate.to_lowercase()))
}

/// `"a", "b" or "c"`.
pub fn one_of<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let mut names: Vec<_> = names.map(|name| format!("\"{name}\"")).collect();
    match (names.pop(), names.is_empty()) {
        (Some(last), false) => format!("{} or {last}", names.join(", ")),
        (last, _) => last.unwrap_or_else(|| "none".into()),
    }
}

/// A whole number, if it is one that an i64 holds.
pub fn integer(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// A finite number, whole or not.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    let number = match value {
        DeValue::Float(float) => float.as_str().parse::<f64>().ok()?,
        _ => integer(value)? as f64,
    };
    number.is_finite().then_some(number)
}

/// A value as a message shows it.
fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("\"{text}\""),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(time) => time.to_string(),
        DeValue::Array(items) => {
            let items: Vec<_> = items.iter().map(|item| shown(item.get_ref())).collect();
            format!("[{}]", items.join(", "))
        }
        DeValue::Table(_) => "a table".into(),
    }
}
