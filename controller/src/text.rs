//! Texts of others, names and lines of programs, as people are shown them: nothing in them acts on what shows them, and none passes
//! for another one.

use std::borrow::Cow;

/// Whether a character changes the order in which others are shown, or is there without being seen: a name could be taken
/// for another one.
fn is_unseen(c: char) -> bool {
    matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
}

/// Text as people are shown it, on a terminal or a page: control characters but those of lines and columns are escaped, and so is what is unseen.
pub(crate) fn shown(text: &str) -> Cow<'_, str> {
    let is_obeyed = |c: char| (c.is_control() && !matches!(c, '\n' | '\t')) || is_unseen(c);
    if !text.contains(is_obeyed) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_obeyed(c) {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    shown.into()
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn control_characters_are_shown() {
        assert_eq!(shown("a plain\n\tline µ"), "a plain\n\tline µ");
        assert_eq!(shown("\x1b[2Jx\r\u{9b}"), "\\u{1b}[2Jx\\r\\u{9b}");
        let unseen = [
            "200b", "200f", "202a", "202e", "2066", "2069", "feff", "61c",
        ];
        for code in unseen {
            let number = u32::from_str_radix(code, 16).unwrap();
            let text = format!("part{}cgn.1", char::from_u32(number).unwrap());
            assert_eq!(shown(&text), format!("part\\u{{{code}}}cgn.1"));
        }
    }
}
