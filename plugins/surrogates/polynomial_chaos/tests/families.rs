//! Families of polynomials against their closed forms.

use lacuna::math::distribution::Distribution;
use lacuna::math::special::ln_gamma;
use lacuna_linalg::Matrix;
use lacuna_linalg::lanes::LANES;

use super::bench::parameter;
use crate::surrogates::polynomial_chaos::{Coordinate, Family, Recurrence, measure};

fn coordinate(family: Family, design: Distribution, degree: usize) -> Coordinate {
    Coordinate::new(family, &parameter("x1", design), degree).unwrap()
}

fn gamma(x: f64) -> f64 {
    ln_gamma(x).exp()
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * expected.abs().max(1.0), "{found} {expected}");
}

/// Asserts values and slopes of degree 2, 3, 4, 6 (as many as given), each up to its sign.
fn agrees(coordinate: &Coordinate, z: f64, expected: &[(usize, f64, f64)]) {
    let (mut p, mut d, mut alone) = ([0.0; 7], [0.0; 7], [0.0; 7]);
    coordinate.derivatives(z, &mut p, &mut d);
    coordinate.polynomials(z, &mut alone);
    assert_eq!(p, alone);
    for &(n, value, slope) in expected {
        close(p[n], value, 1e-12);
        close(d[n], slope, 1e-11);
    }
}

#[test]
fn legendre_polynomials_have_their_closed_forms() {
    // Source: Abramowitz and Stegun, table 22.9.
    let legendre = coordinate(Family::Auto, Distribution::Uniform([-1.0, 1.0]), 6);
    assert_eq!(legendre, Coordinate::legendre(0.0, 1.0));
    let norm = |n: usize| ((2 * n + 1) as f64).sqrt();
    for i in 0..=20 {
        let z = -1.2 + 0.12 * f64::from(i);
        let [z2, z3, z4] = [z * z, z.powi(3), z.powi(4)];
        let p6 = (231.0 * z4 * z2 - 315.0 * z4 + 105.0 * z2 - 5.0) / 16.0;
        let d6 = (1386.0 * z4 * z - 1260.0 * z3 + 210.0 * z) / 16.0;
        let four = ((35.0 * z4 - 30.0 * z2 + 3.0) / 8.0, (140.0 * z3 - 60.0 * z) / 8.0);
        let expected = [
            (2, norm(2) * (3.0 * z2 - 1.0) / 2.0, norm(2) * 3.0 * z),
            (3, norm(3) * (5.0 * z3 - 3.0 * z) / 2.0, norm(3) * (15.0 * z2 - 3.0) / 2.0),
            (4, norm(4) * four.0, norm(4) * four.1),
            (6, norm(6) * p6, norm(6) * d6),
        ];
        agrees(&legendre, z, &expected);
    }
}

#[test]
fn hermite_and_laguerre_polynomials_have_their_closed_forms() {
    // Source: Abramowitz and Stegun, tables 22.13 and 22.10; n! is the square of He_n's length.
    let hermite = coordinate(Family::Auto, Distribution::Normal([0.0, 1.0]), 6);
    let laguerre = coordinate(Family::Auto, Distribution::Exponential(1.0), 6);
    assert_eq!((hermite.family(), laguerre.family()), (Family::Hermite, Family::Laguerre));
    for i in 0..=20 {
        let z = -3.0 + 0.4 * f64::from(i);
        let [z2, z3, z4, z6] = [z * z, z.powi(3), z.powi(4), z.powi(6)];
        let lengths = [2.0_f64.sqrt(), 6.0_f64.sqrt(), 24.0_f64.sqrt(), 720.0_f64.sqrt()];
        let expected = [
            (2, (z2 - 1.0) / lengths[0], 2.0 * z / lengths[0]),
            (3, (z3 - 3.0 * z) / lengths[1], (3.0 * z2 - 3.0) / lengths[1]),
            (4, (z4 - 6.0 * z2 + 3.0) / lengths[2], (4.0 * z3 - 12.0 * z) / lengths[2]),
            (
                6,
                (z6 - 15.0 * z4 + 45.0 * z2 - 15.0) / lengths[3],
                (6.0 * z4 * z - 60.0 * z3 + 90.0 * z) / lengths[3],
            ),
        ];
        agrees(&hermite, z, &expected);
        let z = z + 3.0;
        let [z2, z3, z4] = [z * z, z.powi(3), z.powi(4)];
        let four = (z4 - 16.0 * z3 + 72.0 * z2 - 96.0 * z + 24.0) / 24.0;
        let expected = [
            (2, 0.5 * (z2 - 4.0 * z + 2.0), z - 2.0),
            (3, (z3 - 9.0 * z2 + 18.0 * z - 6.0) / 6.0, 0.5 * (z2 - 6.0 * z + 6.0)),
            (4, four, (z3 - 12.0 * z2 + 36.0 * z - 24.0) / 6.0),
        ];
        agrees(&laguerre, z, &expected);
    }
}

