//! The stretch move against closed forms and against figures measured with emcee 3.1.6.

use lacuna::data::Draws;
use lacuna::diagnose::walkers::Stranded;
use lacuna::diagnose::{autocorrelation, walkers};
use lacuna::math::distribution::Distribution;
use lacuna::math::moments::Moments;
use lacuna::math::random::normal;
use rayon::prelude::*;

use super::*;

/// A density given by a function; its prior draws are normal numbers around `centre`.
struct Density<F> {
    dimension: usize,
    centre: f64,
    spread: f64,
    function: F,
}

impl<F: Fn(&[f64]) -> f64 + Sync> Target for Density<F> {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(&self.function).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let law = Distribution::Normal([self.centre, self.spread]);
        points.iter_rows().map(|p| p.iter().map(|&x| law.log_density(x)).sum()).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        ((self.function)(point), vec![f64::NAN; point.len()])
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); self.dimension]
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.dimension, |_, _| self.centre + self.spread * normal(&mut rng))
    }
}

fn standard(dimension: usize) -> Density<impl Fn(&[f64]) -> f64 + Sync> {
    let function = |x: &[f64]| -0.5 * x.iter().map(|x| x * x).sum::<f64>();
    Density { dimension, centre: 0.0, spread: 1.0, function }
}

fn ensemble(walkers: usize, steps: usize) -> AffineInvariantEnsemble {
    AffineInvariantEnsemble { walkers, steps, ..AffineInvariantEnsemble::default() }
}

/// Runs a sampler to its end; returns the draws after `burn_in` steps.
fn run(sampler: &AffineInvariantEnsemble, target: &dyn Target, seed: u64, burn_in: usize) -> Draws {
    let points = target.prior_draws(sampler.walkers, &Stream::root(seed).named("start"));
    run_from(sampler, target, points, seed, burn_in)
}

/// Like [`run`], from given starting points.
pub(super) fn run_from(
    sampler: &AffineInvariantEnsemble,
    target: &dyn Target,
    points: Matrix,
    seed: u64,
    burn_in: usize,
) -> Draws {
    let root = Stream::root(seed);
    let mut state = sampler.start(target, points).unwrap();
    let mut kept = Vec::new();
    for step in 0..sampler.steps {
        sampler.step(target, &mut state, &root.named("step").at(step as u64)).unwrap();
        if step >= burn_in {
            kept.push((state.points.clone(), state.log_density.clone()));
        }
    }
    let names = (0..target.dimension()).map(|j| format!("x{j}")).collect();
    Draws::from_steps(names, &kept)
}

/// Asserts that the mean of `f` over the draws is within four Monte Carlo errors of `expected`.
fn assert_mean(draws: &Draws, what: &str, expected: f64, f: impl Fn(&[f64]) -> f64) {
    let values: Vec<Vec<f64>> = (0..draws.chains)
        .map(|chain| (0..draws.steps).map(|step| f(draws.point(chain, step))).collect())
        .collect();
    let mean = values.iter().flatten().sum::<f64>() / draws.len() as f64;
    let error = autocorrelation::ensemble_error(&values);
    assert!((mean - expected).abs() < 4.0 * error, "{what}: {mean} +- {error}, not {expected}");
}

#[test]
fn it_keeps_the_contract_of_samplers() {
    for update in [Update::Split, Update::Sequential] {
        let sampler = AffineInvariantEnsemble { update, ..ensemble(40, 2000) };
        assert_eq!(lacuna_contract::sampler("affine_invariant_ensemble", &sampler), Ok(()));
    }
}

/// The first two coordinates of a run of 100 walkers; all coordinates are alike.
fn first_two_coordinates(target: &dyn Target, steps: u64) -> Draws {
    let (sampler, root) = (ensemble(100, 1), Stream::root(1));
    let mut state = sampler.start(target, target.prior_draws(100, &root.named("start"))).unwrap();
    let mut kept = Vec::new();
    for step in 0..steps {
        sampler.step(target, &mut state, &root.named("step").at(step)).unwrap();
        kept.push((state.points.select_columns(&[0, 1]), state.log_density.clone()));
    }
    Draws::from_steps(vec!["x0".into(), "x1".into()], &kept)
}

