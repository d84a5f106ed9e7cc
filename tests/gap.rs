//! The gap workflow on data in which an effect is hidden.
#![allow(clippy::unwrap_used)]

use lacuna_plugins as _;

#[path = "gap/beside.rs"]
mod beside;
#[path = "gap/chain.rs"]
mod chain;
#[path = "gap/falling_balls.rs"]
mod falling_balls;
#[path = "gap/inside.rs"]
mod inside;
#[path = "gap/target.rs"]
mod target;
#[path = "gap/workflow.rs"]
mod workflow;
