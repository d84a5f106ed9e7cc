//! Numerics that several effects share: curves between their points, lags, and places along an axis.

mod along;
mod filter;
mod line;
mod spline;

pub use along::{Along, Row, Stations, lagrange};
pub use filter::Filter;
pub use line::Line;
pub use spline::{Knots, sampled, shifted, shifted_by};

#[cfg(test)]
pub(crate) mod testing;
