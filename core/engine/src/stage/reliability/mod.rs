//! Stage 6: probabilities of rare events.
//!
//! The limit state is the difference between a limit and a quantity of interest of the response: that of the emulator if the
//! study has one, otherwise that of the model. It contains the uncertainty of the parameters, and the errors of emulator and
//! numerics that the quantity includes, which are functions of further standard normal variables.

mod findings;
mod state;

use lacuna::plugin::reliability::{DesignPoint, Estimate};
use lacuna::run::{Observer, Progress, Stop};
use lacuna_run::{Kept, RunDirectory, Stage};
use serde_json::{Value, json};

pub use self::findings::{FoundPoint, RareEvent, RareEvents};
use self::state::{Evaluation, OfPosterior, OfPrior};
use super::calibrate::{Calibrated, Parts};
use super::prediction_errors::Errors;
use super::stream;
use crate::posterior::Posterior;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;
use crate::study::reliability::{Event, ReliabilitySection, Source};

/// Probabilities of a study with a model; `None` if it asks for none.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    calibrated: Option<&Kept<Calibrated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<RareEvents>>, Stop> {
    let inputs = json!([
        problem.data.hash,
        problem.origin(),
        problem.numerics().map(|n| &n.hash),
        study.numerical_error.as_ref().map(|section| section.written.scales()),
        calibrated.map(|kept| &kept.hash),
        asked_for(study),
    ]);
    estimated(study, &inputs, run, observer, |work| {
        let evaluation = Evaluation::new(study, problem);
        let of_priors = Errors::of_priors(study, problem)?;
        let calibrated = calibrated.map(|kept| &kept.value);
        let Some((measured, calibrated)) = problem.data.value.measured.as_ref().zip(calibrated)
        else {
            return work.all(&evaluation, &of_priors, None);
        };
        let parts = Parts::of(study, measured, problem)?;
        let posterior = &parts.posterior(study, problem);
        let errors = &Errors::of(study, measured, problem, &calibrated.outcome.map)?;
        work.all(&evaluation, &of_priors, Some(Sampled { posterior, calibrated, errors }))
    })
}

/// Probabilities of a study whose log density is given.
pub fn of_target(
    study: &Study,
    posterior: &Posterior<'_>,
    calibrated: &Kept<Calibrated>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Option<Kept<RareEvents>>, Stop> {
    let inputs = json!([calibrated.hash, asked_for(study)]);
    estimated(study, &inputs, run, observer, |work| {
        let (evaluation, errors) = (Evaluation::of_numbers(study), &Errors::none());
        let calibrated = &calibrated.value;
        work.all(&evaluation, errors, Some(Sampled { posterior, calibrated, errors }))
    })
}

/// Everything of the study that the probabilities depend on, besides its posterior.
fn asked_for(study: &Study) -> Value {
    let sections = study.reliability.iter().map(|r| json!((r.built.identity(), &r.common)));
    let quantities = study.quantities.iter().map(|q| json!((q.built.identity(), &q.common)));
    json!([
        sections.collect::<Vec<_>>(),
        quantities.collect::<Vec<_>>(),
        study.parameters,
        study.derived_sections,
        study.scenarios,
        study.model.as_ref().map(|model| &model.common.fixed),
        study.about.seed,
    ])
}

fn estimated(
    study: &Study,
    inputs: &Value,
    run: &mut RunDirectory,
    observer: &dyn Observer,
    make: impl FnOnce(&Work<'_>) -> Result<RareEvents, Stop>,
) -> Result<Option<Kept<RareEvents>>, Stop> {
    if study.reliability.is_empty() {
        return Ok(None);
    }
    observer.begin(Stage::Reliability.label(), "call", 0);
    let kept = run.keep(&Stage::Reliability.folder(), inputs, observer, |_| {
        make(&Work { study, progress: &Progress::new(observer) })
    })?;
    for event in &kept.value.events {
        for warning in &event.warnings {
            observer.warn(&format!("the probability `{}`: {warning}", event.name));
        }
    }
    let count = kept.value.events.len();
    let word = if count == 1 { "probability" } else { "probabilities" };
    observer.end(Stage::Reliability.label(), &format!("{count} {word}"));
    Ok(Some(kept))
}

/// A posterior with its draws, and the errors of a prediction from it.
#[derive(Clone, Copy)]
struct Sampled<'a> {
    posterior: &'a Posterior<'a>,
    calibrated: &'a Calibrated,
    errors: &'a Errors,
}

struct Work<'a> {
    study: &'a Study,
    progress: &'a Progress<'a>,
}

