//! Start-up transients: the first values of a record, off by far more than the record varies from value to value, such as
//! those of an instrument that has not settled. They are no physics of the record, and left out of the search.

use lacuna::data::{Measurements, Observations};
use lacuna_linalg::{Cholesky, Matrix, gram, transposed_multiply_vector};

use super::{Experiment, MeasuredCurve};
use crate::page::number::significant;

/// The largest number of values of a transient.
const MOST: usize = 3;

/// The number of following values from which a value is extrapolated by a straight line.
const FOLLOWING: usize = 4;

/// The largest number of following values of linear prediction, and the number of values of a record for each.
const ORDER: usize = 8;
const EACH: usize = 8;

/// The ridge of linear prediction, relative to the sum of the squares.
const RIDGE: f64 = 1e-9;

/// The smallest number of values of a record in which a transient is sought.
const FEWEST: usize = 20;

/// A transient is this many times as far from the extrapolation as any other value of the record is.
const BEYOND: f64 = 2.0;

/// The smallest distance from the extrapolation in standard deviations of all of them, by their median.
const FAR: f64 = 8.0;

/// The share of the distance that the response itself may have, if it is a jump of the response: twice as far from its own
/// extrapolation as elsewhere. A response that begins with a jump explains values that are off.
const RESPONSE: f64 = 0.25;

/// The median absolute value of a standard normal variable.
const MEDIAN: f64 = 0.674_489_750_196_082;

/// The first values of a curve that are off.
#[derive(Debug, Clone, PartialEq)]
pub struct Transient {
    /// The outputs.
    pub outputs: Vec<usize>,
    /// The curve in words.
    name: String,
    /// The largest distance from what the following values show, with its unit, and in standard deviations.
    off: String,
    far: f64,
}

impl Transient {
    /// The transient in words, as a reason of a verdict.
    pub fn words(&self) -> String {
        let values = match self.outputs.len() {
            1 => "first value of".to_owned(),
            count => format!("first {count} values of"),
        };
        let are = if self.outputs.len() == 1 { "is" } else { "are" };
        format!(
            "a start-up transient: the {values} {} {are} off by up to {}, {:.0} standard deviations of the neighbours, and \
             left out of the search",
            self.name, self.off, self.far
        )
    }
}

/// The transients of the records without replicates, about a response with one value per output, beside those that are
/// known, whose values the data do not have any more.
pub fn transients(
    experiment: &Experiment<'_>,
    response: &[f64],
    known: &[Transient],
) -> Vec<Transient> {
    let (_, means) = experiment.means();
    let alone = experiment.curves.iter().filter(|curve| experiment.complete(curve).len() < 2);
    let found = alone.filter_map(|curve| {
        let name = curve.name(experiment.layouts);
        let most = MOST - known.iter().find(|own| own.name == name).map_or(0, |t| t.outputs.len());
        of_curve(experiment, curve, &means, response, most)
    });
    found.collect()
}

/// Transients with further values of the same curves.
pub fn joined(mut known: Vec<Transient>, further: Vec<Transient>) -> Vec<Transient> {
    for one in further {
        match known.iter_mut().find(|own| own.name == one.name) {
            Some(own) => own.outputs.extend(one.outputs),
            None => known.push(one),
        }
    }
    known
}

/// The measurements without the values of transients.
pub fn without(data: &Observations, transients: &[Transient]) -> Observations {
    let mut begin = 0;
    let mut blocks = Vec::new();
    for block in &data.blocks {
        let is_off = |i: usize| transients.iter().any(|own| own.outputs.contains(&(begin + i)));
        let kept: Vec<_> = block.replicates.iter().map(|r| r.only(|i| !is_off(i))).collect();
        blocks.push(Measurements::with_replicates(block, kept));
        begin += block.layout.len();
    }
    Observations { blocks }
}

