//! What a sampler tells of its steps beside their points.

use serde::{Deserialize, Serialize};

/// What kind of number a statistic is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Zero or one.
    Flag,
    /// A whole number.
    Count,
    /// Any number.
    Number,
}

/// A statistic of one step: one number a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistic {
    /// Its name, as in the group `sample_stats` of ArviZ's `InferenceData` where it has one there.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Its value in each chain; not a number before the first step.
    pub values: Vec<f64>,
}

/// The statistics of all steps of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Statistics {
    /// Their names and kinds.
    pub names: Vec<(String, Kind)>,
    /// The number of chains.
    pub chains: usize,
    /// The number of steps of each chain.
    pub steps: usize,
    /// The values: statistic by statistic, chain by chain, step by step.
    pub values: Vec<f64>,
}

impl Statistics {
    /// One statistic chain by chain without the first `first` steps of each.
    pub fn from_step(&self, statistic: usize, first: usize) -> Vec<f64> {
        let all = self.chains * self.steps;
        let own = &self.values[statistic * all..(statistic + 1) * all];
        let chains = own.chunks_exact(self.steps.max(1));
        chains.flat_map(|chain| &chain[first.min(chain.len())..]).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_steps_of_each_chain_are_left_out() {
        let names = vec![("energy".to_owned(), Kind::Number), ("n_steps".to_owned(), Kind::Count)];
        let values = (0..12).map(f64::from).collect();
        let statistics = Statistics { names, chains: 2, steps: 3, values };
        assert_eq!(statistics.from_step(0, 1), [1.0, 2.0, 4.0, 5.0]);
        assert_eq!(statistics.from_step(1, 2), [8.0, 11.0]);
        assert_eq!(statistics.from_step(1, 9), [0.0; 0]);
    }
}
