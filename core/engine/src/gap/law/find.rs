//! The search for a law: the rate that lacks a force, the forms that explain the data as it does, and what is said of
//! them.

use lacuna::data::Unit;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use super::finder::{Finder, LawSetting};
use super::force::Inferred;
use super::sites;
use super::trial::Trial;
use crate::gap::noise::ResponseTangents;
use crate::gap::result::law::Law;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit_from};
use crate::gap::system::whitener::Whitener;
use crate::stage::simulator::Simulator;
use crate::study::Study;

/// A law that was found, with the responses that it is compared by: without it, with a free force, and with it.
pub struct Described {
    /// The law, not yet accepted.
    pub law: Law,
    /// The response without a law, with the free force, and with the law.
    pub responses: [Vec<f64>; 3],
    /// The study's parameters beside the law.
    pub parameters: Vec<f64>,
    /// The response with the law and the changes that the unknowns can make to it, in units of their priors' widths.
    pub around: ResponseTangents,
}

/// Infers the force that a rate lacks and seeks its law; `None` if the model has no equations or no rate lacks a
/// force.
pub fn find(setting: &LawSetting<'_, '_>) -> Option<Described> {
    let LawSetting { study, experiment, noise, starts, .. } = *setting;
    let amend = study.model.as_ref()?.built.plugin.amend()?;
    let (layout, _) = study.layouts.of_scenario(&study.scenarios.first()?.name)?;
    let context = study.context_of(&layout);
    let sites = sites::all(amend, &context);
    let mut taken: Vec<String> = study.given.iter().map(|given| given.name.clone()).collect();
    taken.extend(amend.states(&context).into_iter().map(|state| state.name));
    let asked = &study.gap.inside.terms;
    taken.extend(asked.iter().map(|term| term.common.name(&term.built).to_owned()));
    let values = experiment.curves.iter().map(|curve| curve.measured.len()).sum();
    let (_, means) = experiment.means();
    let time = span(study)?;
    let finder = Finder { setting, amend, context, sites, means, values, taken, time };
    let whitener = Whitener::new(experiment, noise, &finder.means);
    let base = System::new(experiment, Vec::new());
    let base = fit_from(&base, &whitener, &finder.means, starts)?;
    let (site, found) = finder.force(&base, noise)?;
    Some(finder.described(site, &found, &base))
}

/// The name of the time with its first and last value over all conditions, in the unit of the model.
fn span(study: &Study) -> Option<(String, f64, f64, Unit)> {
    let simulator = Simulator::of(study).ok()??;
    let mut all: Option<(String, f64, f64, Unit)> = None;
    for setting in &simulator.settings {
        let (name, at, unit) = setting.asked.abscissa()?;
        let (first, last) = (*at.first()?, *at.last()?);
        let (from, to) =
            all.as_ref().map_or((first, last), |(_, a, b, _)| (first.min(*a), last.max(*b)));
        all = Some((name.to_owned(), from, to, unit.clone()));
    }
    all.filter(|(_, from, to, _)| to > from)
}

impl Finder<'_, '_, '_> {
    /// The force of a rate with the law that describes it.
    fn described(&self, site: usize, found: &Inferred, base: &Fit) -> Described {
        let LawSetting { study, experiment, .. } = *self.setting;
        let trial = Trial { study, experiment, whitener: &found.whitener, means: &self.means };
        let starts = [base.at.point.clone(), found.parameters.clone()];
        let nothing = trial.fitted(&[], &starts);
        let (law, tried) = match &nothing {
            Some(nothing) => self.law(site, found, &trial, nothing),
            None => (None, 0),
        };
        let (law, rivals) = law.map_or((None, Vec::new()), |(law, rivals)| (Some(law), rivals));
        let before = nothing.as_ref().map_or(base, |nothing| &nothing.fit);
        let energy = |response: &[f64]| {
            let misfit: Vec<f64> = self.means.iter().zip(response).map(|(y, m)| y - m).collect();
            let white = found.whitener.whiten(&misfit);
            dot(&white, &white)
        };
        let [first, with_force] = [&before.at.response, &found.response].map(|r| energy(r));
        let share = |after: f64, whole: f64| ((first - after) / whole.max(1.0)).clamp(0.0, 1.0);
        let after = law.as_ref().map_or(&before.at.response, |law| &law.fit.at.response);
        let explained = share(energy(after), first - with_force);
        let excess = first - (self.values as f64 - study.parameters.len() as f64);
        let force = self.shown(site, found, law.as_ref(), share(with_force, excess));
        let point = law.as_ref().map_or(&before.at.point, |law| &law.fit.at.point);
        let parameters = point[..study.parameters.len()].to_vec();
        let terms = law.as_ref().map(|law| &law.terms[..]).unwrap_or_default();
        let last = law.as_ref().map_or(before, |law| &law.fit);
        let around = trial.with(terms, |system| system.around(&last.at));
        let around = around.unwrap_or_else(|| ResponseTangents {
            response: after.clone(),
            slopes: Matrix::zeros(0, after.len()),
        });
        Described {
            responses: [before.at.response.clone(), found.response.clone(), after.clone()],
            parameters: parameters.clone(),
            around,
            law: Law {
                accepted: false,
                reason: None,
                explained,
                tried,
                force,
                terms: law.map(|law| law.terms).unwrap_or_default(),
                rivals,
                parameters,
                proof: None,
            },
        }
    }
}
