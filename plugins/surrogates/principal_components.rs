//! Principal components of the outputs: a thousand correlated outputs are reduced to a few tens of scores.

use std::ops::Range;

use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::wide::{self, Axes};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Number of principal components of the outputs that are emulated in place of the outputs themselves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Components {
    /// No reduction: each output that varies is its own component.
    None,
    /// As many components as carry this fraction of the variance of all outputs over the runs, above 0 and at most 1,
    /// such as `{ variance = 0.9999 }`.
    Variance(f64),
    /// A fixed number of components, such as `{ count = 20 }`.
    Count(usize),
}

/// Responses `Y = 1 mean' + T V' + E` with few scores `T`.
#[derive(Debug, Clone, PartialEq)]
pub struct PrincipalComponents {
    /// Mean of each output over the runs.
    pub mean: Vec<f64>,
    /// `V`: orthonormal columns in decreasing order of the variance they carry (`outputs x components`).
    pub directions: Matrix,
    /// `T` (`runs x components`).
    pub scores: Matrix,
    /// `E`, the part that the components leave out (`runs x outputs`); `None` if only its size is known.
    pub remainder: Option<Matrix>,
    /// Mean square of `E` over the runs, by output.
    pub truncation: Vec<f64>,
}

/// Number of values (runs times outputs) above which components are computed from the products of the runs.
const LARGE: usize = 10_000_000;
/// Number of runs whose kept part is in memory at a time.
const BLOCK: usize = 64;

impl Components {
    /// Returns a description of what is wrong with the choice, if anything.
    pub fn fault(&self) -> Option<String> {
        match *self {
            Self::Variance(share) if !(share > 0.0 && share <= 1.0) => Some(format!(
                "the share of the variance is {share}, but must be above 0, at most 1"
            )),
            Self::Count(0) => Some("the number of components must be at least 1".to_owned()),
            _ => None,
        }
    }

    /// Computes the components of responses (`runs x outputs`).
    pub fn of(&self, responses: &Matrix) -> Result<PrincipalComponents, Stop> {
        let (runs, outputs) = (responses.rows(), responses.columns());
        let large = outputs > runs && runs * outputs > LARGE && !self.needs_all_digits();
        self.computed(responses, large)
    }

    /// Computes all components of responses (`runs x outputs`) that carry more than rounding errors; of more outputs than
    /// runs those whose variance is above `1e-14` of the largest. Of many values the remainder is not kept.
    pub fn resolved(responses: &Matrix) -> Result<PrincipalComponents, Stop> {
        let (runs, outputs) = (responses.rows(), responses.columns());
        if outputs > runs && runs * outputs > LARGE {
            return by_blocks(responses);
        }
        Self::Variance(1.0).computed(responses, outputs > runs)
    }

    fn computed(self, responses: &Matrix, by_runs: bool) -> Result<PrincipalComponents, Stop> {
        let (runs, outputs) = (responses.rows(), responses.columns());
        let mean = wide::column_means(responses);
        let centred = wide::centred(responses, &mean, &(0..outputs));
        if self == Self::None {
            return Ok(PrincipalComponents::of_outputs(mean, &centred));
        }
        if by_runs {
            return self.by_runs(mean, centred).map_err(failed);
        }
        let svd = lacuna_linalg::thin_svd(&centred).map_err(failed)?;
        let rank = self.rank(&svd.values);
        let scores = Matrix::from_fn(runs, rank, |i, k| svd.u[(i, k)] * svd.values[k]);
        let directions = Matrix::from_fn(outputs, rank, |j, k| svd.v[(j, k)]);
        Ok(PrincipalComponents::without(centred, mean, directions, scores))
    }

    /// Returns true if components are wanted that the eigenvalues of products do not resolve.
    fn needs_all_digits(&self) -> bool {
        matches!(self, Self::Variance(share) if *share > 1.0 - 1e-12)
    }

