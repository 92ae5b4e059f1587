//! Enumerations of GObject that are made of choices when the plugin is loaded.

use std::ffi::CString;
use std::ptr;

use bokehcam::look::settings::Choice;
use gst::glib::translate::{FromGlib, IntoGlib, from_glib_none};
use gst::glib::{self, gobject_ffi};

/// Text that lives as long as the program, as types do.
fn forever(text: &str) -> *const std::ffi::c_char {
    // Names and help are text of the program's own, without zeros.
    CString::new(text).unwrap_or_default().into_raw()
}

/// Registers an enumeration of this name; its values are the places of `choices`.
pub fn register(name: &str, choices: &[Choice]) -> glib::Type {
    let value = |(place, &(nick, help)): (usize, &Choice)| gobject_ffi::GEnumValue {
        value: place as i32,
        value_name: forever(if help.is_empty() { nick } else { help }),
        value_nick: forever(nick),
    };
    let end = gobject_ffi::GEnumValue { value: 0, value_name: ptr::null(), value_nick: ptr::null() };
    let values: Vec<_> = choices.iter().enumerate().map(value).chain([end]).collect();
    let values = Box::leak(values.into_boxed_slice());
    // SAFETY: the name is copied; the values, which end with one of zeros, and their texts are never freed or changed. A
    // property is made once, so no type is registered twice.
    #[allow(unsafe_code)]
    unsafe {
        let type_ = gobject_ffi::g_enum_register_static(forever(name), values.as_ptr());
        gst::ffi::gst_type_mark_as_plugin_api(type_, 0);
        glib::Type::from_glib(type_)
    }
}

/// A property of such an enumeration.
pub fn param_spec(
    name: &str,
    (nick, blurb): (&str, &str),
    type_: glib::Type,
    default: usize,
    flags: glib::ParamFlags,
) -> glib::ParamSpec {
    // SAFETY: the texts are never freed; the type is an enumeration, and the default one of its values, as the caller made it
    // of the same choices.
    #[allow(unsafe_code)]
    unsafe {
        from_glib_none(gobject_ffi::g_param_spec_enum(
            forever(name),
            forever(nick),
            forever(blurb),
            type_.into_glib(),
            default as i32,
            flags.into_glib(),
        ))
    }
}
