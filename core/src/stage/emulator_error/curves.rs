//! Errors of the emulator at runs that it had not seen.

use crate::linalg::Matrix;
use crate::plugin::Emulator;
use crate::run::Stop;
use crate::study::Study;

/// Beyond this number of training runs the leave-one-out formula stands for fitting again: what it hides becomes small with
/// the number of runs, and what fitting costs becomes large.
const REFITTED: usize = 200;

/// In so many parts the runs are left out.
const PARTS: usize = 10;

/// How many runs inside the prior are enough to learn the emulator's error from them alone.
const ENOUGH: usize = 50;

/// Error curves, one a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// The parameters of the runs in physical units, `runs x parameters`.
    pub points: Matrix,
    /// Model minus emulator, `runs x outputs`, in the response's unit.
    pub errors: Matrix,
    /// The variance that the emulator stated there, `runs x outputs`; `None` when it states none.
    pub stated: Option<Matrix>,
}

/// Runs with their responses.
#[derive(Debug, Clone, Copy)]
pub struct Runs<'a> {
    /// The parameters, `runs x parameters`.
    pub points: &'a Matrix,
    /// The responses, `runs x outputs`.
    pub responses: &'a Matrix,
}

impl Curves {
    /// The errors that emulators make at training runs which they were fitted without, ten parts of the runs in turn: principal
    /// components, terms and length scales are then chosen without the run, which the leave-one-out
    /// formulas do not do. `fit` fits to some of the runs and is told the rows of those that are left out. `None` for many
    /// runs.
    ///
    /// # Errors
    ///
    /// What `fit` says where so few runs are not enough for it; errors that are not finite.
    pub fn refitted(
        runs: Runs<'_>,
        mut fit: impl FnMut(&[usize], &[usize]) -> Result<Box<dyn Emulator>, Stop>,
    ) -> Result<Option<Self>, Stop> {
        let count = runs.points.rows();
        if !(3..=REFITTED).contains(&count) {
            return Ok(None);
        }
        let mut errors = Matrix::zeros(count, runs.responses.columns());
        let mut stated: Option<Matrix> = Some(errors.clone());
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
            stated = stated.zip(variance).map(|(mut all, variance)| {
                left.iter()
                    .enumerate()
                    .for_each(|(k, &i)| all.row_mut(i).copy_from_slice(variance.row(k)));
                all
            });
        }
        if errors.as_slice().iter().any(|e| !e.is_finite()) {
            return Err(Stop::new(
                "an emulator gives no finite response at a run that was left out",
            ));
        }
        Ok(Some(Self { points: runs.points.clone(), errors, stated }))
    }

    /// These and others.
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

    /// Those of some runs.
    pub fn select(&self, rows: &[usize]) -> Self {
        Self {
            points: self.points.select_rows(rows),
            errors: self.errors.select_rows(rows),
            stated: self.stated.as_ref().map(|stated| stated.select_rows(rows)),
        }
    }

    /// Those at runs inside the prior's support, or all when these are fewer than fifty.
    pub fn near_prior(&self, study: &Study) -> Self {
        let rows = rows_near_prior(study, &self.points);
        if rows.len() == self.points.rows() { self.clone() } else { self.select(&rows) }
    }
}

/// The points inside the prior's support, or all when these are fewer than fifty.
pub fn rows_near_prior(study: &Study, points: &Matrix) -> Vec<usize> {
    let inside = |point: &[f64]| {
        let prior = study.parameters.iter().zip(point);
        prior.into_iter().all(|(p, &x)| p.prior.log_density(x).is_finite())
    };
    let near: Vec<usize> = (0..points.rows()).filter(|&i| inside(points.row(i))).collect();
    if near.len() >= ENOUGH { near } else { (0..points.rows()).collect() }
}
