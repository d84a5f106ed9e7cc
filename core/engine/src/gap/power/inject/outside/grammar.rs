//! Random terms of a grammar: expressions of the response, its derivative, its integral and the place along the curve.

use lacuna::math::random::{below, uniform};
use rand::Rng;

use super::record::{Record, normed};

/// The number of operations of an expression, at least and at most.
const OPERATIONS: [usize; 2] = [2, 4];

/// The powers that are drawn lie between these.
const POWERS: [f64; 2] = [0.5, 3.0];

/// An expression.
#[derive(Debug, Clone, PartialEq)]
pub enum Expression {
    /// The response over its largest absolute value.
    Response,
    /// The derivative along the curve, likewise.
    Slope,
    /// The integral from the beginning, likewise.
    Integral,
    /// The place along the curve, from 0 to 1.
    Place,
    /// The sum of two.
    Sum(Box<[Self; 2]>),
    /// The product of two.
    Product(Box<[Self; 2]>),
    /// The absolute value.
    Absolute(Box<Self>),
    /// The power of the absolute value, with the sign of the value.
    Power(Box<Self>, f64),
    /// The hyperbolic tangent of the value times this factor.
    Tanh(Box<Self>, f64),
    /// The value between these limits.
    Clip(Box<Self>, [f64; 2]),
}

impl Expression {
    /// A random expression.
    pub fn random(rng: &mut impl Rng) -> Self {
        let [least, most] = OPERATIONS;
        let count = least + below(rng, most - least + 1);
        Self::of(rng, count)
    }

    /// A random expression of this number of operations.
    fn of(rng: &mut impl Rng, operations: usize) -> Self {
        if operations == 0 {
            let all = [Self::Response, Self::Slope, Self::Integral, Self::Place];
            return all[below(rng, all.len())].clone();
        }
        let kind = below(rng, 6);
        if kind < 2 {
            let left = below(rng, operations);
            let both = Box::new([Self::of(rng, left), Self::of(rng, operations - 1 - left)]);
            return if kind == 0 { Self::Sum(both) } else { Self::Product(both) };
        }
        let inner = Box::new(Self::of(rng, operations - 1));
        match kind {
            2 => Self::Absolute(inner),
            3 => {
                let [low, high] = POWERS;
                Self::Power(inner, low + (high - low) * uniform(rng))
            }
            4 => Self::Tanh(inner, 1.0 + 5.0 * uniform(rng)),
            _ => {
                let low = -0.1 - 0.7 * uniform(rng);
                Self::Clip(inner, [low, 0.1 + 0.7 * uniform(rng)])
            }
        }
    }

    /// The values along a record, over their largest absolute value, so that powers and limits act on all curves alike.
    pub fn values(&self, record: &Record) -> Vec<f64> {
        let each = |inner: &Self, f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            inner.values(record).into_iter().map(f).collect()
        };
        let both = |two: &[Self; 2], f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            let [a, b] = [&two[0], &two[1]].map(|inner| inner.values(record));
            a.iter().zip(b).map(|(a, b)| f(*a, b)).collect()
        };
        let values = match self {
            Self::Response => record.y.clone(),
            Self::Slope => record.slope(),
            Self::Integral => record.integral(),
            Self::Place => record.at.clone(),
            Self::Sum(two) => both(two, &|a, b| a + b),
            Self::Product(two) => both(two, &|a, b| a * b),
            Self::Absolute(inner) => each(inner, &f64::abs),
            Self::Power(inner, power) => each(inner, &|x| x.signum() * x.abs().powf(*power)),
            Self::Tanh(inner, factor) => each(inner, &|x| (factor * x).tanh()),
            Self::Clip(inner, [low, high]) => each(inner, &|x| x.clamp(*low, *high)),
        };
        normed(values)
    }

    /// The expression in words: `y`, `dy`, `int(y)` and `t` stand for response, derivative, integral and place.
    pub fn text(&self) -> String {
        match self {
            Self::Response => "y".into(),
            Self::Slope => "dy".into(),
            Self::Integral => "int(y)".into(),
            Self::Place => "t".into(),
            Self::Sum(two) => format!("({} + {})", two[0].text(), two[1].text()),
            Self::Product(two) => format!("{} * {}", two[0].text(), two[1].text()),
            Self::Absolute(inner) => format!("|{}|", inner.text()),
            Self::Power(inner, power) => format!("({})^{power:.2}", inner.text()),
            Self::Tanh(inner, factor) => format!("tanh({factor:.2} ({}))", inner.text()),
            Self::Clip(inner, [low, high]) => {
                format!("clip({}, {low:.2}, {high:.2})", inner.text())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::Stream;

    /// On `y = t` the derivative is 1 and the integral `t^2`, both over their largest values; `|y| * int(y)` is `t^3`.
    #[test]
    fn terms_have_their_values() {
        let at: Vec<f64> = (0..=100).map(|i| f64::from(i) / 100.0).collect();
        let record = Record { y: at.clone(), at: at.clone(), scale: 1.0, place: 0.0 };
        let absolute = Expression::Absolute(Box::new(Expression::Response));
        let product = Expression::Product(Box::new([absolute, Expression::Integral]));
        let clip = Expression::Clip(Box::new(Expression::Response), [-0.5, 0.25]);
        let power = Expression::Power(Box::new(Expression::Place), 0.5);
        for (i, t) in at.iter().enumerate() {
            assert!((Expression::Slope.values(&record)[i] - 1.0).abs() < 1e-12);
            assert!((product.values(&record)[i] - t.powi(3)).abs() < 1e-12);
            assert!((clip.values(&record)[i] - (4.0 * t).min(1.0)).abs() < 1e-12);
            assert!((power.values(&record)[i] - t.sqrt()).abs() < 1e-12);
        }
        assert_eq!(product.text(), "|y| * int(y)");
    }

    #[test]
    fn random_terms_are_finite_and_differ() {
        let at: Vec<f64> = (0..60).map(|i| f64::from(i) / 59.0).collect();
        let y = at.iter().map(|t| (9.0 * t).sin() * (-t).exp()).collect();
        let record = Record { y, at, scale: 1.0, place: 0.0 };
        let mut rng = Stream::root(4).generator();
        let mut texts = std::collections::BTreeSet::new();
        for _ in 0..300 {
            let term = Expression::random(&mut rng);
            assert!(term.values(&record).iter().all(|x| x.abs() <= 1.0), "{}", term.text());
            texts.insert(term.text());
        }
        assert!(texts.len() > 200, "{}", texts.len());
    }
}
