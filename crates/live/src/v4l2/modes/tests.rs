use super::*;

fn every(numerator: u32, denominator: u32) -> Interval {
    Interval { numerator, denominator }
}

#[test]
fn rates_are_found_by_ratio_and_written_as_people_do() {
    assert_eq!(every(1, 30).to_string(), "30");
    assert_eq!(every(1001, 30_000).to_string(), "29.97");
    assert_eq!(every(333_333, 10_000_000).to_string(), "30");
    assert_eq!(every(2, 15).to_string(), "7.5");
    let offered = Rates::Discrete(vec![every(1, 60), every(333_333, 10_000_000), every(1, 15)]);
    assert_eq!(offered.nearest_interval(every(1, 30)), Some(every(333_333, 10_000_000)));
    assert_eq!(offered.nearest_interval(every(1, 120)), Some(every(1, 60)));
    assert_eq!(Rates::Unknown.nearest_interval(every(1, 30)), None);
    let range = Rates::Range { shortest: every(1, 60), longest: every(1, 5) };
    assert_eq!(range.nearest_interval(every(1, 25)), Some(every(1, 25)));
    assert_eq!(range.nearest_interval(every(1, 1)), Some(every(1, 5)));
    assert_eq!(range.to_string(), "5 to 60 fps");
}

#[test]
fn a_fraction_without_a_part_is_no_rate() {
    let told = |numerator, denominator| Interval::new(sys::v4l2_fract { numerator, denominator });
    assert_eq!([told(1, 30), told(2, 1)], [Some(every(1, 30)), Some(every(2, 1))]);
    assert_eq!([told(0, 30), told(1, 0)], [None, None]);
}

#[test]
fn a_rate_becomes_the_fraction_that_drivers_use() {
    for (fps, expected) in [
        (30.0, every(1, 30)),
        (29.97, every(1001, 30_000)),
        (59.94, every(1001, 60_000)),
        (7.5, every(1000, 7500)),
        (12.5, every(1000, 12_500)),
        (0.1, every(1000, 100)),
    ] {
        assert_eq!(Interval::from_fps(fps), expected, "{fps}");
    }
    assert_eq!(every(1, 30).period_ns(), 33_333_333);
}

#[test]
fn a_grid_of_sizes_stays_a_grid() {
    let mut entry = zeroed::<sys::v4l2_frmsizeenum>();
    entry.type_ = sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_CONTINUOUS;
    entry.__bindgen_anon_1.stepwise = sys::v4l2_frmsize_stepwise {
        min_width: 2,
        max_width: 8192,
        step_width: 0,
        min_height: 1,
        max_height: 8192,
        step_height: 0,
    };
    let Some(SizeEntry::Range { min_px, max_px, step_px }) = parse_size_entry(&entry) else { panic!("no range") };
    assert_eq!((min_px, max_px, step_px), ((2, 1), (8192, 8192), (1, 1)));
    entry.type_ = 77;
    assert!(parse_size_entry(&entry).is_none());
    let empty = zeroed::<sys::v4l2_frmsizeenum>();
    assert!(parse_size_entry(&empty).is_none());
}

#[test]
fn a_size_has_columns_and_rows() {
    let told = |width, height| {
        let mut entry = zeroed::<sys::v4l2_frmsizeenum>();
        entry.type_ = sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_DISCRETE;
        entry.__bindgen_anon_1.discrete = sys::v4l2_frmsize_discrete { width, height };
        match parse_size_entry(&entry) {
            Some(SizeEntry::One(size)) => Some(size),
            _ => None,
        }
    };
    assert_eq!([told(1, 1), told(0, 1), told(1, 0)], [Some((1, 1)), None, None]);
}

#[test]
fn a_list_of_modes_can_be_read_by_people_and_programs() {
    let rates = Rates::Discrete(vec![every(1, 30), every(1, 15)]);
    let sizes = Sizes::Discrete(vec![SizeModes { size_px: (1280, 720), rates }]);
    assert_eq!(sizes.to_string(), "1280x720 (30, 15 fps)");
    let json = serde_json::to_value(&sizes).unwrap();
    assert_eq!(json["discrete"][0]["size_px"], serde_json::json!([1280, 720]));
    assert_eq!(json["discrete"][0]["rates"]["discrete"][1]["fps"], 15.0);
}
