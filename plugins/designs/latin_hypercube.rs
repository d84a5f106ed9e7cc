//! `latin_hypercube`: one point in each of N slices of every axis.

use lacuna::data::Parameter;
use lacuna::math::random::{Stream, below, permutation, uniform};
use lacuna::plugin::{Component, Design};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Latin hypercube: every axis is divided into as many equal slices as there are runs, and each slice holds exactly
/// one run.
///
/// `optimise = "maximin"` exchanges coordinates between runs so that the closest pair is as far apart as possible;
/// `optimise = "correlation"` exchanges them so that the columns are as uncorrelated as possible. Both keep the Latin
/// property.
///
/// Extending a design keeps its points: every axis is divided again into as many slices as there are then runs, and
/// the new runs take empty slices. If the number of runs doubles, each slice again holds exactly one run; otherwise
/// some slices may hold two old runs, and as many stay empty.
///
/// References: M. D. `McKay`, Beckman, Conover, Technometrics 21 (1979) 239; Morris and Mitchell, J. Stat. Plan.
/// Inference 43 (1995) 381 (the criterion `phi_p`); Iman and Conover, Commun. Stat. B 11 (1982) 311.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LatinHypercube {
    /// Criterion that the exchanges optimise.
    pub optimise: Optimise,
    /// Number of exchanges tried per run, with `maximin` and `correlation`. More exchanges improve the criterion and
    /// take longer.
    pub exchanges: usize,
    /// If true, each point lies at the centre of its slices; if false, at a random position inside them.
    pub centred: bool,
}

/// Criterion that a Latin hypercube optimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Optimise {
    /// No criterion: a plain random Latin hypercube.
    None,
    /// Maximum distance between the closest runs, which fills the space evenly.
    Maximin,
    /// Minimum correlations between the columns, which separates the effects of the parameters.
    Correlation,
}

impl Default for LatinHypercube {
    fn default() -> Self {
        Self { optimise: Optimise::None, exchanges: 100, centred: false }
    }
}

impl Component for LatinHypercube {}

impl Design for LatinHypercube {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        let mut points = self.plain(count, dimension, stream);
        let mut rng = stream.named("exchange").generator();
        match self.optimise {
            Optimise::None => {}
            Optimise::Maximin => self.maximin(&mut points, 0, &mut rng),
            Optimise::Correlation => self.decorrelate(&mut points, 0, &mut rng),
        }
        Ok(points)
    }

    fn extend(
        &self,
        _: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        let first = known.rows();
        let stream = stream.named("extension").at(first as u64);
        let mut points = known.clone();
        self.fill(known, count, &stream).iter_rows().for_each(|row| points.push_row(row));
        let mut rng = stream.named("exchange").generator();
        match self.optimise {
            Optimise::None => {}
            Optimise::Maximin => self.maximin(&mut points, first, &mut rng),
            Optimise::Correlation => self.decorrelate(&mut points, first, &mut rng),
        }
        Ok(points.select_rows(&(first..first + count).collect::<Vec<_>>()))
    }
}

impl LatinHypercube {
    fn plain(&self, count: usize, dimension: usize, stream: &Stream) -> Matrix {
        let mut points = Matrix::zeros(count, dimension);
        for j in 0..dimension {
            let mut rng = stream.named("axis").at(j as u64).generator();
            for (i, slice) in permutation(&mut rng, count).into_iter().enumerate() {
                let inside = if self.centred { 0.5 } else { uniform(&mut rng) };
                points[(i, j)] = (slice as f64 + inside) / count as f64;
            }
        }
        points
    }

    /// Returns points in slices of the finer grid that hold no known point.
    fn fill(&self, known: &Matrix, count: usize, stream: &Stream) -> Matrix {
        let all = known.rows() + count;
        let mut points = Matrix::zeros(count, known.columns());
        for j in 0..known.columns() {
            let mut rng = stream.named("axis").at(j as u64).generator();
            let mut empty = vec![true; all];
            for x in known.column(j) {
                empty[((x * all as f64) as usize).min(all - 1)] = false;
            }
            let empty: Vec<usize> = (0..all).filter(|&slice| empty[slice]).collect();
            // There are at least as many empty slices as new points; which of them stay empty is random.
            let order = permutation(&mut rng, empty.len());
            for (i, place) in order.into_iter().take(count).enumerate() {
                let inside = if self.centred { 0.5 } else { uniform(&mut rng) };
                points[(i, j)] = (empty[place] as f64 + inside) / all as f64;
            }
        }
        points
    }

