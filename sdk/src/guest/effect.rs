//! Effects of a library.

use std::sync::Arc;

use lacuna::data::Layout;
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna_abi::argument::{Buffer, Rows};
use lacuna_abi::guard::{Done, Out};
use lacuna_abi::table::ServeEffect;
use lacuna_abi::wire::{EffectAbout, OwnedSituation, json_of_table};
use lacuna_abi::{Memo, Refusal};

use super::{Authored, Plugin, text};

/// The layouts that were read last: the same few come with every call.
static LAYOUTS: Memo<String, Layout> = Memo::new();

/// A layout from its JSON.
fn shape(layout: &[u8]) -> Result<Arc<Layout>, Refusal> {
    let known = |text: &String| text.as_bytes() == layout;
    LAYOUTS.get(known, || Ok((text(layout).into_owned(), serde_json::from_slice(layout)?)))
}

impl<T: Effect + Authored> ServeEffect for Plugin<T> {
    fn describe(&self, out: &Out) -> Done {
        out.json(&EffectAbout::new(self.0.describe(), self.0.reach()))
    }

    fn parameters(&self, layout: &[u8], out: &Out) -> Done {
        out.json(&self.0.parameters(&*shape(layout)?))
    }

    fn absent(&self, layout: &[u8], out: &Out) -> Done {
        out.row(&self.0.absent(&*shape(layout)?));
        Ok(())
    }

    fn apply(
        &self,
        layout: &[u8],
        responses: Rows<'_>,
        values: Rows<'_>,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let (layout, all, values) = (shape(layout)?, responses.matrix(), values.matrix());
        let rows = all.iter_rows().zip(values.iter_rows());
        let all: Vec<f64> = rows.flat_map(|(y, values)| self.0.apply(&layout, y, values)).collect();
        // SAFETY: the buffer is as large as the responses.
        unsafe { to.fill(responses.len(), &all) }
    }

    fn by_parameters(
        &self,
        layout: &[u8],
        response: Rows<'_>,
        values: Rows<'_>,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let slopes = self.0.by_parameters(&*shape(layout)?, &response, &values);
        // SAFETY: the buffer holds `outputs x parameters` numbers.
        unsafe { to.fill(response.len() * values.len(), slopes.as_slice()) }
    }

    fn push_forward(
        &self,
        layout: &[u8],
        response: Rows<'_>,
        values: Rows<'_>,
        tangents: Rows<'_>,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let (layout, along) = (shape(layout)?, tangents.matrix());
        let one = |tangent| self.0.push_forward(&layout, &response, &values, tangent);
        let all: Vec<f64> = along.iter_rows().flat_map(one).collect();
        // SAFETY: the buffer is as large as the tangents.
        unsafe { to.fill(tangents.len(), &all) }
    }

    fn starts(&self, layout: &[u8], situation: &[u8], out: &Out) -> Done {
        let layout = shape(layout)?;
        let situation: OwnedSituation = serde_json::from_slice(situation)?;
        let starts = self.0.starts(&layout, &situation.view());
        out.numbers(&Matrix::from_rows(self.0.parameters(&layout).len(), starts));
        Ok(())
    }

    fn proposals(&self, situation: &[u8], out: &Out) -> Done {
        let situation: OwnedSituation = serde_json::from_slice(situation)?;
        let all = self.0.proposals(&situation.view());
        out.json(&all.iter().map(json_of_table).collect::<Vec<_>>())
    }
}
