//! Search for each output's best terms over degrees and norms.

use std::collections::BTreeMap;

use lacuna::run::{Progress, Stop, Tasks};
use lacuna_linalg::Matrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::PolynomialChaos;
use super::bayesian::{Parts, bayesian};
use super::columns::Columns;
use super::coordinate::Coordinate;
use super::dictionary::Dictionary;
use super::gram::Gram;
use super::judge::{Choice, Criterion, best_along};
use super::least_squares::{Fit, Regression};
use super::matching_pursuit::MatchingPursuit;
use super::options::Solver;
use super::output::Output;
use super::quadrature::Projection;
use super::slopes::Slopes;
use super::subspace_pursuit::subspace_pursuit;
use super::terms::{Basis, Sets, TermSet};

/// Relative error below which a fit is exact and no higher degree is tried.
const EXACT: f64 = 1e-26;
/// Relative error above which a search has not found anything useful yet and must continue.
const USELESS: f64 = 0.5;
/// Number of consecutive norms of one degree that were worse before the next degree is tried.
const WORSE_NORMS: usize = 2;

/// Terms of one output, and how they were found.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Best {
    pub error: f64,
    pub degree: usize,
    pub q_norm: f64,
    /// Indices among the terms of all sets, the constant first.
    pub terms: Vec<usize>,
}

impl Best {
    /// The constant and the other terms of a set that a solver chose.
    pub fn new(set: &TermSet, error: f64, others: impl Iterator<Item = usize>) -> Self {
        let mut terms = vec![set.members[0]];
        terms.extend(others);
        terms.sort_unstable();
        Self { error, degree: set.degree, q_norm: set.q_norm, terms }
    }
}

/// Best fit of one output so far.
#[derive(Debug, Clone, Default)]
pub(super) struct State {
    pub best: Option<Best>,
    /// Number of consecutive degrees that were worse than the best.
    worse: usize,
    /// True if no further degree is tried.
    pub done: bool,
    /// Best fit among the norms of the present degree.
    of_degree: Option<Best>,
    worse_norms: usize,
}

/// The search and the data shared by all outputs.
pub(super) struct Search<'a> {
    pub options: &'a PolynomialChaos,
    /// Place where the paths of the outputs are followed.
    pub tasks: Tasks<'a>,
    pub points: &'a Matrix,
    pub coordinates: &'a [Coordinate],
    pub sets: &'a Sets,
    pub criterion: &'a Criterion,
    /// Weights of the runs, for projections.
    pub projection: Option<&'a Projection>,
    /// Slopes among the rows of the regression.
    pub slopes: Option<&'a Slopes>,
}

