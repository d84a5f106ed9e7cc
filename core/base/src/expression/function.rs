//! Functions that an expression can call.

use std::ops::Range;

use super::Fault;
use super::operator::{Binary, Unary};
use crate::text::nearest::nearest;

/// A function, as documented for users.
#[derive(Debug)]
pub struct Function {
    /// Name of the function.
    pub name: &'static str,
    /// Names of the arguments, in order; `…` means that the preceding one may be repeated.
    pub arguments: &'static [&'static str],
    /// Description of the result.
    pub meaning: &'static str,
    pub(super) action: Action,
}

/// Operation of a function.
#[derive(Clone, Copy, Debug)]
pub(super) enum Action {
    Unary(Unary),
    Binary(Binary),
    /// Reduction of several numbers, or of the elements of one vector, to one number.
    Fold(Binary, Reduction),
    If,
    Sum,
    Mean,
    Dot,
    Length,
    MatrixProduct,
    Recurrence,
    Interpolate,
    Density(Density),
}

/// Reduction of a vector to one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Reduction {
    Sum,
    Min,
    Max,
    LogSumExp,
}

/// The logarithm of a probability density.
#[derive(Clone, Copy, Debug)]
pub(super) enum Density {
    Normal,
    LogNormal,
    StudentT,
    Cauchy,
    Exponential,
    Gamma,
    InverseGamma,
    Beta,
    Uniform,
    Poisson,
    Binomial,
}

const fn function(
    name: &'static str,
    arguments: &'static [&'static str],
    meaning: &'static str,
    action: Action,
) -> Function {
    Function { name, arguments, meaning, action }
}

const fn unary(name: &'static str, meaning: &'static str, operation: Unary) -> Function {
    function(name, &["x"], meaning, Action::Unary(operation))
}

const fn density(
    name: &'static str,
    arguments: &'static [&'static str],
    meaning: &'static str,
    density: Density,
) -> Function {
    function(name, arguments, meaning, Action::Density(density))
}

const MORE: &str = "…";

static FUNCTIONS: [Function; 47] = [
    unary("abs", "the magnitude", Unary::Abs),
    unary("sign", "-1, 0 or 1", Unary::Sign),
    unary("sqrt", "the square root", Unary::Sqrt),
    unary("exp", "the exponential", Unary::Exp),
    unary("expm1", "`exp(x) - 1` with all digits of a small `x`", Unary::Expm1),
    unary("log", "the natural logarithm", Unary::Log),
    unary("log10", "the logarithm to base ten", Unary::Log10),
    unary("log1p", "`log(1 + x)` with all digits of a small `x`", Unary::Log1p),
    unary("sin", "the sine of an angle in radians", Unary::Sin),
    unary("cos", "the cosine of an angle in radians", Unary::Cos),
    unary("tan", "the tangent of an angle in radians", Unary::Tan),
    unary("asin", "the angle of this sine, from -pi/2 to pi/2", Unary::Asin),
    unary("acos", "the angle of this cosine, from 0 to pi", Unary::Acos),
    unary("atan", "the angle of this tangent, from -pi/2 to pi/2", Unary::Atan),
    unary("sinh", "the hyperbolic sine", Unary::Sinh),
    unary("cosh", "the hyperbolic cosine", Unary::Cosh),
    unary("tanh", "the hyperbolic tangent", Unary::Tanh),
    unary("floor", "the largest whole number not above `x`", Unary::Floor),
    unary("ceil", "the smallest whole number not below `x`", Unary::Ceil),
    unary("erf", "the error function", Unary::Erf),
    unary("erfc", "one less the error function", Unary::Erfc),
    unary("log_gamma", "the logarithm of the gamma function's magnitude", Unary::LogGamma),
    function("pow", &["x", "y"], "`x ^ y`", Action::Binary(Binary::Power)),
    function("atan2", &["y", "x"], "the angle of the point (x, y)", Action::Binary(Binary::Atan2)),
    function("hypot", &["x", "y"], "`sqrt(x^2 + y^2)`", Action::Binary(Binary::Hypot)),
    function(
        "min",
        &["x", MORE],
        "the smallest argument, or the smallest element of one vector",
        Action::Fold(Binary::Min, Reduction::Min),
    ),
    function(
        "max",
        &["x", MORE],
        "the largest argument, or the largest element of one vector",
        Action::Fold(Binary::Max, Reduction::Max),
    ),
    function(
        "log_sum_exp",
        &["x", MORE],
        "`log(exp(x) + …)` without overflow, of the arguments or of the elements of one vector",
        Action::Fold(Binary::LogSumExp, Reduction::LogSumExp),
    ),
    function("if", &["condition", "yes", "no"], "one of two values", Action::If),
    function("sum", &["vector"], "the sum of the elements", Action::Sum),
    function("mean", &["vector"], "the mean of the elements", Action::Mean),
    function("dot", &["vector", "vector"], "the scalar product", Action::Dot),
    function("length", &["vector"], "the number of elements", Action::Length),
    function(
        "matrix_product",
        &["matrix", "vector"],
        "the product of a matrix of data and a vector",
        Action::MatrixProduct,
    ),
    function(
        "recurrence",
        &["start", "factor", "input"],
        "the vector of `z[i] = factor * z[i - 1] + input[i]`, with `start` before its first element; the factor \
         is one number or a vector as long as the input",
        Action::Recurrence,
    ),
    function(
        "interpolate",
        &["x", "nodes", "values"],
        "the straight line between the values at the nodes, constant beyond the first and the last; nodes \
         and values are data",
        Action::Interpolate,
    ),
    density("normal_log_density", &["x", "mean", "sd"], "of a normal law", Density::Normal),
    density(
        "log_normal_log_density",
        &["x", "mu", "sigma"],
        "of a law whose logarithm is normal with mean mu and standard deviation sigma",
        Density::LogNormal,
    ),
    density(
        "student_t_log_density",
        &["x", "degrees", "location", "scale"],
        "of Student's t with these degrees of freedom",
        Density::StudentT,
    ),
    density("cauchy_log_density", &["x", "location", "scale"], "of a Cauchy law", Density::Cauchy),
    density(
        "exponential_log_density",
        &["x", "mean"],
        "of an exponential law",
        Density::Exponential,
    ),
    density(
        "gamma_log_density",
        &["x", "shape", "scale"],
        "of a gamma law of mean shape times scale",
        Density::Gamma,
    ),
    density(
        "inverse_gamma_log_density",
        &["x", "shape", "scale"],
        "of a law whose reciprocal is of the gamma law with this shape and the reciprocal scale",
        Density::InverseGamma,
    ),
    density("beta_log_density", &["x", "a", "b"], "of a beta law on (0, 1)", Density::Beta),
    density(
        "uniform_log_density",
        &["x", "lower", "upper"],
        "of a uniform law on an interval",
        Density::Uniform,
    ),
    density("poisson_log_density", &["count", "mean"], "of a Poisson law", Density::Poisson),
    density(
        "binomial_log_density",
        &["count", "trials", "probability"],
        "of a binomial law",
        Density::Binomial,
    ),
];

