//! Quantities predicted by several studies in one: the draws of each study have its weight.

use std::path::Path;

use lacuna::run::Stop;
use lacuna_run::{Artifact, Stage};
use serde::Serialize;

use crate::stage::quantities::{Described, Quantified, Variant};

/// Draws of the quantities that one study predicts, with all their sources of uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Predicted {
    /// Name, unit and draws of each quantity; draws at which it is undefined are left out.
    quantities: Vec<(String, String, Vec<f64>)>,
}

impl Predicted {
    /// Reads what a run kept; `None` if the study predicts nothing.
    ///
    /// # Errors
    /// If a file is there and cannot be read.
    pub(super) fn read(run: &Path) -> Result<Option<Self>, Stop> {
        let folder = run.join(Stage::Quantities.folder().name());
        if !folder.exists() {
            return Ok(None);
        }
        let kept = Quantified::load(&folder)?;
        let total = kept.about.variants.iter().position(|variant| *variant == Variant::Total);
        let described = &kept.about.quantities;
        let Some(total) = total.filter(|_| !described.is_empty()) else { return Ok(None) };
        let of = |(k, quantity): (usize, &Described)| {
            let row = kept.draws.row(total * described.len() + k);
            let defined = row.iter().copied().filter(|value| value.is_finite()).collect();
            (quantity.name.clone(), quantity.unit.clone(), defined)
        };
        Ok(Some(Self { quantities: described.iter().enumerate().map(of).collect() }))
    }

    fn draws(&self, name: &str, unit: &str) -> Option<&[f64]> {
        let known = self.quantities.iter().find(|(n, u, _)| n == name && u == unit)?;
        Some(&known.2).filter(|draws| !draws.is_empty()).map(Vec::as_slice)
    }
}

/// Distribution of a quantity in the mixture of the studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mixed {
    /// Name of the quantity, as in `summary.json`.
    pub name: String,
    /// Unit of all numbers.
    pub unit: String,
    /// With the weights by stacking.
    pub stacking: Option<Spread>,
    /// With the weights by pseudo-BMA+.
    pub pseudo_bma: Option<Spread>,
    /// With the posterior probabilities of the studies (Bayesian model averaging).
    pub probability: Option<Spread>,
}

/// Mean, standard deviation and quantiles of a mixture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Quantile of 2.5 %.
    pub q025: f64,
    /// Median.
    pub median: f64,
    /// Quantile of 97.5 %.
    pub q975: f64,
}

/// Weights of the studies, one for each of them.
#[derive(Debug, Clone, Default)]
pub(super) struct Weights {
    pub stacking: Option<Vec<f64>>,
    pub pseudo_bma: Option<Vec<f64>>,
    pub probability: Option<Vec<f64>>,
}

/// The quantities that all studies predict in the same unit, mixed.
pub(super) fn mixed(studies: &[&Predicted], weights: &Weights) -> Vec<Mixed> {
    let Some(first) = studies.first() else { return Vec::new() };
    let of = |(name, unit, _): &(String, String, Vec<f64>)| {
        let draws: Vec<&[f64]> =
            studies.iter().map(|study| study.draws(name, unit)).collect::<Option<_>>()?;
        let spread = |weights: &Option<Vec<f64>>| Some(Spread::of(&draws, weights.as_ref()?));
        Some(Mixed {
            name: name.clone(),
            unit: unit.clone(),
            stacking: spread(&weights.stacking),
            pseudo_bma: spread(&weights.pseudo_bma),
            probability: spread(&weights.probability),
        })
    };
    first.quantities.iter().filter_map(of).collect()
}

impl Spread {
    /// The mixture of samples with these weights, whose sum is one.
    fn of(samples: &[&[f64]], weights: &[f64]) -> Self {
        let each = samples.iter().zip(weights);
        let mut all: Vec<(f64, f64)> = each
            .flat_map(|(draws, w)| draws.iter().map(move |x| (*x, w / draws.len() as f64)))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mean: f64 = all.iter().map(|(x, w)| w * x).sum();
        let variance: f64 = all.iter().map(|(x, w)| w * (x - mean).powi(2)).sum();
        let quantile = |p: f64| {
            let mut below = 0.0;
            let reached = all.iter().find(|(_, w)| {
                below += w;
                below >= p
            });
            reached.or(all.last()).map_or(f64::NAN, |(x, _)| *x)
        };
        Self {
            mean,
            sd: variance.sqrt(),
            q025: quantile(0.025),
            median: quantile(0.5),
            q975: quantile(0.975),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(unit: &str, from: f64) -> Predicted {
        // Midpoints of equal cells are the quantiles of a uniform distribution.
        let draws = (0..1000).map(|i| from + (f64::from(i) + 0.5) / 1000.0).collect();
        Predicted { quantities: vec![("peak".into(), unit.into(), draws)] }
    }

    /// The mixture of the uniform distributions on [0, 1] and [2, 3] with weights 0.7 and 0.3 has the mean 1.1, the
    /// variance 1/12 + 0.7 * 0.3 * 4, and as quantile of 97.5 % the point where 0.025 of 0.3 are above.
    #[test]
    fn a_mixture_of_two_uniform_distributions_has_its_closed_form() {
        let weights = Weights { stacking: Some(vec![0.7, 0.3]), ..Weights::default() };
        let found = mixed(&[&study("m", 0.0), &study("m", 2.0)], &weights);
        let [Mixed { stacking: Some(spread), pseudo_bma: None, .. }] = &found[..] else {
            panic!("{found:?}")
        };
        let sd = (1.0_f64 / 12.0 + 0.84).sqrt();
        for (value, expected) in [
            (spread.mean, 1.1),
            (spread.sd, sd),
            (spread.q025, 0.025 / 0.7),
            (spread.median, 0.5 / 0.7),
            (spread.q975, 3.0 - 0.025 / 0.3),
        ] {
            assert!((value - expected).abs() < 2e-3, "{value} {expected}");
        }
    }

    #[test]
    fn quantities_in_other_units_are_not_mixed() {
        let weights = Weights { stacking: Some(vec![0.5, 0.5]), ..Weights::default() };
        assert!(mixed(&[&study("m", 0.0), &study("mm", 2.0)], &weights).is_empty());
    }
}
