//! What is claimed of the governor, on the simulated machines of `cargo bench --bench governor`.
#![allow(missing_docs, dead_code)]

#[path = "../benches/governor/claims.rs"]
mod claims;
#[path = "../benches/governor/load.rs"]
mod load;
#[path = "../benches/governor/play.rs"]
mod play;
#[path = "../benches/governor/rivals.rs"]
mod rivals;

#[test]
fn the_governor_keeps_what_is_claimed_of_it_on_every_machine() {
    for case in claims::cases() {
        let broken = case.broken(&case.measure(101..=110, 6));
        assert!(broken.is_empty(), "{}: {broken:?}", case.name);
    }
}
