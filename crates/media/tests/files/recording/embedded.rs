//! Depth inside photos.

mod colors;
mod containers;
mod damage;

use std::fs;
use std::sync::Arc;

use bokehcam::frame::ColorImage;
use bokehcam::look::Look;
use bokehcam_live::source::Options;
use bokehcam_live::source::photo::read_default_depth;
use bokehcam_media::recording::PictureFault;
use bokehcam_media::recording::embedded::{EmbeddedDepth, Focus, Meaning, find};
use image::ImageFormat;

use self::containers::*;

const RANGE: &str = "GDepth:Format=\"RangeInverse\" GDepth:Near=\"0.5\" GDepth:Far=\"8\"";
const RANGE_INVERSE: Meaning = Meaning::RangeInverse { near: 0.5, far: 8.0 };
const DEPTH_MAP: &str = "DepthMap:Format=\"RangeInverse\" DepthMap:Near=\"0.5\" DepthMap:Far=\"8\" DepthMap:Units=\"Meters\" \
                         DepthMap:DepthURI=\"android/depthmap\" DepthMap:ItemSemantic=\"Depth\"";
const DISPARITY: &str = "<apdi:AuxiliaryImageType>disparity</apdi:AuxiliaryImageType>\
                         <apdi:FloatMinValue>0.5</apdi:FloatMinValue><apdi:FloatMaxValue>2.5</apdi:FloatMaxValue>";
const MATTE: &str = "<apdi:AuxiliaryImageType>depth</apdi:AuxiliaryImageType>\
                     <apdi:AuxiliaryImageSubType>portraiteffectsmatte</apdi:AuxiliaryImageSubType>";

#[track_caller]
fn found(file: &[u8]) -> EmbeddedDepth {
    find(file).unwrap().expect("no depth found")
}

/// Asserts that the file is refused with one line that contains all `parts`.
#[track_caller]
fn assert_refused(file: &[u8], parts: &[&str]) {
    let Err(fault @ PictureFault::EmbeddedDepth { .. }) = find(file) else { panic!("{:?}", find(file)) };
    let message = fault.to_string();
    assert!(!message.contains('\n'), "{message}");
    parts.iter().for_each(|part| assert!(message.contains(part), "{part:?} is not in: {message}"));
}

#[test]
fn values_become_depth_by_the_formula_of_their_kind() {
    for (near, far) in [(0.5, 8.0), (0.1, 50.0), (3.0, 3.0), (6.3, 48.9)] {
        let (inverse, linear) = (Meaning::RangeInverse { near, far }, Meaning::RangeLinear { near, far });
        let (depth, disparity) =
            (Meaning::Depth { min: near, max: far }, Meaning::Disparity { min: 1.0 / far, max: 1.0 / near });
        for step in 0..=10 {
            let depth_m = near + (far - near) * step as f32 / 10.0;
            let share = |share: f32| if near < far { share } else { 0.5 };
            // The encoders of the formats: Dynamic Depth 1.0, "RangeLinear" and "RangeInverse".
            let v_linear = share((depth_m - near) / (far - near));
            let v_inverse = share(far * (depth_m - near) / (depth_m * (far - near)));
            for (meaning, v) in
                [(inverse, v_inverse), (linear, v_linear), (depth, v_linear), (disparity, 1.0 - v_inverse)]
            {
                let error = (meaning.to_depth(v) - depth_m).abs() / depth_m;
                assert!(error < 1e-4, "{meaning:?} of {v}: {} instead of {depth_m}", meaning.to_depth(v));
            }
        }
    }
    // A disparity of 0 is far, but not unknown.
    for min in [0.0, -1.0] {
        let far = Meaning::Disparity { min, max: 2.0 }.to_depth(0.0);
        assert!(far.is_finite() && far > 100.0, "{far}");
    }
}

