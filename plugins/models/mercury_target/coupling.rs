//! Conversion of forces to velocities: masses, held motions, the sliding contact between fluid and wall, a rigid
//! plate, and the absorbing rear end.
//!
//! The fluid slips along the wall: a wall node and its fluid node share the acceleration along the normal,
//! `a_n = (F_fluid + F_wall)·n / (m_fluid + m_wall)`, and have separate accelerations along the meridian. The normal is
//! that of the fluid's discrete surface, so that a uniform pressure acts exactly along it.

/// One value for every motion of fluid and wall: velocities (m/s, rad/s), forces (N, N m) or masses (kg, kg m²).
#[derive(Debug, Clone, Default)]
pub struct Field {
    /// Radial component at each fluid node, indexed as in the mesh.
    pub fluid_r: Vec<f64>,
    /// Axial component at each fluid node.
    pub fluid_z: Vec<f64>,
    /// Radial component at each wall node, from the apex of the cap.
    pub shell_r: Vec<f64>,
    /// Axial component at each wall node.
    pub shell_z: Vec<f64>,
    /// Rotation component at each wall node.
    pub shell_turn: Vec<f64>,
}

impl Field {
    /// A field of zeros.
    pub fn zeros(fluid_nodes: usize, shell_nodes: usize) -> Self {
        Self {
            fluid_r: vec![0.0; fluid_nodes],
            fluid_z: vec![0.0; fluid_nodes],
            shell_r: vec![0.0; shell_nodes],
            shell_z: vec![0.0; shell_nodes],
            shell_turn: vec![0.0; shell_nodes],
        }
    }

    /// The five components, in the order of the fields.
    pub fn parts(&self) -> [&Vec<f64>; 5] {
        [&self.fluid_r, &self.fluid_z, &self.shell_r, &self.shell_z, &self.shell_turn]
    }

    /// The five components, mutable, in the order of the fields.
    pub fn parts_mut(&mut self) -> [&mut Vec<f64>; 5] {
        [
            &mut self.fluid_r,
            &mut self.fluid_z,
            &mut self.shell_r,
            &mut self.shell_z,
            &mut self.shell_turn,
        ]
    }
}

/// Motions that are held at zero.
#[derive(Debug, Clone)]
pub struct Held {
    /// Held motions (r, z) of each fluid node.
    pub fluid: Vec<[bool; 2]>,
    /// Held motions (r, z, rotation) of each wall node.
    pub shell: Vec<[bool; 3]>,
}

/// Contact between a fluid node and a wall node.
#[derive(Debug, Clone, Copy)]
pub enum Contact {
    /// Shared motion along the normal, separate motions along the meridian.
    Slip,
    /// Shared motion in both components: for a corner, which has no single normal.
    Stick,
}

/// Connections between fluid, wall, plate and the mercury behind the rear end.
#[derive(Debug, Clone, Default)]
pub struct Joints {
    /// Contacts: fluid node, wall node, kind of contact.
    pub contacts: Vec<(usize, usize, Contact)>,
    /// Rigid plate: the fluid nodes that move axially with it, and its mass, kg.
    pub plate: Option<(Vec<usize>, f64)>,
    /// Fluid nodes of an absorbing rear end, behind which the fluid continues.
    pub open_end: Vec<usize>,
    /// Share of the pressure that the fluid behind an absorbing rear end reflects.
    pub reflection: f64,
}

#[derive(Debug, Clone)]
struct Link {
    fluid: usize,
    shell: usize,
    normal: [f64; 2],
    shared: f64,
    fluid_tangent: f64,
    shell_tangent: f64,
}

#[derive(Debug, Clone)]
struct Absorber {
    node: usize,
    inverse_mass: f64,
    resistance: f64,
}

/// Data for the conversion of forces to velocities.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Mass of every motion, with the plate's mass distributed over its nodes; kg, and kg m² for rotations.
    pub mass: Field,
    inverse: Field,
    links: Vec<Link>,
    plate: Vec<usize>,
    plate_inverse: f64,
    absorbers: Vec<Absorber>,
}

