//! `overflow`: a loss, or a stop, above a level.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, of_quantity, quantity, unit_of};

/// The range of unknown levels, relative to the root mean square of the quantity.
const RANGE: [f64; 2] = [0.2, 4.0];

/// The number of levels from which a search starts.
const STARTS: usize = 12;

/// The width of the bend at the level, relative to the root mean square of the quantity.
const WIDTH: f64 = 0.01;

/// Overflow: a loss in proportion to the excess above a level, such as that of a vessel that runs over or of a mass that
/// meets a stop.
///
/// ```text
/// rate = … - coefficient width ln(1 + exp((u - level) / width)),   coefficient ≥ 0
/// ```
///
/// This is `coefficient max(u - level, 0)` with a bend of a small `width` at the level. A large coefficient limits the
/// quantity `u` to the level. Below the level the term is absent, so that a record which does not reach it cannot show
/// the term. With `of = "-x"` the quantity is limited from below.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Overflow {
    /// Quantity `u` that is limited, as an expression, such as the deflection `"x"` in the rate of a velocity. Default:
    /// the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Level, as an expression such as `"0.3 {m}"`. Default: an unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<String>,
    /// Prior of an unknown level, in the unit of `u`. Default: uniform from 0.2 to 4 times the root mean square of `u`
    /// along the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Distribution>,
    /// Width of the bend at the level, in the unit of `u`. Default: a hundredth of the root mean square of `u` along the
    /// run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
}

impl Component for Overflow {}

impl Overflow {
    /// The level as an unknown, for a quantity of this size.
    fn unknown(&self, place: &Place<'_>, unit: &Unit, size: f64) -> Index {
        let range = || Distribution::Uniform(RANGE.map(|share| share * size));
        let prior = self.prior.clone().unwrap_or_else(range);
        let at = |k: usize| prior.quantile((k as f64 + 0.5) / STARTS as f64);
        let starts = (0..STARTS).map(at).collect();
        Index { name: format!("{}_level", place.name), unit: unit.clone(), prior, starts }
    }
}

impl Term for Overflow {
    fn describe(&self) -> Description {
        Description {
            title: "overflow: a loss, or a stop, above a level".into(),
            formula: "- coefficient * width * log(1 + exp((u - level) / width))".into(),
            source:
                "standard: piecewise linear restoring force (Shaw and Holmes, J. Sound Vib. 90 (1983) 129)"
                    .into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        // The stop of a velocity acts on a position, from either side.
        let sides = |state: &&State| {
            let below = format!("-{}", state.name);
            [of_quantity(&state.name, &state.unit), of_quantity(&below, &state.unit)]
        };
        if site.positions.is_empty() {
            return vec![Table::new()];
        }
        site.positions.iter().flat_map(sides).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let size = (place.size)(u)?;
        let width = self.width.unwrap_or(WIDTH * size);
        if !(width.is_finite() && width > 0.0 && size > 0.0) {
            return Err(format!(
                "the quantity `{u}` is {size} and the width of the bend {width}: expected numbers above 0"
            ));
        }
        let width = quantity(width, unit);
        let fixed = self.width.is_none().then(|| format!("width = {width}"));
        let (level, indices) = if let Some(level) = &self.level {
            (format!("({level})"), Vec::new())
        } else {
            let index = self.unknown(place, unit, size);
            (index.name.clone(), vec![index])
        };
        // The shape is as large as the quantity: the level itself has no value before the term is there.
        let scale = (!indices.is_empty()).then(|| format!("({u})"));
        let shape = format!("-({width}) * log_sum_exp((({u}) - {level}) / ({width}), 0)");
        Ok(Summand { shape, sign: Sign::Positive, indices, scale, fixed, ..Summand::default() })
    }
}

lacuna::register!(Term, "overflow", Overflow);