#[test]
fn acceptance_and_autocorrelation_are_those_of_emcee() {
    // Source: emcee 3.1.6, standard normal distribution, 100 walkers, 20000 steps, a = 2: acceptance rate and
    // autocorrelation time.
    for (dimension, acceptance, tau) in
        [(2, 0.716, 31.0), (5, 0.552, 56.0), (10, 0.418, 111.0), (20, 0.298, 264.0)]
    {
        let draws = first_two_coordinates(&standard(dimension), 20_000);
        let shares = walkers::acceptance(&draws);
        let found = shares.iter().sum::<f64>() / 100.0;
        assert!((found - acceptance).abs() < 0.01, "d = {dimension}: acceptance {found}");
        println!("d = {dimension}: acceptance {found:.4}");
        let times = (0..2)
            .map(|j| autocorrelation::integrated_time(&draws.coordinate(j).collect::<Vec<_>>()));
        let found = times.sum::<f64>() / 2.0;
        assert!((found / tau - 1.0).abs() < 0.1, "d = {dimension}: tau {found}");
        println!("d = {dimension}: autocorrelation time {found:.1}");
        assert_eq!(Stranded::among(&draws), Stranded::default());
    }
}

#[test]
fn a_conjugate_normal_posterior_is_found_in_sixty_steps() {
    // Source: the self-test of UQLab. Prior N(7, variance 2), data 9.1241 and 8.151 with variance 3;
    // the posterior is normal with mean 7.935743 and variance 0.857143.
    let function = |x: &[f64]| {
        let misfit = (9.1241 - x[0]).powi(2) + (8.151 - x[0]).powi(2);
        -0.25 * (x[0] - 7.0).powi(2) - misfit / 6.0
    };
    let target = Density { dimension: 1, centre: 7.0, spread: 2.0_f64.sqrt(), function };
    let mut divergences: Vec<f64> = (0..20)
        .map(|seed| {
            let draws = run(&ensemble(100, 60), &target, seed, 30);
            let moments = Moments::of_rows(&draws.points());
            let (mean, variance) = (moments.mean()[0], moments.covariance()[(0, 0)]);
            let ratio = variance / 0.857_143;
            0.5 * (ratio - 1.0 - ratio.ln() + (mean - 7.935_743_f64).powi(2) / 0.857_143)
        })
        .collect();
    divergences.sort_by(f64::total_cmp);
    assert!(divergences[10] < 0.01, "{divergences:?}");
}

#[test]
fn a_strongly_correlated_normal_law_has_its_mean_and_covariance() {
    let (scale, rho) = ([1e-6, 1e6], 0.99);
    let function = move |x: &[f64]| {
        let (u, v) = (x[0] / scale[0] - 3.0, x[1] / scale[1] + 2.0);
        -0.5 * (u * u + v * v - 2.0 * rho * u * v) / (1.0 - rho * rho)
    };
    let target = Density { dimension: 2, centre: 0.0, spread: 1e-6, function };
    let sampler = ensemble(40, 6000);
    let mut rng = Stream::root(4).named("start").generator();
    let points = Matrix::from_fn(40, 2, |_, j| scale[j] * ([3.0, -2.0][j] + normal(&mut rng)));
    let draws = run_from(&sampler, &target, points, 4, 600);
    let u = move |x: &[f64]| x[0] / scale[0] - 3.0;
    let v = move |x: &[f64]| x[1] / scale[1] + 2.0;
    assert_mean(&draws, "mean of x", 0.0, u);
    assert_mean(&draws, "mean of y", 0.0, v);
    assert_mean(&draws, "variance of x", 1.0, move |x| u(x).powi(2));
    assert_mean(&draws, "variance of y", 1.0, move |x| v(x).powi(2));
    assert_mean(&draws, "covariance", rho, move |x| u(x) * v(x));
}

