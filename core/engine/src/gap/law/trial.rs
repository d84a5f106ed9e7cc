//! The non-linear fit of a law beside the study's parameters.

use lacuna::plugin::effect::On;

use super::term::pieces;
use crate::gap::candidates::Placement;
use crate::gap::experiment::Experiment;
use crate::gap::inside::{Pieces, extended};
use crate::gap::result::law::LawTerm;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit_from};
use crate::gap::system::whitener::Whitener;
use crate::study::Study;

/// The data to which laws are fitted.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a, 'b> {
    pub study: &'a Study,
    pub experiment: &'b Experiment<'a>,
    pub whitener: &'b Whitener,
    pub means: &'b [f64],
}

/// A law at its best fit.
#[derive(Clone)]
pub(super) struct Fitted {
    /// The terms with the values and standard deviations of their unknowns.
    pub terms: Vec<LawTerm>,
    pub fit: Fit,
    /// The log evidence by Laplace's method.
    pub evidence: f64,
}

impl Trial<'_, '_> {
    /// The best fit of the terms from several starts: the study's parameters, then the unknowns of the terms. `None` if there
    /// is none.
    pub fn fitted(&self, terms: &[LawTerm], starts: &[Vec<f64>]) -> Option<Fitted> {
        let fit = self.with(terms, |system| {
            let bounds = system.bounds();
            let clamped = starts.iter().map(|start| -> Vec<f64> {
                start.iter().zip(&bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect()
            });
            fit_from(system, self.whitener, self.means, &clamped.collect::<Vec<_>>())
        })??;
        let evidence = fit.log_evidence();
        let sd = fit.sd();
        let mut own = fit.at.point.iter().zip(sd).skip(self.study.parameters.len());
        let mut terms = terms.to_vec();
        for term in &mut terms {
            for unknown in std::iter::once(&mut term.coefficient).chain(&mut term.index) {
                let (value, sd) = own.next()?;
                (unknown.value, unknown.sd) = (*value, sd);
            }
        }
        evidence.is_finite().then_some(Fitted { terms, fit, evidence })
    }

    /// The result of `use_it` with the system that has these terms; `None` if the model with them cannot be made.
    pub fn with<T>(&self, terms: &[LawTerm], use_it: impl FnOnce(&System<'_>) -> T) -> Option<T> {
        if terms.is_empty() {
            return Some(use_it(&System::new(self.experiment, Vec::new())));
        }
        let pieces = Pieces::alone(self.study, pieces(terms)).ok()??;
        let wide = extended(self.study, &pieces).ok()?;
        let candidates = pieces.candidates();
        let experiment = Experiment { wide: Some(&wide), ..self.experiment.clone() };
        let placed = candidates.iter().enumerate().map(|(candidate, own)| {
            Placement { candidate, on: On::new() }.placed(&experiment, &candidates, &own.kind)
        });
        Some(use_it(&System::new(&experiment, placed.collect())))
    }
}
