//! Test functions, designs and shortcuts to fits.

use lacuna::data::{Axis, Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::plugin::Forward;
use lacuna::plugin::surrogate::Training;
use lacuna::run::{Progress, Silent, Stop, Tasks};
use lacuna_linalg::Matrix;

use crate::surrogates::polynomial_chaos::{Degree, DegreeRange, Expansion, PolynomialChaos, fit};

/// A function on a box.
#[derive(Clone, Copy)]
pub struct Function {
    pub ranges: &'static [[f64; 2]],
    pub value: fn(&[f64]) -> f64,
}

const PI: f64 = std::f64::consts::PI;

/// Ishigami and Homma (1990), a = 7, b = 0.1.
pub const ISHIGAMI: Function = Function {
    ranges: &[[-PI, PI]; 3],
    value: |x| x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin(),
};

/// Output transformerless push-pull circuit (Ben-Ari and Steinberg 2007), mid-point voltage.
pub const CIRCUIT: Function = Function {
    ranges: &[[50.0, 150.0], [25.0, 70.0], [0.5, 3.0], [1.2, 2.5], [0.25, 1.2], [50.0, 300.0]],
    value: |x| {
        let [rb1, rb2, rf, rc1, rc2, beta] = [x[0], x[1], x[2], x[3], x[4], x[5]];
        let gain = beta * (rc2 + 9.0);
        let vb1 = 12.0 * rb2 / (rb1 + rb2);
        ((vb1 + 0.74) * gain + 11.35 * rf + 0.74 * rf * gain / rc1) / (gain + rf)
    },
};

/// Flow through a borehole (Harper and Gupta 1983), all inputs uniform.
pub const BOREHOLE: Function = Function {
    ranges: &[
        [0.05, 0.15],
        [100.0, 50_000.0],
        [63_070.0, 115_600.0],
        [990.0, 1110.0],
        [63.1, 116.0],
        [700.0, 820.0],
        [1120.0, 1680.0],
        [9855.0, 12_045.0],
    ],
    value: |x| {
        let [rw, r, tu, hu, tl, hl, l, kw] = [x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]];
        let log = (r / rw).ln();
        2.0 * PI * tu * (hu - hl) / (log * (1.0 + 2.0 * l * tu / (log * rw * rw * kw) + tu / tl))
    },
};

/// The g-function of Sobol' with eight parameters, a = 1, 2, 5, 10, 20, 50, 100, 500.
pub const SOBOL_G: Function = Function {
    ranges: &[[0.0, 1.0]; 8],
    value: |x| {
        let factor = |(x, a): (&f64, f64)| ((4.0 * x - 2.0).abs() + a) / (1.0 + a);
        x.iter().zip(SOBOL_G_WEIGHTS).map(factor).product()
    },
};

/// `a` of [`SOBOL_G`].
pub const SOBOL_G_WEIGHTS: [f64; 8] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 500.0];

/// Direction numbers of Joe and Kuo (2008), file new-joe-kuo-6.21201: degree, polynomial, m.
const DIRECTIONS: [(usize, u32, &[u32]); 7] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
];

/// The first points of the unscrambled Sobol' sequence in Gray-code order, without the origin.
pub fn sobol(n: usize, dimension: usize) -> Matrix {
    let directions: Vec<Vec<u32>> = (0..dimension).map(direction_numbers).collect();
    let mut state = vec![0_u32; dimension];
    let mut points = Matrix::zeros(n, dimension);
    for i in 0..n {
        let bit = i.trailing_ones() as usize;
        for j in 0..dimension {
            state[j] ^= directions[j][bit];
            points[(i, j)] = f64::from(state[j]) / 4_294_967_296.0;
        }
    }
    points
}

fn direction_numbers(dimension: usize) -> Vec<u32> {
    if dimension == 0 {
        return (0..32).map(|i| 1 << (31 - i)).collect();
    }
    let (s, a, m) = DIRECTIONS[dimension - 1];
    let mut v: Vec<u32> = (0..s).map(|i| m[i] << (31 - i)).collect();
    for i in s..32 {
        let mut next = v[i - s] ^ (v[i - s] >> s);
        for k in 1..s {
            if (a >> (s - 1 - k)) & 1 == 1 {
                next ^= v[i - k];
            }
        }
        v.push(next);
    }
    v
}

