//! The truths: points of the prior with their responses.

use rand::seq::SliceRandom as _;
use serde_json::json;

use crate::data::Ensemble;
use crate::linalg::Matrix;
use crate::math::random::{Stream, uniform};
use crate::plugin::Hyperparameter;
use crate::run::{Observer, RunDirectory, Stop};
use crate::study::Study;

use crate::diagnose::coverage::Source;
use crate::stage::read::{self, Runs};
use crate::stage::simulate::{Asked, grown};
use crate::stage::simulator::Simulator;

/// Truths with their responses.
pub struct Truths {
    /// The values of the parameters, one truth a row.
    pub points: Matrix,
    /// The response to each, without effects, or why there is none.
    pub responses: Vec<Result<Vec<f64>, String>>,
    /// The part of the runs that the emulator of each must not know; 0 where truths are of the model.
    pub parts: Vec<usize>,
}

const FOLDER: &str = "7-coverage-truths";
const FINER: &str = "7-coverage-truths-finer";

/// Draws from the priors of the parameters, one a row: the first ones are the same however many there are.
fn draws(study: &Study, count: usize, stream: &Stream) -> Matrix {
    let point = |i: usize| {
        let mut rng = stream.at(i as u64).generator();
        study.parameters.iter().map(|p| p.prior.sample(&mut rng)).collect::<Vec<_>>()
    };
    Matrix::from_rows(study.parameters.len(), (0..count).map(point))
}

/// Truths at which the study's model is run. In a study with `[numerical_error]` they are those of its finer model, as far
/// beyond it as the section says the exact solution is.
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
    let mut responses = made(study, &simulator, FOLDER, &points, &model, run, observer)?;
    let mut source = Source::Model;
    if let Some(numerical) = &study.numerical_error {
        let finer = Simulator::with_model(study, &numerical.model)?;
        let model = json!([numerical.model.built.identity(), numerical.model.common]);
        let finer = made(study, &finer, FINER, &points, &model, run, observer)?;
        let whole = numerical.written.whole();
        responses =
            responses.into_iter().zip(finer).map(|(a, b)| Ok(limit(&a?, &b?, whole))).collect();
        source = Source::FinerModel;
    }
    Ok((Truths { points, responses, parts: vec![0; count] }, source))
}

/// What two meshes tend to.
fn limit(ordinary: &[f64], finer: &[f64], whole: f64) -> Vec<f64> {
    ordinary.iter().zip(finer).map(|(a, b)| a + whole * (b - a)).collect()
}

fn made(
    study: &Study,
    simulator: &Simulator<'_>,
    folder: &str,
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
            return Err(format!("the model gave no answer: {reason}"));
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
        .help("`--from-runs` takes runs that are held back as truths")),
        _ => Ok(responses),
    }
}

/// Into how many parts the runs are cut at most.
const PARTS: usize = 10;
/// No fewer runs than this are truths of one part, so that few parts are fitted where few runs can be truths.
const SMALLEST: usize = 2;

/// Runs that are held back, as truths: those that a sample of the prior could be (by rejection, where the runs were
/// made under another law), those of the validation first, in random order.
///
/// Also the number of runs that could be truths, and the parts: the runs that the emulator of each must not know.
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
            "none of the {} simulation runs can stand for a draw from the prior",
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

/// The runs that are a sample of the prior: of valid ones each with the probability of its prior density over that of the
/// design, as a share of the largest.
fn of_prior(study: &Study, ensemble: &Ensemble, stream: &Stream) -> Vec<usize> {
    let weight = |run: usize| -> f64 {
        let point = ensemble.points.row(run);
        let each = study.parameters.iter().zip(point);
        each.map(|(p, &x)| p.prior.log_density(x) - p.design.log_density(x)).sum()
    };
    let weights: Vec<f64> = (0..ensemble.runs.len()).map(weight).collect();
    // A run outside its own design has no known law.
    let usable = |run: &usize| ensemble.valid[*run] && weights[*run].is_finite();
    let largest =
        (0..weights.len()).filter(usable).map(|run| weights[run]).fold(f64::NEG_INFINITY, f64::max);
    let accepted = |run: &usize| {
        let u = uniform(&mut stream.named("accept").at(*run as u64).generator());
        u.ln() <= weights[*run] - largest + 1e-12
    };
    (0..weights.len()).filter(usable).filter(accepted).collect()
}

/// Draws of unknowns beside the parameters from their priors.
pub fn of_priors(hyper: &[Hyperparameter], stream: &Stream) -> Vec<f64> {
    let mut rng = stream.generator();
    hyper.iter().map(|h| h.prior.sample(&mut rng)).collect()
}
