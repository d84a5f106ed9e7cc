//! The search of a study, from its data and a model to the result.

use lacuna::data::{Measurements, Observations, Parameter};
use lacuna::math::moments::mean;
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::{CommonError, StatedNoise};
use lacuna::plugin::effect::Situation;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::search_model::SearchModel;
use crate::gap::candidates::{Candidate, Proposed, Untried, proposed};
use crate::gap::experiment::Experiment;
use crate::gap::experiment::hold_out::{HeldOutData, HeldOutKind, HoldOutSplit, split};
use crate::gap::experiment::stated::Statement;
use crate::gap::experiment::transient::{Transient, joined, transients, without};
use crate::gap::experiment::wider::ExtendedMap;
use crate::gap::experiment::with_effects::WithEffects;
use crate::gap::inside::advice::what_would_tell;
use crate::gap::next::{Wish, after};
use crate::gap::noise::{Noise, ResponseTangents};
use crate::gap::prove::{freedoms, prove};
use crate::gap::result::{GapResult, HeldOut};
use crate::gap::search::{SearchOptions, SearchResult, VerdictKind, search_observed};
use crate::gap::system::System;
use crate::gap::system::emulator_error::error_covariance;
use crate::gap::system::fit::{Fit, precision};
use crate::stage::calibrate::stated_variance;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::validate::accuracy;
use crate::stage::{best_fit, stream};
use crate::study::Study;

/// The number of local maxima of the base model from which the calibration starts.
const STARTS: usize = 4;

/// The share of `false_alarm` for the scores; the rest is for scan and energy.
const NAMES: f64 = 0.6;

/// The data, candidates and starts of a search.
pub struct PreparedSearch<'a> {
    pub(super) base: &'a BaseModel<'a>,
    pub(super) split: &'a HoldOutSplit,
    pub(super) transients: Vec<Transient>,
    pub(super) starts: Vec<Vec<f64>>,
    /// The data that are not held out.
    pub experiment: &'a Experiment<'a>,
    /// The candidates.
    pub candidates: &'a [Candidate],
    /// The effects that are not tried.
    pub untried: &'a [Untried],
    /// The levels and limits of the search.
    pub options: SearchOptions,
    /// The random stream of the stage.
    pub random: Stream,
}

