//! What inputs change, learned from runs of their own where a surrogate stands for the model.
//!
//! The surrogate is fitted to the difference of the runs from the study's emulator, and what it says at the absent values is
//! taken off, so that both agree there. Every run has one piece present, or all of them, in turn.

use serde_json::json;

use crate::data::Parameter;
use crate::gap::wide::{Freed, Wide};
use crate::linalg::Matrix;
use crate::plugin::discrepancy::CommonError;
use crate::plugin::surrogate::Training;
use crate::plugin::{Emulator, Forward};
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Observer, Progress, RunDirectory, Stop, files};
use crate::stage::read::{self, Runs};
use crate::stage::{Known, design, simulate, stream};
use crate::study::Study;

use super::pieces::Pieces;

/// The stages in the run directory.
const SIMULATE: &str = "7-gap-simulate";
const SURROGATE: &str = "7-gap-surrogate";

/// The wide forward map: the study's emulator and what the inputs add to it.
pub(super) fn wide<'a>(
    pieces: &'a Pieces,
    study: &'a Study,
    known: &Known<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Wide<'a>, Stop> {
    let inputs = pieces.inputs.clone();
    let points = points(study, pieces)?;
    let names: Vec<String> =
        simulate::names(points.rows()).into_iter().map(|name| format!("gap-{name}")).collect();
    let simulator = pieces.simulator(study)?;
    let count = names.len() * simulator.settings.len();
    observer.begin("gap-simulate", "run", count as u64);
    let made = simulate::kept(
        study,
        &simulator,
        SIMULATE,
        &names,
        &points,
        &pieces.model(),
        run,
        observer,
    )?;
    observer.end("gap-simulate", &format!("{count} runs with pieces that may be missing"));
    let section =
        study.surrogate.as_ref().ok_or_else(|| Stop::new("the study has no surrogate"))?;
    let parameters = parameters(study, &inputs);
    let laws: Vec<_> = parameters.iter().map(|p| (&p.name, &p.design)).collect();
    let hashed = json!([
        made.hash,
        known.origin,
        section.built.name,
        section.built.options,
        laws,
        study.about.seed
    ]);
    observer.begin("gap-surrogate", "output", study.layouts.len() as u64);
    let folder = run.stage_folder(SIMULATE);
    let kept = run.keep(SURROGATE, &hashed, observer, |_| {
        let runs = Runs { folder: &folder, made: &made.value };
        let ensemble = read::ensemble_of(study, &parameters, Some(runs))?;
        let own: Vec<usize> = (0..study.parameters.len()).collect();
        let base = known.forward.mean(&ensemble.points.select_columns(&own));
        let difference = Matrix::from_fn(base.rows(), base.columns(), |i, j| {
            ensemble.responses[(i, j)] - base[(i, j)]
        });
        let training = Training {
            parameters: &parameters,
            layouts: &study.layouts,
            points: &ensemble.points,
            responses: &difference,
        };
        let progress = Progress::new(observer);
        let emulator =
            section.built.plugin.fit(&training, &stream(study, "gap-surrogate"), &progress)?;
        Ok(Learned { bytes: emulator.save()?, errors: emulator.fit_error().residuals.clone() })
    })?;
    let errors = &kept.value.errors;
    let square = errors.as_slice().iter().map(|e| e * e).sum::<f64>();
    let rmse = (square / errors.as_slice().len().max(1) as f64).sqrt();
    observer.end("gap-surrogate", &format!("rmse {rmse:.3e} {}", study.layouts.unit()));
    let emulator = section.built.plugin.load(&kept.value.bytes)?;
    let absent = inputs.iter().map(|freed| freed.absent).collect();
    let forward = Added { base: known.forward, difference: emulator, absent };
    Ok(Wide { forward: Box::new(forward), inputs, common: vec![common(errors)] })
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

/// The study's parameters and the inputs.
fn parameters(study: &Study, inputs: &[Freed]) -> Vec<Parameter> {
    let freed = inputs.iter().map(|freed| Parameter {
        unit: freed.unit.clone(),
        ..Parameter::plain(&freed.name, freed.prior.clone())
    });
    study.parameters.iter().cloned().chain(freed).collect()
}

/// The runs by the study's own design.
fn points(study: &Study, pieces: &Pieces) -> Result<Matrix, Stop> {
    let section = study.design.as_ref().ok_or_else(|| {
        Stop::new("the study has no design by which runs with other inputs could be made")
            .help("add `[design]` and `[model]`, or take `[[gap.switch]]` and `[[gap.term]]` out")
    })?;
    let parameters = parameters(study, &pieces.inputs);
    let runs = section.common.runs.get();
    let cube = section.built.plugin.place(&parameters, runs, &stream(study, "gap-design"))?;
    let mut points = design::physical(&cube, &parameters);
    let (first, count) = (study.parameters.len(), pieces.all.len());
    for run in 0..points.rows() {
        let present = run % (count + 1);
        for (i, piece) in pieces.all.iter().enumerate() {
            if count > 1 && present < count && i != present {
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
        let (with, without) = (self.difference.mean(points), self.difference.mean(&absent));
        let changes = with.as_slice().iter().zip(without.as_slice());
        mean.as_mut_slice().iter_mut().zip(changes).for_each(|(y, (a, b))| *y += a - b);
        mean
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let base = self.base.jacobian(self.split(point).0);
        let with = self.difference.jacobian(point);
        let without = self.difference.jacobian(&self.without(point));
        Matrix::from_fn(base.rows(), point.len(), |i, j| {
            if j < base.columns() {
                base[(i, j)] + with[(i, j)] - without[(i, j)]
            } else {
                with[(i, j)]
            }
        })
    }

    fn failure(&self) -> Option<String> {
        self.base.failure()
    }
}
