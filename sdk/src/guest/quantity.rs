//! Quantities of interest of a library.

use lacuna::plugin::Quantity;
use lacuna::plugin::quantity::Functional;
use lacuna_abi::argument::{Buffer, Rows, Space};
use lacuna_abi::guard::{Done, Out, begin};
use lacuna_abi::table::{self, FunctionalFunctions, ServeFunctional, ServeQuantity};
use lacuna_abi::wire::{Complaint, OwnedArguments};
use lacuna_abi::{Refusal, status};

use super::{Authored, Plugin};

static FUNCTIONAL: FunctionalFunctions = FunctionalFunctions::of::<Owned>();

/// A quantity that is ready to be computed.
struct Owned(Box<dyn Functional>);

impl<T: Quantity + Authored> ServeQuantity for Plugin<T> {
    fn of_curve(&self, to: Space<'_, u8>, _: &Out) -> Done {
        // SAFETY: the caller gives a place for one flag.
        unsafe { to.put(self.0.of_curve().into()) };
        Ok(())
    }

    fn bind(&self, arguments: &[u8], made: Space<'_, table::Functional>, _: &Out) -> Done {
        let arguments: OwnedArguments = serde_json::from_slice(arguments)?;
        let functional = arguments.with(|arguments| self.0.bind(arguments)).map_err(|misfits| {
            let complaints: Vec<Complaint> = misfits.into_iter().map(Complaint::from).collect();
            serde_json::to_string(&complaints)
                .map_or_else(Refusal::from, |text| Refusal::new(status::REJECTED, text))
        })?;
        let functional = table::Functional {
            size: size_of::<table::Functional>(),
            functional: begin(Owned(functional)),
            functions: &raw const FUNCTIONAL,
        };
        // SAFETY: the caller gives a place for one functional.
        unsafe { made.put(functional) };
        Ok(())
    }
}

impl ServeFunctional for Owned {
    fn unit(&self, out: &Out) -> Done {
        out.text(&self.0.unit().to_string());
        Ok(())
    }

    fn value(&self, arguments: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let columns = arguments.columns;
        let row = |i: usize| self.0.value(&arguments[i * columns..(i + 1) * columns]);
        let values: Vec<f64> = (0..arguments.rows).map(row).collect();
        // SAFETY: the buffer holds one number for each row.
        unsafe { to.fill(values.len(), &values) }
    }
}
