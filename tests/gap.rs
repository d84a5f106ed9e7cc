//! The gap workflow on data in which an effect is hidden.
//!
//! `LACUNA_GAP_CASES` is the number of single effects at each of two sizes; all other numbers scale with it. An
//! ordinary run takes a few, one of each kind. The full run, whose tables are in `docs/gap_rates.md`, takes
//! 126:
//!
//! ```text
//! LACUNA_GAP_CASES=126 LACUNA_GAP_SEED=1 cargo test --release --workspace --test all -- --nocapture gap:: --test-threads 1
//! ```
//!
//! `LACUNA_GAP_SEED` selects other data. Cases run in parallel; the results do not depend on the number of threads.

mod beside;
mod cases;
mod chain;
mod classes;
mod companion;
mod falling_balls;
mod further_runs;
mod inexact;
mod inside;
mod laws;
mod models;
mod names;
mod next;
mod places;
mod power;
mod proofs;
mod records;
mod sets;
mod single;
mod tally;
mod target;
mod term_forms;
mod term_laws;
mod terms;
mod two_masses;
mod workflow;
mod yeast;
