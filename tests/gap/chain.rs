//! The workflow on a chain of two masses under two forces, with a polynomial chaos expansion in place of the model.

use std::ops::Range;
use std::sync::OnceLock;

use generator::chain::CONDITIONS;
use generator::{Case, Chain, Kind, PARAMETERS, REFERENCE, SENSORS, times};
use lacuna::data::{Axis, Layout, Layouts, Measurements, Observations, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::plugin::effect::Situation;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_engine::gap::candidates::{Candidate, proposed};
use lacuna_engine::gap::experiment::Experiment;
use lacuna_engine::gap::noise::{Noise, ResponseTangents};
use lacuna_engine::gap::prove::{Proof, freedoms, prove};
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::gap::search::{SearchOptions, SearchResult, Verdict, search, verdict};
use lacuna_engine::gap::system::emulator_error::error_covariance;
use lacuna_engine::gap::test::Region;
use lacuna_linalg::Matrix;

use super::cases::options;

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

/// The emulator with its error, estimated by leaving runs out.
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
            gradients: None,
        };
        let fitted = surrogate.plugin.fit(&training, &Stream::root(2), &Progress::new(&Silent));
        let emulator = fitted.unwrap();
        let residuals = &emulator.fit_error().residuals;
        let scale = (RUNS as f64).sqrt();
        let factor = Matrix::from_fn(layouts.len(), RUNS, |i, r| residuals[(r, i)] / scale);
        (
            emulator,
            CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true },
        )
    })
}

/// Some replicates of a case, as observations.
pub fn observations(case: &Case, replicates: Range<usize>) -> Observations {
    let replicate = |r: usize| {
        Replicate::new(
            r.to_string(),
            case.replicates.iter().flat_map(|c| c[r].iter().map(|y| Some(*y))).collect(),
        )
    };
    let layout = layouts().blocks[0].clone();
    Measurements::new(layout, replicates.map(replicate).collect()).into()
}

/// Answer of the workflow for a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// p-values under no gap: of the largest score, the best cell of the scan and the energy.
    pub p: [f64; 3],
    /// Logarithm of the odds that any candidate acts.
    pub log_odds: f64,
    /// Verdict of the search.
    pub verdict: Verdict,
    /// Regions in which data and model disagree.
    pub regions: Vec<Region>,
    /// Test of the gap on held-out replicates, if there are any.
    pub proof: Option<Proof>,
}

/// Runs the workflow on a case: the search with some of its replicates, the proof with the others. The workflow does
/// not see what is hidden.
pub fn ask(case: &Case, replicates: usize, seed: u64) -> Answer {
    run(case, replicates, seed, None, |found, candidates, options, _, proof| {
        let verdict = verdict(found, candidates, options);
        let log_odds = found.path.first().map_or(f64::NAN, |step| step.log_odds);
        let first = found.first();
        Answer { p: first.p, log_odds, verdict, regions: first.regions.clone(), proof }
    })
}

/// The result of the workflow among the candidates of these names, and its proof on the other replicates.
pub fn searched(case: &Case, replicates: usize, seed: u64, names: &[&str]) -> (GapResult, Proof) {
    let names: Vec<String> = names.iter().map(ToString::to_string).collect();
    run(case, replicates, seed, Some(&names), |found, candidates, options, stream, proof| {
        (GapResult::of(found, candidates, options, stream), proof.unwrap())
    })
}

/// Searches in some replicates of a case, with all candidates or those of these names, and proves with the others.
fn run<T>(
    case: &Case,
    replicates: usize,
    seed: u64,
    names: Option<&[String]>,
    use_it: impl FnOnce(&SearchResult<'_>, &[Candidate], SearchOptions, &Stream, Option<Proof>) -> T,
) -> T {
    let (layouts, parameters) = (layouts(), parameters());
    let (emulator, error) = emulator();
    let data = observations(case, 0..replicates);
    let mut experiment = Experiment::new(&layouts, &parameters, &**emulator, &data);
    let centre: Vec<f64> = REFERENCE.to_vec();
    let response = emulator.mean(&Matrix::from_rows(4, [&centre])).row(0).to_vec();
    let noise = Noise::of(&experiment, &ResponseTangents::fixed(&response), None);
    let all = error_covariance(&experiment, &noise, &response, std::slice::from_ref(error));
    (experiment.common, experiment.independent) = (all.common, all.independent);
    let sd = noise.sd(&experiment, &response);
    let situation = Situation { layouts: &layouts, response: &response, noise: &sd };
    let candidates = proposed(names, &[], &situation).unwrap().candidates;
    let options = options();
    let stream = Stream::root(seed);
    let found: SearchResult<'_> =
        search(&experiment, &candidates, &[centre], options, &stream).unwrap();
    let held_out = observations(case, replicates..case.replicates[0].len());
    let mut held_out = Experiment::new(&layouts, &parameters, &**emulator, &held_out);
    held_out.common.clone_from(&experiment.common);
    held_out.independent.clone_from(&experiment.independent);
    let (before, after) = (&found.first().fit.at.response, &found.last.fit.at.response);
    let proof = prove(&held_out, &found.noise, &freedoms(&experiment), before, after);
    use_it(&found, &candidates, options, &stream, proof)
}

/// Computes what all cases share, before they run in parallel.
pub fn prepare() {
    emulator();
}

/// The workflow gives the same result with any number of threads.
#[test]
fn threads_change_nothing() {
    prepare();
    let case = generator::case(77, &[(Kind::Echo, vec![1])], 1.0, 8);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ask(&case, 6, 5))
    };
    assert_eq!(with(1), with(2));
}