/// Names in other languages and the corresponding names here.
const ALIASES: [(&str, &str); 13] = [
    ("ln", "log"),
    ("lgamma", "log_gamma"),
    ("fabs", "abs"),
    ("signum", "sign"),
    ("ceiling", "ceil"),
    ("arcsin", "asin"),
    ("arccos", "acos"),
    ("arctan", "atan"),
    ("len", "length"),
    ("interp", "interpolate"),
    ("matmul", "matrix_product"),
    ("normal_lpdf", "normal_log_density"),
    ("logsumexp", "log_sum_exp"),
];

/// All functions, for the pages of the manual.
pub fn functions() -> impl Iterator<Item = &'static Function> {
    FUNCTIONS.iter()
}

/// Looks up the function named at this byte range; the names of tables are used for suggestions.
pub(super) fn find(
    name: &str,
    span: &Range<usize>,
    tables: &[&str],
) -> Result<&'static Function, Fault> {
    if let Some(function) = functions().find(|function| function.name == name) {
        return Ok(function);
    }
    let fault = Fault::new(span.clone(), format!("unknown function `{name}`"));
    let alias = ALIASES.into_iter().find(|(other, _)| *other == name).map(|(_, ours)| ours);
    let names = functions().map(|function| function.name).chain(tables.iter().copied());
    let near = alias.or_else(|| nearest(name, names));
    Err(match near {
        Some(near) => fault.help(format!("did you mean `{near}`?")),
        None => fault.help("a product with a parenthesis is written with `*`"),
    })
}

/// Calling form of a function that is given by a table.
pub(super) fn table_usage(name: &str) -> String {
    format!("{name}(x)")
}

impl Function {
    /// Calling form, such as `atan2(y, x)`.
    pub fn usage(&self) -> String {
        format!("{}({})", self.name, self.arguments.join(", "))
    }

    /// Returns true if the function accepts this number of arguments.
    pub(super) fn takes(&self, count: usize) -> bool {
        match self.arguments.split_last() {
            Some((&MORE, fixed)) => count >= fixed.len(),
            _ => count == self.arguments.len(),
        }
    }
}