impl Work<'_> {
    fn all(
        &self,
        evaluation: &Evaluation<'_>,
        of_priors: &Errors,
        sampled: Option<Sampled<'_>>,
    ) -> Result<RareEvents, Stop> {
        let sections = self.study.reliability.iter();
        let events = sections.map(|section| self.one(section, evaluation, of_priors, sampled));
        Ok(RareEvents { events: events.collect::<Result<_, _>>()? })
    }

    fn one(
        &self,
        section: &ReliabilitySection,
        evaluation: &Evaluation<'_>,
        of_priors: &Errors,
        sampled: Option<Sampled<'_>>,
    ) -> Result<RareEvent, Stop> {
        let event = Event::of(self.study, section, &evaluation.asked).map_err(|misfits| {
            let first = misfits.into_iter().next().map_or_else(String::new, |m| m.message);
            Stop::new(format!("reliability `{}`: {first}", section.common.name.as_str()))
        })?;
        let random = stream(self.study, "reliability").named(section.common.name.as_str());
        match (event.source, sampled) {
            (Source::Prior, _) => {
                let errors = evaluation.variables(&event, of_priors)?;
                let count = errors.count();
                let parameters = &self.study.parameters;
                let state = OfPrior { evaluation, event, parameters, errors };
                let estimate = section.built.plugin.estimate(&state, &random, self.progress)?;
                let natural = |p: &DesignPoint| state.natural(&p.point);
                Ok(self.found(section, event, (evaluation, count), estimate, natural))
            }
            (Source::Posterior, Some(Sampled { posterior, calibrated, errors })) => {
                let errors = evaluation.variables(&event, errors)?;
                let count = errors.count();
                let with = (errors, &random);
                let state = OfPosterior::new(evaluation, event, posterior, calibrated, with)?;
                let estimate = section.built.plugin.estimate(&state, &random, self.progress)?;
                let natural = |p: &DesignPoint| state.natural(&p.point);
                Ok(self.found(section, event, (evaluation, count), estimate, natural))
            }
            (Source::Posterior, None) => Err(Stop::new("the study has no posterior")
                .help("state `distribution = \"prior\"` in `[[reliability]]`")),
        }
    }

    fn found(
        &self,
        section: &ReliabilitySection,
        event: Event,
        (evaluation, error_variables): (&Evaluation<'_>, usize),
        estimate: Estimate,
        natural: impl Fn(&DesignPoint) -> Vec<f64>,
    ) -> RareEvent {
        let names: Vec<String> = self.study.parameters.iter().map(|p| p.name.clone()).collect();
        let asked = &evaluation.asked[event.value];
        let mut warnings = estimate.warnings;
        let at = estimate.design_points.iter().map(&natural);
        let far = at.filter(|point| evaluation.is_beyond(point)).count();
        warnings.extend(extrapolated(evaluation.taken(), far));
        let points = estimate.design_points.iter().map(|point| {
            let importance = point.importance();
            let of_errors = &importance[importance.len() - error_variables..];
            FoundPoint {
                distance: point.distance,
                values: names.iter().cloned().zip(natural(point)).collect(),
                importance: names.iter().cloned().zip(importance.iter().copied()).collect(),
                error_importance: of_errors.iter().sum(),
            }
        });
        RareEvent {
            name: section.common.name.as_str().to_owned(),
            quantity: asked.name.clone(),
            unit: asked.unit.to_string(),
            limit: event.limit,
            above: event.above,
            method: section.built.name.to_string(),
            distribution: event.source.word().to_owned(),
            design_points: points.collect(),
            probability: estimate.probability,
            variation: estimate.variation,
            interval: estimate.interval,
            calls: estimate.calls,
            undefined: estimate.undefined,
            error_variables,
            failures: estimate.failures,
            converged: estimate.converged,
            warnings,
        }
    }
}

/// Share of the calls at which the event occurs, beyond the runs of the emulator, above which a warning says so.
const EXTRAPOLATED: f64 = 0.05;

/// A warning if the event occurs, or has `points` design points, where the emulator extrapolates.
fn extrapolated([occurred, beyond]: [usize; 2], points: usize) -> Option<String> {
    let many = beyond as f64 > EXTRAPOLATED * occurred as f64;
    (many || points > 0).then(|| {
        let points = if points > 0 { format!(", and {points} design points") } else { String::new() };
        format!(
            "{beyond} of the {occurred} calls at which the event occurs{points} lie beyond the simulation runs, where the \
             emulator extrapolates: the probability may be far off; widen `design`, or leave out `[surrogate]`"
        )
    })
}
