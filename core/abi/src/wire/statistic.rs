//! Names and kinds of the statistics that a sampler tells of each step.

use lacuna::data::Statistic;
use lacuna::data::statistics::Kind;
use serde::{Deserialize, Serialize};

/// A statistic without its values.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StatisticAbout {
    /// The name of the statistic.
    pub name: String,
    /// The kind of its numbers.
    pub kind: Kind,
}

impl From<&Statistic> for StatisticAbout {
    fn from(statistic: &Statistic) -> Self {
        Self { name: statistic.name.clone(), kind: statistic.kind }
    }
}

impl StatisticAbout {
    /// The statistic with one value a chain.
    pub fn with(self, values: Vec<f64>) -> Statistic {
        Statistic { name: self.name, kind: self.kind, values }
    }
}
