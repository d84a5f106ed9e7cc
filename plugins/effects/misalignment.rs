//! `misalignment`: a sensor that points another way.

use std::collections::BTreeMap;

use lacuna::data::{Layout, Unit};
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Reach, Situation};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::common::{Along, Measure, Row, Unknown, check, parameters, propose, signs};

/// Misalignment: a strain gauge is turned by an angle from the direction that the model assumes.
///
/// It then shows a part of the strain across its direction and of the shear:
///
/// ```text
/// y → cos² angle · y + sin² angle · y across + sin angle · cos angle · shear
/// ```
///
/// `other` says which sensor shows the strain at the same place across the direction, and `shear` which shows the
/// shear (as an angle, twice the tensor's component), where there is any. Without shear both signs of the angle are
/// alike and small angles cannot be seen: the change is of second order.
///
/// It is easily confused with `gain` where both strains have one shape, and with `crosstalk`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Misalignment {
    /// Prior of the angle, in degrees. By default 3 degrees about zero, as gauges are laid by hand.
    pub angle: Distribution,
    /// For each sensor that may be turned the sensor that shows the strain across, such as `{ R = "V" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub other: BTreeMap<String, String>,
    /// For each sensor that may be turned the sensor that shows the shear; none where left out.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shear: BTreeMap<String, String>,
    /// The axis of the sensors.
    pub axis: String,
}

impl Default for Misalignment {
    fn default() -> Self {
        Self {
            angle: Distribution::TruncatedNormal([0.0, 3.0, -45.0, 45.0]),
            other: BTreeMap::new(),
            shear: BTreeMap::new(),
            axis: "sensor".to_owned(),
        }
    }
}

impl Misalignment {
    fn unknowns(&self) -> [Unknown<'_>; 1] {
        [Unknown {
            name: "angle",
            symbol: "α",
            measure: Measure::In(Unit::parse("deg").unwrap_or_default()),
            prior: Some(&self.angle),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
            example: "{ normal = [0, 3] }",
        }]
    }

    /// The axis, and what each place of it shows with these weights of its own strain, that across and the shear.
    fn rows<'a>(
        &self,
        layout: &'a Layout,
        [own, across, sheared]: [f64; 3],
    ) -> Option<(Along<'a>, Vec<Option<Row>>)> {
        let along = Along::new(layout, &self.axis)?;
        let mut rows = vec![None; along.axis.len()];
        for (label, other) in &self.other {
            let places = (along.axis.position(label), along.axis.position(other));
            let (Some(place), Some(other)) = places else { continue };
            let shear = self.shear.get(label).and_then(|label| along.axis.position(label));
            let shear = shear.map_or((place, 0.0), |shear| (shear, sheared));
            rows[place] = Some([(place, own), (other, across), shear]);
        }
        Some((along, rows))
    }
}

impl Component for Misalignment {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check(&self.unknowns(), context.layout, complaints);
        let Some(along) = Along::check(context.layout, &self.axis, complaints) else { return };
        if self.other.is_empty() {
            complaints.at("other").say("missing key `other`").expected(
                "which sensor shows the strain across which, such as `other = { R = \"V\" }`",
            );
        }
        for (key, table) in [("other", &self.other), ("shear", &self.shear)] {
            for (label, of) in table {
                let path = format!("{key}.{label}");
                along.check_label(&path, label, complaints);
                along.check_label(&path, of, complaints);
            }
        }
        for label in self.shear.keys().filter(|label| !self.other.contains_key(*label)) {
            complaints
                .at(&format!("shear.{label}"))
                .say(format!("`{label}` has a shear and no strain across"))
                .help(format!("say in `other` which sensor is across `{label}`"));
        }
    }
}

impl Effect for Misalignment {
    fn describe(&self) -> Description {
        Description {
            title: "misalignment: a sensor that points another way".into(),
            formula: "cos² angle · y + sin² angle · y across + sin angle · cos angle · shear".into(),
            source: "standard: transformation of strain, as in Timoshenko and Goodier, Theory of Elasticity"
                .into(),
        }
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        parameters(&self.unknowns(), layout)
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        vec![0.0]
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let (sin, cos) = values[0].to_radians().sin_cos();
        let rows = self.rows(layout, [cos * cos, sin * sin, sin * cos]);
        rows.map_or_else(|| response.to_vec(), |(along, rows)| along.combine(response, &rows))
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let (sin, cos) = (2.0 * values[0].to_radians()).sin_cos();
        let slopes = [-sin, sin, cos].map(f64::to_radians);
        let slopes = self.rows(layout, slopes);
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
        signs(Some(&self.angle), 0.0).into_iter().map(|angle| vec![angle]).collect()
    }

    /// None for sensors of which nothing is known: which are at one place, no data say.
    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        let known = |layout: &Layout| self.rows(layout, [1.0, 0.0, 0.0]).map(|(_, rows)| rows);
        let mut blocks = situation.layouts.blocks.iter().filter_map(known);
        if !blocks.any(|rows| rows.iter().any(Option::is_some)) {
            return Vec::new();
        }
        let text = |(label, of): (&String, &String)| (label.clone(), Value::String(of.clone()));
        let mut table = propose(&[("angle", self.angle.clone())]);
        table.insert("axis".into(), Value::String(self.axis.clone()));
        for (key, labels) in [("other", &self.other), ("shear", &self.shear)] {
            table.insert(key.into(), Value::Table(labels.iter().map(text).collect()));
        }
        vec![table]
    }

    fn reach(&self) -> Reach {
        Reach::Single
    }
}

lacuna::register!(Effect, "misalignment", Misalignment);

#[cfg(test)]
mod tests {
    use super::super::common::testing::effect;

    use lacuna::data::{Axis, Layout, Unit};

    /// One number for each of four places.
    fn layout() -> Layout {
        let axes = vec![Axis::labels("sensor", ["A", "B", "C", "D"])];
        Layout { name: "y".into(), unit: Unit::dimensionless(), axes }
    }

    /// At 45 degrees a gauge shows the mean of both strains and half the shear (Mohr's circle).
    #[test]
    fn at_45_degrees_it_shows_the_mean_and_half_the_shear() {
        let options = "other = { A = \"B\", B = \"A\" }\nshear = { A = \"C\" }";
        let turned = effect("misalignment", options);
        let found = turned.apply(&layout(), &[3.0, 1.0, 0.5, 9.0], &[45.0]);
        let exact = [2.25, 2.0, 0.5, 9.0];
        assert!(found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
    }
}
