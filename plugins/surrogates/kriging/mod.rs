//! Gaussian processes with a trend, conditioned on runs; shared by `gaussian_process`, `polynomial_chaos_kriging` and `active_kriging`.

mod emulator;
mod factor;
mod field;
mod fit;
mod kernel;
mod likelihood;
mod nearest;
mod options;
mod regressors;
mod scoring;
mod search;
mod standard;
mod tables;

#[cfg(test)]
mod tests;

pub use emulator::Kriging;
pub use field::{Choice, Field, Runs};
pub use fit::{Settings, Trends};
pub use kernel::Kernel;
pub use likelihood::Restricted;
pub use options::{Approximation, Bounds, Estimated, LengthScales, Nugget};
pub use regressors::Regressors;
pub use search::search;
pub use standard::Standard;
