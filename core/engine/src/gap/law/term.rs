//! A term of a law as a piece of the model with its inputs.

use lacuna::plugin::amend::Addition;
use lacuna::plugin::effect::Description;

use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::Piece;
use crate::gap::result::law::{LawTerm, LawUnknown};

/// The number of standard deviations beside the value of an exponent or a threshold from which fits start as well.
const BESIDE: f64 = 2.0;

/// The terms as pieces of the study's model.
pub fn pieces(terms: &[LawTerm]) -> Vec<(Piece, Vec<FreeInput>)> {
    terms.iter().map(piece).collect()
}

fn piece(term: &LawTerm) -> (Piece, Vec<FreeInput>) {
    let LawTerm { name, state, shape, coefficient, index, .. } = term;
    let size = input(coefficient, 0.0).starting_from(vec![coefficient.value]);
    let index = index.iter().map(|index| {
        let shift = BESIDE * index.sd;
        let (low, high) = index.prior.support();
        let beside = [0.0, -shift, shift].map(|shift| index.value + shift);
        let inside = beside.into_iter().filter(|x| x.is_finite() && low < *x && *x < high);
        let mut starts: Vec<f64> = inside.collect();
        starts.dedup();
        input(index, index.value).starting_from(starts)
    });
    let inputs: Vec<FreeInput> = std::iter::once(size).chain(index).collect();
    let description = Description {
        title: term.title.clone(),
        formula: term.formula.clone(),
        source: "found in the data of the study".into(),
    };
    let summands = vec![(state.clone(), format!("{name} * ({shape})"))];
    let piece = Piece {
        kind: name.clone(),
        description,
        places: (0..inputs.len()).collect(),
        addition: Some(Addition { summands, states: Vec::new() }),
        at: None,
        tried: term.tried,
    };
    (piece, inputs)
}

fn input(unknown: &LawUnknown, absent: f64) -> FreeInput {
    FreeInput::new(&unknown.name, unknown.unit.clone(), absent, unknown.prior.clone())
}
