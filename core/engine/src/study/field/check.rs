//! Fields against the model that takes them.

use std::collections::BTreeSet;

use lacuna::data::Field;
use lacuna::plugin::model::Signature;
use lacuna::text::Complaints;

use crate::study::Study;

/// Names of the fields that expressions of `[model] computed` call.
fn called_in_expressions(study: &Study) -> BTreeSet<String> {
    let functions = study.scenarios.iter().flat_map(|scenario| &scenario.functions);
    let fields = study.fields.iter().map(|field| field.name.as_str());
    let tables: Vec<&str> = functions.map(|f| f.name.as_str()).chain(fields).collect();
    let texts = study.model.iter().flat_map(|model| model.common.computed.values());
    let called =
        texts.flat_map(|text| lacuna::expression::called(text, &tables).unwrap_or_default());
    called.filter(|name| study.fields.iter().any(|field| field.name == *name)).collect()
}

impl Study {
    /// True if the model evaluates fields itself, by their coefficients.
    pub(in crate::study) fn model_takes_fields(&self) -> bool {
        self.model.as_ref().is_some_and(|model| model.built.plugin.takes_fields())
    }

    /// Fields whose values at the places are inputs of the model.
    pub(in crate::study) fn fields_by_place(&self) -> Vec<&Field> {
        if self.model_takes_fields() {
            return Vec::new();
        }
        let called = called_in_expressions(self);
        let all = self.fields.iter().map(AsRef::as_ref);
        all.filter(|field| !called.contains(&field.name)).collect()
    }
}

/// Reports fields that the model does not use, or takes in another unit; `set` gets the names of the inputs that they set.
pub(in crate::study) fn check(
    study: &Study,
    signature: &Signature,
    set: &mut BTreeSet<String>,
    complaints: &mut Complaints<'_>,
) {
    let called = called_in_expressions(study);
    for field in &study.fields {
        let path = format!("field.{}", field.name);
        let by_place = !study.model_takes_fields();
        let names = if by_place { field.inputs() } else { field.coefficients() };
        let input = |name: &String| signature.inputs.iter().find(|input| input.name == *name);
        let found: Vec<_> = names.iter().filter_map(input).collect();
        if found.is_empty() && !called.contains(&field.name) {
            let (name, axis) = (&field.name, &field.axis);
            let problem = complaints
                .at(&format!("{path}.name"))
                .say(format!("the model does not use the field `{name}`"));
            if by_place {
                problem
                    .help(format!("a model with inputs of its own takes values of it: `computed = {{ input = \"{name}({axis} …)\" }}`"));
            } else {
                problem.help(format!("equations call it: `{name}({axis})`"));
            }
            continue;
        }
        set.extend(found.iter().map(|input| input.name.clone()));
        let misfit =
            found.iter().find(|input| by_place && field.unit.factor_to(&input.unit).is_none());
        if let Some(input) = misfit {
            complaints
                .at(&format!("{path}.unit"))
                .say(format!("the field `{}` has the wrong unit", field.name))
                .expected(format!("a unit that converts to `{}`", input.unit))
                .found(format!("`{}`", field.unit));
        }
    }
}
