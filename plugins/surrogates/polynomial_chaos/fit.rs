//! From runs to an expansion: one problem for all outputs.

use lacuna::linalg::{Matrix, multiply_transposed};
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::run::{Progress, Stop};
use rayon::prelude::*;

use super::PolynomialChaos;
use super::emulator::{Expansion, Summary};
use super::family::Coordinate;
use super::least_angle::{Dictionary, best_along_path};
use super::least_squares::Regression;
use super::options::Solver;
use super::terms::{Basis, Nested};

/// Outputs whose standard deviation over the runs is below this share of the largest response do not
/// vary: what is left is round-off (the strain of a sensor before the wave arrives).
const ROUND_OFF: f64 = 1e-13;
/// A fit whose relative error is below this is exact; no higher degree is tried.
const EXACT: f64 = 1e-26;
/// A search whose best relative error is above this has found nothing yet and must not be ended.
const USELESS: f64 = 0.5;

/// One output over the runs.
struct Output {
    mean: f64,
    /// The values less their mean.
    centred: Vec<f64>,
    /// Divided by the number of runs; zero for outputs that do not vary.
    variance: f64,
}

/// The best fit of one output so far.
#[derive(Debug, Clone, Default)]
struct Search {
    best: Option<Best>,
    /// Degrees in a row that were worse than the best.
    worse: usize,
    done: bool,
}

#[derive(Debug, Clone)]
struct Best {
    error: f64,
    degree: usize,
    /// Positions in the nested set, the constant first.
    terms: Vec<usize>,
}

/// The fit of one output, ready to be put beside the others.
struct Refit {
    terms: Vec<usize>,
    degree: usize,
    coefficients: Vec<f64>,
    relative: f64,
    residuals: Vec<f64>,
}

pub(super) fn fit(
    options: &PolynomialChaos,
    training: &Training<'_>,
    progress: &Progress<'_>,
) -> Result<Expansion, Stop> {
    check_numbers(training)?;
    let runs = training.points.rows();
    if let Some(fault) = options.faults(training.parameters, Some(runs)).into_iter().next() {
        return Err(
            Stop::new(format!("`surrogate.{}`: {}", fault.key, fault.message)).help(fault.help)
        );
    }
    let coordinates: Vec<Coordinate> = (training.parameters.iter())
        .map(|p| options.basis.coordinate(p).map_err(Stop::new))
        .collect::<Result<_, _>>()?;
    let nested = options.nested(coordinates.len());
    let outputs = outputs(training.responses);
    warn_of_constants(&outputs, progress);

    let search = Degrees { options, training, coordinates: &coordinates, nested: &nested };
    let found = search.run(&outputs, progress)?;
    let refits: Vec<Refit> = (outputs.par_iter().zip(&found))
        .map(|(output, found)| search.refit(output, found.best.as_ref()))
        .collect::<Result<_, _>>()?;
    Ok(assemble(options.solver, coordinates, &nested, runs, &refits))
}

/// Refuses numbers that no regression can take, naming where they are.
pub(in crate::surrogates) fn check_numbers(training: &Training<'_>) -> Result<(), Stop> {
    let Training { parameters, layout, points, responses } = training;
    if points.rows() != responses.rows() || points.rows() < 3 {
        return Err(Stop::new(format!(
            "a surrogate needs at least 3 runs with a response each, but there are {} points and {} \
             responses",
            points.rows(),
            responses.rows()
        )));
    }
    let first = |m: &Matrix| {
        let flat = m.as_slice().iter().position(|x| !x.is_finite())?;
        Some((flat / m.columns(), flat % m.columns()))
    };
    if let Some((run, i)) = first(points) {
        return Err(Stop::new(format!(
            "parameter `{}` of run {} is {}",
            parameters[i].name,
            run + 1,
            points[(run, i)]
        )));
    }
    if let Some((run, o)) = first(responses) {
        let place = layout.describe(o);
        let at = if place.is_empty() { String::new() } else { format!(" at {place}") };
        return Err(Stop::new(format!(
            "`{}` of run {}{at} is {}",
            layout.name,
            run + 1,
            responses[(run, o)]
        ))
        .help("leave the run out, or repair its response"));
    }
    Ok(())
}

