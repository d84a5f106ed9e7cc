//! Forms along a run: their units, their values and the responses to them.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::Addition;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Summand};
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::finder::{Finder, Run};
use super::forms::{Entry, Seen, entries};
use super::model::Widened;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::{Piece, Pieces, coefficient_unit, free};
use crate::gap::system::whitener::Whitener;

/// The largest number of values of all responses to forms, which bounds the memory.
const NUMBERS: usize = 24_000_000;

/// The largest number of responses to forms that are computed at once.
const TOGETHER: usize = 24;

impl Finder<'_, '_, '_> {
    /// All forms along a run, as many as the memory allows: with fewer arguments if there are too many.
    pub(super) fn dictionary(&self, model: &Widened<'_>, run: &Run) -> Option<Vec<Entry>> {
        let affordable = NUMBERS / self.setting.experiment.outputs().max(1);
        let most = self.sites.iter().map(|site| site.arguments.len()).max()?;
        for arguments in (1..=most).rev() {
            let mut all = Vec::new();
            for (index, site) in self.sites.iter().enumerate() {
                let own = &site.arguments[..arguments.min(site.arguments.len())];
                let texts: Vec<String> = own.iter().map(|a| a.text.clone()).collect();
                let values = along(model, run, &texts)?;
                let seen = own.iter().zip(values);
                let seen: Vec<Seen<'_>> =
                    seen.map(|(argument, values)| Seen { argument, values }).collect();
                all.extend(entries(index, site, &seen));
            }
            all.retain(|entry| self.unit(entry, &entry.shape(), &[]).is_ok());
            if all.len() <= affordable || arguments == 1 {
                return Some(all);
            }
        }
        None
    }

    /// The unit of the coefficient of a form.
    pub(super) fn unit(
        &self,
        entry: &Entry,
        shape: &str,
        indices: &[Index],
    ) -> Result<Unit, String> {
        let (shape, indices) = (shape.to_owned(), indices.to_vec());
        let summand = Summand { shape, indices, ..Summand::default() };
        let state = &self.sites[entry.site].state;
        coefficient_unit(self.amend, &self.context, state, &summand)
    }

    /// The whitened responses to forms along a run, `forms x outputs`; zero for one that has none.
    pub(super) fn responses(&self, run: &Run, all: &[Entry], whitener: &Whitener) -> Matrix {
        let of = |part: &[Entry]| {
            let made = self.responses_together(run, part);
            let made = made.unwrap_or_else(|| {
                // One form without a response spoils that of the others.
                let mut each = Matrix::zeros(0, self.means.len());
                for entry in part {
                    let own = self.responses_together(run, std::slice::from_ref(entry));
                    each.push_row(own.as_ref().map_or(&vec![0.0; self.means.len()], |o| o.row(0)));
                }
                each
            });
            whitener.whiten_rows(&made)
        };
        let parts: Vec<Matrix> = all.par_chunks(TOGETHER).map(of).collect();
        let mut rows = Matrix::zeros(0, self.means.len());
        parts.iter().flat_map(Matrix::iter_rows).for_each(|row| rows.push_row(row));
        rows
    }

    fn responses_together(&self, run: &Run, part: &[Entry]) -> Option<Matrix> {
        let study = self.setting.study;
        let begin = run.inputs.first()?.len();
        let mut pieces = run.pieces.clone();
        for (k, entry) in part.iter().enumerate() {
            pieces.push(self.form_piece(entry, &format!("latent_form_{k}"))?);
        }
        let pieces = Pieces::alone(study, pieces).ok()??;
        let model = Widened::new(study, &pieces)?;
        let longer = run
            .inputs
            .iter()
            .map(|own| [&own[..], &vec![0.0; part.len()]].concat())
            .collect::<Vec<_>>();
        let answer =
            model.answer(&run.parameters, &longer, &model.measured(self.setting.experiment))?;
        let rows: Vec<usize> = (begin..begin + part.len()).collect();
        Some(answer.by_inputs.select_rows(&rows))
    }

    /// A form as a piece of the model, with its coefficient as input.
    fn form_piece(&self, entry: &Entry, name: &str) -> Option<(Piece, Vec<FreeInput>)> {
        let name = free(name.to_owned(), &self.taken);
        let shape = entry.shape();
        let unit = self.unit(entry, &shape, &[]).ok()?;
        let words = || String::new();
        let state = self.sites[entry.site].state.name.clone();
        let input = FreeInput::new(&name, unit, 0.0, Distribution::Normal([0.0, 1.0]));
        let piece = Piece {
            kind: name.clone(),
            description: Description { title: words(), formula: words(), source: words() },
            places: vec![0],
            addition: Some(Addition {
                summands: vec![(state, format!("{name} * ({shape})"))],
                states: Vec::new(),
            }),
            at: None,
            tried: 1,
        };
        Some((piece, vec![input]))
    }
}

/// The values of expressions along a run, over all conditions.
pub(super) fn along(model: &Widened<'_>, run: &Run, texts: &[String]) -> Option<Vec<Vec<f64>>> {
    let mut all = vec![Vec::new(); texts.len()];
    for c in 0..model.conditions() {
        let own = model.along(c, &run.parameters, &run.inputs, texts)?;
        all.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
    }
    Some(all)
}
