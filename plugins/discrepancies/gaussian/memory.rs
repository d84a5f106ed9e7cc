//! Directions of the common errors for parts of the data, each computed once.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::statistics::Directions;

/// Number of values of directions that are kept: 256 MB.
const KEPT: usize = 1 << 25;

/// Directions, or the place where they will be; `None` if they cannot be computed.
type Place = Arc<OnceLock<Option<Arc<Directions>>>>;

/// Directions by the weights of the outputs.
#[derive(Debug, Default)]
pub(super) struct Memory(Mutex<Vec<(Vec<f64>, Place)>>);

impl Memory {
    /// The directions for these weights, which `make` computes if they are new. A thread that needs them meanwhile waits, so
    /// `make` must not wait for other threads: decompositions run on one.
    pub fn directions(
        &self,
        weights: &[f64],
        make: impl FnOnce() -> Option<Directions>,
    ) -> Option<Arc<Directions>> {
        let make = || make().map(Arc::new);
        match self.place(weights) {
            Some(place) => place.get_or_init(make).clone(),
            None => make(),
        }
    }

    /// The place of directions that are kept; `None` if there are too many. At worst there are as many directions as weights.
    fn place(&self, weights: &[f64]) -> Option<Place> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = all.iter().find(|(known, _)| known == weights) {
            return Some(Arc::clone(place));
        }
        let fits = (all.len() + 1).saturating_mul(weights.len().pow(2)) <= KEPT;
        fits.then(|| {
            let place = Place::default();
            all.push((weights.to_vec(), Arc::clone(&place)));
            place
        })
    }
}