fn of_curve(
    experiment: &Experiment<'_>,
    curve: &MeasuredCurve,
    means: &[f64],
    response: &[f64],
    most: usize,
) -> Option<Transient> {
    if curve.measured.len() < FEWEST {
        return None;
    }
    let misfit: Vec<f64> = curve.measured.iter().map(|&i| means[i] - response[i]).collect();
    let own: Vec<f64> = curve.measured.iter().map(|&i| response[i]).collect();
    let [misfit, own] = [misfit, own].map(|values| Backward::of(values, &curve.at));
    let is_off = |k: usize, from: usize| {
        let off = misfit.away(k, from).abs();
        let [of_misfit, of_own] = [&misfit, &own].map(|b| b.elsewhere[from - k - 1]);
        let jump = (BEYOND * of_own.largest).max(RESPONSE * off);
        let far = (BEYOND * of_misfit.largest).max(FAR * of_misfit.sd);
        off > far && own.away(k, from).abs() <= jump
    };
    let count = (1..=most).rev().find(|&count| (0..count).all(|k| is_off(k, count)))?;
    let off = (0..count).map(|k| misfit.away(k, count).abs()).fold(0.0, f64::max);
    let unit = &experiment.layouts.blocks[0].unit;
    let unit = if unit.is_dimensionless() { String::new() } else { format!(" {unit}") };
    Some(Transient {
        outputs: curve.measured[..count].to_vec(),
        name: curve.name(experiment.layouts),
        off: format!("{}{unit}", significant(off, 2)),
        far: off / misfit.elsewhere[0].sd.max(f64::MIN_POSITIVE),
    })
}

/// Values along a curve with their extrapolation to the beginning: by a straight line through the values that follow, or by
/// linear prediction, which also continues oscillations (Makhoul, Proceedings of the IEEE 63 (1975) 561); the one that is
/// nearer along the rest of the curve.
struct Backward<'a> {
    values: Vec<f64>,
    at: &'a [f64],
    /// The coefficients of linear prediction from the next values; empty for the straight line.
    filter: Vec<f64>,
    /// The distances from the extrapolation along the rest of the curve, by the number of steps.
    elsewhere: [Elsewhere; MOST],
}

/// Distances of values from their extrapolation.
#[derive(Clone, Copy, Default)]
struct Elsewhere {
    largest: f64,
    /// Their standard deviation, by their median.
    sd: f64,
}

impl<'a> Backward<'a> {
    fn of(values: Vec<f64>, at: &'a [f64]) -> Self {
        let elsewhere = [Elsewhere::default(); MOST];
        let line = Self { values, at, filter: Vec::new(), elsewhere }.judged();
        let order = ORDER.min(line.values.len() / EACH);
        let Some(filter) = line.filter_of(order) else { return line };
        let other = Self { values: line.values.clone(), filter, ..line }.judged();
        if other.elsewhere[0].sd < line.elsewhere[0].sd { other } else { line }
    }

    fn judged(mut self) -> Self {
        let end = self.values.len() - self.filter.len().max(FOLLOWING) - MOST;
        self.elsewhere = std::array::from_fn(|steps| {
            let mut all: Vec<f64> =
                (MOST..end).map(|k| self.away(k, k + 1 + steps).abs()).collect();
            all.sort_by(f64::total_cmp);
            Elsewhere { largest: all[all.len() - 1], sd: all[all.len() / 2] / MEDIAN }
        });
        self
    }

    /// The coefficients of least squares along the rest of the curve.
    fn filter_of(&self, order: usize) -> Option<Vec<f64>> {
        let rest = MOST..self.values.len() - order;
        let rows = rest.clone().map(|k| self.values[k + 1..=k + order].to_vec());
        let design = Matrix::from_rows(order, rows);
        let mut normal = gram(&design);
        let ridge = RIDGE * (0..order).map(|j| normal[(j, j)]).sum::<f64>();
        (0..order).for_each(|j| normal[(j, j)] += ridge.max(f64::MIN_POSITIVE));
        let mut filter = transposed_multiply_vector(&design, &self.values[rest]);
        Cholesky::new(&normal).ok()?.solve(&mut filter);
        Some(filter)
    }

    /// The distance of a value from the extrapolation of those that begin with `from`.
    fn away(&self, k: usize, from: usize) -> f64 {
        if self.filter.is_empty() {
            return self.away_from_line(k, from);
        }
        let mut next = self.values[from..from + self.filter.len()].to_vec();
        for _ in k..from {
            let before = next.iter().zip(&self.filter).map(|(y, a)| y * a).sum();
            next.pop();
            next.insert(0, before);
        }
        self.values[k] - next[0]
    }

