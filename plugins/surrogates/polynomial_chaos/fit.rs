//! Fit of an expansion to runs, as one problem for all outputs.

use lacuna::math::random::Stream;
use lacuna::plugin::Emulator;
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::run::{Progress, Stop};
use lacuna_linalg::{Matrix, multiply_transposed};

use super::PolynomialChaos;
use super::coordinate::Coordinate;
use super::emulator::{Expansion, Reduction, Summary};
use super::judge::Criterion;
use super::least_squares::Fit;
use super::options::Solver;
use super::quadrature::Projection;
use super::search::{Best, Output, Search};
use super::slopes::{self, Slopes};
use super::terms::{Basis, Sets};
use crate::surrogates::principal_components::PrincipalComponents;

/// Standard deviation over the runs, as a fraction of the largest response, below which an output counts as constant:
/// what is left are rounding errors (such as the strain of a sensor before the wave arrives).
const ROUND_OFF: f64 = 1e-13;

/// Largest degree that is low enough for a warning if the number of terms allows no higher one.
const LOW_DEGREE: usize = 3;

/// Fits of all outputs, or of all components, side by side.
struct Fits {
    terms: Basis,
    /// Coefficients (`terms x outputs`).
    coefficients: Matrix,
    relative: Vec<f64>,
    /// Leave-one-out residuals (`runs x outputs`).
    residuals: Matrix,
    summary: Summary,
}

