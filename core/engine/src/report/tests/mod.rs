//! Tests of the report with made-up results of the shape of the mercury target study.
#![allow(clippy::unwrap_used)]

mod drawn;
mod fixture;
mod page;
mod runs;
mod summary;
mod xml;
