//! Two pads: which map pairs with which picture, the end of either stream, late buffers, and changes.

use gst::prelude::*;

use crate::common::*;

const SIZE: (u32, u32) = (64, 48);

#[test]
fn without_the_pad_depth_all_is_blurred_and_with_it_the_subject_stays_sharp() {
    let strong = |harness: &gst_check::Harness| harness.element().unwrap().set_property("coc-at-infinity", "6");
    let mut without = harness();
    strong(&without);
    without.set_src_caps(caps("RGB", SIZE));
    without.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    let evenly = bytes(&without.pull().unwrap());
    let mut with = harness();
    strong(&with);
    with.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&with, SIZE);
    depth.push(timed(map(SIZE), 0, 1)).unwrap();
    with.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    let by_depth = bytes(&with.pull().unwrap());
    let change = |blurred: &[u8], x: usize, y: usize| {
        let at = 3 * (y * 64 + x);
        (at..at + 3).map(|at| blurred[at].abs_diff(stripes(SIZE, 0)[at])).max().unwrap()
    };
    assert!(change(&by_depth, 32, 30) < 8 && change(&by_depth, 6, 30) > 40, "what is near is sharp");
    assert!(change(&evenly, 6, 26) > 40 && change(&evenly, 32, 3) > 40, "nobody knows what to keep sharp");
}

#[test]
fn depth_at_half_the_rate_is_used_twice() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&harness, SIZE);
    for index in 0..30 {
        harness.push(timed(stripes(SIZE, index), index, 1)).unwrap();
        if index % 2 == 0 {
            depth.push(timed(map(SIZE), index, 2)).unwrap();
        }
        assert_eq!(harness.pull().unwrap().pts(), Some(index * PERIOD));
    }
    let element = harness.element().unwrap();
    let stats = ["pictures", "maps", "shared-maps", "late", "without-map"].map(|name| stat(&element, name));
    assert_eq!(stats, [30, 15, 15, 0, 0]);
}

#[test]
fn maps_that_come_twice_as_often_are_passed_over() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&harness, SIZE);
    let half = |index: u64| {
        let mut buffer = timed(map(SIZE), 0, 1);
        let inside = buffer.get_mut().unwrap();
        inside.set_pts(index * PERIOD / 2);
        inside.set_duration(PERIOD / 2);
        buffer
    };
    // Pushing maps ahead of the pictures blocks.
    let maps = std::thread::spawn(move || {
        for index in 0..12 {
            // The last one may come after the end of the stream.
            let _ = depth.push(half(index));
        }
        depth
    });
    for index in 0..6 {
        harness.push(timed(stripes(SIZE, index), index, 1)).unwrap();
        harness.pull().unwrap();
    }
    let element = harness.element().unwrap();
    assert_eq!([stat(&element, "maps"), stat(&element, "shared-maps")], [6, 0]);
    harness.push_event(gst::event::Eos::new());
    drop(harness);
    drop(maps.join().unwrap());
}

#[test]
fn after_the_end_of_depth_its_last_map_holds() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&harness, SIZE);
    harness.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    depth.push(timed(map(SIZE), 0, 1)).unwrap();
    harness.pull().unwrap();
    depth.push_event(gst::event::Eos::new());
    for index in 1..5 {
        harness.push(timed(stripes(SIZE, index), index, 1)).unwrap();
        harness.pull().unwrap();
    }
    let element = harness.element().unwrap();
    assert_eq!([stat(&element, "maps"), stat(&element, "shared-maps")], [1, 4]);
    harness.push_event(gst::event::Eos::new());
    assert!(ends(&mut harness));
}

#[test]
fn an_end_of_depth_before_any_map_is_as_if_there_were_no_pad() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&harness, SIZE);
    depth.push_event(gst::event::Eos::new());
    harness.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    let found = bytes(&harness.pull().unwrap());
    let mut without = crate::common::harness();
    without.set_src_caps(caps("RGB", SIZE));
    without.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    assert!(found == bytes(&without.pull().unwrap()));
}

