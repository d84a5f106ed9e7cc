//! Parts shared by the discrepancies: groups of outputs, known or unknown numbers, replicates, and the normal density
//! with errors common to all replicates.

mod biased;
mod correlation;
mod dense;
mod directions;
mod groups;
mod noise;
mod normal;
mod places;
mod quantity;
mod replicates;
mod series;
mod smooth;
mod unknown;

pub use biased::{Bias, Biased, normal_draw};
pub use correlation::{Correlation, Functional};
pub use dense::{Dense, DenseSolved};
pub use directions::{WeightedDirections, WeightedFactor};
pub use groups::{AxisWindows, By, Division, Groups};
pub use noise::{Noise, Setting, part, start};
pub use normal::{Normal, conditional, values};
pub use places::Places;
pub use quantity::{Quantity, Variance};
pub use replicates::{Replicates, squared};
pub use series::Series;
pub use smooth::{Block, Smooth, SmoothBias, loses_an_output};
pub use unknown::{PerGroup, Unknown};

#[cfg(test)]
pub(crate) mod testing;
