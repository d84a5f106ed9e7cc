//! Errors of an emulator as numbers, at runs that were left out and at validation runs.

use lacuna::plugin::Emulator;
use lacuna_linalg::Matrix;

use crate::study::Study;

/// Number of runs whose residuals are in memory at a time.
const TOGETHER: usize = 16;

/// Ratio of the root mean square error at validation runs to the root mean square of the stated standard deviations.
pub fn inflation(emulator: &dyn Emulator, points: &Matrix, errors: &Matrix) -> Option<f64> {
    let variance = emulator.variance(points).filter(|_| points.rows() >= 10)?;
    let squares: f64 = errors.as_slice().iter().map(|e| e * e).sum();
    let ratio = (squares / variance.as_slice().iter().sum::<f64>()).sqrt();
    ratio.is_finite().then_some(ratio)
}

/// Leave-one-out residuals of some training runs, scaled so that their mean square over all runs is the (corrected)
/// leave-one-out error.
pub fn corrected(emulator: &dyn Emulator, responses: &Matrix, runs: &[usize]) -> Matrix {
    let relative = emulator.relative_error();
    let centres = column_means(responses, |_, y| y);
    let variances = column_means(responses, |j, y| (y - centres[j]).powi(2));
    let outputs: Vec<usize> = (0..responses.columns()).collect();
    let rows: Vec<usize> = (0..responses.rows()).collect();
    let mut squares = vec![0.0; outputs.len()];
    for some in rows.chunks(TOGETHER) {
        for row in emulator.left_out(some, &outputs).iter_rows() {
            squares.iter_mut().zip(row).for_each(|(sum, r)| *sum += r * r);
        }
    }
    let scale: Vec<f64> = (0..outputs.len())
        .map(|j| {
            let square = squares[j] / rows.len() as f64;
            let expected = relative[j] * variances[j];
            // Residuals are only enlarged: a correction for the selection of terms cannot make the error smaller.
            if square > 0.0 && expected > square { (expected / square).sqrt() } else { 1.0 }
        })
        .collect();
    let mut residuals = emulator.left_out(runs, &outputs);
    for i in 0..runs.len() {
        residuals.row_mut(i).iter_mut().zip(&scale).for_each(|(r, scale)| *r *= scale);
    }
    residuals
}

/// Name, mean absolute error, root mean square error and relative leave-one-out error of each group of outputs.
pub fn by_group(study: &Study, errors: &Matrix, loo: &[f64]) -> Vec<(String, f64, f64, f64)> {
    let groups = study.layouts.groups();
    let figures = |group: &lacuna::data::layout::Group| {
        let all = || errors.iter_rows().flat_map(|row| group.indices.iter().map(|&i| row[i]));
        let loo = mean(group.indices.iter().map(|&i| loo[i]));
        (mean(all().map(f64::abs)), mean(all().map(|e| e * e)).sqrt(), loo)
    };
    groups
        .iter()
        .map(|group| {
            let (mae, rmse, loo) = figures(group);
            (group.name.clone(), mae, rmse, loo)
        })
        .collect()
}

/// At most about 3000 pairs of simulated and emulated values, evenly thinned.
pub fn pairs(simulated: &Matrix, emulated: &Matrix) -> Vec<(f64, f64)> {
    let step = (simulated.as_slice().len() / 3000).max(1);
    let all = simulated.as_slice().iter().zip(emulated.as_slice());
    all.step_by(step).map(|(a, b)| (*a, *b)).collect()
}

/// `a` less `b`.
pub fn difference(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), a.columns(), |i, j| a[(i, j)] - b[(i, j)])
}

/// The rows of `a`, then those of `b`.
pub fn stacked(mut a: Matrix, b: &Matrix) -> Matrix {
    b.iter_rows().for_each(|row| a.push_row(row));
    a
}

/// Mean over the rows of `of` each column and entry.
fn column_means(matrix: &Matrix, of: impl Fn(usize, f64) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; matrix.columns()];
    for row in matrix.iter_rows() {
        sums.iter_mut().zip(row).enumerate().for_each(|(j, (sum, y))| *sum += of(j, *y));
    }
    let rows = matrix.rows() as f64;
    sums.into_iter().map(|sum| if rows > 0.0 { sum / rows } else { 0.0 }).collect()
}

/// Mean of some values; zero of none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}
