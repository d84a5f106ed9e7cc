//! `polynomial_chaos`: expansions in orthonormal polynomials of the parameters.

mod bayesian;
mod by_run;
pub(super) mod bytes;
mod candidates;
mod columns;
mod common_terms;
mod coordinate;
mod dictionary;
mod emulator;
mod errors;
mod family;
mod fit;
mod fits;
mod functions;
mod gram;
mod judge;
mod least_angle;
mod least_squares;
mod matching_pursuit;
mod measure;
mod options;
mod output;
mod part;
mod paths;
mod quadrature;
mod recurrence;
mod reduction;
mod rotated;
mod search;
mod sensitivity;
mod slopes;
mod sparse;
mod squares;
mod subspace_pursuit;
mod sum;
mod tables;
mod terms;
mod trend;

#[cfg(test)]
pub(super) mod tests;

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::{Summand, Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Stop, Tasks};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::surrogates::principal_components::Components;

pub use coordinate::Coordinate;
pub use emulator::{Expansion, Reduction, Summary};
pub use family::Family;
pub(super) use fit::check_numbers;
pub use options::{Degree, DegreeRange, EarlyStop, QNorm, QNormRange, Selection, Solver};
pub use recurrence::Recurrence;
pub use tables::add_basis;
pub use terms::{Basis, Nested, Sets, TermSet, Terms, Truncation};

/// A polynomial chaos expansion: each output is a sum of products of orthonormal polynomials in the parameters.
///
/// The polynomials are orthonormal under the *design's* distribution, so that the coefficients give mean, variance
/// and Sobol' indices without sampling. All outputs are fitted as one problem: they share the basis and its Gram
/// matrix. For each output, degree and norm the solver proposes sets of terms; every proposed set is fitted by least
/// squares and assessed by its leave-one-out error, corrected for the number of terms by
/// `N / (N - P) (1 + tr (Psi' Psi)^-1)`, or by cross-validation. The output keeps the set, degree and norm with the
/// smallest error; an output that varies is never represented by its mean alone. Outputs that are constant over the
/// runs up to rounding errors are emulated by their mean and have the error 0.
///
/// With `gradients = true` in `[surrogate]` each run adds the slopes by its parameters to the regression, in the standard
/// variables and with the weights under which the slopes of the polynomials are orthogonal as well. The leave-one-out error is
/// then that of the values at runs left out together with their slopes. The solvers `least_angle_regression`,
/// `orthogonal_matching_pursuit` and `least_squares` take slopes.
///
/// Because this error was used for the choice, it is too small if there are few runs: with fewer than three runs per
/// term or ten per parameter rely on the `validation` runs instead. The result reports when this is the case.
///
/// Outside the range of the design the polynomials are extrapolated, and grow quickly; if a parameter is transformed
/// they keep their values at the bounds of the design.
///
/// References: Blatman and Sudret, *Adaptive sparse polynomial chaos expansion based on least angle regression*,
/// Journal of Computational Physics 230 (2011) 2345; Efron, Hastie, Johnstone and Tibshirani, *Least angle
/// regression*, Annals of Statistics 32 (2004) 407; Chapelle, Vapnik and Bengio, *Model selection for small sample
/// regression*, Machine Learning 48 (2002) 9; Sudret, *Global sensitivity analysis using polynomial chaos
/// expansions*, Reliability Engineering and System Safety 93 (2008) 964. Families: Xiu and Karniadakis, SIAM Journal
/// on Scientific Computing 24 (2002) 619; Gautschi, *Orthogonal Polynomials*, Oxford (2004); Ernst, Mugler, Starkloff
/// and Ullmann, ESAIM: Mathematical Modelling and Numerical Analysis 46 (2012) 317 (responses that polynomials of
/// log-normal parameters cannot represent). Solvers: Pati, Rezaiifar and Krishnaprasad, 27th Asilomar Conference
/// (1993) 40; Dai and Milenkovic, IEEE Transactions on Information Theory 55 (2009) 2230; Tipping and Faul, 9th
/// Workshop on Artificial Intelligence and Statistics (2003); Lüthen, Marelli and Sudret, SIAM/ASA Journal on
/// Uncertainty Quantification 9 (2021) 593 (a comparison). Slopes: Peng, Hampton and Doostan, Journal of Computational
/// Physics 310 (2016) 440.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PolynomialChaos {
    /// Family of polynomials of each parameter.
    pub basis: Family,
    /// Method that chooses the terms and their coefficients.
    pub solver: Solver,
    /// Degree, or the range of degrees from which each output takes the best.
    pub degree: Degree,
    /// Norm `q` that truncates the basis: degree `p` includes the products whose exponents satisfy
    /// `(sum of exponent^q)^(1 / q) <= p`. Above 0, at most 1. With 1 this is the total degree; smaller values leave
    /// out products of many parameters. From a list, or a range such as `{ min = 0.5, max = 1.0, step = 0.1 }`, each
    /// output takes the norm with the smallest error. Default: 1; with more than 15 parameters `[0.5, 0.75]`.
    pub q_norm: Option<QNorm>,
    /// Maximum number of parameters in one product. Default: no limit; with more than 15 parameters 2.
    pub max_interaction: Option<usize>,
    /// Maximum number of terms of a degree; degrees with more terms are not tried. Default: 4000; with more than 15
    /// parameters 6000.
    pub max_terms: Option<usize>,
    /// Conditions that end the search for a better expansion.
    pub early_stop: EarlyStop,
    /// Error by which terms, degrees and norms are chosen.
    pub selection: Selection,
    /// Principal components of the outputs, fitted in place of the outputs: `{ variance = 0.9999 }` for as many as
    /// carry this fraction of the variance, or `{ count = 20 }`. This saves time with thousands of outputs; the part
    /// that the components leave out is added to the emulator's error. `"none"` fits the outputs themselves. Default: the
    /// outputs themselves up to a million values (runs times outputs), and above with up to 1000 runs of up to 2000
    /// outputs; otherwise as many components as leave out at most a hundredth of the mean square error of the fits.
    pub components: Option<Components>,
    /// Number of runs on which sparse solvers choose the terms of each output if there are more; coefficients and
    /// errors are those of all runs. With ten runs for each term of all outputs together every output is fitted with
    /// all of these terms, and its error is the leave-one-out error whatever the `selection`. Default: 2000.
    pub selection_runs: Option<usize>,
}

