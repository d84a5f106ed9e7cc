//! A multiscale scan of whitened residuals: curves, windows along the last axis, octave bands.
//!
//! The energy of white noise in a window is chi squared. It is transformed to a normal statistic by its deviance, which
//! is accurate far out in the tail (Peizer and Pratt, Journal of the American Statistical Association 63 (1968) 1416),
//! and penalised for the number of windows of its length (Dümbgen and Spokoiny, Annals of Statistics 29 (2001) 124), so
//! that the cells of all scales compete on equal terms.

use std::sync::Arc;

use rustdct::{DctPlanner, TransformType2And3};

use crate::gap::experiment::Experiment;

/// Smallest number of degrees of freedom of a cell.
const FEWEST: f64 = 2.0;

/// Smallest number of cosines in an octave band.
const NARROWEST: usize = 4;

/// A cell of the scan with its statistic.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// The place that is scanned: a curve, or all curves of a condition together.
    pub place: usize,
    /// The indices of the first and the last measured value of the window.
    pub window: (usize, usize),
    /// The indices of the first cosine of the band and of the one after the last; `None` for all frequencies.
    pub band: Option<(usize, usize)>,
    /// The energy of the cell, standardised to a normal deviate and penalised for its length.
    pub statistic: f64,
}

/// The cells that are scanned.
pub struct Scan {
    /// The curves of each place.
    pub places: Vec<Vec<usize>>,
    curves: Vec<Vec<usize>>,
    plans: Vec<Arc<Plan>>,
}

/// Windows and bands of curves of one length.
struct Plan {
    length: usize,
    /// The lengths of windows, each with the indices at which its windows begin.
    windows: Vec<(usize, Vec<usize>)>,
    bands: Vec<(usize, usize)>,
    cosines: Arc<dyn TransformType2And3<f64>>,
}

impl Scan {
    /// The scan of each curve of an experiment, and of all curves of a condition together if they have equally many
    /// values.
    pub fn new(experiment: &Experiment<'_>) -> Self {
        let curves: Vec<Vec<usize>> =
            experiment.curves.iter().map(|curve| curve.measured.clone()).collect();
        let mut places: Vec<Vec<usize>> = (0..curves.len()).map(|s| vec![s]).collect();
        for condition in &experiment.conditions {
            let own: Vec<usize> =
                condition.curves.clone().filter(|&s| !curves[s].is_empty()).collect();
            if own.len() > 1 && own.iter().all(|&s| curves[s].len() == curves[own[0]].len()) {
                places.push(own);
            }
        }
        let mut plans: Vec<Arc<Plan>> = Vec::new();
        for curve in &curves {
            let known = plans.iter().find(|plan| plan.length == curve.len()).cloned();
            plans.push(known.unwrap_or_else(|| Arc::new(Plan::new(curve.len()))));
        }
        Self { places, curves, plans }
    }

    /// The cell of largest statistic of each place, from a whitened residual with one value per output.
    pub fn best(&self, white: &[f64]) -> Vec<Cell> {
        let sums: Vec<Vec<Vec<f64>>> = self
            .curves
            .iter()
            .zip(&self.plans)
            .map(|(curve, plan)| plan.sums(&curve.iter().map(|&i| white[i]).collect::<Vec<_>>()))
            .collect();
        let place = |(place, curves): (usize, &Vec<usize>)| {
            let plan = &self.plans[curves[0]];
            let own: Vec<&Vec<Vec<f64>>> = curves.iter().map(|&s| &sums[s]).collect();
            plan.best(place, &own)
        };
        self.places.iter().enumerate().map(place).collect()
    }

    /// The window of a place with the largest statistic over all frequencies, as indices of its first and last measured
    /// value: the best of the scanned windows, with its ends moved as long as that increases the statistic.
    pub fn window(&self, white: &[f64], place: usize) -> (usize, usize) {
        let curves = &self.places[place];
        let plan = &self.plans[curves[0]];
        let mut squares = vec![0.0; plan.length];
        for &s in curves {
            squares.iter_mut().zip(&self.curves[s]).for_each(|(q, &i)| *q += white[i].powi(2));
        }
        let roots: Vec<f64> = squares.iter().map(|q| q.sqrt()).collect();
        plan.narrowed(&running(&roots), curves.len() as f64)
    }
}

