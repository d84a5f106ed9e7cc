//! Options of the model with their defaults: geometry, wall, pulse, numerics, gauges and sampling.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SimulationError;

/// All settings of the model; the calibrated quantities are in [`super::Mercury`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Shape of the vessel.
    pub geometry: Geometry,
    /// Steel wall.
    pub wall: Wall,
    /// Energy deposited by the proton pulse.
    pub pulse: Pulse,
    /// Mesh, time step and numerical damping.
    pub numerics: Numerics,
    /// Strain gauges on the outer face of the wall.
    pub gauges: Gauges,
    /// Output times.
    pub sampling: Sampling,
    /// Decay of all motion in proportion to its mass, 1/s: free vibrations of any frequency decay in amplitude as
    /// `exp(-damping t / 2)`.
    pub damping: f64,
    /// Share of the pressure that an absorbing rear end reflects, above -1 and below 1: 0 absorbs all waves, 1 would be
    /// a rigid wall.
    pub rear_reflection: f64,
}

/// A cylinder with a spherical cap as beam window; `z` runs from the cap's apex to the rear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Geometry {
    /// Inner radius of the cylinder, m, above 0.
    pub radius: f64,
    /// Distance from the apex of the cap to the rear end, m, above 1.5 times the depth of the cap.
    pub length: f64,
    /// Radius of curvature of the cap, m, at least `radius`.
    pub cap_radius: f64,
}

impl Default for Geometry {
    fn default() -> Self {
        Self { radius: 0.10, length: 0.45, cap_radius: 0.16 }
    }
}

/// The wall, a thin shell; the defaults are those of 316L stainless steel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Wall {
    /// Thickness of the cap, m, above 0.
    pub cap_thickness: f64,
    /// Thickness of the cylinder, m, above 0.
    pub cylinder_thickness: f64,
    /// Young's modulus, Pa, above 0.
    pub young_modulus: f64,
    /// Poisson's ratio, in [0, 0.5).
    pub poisson_ratio: f64,
    /// Density, kg/m³, above 0.
    pub density: f64,
}

impl Default for Wall {
    fn default() -> Self {
        Self {
            cap_thickness: 3e-3,
            cylinder_thickness: 3e-3,
            young_modulus: 193e9,
            poisson_ratio: 0.3,
            density: 7990.0,
        }
    }
}

/// Quantity of the load that does not depend on the mercury's density and sound speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Load {
    /// The thermal expansion; the initial pressure is proportional to the bulk modulus.
    ThermalStrain,
    /// The initial pressure.
    FixedPressure,
}

/// Initial state after a pulse much shorter than the response: `p = P₀ exp(-r²/2s²) f(z')/max f` with
/// `f = (1 - exp(-z'/l₁)) exp(-z'/l₂)` and `z'` the distance behind the window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Pulse {
    /// Quantity that does not depend on the mercury's density and sound speed: the thermal expansion
    /// (`"thermal_strain"`, default) or the initial pressure (`"fixed_pressure"`).
    pub load: Load,
    /// Peak initial pressure `P₀`, Pa, at least 0; under `load = "thermal_strain"` it applies at the reference
    /// density and sound speed and varies with the bulk modulus.
    pub peak_pressure: f64,
    /// Density for which `peak_pressure` is given under `load = "thermal_strain"`, kg/m³, above 0.
    pub reference_density: f64,
    /// Sound speed for which `peak_pressure` is given under `load = "thermal_strain"`, m/s, above 0.
    pub reference_sound_speed: f64,
    /// Standard deviation `s` of the beam, m, above 0.
    pub width: f64,
    /// Build-up length `l₁` behind the window, m, above 0.
    pub rise: f64,
    /// Decay length `l₂` along the beam, m, above 0.
    pub decay: f64,
    /// Thermal strain of the cap on the axis, dimensionless, below 0.1 in magnitude; it decreases with the radius
    /// like the beam.
    pub wall_strain: f64,
}

impl Default for Pulse {
    fn default() -> Self {
        Self {
            load: Load::ThermalStrain,
            peak_pressure: 36e6,
            reference_density: 13_500.0,
            reference_sound_speed: 1456.0,
            width: 0.032,
            rise: 0.020,
            decay: 0.160,
            wall_strain: 20e-6,
        }
    }
}

/// Boundary condition of the fluid at the rear end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rear {
    /// Semi-infinite mercury at rest: plane waves leave without reflection.
    Absorbing,
    /// A rigid wall.
    Rigid,
}

/// A mesh by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NamedMesh {
    /// 20 x 90 cells.
    Default,
    /// 40 x 180 cells.
    Fine,
}

