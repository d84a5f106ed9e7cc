//! The covariance of the emulator's error, and of other errors that all replicates share, from few samples of them.
//!
//! The second moment of `n` sampled curves has rank `n`. A further error lies outside their span in part, and a test
//! that treats that part as noise sees a gap where there is none. The covariance is therefore shrunk towards that of
//! independent errors of the same size, `n / (n + w) S + w / (n + w) diag(S)` (Ledoit and Wolf, Journal of Multivariate
//! Analysis 88 (2004) 365), in units of the noise of the replicates' mean. The weight `w` maximises the leave-one-out
//! log density of the samples under that noise.

use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed, symmetric_eigen, transposed_multiply};

use super::whitener::Whitener;
use crate::gap::experiment::{ErrorShares, Experiment};
use crate::gap::noise::Noise;

/// The weights `w` that are tried, relative to the number of samples.
const WEIGHTS: [f64; 10] = [0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];

/// The number of values on either side over which the variance of the errors is averaged along a curve.
const NEAR: usize = 4;

/// Principal directions with a variance below this share of the noise variance join the independent errors.
const MATTERS: f64 = 0.1;

/// Covariance of the model's errors, in the form that a calibration uses.
#[derive(Debug, Clone, Default)]
pub struct ErrorCovariance {
    /// The part in the span of the samples: factors `outputs x errors`, in the response's unit.
    pub common: Vec<CommonError>,
    /// The origins of the errors, one entry a column of the factors.
    pub origins: Vec<ErrorShares>,
    /// The part outside that span: see [`Experiment::independent`].
    pub independent: Vec<f64>,
}

/// The covariance of the model's errors from samples of them, around a response. The columns of each factor must be the
/// samples themselves divided by the square root of their number, `outputs x samples`, in the response's unit.
pub fn error_covariance(
    experiment: &Experiment<'_>,
    noise: &Noise,
    response: &[f64],
    samples: &[CommonError],
) -> ErrorCovariance {
    let alone = Experiment { common: Vec::new(), independent: Vec::new(), ..experiment.clone() };
    let whitener = Whitener::new(&alone, noise, response);
    let scale = whitener.scale();
    let independent = vec![0.0; experiment.outputs()];
    let mut all = ErrorCovariance { independent, ..ErrorCovariance::default() };
    for error in samples {
        let count = error.factor.columns();
        if count < 2 {
            all.common.push(error.clone());
            continue;
        }
        let root = (count as f64).sqrt();
        let rows = (0..count).map(|k| error.factor.column(k));
        let white = whitener.base_rows(&Matrix::from_rows(experiment.outputs(), rows));
        let white = Matrix::from_fn(count, white.columns(), |k, i| root * white[(k, i)]);
        let target = target(experiment, &white);
        let weight = weight(&white, &target);
        let kept = (1.0 - weight).sqrt();
        let factor =
            Matrix::from_fn(error.factor.rows(), count, |i, k| kept * error.factor[(i, k)]);
        all.common.push(CommonError { factor: factor.into(), ..error.clone() });
        for ((sum, t), s) in all.independent.iter_mut().zip(&target).zip(&scale) {
            if *s > 0.0 {
                *sum += weight * t / (s * s);
            }
        }
    }
    all.joined(experiment, noise, response)
}

