//! The search: candidates are fitted together with the calibrated unknowns, compared by their evidences, and added one
//! at a time.

mod checks;
mod cross_validate;
mod diagnostics;
mod discriminate;
mod evidence;
mod explained;
mod finish;
mod fold_score;
mod folds;
mod forward;
mod moves;
pub mod needless;
mod pairs;
mod placement_prior;
mod places;
mod refit;
mod simpler;
mod slots;
mod special_case;
mod state;
mod subsets;
mod support;
#[cfg(test)]
mod tests;
mod verdict;
mod visited;

pub use checks::{consistency, stability};
pub use cross_validate::{CrossValidation, Explanation, LeftOut, PROVEN, cross_validate};
pub use diagnostics::{Detectability, Diagnostics, SearchOptions, SearchResult, SearchStep};
pub use discriminate::{DiscriminatingData, Discrimination, FurtherData, discriminate};
pub use evidence::{LogEvidence, log_evidence};
pub use explained::Explained;
pub use forward::{search, search_observed};
pub use placement_prior::{log_prior, placement_prior};
pub use refit::{RefitSetting, Scored, Weighed, most_promising, refit_all};
pub use state::kinds;
pub use support::{Support, decides};
pub use verdict::{
    Bin, Brier, CEILING, MissingEffect, Reliability, SURE, Told, Traits, Verdict, VerdictKind,
    class, explains, verdict,
};
pub use visited::{Inclusion, ModelAverage, VisitedModel};
