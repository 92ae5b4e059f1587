//! Formats and buffers in PipeWire's own notation (*pods*).

use pipewire::spa::param::ParamType;
use pipewire::spa::param::format::{FormatProperties, MediaSubtype, MediaType};
use pipewire::spa::pod::serialize::PodSerializer;
use pipewire::spa::pod::{ChoiceValue, Object, Property, Value};
use pipewire::spa::sys;
use pipewire::spa::utils::{Choice, ChoiceEnum, ChoiceFlags, Fraction, Id, Rectangle, SpaTypes};

use super::mode::{self, FourCc};

/// Buffers that are asked for, fewest to most: as many as readers may hold at once.
const BUFFERS: (i32, i32, i32) = (4, 2, 16);

/// One picture format with one size and one rate (pictures per second as a fraction): browsers and OBS list no camera
/// that leaves one of them open.
pub fn format(fourcc: FourCc, (width, height): (u32, u32), (num, denom): (u32, u32)) -> Vec<u8> {
    let id = |key: FormatProperties, value: u32| Property::new(key.as_raw(), Value::Id(Id(value)));
    let raw = mode::video_format(fourcc);
    let subtype = if raw.is_some() { MediaSubtype::Raw } else { MediaSubtype::Mjpg };
    object(
        SpaTypes::ObjectParamFormat,
        ParamType::EnumFormat,
        [
            Some(id(FormatProperties::MediaType, MediaType::Video.as_raw())),
            Some(id(FormatProperties::MediaSubtype, subtype.as_raw())),
            raw.map(|format| id(FormatProperties::VideoFormat, format.as_raw())),
            Some(Property::new(FormatProperties::VideoSize.as_raw(), Value::Rectangle(Rectangle { width, height }))),
            Some(Property::new(FormatProperties::VideoFramerate.as_raw(), Value::Fraction(Fraction { num, denom }))),
        ]
        .into_iter()
        .flatten()
        .collect(),
    )
}

/// Buffers in memory, as the other side lays them out.
pub fn any_buffers() -> Vec<u8> {
    object(SpaTypes::ObjectParamBuffers, ParamType::Buffers, vec![number_of_buffers(), in_memory()])
}

/// Buffers of one plane in memory.
pub fn buffers(frame_bytes: i32, stride: i32) -> Vec<u8> {
    let int = |key, value| Property::new(key, Value::Int(value));
    object(
        SpaTypes::ObjectParamBuffers,
        ParamType::Buffers,
        vec![
            number_of_buffers(),
            int(sys::SPA_PARAM_BUFFERS_blocks, 1),
            int(sys::SPA_PARAM_BUFFERS_size, frame_bytes),
            int(sys::SPA_PARAM_BUFFERS_stride, stride),
            in_memory(),
        ],
    )
}

fn number_of_buffers() -> Property {
    let (default, min, max) = BUFFERS;
    choice(sys::SPA_PARAM_BUFFERS_buffers, ChoiceEnum::Range { default, min, max })
}

fn in_memory() -> Property {
    let default = (1 << sys::SPA_DATA_MemFd) | (1 << sys::SPA_DATA_MemPtr);
    choice(sys::SPA_PARAM_BUFFERS_dataType, ChoiceEnum::Flags { default, flags: vec![] })
}

fn choice(key: u32, choice: ChoiceEnum<i32>) -> Property {
    Property::new(key, Value::Choice(ChoiceValue::Int(Choice(ChoiceFlags::empty(), choice))))
}

/// A header with each buffer, for time and number of the picture.
pub fn header() -> Vec<u8> {
    let bytes = size_of::<sys::spa_meta_header>() as i32;
    object(
        SpaTypes::ObjectParamMeta,
        ParamType::Meta,
        vec![
            Property::new(sys::SPA_PARAM_META_type, Value::Id(Id(sys::SPA_META_Header))),
            Property::new(sys::SPA_PARAM_META_size, Value::Int(bytes)),
        ],
    )
}

fn object(kind: SpaTypes, id: ParamType, properties: Vec<Property>) -> Vec<u8> {
    let object = Value::Object(Object { type_: kind.as_raw(), id: id.as_raw(), properties });
    let written = PodSerializer::serialize(std::io::Cursor::new(Vec::new()), &object);
    // Writing to memory does not fail.
    written.map(|(pod, _)| pod.into_inner()).unwrap_or_default()
}
