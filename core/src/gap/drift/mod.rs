//! The parameter-drift map: the parameters recalibrated under each condition and in each window of the last axis.
//!
//! A model that is right has one value of each parameter. Where the values differ between pieces of the data by more than
//! noise and errors of the forward map allow, the model is wrong (Green, Chodora and Atamturktur, calibration parameters
//! that vary as a sign of a flawed model); where one sensor alone makes the difference, its chain is (Ebers, Steele and
//! Kutz, arXiv 2203.05164: missing dynamics or an error of the sensor).
//!
//! The pieces have their own parameters in one linear model of all data, `z = G'd + e` with whitened slopes `G` of the
//! pieces, so that noise and common errors that tie pieces together are accounted for (Zellner, Journal of the American
//! Statistical Association 57 (1962) 348). Estimates are held by the prior's width about the joint fit; the tests of
//! equality are of Wald's form after the common values are fitted anew, and do not depend on that.

mod equality;
mod map;
mod pieces;
mod reading;
#[cfg(test)]
mod tests;

pub use equality::Equality;
pub use map::{Drifting, Map, Options, Piece, drift};
pub use reading::{Reading, Share};