pub(super) fn fit(
    options: &PolynomialChaos,
    training: &Training<'_>,
    stream: &Stream,
    progress: &Progress<'_>,
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
    let outputs = problem.outputs(training.responses, training.gradients);
    let expansion = match options.components {
        Some(components) => {
            let components = components.of(training.responses)?;
            let of_scores = training
                .gradients
                .map(|g| slopes::of_components(g, &components.directions, dimension));
            let scores = problem.outputs(&components.scores, of_scores.as_ref());
            problem.fits(&scores, progress)?.multiplied_back(&outputs, &components)
        }
        None => problem.fits(&outputs, progress)?.expansion(None),
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

/// Data shared by the fits of all outputs.
struct Problem<'a> {
    options: &'a PolynomialChaos,
    points: &'a Matrix,
    coordinates: Vec<Coordinate>,
    sets: Sets,
    criterion: Criterion,
    projection: Option<Projection>,
    /// Slopes of the responses at the runs, if they are known.
    slopes: Option<Slopes>,
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
        let outputs = expansion.fit_error().relative.len();
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

    /// Returns the best fit of each output.
    fn fits(&self, outputs: &[Output], progress: &Progress<'_>) -> Result<Fits, Stop> {
        let search = Search {
            options: self.options,
            points: self.points,
            coordinates: &self.coordinates,
            sets: &self.sets,
            criterion: &self.criterion,
            projection: self.projection.as_ref(),
            slopes: self.slopes.as_ref(),
        };
        let found = search.run(outputs, progress)?;
        let unexplained = outputs.iter().zip(&found).any(|(o, b)| o.variance > 0.0 && b.is_none());
        if unexplained {
            return Err(unexplained_output());
        }
        let fits = search.refit(outputs, &found)?;
        let runs = self.points.rows();
        let fits: Vec<Fit> = outputs
            .iter()
            .zip(fits)
            .map(|(o, fit)| fit.unwrap_or_else(|| constant(o, runs)))
            .collect();
        Ok(self.assembled(outputs, &found, &fits))
    }

    /// Assembles the fits over the union of the outputs' terms.
    fn assembled(&self, outputs: &[Output], found: &[Option<Best>], fits: &[Fit]) -> Fits {
        let all = &self.sets.terms;
        let terms_of = |best: &Option<Best>| best.as_ref().map_or(vec![0], |b| b.terms.clone());
        let own: Vec<Vec<usize>> = found.iter().map(terms_of).collect();
        let mut used = vec![false; all.len()];
        own.iter().flatten().for_each(|&t| used[t] = true);
        // The constant is included even without outputs.
        used[0] = true;
        let union: Vec<usize> = (0..used.len()).filter(|&t| used[t]).collect();
        let mut position = vec![0; used.len()];
        union.iter().enumerate().for_each(|(i, &t)| position[t] = i);
        let mut coefficients = Matrix::zeros(union.len(), fits.len());
        for (o, (fit, terms)) in fits.iter().zip(&own).enumerate() {
            for (&t, &c) in terms.iter().zip(&fit.coefficients) {
                coefficients[(position[t], o)] = c;
            }
        }
        let runs = self.points.rows();
        let best = || found.iter().flatten();
        let summary = Summary {
            solver: self.options.solver,
            selection: self.options.selection,
            rule: self.projection.as_ref().map(|p| format!("{}, level {}", p.rule.name(), p.level)),
            degrees: found.iter().map(|b| b.as_ref().map_or(0, |b| b.degree)).collect(),
            q_norms: best().map(|b| b.q_norm).collect(),
            terms: own.iter().map(Vec::len).collect(),
            candidates: all.len(),
            constant: outputs.iter().filter(|o| o.variance == 0.0).count(),
            poor: fits.iter().filter(|f| f.relative >= 1.0).count(),
            optimistic: best().filter(|b| 3 * b.terms.len() > self.known()).count(),
            reduction: None,
        };
        Fits {
            terms: Basis::new(self.coordinates.clone(), all.select(&union)),
            coefficients,
            relative: fits.iter().map(|f| f.relative).collect(),
            residuals: Matrix::from_fn(runs, fits.len(), |r, o| fits[o].residuals[r]),
            summary,
        }
    }
}

impl Fits {
    fn expansion(self, reduction: Option<Reduction>) -> Expansion {
        let fit_error = FitError { relative: self.relative, residuals: self.residuals };
        let summary = Summary { reduction, ..self.summary };
        Expansion::new(self.terms, self.coefficients, fit_error, summary)
    }

    /// Converts an expansion of components to one of the outputs. The part of the outputs that the components leave
    /// out is included in the residuals, and hence in all statements about the emulator's error.
    fn multiplied_back(self, outputs: &[Output], components: &PrincipalComponents) -> Expansion {
        let PrincipalComponents { mean, directions, scores, remainder } = components;
        let runs = self.residuals.rows();
        let mut coefficients = multiply_transposed(&self.coefficients, directions);
        // The constant is the first term of every set.
        coefficients.row_mut(0).iter_mut().zip(mean).for_each(|(c, m)| *c += m);
        let square = |column: Vec<f64>| column.iter().map(|x| x * x).sum::<f64>();
        // The correction for the number of terms differs between components.
        let corrections: Vec<f64> = (0..scores.columns())
            .map(|k| {
                let plain = square(self.residuals.column(k));
                let corrected = self.relative[k] * square(scores.column(k));
                if plain > 0.0 { (corrected / plain).sqrt() } else { 1.0 }
            })
            .collect();
        let corrected =
            Matrix::from_fn(runs, scores.columns(), |i, k| self.residuals[(i, k)] * corrections[k]);
        let back = |scores: &Matrix| {
            let product = multiply_transposed(scores, directions);
            Matrix::from_fn(runs, outputs.len(), |i, j| product[(i, j)] + remainder[(i, j)])
        };
        let (residuals, enlarged) = (back(&self.residuals), back(&corrected));
        let relative: Vec<f64> = (outputs.iter().enumerate())
            .map(|(o, output)| {
                let error = square(enlarged.column(o)) / runs as f64;
                if output.variance > 0.0 { error / output.variance } else { 0.0 }
            })
            .collect();
        let total: f64 = outputs.iter().map(|o| o.variance).sum();
        let reduction = Reduction {
            components: scores.columns(),
            left_out: components.truncation().iter().sum::<f64>() / total.max(f64::MIN_POSITIVE),
        };
        let summary = Summary {
            constant: outputs.iter().filter(|o| o.variance == 0.0).count(),
            poor: relative.iter().filter(|e| **e >= 1.0).count(),
            ..self.summary
        };
        Fits { coefficients, relative, residuals, summary, ..self }.expansion(Some(reduction))
    }
}

/// Returns the fit of an output that does not vary.
fn constant(output: &Output, runs: usize) -> Fit {
    let n = runs as f64;
    let residuals = output.centred[..runs].iter().map(|y| y / (1.0 - 1.0 / n)).collect();
    Fit { coefficients: vec![output.mean], relative: 0.0, residuals }
}

fn unexplained_output() -> Stop {
    Stop::new("the responses vary over the runs, but no basis function does so with them")
        .help("check that the runs' parameters and responses belong together")
}
