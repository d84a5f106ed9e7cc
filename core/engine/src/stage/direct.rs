//! Route without a surrogate: the model itself is the forward map.

mod beginning;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use lacuna::math::distribution::Distribution;
use lacuna::plugin::Forward;
use lacuna::plugin::forward::{Numbers, Wanted};
use lacuna::plugin::model::{Call, EvalError, Gradient, Response};
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::best_fit::BestFit;
use super::calls::Calls;
use super::inverse_problem::Route;
use super::read;
use super::read::Data;
use super::simulator::{Setting, Simulator};
use super::{best_fit, replicate_error};
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

/// Measurements and model, which are all that precedes the posterior.
pub struct Direct<'a> {
    data: Kept<Data>,
    /// Best fit to the data, if it was needed.
    best_fit: Option<Kept<BestFit>>,
    /// The model as the forward map.
    pub forward: ModelMap<'a>,
    /// Hash of everything the forward map depends on.
    pub origin: String,
}

impl<'a> Direct<'a> {
    /// Reads the measurements.
    pub fn of(
        study: &'a Study,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Self, Stop> {
        let data = read::stage(study, None, run, observer)?;
        let mut forward = ModelMap::of(study)?;
        let model = study.model.as_ref().map(|m| (m.built.identity(), &m.common));
        let sources = files::hash_sources(&forward.simulator.model.files(&study.directory))?;
        let made_from = json!([model, study.scenarios, study.layouts, sources]);
        let calls = Calls::open(calls_file(run, &made_from)?);
        forward.calls = Some(if run.is_visited() { calls.in_memory() } else { calls });
        let mut origin = json!([model, study.scenarios, study.layouts, study.unknowns, sources]);
        if forward.is_stochastic() {
            origin = json!([origin, study.about.seed]);
        }
        let origin = files::hash(origin.to_string().as_bytes());
        Ok(Self { data, best_fit: None, forward, origin })
    }

    /// The same with the best fit to the data, if the error of the replicates' mean needs it.
    pub fn fitted(
        mut self,
        study: &Study,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Self, Stop> {
        if let Some(measured) = &self.data.value.measured
            && replicate_error::needs_best_fit(study, measured)
        {
            let inputs = json!([self.data.hash, self.origin]);
            let to = (&measured.likelihood, &self.forward as &dyn Forward);
            self.best_fit = Some(best_fit::stage(study, to, &inputs, run, observer)?);
        }
        Ok(self)
    }

    /// The data with the model as the forward map.
    pub fn problem(&self) -> InverseProblem<'_> {
        let known = self.best_fit.as_ref().map(|kept| &kept.value);
        InverseProblem::new(&self.data, Route::Direct(self), None).with_best_fit(known)
    }

    /// Summary of the model's evaluations; see [`ModelMap::tally`].
    pub fn tally(&self) -> Option<String> {
        self.forward.tally()
    }
}

/// File of the slow evaluations of a model with these inputs.
fn calls_file(run: &RunDirectory, made_from: &Value) -> Result<PathBuf, Stop> {
    let folder = Stage::Simulate.part("calls");
    let hash = run.hash_of(&folder, made_from)?;
    Ok(run.stage_folder(&folder).join(format!("{}.jsonl", &hash[..12])))
}

/// The model of a study as its forward map.
///
/// A failed evaluation gives a row of NaN, and is counted with its reason. Derivatives are the model's own if it has
/// any, otherwise finite differences.
pub struct ModelMap<'a> {
    simulator: Simulator<'a>,
    priors: Vec<Distribution>,
    outputs: usize,
    evaluations: AtomicU64,
    failures: Mutex<Failures>,
    /// Slow evaluations that are kept.
    calls: Option<Calls>,
}

#[derive(Default)]
struct Failures {
    reasons: BTreeMap<String, u64>,
    fatal: Option<String>,
}

/// Number of different reasons that are reported.
const TOLD: usize = 5;

impl<'a> ModelMap<'a> {
    /// The forward map of a study's model.
    pub fn of(study: &'a Study) -> Result<Self, Stop> {
        let simulator = Simulator::of(study)?.ok_or_else(|| {
            Stop::new("the study has neither a surrogate nor a model")
                .help("add `[model]`, or `[surrogate]` with simulation runs")
        })?;
        let priors = study.parameters.iter().map(|p| p.prior.clone()).collect();
        Ok(Self::with(simulator, priors, study.layouts.len()))
    }

    /// A simulator as the forward map of its unknowns, which have these priors.
    pub fn with(simulator: Simulator<'a>, priors: Vec<Distribution>, outputs: usize) -> Self {
        let (evaluations, failures) = (AtomicU64::new(0), Mutex::default());
        Self { simulator, priors, outputs, evaluations, failures, calls: None }
    }

