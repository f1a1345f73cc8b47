//! A person who writes a machine file hears of all mistakes in two rounds at most: of those of a table alone and of names, then
//! of what does not fit together.

use proptest::prelude::*;
use proptest::sample::subsequence;
use std::path::Path;
use syncline_controller::machine::Machine;
use syncline_strict_toml::Rest;

const ROUTER: &str = include_str!("../../../examples/router/machine.toml");

/// A mistake: what stands behind a place of the file becomes something else, and so it is told.
#[derive(Clone, Copy, Debug)]
struct Mistake {
    behind: &'static str,
    from: &'static str,
    to: &'static str,
    told: &'static str,
}

const fn mistake(
    behind: &'static str,
    from: &'static str,
    to: &'static str,
    told: &'static str,
) -> Mistake {
    Mistake {
        behind,
        from,
        to,
        told,
    }
}

const X: &str = "[[axis]]\nname = \"X\"";
const Y: &str = "[[axis]]\nname = \"Y\"";
const Z: &str = "[[axis]]\nname = \"Z\"";

/// Of every kind; no two change the same line.
const MISTAKES: [Mistake; 27] = [
    // No TOML.
    mistake(
        Y,
        "max_jerk = 80_000.0",
        "max_jerk = 80_000.0 mm",
        "not TOML: string values must be quoted",
    ),
    mistake(
        Z,
        "max_jerk = 60_000.0",
        "max_jerk 60_000.0",
        "not TOML: key with no value",
    ),
    mistake(
        Z,
        "following_error_limit = 1.0",
        "following_error_limit = 1.0\nfollowing_error_limit = 2.0",
        "not TOML: duplicate key",
    ),
    // Keys.
    mistake(
        X,
        "skew_limit = 0.5",
        "#",
        "axis \"X\": missing key `skew_limit`",
    ),
    mistake(
        "[homing]",
        "at_start",
        "at_begin",
        "homing: unknown key `at_begin`",
    ),
    mistake(
        "[machine]",
        "name = \"router\"",
        "name = \"router\"\ncolour = 1",
        "unknown key `colour`",
    ),
    // Values.
    mistake(
        "[machine]",
        "cycle_us = 2000",
        "cycle_us = \"fast\"",
        "machine: `cycle_us` is",
    ),
    mistake(
        X,
        "max_velocity = 600.0",
        "max_velocity = 0",
        "axis \"X\": `max_velocity` is",
    ),
    mistake(
        Y,
        "soft_limits = [0.0, 800.0]",
        "soft_limits = [800.0, 0.0]",
        "axis \"Y\": `soft_limits`",
    ),
    mistake(
        X,
        "pitch = 160.0",
        "pitch = 1e-320",
        "axis \"X\": `pitch` / `gear` is no usable number",
    ),
    mistake(
        "name = \"X2\"",
        "model = \"lxm32m\"",
        "model = \"lxm31m\"",
        "drive \"X2\": `model` is",
    ),
    mistake(
        "name = \"home Z\"",
        "active_low = true",
        "active_low = \"yes\"",
        "input \"home Z\": `active_low` is",
    ),
    mistake(
        "switches = [\"home Y\"]",
        "direction = \"negative\"",
        "direction = \"down\"",
        "`direction` is \"down\"",
    ),
    // Names.
    mistake(
        "name = \"Y\"",
        "bus = \"main\"",
        "bus = \"mian\"",
        "drive \"Y\": there is no bus \"mian\"",
    ),
    mistake(
        "[[axis]]\nname = \"Z\"",
        "drives = [\"Z\"]",
        "drives = [\"Zed\"]",
        "axis \"Z\": there is no drive \"Zed\"",
    ),
    mistake(
        "model = \"lxm32m\"\n\n[[drive]]\nname = \"Z\"",
        "node = 4",
        "node = 4\nmodel = \"lxm32m\"\n\n[[drive]]\nname = \"Spare\"\nbus = \"main\"\nnode = 9",
        "drive \"Spare\": no axis names it",
    ),
    mistake(
        "name = \"home X2\"",
        "drive = \"X2\"",
        "drive = \"X3\"",
        "there is no drive \"X3\"",
    ),
    mistake(
        Y,
        "switches = [\"home Y\"]",
        "switches = [\"home U\"]",
        "\"home U\"",
    ),
    // What does not fit together.
    mistake(
        "",
        "[homing]",
        "[controller]\nheartbeat_timeout_ms = 50\n\n[homing]",
        "`heartbeat_timeout_ms` is 50 with",
    ),
    mistake(
        "name = \"X1\"",
        "node = 1\n",
        "node = 127\n",
        "node 127 is already the controller",
    ),
    mistake(
        "name = \"X2\"",
        "node = 2\n",
        "node = 200\n",
        "drive \"X2\": `node` is 200",
    ),
    mistake(
        "name = \"home X1\"",
        "signal = \"DI0\"",
        "signal = \"DI77\"",
        "\"DI77\"",
    ),
    mistake(
        "[[bus]]",
        "bitrate = 1_000_000",
        "bitrate = 10_000",
        "`bitrate` is 10000, which drive",
    ),
    mistake(
        "node = 4",
        "model = \"lxm32m\"",
        "model = \"lxm32m\"\nzero = -2147483000",
        "are beyond what drive \"Z\" can count",
    ),
    mistake(Z, "speed = 30.0", "speed = 0.0", "homing: `speed` is 0"),
    mistake(
        X,
        "order = 2",
        "order = 2\nswitches_ = 1",
        "unknown key `switches_`",
    ),
    mistake(
        "[axis.simulation]\nstart = 180.0",
        "[[axis]]",
        "[axis.simulation.more]\na = 1\n\n[[axis]]",
        "unknown key `more`",
    ),
];

