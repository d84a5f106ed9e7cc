//! The growth of a law: terms are added while they are worth their price.

use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::term::Index;
use lacuna_linalg::vector::dot;
use rayon::prelude::*;

use super::along::along;
use super::choose::{Finalist, Screen};
use super::finder::{Finder, Run, WORTH};
use super::force::{Inferred, Misfit};
use super::forms::Entry;
use super::model::Widened;
use super::posterior::Pull;
use super::quantity::rounded;
use super::term::pieces;
use super::trial::{Fitted, Trial};
use crate::gap::inside::{Pieces, free};
use crate::gap::result::law::{LawTerm, LawUnknown};
use crate::gap::system::System;

/// The largest number of terms of a law.
const TERMS: usize = 3;

/// The largest number of rivals of a term.
const RIVALS: usize = 3;

/// The share of the rate that a term contributes at one standard deviation of its coefficient.
const SHARE: f64 = 0.5;

/// A law with a further term.
struct Next {
    best: Fitted,
    /// Other terms in its place whose evidence is hardly less.
    rivals: Vec<LawTerm>,
    /// The number of forms that were compared.
    tried: usize,
}

impl<'a> Finder<'a, '_, '_> {
    /// The law of the force with the number of forms that were tried: terms are added while they are worth their price.
    pub(super) fn law(
        &self,
        site: usize,
        found: &Inferred,
        trial: &Trial<'a, '_>,
        nothing: &Fitted,
    ) -> (Option<(Fitted, Vec<LawTerm>)>, usize) {
        let mut run = Run {
            pieces: vec![self.force_piece(site)],
            parameters: found.parameters.clone(),
            inputs: found.weights.clone(),
        };
        let mut misfit = self.with_force(site, |setting| setting.residual(found)).flatten();
        let (mut best, mut tried, mut rivals) = (nothing.clone(), 0, Vec::new());
        for step in 0..TERMS {
            let Some(known) = misfit.take() else { break };
            let stream = self.setting.stream.named("forms").at(step as u64);
            let Some(next) = self.next(&run, known, trial, &best, &stream) else { break };
            tried = tried.max(next.tried);
            if next.best.evidence - best.evidence < WORTH + (next.tried as f64).ln() {
                break;
            }
            best = next.best;
            // In the place of one of several terms others may stand that the further terms correct.
            rivals = if step == 0 { next.rivals } else { Vec::new() };
            run = self.run_of(&best, run.inputs.len());
            misfit = left(trial, &best);
        }
        ((!best.terms.is_empty()).then_some((best, rivals)), tried)
    }

    /// The run of a law.
    fn run_of(&self, law: &Fitted, conditions: usize) -> Run {
        let own = law.fit.at.point.split_at(self.setting.study.parameters.len());
        Run {
            pieces: pieces(&law.terms),
            parameters: own.0.to_vec(),
            inputs: vec![own.1.to_vec(); conditions],
        }
    }

    /// The law with the best further term.
    fn next(
        &self,
        run: &Run,
        misfit: Misfit,
        trial: &Trial<'a, '_>,
        known: &Fitted,
        stream: &Stream,
    ) -> Option<Next> {
        let study = self.setting.study;
        let alone = Pieces::alone(study, run.pieces.clone()).ok()??;
        let model = Widened::new(study, &alone)?;
        let all = self.dictionary(&model, run)?;
        let white = self.responses(run, &all, trial.whitener);
        let screen = Screen::new(&all, white, misfit, self.values)?;
        let finalists = screen.finalists(&stream.named("noise"));
        let fits = finalists.par_iter().filter_map(|finalist| {
            let fitted = self.refined(&model, run, finalist, trial, known, all.len())?;
            Some((finalist, fitted))
        });
        let mut fits: Vec<(&Finalist, Fitted)> = fits.collect();
        fits.sort_by(|a, b| b.1.evidence.total_cmp(&a.1.evidence));
        let mut fits = fits.into_iter();
        let (finalist, mut best) = fits.next()?;
        let winner = &finalist.starts[0].0;
        let stability = screen.stability(self.setting.experiment, winner, &stream.named("halves"));
        best.terms.last_mut()?.stability = stability;
        let near = fits.filter(|(_, own)| best.evidence - own.evidence < WORTH).take(RIVALS);
        let terms = near.filter_map(|(_, own)| own.terms.last().cloned());
        let rivals = terms.enumerate().map(|(k, term)| {
            let name = free(format!("{}_or_{}", term.name, k + 2), &self.taken);
            term.renamed(&name)
        });
        let rivals = rivals.collect();
        Some(Next { best, rivals, tried: all.len() })
    }

