//! Synthetic scenes: procedural layers with CoC in pixels, so that no files have to be shipped.
//!
//! Beyond the picture a surface continues with its border, as a single picture cannot show more; the scene `frame`
//! alone has real content there. Lights brighter than white are clipped in the picture, as by a camera, and in the
//! truth only after they have been spread.

use bokehcam::bokeh::aperture::{Aperture, Shape};
use glam::Vec2;

use super::builder::{BRICK, GREY, LEAF, SKIN, SKY, SceneBuilder, bust_distance, coat_color, face_color};
use super::lens::{Scene, Surface};
use super::picture::Rgb;
use super::texture::{
    Lights, Pattern, Rng, coverage_from_distance, disc_distance, ellipse_distance, pattern_color, premultiply,
    rect_distance, render_texture, stroke_distance,
};

/// Columns and rows of every scene.
pub const SIZE: (usize, usize) = (640, 360);
/// Distance of the focal plane in metres: it only sets the scale of the depth map.
pub const FOCUS_M: f32 = 1.5;

/// A scene by name.
pub struct SceneKind {
    /// Name on the command line.
    pub name: &'static str,
    /// Description.
    pub what: &'static str,
    /// Whether it changes from frame to frame.
    pub moves: bool,
    /// Returns the scene at a frame.
    pub at: fn(usize) -> Scene,
}

/// Every scene.
pub const KINDS: [SceneKind; 17] = [
    static_scene("wall", "a flat wall, 12 px", |_| {
        SceneBuilder::new(14.0).add_wall(12.0, Pattern::Checks(24.0), 1).scene
    }),
    static_scene("slant", "a slanted wall, 2 to 17 px, behind a subject", |_| slant_scene()),
    static_scene("ground", "a ground plane through focus, -11 to 11 px", |_| ground_scene()),
    static_scene("lights", "HDR lights behind and before a subject, 16 px", |_| {
        lights_scene(Shape::Disc, 14, 8.0, (1.5, 3.5))
    }),
    static_scene("hair", "a head with strands of hair before a wall, 12 px", |_| hair_scene()),
    static_scene("fence", "a fence before the subject, -10 px", |_| fence_scene(0)),
    static_scene("depths", "a subject in the middle of three depths, -9, 0 and 11 px", |_| depths_scene()),
    static_scene(
        "overlook",
        "the focus behind two near things that hide each other, -22, -7 and 0 px, and a light",
        |_| overlook_scene(),
    ),
    static_scene("frame", "a near object cut by the frame's edge, -14 px, the world goes on", |_| frame_scene()),
    static_scene("weak", "weak blur, 2 to 4 px", |_| weak_scene()),
    static_scene("strong", "strong blur, 30 px", |_| strong_scene()),
    static_scene("pentagon", "lights and windows through five blades", |_| {
        lights_scene(polygon(5), 25, 1.0, (3.0, 6.0))
    }),
    static_scene("hexagon", "lights and windows through six blades", |_| lights_scene(polygon(6), 36, 1.0, (3.0, 6.0))),
    static_scene("bars", "thin bars at eleven depths, -13 to 15 px", |_| bars_scene()),
    static_scene("street", "a ground plane through focus with things on it, and a wall", |_| street_scene()),
    SceneKind { name: "pan", what: "the fence and the subject in motion", moves: true, at: fence_scene },
    SceneKind {
        name: "sway",
        what: "a head with strands of hair that moves to and fro before a wall",
        moves: true,
        at: sway_scene,
    },
];

const fn static_scene(name: &'static str, what: &'static str, at: fn(usize) -> Scene) -> SceneKind {
    SceneKind { name, what, moves: false, at }
}

fn polygon(blades: u32) -> Shape {
    Shape::Polygon { blades, rotation_deg: 20.0, curvature: 0.0 }
}

