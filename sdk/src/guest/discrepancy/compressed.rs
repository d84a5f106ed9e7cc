//! The compressed likelihoods of a library's discrepancies.

use lacuna::plugin::discrepancy::Compressed;
use lacuna_abi::Refusal;
use lacuna_abi::argument::{Buffer, Lent, Rows};
use lacuna_abi::guard::{Done, Out};
use lacuna_abi::linear::LinearView;
use lacuna_abi::table::{CompressedFunctions, Linear, ServeCompressed};

use super::likelihood::density;
use super::{Guest, row_by_row};

type Own = Guest<dyn Compressed>;

pub(super) static FUNCTIONS: CompressedFunctions = CompressedFunctions::of::<Own>();

impl Own {
    fn view(&self, linear: Lent<'_, Linear>) -> Result<LinearView, Refusal> {
        // SAFETY: the table gives a map, which is there for the time of the call; no view is kept.
        unsafe { LinearView::new(*linear.one(), self.fault.clone()) }
    }
}

impl ServeCompressed for Own {
    fn log_likelihood(&self, basis: Rows<'_>, hyper: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let all = self.own.log_likelihood(&basis.matrix(), &hyper.matrix());
        let all: Vec<f64> = all.into_iter().map(density).collect();
        self.sound()?;
        // SAFETY: the buffer holds one number a point.
        unsafe { to.fill(basis.rows, &all) }
    }

    fn log_likelihood_at(
        &self,
        linear: Lent<'_, Linear>,
        points: Rows<'_>,
        hyper: Rows<'_>,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let view = self.view(linear)?;
        let all = self.own.log_likelihood_at(&view, &points.matrix(), &hyper.matrix());
        let all: Vec<f64> = all.into_iter().map(density).collect();
        self.sound()?;
        // SAFETY: the buffer holds one number a point.
        unsafe { to.fill(points.rows, &all) }
    }

    fn gradient(
        &self,
        basis: Rows<'_>,
        hyper: Rows<'_>,
        by_basis: Buffer<'_>,
        by_hyper: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let one = |basis: &[f64], hyper: &[f64]| self.own.gradient(basis, hyper);
        let (a, b) = row_by_row(&basis.matrix(), &hyper.matrix(), one);
        self.sound()?;
        // SAFETY: the buffers hold one row a point.
        unsafe {
            by_basis.fill(basis.len(), &a)?;
            by_hyper.fill(hyper.len(), &b)
        }
    }

    fn gradient_at(
        &self,
        linear: Lent<'_, Linear>,
        points: Rows<'_>,
        hyper: Rows<'_>,
        by_points: Buffer<'_>,
        by_hyper: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let view = self.view(linear)?;
        let one = |point: &[f64], hyper: &[f64]| self.own.gradient_at(&view, point, hyper);
        let (a, b) = row_by_row(&points.matrix(), &hyper.matrix(), one);
        self.sound()?;
        // SAFETY: the buffers hold one row a point.
        unsafe {
            by_points.fill(points.len(), &a)?;
            by_hyper.fill(hyper.len(), &b)
        }
    }
}
