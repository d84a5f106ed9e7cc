//! The change of a companion's response by a candidate, learned near a point of the parameters.
//!
//! A simulator with events, such as cavities that open one step earlier or later, answers a tiny change with a jump: the
//! difference of two runs is the change plus two such jumps. A regression over many differences keeps the change. The
//! basis are the monomials of total degree three in the scaled parameters, the scaled indices and the scaled size, each
//! with the size in it, so that nothing changes at the size of absence (response surface methodology: Box and Draper,
//! Empirical Model-Building and Response Surfaces, 1987).

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna_linalg::{Cholesky, Matrix, gram, transposed_multiply, transposed_multiply_vector};

use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::change::Change;

/// Half the width of the region around the point, as a share of the central 95 % of each prior.
const REGION: f64 = 0.15;

/// The part of an index's prior in which changes are learned: the quantiles between this and its complement. The size
/// reaches as far at most.
const TAIL: f64 = 0.01;

/// The share of the reach at which a difference has half the weight of one at absence: relative errors matter where a
/// change is large, jumps of the simulator where it is small.
const SMALL: f64 = 0.05;

/// The farthest that a size is followed beyond its reach, in units of it.
const BEYOND: f64 = 1.5;

/// The number of halvings of the farthest distance of a size from absence.
const HALVINGS: i32 = 12;

/// The number of differences for each monomial.
const EACH: usize = 5;

/// The ridge, relative to the mean square of a monomial.
const RIDGE: f64 = 1e-6;

/// The degree of the monomials.
const DEGREE: usize = 3;

/// The region around a point of the parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Region {
    centre: Vec<f64>,
    half: Vec<f64>,
    bounds: Vec<(f64, f64)>,
}

/// The monomials of a change with the points at which it is learned.
#[derive(Debug, Clone)]
pub(super) struct Basis {
    region: Region,
    inputs: Vec<FreeInput>,
    /// The distance of the size from absence up to which the change is learned, then the width of each index's prior.
    widths: Vec<f64>,
    /// The exponents of each monomial: of the parameters, of the indices, of the size.
    exponents: Vec<Vec<usize>>,
}

/// A learned change.
#[derive(Debug, Clone)]
pub(super) struct LearnedChange {
    basis: Basis,
    /// `monomials x outputs`, in the response's unit.
    coefficients: Matrix,
}

impl Region {
    /// The region around a point of some parameters.
    pub fn around(parameters: &[Parameter], point: &[f64]) -> Self {
        let half = |p: &Parameter| REGION * (p.prior.quantile(0.975) - p.prior.quantile(0.025));
        Self {
            centre: point[..parameters.len()].to_vec(),
            half: parameters.iter().map(half).collect(),
            bounds: parameters.iter().map(|p| p.prior.support()).collect(),
        }
    }

    /// A point of the region and inside the bounds, from numbers between 0 and 1.
    fn at(&self, shares: &[f64]) -> Vec<f64> {
        let place = |j: usize| {
            let x = self.centre[j] + (2.0 * shares[j] - 1.0) * self.half[j];
            x.clamp(self.bounds[j].0, self.bounds[j].1)
        };
        (0..self.centre.len()).map(place).collect()
    }

    /// The middle of the region, then for each parameter the points half way to the edge below and above it.
    pub fn cross(&self) -> Vec<Vec<f64>> {
        let d = self.centre.len();
        let point = |j: usize, share: f64| {
            let mut shares = vec![0.5; d];
            shares[j] = share;
            self.at(&shares)
        };
        let sides = (0..d).flat_map(|j| [point(j, 0.25), point(j, 0.75)]);
        std::iter::once(self.centre.clone()).chain(sides).collect()
    }

    /// The parameters in units of the region, moved to its edge where they are outside.
    fn scaled(&self, point: &[f64]) -> Vec<f64> {
        let scale = |j: usize| ((point[j] - self.centre[j]) / self.half[j]).clamp(-1.0, 1.0);
        (0..self.centre.len()).map(scale).collect()
    }
}

