//! Reliability methods: the probability of a rare event.

use lacuna_base::math::random::Stream;
use lacuna_base::matrix::Matrix;
use lacuna_base::run::{Progress, Stop};
use serde::{Deserialize, Serialize};

use super::Component;

/// A method that estimates the probability that a limit is exceeded.
pub trait Reliability: Component {
    /// True for a method that works only if the variables are exactly standard normal, as they are for independent priors
    /// and are not for a posterior.
    fn needs_standard_normal(&self) -> bool {
        false
    }

    /// The probability that the limit state is not above zero.
    ///
    /// # Errors
    /// If the limit state cannot be evaluated, or no estimate exists.
    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop>;
}

/// A limit state: a function of standard normal variables that is not above zero where the limit is exceeded.
///
/// If there is a weight `w`, the density of the variables is proportional to `phi(u) w(u)` with the standard normal
/// density `phi`.
pub trait LimitState: Sync {
    /// Number of variables.
    fn dimension(&self) -> usize;

    /// Values at each row of `points` (`points x dimension`); NaN where the model has no answer. Every row is one call of
    /// the model.
    ///
    /// # Errors
    /// If the model cannot be called any more.
    fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop>;

    /// True if the variables are standard normal, without a weight.
    fn is_standard_normal(&self) -> bool {
        true
    }

    /// Logarithm of the weight at each row of `points`, which costs no call of the model; minus infinity outside the
    /// support.
    fn log_weights(&self, points: &Matrix) -> Vec<f64> {
        vec![0.0; points.rows()]
    }

    /// Nearly independent draws of the variables (`draws x dimension`); `None` if they are standard normal.
    fn draws(&self) -> Option<&Matrix> {
        None
    }
}

/// An estimate of the probability of a rare event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Probability.
    pub probability: f64,
    /// Coefficient of variation of the estimate; `None` for an approximation without sampling.
    pub variation: Option<f64>,
    /// Interval that contains the probability with 95 % confidence; `None` for an approximation without sampling.
    pub interval: Option<[f64; 2]>,
    /// Number of calls of the model.
    pub calls: usize,
    /// Number of calls without an answer. They count as no failure.
    pub undefined: usize,
    /// Number of calls at which the limit was exceeded; `None` for an approximation without sampling.
    pub failures: Option<usize>,
    /// Points of the failure region nearest to the origin, the nearest first; empty if the method does not find them.
    pub design_points: Vec<DesignPoint>,
    /// True if the criteria of the method are met.
    pub converged: bool,
    /// Sentences on what makes the estimate doubtful.
    pub warnings: Vec<String>,
}

/// A local minimum of the distance between the failure region and the origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DesignPoint {
    /// Standard normal variables.
    pub point: Vec<f64>,
    /// Distance from the origin; negative if the origin is in the failure region.
    pub distance: f64,
    /// Unit vector against the gradient of the limit state.
    pub direction: Vec<f64>,
}

impl DesignPoint {
    /// Share of each variable in the variance of the linearised limit state; the sum is one.
    pub fn importance(&self) -> Vec<f64> {
        self.direction.iter().map(|a| a * a).collect()
    }
}
