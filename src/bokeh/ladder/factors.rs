//! Cache of aperture decompositions: a blur of another strength needs the same ones again.

use std::sync::{Arc, Mutex, PoisonError};

use super::super::aperture::{Aperture, Mask};
use super::super::bank::MASK_CELLS;
use super::super::low_rank::Decomposition;

/// An aperture's mask and its singular value decomposition.
pub struct Factors {
    pub mask: Mask,
    pub svd: Decomposition,
}

/// Size of the cache, most recently used first; each entry takes 400 kB.
const MAX_CACHED: usize = 8;
type Cache = Mutex<Vec<(Aperture, f32, Arc<Factors>)>>;
static CACHE: Cache = Mutex::new(Vec::new());

impl Factors {
    /// Returns the factors of an aperture whose rim is `rim` of its radius wide.
    pub fn cached(aperture: &Aperture, rim: f32) -> Arc<Self> {
        Self::cached_in(&CACHE, aperture, rim)
    }

    fn cached_in(kept: &Cache, aperture: &Aperture, rim: f32) -> Arc<Self> {
        let lock = || kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = {
            let mut kept = lock();
            let at = kept.iter().position(|(of, of_rim, _)| of == aperture && *of_rim == rim);
            at.map(|at| kept.remove(at).2)
        };
        // Computed without the lock, so that other threads do not wait.
        let factors = known.unwrap_or_else(|| {
            let mask = aperture.mask(MASK_CELLS, rim);
            Arc::new(Self { svd: Decomposition::of(&mask), mask })
        });
        let mut kept = lock();
        kept.insert(0, (aperture.clone(), rim, Arc::clone(&factors)));
        kept.truncate(MAX_CACHED);
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::aperture::Shape;

    #[test]
    fn an_aperture_is_factored_once_and_a_few_are_remembered() {
        let kept = Cache::default();
        let ring = |inner: f32, rim: f32| {
            let aperture = Aperture { shape: Shape::Ring { inner }, intensity: 0.1 };
            Factors::cached_in(&kept, &aperture, rim)
        };
        let first = ring(0.3, 0.2);
        assert!(Arc::ptr_eq(&first, &ring(0.3, 0.2)));
        for other in [ring(0.4, 0.2), ring(0.3, 0.25)] {
            assert!(other.mask != first.mask);
        }
        assert!(Arc::ptr_eq(&first, &ring(0.3, 0.2)), "whatever came between");
        (1..=MAX_CACHED).for_each(|k| drop(ring(0.05 * k as f32, 0.1)));
        assert_eq!(kept.lock().unwrap().len(), MAX_CACHED);
        assert!(!Arc::ptr_eq(&first, &ring(0.3, 0.2)), "a bound on memory");
    }
}
