//! The rungs of the quality ladder. A rung changes fidelity, never the amount of blur.

use crate::names::named;

named! {
    /// A rung of the ladder, from cheapest to finest.
    pub enum Quality default Balanced {
        /// The floor: nothing is filled in behind near objects. A blur always stays, whatever the load.
        Draft = "draft",
        /// Two bins a side, two separable terms.
        Fast = "fast",
        /// The default.
        Balanced = "balanced",
        /// More bins and terms.
        High = "high",
        /// As good as this method gets, at several times the cost.
        Best = "best",
    }
}