#[test]
fn a_curved_ridge_has_its_exact_moments() {
    // x ~ N(1, 1) and y | x ~ N(x^2, 0.1), a density of Rosenbrock's shape: the moments of the normal distribution
    // give E y = 2 and var y = 6.1.
    let function = |x: &[f64]| -0.5 * (x[0] - 1.0).powi(2) - 5.0 * (x[1] - x[0] * x[0]).powi(2);
    let target = Density { dimension: 2, centre: 1.0, spread: 0.5, function };
    for update in [Update::Split, Update::Sequential] {
        let draws =
            run(&AffineInvariantEnsemble { update, ..ensemble(100, 10_000) }, &target, 2, 2000);
        assert_mean(&draws, "mean of x", 1.0, |x| x[0]);
        assert_mean(&draws, "variance of x", 1.0, |x| (x[0] - 1.0).powi(2));
        assert_mean(&draws, "mean of y", 2.0, |x| x[1]);
        assert_mean(&draws, "variance of y", 6.1, |x| (x[1] - 2.0).powi(2));
    }
}

#[test]
fn an_affine_change_of_the_unknowns_changes_the_chain_by_the_same_map() {
    // y = A x + b; the log density of y is that of x up to a constant.
    let a = [[2.0, 1.0, 0.0], [0.0, 1e3, -3.0], [0.5, 0.0, 1e-3]];
    let b = [5.0, -1.0, 100.0];
    let map = move |x: &[f64]| -> Vec<f64> {
        (0..3).map(|i| b[i] + (0..3).map(|j| a[i][j] * x[j]).sum::<f64>()).collect()
    };
    let inverse = move |y: &[f64]| -> [f64; 3] {
        // x3 from the elimination of x1 = (z1 - x2) / 2 and x2 = (z2 + 3 x3) / 1000.
        let z = [y[0] - b[0], y[1] - b[1], y[2] - b[2]];
        let x3 = (z[2] - 0.25 * z[0] + 0.25e-3 * z[1]) / (1e-3 - 0.75e-3);
        let x2 = (z[1] + 3.0 * x3) / 1e3;
        [0.5 * (z[0] - x2), x2, x3]
    };
    let plain = standard(3);
    let mapped = Density {
        dimension: 3,
        centre: 0.0,
        spread: 1.0,
        function: move |y: &[f64]| -0.5 * inverse(y).iter().map(|x| x * x).sum::<f64>(),
    };
    for update in [Update::Split, Update::Sequential] {
        let sampler = AffineInvariantEnsemble { update, ..ensemble(20, 100) };
        let points = plain.prior_draws(20, &Stream::root(3));
        let moved = Matrix::from_rows(3, points.iter_rows().map(map));
        let mut x = sampler.start(&plain, points).unwrap();
        let mut y = sampler.start(&mapped, moved).unwrap();
        for step in 0..100 {
            let stream = Stream::root(5).at(step);
            sampler.step(&plain, &mut x, &stream).unwrap();
            sampler.step(&mapped, &mut y, &stream).unwrap();
            assert_eq!(x.accepted, y.accepted);
        }
        for (x, y) in x.points.iter_rows().zip(y.points.iter_rows()) {
            for (expected, found) in map(x).iter().zip(y) {
                assert!((found - expected).abs() < 1e-8 * expected.abs().max(1.0));
            }
        }
    }
}

#[test]
fn threads_that_share_a_batch_do_not_change_it() {
    struct Parallel;
    impl Target for Parallel {
        fn dimension(&self) -> usize {
            3
        }
        fn log_density(&self, points: &Matrix) -> Vec<f64> {
            let rows: Vec<&[f64]> = points.iter_rows().collect();
            rows.par_iter().map(|x| -0.5 * x.iter().map(|x| x * x).sum::<f64>()).collect()
        }
        fn log_prior(&self, points: &Matrix) -> Vec<f64> {
            standard(3).log_prior(points)
        }
        fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
            standard(3).gradient(point)
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            standard(3).bounds()
        }
        fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
            standard(3).prior_draws(count, stream)
        }
    }
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&ensemble(50, 40), &Parallel, 6, 0))
    };
    assert_eq!(with(1), with(2));
}