    /// Computes the components from the products of the runs with each other, `C C'`, whose eigenvectors are the left
    /// singular vectors: for many more outputs than runs, with memory for one matrix of the size of the directions.
    /// Components that the products do not resolve are left to the remainder.
    fn by_runs(
        &self,
        mean: Vec<f64>,
        centred: Matrix,
    ) -> Result<PrincipalComponents, lacuna_linalg::Error> {
        let products = lacuna_linalg::multiply_transposed(&centred, &centred);
        let axes = Axes::of(&[products])?;
        let kept: Vec<usize> = (0..self.rank(&axes.values)).collect();
        let scores = axes.scores.select_columns(&kept);
        let directions =
            lacuna_linalg::transposed_multiply(&centred, &axes.inverse.select_columns(&kept));
        Ok(PrincipalComponents::without(centred, mean, directions, scores))
    }

    fn rank(&self, singular_values: &[f64]) -> usize {
        // Singular values below round-off carry no information.
        let largest = singular_values.first().copied().unwrap_or(0.0);
        let real = singular_values.iter().take_while(|&&s| s > 1e-14 * largest).count();
        match *self {
            Self::None => real,
            Self::Count(count) => count.min(real),
            Self::Variance(share) => {
                let total: f64 = singular_values.iter().map(|s| s * s).sum();
                let mut sum = 0.0;
                let short = |s: &&f64| {
                    let before = sum;
                    sum += *s * *s;
                    before < share * total
                };
                singular_values[..real].iter().take_while(short).count()
            }
        }
    }
}

/// Returns the message for components that cannot be computed.
fn failed(error: lacuna_linalg::Error) -> Stop {
    Stop::new(format!("the principal components of the outputs: {error}"))
}

/// Computes all components that the products of the runs resolve, without a matrix of the size of the responses.
fn by_blocks(responses: &Matrix) -> Result<PrincipalComponents, Stop> {
    let mean = wide::column_means(responses);
    let blocks = wide::blocks(mean.len());
    let product = |some: &[Range<usize>]| wide::products(responses, &mean, some);
    let parts: Vec<Matrix> = blocks.par_chunks(wide::TOGETHER).map(product).collect();
    let Axes { scores, inverse, .. } = Axes::of(&parts).map_err(failed)?;
    let of_block = |own: &Range<usize>| {
        let centred = wide::centred(responses, &mean, own);
        let directions = lacuna_linalg::transposed_multiply(&centred, &inverse);
        let own = PrincipalComponents::without(centred, Vec::new(), directions, scores.clone());
        (own.directions, own.truncation)
    };
    let mut directions = Matrix::zeros(0, scores.columns());
    directions.reserve_rows(mean.len());
    let mut truncation = Vec::with_capacity(mean.len());
    for some in blocks.chunks(wide::TOGETHER) {
        let found: Vec<_> = some.par_iter().map(of_block).collect();
        for (own, left) in found {
            own.iter_rows().for_each(|row| directions.push_row(row));
            truncation.extend(left);
        }
    }
    Ok(PrincipalComponents { mean, directions, scores, remainder: None, truncation })
}

impl PrincipalComponents {
    /// Takes components out of centred responses.
    fn without(centred: Matrix, mean: Vec<f64>, directions: Matrix, scores: Matrix) -> Self {
        let mut remainder = centred;
        let runs = scores.rows();
        for first in (0..runs).step_by(BLOCK) {
            let rows: Vec<usize> = (first..runs.min(first + BLOCK)).collect();
            let kept = lacuna_linalg::multiply_transposed(&scores.select_rows(&rows), &directions);
            for (&i, kept) in rows.iter().zip(kept.iter_rows()) {
                remainder.row_mut(i).iter_mut().zip(kept).for_each(|(e, k)| *e -= k);
            }
        }
        Self::with_remainder(mean, directions, scores, remainder)
    }

    fn with_remainder(
        mean: Vec<f64>,
        directions: Matrix,
        scores: Matrix,
        remainder: Matrix,
    ) -> Self {
        let mut squares = vec![0.0; remainder.columns()];
        for row in remainder.iter_rows() {
            squares.iter_mut().zip(row).for_each(|(sum, e)| *sum += e * e);
        }
        let runs = remainder.rows() as f64;
        let truncation = squares.into_iter().map(|sum| sum / runs).collect();
        Self { mean, directions, scores, remainder: Some(remainder), truncation }
    }

