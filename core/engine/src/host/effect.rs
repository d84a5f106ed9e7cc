//! Effects of libraries.

use std::sync::Arc;

use lacuna::data::Layout;
use lacuna::plugin::Hyperparameter;
use lacuna::plugin::effect::{
    Description, Effect, Reach, Situation, by_parameter_steps, push_forward_step,
};
use lacuna_abi::check::{finite_only, shaped};
use lacuna_abi::object::{numbers, numbers_if_any};
use lacuna_abi::table::EffectFunctions;
use lacuna_abi::wire::{EffectAbout, OwnedSituation, table_of_json};
use lacuna_abi::{Memo, Refusal};
use lacuna_linalg::Matrix;
use serde_json::{Map, Value as Json};
use toml::Table;

use super::Plugin;
use super::plugin::unknowns;

/// The layouts that were written last: the same few go with every call.
static LAYOUTS: Memo<Layout, String> = Memo::new();

fn written(layout: &Layout) -> Result<Arc<String>, Refusal> {
    LAYOUTS.get(|known| known == layout, || Ok((layout.clone(), serde_json::to_string(layout)?)))
}

impl Plugin<EffectFunctions> {
    fn about(&self) -> EffectAbout {
        // SAFETY: nothing is written.
        let about = unsafe { self.object.describe() }.demand().and_then(|reply| reply.json());
        self.object.or_fault(about, EffectAbout::default)
    }

    fn unknowns(&self, layout: &Layout) -> Result<Vec<Hyperparameter>, Refusal> {
        // SAFETY: nothing is written.
        unknowns(unsafe { self.object.parameters(&*written(layout)?) }.demand()?)
    }

    fn nothing(&self, layout: &Layout) -> Result<Vec<f64>, Refusal> {
        // SAFETY: nothing is written.
        let row = unsafe { self.object.absent(&*written(layout)?) }.demand()?.row()?;
        finite_only("absent", &row)?;
        Ok(row)
    }

    fn applied(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
    ) -> Result<Vec<f64>, Refusal> {
        let layout = written(layout)?;
        // SAFETY: the buffer is as large as the response.
        numbers(response.len(), |to| unsafe { self.object.apply(&*layout, response, values, to) })
    }

    fn slopes(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
    ) -> Result<Option<Matrix>, Refusal> {
        let layout = written(layout)?;
        // SAFETY: the buffer holds `outputs x parameters` numbers.
        let call = |to| unsafe { self.object.by_parameters(&*layout, response, values, to) };
        let slopes = numbers_if_any(response.len() * values.len(), call)?;
        Ok(slopes.map(|slopes| Matrix::from_vec(response.len(), values.len(), slopes)))
    }

    fn pushed(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Result<Option<Vec<f64>>, Refusal> {
        let layout = written(layout)?;
        // SAFETY: the buffer is as large as the tangent.
        let call =
            |to| unsafe { self.object.push_forward(&*layout, response, values, tangent, to) };
        numbers_if_any(tangent.len(), call)
    }

    fn begun(&self, layout: &Layout, situation: &Situation<'_>) -> Result<Vec<Vec<f64>>, Refusal> {
        let situation = serde_json::to_string(&OwnedSituation::from(situation))?;
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.starts(&*written(layout)?, &situation) };
        let [starts] = asked.demand()?.matrices()?;
        shaped("starts", &starts, starts.rows(), self.unknowns(layout)?.len())?;
        finite_only("starts", starts.as_slice())?;
        Ok(starts.iter_rows().map(<[f64]>::to_vec).collect())
    }

    fn proposed(&self, situation: &Situation<'_>) -> Result<Vec<Table>, Refusal> {
        let situation = serde_json::to_string(&OwnedSituation::from(situation))?;
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.proposals(&situation) };
        let all: Vec<Map<String, Json>> = asked.json_if_any()?;
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
