//! Records placed on the response's axis: as sampled, interpolated or filtered, and aligned by a trigger.

use lacuna::data::{Axis, Coordinates};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::filter::LowPass;
use crate::readers::cells::grid_places;

/// How samples come to the times of the response.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Resample {
    /// Each sample lies at a time of the response; another time is an error.
    #[default]
    Exact,
    /// Linear interpolation between samples. Frequencies above half the rate of the response's times are folded into lower
    /// ones.
    Linear,
    /// Low-pass filter before the record is read at the response's times: a sinc function under a Kaiser window that
    /// passes frequencies up to 0.8 of the Nyquist frequency of the slower of the two rates, and stops those above it, both to
    /// 0.001. The filter reaches over 21 intervals of the slower rate to both sides; beyond its ends a record is continued
    /// by its point reflection. The samples and the response's times must be equally spaced.
    Filtered,
}

/// Direction of a crossing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Slope {
    /// From below the level to above it.
    #[default]
    Rising,
    /// From above the level to below it.
    Falling,
}

/// Alignment of a record by the first time at which a channel crosses a level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trigger {
    /// Dataset of the channel, with the samples of the record; `{replicate}` as in `dataset`. A stacked channel has
    /// the replicates along its first dimension.
    pub channel: String,
    /// Level, in the channel's own numbers.
    pub level: f64,
    /// Direction of the crossing.
    #[serde(default)]
    pub slope: Slope,
    /// Time that the crossing gets, in the unit of the response's axis.
    #[serde(default)]
    pub at: f64,
}

impl Trigger {
    /// Time of the first crossing, interpolated linearly between two samples.
    pub fn crossing(&self, times: &[f64], channel: &[f64]) -> Result<f64, String> {
        let sign = if self.slope == Slope::Rising { 1.0 } else { -1.0 };
        let above = |x: f64| sign * (x - self.level);
        let crossed = channel.windows(2).position(|w| above(w[0]) < 0.0 && above(w[1]) >= 0.0);
        if let Some(i) = crossed {
            let part = (self.level - channel[i]) / (channel[i + 1] - channel[i]);
            return Ok(times[i] + part * (times[i + 1] - times[i]));
        }
        let low = channel.iter().copied().fold(f64::INFINITY, f64::min);
        let high = channel.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let slope = if self.slope == Slope::Rising { "rises" } else { "falls" };
        Err(format!(
            "never {slope} through the trigger level {}: its {} samples are from {low} to {high}",
            self.level,
            channel.len()
        ))
    }
}

/// One value for each place of an axis.
pub struct Placed {
    /// Values; `None` where the sample is missing, or the record has none.
    pub values: Vec<Option<f64>>,
    /// True for each place that the record reaches.
    pub reached: Vec<bool>,
}

/// Places samples at `times` (in the unit of the axis, strictly increasing unless they are taken as they are) on an axis.
pub fn place(axis: &Axis, times: &[f64], samples: &[f64], how: Resample) -> Result<Placed, String> {
    let Coordinates::Grid { values: grid, .. } = &axis.coordinates else {
        return Err(format!("axis `{}` has labels and no numbers", axis.name));
    };
    if let Some(i) = times.iter().position(|t| !t.is_finite()) {
        return Err(format!("{} {} is {}", axis.name, i + 1, times[i]));
    }
    if how == Resample::Exact {
        return exact(axis, times, samples);
    }
    if let Some(i) = times.windows(2).position(|w| w[1] <= w[0]) {
        let (name, next) = (&axis.name, times[i + 1]);
        return Err(format!("{name} {next} follows {}: expected increasing numbers", times[i]));
    }
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return Ok(Placed { values: vec![None; grid.len()], reached: vec![false; grid.len()] });
    };
    let slack = 1e-6 * (last - first) / times.len().max(2) as f64;
    let reached: Vec<bool> =
        grid.iter().map(|t| (first - slack..=last + slack).contains(t)).collect();
    let values = match how {
        Resample::Filtered => filtered(axis, grid, times, samples)?,
        _ => grid.iter().map(|&t| linear(times, samples, t)).collect(),
    };
    let inside = |(y, reached): (Option<f64>, &bool)| y.filter(|_| *reached);
    Ok(Placed { values: values.into_iter().zip(&reached).map(inside).collect(), reached })
}

fn exact(axis: &Axis, times: &[f64], samples: &[f64]) -> Result<Placed, String> {
    let mut placed = Placed { values: vec![None; axis.len()], reached: vec![false; axis.len()] };
    for (i, place) in grid_places(axis, times, None)?.into_iter().enumerate() {
        if std::mem::replace(&mut placed.reached[place], true) {
            return Err(format!("a second sample at {} {}", axis.name, axis.text(place)));
        }
        placed.values[place] = Some(samples[i]).filter(|y| !y.is_nan());
    }
    Ok(placed)
}

fn linear(times: &[f64], samples: &[f64], t: f64) -> Option<f64> {
    let after = times.partition_point(|&x| x < t).min(times.len() - 1);
    if after == 0 || times[after] <= t {
        return Some(samples[after]).filter(|y| !y.is_nan());
    }
    let part = (t - times[after - 1]) / (times[after] - times[after - 1]);
    let y = samples[after - 1] + part * (samples[after] - samples[after - 1]);
    Some(y).filter(|y| !y.is_nan())
}

fn filtered(
    axis: &Axis,
    grid: &[f64],
    times: &[f64],
    samples: &[f64],
) -> Result<Vec<Option<f64>>, String> {
    let name = &axis.name;
    let step = spacing(times).map_err(|text| format!("the record's {name} {text}"))?;
    let spacing = spacing(grid).map_err(|text| format!("the response's {name} {text}"))?;
    let filter = LowPass::new(step, spacing);
    let needed = (filter.half / step).ceil() as usize + 2;
    if times.len() < needed {
        return Err(format!(
            "has {} samples, and the filter reaches over {needed} to each side",
            times.len()
        ));
    }
    Ok(grid.iter().map(|&t| filter.at(t, times[0], step, samples)).collect())
}

/// The interval of equally spaced numbers.
fn spacing(numbers: &[f64]) -> Result<f64, String> {
    let [first, .., last] = numbers else {
        return Err(format!("has {} numbers: a filter needs two at least", numbers.len()));
    };
    let step = (last - first) / (numbers.len() - 1) as f64;
    let off = |(n, x): (usize, &f64)| (x - (first + n as f64 * step)).abs() > 1e-3 * step;
    match numbers.iter().enumerate().position(off) {
        None => Ok(step),
        Some(n) => Err(format!(
            "is not equally spaced, as the filter needs it: {} in place of {}",
            numbers[n],
            first + n as f64 * step
        )),
    }
}
