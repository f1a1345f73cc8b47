//! Comments that are for the operator: `(MSG, …)`, `(DEBUG, …)`, `(PRINT, …)`, and what is written beside a stop.
//!
//! A message is shown where it stands in the program. That of MSG is shown as it is written; in those of DEBUG and
//! PRINT, `#5220` and `#<name>` are shown by their values behind the parameter settings of the block. A comment beside M0, M1
//! or M6 tells the operator what there is to do, and is a message without a word for it.

use std::fmt::Write as _;

use super::expression::Scope;
use super::modal::to_the_millionth;
use super::names::is_signal;
use super::parameters::INPUT_RESULT;

/// What a comment tells the operator; `None` if it is for readers of the program alone. `stops`: the program
/// waits for the operator at its block.
pub(crate) fn message(comment: &str, stops: bool, scope: &impl Scope) -> Option<String> {
    let (word, text) = comment.split_once(',').unwrap_or(("", comment));
    let text = match word.trim().to_ascii_uppercase().as_str() {
        "MSG" => text.trim().to_owned(),
        "DEBUG" | "PRINT" => with_values(text.trim(), scope),
        _ if stops => comment.trim().to_owned(),
        _ => return None,
    };
    Some(text).filter(|text| !text.is_empty())
}

/// The text of a comment that is a message with values of parameters; none of another one.
fn text_with_values(comment: &str) -> &str {
    match comment.split_once(',') {
        Some((word, text)) if matches!(&*word.trim().to_ascii_uppercase(), "DEBUG" | "PRINT") => {
            text
        }
        _ => "",
    }
}

/// Whether a comment is a message that shows an input or output of the machine by its name.
pub(crate) fn shows_signal(comment: &str) -> bool {
    let mut names = text_with_values(comment).split("#<").skip(1);
    names.any(|name| {
        name.split_once('>')
            .is_some_and(|(name, _)| is_signal(&plain(name)))
    })
}

/// Whether a comment is a message that shows what the last M66 found.
pub(crate) fn shows_input_result(comment: &str) -> bool {
    let mut numbers = text_with_values(comment).split('#').skip(1);
    numbers.any(|behind| {
        let digits = behind.bytes().take_while(u8::is_ascii_digit).count();
        behind[..digits].parse() == Ok(INPUT_RESULT)
    })
}

/// A name as expressions have it: lower case, without blanks.
fn plain(name: &str) -> String {
    let blank = |character: &char| !character.is_whitespace();
    name.chars()
        .filter(blank)
        .collect::<String>()
        .to_lowercase()
}

/// The text with the values of its parameters. What is none stays as it is written: a comment is no mistake.
fn with_values(text: &str, scope: &impl Scope) -> String {
    let mut shown = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('#') {
        shown += &rest[..at];
        rest = &rest[at..];
        let (length, value) = parameter(rest, scope).unwrap_or((1, None));
        match value {
            Some(value) => {
                // Writing to a string does not fail.
                let _ = write!(shown, "{}", to_the_millionth(value));
            }
            None => shown += &rest[..length],
        }
        rest = &rest[length..];
    }
    shown + rest
}

/// The parameter that a text begins with: how many bytes name it, and its value if it has one.
fn parameter(text: &str, scope: &impl Scope) -> Option<(usize, Option<f64>)> {
    let behind = text.strip_prefix('#')?;
    if let Some(name) = behind.strip_prefix('<') {
        let end = name.find('>')?;
        return Some((end + 3, scope.named(&plain(&name[..end]))));
    }
    let digits = behind.bytes().take_while(u8::is_ascii_digit).count();
    let number = behind[..digits].parse().ok()?;
    Some((digits + 1, scope.numbered(number).ok()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Fault;
    use proptest::prelude::*;

    struct Some7;

    impl Scope for Some7 {
        fn numbered(&self, index: f64) -> Result<f64, Fault> {
            match index {
                7.0 => Ok(0.1 + 0.2),
                other => Err(Fault::ParameterIndex(other)),
            }
        }

        fn named(&self, name: &str) -> Option<f64> {
            (name == "depth").then_some(-12.5)
        }

        fn refusal(&self, name: &str) -> Option<Fault> {
            Some(Fault::ParameterUnset(name.to_owned()))
        }
    }

    #[test]
    fn comments_that_are_messages() {
        for (comment, stops, told) in [
            ("MSG, turn #7 over", false, Some("turn #7 over")),
            (" msg ,a, b", false, Some("a, b")),
            (
                "DEBUG, depth #<De pth> by #7.",
                false,
                Some("depth -12.5 by 0.3."),
            ),
            (
                "print,#8 #<none> #<open # #",
                false,
                Some("#8 #<none> #<open # #"),
            ),
            ("debug,ä#7ö", false, Some("ä0.3ö")),
            ("MSG,", false, None),
            ("MSG turn it over", false, None),
            ("turn it over", false, None),
            ("turn it over", true, Some("turn it over")),
            ("first, turn it over", true, Some("first, turn it over")),
            ("", true, None),
        ] {
            let found = message(comment, stops, &Some7);
            assert_eq!(found.as_deref(), told, "{comment}");
        }
    }

    proptest! {
        /// Whatever stands between them, parameters that have a value are shown by it, and all else as it is
        /// written.
        #[test]
        fn parameters_are_shown_by_their_values(
            parts in prop::collection::vec(
                prop_oneof![
                    "[ a-zä.,<>(]{0,6}".prop_map(|text| (text.clone(), text)),
                    prop::sample::select(vec![
                        ("#7", "0.3"),
                        ("#<depth>", "-12.5"),
                        ("#8", "#8"),
                        ("#<none>", "#<none>"),
                    ])
                    .prop_map(|(text, shown)| (text.to_owned(), shown.to_owned())),
                ],
                0..8,
            ),
        ) {
            let (text, shown): (String, String) = parts.into_iter().unzip();
            prop_assert_eq!(with_values(&text, &Some7), shown);
        }
    }
}
