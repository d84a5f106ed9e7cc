//! The extended forward map of a model without a surrogate: each evaluation runs the model with the present inputs
//! only, so that its cost does not grow with the number of candidates.

use lacuna::plugin::Forward;
use lacuna::plugin::forward::Wanted;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::lazy_map::LazyMap;
use super::pieces::{ExtendedModel, Pieces};
use crate::gap::experiment::wider::FreeInput;
use crate::stage::direct::ModelMap;
use crate::study::Study;

/// The models with some of the pieces; `None` for one that cannot be made.
pub type RestrictedModels = LazyMap<Option<ExtendedModel>>;

/// The forward map.
pub struct RestrictedMap<'a> {
    study: &'a Study,
    pieces: &'a Pieces,
    narrower: &'a RestrictedModels,
    whole: ModelMap<'a>,
    parts: LazyMap<Option<ModelMap<'a>>>,
}

/// A model with the inputs that are free in it.
type Part<'n, 'a> = (&'n ModelMap<'a>, &'n [usize]);

impl<'a> RestrictedMap<'a> {
    /// The forward map of the study's parameters and then of all inputs of the pieces.
    pub fn new(
        study: &'a Study,
        pieces: &'a Pieces,
        narrower: &'a RestrictedModels,
    ) -> Result<Self, Stop> {
        let whole = direct(study, pieces, pieces.whole())?;
        Ok(Self { study, pieces, narrower, whole, parts: LazyMap::new() })
    }

    fn part(&self, present: &[usize]) -> Part<'_, 'a> {
        let whole = (&self.whole, &self.pieces.whole().inputs[..]);
        // If the model with a part of the pieces cannot be made, the model with all of them is used.
        let made = || self.pieces.wider(self.study, present).ok().flatten();
        let Some(wider) = self.narrower.get_or_make(present, made) else { return whole };
        let made = || direct(self.study, self.pieces, wider).ok();
        match self.parts.get_or_make(present, made) {
            Some(part) => (part, &wider.inputs),
            None => whole,
        }
    }

    /// The pieces that are present at a point, and those by whose columns derivatives are wanted.
    fn present(&self, point: &[f64], columns: &[usize]) -> Vec<usize> {
        let d = self.study.parameters.len();
        let is_there = |p: &usize| {
            let piece = &self.pieces.all[*p];
            let size = piece.places[0];
            point[d + size] != self.pieces.inputs[size].absent
                || piece.places.iter().any(|&i| columns.contains(&(d + i)))
        };
        (0..self.pieces.all.len()).filter(is_there).collect()
    }

    /// The point of the part, with its own inputs only.
    fn narrowed(&self, point: &[f64], inputs: &[usize]) -> Vec<f64> {
        let d = self.study.parameters.len();
        point[..d].iter().copied().chain(inputs.iter().map(|i| point[d + i])).collect()
    }

    /// The responses at points, each by the model with its own pieces.
    fn means(&self, points: &Matrix, mean: impl Fn(&ModelMap<'a>, &Matrix) -> Matrix) -> Matrix {
        let mut all = Matrix::zeros(points.rows(), self.outputs());
        let mut groups: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for (i, point) in points.iter_rows().enumerate() {
            let present = self.present(point, &[]);
            match groups.iter_mut().find(|(pieces, _)| *pieces == present) {
                Some((_, rows)) => rows.push(i),
                None => groups.push((present, vec![i])),
            }
        }
        for (present, rows) in groups {
            let (part, inputs) = self.part(&present);
            let own = rows.iter().map(|&i| self.narrowed(points.row(i), inputs));
            let means = mean(part, &Matrix::from_rows(part.dimension(), own));
            for (&i, mean) in rows.iter().zip(means.iter_rows()) {
                all.row_mut(i).copy_from_slice(mean);
            }
        }
        all
    }
}

fn direct<'a>(
    study: &'a Study,
    pieces: &'a Pieces,
    wider: &'a ExtendedModel,
) -> Result<ModelMap<'a>, Stop> {
    let free = wider.inputs.iter().map(|&i| &pieces.inputs[i]);
    let priors = study.parameters.iter().map(|p| p.prior.clone());
    let priors = priors.chain(free.map(|freed: &FreeInput| freed.prior.clone())).collect();
    Ok(ModelMap::with(pieces.simulator(study, wider)?, priors, study.layouts.len()))
}

impl Forward for RestrictedMap<'_> {
    fn dimension(&self) -> usize {
        self.study.parameters.len() + self.pieces.inputs.len()
    }

    fn outputs(&self) -> usize {
        self.whole.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.means(points, Forward::mean)
    }

    fn mean_at(&self, needed: &[bool], points: &Matrix) -> Matrix {
        self.means(points, |part, own| part.mean_at(needed, own))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.mean_and_jacobian(point).1
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        let all: Vec<usize> = (0..point.len()).collect();
        self.mean_and_jacobian_by(point, Wanted::by(&all))
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let d = self.study.parameters.len();
        let (part, inputs) = self.part(&self.present(point, wanted.parameters));
        let column = |&i: &usize| match i.checked_sub(d) {
            Some(input) => inputs.iter().position(|own| *own == input).map_or(0, |k| d + k),
            None => i,
        };
        let columns: Vec<usize> = wanted.parameters.iter().map(column).collect();
        let wanted = Wanted { parameters: &columns, ..wanted };
        part.mean_and_jacobian_by(&self.narrowed(point, inputs), wanted)
    }

    fn failure(&self) -> Option<String> {
        let parts = self.parts.values().flatten();
        std::iter::once(&self.whole).chain(parts).find_map(ModelMap::failure)
    }
}
