//! Stage 6: prediction of the quantities of interest. What follows is for a study with data; without data the priors take
//! the place of the posterior (`forward`).
//!
//! At each of up to a thousand draws of the posterior the response is computed with the study's effects, and one draw of
//! each error of the prediction is added: of the common errors given the data, of the discrepancy's model form, of the
//! scatter of a new replicate. The errors are curves, correlated as the discrepancy and the common errors say, because maxima, spectra and
//! cycles depend on that. Every quantity is evaluated with the errors that it includes, with none, and without each;
//! all variants use the same draws, so that their differences are not those of random numbers.

mod about;
mod bounds;
mod findings;
mod forward;
mod inputs;
mod kept;

use lacuna::data::Draws;
use lacuna::math::moments::mean;
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::ErrorPath;
use lacuna::run::{Observer, Progress, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};
use rayon::prelude::*;
use serde_json::{Value, json};

pub use self::about::{About, Described, Variant};
use self::about::{PARAMETERS, described, variants};
pub use self::bounds::{Bounds, BoundsFindings, End, Interval, PROBABILITIES, Range};
pub use self::findings::{InputShare, QuantityFindings};
pub use self::forward::{Bands, Propagated, runs};
use super::calibrate::Calibrated;
use super::prediction_errors::Errors;
use super::predictions::Chosen;
use super::{predict, stream};
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;
use crate::study::derived::Derived;
use crate::study::quantity::Asked;

/// Predicted quantities, with all draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantified {
    /// Description of the quantities and the draws.
    pub about: About,
    /// Value of each quantity in each variant, `(variants * quantities) x draws`, variant by variant. NaN where a quantity
    /// is undefined.
    pub draws: Matrix,
    /// Value of each quantity at the MAP, without errors; in a study without data at the medians of the priors.
    pub map: Vec<f64>,
    /// Response under the priors and shares of the parameters, in a study without data.
    pub propagated: Option<Propagated>,
}

/// Predicts the quantities of a study with data from its posterior, and those of one without from its priors; `None` if
/// it asks for none.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Quantified>>, Stop> {
    if let Some(draws) = study.propagated() {
        return of_priors(study, problem, draws, run, observer);
    }
    let (Some(calibrated), Some(measured)) = (calibrated, &problem.data.value.measured) else {
        return Ok(None);
    };
    let inputs = json!([
        problem.data.hash,
        problem.origin(),
        problem.numerics().map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        calibrated.hash,
        asked_for(study),
    ]);
    predicted(study, &inputs, run, observer, |progress| {
        let errors = Errors::of(study, measured, problem, &calibrated.value.outcome.map)?;
        let chosen = Chosen::of(&calibrated.value, measured.likelihood.count());
        let forward = Some(problem.forward());
        let basis = Basis::of(&calibrated.value, &chosen);
        Work::new(study, forward, errors, progress).predict(&basis, chosen)
    })
}

