//! Densities against scipy 1.17.1 (`multivariate_normal`, `multivariate_t`, `dirichlet`) and statsmodels 0.15.0 (Clayton,
//! Gumbel, Frank); slopes against finite differences; draws against Kendall's tau and moments in closed form.

#![allow(clippy::unreadable_literal, reason = "values as the reference prints them")]

use super::*;
use crate::math::random::Stream;

const POINTS: [[f64; 2]; 5] = [[0.1, 0.3], [0.5, 0.5], [0.9, 0.95], [0.02, 0.7], [0.999, 0.2]];

fn uniforms(count: usize) -> Vec<Distribution> {
    vec![Distribution::Uniform([0.0, 1.0]); count]
}

fn three() -> Correlation {
    let rows = [[1.0, 0.6, 0.1], [0.6, 1.0, -0.3], [0.1, -0.3, 1.0]];
    Correlation::new(rows.iter().map(|row| row.to_vec()).collect()).unwrap()
}

fn log_ratio(copula: &Copula, laws: &[Distribution], x: &[f64]) -> f64 {
    copula.log_ratio(&laws.iter().collect::<Vec<_>>(), x)
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance * (1.0 + expected.abs()),
        "{found} != {expected}"
    );
}

#[test]
fn densities_of_two_are_those_of_other_programs() {
    use Family::{Clayton, Frank, Gumbel};
    let two = || Correlation::of_two(0.6).unwrap();
    #[rustfmt::skip]
    let table = [
        (Copula::Archimedean(Clayton, 2.0), [-0.13543891185636703, 0.39271999938949786, 0.8320515105962121, -5.6564494900989075, -2.117462327576219]),
        (Copula::Archimedean(Clayton, 0.5), [0.13212296848699268, 0.07108223938085056, 0.332339054383088, -1.1244748823129145, -0.39864809604416696]),
        (Copula::Archimedean(Gumbel, 1.5), [0.2786495235600981, 0.19850119097700292, 1.064004924337553, -0.8121528809244909, -3.4200624203170418]),
        (Copula::Archimedean(Gumbel, 4.0), [-0.06724143969390362, 1.0568784395565074, 1.1786822026027295, -6.259251252419368, -21.09619877086005]),
        (Copula::Archimedean(Frank, 5.0), [0.3518092719147221, 0.38768376934879667, 1.049608193575267, -1.7887631530053874, -2.3789181889044366]),
        (Copula::Archimedean(Frank, 0.7), [0.1011995740417968, 0.010136008587316114, 0.23392551559978125, -0.15282301649051555, -0.229841532238253]),
        (Copula::StudentT(two(), 4.0), [0.22041275049159204, 0.34692499092831675, 1.0878854173234598, -1.5938901048225267, -2.1893662872216773]),
        (Copula::StudentT(two(), 1.5), [-0.051172877010543516, 0.5385670545686458, 1.178232937775527, -1.866440362806932, -3.24741590094858]),
    ];
    for (copula, expected) in table {
        for (point, expected) in POINTS.iter().zip(expected) {
            close(log_ratio(&copula, &uniforms(2), point), expected, 1e-9);
        }
    }
}

#[test]
fn densities_of_three_are_those_of_scipy() {
    let u = [0.1, 0.95, 0.4];
    close(log_ratio(&Copula::Gaussian(three()), &uniforms(3), &u), -3.7889639580263017, 1e-10);
    close(log_ratio(&Copula::StudentT(three(), 4.0), &uniforms(3), &u), -2.5048656825222917, 1e-10);
}

#[test]
fn normal_marginals_with_a_gaussian_copula_are_multivariate_normal() {
    let laws = [[1.0, 2.0], [-2.0, 0.5], [3.0, 1.0]].map(Distribution::Normal);
    let x = [2.5, -2.7, 3.2];
    let own: f64 = laws.iter().zip(x).map(|(law, x)| law.log_density(x)).sum();
    close(own + log_ratio(&Copula::Gaussian(three()), &laws, &x), -5.901602086222129, 1e-13);
    // Far in both tails, where probabilities have no digits left.
    let (two, far) = (Correlation::of_two(0.6).unwrap(), [1.0 + 2.0 * 12.0, -2.0 + 0.5 * 11.0]);
    let quadratic = (144.0 - 1.2 * 132.0 + 121.0) / 0.64 - 265.0;
    let expected = -0.5 * (quadratic + 0.64_f64.ln());
    close(log_ratio(&Copula::Gaussian(two), &laws[..2], &far), expected, 1e-13);
}

