//! Detection of runs outside the declared design.

use lacuna::data::{Ensemble, Parameter, Scenario};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::study::Study;
use crate::study::file::OutsideDesign;

/// A parameter value of a run outside its design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// Row of the run.
    pub run: usize,
    /// Column of the parameter.
    pub parameter: usize,
    /// Value of the parameter.
    pub value: f64,
}

/// Tail probability of an unbounded distribution in which no design places a run: six standard deviations of a normal
/// one.
const TAIL: f64 = 1e-9;

/// The parameter values outside the declared design, run by run.
///
/// A table is written with a limited number of digits: a value counts as outside if it is beyond the bound by more than
/// half a unit of the column's last digit, or by 1e-9 of the design's width.
pub fn runs(parameters: &[Parameter], ensemble: &Ensemble) -> Vec<Outside> {
    among(parameters, &ensemble.points)
}

fn among(parameters: &[Parameter], points: &Matrix) -> Vec<Outside> {
    let bounds: Vec<(f64, f64)> = parameters
        .iter()
        .enumerate()
        .map(|(j, parameter)| {
            let (low, high) = limits(parameter);
            // Slightly more than half, because decimal numbers are rounded in memory.
            let last = 0.500_001 * last_digit(&points.column(j));
            let width = if (high - low).is_finite() { 1e-9 * (high - low) } else { 0.0 };
            let slack = last.max(width);
            (low - slack, high + slack)
        })
        .collect();
    let points = points.iter_rows().enumerate();
    let of_run = |(run, point): (usize, &[f64])| {
        let outside = |(parameter, (&value, &(low, high))): (usize, (&f64, &(f64, f64)))| {
            (value < low || value > high).then_some(Outside { run, parameter, value })
        };
        point.iter().zip(&bounds).enumerate().filter_map(outside).collect::<Vec<_>>()
    };
    points.flat_map(of_run).collect()
}

/// Limits of the runs of a design: its support, cut at the tails that a design can reach.
fn limits(parameter: &Parameter) -> (f64, f64) {
    let (low, high) = parameter.design.support();
    let low = if low.is_finite() { low } else { parameter.design.quantile(TAIL) };
    let high = if high.is_finite() { high } else { parameter.design.quantile(1.0 - TAIL) };
    (low, high)
}

/// Value of the last decimal place that any of these numbers has: 0.01 for 1.5, 2 and 1.25.
///
/// The shortest text that reads back as a number is the one it was written with, except for trailing zeros.
fn last_digit(values: &[f64]) -> f64 {
    let place = |x: &f64| {
        let text = format!("{x:e}");
        let (mantissa, exponent) = text.split_once('e')?;
        let digits = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        Some(exponent.parse::<i32>().ok()? - digits as i32)
    };
    let finite = values.iter().filter(|x| x.is_finite() && **x != 0.0);
    finite.filter_map(place).min().map_or(0.0, |place| 10_f64.powi(place))
}

/// Returns an error for runs outside the declared design, unless the study permits them.
pub(in crate::stage) fn refuse(study: &Study, ensemble: &Ensemble) -> Result<(), Stop> {
    refuse_points(study, &ensemble.points, &ensemble.runs)
}

/// Like [`refuse`], for the points of runs of these names.
pub(in crate::stage) fn refuse_points(
    study: &Study,
    points: &Matrix,
    runs: &[String],
) -> Result<(), Stop> {
    let keys = study.simulations.as_ref().map(|section| section.common.outside_design);
    if keys == Some(OutsideDesign::Allow) {
        return Ok(());
    }
    let outside = among(&study.parameters, points);
    let Some(first) = outside.first() else { return Ok(()) };
    let mut rows: Vec<usize> = outside.iter().map(|o| o.run).collect();
    rows.dedup();
    let (count, of) = (rows.len(), runs.len());
    let parameter = &study.parameters[first.parameter];
    let (low, high) = limits(parameter);
    let (name, run, value) = (&parameter.name, &runs[first.run], first.value);
    let place = place(study, run, value).map_or_else(String::new, |place| format!(" ({place})"));
    let value = if value.abs() < 1e16 { value.to_string() } else { format!("{value:e}") };
    let are = if count == 1 { "lies" } else { "lie" };
    let message = format!(
        "{count} of {of} runs {are} outside the declared design; the first is run `{run}`{place}: `{name}` is \
         {value}, and its design reaches from {low} to {high}"
    );
    let help = if study.simulations.is_some() {
        "correct the table or the `design` of the parameter; `outside_design = \"allow\"` in `[simulations]` uses \
         such runs all the same"
    } else {
        "correct the runs or the `design` of the parameter"
    };
    Err(Stop::new(message).help(help))
}

