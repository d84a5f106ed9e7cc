//! `noise` of `[measurements]`: what data sheets say about the instruments.

use std::collections::BTreeMap;
use std::fmt;

use lacuna::data::{Coordinates, Layout, Unit};
use lacuna::plugin::effect::{On, acts};
use lacuna::text::quantity::Quantity;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// Noise of an instrument as its data sheet states it. What is left out is estimated from the data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseSection {
    /// Curves of the instrument: labels by axis, such as `{ sensor = ["B"] }`. Default: all curves.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
    /// Standard deviation of a single value, in the unit of the response or with a unit of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sd: Option<Quantity>,
    /// Resolution: the distance between neighbouring readings, to which the values are rounded, in the unit of the
    /// response or with a unit of its own. Its error is uniform, of standard deviation `resolution / sqrt(12)`, and is
    /// added to that of `sd`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resolution: Option<Quantity>,
    /// Memory: the distance along the last axis over which the correlation of the noise falls to 1/e, in the unit of
    /// the axis or with a unit of its own; 0 for independent values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<Quantity>,
}

/// Noise of all instruments; where several act on a curve, the keys of the last one hold.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InstrumentNoise(pub Vec<NoiseSection>);

/// Noise of one output as it is stated.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OutputNoise {
    /// Standard deviation, in the unit of the response.
    pub sd: Option<f64>,
    /// Correlation time along the last axis, in its unit; zero for independent values.
    pub memory: Option<f64>,
}

impl NoiseSection {
    /// Standard deviation of noise and rounding together, in a unit; `None` if neither is stated.
    fn size(&self, unit: &Unit) -> Option<f64> {
        let of = |quantity: &Option<Quantity>| quantity.as_ref().and_then(|q| q.in_unit(unit));
        match (of(&self.sd), of(&self.resolution)) {
            (None, None) => None,
            (sd, step) => Some(sd.unwrap_or(0.0).hypot(step.unwrap_or(0.0) / 12.0_f64.sqrt())),
        }
    }
}

impl InstrumentNoise {
    /// Noise of each output of a block.
    pub fn of(&self, layout: &Layout) -> Vec<OutputNoise> {
        let mut all = vec![OutputNoise::default(); layout.len()];
        for section in &self.0 {
            let size = section.size(&layout.unit);
            let axis = axis_unit(layout);
            let memory = section.memory.as_ref().zip(axis).and_then(|(m, unit)| m.in_unit(unit));
            for (own, _) in all.iter_mut().zip(acts(layout, &section.on)).filter(|(_, on)| *on) {
                own.sd = size.or(own.sd);
                own.memory = memory.or(own.memory);
            }
        }
        all
    }
}

/// Unit of the last axis; `None` if it has labels.
pub(super) fn axis_unit(layout: &Layout) -> Option<&Unit> {
    match &layout.axes.last()?.coordinates {
        Coordinates::Grid { unit, .. } => Some(unit),
        Coordinates::Labels(_) => None,
    }
}

impl Serialize for InstrumentNoise {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [one] => one.serialize(serializer),
            several => several.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for InstrumentNoise {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrSeveral;
        impl<'de> Visitor<'de> for OneOrSeveral {
            type Value = InstrumentNoise;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table such as `{ sd = 0.01 }`, or an array of such tables")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<InstrumentNoise, A::Error> {
                let one = NoiseSection::deserialize(MapAccessDeserializer::new(map))?;
                Ok(InstrumentNoise(vec![one]))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<InstrumentNoise, A::Error> {
                let several = Vec::deserialize(SeqAccessDeserializer::new(seq))?;
                if several.is_empty() {
                    return Err(de::Error::invalid_length(0, &"at least one table"));
                }
                Ok(InstrumentNoise(several))
            }
        }
        deserializer.deserialize_any(OneOrSeveral)
    }
}

impl JsonSchema for InstrumentNoise {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "InstrumentNoise".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<NoiseSection>();
        json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::data::Axis;

    #[test]
    fn the_last_statement_about_a_curve_holds_key_by_key() {
        let unit = |text: &str| Unit::parse(text).unwrap();
        let axes = vec![
            Axis::labels("sensor", ["A", "B"]),
            Axis::grid("time", vec![0.0, 1.0], unit("ms")),
        ];
        let layout = Layout { name: "y".into(), unit: unit("mm"), axes };
        let stated: InstrumentNoise = toml::from_str::<BTreeMap<String, InstrumentNoise>>(
            "noise = [{ sd = { value = 3e-3, unit = \"m\" }, memory = { value = 2e-3, unit = \"s\" } },\n\
             { on = { sensor = [\"B\"] }, sd = 4, resolution = 6 }]",
        )
        .unwrap()
        .remove("noise")
        .unwrap();
        let all = stated.of(&layout);
        // 6 / sqrt(12) is sqrt(3): with 4 the sd is sqrt(19).
        for (own, sd) in all.iter().zip([3.0, 3.0, 19.0_f64.sqrt(), 19.0_f64.sqrt()]) {
            assert!((own.sd.unwrap() - sd).abs() < 1e-12, "{own:?}");
            assert!((own.memory.unwrap() - 2.0).abs() < 1e-12, "{own:?}");
        }
        let written = toml::to_string(&BTreeMap::from([("noise", &stated)])).unwrap();
        let again: BTreeMap<String, InstrumentNoise> = toml::from_str(&written).unwrap();
        assert_eq!(again["noise"], stated);
    }
}
