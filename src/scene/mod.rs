//! The synthetic scene.