/// Returns the colour of a patterned object, in the tint of its seed.
fn object_color(p: Vec2, seed: u32) -> Rgb {
    let tint = [BRICK, LEAF, SKY, GREY, SKIN][seed as usize % 5];
    pattern_color(p, tint, if seed.is_multiple_of(2) { Pattern::Noise } else { Pattern::Stripes(6.0) }, seed)
}

fn slant_scene() -> Scene {
    let builder = SceneBuilder::new(20.0).add_plane(9.5, Vec2::new(15.0 / 640.0, 0.0), |p| {
        premultiply(pattern_color(p, BRICK, Pattern::Checks(20.0), 2), 1.0)
    });
    builder.add_bust(300.0, 3).scene
}

fn ground_scene() -> Scene {
    let floor = |p| premultiply(pattern_color(p, GREY, Pattern::Checks(28.0), 4), 1.0);
    SceneBuilder::new(14.0).add_plane(0.0, Vec2::new(0.0, -22.0 / 360.0), floor).scene
}

/// Returns a string of lights before a subject and lights behind it, up to `brightest` times white and `radius_px`
/// wide.
fn lights_scene(shape: Shape, seed: u64, brightest: f32, radius_px: (f32, f32)) -> Scene {
    let size = Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let behind = Lights::scatter(seed, 40, size, radius_px, (0.2 * brightest, brightest));
    let dark = |p: Vec2, seed| pattern_color(p, SKY, Pattern::Noise, seed).map(|light| 0.3 * light);
    let berries = |p: Vec2| {
        let at = |k: i32| Vec2::new(25.0 + 50.0 * k as f32, 292.0 + 11.0 * k as f32);
        (0..5).map(|k| disc_distance(p, at(k), 4.0)).fold(f32::INFINITY, f32::min)
    };
    let twig = |p: Vec2| stroke_distance(p, Vec2::new(-20.0, 290.0), Vec2::new(260.0, 350.0), 7.0);
    let mut builder = SceneBuilder::new(18.0)
        .add_cutout(16.0, |_| -1.0, |p| behind.composite_over(p, dark(p, seed as u32)))
        .add_bust(330.0, seed as u32 + 1)
        .add_cutout(
            -11.0,
            |p| berries(p).min(twig(p)),
            |p| {
                let is_lit = berries(p) < 0.5;
                if is_lit { [1.0, 0.75, 0.4].map(|c| c * brightest) } else { pattern_color(p, LEAF, Pattern::Noise, 5) }
            },
        );
    builder.scene.aperture = Aperture { shape, intensity: 0.0 };
    builder.scene
}

fn hair_scene() -> Scene {
    moved_hair_scene(0.0)
}

/// Moves back and forth in two seconds.
fn sway_scene(frame: usize) -> Scene {
    moved_hair_scene(24.0 * (frame as f32 * std::f32::consts::TAU / 60.0).sin())
}

fn moved_hair_scene(by: f32) -> Scene {
    let mut rng = Rng::new(6);
    let strands: Vec<[Vec2; 3]> = (0..70)
        .map(|_| {
            let angle = rng.between(-3.3, 0.16);
            let out = Vec2::from_angle(angle) * Vec2::new(62.0, 84.0);
            let bend = Vec2::from_angle(angle + 0.35 * rng.normal());
            let (root, length) = (Vec2::new(320.0, 150.0) + 0.9 * out, rng.between(14.0, 46.0));
            let middle = root + length * 0.6 * Vec2::from_angle(angle);
            [root, middle, middle + length * 0.6 * bend]
        })
        .collect();
    let own = move |p: Vec2| p - Vec2::new(by, 0.0);
    let strand = |p: Vec2| {
        let p = own(p);
        let near = strands.iter().map(|s| stroke_distance(p, s[0], s[1], 1.4).min(stroke_distance(p, s[1], s[2], 0.9)));
        near.fold(f32::INFINITY, f32::min)
    };
    SceneBuilder::new(14.0)
        .add_wall(12.0, Pattern::Checks(16.0), 5)
        .add_moved_bust(320.0, by, 7)
        .add_cutout(0.0, strand, move |p| pattern_color(own(p), [0.3, 0.2, 0.12], Pattern::Noise, 8))
        .scene
}

