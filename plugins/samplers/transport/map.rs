//! A triangular map between free coordinates of a density and coordinates in which it is nearly standard normal.

use lacuna::math::moments::{mean, variance};
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use serde::{Deserialize, Serialize};

use super::fit::{self, Dependence};

/// Largest dimension for which locations have products of two coordinates.
const MOST_PRODUCTS: usize = 10;
/// Largest dimension for which each coordinate is predicted from each other to find their order.
const MOST_PAIRS: usize = 20;
/// Size, in standard deviations, to which a coordinate is limited in all but linear terms: beyond the draws the map is linear.
const LIMIT: f64 = 10.0;

/// The map `v_k = m_k(v_1 .. v_(k-1)) + exp(s_k(v_1 .. v_(k-1))) z_k` of standardised coordinates, in an order of its own
/// (Parno and Marzouk, SIAM/ASA J. Uncertainty Quantification 6 (2018) 645, with conditional scales as in Papamakarios et
/// al., arXiv:1705.07057).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Map {
    centre: Vec<f64>,
    scale: Vec<f64>,
    /// Coordinate of each place in the triangle.
    order: Vec<usize>,
    places: Vec<Place>,
}

/// Dependence of a coordinate on those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Form {
    /// None.
    Constant,
    /// A linear location.
    Linear,
    /// A quadratic location, and a scale whose logarithm is linear.
    Curved,
}

/// One row of the triangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    pub form: Form,
    /// Coefficients of [`Place::location_terms`].
    pub location: Vec<f64>,
    /// Coefficients of [`Place::scale_terms`].
    pub log_scale: Vec<f64>,
}

/// A point of the map with what its derivatives need.
struct Reached {
    /// Standardised coordinates in the order of the triangle.
    v: Vec<f64>,
    log_scale: Vec<f64>,
}

fn limited(x: f64) -> f64 {
    LIMIT * (x / LIMIT).tanh()
}

fn limited_slope(x: f64) -> f64 {
    1.0 - (x / LIMIT).tanh().powi(2)
}

impl Place {
    /// Terms of the location: one, each coordinate, the squares of the limited ones, and their products if there are few.
    pub fn location_terms(form: Form, v: &[f64], products: bool) -> Vec<f64> {
        let mut terms = vec![1.0];
        if form == Form::Constant {
            return terms;
        }
        terms.extend(v);
        if form == Form::Curved {
            let limited: Vec<f64> = v.iter().map(|&x| limited(x)).collect();
            terms.extend(limited.iter().map(|x| x * x));
            if products {
                for (i, x) in limited.iter().enumerate() {
                    terms.extend(limited[..i].iter().map(|y| x * y));
                }
            }
        }
        terms
    }

    /// Terms of the logarithm of the scale: one, and each limited coordinate.
    pub fn scale_terms(form: Form, v: &[f64]) -> Vec<f64> {
        let mut terms = vec![1.0];
        if form == Form::Curved {
            terms.extend(v.iter().map(|&x| limited(x)));
        }
        terms
    }

    /// Location and logarithm of the scale, given the coordinates before.
    pub fn at(&self, v: &[f64], products: bool) -> (f64, f64) {
        (
            dot(&self.location, &Self::location_terms(self.form, v, products)),
            dot(&self.log_scale, &Self::scale_terms(self.form, v)),
        )
    }

    /// Adds the derivatives of the location times `weight`, and of the logarithm of the scale times `by_log`, to those by
    /// the coordinates.
    fn add_slopes(&self, v: &[f64], products: bool, weight: f64, by_log: f64, to: &mut [f64]) {
        if self.form == Form::Constant {
            return;
        }
        let k = v.len();
        to.iter_mut().zip(&self.location[1..=k]).for_each(|(to, a)| *to += weight * a);
        if self.form == Form::Linear {
            return;
        }
        let slopes: Vec<f64> = v.iter().map(|&x| limited_slope(x)).collect();
        let limited: Vec<f64> = v.iter().map(|&x| limited(x)).collect();
        for j in 0..k {
            let by_place = weight * 2.0 * self.location[1 + k + j] * limited[j];
            to[j] += (by_place + by_log * self.log_scale[1 + j]) * slopes[j];
        }
        if products {
            let mut next = 1 + 2 * k;
            for i in 0..k {
                for j in 0..i {
                    let both = weight * self.location[next];
                    to[i] += both * limited[j] * slopes[i];
                    to[j] += both * limited[i] * slopes[j];
                    next += 1;
                }
            }
        }
    }
}

