//! Tracks the object at a point of the picture in the depth maps (mean shift in position and depth).

use super::hysteresis::motion_tolerance;
use super::median_depth_at;
use crate::frame::DepthMap;

/// Maximum number of sampled rows and columns.
const MAX_SAMPLES: usize = 120;
/// Initial search radius around the point, and bounds of the object's spread (standard deviation), as fractions of each
/// side.
const FIRST_RADIUS: f32 = 0.2;
const SPREAD_RANGE: [f32; 2] = [0.02, 0.2];
/// Later search radius: a multiple of the spread, plus a margin as a fraction of each side.
const SPREAD_FACTOR: f32 = 2.5;
const MARGIN: f32 = 0.05;
/// Minimum fraction of the object's previous size: with less it is hidden, or the map is bad, and the track holds.
const MIN_SIZE_RATIO: f32 = 0.3;
/// Smoothing factor of size and spread, per map.
const SMOOTHING: f32 = 0.1;

/// A tracked object, with the point where it was selected.
#[derive(Debug)]
pub struct ObjectTrack {
    at: [f32; 2],
    object: Option<Object>,
}

/// State of the object; positions are fractions of width and height.
#[derive(Clone, Copy, Debug)]
struct Object {
    dioptres: f32,
    time_ns: u64,
    center: [f32; 2],
    spread: [f32; 2],
    /// Size as a fraction of the picture.
    fraction: f32,
}

impl ObjectTrack {
    /// Creates a track of the object at these fractions of width and height in the first map.
    pub fn new(at: [f32; 2]) -> Self {
        Self { at, object: None }
    }

    /// Returns the object's distance in dioptres in a map at `time_ns`; `None` as long as no map had it.
    pub fn locate(&mut self, map: &DepthMap, time_ns: u64, window_m: &mut Vec<f32>) -> Option<f32> {
        let found = match self.object {
            None => {
                let dioptres = 1.0 / median_depth_at(map, self.at[0], self.at[1], window_m)?;
                let (center, radius) = (self.at, [FIRST_RADIUS; 2]);
                let at_first = Object { dioptres, time_ns, center, spread: [0.0; 2], fraction: 0.0 };
                Some(measure_object(map, at_first, radius, motion_tolerance(0, 0)).unwrap_or(at_first))
            }
            Some(previous) => {
                let radius = previous.spread.map(|spread| SPREAD_FACTOR * spread + MARGIN);
                // First finds the mean distance within the motion tolerance, then the object around that distance.
                let near = measure_object(map, previous, radius, motion_tolerance(previous.time_ns, time_ns));
                let now = near.and_then(|near| {
                    measure_object(map, Object { center: previous.center, ..near }, radius, motion_tolerance(0, 0))
                });
                now.filter(|now| now.fraction >= MIN_SIZE_RATIO * previous.fraction).map(|now| {
                    let fraction = previous.fraction + (now.fraction - previous.fraction) * SMOOTHING;
                    let spread = [0, 1].map(|k| previous.spread[k] + (now.spread[k] - previous.spread[k]) * SMOOTHING);
                    Object { fraction, spread, ..now }
                })
            }
        };
        match (found, &mut self.object) {
            (Some(found), _) => self.object = Some(Object { time_ns, ..found }),
            // The time while it was hidden does not widen the tolerance.
            (None, Some(previous)) => previous.time_ns = time_ns,
            (None, None) => {}
        }
        self.object.map(|object| object.dioptres)
    }
}

/// Measures the pixels within `radius` of an object's centre and `tolerance` of its distance; `None` if there are none.
fn measure_object(map: &DepthMap, object: Object, radius: [f32; 2], tolerance: f32) -> Option<Object> {
    let size = [map.width as usize, map.height as usize];
    let steps = size.map(|count| count.div_ceil(MAX_SAMPLES).max(1));
    let range = |k: usize| {
        let at = |fraction: f32| ((fraction.clamp(0.0, 1.0) * size[k] as f32) as usize).min(size[k]);
        (at(object.center[k] - radius[k])..at(object.center[k] + radius[k])).step_by(steps[k])
    };
    let (mut count, mut dioptres) = (0.0, 0.0);
    // Sums of the positions, as fractions of width and height, and of their squares.
    let [mut sums, mut squares] = [[0.0; 2]; 2];
    for y in range(1) {
        for x in range(0) {
            let metres = map.metres[y * size[0] + x];
            let inverse = DepthMap::inverse_depth(metres);
            if DepthMap::is_known(metres) && (inverse - object.dioptres).abs() <= tolerance {
                count += 1.0;
                dioptres += inverse;
                for (k, px) in [x, y].into_iter().enumerate() {
                    let at = (px as f32 + 0.5) / size[k] as f32;
                    sums[k] += at;
                    squares[k] += at * at;
                }
            }
        }
    }
    (count > 0.0).then(|| {
        let center = sums.map(|sum| sum / count);
        let spread = [0, 1].map(|k| {
            (squares[k] / count - center[k] * center[k]).max(0.0).sqrt().clamp(SPREAD_RANGE[0], SPREAD_RANGE[1])
        });
        let samples = (size[0] / steps[0]).max(1) * (size[1] / steps[1]).max(1);
        Object { dioptres: dioptres / count, center, spread, fraction: count / samples as f32, ..object }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_NS: u64 = 33_000_000;

    /// Two objects before a wall at 4 m: one of a head's width at column `x`, at `metres`, and another at 0.5 m on the
    /// left.
    fn scene(x: f32, metres: f32) -> DepthMap {
        let (width, height) = (160, 90);
        let depth = |at: usize| {
            let (u, v) = ((at % width) as f32 / width as f32, (at / width) as f32 / height as f32);
            match () {
                () if u < 0.25 && v > 0.3 => 0.5,
                () if (u - x).abs() < 0.07 && v > 0.3 => metres,
                () => 4.0,
            }
        };
        DepthMap { metres: (0..width * height).map(depth).collect(), ..DepthMap::new(width as u32, height as u32) }
    }

    #[test]
    fn what_was_pointed_at_is_followed_across_and_in_depth() {
        let mut track = ObjectTrack::new([0.4, 0.6]);
        for frame in 0..90u64 {
            let way = frame as f32 / 89.0;
            let (x, metres) = (0.4 + 0.45 * way, 1.2 + 0.8 * way);
            let found = track.locate(&scene(x, metres), frame * FRAME_NS, &mut Vec::new()).unwrap();
            assert!((found - 1.0 / metres).abs() < 0.03, "{frame}: {} m for {metres}", 1.0 / found);
        }
    }

    #[test]
    fn it_waits_where_the_thing_is_hidden_or_a_map_is_bad() {
        let mut track = ObjectTrack::new([0.5, 0.6]);
        let mut locate = |map: &DepthMap, frame: u64| track.locate(map, frame * FRAME_NS, &mut Vec::new()).unwrap();
        let first = locate(&scene(0.5, 1.2), 0);
        let wall = DepthMap { metres: vec![4.0; 160 * 90], ..DepthMap::new(160, 90) };
        let near = DepthMap { metres: vec![0.5; 160 * 90], ..DepthMap::new(160, 90) };
        for (frame, map) in (1..).zip([&wall, &near, &DepthMap::new(160, 90), &wall]) {
            assert_eq!(locate(map, frame), first, "{frame}");
        }
        assert!((locate(&scene(0.52, 1.25), 9) - 0.8).abs() < 0.02, "and goes on with it");
    }
}
