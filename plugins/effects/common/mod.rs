//! What the effects share: their unknowns and priors, starts and proposals, curves between their points, lags,
//! and places along an axis.

mod added;
mod along;
mod filter;
mod line;
mod span;
mod spline;
mod starts;
mod unknown;

pub use added::{added, added_slopes};
pub use along::{Along, Row, Stations, lagrange};
pub use filter::Filter;
pub use line::Line;
pub use span::{Span, each_curve, grid};
pub use spline::{Knots, shifted};
pub use starts::{all, apart, propose, signs, spaced, spaced_by_ratio};
pub use unknown::{Measure, Unknown, check, parameters};

#[cfg(test)]
pub(crate) mod testing;
