//! Evidences compared with closed forms.

use lacuna::math::distribution::Distribution;

use super::*;

/// Linear regression with normal priors and known noise; its posterior is normal.
struct Regression {
    x: Matrix,
    y: Vec<f64>,
}

const NOISE: f64 = 0.3;
const WIDTH: f64 = 2.0;

impl Regression {
    fn new() -> Self {
        let mut rng = Stream::root(3).generator();
        let x = Matrix::from_fn(30, 3, |i, j| (i as f64 / 30.0).powi(j as i32));
        let noise: Vec<f64> = (0..30).map(|_| NOISE * normal(&mut rng)).collect();
        let y = x.iter_rows().zip(noise).map(|(row, e)| row[0] - 2.0 * row[1] + e).collect();
        Self { x, y }
    }

    /// The data are normal with covariance `s^2 I + t^2 X X'`.
    fn log_evidence(&self) -> f64 {
        let mut covariance = lacuna_linalg::multiply_transposed(&self.x, &self.x);
        covariance.as_mut_slice().iter_mut().for_each(|c| *c *= WIDTH * WIDTH);
        (0..30).for_each(|i| covariance[(i, i)] += NOISE * NOISE);
        let factor = Cholesky::new(&covariance).unwrap();
        -0.5 * (factor.quadratic(&self.y) + factor.log_determinant()) - 30.0 * HALF_LN_TWO_PI
    }

    /// Chains of the posterior with autocorrelation `phi^lag`: autoregressions with its distribution.
    fn chains(&self, chains: usize, steps: usize, phi: f64, seed: u64) -> Draws {
        let mut precision = lacuna_linalg::gram(&self.x);
        precision.as_mut_slice().iter_mut().for_each(|c| *c /= NOISE * NOISE);
        (0..3).for_each(|i| precision[(i, i)] += 1.0 / (WIDTH * WIDTH));
        let factor = Cholesky::new(&precision).unwrap();
        let mut mean = lacuna_linalg::transposed_multiply_vector(&self.x, &self.y);
        for m in &mut mean {
            *m /= NOISE * NOISE;
        }
        factor.solve(&mut mean);
        let spread = Cholesky::new(&factor.inverse()).unwrap();
        let mut draws = Draws {
            names: vec!["a".into(), "b".into(), "c".into()],
            chains,
            steps,
            values: Vec::new(),
            log_density: Vec::new(),
        };
        for chain in 0..chains {
            let mut rng = Stream::root(seed).at(chain as u64).generator();
            let mut z: Vec<f64> = (0..3).map(|_| normal(&mut rng)).collect();
            for _ in 0..steps {
                for z in &mut z {
                    *z = phi * *z + (1.0 - phi * phi).sqrt() * normal(&mut rng);
                }
                draws.values.extend(spread.colour(&z).iter().zip(&mean).map(|(s, m)| s + m));
            }
        }
        draws.log_density = self.log_density(&draws.points());
        draws
    }
}

impl Target for Regression {
    fn dimension(&self) -> usize {
        3
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|p| self.gradient(p).0).collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let law = Distribution::Normal([0.0, WIDTH]);
        points.iter_rows().map(|p| p.iter().map(|&b| law.log_density(b)).sum()).collect()
    }
    fn gradient(&self, b: &[f64]) -> (f64, Vec<f64>) {
        let law = Distribution::Normal([0.0, WIDTH]);
        let mut value: f64 = b.iter().map(|&b| law.log_density(b)).sum();
        let mut slope: Vec<f64> = b.iter().map(|&b| law.log_density_derivative(b)).collect();
        for (row, y) in self.x.iter_rows().zip(&self.y) {
            let misfit = y - row.iter().zip(b).map(|(x, b)| x * b).sum::<f64>();
            value += -0.5 * (misfit / NOISE).powi(2) - NOISE.ln() - HALF_LN_TWO_PI;
            slope.iter_mut().zip(row).for_each(|(s, x)| *s += misfit * x / (NOISE * NOISE));
        }
        (value, slope)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); 3]
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, 3, |_, _| WIDTH * normal(&mut rng))
    }
}

/// An unnormalised gamma density times a constant, on positive numbers.
struct Gamma;

impl Target for Gamma {
    fn dimension(&self) -> usize {
        1
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|p| self.gradient(p).0).collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        self.log_density(points)
    }
    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let law = Distribution::Gamma([4.0, 1e-3]);
        (law.log_density(x[0]) - 1234.5, vec![law.log_density_derivative(x[0])])
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(0.0, f64::INFINITY)]
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        let law = Distribution::Gamma([4.0, 1e-3]);
        Matrix::from_fn(count, 1, |_, _| law.sample(&mut rng))
    }
}

#[test]
fn the_evidence_of_a_regression_is_found_with_an_honest_error() {
    let target = Regression::new();
    let truth = target.log_evidence();
    // Independent draws, and chains with an autocorrelation time of (1 + 0.8) / (1 - 0.8) = 9 steps.
    for (phi, steps) in [(0.0, 200), (0.8, 600)] {
        let runs = 60;
        let mut squares = 0.0;
        for seed in 0..runs {
            let draws = target.chains(4, steps, phi, seed);
            let found = bridge(&target, &draws, &Stream::root(seed).named("bridge")).unwrap();
            let off = found.log - truth;
            assert!(off.abs() < 0.1 && off.abs() < 4.0 * found.error, "{off} +- {}", found.error);
            squares += (off / found.error).powi(2);
        }
        // The mean of 60 chi-square variables has the standard deviation sqrt(2 / 60) = 0.18.
        let rms = (squares / runs as f64).sqrt();
        assert!((0.7..1.4).contains(&rms), "{phi}: {rms}");
    }
}

#[test]
fn bounds_and_constants_are_taken_into_account() {
    let points = Gamma.prior_draws(4000, &Stream::root(1));
    let log_density = Gamma.log_density(&points);
    let draws = Draws {
        names: vec!["x".into()],
        chains: 4,
        steps: 1000,
        values: points.into_vec(),
        log_density,
    };
    let found = bridge(&Gamma, &draws, &Stream::root(2)).unwrap();
    let off = found.log + 1234.5;
    assert!(off.abs() < 4.0 * found.error && found.error < 0.02, "{off} +- {}", found.error);
}

#[test]
fn laplace_is_exact_for_a_normal_posterior_and_says_when_it_is_not() {
    let target = Regression::new();
    let best = lacuna_optimise::maximise(&target, &Matrix::from_rows(3, [[0.0; 3]]));
    let found = laplace_evidence(&target, &best[0].point).unwrap();
    let off = found.log - target.log_evidence();
    assert!(off.abs() < 1e-5 && off.abs() < 4.0 * found.error, "{off} +- {}", found.error);
    // Stirling: the integral of x^3 exp(-x), which is 6, is exp(0.0277) times its approximation at the mode.
    let found = laplace_evidence(&Gamma, &[3e-3]).unwrap();
    let off = found.log + 1234.5;
    assert!(off.abs() > 0.02 && off.abs() < 4.0 * found.error, "{off} +- {}", found.error);
}

#[test]
fn draws_that_cannot_tell_are_refused() {
    let target = Regression::new();
    let stream = Stream::root(1);
    let few = bridge(&target, &target.chains(2, 30, 0.0, 1), &stream).unwrap_err();
    assert!(few.contains("60 draws of 2 chains are too few"), "{few}");
    let mut stuck = target.chains(2, 100, 0.0, 1);
    stuck.values = [1.0, 2.0, 3.0].repeat(200);
    assert!(bridge(&target, &stuck, &stream).unwrap_err().contains("do not span the space"));
}