/// Propagates the priors of a study without data.
fn of_priors(
    study: &Study,
    problem: &InverseProblem<'_>,
    draws: usize,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Quantified>>, Stop> {
    let inputs = json!([
        problem.origin(),
        problem.numerics().map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        inputs::priors(study),
        study.effects_identity(),
        draws,
        asked_for(study),
    ]);
    // A study without intervals has none of the search in its identity.
    let search = bounds::identity(study);
    let inputs = if search.is_null() { inputs } else { json!([inputs, search]) };
    predicted(study, &inputs, run, observer, |progress| {
        if let Some(text) = forward::announcement(study, problem) {
            observer.remark(&text);
        }
        forward::propagate(study, problem, draws, progress)
    })
}

/// Predicts the quantities of a study whose log density is given: they are functions of the parameters.
pub fn of_target(
    study: &Study,
    calibrated: &Kept<Calibrated>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<Quantified>>, Stop> {
    let inputs = json!([calibrated.hash, asked_for(study)]);
    predicted(study, &inputs, run, observer, |progress| {
        let chosen = Chosen::of(&calibrated.value, 0);
        let basis = Basis::of(&calibrated.value, &chosen);
        Work::new(study, None, Errors::none(), progress).predict(&basis, chosen)
    })
}

/// Everything of the study that the quantities depend on, besides its posterior.
fn asked_for(study: &Study) -> Value {
    let sections = study.quantities.iter().map(|q| json!((q.built.identity(), &q.common)));
    json!([
        sections.collect::<Vec<_>>(),
        study.derived_sections,
        study.scenarios,
        study.model.as_ref().map(|model| &model.common.fixed),
        study.about.seed,
    ])
}

fn predicted(
    study: &Study,
    inputs: &Value,
    run: &mut RunDirectory,
    observer: &dyn Observer,
    make: impl FnOnce(&Progress<'_>) -> Result<Quantified, Stop>,
) -> Result<Option<Kept<Quantified>>, Stop> {
    if study.quantities.is_empty() && study.propagated().is_none() {
        return Ok(None);
    }
    observer.begin(Stage::Quantities.label(), "draw", 0);
    let kept = run
        .keep(&Stage::Quantities.folder(), inputs, observer, |_| make(&Progress::new(observer)))?;
    let findings = kept.value.findings();
    for found in findings.iter().filter(|found| found.undefined > 0) {
        observer.warn(&format!(
            "the quantity `{}` is undefined at {} of {} draws; its numbers are those of the others",
            found.name, found.undefined, found.draws
        ));
    }
    bounds::warn(&kept.value, observer);
    let count = findings.len();
    let word = if count == 1 { "quantity" } else { "quantities" };
    observer.end(Stage::Quantities.label(), &format!("{count} {word}"));
    Ok(Some(kept))
}

/// Number of draws processed together.
const TOGETHER: usize = 40;

struct Work<'a> {
    study: &'a Study,
    forward: Option<&'a dyn Forward>,
    errors: Errors,
    asked: Vec<Asked>,
    derived: Vec<Derived>,
    random: Stream,
    progress: &'a Progress<'a>,
}

/// Context of the draws of a posterior or a prior.
struct Basis<'a> {
    /// Point that represents all draws: the MAP, or the medians of the priors.
    centre: Vec<f64>,
    /// Ratio of independent to all draws.
    efficiency: f64,
    /// Responses at the draws, if they are known.
    responses: Option<&'a [Vec<f64>]>,
}

impl Basis<'_> {
    fn of(calibrated: &Calibrated, chosen: &Chosen) -> Self {
        let efficiency = efficiency(calibrated, chosen);
        Self { centre: calibrated.outcome.map.clone(), efficiency, responses: None }
    }
}

/// A point of the posterior with its response.
struct Place<'a> {
    point: &'a [f64],
    derived: Vec<f64>,
    response: &'a [f64],
}

impl<'a> Work<'a> {
    fn new(
        study: &'a Study,
        forward: Option<&'a dyn Forward>,
        errors: Errors,
        progress: &'a Progress<'a>,
    ) -> Self {
        let (asked, derived) = (study.asked(), study.derived());
        let random = stream(study, "quantities");
        Self { study, forward, errors, asked, derived, random, progress }
    }

