//! Properties that every fit must have.

use lacuna::math::random::{Stream, normal};
use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::Surrogate;
use lacuna::plugin::{Emulator, Forward};
use lacuna_linalg::Matrix;

use super::bench::{
    ISHIGAMI, fitted, latin_hypercube, monte_carlo, of_degree, scaled, sobol, up_to,
};
use crate::surrogates::polynomial_chaos::{Basis, Expansion, PolynomialChaos, Solver};

const BOX: [[f64; 2]; 3] = [[0.0, 1.5e7], [1.1e4, 1.4e4], [1200.0, 1800.0]];

/// Outputs with kinks, oscillations and very different sizes.
fn wave(unit: &[f64], output: usize) -> f64 {
    let t = output as f64 / 10.0;
    let decay = (-t * (1.0 + unit[0])).exp();
    let wave = decay * (6.0 * t * (0.8 + 0.4 * unit[2]) / (0.9 + 0.2 * unit[1]).sqrt()).sin();
    10.0_f64.powi(output as i32 - 6) * wave.max(-0.2 - 0.5 * unit[0])
}

fn waves(n: usize, outputs: usize) -> (Matrix, Matrix) {
    let unit = latin_hypercube(n, 3, 11);
    let responses = Matrix::from_fn(n, outputs, |i, o| wave(unit.row(i), o + 1));
    (scaled(&unit, &BOX), responses)
}

#[test]
fn a_planted_sparse_expansion_is_recovered() {
    let planted = [(0, 3.0), (4, -1.25), (17, 0.5), (60, 2.0), (200, -0.75)];
    let probe = ISHIGAMI.fit(&of_degree(1), &sobol(20, 3));
    let nested = of_degree(10).nested(3, 1.0);
    let basis = Basis::new(probe.basis_coordinates(), nested.terms.clone());
    for seed in 0..5 {
        let points = scaled(&latin_hypercube(80, 3, seed), ISHIGAMI.ranges);
        let values = basis.values(&points);
        let responses =
            Matrix::from_fn(80, 1, |i, _| planted.iter().map(|&(t, c)| c * values[(i, t)]).sum());
        let expansion = fitted(&of_degree(10), ISHIGAMI.ranges, &points, &responses).unwrap();
        for t in 0..expansion.terms().len() {
            let expected = planted
                .iter()
                .find(|(p, _)| nested.terms.term(*p) == expansion.terms().term(t))
                .map_or(0.0, |(_, c)| *c);
            assert!((expansion.coefficients()[(t, 0)] - expected).abs() < 1e-12);
        }
        let (_, variance) = expansion.mean_and_variance();
        assert!((variance[0] - (1.25_f64.powi(2) + 0.25 + 4.0 + 0.5625)).abs() < 1e-11);
    }
}

#[test]
fn an_output_that_varies_never_becomes_a_constant() {
    // Source: OpenTURNS issue 2495, where some seeds gave a constant model of the Ishigami function.
    for seed in 0..25 {
        for n in [30, 75] {
            let unit = monte_carlo(n, 3, seed);
            let points = scaled(&unit, ISHIGAMI.ranges);
            let mut rng = Stream::root(seed).generator();
            let noise = Matrix::from_fn(n, 1, |_, _| normal(&mut rng));
            let responses =
                Matrix::from_fn(n, 2, |i, o| [(ISHIGAMI.value)(points.row(i)), noise[(i, 0)]][o]);
            let fit = fitted(&up_to(1, 10), ISHIGAMI.ranges, &points, &responses).unwrap();
            assert!(fit.summary().terms.iter().all(|&t| t > 1), "seed {seed}, {n} runs");
            assert!(n < 75 || fit.fit_error().relative[0] < 0.3, "seed {seed}, {n} runs");
        }
    }
}

#[test]
fn low_degrees_that_explain_nothing_do_not_end_the_search() {
    // P6(x1) P6(x2) is orthogonal to all terms of degree 11 and less.
    let probe = ISHIGAMI.fit(&of_degree(1), &sobol(20, 3));
    let nested = of_degree(12).nested(3, 1.0);
    let basis = Basis::new(probe.basis_coordinates(), nested.terms.clone());
    let points = scaled(&sobol(400, 3), ISHIGAMI.ranges);
    let t = (0..nested.terms.len()).find(|&t| nested.terms.term(t) == [6, 6, 0]).unwrap();
    let responses = basis.values(&points).select_columns(&[t]);
    let fit = fitted(&PolynomialChaos::default(), ISHIGAMI.ranges, &points, &responses).unwrap();
    assert!(fit.fit_error().relative[0] < 1e-20, "{:?}", fit.fit_error().relative);
}

