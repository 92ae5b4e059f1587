//! Checks the distances of a depth map: their unit, and a focus among them.

use super::log;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::DepthMap;
use bokehcam::look::{CocRule, Look};
use bokehcam::optics::{CocField, DepthCoc};
use bokehcam_live::source::DepthOrigin;
use bokehcam_live::source::options::DEPTH_SCALE;

/// Says that the number of a focus is `taken` as a place in relative depth.
pub fn note_place(given: &Look, taken: &Look) {
    if let (FocusRule::Metres(_) | FocusRule::Relative(_), FocusRule::Relative(place)) = (given.focus, taken.focus) {
        log::note(&format!("--focus {place}: a place in relative depth, from 0 (nearest) to 1 (farthest)"));
    }
}

/// Fraction of a map that must be blurred on one side of the focal plane to count as all of it: the rest is noise.
const MIN_BLURRED_FRACTION: f32 = 0.99;
/// CoC radius up to which a pixel is sharp, in pixels.
const MAX_SHARP_PX: f32 = 1.0;

/// If all depth is nearer than this, in metres, it has another unit than assumed.
const MIN_FAR_M: f32 = 1.0;

/// Warns of depth in another unit than assumed, or of a focus in metres that nothing in `map` is near. `scale` is that
/// of `--depth-scale`, if any, and `size` that of the picture, in pixels.
pub fn warn_of_distances(look: &Look, size: (u32, u32), map: &DepthMap, from: DepthOrigin, scale: Option<f32>) {
    let in_units = from == DepthOrigin::Units;
    if in_units
        && scale.is_none()
        && let Some(far_m) = quantile_m(&mut known_metres(map), MIN_BLURRED_FRACTION)
        && far_m < MIN_FAR_M
    {
        log::warn(&format!(
            "at {DEPTH_SCALE} units per metre all depth is nearer than {far_m:.2} m; if it is in millimetres, add \
             --depth-scale 1000"
        ));
        return;
    }
    let (FocusRule::Metres(focus_m), CocRule::Depth { lens, range_m, max_coc_px, .. }) =
        (look.focus, look.coc_rule(size))
    else {
        return;
    };
    if let CocField::Depth(coc) = lens.coc_field(focus_m, range_m, size.0, max_coc_px)
        && let Some(why) = describe_out_of_focus(&coc, map)
    {
        let scale = if in_units { "; is --depth-scale right for this depth?" } else { "" };
        log::warn(&format!("--focus {focus_m}: {why}{scale}"));
    }
}

fn known_metres(map: &DepthMap) -> Vec<f32> {
    map.metres.iter().copied().filter(|&metres| DepthMap::is_known(metres)).collect()
}

fn quantile_m(known: &mut [f32], fraction: f32) -> Option<f32> {
    let index = (fraction * known.len().checked_sub(1)? as f32).round() as usize;
    Some(*known.select_nth_unstable_by(index, f32::total_cmp).1)
}

/// Describes why nothing is sharp, if so.
fn describe_out_of_focus(coc: &DepthCoc, map: &DepthMap) -> Option<String> {
    let mut known = known_metres(map);
    if known.is_empty() {
        return Some("no depth is known anywhere".to_string());
    }
    let fraction = |is_side: &dyn Fn(f32) -> bool| {
        known.iter().filter(|&&metres| is_side(coc.coc_px(metres))).count() as f32 / known.len() as f32
    };
    let side = match (fraction(&|coc_px| coc_px > MAX_SHARP_PX), fraction(&|coc_px| coc_px < -MAX_SHARP_PX)) {
        (behind, _) if behind >= MIN_BLURRED_FRACTION => "beyond",
        (_, before) if before >= MIN_BLURRED_FRACTION => "before",
        _ => return None,
    };
    let nearest_m = quantile_m(&mut known, 1.0 - MIN_BLURRED_FRACTION)?;
    let farthest_m = quantile_m(&mut known, MIN_BLURRED_FRACTION)?;
    Some(format!("the depth lies from {nearest_m:.3} to {farthest_m:.3} m, all of it {side} that, so nothing is sharp"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_on_one_side_of_the_focus_is_found_and_a_little_noise_does_not_hide_it() {
        let coc = DepthCoc { coc_at_infinity_px: 16.0, focus_m: 1.5, range_m: 0.0, max_coc_px: 40.0 };
        let map = |metres: Vec<f32>| DepthMap { width: metres.len() as u32, height: 1, metres, ..DepthMap::default() };
        let metres = |scale: f32| (0..1000).map(|k| (0.5 + k as f32 * 0.004) * scale).collect::<Vec<f32>>();
        assert_eq!(describe_out_of_focus(&coc, &map(metres(1.0))), None);
        let far = describe_out_of_focus(&coc, &map(metres(5.0))).unwrap();
        assert!(far.contains("from 2.7") && far.contains("beyond"), "{far}");
        let mut noisy = metres(5.0);
        noisy[..5].fill(1.5);
        assert!(describe_out_of_focus(&coc, &map(noisy)).is_some());
        assert!(describe_out_of_focus(&coc, &map(metres(0.2))).unwrap().contains("before"));
        assert!(describe_out_of_focus(&coc, &map(vec![0.0; 9])).unwrap().contains("no depth is known"));
    }
}
