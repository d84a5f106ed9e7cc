//! Number of cycles to failure.

/// A material under cyclic load. Stresses are in Pa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Law of the life.
    pub law: Law,
    /// Fatigue strength coefficient `σf'`.
    pub strength: f64,
    /// Fatigue strength exponent `b`.
    pub exponent: f64,
    /// Correction for the mean stress.
    pub mean: Mean,
}

/// Law of the life.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// Basquin's law; amplitudes are stresses.
    Stress,
    /// The law of Coffin, Manson and Basquin; amplitudes are strains.
    Strain {
        /// Young's modulus `E`.
        modulus: f64,
        /// Fatigue ductility coefficient `εf'`.
        ductility: f64,
        /// Fatigue ductility exponent `c`.
        ductility_exponent: f64,
    },
}

/// Correction for the mean stress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mean {
    /// None.
    None,
    /// Goodman, with the ultimate strength.
    Goodman(f64),
    /// Morrow.
    Morrow,
    /// Smith, Watson and Topper.
    SmithWatsonTopper,
}

impl Material {
    /// Damage `1/N` of one cycle with this amplitude and mean, both stresses or both strains as the law says; zero without
    /// amplitude, and NaN if the mean stress alone leads to failure.
    pub fn damage(&self, amplitude: f64, mean: f64) -> f64 {
        if amplitude == 0.0 {
            return 0.0;
        }
        2.0 * (-self.log_reversals(amplitude, mean)).exp()
    }

    /// Logarithm of the number of reversals `2N`; infinite if the cycle does no damage.
    pub fn log_reversals(&self, amplitude: f64, mean: f64) -> f64 {
        match self.law {
            Law::Stress => self.stress_life(amplitude, mean),
            Law::Strain { modulus, ductility, ductility_exponent } => {
                self.strain_life(amplitude, mean, modulus, (ductility, ductility_exponent))
            }
        }
    }

    fn stress_life(&self, amplitude: f64, mean: f64) -> f64 {
        let strength = self.strength;
        let (amplitude, strength) = match self.mean {
            Mean::None => (amplitude, strength),
            Mean::Goodman(ultimate) => (amplitude / left(1.0 - mean / ultimate), strength),
            Mean::Morrow => (amplitude, left(strength - mean)),
            Mean::SmithWatsonTopper => (((mean + amplitude).max(0.0) * amplitude).sqrt(), strength),
        };
        // Without amplitude, the logarithm and with it the life is infinite.
        (amplitude / strength).ln() / self.exponent
    }

    fn strain_life(
        &self,
        amplitude: f64,
        mean: f64,
        modulus: f64,
        (ductility, c): (f64, f64),
    ) -> f64 {
        let (strength, b) = (self.strength, self.exponent);
        match self.mean {
            Mean::SmithWatsonTopper => {
                let largest = modulus * (mean + amplitude);
                if largest <= 0.0 {
                    return f64::INFINITY;
                }
                let elastic = (strength * strength / modulus, 2.0 * b);
                sum_of_powers(elastic, (strength * ductility, b + c), largest * amplitude)
            }
            Mean::Morrow => {
                let elastic = (left(strength - modulus * mean) / modulus, b);
                sum_of_powers(elastic, (ductility, c), amplitude)
            }
            Mean::None | Mean::Goodman(_) => {
                sum_of_powers((strength / modulus, b), (ductility, c), amplitude)
            }
        }
    }
}

/// The strength that the mean stress leaves; NaN if it leaves none.
fn left(strength: f64) -> f64 {
    if strength > 0.0 { strength } else { f64::NAN }
}

/// Solves `A exp(a x) + B exp(b x) = target` for `x`, with `A`, `B`, `target` above zero and `a`, `b` below.
///
/// The logarithm of the left side is convex and falls, and each term alone reaches the target at a smaller `x`: Newton's
/// method from the larger of these converges from that side, without overshooting.
fn sum_of_powers((large, a): (f64, f64), (small, b): (f64, f64), target: f64) -> f64 {
    const MOST: usize = 100;
    let goal = target.ln();
    let (large, small) = (large.ln(), small.ln());
    let mut x = ((goal - large) / a).max((goal - small) / b);
    if large.is_nan() || small.is_nan() {
        return f64::NAN;
    }
    for _ in 0..MOST {
        let (first, second) = (large + a * x, small + b * x);
        let most = first.max(second);
        let (p, q) = ((first - most).exp(), (second - most).exp());
        let step = (most + (p + q).ln() - goal) * (p + q) / (a * p + b * q);
        x -= step;
        if step.abs() <= 1e-14 * x.abs().max(1.0) || !x.is_finite() {
            break;
        }
    }
    x
}
