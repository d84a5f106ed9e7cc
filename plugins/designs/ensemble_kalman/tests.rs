use lacuna::math::moments::Moments;
use lacuna::math::random::{Stream, normal};
use lacuna::math::special::normal_quantile;
use lacuna::plugin::Design;
use lacuna::plugin::design::{Batch, Next};
use lacuna_linalg::{Cholesky, Matrix, multiply, multiply_transposed, transposed_multiply};

use super::{EnsembleKalman, Update};

/// Residuals of a model at scores: one row per run.
type Model<'a> = &'a dyn Fn(&[f64]) -> Vec<f64>;

fn batch(scores: Matrix, model: Model<'_>) -> Batch {
    let residuals: Vec<Vec<f64>> = scores.iter_rows().map(model).collect();
    let columns = residuals[0].len();
    Batch { placed: scores.rows(), residuals: Matrix::from_rows(columns, residuals), scores }
}

/// All batches of an ensemble of `runs`.
fn batches(design: &EnsembleKalman, runs: usize, d: usize, model: Model<'_>) -> Vec<Batch> {
    let stream = Stream::root(7).named("design");
    let cube = design.points(runs, d, &stream).unwrap();
    let scores = Matrix::from_fn(runs, d, |i, j| normal_quantile(cube[(i, j)]));
    let mut all = vec![batch(scores, model)];
    while let Next::Place(scores) = design.next(&all, &stream).unwrap() {
        all.push(batch(scores, model));
    }
    all
}

/// A linear model `A z` of three parameters with data `y` in units of their noise.
fn linear() -> (Matrix, Vec<f64>) {
    let a = Matrix::from_rows(
        3,
        [[2.0, 1.0, 0.0], [0.0, 1.5, -1.0], [1.0, 0.0, 3.0], [4.0, -2.0, 1.0]],
    );
    (a, vec![3.0, -1.0, 4.0, 6.0])
}

fn residual(a: &Matrix, y: &[f64], z: &[f64]) -> Vec<f64> {
    lacuna_linalg::multiply_vector(a, z).iter().zip(y).map(|(g, y)| g - y).collect()
}

/// Mean and covariance of a linear model's posterior in the form of Kalman's gain (Kalman, Journal of Basic Engineering
/// 82 (1960) 35), for a normal prior and noise of variance one.
fn kalman(a: &Matrix, y: &[f64], mean: &[f64], covariance: &Matrix) -> (Vec<f64>, Matrix) {
    let across = multiply(a, covariance);
    let mut inner = multiply_transposed(&across, a);
    (0..inner.rows()).for_each(|i| inner[(i, i)] += 1.0);
    let solved = Cholesky::new(&inner).unwrap().solve_matrix(&across);
    let pull = Matrix::from_vec(y.len(), 1, residual(a, y, mean).iter().map(|r| -r).collect());
    let shift = transposed_multiply(&solved, &pull);
    let less = transposed_multiply(&across, &solved);
    let d = mean.len();
    let posterior = Matrix::from_fn(d, d, |i, j| covariance[(i, j)] - less[(i, j)]);
    ((0..d).map(|i| mean[i] + shift[(i, 0)]).collect(), posterior)
}

/// The square root update has the posterior of the first batch's own mean and covariance, to round-off, however many
/// steps the likelihood is divided into.
#[test]
fn a_linear_model_ends_at_the_kalman_posterior() {
    let (a, y) = linear();
    let design = EnsembleKalman::default();
    let all = batches(&design, 40, 3, &|z| residual(&a, &y, z));
    assert!(all.len() > 2, "{} batches", all.len());
    let [first, last] = [&all[0], &all[all.len() - 1]].map(|b| Moments::of_rows(&b.scores));
    let (mean, covariance) = kalman(&a, &y, first.mean(), &first.covariance());
    let found = last.covariance();
    for i in 0..3 {
        assert!((last.mean()[i] - mean[i]).abs() < 1e-9, "{:?} {mean:?}", last.mean());
        for j in 0..3 {
            assert!((found[(i, j)] - covariance[(i, j)]).abs() < 1e-9);
        }
    }
}