fn fence_scene(frame: usize) -> Scene {
    let shift = 9.0 * frame as f32;
    let outline = move |p: Vec2| {
        let post = ((p.x + shift).rem_euclid(80.0) - 40.0).abs() - 7.0;
        post.min((p.y - 229.0).abs() - 7.0)
    };
    SceneBuilder::new(12.0)
        .add_wall(10.0, Pattern::Stripes(14.0), 9)
        .add_bust(330.0 + 4.0 * frame as f32, 10)
        .add_cutout(-10.0, outline, move |p| {
            pattern_color(p + Vec2::new(shift, 0.0), GREY, Pattern::Noise, 11).map(|light| 0.4 + 0.6 * light)
        })
        .scene
}

fn depths_scene() -> Scene {
    let mut rng = Rng::new(12);
    let blobs: Vec<(Vec2, Vec2)> = (0..7)
        .map(|_| {
            let at = Vec2::new(rng.between(0.0, 640.0), rng.between(60.0, 360.0));
            (at, Vec2::new(rng.between(12.0, 50.0), rng.between(12.0, 50.0)))
        })
        .collect();
    let near = |p: Vec2| blobs.iter().map(|&(at, radii)| ellipse_distance(p, at, radii)).fold(f32::INFINITY, f32::min);
    SceneBuilder::new(13.0)
        .add_wall(11.0, Pattern::Checks(18.0), 13)
        .add_bust(320.0, 14)
        .add_cutout(-9.0, near, |p| pattern_color(p, LEAF, Pattern::Stripes(8.0), 15))
        .scene
}

/// Returns a person before a hedge before a far hill in focus, and a bright object elsewhere in the frame.
fn overlook_scene() -> Scene {
    let hedge = |p: Vec2| 190.0 + 14.0 * (p.x / 37.0).sin() + 9.0 * (p.x / 11.0).sin() - p.y;
    SceneBuilder::new(3.0)
        .add_cutout(
            0.0,
            |_| -1.0,
            |p| {
                let lamp = disc_distance(p, Vec2::new(590.0, 40.0), 18.0) < 0.0;
                if lamp { [1.0; 3] } else { pattern_color(p, SKY, Pattern::Noise, 60) }
            },
        )
        .add_cutout(-7.0, hedge, |p| pattern_color(p, LEAF, Pattern::Checks(9.0), 61).map(|light| 0.6 * light))
        .add_cutout(
            -22.0,
            |p| bust_distance(p, 270.0),
            |p| if p.y < 255.0 { face_color(p, 62) } else { coat_color(p, 62) },
        )
        .scene
}

fn frame_scene() -> Scene {
    const MARGIN_PX: usize = 40;
    let mut builder = SceneBuilder::new(14.0).add_wall(10.0, Pattern::Noise, 16).add_bust(360.0, 17);
    let near = render_texture(SIZE, MARGIN_PX, |p| {
        let outline = disc_distance(p, Vec2::new(20.0, 330.0), 130.0).min(rect_distance(
            p,
            Vec2::new(560.0, -99.0),
            Vec2::new(637.0, 150.0),
        ));
        premultiply(pattern_color(p, BRICK, Pattern::Checks(15.0), 18), coverage_from_distance(outline))
    });
    builder.scene.surfaces.push(Surface { coc_px: -14.0, slope: Vec2::ZERO, texture: near, margin_px: MARGIN_PX });
    let wall = render_texture(SIZE, MARGIN_PX, |p| premultiply(pattern_color(p, GREY, Pattern::Noise, 16), 1.0));
    builder.scene.surfaces[0] = Surface { coc_px: 10.0, slope: Vec2::ZERO, texture: wall, margin_px: MARGIN_PX };
    builder.scene
}