#[test]
fn basis_functions_that_repeat_others_on_the_runs_are_passed_over() {
    let mut unit = latin_hypercube(60, 3, 2);
    for i in 0..60 {
        let row = unit.row_mut(i);
        (row[1], row[2]) = (row[0], 0.3);
    }
    let points = scaled(&unit, &BOX);
    let responses = Matrix::from_fn(60, 1, |i, _| (4.0 * unit[(i, 0)]).sin());
    let fit = fitted(&up_to(1, 8), &BOX, &points, &responses).unwrap();
    assert!(fit.fit_error().relative[0] < 1e-8 && fit.summary().terms[0] < 12);
    let same = Matrix::from_fn(60, 3, |_, j| points[(0, j)]);
    let stop = fitted(&up_to(1, 8), &BOX, &same, &responses).unwrap_err();
    assert!(stop.message.starts_with("the responses vary over the runs, but no basis function"));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let (points, responses) = waves(70, 12);
    let fit = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&up_to(1, 9), &BOX, &points, &responses).unwrap())
    };
    let (one, two) = (fit(1), fit(2));
    assert_eq!(one, two);
    assert_eq!(one.save().unwrap(), two.save().unwrap());
}

#[test]
fn other_outputs_do_not_change_the_terms_of_one() {
    let (points, responses) = waves(70, 6);
    let all = fitted(&up_to(1, 6), &BOX, &points, &responses).unwrap();
    for o in 0..6 {
        let alone = fitted(&up_to(1, 6), &BOX, &points, &responses.select_columns(&[o])).unwrap();
        assert_eq!(alone.summary().degrees[0], all.summary().degrees[o]);
        let (one, many) = (alone.fit_error().relative[0], all.fit_error().relative[o]);
        assert!((one / many - 1.0).abs() < 1e-9);
    }
}

#[test]
fn saving_and_loading_keeps_every_bit() {
    let (points, responses) = waves(60, 5);
    let plugin = up_to(1, 6);
    let fit = fitted(&plugin, &BOX, &points, &responses).unwrap();
    let bytes = fit.save().unwrap();
    assert_eq!(Expansion::from_bytes(&bytes).unwrap(), fit);
    let loaded = plugin.load(&bytes).unwrap();
    assert_eq!(loaded.mean(&points), fit.mean(&points));
    assert_eq!(loaded.jacobian(points.row(3)), fit.jacobian(points.row(3)));
    for cut in [0, 10, 30, bytes.len() / 2, bytes.len() - 8, bytes.len() - 1] {
        assert!(plugin.load(&bytes[..cut]).is_err());
    }
}

#[test]
fn constant_outputs_have_their_mean_and_no_error() {
    let (points, mut responses) = waves(60, 4);
    for i in 0..60 {
        responses[(i, 0)] = 7.5;
        responses[(i, 1)] = 0.0;
        responses[(i, 2)] = 1e-19 * (i as f64).sin();
    }
    let fit = fitted(&up_to(1, 5), &BOX, &points, &responses).unwrap();
    assert_eq!(fit.fit_error().relative[..3], [0.0; 3]);
    assert!(fit.fit_error().relative[3] > 0.0);
    let mean = fit.mean(&points);
    assert!((0..60).all(|i| mean[(i, 0)] == 7.5 && mean[(i, 1)] == 0.0));
    assert!((0..60).all(|i| mean[(i, 2)].abs() < 1e-19));
    assert_eq!(fit.summary().constant, 3);
    let indices = fit.sensitivity().unwrap();
    assert!(indices.outputs.total.row(0).iter().all(|&s| s == 0.0));
    assert!(fit.facts().iter().any(|f| f.name.contains("do not vary") && f.value == "3"));
}

