//! Synthetic scenes: procedural layers with CoC in pixels, so that no files have to be shipped.
//!
//! Beyond the picture a surface continues with its border, as a single picture cannot show more; the scene `frame`
//! alone has real content there. Lights brighter than white are clipped in the picture, as by a camera, and in the
//! truth only after they have been spread.

use bokehcam::bokeh::aperture::{Aperture, Shape};
use glam::Vec2;

use super::lens::{Rgba, Scene, Surface};
use super::picture::Rgb;
use super::texture::{Dice, Lights, Pattern, coverage, disc, ellipse, paint, premultiplied, rect, stroke, texture};

/// Columns and rows of every scene.
pub const SIZE: (usize, usize) = (640, 360);
/// Distance of the focal plane in metres: it only sets the scale of the depth map.
pub const FOCUS_M: f32 = 1.5;

/// A scene by name.
pub struct Kind {
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
pub const KINDS: [Kind; 17] = [
    still("wall", "a flat wall, 12 px", |_| Stage::new(14.0).wall(12.0, Pattern::Checks(24.0), 1).scene),
    still("slant", "a slanted wall, 2 to 17 px, behind a subject", |_| slant()),
    still("ground", "a ground plane through focus, -11 to 11 px", |_| ground()),
    still("lights", "HDR lights behind and before a subject, 16 px", |_| lights(Shape::Disc, 14, 8.0, (1.5, 3.5))),
    still("hair", "a head with strands of hair before a wall, 12 px", |_| hair()),
    still("fence", "a fence before the subject, -10 px", |_| fence(0)),
    still("depths", "a subject in the middle of three depths, -9, 0 and 11 px", |_| depths()),
    still("overlook", "the focus behind two near things that hide each other, -22, -7 and 0 px, and a light", |_| {
        overlook()
    }),
    still("frame", "a near object cut by the frame's edge, -14 px, the world goes on", |_| frame()),
    still("weak", "weak blur, 2 to 4 px", |_| weak()),
    still("strong", "strong blur, 30 px", |_| strong()),
    still("pentagon", "lights and windows through five blades", |_| lights(polygon(5), 25, 1.0, (3.0, 6.0))),
    still("hexagon", "lights and windows through six blades", |_| lights(polygon(6), 36, 1.0, (3.0, 6.0))),
    still("bars", "thin bars at eleven depths, -13 to 15 px", |_| bars()),
    still("street", "a ground plane through focus with things on it, and a wall", |_| street()),
    Kind { name: "pan", what: "the fence and the subject in motion", moves: true, at: fence },
    Kind {
        name: "sway",
        what: "a head with strands of hair that moves to and fro before a wall",
        moves: true,
        at: sway,
    },
];

const fn still(name: &'static str, what: &'static str, at: fn(usize) -> Scene) -> Kind {
    Kind { name, what, moves: false, at }
}

const GREY: Rgb = [0.8, 0.8, 0.8];
const BRICK: Rgb = [1.0, 0.62, 0.45];
const SKY: Rgb = [0.5, 0.7, 1.0];
const LEAF: Rgb = [0.5, 0.9, 0.4];
const SKIN: Rgb = [1.0, 0.75, 0.6];

/// A scene being built.
struct Stage {
    scene: Scene,
}

impl Stage {
    fn new(coc_at_infinity_px: f32) -> Self {
        let (width, height) = SIZE;
        let scene = Scene { width, height, coc_at_infinity_px, aperture: Aperture::default(), surfaces: Vec::new() };
        Self { scene }
    }

    /// Adds a plane with its CoC at the picture's centre and the change of the CoC per pixel.
    fn plane(mut self, coc_px: f32, slope: Vec2, of: impl Fn(Vec2) -> Rgba + Sync) -> Self {
        self.scene.surfaces.push(Surface { coc_px, slope, texture: texture(SIZE, 0, of), margin_px: 0 });
        self
    }

    /// Adds a plane that faces the camera, cut to an outline (signed distance, negative inside).
    fn cutout(self, coc_px: f32, outline: impl Fn(Vec2) -> f32 + Sync, color: impl Fn(Vec2) -> Rgb + Sync) -> Self {
        self.plane(coc_px, Vec2::ZERO, |p| {
            let alpha = coverage(outline(p));
            if alpha > 0.0 { premultiplied(color(p), alpha) } else { [0.0; 4] }
        })
    }

