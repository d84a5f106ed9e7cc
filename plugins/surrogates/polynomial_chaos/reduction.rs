//! Principal components that are fitted in place of the outputs.

use lacuna::run::{Progress, Stop};
use lacuna_linalg::Matrix;

use super::PolynomialChaos;
use super::output::Output;
use super::search::{Best, Search};
use crate::surrogates::principal_components::{Components, PrincipalComponents};

/// Number of values (runs times outputs) above which components are fitted by default if there are also more than
/// [`MANY_RUNS`] runs or more than [`MANY_OUTPUTS`] outputs.
const MANY_VALUES: usize = 1_000_000;
const MANY_RUNS: usize = 1000;
const MANY_OUTPUTS: usize = 2000;
/// Fraction of the error of the components' fits that the components left out add at most.
const ADDED: f64 = 0.01;
/// Number of components of the first block; each further block doubles the number.
const FIRST: usize = 64;

/// How many components are fitted.
#[derive(Debug, Clone, Copy)]
pub(super) enum Reduction {
    /// As many as the study says.
    Stated(Components),
    /// Until those that are left out add one percent to the mean square error of the fits.
    ByError,
}

impl PolynomialChaos {
    /// Returns the components that are fitted in place of the outputs, if any.
    pub(super) fn reduction(&self, runs: usize, outputs: usize) -> Option<Reduction> {
        let many = runs * outputs > MANY_VALUES && (runs > MANY_RUNS || outputs > MANY_OUTPUTS);
        match self.components {
            Some(Components::None) => None,
            Some(components) => Some(Reduction::Stated(components)),
            None => many.then_some(Reduction::ByError),
        }
    }
}

impl Reduction {
    /// Chooses the components of responses (`runs x outputs`) and the terms of each; `scores_of` returns their scores as
    /// outputs.
    pub fn chosen(
        self,
        responses: &Matrix,
        scores_of: impl Fn(&PrincipalComponents) -> Vec<Output>,
        search: &Search<'_>,
        progress: &Progress<'_>,
    ) -> Result<Chosen, Stop> {
        let components = match self {
            Self::Stated(components) => components.of(responses)?,
            Self::ByError => Components::resolved(responses)?,
        };
        let mut scores = scores_of(&components);
        match self {
            Self::Stated(_) => {
                let found = search.choose_all(&scores, progress)?;
                Ok(Chosen { components, scores, found })
            }
            Self::ByError => {
                let found = until_little_is_left(&scores, search, progress)?;
                scores.truncate(found.len());
                Ok(Chosen { components: components.first(found.len()), scores, found })
            }
        }
    }
}

/// Components with their scores and the best terms of each.
pub(super) struct Chosen {
    pub components: PrincipalComponents,
    pub scores: Vec<Output>,
    pub found: Vec<Option<Best>>,
}

/// Chooses terms for blocks of components, in decreasing order of their variances, until the variance of the others is
/// small against the error of those before.
fn until_little_is_left(
    scores: &[Output],
    search: &Search<'_>,
    progress: &Progress<'_>,
) -> Result<Vec<Option<Best>>, Stop> {
    let mut found: Vec<Option<Best>> = Vec::new();
    let (mut left, mut error) = (scores.iter().map(|o| o.variance).sum::<f64>(), 0.0);
    while found.len() < scores.len() {
        let end = scores.len().min((2 * found.len()).max(FIRST));
        let block = &scores[found.len()..end];
        for (output, best) in block.iter().zip(search.choose_all(block, progress)?) {
            left -= output.variance;
            error += best.as_ref().map_or(0.0, |b| b.error.min(1.0)) * output.variance;
            found.push(best);
        }
        if left <= ADDED * error {
            break;
        }
    }
    Ok(found)
}
