//! From the study's data and a model to the account of a search.

use crate::data::{Measurements, Observations, Parameter};
use crate::gap::account::{Account, HeldOut};
use crate::gap::candidates::{Candidate, proposed};
use crate::gap::common::shared;
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, precision};
use crate::gap::hold_out::{HeldOutData, Kind, Split, split};
use crate::gap::name::{Found, Options, search};
use crate::gap::noise::{Around, Noise};
use crate::gap::prove::prove;
use crate::gap::system::System;
use crate::gap::wide::Wide;
use crate::gap::with_effects::WithEffects;
use crate::linalg::Matrix;
use crate::math::moments::mean;
use crate::math::random::Stream;
use crate::plugin::Forward;
use crate::plugin::discrepancy::{CommonError, StatedNoise};
use crate::plugin::effect::Situation;
use crate::run::{Observer, RunDirectory, Stop};
use crate::stage::calibrate::stated_variance;
use crate::stage::gap_model::{self, Pieces};
use crate::stage::validate::accuracy;
use crate::stage::{Known, best_fit, stream};
use crate::study::Study;

/// The best of the base model's local maxima from which the calibration starts.
const STARTS: usize = 4;

/// The share of the false alarms that is spent on names.
const NAMES: f64 = 0.6;

/// What may be missing inside the model, with the forward map that has it; nothing where the study names nothing.
#[derive(Default)]
pub struct Inside<'a> {
    candidates: Vec<Candidate>,
    wide: Option<Wide<'a>>,
}

impl<'a> Inside<'a> {
    /// The runs and the emulator of these pieces.
    pub fn of(
        pieces: Option<&'a Pieces>,
        study: &'a Study,
        known: &Known<'a>,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Self, Stop> {
        let Some(pieces) = pieces else { return Ok(Self::default()) };
        let (candidates, wide) = gap_model::candidates(pieces, study, known, run, observer)?;
        Ok(Self { candidates, wide: Some(wide) })
    }
}

/// A model with which a search begins: the study's, or another in its place.
#[derive(Clone, Copy)]
pub struct Beginning<'a> {
    /// From parameters to responses.
    pub forward: &'a dyn Forward,
    /// The parameters.
    pub parameters: &'a [Parameter],
    /// Where the forward map holds, where that is narrower than the priors.
    pub region: Option<&'a [(f64, f64)]>,
    /// What may be missing inside it.
    pub inside: &'a Inside<'a>,
    /// The errors that all replicates share of another model than the study's.
    pub other: Option<&'a [CommonError]>,
}

impl<'a> Beginning<'a> {
    /// The study's model.
    pub fn own(study: &'a Study, known: &Known<'a>, inside: &'a Inside<'a>) -> Self {
        let (forward, region) = (known.forward, known.region);
        Self { forward, parameters: &study.parameters, region, inside, other: None }
    }
}

/// All that a search begins with.
pub struct Prepared<'a> {
    base: &'a Base<'a>,
    split: &'a Split,
    starts: Vec<Vec<f64>>,
    /// What is not set aside.
    pub experiment: &'a Experiment<'a>,
    /// What is tried.
    pub candidates: &'a [Candidate],
    /// How the search judges.
    pub options: Options,
    /// The stage's random numbers.
    pub random: Stream,
}