fn weak_scene() -> Scene {
    let near = |p: Vec2| {
        disc_distance(p, Vec2::new(120.0, 300.0), 70.0).min(stroke_distance(
            p,
            Vec2::new(420.0, 0.0),
            Vec2::new(600.0, 360.0),
            10.0,
        ))
    };
    SceneBuilder::new(5.0)
        .add_wall(4.0, Pattern::Checks(10.0), 20)
        .add_cutout(2.0, |p| rect_distance(p, Vec2::new(60.0, 60.0), Vec2::new(200.0, 210.0)), |p| object_color(p, 21))
        .add_bust(330.0, 22)
        .add_cutout(-3.0, near, |p| object_color(p, 24))
        .scene
}

fn strong_scene() -> Scene {
    let size = Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let windows = Lights::scatter(26, 25, size, (3.0, 6.0), (0.8, 1.0));
    let near = |p: Vec2| {
        disc_distance(p, Vec2::new(560.0, 330.0), 80.0).min(stroke_distance(
            p,
            Vec2::new(0.0, 60.0),
            Vec2::new(190.0, 0.0),
            16.0,
        ))
    };
    SceneBuilder::new(33.0)
        .add_cutout(30.0, |_| -1.0, |p| windows.composite_over(p, pattern_color(p, BRICK, Pattern::Checks(32.0), 27)))
        .add_bust(300.0, 28)
        .add_cutout(-20.0, near, |p| object_color(p, 30))
        .scene
}

fn bars_scene() -> Scene {
    let mut builder = SceneBuilder::new(18.0).add_wall(16.0, Pattern::Noise, 31);
    for k in 0..11 {
        // Neighbours in the picture are far apart in depth.
        let coc_px = 15.0 - 28.0 * ((k * 7) % 11) as f32 / 10.0;
        let (x, lean, width) = (40.0 + 56.0 * k as f32, 30.0 * ((k % 3) as f32 - 1.0), 6.0 + 3.0 * (k % 4) as f32);
        let outline = move |p| stroke_distance(p, Vec2::new(x - lean, -20.0), Vec2::new(x + lean, 380.0), width);
        builder = builder.add_cutout(coc_px, outline, move |p| object_color(p, 32 + k as u32));
    }
    builder.scene
}

fn street_scene() -> Scene {
    const SLOPE: f32 = -20.0 / 200.0;
    let size = Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let lamps = Lights::scatter(45, 22, Vec2::new(size.x, 130.0), (1.5, 3.0), (0.7, 1.0));
    // The ground meets the wall at row 150 with 12 px, and is in focus at row 270.
    let ground_px = |y: f32| SLOPE * (y - 270.0);
    let middle_px = ground_px(179.5);
    let mut builder = SceneBuilder::new(14.0)
        .add_cutout(
            12.0,
            |_| -1.0,
            |p| lamps.composite_over(p, pattern_color(p, SKY, Pattern::Checks(22.0), 46).map(|light| 0.6 * light)),
        )
        .add_plane(middle_px, Vec2::new(0.0, SLOPE), |p| {
            premultiply(pattern_color(p, GREY, Pattern::Checks(26.0), 47), coverage_from_distance(150.0 - p.y))
        });
    for (k, (x, base, width, height)) in [
        (90.0, 180.0, 22.0, 110.0),
        (210.0, 215.0, 12.0, 150.0),
        (330.0, 270.0, 80.0, 200.0),
        (480.0, 240.0, 16.0, 190.0),
        (560.0, 335.0, 26.0, 250.0),
    ]
    .into_iter()
    .enumerate()
    {
        let outline =
            move |p| rect_distance(p, Vec2::new(x - width / 2.0, base - height), Vec2::new(x + width / 2.0, base));
        builder = builder.add_cutout(ground_px(base), outline, move |p| object_color(p, 48 + k as u32));
    }
    builder.scene
}
