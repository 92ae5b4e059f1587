//! Damaged and hostile containers.

use std::time::{Duration, Instant};

use bokehcam_media::recording::embedded::find;

use super::containers::*;
use super::{DEPTH_MAP, DISPARITY, RANGE};

/// Places of each container that are damaged.
const PLACES: usize = 200;

/// One container of each kind.
fn containers() -> [Vec<u8>; 4] {
    let map = &maps()[0];
    let items: &[Item] = &[("android/original_image", 0, &jpeg(200)), ("android/depthmap", 0, map)];
    [
        gdepth(RANGE, map),
        gdepth_extended(RANGE, map, &jpeg(200), |pieces| pieces.reverse()),
        dynamic_depth(DEPTH_MAP, 3, items, b"end"),
        multi_picture(false, &[auxiliary(3, DISPARITY)]),
    ]
}

/// Whatever is found is part of the file, and no larger; a fault is one line.
#[track_caller]
fn check(file: &[u8]) {
    match find(file) {
        Ok(Some(depth)) => assert!(depth.map.len() + depth.original.map_or(0, |original| original.len()) <= file.len()),
        Ok(None) => {}
        Err(fault) => assert!(!fault.to_string().contains('\n'), "{fault}"),
    }
}

#[test]
fn damage_anywhere_gives_depth_or_a_fault() {
    for file in containers() {
        let places = (0..PLACES).map(|place| place * file.len() / PLACES);
        for at in places {
            check(&file[..at]);
            for byte in [0, 0xFF, b'<', b'"', b'9', file[at] ^ 1] {
                let mut damaged = file.clone();
                damaged[at] = byte;
                check(&damaged);
            }
            // A length or position of the largest value.
            let mut damaged = file.clone();
            damaged.splice(at..(at + 4).min(file.len()), [0xFF; 4]);
            check(&damaged);
            check(&[&file[..at], &file[at / 2..]].concat());
        }
    }
}

/// What a file claims allocates nothing, and structure is limited before it is parsed.
#[test]
fn hostile_files_are_refused_at_once() {
    let huge_pieces: Vec<_> = (0..8)
        .map(|index: u32| {
            let claim = [u32::MAX.to_be_bytes(), (index << 28).to_be_bytes()].concat();
            let content = [b"http://ns.adobe.com/xmp/extension/\0", GUID.as_bytes(), &claim, b"x"].concat();
            segment(0xE1, &content)
        })
        .collect();
    let attributes: String = (0..7000).map(|index| format!("a{index}=''")).collect::<Vec<_>>().join(" ");
    let nested = "<a>".repeat(9000);
    let entities = "<!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;\">]>";
    let namespace = "xmlns:GDepth=\"http://ns.google.com/photos/1.0/depthmap/\"";
    let strange_guids: Vec<_> = (0..20_000_u32)
        .map(|index| {
            let guid = format!("{index:032}");
            segment(0xE1, &[b"http://ns.adobe.com/xmp/extension/\0", guid.as_bytes(), &[0; 8]].concat())
        })
        .collect();
    let packets = vec![main_xmp(&format!("<x {namespace} {attributes}/>")); 300];
    let files = [
        with_segments(&jpeg(9), &huge_pieces),
        with_segments(&jpeg(9), &strange_guids),
        with_segments(&jpeg(9), &packets),
        with_segments(&jpeg(9), &[main_xmp(&nested)]),
        with_segments(&jpeg(9), &[main_xmp(&format!("{entities}<x {namespace} GDepth:Format='&b;'/>"))]),
        with_segments(&jpeg(9), &extended_xmp(&packet(&attributes.repeat(99), ""), GUID, 60_000)),
        multi_picture(true, &vec![with_segments(&jpeg(3), &packets[..1]); 64]),
        gdepth(RANGE, &vec![0x41; 40_000]),
    ];
    for file in files {
        let started = Instant::now();
        check(&file);
        assert!(started.elapsed() < Duration::from_secs(10), "{:?}", started.elapsed());
    }
}