#[test]
fn jacobi_polynomials_have_their_closed_form() {
    // Source: Abramowitz and Stegun 22.3.1 and 22.2.1.
    for [a, b] in [[2.0, 3.5], [0.5, 0.5], [1.0, 1.0], [4.0, 0.7]] {
        let jacobi = coordinate(Family::Auto, Distribution::Beta([a, b, -1.0, 1.0]), 6);
        let (alpha, beta) = (b - 1.0, a - 1.0);
        let choose = |x: f64, k: f64| gamma(x + 1.0) / gamma(k + 1.0) / gamma(x - k + 1.0);
        let mut p = [0.0; 7];
        for z in [-0.95, -0.4, 0.0, 0.3, 0.99_f64] {
            jacobi.polynomials(z, &mut p);
            for n in 1..=6_i32 {
                let x = f64::from(n);
                let term = |m: i32| {
                    choose(x + alpha, f64::from(m))
                        * choose(x + beta, f64::from(n - m))
                        * (z - 1.0).powi(n - m)
                        * (z + 1.0).powi(m)
                };
                let plain: f64 = (0..=n).map(term).sum::<f64>() / 2.0_f64.powi(n);
                let square = gamma(x + a) * gamma(x + b) * gamma(a + b)
                    / ((2.0 * x + a + b - 1.0) * gamma(x + 1.0) * gamma(x + a + b - 1.0))
                    / (gamma(a) * gamma(b));
                close(p[n as usize], plain / square.sqrt(), 1e-11);
            }
        }
    }
}

#[test]
fn the_procedure_of_stieltjes_finds_the_classical_recurrences() {
    // Source: the closed forms of the recurrences (Abramowitz and Stegun 22.7; Szegő 2.7 for the log-normal
    // distribution).
    let degree = 12;
    for (design, centre, scale, closed) in [
        (Distribution::Uniform([2.0, 6.0]), 4.0, 2.0, Recurrence::legendre(degree)),
        (Distribution::Normal([-3.0, 0.1]), -3.0, 0.1, Recurrence::hermite(degree)),
        (Distribution::Exponential(5.0), 0.0, 5.0, Recurrence::laguerre(degree, 1.0)),
        (Distribution::Gamma([2.5, 1e-3]), 0.0, 1e-3, Recurrence::laguerre(degree, 2.5)),
        (Distribution::Beta([2.0, 3.0, 0.0, 2.0]), 1.0, 1.0, Recurrence::jacobi(degree, 2.0, 3.0)),
        (
            Distribution::LogNormal([1.0, 0.2]),
            0.0,
            1.0_f64.exp(),
            Recurrence::stieltjes_wigert(degree, 0.2),
        ),
    ] {
        let found = measure::recurrence(&design, degree, centre, scale);
        let sizes = found.sizes.iter().zip(&closed.sizes);
        for ((size, expected), (a, b)) in sizes.zip(found.centres.iter().zip(&closed.centres)) {
            assert!((size / expected - 1.0).abs() < 1e-12, "{design}: {size} {expected}");
            assert!((a - b).abs() < 1e-12 * expected.max(b.abs()), "{design}: {a} {b}");
        }
    }
}

