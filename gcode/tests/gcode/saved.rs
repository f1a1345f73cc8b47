//! M70 to M73: the modal state is saved and restored.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_gcode::{Action, Command, Interpreter, Point, Setup, Tool};

use super::listing::{listing, places, run, xyz};

#[test]
fn restored_are_the_modes_and_neither_motion_nor_position() {
    insta::assert_snapshot!(listing(
        "G1 F600 S100
M70
G91 G20 G55 G18 G64 P0.1 F3 S200 M3 M8
G0 X1
M72
G0 X2
M71
M2"
    ));
}

#[test]
fn a_subroutine_restores_its_callers_modes_where_it_says_so() {
    insta::assert_snapshot!(listing(
        "o1 sub
M73
G91 G0 X1
o2 if [#1]
o1 return
o2 endif
X1
o1 endsub
o3 sub
G91
o3 endsub
G0 X10
o1 call [0]
X20
o1 call [1]
X30
M98 P7
X40
o3 call
X1
M2
O7
M73
G91 M3 S9
X1
M99"
    ));
}

/// What M72 restores of a contour: one that has ended is refused, one that has begun ends.
#[test]
fn a_contour_that_began_meanwhile_ends() {
    let program = "F600 M70\nG41.1 D6 G1 X20\nX40\nM72\nG1 X60 Y10\nM2";
    let written = program.replace("M72", "G40");
    let actions = |text: &str| -> Vec<Action> {
        let commands = run(text).unwrap();
        commands.into_iter().map(|command| command.action).collect()
    };
    assert_eq!(actions(program), actions(&written));
}

/// A machine with one tool, whose length is 7 mm.
fn setup() -> Setup {
    let mut setup = xyz();
    let tool = Tool {
        offset: Point::xyz(0.0, 0.0, 7.0),
        ..Tool::default()
    };
    setup.tables.tools.insert(1, tool);
    setup.typed = true;
    setup
}

const LINES: [&str; 27] = [
    "G0 X1 Y2",
    "G1 X3 F100",
    "X4 Z2",
    "G17",
    "G18",
    "G19",
    "G20",
    "G21",
    "G90",
    "G91",
    "G90.1",
    "G91.1",
    "G93",
    "G94",
    "G98",
    "G99",
    "G54",
    "G55",
    "G59.3",
    "F300",
    "S1000 M3",
    "M4",
    "M8",
    "M7",
    "G43 H1",
    "G49",
    "G64 P0.5",
];

/// The moves, where they lead, and the modes by their words.
fn outcome(text: &str) -> Option<(Vec<Action>, Point, String)> {
    let mut program = Interpreter::from_text("lines", text, setup());
    let mut actions = Vec::new();
    for command in program.by_ref() {
        let action = command.ok()?.action;
        if matches!(action, Action::Rapid { .. } | Action::Feed { .. }) {
            actions.push(action);
        }
    }
    Some((actions, program.position(), program.modes().to_string()))
}

proptest! {
    /// M72 does what the words would do that set the state of M70; and it can be used again.
    #[test]
    fn restoring_is_writing_the_words_again(
        before in prop::collection::vec(select(&LINES[..]), 0..12),
        between in prop::collection::vec(select(&LINES[..]), 0..12),
        behind in prop::collection::vec(select(&LINES[..]), 0..4),
        sub in any::<bool>(),
    ) {
        let [before, between, behind] = [before, between, behind].map(|lines| lines.join("\n"));
        // In mm, which their words give exactly.
        let before = before.replace("G20", "G21");
        let start = format!("T1 M6 F200 G61 G0\n{before}");
        let Some((.., modes)) = outcome(&start) else { return Ok(()) };
        // The motion is not restored, the tool is the same, and where M4 was it goes on.
        let (_, words) = modes.split_once(' ').unwrap();
        let words = words.replace(" T1 M6", "").replace("G43 ", "G43 H1 ");
        // M7 and M8 add to what runs, and no word says that there is no F.
        let words = format!("M9\nG93\nG94\n{words}");
        let wanted = outcome(&format!("{start}\n{between}\n{words}\n{behind}"));
        let restored = if sub {
            format!("o1 sub\nM73\n{between}\no1 endsub\n{start}\no1 call\n{behind}")
        } else {
            format!("{start}\nM70\n{between}\nM72\nM72\n{behind}")
        };
        prop_assert_eq!(outcome(&restored), wanted);
    }
}

#[test]
fn what_is_saved_lives_from_one_typed_line_to_the_next() {
    let mut typed = setup();
    let mut last = Vec::new();
    for line in ["M70", "G91", "M72", "G0 X1", "X1"] {
        let mut program = Interpreter::from_text("MDI", line, typed.clone());
        last = program
            .by_ref()
            .map(|command| command.unwrap())
            .collect::<Vec<Command>>();
        typed.memory = program.memory();
        typed.start = program.position();
    }
    assert_eq!(
        last[0].action,
        Action::Rapid {
            to: Point::xyz(1.0, 0.0, 0.0)
        }
    );
}

/// Each pass through a subprogram restores what it has saved, as each call does.
#[test]
fn each_pass_of_a_subprogram_restores_its_callers_modes() {
    for (change, to) in [
        ("G91 X1", [11.0, 12.0, 13.0]),
        ("G20 X1", [25.4; 3]),
        ("G55 X1", [6.0; 3]),
    ] {
        let program =
            format!("G10 L2 P2 X5\nG0 X10\nM98 P200 L3\nX1\nM2\nO200\nM73\n{change}\nM99");
        let x: Vec<f64> = places(xyz(), &program)
            .into_iter()
            .map(|place| place[0])
            .collect();
        assert_eq!(x, [&[10.0], &to[..], &[1.0]].concat(), "{change}");
    }
}

/// Whether the shift of G92 is on is saved, and comes back.
#[test]
fn whether_g92_is_on_comes_back() {
    for (program, x) in [
        ("M70\nG92 X5\nM72\nG1 X1 F9\nM2", 1.0),
        ("G92 X5\nM70\nG92.2\nM72\nG1 X1 F9\nM2", -4.0),
        ("o1 sub\nM73\nG52 X7\no1 endsub\no1 call\nG1 X1 F9\nM2", 1.0),
    ] {
        assert_eq!(places(xyz(), program), [[x, 0.0, 0.0]], "{program}");
    }
}
