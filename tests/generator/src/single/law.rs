//! Laws of physics that a rate may lack.

/// Width of the sign of a speed, relative to the speed's root mean square.
const WIDTH: f64 = 2e-3;

/// A law: the summand of a rate per unit of its coefficient. `u` is the quantity that changes at this rate (a speed, an
/// excess temperature, a level), `x` the position; both are relative to sizes that they have along the run, so that a
/// coefficient is that of the rate where they have this size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// A loss in proportion to a power of the magnitude of `u`; of power zero: dry friction.
    Loss(f64),
    /// Dry friction that falls with the speed.
    Stribeck,
    /// A constant.
    Constant,
    /// A restoring rate in proportion to a power of the magnitude of `x`.
    Stiffness(f64),
    /// A rate in proportion to the square of `x`, of one sign.
    OneSided,
    /// The loss of a linear spring over a gap on both sides.
    DeadZone,
    /// A stop on one side.
    Stop,
    /// A force periodic in the position.
    Cogging,
    /// A hysteretic force: Bouc and Wen's law, whose internal variable is the third state.
    Hysteresis,
    /// Radiation to surroundings of this absolute temperature, in units of that of `u`.
    Radiation(f64),
    /// Evaporation: a loss that grows e-fold over this rise.
    Evaporation(f64),
    /// A loss in proportion to the excess above a level.
    Overflow,
    /// A drag that tends to a constant at high speed.
    Drooping,
    /// A spring whose force grows exponentially.
    Exponential,
    /// A leak through a hole at a height, by Torricelli's law.
    Hole,
}

impl Law {
    /// The rate per unit of the coefficient; `z` is the internal variable.
    pub fn rate(self, u: f64, x: f64, z: f64) -> f64 {
        match self {
            Self::Loss(0.0) => -(u / WIDTH).tanh(),
            Self::Loss(power) => -u.signum() * u.abs().powf(power),
            Self::Stribeck => -(u / WIDTH).tanh() * (0.5 + (-(u / 0.5).powi(2)).exp()),
            Self::Constant => 1.0,
            Self::Stiffness(power) => -x.signum() * x.abs().powf(power),
            Self::OneSided => -x * x,
            Self::DeadZone => x.clamp(-0.4, 0.4),
            Self::Stop => -(x - 0.7).max(0.0),
            Self::Cogging => (5.0 * x).sin(),
            Self::Hysteresis => -z,
            Self::Radiation(around) => around.powi(4) - (around + u).powi(4),
            Self::Evaporation(scale) => 1.0 - (u / scale).exp(),
            Self::Overflow => -(u - 1.05).max(0.0),
            Self::Drooping => -u / (1.0 + u.abs()),
            Self::Exponential => -(1.5 * x).sinh(),
            Self::Hole => -(u - 0.6).max(0.0).sqrt(),
        }
    }

    /// The rate of the internal variable at a relative speed `u` in units of the position's size per time.
    pub fn internal(self, speed: f64, z: f64) -> f64 {
        match self {
            Self::Hysteresis => 2.0 * speed - 1.2 * speed.abs() * z - 0.8 * speed * z.abs(),
            _ => 0.0,
        }
    }
}
