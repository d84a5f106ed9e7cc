//! Screening of faulty curves among the replicates, and summary curves that a study adds to its data.

use lacuna::data::layout::Group;
use lacuna::data::measurements::{Measurements, Observations, Replicate};
use lacuna::math::moments::{quantile, sorted};

use super::read::Measured;
use serde::{Deserialize, Serialize};

use crate::study::file::{AddedCurve, MeasurementKeys};

/// Factor that converts a median absolute deviation into the standard deviation of a normal distribution.
const MAD: f64 = 1.482_602_218_505_602;

/// Half-width of the 95 % interval of a normal distribution, in standard deviations.
pub const Z975: f64 = 1.959_963_984_540_054;

/// A curve far from the other replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlaggedCurve {
    /// The replicate's name.
    pub replicate: String,
    /// The group (sensor).
    pub group: String,
    /// Root mean square distance of the curve from the group's median curve, standardised by the median and the median
    /// absolute deviation of the group's distances.
    pub distance: f64,
    /// The distance above which curves are flagged.
    pub threshold: f64,
    /// True if the curve is excluded from the calibration.
    pub left_out: bool,
}

/// Flags curves whose root mean square distance from their group's median curve differs strongly from that of the
/// others.
///
/// The distance of a curve is standardised by the median and the median absolute deviation of the group's distances
/// (Iglewicz and Hoaglin 1993), with a scale of at least a tenth of the median distance, so that nothing is flagged in
/// a group of nearly equal curves. Groups of fewer than four curves are not judged.
pub fn flag(data: &Measurements, threshold: f64, leave_out: bool) -> Vec<FlaggedCurve> {
    let mut flagged = Vec::new();
    for group in data.layout.groups() {
        let distances = distances(data, &group);
        if distances.len() < 4 {
            continue;
        }
        let plain: Vec<f64> = distances.iter().map(|(_, d)| *d).collect();
        let centre = median(plain.clone());
        let spread = MAD * median(plain.iter().map(|d| (d - centre).abs()).collect());
        let scale = spread.max(0.1 * centre);
        if scale == 0.0 {
            continue;
        }
        for (replicate, distance) in distances {
            let standardised = (distance - centre) / scale;
            if standardised > threshold {
                flagged.push(FlaggedCurve {
                    replicate: data.replicates[replicate].name.clone(),
                    group: group.name.clone(),
                    distance: standardised,
                    threshold,
                    left_out: leave_out,
                });
            }
        }
    }
    flagged
}

/// Root mean square distance of each curve of a group from the group's median curve, with the index of its replicate.
fn distances(data: &Measurements, group: &Group) -> Vec<(usize, f64)> {
    let medians: Vec<f64> = group.indices.iter().map(|&i| median(data.values(i))).collect();
    let distance = |replicate: &Replicate| {
        let pairs = group.indices.iter().zip(&medians);
        let squares: Vec<f64> =
            pairs.filter_map(|(&i, m)| replicate.values[i].map(|y| (y - m).powi(2))).collect();
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        (!squares.is_empty()).then(|| mean.sqrt())
    };
    let all = data.replicates.iter().enumerate();
    all.filter_map(|(r, replicate)| Some((r, distance(replicate)?))).collect()
}

fn median(values: Vec<f64>) -> f64 {
    if values.is_empty() { 0.0 } else { quantile(&sorted(&values), 0.5) }
}

/// The measurements without the flagged curves that are to be removed.
pub fn without(data: &Measurements, flagged: &[FlaggedCurve]) -> Measurements {
    let mut kept = data.clone();
    let groups = data.layout.groups();
    for curve in flagged.iter().filter(|curve| curve.left_out) {
        let group = groups.iter().find(|g| g.name == curve.group);
        let replicate = kept.replicates.iter_mut().find(|r| r.name == curve.replicate);
        if let (Some(group), Some(replicate)) = (group, replicate) {
            for &i in &group.indices {
                replicate.values[i] = None;
            }
        }
    }
    kept
}

