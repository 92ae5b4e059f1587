//! Modules of the bench `quality` that are used here.
#![allow(dead_code)]

#[path = "../quality/damage.rs"]
pub mod damage;
#[path = "../quality/lens.rs"]
pub mod lens;
#[path = "../quality/methods.rs"]
pub mod methods;
#[path = "../quality/metrics.rs"]
pub mod metrics;
#[path = "../quality/picture.rs"]
pub mod picture;
#[path = "../quality/rivals.rs"]
pub mod rivals;
#[path = "../quality/sheet.rs"]
pub mod sheet;
#[path = "../quality/texture.rs"]
pub mod texture;
