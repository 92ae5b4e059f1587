//! The claims about the governor, on the simulated machines of `cargo bench --bench governor`.
#![allow(missing_docs, dead_code)]

#[path = "../../benches/governor/claims.rs"]
mod claims;
#[path = "../../benches/governor/load.rs"]
mod load;
#[path = "../../benches/governor/play.rs"]
mod play;
#[path = "../../benches/governor/rivals.rs"]
mod rivals;

use claims::{BUDGET, Outcome, cases};
use rivals::GovernorRule;

/// All claims but the comparisons with rivals, which take twelve times as long.
#[test]
fn the_governor_keeps_what_is_claimed_of_it_on_every_machine() {
    for case in cases() {
        let ours = case.simulate(101..=140, 20, |known| Box::new(GovernorRule::new(known, BUDGET)));
        let broken = case.find_violations(&Outcome { ours, pids: Vec::new(), equal: None });
        assert!(broken.is_empty(), "{}: {broken:?}", case.name);
    }
}
