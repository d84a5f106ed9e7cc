//! The report: a self-contained page of figures and tables, made from plain results.
//!
//! [`render`] makes the page, [`summary_text`] the closing text of the terminal, and [`summary`] the file for scripts;
//! all three depend on [`findings::Findings`] only.

mod coverage;
pub mod findings;
mod missing;
mod page;
mod qualified;
mod section;
pub mod stage;
mod summary;
mod terminal;

pub use crate::gap::report::power::power_text;
pub use crate::page::table::Table;
pub use coverage::{coverage_page, coverage_text};
pub use page::{page, render};
pub use section::banner::banner;
pub use summary::{ByName, Key, Quantity, SCHEMA, Summary, keys, schema, schema_of, summary};
pub use terminal::{gap_text, next_text, summary_text};

#[cfg(test)]
mod tests;
