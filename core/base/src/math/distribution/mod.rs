//! Probability distributions that a study can name.
//!
//! A distribution is written as a table with one key, such as `{ uniform = [0, 1.5e6] }`. A distribution read from a
//! study has been checked; [`Distribution::check`] does the same for one made in code.

mod density;
mod fitted;
mod probability;
mod quantiles;
mod score;
mod summary;
mod written;

use std::fmt;

use quantiles::Quantiles;
use schemars::JsonSchema;
use serde::Serialize;

/// Largest shape of a beta distribution: its probabilities need more terms the larger the shape.
const LARGEST_SHAPE: f64 = 1e9;

/// Relative width below which few numbers of double precision lie in an interval.
const ROUNDING: f64 = 1e-14;

/// The largest number of a distribution lies between these: variances of values beyond them are not numbers of double precision.
const SIZES: [f64; 2] = [1e-100, 1e100];

/// A distribution of one number, in the unit of that number.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Uniform on an interval: `[lower bound, upper bound]`.
    Uniform([f64; 2]),
    /// Normal: `[mean, standard deviation]`.
    Normal([f64; 2]),
    /// The absolute value of a normal variable with mean zero. The number is the standard deviation of that normal
    /// distribution; the mean of the half-normal one is 0.798 times and its own standard deviation 0.603 times as
    /// large.
    HalfNormal(f64),
    /// Log-normal: `[mu, sigma]`, the mean and the standard deviation of the logarithm.
    LogNormal([f64; 2]),
    /// The logarithm is uniform: `[lower bound, upper bound]`, both above zero.
    LogUniform([f64; 2]),
    /// Gamma: `[shape, scale]`, with mean shape times scale.
    Gamma([f64; 2]),
    /// Inverse gamma: `[shape, scale]`, with mean scale / (shape - 1) if the shape exceeds one.
    InverseGamma([f64; 2]),
    /// Beta on an interval: `[a, b, lower bound, upper bound]`, or `[a, b]` on (0, 1).
    Beta(#[schemars(schema_with = "written::beta_schema")] [f64; 4]),
    /// Exponential: the mean.
    Exponential(f64),
    /// Student's t: `[degrees of freedom, location, scale]`.
    StudentT([f64; 3]),
    /// The absolute value of a variable with Student's t distribution about zero: `[degrees of freedom, scale]`. With one
    /// degree of freedom it is the half-Cauchy distribution.
    HalfStudentT([f64; 2]),
    /// Normal truncated to bounds, which may be infinite: `[mean, standard deviation, lower bound, upper bound]`, the
    /// first two before truncation.
    TruncatedNormal([f64; 4]),
    /// Triangular: `[lower bound, mode, upper bound]`.
    Triangular([f64; 3]),
    /// Given by quantiles: `[lower bound, upper bound, s, x0, x1, …]`, bounds that may be infinite and the values of which the
    /// normal scores are equally spaced from -s to s. Between them the value is a smooth monotone function of the score; beyond
    /// them the tails are normal (log-normal or logit-normal towards a bound).
    Quantiles(Vec<f64>),
}

