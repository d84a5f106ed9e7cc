//! Maxima known in closed form, and a published test problem.

use lacuna_base::math::distribution::Distribution;
use lacuna_base::math::moments::Moments;
use lacuna_base::math::random::normal;

use super::*;

/// A log density with its gradient, given as a closure.
struct Density<F> {
    bounds: Vec<(f64, f64)>,
    prior: Vec<(f64, f64)>,
    function: F,
}

impl<F: Fn(&[f64]) -> (f64, Vec<f64>) + Sync> Target for Density<F> {
    fn dimension(&self) -> usize {
        self.bounds.len()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|x| self.gradient(x).0).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let law = |j: usize| Distribution::Normal([self.prior[j].0, self.prior[j].1]);
        let density = |x: &[f64]| (0..x.len()).map(|j| law(j).log_density(x[j])).sum();
        points.iter_rows().map(density).collect()
    }

    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        if x.iter().zip(&self.bounds).any(|(x, (lo, hi))| x < lo || x > hi) {
            return (f64::NEG_INFINITY, vec![0.0; x.len()]);
        }
        (self.function)(x)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.bounds.clone()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.prior.len(), |_, j| {
            self.prior[j].0 + self.prior[j].1 * normal(&mut rng)
        })
    }
}

const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

fn density<F: Fn(&[f64]) -> (f64, Vec<f64>) + Sync>(
    bounds: &[(f64, f64)],
    function: F,
) -> Density<F> {
    Density { bounds: bounds.to_vec(), prior: vec![(0.0, 1.0); bounds.len()], function }
}

fn rosenbrock(x: &[f64]) -> (f64, Vec<f64>) {
    let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
    (-a * a - 100.0 * b * b, vec![2.0 * a + 400.0 * b * x[0], -200.0 * b])
}

fn close(found: &[f64], expected: &[f64], relative: f64) {
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= relative * e.abs(), "{found:?} and not {expected:?}");
    }
}

#[test]
fn rosenbrocks_valley_is_followed_to_its_end() {
    let found = maximise(&density(&[FREE, FREE], rosenbrock), &Matrix::from_rows(2, [[-1.2, 1.0]]));
    close(&found[0].point, &[1.0, 1.0], 1e-7);
    assert!(found[0].converged && found[0].evaluations > 10);
}

#[test]
fn one_ascent_spends_its_own_evaluations_only() {
    let target = density(&[FREE, (-3.0, 0.25)], rosenbrock);
    let precision = Precision { gradient: 1e-7, gain: None, steps: 200 };
    let found = ascend(&target, &[-1.2, 1.0], &[1.0, 1.0], precision).unwrap();
    // On the bound x_2 = 1/4 the maximum over x_1 solves 200 x_1^3 - 49 x_1 - 1 = 0.
    let x = found.point[0];
    assert!(found.converged && found.point[1] == 0.25 && found.evaluations < 60);
    assert!((200.0 * x.powi(3) - 49.0 * x - 1.0).abs() < 1e-5, "{x}");
    let rough = Precision { gradient: 0.0, gain: Some(1e-3), steps: 200 };
    assert!(
        ascend(&target, &[-1.2, 1.0], &[1.0, 1.0], rough).unwrap().evaluations < found.evaluations
    );
    assert!(ascend(&density(&[FREE], |_| (f64::NAN, vec![0.0])), &[0.0], &[1.0], rough).is_none());
}

#[test]
fn bounds_hold_the_maximum() {
    // Source: Hock and Schittkowski (1981), problem 2: Rosenbrock's function with x2 >= 1.5 has
    // its minimum 0.0504261879 at x1 = 2 a cos(arccos(1 / b) / 3), and another, 4.9412293, at
    // x1 = -1.2210274.
    let target = density(&[FREE, (1.5, f64::INFINITY)], rosenbrock);
    let found = maximise(&target, &Matrix::from_rows(2, [[-2.0, 1.0], [2.0, 9.0], [1.0, 1.6]]));
    let a = (598.0_f64 / 1200.0).sqrt();
    let b = 400.0 * a.powi(3);
    close(&found[0].point, &[2.0 * a * ((1.0 / b).acos() / 3.0).cos(), 1.5], 1e-8);
    assert!((found[0].value + 0.050_426_187_9).abs() < 1e-9);
    assert_eq!(found.len(), 2);
    assert!((found[1].value + 4.941_229_3).abs() < 1e-6);
    assert!(found.iter().all(|optimum| optimum.converged));
}

#[test]
fn distinct_maxima_come_in_order() {
    // Three peaks of different height, far apart; twenty starts.
    let peaks = [(-4.0, 0.5), (0.0, 1.0), (5.0, 0.8)];
    let target = density(&[(-10.0, 10.0)], |x: &[f64]| {
        let weights = peaks.map(|(centre, height)| height * (-0.5 * (x[0] - centre).powi(2)).exp());
        let sum: f64 = weights.iter().sum();
        let slope: f64 = weights.iter().zip(peaks).map(|(w, (c, _))| w * (c - x[0])).sum();
        (sum.ln(), vec![slope / sum])
    });
    let starts = Matrix::from_fn(20, 1, |i, _| -9.5 + i as f64);
    let found: Vec<f64> = maximise(&target, &starts).iter().map(|o| o.point[0]).collect();
    assert_eq!(found.len(), 3, "{found:?}");
    for (found, expected) in found.iter().zip([0.0, 5.0, -4.0]) {
        assert!((found - expected).abs() < 1e-2, "{found}");
    }
}

