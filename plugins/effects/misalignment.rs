//! `misalignment`: a rotated sensor.

use std::collections::BTreeMap;

use lacuna::data::{Layout, Unit};
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

/// Misalignment: a strain gauge is rotated by an angle from the direction that the model assumes.
///
/// It then also measures a part of the transverse strain and of the shear strain:
///
/// ```text
/// y → cos² angle · y + sin² angle · y across + sin angle · cos angle · shear
/// ```
///
/// `other` names the sensor that measures the transverse strain at the same place, and `shear` the sensor that measures
/// the shear strain there, if any (engineering shear strain, twice the tensor component). Without shear strain both
/// signs of the angle are equivalent and small angles cannot be detected: the change is of second order.
///
/// It is easily confused with `gain` if both strains have the same time history, and with `crosstalk`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Misalignment {
    /// Prior of the angle, in degrees. Default: mean 0 and standard deviation 3 degrees, typical of gauges applied by
    /// hand.
    pub angle: Distribution,
    /// Sensor that measures the transverse strain, for each sensor that may be rotated, such as `{ R = "V" }`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub other: BTreeMap<String, String>,
    /// Sensor that measures the shear strain, for each sensor that may be rotated. Default: no shear strain.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shear: BTreeMap<String, String>,
    /// Name of the axis of the sensors.
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

impl CurveEffect for Misalignment {
    const FORM: Form = Form::Linear;

    fn describe(&self) -> Description {
        Description::new(
            "misalignment: a sensor that points another way",
            "cos² angle · y + sin² angle · y across + sin angle · cos angle · shear",
            "standard: transformation of strain, as in Timoshenko and Goodier, Theory of Elasticity",
        )
    }

    fn unknowns(&self) -> Vec<Unknown<'_>> {
        vec![Unknown::new(
            "angle",
            "α",
            Measure::In(Unit::parse("deg").unwrap_or_default()),
            &self.angle,
            "{ normal = [0, 3] }",
        )]
    }

    fn formula(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let (sin, cos) = values[0].to_radians().sin_cos();
        let rows = self.rows(layout, [cos * cos, sin * sin, sin * cos]);
        rows.map_or_else(|| response.to_vec(), |(along, rows)| along.combine(response, &rows))
    }

    fn slopes(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let (sin, cos) = (2.0 * values[0].to_radians()).sin_cos();
        let slopes = [-sin, sin, cos].map(f64::to_radians);
        let slopes = self.rows(layout, slopes);
        let slopes = slopes.map(|(along, rows)| along.combine_slopes(response, &rows));
        let slopes = slopes.unwrap_or_else(|| vec![0.0; response.len()]);
        Matrix::from_vec(response.len(), 1, slopes)
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

    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
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