    /// The distance of a value from the straight line through the values that begin with `from`, by least squares.
    fn away_from_line(&self, k: usize, from: usize) -> f64 {
        let (values, at) = (&self.values, self.at);
        let used = from..(from + FOLLOWING).min(values.len());
        let count = used.len() as f64;
        let (x, y) = (
            at[used.clone()].iter().sum::<f64>() / count,
            values[used.clone()].iter().sum::<f64>() / count,
        );
        let (mut products, mut squares) = (0.0, 0.0);
        for i in used {
            products += (at[i] - x) * (values[i] - y);
            squares += (at[i] - x).powi(2);
        }
        let slope = if squares > 0.0 { products / squares } else { 0.0 };
        values[k] - y - slope * (at[k] - x)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::gap::testing::LinearModel;
    use lacuna::data::{Axis, Layout, Layouts, Replicate, Unit};
    use lacuna::math::random::{Stream, normal};

    /// A record of this misfit about a response.
    fn found(misfit: &[f64], response: &[f64]) -> Vec<Transient> {
        let times = (0..misfit.len()).map(|t| t as f64).collect();
        let grid = Axis::grid("time", times, Unit::parse("s").unwrap());
        let unit = Unit::parse("mm").unwrap();
        let layout = Layout { name: "y".into(), unit, axes: vec![grid] };
        let layouts: Layouts = layout.clone().into();
        let values = misfit.iter().zip(response).map(|(e, y)| Some(y + e)).collect();
        let data = Measurements::new(layout, vec![Replicate::new("0", values)]).into();
        let forward = LinearModel { slopes: Matrix::zeros(0, misfit.len()) };
        let experiment = Experiment::new(&layouts, &[], &forward, &data);
        transients(&experiment, response, &[])
    }

    /// Noise of first order, and of heavier tails than normal if `cubed`.
    fn noise(a: f64, length: usize, cubed: bool, b: u64) -> Vec<f64> {
        let mut rng = Stream::root(51).at(b).generator();
        let mut last = normal(&mut rng) / (1.0 - a * a).sqrt();
        let shock = |x: f64| if cubed { x * x.abs() } else { x };
        (0..length)
            .map(|_| {
                last = a * last + shock(normal(&mut rng));
                last
            })
            .collect()
    }

    /// Less than one in a thousand records of noise is taken for one with a transient: none of 4000 has a 95 % bound
    /// below that, and of three kinds each has 6000 records.
    #[test]
    fn noise_has_no_transient() {
        for (a, length, cubed) in [(0.0, 25, false), (0.9, 60, false), (0.5, 200, true)] {
            let flat = vec![0.0; length];
            let fired =
                (0..6000).filter(|&b| !found(&noise(a, length, cubed, b), &flat).is_empty());
            let count = fired.count();
            assert!(count < 6, "{count} of 6000 at {a}, {length}");
        }
    }

    #[test]
    fn the_values_that_are_off_are_counted() {
        for count in 1..=3 {
            let mut all = 0;
            for b in 0..50 {
                let mut misfit = noise(0.5, 60, false, b);
                for (k, value) in misfit.iter_mut().take(count).enumerate() {
                    *value += 400.0 / (k + 1) as f64;
                }
                // Beside a slow misfit.
                misfit.iter_mut().enumerate().for_each(|(t, y)| *y += 0.004 * (t * t) as f64);
                let found = found(&misfit, &[0.0; 60]);
                assert!(found.len() == 1, "{found:?}");
                all += usize::from(found[0].outputs == (0..count).collect::<Vec<_>>());
            }
            assert!(all >= 45, "{all} of 50 with {count}");
        }
        let words =
            found(&[&[300.0][..], &noise(0.0, 59, false, 1)].concat(), &[0.0; 60])[0].words();
        assert!(
            words.starts_with("a start-up transient: the first value of y is off by up to"),
            "{words}"
        );
        assert!(words.contains(" mm, "), "{words}");
    }

    /// A response that jumps in the same place explains the first value: a misplaced jump is physics.
    #[test]
    fn a_jump_of_the_response_is_no_transient() {
        let mut misfit = noise(0.0, 60, false, 3);
        let mut response = vec![10.0; 60];
        misfit[0] -= 100.0;
        assert_eq!(found(&misfit, &response).len(), 1);
        response[0] = 110.0;
        assert!(found(&misfit, &response).is_empty());
    }
}
