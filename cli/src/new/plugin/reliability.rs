//! `skeleton`: the share of draws that fail.

use lacuna::math::random::{Stream, normal};
use lacuna::matrix::Matrix;
use lacuna::plugin::reliability::{Estimate, LimitState};
use lacuna::plugin::{Component, Reliability};
use lacuna::run::{Progress, Stop};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Share of independent draws at which the limit is exceeded, with a normal interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Number of draws.
    pub samples: u32,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { samples: 10_000 }
    }
}

impl Component for Skeleton {}

impl Reliability for Skeleton {
    fn needs_standard_normal(&self) -> bool {
        true
    }

    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        if !state.is_standard_normal() {
            return Err(Stop::new("`skeleton` needs independent priors"));
        }
        let (mut rng, count) = (stream.generator(), self.samples as usize);
        let points = Matrix::from_fn(count, state.dimension(), |_, _| normal(&mut rng));
        let values = state.values(&points)?;
        progress.add(count as u64);
        let failures = values.iter().filter(|value| **value <= 0.0).count();
        let probability = failures as f64 / count as f64;
        let error = (probability * (1.0 - probability) / count as f64).sqrt();
        Ok(Estimate {
            probability,
            variation: Some(error / probability).filter(|ratio| ratio.is_finite()),
            interval: Some([(probability - 1.96 * error).max(0.0), probability + 1.96 * error]),
            calls: count,
            undefined: values.iter().filter(|value| value.is_nan()).count(),
            failures: Some(failures),
            design_points: Vec::new(),
            converged: failures >= 10,
            warnings: Vec::new(),
        })
    }
}

lacuna::register!(Reliability, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::reliability("skeleton", &Skeleton::default()), Ok(()));
    }
}