#[test]
fn gdepth_is_found_in_attributes_and_elements_with_maps_of_every_kind() {
    for map in maps() {
        let expected = EmbeddedDepth {
            kind: "GDepth",
            map: map.clone(),
            meaning: RANGE_INVERSE,
            is_metric: false,
            focus: None,
            original: None,
        };
        assert_eq!(found(&gdepth(RANGE, &map)), expected);
        let data = base64(&map);
        let wrapped: String = data.as_bytes().chunks(76).map(|line| String::from_utf8_lossy(line) + "\n").collect();
        let elements = format!(
            "<GDepth:Far>8.0</GDepth:Far><GDepth:Near> 0.5 </GDepth:Near><GDepth:Format>RangeInverse</GDepth:Format>\
             <GDepth:Data>{wrapped}</GDepth:Data>"
        );
        assert_eq!(found(&with_segments(&jpeg(9), &[main_xmp(&packet("", &elements))])), expected);
        // The prefix is a writer's choice, and the namespace counts.
        let other = packet(&format!("{RANGE} GDepth:Data=\"{data}\""), "")
            .replace("GDepth:", "d:")
            .replace("xmlns:GDepth", "xmlns:d");
        assert_eq!(found(&with_segments(&jpeg(9), &[main_xmp(&other)])), expected);
    }
}

#[test]
fn extended_xmp_is_put_together_in_any_order() {
    let (map, original) = (&maps()[1], jpeg(200));
    let orders: [fn(&mut Vec<Vec<u8>>); 4] =
        [|_| {}, |pieces| pieces.reverse(), |pieces| pieces.rotate_left(3), |pieces| pieces.push(pieces[1].clone())];
    for order in orders {
        let depth = found(&gdepth_extended(RANGE, map, &original, order));
        assert_eq!((&depth.map, depth.original.as_ref()), (map, Some(&original)));
    }
    // Pieces of another packet, which an editor left behind, do not count.
    let stray = extended_xmp(&packet(RANGE, ""), "FFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFF", 64);
    let file = with_segments(&gdepth_extended(RANGE, map, &original, |_| {}), &stray);
    assert_eq!(&found(&file).map, map);
}

#[test]
fn units_and_focus_are_those_of_the_file() {
    let map = &maps()[0];
    let depth = |attributes: &str| found(&gdepth(&format!("{RANGE} {attributes}"), map));
    for (units, is_metric, meaning) in [
        ("", false, RANGE_INVERSE),
        ("GDepth:Units=\"m\"", true, RANGE_INVERSE),
        ("GDepth:Units=\"mm\"", true, Meaning::RangeInverse { near: 0.0005, far: 0.008 }),
        ("GDepth:Units=\"ells\"", false, RANGE_INVERSE),
    ] {
        assert_eq!((depth(units).is_metric, depth(units).meaning), (is_metric, meaning), "{units}");
    }
    for (attributes, focus) in [
        ("GFocus:FocalPointX=\"0.25\" GFocus:FocalPointY=\"0.75\"", Some(Focus::Point { x: 0.25, y: 0.75 })),
        ("GFocus:FocalDistance=\"2.5\"", Some(Focus::Distance(2.5))),
        ("GFocus:FocalPointX=\"7\" GFocus:FocalPointY=\"0.75\" GFocus:FocalDistance=\"3\"", Some(Focus::Distance(3.0))),
        ("GFocus:FocalDistance=\"2500\" GDepth:Units=\"mm\"", Some(Focus::Distance(2.5))),
        ("GFocus:FocalDistance=\"nan\"", None),
        ("GFocus:FocalPointX=\"0.5\"", None),
    ] {
        assert_eq!(depth(attributes).focus, focus, "{attributes}");
    }
    let linear = RANGE.replace("Inverse", "Linear").replace("0.5", "0");
    assert_eq!(found(&gdepth(&linear, map)).meaning, Meaning::RangeLinear { near: 0.0, far: 8.0 });
}

#[test]
fn a_png_may_have_depth_inside() {
    let map = &maps()[2];
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 1, 1);
    let text = packet(&format!("{RANGE} GDepth:Data=\"{}\"", base64(map)), "");
    encoder.add_itxt_chunk("XML:com.adobe.xmp".into(), text).unwrap();
    encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
    assert_eq!(&found(&file).map, map);
}