/// Number of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"default\", \"fine\" or [radial cells, axial cells]")]
pub enum Cells {
    /// `"default"` or `"fine"`.
    Named(NamedMesh),
    /// `[radial, axial]`.
    Explicit([usize; 2]),
}

impl Cells {
    /// Number of cells along the radius and along the axis.
    pub fn counts(self) -> [usize; 2] {
        match self {
            Self::Named(NamedMesh::Default) => [20, 90],
            Self::Named(NamedMesh::Fine) => [40, 180],
            Self::Explicit(counts) => counts,
        }
    }
}

/// Mesh, time step and numerical damping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Numerics {
    /// Number of cells: `"default"` (20 x 90), `"fine"` (40 x 180) or `[radial, axial]` with 2 to 200 radial and 4 to
    /// 2000 axial cells. Twice the cells in both directions take about eight times as long.
    pub mesh: Cells,
    /// Time step divided by the stability limit, in (0, 1].
    pub cfl: f64,
    /// Linear artificial viscosity `b₁`, dimensionless, in [0, 2]. Larger values damp oscillations behind shocks and
    /// smooth the traces more.
    pub linear_viscosity: f64,
    /// Quadratic artificial viscosity `b₂`, dimensionless, in [0, 2]. Larger values spread strong shocks over more
    /// cells.
    pub quadratic_viscosity: f64,
    /// Coefficient of the viscous hourglass control, dimensionless, in [0, 0.2]; it suppresses zero-energy motions of
    /// the cells.
    pub hourglass: f64,
    /// Boundary condition of the fluid at the rear end.
    pub rear: Rear,
}

impl Default for Numerics {
    fn default() -> Self {
        Self {
            mesh: Cells::Named(NamedMesh::Default),
            cfl: 0.7,
            linear_viscosity: 0.25,
            quadratic_viscosity: 1.2,
            hourglass: 0.01,
            rear: Rear::Absorbing,
        }
    }
}

/// Part of the wall that carries a gauge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The beam window; positions are radii.
    Cap,
    /// The cylinder; positions are distances from the apex of the cap.
    Cylinder,
}

/// A strain gauge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gauge {
    /// Name of the gauge and its label on the response's `sensor` axis.
    pub name: String,
    /// Part of the wall: `"cap"` or `"cylinder"`.
    pub place: Place,
    /// Position of the gauge's middle, m: radius on the cap, distance from the apex on the cylinder.
    pub position: f64,
    /// Angle between the gauge and the meridian, degrees: 0 measures the axial strain, 90 the hoop strain.
    pub angle: f64,
    /// Length over which the gauge averages, m, from 0 to the length of the vessel.
    #[serde(default = "default_gauge_length")]
    pub length: f64,
}

/// The gauges, in the order of the response's strain traces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Gauges(pub Vec<Gauge>);

/// Length of the fibre gauges of the single-pulse tests at WNR in 1999, m.
fn default_gauge_length() -> f64 {
    12.7e-3
}

impl Default for Gauges {
    fn default() -> Self {
        use Place::{Cap, Cylinder};
        let table = [
            ("B", Cap, 0.055, 45.0),
            ("C", Cylinder, 0.150, 90.0),
            ("G", Cylinder, 0.100, 90.0),
            ("M", Cylinder, 0.100, 0.0),
            ("R", Cylinder, 0.330, 90.0),
            ("T", Cylinder, 0.055, 90.0),
            ("U", Cylinder, 0.200, 90.0),
            ("V", Cylinder, 0.280, 90.0),
            ("Y", Cylinder, 0.150, 0.0),
            ("Z", Cylinder, 0.200, 0.0),
        ];
        let gauge = |(name, place, position, angle): (&str, Place, f64, f64)| Gauge {
            name: name.to_owned(),
            place,
            position,
            angle,
            length: default_gauge_length(),
        };
        Self(table.into_iter().map(gauge).collect())
    }
}

/// Output times `interval`, `2 interval`, ..., `count interval` after the pulse.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sampling {
    /// Time between outputs, s.
    pub interval: f64,
    /// Number of outputs.
    pub count: usize,
}

impl Default for Sampling {
    fn default() -> Self {
        Self { interval: 1e-5, count: 100 }
    }
}

/// Checks that a value is finite and that `keep` accepts it; the error states its name, the value and `right`, the
/// permitted range.
pub(super) fn check(
    name: &str,
    value: f64,
    keep: impl Fn(f64) -> bool,
    right: &str,
) -> Result<(), SimulationError> {
    if value.is_finite() && keep(value) {
        Ok(())
    } else {
        Err(SimulationError::Settings(format!("`{name}` is {value}; it must be {right}")))
    }
}

