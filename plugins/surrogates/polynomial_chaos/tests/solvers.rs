//! The solvers against planted expansions, closed forms and published figures.

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Design, Emulator, Forward};
use lacuna_linalg::Matrix;

use super::bench::{
    BOREHOLE, ISHIGAMI, fitted_to, latin_hypercube, of_degree, parameters, parameters_of, scaled,
    sobol, up_to,
};
use crate::designs::quadrature::{Quadrature, Rule};
use crate::surrogates::polynomial_chaos::{
    Basis, Coordinate, Expansion, Family, PolynomialChaos, QNorm, QNormRange, Selection, Solver,
};

const SPARSE: [Solver; 4] = [
    Solver::LeastAngleRegression,
    Solver::OrthogonalMatchingPursuit,
    Solver::SubspacePursuit,
    Solver::BayesianCompressiveSensing,
];

const PLANTED: [(usize, f64); 5] = [(0, 3.0), (4, -1.25), (17, 0.5), (60, 2.0), (200, -0.75)];

/// Returns the planted expansion at some points and the exponents of its terms.
fn planted(parameters: &[Parameter], degree: usize, points: &Matrix) -> (Matrix, Vec<Vec<u16>>) {
    let coordinate = |p| Coordinate::new(Family::Auto, p, degree).unwrap();
    let terms = of_degree(degree).nested(parameters.len(), 1.0).terms;
    let exponents = PLANTED.iter().map(|(t, _)| terms.term(*t).to_vec()).collect();
    let chosen = terms.select(&PLANTED.map(|(t, _)| t));
    let values = Basis::new(parameters.iter().map(coordinate).collect(), chosen).values(points);
    let sum = |i: usize| values.row(i).iter().zip(PLANTED).map(|(psi, (_, c))| psi * c).sum();
    (Matrix::from_fn(points.rows(), 1, |i, _| sum(i)), exponents)
}

fn is_recovered(expansion: &Expansion, exponents: &[Vec<u16>]) {
    for t in 0..expansion.terms().len() {
        let place = exponents.iter().position(|e| e[..] == *expansion.terms().term(t));
        let expected = place.map_or(0.0, |k| PLANTED[k].1);
        let found = expansion.coefficients()[(t, 0)];
        assert!((found - expected).abs() < 1e-12, "{:?}: {found}", expansion.terms().term(t));
    }
    let all = (0..expansion.terms().len()).map(|t| expansion.terms().term(t));
    assert!(exponents.iter().all(|e| all.clone().any(|t| t == &e[..])));
}

#[test]
fn every_solver_recovers_a_planted_sparse_expansion() {
    let normal = Distribution::Normal([1.0, 2.0]);
    let mixed =
        [Distribution::Uniform([0.0, 2.0]), normal, Distribution::Beta([2.0, 3.0, 0.0, 1.0])];
    for parameters in [parameters(ISHIGAMI.ranges), parameters_of(&mixed)] {
        for seed in 0..3 {
            let unit = latin_hypercube(100, 3, seed);
            let points =
                Matrix::from_fn(100, 3, |i, j| parameters[j].design.quantile(unit[(i, j)]));
            let (responses, exponents) = planted(&parameters, 10, &points);
            for solver in SPARSE {
                let options = PolynomialChaos { solver, ..of_degree(10) };
                let fit = fitted_to(&options, &parameters, &points, &responses).unwrap();
                is_recovered(&fit, &exponents);
            }
        }
    }
    let parameters = parameters(ISHIGAMI.ranges);
    let points = scaled(&sobol(600, 3), ISHIGAMI.ranges);
    let (responses, exponents) = planted(&parameters, 10, &points);
    let options = PolynomialChaos { solver: Solver::LeastSquares, ..of_degree(10) };
    is_recovered(&fitted_to(&options, &parameters, &points, &responses).unwrap(), &exponents);
}

#[test]
fn few_terms_describe_ishigami() {
    // Source: UQLab's self-test with 150 Sobol' points and degree 10 keeps 23 terms by subspace pursuit and 20 by
    // Bayesian compressive sensing; 17 of the 286 terms are non-zero apart from rounding errors of the truncation.
    for (solver, least, most) in [
        (Solver::LeastAngleRegression, 12, 60),
        (Solver::OrthogonalMatchingPursuit, 12, 60),
        (Solver::SubspacePursuit, 12, 60),
        (Solver::BayesianCompressiveSensing, 12, 60),
    ] {
        let fit = ISHIGAMI.fit(&PolynomialChaos { solver, ..of_degree(10) }, &sobol(150, 3));
        let (terms, error) = (fit.summary().terms[0], ISHIGAMI.validation(&fit, 5_000));
        println!("{}: {terms} terms, {error:.1e}", solver.name());
        assert!((least..=most).contains(&terms), "{}: {terms} terms", solver.name());
        assert!(error < 1e-5, "{}: {error}", solver.name());
    }
}

