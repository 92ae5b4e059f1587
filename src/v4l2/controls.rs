//! A camera's own settings, such as exposure (V4L2 controls): listing them, reading them, and setting them by name.

mod value;

use std::ffi::c_char;
use std::io;

use serde::Serialize;
use v4l::v4l_sys as sys;
use v4l::v4l2::vidioc;

use super::device::{Device, Request, zeroed};
use super::node::text;
pub use value::{ControlError, Value};

/// A setting that a device offers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Control {
    /// Its name as tools write it: `exposure_dynamic_framerate`.
    pub name: String,
    /// Its name as the driver writes it: `Exposure, Dynamic Framerate`.
    pub label: String,
    pub id: u32,
    /// What values it takes.
    pub kind: Kind,
    /// The least value; for a text, its least length in bytes.
    pub minimum: i64,
    /// The largest value; for a bit mask, all its bits; for a text, its largest length in bytes.
    pub maximum: i64,
    /// Distance from one value to the next, at least 1.
    pub step: u64,
    /// The driver's default value.
    pub default: i64,
    /// The items of a menu. Numbers may be missing between.
    pub items: Vec<Item>,
    /// Its present value; `None` if it cannot be read or has no single value (a button, a table).
    pub value: Option<Value>,
    /// Whether it can be read but not set.
    pub read_only: bool,
    /// Whether it has no effect now, because another control overrides it.
    pub inactive: bool,
    /// Whether it cannot be set now, because the device is streaming.
    pub grabbed: bool,
}

/// What values a control takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    Integer,
    Boolean,
    /// One of several names.
    Menu,
    /// One of several numbers.
    IntegerMenu,
    /// Does something when it is set.
    Button,
    /// Whole numbers of 64 bits.
    Integer64,
    String,
    Bitmask,
    /// Tables and structures, which have no value that one could type.
    Compound,
}

/// An item of a menu.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Item {
    pub index: i64,
    /// Its name; of a menu of numbers, the number.
    pub name: String,
}

/// Old and new names of the controls that Linux 5.14 renamed: either name finds whichever the device has.
const RENAMED: [(&str, &str); 5] = [
    ("exposure_auto", "auto_exposure"),
    ("exposure_auto_priority", "exposure_dynamic_framerate"),
    ("exposure_absolute", "exposure_time_absolute"),
    ("focus_auto", "focus_automatic_continuous"),
    ("white_balance_temperature_auto", "white_balance_automatic"),
];

/// The control that makes a camera halve its rate in the dark when it is 1.
pub const LOW_LIGHT: &str = "exposure_dynamic_framerate";

/// All controls of a device with their values, in the driver's order. A device without any has an empty list.
///
/// # Errors
/// The error of the system that broke the listing off, other than the one that ends it.
pub fn list(device: &Device) -> io::Result<Vec<Control>> {
    const NEXT: u32 = sys::V4L2_CTRL_FLAG_NEXT_CTRL | sys::V4L2_CTRL_FLAG_NEXT_COMPOUND;
    let (mut controls, mut last, mut faults) = (Vec::new(), 0, 0);
    loop {
        let mut query: sys::v4l2_query_ext_ctrl = zeroed();
        query.id = last | NEXT;
        match device.query_control(&mut query) {
            Ok(()) => {
                // A driver that ignores the flags of `NEXT` gives the same control again and again.
                if query.id <= last {
                    return Ok(controls);
                }
                last = query.id;
                controls.extend(describe(device, &query));
            }
            // Some firmware fails at single controls, whose id is not told: go on id by id.
            Err(error) if error.raw_os_error() == Some(EIO) && faults < MAX_FAULTS => {
                faults += 1;
                last += 1;
            }
            Err(error) if matches!(error.raw_os_error(), Some(EINVAL | ENOTTY)) => return Ok(controls),
            Err(error) => return Err(error),
        }
    }
}

const EIO: i32 = 5;
const EINVAL: i32 = 22;
const ENOTTY: i32 = 25;
/// After so many failures the whole device is taken to fail.
const MAX_FAULTS: u32 = 64;

/// The control of this name, also under its former or later name.
pub fn find<'a>(controls: &'a [Control], name: &str) -> Option<&'a Control> {
    let renamed = RENAMED.iter().find_map(|(old, new)| match name {
        _ if name == *old => Some(*new),
        _ if name == *new => Some(*old),
        _ => None,
    });
    let called = |wanted: &str| controls.iter().find(|control| control.name == wanted);
    called(name).or_else(|| called(renamed?))
}

