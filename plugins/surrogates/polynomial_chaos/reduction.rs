//! Principal components that are fitted in place of the outputs.

use lacuna::run::{Progress, Stop};
use lacuna_linalg::Matrix;

use super::PolynomialChaos;
use super::output::{Output, outputs};
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
    pub(super) fn reduction(&self, runs: usize, responses: &Matrix) -> Option<Reduction> {
        let outputs = responses.columns();
        let many = runs * outputs > MANY_VALUES && (runs > MANY_RUNS || outputs > MANY_OUTPUTS);
        let stated = self.components.map(Reduction::Stated);
        stated.or_else(|| many.then_some(Reduction::ByError))
    }
}

impl Reduction {
    /// Returns the components of responses (`runs x outputs`): by error all that there are.
    pub fn components(self, responses: &Matrix) -> Result<PrincipalComponents, Stop> {
        match self {
            Self::Stated(components) => components.of(responses),
            Self::ByError => Components::Variance(1.0).of(responses),
        }
    }

    /// Returns the components of responses (`runs x outputs`) and the best terms of each.
    pub fn chosen(
        self,
        responses: &Matrix,
        search: &Search<'_>,
        progress: &Progress<'_>,
    ) -> Result<(PrincipalComponents, Vec<Option<Best>>), Stop> {
        let all = self.components(responses)?;
        let scores = outputs(&all.scores);
        match self {
            Self::Stated(_) => {
                let found = search.choose_all(&scores, progress)?;
                Ok((all, found))
            }
            Self::ByError => {
                let found = until_little_is_left(&scores, search, progress)?;
                Ok((all.first(found.len()), found))
            }
        }
    }
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
