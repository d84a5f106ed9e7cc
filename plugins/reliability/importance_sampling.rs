//! `importance_sampling`: samples around the design points.

use lacuna::math::random::{Stream, normal, uniform};
use lacuna::math::special::{ln_sum_exp, normal_cdf};
use lacuna::plugin::reliability::{DesignPoint, Estimate, LimitState};
use lacuna::plugin::{Component, Context, Reliability, Size};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use rand::rngs::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{Counted, at_least, between, log_normal, standard_normal};
use super::form::{Form, approximation, pick};

/// Importance sampling around the design points of `form`: the samples are standard normal around each point, in proportion to
/// the probabilities of their half-spaces, and weighted exactly, so that the curvature of the limit state makes no error.
///
/// About half of the samples fail, whatever the probability: a coefficient of variation of 5 % takes some 500 to 2000
/// calls for few parameters. A part of the failure region without a design point of its own is missed or makes the weights uneven;
/// compare with `subset_simulation` if the limit state may have several parts. With many parameters (above 50, say) the
/// weights of a curved limit state become uneven as well. It needs independent priors, not a posterior.
///
/// Reference: Melchers, Structural Safety 6 (1989) 3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImportanceSampling {
    /// Search for the design points.
    pub form: Form,
    /// Largest number of samples.
    pub samples: usize,
    /// Number of samples that are evaluated together.
    pub batch: usize,
    /// Coefficient of variation at which the sampling ends.
    pub variation: f64,
}

impl Default for ImportanceSampling {
    fn default() -> Self {
        Self { form: Form::default(), samples: 10_000, batch: 100, variation: 0.05 }
    }
}

/// Number of failures below which the coefficient of variation itself is not reliable.
const FEW: usize = 30;

impl Component for ImportanceSampling {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.form.check(context, complaints);
        at_least("samples", self.samples, 100, complaints);
        at_least("batch", self.batch, 10, complaints);
        between("variation", self.variation, (0.0, 1.0), complaints);
    }

    fn room(&self, unknowns: usize) -> Vec<Size> {
        // The points one by one and as rows, each with its place and its value.
        let numbers = 2 * unknowns + 4;
        vec![Size { key: "batch", what: "the samples", value: self.batch, numbers }]
    }
}

/// Mixture of standard normal distributions around the design points.
struct Mixture {
    points: Vec<DesignPoint>,
    shares: Vec<f64>,
    total: f64,
}

impl Mixture {
    fn new(points: Vec<DesignPoint>) -> Self {
        let shares: Vec<f64> = points.iter().map(|p| normal_cdf(-p.distance).max(1e-300)).collect();
        let total = shares.iter().sum();
        Self { points, shares, total }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let centre = &self.points[pick(&self.shares, self.total * uniform(rng))].point;
        centre.iter().map(|x| x + normal(rng)).collect()
    }

    /// Standard normal density divided by that of the mixture.
    fn weight(&self, u: &[f64]) -> f64 {
        let ratio = |(point, share): (&DesignPoint, &f64)| {
            dot(u, &point.point) - 0.5 * dot(&point.point, &point.point) + (share / self.total).ln()
        };
        let all = self.points.iter().zip(&self.shares).map(ratio);
        (-all.fold(f64::NEG_INFINITY, ln_sum_exp)).exp()
    }
}

impl Reliability for ImportanceSampling {
    fn needs_standard_normal(&self) -> bool {
        true
    }

    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        standard_normal("importance_sampling", state)?;
        let counted = Counted::new(state, progress);
        let found = self.form.find(&counted, &stream.named("search"))?;
        let mixture = Mixture::new(found.iter().map(|f| f.design.clone()).collect());
        let mut rng = stream.named("samples").generator();
        let (mut weights, mut failures): (Vec<f64>, usize) = (Vec::new(), 0);
        while weights.len() < self.samples {
            let points: Vec<Vec<f64>> = (0..self.batch).map(|_| mixture.draw(&mut rng)).collect();
            let values = counted.answers(&Matrix::from_rows(state.dimension(), &points))?;
            for (point, value) in points.iter().zip(values) {
                let failed = value <= 0.0;
                failures += usize::from(failed);
                weights.push(if failed { mixture.weight(point) } else { 0.0 });
            }
            if failures >= FEW && moments(&weights).1 <= self.variation {
                break;
            }
        }
        let (probability, variation) = moments(&weights);
        let mut estimate = approximation(probability, &counted, &found);
        estimate.converged = failures >= FEW && variation <= self.variation;
        if failures < FEW {
            let text =
                format!("the limit was exceeded at only {failures} of {} samples", weights.len());
            estimate.warnings.push(text);
        } else if !estimate.converged {
            let text = format!("the coefficient of variation is above {}", self.variation);
            estimate.warnings.push(text);
        }
        estimate.failures = Some(failures);
        if variation.is_finite() {
            estimate.variation = Some(variation);
            estimate.interval = Some(log_normal(probability, variation));
        }
        Ok(estimate)
    }
}

/// Mean of the weights, and its coefficient of variation.
fn moments(weights: &[f64]) -> (f64, f64) {
    let n = weights.len().max(1) as f64;
    let mean = weights.iter().sum::<f64>() / n;
    let square = weights.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / (n - 1.0);
    (mean, (square / n).sqrt() / mean)
}

lacuna::register!(Reliability, "importance_sampling", ImportanceSampling);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_samples_of_a_batch_need_memory() {
        let found = ImportanceSampling { batch: 1000, ..ImportanceSampling::default() }.room(3);
        let what = "the samples";
        assert_eq!(found, [Size { key: "batch", what, value: 1000, numbers: 10 }]);
    }
}
