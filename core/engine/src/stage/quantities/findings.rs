//! Figures of predicted quantities.

use lacuna::math::moments::{mean, quantile, sorted, variance};

use lacuna_linalg::Matrix;

use super::{Bounds, Quantified, Variant};

/// A predicted quantity. All figures are in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantityFindings {
    /// Name with the labels of its curve and its scenario.
    pub name: String,
    /// Unit of all figures.
    pub unit: String,
    /// Reference value, if the study gives one.
    pub reference: Option<f64>,
    /// Prediction with the posterior of the parameters and the errors that it includes.
    pub total: Spread,
    /// Prediction with the posterior of the parameters alone.
    pub parameters: Spread,
    /// Value at the MAP, without errors; in a study without data at the medians of the priors.
    pub map: f64,
    /// True in a study without data: the parameters have their priors.
    pub of_priors: bool,
    /// Shares of the inputs in the variance, in a study without data.
    pub shares: Vec<InputShare>,
    /// Bounds over the intervals of parameters, in a study without data that has some; all other figures are then those at
    /// the middle of the intervals.
    pub bounds: Option<Bounds>,
    /// Draws of the prediction at which it is defined.
    pub values: Vec<f64>,
    /// Monte Carlo standard error of the mean of `total`.
    pub mcse_mean: f64,
    /// Standard deviation with all sources but one: `parameters`, or the origin of an error that it includes.
    pub without: Vec<(String, f64)>,
    /// Errors in the prediction, by origin.
    pub includes: Vec<String>,
    /// Errors that a new replicate has and the prediction does not contain, by origin.
    pub leaves_out: Vec<String>,
    /// Number of draws.
    pub draws: usize,
    /// Number of draws at which the quantity is undefined; the figures are those of the others.
    pub undefined: usize,
}

/// Share of an uncertain input in the variance of a quantity without errors, each with its standard error. NaN if the
/// quantity does not vary.
#[derive(Debug, Clone, PartialEq)]
pub struct InputShare {
    /// Name of the input.
    pub name: String,
    /// First-order Sobol index.
    pub first: (f64, f64),
    /// Total Sobol index.
    pub total: (f64, f64),
    /// Shapley effect.
    pub shapley: (f64, f64),
}

/// Figures of a distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// 2.5 % quantile.
    pub q025: f64,
    /// Median.
    pub median: f64,
    /// 97.5 % quantile.
    pub q975: f64,
}

impl Spread {
    /// Figures of draws; NaN without any.
    fn of(draws: &[f64]) -> Self {
        if draws.is_empty() {
            let none = f64::NAN;
            return Self { mean: none, sd: none, q025: none, median: none, q975: none };
        }
        let sorted = sorted(draws);
        // The mean of equal numbers is not always that number.
        if sorted[0].to_bits() == sorted[sorted.len() - 1].to_bits() {
            let all = sorted[0];
            return Self { mean: all, sd: 0.0, q025: all, median: all, q975: all };
        }
        let [q025, median, q975] = [0.025, 0.5, 0.975].map(|p| quantile(&sorted, p));
        Self { mean: mean(draws), sd: variance(draws).sqrt(), q025, median, q975 }
    }
}

impl Quantified {
    /// Draws of a quantity in a variant; `None` if there is no such variant.
    pub fn draws_of(&self, quantity: usize, variant: &Variant) -> Option<&[f64]> {
        let place = self.about.variants.iter().position(|other| other == variant)?;
        Some(self.draws.row(place * self.about.quantities.len() + quantity))
    }

    /// Draws at which a quantity is defined.
    fn defined(&self, quantity: usize, variant: &Variant) -> Vec<f64> {
        let all = self.draws_of(quantity, variant).unwrap_or_default();
        all.iter().copied().filter(|value| value.is_finite()).collect()
    }

    /// Figures of all quantities.
    pub fn findings(&self) -> Vec<QuantityFindings> {
        (0..self.about.quantities.len()).map(|i| self.found(i)).collect()
    }

    fn found(&self, i: usize) -> QuantityFindings {
        let about = &self.about.quantities[i];
        let kept = self.defined(i, &Variant::Total);
        let total = Spread::of(&kept);
        let parameters = Spread::of(&self.defined(i, &Variant::Parameters));
        let without = self.about.variants.iter().filter_map(|variant| match variant {
            // An error that no draw of the quantity depends on is none of it.
            Variant::Without(source) if self.depends(i, variant) => {
                Some((source.clone(), Spread::of(&self.defined(i, variant)).sd))
            }
            _ => None,
        });
        // Draws of the errors are independent, those of the parameters are not.
        let of_parameters = parameters.sd.powi(2).min(total.sd.powi(2));
        let of_errors = total.sd.powi(2) - of_parameters;
        let count = kept.len() as f64;
        let error = of_parameters / (count * self.about.efficiency) + of_errors / count;
        QuantityFindings {
            name: about.name.clone(),
            unit: about.unit.clone(),
            reference: about.reference,
            total,
            parameters,
            map: self.map[i],
            of_priors: self.propagated.is_some(),
            shares: self.shares(i),
            bounds: self.bounds(i).cloned(),
            mcse_mean: error.sqrt(),
            without: without.collect(),
            includes: about.includes.clone(),
            leaves_out: about.leaves_out.clone(),
            draws: self.draws.columns(),
            undefined: self.draws.columns() - kept.len(),
            values: kept,
        }
    }

    /// Bounds of a quantity over the intervals of parameters.
    fn bounds(&self, quantity: usize) -> Option<&Bounds> {
        self.propagated.as_ref()?.bounds.as_ref()?.quantities[quantity].as_ref()
    }

    /// Shares of the inputs in the variance of a quantity.
    fn shares(&self, quantity: usize) -> Vec<InputShare> {
        let Some(found) = &self.propagated else { return Vec::new() };
        let own = &found.quantities;
        let share = |(i, name): (usize, &String)| {
            let at = |value: &Matrix, error: &Matrix| (value[(quantity, i)], error[(quantity, i)]);
            InputShare {
                name: name.clone(),
                first: at(&own.first, &own.first_error),
                total: at(&own.total, &own.total_error),
                shapley: at(&own.shapley, &own.shapley_error),
            }
        };
        found.inputs.iter().enumerate().map(share).collect()
    }

    /// Returns true if a variant gives other draws than all sources together.
    fn depends(&self, quantity: usize, variant: &Variant) -> bool {
        let bits = |variant: &Variant| {
            let draws = self.draws_of(quantity, variant).unwrap_or_default();
            draws.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
        };
        bits(variant) != bits(&Variant::Total)
    }
}
