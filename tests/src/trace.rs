//! Checks a trace against the limits, trusting no planner: plain differences of what was sent.

use std::fmt;
use syncline_controller::machine::{HomingMethod, Machine};

/// A trace, as `--trace` writes it or as a [`rig`](crate::rig) recorded it.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Seconds between two rows.
    pub cycle: f64,
    /// In the machine's order.
    pub axes: Vec<AxisTrace>,
    /// Program line by row.
    pub line: Vec<u32>,
    /// A quick stop cut the plan off, which did not come to rest.
    pub cut_off: bool,
}

/// One axis, by row, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisTrace {
    /// As the machine file names it.
    pub name: String,
    /// Setpoints.
    pub set: Vec<f64>,
    /// Actual positions.
    pub act: Vec<f64>,
    /// Greatest velocity, acceleration and jerk allowed, by mm and s.
    pub limits: [f64; 3],
    /// Its drive goes point to point by itself: where it was measured stands for setpoints, and no limit is
    /// judged by that.
    pub by_itself: bool,
    /// It is referenced by a homing, after which the same place has another position.
    pub homes: bool,
}

impl AxisTrace {
    /// The setpoints between changes of the reference, each with the row that it begins in: where the
    /// setpoint and the actual position of an axis that homes change alike, by more than the axis can go
    /// in a cycle.
    #[must_use]
    pub fn by_reference(&self, cycle: f64) -> Vec<(usize, &[f64])> {
        let farthest = 2.0 * self.limits[0] * cycle;
        let changes = (1..self.set.len()).filter(|&row| {
            let [set, act] = [&self.set, &self.act].map(|of| of[row] - of[row - 1]);
            self.homes && set.abs() > farthest && (set - act).abs() < farthest
        });
        let mut begins = vec![0];
        begins.extend(changes);
        let ends = begins.iter().skip(1).copied().chain([self.set.len()]);
        let pieces = begins.iter().zip(ends);
        pieces
            .map(|(&begin, end)| (begin, &self.set[begin..end]))
            .collect()
    }
}

/// What has limits.
const QUANTITIES: [&str; 3] = ["velocity", "acceleration", "jerk"];

/// Something above its limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Excess<'a> {
    /// Whose.
    pub axis: &'a str,
    /// `velocity`, `acceleration` or `jerk`.
    pub what: &'static str,
    /// In which row.
    pub row: usize,
    /// How much.
    pub value: f64,
    /// Of how much.
    pub limit: f64,
}

impl fmt::Display for Excess<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            axis,
            what,
            row,
            value,
            limit,
        } = self;
        write!(f, "{what} of axis {axis} in row {row}: {value} of {limit}")
    }
}

/// The machine's axes without a row.
#[must_use]
pub fn axes(machine: &Machine) -> Vec<AxisTrace> {
    let axes = machine.axes.iter().map(|axis| AxisTrace {
        name: axis.name().to_owned(),
        set: Vec::new(),
        act: Vec::new(),
        limits: [
            axis.limits.velocity,
            axis.limits.acceleration,
            axis.limits.jerk,
        ],
        by_itself: machine.point_to_point()[axis.letter.index()],
        homes: axis.homing.method != HomingMethod::Encoder,
    });
    axes.collect()
}

