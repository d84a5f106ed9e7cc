//! Replicates of each output reduced to counts, means and scatters, and the factor of the common errors.

use lacuna::data::{Measurements, Unit};
use lacuna::plugin::discrepancy::CommonError;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::directions::{WeightedDirections, WeightedFactor};

/// Statistics of the outputs that were measured at least once.
#[derive(Debug, Clone)]
pub struct Replicates {
    /// Flat indices of these outputs.
    pub measured: Vec<usize>,
    /// Number of replicates of each.
    pub count: Vec<f64>,
    /// Mean of the replicates.
    pub mean: Vec<f64>,
    /// Sum of squared deviations from the mean.
    pub scatter: Vec<f64>,
}

impl Replicates {
    /// Summarises the replicates; fails if data or common errors do not match the layout, or no value is measured.
    pub fn of(data: &Measurements, common: &[CommonError]) -> Result<Self, Stop> {
        check(data, common)?;
        let summaries = data.summaries();
        let measured: Vec<usize> =
            (0..summaries.len()).filter(|&i| summaries[i].count > 0).collect();
        if measured.is_empty() {
            return Err(Stop::new("the measurements hold no value"));
        }
        let kept = || measured.iter().map(|&i| &summaries[i]);
        Ok(Self {
            count: kept().map(|s| s.count as f64).collect(),
            mean: kept().map(|s| s.mean).collect(),
            scatter: kept().map(|s| s.scatter).collect(),
            measured,
        })
    }

    /// Returns the differences between the means and a response.
    pub fn residual(&self, response: &[f64]) -> Vec<f64> {
        self.measured.iter().zip(&self.mean).map(|(&i, mean)| mean - response[i]).collect()
    }

    /// Expands derivatives with respect to the measured outputs to all outputs, with zeros.
    pub fn over_all(&self, by_measured: &[f64], outputs: usize) -> Vec<f64> {
        let mut all = vec![0.0; outputs];
        for (&i, g) in self.measured.iter().zip(by_measured) {
            all[i] = *g;
        }
        all
    }

    /// Returns the factor of all common errors at the measured outputs, with as many columns as its rank, by a
    /// singular value decomposition weighted with the roots of the counts.
    pub fn common_factor(&self, common: &[CommonError]) -> Result<Matrix, Stop> {
        let weight: Vec<f64> = self.count.iter().map(|n| n.sqrt()).collect();
        let WeightedDirections { rows, values } =
            WeightedFactor::of(common, &self.measured, &weight).directions()?;
        Ok(Matrix::from_fn(self.measured.len(), values.len(), |i, k| {
            rows[(k, i)] * values[k] / weight[i]
        }))
    }
}

/// Fails if data or errors do not match the layout, or a value is not finite.
fn check(data: &Measurements, common: &[CommonError]) -> Result<(), Stop> {
    let outputs = data.layout.len();
    for replicate in &data.replicates {
        let (name, count) = (&replicate.name, replicate.values.len());
        if count != outputs {
            let text = format!("replicate `{name}` has {count} values and not {outputs}");
            return Err(Stop::new(text));
        }
        let bad = |value: &Option<f64>| value.is_some_and(|y| !y.is_finite());
        if let Some(i) = replicate.values.iter().position(bad) {
            let place = data.layout.describe(i);
            return Err(Stop::new(format!("replicate `{name}` is not finite at {place}")));
        }
    }
    for CommonError { origin, factor, .. } in common {
        let rows = factor.rows();
        if rows != outputs {
            let text = format!("the common error `{origin}` has {rows} outputs and not {outputs}");
            return Err(Stop::new(text));
        }
    }
    Ok(())
}

/// Returns the unit of a variance of values in a unit: K^2 for `degC`.
pub fn squared(unit: &Unit) -> Result<Unit, Stop> {
    let text = unit.difference().to_string();
    let squared = match text.as_str() {
        "1" => "1".to_owned(),
        t if t.chars().all(char::is_alphabetic) => format!("{t}^2"),
        t => format!("({t})^2"),
    };
    Unit::parse(&squared).map_err(|e| Stop::new(format!("the unit of the variance: {e}")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_variance_has_the_square_of_the_unit_of_differences() {
        for (unit, expected) in [("1", "1"), ("m", "m^2"), ("m/s", "(m/s)^2"), ("degC", "K^2")] {
            assert_eq!(squared(&Unit::parse(unit).unwrap()).unwrap().to_string(), expected);
        }
    }
}
