//! A mass on a spring with more than Hooke and Stokes: the classical method of Runge and Kutta of order four at steps of a
//! millisecond.

/// The rate of the speed is `-stiffness x - damping v - cubic x³ - quadratic v |v|`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// 1/s².
    pub stiffness: f64,
    /// 1/s.
    pub damping: f64,
    /// 1/(m² s²).
    pub cubic: f64,
    /// 1/m.
    pub quadratic: f64,
    /// Where it is let go, m.
    pub start: f64,
}

/// The step, s.
const STEP: f64 = 1e-3;

impl Oscillator {
    fn rates(&self, [x, v]: [f64; 2]) -> [f64; 2] {
        let spring = self.stiffness * x + self.cubic * x * x * x;
        [v, -spring - self.damping * v - self.quadratic * v * v.abs()]
    }

    /// The deflection `each` milliseconds apart, `count` times; the first not at the start but one interval behind.
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
