//! Contract of models.

use std::path::Path;

use lacuna::data::{Axis, Coordinates, Layout, Scenario};
use lacuna::plugin::model::{Call, Response, Signature};
use lacuna::plugin::{Context, Model};

use crate::judge::{Check, agree, calm, judge, refused, same_on_threads, slope, twice};

/// Tests a model against its contract in a study of this context; files go to the folder `scratch`.
///
/// - Its inputs have distinct names, and defaults inside their ranges; its layout has values.
/// - It returns one finite value per output, reproducibly and on any number of threads, and other values for other
///   inputs, except for those that it declares as unused.
/// - An input that is NaN, too few or too many inputs, and a layout of other axes or labels are rejected without a
///   panic.
/// - A file in its own format has the name that it returned, and the same bytes each time.
/// - Derivatives, if implemented, agree with finite differences.
pub fn model(
    name: &str,
    model: &dyn Model,
    context: &Context<'_>,
    scratch: &Path,
) -> Result<(), Vec<String>> {
    let case = Case::of(model, context);
    let checks: [Check<'_>; 6] = [
        ("signs soundly", Box::new(|| signs_soundly(&case.signature))),
        ("uses what it says", Box::new(|| case.uses_what_it_says(&model.unused(context)))),
        ("answers", Box::new(|| case.answers())),
        ("refuses nonsense", Box::new(|| case.refuses_nonsense())),
        ("writes its files", Box::new(|| case.writes_its_files(scratch))),
        ("knows its derivatives", Box::new(|| case.knows_its_derivatives())),
    ];
    judge("model", name, &checks)
}

/// A model with a small call.
struct Case<'a> {
    model: &'a dyn Model,
    signature: Signature,
    names: Vec<String>,
    units: Vec<lacuna::data::Unit>,
    inputs: Vec<f64>,
    layout: Layout,
    scenario: Scenario,
    study: &'a Path,
}

fn signs_soundly(signature: &Signature) -> Result<(), String> {
    if let Some(name) = twice(signature.inputs.iter().map(|input| input.name.as_str())) {
        return Err(format!("two inputs are called `{name}`"));
    }
    for input in &signature.inputs {
        let (low, high) = input.range;
        let inside = |x: f64| (low..=high).contains(&x);
        if !(low < high && input.default.is_none_or(inside)) {
            return Err(format!("the default or the range of `{}` is not sound", input.name));
        }
        if input.description.trim().is_empty() {
            return Err(format!("`{}` is not described", input.name));
        }
    }
    if signature.layout.is_empty() { Err("its layout has no values".into()) } else { Ok(()) }
}

/// The first two labels and the first ten numbers of each axis, which keeps the tests fast.
fn part(layout: &Layout) -> Layout {
    let axis = |axis: &Axis| match &axis.coordinates {
        Coordinates::Labels(labels) => Axis::labels(&axis.name, labels.iter().take(2).cloned()),
        Coordinates::Grid { values, unit } => {
            let values = values.iter().take(10).copied().collect();
            Axis::grid(&axis.name, values, unit.clone())
        }
    };
    Layout { axes: layout.axes.iter().map(axis).collect(), ..layout.clone() }
}

impl<'a> Case<'a> {
    fn of(model: &'a dyn Model, context: &Context<'a>) -> Self {
        let signature = model.signature(context);
        let layout =
            if signature.resamples { part(&signature.layout) } else { signature.layout.clone() };
        let inputs = signature.inputs.iter().map(|input| {
            let (low, high) = (input.range.0.max(-1.0), input.range.1.min(1.0));
            input.default.unwrap_or(0.5 * (low + high))
        });
        let inputs = inputs.collect();
        let names = signature.inputs.iter().map(|input| input.name.clone()).collect();
        let units = signature.inputs.iter().map(|input| input.unit.clone()).collect();
        let scenario = context.scenarios.first().cloned().unwrap_or_default();
        Self { model, signature, names, units, inputs, layout, scenario, study: context.directory }
    }

