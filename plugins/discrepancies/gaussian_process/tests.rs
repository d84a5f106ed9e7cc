//! The likelihood against the multivariate normal density with the dense covariance.
#![allow(clippy::unwrap_used)]

use lacuna::data::Measurements;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{CommonError, Known, Likelihood};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::likelihood::BiasedLikelihood;
use super::{GaussianProcess, Kernel};
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, Written, close, common, data, has_its_derivatives, layout, options,
    random_matrix, shared,
};

/// Slopes of three parameters, of which the last is a combination of the others.
#[expect(clippy::unnecessary_wraps, reason = "slopes may fail where a study computes them")]
fn slopes() -> Result<Matrix, Stop> {
    let random = random_matrix(OUTPUTS, 2, 77);
    Ok(Matrix::from_fn(OUTPUTS, 3, |i, j| match j {
        2 => random[(i, 0)] - 2.0 * random[(i, 1)],
        j => random[(i, j)],
    }))
}

fn build(text: &str, data: &Measurements, common: &[CommonError]) -> BiasedLikelihood {
    let chosen: GaussianProcess = options("gaussian_process", text).unwrap();
    BiasedLikelihood::new(&chosen, &Known { data, common, slopes: &slopes, parameters: &[] })
        .unwrap()
}

const SHARED: &str = "bias = { half_normal = 1 }\ncorrelation_length = { half_normal = 1 }\n\
    variance = { half_normal = 1 }";
const SEPARATE: &str = "bias = { half_normal = 1 }\ncorrelation_length = { half_normal = 1 }\n\
    bias_by = \"sensor\"\nkernel = \"matern_3_2\"\nvariance = { half_normal = 1 }\nby = \"sensor\"";

/// Times in units of 1e-4 s.
fn rescaled(seed: u64, replicates: usize) -> Measurements {
    let mut data = data(seed, replicates);
    let grid = (0..TIMES).map(|j| j as f64 + 0.1 * (j * j) as f64).collect();
    data.layout.axes[1] = lacuna::data::Axis::grid("time", grid, layout().unit);
    data
}

#[test]
fn it_is_the_normal_density_written_out() {
    for seed in 0..4 {
        let (data, error) = (rescaled(seed, 4), [common(seed + 1)]);
        let response = random_matrix(1, OUTPUTS, seed + 2);
        for (text, hyper, groups) in [
            (SHARED, &[0.8, 1.5, 0.3][..], 1),
            (SEPARATE, &[0.8, 0.5, 0.2, 1.5, 0.7, 3.0, 0.3, 0.4, 0.5], 3),
        ] {
            for orthogonal in [true, false] {
                for error in [&[][..], &error[..]] {
                    let text = format!("{text}\northogonal = {orthogonal}");
                    let likelihood = build(&text, &data, error);
                    let bias = likelihood.written_bias(hyper);
                    let place: Vec<Option<usize>> = (0..OUTPUTS)
                        .scan(0, |k, i| {
                            let known = data.values(i).is_empty();
                            *k += usize::from(!known);
                            Some((!known).then(|| *k - 1))
                        })
                        .collect();
                    let common = shared(error);
                    let both = |i: usize, j: usize| {
                        common(i, j) + bias[(place[i].unwrap(), place[j].unwrap())]
                    };
                    let v = |i: usize| hyper[2 * groups + if groups > 1 { i / TIMES } else { 0 }];
                    let own = |i: usize, j: usize| if i == j { v(i) } else { 0.0 };
                    let written = Written::new(&data, response.row(0), both, own);
                    let found = likelihood.log_likelihood(response.row(0), hyper);
                    close(found, written.log_density(), 1e-10);
                    let left_out = likelihood.left_out(response.row(0), hyper).unwrap();
                    left_out.iter().zip(written.left_out()).for_each(|(f, e)| close(*f, e, 1e-9));
                }
            }
        }
    }
}

#[test]
fn gradients_are_the_derivatives() {
    let (data, error) = (rescaled(3, 4), [common(4)]);
    let response = random_matrix(1, OUTPUTS, 5);
    for (text, hyper) in
        [(SHARED, &[0.8, 1.5, 0.3][..]), (SEPARATE, &[0.8, 0.5, 0.2, 1.5, 0.7, 3.0, 0.3, 0.4, 0.5])]
    {
        for error in [&[][..], &error[..]] {
            let likelihood = build(text, &data, error);
            has_its_derivatives(&likelihood, response.row(0), hyper);
            let plain = build(&format!("{text}\northogonal = false"), &data, error);
            has_its_derivatives(&plain, response.row(0), hyper);
        }
    }
}