#[test]
fn norms_are_chosen_for_each_output() {
    // An additive function needs the high degrees of a small norm; a product of all parameters the total degree.
    let unit = latin_hypercube(120, 3, 5);
    let points = scaled(&unit, &[[0.0, 1.0]; 3]);
    let responses = Matrix::from_fn(120, 2, |i, o| {
        let x = unit.row(i);
        if o == 0 { x.iter().map(|x| (7.0 * x).sin()).sum() } else { (x[0] + x[1] + x[2]).exp() }
    });
    let q_norm = QNorm::Range(QNormRange { min: 0.4, max: 1.0, step: 0.2 });
    let options = PolynomialChaos { q_norm: Some(q_norm), ..up_to(1, 14) };
    let parameters = parameters(&[[0.0, 1.0]; 3]);
    let both = fitted_to(&options, &parameters, &points, &responses).unwrap();
    let norms = &both.summary().q_norms;
    assert!(norms[0] < norms[1], "{norms:?}");
    for (o, &error) in both.fit_error().relative.iter().enumerate() {
        let one = fitted_to(&up_to(1, 14), &parameters, &points, &responses.select_columns(&[o]));
        assert!(error <= one.unwrap().fit_error().relative[0]);
    }
}

/// Compares the sets that are tried with their definition.
#[test]
fn sets_of_several_norms_are_those_of_each() {
    let options =
        PolynomialChaos { q_norm: Some(QNorm::List(vec![1.0, 0.5, 0.75])), ..up_to(2, 6) };
    let sets = options.sets(3);
    for set in &sets.sets {
        let nested = options.nested(3, set.q_norm);
        assert_eq!(set.members.len(), nested.counts[set.degree]);
        for (place, t) in set.members.iter().zip(0..) {
            assert_eq!(sets.terms.term(*place), nested.terms.term(t));
        }
        assert!((2..=6).contains(&set.degree));
    }
    let tried: Vec<_> = sets.sets.iter().map(|s| (s.degree, s.q_norm)).collect();
    assert!(tried.is_sorted() && tried.contains(&(6, 0.5)) && tried.contains(&(6, 1.0)));
    let alone = up_to(1, 6).sets(3);
    assert!(alone.sets.iter().all(|s| s.members.iter().copied().eq(0..s.members.len())));
}

fn nodes(design: &Quadrature, parameters: &[Parameter], count: usize) -> Matrix {
    let cube = design.place(parameters, count, &Stream::root(1)).unwrap();
    Matrix::from_fn(count, parameters.len(), |i, j| parameters[j].design.quantile(cube[(i, j)]))
}

#[test]
fn quadrature_finds_polynomials_of_its_level() {
    let laws = [
        Distribution::Uniform([2.0, 3.0]),
        Distribution::Normal([-1.0, 0.5]),
        Distribution::Exponential(2.0),
        Distribution::Triangular([0.0, 1.0, 5.0]),
    ];
    for (rule, d, level, count) in
        [(Rule::Tensor, 3, 4, 125), (Rule::Smolyak, 3, 4, 0), (Rule::Smolyak, 4, 3, 0)]
    {
        let parameters = parameters_of(&laws[..d]);
        let design = Quadrature { rule, level: Some(level), basis: Family::Auto };
        // The message contains the number of nodes.
        let count = if count > 0 {
            count
        } else {
            let stop = design.place(&parameters, 1, &Stream::root(1)).unwrap_err();
            stop.message
                .split(' ')
                .find_map(|word| word.parse().ok().filter(|&n: &usize| n > 9))
                .unwrap()
        };
        let points = nodes(&design, &parameters, count);
        let response = |x: &[f64]| 1.0 + x[0] * x[0] * x[1] + x[1].powi(3) - 0.1 * x[d - 1] * x[1];
        let responses = Matrix::from_fn(count, 1, |i, _| response(points.row(i)));
        let options = PolynomialChaos { solver: Solver::Quadrature, ..of_degree(3) };
        let fit = fitted_to(&options, &parameters, &points, &responses).unwrap();
        assert!(fit.fit_error().relative[0] < 1e-14, "{:?}", fit.fit_error().relative);
        assert!(fit.facts().iter().any(|f| f.value == format!("{}, level {level}", rule.name())));
        let unit = latin_hypercube(50, d, 2);
        let fresh = Matrix::from_fn(50, d, |i, j| laws[j].quantile(unit[(i, j)]));
        for (x, y) in fresh.iter_rows().zip(fit.mean(&fresh).as_slice()) {
            assert!((y - response(x)).abs() < 1e-7 * (1.0 + response(x).abs()));
        }
        // The fit is as good with the runs in another order, and an error if a node is missing.
        let order: Vec<usize> = (0..count).map(|i| (i * 7 + 3) % count).collect();
        if count % 7 != 0 {
            let (points, responses) = (points.select_rows(&order), responses.select_rows(&order));
            let again = fitted_to(&options, &parameters, &points, &responses).unwrap();
            assert!((again.coefficients()[(1, 0)] - fit.coefficients()[(1, 0)]).abs() < 1e-10);
        }
        let all: Vec<usize> = (1..count).collect();
        let (points, responses) = (points.select_rows(&all), responses.select_rows(&all));
        let stop = fitted_to(&options, &parameters, &points, &responses).unwrap_err();
        assert!(
            stop.message.contains("are not the nodes of a quadrature rule"),
            "{}",
            stop.message
        );
    }
}

