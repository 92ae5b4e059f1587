//! The maximum useful blur radius is the picture's diagonal.

use std::fs;

use bokehcam::bokeh::{self, BokehError, Method, Rank, Settings, aperture::Aperture};
use bokehcam::budget::Quality;
use bokehcam::optics::CocKind;
use bokehcam_media::recording::snapshot::{self, Snapshot};
use bokehcam_media::recording::still;

use crate::program::Home;

#[test]
fn absurd_radii_are_refused_wherever_they_come_from() {
    let home = Home::new().with_photo();
    let range = "from 0 to 20000";
    for more in [&["--coc-at-infinity", "1e9"][..], &["--max-coc", "100000"], &["--coc-at-infinity", "inf"]] {
        let args = ["render", "photo.png", "--out", "out.png", "--effect", "blur"];
        home.run(&[&args[..], more].concat()).refused(2, &[range]);
    }
    home.run(&["bench", "--coc", "1e6"]).refused(2, &[range]);
    fs::write(home.path("c.toml"), "effect = \"blur\"\ncoc-at-infinity = 100000\n").unwrap();
    home.run(&["render", "photo.png", "--config", "c.toml", "--out", "out.png"]).refused(2, &["c.toml:2: ", range]);
    let color = still::read_color(&home.path("photo.png")).unwrap();
    let settings = [("effect", "blur".to_string()), ("coc-at-infinity", "100000".to_string())];
    let shot = Snapshot { picture: &color, sources: Some((&color, None)), settings: &settings, source: "camera" };
    snapshot::save(home.0.path(), "shot", &shot).unwrap();
    home.run(&["render", "--like", "shot.png", "--out", "out.png"]).refused(2, &["--like shot.png", range]);
}

#[test]
fn a_radius_beyond_the_diagonal_is_refused_once_the_size_is_known() {
    let home = Home::new().with_photo();
    let render = |more: &[&str]| {
        let args = ["render", "photo.png", "--out", "out.png", "--backend", "cpu", "--force"];
        home.run(&[&args, more].concat())
    };
    let said = ["a blur radius of 81 px is too large: for pictures of 64x48, use at most 80 px"];
    render(&["--effect", "blur", "--coc-at-infinity", "81"]).refused(2, &said);
    render(&["--depth-map", "depth.png", "--max-coc", "81"]).refused(2, &said);
    for more in [
        &["--effect", "blur", "--coc-at-infinity", "80"][..],
        &["--effect", "tilt-shift", "--coc-at-infinity", "80"],
        // A large CoC at infinity, limited by `--max-coc`.
        &["--depth-map", "depth.png", "--coc-at-infinity", "1000", "--max-coc", "20"],
        &["--depth-map", "depth.png", "--max-coc", "80", "--rank", "full"],
        &["--depth-map", "depth.png", "--max-coc", "80", "--method", "gather"],
        &["--depth-map", "depth.png", "--max-coc", "80", "--quality", "best"],
    ] {
        render(more).done();
    }
}

#[test]
fn the_library_refuses_what_the_command_line_does() {
    let settings = |coc, method, rank, radius_px| Settings {
        coc,
        method,
        aperture: Aperture::default(),
        rim: 0.2,
        rank,
        highlights: 0.0,
        quality: Quality::Balanced,
        adaptive: false,
        reuse: false,
        privacy: false,
        far_max_px: radius_px,
        near_max_px: 0.0,
    };
    let create = |settings: &Settings| bokeh::create_blur(settings, (640, 360), None, Some(1)).map(|_| ());
    for (coc, method, rank, max_px) in [
        (CocKind::Uniform, Method::Layered, None, 735.0),
        (CocKind::Ramp, Method::Layered, None, 735.0),
        (CocKind::Depth, Method::Layered, Some(Rank::Full), 735.0),
        (CocKind::Depth, Method::Gather, None, 512.0),
        (CocKind::Depth, Method::Gather, Some(Rank::Full), 128.0),
    ] {
        for radius_px in [max_px + 1.0, 1e9, f32::INFINITY, f32::NAN] {
            let refused = create(&settings(coc, method, rank, radius_px)).unwrap_err();
            assert!(matches!(refused, BokehError::TooWide { max_px: most, .. } if most == max_px), "{refused}");
            assert!(!refused.to_string().contains('\n'), "{refused}");
        }
        // Without a request, radii are clamped, so memory stays bounded.
        let plan = bokeh::plan::Plan::new(&settings(coc, method, rank, 1e30), 640, 360);
        let bytes: usize = plan.ladder.banks.iter().map(|bank| (bank.horizontal.len() * 2) * 4).sum();
        assert!(bytes < 200 << 20, "{coc:?} {method:?} {rank:?}: {bytes} bytes");
    }
}
