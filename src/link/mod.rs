//! How frames change hands between threads, and how buffers come home.

pub mod pool;
