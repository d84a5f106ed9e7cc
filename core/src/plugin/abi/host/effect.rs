//! Effects of libraries.

use std::sync::Arc;

use serde_json::{Map, Value as Json};
use toml::Table;

use super::Plugin;
use super::object::{finite_only, shaped};
use super::plugin::{optional, unknowns};
use crate::data::Layout;
use crate::linalg::Matrix;
use crate::plugin::Hyperparameter;
use crate::plugin::abi::table::{EffectFunctions, Numbers, Text};
use crate::plugin::abi::wire::{EffectAbout, OwnedSituation, table_of_json};
use crate::plugin::abi::{Memo, Refusal};
use crate::plugin::effect::{
    Description, Effect, Reach, Situation, by_parameter_steps, push_forward_step,
};

/// The layouts that were written last: the same few go with every call.
static LAYOUTS: Memo<Layout, String> = Memo::new();

fn written(layout: &Layout) -> Result<Arc<String>, Refusal> {
    LAYOUTS.get(|known| known == layout, || Ok((layout.clone(), serde_json::to_string(layout)?)))
}

impl Plugin<EffectFunctions> {
    fn about(&self) -> EffectAbout {
        let (ask, this) = (self.object.functions.describe, self.object.this);
        // SAFETY: the function belongs to the plugin.
        let reply = self.object.demand("describe", |a| optional(ask, |f| unsafe { f(this, a) }));
        self.object.or_fault(reply.and_then(|reply| reply.json()), EffectAbout::default)
    }

    fn unknowns(&self, layout: &Layout) -> Result<Vec<Hyperparameter>, Refusal> {
        let (ask, this, text) =
            (self.object.functions.parameters, self.object.this, written(layout)?);
        // SAFETY: the function belongs to the plugin, and the text is there until it returns.
        let call = |a| optional(ask, |f| unsafe { f(this, Text::of(&text), a) });
        unknowns(self.object.demand("parameters", call)?)
    }

    fn nothing(&self, layout: &Layout) -> Result<Vec<f64>, Refusal> {
        let (ask, this, text) = (self.object.functions.absent, self.object.this, written(layout)?);
        // SAFETY: as in `unknowns`.
        let call = |a| optional(ask, |f| unsafe { f(this, Text::of(&text), a) });
        let row = self.object.demand("absent", call)?.row()?;
        finite_only("absent", &row)?;
        Ok(row)
    }

    fn applied(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
    ) -> Result<Vec<f64>, Refusal> {
        let (ask, this, text) = (self.object.functions.apply, self.object.this, written(layout)?);
        let (at, given) = (Numbers::row(response), Numbers::row(values));
        self.object.numbers("apply", response.len(), |to, a| {
            // SAFETY: as in `unknowns`; the buffer is as large as the response.
            optional(ask, |f| unsafe { f(this, Text::of(&text), at, given, to, a) })
        })
    }

    fn slopes(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
    ) -> Result<Option<Matrix>, Refusal> {
        let Some(ask) = self.object.functions.by_parameters else { return Ok(None) };
        let (this, text) = (self.object.this, written(layout)?);
        let (at, given) = (Numbers::row(response), Numbers::row(values));
        let count = response.len() * values.len();
        let slopes = self.object.ask_numbers("by_parameters", count, |to, a| {
            // SAFETY: as in `unknowns`; the buffer holds `outputs x parameters` numbers.
            unsafe { ask(this, Text::of(&text), at, given, to, a) }
        })?;
        Ok(slopes.map(|slopes| Matrix::from_vec(response.len(), values.len(), slopes)))
    }

    fn pushed(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Result<Option<Vec<f64>>, Refusal> {
        let Some(ask) = self.object.functions.push_forward else { return Ok(None) };
        let (this, text) = (self.object.this, written(layout)?);
        let (at, given, along) =
            (Numbers::row(response), Numbers::row(values), Numbers::row(tangent));
        self.object.ask_numbers("push_forward", tangent.len(), |to, a| {
            // SAFETY: as in `unknowns`; the buffer is as large as the tangent.
            unsafe { ask(this, Text::of(&text), at, given, along, to, a) }
        })
    }

    fn begun(&self, layout: &Layout, situation: &Situation<'_>) -> Result<Vec<Vec<f64>>, Refusal> {
        let (ask, this, text) = (self.object.functions.starts, self.object.this, written(layout)?);
        let situation = serde_json::to_string(&OwnedSituation::from(situation))?;
        // SAFETY: as in `unknowns`.
        let call =
            |a| optional(ask, |f| unsafe { f(this, Text::of(&text), Text::of(&situation), a) });
        let [starts] = self.object.demand("starts", call)?.matrices()?;
        shaped("starts", &starts, starts.rows(), self.unknowns(layout)?.len())?;
        finite_only("starts", starts.as_slice())?;
        Ok(starts.iter_rows().map(<[f64]>::to_vec).collect())
    }

    fn proposed(&self, situation: &Situation<'_>) -> Result<Vec<Table>, Refusal> {
        let (ask, this) = (self.object.functions.proposals, self.object.this);
        let situation = serde_json::to_string(&OwnedSituation::from(situation))?;
        // SAFETY: as in `unknowns`.
        let call = |a| optional(ask, |f| unsafe { f(this, Text::of(&situation), a) });
        let Some(reply) = self.object.ask("proposals", call)? else { return Ok(Vec::new()) };
        let all: Vec<Map<String, Json>> = reply.json_if_any()?.unwrap_or_default();
        Ok(all.iter().map(table_of_json).collect())
    }
}

impl Effect for Plugin<EffectFunctions> {
    fn describe(&self) -> Description {
        self.about().description()
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        let known = || {
            let (unknowns, absent) = (self.unknowns(layout)?, self.nothing(layout)?);
            if unknowns.len() != absent.len() {
                let (all, found) = (unknowns.len(), absent.len());
                let message = format!("`absent` answers {found} values for {all} unknowns");
                return Err(Refusal::stop(message));
            }
            Ok(unknowns)
        };
        self.object.or_fault(known(), Vec::new)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        self.object.or_fault(self.nothing(layout), Vec::new)
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        self.object
            .or_fault(self.applied(layout, response, values), || vec![f64::NAN; response.len()])
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let given = self.object.or_fault(self.slopes(layout, response, values), || None);
        given.unwrap_or_else(|| by_parameter_steps(self, layout, response, values))
    }

    fn push_forward(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        let given = self.object.or_fault(self.pushed(layout, response, values, tangent), || None);
        given.unwrap_or_else(|| push_forward_step(self, layout, response, values, tangent))
    }

    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>> {
        self.object.or_fault(self.begun(layout, situation), Vec::new)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        self.object.or_fault(self.proposed(situation), Vec::new)
    }

    fn reach(&self) -> Reach {
        self.about().reach()
    }
}
