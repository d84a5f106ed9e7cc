//! Whether draws can be trusted, and what would help.
//!
//! What is valid for **independent chains**: R-hat compares them, effective sample sizes and
//! Monte Carlo errors follow from their autocorrelation.
//!
//! What is valid for **walkers of one ensemble**: each walker is a chain with the right stationary
//! law, so that a large R-hat, a stranded walker or few autocorrelation times show a failure. But
//! walkers move along lines through each other and are not independent: a small R-hat is no proof of
//! convergence, and it is expected to be near `sqrt(1 + 2 tau / steps)` however well the ensemble
//! has converged. Effective sizes add over walkers as if they were independent, which holds only for
//! many walkers and many autocorrelation times; the error of a mean that needs no independence is
//! that of the series of ensemble means, [`autocorrelation::ensemble_error`].

pub mod autocorrelation;
pub mod bridge;
pub mod chains;
pub mod coverage;
pub mod leave_one_out;
pub mod pareto;
pub mod walkers;

use serde::{Deserialize, Serialize};

use crate::data::Draws;
use walkers::Stranded;

/// What is known about the draws of one coordinate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coordinate {
    /// Its name.
    pub name: String,
    /// Rank-normalised split R-hat.
    pub r_hat: f64,
    /// The effective sample size for the bulk.
    pub ess_bulk: f64,
    /// The effective sample size for the tails.
    pub ess_tail: f64,
    /// The integrated autocorrelation time, in steps.
    pub autocorrelation_time: f64,
    /// The Monte Carlo standard error of the mean; for an ensemble, the larger one of those of
    /// independent walkers and of the series of its means.
    pub mcse_mean: f64,
    /// The Monte Carlo standard error of the standard deviation.
    pub mcse_sd: f64,
}

/// What draws must satisfy to count as converged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Criteria {
    /// The largest R-hat.
    pub r_hat: f64,
    /// The smallest effective sample size of bulk and tails.
    pub ess: f64,
    /// The smallest number of autocorrelation times in the steps kept.
    pub times: f64,
}

impl Criteria {
    /// Independent chains: R-hat below 1.01 and 400 effective draws (Vehtari et al. 2021).
    pub const CHAINS: Self = Self { r_hat: 1.01, ess: 400.0, times: 10.0 };

    /// Walkers of an ensemble: 400 effective draws and ten autocorrelation times, at which the
    /// R-hat of a converged ensemble is expected to be 1.095.
    pub const ENSEMBLE: Self = Self { r_hat: 1.1, ess: 400.0, times: 10.0 };
}

/// A judgement on the draws of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Each coordinate.
    pub coordinates: Vec<Coordinate>,
    /// The share of steps at which each chain moved.
    pub acceptance: Vec<f64>,
    /// Chains that never reached the bulk.
    pub stranded: Stranded,
    /// Whether the chains are walkers of one ensemble.
    pub ensemble: bool,
    /// What was asked.
    pub criteria: Criteria,
    /// Whether all of it holds.
    pub converged: bool,
    /// How many more steps would satisfy the criteria at the present rate, where steps are what is missing.
    pub more_steps: usize,
    /// What a person should know, most important first.
    pub advice: Vec<String>,
}

/// So many unknowns on which chains disagree are told one by one.
const NAMED: usize = 6;

impl Diagnosis {
    /// Judges draws from which the burn-in has been dropped.
    pub fn of(draws: &Draws, ensemble: bool) -> Self {
        let criteria = if ensemble { Criteria::ENSEMBLE } else { Criteria::CHAINS };
        let coordinates: Vec<Coordinate> =
            (0..draws.dimension()).map(|j| coordinate(draws, j, ensemble)).collect();
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

    /// Judges independent draws of equal weight that are worth so many, with the method's own doubts.
    pub fn of_harvest(draws: &Draws, size: f64, doubts: &[String]) -> Self {
        let mut diagnosis = Self::of(draws, false);
        diagnosis.acceptance = Vec::new();
        diagnosis.stranded = Stranded::default();
        diagnosis.criteria = Criteria { times: 0.0, ..Criteria::CHAINS };
        for c in &mut diagnosis.coordinates {
            // Draws that were resampled look better than they are.
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
                "the draws are worth {found} independent ones, and {wanted} are wanted: ask the sampler for more"
            ));
        }
        diagnosis.converged = diagnosis.advice.is_empty();
        diagnosis
    }

    /// The same with the method's own reasons not to trust the draws, which come first.
    #[must_use]
    pub fn with_doubts(mut self, doubts: Vec<String>) -> Self {
        self.converged &= doubts.is_empty();
        self.advice.splice(0..0, doubts);
        self
    }

    /// The same with what a person should know besides, which comes first and leaves the verdict as it is.
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
                "{late} of {} {kind} reached the bulk late: drop a longer burn-in",
                draws.chains
            ));
        }
        // An R-hat that could not be computed complains too.
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
                "{} more steps would give {} autocorrelation times and {} effective draws, \
                 if the {kind} go on as they do",
                self.more_steps, self.criteria.times, self.criteria.ess
            ));
        }
        let longest = longest_time(&self.coordinates);
        if (draws.steps as f64) < 50.0 * longest {
            advice.push(format!(
                "the autocorrelation time, {longest:.0} steps, is rough: {} steps would settle it",
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
            // The first is too small for short runs, the second for walkers that move together.
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

/// Steps that are missing at the present rate; as many again as there are where the rate is unknown.
///
/// The excess of R-hat squared over one falls as one over the number of steps. It tells when chains are
/// still too short to show their own autocorrelation time.
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