impl Map {
    /// The map of the draws of some chains, one per row, those of one step after those of another; `None` if they have no
    /// scatter.
    pub fn of(draws: &Matrix, chains: usize) -> Option<Self> {
        let d = draws.columns();
        let columns: Vec<Vec<f64>> = (0..d).map(|j| draws.column(j)).collect();
        let centre: Vec<f64> = columns.iter().map(|c| mean(c)).collect();
        let scale: Vec<f64> = columns.iter().map(|c| variance(c).sqrt()).collect();
        if !scale.iter().all(|s| s.is_finite() && *s > 0.0) {
            return None;
        }
        let standard = |j: usize| columns[j].iter().map(|x| (x - centre[j]) / scale[j]).collect();
        let standardised: Vec<Vec<f64>> = (0..d).map(standard).collect();
        let order = ordered(&standardised, chains);
        let rows: Vec<Vec<f64>> = (0..draws.rows())
            .map(|i| order.iter().map(|&j| standardised[j][i]).collect())
            .collect();
        let place = |k: usize| {
            let given: Vec<Vec<f64>> = rows.iter().map(|v| v[..k].to_vec()).collect();
            let values = &standardised[order[k]];
            let products = d <= MOST_PRODUCTS;
            let dependence = Dependence { given: &given, values, chains, products };
            fit::place(&dependence).map(|(place, _)| place)
        };
        let places: Option<Vec<Place>> = (0..d).map(place).collect();
        Some(Self { centre, scale, order, places: places? })
    }

    /// Number of coordinates with a form.
    pub fn count(&self, form: Form) -> usize {
        self.places.iter().filter(|place| place.form == form).count()
    }

    fn products(&self) -> bool {
        self.order.len() <= MOST_PRODUCTS
    }

    fn reached(&self, z: &[f64]) -> Reached {
        let mut reached = Reached { v: Vec::new(), log_scale: Vec::new() };
        for (place, z) in self.places.iter().zip(z) {
            let (location, log_scale) = place.at(&reached.v, self.products());
            reached.v.push(location + log_scale.exp() * z);
            reached.log_scale.push(log_scale);
        }
        reached
    }

    /// The free point of a transported one, and the logarithm of the determinant of the map's derivative.
    pub fn free(&self, z: &[f64]) -> (Vec<f64>, f64) {
        let reached = self.reached(z);
        let mut free = vec![0.0; z.len()];
        for (&j, v) in self.order.iter().zip(&reached.v) {
            free[j] = self.centre[j] + self.scale[j] * v;
        }
        let scales: f64 = self.scale.iter().map(|s| s.ln()).sum();
        (free, scales + reached.log_scale.iter().sum::<f64>())
    }

    /// The transported point of a free one.
    pub fn transported(&self, free: &[f64]) -> Vec<f64> {
        let v: Vec<f64> =
            self.order.iter().map(|&j| (free[j] - self.centre[j]) / self.scale[j]).collect();
        let places = self.places.iter().enumerate();
        let back = places.map(|(k, place)| {
            let (location, log_scale) = place.at(&v[..k], self.products());
            (v[k] - location) * (-log_scale).exp()
        });
        back.collect()
    }

    /// The gradient of the transported log density at a point, from that of the free one.
    pub fn pulled(&self, z: &[f64], gradient: &[f64]) -> Vec<f64> {
        let Reached { v, log_scale } = self.reached(z);
        let mut by_v: Vec<f64> = self.order.iter().map(|&j| gradient[j] * self.scale[j]).collect();
        let mut by_z = vec![0.0; z.len()];
        for (k, place) in self.places.iter().enumerate().rev() {
            let (weight, scale) = (by_v[k], log_scale[k].exp());
            by_z[k] = weight * scale;
            // The determinant has the logarithm of the scale itself, the point its exponential.
            let by_log = weight * scale * z[k] + 1.0;
            place.add_slopes(&v[..k], self.products(), weight, by_log, &mut by_v[..k]);
        }
        by_z
    }
}

/// Coordinates in the order of the triangle: first those from which the others are predicted better than they are from the
/// others.
fn ordered(columns: &[Vec<f64>], chains: usize) -> Vec<usize> {
    let d = columns.len();
    let gain = |from: &[f64], to: &[f64]| {
        if d <= MOST_PAIRS { predicted(from, to, chains) } else { correlated(from, to) }
    };
    let pairs =
        Matrix::from_fn(d, d, |j, k| if j == k { 0.0 } else { gain(&columns[j], &columns[k]) });
    let score = |j: usize| (0..d).map(|k| pairs[(j, k)] - pairs[(k, j)]).sum::<f64>();
    let scores: Vec<f64> = (0..d).map(score).collect();
    let mut order: Vec<usize> = (0..d).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]).then(a.cmp(&b)));
    order
}

/// Gain in the log density of one coordinate by another.
fn predicted(from: &[f64], to: &[f64], chains: usize) -> f64 {
    let given: Vec<Vec<f64>> = from.iter().map(|x| vec![*x]).collect();
    let dependence = Dependence { given: &given, values: to, chains, products: false };
    fit::place(&dependence).map_or(0.0, |(_, gain)| gain)
}

/// Correlations of a coordinate with the scale and with the location of another, squared.
fn correlated(from: &[f64], to: &[f64]) -> f64 {
    let log_squares: Vec<f64> = to.iter().map(|x| (x * x + 1e-12).ln()).collect();
    let squares: Vec<f64> = from.iter().map(|x| x * x).collect();
    correlation(from, &log_squares).powi(2) + correlation(&squares, to).powi(2)
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (of_a, of_b) = (mean(a), mean(b));
    let together: f64 = a.iter().zip(b).map(|(x, y)| (x - of_a) * (y - of_b)).sum();
    let spread = (variance(a) * variance(b)).sqrt() * (a.len() as f64 - 1.0);
    if spread > 0.0 { together / spread } else { 0.0 }
}
