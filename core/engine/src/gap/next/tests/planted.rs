//! Planted cases: how often the recommended measurement tells more than a random one.

use lacuna::math::random::{Stream, normal};
use lacuna::text::values::{Count, Name};
use lacuna_linalg::Matrix;

use crate::gap::experiment::Experiment;
use crate::gap::next::{NextOption, Wanted, Wish, next};
use crate::gap::search::Explanation;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit};
use crate::gap::system::whitener::Whitener;
use crate::gap::testing::SyntheticExperiment;
use crate::study::gap::next::NextKeys;

pub(super) const TIMES: usize = 12;
const CONDITIONS: [&str; 2] = ["x", "y"];
const SENSORS: [&str; 4] = ["a", "b", "c", "d"];
pub(super) const CURVES: usize = 8;

/// The noise of all planted cases: an autoregression whose innovations have variance one.
const MEMORY: f64 = 0.3;

/// The forms that an effect may have over time, from 0 to 1.
pub(super) const FORMS: [fn(f64) -> f64; 3] = [|t| t, |t| t.powi(3), |t| 1.0 - (-3.0 * t).exp()];

/// Two conditions and four sensors; a level, and an effect whose size differs by curve.
pub(super) fn world(form: fn(f64) -> f64, strong: &[f64; CURVES]) -> SyntheticExperiment {
    let slope = |j: usize, c: usize, s: usize, t: f64| match j {
        0 => 1.0,
        _ => strong[SENSORS.len() * c + s] * form(t / TIMES as f64),
    };
    SyntheticExperiment::new(&CONDITIONS, &SENSORS, TIMES, MEMORY, &["level", "size"], slope)
}

/// The number of further replicates of a curve.
const FURTHER: usize = 16;

/// The bits from which on an option is expected to decide anything.
const DECISIVE: f64 = 0.1;

/// Further replicates of a single curve.
fn of_curve(curve: usize) -> NextKeys {
    NextKeys {
        name: Some(Name::new(format!("curve{curve}")).unwrap()),
        scenarios: vec![CONDITIONS[curve / SENSORS.len()].to_owned()],
        on: [("sensor".to_owned(), vec![SENSORS[curve % SENSORS.len()].to_owned()])].into(),
        replicates: Count::new(FURTHER).unwrap(),
        ..NextKeys::default()
    }
}

fn curve_of(option: &NextOption) -> usize {
    option.name.trim_start_matches("curve").parse().unwrap()
}

/// The knowledge about the hypotheses of a planted case: the log probability of each, and mean and covariance of its unknowns.
#[derive(Clone)]
struct Known {
    logs: Vec<f64>,
    means: Vec<Vec<f64>>,
    covariances: Vec<Matrix>,
}

impl Known {
    /// The priors: equal probabilities, and standard normal unknowns.
    fn prior() -> Self {
        let unit = Matrix::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 0.0 });
        Self {
            logs: vec![0.0; FORMS.len()],
            means: vec![vec![0.0; 2]; FORMS.len()],
            covariances: vec![unit; FORMS.len()],
        }
    }

    /// Learns from a replicate of a curve, value by value: a sequence of Kalman updates, which shares nothing with
    /// the code under test.
    fn learn(&mut self, slopes: &[&Matrix], curve: usize, data: &[f64]) {
        for t in 0..TIMES {
            let i = curve * TIMES + t;
            let variance = if t == 0 { 1.0 / (1.0 - MEMORY * MEMORY) } else { 1.0 };
            let back =
                |y: &dyn Fn(usize) -> f64| y(i) - if t > 0 { MEMORY * y(i - 1) } else { 0.0 };
            let value = data[t] - if t > 0 { MEMORY * data[t - 1] } else { 0.0 };
            for (h, slopes) in slopes.iter().enumerate() {
                let (mean, covariance) = (&mut self.means[h], &mut self.covariances[h]);
                let g = [0, 1].map(|j| back(&|k| slopes[(j, k)]));
                let along = [0, 1].map(|j| covariance[(j, 0)] * g[0] + covariance[(j, 1)] * g[1]);
                let all = variance + g[0] * along[0] + g[1] * along[1];
                let off = value - g[0] * mean[0] - g[1] * mean[1];
                self.logs[h] -= 0.5 * (off * off / all + all.ln());
                (0..2).for_each(|j| mean[j] += along[j] * off / all);
                let before = covariance.clone();
                *covariance =
                    Matrix::from_fn(2, 2, |j, l| before[(j, l)] - along[j] * along[l] / all);
            }
        }
    }

    /// The probability of a hypothesis.
    fn probability(&self, h: usize) -> f64 {
        1.0 / self.logs.iter().map(|log| (log - self.logs[h]).exp()).sum::<f64>()
    }
}

