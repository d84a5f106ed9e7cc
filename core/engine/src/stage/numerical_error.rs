//! Numerical error of the model, from some runs of the design repeated with finer numerics.
//!
//! A mesh that is fine enough for a picture may be too coarse for a calibration with ten thousand points: its error is
//! common to all replicates and correlated between outputs, and resembles a change of the parameters. It has a sign and
//! depends on the parameters, so it is predicted from them as far as held-out runs confirm; the remainder is treated as
//! noise with mean zero.

use std::collections::HashMap;
use std::path::Path;

use lacuna::data::{Ensemble, Parameter};
use lacuna::math::distribution::Distribution;
use lacuna::math::moments;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::plugin::surrogate::FitError;
use lacuna::plugin::{Emulator, Fact};
use lacuna::run::{Observer, Progress, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::arrays::{self, Array};
use lacuna_run::{Artifact, Folder, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::best_fit::Fit;
use super::common_error::Allowance;
use super::emulator_error::{self, Curves};
use super::fidelity::{Combined, Coverage, Difference, Lesson, Rule, Source, Verdict, cover};
use super::idle::Used;
use super::read::{self, Data, Runs};
use super::simulator::Simulator;
use super::surrogate::Fitted;
use super::{grouped, low_fidelity, simulate, stream};
use crate::study::Study;
use crate::study::fidelity::NumericalError as Asked;
use crate::study::file::NumericalErrorSection;

/// Differences between finer and ordinary runs.
#[derive(Debug, Clone, PartialEq)]
pub struct NumericalError {
    /// Response of the finer run minus that of the ordinary run, `runs x outputs`.
    pub differences: Matrix,
    /// Parameters of these runs, `runs x parameters`.
    pub points: Matrix,
    /// Prediction of the differences from the parameters, if the study requests it.
    pub prediction: Option<Difference>,
    /// Interval of each parameter from which the runs were chosen, if narrower than the design.
    pub region: Option<Vec<(f64, f64)>>,
}

/// Human-readable part of the result.
#[derive(Serialize, Deserialize)]
struct Readable {
    region: Option<Vec<(f64, f64)>>,
    prediction: Option<Vec<Verdict>>,
}

const FILE: &str = "differences.nc";
const PREDICTION: &str = "prediction.bin";
const READABLE: &str = "prediction.json";
/// Folders of the finer runs and of the differences.
pub fn folders() -> [Folder; 2] {
    [Stage::Simulate.part("finer"), Stage::NumericalError.folder()]
}

impl Artifact for NumericalError {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let arrays = [
            Array::matrix("differences", "run", "output", &self.differences),
            Array::matrix("points", "run", "parameter", &self.points),
        ];
        arrays::write(&folder.join(FILE), &[], &arrays)?;
        let prediction = self.prediction.as_ref().map(|p| p.verdicts.clone());
        let readable = Readable { region: self.region.clone(), prediction };
        files::write_json(&folder.join(READABLE), &readable)?;
        let mut written = vec![FILE.to_owned(), READABLE.to_owned()];
        if let Some(prediction) = &self.prediction {
            files::write_atomic(&folder.join(PREDICTION), &prediction.to_bytes()?)?;
            written.push(PREDICTION.to_owned());
        }
        Ok(written)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let readable: Readable = files::read_json(&folder.join(READABLE))?;
        let bytes =
            readable.prediction.map(|_| files::read(&folder.join(PREDICTION))).transpose()?;
        let path = folder.join(FILE);
        Ok(Self {
            differences: arrays::read(&path, "differences")?.into_matrix(),
            points: arrays::read(&path, "points")?.into_matrix(),
            prediction: bytes.map(|bytes| Difference::from_bytes(&bytes)).transpose()?,
            region: readable.region,
        })
    }
}

impl NumericalError {
    /// Covariance of the unknown part of the numerical error, for these data ([`emulator_error`]).
    pub fn allowance(
        &self,
        study: &Study,
        section: &NumericalErrorSection,
        fit: Fit<'_>,
    ) -> Result<Allowance, Stop> {
        let (errors, beyond) = self.unknown(section);
        let curves = Curves { points: self.points.clone(), errors, stated: None };
        let factors = emulator_error::factors(study, &curves, fit)?;
        let beyond = over_root(&beyond);
        Ok(Allowance::new(ErrorOrigin::Numerics, factors.map(|own| joined(&own, &beyond))))
    }

    /// Samples of the unknown part, one per column, divided by the square root of their number.
    pub fn error_samples(&self, section: &NumericalErrorSection) -> CommonError {
        let (errors, beyond) = self.unknown(section);
        let factor = joined(&over_root(&errors), &over_root(&beyond));
        CommonError { origin: ErrorOrigin::Numerics, factor: factor.into(), predictive: true }
    }

    /// Curves of the unknown part, one per row; `whole` is the ratio of the whole error to a difference.
    ///
    /// Predicted differences leave `whole` times the errors of the prediction at held-out runs, plus the fraction
    /// `extrapolation` of the extrapolated part beyond the finer runs. Otherwise the curves are `whole` times the
    /// differences, with their mean square about zero, because all of them may have the same sign.
    fn unknown(&self, section: &NumericalErrorSection) -> (Matrix, Matrix) {
        let d = &self.differences;
        let (runs, outputs) = (d.rows(), d.columns());
        let [whole, share] = section.scales();
        let predicted = |j: usize| self.prediction.as_ref().is_some_and(|p| p.corrects(j));
        let known = self.prediction.as_ref().map_or(d, |prediction| &prediction.residuals);
        let errors = Matrix::from_fn(runs, outputs, |i, j| whole * known[(i, j)]);
        let beyond = if (0..outputs).any(predicted) { (whole - 1.0) * share } else { 0.0 };
        let rows = if beyond > 0.0 { runs } else { 0 };
        let extrapolated = |i: usize, j: usize| if predicted(j) { beyond * d[(i, j)] } else { 0.0 };
        (errors, Matrix::from_fn(rows, outputs, extrapolated))
    }

    /// The study's emulator with the predicted numerical error added; `None` if none is predicted.
    pub fn corrected(
        &self,
        study: &Study,
        fitted: &Fitted,
    ) -> Result<Option<Box<dyn Emulator>>, Stop> {
        let (Some(section), Some(prediction)) = (&study.numerical_error, &self.prediction) else {
            return Ok(None);
        };
        if !prediction.is_used() {
            return Ok(None);
        }
        let whole = section.written.whole();
        let (scale, own_offset, emulated) = grouped::of_model(study, prediction);
        let model = study.trained();
        let (mut sources, mut offset) = low_fidelity::sources(model, &fitted.bytes.bytes()?)?;
        for (j, scale) in scale.iter().enumerate() {
            let own = 1.0 + whole * (scale - 1.0);
            for source in &mut sources {
                source.weights[j] *= own;
            }
            offset[j] = own * offset[j] + whole * own_offset[j];
        }
        if let (Some(bytes), Some((plugin, name))) =
            (&prediction.emulator, predictor(study, section))
        {
            let weight = |emulated: &bool| if *emulated { whole } else { 0.0 };
            let weights = emulated.iter().map(weight).collect();
            sources.push(Source { plugin, name, bytes: bytes.clone(), weights });
        }
        // The error estimates of the sum would not be those of the emulator of the ordinary runs; they are never used.
        let sum = Combined::new(&sources, &offset, FitError::default(), Vec::new(), Vec::new())?;
        let sum = Used::of(model)?.widen(Box::new(sum));
        Ok(Some(grouped::each_group(study, sum)))
    }

    /// Facts for the report.
    pub fn facts(&self, unit: &str) -> Vec<Fact> {
        let told = self.prediction.iter().flat_map(|prediction| prediction.facts(unit));
        told.map(|fact| Fact::new(format!("numerical error: {}", fact.name), fact.value)).collect()
    }

    /// Root mean square difference over runs and outputs.
    pub fn rms(&self) -> f64 {
        rms(&self.differences)
    }
}

/// Curves as columns, divided by the square root of their number.
fn over_root(curves: &Matrix) -> Matrix {
    let root = (curves.rows() as f64).sqrt();
    Matrix::from_fn(curves.columns(), curves.rows(), |j, k| curves[(k, j)] / root)
}

/// The columns of two matrices side by side.
fn joined(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), a.columns() + b.columns(), |j, k| {
        if k < a.columns() { a[(j, k)] } else { b[(j, k - a.columns())] }
    })
}

