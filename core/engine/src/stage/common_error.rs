//! Errors that are common to all replicates.

use lacuna::data::Measurements;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::Matrix;

/// An error of emulator or numerics, in two sizes.
#[derive(Debug, Clone)]
pub struct Allowance {
    /// For estimates: enlarged until held-out errors shift the estimates by as much as the posterior states.
    pub estimates: CommonError,
    /// For predictions of data: the size of the held-out errors themselves.
    pub predictions: CommonError,
}

impl Allowance {
    /// Both sizes of an error that is common to all data; the factors are `outputs x rank`.
    pub fn new(origin: ErrorOrigin, [estimates, predictions]: [Matrix; 2]) -> Self {
        let error = |factor| CommonError { origin: origin.clone(), factor, predictive: true };
        Self { estimates: error(estimates), predictions: error(predictions) }
    }
}

/// Error of the mean curve of the replicates, estimated from the replicates; `None` with fewer than three replicates.
///
/// Values of one replicate share its gain and its timing, so the mean over R replicates is less accurate than that of
/// independent values. The sample covariance of the mean curve is `sum_r d_r d_r' / (R (R - 1))` with the deviations
/// `d_r` of the replicates from their mean; a value with fewer replicates uses its own number for R. Its white-noise
/// part is counted twice in at most R - 1 directions, which costs almost no information.
pub fn of_replicates(data: &Measurements) -> Option<CommonError> {
    let summaries = data.summaries();
    let used: Vec<_> =
        data.replicates.iter().filter(|r| r.values.iter().any(Option::is_some)).collect();
    if used.len() < 3 {
        return None;
    }
    let factor = Matrix::from_fn(data.layout.len(), used.len(), |i, r| {
        let (count, mean) = (summaries[i].count as f64, summaries[i].mean);
        match used[r].values[i] {
            // A missing value contributes nothing; the divisor uses the number of replicates of this output.
            Some(y) if summaries[i].count >= 2 => (y - mean) / (count * (count - 1.0)).sqrt(),
            _ => 0.0,
        }
    });
    Some(CommonError { origin: ErrorOrigin::Replicates, factor, predictive: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Layout, Replicate, Unit};
    use lacuna::math::random::{Stream, normal};

    /// Curves that differ by a gain of standard deviation 0.1 about a mean curve: the covariance of the mean of R
    /// curves is that of the gain divided by R along the mean curve. The mean square with R - 1 degrees of freedom has
    /// the relative standard deviation sqrt(2 / (R - 1)).
    #[test]
    fn a_common_gain_is_found_along_the_mean_curve() {
        let grid: Vec<f64> = (1..=30).map(f64::from).collect();
        let curve: Vec<f64> = grid.iter().map(|t| (0.2 * t).sin()).collect();
        let count = 200;
        let replicate = |r: usize| {
            let gain = 1.0 + 0.1 * normal(&mut Stream::root(3).at(r as u64).generator());
            let values = curve.iter().map(|y| Some(gain * y)).collect();
            Replicate::new(r.to_string(), values)
        };
        let unit = Unit::dimensionless();
        let axes = vec![Axis::grid("time", grid.clone(), unit.clone())];
        let layout = Layout { name: "y".into(), unit, axes };
        let data = Measurements::new(layout, (0..count).map(replicate).collect());
        let factor = of_replicates(&data).unwrap().factor;
        let norm: f64 = curve.iter().map(|y| y * y).sum();
        let along: f64 = (0..count)
            .map(|r| {
                let product: f64 = curve.iter().enumerate().map(|(i, y)| y * factor[(i, r)]).sum();
                (product / norm).powi(2)
            })
            .sum();
        let expected = 0.01 / count as f64;
        let bound = 4.0 * expected * (2.0 / (count as f64 - 1.0)).sqrt();
        assert!((along - expected).abs() < bound, "{along} {expected}");
    }
}
