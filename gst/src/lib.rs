//! GStreamer plugin `bokehcam`: the element `bokeh` blurs the background of video, by depth if it gets any.
//!
//! `bokeh` is the element, `settings` its properties, generated from the library's table of settings (`enums` creates
//! the types of those with named values); `pictures` and `maps` convert between GStreamer's memory and the library's.
//! [`bokehcam::engine::FrameProcessor`] processes a frame.
//!
//! `unsafe` is allowed in `enums.rs`, where each block carries its argument.

mod bokeh;
mod enums;
mod lateness;
mod maps;
mod pictures;
mod settings;

use gst::glib;

fn plugin_init(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    bokehcam_live::source::register_look_files();
    bokeh::register(plugin)
}

gst::plugin_define!(
    bokehcam,
    env!("CARGO_PKG_DESCRIPTION"),
    plugin_init,
    env!("CARGO_PKG_VERSION"),
    // Versions before 1.20 refuse names of licences that they do not know, such as SPDX's.
    "MIT/X11",
    env!("CARGO_PKG_NAME"),
    "bokehcam",
    "https://github.com/bokehcam/bokehcam",
    "2026-11-24"
);
