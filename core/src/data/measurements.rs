//! Replicated measurements of a response.

use serde::{Deserialize, Serialize};

use super::{Layout, Layouts};

/// Repeated measurements of one response, with gaps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// The shape of one complete measurement.
    pub layout: Layout,
    /// The repetitions, in the order in which they were read.
    pub replicates: Vec<Replicate>,
}

/// One repeated measurement, such as one pulse.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    /// Its name in the data, such as a pulse number.
    pub name: String,
    /// Its values on the layout; `None` where nothing was measured.
    pub values: Vec<Option<f64>>,
}

/// What the replicates say about one value of the response.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// How many replicates measured it.
    pub count: usize,
    /// Their mean; zero when there is none.
    pub mean: f64,
    /// The sum of squared deviations from the mean.
    pub scatter: f64,
}

impl Summary {
    /// The standard deviation of one replicate, unbiased variance; `None` below two replicates.
    pub fn sd(&self) -> Option<f64> {
        (self.count >= 2).then(|| (self.scatter / (self.count as f64 - 1.0)).sqrt())
    }
}

impl Measurements {
    /// The number of values that were measured.
    pub fn count(&self) -> usize {
        self.replicates.iter().map(|r| r.values.iter().flatten().count()).sum()
    }

    /// Count, mean and scatter over the replicates, for each value of the layout.
    pub fn summaries(&self) -> Vec<Summary> {
        (0..self.layout.len()).map(|i| self.summary(i)).collect()
    }

    fn summary(&self, i: usize) -> Summary {
        let values = || self.replicates.iter().filter_map(|r| r.values[i]);
        let count = values().count();
        if count == 0 {
            return Summary::default();
        }
        let mean = values().sum::<f64>() / count as f64;
        let scatter = values().map(|y| (y - mean).powi(2)).sum();
        Summary { count, mean, scatter }
    }

    /// The measured values at place `i` of the layout, in the order of the replicates.
    pub fn values(&self, i: usize) -> Vec<f64> {
        self.replicates.iter().filter_map(|r| r.values[i]).collect()
    }
}

/// The measurements of all blocks of a study's [`Layouts`], in their order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Observations {
    /// The measurements of each block.
    pub blocks: Vec<Measurements>,
}

impl From<Measurements> for Observations {
    fn from(measurements: Measurements) -> Self {
        Self { blocks: vec![measurements] }
    }
}

impl Observations {
    /// The same with something done to each block.
    pub fn map(&self, change: impl Fn(&Measurements) -> Measurements) -> Self {
        Self { blocks: self.blocks.iter().map(change).collect() }
    }

    /// The number of values.
    pub fn count(&self) -> usize {
        self.blocks.iter().map(Measurements::count).sum()
    }

    /// The number of replicates of all blocks.
    pub fn replicates(&self) -> usize {
        self.blocks.iter().map(|block| block.replicates.len()).sum()
    }

    /// What the replicates say about each output of all blocks.
    pub fn summaries(&self) -> Vec<Summary> {
        self.blocks.iter().flat_map(Measurements::summaries).collect()
    }

    /// The shapes of the blocks.
    pub fn layouts(&self) -> Layouts {
        Layouts { blocks: self.blocks.iter().map(|block| block.layout.clone()).collect() }
    }
}
