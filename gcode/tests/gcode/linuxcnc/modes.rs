//! Offsets, tool lengths, planes, units, distance modes and cycles in random order between moves: where these lead is where
//! LinuxCNC goes.

use proptest::prelude::*;

use super::{available, differ, moved, ours, theirs};

/// Blocks with letters for numbers: `a` to `d` a coordinate, `h` a level, `z` a depth below it, `p` above zero, `q` as an angle, `r` a
/// radius that reaches everywhere, `n` a work offset, `t` a tool.
const MOVES: &[&str] = &[
    "G0 Xa Yb Zc",
    "G1 Xa",
    "G1 Yb Za",
    "G0 Zc",
    "G90 G53 G0 Xa Zb",
    "G2 Xa Yb Rr",
    "G3 Xa Yb Ia Jb\nG0 Xa",
    "G3 Ia Jb",
    "G2 Ia Jb Zc P2",
    "G30",
];
/// Units change without a tool's length: LinuxCNC takes that off, under G53, G28 and G30, in the unit in which it was read.
const MODES: &[&str] = &[
    "G90", "G91", "G49\nG20", "G49\nG21", "G90.1", "G91.1", "G8", "G98", "G99", "G28.1", "G30.1",
];
const OFFSETS: &[&str] = &[
    "G54",
    "G55",
    "G56",
    "G57",
    "G58",
    "G59",
    "G59.1",
    "G59.2",
    "G59.3",
    "G10 L2 Pn Xa Yb Zc",
    "G10 L2 P0 Zc",
    "G10 L20 Pn Xa",
    "G10 L20 P0 Xa Yb Zc",
    "G92 Xa Yb",
    "G92 Zc",
    "G92.1",
    "G92.2",
    "G92.3",
    "G52 Xa Yb Zc",
    "G43 Ht",
    "G43.1 Za Xb",
    "G43.2 Ht",
    "G49",
    "G43",
    "G90 Tt M6",
    "G90 Tt M6\nG43",
    "G10 L1 Pt Za Rp",
    "G10 L1 Pt Xa Zb",
    "G10 L10 Pt Za",
    "G10 L11 Pt Za",
];
/// In G90: what LinuxCNC counts an incremental move from leaves G92 out as a system is turned, so that `G91 G0 X0 Y0` moves there.
const TURNS: &[&str] = &[
    "G90 G10 L2 Pn Rq",
    "G90 G10 L2 P0 Xa Yb Rq",
    "G90 G10 L2 P1 R0",
];
const PLANES: &[&str] = &[
    "G28 Xa Zb",
    "G30 Yb",
    "G18 G2 Xa Zb Rr\nG17",
    "G18 G3 Ia Kb Yc\nG17",
    "G19 G3 Ya Zb Rr\nG17",
    "G19 G2 Ja Kb Xc P2\nG17",
    "G18 G83 Xa Zb Yz Rh Qp\nXd\nG80 G17",
    "G19 G81 Ya Zb Xz Rh\nYd Zb\nG80 G17",
    "G18 G89 Xa Zb Yz Rh Pp\nZd Yb\nG80 G17",
];
const CYCLES: &[&str] = &[
    "G81 Xa Yb Zz Rh\nXb Ya\nYd\nG80",
    "G82 Xa Yb Zz Rh Pp\nXb L2\nG80",
    "G83 Xa Yb Zz Rh Qp\nXd Zz\nG80",
    "G73 Xa Yb Zz Rh Qp\nYd Rh\nG80",
    "G85 Xa Zz Rh L3\nG99 Xd Yb\nXa\nG80",
    "G89 Ya Zz Rh Pp\nXd\nG0 Xa",
    "G86 Xa Zz Rh Pp\nYd\nG80",
    "G99 G81 Xa Yb Zz Rh\nG82 Xb Zz Rh Pp\nG80",
];

#[derive(Clone, Debug)]
struct Step {
    block: &'static str,
    values: [f64; 4],
    number: u32,
    turn: f64,
}

fn step(turned: bool) -> impl Strategy<Value = Step> {
    let planes = if turned { TURNS } else { PLANES };
    let of = |blocks: &'static [&'static str]| prop::sample::select(blocks);
    let block = prop_oneof![4 => of(MOVES), 2 => of(MODES), 4 => of(OFFSETS), 2 => of(planes), 2 => of(CYCLES)];
    let value = || (-40_000..40_000_i32).prop_map(|value| f64::from(value) / 1000.0);
    let values = [value(), value(), value(), value()];
    (block, values, 0..9_u32, -180..180_i32).prop_map(|(block, values, number, turn)| Step {
        block,
        values,
        number,
        turn: f64::from(turn),
    })
}

impl Step {
    fn text(&self) -> String {
        let [a, b, c, d] = self.values;
        let put = |letter: char| match letter {
            'a' => a.to_string(),
            'b' => b.to_string(),
            'c' => c.to_string(),
            'd' => d.to_string(),
            'h' => (12.0 + d.abs() / 4.0).to_string(),
            'z' => (-1.0 - c.abs() / 2.0).to_string(),
            'p' => (5.0 + d.abs() / 4.0).to_string(),
            'q' => self.turn.to_string(),
            'r' => if self.number < 5 { "150" } else { "-130.5" }.to_owned(),
            'n' => (self.number + 1).to_string(),
            't' => (self.number % 3 + 1).to_string(),
            other => other.to_string(),
        };
        self.block.chars().map(put).collect()
    }
}

fn programs() -> impl Strategy<Value = String> {
    let steps = |turned| prop::collection::vec(step(turned), 1..14);
    prop_oneof![steps(false), steps(true)].prop_map(|steps| {
        let mut text = "G21 G17 G90 G98 F100\nT1 M6 S500 M3\nG0 X1 Y2 Z3\n".to_owned();
        for step in steps {
            text += &step.text();
            // Behind what sets places there is a move of all three.
            let moves = !MOVES.contains(&step.block) && !MODES.contains(&step.block);
            let [a, b, c, _] = step.values;
            text += &if moves {
                format!("\nS500 M3\nG0 X{c} Y{a} Z{b}\n")
            } else {
                "\n".to_owned()
            };
        }
        text + "M2\n"
    })
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 400, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn modes_and_offsets_lead_where_linuxcnc_goes(program in programs()) {
        if !available() {
            return Ok(());
        }
        // Four decimals, of an inch too, and what they round in each offset adds up.
        let digits = if program.contains("G20") { 0.02 } else { 6e-4 };
        let (ours, theirs) = (ours(&program), theirs(&program));
        prop_assert_eq!(ours.is_some(), theirs.is_some(), "{}{:?}\n{:?}", program, ours, theirs);
        if let (Some(ours), Some(theirs)) = (ours, theirs) {
            let [ours, theirs] = [ours, theirs].map(|moves| moved(moves, digits / 3.0));
            prop_assert!(!differ(&ours, &theirs, digits), "{}{:?}\n{:?}", program, ours, theirs);
        }
    }
}
