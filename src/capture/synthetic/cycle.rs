//! The scene's motion kept in memory: it is played at any rate, though rendering is slow.
//!
//! The first frame is there at once. A helper renders those after it, one by one, at the lowest priority; meanwhile
//! what is there is played forth and back, in swings that get wider. Once all frames are there, they are played in a
//! loop.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;

use super::SAMPLES_PER_PIXEL;
use crate::capture::Shot;
use crate::frame::{ColorImage, DepthMap};
use crate::scene::{Scene, View};

/// What all frames together may take; where that is not enough, there are fewer.
const MOST_BYTES: usize = 128 << 20;
/// A swing forth and back takes no less than this.
const LEAST_SWING_S: f64 = 2.0;

/// Plays the kept frames of one period of the scene's motion.
pub(super) struct Cycle {
    shelf: Arc<Shelf>,
    threads: usize,
    /// Kept frames from one captured frame to the next.
    step: f64,
    /// The longest step of `phase`.
    most_phase_step: f64,
    /// The playing position in kept frames.
    at: f64,
    /// Phase of the swing in radians: forth below pi, back above it.
    phase: f64,
    /// Whether all frames are there and are played in a loop.
    looping: bool,
}

/// The kept frames, shared with the helper that renders them.
struct Shelf {
    scene: Scene,
    view: View,
    frames: Vec<OnceLock<(ColorImage, DepthMap)>>,
    /// How many of them are there, from the first one on.
    ready: AtomicUsize,
    /// Nobody plays them any more.
    over: AtomicBool,
}

impl Shelf {
    /// Renders the frame `index` unless it is there, and counts it as ready: to be called in order.
    fn render(&self, index: usize, threads: usize) {
        let time_s = index as f64 / self.frames.len() as f64 * self.scene.period_s();
        self.frames[index].get_or_init(|| {
            let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
            self.scene.render_pinhole(&self.view, time_s, SAMPLES_PER_PIXEL, threads, &mut color, &mut depth);
            (color, depth)
        });
        self.ready.store(index + 1, Ordering::Release);
    }

    /// Renders all frames but the first, until nobody plays them any more.
    fn render_the_others(&self, threads: usize) {
        // Pictures that are shown come first.
        const LOWEST_PRIORITY: i32 = 19;
        if let Err(error) = rustix::process::setpriority_process(None, LOWEST_PRIORITY) {
            tracing::debug!("the synthetic scene is rendered at the usual priority: {error}");
        }
        for index in 1..self.frames.len() {
            if self.over.load(Ordering::Relaxed) {
                return;
            }
            self.render(index, threads);
        }
    }
}

impl Cycle {
    /// `frames` (> 0) of a period, or as many as there is memory for, played at `fps`.
    pub(super) fn new(scene: Scene, view: View, frames: u64, fps: f64, threads: usize) -> Self {
        let pixels = view.width as usize * view.height as usize;
        // Three bytes of colour and a depth for each pixel.
        let most_frames = (MOST_BYTES / (pixels * (3 + size_of::<f32>()))).max(1);
        let count = usize::try_from(frames).unwrap_or(most_frames).clamp(1, most_frames);
        let period_s = scene.period_s();
        let shelf = Shelf {
            scene,
            view,
            frames: (0..count).map(|_| OnceLock::new()).collect(),
            ready: AtomicUsize::new(0),
            over: AtomicBool::new(false),
        };
        Self {
            shelf: Arc::new(shelf),
            threads,
            step: count as f64 / (period_s * fps),
            most_phase_step: TAU / (LEAST_SWING_S * fps),
            at: 0.0,
            phase: 0.0,
            looping: false,
        }
    }

    /// Copies the present frame into `shot`; the first call renders it and starts the helper.
    pub(super) fn read(&mut self, shot: Shot) {
        if self.shelf.ready.load(Ordering::Acquire) == 0 {
            self.shelf.render(0, self.threads);
            self.start_helper();
        }
        let index = self.at as usize;
        if let Some((color, depth)) = self.shelf.frames[index].get() {
            shot.color.resize(color.width, color.height);
            shot.color.rgb.copy_from_slice(&color.rgb);
            shot.depth.resize(depth.width, depth.height);
            shot.depth.metres.copy_from_slice(&depth.metres);
        }
    }

    fn start_helper(&self) {
        let (shelf, threads) = (Arc::clone(&self.shelf), (self.threads / 2).max(1));
        // Nobody waits for its end: it comes after the frame that is being rendered.
        let helper = thread::Builder::new().name("scene".into()).spawn(move || shelf.render_the_others(threads));
        if let Err(error) = helper {
            tracing::warn!("the synthetic scene stands still: {error}");
        }
    }

    /// Moves on by one captured frame.
    pub(super) fn advance(&mut self) {
        let (ready, count) = (self.shelf.ready.load(Ordering::Acquire), self.shelf.frames.len());
        // The loop begins on the way forth, so that the motion does not jump.
        self.looping |= ready == count && self.phase < PI;
        if self.looping {
            self.at = (self.at + self.step) % count as f64;
            return;
        }
        let half = ready.max(1) as f64 / 2.0;
        // At the middle of the swing no faster than the scene's own speed.
        self.phase = (self.phase + self.most_phase_step.min(self.step / half)) % TAU;
        // The swing goes up to `ready`, as the position is rounded down: else the last frame would only flash up.
        let goal = (half * (1.0 - self.phase.cos())).min(2.0 * half - 1e-6);
        self.at += (goal - self.at).clamp(-self.step, self.step);
    }
}