    /// Exchanges coordinates to lower Morris and Mitchell's criterion `phi_p = (sum d_ij^-p)^(1/p)` with p = 15. It
    /// compares `sum d^-p`, in which an exchange changes only the terms of the two runs concerned. Runs before
    /// `first` are kept.
    fn maximin(&self, points: &mut Matrix, first: usize, rng: &mut impl Rng) {
        let (count, dimension) = (points.rows() - first, points.columns());
        if count < 2 || points.rows() < 3 || dimension == 0 {
            return;
        }
        for _ in 0..self.exchanges * count {
            let (a, b) = pair(rng, first, count);
            let j = below(rng, dimension);
            let before = crowding(points, a, b);
            swap(points, a, b, j);
            if crowding(points, a, b) >= before {
                swap(points, a, b, j);
            }
        }
    }

    /// Exchanges coordinates to lower the sum of squared correlations between the columns. Runs before `first` are
    /// kept.
    fn decorrelate(&self, points: &mut Matrix, first: usize, rng: &mut impl Rng) {
        let (count, dimension) = (points.rows() - first, points.columns());
        if count < 2 || points.rows() < 3 || dimension < 2 {
            return;
        }
        let mut products = Products::of(points);
        for _ in 0..self.exchanges * count {
            let (a, b) = pair(rng, first, count);
            let j = below(rng, dimension);
            let before = products.column_badness(j);
            products.exchange(points, a, b, j);
            swap(points, a, b, j);
            if products.column_badness(j) >= before {
                products.exchange(points, a, b, j);
                swap(points, a, b, j);
            }
        }
    }
}

/// Draws two distinct runs among the `count` runs from `first` on.
fn pair(rng: &mut impl Rng, first: usize, count: usize) -> (usize, usize) {
    let a = below(rng, count);
    let b = (a + 1 + below(rng, count - 1)) % count;
    (first + a, first + b)
}

fn swap(points: &mut Matrix, a: usize, b: usize, j: usize) {
    let kept = points[(a, j)];
    points[(a, j)] = points[(b, j)];
    points[(b, j)] = kept;
}

/// Returns the sum of `d^-15` over all pairs that contain run `a` or run `b`.
fn crowding(points: &Matrix, a: usize, b: usize) -> f64 {
    let around = |centre: usize| {
        let others = (0..points.rows()).filter(|&i| i != centre && (centre == a || i != a));
        others.map(|i| squared_distance(points.row(centre), points.row(i)).powf(-7.5)).sum::<f64>()
    };
    around(a) + around(b)
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum()
}

/// Centred cross products of the columns, updated at each exchange.
struct Products {
    mean: Vec<f64>,
    cross: Matrix,
}

impl Products {
    fn of(points: &Matrix) -> Self {
        let (n, d) = (points.rows(), points.columns());
        let mean: Vec<f64> =
            (0..d).map(|j| points.column(j).iter().sum::<f64>() / n as f64).collect();
        let cross = Matrix::from_fn(d, d, |j, k| {
            (0..n).map(|i| (points[(i, j)] - mean[j]) * (points[(i, k)] - mean[k])).sum()
        });
        Self { mean, cross }
    }

    /// Returns the sum of squared correlations of column `j` with the others.
    fn column_badness(&self, j: usize) -> f64 {
        let others = (0..self.mean.len()).filter(|&k| k != j);
        others.map(|k| self.cross[(j, k)].powi(2) / (self.cross[(j, j)] * self.cross[(k, k)])).sum()
    }

