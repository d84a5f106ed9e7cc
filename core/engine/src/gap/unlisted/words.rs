//! Descriptions of regions of disagreement: sensors, interval, band of frequencies, and conditions.

use lacuna::data::{Layouts, Unit};
use rustdct::DctPlanner;
use serde::{Deserialize, Serialize};

use crate::gap::experiment::{Experiment, MeasuredCurve};
use crate::gap::test::Region;

/// Number of standard deviations from which an excess energy is significant.
const CLEAR: f64 = 3.0;

/// Description of a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualDescription {
    /// The first and the last place along the last axis, in its unit.
    pub span: (f64, f64),
    /// The lowest and highest frequency of its band, in periods per unit of the last axis; `None` for all.
    pub band: Option<(f64, f64)>,
    /// The strength under each condition that measures these curves.
    pub conditions: Vec<Dependence>,
    /// The description in one sentence.
    pub words: String,
}

/// A region under one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Dependence {
    /// The name of the scenario; `None` if the study has none.
    pub scenario: Option<String>,
    /// The root mean square of the whitened residual in window and band; its expectation under noise is 1.
    pub strength: f64,
    /// The energy beyond its expectation under noise, in standard deviations under noise.
    pub excess: f64,
}

/// Describes a region by the residual (`TestStatistics::residual`, one value an output).
pub fn describe(experiment: &Experiment<'_>, region: &Region, left: &[f64]) -> ResidualDescription {
    let first = &experiment.curves[region.curves[0]];
    let band = region.cell.band.map(|band| frequencies(first, band));
    let labels: Vec<_> = region.curves.iter().map(|&s| &experiment.curves[s].labels).collect();
    let strengths = experiment.conditions.iter().enumerate().filter_map(|(c, condition)| {
        let curves = condition.curves.clone().map(|s| &experiment.curves[s]);
        let same: Vec<&MeasuredCurve> =
            curves.filter(|own| labels.contains(&&own.labels)).collect();
        let (energy, freedom) = same.iter().fold((0.0, 0.0), |(energy, freedom), curve| {
            let (e, f) = energy_of(curve, region, left);
            (energy + e, freedom + f)
        });
        (freedom > 0.0).then_some((c, energy, freedom))
    });
    let conditions: Vec<(usize, Dependence)> = strengths
        .map(|(c, energy, freedom)| {
            let own = Dependence {
                scenario: experiment.conditions[c].scenario.clone(),
                strength: (energy / freedom).sqrt(),
                excess: (energy - freedom) / (2.0 * freedom).sqrt(),
            };
            (c, own)
        })
        .collect();
    let words = words(experiment, region, band, &conditions);
    let conditions = conditions.into_iter().map(|(_, own)| own).collect();
    ResidualDescription { span: region.span, band, conditions, words }
}

/// Lowest and highest frequency of cosines `begin..end` over the measured values of a curve, in periods per unit: the
/// `k`-th of `n` values has `k` half periods.
fn frequencies(curve: &MeasuredCurve, (begin, end): (usize, usize)) -> (f64, f64) {
    let n = curve.at.len();
    let step = (curve.at[n - 1] - curve.at[0]) / (n - 1).max(1) as f64;
    let of = |k: usize| k as f64 / (2.0 * n as f64 * step);
    (of(begin), of(end - 1))
}

/// The energy of a curve in the window and band of a region, and its expectation under white noise.
fn energy_of(curve: &MeasuredCurve, region: &Region, left: &[f64]) -> (f64, f64) {
    let mut values: Vec<f64> = curve.measured.iter().map(|&i| left[i]).collect();
    let mut width = 1.0;
    if let Some((begin, end)) = region.cell.band.filter(|(_, end)| *end <= values.len()) {
        let mut planner = DctPlanner::new();
        planner.plan_dct2(values.len()).process_dct2(&mut values);
        values.iter_mut().enumerate().for_each(|(k, x)| {
            if !(begin..end).contains(&k) {
                *x = 0.0;
            }
        });
        planner.plan_dct3(values.len()).process_dct3(&mut values);
        let scale = 2.0 / values.len() as f64;
        for x in &mut values {
            *x *= scale;
        }
        width = (end - begin) as f64 / values.len() as f64;
    }
    let (from, to) = region.span;
    let inside = values.iter().zip(&curve.at).filter(|(_, at)| (from..=to).contains(at));
    inside.fold((0.0, 0.0), |(energy, freedom), (x, _)| (energy + x * x, freedom + width))
}