fn outputs(responses: &Matrix) -> Vec<Output> {
    let largest = responses.as_slice().iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let runs = responses.rows() as f64;
    let columns = responses.transposed();
    let output = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / runs;
        let centred: Vec<f64> = values.iter().map(|y| y - mean).collect();
        let variance = centred.iter().map(|y| y * y).sum::<f64>() / runs;
        let varies = variance.sqrt() > ROUND_OFF * largest;
        Output { mean, centred, variance: if varies { variance } else { 0.0 } }
    };
    columns.iter_rows().map(output).collect()
}

fn warn_of_constants(outputs: &[Output], progress: &Progress<'_>) {
    let constant = outputs.iter().filter(|o| o.variance == 0.0).count();
    if constant > 0 {
        progress.warn(&format!(
            "{constant} of {} outputs do not vary over the runs and are emulated by their mean",
            outputs.len()
        ));
    }
}

/// The search over degrees.
struct Degrees<'a> {
    options: &'a PolynomialChaos,
    training: &'a Training<'a>,
    coordinates: &'a [Coordinate],
    nested: &'a Nested,
}

impl Degrees<'_> {
    /// Tries one degree after the other for all outputs that still improve.
    fn run(&self, outputs: &[Output], progress: &Progress<'_>) -> Result<Vec<Search>, Stop> {
        let mut searches = vec![Search::default(); outputs.len()];
        for (search, output) in searches.iter_mut().zip(outputs) {
            search.done = output.variance == 0.0;
        }
        let count = |searches: &[Search]| searches.iter().filter(|s| s.done).count() as u64;
        let mut reported = count(&searches);
        progress.add(reported);
        for degree in self.degrees() {
            let active: Vec<usize> = (0..outputs.len()).filter(|&o| !searches[o].done).collect();
            if active.is_empty() {
                break;
            }
            for (&o, found) in active.iter().zip(self.at_degree(degree, outputs, &active)?) {
                searches[o].take(found, self.options.early_stop.degrees);
            }
            progress.add(count(&searches) - reported);
            reported = count(&searches);
        }
        progress.add(outputs.len() as u64 - reported);
        Ok(searches)
    }

    /// The degrees to be tried: those whose set differs from the one before.
    fn degrees(&self) -> impl Iterator<Item = usize> {
        let range = self.options.degree.range();
        let counts = &self.nested.counts;
        (range.min..=range.max.min(counts.len() - 1))
            .filter(move |&p| p == range.min || counts[p] > counts[p - 1])
    }

    /// The basis functions of a degree at the runs, `runs x terms`.
    fn basis(&self, degree: usize) -> Matrix {
        let terms = self.nested.terms.prefix(self.nested.counts[degree]);
        Basis::new(self.coordinates.to_vec(), terms).values(self.training.points)
    }

    /// The best fit of each active output at one degree.
    fn at_degree(
        &self,
        degree: usize,
        outputs: &[Output],
        active: &[usize],
    ) -> Result<Vec<Option<Best>>, Stop> {
        let basis = self.basis(degree);
        match self.options.solver {
            Solver::LeastAngleRegression => Ok(self.sparse(degree, &basis, outputs, active)),
            Solver::LeastSquares => {
                let regression = Regression::new(&basis).ok_or_else(|| dependent(degree))?;
                let terms: Vec<usize> = (0..basis.columns()).collect();
                let best = |&o: &usize| {
                    let Output { mean, centred, variance } = &outputs[o];
                    let error = regression.fit(*mean, centred, *variance).relative;
                    Some(Best { error, degree, terms: terms.clone() })
                };
                Ok(active.par_iter().map(best).collect())
            }
        }
    }

    fn sparse(
        &self,
        degree: usize,
        basis: &Matrix,
        outputs: &[Output],
        active: &[usize],
    ) -> Vec<Option<Best>> {
        let dictionary = Dictionary::new(basis);
        let centred = Matrix::from_rows(basis.rows(), active.iter().map(|&o| &outputs[o].centred));
        let correlations = multiply_transposed(&centred, dictionary.columns());
        let window = self.options.early_stop.window(basis.rows());
        let best = |i: usize| {
            let choice = best_along_path(&dictionary, centred.row(i), correlations.row(i), window)?;
            let mut terms = vec![0];
            terms.extend(choice.terms);
            terms.sort_unstable();
            Some(Best { error: choice.error, degree, terms })
        };
        (0..active.len()).into_par_iter().map(best).collect()
    }

    /// The least-squares fit of an output on its chosen terms; on the constant alone without any.
    fn refit(&self, output: &Output, best: Option<&Best>) -> Result<Refit, Stop> {
        let Some(best) = best else {
            if output.variance > 0.0 {
                return Err(unexplained());
            }
            let n = output.centred.len() as f64;
            let residuals = output.centred.iter().map(|y| y / (1.0 - 1.0 / n)).collect();
            return Ok(Refit {
                terms: vec![0],
                degree: 0,
                coefficients: vec![output.mean],
                relative: 0.0,
                residuals,
            });
        };
        let terms = self.nested.terms.select(&best.terms);
        let basis = Basis::new(self.coordinates.to_vec(), terms).values(self.training.points);
        let regression = Regression::new(&basis).ok_or_else(|| dependent(best.degree))?;
        let fit = regression.fit(output.mean, &output.centred, output.variance);
        Ok(Refit {
            terms: best.terms.clone(),
            degree: best.degree,
            coefficients: fit.coefficients,
            relative: fit.relative,
            residuals: fit.residuals,
        })
    }
}

