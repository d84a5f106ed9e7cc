//! Designs of a library.

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::Design;
use lacuna_abi::argument::{Buffer, Rows};
use lacuna_abi::guard::{Done, Out};
use lacuna_abi::table::ServeDesign;

use super::{Authored, Plugin};

impl<T: Design + Authored> ServeDesign for Plugin<T> {
    fn points(&self, count: usize, dimension: usize, key: Stream, to: Buffer<'_>, _: &Out) -> Done {
        let points = self.0.points(count, dimension, &key)?;
        // SAFETY: the buffer holds `count x dimension` numbers.
        unsafe { to.fill(count * dimension, points.as_slice()) }
    }

    fn place(
        &self,
        parameters: &[u8],
        count: usize,
        dimension: usize,
        key: Stream,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let parameters: Vec<Parameter> = serde_json::from_slice(parameters)?;
        let points = self.0.place(&parameters, count, &key)?;
        // SAFETY: the buffer holds `count x dimension` numbers.
        unsafe { to.fill(count * dimension, points.as_slice()) }
    }

    fn extend(
        &self,
        parameters: &[u8],
        known: Rows<'_>,
        count: usize,
        key: Stream,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let parameters: Vec<Parameter> = serde_json::from_slice(parameters)?;
        let points = self.0.extend(&parameters, &known.matrix(), count, &key)?;
        // SAFETY: the buffer holds `count x parameters` numbers.
        unsafe { to.fill(count * parameters.len(), points.as_slice()) }
    }
}
