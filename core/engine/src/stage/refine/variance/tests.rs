use lacuna::math::moments;
use lacuna::math::random::{Stream, normal};
use lacuna_linalg::{Cholesky, Matrix};

use super::{State, log_square};

/// Normal log density with mean zero.
fn log_normal(e: &[f64], covariance: &Matrix) -> f64 {
    let factor = Cholesky::new(covariance).unwrap();
    let p = e.len() as f64;
    -0.5 * (factor.quadratic(e) + factor.log_determinant() + p * std::f64::consts::TAU.ln())
}

/// `I + R diag(v) R'`.
fn covariance(directions: &Matrix, v: &[f64]) -> Matrix {
    let p = directions.rows();
    Matrix::from_fn(p, p, |i, j| {
        let sum: f64 =
            v.iter().enumerate().map(|(k, v)| v * directions[(i, k)] * directions[(j, k)]).sum();
        sum + if i == j { 1.0 } else { 0.0 }
    })
}

/// The expectation over the result of a run, by simulation: the mean of the emulator moves by a normal number of the
/// variance that becomes known, and the squared density is averaged. Ratios of two runs are compared, within 4 standard
/// errors.
#[test]
fn the_expected_square_is_that_of_simulated_runs() {
    let directions = Matrix::from_rows(2, [[1.0, 0.4], [0.0, 0.8]]);
    let (residual, own) = ([1.2, -0.7], [3.0, 0.9]);
    let mut rng = Stream::root(5).generator();
    let mut simulated = |known: [f64; 2]| {
        let left: Vec<f64> = own.iter().zip(known).map(|(own, known)| own - known).collect();
        let left = covariance(&directions, &left);
        let squares: Vec<f64> = (0..20_000)
            .map(|_| {
                let t = known.map(|v| v.sqrt() * normal(&mut rng));
                let moved: Vec<f64> = (0..2)
                    .map(|i| residual[i] - directions[(i, 0)] * t[0] - directions[(i, 1)] * t[1])
                    .collect();
                (2.0 * log_normal(&moved, &left)).exp()
            })
            .collect();
        (moments::mean(&squares), (moments::variance(&squares) / 20_000.0).sqrt())
    };
    let none = log_square(&directions, &residual, &own, &[0.0, 0.0]);
    let (base, _) = simulated([0.0, 0.0]);
    for known in [[1.5, 0.1], [2.8, 0.0], [0.5, 0.85]] {
        let (found, error) = simulated(known);
        let exact = (log_square(&directions, &residual, &own, &known) - none).exp() * base;
        assert!((found - exact).abs() < 4.0 * error, "{known:?}: {found} +- {error}, {exact}");
        assert!(exact > base);
    }
}

/// Conditioning on a run is that of a normal law: the covariance of the remaining errors is the Schur complement.
#[test]
fn a_chosen_point_makes_its_neighbourhood_known() {
    let kernel = |i: usize, j: usize| 4.0 * (-0.5 * (i as f64 - j as f64).powi(2)).exp();
    let mut state = State {
        covariances: vec![Matrix::from_fn(8, 8, kernel)],
        noise: vec![0.0],
        directions: Matrix::from_rows(1, [[1.0]]),
        residuals: Matrix::from_fn(4, 1, |i, _| [0.0, 5.0, 5.0, 5.0][i]),
        outside: vec![0.0; 4],
    };
    // The first reference fits the data, so that the candidate nearest to it (index 4) is worth most.
    let gains: Vec<f64> = (4..8).map(|c| state.gain(c)).collect();
    assert!(gains[0] > gains[1] && gains[1] > gains[3], "{gains:?}");
    state.condition(4);
    let schur = kernel(5, 6) - kernel(5, 4) * kernel(4, 6) / kernel(4, 4);
    assert!((state.covariances[0][(5, 6)] - schur).abs() < 1e-12);
    assert!(state.covariances[0][(4, 4)].abs() < 1e-12);
}