impl Trace {
    /// Reads what `--trace` wrote.
    ///
    /// # Panics
    /// If it is not what the user guide promises: columns, and rows a cycle apart from 0.
    #[must_use]
    pub fn read(machine: &Machine, csv: &str) -> Self {
        let cycle = machine.cycle.as_secs_f64();
        let mut axes = axes(machine);
        let mut line = Vec::new();
        let mut reader = csv::Reader::from_reader(csv.as_bytes());
        let columns = axes
            .iter()
            .flat_map(|axis| ["set", "act"].map(|what| format!("{}_{what}", axis.name)));
        let columns: Vec<String> = ["t_s".to_owned(), "line".to_owned()]
            .into_iter()
            .chain(columns)
            .collect();
        // Switched outputs follow.
        let header = reader.headers().expect("a header");
        assert!(header.iter().take(columns.len()).eq(&columns), "{header:?}");
        for (row, record) in reader.records().enumerate() {
            let record = record.expect("a row");
            let field = |column: usize| {
                let value: f64 = record[column].parse().expect("a number");
                assert_eq!(
                    record[column],
                    value.to_string(),
                    "shortest round-trip decimals"
                );
                value
            };
            let nanoseconds = row as u128 * machine.cycle.as_nanos();
            assert_eq!(field(0), nanoseconds as f64 / 1e9, "row {row}");
            line.push(record[1].parse().expect("a line"));
            for (index, axis) in axes.iter_mut().enumerate() {
                axis.set.push(field(2 + 2 * index));
                axis.act.push(field(3 + 2 * index));
            }
        }
        Self {
            cycle,
            axes,
            line,
            cut_off: false,
        }
    }

    /// What exceeds a limit, by the differences of the setpoints: at rest before the first row
    /// and, unless it was cut off, after the last one.
    ///
    /// Differences average the plan over a cycle, so they can only be smaller; allowed on top are
    /// one part in a million, and for each difference the rounding of the positions in it.
    #[must_use]
    pub fn excesses(&self) -> Vec<Excess<'_>> {
        let mut excesses = Vec::new();
        self.differences(|excess, allowed| {
            if excess.value.is_nan() || excess.value > allowed {
                excesses.push(excess);
            }
        });
        excesses
    }

    /// The greatest velocity, acceleration and jerk of any axis as parts of their limits.
    #[must_use]
    pub fn loads(&self) -> [f64; 3] {
        let mut loads = [0.0_f64; 3];
        self.differences(|it, _| {
            let order = QUANTITIES.iter().position(|what| *what == it.what);
            let load = &mut loads[order.unwrap_or(0)];
            *load = load.max(it.value / it.limit);
        });
        loads
    }

    /// Hands out every difference with what is allowed for it.
    fn differences<'a>(&'a self, mut look: impl FnMut(Excess<'a>, f64)) {
        for axis in self.axes.iter().filter(|axis| !axis.by_itself) {
            for (begin, set) in axis.by_reference(self.cycle) {
                let (Some(&first), Some(&last)) = (set.first(), set.last()) else {
                    continue;
                };
                let mut padded = vec![first; 3];
                padded.extend(set);
                if !self.cut_off || begin + set.len() < axis.set.len() {
                    padded.extend([last; 3]);
                }
                let greatest = padded.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
                let ulp = greatest.next_up() - greatest;
                let mut differences = padded;
                let mut span = 1.0;
                for (order, what) in QUANTITIES.into_iter().enumerate() {
                    span *= self.cycle;
                    differences = differences.windows(2).map(|w| w[1] - w[0]).collect();
                    let limit = axis.limits[order];
                    let allowed = limit * (1.0 + 1e-6) + 8.0 * 4.0 * ulp / span;
                    for (index, difference) in differences.iter().enumerate() {
                        let excess = Excess {
                            axis: &axis.name,
                            what,
                            row: begin + (index + order + 1).saturating_sub(3),
                            value: difference.abs() / span,
                            limit,
                        };
                        look(excess, allowed);
                    }
                }
            }
        }
    }

    /// Panics if a limit is exceeded, with the first excesses.
    ///
    /// # Panics
    /// Or if there is nothing to check.
    pub fn assert_within_limits(&self) {
        assert!(!self.line.is_empty(), "an empty trace proves nothing");
        let excesses = self.excesses();
        let first: Vec<String> = excesses.iter().take(5).map(Excess::to_string).collect();
        assert!(
            excesses.is_empty(),
            "{} excesses: {first:#?}",
            excesses.len()
        );
    }

    /// The axis of that name.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn axis(&self, name: &str) -> &AxisTrace {
        let axis = self.axes.iter().find(|axis| axis.name == name);
        axis.unwrap_or_else(|| panic!("no axis {name}"))
    }

    /// Whether every setpoint of the last `rows` rows is the same.
    #[must_use]
    pub fn ends_at_rest(&self, rows: usize) -> bool {
        self.axes.iter().all(|axis| {
            let end = &axis.set[axis.set.len().saturating_sub(rows)..];
            end.iter().all(|set| *set == end[0])
        })
    }
}

