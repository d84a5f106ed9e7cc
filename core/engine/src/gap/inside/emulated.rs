//! The emulator of further inputs, trained on runs of its own if a surrogate replaces the model.
//!
//! The surrogate is trained on the difference between the runs and the study's emulator, and its value at the absent
//! inputs is subtracted, so that both agree there. About half of the inputs, chosen at random, are present in each run:
//! the runs show main effects and interactions, also of an input that has no effect without another one.

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::uniform;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::plugin::{Emulator, Forward};
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::json;

use super::pieces::Pieces;
use crate::gap::experiment::wider::{ExtendedMap, FreeInput};
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::{Data, Runs};
use crate::stage::simulator::Simulator;
use crate::stage::surrogate::{self, Fitting, Purpose};
use crate::stage::{design, read, simulate, stream};
use crate::study::Study;

/// The extended forward map: the study's emulator plus the emulated change by the inputs.
pub(super) fn wide<'a>(
    pieces: &'a Pieces,
    study: &'a Study,
    problem: &InverseProblem<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<ExtendedMap<'a>, Stop> {
    let inputs = pieces.inputs.clone();
    let parameters = parameters(study, &inputs, problem.region());
    let simulator = pieces.simulator(study, pieces.whole())?;
    let idle = simulator.idle(parameters.len());
    let used: Vec<usize> = (0..parameters.len()).filter(|i| !idle.contains(i)).collect();
    let further = FurtherRuns {
        name: "gap",
        simulator: &simulator,
        points: points(study, pieces, &parameters)?,
        used: used.clone(),
        parameters,
        base: Some((problem.forward(), problem.origin())),
        model: json!(pieces.model()),
    };
    let (difference, common) = further.emulate(study, run, observer)?;
    let absent = inputs.iter().map(|freed| freed.absent).collect();
    let forward = WithDifference { base: problem.forward(), difference, absent, used };
    Ok(ExtendedMap { forward: Box::new(forward), inputs, common: vec![common] })
}

/// Further runs on which the study's surrogate is trained.
pub(super) struct FurtherRuns<'a> {
    /// The name of the stages in the run directory: `7-NAME-simulate`, `7-NAME-surrogate`.
    pub name: &'a str,
    /// The model that is run.
    pub simulator: &'a Simulator<'a>,
    /// The points of the runs, `runs x parameters`, in the parameters' units.
    pub points: Matrix,
    /// The parameters of the runs.
    pub parameters: Vec<Parameter>,
    /// The indices of the parameters on which the surrogate is trained.
    pub used: Vec<usize>,
    /// The forward map of the study's parameters that is subtracted from the responses, with its hash.
    pub base: Option<(&'a dyn Forward, &'a str)>,
    /// The identity of the model, for the hash of the runs.
    pub model: serde_json::Value,
}

impl FurtherRuns<'_> {
    /// The emulator of the used parameters, with the covariance of its error. The runs and the fit go through the same
    /// stages as those of the study.
    pub fn emulate(
        &self,
        study: &Study,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<(Box<dyn Emulator>, CommonError), Stop> {
        let data = self.data(study, run, observer)?;
        let parameters: Vec<Parameter> =
            self.used.iter().map(|&i| self.parameters[i].clone()).collect();
        let fitting = Fitting {
            folder: Stage::Surrogate.inside(Stage::Gap, self.name),
            parameters: &parameters,
            training: (0..data.value.runs()?.runs.len()).collect(),
            validation: Vec::new(),
            purpose: Purpose::Gap(self.name),
        };
        let (_, emulator) = surrogate::stage(study, &data, &fitting, run, observer)?;
        let common = common(&emulator.fit_error().residuals);
        Ok((emulator, common))
    }

    /// The runs with the used parameters only, and with the responses of the base subtracted.
    fn data(
        &self,
        study: &Study,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Kept<Data>, Stop> {
        let stage = Stage::Simulate.inside(Stage::Gap, self.name);
        let names: Vec<String> = simulate::names(self.points.rows())
            .into_iter()
            .map(|name| format!("{}-{name}", self.name))
            .collect();
        let count = names.len() * self.simulator.settings.len();
        observer.begin("gap-simulate", "run", count as u64);
        let asked = simulate::Asked::new(&names, &self.points);
        let made =
            simulate::kept(study, self.simulator, &stage, asked, &self.model, run, observer)?;
        observer.end("gap-simulate", &format!("{count} runs of `{}`", self.name));
        let folder = run.stage_folder(&stage);
        let runs = Runs { folder: &folder, made: &made.value };
        let mut ensemble = read::ensemble_of(study, &self.parameters, Some(runs))?;
        if let Some((base, _)) = self.base {
            let own: Vec<usize> = (0..study.parameters.len()).collect();
            let mean = base.mean(&ensemble.points.select_columns(&own));
            let pairs = ensemble.responses.as_mut_slice().iter_mut().zip(mean.as_slice());
            pairs.for_each(|(y, base)| *y -= base);
        }
        ensemble.points = ensemble.points.select_columns(&self.used);
        ensemble.parameters = self.used.iter().map(|&i| ensemble.parameters[i].clone()).collect();
        ensemble.units = self.used.iter().map(|&i| ensemble.units[i].clone()).collect();
        let base = self.base.map(|(_, origin)| origin);
        let hash = files::hash(json!([made.hash, base]).to_string().as_bytes());
        let value = Data { ensemble: Some(ensemble), measured: None, cheaper: None };
        Ok(Kept { value, hash, seconds: made.seconds, fresh: made.fresh })
    }
}

/// The study's parameters, inside the region in which its emulator is valid, and the inputs.
fn parameters(
    study: &Study,
    inputs: &[FreeInput],
    region: Option<&[(f64, f64)]>,
) -> Vec<Parameter> {
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

/// Points of the study's own design for these parameters, `runs x parameters`, in their units.
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

/// The covariance of the emulator's error from its leave-one-out errors, `runs x outputs`: each error is a column of
/// the factor, divided by the square root of their number.
fn common(errors: &Matrix) -> CommonError {
    let scale = (errors.rows() as f64).sqrt();
    let factor = Matrix::from_fn(errors.columns(), errors.rows(), |i, k| errors[(k, i)] / scale);
    CommonError {
        origin: ErrorOrigin::Other("emulator of further inputs".to_owned()),
        factor: factor.into(),
        predictive: true,
    }
}

/// An emulator plus the change of the response by further inputs.
struct WithDifference<'a> {
    base: &'a dyn Forward,
    difference: Box<dyn Emulator>,
    absent: Vec<f64>,
    /// Indices of the parameters and inputs on which that change depends.
    used: Vec<usize>,
}

impl WithDifference<'_> {
    fn split<'p>(&self, point: &'p [f64]) -> (&'p [f64], &'p [f64]) {
        point.split_at(point.len() - self.absent.len())
    }

    /// The point with all inputs at their absent values.
    fn without(&self, point: &[f64]) -> Vec<f64> {
        [self.split(point).0, &self.absent].concat()
    }
}

impl Forward for WithDifference<'_> {
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
