//! Discrepancies: the statistical model of what separates model and data.

pub mod gaussian;
