//! Candidates inside the model: inputs set free, terms added to equations, and other models.
//!
//! All inputs and terms are inputs of one extended model. If the model is its own forward map, it is evaluated with the
//! inputs that are present; if a surrogate replaces it, the surrogate is trained on further runs.

pub mod advice;
mod change;
pub mod companion;
mod emulated;
mod lazy_map;
mod narrow;
mod pieces;
pub mod runs;
mod swap;
mod terms;
mod unasked;

use companion::AdmittedCompanion;
use lacuna::run::{Observer, Stop};
use lacuna_run::RunDirectory;
use narrow::RestrictedMap;

use crate::gap::candidates::{Candidate, Untried};
use crate::gap::experiment::wider::ExtendedMap;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

pub use pieces::{Piece, Pieces};
pub use swap::{AlternativeModel, BayesFactor, ModelFits, alternatives, swapped};
pub(in crate::gap) use terms::coefficient_unit;
pub(in crate::gap) use unasked::{Sited, free, sites};

/// The candidates inside the model, with the forward map that has them as inputs; empty if the study names none.
#[derive(Default)]
pub struct InsideCandidates<'a> {
    /// The candidates but for those inside the companion.
    pub candidates: Vec<Candidate>,
    /// The forward map that has the inputs and terms of `[gap]` as inputs.
    pub wide: Option<ExtendedMap<'a>>,
    /// The companion with its constants, if the study has one.
    pub companion: Option<AdmittedCompanion>,
    /// The terms of the library that are not tried in the equations.
    pub untried: Vec<Untried>,
}

impl<'a> InsideCandidates<'a> {
    /// The candidates and the extended forward map of these inputs and terms.
    pub fn of(
        pieces: Option<&'a Pieces>,
        study: &'a Study,
        problem: &InverseProblem<'a>,
        run: &mut RunDirectory,
        observer: &dyn Observer,
    ) -> Result<Self, Stop> {
        let companion = companion::prepared(study, problem, run, observer)?;
        let mut candidates = runs::candidates(study, problem, run, observer)?;
        let Some(pieces) = pieces else {
            return Ok(Self { candidates, wide: None, companion, untried: Vec::new() });
        };
        let (own, wide) = self::candidates(pieces, study, problem, run, observer)?;
        candidates.extend(own);
        let untried = pieces.untried.clone();
        Ok(Self { candidates, wide: Some(wide), companion, untried })
    }
}

/// The candidates inside the model, and the extended forward map of which they are inputs. With a surrogate, further
/// runs are made.
pub fn candidates<'a>(
    pieces: &'a Pieces,
    study: &'a Study,
    problem: &InverseProblem<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Vec<Candidate>, ExtendedMap<'a>), Stop> {
    let wide = if problem.emulator().is_some() {
        emulated::wide(pieces, study, problem, run, observer)?
    } else {
        extended(study, pieces)?
    };
    Ok((pieces.candidates(), wide))
}

/// The extended forward map of a study without a surrogate.
pub(in crate::gap) fn extended<'a>(
    study: &'a Study,
    pieces: &'a Pieces,
) -> Result<ExtendedMap<'a>, Stop> {
    let forward = Box::new(RestrictedMap::new(study, pieces, pieces.narrower())?);
    Ok(ExtendedMap { forward, inputs: pieces.inputs.clone(), common: Vec::new() })
}
