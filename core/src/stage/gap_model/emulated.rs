//! What inputs change, learned from runs of their own where a surrogate stands for the model.
//!
//! The surrogate is fitted to the difference of the runs from the study's emulator, and what it says at the absent values is
//! taken off, so that both agree there. Every run has about half of the pieces present, at random: what a piece does alone and
//! what pieces do together are learned from the same runs, also of one that does nothing without another.

use serde_json::json;

use crate::data::{Ensemble, Parameter};
use crate::gap::wide::{Freed, Wide};
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::math::random::uniform;
use crate::plugin::discrepancy::CommonError;
use crate::plugin::surrogate::Training;
use crate::plugin::{Emulator, Forward, Surrogate};
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Observer, Progress, RunDirectory, Stop, files};
use crate::stage::read::{self, Runs};
use crate::stage::simulator::Simulator;
use crate::stage::{Known, design, simulate, stream};
use crate::study::Study;

use super::pieces::Pieces;

/// The wide forward map: the study's emulator and what the inputs add to it.
pub(super) fn wide<'a>(
    pieces: &'a Pieces,
    study: &'a Study,
    known: &Known<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Wide<'a>, Stop> {
    let inputs = pieces.inputs.clone();
    let parameters = parameters(study, &inputs, known.region);
    let simulator = pieces.simulator(study, pieces.whole())?;
    let idle = simulator.idle(parameters.len());
    let used: Vec<usize> = (0..parameters.len()).filter(|i| !idle.contains(i)).collect();
    let lesson = Lesson {
        name: "gap",
        simulator: &simulator,
        points: points(study, pieces, &parameters)?,
        used: used.clone(),
        parameters,
        base: Some((known.forward, known.origin)),
        model: json!(pieces.model()),
    };
    let (difference, common) = lesson.learn(study, run, observer)?;
    let absent = inputs.iter().map(|freed| freed.absent).collect();
    let forward = Added { base: known.forward, difference, absent, used };
    Ok(Wide { forward: Box::new(forward), inputs, common: vec![common] })
}

/// Runs from which the study's surrogate learns.
pub(super) struct Lesson<'a> {
    /// The name of the stages in the run directory: `7-NAME-simulate`, `7-NAME-surrogate`.
    pub name: &'a str,
    /// What is run.
    pub simulator: &'a Simulator<'a>,
    /// Where.
    pub points: Matrix,
    /// The parameters of the runs.
    pub parameters: Vec<Parameter>,
    /// Those of them that the surrogate is trained on.
    pub used: Vec<usize>,
    /// The forward map of the study's parameters from which the differences are learned, with its hash.
    pub base: Option<(&'a dyn Forward, &'a str)>,
    /// What the model is, for the hash of the runs.
    pub model: serde_json::Value,
}

impl Lesson<'_> {
    /// The emulator with its error.
    pub fn learn(
        &self,
        study: &Study,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<(Box<dyn Emulator>, CommonError), Stop> {
        let [simulate, learn] =
            ["simulate", "surrogate"].map(|what| format!("7-{}-{what}", self.name));
        let points = &self.points;
        let names: Vec<String> = simulate::names(points.rows())
            .into_iter()
            .map(|name| format!("{}-{name}", self.name))
            .collect();
        let count = names.len() * self.simulator.settings.len();
        observer.begin("gap-simulate", "run", count as u64);
        let (simulator, model) = (self.simulator, &self.model);
        let made = simulate::kept(
            study,
            simulator,
            &simulate,
            simulate::Asked::new(&names, points),
            model,
            run,
            observer,
        )?;
        observer.end("gap-simulate", &format!("{count} runs of `{}`", self.name));
        let section =
            study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
        let laws: Vec<_> = self
            .used
            .iter()
            .map(|&i| (&self.parameters[i].name, &self.parameters[i].design))
            .collect();
        let base = self.base.map(|(_, origin)| origin);
        let identity = section.built.identity();
        let inputs = json!([made.hash, base, identity, laws, study.about.seed]);
        observer.begin("gap-surrogate", "output", study.layouts.len() as u64);
        let folder = run.stage_folder(&simulate);
        let kept = run.keep(&learn, &inputs, observer, |_| {
            let runs = Runs { folder: &folder, made: &made.value };
            let ensemble = read::ensemble_of(study, &self.parameters, Some(runs))?;
            self.fit(study, &*section.built.plugin, &ensemble, observer)
        })?;
        let errors = &kept.value.errors;
        let square = errors.as_slice().iter().map(|e| e * e).sum::<f64>();
        let rmse = (square / errors.as_slice().len().max(1) as f64).sqrt();
        observer.end("gap-surrogate", &format!("rmse {rmse:.3e} {}", study.layouts.unit()));
        Ok((section.built.plugin.load(&kept.value.bytes)?, common(errors)))
    }

    fn fit(
        &self,
        study: &Study,
        plugin: &dyn Surrogate,
        ensemble: &Ensemble,
        observer: &dyn Observer,
    ) -> Result<Learned, Stop> {
        let mut responses = ensemble.responses.clone();
        if let Some((base, _)) = self.base {
            let own: Vec<usize> = (0..study.parameters.len()).collect();
            let mean = base.mean(&ensemble.points.select_columns(&own));
            let pairs = responses.as_mut_slice().iter_mut().zip(mean.as_slice());
            pairs.for_each(|(y, base)| *y -= base);
        }
        let parameters: Vec<Parameter> =
            self.used.iter().map(|&i| self.parameters[i].clone()).collect();
        let training = Training {
            parameters: &parameters,
            layouts: &study.layouts,
            points: &ensemble.points.select_columns(&self.used),
            responses: &responses,
        };
        let stream = stream(study, "gap-surrogate").named(self.name);
        let emulator = plugin.fit(&training, &stream, &Progress::new(observer))?;
        Ok(Learned { bytes: emulator.save()?, errors: emulator.fit_error().residuals.clone() })
    }
}