impl Motion {
    /// The motion of a system with the given masses. `area` is the outward area vector (r, z) of each fluid node, m²,
    /// zero at inner nodes; `impedance` is `ρc`, kg/(m² s).
    pub fn new(
        mut mass: Field,
        area: &[Vec<f64>; 2],
        held: &Held,
        joints: &Joints,
        impedance: f64,
    ) -> Self {
        let mut inverse = inverse_masses(&mass, held);
        let links: Vec<Link> = (joints.contacts.iter())
            .flat_map(|contact| links(*contact, &mass, &mut inverse, area))
            .collect();
        let absorbers = (joints.open_end.iter())
            .map(|&node| Absorber {
                node,
                inverse_mass: std::mem::take(&mut inverse.fluid_z[node]),
                // The impedance of the fluid behind is `(1 + r) / (1 - r)` times as large where it reflects `r`.
                resistance: impedance * area[1][node] * (1.0 + joints.reflection)
                    / (1.0 - joints.reflection),
            })
            .collect();
        let (mut plate, mut plate_inverse) = (Vec::new(), 0.0);
        if let Some((nodes, plate_mass)) = &joints.plate {
            let fluid: f64 = nodes.iter().map(|&n| mass.fluid_z[n]).sum();
            plate_inverse = 1.0 / (fluid + plate_mass);
            for &n in nodes {
                inverse.fluid_z[n] = 0.0;
                mass.fluid_z[n] += plate_mass / nodes.len() as f64;
            }
            plate.clone_from(nodes);
        }
        Self { mass, inverse, links, plate, plate_inverse, absorbers }
    }

    /// Changes the velocities by the forces over `dt`, s. Returns the energy that leaves through the absorbing end,
    /// J.
    pub fn kick(&self, velocity: &mut Field, force: &Field, dt: f64) -> f64 {
        let parts = velocity.parts_mut().into_iter().zip(force.parts()).zip(self.inverse.parts());
        for ((v, f), inverse) in parts {
            for ((v, f), inverse) in v.iter_mut().zip(f).zip(inverse) {
                *v += dt * f * inverse;
            }
        }
        for link in &self.links {
            link.kick(velocity, force, dt);
        }
        if !self.plate.is_empty() {
            let total: f64 = self.plate.iter().map(|&n| force.fluid_z[n]).sum();
            for &n in &self.plate {
                velocity.fluid_z[n] += dt * total * self.plate_inverse;
            }
        }
        let mut radiated = 0.0;
        for end in &self.absorbers {
            let v = &mut velocity.fluid_z[end.node];
            // The resistance acts on the mean of the old and the new velocity, which is stable for any step.
            let half = 0.5 * dt * end.resistance * end.inverse_mass;
            let new = (*v * (1.0 - half) + dt * force.fluid_z[end.node] * end.inverse_mass)
                / (1.0 + half);
            let mean = 0.5 * (*v + new);
            radiated += dt * end.resistance * mean * mean;
            *v = new;
        }
        radiated
    }

    /// Power that leaves through the absorbing end at the mean of the two velocities, projected on the first, W.
    pub fn radiated_power(&self, before: &Field, after: &Field) -> f64 {
        let power = |end: &Absorber| {
            let (v, w) = (before.fluid_z[end.node], after.fluid_z[end.node]);
            end.resistance * 0.5 * (v + w) * v
        };
        self.absorbers.iter().map(power).sum()
    }

    /// Kinetic energy `½ m v·w` of the leapfrog's velocities half a step before (`v`) and after (`w`), J.
    pub fn kinetic(&self, before: &Field, after: &Field) -> f64 {
        let parts = self.mass.parts().into_iter().zip(before.parts()).zip(after.parts());
        let part = |((m, v), w): ((&Vec<f64>, &Vec<f64>), &Vec<f64>)| -> f64 {
            m.iter().zip(v).zip(w).map(|((m, v), w)| 0.5 * m * v * w).sum()
        };
        parts.map(part).sum()
    }
}

