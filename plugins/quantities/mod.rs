//! Quantities of interest: numbers that follow from a curve of the response, or from other numbers.

pub mod at;
pub mod band;
pub mod common;
pub mod exceedance;
pub mod expression;
pub mod integral;
pub mod maximum;
pub mod mean;
pub mod minimum;
pub mod rainflow;
pub mod range;
pub mod rms;
mod spectrum;
pub mod time_of_maximum;
