//! A million frames through the links and pools of a live run, under random stalls: no frame is lost track of.
#![allow(missing_docs)]

use std::thread;
use std::time::Duration;

use bokehcam_link::pool::{Pool, Pooled};
use bokehcam_link::{Receiver, Sender, live};

const FRAMES: u64 = if cfg!(miri) { 200 } else { 1_000_000 };

/// Reproducible stalls: short spins, yields, and now and then a sleep.
struct Stalls(u64);

impl Stalls {
    fn stall(&mut self, mean_turns: u64) {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        match self.0 >> 33 & 0xffff {
            0..16 => thread::sleep(Duration::from_micros(100)),
            16..512 => thread::yield_now(),
            dice if cfg!(not(miri)) => (0..dice % (2 * mean_turns)).for_each(|_| std::hint::spin_loop()),
            _ => {}
        }
    }
}

/// Each buffer holds the number of the frame that it belongs to.
struct Frame {
    id: u64,
    color: Pooled<u64>,
    depth: Option<Pooled<u64>>,
}

impl Frame {
    fn assert_whole(&self) {
        assert_eq!(*self.color, self.id, "nobody else wrote to the buffer meanwhile");
        assert!(self.depth.as_deref().is_none_or(|depth| *depth == self.id));
    }
}

/// Receives all frames of a link, in order; returns their count, and the number of the last one.
fn receive(from: &mut Receiver<Frame>, mut each: impl FnMut(Frame)) -> (u64, Option<u64>) {
    let (mut count, mut last) = (0, None);
    while let Some(frame) = from.recv() {
        frame.assert_whole();
        assert!(last < Some(frame.id), "frames keep their order");
        (count, last) = (count + 1, Some(frame.id));
        each(frame);
    }
    (count, last)
}

/// Sends a frame; returns the number of frames that it displaced.
fn send(to: &mut Sender<Frame>, frame: Frame) -> u64 {
    let id = frame.id;
    to.send(frame).expect("nobody goes early").map_or(0, |older| {
        older.assert_whole();
        assert!(older.id < id, "only an older frame is displaced");
        1
    })
}

#[test]
fn a_million_frames_are_each_delivered_or_displaced_once() {
    // The buffers that the stages hold, and those between them, as in a live run.
    let (colors, depths, outs) = (Pool::new(10, || 0), Pool::new(8, || 0), Pool::new(5, || 0));
    let (mut to_depth, mut from_capture) = live();
    let (mut to_blur, mut from_depth) = live();
    let (mut to_sink, mut from_blur) = live();

    let (by_capture, depth, blur, sink) = thread::scope(|scope| {
        let (colors, depths, outs) = (&colors, &depths, &outs);
        let capture = scope.spawn(move || {
            let mut stalls = Stalls(1);
            let mut displaced = 0;
            for id in 0..FRAMES {
                let mut color = colors.take();
                *color = id;
                displaced += send(&mut to_depth, Frame { id, color, depth: None });
                stalls.stall(100);
            }
            displaced
        });
        let depth = scope.spawn(move || {
            let mut stalls = Stalls(2);
            let mut displaced = 0;
            let received = receive(&mut from_capture, |frame| {
                let mut depth = depths.take();
                *depth = frame.id;
                stalls.stall(40);
                displaced += send(&mut to_blur, Frame { depth: Some(depth), ..frame });
            });
            (received, displaced)
        });
        let blur = scope.spawn(move || {
            let mut stalls = Stalls(3);
            let mut displaced = 0;
            let received = receive(&mut from_depth, |frame| {
                let mut out = outs.take();
                *out = *frame.color;
                stalls.stall(60);
                displaced += send(&mut to_sink, Frame { id: frame.id, color: out, depth: None });
            });
            (received, displaced)
        });
        let mut stalls = Stalls(4);
        let sink = receive(&mut from_blur, |_| stalls.stall(40));
        (capture.join().unwrap(), depth.join().unwrap(), blur.join().unwrap(), sink)
    });

    let ((read_by_depth, depth_last), by_depth) = depth;
    let ((read_by_blur, blur_last), by_blur) = blur;
    let (delivered, sink_last) = sink;
    println!("{FRAMES} captured, displaced {by_capture} + {by_depth} + {by_blur}, delivered {delivered}");
    assert_eq!(FRAMES, read_by_depth + by_capture);
    assert_eq!(read_by_depth, read_by_blur + by_depth);
    assert_eq!(read_by_blur, delivered + by_blur);
    assert_eq!([depth_last, blur_last, sink_last], [Some(FRAMES - 1); 3], "the newest frame always arrives");
    assert_eq!([colors.free(), depths.free(), outs.free()], [10, 8, 5], "every buffer is home");
}