    /// Takes each output that varies by more than round-off as its own component, in the order of the outputs.
    fn of_outputs(mean: Vec<f64>, centred: &Matrix) -> Self {
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let size = largest(centred.as_slice()).max(largest(&mean));
        let varies = |j: &usize| largest(&centred.column(*j)) > 1e-13 * size;
        let varying: Vec<usize> = (0..mean.len()).filter(varies).collect();
        let scores = centred.select_columns(&varying);
        let entry = |j: usize, k: usize| f64::from(u8::from(varying[k] == j));
        let directions = Matrix::from_fn(mean.len(), varying.len(), entry);
        let mut remainder = centred.clone();
        for i in 0..remainder.rows() {
            for &j in &varying {
                remainder[(i, j)] = 0.0;
            }
        }
        Self::with_remainder(mean, directions, scores, remainder)
    }

    /// Returns the first components alone; the others become part of the remainder.
    pub fn first(self, count: usize) -> Self {
        let kept: Vec<usize> = (0..count).collect();
        let left: Vec<usize> = (count..self.scores.columns()).collect();
        let Self { mean, directions, scores, remainder, mut truncation } = self;
        let Some(mut remainder) = remainder else {
            // Scores of different components are orthogonal over the runs.
            let variance = |k: &usize| scores.column(*k).iter().map(|s| s * s).sum::<f64>();
            let variances: Vec<f64> = left.iter().map(variance).collect();
            for (sum, row) in truncation.iter_mut().zip(directions.iter_rows()) {
                let squares = row[count..].iter().zip(&variances).map(|(v, s)| v * v * s);
                *sum += squares.sum::<f64>() / scores.rows() as f64;
            }
            let directions = directions.select_columns(&kept);
            let scores = scores.select_columns(&kept);
            return Self { mean, directions, scores, remainder: None, truncation };
        };
        let others = lacuna_linalg::multiply_transposed(
            &scores.select_columns(&left),
            &directions.select_columns(&left),
        );
        remainder.as_mut_slice().iter_mut().zip(others.as_slice()).for_each(|(e, o)| *e += o);
        let (directions, scores) = (directions.select_columns(&kept), scores.select_columns(&kept));
        Self::with_remainder(mean, directions, scores, remainder)
    }

    /// Returns the same mean and directions with the scores and the remainder of other runs.
    pub fn of_all(self, responses: &Matrix) -> Self {
        let Self { mean, directions, .. } = self;
        let centred = wide::centred(responses, &mean, &(0..mean.len()));
        let scores = lacuna_linalg::multiply(&centred, &directions);
        Self::without(centred, mean, directions, scores)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};

    /// Responses of rank three, of which three components leave out only rounding errors (Eckart and Young 1936).
    #[test]
    fn responses_of_low_rank_have_few_components() {
        let mut rng = Stream::root(1).generator();
        let mut random = |rows, columns| Matrix::from_fn(rows, columns, |_, _| normal(&mut rng));
        let responses = lacuna_linalg::multiply(&random(40, 3), &random(3, 25));
        let found = Components::Variance(1.0).of(&responses).unwrap();
        assert_eq!(found.scores.columns(), 3);
        assert!(found.truncation.iter().all(|t| *t < 1e-24));
        let two = Components::Count(2).of(&responses).unwrap();
        let left: f64 = two.truncation.iter().sum();
        let third: f64 = found.scores.column(2).iter().map(|s| s * s).sum::<f64>() / 40.0;
        assert!((left - third).abs() < 1e-12 * third);
    }

