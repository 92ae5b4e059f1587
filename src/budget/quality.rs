//! The quality levels. A level changes fidelity, never the amount of blur.

use crate::names::named;

named! {
    /// A level of the ladder, from cheapest to finest.
    pub enum Quality default Balanced {
        /// The fastest: fewer bins and terms.
        Draft = "draft" once "fast",
        /// The default.
        Balanced = "balanced" once "high",
        /// The best of this method, at several times the cost.
        Best = "best",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_read_by_the_name_it_is_written_with() {
        for quality in Quality::ALL {
            assert_eq!(quality.to_string().parse(), Ok(quality));
        }
        assert_eq!(["fast", "high"].map(str::parse), [Ok(Quality::Draft), Ok(Quality::Balanced)]);
        let refused = "finest".parse::<Quality>();
        assert_eq!(refused, Err("use draft, balanced or best".into()));
    }
}
