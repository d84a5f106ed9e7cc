//! The report: a self-contained page of figures and tables, from plain results.
//!
//! [`render`] makes the page, [`summary_text`] what a terminal shows at the end, and
//! [`summary_json`] what scripts read; all three from [`findings::Findings`] and nothing else.

mod chart;
mod coverage;
mod curve;
pub mod findings;
mod gap;
pub(crate) mod number;
mod page;
mod power;
mod qualified;
mod scale;
mod section;
mod summary;
mod svg;
pub(crate) mod table;
mod terminal;

pub use coverage::{coverage_page, coverage_text};
pub use gap::gap_text;
pub use page::render;
pub use power::power_text;
pub use summary::{SCHEMA, summary, summary_json};
pub use table::Table;
pub use terminal::summary_text;

#[cfg(test)]
mod tests;
