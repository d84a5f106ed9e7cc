//! Main effects of the parameters on the emulated response, for a figure.

use lacuna::data::Parameter;
use lacuna::math::moments::{mean, quantile, sorted};
use lacuna::math::sobol;
use lacuna::plugin::Forward;
use lacuna_linalg::Matrix;

use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

/// Largest number of parameters that are varied, and of outputs that are looked at.
const MOST_PARAMETERS: usize = 40;
const MOST_OUTPUTS: usize = 20_000;

/// Number of values of a parameter, and of settings of the others at each.
const VALUES: usize = 15;
const SETTINGS: u32 = 64;

/// Main effect of a parameter where it acts most: its response averaged over the other parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct MainEffect {
    /// The parameter.
    pub parameter: Parameter,
    /// Output with the largest range of the mean.
    pub output: usize,
    /// Values of the parameter.
    pub values: Vec<f64>,
    /// Mean of the response at each value, over the design of the other parameters.
    pub mean: Vec<f64>,
    /// 5 % and 95 % quantiles of the response at each value as the other parameters vary.
    pub interval: Vec<(f64, f64)>,
}

impl MainEffect {
    /// Range of the mean.
    pub fn range(&self) -> f64 {
        range(&self.mean)
    }
}

fn range(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    high - values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The main effects over the region of the emulator, the largest first; empty without an emulator, and for so many
/// parameters or outputs that no figure could show them.
pub fn main_effects(study: &Study, problem: &InverseProblem<'_>) -> Vec<MainEffect> {
    let Some(emulator) = problem.emulator() else { return Vec::new() };
    let parameters = &study.trained().parameters;
    let fits = parameters.len() == emulator.dimension()
        && parameters.len() <= MOST_PARAMETERS
        && emulator.outputs() <= MOST_OUTPUTS;
    if fits { of(emulator, parameters, problem.region()) } else { Vec::new() }
}

fn of(
    forward: &dyn Forward,
    parameters: &[Parameter],
    region: Option<&[(f64, f64)]>,
) -> Vec<MainEffect> {
    let space = Space { parameters, region };
    let settings: Vec<Vec<f64>> =
        (1..=SETTINGS).map(|k| sobol::point(k, parameters.len())).collect();
    let mut effects: Vec<MainEffect> =
        (0..parameters.len()).filter_map(|i| effect(forward, &space, &settings, i)).collect();
    effects.sort_by(|a, b| b.range().total_cmp(&a.range()));
    effects
}

/// Design of the parameters within the region in which the emulator was fitted.
struct Space<'a> {
    parameters: &'a [Parameter],
    region: Option<&'a [(f64, f64)]>,
}

impl Space<'_> {
    /// Value of a parameter at a share of its design within the region.
    fn value(&self, parameter: usize, share: f64) -> f64 {
        let design = &self.parameters[parameter].design;
        let ends = self.region.map(|region| region[parameter]);
        let (low, high) = ends.map_or((0.0, 1.0), |(a, b)| (design.cdf(a), design.cdf(b)));
        design.quantile(low + share * (high - low))
    }
}

