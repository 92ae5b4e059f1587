//! An attack on blurred backgrounds: what of a card with text can be restored after a call has shown it.
//!
//! | module | holds |
//! |---|---|
//! | [`card`] | text of known sizes, or a poster, before a wall |
//! | [`call`] | the blur as a call has it, a camera that moves, and video codecs |
//! | [`observation`] | what an attacker has: the mean of many registered pictures |
//! | [`attack`] | deconvolution: the Wiener filter and Richardson-Lucy |
//! | [`score`] | how much of each line is back |
//!
//! `docs/privacy.md` explains it; the bench `leak` and the laws of the tests run it.

#![allow(dead_code)] // The bench and the tests each use a part.

pub mod attack;
pub mod call;
pub mod card;
pub mod codec;
pub mod fourier;
pub mod light;
pub mod observation;
pub mod score;
