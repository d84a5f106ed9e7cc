//! `level_jumps`: a level that jumps and stays.

use lacuna::data::Layout;
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{
    Measure, Span, Unknown, added, added_slopes, all, apart, check, grid, parameters, propose,
    signs,
};

/// A jump of the level: from some time on a curve is higher or lower by a number.
///
/// An interferometer loses count of its fringes, a gauge comes loose, an amplifier changes its range. Several jumps
/// are several effects.
///
/// ```text
/// y → y + size from time on
/// ```
///
/// A jump between two points of the grid is seen at the second; the step between them is rounded off over their
/// distance, so that the time has a slope for those who search along it. The time is known no better than the grid.
///
/// It is easily confused with `offset` near the first time and `secondary_pulse` near the last. Jumps of an
/// interferometer are whole multiples of one size.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LevelJumps {
    /// Prior of the height, in the unit of the response, of either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Distribution>,
    /// Prior of the time, in the unit of the last axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
}

impl LevelJumps {
    fn unknowns(&self) -> [Unknown<'_>; 2] {
        [
            Unknown {
                name: "size",
                symbol: "b",
                measure: Measure::Response,
                prior: self.size.as_ref(),
                limits: (f64::NEG_INFINITY, f64::INFINITY),
                example: "{ normal = [0, 1e-4] }",
            },
            Unknown {
                name: "time",
                symbol: "t1",
                measure: Measure::Axis,
                prior: self.time.as_ref(),
                limits: (f64::NEG_INFINITY, f64::INFINITY),
                example: "{ uniform = [1e-5, 1e-3] }",
            },
        ]
    }
}

/// How far a jump has been passed at a point of the grid, from 0 to 1, and the length over which that happens: the
/// distance to the point on the other side of the jump.
fn passed(at: &[f64], i: usize, time: f64) -> (f64, f64) {
    let since = at[i] - time;
    let before = if i > 0 { Some(at[i] - at[i - 1]) } else { None };
    let after = at.get(i + 1).map(|next| next - at[i]);
    let width = if since > 0.0 { before.or(after) } else { after.or(before) };
    let width = width.unwrap_or(1.0);
    ((since / width + 0.5).clamp(0.0, 1.0), width)
}

impl Component for LevelJumps {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        Span::check(context.layout, complaints);
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for LevelJumps {
    fn describe(&self) -> Description {
        Description {
            title: "a jump: a level that jumps and stays".into(),
            formula: "y + size from time on".into(),
            source: "standard: fringe-count error of an interferometer".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        let mut values: Vec<f64> = self.parameters(layout).iter().map(|own| own.start).collect();
        values[0] = 0.0;
        values
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        added(layout, response, values[0], |i| {
            let x = passed(at, i, values[1]).0;
            x * x * (3.0 - 2.0 * x)
        })
    }

    fn by_parameters(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, 2, |i, row| {
            let (x, width) = passed(at, i, values[1]);
            row[0] = x * x * (3.0 - 2.0 * x);
            row[1] = -values[0] * 6.0 * x * (1.0 - x) / width;
        })
    }

    fn push_forward(&self, _: &Layout, _: &[f64], _: &[f64], tangent: &[f64]) -> Vec<f64> {
        tangent.to_vec()
    }

    fn starts(&self, layout: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let Some(span) = Span::of(layout) else { return Vec::new() };
        let times = apart(self.time.as_ref(), (span.first, span.last), span.step, 95);
        all(&[signs(self.size.as_ref(), 0.0), times])
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let Some(span) = Span::of_all(situation) else { return Vec::new() };
        vec![propose(&[
            ("size", Distribution::Normal([0.0, 0.2 * situation.scale()])),
            ("time", Distribution::Uniform([span.first, span.last])),
        ])]
    }
}

lacuna::register!(Effect, "level_jumps", LevelJumps);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even};

    #[test]
    fn a_jump_in_the_middle_of_a_step_is_sharp() {
        let options = "size = { normal = [0, 1] }\ntime = { uniform = [0, 9] }";
        let jump = effect("level_jumps", options);
        let uneven = vec![0.0, 1.0, 3.0, 3.5, 4.0];
        let found = jump.apply(&curve(uneven), &[1.0; 5], &[0.5, 2.0]);
        assert_eq!(found, [1.0, 1.0, 1.5, 1.5, 1.5]);
        let found = jump.apply(&curve(even(4, 1.0)), &[0.0; 4], &[2.0, 2.0]);
        assert_eq!(found, [0.0, 0.0, 1.0, 2.0]);
    }
}
