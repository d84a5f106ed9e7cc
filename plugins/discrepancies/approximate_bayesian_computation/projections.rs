//! The Wasserstein distance of order 1, sliced for points of a plane.

use std::f64::consts::PI;

/// Number of directions for points of a plane.
const DIRECTIONS: usize = 16;

/// The data projected on each direction.
#[derive(Debug, Clone)]
pub(super) struct Projections {
    coordinate: Option<Vec<f64>>,
    /// Cosine and sine of each direction, with its sorted projections.
    directions: Vec<(f64, f64, Vec<f64>)>,
}

impl Projections {
    pub fn new(coordinate: Option<Vec<f64>>, data: &[f64]) -> Self {
        let angle = |l: usize| PI * (l as f64 + 0.5) / DIRECTIONS as f64;
        let angles: Vec<f64> = match coordinate {
            None => vec![0.5 * PI],
            Some(_) => (0..DIRECTIONS).map(angle).collect(),
        };
        let sorted = |angle: f64| {
            // Values alone are their own projections, to the bit.
            let (cosine, sine) =
                if coordinate.is_some() { (angle.cos(), angle.sin()) } else { (0.0, 1.0) };
            let mut projected = projected(coordinate.as_deref(), data, cosine, sine);
            projected.sort_by(f64::total_cmp);
            (cosine, sine, projected)
        };
        let directions = angles.into_iter().map(sorted).collect();
        Self { coordinate, directions }
    }

    pub fn square(&self, values: &[f64], slopes: Option<&mut [f64]>) -> f64 {
        let share = 1.0 / (self.directions.len() * values.len()) as f64;
        let mut signs = vec![0.0; values.len()];
        let mut distance = 0.0;
        for (cosine, sine, sorted) in &self.directions {
            let own = projected(self.coordinate.as_deref(), values, *cosine, *sine);
            let mut order: Vec<usize> = (0..own.len()).collect();
            order.sort_by(|a, b| own[*a].total_cmp(&own[*b]));
            for (&j, data) in order.iter().zip(sorted) {
                let gap = own[j] - data;
                distance += share * gap.abs();
                signs[j] += share * sine * if gap == 0.0 { 0.0 } else { gap.signum() };
            }
        }
        if let Some(slopes) = slopes {
            slopes.iter_mut().zip(signs).for_each(|(s, sign)| *s = 2.0 * distance * sign);
        }
        distance * distance
    }
}

fn projected(coordinate: Option<&[f64]>, values: &[f64], cosine: f64, sine: f64) -> Vec<f64> {
    match coordinate {
        None => values.to_vec(),
        Some(at) => at.iter().zip(values).map(|(x, y)| cosine * x + sine * y).collect(),
    }
}
