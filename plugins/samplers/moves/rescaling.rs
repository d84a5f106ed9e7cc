//! Steps that change a point's scale to that of another group of points.
//!
//! The map takes the centre and the widths of one group to those of another, along the principal axes of all
//! points. It suits funnels, in which a whole posterior shrinks about a centre while an unknown variance
//! falls: there it leads in one step from mouth to neck and on, whatever the dimension. Its inverse is the map between
//! the same groups the other way, so that a step is taken with the probability of Green, Biometrika 82 (1995) 711,
//! for deterministic maps: the ratio of densities times the determinant.

use lacuna::linalg::Matrix;
use lacuna::math::moments::variance;
use rand::Rng;

use super::levels::{Levels, pair};
use super::{Evaluated, Group, Proposal, Shape};

/// The centre and the widths of each group of others, in the axes of a shape.
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

/// One step of each mover between two groups drawn at random; none with a single group.
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
        // A group of equal points has no width.
        ln_ratio.push(if ln_determinant.is_finite() { ln_determinant } else { f64::NEG_INFINITY });
    }
    Some(Proposal { points, ln_ratio, chosen: None })
}
