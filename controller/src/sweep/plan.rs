//! Which values a run has.
//!
//! Every value of a run is a function of the seed and of two numbers, that of the run and that of the variable: each
//! draw has a stream of random numbers of its own. Of a Latin hypercube of N runs the range of each variable is
//! cut into N strata, and a shuffle that is the variable's own says which run has which stratum, so that each of
//! them comes once.

use std::path::Path;
use syncline_drives::twin::random::Random;
use syncline_strict_toml::{Invalid, Log, Table, parse};

/// Runs that a sweep has at most.
pub(super) const MOST: u64 = 1_000_000;

/// How values are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Every value of each key with every value of all others; the last key's changes first.
    Grid,
    /// As many strata as runs; each comes once for each key.
    LatinHypercube,
    /// Each value on its own, all alike.
    MonteCarlo,
}

impl Method {
    const NAMES: [(&str, Self); 3] = [
        ("grid", Self::Grid),
        ("latin_hypercube", Self::LatinHypercube),
        ("monte_carlo", Self::MonteCarlo),
    ];
}

/// A key and the values that it is given.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// As `--set` takes it: `axis.X.max_jerk`.
    pub key: String,
    values: Values,
}

#[derive(Clone, Debug, PartialEq)]
enum Values {
    /// As TOML has them.
    Listed(Vec<String>),
    /// Whole numbers, both ends included; steps in a grid.
    Whole { from: i64, to: i64, steps: u64 },
    /// Numbers; steps in a grid.
    Real { from: f64, to: f64, steps: u64 },
}

/// Where in its values a variable is.
#[derive(Clone, Copy, Debug)]
enum At {
    /// A value of a grid.
    Step(u64),
    /// Part of the way, 0…1, 1 excluded.
    Part(f64),
}

impl Values {
    /// How many a grid has.
    fn steps(&self) -> u64 {
        match self {
            Self::Listed(values) => values.len() as u64,
            Self::Whole { steps, .. } | Self::Real { steps, .. } => *steps,
        }
    }

    /// One of them, as TOML has it.
    fn value(&self, at: At) -> String {
        let last = self.steps().saturating_sub(1).max(1);
        match self {
            Self::Listed(values) => match at {
                At::Step(step) => values[step as usize].clone(),
                At::Part(part) => values[(part * values.len() as f64) as usize].clone(),
            },
            Self::Whole { from, to, .. } => {
                let span = i128::from(*to) - i128::from(*from);
                let offset = match at {
                    At::Step(step) => span * i128::from(step) / i128::from(last),
                    At::Part(part) => (part * (span + 1) as f64) as i128,
                };
                (i128::from(*from) + offset.min(span)).to_string()
            }
            Self::Real { from, to, .. } => {
                let part = match at {
                    At::Step(step) => step as f64 / last as f64,
                    At::Part(part) => part,
                };
                // Debug's form: there is always a point or an exponent, so that it stays a float.
                format!("{:?}", (from * (1.0 - part) + to * part).clamp(*from, *to))
            }
        }
    }
}

/// What is varied, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Vary {
    /// How.
    pub method: Method,
    /// What; at least one.
    pub variables: Vec<Variable>,
}

impl Vary {
    /// Reads a file's text; `file` only names it in messages.
    ///
    /// # Errors
    /// Everything that is wrong in it.
    pub fn parse(file: &Path, source: &str) -> Result<Self, Invalid> {
        let mut log = Log::new(source);
        let vary = Self::read(&mut log, source);
        let diagnostics = log.into_diagnostics();
        match vary {
            Some(vary) if diagnostics.is_empty() => Ok(vary),
            _ => Err(Invalid {
                file: file.into(),
                diagnostics,
            }),
        }
    }