    fn predict(&self, basis: &Basis<'_>, chosen: Chosen) -> Result<Quantified, Stop> {
        let centre = &basis.centre;
        let there = self.responses(&Matrix::from_vec(1, centre.len(), centre.clone()));
        let centre = self.place(centre, &there[0]);
        let origins = self.origins(&centre);
        let variants = variants(&origins);
        let count = chosen.points.rows();
        let mut draws = Matrix::zeros(variants.len() * self.asked.len(), count);
        for first in (0..count).step_by(TOGETHER) {
            let rows: Vec<usize> = (first..count.min(first + TOGETHER)).collect();
            let made;
            let responses = if let Some(known) = basis.responses {
                &known[first..first + rows.len()]
            } else {
                made = self.responses(&chosen.points.select_rows(&rows));
                &made[..]
            };
            let one = |(&i, response): (&usize, &Vec<f64>)| {
                let place = self.place(chosen.points.row(i), response);
                self.values(&variants, &place, &centre, &self.random.at(i as u64))
            };
            let values: Vec<Vec<f64>> = rows.par_iter().zip(responses).map(one).collect();
            for (&i, values) in rows.iter().zip(values) {
                values.into_iter().enumerate().for_each(|(k, value)| draws[(k, i)] = value);
            }
            self.progress.add(rows.len() as u64);
        }
        if let Some(reason) = self.forward.and_then(Forward::failure) {
            return Err(Stop::new(reason));
        }
        let map = self.evaluated(&centre, &[], |_, _| true);
        let about = About {
            quantities: self.asked.iter().map(|asked| described(asked, &origins)).collect(),
            variants,
            efficiency: basis.efficiency,
            chains: chosen.chains,
            steps: chosen.steps,
        };
        Ok(Quantified { about, draws, map, propagated: None })
    }

    fn responses(&self, points: &Matrix) -> Vec<Vec<f64>> {
        match self.forward {
            Some(forward) => predict::responses(self.study, forward, points),
            None => vec![Vec::new(); points.rows()],
        }
    }

    fn place<'p>(&self, point: &'p [f64], response: &'p [f64]) -> Place<'p> {
        let derived = self.derived.iter().map(|quantity| quantity.value(point)).collect();
        Place { point, derived, response }
    }

    /// Origins of the errors of a new replicate, without repetition.
    fn origins(&self, place: &Place<'_>) -> Vec<String> {
        let mut origins: Vec<String> = Vec::new();
        for path in self.errors.draw(place.response, place.point, &self.random.named("origins")) {
            let origin = path.origin.to_string();
            if !origins.contains(&origin) {
                origins.push(origin);
            }
        }
        origins
    }

    /// Values of all quantities in all variants at a draw, variant by variant. Without the uncertainty of the parameters
    /// the response is that of the `centre`; the errors keep the hyperparameters of the draw, and its random numbers.
    fn values(
        &self,
        variants: &[Variant],
        place: &Place<'_>,
        centre: &Place<'_>,
        random: &Stream,
    ) -> Vec<f64> {
        let paths = self.errors.draw(place.response, place.point, random);
        let of = |variant: &Variant| match variant {
            Variant::Total => self.evaluated(place, &paths, Asked::includes),
            Variant::Parameters => self.evaluated(place, &[], Asked::includes),
            Variant::Without(source) if source == PARAMETERS => {
                let paths = self.errors.draw(centre.response, place.point, random);
                self.evaluated(centre, &paths, Asked::includes)
            }
            Variant::Without(source) => self.evaluated(place, &paths, |asked, origin| {
                origin != source && asked.includes(origin)
            }),
        };
        variants.iter().flat_map(of).collect()
    }

    /// Values of all quantities at a place, each with the paths that `included` selects.
    fn evaluated(
        &self,
        place: &Place<'_>,
        paths: &[ErrorPath],
        included: impl Fn(&Asked, &str) -> bool,
    ) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.asked.len());
        for asked in &self.asked {
            let own: Vec<&ErrorPath> =
                paths.iter().filter(|path| included(asked, path.origin.as_str())).collect();
            let response =
                |i: usize| place.response[i] + own.iter().map(|path| path.values[i]).sum::<f64>();
            values.push(asked.value(response, (place.point, &place.derived, &values)));
        }
        values
    }
}

/// Ratio of independent draws to those chosen, at most one.
fn efficiency(calibrated: &Calibrated, chosen: &Chosen) -> f64 {
    let draws: &Draws = &calibrated.draws;
    if draws.chains > 1 {
        return chosen.efficiency.min(1.0);
    }
    let judged = &calibrated.outcome.diagnosis.coordinates;
    let share = mean(&judged.iter().map(|j| j.ess_bulk).collect::<Vec<_>>())
        / chosen.points.rows().max(1) as f64;
    if share > 0.0 { share.min(1.0) } else { 1.0 }
}
