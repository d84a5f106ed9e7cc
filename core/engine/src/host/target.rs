//! A log density for samplers of a library to ask.

use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna_abi::Refusal;
use lacuna_abi::argument::{Buffer, Rows};
use lacuna_abi::guard::{Done, Out};
use lacuna_abi::table::{self, ServeTarget, TargetFunctions};
use lacuna_linalg::Matrix;

/// A log density as it is handed over. What is handed over points into this value.
pub(super) struct ServedTarget<'a>(pub &'a dyn Target);

static FUNCTIONS: TargetFunctions = TargetFunctions::of::<ServedTarget<'static>>();

impl ServedTarget<'_> {
    /// The struct that is handed to the other side: valid for as long as this value stays where it is.
    pub fn table(&self) -> table::Target {
        table::Target {
            size: size_of::<table::Target>(),
            target: (&raw const *self).cast_mut().cast(),
            functions: &raw const FUNCTIONS,
            dimension: self.0.dimension(),
        }
    }

    /// Points of the density's dimension.
    fn points(&self, points: Rows<'_>) -> Result<Matrix, Refusal> {
        let (found, dimension) = (points.columns, self.0.dimension());
        if found == dimension {
            return Ok(points.matrix());
        }
        Err(Refusal::stop(format!(
            "was asked at points of {found} coordinates in place of {dimension}"
        )))
    }
}

impl ServeTarget for ServedTarget<'_> {
    fn log_density(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        // SAFETY: the buffer holds one number a point.
        unsafe { to.fill(points.rows, &self.0.log_density(&self.points(points)?)) }
    }

    fn log_prior(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        // SAFETY: the buffer holds one number a point.
        unsafe { to.fill(points.rows, &self.0.log_prior(&self.points(points)?)) }
    }

    fn gradient(&self, point: Rows<'_>, value: Buffer<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let points = self.points(point)?;
        if points.rows() != 1 {
            let found = points.rows();
            return Err(Refusal::stop(format!("was asked for the gradient at {found} points")));
        }
        let (density, gradient) = self.0.gradient(points.as_slice());
        // SAFETY: the buffers hold one number, and one a coordinate.
        unsafe {
            value.put(density);
            to.fill(self.0.dimension(), &gradient)
        }
    }

    fn bounds(&self, low: Buffer<'_>, high: Buffer<'_>, _: &Out) -> Done {
        let (from, to): (Vec<f64>, Vec<f64>) = self.0.bounds().into_iter().unzip();
        // SAFETY: the buffers hold one number a coordinate.
        unsafe {
            low.fill(self.0.dimension(), &from)?;
            high.fill(self.0.dimension(), &to)
        }
    }

    fn prior_draws(&self, count: usize, key: Stream, to: Buffer<'_>, _: &Out) -> Done {
        let size = count.checked_mul(self.0.dimension());
        let size = size.filter(|size| *size <= isize::MAX as usize / size_of::<f64>());
        let too_many = || Refusal::stop(format!("was asked for {count} draws"));
        let size = size.ok_or_else(too_many)?;
        // SAFETY: the buffer holds `count x dimension` numbers.
        unsafe { to.fill(size, self.0.prior_draws(count, &key).as_slice()) }
    }

    fn failure(&self, out: &Out) -> Done {
        out.text(&self.0.failure().ok_or_else(Refusal::absent)?);
        Ok(())
    }
}
