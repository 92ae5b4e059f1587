//! Cache of aperture decompositions: a blur of another strength needs the same ones again.

use std::sync::{Arc, Mutex, PoisonError};

use super::super::aperture::{Aperture, Mask};
use super::super::bank::MASK_CELLS;
use super::super::low_rank::Decomposition;

/// An aperture's mask and its singular value decomposition.
pub struct ApertureFactors {
    pub mask: Mask,
    pub svd: Decomposition,
}

/// Size of the cache, most recently used first; each entry takes 400 kB.
const MAX_CACHED: usize = 8;
type Cache = Mutex<Vec<(Aperture, f32, Arc<ApertureFactors>)>>;
static CACHE: Cache = Mutex::new(Vec::new());

impl ApertureFactors {
    /// Returns the factors of an aperture whose rim is `rim` of its radius wide.
    pub fn from_cache(aperture: &Aperture, rim: f32) -> Arc<Self> {
        Self::from_cache_in(&CACHE, aperture, rim)
    }

    fn from_cache_in(cache: &Cache, aperture: &Aperture, rim: f32) -> Arc<Self> {
        let lock = || cache.lock().unwrap_or_else(PoisonError::into_inner);
        let known = {
            let mut cache = lock();
            let at = cache.iter().position(|(of, of_rim, _)| of == aperture && *of_rim == rim);
            at.map(|at| cache.remove(at).2)
        };
        // Computed without the lock, so that other threads do not wait.
        let factors = known.unwrap_or_else(|| {
            let mask = aperture.to_mask(MASK_CELLS, rim);
            Arc::new(Self { svd: Decomposition::new(&mask), mask })
        });
        let mut cache = lock();
        cache.insert(0, (aperture.clone(), rim, Arc::clone(&factors)));
        cache.truncate(MAX_CACHED);
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::aperture::Shape;

    #[test]
    fn an_aperture_is_factored_once_and_a_few_are_remembered() {
        let cache = Cache::default();
        let ring = |inner: f32, rim: f32| {
            let aperture = Aperture { shape: Shape::Ring { inner }, intensity: 0.1 };
            ApertureFactors::from_cache_in(&cache, &aperture, rim)
        };
        let first = ring(0.3, 0.2);
        assert!(Arc::ptr_eq(&first, &ring(0.3, 0.2)));
        for other in [ring(0.4, 0.2), ring(0.3, 0.25)] {
            assert!(other.mask != first.mask);
        }
        assert!(Arc::ptr_eq(&first, &ring(0.3, 0.2)), "whatever came between");
        (1..=MAX_CACHED).for_each(|k| drop(ring(0.05 * k as f32, 0.1)));
        assert_eq!(cache.lock().unwrap().len(), MAX_CACHED);
        assert!(!Arc::ptr_eq(&first, &ring(0.3, 0.2)), "a bound on memory");
    }
}
