//! The likelihood against the dense multivariate normal density.
#![allow(clippy::unwrap_used)]

use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{Known, Likelihood};

use super::MultiplicativeGaussian;
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, Written, close, common, data, has_its_derivatives, options, random_matrix,
    shared,
};

const OPTIONS: &str =
    "relative = { half_normal = 1 }\nby = \"sensor\"\nfloor = { half_normal = 1 }";

fn build(text: &str, known: &Known<'_>) -> Box<dyn Likelihood> {
    let chosen: MultiplicativeGaussian = options("multiplicative_gaussian", text).unwrap();
    chosen.likelihood(known).unwrap()
}

#[test]
fn it_is_the_normal_density_written_out() {
    for seed in 0..5 {
        let (data, error) = (data(seed, 4), [common(seed + 1)]);
        let response = random_matrix(1, OUTPUTS, seed + 2);
        let m = response.row(0);
        let hyper = [0.3, 0.5, 0.7, 0.4];
        for error in [&[][..], &error[..]] {
            let likelihood = build(OPTIONS, &Known::without_slopes(&data, error));
            let variance = |i: usize| (hyper[i / TIMES] * m[i]).powi(2) + 0.16;
            let own = |i: usize, j: usize| if i == j { variance(i) } else { 0.0 };
            let written = Written::new(&data, m, shared(error), own);
            close(likelihood.log_likelihood(m, &hyper), written.log_density(), 1e-10);
            let left_out = likelihood.left_out(m, &hyper).unwrap();
            left_out.iter().zip(written.left_out()).for_each(|(f, e)| close(*f, e, 1e-9));
            has_its_derivatives(&*likelihood, m, &hyper);
        }
    }
}

#[test]
fn names_tell_the_groups_and_a_response_of_zero_needs_a_floor() {
    let data = data(1, 3);
    let known = Known::without_slopes(&data, &[]);
    let names: Vec<String> =
        build(OPTIONS, &known).hyperparameters().iter().map(|h| h.name.clone()).collect();
    assert_eq!(names, ["relative[B]", "relative[C]", "relative[G]", "floor"]);
    let without = build("relative = { known = 0.1 }", &known);
    assert_eq!(without.log_likelihood(&[0.0; OUTPUTS], &[]), f64::NEG_INFINITY);
    assert!(
        build("relative = { known = 0.1 }\nfloor = { known = 0.1 }", &known)
            .log_likelihood(&[0.0; OUTPUTS], &[])
            .is_finite()
    );
}
