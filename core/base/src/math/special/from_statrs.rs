//! Functions taken from the crate `statrs`, in one place; the functions of this module with quantiles of their own are
//! more accurate in the tails.

use statrs::distribution::{ContinuousCDF, StudentsT};

pub use statrs::function::factorial::ln_binomial;
pub use statrs::function::gamma::digamma;

/// Probability that a Student t variable with this many degrees of freedom is below `x`; `None` unless they are
/// positive.
pub fn student_t_cdf(freedom: f64, x: f64) -> Option<f64> {
    Some(StudentsT::new(0.0, 1.0, freedom).ok()?.cdf(x))
}

/// Quantile of Student's t distribution with this many degrees of freedom at probability `p`; `None` unless they are
/// positive. For the usual levels: it loses digits in the tails.
pub fn student_t_quantile(freedom: f64, p: f64) -> Option<f64> {
    Some(StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(p))
}
