//! The log of PipeWire's library, which writes to standard error by itself.

/// Silences it: what matters comes back as an error, and is said in our words. Who sets PIPEWIRE_DEBUG wants to see it.
pub fn silence() {
    if std::env::var_os("PIPEWIRE_DEBUG").is_none() {
        // SAFETY: the library was initialised, and this sets a number that it reads.
        #[allow(unsafe_code)]
        unsafe {
            pipewire::sys::pw_log_set_level(pipewire::spa::sys::SPA_LOG_LEVEL_NONE);
        }
    }
}
