//! YUYV pictures are only for a sink that wants them, without other readers, and uncropped.

use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use bokehcam::bokeh::{BlurredFrame, Job, PassTimes, Picture};
use bokehcam::compute::Backend;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::{ColorImage, YuyvImage};
use bokehcam::link;
use bokehcam::look::Look;
use bokehcam_live::capture::FrameData;
use bokehcam_live::pipeline::{Run, run};
use bokehcam_live::sink::{Sink, SinkError};

use crate::fakes::*;
use crate::setup::*;

/// Creates a blur that encodes the frame's number as YUYV where it may.
fn ready() -> FakeBokeh {
    let makes = |Job { ticket, color, depth, mut out, yuyv, .. }| {
        out.resize(SIZE.0, SIZE.1);
        let &[low, high] = color.rgb.last_chunk::<2>().unwrap();
        let picture = match yuyv {
            Some(mut yuyv) => {
                yuyv.resize(SIZE.0, SIZE.1);
                yuyv.bytes.as_chunks_mut().0.fill([low, high]);
                Picture::from_yuyv(yuyv, out)
            }
            None => {
                out.rgb.as_chunks_mut().0.fill([low, high, 0]);
                Picture::from_memory(out)
            }
        };
        BlurredFrame { ticket, picture, color, depth, times: PassTimes::new() }
    };
    FakeBokeh { backend: Backend::Gpu, makes: Box::new(makes), ..fake_bokeh(3, Trouble::default()) }
}

/// The received frames: whether each was YUYV, and its number.
type Came = Arc<Mutex<Vec<(bool, u16)>>>;

/// A camera that wants YUYV intermittently, and keeps the memory of its last frame.
struct Camera {
    came: Came,
    last: Vec<u8>,
    wants: fn(usize) -> bool,
}

impl Camera {
    /// Records a frame of `N` bytes a pixel.
    fn note<const N: usize>(&self, bytes: &[u8]) {
        let pixels = bytes.as_chunks::<N>().0;
        assert!(pixels.iter().all(|pixel| *pixel == pixels[0]), "a frame of one piece");
        self.came.lock().unwrap().push((N == 2, u16::from_le_bytes([pixels[0][0], pixels[0][1]])));
    }
}

impl Sink for Camera {
    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        self.note::<3>(&frame.rgb);
        Ok(ControlFlow::Continue(()))
    }

    fn wants_yuyv(&mut self) -> bool {
        (self.wants)(self.came.lock().unwrap().len())
    }

    fn write_yuyv(&mut self, frame: &mut YuyvImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        assert_eq!((frame.size(), frame.bytes.len()), (SIZE, 2 * (SIZE.0 * SIZE.1) as usize));
        self.note::<2>(&frame.bytes);
        std::mem::swap(&mut self.last, &mut frame.bytes);
        Ok(ControlFlow::Continue(()))
    }
}

const FRAMES: usize = 400;

/// Runs with the changes of `change`, and returns all frames; `wants` decides from the number received whether the
/// camera wants YUYV.
fn came(look: Look, wants: fn(usize) -> bool, change: impl FnOnce(&mut Run)) -> Vec<(bool, u16)> {
    let (came, stop) = (Came::default(), AtomicBool::new(false));
    let camera = FakeCamera { frame_data: FrameData::Depth, ..fake_camera(FRAMES) };
    let sink = Camera { came: Arc::clone(&came), last: vec![0; 2 * (SIZE.0 * SIZE.1) as usize], wants };
    let mut blurred = Run::new(Box::new(camera), None, look, Box::new(sink), &stop).unwrap();
    blurred.bokeh = Some(Box::new(ready()));
    change(&mut blurred);
    let report = run(blurred).unwrap();
    assert_eq!(report.frames.delivered, FRAMES as u64);
    let came = came.lock().unwrap().clone();
    assert!(came.iter().map(|came| usize::from(came.1)).eq(0..FRAMES), "each frame once and in order");
    came
}

#[test]
fn a_camera_alone_gets_yuyv_and_no_frame_is_lost_where_it_wants_something_else() {
    let turns = |came: usize| came / 40 % 2 == 1;
    let came = came(uniform(4.0), turns, |_| {});
    // With three frames at the executor, a few more are under way in the previous format.
    const UNDER_WAY: usize = 12;
    for (k, (is_yuyv, _)) in came.into_iter().enumerate().filter(|(k, _)| k % 40 >= UNDER_WAY) {
        assert_eq!(is_yuyv, turns(k), "frame {k}");
    }
}

#[test]
fn nobody_is_given_yuyv_who_may_need_colours() {
    let always = |_| true;
    let rgb = |came: Vec<(bool, u16)>| came.iter().all(|came| !came.0);
    assert!(rgb(came(uniform(4.0), |_| false, |_| {})));
    assert!(rgb(came(uniform(4.0), always, |run| run.mirror = true)));
    let (view, seen) = link::live();
    assert!(rgb(came(uniform(4.0), always, |run| run.view = Some(view))));
    drop(seen);
    let parts = |came: Vec<(bool, u16)>| came.iter().filter(|came| came.0).count();
    assert!(parts(came(uniform(4.0), always, |_| {})) > FRAMES / 2);
    let follow = Look { follow: "2".parse().unwrap(), ..dof_with(FocusRule::Point { x: 0.0, y: 0.0 }, 4.0) };
    assert_eq!(parts(came(follow, always, |_| {})), 0, "a part is cut out of the picture");
}
