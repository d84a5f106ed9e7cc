//! Convergence diagnostics of draws, with advice.
//!
//! For **independent chains** all diagnostics hold: R-hat compares the chains, effective sample sizes and Monte Carlo
//! standard errors follow from their autocorrelation.
//!
//! For **walkers of one ensemble** each walker is a chain with the right stationary law, so that a large R-hat, a
//! stranded walker or few autocorrelation times reveal a failure. But walkers move along lines through each other and
//! are not independent: a small R-hat does not prove convergence, and R-hat is expected to be near
//! `sqrt(1 + 2 tau / steps)` however well the ensemble has converged. Effective sample sizes are summed over walkers as
//! if they were independent, which holds only for many walkers and many autocorrelation times; the error of a mean that
//! needs no independence is that of the series of ensemble means, [`autocorrelation::ensemble_error`].

pub mod autocorrelation;
pub mod chains;
pub mod coverage;
pub mod divergence;
pub mod energy;
pub mod leave_one_out;
pub mod pareto;
pub mod walkers;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::data::Draws;
use walkers::Stranded;

/// Diagnostics of one coordinate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// Name of the coordinate.
    pub name: String,
    /// Rank-normalised split R-hat.
    pub r_hat: f64,
    /// Effective sample size of the bulk.
    pub ess_bulk: f64,
    /// Effective sample size of the tails.
    pub ess_tail: f64,
    /// Integrated autocorrelation time, in steps.
    pub autocorrelation_time: f64,
    /// Monte Carlo standard error of the mean; for an ensemble, the larger of that of independent walkers and that of
    /// the series of ensemble means.
    pub mcse_mean: f64,
    /// Monte Carlo standard error of the standard deviation.
    pub mcse_sd: f64,
}

/// Thresholds that draws must meet to count as converged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Criteria {
    /// Largest R-hat.
    pub r_hat: f64,
    /// Smallest effective sample size of bulk and tails.
    pub ess: f64,
    /// Smallest number of autocorrelation times within the kept steps of a chain.
    pub times: f64,
}

impl Criteria {
    /// Independent chains: R-hat at most 1.01 and 400 effective draws (Vehtari et al. 2021).
    pub const CHAINS: Self = Self { r_hat: 1.01, ess: 400.0, times: 10.0 };

    /// Walkers of an ensemble: 400 effective draws and ten autocorrelation times, at which the R-hat of a converged
    /// ensemble is expected to be 1.095.
    pub const ENSEMBLE: Self = Self { r_hat: 1.1, ess: 400.0, times: 10.0 };
}

/// Diagnosis of the draws of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Diagnostics of each coordinate.
    pub coordinates: Vec<Coordinate>,
    /// Acceptance rate of each chain: the fraction of steps at which it moved.
    pub acceptance: Vec<f64>,
    /// Chains that never reached the bulk, or reached it late.
    pub stranded: Stranded,
    /// True if the chains are walkers of one ensemble.
    pub ensemble: bool,
    /// Thresholds that were applied.
    pub criteria: Criteria,
    /// True if all thresholds are met.
    pub converged: bool,
    /// Number of further steps that would meet the thresholds at the present rate; zero if steps are not what is
    /// missing.
    pub more_steps: usize,
    /// Advice to the user, most important first.
    pub advice: Vec<String>,
}

/// Up to this number of unknowns with a large R-hat are listed by name.
const NAMED: usize = 6;

impl Diagnosis {
    /// Diagnoses draws from which the burn-in has been dropped.
    pub fn of(draws: &Draws, ensemble: bool) -> Self {
        let criteria = if ensemble { Criteria::ENSEMBLE } else { Criteria::CHAINS };
        let coordinates: Vec<Coordinate> = (0..draws.dimension())
            .into_par_iter()
            .map(|j| coordinate(draws, j, ensemble))
            .collect();
        let mut diagnosis = Self {
            acceptance: walkers::acceptance(draws),
            stranded: Stranded::among(draws),
            more_steps: more_steps(&coordinates, draws.steps, &criteria),
            coordinates,
            ensemble,
            criteria,
            converged: false,
            advice: Vec::new(),
        };
        diagnosis.converged = diagnosis.holds();
        diagnosis.advice = diagnosis.advise(draws);
        diagnosis
    }

    /// Diagnoses independent draws of equal weight with an effective sample size of `size`; `doubts` are the method's
    /// own reasons not to trust them.
    pub fn of_harvest(draws: &Draws, size: f64, doubts: &[String]) -> Self {
        let mut diagnosis = Self::of(draws, false);
        diagnosis.acceptance = Vec::new();
        diagnosis.stranded = Stranded::default();
        diagnosis.criteria = Criteria { times: 0.0, ..Criteria::CHAINS };
        for c in &mut diagnosis.coordinates {
            // The draws were resampled from weighted ones: duplicates look independent, so the sizes are capped.
            let worth = |found: f64| found.min(size);
            let shrink = (c.ess_bulk / worth(c.ess_bulk)).sqrt();
            (c.ess_bulk, c.ess_tail) = (worth(c.ess_bulk), worth(c.ess_tail));
            c.mcse_mean *= shrink;
            c.mcse_sd *= shrink;
        }
        diagnosis.advice = doubts.to_vec();
        diagnosis.more_steps = 0;
        if size < diagnosis.criteria.ess {
            let (wanted, found) = (diagnosis.criteria.ess, size.floor());
            diagnosis.advice.push(format!(
                "the effective sample size is {found}, below {wanted}: request more draws from the sampler"
            ));
        }
        diagnosis.converged = diagnosis.advice.is_empty();
        diagnosis
    }

