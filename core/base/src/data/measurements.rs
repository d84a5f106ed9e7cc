//! Replicated measurements of a response.

use serde::{Deserialize, Serialize};

use super::{Layout, Layouts, Shared};
use crate::matrix::Matrix;

/// Repeated measurements of one response; values may be missing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// Layout of one complete measurement.
    pub layout: Layout,
    /// Replicates, in the order in which they were read. Copies of the measurements share them.
    pub replicates: Shared<Vec<Replicate>>,
    /// Covariance of the noise of one complete measurement, `outputs x outputs`, in the squared unit of the response;
    /// `None` if the data do not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Matrix>,
}

/// One repeated measurement, such as one pulse.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    /// Name of the replicate in the data, such as a pulse number.
    pub name: String,
    /// Measured values, one per output of the layout; `None` where nothing was measured. Copies of the replicate share
    /// them.
    pub values: Shared<Vec<Option<f64>>>,
    /// Standard deviation of the noise of each value, in the unit of the response; zero where nothing was measured.
    /// `None` if the data do not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<Vec<f64>>,
}

impl Replicate {
    /// A replicate without stated noise.
    pub fn new(name: impl Into<String>, values: Vec<Option<f64>>) -> Self {
        Self { name: name.into(), values: values.into(), sd: None }
    }

    /// A copy that keeps only the values at outputs for which `kept` is true; the noise is kept unchanged.
    #[must_use]
    pub fn only(&self, kept: impl Fn(usize) -> bool) -> Self {
        let values = self.values.iter().enumerate().map(|(i, y)| y.filter(|_| kept(i)));
        Self { values: values.collect(), ..self.clone() }
    }
}

/// Statistics of one output over the replicates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of replicates that measured the output.
    pub count: usize,
    /// Mean over the replicates; zero if there are none.
    pub mean: f64,
    /// Sum of squared deviations from the mean, in the squared unit of the response.
    pub scatter: f64,
    /// Standard deviation of one replicate as the data state it: the root mean square of the stated values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated: Option<f64>,
}

impl Summary {
    /// Standard deviation of one replicate: the stated one, otherwise that of the sample (divisor `count - 1`); `None`
    /// if it is not stated and there are fewer than two replicates.
    pub fn sd(&self) -> Option<f64> {
        let found = || (self.scatter / (self.count as f64 - 1.0)).sqrt();
        self.stated.or_else(|| (self.count >= 2).then(found))
    }
}

impl Measurements {
    /// Measurements without stated noise.
    pub fn new(layout: Layout, replicates: Vec<Replicate>) -> Self {
        Self { layout, replicates: replicates.into(), covariance: None }
    }

    /// A copy with these replicates in place of the present ones; layout and stated covariance are kept.
    #[must_use]
    pub fn with_replicates(&self, replicates: Vec<Replicate>) -> Self {
        let (layout, covariance) = (self.layout.clone(), self.covariance.clone());
        Self { layout, replicates: replicates.into(), covariance }
    }

    /// Returns true if the data state the size of their noise.
    pub fn states_noise(&self) -> bool {
        self.covariance.is_some() || self.replicates.iter().any(|r| r.sd.is_some())
    }

    /// Stated variance of output `i` of one replicate, in the squared unit of the response; `None` if it is not stated.
    pub fn stated_variance(&self, replicate: &Replicate, i: usize) -> Option<f64> {
        let own = || replicate.sd.as_ref().map(|sd| sd[i] * sd[i]);
        self.covariance.as_ref().map(|c| c[(i, i)]).or_else(own)
    }

    /// Stated standard deviation of each output, in the unit of the response. Outputs without a measured value get the
    /// root mean square of the others; all are zero if nothing is stated.
    pub fn stated_sd(&self) -> Vec<f64> {
        let stated: Vec<Option<f64>> = self.summaries().iter().map(|s| s.stated).collect();
        let squares = || stated.iter().flatten().map(|sd| sd * sd);
        let other = (squares().sum::<f64>() / squares().count().max(1) as f64).sqrt();
        stated.iter().map(|sd| sd.unwrap_or(other)).collect()
    }

    /// Number of measured values.
    pub fn count(&self) -> usize {
        self.replicates.iter().map(|r| r.values.iter().flatten().count()).sum()
    }

