//! Figures computed by slow, independent textbook code: explicit inverses, the explicit hat matrix, runs actually
//! left out, and the equiangular vector of Efron et al. (2004), section 2, literally.

use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Emulator;
use lacuna::plugin::forward::Linear;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector};

use super::bench::{fitted, latin_hypercube, of_degree, scaled};
use crate::surrogates::polynomial_chaos::bayesian::Ascent;
use crate::surrogates::polynomial_chaos::dictionary::Dictionary;
use crate::surrogates::polynomial_chaos::judge::{Criterion, best_along};
use crate::surrogates::polynomial_chaos::least_angle::LeastAngle;
use crate::surrogates::polynomial_chaos::matching_pursuit::MatchingPursuit;
use crate::surrogates::polynomial_chaos::{EarlyStop, Expansion, PolynomialChaos, Solver};

pub(super) type Rows = Vec<Vec<f64>>;

/// Returns `A^-1` by Gauss-Jordan elimination with row pivoting.
fn inverse(a: &Rows) -> Rows {
    let n = a.len();
    let mut w: Rows = (0..n)
        .map(|i| a[i].iter().copied().chain((0..n).map(|j| f64::from(u8::from(i == j)))).collect())
        .collect();
    for c in 0..n {
        let pivot = (c..n).max_by(|&i, &j| w[i][c].abs().total_cmp(&w[j][c].abs())).unwrap();
        w.swap(c, pivot);
        let divisor = w[c][c];
        w[c].iter_mut().for_each(|x| *x /= divisor);
        for i in (0..n).filter(|&i| i != c) {
            let factor = w[i][c];
            let row = w[c].clone();
            w[i].iter_mut().zip(row).for_each(|(x, y)| *x -= factor * y);
        }
    }
    w.into_iter().map(|row| row[n..].to_vec()).collect()
}

fn product(a: &Rows, b: &Rows) -> Rows {
    let sum = |row: &Vec<f64>, j: usize| row.iter().zip(b).map(|(x, r)| x * r[j]).sum();
    a.iter().map(|row| (0..b[0].len()).map(|j| sum(row, j)).collect()).collect()
}

