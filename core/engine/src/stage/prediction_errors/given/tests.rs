//! Weights given the data against the formulas for normal vectors, written out with dense matrices.

use lacuna::data::Measurements;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Likelihood;
use lacuna::plugin::discrepancy::{Hyperparameter, VariancePart};
use lacuna_linalg::{Cholesky, Matrix, multiply, multiply_transposed, transposed_multiply};

use super::GivenData;

/// Data whose blocks are normal about the response, with the covariance of their noise and their own common error.
struct Normal {
    data: Vec<f64>,
    /// First output, end, and covariance of each block.
    blocks: Vec<(usize, usize, Matrix)>,
}

impl Likelihood for Normal {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &[]
    }

    fn log_likelihood(&self, response: &[f64], _: &[f64]) -> f64 {
        let residual: Vec<f64> = self.data.iter().zip(response).map(|(y, r)| y - r).collect();
        let (pull, _) = self.gradient(response, &[]);
        -0.5 * residual.iter().zip(pull).map(|(z, g)| z * g).sum::<f64>()
    }

    fn gradient(&self, response: &[f64], _: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut all = Vec::new();
        for (first, end, covariance) in &self.blocks {
            let mut residual: Vec<f64> =
                (*first..*end).map(|i| self.data[i] - response[i]).collect();
            Cholesky::new(covariance).unwrap().solve(&mut residual);
            all.extend(residual);
        }
        (all, Vec::new())
    }

    fn predictive(&self, _: &[f64], _: &[f64]) -> Vec<VariancePart> {
        Vec::new()
    }

    fn simulate(&self, _: &[f64], _: &[f64], _: &Stream) -> Vec<Measurements> {
        Vec::new()
    }
}

fn random(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(rows, columns, |_, _| normal(&mut rng))
}

/// `F F' + 0.25 I` over some outputs.
fn covariance(factor: &Matrix, first: usize, end: usize) -> Matrix {
    let own = factor.select_rows(&(first..end).collect::<Vec<_>>());
    let mut sum = multiply_transposed(&own, &own);
    (0..end - first).for_each(|i| sum[(i, i)] += 0.25);
    sum
}

/// Mean and covariance of many draws of the weights.
fn moments(given: &GivenData, gradient: &[f64], weights: usize) -> (Vec<f64>, Matrix) {
    const COUNT: u64 = 40_000;
    let draws: Vec<Vec<f64>> =
        (0..COUNT).map(|k| given.draw(gradient, &Stream::root(7).at(k))).collect();
    let mean: Vec<f64> =
        (0..weights).map(|j| draws.iter().map(|w| w[j]).sum::<f64>() / COUNT as f64).collect();
    let covariance = Matrix::from_fn(weights, weights, |i, j| {
        draws.iter().map(|w| (w[i] - mean[i]) * (w[j] - mean[j])).sum::<f64>() / COUNT as f64
    });
    (mean, covariance)
}

/// The weights given data with noise of variance 0.25 have the covariance `(I + F'F / 0.25)^-1` and that matrix times
/// `F'(y - r) / 0.25` as their mean, however the outputs are divided into blocks; rows of the factor beyond the data, as of
/// conditions that were not measured, do not matter.
#[test]
fn the_moments_are_those_of_normal_vectors() {
    let (outputs, weights) = (12, 3);
    let factor = random(outputs, weights, 1);
    let data = random(1, outputs, 2).into_vec();
    let response = random(1, outputs, 3).into_vec();
    let mut precision = transposed_multiply(&factor, &factor);
    precision.as_mut_slice().iter_mut().for_each(|p| *p /= 0.25);
    (0..weights).for_each(|j| precision[(j, j)] += 1.0);
    let solver = Cholesky::new(&precision).unwrap();
    let mut expected: Vec<f64> = (0..weights)
        .map(|j| (0..outputs).map(|i| factor[(i, j)] * (data[i] - response[i]) / 0.25).sum())
        .collect();
    solver.solve(&mut expected);
    let unit = |j: usize| {
        let mut column = vec![0.0; weights];
        column[j] = 1.0;
        solver.solve(&mut column);
        column
    };
    let inverse: Vec<Vec<f64>> = (0..weights).map(unit).collect();
    for cuts in [vec![0, 12], vec![0, 5, 12], vec![0, 3, 4, 12]] {
        let ranges: Vec<_> = cuts.windows(2).map(|cut| cut[0]..cut[1]).collect();
        let block = |range: &std::ops::Range<usize>| {
            (range.start, range.end, covariance(&factor, range.start, range.end))
        };
        let likelihood = Normal { data: data.clone(), blocks: ranges.iter().map(block).collect() };
        let gradient = likelihood.gradient(&response, &[]).0;
        let given =
            GivenData::new(factor.clone(), ranges.into_iter(), &likelihood, (&response, &[]))
                .unwrap();
        let (mean, covariance) = moments(&given, &gradient, weights);
        for i in 0..weights {
            // Four standard errors of a mean and of a covariance over 40 000 independent draws.
            let sd = inverse[i][i].sqrt();
            assert!((mean[i] - expected[i]).abs() < 4.0 * sd / 200.0, "{mean:?} {expected:?}");
            for j in 0..weights {
                let product = inverse[i][i] * inverse[j][j] + inverse[i][j].powi(2);
                let bound = 4.0 * product.sqrt() / 200.0;
                assert!((covariance[(i, j)] - inverse[i][j]).abs() < bound, "{i} {j}");
            }
        }
        let curve = given.values(&expected, 0..weights);
        let direct = multiply(&factor, &Matrix::from_vec(weights, 1, expected.clone()));
        for (a, b) in curve.iter().zip(direct.as_slice()) {
            assert!((a - b).abs() < 1e-12 * b.abs().max(1.0), "{a} {b}");
        }
    }
}

/// A gradient that is not finite, at a draw where the density cannot be computed, leaves the errors at their prior.
#[test]
fn without_a_gradient_the_weights_are_those_of_the_prior() {
    let factor = random(4, 2, 5);
    let likelihood = Normal { data: vec![0.0; 4], blocks: vec![(0, 4, covariance(&factor, 0, 4))] };
    let given =
        GivenData::new(factor, std::iter::once(0..4), &likelihood, (&[0.0; 4], &[])).unwrap();
    let (_, covariance) = moments(&given, &[f64::NAN; 4], 2);
    // The variance of a variance over 40 000 draws is 2 / 40 000.
    assert!((covariance[(0, 0)] - 1.0).abs() < 4.0 * (2.0_f64 / 40_000.0).sqrt());
}
