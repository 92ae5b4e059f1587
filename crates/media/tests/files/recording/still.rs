//! Single pictures.

use std::fs;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::Photo;
use bokehcam_media::recording::still::{
    read_aperture, read_color, read_depth, read_grey, read_photo, write_color, write_depth, write_photo,
};
use image::{DynamicImage, GrayAlphaImage, ImageBuffer, Luma, Rgb, RgbaImage};
use tempfile::TempDir;

use super::{SIZE, assert_says, crc32, png_that_claims, save_grey};

fn gradient() -> ColorImage {
    let mut image = ColorImage::new(SIZE.0, SIZE.1);
    for (index, byte) in image.rgb.iter_mut().enumerate() {
        *byte = (index / 5) as u8;
    }
    image
}

#[test]
fn colour_of_every_kind_becomes_8_bit_rgb() {
    let dir = TempDir::new().unwrap();
    let save = |image: DynamicImage| {
        let path = dir.path().join("picture.png");
        image.save(&path).unwrap();
        read_color(&path).unwrap()
    };
    let rgb = save(RgbaImage::from_pixel(3, 2, [10, 20, 30, 128].into()).into());
    assert_eq!((rgb.size(), &rgb.rgb[..3]), ((3, 2), &[132, 137, 142][..]), "in front of white");
    assert_eq!(save(GrayAlphaImage::from_pixel(3, 2, [77, 5].into()).into()).rgb, [252; 18]);
    let wide = ImageBuffer::<Luma<u16>, _>::from_pixel(3, 2, [0x8081].into());
    assert_eq!(save(wide.into()).rgb, [0x80; 18]);
    let wide = ImageBuffer::<Rgb<u16>, _>::from_pixel(3, 2, [0, 65535, 300].into());
    assert_eq!(save(wide.into()).rgb[..3], [0, 255, 1]);

    // A palette of two colours, one bit a pixel: red and green, alternating.
    let path = dir.path().join("palette.png");
    fs::write(&path, PALETTE_PNG).unwrap();
    assert_eq!(read_color(&path).unwrap().rgb, [255, 0, 0, 0, 255, 0]);
}

/// 2x1, palette red and green, indices 0 and 1.
const PALETTE_PNG: &[u8] =
    b"\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x02\x00\x00\x00\x01\
    \x01\x03\x00\x00\x00\xce\xec\xed\xc9\x00\x00\x00\x06\x50\x4c\x54\x45\xff\x00\x00\x00\xff\x00\xd2\
    \x87\xef\x71\x00\x00\x00\x0a\x49\x44\x41\x54\x78\x9c\x63\x70\x00\x00\x00\x42\x00\x41\x29\x37\xf4\
    \xef\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82";

#[test]
fn png_keeps_colour_exactly_and_jpeg_nearly() {
    let dir = TempDir::new().unwrap();
    let image = gradient();
    for (name, tolerance) in [("a.png", 0), ("a.PNG", 0), ("a.jpg", 24), ("a.jpeg", 24)] {
        let path = dir.path().join(name);
        write_color(&path, &image, false).unwrap();
        let read = read_color(&path).unwrap();
        assert_eq!(read.size(), image.size());
        let worst = image.rgb.iter().zip(&read.rgb).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(tolerance), "{name}: off by {worst:?}");
    }
    // No other file is left besides the four.
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 4);
}

#[test]
fn nothing_is_overwritten_unless_asked() {
    let dir = TempDir::new().unwrap();
    let (image, depth) = (gradient(), DepthMap::new(4, 3));
    for name in ["a.png", "a.pfm"] {
        let path = dir.path().join(name);
        fs::write(&path, "mine").unwrap();
        assert_says(write_depth(&path, &depth, 5000.0, false), &[name, "exists already"]);
        assert_eq!(fs::read(&path).unwrap(), b"mine");
        write_depth(&path, &depth, 5000.0, true).unwrap();
        assert_eq!(read_depth(&path, 5000.0, None).unwrap(), depth);
    }
    let path = dir.path().join("a.png");
    assert_says(write_color(&path, &image, false), &["a.png", "exists already"]);
    write_color(&path, &image, true).unwrap();
    assert_eq!(read_color(&path).unwrap(), image);
}