/// The measurements with further curves computed from the replicates of each value: their mean and the ends of the 95 %
/// interval `mean +- 1.96 sd` of a replicate.
pub fn with_added_curves(data: &Measurements, curves: &[AddedCurve]) -> Measurements {
    let mut extended = data.clone();
    if curves.is_empty() {
        return extended;
    }
    let summaries = data.summaries();
    for curve in curves {
        let (name, shift) = match curve {
            AddedCurve::Mean => ("mean", 0.0),
            AddedCurve::Q025 => ("q025", -Z975),
            AddedCurve::Q975 => ("q975", Z975),
        };
        let value = |s: &lacuna::data::measurements::Summary| {
            let shifted = || Some(s.mean + shift * s.sd()?);
            if s.count == 0 {
                None
            } else if shift == 0.0 {
                Some(s.mean)
            } else {
                shifted()
            }
        };
        extended
            .replicates
            .push(Replicate::new(name.to_owned(), summaries.iter().map(value).collect()));
    }
    extended
}

/// The measurements as the calibration uses them: screened, and with the curves that the study adds.
pub fn screened(keys: &MeasurementKeys, read: Observations) -> Measured {
    let flagged = match &keys.screen {
        Some(options) => {
            let (threshold, leave_out) = (options.threshold.get(), options.leave_out);
            read.blocks.iter().flat_map(|data| flag(data, threshold, leave_out)).collect()
        }
        None => Vec::new(),
    };
    let used = read.map(|data| without(data, &flagged));
    let added = &keys.added_curves;
    let likelihood = used.map(|data| with_added_curves(data, added));
    Measured { read, used, likelihood, flagged }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Axis, Layout, Unit};
    use lacuna::math::random::{Stream, normal};

    /// Twelve sine curves with 5 % gain jitter and noise; the curve `faulty` is white noise.
    fn data(faulty: Option<usize>) -> Measurements {
        let unit = |text: &str| Unit::parse(text).unwrap();
        let grid: Vec<f64> = (0..50).map(f64::from).collect();
        let layout = Layout {
            name: "y".into(),
            unit: unit("1"),
            axes: vec![Axis::labels("sensor", ["A", "B"]), Axis::grid("time", grid, unit("s"))],
        };
        let curve = |r: usize| {
            let mut rng = Stream::root(5).at(r as u64).generator();
            let gain = 1.0 + 0.05 * normal(&mut rng);
            let value = |t: usize, rng: &mut _| {
                let noise = normal(rng);
                let signal = gain * (0.3 * t as f64).sin() + 0.02 * noise;
                Some(if faulty == Some(r) && t < 50 { 0.7 * noise } else { signal })
            };
            (0..100).map(|i| value(i, &mut rng)).collect()
        };
        let replicates = (0..12).map(|r| Replicate::new(format!("p{r}"), curve(r))).collect();
        Measurements::new(layout, replicates)
    }

    #[test]
    fn a_curve_of_white_noise_is_flagged_in_its_group_only() {
        let flagged = flag(&data(Some(4)), 10.0, true);
        assert_eq!(flagged.len(), 1);
        assert_eq!((flagged[0].replicate.as_str(), flagged[0].group.as_str()), ("p4", "A"));
        let kept = without(&data(Some(4)), &flagged);
        assert_eq!(kept.count(), 12 * 100 - 50);
    }

    #[test]
    fn sound_curves_are_not_flagged() {
        assert_eq!(flag(&data(None), 10.0, true), []);
    }

    #[test]
    fn added_curves_are_the_mean_and_the_ends_of_the_interval() {
        let data = data(None);
        let all = [AddedCurve::Mean, AddedCurve::Q025, AddedCurve::Q975];
        let extended = with_added_curves(&data, &all);
        assert_eq!(extended.count(), data.count() + 300);
        let summary = data.summaries()[7];
        let upper = extended.replicates[14].values[7].unwrap();
        assert!((upper - summary.mean - Z975 * summary.sd().unwrap()).abs() < 1e-15);
    }
}
