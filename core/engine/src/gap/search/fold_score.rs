//! The log score of a part that is left out, for two explanations.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed, multiply_vector};

use super::cross_validate::Explanation;
use super::folds::Fold;
use crate::gap::experiment::{Condition, Experiment};
use crate::gap::noise::Noise;
use crate::gap::noise::part::part;
use crate::gap::system::fit::{fit, precision};
use crate::gap::system::whitener::Whitener;

/// The difference in log score between two explanations in one part.
pub(super) struct FoldScore {
    pub difference: f64,
    /// The condition, if a single replicate was left out.
    pub replicate: Option<usize>,
    /// The difference without each replicate, by condition; empty if the part has no value of a condition.
    pub without: Vec<Vec<f64>>,
}

/// The means of some data, and their whiteners for two explanations.
pub(super) struct Whitened {
    means: Vec<f64>,
    whiteners: [Whitener; 2],
}

impl Whitened {
    pub fn of(
        explanations: &[Explanation<'_, '_>; 2],
        experiment: &Experiment<'_>,
        noise: &Noise,
    ) -> Self {
        let response = &explanations[0].fit.at.response;
        let whiteners = explanations.map(|explanation| {
            let mut whole = experiment.clone();
            whole.common.extend(explanation.remainder.cloned());
            Whitener::rotated(&whole, noise, response)
        });
        Self { means: experiment.means().1, whiteners }
    }
}

/// The difference between the log scores of two explanations in a part that is left out. `whole` is that of all data, if
/// nothing is hidden.
pub(super) fn score_of(
    explanations: &[Explanation<'_, '_>; 2],
    noise: &Noise,
    fold: &Fold,
    whole: Option<&Whitened>,
) -> Option<FoldScore> {
    let experiment = explanations[0].system.experiment;
    // The score of the left-out part given the rest is the log density of both together minus that of the rest.
    let seen = whole.is_none().then(|| {
        let (both, noise) = part(experiment, noise, |c, r, i| !(fold.hidden)(c, r, i));
        Whitened::of(explanations, &both, &noise)
    });
    let both = whole.or(seen.as_ref())?;
    let (rest, noise_rest) =
        part(experiment, noise, |c, r, i| !(fold.hidden)(c, r, i) && !(fold.left_out)(c, r, i));
    let rest = Whitened::of(explanations, &rest, &noise_rest);
    let whiteners = [0, 1].map(|k| [&both.whiteners[k], &rest.whiteners[k]]);
    let means = [&both.means[..], &rest.means[..]];
    let scores: Vec<Score> = explanations
        .iter()
        .zip(&whiteners)
        .map(|(explanation, whiteners)| Score::new(explanation, *whiteners, means))
        .collect::<Option<Vec<Score>>>()?;
    // Without remainders both have the same covariance, whose determinant cancels.
    let determinants = if explanations.iter().any(|e| e.remainder.is_some()) {
        let own = |[both, rest]: [&Whitener; 2]| both.log_determinant() - rest.log_determinant();
        own(whiteners[0]) - own(whiteners[1])
    } else {
        0.0
    };
    let difference = |shifts: [&[f64]; 2]| {
        scores[0].value(shifts[0]) - scores[1].value(shifts[1]) + determinants
    };
    let nothing = vec![0.0; experiment.outputs()];
    let without = if fold.replicate.is_some() {
        Vec::new()
    } else {
        shifts(experiment, fold)
            .into_iter()
            .map(|own| {
                let moved = |shift: &Vec<f64>| {
                    let white = [0, 1].map(|i: usize| whiteners[i][0].whiten(shift));
                    difference([&white[0], &white[1]])
                };
                own.iter().map(moved).collect()
            })
            .collect()
    };
    Some(FoldScore {
        difference: difference([&nothing, &nothing]),
        replicate: fold.replicate,
        without,
    })
}

