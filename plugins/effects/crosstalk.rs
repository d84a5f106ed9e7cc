//! `crosstalk`: a part of another sensor's signal.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Coordinates, Layout};
use lacuna::math::distribution::Distribution;
use lacuna::matrix::Matrix;
use lacuna::plugin::effect::{
    CurveEffect, Description, Form, Measure, Reach, Situation, Unknown, propose,
};
use lacuna::plugin::{Context, Effect};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::common::{Along, Row};

/// Crosstalk: a fraction of one sensor's signal appears in the curves of others.
///
/// Typical causes: parallel cables, amplifier channels that share a supply, a gauge that is sensitive to transverse
/// strain.
///
/// ```text
/// y → y + share · y of the sensor `from`
/// ```
///
/// It acts on all other sensors, or on those of `on`; the source itself is unchanged. It is easily confused with
/// `gain`: sensors that measure nearly the same signal cannot distinguish the two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Crosstalk {
    /// Prior of the fraction, from -1 to 1. Default: mean 0 and standard deviation 0.1.
    pub share: Distribution,
    /// Sensor whose signal appears in the others: a label of `axis`.
    pub from: String,
    /// Name of the axis of the sensors.
    pub axis: String,
}

impl Default for Crosstalk {
    fn default() -> Self {
        let share = Distribution::TruncatedNormal([0.0, 0.1, -1.0, 1.0]);
        Self { share, from: String::new(), axis: "sensor".to_owned() }
    }
}

impl Crosstalk {
    /// The axis and the weights of each of its places, with the weight `own` of its own signal and `share` of the
    /// source's.
    fn rows<'a>(
        &self,
        layout: &'a Layout,
        own: f64,
        share: f64,
    ) -> Option<(Along<'a>, Vec<Option<Row>>)> {
        let along = Along::new(layout, &self.axis)?;
        let source = along.axis.position(&self.from)?;
        let row = |place: usize| {
            (place != source).then_some([(place, own), (source, share), (source, 0.0)])
        };
        Some((along, (0..along.axis.len()).map(row).collect()))
    }
}

impl CurveEffect for Crosstalk {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        let of = if self.from.is_empty() { "another sensor" } else { self.from.as_str() };
        Description::new(
            &format!("crosstalk: {of} in this curve"),
            &format!("y + share · y of {of}"),
            "standard: coupling of channels",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![
            Unknown::new(
                "share",
                "a",
                Measure::Number,
                &self.share,
                "{ truncated_normal = [0, 0.1, -1, 1] }",
            )
            .within(-1.0, 1.0),
        ]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let rows = self.rows(layout, 1.0, values[0]);
        rows.map_or_else(|| response.to_vec(), |(along, rows)| along.combine(response, &rows))
    }

    fn slopes(&self, layout: &Layout, response: &[f64], _: &[f64]) -> Matrix {
        let slopes = self.rows(layout, 0.0, 1.0);
        let slopes = slopes.map(|(along, rows)| along.combine_slopes(response, &rows));
        let slopes = slopes.unwrap_or_else(|| vec![0.0; response.len()]);
        Matrix::from_vec(response.len(), 1, slopes)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let mut found: Vec<Table> = Vec::new();
        for axis in situation.layouts.blocks.iter().flat_map(|block| &block.axes) {
            let Coordinates::Labels(labels) = &axis.coordinates else { continue };
            if axis.name == SCENARIO || labels.len() < 2 {
                continue;
            }
            for label in labels {
                let mut table = propose(&[("share", self.share.clone())]);
                table.insert("from".to_owned(), Value::String(label.clone()));
                table.insert("axis".to_owned(), Value::String(axis.name.clone()));
                if !found.contains(&table) {
                    found.push(table);
                }
            }
        }
        found
    }

    /// A displaced sensor shows, to first order, its own curve and a share of its neighbour's.
    fn looks_like(&self) -> &'static [&'static str] {
        &["misplacement"]
    }

    fn reach(&self) -> Reach {
        Reach::Single
    }

    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(along) = Along::check(context.layout, &self.axis, complaints) {
            along.check_label("from", &self.from, complaints);
        }
    }
}

lacuna::register!(Effect, "crosstalk", Crosstalk);

#[cfg(test)]
mod tests {
    use super::super::common::testing::effect;

    use lacuna::data::{Axis, Layout, Unit};

    /// One number for each of four places.
    fn layout() -> Layout {
        let axes = vec![Axis::labels("sensor", ["A", "B", "C", "D"])];
        Layout { name: "y".into(), unit: Unit::dimensionless(), axes }
    }

    #[test]
    fn the_source_is_in_all_curves_but_its_own() {
        let found =
            effect("crosstalk", "from = \"B\"").apply(&layout(), &[1.0, 10.0, 2.0, 0.0], &[0.1]);
        assert_eq!(found, [2.0, 10.0, 3.0, 1.0]);
    }
}
