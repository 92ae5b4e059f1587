//! The factors of an aperture, remembered: a blur of another strength needs them again.

use std::sync::{Arc, Mutex, PoisonError};

use super::super::aperture::{Aperture, Mask};
use super::super::bank::MASK_CELLS;
use super::super::low_rank::Decomposition;

/// The mask of an aperture, and its decomposition.
pub struct Factors {
    pub mask: Mask,
    pub svd: Decomposition,
}

/// So many are remembered, the last first; each takes 400 kB.
const KEPT: usize = 8;
type Kept = Mutex<Vec<(Aperture, f32, Arc<Factors>)>>;
static KEPT_OF_ALL: Kept = Mutex::new(Vec::new());

impl Factors {
    /// The factors of an aperture whose rim is `rim` of its radius wide.
    pub fn of(aperture: &Aperture, rim: f32) -> Arc<Self> {
        Self::among(&KEPT_OF_ALL, aperture, rim)
    }

    fn among(kept: &Kept, aperture: &Aperture, rim: f32) -> Arc<Self> {
        let lock = || kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = {
            let mut kept = lock();
            let at = kept.iter().position(|(of, of_rim, _)| of == aperture && *of_rim == rim);
            at.map(|at| kept.remove(at).2)
        };
        // Others need not wait while these are made.
        let factors = known.unwrap_or_else(|| {
            let mask = aperture.mask(MASK_CELLS, rim);
            Arc::new(Self { svd: Decomposition::of(&mask), mask })
        });
        let mut kept = lock();
        kept.insert(0, (aperture.clone(), rim, Arc::clone(&factors)));
        kept.truncate(KEPT);
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bokeh::aperture::Shape;

    #[test]
    fn an_aperture_is_factored_once_and_a_few_are_remembered() {
        let kept = Kept::default();
        let ring = |inner: f32, rim: f32| {
            let aperture = Aperture { shape: Shape::Ring { inner }, intensity: 0.1 };
            Factors::among(&kept, &aperture, rim)
        };
        let first = ring(0.3, 0.2);
        assert!(Arc::ptr_eq(&first, &ring(0.3, 0.2)));
        for other in [ring(0.4, 0.2), ring(0.3, 0.25)] {
            assert!(other.mask != first.mask);
        }
        assert!(Arc::ptr_eq(&first, &ring(0.3, 0.2)), "whatever came between");
        (1..=KEPT).for_each(|k| drop(ring(0.05 * k as f32, 0.1)));
        assert_eq!(kept.lock().unwrap().len(), KEPT);
        assert!(!Arc::ptr_eq(&first, &ring(0.3, 0.2)), "a bound on memory");
    }
}