#[test]
fn what_cannot_be_written_leaves_nothing() {
    let dir = TempDir::new().unwrap();
    for name in ["a.gif", "a", "a.pfm"] {
        assert_says(
            write_color(&dir.path().join(name), &gradient(), false),
            &[name, "`.png`, `.jpg`, `.tif` or `.webp`"],
        );
    }
    assert_says(write_depth(&dir.path().join("a.jpg"), &DepthMap::new(2, 2), 1.0, false), &["`.png` or `.pfm`"]);
    assert_says(write_color(&dir.path().join("none/a.png"), &gradient(), false), &["cannot write", "none/a.png"]);
    // A folder is in the way, which only the last step detects.
    fs::create_dir_all(dir.path().join("b.png/inside")).unwrap();
    assert_says(write_color(&dir.path().join("b.png"), &gradient(), true), &["cannot write", "b.png"]);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn wrong_pictures_are_told_with_their_name() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("picture.png");
    assert_says(read_color(&path), &["picture.png: there is no such file"]);
    fs::write(&path, png_that_claims(100_000, 100_000)).unwrap();
    assert_says(read_color(&path), &["picture.png: its header claims 100000x100000"]);
    assert_says(read_grey(&path), &["claims 100000x100000"]);
    save_grey(&path, SIZE, 9);
    assert_says(
        read_depth(&path, 5000.0, None),
        &["picture.png: an 8-bit grey picture", "inverse if white is near", "scale:N"],
    );
}

#[test]
fn a_picture_that_lets_no_light_through_is_no_aperture() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("black.png");
    let mut picture = ColorImage::new(5, 5);
    write_color(&file, &picture, false).unwrap();
    let error = read_aperture(&file).unwrap_err().to_string();
    assert!(error.contains("black.png: it is black all over"), "{error}");
    picture.rgb[36] = 200;
    write_color(&file, &picture, true).unwrap();
    assert!(read_aperture(&file).is_ok());
}

#[test]
fn grey_is_luma_as_stored() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("aperture.png");
    let read = |image: DynamicImage| {
        image.save(&path).unwrap();
        let (width, height, grey) = read_grey(&path).unwrap();
        assert_eq!((width, height, grey.len()), (3, 2, 6));
        grey[5]
    };
    assert_eq!(read(image::GrayImage::from_pixel(3, 2, [51].into()).into()), 0.2);
    assert_eq!(read(ImageBuffer::<Luma<u16>, Vec<u16>>::from_pixel(3, 2, [13107].into()).into()), 0.2);
    assert!((read(image::RgbImage::from_pixel(3, 2, [0, 255, 0].into()).into()) - 0.7152).abs() < 1e-6);
    assert!((read(image::RgbImage::from_pixel(3, 2, [255; 3].into()).into()) - 1.0).abs() < 1e-6);
    assert!((read(RgbaImage::from_pixel(3, 2, [255, 255, 255, 51].into()).into()) - 0.2).abs() < 1e-6);
}

/// A photograph records the camera's orientation; the blur must not lose that.
#[test]
fn a_turned_photograph_is_read_upright() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("photo.jpg");
    let mut image = ColorImage::new(32, 16);
    // The left half is white.
    for (index, pixel) in image.rgb.chunks_exact_mut(3).enumerate() {
        pixel.fill(if index % 32 < 16 { 255 } else { 0 });
    }
    write_color(&path, &image, false).unwrap();
    let plain = fs::read(&path).unwrap();
    // EXIF orientation 6: turn by 90 degrees clockwise to stand upright; the left goes to the top.
    let exif = b"\xff\xe1\x00\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    fs::write(&path, [&plain[..2], exif, &plain[2..]].concat()).unwrap();
    let upright = read_color(&path).unwrap();
    assert_eq!(upright.size(), (16, 32));
    assert!(upright.rgb[0] > 250 && upright.rgb[16 * 31 * 3] < 5);
}

