//! The gap workflow on data in which an effect is hidden.
#![allow(clippy::unwrap_used)]

use lacuna_plugins as _;

#[path = "gap/beside.rs"]
mod beside;
#[path = "gap/chain.rs"]
mod chain;
