//! Warnings of valid but implausible input: numbers in the wrong unit, and pictures in the wrong place.
//!
//! Each is one line, and never an error.

use std::fmt::Display;
use std::path::Path;

use super::log;
use bokehcam::color::luminance;
use bokehcam::depth::focus::FocusRule;
use bokehcam::files::place;
use bokehcam::frame::{ColorImage, DepthMap, Mask};
use bokehcam::look::{Look, Strength};
use bokehcam::optics::{Lens, StereoRig};
use bokehcam::source::options::DEPTH_SCALE;
use bokehcam::source::{self, DepthOrigin, Options, PlateFile, SingleCameraDepth, Source};

/// Tolerance below which grey values (0 to 1) count as equal.
const TOLERANCE: f32 = 0.02;
/// Maximum plausible baseline, in metres, of a camera that is carried or driven.
const MAX_BASELINE_M: f32 = 3.0;
/// Minimum plausible size of lens and sensor: smaller values have another unit.
const MIN_LENS_MM: f32 = 0.5;
/// Quantile for the largest distance of a map: the farthest pixels may be wrong.
const FAR_QUANTILE: f32 = 0.98;
/// If all depth is nearer than this, in metres, the map has another unit than assumed.
const MIN_FAR_M: f32 = 1.0;
/// A foreground that covers more of the picture than this and has a more ragged outline is no person in front of the
/// plate.
const MAX_FOREGROUND: f32 = 0.2;
const MAX_RAGGEDNESS: f32 = 16.0;
/// A person in a plate covers at least this share of it.
const MIN_PERSON: f32 = 0.01;

/// Warns of an implausibly wide baseline.
pub fn warn_of_baseline(rig: Option<StereoRig>) {
    rig.and_then(|rig| check_baseline(&rig)).iter().for_each(|line| log::warn(line));
}

fn check_baseline(rig: &StereoRig) -> Option<String> {
    let StereoRig { baseline_m, metric, .. } = *rig;
    let is_wide = metric && baseline_m > MAX_BASELINE_M;
    is_wide.then(|| {
        format!(
            "{baseline_m} m between the cameras; if that is in millimetres, it is {} \
                             m",
            baseline_m / 1e3
        )
    })
}

/// Warns of a lens in another unit, or one that cannot focus as near as requested.
pub fn warn_of_lens(look: &Look) {
    let Strength::Lens(lens) = look.strength else { return };
    check_lens(&lens, look.focus).iter().for_each(|line| log::warn(line));
}

fn check_lens(lens: &Lens, focus: FocusRule) -> Option<String> {
    let Lens { focal_length_mm, sensor_width_mm, .. } = *lens;
    let small = [("focal-length", focal_length_mm), ("sensor-width", sensor_width_mm)];
    if let Some((name, mm)) = small.into_iter().find(|(_, mm)| *mm < MIN_LENS_MM) {
        return Some(format!("--{name} {mm} is in millimetres; if that is in metres, it is {}", mm * 1e3));
    }
    match focus {
        FocusRule::Metres(focus_m) if focus_m * 1e3 <= focal_length_mm => Some(format!(
            "--focus {focus_m}: a lens of {focal_length_mm} mm cannot focus nearer than {} m",
            focal_length_mm / 1e3
        )),
        _ => None,
    }
}

/// Warns of a scale that is the inverse of units per metre.
pub fn warn_of_depth_scale(scale: Option<f32>) {
    if let Some(scale) = scale.filter(|scale| *scale < 1.0) {
        log::warn(&format!(
            "--depth-scale {scale} is units per metre; if a unit has {scale} m, there are {} to a metre",
            (1.0 / scale).round()
        ));
    }
}

/// Warns of a mask without information.
pub fn warn_of_mask(file: &Path, mask: &Mask, color: &ColorImage) {
    check_mask(mask, color).iter().for_each(|what| log::warn(&format!("{}: {what}", file.display())));
}

fn check_mask(mask: &Mask, color: &ColorImage) -> Option<&'static str> {
    let (low, high) = value_range(&mask.alpha)?;
    match () {
        () if low > 1.0 - TOLERANCE => {
            Some("the mask is white all over: the whole picture is the subject, and stays sharp")
        }
        () if high < TOLERANCE => Some("the mask is black all over: there is no subject, and everything is blurred"),
        () if high - low < TOLERANCE => {
            Some("the mask is one grey all over: it separates no subject from the background")
        }
        () if is_luma_copy(&mask.alpha, mask.width, color) => Some("this is the picture itself, not a mask of it"),
        () => None,
    }
}

/// Returns the smallest and the largest of the known values.
fn value_range(values: &[f32]) -> Option<(f32, f32)> {
    let mut known = values.iter().copied().filter(|value| value.is_finite());
    let first = known.next()?;
    Some(known.fold((first, first), |(low, high), value| (low.min(value), high.max(value))))
}