    /// The law with the form of a finalist as a further term, at its best fit.
    fn refined(
        &self,
        model: &Widened<'_>,
        run: &Run,
        finalist: &Finalist,
        trial: &Trial<'a, '_>,
        known: &Fitted,
        tried: usize,
    ) -> Option<Fitted> {
        let (entry, coefficient) = &finalist.starts[0];
        let term = self.term(model, run, entry, *coefficient, (known.terms.len(), tried))?;
        let starts = finalist.starts.iter().map(|(entry, coefficient)| {
            let own = term.index.as_ref().map(|_| entry.value);
            let mut start = known.fit.at.point.clone();
            start[..run.parameters.len()].copy_from_slice(&run.parameters);
            start.push(*coefficient);
            start.extend(own);
            start
        });
        let starts: Vec<Vec<f64>> = starts.collect();
        let mut terms = known.terms.clone();
        terms.push(term);
        trial.fitted(&terms, &starts)
    }

    /// A form as a term of a law.
    fn term(
        &self,
        model: &Widened<'_>,
        run: &Run,
        entry: &Entry,
        coefficient: f64,
        (before, tried): (usize, usize),
    ) -> Option<LawTerm> {
        let state = &self.sites[entry.site].state;
        let name = format!("law_{}", state.name);
        let name = if before == 0 { name } else { format!("{name}_{}", before + 1) };
        let name = free(name, &self.taken);
        let index = entry.index().map(|(suffix, unit, prior)| LawUnknown {
            name: free(format!("{name}_{suffix}"), &self.taken),
            unit,
            value: entry.value,
            sd: 0.0,
            prior,
        });
        let shape = match &index {
            Some(index) => entry.shape_with(&index.name),
            None => entry.shape(),
        };
        let indices: Vec<Index> = index
            .iter()
            .map(|index| Index {
                name: index.name.clone(),
                unit: index.unit.clone(),
                prior: index.prior.clone(),
                starts: vec![index.value],
            })
            .collect();
        let unit = self.unit(entry, &shape, &indices).ok()?;
        let sizes = along(model, run, &[state.rate.clone(), entry.shape()])?;
        let [rate, size] = [0, 1]
            .map(|k: usize| (dot(&sizes[k], &sizes[k]) / sizes[k].len().max(1) as f64).sqrt());
        let sd = rounded((SHARE * rate / size).max(coefficient.abs()));
        let prior = Distribution::Normal([0.0, sd]);
        (sd.is_finite() && sd > 0.0).then(|| LawTerm {
            formula: entry.formula(&name, index.as_ref().map_or("", |index| &index.name)),
            title: entry.title(),
            of: entry.of.clone(),
            state: state.name.clone(),
            coefficient: LawUnknown {
                name: name.clone(),
                unit,
                value: coefficient,
                sd: 0.0,
                prior,
            },
            name,
            shape,
            index,
            tried,
            stability: 0.0,
        })
    }
}

/// The misfit that a law leaves.
fn left(trial: &Trial<'_, '_>, law: &Fitted) -> Option<Misfit> {
    let fit = &law.fit;
    let pull = |system: &System<'_>| Pull::of(system.priors(), &fit.at.point);
    let pull = trial.with(&law.terms, pull)?;
    let residual = pull.centred(&fit.residual, &fit.slopes);
    Some(Misfit { residual, slopes: fit.slopes.clone(), precisions: pull.precisions })
}
