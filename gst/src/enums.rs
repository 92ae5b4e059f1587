//! GObject enumerations that are generated from choices when the plugin is loaded.

use std::ffi::CString;
use std::ptr;

use bokehcam::look::settings::Choice;
use gst::glib::translate::{FromGlib, IntoGlib, from_glib_none};
use gst::glib::{self, gobject_ffi};

/// Leaks a C string: types, and so their texts, are never freed.
fn leak_c_string(text: &str) -> *const std::ffi::c_char {
    // Names and help texts are constants without NUL bytes.
    CString::new(text).unwrap_or_default().into_raw()
}

/// Registers an enumeration; its values are the indices of `choices`. Former names follow: they set the same values,
/// which are read by the present names, as those come first.
pub fn register(name: &str, choices: &[Choice]) -> glib::Type {
    let value = |place: usize, nick: &str, help: &str| gobject_ffi::GEnumValue {
        value: place as i32,
        value_name: leak_c_string(if help.is_empty() { nick } else { help }),
        value_nick: leak_c_string(nick),
    };
    let present = choices.iter().enumerate().map(|(place, choice)| value(place, choice.name, choice.help));
    let former = choices.iter().enumerate().flat_map(|(place, choice)| {
        let help = format!("Is called {} now", choice.name);
        choice.former_names.iter().map(move |former| value(place, former, &help))
    });
    let end = gobject_ffi::GEnumValue { value: 0, value_name: ptr::null(), value_nick: ptr::null() };
    let values: Vec<_> = present.chain(former).chain([end]).collect();
    let values = Box::leak(values.into_boxed_slice());
    // SAFETY: the name is copied; the values, terminated by one of zeros, and their texts are never freed or changed.
    // Each property is created once, so no type is registered twice.
    #[allow(unsafe_code)]
    unsafe {
        let type_ = gobject_ffi::g_enum_register_static(leak_c_string(name), values.as_ptr());
        gst::ffi::gst_type_mark_as_plugin_api(type_, 0);
        glib::Type::from_glib(type_)
    }
}

/// Creates a property of a registered enumeration.
pub fn param_spec(
    name: &str,
    (nick, blurb): (&str, &str),
    type_: glib::Type,
    default: usize,
    flags: glib::ParamFlags,
) -> glib::ParamSpec {
    // SAFETY: the texts are never freed; the type is an enumeration, and the default is one of its values, as the
    // caller made both from the same choices.
    #[allow(unsafe_code)]
    unsafe {
        from_glib_none(gobject_ffi::g_param_spec_enum(
            leak_c_string(name),
            leak_c_string(nick),
            leak_c_string(blurb),
            type_.into_glib(),
            default as i32,
            flags.into_glib(),
        ))
    }
}
