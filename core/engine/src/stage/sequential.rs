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
    let mut sizes = vec![Size { placed: section.common.runs.get(), first: 0 }];
    let batches = loop {
        let batches = batches(study, &data.value, &sizes)?;
        let scores = match section.built.plugin.next(&batches, &stream)? {
            Next::Place(scores) => scores,
            Next::Complete(why) => {
                observer.remark(&format!("sequential design: {why}"));
                break batches;
            }
        };
        let points = Matrix::from_fn(scores.rows(), scores.columns(), |i, j| {
            study.parameters[j].design.at_score(scores[(i, j)])
        });
        let number = batches.len() + 1;
        let more = More {
            folder: Stage::Simulate.part(&format!("batch-{number}")),
            prefix: &format!("batch{number}"),
            points: &points,
            may_fail: true,
        };
        sizes.push(Size { placed: points.rows(), first: data.value.runs()?.runs.len() });
        data = more.added(study, data, run, observer)?;
    };
    let refine = study.surrogate.as_ref().and_then(|s| s.common.refine.as_ref());
    let whole = refine.is_some_and(|refine| refine.region == Region::Design);
    let place = if whole { None } else { Some(around(study, data.value.runs()?, &batches)) };
    Ok((data, place))
}

/// Runs of a batch.
struct Size {
    /// Number of runs that were placed.
    placed: usize,
    /// Index of the first one in the ensemble.
    first: usize,
}

/// All batches so far, compared with the data in units of the noise as it is known now: where it is not stated, the best
/// run limits it, and the parts of the likelihood that earlier batches took are counted again.
fn batches(study: &Study, data: &Data, sizes: &[Size]) -> Result<Vec<Batch>, Stop> {
    let measured = data.measured.as_ref();
    let measured = measured.ok_or_else(|| Stop::new("the study has no measurements"))?;
    let ensemble = data.runs()?;
    let ends = sizes[1..].iter().map(|size| size.first).chain([ensemble.runs.len()]);
    let wanted = |(size, end): (&Size, usize)| -> Vec<usize> {
        (size.first..end).filter(|&i| is_wanted(study, ensemble, i)).collect()
    };
    let rows: Vec<Vec<usize>> = sizes.iter().zip(ends).map(wanted).collect();
    let all: Vec<usize> = rows.concat();
    let scale = Scale::of(study, measured, &ensemble.responses.select_rows(&all))?;
    let batch = |(size, rows): (&Size, &Vec<usize>)| Batch {
        placed: size.placed,
        scores: Matrix::from_fn(rows.len(), study.parameters.len(), |i, j| {
            study.parameters[j].design.score(ensemble.points[(rows[i], j)])
        }),
        residuals: scale.residuals(&ensemble.responses.select_rows(rows)),
    };
    Ok(sizes.iter().zip(&rows).map(batch).collect())
}

/// Data that responses are compared with, in units of their noise.
struct Scale {
    /// Indices of the measured outputs.
    outputs: Vec<usize>,
    /// Mean of the replicates for each of them, and standard deviation of its noise.
    data: Vec<(f64, f64)>,
}

impl Scale {
    /// The noise of the mean of the replicates. In each layout it is at least the residual of the best run, so that data
    /// which the model cannot reproduce do not draw all runs to one point.
    fn of(study: &Study, measured: &Measured, responses: &Matrix) -> Result<Self, Stop> {
        let data = &measured.likelihood;
        let summaries = data.summaries();
        let outputs: Vec<usize> =
            (0..summaries.len()).filter(|&i| summaries[i].count > 0).collect();
        let difference = |row: &[f64], i: usize| row[i] - summaries[i].mean;
        // Mean square residual of each layout with its number of data.
        let squares = |row: &[f64]| -> Vec<(f64, f64)> {
            let part = |range: std::ops::Range<usize>| {
                let own = range.filter(|&i| summaries[i].count > 0);
                let own: Vec<f64> = own.map(|i| difference(row, i).powi(2)).collect();
                if own.is_empty() { (0.0, 0.0) } else { (moments::mean(&own), own.len() as f64) }
            };
            study.layouts.parts().map(|(_, range)| part(range)).collect()
        };
        // The likelihood of independent normal data of unknown variance in each layout.
        let size = |row: &[f64]| -> f64 {
            let parts = squares(row).into_iter().filter(|(_, count)| *count > 0.0);
            parts.map(|(square, count)| count * square.max(f64::MIN_POSITIVE).ln()).sum()
        };
        let sizes: Vec<f64> = responses.iter_rows().map(size).collect();
        let best = (0..sizes.len()).reduce(|a, b| if sizes[b] < sizes[a] { b } else { a });
        let best = best.ok_or_else(|| Stop::new("no run of the first batch has a response"))?;
        let best = responses.row(best);
        let noise = noise::of_mean_at(study, data, best, &Matrix::zeros(0, summaries.len()))?;
        let mut least = vec![0.0; summaries.len()];
        for ((_, range), (square, _)) in study.layouts.parts().zip(squares(best)) {
            range.for_each(|i| least[i] = square);
        }
        let one =
            |&i: &usize| (summaries[i].mean, noise[i].max(least[i]).max(f64::MIN_POSITIVE).sqrt());
        Ok(Self { data: outputs.iter().map(one).collect(), outputs })
    }

    /// Differences between responses and data in standard deviations of the noise, `runs x data`.
    fn residuals(&self, responses: &Matrix) -> Matrix {
        Matrix::from_fn(responses.rows(), self.outputs.len(), |r, k| {
            let (mean, sd) = self.data[k];
            (responses[(r, self.outputs[k])] - mean) / sd
        })
    }
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
    // An ensemble that is too small states too narrow a law: half of all runs are inside in any case.
    let wanted = (RUNS * study.parameters.len()).max(points.len().div_ceil(2));
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
