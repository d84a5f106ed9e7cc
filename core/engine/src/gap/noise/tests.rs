//! Noise of an experiment: what is made with known noise is found, and whitening makes it white.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Layouts, Measurements, Parameter, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};

use super::*;
use crate::gap::experiment::stated::Statement;
use crate::gap::system::whitener::Whitener;
use crate::study::noise::OutputNoise;

/// A response that depends on nothing.
struct Fixed(Vec<f64>);

impl Forward for Fixed {
    fn dimension(&self) -> usize {
        0
    }
    fn outputs(&self) -> usize {
        self.0.len()
    }
    fn mean(&self, points: &Matrix) -> Matrix {
        Matrix::from_rows(self.0.len(), (0..points.rows()).map(|_| &self.0))
    }
    fn jacobian(&self, _: &[f64]) -> Matrix {
        Matrix::zeros(self.0.len(), 0)
    }
}

const LENGTH: usize = 60;

fn layouts() -> Layouts {
    let times = (0..LENGTH).map(|t| t as f64).collect();
    let axes = vec![
        Axis::labels("sensor", ["A", "B", "C"]),
        Axis::grid("time", times, Unit::parse("s").unwrap()),
    ];
    Layout { name: "y".into(), unit: Unit::dimensionless(), axes }.into()
}

fn response() -> Vec<f64> {
    (0..3 * LENGTH)
        .map(|i| 10.0 * (0.15 * (i % LENGTH) as f64 + (i / LENGTH) as f64).sin())
        .collect()
}

