//! Data common to all cases of a coverage study: truths, emulator, noise.

use lacuna::data::{Draws, Ensemble};
use lacuna::diagnose::coverage::{Coordinate, Noise, Source};
use lacuna::plugin::Forward;
use lacuna::run::{Observer, Silent, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::{Value, json};

use super::noise::{fewest, of_replicates};
use super::truths::{self, Truths};
use super::{Asked, ENOUGH, coordinates};
use crate::pipeline::emulate;
use crate::stage::calibrate::{self, Calibrated, Parts};
use crate::stage::emulated::Emulated;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::{Data, Measured};
use crate::stage::surrogate::{self, Fitting, Purpose};
use crate::stage::{best_fit, direct, predict, refine, stream};
use crate::study::Study;

/// Data common to all cases.
pub struct Ground<'a> {
    /// The study.
    pub study: &'a Study,
    /// Forward map, with estimates of its errors.
    pub base: Base<'a>,
    /// Truths with their responses.
    pub truths: Truths,
    /// Source of the responses.
    pub source: Source,
    /// Source of the noise.
    pub noise: Noise,
    /// Unknowns whose truths are known.
    pub coordinates: Vec<Coordinate>,
    /// Points that fit the study's own data, in natural units, each with its response: draws of its posterior, or the
    /// best fit.
    pub fits: Vec<(Vec<f64>, Vec<f64>)>,
    /// True if chains are halved.
    pub quick: bool,
    /// Number of runs that could serve as truths, if truths are held-out runs.
    candidates: Option<usize>,
    hash: String,
}

/// Forward map of the cases.
// Only one value of this type exists, so its size does not matter.
#[allow(clippy::large_enum_variant)]
pub enum Base<'a> {
    /// Emulators; several if truths are held-out runs, one per part of the runs.
    Emulated(Vec<Emulated>),
    /// The model itself.
    Direct(direct::Direct<'a>),
}

impl Base<'_> {
    /// The inverse problem of one part.
    pub fn problem(&self, part: usize) -> InverseProblem<'_> {
        match self {
            Self::Emulated(all) => all[part].problem(),
            Self::Direct(ready) => ready.problem(),
        }
    }
}

/// Number of draws that represent the study's posterior.
const DRAWS: usize = 1000;

