//! Steps that map a point from the scale of one group of points to that of another.
//!
//! The map takes the mean and the standard deviations of one group to those of another, along the principal axes of
//! all points. It suits funnels, in which the whole posterior shrinks about a centre as an unknown variance
//! decreases: one step leads from mouth to neck and back, in any dimension. Its inverse is the map between the same
//! groups in the opposite direction, so that the acceptance ratio is that of Green, Biometrika 82 (1995) 711, for
//! deterministic maps: the ratio of the densities times the Jacobian determinant.

use lacuna::math::moments::variance;
use lacuna_linalg::Matrix;
use rand::Rng;

use super::levels::{Levels, pair};
use super::{Evaluated, Group, Proposal, Shape};

/// Mean and standard deviations of each group, in the whitened coordinates of a shape.
struct Frames {
    centres: Vec<Vec<f64>>,
    widths: Vec<Vec<f64>>,
}

impl Frames {
    fn of(others: &Evaluated, levels: &Levels, shape: &Shape) -> Self {
        let (mut centres, mut widths) = (Vec::new(), Vec::new());
        for level in 0..levels.count() {
            let mut members = others.points.select_rows(levels.members(level));
            (0..members.rows()).for_each(|i| shape.factor.whiten(members.row_mut(i)));
            let columns: Vec<Vec<f64>> =
                (0..members.columns()).map(|j| members.column(j)).collect();
            let mean = |x: &Vec<f64>| x.iter().sum::<f64>() / x.len() as f64;
            centres.push(columns.iter().map(mean).collect());
            widths.push(columns.iter().map(|x| variance(x).sqrt()).collect());
        }
        Self { centres, widths }
    }
}

/// Proposes for each mover a map between two groups drawn at random; `None` if there is a single group.
pub(super) fn rescalings(
    population: &Evaluated,
    Group { movers, others, shape }: Group<'_>,
    rng: &mut impl Rng,
) -> Option<Proposal> {
    let levels = Levels::of(others);
    if levels.count() < 2 {
        return None;
    }
    let frames = Frames::of(others, &levels, shape);
    let d = population.points.columns();
    let mut points = Matrix::zeros(0, d);
    let mut ln_ratio = Vec::with_capacity(movers.len());
    for &mover in movers {
        let (from, to) = pair(levels.count(), rng);
        let mut x = population.points.row(mover).to_vec();
        shape.factor.whiten(&mut x);
        let mut ln_determinant = 0.0;
        for (j, x) in x.iter_mut().enumerate() {
            let ratio = frames.widths[to][j] / frames.widths[from][j];
            *x = frames.centres[to][j] + ratio * (*x - frames.centres[from][j]);
            ln_determinant += ratio.ln();
        }
        points.push_row(&shape.factor.colour(&x));
        // A group of identical points has no width; the step is rejected.
        ln_ratio.push(if ln_determinant.is_finite() { ln_determinant } else { f64::NEG_INFINITY });
    }
    Some(Proposal { points, ln_ratio, chosen: None })
}
