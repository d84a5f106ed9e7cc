//! Functions of one number given by a table.

use crate::data::Interpolation;

/// A function given by its values at nodes: constant, straight or cubic between two of them, and constant beyond the
/// nodes.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Nodes, strictly increasing.
    pub nodes: Vec<f64>,
    pub values: Vec<f64>,
    interpolation: Interpolation,
    /// Second derivatives of a spline at the nodes; otherwise empty.
    bends: Vec<f64>,
}

/// A piece of a curve, where `from <= x < to`: `value + d (slope + d (square + d cube))` with `d = x - node`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    from: f64,
    to: f64,
    node: f64,
    value: f64,
    slope: f64,
    square: f64,
    cube: f64,
}

impl Segment {
    /// A segment that contains no number.
    pub const NONE: Self =
        Self { from: 0.0, to: 0.0, node: 0.0, value: 0.0, slope: 0.0, square: 0.0, cube: 0.0 };

    fn constant(from: f64, to: f64, value: f64) -> Self {
        Self { from, to, value, ..Self::NONE }
    }

    pub fn contains(&self, x: f64) -> bool {
        self.from <= x && x < self.to
    }

    pub fn height(&self, x: f64) -> f64 {
        if x.is_nan() {
            return x;
        }
        let d = x - self.node;
        if self.square != 0.0 || self.cube != 0.0 {
            return self.value + d * (self.slope + d * (self.square + d * self.cube));
        }
        // Beyond the nodes the distance may be infinite, and infinity times a zero slope is NaN.
        if self.slope == 0.0 { self.value } else { self.value + d * self.slope }
    }

    pub fn slope(&self, x: f64) -> f64 {
        if self.square == 0.0 && self.cube == 0.0 {
            return self.slope;
        }
        let d = x - self.node;
        self.slope + d * (2.0 * self.square + d * 3.0 * self.cube)
    }
}

impl Curve {
    /// A curve through values at strictly increasing nodes.
    pub fn new(nodes: Vec<f64>, values: Vec<f64>, interpolation: Interpolation) -> Self {
        let bends = match interpolation {
            Interpolation::Spline => bends(&nodes, &values),
            _ => Vec::new(),
        };
        Self { nodes, values, interpolation, bends }
    }

    /// The nodes at which the curve breaks, and whether it jumps there; otherwise only its slope does.
    pub fn breaks(&self) -> (Vec<f64>, bool) {
        match self.interpolation {
            Interpolation::Linear => (self.nodes.clone(), false),
            Interpolation::Hold => (self.nodes[1..].to_vec(), true),
            Interpolation::Spline => (vec![self.nodes[0], self.nodes[self.nodes.len() - 1]], false),
        }
    }

    /// The segment that contains `x`.
    pub fn segment(&self, x: f64) -> Segment {
        let (nodes, values, last) = (&self.nodes, &self.values, self.nodes.len() - 1);
        let after = self.after(x);
        if after == 0 {
            return Segment::constant(f64::NEG_INFINITY, nodes[0], values[0]);
        }
        if after > last {
            return Segment::constant(nodes[last], f64::INFINITY, values[last]);
        }
        let i = after - 1;
        let (from, to, value) = (nodes[i], nodes[after], values[i]);
        let width = to - from;
        let slope = (values[after] - value) / width;
        let straight = Segment { from, to, node: from, value, slope, square: 0.0, cube: 0.0 };
        match self.interpolation {
            Interpolation::Linear => straight,
            Interpolation::Hold => Segment::constant(from, to, value),
            Interpolation::Spline => {
                let (here, there) = (self.bends[i], self.bends[after]);
                Segment {
                    slope: slope - width * (2.0 * here + there) / 6.0,
                    square: 0.5 * here,
                    cube: (there - here) / (6.0 * width),
                    ..straight
                }
            }
        }
    }

    /// Number of nodes at or below `x`; for equally spaced nodes it is computed without a search.
    fn after(&self, x: f64) -> usize {
        let (nodes, last) = (&self.nodes, self.nodes.len() - 1);
        let guess = ((x - nodes[0]) / (nodes[last] - nodes[0]) * last as f64) as usize;
        for near in [guess, guess.saturating_sub(1), guess.saturating_add(1)] {
            if near < last && nodes[near] <= x && x < nodes[near + 1] {
                return near + 1;
            }
        }
        nodes.partition_point(|node| *node <= x)
    }

    pub fn height(&self, x: f64) -> f64 {
        if x.is_nan() { x } else { self.segment(x).height(x) }
    }
}

/// The second derivatives at the nodes of the cubic spline whose third derivative does not jump at the second and the
/// last but one node (C. de Boor, A Practical Guide to Splines, Springer 1978, chapter IV: "not-a-knot"): a straight line
/// for two nodes, a parabola for three.
fn bends(nodes: &[f64], values: &[f64]) -> Vec<f64> {
    let n = nodes.len();
    if n < 3 {
        return vec![0.0; n];
    }
    let width: Vec<f64> = nodes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slope = |i: usize| (values[i + 1] - values[i]) / width[i];
    if n == 3 {
        return vec![2.0 * (slope(1) - slope(0)) / (width[0] + width[1]); 3];
    }
    // Rows of the inner nodes i: w[i-1] m[i-1] + 2 (w[i-1] + w[i]) m[i] + w[i] m[i+1] = 6 (s[i] - s[i-1]). At both ends
    // the outer second derivative is eliminated: m[0] = m[1] - (m[2] - m[1]) w[0] / w[1].
    let inner = n - 2;
    let row = |i: usize| (width[i], 2.0 * (width[i] + width[i + 1]), width[i + 1]);
    let (mut below, mut middle): (Vec<f64>, Vec<f64>) =
        (0..inner).map(|i| (row(i).0, row(i).1)).unzip();
    let mut above: Vec<f64> = (0..inner).map(|i| row(i).2).collect();
    let mut m: Vec<f64> = (0..inner).map(|i| 6.0 * (slope(i + 1) - slope(i))).collect();
    let (first, last) = (width[0] / width[1], width[n - 2] / width[n - 3]);
    middle[0] += width[0] * (1.0 + first);
    above[0] -= width[0] * first;
    middle[inner - 1] += width[n - 2] * (1.0 + last);
    below[inner - 1] -= width[n - 2] * last;
    for i in 1..inner {
        let factor = below[i] / middle[i - 1];
        middle[i] -= factor * above[i - 1];
        m[i] -= factor * m[i - 1];
    }
    m[inner - 1] /= middle[inner - 1];
    for i in (0..inner - 1).rev() {
        m[i] = (m[i] - above[i] * m[i + 1]) / middle[i];
    }
    let begin = m[0] - (m[1] - m[0]) * first;
    let end = m[inner - 1] + (m[inner - 1] - m[inner - 2]) * last;
    std::iter::once(begin).chain(m).chain(std::iter::once(end)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of a segment far away is not one that has a next.
    #[test]
    fn far_beyond_its_ends_a_curve_is_constant() {
        for interpolation in [Interpolation::Linear, Interpolation::Hold, Interpolation::Spline] {
            let curve = Curve::new(vec![0.0, 1.0, 2.0], vec![3.0, 4.0, 7.0], interpolation);
            for x in [1e300, f64::MAX, f64::INFINITY] {
                assert_eq!((curve.height(x), curve.height(-x)), (7.0, 3.0), "{x}");
            }
        }
    }
}
