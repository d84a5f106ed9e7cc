//! Published test functions of many inputs.

use lacuna::math::distribution::Distribution;
use lacuna_linalg::{Matrix, symmetric_eigen};

/// Value at a point in the units of the designs.
type Value = Box<dyn Fn(&[f64]) -> f64>;

/// A function, the designs of its inputs and its source.
pub struct Function {
    pub name: &'static str,
    pub designs: Vec<Distribution>,
    pub value: Value,
}

fn uniform(low: f64, high: f64) -> Distribution {
    Distribution::Uniform([low, high])
}

/// Water through a borehole (Harper and Gupta 1983; Morris, Mitchell and Ylvisaker 1993), 8 inputs.
pub fn borehole() -> Function {
    let designs = [
        [0.05, 0.15],
        [100.0, 50_000.0],
        [63_070.0, 115_600.0],
        [990.0, 1110.0],
        [63.1, 116.0],
        [700.0, 820.0],
        [1120.0, 1680.0],
        [9855.0, 12_045.0],
    ];
    let value = |x: &[f64]| {
        let ratio = (x[1] / x[0]).ln();
        let leak = 2.0 * x[6] * x[2] / (ratio * x[0] * x[0] * x[7]);
        2.0 * std::f64::consts::PI * x[2] * (x[3] - x[5]) / (ratio * (1.0 + leak + x[2] / x[4]))
    };
    let designs = designs.iter().map(|&[low, high]| uniform(low, high)).collect();
    Function { name: "borehole", designs, value: Box::new(value) }
}

/// The function of Welch et al., Technometrics 34 (1992) 15, 20 inputs.
pub fn welch() -> Function {
    let value = |x: &[f64]| {
        let linear: f64 = [
            (5, 1.0),
            (2, 0.05),
            (3, 0.08),
            (6, -0.03),
            (7, 0.03),
            (9, -0.09),
            (10, -0.01),
            (11, -0.07),
            (14, -0.04),
            (15, 0.06),
            (17, -0.01),
            (18, -0.03),
            (19, -5.0),
        ]
        .iter()
        .map(|&(k, c): &(usize, f64)| c * x[k - 1])
        .sum();
        5.0 * x[11] / (1.0 + x[0])
            + 5.0 * (x[3] - x[19]).powi(2)
            + 40.0 * x[18].powi(3)
            + 0.25 * x[12].powi(2)
            + linear
    };
    Function { name: "Welch", designs: vec![uniform(-0.5, 0.5); 20], value: Box::new(value) }
}

/// The function of Morris, Technometrics 33 (1991) 161, with the coefficients that the paper draws at random replaced
/// as in Saltelli et al., *Global Sensitivity Analysis: The Primer* (2008): `(-1)^i` and `(-1)^(i+j)`; 20 inputs.
pub fn morris() -> Function {
    let value = |x: &[f64]| {
        let w: Vec<f64> = (0..20)
            .map(|i| match i {
                2 | 4 | 6 => 2.0 * (1.1 * x[i] / (x[i] + 0.1) - 0.5),
                _ => 2.0 * (x[i] - 0.5),
            })
            .collect();
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut sum = 0.0;
        for i in 0..20 {
            sum += if i < 10 { 20.0 } else { sign(i + 1) } * w[i];
            for j in i + 1..20 {
                sum += if j < 6 { -15.0 } else { sign(i + j) } * w[i] * w[j];
                for k in j + 1..5 {
                    sum -= 10.0 * w[i] * w[j] * w[k];
                }
            }
        }
        sum + 5.0 * w[0] * w[1] * w[2] * w[3]
    };
    Function { name: "Morris", designs: vec![uniform(0.0, 1.0); 20], value: Box::new(value) }
}

/// The function of UQLab's example of sensitivity in high dimension (Marelli et al., UQLab user manual: sensitivity
/// analysis), 100 inputs.
pub fn uqlab() -> Function {
    let value = |x: &[f64]| {
        let m = x.len() as f64;
        let sum = |power: i32| -> f64 {
            x.iter().enumerate().map(|(k, x)| (k + 1) as f64 * x.powi(power)).sum()
        };
        let inner = (sum(2) + sum(4)) / (3.0 * m);
        3.0 - 5.0 / m * sum(1) + sum(3) / m + inner.ln() + x[0] * x[1].powi(2) - x[1] * x[3]
            + x[2] * x[4]
            + x[50]
            + x[49] * x[53].powi(2)
    };
    let mut designs = vec![uniform(1.0, 2.0); 100];
    designs[19] = uniform(1.0, 3.0);
    Function { name: "UQLab, 100 inputs", designs, value: Box::new(value) }
}

/// Diffusion in a rod with a random coefficient: `(a u')' = -1`, `u(0) = 0`, `u'(1) = 0`, and `ln a` a normal field
/// with standard deviation 0.5 and covariance `exp(-|x - y| / 0.2)` in its Karhunen-Loève expansion (Ghanem and
/// Spanos, *Stochastic Finite Elements*, 1991). The value is `u(1)`, the integral of `(1 - x) / a(x)`.
pub fn diffusion(inputs: usize) -> Function {
    const CELLS: usize = 128;
    let place = |i: usize| (i as f64 + 0.5) / CELLS as f64;
    let covariance =
        Matrix::from_fn(CELLS, CELLS, |i, j| 0.25 * (-(place(i) - place(j)).abs() / 0.2).exp());
    let eigen = symmetric_eigen(&covariance).unwrap();
    // Largest eigenvalues first.
    let mut order: Vec<usize> = (0..CELLS).collect();
    order.sort_by(|&a, &b| eigen.values[b].total_cmp(&eigen.values[a]));
    let modes = Matrix::from_fn(CELLS, inputs, |i, k| {
        eigen.vectors[(i, order[k])] * eigen.values[order[k]].max(0.0).sqrt()
    });
    let value = move |xi: &[f64]| {
        (0..CELLS)
            .map(|i| {
                let field: f64 = modes.row(i).iter().zip(xi).map(|(m, x)| m * x).sum();
                (1.0 - place(i)) * (-field).exp() / CELLS as f64
            })
            .sum()
    };
    let name = if inputs == 50 { "diffusion, 50 inputs" } else { "diffusion, 100 inputs" };
    let designs = vec![Distribution::Normal([0.0, 1.0]); inputs];
    Function { name, designs, value: Box::new(value) }
}