#[test]
fn shares_have_the_density_of_scipys_dirichlet() {
    for (concentrations, expected) in
        [(vec![2.0, 1.0, 1.0], 0.5877866649021188), (vec![2.5, 0.7, 3.1], -1.0034169790862162)]
    {
        let laws = Copula::marginals_of_shares(&concentrations);
        let x = [0.3, 0.5];
        let own: f64 = laws.iter().zip(x).map(|(law, x)| law.log_density(x)).sum();
        let copula = Copula::Dirichlet(concentrations);
        close(own + log_ratio(&copula, &laws, &x), expected, 1e-12);
        assert_eq!(log_ratio(&copula, &laws, &[0.6, 0.5]), f64::NEG_INFINITY);
    }
}

fn all() -> Vec<(Copula, Vec<Distribution>)> {
    let mixed = || {
        vec![
            Distribution::Gamma([2.0, 1.5]),
            Distribution::LogUniform([0.1, 10.0]),
            Distribution::Normal([1.0, 2.0]),
        ]
    };
    let two = || vec![Distribution::HalfNormal(2.0), Distribution::StudentT([5.0, 1.0, 2.0])];
    let of_two = |family, theta| (Copula::Archimedean(family, theta), two());
    let shares = vec![2.5, 0.7, 3.1];
    vec![
        (Copula::Gaussian(three()), mixed()),
        (Copula::StudentT(three(), 3.0), mixed()),
        of_two(Family::Clayton, 1.7),
        of_two(Family::Gumbel, 2.3),
        of_two(Family::Frank, 4.0),
        of_two(Family::Frank, -4.0),
        (Copula::Dirichlet(shares.clone()), Copula::marginals_of_shares(&shares)),
    ]
}

#[test]
fn slopes_are_those_of_finite_differences() {
    for (k, (copula, laws)) in all().into_iter().enumerate() {
        let laws: Vec<&Distribution> = laws.iter().collect();
        let mut rng = Stream::root(k as u64).generator();
        for _ in 0..50 {
            let x = copula.sample(&laws, &mut rng);
            let slopes = copula.gradient(&laws, &x);
            for j in 0..x.len() {
                let step = 1e-5 * x[j].abs().clamp(1e-3, 1.0);
                let at = |by: f64| {
                    let mut moved = x.clone();
                    moved[j] += by;
                    copula.log_ratio(&laws, &moved)
                };
                let difference = (at(-2.0 * step) - at(2.0 * step) + 8.0 * (at(step) - at(-step)))
                    / (12.0 * step);
                let tolerance = 1e-5 * (1.0 + slopes[j].abs());
                assert!(
                    (slopes[j] - difference).abs() < tolerance,
                    "{copula:?} at {x:?}, {j}: {} != {difference}",
                    slopes[j]
                );
            }
        }
    }
}

/// Number of draws.
const PAIRS: usize = 40_000;