pub fn latin_hypercube(n: usize, dimension: usize, seed: u64) -> Matrix {
    let mut points = Matrix::zeros(n, dimension);
    for j in 0..dimension {
        let mut rng = Stream::root(seed).at(j as u64).generator();
        for (i, cell) in permutation(&mut rng, n).into_iter().enumerate() {
            points[(i, j)] = (cell as f64 + uniform(&mut rng)) / n as f64;
        }
    }
    points
}

pub fn monte_carlo(n: usize, dimension: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).named("monte carlo").generator();
    Matrix::from_fn(n, dimension, |_, _| uniform(&mut rng))
}

/// Scales points of the unit cube to physical ranges.
pub fn scaled(unit: &Matrix, ranges: &[[f64; 2]]) -> Matrix {
    Matrix::from_fn(unit.rows(), unit.columns(), |i, j| {
        let [low, high] = ranges[j];
        low + (high - low) * unit[(i, j)]
    })
}

pub fn parameter(name: &str, design: Distribution) -> Parameter {
    Parameter {
        name: name.into(),
        symbol: name.into(),
        unit: Unit::parse("1").unwrap(),
        prior: design.clone(),
        design,
        reference: None,
    }
}

pub fn parameters(ranges: &[[f64; 2]]) -> Vec<Parameter> {
    let laws: Vec<_> = ranges.iter().map(|range| Distribution::Uniform(*range)).collect();
    parameters_of(&laws)
}

pub fn parameters_of(laws: &[Distribution]) -> Vec<Parameter> {
    let named = |(i, law): (usize, &Distribution)| parameter(&format!("x{}", i + 1), law.clone());
    laws.iter().enumerate().map(named).collect()
}

pub fn layout(outputs: usize) -> Layout {
    let labels = (0..outputs).map(|o| format!("s{o}"));
    Layout {
        name: "strain".into(),
        unit: Unit::parse("1").unwrap(),
        axes: vec![Axis::labels("sensor", labels)],
    }
}

pub fn fitted(
    options: &PolynomialChaos,
    ranges: &[[f64; 2]],
    points: &Matrix,
    responses: &Matrix,
) -> Result<Expansion, Stop> {
    fitted_to(options, &parameters(ranges), points, responses)
}

pub fn fitted_to(
    options: &PolynomialChaos,
    parameters: &[Parameter],
    points: &Matrix,
    responses: &Matrix,
) -> Result<Expansion, Stop> {
    let layouts = layout(responses.columns()).into();
    let training = Training { parameters, layouts: &layouts, points, responses, gradients: None };
    fit::fit(options, &training, &Stream::root(1), &Progress::new(&Silent), Tasks::here())
}

impl Function {
    pub fn dimension(&self) -> usize {
        self.ranges.len()
    }

    pub fn values(&self, points: &Matrix) -> Matrix {
        Matrix::from_fn(points.rows(), 1, |i, _| (self.value)(points.row(i)))
    }

    /// Fits the expansion to runs at these points of the unit cube.
    pub fn fit(&self, options: &PolynomialChaos, unit: &Matrix) -> Expansion {
        let points = scaled(unit, self.ranges);
        fitted(options, self.ranges, &points, &self.values(&points)).unwrap()
    }

    /// Returns the mean squared error on `n` random points relative to the variance there.
    pub fn validation(&self, expansion: &Expansion, n: usize) -> f64 {
        let points = scaled(&monte_carlo(n, self.dimension(), 99), self.ranges);
        let (truth, emulated) = (self.values(&points), expansion.mean(&points));
        let mean = truth.as_slice().iter().sum::<f64>() / n as f64;
        let variance: f64 = truth.as_slice().iter().map(|y| (y - mean).powi(2)).sum();
        let pairs = truth.as_slice().iter().zip(emulated.as_slice());
        pairs.map(|(y, e)| (y - e).powi(2)).sum::<f64>() / variance
    }
}

pub fn up_to(min: usize, max: usize) -> PolynomialChaos {
    PolynomialChaos { degree: Degree::Range(DegreeRange { min, max }), ..Default::default() }
}

pub fn of_degree(degree: usize) -> PolynomialChaos {
    PolynomialChaos { degree: Degree::Fixed(degree), ..Default::default() }
}