/// The checker is checked: what it must see, it sees.
#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: f64 = 0.002;

    /// An axis that is moved by a jerk, sampled exactly: up and down again at its limits.
    fn good() -> Trace {
        let jerk = 1000.0;
        let step = 50; // cycles, each ramp of the acceleration
        let (mut p, mut v, mut a) = (1000.0_f64, 0.0, 0.0);
        let mut set = vec![p; 5];
        let phases = [1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0];
        for phase in phases {
            for _ in 0..step {
                let j = phase * jerk;
                p += CYCLE * (v + CYCLE * (a / 2.0 + CYCLE * j / 6.0));
                v += CYCLE * (a + CYCLE * j / 2.0);
                a += CYCLE * j;
                set.push(p);
            }
        }
        set.extend([p; 5]);
        Trace {
            cycle: CYCLE,
            line: vec![1; set.len()],
            cut_off: false,
            axes: vec![AxisTrace {
                name: "X".into(),
                act: set.clone(),
                set,
                limits: [20.0, 100.0, jerk],
                by_itself: false,
                homes: false,
            }],
        }
    }

    fn whats(trace: &Trace) -> Vec<&str> {
        let mut whats: Vec<_> = trace.excesses().iter().map(|it| it.what).collect();
        whats.dedup();
        whats
    }

    #[test]
    fn motion_at_its_limits_passes() {
        good().assert_within_limits();
        assert!(good().ends_at_rest(5));
    }

    #[test]
    fn each_limit_is_seen_when_it_is_exceeded_by_a_thousandth() {
        for (order, what) in QUANTITIES.into_iter().enumerate() {
            let mut trace = good();
            trace.axes[0].limits[order] /= 1.001;
            assert_eq!(whats(&trace), [what]);
            assert!((trace.loads()[order] - 1.001).abs() < 1e-6, "{what}");
        }
    }

    #[test]
    fn a_doctored_setpoint_is_seen() {
        // A ten-thousandth of a millimetre is 12,500 mm/s³ in the third difference.
        let mut trace = good();
        trace.axes[0].set[100] += 1e-4;
        let excesses = trace.excesses();
        assert!(excesses.iter().all(|it| it.row.abs_diff(100) <= 3));
        assert!(excesses.iter().any(|it| it.what == "jerk"));

        let mut trace = good();
        trace.axes[0].set[100] = f64::NAN;
        assert!(!trace.excesses().is_empty());
    }

    #[test]
    fn another_reference_is_no_motion_of_an_axis_that_homes_and_rests() {
        let shifted = |from: usize, homes: bool, act: bool| {
            let mut trace = good();
            let axis = &mut trace.axes[0];
            axis.homes = homes;
            axis.set[from..].iter_mut().for_each(|it| *it += 180.0);
            if act {
                axis.act[from..].iter_mut().for_each(|it| *it += 180.0);
            }
            trace
        };
        shifted(3, true, true).assert_within_limits();
        for trace in [
            shifted(3, false, true),
            shifted(3, true, false),
            shifted(100, true, true),
        ] {
            assert!(!trace.excesses().is_empty());
        }
    }

    #[test]
    fn a_lost_row_and_an_end_in_motion_are_seen() {
        let mut trace = good();
        trace.axes[0].set.remove(150);
        assert!(whats(&trace).contains(&"jerk"));
        let mut trace = good();
        trace.axes[0].set.truncate(150);
        assert!(whats(&trace).contains(&"acceleration"));
        assert!(!trace.ends_at_rest(2));
    }
}