impl Settings {
    /// Checks all settings. The error names the first setting that is out of range.
    pub fn validate(&self) -> Result<(), SimulationError> {
        self.validate_vessel()?;
        self.validate_numerics()?;
        let gauges = &self.gauges.0;
        for (k, gauge) in gauges.iter().enumerate() {
            self.validate_gauge(gauge)?;
            if gauges[..k].iter().any(|other| other.name == gauge.name) {
                let name = &gauge.name;
                return Err(SimulationError::Settings(format!("two gauges are named `{name}`")));
            }
        }
        if gauges.is_empty() {
            return Err(SimulationError::Settings("`gauges` is empty; name at least one".into()));
        }
        Ok(())
    }

    fn validate_vessel(&self) -> Result<(), SimulationError> {
        let (g, w, p) = (&self.geometry, &self.wall, &self.pulse);
        let positive = |x: f64| x > 0.0;
        for (name, value) in [
            ("geometry.radius", g.radius),
            ("wall.cap_thickness", w.cap_thickness),
            ("wall.cylinder_thickness", w.cylinder_thickness),
            ("wall.young_modulus", w.young_modulus),
            ("wall.density", w.density),
            ("pulse.reference_density", p.reference_density),
            ("pulse.reference_sound_speed", p.reference_sound_speed),
            ("pulse.width", p.width),
            ("pulse.rise", p.rise),
            ("pulse.decay", p.decay),
        ] {
            check(name, value, positive, "a positive number")?;
        }
        check("geometry.cap_radius", g.cap_radius, |x| x >= g.radius, "at least `radius`")?;
        let depth = g.nose(g.radius);
        check("geometry.length", g.length, |x| x > 1.5 * depth, "over 1.5 times the cap's depth")?;
        check("wall.poisson_ratio", w.poisson_ratio, |x| (0.0..0.5).contains(&x), "in [0, 0.5)")?;
        let zero_or_more = |x: f64| x >= 0.0;
        check("pulse.peak_pressure", p.peak_pressure, zero_or_more, "zero or more")?;
        check("pulse.wall_strain", p.wall_strain, |x| x.abs() < 0.1, "below 0.1 in size")
    }

    fn validate_numerics(&self) -> Result<(), SimulationError> {
        let n = &self.numerics;
        let [radial, axial] = n.mesh.counts();
        if !(2..=200).contains(&radial) || !(4..=2000).contains(&axial) {
            return Err(SimulationError::Settings(format!(
                "`numerics.mesh` is [{radial}, {axial}]; it must have 2 to 200 radial and 4 to \
                 2000 axial cells"
            )));
        }
        check("numerics.cfl", n.cfl, |x| x > 0.0 && x <= 1.0, "in (0, 1]")?;
        let mild = |x: f64| (0.0..=2.0).contains(&x);
        check("numerics.linear_viscosity", n.linear_viscosity, mild, "in [0, 2]")?;
        check("numerics.quadratic_viscosity", n.quadratic_viscosity, mild, "in [0, 2]")?;
        check("numerics.hourglass", n.hourglass, |x| (0.0..=0.2).contains(&x), "in [0, 0.2]")?;
        check("damping", self.damping, |x| x >= 0.0, "zero or more")?;
        check("rear_reflection", self.rear_reflection, |x| x.abs() < 1.0, "above -1 and below 1")?;
        check("sampling.interval", self.sampling.interval, |x| x > 0.0, "a positive number")?;
        if self.sampling.count == 0 {
            return Err(SimulationError::Settings(
                "`sampling.count` is 0; it must be at least 1".into(),
            ));
        }
        Ok(())
    }

    fn validate_gauge(&self, gauge: &Gauge) -> Result<(), SimulationError> {
        let (g, name) = (&self.geometry, &gauge.name);
        let (range, right) = match gauge.place {
            Place::Cap => (0.0..=g.radius, "between 0 and `geometry.radius` on the cap"),
            Place::Cylinder => (
                g.nose(g.radius)..=g.length,
                "between the rim of the cap and `geometry.length` on the cylinder",
            ),
        };
        let position = format!("position of gauge {name}");
        check(&position, gauge.position, |x| range.contains(&x), right)?;
        check(&format!("angle of gauge {name}"), gauge.angle, |_| true, "a finite number")?;
        let length = format!("length of gauge {name}");
        check(&length, gauge.length, |x| (0.0..=g.length).contains(&x), "zero or more")
    }
}

impl Geometry {
    /// Depth `z` of the cap at radius `r`, m.
    pub fn nose(&self, r: f64) -> f64 {
        self.cap_radius - (self.cap_radius.powi(2) - r.powi(2)).max(0.0).sqrt()
    }
}
