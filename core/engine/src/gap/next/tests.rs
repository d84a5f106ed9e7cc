//! Closed forms: a linear model, two normal distributions, a quadratic regression.
#![allow(clippy::unwrap_used)]

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::Matrix;

use super::hypothesis::Hypothesis;
use super::information::{Predicted, name_bits};
use super::next;
use crate::gap::search::{Explanation, FurtherData};
use crate::gap::system::System;
use crate::gap::system::fit::fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::testing::SyntheticExperiment;

fn known(mean: f64) -> Predicted {
    Predicted {
        mean: vec![mean],
        slopes: Matrix::zeros(1, 1),
        precision: Matrix::from_vec(1, 1, vec![1.0]),
    }
}

/// The information on which of two normal distributions of distance `d` data come from, by the trapezoidal rule.
fn by_quadrature(d: f64) -> f64 {
    let log2 = |x: f64| x.ln() / std::f64::consts::LN_2;
    let step = 1e-3;
    let one = |i: i32| {
        let x = f64::from(i) * step;
        let (p, q) = ((-0.5 * x * x).exp(), (-0.5 * (x - d).powi(2)).exp());
        let share = |a: f64, b: f64| if a > 0.0 { 0.5 * a * log2(2.0 * a / (a + b)) } else { 0.0 };
        (share(p, q) + share(q, p)) / (2.0 * std::f64::consts::PI).sqrt() * step
    };
    (-12_000..20_000).map(one).sum()
}

#[test]
fn bits_on_the_name_of_two_normal_distributions_are_those_of_quadrature() {
    for (k, d) in [0.5, 1.0, 2.0, 4.0].into_iter().enumerate() {
        let found =
            name_bits(&[0.5, 0.5], &[known(0.0), known(d)], &Stream::root(k as u64)).unwrap();
        let exact = by_quadrature(d);
        assert!((found.value - exact).abs() < 4.0 * found.error, "{d}: {} {exact}", found.value);
        assert!(found.error < 0.02);
    }
}

/// `0.5 log2(1 + s^2 / sigma^2)` for one value of noise `sigma` and a prior of width `s`.
#[test]
fn bits_on_the_parameter_of_a_linear_model_have_their_closed_form() {
    for ratio in [0.3_f64, 1.0, 5.0] {
        let own = Hypothesis {
            response: vec![0.0],
            tangents: Matrix::from_vec(1, 1, vec![1.0]),
            precision: Matrix::from_vec(1, 1, vec![1.0]),
            parameters: 1,
        };
        let new = Predicted {
            mean: vec![0.0],
            slopes: Matrix::from_vec(1, 1, vec![ratio]),
            precision: own.precision.clone(),
        };
        let exact = 0.5 * (1.0 + ratio * ratio).log2();
        assert!((own.parameter_bits(&new).unwrap() - exact).abs() < 1e-12);
    }
}

/// The D-optimal design of a quadratic regression on [-1, 1] has equal weights at -1, 0 and 1 (Fedorov, Theory of Optimal
/// Experiments, 1972).
#[test]
fn the_best_three_places_of_a_quadratic_regression_are_its_d_optimal_design() {
    let own = Hypothesis {
        response: vec![0.0],
        tangents: Matrix::zeros(3, 1),
        precision: Matrix::from_fn(3, 3, |i, j| if i == j { 1e-6 } else { 0.0 }),
        parameters: 3,
    };
    let places: Vec<f64> = (-10..=10).map(|i| f64::from(i) / 10.0).collect();
    let mut best = (f64::NEG_INFINITY, [0.0; 3]);
    let increasing = |a: f64| places.iter().copied().filter(move |b| *b > a);
    for at in places
        .iter()
        .flat_map(|&a| increasing(a).flat_map(move |b| increasing(b).map(move |c| [a, b, c])))
    {
        let slopes = Matrix::from_fn(3, 3, |j, i| at[i].powi(j as i32));
        let new = Predicted { mean: vec![0.0; 3], slopes, precision: own.precision.clone() };
        let bits = own.parameter_bits(&new).unwrap();
        if bits > best.0 {
            best = (bits, at);
        }
    }
    assert_eq!(best.1, [-1.0, 0.0, 1.0]);
}

const TIMES: usize = 12;

/// Two conditions and two sensors; the second unknown grows as a power of time, and shows at places that differ by case.
fn world(power: i32, strong: [f64; 4]) -> SyntheticExperiment {
    SyntheticExperiment::new(
        &["x", "y"],
        &["a", "b"],
        TIMES,
        0.3,
        &["level", "rate"],
        |j, c, s, t| {
            let size = strong[2 * c + s];
            if j == 0 { 1.0 } else { size * (t / TIMES as f64).powi(power) }
        },
    )
}