impl Drop for Cycle {
    fn drop(&mut self) {
        self.shelf.over.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::GrayImage;

    const SIZE: (u32, u32) = (32, 18);

    fn cycle(frames: u64, fps: f64) -> Cycle {
        Cycle::new(Scene::portrait(), View::new(SIZE.0, SIZE.1), frames, fps, 1)
    }

    /// As [`cycle`], with so many frames that look different, and nobody who renders more.
    fn with_ready(frames: u64, fps: f64, ready: usize) -> Cycle {
        let cycle = cycle(frames, fps);
        fill(&cycle, ready);
        cycle
    }

    fn fill(cycle: &Cycle, ready: usize) {
        for index in 0..ready {
            cycle.shelf.frames[index].get_or_init(|| {
                let mut color = ColorImage::new(SIZE.0, SIZE.1);
                color.rgb.fill(index as u8);
                (color, DepthMap::new(SIZE.0, SIZE.1))
            });
        }
        cycle.shelf.ready.store(ready, Ordering::Release);
    }

    fn read(cycle: &mut Cycle) -> (ColorImage, DepthMap) {
        let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
        cycle.read(Shot { color: &mut color, depth: &mut depth, right: &mut GrayImage::default() });
        cycle.advance();
        (color, depth)
    }

    fn play(cycle: &mut Cycle, frames: usize) -> Vec<i32> {
        (0..frames).map(|_| i32::from(read(cycle).0.rgb[0])).collect()
    }

    #[test]
    fn what_is_there_is_played_forth_and_back_without_a_jump_while_more_comes() {
        let mut cycle = with_ready(60, 30.0, 1);
        let mut played = play(&mut cycle, 10);
        assert_eq!(played, [0; 10]);
        for ready in 2..=60 {
            fill(&cycle, ready);
            played.extend(play(&mut cycle, 13));
            let least = played[10..].iter().rev().take(200).min().unwrap();
            assert_eq!(*least, 0, "with {ready} frames it comes back to the first");
        }
        assert!(played.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= 1 || pair == [59, 0]), "{played:?}");
        assert!(*played.iter().max().unwrap() > 50);
    }

    #[test]
    fn few_frames_are_played_slowly() {
        let mut cycle = with_ready(60, 30.0, 3);
        let played = play(&mut cycle, 300);
        let turns = played.windows(3).filter(|three| three[1] != three[0] && three[2] == three[0]).count();
        assert_eq!(turns, 0, "it does not shake: {played:?}");
        let changes = played.windows(2).filter(|pair| pair[0] != pair[1]).count();
        // Five times forth and back in ten seconds, two steps each way.
        assert!((10..=20).contains(&changes), "{changes}");
    }

    #[test]
    fn a_whole_motion_goes_round_at_the_scenes_own_speed() {
        let mut cycle = with_ready(60, 30.0, 60);
        let played = play(&mut cycle, 150);
        let expected: Vec<i32> = (0..150).map(|frame| frame % 60).collect();
        assert_eq!(played, expected);
        // Half as many frames as are played: each of them twice.
        let mut cycle = with_ready(30, 30.0, 30);
        assert_eq!(play(&mut cycle, 6), [0, 0, 1, 1, 2, 2]);
        // A motion that becomes whole while it goes back goes forth first.
        let mut cycle = with_ready(60, 30.0, 50);
        let back = (0..).find(|_| {
            read(&mut cycle);
            cycle.phase > PI
        });
        assert!(back.is_some());
        fill(&cycle, 60);
        let played = play(&mut cycle, 400);
        assert!(played.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= 1 || pair == [59, 0]), "{played:?}");
        assert!(cycle.looping);
    }

    #[test]
    fn the_helper_renders_the_scene_and_the_first_frame_does_not_wait_for_it() {
        let mut cycle = cycle(4, 2.0);
        let scene = Scene::portrait();
        let first = read(&mut cycle);
        let begun = std::time::Instant::now();
        while cycle.shelf.ready.load(Ordering::Acquire) < 4 {
            assert!(begun.elapsed().as_secs() < 60, "it does not get ready");
            thread::sleep(std::time::Duration::from_millis(1));
        }
        assert!(cycle.shelf.frames.iter().all(|frame| frame.get().is_some()));
        let (mut color, mut depth) = (ColorImage::default(), DepthMap::default());
        for index in 0..4 {
            let (view, time_s) = (View::new(SIZE.0, SIZE.1), index as f64 / 4.0 * scene.period_s());
            scene.render_pinhole(&view, time_s, SAMPLES_PER_PIXEL, 1, &mut color, &mut depth);
            assert_eq!(cycle.shelf.frames[index].get(), Some(&(color.clone(), depth.clone())), "frame {index}");
            assert!(index != 0 || first == (color.clone(), depth.clone()));
        }
    }

    #[test]
    fn memory_is_bounded() {
        let large = Cycle::new(Scene::portrait(), View::new(1920, 1080), 1000, 30.0, 1);
        let count = large.shelf.frames.len();
        assert!(count > 1 && count * 1920 * 1080 * 7 <= MOST_BYTES, "{count}");
        assert!((large.step - count as f64 / 60.0).abs() < 1e-9, "the motion keeps its speed");
        let huge = Cycle::new(Scene::portrait(), View::new(8192, 8192), 10, 30.0, 1);
        assert_eq!(huge.shelf.frames.len(), 1);
    }
}
