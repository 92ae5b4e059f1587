//! V4L2 controls, a camera's own settings such as exposure: listing, reading, and setting them by name.

mod value;

use std::ffi::c_char;
use std::io;

use serde::Serialize;
use v4l::v4l_sys as sys;
use v4l::v4l2::vidioc;

use super::device::{Device, Request, zeroed};
use super::node::decode_text;
pub use value::{ControlError, Value};

/// A control that a device offers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Control {
    /// Name as tools write it: `exposure_dynamic_framerate`.
    pub name: String,
    /// Name as the driver writes it: `Exposure, Dynamic Framerate`.
    pub label: String,
    pub id: u32,
    /// The type of its values.
    pub kind: Kind,
    /// Smallest value; for a string, its minimum length in bytes.
    pub minimum: i64,
    /// Largest value; for a bit mask, all its bits; for a string, its maximum length in bytes.
    pub maximum: i64,
    /// Distance between adjacent values, at least 1.
    pub step: u64,
    /// The driver's default value.
    pub default: i64,
    /// Menu items. Their indices may have gaps.
    pub items: Vec<Item>,
    /// Current value; `None` if it cannot be read or has no single value (a button, a table).
    pub value: Option<Value>,
    /// Whether it can be read but not set.
    pub read_only: bool,
    /// Whether another control overrides it, so that it has no effect now.
    pub inactive: bool,
    /// Whether it cannot be set while the device is streaming.
    pub grabbed: bool,
}

/// The type of a control's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    Integer,
    Boolean,
    /// One of several names.
    Menu,
    /// One of several numbers.
    IntegerMenu,
    /// Triggers an action when it is set.
    Button,
    /// 64-bit integers.
    Integer64,
    String,
    Bitmask,
    /// Arrays and structures, which have no single value to type in.
    Compound,
}

/// A menu item.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Item {
    pub index: i64,
    /// Its name; in a menu of numbers, the number.
    pub name: String,
}

/// Old and new names of the controls that Linux 5.14 renamed. Either name finds the control, whichever the device has.
const RENAMED_CONTROLS: [(&str, &str); 5] = [
    ("exposure_auto", "auto_exposure"),
    ("exposure_auto_priority", "exposure_dynamic_framerate"),
    ("exposure_absolute", "exposure_time_absolute"),
    ("focus_auto", "focus_automatic_continuous"),
    ("white_balance_temperature_auto", "white_balance_automatic"),
];

/// The control that, when it is 1, lets a camera halve its frame rate in the dark.
pub const LOW_LIGHT_CONTROL: &str = "exposure_dynamic_framerate";

