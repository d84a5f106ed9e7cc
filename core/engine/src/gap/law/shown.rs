//! The force as it is shown, with the law along the same run.

use super::finder::Finder;
use super::force::Inferred;
use super::quantity::quantity;
use super::trial::Fitted;
use crate::gap::result::law::{Force, ForceCurve, LawTerm, LawUnknown};

/// The largest number of times at which a force is kept.
const SHOWN: usize = 200;

impl Finder<'_, '_, '_> {
    /// The force as it is shown, with the law along the same run.
    pub(super) fn shown(
        &self,
        site: usize,
        found: &Inferred,
        law: Option<&Fitted>,
        explained: f64,
    ) -> Force {
        let (_, from, to, _) = &self.time;
        let own = &self.sites[site];
        let terms = law.map(|law| &law.terms[..]).unwrap_or_default();
        let of = terms.iter().find(|term| term.state == own.state.name).map(|term| term.of.clone());
        let curves = self.with_force(site, |setting| {
            let curve = |c: usize| {
                let (mean, sd) = setting.at(found, c, (*from, *to));
                let texts: Vec<String> = of
                    .iter()
                    .cloned()
                    .chain(of.iter().map(|_| plain(terms, &own.state.name)))
                    .collect();
                let model = setting.model;
                let along = model.along(c, &found.parameters, &found.weights, &texts);
                let mut along = along.unwrap_or_default().into_iter();
                let (of, law) =
                    (along.next().unwrap_or_default(), along.next().unwrap_or_default());
                let scenario = &self.setting.experiment.conditions[c].scenario;
                let at = model.times(c).to_vec();
                thinned(ForceCurve { scenario: scenario.clone(), at, mean, sd, law, of })
            };
            let measured = setting.measured().into_iter();
            measured.map(curve).collect::<Vec<_>>()
        });
        Force {
            state: own.state.name.clone(),
            unit: own.unit.clone(),
            log_evidence: found.log_evidence,
            explained,
            of,
            curves: curves.unwrap_or_default(),
        }
    }
}

/// The terms in the rate of a state with the values of their unknowns, as an expression.
fn plain(terms: &[LawTerm], state: &str) -> String {
    let own = terms.iter().filter(|term| term.state == state);
    let each: Vec<String> = own
        .map(|term| {
            let value = |unknown: &LawUnknown| quantity(unknown.value, &unknown.unit);
            let mut shape = term.shape.clone();
            if let Some(index) = &term.index {
                shape = shape.replace(&index.name, &format!("({})", value(index)));
            }
            format!("({}) * ({shape})", value(&term.coefficient))
        })
        .collect();
    each.join(" + ")
}

/// A curve with at most so many times as are shown.
fn thinned(curve: ForceCurve) -> ForceCurve {
    let step = curve.at.len().div_ceil(SHOWN).max(1);
    let some = |values: Vec<f64>| values.into_iter().step_by(step).collect::<Vec<f64>>();
    ForceCurve {
        scenario: curve.scenario,
        at: some(curve.at),
        mean: some(curve.mean),
        sd: some(curve.sd),
        law: some(curve.law),
        of: some(curve.of),
    }
}
