//! Multi-indices of an expansion, ordered so that the set of each degree is a prefix of the next.

use std::collections::BTreeMap;
use std::ops::Range;

use lacuna_linalg::Matrix;
use lacuna_linalg::lanes::{LANES, Lanes};

use super::coordinate::Coordinate;

/// Multi-indices one after the other: the degree of each parameter's polynomial.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Terms {
    dimension: usize,
    exponents: Vec<u16>,
}

/// Condition on the multi-indices of degree `p`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truncation {
    /// `q` of the hyperbolic norm `(sum_i alpha_i^q)^(1/q) <= p` (Blatman and Sudret 2011); 1 is the total degree.
    pub q_norm: f64,
    /// Maximum number of parameters in one product.
    pub max_interaction: usize,
}

/// A nested family of multi-index sets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Nested {
    /// All multi-indices, lower degrees first.
    pub terms: Terms,
    /// Number of multi-indices of each degree `0..=largest` and below.
    pub counts: Vec<usize>,
}

impl Nested {
    /// Returns the sets of degree `0..=degree`; ends before the first set with more than `limit` members.
    pub fn new(dimension: usize, degree: usize, truncation: Truncation, limit: usize) -> Self {
        let mut terms = Terms { dimension, exponents: vec![0; dimension] };
        let mut counts = vec![1];
        let powers: Vec<f64> = (0..=degree).map(|e| (e as f64).powf(truncation.q_norm)).collect();
        for p in 1..=degree {
            let max_interaction = truncation.max_interaction;
            let (exponents, found) = (vec![0; dimension], Vec::new());
            let mut shell = Shell { max_interaction, powers: &powers, p, exponents, found };
            // A shell above the limit is abandoned while it is filled: large sets must not even be listed.
            let room = limit.saturating_sub(terms.len());
            if !shell.fill(0, 0.0, 0, room * dimension) {
                break;
            }
            terms.exponents.extend(shell.found);
            counts.push(terms.len());
        }
        Self { terms, counts }
    }
}

/// Sets of all degrees and norms to be tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Sets {
    /// Members of all sets.
    pub terms: Terms,
    /// Sets ordered by degree and then by norm, without repetitions of the previous one.
    pub sets: Vec<TermSet>,
}

/// Terms of one degree and norm.
#[derive(Debug, Clone, PartialEq)]
pub struct TermSet {
    /// Degree.
    pub degree: usize,
    /// Norm.
    pub q_norm: f64,
    /// Indices among the terms of all sets.
    pub members: Vec<usize>,
}

impl Sets {
    /// Returns the sets of degree `min` and above of nested families, one per norm with the smallest norm first.
    pub fn new(dimension: usize, min: usize, families: &[(f64, Nested)]) -> Self {
        let mut known: BTreeMap<&[u16], usize> = BTreeMap::new();
        let (mut exponents, mut sets) = (Vec::new(), Vec::<TermSet>::new());
        let mut members = vec![Vec::new(); families.len()];
        let degrees = families.iter().map(|(_, nested)| nested.counts.len()).max().unwrap_or(0);
        for degree in 0..degrees {
            for ((q_norm, nested), members) in families.iter().zip(&mut members) {
                let Some(&count) = nested.counts.get(degree) else { continue };
                let grows = count > members.len();
                for t in members.len()..count {
                    let term = nested.terms.term(t);
                    members.push(*known.entry(term).or_insert_with(|| {
                        exponents.extend(term);
                        exponents.len() / dimension - 1
                    }));
                }
                let last = sets.last();
                let repeats = last.is_some_and(|l| l.degree == degree && l.members.len() == count);
                if degree >= min && (grows || degree == min) && !repeats {
                    let members = members.clone();
                    sets.push(TermSet { degree, q_norm: *q_norm, members });
                }
            }
        }
        Self { terms: Terms { dimension, exponents }, sets }
    }
}

/// Members of degree `p` that are not of degree `p - 1`.
struct Shell<'a> {
    max_interaction: usize,
    /// `e^q` for each exponent.
    powers: &'a [f64],
    p: usize,
    exponents: Vec<u16>,
    found: Vec<u16>,
}

impl Shell<'_> {
    /// Largest sum of `q`-th powers of a member of degree `p`.
    fn bound(&self, p: usize) -> f64 {
        // The sums carry rounding errors; a member on the boundary belongs to the set.
        self.powers[p] * (1.0 + 1e-12)
    }

    /// Chooses exponents from parameter `i` on; returns false if more than `room` numbers were found.
    fn fill(&mut self, i: usize, norm: f64, active: usize, room: usize) -> bool {
        if i == self.exponents.len() {
            if norm > self.bound(self.p - 1) {
                self.found.extend(&self.exponents);
            }
            return self.found.len() <= room;
        }
        let allowed = if active < self.max_interaction { self.p } else { 0 };
        // High exponents of early parameters first: x1, x2, ... within degree 1.
        for e in (0..=allowed).rev() {
            let sum = norm + self.powers[e];
            if sum > self.bound(self.p) {
                continue;
            }
            self.exponents[i] = e as u16;
            if !self.fill(i + 1, sum, active + usize::from(e > 0), room) {
                return false;
            }
        }
        self.exponents[i] = 0;
        true
    }
}

