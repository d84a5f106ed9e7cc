//! Effects in Python.

use lacuna::data::Layout;
use lacuna::plugin::Hyperparameter;
use lacuna::plugin::effect::{Description, Effect, Reach, Situation, all, signs};
use lacuna_abi::Refusal;
use lacuna_abi::check::{finite_only, shaped};
use lacuna_abi::wire::{EffectAbout, table_of_json};
use serde_json::{Map, Value as Json, json};
use toml::Table;

use crate::object::{Call, Plugin, answer, matrices, matrix, row, unknowns};

impl Plugin {
    fn about(&self) -> (EffectAbout, f64) {
        let asked = || {
            let message = self.0.ask(&Call::new("describe", &[]))?;
            let mut about: Map<String, Json> = answer(&message)?;
            let absent = about.remove("absent").and_then(|x| x.as_f64()).unwrap_or_default();
            Ok((serde_json::from_value(Json::Object(about))?, absent))
        };
        self.0.or_fault(asked(), Default::default)
    }

    fn own(&self, layout: &Layout) -> Result<Vec<Hyperparameter>, Refusal> {
        let known = self.0.known(&[], layout, None)?;
        let own = unknowns(&self.0.ask(&Call { known, ..Call::new("unknowns", &[]) })?)?;
        if own.is_empty() { Err(Refusal::stop("`unknowns` gives none")) } else { Ok(own) }
    }

    fn names(&self, layout: &Layout) -> Result<Vec<String>, Refusal> {
        Ok(self.own(layout)?.into_iter().map(|own| own.name).collect())
    }

    fn changed(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
    ) -> Result<Vec<f64>, Refusal> {
        let known = self.0.known(&[], layout, None)?;
        let (given, values) = (row(response), row(values));
        let message = self.0.ask(&Call { known, ..Call::new("apply", &[&given, &values]) })?;
        Ok(matrix("apply", message, 1, response.len())?.into_vec())
    }

    fn begun(&self, layout: &Layout, situation: &Situation<'_>) -> Result<Vec<Vec<f64>>, Refusal> {
        let own = self.own(layout)?;
        if !self.0.has("starts") {
            let sizes = signs(own.first().map(|size| &size.prior), self.about().1);
            let indices = own.iter().skip(1).map(|index| vec![index.start]);
            return Ok(all(&std::iter::once(sizes).chain(indices).collect::<Vec<_>>()));
        }
        let known = self.0.known(&self.names(layout)?, layout, None)?;
        let (response, noise) = (row(situation.response), row(situation.noise));
        let given = [&response, &noise];
        let call = Call { known, ..Call::new("starts", &given) };
        let [starts] = matrices(self.0.ask(&call)?)?;
        shaped("starts", &starts, starts.rows(), own.len())?;
        finite_only("starts", starts.as_slice())?;
        Ok(starts.iter_rows().map(<[f64]>::to_vec).collect())
    }

    fn proposed(&self, situation: &Situation<'_>) -> Result<Vec<Table>, Refusal> {
        if !self.0.has("proposals") {
            return Ok(vec![Table::new()]);
        }
        let layouts: Vec<&Layout> = situation.layouts.blocks.iter().collect();
        let (response, noise) = (row(situation.response), row(situation.noise));
        let given = [&response, &noise];
        let call = Call::new("proposals", &given);
        let all: Vec<Map<String, Json>> =
            answer(&self.0.ask(&call.about(json!({ "layouts": layouts })))?)?;
        Ok(all.iter().map(table_of_json).collect())
    }
}

impl Effect for Plugin {
    fn describe(&self) -> Description {
        self.about().0.description()
    }

    fn parameters(&self, layout: &Layout) -> Vec<Hyperparameter> {
        self.0.or_fault(self.own(layout), Vec::new)
    }

    fn absent(&self, layout: &Layout) -> Vec<f64> {
        let own = self.parameters(layout);
        std::iter::once(self.about().1).chain(own.iter().skip(1).map(|own| own.start)).collect()
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let changed = self.changed(layout, response, values);
        self.0.or_fault(changed, || vec![f64::NAN; response.len()])
    }

    fn starts(&self, layout: &Layout, situation: &Situation<'_>) -> Vec<Vec<f64>> {
        self.0.or_fault(self.begun(layout, situation), Vec::new)
    }

    fn proposals(&self, situation: &Situation<'_>) -> Vec<Table> {
        self.0.or_fault(self.proposed(situation), Vec::new)
    }

    fn reach(&self) -> Reach {
        self.about().0.reach()
    }
}