    fn read(log: &mut Log<'_>, source: &str) -> Option<Self> {
        let document = parse(log, source);
        let mut file = Table::new("file of what to vary", 0..0, document.get_ref());
        let names = Method::NAMES.iter().map(|(name, _)| *name);
        let method = file.choice(log, "method", names);
        let method = method.and_then(|name| {
            let mut methods = Method::NAMES.iter();
            methods.find_map(|(it, method)| (it == name.get_ref()).then_some(*method))
        });
        let tables = file.tables_if(log, "vary", "key");
        if tables.is_empty() {
            let allowed = "add one or more tables [[vary]], each with `key` and its values";
            log.report(0..0, "nothing is varied", allowed);
        }
        let is_grid = method == Some(Method::Grid);
        let mut variables: Vec<Variable> = Vec::new();
        for table in tables {
            let place = table.span.clone();
            let Some(variable) = Variable::read(log, source, table, is_grid) else {
                continue;
            };
            if variables.iter().any(|it| it.key == variable.key) {
                let told = format!("`{}` is varied twice", variable.key);
                log.report(place, told, "vary each key once");
            }
            variables.push(variable);
        }
        file.finish(log);
        let method = method?;
        (!variables.is_empty()).then_some(Self { method, variables })
    }
}

impl Variable {
    fn read(
        log: &mut Log<'_>,
        source: &str,
        mut table: Table<'_, '_>,
        is_grid: bool,
    ) -> Option<Self> {
        let key = "a key as `--set` takes it: \"axis.X.max_jerk\"";
        let key = table.text(log, "key", key, |key| !key.is_empty());
        let allowed = "a list of one or more values";
        let items = table.items(log, "values", allowed);
        let values = match table.span_of("values") {
            None => Self::range(log, source, &mut table, is_grid),
            Some(place) => {
                if items.is_empty() {
                    log.report(place, "`values` is empty", allowed);
                }
                let written = items.iter().map(|item| source[item.span()].to_owned());
                Some(Values::Listed(written.collect()))
            }
        };
        table.finish(log);
        Some(Self {
            key: key?.into_inner(),
            values: values?,
        })
    }

    /// Numbers between two, which are whole where both are written so.
    fn range(
        log: &mut Log<'_>,
        source: &str,
        table: &mut Table<'_, '_>,
        is_grid: bool,
    ) -> Option<Values> {
        let allowed = "a number, and `to` above it; or `values`, a list";
        let from = table.number(log, "from", allowed, |_| true);
        let least = from.as_ref().map_or(f64::MIN, |from| *from.get_ref());
        let to = table.number(log, "to", "a number above `from`", |to| to > least);
        let steps = match is_grid {
            true => {
                let unit = " values, both ends included";
                Some(table.integer(log, "steps", 2..=MOST as i64, unit)?)
            }
            false => None,
        };
        let (from, to) = (from?, to?);
        let whole = |place: std::ops::Range<usize>| -> Option<i64> {
            source[place].replace('_', "").parse().ok()
        };
        let ends = (whole(from.span()), whole(to.span()));
        if let (Some(from), Some(to)) = ends
            && let Some(steps) = &steps
            && (i128::from(to) - i128::from(from)) % i128::from(*steps.get_ref() - 1) != 0
        {
            let place = steps.span();
            let told = format!(
                "{} whole numbers from {from} to {to} are not evenly apart",
                steps.get_ref()
            );
            let allowed =
                "`steps` that part the range evenly, `values`, or ends with a point as 1.0";
            log.report(place, told, allowed);
        }
        let steps = steps.map_or(0, |steps| steps.into_inner() as u64);
        Some(match ends {
            (Some(from), Some(to)) => Values::Whole { from, to, steps },
            _ => Values::Real {
                from: from.into_inner(),
                to: to.into_inner(),
                steps,
            },
        })
    }
}

/// Which values every run of a sweep has.
#[derive(Clone, Debug)]
pub struct Plan {
    vary: Vary,
    runs: u64,
    seed: u64,
    /// The strata of a Latin hypercube: of each variable, by run.
    strata: Vec<Vec<u32>>,
}

