//! Expressions: steps for a stack, and what they evaluate to.

use std::ops::Range;

use super::block::Block;
use super::error::{Fault, Refusal};
use super::lexer::Columns;
use super::messages::{shows_input_result, shows_signal};
use super::names::is_signal;
use super::parameters::INPUT_RESULT;

/// How far apart two numbers may be and still be `EQ`, as in LinuxCNC.
const EQUAL: f64 = 1e-4;

/// The last parameter that is the program's own; those behind it show the machine's state.
const LAST_OWN: f64 = 5000.0;

/// A value of a block: the steps that compute it.
#[derive(Clone, Debug)]
pub(crate) struct Value {
    pub(crate) steps: Range<usize>,
    pub(crate) columns: Columns,
}

/// One step on the stack, and the columns to blame for it.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) operation: Operation,
    pub(crate) columns: Columns,
}

#[derive(Clone, Debug)]
pub(crate) enum Operation {
    /// Pushes a number.
    Number(f64),
    /// Replaces a number by the parameter of that number.
    Numbered,
    /// Pushes a named parameter: a range of the block's names.
    Named(Range<usize>),
    /// Pushes whether a named parameter exists.
    Exists(Range<usize>),
    Negate,
    Function(Function),
    /// ATAN[y]/[x]
    Atan,
    Operator(Operator),
}

/// A function of one value. Angles are in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Function {
    Abs,
    Acos,
    Asin,
    Cos,
    Exp,
    Fix,
    Fup,
    Ln,
    Round,
    Sin,
    Sqrt,
    Tan,
}

impl Function {
    pub(crate) const NAMED: [(&str, Function); 12] = [
        ("ABS", Function::Abs),
        ("ACOS", Function::Acos),
        ("ASIN", Function::Asin),
        ("COS", Function::Cos),
        ("EXP", Function::Exp),
        ("FIX", Function::Fix),
        ("FUP", Function::Fup),
        ("LN", Function::Ln),
        ("ROUND", Function::Round),
        ("SIN", Function::Sin),
        ("SQRT", Function::Sqrt),
        ("TAN", Function::Tan),
    ];

    fn apply(self, x: f64) -> f64 {
        match self {
            Function::Abs => x.abs(),
            Function::Acos => libm::acos(x).to_degrees(),
            Function::Asin => libm::asin(x).to_degrees(),
            Function::Cos => libm::cos(x.to_radians()),
            Function::Exp => libm::exp(x),
            Function::Fix => x.floor(),
            Function::Fup => x.ceil(),
            Function::Ln => libm::log(x),
            Function::Round => x.round(),
            Function::Sin => libm::sin(x.to_radians()),
            Function::Sqrt => x.sqrt(),
            Function::Tan => libm::tan(x.to_radians()),
        }
    }
}

/// An operator between two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Power,
    Times,
    Divide,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    And,
    Or,
    ExclusiveOr,
}

impl Operator {
    pub(crate) const NAMED: [(&str, Operator); 10] = [
        ("MOD", Operator::Modulo),
        ("EQ", Operator::Equal),
        ("NE", Operator::NotEqual),
        ("GT", Operator::Greater),
        ("GE", Operator::GreaterOrEqual),
        ("LT", Operator::Less),
        ("LE", Operator::LessOrEqual),
        ("AND", Operator::And),
        ("OR", Operator::Or),
        ("XOR", Operator::ExclusiveOr),
    ];

    /// The higher binds first; equals bind from left to right.
    pub(crate) fn precedence(self) -> u8 {
        match self {
            Operator::Power => 4,
            Operator::Times | Operator::Divide | Operator::Modulo => 3,
            Operator::Plus | Operator::Minus => 2,
            Operator::Equal
            | Operator::NotEqual
            | Operator::Greater
            | Operator::GreaterOrEqual
            | Operator::Less
            | Operator::LessOrEqual => 1,
            Operator::And | Operator::Or | Operator::ExclusiveOr => 0,
        }
    }

    fn apply(self, a: f64, b: f64) -> f64 {
        let truth = |condition: bool| if condition { 1.0 } else { 0.0 };
        match self {
            Operator::Power => libm::pow(a, b),
            Operator::Times => a * b,
            Operator::Divide => a / b,
            Operator::Modulo => match a % b {
                rest if rest < 0.0 => rest + b.abs(),
                rest => rest,
            },
            Operator::Plus => a + b,
            Operator::Minus => a - b,
            Operator::Equal => truth((a - b).abs() < EQUAL),
            Operator::NotEqual => truth((a - b).abs() >= EQUAL),
            Operator::Greater => truth(a > b),
            Operator::GreaterOrEqual => truth(a >= b),
            Operator::Less => truth(a < b),
            Operator::LessOrEqual => truth(a <= b),
            Operator::And => truth(a != 0.0 && b != 0.0),
            Operator::Or => truth(a != 0.0 || b != 0.0),
            Operator::ExclusiveOr => truth((a != 0.0) != (b != 0.0)),
        }
    }
}