impl Plan {
    fn new(length: usize) -> Self {
        let mut bands = Vec::new();
        let mut begin = 0;
        while begin < length {
            let end = (begin * 2).max(begin + NARROWEST);
            // A last band that would be too narrow is joined to the one before.
            let end = if end + NARROWEST > length { length } else { end };
            bands.push((begin, end));
            begin = end;
        }
        let cosines = DctPlanner::new().plan_dct2(length.max(1));
        Self { length, windows: windows(length), bands, cosines }
    }

    /// The running sums of the squares of a curve, and of its part in each band.
    fn sums(&self, curve: &[f64]) -> Vec<Vec<f64>> {
        if curve.is_empty() {
            return Vec::new();
        }
        let mut parts = vec![running(curve)];
        if self.bands.len() > 1 {
            let mut spectrum = curve.to_vec();
            self.cosines.process_dct2(&mut spectrum);
            for &(begin, end) in &self.bands {
                let mut part = vec![0.0; curve.len()];
                part[begin..end].copy_from_slice(&spectrum[begin..end]);
                self.cosines.process_dct3(&mut part);
                let scale = 2.0 / curve.len() as f64;
                for x in &mut part {
                    *x *= scale;
                }
                parts.push(running(&part));
            }
        }
        parts
    }

    /// The best cell of some curves together.
    fn best(&self, place: usize, sums: &[&Vec<Vec<f64>>]) -> Cell {
        let mut best = Cell { place, window: (0, 0), band: None, statistic: f64::NEG_INFINITY };
        if sums.iter().any(|parts| parts.is_empty()) {
            return best;
        }
        for part in 0..sums[0].len() {
            let band = part.checked_sub(1).map(|b| self.bands[b]);
            let width = band.map_or(1.0, |(a, b)| (b - a) as f64 / self.length as f64);
            for (length, begins) in &self.windows {
                let freedom = *length as f64 * width * sums.len() as f64;
                if freedom < FEWEST {
                    continue;
                }
                // Of the windows of one length, the one with the most energy has the largest statistic.
                let mut most = (f64::NEG_INFINITY, 0);
                for &begin in begins {
                    let end = begin + length;
                    let energy: f64 = sums.iter().map(|p| p[part][end] - p[part][begin]).sum();
                    if energy > most.0 {
                        most = (energy, begin);
                    }
                }
                let (energy, begin) = most;
                let statistic = standardised(energy, freedom) - self.penalty(*length);
                if statistic > best.statistic {
                    best = Cell { place, window: (begin, begin + length - 1), band, statistic };
                }
            }
        }
        best
    }

    /// The window with the largest statistic, by the running sums of squares of so many curves together.
    fn narrowed(&self, sums: &[f64], curves: f64) -> (usize, usize) {
        let statistic = |begin: usize, end: usize| {
            let freedom = (end - begin) as f64 * curves;
            standardised(sums[end] - sums[begin], freedom) - self.penalty(end - begin)
        };
        let mut best = (f64::NEG_INFINITY, 0, self.length);
        for (length, begins) in &self.windows {
            for &begin in begins.iter().filter(|_| *length as f64 * curves >= FEWEST) {
                let one = statistic(begin, begin + length);
                if one > best.0 {
                    best = (one, begin, begin + length);
                }
            }
        }
        let mut step = (best.2 - best.1) / 4;
        while step > 0 {
            let (_, begin, end) = best;
            let moved = [
                (begin.saturating_sub(step), end),
                (begin + step, end),
                (begin, end.saturating_sub(step)),
                (begin, (end + step).min(self.length)),
            ];
            for (begin, end) in moved {
                let wide = end >= begin + 3 && (end - begin) as f64 * curves >= FEWEST;
                if wide && statistic(begin, end) > best.0 {
                    best = (statistic(begin, end), begin, end);
                }
            }
            if (best.1, best.2) == (begin, end) {
                step /= 2;
            }
        }
        (best.1, best.2.max(1) - 1)
    }

