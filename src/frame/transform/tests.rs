use super::*;

/// Three columns and two rows, numbered in reading order.
fn numbered() -> DepthMap {
    DepthMap { width: 3, height: 2, metres: (1..=6).map(|k| k as f32).collect(), ..DepthMap::default() }
}

fn transformed(transform: Transform) -> (u32, Vec<f32>) {
    let (from, mut into) = (numbered(), DepthMap::default());
    transform.apply_to_map(&from, from.size(), &mut into);
    (into.width, into.metres)
}

const ALL: [(Rotation, Flip); 12] = {
    let mut all = [(Rotation::None, Flip::None); 12];
    let mut k = 0;
    while k < 12 {
        all[k] = (Rotation::ALL[k / 3], Flip::ALL[k % 3]);
        k += 1;
    }
    all
};

#[test]
fn pictures_are_rotated_clockwise_then_flipped_then_cut() {
    let case = |rotation, flip, area: &str| {
        transformed(Transform { rotation, flip, area: (!area.is_empty()).then(|| area.parse().unwrap()) })
    };
    assert_eq!(case(Rotation::None, Flip::None, ""), (3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(case(Rotation::Quarter, Flip::None, ""), (2, vec![4.0, 1.0, 5.0, 2.0, 6.0, 3.0]));
    assert_eq!(case(Rotation::Half, Flip::None, ""), (3, vec![6.0, 5.0, 4.0, 3.0, 2.0, 1.0]));
    assert_eq!(case(Rotation::ThreeQuarters, Flip::None, ""), (2, vec![3.0, 6.0, 2.0, 5.0, 1.0, 4.0]));
    assert_eq!(case(Rotation::None, Flip::Horizontal, ""), (3, vec![3.0, 2.0, 1.0, 6.0, 5.0, 4.0]));
    assert_eq!(case(Rotation::None, Flip::Vertical, ""), (3, vec![4.0, 5.0, 6.0, 1.0, 2.0, 3.0]));
    assert_eq!(case(Rotation::Quarter, Flip::Horizontal, ""), (2, vec![1.0, 4.0, 2.0, 5.0, 3.0, 6.0]));
    assert_eq!(case(Rotation::Quarter, Flip::None, "1x2+1+1"), (1, vec![2.0, 3.0]));
    assert_eq!(case(Rotation::Half, Flip::Vertical, "2x1+1+0"), (2, vec![2.0, 1.0]));
}

#[test]
fn a_picture_and_its_map_stay_together_at_every_size() {
    for (rotation, flip) in ALL {
        // Larger than a tile, and no multiple of one.
        let mut from = ColorImage::new(170, 141);
        for (at, pixel) in from.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel = [(at % 170) as u8, (at / 170) as u8, 7];
        }
        let metres = from.rgb.as_chunks::<3>().0.iter().map(|[x, y, _]| f32::from(*y) * 170.0 + f32::from(*x));
        let map = DepthMap { width: 170, height: 141, metres: metres.collect(), ..DepthMap::default() };
        let transform = Transform { rotation, flip, area: Some("130x100+2+9".parse().unwrap()) };
        let (mut color, mut turned) = (ColorImage::default(), DepthMap::default());
        transform.apply_to_color(&from, &mut color);
        transform.apply_to_map(&map, from.size(), &mut turned);
        assert_eq!((color.size(), turned.size()), ((130, 100), (130, 100)));
        for (pixel, metres) in color.rgb.as_chunks::<3>().0.iter().zip(&turned.metres) {
            assert_eq!(f32::from(pixel[1]) * 170.0 + f32::from(pixel[0]), *metres, "{rotation:?} {flip:?}");
        }
        // The centre of a pixel is where the pixel is.
        let (x, y) = (30.0, 20.0);
        let point = transform.apply_to_point([(x + 0.5) / 170.0, (y + 0.5) / 141.0], (170, 141));
        if let Some([px, py]) = point {
            let at = (py * 100.0) as usize * 130 + (px * 130.0) as usize;
            assert_eq!(turned.metres[at], y * 170.0 + x, "{rotation:?} {flip:?}");
        }
    }
}

#[test]
fn a_coarser_map_is_cut_where_the_picture_is() {
    let map = DepthMap { width: 8, height: 4, metres: (0..32).map(|k| k as f32).collect(), ..DepthMap::default() };
    let transform = Transform { area: Some("40x20+20+10".parse().unwrap()), ..Transform::default() };
    let mut into = DepthMap::default();
    transform.apply_to_map(&map, (80, 40), &mut into);
    assert_eq!((into.size(), &into.metres[..]), ((4, 2), &[10.0, 11.0, 12.0, 13.0, 18.0, 19.0, 20.0, 21.0][..]));
    let mask = Mask { width: 2, height: 2, alpha: vec![0.0, 0.25, 0.5, 1.0] };
    let cut = Transform { area: Some("1x1+79+39".parse().unwrap()), ..Transform::default() };
    assert_eq!(cut.apply_to_mask(&mask, (80, 40)), Mask { width: 1, height: 1, alpha: vec![1.0] });
}

#[test]
fn an_area_outside_is_refused_with_the_size_of_the_turned_picture() {
    let size = |rotation, area: &str| {
        Transform { rotation, area: Some(area.parse().unwrap()), ..Transform::default() }.output_size((640, 480))
    };
    assert_eq!(size(Rotation::None, "640x480+0+0"), Ok((640, 480)));
    assert_eq!(size(Rotation::Quarter, "480x640+0+0"), Ok((480, 640)));
    assert_eq!(size(Rotation::Quarter, "640x480+0+0"), Err((480, 640)));
    for area in ["641x1+0+0", "1x1+640+0", "1x1+0+480", "2x2+4294967295+0", "4294967295x1+1+0"] {
        assert_eq!(size(Rotation::Half, area), Err((640, 480)), "{area}");
    }
}

#[test]
fn areas_are_read_as_they_are_printed() {
    assert_eq!("1280x720+320+0".parse::<Area>().unwrap().to_string(), "1280x720+320+0");
    for text in ["", "640x480", "640x480+1", "0x1+0+0", "1x0+0+0", "-1x1+0+0", "1x1+-1+0", "1x1++1+0", "1x1+1+0+0"] {
        assert!(text.parse::<Area>().unwrap_err().contains("1280x720+320+180"), "{text}");
    }
}
