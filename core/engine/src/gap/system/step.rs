//! The step of a fit: the minimum of a quadratic function inside a box.

use lacuna_linalg::{Cholesky, Matrix};

/// The relative size of a slope at which a bound is not left.
const FLAT: f64 = 1e-12;

/// The minimum of `s'As / 2 - g's` for `low <= s <= high`, with `A` positive definite and zero inside the box: a primal
/// active-set method (Nocedal and Wright, Numerical Optimization, 2nd ed., section 16.5; for bounds: Stark and Parker,
/// Computational Statistics 10 (1995) 129). `None` if `A` has no Cholesky factor.
pub(in crate::gap) fn within(a: &Matrix, g: &[f64], low: &[f64], high: &[f64]) -> Option<Vec<f64>> {
    let size = g.len();
    let mut s = vec![0.0; size];
    let mut held = vec![false; size];
    // Every round but the last fixes one unknown at a bound or releases one. The limit guards against a cycle at
    // degenerate bounds; the function falls in every round, so that the present point is a step as well.
    for _ in 0..8 * size + 8 {
        let aim = on_face(a, g, &s, &held)?;
        let (share, reached) = along(&s, &aim, low, high);
        for i in (0..size).filter(|&i| !held[i]) {
            s[i] += share * (aim[i] - s[i]);
        }
        if let Some(i) = reached {
            s[i] = if aim[i] < s[i] || aim[i] < low[i] { low[i] } else { high[i] };
            held[i] = true;
            continue;
        }
        let slope = |i: usize| g[i] - (0..size).map(|j| a[(i, j)] * s[j]).sum::<f64>();
        let inward = |&i: &usize| {
            let slope = slope(i);
            let clear = slope.abs() > FLAT * g[i].abs().max(f64::MIN_POSITIVE);
            held[i] && low[i] < high[i] && clear && ((slope > 0.0) == (s[i] <= low[i]))
        };
        let steepest = |&i: &usize, &j: &usize| slope(i).abs().total_cmp(&slope(j).abs());
        match (0..size).filter(inward).max_by(steepest) {
            Some(i) => held[i] = false,
            None => break,
        }
    }
    Some(s)
}

/// The minimum with the held unknowns fixed, without bounds.
fn on_face(a: &Matrix, g: &[f64], s: &[f64], held: &[bool]) -> Option<Vec<f64>> {
    let free: Vec<usize> = (0..g.len()).filter(|&i| !held[i]).collect();
    let reduced = Matrix::from_fn(free.len(), free.len(), |i, j| a[(free[i], free[j])]);
    let fixed = |i: usize| (0..g.len()).filter(|&j| held[j]).map(|j| a[(i, j)] * s[j]).sum::<f64>();
    let mut aim: Vec<f64> = free.iter().map(|&i| g[i] - fixed(i)).collect();
    if !free.is_empty() {
        Cholesky::new(&reduced).ok()?.solve(&mut aim);
    }
    let mut all = s.to_vec();
    free.iter().zip(aim).for_each(|(&i, x)| all[i] = x);
    Some(all)
}

/// The share of the way to an aim that stays in the box, at most one, and the unknown that reaches its bound there.
fn along(s: &[f64], aim: &[f64], low: &[f64], high: &[f64]) -> (f64, Option<usize>) {
    let mut first = (1.0, None);
    for i in 0..s.len() {
        let way = aim[i] - s[i];
        let bound = if way < 0.0 { low[i] } else { high[i] };
        if (way < 0.0 && aim[i] < bound) || (way > 0.0 && aim[i] > bound) {
            let share = ((bound - s[i]) / way).clamp(0.0, 1.0);
            if share < first.0 || first.1.is_none() {
                first = (share, Some(i));
            }
        }
    }
    first
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::math::random::{Stream, normal};
    use lacuna_linalg::gram;

    fn value(a: &Matrix, g: &[f64], s: &[f64]) -> f64 {
        let product = |i: usize| (0..g.len()).map(|j| a[(i, j)] * s[j]).sum::<f64>();
        (0..g.len()).map(|i| s[i] * (0.5 * product(i) - g[i])).sum()
    }

    /// The least value over all faces of the box, `3^size`, whose free unknowns are inside.
    fn by_enumeration(a: &Matrix, g: &[f64], low: &[f64], high: &[f64]) -> f64 {
        let size = g.len();
        let mut best = f64::INFINITY;
        for face in 0..3_usize.pow(size as u32) {
            let digit = |i: usize| face / 3_usize.pow(i as u32) % 3;
            let held: Vec<bool> = (0..size).map(|i| digit(i) > 0).collect();
            let start: Vec<f64> = (0..size).map(|i| [0.0, low[i], high[i]][digit(i)]).collect();
            let s = on_face(a, g, &start, &held).unwrap();
            if s.iter().zip(low.iter().zip(high)).all(|(x, (l, h))| l <= x && x <= h) {
                best = best.min(value(a, g, &s));
            }
        }
        best
    }

    #[test]
    fn the_least_value_of_all_faces_is_found() {
        let size = 4;
        for b in 0..200 {
            let mut rng = Stream::root(3).at(b).generator();
            let factor = Matrix::from_fn(size + 1, size, |_, _| normal(&mut rng));
            let a = gram(&factor);
            let g: Vec<f64> = (0..size).map(|_| 3.0 * normal(&mut rng)).collect();
            let mut side = || normal(&mut rng).abs() * if b % 3 == 0 { 0.2 } else { 2.0 };
            // A side of length zero: the search stands at that bound.
            let low: Vec<f64> = (0..size).map(|i| if i == 0 { 0.0 } else { -side() }).collect();
            let high: Vec<f64> = (0..size).map(|_| side()).collect();
            let s = within(&a, &g, &low, &high).unwrap();
            assert!(s.iter().zip(low.iter().zip(&high)).all(|(x, (l, h))| l <= x && x <= h));
            let (found, least) = (value(&a, &g, &s), by_enumeration(&a, &g, &low, &high));
            assert!(found - least < 1e-9 * least.abs().max(1.0), "{b}: {found} {least}");
        }
    }
}