/// Splits the measurements, finds the best fit to what is not set aside, and asks the effects for proposals.
pub fn prepared<T>(
    study: &Study,
    known: &Known<'_>,
    beginning: &Beginning<'_>,
    random: &Stream,
    use_it: impl FnOnce(&Prepared<'_>) -> Result<T, Stop>,
) -> Result<T, Stop> {
    let Some(measured) = &known.data.value.measured else {
        return Err(Stop::new("the study has no `[measurements]` to search for a gap"));
    };
    let split = apart(study, &measured.used);
    let forward = WithEffects::new(beginning.forward, study.placed_effects());
    let parameters = forward.parameters(beginning.parameters);
    let wide = beginning.inside.wide.as_ref().map(|wide| wide.with_effects(study.placed_effects()));
    let wide = wide.as_ref();
    let base = Base { study, known, beginning, wide, forward: &forward, parameters: &parameters };
    let starts = base.starts(&split.training, random)?;
    let experiment = base.experiment(&split.training, &starts[0])?;
    let response = base.response(&starts[0]);
    let noise = Noise::of(&experiment, &base.around(&starts[0]), None).sd(&experiment, &response);
    let situation = Situation { layouts: &study.layouts, response: &response, noise: &noise };
    let mut candidates = candidates(study, &situation)?;
    candidates.extend(beginning.inside.candidates.iter().cloned());
    let made = use_it(&Prepared {
        base: &base,
        split: &split,
        starts,
        experiment: &experiment,
        candidates: &candidates,
        options: options(study),
        random: random.clone(),
    });
    // An effect that could answer no more leaves nothing that could be trusted.
    let faults: Vec<_> = candidates.iter().flat_map(|c| c.effect.faults()).collect();
    match faults.iter().find_map(|fault| fault.said()) {
        Some(said) => Err(Stop::new(said)),
        None => made,
    }
}

impl<'a> Prepared<'a> {
    /// Searches for what is missing.
    pub fn search(&'a self) -> Result<Found<'a>, Stop> {
        let Self { experiment, candidates, options, .. } = *self;
        let found = search(experiment, candidates, &self.starts, options, &self.random);
        if let Some(failure) = self.base.beginning.forward.failure() {
            return Err(Stop::new(failure));
        }
        let stop = || {
            Stop::new("the model gave no answer at the best fit")
                .help("check the priors and the model's own limits")
        };
        found.ok_or_else(stop)
    }

    /// What was found, and how it fares against the response `before` on what was set aside of all measurements.
    pub fn account(
        &'a self,
        found: &Found<'a>,
        before: &[f64],
        all: &Observations,
    ) -> Result<Account, Stop> {
        let mut account = Account::of(found, self.candidates, self.options, &self.random);
        let fitted = Fitted { system: &found.system, fit: &found.last.fit, noise: &found.noise };
        for part in &self.split.held_out {
            account.held_out.extend(self.base.proof(part, all, before, &fitted)?);
        }
        Ok(account)
    }
}

/// The measurements of a study in two parts: what is looked at, and what proves.
pub(super) fn apart(study: &Study, all: &Observations) -> Split {
    let stream = stream(study, "gap").named("hold out");
    split(all, &study.gap.keys.hold_out, &stream)
}

fn options(study: &Study) -> Options {
    let keys = &study.gap.keys;
    let alarm = keys.false_alarm.get();
    Options {
        naming: NAMES * alarm,
        unlisted: (1.0 - NAMES) * alarm,
        simulations: keys.simulations.get(),
        most: keys.effects.get(),
    }
}

/// What the study tries: proposals of the installed effects, and effects of its own.
fn candidates(study: &Study, situation: &Situation<'_>) -> Result<Vec<Candidate>, Stop> {
    let mut all = proposed(study.gap.keys.candidates.as_deref(), situation).map_err(Stop::new)?;
    for section in &study.gap.candidates {
        let kind = section.common.name.as_ref().map_or(section.built.name, AsRef::as_ref);
        all.push(
            Candidate::of(kind, section.built.name, &section.built.options).map_err(Stop::new)?,
        );
    }
    Ok(all)
}

/// A study's model with the study's effects, and all that is known of it.
pub(super) struct Base<'a> {
    pub study: &'a Study,
    pub known: &'a Known<'a>,
    pub beginning: &'a Beginning<'a>,
    pub wide: Option<&'a Wide<'a>>,
    pub forward: &'a WithEffects<'a>,
    pub parameters: &'a [Parameter],
}

impl<'a> Base<'a> {
    fn starts(&self, data: &Observations, random: &Stream) -> Result<Vec<Vec<f64>>, Stop> {
        let stream = random.named("best fit");
        let mut maxima = best_fit::points(self.parameters, data, self.forward, &stream)?;
        maxima.truncate(STARTS);
        Ok(maxima)
    }

    fn response(&self, point: &[f64]) -> Vec<f64> {
        self.forward.mean(&Matrix::from_vec(1, point.len(), point.to_vec())).into_vec()
    }

    /// The response at a point with what the parameters can do to it.
    pub fn around(&self, point: &[f64]) -> Around {
        let (response, jacobian) = self.forward.mean_and_jacobian(point);
        let widths: Vec<f64> =
            self.parameters.iter().map(|p| 1.0 / precision(&p.prior).sqrt()).collect();
        let slopes = Matrix::from_fn(jacobian.columns(), jacobian.rows(), |j, i| {
            widths[j] * jacobian[(i, j)]
        });
        Around { response, slopes }
    }

    /// The noise as the data state it, else as the study's discrepancy does, for all outputs.
    fn stated(&self, data: &Observations, response: &[f64]) -> Result<Option<StatedNoise>, Stop> {
        if data.blocks.iter().any(|block| block.covariance.is_some()) {
            let text =
                "the search for what is missing cannot use a `covariance` of the measurements";
            return Err(Stop::new(text).help(
                "state the noise of single values, in a column `sigma`, or let replicates show it",
            ));
        }
        if data.states_noise() {
            let sd = data.blocks.iter().flat_map(Measurements::stated_sd).collect();
            return Ok(Some(StatedNoise { sd, correlation_time: None }));
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
        Ok(Some(all))
    }

    /// The measurements with the forward map and all errors that replicates share.
    pub fn experiment(&self, data: &Observations, point: &[f64]) -> Result<Experiment<'a>, Stop> {
        let layouts = &self.study.layouts;
        let mut experiment = Experiment::new(layouts, self.parameters, self.forward, data);
        experiment.region = self.beginning.region.map(<[_]>::to_vec);
        experiment.wide = self.wide;
        let around = self.around(point);
        let response = &around.response;
        experiment.stated = self.stated(data, response)?;
        let noise = Noise::of(&experiment, &around, None);
        let all = shared(&experiment, &noise, response, &self.samples(data)?);
        (experiment.common, experiment.remainder) = (all.common, all.remainder);
        Ok(experiment)
    }

    /// Samples of the errors that replicates share.
    fn samples(&self, data: &Observations) -> Result<Vec<CommonError>, Stop> {
        let Self { study, known, wide, beginning, .. } = self;
        let mut all = Vec::new();
        if let Some(errors) = beginning.other {
            all.extend(errors.iter().cloned());
        } else if let Some(fitted) = known.fitted {
            let stated = stated_variance(study, data, known.forward)?;
            all.push(fitted.value.error_samples(study, stated.as_deref()));
        }
        if let (Some(kept), Some(section)) = (known.numerics, &study.numerical_error) {
            all.push(kept.value.error_samples(&section.written));
        }
        all.extend(wide.iter().flat_map(|wide| wide.common.iter().cloned()));
        Ok(all)
    }

    /// How a response and the fit of a system fare on what was set aside.
    pub fn proof(
        &self,
        part: &HeldOutData,
        all: &Observations,
        before: &[f64],
        fitted: &Fitted<'_>,
    ) -> Result<Option<HeldOut>, Stop> {
        let Fitted { system, fit, noise } = fitted;
        let point = &fit.at.point[..self.parameters.len()];
        let held_out = self.experiment(&part.data, point)?;
        let after = &fit.at.response;
        let noise = if part.kind == Kind::Replicates {
            noise.restricted(system.experiment, &held_out)
        } else {
            // What the training never measured has its noise from the replicates that were set aside.
            let whole = self.experiment(all, point)?;
            let around = Around::fit(system, &fit.at);
            Noise::of(&whole, &around, None).restricted(&whole, &held_out)
        };
        let proof = prove(&held_out, &noise, before, after);
        let [without, with] = [before, after].map(|response| average(&part.data, response));
        let accuracy = without.zip(with).map(|(without, with)| [without, with]);
        let names = part.names.clone();
        Ok(proof.map(|proof| HeldOut { kind: part.kind, names, proof, accuracy }))
    }
}

/// A system at its best fit to what was not set aside, with the noise found there.
pub(super) struct Fitted<'a> {
    pub system: &'a System<'a>,
    pub fit: &'a Fit,
    pub noise: &'a Noise,
}

/// The accuracy on the mean over the groups of sensors.
fn average(data: &Observations, response: &[f64]) -> Option<f64> {
    let shares: Vec<f64> = accuracy(data, response).into_iter().map(|(_, share)| share).collect();
    (!shares.is_empty()).then(|| mean(&shares))
}
