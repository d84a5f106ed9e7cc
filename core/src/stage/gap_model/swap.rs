//! Other models in place of the study's, calibrated and weighed against it.
//!
//! They are not nested in the study's model, so that only the probabilities of the data tell: each with its own
//! calibration under the study's priors, where names agree, and the same noise.

use serde_json::json;

use crate::data::Parameter;
use crate::gap::account::Estimate;
use crate::gap::common::shared;
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, fit_from};
use crate::gap::name::weigh;
use crate::gap::noise::Noise;
use crate::gap::replaced::OtherModel;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::gap::with_effects::WithEffects;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::discrepancy::CommonError;
use crate::plugin::effect::Placed;
use crate::plugin::{Emulator, Forward};
use crate::run::{Observer, RunDirectory, Stop};
use crate::stage::Known;
use crate::stage::direct::Direct;
use crate::stage::simulator::Simulator;
use crate::study::Study;
use crate::study::gap::{Edit, Swap, Swapped};

use super::emulated::{Lesson, designed};

/// Another model as a forward map.
pub struct Rival<'a> {
    /// What the study calls it.
    pub name: String,
    /// The parameters of the study that it uses.
    pub parameters: Vec<Parameter>,
    /// From these to responses.
    pub forward: Box<dyn Forward + 'a>,
    /// Errors of it that all replicates share.
    pub common: Vec<CommonError>,
    /// What the study must say to have it.
    pub edit: Edit,
}

/// The other models that the study names.
pub fn rivals<'a>(
    study: &'a Study,
    known: &Known<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Vec<Rival<'a>>, Stop> {
    let models = study.gap.inside.models.iter();
    models.map(|swap| rival(study, swap, known, run, observer)).collect()
}

fn rival<'a>(
    study: &'a Study,
    swap: &'a Swap,
    known: &Known<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Rival<'a>, Stop> {
    let simulator = Simulator::with_model(study, &swap.section)?;
    let idle = simulator.idle(study.parameters.len());
    let used: Vec<usize> = (0..study.parameters.len()).filter(|i| !idle.contains(i)).collect();
    let parameters: Vec<Parameter> = used.iter().map(|&i| study.parameters[i].clone()).collect();
    let middle: Vec<f64> = study.parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
    let (forward, common): (Box<dyn Forward + 'a>, _) = if known.emulator.is_some() {
        let section = &swap.section;
        let lesson = Lesson {
            name: &format!("gap-{}", swap.keys.name),
            simulator: &simulator,
            points: designed(study, &study.parameters)?,
            parameters: study.parameters.clone(),
            used,
            base: None,
            model: json!([section.built.identity(), &section.common]),
        };
        let (emulator, common) = lesson.learn(study, run, observer)?;
        (Box::new(Emulated(emulator)), vec![common])
    } else {
        let priors = study.parameters.iter().map(|p| p.prior.clone()).collect();
        let whole = Direct::with(simulator, priors, study.layouts.len());
        (Box::new(Partial { whole, used, middle }), Vec::new())
    };
    let name = swap.keys.name.as_str().to_owned();
    Ok(Rival { name, parameters, forward, common, edit: edit(study, swap)? })
}

/// What the study must say to have the other model that it calls `name`; `None` where it names no such model.
pub fn swapped(study: &Study, name: &str) -> Result<Option<Edit>, Stop> {
    let mut models = study.gap.inside.models.iter();
    models.find(|swap| swap.keys.name.as_str() == name).map(|swap| edit(study, swap)).transpose()
}

fn edit(study: &Study, swap: &Swap) -> Result<Edit, Stop> {
    let idle = Simulator::with_model(study, &swap.section)?.idle(study.parameters.len());
    let of = |name: &str| {
        let mut own = study.unknowns.iter().enumerate().filter(|(_, unknown)| unknown.name == name);
        own.all(|(i, _)| idle.contains(&i))
    };
    let mut names: Vec<String> = study.unknowns.iter().map(|u| u.name.clone()).collect();
    names.dedup();
    names.retain(|name| of(name));
    let (name, model) = (swap.keys.name.as_str().to_owned(), table(study, swap)?);
    let swapped = Some(Swapped { name, model, idle: names });
    Ok(Edit { swapped, ..Edit::default() })
}

/// `[model]` of a study that has the other model.
fn table(study: &Study, swap: &Swap) -> Result<toml::Table, Stop> {
    let mut table = swap.section.built.options.clone();
    table.insert("use".to_owned(), swap.section.built.name.into());
    let mut fixed = swap.keys.fixed.clone();
    let signature = study.signature_of(&*swap.section.built.plugin);
    let has = |name: &String| signature.iter().any(|s| s.inputs.iter().any(|i| &i.name == name));
    for (name, quantity) in study.model.iter().flat_map(|model| &model.common.fixed) {
        if has(name) {
            fixed.entry(name.clone()).or_insert_with(|| quantity.clone());
        }
    }
    let fixed = crate::study::emit::to_table(&fixed);
    let fixed = fixed.map_err(|error| Stop::new(format!("the fixed values {error}")))?;
    if !fixed.is_empty() {
        table.insert("fixed".to_owned(), fixed.into());
    }
    let computed = study.model.iter().flat_map(|model| &model.common.computed);
    let computed: toml::Table = computed
        .filter(|(name, _)| has(name))
        .map(|(name, text)| (name.clone(), text.as_str().into()))
        .collect();
    if !computed.is_empty() {
        table.insert("computed".to_owned(), computed.into());
    }
    Ok(table)
}

