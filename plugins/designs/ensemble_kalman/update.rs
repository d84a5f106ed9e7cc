//! One step of an ensemble: how much of the likelihood it takes, and where the runs move.

use lacuna::math::moments;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::design::Batch;
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_transposed, multiply_vector, symmetric_eigen,
    transposed_multiply, transposed_multiply_vector,
};

use super::Update;

/// Largest size of a score: the law beyond it has a probability of 2e-9, and a model may have no answer there.
const LARGEST: f64 = 6.0;

/// Share of the likelihood of the next step, at most what is left of it: with the misfits `phi = |residuals|^2 / 2` of
/// the runs and `m` data, `max(m / (2 mean phi), sqrt(m / (2 var phi)))` (Iglesias and Yang 2021, section 3).
///
/// With `steps` left the time grows at least by the factor that reaches 1 with equal factors.
pub fn step(residuals: &Matrix, time: f64, steps: usize) -> f64 {
    let misfits: Vec<f64> = residuals.iter_rows().map(|row| 0.5 * dot(row, row)).collect();
    let data = residuals.columns() as f64;
    let by_mean = data / (2.0 * moments::mean(&misfits));
    let by_variance = (data / (2.0 * moments::variance(&misfits))).sqrt();
    let left = 1.0 - time;
    let least = match steps {
        0 | 1 => left,
        _ if time > 0.0 => time * (time.powf(-1.0 / steps as f64) - 1.0),
        _ => 0.0,
    };
    // Runs without any misfit give no finite number: nothing limits the step.
    let sizes = [by_mean, by_variance].into_iter().filter(|h| h.is_finite());
    sizes.reduce(f64::max).map_or(left, |h| h.max(least).min(left))
}

/// Scores of the next batch after a step `h`, of as many runs as the last one placed.
///
/// With the deviations `Z` of the scores and `R` of the residuals from their means, one run per row and divided by
/// `sqrt(runs - 1)`, the gain `Z' R (R' R + I / h)^-1` is `Z' (R R' + I / h)^-1 R`.
pub fn moved(last: &Batch, h: f64, update: Update, stream: &Stream) -> Result<Matrix, Stop> {
    let runs = last.scores.rows();
    let (centre, scores) = deviations(&last.scores);
    let (misfit, residuals) = deviations(&last.residuals);
    let square = multiply_transposed(&residuals, &residuals);
    let (mean, spread) = match update {
        Update::Transform => transformed(&centre, &scores, &misfit, &residuals, &square, h)?,
        Update::PerturbedData => {
            let all = perturbed(last, &scores, &residuals, &square, h, stream)?;
            deviations(&all)
        }
    };
    let scale = ((runs - 1) as f64).sqrt();
    let mut rng = stream.named("replacement").generator();
    let mut next = Matrix::zeros(0, centre.len());
    for i in 0..last.placed {
        // The ensemble's own members, then draws from its normal distribution for the runs that failed.
        let weights: Vec<f64> = if i < runs {
            (0..runs).map(|k| if k == i { scale } else { 0.0 }).collect()
        } else {
            (0..runs).map(|_| normal(&mut rng)).collect()
        };
        let deviation = transposed_multiply_vector(&spread, &weights);
        let point = mean.iter().zip(deviation).map(|(m, d)| (m + d).clamp(-LARGEST, LARGEST));
        next.push_row(&point.collect::<Vec<f64>>());
    }
    Ok(next)
}

/// Mean of the rows, and deviations from it divided by `sqrt(rows - 1)`.
fn deviations(all: &Matrix) -> (Vec<f64>, Matrix) {
    let mean: Vec<f64> = (0..all.columns()).map(|j| moments::mean(&all.column(j))).collect();
    let scale = ((all.rows() - 1) as f64).sqrt();
    let spread = Matrix::from_fn(all.rows(), all.columns(), |i, j| (all[(i, j)] - mean[j]) / scale);
    (mean, spread)
}

/// Mean and deviations after a square root update: the deviations become `(I + h R R')^-1/2 Z`.
fn transformed(
    centre: &[f64],
    scores: &Matrix,
    misfit: &[f64],
    residuals: &Matrix,
    square: &Matrix,
    h: f64,
) -> Result<(Vec<f64>, Matrix), Stop> {
    let eigen = symmetric_eigen(square).map_err(failed)?;
    let filtered = |power: f64| {
        let scaled = Matrix::from_fn(square.rows(), square.rows(), |i, k| {
            eigen.vectors[(i, k)] * (1.0 + h * eigen.values[k].max(0.0)).powf(power)
        });
        multiply_transposed(&scaled, &eigen.vectors)
    };
    let pull = multiply_vector(residuals, misfit);
    let weights = multiply_vector(&filtered(-1.0), &pull);
    let shift = transposed_multiply_vector(scores, &weights);
    let mean = centre.iter().zip(shift).map(|(m, s)| m - h * s).collect();
    Ok((mean, multiply(&filtered(-0.5), scores)))
}

/// All runs after an update by data with noise of their own, whose variance is `1 / h` in units of the data's.
fn perturbed(
    last: &Batch,
    scores: &Matrix,
    residuals: &Matrix,
    square: &Matrix,
    h: f64,
    stream: &Stream,
) -> Result<Matrix, Stop> {
    let runs = last.scores.rows();
    let mut inner = square.clone();
    (0..runs).for_each(|i| inner[(i, i)] += 1.0 / h);
    let inner = Cholesky::new(&inner).map_err(failed)?;
    let mut rng = stream.named("data").generator();
    let noisy = Matrix::from_fn(runs, residuals.columns(), |j, i| {
        -(last.residuals[(j, i)] + normal(&mut rng) / h.sqrt())
    });
    let weights = inner.solve_matrix(&multiply_transposed(residuals, &noisy));
    let shifts = transposed_multiply(&weights, scores);
    Ok(Matrix::from_fn(runs, scores.columns(), |i, j| last.scores[(i, j)] + shifts[(i, j)]))
}

fn failed(error: lacuna_linalg::Error) -> Stop {
    Stop::new(format!("the ensemble cannot be updated: {error}"))
        .help("a response may have grown beyond all measure; narrow the `design`")
}
