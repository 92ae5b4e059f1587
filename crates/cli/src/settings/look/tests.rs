use clap::{Args, Command, FromArgMatches};

use super::*;
use bokehcam::bokeh;
use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{ApertureSetting, CocRule, Effect, Metres, Patch, Privacy, Refine, SETTINGS, Strength, Tilt};
use bokehcam::optics::{CocField, Lens};

const SIZE: (u32, u32) = (640, 450);

fn resolve(flags: &[&str], has_depth: bool) -> Result<Look, CliError> {
    let command = options::Every::augment_args(Command::new("test").no_binary_name(true));
    let matches = command.try_get_matches_from(flags).unwrap();
    let every = options::Every::from_arg_matches(&matches).unwrap();
    let facts = every.blur.depth.look_facts(has_depth, Metres::Known)?;
    RequestedLook::new(&every.blur, &every.computing.quality, &GivenSettings::default())?.fit(None, &facts)
}

fn refusal(flags: &[&str], has_depth: bool) -> String {
    resolve(flags, has_depth).unwrap_err().to_string()
}

#[test]
fn the_effect_follows_what_the_source_has() {
    assert!(resolve(&[], true).unwrap().effect.follows_depth());
    assert_eq!(resolve(&[], false).unwrap().effect, Effect::Blur);
    assert_eq!(resolve(&["--depth=none"], true).unwrap().effect, Effect::Blur);
    assert!(resolve(&["--effect=none"], true).unwrap().blur_settings(SIZE, false).is_none());
    assert!(refusal(&["--effect=dof"], false).contains("the source has none"));
    assert!(refusal(&["--effect=dof", "--depth=none"], true).contains("--depth none"));
}