#[test]
fn quadrature_judges_itself_like_weighted_least_squares_and_chooses_the_degree() {
    let parameters = parameters(&BOREHOLE.ranges[..3]);
    let response = |x: &[f64]| (x[0] / 0.15).exp() * (1.0 + x[1] / 5e4) + x[2] / 1e5;
    let points = nodes(&Quadrature::default(), &parameters, 125);
    let responses = Matrix::from_fn(125, 1, |i, _| response(points.row(i)));
    let options = PolynomialChaos { solver: Solver::Quadrature, ..up_to(1, 20) };
    let fit = fitted_to(&options, &parameters, &points, &responses).unwrap();
    assert!(fit.fit_error().relative[0] < 1e-5);
    // Tensor weights are positive: the leave-one-out residual is that of the weighted fit, here actually refitted.
    let own = Basis::new(fit.basis_coordinates(), fit.terms().clone());
    let psi = own.values(&points);
    let axes: Vec<_> = fit.basis_coordinates().iter().map(|c| c.recurrence(5)).collect();
    let rule = Rule::Tensor.nodes(&axes, 4, 125).unwrap();
    let left_out = 17;
    let keep: Vec<usize> = (0..125).filter(|&i| i != left_out).collect();
    let root = |i: usize| rule.weights[i].sqrt();
    let a = Matrix::from_fn(124, psi.columns(), |i, t| root(keep[i]) * psi[(keep[i], t)]);
    let b = Matrix::from_fn(124, 1, |i, _| root(keep[i]) * responses[(keep[i], 0)]);
    let solution = lacuna_linalg::least_squares(&a, &b).unwrap().solution;
    let predicted: f64 =
        psi.row(left_out).iter().zip(solution.as_slice()).map(|(p, c)| p * c).sum();
    let expected = responses[(left_out, 0)] - predicted;
    assert!((fit.fit_error().residuals[(left_out, 0)] - expected).abs() < 1e-10);
}

#[test]
fn k_fold_errors_are_those_of_parts_really_left_out() {
    use crate::surrogates::polynomial_chaos::judge::Criterion;
    let parameters = parameters(ISHIGAMI.ranges);
    let points = scaled(&latin_hypercube(90, 3, 8), ISHIGAMI.ranges);
    let responses = ISHIGAMI.values(&points);
    for solver in [Solver::LeastAngleRegression, Solver::LeastSquares, Solver::SubspacePursuit] {
        let selection = Selection::KFold(7);
        let options = PolynomialChaos { solver, selection, ..of_degree(5) };
        let fit = fitted_to(&options, &parameters, &points, &responses).unwrap();
        let Criterion::Folds(folds) = Criterion::new(selection, 90, &Stream::root(1)) else {
            panic!("folds")
        };
        let psi = Basis::new(fit.basis_coordinates(), fit.terms().clone()).values(&points);
        let mut squares = 0.0;
        for fold in &folds {
            let rest: Vec<usize> = (0..90).filter(|i| !fold.contains(i)).collect();
            let (a, b) = (psi.select_rows(&rest), responses.select_rows(&rest));
            let c = lacuna_linalg::least_squares(&a, &b).unwrap().solution;
            for &i in fold {
                let model: f64 = psi.row(i).iter().zip(c.as_slice()).map(|(p, c)| p * c).sum();
                squares += (responses[(i, 0)] - model).powi(2);
            }
        }
        let mean = responses.as_slice().iter().sum::<f64>() / 90.0;
        let total: f64 = responses.as_slice().iter().map(|y| (y - mean).powi(2)).sum();
        let ratio = fit.fit_error().relative[0] / (squares / total);
        assert!((ratio - 1.0).abs() < 1e-10, "{ratio}");
    }
}
