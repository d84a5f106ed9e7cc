//! What is missing: candidates refitted together with the calibrated unknowns, weighed, and added one by one.

mod consistency;
mod evidence;
mod folds;
mod foretell;
mod groups;
mod leaders;
mod look;
mod placement;
mod search;
mod separate;
mod shares;
mod stability;
mod state;
#[cfg(test)]
mod tests;
mod verdict;

pub use consistency::consistency;
pub use evidence::{Weighed, weigh};
pub use foretell::{Foretelling, LeftOut, Rival, foretell};
pub use leaders::{Desk, Judged, Lead, judge, leads, one};
pub use look::{Found, Look, Options, Step, Visible};
pub use placement::log_prior;
pub use search::search;
pub use separate::{Separation, Separations, What, separate};
pub use stability::stability;
pub use state::kinds;
pub use verdict::{Named, SURE, Verdict, Word, class, explains, verdict};