    fn call<'b>(&'b self, inputs: &'b [f64], layout: &'b Layout) -> Call<'b> {
        Call {
            inputs,
            names: &self.names,
            units: &self.units,
            layout,
            scenario: &self.scenario,
            study: self.study,
            directory: None,
        }
    }

    fn respond(&self, inputs: &[f64]) -> Result<Response, String> {
        let response = self.model.predict(&self.call(inputs, &self.layout));
        response.map_err(|error| format!("the inputs {inputs:?} are refused: {error}"))
    }

    /// The inputs, each moved one percent towards the middle of its range.
    fn other_inputs(&self) -> Vec<f64> {
        let moved = |(x, input): (&f64, &lacuna::plugin::model::Input)| {
            let up = x + 0.01 * x.abs().max(0.01);
            if up <= input.range.1 { up } else { x - 0.01 * x.abs().max(0.01) }
        };
        self.inputs.iter().zip(&self.signature.inputs).map(moved).collect()
    }

    fn answers(&self) -> Result<(), String> {
        let response = self.respond(&self.inputs)?;
        if response.values.len() != self.layout.len() {
            let (found, asked) = (response.values.len(), self.layout.len());
            return Err(format!("{found} values where {asked} were asked for"));
        }
        if let Some(i) = response.values.iter().position(|y| !y.is_finite()) {
            return Err(format!("{} at {}", response.values[i], self.layout.describe(i)));
        }
        if self.respond(&self.inputs)? != response {
            return Err("the same inputs give another response".into());
        }
        if self.respond(&self.other_inputs())?.values == response.values {
            return Err("other inputs give the same response".into());
        }
        same_on_threads(|| self.respond(&self.inputs))
    }

    fn uses_what_it_says(&self, unused: &[String]) -> Result<(), String> {
        let (response, others) = (self.respond(&self.inputs)?, self.other_inputs());
        for name in unused {
            let Some(i) = self.names.iter().position(|other| other == name) else {
                return Err(format!("`{name}`, which it does not use, is no input"));
            };
            let mut inputs = self.inputs.clone();
            inputs[i] = others[i];
            if self.respond(&inputs)?.values != response.values {
                return Err(format!("the response depends on `{name}`, which it does not use"));
            }
        }
        Ok(())
    }

    fn refuses_nonsense(&self) -> Result<(), String> {
        let ask = |inputs: &[f64], layout: &Layout| self.model.predict(&self.call(inputs, layout));
        for (j, value) in (0..self.inputs.len()).flat_map(|j| [(j, f64::NAN), (j, f64::INFINITY)]) {
            let mut inputs = self.inputs.clone();
            inputs[j] = value;
            let what = format!("the value {value} of input {}", j + 1);
            // An infinite input may have a finite response; NaN or a non-finite response must not be returned as valid.
            if let Ok(response) = calm(&what, || ask(&inputs, &self.layout))?
                && (value.is_nan() || response.values.iter().any(|y| !y.is_finite()))
            {
                return Err(format!("{what} is accepted"));
            }
        }
        if !self.inputs.is_empty() {
            refused("an input too few", || ask(&self.inputs[1..], &self.layout))?;
        }
        let more = [&self.inputs[..], &[1.0]].concat();
        refused("an input too many", || ask(&more, &self.layout))?;
        let unknown = Layout {
            axes: vec![Axis::labels("no such axis", ["no such label"])],
            ..self.layout.clone()
        };
        refused("a layout of other axes", || ask(&self.inputs, &unknown))
    }

    fn writes_its_files(&self, scratch: &Path) -> Result<(), String> {
        let response = self.respond(&self.inputs)?;
        let call = self.call(&self.inputs, &self.layout);
        let write = || {
            let file = self.model.write("run001", &call, &response, scratch);
            let Some(file) = file.map_err(|error| error.to_string())? else { return Ok(None) };
            let bytes = std::fs::read(scratch.join(&file));
            bytes.map(Some).map_err(|error| format!("`{file}`: {error}"))
        };
        let first: Result<Option<Vec<u8>>, String> = write();
        if first? == write()? { Ok(()) } else { Err("the same run gives other bytes".into()) }
    }

    fn knows_its_derivatives(&self) -> Result<(), String> {
        let Some(gradient) = self.model.gradient() else { return Ok(()) };
        let jacobian = gradient.jacobian(&self.call(&self.inputs, &self.layout));
        let jacobian = jacobian.map_err(|error| error.to_string())?;
        let values = |inputs: &[f64]| self.respond(inputs).map_or(Vec::new(), |r| r.values);
        for j in 0..self.inputs.len() {
            let step = 1e-5 * self.inputs[j].abs().max(1e-5);
            let what = format!("the derivative by input {} of value", j + 1);
            let differences = slope(values, &self.inputs, j, step);
            agree(&what, &jacobian.column(j), &differences, 1e-4)?;
        }
        Ok(())
    }
}
