//! Values of the outputs over the runs.

use lacuna_linalg::Matrix;

/// Standard deviation over the runs, as a fraction of the largest response, below which an output counts as constant:
/// what is left are rounding errors (such as the strain of a sensor before the wave arrives).
const ROUND_OFF: f64 = 1e-13;

/// Values of one output over the runs.
#[derive(Clone)]
pub(super) struct Output {
    pub mean: f64,
    /// Values minus their mean, followed by the slopes if they are known ([`super::slopes::Slopes`]).
    pub centred: Vec<f64>,
    /// Variance with the number of runs as divisor; zero for outputs that do not vary.
    pub variance: f64,
}

/// Returns the columns of the responses (`runs x outputs`).
pub(super) fn outputs(responses: &Matrix) -> Vec<Output> {
    let (means, variances) = moments(responses);
    let columns = responses.transposed();
    let each = columns.iter_rows().zip(means).zip(variances);
    each.map(|((values, mean), variance)| {
        let centred = values.iter().map(|y| y - mean).collect();
        Output { mean, centred, variance }
    })
    .collect()
}

/// Returns mean and variance of each output over the runs (`runs x outputs`); the variance, with the number of runs as
/// divisor, is zero for outputs that do not vary.
pub(super) fn moments(responses: &Matrix) -> (Vec<f64>, Vec<f64>) {
    let largest = responses.as_slice().iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let runs = responses.rows() as f64;
    let mut means = vec![0.0; responses.columns()];
    for row in responses.iter_rows() {
        means.iter_mut().zip(row).for_each(|(sum, y)| *sum += y);
    }
    for mean in &mut means {
        *mean /= runs;
    }
    let mut variances = vec![0.0; responses.columns()];
    for row in responses.iter_rows() {
        let deviations = row.iter().zip(&means).map(|(y, mean)| y - mean);
        variances.iter_mut().zip(deviations).for_each(|(sum, d)| *sum += d * d);
    }
    for variance in &mut variances {
        *variance /= runs;
        if variance.sqrt() <= ROUND_OFF * largest {
            *variance = 0.0;
        }
    }
    (means, variances)
}