    /// Adds the method's own reasons not to trust the draws, before all other advice; any reason makes `converged`
    /// false.
    #[must_use]
    pub fn with_doubts(mut self, doubts: Vec<String>) -> Self {
        self.converged &= doubts.is_empty();
        self.advice.splice(0..0, doubts);
        self
    }

    /// Adds notes before all other advice without changing `converged`.
    #[must_use]
    pub fn with_notes(mut self, notes: Vec<String>) -> Self {
        self.advice.splice(0..0, notes);
        self
    }

    fn holds(&self) -> bool {
        let reached = self.stranded.to_the_end.is_empty() && self.stranded.late.is_empty();
        reached && self.more_steps == 0
    }

    fn advise(&self, draws: &Draws) -> Vec<String> {
        let mut advice = Vec::new();
        let kind = if self.ensemble { "walkers" } else { "chains" };
        let (lost, late) = (self.stranded.to_the_end.len(), self.stranded.late.len());
        if lost > 0 {
            advice.push(format!(
                "{lost} of {} {kind} never reached the bulk: start them around the best fit",
                draws.chains
            ));
        }
        if late > 0 {
            advice.push(format!(
                "{late} of {} {kind} reached the bulk late: use a longer burn-in",
                draws.chains
            ));
        }
        // The comparison is false for NaN, so an R-hat that could not be computed is reported explicitly.
        let disagree = |c: &&Coordinate| c.r_hat.is_nan() || c.r_hat > self.criteria.r_hat;
        let disputed: Vec<&Coordinate> = self.coordinates.iter().filter(disagree).collect();
        let say = |what: String, r_hat: f64| {
            let most = self.criteria.r_hat;
            format!(
                "the {kind} disagree on {what}: R-hat is {r_hat:.3} and should be at most {most}"
            )
        };
        if disputed.len() <= NAMED {
            advice.extend(disputed.iter().map(|c| say(format!("`{}`", c.name), c.r_hat)));
        } else if let Some(worst) = disputed.iter().max_by(|a, b| a.r_hat.total_cmp(&b.r_hat)) {
            let (count, all) = (disputed.len(), self.coordinates.len());
            let what = format!("{count} of {all} unknowns, most on `{}`", worst.name);
            advice.push(say(what, worst.r_hat));
        }
        if self.more_steps > 0 {
            advice.push(format!(
                "run {} more steps to reach {} autocorrelation times and {} effective draws at the present rate",
                self.more_steps, self.criteria.times, self.criteria.ess
            ));
        }
        let longest = longest_time(&self.coordinates);
        if (draws.steps as f64) < 50.0 * longest {
            advice.push(format!(
                "the estimate of the autocorrelation time ({longest:.0} steps) is uncertain: run at least {} steps \
                 after the burn-in",
                (50.0 * longest).ceil()
            ));
        }
        advice
    }
}

fn coordinate(draws: &Draws, j: usize, ensemble: bool) -> Coordinate {
    let values: Vec<Vec<f64>> = draws.coordinate(j).collect();
    Coordinate {
        name: draws.names[j].clone(),
        r_hat: chains::r_hat(&values),
        ess_bulk: chains::ess_bulk(&values),
        ess_tail: chains::ess_tail(&values),
        autocorrelation_time: autocorrelation::integrated_time(&values),
        mcse_mean: if ensemble {
            // The first error is too small for short runs, the second for walkers that move together.
            autocorrelation::ensemble_error(&values).max(chains::mcse_mean(&values))
        } else {
            chains::mcse_mean(&values)
        },
        mcse_sd: chains::mcse_sd(&values),
    }
}

fn longest_time(coordinates: &[Coordinate]) -> f64 {
    coordinates.iter().map(|c| c.autocorrelation_time).fold(0.0, f64::max)
}

/// Number of further steps needed at the present rate; as many as there are already if the rate is unknown.
///
/// `R-hat^2 - 1` falls inversely with the number of steps. It also reveals chains that are still too short to show
/// their own autocorrelation time.
fn more_steps(coordinates: &[Coordinate], steps: usize, criteria: &Criteria) -> usize {
    let present = steps as f64;
    let needed = |c: &Coordinate| {
        let for_size = present * criteria.ess / c.ess_bulk.min(c.ess_tail);
        let for_times = criteria.times * c.autocorrelation_time;
        let excess = |r_hat: f64| r_hat * r_hat - 1.0;
        let for_r_hat = present * excess(c.r_hat) / excess(criteria.r_hat);
        let all = [for_size, for_times, for_r_hat];
        if all.iter().all(|n| n.is_finite()) {
            all.into_iter().fold(0.0, f64::max)
        } else {
            (2.0 * present).max(1.0)
        }
    };
    let most = coordinates.iter().map(needed).fold(0.0, f64::max);
    (most.ceil() as usize).saturating_sub(steps)
}

#[cfg(test)]
mod tests;
