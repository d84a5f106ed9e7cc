//! Replicates with gains, time shifts and offsets that are applied to curves as such, not through the functions of the
//! method.

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna_linalg::{Cholesky, Matrix, transposed_multiply};

use super::of_replicates;

const GAUGES: usize = 6;
const TIMES: usize = 60;
const NOISE: f64 = 0.1;

/// Standard deviations of gain, time and offset, for all gauges together and for each.
#[derive(Clone, Copy)]
struct Pulses {
    common: [f64; 3],
    own: [f64; 3],
}

const NONE: [f64; 3] = [0.0; 3];

/// Strain of a gauge: an oscillation that decays, with an amplitude, a frequency and a delay of its own.
fn strain(gauge: usize, speed: f64, time: f64) -> f64 {
    let g = gauge as f64;
    let arrived = speed * time - 2.0 - 0.7 * g;
    let amplitude = 1.0 + 0.3 * g;
    if arrived <= 0.0 { 0.0 } else { amplitude * (-0.05 * arrived).exp() * (0.35 * arrived).sin() }
}

fn curve(speed: f64) -> Vec<f64> {
    let all = (0..GAUGES).flat_map(|g| (0..TIMES).map(move |t| strain(g, speed, 0.5 * t as f64)));
    all.collect()
}

fn layout() -> Layout {
    let unit = Unit::dimensionless();
    let times = (0..TIMES).map(|t| 0.5 * t as f64).collect();
    let axes = vec![
        Axis::labels("gauge", (0..GAUGES).map(|g| format!("G{g}"))),
        Axis::grid("time", times, unit.clone()),
    ];
    Layout { name: "strain".into(), unit, axes }
}

/// Replicates at the speed one.
fn measured(pulses: &Pulses, count: usize, seed: u64) -> Measurements {
    let replicate = |r: usize| {
        let mut rng = Stream::root(seed).at(r as u64).generator();
        let common = pulses.common.map(|sd| sd * normal(&mut rng));
        let mut values = Vec::new();
        for gauge in 0..GAUGES {
            let own = pulses.own.map(|sd| sd * normal(&mut rng));
            let [gain, shift, offset] = std::array::from_fn(|j| common[j] + own[j]);
            for t in 0..TIMES {
                let y = (1.0 + gain) * strain(gauge, 1.0, 0.5 * t as f64 - shift) + offset;
                values.push(Some(y + NOISE * normal(&mut rng)));
            }
        }
        Replicate::new(r.to_string(), values)
    };
    Measurements::new(layout(), (0..count).map(replicate).collect())
}

/// Derivatives of the curves by speed and gain.
fn slopes() -> Matrix {
    let step = 1e-4;
    let (before, truth, after) = (curve(1.0 - step), curve(1.0), curve(1.0 + step));
    let slope = |i: usize| (after[i] - before[i]) / (2.0 * step);
    Matrix::from_fn(truth.len(), 2, |i, j| if j == 0 { slope(i) } else { truth[i] })
}

/// Weighted least squares of the unknowns with these slopes about the truth: error and standard deviation of each.
fn estimated(
    data: &Measurements,
    factor: &Matrix,
    truth: &[f64],
    slopes: &Matrix,
) -> Vec<[f64; 2]> {
    let count = data.replicates.len() as f64;
    let summaries = data.summaries();
    let scatter: f64 = summaries.iter().map(|s| s.scatter).sum();
    let variance = scatter / (count - 1.0) / truth.len() as f64 / count;
    let mut whole = lacuna_linalg::multiply_transposed(factor, factor);
    (0..truth.len()).for_each(|i| whole[(i, i)] += variance);
    let weighted = Cholesky::new(&whole).unwrap().solve_matrix(slopes);
    let information = transposed_multiply(slopes, &weighted);
    let residual: Vec<f64> = summaries.iter().zip(truth).map(|(s, m)| s.mean - m).collect();
    let mut found = lacuna_linalg::transposed_multiply_vector(&weighted, &residual);
    let known = Cholesky::new(&information).unwrap();
    known.solve(&mut found);
    let sd = |j: usize| {
        let mut unit = vec![0.0; slopes.columns()];
        unit[j] = 1.0;
        known.solve(&mut unit);
        unit[j].sqrt()
    };
    found.iter().enumerate().map(|(j, error)| [*error, sd(j)]).collect()
}

/// Sample covariance of the mean of whole curves.
fn sampled(data: &Measurements) -> Matrix {
    let (summaries, n) = (data.summaries(), data.replicates.len() as f64);
    let value = |i: usize, r: usize| data.replicates[r].values[i].unwrap() - summaries[i].mean;
    let divisor = (n * (n - 1.0)).sqrt();
    Matrix::from_fn(summaries.len(), data.replicates.len(), |i, r| value(i, r) / divisor)
}