/// The share of concordant pairs among independent pairs of draws is (1 + tau) / 2.
#[test]
fn draws_have_the_kendall_tau_of_the_copula() {
    let two = |r| Correlation::of_two(r).unwrap();
    let arc_sine = |r: f64| 2.0 / std::f64::consts::PI * r.asin();
    let of =
        |family: Family, theta: f64| (Copula::Archimedean(family, theta), family.kendall(theta));
    let cases = [
        (Copula::Gaussian(two(0.6)), arc_sine(0.6)),
        (Copula::StudentT(two(-0.5), 3.0), arc_sine(-0.5)),
        of(Family::Clayton, 2.0),
        of(Family::Gumbel, 1.5),
        of(Family::Gumbel, 4.0),
        of(Family::Frank, 5.0),
        of(Family::Frank, -3.0),
    ];
    let laws = [Distribution::Exponential(2.0), Distribution::Normal([1.0, 3.0])];
    let laws: Vec<&Distribution> = laws.iter().collect();
    for (k, (copula, tau)) in cases.into_iter().enumerate() {
        let mut rng = Stream::root(k as u64).named("tau").generator();
        let mut concordant = 0;
        let mut uniform = [Vec::new(), Vec::new()];
        for _ in 0..PAIRS {
            let (a, b) = (copula.sample(&laws, &mut rng), copula.sample(&laws, &mut rng));
            concordant += usize::from((a[0] - b[0]) * (a[1] - b[1]) > 0.0);
            for j in 0..2 {
                uniform[j].push(laws[j].cdf(a[j]));
            }
        }
        let (share, expected) = (concordant as f64 / PAIRS as f64, 0.5 * (1.0 + tau));
        let error = (expected * (1.0 - expected) / PAIRS as f64).sqrt();
        assert!((share - expected).abs() < 4.0 * error, "{copula:?}: {share} != {expected}");
        for sample in uniform {
            let sorted = crate::math::moments::sorted(&sample);
            let distance = crate::math::moments::kolmogorov_distance(&sorted, |u| u);
            let probability = crate::math::moments::kolmogorov_probability(distance, PAIRS as f64);
            assert!(probability > 1e-4, "{copula:?}: the marginal has p {probability}");
        }
    }
}

/// Kendall's tau of statsmodels 0.15.0, and the inverse.
#[test]
fn kendalls_tau_follows_from_theta_and_back() {
    for (family, theta, tau) in [
        (Family::Clayton, 2.0, 0.5),
        (Family::Gumbel, 1.5, 1.0 / 3.0),
        (Family::Frank, 5.0, 0.45670095816011336),
        (Family::Frank, 0.7, 0.07739981263620754),
    ] {
        close(family.kendall(theta), tau, 1e-10);
        close(family.theta(tau).unwrap(), theta, 1e-8);
    }
    close(Family::Frank.theta(-0.45670095816011336).unwrap(), -5.0, 1e-8);
    assert_eq!(Family::Clayton.theta(-0.2), None);
    assert_eq!(Family::Gumbel.theta(-0.2), None);
}

/// Number of draws.
const COUNT: usize = 40_000;

/// Means `a_i` / A and covariances of shares (Gelman et al., appendix A).
#[test]
fn shares_have_the_moments_of_a_dirichlet_distribution() {
    let a = [2.0, 1.0, 4.0];
    let (sum, copula) = (7.0, Copula::Dirichlet(a.to_vec()));
    let mut rng = Stream::root(5).generator();
    let draws: Vec<Vec<f64>> = (0..COUNT).map(|_| copula.sample(&[], &mut rng)).collect();
    let mean = |f: &dyn Fn(&[f64]) -> f64| draws.iter().map(|x| f(x)).sum::<f64>() / COUNT as f64;
    for j in 0..2 {
        let variance = a[j] * (sum - a[j]) / (sum * sum * (sum + 1.0));
        let error = (variance / COUNT as f64).sqrt();
        assert!((mean(&|x| x[j]) - a[j] / sum).abs() < 4.0 * error);
    }
    let covariance = mean(&|x| (x[0] - 2.0 / 7.0) * (x[1] - 1.0 / 7.0));
    let expected = -a[0] * a[1] / (sum * sum * (sum + 1.0));
    let spread = mean(&|x| ((x[0] - 2.0 / 7.0) * (x[1] - 1.0 / 7.0) - expected).powi(2)).sqrt();
    assert!((covariance - expected).abs() < 4.0 * spread / (COUNT as f64).sqrt());
}

#[test]
fn singular_and_indefinite_matrices_are_refused() {
    assert!(Correlation::of_two(1.0).is_none());
    assert!(Correlation::of_two(f64::NAN).is_none());
    let rows = [[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]];
    assert!(Correlation::new(rows.iter().map(|row| row.to_vec()).collect()).is_none());
}
