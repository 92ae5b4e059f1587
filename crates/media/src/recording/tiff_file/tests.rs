use std::fs;

use tempfile::TempDir;

use super::super::Photo;
use super::*;

/// Returns big-endian EXIF with an entry of each directory.
fn exif() -> Vec<u8> {
    let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
        [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count.to_be_bytes(), &value].concat()
    };
    let own = [
        entry(256, 4, 1, [0, 0, 0, 9]),
        entry(271, 2, 4, *b"CAM\0"),
        entry(0x8769, 4, 1, [0, 0, 0, 62]),
        entry(0x8825, 4, 1, [0, 0, 0, 80]),
    ];
    let [exposure, position] = [entry(33434, 5, 1, [0, 0, 0, 98]), entry(1, 2, 2, *b"N\0\0\0")];
    let head = [&b"MM\0*\0\0\0\x08\0\x04"[..], &own.concat(), &[0; 4]].concat();
    assert_eq!(head.len(), 62);
    [&head[..], &[0, 1], &exposure, &[0; 4], &[0, 1], &position, &[0; 4], &[0, 0, 0, 1, 0, 0, 0, 250]].concat()
}

#[test]
fn exif_survives_the_way_through_a_tiff() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.tif");
    let mut photo = Photo { alpha: Some(vec![0, 65535]), ..Photo::default() };
    photo.color.resize(2, 1);
    photo.metadata.exif = Some(exif());
    photo.metadata.icc_profile = Some([&[7; 16][..], b"RGB ", &[7; 200]].concat());
    let (alpha, profile) = (photo.alpha.clone(), photo.metadata.icc_profile.clone());
    photo.write(&path, false).unwrap();
    let read = |path: &std::path::Path| Photo::read(path).unwrap().metadata.exif.unwrap();
    let first = Exif::parse(&read(&path)).unwrap();
    assert_eq!(first.descriptive, [(Tag::Make, Type::ASCII, b"CAM\0".to_vec())]);
    let [(_, exposure), (_, position)] = &first.directories;
    let seconds = [1_u32, 250].map(u32::to_ne_bytes).concat();
    assert_eq!(exposure, &[(Tag::Unknown(33434), Type::RATIONAL, seconds)]);
    assert_eq!(position, &[(Tag::Unknown(1), Type::ASCII, b"N\0".to_vec())]);
    // Again, by what was read.
    Photo::read(&path).unwrap().write(&path, true).unwrap();
    assert_eq!(Exif::parse(&read(&path)).unwrap().encode().unwrap(), first.encode().unwrap());
    let again = Photo::read(&path).unwrap();
    assert_eq!((again.alpha, again.metadata.icc_profile), (alpha, profile));
}

#[test]
fn exif_that_leads_nowhere_is_left_out() {
    let whole = exif();
    for length in 0..whole.len() {
        if let Some(exif) = Exif::parse(&whole[..length]) {
            exif.encode().unwrap();
        }
    }
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0xFF;
        if let Some(exif) = Exif::parse(&damaged) {
            exif.encode().unwrap();
        }
    }
    // 60000 entries that all claim a million bytes.
    let entry = [&[1, 15, 0, 1, 0, 15, 0x42, 0x40][..], &[0; 4]].concat();
    let greedy = [&b"MM\0*\0\0\0\x08\xEA\x60"[..], &entry.repeat(60_000), &vec![0; 1 << 20]].concat();
    let read = Exif::parse(&greedy).unwrap();
    assert!(read.descriptive.iter().map(|entry| entry.2.len()).sum::<usize>() <= MAX_BYTES);
}

#[test]
fn colours_that_are_multiplied_by_alpha_are_divided_again() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.tif");
    for (extra, expected) in
        [(ExtraSamples::AssociatedAlpha, [200, 100, 255, 200]), (ExtraSamples::UnassociatedAlpha, [100, 50, 200, 100])]
    {
        let mut file = Vec::new();
        let mut encoder = TiffEncoder::new(Cursor::new(&mut file)).unwrap();
        let mut image = encoder.new_image::<colortype::RGBA8>(2, 1).unwrap();
        image.encoder().write_tag(Tag::ExtraSamples, &[extra][..]).unwrap();
        image.write_data(&[100, 50, 200, 128, 9, 9, 9, 0]).unwrap();
        fs::write(&path, file).unwrap();
        let photo = Photo::read(&path).unwrap();
        // The second pixel is hidden.
        let found = [0, 1, 2, 3].map(|k| photo.color.rgb[k]);
        let is_near = found.iter().zip(expected).all(|(found, expected): (&u8, u8)| found.abs_diff(expected) <= 1);
        assert!(is_near, "{found:?}");
        assert_eq!(photo.alpha, Some(vec![128 * 257, 0]));
    }
}
