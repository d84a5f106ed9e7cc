//! Fit of Gaussian processes to runs.

use lacuna::math::random::Stream;
use lacuna::plugin::Context;
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::run::{Progress, Stop, Tasks};
use lacuna::text::problem::Complaints;
use lacuna_linalg::{Matrix, multiply};
use rayon::prelude::*;

use super::emulator::{Kriging, condition};
use super::field::{Choice, Field, Runs};
use super::kernel::Kernel;
use super::likelihood::Restricted;
use super::options::{Approximation, Bounds, LengthScales, Nugget};
use super::regressors::Regressors;
use super::search::{search, search_nearby};
use super::standard::{Standard, standardised};
use crate::surrogates::polynomial_chaos::check_numbers;
use crate::surrogates::principal_components::{Components, PrincipalComponents};

/// Settings common to all surrogates of Gaussian processes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Name of the plugin.
    pub plugin: &'static str,
    /// Correlation function.
    pub kernel: Kernel,
    /// Choice between separate and common hyperparameters of the components.
    pub length_scales: LengthScales,
    /// Noise of the runs.
    pub nugget: Nugget,
    /// Covariance of all runs, or of neighbours.
    pub approximation: Approximation,
    /// Reduction of the outputs to components.
    pub components: Components,
    /// Number of starts of the search.
    pub starts: usize,
    /// Bounds of the search.
    pub bounds: Bounds,
}

/// Candidate trends, from which each component takes the best.
#[derive(Debug, Clone, PartialEq)]
pub struct Trends {
    /// Regressors from which all trends are built.
    pub regressors: Regressors,
    /// For each component, one or more sets of regressors.
    pub candidates: Vec<Vec<Vec<usize>>>,
}

impl Trends {
    /// Gives all components the same trend, with all of these regressors.
    pub fn all(regressors: Regressors, components: usize) -> Self {
        let terms: Vec<usize> = (0..regressors.count()).collect();
        Self { regressors, candidates: vec![vec![terms]; components] }
    }
}

/// Standard deviation over the runs, as a fraction of the largest response, below which an output counts as constant.
const ROUND_OFF: f64 = 1e-13;

/// The progress of a search, counted in outputs.
#[derive(Clone, Copy)]
struct Counted<'a> {
    progress: &'a Progress<'a>,
    outputs: usize,
}

impl Settings {
    /// Reports invalid options, and designs for which no standard variable exists.
    pub fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for (key, message) in self.faults(context.runs) {
            complaints.at(key).say(message);
        }
        for message in context.parameters.iter().filter_map(|p| Standard::of(p).err()) {
            complaints.at("use").say(message);
        }
    }

    /// Returns what is wrong with the settings for this number of runs: the option, and a description.
    fn faults(&self, runs: Option<usize>) -> Vec<(&'static str, String)> {
        let mut faults = self.bounds.faults();
        faults.extend(self.components.fault().map(|words| ("components", words)));
        faults.extend(self.nugget.fault().map(|words| ("nugget", words)));
        faults.extend(self.approximation.fault(runs).map(|words| ("approximation", words)));
        if self.starts == 0 {
            faults.push(("starts", "the search needs at least one start".to_owned()));
        }
        faults
    }

    /// Fits the processes; `trends` builds the candidate trends from the standard variables and the scores.
    pub fn fit(
        &self,
        training: &Training<'_>,
        trends: impl FnOnce(&[Standard], &Matrix) -> Result<Trends, Stop>,
        stream: &Stream,
        progress: &Progress<'_>,
        tasks: Tasks<'_>,
    ) -> Result<Kriging, Stop> {
        check_numbers(training)?;
        if let Some((key, message)) = self.faults(Some(training.points.rows())).into_iter().next() {
            return Err(Stop::new(format!("`surrogate.{key}`: {message}")));
        }
        let standards = standards(training)?;
        let parts = self.components.of(training.responses)?;
        let (scores, sizes) = unit_scores(&parts.scores);
        let Trends { regressors, candidates } = trends(&standards, &scores)?;
        let points = standardised(&standards, training.points);
        let values = regressors.values(training.points);
        let runs = Runs { points: &points, regressors: &values, scores: &scores };
        let counted = Counted { progress, outputs: parts.mean.len() };
        let choices = self.choices(runs, &candidates, stream, counted, tasks)?;
        let fields =
            condition(self.kernel, choices, &standards, &regressors, training.points, &scores)
                .ok_or_else(impossible)?;
        let loadings = Matrix::from_fn(sizes.len() + 1, parts.mean.len(), |c, j| match c {
            0 => parts.mean[j],
            c => sizes[c - 1] * parts.directions[(j, c - 1)],
        });
        let fit_error = fit_error(training.responses, &fields, &loadings, &parts);
        Ok(Kriging {
            plugin: self.plugin,
            kernel: self.kernel,
            names: training.parameters.iter().map(|p| p.name.clone()).collect(),
            standards,
            regressors,
            fields,
            points: training.points.clone(),
            scores,
            loadings,
            truncation: parts.truncation.clone(),
            fit_error,
        })
    }

    /// Returns hyperparameters and trend of each field.
    fn choices(
        &self,
        runs: Runs<'_>,
        candidates: &[Vec<Vec<usize>>],
        stream: &Stream,
        Counted { progress, outputs }: Counted<'_>,
        tasks: Tasks<'_>,
    ) -> Result<Vec<Choice>, Stop> {
        let groups: Vec<Vec<usize>> = match self.length_scales {
            LengthScales::Each => (0..candidates.len()).map(|c| vec![c]).collect(),
            LengthScales::Shared if candidates.is_empty() => Vec::new(),
            LengthScales::Shared => vec![(0..candidates.len()).collect()],
        };
        if groups.is_empty() {
            progress.add(outputs as u64);
        }
        let count = groups.len();
        let choose = |g: usize| {
            let components = groups[g].clone();
            let trends = &candidates[components[0]];
            let choice = self.choose(runs, components, trends, &stream.at(g as u64));
            choice.ok_or_else(impossible)
        };
        let done =
            |g: usize| progress.add((outputs * (g + 1) / count - outputs * g / count) as u64);
        tasks.map(count, &choose, &done)
    }

    /// Chooses the best trend of a field, with its hyperparameters: that with the smallest leave-one-out error,
    /// corrected by `N / (N - p) (1 + p / N)` because the same runs choose the terms (Chapelle, Vapnik and Bengio
    /// 2002, for orthonormal regressors).
    fn choose(
        &self,
        runs: Runs<'_>,
        components: Vec<usize>,
        trends: &[Vec<usize>],
        stream: &Stream,
    ) -> Option<Choice> {
        let found = |terms: &Vec<usize>| {
            let choice = self.maximise(runs, components.clone(), terms.clone(), stream)?;
            if trends.len() == 1 {
                return Some((0.0, choice));
            }
            let field = Field::new(self.kernel, choice, runs)?;
            let (n, p) = (runs.scores.rows() as f64, terms.len() as f64);
            let squares: f64 = field.left_out().as_slice().iter().map(|e| e * e).sum();
            Some((squares * n / (n - p) * (1.0 + p / n), field.choice))
        };
        let found: Vec<(f64, Choice)> = trends.par_iter().filter_map(found).collect();
        let better = |a: (f64, Choice), b: (f64, Choice)| if b.0 < a.0 { b } else { a };
        found.into_iter().reduce(better).map(|(_, choice)| choice)
    }

    /// Maximises the likelihood of the hyperparameters for a given trend.
    fn maximise(
        &self,
        runs: Runs<'_>,
        components: Vec<usize>,
        terms: Vec<usize>,
        stream: &Stream,
    ) -> Option<Choice> {
        let trend = runs.regressors.select_columns(&terms);
        if trend.columns() + 1 >= trend.rows() {
            return None;
        }
        let problem = Restricted {
            kernel: self.kernel,
            points: runs.points,
            trend: &trend,
            scores: &runs.scores.select_columns(&components),
            bounds: self.bounds,
            nugget: self.nugget,
        };
        let neighbours = self.approximation.neighbours(runs.scores.rows());
        let found = match neighbours {
            None => search(&problem, self.starts, stream)?,
            Some(count) => search_nearby(&problem, count, self.starts, stream)?,
        };
        Some(Choice { neighbours, ..Choice::new(components, terms, found) })
    }
}

