//! `[[dependence]]`: checked, and made into groups of parameters.

use lacuna::data::{Group, Parameter};
use lacuna::math::dependence::{Copula, Correlation, Family};
use lacuna::math::distribution::Distribution;
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use super::Sections;
use super::earlier::Earlier;
use super::keys::{CopulaName, DependenceSection};
use super::matrix::{Correlations, smallest_eigenvalue};

/// The prior that follows for a parameter from a Dirichlet distribution of which it is a share.
pub(super) fn prior_of_share(section: &DependenceSection, name: &str) -> Option<Distribution> {
    let concentrations = concentrations(section)?;
    let place = section.parameters.iter().position(|other| other == name)?;
    let fits = concentrations.len() == section.parameters.len() + 1;
    fits.then(|| Copula::marginals_of_shares(&concentrations).swap_remove(place))
}

fn concentrations(section: &DependenceSection) -> Option<Vec<f64>> {
    Some(section.dirichlet.as_ref()?.iter().map(|a| a.get()).collect())
}

/// The groups of all sections; what is wrong is left out and reported.
pub(super) fn groups(
    sections: &Sections,
    parameters: &[Parameter],
    root: &Node,
    problems: &mut Problems,
) -> Vec<Group> {
    let mut groups: Vec<Group> =
        sections.earlier.iter().filter_map(|run| of_run(run, parameters)).collect();
    let nodes = root.get("dependence").map(Node::elements).unwrap_or_default();
    for (section, node) in sections.dependence.iter().zip(nodes) {
        problems.within("dependence", |problems| {
            let mut complaints = Complaints::new(node, problems);
            let Some(members) = members(section, parameters, &groups, &mut complaints) else {
                return;
            };
            if let Some(copula) = copula(section, &members, parameters, &mut complaints) {
                groups.push(Group { members, copula });
            }
        });
    }
    groups
}

/// The joint prior of parameters of an earlier run.
fn of_run(run: &Earlier, parameters: &[Parameter]) -> Option<Group> {
    let place = |name: &String| parameters.iter().position(|p| p.name == *name);
    let members = run.parameters.iter().map(place).collect::<Option<_>>()?;
    Some(Group { members, copula: Copula::Mixture(run.mixture.clone()?) })
}

/// Places of the parameters of a section.
fn members(
    section: &DependenceSection,
    parameters: &[Parameter],
    groups: &[Group],
    complaints: &mut Complaints<'_>,
) -> Option<Vec<usize>> {
    let mut members = Vec::new();
    for name in &section.parameters {
        let names = || parameters.iter().map(|p| p.name.as_str());
        let Some(place) = names().position(|other| other == name) else {
            let problem =
                complaints.at("parameters").say(format!("there is no parameter `{name}`"));
            problem.expected(one_of(names()));
            if let Some(near) = nearest(name, names()) {
                problem.help(format!("did you mean `{near}`?"));
            }
            continue;
        };
        if members.contains(&place) {
            complaints.at("parameters").say(format!("the parameter `{name}` is named twice"));
        } else if groups.iter().any(|group| group.members.contains(&place)) {
            complaints
                .at("parameters")
                .say(format!("the parameter `{name}` depends on others in two ways"))
                .expected(
                    "each parameter in one `[[dependence]]`, or in the joint posterior of one run",
                )
                .help("write one section with all parameters that depend on each other");
        }
        members.push(place);
    }
    let least = if section.dirichlet.is_some() { 1 } else { 2 };
    if section.parameters.len() < least {
        complaints
            .at("parameters")
            .say("a dependence needs several parameters")
            .expected("at least two names")
            .found(section.parameters.len());
        return None;
    }
    (members.len() == section.parameters.len()).then_some(members)
}

/// The strength of a dependence as a section states it.
enum Strength<'a> {
    Correlation(&'a Correlations),
    Spearman(&'a Correlations),
    Kendall(&'a Correlations),
    Theta(f64),
    Dirichlet(Vec<f64>),
}

fn strength<'a>(
    section: &'a DependenceSection,
    complaints: &mut Complaints<'_>,
) -> Option<Strength<'a>> {
    let mut all = Vec::new();
    all.extend(section.correlation.as_ref().map(|r| ("correlation", Strength::Correlation(r))));
    all.extend(section.spearman.as_ref().map(|r| ("spearman", Strength::Spearman(r))));
    all.extend(section.kendall.as_ref().map(|r| ("kendall", Strength::Kendall(r))));
    all.extend(section.theta.map(|theta| ("theta", Strength::Theta(theta))));
    all.extend(concentrations(section).map(|a| ("dirichlet", Strength::Dirichlet(a))));
    if all.len() != 1 {
        let found: Vec<String> = all.iter().map(|(key, _)| format!("`{key}`")).collect();
        let message = if found.is_empty() {
            "the dependence has no strength".to_owned()
        } else {
            format!("the dependence has several strengths: {}", found.join(", "))
        };
        let expected = "one of `correlation`, `spearman`, `kendall`, `theta`, `dirichlet`";
        complaints.at("").say(message).expected(expected);
        return None;
    }
    all.pop().map(|(_, strength)| strength)
}

