//! The element `bokeh`.

mod imp;
mod stream;

use gst::glib;
use gst::prelude::*;

glib::wrapper! {
    /// The GObject class of the element.
    pub struct Bokeh(ObjectSubclass<imp::Imp>) @extends gst_base::Aggregator, gst::Element, gst::Object;
}

/// Registers the element.
pub fn register(plugin: &gst::Plugin) -> Result<(), glib::BoolError> {
    gst::Element::register(Some(plugin), "bokeh", gst::Rank::NONE, Bokeh::static_type())
}
