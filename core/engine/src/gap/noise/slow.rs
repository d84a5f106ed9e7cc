//! The slow part of a record's misfit: a band of cosines larger than noise of the estimated autocorrelation would
//! produce.
//!
//! A drift appears in the slowest cosines, a cycle in those around its frequency; the noise is estimated around this
//! part. The band, if any, is chosen by the likelihood with a penalty per cosine, at which pure noise gets a first
//! cosine in one of a hundred records (Eubank and Hart, Annals of Statistics 20 (1992) 1412). A band that does not
//! begin with the slowest cosine has a further penalty for the choice of its beginning (Chen and Chen, Biometrika 95
//! (2008) 759).

use std::ops::Range;

use lacuna_linalg::vector::{add_scaled, dot};

use super::restricted::{self, Known, Law, Restricted};

/// The price of a cosine, as twice a log-likelihood: `sum over j of P(chi2_j > j price) / j` is 0.01.
const PRICE: f64 = 6.74;

/// Largest number of cosines.
const MOST: usize = 48;

/// Smallest number of values per cosine.
const EACH: usize = 3;

/// A cosine that keeps less than this share of its square after projection onto the complement of the unknowns and the
/// slower cosines is dropped.
const OWN: f64 = 0.05;

/// Number of bands that are tried one after another from each beginning.
const STEPS: usize = 4;

/// A record, the slopes of the unknowns, and the cosines that are orthogonal to them.
struct Record<'a> {
    values: &'a [f64],
    places: &'a [usize],
    unknowns: &'a [Vec<f64>],
    known: &'a Known,
    /// Orthonormal cosines, orthogonal to the unknowns; the slowest first.
    cosines: Vec<Vec<f64>>,
}

/// The law of a record's noise about its slow part; `unknowns` are orthonormal. `None` if too few values are left.
pub(super) fn law(
    values: &[f64],
    unknowns: &[Vec<f64>],
    places: &[usize],
    known: &Known,
) -> Option<Law> {
    let record = Record { values, places, unknowns, known, cosines: cosines(unknowns, places) };
    let mut seen: Vec<(Range<usize>, Law)> = Vec::new();
    // Two starts: all of the misfit as noise, and roughly its fast part only.
    for (mut band, mut most) in [(0..0, restricted::MOST), (0..record.cosines.len(), 1)] {
        for _ in 0..STEPS {
            if seen.iter().any(|(other, _)| *other == band) {
                break;
            }
            let Some(law) = record.law(&band, most) else { break };
            let next = record.band(&law);
            seen.push((band, law));
            (band, most) = (next, restricted::MOST);
        }
    }
    let value = |(band, law): &(Range<usize>, Law)| law.deviance + record.price(band);
    let best = seen.into_iter().min_by(|a, b| value(a).total_cmp(&value(b)));
    best.map(|(_, law)| law)
}

/// The cosines of a record, orthogonal to the slopes of its unknowns.
fn cosines(unknowns: &[Vec<f64>], places: &[usize]) -> Vec<Vec<f64>> {
    let most = MOST.min(places.len().saturating_sub(unknowns.len()) / EACH);
    let mut all = unknowns.to_vec();
    for k in 0..most {
        all.extend(off(cosine(k, places), &all, OWN));
    }
    all.split_off(unknowns.len())
}

/// A cosine with `k` half waves over a record, at these places.
fn cosine(k: usize, places: &[usize]) -> Vec<f64> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return Vec::new() };
    let wave = std::f64::consts::PI * k as f64 / (last - first + 1) as f64;
    places.iter().map(|place| (wave * ((place - first) as f64 + 0.5)).cos()).collect()
}

/// The component of a curve orthogonal to some orthonormal ones, normalised; `None` if less than a share of its square
/// is left.
fn off(mut curve: Vec<f64>, others: &[Vec<f64>], share: f64) -> Option<Vec<f64>> {
    let size = dot(&curve, &curve);
    // Two passes of Gram-Schmidt orthogonalisation are enough (Giraud and others, Numerische Mathematik 101 (2005) 87).
    for _ in 0..2 {
        for other in others {
            let along = dot(other, &curve);
            add_scaled(&mut curve, -along, other);
        }
    }
    let left = dot(&curve, &curve);
    for x in &mut curve {
        *x /= left.sqrt();
    }
    (left > share * size).then_some(curve)
}