fn rms(matrix: &Matrix) -> f64 {
    let squares: Vec<f64> = matrix.as_slice().iter().map(|d| d * d).collect();
    moments::mean(&squares).sqrt()
}

/// Surrogate that predicts the differences, with its name.
fn predictor<'a>(
    study: &'a Study,
    section: &'a Asked,
) -> Option<(&'a dyn lacuna::plugin::Surrogate, &'a str)> {
    let own = section.surrogate.as_ref().map(|s| &s.built);
    let built = own.or(study.surrogate.as_ref().map(|s| &s.built))?;
    Some((&*built.plugin, built.name))
}

/// Repeats runs with finer numerics, choosing from those inside the prior and the region; `None` if the study does not
/// request it, or if there is no such run and refinement will make some.
pub fn stage(
    study: &Study,
    data: &Kept<Data>,
    region: Option<&[(f64, f64)]>,
    [runs_folder, folder]: &[Folder; 2],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<NumericalError>>, Stop> {
    let Some(section) = &study.numerical_error else { return Ok(None) };
    let simulator = Simulator::with_model(study, &section.model)?;
    let ensemble = data.value.runs()?;
    let chosen = chosen(study, ensemble, region, section.runs);
    if chosen.is_empty() {
        if study.surrogate.as_ref().is_some_and(|s| s.common.refine.is_some()) {
            return Ok(None);
        }
        let stop = Stop::new("no run of the design lies inside the prior, so none can be repeated");
        return Err(stop.help("remove `[numerical_error]`, or narrow the design"));
    }
    let names: Vec<String> = chosen.iter().map(|&i| ensemble.runs[i].clone()).collect();
    let points = ensemble.points.select_rows(&chosen);
    let model = (section.model.built.identity(), &section.model.common);
    observer.begin("finer", "run", names.len() as u64);
    let runs = simulate::kept(
        study,
        &simulator,
        runs_folder,
        simulate::Asked::new(&names, &points),
        &model,
        run,
        observer,
    )?;
    let made = run.stage_folder(runs_folder);
    let reader = study.simulations.as_ref().map(|s| s.built.identity());
    let surrogate = section.surrogate.as_ref().map(|s| s.built.identity());
    let study_surrogate = study.surrogate.as_ref().map(|s| s.built.identity());
    let parameters = designed(study, region);
    let laws: Vec<_> = parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let predictor = section.written.predict.then_some((surrogate, study_surrogate, laws));
    let inputs = json!([runs.hash, data.hash, reader, predictor, study.about.seed]);
    let kept = run.keep(folder, &inputs, observer, |_| {
        let runs = Runs { folder: &made, made: &runs.value };
        let finer = read::ensemble(study, Some(runs))?;
        let region = region.map(<[_]>::to_vec);
        let pairs = Pairs::of(&finer, ensemble)?;
        let differences = pairs.differences();
        let prediction = section.written.predict.then(|| pairs.learn(study, section, &parameters));
        let prediction = prediction.transpose()?;
        Ok(NumericalError { differences, points: pairs.points, prediction, region })
    })?;
    observer.end("finer", &summary(study, &kept.value));
    Ok(Some(kept))
}

fn summary(study: &Study, error: &NumericalError) -> String {
    let unit = study.layouts.unit();
    let text = format!("{} runs, rms difference {:.3e} {unit}", error.points.rows(), error.rms());
    match &error.prediction {
        Some(prediction) if prediction.is_used() => {
            format!("{text}, {:.3e} after prediction", rms(&prediction.residuals))
        }
        Some(_) => format!("{text}, not predictable from the parameters"),
        None => text,
    }
}

/// Parameters with the distributions of the repeated runs.
fn designed(study: &Study, region: Option<&[(f64, f64)]>) -> Vec<Parameter> {
    let narrowed = |(i, parameter): (usize, &Parameter)| Parameter {
        design: region.map_or_else(
            || parameter.design.clone(),
            |region| Distribution::Uniform([region[i].0, region[i].1]),
        ),
        ..parameter.clone()
    };
    study.parameters.iter().enumerate().map(narrowed).collect()
}

/// Finer runs paired with the ordinary ones at the same points.
struct Pairs {
    points: Matrix,
    finer: Matrix,
    ordinary: Matrix,
}

impl Pairs {
    fn of(finer: &Ensemble, ordinary: &Ensemble) -> Result<Self, Stop> {
        let row: HashMap<&String, usize> = ordinary.runs.iter().zip(0..).collect();
        let (rows, others): (Vec<usize>, Vec<usize>) = finer
            .runs
            .iter()
            .enumerate()
            .filter_map(|(i, name)| Some((i, *row.get(name)?)))
            .unzip();
        if rows.is_empty() {
            return Err(Stop::new("none of the repeated runs has a usable response"));
        }
        Ok(Self {
            points: ordinary.points.select_rows(&others),
            finer: finer.responses.select_rows(&rows),
            ordinary: ordinary.responses.select_rows(&others),
        })
    }

    fn differences(&self) -> Matrix {
        let (rows, columns) = (self.finer.rows(), self.finer.columns());
        Matrix::from_fn(rows, columns, |i, j| self.finer[(i, j)] - self.ordinary[(i, j)])
    }

    /// Learns the dependence of the differences on the parameters.
    fn learn(
        &self,
        study: &Study,
        section: &Asked,
        parameters: &[Parameter],
    ) -> Result<Difference, Stop> {
        let used = Used::of(study)?;
        let (plugin, _) =
            predictor(study, section).ok_or_else(|| Stop::new("the study has no surrogate"))?;
        let lesson = Lesson {
            plugin,
            parameters: &used.parameters(parameters),
            layouts: &study.layouts,
            points: &used.points(&self.points),
            fine: &self.finer,
            cheap: &self.ordinary,
            predicted: &self.ordinary,
            rules: &Rule::OF_CORRECTION,
            stream: &stream(study, "numerical-error"),
        };
        lesson.learn(&Progress::new(&lacuna::run::Silent))
    }
}

/// The runs inside the prior and the region that together are closest to all others there.
///
/// They are chosen among the initial runs of the design if these suffice: a design that grows then repeats the same
/// runs.
fn chosen(
    study: &Study,
    ensemble: &Ensemble,
    region: Option<&[(f64, f64)]>,
    count: usize,
) -> Vec<usize> {
    let inside = |&i: &usize| {
        let point = ensemble.points.row(i);
        study.prior().allows(point)
            && region.is_none_or(|r| r.iter().zip(point).all(|(&(a, b), &x)| a <= x && x <= b))
    };
    let first = study.design.as_ref().map_or(usize::MAX, |design| design.common.runs.get());
    let among = |runs: usize| (0..runs).filter(inside).collect::<Vec<usize>>();
    let mut candidates = among(ensemble.runs.len().min(first));
    if region.is_some() || candidates.len() < count {
        candidates = among(ensemble.runs.len());
    }
    let coverage = Coverage::new(&designed(study, region), &ensemble.points);
    cover(&coverage, &candidates, count)
}