/// What is learned of the inputs.
struct Learned {
    /// The emulator of the difference.
    bytes: Vec<u8>,
    /// Its leave-one-out errors, `runs x outputs`.
    errors: Matrix,
}

impl Artifact for Learned {
    fn save(&self, folder: &std::path::Path) -> Result<Vec<String>, Stop> {
        files::write_atomic(&folder.join("emulator.bin"), &self.bytes)?;
        let errors = Array::matrix("errors", "run", "output", &self.errors);
        arrays::write(&folder.join("errors.nc"), &[], &[errors])?;
        Ok(["emulator.bin", "errors.nc"].map(str::to_owned).to_vec())
    }

    fn load(folder: &std::path::Path) -> Result<Self, Stop> {
        Ok(Self {
            bytes: files::read(&folder.join("emulator.bin"))?,
            errors: arrays::read(&folder.join("errors.nc"), "errors")?.into_matrix(),
        })
    }
}

/// The study's parameters, where its emulator holds, and the inputs.
fn parameters(study: &Study, inputs: &[Freed], region: Option<&[(f64, f64)]>) -> Vec<Parameter> {
    let own = study.parameters.iter().enumerate().map(|(i, own)| {
        let held = region.map(|region| Distribution::Uniform([region[i].0, region[i].1]));
        Parameter { design: held.unwrap_or_else(|| own.design.clone()), ..own.clone() }
    });
    let freed = inputs.iter().map(|freed| Parameter {
        unit: freed.unit.clone(),
        ..Parameter::plain(&freed.name, freed.prior.clone())
    });
    own.chain(freed).collect()
}

/// Points of the study's own design for these parameters.
pub(super) fn designed(study: &Study, parameters: &[Parameter]) -> Result<Matrix, Stop> {
    let section = study.design.as_ref().ok_or_else(|| {
        Stop::new("the study has no design by which further runs could be made").help(
            "add `[design]`, or take `[[gap.switch]]`, `[[gap.term]]` and `[[gap.model]]` out",
        )
    })?;
    let runs = section.common.total();
    let cube = section.built.plugin.place(parameters, runs, &stream(study, "gap-design"))?;
    Ok(design::physical(&cube, parameters))
}

/// The runs for all pieces.
fn points(study: &Study, pieces: &Pieces, parameters: &[Parameter]) -> Result<Matrix, Stop> {
    let mut points = designed(study, parameters)?;
    let (first, count) = (study.parameters.len(), pieces.all.len());
    let stream = stream(study, "gap-design").named("present");
    for run in 0..points.rows() {
        let mut rng = stream.at(run as u64).generator();
        for piece in &pieces.all {
            if count > 1 && uniform(&mut rng) < 0.5 {
                for &j in &piece.places {
                    points[(run, first + j)] = pieces.inputs[j].absent;
                }
            }
        }
    }
    Ok(points)
}

/// The error of the difference, which all replicates share: what runs left out show, one a column over the root of their
/// number.
fn common(errors: &Matrix) -> CommonError {
    let scale = (errors.rows() as f64).sqrt();
    let factor = Matrix::from_fn(errors.columns(), errors.rows(), |i, k| errors[(k, i)] / scale);
    CommonError { origin: "emulator of further inputs".to_owned(), factor, predictive: true }
}

/// An emulator with the difference that further inputs make.
struct Added<'a> {
    base: &'a dyn Forward,
    difference: Box<dyn Emulator>,
    absent: Vec<f64>,
    /// What the difference depends on, of the parameters and the inputs.
    used: Vec<usize>,
}

impl Added<'_> {
    fn split<'p>(&self, point: &'p [f64]) -> (&'p [f64], &'p [f64]) {
        point.split_at(point.len() - self.absent.len())
    }

    /// The points with the inputs at their absent values.
    fn without(&self, point: &[f64]) -> Vec<f64> {
        [self.split(point).0, &self.absent].concat()
    }
}

impl Forward for Added<'_> {
    fn dimension(&self) -> usize {
        self.base.dimension() + self.absent.len()
    }

    fn outputs(&self) -> usize {
        self.base.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        let own = Matrix::from_rows(
            self.base.dimension(),
            points.iter_rows().map(|point| self.split(point).0),
        );
        let absent = Matrix::from_rows(
            points.columns(),
            points.iter_rows().map(|point| self.without(point)),
        );
        let mut mean = self.base.mean(&own);
        let difference = |points: &Matrix| self.difference.mean(&points.select_columns(&self.used));
        let (with, without) = (difference(points), difference(&absent));
        let changes = with.as_slice().iter().zip(without.as_slice());
        mean.as_mut_slice().iter_mut().zip(changes).for_each(|(y, (a, b))| *y += a - b);
        mean
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let mut jacobian = Matrix::zeros(self.outputs(), point.len());
        let base = self.base.jacobian(self.split(point).0);
        let slopes = |point: &[f64]| {
            let used: Vec<f64> = self.used.iter().map(|&i| point[i]).collect();
            self.difference.jacobian(&used)
        };
        let (with, without) = (slopes(point), slopes(&self.without(point)));
        for i in 0..self.outputs() {
            jacobian.row_mut(i)[..base.columns()].copy_from_slice(base.row(i));
            for (k, &j) in self.used.iter().enumerate() {
                let own = if j < base.columns() { without[(i, k)] } else { 0.0 };
                jacobian[(i, j)] += with[(i, k)] - own;
            }
        }
        jacobian
    }

    fn failure(&self) -> Option<String> {
        self.base.failure()
    }
}