#[test]
fn stranded_walkers_are_found_in_a_real_run() {
    // Two modes 40 standard deviations apart, the second with e^-60 of the density: the walkers that start there are
    // too few to leave it.
    let function = |x: &[f64]| {
        let square = |m: f64| x.iter().map(|x| (x - m).powi(2)).sum::<f64>();
        (-0.5 * square(0.0)).max(-60.0 - 0.5 * square(40.0))
    };
    let target = Density { dimension: 4, centre: 0.0, spread: 1.0, function };
    let sampler = ensemble(60, 400);
    let mut points = target.prior_draws(60, &Stream::root(1));
    for walker in 0..12 {
        points.row_mut(walker).iter_mut().for_each(|x| *x += 40.0);
    }
    let draws = run_from(&sampler, &target, points, 2, 200);
    let far: Vec<usize> = (0..60).filter(|&k| draws.point(k, draws.steps - 1)[0] > 20.0).collect();
    assert!(far.len() > 3, "{far:?}");
    assert_eq!(Stranded::among(&draws).to_the_end, far);
}

#[test]
fn bad_starts_say_what_would_be_right() {
    let target = standard(3);
    let start = |sampler: &AffineInvariantEnsemble, points: Matrix| {
        sampler.start(&target, points).unwrap_err().message
    };
    let good = target.prior_draws(20, &Stream::root(1));
    let flat = Matrix::from_fn(20, 3, |i, j| if j == 2 { 7.0 } else { good[(i, j)] });
    let plane =
        Matrix::from_fn(
            20,
            3,
            |i, j| if j == 2 { good[(i, 0)] + good[(i, 1)] } else { good[(i, j)] },
        );
    for (message, expected) in [
        (
            start(&ensemble(6, 1), target.prior_draws(6, &Stream::root(1))),
            "expected a starting point of 3 coordinates for each of 8 walkers, found 6 points of 3",
        ),
        (
            start(&ensemble(9, 1), target.prior_draws(9, &Stream::root(1))),
            "9 walkers cannot move in two halves: expected an even number",
        ),
        (
            start(&ensemble(20, 1), target.prior_draws(19, &Stream::root(1))),
            "expected a starting point of 3 coordinates for each of 20 walkers, found 19 points of 3",
        ),
        (
            start(&ensemble(20, 1), flat),
            "all walkers start with the same value 7 of coordinate 3, and would keep it",
        ),
        (start(&ensemble(20, 1), plane), "do not span the space of 3 unknowns"),
        (
            start(&AffineInvariantEnsemble { stretch: 1.0, ..ensemble(20, 1) }, good.clone()),
            "expected `stretch` of the sampler above 1, found 1",
        ),
    ] {
        assert!(message.contains(expected), "{message}");
    }
    // Too few for all unknowns: the plan has more, and starts with them.
    let points = target.prior_draws(ensemble(6, 1).plan(3).chains, &Stream::root(1));
    assert_eq!(ensemble(6, 1).start(&target, points).unwrap().points.rows(), 8);
    let function = |x: &[f64]| Distribution::Exponential(1.0).log_density(x[0]);
    let half = Density { dimension: 1, centre: 0.0, spread: 1.0, function };
    let message =
        ensemble(20, 1).start(&half, half.prior_draws(20, &Stream::root(1))).unwrap_err().message;
    assert!(message.contains("walkers start where the posterior density is zero"), "{message}");
}

#[test]
fn options_have_the_defaults_of_the_documentation() {
    let read: AffineInvariantEnsemble = serde_json::from_str("{}").unwrap();
    assert_eq!((read.walkers, read.steps, read.stretch), (120, 1200, 2.0));
    assert_eq!(read.update, Update::Split);
    let written = serde_json::to_string(&read).unwrap();
    assert_eq!(serde_json::from_str::<AffineInvariantEnsemble>(&written).unwrap(), read);
    assert!(serde_json::from_str::<AffineInvariantEnsemble>(r#"{"walker": 3}"#).is_err());
}

/// Unknowns of discrepancies and effects count too: ten unknowns need 22 walkers, three are content with the 16 stated.
#[test]
fn too_few_walkers_for_all_unknowns_are_raised() {
    let sampler = AffineInvariantEnsemble { walkers: 16, ..AffineInvariantEnsemble::default() };
    assert_eq!([3, 10].map(|dimension| sampler.plan(dimension).chains), [16, 22]);
}
