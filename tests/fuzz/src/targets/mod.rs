//! One function for each kind of input that others write: whatever the bytes are, it must return.
//!
//! Besides the absence of panics each asks for what is cheap to ask: an error says something, what was read has the shape
//! that its users rely on, and what is written reads back as it was.

mod csv;
mod exodus;
mod expression;
mod heartbeat;
mod plugin_table;
mod records;
mod run_directory;
mod shared;
mod study;
mod um_bridge;
mod unit;

/// A target: its name, which is also that of its corpus, and its body.
pub type Target = (&'static str, fn(&[u8]));

/// Every target.
pub const TARGETS: [Target; 10] = [
    ("csv", csv::csv),
    ("exodus", exodus::exodus),
    ("expression", expression::expression),
    ("heartbeat", heartbeat::heartbeat),
    ("plugin_table", plugin_table::plugin_table),
    ("records", records::records),
    ("run_directory", run_directory::run_directory),
    ("study", study::study),
    ("um_bridge", um_bridge::um_bridge),
    ("unit", unit::unit),
];

/// Runs one target.
pub fn run(name: &str, bytes: &[u8]) {
    let (_, body) = TARGETS.iter().find(|(other, _)| *other == name).expect("a target's name");
    body(bytes);
}
