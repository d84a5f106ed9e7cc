//! Plain data: units, layouts, ensembles, measurements.

pub mod unit;

pub use unit::{Unit, UnitError};
