//! What the discrepancies share: how outputs are grouped, numbers that are known or not, replicates, the
//! normal density with errors that all replicates share.

mod groups;
mod noise;
mod normal;
mod quantity;
mod replicates;
mod series;
mod unknown;

pub use groups::{AxisWindows, By, Division, Groups};
pub use noise::{Noise, Setting, part, start};
pub use normal::{Normal, conditional, values};
pub use quantity::{Quantity, Variance};
pub use replicates::{Replicates, squared};
pub use series::Series;
pub use unknown::{PerGroup, Unknown};

#[cfg(test)]
pub(crate) mod testing;
