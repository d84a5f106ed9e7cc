//! `level_jumps`: a lasting jump of the level.

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Situation, Span, Unknown, added, added_slopes, apart,
    grid, propose,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A jump of the level: a constant added to a curve from some time on.
///
/// Typical causes: an interferometer that miscounts fringes, a gauge that comes loose, an amplifier that changes its
/// range. Use one effect for each jump.
///
/// ```text
/// y → y + size from time on
/// ```
///
/// A jump between two points of the grid is seen at the second. The step between them is smoothed over their distance,
/// so that the response has a derivative with respect to the time, which gradient-based fits need. The time is
/// determined no better than to the grid spacing.
///
/// It is easily confused with `offset` near the first time and with `secondary_pulse` near the last. Jumps of an
/// interferometer are integer multiples of one size.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LevelJumps {
    /// Prior of the height of the jump, in the unit of the response; either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Distribution>,
    /// Prior of the time of the jump, in the unit of the last axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
}

/// Fraction of a jump that is completed at a point of the grid, from 0 to 1, and the width over which the jump is
/// smoothed: the distance to the point on the other side of it.
fn passed(at: &[f64], i: usize, time: f64) -> (f64, f64) {
    let since = at[i] - time;
    let before = if i > 0 { Some(at[i] - at[i - 1]) } else { None };
    let after = at.get(i + 1).map(|next| next - at[i]);
    let width = if since > 0.0 { before.or(after) } else { after.or(before) };
    let width = width.unwrap_or(1.0);
    ((since / width + 0.5).clamp(0.0, 1.0), width)
}

impl CurveEffect for LevelJumps {
    const FORM: Form = Form::Additive;

    fn describe(&self) -> Description {
        Description::new(
            "a jump: a level that jumps and stays",
            "y + size from time on",
            "standard: fringe-count error of an interferometer",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new("size", "b", Measure::Response, &self.size, "{ normal = [0, 1e-4] }"),
            Unknown::new("time", "t1", Measure::Axis, &self.time, "{ uniform = [1e-5, 1e-3] }"),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let at = grid(layout);
        added(layout, response, values[0], |i| {
            let x = passed(at, i, values[1]).0;
            x * x * (3.0 - 2.0 * x)
        })
    }

    fn slopes(&self, layout: &Layout, _: &[f64], values: &[f64]) -> Matrix {
        let at = grid(layout);
        added_slopes(layout, 2, |i, row| {
            let (x, width) = passed(at, i, values[1]);
            row[0] = x * x * (3.0 - 2.0 * x);
            row[1] = -values[0] * 6.0 * x * (1.0 - x) / width;
        })
    }

    fn indices(&self, layout: &Layout) -> Option<Vec<Vec<f64>>> {
        let span = Span::of(layout)?;
        Some(vec![apart(self.time.as_ref(), (span.first, span.last), span.step, 95)])
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