/// Whether the values (0 to 1, row by row) equal the picture's luma.
fn is_luma_copy(values: &[f32], width: u32, color: &ColorImage) -> bool {
    if width != color.width || values.len() != color.rgb.len() / 3 {
        return false;
    }
    let sum: f32 = values.iter().zip(luma_values(color)).map(|(value, grey)| (value - grey).abs()).sum();
    sum <= 0.5 * TOLERANCE * values.len() as f32
}

/// Returns the luma of each pixel (0 to 1), from the gamma-encoded codes.
fn luma_values(color: &ColorImage) -> impl Iterator<Item = f32> {
    color.rgb.as_chunks::<3>().0.iter().map(|pixel| {
        let [r, g, b] = pixel.map(|code| f32::from(code) / 255.0);
        luminance(r, g, b)
    })
}

/// Warns of depth without distances, or with distances in another unit; `is_unit_known` skips the latter. Returns
/// whether it did.
pub fn warn_of_map(name: &dyn Display, map: &DepthMap, is_unit_known: bool) -> bool {
    check_map(map, is_unit_known).iter().inspect(|what| log::warn(&format!("{name}: {what}"))).count() > 0
}

fn check_map(map: &DepthMap, is_unit_known: bool) -> Option<String> {
    let mut known: Vec<f32> = map.metres.iter().copied().filter(|&metres| DepthMap::is_known(metres)).collect();
    let Some((nearest_m, farthest_m)) = value_range(&known) else {
        return Some("no depth is known anywhere in it".to_owned());
    };
    if farthest_m - nearest_m <= 1e-3 * farthest_m {
        return Some(format!("all of it is {nearest_m:.3} m away, so nothing is nearer than the rest"));
    }
    let at = (FAR_QUANTILE * (known.len() - 1) as f32) as usize;
    let far_m = *known.select_nth_unstable_by(at, f32::total_cmp).1;
    (!is_unit_known && far_m < MIN_FAR_M).then(|| {
        format!(
            "at {DEPTH_SCALE} units per metre all of it is nearer than {far_m:.2} m; if it is in millimetres, add --depth-scale 1000"
        )
    })
}

/// Warns of inverse depth that is constant or a copy of the picture. Returns whether it did.
pub fn warn_of_inverse(name: &dyn Display, map: &DepthMap, color: &ColorImage) -> bool {
    check_inverse(map, color).iter().inspect(|what| log::warn(&format!("{name}: {what}"))).count() > 0
}

fn check_inverse(map: &DepthMap, color: &ColorImage) -> Option<&'static str> {
    let nearness: Vec<f32> = map.metres.iter().map(|&metres| DepthMap::SUBJECT_M / metres).collect();
    let (low, high) = value_range(&nearness)?;
    if high - low < 1e-3 {
        return Some("it has one value all over, so nothing is nearer than the rest");
    }
    // Pearson's correlation is independent of the map's scale.
    let greys: Vec<f32> = luma_values(color).collect();
    (map.size() == color.size() && correlation(&nearness, &greys).abs() > 0.999)
        .then_some("this is the picture itself, not its depth")
}

/// Returns Pearson's correlation (-1 to 1) of two lists, ignoring unknown `values`.
fn correlation(values: &[f32], others: &[f32]) -> f64 {
    let pairs =
        || values.iter().zip(others).filter(|(value, _)| value.is_finite()).map(|(a, b)| [*a, *b].map(f64::from));
    let count = pairs().count().max(1) as f64;
    let [a, b] = pairs().fold([0.0; 2], |[a, b], [x, y]| [a + x / count, b + y / count]);
    let [aa, ab, bb] = pairs().fold([0.0; 3], |[aa, ab, bb], [x, y]| {
        [aa + (x - a) * (x - a), ab + (x - a) * (y - b), bb + (y - b) * (y - b)]
    });
    ab / (aa * bb).sqrt().max(f64::MIN_POSITIVE)
}

/// Says what was assumed about a source's files; warns of implausible options, and of its first depth. Returns whether it
/// warned of the latter.
pub fn warn_of_source(source: &Source, look: &Look, options: &Options) -> bool {
    source.findings.notes.iter().for_each(|note| log::note(note));
    warn_of_lens(look);
    warn_of_depth_scale(options.depth.depth_scale);
    let is_unit_known = source.depth_from != DepthOrigin::Units || options.depth.depth_scale.is_some();
    warn_of_baseline(source.rig);
    let has_metres = matches!(source.depth_from, DepthOrigin::Units | DepthOrigin::Metres);
    source.first_depth.as_ref().filter(|_| has_metres).is_some_and(|map| {
        warn_of_map(&format!("the first depth picture of {}", source.camera.info().name), map, is_unit_known)
    })
}

/// Warns if no person was found, or an implausible one. `chosen` is `None` for the installed network.
pub fn warn_of_subject(chosen: Option<&SingleCameraDepth>, map: &DepthMap, image: Option<&Path>) {
    let plate = chosen.and_then(|chosen| chosen.plate.as_ref()).and_then(|plate| match plate {
        PlateFile::At(file) => Some(file.as_path()),
        PlateFile::Taken => None,
    });
    check_subject(map, plate, image).iter().for_each(|line| log::warn(line));
}

