//! Fit of an expansion to runs, as one problem for all outputs.

use lacuna::math::random::Stream;
use lacuna::plugin::Emulator;
use lacuna::plugin::surrogate::Training;
use lacuna::run::{Progress, Stop, Tasks};
use lacuna_linalg::Matrix;

use super::PolynomialChaos;
use super::coordinate::Coordinate;
use super::emulator::{Expansion, Summary};
use super::fits::Fits;
use super::judge::Criterion;
use super::least_squares::Fit;
use super::options::Solver;
use super::output::{Output, moments, outputs};
use super::quadrature::Projection;
use super::reduction::{Chosen, Reduction};
use super::search::{Best, Search};
use super::slopes::{self, Slopes};
use super::terms::{Basis, Sets};
use crate::surrogates::principal_components::PrincipalComponents;

/// Largest degree that is low enough for a warning if the number of terms allows no higher one.
const LOW_DEGREE: usize = 3;

pub(super) fn fit(
    options: &PolynomialChaos,
    training: &Training<'_>,
    stream: &Stream,
    progress: &Progress<'_>,
    tasks: Tasks<'_>,
) -> Result<Expansion, Stop> {
    let Training { points, responses, .. } = training;
    let reduction = options.reduction(points.rows(), responses.columns());
    fit_with(options, reduction, training, stream, progress, tasks)
}

/// Like [`fit`], with components in place of the outputs as stated.
pub(super) fn fit_with(
    options: &PolynomialChaos,
    reduction: Option<Reduction>,
    training: &Training<'_>,
    stream: &Stream,
    progress: &Progress<'_>,
    tasks: Tasks<'_>,
) -> Result<Expansion, Stop> {
    check_numbers(training)?;
    let runs = training.points.rows();
    if let Some(fault) = options.faults(training.parameters, Some(runs)).into_iter().next() {
        return Err(
            Stop::new(format!("`surrogate.{}`: {}", fault.key, fault.message)).help(fault.help)
        );
    }
    let coordinates = options.coordinates(training.parameters).map_err(Stop::new)?;
    let dimension = coordinates.len();
    let slopes = training.gradients.map(|g| Slopes::new(&coordinates, training.points, g));
    let problem = Problem {
        options,
        tasks,
        reduction,
        points: training.points,
        coordinates,
        sets: options.sets(dimension),
        criterion: match &slopes {
            Some(slopes) => Criterion::ByRun { runs, dimension, known: runs + slopes.known() },
            None => Criterion::new(options.selection, runs, stream),
        },
        slopes,
        projection: match options.solver {
            Solver::Quadrature => {
                Some(Projection::of(options.basis, training.parameters, training.points)?)
            }
            _ => None,
        },
    };
    problem.check_level()?;
    let expansion = match problem.part(stream) {
        Some(part) => problem.fit_from_part(&part, training.responses, stream, progress)?,
        None => problem.fit_from_all(training, progress)?,
    };
    problem.warn(&expansion, progress);
    problem.warn_of_limit(&expansion, progress);
    Ok(expansion)
}

/// Fails if there are fewer than 3 runs or a number is not finite; the message names the run and the place.
pub(in crate::surrogates) fn check_numbers(training: &Training<'_>) -> Result<(), Stop> {
    let Training { parameters, layouts, points, responses, gradients } = training;
    let wanted = responses.columns() * points.columns();
    if let Some(found) = gradients.filter(|g| (g.rows(), g.columns()) != (points.rows(), wanted)) {
        return Err(Stop::new(format!(
            "the derivatives of the responses should be {} x {wanted}, not {} x {}",
            points.rows(),
            found.rows(),
            found.columns()
        )));
    }
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
        let place = layouts.describe(o);
        let at = if place.is_empty() { String::new() } else { format!(" at {place}") };
        return Err(Stop::new(format!(
            "`{}` of run {}{at} is {}",
            layouts.name(),
            run + 1,
            responses[(run, o)]
        ))
        .help("leave the run out, or repair its response"));
    }
    Ok(())
}

/// Data shared by the fits of all outputs.
pub(super) struct Problem<'a> {
    pub options: &'a PolynomialChaos,
    /// Place where the paths of the outputs are followed.
    pub tasks: Tasks<'a>,
    /// Components in place of the outputs.
    pub reduction: Option<Reduction>,
    pub points: &'a Matrix,
    pub coordinates: Vec<Coordinate>,
    pub sets: Sets,
    pub criterion: Criterion,
    pub projection: Option<Projection>,
    /// Slopes of the responses at the runs, if they are known.
    pub slopes: Option<Slopes>,
}

