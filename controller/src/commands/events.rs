//! What an operator does, in words: in a validated run from a CSV file, `t_s,event,value`, and on the
//! lines of a console.

use crate::machine::COORDINATES;
use crate::session::{
    Command, Direction, Jog, LEAST, MOST_FEED, MOST_RAPID, Override, StepChange, SwitchChange,
};
use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use syncline_gcode::AxisLetter;
use syncline_strict_toml::input;

/// What an operator may write.
#[derive(Clone, Copy)]
pub(super) struct Event {
    pub(super) name: &'static str,
    /// What its value has to be; empty where it has none.
    needs: &'static str,
    /// What comes of it.
    meaning: &'static str,
    /// The command that it makes with a value, of one that is right.
    read: fn(&str) -> Option<Command>,
}

/// For a list: `jog_step   how far a key moves an axis: a distance in mm or degrees`.
impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<18} {}", self.name, self.meaning)?;
        match self.needs {
            "" => Ok(()),
            needs => write!(f, ": {needs}"),
        }
    }
}

/// All that there are.
pub(super) const EVENTS: [Event; 27] = [
    Event {
        name: "feed_override",
        needs: "0 or a value from 0.1 to 200 (%)",
        meaning: "sets the feed to a part of what is programmed; 0 rests on the path",
        read: |value| percent(value, MOST_FEED).map(Command::FeedOverride),
    },
    Event {
        name: "rapid_override",
        needs: "0 or a value from 0.1 to 100 (%)",
        meaning: "sets the speed of rapid moves, homing and jogs to a part of theirs; 0 holds them",
        read: |value| percent(value, MOST_RAPID).map(Command::RapidOverride),
    },
    Event {
        name: "feed_hold",
        needs: "",
        meaning: "the axes come to rest on the path and wait there",
        read: |_| Some(Command::FeedHold),
    },
    Event {
        name: "resume",
        needs: "",
        meaning: "a program that was held or interrupted is taken up; cycle_start confirms it",
        read: |_| Some(Command::Resume),
    },
    Event {
        name: "single_block",
        needs: ON_OFF,
        meaning: "the path rests behind each block",
        read: |value| switch(value).map(Command::SingleBlock),
    },
    Event {
        name: "optional_stop",
        needs: ON_OFF,
        meaning: "M1 stops as M0 does",
        read: |value| switch(value).map(Command::OptionalStop),
    },
    Event {
        name: "retrace",
        needs: "",
        meaning: "from a hold, one block back along the path",
        read: |_| Some(Command::Retrace),
    },
    Event {
        name: "jog",
        needs: "an axis and a distance as `X+1.5`, or its sign as `X-`; then as `F600` mm/min (A, B, C: °/min), at will",
        meaning: "moves one axis by a distance, or for as long as it is renewed",
        read: |value| jog(value).map(Command::Jog),
    },
    Event {
        name: "renew_jog",
        needs: AXIS,
        meaning: "a jog goes on: to be said at least every 200 ms",
        read: |value| axis(value).map(Command::RenewJog),
    },
    Event {
        name: "end_jog",
        needs: AXIS,
        meaning: "a jog comes to rest",
        read: |value| axis(value).map(Command::EndJog),
    },
    Event {
        name: "jog_to",
        needs: POSITIONS,
        meaning: "moves axes there, machine coordinates, each by its own way",
        read: |value| positions(value).map(|to| Command::Jog(Jog::To(to))),
    },
    Event {
        name: "move_to",
        needs: POSITIONS,
        meaning: "moves axes there, machine coordinates, on a straight line",
        read: |value| positions(value).map(|to| Command::Jog(Jog::Line(to))),
    },
    Event {
        name: "stop",
        needs: "",
        meaning: "what is at work ends on its path, and outputs become safe",
        read: |_| Some(Command::Stop),
    },
    Event {
        name: "cycle_start",
        needs: "",
        meaning: "begins the program that is loaded, or goes on",
        read: |_| Some(Command::CycleStart),
    },
    Event {
        name: "jog_step",
        needs: "a distance in mm or degrees",
        meaning: "how far a key moves an axis",
        read: |value| {
            let step = number(value).filter(|step| *step > 0.0);
            step.map(|step| Command::JogStep(StepChange::To(step)))
        },
    },
    Event {
        name: "go_to",
        needs: POSITIONS,
        meaning: "moves axes there, work coordinates, on a straight line",
        read: |value| positions(value).map(Command::GoTo),
    },
    Event {
        name: "set_offset",
        needs: POSITIONS,
        meaning: "the work offset in effect, so that the tool stands there",
        read: |value| positions(value).map(Command::SetWorkOffset),
    },
    Event {
        name: "set_tool_length",
        needs: POSITIONS,
        meaning: "the length of the tool, so that its tip stands there",
        read: |value| positions(value).map(Command::SetToolLength),
    },
    Event {
        name: "load",
        needs: "a file",
        meaning: "which program `run` begins",
        read: |value| (!value.is_empty()).then(|| Command::Load(value.into())),
    },
    Event {
        name: "run",
        needs: "nothing, or the line to begin at",
        meaning: "begins the program that is loaded",
        read: |value| {
            let from_line = match value {
                "" => None,
                line => Some(line.parse().ok().filter(|line| *line > 0)?),
            };
            Some(Command::Run { from_line })
        },
    },
    Event {
        name: "mdi",
        needs: "blocks, with `;` in between",
        meaning: "does typed lines",
        read: |value| {
            let lines = value.replace(';', "\n");
            (!value.is_empty()).then_some(Command::Mdi(lines))
        },
    },
    Event {
        name: "home",
        needs: "nothing, or axes as `X Y`",
        meaning: "homes axes, all without a value",
        read: |value| letters(value).map(Command::Home),
    },
    Event {
        name: "output",
        needs: "the name of an output, then `on` or `off`",
        meaning: "switches an output by hand where the machine rests",
        read: output,
    },
    Event {
        name: "enable",
        needs: "",
        meaning: "drives get their power",
        read: |_| Some(Command::Enable),
    },
    Event {
        name: "disable",
        needs: "",
        meaning: "drives lose their power, once the axes rest",
        read: |_| Some(Command::Disable),
    },
    Event {
        name: "reset",
        needs: "",
        meaning: "behind a fault: drives are set up anew, nothing moves",
        read: |_| Some(Command::Reset),
    },
    Event {
        name: "switch_off",
        needs: "",
        meaning: "ends the session, drives without power",
        read: |_| Some(Command::SwitchOff),
    },
];

