//! The likelihood against the dense normal density and a closed form.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{Known, Likelihood};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::bias::EmbeddedBias;
use super::{Biased, Embedded};
use crate::discrepancies::common::testing::{
    OUTPUTS, Written, close, common, data, has_its_derivatives, options, random_matrix, shared,
};

/// Per prior standard deviation.
#[expect(clippy::unnecessary_wraps, reason = "slopes may fail where a study computes them")]
fn slopes() -> Result<Matrix, Stop> {
    Ok(random_matrix(OUTPUTS, 3, 77))
}

/// Priors of the standard deviations 2, 3 and 0.5.
fn parameters() -> [Parameter; 3] {
    [("stiffness", 2.0), ("mass", 3.0), ("damping", 0.5)]
        .map(|(name, sd)| Parameter::plain(name, Distribution::Normal([0.0, sd])))
}

fn build(form: &str, data: &Measurements) -> Biased<EmbeddedBias> {
    let text = format!(
        "spread = {{ damping = {{ half_normal = 1 }}, stiffness = {{ half_normal = 1 }} }}\n\
         likelihood = \"{form}\"\nvariance = {{ half_normal = 1 }}"
    );
    let chosen: Embedded = options("embedded", &text).unwrap();
    let (errors, parameters) = ([common(5)], parameters());
    let known = Known { data, common: &errors, slopes: &slopes, parameters: &parameters };
    chosen.under(&known, data).unwrap()
}

#[test]
fn it_is_the_normal_density_written_out() {
    let (data, response, slopes) = (data(2, 4), random_matrix(1, OUTPUTS, 3), slopes().unwrap());
    let error = [common(5)];
    let of_error = shared(&error);
    // In the order of the parameters.
    let hyper = [0.8, 0.3, 0.2];
    let spread = |i: usize, j: usize| {
        let of = |c: usize, delta: f64| delta * delta * slopes[(i, c)] * slopes[(j, c)];
        of(0, hyper[0] / 2.0) + of(2, hyper[1] / 0.5)
    };
    for form in ["independent", "joint"] {
        let likelihood = build(form, &data);
        let names: Vec<&str> =
            likelihood.hyperparameters().iter().map(|h| h.name.as_str()).collect();
        assert_eq!(names, ["spread[stiffness]", "spread[damping]", "variance"]);
        let both = |i: usize, j: usize| {
            of_error(i, j) + if i == j || form == "joint" { spread(i, j) } else { 0.0 }
        };
        let written =
            Written::new(&data, response.row(0), both, |i, j| if i == j { hyper[2] } else { 0.0 });
        close(likelihood.log_likelihood(response.row(0), &hyper), written.log_density(), 1e-10);
        let left_out = likelihood.left_out(response.row(0), &hyper).unwrap();
        left_out.iter().zip(written.left_out()).for_each(|(f, e)| close(*f, e, 1e-9));
        has_its_derivatives(&likelihood, response.row(0), &hyper);
    }
}

/// `y = (θ + δ ξ) x` without noise: `y / x` is normal with mean `θ` and standard deviation `δ`.
#[test]
fn the_spread_is_that_of_the_parameter() {
    let xs = [0.5, 1.0, 2.0, 4.0, 8.0];
    let layout = Layout {
        name: "work".into(),
        unit: Unit::dimensionless(),
        axes: vec![Axis::grid("effort", xs.to_vec(), Unit::dimensionless())],
    };
    let rates = [0.9, 1.3, 1.1, 0.6, 1.2];
    let values = xs.iter().zip(rates).map(|(x, rate)| Some(rate * x)).collect();
    let data = Measurements::new(layout, vec![Replicate::new("1", values)]);
    let chosen: Embedded = options(
        "embedded",
        "spread = { rate = { half_normal = 1 } }\nvariance = { known = 1e-14 }",
    )
    .unwrap();
    let parameters = [Parameter::plain("rate", Distribution::Normal([1.0, 0.4]))];
    let slopes = || Ok(Matrix::from_fn(5, 1, |i, _| 0.4 * xs[i]));
    let known = Known { data: &data, common: &[], slopes: &slopes, parameters: &parameters };
    let likelihood = chosen.under(&known, &data).unwrap();
    let (rate, delta) = (1.05, 0.23);
    let law = Distribution::Normal([rate, delta]);
    let expected: f64 = rates.iter().zip(xs).map(|(r, x)| law.log_density(*r) - f64::ln(x)).sum();
    let response: Vec<f64> = xs.iter().map(|x| rate * x).collect();
    close(likelihood.log_likelihood(&response, &[delta]), expected, 1e-10);
    // Errors are those of one value of the parameter.
    let drawn = likelihood.errors(&response, &[delta], &Stream::root(3));
    let ratio = drawn[1].values[0] / xs[0];
    drawn[1].values.iter().zip(xs).for_each(|(e, x)| close(e / x, ratio, 1e-12));
}