#[test]
fn dynamic_depth_is_found_after_the_photo() {
    let (confidence, original) = (jpeg(3), jpeg(200));
    for map in &maps() {
        let items: [&[Item]; 3] = [
            &[("android/depthmap", 0, map)],
            &[
                ("android/original_image", 0, &original),
                ("android/depthmap", 5, map),
                ("android/confidencemap", 0, &confidence),
            ],
            &[
                ("android/confidencemap", 7, &confidence),
                ("android/original_image", 3, &original),
                ("android/depthmap", 0, map),
            ],
        ];
        for items in items {
            for (padding, trailer) in [(0, &b""[..]), (11, b""), (0, b"SEFT of another maker")] {
                let depth = found(&dynamic_depth(DEPTH_MAP, padding, items, trailer));
                assert_eq!((depth.kind, &depth.map), ("Dynamic Depth", map));
                assert_eq!((depth.meaning, depth.is_metric), (RANGE_INVERSE, true));
                assert_eq!(depth.original.is_some(), items.len() > 1);
                assert!(depth.original.is_none_or(|found| found == original));
            }
        }
        // Data that the list does not mention, before the items.
        let file = dynamic_depth(DEPTH_MAP, 0, &[("android/depthmap", 0, map)], b"");
        let at = file.len() - map.len();
        let file = [&file[..at], b"a thumbnail", map].concat();
        assert_eq!(&found(&file).map, map);
    }
}

#[test]
fn apple_s_depth_is_found_among_the_pictures() {
    let gain_map =
        auxiliary(1, "<apdi:AuxiliaryImageType>urn:com:apple:photo:2020:aux:hdrgainmap</apdi:AuxiliaryImageType>");
    let (matte, map) = (auxiliary(2, MATTE), auxiliary(3, DISPARITY));
    let orders =
        [vec![map.clone()], vec![gain_map.clone(), matte.clone(), map.clone()], vec![map.clone(), matte.clone()]];
    for pictures in &orders {
        for is_big_endian in [true, false] {
            let depth = found(&multi_picture(is_big_endian, pictures));
            assert_eq!((depth.kind, &depth.map, depth.is_metric), ("Apple", &map, false));
            assert_eq!(depth.meaning, Meaning::Disparity { min: 0.5, max: 2.5 });
        }
    }
    assert_eq!(find(&multi_picture(true, &[gain_map, matte])).unwrap(), None);

    let absolute =
        format!("{}<depthData:Accuracy>absolute</depthData:Accuracy>", DISPARITY.replace("disparity", "depth"));
    let depth = found(&multi_picture(true, &[auxiliary(4, &absolute)]));
    assert_eq!((depth.meaning, depth.is_metric), (Meaning::Depth { min: 0.5, max: 2.5 }, true));
    // `heif-convert --with-aux` writes the auxiliary picture alone.
    assert_eq!(found(&map).meaning, Meaning::Disparity { min: 0.5, max: 2.5 });
}

#[test]
fn what_has_no_depth_is_no_fault() {
    let rights = with_segments(&jpeg(9), &[main_xmp(&packet("", "<dc:rights xmlns:dc=\"d\">me</dc:rights>"))]);
    let broken_rights = with_segments(&jpeg(9), &[main_xmp("<x:xmpmeta><not closed")]);
    let png = encode(image::GrayImage::new(2, 2), ImageFormat::Png);
    for file in [&rights, &broken_rights, &png, &jpeg(9), &b"GIF89a".to_vec(), &vec![], &vec![0xFF, 0xD8, 0xFF]] {
        assert_eq!(find(file).unwrap(), None);
    }
    // An index whose pictures a program has dropped: previews of cameras, and the gain map of a phone.
    let index_only = |kind: u32| {
        let picture = auxiliary(3, DISPARITY);
        let mut file = multi_picture(true, std::slice::from_ref(&picture));
        file.truncate(file.len() - picture.len());
        let size = (picture.len() as u32).to_be_bytes();
        let entry = [&[0; 4], &size[..]].concat();
        let at = file.windows(8).position(|bytes| bytes == entry).unwrap();
        file[at..at + 4].copy_from_slice(&kind.to_be_bytes());
        file
    };
    let namespace = "xmlns:hdrgm=\"http://ns.adobe.com/hdr-gain-map/1.0/\"";
    let gain_map = main_xmp(&packet(&format!("{namespace} hdrgm:Version=\"1.0\""), ""));
    let with_gain_map = with_segments(&index_only(0), &[gain_map]);
    for file in [index_only(0x1_0001), index_only(0x1_0002), index_only(0x8002_0003), with_gain_map] {
        assert_eq!(find(&file).unwrap(), None);
    }
    assert_refused(&index_only(0), &["Apple", "cut off or missing"]);
}

