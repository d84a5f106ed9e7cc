//! Comparison of finished runs: posteriors, errors, evidences, predictions.

mod mixture;
mod show;
mod weights;

use std::path::{Path, PathBuf};

use lacuna::diagnose::leave_one_out::{LeaveOneOut, compare as difference};
use lacuna::run::{Stop, files};
use lacuna_run::Stage;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::stage::evidence;

use mixture::{Predicted, Weights};

pub use mixture::{Mixed, Spread};
pub use show::{names, tables, text};

/// Results of one run that are compared.
#[derive(Debug, Clone)]
pub struct Finished {
    /// Run directory.
    pub directory: PathBuf,
    /// Contents of `summary.json`.
    pub summary: Value,
    /// Leave-one-out predictions of data.
    left_out: Option<LeaveOneOut>,
    /// Leave-one-out predictions of curves.
    curves_left_out: Option<LeaveOneOut>,
    /// Predicted quantities.
    predicted: Option<Predicted>,
}

impl Finished {
    /// Reads the directory of a finished run.
    pub fn read(directory: &Path) -> Result<Self, Stop> {
        let path = directory.join("summary.json");
        let summary: Value = files::read_json(&path).map_err(|stop| {
            stop.help("give the directories of finished runs, such as `runs/study`")
        })?;
        let known = summary.get("loo").is_some();
        let folder = directory.join(Stage::Evidence.folder().name());
        let left_out = known.then(|| evidence::left_out(&folder)).transpose()?;
        let curves_left_out = left_out.as_ref().and_then(|_| evidence::curves_left_out(&folder));
        let predicted = Predicted::read(directory)?;
        Ok(Self { directory: directory.to_owned(), summary, left_out, curves_left_out, predicted })
    }

    /// A number of the summary, by its path.
    fn number(&self, path: &[&str]) -> Option<f64> {
        path.iter().try_fold(&self.summary, |value, key| value.get(key))?.as_f64()
    }

    fn word(&self, path: &[&str]) -> Option<&str> {
        path.iter().try_fold(&self.summary, |value, key| value.get(key))?.as_str()
    }

    /// Parameters and hyperparameters by name.
    fn parameters(&self) -> Option<&Map<String, Value>> {
        self.summary.get("parameters")?.as_object()
    }
}

/// Comparison of several runs.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// One entry per run, in the given order.
    pub runs: Vec<Entry>,
    /// Quantities that all runs predict, by the mixture of the studies with their weights.
    pub mixed: Vec<Mixed>,
    /// Notes on what limits the comparison.
    pub notes: Vec<String>,
}

/// One run in the comparison.
#[derive(Debug, Clone, Serialize)]
pub struct Entry {
    /// Run directory, as given.
    pub directory: String,
    /// Name of the study.
    pub study: String,
    /// Title of the study.
    pub title: String,
    /// True if the sampler converged.
    pub converged: bool,
    /// Kind and plugin of its components.
    pub components: Value,
    /// Posterior, as in `summary.json`.
    pub parameters: Value,
    /// Error of the surrogate, as in `summary.json`.
    pub surrogate: Value,
    /// Accuracy at the MAP, mean over the groups.
    pub accuracy: Option<f64>,
    /// Standard deviation of a new replicate by origin.
    pub spread: Value,
    /// Log evidence and its standard error.
    pub evidence: Option<[f64; 2]>,
    /// Log evidence of the best run less that of this one, and the standard error of the difference.
    pub evidence_behind: Option<[f64; 2]>,
    /// Posterior probability of the study among those compared, with equal prior probabilities.
    pub probability: Option<f64>,
    /// `elpd_loo` and its standard error: by curve, if curves are known.
    pub loo: Option<[f64; 2]>,
    /// `elpd_loo` of the best run less that of this one, and the standard error of the difference: by curve if the
    /// curves are known, otherwise by datum.
    pub loo_behind: Option<[f64; 2]>,
    /// Expected log predictive density of left-out curves and its standard error.
    pub curves: Option<[f64; 2]>,
    /// That of the best run less that of this one, and the standard error of the difference by curve.
    pub curves_behind: Option<[f64; 2]>,
    /// Number of curves whose predictions are unreliable.
    pub curves_unreliable: Option<f64>,
    /// Number of data whose predictions are unreliable.
    pub loo_unreliable: Option<f64>,
    /// Weight in the mixture of the studies that predicts left-out data best: left-out curves if all runs have them.
    pub stacking: Option<f64>,
    /// Weight by its own left-out predictions and their uncertainty (pseudo-BMA+), of the same parts.
    pub pseudo_bma: Option<f64>,
    /// Duration of its stages when they were made, in seconds.
    pub seconds: Value,
}

/// Compares several runs.
pub fn compare(runs: &[Finished]) -> Comparison {
    let same_data = same(runs, |run| run.word(&["data", "sha256"]).map(str::to_owned));
    let same_priors = same(runs, |run| Some(run.parameters()?.keys().cloned().collect::<Vec<_>>()));
    let mut notes = Vec::new();
    if !same_data {
        notes.push(
            "the runs do not have the same data: their evidences and predictions are not compared"
                .to_owned(),
        );
    } else if !same_priors {
        notes.push(
            "the runs have different unknowns: an evidence depends on the priors of all of them"
                .to_owned(),
        );
    }
    let mut entries: Vec<Entry> = runs.iter().map(entry).collect();
    for (run, entry) in runs.iter().zip(&entries).filter(|(_, e)| !e.converged) {
        let verdict = run.word(&["verdict"]).unwrap_or("no reason is given");
        notes.push(format!("`{}` has not converged: {verdict}", entry.directory));
    }
    if same_data {
        rank_evidences(&mut entries);
        rank_predictions(runs, &mut entries);
        weigh(runs, &mut entries);
    }
    let mixed = mixed(runs, &entries);
    Comparison { runs: entries, mixed, notes }
}