const ON_OFF: &str = "`on` or `off`";

/// The command that an event's name and its value make, for those who know these `other` words, too.
///
/// # Errors
/// What is wrong with them.
pub(super) fn command(event: &str, value: &str, other: &[&str]) -> Result<Command, String> {
    let Event {
        name, needs, read, ..
    } = known(event, other)?;
    if needs.is_empty() && !value.is_empty() {
        return Err(format!("`{name}` has no value"));
    }
    read(value).ok_or_else(|| format!("`{name}` needs {needs}"))
}

/// The event of that name.
fn known(event: &str, other: &[&str]) -> Result<Event, String> {
    if let Some((_, now)) = RENAMED.iter().find(|(old, _)| *old == event) {
        return Err(format!("`{event}` is called `{now}` now"));
    }
    let known = EVENTS.iter().find(|it| it.name == event);
    known.copied().ok_or_else(|| {
        let names = [&EVENTS.map(|it| it.name), other].concat();
        let near = |name: &&str| (strsim::jaro_winkler(name, event) * 1e6) as u64;
        let nearest = names.iter().max_by_key(|name| near(name)).copied();
        let (nearest, names) = (nearest.unwrap_or_default(), names.join(", "));
        format!("unknown event `{event}`; nearest: `{nearest}`; allowed: {names}")
    })
}

const AXIS: &str = "an axis as `X`";
const POSITIONS: &str = "axes and their positions as `X10 Y-2.5`";

/// Events of files of old, and what each is called now.
const RENAMED: [(&str, &str); 3] = [
    ("hold", "feed_hold"),
    ("stop_after_block", "single_block"),
    ("step_back", "retrace"),
];

/// `on`, `off`
fn switch(value: &str) -> Option<SwitchChange> {
    match value {
        "on" => Some(SwitchChange::To(true)),
        "off" => Some(SwitchChange::To(false)),
        _ => None,
    }
}

/// `clamp on`; names may have spaces.
fn output(value: &str) -> Option<Command> {
    let (name, on) = value.rsplit_once(char::is_whitespace)?;
    let SwitchChange::To(on) = switch(on)? else {
        return None;
    };
    let name = name.trim_end().to_owned();
    (!name.is_empty()).then_some(Command::Output { name, on })
}

/// So many percent.
fn percent(value: &str, most: f64) -> Option<Override> {
    let percent = value.parse().ok();
    let percent = percent.filter(|it: &f64| *it == 0.0 || (LEAST..=most).contains(it));
    percent.map(Override::To)
}

/// `X`
fn axis(value: &str) -> Option<AxisLetter> {
    let (letter, rest) = word(value)?;
    AxisLetter::from_letter(letter).filter(|_| rest.is_empty())
}

