//! The data from which a likelihood is made, as they are handed to a library.

use lacuna::data::Replicate;
use lacuna::plugin::discrepancy::Known;
use lacuna_abi::Refusal;
use lacuna_abi::guard::{Done, Out};
use lacuna_abi::table::{self, CommonErrorView, KnownFunctions, Numbers, ServeKnown, Text};
use lacuna_abi::wire::DataAbout;
use lacuna_linalg::Matrix;

/// The known data, with copies of what crosses the boundary.
pub(super) struct HandedKnown<'a> {
    known: &'a Known<'a>,
    about: String,
    values: Matrix,
    measured: Vec<u8>,
    /// The standard deviations that the replicates state; no rows where none does.
    sd: Matrix,
    /// The covariance that the data state; no rows where they do not.
    covariance: Matrix,
}

static FUNCTIONS: KnownFunctions = KnownFunctions::of::<HandedKnown<'static>>();

impl ServeKnown for HandedKnown<'_> {
    fn slopes(&self, out: &Out) -> Done {
        out.numbers(&(self.known.slopes)()?);
        Ok(())
    }
}

/// The standard deviations that replicates state, a row of NaN where one states none; no rows where none does.
fn stated(replicates: &[Replicate], outputs: usize) -> Result<Matrix, Refusal> {
    let mut all = Matrix::zeros(0, outputs);
    if replicates.iter().all(|replicate| replicate.sd.is_none()) {
        return Ok(all);
    }
    let none = vec![f64::NAN; outputs];
    for Replicate { name, sd, .. } in replicates {
        let row = sd.as_ref().unwrap_or(&none);
        if row.len() != outputs {
            let found = row.len();
            let message = format!("replicate `{name}` states the noise of {found} values");
            return Err(Refusal::stop(format!("{message}, and the response has {outputs}")));
        }
        all.push_row(row);
    }
    Ok(all)
}

impl<'a> HandedKnown<'a> {
    /// Copies the measurements; those of another shape than they say are refused here, since they have no place in
    /// what crosses.
    pub fn of(known: &'a Known<'a>) -> Result<Self, Refusal> {
        let outputs = known.data.layout.len();
        let replicates = &known.data.replicates;
        if let Some(odd) = replicates.iter().find(|r| r.values.len() != outputs) {
            let (name, found) = (&odd.name, odd.values.len());
            return Err(Refusal::stop(format!(
                "replicate `{name}` has {found} values, and the response {outputs}"
            )));
        }
        let all = || replicates.iter().flat_map(|replicate| replicate.values.iter());
        let values: Vec<f64> = all().map(|value| value.unwrap_or(0.0)).collect();
        let about = DataAbout {
            layout: known.data.layout.clone(),
            replicates: replicates.iter().map(|replicate| replicate.name.clone()).collect(),
        };
        Ok(Self {
            known,
            about: serde_json::to_string(&about)?,
            values: Matrix::from_vec(replicates.len(), outputs, values),
            measured: all().map(|value| u8::from(value.is_some())).collect(),
            sd: stated(replicates, outputs)?,
            covariance: known.data.covariance.clone().unwrap_or_else(|| Matrix::zeros(0, outputs)),
        })
    }

    /// Calls with what the other side is given.
    pub fn with<R>(&self, call: impl FnOnce(*const table::Known) -> R) -> R {
        let common: Vec<CommonErrorView> = self
            .known
            .common
            .iter()
            .map(|error| CommonErrorView {
                origin: Text::of(error.origin.as_str()),
                factor: Numbers::of(&error.factor),
                predictive: u8::from(error.predictive),
            })
            .collect();
        let known = table::Known {
            size: size_of::<table::Known>(),
            known: (&raw const *self).cast_mut().cast(),
            functions: &raw const FUNCTIONS,
            about: Text::of(&self.about),
            values: Numbers::of(&self.values),
            measured: self.measured.as_ptr(),
            common: common.as_ptr(),
            common_count: common.len(),
            sd: Numbers::of(&self.sd),
            covariance: Numbers::of(&self.covariance),
        };
        call(&raw const known)
    }
}
