//! Pieces that may be missing inside the model, as candidates of a search: inputs set free, and terms added to equations.
//!
//! All of them are inputs of one wider model. Where the model is its own forward map the wide forward map is the
//! wider model; where a surrogate stands for it, further runs teach what the inputs change.

mod emulated;
mod pieces;
mod swap;
mod terms;

pub use pieces::{Piece, Pieces};
pub use swap::{Rival, rivals};

use crate::gap::candidates::Candidate;
use crate::gap::wide::Wide;
use crate::run::{Observer, RunDirectory, Stop};
use crate::study::Study;

use super::Known;
use super::direct::Direct;

/// The candidates among the pieces, and the forward map in which they are inputs.
pub fn candidates<'a>(
    pieces: &'a Pieces,
    study: &'a Study,
    known: &Known<'a>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Vec<Candidate>, Wide<'a>), Stop> {
    let wide = if known.emulator.is_some() {
        emulated::wide(pieces, study, known, run, observer)?
    } else {
        let inputs = pieces.inputs.clone();
        let priors = study.parameters.iter().map(|p| p.prior.clone());
        let priors = priors.chain(inputs.iter().map(|freed| freed.prior.clone())).collect();
        let direct = Direct::with(pieces.simulator(study)?, priors, study.layouts.len());
        Wide { forward: Box::new(direct), inputs, common: Vec::new() }
    };
    Ok((pieces.candidates(), wide))
}