impl Terms {
    /// Returns the terms with these exponents, `dimension` numbers per term.
    pub fn from_exponents(dimension: usize, exponents: Vec<u16>) -> Self {
        Self { dimension, exponents }
    }

    /// Returns the exponents of all terms, one after the other.
    pub fn exponents(&self) -> &[u16] {
        &self.exponents
    }

    /// Returns the number of terms.
    pub fn len(&self) -> usize {
        self.exponents.len() / self.dimension
    }

    /// Returns true if there are no terms.
    pub fn is_empty(&self) -> bool {
        self.exponents.is_empty()
    }

    /// Returns the exponents of term `t`.
    pub fn term(&self, t: usize) -> &[u16] {
        &self.exponents[t * self.dimension..(t + 1) * self.dimension]
    }

    /// Returns the first `count` terms.
    pub fn prefix(&self, count: usize) -> Self {
        let exponents = self.exponents[..count * self.dimension].to_vec();
        Self { dimension: self.dimension, exponents }
    }

    /// Returns the terms with these indices.
    pub fn select(&self, indices: &[usize]) -> Self {
        let exponents = indices.iter().flat_map(|&t| self.term(t)).copied().collect();
        Self { dimension: self.dimension, exponents }
    }
}

/// Product polynomials of a set of terms, prepared for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    coordinates: Vec<Coordinate>,
    terms: Terms,
    /// One more than the largest exponent: the length of each parameter's table of values.
    stride: usize,
    /// Table entries that each term multiplies, and the end of each term's entries.
    factors: Vec<u32>,
    ends: Vec<usize>,
    /// Products from which the terms are built, after 1: an earlier product times a table entry.
    products: Vec<(u32, u32)>,
    /// Index of the product that equals each term.
    places: Vec<u32>,
}

impl Basis {
    /// Prepares the product polynomials of `terms` in these coordinates.
    pub fn new(coordinates: Vec<Coordinate>, terms: Terms) -> Self {
        let stride = terms.exponents.iter().max().map_or(1, |&e| usize::from(e) + 1);
        let (mut factors, mut ends) = (Vec::new(), Vec::new());
        let (mut products, mut places) = (Vec::new(), Vec::new());
        let mut known = BTreeMap::new();
        for t in 0..terms.len() {
            let mut place = 0;
            for (i, &e) in terms.term(t).iter().enumerate().filter(|(_, e)| **e > 0) {
                let factor = (i * stride + usize::from(e)) as u32;
                factors.push(factor);
                place = *known.entry((place, factor)).or_insert_with(|| {
                    products.push((place, factor));
                    products.len() as u32
                });
            }
            ends.push(factors.len());
            places.push(place);
        }
        Self { coordinates, terms, stride, factors, ends, products, places }
    }

    /// Returns the terms.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Returns the standard coordinates.
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    fn factors(&self, t: usize) -> &[u32] {
        let start = if t == 0 { 0 } else { self.ends[t - 1] };
        &self.factors[start..self.ends[t]]
    }

    /// Returns the basis functions at points in physical units, one per row (`points x terms`).
    pub fn values(&self, points: &Matrix) -> Matrix {
        let count = self.terms.len();
        let mut values = Matrix::zeros(points.rows(), count);
        self.in_lanes(points, |range, products| {
            let rows = &mut values.as_mut_slice()[range.start * count..range.end * count];
            for (l, row) in rows.chunks_exact_mut(count.max(1)).enumerate() {
                for (value, &place) in row.iter_mut().zip(&self.places) {
                    *value = products[place as usize][l];
                }
            }
        });
        values
    }

    /// Returns the index of each basis function in the table that [`Self::in_lanes`] makes.
    pub(super) fn places(&self) -> &[u32] {
        &self.places
    }

    /// Calls `take` with blocks of points: the range of their rows, and a table of their products side by side.
    pub(super) fn in_lanes(&self, points: &Matrix, mut take: impl FnMut(Range<usize>, &[Lanes])) {
        let mut table = vec![[0.0; LANES]; self.coordinates.len() * self.stride];
        let mut products = vec![[1.0; LANES]; self.products.len() + 1];
        for first in (0..points.rows()).step_by(LANES) {
            let end = points.rows().min(first + LANES);
            let tables = table.chunks_exact_mut(self.stride);
            for (i, (coordinate, table)) in self.coordinates.iter().zip(tables).enumerate() {
                coordinate.values((first..end).map(|r| points[(r, i)]), table);
            }
            for (p, &(earlier, factor)) in self.products.iter().enumerate() {
                let (before, factor) = (products[earlier as usize], &table[factor as usize]);
                for (l, product) in products[p + 1].iter_mut().enumerate() {
                    *product = before[l] * factor[l];
                }
            }
            take(first..end, &products);
        }
    }