    /// Number of evaluations and of failures of the model, with the most frequent reasons.
    pub fn tally(&self) -> Option<String> {
        let failures = self.failures.lock().ok()?;
        let failed: u64 = failures.reasons.values().sum();
        if failed == 0 {
            return None;
        }
        let asked = self.evaluations.load(Ordering::Relaxed);
        let mut reasons: Vec<(&String, &u64)> = failures.reasons.iter().collect();
        reasons.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
        let told: Vec<String> = reasons
            .iter()
            .take(TOLD)
            .map(|(reason, count)| format!("{count} times: {reason}"))
            .collect();
        Some(format!("{failed} of {asked} evaluations of the model failed ({})", told.join("; ")))
    }

    fn note<T>(&self, outcome: Result<T, EvalError>) -> Option<T> {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let error = match outcome {
            Ok(answer) => return Some(answer),
            Err(error) => error,
        };
        if let Ok(mut failures) = self.failures.lock() {
            match error {
                EvalError::Rejected(reason) => *failures.reasons.entry(reason).or_default() += 1,
                EvalError::Fatal(reason) => {
                    failures.fatal.get_or_insert(reason);
                }
            }
        }
        None
    }

    /// Responses to one scenario in some runs: the row of `points` and the number of each. Those that are kept are not
    /// computed again.
    fn some(
        &self,
        place: usize,
        points: &Matrix,
        rows: &[(usize, u64)],
        numbers: Numbers,
    ) -> Vec<Option<Vec<f64>>> {
        let setting = &self.simulator.settings[place];
        let inputs = |&(i, run): &(usize, u64)| setting.inputs_of_run(points.row(i), run, numbers);
        let inputs: Vec<Vec<f64>> = rows.iter().map(inputs).collect();
        let known = |inputs: &Vec<f64>| self.calls.as_ref()?.response(place, inputs);
        let mut answers: Vec<Option<Vec<f64>>> = inputs.iter().map(known).collect();
        let missing: Vec<usize> = (0..rows.len()).filter(|&k| answers[k].is_none()).collect();
        let asked: Vec<&Vec<f64>> = missing.iter().map(|&k| &inputs[k]).collect();
        for (k, answer) in missing.into_iter().zip(self.computed(place, &asked)) {
            answers[k] = answer;
        }
        answers
    }

    /// Responses to one scenario for some inputs of the model.
    fn computed(&self, place: usize, inputs: &[&Vec<f64>]) -> Vec<Option<Vec<f64>>> {
        if inputs.is_empty() || self.failure().is_some() {
            return vec![None; inputs.len()];
        }
        let setting = &self.simulator.settings[place];
        let calls: Vec<Call<'_>> =
            inputs.iter().map(|inputs| self.simulator.call(setting, inputs)).collect();
        let begun = Instant::now();
        let mut responses = self.simulator.model.predict_batch(&calls).into_iter();
        let taken = begun.elapsed() / inputs.len() as u32;
        let missing = || {
            Err(EvalError::Fatal("the model returned fewer responses than requested".to_owned()))
        };
        let one = |inputs: &&Vec<f64>| {
            let answer = self.note(setting.checked(responses.next().unwrap_or_else(missing)))?;
            self.keep(place, inputs, &answer.values, taken);
            Some(answer.values)
        };
        inputs.iter().map(one).collect()
    }

    /// Keeps a response if it was slow; no more responses are computed if that fails.
    fn keep(&self, place: usize, inputs: &[f64], response: &[f64], taken: Duration) {
        let Some(calls) = &self.calls else { return };
        if let Err(stop) = calls.note(place, inputs, response, taken)
            && let Ok(mut failures) = self.failures.lock()
        {
            failures.fatal.get_or_insert(stop.to_string());
        }
    }

    /// Response to one scenario with its derivatives.
    fn answered(
        &self,
        setting: &Setting<'_>,
        gradient: &dyn Gradient,
        point: &[f64],
    ) -> Option<(Response, Matrix)> {
        if self.failure().is_some() {
            return None;
        }
        self.note(self.simulator.with_derivatives(setting, gradient, point))
    }