/// Number of runs on which terms are chosen, if the study does not say.
const SELECTION_RUNS: usize = 2000;

/// Highest degree that may be requested.
const MOST_DEGREES: usize = 1000;

/// Number of parameters above which the basis has fewer products by default: there are too many to choose from.
const FEW_PARAMETERS: usize = 15;
/// Norms for more parameters, if the study does not say.
const NORMS_OF_MANY: [f64; 2] = [0.5, 0.75];
/// Maximum number of terms of a degree for few and for many parameters, if the study does not say.
const USUAL_TERMS: [usize; 2] = [4000, 6000];

/// An error of the options in the context of the study.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Fault {
    /// Name of the option.
    key: &'static str,
    message: String,
    help: String,
}

impl PolynomialChaos {
    /// Returns the maximum number of terms of a degree in `dimension` parameters.
    fn most_terms(&self, dimension: usize) -> usize {
        self.max_terms.unwrap_or(USUAL_TERMS[usize::from(dimension > FEW_PARAMETERS)])
    }

    /// Returns the norms to be tried in `dimension` parameters, or a description of what is wrong with them.
    fn norms(&self, dimension: usize) -> Result<Vec<f64>, String> {
        match &self.q_norm {
            Some(norm) => norm.values(),
            None if dimension > FEW_PARAMETERS => Ok(NORMS_OF_MANY.to_vec()),
            None => Ok(vec![1.0]),
        }
    }

    /// Returns the nested sets of terms of one norm in `dimension` parameters.
    fn nested(&self, dimension: usize, q_norm: f64) -> Nested {
        let usual = if dimension > FEW_PARAMETERS { 2 } else { dimension };
        let max_interaction = self.max_interaction.unwrap_or(usual);
        let truncation = Truncation { q_norm, max_interaction };
        Nested::new(dimension, self.degree.range().max, truncation, self.most_terms(dimension))
    }

    /// Returns the sets of terms to be tried.
    fn sets(&self, dimension: usize) -> Sets {
        let norms = self.norms(dimension).unwrap_or_default();
        let families: Vec<(f64, Nested)> =
            norms.into_iter().map(|q| (q, self.nested(dimension, q))).collect();
        Sets::new(dimension, self.degree.range().min, &families)
    }

    fn coordinate(&self, parameter: &Parameter) -> Result<Coordinate, String> {
        // The cap bounds the work for a degree out of range, which is reported separately.
        Coordinate::new(self.basis, parameter, self.degree.range().max.min(MOST_DEGREES))
    }

    /// Returns the standard variables of the parameters with their polynomials.
    fn coordinates(&self, parameters: &[Parameter]) -> Result<Vec<Coordinate>, String> {
        parameters.iter().map(|p| self.coordinate(p)).collect()
    }

    /// Returns all errors of the options for these parameters and runs.
    fn faults(&self, parameters: &[Parameter], runs: Option<usize>) -> Vec<Fault> {
        let mut faults = self.faults_alone();
        if parameters.is_empty() {
            let message = "a polynomial chaos expansion needs at least one parameter".to_owned();
            faults.push(Fault { key: "use", message, help: "add a `[[parameter]]`".to_owned() });
        }
        for parameter in parameters {
            if let Err(message) = self.coordinate(parameter) {
                let help = "lower `degree`, or transform the parameter with `basis = \"hermite\"`";
                faults.push(Fault { key: "basis", message, help: help.to_owned() });
            }
        }
        if faults.is_empty() {
            faults.extend(self.fault_of_size(parameters.len(), runs));
        }
        faults
    }

