//! `crosstalk`: another sensor in this one's curve.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Coordinates, Layout};
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Reach, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::common::{Along, Measure, Row, Unknown, check, parameters, propose, signs};

/// Crosstalk: a part of one sensor's signal is in the curves of others.
///
/// Cables run side by side, channels of an amplifier share a supply, a gauge feels strain across its direction.
///
/// ```text
/// y → y + share · y of the sensor `from`
/// ```
///
/// It acts on all other sensors, or on those of `on`; the source itself stays. It is easily confused with `gain`:
/// sensors that see nearly the same signal cannot tell them apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Crosstalk {
    /// Prior of the share, from -1 to 1; by default 0.1 about zero.
    pub share: Distribution,
    /// The sensor whose signal is seen: a label of `axis`.
    pub from: String,
    /// The axis of the sensors.
    pub axis: String,
}

impl Default for Crosstalk {
    fn default() -> Self {
        let share = Distribution::TruncatedNormal([0.0, 0.1, -1.0, 1.0]);
        Self { share, from: String::new(), axis: "sensor".to_owned() }
    }
}

impl Crosstalk {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "share",
            symbol: "a",
            measure: Measure::Number,
            prior: Some(&self.share),
            limits: (-1.0, 1.0),
            example: "{ truncated_normal = [0, 0.1, -1, 1] }",
        }]
    }

    /// The axis, and what each place of it shows.
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

impl Component for Crosstalk {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(along) = Along::check(context.layout, &self.axis, complaints) {
            along.check_label("from", &self.from, complaints);
        }
        check(&self.unknowns(), context.layout, complaints);
    }
}

impl Effect for Crosstalk {
    fn describe(&self) -> Description {
        let of = if self.from.is_empty() { "another sensor" } else { self.from.as_str() };
        Description {
            title: format!("crosstalk: {of} in this curve"),
            formula: format!("y + share · y of {of}"),
            source: "standard: coupling of channels".into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let rows = self.rows(layout, 1.0, values[0]);
        rows.map_or_else(|| response.to_vec(), |(along, rows)| along.combine(response, &rows))
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], _: &[f64]) -> Matrix {
        let slopes = self.rows(layout, 0.0, 1.0);
        let slopes = slopes.map(|(along, rows)| along.combine_slopes(response, &rows));
        let slopes = slopes.unwrap_or_else(|| vec![0.0; response.len()]);
        Matrix::from_vec(response.len(), 1, slopes)
    }

    fn push_forward(
        &self,
        layout: &Layout,
        _: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        self.apply(layout, tangent, values)
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        signs(Some(&self.share), 0.0).into_iter().map(|a| vec![a]).collect()
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

    fn reach(&self) -> Reach {
        Reach::Single
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