/// Splits the measurements, finds the best fits to those that are not held out, and collects the candidates; then calls
/// `use_it`.
pub fn prepared<T>(
    study: &Study,
    problem: &InverseProblem<'_>,
    beginning: &SearchModel<'_>,
    random: &Stream,
    use_it: impl FnOnce(&PreparedSearch<'_>) -> Result<T, Stop>,
) -> Result<T, Stop> {
    let Some(measured) = &problem.data.value.measured else {
        return Err(Stop::new("the study has no `[measurements]` to search for a gap"));
    };
    let mut split = apart(study, &measured.used);
    let forward = WithEffects::new(beginning.forward, study.placed_effects());
    let parameters = forward.parameters(beginning.parameters);
    let wide = beginning.inside.wide.as_ref().map(|wide| wide.with_effects(study.placed_effects()));
    let wide = wide.as_ref();
    let base =
        BaseModel { study, problem, beginning, wide, forward: &forward, parameters: &parameters };
    let mut starts = base.starts(&split.training, random)?;
    let mut transients = Vec::new();
    // A fit to values that are off hides those beside them: they are sought again about the fit without them.
    while let Some(further) = base.transients(&split.training, &starts[0], &transients) {
        split.training = without(&split.training, &further);
        transients = joined(transients, further);
        starts = base.starts(&split.training, random)?;
    }
    let experiment = base.experiment(&split.training, &starts[0])?;
    let response = base.response(&starts[0]);
    let noise = Noise::of(&experiment, &base.around(&starts[0]), None).sd(&experiment, &response);
    let situation = Situation { layouts: &study.layouts, response: &response, noise: &noise };
    let Proposed { mut candidates, mut untried } = candidates(study, &situation)?;
    candidates.extend(beginning.inside.candidates.iter().cloned());
    untried.extend(beginning.inside.untried.iter().cloned());
    if let Some(companion) = &beginning.inside.companion {
        let learned = companion.candidates(study, &starts[0], misfit(&experiment, &response))?;
        candidates.extend(learned.candidates);
        untried.extend(learned.untried);
    }
    let is_tried = |kind: &String| beginning.only.is_none_or(|only| only.contains(kind));
    candidates.retain(|candidate| is_tried(&candidate.kind));
    let odds = &study.gap.keys.prior_odds;
    let inside = odds.of_inside(experiment.most_replicates() > 1);
    for candidate in &mut candidates {
        candidate.odds = if candidate.is_inside() { inside } else { odds.response.get() };
    }
    let made = use_it(&PreparedSearch {
        base: &base,
        split: &split,
        transients,
        starts,
        experiment: &experiment,
        candidates: &candidates,
        untried: &untried,
        options: options(study),
        random: random.clone(),
    });
    // A result cannot be trusted after an effect has failed.
    let faults: Vec<_> = candidates.iter().flat_map(|c| c.effect.faults()).collect();
    match faults.iter().find_map(|fault| fault.said()) {
        Some(said) => Err(Stop::new(said)),
        None => made,
    }
}

impl<'a> PreparedSearch<'a> {
    /// Runs the search; `done` is told about what share of it is done.
    pub fn search(&'a self, done: &dyn Fn(f64)) -> Result<SearchResult<'a>, Stop> {
        let Self { experiment, candidates, options, .. } = *self;
        let found =
            search_observed(experiment, candidates, &self.starts, options, &self.random, done);
        if let Some(failure) = self.base.beginning.forward.failure() {
            return Err(Stop::new(failure));
        }
        let stop = || {
            Stop::new("the model gave no answer at the best fit")
                .help("check the priors and the model's own limits")
        };
        found.ok_or_else(stop)
    }

    /// The result of a search, with the proof on the held-out part of all measurements against the response `before`.
    pub fn result(
        &'a self,
        found: &SearchResult<'a>,
        before: &[f64],
        all: &Observations,
    ) -> Result<GapResult, Stop> {
        let mut result = GapResult::of(found, self.candidates, self.options, &self.random);
        let (none, stream) = (result.verdict.none_of_these, self.random.named("next"));
        result.insight.next = after(found, self.candidates, none, self.wish(), &stream);
        result.untried = self.untried.to_vec();
        result.verdict.reasons.extend(self.transients.iter().map(Transient::words));
        if let (Some(companion), Some(own)) =
            (&self.base.study.gap.companion, &self.base.beginning.inside.companion)
        {
            result.verdict.reasons.push(own.identified().words(companion));
            result.companion = Some(own.identified().clone());
        }
        if matches!(result.verdict.word, VerdictKind::Unlisted | VerdictKind::Approximate) {
            result.verdict.reasons.extend(what_would_tell(self.base.study));
        }
        let all = &without(all, &self.transients);
        let fitted =
            FittedSystem { system: &found.system, fit: &found.last.fit, noise: &found.noise };
        for part in &self.split.held_out {
            result.held_out.extend(self.base.proof(part, all, before, &fitted)?);
        }
        Ok(result)
    }
}

impl PreparedSearch<'_> {
    /// The statements of the study about the next data.
    fn wish(&self) -> Wish<'_> {
        let (study, problem) = (self.base.study, self.base.problem);
        let runs = problem.fitted().map_or(0, |fitted| fitted.value.errors.training);
        let keys = &study.gap.keys;
        Wish { options: &keys.next, quantity: keys.quantity.as_ref(), runs }
    }
}

