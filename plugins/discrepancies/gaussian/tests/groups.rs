//! Several variances, multipliers of measured variances, and variances integrated out.

use std::path::Path;

use lacuna::data::Measurements;
use lacuna::data::measurements::Summary;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{CommonError, Known, Likelihood};
use lacuna::text::problem::Complaints;
use lacuna::text::read::read;
use lacuna::text::{Problems, Sources};
use lacuna_linalg::Matrix;

use super::{Emulated, build};
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, Written, close, common, data, has_its_derivatives, layout, options,
    random_matrix, shared,
};
use crate::discrepancies::gaussian::Gaussian;
use crate::discrepancies::gaussian::likelihood::GaussianLikelihood;

const WINDOWS: &str =
    "variance = { half_normal = 1.0 }\nby = [\"sensor\", { axis = \"time\", windows = 3 }]";

fn written(
    data: &Measurements,
    error: &[CommonError],
    response: &[f64],
    variance: &dyn Fn(usize) -> f64,
) -> Written {
    let own = |i: usize, j: usize| if i == j { variance(i) } else { 0.0 };
    Written::new(data, response, shared(error), own)
}

fn names(likelihood: &GaussianLikelihood) -> Vec<String> {
    likelihood.hyperparameters().iter().map(|h| h.name.clone()).collect()
}

/// Returns the group of an output under `WINDOWS`; the last window of sensor G has no data.
fn window(i: usize) -> usize {
    (3 * (i / TIMES) + (i % TIMES) / 2).min(7)
}

#[test]
fn groups_have_names_and_a_variance_where_there_are_data() {
    let data = data(1, 4);
    let named = |options: &str| names(&build(&data, &[], options));
    assert_eq!(named("variance = { half_normal = 1.0 }"), ["variance"]);
    let by = |by: &str| named(&format!("variance = {{ half_normal = 1.0 }}\nby = {by}"));
    assert_eq!(by("\"all\""), ["variance"]);
    assert_eq!(by("\"sensor\""), ["variance[B]", "variance[C]", "variance[G]"]);
    assert_eq!(by("\"time\"")[1], "variance[0.00011000000000000002 s]");
    let edges = by("{ axis = \"time\", edges = [-1.0, 2e-4, 2.4e-4, 1.0] }");
    assert_eq!(edges.len(), 2);
    let windows = named(WINDOWS);
    assert_eq!(windows.len(), 8);
    assert!(windows[0].starts_with("variance[B, 0..0.00011"), "{}", windows[0]);
    assert!(named("variance = { known = 2.0 }").is_empty());
    let measured = "variance = { measured = { inverse_gamma = [3, 4] } }\nby = \"sensor\"";
    assert_eq!(named(measured)[2], "multiplier[G]");
}

#[test]
fn axes_and_windows_that_are_none_are_refused() {
    let data = data(1, 4);
    for by in [
        "\"sensors\"",
        "{ axis = \"sensor\", windows = 2 }",
        "{ axis = \"time\", windows = 7 }",
        "{ axis = \"time\", windows = 2, edges = [1e-4] }",
        "{ axis = \"time\", edges = [2e-4, 1e-4] }",
    ] {
        let text = format!("variance = {{ half_normal = 1.0 }}\nby = {by}");
        let chosen: Gaussian = options("gaussian", &text).unwrap();
        assert!(GaussianLikelihood::new(&chosen, &Known::without_slopes(&data, &[])).is_err());
    }
    for bad in ["by = 3", "by = [[\"sensor\"]]", "by = { axis = \"time\", window = 3 }"] {
        let text = format!("variance = {{ known = 1.0 }}\n{bad}");
        assert!(options::<Gaussian>("gaussian", &text).is_err(), "{bad}");
    }
    for bad in ["{ known = 1.0, half_normal = 1.0 }", "{ half_norm = 1.0 }", "{}", "3.0"] {
        assert!(options::<Gaussian>("gaussian", &format!("variance = {bad}")).is_err(), "{bad}");
    }
}

#[test]
fn options_are_written_as_they_are_read() {
    for text in [
        WINDOWS,
        "variance = { known = [1.0, 2.0, 3.0] }\nby = \"sensor\"",
        "variance = { measured = { known = 1.0 } }",
        "variance = { measured = { log_normal = [0.0, 1.0] } }\nmarginal = true",
    ] {
        let chosen: Gaussian = options("gaussian", text).unwrap();
        let json = serde_json::to_string(&chosen).unwrap();
        assert_eq!(serde_json::from_str::<Gaussian>(&json).unwrap(), chosen);
    }
}