impl Plan {
    /// Of so many runs; of a grid as many as it has.
    ///
    /// # Errors
    /// The number of runs is missing, none, too large, or not the grid's.
    pub fn new(vary: Vary, runs: Option<u64>, seed: u64) -> Result<Self, String> {
        let grid = vary.variables.iter().try_fold(1u64, |product, variable| {
            product.checked_mul(variable.values.steps())
        });
        let runs = match (vary.method, runs) {
            (Method::Grid, runs) => {
                let grid = grid.unwrap_or(u64::MAX);
                if runs.is_some_and(|runs| runs != grid) {
                    return Err(format!("this grid has {grid} runs: leave out --runs"));
                }
                grid
            }
            (_, Some(runs)) => runs,
            (_, None) => return Err("say with --runs how many runs there are to be".into()),
        };
        if !(1..=MOST).contains(&runs) {
            return Err(format!("{runs} runs: a sweep has 1 to {MOST}"));
        }
        let strata = match vary.method {
            Method::LatinHypercube => (0..vary.variables.len() as u64)
                .map(|variable| shuffled(runs as u32, Random::new(seed, u64::MAX - variable)))
                .collect(),
            Method::Grid | Method::MonteCarlo => Vec::new(),
        };
        Ok(Self {
            vary,
            runs,
            seed,
            strata,
        })
    }

    /// How many runs there are.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.runs
    }

    /// The keys that are varied.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.vary.variables.iter().map(|it| it.key.as_str())
    }

    /// The seed of a run's drives.
    #[must_use]
    pub fn seed(&self, run: u64) -> u64 {
        self.seed.wrapping_add(run)
    }

    /// The values of a run in the order of the keys, as TOML has them.
    #[must_use]
    pub fn values(&self, run: u64) -> Vec<String> {
        let variables = self.vary.variables.iter().enumerate();
        let value =
            |(index, variable): (usize, &Variable)| variable.values.value(self.at(index, run));
        variables.map(value).collect()
    }

    /// The values of a run as `--set` takes them.
    #[must_use]
    pub fn settings(&self, run: u64) -> Vec<String> {
        let values = self.values(run);
        let settings = self.keys().zip(values);
        settings
            .map(|(key, value)| format!("{key}={value}"))
            .collect()
    }

    /// Each key alone with the first of its values, as `--set` takes it, and with all that are no numbers: they may name files.
    pub fn samples(&self) -> impl Iterator<Item = String> {
        self.vary.variables.iter().flat_map(|it| {
            let first = [it.values.value(At::Step(0))];
            let named = match &it.values {
                Values::Listed(values) => &values[1..],
                Values::Whole { .. } | Values::Real { .. } => &[],
            };
            let named = named.iter().filter(|value| value.parse::<f64>().is_err());
            let all = first.into_iter().chain(named.cloned());
            all.map(|value| format!("{}={value}", it.key))
        })
    }

    fn at(&self, variable: usize, run: u64) -> At {
        let drawn = || Random::new(self.seed, (variable as u64) << 32 | run).unit();
        match self.vary.method {
            Method::Grid => {
                let behind = &self.vary.variables[variable + 1..];
                let stride: u64 = behind.iter().map(|it| it.values.steps()).product();
                At::Step(run / stride % self.vary.variables[variable].values.steps())
            }
            Method::LatinHypercube => {
                let stratum = f64::from(self.strata[variable][run as usize]);
                At::Part(((stratum + drawn()) / self.runs as f64).min(1.0 - f64::EPSILON))
            }
            Method::MonteCarlo => At::Part(drawn()),
        }
    }
}

