//! Formulas as written in a study: parsed, checked, compiled, differentiated exactly.
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
//! Powers are right-associative and bind tighter than signs: `-x^2` is `-(x^2)`, `2^3^2` is `2^9`, `2^-x` is allowed.
//! Comparisons give conditions, which `and`, `or`, `not` combine and `if(condition, yes, no)` uses; they cannot be
//! chained and are not numbers. `pi` and `e` are predefined.
//!
//! A name denotes a number or a vector. Arithmetic and functions act elementwise, a number combines with every element;
//! vectors must have the same length. Elements count from 1: `x[3]`, `x[2:10]` (both ends included), and
//! `theta[school]` for a vector of whole numbers `school`. `sum`, `mean`, `min`, `max` and others reduce a vector to
//! one number. The log density of a regression, for example, is `sum(normal_log_density(y, a + b * x, sigma))`. All
//! functions are listed by [`functions`]; a study's tables, such as a force over time, and its random fields are called
//! like functions: `force(time)`.
//!
//! # Undefined results
//!
//! Operations outside their domain (`log(-1)`, `0/0`) give NaN, and so does everything computed from it: `min`, `max`
//! and comparisons do not hide it. `if` evaluates only the branch taken, and `and` and `or` are decided by one side if
//! that side is decisive.
//!
//! # Derivatives
//!
//! Derivatives are exact, in forward or reverse mode. Where none exists, this convention holds: `abs` and `sign` have
//! slope 0 at 0; `floor` and `ceil` have slope 0; `min` and `max` have the slope of the first of equal arguments; `if`
//! has the slope of the branch taken; `interpolate` and tables have that of the segment to the right, and zero beyond
//! the nodes; `hypot` and `atan2` have slope 0 at the origin. An argument that does not contribute to a result has
//! slope zero.

mod adjoint;
mod breaks;
mod compile;
mod curve;
mod evaluator;
mod fault;
mod forward;
mod function;
mod operator;
mod parse;
mod parts;
mod program;
mod reverse;
mod scope;
mod tangent;
mod tape;
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

/// Checks the syntax of an expression without looking up its names.
///
/// # Errors
/// The syntax fault.
pub fn check(text: &str) -> Result<(), Fault> {
    tree::Tree::parse(text, &[]).map(|_| ())
}

/// Names that an expression uses; `tables` are the functions given by tables that it may call.
pub fn names(text: &str, tables: &[&str]) -> Result<Vec<String>, Fault> {
    Ok(tree::Tree::parse(text, tables)?.names().map(str::to_owned).collect())
}

/// Functions given by tables, of those in `tables`, that an expression calls.
pub fn called(text: &str, tables: &[&str]) -> Result<Vec<String>, Fault> {
    Ok(tree::Tree::parse(text, tables)?.called().map(str::to_owned).collect())
}

#[cfg(test)]
mod tests;
