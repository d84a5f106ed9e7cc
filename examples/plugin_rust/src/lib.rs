//! A library of plugins: a discrepancy and a sampler.
//!
//! Each is written like a plugin in the source tree; the last lines export both.

mod difference_walk;
mod matern;

use difference_walk::DifferenceWalk;
use matern::Matern;

lacuna_plugin::export! {
    Discrepancy "matern" Matern,
    Sampler "difference_walk" DifferenceWalk,
}
