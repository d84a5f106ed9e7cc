//! Log densities compared with the distributions of the engine and with closed forms.

use super::*;
use crate::math::distribution::Distribution;

#[test]
fn densities_are_those_of_priors() {
    let cases = [
        ("normal_log_density(x, 1.2, 0.7)", Distribution::Normal([1.2, 0.7])),
        ("log_normal_log_density(x, 0.2, 0.7)", Distribution::LogNormal([0.2, 0.7])),
        ("student_t_log_density(x, 3.5, 0.2, 0.7)", Distribution::StudentT([3.5, 0.2, 0.7])),
        ("cauchy_log_density(x, 0.2, 0.7)", Distribution::StudentT([1.0, 0.2, 0.7])),
        ("exponential_log_density(x, 1.5)", Distribution::Exponential(1.5)),
        ("gamma_log_density(x, 2.5, 0.7)", Distribution::Gamma([2.5, 0.7])),
        ("inverse_gamma_log_density(x, 2.5, 0.7)", Distribution::InverseGamma([2.5, 0.7])),
        ("beta_log_density(x, 2.5, 0.7)", Distribution::Beta([2.5, 0.7, 0.0, 1.0])),
        ("beta_log_density(x, 1, 1)", Distribution::Uniform([0.0, 1.0])),
        ("uniform_log_density(x, -0.3, 0.6)", Distribution::Uniform([-0.3, 0.6])),
    ];
    for (text, law) in cases {
        let program = program(scope(&["x"]), text);
        for x in [-2.0, -0.1, 0.05, 0.4, 0.9, 1.7, 30.0] {
            let (value, slope) = program.gradient(&[x]);
            let expected = law.log_density(x);
            let same = value == expected || near(value, expected, 1e-12);
            assert!(same, "{text} at {x}: {value}, expected {expected}");
            let h = 1e-6;
            let difference = (law.log_density(x + h) - law.log_density(x - h)) / (2.0 * h);
            if expected.is_finite() {
                assert!(near(slope[0], difference, 1e-7), "{text} at {x}: {slope:?}");
            } else {
                assert_eq!(slope, [0.0], "{text} at {x}");
            }
        }
    }
}

#[test]
fn counts_have_the_probabilities_of_the_books() {
    for (text, probability) in [
        // Poisson: 2.5^3 e^-2.5 / 3!; for mean zero the count is zero with probability one.
        ("poisson_log_density(3, 2.5)", 2.5f64.powi(3) * (-2.5f64).exp() / 6.0),
        ("poisson_log_density(0, 0)", 1.0),
        ("poisson_log_density(1.5, 2)", 0.0),
        ("poisson_log_density(-1, 2)", 0.0),
        // Binomial: 10 choose 3, times 0.2^3 0.8^7.
        ("binomial_log_density(3, 10, 0.2)", 120.0 * 0.2f64.powi(3) * 0.8f64.powi(7)),
        ("binomial_log_density(10, 10, 1)", 1.0),
        ("binomial_log_density(0, 10, 0)", 1.0),
        ("binomial_log_density(11, 10, 0.2)", 0.0),
    ] {
        let value = program(scope(&[]), text).value(&[])[0].exp();
        assert!(near(value, probability, 1e-13), "{text}: {value}, expected {probability}");
    }
}

#[test]
fn parameters_that_make_no_distribution_are_undefined() {
    for text in [
        "normal_log_density(0, 0, -1)",
        "cauchy_log_density(0, 0, -1)",
        "exponential_log_density(1, -1)",
        "gamma_log_density(1, 2, -1)",
        "poisson_log_density(1, -1)",
        "binomial_log_density(1, 2, 1.5)",
    ] {
        assert!(program(scope(&[]), text).value(&[])[0].is_nan(), "{text}");
    }
}