    /// Updates the products for an exchange of entry `j` of runs `a` and `b`, which changes the product with column
    /// `k` by `-(x_aj - x_bj)(x_ak - x_bk)`.
    fn exchange(&mut self, points: &Matrix, a: usize, b: usize, j: usize) {
        let step = points[(a, j)] - points[(b, j)];
        for k in (0..self.mean.len()).filter(|&k| k != j) {
            let change = -step * (points[(a, k)] - points[(b, k)]);
            self.cross[(j, k)] += change;
            self.cross[(k, j)] += change;
        }
    }
}

lacuna::register!(Design, "latin_hypercube", LatinHypercube, aliases: ["lhs", "lhd"]);

#[cfg(test)]
mod tests {
    use super::*;

    fn design(optimise: Optimise) -> Matrix {
        let plugin = LatinHypercube { optimise, ..LatinHypercube::default() };
        plugin.points(60, 3, &Stream::root(1)).unwrap()
    }

    fn closest(points: &Matrix) -> f64 {
        let n = points.rows();
        (0..n)
            .flat_map(|i| (0..i).map(move |k| (i, k)))
            .map(|(i, k)| squared_distance(points.row(i), points.row(k)).sqrt())
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn every_slice_of_every_axis_holds_one_run() {
        for optimise in [Optimise::None, Optimise::Maximin, Optimise::Correlation] {
            let points = design(optimise);
            for j in 0..3 {
                let mut slices: Vec<usize> =
                    points.column(j).iter().map(|x| (x * 60.0) as usize).collect();
                slices.sort_unstable();
                assert_eq!(slices, (0..60).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn maximin_moves_the_closest_pair_apart() {
        let (plain, spread) =
            (closest(&design(Optimise::None)), closest(&design(Optimise::Maximin)));
        assert!(spread > 2.0 * plain, "{plain} against {spread}");
    }

    #[test]
    fn correlation_reduction_leaves_uncorrelated_columns() {
        let products = Products::of(&design(Optimise::Correlation));
        let worst = (0..3).map(|j| products.column_badness(j)).fold(0.0, f64::max);
        assert!(worst.sqrt() < 5e-3, "{worst}");
        let plain = Products::of(&design(Optimise::None));
        assert!((0..3).map(|j| plain.column_badness(j)).fold(0.0, f64::max) > 1e-3);
    }

    #[test]
    fn kept_products_equal_those_computed_afresh() {
        let mut points = design(Optimise::None);
        let mut products = Products::of(&points);
        products.exchange(&points, 3, 17, 1);
        swap(&mut points, 3, 17, 1);
        let fresh = Products::of(&points);
        for j in 0..3 {
            assert!((products.column_badness(j) - fresh.column_badness(j)).abs() < 1e-12);
        }
    }

    #[test]
    fn an_extension_fills_empty_slices_and_moves_nothing() {
        for optimise in [Optimise::None, Optimise::Maximin, Optimise::Correlation] {
            let plugin = LatinHypercube { optimise, ..LatinHypercube::default() };
            let stream = Stream::root(1);
            let known = plugin.points(60, 3, &stream).unwrap();
            let slices = |points: &Matrix, j: usize, all: f64| -> Vec<usize> {
                let mut slices: Vec<usize> =
                    points.column(j).iter().map(|x| (x * all) as usize).collect();
                slices.sort_unstable();
                slices
            };
            let doubled = plugin.extend(&[], &known, 60, &stream).unwrap();
            let some = plugin.extend(&[], &known, 25, &stream).unwrap();
            assert_eq!((doubled.rows(), some.rows()), (60, 25));
            for j in 0..3 {
                let both = [slices(&known, j, 120.0), slices(&doubled, j, 120.0)].concat();
                let distinct: std::collections::BTreeSet<usize> = both.into_iter().collect();
                assert_eq!(distinct.len(), 120, "a Latin hypercube again");
                let old: std::collections::BTreeSet<usize> =
                    slices(&known, j, 85.0).into_iter().collect();
                let new = slices(&some, j, 85.0);
                assert!(new.windows(2).all(|pair| pair[0] < pair[1]), "one run a slice");
                assert!(new.iter().all(|slice| !old.contains(slice)), "in empty slices");
            }
        }
    }
}
