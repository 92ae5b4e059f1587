//! A stepper on its caller's thread gives the results of a run with its own threads.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use bokehcam::computing::ComputeOptions;
use bokehcam::engine::FrameProcessor;
use bokehcam::frame::ColorImage;
use bokehcam::look::{Effect, Look};
use bokehcam_live::pipeline::{self, Run};
use bokehcam_live::source::{self, Source};
use bokehcam_media::recording::{Options, Recording, Scratch};

use crate::fakes::sink_by;
use crate::portrait;

#[test]
fn every_frame_is_that_of_a_run() {
    let dir = portrait::folder();
    let recording = Recording::open(&dir, &Options::default()).unwrap();
    let followed = Look {
        follow: "1.5".parse().unwrap(),
        background: bokehcam::depth::backdrop::Background::Color([0, 99, 9]),
        ..Look::default()
    };
    for look in [Look::default(), followed, Look::with_effect(Effect::TiltShift), Look::with_effect(Effect::None)] {
        let source =
            Source::open(&dir.to_str().unwrap().parse().unwrap(), &source::Options::default(), Some(&look)).unwrap();
        let (kept, stop) = (Arc::<Mutex<Vec<ColorImage>>>::default(), AtomicBool::new(false));
        let keeps = Arc::clone(&kept);
        let sink = sink_by(move |frame| keeps.lock().unwrap().push(frame.clone()));
        let run = Run::new(source.camera, source.depth, look.clone(), sink, &stop).unwrap();
        pipeline::run(run).unwrap();
        let kept = kept.lock().unwrap();
        assert_eq!(kept.len(), recording.len());
        let mut processor =
            FrameProcessor::new(&look, recording.size(), true, true, ComputeOptions::default()).unwrap();
        // Asking for depth would be wasted work where the effect does not follow it.
        assert_eq!(processor.needs_depth(), look.effect.follows_depth(), "{:?}", look.effect);
        let mut scratch = Scratch::default();
        for (index, wanted) in kept.iter().enumerate() {
            let needs_depth = processor.needs_depth();
            let (color, depth) = processor.frame_buffers();
            recording.read_color(index, &mut scratch, color).unwrap();
            if needs_depth {
                recording.read_depth(index, &mut scratch, depth).unwrap();
            }
            assert!(processor.process(recording.time_ns(index)).unwrap() == wanted, "{:?} frame {index}", look.effect);
        }
    }
}

#[test]
fn quality_follows_the_time_only_once_that_is_said_and_where_it_may() {
    let size = (320, 240);
    let last = |look: &Look, budget_ns: Option<u64>| {
        let mut processor = FrameProcessor::new(look, size, false, true, ComputeOptions::default()).unwrap();
        budget_ns.into_iter().for_each(|budget_ns| processor.set_budget(budget_ns));
        for frame in 0..20 {
            processor.frame_buffers().0.rgb.fill(90);
            processor.process(frame).unwrap();
        }
        processor.quality().unwrap().name()
    };
    let look = Look::with_effect(Effect::Blur);
    assert_eq!(last(&look, None), "balanced");
    assert_eq!(last(&look, Some(1)), "draft");
    assert_eq!(last(&Look { quality: Some(bokehcam::budget::Quality::Best), ..look }, Some(1)), "best");
}
