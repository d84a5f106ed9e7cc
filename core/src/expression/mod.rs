//! Formulas as people write them in a study: read, checked, compiled, differentiated exactly.
//!
//! # The language
//!
//! ```text
//! expression = expression operator expression | sign expression | "not" expression
//!            | value | value "[" index "]" | value "[" [first] ":" [last] "]"
//! value      = number [ "{" unit "}" ] | name | function "(" expression {"," expression} ")"
//!            | "(" expression ")" | "[" expression {"," expression} "]"
//! operators, loosest first:
//!              or    and    not    < <= > >= == !=    + -    * /    (sign) + -    ^
//! number     = 12   0.5   .5   1e-6          name = letters, digits and `_`, no digit first
//! ```
//!
//! Powers bind to the right and tighter than signs: `-x^2` is `-(x^2)`, `2^3^2` is `2^9`, `2^-x` is right.
//! Comparisons give conditions, which `and`, `or`, `not` join and `if(condition, yes, no)` uses; they cannot be
//! chained, and are no numbers. `pi` and `e` are known.
//!
//! A name stands for a number or for a vector. Arithmetic and functions go element by element, a number with
//! every element; vectors must have one length. Elements count from 1: `x[3]`, `x[2:10]` (both ends included), and
//! `theta[school]` for a vector of whole numbers `school`. `sum`, `mean`, `min`, `max` and others give one number of a
//! vector. So the log density of a regression reads `sum(normal_log_density(y, a + b * x, sigma))`. All functions are
//! listed by [`functions`]; a study's tables, such as a force over time, are called like them: `force(time)`.
//!
//! # What is undefined
//!
//! Operations outside their domain (`log(-1)`, `0/0`) give no number (NaN), and so does everything computed from
//! it: `min`, `max` and comparisons do not hide it. `if` looks only at the branch that is taken,
//! and `and` and `or` are decided by one side where one side decides.
//!
//! # Derivatives
//!
//! are exact, in forward or reverse mode. Where there is none, this one is taken: `abs` and `sign` have slope 0
//! at 0; `floor` and `ceil` have slope 0; `min` and `max` have the slope of the first of equal arguments; `if` has
//! the slope of the branch taken; `interpolate` and tables that of the segment to the right, and none beyond the nodes;
//! `hypot` and `atan2` have slope 0 at the origin. What does not contribute to a result has no slope in it.

mod breaks;
mod compile;
mod evaluator;
mod fault;
mod forward;
mod function;
mod operator;
mod parse;
mod program;
mod reverse;
mod scope;
mod tangent;
mod token;
mod tree;
mod units;

pub use breaks::Break;
pub use evaluator::{DIRECTIONS, Evaluator};
pub use fault::Fault;
pub use function::{Function, functions};
pub use program::Program;
pub use scope::{Data, Scope};
pub use token::is_name;

/// Reads an expression without looking up its names: a fault is one of form.
pub fn check(text: &str) -> Result<(), Fault> {
    tree::Tree::parse(text, &[]).map(|_| ())
}

/// The names that an expression uses, which may call these tables.
pub fn names(text: &str, tables: &[&str]) -> Result<Vec<String>, Fault> {
    Ok(tree::Tree::parse(text, tables)?.names().map(str::to_owned).collect())
}

#[cfg(test)]
mod tests;