/// Rounding errors of 1e-15 of the response's scale before the pulse are not a signal, for any solver.
#[test]
fn a_channel_of_round_off_has_no_error() {
    let (points, mut responses) = waves(60, 4);
    let scale = responses.as_slice().iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    for i in 0..60 {
        responses[(i, 1)] = 1e-15 * scale * (7.0 * i as f64).sin();
    }
    for solver in [
        Solver::LeastAngleRegression,
        Solver::OrthogonalMatchingPursuit,
        Solver::SubspacePursuit,
        Solver::BayesianCompressiveSensing,
        Solver::LeastSquares,
    ] {
        let options = PolynomialChaos { solver, ..up_to(1, 4) };
        let fit = fitted(&options, &BOX, &points, &responses).unwrap();
        assert_eq!((fit.fit_error().relative[1], fit.summary().constant), (0.0, 1));
        assert!(fit.fit_error().relative[3] > 0.0);
    }
}

#[test]
fn fits_that_are_not_to_be_trusted_say_so() {
    let points = scaled(&monte_carlo(24, 3, 1), ISHIGAMI.ranges);
    let mut rng = Stream::root(4).generator();
    let noise = Matrix::from_fn(24, 2, |_, _| normal(&mut rng));
    let fit = fitted(&up_to(1, 4), ISHIGAMI.ranges, &points, &noise).unwrap();
    let told = |fit: &Expansion, what: &str| fit.facts().iter().any(|f| f.name.contains(what));
    assert_eq!(fit.summary().poor > 0, told(&fit, "no better than by their mean"));
    assert!(fit.fit_error().relative.iter().any(|e| *e >= 1.0) && fit.summary().poor > 0);
    let few = ISHIGAMI.fit(&up_to(1, 10), &sobol(50, 3));
    assert!(told(&few, "fewer than 3 runs per term"), "{:?}", few.facts());
    let many = ISHIGAMI.fit(&up_to(1, 10), &sobol(300, 3));
    assert!(!told(&many, "fewer than 3 runs per term"));
}

#[test]
fn the_emulator_is_its_linear_form_and_its_gradient_the_limit_of_differences() {
    let (points, responses) = waves(90, 6);
    let fit = fitted(&up_to(1, 8), &BOX, &points, &responses).unwrap();
    let linear = fit.linear().unwrap();
    let product = lacuna_linalg::multiply(&linear.basis(&points), linear.coefficients());
    assert_eq!(product, fit.mean(&points));
    let point = [0.4e7, 1.21e4, 1503.0];
    let jacobian = fit.jacobian(&point);
    for (i, range) in BOX.iter().enumerate() {
        let step = 1e-6 * (range[1] - range[0]);
        let at = |sign: f64| {
            let mut p = point;
            p[i] += sign * step;
            fit.mean(&Matrix::from_rows(3, [p]))
        };
        let (up, down) = (at(1.0), at(-1.0));
        for o in 0..6 {
            let difference = (up[(0, o)] - down[(0, o)]) / (2.0 * step);
            let scale = (range[1] - range[0]) / 10.0_f64.powi(o as i32 - 5);
            assert!((jacobian[(o, i)] - difference).abs() * scale < 1e-5);
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_with_their_place() {
    let (mut points, mut responses) = waves(20, 3);
    responses[(4, 1)] = f64::NAN;
    let stop = fitted(&up_to(1, 3), &BOX, &points, &responses).unwrap_err();
    assert_eq!(stop.message, "`strain` of run 5 at sensor `s1` is NaN");
    points[(2, 1)] = f64::INFINITY;
    let stop = fitted(&up_to(1, 3), &BOX, &points, &responses).unwrap_err();
    assert_eq!(stop.message, "parameter `x2` of run 3 is inf");
}

#[test]
fn least_squares_refuses_more_terms_than_runs() {
    let (points, responses) = waves(60, 2);
    let options = PolynomialChaos { solver: Solver::LeastSquares, ..of_degree(6) };
    let stop = fitted(&options, &BOX, &points, &responses).unwrap_err();
    assert_eq!(
        stop.message,
        "`surrogate.degree`: least squares of degree 6 has 84 terms, but there are only 60 runs"
    );
    assert!(stop.help.unwrap().starts_with("the largest degree that fits is 5;"));
    let adaptive = PolynomialChaos { solver: Solver::LeastSquares, ..up_to(1, 5) };
    let fit = fitted(&adaptive, &BOX, &points, &responses).unwrap();
    assert!(fit.summary().degrees.iter().all(|&p| p < 5));
}
