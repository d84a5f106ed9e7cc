//! The gap workflow: where simulation and data disagree, what is missing, and whether the gap shrinks with it.

pub mod candidates;
pub mod experiment;
pub mod fit;
pub mod locate;
pub mod name;
pub mod noise;
pub mod prove;
pub mod system;
pub mod whitener;
