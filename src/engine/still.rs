//! One picture on its own: the same blur as in a stream, without one.

use super::{Blur, Images, Input, Origin, Preparation};
use crate::bokeh::BokehError;
use crate::computing::Computing;
use crate::frame::{ColorImage, DepthMap};
use crate::look::Look;
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
    let (depth, mut map) = match depth {
        Some(Depth::Measured(map)) => (Origin::Single, Some(map)),
        Some(Depth::Final(map)) => (Origin::Finished, Some(map)),
        None => (Origin::Finished, None),
    };
    let input = Input { size: color.size(), frames: Some(1), depth, knows_background: true, threads: 1 };
    // All of the picture is shown, wherever its subject is.
    let (field, _) = Preparation::new(look, input).prepare(color, map.as_mut(), 0)?;
    Ok((field, map.filter(|_| matches!(field, CocField::Depth(_)))))
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
    if look.coc_kind().is_none() {
        return Ok((color, "not blurred".to_string()));
    }
    let (coc, depth) = coc_and_depth(look, &mut color, depth)?;
    let (mut blur, mut images) = (Blur::default(), Images { color, depth, ..Images::default() });
    blur.follow(look, (size, false), |settings| computing.blur(settings, size))?;
    blur.blur(&mut images, coc)?;
    let [_, by] = blur.about();
    Ok((images.blurred, by))
}
