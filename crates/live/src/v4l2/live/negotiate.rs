//! Selection of a camera's mode, by the bandwidth of its connection.

use std::cmp::Ordering;

use crate::layout::{Content, Family};
use crate::v4l2::FourCc;
use crate::v4l2::modes::{FormatModes, Interval, QueueKind, Rates, SizeModes, Sizes};

/// Constraints on a camera's mode. Open ones are chosen automatically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeRequest {
    pub content: Content,
    /// Width and height, in pixels.
    pub size_px: Option<(u32, u32)>,
    pub fps: Option<f64>,
    pub fourcc: Option<FourCc>,
}

impl ModeRequest {
    /// Constrains only the content.
    pub fn for_content(content: Content) -> Self {
        Self { content, size_px: None, fps: None, fourcc: None }
    }
}

/// The bandwidth of a camera's connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkSpeed {
    /// USB 2 or slower, or unknown: raw pictures beyond VGA exceed its bandwidth.
    Slow,
    /// USB 3, or an internal connection.
    Fast,
}

/// A mode to request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    pub queue: QueueKind,
    pub fourcc: FourCc,
    /// Width and height, in pixels.
    pub size_px: (u32, u32),
    /// Time between frames.
    pub interval: Interval,
}

/// Why no mode is usable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoMode {
    #[error("it offers no picture format; a virtual camera offers one only while something writes to it")]
    Nothing,
    /// No offered format can be read.
    #[error("it offers {offered}, but only {readable} can be read as {as_what}{way_out}")]
    Unreadable { offered: String, as_what: &'static str, readable: String, way_out: &'static str },
    /// The requested format is not offered, or cannot be read.
    #[error("{}; choose --format from {offered}", refuse_format(*wanted, *is_offered))]
    Format {
        /// The requested format.
        wanted: FourCc,
        is_offered: bool,
        /// What is offered and can be read.
        offered: String,
    },
}

fn refuse_format(wanted: FourCc, is_offered: bool) -> String {
    match is_offered {
        true => format!("{wanted} cannot be read here"),
        false => format!("it does not offer {wanted}"),
    }
}

/// Decodes what this program cannot, such as H.264.
const BY_FFMPEG: &str = "; let ffmpeg decode it: ffmpeg -f v4l2 -i NODE -f yuv4mpegpipe - | bokehcam stream -";
/// Used where the request leaves size or rate open.
const DEFAULT_SIZE_PX: (u32, u32) = (1280, 720);
const DEFAULT_FPS: f64 = 30.0;
/// USB 2 carries raw pictures up to this size and rate, in pixels per second: 30 fps, with a margin for rounded rates.
const VGA_PX_PER_S: f64 = 640.0 * 480.0 * 30.5;
/// Logarithm of the ratio of two rates below which viewers see no difference: about a tenth.
const SAME_RATE: f64 = 0.1;

/// Ranks the best mode of each readable format, the best of all first; never empty.
///
/// # Errors
/// No mode is usable.
pub fn rank_modes(modes: &[FormatModes], request: &ModeRequest, link_speed: LinkSpeed) -> Result<Vec<Choice>, NoMode> {
    let readable = |fourcc: FourCc| fourcc.content() == Some(request.content);
    let suits = |format: &&FormatModes| readable(format.fourcc) && request.fourcc.is_none_or(|f| f == format.fourcc);
    let mut best: Vec<(ModePenalties, Choice)> =
        modes.iter().filter(suits).filter_map(|format| find_best_mode(format, request, link_speed)).collect();
    if best.is_empty() {
        let offered = join_names(modes.iter().map(|format| format.fourcc));
        let readable_offered = join_names(modes.iter().map(|format| format.fourcc).filter(|fourcc| readable(*fourcc)));
        let is_foreign = modes.iter().all(|format| format.fourcc.content().is_none());
        return Err(match request.fourcc {
            _ if modes.is_empty() => NoMode::Nothing,
            Some(wanted) if !readable_offered.is_empty() => {
                let is_offered = modes.iter().any(|format| format.fourcc == wanted);
                NoMode::Format { wanted, is_offered, offered: readable_offered }
            }
            _ => NoMode::Unreadable {
                offered,
                as_what: if request.content == Content::Color { "colours" } else { "depth" },
                readable: join_names(FourCc::supported_formats().filter(|fourcc| readable(*fourcc))),
                way_out: if request.content == Content::Color && is_foreign { BY_FFMPEG } else { "" },
            },
        });
    }
    best.sort_by(|(a, _), (b, _)| compare_penalties(a, b));
    Ok(best.into_iter().map(|(_, choice)| choice).collect())
}

