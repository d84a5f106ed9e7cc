//! `polynomial_chaos`: expansions in orthonormal polynomials of the parameters.

mod bayesian;
pub(super) mod bytes;
mod candidates;
mod coordinate;
mod dictionary;
mod emulator;
mod family;
mod fit;
mod judge;
mod least_angle;
mod least_squares;
mod matching_pursuit;
mod measure;
mod options;
mod quadrature;
mod recurrence;
mod search;
mod sensitivity;
mod sparse;
mod squares;
mod subspace_pursuit;
mod sum;
mod terms;
mod trend;

#[cfg(test)]
mod tests;

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::{Summand, Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Stop};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::surrogates::principal_components::Components;

pub use coordinate::Coordinate;
pub use emulator::{Expansion, Reduction, Summary};
pub use family::Family;
pub(super) use fit::check_numbers;
pub use options::{Degree, DegreeRange, EarlyStop, QNorm, QNormRange, Selection, Solver};
pub use recurrence::Recurrence;
pub use terms::{Basis, Nested, Sets, TermSet, Terms, Truncation};

/// A polynomial chaos expansion: each output is a sum of products of orthonormal polynomials in the
/// parameters.
///
/// The polynomials are orthonormal under the *design's* distribution, so that the coefficients give mean,
/// variance and Sobol' indices without sampling. All outputs are fitted as one problem: they share the
/// basis and its Gram matrix. For each output, degree and norm the solver proposes sets of terms;
/// every proposed set is fitted by least squares and judged by its leave-one-out error,
/// corrected for the number of terms by `N / (N - P) (1 + tr (Psi' Psi)^-1)`, or by cross-validation. The output keeps
/// the set, the degree and the norm with the least error, and never only its mean where it varies. Outputs that
/// do not vary over the runs, but for round-off, are emulated by their mean and have the error 0.
///
/// The error was used to choose, so that it is too small where runs are few: with fewer than three runs a term
/// or ten a parameter believe the `validation` runs instead. The result tells when this is so.
///
/// Outside the design's range the polynomials are extrapolated, and grow quickly there; where a parameter is
/// transformed they keep their values on the design's bounds.
///
/// References: Blatman and Sudret, *Adaptive sparse polynomial chaos expansion based on least angle
/// regression*, Journal of Computational Physics 230 (2011) 2345; Efron, Hastie, Johnstone and
/// Tibshirani, *Least angle regression*, Annals of Statistics 32 (2004) 407; Chapelle, Vapnik and
/// Bengio, *Model selection for small sample regression*, Machine Learning 48 (2002) 9; Sudret,
/// *Global sensitivity analysis using polynomial chaos expansions*, Reliability Engineering and System
/// Safety 93 (2008) 964. Families: Xiu and Karniadakis, SIAM Journal on Scientific Computing 24 (2002) 619; Gautschi,
/// *Orthogonal Polynomials*, Oxford (2004); Ernst, Mugler, Starkloff and Ullmann, ESAIM: Mathematical Modelling and
/// Numerical Analysis 46 (2012) 317 (what log-normal parameters cannot reach). Solvers: Pati, Rezaiifar and
/// Krishnaprasad, 27th Asilomar Conference (1993) 40; Dai and Milenkovic, IEEE Transactions on Information Theory 55
/// (2009) 2230; Tipping and Faul, 9th Workshop on Artificial Intelligence and Statistics (2003); Lüthen, Marelli and
/// Sudret, SIAM/ASA Journal on Uncertainty Quantification 9 (2021) 593 (a comparison).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PolynomialChaos {
    /// The families of polynomials.
    pub basis: Family,
    /// How the coefficients are found.
    pub solver: Solver,
    /// The degree, or the range of degrees from which each output takes its best.
    pub degree: Degree,
    /// Which products belong to a degree `p`: those whose exponents have
    /// `(sum of exponent^q_norm)^(1 / q_norm) <= p`. With 1 this is the total degree; smaller values
    /// leave out products of many parameters. Of a list, or of a range such as `{ min = 0.5, max = 1.0, step =
    /// 0.1 }`, each output takes the one with the least error.
    pub q_norm: QNorm,
    /// The most parameters that may appear together in a product; all when not given.
    pub max_interaction: Option<usize>,
    /// Degrees with more terms than this are not tried.
    pub max_terms: usize,
    /// When to stop looking for something better.
    pub early_stop: EarlyStop,
    /// The error by which terms, degrees and norms are chosen.
    pub selection: Selection,
    /// Principal components of the outputs that are fitted instead of the outputs: `{ variance = 0.9999 }` for as
    /// many as carry this share, or `{ count = 20 }`. Saves time with thousands of outputs; what they
    /// leave out becomes part of the emulator's error. All outputs themselves when not given.
    pub components: Option<Components>,
}

