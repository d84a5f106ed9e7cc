//! Distributions as sums over many nodes, fine enough for the moments that orthogonal polynomials need.

use lacuna::math::distribution::Distribution;

use super::recurrence::Recurrence;

/// A change of variable `x(s)` after which the density is smooth and decays at least exponentially.
#[derive(Debug, Clone, Copy)]
enum Change {
    /// `x = origin + unit s`.
    Affine { origin: f64, unit: f64 },
    /// `x = unit exp(s)`.
    Exponential { unit: f64 },
    /// `x = origin + unit sinh(s)`.
    Sine { origin: f64, unit: f64 },
}

/// A piece of a distribution: start, largest extent, and width of the panels.
#[derive(Debug, Clone, Copy)]
struct Piece {
    change: Change,
    start: f64,
    low: f64,
    high: f64,
    /// Width of a panel.
    width: f64,
}

/// Number of nodes of each panel.
const NODES: usize = 32;
/// Log ratio at which a piece is cut off: the integrand of the highest moment is there `exp(-NEGLIGIBLE)` of its
/// maximum.
const NEGLIGIBLE: f64 = 80.0;
/// Largest number of steps to an end of a piece. A density that has not decayed there is that of a single number to double
/// precision, or zero everywhere.
const STEPS: usize = 100_000;
/// Distance from the first infinite moment below which moments are not computed, because their tails are too long.
const NEAR_INFINITE: f64 = 0.1;

impl Change {
    fn at(self, s: f64) -> f64 {
        match self {
            Self::Affine { origin, unit } => origin + unit * s,
            Self::Exponential { unit } => unit * s.exp(),
            Self::Sine { origin, unit } => origin + unit * s.sinh(),
        }
    }

    /// Returns `ln dx/ds`.
    fn ln_slope(self, s: f64) -> f64 {
        match self {
            Self::Affine { unit, .. } => unit.ln(),
            Self::Exponential { unit } => unit.ln() + s,
            Self::Sine { unit, .. } => unit.ln() + s.cosh().ln(),
        }
    }
}

/// Returns the largest degree for which the distribution has orthogonal polynomials: the moment of twice the degree
/// must be finite. `None` without limit.
pub fn largest_degree(law: &Distribution) -> Option<usize> {
    let below = |moments: f64| Some((0.5 * (moments - NEAR_INFINITE)).max(0.0).floor() as usize);
    match *law {
        Distribution::StudentT([dof, ..]) | Distribution::HalfStudentT([dof, _]) => below(dof),
        Distribution::InverseGamma([shape, _]) => below(shape),
        // The squares of the recurrence's entries grow like exp(4 n sigma^2).
        Distribution::LogNormal([_, sigma]) => Some((150.0 / (sigma * sigma)).floor() as usize),
        _ => None,
    }
}

/// Returns the recurrence of the polynomials that are orthonormal under a distribution, in the variable
/// `(x - centre) / scale`, by quadrature.
pub fn recurrence(law: &Distribution, degree: usize, centre: f64, scale: f64) -> Recurrence {
    let (mut nodes, mut weights) = (Vec::new(), Vec::new());
    // A rule with so few nodes always exists.
    let rule = Recurrence::legendre(NODES).gauss(NODES).unwrap_or_default();
    for piece in pieces(law, degree) {
        let (low, high) = piece.reach(law, degree, centre, scale);
        let panels = ((high - low) / piece.width).ceil().max(1.0);
        let width = (high - low) / panels;
        for panel in 0..panels as usize {
            for (node, weight) in &rule {
                let s = low + width * (panel as f64 + 0.5 * (1.0 + node));
                nodes.push((piece.change.at(s) - centre) / scale);
                weights.push(weight * width * piece.ln_weight(law, s).exp());
            }
        }
    }
    Recurrence::stieltjes(degree, &nodes, &weights)
}

