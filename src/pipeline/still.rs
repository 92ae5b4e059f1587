//! One picture on its own: the same blur as in a stream, without one.

use super::staging::Staging;
use super::{CocMaker, Finish};
use crate::bokeh::{Bokeh, BokehError, Finished, Job};
use crate::budget::Quality;
use crate::computing::Computing;
use crate::depth::misfit::Misfit;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::look::{Follow, Look, Refine};
use crate::optics::CocField;

/// A depth map for one picture.
pub enum Depth {
    /// As it was measured: with holes, and noise.
    Measured(DepthMap),
    /// As a blur had it.
    Final(DepthMap),
}

/// What `color` is blurred by: the circle of confusion of every pixel, and the depth map if that follows depth. A
/// measured map is returned with its holes filled, and refined if the look asks for it; or where it leaves that open and
/// the map does not fit the picture. What the look puts behind the subject is put into the picture.
///
/// # Errors
/// [`BokehError::NoDepth`] when the blur follows depth and there is none.
pub fn coc_and_depth(
    look: &Look,
    color: &mut ColorImage,
    depth: Option<Depth>,
) -> Result<(CocField, Option<DepthMap>), BokehError> {
    let (finish, mending, map) = match depth {
        Some(Depth::Measured(map)) => {
            let misfit = if look.refine == Refine::Off { None } else { Misfit::of(&map, color) };
            let mending = misfit.and_then(|misfit| misfit.mending(&map, color));
            (Finish::measured(mending.is_some() || look.refines(false)), mending, Some(map))
        }
        Some(Depth::Final(map)) => (Finish::Keep, None, Some(map)),
        None => (Finish::Keep, None, None),
    };
    let mut maker = CocMaker::new(look.coc_rule(color.size()), finish);
    maker.mend(mending.unwrap_or_default());
    match (maker.fixed(), map) {
        (Some(field), _) => Ok((field, None)),
        (None, None) => Err(BokehError::NoDepth),
        (None, Some(mut map)) => {
            let field = maker.make(&mut map, color, 0);
            Staging::new(&Look { follow: Follow::OFF, ..look.clone() }).stage(color, &mut map, &field, 0);
            Ok((field, Some(map)))
        }
    }
}

/// Blurs the picture `color` as `look` says; returns it and what blurred it. It is unchanged where the effect is none.
///
/// # Errors
/// The blur follows depth and there is none, is too wide for the picture, or there is no such GPU.
pub fn blur(
    look: &Look,
    mut color: ColorImage,
    depth: Option<Depth>,
    computing: &Computing,
) -> Result<(ColorImage, String), BokehError> {
    let size = color.size();
    let Some(settings) = look.settings(size, false) else { return Ok((color, "not blurred".to_string())) };
    let (coc, depth) = coc_and_depth(look, &mut color, depth)?;
    let mut bokeh = computing.blur(&settings, size)?;
    Ok((blur_with(&mut *bokeh, settings.quality, color, depth, coc)?, bokeh.describe()))
}

/// Blurs the picture `color` with an executor that has nothing else in hand, by what [`coc_and_depth`] gave.
///
/// # Errors
/// The executor failed.
pub fn blur_with(
    bokeh: &mut dyn Bokeh,
    quality: Quality,
    color: ColorImage,
    depth: Option<DepthMap>,
    coc: CocField,
) -> Result<ColorImage, BokehError> {
    Ok(blur_into(bokeh, quality, (color, ColorImage::default()), depth, coc)?.blurred)
}

/// What comes back from an executor.
pub(super) struct Blurred {
    pub color: ColorImage,
    pub blurred: ColorImage,
    pub depth: Option<DepthMap>,
}

/// The same in memory that comes back: of the picture, of what it becomes, and of its depth.
pub(super) fn blur_into(
    bokeh: &mut dyn Bokeh,
    quality: Quality,
    (color, out): (ColorImage, ColorImage),
    depth: Option<DepthMap>,
    coc: CocField,
) -> Result<Blurred, BokehError> {
    let job = Job::new(Pooled::detached(color), depth.map(Pooled::detached), coc);
    bokeh.submit(Job { quality, out: Pooled::detached(out), ..job })?;
    let Finished { mut picture, mut color, depth, .. } = bokeh.collect(true)?.ok_or(BokehError::Lost)?;
    let blurred = std::mem::take(picture.memory_mut().ok_or(BokehError::Lost)?);
    let depth = depth.map(|mut depth| std::mem::take(&mut *depth));
    Ok(Blurred { color: std::mem::take(&mut *color), blurred, depth })
}
