//! Surrogates whose fit does not depend on the axes of the outputs.

use lacuna::matrix::{Matrix, multiply_vector};
use lacuna::plugin::surrogate::Surrogate;

use super::{Problem, RUNS};
use crate::judge::agree;

/// Number of outputs that every surrogate counts as many.
const MANY: usize = 60_000;

/// Compares the emulator of many outputs `Y = 1 m' + T Q'` with that of the scores `T` by the surrogate for rotated
/// outputs: with orthonormal `Q` it is `m + Q` times the latter.
pub(super) fn turns(surrogate: &dyn Surrogate, problem: &Problem) -> Result<(), String> {
    let Some(rotated) = surrogate.rotated(RUNS, MANY) else { return Ok(()) };
    let scores = &problem.responses;
    let axes = scores.columns();
    // Each output belongs to one axis; the columns have length one.
    let entry = (axes as f64 / MANY as f64).sqrt();
    let q = Matrix::from_fn(MANY, axes, |j, k| if j % axes == k { entry } else { 0.0 });
    let mean = |j: usize| (j % 7) as f64;
    let mut responses = outputs_of(scores, &q);
    for i in 0..RUNS {
        responses.row_mut(i).iter_mut().enumerate().for_each(|(j, y)| *y += mean(j));
    }
    let said = |stop| format!("many outputs are refused: {stop}");
    let plain = problem.fit_to(surrogate, &problem.points, &responses, None).map_err(said)?;
    let turned = problem.fit(&*rotated)?;
    if turned.variance(&problem.fresh).is_some() {
        return Err("the emulator of rotated outputs states a variance".to_owned());
    }
    let expected = outputs_of(&turned.mean(&problem.fresh), &q);
    let found = plain.mean(&problem.fresh);
    for j in [0, 1, 2, 17, MANY / 2, MANY - 1] {
        let less: Vec<f64> = found.column(j).iter().map(|y| (y - mean(j)) / entry).collect();
        let scores: Vec<f64> = expected.column(j).iter().map(|y| y / entry).collect();
        agree(&format!("output {j} in rotated axes, point"), &less, &scores, 1e-6)?;
    }
    Ok(())
}

/// Values of the outputs for scores, one point a row.
fn outputs_of(scores: &Matrix, q: &Matrix) -> Matrix {
    Matrix::from_rows(q.rows(), scores.iter_rows().map(|row| multiply_vector(q, row)))
}
