//! `one_comp_mm_elim_abs`: one compartment, first-order absorption, Michaelis-Menten elimination.

use lacuna::math::distribution::Distribution::HalfNormal;

use super::{Model, Posterior, Real, file, half_cauchy, normal};

/// Point: `k_a`, `K_m`, `V_m`, sigma.
struct Compartment {
    dose: f64,
    volume: f64,
    times: Vec<f64>,
    concentrations: Vec<f64>,
}

/// Largest step of the fourth-order Runge-Kutta method, in days.
const STEP: f64 = 1.0 / 128.0;

impl Model for Compartment {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let &[absorption, half, fastest, sigma] = point else { unreachable!("four unknowns") };
        let mut sum = R::from(0.0);
        for x in point {
            sum = sum + half_cauchy(*x, 1.0);
        }
        let supply = absorption * R::from(self.dose / self.volume);
        let drain = fastest / R::from(self.volume);
        let rate =
            |t: f64, c: R| (-absorption * R::from(t)).exp() * supply - drain * c / (half + c);
        let (mut time, mut c) = (0.0, R::from(0.0));
        for (end, measured) in self.times.iter().zip(&self.concentrations) {
            let steps = ((end - time) / STEP).ceil();
            let h = (end - time) / steps;
            let (whole, middle) = (R::from(h), R::from(0.5 * h));
            for _ in 0..steps as usize {
                let a = rate(time, c);
                let b = rate(time + 0.5 * h, c + middle * a);
                let d = rate(time + 0.5 * h, c + middle * b);
                let e = rate(time + h, c + whole * d);
                c = c + whole * (a + (b + d) * R::from(2.0) + e) / R::from(6.0);
                time += h;
            }
            time = *end;
            sum = sum + normal(R::from(measured.ln()), c.ln(), sigma);
        }
        sum
    }
}

pub(super) fn posterior() -> Posterior {
    let file = file!("one_comp_mm_elim_abs-one_comp_mm_elim_abs");
    let model = Compartment {
        dose: file.number("D"),
        volume: file.number("V"),
        times: file.vector("times"),
        concentrations: file.vector("C_hat"),
    };
    let starts = ["k_a", "K_m", "V_m", "sigma"].map(|name| (name, HalfNormal(1.0))).to_vec();
    file.posterior(model, starts)
}
