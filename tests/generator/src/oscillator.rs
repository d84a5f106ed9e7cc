//! An oscillator with nonlinear stiffness and damping, integrated by the classical fourth-order Runge-Kutta method with
//! steps of one millisecond.

/// The acceleration is `-stiffness x - damping v - cubic x³ - quadratic v |v|`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// Linear stiffness per mass, 1/s².
    pub stiffness: f64,
    /// Linear damping per mass, 1/s.
    pub damping: f64,
    /// Cubic stiffness per mass, 1/(m² s²).
    pub cubic: f64,
    /// Quadratic damping per mass, 1/m.
    pub quadratic: f64,
    /// Initial deflection, m; released from rest.
    pub start: f64,
}

/// Time step, s.
const STEP: f64 = 1e-3;

impl Oscillator {
    fn rates(&self, [x, v]: [f64; 2]) -> [f64; 2] {
        let spring = self.stiffness * x + self.cubic * x * x * x;
        [v, -spring - self.damping * v - self.quadratic * v * v.abs()]
    }

    /// The deflection at `count` times that are `each` milliseconds apart, the first one interval after the start.
    pub fn deflection(&self, each: usize, count: usize) -> Vec<f64> {
        let along = |y: [f64; 2], k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
        let mut state = [self.start, 0.0];
        let mut all = Vec::with_capacity(count);
        for step in 1..=each * count {
            let k1 = self.rates(state);
            let k2 = self.rates(along(state, k1, 0.5 * STEP));
            let k3 = self.rates(along(state, k2, 0.5 * STEP));
            let k4 = self.rates(along(state, k3, STEP));
            for i in 0..2 {
                state[i] += STEP / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
            if step % each == 0 {
                all.push(state[0]);
            }
        }
        all
    }
}