#[test]
fn groups_equal_the_normal_density_written_out() {
    let v = |g: usize| 0.3 + 0.4 * g as f64;
    for seed in 0..10 {
        let data = data(seed, 4);
        let error = [common(seed + 100), common(seed + 300)];
        let response = random_matrix(1, OUTPUTS, seed + 200);
        for error in [&[][..], &error[..]] {
            let likelihood = build(&data, error, WINDOWS);
            let hyper: Vec<f64> = (0..8).map(v).collect();
            let written = written(&data, error, response.row(0), &|i| v(window(i)));
            close(likelihood.log_likelihood(response.row(0), &hyper), written.log_density(), 1e-10);
            let found = likelihood.left_out(response.row(0), &hyper).unwrap();
            for (found, expected) in found.iter().zip(written.left_out()) {
                close(*found, expected, 1e-9);
            }
        }
    }
}

#[test]
fn known_and_measured_variances_equal_the_density_written_out() {
    let data = data(5, 4);
    let error = [common(6)];
    let response = random_matrix(1, OUTPUTS, 7);
    let sds: Vec<Option<f64>> = data.summaries().iter().map(Summary::sd).collect();
    let hyper = [0.5, 1.5, 2.5];
    for error in [&[][..], &error[..]] {
        let known = build(&data, error, "variance = { known = [1.0, 2.0, 3.0] }\nby = \"sensor\"");
        let expected = written(&data, error, response.row(0), &|i| 1.0 + (i / TIMES) as f64);
        close(known.log_likelihood(response.row(0), &[]), expected.log_density(), 1e-10);
        let multipliers = |by: &str| {
            build(
                &data,
                error,
                &format!("variance = {{ measured = {{ half_normal = 1 }} }}\nby = \"{by}\""),
            )
        };
        for (by, count) in [("all", 1), ("sensor", 3)] {
            let likelihood = multipliers(by);
            let variance = |i: usize| {
                let measured = sds[i].filter(|sd| *sd > 0.0).map(|sd| sd * sd);
                hyper[if count == 1 { 0 } else { i / TIMES }]
                    * measured.unwrap_or(likelihood.noise().scale[i])
            };
            let expected = written(&data, error, response.row(0), &variance);
            let found = likelihood.log_likelihood(response.row(0), &hyper[..count]);
            close(found, expected.log_density(), 1e-10);
            let found = likelihood.left_out(response.row(0), &hyper[..count]).unwrap();
            found.iter().zip(expected.left_out()).for_each(|(f, e)| close(*f, e, 1e-9));
            has_its_derivatives(&likelihood, response.row(0), &hyper[..count]);
        }
    }
}

#[test]
fn the_compressed_forms_of_groups_equal_the_full_ones() {
    let marginal = "variance = { half_normal = 1.0 }\nmarginal = true";
    let by_sensor = "variance = { inverse_gamma = [2, 1] }\nby = \"sensor\"\nmarginal = true";
    let measured = "variance = { measured = { half_normal = 1 } }\nby = \"time\"";
    for seed in 0..5 {
        let data = data(seed, 4);
        let error = [common(seed + 100)];
        for (options, error) in [
            (WINDOWS, &[][..]),
            (WINDOWS, &error),
            (measured, &error),
            (marginal, &error),
            (by_sensor, &[]),
        ] {
            for terms in [2, 5, 30] {
                let emulated = Emulated { coefficients: random_matrix(terms, OUTPUTS, seed + 300) };
                let full = build(&data, error, options);
                let compressed = full.compress(&emulated).unwrap();
                let basis = random_matrix(3, terms, seed + 400);
                let count = full.hyperparameters().len();
                let hyper = Matrix::from_fn(3, count, |i, j| 0.2 + (i + j) as f64);
                let found = compressed.log_likelihood(&basis, &hyper);
                let responses = lacuna_linalg::multiply(&basis, &emulated.coefficients);
                for (i, &found) in found.iter().enumerate() {
                    close(found, full.log_likelihood(responses.row(i), hyper.row(i)), 1e-10);
                    let (by_basis, by_hyper) = compressed.gradient(basis.row(i), hyper.row(i));
                    let (by_response, expected) = full.gradient(responses.row(i), hyper.row(i));
                    let chained =
                        lacuna_linalg::multiply_vector(&emulated.coefficients, &by_response);
                    by_basis.iter().zip(chained).for_each(|(f, e)| close(*f, e, 1e-8));
                    by_hyper.iter().zip(expected).for_each(|(f, e)| close(*f, e, 1e-8));
                }
            }
        }
    }
}

