//! The wall: two-node conical frustum shells (Mindlin) with reduced integration.
//!
//! The unknowns are the mid-surface displacements `u_r`, `u_z` and the rotation `β`. With the meridian's tangent `t`,
//! outward normal `n`, element length `l` and mean radius `r`: `e_s = Δu·t/l`, `e_t = u_r/r`, `k_s = Δβ/l`,
//! `k_t = β t_r/r`, `γ = β + Δu·n/l`; `N = C(e + νe')`, `M = D(k + νk')`, `Q = 5/6 G h γ`, `C = Eh/(1-ν²)`,
//! `D = Ch²/12`. One-point integration of the shear avoids locking (Zienkiewicz et al., Int. J. Numer. Methods Eng. 11,
//! 1977, 1545). Only the hoop membrane strain is evaluated at both ends, because its mean would make short waves too
//! soft.

use std::f64::consts::PI;

use nalgebra::Matrix6;

use super::coupling::Field;

/// Elastic constants of the wall.
#[derive(Debug, Clone, Copy)]
pub struct Steel {
    /// Young's modulus, Pa.
    pub young_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density, kg/m³.
    pub density: f64,
}

/// Strains of the mid-surface: membrane and bending, along the meridian and around the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallStrain {
    /// Meridional membrane strain `e_s`.
    pub meridional: f64,
    /// Hoop membrane strain `e_t`.
    pub hoop: f64,
    /// Meridional curvature `k_s`, 1/m.
    pub meridional_bend: f64,
    /// Hoop curvature `k_t`, 1/m.
    pub hoop_bend: f64,
    shear: f64,
    /// Hoop membrane strain at both ends.
    ends: [f64; 2],
}

/// An element between two neighbouring wall nodes.
#[derive(Debug, Clone, Copy)]
pub struct Element {
    /// Length, m.
    pub length: f64,
    /// Thickness, m.
    pub thickness: f64,
    tangent: [f64; 2],
    radius: f64,
    /// Radius, m, and fraction of the element's area of both ends.
    ends: [(f64, f64); 2],
    membrane: f64,
    bending: f64,
    shear: f64,
    poisson: f64,
    eigenstrain: f64,
    mass: [f64; 2],
    rotary: [f64; 2],
}

/// The wall as a chain of elements, from the cap's apex to the rear.
#[derive(Debug, Clone, Default)]
pub struct Shell {
    /// Elements in order; element `s` joins nodes `s` and `s + 1`.
    pub elements: Vec<Element>,
    /// Radial displacement of the mid-surface at each node, m.
    pub r: Vec<f64>,
    /// Axial displacement of the mid-surface at each node, m.
    pub z: Vec<f64>,
    /// Rotation at each node, rad.
    pub turn: Vec<f64>,
}

impl Element {
    /// The frustum between the nodes `a` and `b` (r, z), m, with an isotropic membrane eigenstrain.
    pub fn new(a: [f64; 2], b: [f64; 2], thickness: f64, steel: Steel, eigenstrain: f64) -> Self {
        let (dr, dz) = (b[0] - a[0], b[1] - a[1]);
        let length = dr.hypot(dz);
        let Steel { young_modulus, poisson_ratio: nu, density } = steel;
        let membrane = young_modulus * thickness / (1.0 - nu * nu);
        let bending = membrane * thickness * thickness / 12.0;
        let lump = |near: f64, far: f64| {
            density * thickness * 2.0 * PI * length * (2.0 * near + far) / 6.0
        };
        let mass = [lump(a[0], b[0]), lump(b[0], a[0])];
        // The rotary inertia is raised on coarse meshes so that it does not limit the time step.
        let gyration2 = (thickness * thickness / 12.0).max(length * length / 10.0);
        Self {
            length,
            thickness,
            tangent: [dr / length, dz / length],
            radius: 0.5 * (a[0] + b[0]),
            ends: [(a[0], b[0]), (b[0], a[0])]
                .map(|(near, far)| (near, (2.0 * near + far) / (3.0 * (near + far)))),
            membrane,
            bending,
            shear: 5.0 / 6.0 * young_modulus / (2.0 * (1.0 + nu)) * thickness,
            poisson: nu,
            eigenstrain,
            mass,
            rotary: mass.map(|m| m * gyration2),
        }
    }

    /// Strains due to displacements and rotation `(u_r, u_z, β)` at both ends.
    fn strain(&self, a: [f64; 3], b: [f64; 3]) -> WallStrain {
        let ([tr, tz], l) = (self.tangent, self.length);
        let (du_r, du_z) = (b[0] - a[0], b[1] - a[1]);
        let turn = 0.5 * (a[2] + b[2]);
        let mean = 0.5 * (a[0] + b[0]) / self.radius;
        let ends = if self.ends[0].0 == 0.0 {
            [mean; 2]
        } else {
            [a[0] / self.ends[0].0, b[0] / self.ends[1].0]
        };
        WallStrain {
            meridional: (du_r * tr + du_z * tz) / l,
            hoop: ends[0] * self.ends[0].1 + ends[1] * self.ends[1].1,
            meridional_bend: (b[2] - a[2]) / l,
            hoop_bend: turn * tr / self.radius,
            shear: turn + (du_r * tz - du_z * tr) / l,
            ends,
        }
    }

    fn area(&self) -> f64 {
        2.0 * PI * self.radius * self.length
    }