fn pieces(law: &Distribution, degree: usize) -> Vec<Piece> {
    const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
    let piece = |change, start, (low, high), width| Piece { change, start, low, high, width };
    let between = |from: f64, to: f64| {
        let change = Change::Affine { origin: from, unit: to - from };
        piece(change, 0.0, (0.0, 1.0), 16.0 / degree.max(16) as f64)
    };
    match *law {
        Distribution::LogUniform([low, high]) => {
            let bounds = (low.ln(), high.ln());
            let width = 16.0 / (2 * degree + 1) as f64;
            vec![piece(Change::Exponential { unit: 1.0 }, bounds.0, bounds, width)]
        }
        Distribution::InverseGamma([shape, scale]) => {
            let width = 0.5 / shape.max(1.0).sqrt();
            vec![piece(Change::Exponential { unit: scale }, -shape.ln(), ALL, width)]
        }
        Distribution::Exponential(scale) => pieces(&Distribution::Gamma([1.0, scale]), degree),
        Distribution::Gamma([shape, scale]) => {
            let width = 0.5 / shape.max(1.0).sqrt();
            vec![piece(Change::Exponential { unit: scale }, shape.ln(), ALL, width)]
        }
        Distribution::LogNormal([mu, sigma]) => {
            vec![piece(Change::Exponential { unit: mu.exp() }, 0.0, ALL, 0.5 * sigma)]
        }
        Distribution::StudentT([_, location, scale]) => {
            vec![piece(Change::Sine { origin: location, unit: scale }, 0.0, ALL, 0.25)]
        }
        Distribution::HalfStudentT([_, scale]) => {
            let change = Change::Sine { origin: 0.0, unit: scale };
            vec![piece(change, 0.0, (0.0, f64::INFINITY), 0.25)]
        }
        Distribution::Normal([mean, sd]) => {
            vec![piece(Change::Affine { origin: mean, unit: sd }, 0.0, ALL, 0.5)]
        }
        Distribution::HalfNormal(scale) => {
            let change = Change::Affine { origin: 0.0, unit: scale };
            vec![piece(change, 0.0, (0.0, f64::INFINITY), 0.5)]
        }
        Distribution::TruncatedNormal([mean, sd, low, high]) => {
            let mode = mean.clamp(low, high);
            // Far from the mean the density decays like an exponential with this scale.
            let unit = sd / (1.0 + ((mode - mean) / sd).abs());
            let bounds = ((low - mode) / unit, (high - mode) / unit);
            vec![piece(Change::Affine { origin: mode, unit }, 0.0, bounds, 0.5)]
        }
        Distribution::Uniform([low, high]) | Distribution::Beta([_, _, low, high]) => {
            vec![between(low, high)]
        }
        Distribution::Quantiles(ref numbers) => {
            let (values, last) = (&numbers[3..], numbers.len() - 4);
            let tail = |from: f64, unit: f64, bound: f64| {
                let end = (bound - from) / unit;
                let bounds = (end.min(0.0), end.max(0.0));
                piece(Change::Affine { origin: from, unit }, 0.0, bounds, 0.5)
            };
            let mut all = vec![tail(values[0], values[1] - values[0], numbers[0])];
            all.extend(values.windows(2).map(|pair| between(pair[0], pair[1])));
            all.push(tail(values[last], values[last] - values[last - 1], numbers[1]));
            all
        }
        Distribution::Triangular([low, mode, high]) => {
            let halves = [(low, mode), (mode, high)].into_iter();
            halves.filter(|(from, to)| from < to).map(|(from, to)| between(from, to)).collect()
        }
    }
}

impl Piece {
    fn ln_weight(&self, law: &Distribution, s: f64) -> f64 {
        law.log_density(self.change.at(s)) + self.change.ln_slope(s)
    }

    /// Returns the ends of the piece for moments up to `2 degree`; NaN where the density does not decay.
    fn reach(&self, law: &Distribution, degree: usize, centre: f64, scale: f64) -> (f64, f64) {
        let size = |s: f64| {
            let z = ((self.change.at(s) - centre) / scale).abs().max(1.0);
            self.ln_weight(law, s) + (2 * degree + 1) as f64 * z.ln()
        };
        let end = |bound: f64, step: f64| {
            if bound.is_finite() && ((bound - self.start) / step) < 64.0 {
                return bound;
            }
            let (mut s, mut largest) = (self.start, f64::NEG_INFINITY);
            for _ in 0..STEPS {
                let here = size(s);
                largest = largest.max(here);
                if here < largest - NEGLIGIBLE || (bound - s) * step <= 0.0 {
                    return if (bound - s) * step <= 0.0 { bound } else { s };
                }
                s += step;
            }
            f64::NAN
        };
        (end(self.low, -self.width), end(self.high, self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_density_without_an_end_has_no_recurrence() {
        for law in [
            Distribution::TruncatedNormal([0.5, 1e-30, -1.5, 1.5]),
            Distribution::Quantiles(vec![-1e300, f64::INFINITY, 2.0, 0.1, 0.1 + 1e-16, 0.3]),
        ] {
            assert_eq!(law.check(), Ok(()), "{law:?}");
            let found = recurrence(&law, 3, 0.5, 1.0);
            assert!(found.sizes.iter().all(|x| !x.is_finite()), "{law:?}: {found:?}");
        }
        // A standard deviation far above the interval leaves a uniform distribution.
        let found = recurrence(&Distribution::TruncatedNormal([0.0, 1e5, -1.0, 1.0]), 3, 0.0, 1.0);
        let uniform = Recurrence::legendre(3);
        let mut pairs = found.sizes.iter().zip(&uniform.sizes);
        assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
    }
}