    fn faults_alone(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let mut add = |key, message: String, help: &str| {
            faults.push(Fault { key, message, help: help.to_owned() });
        };
        let DegreeRange { min, max } = self.degree.range();
        if min == 0 || min > max || max > MOST_DEGREES {
            let message = format!(
                "the degrees must be an increasing range from 1 to 1000, not {min} to {max}"
            );
            add("degree", message, "write `degree = { min = 1, max = 20 }` or a whole number");
        }
        if let Err(message) = self.norms(0) {
            add("q_norm", message, "1 is the total degree; values from 0.4 to 1 are usual");
        }
        if self.max_interaction == Some(0) {
            let message =
                "`max_interaction` is 0, which leaves no term but the constant".to_owned();
            add("max_interaction", message, "1 allows no products, 2 products of two parameters");
        }
        if let Some(message) = self.components.as_ref().and_then(Components::fault) {
            add("components", message, "`{ variance = 0.9999 }` is a usual choice");
        }
        if let Some(runs) = self.selection_runs.filter(|&runs| runs < 100) {
            let message = format!("`selection_runs` must be at least 100, not {runs}");
            add("selection_runs", message, "from 1000 to 10000 runs are usual");
        }
        if let Selection::KFold(folds) = self.selection {
            if folds < 2 {
                let message = format!(
                    "`selection` by cross-validation needs at least 2 parts of the runs, not {folds}"
                );
                add("selection", message, "5 or 10 parts are usual");
            } else if self.solver == Solver::Quadrature {
                let message = "cross-validation is not possible with a quadrature rule, which needs all of its nodes".to_owned();
                add("selection", message, "use `selection = \"leave_one_out\"`");
            }
        }
        faults
    }

    /// Returns an error if the basis is too large for `max_terms` or for the number of runs.
    fn fault_of_size(&self, dimension: usize, runs: Option<usize>) -> Option<Fault> {
        let DegreeRange { min, max } = self.degree.range();
        // The smallest norm has the smallest number of terms.
        let norm = self.norms(dimension).ok()?.into_iter().next()?;
        let counts = self.nested(dimension, norm).counts;
        if counts.len() <= min {
            return Some(Fault {
                key: "degree",
                message: format!(
                    "degree {min} in {dimension} parameters has more than `max_terms` = {} terms",
                    self.most_terms(dimension)
                ),
                help: format!("the largest degree that fits is {}", counts.len() - 1),
            });
        }
        let runs = runs?;
        let chosen_on = runs.min(self.selection_runs.unwrap_or(SELECTION_RUNS));
        if let Selection::KFold(folds) = self.selection
            && folds > chosen_on
        {
            return Some(Fault {
                key: "selection",
                message: format!("{chosen_on} runs cannot be divided into {folds} parts"),
                help: "5 or 10 parts are usual".to_owned(),
            });
        }
        if self.solver != Solver::LeastSquares {
            return None;
        }
        let fits = counts.iter().take_while(|&&terms| terms < runs).count().max(1) - 1;
        if fits >= max {
            return None;
        }
        let terms = counts.get(max).map_or_else(
            || format!("more than {}", self.most_terms(dimension)),
            ToString::to_string,
        );
        Some(Fault {
            key: "degree",
            message: format!(
                "least squares of degree {max} has {terms} terms, but there are only {runs} runs"
            ),
            help: format!(
                "the largest degree that fits is {fits}; `solver = \"least_angle_regression\"` can \
                 choose among more terms than runs"
            ),
        })
    }
}

impl Component for PolynomialChaos {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for fault in self.faults(context.parameters, context.runs) {
            complaints.at(fault.key).say(fault.message).help(fault.help);
        }
    }
}

impl Surrogate for PolynomialChaos {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        self.fit_with_tasks(training, stream, progress, Tasks::here())
    }

    fn fit_with_tasks(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
        tasks: Tasks<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(fit::fit(self, training, stream, progress, tasks)?))
    }

    fn takes_gradients(&self) -> Result<(), String> {
        let takes =
            [Solver::LeastAngleRegression, Solver::OrthogonalMatchingPursuit, Solver::LeastSquares];
        if !takes.contains(&self.solver) {
            let names: Vec<String> = takes.map(|s| format!("`{}`", s.name())).into();
            let (own, others) = (self.solver.name(), names.join(", "));
            return Err(format!(
                "its solver `{own}` is fitted to the responses alone; {others} take derivatives"
            ));
        }
        if self.selection != Selection::LeaveOneOut {
            return Err("with derivatives it leaves out one run after the other, not the groups of `k_fold`".to_owned());
        }
        Ok(())
    }

    fn rotated(&self, runs: usize, outputs: usize) -> Option<Box<dyn Surrogate>> {
        Some(Box::new(rotated::Rotated::of(self, runs, outputs)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(Expansion::from_bytes(bytes)?))
    }

    fn sum(
        &self,
        parts: &[Summand<'_>],
        offset: &[f64],
    ) -> Result<Option<Box<dyn Emulator>>, Stop> {
        let sum = sum::sum(parts, offset)?;
        Ok(sum.map(|sum| Box::new(sum) as Box<dyn Emulator>))
    }
}

lacuna::register!(Surrogate, "polynomial_chaos", PolynomialChaos, aliases: ["pce", "pc", "polynomial_chaos_expansion"], revision = 5);