/// File and line of a run in the tables of the study's reader: the first line that begins with its name and contains
/// the value.
fn place(study: &Study, run: &str, value: f64) -> Option<String> {
    let reader = &study.simulations.as_ref()?.built.plugin;
    let labels: Vec<Option<&str>> = study.scenarios.iter().map(Scenario::label).collect();
    let files = labels.iter().flat_map(|label| reader.files(&study.directory, *label));
    for file in files {
        let Ok(text) = std::fs::read_to_string(&file) else { continue };
        let is_it = |line: &str| {
            let mut cells = line.split([',', ';', '\t', ' ']).map(str::trim);
            let name = cells.next().unwrap_or_default().trim_matches('"');
            name == run && cells.any(|cell| cell.parse() == Ok(value))
        };
        if let Some(line) = text.lines().position(is_it) {
            let name = file.strip_prefix(&study.directory).unwrap_or(&file);
            return Some(format!("{}, line {}", name.display(), line + 1));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::{Layout, Unit};
    use lacuna::math::distribution::Distribution;

    fn of(design: Distribution, values: &[f64]) -> Vec<f64> {
        let parameter = Parameter {
            name: "x".into(),
            symbol: String::new(),
            unit: Unit::dimensionless(),
            prior: design.clone(),
            design,
            reference: None,
        };
        let ensemble = Ensemble {
            parameters: vec!["x".into()],
            units: vec![Unit::dimensionless()],
            runs: (0..values.len()).map(|i| i.to_string()).collect(),
            points: Matrix::from_vec(values.len(), 1, values.to_vec()),
            layouts: Layout::number("y").into(),
            responses: Matrix::zeros(values.len(), 1),
            valid: vec![true; values.len()],
            failed: Vec::new(),
        };
        runs(&[parameter], &ensemble).iter().map(|outside| outside.value).collect()
    }

    #[test]
    fn runs_beyond_a_bound_are_outside_and_the_last_digit_is_forgiven() {
        let design = Distribution::Uniform([1.9, 2.9]);
        assert_eq!(of(design.clone(), &[1.5, 1.93, 2.5]), [1.5]);
        assert_eq!(of(design, &[1.9, 2.87, 19.3]), [19.3]);
        // 1.895 was rounded up and down to two digits; 1.88 was not.
        let narrow = Distribution::Uniform([1.895, 2.0]);
        assert_eq!(of(narrow.clone(), &[1.89, 1.95]), [0.0; 0]);
        assert_eq!(of(narrow, &[1.88, 1.95]), [1.88]);
    }

    #[test]
    fn unbounded_laws_have_their_tails_and_half_bounded_ones_their_bound() {
        let normal = Distribution::Normal([10.0, 1.0]);
        assert_eq!(of(normal.clone(), &[6.5, 10.25, 14.5]), [0.0; 0]);
        assert_eq!(of(normal, &[10.25, 103.5]), [103.5]);
    }

    #[test]
    fn the_last_digit_is_that_of_the_finest_number() {
        assert!((last_digit(&[1.5, 2.0, 1.25]) - 0.01).abs() < 1e-15);
        assert!((last_digit(&[100.0, 250.0]) - 10.0).abs() < 1e-12);
        assert_eq!(last_digit(&[0.0]), 0.0);
    }
}
