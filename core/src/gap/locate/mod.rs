//! Where data and calibrated model disagree: three tests, with nulls by parametric bootstrap, and regions.

mod null;
mod projection;
mod regions;
mod scan;
mod score;

pub use null::{Bench, Nulls, Statistics, common_error, probability};
pub use projection::Projection;
pub use regions::{Region, regions};
pub use scan::{Cell, Scan};
pub use score::{Direction, Directions, Scores, Spread, differences};
