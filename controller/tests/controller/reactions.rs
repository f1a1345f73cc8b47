//! What the machine does about what happens to it: the table of `docs/supervision.md` is the code's.

use super::outside::root;
use std::fs;
use syncline_controller::control::reaction::RULES;

#[test]
fn the_table_of_reactions_is_the_codes() {
    let page = fs::read_to_string(root().join("docs/supervision.md")).unwrap();
    let begin = page.find("| cause | reaction |").expect("the table");
    let rows = page[begin..].lines().skip(2);
    let rows: Vec<&str> = rows.take_while(|row| row.starts_with('|')).collect();
    let rules = RULES.map(|rule| {
        format!(
            "| {} | {} | {} |",
            rule.cause, rule.reaction, rule.cleared_by
        )
    });
    assert_eq!(rows, rules);
}
