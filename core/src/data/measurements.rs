//! Replicated measurements of a response.

use serde::{Deserialize, Serialize};

use super::{Layout, Layouts};
use crate::linalg::Matrix;

/// Repeated measurements of one response, with gaps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// The shape of one complete measurement.
    pub layout: Layout,
    /// The repetitions, in the order in which they were read.
    pub replicates: Vec<Replicate>,
    /// The covariance of the noise of one complete measurement, `outputs x outputs`, in the squared unit of the
    /// response, where the data state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Matrix>,
}

/// One repeated measurement, such as one pulse.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    /// Its name in the data, such as a pulse number.
    pub name: String,
    /// Its values on the layout; `None` where nothing was measured.
    pub values: Vec<Option<f64>>,
    /// The standard deviation of the noise of each value, in the unit of the response, where the data state it; zero
    /// where nothing was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<Vec<f64>>,
}

impl Replicate {
    /// A replicate whose noise is not stated.
    pub fn new(name: impl Into<String>, values: Vec<Option<f64>>) -> Self {
        Self { name: name.into(), values, sd: None }
    }

    /// The same values at some outputs only, with their noise.
    #[must_use]
    pub fn only(&self, kept: impl Fn(usize) -> bool) -> Self {
        let values = self.values.iter().enumerate().map(|(i, y)| y.filter(|_| kept(i)));
        Self { values: values.collect(), ..self.clone() }
    }
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
    /// The standard deviation of one replicate that the data state: the root of the mean of the stated variances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated: Option<f64>,
}

impl Summary {
    /// The standard deviation of one replicate: the one that is stated, else from the unbiased variance; `None` below
    /// two replicates whose noise is not stated.
    pub fn sd(&self) -> Option<f64> {
        let found = || (self.scatter / (self.count as f64 - 1.0)).sqrt();
        self.stated.or_else(|| (self.count >= 2).then(found))
    }
}

impl Measurements {
    /// Measurements whose noise is not stated.
    pub fn new(layout: Layout, replicates: Vec<Replicate>) -> Self {
        Self { layout, replicates, covariance: None }
    }

    /// The same with other replicates.
    #[must_use]
    pub fn with_replicates(&self, replicates: Vec<Replicate>) -> Self {
        Self { layout: self.layout.clone(), replicates, covariance: self.covariance.clone() }
    }

    /// Whether the data say how large their noise is.
    pub fn states_noise(&self) -> bool {
        self.covariance.is_some() || self.replicates.iter().any(|r| r.sd.is_some())
    }

    /// The stated variance of one value, in the squared unit of the response.
    pub fn stated_variance(&self, replicate: &Replicate, i: usize) -> Option<f64> {
        let own = || replicate.sd.as_ref().map(|sd| sd[i] * sd[i]);
        self.covariance.as_ref().map(|c| c[(i, i)]).or_else(own)
    }

    /// The stated standard deviation of each output: that of its values, and where it was not measured the root mean
    /// square of the others; zero where nothing is stated.
    pub fn stated_sd(&self) -> Vec<f64> {
        let stated: Vec<Option<f64>> = self.summaries().iter().map(|s| s.stated).collect();
        let squares = || stated.iter().flatten().map(|sd| sd * sd);
        let other = (squares().sum::<f64>() / squares().count().max(1) as f64).sqrt();
        stated.iter().map(|sd| sd.unwrap_or(other)).collect()
    }

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
        let measured = self.replicates.iter().filter(|r| r.values[i].is_some());
        let stated: Option<Vec<f64>> = measured.map(|r| self.stated_variance(r, i)).collect();
        let stated = stated.map(|of| (of.iter().sum::<f64>() / of.len() as f64).sqrt());
        Summary { count, mean, scatter, stated }
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

    /// Whether the data say how large their noise is.
    pub fn states_noise(&self) -> bool {
        self.blocks.iter().any(Measurements::states_noise)
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
