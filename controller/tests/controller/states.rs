//! What may be asked of the machine in which state: the table of `docs/design.md` is the code's.

use super::outside::root;
use std::fs;
use syncline_controller::control::{Request, State};

#[test]
fn the_table_of_states_is_the_codes() {
    let design = fs::read_to_string(root().join("docs/design.md")).unwrap();
    let begin = design.find("| state | ").expect("the table");
    let mut rows = design[begin..].lines().map(|row| {
        let cells = row.trim_matches('|').split('|');
        cells.map(str::trim).map(str::to_owned).collect::<Vec<_>>()
    });
    let heads = rows.next().unwrap();
    let requests = Request::ALL.map(|request| request.to_string());
    assert_eq!(heads[1..], requests);
    for (state, row) in State::ALL.into_iter().zip(rows.skip(1)) {
        assert_eq!(row[0], state.to_string());
        for (request, cell) in Request::ALL.into_iter().zip(&row[1..]) {
            let allowed = if state.allows(request) { "yes" } else { "" };
            assert_eq!(cell, allowed, "{request} while {state}");
        }
    }
}
