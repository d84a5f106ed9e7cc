//! Principal curvatures of a limit state at a design point.

use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, symmetric_eigen};

use crate::reliability::common::Counted;
use crate::reliability::form::Found;

/// Principal curvatures, positive where the failure region curves away from the origin; `None` if the model has no answer
/// around the point.
///
/// Mixed derivatives take two further values each: `g(u + a + b) + g(u - a - b)` less the values along `a` and `b`.
pub fn principal(state: &Counted<'_>, found: &Found, step: f64) -> Result<Option<Vec<f64>>, Stop> {
    let u = &found.design.point;
    let axes = tangent(&found.design.direction);
    let m = axes.len();
    if m == 0 {
        return Ok(Some(Vec::new()));
    }
    let mut points = Matrix::zeros(0, u.len());
    let mut add = |parts: &[(usize, f64)]| {
        let mut point = u.clone();
        for (i, size) in parts {
            point.iter_mut().zip(&axes[*i]).for_each(|(x, a)| *x += size * step * a);
        }
        points.push_row(&point);
    };
    (0..m).for_each(|i| [1.0, -1.0].into_iter().for_each(|s| add(&[(i, s)])));
    for i in 0..m {
        for j in 0..i {
            for s in [1.0, -1.0] {
                add(&[(i, s), (j, s)]);
            }
        }
    }
    let values = state.values(&points)?;
    if values.iter().any(|value| !value.is_finite()) {
        return Ok(None);
    }
    let centre = found.value;
    let along = |i: usize| values[2 * i] + values[2 * i + 1];
    let mut hessian = Matrix::zeros(m, m);
    let mut pair = 2 * m;
    for i in 0..m {
        hessian[(i, i)] = (along(i) - 2.0 * centre) / (step * step);
        for j in 0..i {
            let both = values[pair] + values[pair + 1];
            let mixed = (both - along(i) - along(j) + 2.0 * centre) / (2.0 * step * step);
            (hessian[(i, j)], hessian[(j, i)]) = (mixed, mixed);
            pair += 2;
        }
    }
    let Ok(eigen) = symmetric_eigen(&hessian) else { return Ok(None) };
    Ok(Some(eigen.values.iter().map(|value| value / found.slope).collect()))
}

/// Orthonormal vectors perpendicular to a unit vector, by Gram and Schmidt from the coordinate axes.
fn tangent(normal: &[f64]) -> Vec<Vec<f64>> {
    let d = normal.len();
    let mut all: Vec<Vec<f64>> = vec![normal.to_vec()];
    let largest = (0..d).max_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs()));
    for axis in (0..d).filter(|i| Some(*i) != largest) {
        let mut vector: Vec<f64> = (0..d).map(|j| f64::from(u8::from(j == axis))).collect();
        // Twice is enough.
        for _ in 0..2 {
            for other in &all {
                let share = dot(&vector, other);
                vector.iter_mut().zip(other).for_each(|(x, o)| *x -= share * o);
            }
        }
        let size = dot(&vector, &vector).sqrt();
        for x in &mut vector {
            *x /= size;
        }
        all.push(vector);
    }
    all.split_off(1)
}