/// Warns if the installed network finds a person in a plate, who would then not be found in front of it.
pub fn warn_of_person_in_plate(plate: &ColorImage, file: &Path) {
    let detector = SingleCameraDepth { mono: None, ..source::installed_networks() };
    if !detector.has_networks() {
        return;
    }
    let map = source::single_camera::compute_picture_depth(&detector, &Options::default(), &Look::default(), plate);
    // A network that fails says nothing about the plate.
    if map.is_ok_and(|map| near_share(&map) > MIN_PERSON) {
        log::warn(&format!(
            "{}: there is a person in the plate, whose place becomes background: take it while nobody is in the picture",
            file.display()
        ));
    }
}

/// Returns the share of the picture that is as near as the subject; 0 without one.
fn near_share(map: &DepthMap) -> f32 {
    let near = |subject_m: f32| map.metres.iter().filter(|&&metres| metres <= subject_m).count();
    map.subject_m.map_or(0.0, |subject_m| near(subject_m) as f32 / map.metres.len().max(1) as f32)
}

fn check_subject(map: &DepthMap, plate: Option<&Path>, image: Option<&Path>) -> Option<String> {
    let subject_m = map.subject_m?;
    let is_near = |at: usize| map.metres[at] <= subject_m;
    let count = map.metres.len();
    let near = (0..count).filter(|&at| is_near(at)).count();
    let is_itself = plate.zip(image).is_some_and(|(plate, image)| place::paths_overlap(plate, image));
    match plate.map(Path::display) {
        Some(plate) if is_itself => {
            Some(format!("{plate}: the plate is the picture itself: no person is found, and everything is blurred"))
        }
        Some(plate) if near == 0 => Some(format!(
            "{plate}: nothing in the picture differs from the plate, so everything is blurred; a plate shows the place \
             without the person"
        )),
        None if near == 0 => Some("no person was found in the picture, so everything is blurred".to_owned()),
        Some(plate) if near as f32 > MAX_FOREGROUND * count as f32 && raggedness(map, is_near) > MAX_RAGGEDNESS => {
            Some(format!(
                "{plate}: {} % of the picture differs from it, in many small pieces, and stays sharp: it was taken \
                 from another position; a plate needs a camera that does not move, as on a tripod",
                100 * near / count
            ))
        }
        _ => None,
    }
}

/// Returns the outline of the near region over the square root of its area: 4 for a square, 6 to 9 for a person.
fn raggedness(map: &DepthMap, is_near: impl Fn(usize) -> bool) -> f32 {
    // Subsampled: at full resolution, hair would dominate the outline.
    let (width, height) = (map.width as usize, map.height as usize);
    let step = (width / 160).max(1);
    let columns: Vec<usize> = (0..width).step_by(step).collect();
    let (mut inside, mut outline) = (0, 0);
    for y in (0..height).step_by(step) {
        for &x in &columns {
            let own = is_near(y * width + x);
            let right = x + step < width && is_near(y * width + x + step) != own;
            let below = y + step < height && is_near((y + step) * width + x) != own;
            inside += usize::from(own);
            outline += usize::from(right) + usize::from(below);
        }
    }
    outline as f32 / (inside.max(1) as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(near: impl Fn(f32, f32) -> bool) -> DepthMap {
        let at = |k: u32| (k % 640, k / 640);
        let metres = |k| if near(at(k).0 as f32, at(k).1 as f32) { DepthMap::SUBJECT_M } else { DepthMap::FAR_M };
        DepthMap {
            width: 640,
            height: 360,
            metres: (0..640 * 360).map(metres).collect(),
            subject_m: Some(DepthMap::SUBJECT_M),
            ..DepthMap::default()
        }
    }

    #[test]
    fn a_plate_from_elsewhere_leaves_shreds_and_a_person_has_an_outline() {
        let plate = Some(Path::new("room.png"));
        let person = |x: f32, y: f32| (x - 320.0).hypot(y - 130.0) < 90.0 || (y > 200.0 && (x - 320.0).abs() < 200.0);
        assert_eq!(check_subject(&map(person), plate, None), None);
        let shreds = |x: f32, y: f32| person(x, y) || (x * 0.12).sin() * (y * 0.2).cos() > 0.5;
        let said = check_subject(&map(shreds), plate, None).unwrap();
        assert!(said.starts_with("room.png: ") && said.contains("as on a tripod"), "{said}");
        // A network's result is not compared with a plate.
        assert_eq!(check_subject(&map(shreds), None, None), None);
        assert!(check_subject(&map(|_, _| false), None, None).unwrap().contains("no person was found"));
    }

    #[test]
    fn eyes_of_vehicles_are_usual_and_those_of_houses_are_not() {
        let rig = |baseline_m, metric| StereoRig { focal_px: 700.0, baseline_m, doffs_px: 0.0, metric };
        assert_eq!(check_baseline(&rig(2.0, true)), None);
        assert_eq!(check_baseline(&rig(60.0, false)), None);
        assert!(check_baseline(&rig(63.5, true)).unwrap().contains("it is 0.0635 m"));
    }
}
