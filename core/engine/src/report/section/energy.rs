//! Energies of a Hamiltonian sampler.

use maud::{Markup, html};

use crate::page::chart::{Axis, Curve, Key, Panel, small_multiples};
use crate::page::curve::smooth_density;
use crate::page::number::{count, significant};
use crate::page::scale::extent;
use crate::page::{Caption, Numbers};
use crate::report::findings::Energies;
use crate::stage::energies::SMALLEST;

/// Number of points of a density.
const POINTS: usize = 160;

/// Densities of the energies and of their changes; empty if all energies are equal.
pub fn figure(energies: &Energies, numbers: &mut Numbers) -> Markup {
    let density = |values: &[f64]| smooth_density(values, f64::NAN, POINTS);
    let (levels, changes) = (density(&energies.levels), density(&energies.changes));
    let all = || levels.iter().chain(&changes);
    let (Some(domain), Some((_, highest))) =
        (extent(all().map(|p| p.0)), extent(all().map(|p| p.1)))
    else {
        return html! {};
    };
    let lowest = energies.fractions.iter().copied().fold(f64::INFINITY, f64::min);
    let low = energies.fractions.iter().filter(|fraction| **fraction < SMALLEST).count();
    let curve = |class, name: &str, points: &[(f64, f64)]| Curve {
        class,
        name: name.to_owned(),
        points: points.to_vec(),
    };
    let panel = Panel {
        title: String::new(),
        remark: format!("smallest E-BFMI {}", significant(lowest, 2)),
        bands: Vec::new(),
        curves: vec![
            curve("s-mean", "energy less its mean", &levels),
            curve("s-map", "change in a step", &changes),
        ],
    };
    let keys =
        [Key::line("s-mean", "energy less its mean"), Key::line("s-map", "change in a step")];
    let below = match low {
        0 => format!("in all {} chains at least {SMALLEST}", count(energies.fractions.len())),
        _ => format!(
            "below {SMALLEST} in {} of {} chains",
            count(low),
            count(energies.fractions.len())
        ),
    };
    let caption = Caption::new(
        format!(
            "Energy of the Hamiltonian sampler about its mean, and change of the energy from step to step. The energy Bayesian \
             fraction of missing information (E-BFMI), the mean square of the changes over that of the energies, is {below}."
        ),
        "the steps after the burn-in.",
        "changes much narrower than the energies: the chains diffuse slowly through the tails. Other coordinates or a heavier \
         prior for scales help, more steps hardly.",
    );
    let x = Axis::new("energy", domain).ticks(6);
    let y = Axis::new("density", (0.0, 1.1 * highest)).ticks(4);
    let drawings = small_multiples(&[panel], &x, &y, "energy of the sampler");
    numbers.figure("energy", &drawings, &keys, &caption)
}
