//! One picture on its own: the same blur as in a stream, without one.

use super::{CocMaker, Finish};
use crate::bokeh::{BokehError, Job};
use crate::compute::Place;
use crate::computing::Computing;
use crate::depth::agreement::Agreement;
use crate::depth::refine;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{Look, Refine};
use crate::optics::CocField;

/// A depth map for one picture.
pub enum Depth {
    /// As it was measured: with holes, and noise.
    Measured(DepthMap),
    /// As a blur had it.
    Final(DepthMap),
}

/// Why a depth map does not fit its picture as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// Its columns and rows, where it has fewer than the picture.
    pub smaller: Option<(u32, u32)>,
    /// How its outlines and those of the picture lie.
    pub outlines: Agreement,
}

impl Misfit {
    /// Of the measured depth `map` and its picture, if there is any.
    pub fn of(map: &DepthMap, color: &ColorImage) -> Option<Self> {
        let smaller = (map.width < color.width).then(|| map.size());
        let outlines = Agreement::of(map, color);
        let fits = smaller.is_none() && matches!(outlines, Agreement::Meets | Agreement::Unknown);
        (!fits).then_some(Self { smaller, outlines })
    }

    /// Mends what colours cannot, and returns at which scale they may begin to find the outlines
    /// ([`Refiner::from_coarse`](crate::depth::refine::Refiner::from_coarse)); `None`: they do not know.
    fn mend(self, map: &mut DepthMap, color: &ColorImage) -> Option<u32> {
        let mut outlines = self.outlines;
        if let Agreement::Beside { distance_px } = outlines {
            refine::move_outlines(map, distance_px * map.width as i32 / color.width as i32);
            outlines = Agreement::of(map, color);
        }
        // At each scale, edges move by some three pixels.
        let of_size = self.smaller.map_or(1, |(width, _)| color.width.div_ceil(width.max(1)));
        match outlines {
            Agreement::Unrelated => None,
            Agreement::Soft { width_px } => Some(width_px.div_ceil(3).max(of_size)),
            Agreement::Meets | Agreement::Unknown | Agreement::Beside { .. } => Some(of_size),
        }
    }
}

/// What `color` is blurred by: the circle of confusion of every pixel, and the depth map if that follows depth. A
/// measured map is returned with its holes filled, and refined if the look asks for it; or where it leaves that open and
/// the map does not fit the picture.
///
/// # Errors
/// [`BokehError::NoDepth`] when the blur follows depth and there is none.
pub fn coc_and_depth(
    look: &Look,
    color: &ColorImage,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    let (finish, map) = match depth {
        Some(Depth::Measured(mut map)) => {
            let misfit = if look.refine == Refine::Off { None } else { Misfit::of(&map, color) };
            let coarsest = misfit.and_then(|misfit| misfit.mend(&mut map, color));
            let plain = Finish::measured(look.refines(false));
            (coarsest.map_or(plain, |coarsest| Finish::Refine { coarsest }), Some(map))
        }
        Some(Depth::Final(map)) => (Finish::Keep, Some(map)),
        None => (Finish::Keep, None),
    };
    let mut maker = CocMaker::new(look.coc_rule(color.size()), finish);
    match (maker.fixed(), map) {
        (Some(field), _) => Ok((field, None)),
        (None, None) => Err(BokehError::NoDepth),
        (None, Some(mut map)) => Ok((maker.make(&mut map, color, 0), Some(map))),
    }
}

/// Blurs the picture `color` as `look` says; returns it and what blurred it. It is unchanged where the effect is none.
///
/// # Errors
/// The blur follows depth and there is none, is too wide for the picture, or there is no such GPU.
pub fn blur(
    look: &Look,
    color: ColorImage,
    depth: Option<Depth>,
    computing: &Computing,
) -> Result<(ColorImage, String), BokehError> {
    let size = color.size();
    let Some(settings) = look.settings(size, false) else { return Ok((color, "not blurred".to_string())) };
    let (coc, depth) = coc_and_depth(look, &color, depth)?;
    let mut bokeh = computing.blur(&settings, size)?;
    bokeh.submit(Job {
        ticket: 0,
        color: Pooled::detached(color),
        depth: depth.map(Pooled::detached),
        coc,
        quality: settings.quality,
        place: Place::Memory,
        out: Pooled::detached(ColorImage::default()),
    })?;
    let mut finished = bokeh.collect(true)?.ok_or(BokehError::Lost)?;
    let picture = finished.picture.memory_mut().ok_or(BokehError::Lost)?;
    Ok((std::mem::take(picture), bokeh.describe()))
}
