#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Layouts, Unit};
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::surrogate::FitError;
use lacuna::run::Stop;
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed};

use super::curves::{Curves, Runs};
use super::factor::Shifts;
use super::kriging::Kriging;
use super::size::Size;
use super::taper::{Places, Scaled};

fn points(count: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(count, 2, |_, _| uniform(&mut rng))
}

/// Variance of a process of unit variance with a trend whose coefficients have a very wide normal prior, which is
/// universal kriging in the limit (Rasmussen and Williams 2006, equation 2.42), by conditioning one normal vector.
fn conditioned(runs: &Matrix, point: &[f64], length: f64) -> f64 {
    let scaled = |p: &[f64]| -> Vec<f64> { p.iter().map(|x| x / length).collect() };
    let covariance = |a: &[f64], b: &[f64]| {
        let (a, b) = (scaled(a), scaled(b));
        let square: f64 = a.iter().zip(&b).map(|(x, y)| (x - y).powi(2)).sum();
        let r = (5.0 * square).sqrt();
        let trend = 1.0 + a.iter().zip(&b).map(|(x, y)| x * y).sum::<f64>();
        (1.0 + r + r * r / 3.0) * (-r).exp() + 1e5 * trend
    };
    let among = Matrix::from_fn(runs.rows(), runs.rows(), |i, j| {
        covariance(runs.row(i), runs.row(j)) + if i == j { 1e-4 } else { 0.0 }
    });
    let onto: Vec<f64> = runs.iter_rows().map(|run| covariance(run, point)).collect();
    covariance(point, point) + 1e-4 - Cholesky::new(&among).unwrap().quadratic(&onto)
}

#[test]
fn the_variance_is_that_of_universal_kriging() {
    let runs = points(15, 1);
    let kriging = Kriging::new(&runs, 0.7).unwrap();
    for point in [[0.5, 0.5], [0.02, 0.97], [1.1, -0.1]] {
        let expected = conditioned(&runs, &point, 0.7);
        let found = kriging.variance(&point);
        assert!((found - expected).abs() < 1e-3 * expected, "{found} {expected}");
    }
    for (left, found) in kriging.left_out().into_iter().enumerate() {
        let others: Vec<usize> = (0..15).filter(|i| *i != left).collect();
        let expected = conditioned(&runs.select_rows(&others), runs.row(left), 0.7);
        assert!((found - expected).abs() < 1e-3 * expected, "run {left}: {found} {expected}");
    }
}

fn layouts(outputs: usize) -> Layouts {
    let grid: Vec<f64> = (0..outputs).map(|i| i as f64).collect();
    let axes =
        vec![Axis::labels("sensor", ["a", "b"]), Axis::grid("time", grid, Unit::dimensionless())];
    let layout = Layout { name: "y".into(), unit: Unit::dimensionless(), axes };
    Layouts::of_scenarios([("", layout)])
}

/// Curves at points, with the given sizes.
fn curves(count: usize, outputs: usize, size: impl Fn(&[f64]) -> f64) -> Curves {
    let points = points(count, 5);
    let mut rng = Stream::root(6).generator();
    let sizes: Vec<f64> = points.iter_rows().map(size).collect();
    let errors = Matrix::from_fn(count, outputs, |i, _| sizes[i] * normal(&mut rng));
    Curves { points, errors, stated: None }
}

/// The variance of an independent normal error of 40 outputs is known from 60 curves to 2 %; its logarithm falls by 2
/// from one end to the other, which neither distances nor a constant describe, but a stated variance does.
#[test]
fn a_stated_variance_tells_where_errors_are_large() {
    let sd = |point: &[f64]| (-2.0 * point[0]).exp();
    let mut known = curves(60, 40, sd);
    // Ten times too small: only relative values matter.
    let stated = |i: usize| 0.01 * sd(known.points.row(i)).powi(2);
    known.stated = Some(Matrix::from_fn(60, 40, |i, _| stated(i)));
    let size = Size::learned(&known);
    assert!(size.varies());
    let ratio = |i: usize| size.at_curves[i] / sd(known.points.row(i));
    let mean = (0..60).map(ratio).sum::<f64>() / 60.0;
    // The exponent is shrunk toward one half, which is the truth.
    assert!((0..60).all(|i| (ratio(i) / mean - 1.0).abs() < 0.1));
}

#[test]
fn of_few_curves_nothing_is_learned_of_where_they_are_large() {
    assert!(!Size::learned(&curves(24, 40, |point| (-2.0 * point[0]).exp())).varies());
    assert!(!Size::learned(&curves(5, 40, |_| 1.0)).varies());
}

/// The factor times its transpose is the elementwise product of the mean square of the curves and the damping, whose
/// entries are known by hand: 0.7 between sensors, exp(-1/2 (d / 0.15)^2) at a distance of the fraction d of the axis.
#[test]
fn correlations_are_damped_and_variances_kept() {
    let layouts = layouts(8);
    let places = Places::of(&layouts);
    let known = curves(5, 16, |_| 1.0).errors;
    let factor = places.factor(&Scaled::plain(&known), &[1e-6; 16]).unwrap();
    let found = multiply_transposed(&factor, &factor);
    for (i, j, damping) in [
        (3, 3, 1.0),
        (3, 11, 0.7),
        (2, 3, (-0.5_f64 * (0.125_f64 / 0.15).powi(2)).exp()),
        (0, 12, 0.7 * (-0.5_f64 * (0.5_f64 / 0.15).powi(2)).exp()),
    ] {
        let square = (0..5).map(|k| known[(k, i)] * known[(k, j)]).sum::<f64>() / 5.0;
        let expected = damping * square;
        assert!((found[(i, j)] - expected).abs() < 1e-6, "{i} {j}: {} {expected}", found[(i, j)]);
    }
}

