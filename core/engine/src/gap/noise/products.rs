//! Products of curves at all lags, computed once for all steps of expectation and maximisation.

use lacuna_linalg::vector::dot;

use super::autoregression::Autoregression;

/// One more than the highest order.
const LAGS: usize = 4;

/// The sums over `t >= p` of `x_{t-j} y_{t-k}` for two curves and an order `p`.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    order: usize,
    sums: [[f64; LAGS]; LAGS],
    heads: [[f64; LAGS]; 2],
}

impl Pair {
    /// The products of two curves of equal length, which is at least the order.
    pub fn new(x: &[f64], y: &[f64], order: usize) -> Self {
        let (length, p) = (x.len(), order);
        let mut sums = [[0.0; LAGS]; LAGS];
        for k in 0..=p {
            sums[0][k] = dot(&x[p..], &y[p - k..length - k]);
            sums[k][0] = if k == 0 { sums[0][0] } else { dot(&x[p - k..length - k], &y[p..]) };
        }
        for j in 0..p {
            for k in 0..p {
                sums[j + 1][k + 1] = sums[j][k] + x[p - 1 - j] * y[p - 1 - k]
                    - x[length - 1 - j] * y[length - 1 - k];
            }
        }
        let head = |z: &[f64]| {
            let mut head = [0.0; LAGS];
            head[..p].copy_from_slice(&z[..p]);
            head
        };
        Self { order, sums, heads: [head(x), head(y)] }
    }

    /// The sum of `x_t y_{t-lag}`.
    pub fn lagged(&self, lag: usize) -> f64 {
        let [x, y] = &self.heads;
        self.sums[0][lag] + (lag..self.order).map(|t| x[t] * y[t - lag]).sum::<f64>()
    }

    /// The sum of `x_{t-lag} y_t`.
    fn led(&self, lag: usize) -> f64 {
        let [x, y] = &self.heads;
        self.sums[lag][0] + (lag..self.order).map(|t| x[t - lag] * y[t]).sum::<f64>()
    }

    /// The sum of both.
    pub fn around(&self, lag: usize) -> f64 {
        self.lagged(lag) + self.led(lag)
    }

    /// The product of the curves after [`Autoregression::whiten`] with a memory of this order or none.
    pub fn whitened(&self, memory: &Autoregression) -> f64 {
        let p = self.order;
        let mut heads = self.heads;
        for head in &mut heads {
            memory.whiten(&mut head[..p]);
        }
        let mut weights = [0.0; LAGS];
        weights[0] = 1.0;
        weights[1..].iter_mut().zip(memory.coefficients()).for_each(|(w, a)| *w = -a);
        let mut sum = dot(&heads[0][..p], &heads[1][..p]);
        for (row, w) in self.sums.iter().zip(&weights) {
            sum += w * dot(row, &weights);
        }
        sum
    }
}

/// The products of some directions with each other and with contrasts.
#[derive(Debug, Clone, Default)]
pub(super) struct Products {
    /// The products of each direction with each direction.
    pub directions: Vec<Vec<Pair>>,
    /// The products of each contrast with each direction.
    pub mixed: Vec<Vec<Pair>>,
    /// The sums over the contrasts of their products with themselves, by lag.
    pub own: Vec<f64>,
}

impl Products {
    /// The products of curves of equal length.
    pub fn new(contrasts: &[Vec<f64>], directions: &[Vec<f64>], order: usize) -> Self {
        let with_all =
            |x: &Vec<f64>| directions.iter().map(|y| Pair::new(x, y, order)).collect::<Vec<_>>();
        let lag = |lag: usize| contrasts.iter().map(|c| dot(&c[lag..], &c[..c.len() - lag])).sum();
        Self {
            directions: directions.iter().map(with_all).collect(),
            mixed: contrasts.iter().map(with_all).collect(),
            own: (0..=order).map(lag).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_the_curves() {
        let curve =
            |a: f64| -> Vec<f64> { (0..12).map(|t| (a * f64::from(t * t)).sin()).collect() };
        let (x, y) = (curve(0.7), curve(1.9));
        let memory = Autoregression::of_autocovariances(&[1.0, 0.6, 0.3, 0.2], 3).0;
        let pair = Pair::new(&x, &y, 3);
        for lag in 0..=3 {
            assert!((pair.lagged(lag) - dot(&x[lag..], &y[..12 - lag])).abs() < 1e-12);
            assert!((pair.led(lag) - dot(&y[lag..], &x[..12 - lag])).abs() < 1e-12);
        }
        let (mut u, mut v) = (x, y);
        memory.whiten(&mut u);
        memory.whiten(&mut v);
        assert!((pair.whitened(&memory) - dot(&u, &v)).abs() < 1e-12);
    }
}