#[test]
fn the_strength_is_a_share_of_the_height_a_radius_or_a_lens() {
    let rule = |flags: &[&str]| resolve(flags, true).unwrap().coc_rule(SIZE);
    let depth = |flags: &[&str]| match rule(flags) {
        CocRule::Depth { lens, max_coc_px, .. } => match lens.coc_field(2.0, 0.0, SIZE.0, max_coc_px) {
            CocField::Depth(depth) => (depth.coc_at_infinity_px, depth.max_coc_px),
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    assert_eq!(depth(&[]), (10.0, 27.0));
    assert_eq!(depth(&["--coc-at-infinity=40"]), (40.0, 40.0));
    assert_eq!(depth(&["--coc-at-infinity=40", "--max-coc=30"]), (40.0, 30.0));
    assert_eq!(depth(&["--coc-at-infinity=4%"]), (18.0, 27.0));
    assert_eq!(depth(&["--coc-at-infinity=8%"]), (36.0, 36.0));
    assert_eq!(depth(&["--coc-at-infinity=auto", "--max-coc=auto"]), depth(&[]));
    let lens = ["--f-number=2", "--focal-length=50", "--sensor-width=36"];
    assert!((depth(&lens).0 - 5.698).abs() < 1e-2);
    assert!(refusal(&lens[..2], true).contains("--sensor-width"));
    assert!(refusal(&lens, false).contains("--focus METRES"));
    let uniform = CocRule::Fixed(CocField::Uniform { radius_px: 7.0 });
    assert_eq!(rule(&["--effect=blur", "--coc-at-infinity=7"]), uniform);
}

#[test]
fn the_executor_is_made_for_every_radius_that_can_come() {
    let dof = resolve(&["--f-number=2", "--focal-length=50", "--sensor-width=36"], true).unwrap();
    let settings = dof.blur_settings(SIZE, false).unwrap();
    assert_eq!((settings.far_max_px, settings.near_max_px), (27.0, 27.0));
    let blur = resolve(&["--effect=blur", "--coc-at-infinity=7"], false).unwrap().blur_settings(SIZE, false).unwrap();
    assert_eq!((blur.far_max_px, blur.near_max_px), (7.0, 0.0));
}

#[test]
fn tilt_shift_is_sharp_in_its_band_and_strongest_in_the_farthest_corner() {
    for angle in ["0", "30", "-90"] {
        let tilt = format!("--tilt=0.25:0.1:{angle}");
        let blur = resolve(&["--effect=tilt-shift", "--coc-at-infinity=8", &tilt], true).unwrap();
        let CocRule::Fixed(CocField::Ramp(ramp)) = blur.coc_rule(SIZE) else { panic!("no ramp") };
        assert_eq!(ramp.coc_px(320.0, 112.5), 0.0);
        let corners = [(0.0, 0.0), (640.0, 0.0), (0.0, 450.0), (640.0, 450.0)];
        let max_px = corners.map(|(x, y)| ramp.coc_px(x, y)).into_iter().fold(0.0, f32::max);
        assert!((max_px - 8.0).abs() < 1e-3, "{angle}: {max_px}");
    }
}

#[test]
fn the_range_of_focus_reaches_the_lens() {
    let field = |flags: &[&str]| match resolve(flags, true).unwrap().coc_rule(SIZE) {
        CocRule::Depth { lens, range_m, max_coc_px, .. } => match lens.coc_field(2.0, range_m, SIZE.0, max_coc_px) {
            CocField::Depth(depth) => depth,
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    assert_eq!((field(&[]).near_m(), field(&[]).far_m()), (2.0, 2.0));
    let wide = field(&["--focus-range=1"]);
    assert_eq!((wide.near_m(), wide.far_m(), wide.focus_m), (1.5, 2.5, 2.0));
    assert_eq!(field(&["--focus-range=100"]).near_m(), 0.2);
}

/// Returns looks that differ from the default in one field each, in every form of that field.
fn looks(picture: &std::path::Path) -> Vec<Look> {
    bokehcam_live::source::register_look_files();
    let plain = Look::default();
    let mut looks = vec![plain.clone()];
    let mut add = |change: &dyn Fn(&mut Look)| {
        let mut look = plain.clone();
        change(&mut look);
        assert_ne!(look, plain);
        looks.push(look);
    };
    for effect in [Effect::None, Effect::Blur, Effect::TiltShift, Effect::Dof] {
        add(&|look| look.effect = effect);
    }
    // Numbers without a short binary form, large and small ones.
    for number in [0.1, 1.0 / 3.0, 1e-7, 0.3 - 0.1, 1e-40, 0.999_999_94] {
        add(&|look| look.rim = number);
        add(&|look| look.aperture.intensity = -number);
        add(&|look| look.focus = FocusRule::Metres(number.max(DepthMap::MIN_M)));
        add(&|look| look.focus = FocusRule::Point { x: number, y: 1.0 - number });
        add(&|look| look.focus = FocusRule::Track { x: 1.0 - number, y: number });
        add(&|look| look.strength = Strength::Percent(number));
        add(&|look| look.tilt = Tilt { center_y: number, band: 0.0, angle_deg: -360.0 * number });
        add(&|look| look.aperture.shape = Shape::Ring { inner: number });
        add(&|look| {
            look.aperture.shape = Shape::Polygon { blades: 7, rotation_deg: -100.0 * number, curvature: number };
        });
        add(&|look| look.aperture.shape = Shape::Polygon { blades: 16, rotation_deg: 0.0, curvature: number });
    }
    for number in [0.0, 12.0, 1234.5678, 2e4] {
        add(&|look| look.strength = Strength::AtInfinity(number));
        add(&|look| look.max_coc_px = Some(number));
        add(&|look| look.focus_range_m = number + 0.25);
    }
    add(&|look| look.highlights = 999.5);
    add(&|look| {
        look.strength = Strength::Lens(Lens { focal_length_mm: 85.0, f_number: 1.2, sensor_width_mm: 35.9 });
    });
    for shape in [Shape::Heart, Shape::Star { points: 5 }, Shape::Ring { inner: 0.0 }] {
        add(&|look| look.aperture = Aperture { shape: shape.clone(), intensity: 0.5 });
    }
    add(&|look| {
        look.aperture = Aperture { shape: ApertureSetting::Image(picture.to_owned()).load().unwrap(), intensity: -1.0 };
    });
    add(&|look| look.method = bokeh::Method::Gather);
    for privacy in [Privacy::On, Privacy::Off] {
        add(&|look| look.privacy = privacy);
    }
    for refine in [Refine::On, Refine::Off] {
        add(&|look| look.refine = refine);
    }
    for rank in [bokeh::Rank::Terms(1), bokeh::Rank::Terms(16), bokeh::Rank::Full] {
        add(&|look| look.rank = Some(rank));
    }
    for quality in Quality::ALL {
        add(&|look| look.quality = Some(quality));
    }
    looks
}

#[test]
fn the_flags_of_a_look_give_the_look() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a cat's, odd: name.png");
    bokehcam_media::recording::still::write_color(
        &picture,
        &ColorImage { rgb: vec![200; 18], ..ColorImage::new(3, 2) },
        false,
    )
    .unwrap();
    let written = |patch: &Patch| -> Vec<String> {
        patch.values().iter().map(|(name, value)| format!("--{name}={value}")).collect()
    };
    let parsed = |patch: &Patch| {
        let written = written(patch);
        resolve(&written.iter().map(String::as_str).collect::<Vec<_>>(), true).unwrap()
    };
    let looks = looks(&picture);
    let usual = Patch::from_look(&looks[0]);
    let unusual = |look: &Look| Patch::from_look(look).without_equal_values(&usual);
    assert_eq!(resolve(&[], true).unwrap(), looks[0]);
    for (k, look) in looks.iter().enumerate() {
        let flags = unusual(look).values();
        assert_eq!(parsed(&unusual(look)), *look, "{flags:?}");
        assert_eq!(parsed(&Patch::from_look(look)), *look);
        // One change, one setting; a lens is three.
        let count = if matches!(look.strength, Strength::Lens(_)) { 3 } else { flags.len().min(2) };
        assert_eq!(flags.len(), count, "{flags:?}");
        // The difference between any two looks leads from one to the other.
        let other = &looks[(k * 7 + 3) % looks.len()];
        assert_eq!(
            Patch::from_look(look).without_equal_values(&Patch::from_look(other)).apply_to(other).unwrap(),
            *look
        );
        assert_eq!(serde_json::from_str::<Look>(&serde_json::to_string(look).unwrap()).unwrap(), *look);
    }
    let names: Vec<_> = looks.iter().flat_map(|look| Patch::from_look(look).values()).map(|(name, _)| name).collect();
    assert!(SETTINGS.iter().all(|setting| names.contains(&setting.name)));
    assert_eq!(written(&unusual(&Look { rim: 0.1, ..looks[0].clone() })), ["--rim=0.1"]);
}
