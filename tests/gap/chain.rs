//! A chain of two masses: eight replicates under two forces, a polynomial chaos in place of the model, one hidden effect.

use std::sync::OnceLock;

use generator::{Case, Chain, Kind, PARAMETERS, REFERENCE, SENSORS, chain::CONDITIONS, times};
use lacuna::data::{Axis, Layout, Layouts, Measurements, Observations, Parameter, Replicate, Unit};
use lacuna::gap::candidates::proposed;
use lacuna::gap::experiment::Experiment;
use lacuna::gap::name::{Found, Named, Options, Verdict, Word, search, verdict};
use lacuna::gap::noise::Noise;
use lacuna::gap::whitener::condensed;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::effect::Situation;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Surrogate, registry};
use lacuna::run::{Progress, Silent};

const RUNS: usize = 150;

pub fn layouts() -> Layouts {
    let axes = || {
        let seconds = Unit::parse("s").unwrap();
        vec![Axis::labels("sensor", SENSORS), Axis::grid("time", times(), seconds)]
    };
    let layout = || Layout { name: "y".into(), unit: Unit::dimensionless(), axes: axes() };
    Layouts::of_scenarios([("knock", layout()), ("sweep", layout())])
}

pub fn parameters() -> Vec<Parameter> {
    let parameter = |(name, x): (&str, f64)| Parameter {
        name: name.into(),
        symbol: name.into(),
        unit: Unit::dimensionless(),
        design: Distribution::Uniform([0.75 * x, 1.25 * x]),
        prior: Distribution::Uniform([0.75 * x, 1.25 * x]),
        reference: None,
    };
    PARAMETERS.into_iter().zip(REFERENCE).map(parameter).collect()
}

fn model(point: &[f64]) -> Vec<f64> {
    let chain = Chain::plain([point[0], point[1], point[2], point[3]]);
    (0..CONDITIONS).flat_map(|c| generator::sampled(&chain.curves(c)).concat()).collect()
}

/// The emulator with its error by leaving runs out.
pub fn emulator() -> &'static (Box<dyn Emulator>, CommonError) {
    static MADE: OnceLock<(Box<dyn Emulator>, CommonError)> = OnceLock::new();
    MADE.get_or_init(|| {
        let design = registry::from_text::<dyn Design>("latin_hypercube", "").unwrap().plugin;
        let unit = design.points(RUNS, 4, &Stream::root(1)).unwrap();
        let parameters = parameters();
        let points = Matrix::from_fn(RUNS, 4, |i, j| parameters[j].design.quantile(unit[(i, j)]));
        let layouts = layouts();
        let responses = Matrix::from_rows(layouts.len(), points.iter_rows().map(model));
        let options = "degree = { max = 8 }";
        let surrogate = registry::from_text::<dyn Surrogate>("polynomial_chaos", options).unwrap();
        let training = Training {
            parameters: &parameters,
            layouts: &layouts,
            points: &points,
            responses: &responses,
        };
        let fitted = surrogate.plugin.fit(&training, &Stream::root(2), &Progress::new(&Silent));
        let emulator = fitted.unwrap();
        let residuals = &emulator.fit_error().residuals;
        let scale = (RUNS as f64).sqrt();
        let factor = Matrix::from_fn(layouts.len(), RUNS, |i, r| residuals[(r, i)] / scale);
        (emulator, CommonError { origin: "emulator".into(), factor, predictive: true })
    })
}

pub fn observations(case: &Case, layouts: &Layouts) -> Observations {
    let count = case.replicates[0].len();
    let replicate = |r: usize| Replicate {
        name: r.to_string(),
        values: case.replicates.iter().flat_map(|c| c[r].iter().map(|y| Some(*y))).collect(),
    };
    let layout = layouts.blocks[0].clone();
    Measurements { layout, replicates: (0..count).map(replicate).collect() }.into()
}

struct Answer {
    /// Probabilities without a gap of the largest score, the best cell of the scan and the energy.
    p: [f64; 3],
    verdict: Verdict,
}

/// The answer of the workflow to a case; it does not see what is hidden.
fn ask(case: &Case, seed: u64) -> Answer {
    let (layouts, parameters) = (layouts(), parameters());
    let (emulator, error) = emulator();
    let data = observations(case, &layouts);
    let mut experiment = Experiment::new(&layouts, &parameters, &**emulator, &data);
    let centre: Vec<f64> = REFERENCE.to_vec();
    let response = emulator.mean(&Matrix::from_rows(4, [&centre])).row(0).to_vec();
    experiment.common = vec![error.clone()];
    let noise = Noise::of(&experiment, &response, None);
    experiment.common = condensed(&experiment, &noise, &response);
    let sd = noise.sd(&experiment, &response);
    let situation = Situation { layouts: &layouts, response: &response, noise: &sd };
    let candidates = proposed(None, &situation).unwrap();
    let options = Options { naming: 0.03, unlisted: 0.02, simulations: 199, most: 3 };
    let stream = Stream::root(seed);
    let found: Found<'_> = search(&experiment, &candidates, &[centre], options, &stream).unwrap();
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    Answer { p: first.p, verdict: verdict(&found, &candidates, options) }
}

