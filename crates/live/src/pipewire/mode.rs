//! The modes that a PipeWire camera offers, parsed from pods.

use pipewire::spa::param::format::{FormatProperties, MediaSubtype, MediaType};
use pipewire::spa::param::video::VideoFormat;
use pipewire::spa::pod::deserialize::PodDeserializer;
use pipewire::spa::pod::{CanonicalFixedSizedPod, ChoiceValue, Object, Value};
use pipewire::spa::utils::{Choice, ChoiceEnum, Fraction, Id, Rectangle};

/// A picture format, as the kernel's four-character code.
pub type FourCc = [u8; 4];

/// Supported formats with their PipeWire equivalents.
const FORMATS: [(FourCc, VideoFormat); 11] = [
    (*b"YUYV", VideoFormat::YUY2),
    (*b"UYVY", VideoFormat::UYVY),
    (*b"YVYU", VideoFormat::YVYU),
    (*b"NV12", VideoFormat::NV12),
    (*b"NV21", VideoFormat::NV21),
    (*b"YU12", VideoFormat::I420),
    (*b"YV12", VideoFormat::YV12),
    (*b"RGB3", VideoFormat::RGB),
    (*b"BGR3", VideoFormat::BGR),
    (*b"GREY", VideoFormat::GRAY8),
    MOTION_JPEG,
];
/// Compressed pictures are a media subtype of their own in PipeWire, not a video format.
const MOTION_JPEG: (FourCc, VideoFormat) = (*b"MJPG", VideoFormat::Encoded);

/// Returns PipeWire's name for a raw format; `None` if the format is compressed or unknown.
pub(super) fn video_format(fourcc: FourCc) -> Option<VideoFormat> {
    let found = FORMATS.iter().find(|(known, _)| *known == fourcc)?.1;
    (found != VideoFormat::Encoded).then_some(found)
}

/// The values that a camera offers for a property.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Offer<T> {
    /// Not stated.
    Unknown,
    /// Only these.
    These(Vec<T>),
    /// Every value between two.
    Range { min: T, max: T },
}

impl<T> Offer<T> {
    fn map<U>(self, change: impl Fn(T) -> U) -> Offer<U> {
        match self {
            Self::Unknown => Offer::Unknown,
            Self::These(values) => Offer::These(values.into_iter().map(change).collect()),
            Self::Range { min, max } => Offer::Range { min: change(min), max: change(max) },
        }
    }
}

/// A format with its sizes and rates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mode {
    pub fourcc: FourCc,
    /// Widths and heights, in pixels.
    pub sizes: Offer<(u32, u32)>,
    /// Pictures per second, as fractions.
    pub rates: Offer<(u32, u32)>,
}

/// The negotiated format of the pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NegotiatedFormat {
    pub fourcc: FourCc,
    /// Width and height, in pixels.
    pub size: (u32, u32),
    /// Pictures per second, as a fraction, > 0.
    pub rate: (u32, u32),
}

impl NegotiatedFormat {
    /// Returns the mode that offers only this format.
    pub fn to_mode(&self) -> Mode {
        let Self { fourcc, size, rate } = *self;
        Mode { fourcc, sizes: Offer::These(vec![size]), rates: Offer::These(vec![rate]) }
    }
}

/// Reads the negotiated format; `None` if it is not supported.
pub(super) fn parse_negotiated(format: &[u8]) -> Option<NegotiatedFormat> {
    parse_modes(format).into_iter().find_map(|Mode { fourcc, sizes, rates }| {
        let Offer::These(sizes) = sizes else { return None };
        let rate = match rates {
            // A rate of 0 means a variable rate.
            Offer::These(rates) => rates.first().copied().filter(|(num, denom)| *num > 0 && *denom > 0),
            _ => None,
        };
        Some(NegotiatedFormat { fourcc, size: *sizes.first()?, rate: rate.unwrap_or((30, 1)) })
    })
}

