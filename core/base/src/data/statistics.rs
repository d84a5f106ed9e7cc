//! Statistics that a sampler reports for each step.

use serde::{Deserialize, Serialize};

/// Type of a statistic's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// 0 or 1.
    Flag,
    /// A non-negative integer.
    Count,
    /// A real number.
    Number,
}

/// A statistic of one step: one value per chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistic {
    /// Name, as in the group `sample_stats` of ArviZ's `InferenceData` if ArviZ has the statistic.
    pub name: String,
    /// Type of the values.
    pub kind: Kind,
    /// Value in each chain; NaN before the first step.
    pub values: Vec<f64>,
}

/// The statistics of all steps of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Statistics {
    /// Name and type of each statistic.
    pub names: Vec<(String, Kind)>,
    /// Number of chains.
    pub chains: usize,
    /// Number of steps of each chain.
    pub steps: usize,
    /// Values, row-major as `statistics x chains x steps`.
    pub values: Vec<f64>,
}

impl Statistics {
    /// The values of one statistic without the first `first` steps of each chain, all chains concatenated.
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
