//! Distances against `SciPy`, `NumPy` and POT; the likelihood and the posterior of a normal mean against their closed
//! forms; a sample of two modes.
#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known, Likelihood};
use lacuna::plugin::{Discrepancy, registry};
use lacuna_linalg::Matrix;

use super::metric::{Metric, ToData};
use crate::discrepancies::common::testing::{OUTPUTS, common, data, has_its_derivatives};

fn build(text: &str, data: &Measurements, errors: &[CommonError]) -> Box<dyn Likelihood> {
    let built =
        registry::from_text::<dyn Discrepancy>("approximate_bayesian_computation", text).unwrap();
    built.plugin.likelihood(&Known::without_slopes(data, errors)).unwrap()
}

/// A curve of these values over the numbers from 0.
fn curve(values: &[f64]) -> Measurements {
    let grid = (0..values.len()).map(|i| i as f64).collect();
    let one = Unit::dimensionless;
    let axes = vec![Axis::grid("time", grid, one())];
    let layout = Layout { name: "y".into(), unit: one(), axes };
    Measurements::new(layout, vec![Replicate::new("1", values.iter().copied().map(Some).collect())])
}

/// Values by `SciPy` 1.17.1 (`wasserstein_distance`, `energy_distance`, `jensenshannon` of the bins' probabilities by
/// `norm.cdf`), by `NumPy` with the kernel matrices written out, and by POT 0.9.7 (`sliced_wasserstein_distance` with
/// the same directions), for `x = sin(1.3 i) + 0.1 i` and `y = 1.4 cos(0.9 i) + 0.3` at the places `0.25 i`, `i` from 0
/// to 11.
#[test]
fn the_distances_are_those_of_other_programs() {
    use Metric::{Energy, JensenShannon, MaximumMeanDiscrepancy, Wasserstein};
    let each = |f: fn(f64) -> f64| -> Vec<f64> { (0..12).map(|i| f(f64::from(i))).collect() };
    let (x, y) = (each(|i| (1.3 * i).sin() + 0.1 * i), each(|i| 1.4 * (0.9 * i).cos() + 0.3));
    for (metric, plane, bandwidth, expected) in [
        (Wasserstein, false, None, 0.460_356_590_792_584_7),
        (Wasserstein, true, None, 0.348_694_752_611_024),
        (Energy, false, None, 0.452_751_524_196_052_86),
        (Energy, true, None, 0.424_336_693_014_465_97),
        (MaximumMeanDiscrepancy, false, Some(0.7), 0.308_837_209_534_647),
        (MaximumMeanDiscrepancy, false, None, 0.283_824_886_549_169_26),
        (JensenShannon, false, Some(0.25), 0.321_273_322_998_297_98),
        (JensenShannon, true, Some(0.25), 0.462_657_528_108_459_84),
    ] {
        let places = plane.then(|| each(|i| 0.25 * i));
        let to_data = ToData::new(metric, places, x.clone(), bandwidth).unwrap();
        let mut slopes = vec![0.0; 12];
        let square = to_data.square(&y, Some(&mut slopes));
        assert!((square.sqrt() - expected).abs() < 1e-12, "{metric:?} {}", square.sqrt());
        for (j, slope) in slopes.iter().enumerate() {
            let at = |h: f64| {
                let mut moved = y.clone();
                moved[j] += h;
                to_data.square(&moved, None)
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((slope - difference).abs() < 1e-8, "{metric:?} {j}: {slope} {difference}");
        }
        assert!(to_data.square(&x, None).abs() < 1e-15);
    }
}

#[test]
fn it_has_its_derivatives() {
    let data = data(2, 3);
    let response: Vec<f64> = (0..OUTPUTS).map(|i| (i as f64).sin()).collect();
    for (metric, more) in [
        ("energy", "axis_weight = 3e3\ndistance_by = \"sensor\""),
        ("wasserstein", "sample = true"),
        ("maximum_mean_discrepancy", "by = \"sensor\""),
        ("jensen_shannon", ""),
    ] {
        let text = format!(
            "metric = \"{metric}\"\ntolerance = {{ half_normal = 1 }}\nsimulations = 3\n\
             variance = {{ half_normal = 1 }}\n{more}"
        );
        let likelihood = build(&text, &data, &[common(5)]);
        let count = likelihood.hyperparameters().len();
        let hyper: Vec<f64> = (0..count).map(|j| 0.6 + 0.1 * j as f64).collect();
        has_its_derivatives(&*likelihood, &response, &hyper);
    }
}

/// One number with normal noise: the mean of the kernel is twice the normal density of the difference, with the
/// variances of noise, common error and kernel added. Its Monte Carlo error is that of a mean of Gaussian kernels.
#[test]
fn the_likelihood_of_a_normal_number_has_its_closed_form() {
    const SIMULATIONS: f64 = 20_000.0;
    let factor = Matrix::from_fn(1, 1, |_, _| 0.4);
    let error =
        CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true };
    let text = "tolerance = { known = 0.3 }\nsimulations = 20000\nvariance = { half_normal = 1 }";
    let likelihood = build(text, &curve(&[1.0]), &[error]);
    let density = |x: f64, v: f64| (-0.5 * x * x / v).exp() / (TAU * v).sqrt();
    for (response, noise) in [(0.0, 0.25), (1.1, 0.25), (0.5, 1.0)] {
        let (gap, own, kernel): (f64, f64, f64) = (1.0 - response, noise + 0.16, 0.09);
        let mean = 2.0 * density(gap, own + kernel);
        let square = 2.0 / (kernel * PI).sqrt() * density(gap, own + 0.5 * kernel);
        let error = ((square / (mean * mean) - 1.0) / SIMULATIONS).sqrt();
        let found = likelihood.log_likelihood(&[response], &[noise]);
        assert!(
            (found - mean.ln()).abs() < 4.0 * error,
            "{response} {found} {} {error}",
            mean.ln()
        );
    }
}

