//! Expressions, parameters and flow of control in random programs: whatever they are written like, and however they nest,
//! they lead where LinuxCNC goes.

use std::fmt::Write;

use proptest::prelude::*;
use syncline_gcode::Fault;

use super::{available, differ, moved, refused_or_moves, theirs};
use crate::sweep::Random;

/// The longest line of a program before it is spelt in another way; theirs may have 255 characters.
const LONGEST: usize = 210;

/// How much four decimals may be off, mm.
const DIGITS: f64 = 1e-4;

/// A value as it is written.
#[derive(Clone, Debug)]
enum Expr {
    Number(String),
    Parameter(&'static str),
    Signed(char, Box<Expr>),
    Function(&'static str, Box<Expr>),
    Atan(Box<Expr>, Box<Expr>),
    Exists(&'static str),
    /// Values with operators between them, without brackets of their own.
    Chain(Box<Expr>, Vec<(&'static str, Expr)>),
}

/// Parameters that have a value everywhere. #36 and #37 are numbers of others.
const READ: [&str; 14] = [
    "#1",
    "#2",
    "#3",
    "#31",
    "#32",
    "#33",
    "##36",
    "#[#37]",
    "#[30 + 2]",
    "#[#36 + 1]",
    "#<a>",
    "#<_g>",
    "#<_value>",
    "#<_value_returned>",
];
const SET: [&str; 10] = [
    "#1",
    "#2",
    "#31",
    "#32",
    "##36",
    "#[#37 - 1]",
    "#<a>",
    "#<b>",
    "#<_g>",
    "#<_h>",
];
/// Functions that two libraries may round in another way.
const ROUNDED: [&str; 8] = ["sin", "cos", "tan", "asin", "acos", "exp", "ln", "sqrt"];
const EXACT: [&str; 4] = ["abs", "fix", "fup", "round"];
const OPERATORS: [&str; 14] = [
    "+", "-", "*", "/", "mod", "eq", "ne", "gt", "ge", "lt", "le", "and", "or", "xor",
];

fn number() -> impl Strategy<Value = Expr> {
    let digits = prop_oneof![
        "[0-9]{1,2}",
        "[0-9]\\.",
        "\\.[0-9]",
        "[0-9]\\.[0-9]{1,3}",
        "0[0-9]\\.50",
    ];
    (prop::sample::select(vec!["", "", "", "-", "+"]), digits)
        .prop_map(|(sign, digits)| Expr::Number(sign.to_owned() + &digits))
}

fn expr() -> impl Strategy<Value = Expr> {
    let leaf = prop_oneof![
        3 => number(),
        3 => prop::sample::select(READ.to_vec()).prop_map(Expr::Parameter),
        1 => prop::sample::select(vec!["a", "b", "_g", "_h"]).prop_map(Expr::Exists),
    ];
    leaf.prop_recursive(3, 7, 3, |inner| {
        let boxed = || inner.clone().prop_map(Box::new);
        let function = prop::sample::select([&ROUNDED[..], &EXACT].concat());
        let operator = prop::sample::select(OPERATORS.to_vec());
        let powers = prop::sample::select(vec!["2", "3", "0", "1"]);
        let more = prop_oneof![
            6 => (operator, inner.clone()),
            1 => powers.prop_map(|power| ("**", Expr::Number(power.to_owned()))),
        ];
        prop_oneof![
            1 => (prop::sample::select(vec!['-', '+']), boxed())
                .prop_map(|(sign, of)| Expr::Signed(sign, of)),
            2 => (function, boxed()).prop_map(|(function, of)| Expr::Function(function, of)),
            1 => (boxed(), boxed()).prop_map(|(y, x)| Expr::Atan(y, x)),
            4 => (boxed(), prop::collection::vec(more, 1..4))
                .prop_map(|(first, more)| Expr::Chain(first, more)),
        ]
    })
}

impl Expr {
    /// As it is written, if that is no longer; else something short.
    fn within(&self, length: usize) -> String {
        let text = self.text();
        if text.len() > length {
            "#31".to_owned()
        } else {
            text
        }
    }

    fn text(&self) -> String {
        match self {
            Expr::Number(digits) => digits.clone(),
            Expr::Parameter(written) => (*written).to_owned(),
            Expr::Signed(sign, of) => format!("{sign}{}", of.text()),
            Expr::Function(function @ ("asin" | "acos"), of) => {
                rounded(&format!("{function}[sin[{}]]", of.text()))
            }
            Expr::Function("exp", of) => rounded(&format!("exp[{} mod 3]", of.text())),
            Expr::Function("ln", of) => rounded(&format!("ln[abs[{}] + 1]", of.text())),
            Expr::Function("sqrt", of) => rounded(&format!("sqrt[abs[{}]]", of.text())),
            Expr::Function(function, of) if EXACT.contains(function) => {
                format!("{function}[{}]", of.text())
            }
            Expr::Function(function, of) => rounded(&format!("{function}[{}]", of.text())),
            Expr::Atan(y, x) => rounded(&format!("atan[{}]/[{}]", y.text(), x.text())),
            Expr::Exists(name) => format!("exists[#<{name}>]"),
            Expr::Chain(first, more) => {
                let more = more
                    .iter()
                    .map(|(operator, of)| format!(" {operator} {}", of.text()));
                format!("[{}{}]", first.text(), more.collect::<String>())
            }
        }
    }
}

/// To three decimals, off the places where those change, so that the last bit decides nothing further on.
fn rounded(value: &str) -> String {
    format!("[round[{value}*1000+.2]/1000]")
}

#[derive(Clone, Debug)]
enum Statement {
    /// Axes and settings of one block.
    Block(Vec<(char, Expr)>, Vec<(&'static str, Expr)>),
    Code(&'static str),
    If(Vec<(Expr, Vec<Statement>)>, Option<Vec<Statement>>),
    While(u32, Vec<Statement>),
    Do(u32, Vec<Statement>),
    Repeat(u32, Vec<Statement>),
    /// BREAK or CONTINUE of a loop around it, the innermost or one farther out.
    Exit(&'static str, usize, Expr),
    Call(usize, [Expr; 3]),
    Return(Expr, Option<Expr>),
}

fn statement() -> impl Strategy<Value = Statement> {
    let axes = prop::sample::subsequence(vec!['X', 'Y', 'Z'], 0..=3);
    let words = axes.prop_flat_map(|axes| {
        let count = axes.len();
        prop::collection::vec(expr(), count)
            .prop_map(move |values| axes.clone().into_iter().zip(values).collect())
    });
    let set = (prop::sample::select(SET.to_vec()), expr());
    let block = (words, prop::collection::vec(set, 0..3))
        .prop_map(|(words, set)| Statement::Block(words, set));
    let codes = vec!["G90", "G91", "G0", "G1", "G1 F200"];
    let leaf = prop_oneof![
        6 => block,
        1 => prop::sample::select(codes).prop_map(Statement::Code),
        1 => (prop::sample::select(vec!["break", "continue"]), 0..2_usize, expr())
            .prop_map(|(kind, out, when)| Statement::Exit(kind, out, when)),
        1 => (0..2_usize, [expr(), expr(), expr()])
            .prop_map(|(which, arguments)| Statement::Call(which, arguments)),
        1 => (expr(), prop::option::of(expr()))
            .prop_map(|(when, value)| Statement::Return(when, value)),
    ];
    leaf.prop_recursive(3, 20, 4, |inner| {
        let body = || prop::collection::vec(inner.clone(), 1..4);
        prop_oneof![
            2 => (
                prop::collection::vec((expr(), body()), 1..3),
                prop::option::of(body())
            )
                .prop_map(|(branches, last)| Statement::If(branches, last)),
            1 => (0..4_u32, body()).prop_map(|(count, body)| Statement::While(count, body)),
            1 => (0..4_u32, body()).prop_map(|(count, body)| Statement::Do(count, body)),
            1 => (0..4_u32, body()).prop_map(|(count, body)| Statement::Repeat(count, body)),
        ]
    })
}

/// Writes statements as lines.
struct Writer {
    lines: Vec<String>,
    /// How many labels there are.
    labels: u32,
    /// Labels of the loops around.
    loops: Vec<String>,
    /// Labels of loops that begin with DO.
    dos: Vec<String>,
    /// The subroutine that is written.
    within: Option<usize>,
}

const SUBROUTINES: [&str; 2] = ["o<part>", "o7"];

impl Writer {
    fn label(&mut self) -> String {
        self.labels += 1;
        match self.labels % 3 {
            0 => format!("o<n{}>", self.labels),
            _ => format!("o{}", 100 + self.labels),
        }
    }

    fn line(&mut self, line: impl Into<String>) {
        self.lines.push(line.into());
    }

    fn body(&mut self, body: &[Statement]) {
        body.iter().for_each(|statement| self.statement(statement));
    }

    fn looped(&mut self, label: &str, body: &[Statement]) {
        self.loops.push(label.to_owned());
        self.body(body);
        self.loops.pop();
    }

    fn statement(&mut self, statement: &Statement) {
        match statement {
            Statement::Block(words, set) => {
                let words = words
                    .iter()
                    .map(|(axis, of)| format!("{axis}[{} mod 500] ", of.within(100)));
                let set = set
                    .iter()
                    .map(|(to, of)| format!("{to} = {} ", of.within(100)));
                let mut line = String::new();
                for item in words.chain(set) {
                    if line.len() + item.len() > LONGEST {
                        self.line(std::mem::take(&mut line));
                    }
                    line += &item;
                }
                self.line(line);
            }
            Statement::Code(code) => self.line(*code),
            Statement::If(branches, last) => {
                let label = self.label();
                for (index, (when, body)) in branches.iter().enumerate() {
                    let word = if index == 0 { "if" } else { "elseif" };
                    self.line(format!("{label} {word} [{}]", when.within(LONGEST)));
                    self.body(body);
                }
                if let Some(body) = last {
                    self.line(format!("{label} else"));
                    self.body(body);
                }
                self.line(format!("{label} endif"));
            }
            Statement::While(count, body) => {
                let label = self.label();
                let counter = format!("#{}", 1000 + self.labels);
                self.line(format!("{counter} = 0"));
                self.line(format!("{label} while [{counter} lt {count}]"));
                self.line(format!("{counter} = [{counter} + 1]"));
                self.looped(&label, body);
                self.line(format!("{label} endwhile"));
            }
            Statement::Do(count, body) => {
                let label = self.label();
                let counter = format!("#{}", 1000 + self.labels);
                self.line(format!("{counter} = 0"));
                self.line(format!("{label} do"));
                self.dos.push(label.clone());
                self.line(format!("{counter} = [{counter} + 1]"));
                self.looped(&label, body);
                self.line(format!("{label} while [{counter} lt {count}]"));
            }
            Statement::Repeat(count, body) => {
                let label = self.label();
                self.line(format!("{label} repeat [{count}]"));
                // Theirs leaves no REPEAT from inside.
                let loops = std::mem::take(&mut self.loops);
                self.body(body);
                self.loops = loops;
                self.line(format!("{label} endrepeat"));
            }
            Statement::Exit(kind, out, when) => {
                let around = self.loops.iter().rev().nth(*out).or(self.loops.last());
                let Some(around) = around.cloned() else {
                    return;
                };
                // Theirs loses its way behind a CONTINUE of a DO.
                let kind = if self.dos.contains(&around) {
                    "break"
                } else {
                    kind
                };
                let label = self.label();
                self.line(format!("{label} if [{}]", when.within(LONGEST)));
                self.line(format!("{around} {kind}"));
                self.line(format!("{label} endif"));
            }
            Statement::Call(which, arguments) => {
                // None calls itself.
                if self.within.is_some_and(|within| within <= *which) {
                    return;
                }
                let [a, b, c] = arguments.each_ref().map(|it| it.within(65));
                self.line(format!("{} call [{a}] [{b}] [{c}]", SUBROUTINES[*which]));
            }
            Statement::Return(when, value) => {
                let Some(which) = self.within else { return };
                let label = self.label();
                let value = value
                    .as_ref()
                    .map_or(String::new(), |it| format!("[{}]", it.within(LONGEST)));
                self.line(format!("{label} if [{}]", when.within(LONGEST)));
                self.line(format!("{} return {value}", SUBROUTINES[which]));
                self.line(format!("{label} endif"));
            }
        }
    }
}

/// The same line in another spelling: blanks between any two characters, letters of any case, comments, a number.
fn spelt(line: &str, random: &mut Random) -> String {
    let mut text = String::new();
    if random.chance(0.2) {
        let _ = write!(text, "N{} ", random.between(0.0, 99999.0) as u32);
    }
    for character in line.chars() {
        if random.chance(0.1) {
            text.push(if random.chance(0.5) { ' ' } else { '\t' });
        }
        text.push(match random.chance(0.3) {
            true => character.to_ascii_uppercase(),
            false => character,
        });
    }
    if random.chance(0.2) {
        text += "(by [hand] #1 ; G0 X5)";
    }
    if random.chance(0.1) {
        text += "; (and X7";
    }
    text
}

fn program(body: &[Statement], subroutines: &[Vec<Statement>; 2], seed: u64) -> String {
    let mut writer = Writer {
        lines: Vec::new(),
        labels: 0,
        loops: Vec::new(),
        dos: Vec::new(),
        within: None,
    };
    // Theirs looks at values also where it reads over them: all parameters have one from the beginning.
    writer.line("G21 G17 G90 G1 F100");
    for (index, value) in [
        (1, 1.5),
        (2, -2.0),
        (3, 40.0),
        (31, 7.0),
        (32, 0.25),
        (33, -11.0),
    ] {
        writer.line(format!("#{index} = {value}"));
    }
    for set in ["#36 = 31", "#37 = 33", "#<a> = 3", "#<_g> = 4"] {
        writer.line(set);
    }
    for (which, body) in subroutines.iter().enumerate() {
        let label = SUBROUTINES[which];
        writer.within = Some(which);
        writer.line(format!("{label} sub"));
        writer.line("#<a> = #1");
        writer.body(body);
        writer.line(format!("{label} endsub [#<a> + 1]"));
    }
    writer.within = None;
    writer.line("o9 sub");
    writer.line("o9 endsub [2]");
    writer.line("o9 call");
    writer.body(body);
    let mut random = Random(seed);
    let spell = seed != 0;
    let lines = writer.lines.iter();
    let lines = lines.map(|line| {
        let spelt = spelt(line, &mut random);
        let spells = spell && spelt.len() < 255;
        (if spells { spelt } else { line.clone() }) + "\n"
    });
    lines.collect::<String>() + "M2\n"
}

fn programs() -> impl Strategy<Value = String> {
    let some = |count| prop::collection::vec(statement(), count);
    (0..1000_u64, [some(0..4), some(0..4)], some(1..8))
        .prop_map(|(seed, subroutines, body)| program(&body, &subroutines, seed))
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 1000, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn programs_lead_where_linuxcnc_goes(program in programs()) {
        if !available() {
            return Ok(());
        }
        let theirs = theirs(&program).map(|moves| moved(moves, 2.0 * DIGITS));
        match (refused_or_moves(&program), theirs) {
            (Ok(ours), Some(theirs)) => {
                let ours = moved(ours, 2.0 * DIGITS);
                prop_assert!(!differ(&ours, &theirs, DIGITS), "{}{:?}\n{:?}", program, ours, theirs);
            }
            // What has no result may be none in the end there, as where it is only asked whether it is 0.
            (Err(error), _) if matches!(error.fault, Fault::NoResult) => {}
            // Theirs looks also at values that are read over.
            (_, None) => {}
            (ours, theirs) => {
                prop_assert!(false, "{}{:?}\n{:?}", program, ours.map_err(|it| it.to_string()), theirs);
            }
        }
    }
}