impl ErrorCovariance {
    /// All errors as one factor, in the directions that matter compared with noise and independent errors; the variance of the
    /// other directions is added to the independent errors.
    fn joined(self, experiment: &Experiment<'_>, noise: &Noise, response: &[f64]) -> Self {
        let columns = self.common.iter().flat_map(|error| {
            (0..error.factor.columns()).map(|k| error.factor.column(k)).collect::<Vec<_>>()
        });
        let rows = Matrix::from_rows(experiment.outputs(), columns);
        if rows.rows() == 0 {
            return self;
        }
        let alone = Experiment {
            common: Vec::new(),
            independent: self.independent.clone(),
            ..experiment.clone()
        };
        let whitener = Whitener::new(&alone, noise, response);
        let white = whitener.base_rows(&rows);
        let Ok(eigen) = symmetric_eigen(&multiply_transposed(&white, &white)) else { return self };
        let kept: Vec<usize> =
            (0..eigen.values.len()).filter(|&k| eigen.values[k] > MATTERS).collect();
        let vectors = eigen.vectors.select_columns(&kept);
        let inside = transposed_multiply(&vectors, &white);
        let square = |rows: &Matrix, i: usize| rows.iter_rows().map(|r| r[i] * r[i]).sum::<f64>();
        let mut independent = self.independent;
        for (i, s) in whitener.scale().iter().enumerate().filter(|(_, s)| **s > 0.0) {
            independent[i] += (square(&white, i) - square(&inside, i)).max(0.0) / (s * s);
        }
        let names: Vec<&str> = self.common.iter().map(|error| error.origin.as_str()).collect();
        let (origin, factor) = (names.join(", "), transposed_multiply(&rows, &vectors));
        let origins = origins(&self.common, &vectors);
        Self {
            origins,
            common: vec![CommonError {
                origin: ErrorOrigin::from(origin),
                factor: factor.into(),
                predictive: true,
            }],
            independent,
        }
    }
}

/// The shares of the emulator and of the numerical error in errors that are these combinations, one a column, of the
/// columns of all factors.
fn origins(all: &[CommonError], vectors: &Matrix) -> Vec<ErrorShares> {
    let of = |wanted: &ErrorOrigin, k: usize| {
        let (mut row, mut share) = (0, 0.0);
        for error in all {
            let own = row..row + error.factor.columns();
            row = own.end;
            if error.origin == *wanted {
                share += own.map(|i| vectors[(i, k)].powi(2)).sum::<f64>();
            }
        }
        share
    };
    let shares = |k: usize| ErrorShares {
        emulator: of(&ErrorOrigin::Emulator, k),
        numerics: of(&ErrorOrigin::Numerics, k),
    };
    (0..vectors.columns()).map(shares).collect()
}

/// The mean square of the samples at each output, averaged over the neighbouring values of its curve.
fn target(experiment: &Experiment<'_>, white: &Matrix) -> Vec<f64> {
    let count = white.rows() as f64;
    let square = |i: usize| white.iter_rows().map(|row| row[i] * row[i]).sum::<f64>() / count;
    let mut target = vec![0.0; white.columns()];
    for curve in &experiment.curves {
        let squares: Vec<f64> = curve.measured.iter().map(|&i| square(i)).collect();
        for (k, &i) in curve.measured.iter().enumerate() {
            let (from, to) = (k.saturating_sub(NEAR), (k + NEAR + 1).min(squares.len()));
            target[i] = squares[from..to].iter().sum::<f64>() / (to - from) as f64;
        }
    }
    target
}

/// The share of the target at which the samples have the largest probability given the others.
fn weight(white: &Matrix, target: &[f64]) -> f64 {
    let count = white.rows() as f64;
    let shares = WEIGHTS.map(|w| w / (1.0 + w));
    let mut best = (f64::NEG_INFINITY, 0.0);
    for share in shares {
        let score = score(white, target, share).unwrap_or(f64::NEG_INFINITY);
        if score > best.0 {
            best = (score, share);
        }
    }
    // All samples together are one more than a sample was judged by.
    let others = best.1 / (1.0 - best.1) * (count - 1.0);
    others / (count + others)
}