    /// Count, mean and scatter over the replicates, one entry per output.
    ///
    /// Replicates are passed one after the other, so that a large table is read in the order of memory.
    pub fn summaries(&self) -> Vec<Summary> {
        let mut summaries = self.counted();
        self.add_scatter(&mut summaries);
        let stated = self.mean_stated_variances(&summaries);
        for (summary, variance) in summaries.iter_mut().zip(stated) {
            summary.stated = variance.map(f64::sqrt);
        }
        summaries
    }

    /// Count and mean of each output; the others are zero.
    fn counted(&self) -> Vec<Summary> {
        // Starts from -0.0, like the sum over an iterator.
        let mut sums = vec![(0_usize, -0.0); self.layout.len()];
        for replicate in &self.replicates {
            for ((count, sum), y) in sums.iter_mut().zip(&replicate.values) {
                if let Some(y) = y {
                    *count += 1;
                    *sum += y;
                }
            }
        }
        let mean = |(count, sum): (usize, f64)| match count {
            0 => Summary::default(),
            _ => Summary { count, mean: sum / count as f64, ..Summary::default() },
        };
        sums.into_iter().map(mean).collect()
    }

    fn add_scatter(&self, summaries: &mut [Summary]) {
        let measured = |summary: &&mut Summary| summary.count > 0;
        summaries.iter_mut().filter(measured).for_each(|summary| summary.scatter = -0.0);
        for replicate in &self.replicates {
            for (summary, y) in summaries.iter_mut().zip(&replicate.values) {
                if let Some(y) = y {
                    summary.scatter += (y - summary.mean).powi(2);
                }
            }
        }
    }

    /// Mean of the stated variances of each output over its values; `None` if one of them is not stated, or there is none.
    fn mean_stated_variances(&self, summaries: &[Summary]) -> Vec<Option<f64>> {
        if !self.states_noise() {
            return vec![None; summaries.len()];
        }
        let measured = |s: &Summary| (s.count > 0).then_some(-0.0);
        let mut sums: Vec<Option<f64>> = summaries.iter().map(measured).collect();
        for replicate in &self.replicates {
            let outputs = sums.iter_mut().zip(&replicate.values).enumerate();
            for (i, (sum, _)) in outputs.filter(|(_, (_, y))| y.is_some()) {
                let stated = self.stated_variance(replicate, i);
                *sum = sum.and_then(|sum| Some(sum + stated?));
            }
        }
        let mean = |(sum, s): (Option<f64>, &Summary)| sum.map(|sum| sum / s.count as f64);
        sums.into_iter().zip(summaries).map(mean).collect()
    }

    /// The measured values of output `i`, in the order of the replicates.
    pub fn values(&self, i: usize) -> Vec<f64> {
        self.replicates.iter().filter_map(|r| r.values[i]).collect()
    }
}

/// The measurements of all blocks of a study's [`Layouts`], in the order of the blocks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Observations {
    /// Measurements of each block.
    pub blocks: Vec<Measurements>,
}

impl From<Measurements> for Observations {
    fn from(measurements: Measurements) -> Self {
        Self { blocks: vec![measurements] }
    }
}

impl Observations {
    /// Applies a function to each block.
    pub fn map(&self, change: impl Fn(&Measurements) -> Measurements) -> Self {
        Self { blocks: self.blocks.iter().map(change).collect() }
    }

    /// Returns true if the data of any block state the size of their noise.
    pub fn states_noise(&self) -> bool {
        self.blocks.iter().any(Measurements::states_noise)
    }

    /// The measured values by block, replicate and output, without the missing ones.
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let replicates = self.blocks.iter().flat_map(|block| &block.replicates);
        replicates.flat_map(|replicate| replicate.values.iter().flatten()).copied()
    }

    /// Number of measured values over all blocks.
    pub fn count(&self) -> usize {
        self.blocks.iter().map(Measurements::count).sum()
    }

    /// Number of replicates, summed over all blocks.
    pub fn replicates(&self) -> usize {
        self.blocks.iter().map(|block| block.replicates.len()).sum()
    }

    /// Statistics of each output over the replicates, all blocks concatenated.
    pub fn summaries(&self) -> Vec<Summary> {
        self.blocks.iter().flat_map(Measurements::summaries).collect()
    }

    /// Layouts of the blocks.
    pub fn layouts(&self) -> Layouts {
        Layouts { blocks: self.blocks.iter().map(|block| block.layout.clone()).collect() }
    }
}
