//! Quantities of interest of libraries.

use lacuna::data::Unit;
use lacuna::plugin::Quantity;
use lacuna::plugin::quantity::{Arguments, Functional, Misfit};
use lacuna_abi::object::{filled_if_any, mark};
use lacuna_abi::table::{self, FunctionalFunctions, QuantityFunctions};
use lacuna_abi::wire::{Complaint, OwnedArguments};
use lacuna_abi::{Object, Refusal, status};

use super::Plugin;

/// A quantity of a library that is ready to be computed.
struct LoadedFunctional {
    object: Object<FunctionalFunctions>,
    unit: Unit,
}

impl LoadedFunctional {
    fn new(object: Object<FunctionalFunctions>) -> Result<Self, Refusal> {
        // SAFETY: nothing is written.
        let text = unsafe { object.unit() }.demand()?.string();
        let unit = Unit::parse(text.trim())
            .map_err(|_| Refusal::stop(format!("`unit` answers `{text}`, which is no unit")))?;
        Ok(Self { object, unit })
    }

    fn computed(&self, arguments: &[f64]) -> Result<f64, Refusal> {
        // SAFETY: the buffer holds the one number of the one row.
        let call = |to| unsafe { self.object.value(arguments, to) };
        let values = filled_if_any(1, call)?;
        values.map(|values| values[0]).ok_or_else(Refusal::absent)
    }
}

impl Functional for LoadedFunctional {
    fn unit(&self) -> &Unit {
        &self.unit
    }

    fn value(&self, arguments: &[f64]) -> f64 {
        self.object.or_fault(self.computed(arguments), || f64::NAN)
    }
}

impl Plugin<QuantityFunctions> {
    fn bound(&self, arguments: &Arguments<'_>) -> Result<LoadedFunctional, Refusal> {
        let text = serde_json::to_string(&OwnedArguments::from(arguments))?;
        let mut made = table::Functional {
            size: 0,
            functional: std::ptr::null_mut(),
            functions: std::ptr::null(),
        };
        // SAFETY: the text is there until the call returns, and there is a place for one functional.
        unsafe { self.object.bind(&text, &raw mut made) }.demand_plain()?;
        let (what, fault) = ("functional", self.object.fault().clone());
        // SAFETY: whoever made the functional gave it over with its table, a constant.
        let object = unsafe {
            Object::made(what, made.functional, made.functions, |table| table.destroy, fault)?
        };
        LoadedFunctional::new(object)
    }
}

impl Quantity for Plugin<QuantityFunctions> {
    fn of_curve(&self) -> bool {
        // SAFETY: there is a place for one flag.
        let told = mark(true, |to| unsafe { self.object.of_curve(to) });
        self.object.or_fault(told, || true)
    }

    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        match self.bound(arguments) {
            Ok(functional) => Ok(Box::new(functional)),
            Err(refusal) if refusal.status == status::REJECTED => {
                Err(Complaint::read(&refusal.message).into_iter().map(Misfit::from).collect())
            }
            Err(refusal) => {
                let who = self.object.fault().who();
                Err(vec![Misfit::new("", format!("{who}: {}", refusal.message))])
            }
        }
    }
}