/// Builds a PNG of these chunks, each with its checksum.
fn png(chunks: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, data) in chunks {
        let chunk = [&name[..], data].concat();
        file.extend((data.len() as u32).to_be_bytes());
        file.extend(&chunk);
        file.extend(crc32(&chunk).to_be_bytes());
    }
    file
}

/// Returns a zlib stream of stored (uncompressed) blocks.
fn stored(data: &[u8]) -> Vec<u8> {
    let (mut a, mut b) = (1_u32, 0_u32);
    for &byte in data {
        a = (a + u32::from(byte)) % 65521;
        b = (b + a) % 65521;
    }
    let length = data.len() as u16;
    [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes(), data, &(b << 16 | a).to_be_bytes()].concat()
}

/// Rows of an interlaced picture come in seven passes, of which a small picture has fewer.
#[test]
fn an_interlaced_picture_is_put_together() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("interlaced.png");
    for (width, height) in [(11_u32, 9_u32), (5, 3), (1, 1), (1, 6), (3, 1)] {
        let value = |x: u32, y: u32| (1 + x + 100 * y) as u16;
        let mut rows = Vec::new();
        for [x, dx, y, dy] in
            [[0, 8, 0, 8], [4, 8, 0, 8], [0, 4, 4, 8], [2, 4, 0, 4], [0, 2, 2, 4], [1, 2, 0, 2], [0, 1, 1, 2]]
        {
            for y in (y..height).step_by(dy as usize).filter(|_| x < width) {
                rows.push(0);
                rows.extend((x..width).step_by(dx as usize).flat_map(|x| value(x, y).to_be_bytes()));
            }
        }
        let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[16, 0, 0, 0, 1]].concat();
        fs::write(&path, png(&[(b"IHDR", header), (b"IDAT", stored(&rows)), (b"IEND", Vec::new())])).unwrap();
        let depth = read_depth(&path, 1.0, None).unwrap();
        let expected: Vec<f32> = (0..height).flat_map(|y| (0..width).map(move |x| f32::from(value(x, y)))).collect();
        assert_eq!((depth.size(), depth.metres), ((width, height), expected));
        let rgb = read_color(&path).unwrap().rgb;
        let last = (f64::from(value(width - 1, height - 1)) / 257.0).round() as u8;
        assert_eq!(rgb[rgb.len() - 3..], [last; 3]);
    }
}

/// Returns EXIF data of a camera held upright (orientation 6), with a camera name and a thumbnail.
fn exif() -> Vec<u8> {
    let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
        [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count.to_be_bytes(), &value].concat()
    };
    let mut exif = b"MM\0\x2a\0\0\0\x08\0\x02".to_vec();
    exif.extend(entry(0x0110, 2, 4, *b"CAM\0"));
    exif.extend(entry(0x0112, 3, 1, [0, 6, 0, 0]));
    exif.extend(38_u32.to_be_bytes());
    exif.extend(2_u16.to_be_bytes());
    exif.extend(entry(0x0201, 4, 1, 68_u32.to_be_bytes()));
    exif.extend(entry(0x0202, 4, 1, 5_u32.to_be_bytes()));
    exif.extend([0; 4]);
    assert_eq!(exif.len(), 68);
    exif.extend(b"THUMB");
    exif
}