fn copula(
    section: &DependenceSection,
    members: &[usize],
    parameters: &[Parameter],
    complaints: &mut Complaints<'_>,
) -> Option<Copula> {
    let strength = strength(section, complaints)?;
    let name = section.copula.unwrap_or(CopulaName::Gaussian);
    let is_student = section.dirichlet.is_none() && name == CopulaName::StudentT;
    if section.degrees_of_freedom.is_some() != is_student {
        let spot = complaints.at("degrees_of_freedom");
        let message = if is_student {
            "the copula `student_t` needs its degrees of freedom"
        } else {
            "only the copula `student_t` has degrees of freedom"
        };
        spot.say(message).expected("`copula = \"student_t\"` with `degrees_of_freedom`");
        return None;
    }
    if let Strength::Dirichlet(concentrations) = strength {
        return shares(section, &concentrations, members, parameters, complaints);
    }
    match name {
        CopulaName::Gaussian | CopulaName::StudentT => {
            let correlation = correlation(&strength, name, members.len(), complaints)?;
            Some(match section.degrees_of_freedom {
                Some(dof) => Copula::StudentT(correlation, dof.get()),
                None => Copula::Gaussian(correlation),
            })
        }
        CopulaName::Clayton => archimedean(Family::Clayton, name, &strength, members, complaints),
        CopulaName::Gumbel => archimedean(Family::Gumbel, name, &strength, members, complaints),
        CopulaName::Frank => archimedean(Family::Frank, name, &strength, members, complaints),
    }
}

/// The correlation of the normal scores, or of Student's t: from rank correlations by Kruskal (JASA 53 (1958) 814).
fn correlation(
    strength: &Strength<'_>,
    name: CopulaName,
    count: usize,
    complaints: &mut Complaints<'_>,
) -> Option<Correlation> {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};
    let (key, rows) = match strength {
        Strength::Correlation(r) => ("correlation", r.rows(count, |r| r)),
        Strength::Spearman(r) if name == CopulaName::Gaussian => {
            ("spearman", r.rows(count, |r| 2.0 * (FRAC_PI_6 * r).sin()))
        }
        Strength::Spearman(_) => {
            complaints
                .at("spearman")
                .say("Spearman's correlation of this copula has no closed form")
                .expected("`kendall` or `correlation`");
            return None;
        }
        Strength::Kendall(r) => ("kendall", r.rows(count, |r| (FRAC_PI_2 * r).sin())),
        Strength::Theta(_) | Strength::Dirichlet(_) => {
            complaints
                .at("theta")
                .say(format!("the copula `{}` has no `theta`", name.written()))
                .expected("`correlation`, `spearman` or `kendall`, or `copula` = \"clayton\", \"gumbel\" or \"frank\"");
            return None;
        }
    };
    let rows = match rows {
        Ok(rows) => rows,
        Err(unfit) => {
            complaints.at(key).say(unfit.message).expected(unfit.expected);
            return None;
        }
    };
    let smallest = smallest_eigenvalue(&rows);
    let correlation = Correlation::new(rows);
    if correlation.is_none() {
        complaints
            .at(key)
            .say("no random numbers have these correlations: the matrix is not positive definite")
            .expected("a matrix whose eigenvalues are all above 1e-12")
            .found(format!("a smallest eigenvalue of {smallest:.4}"));
    }
    correlation
}

fn archimedean(
    family: Family,
    name: CopulaName,
    strength: &Strength<'_>,
    members: &[usize],
    complaints: &mut Complaints<'_>,
) -> Option<Copula> {
    if members.len() != 2 {
        complaints
            .at("parameters")
            .say(format!("the copula `{}` joins two parameters", name.written()))
            .expected("two names")
            .found(members.len());
        return None;
    }
    let (key, theta) = match strength {
        Strength::Theta(theta) => ("theta", Some(*theta)),
        Strength::Kendall(Correlations::One(tau)) => ("kendall", family.theta(*tau)),
        Strength::Kendall(_) => ("kendall", None),
        Strength::Correlation(_) | Strength::Spearman(_) | Strength::Dirichlet(_) => {
            complaints
                .at("copula")
                .say(format!(
                    "the copula `{}` is not described by this correlation",
                    name.written()
                ))
                .expected("`kendall` or `theta`");
            return None;
        }
    };
    let fitting = theta.filter(|theta| family.allows(*theta));
    if fitting.is_none() {
        let expected = match (key, family) {
            ("theta", _) => family.range(),
            (_, Family::Frank) => "a number between -1 and 1, not 0 and not too near -1 or 1",
            _ => "a number between 0 and 0.98",
        };
        complaints
            .at(key)
            .say(format!("no `{}` copula has this strength", name.written()))
            .expected(expected);
    }
    fitting.map(|theta| Copula::Archimedean(family, theta))
}

fn shares(
    section: &DependenceSection,
    concentrations: &[f64],
    members: &[usize],
    parameters: &[Parameter],
    complaints: &mut Complaints<'_>,
) -> Option<Copula> {
    if section.copula.is_some() {
        complaints.at("copula").say("a Dirichlet distribution has no copula of its own to choose");
        return None;
    }
    if concentrations.len() != members.len() + 1 {
        complaints
            .at("dirichlet")
            .say("the concentrations do not fit the parameters")
            .expected(format!(
                "{} numbers: one per parameter, and one of the share that the parameters leave of 1",
                members.len() + 1
            ))
            .found(concentrations.len());
        return None;
    }
    let marginals = Copula::marginals_of_shares(concentrations);
    if let Some(text) = marginals.iter().find_map(|law| law.check().err()) {
        complaints.at("dirichlet").say(format!("the beta distribution of a share: {text}"));
        return None;
    }
    let mut fits = true;
    for (&j, law) in members.iter().zip(&marginals) {
        let parameter = &parameters[j];
        if parameter.prior != *law {
            fits = false;
            complaints
                .at("dirichlet")
                .say(format!(
                    "the prior of the share `{}` is not that of the Dirichlet distribution",
                    parameter.name
                ))
                .expected(format!("no `prior`, or {law}"))
                .found(&parameter.prior);
        }
        if !parameter.unit.is_dimensionless() {
            fits = false;
            complaints.at("parameters").say(format!("the share `{}` has a unit", parameter.name));
        }
    }
    fits.then(|| Copula::Dirichlet(concentrations.to_vec()))
}