/// Where parameters are read from.
pub(crate) trait Scope {
    /// A numbered parameter, or why there is none.
    fn numbered(&self, index: f64) -> Result<f64, Fault>;

    /// A named parameter, if it has a value.
    fn named(&self, name: &str) -> Option<f64>;

    /// Why a named parameter has no value; `None` for one that only is not known yet.
    fn refusal(&self, name: &str) -> Option<Fault>;
}

impl Block {
    /// Whether it has to be known what inputs and outputs of the machine are before the block is executed: an
    /// expression reads one, or a message shows one.
    pub(crate) fn reads_signals(&self) -> bool {
        let mut comments = self.tokens.comments.iter();
        self.signals().next().is_some() || comments.any(|at| shows_signal(&self.text[at.clone()]))
    }

    /// Whether it reads or shows what the last M66 found, by `#5399`.
    pub(crate) fn reads_input_result(&self) -> bool {
        let reads = self.steps.windows(2).any(|steps| {
            let number = matches!(steps[0].operation, Operation::Number(number) if number == INPUT_RESULT as f64);
            number && matches!(steps[1].operation, Operation::Numbered)
        });
        let mut comments = self.tokens.comments.iter();
        reads || comments.any(|at| shows_input_result(&self.text[at.clone()]))
    }

    /// The names of inputs and outputs that its expressions read.
    pub(crate) fn signals(&self) -> impl Iterator<Item = (&str, Columns)> {
        self.steps
            .iter()
            .filter_map(|step| match &step.operation {
                Operation::Named(name) => Some((self.name(name), step.columns)),
                _ => None,
            })
            .filter(|(name, _)| is_signal(name))
    }

    /// Whether a value of the block hangs on no parameter.
    pub(crate) fn is_constant(&self, value: &Value) -> bool {
        !self.steps[value.steps.clone()].iter().any(|step| {
            use Operation::{Exists, Named, Numbered};
            matches!(step.operation, Numbered | Named(_) | Exists(_))
        })
    }

    /// Whether a value of the block hangs on what the machine and its modes are: parameters that show these, or that are looked up.
    pub(crate) fn reads_state(&self, value: &Value) -> bool {
        let steps = &self.steps[value.steps.clone()];
        steps
            .iter()
            .enumerate()
            .any(|(at, step)| match &step.operation {
                Operation::Named(name) | Operation::Exists(name) => {
                    self.name(name).starts_with('_')
                }
                Operation::Numbered => {
                    let before = at.checked_sub(1).map(|at| &steps[at].operation);
                    !matches!(before, Some(Operation::Number(number)) if *number <= LAST_OWN)
                }
                _ => false,
            })
    }

    /// Evaluates one of the block's values; `stack` is working memory.
    pub(crate) fn evaluate(
        &self,
        value: &Value,
        scope: &impl Scope,
        stack: &mut Vec<f64>,
    ) -> Result<f64, Refusal> {
        stack.clear();
        for step in &self.steps[value.steps.clone()] {
            let mut pop = || stack.pop().unwrap_or_default();
            let result = match &step.operation {
                Operation::Number(number) => Ok(*number),
                Operation::Numbered => scope.numbered(pop()),
                Operation::Named(name) => {
                    let name = self.name(name);
                    let unset = || Fault::ParameterUnset(name.to_owned());
                    (scope.named(name)).ok_or_else(|| scope.refusal(name).unwrap_or_else(unset))
                }
                Operation::Exists(name) => {
                    let name = self.name(name);
                    let exists = scope.named(name).is_some() || scope.refusal(name).is_none();
                    Ok(f64::from(u8::from(exists)))
                }
                Operation::Negate => Ok(-pop()),
                Operation::Function(function) => finite(function.apply(pop())),
                Operation::Atan => {
                    let x = pop();
                    finite(libm::atan2(pop(), x).to_degrees())
                }
                Operation::Operator(operator) => {
                    let b = pop();
                    finite(operator.apply(pop(), b))
                }
            };
            stack.push(result.map_err(|fault| Refusal::new(step.columns, fault))?);
        }
        Ok(stack.pop().unwrap_or_default())
    }
}

fn finite(value: f64) -> Result<f64, Fault> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Fault::NoResult)
    }
}