    /// The products of the runs have the same components as the singular value decomposition, up to the sign of each.
    #[test]
    fn components_of_the_products_are_those_of_the_decomposition() {
        let mut rng = Stream::root(2).generator();
        let mut random = |rows, columns| Matrix::from_fn(rows, columns, |_, _| normal(&mut rng));
        let scale = |m: Matrix| {
            Matrix::from_fn(m.rows(), m.columns(), |i, j| m[(i, j)] * 0.3_f64.powi(j as i32))
        };
        let responses = lacuna_linalg::multiply(&scale(random(20, 6)), &random(6, 90));
        let choice = Components::Variance(0.999);
        let expected = choice.of(&responses).unwrap();
        let mean = expected.mean.clone();
        let centred = Matrix::from_fn(20, 90, |i, j| responses[(i, j)] - mean[j]);
        let found = choice.by_runs(mean, centred).unwrap();
        assert_eq!(found.scores.columns(), expected.scores.columns());
        for k in 0..found.scores.columns() {
            let sign = (found.directions[(0, k)] / expected.directions[(0, k)]).signum();
            for i in 0..20 {
                let size = expected.scores[(0, 0)].abs();
                assert!(
                    (sign * found.scores[(i, k)] - expected.scores[(i, k)]).abs() < 1e-9 * size
                );
            }
            let length: f64 = found.directions.column(k).iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 1e-10);
        }
        for (a, b) in found.truncation.iter().zip(expected.truncation) {
            assert!((a - b).abs() < 1e-9 * (1.0 + b), "{a} {b}");
        }
    }

    /// Block by block the components are the same; the variance of those that are dropped adds to what is left out.
    #[test]
    fn components_by_blocks_are_those_of_the_decomposition() {
        let mut rng = Stream::root(4).generator();
        let mut random = |rows, columns| Matrix::from_fn(rows, columns, |_, _| normal(&mut rng));
        let (scores, directions) = (random(15, 3), random(20_000, 3));
        let mut responses = lacuna_linalg::multiply_transposed(&scores, &directions);
        let noise = random(15, 20_000);
        let both = responses.as_mut_slice().iter_mut().zip(noise.as_slice());
        both.for_each(|(y, e)| *y += 3.0 + 0.01 * e);
        let found = by_blocks(&responses).unwrap();
        let expected = Components::Variance(1.0).of(&responses).unwrap();
        assert_eq!((found.scores.columns(), found.remainder.as_ref()), (14, None));
        assert!(found.truncation.iter().all(|left| *left < 1e-15));
        let (found, expected) = (found.first(3), expected.first(3));
        for k in 0..3 {
            let sign = (found.directions[(0, k)] / expected.directions[(0, k)]).signum();
            for j in [0, 8191, 8192, 19_999] {
                let (a, b) = (found.directions[(j, k)], expected.directions[(j, k)]);
                assert!((sign * a - b).abs() < 1e-9, "{a} {b}");
            }
        }
        for j in [0, 8191, 8192, 19_999] {
            let (a, b) = (found.truncation[j], expected.truncation[j]);
            assert!((a - b).abs() < 1e-9 * b, "{a} {b}");
        }
    }

    /// Fewer components, and the components of some runs applied to all, leave the responses as they are.
    #[test]
    fn components_and_remainder_add_up_to_the_responses() {
        let mut rng = Stream::root(3).generator();
        let responses = Matrix::from_fn(30, 8, |_, j| 5.0 + j as f64 * normal(&mut rng));
        let part = responses.select_rows(&(0..12).collect::<Vec<_>>());
        let first = Components::Variance(1.0).of(&part).unwrap().first(3);
        assert_eq!(first.scores.columns(), 3);
        let direct = Components::Count(3).of(&part).unwrap();
        let remainder = |of: &PrincipalComponents| of.remainder.clone().unwrap();
        for (a, b) in remainder(&first).as_slice().iter().zip(remainder(&direct).as_slice()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
        for (found, of) in [(first.clone(), &part), (first.of_all(&responses), &responses)] {
            let back = lacuna_linalg::multiply_transposed(&found.scores, &found.directions);
            let remainder = remainder(&found);
            for i in 0..of.rows() {
                for j in 0..8 {
                    let whole = found.mean[j] + back[(i, j)] + remainder[(i, j)];
                    assert!((whole - of[(i, j)]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn outputs_can_be_their_own_components() {
        let responses =
            Matrix::from_fn(6, 3, |i, j| if j == 1 { 5.0 } else { (i * (j + 2)) as f64 });
        let found = Components::None.of(&responses).unwrap();
        assert_eq!((found.scores.columns(), found.mean[1]), (2, 5.0));
        let back = lacuna_linalg::multiply_transposed(&found.scores, &found.directions);
        let remainder = found.remainder.clone().unwrap();
        for i in 0..6 {
            for j in 0..3 {
                let whole = found.mean[j] + back[(i, j)] + remainder[(i, j)];
                assert!((whole - responses[(i, j)]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn responses_without_variance_have_no_component() {
        let found = Components::Variance(0.99).of(&Matrix::from_fn(5, 4, |_, j| j as f64)).unwrap();
        assert_eq!((found.scores.columns(), found.mean[3]), (0, 3.0));
    }
}