/// Share of 95 % intervals of speed and gain that hold the truth, with this error of the mean.
fn coverage(pulses: &Pulses, error: impl Fn(&Measurements) -> Matrix) -> [f64; 2] {
    const SETS: u64 = 200;
    let (mut held, truth, slopes) = ([0.0; 2], curve(1.0), slopes());
    for seed in 0..SETS {
        let data = measured(pulses, 5, 1000 + seed);
        for (h, [error, sd]) in
            held.iter_mut().zip(estimated(&data, &error(&data), &truth, &slopes))
        {
            *h += f64::from(u8::from(error.abs() < 1.96 * sd));
        }
    }
    held.map(|h| h / SETS as f64)
}

/// With five replicates, 95 % intervals hold the truth about as often as they say, whichever of the deviations there are. With
/// the sample covariance of whole curves those of the gain hold it in less than half of the cases.
#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    let all = Pulses { common: [0.02, 0.05, 0.02], own: [0.03, 0.05, 0.02] };
    let cases = [
        all,
        Pulses { own: NONE, ..all },
        Pulses { common: NONE, ..all },
        Pulses { common: [0.03, 0.0, 0.0], own: NONE },
        Pulses { common: NONE, own: NONE },
    ];
    let truth = curve(1.0);
    for (k, pulses) in cases.iter().enumerate() {
        let held = coverage(pulses, |data| {
            Matrix::clone(&of_replicates(data, Some(&truth)).unwrap().factor)
        });
        // 95 % minus three standard errors of 200 data sets.
        assert!(held.iter().all(|h| *h > 0.90), "case {k}: {held:?}");
    }
    let before = coverage(&all, sampled);
    assert!(before[1] < 0.5, "{before:?}");
}

/// With a best fit of a wrong form, whose curves arrive later the farther the gauge is and do not decay, the directions are
/// wrong: some of what gains and shifts do is left to the rest, and the intervals hold the truth less often than they say. They
/// still hold it more often than with the sample covariance of whole curves.
#[test]
fn a_model_of_a_wrong_form_is_better_than_none() {
    let pulses = Pulses { common: [0.02, 0.05, 0.02], own: [0.03, 0.05, 0.02] };
    let wrong = |g: usize, time: f64| {
        let arrived = time - 2.3 - 0.75 * g as f64;
        if arrived <= 0.0 { 0.0 } else { 0.8 * (1.0 + 0.3 * g as f64) * (0.34 * arrived).sin() }
    };
    let all = (0..GAUGES).flat_map(|g| (0..TIMES).map(move |t| wrong(g, 0.5 * t as f64)));
    let wrong: Vec<f64> = all.collect();
    let held =
        coverage(&pulses, |data| Matrix::clone(&of_replicates(data, Some(&wrong)).unwrap().factor));
    let before = coverage(&pulses, sampled);
    // Three standard errors of the difference of two shares of 200 data sets.
    assert!(
        (0..2).all(|j| held[j] > before[j] + 3.0 * (0.5_f64 / 200.0).sqrt()),
        "{held:?} {before:?}"
    );
}

/// Gains of standard deviation 0.1 that all gauges share: the covariance of the mean along the mean curve is `0.01 / R`. The
/// mean square with R - 1 degrees of freedom has the relative standard deviation `sqrt(2 / (R - 1))`.
#[test]
fn a_common_gain_is_found_along_the_mean_curve() {
    let (count, truth) = (200, curve(1.0));
    let pulses = Pulses { common: [0.1, 0.0, 0.0], own: NONE };
    let factor = of_replicates(&measured(&pulses, count, 3), Some(&truth)).unwrap().factor;
    let norm: f64 = truth.iter().map(|y| y * y).sum();
    let along = lacuna_linalg::transposed_multiply_vector(&factor, &truth);
    let along: f64 = along.iter().map(|a| (a / norm).powi(2)).sum();
    let expected = 0.01 / count as f64;
    let bound = 4.0 * expected * (2.0 / (count as f64 - 1.0)).sqrt();
    assert!((along - expected).abs() < bound, "{along} {expected}");
}

/// A curve with one point more or less, a gauge that one replicate lacks, a response of zeros, no response:
/// the error is finite, and there is one wherever two replicates have a value.
#[test]
fn gaps_and_useless_responses_are_taken() {
    let pulses = Pulses { common: [0.02, 0.05, 0.02], own: [0.03, 0.05, 0.02] };
    let mut data = measured(&pulses, 4, 9);
    for t in 0..TIMES {
        data.replicates[0].values[TIMES + t] = None;
    }
    data.replicates[1].values[7] = None;
    for replicate in &mut data.replicates[1..] {
        replicate.values[3] = None;
    }
    let truth = curve(1.0);
    let zero = vec![0.0; truth.len()];
    for response in [Some(&truth[..]), Some(&zero[..]), None] {
        let factor = of_replicates(&data, response).unwrap().factor;
        assert!(factor.as_slice().iter().all(|f| f.is_finite()));
        let known = factor.iter_rows().filter(|row| row.iter().any(|f| *f != 0.0)).count();
        assert_eq!(known, GAUGES * TIMES - 1, "one value has no scatter");
    }
    let two = Measurements::new(layout(), data.replicates[..2].to_vec());
    assert_eq!(of_replicates(&two, Some(&truth)), None);
}