/// The change of the means of the left-out part without each replicate, by condition, one value an output.
fn shifts(experiment: &Experiment<'_>, fold: &Fold) -> Vec<Vec<Vec<f64>>> {
    let (counts, means) = experiment.means();
    let of = |(c, condition): (usize, &Condition)| {
        let touched = condition.outputs.clone().any(|i| (fold.left_out)(c, 0, i));
        let count = if touched { condition.replicates.len() } else { 0 };
        let without = |r: usize| {
            let mut shift = vec![0.0; means.len()];
            for (i, y) in condition.outputs.clone().zip(&condition.replicates[r]) {
                if let Some(y) = y.filter(|_| counts[i] > 1.0 && (fold.left_out)(c, r, i)) {
                    shift[i] = (means[i] - y) / (counts[i] - 1.0);
                }
            }
            shift
        };
        (0..count).map(without).collect()
    };
    experiment.conditions.iter().enumerate().map(of).collect()
}

/// The log density of the left-out part as a function of its whitened means.
struct Score {
    residual: Vec<f64>,
    slopes: Matrix,
    /// The squared residual of the rest, and its products with the slopes.
    square: f64,
    products: Vec<f64>,
    factor: Cholesky,
    log_determinant: f64,
}

impl Score {
    /// `whiteners` and `means` of the rest with what is left out, and of the rest alone.
    fn new(
        explanation: &Explanation<'_, '_>,
        whiteners: [&Whitener; 2],
        means: [&[f64]; 2],
    ) -> Option<Self> {
        let refitted = fit(explanation.system, whiteners[1], means[1], &explanation.fit.at.point);
        let misfit: Vec<f64> =
            means[0].iter().zip(&refitted.at.response).map(|(y, m)| y - m).collect();
        let residual = whiteners[0].whiten(&misfit);
        let slopes = whiteners[0].whiten_rows(&refitted.at.tangents);
        let finite = refitted.log_density.is_finite()
            && slopes.as_slice().iter().chain(&residual).all(|x| x.is_finite());
        if !finite {
            return None;
        }
        let held = |slopes: &Matrix| {
            let mut all = multiply_transposed(slopes, slopes);
            let priors = explanation.system.priors().iter().enumerate();
            priors.for_each(|(j, prior)| all[(j, j)] += precision(prior));
            // Units of the priors' widths: unknowns of any size go together.
            let width: Vec<f64> =
                explanation.system.priors().iter().map(|p| 1.0 / precision(p).sqrt()).collect();
            Cholesky::new(&Matrix::from_fn(all.rows(), all.rows(), |i, j| {
                width[i] * all[(i, j)] * width[j]
            }))
            .ok()
            .map(|factor| (factor, width))
        };
        let (factor, width) = held(&slopes)?;
        let (of_rest, _) = held(&refitted.slopes)?;
        let scaled = |slopes: &Matrix| {
            Matrix::from_fn(slopes.rows(), slopes.columns(), |j, i| width[j] * slopes[(j, i)])
        };
        let products = multiply_vector(&scaled(&refitted.slopes), &refitted.residual);
        let square = dot(&refitted.residual, &refitted.residual);
        let log_determinant = factor.log_determinant() - of_rest.log_determinant();
        let slopes = scaled(&slopes);
        Some(Self { residual, slopes, square, products, factor, log_determinant })
    }

    /// The log density with the whitened means moved by `shift`, up to a constant that depends on the noise only.
    fn value(&self, shift: &[f64]) -> f64 {
        let moved: Vec<f64> = self.residual.iter().zip(shift).map(|(z, s)| z + s).collect();
        let mut gain = multiply_vector(&self.slopes, &moved);
        gain.iter_mut().zip(&self.products).for_each(|(g, p)| *g -= p);
        self.factor.whiten(&mut gain);
        0.5 * (dot(&gain, &gain) - dot(&moved, &moved) + self.square - self.log_determinant)
    }
}
