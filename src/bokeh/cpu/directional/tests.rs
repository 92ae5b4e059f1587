use super::super::rows::PlanarRows;
use super::*;
use crate::bokeh::occlusion::DISTANCES_PER_CELL;

const WIDTH: usize = 64;
const HEIGHT: usize = 48;
const NEAR_PX: f32 = 0.0;
const FAR_PX: f32 = 12.0;

/// Makes two surfaces with a straight outline between them, and a bar across that hides them.
fn level(nearer: impl Fn(usize, usize) -> bool, hidden: impl Fn(usize, usize) -> bool) -> Level {
    let mut rows = PlanarRows::<PLANES>::new(WIDTH, HEIGHT, 0);
    let (stride, row_len) = (rows.stride, rows.row_len());
    for (y, row) in rows.data.chunks_exact_mut(row_len).enumerate() {
        for x in (0..WIDTH).filter(|&x| !hidden(x, y)) {
            let (light, coc_px) = if nearer(x, y) { (0.8, NEAR_PX) } else { (0.1, FAR_PX) };
            for (p, value) in [light, light, light, coc_px, 1.0].into_iter().enumerate() {
                row[p * stride + x] = value;
            }
        }
    }
    Level { width: WIDTH, height: HEIGHT, rows }
}

/// Makes silhouettes that uncover every pixel.
fn everywhere() -> Silhouettes {
    let mut silhouettes = Silhouettes::new(PIXEL * WIDTH, PIXEL * HEIGHT);
    let marks = silhouettes.marks(PIXEL * HEIGHT);
    marks.part(0).fill(1e3);
    silhouettes.dilate(DISTANCES_PER_CELL, &mut ThreadPool::new("spread", 1), Arch::new());
    silhouettes
}

fn at(level: &Level, p: usize, x: usize, y: usize) -> f32 {
    level.rows.row(y)[p * level.rows.stride + x]
}

#[test]
fn straight_outlines_run_on_behind_a_bar() {
    let mut directional = DirectionalInpainting::new(WIDTH, HEIGHT);
    let mut workers = ThreadPool::new("fill", 2);
    for degrees in (0..180).step_by(15) {
        let (sin, cos) = f32::to_radians(degrees as f32).sin_cos();
        let (middle_x, middle_y) = (WIDTH as f32 / 2.0, HEIGHT as f32 / 2.0);
        let outline_px = |x: usize, y: usize| (x as f32 + 0.5 - middle_x) * cos + (y as f32 + 0.5 - middle_y) * sin;
        // The bar crosses the outline at a right angle, or at the axis nearest to that.
        let hidden = |x: usize, y: usize| match cos.abs() < sin.abs() {
            true => (28..36).contains(&x),
            false => (20..28).contains(&y),
        };
        let mut level = level(|x, y| outline_px(x, y) < 0.0, hidden);
        directional.fill(&mut level, &everywhere(), &mut workers, Arch::new());
        let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))).filter(|&(x, y)| hidden(x, y));
        let mut wrong = 0;
        for (x, y) in pixels {
            let (known, is_beside) = (at(&level, PLANES - 1, x, y), outline_px(x, y).abs() < 4.0);
            assert!(known == 1.0 || !is_beside, "{degrees} degrees: ({x}, {y}) sees both surfaces");
            if known == 0.0 {
                continue;
            }
            let truth_px = if outline_px(x, y) < 0.0 { NEAR_PX } else { FAR_PX };
            wrong += usize::from((at(&level, 3, x, y) - truth_px).abs() > 1.0);
        }
        // Next to the outline, lines disagree: on average one pixel per side, of the eight that it is hidden for.
        assert!(wrong <= 16, "{degrees} degrees: {wrong} pixels are of the other surface or of neither");
    }
}

#[test]
fn what_is_known_stays_and_so_does_what_sees_no_two_surfaces() {
    let mut workers = ThreadPool::new("fill", 2);
    let mut directional = DirectionalInpainting::new(WIDTH, HEIGHT);
    let hidden = |x: usize, y: usize| (40..44).contains(&x) && y < 20;
    let mut seen = level(|x, _| x < 42, hidden);
    directional.fill(&mut seen, &everywhere(), &mut workers, Arch::new());
    let before = level(|x, _| x < 42, hidden);
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))).filter(|&(x, y)| !hidden(x, y));
    for (x, y) in pixels {
        let same = (0..PLANES).all(|p| at(&seen, p, x, y) == at(&before, p, x, y));
        assert!(same, "({x}, {y})");
    }
    assert!((0..20).all(|y| at(&seen, PLANES - 1, 41, y) == 1.0), "two surfaces are seen from there");
    let mut alone = level(|_, _| true, hidden);
    directional.fill(&mut alone, &everywhere(), &mut workers, Arch::new());
    assert!((0..20).all(|y| at(&alone, PLANES - 1, 41, y) == 0.0), "one surface is seen from there");
    let mut unseen = level(|_, _| true, |_, _| true);
    directional.fill(&mut unseen, &everywhere(), &mut workers, Arch::new());
    assert!((0..HEIGHT).all(|y| (0..WIDTH).all(|x| at(&unseen, PLANES - 1, x, y) == 0.0)));
}