/// A normal distribution with these means, standard deviations and correlation.
fn correlated(m: [f64; 2], s: [f64; 2], rho: f64) -> impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync {
    move |x: &[f64]| {
        let (u, v) = ((x[0] - m[0]) / s[0], (x[1] - m[1]) / s[1]);
        let slope = [(u - rho * v) / (1.0 - rho * rho), (v - rho * u) / (1.0 - rho * rho)];
        let value = -1e5 - 0.5 * (u * slope[0] + v * slope[1]);
        (value, vec![-slope[0] / s[0], -slope[1] / s[1]])
    }
}

#[test]
fn a_million_and_a_ten_billionth_go_together() {
    let (mean, sd) = ([3e6, 2e-10], [1e3, 1e-13]);
    for (bounds, prior) in [
        ([FREE, FREE], vec![(1e6, 1e6), (1e-10, 1e-10)]),
        ([(0.0, 1e7), (0.0, 1e-6)], vec![(0.0, 1.0); 2]),
    ] {
        let target =
            Density { bounds: bounds.to_vec(), prior, function: correlated(mean, sd, 0.95) };
        let found = maximise(&target, &Matrix::from_rows(2, [[8e6, 9e-10], [1e5, 1e-12]]));
        assert_eq!(found.len(), 1);
        assert!(found[0].converged, "{:?}", found[0]);
        close(&found[0].point, &mean, 1e-6);
        let shape = laplace(&target, &found[0].point).unwrap();
        assert!(shape.definite);
        let covariance = shape.covariance;
        let expected = [1e6, 0.95e-10, 1e-26];
        close(&[covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]], &expected, 1e-5);
    }
}

#[test]
fn the_map_of_a_conjugate_normal_law_is_exact() {
    // Prior N(7, variance 2), data 9.1241 and 8.151 with variance 3: precision 7/6, closed form.
    let target = density(&[FREE], |x: &[f64]| {
        let (p, a, b) = (x[0] - 7.0, x[0] - 9.1241, x[0] - 8.151);
        (-p * p / 4.0 - (a * a + b * b) / 6.0, vec![-p / 2.0 - (a + b) / 3.0])
    });
    let found = &maximise(&target, &Matrix::from_rows(1, [[-50.0]]))[0];
    close(&found.point, &[(3.5 + (9.1241 + 8.151) / 3.0) * 6.0 / 7.0], 1e-9);
    let shape = laplace(&target, &found.point).unwrap();
    close(shape.covariance.as_slice(), &[6.0 / 7.0], 1e-9);
}

#[test]
fn places_without_density_turn_the_search_back() {
    // ln(1 - x^2 - y^2) + 5 x on the disc: 5 (1 - x^2) = 2 x at the maximum.
    let disc = density(&[FREE, FREE], |x: &[f64]| {
        let rest = 1.0 - x[0] * x[0] - x[1] * x[1];
        if rest <= 0.0 {
            return (f64::NEG_INFINITY, vec![0.0; 2]);
        }
        (rest.ln() + 5.0 * x[0], vec![5.0 - 2.0 * x[0] / rest, -2.0 * x[1] / rest])
    });
    let starts = Matrix::from_rows(2, [[-0.9, 0.3], [0.0, -0.99], [2.0, 0.0], [0.5, f64::NAN]]);
    let found = maximise(&disc, &starts);
    assert_eq!(found.len(), 1);
    assert!((found[0].point[0] - (104.0_f64.sqrt() - 2.0) / 10.0).abs() < 1e-7);
    assert!(found[0].point[1].abs() < 1e-7 && found[0].converged);

    // A gamma distribution whose zero at the origin is not declared as a bound.
    let law = Distribution::Gamma([2.0, 3.0]);
    let gamma = density(&[FREE], |x: &[f64]| {
        (law.log_density(x[0]), vec![law.log_density_derivative(x[0])])
    });
    for start in [1e-3, 1.0, 200.0] {
        let found = &maximise(&gamma, &Matrix::from_rows(1, [[start]]))[0];
        assert!((found.point[0] - 3.0).abs() < 1e-6 && found.converged, "{start}: {found:?}");
    }
    assert!(maximise(&gamma, &Matrix::from_rows(1, [[-1.0]])).is_empty());
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let target = density(&[FREE, (1.5, f64::INFINITY)], rosenbrock);
    let starts = target.prior_draws(16, &Stream::root(1));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| maximise(&target, &starts))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn a_direction_without_curvature_is_as_wide_as_its_bounds() {
    let target = density(&[FREE, (0.0, 50.0)], |x: &[f64]| (-0.5 * x[0] * x[0], vec![-x[0], 0.0]));
    let shape = laplace(&target, &[0.0, 20.0]).unwrap();
    assert!(!shape.definite);
    close(&[shape.covariance[(0, 0)], shape.covariance[(1, 1)]], &[1.0, 2500.0], 1e-6);
}

