//! The data from which a likelihood is made, as the program hands them over.

use std::marker::PhantomData;
use std::sync::Arc;

use lacuna::data::{Measurements, Replicate};
use lacuna::matrix::Matrix;
use lacuna::plugin::discrepancy::{CommonError, Known};
use lacuna::run::{Fault, Stop};
use lacuna_abi::table::{self, KnownFunctions, copied};
use lacuna_abi::wire::DataAbout;
use lacuna_abi::{Object, Refusal};

/// Measurements and errors that were copied, and a way to ask for slopes.
pub struct OwnedKnown<'a> {
    data: Measurements,
    common: Vec<CommonError>,
    known: Object<KnownFunctions>,
    /// The time for which the data are there.
    during: PhantomData<&'a ()>,
}

impl<'a> OwnedKnown<'a> {
    /// Copies what is known.
    ///
    /// # Safety
    /// All that the struct points to is there during `'a`.
    pub unsafe fn read(known: &'a table::Known) -> Result<Self, Refusal> {
        // SAFETY: as the caller promises.
        let (about, values, functions) =
            unsafe { (known.about.bytes(), known.values.matrix()?, copied(known.functions)) };
        let DataAbout { layout, replicates } = serde_json::from_slice(about)?;
        let functions = functions.map_err(|_| Refusal::stop("the slopes cannot be asked for"))?;
        let count = values.as_slice().len();
        let measured: &[u8] = if count == 0 || known.measured.is_null() {
            &[]
        } else {
            // SAFETY: one mark a value.
            unsafe { std::slice::from_raw_parts(known.measured, count) }
        };
        // SAFETY: as the caller promises.
        let (sd, covariance) = unsafe { stated(known, &values)? };
        let row = |(i, name): (usize, String)| {
            let marks = &measured[i * values.columns()..];
            let value = |(&y, &mark): (&f64, &u8)| (mark != 0).then_some(y);
            let values = values.row(i).iter().zip(marks).map(value).collect();
            let sd = sd.as_ref().map(|sd| sd.row(i)).filter(|sd| !sd.iter().all(|sd| sd.is_nan()));
            Replicate { name, values, sd: sd.map(<[f64]>::to_vec) }
        };
        if replicates.len() != values.rows() || measured.len() != count {
            return Err(Refusal::stop("the replicates have not as many names as values"));
        }
        let replicates = replicates.into_iter().enumerate().map(row).collect();
        // SAFETY: as the caller promises.
        let common = unsafe { common(known)? };
        let fault = Arc::new(Fault::new("the program"));
        let known = Object::new(known.known, functions, None, fault);
        Ok(Self {
            data: Measurements { layout, replicates, covariance },
            common,
            known,
            during: PhantomData,
        })
    }

    /// The measurements.
    pub fn data(&self) -> &Measurements {
        &self.data
    }

    /// Looks at it as discrepancies do.
    pub fn with<R>(&self, look: impl FnOnce(&Known<'_>) -> R) -> R {
        let slopes = || self.slopes().map_err(|refusal| Stop::new(refusal.message));
        look(&Known { data: &self.data, common: &self.common, slopes: &slopes, parameters: &[] })
    }

    fn slopes(&self) -> Result<Matrix, Refusal> {
        // SAFETY: nothing is written.
        let [slopes] = unsafe { self.known.slopes() }.demand_plain()?.matrices()?;
        Ok(slopes)
    }
}

/// Copies the noise that the data state: standard deviations and a covariance.
///
/// # Safety
/// All that the struct points to is there.
unsafe fn stated(
    known: &table::Known,
    values: &Matrix,
) -> Result<(Option<Matrix>, Option<Matrix>), Refusal> {
    // SAFETY: as the caller promises.
    let (sd, covariance) = unsafe { (known.sd.matrix()?, known.covariance.matrix()?) };
    let (replicates, outputs) = (values.rows(), values.columns());
    let fits = |of: &Matrix, rows| of.rows() == 0 || (of.rows(), of.columns()) == (rows, outputs);
    if !fits(&sd, replicates) || !fits(&covariance, outputs) {
        return Err(Refusal::stop("the stated noise is not that of the values"));
    }
    let some = |of: Matrix| (of.rows() > 0).then_some(of);
    Ok((some(sd), some(covariance)))
}

/// Copies the common errors.
///
/// # Safety
/// All that the struct points to is there.
unsafe fn common(known: &table::Known) -> Result<Vec<CommonError>, Refusal> {
    let mut all = Vec::with_capacity(known.common_count);
    for i in 0..known.common_count {
        // SAFETY: the pointer leads to so many.
        let error = unsafe { &*known.common.add(i) };
        // SAFETY: as the caller promises.
        let (origin, factor) = unsafe { (error.origin.string().into(), error.factor.matrix()?) };
        all.push(CommonError { origin, factor: factor.into(), predictive: error.predictive != 0 });
    }
    Ok(all)
}
