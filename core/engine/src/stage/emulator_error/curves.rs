//! Errors of the emulator at runs on which it was not trained.

use std::borrow::Cow;

use lacuna::plugin::Emulator;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::study::Study;

/// Number of training runs above which the leave-one-out formula replaces refitting: its bias decreases with the number
/// of runs, while the cost of refitting increases.
const REFITTED: usize = 200;

/// Number of parts of the cross-validation.
const PARTS: usize = 10;

/// Number of runs inside the prior from which on the emulator's error is estimated from them alone.
const ENOUGH: usize = 50;

/// Error curves, one per row.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Parameters of the runs in physical units, `runs x parameters`.
    pub points: Matrix,
    /// Model minus emulator, `runs x outputs`, in the response's unit.
    pub errors: Matrix,
    /// Variance that the emulator stated there, `runs x outputs`; `None` if it states none.
    pub stated: Option<Matrix>,
}

/// Runs with their responses.
#[derive(Debug, Clone, Copy)]
pub struct Runs<'a> {
    /// Parameters, `runs x parameters`.
    pub points: &'a Matrix,
    /// Responses, `runs x outputs`.
    pub responses: &'a Matrix,
}

/// Number of values (runs times outputs) above which a table is [large](Runs::are_large): 80 MB.
const LARGE: usize = 10_000_000;

impl Runs<'_> {
    /// Returns true if copies of the responses, or of errors of as many values, are not made where it can be avoided.
    pub fn are_large(&self) -> bool {
        self.responses.rows() * self.responses.columns() > LARGE
    }
}

impl Curves {
    /// Errors of emulators at training runs that were left out of the fit, by ten-fold cross-validation: principal
    /// components, terms and length scales are then chosen without the run, unlike in leave-one-out formulas. `fit`
    /// fits to some of the runs (first argument) and is given the rows of the left-out ones. `None` for fewer than
    /// three or many runs.
    ///
    /// # Errors
    ///
    /// The error of `fit`, if the remaining runs are too few for it; or errors that are not finite.
    pub fn refitted(
        runs: Runs<'_>,
        mut fit: impl FnMut(&[usize], &[usize]) -> Result<Box<dyn Emulator>, Stop>,
    ) -> Result<Option<Self>, Stop> {
        let count = runs.points.rows();
        if !Self::are_refitted(count) {
            return Ok(None);
        }
        let mut errors = Matrix::zeros(count, runs.responses.columns());
        // Of an emulator that states no variance there is nothing to keep.
        let mut stated = Vec::new();
        for part in 0..PARTS.min(count) {
            let (left, kept): (Vec<usize>, Vec<usize>) =
                (0..count).partition(|i| i % PARTS.min(count) == part);
            let emulator = fit(&kept, &left)?;
            let points = runs.points.select_rows(&left);
            let mean = emulator.mean(&points);
            let variance = emulator.variance(&points);
            for (k, &i) in left.iter().enumerate() {
                let row = runs.responses.row(i).iter().zip(mean.row(k));
                errors.row_mut(i).iter_mut().zip(row).for_each(|(e, (y, m))| *e = y - m);
            }
            stated.push(variance.map(|variance| (left, variance)));
        }
        if errors.as_slice().iter().any(|e| !e.is_finite()) {
            return Err(Stop::new(
                "an emulator gives no finite response at a run that was left out",
            ));
        }
        let stated: Option<Vec<_>> = stated.into_iter().collect();
        let stated = stated.map(|parts| gathered(&parts, &errors));
        Ok(Some(Self { points: runs.points.clone(), errors, stated }))
    }

    /// Returns true if emulators are refitted for this number of training runs.
    pub fn are_refitted(runs: usize) -> bool {
        (3..=REFITTED).contains(&runs)
    }

    /// Appends other curves.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        other.points.iter_rows().for_each(|row| self.points.push_row(row));
        other.errors.iter_rows().for_each(|row| self.errors.push_row(row));
        self.stated = match (self.stated, other.stated) {
            (Some(mut all), Some(more)) => {
                more.iter_rows().for_each(|row| all.push_row(row));
                Some(all)
            }
            (all, None) if other.points.rows() == 0 => all,
            _ => None,
        };
        self
    }

    /// The curves of some runs.
    pub fn select(&self, rows: &[usize]) -> Self {
        Self {
            points: self.points.select_rows(rows),
            errors: self.errors.select_rows(rows),
            stated: self.stated.as_ref().map(|stated| stated.select_rows(rows)),
        }
    }

    /// The curves at runs inside the prior's support, or all if these are fewer than fifty.
    pub fn near_prior(&self, study: &Study) -> Cow<'_, Self> {
        let rows = rows_near_prior(study, &self.points);
        let all = rows.len() == self.points.rows();
        if all { Cow::Borrowed(self) } else { Cow::Owned(self.select(&rows)) }
    }
}

/// A matrix as large as another, from groups of its rows with their indices.
fn gathered(parts: &[(Vec<usize>, Matrix)], like: &Matrix) -> Matrix {
    let mut all = Matrix::zeros(like.rows(), like.columns());
    for (rows, part) in parts {
        rows.iter().zip(part.iter_rows()).for_each(|(&i, row)| all.row_mut(i).copy_from_slice(row));
    }
    all
}

/// Rows of the points inside the prior's support, or all rows if these are fewer than fifty.
pub fn rows_near_prior(study: &Study, points: &Matrix) -> Vec<usize> {
    let inside = |point: &[f64]| study.prior().allows(point);
    let near: Vec<usize> = (0..points.rows()).filter(|&i| inside(points.row(i))).collect();
    if near.len() >= ENOUGH { near } else { (0..points.rows()).collect() }
}
