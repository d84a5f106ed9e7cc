//! Fit of the emulator to the training runs, with its errors.

use std::borrow::Cow;

use lacuna::data::Parameter;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Fact};
use lacuna::run::{Observer, Progress, Stop, Tasks};
use lacuna_linalg::Matrix;

use super::figures::{by_group, corrected, difference, inflation, mean, pairs, stacked};
use super::serialised::Serialised;
use super::{Errors, Fitted, Fitting, Purpose, plugin};
use crate::screening::{ActiveSubspace, active_subspace};
use crate::stage::emulator_error::{self, Curves};
use crate::stage::gradients::Gradients;
use crate::stage::idle::Used;
use crate::stage::read::Data;
use crate::stage::{low_fidelity, stream};
use crate::study::Study;

/// Largest number of training runs whose error curves are kept, evenly spaced: their covariance is then known to one
/// percent.
const MOST_CURVES: usize = 5000;

/// Number of values of error curves up to which as many are kept (256 MiB), and the number of curves that is kept however
/// many outputs there are.
const MOST_VALUES: usize = 1 << 25;
const FEWEST_CURVES: usize = 50;

/// Number of error curves that are kept.
fn most_curves(outputs: usize) -> usize {
    (MOST_VALUES / outputs.max(1)).clamp(FEWEST_CURVES, MOST_CURVES)
}

/// Runs and settings to which an emulator of the study is fitted.
pub struct Fit<'a> {
    /// The study.
    pub study: &'a Study,
    /// Runs of the study.
    pub data: &'a Data,
    /// The input of the fit.
    pub fitting: &'a Fitting<'a>,
    /// Parameters on which the surrogate is trained.
    pub used: &'a Used,
    /// Derivatives at the training runs, if the surrogate is fitted to them too.
    pub gradients: Option<&'a Gradients>,
}