#[test]
fn gradients_of_all_forms_are_the_derivatives() {
    let data = data(3, 4);
    let error = [common(4)];
    let response = random_matrix(1, OUTPUTS, 5);
    for (options, error) in [
        (WINDOWS, &error[..]),
        (WINDOWS, &[]),
        ("variance = { half_normal = 1.0 }\nmarginal = true", &error),
        ("variance = { uniform = [0.5, 0.8] }\nby = \"sensor\"\nmarginal = true", &[]),
    ] {
        let likelihood = build(&data, error, options);
        let hyper: Vec<f64> =
            (0..likelihood.hyperparameters().len()).map(|g| 0.5 + g as f64).collect();
        has_its_derivatives(&likelihood, response.row(0), &hyper);
    }
}

/// Integrates by Simpson's rule in the logarithm of the variance, whose error is of the fourth order in the step; a
/// prior with a corner is given as two ranges.
fn by_simpson(prior: &Distribution, ranges: &[f64], density: impl Fn(f64) -> f64) -> f64 {
    const COUNT: usize = 6000;
    let mut values = Vec::new();
    for ends in ranges.windows(2) {
        let (low, high) = (ends[0].ln(), ends[1].ln());
        let step = (high - low) / COUNT as f64;
        values.extend((0..=COUNT).map(|k| {
            let weight = match k {
                0 | COUNT => 1.0,
                _ => 2.0 + 2.0 * (k % 2) as f64,
            };
            let v = if k == COUNT { ends[1] } else { (low + step * k as f64).exp().max(ends[0]) };
            density(v) + prior.log_density(v) + v.ln() + (weight * step / 3.0).ln()
        }));
    }
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + values.iter().map(|v| (v - largest).exp()).sum::<f64>().ln()
}

#[test]
fn integrated_variances_equal_the_integral() {
    let cases: [(&str, Distribution, &[f64]); 6] = [
        ("half_normal = 1.0", Distribution::HalfNormal(1.0), &[1e-9, 1e2]),
        ("inverse_gamma = [2.0, 1.5]", Distribution::InverseGamma([2.0, 1.5]), &[1e-3, 1e8]),
        ("uniform = [0.5, 0.8]", Distribution::Uniform([0.5, 0.8]), &[0.5, 0.65, 0.8]),
        (
            "log_uniform = [1e-3, 2.0]",
            Distribution::LogUniform([1e-3, 2.0]),
            &[1e-3, 0.2, 1.0, 1.5, 2.0],
        ),
        ("log_uniform = [1e-9, 1e9]", Distribution::LogUniform([1e-9, 1e9]), &[1e-4, 1e9]),
        (
            "triangular = [0.0, 1.0, 4.0]",
            Distribution::Triangular([0.0, 1.0, 4.0]),
            &[1e-9, 0.2, 1.0, 2.0, 4.0],
        ),
    ];
    for (seed, count) in [(0, 1), (1, 6)] {
        let data = data(seed, count);
        let error = [common(seed + 10)];
        let response = random_matrix(1, OUTPUTS, seed + 20);
        for (text, prior, ranges) in &cases {
            for error in [&[][..], &error[..]] {
                let plain = build(&data, error, &format!("variance = {{ {text} }}"));
                let marginal =
                    build(&data, error, &format!("variance = {{ {text} }}\nmarginal = true"));
                assert!(marginal.hyperparameters().is_empty());
                let at = |v: f64| plain.log_likelihood(response.row(0), &[v]);
                let expected = by_simpson(prior, ranges, at);
                let found = marginal.log_likelihood(response.row(0), &[]);
                close(found, expected, 1e-10);
            }
        }
    }
}

/// The density of one value given the others is the quotient of two integrals.
#[test]
fn values_left_out_of_an_integral_have_their_densities() {
    let data = data(2, 3);
    let error = [common(3)];
    let response = random_matrix(1, OUTPUTS, 4);
    for error in [&[][..], &error[..]] {
        let options = "variance = { half_normal = 1.0 }\nmarginal = true";
        let value =
            |data: &Measurements| build(data, error, options).log_likelihood(response.row(0), &[]);
        let found = build(&data, error, options).left_out(response.row(0), &[]).unwrap();
        let mut next = found.iter();
        for r in 0..3 {
            for i in (0..OUTPUTS).filter(|&i| data.replicates[r].values[i].is_some()) {
                let mut less = data.clone();
                less.replicates[r].values[i] = None;
                close(*next.next().unwrap(), value(&data) - value(&less), 1e-8);
            }
        }
    }
}