/// The noise of the tests: memory, offsets of each curve, a gain that all share, and correlated innovations.
fn truth() -> Noise {
    let curve = |sd: f64, a: f64| CurveNoise {
        sd,
        memory: Autoregression::of_autocovariances(&[1.0, a], 1).0,
        level: 0.0,
        wander: ReplicateVariation { offset: 0.25, ..ReplicateVariation::default() },
        profile: vec![1.0; LENGTH],
    };
    let correlation = Matrix::from_rows(3, [[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let factor = lacuna_linalg::Cholesky::new(&correlation).unwrap().lower().clone();
    Noise {
        curves: vec![curve(1.0, 0.5), curve(0.5, 0.3), curve(2.0, 0.0)],
        shared: vec![ReplicateVariation { gain: 0.01, ..ReplicateVariation::default() }],
        across: vec![Some(factor)],
        origins: vec![Origin::Replicates; 3],
    }
}

fn measured<'a>(
    layouts: &'a Layouts,
    parameters: &'a [Parameter],
    forward: &'a Fixed,
    replicates: usize,
) -> Experiment<'a> {
    let values = vec![Some(0.0); 3 * LENGTH];
    let replicate = |r: usize| Replicate::new(r.to_string(), values.clone());
    let layout = layouts.blocks[0].clone();
    let data = Measurements::new(layout, (0..replicates).map(replicate).collect());
    let experiment = Experiment::new(layouts, parameters, forward, &data.into());
    let new = truth().simulate(&experiment, &forward.0, &Stream::root(5));
    experiment.with_replicates(new)
}

/// Standard errors as those of `known_noise_is_found`; that of a correlation r of N pairs is `(1 - r^2) / sqrt(N)`.
#[test]
fn the_noise_that_made_the_replicates_is_found() {
    let (layouts, forward, count) = (layouts(), Fixed(response()), 120);
    let experiment = measured(&layouts, &[], &forward, count);
    let noise = Noise::of(&experiment, &ResponseTangents::fixed(&forward.0), Some(&truth()));
    let n = count as f64 - 1.0;
    let gain = noise.shared[0].gain;
    assert!((gain / 0.01 - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{gain}");
    for (found, truth) in noise.curves.iter().zip(truth().curves) {
        let relative = (found.sd / truth.sd).powi(2) - 1.0;
        assert!(relative.abs() < 4.0 * (2.0 / (n * LENGTH as f64)).sqrt(), "{relative}");
        let offset = found.wander.offset / 0.25 - 1.0;
        // The mean of an autoregression adds its own variance to that of the offset.
        let own = truth.sd.powi(2) / (1.0 - truth.memory.inflation().min(0.5)) / LENGTH as f64;
        assert!(offset.abs() < 5.0 * (2.0 / n).sqrt() * (1.0 + own / 0.25), "{offset}");
    }
    let factor = noise.across[0].as_ref().unwrap();
    assert!((factor[(1, 0)] - 0.5).abs() < 4.0 * 0.75 / (n * LENGTH as f64).sqrt());
    assert_eq!(noise.origins, [Origin::Replicates; 3]);
}

/// White numbers have covariance one: over B draws an entry has standard error `1 / sqrt(B)` off the diagonal. What is
/// checked is the mean square along some directions, whose standard error is `sqrt(2 / B)`.
#[test]
fn whitening_with_the_true_noise_gives_white_numbers() {
    let (layouts, forward, count) = (layouts(), Fixed(response()), 8);
    let mut experiment = measured(&layouts, &[], &forward, count);
    let bump: Vec<f64> =
        (0..3 * LENGTH).map(|i| (-((i as f64 - 80.0) / 9.0).powi(2)).exp()).collect();
    let factor = Matrix::from_vec(3 * LENGTH, 1, bump.clone());
    let common =
        CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true };
    experiment.common = vec![common];
    let noise = truth();
    let whitener = Whitener::new(&experiment, &noise, &forward.0);
    let draws = 400;
    let white: Vec<Vec<f64>> = (0..draws)
        .map(|b| {
            let stream = Stream::root(6).at(b);
            let error = normal(&mut stream.named("common").generator());
            let centre: Vec<f64> =
                forward.0.iter().zip(&bump).map(|(y, u)| y + error * u).collect();
            let new = noise.simulate(&experiment, &forward.0, &stream);
            let (_, means) = experiment.with_replicates(new).means();
            let moved: Vec<f64> = (0..means.len())
                .map(|i| means[i] - forward.0[i] + centre[i] - forward.0[i])
                .collect();
            whitener.whiten(&moved)
        })
        .collect();
    let along = |direction: &[f64]| {
        let norm = direction.iter().map(|x| x * x).sum::<f64>();
        let product = |z: &Vec<f64>| z.iter().zip(direction).map(|(z, d)| z * d).sum::<f64>();
        white.iter().map(|z| product(z).powi(2)).sum::<f64>() / norm / draws as f64
    };
    let bound = 4.5 * (2.0 / draws as f64).sqrt();
    for direction in [
        whitener.whiten(&bump),
        whitener.whiten(&forward.0),
        whitener.whiten(&vec![1.0; 3 * LENGTH]),
        (0..3 * LENGTH).map(|i| f64::from(u8::from(i == 70))).collect(),
        (0..3 * LENGTH).map(|i| (0.9 * i as f64).cos()).collect(),
    ] {
        let square = along(&direction);
        assert!((square - 1.0).abs() < bound, "{square}");
    }
    let mean =
        white.iter().flatten().map(|z| z * z).sum::<f64>() / (draws as usize * 3 * LENGTH) as f64;
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
    let rows = whitener.whiten_rows(&Matrix::from_rows(3 * LENGTH, [&bump, &forward.0]));
    let one = whitener.whiten(&bump);
    assert!(rows.row(0).iter().zip(&one).all(|(a, b)| (a - b).abs() < 1e-9));
}

/// Single records of these misfits about nothing, as those of one sensor under several conditions, and their noise.
fn noise_of_records(misfits: &[Vec<f64>], stated: Option<OutputNoise>) -> (Noise, Option<String>) {
    let length = misfits[0].len();
    let times = (0..length).map(|t| 0.1 * t as f64).collect();
    let axes = vec![
        Axis::labels("scenario", (0..misfits.len()).map(|c| format!("run {c}"))),
        Axis::grid("time", times, Unit::parse("s").unwrap()),
    ];
    let layout = Layout { name: "place".into(), unit: Unit::parse("mm").unwrap(), axes };
    let layouts: Layouts = layout.clone().into();
    let forward = Fixed(vec![0.0; length * misfits.len()]);
    let values = misfits.iter().flatten().map(|y| Some(*y)).collect();
    let data = Measurements::new(layout, vec![Replicate::new("0", values)]).into();
    let mut experiment = Experiment::new(&layouts, &[], &forward, &data);
    experiment.stated =
        stated.map(|own| Statement { outputs: vec![own; length * misfits.len()], by: "the test" });
    let noise = Noise::of(&experiment, &ResponseTangents::fixed(&forward.0), None);
    let words = noise.provenance(&experiment);
    (noise, words)
}

/// Noise of first order with standard deviation one.
fn first_order(a: f64, length: usize, seed: u64) -> Vec<f64> {
    let memory = Autoregression::of_reflections(&[a]);
    let mut rng = Stream::root(31).at(seed).generator();
    let mut values: Vec<f64> = (0..length).map(|_| normal(&mut rng)).collect();
    memory.colour(&mut values);
    values.iter().map(|y| y / memory.variance().sqrt()).collect()
}

/// Smooth misfits with kinks, as dry friction leaves them, forty times as large as the noise: most of them are no noise.
#[test]
fn what_is_large_and_smooth_is_no_noise() {
    for length in [300, 1500] {
        let smooth = |t: usize| {
            let x = t as f64 / length as f64;
            40.0 * ((9.0 * x).sin() + (23.0 * x + 1.0).sin().abs() - 0.5 * (51.0 * x * x).cos())
        };
        let mut misfit = first_order(0.0, length, 1);
        misfit.iter_mut().enumerate().for_each(|(t, y)| *y += smooth(t));
        let (noise, _) = noise_of_records(&[misfit], None);
        let size = noise.curves[0].size();
        assert!(size < 8.0, "{length}: {size} {:?}", noise.curves[0].memory);
    }
}

/// The standard deviation of n values of first order is found with the error `sqrt(T / 2n)`, `T` being the number that
/// counts as one: `(1 + a^2) / (1 - a^2)`; the mean of B such records with that over `sqrt(B)`. Besides, a memory is
/// found shorter by its prior; 20 % are allowed at the longest.
#[test]
fn noise_with_a_memory_is_found_in_a_record() {
    let (length, records) = (300, 40);
    for (a, bias) in [(0.0, 0.03), (0.5, 0.05), (0.8, 0.1), (0.9, 0.2)] {
        let found = (0..records)
            .map(|b| noise_of_records(&[first_order(a, length, b)], None).0.curves[0].size());
        let mean = found.sum::<f64>() / records as f64;
        let counted = (1.0 + a * a) / (1.0 - a * a);
        let error = (counted / (2.0 * length as f64 * records as f64)).sqrt();
        assert!((mean - 1.0).abs() < bias + 4.0 * error, "{a}: {mean}");
    }
}

/// Two records of one instrument, one with a misfit of a form that no slow part describes: the quiet one shows the noise
/// of both. Where values differ from one to the next by other amounts, the instruments differ.
#[test]
fn the_quiet_record_of_an_instrument_shows_its_noise() {
    let length = 200;
    let quiet = first_order(0.3, length, 4);
    let mut loud = first_order(0.3, length, 5);
    loud.iter_mut().enumerate().for_each(|(t, y)| *y += if t / 20 % 3 == 0 { 15.0 } else { 0.0 });
    let alone = noise_of_records(std::slice::from_ref(&loud), None).0.curves[0].size();
    let (noise, words) = noise_of_records(&[quiet.clone(), loud], None);
    let [a, b] = [0, 1].map(|s| noise.curves[s].size());
    assert!(alone > 2.0 && a < 1.3 && b < 1.3, "{alone} {a} {b}");
    assert!(words.unwrap().contains("taken for noise with"));
    let other: Vec<f64> = first_order(0.3, length, 6).iter().map(|y| 5.0 * y).collect();
    let (noise, _) = noise_of_records(&[quiet, other], None);
    assert!(noise.curves[1].size() > 3.5, "{:?}", noise.curves[1]);
}

#[test]
fn what_is_stated_is_used_and_the_rest_is_estimated() {
    let record = first_order(0.6, 400, 7);
    let (noise, words) = noise_of_records(
        std::slice::from_ref(&record),
        Some(OutputNoise { sd: Some(0.9), memory: Some(0.0) }),
    );
    assert_eq!(noise.origins, [Origin::Stated]);
    assert!((noise.curves[0].size() - 0.9).abs() < 1e-12 && noise.curves[0].memory.order() == 0);
    assert_eq!(words.unwrap(), "noise stated: without replicates, the noise is that of the test");
    let (noise, _) = noise_of_records(
        std::slice::from_ref(&record),
        Some(OutputNoise { sd: Some(1.0), memory: None }),
    );
    assert_eq!(noise.origins, [Origin::StatedInPart]);
    let coefficients = noise.curves[0].memory.coefficients().to_vec();
    assert!((noise.curves[0].size() - 1.0).abs() < 1e-9, "{noise:?}");
    assert!((coefficients[0] - 0.6).abs() < 4.0 * (0.64_f64 / 400.0).sqrt(), "{coefficients:?}");
    // A correlation that falls to 1/e over 0.2 s is exp(-0.5) from one value to the next.
    let (noise, words) =
        noise_of_records(&[record], Some(OutputNoise { sd: None, memory: Some(0.2) }));
    assert_eq!(noise.origins, [Origin::StatedInPart]);
    assert!((noise.curves[0].memory.coefficients()[0] - (-0.5_f64).exp()).abs() < 1e-12);
    assert!((noise.curves[0].size() - 1.0).abs() < 4.0 * (2.0_f64 / 800.0).sqrt(), "{noise:?}");
    let words = words.unwrap();
    assert!(words.contains("place under run 0") && words.contains("a memory of 0.20 s"), "{words}");
}