/// Perturbed data give the posterior of the standard normal prior up to the error of a sample. Each step adds an error
/// of its own, so that the variance of the errors is at most that of one sample times the number of batches; a mean is
/// allowed 4 such standard errors, a variance 4 times `sqrt(2 / runs)` of itself.
#[test]
fn perturbed_data_end_at_the_kalman_posterior_up_to_the_ensemble_error() {
    const RUNS: usize = 2000;
    let (a, y) = linear();
    let design = EnsembleKalman { update: Update::PerturbedData, ..EnsembleKalman::default() };
    let all = batches(&design, RUNS, 3, &|z| residual(&a, &y, z));
    let unit = Matrix::from_fn(3, 3, |i, j| f64::from(u8::from(i == j)));
    let (mean, covariance) = kalman(&a, &y, &[0.0; 3], &unit);
    let last = Moments::of_rows(&all[all.len() - 1].scores);
    let error = (all.len() as f64 / RUNS as f64).sqrt();
    for i in 0..3 {
        let variance = covariance[(i, i)];
        let off = (last.mean()[i] - mean[i]).abs() / variance.sqrt();
        assert!(off < 4.0 * error, "mean {i}: {off}");
        let ratio = (last.covariance()[(i, i)] / variance - 1.0).abs();
        assert!(ratio < 4.0 * 2.0_f64.sqrt() * error, "variance {i}: {ratio}");
    }
}

/// Iglesias and Yang 2021: the parts of the likelihood add up to one, and a model that fits from the start takes one step.
#[test]
fn the_steps_end_with_the_whole_likelihood() {
    let design = EnsembleKalman::default();
    let all = batches(&design, 20, 2, &|z| vec![1e-3 * z[0], 1e-3 * z[1]]);
    assert_eq!(all.len(), 2);
    let mut time = 0.0;
    let far = batches(&design, 20, 2, &|z| vec![30.0 * z[0] - 60.0, 20.0 * z[1] + z[0]]);
    for (k, batch) in far[..far.len() - 1].iter().enumerate() {
        let step = super::step(&batch.residuals, time, 6 - k);
        assert!(step > 0.0);
        time += step;
    }
    assert!((time - 1.0).abs() < 1e-12 && far.len() > 3, "{time}, {} batches", far.len());
    // The number of batches is limited, and the whole likelihood is reached nevertheless.
    let design = EnsembleKalman { iterations: 2, ..EnsembleKalman::default() };
    let few = batches(&design, 20, 2, &|z| vec![30.0 * z[0] - 60.0, 20.0 * z[1] + z[0]]);
    let all: f64 = super::step(&few[0].residuals, 0.0, 2);
    assert_eq!(few.len(), 3);
    assert_eq!(all + super::step(&few[1].residuals, all, 1), 1.0);
}

/// Huang, Huang, Reich and Stuart, Inverse Problems 38 (2022) 125006, section 5.2: the linear problems with two
/// parameters have the posteriors of their closed forms; here the one with more data than parameters.
#[test]
fn runs_that_fail_are_replaced_by_draws_of_the_others() {
    let a = Matrix::from_rows(2, [[10.0, 20.0], [30.0, 40.0], [50.0, 60.0]]);
    let y = [30.0, 70.0, 100.0];
    let design = EnsembleKalman::default();
    let stream = Stream::root(3);
    let mut rng = stream.named("scores").generator();
    let scores = Matrix::from_fn(300, 2, |_, _| normal(&mut rng));
    let mut all = vec![batch(scores, &|z| residual(&a, &y, z))];
    all[0].placed = 600;
    while let Next::Place(scores) = design.next(&all, &stream).unwrap() {
        assert_eq!(scores.rows(), 600);
        // Half of the runs of every batch fail.
        let kept = scores.select_rows(&(0..600).step_by(2).collect::<Vec<_>>());
        all.push(Batch { placed: 600, ..batch(kept, &|z| residual(&a, &y, z)) });
    }
    let unit = Matrix::from_fn(2, 2, |i, j| f64::from(u8::from(i == j)));
    let (mean, covariance) = kalman(&a, &y, &[0.0; 2], &unit);
    let last = Moments::of_rows(&all[all.len() - 1].scores);
    // Every batch loses half of its runs, so that it is a sample of the batch before it.
    let error = (all.len() as f64 / 300.0).sqrt();
    for i in 0..2 {
        let off = (last.mean()[i] - mean[i]).abs() / covariance[(i, i)].sqrt();
        assert!(off < 4.0 * error, "mean {i}: {off}");
    }
    let few = Batch { placed: 20, ..batch(Matrix::zeros(2, 2), &|z| residual(&a, &y, z)) };
    let stop = design.next(&[few], &stream).unwrap_err().to_string();
    assert!(stop.contains("2 of 20 runs"), "{stop}");
}
