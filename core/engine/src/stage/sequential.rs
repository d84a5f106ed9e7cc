//! Runs of a sequential design after its first batch, and the region in which the emulator is fitted to them.

use lacuna::data::Ensemble;
use lacuna::math::moments;
use lacuna::plugin::design::{Batch, Next};
use lacuna::run::{Observer, Stop};
use lacuna_linalg::Matrix;
use lacuna_run::{Kept, RunDirectory, Stage};

use super::emulator_error::noise;
use super::more_runs::{Intervals, More, bounds, is_inside};
use super::read::{Data, Measured};
use super::stream;
use super::surrogate::is_wanted;
use crate::study::Study;
use crate::study::file::Region;

/// Half of the width of the region in standard deviations of the last batch, before it is widened.
const REACH: f64 = 4.0;
/// Number of runs inside the region for each parameter, if there are as many.
const RUNS: usize = 10;
/// Smallest variance of the noise as a fraction of the mean square residual of a batch, so that data without noise do
/// not stop the ensemble.
const LEAST: f64 = 1e-8;

/// Makes the further batches of a sequential design, and returns the data with the region of the fit; without such a
/// design the data as they are.
pub fn stage(
    study: &Study,
    mut data: Kept<Data>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<(Kept<Data>, Option<Intervals>), Stop> {
    let sequential = study.design.as_ref().filter(|section| section.built.plugin.is_sequential());
    let Some(section) = sequential else { return Ok((data, None)) };
    let stream = stream(study, "design");
    let mut placed = section.common.runs.get();
    let mut batches: Vec<Batch> = Vec::new();
    let mut first = 0;
    loop {
        batches.push(batch(study, &data.value, first, placed)?);
        match section.built.plugin.next(&batches, &stream)? {
            Next::Complete(why) => {
                observer.remark(&format!("sequential design: {why}"));
                break;
            }
            Next::Place(scores) => {
                let points = Matrix::from_fn(scores.rows(), scores.columns(), |i, j| {
                    study.parameters[j].design.at_score(scores[(i, j)])
                });
                let number = batches.len() + 1;
                let prefix = format!("batch{number}");
                let more = More {
                    folder: Stage::Simulate.part(&format!("batch-{number}")),
                    prefix: &prefix,
                    points: &points,
                    may_fail: true,
                };
                (first, placed) = (data.value.runs()?.runs.len(), points.rows());
                data = more.added(study, data, run, observer)?;
            }
        }
    }
    let refine = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref());
    let whole = refine.is_some_and(|refine| refine.region == Region::Design);
    let place = if whole { None } else { Some(around(study, data.value.runs()?, &batches)) };
    Ok((data, place))
}

/// The runs from `first` on as a batch.
fn batch(study: &Study, data: &Data, first: usize, placed: usize) -> Result<Batch, Stop> {
    let measured = data.measured.as_ref();
    let measured = measured.ok_or_else(|| Stop::new("the study has no measurements"))?;
    let ensemble = data.runs()?;
    let rows: Vec<usize> =
        (first..ensemble.runs.len()).filter(|&i| is_wanted(study, ensemble, i)).collect();
    let scores = Matrix::from_fn(rows.len(), study.parameters.len(), |i, j| {
        study.parameters[j].design.score(ensemble.points[(rows[i], j)])
    });
    let residuals = if rows.is_empty() {
        Matrix::default()
    } else {
        residuals(study, measured, &ensemble.responses.select_rows(&rows))?
    };
    Ok(Batch { placed, scores, residuals })
}

/// Differences between responses and the mean of the replicates, in standard deviations of its noise.
fn residuals(study: &Study, measured: &Measured, responses: &Matrix) -> Result<Matrix, Stop> {
    let data = &measured.likelihood;
    let summaries = data.summaries();
    let outputs: Vec<usize> = (0..summaries.len()).filter(|&i| summaries[i].count > 0).collect();
    let difference = |row: &[f64], i: usize| row[i] - summaries[i].mean;
    let size = |row: &[f64]| -> f64 {
        // The likelihood of independent normal data of unknown variance in each layout.
        let parts = study.layouts.parts().map(|(_, range)| {
            let own: Vec<f64> = range
                .filter(|&i| summaries[i].count > 0)
                .map(|i| difference(row, i).powi(2))
                .collect();
            if own.is_empty() { 0.0 } else { own.len() as f64 * moments::mean(&own).ln() }
        });
        parts.sum()
    };
    let sizes: Vec<f64> = responses.iter_rows().map(size).collect();
    let best = (0..sizes.len()).reduce(|a, b| if sizes[b] < sizes[a] { b } else { a });
    let best = responses.row(best.unwrap_or(0));
    let unknown = Matrix::zeros(0, summaries.len());
    let noise = noise::of_mean_at(study, data, best, &unknown)?;
    let squares: Vec<f64> = responses
        .iter_rows()
        .flat_map(|row| outputs.iter().map(|&i| difference(row, i).powi(2)).collect::<Vec<_>>())
        .collect();
    let least = (LEAST * moments::mean(&squares)).max(f64::MIN_POSITIVE);
    Ok(Matrix::from_fn(responses.rows(), outputs.len(), |r, k| {
        let i = outputs[k];
        difference(responses.row(r), i) / noise[i].max(least).sqrt()
    }))
}

/// Region around the last batch: wide enough for the posterior, and for enough runs to fit an emulator to.
fn around(study: &Study, ensemble: &Ensemble, batches: &[Batch]) -> Intervals {
    let runs = (0..ensemble.runs.len()).filter(|&i| is_wanted(study, ensemble, i));
    let points: Vec<&[f64]> = runs.map(|i| ensemble.points.row(i)).collect();
    let last = batches.last().map(|batch| &batch.scores);
    let columns = |j: usize| last.map_or_else(Vec::new, |scores| scores.column(j));
    let law = |j: usize| {
        let column = columns(j);
        (moments::mean(&column), moments::variance(&column).sqrt())
    };
    let laws: Vec<(f64, f64)> = (0..study.parameters.len()).map(law).collect();
    let place = |reach: f64| -> Intervals {
        let interval = |(p, &(mean, sd)): (&lacuna::data::Parameter, &(f64, f64))| {
            let ends = [mean - reach * sd, mean + reach * sd].map(|z| p.design.at_score(z));
            let (lowest, highest) = bounds(p);
            (ends[0].clamp(lowest, highest), ends[1].clamp(lowest, highest))
        };
        study.parameters.iter().zip(&laws).map(interval).collect()
    };
    let wanted = (RUNS * study.parameters.len()).max(batches.last().map_or(0, |b| b.placed));
    let mut reach = REACH;
    loop {
        let region = place(reach);
        let inside = points.iter().filter(|point| is_inside(&region, point)).count();
        // Beyond this reach the region is the whole design, if any batch has a width.
        if inside >= wanted.min(points.len()) || reach > 1e4 {
            return region;
        }
        reach *= 1.2;
    }
}