/// The effects of the library that are hidden, by the name that they should get.
const LISTED: [(Kind, &str); 13] = [
    (Kind::Gain, "gain"),
    (Kind::Offset, "offset"),
    (Kind::Drift, "drift"),
    (Kind::Delay, "delay"),
    (Kind::LowPass, "low_pass"),
    (Kind::Echo, "echo"),
    (Kind::Damping, "damping"),
    (Kind::Saturation, "saturation"),
    (Kind::SecondaryPulse, "secondary_pulse"),
    (Kind::Flash, "flash"),
    (Kind::LevelJump, "level_jumps"),
    (Kind::Resonance, "resonance"),
    (Kind::Crosstalk, "crosstalk"),
];

/// Cases of each kind: one, or as many as `LACUNA_GAP_CASES` says.
fn cases() -> u64 {
    std::env::var("LACUNA_GAP_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

fn said(answer: &Answer) -> String {
    let one = |e: &Named| format!("{:?} {:?} {:.2}", e.class, e.on.values(), e.probability);
    let effects: Vec<String> = answer.verdict.effects.iter().map(one).collect();
    format!("{:?} {:?} {effects:?} {:?}", answer.p, answer.verdict.word, answer.verdict.reasons)
}

/// The largest number of events of probability `p` in `n` trials that is not surprising: four standard deviations above
/// the mean, and one for the discreteness.
fn most(p: f64, n: u64) -> u64 {
    let n = n as f64;
    (n * p + 4.0 * (n * p * (1.0 - p)).sqrt() + 1.0) as u64
}

/// Effects of the size of one replicate's noise on one sensor. Aims: the truth inside the class in 95 of 100 cases, two
/// false names in 100; the bounds are four standard deviations of such counts away.
#[test]
fn hidden_effects_are_named() {
    let (mut right, mut false_names, mut count) = (0, 0, 0);
    for (kind, name) in LISTED {
        for seed in 0..cases() {
            let sensor = ((seed + kind as u64) % 4) as usize;
            let case = generator::case(7919 * kind as u64 + seed, &[(kind, vec![sensor])], 1.0, 8);
            let answer = ask(&case, seed);
            println!("{name} on {}: {}", SENSORS[sensor], said(&answer));
            let effects = &answer.verdict.effects;
            let inside = effects.iter().any(|e| e.class.iter().any(|class| class == name));
            right += u64::from(inside && answer.verdict.word != Word::None);
            let named = answer.verdict.word == Word::Named;
            false_names += u64::from(named && effects.iter().any(|e| e.kind != name));
            count += 1;
        }
    }
    println!("{right} of {count} in the class, {false_names} false names");
    assert!(count - right <= most(0.05, count), "{right} of {count}");
    assert!(false_names <= most(0.02, count), "{false_names} of {count}");
}

/// Physics that no candidate has: no name may be given.
#[test]
fn what_is_not_listed_gets_no_name() {
    let (mut false_names, mut count) = (0, 0);
    for kind in [Kind::Burst, Kind::Switching, Kind::Cubic] {
        for seed in 0..2 * cases() {
            let sensors =
                if kind == Kind::Burst { vec![(seed % 4) as usize] } else { (0..4).collect() };
            let case = generator::case(7919 * kind as u64 + seed, &[(kind, sensors)], 1.0, 8);
            let answer = ask(&case, seed);
            println!("{kind:?}: {}", said(&answer));
            false_names += u64::from(answer.verdict.word == Word::Named);
            count += 1;
        }
    }
    assert!(false_names <= most(0.1, count), "{false_names} of {count}");
}

/// Nothing is hidden: the alarms are those of the tests' level, three and two in a hundred.
#[test]
fn without_a_gap_there_is_no_alarm() {
    let count = 8 * cases();
    let mut alarms = 0;
    for seed in 0..count {
        let answer = ask(&generator::case(1000 + seed, &[], 0.0, 8), seed);
        println!("nothing: {}", said(&answer));
        alarms += u64::from(answer.verdict.word != Word::None);
    }
    println!("{alarms} alarms of {count}");
    assert!(alarms <= most(0.05, count), "{alarms} of {count}");
}