/// A planted case: how much more information the recommended curve gives on the right name than a random other one, in the
/// mean over the noise of the new replicates. `None` if no curve is expected to decide anything.
fn advantage(case: u64) -> Option<f64> {
    let stream = Stream::root(700 + case);
    let mut rng = stream.named("places").generator();
    let strong = [0.0; CURVES].map(|_: f64| normal(&mut rng).abs());
    let point = [normal(&mut rng), normal(&mut rng)];
    let right = case as usize % FORMS.len();
    let worlds = FORMS.map(|form| world(form, &strong));
    let truth = worlds[right].response(&point);
    let experiment = worlds[0].experiment(&truth, 2, &stream.named("data"));
    let experiments = worlds.each_ref().map(|own| Experiment {
        parameters: &own.parameters,
        forward: &own.forward,
        ..experiment.clone()
    });
    let further = worlds[0].experiment(&truth, FURTHER, &stream.named("further"));
    let slopes = worlds.each_ref().map(|own| &own.forward.slopes);
    let mut known = Known::prior();
    for (c, condition) in experiment.conditions.iter().enumerate() {
        for replicate in &condition.replicates {
            let values: Vec<f64> = replicate.iter().map(|value| value.unwrap()).collect();
            for (s, own) in values.chunks(TIMES).enumerate() {
                known.learn(&slopes, SENSORS.len() * c + s, own);
            }
        }
    }
    let systems = experiments.each_ref().map(|own| System::new(own, Vec::new()));
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &worlds[0].noise, &means);
    let fits: Vec<Fit> =
        systems.iter().map(|system| fit(system, &whitener, &means, &[0.0, 0.0])).collect();
    let own =
        |k: usize| (k.to_string(), known.probability(k), Explanation::exact(&systems[k], &fits[k]));
    let options: Vec<NextKeys> = (0..CURVES).map(of_curve).collect();
    let wish = Wish { options: &options, quantity: None, runs: 0 };
    let all = [own(0), own(1), own(2)];
    let found = next(&all, &worlds[0].noise, wish, &stream.named("next")).unwrap();
    assert_eq!((found.ranked_by, found.options.len()), (Wanted::Name, CURVES));
    let mean = |option: &NextOption| {
        let curve = curve_of(option);
        let one = |r| {
            let new = worlds[0].noise.simulate(&further, &truth, &stream.named("new").at(r));
            let (c, s) = (curve / SENSORS.len(), curve % SENSORS.len());
            let mut after = known.clone();
            for replicate in &new[c] {
                let data = (0..TIMES).map(|t| replicate[s * TIMES + t].unwrap());
                after.learn(&slopes, curve, &data.collect::<Vec<f64>>());
            }
            (after.probability(right) / known.probability(right)).log2()
        };
        (0..200).map(one).sum::<f64>() / 200.0
    };
    let other = 1 + (case as usize / FORMS.len()) % (CURVES - 1);
    (found.options[0].name_bits >= DECISIVE)
        .then(|| mean(&found.options[0]) - mean(&found.options[other]))
}

/// In planted cases the recommended measurement gives more information on the right name than a random other one of equal
/// cost, in at least 80 %. Truth and data of a case are one draw, so that some fail by chance.
#[test]
fn the_recommended_option_beats_a_random_one() {
    let told: Vec<f64> = (0..105).filter_map(advantage).collect();
    let better = told.iter().filter(|own| **own > 0.0).count();
    println!("{better} of {}", told.len());
    assert!(told.len() > 50 && better * 10 >= told.len() * 8, "{better} of {}", told.len());
}