impl Distribution {
    /// Name that a study uses, such as `half_normal`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Uniform(_) => "uniform",
            Self::Normal(_) => "normal",
            Self::HalfNormal(_) => "half_normal",
            Self::LogNormal(_) => "log_normal",
            Self::LogUniform(_) => "log_uniform",
            Self::Gamma(_) => "gamma",
            Self::InverseGamma(_) => "inverse_gamma",
            Self::Beta(_) => "beta",
            Self::Exponential(_) => "exponential",
            Self::StudentT(_) => "student_t",
            Self::HalfStudentT(_) => "half_student_t",
            Self::TruncatedNormal(_) => "truncated_normal",
            Self::Triangular(_) => "triangular",
            Self::Quantiles(_) => "quantiles",
        }
    }

    /// Parameters in the order in which a study writes them.
    pub fn numbers(&self) -> &[f64] {
        match self {
            Self::Uniform(n)
            | Self::Normal(n)
            | Self::LogNormal(n)
            | Self::LogUniform(n)
            | Self::Gamma(n)
            | Self::InverseGamma(n)
            | Self::HalfStudentT(n) => n,
            Self::HalfNormal(n) | Self::Exponential(n) => std::slice::from_ref(n),
            Self::Beta(n) | Self::TruncatedNormal(n) => n,
            Self::StudentT(n) | Self::Triangular(n) => n,
            Self::Quantiles(n) => n,
        }
    }

    /// Checks that the parameters are valid.
    ///
    /// # Errors
    /// What was expected and what was found.
    pub fn check(&self) -> Result<(), String> {
        let numbers = self.numbers();
        let complain = |expected: &str| {
            let found = match numbers {
                [x] => written::number(*x),
                _ => written::in_brackets(numbers),
            };
            Err(format!("expected {expected}, found {found}"))
        };
        if let Self::Quantiles(numbers) = self {
            return Quantiles::wrong(numbers).map_or(Ok(()), complain);
        }
        let bounds = if let Self::TruncatedNormal(n) = self { &n[2..] } else { &[][..] };
        let rest = &numbers[..numbers.len() - bounds.len()];
        if rest.iter().any(|x| !x.is_finite()) || bounds.iter().any(|x| x.is_nan()) {
            return complain("finite numbers");
        }
        match *self {
            Self::Uniform([lo, hi]) if lo >= hi => complain("the lower bound below the upper"),
            Self::Uniform([lo, hi]) if !(hi - lo).is_finite() => complain("a narrower interval"),
            Self::Uniform([lo, hi]) if hi - lo <= ROUNDING * lo.abs().max(hi.abs()) => {
                complain("an interval that is wider than rounding, 1e-14 of its bounds")
            }
            Self::Normal([mean, sd]) if sd > 0.0 && sd <= ROUNDING * mean.abs() => {
                complain("a standard deviation above rounding, 1e-14 of the mean")
            }
            Self::Normal([_, sd]) if sd <= 0.0 => complain("a standard deviation above zero"),
            Self::HalfNormal(scale) if scale <= 0.0 => complain("a scale above zero"),
            Self::LogNormal([_, sigma]) if sigma <= 0.0 => complain("a sigma above zero"),
            Self::LogUniform([lo, _]) if lo <= 0.0 => complain("bounds above zero"),
            Self::LogUniform([lo, hi]) if lo >= hi => complain("the lower bound below the upper"),
            Self::Gamma([shape, scale]) | Self::InverseGamma([shape, scale])
                if shape <= 0.0 || scale <= 0.0 =>
            {
                complain("a shape and a scale above zero")
            }
            Self::Beta([a, b, _, _]) if a <= 0.0 || b <= 0.0 => complain("a and b above zero"),
            Self::Beta([a, b, _, _]) if a.max(b) > LARGEST_SHAPE => {
                complain("a and b of at most 1e9")
            }
            Self::Beta([_, _, lo, hi]) if lo >= hi => complain("the lower bound below the upper"),
            Self::Exponential(mean) if mean <= 0.0 => complain("a mean above zero"),
            Self::StudentT([dof, _, scale]) | Self::HalfStudentT([dof, scale])
                if dof <= 0.0 || scale <= 0.0 =>
            {
                complain("degrees of freedom and a scale above zero")
            }
            Self::TruncatedNormal([_, sd, _, _]) if sd <= 0.0 => {
                complain("a standard deviation above zero")
            }
            Self::TruncatedNormal([_, _, lo, hi])
                if lo >= hi || lo == f64::INFINITY || hi == f64::NEG_INFINITY =>
            {
                complain("the lower bound below the upper")
            }
            // Beyond that distance the law is exponential at its bound, and its parameters are lost to rounding.
            Self::TruncatedNormal([mean, sd, lo, hi])
                if lo - mean > 1000.0 * sd || mean - hi > 1000.0 * sd =>
            {
                complain("bounds at most 1000 standard deviations from the mean")
            }
            Self::Triangular([lo, mode, hi]) if !(lo <= mode && mode <= hi && lo < hi) => {
                complain("the mode between a lower and a higher bound")
            }
            Self::LogNormal([mu, sigma]) if mu.abs().max(sigma) > SIZES[1].ln() => {
                complain("a mu and a sigma between -230 and 230")
            }
            _ if !self.is_of_ordinary_size() => {
                complain("numbers of a size between 1e-100 and 1e100, in another unit if need be")
            }
            _ => Ok(()),
        }
    }

    /// Squares of the variable, and their reciprocals, are numbers.
    fn is_of_ordinary_size(&self) -> bool {
        if let Self::LogUniform([lo, hi]) = *self {
            // It may span all decades: what matters is where the data leave it.
            return lo <= SIZES[1] && hi >= SIZES[0];
        }
        // Bounds that cut nothing off may be any numbers.
        let numbers = if let Self::TruncatedNormal(n) = self { &n[..2] } else { self.numbers() };
        let largest = numbers.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
        (SIZES[0]..=SIZES[1]).contains(&largest)
    }
}

impl fmt::Display for Distribution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = |x: f64| written::number(x);
        match *self {
            Self::Uniform([lo, hi]) => write!(f, "uniform on [{}, {}]", n(lo), n(hi)),
            Self::Normal([mean, sd]) => write!(f, "normal, mean {}, sd {}", n(mean), n(sd)),
            Self::HalfNormal(scale) => write!(f, "half-normal of scale {}", n(scale)),
            Self::LogNormal([mu, sigma]) => {
                write!(f, "log-normal, logarithm of mean {}, sd {}", n(mu), n(sigma))
            }
            Self::LogUniform([lo, hi]) => write!(f, "log-uniform on [{}, {}]", n(lo), n(hi)),
            Self::Gamma([shape, scale]) => {
                write!(f, "gamma of shape {}, scale {}", n(shape), n(scale))
            }
            Self::InverseGamma([shape, scale]) => {
                write!(f, "inverse gamma of shape {}, scale {}", n(shape), n(scale))
            }
            Self::Beta([a, b, lo, hi]) => {
                write!(f, "beta ({}, {}) on [{}, {}]", n(a), n(b), n(lo), n(hi))
            }
            Self::Exponential(mean) => write!(f, "exponential of mean {}", n(mean)),
            Self::StudentT([dof, location, scale]) => write!(
                f,
                "Student t with {} degrees of freedom, location {}, scale {}",
                n(dof),
                n(location),
                n(scale)
            ),
            Self::HalfStudentT([dof, scale]) => {
                write!(f, "half Student t with {} degrees of freedom, scale {}", n(dof), n(scale))
            }
            Self::TruncatedNormal([mean, sd, lo, hi]) => {
                write!(f, "normal, mean {}, sd {}, kept in [{}, {}]", n(mean), n(sd), n(lo), n(hi))
            }
            Self::Triangular([lo, mode, hi]) => {
                write!(f, "triangular on [{}, {}], mode {}", n(lo), n(hi), n(mode))
            }
            Self::Quantiles(_) => {
                let [low, middle, high] = [0.025, 0.5, 0.975].map(|p| self.quantile(p));
                let rounded = |x: f64| format!("{x:.4}");
                let (low, middle, high) = (rounded(low), rounded(middle), rounded(high));
                write!(f, "by quantiles: 95 % in [{low}, {high}], median {middle}")
            }
        }
    }
}

#[cfg(test)]
mod tests;
