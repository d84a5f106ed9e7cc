//! Other models in place of the study's, calibrated and compared with it by Bayes factors.
//!
//! They are not nested in the study's model, so that score tests do not apply: each model is calibrated by itself, with
//! the study's priors for the parameters that both have, and under the same noise.

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::effect::Placed;
use lacuna::plugin::{Emulator, Forward};
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;
use serde_json::json;

use super::emulated::{FurtherRuns, designed};
use crate::gap::edit::{Edit, Swapped};
use crate::gap::experiment::Experiment;
use crate::gap::experiment::with_effects::WithEffects;
use crate::gap::noise::Noise;
use crate::gap::result::Estimate;
use crate::gap::result::replaced::OtherModel;
use crate::gap::search::log_evidence;
use crate::gap::system::System;
use crate::gap::system::emulator_error::error_covariance;
use crate::gap::system::fit::{Fit, fit_from};
use crate::gap::system::whitener::Whitener;
use crate::stage::direct::ModelMap;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::simulator::Simulator;
use crate::study::Study;
use crate::study::gap::Swap;

/// Another model as a forward map.
pub struct AlternativeModel<'a> {
    /// The name in the study.
    pub name: String,
    /// The parameters of the study that it uses.
    pub parameters: Vec<Parameter>,
    /// The forward map: from these parameters to responses.
    pub forward: Box<dyn Forward + 'a>,
    /// The covariance of its emulator's error.
    pub common: Vec<CommonError>,
    /// The changes of the study that include it.
    pub edit: Edit,
}

/// The other models that the study names.
pub fn alternatives<'a>(
    study: &'a Study,
    problem: &InverseProblem<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Vec<AlternativeModel<'a>>, Stop> {
    let models = study.gap.inside.models.iter();
    models.map(|swap| alternative(study, swap, problem, run, observer)).collect()
}

fn alternative<'a>(
    study: &'a Study,
    swap: &'a Swap,
    problem: &InverseProblem<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<AlternativeModel<'a>, Stop> {
    let simulator = Simulator::with_model(study, &swap.section)?;
    let idle = simulator.idle(study.parameters.len());
    let used: Vec<usize> = (0..study.parameters.len()).filter(|i| !idle.contains(i)).collect();
    let parameters: Vec<Parameter> = used.iter().map(|&i| study.parameters[i].clone()).collect();
    let middle: Vec<f64> = study.parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
    let (forward, common): (Box<dyn Forward + 'a>, _) = if problem.emulator().is_some() {
        let section = &swap.section;
        let further = FurtherRuns {
            name: &format!("gap-{}", swap.keys.name),
            simulator: &simulator,
            points: designed(study, &study.parameters)?,
            parameters: study.parameters.clone(),
            used,
            base: None,
            model: json!([section.built.identity(), &section.common]),
        };
        let (emulator, common) = further.emulate(study, run, observer)?;
        (Box::new(Emulated(emulator)), vec![common])
    } else {
        let priors = study.parameters.iter().map(|p| p.prior.clone()).collect();
        let whole = ModelMap::with(simulator, priors, study.layouts.len());
        (Box::new(Partial { whole, used, middle }), Vec::new())
    };
    let name = swap.keys.name.as_str().to_owned();
    Ok(AlternativeModel { name, parameters, forward, common, edit: edit(study, swap)? })
}

/// The changes of the study that include the other model `name`; `None` if the study names no such model.
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

/// The `[model]` of a study with the other model.
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
    let fixed = lacuna::text::emit::to_table(&fixed);
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

impl AlternativeModel<'_> {
    /// Compares the model with that of an experiment, whose fit is `base`; both have the effects of the study. `None`
    /// if the model has no response.
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
            ModelFits { system: &own, starts: vec![base.at.point.clone()] },
            ModelFits {
                system: &system,
                starts: starts(&parameters, experiment.parameters, &base.at.point),
            },
        ];
        let BayesFactor { log_odds, error, fit } = self.bayes_factor(&sides, noise, stream)?;
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

    /// The Bayes factor of a system with this model against one with the study's, each after its own calibration. Both
    /// have the same covariance, with the errors of both models, so that a model does not gain by stating a larger
    /// error.
    pub fn bayes_factor(
        &self,
        [own, other]: &[ModelFits<'_, '_>; 2],
        noise: &Noise,
        stream: &Stream,
    ) -> Option<BayesFactor> {
        let response = own.system.response(own.starts.first()?);
        let mut both = own.system.experiment.clone();
        let error = error_covariance(&both, noise, &response, &self.common);
        both.common.extend(error.common);
        both.independent.resize(both.outputs(), 0.0);
        both.independent.iter_mut().zip(error.independent).for_each(|(all, rest)| *all += rest);
        let (_, means) = both.means();
        let whitener = Whitener::new(&both, noise, &response);
        let weighed = |side: &ModelFits<'_, '_>, name: &str| {
            let fit = fit_from(side.system, &whitener, &means, &side.starts)?;
            let weighed = log_evidence(side.system, &whitener, &means, &fit, &stream.named(name));
            Some((fit, weighed))
        };
        let (_, without) = weighed(own, "own")?;
        let (fit, with) = weighed(other, "other")?;
        let log_odds = with.value - without.value;
        Some(BayesFactor { log_odds, error: with.error.hypot(without.error), fit })
    }
}

/// One of two systems that are compared.
pub struct ModelFits<'a, 'b> {
    /// The system.
    pub system: &'b System<'a>,
    /// The starts of its calibration, in the units of the unknowns.
    pub starts: Vec<Vec<f64>>,
}

/// The Bayes factor of two systems.
pub struct BayesFactor {
    /// The log Bayes factor of the second system against the first.
    pub log_odds: f64,
    /// The standard error of the log Bayes factor.
    pub error: f64,
    /// The fit of the second system.
    pub fit: Fit,
}

/// The starts of a calibration: the optimum of another model, and the middle and the quartiles of the priors.
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

/// A forward map of some of its parameters; the others, on which it does not depend, are held fixed.
struct Partial<'a> {
    whole: ModelMap<'a>,
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