fn transpose(a: &Rows) -> Rows {
    (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
}

fn column(v: &[f64]) -> Rows {
    v.iter().map(|x| vec![*x]).collect()
}

/// `sqrt(2 n + 1) P_n(z)` by the explicit sum (Abramowitz and Stegun 22.3.8).
fn legendre(n: usize, z: f64) -> f64 {
    let choose =
        |n: usize, k: usize| (0..k).map(|i| (n - i) as f64 / (k - i) as f64).product::<f64>();
    let term = |k: usize| {
        (-1.0_f64).powi(k as i32)
            * choose(n, k)
            * choose(2 * n - 2 * k, n)
            * z.powi((n - 2 * k) as i32)
    };
    ((2 * n + 1) as f64).sqrt() * (0..=n / 2).map(term).sum::<f64>() / 2.0_f64.powi(n as i32)
}

pub(super) fn basis(exponents: &[Vec<u16>], unit: &Matrix) -> Rows {
    let value = |point: &[f64], e: &Vec<u16>| {
        point.iter().zip(e).map(|(u, &n)| legendre(usize::from(n), 2.0 * u - 1.0)).product()
    };
    unit.iter_rows().map(|p| exponents.iter().map(|e| value(p, e)).collect()).collect()
}

struct Textbook {
    coefficients: Vec<f64>,
    residuals: Vec<f64>,
    relative: f64,
}

/// Least squares through `(Psi' Psi)^-1` and the hat matrix.
fn textbook(psi: &Rows, y: &[f64]) -> Textbook {
    let (n, p) = (psi.len(), psi[0].len());
    let m = inverse(&product(&transpose(psi), psi));
    let solve = product(&m, &transpose(psi));
    let coefficients = product(&solve, &column(y));
    let hat = product(psi, &solve);
    let fitted = product(&hat, &column(y));
    let residuals: Vec<f64> = (0..n).map(|i| (y[i] - fitted[i][0]) / (1.0 - hat[i][i])).collect();
    let mean = y.iter().sum::<f64>() / n as f64;
    let variance = y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
    let trace: f64 = (0..p).map(|i| m[i][i]).sum();
    let t = n as f64 / (n - p) as f64 * (1.0 + trace);
    let relative = residuals.iter().map(|r| r * r).sum::<f64>() / n as f64 / variance * t;
    Textbook { coefficients: coefficients.into_iter().map(|c| c[0]).collect(), residuals, relative }
}

const BOX: [[f64; 2]; 2] = [[2.0, 6.0], [-1e-3, 4e-3]];

fn response(unit: &[f64], output: usize) -> f64 {
    let (a, b) = (unit[0], unit[1]);
    match output {
        0 => (5.0 * a * b).sin() + a,
        1 => (a - 0.4).abs() * (1.0 + b),
        _ => 1.0 + (-3.0 * a).exp() * (7.0 * b).cos(),
    }
}

fn runs(n: usize) -> (Matrix, Matrix) {
    let unit = latin_hypercube(n, 2, 4);
    let responses = Matrix::from_fn(n, 3, |i, o| response(unit.row(i), o));
    (unit, responses)
}

fn fit(options: &PolynomialChaos, unit: &Matrix, responses: &Matrix) -> Expansion {
    fitted(options, &BOX, &scaled(unit, &BOX), responses).unwrap()
}

/// Returns the exponents of an output's own terms and their coefficients.
fn own_terms(expansion: &Expansion, output: usize) -> (Vec<Vec<u16>>, Vec<f64>) {
    let terms = expansion.terms();
    (0..terms.len())
        .filter(|&t| expansion.coefficients()[(t, output)] != 0.0)
        .map(|t| (terms.term(t).to_vec(), expansion.coefficients()[(t, output)]))
        .unzip()
}

fn close(a: f64, b: f64, scale: f64) {
    assert!((a - b).abs() < 1e-10 * scale, "{a} against {b}");
}

#[test]
fn coefficients_and_errors_equal_the_explicit_ones() {
    let (unit, responses) = runs(60);
    for solver in [
        Solver::LeastAngleRegression,
        Solver::OrthogonalMatchingPursuit,
        Solver::SubspacePursuit,
        Solver::BayesianCompressiveSensing,
        Solver::LeastSquares,
    ] {
        let expansion = fit(&PolynomialChaos { solver, ..of_degree(6) }, &unit, &responses);
        for o in 0..3 {
            let (exponents, coefficients) = own_terms(&expansion, o);
            let slow = textbook(&basis(&exponents, &unit), &responses.column(o));
            for (c, s) in coefficients.iter().zip(&slow.coefficients) {
                close(*c, *s, slow.coefficients[0].abs().max(1.0));
            }
            close(expansion.fit_error().relative[o] / slow.relative, 1.0, 1.0);
            for (i, r) in slow.residuals.iter().enumerate() {
                close(
                    expansion.fit_error().residuals[(i, o)],
                    *r,
                    responses[(0, o)].abs().max(1.0),
                );
            }
        }
    }
}

#[test]
fn leave_one_out_residuals_are_those_of_runs_really_left_out() {
    let (unit, responses) = runs(30);
    let expansion = fit(&of_degree(3), &unit, &responses);
    let (exponents, _) = own_terms(&expansion, 0);
    let psi = basis(&exponents, &unit);
    let y = responses.column(0);
    for left_out in [0, 7, 29] {
        let keep = |i: &usize| *i != left_out;
        let rest: Rows = (0..30).filter(keep).map(|i| psi[i].clone()).collect();
        let values: Vec<f64> = (0..30).filter(keep).map(|i| y[i]).collect();
        let model = textbook(&rest, &values).coefficients;
        let predicted: f64 = psi[left_out].iter().zip(&model).map(|(p, c)| p * c).sum();
        close(expansion.fit_error().residuals[(left_out, 0)], y[left_out] - predicted, 1.0);
    }
}

/// Returns the order in which terms enter, from the definition: at each step the equiangular vector of the active
/// columns through an explicit inverse, and the residual itself.
pub(super) fn slow_path(psi: &Rows, y: &[f64], steps: usize) -> Vec<usize> {
    let n = y.len();
    let standardised: Rows = transpose(psi)
        .into_iter()
        .map(|column| {
            let mean = column.iter().sum::<f64>() / n as f64;
            let length = column.iter().map(|x| (x - mean).powi(2)).sum::<f64>().sqrt();
            column.iter().map(|x| if length > 0.0 { (x - mean) / length } else { 0.0 }).collect()
        })
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mean = y.iter().sum::<f64>() / n as f64;
    let mut residual: Vec<f64> = y.iter().map(|v| v - mean).collect();
    let mut active: Vec<usize> = Vec::new();
    while active.len() < steps {
        let c: Vec<f64> = standardised.iter().map(|x| dot(x, &residual)).collect();
        let candidates = || (1..c.len()).filter(|j| !active.contains(j));
        if active.is_empty() {
            active.push(candidates().max_by(|&i, &j| c[i].abs().total_cmp(&c[j].abs())).unwrap());
            continue;
        }
        let level = active.iter().map(|&j| c[j].abs()).fold(0.0, f64::max);
        let signed: Rows = (active.iter())
            .map(|&j| standardised[j].iter().map(|x| x * c[j].signum()).collect())
            .collect();
        let inverse = inverse(&product(&signed, &transpose(&signed)));
        let sums: Vec<f64> = inverse.iter().map(|row| row.iter().sum()).collect();
        let size = sums.iter().sum::<f64>().sqrt().recip();
        let weights: Vec<f64> = sums.iter().map(|s| s * size).collect();
        let direction: Vec<f64> = product(&vec![weights], &signed).remove(0);
        let arrival = |&j: &usize| {
            let a = dot(&standardised[j], &direction);
            [(level - c[j]) / (size - a), (level + c[j]) / (size + a)]
                .into_iter()
                .filter(|g| *g > 1e-14)
                .fold(f64::INFINITY, f64::min)
        };
        let next = candidates().min_by(|i, j| arrival(i).total_cmp(&arrival(j))).unwrap();
        let distance = arrival(&next);
        residual.iter_mut().zip(direction).for_each(|(r, d)| *r -= distance * d);
        active.push(next);
    }
    active
}

#[test]
fn the_chosen_terms_are_the_best_along_the_explicit_path() {
    let (unit, responses) = runs(60);
    let early_stop = EarlyStop { degrees: 0, terms: 0 };
    let expansion = fit(&PolynomialChaos { early_stop, ..of_degree(7) }, &unit, &responses);
    let all: Vec<Vec<u16>> =
        (0..8_u16).flat_map(|p| (0..=p).map(move |j| vec![p - j, j])).collect();
    let psi = basis(&all, &unit);
    for o in 0..3 {
        let y = responses.column(o);
        let path = slow_path(&psi, &y, all.len() - 1);
        let own = |k: usize| {
            let mut terms: Vec<usize> = std::iter::once(0).chain(path[..k].to_vec()).collect();
            terms.sort_unstable();
            terms
        };
        let error = |k: &usize| {
            let terms = own(*k);
            let columns: Rows =
                psi.iter().map(|row| terms.iter().map(|&t| row[t]).collect()).collect();
            textbook(&columns, &y).relative
        };
        let best = (1..=path.len()).min_by(|i, j| error(i).total_cmp(&error(j))).unwrap();
        let mut expected: Vec<Vec<u16>> = own(best).into_iter().map(|t| all[t].clone()).collect();
        let (mut chosen, _) = own_terms(&expansion, o);
        expected.sort();
        chosen.sort();
        assert_eq!(chosen, expected, "output {o}");
        close(expansion.fit_error().relative[o] / error(&best), 1.0, 1.0);
    }
}

#[test]
fn terms_enter_in_the_order_of_the_explicit_path_when_there_are_more_terms_than_runs() {
    let unit = latin_hypercube(150, 3, 9);
    let exponents: Vec<Vec<u16>> = (0..11_u16)
        .flat_map(|p| (0..=p).flat_map(move |j| (0..=j).map(move |k| vec![p - j, j - k, k])))
        .collect();
    let psi = basis(&exponents, &unit);
    let dictionary = Dictionary::new(&Matrix::from_rows(exponents.len(), &psi), None, false);
    for seed in 0..3 {
        // A dense sum of all terms, so that many enter before the best fit.
        let mut rng = Stream::root(seed).generator();
        let size = |e: &Vec<u16>| (-0.8 * f64::from(e.iter().sum::<u16>())).exp();
        let weights: Vec<f64> = exponents.iter().map(|e| size(e) * normal(&mut rng)).collect();
        let y: Vec<f64> =
            psi.iter().map(|row| row.iter().zip(&weights).map(|(p, w)| p * w).sum()).collect();
        let mean = y.iter().sum::<f64>() / 150.0;
        let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
        let correlations = multiply_vector(dictionary.columns(), &centred);
        let all = dictionary.subset(&(0..exponents.len()).collect::<Vec<_>>());
        let mut path = LeastAngle::new(&dictionary, &all, &correlations);
        let choice =
            best_along(&mut path, &centred, &Criterion::LeaveOneOut, 148, usize::MAX).unwrap();
        assert!(choice.terms.len() > 25, "only {} terms", choice.terms.len());
        assert_eq!(choice.terms, slow_path(&psi, &y, choice.terms.len()), "seed {seed}");
    }
}

/// Returns the order in which terms enter by matching pursuit, from the definition: the residual of an explicit
/// least-squares fit at each step.
fn slow_pursuit(psi: &Rows, y: &[f64], steps: usize) -> Vec<usize> {
    let n = y.len() as f64;
    let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
    let columns = transpose(psi);
    let mut active = vec![0];
    while active.len() <= steps {
        let own: Rows = psi.iter().map(|row| active.iter().map(|&t| row[t]).collect()).collect();
        let c = textbook(&own, y).coefficients;
        let residual: Vec<f64> = (own.iter().zip(y))
            .map(|(row, y)| y - row.iter().zip(&c).map(|(p, c)| p * c).sum::<f64>())
            .collect();
        let correlation = |t: &usize| {
            let m = mean(&columns[*t]);
            let length = columns[*t].iter().map(|x| (x - m).powi(2)).sum::<f64>().sqrt();
            let sum: f64 = columns[*t].iter().zip(&residual).map(|(x, r)| (x - m) * r).sum();
            (sum / length).abs()
        };
        let open = (1..columns.len()).filter(|t| !active.contains(t));
        active.push(open.max_by(|a, b| correlation(a).total_cmp(&correlation(b))).unwrap());
    }
    active[1..].to_vec()
}

#[test]
fn matching_pursuit_follows_the_explicit_one() {
    let (unit, responses) = runs(60);
    let all: Vec<Vec<u16>> =
        (0..8_u16).flat_map(|p| (0..=p).map(move |j| vec![p - j, j])).collect();
    let psi = basis(&all, &unit);
    let dictionary = Dictionary::new(&Matrix::from_rows(all.len(), &psi), None, true);
    for o in 0..3 {
        let y = responses.column(o);
        let mean = y.iter().sum::<f64>() / 60.0;
        let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
        let correlations = multiply_vector(dictionary.columns(), &centred);
        let mut path = MatchingPursuit::new(&dictionary, &correlations);
        let window = usize::MAX;
        let choice = best_along(&mut path, &centred, &Criterion::LeaveOneOut, 25, window).unwrap();
        let slow = slow_pursuit(&psi, &y, choice.terms.len());
        assert_eq!(choice.terms, slow, "output {o}");
        let mut own: Vec<usize> = slow.into_iter().chain([0]).collect();
        own.sort_unstable();
        let columns: Rows = psi.iter().map(|row| own.iter().map(|&t| row[t]).collect()).collect();
        close(choice.error / textbook(&columns, &y).relative, 1.0, 1.0);
    }
}

/// At its maximum the marginal likelihood `-(ln |C| + y' C^-1 y) / 2` of the weights' variances, computed densely,
/// decreases if any variance is changed, a term removed, or one added.
#[test]
fn bayesian_sensing_ends_at_a_maximum_of_the_marginal_likelihood() {
    let (unit, responses) = runs(40);
    let all: Vec<Vec<u16>> =
        (0..5_u16).flat_map(|p| (0..=p).map(move |j| vec![p - j, j])).collect();
    let psi = basis(&all, &unit);
    let dictionary = Dictionary::new(&Matrix::from_rows(all.len(), &psi), None, true);
    let y = responses.column(2);
    let mean = y.iter().sum::<f64>() / 40.0;
    let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
    let correlations = multiply_vector(dictionary.columns(), &centred);
    let noise = 0.1 * centred.iter().map(|v| v * v).sum::<f64>() / 40.0;
    let open: Vec<bool> = dictionary.varies().collect();
    let gram = dictionary.gram();
    let found = Ascent::new(&gram, &open, &correlations, noise).run(30);
    let evidence = |variances: &[f64]| {
        let covariance = Matrix::from_fn(40, 40, |i, j| {
            let column = |t: usize| dictionary.columns()[(t, i)] * dictionary.columns()[(t, j)];
            let sum: f64 = variances.iter().enumerate().map(|(t, v)| v * column(t)).sum();
            sum + if i == j { noise } else { 0.0 }
        });
        let factor = Cholesky::new(&covariance).unwrap();
        -factor.log_determinant() - factor.quadratic(&centred)
    };
    let mut variances = vec![0.0; all.len()];
    for (&t, alpha) in found.active.iter().zip(&found.alpha) {
        variances[t] = alpha.recip();
    }
    let best = evidence(&variances);
    assert!((2..14).contains(&found.active.len()), "{}", found.active.len());
    for t in 1..all.len() {
        let own = variances[t];
        let others = if own > 0.0 { [0.0, 0.7 * own, 1.4 * own] } else { [1e-6, 1e-3, 1e-1] };
        for other in others {
            variances[t] = other;
            assert!(evidence(&variances) < best + 1e-3, "term {t}: {own} {other}");
        }
        variances[t] = own;
    }
}
