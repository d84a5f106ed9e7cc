//! The diagnostics of a model on the path of a search, and the result of the search, as plain data.

use lacuna::math::moments::quantile;
use lacuna::plugin::effect::On;
use serde::{Deserialize, Serialize};

use super::explained::Explained;
use super::refit::{TolerantEvidence, Weighed};
use super::support::Support;
use super::visited::{ModelAverage, VisitedModel};
use crate::gap::candidates::{Candidate, Placement};
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::remainder::Remainder;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{DesignMatrix, NullDistribution, Region, TestStatistics};

/// The levels and limits of a search.
#[derive(Debug, Clone, Copy)]
pub struct SearchOptions {
    /// The probability of a false alarm by the scores, which lead to a name.
    pub naming: f64,
    /// The probability of a false alarm by the scan and the energy.
    pub unlisted: f64,
    /// The largest number of simulations of a null distribution.
    pub simulations: usize,
    /// The largest number of effects.
    pub most: usize,
}

/// The diagnostics of a calibrated system: its fit, test statistics and p-values.
#[derive(Clone)]
pub struct Diagnostics {
    /// The unknowns and the response.
    pub fit: Fit,
    /// The statistics.
    pub statistics: TestStatistics,
    /// The expectation of the energy under noise and the emulator's error alone.
    pub expected_energy: f64,
    /// The standard deviation of the energy under the same.
    pub energy_sd: f64,
    /// The p-values of the largest score, of the best cell and of the energy.
    pub p: [f64; 3],
    /// Regions in which data and model disagree.
    pub regions: Vec<Region>,
    /// The detectability of each placement.
    pub visible: Vec<Detectability>,
    /// The evidence of its remainder.
    pub tolerant: TolerantEvidence,
}

impl Diagnostics {
    /// The energy of the residual less its expectation under noise and the emulator's error.
    pub fn excess(&self) -> f64 {
        self.statistics.energy - self.expected_energy
    }
}

/// The detectability of a placement in an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Detectability {
    /// The name of its plugin.
    pub kind: String,
    /// Labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The share of its squared whitened length that the calibrated unknowns absorb, for its longest regressor.
    pub absorbed: f64,
    /// The smallest size, in its unit, that would be found in 80 % of cases, by linearisation.
    pub smallest: f64,
}

/// One step of the forward selection.
#[derive(Clone)]
pub struct SearchStep {
    /// The system before it.
    pub before: Diagnostics,
    /// The placements that were refitted, the one of largest weight first.
    pub weighed: Vec<Weighed>,
    /// The log posterior odds of all of them together against no further effect.
    pub log_odds: f64,
    /// The placements that were added.
    pub added: Vec<Placement>,
    /// The names of effects that were dropped after it.
    pub dropped: Vec<String>,
    /// The models that were compared.
    pub visited: Vec<VisitedModel>,
}

/// The result of a search.
#[derive(Clone)]
pub struct SearchResult<'a> {
    /// The steps.
    pub path: Vec<SearchStep>,
    /// The system at the end.
    pub system: System<'a>,
    /// The placements of its effects.
    pub chosen: Vec<Placement>,
    /// The diagnostics of the system at the end.
    pub last: Diagnostics,
    /// The probability of each type for each effect, in the place of the one chosen, the most probable first.
    pub types: Vec<Vec<(String, f64)>>,
    /// The placements that were weighed in the place of each effect, in decreasing order of weight.
    pub slots: Vec<Vec<Weighed>>,
    /// The posterior probabilities of all types, over the models that the search compared.
    pub average: ModelAverage,
    /// The part of the gap that the effects close together.
    pub explained: Explained,
    /// The support of each effect.
    pub support: Vec<Support>,
    /// The names of effects that were found beside these and are not certain: they are left to the remainder.
    pub uncertain: Vec<String>,
    /// The probability of differences as large between conditions, or between the sensors of a group, if each effect
    /// were the same in all; 1 if there is nothing to compare.
    pub consistency: f64,
    /// The share of replicates without which the last effect keeps its name.
    pub stability: f64,
    /// The noise of the replicates.
    pub noise: Noise,
    /// The whitener of the mean under that noise.
    pub whitener: Whitener,
    /// The replicates' means, one an output, in the response's unit.
    pub means: Vec<f64>,
    /// The remainder that was tried.
    pub remainder: Remainder,
}

impl SearchResult<'_> {
    /// The calibrated system before the first step.
    pub fn first(&self) -> &Diagnostics {
        self.path.first().map_or(&self.last, |step| &step.before)
    }

    /// True when some test rejected the system before the first step.
    pub fn alarmed(&self, options: SearchOptions) -> bool {
        let [score, scan, energy] = self.first().p;
        score <= options.naming || scan.min(energy) <= 0.5 * options.unlisted
    }
}

/// The normal quantile of 80 %.
const EIGHTY: f64 = 0.8416;

/// The detectability of each placement, by linearisation; `naming` is the level of the score test.
pub(super) fn detectability(
    candidates: &[Candidate],
    placements: &[Placement],
    design: &DesignMatrix,
    nulls: &NullDistribution,
    naming: f64,
) -> Vec<Detectability> {
    let mut null = nulls.score.clone();
    null.sort_by(f64::total_cmp);
    let threshold = quantile(&null, 1.0 - naming);
    let of = |(s, placement): (usize, &Placement)| {
        let own = design.regressors.iter().filter(|d| d.placement == s);
        let best = own.max_by(|a, b| a.length.total_cmp(&b.length));
        Detectability {
            kind: candidates[placement.candidate].kind.clone(),
            on: placement.on.clone(),
            absorbed: best.map_or(1.0, |d| d.absorbed),
            smallest: best.map_or(f64::INFINITY, |d| (threshold + EIGHTY) / d.length),
        }
    };
    placements.iter().enumerate().map(of).collect()
}