/// The outputs of an option.
fn touched(what: Option<&FurtherData>, i: usize) -> bool {
    let (c, s) = (i / (2 * TIMES), i / TIMES % 2);
    match what {
        Some(FurtherData::Condition { scenario }) => scenario.as_deref() == Some(["x", "y"][c]),
        Some(FurtherData::Sensor { on }) => on["sensor"] == [["a", "b"][s]],
        _ => true,
    }
}

/// The log probability of the first hypothesis, in bits, after new data of an option that are simulated from the truth
/// and analysed value by value: a sequence of Kalman updates, which shares nothing with the code under test.
fn realised(
    fits: &[(Vec<f64>, Matrix, Matrix)],
    truth: &[f64],
    own: &[usize],
    stream: &Stream,
) -> f64 {
    let mut rng = stream.generator();
    let mut last: Vec<f64> = vec![0.0; truth.len()];
    let mut logs = vec![0.0; fits.len()];
    let mut states: Vec<(Vec<f64>, Matrix)> =
        fits.iter().map(|(_, slopes, c)| (vec![0.0; slopes.rows()], c.clone())).collect();
    for &i in own {
        let memory = if i % TIMES == 0 { 0.0 } else { 0.3 };
        let first = if i % TIMES == 0 { 1.0 / (1.0_f64 - 0.09).sqrt() } else { 1.0 };
        last[i] = normal(&mut rng) * first + if memory > 0.0 { memory * last[i - 1] } else { 0.0 };
        let back =
            |y: &dyn Fn(usize) -> f64| y(i) - if memory > 0.0 { memory * y(i - 1) } else { 0.0 };
        let data = back(&|k| truth[k] + last[k]);
        for (h, (response, slopes, _)) in fits.iter().enumerate() {
            let (mean, covariance) = &mut states[h];
            let n = mean.len();
            let g: Vec<f64> = (0..n).map(|j| back(&|k| slopes[(j, k)])).collect();
            let expected = back(&|k| response[k]) + (0..n).map(|j| g[j] * mean[j]).sum::<f64>();
            let along: Vec<f64> =
                (0..n).map(|j| (0..n).map(|l| covariance[(j, l)] * g[l]).sum()).collect();
            let variance = first * first + (0..n).map(|j| g[j] * along[j]).sum::<f64>();
            let off = data - expected;
            logs[h] -= 0.5 * (off * off / variance + variance.ln());
            (0..n).for_each(|j| mean[j] += along[j] * off / variance);
            let before = covariance.clone();
            *covariance =
                Matrix::from_fn(n, n, |j, l| before[(j, l)] - along[j] * along[l] / variance);
        }
    }
    -(1.0 + (logs[1] - logs[0]).exp()).log2()
}

/// In planted cases the recommended option gives more information on the name than a random one of as many replicates.
#[test]
fn the_recommended_option_beats_a_random_one() {
    let (mut better, mut cases) = (0, 0);
    for case in 0..40_u64 {
        let stream = Stream::root(700 + case);
        let mut rng = stream.named("places").generator();
        let strong = [0; 4].map(|_| normal(&mut rng).abs());
        let worlds = [world(1, strong), world(3, strong)];
        let truth = worlds[0].response(&[0.3, 1.5]);
        let experiment = worlds[0].experiment(&truth, 2, &stream.named("data"));
        let other = crate::gap::experiment::Experiment {
            parameters: &worlds[1].parameters,
            forward: &worlds[1].forward,
            ..experiment.clone()
        };
        let systems = [System::new(&experiment, Vec::new()), System::new(&other, Vec::new())];
        let (_, means) = experiment.means();
        let whitener = Whitener::new(&experiment, &worlds[0].noise, &means);
        let fits = [0, 1].map(|k| fit(&systems[k], &whitener, &means, &[0.0, 0.0]));
        let own = |k: usize| (k.to_string(), 0.5, Explanation::exact(&systems[k], &fits[k]));
        let found = next(&[own(0), own(1)], &worlds[0].noise, &stream.named("next")).unwrap();
        let single: Vec<_> =
            found.options.iter().filter(|own| own.replicates == 4 && own.what.is_some()).collect();
        let plain: Vec<(Vec<f64>, Matrix, Matrix)> = fits
            .iter()
            .map(|fit| {
                let covariance = lacuna_linalg::Cholesky::new(&fit.precision()).unwrap().inverse();
                (fit.at.response.clone(), fit.at.tangents.clone(), covariance)
            })
            .collect();
        let mean = |what: Option<&FurtherData>| {
            let outputs: Vec<usize> = (0..truth.len()).filter(|&i| touched(what, i)).collect();
            let one = |r| realised(&plain, &truth, &outputs, &stream.named("new").at(r));
            (0..100).map(one).sum::<f64>() / 100.0
        };
        let random = 1 + (case as usize) % (single.len() - 1);
        cases += 1;
        better += usize::from(mean(single[0].what.as_ref()) > mean(single[random].what.as_ref()));
    }
    assert!(better * 10 >= cases * 8, "{better} of {cases}");
}