/// Data without noise: the deviations are explained exactly, and the error is that of their gains.
#[test]
fn data_without_noise_are_no_division_by_zero() {
    let truth = curve(1.0);
    let replicate = |r: usize| {
        let gain = [0.97, 1.0, 1.03][r];
        Replicate::new(r.to_string(), truth.iter().map(|y| Some(gain * y)).collect())
    };
    let data = Measurements::new(layout(), (0..3).map(replicate).collect());
    let factor = of_replicates(&data, Some(&truth)).unwrap().factor;
    assert!(factor.as_slice().iter().all(|f| f.is_finite()));
    let most = truth.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    let variance: f64 = factor.row(most).iter().map(|f| f * f).sum();
    assert!(variance.sqrt() > 0.03 / 3.0_f64.sqrt() * truth[most], "{variance}");
}

/// The strain of a target of `configs/sns-fatigue` without noise, in microstrain: gauge by gauge, 100 times.
fn target(name: &str) -> Vec<f64> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/sns-fatigue/truth.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().filter(|line| line.starts_with(&format!("{name},1,")));
    rows.map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
}

/// Noise of each gauge in microstrain, from the record of how the measurements were made.
fn noises() -> Vec<f64> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/sns-fatigue/measurements.json");
    let record: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let gauges = record["gauges: name, noise sd [microstrain]"].as_array().unwrap();
    gauges.iter().map(|gauge| gauge[1].as_f64().unwrap()).collect()
}

/// Pulses at a target, as `examples/fatigue_measurements.rs` makes them: 2 % common and 3 % own gain, shifts of 1 us each.
fn pulses_at_target(truth: &[f64], noises: &[f64], count: usize, seed: u64) -> Measurements {
    let times: Vec<f64> = (1..=100).map(|t| 10.0 * f64::from(t)).collect();
    let replicate = |r: usize| {
        let mut rng = Stream::root(seed).at(r as u64).generator();
        let [gain, shift] = [0.02, 1.0].map(|sd| sd * normal(&mut rng));
        let mut values = Vec::new();
        for (curve, noise) in truth.chunks(100).zip(noises) {
            let [gain, shift] = [1.0 + gain + 0.03 * normal(&mut rng), shift + normal(&mut rng)];
            for time in &times {
                let at = ((time - shift) / 10.0).clamp(0.0, 100.0);
                let before = at.floor().min(99.0);
                let value = |t: f64| if t < 1.0 { 0.0 } else { curve[t as usize - 1] };
                let y = value(before) + (at - before) * (value(before + 1.0) - value(before));
                values.push(Some(gain * y + noise * normal(&mut rng)));
            }
        }
        Replicate::new(r.to_string(), values)
    };
    let unit = Unit::dimensionless();
    let axes = vec![
        Axis::labels("gauge", (0..10).map(|g| format!("G{g}"))),
        Axis::grid("time", times.clone(), unit.clone()),
    ];
    let layout = Layout { name: "strain".into(), unit, axes };
    Measurements::new(layout, (0..count).map(replicate).collect())
}

/// Factor of the error of the mean of some data.
type Method<'a> = &'a dyn Fn(&Measurements) -> Matrix;

/// The table of `docs/statistics.md`: `cargo test -p lacuna-engine --lib table_of_the_guide -- --ignored --nocapture`, 2 min.
#[test]
#[ignore = "1200 data sets in three ways take two minutes"]
fn the_table_of_the_guide() {
    const SETS: u64 = 200;
    let (truth, noises) = (target("T24"), noises());
    let (slow, fast) = (target("T26"), target("T28"));
    let speed = |i: usize| (fast[i] - slow[i]) / (1_853.296_13 - 1_842.163_60);
    for unknowns in [1, 2] {
        let slope = |i: usize, j: usize| if j == 0 { speed(i) } else { truth[i] };
        let slopes = Matrix::from_fn(truth.len(), unknowns, slope);
        for count in [3, 5, 20] {
            let none = |_: &Measurements| Matrix::zeros(truth.len(), 1);
            let now = |data: &Measurements| {
                Matrix::clone(&of_replicates(data, Some(&truth)).unwrap().factor)
            };
            let methods: [(&str, Method<'_>); 3] =
                [("none", &none), ("sampled", &sampled), ("gain, timing, offset", &now)];
            for (name, error) in methods {
                let mut held = vec![0.0; unknowns];
                let mut squares = vec![0.0; unknowns];
                for seed in 0..SETS {
                    let data = pulses_at_target(&truth, &noises, count, seed);
                    let found = estimated(&data, &error(&data), &truth, &slopes);
                    for (j, [error, sd]) in found.into_iter().enumerate() {
                        held[j] += f64::from(u8::from(error.abs() < 1.96 * sd)) / SETS as f64;
                        squares[j] += error * error / SETS as f64;
                    }
                }
                let errors: Vec<f64> = squares.iter().map(|s| s.sqrt()).collect();
                println!(
                    "{unknowns} unknowns, {count} replicates, {name}: held {held:.3?}, error {errors:.4?}"
                );
            }
        }
    }
}
