//! `forces` in `[simulation]`: the force on the tool along the path of a program, from a file that something else has measured or
//! computed.

use super::files::Files;
use std::io;
use std::path::PathBuf;
use syncline_strict_toml::{Log, Table, input};

/// The first line of such a file: distance along the path, mm, and the force along X, Y and Z of the machine, N.
const COLUMNS: [&str; 4] = ["path_mm", "x_n", "y_n", "z_n"];
/// More than any tool bears, N.
const MOST: f64 = 1e6;
/// More lines are no forces of a program that anybody waits for.
const MOST_LINES: usize = 5_000_000;

/// Forces on the tool, at distances along the path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathForces {
    /// Where they are from.
    pub file: PathBuf,
    /// Ascending distances, mm, with forces along X, Y and Z, N.
    points: Vec<(f64, [f64; 3])>,
}

impl PathForces {
    /// Along X, Y and Z, N, where the path has come so far, mm: linear between the lines of the file, none before the first one and
    /// behind the last.
    #[must_use]
    pub fn at(&self, distance: f64) -> [f64; 3] {
        let behind = self.points.partition_point(|(at, _)| *at <= distance);
        let Some(&(from, before)) = behind.checked_sub(1).and_then(|it| self.points.get(it)) else {
            return [0.0; 3];
        };
        match self.points.get(behind) {
            Some(&(to, next)) => {
                let part = (distance - from) / (to - from);
                [0, 1, 2].map(|it| before[it] + part * (next[it] - before[it]))
            }
            None if distance == from => before,
            None => [0.0; 3],
        }
    }
}

/// The forces that a table names.
pub(super) fn read(
    log: &mut Log<'_>,
    files: &mut Files,
    table: &mut Table<'_, '_>,
) -> Option<PathForces> {
    let allowed = "a CSV file with the columns path_mm,x_n,y_n,z_n";
    let name = table.text_if(log, "forces", allowed, |it| !it.is_empty())?;
    let file = files.named(name.get_ref());
    let lines = input::lines(&file).map_err(|why| why.to_string());
    match lines.and_then(points) {
        Ok(points) => Some(PathForces { file, points }),
        Err(problem) => {
            let problem = format!("{}: `forces`: {}: {problem}", table.title, name.get_ref());
            log.report(name.span(), problem, format!("allowed: {allowed}"));
            None
        }
    }
}

/// The lines of a file, or what is wrong in it.
fn points(text: impl io::Read) -> Result<Vec<(f64, [f64; 3])>, String> {
    let mut csv = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text);
    let header = csv.headers().map_err(|why| why.to_string())?;
    if header.iter().ne(COLUMNS) {
        return Err(format!("its first line is not {}", COLUMNS.join(",")));
    }
    let mut points: Vec<(f64, [f64; 3])> = Vec::new();
    for (row, record) in (1..).zip(csv.into_records()) {
        let record = record.map_err(|why| why.to_string())?;
        let number = |column: usize| {
            let value = record.get(column).and_then(|it| it.parse::<f64>().ok());
            let value = value.filter(|it| it.is_finite());
            value.ok_or_else(|| format!("row {row}: `{}` is no number", COLUMNS[column]))
        };
        let at = number(0)?;
        if points.last().is_some_and(|(before, _)| *before >= at) {
            return Err(format!("row {row}: `path_mm` does not ascend"));
        }
        let force = [number(1)?, number(2)?, number(3)?];
        if force.iter().any(|it| it.abs() > MOST) {
            return Err(format!("row {row}: a force is beyond {MOST} N"));
        }
        if points.len() == MOST_LINES {
            return Err(format!("it has more than {MOST_LINES} lines"));
        }
        points.push((at, force));
    }
    match points.len() {
        0 | 1 => Err("it has no two lines of forces".to_owned()),
        _ => Ok(points),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(text: &str) -> Result<PathForces, String> {
        let points = points(text.as_bytes())?;
        let file = PathBuf::new();
        Ok(PathForces { file, points })
    }

    proptest! {
        /// What is written is read; between two lines the force is between theirs by the same part, and outside there is none.
        #[test]
        fn forces_are_linear_between_their_lines(
            steps in prop::collection::vec((1e-3..50.0_f64, prop::array::uniform3(-2000.0..2000.0_f64)), 2..30),
            part in 0.0..1.0_f64, start in -10.0..500.0_f64,
        ) {
            let mut text = String::from("path_mm,x_n,y_n,z_n\n");
            let mut at = start;
            let mut lines = Vec::new();
            for (step, [x, y, z]) in steps {
                at += step;
                text += &format!("{at:?}, {x:?},{y:?},{z:?}\n");
                lines.push((at, [x, y, z]));
            }
            let forces = of(&text).unwrap();
            for pair in lines.windows(2) {
                let [(from, before), (to, next)] = [pair[0], pair[1]];
                prop_assert_eq!(forces.at(from), before);
                prop_assert_eq!(forces.at(to), next);
                let between = forces.at(from + part * (to - from));
                for n in 0..3 {
                    let wanted = before[n] + part * (next[n] - before[n]);
                    prop_assert!((between[n] - wanted).abs() < 1e-6 * 2000.0);
                }
            }
            prop_assert_eq!(forces.at(lines[0].0 - 1e-6), [0.0; 3]);
            prop_assert_eq!(forces.at(at + 1e-6), [0.0; 3]);
        }
    }

    #[test]
    fn what_is_no_such_file_is_refused() {
        let head = "path_mm,x_n,y_n,z_n\n";
        for (text, why) in [
            (
                "line,x_n,y_n,z_n\n1,0,0,0\n2,0,0,0\n",
                "its first line is not path_mm,x_n,y_n,z_n",
            ),
            (head, "it has no two lines of forces"),
            (&format!("{head}0,1,2,3\n"), "it has no two lines of forces"),
            (
                &format!("{head}0,1,2,3\n5,1,x,3\n"),
                "row 2: `y_n` is no number",
            ),
            (
                &format!("{head}0,1,2,3\n5,1,NaN,3\n"),
                "row 2: `y_n` is no number",
            ),
            (
                &format!("{head}5,1,2,3\n\n\n5,1,2,3\n"),
                "row 2: `path_mm` does not ascend",
            ),
            (
                &format!("{head}0,1,2,3\n5,1,2e7,3\n"),
                "row 2: a force is beyond 1000000 N",
            ),
        ] {
            assert_eq!(of(text), Err(why.to_owned()));
        }
        assert!(of(&format!("{head}0,1,2,3\n5,1,2\n")).is_err());
    }
}