    fn wall(self, coc_px: f32, pattern: Pattern, seed: u32) -> Self {
        let tint = [SKY, BRICK, GREY, LEAF][seed as usize % 4];
        self.cutout(coc_px, |_| -1.0, |p| paint(p, tint, pattern, seed))
    }

    /// Adds a head and shoulders in focus.
    fn bust(self, x: f32, seed: u32) -> Self {
        self.moved_bust(x, 0.0, seed)
    }

    /// Adds the same, moved to the right.
    fn moved_bust(self, x: f32, by: f32, seed: u32) -> Self {
        let own = move |p: Vec2| p - Vec2::new(by, 0.0);
        self.cutout(0.0, |p| bust(own(p), x), |p| if p.y < 255.0 { face(own(p), seed) } else { coat(own(p), seed) })
    }
}

fn bust(p: Vec2, x: f32) -> f32 {
    let head = ellipse(p, Vec2::new(x, 150.0), Vec2::new(62.0, 84.0));
    let neck = rect(p, Vec2::new(x - 28.0, 200.0), Vec2::new(x + 28.0, 290.0));
    head.min(neck).min(ellipse(p, Vec2::new(x, 395.0), Vec2::new(165.0, 140.0)))
}

fn face(p: Vec2, seed: u32) -> Rgb {
    paint(p, SKIN, Pattern::Noise, seed)
}

fn coat(p: Vec2, seed: u32) -> Rgb {
    paint(p, [0.5, 0.5, 0.8], Pattern::Stripes(9.0), seed)
}

fn polygon(blades: u32) -> Shape {
    Shape::Polygon { blades, rotation_deg: 20.0, curvature: 0.0 }
}

/// Returns the colour of a patterned object, in the tint of its seed.
fn thing(p: Vec2, seed: u32) -> Rgb {
    let tint = [BRICK, LEAF, SKY, GREY, SKIN][seed as usize % 5];
    paint(p, tint, if seed.is_multiple_of(2) { Pattern::Noise } else { Pattern::Stripes(6.0) }, seed)
}

fn slant() -> Scene {
    let stage = Stage::new(20.0)
        .plane(9.5, Vec2::new(15.0 / 640.0, 0.0), |p| premultiplied(paint(p, BRICK, Pattern::Checks(20.0), 2), 1.0));
    stage.bust(300.0, 3).scene
}

fn ground() -> Scene {
    let floor = |p| premultiplied(paint(p, GREY, Pattern::Checks(28.0), 4), 1.0);
    Stage::new(14.0).plane(0.0, Vec2::new(0.0, -22.0 / 360.0), floor).scene
}

/// Returns a string of lights before a subject and lights behind it, up to `brightest` times white and `radius_px`
/// wide.
fn lights(shape: Shape, seed: u64, brightest: f32, radius_px: (f32, f32)) -> Scene {
    let size = Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let behind = Lights::scattered(seed, 40, size, radius_px, (0.2 * brightest, brightest));
    let dark = |p: Vec2, seed| paint(p, SKY, Pattern::Noise, seed).map(|light| 0.3 * light);
    let berries = |p: Vec2| {
        let at = |k: i32| Vec2::new(25.0 + 50.0 * k as f32, 292.0 + 11.0 * k as f32);
        (0..5).map(|k| disc(p, at(k), 4.0)).fold(f32::INFINITY, f32::min)
    };
    let twig = |p: Vec2| stroke(p, Vec2::new(-20.0, 290.0), Vec2::new(260.0, 350.0), 7.0);
    let mut stage = Stage::new(18.0)
        .cutout(16.0, |_| -1.0, |p| behind.over(p, dark(p, seed as u32)))
        .bust(330.0, seed as u32 + 1)
        .cutout(
            -11.0,
            |p| berries(p).min(twig(p)),
            |p| {
                let is_lit = berries(p) < 0.5;
                if is_lit { [1.0, 0.75, 0.4].map(|c| c * brightest) } else { paint(p, LEAF, Pattern::Noise, 5) }
            },
        );
    stage.scene.aperture = Aperture { shape, intensity: 0.0 };
    stage.scene
}

fn hair() -> Scene {
    moved_hair(0.0)
}

/// Moves back and forth in two seconds.
fn sway(frame: usize) -> Scene {
    moved_hair(24.0 * (frame as f32 * std::f32::consts::TAU / 60.0).sin())
}

fn moved_hair(by: f32) -> Scene {
    let mut dice = Dice::new(6);
    let strands: Vec<[Vec2; 3]> = (0..70)
        .map(|_| {
            let angle = dice.between(-3.3, 0.16);
            let out = Vec2::from_angle(angle) * Vec2::new(62.0, 84.0);
            let bend = Vec2::from_angle(angle + 0.35 * dice.normal());
            let (root, length) = (Vec2::new(320.0, 150.0) + 0.9 * out, dice.between(14.0, 46.0));
            let middle = root + length * 0.6 * Vec2::from_angle(angle);
            [root, middle, middle + length * 0.6 * bend]
        })
        .collect();
    let own = move |p: Vec2| p - Vec2::new(by, 0.0);
    let strand = |p: Vec2| {
        let p = own(p);
        let near = strands.iter().map(|s| stroke(p, s[0], s[1], 1.4).min(stroke(p, s[1], s[2], 0.9)));
        near.fold(f32::INFINITY, f32::min)
    };
    Stage::new(14.0)
        .wall(12.0, Pattern::Checks(16.0), 5)
        .moved_bust(320.0, by, 7)
        .cutout(0.0, strand, move |p| paint(own(p), [0.3, 0.2, 0.12], Pattern::Noise, 8))
        .scene
}

fn fence(frame: usize) -> Scene {
    let shift = 9.0 * frame as f32;
    let outline = move |p: Vec2| {
        let post = ((p.x + shift).rem_euclid(80.0) - 40.0).abs() - 7.0;
        post.min((p.y - 229.0).abs() - 7.0)
    };
    Stage::new(12.0)
        .wall(10.0, Pattern::Stripes(14.0), 9)
        .bust(330.0 + 4.0 * frame as f32, 10)
        .cutout(-10.0, outline, move |p| {
            paint(p + Vec2::new(shift, 0.0), GREY, Pattern::Noise, 11).map(|light| 0.4 + 0.6 * light)
        })
        .scene
}

fn depths() -> Scene {
    let mut dice = Dice::new(12);
    let blobs: Vec<(Vec2, Vec2)> = (0..7)
        .map(|_| {
            let at = Vec2::new(dice.between(0.0, 640.0), dice.between(60.0, 360.0));
            (at, Vec2::new(dice.between(12.0, 50.0), dice.between(12.0, 50.0)))
        })
        .collect();
    let near = |p: Vec2| blobs.iter().map(|&(at, radii)| ellipse(p, at, radii)).fold(f32::INFINITY, f32::min);
    Stage::new(13.0)
        .wall(11.0, Pattern::Checks(18.0), 13)
        .bust(320.0, 14)
        .cutout(-9.0, near, |p| paint(p, LEAF, Pattern::Stripes(8.0), 15))
        .scene
}

/// Returns a person before a hedge before a far hill in focus, and a bright object elsewhere in the frame.
fn overlook() -> Scene {
    let hedge = |p: Vec2| 190.0 + 14.0 * (p.x / 37.0).sin() + 9.0 * (p.x / 11.0).sin() - p.y;
    Stage::new(3.0)
        .cutout(
            0.0,
            |_| -1.0,
            |p| {
                let lamp = disc(p, Vec2::new(590.0, 40.0), 18.0) < 0.0;
                if lamp { [1.0; 3] } else { paint(p, SKY, Pattern::Noise, 60) }
            },
        )
        .cutout(-7.0, hedge, |p| paint(p, LEAF, Pattern::Checks(9.0), 61).map(|light| 0.6 * light))
        .cutout(-22.0, |p| bust(p, 270.0), |p| if p.y < 255.0 { face(p, 62) } else { coat(p, 62) })
        .scene
}

fn frame() -> Scene {
    const MARGIN_PX: usize = 40;
    let mut stage = Stage::new(14.0).wall(10.0, Pattern::Noise, 16).bust(360.0, 17);
    let near = texture(SIZE, MARGIN_PX, |p| {
        let outline =
            disc(p, Vec2::new(20.0, 330.0), 130.0).min(rect(p, Vec2::new(560.0, -99.0), Vec2::new(637.0, 150.0)));
        premultiplied(paint(p, BRICK, Pattern::Checks(15.0), 18), coverage(outline))
    });
    stage.scene.surfaces.push(Surface { coc_px: -14.0, slope: Vec2::ZERO, texture: near, margin_px: MARGIN_PX });
    let wall = texture(SIZE, MARGIN_PX, |p| premultiplied(paint(p, GREY, Pattern::Noise, 16), 1.0));
    stage.scene.surfaces[0] = Surface { coc_px: 10.0, slope: Vec2::ZERO, texture: wall, margin_px: MARGIN_PX };
    stage.scene
}

fn weak() -> Scene {
    let near = |p: Vec2| {
        disc(p, Vec2::new(120.0, 300.0), 70.0).min(stroke(p, Vec2::new(420.0, 0.0), Vec2::new(600.0, 360.0), 10.0))
    };
    Stage::new(5.0)
        .wall(4.0, Pattern::Checks(10.0), 20)
        .cutout(2.0, |p| rect(p, Vec2::new(60.0, 60.0), Vec2::new(200.0, 210.0)), |p| thing(p, 21))
        .bust(330.0, 22)
        .cutout(-3.0, near, |p| thing(p, 24))
        .scene
}

fn strong() -> Scene {
    let size = Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let windows = Lights::scattered(26, 25, size, (3.0, 6.0), (0.8, 1.0));
    let near = |p: Vec2| {
        disc(p, Vec2::new(560.0, 330.0), 80.0).min(stroke(p, Vec2::new(0.0, 60.0), Vec2::new(190.0, 0.0), 16.0))
    };
    Stage::new(33.0)
        .cutout(30.0, |_| -1.0, |p| windows.over(p, paint(p, BRICK, Pattern::Checks(32.0), 27)))
        .bust(300.0, 28)
        .cutout(-20.0, near, |p| thing(p, 30))
        .scene
}

fn bars() -> Scene {
    let mut stage = Stage::new(18.0).wall(16.0, Pattern::Noise, 31);
    for k in 0..11 {
        // Neighbours in the picture are far apart in depth.
        let coc_px = 15.0 - 28.0 * ((k * 7) % 11) as f32 / 10.0;
        let (x, lean, width) = (40.0 + 56.0 * k as f32, 30.0 * ((k % 3) as f32 - 1.0), 6.0 + 3.0 * (k % 4) as f32);
        let outline = move |p| stroke(p, Vec2::new(x - lean, -20.0), Vec2::new(x + lean, 380.0), width);
        stage = stage.cutout(coc_px, outline, move |p| thing(p, 32 + k as u32));
    }
    stage.scene
}

fn street() -> Scene {
    const SLOPE: f32 = -20.0 / 200.0;
    let size = Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
    let lamps = Lights::scattered(45, 22, Vec2::new(size.x, 130.0), (1.5, 3.0), (0.7, 1.0));
    // The ground meets the wall at row 150 with 12 px, and is in focus at row 270.
    let ground_px = |y: f32| SLOPE * (y - 270.0);
    let middle_px = ground_px(179.5);
    let mut stage = Stage::new(14.0)
        .cutout(12.0, |_| -1.0, |p| lamps.over(p, paint(p, SKY, Pattern::Checks(22.0), 46).map(|light| 0.6 * light)))
        .plane(middle_px, Vec2::new(0.0, SLOPE), |p| {
            premultiplied(paint(p, GREY, Pattern::Checks(26.0), 47), coverage(150.0 - p.y))
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
        let outline = move |p| rect(p, Vec2::new(x - width / 2.0, base - height), Vec2::new(x + width / 2.0, base));
        stage = stage.cutout(ground_px(base), outline, move |p| thing(p, 48 + k as u32));
    }
    stage.scene
}
