//! All design points of a limit state, and the union of its linearised failure regions.

use lacuna::math::random::{Stream, normal, uniform};
use lacuna::math::special::{normal_cdf, normal_quantile_of_ln};
use lacuna::plugin::reliability::DesignPoint;
use lacuna::run::Stop;
use lacuna_linalg::vector::{dot, norm};

use super::search::{Bulge, Found, Settings, search};
use crate::reliability::common::Counted;

/// Share of the probability of the nearest point below which a further point ends the search.
const NEGLIGIBLE: f64 = 0.01;
/// Attempts at a search that has no slope at its start, or does not converge.
const ATTEMPTS: usize = 2;
/// Iterations of a search for a further point.
const FURTHER: usize = 10;
/// Distance of the first start from the origin, where a limit state may be symmetric and its slope lead to a saddle.
const OFFSET: f64 = 0.2;

/// Finds up to `most` design points, the nearest first; empty if no search converges.
pub fn design_points(
    state: &Counted<'_>,
    most: usize,
    settings: Settings,
    stream: &Stream,
) -> Result<Vec<Found>, Stop> {
    let mut rng = stream.generator();
    let mut found: Vec<Found> = Vec::new();
    let mut last: Option<Found> = None;
    for round in 0..most {
        let bulges: Vec<Bulge> = found.iter().map(Bulge::at).collect();
        let further = Settings { iterations: settings.iterations.min(FURTHER), ..settings };
        let settings = if round == 0 { settings } else { further };
        let mut next = None;
        for attempt in 0..ATTEMPTS {
            let mut start = opposite(&found, state.dimension());
            let size = found.first().map_or(OFFSET, |f| 0.5 * f.design.distance.abs());
            if attempt > 0 || norm(&start) < 0.1 {
                start = (0..state.dimension()).map(|_| normal(&mut rng)).collect();
                let factor =
                    if attempt > 0 { size.max(1.0) } else { size } / norm(&start).max(1e-12);
                for x in &mut start {
                    *x *= factor;
                }
            }
            let mut ended = search(state, &start, &bulges, settings)?;
            if let Some(inside) = ended.as_ref().filter(|f| !f.converged && f.settled) {
                // A point inside a bulge may lie near another design point.
                ended = search(state, &inside.design.point, &[], settings)?;
            }
            next = ended.clone().filter(|f| f.converged && !found.iter().any(|o| same(o, f)));
            last = last.or(ended);
            if next.is_some() {
                break;
            }
        }
        let Some(next) = next else { break };
        let share = normal_cdf(-next.design.distance);
        let most = found.iter().map(|f| normal_cdf(-f.design.distance)).fold(0.0, f64::max);
        if share < NEGLIGIBLE * most {
            break;
        }
        found.push(next);
    }
    if found.is_empty() {
        found.extend(last);
    }
    found.sort_by(|a, b| a.design.distance.total_cmp(&b.design.distance));
    Ok(found)
}

/// The point opposite to the mean of those that have been found, at half their distance; the origin without any.
fn opposite(found: &[Found], dimension: usize) -> Vec<f64> {
    let count = found.len().max(1) as f64;
    let mean = |j: usize| found.iter().map(|f| f.design.point[j]).sum::<f64>() / count;
    (0..dimension).map(|j| if found.is_empty() { 0.0 } else { -0.5 * mean(j) }).collect()
}

fn same(a: &Found, b: &Found) -> bool {
    let pairs = a.design.point.iter().zip(&b.design.point);
    let square: f64 = pairs.map(|(x, y)| (x - y) * (x - y)).sum();
    square.sqrt() < 0.1 * a.design.distance.abs().max(1.0)
}

/// Number of draws for the overlap of half-spaces, which cost no call of the model.
const DRAWS: usize = 20_000;

/// Probability of the union of the half-spaces beyond the design points.
///
/// For several points it is estimated with samples from one half-space at a time, each weighted by the number of those that
/// contain it (Owen, Maximov and Chertkov, Electron. J. Stat. 13 (2019) 231), with an error below 1 %.
pub fn union(points: &[DesignPoint], stream: &Stream) -> f64 {
    let single: Vec<f64> = points.iter().map(|point| normal_cdf(-point.distance)).collect();
    let total: f64 = single.iter().sum();
    if points.len() < 2 || total <= 0.0 {
        return total;
    }
    let mut rng = stream.generator();
    let mut sum = 0.0;
    for _ in 0..DRAWS {
        let chosen = pick(&single, total * uniform(&mut rng));
        let u = beyond(&points[chosen], &mut rng);
        let holding = points.iter().filter(|p| dot(&p.direction, &u) >= p.distance).count();
        sum += 1.0 / holding.max(1) as f64;
    }
    (total * sum / DRAWS as f64).min(1.0)
}

/// Index of the share in which a number below the total falls.
pub fn pick(shares: &[f64], mut at: f64) -> usize {
    for (i, share) in shares.iter().enumerate() {
        if at < *share {
            return i;
        }
        at -= share;
    }
    shares.len() - 1
}

/// Standard normal draw beyond the plane at a design point.
fn beyond(point: &DesignPoint, rng: &mut rand::rngs::ChaCha8Rng) -> Vec<f64> {
    let mut u: Vec<f64> = point.direction.iter().map(|_| normal(rng)).collect();
    let ln_tail = lacuna::math::special::ln_normal_cdf(-point.distance);
    let along = -normal_quantile_of_ln(ln_tail + uniform(rng).ln());
    let shift = along - dot(&point.direction, &u);
    u.iter_mut().zip(&point.direction).for_each(|(x, a)| *x += shift * a);
    u
}