/// A letter and what follows it.
fn word(word: &str) -> Option<(char, &str)> {
    let letter = word.chars().next()?;
    Some((letter.to_ascii_uppercase(), &word[letter.len_utf8()..]))
}

/// A plain decimal number.
fn number(text: &str) -> Option<f64> {
    let plain = |c: char| c.is_ascii_digit() || "+-.".contains(c);
    let number = text.parse().ok().filter(|it: &f64| it.is_finite());
    number.filter(|_| text.chars().all(plain))
}

/// `X+1.5`, `X-1.5 F600`, `X+`, `X- F600`
fn jog(value: &str) -> Option<Jog> {
    let mut words = value.split_whitespace().map(word);
    let (letter, distance) = words.next()??;
    let axis = AxisLetter::from_letter(letter)?;
    let speed = match words.next() {
        None => None,
        Some(feed) => {
            let (letter, feed) = feed?;
            let feed = number(feed).filter(|it| letter == 'F' && *it > 0.0);
            Some(feed? / 60.0)
        }
    };
    if words.next().is_some() {
        return None;
    }
    let continuous = |direction| Jog::Continuous {
        axis,
        direction,
        speed,
    };
    Some(match distance {
        "+" => continuous(Direction::Positive),
        "-" => continuous(Direction::Negative),
        _ => Jog::By {
            axis,
            distance: number(distance).filter(|_| distance.starts_with(['+', '-']))?,
            speed,
        },
    })
}

/// `X10 Y-2.5`
fn positions(value: &str) -> Option<[Option<f64>; COORDINATES]> {
    let mut positions = [None; COORDINATES];
    for part in value.split_whitespace() {
        let (letter, position) = word(part)?;
        let place = &mut positions[AxisLetter::from_letter(letter)?.index()];
        if place.replace(number(position)?).is_some() {
            return None;
        }
    }
    positions.iter().any(Option::is_some).then_some(positions)
}

/// `X Y`, `XY`; nothing.
fn letters(value: &str) -> Option<[bool; COORDINATES]> {
    let mut letters = [false; COORDINATES];
    for letter in value.chars().filter(|it| !it.is_whitespace()) {
        letters[AxisLetter::from_letter(letter.to_ascii_uppercase())?.index()] = true;
    }
    Some(letters)
}

/// When a command is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum When {
    /// At this time, s.
    At(f64),
    /// Once the machine rests, behind all that came before.
    AtRest,
}

/// Whether there is a machine that stays on, at whose rest a command can be given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Plays {
    /// A program, at the end of which the machine goes off.
    Program,
    /// A session, in which the machine stays on.
    Session,
}

/// Commands in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Events(VecDeque<(When, Command)>);

/// An events file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum EventsError {
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
    /// trace and does not go back; in a session it may be left out, for once the machine rests.
    ///
    /// # Errors
    /// It cannot be read, or the first line that is wrong.
    pub(super) fn load(file: &Path, plays: Plays) -> Result<Self, EventsError> {
        let text = input::read_lines(file).map_err(|source| EventsError::Read {
            file: file.to_owned(),
            source,
        })?;
        Self::parse(file, &text, plays)
    }

    /// The same from a text; `file` only names it in messages.
    ///
    /// # Errors
    /// The first line that is wrong.
    pub(super) fn parse(file: &Path, text: &str, plays: Plays) -> Result<Self, EventsError> {
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
            let when = match seconds.filter(|it| *it >= before) {
                Some(seconds) => {
                    before = seconds;
                    When::At(seconds)
                }
                None if time.is_empty() && plays == Plays::Session => When::AtRest,
                None => {
                    let or = match plays {
                        Plays::Program => "",
                        Plays::Session => ", or nothing: once the machine rests",
                    };
                    let problem =
                        format!("`{time}` is no time: allowed: seconds from {before} on{or}");
                    return Err(refuse(at, problem));
                }
            };
            known(event, &[]).map_err(|problem| refuse(event_at, problem))?;
            let (value_at, value) = match rest {
                [] => (line.chars().count(), ""),
                [value] => *value,
                [_, (more, _), ..] => {
                    return Err(refuse(*more, "nothing follows the value".to_owned()));
                }
            };
            let command =
                command(event, value, &[]).map_err(|problem| refuse(value_at, problem))?;
            events.push_back((when, command));
        }
        Ok(Self(events))
    }

    /// The programs that are loaded.
    pub(super) fn programs(&self) -> impl Iterator<Item = &Path> {
        self.0.iter().filter_map(|(_, command)| match command {
            Command::Load(file) => Some(&**file),
            _ => None,
        })
    }

    /// How many have not come, and when the first was to.
    pub(super) fn left(&self) -> Option<(When, usize)> {
        let (when, _) = self.0.front()?;
        Some((*when, self.0.len()))
    }

    /// The next command.
    pub(super) fn next(&self) -> Option<&Command> {
        self.0.front().map(|(_, command)| command)
    }

    /// The next command, if it is due at this time, s, at which the machine rests or not.
    pub(super) fn due(&self, now: f64, rests: bool) -> Option<&Command> {
        let (when, command) = self.0.front()?;
        let is_due = match when {
            When::At(at) => *at <= now,
            When::AtRest => rests,
        };
        is_due.then_some(command)
    }

    /// The next command has been given.
    pub(super) fn pass(&mut self) {
        self.0.pop_front();
    }
}