/// What a control is set to.
///
/// # Errors
/// There is none of this name, or it has no value to read.
pub fn get(device: &Device, name: &str) -> Result<Value, ControlError> {
    let controls = list(device).map_err(|source| ControlError::Device { name: name.to_owned(), source })?;
    let control = find(&controls, name).ok_or_else(|| ControlError::unknown(name, &controls))?;
    control.value.clone().ok_or_else(|| ControlError::NoValue(control.name.clone()))
}

/// Sets a control by its name: a number, the name or number of a menu's item, `on` or `off`, a text. Returns what it is
/// set to then, which may be another value where the device decides so.
///
/// # Errors
/// There is no such control, it does not take this value, it cannot be set now, or the device refuses.
pub fn set(device: &Device, name: &str, value: &str) -> Result<Option<Value>, ControlError> {
    let failed = |source| ControlError::Device { name: name.to_owned(), source };
    let controls = list(device).map_err(failed)?;
    let control = find(&controls, name).ok_or_else(|| ControlError::unknown(name, &controls))?;
    let value = control.parse(value)?;
    write(device, control, &value).map_err(failed)?;
    Ok(read(device, control).ok().flatten())
}

/// The control that a query found, with its menu and present value; `None` for a class heading or a disabled control.
fn describe(device: &Device, query: &sys::v4l2_query_ext_ctrl) -> Option<Control> {
    let label = text(&query.name.map(c_char::cast_unsigned));
    let flag = |flag| query.flags & flag != 0;
    if flag(sys::V4L2_CTRL_FLAG_DISABLED) || query.type_ == sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_CTRL_CLASS {
        return None;
    }
    let mut control = Control {
        name: tool_name(&label),
        label,
        id: query.id,
        kind: kind(query),
        minimum: query.minimum,
        maximum: query.maximum,
        step: query.step.max(1),
        default: query.default_value,
        items: Vec::new(),
        value: None,
        read_only: flag(sys::V4L2_CTRL_FLAG_READ_ONLY),
        inactive: flag(sys::V4L2_CTRL_FLAG_INACTIVE),
        grabbed: flag(sys::V4L2_CTRL_FLAG_GRABBED),
    };
    control.items = items(device, &control);
    if !flag(sys::V4L2_CTRL_FLAG_WRITE_ONLY) {
        // One that cannot be read does not keep the others from being listed.
        control.value = read(device, &control).ok().flatten();
    }
    Some(control)
}

fn kind(query: &sys::v4l2_query_ext_ctrl) -> Kind {
    let is_array = query.nr_of_dims > 0;
    match query.type_ {
        // The type is that of its elements.
        _ if is_array => Kind::Compound,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER => Kind::Integer,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BOOLEAN => Kind::Boolean,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_MENU => Kind::Menu,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU => Kind::IntegerMenu,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BUTTON => Kind::Button,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER64 => Kind::Integer64,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_STRING => Kind::String,
        sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BITMASK => Kind::Bitmask,
        _ => Kind::Compound,
    }
}

/// The name that `v4l2-ctl` makes of a driver's label: letters and digits in lower case, one underscore for each run of
/// other characters.
fn tool_name(label: &str) -> String {
    let words = label.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
}

/// The items of a menu; none for other kinds. The driver refuses the numbers that its menu leaves out.
fn items(device: &Device, control: &Control) -> Vec<Item> {
    /// More than any menu has: bounds the loop whatever range a driver states.
    const MOST_ITEMS: i64 = 1024;
    if !matches!(control.kind, Kind::Menu | Kind::IntegerMenu) {
        return Vec::new();
    }
    let item = |index: i64| {
        let mut query: sys::v4l2_querymenu = zeroed();
        (query.id, query.index) = (control.id, u32::try_from(index).ok()?);
        device.query_menu(&mut query).ok()?;
        let union = query.__bindgen_anon_1;
        // SAFETY: every bit pattern is a value of both members, and both lie within what the kernel filled.
        #[allow(unsafe_code)]
        let name = unsafe { if control.kind == Kind::Menu { text(&union.name) } else { union.value.to_string() } };
        Some(Item { index, name })
    };
    (control.minimum..=control.maximum.min(control.minimum.saturating_add(MOST_ITEMS))).filter_map(item).collect()
}