#[test]
fn profile_and_exif_go_with_the_picture() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let mut profile = vec![7; 200];
    profile[16..20].copy_from_slice(b"RGB ");
    let exif = exif();
    let mut image = ColorImage::new(32, 16);
    image.rgb[..48].fill(255);
    let metadata = bokehcam_media::recording::PhotoMetadata {
        icc_profile: Some(profile.clone()),
        exif: Some(exif.clone()),
        ..Default::default()
    };
    write_photo(&path("in.png"), &image, &metadata, false).unwrap();
    write_photo(&path("in.jpg"), &image, &metadata, false).unwrap();
    for (from, to) in [("in.png", "a.png"), ("in.png", "a.jpg"), ("in.jpg", "b.png"), ("in.jpg", "b.jpg")] {
        let (upright, metadata) = read_photo(&path(from)).unwrap();
        assert_eq!((upright.size(), metadata.icc_profile.as_ref()), ((16, 32), Some(&profile)), "{from}");
        write_photo(&path(to), &upright, &metadata.without_thumbnail().for_jpeg(), false).unwrap();
        // Rotated once, not twice.
        let (again, metadata) = read_photo(&path(to)).unwrap();
        assert_eq!(
            (again.size(), metadata.icc_profile, metadata.lost_properties.len()),
            ((16, 32), Some(profile.clone()), 0)
        );
        let kept = metadata.exif.unwrap();
        let camera = |exif: &[u8]| exif.windows(3).any(|part| part == b"CAM");
        assert!(camera(&kept) && !kept.windows(5).any(|part| part == b"THUMB"), "{to}");
        assert_eq!(kept[30..32], [0, 1], "it says that it is upright");
        assert_eq!(kept[34..38], [0; 4], "nothing leads to the thumbnail's directory");
    }
    profile[16..20].copy_from_slice(b"GRAY");
    let grey = bokehcam_media::recording::PhotoMetadata { icc_profile: Some(profile), ..Default::default() };
    write_photo(&path("grey.png"), &image, &grey, false).unwrap();
    let (_, read) = read_photo(&path("grey.png")).unwrap();
    assert_eq!((read.icc_profile, read.lost_properties.len()), (None, 1), "it does not apply to RGB");

    // `lost_properties` names the properties that 8-bit RGB cannot hold.
    let wide = ImageBuffer::<image::Rgba<u16>, _>::from_pixel(2, 2, [1, 2, 3, 4].into());
    DynamicImage::from(wide).save(path("wide.png")).unwrap();
    assert_eq!(read_photo(&path("wide.png")).unwrap().1.lost_properties, ["transparency", "16 bits a channel"]);
    assert!(read_photo(&path("in.png")).unwrap().1.lost_properties.is_empty());
}

#[test]
fn the_size_of_a_heic_picture_is_the_largest_that_it_states() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.heic");
    let property = |(width, height): (u32, u32)| {
        [&b"\0\0\0\x14ispe\0\0\0\0"[..], &width.to_be_bytes(), &height.to_be_bytes()].concat()
    };
    for (sizes, expected) in [
        (&[][..], None),
        (&[(512, 512), (4032, 3024), (320, 240)], Some((4032, 3024))),
        // One beyond the limits.
        (&[(64, 48), (u32::MAX, u32::MAX)], Some((64, 48))),
    ] {
        let properties: Vec<u8> = sizes.iter().copied().flat_map(property).collect();
        fs::write(&path, [&b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"[..], &properties].concat()).unwrap();
        assert_eq!(Photo::read_heic_size(&path), expected);
    }
    assert_eq!(Photo::read_heic_size(&dir.path().join("none.heic")), None);
}

#[test]
fn exif_that_leads_nowhere_is_left_behind() {
    let whole = exif();
    let kept = |exif: &[u8]| {
        let metadata = bokehcam_media::recording::PhotoMetadata { exif: Some(exif.to_vec()), ..Default::default() };
        let kept = metadata.without_thumbnail();
        assert_eq!(kept.lost_properties, if kept.exif.is_some() { &[][..] } else { &["EXIF that is damaged"] });
        kept.exif
    };
    assert!(kept(&whole).is_some());
    // Up to the offset of the thumbnail's directory, it is a directory like any other.
    for length in 0..whole.len() {
        let expected = (10..38).contains(&length).then(|| whole[..length].to_vec());
        assert_eq!(kept(&whole[..length]), expected, "{length} bytes");
    }
    // The thumbnail is there, and leads elsewhere: its directory, its place, its length.
    for at in [34, 48, 60] {
        let mut astray = whole.clone();
        astray[at] = 0x7F;
        assert_eq!(kept(&astray), None, "byte {at}");
    }
}