#[test]
fn the_bias_is_orthogonal_to_what_the_parameters_do() {
    let data = rescaled(1, 3);
    let likelihood = build(SHARED, &data, &[]);
    let hyper = [0.8, 1.5, 0.3];
    let bias = likelihood.written_bias(&hyper);
    assert_eq!(likelihood.bias.basis.columns(), 2);
    let kept: Vec<usize> = (0..OUTPUTS).filter(|&i| !data.values(i).is_empty()).collect();
    let slopes = slopes().unwrap().select_rows(&kept);
    let product = lacuna_linalg::transposed_multiply(&slopes, &bias);
    assert!(product.as_slice().iter().all(|x| x.abs() < 1e-12));
    // Draws are orthogonal too, and have the predicted variance.
    let told = &likelihood.predictive(&[0.0; OUTPUTS], &hyper)[1].variance;
    for (&i, k) in kept.iter().zip(0..) {
        close(told[i], bias[(k, k)], 1e-10);
    }
    let silent = "bias = { known = 0.8 }\ncorrelation_length = { known = 1.5 }\nvariance = { known = 1e-30 }";
    let likelihood = build(silent, &data, &[]);
    let drawn = likelihood.simulate(&[0.0; OUTPUTS], &[], &Stream::root(5));
    let values: Vec<Option<f64>> =
        kept.iter().map(|&i| drawn[0].replicates.iter().find_map(|r| r.values[i])).collect();
    let values: Vec<f64> = values.into_iter().flatten().collect();
    let along = lacuna_linalg::transposed_multiply_vector(&slopes, &values);
    assert!(along.iter().all(|x| x.abs() < 1e-9), "{along:?}");
}

/// Given the data the bias at the measured outputs is normal with mean `C V^-1 d` and covariance `C - C V^-1 C`, with the
/// residual `d` of the means and their covariance `V = C + D + F F'` (Rasmussen and Williams (2006), 2.23 and 2.24), also
/// where the prior `C` is orthogonal to derivatives.
#[test]
fn the_bias_given_the_data_is_that_of_a_normal_vector() {
    const COUNT: u64 = 4000;
    let (data, error, hyper) = (rescaled(2, 3), [common(6)], [0.8, 1.5, 0.3]);
    let response = random_matrix(1, OUTPUTS, 7).into_vec();
    let kept: Vec<usize> = (0..OUTPUTS).filter(|&i| !data.values(i).is_empty()).collect();
    for orthogonal in [true, false] {
        let likelihood = build(&format!("{SHARED}\northogonal = {orthogonal}"), &data, &error);
        let prior = likelihood.written_bias(&hyper);
        let (n, common) = (kept.len(), shared(&error));
        let count = |k: usize| data.values(kept[k]).len() as f64;
        let noise = |k: usize, l: usize| if k == l { hyper[2] / count(k) } else { 0.0 };
        let whole = |k, l| prior[(k, l)] + noise(k, l) + common(kept[k], kept[l]);
        let whole = lacuna_linalg::Cholesky::new(&Matrix::from_fn(n, n, whole)).unwrap();
        let known = whole.solve_matrix(&prior);
        let mean = |k: usize| data.values(kept[k]).iter().sum::<f64>() / count(k);
        let residual: Vec<f64> = (0..n).map(|k| mean(k) - response[kept[k]]).collect();
        let expected = lacuna_linalg::transposed_multiply_vector(&known, &residual);
        let left = lacuna_linalg::multiply(&prior, &known);
        let draw = |k| likelihood.errors_given_data(&response, &hyper, &Stream::root(8).at(k));
        let draws: Vec<Vec<f64>> = (0..COUNT).map(|k| draw(k).unwrap()[1].values.clone()).collect();
        for (k, &i) in kept.iter().enumerate() {
            let variance = prior[(k, k)] - left[(k, k)];
            let found = draws.iter().map(|b| b[i]).sum::<f64>() / COUNT as f64;
            let square =
                draws.iter().map(|b| (b[i] - expected[k]).powi(2)).sum::<f64>() / COUNT as f64;
            // Four and a half standard errors of a mean and of a variance over 4000 draws, for thirty outputs.
            let n = COUNT as f64;
            assert!((found - expected[k]).abs() < 4.5 * (variance / n).sqrt(), "{found} {k}");
            assert!((square - variance).abs() < 4.5 * variance * (2.0 / n).sqrt(), "{square} {k}");
        }
    }
}

/// Matérn with index 1/2, 3/2, 5/2 at a distance of one length: Rasmussen and Williams (2006), 4.17.
#[test]
fn kernels_have_their_closed_forms() {
    let (a, b) = (3.0_f64.sqrt(), 5.0_f64.sqrt());
    close(Kernel::ThreeHalves.at(2.0, 2.0).0, (1.0 + a) * (-a).exp(), 1e-15);
    close(Kernel::FiveHalves.at(2.0, 2.0).0, (1.0 + b + 5.0 / 3.0) * (-b).exp(), 1e-15);
    for kernel in [Kernel::ThreeHalves, Kernel::FiveHalves] {
        let h = 1e-5;
        let difference = (kernel.at(1.3, 0.7 + h).0 - kernel.at(1.3, 0.7 - h).0) / (2.0 * h);
        close(kernel.at(1.3, 0.7).1, difference, 1e-8);
    }
}
