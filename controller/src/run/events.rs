//! What a person does in a validated run, from a CSV file: `t_s,event,value`.

use crate::control::Order;
use std::collections::VecDeque;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Events and what their value is: percent from 0 to this, or none.
const EVENTS: [(&str, Option<f64>); 7] = [
    ("feed_override", Some(200.0)),
    ("rapid_override", Some(100.0)),
    ("hold", None),
    ("resume", None),
    ("stop_after_block", None),
    ("step_back", None),
    ("stop", None),
];

/// Orders in the order of their times.
#[derive(Clone, Debug, Default)]
pub struct Events(VecDeque<(f64, Order)>);

/// An events file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EventsError {
    /// It cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file as it was named.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line is wrong.
    #[error("{}:{line}:{column}: {problem}\n  {text}\n  {:>width$}", file.display(), "^", width = column)]
    Line {
        /// The file as it was named.
        file: PathBuf,
        /// 1-based.
        line: usize,
        /// 1-based, in characters.
        column: usize,
        /// What is wrong, and what is allowed.
        problem: String,
        /// The line.
        text: String,
    },
}

impl Events {
    /// Reads a file: the header `t_s,event,value`, then one event a line. `t_s` is the time of the
    /// trace, and does not go back; a value is a percentage, and only overrides have one.
    ///
    /// # Errors
    /// It cannot be read, or the first line that is wrong.
    pub fn load(file: &Path) -> Result<Self, EventsError> {
        let text = fs::read_to_string(file).map_err(|source| EventsError::Read {
            file: file.to_owned(),
            source,
        })?;
        Self::parse(file, &text)
    }

    /// The same from a text; `file` only names it in messages.
    ///
    /// # Errors
    /// The first line that is wrong.
    pub fn parse(file: &Path, text: &str) -> Result<Self, EventsError> {
        let mut events = VecDeque::new();
        let mut before = 0.0;
        let header = |line: &str| line.split(',').map(str::trim).eq(["t_s", "event", "value"]);
        // An empty file has no header either.
        let lines = text.lines().chain(text.is_empty().then_some(""));
        for (index, line) in lines.enumerate() {
            let refuse = |column: usize, problem: String| EventsError::Line {
                file: file.to_owned(),
                line: index + 1,
                column: column + 1,
                problem,
                text: line.to_owned(),
            };
            if index == 0 {
                if !header(line) {
                    return Err(refuse(
                        0,
                        "the header has to be `t_s,event,value`".to_owned(),
                    ));
                }
                continue;
            }
            if line.trim().is_empty() {
                continue;
            }
            let fields = fields(line);
            let &[(at, time), (event_at, event), ref rest @ ..] = &fields[..] else {
                let problem = "there is no event: write `t_s,event,value`".to_owned();
                return Err(refuse(line.chars().count(), problem));
            };
            let seconds = time.parse().ok().filter(|it: &f64| it.is_finite());
            let seconds = seconds.filter(|it| *it >= before).ok_or_else(|| {
                let problem = format!("`{time}` is no time: allowed: seconds from {before} on");
                refuse(at, problem)
            })?;
            before = seconds;
            let known = EVENTS.iter().find(|(name, _)| *name == event);
            let (name, most) = known.copied().ok_or_else(|| {
                let names = EVENTS.map(|(name, _)| name);
                let near = |name: &&str| (strsim::jaro_winkler(name, event) * 1e6) as u64;
                let nearest = names.iter().max_by_key(|name| near(name)).copied();
                let (nearest, names) = (nearest.unwrap_or_default(), names.join(", "));
                refuse(
                    event_at,
                    format!("unknown event `{event}`; nearest: `{nearest}`; allowed: {names}"),
                )
            })?;
            let (value_at, value) = match rest {
                [] => (line.chars().count(), ""),
                [value] => *value,
                [_, (more, _), ..] => {
                    return Err(refuse(*more, "nothing follows the value".to_owned()));
                }
            };
            let part = match most {
                None if value.is_empty() => 0.0,
                None => return Err(refuse(value_at, format!("`{name}` has no value"))),
                Some(most) => {
                    let percent = value.parse().ok();
                    let percent = percent.filter(|it: &f64| (0.0..=most).contains(it));
                    percent.ok_or_else(|| {
                        let problem = format!("`{name}` needs a value from 0 to {most} (%)");
                        refuse(value_at, problem)
                    })? / 100.0
                }
            };
            let order = match name {
                "feed_override" => Order::FeedOverride(part),
                "rapid_override" => Order::RapidOverride(part),
                "hold" => Order::Hold,
                "resume" => Order::Resume,
                "stop_after_block" => Order::StopAfterBlock,
                "step_back" => Order::StepBack,
                _ => Order::Interrupt,
            };
            events.push_back((seconds, order));
        }
        Ok(Self(events))
    }