/// The root mean square of the replicates' means less a response, in its unit.
fn misfit(experiment: &Experiment<'_>, response: &[f64]) -> f64 {
    let (counts, means) = experiment.means();
    let measured = counts.iter().zip(&means).zip(response).filter(|((count, _), _)| **count > 0.0);
    let squares: Vec<f64> = measured.map(|((_, mean), y)| (mean - y).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// The measurements of a study in two parts: those of the search, and those that are held out.
pub(super) fn apart(study: &Study, all: &Observations) -> HoldOutSplit {
    let stream = stream(study, "gap").named("hold out");
    split(all, &study.gap.keys.hold_out, &stream)
}

fn options(study: &Study) -> SearchOptions {
    let keys = &study.gap.keys;
    let alarm = keys.false_alarm.get();
    SearchOptions {
        naming: NAMES * alarm,
        unlisted: (1.0 - NAMES) * alarm,
        simulations: keys.simulations.get(),
        most: keys.effects.get(),
    }
}

/// The candidates of the study: those that the installed effects propose, and those that the study lists.
fn candidates(study: &Study, situation: &Situation<'_>) -> Result<Proposed, Stop> {
    let keys = &study.gap.keys;
    let names = keys.candidates.as_deref();
    let mut all = proposed(names, &study.positions, situation).map_err(Stop::new)?;
    for section in &study.gap.candidates {
        let kind = section.common.name.as_ref().map_or(section.built.name, AsRef::as_ref);
        all.untried.retain(|untried| untried.kind != section.built.name);
        all.candidates.push(
            Candidate::of(kind, section.built.name, &section.built.options).map_err(Stop::new)?,
        );
    }
    Ok(all)
}

/// The study's model with the study's effects, its data and its errors.
pub(super) struct BaseModel<'a> {
    pub study: &'a Study,
    pub problem: &'a InverseProblem<'a>,
    pub beginning: &'a SearchModel<'a>,
    pub wide: Option<&'a ExtendedMap<'a>>,
    pub forward: &'a WithEffects<'a>,
    pub parameters: &'a [Parameter],
}

impl<'a> BaseModel<'a> {
    fn starts(&self, data: &Observations, random: &Stream) -> Result<Vec<Vec<f64>>, Stop> {
        let stream = random.named("best fit");
        let mut maxima = best_fit::points(self.parameters.into(), data, self.forward, &stream)?;
        maxima.truncate(STARTS);
        Ok(maxima)
    }

    /// The first values of records that are off about a fit, beside those that are known; `None` if there are none.
    fn transients(
        &self,
        data: &Observations,
        point: &[f64],
        known: &[Transient],
    ) -> Option<Vec<Transient>> {
        let layouts = &self.study.layouts;
        let experiment = Experiment::new(layouts, self.parameters, self.forward, data);
        let found = transients(&experiment, &self.response(point), known);
        (!found.is_empty()).then_some(found)
    }

    fn response(&self, point: &[f64]) -> Vec<f64> {
        self.forward.mean(&Matrix::from_vec(1, point.len(), point.to_vec())).into_vec()
    }

    /// The response at a point with its derivatives by the parameters.
    pub fn around(&self, point: &[f64]) -> ResponseTangents {
        let (response, jacobian) = self.forward.mean_and_jacobian(point);
        let widths: Vec<f64> =
            self.parameters.iter().map(|p| 1.0 / precision(&p.prior).sqrt()).collect();
        let slopes = Matrix::from_fn(jacobian.columns(), jacobian.rows(), |j, i| {
            widths[j] * jacobian[(i, j)]
        });
        ResponseTangents { response, slopes }
    }

    /// The noise as the measurements state it, otherwise as the study's discrepancy does, for all outputs; `None` if
    /// neither does.
    fn stated(&self, data: &Observations, response: &[f64]) -> Result<Option<Statement>, Stop> {
        if data.blocks.iter().any(|block| block.covariance.is_some()) {
            let text =
                "the search for what is missing cannot use a `covariance` of the measurements";
            return Err(Stop::new(text).help(
                "state the noise of single values, in a column `sigma`, or let replicates show it",
            ));
        }
        let instruments = self.study.measurements.as_ref().and_then(|s| s.common.noise.as_ref());
        let mut stated = instruments.map(|noise| {
            let blocks = self.study.layouts.blocks.iter();
            let outputs = blocks.flat_map(|layout| noise.of(layout)).collect();
            Statement { outputs, by: "`noise` in `[measurements]`" }
        });
        if data.states_noise() {
            let sd: Vec<f64> = data.blocks.iter().flat_map(Measurements::stated_sd).collect();
            let Some(stated) = &mut stated else {
                let stated = StatedNoise { sd, correlation_time: None };
                return Ok(Some(Statement::complete(stated, "the column `sigma`")));
            };
            if stated.outputs.iter().any(|own| own.sd.is_some()) {
                let text = "the measurements state the size of their noise twice: in a column `sigma` and in `noise` of \
                            `[measurements]`";
                return Err(Stop::new(text).help(
                    "take `sd` and `resolution` out of `noise`, or the column out with `ignore = [\"sigma\"]`",
                ));
            }
            stated.outputs.iter_mut().zip(sd).for_each(|(own, sd)| own.sd = Some(sd));
        }
        if stated.is_some() {
            return Ok(stated);
        }
        let Some(section) = &self.study.discrepancy else { return Ok(None) };
        let mut all = StatedNoise { sd: Vec::new(), correlation_time: None };
        for (layout, range) in self.study.layouts.parts() {
            let own = section.built.plugin.stated_noise(layout, &response[range]);
            let Some(own) = own else { return Ok(None) };
            all.sd.extend(own.sd);
            if let Some(times) = own.correlation_time {
                all.correlation_time.get_or_insert_default().extend(times);
            }
        }
        Ok(Some(Statement::complete(all, "`discrepancy`")))
    }

    /// The measurements with the forward map and the covariance of its errors.
    pub fn experiment(&self, data: &Observations, point: &[f64]) -> Result<Experiment<'a>, Stop> {
        let layouts = &self.study.layouts;
        let mut experiment = Experiment::new(layouts, self.parameters, self.forward, data);
        experiment.region = self.beginning.region.map(<[_]>::to_vec);
        experiment.wide = self.wide;
        let around = self.around(point);
        let response = &around.response;
        experiment.stated = self.stated(data, response)?;
        let noise = Noise::of(&experiment, &around, None);
        let all = error_covariance(&experiment, &noise, response, &self.samples(data)?);
        (experiment.common, experiment.origins) = (all.common, all.origins);
        experiment.independent = all.independent;
        if let Some(companion) = &self.beginning.inside.companion {
            experiment.forms = companion.forms();
        }
        Ok(experiment)
    }

    /// Samples of the errors of emulator and numerics.
    fn samples(&self, data: &Observations) -> Result<Vec<CommonError>, Stop> {
        let Self { study, problem, wide, beginning, .. } = self;
        let mut all = Vec::new();
        if let Some(errors) = beginning.other {
            all.extend(errors.iter().cloned());
        } else if let Some(fitted) = problem.fitted() {
            let stated = stated_variance(study, data, problem.forward())?;
            all.push(fitted.value.error_samples(study, stated.as_deref()));
        }
        if let (Some(kept), Some(section)) = (problem.numerics(), &study.numerical_error) {
            all.push(kept.value.error_samples(&section.written));
        }
        all.extend(wide.iter().flat_map(|wide| wide.common.iter().cloned()));
        Ok(all)
    }

    /// The proof of a system against the response `before` on one kind of held-out data.
    pub fn proof(
        &self,
        part: &HeldOutData,
        all: &Observations,
        before: &[f64],
        fitted: &FittedSystem<'_>,
    ) -> Result<Option<HeldOut>, Stop> {
        let FittedSystem { system, fit, noise } = fitted;
        let point = &fit.at.point[..self.parameters.len()];
        let held_out = self.experiment(&part.data, point)?;
        let after = &fit.at.response;
        let (noise, freedoms) = if part.kind == HeldOutKind::Replicates {
            (noise.restricted(system.experiment, &held_out), freedoms(system.experiment))
        } else {
            // Outputs without training data have the noise of the held-out replicates.
            let whole = self.experiment(all, point)?;
            let around = system.around(&fit.at);
            (Noise::of(&whole, &around, None).restricted(&whole, &held_out), freedoms(&whole))
        };
        let proof = prove(&held_out, &noise, &freedoms, before, after);
        let [without, with] = [before, after].map(|response| average(&part.data, response));
        let accuracy = without.zip(with).map(|(without, with)| [without, with]);
        let names = part.names.clone();
        Ok(proof.map(|proof| HeldOut { kind: part.kind, names, proof, accuracy }))
    }
}

/// A system at its best fit to the data of the search, with the noise around it.
pub(super) struct FittedSystem<'a> {
    pub system: &'a System<'a>,
    pub fit: &'a Fit,
    pub noise: &'a Noise,
}

/// The accuracy, mean over the groups of sensors.
fn average(data: &Observations, response: &[f64]) -> Option<f64> {
    let shares: Vec<f64> = accuracy(data, response).into_iter().map(|(_, share)| share).collect();
    (!shares.is_empty()).then(|| mean(&shares))
}
