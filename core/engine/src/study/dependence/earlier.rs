//! Priors that are the posterior of an earlier run.

use std::path::{Path, PathBuf};

use lacuna::data::Unit;
use lacuna::math::dependence::Mixture;
use lacuna::math::distribution::Distribution;
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use super::prior::Prior;
use super::represent::{Check, Density, Sample};
use super::run::Posterior;
use crate::study::file::ParameterSection;

/// Parameters whose prior is the joint posterior of an earlier run.
#[derive(Debug, Clone, PartialEq)]
pub struct Earlier {
    /// Run directory as the study writes it.
    pub run: PathBuf,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Distribution of each.
    pub marginals: Vec<Distribution>,
    /// Dependence of the normal scores; `None` for one parameter.
    pub mixture: Option<Mixture>,
    /// Number of draws, and of independent draws that they are worth.
    pub draws: (usize, f64),
    /// True if the chains of the run converged.
    pub converged: bool,
    /// Comparison of the density with draws that it was not fitted to.
    pub check: Check,
}

/// Fewest independent draws of a run that make a prior.
const FEWEST: f64 = 200.0;

/// The priors of all parameters that name a run; what is wrong is left out and reported.
pub(super) fn earlier(
    parameters: &[ParameterSection],
    directory: &Path,
    root: &Node,
    problems: &mut Problems,
) -> Vec<Earlier> {
    let mut runs: Vec<(&Path, Vec<&ParameterSection>)> = Vec::new();
    for section in parameters {
        let Some(Prior::Earlier { posterior }) = &section.prior else { continue };
        match runs.iter_mut().find(|(run, _)| run == posterior) {
            Some((_, members)) => members.push(section),
            None => runs.push((posterior, vec![section])),
        }
    }
    let mut complaints = Complaints::new(root, problems);
    let all = runs
        .into_iter()
        .filter_map(|(run, members)| of_run(run, &members, directory, &mut complaints));
    all.collect()
}

fn of_run(
    run: &Path,
    members: &[&ParameterSection],
    directory: &Path,
    complaints: &mut Complaints<'_>,
) -> Option<Earlier> {
    let key = |section: &ParameterSection| format!("parameter.{}.prior", section.name);
    let posterior = match Posterior::read(&directory.join(run)) {
        Ok(posterior) => posterior,
        Err(stop) => {
            complaints
                .at(&key(members[0]))
                .say(format!(
                    "`{}` is no run directory with a posterior: {}",
                    run.display(),
                    stop.message
                ))
                .expected(
                    "the run directory of a finished calibration, relative to the study file",
                );
            return None;
        }
    };
    let found: Vec<Option<(usize, (Unit, Unit))>> = members
        .iter()
        .map(|section| place(section, &posterior, &key(section), complaints))
        .collect();
    let places: Vec<(usize, (Unit, Unit))> = found.into_iter().collect::<Option<_>>()?;
    let converted = |x: f64, units: &(Unit, Unit)| units.0.convert(x, &units.1).unwrap_or(f64::NAN);
    let own = |point: &Vec<f64>| -> Vec<f64> {
        places.iter().map(|(j, units)| converted(point[*j], units)).collect()
    };
    let support = |(j, units): &(usize, (Unit, Unit))| {
        let prior = posterior.coordinates[*j].prior.as_ref();
        let (low, high) = prior.map_or((f64::NEG_INFINITY, f64::INFINITY), Distribution::support);
        let end = |x: f64| if x.is_finite() { converted(x, units) } else { x };
        (end(low), end(high))
    };
    let effective =
        places.iter().map(|(j, _)| posterior.effective[*j]).fold(f64::INFINITY, f64::min);
    let draws = posterior.chains.iter().map(Vec::len).sum();
    let sample = Sample {
        chains: posterior.chains.iter().map(|chain| chain.iter().map(own).collect()).collect(),
        supports: places.iter().map(support).collect(),
        effective: effective.min(draws as f64),
    };
    let density = if effective >= FEWEST { Density::of(&sample) } else { None };
    let Some(density) = density else {
        complaints
            .at(&key(members[0]))
            .say(format!("the draws of `{}` are too few for a prior", run.display()))
            .expected(format!("at least {FEWEST} independent draws of every parameter"))
            .found(format!("{draws} draws, worth {effective:.0} independent ones"))
            .help("run the earlier study with more steps");
        return None;
    };
    Some(Earlier {
        run: run.to_owned(),
        parameters: members.iter().map(|section| section.name.as_str().to_owned()).collect(),
        marginals: density.marginals,
        mixture: density.copula,
        draws: (draws, sample.effective),
        converged: posterior.converged,
        check: density.check,
    })
}

/// Place of a parameter among the coordinates of a run, and the units there and in the study.
fn place(
    section: &ParameterSection,
    posterior: &Posterior,
    key: &str,
    complaints: &mut Complaints<'_>,
) -> Option<(usize, (Unit, Unit))> {
    let name = section.name.as_str();
    if section.scenario.is_some() {
        complaints
            .at(key)
            .say(format!("`{name}` belongs to a scenario and cannot take its prior from a run"))
            .expected("a distribution");
        return None;
    }
    let names = || posterior.coordinates.iter().map(|c| c.name.as_str());
    let Some(place) = posterior.place(name) else {
        let problem = complaints.at(key).say(format!("the run has no parameter `{name}`"));
        problem.expected(one_of(names()));
        if let Some(near) = nearest(name, names()) {
            problem.help(format!("did you mean `{near}`?"));
        }
        return None;
    };
    let unit = &posterior.coordinates[place].unit;
    if unit.convert(1.0, &section.unit).is_none() {
        complaints
            .at(&format!("parameter.{name}.unit"))
            .say(format!("the run has `{name}` in another unit"))
            .expected(format!("a unit that converts to `{unit}`"))
            .found(format!("`{}`", section.unit));
        return None;
    }
    Some((place, (unit.clone(), section.unit.clone())))
}
