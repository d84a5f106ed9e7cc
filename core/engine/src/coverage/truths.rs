//! Truths: points drawn from the prior with their responses.

use lacuna::data::Ensemble;
use lacuna::diagnose::coverage::Source;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::Hyperparameter;
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Folder, RunDirectory, Stage};
use rand::seq::SliceRandom as _;
use serde_json::json;

use crate::stage::read::{self, Runs};
use crate::stage::simulate::{Asked, grown};
use crate::stage::simulator::Simulator;
use crate::study::Study;

/// Truths with their responses.
pub struct Truths {
    /// Values of the parameters, `truths x parameters`.
    pub points: Matrix,
    /// Response to each truth without effects, or the reason why there is none.
    pub responses: Vec<Result<Vec<f64>, String>>,
    /// Index of the part of the runs that must be held out from the emulator of each truth; 0 if truths come from the
    /// model.
    pub parts: Vec<usize>,
}

/// Folder of the truths' runs.
fn runs_folder() -> Folder {
    Stage::Simulate.inside(Stage::Coverage, "coverage")
}

/// Draws from the priors of the parameters, one per row; the first ones do not depend on `count`.
fn draws(study: &Study, count: usize, stream: &Stream) -> Matrix {
    let point = |i: usize| {
        let mut rng = stream.at(i as u64).generator();
        study.prior().sample(&mut rng)
    };
    Matrix::from_rows(study.parameters.len(), (0..count).map(point))
}

/// Truths at which the study's model is run. In a study with `[numerical_error]` the responses are those of its finer
/// model, extrapolated to the exact solution as that section states.
pub fn of_model(
    study: &Study,
    count: usize,
    stream: &Stream,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Truths, Source), Stop> {
    let points = draws(study, count, stream);
    let (Some(simulator), Some(section)) = (Simulator::of(study)?, &study.model) else {
        return Err(Stop::new("the study has no model"));
    };
    let model = json!([section.built.identity(), section.common]);
    let mut responses = made(study, &simulator, &runs_folder(), &points, &model, run, observer)?;
    let mut source = Source::Model;
    if let Some(numerical) = &study.numerical_error {
        let finer = Simulator::with_model(study, &numerical.model)?;
        let model = json!([numerical.model.built.identity(), numerical.model.common]);
        let folder = runs_folder().part("finer");
        let finer = made(study, &finer, &folder, &points, &model, run, observer)?;
        let whole = numerical.written.whole();
        responses =
            responses.into_iter().zip(finer).map(|(a, b)| Ok(limit(&a?, &b?, whole))).collect();
        source = Source::FinerModel;
    }
    Ok((Truths { points, responses, parts: vec![0; count] }, source))
}

/// Extrapolated response from two meshes.
fn limit(ordinary: &[f64], finer: &[f64], whole: f64) -> Vec<f64> {
    ordinary.iter().zip(finer).map(|(a, b)| a + whole * (b - a)).collect()
}