impl Problem<'_> {
    /// Returns the responses or scores with their slopes.
    fn outputs(&self, responses: &Matrix, gradients: Option<&Matrix>) -> Vec<Output> {
        let mut outputs = outputs(responses);
        if let (Some(slopes), Some(gradients)) = (&self.slopes, gradients) {
            for (o, output) in outputs.iter_mut().enumerate() {
                output.centred.extend(slopes.of_output(gradients, o));
            }
        }
        outputs
    }

    /// Returns the number of values and known slopes of an output at the runs.
    fn known(&self) -> usize {
        self.points.rows() + self.slopes.as_ref().map_or(0, Slopes::known)
    }

    /// Warns of outputs and errors that deserve caution.
    fn warn(&self, expansion: &Expansion, progress: &Progress<'_>) {
        let Summary { constant, poor, optimistic, .. } = expansion.summary();
        let outputs = expansion.relative_error().len();
        if *constant > 0 {
            progress.warn(&format!(
                "{constant} of {outputs} outputs do not vary over the runs and are emulated by their mean"
            ));
        }
        if *poor > 0 {
            progress.warn(&format!(
                "{poor} of {outputs} outputs are emulated no better than by their mean"
            ));
        }
        let runs = self.points.rows();
        let few = runs < 10 * self.coordinates.len();
        if few || 2 * optimistic > outputs {
            let why =
                if few { "ten runs per parameter" } else { "three runs per term in most outputs" };
            progress.warn(&format!(
                "{runs} runs are fewer than {why}: the surrogate's leave-one-out errors are likely too small; \
                 use the errors at `validation` runs instead"
            ));
        }
    }

    /// Warns if the maximum number of terms allows a low degree only and outputs use it.
    fn warn_of_limit(&self, expansion: &Expansion, progress: &Progress<'_>) {
        let dimension = self.coordinates.len();
        let largest = self.sets.sets.iter().map(|set| set.degree).max().unwrap_or(0);
        let used = expansion.summary().degrees.contains(&largest);
        if used && largest <= LOW_DEGREE && largest < self.options.degree.range().max {
            progress.warn(&format!(
                "degree {} in {dimension} parameters has more than {} terms and was not tried: raise `max_terms` in \
                 `[surrogate]`, or leave out products with `max_interaction = 1`",
                largest + 1,
                self.options.most_terms(dimension)
            ));
        }
    }

    /// Fails if the quadrature rule determines none of the requested degrees.
    fn check_level(&self) -> Result<(), Stop> {
        let least = self.options.degree.range().min;
        match &self.projection {
            Some(projection) if projection.level < least => Err(Stop::new(format!(
                "`surrogate.degree`: the runs are a {} rule of level {}, which cannot determine an expansion of degree \
                 {least}",
                projection.rule.name(),
                projection.level
            ))
            .help("lower `degree`, or make the runs with a higher `level`")),
            _ => Ok(()),
        }
    }

    /// Chooses and fits the terms on all runs.
    fn fit_from_all(
        &self,
        training: &Training<'_>,
        progress: &Progress<'_>,
    ) -> Result<Expansion, Stop> {
        let Training { responses, gradients, .. } = *training;
        let Some(reduction) = self.reduction else {
            let outputs = self.outputs(responses, gradients);
            return Ok(self.fits(&outputs, progress)?.expansion());
        };
        let search = self.search();
        let scores_of = |components: &PrincipalComponents| {
            let directions = &components.directions;
            let slopes =
                gradients.map(|g| slopes::of_components(g, directions, self.coordinates.len()));
            self.outputs(&components.scores, slopes.as_ref())
        };
        let Chosen { components, scores, found } =
            reduction.chosen(responses, scores_of, &search, progress)?;
        let (_, variances) = moments(responses);
        let fits = self.refits(&search, &scores, &found)?;
        Ok(fits.multiplied_back(&variances, components))
    }

    /// Returns the best fit of each output.
    fn fits(&self, outputs: &[Output], progress: &Progress<'_>) -> Result<Fits, Stop> {
        let search = self.search();
        let found = search.choose_all(outputs, progress)?;
        self.refits(&search, outputs, &found)
    }

    /// Returns the search on all runs.
    pub fn search(&self) -> Search<'_> {
        Search {
            options: self.options,
            tasks: self.tasks,
            points: self.points,
            coordinates: &self.coordinates,
            sets: &self.sets,
            criterion: &self.criterion,
            projection: self.projection.as_ref(),
            slopes: self.slopes.as_ref(),
        }
    }

    /// Returns the fits on chosen terms.
    pub fn refits(
        &self,
        search: &Search<'_>,
        outputs: &[Output],
        found: &[Option<Best>],
    ) -> Result<Fits, Stop> {
        let fits = search.refit(outputs, found)?;
        let runs = self.points.rows();
        let fits: Vec<Fit> = outputs
            .iter()
            .zip(fits)
            .map(|(o, fit)| fit.unwrap_or_else(|| constant(o, runs)))
            .collect();
        Ok(self.assembled(outputs, found, &fits))
    }

    /// Assembles the fits over the union of the outputs' terms.
    fn assembled(&self, outputs: &[Output], found: &[Option<Best>], fits: &[Fit]) -> Fits {
        let union = self.union(found);
        let mut position = vec![0; self.sets.terms.len()];
        union.iter().enumerate().for_each(|(i, &t)| position[t] = i);
        let mut coefficients = Matrix::zeros(union.len(), fits.len());
        for (o, (fit, best)) in fits.iter().zip(found).enumerate() {
            for (&t, &c) in terms_of(best.as_ref()).iter().zip(&fit.coefficients) {
                coefficients[(position[t], o)] = c;
            }
        }
        let relative: Vec<f64> = fits.iter().map(|f| f.relative).collect();
        let variances: Vec<f64> = outputs.iter().map(|o| o.variance).collect();
        let summary = self.summary(found, &relative, &variances);
        let runs = self.points.rows();
        let residuals = Matrix::from_fn(runs, fits.len(), |r, o| fits[o].residuals[r]);
        Fits { terms: self.basis(&union), coefficients, relative, residuals, summary }
    }

    /// Returns the terms of any output, in increasing order; the constant is always one of them.
    pub fn union(&self, found: &[Option<Best>]) -> Vec<usize> {
        let mut used = vec![false; self.sets.terms.len()];
        found.iter().flat_map(|best| terms_of(best.as_ref())).for_each(|&t| used[t] = true);
        used[0] = true;
        (0..used.len()).filter(|&t| used[t]).collect()
    }

    /// Returns the basis functions of some terms.
    pub fn basis(&self, terms: &[usize]) -> Basis {
        Basis::new(self.coordinates.clone(), self.sets.terms.select(terms))
    }

    /// Returns the properties of a fit, given the choice of each output (or component), and error and variance of each
    /// that was fitted.
    pub fn summary(&self, found: &[Option<Best>], relative: &[f64], variances: &[f64]) -> Summary {
        let best = || found.iter().flatten();
        Summary {
            solver: self.options.solver,
            selection: self.options.selection,
            rule: self.projection.as_ref().map(|p| format!("{}, level {}", p.rule.name(), p.level)),
            degrees: found.iter().map(|b| b.as_ref().map_or(0, |b| b.degree)).collect(),
            q_norms: best().map(|b| b.q_norm).collect(),
            terms: found.iter().map(|b| terms_of(b.as_ref()).len()).collect(),
            candidates: self.sets.terms.len(),
            constant: variances.iter().filter(|v| **v == 0.0).count(),
            poor: relative.iter().filter(|e| **e >= 1.0).count(),
            optimistic: best().filter(|b| 3 * b.terms.len() > self.known()).count(),
            reduction: None,
            part: None,
        }
    }
}

/// Returns the terms of an output, which are the constant alone if none were chosen.
fn terms_of(best: Option<&Best>) -> &[usize] {
    best.map_or(&[0], |b| &b.terms)
}

/// Returns the fit of an output that does not vary.
fn constant(output: &Output, runs: usize) -> Fit {
    let n = runs as f64;
    let residuals = output.centred[..runs].iter().map(|y| y / (1.0 - 1.0 / n)).collect();
    Fit { coefficients: vec![output.mean], relative: 0.0, residuals }
}