    fn penalty(&self, width: usize) -> f64 {
        (2.0 * (self.length as f64 / width as f64).ln()).sqrt()
    }
}

/// The normal deviate of an energy that is chi squared (Peizer and Pratt; freedom above one).
fn standardised(energy: f64, freedom: f64) -> f64 {
    let mode = freedom - 1.0;
    let shift = energy - freedom + 2.0 / 3.0 - 0.08 / freedom;
    let off = energy - mode;
    // Near the mode the deviance is a parabola.
    if off.abs() < 1e-4 * mode {
        return shift / (2.0 * mode).sqrt();
    }
    let deviance = mode * (mode / energy.max(f64::MIN_POSITIVE)).ln() + off;
    shift / off.abs() * deviance.max(0.0).sqrt()
}

/// Sums of the squares of the values before each place.
fn running(values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = Vec::with_capacity(values.len() + 1);
    all.push(0.0);
    for x in values {
        sum += x * x;
        all.push(sum);
    }
    all
}

/// Windows of lengths in steps of a root of two, each an eighth of its length from the next, and the whole.
fn windows(length: usize) -> Vec<(usize, Vec<usize>)> {
    let mut all = vec![(length, vec![0])];
    let mut width = length as f64 / std::f64::consts::SQRT_2;
    while width >= 3.0 {
        let w = width.round() as usize;
        let stride = (w / 8).max(1);
        all.push((w, (0..=length - w).step_by(stride).collect()));
        width /= std::f64::consts::SQRT_2;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::{Stream, normal};

    /// Quantiles of chi squared: 0.95 of 10, 1e-6 of 2 in the upper tail (27.631), 0.5 of 20 (19.337); tables of the
    /// normal law.
    #[test]
    fn energies_are_made_normal() {
        for (energy, freedom, deviate) in [
            (18.307, 10.0, 1.645),
            (27.631, 2.0, 4.753),
            (19.337, 20.0, 0.0),
            (3.940, 10.0, -1.645),
        ] {
            let found = standardised(energy, freedom);
            assert!((found - deviate).abs() < 0.02, "{energy} {freedom}: {found}");
        }
    }

    #[test]
    fn bands_divide_the_energy_of_a_curve() {
        let plan = Plan::new(100);
        let curve: Vec<f64> = (0..100).map(|t| f64::from(t * t % 13) - 6.0).collect();
        let sums = plan.sums(&curve);
        let (all, parts) = (sums[0][100], sums[1..].iter().map(|s| s[100]).sum::<f64>());
        assert!((all - parts).abs() < 1e-9 * all, "{all} {parts}");
        assert_eq!(plan.bands[0], (0, 4));
        assert_eq!(plan.bands[plan.bands.len() - 1].1, 100);
    }

    /// A bump of a height of 3 over 20 of 100 white numbers: the best window lies about it. White noise alone stays
    /// low.
    #[test]
    fn a_bump_is_found_where_it_is() {
        let mut rng = Stream::root(3).generator();
        let white: Vec<f64> = (0..100).map(|_| normal(&mut rng)).collect();
        let plan = Plan::new(100);
        let quiet = plan.best(0, &[&plan.sums(&white)]);
        assert!(quiet.statistic < 3.0, "{quiet:?}");
        let bumped: Vec<f64> = white
            .iter()
            .enumerate()
            .map(|(t, z)| z + if (40..60).contains(&t) { 3.0 } else { 0.0 })
            .collect();
        let found = plan.best(0, &[&plan.sums(&bumped)]);
        assert!(found.statistic > 6.0, "{found:?}");
        assert!((36..=44).contains(&found.window.0) && (56..=63).contains(&found.window.1));
        let (begin, end) = plan.narrowed(&running(&bumped), 1.0);
        assert!((39..=41).contains(&begin) && (58..=60).contains(&end), "{begin} {end}");
    }
}
