//! Quantities in Python.

use lacuna::data::Unit;
use lacuna::plugin::Quantity;
use lacuna::plugin::quantity::{Arguments, Functional, Misfit};
use lacuna_abi::wire::{Complaint, OwnedArguments};
use lacuna_abi::{Refusal, status};
use serde_json::json;

use crate::object::{Call, Object, Plugin, answer, matrices, row};

/// A quantity that is ready to be computed.
struct Bound {
    object: Object,
    unit: Unit,
}

impl Functional for Bound {
    fn unit(&self) -> &Unit {
        &self.unit
    }

    fn value(&self, arguments: &[f64]) -> f64 {
        let asked = || {
            let message = self.object.ask(&Call::new("value", &[&row(arguments)]))?;
            let [value] = matrices(message)?;
            value
                .as_slice()
                .first()
                .copied()
                .ok_or_else(|| Refusal::stop("`value` gives no number"))
        };
        self.object.or_fault(asked(), || f64::NAN)
    }
}

impl Plugin {
    fn bound(&self, arguments: &Arguments<'_>) -> Result<Bound, Refusal> {
        let about = json!({ "arguments": OwnedArguments::from(arguments) });
        let (object, made) = self.0.make(&Call::new("bind", &[]).about(about))?;
        let text: String = answer(&made)?;
        let unit = Unit::parse(text.trim())
            .map_err(|_| Refusal::stop(format!("`unit` gives `{text}`, which is no unit")))?;
        Ok(Bound { object, unit })
    }
}

impl Quantity for Plugin {
    fn of_curve(&self) -> bool {
        !self.0.has("of_numbers")
    }

    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        match self.bound(arguments) {
            Ok(bound) => Ok(Box::new(bound)),
            Err(refusal) if refusal.status == status::REJECTED => {
                Err(Complaint::read(&refusal.message).into_iter().map(Misfit::from).collect())
            }
            Err(refusal) => Err(vec![Misfit::new("", self.0.said(&refusal))]),
        }
    }
}
