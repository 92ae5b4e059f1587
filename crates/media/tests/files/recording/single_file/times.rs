//! The times of messages: those in their headers, or else those at which they were recorded.

use bokehcam_media::recording::Options;

use super::super::{Scene, times_ns};
use super::{open, unchunked};

/// Returns the times, in milliseconds, of four pictures with depth that were recorded 66 ms apart, and have these seconds and
/// milliseconds in their headers.
fn times_ms(stamps: [[u32; 2]; 4]) -> Vec<u64> {
    let (scene, recorded_ms) = (Scene::new(), [0, 33, 66, 99]);
    let topics = [("/color", "rgb8", 9, &recorded_ms[..]), ("/depth", "16UC1", 8, &recorded_ms[..])];
    let mut file = unchunked(&topics, false);
    for (ms, [seconds, stamp_ms]) in recorded_ms.into_iter().zip(stamps) {
        // The header has the length of a name, and the name, after the time.
        let header = |seconds: u32, ms: u32| [seconds, ms * 1_000_000, 7].map(u32::to_le_bytes).concat();
        let header_from = [header(100, ms), b"camera".to_vec()].concat();
        for _ in topics {
            let at = file.windows(header_from.len()).position(|bytes| bytes == header_from).unwrap();
            file[at..][..12].copy_from_slice(&header(seconds, stamp_ms));
        }
    }
    let recording = open(&scene, "take.mcap", &file, &Options::default()).unwrap();
    assert!(recording.has_depth());
    times_ns(&recording).iter().map(|ns| ns / 1_000_000).collect()
}

#[test]
fn times_in_headers_count_unless_they_are_not_set() {
    assert_eq!(times_ms([[5, 0], [5, 40], [5, 80], [5, 120]]), [0, 40, 80, 120]);
    assert_eq!(times_ms([[0, 0], [0, 100], [0, 200], [0, 300]]), [0, 100, 200, 300], "a simulator's clock begins at 0");
    assert_eq!(times_ms([[0, 0], [0, 0], [7, 0], [7, 33]]), [0, 66, 132, 198], "not set");
    let epoch_s = 1_700_000_000;
    let set_later = [[0, 500], [epoch_s, 0], [epoch_s, 33], [epoch_s, 66]];
    assert_eq!(times_ms(set_later), [0, 66, 132, 198], "the first is of another age");
}
