//! The parameter-drift map: the parameters recalibrated under each condition and in each window of the last axis.
//!
//! A correct model has one value of each parameter. Where the values differ between windows of the data by more than
//! noise and errors of the forward map allow, the model is wrong (Green, Chodora and Atamturktur, calibration
//! parameters that vary as a sign of a flawed model); where one sensor alone makes the difference, its measuring chain
//! is (Ebers, Steele and Kutz, arXiv 2203.05164: missing dynamics or an error of the sensor).
//!
//! The windows have their own parameters in one linear model of all data, `z = G'd + e` with whitened slopes `G` of the
//! windows, which accounts for noise and model errors that correlate windows (Zellner, Journal of the American
//! Statistical Association 57 (1962) 348). Estimates are regularised by the prior around the joint fit; the tests of
//! equality are Wald tests after the common values are fitted again, and do not depend on that prior.

mod equality;
mod map;
mod pieces;
mod reading;
mod setting;
#[cfg(test)]
mod tests;

pub use equality::Equality;
pub use map::{DriftMap, DriftOptions, WindowEstimate, drift};
pub use reading::{DriftLevel, MisfitShare};
pub use setting::DriftingParameter;