/// Any file of events: its commands can be told to a session, or its first mistake to a person.
#[cfg(fuzzing)]
pub fn fuzz(text: &str) {
    for plays in [Plays::Program, Plays::Session] {
        match Events::parse(Path::new("events.csv"), text, plays) {
            Ok(mut events) => {
                while let Some((when, _)) = events.left() {
                    let (now, rests) = match when {
                        When::At(time) => (time, false),
                        When::AtRest => (0.0, true),
                    };
                    let command = events.due(now, rests).expect("it is due then");
                    let _ = serde_json::to_string(command).expect("a log can keep it");
                    events.pass();
                }
            }
            Err(error) => assert!(error.to_string().starts_with("events.csv:")),
        }
    }
}

/// The fields of a line, each with its column from 0. In blocks and files' names commas are as good as other signs.
fn fields(line: &str) -> Vec<(usize, &str)> {
    let mut at = 0;
    let of = |field| {
        let trimmed = str::trim_start(field);
        let start = at + field.chars().count() - trimmed.chars().count();
        at += field.chars().count() + 1;
        (start, trimmed.trim_end())
    };
    let is_text = |event: &str| matches!(event.trim(), "mdi" | "load");
    let most = match line.split(',').nth(1) {
        Some(event) if is_text(event) => 3,
        _ => usize::MAX,
    };
    line.splitn(most, ',').map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Events, EventsError> {
        Events::parse(Path::new("e.csv"), text, Plays::Program)
    }

    #[test]
    fn commands_come_when_they_are_due() {
        let text = "t_s,event,value\r\n0.5, feed_hold,\n0.5,feed_override, 120\n\n2,resume\n";
        let mut events = parse(text).unwrap();
        let mut next = |now| {
            let due = events.due(now, true)?.clone();
            events.pass();
            Some(due)
        };
        assert_eq!(next(0.49), None);
        assert_eq!(next(0.5), Some(Command::FeedHold));
        assert_eq!(next(0.5), Some(Command::FeedOverride(Override::To(120.0))));
        assert_eq!(next(1.9), None);
        assert_eq!(next(2.5), Some(Command::Resume));
        assert_eq!(next(9.0), None);
    }

    #[test]
    fn in_a_session_commands_may_wait_for_rest() {
        let text = "t_s,event,value\n,home,\n2,mdi,G0 X1 (MSG, there)\n,run,\n";
        assert!(parse(text).is_err());
        let mut events = Events::parse(Path::new("e.csv"), text, Plays::Session).unwrap();
        let mut next = |now, rests| {
            let due = events.due(now, rests)?.clone();
            events.pass();
            Some(due)
        };
        assert_eq!(next(5.0, false), None);
        assert_eq!(next(0.0, true), Some(Command::Home([false; COORDINATES])));
        assert_eq!(next(1.9, true), None);
        let lines = "G0 X1 (MSG, there)".to_owned();
        assert_eq!(next(2.0, false), Some(Command::Mdi(lines)));
        assert_eq!(next(9.0, false), None);
        assert_eq!(next(2.0, true), Some(Command::Run { from_line: None }));
        assert_eq!(next(9.0, true), None);
    }

    #[test]
    fn switches_are_on_or_off() {
        let text = "t_s,event,value\n1,single_block,on\n1,optional_stop, off\n";
        let mut events = parse(text).unwrap();
        for command in [
            Command::SingleBlock(SwitchChange::To(true)),
            Command::OptionalStop(SwitchChange::To(false)),
        ] {
            assert_eq!(events.due(1.0, false), Some(&command));
            events.pass();
        }
    }

    #[test]
    fn jogs_have_axes_and_numbers() {
        let command = |event: &str| {
            let text = format!("t_s,event,value\n0,{event}\n");
            parse(&text).ok()?.due(0.0, false).cloned()
        };
        let axis = AxisLetter::X;
        for (event, jog) in [
            (
                "jog,X+1.5",
                Jog::By {
                    axis,
                    distance: 1.5,
                    speed: None,
                },
            ),
            (
                "jog, x-.25 F600",
                Jog::By {
                    axis,
                    distance: -0.25,
                    speed: Some(10.0),
                },
            ),
            (
                "jog,X- F600",
                Jog::Continuous {
                    axis,
                    direction: Direction::Negative,
                    speed: Some(10.0),
                },
            ),
            (
                "jog,X+",
                Jog::Continuous {
                    axis,
                    direction: Direction::Positive,
                    speed: None,
                },
            ),
        ] {
            assert_eq!(command(event), Some(Command::Jog(jog)), "{event}");
        }
        let mut to = [None; COORDINATES];
        to[1] = Some(20.0);
        to[8] = Some(-1.0);
        assert_eq!(command("jog_to,Y20 W-1"), Some(Command::Jog(Jog::To(to))));
        assert_eq!(
            command("move_to,W-1  Y20."),
            Some(Command::Jog(Jog::Line(to)))
        );
    }

    /// A file, where its mistake is, and what is told of it.
    const MISTAKES: [(&str, &str, &str); 26] = [
        ("t,event,value\n", "e.csv:1:1:", "header"),
        ("t_s,event,value\n1\n", "e.csv:2:2:", "no event"),
        (
            "t_s,event,value\n-1,feed_hold,\n",
            "e.csv:2:1:",
            "from 0 on",
        ),
        (
            "t_s,event,value\n2,feed_hold,\n1,feed_hold,\n",
            "e.csv:3:1:",
            "from 2 on",
        ),
        ("t_s,event,value\nnan,hold,\n", "e.csv:2:1:", "no time"),
        (
            "t_s,event,value\n1, feed_hodl,\n",
            "e.csv:2:4:",
            "nearest: `feed_hold`",
        ),
        (
            "t_s,event,value\n1,feed_hold,5\n",
            "e.csv:2:13:",
            "no value",
        ),
        (
            "t_s,event,value\n1,feed_override,\n",
            "e.csv:2:17:",
            "0.1 to 200",
        ),
        (
            "t_s,event,value\n1,feed_override\n",
            "e.csv:2:16:",
            "0.1 to 200",
        ),
        (
            "t_s,event,value\n1,feed_override,1e-300\n",
            "e.csv:2:17:",
            "0.1 to 200",
        ),
        (
            "t_s,event,value\n1,rapid_override,101\n",
            "e.csv:2:18:",
            "0.1 to 100",
        ),
        (
            "t_s,event,value\n1,feed_hold,,x\n",
            "e.csv:2:14:",
            "nothing follows",
        ),
        (
            "t_s,event,value\n1,hold,\n",
            "e.csv:2:3:",
            "`hold` is called `feed_hold` now",
        ),
        (
            "t_s,event,value\n1,stop_after_block,\n",
            "e.csv:2:3:",
            "`single_block` now",
        ),
        (
            "t_s,event,value\n1,step_back,\n",
            "e.csv:2:3:",
            "`retrace` now",
        ),
        (
            "t_s,event,value\n1,single_block,\n",
            "e.csv:2:16:",
            "`single_block` needs `on` or `off`",
        ),
        (
            "t_s,event,value\n1,optional_stop,ON\n",
            "e.csv:2:17:",
            "`optional_stop` needs `on` or `off`",
        ),
        ("t_s,event,value\n1,jog,X5\n", "e.csv:2:7:", "`X+1.5`"),
        ("t_s,event,value\n1,jog,\n", "e.csv:2:7:", "`X+1.5`"),
        ("t_s,event,value\n1,jog,X+inf\n", "e.csv:2:7:", "`X+1.5`"),
        ("t_s,event,value\n1,jog,X+1 F0\n", "e.csv:2:7:", "`X+1.5`"),
        ("t_s,event,value\n1,jog,X+1 Y+1\n", "e.csv:2:7:", "`X+1.5`"),
        ("t_s,event,value\n1,jog,F+1\n", "e.csv:2:7:", "`X+1.5`"),
        (
            "t_s,event,value\n1,move_to,\n",
            "e.csv:2:11:",
            "`X10 Y-2.5`",
        ),
        (
            "t_s,event,value\n1,jog_to,X1 X2\n",
            "e.csv:2:10:",
            "`X10 Y-2.5`",
        ),
        ("", "e.csv:1:1:", "header"),
    ];

    #[test]
    fn mistakes_are_told_with_their_place() {
        for (text, place, told) in MISTAKES {
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