/// Lists all controls of a device with their values, in the driver's order; empty if it has none.
///
/// # Errors
/// Fails with the driver's error; EINVAL and ENOTTY mark the end of the list.
pub fn list_controls(device: &Device) -> io::Result<Vec<Control>> {
    const NEXT: u32 = sys::V4L2_CTRL_FLAG_NEXT_CTRL | sys::V4L2_CTRL_FLAG_NEXT_COMPOUND;
    let (mut controls, mut last, mut faults) = (Vec::new(), 0, 0);
    loop {
        let mut query: sys::v4l2_query_ext_ctrl = zeroed();
        query.id = last | NEXT;
        match device.query_control(&mut query) {
            Ok(()) => {
                // A driver that ignores the flags of `NEXT` returns the same control again and again.
                if query.id <= last {
                    return Ok(controls);
                }
                last = query.id;
                controls.extend(build_control(device, &query));
            }
            // Some firmware fails on single controls without returning their id: continue with the next id.
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
/// After this many failures, the whole device counts as failing.
const MAX_FAULTS: u32 = 64;

/// Finds the control with this name, or with its old or new equivalent.
pub fn find_control<'a>(controls: &'a [Control], name: &str) -> Option<&'a Control> {
    let renamed = RENAMED_CONTROLS.iter().find_map(|(old, new)| match name {
        _ if name == *old => Some(*new),
        _ if name == *new => Some(*old),
        _ => None,
    });
    let find_named = |wanted: &str| controls.iter().find(|control| control.name == wanted);
    find_named(name).or_else(|| find_named(renamed?))
}

/// Reads the value of a control.
///
/// # Errors
/// No control has this name, or it has no readable value.
pub fn read_control(device: &Device, name: &str) -> Result<Value, ControlError> {
    let controls = list_controls(device).map_err(|source| ControlError::Device { name: name.to_owned(), source })?;
    let control = find_control(&controls, name).ok_or_else(|| ControlError::unknown(name, &controls))?;
    control.value.clone().ok_or_else(|| ControlError::NoValue(control.name.clone()))
}

/// Sets a control by its name, to a number, a menu item's name or index, `on` or `off`, or a text. Returns the value
/// that the device then reports, which may differ from the requested one.
///
/// # Errors
/// The control does not exist, does not accept this value, cannot be set now, or the device refuses.
pub fn set_control(device: &Device, name: &str, value: &str) -> Result<Option<Value>, ControlError> {
    let failed = |source| ControlError::Device { name: name.to_owned(), source };
    let controls = list_controls(device).map_err(failed)?;
    let control = find_control(&controls, name).ok_or_else(|| ControlError::unknown(name, &controls))?;
    let value = control.parse(value)?;
    write_value(device, control, &value).map_err(failed)?;
    Ok(read_value(device, control).ok().flatten())
}

/// Builds a control from a query's result, with its menu and current value; `None` for class headings and disabled
/// controls.
fn build_control(device: &Device, query: &sys::v4l2_query_ext_ctrl) -> Option<Control> {
    let label = decode_text(&query.name.map(c_char::cast_unsigned));
    let has_flag = |flag| query.flags & flag != 0;
    if has_flag(sys::V4L2_CTRL_FLAG_DISABLED) || query.type_ == sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_CTRL_CLASS {
        return None;
    }
    let mut control = Control {
        name: v4l2_ctl_name(&label),
        label,
        id: query.id,
        kind: control_kind(query),
        minimum: query.minimum,
        maximum: query.maximum,
        step: query.step.max(1),
        default: query.default_value,
        items: Vec::new(),
        value: None,
        read_only: has_flag(sys::V4L2_CTRL_FLAG_READ_ONLY),
        inactive: has_flag(sys::V4L2_CTRL_FLAG_INACTIVE),
        grabbed: has_flag(sys::V4L2_CTRL_FLAG_GRABBED),
    };
    control.items = list_menu_items(device, &control);
    if !has_flag(sys::V4L2_CTRL_FLAG_WRITE_ONLY) {
        // A control that cannot be read must not keep the others from being listed.
        control.value = read_value(device, &control).ok().flatten();
    }
    Some(control)
}

fn control_kind(query: &sys::v4l2_query_ext_ctrl) -> Kind {
    let is_array = query.nr_of_dims > 0;
    match query.type_ {
        // An array's type is that of its elements.
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

/// Returns the name that `v4l2-ctl` derives from a driver's label: lower-case letters and digits, and one underscore
/// for each run of other characters.
fn v4l2_ctl_name(label: &str) -> String {
    let words = label.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
}

/// Lists the items of a menu; empty for other kinds. The driver refuses the indices that its menu leaves out.
fn list_menu_items(device: &Device, control: &Control) -> Vec<Item> {
    /// More than any menu has; bounds the loop whatever range a driver states.
    const MAX_ITEMS: i64 = 1024;
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
        let name =
            unsafe { if control.kind == Kind::Menu { decode_text(&union.name) } else { union.value.to_string() } };
        Some(Item { index, name })
    };
    (control.minimum..=control.maximum.min(control.minimum.saturating_add(MAX_ITEMS))).filter_map(item).collect()
}

/// Returns the buffer size for a text of at most `maximum` bytes and its final zero; `None` if no text is that long.
fn text_buffer_bytes(maximum: i64) -> Option<usize> {
    /// More than any text has; bounds the allocation whatever length a driver states.
    const MAX_BYTES: usize = 1 << 16;
    usize::try_from(maximum).ok().filter(|&bytes| bytes < MAX_BYTES).map(|bytes| bytes + 1)
}

/// Reads a control's current value; `None` for kinds without a single value.
fn read_value(device: &Device, control: &Control) -> io::Result<Option<Value>> {
    let mut ext_control: sys::v4l2_ext_control = zeroed();
    ext_control.id = control.id;
    match control.kind {
        Kind::Button | Kind::Compound => return Ok(None),
        Kind::String => {
            let Some(length) = text_buffer_bytes(control.maximum) else { return Ok(None) };
            let mut bytes = vec![0u8; length];
            ext_control.size = bytes.len() as u32;
            ext_control.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
            ioctl_control(device, vidioc::VIDIOC_G_EXT_CTRLS as Request, &mut ext_control)?;
            return Ok(Some(Value::Text(decode_text(&bytes))));
        }
        _ => ioctl_control(device, vidioc::VIDIOC_G_EXT_CTRLS as Request, &mut ext_control)?,
    }
    let union = ext_control.__bindgen_anon_1;
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

fn write_value(device: &Device, control: &Control, value: &Value) -> io::Result<()> {
    let mut ext_control: sys::v4l2_ext_control = zeroed();
    ext_control.id = control.id;
    // Declared here so that it outlives the call, which reads it through a pointer.
    let mut bytes = Vec::new();
    match (value, control.kind) {
        (Value::Text(text), _) => {
            bytes.extend_from_slice(text.as_bytes());
            bytes.push(0);
            ext_control.size = bytes.len() as u32;
            ext_control.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
        }
        (Value::Number(number), Kind::Integer64) => ext_control.__bindgen_anon_1.value64 = *number,
        // Truncates as intended: bit 31 of a bit mask is the sign of the kernel's `i32`.
        (Value::Number(number), _) => ext_control.__bindgen_anon_1.value = *number as i32,
    }
    ioctl_control(device, vidioc::VIDIOC_S_EXT_CTRLS as Request, &mut ext_control)
}

/// Reads or sets one control: `request` is `VIDIOC_G_EXT_CTRLS` or `VIDIOC_S_EXT_CTRLS`. A text lies in the caller's
/// buffer, to which `control` points.
fn ioctl_control(device: &Device, request: Request, control: &mut sys::v4l2_ext_control) -> io::Result<()> {
    let mut controls: sys::v4l2_ext_controls = zeroed();
    controls.count = 1;
    controls.controls = control;
    // SAFETY: both requests take this type. It points to one control, as its count says; that control holds a number,
    // or points to a buffer of the size it states, which the caller keeps alive until this returns.
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
            assert_eq!(v4l2_ctl_name(label), name);
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
        assert_eq!(list_controls(&device).unwrap(), []);
        let error = set_control(&device, "brightness", "1").unwrap_err().to_string();
        assert_eq!(error, "control brightness: the device has no controls");
    }
}