/// The omitted part of the elementwise product is below the noise along every direction, and so in every element: an
/// estimate would find any direction along which an emulator counts as exact.
#[test]
fn no_direction_above_the_noise_is_left_out() {
    let (outputs, noise) = (600, 1e-2);
    let known = curves(40, outputs, |_| 1.0);
    let places = Places::of(&layouts(outputs / 2));
    let factor = places.factor(&Scaled::plain(&known.errors), &vec![noise; outputs]).unwrap();
    let found = multiply_transposed(&factor, &factor);
    for i in (0..outputs).step_by(7) {
        for j in (0..outputs).step_by(11) {
            let product: f64 =
                known.errors.iter_rows().map(|curve| curve[i] * curve[j]).sum::<f64>() / 40.0;
            let expected = product * places.damping(i, j);
            let difference = found[(i, j)] - expected;
            assert!(difference.abs() < 0.1 * noise, "{i} {j}: {difference}");
        }
    }
}

fn factor_of(known: &Curves, noise: f64, slopes: &Matrix) -> f64 {
    let layouts = layouts(known.errors.columns() / 2);
    let (places, size) = (Places::of(&layouts), Size::learned(known));
    let noise = vec![noise; known.errors.columns()];
    Shifts::of(known, &size, &places, &noise).factor(&|_| slopes.clone())
}

/// Independent errors have the tapered covariance as stated: no factor is needed except the one for few curves, here
/// sqrt(199/196). The mean square of 100 curves' shifts of two parameters is known to 1/10, that of the outer half to
/// 1/7, which the slope of the factor turns into at most a tenth.
#[test]
fn errors_that_are_as_stated_need_no_factor() {
    let slopes = Matrix::from_fn(20, 2, |i, k| ((i + 1) as f64 * (k + 1) as f64).sin());
    let factor = factor_of(&curves(200, 20, |_| 1.0), 0.01, &slopes);
    assert!((0.99..1.25).contains(&factor), "{factor}");
}

/// Errors along a slope that never changes its sign over time: a taper cuts their correlation, and understates the
/// variance of the sum. With small noise the shift is the sum over the outputs of one normal number per curve, `m a`,
/// and a taper of effective length `l` states `sqrt(m l) a`.
#[test]
fn errors_that_the_taper_understates_are_enlarged() {
    let base = curves(60, 1, |_| 1.0);
    let errors = Matrix::from_fn(60, 40, |i, _| base.errors[(i, 0)]);
    let slopes = Matrix::from_fn(40, 2, |i, k| if k == 0 { 1.0 } else { (i as f64).sin() });
    let factor = factor_of(&Curves { errors, ..base }, 1e-4, &slopes);
    assert!(factor > 1.3, "{factor}");
}

/// An emulator with the same response at all points.
struct Mean(Vec<f64>, FitError);

mod of_the_others {
    use super::*;
    use lacuna::plugin::{Emulator, Fact, Forward};

    impl Forward for Mean {
        fn dimension(&self) -> usize {
            2
        }

        fn outputs(&self) -> usize {
            self.0.len()
        }

        fn mean(&self, points: &Matrix) -> Matrix {
            Matrix::from_fn(points.rows(), self.0.len(), |_, j| self.0[j])
        }

        fn jacobian(&self, point: &[f64]) -> Matrix {
            Matrix::zeros(self.0.len(), point.len())
        }
    }

    impl Emulator for Mean {
        fn fit_error(&self) -> &FitError {
            &self.1
        }

        fn facts(&self) -> Vec<Fact> {
            Vec::new()
        }

        fn save(&self) -> Result<Vec<u8>, Stop> {
            Ok(Vec::new())
        }
    }

    /// The emulator is the mean of the runs it is given: the error of each run is its distance from the mean of the
    /// runs of the other nine parts.
    #[test]
    fn each_run_is_judged_by_an_emulator_without_it() {
        let (points, known) = (points(25, 8), curves(25, 3, |_| 1.0).errors);
        let runs = Runs { points: &points, responses: &known };
        let mean = |kept: &[usize], j: usize| {
            kept.iter().map(|&i| known[(i, j)]).sum::<f64>() / kept.len() as f64
        };
        let found = Curves::refitted(runs, |kept, left| {
            assert_eq!(kept.len() + left.len(), 25);
            Ok(Box::new(Mean((0..3).map(|j| mean(kept, j)).collect(), FitError::default())))
        });
        let found = found.unwrap().unwrap();
        let others: Vec<usize> = (0..25).filter(|i| i % 10 != 4).collect();
        for j in 0..3 {
            let expected = known[(14, j)] - mean(&others, j);
            assert!((found.errors[(14, j)] - expected).abs() < 1e-14);
        }
        assert_eq!(found.stated, None);
        // If the remaining runs are too few, the refitted errors are unavailable, and the reason is reported.
        let failed = Curves::refitted(runs, |_, _| Err(Stop::new("too few")));
        assert_eq!(failed.unwrap_err().to_string(), "too few");
    }
}
