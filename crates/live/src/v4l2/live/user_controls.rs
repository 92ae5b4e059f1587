//! The user-adjustable controls of a camera while it streams, through a second file descriptor of its node.

use std::path::Path;

use v4l::v4l_sys as sys;

use super::OpenError;
use crate::camera_control::CameraControl;
use crate::v4l2::controls::{self, Control, Kind, Value};
use crate::v4l2::device::Device;
use crate::v4l2::node;

/// Lists the user-adjustable controls of the camera that `name` refers to (see [`node::resolve_node`]), in the driver's
/// order, with their current values. The camera may be streaming, here or elsewhere.
///
/// # Errors
/// The camera does not exist, cannot be opened, or fails.
pub fn list_user_controls(name: &str) -> Result<Vec<CameraControl>, OpenError> {
    read_user_controls(&open_device(name)?)
}

/// Sets a control; returns all of them with their new values, since others may change with it. A value that the control
/// does not accept changes nothing.
///
/// # Errors
/// Those of [`list_user_controls`]; the control does not exist, does not accept this value now, or the camera refuses.
pub fn set_user_control(name: &str, control: &str, value: i64) -> Result<Vec<CameraControl>, OpenError> {
    let device = open_device(name)?;
    controls::set_control(&device, control, &value.to_string())
        .map_err(|source| OpenError::Control { path: device.path().to_owned(), source })?;
    read_user_controls(&device)
}

/// Opens the camera that `name` refers to a second time.
pub(super) fn open_device(name: &str) -> Result<Device, OpenError> {
    let path: &Path = &node::resolve_node(name)?;
    Device::open(path).map_err(|error| OpenError::from_io(path, "it cannot be opened", error))
}

fn read_user_controls(device: &Device) -> Result<Vec<CameraControl>, OpenError> {
    let all = controls::list_controls(device)
        .map_err(|error| OpenError::from_io(device.path(), "its controls cannot be listed", error))?;
    Ok(all.into_iter().filter_map(to_user_control).collect())
}

/// Converts a control to a user-adjustable one; `None` if a user would not adjust it: it is read-only, has no number, is
/// about sound, or is driver-specific.
fn to_user_control(control: Control) -> Option<CameraControl> {
    /// Ids at least this far from the first one of their class are driver-specific.
    const DRIVER_SPECIFIC: u32 = 0x1000;
    // The upper half of an id is its class. In every class ids begin at the same number, here that of `CID_BASE`.
    let is_for_users = matches!(control.id & !0xffff, sys::V4L2_CTRL_CLASS_USER | sys::V4L2_CTRL_CLASS_CAMERA)
        && control.id & 0xffff < (sys::V4L2_CID_BASE & 0xffff) + DRIVER_SPECIFIC
        && !(sys::V4L2_CID_AUDIO_VOLUME..=sys::V4L2_CID_AUDIO_LOUDNESS).contains(&control.id);
    let has_number = matches!(control.kind, Kind::Integer | Kind::Boolean | Kind::Menu | Kind::IntegerMenu);
    let Some(Value::Number(value)) = control.value else { return None };
    if !is_for_users || !has_number || control.read_only {
        return None;
    }
    let step = i64::try_from(control.step).unwrap_or(1);
    Some(CameraControl {
        value,
        range: (control.minimum, control.maximum, step),
        menu: control.items.into_iter().map(|item| (item.index, item.name)).collect(),
        is_boolean: control.kind == Kind::Boolean,
        is_active: !control.inactive && !control.grabbed,
        name: control.name,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v4l2::controls::Item;

    fn control(id: u32, kind: Kind) -> Control {
        Control {
            name: "it".into(),
            label: "It".into(),
            id,
            kind,
            minimum: 0,
            maximum: 9,
            step: 3,
            default: 0,
            items: Vec::new(),
            value: Some(Value::Number(6)),
            read_only: false,
            inactive: false,
            grabbed: false,
        }
    }

    #[test]
    fn only_what_a_person_would_turn_is_a_knob() {
        let brightness = control(sys::V4L2_CID_BRIGHTNESS, Kind::Integer);
        let turned = CameraControl {
            name: "it".into(),
            value: 6,
            range: (0, 9, 3),
            menu: Vec::new(),
            is_boolean: false,
            is_active: true,
        };
        assert_eq!(to_user_control(brightness.clone()), Some(turned.clone()));
        let grabbed = Control { grabbed: true, ..brightness.clone() };
        assert_eq!(to_user_control(grabbed), Some(CameraControl { is_active: false, ..turned.clone() }));
        let inactive = Control { inactive: true, ..brightness.clone() };
        assert_eq!(to_user_control(inactive), Some(CameraControl { is_active: false, ..turned.clone() }));
        let items = vec![Item { index: 1, name: "Manual Mode".into() }];
        let menu = Control { items, ..control(sys::V4L2_CID_EXPOSURE_AUTO, Kind::Menu) };
        assert_eq!(to_user_control(menu), Some(CameraControl { menu: vec![(1, "Manual Mode".into())], ..turned }));
        for (id, kind) in [
            (sys::V4L2_CID_BRIGHTNESS, Kind::Bitmask),
            (sys::V4L2_CID_DO_WHITE_BALANCE, Kind::Button),
            (sys::V4L2_CID_BASE + DRIVERS_OWN_EXAMPLE, Kind::Integer),
            (sys::V4L2_CID_MPEG_VIDEO_BITRATE, Kind::Integer),
            (sys::V4L2_CID_AUDIO_MUTE, Kind::Boolean),
        ] {
            assert_eq!(to_user_control(control(id, kind)), None, "{id:#x}");
        }
        assert_eq!(to_user_control(Control { read_only: true, ..brightness.clone() }), None);
        assert_eq!(to_user_control(Control { value: None, ..brightness }), None);
    }

    const DRIVERS_OWN_EXAMPLE: u32 = 0x1001;

    #[test]
    fn a_device_that_is_no_camera_has_none_and_one_that_is_not_there_is_named() {
        assert_eq!(list_user_controls("/dev/null").unwrap(), []);
        let said = set_user_control("/dev/null", "brightness", 1).unwrap_err().to_string();
        assert_eq!(said, "/dev/null: control brightness: the device has no controls");
        let said = list_user_controls("/dev/video199").unwrap_err().to_string();
        assert!(said.starts_with("there is no camera '/dev/video199'") && !said.contains('\n'), "{said}");
    }
}