/// 0 to `count` - 1 in random order, each order as likely as every other (Fisher and Yates).
fn shuffled(count: u32, mut random: Random) -> Vec<u32> {
    let mut numbers: Vec<u32> = (0..count).collect();
    for last in (1..numbers.len()).rev() {
        numbers.swap(last, (random.unit() * (last + 1) as f64) as usize);
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Values of each kind, and how a file has them.
    fn values() -> impl Strategy<Value = Values> {
        prop_oneof![
            prop::collection::btree_set(-999..999i64, 1..5)
                .prop_map(|values| Values::Listed(values.iter().map(i64::to_string).collect())),
            (-1000..1000i64, 1..300i64, 2..5u64).prop_map(|(from, apart, steps)| Values::Whole {
                from,
                to: from + apart * (steps as i64 - 1),
                steps
            }),
            (-1e6..1e6f64, 1e-6..1e6f64, 2..5u64).prop_map(|(from, span, steps)| Values::Real {
                from,
                to: from + span,
                steps
            }),
            // Whose ends are whole, though they are no whole numbers.
            (-1000..1000i32, 1..1000i32, 2..5u64).prop_map(|(from, span, steps)| Values::Real {
                from: from.into(),
                to: (from + span).into(),
                steps
            }),
        ]
    }

    fn vary(method: Method) -> impl Strategy<Value = Vary> {
        prop::collection::vec(values(), 1..4).prop_map(move |values| Vary {
            method,
            variables: values
                .into_iter()
                .enumerate()
                .map(|(index, values)| Variable {
                    key: format!("axis.X{index}.max_jerk"),
                    values,
                })
                .collect(),
        })
    }

    /// As a file has it.
    fn written(vary: &Vary) -> String {
        let mut names = Method::NAMES.iter();
        let name = names.find(|(_, method)| *method == vary.method).unwrap().0;
        let mut text = format!("method = \"{name}\"\n");
        for Variable { key, values } in &vary.variables {
            text += &format!("[[vary]]\nkey = \"{key}\"\n");
            let steps = match vary.method {
                Method::Grid => format!("steps = {}\n", values.steps()),
                _ => String::new(),
            };
            text += &match values {
                Values::Listed(values) => format!("values = [{}]\n", values.join(", ")),
                Values::Whole { from, to, .. } => format!("from = {from}\nto = {to}\n{steps}"),
                Values::Real { from, to, .. } => format!("from = {from:?}\nto = {to:?}\n{steps}"),
            };
        }
        text
    }

    /// Where in its range a value is, 0…1.
    fn part(values: &Values, value: &str) -> f64 {
        let number = |text: &str| text.parse::<f64>().unwrap();
        match values {
            Values::Listed(all) => {
                let place = all.iter().position(|it| it == value).expect("one of them");
                (place as f64 + 0.5) / all.len() as f64
            }
            Values::Whole { from, to, .. } => {
                let value: i64 = value.parse().expect("whole numbers stay whole");
                assert!((*from..=*to).contains(&value));
                ((value - from) as f64 + 0.5) / (to - from + 1) as f64
            }
            Values::Real { from, to, .. } => {
                assert!(value.contains(['.', 'e']), "{value} stays a float");
                assert!((*from..=*to).contains(&number(value)));
                (number(value) - from) / (to - from)
            }
        }
    }

    proptest! {
        #[test]
        fn a_file_says_what_is_varied(vary in prop_oneof![
            vary(Method::Grid), vary(Method::LatinHypercube), vary(Method::MonteCarlo)
        ]) {
            let read = Vary::parse(Path::new("vary.toml"), &written(&vary)).unwrap();
            let (plan, other) = (Plan::new(read, None, 1), Plan::new(vary.clone(), None, 1));
            if vary.method == Method::Grid {
                let (plan, other) = (plan.unwrap(), other.unwrap());
                prop_assert_eq!(plan.runs(), other.runs());
                for run in 0..plan.runs() {
                    prop_assert_eq!(plan.settings(run), other.settings(run));
                }
            } else {
                prop_assert!(plan.unwrap_err().contains("--runs"));
            }
        }

        #[test]
        fn a_grid_has_every_combination_once(vary in vary(Method::Grid)) {
            let steps: u64 = vary.variables.iter().map(|it| it.values.steps()).product();
            let ends: Vec<_> = vary.variables.iter().map(|it| {
                [0, it.values.steps() - 1].map(|step| it.values.value(At::Step(step)))
            }).collect();
            let plan = Plan::new(vary.clone(), None, 7).unwrap();
            prop_assert_eq!(plan.runs(), steps);
            let all: BTreeSet<_> = (0..steps).map(|run| plan.values(run)).collect();
            prop_assert_eq!(all.len() as u64, steps);
            for (index, variable) in vary.variables.iter().enumerate() {
                let of_it: BTreeSet<_> = all.iter().map(|values| &values[index]).collect();
                prop_assert!(ends[index].iter().all(|end| of_it.contains(end)));
                for value in of_it {
                    part(&variable.values, value);
                }
            }
        }

        /// Each stratum has one run, of each variable.
        #[test]
        fn a_latin_hypercube_has_each_stratum_once(
            vary in vary(Method::LatinHypercube), runs in 1..60u64, seed: u64
        ) {
            let plan = Plan::new(vary.clone(), Some(runs), seed).unwrap();
            for (index, variable) in vary.variables.iter().enumerate() {
                let parts = (0..runs).map(|run| part(&variable.values, &plan.values(run)[index]));
                let mut parts: Vec<f64> = parts.collect();
                parts.sort_by(f64::total_cmp);
                // Half the width of a value among few; of numbers what rounding makes.
                let count = match &variable.values {
                    Values::Listed(values) => values.len() as f64,
                    Values::Whole { from, to, .. } => (to - from + 1) as f64,
                    Values::Real { .. } => 1e6,
                };
                for (stratum, part) in parts.iter().enumerate() {
                    let low = stratum as f64 / runs as f64 - 0.51 / count;
                    let high = (stratum + 1) as f64 / runs as f64 + 0.51 / count;
                    prop_assert!((low..=high).contains(part), "{stratum} of {runs}: {part}");
                }
            }
        }

        /// The same run has the same values, and others than its neighbours.
        #[test]
        fn draws_are_a_function_of_the_run(vary in vary(Method::MonteCarlo), seed: u64) {
            let plan = Plan::new(vary.clone(), Some(50), seed).unwrap();
            let again = Plan::new(vary.clone(), Some(60), seed).unwrap();
            for (index, variable) in vary.variables.iter().enumerate() {
                let values: Vec<_> = (0..50).map(|run| plan.values(run)[index].clone()).collect();
                prop_assert_eq!(&values[20], &again.values(20)[index]);
                values.iter().for_each(|value| { part(&variable.values, value); });
                let real = matches!(variable.values, Values::Real { .. });
                prop_assert!(!real || values.iter().collect::<BTreeSet<_>>().len() == 50);
            }
        }
    }

    #[test]
    fn mistakes_are_told() {
        for (text, told) in [
            ("method = \"grid\"\n", "nothing is varied"),
            (
                "method = \"sobol\"\n[[vary]]\nkey = \"a\"\nvalues = [1]\n",
                "\"latin_hypercube\"",
            ),
            (
                "method = \"grid\"\n[[vary]]\nkey = \"a\"\nvalues = []\n",
                "`values` is empty",
            ),
            (
                "method = \"grid\"\n[[vary]]\nkey = \"a\"\nfrom = 1\nto = 2\n",
                "missing key `steps`",
            ),
            (
                "method = \"grid\"\n[[vary]]\nkey = \"a\"\nfrom = 0\nto = 10\nsteps = 4\n",
                "4 whole numbers from 0 to 10 are not evenly apart",
            ),
            (
                "method = \"monte_carlo\"\n[[vary]]\nkey = \"a\"\nfrom = 2\nto = 2\n",
                "above `from`",
            ),
            (
                "method = \"grid\"\n[[vary]]\nkey = \"a\"\nvalues = [1]\n[[vary]]\nkey = \"a\"\nvalues = [2]\n",
                "varied twice",
            ),
        ] {
            let invalid = Vary::parse(Path::new("vary.toml"), text)
                .unwrap_err()
                .to_string();
            assert!(invalid.contains(told), "{told}: {invalid}");
        }
    }
}
