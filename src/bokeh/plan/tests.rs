use super::super::aperture::Aperture;
use super::*;
use crate::budget::Quality;
use crate::optics::DepthCoc;

fn settings(coc: CocKind, quality: Quality) -> Settings {
    Settings {
        coc,
        method: Method::Layered,
        aperture: Aperture::default(),
        rim: 0.2,
        rank: None,
        highlights: 0.0,
        quality,
        adaptive: false,
        reuse: false,
        privacy: false,
        far_max_px: 16.0,
        near_max_px: 30.0,
    }
}

/// Splits a frame whose pixels have these CoC.
fn split(plan: &mut Plan, coc_px: impl Iterator<Item = f32>) {
    let lens = DepthCoc { coc_at_infinity_px: 16.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 30.0 };
    let metres: Vec<f32> = coc_px.map(|coc_px| 1.0 / (1.0 - coc_px / 16.0)).collect();
    let depth = DepthMap { width: metres.len() as u32, height: 1, metres, ..DepthMap::default() };
    plan.split_by_depth(Some(&depth), &CocField::Depth(lens));
}

#[test]
fn bins_tile_the_line_front_to_back() {
    for quality in Quality::ALL {
        let mut plan = Plan::new(&settings(CocKind::Depth, quality), 640, 360);
        for spread in [0.01, 0.1, 1.0] {
            split(&mut plan, (0..300).map(|k| (k - 200) as f32 * 0.15 * spread));
            assert!(plan.bins.len() <= MAX_BINS && plan.bins.len() <= plan.slot_count());
            assert_eq!(plan.bins[0].low_px, f32::NEG_INFINITY);
            assert_eq!(plan.bins.last().map(|b| b.high_px), Some(f32::INFINITY));
            assert!(plan.bins.windows(2).all(|w| w[0].high_px == w[1].low_px && w[0].low_px < w[1].low_px));
            assert!(plan.bins.iter().all(|b| plan.bank.nearest_node(b.max_radius_px) < plan.bank.nodes));
            assert!(plan.bins.iter().all(|b| b.scale >= plan.min_scale(b.slot)));
            let mut slots: Vec<usize> = plan.bins.iter().map(|b| b.slot).collect();
            slots.sort_unstable();
            assert!(slots.windows(2).all(|w| w[0] < w[1]));
        }
    }
}

#[test]
fn borders_lie_where_no_pixels_do() {
    let mut plan = Plan::new(&settings(CocKind::Depth, Quality::Balanced), 640, 360);
    // In focus, an object at 6 px, a wall at 11 to 12 px, and something near at -9 px.
    let parts = [(0.0, 100), (6.0, 60), (11.0, 100), (12.0, 100), (-9.0, 40)];
    split(&mut plan, parts.iter().flat_map(|&(coc_px, count)| std::iter::repeat_n(coc_px, count)));
    let borders: Vec<f32> = plan.bins[1..].iter().map(|bin| bin.low_px).collect();
    assert_eq!(borders.len(), 3, "{borders:?}");
    assert!((-9.0..-1.0).contains(&borders[0]), "{borders:?}");
    assert!((1.0..6.0).contains(&borders[1]) && (6.0..11.0).contains(&borders[2]), "{borders:?}");
    split(&mut plan, std::iter::repeat_n(0.2, 100));
    assert_eq!(plan.bins.len(), 1);
}

#[test]
fn one_radius_needs_one_bin() {
    let plan = Plan::new(&settings(CocKind::Uniform, Quality::Balanced), 33, 17);
    assert_eq!(plan.bins.len(), 1);
    assert_eq!((plan.bins[0].scale, plan.bins[0].width, plan.bins[0].height), (4, 9, 5));
}