impl Rival<'_> {
    /// The model against that of an experiment, whose fit is `base`; both with the effects that the study has already.
    /// `None` where it has no answer.
    pub fn compare(
        &self,
        experiment: &Experiment<'_>,
        effects: Vec<Placed<'_>>,
        base: &Fit,
        noise: &Noise,
        stream: &Stream,
    ) -> Option<OtherModel> {
        let forward = WithEffects::new(&*self.forward, effects);
        let parameters = forward.parameters(&self.parameters);
        let mut other = experiment.clone();
        (other.parameters, other.forward) = (&parameters, &forward);
        (other.wide, other.region) = (None, None);
        let own = System::new(experiment, Vec::new());
        let system = System::new(&other, Vec::new());
        let sides = [
            Side { system: &own, starts: vec![base.at.point.clone()] },
            Side {
                system: &system,
                starts: starts(&parameters, experiment.parameters, &base.at.point),
            },
        ];
        let Odds { log_odds, error, fit } = self.odds(&sides, noise, stream)?;
        let estimates = parameters.iter().zip(&fit.at.point).zip(fit.sd());
        let estimate = |((p, value), sd): ((&Parameter, &f64), f64)| Estimate {
            name: p.name.clone(),
            unit: p.unit.clone(),
            value: *value,
            sd,
        };
        let parameters = estimates.map(estimate).collect();
        Some(OtherModel { name: self.name.clone(), log_odds, error, parameters })
    }

    /// The odds of a system with this model over one with the study's, each after its own calibration. The covariance is the
    /// same for both, with the errors of both models: neither gains by what it says of its own error.
    pub fn odds(
        &self,
        [own, other]: &[Side<'_, '_>; 2],
        noise: &Noise,
        stream: &Stream,
    ) -> Option<Odds> {
        let response = own.system.response(own.starts.first()?);
        let mut both = own.system.experiment.clone();
        let error = shared(&both, noise, &response, &self.common);
        both.common.extend(error.common);
        both.remainder.resize(both.outputs(), 0.0);
        both.remainder.iter_mut().zip(error.remainder).for_each(|(all, rest)| *all += rest);
        let (_, means) = both.means();
        let whitener = Whitener::new(&both, noise, &response);
        let weighed = |side: &Side<'_, '_>, name: &str| {
            let fit = fit_from(side.system, &whitener, &means, &side.starts)?;
            let weighed = weigh(side.system, &whitener, &means, &fit, &stream.named(name));
            Some((fit, weighed))
        };
        let (_, without) = weighed(own, "own")?;
        let (fit, with) = weighed(other, "other")?;
        let log_odds = with.log_evidence - without.log_evidence;
        Some(Odds { log_odds, error: with.error.hypot(without.error), fit })
    }
}

/// One of two systems that are weighed against each other.
pub struct Side<'a, 'b> {
    /// The system.
    pub system: &'b System<'a>,
    /// From where its calibration starts.
    pub starts: Vec<Vec<f64>>,
}

/// The outcome of weighing two systems.
pub struct Odds {
    /// The log of the probability of the data with the second over that with the first.
    pub log_odds: f64,
    /// Its standard error.
    pub error: f64,
    /// The fit of the second.
    pub fit: Fit,
}

/// From where a calibration starts: from another's, and from the middle and the quarters of the priors.
fn starts(parameters: &[Parameter], others: &[Parameter], point: &[f64]) -> Vec<Vec<f64>> {
    let here = |p: &Parameter| {
        let place = others.iter().position(|other| other.name == p.name);
        place.map_or_else(|| p.prior.quantile(0.5), |i| point[i])
    };
    let at = |q: f64| parameters.iter().map(|p| p.prior.quantile(q)).collect();
    vec![parameters.iter().map(here).collect(), at(0.5), at(0.25), at(0.75)]
}

/// An emulator as a forward map.
struct Emulated(Box<dyn Emulator>);

impl Forward for Emulated {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }

    fn outputs(&self) -> usize {
        self.0.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.0.mean(points)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.0.jacobian(point)
    }
}

/// A forward map of some of its parameters, the others where they do not matter.
struct Partial<'a> {
    whole: Direct<'a>,
    used: Vec<usize>,
    middle: Vec<f64>,
}

impl Partial<'_> {
    fn point(&self, own: &[f64]) -> Vec<f64> {
        let mut point = self.middle.clone();
        self.used.iter().zip(own).for_each(|(&i, x)| point[i] = *x);
        point
    }
}

impl Forward for Partial<'_> {
    fn dimension(&self) -> usize {
        self.used.len()
    }

    fn outputs(&self) -> usize {
        self.whole.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        let rows = points.iter_rows().map(|own| self.point(own));
        self.whole.mean(&Matrix::from_rows(self.middle.len(), rows))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.whole.jacobian(&self.point(point)).select_columns(&self.used)
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let (mean, jacobian) = self.whole.mean_and_jacobian(&self.point(point));
        (mean, jacobian.select_columns(&self.used))
    }

    fn failure(&self) -> Option<String> {
        self.whole.failure()
    }
}