/// Size of the buffer for a text of at most `maximum` bytes, its final zero included; `None` if no text is so long.
fn text_buffer_bytes(maximum: i64) -> Option<usize> {
    /// More than any text has: bounds the memory whatever length a driver states.
    const MOST_BYTES: usize = 1 << 16;
    usize::try_from(maximum).ok().filter(|&bytes| bytes < MOST_BYTES).map(|bytes| bytes + 1)
}

/// The present value of a control; `None` for kinds that have no single value.
fn read(device: &Device, control: &Control) -> io::Result<Option<Value>> {
    let mut exchanged: sys::v4l2_ext_control = zeroed();
    exchanged.id = control.id;
    match control.kind {
        Kind::Button | Kind::Compound => return Ok(None),
        Kind::String => {
            let Some(length) = text_buffer_bytes(control.maximum) else { return Ok(None) };
            let mut bytes = vec![0u8; length];
            exchanged.size = bytes.len() as u32;
            exchanged.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
            exchange(device, vidioc::VIDIOC_G_EXT_CTRLS as Request, &mut exchanged)?;
            return Ok(Some(Value::Text(text(&bytes))));
        }
        _ => exchange(device, vidioc::VIDIOC_G_EXT_CTRLS as Request, &mut exchanged)?,
    }
    let union = exchanged.__bindgen_anon_1;
    // SAFETY: every bit pattern is a value of these members; the control's type says which one the kernel filled.
    #[allow(unsafe_code)]
    let number = unsafe {
        match control.kind {
            Kind::Integer64 => union.value64,
            Kind::Bitmask => i64::from(union.value.cast_unsigned()),
            _ => i64::from(union.value),
        }
    };
    Ok(Some(Value::Number(number)))
}

fn write(device: &Device, control: &Control, value: &Value) -> io::Result<()> {
    let mut exchanged: sys::v4l2_ext_control = zeroed();
    exchanged.id = control.id;
    // Declared here so that it outlives the call, which reads it through a pointer.
    let mut bytes = Vec::new();
    match (value, control.kind) {
        (Value::Text(text), _) => {
            bytes.extend_from_slice(text.as_bytes());
            bytes.push(0);
            exchanged.size = bytes.len() as u32;
            exchanged.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
        }
        (Value::Number(number), Kind::Integer64) => exchanged.__bindgen_anon_1.value64 = *number,
        // Truncates as intended: bit 31 of a bit mask is the sign of the kernel's `i32`.
        (Value::Number(number), _) => exchanged.__bindgen_anon_1.value = *number as i32,
    }
    exchange(device, vidioc::VIDIOC_S_EXT_CTRLS as Request, &mut exchanged)
}

/// Reads or sets one control: `request` is `VIDIOC_G_EXT_CTRLS` or `VIDIOC_S_EXT_CTRLS`. A text lies in the caller's
/// buffer, to which `control` points.
fn exchange(device: &Device, request: Request, control: &mut sys::v4l2_ext_control) -> io::Result<()> {
    let mut controls: sys::v4l2_ext_controls = zeroed();
    controls.count = 1;
    controls.controls = control;
    // SAFETY: the requests are those of this type. It points to one control, as its count says; that holds a number, or
    // points to as many bytes as its size says, which live in the caller until this returns.
    #[allow(unsafe_code)]
    unsafe {
        device.ioctl(request, &mut controls)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_written_as_other_tools_write_them() {
        for (label, name) in [
            ("Exposure, Dynamic Framerate", "exposure_dynamic_framerate"),
            ("White Balance Temperature, Auto", "white_balance_temperature_auto"),
            ("  Pan (Absolute)", "pan_absolute"),
            ("S_VIDEO--2", "s_video_2"),
            ("", ""),
        ] {
            assert_eq!(tool_name(label), name);
        }
    }

    #[test]
    fn the_room_for_a_text_is_bounded() {
        assert_eq!([0, 31, 65_535].map(text_buffer_bytes), [Some(1), Some(32), Some(65_536)]);
        assert_eq!([-1, 65_536, 1 << 40, i64::MAX].map(text_buffer_bytes), [None; 4]);
    }

    #[test]
    fn a_device_without_controls_has_an_empty_list() {
        let device = Device::open("/dev/null".as_ref()).unwrap();
        assert_eq!(list(&device).unwrap(), []);
        let error = set(&device, "brightness", "1").unwrap_err().to_string();
        assert_eq!(error, "control brightness: the device has no controls");
    }
}