fn standards(training: &Training<'_>) -> Result<Vec<Standard>, Stop> {
    if training.parameters.is_empty() {
        return Err(Stop::new("a Gaussian process needs at least one parameter")
            .help("add a `[[parameter]]`"));
    }
    let parameters = training.parameters.iter().enumerate();
    let standard = |(k, parameter): (usize, &lacuna::data::Parameter)| {
        let standard = Standard::of(parameter).map_err(Stop::new)?;
        let column = training.points.column(k);
        match column.iter().position(|x| !standard.covers(*x)) {
            None => Ok(standard),
            Some(run) => Err(Stop::new(format!(
                "parameter `{}` of run {} is {}, but its design is {}",
                parameter.name,
                run + 1,
                column[run],
                parameter.design
            ))
            .help("leave the run out, or correct the parameter's `design`")),
        }
    };
    parameters.map(standard).collect()
}

/// Scales the scores to a root mean square of 1; returns also the divisors.
fn unit_scores(scores: &Matrix) -> (Matrix, Vec<f64>) {
    let size = |c| {
        let column = scores.column(c);
        (column.iter().map(|t| t * t).sum::<f64>() / column.len() as f64).sqrt()
    };
    let sizes: Vec<f64> = (0..scores.columns()).map(size).collect();
    (Matrix::from_fn(scores.rows(), sizes.len(), |i, c| scores[(i, c)] / sizes[c]), sizes)
}

/// Returns the leave-one-out error of each run's outputs: that of the scores plus the part that the components leave
/// out.
fn fit_error(
    responses: &Matrix,
    fields: &[Field],
    loadings: &Matrix,
    parts: &PrincipalComponents,
) -> FitError {
    let (runs, outputs) = (responses.rows(), responses.columns());
    let mut errors = Matrix::zeros(runs, loadings.rows());
    for field in fields {
        for (i, row) in field.left_out().iter_rows().enumerate() {
            for (&c, e) in field.choice.components.iter().zip(row) {
                errors[(i, c + 1)] = *e;
            }
        }
    }
    let mut residuals = multiply(&errors, loadings);
    if let Some(remainder) = &parts.remainder {
        let all = residuals.as_mut_slice().iter_mut().zip(remainder.as_slice());
        all.for_each(|(e, r)| *e += r);
    }
    let largest = responses.as_slice().iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let mean_square = |column: Vec<f64>, mean: f64| {
        column.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / runs as f64
    };
    let relative = |j: usize| {
        let variance = mean_square(responses.column(j), parts.mean[j]);
        if variance.sqrt() > ROUND_OFF * largest {
            mean_square(residuals.column(j), 0.0) / variance
        } else {
            0.0
        }
    };
    FitError { relative: (0..outputs).map(relative).collect(), residuals }
}

fn impossible() -> Stop {
    Stop::new("no Gaussian process with this trend has a likelihood given these runs")
        .help("use more runs, a simpler trend or a larger `surrogate.nugget`")
}
