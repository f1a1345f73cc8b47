//! Texts of others, names and lines of programs, as people are shown them: nothing in them acts on what shows them, and none passes
//! for another one.

use std::borrow::Cow;

/// Whether a character changes the order in which others are shown, ends a line, or is there without being seen: a name could be taken
/// for another one. These are the characters with the property `Default_Ignorable_Code_Point` of the Unicode Character Database (17.0,
/// `DerivedCoreProperties.txt`), the separators of lines and paragraphs, and the marks of annotations.
fn is_unseen(c: char) -> bool {
    matches!(
        c,
        '\u{ad}'
            | '\u{34f}'
            | '\u{61c}'
            | '\u{115f}'..='\u{1160}'
            | '\u{17b4}'..='\u{17b5}'
            | '\u{180b}'..='\u{180f}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{3164}'
            | '\u{fe00}'..='\u{fe0f}'
            | '\u{feff}'
            | '\u{ffa0}'
            | '\u{fff0}'..='\u{fffb}'
            | '\u{1bca0}'..='\u{1bca3}'
            | '\u{1d173}'..='\u{1d17a}'
            | '\u{e0000}'..='\u{e0fff}'
    )
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
        assert_eq!(
            shown("Größe e\u{301} 加工 \u{1f600}"),
            "Größe e\u{301} 加工 \u{1f600}"
        );
        assert_eq!(shown("\x1b[2Jx\r\u{9b}"), "\\u{1b}[2Jx\\r\\u{9b}");
        let unseen = [
            "ad", "34f", "61c", "115f", "17b5", "180e", "200b", "200f", "2028", "2029", "202a",
            "202e", "2066", "2069", "206a", "206f", "3164", "fe00", "fe0f", "feff", "ffa0", "fff9",
            "1d173", "e0001", "e0020", "e01ef",
        ];
        for code in unseen {
            let number = u32::from_str_radix(code, 16).unwrap();
            let text = format!("part{}cgn.1", char::from_u32(number).unwrap());
            assert_eq!(shown(&text), format!("part\\u{{{code}}}cgn.1"));
        }
    }
}