impl Basis {
    /// The basis of a candidate with these inputs, the size first, whose distance from absence reaches so far.
    pub fn new(region: Region, inputs: &[FreeInput], reach: f64) -> Self {
        let variables = region.centre.len() + inputs.len();
        let width = |prior: &Distribution| prior.quantile(1.0 - TAIL) - prior.quantile(TAIL);
        let mut widths: Vec<f64> = inputs.iter().map(|input| width(&input.prior)).collect();
        widths[0] = reach;
        let exponents = monomials(variables, DEGREE);
        // The size comes last among the variables.
        let exponents = exponents.into_iter().filter(|own| own[variables - 1] > 0).collect();
        Self { region, inputs: inputs.to_vec(), widths, exponents }
    }

    /// The points at which the change is learned: those of the parameters, and the values of the inputs.
    pub fn points(&self, random: &Stream) -> Vec<(Vec<f64>, Vec<f64>)> {
        let d = self.region.centre.len();
        let one = |i: usize| {
            let mut rng = random.named("parameters").at(i as u64).generator();
            let shares: Vec<f64> = (0..d).map(|_| uniform(&mut rng)).collect();
            let mut rng = random.named("inputs").at(i as u64).generator();
            // More of the small sizes, where the change is small as well.
            let share = uniform(&mut rng).powi(2);
            let side = if uniform(&mut rng) < 0.5 { -1.0 } else { 1.0 };
            let mut values = vec![self.size(side * share * self.widths[0])];
            let index = |input: &FreeInput| {
                input.prior.quantile(TAIL + (1.0 - 2.0 * TAIL) * uniform(&mut rng))
            };
            values.extend(self.inputs[1..].iter().map(index));
            (self.region.at(&shares), values)
        };
        (0..EACH * self.exponents.len()).map(one).collect()
    }

    /// The size at a distance from absence, on the other side where the prior does not reach there.
    fn size(&self, distance: f64) -> f64 {
        let FreeInput { prior, absent, .. } = &self.inputs[0];
        let (low, high) = prior.support();
        let inside = |x: &f64| (low..=high).contains(x);
        let sizes = [absent + distance, absent - distance];
        sizes.into_iter().find(inside).unwrap_or_else(|| sizes[0].clamp(low, high))
    }

    /// The monomials at a point.
    fn row(&self, parameters: &[f64], values: &[f64]) -> Vec<f64> {
        let mut x = self.region.scaled(parameters);
        let scaled = |k: usize| (values[k] - self.inputs[k].absent) / self.widths[k];
        x.extend((1..self.inputs.len()).map(scaled));
        x.push(scaled(0).clamp(-BEYOND, BEYOND));
        let monomial = |own: &Vec<usize>| -> f64 {
            own.iter().zip(&x).map(|(&e, x)| x.powi(e as i32)).product()
        };
        self.exponents.iter().map(monomial).collect()
    }
}

/// The distances of a size from absence that a search for its reach tries, the largest first.
pub(super) fn distances(size: &FreeInput) -> Vec<f64> {
    let far = |p: f64| (size.prior.quantile(p) - size.absent).abs();
    let most = far(TAIL).max(far(1.0 - TAIL));
    (0..HALVINGS).map(|k| most * 0.5_f64.powi(k)).collect()
}

/// The exponents of all monomials up to a total degree.
fn monomials(variables: usize, degree: usize) -> Vec<Vec<usize>> {
    if variables == 0 {
        return vec![Vec::new()];
    }
    let with = |first: usize| {
        let rest = monomials(variables - 1, degree - first).into_iter();
        rest.map(move |rest| std::iter::once(first).chain(rest).collect())
    };
    (0..=degree).flat_map(with).collect()
}

