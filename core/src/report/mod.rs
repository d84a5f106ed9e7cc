//! The report: a self-contained page of figures and tables, from plain results.

pub mod findings;