impl<'a> Ground<'a> {
    /// Runs the study as far as needed, and draws the truths.
    pub fn of(
        study: &'a Study,
        asked: &Asked,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Self, Stop> {
        let random = stream(study, "coverage").named("truths");
        let is_of_runs = asked.from_runs || study.model.is_none();
        if is_of_runs && study.surrogate.is_none() {
            return Err(Stop::new("the study has no simulation runs that could be held out")
                .help("omit `--from-runs`: the truths are then runs of the model"));
        }
        if study.design.as_ref().is_some_and(|section| section.built.plugin.is_sequential()) {
            return Err(Stop::new(
                "the runs of a sequential design lie near the posterior of the study's own data, not near other truths",
            )
            .help("count the coverage of a copy of the study with a design that does not follow the data"));
        }
        let base = if study.surrogate.is_some() {
            Base::Emulated(vec![emulate(study, run, observer)?])
        } else {
            let direct = direct::Direct::of(study, run, observer)?;
            Base::Direct(direct.fitted(study, run, observer)?)
        };
        let data = base.problem(0).data.clone();
        let measured = data.value.measured.as_ref();
        let measured = measured.ok_or_else(|| Stop::new("the study has no measurements"))?;
        let noise = asked.noise.unwrap_or_else(|| usual(measured));
        if noise == Noise::Replicates {
            // Fails early if the replicates are too few, before the model is run.
            of_replicates(&measured.used, &vec![0.0; study.layouts.len()], &random)?;
        }
        if !study.pools().is_empty() {
            let text = "the truths of unknowns of the discrepancy and of effects are drawn one by one, not from a population";
            return Err(Stop::new(text)
                .help("count the coverage of a copy of the study without `population` there"));
        }
        let parts = Parts::of(study, measured, &base.problem(0))?;
        let own = parts.likelihood().hyperparameters().len();
        let hyper =
            parts.uncompressed_posterior(study, &base.problem(0)).hyperparameters().to_vec();
        drop(parts);
        let coordinates = coordinates(study, &hyper, own, noise);
        let fits = fits(study, noise, &base, measured, run, observer)?;
        let mut hash = json!([data.hash, base.problem(0).origin()]);
        if is_of_runs && study.hierarchy.trained.is_some() {
            let text = "the truths would be runs, in which all groups have the same values";
            return Err(
                Stop::new(text).help("add `[model]`: truths are then drawn from the populations")
            );
        }
        let (base, truths, source, candidates) = if is_of_runs {
            let validation = Fitting::of(study, data.value.runs()?)?.validation;
            let (truths, all, parts) =
                truths::held_back(study, data.value.runs()?, &validation, asked.count, &random)?;
            let base = refitted(study, base, &validation, &parts, run, observer)?;
            (base, truths, Source::HeldBack, Some(all))
        } else {
            let (truths, source) = truths::of_model(study, asked.count, &random, run, observer)?;
            (base, truths, source, None)
        };
        let numerics = base.problem(0).numerics().map(|n| &n.hash);
        hash = json!([hash, numerics, fits.first().map(|fit| &fit.0)]);
        let hash = files::hash(hash.to_string().as_bytes());
        let quick = asked.quick;
        Ok(Self { study, base, truths, source, noise, coordinates, fits, quick, candidates, hash })
    }

    /// Number of truths.
    pub fn count(&self) -> usize {
        self.truths.responses.len()
    }

    /// Measurements whose replicates and missing values the cases have.
    pub fn measured(&self) -> &Measured {
        let problem = self.base.problem(0);
        problem.data.value.measured.as_ref().unwrap_or_else(|| unreachable!("refused before"))
    }

    /// Everything the cases depend on, except for their number.
    pub fn inputs(&self) -> Value {
        let study = self.study;
        let laws: Vec<_> =
            study.parameters.iter().map(|p| (&p.name, &p.prior, &p.design)).collect();
        let laws = study.prior_identity(json!(laws));
        let effects = study.effects_identity();
        json!([
            self.hash,
            study.measurements.as_ref().map(|m| &m.common),
            study.numerical_error.as_ref().map(|n| n.written.scales()),
            laws,
            effects,
            study.model.as_ref().map(|m| (m.built.identity(), &m.common)),
            study.surrogate.as_ref().map(|s| (s.built.identity(), &s.common)),
            study.discrepancy.as_ref().map(|d| (d.built.identity(), &d.common)),
            study.sampler.as_ref().map(|s| (s.built.identity(), &s.common)),
        ])
    }

    /// Notes to the reader on how the coverage was counted.
    pub fn notes(&self, asked: &Asked) -> Vec<String> {
        let mut notes = Vec::new();
        if asked.quick {
            notes.push(
                "quick look: few truths, and chains of half length for samplers whose steps are \
                        draws"
                    .to_owned(),
            );
        }
        if let Some(all) = self.candidates {
            notes.push(format!(
                "the truths are runs held out from the emulator, which was fitted to the others; {all} runs can \
                 serve as draws from the prior"
            ));
            if all < asked.count {
                notes.push(format!("{} truths were requested, {all} are available", asked.count));
            }
        }
        notes
    }
}

/// Default source of the noise: the replicates, if there are enough of them.
fn usual(measured: &Measured) -> Noise {
    let enough = fewest(&measured.used) >= ENOUGH;
    if enough { Noise::Replicates } else { Noise::Posterior }
}

/// A point with its response.
type Fit = (Vec<f64>, Vec<f64>);

/// Points that fit the study's own data, with their responses.
fn fits(
    study: &Study,
    noise: Noise,
    base: &Base<'_>,
    measured: &Measured,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Vec<Fit>, Stop> {
    let points = match noise {
        Noise::Replicates => return Ok(Vec::new()),
        Noise::Prior => {
            let problem = base.problem(0);
            let best = best_fit::point(study, &measured.likelihood, problem.forward())?;
            let absent: Vec<f64> = study
                .placed_effects()
                .iter()
                .flat_map(lacuna::plugin::effect::Placed::absent)
                .collect();
            let point = [best, absent].concat();
            Matrix::from_vec(1, point.len(), point)
        }
        Noise::Posterior => posterior(study, base, run, observer)?,
    };
    let forward = match base {
        Base::Emulated(all) => &*all[0].emulator as &dyn Forward,
        Base::Direct(ready) => ready.problem().forward(),
    };
    let responses = predict::responses(study, forward, &points);
    Ok(points.iter_rows().map(<[f64]>::to_vec).zip(responses).collect())
}

/// Draws of the study's own posterior.
fn posterior(
    study: &Study,
    base: &Base<'_>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Matrix, Stop> {
    let calibrated = match base {
        // Earlier stages are reused from the run directory; the refinement works on its own copy.
        Base::Emulated(_) => refine::stage(study, emulate(study, run, &Silent)?, run, observer)?.1,
        Base::Direct(ready) => {
            calibrate::stage(study, &ready.problem(), &Stage::Calibrate.folder(), run, observer)?
        }
    };
    let calibrated: Kept<Calibrated> =
        calibrated.ok_or_else(|| Stop::new("the study has no posterior"))?;
    let draws: Draws = calibrated.value.draws.from_step(calibrated.value.outcome.burn_in);
    if draws.is_empty() {
        return Err(
            Stop::new("the study's own posterior has no draws").help("`--noise prior` needs none")
        );
    }
    let count = predict::affordable(DRAWS.min(draws.len()), study.layouts.len());
    Ok(draws.points().select_rows(&predict::spaced(count, draws.len())))
}

/// Emulators fitted without some of the runs: one per part of the held-out runs.
fn refitted<'a>(
    study: &'a Study,
    base: Base<'a>,
    validation: &[usize],
    parts: &[Vec<usize>],
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Base<'a>, Stop> {
    let Base::Emulated(mut all) = base else { return Ok(base) };
    let whole = all.remove(0);
    let training = Fitting::of(study, whole.data.value.runs()?)?.training;
    let mut fitted = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let ensemble = whole.data.value.runs()?;
        let kept: Vec<usize> = (0..ensemble.runs.len()).filter(|i| !part.contains(i)).collect();
        let place = |wanted: &[usize]| -> Vec<usize> {
            (0..kept.len()).filter(|&i| wanted.contains(&kept[i])).collect()
        };
        let folder =
            Stage::Surrogate.inside(Stage::Coverage, "coverage").part(&(k + 1).to_string());
        let fitting = Fitting {
            folder,
            parameters: &study.parameters,
            training: place(&training),
            validation: place(validation),
            purpose: Purpose::Study,
        };
        let value = Data {
            ensemble: Some(some(ensemble, &kept)),
            measured: whole.data.value.measured.clone(),
            cheaper: whole
                .data
                .value
                .cheaper
                .as_ref()
                .map(|cheap| elsewhere(cheap, ensemble, part)),
        };
        let hash = files::hash(json!([whole.data.hash, "without", part]).to_string().as_bytes());
        let data = Kept { value, hash, ..whole.data.clone() };
        let own = surrogate::stage(study, &data, &fitting, run, observer)?;
        fitted.push(Emulated::new(study, data, own, whole.numerics.clone(), None)?);
    }
    Ok(Base::Emulated(fitted))
}

/// Cheaper runs that were not made at the points of a part of the fine runs.
fn elsewhere(cheap: &Ensemble, ensemble: &Ensemble, part: &[usize]) -> Ensemble {
    let is_left_out = |point: &[f64]| part.iter().any(|&k| ensemble.points.row(k) == point);
    let rows: Vec<usize> =
        (0..cheap.runs.len()).filter(|&i| !is_left_out(cheap.points.row(i))).collect();
    some(cheap, &rows)
}

/// A selection of runs of an ensemble.
fn some(ensemble: &Ensemble, rows: &[usize]) -> Ensemble {
    Ensemble {
        runs: rows.iter().map(|&i| ensemble.runs[i].clone()).collect(),
        points: ensemble.points.select_rows(rows),
        responses: ensemble.responses.select_rows(rows),
        valid: rows.iter().map(|&i| ensemble.valid[i]).collect(),
        ..ensemble.clone()
    }
}