#[test]
fn a_claim_that_does_not_hold_is_told() {
    let map = &maps()[0];
    let stripped = with_segments(&jpeg(9), &[main_xmp(&packet(RANGE, ""))]);
    assert_refused(&stripped, &["GDepth", "its data is not in the file", "use the file as the phone saved it"]);
    let lost = gdepth_extended(RANGE, map, &jpeg(1), |pieces| drop(pieces.remove(2)));
    assert_refused(&lost, &["pieces of its Extended XMP are missing"]);
    assert_refused(&gdepth(RANGE, &map[..map.len() / 2]), &["not a whole PNG or JPEG"]);
    assert_refused(&gdepth(RANGE, b"BM of Windows"), &["not a whole PNG or JPEG"]);
    for (from, to, part) in [
        ("RangeInverse", "Parabolic", "its format is \"Parabolic\""),
        ("GDepth:Near=\"0.5\"", "", "Near and Far are not stated"),
        ("\"8\"", "\"inf\"", "Near and Far are not stated, or no numbers"),
        ("\"8\"", "\"0.25\"", "its range is 0.5 to 0.25"),
        ("\"0.5\"", "\"0\"", "its range is 0 to 8"),
        ("\"8\"", "\"8\" /", "damaged XML"),
    ] {
        assert_refused(&gdepth(&RANGE.replace(from, to), map), &[part]);
    }

    let items: &[Item] = &[("android/depthmap", 0, map)];
    let dynamic = |depth_map: &str| dynamic_depth(depth_map, 0, items, b"");
    let short = dynamic(DEPTH_MAP);
    assert_refused(&short[..short.len() - map.len()], &["Dynamic Depth", "its picture is not where the list"]);
    assert_refused(&short[..short.len() - 1], &["its picture is not where the list"]);
    assert_refused(&dynamic_depth(DEPTH_MAP, 0, &[("android/confidencemap", 0, map)], b""), &["no depth map"]);
    assert_refused(&dynamic(&DEPTH_MAP.replace("Meters", "Diopters")), &["dioptres"]);
    assert_refused(&dynamic(&DEPTH_MAP.replace("DepthMap:Far=\"8\"", "")), &["Near and Far are not stated"]);

    // An auxiliary picture that is cut off or elsewhere, and only one of two.
    let (matte, map) = (auxiliary(2, MATTE), auxiliary(3, DISPARITY));
    let cut = multi_picture(true, &[matte.clone(), map.clone()]);
    let moved = multi_picture(true, std::slice::from_ref(&map));
    let end = moved.len() - map.len();
    for file in [&cut[..cut.len() - 1], &[&moved[..end], b"ten bytes.", &map].concat()] {
        assert_refused(file, &["Apple", "a picture that the file lists after the photo is cut off or missing"]);
    }
    for (from, to, part) in [
        ("FloatMaxValue>2.5", "FloatMaxValue>many", "FloatMaxValue) is not stated"),
        ("0.5", "3", "its range is 3 to 2.5"),
        ("2.5", "1e30", "its range"),
    ] {
        assert_refused(&multi_picture(true, &[auxiliary(3, &DISPARITY.replace(from, to))]), &["Apple", part]);
    }
}