    /// Forces (r, z), N, and moment, N m, on both ends.
    fn forces(&self, strain: &WallStrain) -> [[f64; 3]; 2] {
        let ([tr, tz], l, nu) = (self.tangent, self.length, self.poisson);
        let (e_s, e_t) = (strain.meridional - self.eigenstrain, strain.hoop - self.eigenstrain);
        let (k_s, k_t) = (strain.meridional_bend, strain.hoop_bend);
        let area = self.area();
        let n_s = area * self.membrane * (e_s + nu * e_t) / l;
        let n_t = self.hoop_forces(strain, e_s);
        let m_s = area * self.bending * (k_s + nu * k_t) / l;
        let m_t = area * self.bending * (k_t + nu * k_s) * 0.5 * tr / self.radius;
        let q = area * self.shear * strain.shear;
        let (along_r, along_z) = (n_s * tr + q * tz / l, n_s * tz - q * tr / l);
        [
            [along_r - n_t[0], along_z, m_s - m_t - 0.5 * q],
            [-along_r - n_t[1], -along_z, -m_s - m_t - 0.5 * q],
        ]
    }

    /// Radial forces of the hoop stress, evaluated at each end: the mean over an element would make short waves too
    /// soft. At the axis the strain is that of the element.
    fn hoop_forces(&self, strain: &WallStrain, e_s: f64) -> [f64; 2] {
        let stress = |e_t: f64| self.membrane * (e_t - self.eigenstrain + self.poisson * e_s);
        let area = self.area();
        if self.ends[0].0 == 0.0 {
            return [area * stress(strain.hoop) * 0.5 / self.radius; 2];
        }
        std::array::from_fn(|end| {
            let (radius, share) = self.ends[end];
            area * share * stress(strain.ends[end]) / radius
        })
    }

    fn energy(&self, strain: &WallStrain) -> f64 {
        let (e_s, e_t) = (strain.meridional - self.eigenstrain, strain.hoop - self.eigenstrain);
        let (k_s, k_t) = (strain.meridional_bend, strain.hoop_bend);
        let quadratic = |x: f64, y: f64| x * x + y * y + 2.0 * self.poisson * x * y;
        let spread: f64 = (strain.ends.iter().zip(self.ends))
            .map(|(e, (_, share))| share * (e - strain.hoop).powi(2))
            .sum();
        0.5 * self.area()
            * (self.membrane * (quadratic(e_s, e_t) + spread)
                + self.bending * quadratic(k_s, k_t)
                + self.shear * strain.shear.powi(2))
    }

    /// Square of the highest natural frequency of the free element, 1/s²: a bound for the mesh.
    fn highest_frequency2(&self, held: [[bool; 3]; 2]) -> f64 {
        let free = Element { eigenstrain: 0.0, ..*self };
        let mass =
            |dof: usize| if dof % 3 == 2 { self.rotary[dof / 3] } else { self.mass[dof / 3] };
        let scale = |dof: usize| {
            if held[dof / 3][dof % 3] { 0.0 } else { 1.0 / mass(dof).sqrt() }
        };
        let mut operator = Matrix6::zeros();
        for column in 0..6 {
            let mut u = [[0.0; 3]; 2];
            u[column / 3][column % 3] = scale(column);
            let force = free.forces(&free.strain(u[0], u[1]));
            for row in 0..6 {
                operator[(row, column)] = -force[row / 3][row % 3] * scale(row);
            }
        }
        operator.symmetric_eigenvalues().max()
    }
}

impl Shell {
    /// A wall at rest.
    pub fn new(elements: Vec<Element>) -> Self {
        let nodes = if elements.is_empty() { 0 } else { elements.len() + 1 };
        let zeros = || vec![0.0; nodes];
        Self { elements, r: zeros(), z: zeros(), turn: zeros() }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.r.len()
    }

    /// Adds the lumped masses, kg, and rotary inertias, kg m².
    pub fn add_masses(&self, mass: &mut Field) {
        for (s, element) in self.elements.iter().enumerate() {
            for end in 0..2 {
                mass.shell_r[s + end] += element.mass[end];
                mass.shell_z[s + end] += element.mass[end];
                mass.shell_turn[s + end] += element.rotary[end];
            }
        }
    }

    /// Longest stable time step with the given motions held, s; infinite without elements.
    pub fn stable_step(&self, held: &[[bool; 3]]) -> f64 {
        let highest = (self.elements.iter().enumerate())
            .map(|(s, element)| element.highest_frequency2([held[s], held[s + 1]]))
            .fold(0.0, f64::max);
        2.0 / highest.sqrt()
    }

    /// Advances the wall by `dt`, s, with the given velocities.
    pub fn advance(&mut self, velocity: &Field, dt: f64) {
        for (u, v) in [
            (&mut self.r, &velocity.shell_r),
            (&mut self.z, &velocity.shell_z),
            (&mut self.turn, &velocity.shell_turn),
        ] {
            u.iter_mut().zip(v).for_each(|(u, v)| *u += dt * v);
        }
    }

    /// Strains of element `s`.
    pub fn strain(&self, s: usize) -> WallStrain {
        let at = |n: usize| [self.r[n], self.z[n], self.turn[n]];
        self.elements[s].strain(at(s), at(s + 1))
    }

    /// Writes the nodal forces, N, and moments, N m.
    pub fn forces(&self, force: &mut Field) {
        force.shell_r.fill(0.0);
        force.shell_z.fill(0.0);
        force.shell_turn.fill(0.0);
        for (s, element) in self.elements.iter().enumerate() {
            for (end, f) in element.forces(&self.strain(s)).into_iter().enumerate() {
                force.shell_r[s + end] += f[0];
                force.shell_z[s + end] += f[1];
                force.shell_turn[s + end] += f[2];
            }
        }
    }

    /// Elastic energy, J.
    pub fn stored_energy(&self) -> f64 {
        self.elements.iter().enumerate().map(|(s, e)| e.energy(&self.strain(s))).sum()
    }
}
