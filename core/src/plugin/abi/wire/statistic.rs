//! What samplers tell of a step, beside the numbers.

use serde::{Deserialize, Serialize};

use crate::data::Statistic;
use crate::data::statistics::Kind;

/// A statistic without its values.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StatisticAbout {
    /// Its name.
    pub name: String,
    /// What kind of number it is.
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
