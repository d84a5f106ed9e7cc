//! Two masses in a chain, driven by a force: the model, and physics that the model lacks.

use std::sync::OnceLock;

use crate::{FINE, Fine, SAMPLES, STEP};

/// Names of the model's parameters.
pub const PARAMETERS: [&str; 4] = ["k1", "k2", "c", "force"];

/// Values of the parameters at the middle of the priors.
pub const REFERENCE: [f64; 4] = [4.0, 2.0, 0.4, 1.0];

/// Number of input signals: an impact and a slow sweep.
pub const CONDITIONS: usize = 2;

/// The chain, including physics that the model may lack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain {
    /// `k1`, `k2`, `c` and the gain of the force.
    pub parameters: [f64; 4],
    /// Cubic stiffness parallel to `k1`.
    pub cubic: f64,
    /// Drag coefficient of the first mass, quadratic in its speed.
    pub drag: f64,
    /// Additional stiffness of `k2` under tension only.
    pub switching: f64,
}

impl Chain {
    /// The chain without additional physics: the model.
    pub fn plain(parameters: [f64; 4]) -> Self {
        Self { parameters, cubic: 0.0, drag: 0.0, switching: 0.0 }
    }

    fn force(condition: usize, t: f64) -> f64 {
        match condition {
            0 => (-((t - 1.0) / 0.35).powi(2)).exp() * 4.0,
            _ => ((0.8 + 0.12 * t) * t).sin(),
        }
    }

    /// The force at the beginning, the middle and the end of each fine step.
    fn forces(condition: usize) -> &'static [[f64; 3]] {
        static FORCES: [OnceLock<Vec<[f64; 3]>>; CONDITIONS] =
            [const { OnceLock::new() }; CONDITIONS];
        FORCES[condition].get_or_init(|| {
            let h = STEP / FINE as f64;
            let times = (0..=FINE * (SAMPLES - 1)).map(|step| h * step as f64);
            times.map(|t| [t, t + 0.5 * h, t + h].map(|t| Self::force(condition, t))).collect()
        })
    }

    fn rate(&self, driving: f64, [x1, x2, v1, v2]: [f64; 4]) -> [f64; 4] {
        let [k1, k2, c, force] = self.parameters;
        let stretch = x2 - x1;
        let switched = if stretch > 0.0 { self.switching * stretch } else { 0.0 };
        let spring = k2 * stretch + switched;
        let drag = self.drag * v1 * v1.abs();
        let a1 = force * driving - k1 * x1 - self.cubic * x1.powi(3) - c * v1 - drag + spring;
        let a2 = -spring - c * v2;
        [v1, v2, a1, a2]
    }

    /// Curves of the sensors at fine sampling, by the classical Runge-Kutta method.
    pub fn curves(&self, condition: usize) -> Fine {
        let h = STEP / FINE as f64;
        let mut state = [0.0; 4];
        let mut curves = vec![Vec::new(); 4];
        for driving in Self::forces(condition) {
            let now = self.rate(driving[0], state);
            for (curve, y) in curves.iter_mut().zip([state[0], state[1], state[2], now[3]]) {
                curve.push(y);
            }
            let moved = |by: f64, rate: [f64; 4]| {
                let mut next = state;
                next.iter_mut().zip(rate).for_each(|(x, r)| *x += by * r);
                next
            };
            let second = self.rate(driving[1], moved(0.5 * h, now));
            let third = self.rate(driving[1], moved(0.5 * h, second));
            let fourth = self.rate(driving[2], moved(h, third));
            for i in 0..4 {
                state[i] += h / 6.0 * (now[i] + 2.0 * second[i] + 2.0 * third[i] + fourth[i]);
            }
        }
        curves
    }
}
