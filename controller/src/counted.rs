//! A number with what it counts, in the singular where it is 1.

use std::fmt::Display;

/// So many of what is called so where it is one, and so where it is any other number.
pub(crate) fn counted(count: u64, one: &str, many: &str) -> impl Display {
    let what = if count == 1 { one } else { many };
    format!("{count} {what}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_alone_is_singular() {
        let told = [0, 1, 2, 21].map(|count| counted(count, "block", "blocks").to_string());
        assert_eq!(told, ["0 blocks", "1 block", "2 blocks", "21 blocks"]);
    }
}