/// The file with these.
fn with(mistakes: &[Mistake]) -> String {
    let mut places: Vec<_> = (mistakes.iter())
        .map(|it| {
            let behind = ROUTER.find(it.behind).expect(it.behind);
            let at = ROUTER[behind..].find(it.from).expect(it.from);
            (behind + at, it)
        })
        .collect();
    places.sort_by_key(|(at, _)| *at);
    let mut text = ROUTER.to_owned();
    for (at, it) in places.iter().rev() {
        text.replace_range(*at..at + it.from.len(), it.to);
    }
    text
}

/// What is told of the file with these.
fn told(mistakes: &[Mistake]) -> Vec<String> {
    let read = Machine::parse(Path::new("machine.toml"), &with(mistakes));
    let found = read.map_or_else(|error| error.diagnostics, |_| Vec::new());
    found.into_iter().map(|it| it.problem).collect()
}

/// Which of these are not told, and what else is.
fn left(mistakes: &[Mistake], told: &[String]) -> (Vec<Mistake>, Vec<String>) {
    let is = |it: &Mistake, text: &String| text.contains(it.told);
    let not_told = mistakes
        .iter()
        .filter(|it| !told.iter().any(|text| is(it, text)));
    let other = told
        .iter()
        .filter(|text| !mistakes.iter().any(|it| is(it, text)));
    (not_told.copied().collect(), other.cloned().collect())
}

#[test]
fn each_alone_is_told_in_one_round_and_nothing_else_is() {
    assert_eq!(told(&[]), [""; 0]);
    for it in MISTAKES {
        let told = told(&[it]);
        let (left, other) = left(&[it], &told);
        assert!(left.is_empty() && other.is_empty(), "{it:?}: {told:#?}");
    }
}

/// What cycle, controller, buses and devices say of each other is told with what is wrong elsewhere.
#[test]
fn what_good_tables_say_of_each_other_is_told_at_once() {
    let is_of_them = |it: &Mistake| {
        let told = [
            "`heartbeat_timeout_ms` is 50",
            "node 127 is already",
            "`bitrate` is 10000",
        ];
        told.iter().any(|text| it.told.starts_with(text))
    };
    let (of_them, others): (Vec<_>, Vec<_>) = MISTAKES.into_iter().partition(is_of_them);
    assert_eq!(of_them.len(), 3);
    // Without a cycle nothing fits it.
    let others = others
        .into_iter()
        .filter(|it| !it.from.starts_with("cycle_us"));
    for it in others {
        for one in &of_them {
            let planted = [it, *one];
            let told = told(&planted);
            let (left, other) = left(&planted, &told);
            let is_late = left.iter().any(|late| late.told == one.told);
            assert!(!is_late && other.is_empty(), "{planted:?}: {told:#?}");
        }
    }
}

proptest! {
    /// Whatever is struck out of a file or written into it, what is left of it is TOML, with all in its place.
    #[test]
    fn what_is_left_is_toml(at in 0..ROUTER.len(), length in 0..30_usize, written in "[\\[\\]=\"'\n,#a.{}é]{0,4}") {
        let start = (0..=at).rev().find(|it| ROUTER.is_char_boundary(*it)).unwrap();
        let end = (at + length..).find(|it| *it >= ROUTER.len() || ROUTER.is_char_boundary(*it)).unwrap();
        let mut text = ROUTER.to_owned();
        text.replace_range(start..end.min(ROUTER.len()), &written);
        if let Some(rest) = Rest::of(&text) {
            prop_assert_eq!(rest.text().len(), text.len());
            prop_assert!(rest.text().parse::<toml::Table>().is_ok(), "{}", rest.text());
            let kept = rest.text().char_indices().filter(|(_, c)| !c.is_whitespace());
            for (at, c) in kept {
                prop_assert!(text[at..].starts_with(c));
            }
        }
        drop(Machine::parse(Path::new("machine.toml"), &text));
    }

    /// Who mends what is told has mended all after two rounds, and is never told of what is right.
    #[test]
    fn all_are_told_in_two_rounds(planted in subsequence(MISTAKES.to_vec(), 1..=8)) {
        let first = told(&planted);
        let (later, other) = left(&planted, &first);
        prop_assert!(other.is_empty(), "first: {other:#?} of {planted:#?}");
        let second = told(&later);
        let (never, other) = left(&later, &second);
        prop_assert!(other.is_empty(), "second: {other:#?} of {later:#?}");
        prop_assert!(never.is_empty(), "third: {never:#?}, first {first:#?}, second {second:#?}");
    }
}