#[test]
fn the_end_of_pictures_is_the_end_though_depth_goes_on() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let mut depth = depth_of(&harness, SIZE);
    harness.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    depth.push(timed(map(SIZE), 0, 1)).unwrap();
    harness.pull().unwrap();
    harness.push_event(gst::event::Eos::new());
    assert!(ends(&mut harness));
}

/// Returns whether the element sends end-of-stream.
fn ends(harness: &mut gst_check::Harness) -> bool {
    std::iter::from_fn(|| harness.pull_event().ok()).take(20).any(|event| event.type_() == gst::EventType::Eos)
}

#[test]
fn pictures_of_another_size_go_on_in_that_size() {
    let mut harness = harness();
    for (index, size) in [(64, 48), (96, 64), (64, 48)].into_iter().enumerate() {
        harness.set_src_caps(caps("RGB", size));
        harness.push(timed(stripes(size, 0), index as u64, 1)).unwrap();
        let blurred = harness.pull().unwrap();
        assert_eq!(blurred.size(), (3 * size.0 * size.1) as usize);
        assert_eq!(harness.sinkpad().unwrap().current_caps().unwrap(), caps("RGB", size));
    }
    harness.set_src_caps(caps("NV12", (64, 48)));
    harness.push(timed(vec![128; 64 * 48 * 3 / 2], 3, 1)).unwrap();
    assert_eq!(harness.pull().unwrap().size(), 64 * 48 * 3 / 2);
}

#[test]
fn depth_of_another_view_is_an_error_that_says_so() {
    let mut harness = harness();
    harness.set_src_caps(caps("RGB", SIZE));
    let bus = gst::Bus::new();
    harness.element().unwrap().set_bus(Some(&bus));
    let mut depth = depth_of(&harness, (32, 48));
    depth.push(timed(map((32, 48)), 0, 1)).unwrap();
    harness.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
    let message = bus.timed_pop_filtered(gst::ClockTime::from_seconds(20), &[gst::MessageType::Error]).unwrap();
    let gst::MessageView::Error(error) = message.view() else { panic!("{message:?}") };
    assert!(error.error().to_string().contains("32x48 pixels does not cover pictures of 64x48"), "{}", error.error());
}

#[test]
fn there_is_one_pad_depth_and_it_can_be_given_back() {
    let harness = harness();
    let element = harness.element().unwrap();
    let pad = element.request_pad_simple("depth").unwrap();
    assert!(element.request_pad_simple("depth").is_none());
    element.release_request_pad(&pad);
    assert!(element.request_pad_simple("depth").is_some());
}

#[test]
fn a_map_means_the_same_in_every_format() {
    let numbers: Vec<u16> = map(SIZE).as_chunks().0.iter().map(|bytes| u16::from_le_bytes(*bytes)).collect();
    let through = |format: &str, scale: f32, bytes_of_map: Vec<u8>| {
        let mut harness = harness();
        harness.element().unwrap().set_property("depth-scale", scale);
        harness.set_src_caps(caps("RGB", SIZE));
        let mut depth = depth_of(&harness, SIZE);
        depth.set_src_caps(caps(format, SIZE));
        depth.push(timed(bytes_of_map, 0, 1)).unwrap();
        harness.push(timed(stripes(SIZE, 0), 0, 1)).unwrap();
        bytes(&harness.pull().unwrap())
    };
    let usual = through("GRAY16_LE", 1000.0, map(SIZE));
    let swapped = numbers.iter().flat_map(|number| (5 * number).to_be_bytes()).collect();
    assert!(through("GRAY16_BE", 5000.0, swapped) == usual);
    let metres = numbers.iter().flat_map(|&number| (f32::from(number) / 1000.0).to_le_bytes()).collect();
    assert!(through("GRAY_F32LE", 1.0, metres) == usual);
}