fn same<T: PartialEq>(runs: &[Finished], value: impl Fn(&Finished) -> Option<T>) -> bool {
    runs.windows(2).all(|pair| value(&pair[0]) == value(&pair[1]))
}

fn entry(run: &Finished) -> Entry {
    let part = |key: &str| run.summary.get(key).cloned().unwrap_or(Value::Null);
    let pair =
        |key: &str, value: &str| Some([run.number(&[key, value])?, run.number(&[key, "error"])?]);
    Entry {
        directory: run.directory.display().to_string(),
        study: run.word(&["study"]).unwrap_or_default().to_owned(),
        title: run.word(&["title"]).unwrap_or_default().to_owned(),
        converged: run.summary.get("converged").and_then(Value::as_bool).unwrap_or(false),
        components: part("components"),
        parameters: part("parameters"),
        surrogate: part("surrogate"),
        accuracy: run.number(&["accuracy", "map", "average"]),
        spread: part("spread"),
        evidence: pair("evidence", "log"),
        evidence_behind: None,
        probability: None,
        loo: pair("loo", "elpd")
            .map(|[elpd, error]| [elpd, run.number(&["loo", "error_by_curve"]).unwrap_or(error)]),
        loo_behind: None,
        curves: run.curves_left_out.as_ref().map(|curves| [curves.elpd, curves.error]),
        curves_behind: None,
        curves_unreliable: run.number(&["loo", "curves", "unreliable"]),
        loo_unreliable: run.number(&["loo", "unreliable"]),
        stacking: None,
        pseudo_bma: None,
        seconds: part("seconds"),
    }
}

/// Computes log Bayes factors relative to the best study, and probabilities for equal prior probabilities.
fn rank_evidences(entries: &mut [Entry]) {
    let known: Vec<[f64; 2]> = entries.iter().filter_map(|e| e.evidence).collect();
    let Some(best) = known.iter().copied().reduce(|a, b| if b[0] > a[0] { b } else { a }) else {
        return;
    };
    let total: f64 = known.iter().map(|e| (e[0] - best[0]).exp()).sum();
    for entry in entries.iter_mut() {
        let Some([log, error]) = entry.evidence else { continue };
        let of_difference = if log == best[0] { 0.0 } else { error.hypot(best[1]) };
        entry.evidence_behind = Some([best[0] - log, of_difference]);
        entry.probability = Some((log - best[0]).exp() / total);
    }
}

/// Computes the weights of the studies in one prediction.
fn weigh(runs: &[Finished], entries: &mut [Entry]) {
    let all = |of: fn(&Finished) -> Option<&LeaveOneOut>| {
        weights::densities(&runs.iter().map(of).collect::<Option<Vec<_>>>()?)
    };
    let curves = all(|run| run.curves_left_out.as_ref());
    let Some(densities) = curves.or_else(|| all(|run| run.left_out.as_ref())) else { return };
    let both = weights::stacking(&densities).into_iter().zip(weights::pseudo_bma(&densities));
    for (entry, (stacking, pseudo_bma)) in entries.iter_mut().zip(both) {
        (entry.stacking, entry.pseudo_bma) = (Some(stacking), Some(pseudo_bma));
    }
}

/// Mixes the quantities that all studies predict, where the studies have weights.
fn mixed(runs: &[Finished], entries: &[Entry]) -> Vec<Mixed> {
    let all = |of: fn(&Entry) -> Option<f64>| entries.iter().map(of).collect::<Option<Vec<f64>>>();
    let weights = Weights {
        stacking: all(|entry| entry.stacking),
        pseudo_bma: all(|entry| entry.pseudo_bma),
        probability: all(|entry| entry.probability),
    };
    let none = [&weights.stacking, &weights.pseudo_bma, &weights.probability];
    let predicted: Option<Vec<&Predicted>> =
        runs.iter().map(|run| run.predicted.as_ref()).collect();
    match predicted {
        Some(studies) if none.iter().any(|weights| weights.is_some()) => {
            mixture::mixed(&studies, &weights)
        }
        _ => Vec::new(),
    }
}

fn rank_predictions(runs: &[Finished], entries: &mut [Entry]) {
    let behind = |of: fn(&Finished) -> Option<&LeaveOneOut>| -> Vec<Option<[f64; 2]>> {
        let known = runs.iter().filter_map(of);
        let best = known.reduce(|a, b| if b.elpd > a.elpd { b } else { a });
        let one = |run| {
            let difference = difference(best?, of(run)?).ok()?;
            Some([difference.elpd, difference.error_by_curve.unwrap_or(difference.error)])
        };
        runs.iter().map(one).collect()
    };
    let (data, curves) =
        (behind(|run| run.left_out.as_ref()), behind(|run| run.curves_left_out.as_ref()));
    for (entry, (data, curves)) in entries.iter_mut().zip(data.into_iter().zip(curves)) {
        (entry.loo_behind, entry.curves_behind) = (data, curves);
    }
}

#[cfg(test)]
mod tests;
