//! Structured axisymmetric mesh of the fluid: volumes, their derivatives, masses, shapes.
//!
//! A cell is the body of revolution of a quadrilateral. Its volume is the sum over the edges of
//! `π/3 (r₁² + r₁r₂ + r₂²)(z₂ - z₁)`, so that the derivative `B = ∂V/∂x` with respect to each corner is exact, and
//! `div v = Σ B·v / V` and the nodal force `p B` together conserve energy (compatible discretisation). The lumped mass
//! of a corner is `ρ ∫ N 2πr dA`, which balances a linear pressure exactly, on the axis also.

use std::f64::consts::PI;

/// Number of corners of a cell, in the order (i, j), (i, j+1), (i+1, j+1), (i+1, j), where `i` counts along the axis
/// and `j` outwards.
pub const CORNERS: usize = 4;

/// One value for each corner of each cell.
pub type Corner = [Vec<f64>; CORNERS];

/// The mesh. Nodes and cells are numbered along the axis first, so that inner loops run over `i`.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// Number of cells along the radius.
    pub nr: usize,
    /// Number of cells along the axis.
    pub nz: usize,
    /// Radius of each node, m.
    pub r: Vec<f64>,
    /// Axial position of each node, m.
    pub z: Vec<f64>,
    /// Volume of each cell, m³.
    pub volume: Vec<f64>,
    /// Derivative `∂V/∂r` with respect to each corner, m².
    pub b_r: Corner,
    /// Derivative `∂V/∂z` with respect to each corner, m².
    pub b_z: Corner,
    /// Hourglass shape of Flanagan and Belytschko (Int. J. Numer. Methods Eng. 17, 1981, 679), orthogonal to linear
    /// fields.
    pub gamma: Corner,
    /// Thickness of each cell: area divided by longest side, m.
    pub thickness: Vec<f64>,
    /// Volume assigned to each node, `∫ N 2πr dA`, m³.
    pub node_volume: Vec<f64>,
    /// Bound on the squared wave number that a cell resolves, `ω²/c²`, 1/m².
    pub wave_number2: Vec<f64>,
}

impl Mesh {
    /// A mesh of `nr` by `nz` cells whose node (i, j) lies at `place(i, j)` = (r, z), m.
    pub fn new(nr: usize, nz: usize, place: impl Fn(usize, usize) -> [f64; 2]) -> Self {
        let nodes = (nr + 1) * (nz + 1);
        let column = || -> Corner { std::array::from_fn(|_| Vec::with_capacity(nr * nz)) };
        let mut mesh = Self {
            nr,
            nz,
            r: Vec::with_capacity(nodes),
            z: Vec::with_capacity(nodes),
            volume: Vec::with_capacity(nr * nz),
            b_r: column(),
            b_z: column(),
            gamma: column(),
            thickness: Vec::with_capacity(nr * nz),
            node_volume: vec![0.0; nodes],
            wave_number2: Vec::with_capacity(nr * nz),
        };
        for j in 0..=nr {
            for i in 0..=nz {
                let [r, z] = place(i, j);
                mesh.r.push(r);
                mesh.z.push(z);
            }
        }
        for j in 0..nr {
            for i in 0..nz {
                mesh.push_cell(i, j);
            }
        }
        mesh
    }

    /// Number of node (i, j).
    pub fn node(&self, i: usize, j: usize) -> usize {
        j * (self.nz + 1) + i
    }

    /// Centre (r, z) of each cell, m, in the order of the cells.
    pub fn centres(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        (0..self.nr).flat_map(move |j| {
            (0..self.nz).map(move |i| {
                let nodes = self.corners(i, j);
                [&self.r, &self.z].map(|x| nodes.iter().map(|&n| x[n]).sum::<f64>() / 4.0)
            })
        })
    }

    /// Outward area vector (r, z) of each boundary node, the sum of its `B`, m²; zero at inner nodes.
    pub fn area(&self) -> [Vec<f64>; 2] {
        [&self.b_r, &self.b_z].map(|b| {
            let mut area = vec![0.0; self.r.len()];
            for j in 0..self.nr {
                for i in 0..self.nz {
                    for (k, n) in self.corners(i, j).into_iter().enumerate() {
                        area[n] += b[k][j * self.nz + i];
                    }
                }
            }
            area
        })
    }

    fn corners(&self, i: usize, j: usize) -> [usize; CORNERS] {
        [self.node(i, j), self.node(i, j + 1), self.node(i + 1, j + 1), self.node(i + 1, j)]
    }

