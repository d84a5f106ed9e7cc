//! A linear forward map for the other side to ask.

use lacuna::matrix::Matrix;
use lacuna::plugin::forward::{self, SumOfSquares};

use crate::Refusal;
use crate::argument::{Buffer, Rows, Space};
use crate::guard::{Done, Out, begin};
use crate::table::{
    Linear, LinearFunctions, Numbers, ServeLinear, ServeSquares, Squares, SquaresFunctions,
};

/// A linear forward map as it is handed over. What is handed over points into this value.
pub struct ServedLinear<'a>(&'a dyn forward::Linear);

static LINEAR: LinearFunctions = LinearFunctions::of::<ServedLinear<'static>>();
static SQUARES: SquaresFunctions = SquaresFunctions::of::<ServedSquares>();

impl<'a> ServedLinear<'a> {
    /// Serves a map.
    pub fn new(linear: &'a dyn forward::Linear) -> Self {
        Self(linear)
    }

    /// The struct that is handed to the other side: valid for as long as this value stays where it is.
    pub fn table(&self) -> Linear {
        Linear {
            size: size_of::<Linear>(),
            map: (&raw const *self).cast_mut().cast(),
            functions: &raw const LINEAR,
            coefficients: Numbers::of(self.0.coefficients()),
        }
    }
}

impl ServeLinear for ServedLinear<'_> {
    fn basis(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let count = points.rows * self.0.coefficients().rows();
        // SAFETY: the buffer holds one row of basis functions a point.
        unsafe { to.fill(count, self.0.basis(&points.matrix()).as_slice()) }
    }

    fn basis_gradient(&self, point: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let count = point.len() * self.0.coefficients().rows();
        // SAFETY: the buffer holds `terms x parameters` numbers.
        unsafe { to.fill(count, self.0.basis_gradient(&point).as_slice()) }
    }

    fn sum_of_squares(&self, factor: Rows<'_>, to: Space<'_, Squares>, _: &Out) -> Done {
        let squares = self.0.sum_of_squares(&factor.matrix()).ok_or_else(Refusal::absent)?;
        let error = squares.error();
        let (size, squares) = (size_of::<Squares>(), begin(ServedSquares(squares)));
        // SAFETY: the caller gives a place for one form.
        unsafe { to.put(Squares { size, squares, functions: &raw const SQUARES, error }) };
        Ok(())
    }
}

/// A sum of squares that the other side ends.
struct ServedSquares(Box<dyn SumOfSquares>);

impl ServeSquares for ServedSquares {
    fn values(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        // SAFETY: the buffer holds one number a point.
        unsafe { to.fill(points.rows, &self.0.values(&points.matrix())) }
    }

    fn gradient(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let at = points.matrix();
        let all = Matrix::from_rows(at.columns(), at.iter_rows().map(|p| self.0.gradient(p)));
        // SAFETY: the buffer holds one row of derivatives a point.
        unsafe { to.fill(points.len(), all.as_slice()) }
    }

    fn covers(&self, points: Rows<'_>) -> i32 {
        i32::from(self.0.covers_all(&points.matrix()))
    }
}
