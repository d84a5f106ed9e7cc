//! A chain of two masses: eight replicates under two forces, a polynomial chaos in place of the model, one hidden effect.

use std::sync::OnceLock;

use generator::{Case, Chain, Kind, PARAMETERS, REFERENCE, SENSORS, chain::CONDITIONS, times};
use lacuna::data::{Axis, Layout, Layouts, Measurements, Observations, Parameter, Replicate, Unit};
use lacuna::gap::candidates::proposed;
use lacuna::gap::experiment::Experiment;
use lacuna::gap::name::{Found, Options, Verdict, search, verdict};
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

fn layouts() -> Layouts {
    let axes = || {
        let seconds = Unit::parse("s").unwrap();
        vec![Axis::labels("sensor", SENSORS), Axis::grid("time", times(), seconds)]
    };
    let layout = || Layout { name: "y".into(), unit: Unit::dimensionless(), axes: axes() };
    Layouts::of_scenarios([("knock", layout()), ("sweep", layout())])
}

fn parameters() -> Vec<Parameter> {
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
fn emulator() -> &'static (Box<dyn Emulator>, CommonError) {
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

fn observations(case: &Case, layouts: &Layouts) -> Observations {
    let count = case.replicates[0].len();
    let replicate = |r: usize| Replicate {
        name: r.to_string(),
        values: case.replicates.iter().flat_map(|c| c[r].iter().map(|y| Some(*y))).collect(),
    };
    let layout = layouts.blocks[0].clone();
    Measurements { layout, replicates: (0..count).map(replicate).collect() }.into()
}

struct Answer {
    p: [f64; 3],
    verdict: Verdict,
    rest: [f64; 3],
    consistency: f64,
    stability: f64,
    seconds: f64,
}

fn ask(case: &Case, seed: u64, simulations: usize) -> Answer {
    let began = std::time::Instant::now();
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
    let options = Options { naming: 0.03, unlisted: 0.02, simulations, most: 3 };
    let found: Found<'_> =
        search(&experiment, &candidates, &[centre], options, &Stream::root(seed)).unwrap();
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    Answer {
        p: first.p,
        verdict: verdict(&found, &candidates, options),
        rest: found.last.p,
        consistency: found.consistency,
        stability: found.stability,
        seconds: began.elapsed().as_secs_f64(),
    }
}

#[test]
fn table() {
    let kinds: Vec<(Kind, &str)> = vec![
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
        (Kind::Burst, ""),
        (Kind::Switching, ""),
    ];
    let number = |name: &str, other: f64| -> f64 {
        std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(other)
    };
    let (ratio, each) = (number("RATIO", 1.0), number("EACH", 2.0) as u64);
    let nulls = number("NULLS", 4.0) as u64;
    let simulations = number("SIMULATIONS", 199.0) as usize;
    println!("emulator");
    let (_, error) = emulator();
    println!("{}", error.factor.columns());
    for seed in 0..nulls {
        let case = generator::case(1000 + seed, &[], 0.0, 8);
        let answer = ask(&case, seed, simulations);
        println!("null {}", said(&answer));
    }
    for (kind, name) in kinds {
        if std::env::var("KIND").is_ok_and(|only| only != name) {
            continue;
        }
        for seed in 0..each {
            let sensor = (seed % 4) as usize;
            let case =
                generator::case(7919 * kind as u64 + seed, &[(kind, vec![sensor])], ratio, 8);
            let answer = ask(&case, seed, simulations);
            println!("{name} {} {}", SENSORS[sensor], said(&answer));
        }
    }
}

fn said(answer: &Answer) -> String {
    let effects: Vec<String> = answer
        .verdict
        .effects
        .iter()
        .map(|e| {
            format!(
                "{}{:?} {:.2} {:?}",
                e.kind,
                e.on.values().collect::<Vec<_>>(),
                e.probability,
                e.class
            )
        })
        .collect();
    format!(
        "{:?} {:?} {} rest {:?} closed {:.2} consistency {:.4} stability {:.2} {:?} {:.1} s",
        answer.p,
        answer.verdict.word,
        effects.join(" + "),
        answer.rest,
        answer.verdict.closed,
        answer.consistency,
        answer.stability,
        answer.verdict.reasons,
        answer.seconds
    )
}
