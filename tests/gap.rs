//! The gap workflow on data in which an effect is hidden.
//!
//! `LACUNA_GAP_CASES` is the number of single effects at each of two sizes; all other numbers grow with it. An ordinary run
//! takes a few, of each kind at least one. The nightly run, whose tables stand in `docs/gap_rates.md`, takes 126:
//!
//! ```text
//! LACUNA_GAP_CASES=126 LACUNA_GAP_SEED=1 cargo test --release --workspace --test gap -- --nocapture --test-threads 1
//! ```
//!
//! `LACUNA_GAP_SEED` chooses other data. Cases run in parallel; what is found does not depend on the threads.
#![allow(clippy::unwrap_used)]

use lacuna_plugins as _;

#[path = "gap/beside.rs"]
mod beside;
#[path = "gap/cases.rs"]
mod cases;
#[path = "gap/chain.rs"]
mod chain;
#[path = "gap/falling_balls.rs"]
mod falling_balls;
#[path = "gap/inside.rs"]
mod inside;
#[path = "gap/models.rs"]
mod models;
#[path = "gap/names.rs"]
mod names;
#[path = "gap/places.rs"]
mod places;
#[path = "gap/proofs.rs"]
mod proofs;
#[path = "gap/records.rs"]
mod records;
#[path = "gap/tally.rs"]
mod tally;
#[path = "gap/target/mod.rs"]
mod target;
#[path = "gap/term_forms.rs"]
mod term_forms;
#[path = "gap/terms.rs"]
mod terms;
#[path = "gap/workflow.rs"]
mod workflow;
