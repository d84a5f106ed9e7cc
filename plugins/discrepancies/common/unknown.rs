//! Hyperparameters with one number per group of outputs.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::discrepancy::Hyperparameter;

use super::{Groups, Quantity};

/// One positive number for each group: known, or a range of the hyperparameters.
#[derive(Debug, Clone)]
pub struct PerGroup {
    known: Option<Vec<f64>>,
    first: usize,
    count: usize,
}

/// Name and unit of a positive number.
pub struct Unknown<'a> {
    /// Name and symbol, to which the group's name is appended.
    pub name: &'a str,
    /// Unit.
    pub unit: Unit,
}

impl PerGroup {
    /// Returns the numbers of all groups; unknown ones become hyperparameters, which are sampled as logarithms.
    pub fn new(
        quantity: &Quantity,
        groups: &Groups,
        unknown: &Unknown<'_>,
        start: impl Fn(usize) -> f64,
        hyper: &mut Vec<Hyperparameter>,
    ) -> Self {
        let (first, count) = (hyper.len(), groups.count());
        let prior = match quantity {
            Quantity::Known(values) => {
                // A missing number is NaN, which makes the likelihood zero.
                let of = |&g: &usize| match values.as_slice() {
                    [one] => *one,
                    many => many.get(g).copied().unwrap_or(f64::NAN),
                };
                let known = groups.position.iter().map(of);
                return Self { known: Some(known.collect()), first, count };
            }
            Quantity::Unknown(prior) => prior,
        };
        hyper.extend((0..count).map(|g| Hyperparameter {
            name: groups.name(unknown.name, g),
            symbol: groups.name(unknown.name, g),
            unit: unknown.unit.clone(),
            prior: prior.clone(),
            log: true,
            start: inside(prior, start(g)),
        }));
        Self { known: None, first, count }
    }

    /// Returns the numbers, given all hyperparameters; `None` if one of them is not above zero.
    pub fn values<'a>(&'a self, hyper: &'a [f64]) -> Option<&'a [f64]> {
        let values = match &self.known {
            Some(known) => known,
            None => &hyper[self.first..self.first + self.count],
        };
        values.iter().all(|v| *v > 0.0).then_some(values)
    }

    /// Adds the derivatives with respect to the numbers to those with respect to the hyperparameters.
    pub fn add_gradient(&self, by_value: &[f64], by_hyper: &mut [f64]) {
        if self.known.is_none() {
            let own = &mut by_hyper[self.first..self.first + self.count];
            own.iter_mut().zip(by_value).for_each(|(sum, g)| *sum += g);
        }
    }
}

/// Returns the estimate if the prior allows it, else the prior's median.
fn inside(prior: &Distribution, estimate: f64) -> f64 {
    if prior.log_density(estimate).is_finite() && estimate > 0.0 {
        estimate
    } else {
        prior.quantile(0.5)
    }
}
