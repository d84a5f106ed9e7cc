//! What a search sees and what it found, as plain data.

use serde::{Deserialize, Serialize};

use crate::gap::candidates::Suspect;
use crate::gap::fit::Fit;
use crate::gap::locate::{Region, Statistics};
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::plugin::effect::On;

use super::leaders::Judged;

/// How a search judges.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The probability of naming an effect where there is none.
    pub naming: f64,
    /// The probability of finding a gap without a name where there is none.
    pub unlisted: f64,
    /// Simulations of the nulls.
    pub simulations: usize,
    /// The most effects.
    pub most: usize,
}

/// A calibrated system as the tests see it.
#[derive(Clone)]
pub struct Look {
    /// The unknowns and the response.
    pub fit: Fit,
    /// The statistics.
    pub statistics: Statistics,
    /// The energy of the residual that noise and common errors alone have.
    pub expected_energy: f64,
    /// The standard deviation of that.
    pub energy_sd: f64,
    /// The probabilities of the largest score, of the best cell and of the energy when nothing is missing.
    pub p: [f64; 3],
    /// Where data and model disagree.
    pub regions: Vec<Region>,
    /// What can be seen of each suspect: the share that is absorbed, and the size found in 80 % of cases.
    pub visible: Vec<Visible>,
}

impl Look {
    /// The energy of the residual beyond that of noise and common errors.
    pub fn excess(&self) -> f64 {
        self.statistics.energy - self.expected_energy
    }
}

/// What an experiment can see of a suspect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Visible {
    /// The name of its plugin.
    pub kind: String,
    /// Where it acts.
    pub on: On,
    /// The share of it that the calibrated unknowns absorb, for the direction that shows best.
    pub absorbed: f64,
    /// The smallest change of its size that would be found in 80 % of cases, by linearisation.
    pub smallest: f64,
}

/// One step of the path.
#[derive(Clone)]
pub struct Step {
    /// The system before it.
    pub before: Look,
    /// What was weighed, the heaviest first.
    pub judged: Vec<Judged>,
    /// The log of the odds that any of it acts, against nothing further.
    pub log_odds: f64,
    /// What was added.
    pub added: Vec<Suspect>,
    /// The names of effects that were dropped after it.
    pub dropped: Vec<String>,
}

/// What a search found.
#[derive(Clone)]
pub struct Found<'a> {
    /// The steps.
    pub path: Vec<Step>,
    /// The system at the end.
    pub system: System<'a>,
    /// Its effects as suspects.
    pub chosen: Vec<Suspect>,
    /// The system at the end as the tests see it.
    pub last: Look,
    /// The probability of each type for each effect, in the place of the one chosen, the most probable first.
    pub types: Vec<Vec<(String, f64)>>,
    /// The probability of such differences between conditions, or between the sensors of a group, if each
    /// effect were the same in all; one where there is nothing to compare.
    pub consistency: f64,
    /// The share of replicates without which the last effect keeps its name.
    pub stability: f64,
    /// The noise of the replicates.
    pub noise: Noise,
    /// Made of it.
    pub whitener: Whitener,
    /// The replicates' means.
    pub means: Vec<f64>,
}

impl Found<'_> {
    /// The calibrated system before the first step.
    pub fn first(&self) -> &Look {
        self.path.first().map_or(&self.last, |step| &step.before)
    }

    /// Whether some test rejected the system before the first step.
    pub fn alarmed(&self, options: Options) -> bool {
        let [score, scan, energy] = self.first().p;
        score <= options.naming || scan.min(energy) <= 0.5 * options.unlisted
    }
}