impl LearnedChange {
    /// The change with the least squares to these differences at the points of the basis; differences that are not finite
    /// are left out. `None` if too few are left.
    pub fn of(
        basis: Basis,
        points: &[(Vec<f64>, Vec<f64>)],
        differences: &[Vec<f64>],
    ) -> Option<Self> {
        let used: Vec<usize> =
            (0..points.len()).filter(|&i| differences[i].iter().all(|y| y.is_finite())).collect();
        let terms = basis.exponents.len();
        if used.len() < terms + terms / 2 {
            return None;
        }
        let absent = basis.inputs[0].absent;
        let weight = |i: usize| 1.0 / (((points[i].1[0] - absent) / basis.widths[0]).abs() + SMALL);
        let weighed =
            |i: usize, row: &[f64]| -> Vec<f64> { row.iter().map(|x| weight(i) * x).collect() };
        let rows = used.iter().map(|&i| weighed(i, &basis.row(&points[i].0, &points[i].1)));
        let design = Matrix::from_rows(terms, rows);
        let outputs = differences[used[0]].len();
        let values = Matrix::from_rows(outputs, used.iter().map(|&i| weighed(i, &differences[i])));
        let mut normal = gram(&design);
        let mean = (0..terms).map(|k| normal[(k, k)]).sum::<f64>() / terms as f64;
        (0..terms).for_each(|k| normal[(k, k)] += RIDGE * mean);
        let factor = Cholesky::new(&normal).ok()?;
        let mut products = transposed_multiply(&design, &values).transposed();
        for i in 0..products.rows() {
            factor.solve(products.row_mut(i));
        }
        Some(Self { basis, coefficients: products.transposed() })
    }
}

impl Change for LearnedChange {
    fn at(&self, point: &[f64], values: &[f64]) -> Vec<f64> {
        transposed_multiply_vector(&self.coefficients, &self.basis.row(point, values))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::data::Unit;
    use lacuna::math::random::normal;

    /// A change that decays with the size as `exp(-s t) - 1` and depends on a parameter, with jumps of a fifth of its root
    /// mean square in each difference: it is learned to the standard error of a regression, `jump sqrt(terms / runs)`, and
    /// a tenth for the missing degrees.
    #[test]
    fn jumps_are_averaged() {
        let parameters = [Parameter::plain("a", Distribution::Uniform([0.0, 10.0]))];
        let size = FreeInput::new("s", Unit::dimensionless(), 0.0, Distribution::HalfNormal(0.5));
        let basis = Basis::new(Region::around(&parameters, &[5.0]), &[size], 1.2);
        let truth = |a: f64, s: f64| -> Vec<f64> {
            let at = |t: usize| 0.02 * t as f64;
            (0..50).map(|t| (a * at(t)).cos() * ((-s * at(t)).exp() - 1.0)).collect()
        };
        let points = basis.points(&Stream::root(1));
        let mut rng = Stream::root(2).generator();
        let square = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64;
        let all: Vec<Vec<f64>> = points.iter().map(|(a, s)| truth(a[0], s[0])).collect();
        let jump = 0.2 * (all.iter().map(|y| square(y)).sum::<f64>() / all.len() as f64).sqrt();
        let noisy: Vec<Vec<f64>> =
            all.iter().map(|y| y.iter().map(|y| y + jump * normal(&mut rng)).collect()).collect();
        let learned = LearnedChange::of(basis, &points, &noisy).unwrap();
        let error = |a: f64, s: f64| {
            let pairs = learned.at(&[a], &[s]).into_iter().zip(truth(a, s));
            square(&pairs.map(|(x, y)| x - y).collect::<Vec<f64>>()).sqrt()
        };
        let expected = jump * (1.0 / EACH as f64).sqrt();
        for (a, s) in [(5.0, 0.3), (4.6, 0.6), (5.4, 0.9)] {
            let size = square(&truth(a, s)).sqrt();
            assert!(error(a, s) < 2.0 * expected + 0.1 * size, "{a} {s}: {}", error(a, s));
        }
        assert!(learned.at(&[5.2], &[0.0]).iter().all(|y| *y == 0.0));
    }
}
