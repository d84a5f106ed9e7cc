//! Distances between two samples of points, squared, with their derivatives.

use lacuna::run::Stop;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::histogram::Histogram;
use super::pairs::{Kernel, Pairs};
use super::projections::Projections;

/// Distance between two distributions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Wasserstein distance of order 1: the mean distance over which the points of one sample are moved to become the
    /// other, in the unit of the response. With `axis_weight` its sliced form, the mean over 16 directions of the
    /// distance between projections (Nadjahi et al., ICASSP 2020, p. 5470).
    #[default]
    Wasserstein,
    /// Maximum mean discrepancy with a Gaussian kernel, a number (Gretton et al., J. Machine Learning Research 13
    /// (2012) 723): the root of its V-statistic.
    MaximumMeanDiscrepancy,
    /// Energy distance, the root of `2 E|X - Y| - E|X - X'| - E|Y - Y'|`, in the root of the unit of the response
    /// (Székely and Rizzo, J. Statistical Planning and Inference 143 (2013) 1249).
    Energy,
    /// Jensen-Shannon distance, a number from 0 to 0.833: the root of the divergence in natural units (Endres and
    /// Schindelin, IEEE Trans. Information Theory 49 (2003) 1858) between histograms smoothed by a normal density.
    JensenShannon,
}

/// The distance of a sample to the data, prepared.
#[derive(Debug, Clone)]
pub(super) enum ToData {
    Projections(Projections),
    Pairs(Pairs),
    Histogram(Histogram),
}

impl ToData {
    /// The distance to points of these values; with a coordinate they are points of a plane, and those of any other
    /// sample have the same coordinates.
    pub fn new(
        metric: Metric,
        coordinate: Option<Vec<f64>>,
        data: Vec<f64>,
        bandwidth: Option<f64>,
    ) -> Result<Self, Stop> {
        Ok(match metric {
            Metric::Wasserstein => Self::Projections(Projections::new(coordinate, &data)),
            Metric::Energy => Self::Pairs(Pairs::new(Kernel::Distance, coordinate, data)),
            Metric::MaximumMeanDiscrepancy => {
                let width = bandwidth.or_else(|| Pairs::median(coordinate.as_deref(), &data));
                let kernel = Kernel::Gaussian { width: width.ok_or_else(no_width)? };
                Self::Pairs(Pairs::new(kernel, coordinate, data))
            }
            Metric::JensenShannon => {
                let width =
                    bandwidth.or_else(|| Histogram::silverman(&data)).ok_or_else(no_width)?;
                Self::Histogram(Histogram::new(coordinate.as_deref(), &data, width))
            }
        })
    }

    /// The squared distance to a sample of as many values as the data, and its derivative by each value if `slopes` has
    /// room for them.
    pub fn square(&self, values: &[f64], slopes: Option<&mut [f64]>) -> f64 {
        match self {
            Self::Projections(projections) => projections.square(values, slopes),
            Self::Pairs(pairs) => pairs.square(values, slopes),
            Self::Histogram(histogram) => histogram.square(values, slopes),
        }
    }
}

fn no_width() -> Stop {
    Stop::new(
        "the measured values of a group are equal, so that they give no `bandwidth`; state it",
    )
}