/// Independent data of known variance have their own normal densities, however far one lies.
#[test]
fn a_value_far_outside_has_a_finite_density() {
    let mut data = data(2, 3);
    let response = random_matrix(1, OUTPUTS, 4);
    let i = (0..OUTPUTS).find(|&i| data.replicates[0].values[i].is_some()).unwrap();
    data.replicates[0].values[i] = Some(response[(0, i)] + 60.0);
    let likelihood = build(&data, &[], "variance = { known = 1.0 }");
    let found = likelihood.left_out(response.row(0), &[]).unwrap();
    close(found[0], -0.5 * (60.0_f64.powi(2) + std::f64::consts::TAU.ln()), 1e-12);
}

#[test]
fn several_variances_are_not_integrated_out_with_common_errors() {
    let text = "variance = { half_normal = 1.0 }\nby = \"sensor\"\nmarginal = true";
    let chosen: Gaussian = options("gaussian", text).unwrap();
    let (data, error) = (data(1, 3), [common(2)]);
    let stop = GaussianLikelihood::new(&chosen, &Known::without_slopes(&data, &error)).err();
    assert!(stop.unwrap().to_string().contains("cannot be integrated out together"));
}

/// The check reports it before anything is run.
#[test]
fn several_variances_with_marginal_are_refused_by_the_check() {
    let text = "[discrepancy]\nvariance = { half_normal = 1.0 }\nmarginal = true\nby = ";
    let complaints = |by: &str, common_errors: bool| {
        let (mut sources, mut problems) = (Sources::default(), Problems::new());
        let id = sources.add_file(Path::new("study.toml"), format!("{text}\"{by}\""));
        let root = read(id, &sources, &mut problems).unwrap();
        let node = root.get("discrepancy").unwrap();
        let chosen: Gaussian = lacuna::text::decode(node, &mut problems).unwrap();
        let (directory, layout) = (Path::new("."), layout());
        let context = Context { common_errors, ..Context::new(directory, &[], &layout) };
        chosen.check(&context, &mut Complaints::new(node, &mut problems));
        problems.render(&sources)
    };
    assert!(complaints("sensor", true).contains("expected `marginal = false`, or one variance"));
    assert_eq!(complaints("sensor", false), "");
    assert_eq!(complaints("all", true), "");
}

#[test]
fn the_variance_is_told_in_parts() {
    let data = data(1, 5);
    let likelihood = build(&data, &[common(2)], "variance = { half_normal = 1 }\nby = \"sensor\"");
    let parts = likelihood.predictive(&[0.0; OUTPUTS], &[0.01, 30.0, 40.0]);
    let origins: Vec<&str> = parts.iter().map(|p| p.origin.as_str()).collect();
    assert_eq!(origins, ["measurement", "model_form", "emulator"]);
    assert_eq!((parts[0].variance[0], parts[1].variance[0]), (0.01, 0.0));
    let c = TIMES;
    assert!((parts[0].variance[c] + parts[1].variance[c] - 30.0).abs() < 1e-12);
    let pooled: (f64, f64) = (TIMES..2 * TIMES)
        .map(|i| data.summaries()[i])
        .fold((0.0, 0.0), |(s, f), o| (s + o.scatter, f + o.count as f64 - 1.0));
    close(parts[0].variance[c], pooled.0 / pooled.1, 1e-12);
    let single = super::super::super::common::testing::data(1, 1);
    let likelihood = build(&single, &[], "variance = { half_normal = 1 }");
    assert_eq!(likelihood.predictive(&[0.0; OUTPUTS], &[0.2])[0].origin.as_str(), "discrepancy");
}

#[test]
fn a_mean_of_zero_and_data_without_scatter_have_a_start() {
    let mut data = data(1, 3);
    for replicate in &mut data.replicates {
        replicate.values.iter_mut().for_each(|v| *v = v.map(|_| 0.0));
    }
    for prior in [
        "half_normal = 1e-6",
        "uniform = [0, 1]",
        "inverse_gamma = [2, 1]",
        "log_uniform = [1e-9, 1]",
    ] {
        let likelihood = build(&data, &[], &format!("variance = {{ {prior} }}\nby = \"sensor\""));
        for h in likelihood.hyperparameters() {
            assert!(h.start > 0.0 && h.prior.log_density(h.start).is_finite(), "{prior}");
        }
    }
}
