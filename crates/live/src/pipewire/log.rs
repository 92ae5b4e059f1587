//! The log of PipeWire's library, which writes to standard error on its own.

/// Disables the log, because relevant failures are returned as errors and reported by this program. Setting
/// PIPEWIRE_DEBUG keeps it enabled.
pub fn disable_log() {
    if std::env::var_os("PIPEWIRE_DEBUG").is_none() {
        // SAFETY: the library is initialised, and this sets a number that it reads.
        #[allow(unsafe_code)]
        unsafe {
            pipewire::sys::pw_log_set_level(pipewire::spa::sys::SPA_LOG_LEVEL_NONE);
        }
    }
}