    /// Returns the derivative of each basis function (rows) with respect to each parameter (columns), in physical
    /// units.
    pub fn gradient(&self, point: &[f64]) -> Matrix {
        let pairs = self.coordinates.iter().zip(point);
        let stretches: Vec<f64> = pairs.map(|(coordinate, &x)| coordinate.stretch(x)).collect();
        let mut gradient = Matrix::zeros(self.terms.len(), self.coordinates.len());
        self.slopes(point, |t, i, slope| gradient[(t, i)] = slope / stretches[i]);
        gradient
    }

    /// Calls `take` with each basis function, each parameter that it depends on, and its derivative with respect to the
    /// standard variable of the parameter: function by function, in the order of the parameters.
    pub(super) fn slopes(&self, point: &[f64], mut take: impl FnMut(usize, usize, f64)) {
        let mut table = vec![0.0; self.coordinates.len() * self.stride];
        let mut slopes = table.clone();
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            let range = i * self.stride..(i + 1) * self.stride;
            let z = coordinate.standard(point[i]);
            coordinate.derivatives(z, &mut table[range.clone()], &mut slopes[range]);
        }
        for t in 0..self.terms.len() {
            let factors = self.factors(t);
            for (k, &f) in factors.iter().enumerate() {
                let others: f64 = (factors.iter().enumerate())
                    .filter(|(l, _)| *l != k)
                    .map(|(_, &g)| table[g as usize])
                    .product();
                take(t, f as usize / self.stride, slopes[f as usize] * others);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOTAL: Truncation = Truncation { q_norm: 1.0, max_interaction: usize::MAX };

    #[test]
    fn total_degree_sets_have_binomial_sizes_and_are_prefixes() {
        // Source: the number of monomials of degree at most p in d variables is C(d + p, p).
        let nested = Nested::new(3, 20, TOTAL, 10_000);
        assert_eq!((nested.counts[1], nested.counts[5], nested.counts[20]), (4, 56, 1771));
        for (p, &count) in nested.counts.iter().enumerate() {
            let degree = |t| nested.terms.term(t).iter().map(|&e| usize::from(e)).sum::<usize>();
            assert!((0..count).all(|t| degree(t) <= p));
            assert!((count..nested.terms.len()).all(|t| degree(t) > p));
        }
        assert_eq!(nested.terms.term(1), [1, 0, 0]);
    }

    #[test]
    fn hyperbolic_sets_equal_their_definition() {
        for (q, r) in [(0.5, 3), (0.75, 2), (1.0, 1)] {
            let truncation = Truncation { q_norm: q, max_interaction: r };
            let nested = Nested::new(3, 9, truncation, 10_000);
            for p in 0..=9_usize {
                let mut expected = 0;
                for a in 0..=p {
                    for b in 0..=p {
                        for c in 0..=p {
                            let index = [a, b, c];
                            let sum: f64 = index.iter().map(|&e| (e as f64).powf(q)).sum();
                            let active = index.iter().filter(|&&e| e > 0).count();
                            let norm = if sum == 0.0 { 0.0 } else { sum.powf(1.0 / q) };
                            expected += usize::from(norm <= p as f64 + 1e-9 && active <= r);
                        }
                    }
                }
                assert_eq!(nested.counts[p], expected, "q {q}, p {p}");
            }
        }
    }

    #[test]
    fn sets_above_the_limit_are_left_out() {
        assert_eq!(Nested::new(20, 20, TOTAL, 1000).counts, [1, 21, 231]);
    }

    #[test]
    fn gradients_are_the_limits_of_differences() {
        let basis = Basis::new(
            vec![Coordinate::legendre(1e4, 1.5e3), Coordinate::legendre(-2e-3, 1e-3)],
            Nested::new(2, 6, TOTAL, 100).terms,
        );
        let point = [1.03e4, -2.4e-3];
        let gradient = basis.gradient(&point);
        for (i, step) in [(0, 1.5e-2), (1, 1e-8)] {
            let shifted = |sign: f64| {
                let mut p = point;
                p[i] += sign * step;
                basis.values(&Matrix::from_rows(2, [p]))
            };
            let (up, down) = (shifted(1.0), shifted(-1.0));
            for t in 0..basis.terms().len() {
                let difference = (up[(0, t)] - down[(0, t)]) / (2.0 * step);
                let scale = basis.coordinates()[i].stretch(point[i]);
                assert!(((gradient[(t, i)] - difference) * scale).abs() < 1e-6);
            }
        }
    }
}
