//! Choice of the terms on a part of the runs, for designs of thousands of runs.
//!
//! The time of a sparse solver's path grows with the product of the number of runs and the square of the number of
//! terms; from a few thousand runs on, further runs change its choice little (`tests/many_runs.rs`). Coefficients and
//! errors are those of all runs.

use std::sync::atomic::{AtomicU64, Ordering};

use lacuna::math::random::{Stream, permutation};
use lacuna::run::{Progress, Stop};
use lacuna_linalg::Matrix;

use super::SELECTION_RUNS;
use super::common_terms::{self, CommonFit};
use super::emulator::{Expansion, Part, Summary};
use super::fit::Problem;
use super::fits::Fits;
use super::judge::Criterion;
use super::options::Solver;
use super::output::{Output, moments, outputs};
use super::search::{Best, Search};
use crate::surrogates::principal_components::PrincipalComponents;

impl Problem<'_> {
    /// Returns the runs on which terms are chosen, in increasing order, if these are not all.
    pub fn part(&self, stream: &Stream) -> Option<Vec<usize>> {
        let runs = self.points.rows();
        let most = self.options.selection_runs.unwrap_or(SELECTION_RUNS);
        let whole = [Solver::LeastSquares, Solver::Quadrature].contains(&self.options.solver);
        if runs <= most || whole || self.slopes.is_some() {
            return None;
        }
        let mut part = permutation(&mut stream.named("selection runs").generator(), runs);
        part.truncate(most);
        part.sort_unstable();
        Some(part)
    }

    /// Chooses the terms on a part of the runs and fits them to all.
    pub fn fit_from_part(
        &self,
        part: &[usize],
        responses: &Matrix,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Expansion, Stop> {
        let points = self.points.select_rows(part);
        let criterion = Criterion::new(self.options.selection, part.len(), stream);
        let search = Search { points: &points, criterion: &criterion, ..self.search() };
        let of_part = responses.select_rows(part);
        let (components, mut found) = match self.reduction {
            Some(reduction) => {
                let scores_of = |c: &PrincipalComponents| outputs(&c.scores);
                let chosen = reduction.chosen(&of_part, scores_of, &search, progress)?;
                (Some(chosen.components), chosen.found)
            }
            None => (None, search.choose_all(&outputs(&of_part), progress)?),
        };
        let (means, variances) = moments(responses);
        if let Some(fits) = self.common(&found, responses, (&means, &variances), progress) {
            return Ok(told(fits, part, true).expansion());
        }
        let components = components.map(|c| c.of_all(responses));
        let all = outputs(components.as_ref().map_or(responses, |c| &c.scores));
        self.choose_rest(&all, &mut found)?;
        let fits = told(self.refits(&self.search(), &all, &found)?, part, false);
        Ok(match components {
            Some(components) => fits.multiplied_back(&variances, components),
            None => fits.expansion(),
        })
    }

    /// Fits all outputs with the terms of all of them; `None` if there are too few runs for that.
    fn common(
        &self,
        found: &[Option<Best>],
        responses: &Matrix,
        (means, variances): (&[f64], &[f64]),
        progress: &Progress<'_>,
    ) -> Option<Fits> {
        let union = self.union(found);
        if !common_terms::is_enough(self.points.rows(), union.len()) {
            return None;
        }
        let terms = self.basis(&union);
        // The components, or the outputs, have been counted once.
        let rest = (responses.columns() - found.len()) as u64;
        let (ticks, done) = (common_terms::ticks(self.points.rows()), AtomicU64::new(0));
        let tick = || {
            let before = done.fetch_add(1, Ordering::Relaxed);
            progress.add(rest * (before + 1) / ticks - rest * before / ticks);
        };
        let fit = common_terms::fit(&terms, self.points, responses, (means, variances), &tick)?;
        let CommonFit { coefficients, relative, residuals } = fit;
        let summary = self.summary(found, &relative, variances);
        Some(Fits { terms, coefficients, relative, residuals, summary })
    }

    /// Chooses terms on all runs for outputs that vary, but not over the part.
    fn choose_rest(&self, all: &[Output], found: &mut [Option<Best>]) -> Result<(), Stop> {
        let rest: Vec<usize> =
            (0..all.len()).filter(|&o| all[o].variance > 0.0 && found[o].is_none()).collect();
        let outputs: Vec<Output> = rest.iter().map(|&o| all[o].clone()).collect();
        let silent = Progress::new(&lacuna::run::Silent);
        let chosen = self.search().choose_all(&outputs, &silent)?;
        rest.into_iter().zip(chosen).for_each(|(o, best)| found[o] = best);
        Ok(())
    }
}

/// Returns the fits with the number of runs on which the terms were chosen.
fn told(fits: Fits, part: &[usize], common: bool) -> Fits {
    let part = Some(Part { runs: part.len(), common });
    let summary = Summary { part, ..fits.summary };
    Fits { summary, ..fits }
}