impl Fit<'_> {
    /// Fits the emulator to all training runs, and estimates its errors.
    pub fn all(&self, tasks: Tasks<'_>, observer: &dyn Observer) -> Result<Fitted, Stop> {
        let Self { study, data, fitting, .. } = *self;
        let ensemble = data.runs()?;
        let points = ensemble.points.select_rows(&fitting.training);
        let responses = rows_of(&ensemble.responses, &fitting.training);
        let emulator = self.main(tasks, observer)?;
        let test_points = ensemble.points.select_rows(&fitting.validation);
        let simulated = ensemble.responses.select_rows(&fitting.validation);
        let emulated = emulator.mean(&test_points);
        let held_out = difference(&simulated, &emulated);
        let shown = emulator_error::thinned(points.rows(), most_curves(responses.columns()));
        let runs = emulator_error::Runs { points: &points, responses: &responses };
        let mut facts = emulator.facts();
        let refitted = self.refitted(runs, &shown).unwrap_or_else(|stop| {
            let why = format!(
                "by the leave-one-out formula, since a fit to nine tenths of the runs failed: {stop}"
            );
            facts.push(Fact::new("errors at runs left out", why));
            None
        });
        let shown_points = points.select_rows(&shown);
        let sample_points = stacked(shown_points.clone(), &test_points);
        let left_out = || corrected(&*emulator, &responses, &shown);
        let (own_samples, curves) = match refitted {
            // Of large tables the errors of the refits stand for those of the formula too.
            Some(curves) if runs.are_large() => (None, curves),
            Some(curves) => (Some(left_out()), curves),
            None => (None, Curves { points: shown_points, errors: left_out(), stated: None }),
        };
        let judged = if held_out.rows() > 0 {
            &held_out
        } else {
            own_samples.as_ref().unwrap_or(&curves.errors)
        };
        let loo_by_output = emulator.relative_error().to_vec();
        let errors = Errors {
            training: fitting.training.len(),
            validation: fitting.validation.len(),
            mae: mean(judged.as_slice().iter().map(|e| e.abs())),
            rmse: mean(judged.as_slice().iter().map(|e| e * e)).sqrt(),
            loo: mean(loo_by_output.iter().copied()),
            by_group: by_group(study, judged, &loo_by_output),
            loo_by_output,
            pairs: pairs(&simulated, &emulated),
            inflation: inflation(&*emulator, &test_points, &held_out),
            facts,
        };
        let own_samples = own_samples.map(|samples| stacked(samples, &held_out));
        let stated = emulator.variance(&test_points);
        let validated = Curves { points: test_points, errors: held_out, stated };
        let curves = curves.with(validated);
        let active = self.active(&responses);
        let bytes = Serialised::Held(emulator.save()?);
        Ok(Fitted { bytes, errors, own_samples, sample_points, curves, active })
    }

    /// Fits the emulator to all training runs.
    pub fn main(
        &self,
        tasks: Tasks<'_>,
        observer: &dyn Observer,
    ) -> Result<Box<dyn Emulator>, Stop> {
        let ensemble = self.data.runs()?;
        let points = ensemble.points.select_rows(&self.fitting.training);
        let responses = rows_of(&ensemble.responses, &self.fitting.training);
        let rows: Vec<usize> = (0..points.rows()).collect();
        self.emulator(&points, &responses, &rows, &[], (tasks, observer))
    }

    /// The active subspace of the training runs, if their derivatives are known.
    fn active(&self, responses: &Matrix) -> Option<ActiveSubspace> {
        let width = |parameter: &Parameter| {
            let (design, sd) = (&parameter.design, parameter.design.sd());
            // Laws without variance have a width all the same.
            let middle = || 0.5 * (design.quantile(0.841) - design.quantile(0.159));
            if sd.is_finite() { sd } else { middle() }
        };
        let widths: Vec<f64> = self.fitting.parameters.iter().map(width).collect();
        let stream = stream(self.study, "gradients").named("resampled");
        let blocks = self.study.layouts.ranges();
        active_subspace(&self.gradients?.slopes, &widths, responses, blocks, &stream)
    }

    /// Fits the emulator to some of these runs. Cheaper runs at the parameters of the left-out runs are left out too.
    pub fn emulator(
        &self,
        points: &Matrix,
        responses: &Matrix,
        kept: &[usize],
        left: &[usize],
        (tasks, observer): (Tasks<'_>, &dyn Observer),
    ) -> Result<Box<dyn Emulator>, Stop> {
        let Self { study, data, fitting, used, gradients } = *self;
        let gradients = gradients.map(|all| all.by(used.indices()).select_rows(kept));
        let runs = Training {
            parameters: &used.parameters(fitting.parameters),
            layouts: &study.layouts,
            points: &used.points(&points.select_rows(kept)),
            responses: &rows_of(responses, kept),
            gradients: gradients.as_ref(),
        };
        let progress = Progress::new(observer);
        if let Purpose::Gap(name) = fitting.purpose {
            let stream = stream(study, "gap-surrogate").named(name);
            return plugin(study)?.fit(&runs, &stream, &progress);
        }
        let cheap = data.cheaper.as_ref().map(|cheap| {
            let known =
                |point: &[f64]| left.iter().any(|&i| low_fidelity::is_same(points.row(i), point));
            let rows: Vec<usize> =
                (0..cheap.points.rows()).filter(|&i| !known(cheap.points.row(i))).collect();
            (used.points(&cheap.points.select_rows(&rows)), cheap.responses.select_rows(&rows))
        });
        let cheap = cheap.as_ref().map(|(points, responses)| (points, responses));
        let wide = used.parameters(&study.parameters);
        let emulator = low_fidelity::fit(study, &runs, cheap, &wide, &progress, tasks)?;
        Ok(used.clone().widen(emulator))
    }
}

/// Rows of a matrix; nothing is copied if these are all rows in their order.
fn rows_of<'a>(matrix: &'a Matrix, rows: &[usize]) -> Cow<'a, Matrix> {
    if rows.iter().copied().eq(0..matrix.rows()) {
        Cow::Borrowed(matrix)
    } else {
        Cow::Owned(matrix.select_rows(rows))
    }
}
