//! Tests of whether and where data and calibrated model disagree: three statistics, null distributions by parametric
//! bootstrap, regions.

mod null;
mod projection;
mod regions;
mod scan;
mod score;

pub use null::{
    NullDistribution, TestSetting, TestStatistics, common_error, is_at_floor, probability,
};
pub use projection::Projection;
pub use regions::{Region, regions};
pub use scan::{Cell, Scan};
pub use score::{DesignMatrix, Regressor, Scores, Spread, differences, slopes};