#[test]
fn walkers_are_scattered_inside_the_support() {
    let free = density(&[FREE, FREE], correlated([1.0, 2.0], [3.0, 0.1], 0.8));
    let shape = laplace(&free, &[1.0, 2.0]).unwrap();
    let points = scatter(&free, &[1.0, 2.0], &shape, 4000, &Stream::root(1)).unwrap();
    let moments = Moments::of_rows(&points);
    // The sample covariance of 4000 normal draws has an error of about sqrt(2 / 4000) = 2.2 %.
    close(&moments.sd(), &[3.0, 0.1], 0.05);
    assert!((moments.correlation()[(0, 1)] - 0.8).abs() < 0.03);

    // The maximum lies on a bound: the half outside is drawn again.
    let target = density(&[(0.0, 1.0)], |x: &[f64]| (-20.0 * x[0], vec![-20.0]));
    let top = maximise(&target, &Matrix::from_rows(1, [[0.5]])).remove(0);
    assert!(top.point == [0.0] && top.converged && top.gradient_norm == 0.0);
    let shape = laplace(&target, &top.point).unwrap();
    close(shape.covariance.as_slice(), &[1.0 / 400.0], 1e-9);
    let points = scatter(&target, &top.point, &shape, 100, &Stream::root(2)).unwrap();
    assert!(points.as_slice().iter().all(|x| (0.0..=1.0).contains(x)));
    assert!(Moments::of_rows(&points).sd()[0] > 0.02);
}

/// A datum of `x[0]` with a uniform prior, and coordinates that it says nothing of: uniform ones and half-normal ones.
struct OneOfMany(usize);

impl OneOfMany {
    fn law(&self, j: usize) -> Distribution {
        if j < self.0 / 2 {
            Distribution::Uniform([0.0, 1.0])
        } else {
            Distribution::HalfNormal(2.0)
        }
    }
}

impl Target for OneOfMany {
    fn dimension(&self) -> usize {
        self.0
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let prior = self.log_prior(points).into_iter();
        prior
            .zip(points.iter_rows())
            .map(|(p, x)| p - 0.5 * ((x[0] - 0.5) / 0.01).powi(2))
            .collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let density = |x: &[f64]| (0..x.len()).map(|j| self.law(j).log_density(x[j])).sum();
        points.iter_rows().map(density).collect()
    }

    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let value = self.log_density(&Matrix::from_rows(x.len(), [x]))[0];
        let mut slope: Vec<f64> =
            (0..x.len()).map(|j| if j < self.0 / 2 { 0.0 } else { -0.25 * x[j] }).collect();
        slope[0] -= (x[0] - 0.5) / 1e-4;
        (value, slope)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        (0..self.0).map(|j| self.law(j).support()).collect()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        let draw = |_, j| self.law(j).quantile(lacuna_base::math::random::uniform(&mut rng));
        Matrix::from_fn(count, self.0, draw)
    }
}

#[test]
fn coordinates_that_the_data_say_nothing_of_start_at_draws_of_their_priors() {
    let target = OneOfMany(60);
    // At the bound of every idle coordinate: one normal draw in 2^59 lies inside.
    let top: Vec<f64> = (0..60).map(|j| if j == 0 { 0.5 } else { 0.0 }).collect();
    let shape = laplace(&target, &top).unwrap();
    let points = scatter(&target, &top, &shape, 400, &Stream::root(4)).unwrap();
    let (moments, sd) = (Moments::of_rows(&points), Moments::of_rows(&points).sd());
    // Standard deviations of 400 draws have errors of 3.5 % and less; that of a half-normal law is sqrt(1 - 2/pi).
    close(&sd[..1], &[0.01], 0.12);
    for (j, sd) in sd.iter().enumerate().skip(1) {
        let law = target.law(j);
        let (exact, error) = (law.variance().sqrt(), law.variance().sqrt() / 20.0);
        assert!((sd / exact - 1.0).abs() < 0.2, "{j}: {sd} {exact}");
        assert!((moments.mean()[j] - law.mean()).abs() < 5.0 * error, "{j}");
    }
}

#[test]
fn no_walker_starts_far_below_the_ridge() {
    // A thin curved ridge: draws of the normal law at its top fall hundreds of nats beside it.
    let target = density(&[FREE, FREE], |x: &[f64]| {
        let b = x[1] - x[0] * x[0];
        (-0.5 * x[0] * x[0] - 5e3 * b * b, vec![-x[0] + 2e4 * b * x[0], -1e4 * b])
    });
    let shape = laplace(&target, &[0.0, 0.0]).unwrap();
    let points = scatter(&target, &[0.0, 0.0], &shape, 200, &Stream::root(3)).unwrap();
    assert!(target.log_density(&points).iter().all(|l| *l > -15.1));
    assert!(Moments::of_rows(&points).sd()[0] > 0.1);
}