fn unexplained() -> Stop {
    Stop::new("the responses vary over the runs, but no basis function does so with them")
        .help("check that the runs' parameters and responses belong together")
}

fn dependent(degree: usize) -> Stop {
    Stop::new(format!(
        "the basis functions of degree {degree} are linearly dependent on these runs"
    ))
    .help("lower `surrogate.degree`, or use a design without repeated points")
}

impl Search {
    /// Compares the fit of one more degree with the best so far.
    fn take(&mut self, found: Option<Best>, patience: usize) {
        let least = self.best.as_ref().map_or(f64::INFINITY, |b| b.error);
        match found {
            Some(found) if self.best.is_none() || found.error < least => {
                self.done = found.error <= EXACT;
                self.worse = 0;
                self.best = Some(found);
            }
            _ => {
                self.worse += 1;
                self.done = patience > 0 && self.worse >= patience && least < USELESS;
            }
        }
    }
}

/// Puts the outputs' terms into their union.
fn assemble(
    solver: Solver,
    coordinates: Vec<Coordinate>,
    nested: &Nested,
    runs: usize,
    refits: &[Refit],
) -> Expansion {
    let mut used = vec![false; nested.terms.len()];
    refits.iter().flat_map(|r| &r.terms).for_each(|&t| used[t] = true);
    let union: Vec<usize> = (0..used.len()).filter(|&t| used[t]).collect();
    let mut position = vec![0; used.len()];
    union.iter().enumerate().for_each(|(i, &t)| position[t] = i);
    let mut coefficients = Matrix::zeros(union.len(), refits.len());
    for (o, refit) in refits.iter().enumerate() {
        for (&t, &c) in refit.terms.iter().zip(&refit.coefficients) {
            coefficients[(position[t], o)] = c;
        }
    }
    let residuals = Matrix::from_fn(runs, refits.len(), |r, o| refits[o].residuals[r]);
    let relative = refits.iter().map(|r| r.relative).collect();
    let summary = Summary {
        solver,
        degrees: refits.iter().map(|r| r.degree).collect(),
        terms: refits.iter().map(|r| r.terms.len()).collect(),
        candidates: nested.terms.len(),
        constant: refits.iter().filter(|r| r.degree == 0).count(),
    };
    let basis = Basis::new(coordinates, nested.terms.select(&union));
    Expansion::new(basis, coefficients, FitError { relative, residuals }, summary)
}