/// The expected log density of each sample with noise of variance one, under the covariance
/// `D + (1 - share) E'E / (n - 1)` of the others, `D = 1 + share * target`; summed, and without constants.
///
/// Leaving a row out of `K = D + c E'E` needs only `M = (1 + c E D^-1 E')^-1`: with `q = (1 - M_ii) / c`, the quadratic
/// form is `q / (1 - c q)` (Sherman and Morrison).
fn score(white: &Matrix, target: &[f64], share: f64) -> Option<f64> {
    let count = white.rows();
    let c = (1.0 - share) / (count as f64 - 1.0);
    let own: Vec<f64> = target.iter().map(|t| 1.0 + share * t).collect();
    let over = |power: f64| {
        let factors: Vec<f64> = own.iter().map(|d| d.powf(-0.5 * power)).collect();
        let mut scaled = white.clone();
        for k in 0..count {
            scaled.row_mut(k).iter_mut().zip(&factors).for_each(|(x, factor)| *x *= factor);
        }
        multiply_transposed(&scaled, &scaled)
    };
    let (first, second) = (over(1.0), over(2.0));
    let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
    let inner = Matrix::from_fn(count, count, |i, j| unit(i, j) + c * first[(i, j)]);
    let factor = Cholesky::new(&inner).ok()?;
    let inverse = factor.inverse();
    let log_determinant = own.iter().map(|d| d.ln()).sum::<f64>() + factor.log_determinant();
    let crossed = multiply_transposed(&inverse, &second);
    let trace = own.iter().map(|d| 1.0 / d).sum::<f64>()
        - c * (0..count).map(|i| crossed[(i, i)]).sum::<f64>();
    let mut sum = 0.0;
    for i in 0..count {
        let q = (1.0 - inverse[(i, i)]) / c;
        let left = 1.0 - c * q;
        let length = dot(crossed.row(i), inverse.row(i));
        let without = trace + c * length / left;
        sum -= 0.5 * (log_determinant + left.ln() + q / left + without);
    }
    sum.is_finite().then_some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};
    use lacuna_linalg::multiply;

    fn samples(count: usize, outputs: usize, directions: usize, white: f64) -> Matrix {
        let mut rng = Stream::root(5).generator();
        let shapes = Matrix::from_fn(directions, outputs, |_, _| normal(&mut rng));
        let sizes = Matrix::from_fn(count, directions, |_, _| normal(&mut rng));
        let mut all = multiply(&sizes, &shapes);
        all.as_mut_slice().iter_mut().for_each(|x| *x += white * normal(&mut rng));
        all
    }

    /// The definition, with the covariance of the others computed and solved explicitly.
    #[test]
    fn the_score_is_that_of_leaving_each_sample_out() {
        let (count, outputs, share) = (6, 15, 0.3);
        let white = samples(count, outputs, 2, 0.5);
        let target: Vec<f64> = (0..outputs).map(|i| 0.5 + 0.1 * i as f64).collect();
        let mut expected = 0.0;
        for left in 0..count {
            let others: Vec<usize> = (0..count).filter(|k| *k != left).collect();
            let covariance = Matrix::from_fn(outputs, outputs, |i, j| {
                let s: f64 = others.iter().map(|&k| white[(k, i)] * white[(k, j)]).sum();
                let own = if i == j { 1.0 + share * target[i] } else { 0.0 };
                own + (1.0 - share) * s / (count as f64 - 1.0)
            });
            let factor = Cholesky::new(&covariance).unwrap();
            let trace: f64 = (0..outputs).map(|i| factor.inverse()[(i, i)]).sum();
            let quadratic = factor.quadratic(white.row(left));
            expected -= 0.5 * (factor.log_determinant() + quadratic + trace);
        }
        let found = score(&white, &target, share).unwrap();
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} {expected}");
    }

    /// Errors along one direction need no shrinkage; independent errors are all target.
    #[test]
    fn the_weight_follows_how_errors_go_together() {
        let mean_square = |white: &Matrix| -> Vec<f64> {
            let count = white.rows() as f64;
            let square = |i: usize| white.column(i).iter().map(|x| x * x).sum::<f64>() / count;
            (0..white.columns()).map(square).collect()
        };
        let (together, apart) = (samples(20, 100, 1, 0.0), samples(20, 100, 1, 5.0));
        assert!(weight(&together, &mean_square(&together)) < 0.01);
        assert!(weight(&apart, &mean_square(&apart)) > 0.6);
    }
}