    /// The next order that is due at this time, s.
    pub fn due(&mut self, now: f64) -> Option<Order> {
        let (at, _) = self.0.front()?;
        if *at > now {
            return None;
        }
        self.0.pop_front().map(|(_, order)| order)
    }
}

/// The fields of a line, each with its column from 0.
fn fields(line: &str) -> Vec<(usize, &str)> {
    let mut at = 0;
    let of = |field| {
        let trimmed = str::trim_start(field);
        let start = at + field.chars().count() - trimmed.chars().count();
        at += field.chars().count() + 1;
        (start, trimmed.trim_end())
    };
    line.split(',').map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Events, EventsError> {
        Events::parse(Path::new("e.csv"), text)
    }

    #[test]
    fn orders_come_when_they_are_due() {
        let text = "t_s,event,value\r\n0.5, hold,\n0.5,feed_override, 120\n\n2,resume\n";
        let mut events = parse(text).unwrap();
        assert_eq!(events.due(0.49), None);
        assert_eq!(events.due(0.5), Some(Order::Hold));
        assert_eq!(events.due(0.5), Some(Order::FeedOverride(1.2)));
        assert_eq!(events.due(1.9), None);
        assert_eq!(events.due(2.5), Some(Order::Resume));
        assert_eq!(events.due(9.0), None);
    }

    #[test]
    fn mistakes_are_told_with_their_place() {
        for (text, place, told) in [
            ("t,event,value\n", "e.csv:1:1:", "header"),
            ("t_s,event,value\n1\n", "e.csv:2:2:", "no event"),
            ("t_s,event,value\n-1,hold,\n", "e.csv:2:1:", "from 0 on"),
            (
                "t_s,event,value\n2,hold,\n1,hold,\n",
                "e.csv:3:1:",
                "from 2 on",
            ),
            ("t_s,event,value\nnan,hold,\n", "e.csv:2:1:", "no time"),
            (
                "t_s,event,value\n1, hodl,\n",
                "e.csv:2:4:",
                "nearest: `hold`",
            ),
            ("t_s,event,value\n1,hold,5\n", "e.csv:2:8:", "no value"),
            (
                "t_s,event,value\n1,feed_override,\n",
                "e.csv:2:17:",
                "0 to 200",
            ),
            (
                "t_s,event,value\n1,feed_override\n",
                "e.csv:2:16:",
                "0 to 200",
            ),
            (
                "t_s,event,value\n1,rapid_override,101\n",
                "e.csv:2:18:",
                "0 to 100",
            ),
            (
                "t_s,event,value\n1,hold,,x\n",
                "e.csv:2:9:",
                "nothing follows",
            ),
            ("", "e.csv:1:1:", "header"),
        ] {
            let error = match parse(text) {
                Err(error) => error.to_string(),
                Ok(events) => panic!("{text:?}: {events:?}"),
            };
            assert!(
                error.starts_with(place) && error.contains(told),
                "{text:?}: {error}"
            );
        }
    }
}
