//! The engine of Lacuna: studies, data, stages, posterior, report. It names no plugin.

pub mod data;
pub mod plugin;
pub mod study;
