//! The gap workflow: where simulation and data disagree, what is missing, and whether the gap shrinks with it.
//!
//! [`experiment`] sorts measurements by condition and curve; [`noise`] learns from their replicates what is no gap;
//! [`locate`] tests for one; [`drift`] asks whether model or sensor is wrong; [`name`] searches for what is missing; [`prove`] shows on other replicates whether the gap
//! shrank.

pub mod account;
pub mod added;
mod blocks;
pub mod candidates;
pub mod common;
pub mod drift;
pub mod experiment;
pub mod fit;
pub mod hold_out;
pub mod insight;
pub mod locate;
pub mod name;
pub mod needless;
pub mod noise;
mod part;
pub mod power;
pub mod prove;
pub mod replaced;
pub mod system;
pub mod unlisted;
pub mod whitener;
pub mod wide;
pub mod with_effects;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