fn words(
    experiment: &Experiment<'_>,
    region: &Region,
    band: Option<(f64, f64)>,
    conditions: &[(usize, Dependence)],
) -> String {
    let layouts: &Layouts = experiment.layouts;
    let first = &experiment.curves[region.curves[0]];
    let name = if region.curves.len() == 1 {
        format!("`{}`", first.name(layouts))
    } else {
        format!("all {} curves together", region.curves.len())
    };
    let (layout, _) = layouts.block(first.outputs.start);
    let mut text = name;
    if let Some(scenario) = &experiment.conditions[first.condition].scenario {
        text += &format!(" under `{scenario}`");
    }
    if let Some((axis, _, unit)) = layout.abscissa() {
        let whole =
            first.at.first() == Some(&region.span.0) && first.at.last() == Some(&region.span.1);
        if whole {
            text += &format!(", over the whole {axis}");
        } else {
            let (from, to) = (digits(region.span.0), digits(region.span.1));
            text += &spaced(&format!(", {axis} {from} to {to}"), unit.as_str());
        }
        if let Some((low, high)) = band {
            let (scale, name) = per(unit, high);
            let (low, high) = (digits(low * scale), digits(high * scale));
            text += &spaced(&format!(", in the band from {low} to {high}"), &name);
        }
    }
    let own = conditions.iter().find(|(c, _)| *c == first.condition);
    if let Some((_, own)) = own {
        text += &format!(": {} times the noise of the mean", digits(own.strength));
    }
    text + &dependence(first.condition, conditions)
}

/// Conditions other than `own` under which a region shows, in words.
fn dependence(own: usize, conditions: &[(usize, Dependence)]) -> String {
    let others: Vec<&Dependence> =
        conditions.iter().filter(|(c, _)| *c != own).map(|(_, other)| other).collect();
    let listed = |shows: bool| {
        let chosen = others.iter().filter(|other| (other.excess > CLEAR) == shows);
        let each = chosen.filter_map(|other| {
            let scenario = other.scenario.as_ref()?;
            let strength =
                if shows { format!(" ({})", digits(other.strength)) } else { String::new() };
            Some(format!("`{scenario}`{strength}"))
        });
        each.collect::<Vec<_>>().join(", ")
    };
    match (listed(true), listed(false)) {
        (also, none) if also.is_empty() && none.is_empty() => String::new(),
        (also, none) if none.is_empty() => format!("; also under {also}"),
        (also, none) if also.is_empty() => format!("; not under {none}"),
        (also, none) => format!("; also under {also}, not under {none}"),
    }
}

/// A number with three significant digits, with thousands written out.
fn digits(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let exponent = x.abs().log10().floor() as i32;
    if !(-4..7).contains(&exponent) {
        return format!("{x:.2e}");
    }
    let decimals = (2 - exponent).max(0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

fn spaced(text: &str, unit: &str) -> String {
    if unit.is_empty() || unit == "1" { text.to_owned() } else { format!("{text} {unit}") }
}

/// The unit of frequencies along an axis: factor from periods per unit of the axis, and name.
fn per(unit: &Unit, frequency: f64) -> (f64, String) {
    let seconds = Unit::parse("s").ok().and_then(|second| unit.factor_to(&second));
    let Some(seconds) = seconds else {
        let text = if unit.is_dimensionless() { String::new() } else { format!("per {unit}") };
        return (1.0, text);
    };
    let hertz = frequency / seconds;
    let prefixes = [(1e9, "GHz"), (1e6, "MHz"), (1e3, "kHz")];
    let (size, name) = prefixes.into_iter().find(|(size, _)| hertz >= *size).unwrap_or((1.0, "Hz"));
    (1.0 / (seconds * size), name.to_owned())
}