/// Reads the modes in one entry of a camera's list; empty if none of its formats is supported.
pub(super) fn parse_modes(pod: &[u8]) -> Vec<Mode> {
    let Ok((_, Value::Object(object))) = PodDeserializer::deserialize_any_from(pod) else { return Vec::new() };
    let id = |key: FormatProperties| match parse_ids(find_value(&object, key)) {
        Offer::These(values) => values,
        _ => Vec::new(),
    };
    if id(FormatProperties::MediaType) != [MediaType::Video.as_raw()] {
        return Vec::new();
    }
    let raw = id(FormatProperties::VideoFormat);
    // A pod may list several raw formats, but compressed ones have a subtype each.
    let is_known = |(fourcc, format): &(FourCc, VideoFormat)| match id(FormatProperties::MediaSubtype)[..] {
        [subtype] if subtype == MediaSubtype::Raw.as_raw() => {
            *fourcc != MOTION_JPEG.0 && raw.contains(&format.as_raw())
        }
        [subtype] if subtype == MediaSubtype::Mjpg.as_raw() => *fourcc == MOTION_JPEG.0,
        _ => false,
    };
    let sizes = match find_value(&object, FormatProperties::VideoSize) {
        Some(Value::Rectangle(size)) => Offer::These(vec![*size]),
        Some(Value::Choice(ChoiceValue::Rectangle(choice))) => parse_offer(choice),
        _ => Offer::Unknown,
    };
    let rates = match find_value(&object, FormatProperties::VideoFramerate) {
        Some(Value::Fraction(rate)) => Offer::These(vec![*rate]),
        Some(Value::Choice(ChoiceValue::Fraction(choice))) => parse_offer(choice),
        _ => Offer::Unknown,
    };
    let sizes = sizes.map(|Rectangle { width, height }| (width, height));
    let rates = rates.map(|Fraction { num, denom }| (num, denom));
    let mode =
        |(fourcc, _): &(FourCc, VideoFormat)| Mode { fourcc: *fourcc, sizes: sizes.clone(), rates: rates.clone() };
    FORMATS.iter().filter(|known| is_known(known)).map(mode).collect()
}

fn find_value(object: &Object, key: FormatProperties) -> Option<&Value> {
    object.properties.iter().find(|property| property.key == key.as_raw()).map(|property| &property.value)
}

fn parse_ids(value: Option<&Value>) -> Offer<u32> {
    match value {
        Some(Value::Id(id)) => Offer::These(vec![id.0]),
        Some(Value::Choice(ChoiceValue::Id(choice))) => parse_offer(choice).map(|Id(id)| id),
        _ => Offer::Unknown,
    }
}

/// Converts a choice, without repetitions: the preferred value is usually also among the alternatives.
fn parse_offer<T: CanonicalFixedSizedPod + Copy + PartialEq>(Choice(_, choice): &Choice<T>) -> Offer<T> {
    match choice {
        ChoiceEnum::None(value) => Offer::These(vec![*value]),
        ChoiceEnum::Range { min, max, .. } | ChoiceEnum::Step { min, max, .. } => Offer::Range { min: *min, max: *max },
        ChoiceEnum::Enum { default, alternatives } => {
            let mut values = Vec::new();
            for value in std::iter::once(default).chain(alternatives) {
                if !values.contains(value) {
                    values.push(*value);
                }
            }
            Offer::These(values)
        }
        ChoiceEnum::Flags { .. } => Offer::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipewire::param;

    #[test]
    fn what_is_written_is_read() {
        for (fourcc, _) in FORMATS {
            let one = NegotiatedFormat { fourcc, size: (1280, 720), rate: (30_000, 1001) };
            let pod = param::build_format(&one);
            assert_eq!((parse_modes(&pod), parse_negotiated(&pod)), (vec![one.to_mode()], Some(one)));
            let several = |sizes: [(u32, u32); 2]| Mode {
                fourcc,
                sizes: Offer::These(sizes.to_vec()),
                rates: Offer::Range { min: (0, 1), max: (60, 1) },
            };
            // The preferred value comes first.
            let [small, large] = [(640, 480), one.size];
            assert_eq!(parse_modes(&param::build_offer(&several([small, large]), &one)), [several([large, small])]);
            let silent = Mode { fourcc, sizes: Offer::Unknown, rates: Offer::Unknown };
            assert_eq!(
                (parse_modes(&param::build_offer(&silent, &one)), parse_negotiated(&param::build_offer(&silent, &one))),
                (vec![silent], None)
            );
        }
    }

    #[test]
    fn what_is_no_list_of_formats_has_none() {
        assert_eq!(parse_modes(&param::build_header_request()), []);
        assert_eq!(parse_modes(&[]), []);
        assert_eq!(parse_modes(&[8, 0, 0, 0, 15]), []);
    }
}
