//! Coordinates of the members of populations.
//!
//! Few data about a member leave it where its population is, so that member and scale are strongly dependent (the funnel of
//! Neal, Annals of Statistics 31 (2003) 705); many data make the standardised member and the location dependent instead. With
//! `u` the value (or its logarithm), `m` the location on the same scale, `s` the scale and `s0` a typical one, the coordinate
//! `v` of a member that is centred to the degree `c` is given by
//!
//! ```text
//! u = m + (s / s0)^(1 - c) (v - c m)
//! ```
//!
//! `c = 1` is centred (`v = u`), `c = 0` is not (`v = s0 z` with `z` standardised). For normal data of known precision the
//! coordinates are independent at `c = 1 - B`, the share of the population's variance that the data take away
//! (Papaspiliopoulos, Roberts and Sköld, Statistical Science 22 (2007) 59). The scale is represented by its logarithm.

use std::sync::Arc;

use lacuna::data::{Form, Population};

/// A member of a population, by its place among the coordinates.
#[derive(Debug, Clone)]
struct Member {
    /// Index of the population.
    population: usize,
    place: usize,
    centred: f64,
    /// Precision of what the data say of it, on the scale of the population; zero before it is known.
    information: f64,
}

/// Jacobian of the coordinates that enters a density.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Jacobian {
    /// That of the coordinates: the density of the coordinates.
    Whole,
    /// That for which the maximum is the one of location and logarithm of the scale with the members integrated out (Laplace's
    /// approximation with the information of the data on each member), and of the members given these. The density of the
    /// values themselves is infinite where all members are equal and the scale is zero, and that of standardised members is
    /// largest where the scale is far too large.
    Marginal,
}

/// Coordinates of all members; see the module.
#[derive(Debug, Clone)]
pub(super) struct Members {
    populations: Arc<[Population]>,
    members: Vec<Member>,
}

impl Members {
    /// Coordinates that are centred as the study says, or not at all where it leaves that to the data.
    pub(super) fn of(populations: Vec<Population>) -> Self {
        let each = populations.iter().enumerate().flat_map(|(population, own)| {
            let centred = own.centred.unwrap_or(0.0);
            let member = move |&place| Member { population, place, centred, information: 0.0 };
            own.members.iter().map(member)
        });
        let members = each.collect();
        Self { populations: populations.into(), members }
    }

    /// The populations.
    pub(super) fn populations(&self) -> &[Population] {
        &self.populations
    }

    /// True if there are no populations.
    pub(super) fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// True if the coordinate at a place is that of a member.
    pub(super) fn has(&self, place: usize) -> bool {
        self.members.iter().any(|member| member.place == place)
    }

    fn of_member(&self, member: &Member) -> &Population {
        &self.populations[member.population]
    }

    /// Degree to which each member is centred.
    pub(super) fn centred(&self) -> Vec<f64> {
        self.members.iter().map(|member| member.centred).collect()
    }

    /// Sets the information of the data on each member, and the degree to which it is centred, where the study leaves that to
    /// the data.
    pub(super) fn set(&mut self, centred: &[f64], information: &[f64]) {
        for (member, &centred) in self.members.iter_mut().zip(centred) {
            member.centred = self.populations[member.population].centred.unwrap_or(centred);
        }
        for (member, &information) in self.members.iter_mut().zip(information) {
            member.information = information;
        }
    }

    /// Makes all members standardised.
    pub(super) fn standardise(&mut self) {
        self.members.iter_mut().for_each(|member| member.centred = 0.0);
    }

    /// Converts coordinates to natural values, in place.
    pub(super) fn natural(&self, point: &mut [f64]) {
        for population in &*self.populations {
            point[population.scale] = point[population.scale].exp();
        }
        for member in &self.members {
            let (m, ratio) = self.frame(member, point);
            let u = m + ratio * (point[member.place] - member.centred * m);
            point[member.place] = if self.is_log(member) { u.exp() } else { u };
        }
    }