fn made(
    study: &Study,
    simulator: &Simulator<'_>,
    folder: &Folder,
    points: &Matrix,
    model: &serde_json::Value,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Vec<Result<Vec<f64>, String>>, Stop> {
    let names: Vec<String> = (1..=points.rows()).map(|i| format!("truth{i:05}")).collect();
    observer.begin("truths", "run", (names.len() * simulator.settings.len()) as u64);
    let asked = Asked::new(&names, points);
    let kept = grown(study, simulator, folder, asked, model, run, observer)?;
    let path = run.stage_folder(folder);
    let runs = read::ensemble_with_failed(study, Runs { folder: &path, made: &kept.value });
    let ensemble =
        runs.map_err(|stop| stop.help("the runs of the truths are read like the study's own"))?;
    let one = |name: &String| {
        let Some(row) = ensemble.runs.iter().position(|run| run == name) else {
            let failed = ensemble.failed.iter().find(|failed| &failed.run == name);
            let reason = failed.map_or("the run has no response", |failed| failed.reason.as_str());
            return Err(format!("the evaluation of the model failed: {reason}"));
        };
        if !ensemble.valid[row] {
            return Err("the model is outside its range of validity".to_owned());
        }
        Ok(ensemble.responses.row(row).to_vec())
    };
    let responses: Vec<_> = names.iter().map(one).collect();
    let answers = responses.iter().filter(|response| response.is_ok()).count();
    observer.end("truths", &format!("{answers} responses"));
    match responses.iter().find_map(|response| response.as_ref().err()) {
        Some(reason) if answers == 0 => Err(Stop::new(format!(
            "the model has no response at any of {} truths drawn from the prior: {reason}",
            names.len()
        ))
        .help("`--from-runs` uses held-out runs as truths")),
        _ => Ok(responses),
    }
}

/// Largest number of parts into which the runs are divided.
const PARTS: usize = 10;
/// Smallest number of runs per part, so that only a few emulators are fitted if few runs can be truths.
const SMALLEST: usize = 2;

/// Held-out runs as truths: a sample from the prior (by rejection, if the runs were drawn from another distribution),
/// those of the validation set first, in random order.
///
/// Also returns the number of runs that could be truths, and the parts: the runs held out from the emulator of each.
pub fn held_back(
    study: &Study,
    ensemble: &Ensemble,
    validation: &[usize],
    count: usize,
    stream: &Stream,
) -> Result<(Truths, usize, Vec<Vec<usize>>), Stop> {
    let mut chosen = of_prior(study, ensemble, stream);
    chosen.shuffle(&mut stream.named("order").generator());
    chosen.sort_by_key(|run| !validation.contains(run));
    if chosen.is_empty() {
        return Err(Stop::new(format!(
            "none of the {} simulation runs can serve as a draw from the prior",
            ensemble.runs.len()
        ))
        .help("truths need runs inside the prior: narrow the design, or add `[model]` so that truths can be run"));
    }
    let all = chosen.len();
    let size = all.div_ceil(PARTS).max(SMALLEST);
    chosen.truncate(count);
    let parts = chosen.chunks(size).map(<[usize]>::to_vec).collect();
    let truths = Truths {
        points: ensemble.points.select_rows(&chosen),
        responses: chosen.iter().map(|&run| Ok(ensemble.responses.row(run).to_vec())).collect(),
        parts: (0..chosen.len()).map(|k| k / size).collect(),
    };
    Ok((truths, all, parts))
}

/// Indices of runs that are a sample from the prior: each valid run is accepted with probability proportional to the
/// ratio of its prior to its design density.
fn of_prior(study: &Study, ensemble: &Ensemble, stream: &Stream) -> Vec<usize> {
    let weight = |run: usize| -> f64 {
        let point = ensemble.points.row(run);
        let each = study.parameters.iter().zip(point);
        let own: f64 = each.map(|(p, &x)| p.prior.log_density(x) - p.design.log_density(x)).sum();
        let prior = study.prior();
        if prior.is_independent() || !own.is_finite() { own } else { own + prior.joint(point) }
    };
    let weights: Vec<f64> = (0..ensemble.runs.len()).map(weight).collect();
    // The distribution of a run outside its own design is unknown.
    let usable = |run: &usize| ensemble.valid[*run] && weights[*run].is_finite();
    let largest =
        (0..weights.len()).filter(usable).map(|run| weights[run]).fold(f64::NEG_INFINITY, f64::max);
    let accepted = |run: &usize| {
        let u = uniform(&mut stream.named("accept").at(*run as u64).generator());
        u.ln() <= weights[*run] - largest + 1e-12
    };
    (0..weights.len()).filter(usable).filter(accepted).collect()
}

/// Draws of the hyperparameters from their priors.
pub fn of_priors(hyper: &[Hyperparameter], stream: &Stream) -> Vec<f64> {
    let mut rng = stream.generator();
    hyper.iter().map(|h| h.prior.sample(&mut rng)).collect()
}