    /// Response, and derivatives by central differences; one-sided at an end of a prior, outside of which the model is not
    /// evaluated, and where the model can be evaluated on one side only.
    fn differences(&self, point: &[f64], columns: &[usize]) -> (Vec<f64>, Matrix) {
        let steps: Vec<f64> = columns.iter().map(|&j| step(&self.priors[j], point[j])).collect();
        let mut around = vec![point.to_vec()];
        // Row of the responses on either side.
        let mut rows = Vec::with_capacity(columns.len());
        for (&j, step) in columns.iter().zip(&steps) {
            let (low, high) = self.priors[j].support();
            rows.push([1.0, -1.0].map(|sign| {
                let mut moved = point.to_vec();
                moved[j] += sign * step;
                (low..=high).contains(&moved[j]).then(|| {
                    around.push(moved);
                    around.len() - 1
                })
            }));
        }
        // Differences of a stochastic response are those between runs with the same random numbers.
        let responses = self.runs(&Matrix::from_rows(point.len(), around), 1, Numbers::Common(0));
        let slope = |i: usize, j: usize| {
            let [above, below] = rows[j].map(|row| row.map_or(f64::NAN, |row| responses[(row, i)]));
            let here = responses[(0, i)];
            match (above.is_finite(), below.is_finite()) {
                (true, true) => (above - below) / (2.0 * steps[j]),
                (true, false) => (above - here) / steps[j],
                _ => (here - below) / steps[j],
            }
        };
        (responses.row(0).to_vec(), Matrix::from_fn(self.outputs, columns.len(), slope))
    }
}

/// Step of the finite difference: small compared with the prior, and large compared with rounding.
fn step(prior: &Distribution, x: f64) -> f64 {
    let width = prior.quantile(0.975) - prior.quantile(0.025);
    (1e-5 * width).max(1e-9 * x.abs()).max(f64::MIN_POSITIVE)
}

impl Forward for ModelMap<'_> {
    fn dimension(&self) -> usize {
        self.priors.len()
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn is_stochastic(&self) -> bool {
        self.simulator.is_stochastic()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.runs(points, 1, Numbers::OfPoint)
    }

    fn runs(&self, points: &Matrix, count: usize, numbers: Numbers) -> Matrix {
        let size = self.simulator.model.batch().max(1);
        let of_point = |i: usize| (0..count as u64).map(move |run| (i, run));
        let rows: Vec<(usize, u64)> = (0..points.rows()).flat_map(of_point).collect();
        let all_rows: Vec<usize> = (0..rows.len()).collect();
        let settings = &self.simulator.settings;
        let tasks: Vec<(usize, &[usize])> = (0..settings.len())
            .flat_map(|place| all_rows.chunks(size).map(move |some| (place, some)))
            .collect();
        let answer = |&(place, some): &(usize, &[usize])| {
            self.some(place, points, &rows[some[0]..some[0] + some.len()], numbers)
        };
        let answers: Vec<Vec<Option<Vec<f64>>>> = tasks.par_iter().map(answer).collect();
        let mut all = Matrix::zeros(rows.len(), self.outputs);
        for (&(place, some), answers) in tasks.iter().zip(answers) {
            for (&row, answer) in some.iter().zip(answers) {
                let outputs = &mut all.row_mut(row)[settings[place].outputs.clone()];
                match answer {
                    Some(values) => outputs.copy_from_slice(&values),
                    None => outputs.fill(f64::NAN),
                }
            }
        }
        all
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.mean_and_jacobian(point).1
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let Some(gradient) = self.simulator.model.gradient() else {
            let all: Vec<usize> = (0..point.len()).collect();
            return self.differences(point, &all);
        };
        let mut mean = vec![f64::NAN; self.outputs];
        let mut jacobian = Matrix::from_fn(self.outputs, point.len(), |_, _| f64::NAN);
        let parts: Vec<Option<(Response, Matrix)>> = self
            .simulator
            .settings
            .par_iter()
            .map(|setting| self.answered(setting, gradient, point))
            .collect();
        for (setting, part) in self.simulator.settings.iter().zip(parts) {
            let Some((response, slopes)) = part else { continue };
            mean[setting.outputs.clone()].copy_from_slice(&response.values);
            for (row, slopes) in setting.outputs.clone().zip(slopes.iter_rows()) {
                jacobian.row_mut(row).copy_from_slice(slopes);
            }
        }
        (mean, jacobian)
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let Some(gradient) = self.simulator.model.gradient() else {
            return self.differences(point, wanted.parameters);
        };
        let beginnings = wanted
            .outputs
            .and_then(|needed| self.derivatives_of_beginnings(needed, gradient, point));
        let (mean, jacobian) = beginnings.unwrap_or_else(|| self.mean_and_jacobian(point));
        (mean, jacobian.select_columns(wanted.parameters))
    }

    fn mean_at(&self, needed: &[bool], points: &Matrix) -> Matrix {
        self.mean_of_beginnings(needed, points).unwrap_or_else(|| self.mean(points))
    }

    fn failure(&self) -> Option<String> {
        self.failures.lock().ok().and_then(|failures| failures.fatal.clone())
    }
}
