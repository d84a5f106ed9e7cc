//! Equations of state of the fluid.

/// Pressure as a function of the volumetric strain, cell by cell, with any state that the law needs in each cell. The
/// solver is compiled separately for each law, so that an additional law leaves the results of the others unchanged
/// to the last bit.
pub trait EquationOfState {
    /// Advances the cells `first..first + strain.len()` by `dt`, s, to the given volumetric strains (total since the
    /// pulse). Writes into the cells' entries the pressures (Pa, relative to the static state) and the current speed
    /// of small waves divided by [`Self::sound_speed`]: 1 in pure liquid, 0 where the liquid is cavitated. The solver
    /// first calls this just after the pulse with zero strain and `dt = 0`, then with half a step: the second
    /// pressure starts the motion.
    fn update(
        &mut self,
        first: usize,
        strain: &[f64],
        dt: f64,
        pressure: &mut [f64],
        speed: &mut [f64],
    );

    /// Speed of the fastest small wave, m/s.
    fn sound_speed(&self) -> f64;

    /// Energy stored in a cell at a volumetric strain, J/m³.
    fn stored_energy(&self, cell: usize, strain: f64) -> f64;

    /// Energy that the law has converted to heat in a cell so far, J/m³; 0 for a reversible law.
    fn lost_energy(&self, _cell: usize) -> f64 {
        0.0
    }
}

/// `p = max(p₀ - K ε, -p_c)` with `K = ρc²`: linear and reversible, with a tensile cutoff (the bilinear fluid of
/// Bleich and Sandler, Int. J. Solids Structures 6, 1970, 617).
#[derive(Debug, Clone)]
pub struct TensileCutoff {
    initial: Vec<f64>,
    bulk_modulus: f64,
    sound_speed: f64,
    cutoff: f64,
}

impl TensileCutoff {
    /// The law for cells with the given pressures after the pulse, Pa. `density` is in kg/m³, `sound_speed` in m/s,
    /// `cutoff` in Pa.
    pub fn new(density: f64, sound_speed: f64, cutoff: f64, initial: Vec<f64>) -> Self {
        let bulk_modulus = density * sound_speed * sound_speed;
        Self { initial, bulk_modulus, sound_speed, cutoff }
    }

    /// Pressure of a cell at a volumetric strain, Pa, without the cutoff.
    pub(super) fn trial(&self, cell: usize, strain: f64) -> f64 {
        self.initial[cell] - self.bulk_modulus * strain
    }

    /// Bulk modulus `K = ρc²`, Pa.
    pub(super) fn bulk_modulus(&self) -> f64 {
        self.bulk_modulus
    }

    /// Lowest pressure, `-p_c`, Pa.
    pub(super) fn floor(&self) -> f64 {
        -self.cutoff
    }
}

impl EquationOfState for TensileCutoff {
    fn update(
        &mut self,
        first: usize,
        strain: &[f64],
        _dt: f64,
        pressure: &mut [f64],
        speed: &mut [f64],
    ) {
        let n = strain.len();
        let (initial, k, floor) =
            (&self.initial[first..first + n], self.bulk_modulus, -self.cutoff);
        let (pressure, speed) = (&mut pressure[..n], &mut speed[..n]);
        for i in 0..n {
            let trial = initial[i] - k * strain[i];
            pressure[i] = if trial < floor { floor } else { trial };
            speed[i] = if trial < floor { 0.0 } else { 1.0 };
        }
    }

    fn sound_speed(&self) -> f64 {
        self.sound_speed
    }

    /// Energy `p²/2K` above the cutoff and `p_c²/2K + p_c (ε - ε_c)` below; without stiffness (`K = 0`) the work
    /// `-p₀ ε` of the constant pressure.
    fn stored_energy(&self, cell: usize, strain: f64) -> f64 {
        let (p0, k, pc) = (self.initial[cell], self.bulk_modulus, self.cutoff);
        if k == 0.0 {
            return -p0.max(-pc) * strain;
        }
        let at_cutoff = (p0 + pc) / k;
        if strain <= at_cutoff {
            (p0 - k * strain).powi(2) / (2.0 * k)
        } else {
            pc * pc / (2.0 * k) + pc * (strain - at_cutoff)
        }
    }
}