impl Link {
    fn kick(&self, velocity: &mut Field, force: &Field, dt: f64) {
        let ([n_r, n_z], f, s) = (self.normal, self.fluid, self.shell);
        let (ff_r, ff_z) = (force.fluid_r[f], force.fluid_z[f]);
        let (fs_r, fs_z) = (force.shell_r[s], force.shell_z[s]);
        let a_n = dt * self.shared * ((ff_r + fs_r) * n_r + (ff_z + fs_z) * n_z);
        let along = |r: f64, z: f64| z * n_r - r * n_z;
        let a_f = dt * self.fluid_tangent * along(ff_r, ff_z);
        let a_s = dt * self.shell_tangent * along(fs_r, fs_z);
        velocity.fluid_r[f] += a_n * n_r - a_f * n_z;
        velocity.fluid_z[f] += a_n * n_z + a_f * n_r;
        velocity.shell_r[s] += a_n * n_r - a_s * n_z;
        velocity.shell_z[s] += a_n * n_z + a_s * n_r;
    }
}

fn inverse_masses(mass: &Field, held: &Held) -> Field {
    let mut inverse = mass.clone();
    for part in inverse.parts_mut() {
        for m in part {
            *m = 1.0 / *m;
        }
    }
    for (n, &[r, z]) in held.fluid.iter().enumerate() {
        if r {
            inverse.fluid_r[n] = 0.0;
        }
        if z {
            inverse.fluid_z[n] = 0.0;
        }
    }
    for (n, &[r, z, turn]) in held.shell.iter().enumerate() {
        for (part, is_held) in
            [(&mut inverse.shell_r, r), (&mut inverse.shell_z, z), (&mut inverse.shell_turn, turn)]
        {
            if is_held {
                part[n] = 0.0;
            }
        }
    }
    inverse
}

/// The links of a contact. They replace the free motion of the two nodes.
fn links(
    (fluid, shell, contact): (usize, usize, Contact),
    mass: &Field,
    inverse: &mut Field,
    area: &[Vec<f64>; 2],
) -> Vec<Link> {
    let free = [
        [inverse.fluid_r[fluid], inverse.fluid_z[fluid]],
        [inverse.shell_r[shell], inverse.shell_z[shell]],
    ];
    let mut release = |r: bool, z: bool| {
        for (part, n, yes) in [
            (&mut inverse.fluid_r, fluid, r),
            (&mut inverse.fluid_z, fluid, z),
            (&mut inverse.shell_r, shell, r),
            (&mut inverse.shell_z, shell, z),
        ] {
            if yes {
                part[n] = 0.0;
            }
        }
    };
    let shared = 1.0 / (mass.fluid_r[fluid] + mass.shell_r[shell]);
    let bare =
        Link { fluid, shell, normal: [1.0, 0.0], shared, fluid_tangent: 0.0, shell_tangent: 0.0 };
    match contact {
        Contact::Stick => {
            release(true, true);
            vec![bare.clone(), Link { normal: [0.0, 1.0], ..bare }]
        }
        Contact::Slip => {
            let (a_r, a_z) = (area[0][fluid], area[1][fluid]);
            // On the axis the radial motion is held and the normal is the axis. On a straight wall with held ends the
            // axial motion is held and the normal is radial.
            let normal = match free[0] {
                [0.0, _] => [0.0, a_z.signum()],
                [_, 0.0] => [1.0, 0.0],
                _ => [a_r / a_r.hypot(a_z), a_z / a_r.hypot(a_z)],
            };
            let tangent = |inverse: [f64; 2]| {
                if normal[0] == 0.0 {
                    inverse[0]
                } else if normal[1] == 0.0 {
                    inverse[1]
                } else {
                    inverse[0].min(inverse[1])
                }
            };
            release(true, true);
            vec![Link {
                normal,
                fluid_tangent: tangent(free[0]),
                shell_tangent: tangent(free[1]),
                ..bare
            }]
        }
    }
}
