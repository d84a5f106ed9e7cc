//! Pieces that may be missing inside the model, as candidates of a search: inputs set free, and terms added to equations.
//!
//! All of them are inputs of one wider model. Where the model is its own forward map it is asked with the pieces that are
//! present; where a surrogate stands for it, further runs teach what the inputs change.

mod emulated;
mod narrow;
mod pieces;
mod swap;
mod terms;
mod unasked;

pub use pieces::{Piece, Pieces};
pub use swap::{Odds, Rival, Side, rivals, swapped};

use narrow::Narrow;

use crate::gap::candidates::Candidate;
use crate::gap::wide::Wide;
use crate::run::{Observer, RunDirectory, Stop};
use crate::study::Study;

use super::Known;

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
        let forward = Box::new(Narrow::new(study, pieces, pieces.narrower())?);
        Wide { forward, inputs: pieces.inputs.clone(), common: Vec::new() }
    };
    Ok((pieces.candidates(), wide))
}