/// An original that is damaged costs the original, not the depth.
#[test]
fn a_damaged_original_is_left_out() {
    let (map, original) = (&maps()[0], jpeg(200));
    let depth = found(&gdepth_extended(RANGE, map, &original[..original.len() - 9], |_| {}));
    assert_eq!((&depth.map, depth.original), (map, None));
    let damaged = &original[..original.len() - 2];
    let items: &[Item] = &[("android/original_image", 0, damaged), ("android/depthmap", 0, map)];
    let depth = found(&dynamic_depth(DEPTH_MAP, 0, items, b""));
    assert_eq!((&depth.map, depth.original), (map, None));
    // A file of both kinds whose better one is broken has the other one.
    let both = with_segments(&gdepth(RANGE, map), &[main_xmp(&packet("", &format!("<Camera:DepthMap {DEPTH_MAP}/>")))]);
    assert_eq!((found(&both).kind, &found(&both).map), ("GDepth", map));
}

/// An original of another view than photo and map costs the original; one of another size is used, which is said.
#[test]
fn an_original_has_the_view_of_the_photo_or_of_the_map() {
    let directory = tempfile::TempDir::new().unwrap();
    let path = directory.path().join("photo.jpg");
    // The map has 8x4 pixels, and the photo 16x8.
    for (photo, (width, height), note) in [
        ((16, 8), (16, 8), "inside, and is used"),
        ((16, 8), (32, 16), "inside, and is used: 32x16 pixels, where the photo has 16x8"),
        ((16, 16), (32, 16), "inside, and is used: 32x16 pixels, where the photo has 16x16"),
        (
            (16, 8),
            (24, 24),
            "the original picture inside (GDepth) is left out: its 24x24 pixels have another aspect ratio than the \
             photo (16x8) and its depth (8x4)",
        ),
    ] {
        let original = encode(image::GrayImage::from_pixel(width, height, [200].into()), ImageFormat::Png);
        fs::write(&path, gdepth_extended(RANGE, &maps()[1], &original, |_| {})).unwrap();
        let color = Arc::new(ColorImage::new(photo.0, photo.1));
        let (depth, notes) = read_default_depth(&path, &color, &Options::default(), &Look::default()).unwrap();
        assert!(notes.iter().any(|said| said.ends_with(note)), "{note:?} is not in {notes:?}");
        let depth = depth.unwrap();
        let size = depth.original.map(|original| original.size());
        assert_eq!(size, (width != height).then_some((width, height)), "{notes:?}");
        assert_eq!(depth.map.size(), (8, 4));
    }
}

/// The seeds for fuzzing come from another writer: Pillow, and a script after the formats' documents.
#[test]
fn files_of_another_writer_are_read() {
    let seed = |name: &str| std::fs::read(format!("../../fuzz/seeds/embedded_depth/{name}.jpg")).unwrap();
    for (name, kind, meaning, is_metric, has_original) in [
        ("gdepth", "GDepth", Meaning::RangeInverse { near: 12.5, far: 67.25 }, false, true),
        ("dynamic", "Dynamic Depth", Meaning::RangeInverse { near: 0.7, far: 9.25 }, true, true),
        ("apple", "Apple", Meaning::Disparity { min: 0.360596, max: 1.800781 }, false, false),
    ] {
        let depth = found(&seed(name));
        assert_eq!((depth.kind, depth.meaning, depth.is_metric), (kind, meaning, is_metric));
        assert_eq!(depth.focus, (name == "gdepth").then_some(Focus::Point { x: 0.298, y: 0.532 }));
        let map = image::load_from_memory(&depth.map).unwrap().into_luma8();
        let near = |value: u8, expected: u8| value.abs_diff(expected) < 8;
        assert!(map.dimensions() == (2, 2) && near(map.as_raw()[0], 0) && near(map.as_raw()[1], 255), "{map:?}");
        let original = depth.original.map(|original| image::load_from_memory(&original).unwrap());
        assert_eq!(original.map(|original| (original.width(), original.height())), has_original.then_some((2, 2)));
    }
}