/// Penalties of a mode, the most important first; compared lexicographically, the smallest wins.
type ModePenalties = [f64; 6];

fn compare_penalties(a: &ModePenalties, b: &ModePenalties) -> Ordering {
    a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// Finds the mode of a format that is nearest to the request.
fn find_best_mode(
    format: &FormatModes,
    request: &ModeRequest,
    link_speed: LinkSpeed,
) -> Option<(ModePenalties, Choice)> {
    let wanted_px = request.size_px.unwrap_or(DEFAULT_SIZE_PX);
    let modes: Vec<((u32, u32), &Rates)> = match &format.sizes {
        Sizes::Unknown => vec![(wanted_px, &Rates::Unknown)],
        Sizes::Discrete(sizes) => sizes.iter().map(|SizeModes { size_px, rates }| (*size_px, rates)).collect(),
        Sizes::Range { min_px, max_px, step_px, rates } => {
            // The nearest value on the grid, even where a driver has swapped its limits.
            let on_grid = |wanted: u32, min: u32, max: u32, step: u32| {
                let steps = (wanted.clamp(min, max.max(min)) - min + step / 2) / step.max(1);
                (min + steps * step).min(max.max(min))
            };
            let width = on_grid(wanted_px.0, min_px.0, max_px.0, step_px.0);
            let height = on_grid(wanted_px.1, min_px.1, max_px.1, step_px.1);
            vec![((width, height), rates)]
        }
    };
    let ranked =
        modes.into_iter().map(|(size_px, rates)| rank_mode(format, size_px, rates, wanted_px, request, link_speed));
    ranked.min_by(|(a, _), (b, _)| compare_penalties(a, b))
}

/// Returns the penalties of a format at one of its sizes, and the mode to request there: the rate nearest to the
/// request.
fn rank_mode(
    format: &FormatModes,
    size_px: (u32, u32),
    rates: &Rates,
    wanted_px: (u32, u32),
    request: &ModeRequest,
    link_speed: LinkSpeed,
) -> (ModePenalties, Choice) {
    let wanted = Interval::from_fps(request.fps.unwrap_or(DEFAULT_FPS));
    // Where the driver lists no rates, the requested one is as good as any.
    let interval = rates.nearest_interval(wanted).unwrap_or(wanted);
    let choice = Choice { queue: format.queue, fourcc: format.fourcc, size_px, interval };
    let log_ratio = |a: f64, b: f64| (a / b).ln();
    let if_visible = |distance: f64| if distance < SAME_RATE { 0.0 } else { distance };
    // Negative, and so no penalty, where the mode is faster.
    let slower = if_visible(log_ratio(wanted.fps(), interval.fps()));
    let rate_error = if_visible(log_ratio(wanted.fps(), interval.fps()).abs());
    let size_error =
        log_ratio(size_px.0.into(), wanted_px.0.into()).abs() + log_ratio(size_px.1.into(), wanted_px.1.into()).abs();
    // A requested size is kept, however slow; otherwise a fluent picture matters more.
    let (first, second) = if request.size_px.is_some() { (size_error, slower) } else { (slower, size_error) };
    let preference = format_preference(format.fourcc, &choice, link_speed);
    let emulated = f64::from(u8::from(format.emulated));
    let multi_planar = f64::from(u8::from(format.queue == QueueKind::MultiPlanar));
    ([first, second, rate_error, emulated, preference, multi_planar], choice)
}

/// Returns the preference of a format among those with the same size and rate: its index among the supported ones,
/// unless it is moved before (-100) or behind (1000) all of them.
fn format_preference(fourcc: FourCc, choice: &Choice, link_speed: LinkSpeed) -> f64 {
    let place = FourCc::supported_formats().position(|supported| supported == fourcc).unwrap_or(usize::MAX) as f64;
    let px_per_s = f64::from(choice.size_px.0) * f64::from(choice.size_px.1) * choice.interval.fps();
    let raw_fits = link_speed == LinkSpeed::Fast || px_per_s <= VGA_PX_PER_S;
    match fourcc.family() {
        // Grey only where no colour format exists.
        Some(Family::Grey) => 1000.0,
        // Compressed first where the connection does not carry raw pictures.
        Some(Family::Jpeg) if !raw_fits => place - 100.0,
        _ => place,
    }
}

/// Joins the names without repetitions, for messages.
fn join_names(fourccs: impl Iterator<Item = FourCc>) -> String {
    let mut names: Vec<String> = Vec::new();
    for name in fourccs.map(|fourcc| fourcc.to_string()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every(denominator: u32) -> Interval {
        Interval { numerator: 1, denominator }
    }

    fn format(fourcc: &[u8; 4], sizes: &[(u32, u32, &[u32])]) -> FormatModes {
        let size = |&(width, height, fps): &(u32, u32, &[u32])| SizeModes {
            size_px: (width, height),
            rates: Rates::Discrete(fps.iter().map(|fps| every(*fps)).collect()),
        };
        FormatModes {
            queue: QueueKind::SinglePlanar,
            fourcc: FourCc(*fourcc),
            description: String::new(),
            emulated: false,
            sizes: Sizes::Discrete(sizes.iter().map(size).collect()),
        }
    }

    /// A common office camera on USB 2: raw pictures get slow as they grow.
    fn office() -> Vec<FormatModes> {
        vec![
            format(b"YUYV", &[(640, 480, &[30, 24, 15]), (1280, 720, &[10, 5]), (1920, 1080, &[5]), (320, 240, &[30])]),
            format(b"MJPG", &[(640, 480, &[30, 15]), (1280, 720, &[60, 30]), (1920, 1080, &[30]), (320, 240, &[30])]),
            format(b"H264", &[(1920, 1080, &[30])]),
        ]
    }

    /// A laptop's camera without compression.
    fn raw_only() -> Vec<FormatModes> {
        vec![format(b"YUYV", &[(640, 480, &[30]), (1280, 720, &[10]), (352, 288, &[30])])]
    }

    /// A capture box on USB 3.
    fn capture_box() -> Vec<FormatModes> {
        vec![
            format(b"MJPG", &[(1920, 1080, &[60, 30]), (1280, 720, &[60, 30])]),
            format(b"YUYV", &[(1920, 1080, &[60, 30]), (1280, 720, &[60, 30])]),
            format(b"NV12", &[(1920, 1080, &[60, 30]), (1280, 720, &[60, 30])]),
        ]
    }

    fn request(size_px: Option<(u32, u32)>, fps: Option<f64>, fourcc: Option<&[u8; 4]>) -> ModeRequest {
        ModeRequest { content: Content::Color, size_px, fps, fourcc: fourcc.map(|f| FourCc(*f)) }
    }

    fn chosen(modes: &[FormatModes], request: ModeRequest, link_speed: LinkSpeed) -> String {
        let best = rank_modes(modes, &request, link_speed).unwrap()[0];
        format!("{}x{} {} {}", best.size_px.0, best.size_px.1, best.fourcc, best.interval)
    }

    #[test]
    fn cameras_on_a_narrow_wire_compress_what_is_large() {
        let any = request(None, None, None);
        assert_eq!(chosen(&office(), any, LinkSpeed::Slow), "1280x720 MJPG 30");
        let vga = request(Some((640, 480)), None, None);
        assert_eq!(chosen(&office(), vga, LinkSpeed::Slow), "640x480 YUYV 30");
        let full = request(Some((1920, 1080)), None, None);
        assert_eq!(chosen(&office(), full, LinkSpeed::Slow), "1920x1080 MJPG 30");
        assert_eq!(chosen(&capture_box(), any, LinkSpeed::Slow), "1280x720 MJPG 30");
        assert_eq!(chosen(&capture_box(), any, LinkSpeed::Fast), "1280x720 NV12 30");
        assert_eq!(chosen(&capture_box(), request(None, Some(60.0), None), LinkSpeed::Fast), "1280x720 NV12 60");
    }

    #[test]
    fn without_a_wish_the_picture_is_fluent_and_a_wish_is_kept() {
        assert_eq!(chosen(&raw_only(), request(None, None, None), LinkSpeed::Slow), "640x480 YUYV 30");
        assert_eq!(chosen(&raw_only(), request(Some((1280, 720)), None, None), LinkSpeed::Slow), "1280x720 YUYV 10");
        assert_eq!(chosen(&raw_only(), request(None, Some(10.0), None), LinkSpeed::Slow), "1280x720 YUYV 10");
        assert_eq!(chosen(&office(), request(None, None, Some(b"YUYV")), LinkSpeed::Slow), "640x480 YUYV 30");
        assert_eq!(
            chosen(&office(), request(Some((1280, 700)), Some(60.0), None), LinkSpeed::Slow),
            "1280x720 MJPG 60"
        );
        assert_eq!(chosen(&office(), request(Some((4000, 3000)), None, None), LinkSpeed::Slow), "1920x1080 MJPG 30");
    }

    #[test]
    fn every_format_is_there_to_fall_back_on() {
        let all = rank_modes(&office(), &request(None, None, None), LinkSpeed::Slow).unwrap();
        let formats: Vec<String> = all.iter().map(|choice| choice.fourcc.to_string()).collect();
        assert_eq!(formats, ["MJPG", "YUYV"]);
    }

    #[test]
    fn grids_and_unknown_sizes_take_the_wish() {
        let sizes = Sizes::Range { min_px: (16, 16), max_px: (3840, 2160), step_px: (2, 2), rates: Rates::Unknown };
        let grid = vec![FormatModes { sizes, ..format(b"NV12", &[]) }];
        assert_eq!(chosen(&grid, request(None, None, None), LinkSpeed::Fast), "1280x720 NV12 30");
        assert_eq!(chosen(&grid, request(Some((641, 10)), Some(29.97), None), LinkSpeed::Fast), "642x16 NV12 29.97");
        assert_eq!(chosen(&grid, request(Some((9000, 9000)), None, None), LinkSpeed::Fast), "3840x2160 NV12 30");
        let unknown = vec![FormatModes { sizes: Sizes::Unknown, ..format(b"YU12", &[]) }];
        assert_eq!(chosen(&unknown, request(Some((800, 600)), None, None), LinkSpeed::Slow), "800x600 YU12 30");
    }

    #[test]
    fn grey_and_multi_planar_come_last_and_emulated_formats_after_real_ones() {
        let sizes: &[(u32, u32, &[u32])] = &[(640, 480, &[30])];
        let any = request(None, None, None);
        let both = vec![format(b"GREY", sizes), format(b"YUYV", sizes)];
        assert_eq!(chosen(&both, any, LinkSpeed::Fast), "640x480 YUYV 30");
        assert_eq!(chosen(&both[..1], any, LinkSpeed::Fast), "640x480 GREY 30");
        let emulated = FormatModes { emulated: true, ..format(b"NV12", sizes) };
        assert_eq!(chosen(&[emulated, format(b"YUYV", sizes)], any, LinkSpeed::Fast), "640x480 YUYV 30");
        let multi = FormatModes { queue: QueueKind::MultiPlanar, ..format(b"YUYV", sizes) };
        let best = rank_modes(&[multi, format(b"YUYV", sizes)], &any, LinkSpeed::Fast).unwrap();
        assert_eq!(best[0].queue, QueueKind::SinglePlanar);
    }

    #[test]
    fn what_cannot_be_had_is_said_with_what_can() {
        let refusal =
            |modes: &[FormatModes], request| rank_modes(modes, &request, LinkSpeed::Fast).unwrap_err().to_string();
        let refused = refusal(&office(), request(None, None, Some(b"NV12")));
        assert_eq!(refused, "it does not offer NV12; choose --format from YUYV, MJPG");
        let refused = refusal(&office(), request(None, None, Some(b"H264")));
        assert_eq!(refused, "H264 cannot be read here; choose --format from YUYV, MJPG");
        let unreadable = refusal(&[format(b"H264", &[(640, 480, &[30])])], request(None, None, None));
        assert!(unreadable.starts_with("it offers H264, but only"), "{unreadable}");
        assert!(unreadable.ends_with("-f yuv4mpegpipe - | bokehcam stream -"), "{unreadable}");
        assert!(refusal(&[], request(None, None, None)).contains("virtual camera"));
        let depth = ModeRequest::for_content(Content::Depth);
        assert!(refusal(&office(), depth).ends_with("but only Z16, Y16 can be read as depth"));
    }
}