/// With `z` of mean 0 and variance 1, `a_1` is the skewness and `b_2 = kurtosis - skewness^2 - 1`.
#[test]
fn arbitrary_polynomials_have_the_moments_of_their_law() {
    // Source: skewness and kurtosis as in Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions.
    let pi = std::f64::consts::PI;
    let (a, c, b) = (1.0, 2.0, 5.0_f64);
    let spread = a * a + b * b + c * c - a * b - a * c - b * c;
    let skew = 2.0_f64.sqrt() * (a + b - 2.0 * c) * (2.0 * a - b - c) * (a - 2.0 * b + c)
        / (5.0 * spread.powf(1.5));
    let moment = |k: i32| (8.0_f64.powi(k) - 1.0) / (f64::from(k) * 8.0_f64.ln());
    let (mean, variance) = (moment(1), moment(2) - moment(1).powi(2));
    let third = (moment(3) - 3.0 * mean * moment(2) + 2.0 * mean.powi(3)) / variance.powf(1.5);
    let fourth = (moment(4) - 4.0 * mean * moment(3) + 6.0 * mean * mean * moment(2)
        - 3.0 * mean.powi(4))
        / variance.powi(2);
    let half =
        (2.0_f64.sqrt() * (4.0 - pi) / (pi - 2.0).powf(1.5), 8.0 * (pi - 3.0) / (pi - 2.0).powi(2));
    for (design, skewness, kurtosis) in [
        (Distribution::Triangular([a, c, b]), skew, 2.4),
        (Distribution::LogUniform([1.0, 8.0]), third, fourth),
        (Distribution::HalfNormal(3.0), half.0, 3.0 + half.1),
        (Distribution::TruncatedNormal([0.0, 3.0, 0.0, f64::INFINITY]), half.0, 3.0 + half.1),
        (Distribution::TruncatedNormal([-900.0, 1.0, 0.0, f64::INFINITY]), 2.0, 9.0),
        (Distribution::StudentT([9.0, 4.0, 0.5]), 0.0, 3.0 + 6.0 / 5.0),
        (
            Distribution::InverseGamma([7.0, 2.0]),
            4.0 * 5.0_f64.sqrt() / 4.0,
            3.0 + 6.0 * (35.0 - 11.0) / (4.0 * 3.0),
        ),
    ] {
        let tolerance = if matches!(design, Distribution::TruncatedNormal([-900.0, ..])) {
            1e-4
        } else {
            1e-11
        };
        let found = coordinate(Family::Auto, design.clone(), 2);
        assert_eq!(found.family(), Family::Arbitrary);
        let Recurrence { centres, sizes } = found.recurrence(2);
        assert!(centres[0].abs() < tolerance && (sizes[0] - 1.0).abs() < tolerance, "{design}");
        close(centres[1], skewness, tolerance);
        close(sizes[1].powi(2), kurtosis - skewness * skewness - 1.0, tolerance);
    }
}