impl Default for PolynomialChaos {
    fn default() -> Self {
        Self {
            basis: Family::default(),
            solver: Solver::default(),
            degree: Degree::default(),
            q_norm: QNorm::Fixed(1.0),
            max_interaction: None,
            max_terms: 4000,
            early_stop: EarlyStop::default(),
            selection: Selection::default(),
            components: None,
        }
    }
}

/// The highest degree that may be asked for.
const MOST_DEGREES: usize = 1000;

/// What is wrong with the options in view of the rest of the study.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Fault {
    /// The option.
    key: &'static str,
    message: String,
    help: String,
}

impl PolynomialChaos {
    /// The nested sets of terms of one norm for so many parameters.
    fn nested(&self, dimension: usize, q_norm: f64) -> Nested {
        let max_interaction = self.max_interaction.unwrap_or(dimension);
        let truncation = Truncation { q_norm, max_interaction };
        Nested::new(dimension, self.degree.range().max, truncation, self.max_terms)
    }

    /// The sets of terms that are to be tried.
    fn sets(&self, dimension: usize) -> Sets {
        let norms = self.q_norm.values().unwrap_or_default();
        let families: Vec<(f64, Nested)> =
            norms.into_iter().map(|q| (q, self.nested(dimension, q))).collect();
        Sets::new(dimension, self.degree.range().min, &families)
    }

    fn coordinate(&self, parameter: &Parameter) -> Result<Coordinate, String> {
        // Among so many degrees there is always one that is too high.
        Coordinate::new(self.basis, parameter, self.degree.range().max.min(MOST_DEGREES))
    }

    /// Where the parameters sit in their families.
    fn coordinates(&self, parameters: &[Parameter]) -> Result<Vec<Coordinate>, String> {
        parameters.iter().map(|p| self.coordinate(p)).collect()
    }

    /// All that is wrong with the options for these parameters and runs.
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
            let message = format!("the degrees {min} to {max} are no range between 1 and 1000");
            add("degree", message, "write `degree = { min = 1, max = 20 }` or a whole number");
        }
        if let Err(message) = self.q_norm.values() {
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
        if let Selection::KFold(folds) = self.selection {
            if folds < 2 {
                let message =
                    format!("`selection` by {folds} parts of the runs leaves none to fit");
                add("selection", message, "5 or 10 parts are usual");
            } else if self.solver == Solver::Quadrature {
                let message = "no part of a quadrature rule's nodes can be left out".to_owned();
                add("selection", message, "use `selection = \"leave_one_out\"`");
            }
        }
        faults
    }

    /// Whether the basis is too large: for the option's limit, or for the runs.
    fn fault_of_size(&self, dimension: usize, runs: Option<usize>) -> Option<Fault> {
        let DegreeRange { min, max } = self.degree.range();
        // The smallest norm has the fewest terms.
        let norm = self.q_norm.values().ok()?.into_iter().next()?;
        let counts = self.nested(dimension, norm).counts;
        if counts.len() <= min {
            return Some(Fault {
                key: "degree",
                message: format!(
                    "degree {min} in {dimension} parameters has more than `max_terms` = {} terms",
                    self.max_terms
                ),
                help: format!("the largest degree that fits is {}", counts.len() - 1),
            });
        }
        let runs = runs?;
        if let Selection::KFold(folds) = self.selection
            && folds > runs
        {
            return Some(Fault {
                key: "selection",
                message: format!("{runs} runs cannot be cut into {folds} parts"),
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
        let terms = counts
            .get(max)
            .map_or_else(|| format!("more than {}", self.max_terms), ToString::to_string);
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
        Ok(Box::new(fit::fit(self, training, stream, progress)?))
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

lacuna::register!(Surrogate, "polynomial_chaos", PolynomialChaos, aliases: ["pce", "pc", "polynomial_chaos_expansion"]);