/// The posterior of a normal mean with a flat prior is normal about the datum, with the variances of noise and kernel
/// added; as the tolerance vanishes, it is that of the noise.
#[test]
fn the_posterior_of_a_normal_mean_has_its_closed_form() {
    let simulations = 1000.0_f64;
    for tolerance in [1.0, 0.3, 0.1] {
        let text = format!(
            "metric = \"wasserstein\"\ntolerance = {{ known = {tolerance} }}\nsimulations = 1000\n\
             variance = {{ known = 0.25 }}"
        );
        let likelihood = build(&text, &curve(&[1.0]), &[]);
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in -160..=160 {
            let shift = 0.04 * f64::from(k);
            let weight = likelihood.log_likelihood(&[1.0 + shift], &[]).exp();
            total += weight;
            first += weight * shift;
            second += weight * shift * shift;
        }
        let mean = first / total;
        let variance = second / total - mean * mean;
        assert!(mean.abs() < 4.0 * 0.5 / simulations.sqrt(), "{mean}");
        let expected = 0.25 + tolerance * tolerance;
        let error = 0.25 * (2.0 / simulations).sqrt();
        assert!((variance - expected).abs() < 4.0 * error, "{tolerance}: {variance} {expected}");
    }
}

/// Sixty outcomes at plus or minus one, which has no partner in the response: the distance finds the separation of the
/// modes, the normal likelihood of the differences takes it for noise.
#[test]
fn it_finds_two_modes_that_a_normal_likelihood_averages() {
    let side = |seed: u64| {
        let mut rng = Stream::root(seed).generator();
        (0..60).map(move |_| if uniform(&mut rng) < 0.5 { -1.0 } else { 1.0 })
    };
    let mut rng = Stream::root(3).generator();
    let values: Vec<f64> = side(1).map(|s| s + 0.1 * normal(&mut rng)).collect();
    let measured = curve(&values);
    let best = |likelihood: &dyn Likelihood| {
        let at = |k: usize| {
            let response: Vec<f64> = side(2).map(|s| 0.05 * k as f64 * s).collect();
            likelihood.log_likelihood(&response, &[])
        };
        0.05 * (0..40).max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap() as f64
    };
    for metric in ["wasserstein", "energy", "maximum_mean_discrepancy", "jensen_shannon"] {
        let text = format!(
            "metric = \"{metric}\"\ntolerance = {{ known = 0.1 }}\nsample = true\n\
             variance = {{ known = 0.01 }}"
        );
        let found = best(&*build(&text, &measured, &[]));
        assert!((found - 1.0).abs() <= 0.1, "{metric} {found}");
    }
    let plain = registry::from_text::<dyn Discrepancy>("gaussian", "variance = { known = 1 }");
    let plain = plain.unwrap().plugin.likelihood(&Known::without_slopes(&measured, &[])).unwrap();
    assert!(best(&*plain) < 0.4);
}
