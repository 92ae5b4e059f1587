//! Builds PipeWire's descriptions of formats and buffers (*pods*).

use pipewire::spa::param::ParamType;
use pipewire::spa::param::format::{FormatProperties, MediaSubtype, MediaType};
use pipewire::spa::pod::serialize::PodSerializer;
use pipewire::spa::pod::{CanonicalFixedSizedPod, ChoiceValue, Object, Property, Value};
use pipewire::spa::sys;
use pipewire::spa::utils::{Choice, ChoiceEnum, ChoiceFlags, Fraction, Id, Rectangle, SpaTypes};

use super::mode::{self, Mode, NegotiatedFormat, Offer};

/// Number of buffers: default, minimum and maximum. Readers may hold that many at once.
const BUFFERS: (i32, i32, i32) = (4, 2, 16);

/// Builds one picture format with one size and one rate: browsers and OBS list no camera that leaves one of them open.
pub fn build_format(negotiated: &NegotiatedFormat) -> Vec<u8> {
    build_offer(&negotiated.to_mode(), negotiated)
}

/// Builds the EnumFormat pod that offers `mode`; `best` is the default of each choice.
pub fn build_offer(mode: &Mode, best: &NegotiatedFormat) -> Vec<u8> {
    let id = |key: FormatProperties, value: u32| Property::new(key.as_raw(), Value::Id(Id(value)));
    let raw = mode::video_format(mode.fourcc);
    let subtype = if raw.is_some() { MediaSubtype::Raw } else { MediaSubtype::Mjpg };
    serialize_object(
        SpaTypes::ObjectParamFormat,
        ParamType::EnumFormat,
        [
            Some(id(FormatProperties::MediaType, MediaType::Video.as_raw())),
            Some(id(FormatProperties::MediaSubtype, subtype.as_raw())),
            raw.map(|format| id(FormatProperties::VideoFormat, format.as_raw())),
            to_choice(&mode.sizes, best.size, |(width, height)| Rectangle { width, height })
                .map(|sizes| value_or_choice(sizes, Value::Rectangle, ChoiceValue::Rectangle))
                .map(|sizes| Property::new(FormatProperties::VideoSize.as_raw(), sizes)),
            to_choice(&mode.rates, best.rate, |(num, denom)| Fraction { num, denom })
                .map(|rates| value_or_choice(rates, Value::Fraction, ChoiceValue::Fraction))
                .map(|rates| Property::new(FormatProperties::VideoFramerate.as_raw(), rates)),
        ]
        .into_iter()
        .flatten()
        .collect(),
    )
}

/// Converts an offer to PipeWire's representation: a single value becomes [`ChoiceEnum::None`].
fn to_choice<T: CanonicalFixedSizedPod>(
    offer: &Offer<(u32, u32)>,
    best: (u32, u32),
    value: impl Fn((u32, u32)) -> T,
) -> Option<ChoiceEnum<T>> {
    match offer {
        Offer::Unknown => None,
        Offer::These(all) => match all[..] {
            [] => None,
            [only] => Some(ChoiceEnum::None(value(only))),
            [first, ..] => Some(ChoiceEnum::Enum {
                default: value(if all.contains(&best) { best } else { first }),
                alternatives: all.iter().map(|one| value(*one)).collect(),
            }),
        },
        Offer::Range { min, max } => {
            Some(ChoiceEnum::Range { default: value(best), min: value(*min), max: value(*max) })
        }
    }
}

/// Wraps a single value as such, and several as a choice.
fn value_or_choice<T: CanonicalFixedSizedPod>(
    values: ChoiceEnum<T>,
    one: impl Fn(T) -> Value,
    several: impl Fn(Choice<T>) -> ChoiceValue,
) -> Value {
    match values {
        ChoiceEnum::None(value) => one(value),
        values => Value::Choice(several(Choice(ChoiceFlags::empty(), values))),
    }
}

/// Types of memory, as bits.
const MEMORY: i32 = (1 << sys::SPA_DATA_MemFd) | (1 << sys::SPA_DATA_MemPtr);
const DMA_BUF: i32 = 1 << sys::SPA_DATA_DmaBuf;

/// Describes buffers with the layout chosen by the other side: in memory, or else in DMA-BUFs. In a single choice, a camera
/// that has both would take the latter, which processors may read slowly.
///
/// The DMA-BUFs are linear, as a processor reads them: formats without a modifier, as [`build_offer`] has them, say so.
pub fn build_any_buffers() -> [Vec<u8>; 2] {
    [MEMORY, DMA_BUF].map(|types| {
        serialize_object(
            SpaTypes::ObjectParamBuffers,
            ParamType::Buffers,
            vec![buffer_count_property(), memory_type_property(types)],
        )
    })
}

/// Describes buffers with one plane in memory, of `frame_bytes` bytes with `stride` bytes per row.
pub fn build_buffers(frame_bytes: i32, stride: i32) -> Vec<u8> {
    let int = |key, value| Property::new(key, Value::Int(value));
    serialize_object(
        SpaTypes::ObjectParamBuffers,
        ParamType::Buffers,
        vec![
            buffer_count_property(),
            int(sys::SPA_PARAM_BUFFERS_blocks, 1),
            int(sys::SPA_PARAM_BUFFERS_size, frame_bytes),
            int(sys::SPA_PARAM_BUFFERS_stride, stride),
            memory_type_property(MEMORY),
        ],
    )
}

fn buffer_count_property() -> Property {
    let (default, min, max) = BUFFERS;
    choice_property(sys::SPA_PARAM_BUFFERS_buffers, ChoiceEnum::Range { default, min, max })
}

fn memory_type_property(types: i32) -> Property {
    choice_property(sys::SPA_PARAM_BUFFERS_dataType, ChoiceEnum::Flags { default: types, flags: vec![] })
}

fn choice_property(key: u32, choice: ChoiceEnum<i32>) -> Property {
    Property::new(key, Value::Choice(ChoiceValue::Int(Choice(ChoiceFlags::empty(), choice))))
}

/// Requests a header with each buffer, for the picture's time stamp and sequence number.
pub fn build_header_request() -> Vec<u8> {
    let bytes = size_of::<sys::spa_meta_header>() as i32;
    serialize_object(
        SpaTypes::ObjectParamMeta,
        ParamType::Meta,
        vec![
            Property::new(sys::SPA_PARAM_META_type, Value::Id(Id(sys::SPA_META_Header))),
            Property::new(sys::SPA_PARAM_META_size, Value::Int(bytes)),
        ],
    )
}

fn serialize_object(kind: SpaTypes, id: ParamType, properties: Vec<Property>) -> Vec<u8> {
    let object = Value::Object(Object { type_: kind.as_raw(), id: id.as_raw(), properties });
    let written = PodSerializer::serialize(std::io::Cursor::new(Vec::new()), &object);
    // Writing to memory does not fail.
    written.map(|(pod, _)| pod.into_inner()).unwrap_or_default()
}
