//! Complaints.
/// A view handed to plugins.
pub struct Complaints<'a>(pub &'a ());
