//! O-words, subroutines in files, M98 and M99.

use std::fs;

use syncline_gcode::{Interpreter, Setup};

use super::listing::{listing, places, refusal, refusal_with, refusals, run, show_all, xyz};

#[test]
fn branches() {
    let program = |value: i32| {
        format!(
            "#1 = {value}
o10 if [#1 EQ 1]
  G0 X1
o10 elseif [#1 EQ 2]
  G0 X2
  o<inner> if [#1 GT 0]
    G0 Y2
  o<inner> else
    G0 Y-2
  o<inner> endif
o10 elseif [#1 EQ 2]
  G0 X-99
o10 else
  G0 X3
o10 endif
G0 Z1
M2"
        )
    };
    let text: Vec<String> = (1..=3)
        .map(|value| format!("#1 = {value}\n{}", listing(&program(value))))
        .collect();
    insta::assert_snapshot!(text.concat());
}

#[test]
fn loops() {
    insta::assert_snapshot!(listing(
        "#1 = 0
o1 while [#1 LT 5]
  #1 = [#1 + 1]
  o2 if [#1 EQ 2]
    o1 continue
  o2 endif
  o2 if [#1 EQ 4]
    o1 break
  o2 endif
  G0 X#1
o1 endwhile
(the label of the loop that was left is free again)
o1 repeat [1]
  G0 Z-1
o1 endrepeat
(while that is false from the start)
o1 while [0]
  G0 X-99
o1 endwhile
o3 do
  #1 = [#1 + 1]
  o4 if [#1 EQ 6]
    o3 continue
  o4 endif
  G0 Y#1
o3 while [#1 LT 7]
o5 repeat [2]
  o6 repeat [3]
    #2 = [#2 + 1]
    o7 if [#2 EQ 2]
      o6 continue
    o7 endif
    G91 G0 Z1
  o6 endrepeat
o5 endrepeat
o8 repeat [0]
  G0 X-99
o8 endrepeat
o9 do
  o9 break
o9 while [1]
G90 G0 X0
M2"
    ));
}

#[test]
fn subroutines() {
    insta::assert_snapshot!(listing(
        "(defined before and behind the call, recursive, with results)
#<side> = 7 #30 = 30 #1 = 11
o<square> sub
  #<side> = #1
  #30 = 0 #31 = 31
  G0 X#<side> Y#2
  o<early> if [#<side> GT 100]
    o<square> return [-1]
  o<early> endif
  #<_seen> = #<_call_level>
o<square> endsub [#<side> * #<side>]
o<square> call [3] [4]
G0 Z#<_value>
G0 X#<side> Y#30 Z[#31 + #1]
o<square> call [200]
G0 Z[#<_value> + #<_value_returned> + #<_seen> + #2]
o100 call [3]
G0 Z#<_value>
o[50 * 2] call [1]
o<nothing> call
G0 X#<_value_returned>
M2
o100 sub
  G0 X#1
  o101 if [#1 GT 1]
    o100 call [#1 - 1]
  o101 endif
o100 endsub [#<_value> + 10]
o<nothing> sub
o<nothing> endsub"
    ));
}

/// Comments between arguments, calls without blanks, labels computed in a subroutine that is
/// called before the one it calls is defined.
#[test]
fn calls_as_they_are_written() {
    insta::assert_snapshot!(listing(
        "o100 sub (begins here)
o[150+50] call (first) [2+#1][3+#2] (third) [4+#3] (a nested call)
o100 endsub (no value)
o200sub
g0x#1y#2z#3
o200endsub
o100 call [.1] [.2] [.3]
O100CALL[.4][.5][.6]
m2"
    ));
}

#[test]
fn subprograms_by_number() {
    insta::assert_snapshot!(listing(
        "%
O1 (MAIN)
#1 = 0
M98 P100 L2
G0 X0
M98 P300 L0
M98 P200
M30
O100 (ALL PARAMETERS ARE SHARED)
#1 = [#1 + 1]
G0 X#1
M98 P200 L2
M99
O200
#1 = [#1 + 10]
G0 Y#1
M99
%"
    ));
}

#[test]
fn an_endless_program_runs_only_as_it_is_read() {
    let mut setup = xyz();
    setup.max_blocks = Some(1000);
    let program = "O7\nG91 G0 X1\nM99\n";
    let message = refusal_with(setup.clone(), program);
    assert!(message.contains("1000 blocks were executed"), "{message}");
    setup.max_blocks = None;
    let endless = Interpreter::from_text("part.ngc", program, setup);
    assert_eq!(endless.take(5000).filter(Result::is_ok).count(), 5000);
}

#[test]
fn an_endless_program_that_moves_nothing_ends() {
    let mut setup = xyz();
    (setup.max_blocks, setup.max_idle_blocks) = (None, 1000);
    for block in ["(nothing)", "G0 X5", "M3 S100"] {
        let message = refusal_with(setup.clone(), &format!("{block}\nM99\n"));
        assert!(message.contains("1000 blocks"), "{block}: {message}");
        assert!(message.contains("nothing moved"), "{block}: {message}");
    }
    for block in ["G4 P0.1", "M0", "G91 G0 X1", "G3 I1 F100"] {
        let program = format!("{block}\nM99\n");
        let endless = Interpreter::from_text("part.ngc", program, setup.clone());
        let good = endless.take(3000).filter(Result::is_ok).count();
        assert_eq!(good, 3000, "{block}");
    }
}

#[test]
fn blocks_of_many_moves_count_by_their_moves() {
    let mut setup = xyz();
    setup.max_blocks = Some(1000);
    let program = "G91 F100\no1 repeat [50]\nG83 X1 Z-2 R-1 Q0.05 L2\no1 endrepeat\nM2\n";
    let message = refusal_with(setup, program);
    assert!(message.contains("1000 blocks were executed"), "{message}");
}

#[test]
fn a_loop_that_does_nothing_ends() {
    let mut setup = Setup::new(xyz().axes);
    setup.max_blocks = Some(100_000);
    let message = refusal_with(setup, "o1 while [1]\no1 endwhile\nM2");
    assert!(message.contains("100000 blocks"), "{message}");
}

#[test]
fn subroutines_in_files() {
    let directory = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| fs::write(directory.path().join(name), text).unwrap();
    file(
        "main.ngc",
        "o<drill> call [1]\nG0 X0\no<drill> call [2]\no200 call\nM2\n",
    );
    file(
        "drill.ngc",
        "(a hole)\no<drill> sub\nG0 X#1\no200 call\no<drill> endsub\nM2\n",
    );
    file("200.ngc", "o200 sub\nG0 Z-1\nG0 Z0\no200 endsub\n");
    let path = directory.path().join("main.ngc");
    let program = Interpreter::open(&path, xyz()).unwrap();
    insta::assert_snapshot!(show_all(program).replace(&*directory.path().to_string_lossy(), "."));

    file("bad.ngc", "o<deep> call\nM2");
    file("deep.ngc", "o<deep> sub\nG0 A1\no<deep> endsub");
    let program = Interpreter::open(&directory.path().join("bad.ngc"), xyz()).unwrap();
    let error = program.last().unwrap().unwrap_err();
    assert!(error.file.ends_with("deep.ngc"));
    assert_eq!((error.line, error.columns.start), (2, 4));

    for name in ["../secret", "Deep/../deep", "missing", "bad"] {
        file("try.ngc", &format!("o<{name}> call\nM2"));
        let program = Interpreter::open(&directory.path().join("try.ngc"), xyz()).unwrap();
        let error = program.last().unwrap().unwrap_err().to_string();
        assert!(error.contains("there is no subroutine"), "{error}");
    }
}

#[test]
fn a_loop_costs_no_memory_and_little_time() {
    let commands = run("o1 repeat [20000]\nG91 G0 X1\no1 endrepeat\nM2").unwrap();
    assert_eq!(commands.len(), 20001);
}

#[test]
fn constructs_nest_only_so_deep() {
    let program: Vec<String> = (0..200).map(|label| format!("o{label} do\n")).collect();
    let message = refusal(&program.concat());
    assert!(
        message.starts_with("part.ngc:101:1: loops and branches nest deeper"),
        "{message}"
    );
}

#[test]
fn what_does_not_belong_together() {
    insta::assert_snapshot!(refusals(&[
        ("G21\no1 if [0]\nG0 X1\nM2", "2:1"),
        ("o1 while [0]\nM2", "1:1"),
        ("o1 sub\nG0 X1\nM2", "1:1"),
        ("o1 sub\no2 sub\no1 endsub", "2:1"),
        ("o1 if [1]\nG0 X1\n", "3:1"),
        ("%\no1 do\n%", "3:1"),
        ("o1 endif", "1:1"),
        ("o1 else", "1:1"),
        ("o1 endwhile", "1:1"),
        ("o1 endrepeat", "1:1"),
        ("o1 break", "1:1"),
        ("o1 continue", "1:1"),
        ("o1 endsub", "1:1"),
        ("o1 return", "1:1"),
        ("o1 if [1]\no2 if [1]\no1 endif", "3:1"),
        ("o1 if [1]\no1 if [1]", "2:1"),
        ("o1 sub\no1 endsub\no1 sub\no1 endsub", "3:1"),
        ("o1 call", "1:1"),
        ("o#1 if [1]", "1:2"),
        ("o[1.5] call", "1:2"),
        ("o1 repeat [1.5]", "1:1"),
        ("o1 sub\no1 call\no1 endsub\no1 call", "2:1"),
        ("M98 P5", "1:1"),
        ("M98", "1:1"),
        ("M98 P1.5", "1:5"),
        ("M98 P31000", "1:1"),
        ("M98 P5 L1.5", "1:8"),
        ("M98 P5\nM2\nO5\nG0 X1", "5:1"),
        ("o1 sub\nM99\no1 endsub\no1 call", "2:1"),
        ("G0 X1\nO5\nM99", "2:1"),
        ("o1 if [0]\nG0 X(\no1 endif", "2:5"),
        ("o1 if [#<none>]", "1:8"),
    ]));
}

#[test]
fn a_value_returned_from_inside_a_branch() {
    insta::assert_snapshot!(listing(
        "o<f> sub
  o1 if [#1 GT 3]
    o<f> return [#1 * 2]
  o1 endif
o<f> endsub [1]
o<f> call [5]
G0 X#<_value>
o<f> call [2]
G0 X#<_value>
#<own> = 3
o<f> call [2]
G0 Y#<own> Z#5060
G0 X#5400 Y#<_spindle_rpm_mode> Z[#<_current_pocket> + #<_feed_override>]
M2"
    ));
}

/// A block that is deleted is not there, also where a branch or a loop that is not gone through is read over.
#[test]
fn deleted_blocks_end_no_branch() {
    let x = |program: &str, block_delete: bool| {
        let mut setup = xyz();
        setup.block_delete = block_delete;
        places(setup, program)
            .into_iter()
            .map(|place| place[0])
            .collect::<Vec<_>>()
    };
    for (condition, deleted, kept) in [
        ("0", vec![3.0], vec![2.0, 3.0]),
        ("1", vec![1.0, 2.0, 3.0], vec![1.0, 3.0]),
    ] {
        let program = format!("o1 if [{condition}]\nG0 X1\n/o1 else\nG0 X2\no1 endif\nG0 X3\nM2");
        assert_eq!(x(&program, true), deleted, "{program}");
        assert_eq!(x(&program, false), kept, "{program}");
    }
    let program = "o1 while [0]\nG0 X1\n/o1 endwhile\nG0 X2\no1 endwhile\nG0 X3\nM2";
    assert_eq!(x(program, true), [3.0]);
    let program = "o1 call\nM2\n/o1 sub\nG0 X1\n/o1 endsub\no1 sub\nG0 X2\no1 endsub";
    assert_eq!(x(program, true), [2.0]);
    let program = "M98 P7\nM2\n/O7\nG0 X1\nM99\nO7\nG0 X2\nM99";
    assert_eq!(x(program, true), [2.0]);
}

/// What the last subroutine returned is known until the next one returns, in that one too.
#[test]
fn a_call_keeps_what_was_returned_before() {
    let program = "o1 sub\no1 endsub [42]\no2 sub\nG0 X#<_value> Y#<_value_returned>\no2 endsub\n\
                   o1 call\no2 call\nG0 X[1 + #<_value>] Y[2 + #<_value_returned>]\nM2\n";
    assert_eq!(places(xyz(), program), [[42.0, 1.0, 0.0], [1.0, 2.0, 0.0]]);
}