#[test]
fn polynomials_are_orthonormal_under_gauss_rules() {
    for design in [
        Distribution::Uniform([-1.0, 1.0]),
        Distribution::Normal([2.0, 3.0]),
        Distribution::Gamma([3.0, 2.0]),
        Distribution::Beta([2.0, 1.5, 0.0, 1.0]),
        Distribution::LogUniform([1.0, 100.0]),
        Distribution::Triangular([0.0, 1.0, 4.0]),
    ] {
        let c = coordinate(Family::Auto, design, 22);
        let mut p = [0.0; 21];
        let mut products = Matrix::zeros(21, 21);
        for (z, weight) in c.recurrence(22).gauss(21).unwrap() {
            c.polynomials(z, &mut p);
            for i in 0..21 {
                for j in 0..21 {
                    products[(i, j)] += weight * p[i] * p[j];
                }
            }
        }
        for i in 0..21 {
            for j in 0..21 {
                assert!((products[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-10);
            }
        }
    }
}

#[test]
fn products_of_polynomials_are_the_sums_of_their_weights() {
    for family in [Family::Legendre, Family::Hermite] {
        let design = Distribution::Normal([0.0, 1.0]);
        let c = if family == Family::Hermite {
            coordinate(family, design, 20)
        } else {
            Coordinate::legendre(0.0, 1.0)
        };
        let mut psi = [0.0; 41];
        for z in [-1.0, -0.9, -0.33, 0.0, 0.25, 0.77, 1.0] {
            let z = z * family.reach();
            c.polynomials(z, &mut psi);
            for m in 0..=20 {
                for n in 0..=20 {
                    let weights = family.product(m, n).unwrap();
                    assert!(weights.iter().all(|w| *w > 0.0));
                    let terms = weights.iter().enumerate().map(|(r, w)| w * psi[m + n - 2 * r]);
                    let size: f64 = terms.clone().map(f64::abs).sum();
                    let (sum, product) = (terms.sum::<f64>(), psi[m] * psi[n]);
                    assert!(
                        (sum - product).abs()
                            < 1e-12 * size.max(((2 * m + 1) * (2 * n + 1)) as f64)
                    );
                }
            }
        }
    }
    assert!(Family::Jacobi.product(2, 3).is_none());
}

#[test]
fn forced_families_transform_the_design() {
    let designs = [
        Distribution::Uniform([1.0, 3.0]),
        Distribution::Normal([5.0, 0.2]),
        Distribution::LogNormal([0.0, 0.5]),
        Distribution::LogUniform([0.1, 30.0]),
        Distribution::TruncatedNormal([0.0, 1.0, -1.0, f64::INFINITY]),
        Distribution::StudentT([3.0, 0.0, 2.0]),
        Distribution::Gamma([3.0, 2.0]),
        Distribution::Beta([2.0, 5.0, 0.0, 4.0]),
    ];
    let families = [Family::Legendre, Family::Hermite, Family::Laguerre, Family::Jacobi];
    for (design, family) in designs.iter().flat_map(|d| families.map(|f| (d, f))) {
        let c = coordinate(family, design.clone(), 5);
        assert_eq!(c.family(), family);
        for p in [0.02, 0.3, 0.5, 0.9, 0.99] {
            let x = design.quantile(p);
            let z = c.standard(x);
            let law = match family {
                Family::Legendre => 0.5 * (1.0 + z),
                Family::Hermite => Distribution::Normal([0.0, 1.0]).cdf(z),
                _ => p,
            };
            assert!((law - p).abs() < 1e-12, "{design} {family:?}: {law} {p}");
            assert!((c.parameter(z) / x - 1.0).abs() < 1e-9 || (c.parameter(z) - x).abs() < 1e-9);
            let step = 1e-5 * x.abs().max(0.1);
            let slope = (c.standard(x + step) - c.standard(x - step)) / (2.0 * step);
            assert!((slope * c.stretch(x) - 1.0).abs() < 1e-5, "{design} {family:?} at {x}");
        }
        // Beyond the support the transformed variable stays at its bound.
        for x in [-1e30, -7.0, 0.0, 1e30] {
            let inside = design.support().0 < x && x < design.support().1;
            let z = c.standard(x);
            assert!(z.is_finite() || inside);
            if !inside && c.stretch(x).is_infinite() {
                let bound = if x <= design.support().0 { -1e200 } else { 1e200 };
                assert_eq!(z, c.standard(bound));
            }
        }
    }
}

#[test]
fn laws_with_few_moments_say_so() {
    let t = parameter("x1", Distribution::StudentT([5.0, 0.0, 1.0]));
    assert!(Coordinate::new(Family::Auto, &t, 2).is_ok());
    assert_eq!(
        Coordinate::new(Family::Auto, &t, 3).unwrap_err(),
        "the design of parameter `x1` (Student t with 5 degrees of freedom, location 0, scale 1) has \
         orthogonal polynomials up to degree 2 only, not 3"
    );
    assert!(Coordinate::new(Family::Hermite, &t, 20).is_ok());
    let none = parameter("x1", Distribution::Uniform([2.0, 2.0]));
    let fault = Coordinate::new(Family::Auto, &none, 3).unwrap_err();
    assert_eq!(
        fault,
        "the design of parameter `x1`: expected the lower bound below the upper, found [2, 2]"
    );
}

#[test]
fn values_side_by_side_have_the_bits_of_single_ones() {
    let coordinate = Coordinate::legendre(0.3, 1.7);
    let points: Vec<f64> = (0..LANES).map(|l| -1.4 + 0.21 * l as f64).collect();
    let mut table = [[0.0; LANES]; 21];
    coordinate.values(points.iter().copied(), &mut table);
    for (l, x) in points.iter().enumerate() {
        let mut single = [0.0; 21];
        coordinate.polynomials(coordinate.standard(*x), &mut single);
        assert!(table.iter().zip(single).all(|(row, value)| row[l] == value));
    }
}