    fn push_cell(&mut self, i: usize, j: usize) {
        let nodes = self.corners(i, j);
        let (r, z) = (nodes.map(|n| self.r[n]), nodes.map(|n| self.z[n]));
        let (volume, b_r, b_z) = revolved(r, z);
        let weight = corner_volumes(r, z);
        let mut wave_number2 = 0.0;
        let gamma = hourglass_shape(r, z);
        for k in 0..CORNERS {
            self.node_volume[nodes[k]] += weight[k];
            // The largest eigenvalue of one cell bounds that of the mesh; the cell's stiffness has rank one. On the
            // axis the radial motion is held.
            let radial = if r[k] > 0.0 { b_r[k] } else { 0.0 };
            wave_number2 += (radial * radial + b_z[k] * b_z[k]) / (weight[k] * volume);
            self.b_r[k].push(b_r[k]);
            self.b_z[k].push(b_z[k]);
            self.gamma[k].push(gamma[k]);
        }
        let longest = (0..CORNERS)
            .map(|k| (r[(k + 1) % 4] - r[k]).hypot(z[(k + 1) % 4] - z[k]))
            .fold(0.0, f64::max);
        self.volume.push(volume);
        self.thickness.push(section(r, z).0 / longest);
        self.wave_number2.push(wave_number2);
    }
}

/// Volume of a revolved quadrilateral and its derivatives with respect to the corners' `r` and `z`.
fn revolved(r: [f64; 4], z: [f64; 4]) -> (f64, [f64; 4], [f64; 4]) {
    let (mut volume, mut b_r, mut b_z) = (0.0, [0.0; 4], [0.0; 4]);
    for k in 0..CORNERS {
        let m = (k + 1) % CORNERS;
        let rise = PI / 3.0 * (z[m] - z[k]);
        let ring = PI / 3.0 * (r[k] * r[k] + r[k] * r[m] + r[m] * r[m]);
        volume += ring * (z[m] - z[k]);
        b_r[k] += (2.0 * r[k] + r[m]) * rise;
        b_r[m] += (r[k] + 2.0 * r[m]) * rise;
        b_z[k] -= ring;
        b_z[m] += ring;
    }
    (volume, b_r, b_z)
}

/// Plane area and its derivatives with respect to the corners' `r` and `z`.
fn section(r: [f64; 4], z: [f64; 4]) -> (f64, [f64; 4], [f64; 4]) {
    let (mut area, mut a_r, mut a_z) = (0.0, [0.0; 4], [0.0; 4]);
    for k in 0..CORNERS {
        let (before, after) = ((k + 3) % CORNERS, (k + 1) % CORNERS);
        area += 0.5 * (r[k] + r[after]) * (z[after] - z[k]);
        a_r[k] = 0.5 * (z[after] - z[before]);
        a_z[k] = 0.5 * (r[before] - r[after]);
    }
    (area, a_r, a_z)
}

/// `γ = ¼ (h - (h·r) ∂N/∂r - (h·z) ∂N/∂z)` with `h = (1, -1, 1, -1)`.
fn hourglass_shape(r: [f64; 4], z: [f64; 4]) -> [f64; 4] {
    const H: [f64; 4] = [1.0, -1.0, 1.0, -1.0];
    let (area, a_r, a_z) = section(r, z);
    let dot = |x: [f64; 4]| (0..4).map(|k| H[k] * x[k]).sum::<f64>() / area;
    let (along_r, along_z) = (dot(r), dot(z));
    std::array::from_fn(|k| 0.25 * (H[k] - along_r * a_r[k] - along_z * a_z[k]))
}

/// `∫ N 2πr dA` of each corner by 2 x 2 Gauss points.
fn corner_volumes(r: [f64; 4], z: [f64; 4]) -> [f64; 4] {
    let g = 1.0 / 3.0_f64.sqrt();
    let mut weight = [0.0; 4];
    for (x, y) in [(-g, -g), (-g, g), (g, g), (g, -g)] {
        // Corners at (axial, radial) = (-1, -1), (-1, 1), (1, 1), (1, -1).
        let n = [
            (1.0 - x) * (1.0 - y) / 4.0,
            (1.0 - x) * (1.0 + y) / 4.0,
            (1.0 + x) * (1.0 + y) / 4.0,
            (1.0 + x) * (1.0 - y) / 4.0,
        ];
        let dx = [-(1.0 - y) / 4.0, -(1.0 + y) / 4.0, (1.0 + y) / 4.0, (1.0 - y) / 4.0];
        let dy = [-(1.0 - x) / 4.0, (1.0 - x) / 4.0, (1.0 + x) / 4.0, -(1.0 + x) / 4.0];
        let dot = |a: [f64; 4], b: [f64; 4]| (0..4).map(|k| a[k] * b[k]).sum::<f64>();
        let jacobian = dot(dx, z) * dot(dy, r) - dot(dx, r) * dot(dy, z);
        for k in 0..CORNERS {
            weight[k] += n[k] * 2.0 * PI * dot(n, r) * jacobian;
        }
    }
    weight
}