impl Search<'_> {
    /// Returns the best terms of each output: `None` for outputs that do not vary. Fails if there are none for an output
    /// that varies.
    pub fn choose_all(
        &self,
        outputs: &[Output],
        progress: &Progress<'_>,
    ) -> Result<Vec<Option<Best>>, Stop> {
        let found = match self.options.solver {
            Solver::LeastAngleRegression => self.along_paths(outputs, progress)?,
            _ => self.set_by_set(outputs, progress)?,
        };
        if outputs.iter().zip(&found).any(|(o, best)| o.variance > 0.0 && best.is_none()) {
            return Err(Stop::new(
                "the responses vary over the runs, but no basis function does so with them",
            )
            .help("check that the runs' parameters and responses belong together"));
        }
        Ok(found)
    }

    /// Tries one set after the other for all outputs that still improve. `None` for outputs that do not vary, or with
    /// which no basis function varies.
    fn set_by_set(
        &self,
        outputs: &[Output],
        progress: &Progress<'_>,
    ) -> Result<Vec<Option<Best>>, Stop> {
        let mut states = vec![State::default(); outputs.len()];
        for (state, output) in states.iter_mut().zip(outputs) {
            state.done = output.variance == 0.0;
        }
        let count = |states: &[State]| states.iter().filter(|s| s.done).count() as u64;
        let mut reported = count(&states);
        progress.add(reported);
        for of_degree in self.sets.sets.chunk_by(|a, b| a.degree == b.degree) {
            let tried: Vec<usize> = (0..outputs.len()).filter(|&o| !states[o].done).collect();
            if tried.is_empty() {
                break;
            }
            for set in of_degree.iter().filter(|set| self.is_possible(set)) {
                let active: Vec<usize> =
                    tried.iter().copied().filter(|&o| states[o].tries_norms()).collect();
                for (&o, found) in active.iter().zip(self.on_set(set, outputs, &active)?) {
                    states[o].take_norm(found);
                }
            }
            for &o in &tried {
                states[o].take_degree(self.options.early_stop.degrees);
            }
            progress.add(count(&states) - reported);
            reported = count(&states);
        }
        progress.add(outputs.len() as u64 - reported);
        Ok(states.into_iter().map(|s| s.best).collect())
    }

    /// Returns true if the runs determine the fit of this set; sparse solvers accept any set.
    fn is_possible(&self, set: &TermSet) -> bool {
        match (self.options.solver, self.projection) {
            (Solver::LeastSquares, _) => set.members.len() < self.points.rows(),
            (Solver::Quadrature, Some(projection)) => set.degree <= projection.level,
            _ => true,
        }
    }

    /// Returns the basis functions of some terms.
    fn basis(&self, terms: &[usize]) -> Basis {
        Basis::new(self.coordinates.to_vec(), self.sets.terms.select(terms))
    }

    /// Returns the basis functions of some terms at the runs (`runs x terms`), followed by their slopes.
    fn rows(&self, terms: &[usize]) -> Matrix {
        let basis = self.basis(terms);
        let values = basis.values(self.points);
        let Some(slopes) = self.slopes else { return values };
        let slopes = slopes.columns(&basis, self.points);
        let columns = Columns::new(values.transposed(), Some(slopes));
        let all = (0..columns.terms()).map(|t| columns.column(t));
        Matrix::from_rows(columns.height(), all).transposed()
    }

    /// Returns the best fit of each active output on one set.
    fn on_set(
        &self,
        set: &TermSet,
        outputs: &[Output],
        active: &[usize],
    ) -> Result<Vec<Option<Best>>, Stop> {
        let all = |o: usize, fit: Fit| {
            let terms = set.members.clone();
            (outputs[o].variance > 0.0).then_some(Best {
                error: fit.relative,
                degree: set.degree,
                q_norm: set.q_norm,
                terms,
            })
        };
        match self.options.solver {
            Solver::LeastSquares | Solver::Quadrature => {
                let fits = self.fits(&set.members, outputs, active)?;
                Ok(active.iter().zip(fits).map(|(&o, fit)| all(o, fit)).collect())
            }
            _ => Ok(self.sparse(set, outputs, active)),
        }
    }

    /// Returns the basis functions of some terms at the runs, for fits of this number of outputs.
    pub fn dictionary(&self, members: &[usize], outputs: usize) -> Dictionary {
        // Sparse Bayesian learning follows the statistics of every term.
        let whole = self.options.solver == Solver::BayesianCompressiveSensing
            || Gram::needs_all(members.len(), self.points.rows(), outputs);
        let basis = self.basis(members);
        let slopes = self.slopes.map(|slopes| slopes.columns(&basis, self.points));
        Dictionary::new(&basis.values(self.points), slopes, whole)
    }

    /// Returns the values of some outputs, with their slopes if these are known, minus their means (`outputs x rows`).
    pub fn centred(&self, outputs: &[Output], which: &[usize]) -> Matrix {
        let runs = self.points.rows();
        let rows = self.slopes.map_or(runs, |slopes| runs * (1 + slopes.dimension()));
        Matrix::from_rows(rows, which.iter().map(|&o| &outputs[o].centred))
    }

    fn sparse(&self, set: &TermSet, outputs: &[Output], active: &[usize]) -> Vec<Option<Best>> {
        let dictionary = self.dictionary(&set.members, active.len());
        let centred = self.centred(outputs, active);
        let correlations = dictionary.correlations(&centred);
        let parts = Parts::default();
        let best = |i: usize| {
            let choice = self.choose(&dictionary, &parts, centred.row(i), correlations.row(i))?;
            Some(Best::new(set, choice.error, choice.terms.iter().map(|&t| set.members[t])))
        };
        (0..active.len()).into_par_iter().map(best).collect()
    }

    /// Returns the choice of a solver that takes each set by itself, for one output.
    fn choose(
        &self,
        dictionary: &Dictionary,
        parts: &Parts,
        centred: &[f64],
        correlations: &[f64],
    ) -> Option<Choice> {
        let criterion = self.criterion;
        let window = self.options.early_stop.window(self.points.rows());
        match self.options.solver {
            Solver::SubspacePursuit => {
                subspace_pursuit(dictionary, centred, correlations, criterion)
            }
            Solver::BayesianCompressiveSensing => {
                bayesian(dictionary, parts, centred, correlations, criterion)
            }
            _ => {
                let mut path = MatchingPursuit::new(dictionary, correlations);
                let most = dictionary.most_greedy_terms();
                best_along(&mut path, centred, criterion, most, window)
            }
        }
    }

    /// Fits all outputs on their chosen terms; outputs with the same terms share the work. `None` for outputs without
    /// terms.
    pub fn refit(
        &self,
        outputs: &[Output],
        found: &[Option<Best>],
    ) -> Result<Vec<Option<Fit>>, Stop> {
        let mut groups: BTreeMap<&[usize], Vec<usize>> = BTreeMap::new();
        for (o, best) in found.iter().enumerate() {
            if let Some(best) = best {
                groups.entry(&best.terms).or_default().push(o);
            }
        }
        let fitted: Vec<Vec<Fit>> = (groups.par_iter())
            .map(|(terms, members)| self.fits(terms, outputs, members))
            .collect::<Result<_, _>>()?;
        let mut fits: Vec<Option<Fit>> = outputs.iter().map(|_| None).collect();
        for (&o, fit) in groups.values().flatten().zip(fitted.into_iter().flatten()) {
            fits[o] = Some(fit);
        }
        Ok(fits)
    }

    /// Fits some outputs on the same terms.
    fn fits(&self, terms: &[usize], outputs: &[Output], which: &[usize]) -> Result<Vec<Fit>, Stop> {
        let basis = self.rows(terms);
        if let Some(projection) = self.projection {
            let projected = projection.on(&basis);
            return Ok(which.par_iter().map(|&o| projected.fit(&outputs[o])).collect());
        }
        let regression = Regression::new(&basis, self.criterion).ok_or_else(dependent)?;
        let fit = |&o: &usize| {
            let Output { mean, centred, variance } = &outputs[o];
            regression.fit(*mean, centred, *variance)
        };
        Ok(which.par_iter().map(fit).collect())
    }
}

fn dependent() -> Stop {
    Stop::new("the basis functions are linearly dependent on these runs")
        .help("lower `surrogate.degree`, or use a design without repeated points")
}

impl State {
    /// Returns true if further norms of the present degree are tried.
    pub fn tries_norms(&self) -> bool {
        self.worse_norms < WORSE_NORMS
    }

    /// Compares the fit with a further norm with the best of this degree.
    pub fn take_norm(&mut self, found: Option<Best>) {
        let least = self.of_degree.as_ref().map_or(f64::INFINITY, |b| b.error);
        match found {
            Some(found) if self.of_degree.is_none() || found.error < least => {
                self.worse_norms = 0;
                self.of_degree = Some(found);
            }
            _ => self.worse_norms += 1,
        }
    }

    /// Compares the best fit of a further degree with the best so far.
    pub fn take_degree(&mut self, patience: usize) {
        self.worse_norms = 0;
        let least = self.best.as_ref().map_or(f64::INFINITY, |b| b.error);
        match self.of_degree.take() {
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