    /// Converts natural values to coordinates, in place.
    pub(super) fn coordinates(&self, natural: &mut [f64]) {
        for member in &self.members {
            let (m, ratio) = self.frame(member, natural);
            let u = self.of_member(member).linear(natural[member.place]);
            natural[member.place] = (u - m) / ratio + member.centred * m;
        }
        for population in &*self.populations {
            natural[population.scale] = natural[population.scale].ln();
        }
    }

    /// Logarithm of the Jacobian at natural values.
    pub(super) fn log_jacobian(&self, natural: &[f64], jacobian: Jacobian) -> f64 {
        let scales: f64 = self.populations.iter().map(|p| natural[p.scale].ln()).sum();
        let of = |member: &Member| {
            let population = self.of_member(member);
            let scale = (natural[population.scale] / population.typical).ln();
            let own = if self.is_log(member) { natural[member.place].ln() } else { 0.0 };
            let width = match jacobian {
                Jacobian::Whole => 0.0,
                Jacobian::Marginal => -0.5 * self.determined(member, natural).ln_1p(),
            };
            member.degree(jacobian) * scale + own + width
        };
        scales + self.members.iter().map(of).sum::<f64>()
    }

    /// Converts derivatives by natural values into those by coordinates, and adds those of the Jacobian.
    pub(super) fn pull_back(&self, natural: &[f64], jacobian: Jacobian, gradient: &mut [f64]) {
        let mut by_log_scale = vec![0.0; self.populations.len()];
        for member in &self.members {
            let population = self.of_member(member);
            let (m, ratio) = self.frame(member, natural);
            let (value, c) = (natural[member.place], member.centred);
            let (by_linear, by_median) = if self.is_log(member) {
                (gradient[member.place] * value + 1.0, 1.0 / natural[population.location])
            } else {
                (gradient[member.place], 1.0)
            };
            gradient[member.place] = by_linear * ratio;
            gradient[population.location] += by_linear * (1.0 - ratio * c) * by_median;
            let u = population.linear(value);
            let slope = &mut by_log_scale[member.population];
            *slope += by_linear * (1.0 - c) * (u - m) + member.degree(jacobian);
            if jacobian == Jacobian::Marginal {
                let determined = self.determined(member, natural);
                *slope -= determined / (1.0 + determined);
            }
        }
        for (population, own) in self.populations.iter().zip(by_log_scale) {
            let slope = &mut gradient[population.scale];
            *slope = *slope * natural[population.scale] + own + 1.0;
        }
    }

    /// Bounds of the coordinates that belong to populations, from those of natural values, in place.
    pub(super) fn bounds(&self, bounds: &mut [(f64, f64)]) {
        for population in &*self.populations {
            let (low, high) = bounds[population.scale];
            bounds[population.scale] = (low.max(0.0).ln(), high.ln());
        }
        for member in &self.members {
            bounds[member.place] = (f64::NEG_INFINITY, f64::INFINITY);
        }
    }

    fn is_log(&self, member: &Member) -> bool {
        self.of_member(member).form == Form::LogNormal
    }

    /// Location on the scale of the population, and the factor of the coordinate, from natural values.
    fn frame(&self, member: &Member, natural: &[f64]) -> (f64, f64) {
        let population = self.of_member(member);
        let location = population.linear(natural[population.location]);
        let scale = natural[population.scale] / population.typical;
        (location, scale.powf(1.0 - member.centred))
    }

    /// Information of the data relative to that of the population.
    fn determined(&self, member: &Member, natural: &[f64]) -> f64 {
        member.information * natural[self.of_member(member).scale].powi(2)
    }
}

impl Member {
    /// Power of the scale in the Jacobian.
    fn degree(&self, jacobian: Jacobian) -> f64 {
        match jacobian {
            Jacobian::Whole => 1.0 - self.centred,
            Jacobian::Marginal => 1.0,
        }
    }
}
