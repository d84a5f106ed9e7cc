//! A hypothesis: a system at its best fit, with the normal posterior of its unknowns, of the known errors and of what it
//! leaves.

use lacuna_linalg::{Cholesky, Matrix, gram, multiply_vector, transposed_multiply_vector};

use super::information::Predicted;
use super::without_errors;
use crate::gap::noise::Noise;
use crate::gap::search::Explanation;
use crate::gap::system::whitener::Whitener;

/// A hypothesis with a normal posterior. Its unknowns are the parameters of the model, those of the effects, and
/// standard normal sizes of what all replicates share: the known errors, then the remainder.
pub(super) struct Hypothesis {
    /// The expected response, errors and remainder included, one value an output, in its unit.
    pub response: Vec<f64>,
    /// The derivatives of the response by the unknowns, `unknowns x outputs`.
    pub tangents: Matrix,
    /// The posterior precision of the unknowns, `unknowns x unknowns`.
    pub precision: Matrix,
    /// The number of parameters of the model, which are the first unknowns.
    pub parameters: usize,
    /// The index of the first known error among the unknowns.
    pub first_error: usize,
    /// The posterior means of the sizes of the known errors and of the remainder.
    pub errors: Vec<f64>,
}

impl Hypothesis {
    /// The posterior of an explanation, with the noise around a response; `None` if it is not finite.
    pub fn of(own: &Explanation<'_, '_>, around: &[f64], noise: &Noise) -> Option<Self> {
        let experiment = own.system.experiment;
        let shared = experiment.common.iter().chain(own.remainder);
        let shared = shared.flat_map(|error| {
            (0..error.factor.columns()).map(|j| error.factor.column(j)).collect::<Vec<_>>()
        });
        let shared = Matrix::from_rows(experiment.outputs(), shared);
        let whitener = Whitener::new(&without_errors(experiment), noise, around);
        let at = &own.fit.at;
        let rows = at.tangents.iter_rows().chain(shared.iter_rows()).map(<[f64]>::to_vec);
        let tangents = Matrix::from_rows(experiment.outputs(), rows);
        let mut precision = gram(&whitener.whiten_rows(&tangents).transposed());
        let priors = own.fit.prior_curvature.iter().zip(&own.fit.prior_precision);
        let priors = priors.map(|(curvature, least)| curvature.max(*least));
        for (j, p) in priors.chain(vec![1.0; shared.rows()]).enumerate() {
            precision[(j, j)] += p;
        }
        let errors = sizes(own, &whitener, &shared)?;
        let mut response = at.response.clone();
        let error = transposed_multiply_vector(&shared, &errors);
        response.iter_mut().zip(error).for_each(|(y, e)| *y += e);
        let finite = response.iter().chain(tangents.as_slice()).all(|x| x.is_finite());
        let (parameters, first_error) = (experiment.parameters.len(), at.tangents.rows());
        finite.then_some(Self { response, tangents, precision, parameters, first_error, errors })
    }

    /// The expected decrease of the entropy of the model's parameters, in bits.
    pub fn parameter_bits(&self, new: &Predicted) -> Option<f64> {
        let added = gram(&new.slopes.transposed());
        let n = self.precision.rows();
        let after = Matrix::from_fn(n, n, |i, j| self.precision[(i, j)] + added[(i, j)]);
        let before = log_determinant_of_marginal(&self.precision, self.parameters)?;
        let after = log_determinant_of_marginal(&after, self.parameters)?;
        Some(0.5 * (after - before) / std::f64::consts::LN_2)
    }
}

/// The posterior means of the sizes of what all replicates share, `shared` being its rows, given the residual of an
/// explanation.
fn sizes(own: &Explanation<'_, '_>, whitener: &Whitener, shared: &Matrix) -> Option<Vec<f64>> {
    if shared.rows() == 0 {
        return Some(Vec::new());
    }
    let (counts, means) = own.system.experiment.means();
    let response = &own.fit.at.response;
    let residual: Vec<f64> = (0..means.len())
        .map(|i| if counts[i] > 0.0 { means[i] - response[i] } else { 0.0 })
        .collect();
    let white = whitener.whiten_rows(shared);
    let mut precision = gram(&white.transposed());
    (0..shared.rows()).for_each(|j| precision[(j, j)] += 1.0);
    let mut sizes = multiply_vector(&white, &whitener.whiten(&residual));
    Cholesky::new(&precision).ok()?.solve(&mut sizes);
    Some(sizes)
}

/// The log determinant of the precision of the first `count` unknowns, the others integrated out:
/// `log det P - log det P_oo`, with the block `P_oo` of the others. Unknowns are scaled to a unit diagonal first, which
/// adds the same constant to every precision with one diagonal.
fn log_determinant_of_marginal(precision: &Matrix, count: usize) -> Option<f64> {
    let n = precision.rows();
    let scale: Vec<f64> = (0..n).map(|j| precision[(j, j)].sqrt()).collect();
    let block = |first: usize| {
        let scaled = Matrix::from_fn(n - first, n - first, |i, j| {
            precision[(first + i, first + j)] / (scale[first + i] * scale[first + j])
        });
        if first == n { Some(0.0) } else { Some(Cholesky::new(&scaled).ok()?.log_determinant()) }
    };
    let scales: f64 = scale[..count].iter().map(|s| 2.0 * s.ln()).sum();
    Some(block(0)? - block(count)? + scales)
}
