use bokehcam::bokeh::{aperture::*, cpu::CpuBokeh, plan::Plan, *};
use bokehcam::frame::*;
use bokehcam::optics::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    // dir quality method cinf rim threads reps outfile size-scale rank
    let dir = &a[1];
    let get = |k: usize, d: &str| a.get(k).cloned().unwrap_or(d.to_string());
    let img = image::open(format!("{dir}/image.png")).unwrap().to_rgb8();
    let d16 = image::open(format!("{dir}/depth.png")).unwrap().to_luma16();
    let txt = std::fs::read_to_string(format!("{dir}/scene.txt")).unwrap();
    let focus: f32 = txt.split_whitespace().nth(1).unwrap().parse().unwrap();
    let (mut w, mut h) = img.dimensions();
    let f: u32 = get(9, "1").parse().unwrap();
    let img =
        if f > 1 { image::imageops::resize(&img, w * f, h * f, image::imageops::FilterType::Triangle) } else { img };
    w *= f;
    h *= f;
    let color = ColorImage { width: w, height: h, rgb: img.into_raw() };
    let depth =
        DepthMap { width: w / f, height: h / f, metres: d16.into_raw().iter().map(|&v| v as f32 / 5000.0).collect() };
    let depth = if f > 1 {
        let mut m = DepthMap::new(w, h);
        for y in 0..h {
            for x in 0..w {
                m.metres[(y * w + x) as usize] = depth.metres[((y / f) * (w / f) + x / f) as usize];
            }
        }
        m
    } else {
        depth
    };
    let cinf: f32 = get(4, "14").parse().unwrap();
    let s = Settings {
        effect: match get(11, "dof").as_str() {
            "blur" => Effect::Blur,
            "dof" => Effect::Dof,
            _ => Effect::TiltShift,
        },
        method: if get(3, "layered") == "layered" { Method::Layered } else { Method::Gather },
        aperture: Aperture::default(),
        rim: get(5, "0.2").parse().unwrap(),
        rank: match get(10, "-").as_str() {
            "-" => None,
            "full" => Some(Rank::Full),
            n => Some(Rank::Terms(n.parse().unwrap())),
        },
        highlights: 0.0,
        quality: get(2, "balanced").parse().unwrap(),
        far_max_px: cinf,
        near_max_px: cinf * 1.5,
    };
    let t0 = std::time::Instant::now();
    let plan = Plan::new(&s, w, h);
    let mut cpu = CpuBokeh::new(plan, Some(get(6, "2").parse().unwrap()));
    eprintln!("setup {:?} {}", t0.elapsed(), cpu.describe());
    let mut out = ColorImage::default();
    let coc = match s.effect {
        Effect::Blur => CocField::Uniform { radius_px: cinf },
        Effect::Dof => CocField::Depth(DepthCoc { coc_at_infinity_px: cinf, focus_m: focus, max_coc_px: cinf * 1.5 }),
        Effect::TiltShift => CocField::Ramp(Ramp {
            normal: glam::Vec2::Y,
            offset_px: h as f32 / 2.0,
            half_band_px: h as f32 * 0.1,
            slope: 0.05,
            max_px: cinf,
        }),
    };
    let reps: usize = get(7, "1").parse().unwrap();
    let mut all: Vec<(f64, PassTimes)> = vec![];
    for _ in 0..reps {
        let t = std::time::Instant::now();
        let p = cpu.blur(&color, Some(&depth), &coc, &mut out).unwrap();
        all.push((t.elapsed().as_secs_f64() * 1e3, p));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let m = &all[reps / 2];
    eprintln!(
        "{w}x{h} median {:.2} ms min {:.2}: {}",
        m.0,
        all[0].0,
        m.1.iter().map(|(n, t)| format!("{n} {:.2}", t.as_secs_f64() * 1e3)).collect::<Vec<_>>().join(", ")
    );
    let o = get(8, "-");
    if o != "-" {
        image::save_buffer(o, &out.rgb, w, h, image::ColorType::Rgb8).unwrap();
    }
}