impl Record<'_> {
    /// The law of the noise about a band, of an order up to `most`.
    fn law(&self, band: &Range<usize>, most: usize) -> Option<Law> {
        let columns = [self.unknowns, &self.cosines[band.clone()]].concat();
        let (values, places, known) = (self.values, self.places, self.known);
        Restricted { values, columns: &columns, places, known }.law(most)
    }

    /// The price of a band, as twice a log-likelihood.
    fn price(&self, band: &Range<usize>) -> f64 {
        let choice = if band.start > 0 { 2.0 * (self.cosines.len() as f64).ln() } else { 0.0 };
        PRICE * band.len() as f64 + choice
    }

    /// The best band under the noise of a law: the one with the largest sum of gains minus prices.
    fn band(&self, law: &Law) -> Range<usize> {
        let mut best = (0.0, 0..0);
        let (mut begin, mut inner, mut all) = (0, 0.0, 0.0);
        for (k, gain) in self.gains(law).into_iter().enumerate() {
            if inner <= 0.0 {
                (begin, inner) = (k, 0.0);
            }
            inner += gain - PRICE;
            all += gain - PRICE;
            let own = begin..k + 1;
            let choice = self.price(&own) - PRICE * own.len() as f64;
            for (sum, band) in [(all, 0..k + 1), (inner - choice, own)] {
                if sum > best.0 {
                    best = (sum, band);
                }
            }
        }
        best.1
    }

    /// Squared white coordinate of each cosine after the unknowns and the slower cosines: chi squared with one degree
    /// of freedom under noise alone.
    fn gains(&self, law: &Law) -> Vec<f64> {
        let succession = law.memory.on(self.places);
        let white = |curve: &Vec<f64>| {
            let mut curve = curve.clone();
            succession.whiten(&mut curve);
            curve
        };
        let values = white(&self.values.to_vec());
        let mut all: Vec<Vec<f64>> = Vec::new();
        for curve in self.unknowns.iter().chain(&self.cosines) {
            let nothing = || vec![0.0; values.len()];
            let next = off(white(curve), &all, 0.0).unwrap_or_else(nothing);
            all.push(next);
        }
        let gain = |curve: &Vec<f64>| (dot(curve, &values) / law.sd).powi(2);
        all[self.unknowns.len()..].iter().map(gain).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::gap::noise::Autoregression;
    use lacuna::math::random::{Stream, normal};

    /// Records of first order about something else, and the noise that is found in them.
    fn found(length: usize, a: f64, records: u64, slow: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
        let places: Vec<usize> = (0..length).collect();
        let level = vec![(length as f64).sqrt().recip(); length];
        let memory = Autoregression::of_reflections(&[a]);
        let record = |b: u64| {
            let mut rng = Stream::root(21).at(b).generator();
            let mut values: Vec<f64> = (0..length).map(|_| normal(&mut rng)).collect();
            memory.colour(&mut values);
            let at = (0..length).map(|t| t as f64 / length as f64);
            values.iter_mut().zip(at).for_each(|(y, x)| *y += slow(x));
            let law =
                law(&values, std::slice::from_ref(&level), &places, &Known::default()).unwrap();
            [law.sd, law.memory.autocovariances(2)[1] / law.memory.variance()]
        };
        (0..records).map(record).collect()
    }

    type Shape = fn(f64) -> f64;

    /// A curve ten times as large as the noise changes little of what is found: innovations of size one, a correlation
    /// of a half; the edges of a cycle's band pass for a slower noise. The standard errors of n values are
    /// `1 / sqrt(2 n)` and `sqrt((1 - a^2) / n)` (Brockwell and Davis, section 8.1).
    #[test]
    fn noise_is_found_about_what_is_slow() {
        let (length, a, records) = (300, 0.5, 12);
        let shapes: [(Shape, f64); 3] = [
            (|_| 0.0, 0.03),
            (|x| 40.0 * (x * x - x / 3.0), 0.1),
            (|x| 14.0 * (75.0 * x).sin(), 0.4),
        ];
        for (shape, bound) in shapes {
            let found = found(length, a, records, shape);
            let mean = |k: usize| found.iter().map(|own| own[k]).sum::<f64>() / records as f64;
            let n = length as f64 * records as f64;
            assert!((mean(0) - 1.0).abs() < bound + 4.0 / (2.0 * n).sqrt(), "{}", mean(0));
            assert!((mean(1) - a).abs() < bound + 4.0 * ((1.0 - a * a) / n).sqrt(), "{}", mean(1));
        }
    }
}
