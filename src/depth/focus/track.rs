//! Follows the thing that is at a point of the picture, wherever it goes.

use super::loyalty::tolerance;
use super::point_m;
use crate::frame::DepthMap;

/// Rows and columns looked at, at most.
const LOOKS: usize = 120;
/// At first it is looked for so far around the point, as a share of each side; and its spread is at least and at most this.
const FIRST_REACH: f32 = 0.2;
const SPREAD: [f32; 2] = [0.02, 0.2];
/// Later it is looked for so many spreads around where it was, and this share of each side more.
const SPREADS: f32 = 2.5;
const MARGIN: f32 = 0.05;
/// Less of it is left of what there was where it is hidden, or the map is bad: it stays where it is.
const LEAST_LEFT: f32 = 0.3;
/// How fast its size follows what is seen of it.
const SIZE_SHARE: f32 = 0.1;

/// A thing that was pointed at.
#[derive(Debug)]
pub struct Track {
    at: [f32; 2],
    thing: Option<Thing>,
}

/// Shares of width and height.
#[derive(Clone, Copy, Debug)]
struct Thing {
    dioptres: f32,
    time_ns: u64,
    center: [f32; 2],
    spread: [f32; 2],
    /// Of the picture.
    share: f32,
}

impl Track {
    /// Of what is at these fractions of width and height in the first map that is looked at.
    pub fn new(at: [f32; 2]) -> Self {
        Self { at, thing: None }
    }

    /// Its distance in dioptres, in a map of this time; `None` where no map knew it yet.
    pub fn find(&mut self, map: &DepthMap, time_ns: u64, window_m: &mut Vec<f32>) -> Option<f32> {
        let found = match self.thing {
            None => {
                let dioptres = 1.0 / point_m(map, self.at[0], self.at[1], window_m)?;
                let (center, reach) = (self.at, [FIRST_REACH; 2]);
                let at_first = Thing { dioptres, time_ns, center, spread: [0.0; 2], share: 0.0 };
                Some(seen(map, at_first, (reach, tolerance(0, 0))).unwrap_or(at_first))
            }
            Some(was) => {
                let reach = was.spread.map(|spread| SPREADS * spread + MARGIN);
                // Somewhere near is its peak; from there it reaches as far as one thing does.
                let near = seen(map, was, (reach, tolerance(was.time_ns, time_ns)));
                let now =
                    near.and_then(|near| seen(map, Thing { center: was.center, ..near }, (reach, tolerance(0, 0))));
                now.filter(|now| now.share >= LEAST_LEFT * was.share).map(|now| {
                    let share = was.share + (now.share - was.share) * SIZE_SHARE;
                    let spread = [0, 1].map(|k| was.spread[k] + (now.spread[k] - was.spread[k]) * SIZE_SHARE);
                    Thing { share, spread, ..now }
                })
            }
        };
        match (found, &mut self.thing) {
            (Some(found), _) => self.thing = Some(Thing { time_ns, ..found }),
            // Time in which it was hidden is none in which it could move unseen.
            (None, Some(was)) => was.time_ns = time_ns,
            (None, None) => {}
        }
        self.thing.map(|thing| thing.dioptres)
    }
}

/// What a map has within `reach` of a thing's place and `tolerance` of its distance; `None` where that is nothing.
fn seen(map: &DepthMap, thing: Thing, (reach, tolerance): ([f32; 2], f32)) -> Option<Thing> {
    let size = [map.width as usize, map.height as usize];
    let steps = size.map(|count| count.div_ceil(LOOKS).max(1));
    let range = |k: usize| {
        let at = |fraction: f32| ((fraction.clamp(0.0, 1.0) * size[k] as f32) as usize).min(size[k]);
        (at(thing.center[k] - reach[k])..at(thing.center[k] + reach[k])).step_by(steps[k])
    };
    let (mut count, mut dioptres, mut places, mut squares) = (0.0, 0.0, [0.0; 2], [0.0; 2]);
    for y in range(1) {
        for x in range(0) {
            let metres = map.metres[y * size[0] + x];
            let inverse = DepthMap::inverse_of(metres);
            if DepthMap::is_known(metres) && (inverse - thing.dioptres).abs() <= tolerance {
                count += 1.0;
                dioptres += inverse;
                for (k, at) in [x, y].into_iter().enumerate() {
                    let place = (at as f32 + 0.5) / size[k] as f32;
                    places[k] += place;
                    squares[k] += place * place;
                }
            }
        }
    }
    (count > 0.0).then(|| {
        let center = places.map(|sum| sum / count);
        let spread =
            [0, 1].map(|k| (squares[k] / count - center[k] * center[k]).max(0.0).sqrt().clamp(SPREAD[0], SPREAD[1]));
        let looks = (size[0] / steps[0]).max(1) * (size[1] / steps[1]).max(1);
        Thing { dioptres: dioptres / count, center, spread, share: count / looks as f32, ..thing }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_NS: u64 = 33_000_000;

    /// Two things before a wall at 4 m: one as wide as a head at column `x`, at `metres`, and another at 0.5 m on the left.
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
        let mut track = Track::new([0.4, 0.6]);
        for frame in 0..90u64 {
            let way = frame as f32 / 89.0;
            let (x, metres) = (0.4 + 0.45 * way, 1.2 + 0.8 * way);
            let found = track.find(&scene(x, metres), frame * FRAME_NS, &mut Vec::new()).unwrap();
            assert!((found - 1.0 / metres).abs() < 0.03, "{frame}: {} m for {metres}", 1.0 / found);
        }
    }

    #[test]
    fn it_waits_where_the_thing_is_hidden_or_a_map_is_bad() {
        let mut track = Track::new([0.5, 0.6]);
        let mut find = |map: &DepthMap, frame: u64| track.find(map, frame * FRAME_NS, &mut Vec::new()).unwrap();
        let first = find(&scene(0.5, 1.2), 0);
        let wall = DepthMap { metres: vec![4.0; 160 * 90], ..DepthMap::new(160, 90) };
        let near = DepthMap { metres: vec![0.5; 160 * 90], ..DepthMap::new(160, 90) };
        for (frame, map) in (1..).zip([&wall, &near, &DepthMap::new(160, 90), &wall]) {
            assert_eq!(find(map, frame), first, "{frame}");
        }
        assert!((find(&scene(0.52, 1.25), 9) - 0.8).abs() < 0.02, "and goes on with it");
    }
}
