//! What errors of the mesh do to the best fit.

use lacuna::linalg::Matrix;
use lacuna::linalg::{Cholesky, multiply, multiply_transposed, transposed_multiply};
use lacuna::math::distribution::Distribution;
use lacuna::math::moments;
use lacuna::stage::Learned;
use lacuna::stage::numerical_error::NumericalError;
use lacuna::study::file::NumericalErrorSection;

/// Mean squares of shift over allowance by parameter; shares of intervals that hold the truth; mean widths.
pub fn of(
    learned: &Learned,
    truths: &Matrix,
    numerics: &NumericalError,
    section: &NumericalErrorSection,
    emulator: &Matrix,
    variance: f64,
) -> String {
    let whole = numerics.error_samples(section).factor;
    let (runs, outputs) = (truths.rows(), truths.columns());
    let d = numerics.points.columns();
    let (mut squares, mut widths) = (vec![Vec::new(); d], vec![Vec::new(); d]);
    let mut held = [0.0; 3];
    for k in 0..runs {
        let kept: Vec<usize> = (0..whole.columns()).filter(|c| c % runs != k).collect();
        let mut factor = whole.select_columns(&kept);
        let scale = (runs as f64 / (runs as f64 - 1.0)).sqrt();
        factor.as_mut_slice().iter_mut().for_each(|f| *f *= scale);
        let point = numerics.points.row(k);
        let jacobian = learned.emulator.jacobian(point);
        let error: Vec<f64> = (0..outputs)
            .map(|j| {
                let scale = section.whole();
                let foretold = numerics.prediction.as_ref().map_or(0.0, |prediction| {
                    numerics.differences[(k, j)] - prediction.residuals[(k, j)]
                });
                truths[(k, j)] - scale * foretold
            })
            .collect();
        let known = multiply_transposed(emulator, emulator);
        let noise = Matrix::from_fn(outputs, outputs, |i, j| {
            known[(i, j)] + if i == j { variance } else { 0.0 }
        });
        let mesh = multiply_transposed(&factor, &factor);
        let sum = Matrix::from_fn(outputs, outputs, |i, j| noise[(i, j)] + mesh[(i, j)]);
        let solved = Cholesky::new(&sum).unwrap().solve_matrix(&jacobian);
        let information = transposed_multiply(&jacobian, &solved);
        let posterior = Cholesky::new(&information).unwrap().inverse();
        let gain = multiply_transposed(&posterior, &solved);
        let moved = multiply(&gain, &Matrix::from_vec(outputs, 1, error));
        let allowed = multiply_transposed(&multiply(&gain, &mesh), &gain);
        let scatter = multiply_transposed(&multiply(&gain, &noise), &gain);
        for j in 0..d {
            squares[j].push(moved[(j, 0)].powi(2) / allowed[(j, j)]);
            widths[j].push(posterior[(j, j)].sqrt());
            let law = Distribution::Normal([moved[(j, 0)], scatter[(j, j)].sqrt()]);
            for (share, z) in held.iter_mut().zip([0.674, 1.645, 1.96]) {
                let half = z * posterior[(j, j)].sqrt();
                *share += (law.cdf(half) - law.cdf(-half)) / (runs * d) as f64;
            }
        }
    }
    let means = |all: &[Vec<f64>]| all.iter().map(|x| moments::mean(x)).collect::<Vec<_>>();
    format!(
        "shift squared over allowed {:.2?}, intervals of 50, 90, 95 % hold {held:.3?}, mean sd {:.4?}",
        means(&squares),
        means(&widths)
    )
}