/// The main effect of one parameter; `None` if the emulator answers nowhere.
fn effect(
    forward: &dyn Forward,
    space: &Space<'_>,
    settings: &[Vec<f64>],
    parameter: usize,
) -> Option<MainEffect> {
    // The outermost shares leave the tails of unbounded designs out.
    let share = |k: usize| 0.02 + 0.96 * k as f64 / (VALUES - 1) as f64;
    let values: Vec<f64> = (0..VALUES).map(|k| space.value(parameter, share(k))).collect();
    let responses: Vec<Matrix> = values
        .iter()
        .map(|&value| {
            let point = |shares: &Vec<f64>| -> Vec<f64> {
                let own = shares.iter().enumerate();
                own.map(|(j, &u)| if j == parameter { value } else { space.value(j, u) }).collect()
            };
            forward.mean(&Matrix::from_rows(space.parameters.len(), settings.iter().map(point)))
        })
        .collect();
    let column = |response: &Matrix, output: usize| -> Vec<f64> {
        response.column(output).into_iter().filter(|y| y.is_finite()).collect()
    };
    let means = |output: usize| -> Vec<f64> {
        responses.iter().map(|response| mean(&column(response, output))).collect()
    };
    let known = (0..forward.outputs()).map(|output| (output, range(&means(output))));
    let (output, _) =
        known.filter(|(_, range)| range.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let interval = |response: &Matrix| {
        let sorted = sorted(&column(response, output));
        (quantile(&sorted, 0.05), quantile(&sorted, 0.95))
    };
    Some(MainEffect {
        parameter: space.parameters[parameter].clone(),
        output,
        mean: means(output),
        interval: responses.iter().map(interval).collect(),
        values,
    })
}

#[cfg(test)]
mod tests {
    use lacuna::data::Unit;
    use lacuna::math::distribution::Distribution;

    use super::*;

    /// The Ishigami function (Ishigami and Homma 1990) as the second of two outputs, and a constant.
    struct Ishigami;

    impl Forward for Ishigami {
        fn dimension(&self) -> usize {
            3
        }

        fn outputs(&self) -> usize {
            2
        }

        fn mean(&self, points: &Matrix) -> Matrix {
            let of = |x: &[f64]| {
                [1.0, x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()]
            };
            Matrix::from_rows(2, points.iter_rows().map(of))
        }

        fn jacobian(&self, _point: &[f64]) -> Matrix {
            Matrix::zeros(2, 3)
        }
    }

    fn parameters() -> Vec<Parameter> {
        let design = Distribution::Uniform([-std::f64::consts::PI, std::f64::consts::PI]);
        let one = |name: &str| Parameter {
            name: name.into(),
            symbol: name.into(),
            unit: Unit::parse("1").unwrap(),
            design: design.clone(),
            prior: design.clone(),
            reference: None,
        };
        ["x1", "x2", "x3"].map(one).to_vec()
    }

    /// The main effects of the function in closed form (Sobol' and Levitan 1999): `(1 + b pi^4 / 5) sin x1`,
    /// `a sin² x2 - a / 2` and zero, about the mean `a / 2`, with `a` = 7 and `b` = 0.1.
    #[test]
    fn main_effects_of_the_ishigami_function_are_those_in_closed_form() {
        let found = of(&Ishigami, &parameters(), None);
        let names: Vec<&str> = found.iter().map(|e| e.parameter.name.as_str()).collect();
        assert_eq!(names, ["x2", "x1", "x3"]);
        let factor = 1.0 + 0.1 * std::f64::consts::PI.powi(4) / 5.0;
        for effect in &found {
            assert_eq!(effect.output, 1);
            for (x, y) in effect.values.iter().zip(&effect.mean) {
                let truth = match effect.parameter.name.as_str() {
                    "x1" => 3.5 + factor * x.sin(),
                    "x2" => 7.0 * x.sin().powi(2),
                    _ => 3.5,
                };
                // The average over 64 points of a Sobol' sequence; the function's standard deviation is 3.7, so that
                // independent points would be off by 0.46.
                assert!((y - truth).abs() < 0.35, "{}: {x} {y} {truth}", effect.parameter.name);
            }
        }
        let third = &found[2];
        let (low, high) = third.interval[0];
        assert!(low < -3.0 && high > 10.0, "{low} {high}: x1 acts through x3 at its end");
    }

    #[test]
    fn values_stay_in_the_region_of_the_emulator() {
        let region = [(0.0, 1.0), (-1.0, 1.0), (2.0, 3.0)];
        for effect in of(&Ishigami, &parameters(), Some(&region)) {
            let place = ["x1", "x2", "x3"].iter().position(|name| effect.parameter.name == *name);
            let (low, high) = region[place.unwrap()];
            assert!(effect.values.iter().all(|v| (low..=high).contains(v)), "{:?}", effect.values);
        }
    }
}
